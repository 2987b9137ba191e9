//! What a checkpoint costs beside a step: case B on 161 × 161 nodes, with one after every step and without any.
//!
//!     cargo bench -p driftmesh --bench checkpoint

use driftmesh::study::{Begin, Kind, MovingMesh, Source};
use std::path::Path;

const STEPS: usize = 40;

fn main() -> driftmesh::Result<()> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/burgers-b-conservative.toml");
    let place = std::env::temp_dir().join(format!("driftmesh-checkpoint-{}", std::process::id()));
    let seconds = |at: &str| -> driftmesh::Result<f64> {
        let mut source = Source::read(&file)?;
        let end = format!("time.end={}", 0.25 + STEPS as f64 * 1e-3);
        let sets =
            ["grid.cells=[160, 160]", &end, "time.report=[]", "output.report=false", "output.frames.every=1000", at];
        sets.iter().try_for_each(|set| source.set(set))?;
        Ok(MovingMesh::from_source(&source)?.run(&place, Begin::Anew, &mut [])?.summary.seconds.wall)
    };
    // turn by turn, so that both meet the same neighbours on the machine
    let [mut with, mut without] = [f64::INFINITY; 2];
    for _ in 0..5 {
        with = with.min(seconds("output.checkpoint.steps=1")?);
        without = without.min(seconds("output.checkpoint.seconds=1e7")?);
    }
    let [step, checkpoint] = [without, with - without].map(|seconds| 1e3 * seconds / STEPS as f64);
    println!(
        "161 × 161: a step takes {step:.1} ms, a checkpoint {checkpoint:.1} ms, {:.2} of a step",
        checkpoint / step
    );
    let _ = std::fs::remove_dir_all(place);
    Ok(())
}
