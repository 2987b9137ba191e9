//! Random walks and paths: bias, noise, and what they meet.

use super::*;
use crate::numerics::difference::Gradient;
use crate::setting::Auto;

fn strips(lattice: &Lattice<2>, subdomains: [usize; 2]) -> Strips {
    Strips::new(&Decomposition::new(lattice, subdomains).unwrap())
}

/// 200 independent grid walks of one point average to the exact solve within three standard errors.
#[test]
fn grid_walks_are_unbiased() {
    let cases = [([20, 20], [false, false]), ([20, 20], [true, true]), ([12, 30], [true, false])];
    for (cells, periodic) in cases {
        let start = mesh(cells, periodic);
        let rho = bump(&start, 8.0, 0.3);
        let equation = Mmpde::published();
        let exact = Whole::default().step(&equation, &start, &rho, DT).unwrap().mesh;
        let operator = equation.operator(start.lattice(), &rho, DT).unwrap();
        let mut sides = start.x().to_vec();
        move_sides(&equation, &start, &rho, DT, &mut sides, &mut Default::default()).unwrap();
        let point = start.lattice().index([1, cells[1] / 3]);
        let residual =
            EstimatorKind::ResidualWalk(ResidualWalk { sweeps: Auto::Value(2), walks: 20, ..Default::default() });
        for kind in [EstimatorKind::GridWalk(GridWalk { walks: 20, increment: false }), residual] {
            let runs: Vec<[f64; 2]> = (0..200)
                .map(|seed| {
                    let problem = Problem::new(&equation, &operator, &start, &rho, DT, &sides, seed, 0);
                    kind.estimator().estimate(&problem, &[point], &mut strips(start.lattice(), [4, 4])).unwrap().points
                        [0]
                    .x
                })
                .collect();
            for c in 0..2 {
                let n = runs.len() as f64;
                let mean = runs.iter().map(|x| x[c]).sum::<f64>() / n;
                let variance = runs.iter().map(|x| (x[c] - mean).powi(2)).sum::<f64>() / (n - 1.0);
                let (error, standard) = ((mean - exact.x()[point][c]).abs(), (variance / n).sqrt());
                assert!(error < 3.0 * standard, "{kind:?} on {periodic:?}: {error:e} for {standard:e}");
                assert!(standard > 1e-9, "{kind:?} has no spread: the test cannot fail");
            }
        }
    }
}

/// Euler–Maruyama is of first order: four times the substeps, a quarter of the bias. Sobol points and the martingale
/// leave next to no noise.
#[test]
fn monte_carlo_has_a_bias_of_first_order() {
    let start = mesh([20, 20], [true, true]);
    let rho = bump(&start, 3.0, 0.3);
    let (equation, dt) = (Mmpde::published(), 2e-3);
    let operator = equation.operator(start.lattice(), &rho, dt).unwrap();
    let problem = Problem::new(&equation, &operator, &start, &rho, dt, start.x(), 1, 0);
    let points: Vec<usize> = [[5, 7], [8, 3], [2, 9]].map(|node| start.lattice().index(node)).to_vec();
    let at = |paths: usize, substeps: usize| {
        let monte = MonteCarlo { sobol: true, control_variate: true, ..MonteCarlo::new(paths, substeps) };
        monte.estimate(&problem, &points, &mut strips(start.lattice(), [2, 2])).unwrap().points
    };
    let limit = at(1 << 14, 64);
    let bias = |substeps: usize| -> f64 {
        let squares = at(1 << 15, substeps)
            .iter()
            .zip(&limit)
            .flat_map(|(a, b)| [0, 1].map(|c| (a.x[c] - b.x[c]).powi(2)))
            .sum::<f64>();
        squares.sqrt()
    };
    // seen from M = 64 the bias of M is that of 1/M − 1/64
    let (coarse, fine) = (bias(2), bias(8));
    let expected = (1.0 / 2.0 - 1.0 / 64.0) / (1.0 / 8.0 - 1.0 / 64.0);
    assert!((coarse / fine / expected - 1.0).abs() < 0.25, "{coarse:e} and {fine:e}: {} for {expected}", coarse / fine);
}

/// However stiff the step, strips leave so little that nothing can fold; where walks would take too long there are
/// none.
#[test]
fn strips_meet_any_stiffness() {
    for periodic in [[false, false], [true, true]] {
        let start = mesh([20, 24], periodic);
        let rho = bump(&start, 20.0, 0.3);
        for relaxation in [1.0, 1e-2, 1e-4, 1e-6] {
            let equation = Mmpde { relaxation: Relaxation::Time(relaxation), form: Form::Gradient(Gradient::Safe) };
            let exact = Whole::default().step(&equation, &start, &rho, DT).unwrap().mesh;
            let mut walks = Stochastic::new([3, 3], 1, EstimatorKind::default());
            let found = walks.step(&equation, &start, &rho, DT).unwrap();
            let (error, edge) = (largest_difference(&found.mesh, &exact), start.shortest_edge());
            assert!(error < 0.01 * edge, "{periodic:?}, τ = {relaxation}: {error:e} of {edge:e}");
            let interface = found.interface.unwrap();
            assert_eq!(interface.walks == 0, found.work.path_steps == 0, "{interface:?}");
            assert!(relaxation < 1.0 || interface.exchanges == 1, "{interface:?}");
        }
    }
    // on an axis without sides nothing else stops a walk
    let start = mesh([20, 24], [true, true]);
    let equation = Mmpde { relaxation: Relaxation::Time(1e-9), form: Form::Gradient(Gradient::Safe) };
    let grid = EstimatorKind::GridWalk(GridWalk { walks: 100, increment: false });
    let refused = Stochastic::new([3, 3], 1, grid).step(&equation, &start, &bump(&start, 20.0, 0.3), DT);
    let long = matches!(refused, Err(Failure::LongWalks { stiffness, .. }) if stiffness > 1e8);
    assert!(long, "{:?}", refused.err());
}

/// Paths that leave pay the side where and when they leave: y_t = ∇²y on the unit square with the sides at ξ = 0 and 1
/// moving evenly in time has the exact solution y = η + sin(πη) (s A(ξ) + B(ξ)) c/Δt.
#[test]
fn paths_pay_moving_sides() {
    let (dt, c) = (0.02, 0.1);
    let at_end = |[xi, eta]: [f64; 2], s: f64| {
        let (z, half) = (PI * (xi - 0.5), PI / 2.0);
        let a = z.cosh() / half.cosh();
        let b = (z * z.sinh() - half * half.tanh() * z.cosh()) / (2.0 * PI * PI * half.cosh());
        [xi, eta + (PI * eta).sin() * c / dt * (s * a + b)]
    };
    let uniform = Mesh::uniform(Lattice::bounded([24, 24]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let positions = |s: f64| -> Vec<[f64; 2]> { uniform.x().iter().map(|&x| at_end(x, s)).collect() };
    let (start, rho) = (uniform.moved(positions(0.0)).unwrap(), Density::from(vec![1.0; uniform.x().len()]));
    let equation = Mmpde::published();
    let operator = equation.operator(start.lattice(), &rho, dt).unwrap();
    let new = positions(dt);
    let problem = Problem::new(&equation, &operator, &start, &rho, dt, &new, 3, 0);
    let points: Vec<usize> = [[1, 12], [3, 12], [6, 9]].map(|node| start.lattice().index(node)).to_vec();
    for control_variate in [false, true] {
        let monte = MonteCarlo { control_variate, ..MonteCarlo::new(20_000, 40) };
        for (&k, found) in
            points.iter().zip(monte.estimate(&problem, &points, &mut strips(start.lattice(), [2, 2])).unwrap().points)
        {
            let (error, standard) = (found.x[1] - new[k][1], found.standard_error[1]);
            assert!(error.abs() < 3.0 * standard + 2e-4, "{control_variate}: off by {error:e}, ± {standard:e}");
            assert!((new[k][1] - start.x()[k][1]).abs() > 2e-3, "nothing moves: the test cannot fail");
        }
    }
}

/// The same bits for 1, 2 and 4 threads, for every estimator and for Schwarz, also over several steps.
#[test]
fn interfaces_do_not_depend_on_threads() {
    let start = mesh([30, 22], [true, false]);
    let rho = bump(&start, 5.0, 0.3);
    let monte = |sobol| EstimatorKind::MonteCarlo(MonteCarlo { sobol, ..MonteCarlo::new(200, 3) });
    let kinds = [
        EstimatorKind::default(),
        EstimatorKind::Strip(Strip::default()),
        EstimatorKind::GridWalk(GridWalk { walks: 50, increment: true }),
        monte(false),
        monte(true),
    ];
    let runs = |threads: usize| -> Vec<Mesh<2>> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let stochastic = |kind: &EstimatorKind| Stochastic::new([3, 4], 5, kind.clone());
            let mut meshes: Vec<Mesh<2>> =
                kinds.iter().map(|kind| advance(&mut stochastic(kind), &start, &rho, 2)).collect();
            meshes.push(advance(&mut Schwarz::new([3, 4], 2), &start, &rho, 2));
            meshes
        })
    };
    let one = runs(1);
    assert!(one == runs(2) && one == runs(4));
    // and another seed gives another mesh
    assert!(one[0] != advance(&mut Stochastic::new([3, 4], 6, kinds[0].clone()), &start, &rho, 2));
}

/// A sample of each interface, interpolated: better the more nodes it has, and all of them give the full estimate.
#[test]
fn sampled_interfaces_approach_the_full_ones() {
    for periodic in [[false, false], [true, true]] {
        let start = mesh([40, 40], periodic);
        let rho = bump(&start, 5.0, 0.3);
        let whole = Whole::default().step(&Mmpde::published(), &start, &rho, DT).unwrap().mesh;
        for placement in [Placement::Density, Placement::Uniform] {
            let error = |sample: usize| {
                let mut generator = Stochastic::new([4, 4], 3, EstimatorKind::default());
                generator.interface = Some(Interpolation { sample, placement });
                let moved = generator.step(&Mmpde::published(), &start, &rho, DT).unwrap().mesh;
                largest_difference(&moved, &whole)
            };
            let full = advance(&mut Stochastic::new([4, 4], 3, EstimatorKind::default()), &start, &rho, 1);
            assert_eq!(error(60), largest_difference(&full, &whole));
            let still = largest_difference(&start, &whole);
            assert!(error(9) < 0.02 * still, "{placement:?}: {:e} of {still:e}", error(9));
        }
    }
}

/// Too steep a density for walks is named with its place; the safe gradient carries any.
#[test]
fn steep_densities_are_named_and_the_safe_gradient_carries_them() {
    let start = mesh([20, 20], [false; 2]);
    let rho: Density = start.x().iter().map(|[x, _]| if *x < 0.0 { 1.0 } else { 1e4 }).collect();
    let mut generator = Stochastic::new([2, 2], 0, EstimatorKind::default());
    for gradient in [Gradient::Central, Gradient::Log] {
        let error = generator
            .step(&Mmpde { relaxation: Relaxation::Time(1.0), form: Form::Gradient(gradient) }, &start, &rho, DT)
            .unwrap_err();
        assert!(matches!(error, Failure::SteepDensity { skew, .. } if skew > 2.0), "{error}");
    }
    let safe = Mmpde { relaxation: Relaxation::Time(1.0), form: Form::Gradient(Gradient::Safe) };
    let moved = generator.step(&safe, &start, &rho, DT).unwrap();
    let whole = Whole::default().step(&safe, &start, &rho, DT).unwrap().mesh;
    let rms = crate::geometry::compare(&moved.mesh, &whole).mesh_rms / 2.0_f64.sqrt();
    let noise = moved.interface.unwrap().standard_error.unwrap();
    assert!(rms < 1.5 * noise, "off by {rms:e}, standard error {noise:e}");
}

/// Walks far too few for a long step are refused by name instead of folding the mesh.
#[test]
fn noise_beyond_the_shortest_edge_is_refused() {
    let start = mesh([40, 40], [false; 2]);
    let rho = bump(&start, 5.0, 0.3);
    let mut generator = Stochastic::new([4, 4], 0, EstimatorKind::GridWalk(GridWalk { walks: 2, increment: false }));
    let error = generator.step(&Mmpde::published(), &start, &rho, 0.04).unwrap_err();
    assert!(matches!(error, Failure::NoisyInterface { .. }), "{error}");
}
