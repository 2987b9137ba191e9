//! What an implicit front costs a node and step, from small boxes to large ones: `cargo bench -p driftmesh --bench
//! front`.
//!
//! The slides' problem, four steps of .005, with as many rows in both phases together as columns. The figure is a ratio
//! to that at 40 × 40.

use driftmesh::study::{Kind, Source, StefanStudy};
use std::path::Path;
use std::time::Instant;

fn main() -> driftmesh::Result<()> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/stefan-slides.toml");
    let mut first = None;
    println!("| cells | µs a node and step | over that at 40² | iterations a solve | by elimination |");
    println!("| ---: | ---: | ---: | ---: | ---: |");
    for n in [40_usize, 80, 160, 300] {
        let mut source = Source::read(&file)?;
        let cells = format!("grid.cells=[{n}, {}, {}]", n / 2, n / 2);
        for set in [&cells, "front.stepping=\"implicit\"", "time.step=0.005", "time.end=0.02", "time.report=[]"] {
            source.set(set)?;
        }
        let study = StefanStudy::from_source(&source)?;
        let start = Instant::now();
        let (run, failure) = study.compute()?;
        assert!(failure.is_none(), "{failure:?}");
        let (work, nodes) = (run.course.work, (n + 1) * (n + 2));
        let each = 1e6 * start.elapsed().as_secs_f64() / (nodes * work.steps) as f64;
        let iterations = work.work.linear_iterations as f64 / work.work.linear_solves as f64;
        let first = *first.get_or_insert(each);
        println!("| {n}² | {each:.1} | {:.2} | {iterations:.1} | {} |", each / first, work.work.direct_solves());
    }
    Ok(())
}
