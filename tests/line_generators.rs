//! Subdomains of a line: Schwarz methods and stochastic domain decomposition as mesh generators.

use driftmesh::error::Error;
use driftmesh::geometry::{Density, Lattice, Mesh};
use driftmesh::meshing::{
    EstimatorKind, Form, GridWalk, Interpolation, LineSchwarz, LineStochastic, MeshGenerator, Mmpde, MonteCarlo,
    Placement, ResidualWalk, Strip, Transmission, Whole,
};
use driftmesh::numerics::difference::Gradient;
use driftmesh::study::{Kind, MovingLine, MovingRun, Source};
use std::f64::consts::PI;

/// Δt of all steps; with τ = 1 the influence of a node reaches a tenth of the line.
const DT: f64 = 1e-2;

fn line(cells: usize, periodic: bool) -> Mesh<1> {
    Mesh::uniform(Lattice::new([cells], [periodic]).unwrap(), [-0.5], [1.5]).unwrap()
}

/// A peak of ρ, six times as high as its surroundings.
fn peak(mesh: &Mesh<1>) -> Density {
    mesh.x().iter().map(|[x]| 1.0 + 5.0 * (-60.0 * (x - 0.3).powi(2)).exp()).collect()
}

fn forms() -> [Mmpde; 2] {
    let published = Mmpde::published();
    [published, Mmpde { form: Form::Conservative, ..published }]
}

fn farthest(a: &Mesh<1>, b: &Mesh<1>) -> f64 {
    a.x().iter().zip(b.x()).map(|([a], [b])| (a - b).abs()).fold(0.0, f64::max)
}

/// The step of the whole line, to round-off: by elimination of the dense system.
fn exact_step(equation: &Mmpde, mesh: &Mesh<1>, rho: &Density, dt: f64) -> Vec<f64> {
    let operator = equation.operator(mesh.lattice(), rho, dt).unwrap();
    let (n, wraps, [[length]]) = (mesh.x().len(), mesh.lattice().periodic()[0], mesh.jump());
    let mut rows = vec![vec![0.0; n + 1]; n];
    for (i, row) in rows.iter_mut().enumerate() {
        let [[below, above]] = operator.weights()[i];
        row[i] = 1.0;
        row[n] = mesh.x()[i][0];
        if !wraps && (i == 0 || i + 1 == n) {
            continue;
        }
        row[i] += below + above;
        row[(i + n - 1) % n] -= below;
        row[(i + 1) % n] -= above;
        row[n] += if i == 0 { -length * below } else { 0.0 } + if i + 1 == n { length * above } else { 0.0 };
    }
    for i in 0..n {
        let pivot = rows[i].clone();
        for (k, row) in rows.iter_mut().enumerate() {
            let share = if k == i { 0.0 } else { row[i] / pivot[i] };
            row.iter_mut().zip(&pivot).for_each(|(entry, pivot)| *entry -= share * pivot);
        }
    }
    (0..n).map(|i| rows[i][n] / rows[i][i]).collect()
}

fn off(mesh: &Mesh<1>, exact: &[f64]) -> f64 {
    mesh.x().iter().zip(exact).map(|([x], exact)| (x - exact).abs()).fold(0.0, f64::max)
}

fn estimators() -> Vec<EstimatorKind> {
    vec![
        EstimatorKind::default(),
        EstimatorKind::ResidualWalk(ResidualWalk { walks: 40, ..ResidualWalk::default() }),
        EstimatorKind::Strip(Strip::default()),
        EstimatorKind::GridWalk(GridWalk { walks: 400, increment: true }),
        EstimatorKind::GridWalk(GridWalk { walks: 4000, increment: false }),
        EstimatorKind::MonteCarlo(MonteCarlo::new(20_000, 20)),
    ]
}

fn optimized(subdomains: usize, overlap: usize) -> LineSchwarz {
    let mut schwarz = LineSchwarz::new([subdomains], overlap);
    schwarz.method = Transmission::Optimized;
    schwarz
}

/// Every generator of a line: equal cells rest under a constant ρ, ρ → 2ρ changes no bit, and ends stay.
#[test]
fn generators_of_a_line_keep_the_laws() {
    let laws = |make: &dyn Fn() -> Box<dyn MeshGenerator<1>>, paths: bool| {
        for (equation, periodic) in forms().iter().flat_map(|form| [false, true].map(|periodic| (form, periodic))) {
            let start = line(24, periodic);
            let rest = make().step(equation, &start, &vec![3.7; start.x().len()].into(), DT);
            if let Ok(rest) = rest {
                assert!(farthest(&rest.mesh, &start) < 0.05, "periodic: {periodic}");
            }
            let rho = peak(&start);
            let step = |rho: &Density| make().step(equation, &start, rho, DT).unwrap().mesh;
            let moved = step(&rho);
            let twice = step(&rho.largest().iter().map(|r| 2.0 * r).collect());
            // paths take ln ρ, of which a factor changes the last bits
            assert!(if paths { farthest(&twice, &moved) < 1e-13 } else { twice == moved });
            assert!(periodic || (moved.x()[0], moved.x()[24]) == ([-0.5], [1.5]));
        }
    };
    for subdomains in [1, 2, 5, 24] {
        for overlap in [1, 2, 7] {
            laws(&|| Box::new(LineSchwarz::new([subdomains], overlap)), false);
            laws(&|| Box::new(optimized(subdomains, overlap)), false);
        }
        for estimator in estimators() {
            let paths = matches!(estimator, EstimatorKind::MonteCarlo(_));
            laws(&|| Box::new(LineStochastic::new([subdomains], 7, estimator.clone())), paths);
        }
    }
}

/// Schwarz methods end at the step of the whole line, classical ones no slower than predicted.
#[test]
fn schwarz_converges_to_the_whole_line() {
    for (equation, periodic) in forms().iter().flat_map(|form| [false, true].map(|periodic| (form, periodic))) {
        let start = line(60, periodic);
        let rho = peak(&start);
        let exact = exact_step(equation, &start, &rho, DT);
        let whole = Whole::to(1e-9).step(equation, &start, &rho, DT).unwrap().mesh;
        assert!(off(&whole, &exact) < 1e-10, "{:e}", off(&whole, &exact));
        for (subdomains, overlap) in [(2, 1), (4, 2), (5, 6), (20, 3)] {
            let moved = LineSchwarz::new([subdomains], overlap).step(equation, &start, &rho, DT).unwrap();
            assert!(off(&moved.mesh, &exact) < 1e-8, "{subdomains}, {overlap}: {:e}", off(&moved.mesh, &exact));
            let classical = moved.interface.unwrap().contraction.unwrap();
            assert!(classical.observed <= classical.predicted.unwrap() + 1e-9, "{classical:?}");
            let moved = optimized(subdomains, overlap).step(equation, &start, &rho, DT).unwrap();
            assert!(off(&moved.mesh, &exact) < 1e-8, "{subdomains}, {overlap}: {:e}", off(&moved.mesh, &exact));
            let iterations = moved.interface.unwrap().contraction.unwrap().iterations;
            assert!(2 * iterations < classical.iterations, "{iterations} for {}", classical.iterations);
        }
    }
}

/// For a constant ρ Robin's condition of a line is that of the unbounded rest of the line: what an iteration leaves has
/// gone to an end of the line and come back, which is e^(−2θ·cells) of it.
#[test]
fn robin_conditions_of_a_line_are_exact_for_constant_densities() {
    let lattice = Lattice::bounded([80]).unwrap();
    let nodes = (0..81).map(|k| [k as f64 / 80.0 + 0.1 * (PI * k as f64 / 80.0).sin() / PI]).collect();
    let start = Mesh::uniform(lattice, [0.0], [1.0]).unwrap().moved(nodes).unwrap();
    let rho: Density = vec![1.0; 81].into();
    let equation = Mmpde::published();
    let exact = exact_step(&equation, &start, &rho, 1e-3);
    let left = |mut schwarz: LineSchwarz| {
        (schwarz.tolerance, schwarz.iterations) = (None, 2);
        off(&schwarz.step(&equation, &start, &rho, 1e-3).unwrap().mesh, &exact)
    };
    let [robin, classical] = [optimized(2, 2), LineSchwarz::new([2], 2)].map(left);
    assert!(robin < 1e-10 && classical > 1e-6, "{robin:e}, {classical:e}");
}

/// Root mean square, over seeds and interface nodes, of the distance to the exact step, and the reported one.
fn noise(estimator: &EstimatorKind, exact: &[f64], start: &Mesh<1>, equation: &Mmpde) -> [f64; 2] {
    let mut squares = [0.0; 2];
    let seeds = 40;
    for seed in 0..seeds {
        let mut generator = LineStochastic::new([4], seed, estimator.clone());
        let moved = generator.step(equation, start, &peak(start), DT).unwrap();
        let cuts = [1, 2, 3].map(|s| s * start.lattice().cells()[0] / 4);
        squares[0] += cuts.iter().map(|&k| (moved.mesh.x()[k][0] - exact[k]).powi(2)).sum::<f64>() / 3.0;
        squares[1] += moved.interface.unwrap().standard_error.unwrap().powi(2);
    }
    squares.map(|sum| (sum / seeds as f64).sqrt())
}

/// The error of random walks is their standard error, which falls like 1/√N: to a tenth with a hundred times the walks,
/// to four times the relative standard deviation of a root mean square over 120 values.
#[test]
fn the_error_of_walks_falls_like_the_root_of_their_number() {
    let start = line(40, false);
    let four_deviations = 4.0 / (2.0 * 120.0_f64).sqrt();
    for equation in forms() {
        let exact = exact_step(&equation, &start, &peak(&start), DT);
        for increment in [false, true] {
            let walks = |walks| EstimatorKind::GridWalk(GridWalk { walks, increment });
            let [few, many] = [300, 30_000].map(|n| noise(&walks(n), &exact, &start, &equation));
            for [error, reported] in [few, many] {
                assert!((error / reported - 1.0).abs() < four_deviations, "{error:e}, reported {reported:e}");
            }
            let ratio = few[0] / many[0];
            assert!((ratio / 10.0 - 1.0).abs() < 1.5 * four_deviations, "{ratio}");
        }
    }
}

/// Feynman–Kac: with b constant, x = s(ξ) + a e^(−bξ/2) sin(πξ), where s rests, is s + a e^(−bξ/2 − (π² + b²/4) Δt/τ)
/// sin(πξ) after the step, and paths with the exit test of a Brownian bridge estimate it without bias.
#[test]
fn paths_with_constant_drift_have_no_bias() {
    let n = 64;
    let equation = Mmpde { form: Form::Gradient(Gradient::Log), ..Mmpde::published() };
    for b in [0.0_f64, 3.0] {
        let at = |xi: f64, dt: f64| {
            let rest = if b == 0.0 { xi } else { (1.0 - (-b * xi).exp()) / (1.0 - (-b).exp()) };
            rest + 0.1 * (-0.5 * b * xi - (PI * PI + 0.25 * b * b) * dt).exp() * (PI * xi).sin()
        };
        let nodes = (0..=n).map(|k| [at(k as f64 / n as f64, 0.0)]).collect();
        let equal = Mesh::uniform(Lattice::bounded([n]).unwrap(), [0.0], [1.0]).unwrap();
        let start = equal.moved(nodes).unwrap();
        let rho: Density = (0..=n).map(|k| (b * k as f64 / n as f64).exp()).collect();
        let plain = MonteCarlo::new(40_000, 8);
        for paths in [
            plain.clone(),
            MonteCarlo { antithetic: true, ..plain.clone() },
            MonteCarlo { sobol: true, ..plain.clone() },
            MonteCarlo { control_variate: true, ..plain.clone() },
            MonteCarlo { common: true, ..plain },
        ] {
            let dt = 0.05;
            let (mut worst, mut reported) = (0.0_f64, 0.0_f64);
            let seeds = 8;
            let mut sums = [0.0; 3];
            for seed in 0..seeds {
                let mut generator = LineStochastic::new([4], seed, EstimatorKind::MonteCarlo(paths.clone()));
                let moved = generator.step(&equation, &start, &rho, dt).unwrap();
                reported = reported.max(moved.interface.unwrap().standard_error.unwrap());
                for (sum, k) in sums.iter_mut().zip([16, 32, 48]) {
                    *sum += (moved.mesh.x()[k][0] - at(k as f64 / n as f64, dt)) / seeds as f64;
                }
            }
            sums.iter().for_each(|sum| worst = worst.max(sum.abs()));
            // the interpolation by cubics through nodes is exact to 1e-7 here
            let allowed = 5.0 * reported / (seeds as f64).sqrt() + 1e-7;
            assert!(worst < allowed && reported < 2e-3, "b = {b}, {paths:?}: {worst:e}, noise {reported:e}");
        }
    }
}

/// Walks for the residual of strips, ten from a node, leave a hundredth of the shortest cell before the step at most.
#[test]
fn residual_walks_leave_little() {
    for (equation, periodic) in forms().iter().flat_map(|form| [false, true].map(|periodic| (form, periodic))) {
        let start = line(60, periodic);
        let rho = peak(&start);
        for dt in [1e-4, 1e-2, 1.0] {
            let exact = exact_step(equation, &start, &rho, dt);
            for estimator in [EstimatorKind::default(), EstimatorKind::Strip(Strip::default())] {
                let mut generator = LineStochastic::new([4], 1, estimator.clone());
                let moved = generator.step(equation, &start, &rho, dt).unwrap();
                let off = off(&moved.mesh, &exact);
                assert!(off < 0.01 * start.shortest_edge(), "{estimator:?}, periodic: {periodic}, Δt = {dt}: {off:e}");
            }
        }
    }
}

/// Subdomains of a line have the same bits on one thread and on three.
#[test]
fn subdomains_of_a_line_have_the_same_bits_for_any_number_of_threads() {
    let start = line(60, false);
    let rho = peak(&start);
    for estimator in estimators() {
        let step = || LineStochastic::new([5], 3, estimator.clone()).step(&forms()[1], &start, &rho, DT).unwrap().mesh;
        let on = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(step);
        assert_eq!(on(1), on(3), "{estimator:?}");
    }
    let step = || optimized(5, 2).step(&forms()[1], &start, &rho, DT).unwrap().mesh;
    let on = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(step);
    assert_eq!(on(1), on(3));
}

fn study(generator: &str) -> Result<MovingLine, Error> {
    let text = format!(
        "[study]\nname = \"line\"\nkind = \"moving-mesh\"\n[grid]\ncells = [40]\n[time]\nstart = 0.25\nend = 0.5\n\
         step = 0.005\n[pde]\nkind = \"burgers\"\nviscosity = 0.002\n[mesh]\nrelaxation = {{ steps = 10 }}\n\
         generator = {generator}\n"
    );
    MovingLine::from_source(&Source::new("line.toml", text))
}

fn run(generator: &str) -> MovingRun<1> {
    let (run, failure) = study(generator).unwrap().compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    run
}

/// A study with subdomains has the errors of the study without.
#[test]
fn studies_with_subdomains_have_the_error_of_the_whole() {
    let error = |run: &MovingRun<1>| run.record.reports.last().unwrap().error.unwrap().linf;
    let whole = error(&run("{ kind = \"whole\" }"));
    for generator in [
        "{ kind = \"schwarz\", subdomains = [4], overlap = 2 }",
        "{ kind = \"schwarz\", subdomains = [3], overlap = 1, method = \"optimized\" }",
        "{ kind = \"stochastic\", subdomains = [4], seed = 1 }",
        "{ kind = \"stochastic\", subdomains = [2], estimator = { kind = \"strip\" } }",
    ] {
        let run = run(generator);
        assert!((error(&run) / whole - 1.0).abs() < 0.05, "{generator}: {:e} for {whole:e}", error(&run));
        let interface = run.record.interface.expect("subdomains have interfaces");
        assert!(interface.points > 0, "{interface:?}");
    }
}

/// Settings of subdomains that make no sense on a line are refused by key.
#[test]
fn nonsense_in_subdomains_of_a_line_is_refused() {
    for (generator, said) in [
        ("{ kind = \"schwarz\", subdomains = [2, 2] }", "expected an array of length 1, found 2"),
        ("{ kind = \"schwarz\", subdomains = [41] }", "`mesh.generator.subdomains` is [41]"),
        ("{ kind = \"schwarz\", subdomains = [0] }", "`mesh.generator.subdomains` is [0]"),
        ("{ kind = \"schwarz\", subdomains = [4], overlap = 0 }", "`mesh.generator.overlap` is 0"),
        ("{ kind = \"stochastic\", subdomains = [4], estimator = { kind = \"grid-walk\", walks = 0 } }", "walks"),
        ("{ kind = \"stochastic\", subdomains = [4], interface = { sample = 3 } }", "`mesh.generator.interface`"),
    ] {
        let error = study(generator).unwrap_err().to_string();
        assert!(error.contains(said), "{generator}: {error}");
    }
    let mut generator = LineStochastic::new([4], 0, EstimatorKind::default());
    generator.interface = Some(Interpolation { sample: 3, placement: Placement::Density });
    assert!(generator.check(&Lattice::bounded([40]).unwrap()).is_err());
}
