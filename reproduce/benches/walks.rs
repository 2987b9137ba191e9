//! Speed of the estimators of interface values: path steps a second, and threads against one thread, in one run.

use driftmesh::meshing::{Estimator, GridWalk, MonteCarlo, ResidualWalk};
use driftmesh_reproduce::InterfaceStep;

fn main() {
    let step = InterfaceStep::case_a(40).expect("case A runs");
    // the fastest of several: the machine is shared
    let seconds = |estimator: &dyn Estimator, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let once = || pool.install(|| step.measure(estimator, 1).expect("an estimate"));
        (0..5).map(|_| once()).min_by(|a, b| a.seconds.total_cmp(&b.seconds)).expect("one of five")
    };
    let estimators: [(&str, &dyn Estimator); 6] = [
        ("Monte Carlo N=1000 M=10", &MonteCarlo::new(1000, 10)),
        ("  antithetic", &MonteCarlo { antithetic: true, ..MonteCarlo::new(1000, 10) }),
        ("  control variate", &MonteCarlo { control_variate: true, ..MonteCarlo::new(1000, 10) }),
        ("  Sobol N=1024 M=8", &MonteCarlo { sobol: true, ..MonteCarlo::new(1024, 8) }),
        ("grid walk N=1000", &GridWalk { walks: 1000, increment: false }),
        ("residual walk, the default", &ResidualWalk::default()),
    ];
    println!(
        "{:28} {:>22} {:>16} {:>22}",
        "41², 225 points, one core", "million steps a second", "µs a point", "2 threads, times faster"
    );
    for (name, estimator) in estimators {
        let (one, two) = (seconds(estimator, 1), seconds(estimator, 2));
        let points = step.points() as f64;
        println!(
            "{name:28} {:>22.1} {:>16.2} {:>22.2}",
            one.evaluations * points / one.seconds * 1e-6,
            one.seconds / points * 1e6,
            one.seconds / two.seconds
        );
    }
}
