//! Every generator: its laws, its agreement with the others, its settings.

use super::*;
use crate::geometry::check_unfolded;
use crate::setting::Auto;

/// The laws of every generator, on every kind of lattice.
fn laws<G: MeshGenerator>(make: impl Fn() -> G) {
    let sides = [[false, false], [true, false], [false, true], [true, true]];
    for (equation, periodic) in forms().iter().flat_map(|form| sides.map(|periodic| (form, periodic))) {
        let advance =
            |mesh: &Mesh<2>, rho: &Density, steps: usize| advance_with(equation, &mut make(), mesh, rho, steps);
        let start = mesh([24, 17], periodic);
        // constant ρ leaves a uniform mesh at rest; a turn around the seam and back may cost the last bit
        let rest = advance(&start, &vec![3.7; start.x().len()].into(), 3);
        assert!(largest_difference(&rest, &start) < 1e-15, "periodic {periodic:?}");
        // ρ → cρ changes nothing; a power of two not even a bit
        let rho = bump(&start, 5.0, 0.3);
        let moved = advance(&start, &rho, 20);
        check_unfolded(&moved).unwrap();
        let doubled: Density = rho.largest().iter().map(|r| 2.0 * r).collect();
        assert!(advance(&start, &doubled, 20) == moved, "ρ → 2ρ changed a bit");
        let scaled: Density = rho.largest().iter().map(|r| 0.123 * r).collect();
        let difference = largest_difference(&advance(&start, &scaled, 20), &moved);
        assert!(difference < 1e-13, "ρ → cρ moved the mesh by {difference:e}");
        // side nodes stay exactly on the box
        let (nodes, lattice) = (start.lattice().nodes(), start.lattice());
        for (k, x) in moved.x().iter().enumerate() {
            for d in (0..2).filter(|&d| !periodic[d]) {
                let at = lattice.node(k)[d];
                let side = [(0, start.lower()[d]), (nodes[d] - 1, start.upper()[d])];
                assert!(side.iter().all(|&(end, value)| at != end || x[d] == value), "node {k} left its side");
            }
        }
    }
}

#[test]
fn whole_keeps_the_laws() {
    laws(Whole::default);
}

#[test]
fn fixed_keeps_the_laws() {
    laws(Fixed::default);
}

#[test]
fn residual_walks_keep_the_laws() {
    for subdomains in [[4, 4], [3, 5], [1, 2], [24, 17]] {
        laws(|| Stochastic::new(subdomains, 7, EstimatorKind::default()));
    }
}

#[test]
fn strips_keep_the_laws() {
    for (subdomains, strip) in [([4, 4], Strip::default()), ([3, 5], Strip::plain(2)), ([24, 17], Strip::plain(1))] {
        laws(|| Stochastic::new(subdomains, 7, EstimatorKind::Strip(strip.clone())));
    }
}

fn with(mut schwarz: Schwarz, edit: impl Fn(&mut Schwarz)) -> Schwarz {
    edit(&mut schwarz);
    schwarz
}

fn optimized(subdomains: [usize; 2], overlap: usize) -> Schwarz {
    with(Schwarz::new(subdomains, overlap), |schwarz| schwarz.method = Transmission::Optimized)
}

#[test]
fn schwarz_keeps_the_laws() {
    for (subdomains, overlap) in [([4, 4], 2), ([3, 5], 1), ([2, 1], 30)] {
        laws(|| Schwarz::new(subdomains, overlap));
        laws(|| optimized(subdomains, overlap));
    }
}

/// A number of iterations without a tolerance is what is done, in every step, and more of them are better by the factor
/// that the last ones show; with a tolerance missed it is a failure.
#[test]
fn schwarz_does_as_many_iterations_as_it_is_told() {
    let start = mesh([40, 40], [false; 2]);
    let rho = bump(&start, 5.0, 0.3);
    let whole = Whole::default().step(&Mmpde::published(), &start, &rho, DT).unwrap().mesh;
    for make in [Schwarz::new as fn([usize; 2], usize) -> Schwarz, optimized] {
        let error = |iterations: usize| {
            let mut schwarz = with(make([4, 4], 2), |s| (s.tolerance, s.iterations) = (None, iterations));
            let moved = schwarz.step(&Mmpde::published(), &start, &rho, DT).unwrap();
            let interface = moved.interface.unwrap();
            assert_eq!((interface.contraction.unwrap().iterations, interface.exchanges), (iterations, iterations));
            largest_difference(&moved.mesh, &whole)
        };
        let errors = [1, 3, 6, 9].map(error);
        assert!(errors.windows(2).all(|pair| pair[1] < 0.3 * pair[0]), "{errors:?}");
        let mut missed = with(make([4, 4], 2), |s| s.iterations = 3);
        let failure = missed.step(&Mmpde::published(), &start, &rho, DT).unwrap_err();
        assert!(matches!(failure, Failure::SchwarzStalled { iterations: 3, .. }), "{failure}");
    }
}

/// Optimised conditions take two thirds of the iterations of classical ones and less, the less the longer the step; p
/// given is no better than p found.
#[test]
fn optimised_conditions_pay() {
    for (periodic, dt) in [([false; 2], 1e-3), ([true, false], 1e-2), ([true; 2], 0.1)] {
        let start = mesh([40, 40], periodic);
        let rho = bump(&start, 5.0, 0.3);
        let whole = Whole::default().step(&Mmpde::published(), &start, &rho, dt).unwrap().mesh;
        let iterations = |mut schwarz: Schwarz| {
            let moved = schwarz.step(&Mmpde::published(), &start, &rho, dt).unwrap();
            assert!(largest_difference(&moved.mesh, &whole) < 1e-8);
            moved.interface.unwrap().contraction.unwrap()
        };
        for overlap in [1, 2, 4] {
            let (classical, robin) =
                (iterations(Schwarz::new([4, 4], overlap)), iterations(optimized([4, 4], overlap)));
            assert!(3 * robin.iterations <= 2 * classical.iterations + 2, "{dt}: {classical:?}, {robin:?}");
            let given = iterations(with(optimized([4, 4], overlap), |s| s.robin = Auto::Value(1e3)));
            assert!(given.iterations >= robin.iterations, "{given:?}, {robin:?}");
        }
    }
}

/// One step of every generator lands on the mesh of `whole`, on every kind of lattice: to the tolerance of Schwarz, to
/// the standard error of the walks.
#[test]
fn all_generators_agree_on_a_step() {
    let sides = [[false, false], [true, false], [false, true], [true, true]];
    for (equation, periodic) in forms().iter().flat_map(|form| sides.map(|periodic| (form, periodic))) {
        let start = mesh([24, 17], periodic);
        let rho = bump(&start, 5.0, 0.3);
        let step = |generator: &mut dyn MeshGenerator| generator.step(equation, &start, &rho, DT).unwrap();
        let whole = exact_step(equation, &start, &rho);
        let close = if equation.form == Form::Conservative { 0.01 * start.shortest_edge() } else { 1e-11 };
        let difference = largest_difference(&step(&mut Whole::default()).mesh, &whole);
        assert!(difference < close, "whole on {periodic:?}: off by {difference:e}");
        for (subdomains, overlap) in [([4, 4], 2), ([3, 5], 1), ([2, 1], 30), ([1, 1], 2)] {
            let moved = step(&mut Schwarz::new(subdomains, overlap));
            let difference = largest_difference(&moved.mesh, &whole);
            assert!(difference < 1e-8, "schwarz {subdomains:?} on {periodic:?}: off by {difference:e}");
            let contraction = moved.interface.unwrap().contraction.unwrap();
            let predicted = contraction.predicted.unwrap();
            assert!(contraction.observed <= predicted + 1e-9 && predicted < 1.0, "{contraction:?}");
        }
        for estimator in [
            EstimatorKind::default(),
            EstimatorKind::Strip(Strip::default()),
            EstimatorKind::GridWalk(GridWalk { walks: 400, increment: true }),
            EstimatorKind::GridWalk(GridWalk { walks: 10_000, increment: false }),
        ] {
            for subdomains in [[4, 4], [3, 5], [1, 2]] {
                let moved = step(&mut Stochastic::new(subdomains, 1, estimator.clone()));
                let rms = crate::geometry::compare(&moved.mesh, &whole).mesh_rms / 2.0_f64.sqrt();
                let Some(noise) = moved.interface.unwrap().standard_error else {
                    assert!(rms < 0.01 * start.shortest_edge(), "strips alone on {periodic:?}: {rms:e}");
                    continue;
                };
                assert!(rms < 1.5 * noise && rms > 0.1 * noise, "{estimator:?} on {periodic:?}: {rms:e}, {noise:e}");
            }
        }
    }
}

/// Every setting out of range has its key.
#[test]
fn nonsense_is_refused_by_key() {
    let lattice = Lattice::bounded([8, 6]).unwrap();
    let key = |outcome: crate::Result<()>| match outcome {
        Err(crate::Error::Invalid { key, .. }) => key,
        other => panic!("{other:?}"),
    };
    let estimated = |estimator: EstimatorKind| key(Stochastic::new([2, 2], 0, estimator).check(&lattice));
    assert_eq!(key(Stochastic::new([9, 2], 0, EstimatorKind::default()).check(&lattice)), "subdomains");
    assert_eq!(key(Stochastic::new([0, 2], 0, EstimatorKind::default()).check(&lattice)), "subdomains");
    assert_eq!(key(Stochastic::new([2, 2], 1 << 63, EstimatorKind::default()).check(&lattice)), "seed");
    assert_eq!(estimated(EstimatorKind::GridWalk(GridWalk { walks: 0, increment: false })), "estimator.walks");
    assert_eq!(
        estimated(EstimatorKind::ResidualWalk(ResidualWalk { walks: 0, ..ResidualWalk::default() })),
        "estimator.walks"
    );
    let monte = |edit: fn(&mut MonteCarlo)| {
        let mut paths = MonteCarlo::new(100, 5);
        edit(&mut paths);
        estimated(EstimatorKind::MonteCarlo(paths))
    };
    assert_eq!(monte(|m| m.paths = 0), "estimator.paths");
    assert_eq!(monte(|m| m.substeps = 0), "estimator.substeps");
    assert_eq!(monte(|m| (m.paths, m.antithetic) = (3, true)), "estimator.paths");
    assert_eq!(monte(|m| (m.sobol, m.antithetic) = (true, true)), "estimator.antithetic");
    assert_eq!(monte(|m| (m.sobol, m.substeps) = (true, 129)), "estimator.substeps");
    let strip = |strip: Strip| estimated(EstimatorKind::Strip(strip));
    assert_eq!(strip(Strip::plain(0)), "estimator.width");
    assert_eq!(strip(Strip::plain(4)), "estimator.width");
    assert_eq!(strip(Strip { coarse: Auto::Value(0), ..Strip::default() }), "estimator.coarse");
    assert_eq!(strip(Strip { coarse: Auto::Value(3), ..Strip::default() }), "estimator.coarse");
    assert_eq!(strip(Strip { exchanges: Auto::Value(0), ..Strip::default() }), "estimator.exchanges");
    assert_eq!(key(<Schwarz>::new([2, 2], 0).check(&lattice)), "overlap");
    let schwarz = |make: fn([usize; 2], usize) -> Schwarz, edit: fn(&mut Schwarz)| {
        key(with(make([2, 2], 2), edit).check(&lattice))
    };
    assert_eq!(schwarz(Schwarz::new, |s| s.robin = Auto::Value(1.0)), "robin");
    assert_eq!(schwarz(optimized, |s| s.robin = Auto::Value(0.0)), "robin");
    assert_eq!(schwarz(Schwarz::new, |s| s.tolerance = Some(f64::NAN)), "tolerance");
    let mut generator = Stochastic::new([2, 2], 0, EstimatorKind::default());
    generator.interface = Some(Interpolation { sample: 0, placement: Placement::Density });
    assert_eq!(key(generator.check(&lattice)), "interface.sample");
}

/// Nodes are drawn to where ρ is large: the cell at the bump shrinks, and equidistribution improves.
#[test]
fn the_mesh_follows_its_density() {
    let start = mesh([30, 30], [false; 2]);
    let density = |mesh: &Mesh<2>| -> Vec<f64> {
        mesh.x().iter().map(|[x, y]| 1.0 + 8.0 * (-20.0 * (x * x + (y - 2.5).powi(2))).exp()).collect()
    };
    let mut generator = Whole::default();
    let moved = (0..300).fold(start.clone(), |mesh, _| {
        generator
            .step(&Mmpde { relaxation: 0.1.into(), ..Mmpde::published() }, &mesh, &density(&mesh).into(), DT)
            .unwrap()
            .mesh
    });
    let figure = |mesh: &Mesh<2>| crate::geometry::quality(mesh, &density(mesh)).unwrap().equidistribution;
    assert!(figure(&moved) < 0.5 * figure(&start), "{} from {}", figure(&moved), figure(&start));
}

#[test]
fn a_density_that_does_not_fit_is_refused() {
    let start = mesh([5, 5], [false; 2]);
    let error = Whole::default().step(&Mmpde::published(), &start, &vec![1.0; 7].into(), DT).unwrap_err();
    assert_eq!(error, Failure::WrongLength { what: "the density", found: 7, expected: 36 });
}
