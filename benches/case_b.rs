//! Case B, 1000 steps, from start to summary: seconds by part, best of several runs.

use driftmesh::study::{Begin, Kind, MovingMesh, Source};

fn main() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for name in ["burgers-b-conservative", "burgers-b-advective", "burgers-uniform-conservative"] {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("studies/{name}.toml"));
        let study = MovingMesh::from_source(&Source::read(&file).unwrap()).unwrap();
        let out = std::env::temp_dir().join(format!("driftmesh-bench-{}-{name}", std::process::id()));
        let runs = (0..5).map(|_| one.install(|| study.run(&out, Begin::Anew, &mut []).unwrap().summary.seconds));
        let best = runs.min_by(|a, b| a.wall.total_cmp(&b.wall)).unwrap();
        let _ = std::fs::remove_dir_all(&out);
        println!(
            "{name:<30} {:.2} s on one core: mesh {:.2}, pde {:.2}, monitor {:.2}, output {:.2}",
            best.wall, best.parts.mesh, best.parts.pde, best.parts.monitor, best.output
        );
    }
}
