//! Estimators of interface values on one step of case A at t = .75, 41², 4 × 4 subdomains: errors as an independent
//! implementation measured them, work in path steps. `driftmesh reproduce interface-study` prints the whole table.

use driftmesh::Auto;
use driftmesh::meshing::{Estimator, GridWalk, MonteCarlo, ResidualWalk, Strip};
use driftmesh::numerics::linear::Smoother;
use driftmesh_reproduce::{InterfaceStep, Measured};
use std::sync::LazyLock;

static STEP: LazyLock<InterfaceStep> = LazyLock::new(|| InterfaceStep::case_a(40).unwrap());

fn measure(estimator: &dyn Estimator, seeds: u64) -> Measured {
    STEP.measure(estimator, seeds).unwrap()
}

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found / expected - 1.0).abs() <= tolerance, "{found:e}, expected {expected:e} ± {tolerance}");
}

fn jacobi(sweeps: usize, walks: usize) -> ResidualWalk {
    ResidualWalk { sweeps: Auto::Value(sweeps), walks, smoother: Smoother::Jacobi }
}

#[test]
fn doing_nothing_is_the_line_to_beat() {
    assert_eq!(STEP.points(), 225);
    assert_near(STEP.do_nothing(), 9.7e-5, 0.02);
}

/// Errors of the walks, mean of 20 seeds: ± 10 %. What they say of themselves is the same: they have no bias.
#[test]
fn lattice_walks_have_the_errors_measured_before() {
    let grid = |walks, increment| GridWalk { walks, increment };
    let cases: [(&dyn Estimator, f64); 6] = [
        (&grid(10, false), 1.4e-2),
        (&grid(100, false), 4.4e-3),
        (&grid(10, true), 6.4e-5),
        (&grid(100, true), 2.0e-5),
        (&jacobi(4, 10), 1.3e-5),
        (&jacobi(16, 10), 1.3e-6),
    ];
    for (estimator, expected) in cases {
        let found = measure(estimator, 20);
        assert_near(found.error, expected, 0.1);
        assert_near(found.standard_error, found.error, 0.1);
    }
}

/// As published: 4.45e-4 for N = 10⁴, M = 10, and the rate N^-½ (here from N = 10³ and 1.4e-3 on).
#[test]
fn monte_carlo_is_as_measured_before_and_falls_with_the_root_of_its_paths() {
    let error = |paths, seeds| measure(&MonteCarlo::new(paths, 10), seeds).error;
    let (few, more, most) = (error(250, 8), error(1000, 2), error(10_000, 1));
    assert_near(few / more, 2.0, 0.15);
    assert_near(more, 1.4e-3, 0.15);
    assert_near(most, 4.45e-4, 0.15);
}

/// The residual walk at a thousandth of the path steps has less than a tenth of the error of Monte Carlo.
#[test]
fn residual_walks_beat_monte_carlo_a_thousandfold() {
    let (walk, paths) = (measure(&jacobi(4, 10), 4), measure(&MonteCarlo::new(10_000, 10), 1));
    assert!(walk.error < 0.1 * paths.error, "{:e} against {:e}", walk.error, paths.error);
    assert!(1000.0 * walk.evaluations < paths.evaluations, "{} against {}", walk.evaluations, paths.evaluations);
}

/// The variance reductions reduce.
#[test]
fn variance_reductions_reduce() {
    let plain = measure(&MonteCarlo::new(1000, 8), 1);
    let antithetic = measure(&MonteCarlo { antithetic: true, ..MonteCarlo::new(1000, 8) }, 1);
    let control = measure(&MonteCarlo { control_variate: true, ..MonteCarlo::new(1000, 8) }, 1);
    let sobol = measure(&MonteCarlo { sobol: true, ..MonteCarlo::new(1024, 8) }, 1);
    assert!(antithetic.error < 0.25 * plain.error && control.error < 0.1 * plain.error, "{antithetic:?} {control:?}");
    assert!(sobol.error < 0.1 * plain.error, "{sobol:?}");
}

/// The deterministic opponent has 1.4e-7 with 8 nodes to each side; what the program chooses is as good or better, in
/// one exchange, and so are its walks.
#[test]
fn strips_are_the_opponent_to_beat() {
    let plain = measure(&Strip::plain(8), 1);
    assert_near(plain.error, 1.37e-7, 0.05);
    // an inner subdomain of 10 × 10 cells, its strip and the ring around that
    assert_eq!((plain.exchanges, plain.read, plain.gathered), (1, 27 * 27 - 100, 0));
    let strip = measure(&Strip::default(), 1);
    assert!(strip.error < plain.error && strip.exchanges == 1, "{strip:?}");
    let walks = measure(&ResidualWalk::default(), 20);
    assert!(walks.error < 3e-7 && walks.exchanges == 1, "{walks:?}");
    assert_near(walks.standard_error, walks.error, 0.25);
    assert!(walks.evaluations < 75.0 && walks.handed_on < 1.0, "{walks:?}");
}

/// The default and the strip stay far below the shortest edge for any stiffness from a = .5 to 100.
#[test]
fn the_default_holds_over_all_stiffnesses() {
    for a in [0.5, 1.6, 5.0, 16.0, 50.0, 100.0] {
        let step = STEP.with_step(a / 1600.0).unwrap();
        assert_near(step.stiffness(), a, 1e-9);
        let found = step.measure(&ResidualWalk::default(), 2).unwrap();
        let (share, gain) = (found.error / step.shortest_edge(), found.error / step.do_nothing());
        assert!(share < 0.05 && gain < 0.1, "a = {a}: {share} of the shortest edge, {gain} of doing nothing");
        let strip = step.measure(&Strip::default(), 1).unwrap();
        assert!(strip.error < 0.01 * step.shortest_edge(), "a = {a}: {strip:?}");
        assert_eq!(found.evaluations == 0.0, a > 16.0, "walks at a = {a}");
    }
}
