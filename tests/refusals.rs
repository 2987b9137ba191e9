//! What a user of the library gives wrongly is refused by name: it is not computed with, and nothing panics.

use driftmesh::density::{Arclength, Given, Monitor, RootGradient, Strength, smooth};
use driftmesh::geometry::{Density, Field, Lattice, Mesh, check_unfolded, quality};
use driftmesh::laplacian::{Laplacian, stencils};
use driftmesh::meshing::{
    Decomposition, Estimates, Estimator, EstimatorKind, Fixed, GridWalk, MeshGenerator, Mmpde, Moved, Problem,
    Relaxation, Schwarz, Steps, Stochastic, Strips, Whole,
};
use driftmesh::mover::{Followed, Gait, Mover};
use driftmesh::{Error, Failure};

const DT: f64 = 1e-3;

fn square(n: usize) -> Mesh<2> {
    Mesh::uniform(Lattice::bounded([n, n]).unwrap(), [0.0; 2], [1.0; 2]).unwrap()
}

fn step(equation: &Mmpde, mesh: &Mesh<2>, rho: &[f64], dt: f64) -> Result<Moved, Failure> {
    Whole::default().step(equation, mesh, &rho.to_vec().into(), dt)
}

#[track_caller]
fn assert_out_of_range<T>(result: Result<T, Failure>, parts: &[&str]) {
    let failure = result.err().expect("it is refused");
    assert_eq!(failure.name(), "out-of-range", "{failure}");
    for part in parts {
        assert!(failure.to_string().contains(part), "{part:?} is not in {failure}");
    }
}

#[track_caller]
fn assert_wrong_length<T>(result: Result<T, Failure>, found: usize, expected: usize) {
    match result.err().expect("it is refused") {
        Failure::WrongLength { found: f, expected: e, .. } => assert_eq!((f, e), (found, expected)),
        other => panic!("{other}"),
    }
}

/// A thin ring, a strong density without smoothing and steps as long as the published equation does not bear: it folds
/// within a few steps, and the step says so. The default equation, which studies have, does not fold.
#[test]
fn a_folded_mesh_is_no_step() {
    let monitor = Arclength { strength: Strength::Relative(300.0), smoothing: 0 };
    let run = |equation: Mmpde| {
        let (mut mesh, mut whole) = (square(40), Whole::default());
        for _ in 0..20 {
            let u: Vec<f64> = mesh.x().iter().map(|[x, y]| (40.0 * (x.hypot(*y) - 0.7)).tanh()).collect();
            let rho = monitor.density(&mesh, &u, None)?;
            mesh = whole.step(&equation, &mesh, &rho, 0.01)?.mesh;
            check_unfolded(&mesh).expect("a step returns no folded mesh");
        }
        Ok(mesh)
    };
    assert!(matches!(run(Mmpde::published()), Err(Failure::Folded { .. })));
    run(Mmpde::default()).unwrap();
}

/// A quarter ring: pulling its sides straight would destroy it. A mesh that stays may have any shape.
#[test]
fn a_mapped_mesh_is_refused() {
    let lattice = Lattice::bounded([8, 12]).unwrap();
    let ring = |[r, s]: [f64; 2]| [0.5, 0.0].map(|shift| (1.0 + r) * (std::f64::consts::PI * (0.5 * s + shift)).sin());
    let unit = Mesh::uniform(lattice, [0.0; 2], [1.0; 2]).unwrap();
    let mesh = Mesh::mapped(lattice, unit.x().iter().map(|&x| ring(x)).collect()).unwrap();
    let rho = vec![1.0; mesh.x().len()];
    let density = Density::from(rho.clone());
    let failure = step(&Mmpde::default(), &mesh, &rho, DT).unwrap_err();
    assert_eq!(failure.name(), "not-a-box");
    assert!(failure.to_string().starts_with("the mesh does not fill its box: along axis"), "{failure}");
    let generators: [Box<dyn MeshGenerator>; 2] =
        [Box::new(Schwarz::new([2, 2], 2)), Box::new(Stochastic::new([2, 2], 1, EstimatorKind::default()))];
    for mut generator in generators {
        assert!(matches!(generator.step(&Mmpde::default(), &mesh, &density, DT), Err(Failure::NotABox { .. })));
    }
    let moved =
        Mover::new(Whole::default()).step(&mesh, &Gait::at_rest(&mesh), Followed { u: &rho, rho: &density }, DT);
    assert!(matches!(moved, Err(Failure::NotABox { .. })));
    assert_eq!(Fixed::default().step(&Mmpde::default(), &mesh, &density, DT).unwrap().mesh, mesh);
    // a mesh that is mapped onto a box is one of a box
    let stretched = Mesh::mapped(lattice, unit.x().iter().map(|[x, y]| [x * x, 2.0 * y]).collect()).unwrap();
    step(&Mmpde::default(), &stretched, &rho, DT).unwrap();
}

/// ρ ≤ 0 or not finite, Δt ≤ 0, τ ≤ 0 and a prediction that nothing would read are refused by name.
#[test]
fn a_step_refuses_what_it_cannot_begin_with() {
    let (mesh, rho) = (square(4), vec![1.0; 25]);
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut rho = rho.clone();
        rho[7] = wrong;
        let failure = step(&Mmpde::default(), &mesh, &rho, DT).unwrap_err();
        let place = failure.to_string();
        assert!(place.contains("the mesh density is") && place.contains("node (1, 2)"), "{failure}");
        assert_eq!(failure.name(), if wrong.is_finite() { "not-positive" } else { "non-finite" });
    }
    for wrong in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
        assert_out_of_range(
            step(&Mmpde::default(), &mesh, &rho, wrong),
            &["the time step is", "finite number above 0"],
        );
        let equation = Mmpde { relaxation: Relaxation::Time(wrong), ..Mmpde::default() };
        assert_out_of_range(step(&equation, &mesh, &rho, DT), &["`relaxation` is", "finite number above 0"]);
    }
    let short = Mmpde { relaxation: Relaxation::steps(0.5), ..Mmpde::default() };
    assert_out_of_range(step(&short, &mesh, &rho, DT), &["`relaxation.steps` is 0.5"]);
    let steps = Relaxation::Steps(Steps { steps: 25.0, prediction: 0.2 });
    let predicted = Mmpde { relaxation: steps, ..Mmpde::default() };
    assert_out_of_range(step(&predicted, &mesh, &rho, DT), &["`relaxation.prediction` is 0.2", "Mover"]);
    assert_wrong_length(step(&Mmpde::default(), &mesh, &[1.0; 5], DT), 5, 25);
    let density = Density::from(rho.clone());
    // what the mover does with the same settings is what they say
    Mover::by(Box::<Whole>::default(), predicted)
        .step(&mesh, &Gait::at_rest(&mesh), Followed { u: &rho, rho: &density }, DT)
        .unwrap();
    let mut mover = Mover::new(Whole::default());
    assert_wrong_length(mover.step(&mesh, &Gait::at_rest(&mesh), Followed { u: &[0.0; 5], rho: &density }, DT), 5, 25);
    assert_wrong_length(
        mover.step(&mesh, &Gait::at_rest(&mesh), Followed { u: &rho, rho: &vec![1.0; 5].into() }, DT),
        5,
        25,
    );
}

/// Settings of generators are checked by their steps, those of an estimator of one's own, too.
#[test]
fn generators_check_their_settings() {
    let (mesh, rho) = (square(8), vec![1.0; 81]);
    let step =
        |mut generator: Box<dyn MeshGenerator>| generator.step(&Mmpde::default(), &mesh, &rho.clone().into(), DT);
    assert_out_of_range(step(Box::new(Schwarz::new([2, 2], 0))), &["`overlap` is 0", "set it to 1 or more"]);
    let mut schwarz = Schwarz::new([2, 2], 2);
    schwarz.tolerance = Some(-1.0);
    assert_out_of_range(step(Box::new(schwarz)), &["`tolerance` is -1"]);
    let none = EstimatorKind::GridWalk(GridWalk { walks: 0, increment: false });
    assert_out_of_range(step(Box::new(Stochastic::new([2, 2], 1, none))), &["`estimator.walks` is 0"]);

    struct Picky;
    impl Estimator for Picky {
        fn check(&self, decomposition: &Decomposition) -> driftmesh::Result<()> {
            Err(Error::invalid("points", decomposition.points().len(), "are too many for this one"))
        }
        fn estimate(&self, _: &Problem<'_>, _: &[usize], _: &mut Strips) -> Result<Estimates, Failure> {
            unreachable!("it is refused before")
        }
    }
    assert_out_of_range(
        step(Box::new(Stochastic::new([2, 2], 1, Picky))),
        &["`estimator.points` is 13, but are too many"],
    );
}

/// Monitors check their settings and the lengths of what they are given.
#[test]
fn monitors_check_what_they_are_given() {
    let mesh = square(8);
    let monitors: [&dyn Monitor; 3] = [&Arclength::default(), &Given::default(), &RootGradient::default()];
    for monitor in monitors {
        assert_wrong_length(monitor.density(&mesh, &[1.0; 5], None), 5, 81);
    }
    assert_wrong_length(Arclength::default().density(&mesh, &[1.0; 81], Some(&[[0.0; 2]; 3])), 3, 81);
    let negative = Arclength { strength: Strength::Absolute(-1e-3), smoothing: 0 };
    assert_out_of_range(negative.density(&mesh, &[1.0; 81], None), &["`strength.absolute` is -0.001", "0 or more"]);
    let endless = Given { smoothing: 1_000_000 };
    assert_out_of_range(endless.density(&mesh, &[1.0; 81], None), &["`smoothing` is 1000000"]);
}

/// Arrays of other lengths, rows that are not there, and positions that are no numbers.
#[test]
fn what_does_not_fit_is_refused() {
    let mesh = square(4);
    assert_wrong_length(smooth(mesh.lattice(), &mut [0.0; 5], 1), 5, 25);
    assert_wrong_length(quality(&mesh, &[1.0; 5]), 5, 25);
    assert_wrong_length(Field::joined(&[vec![0.0; 25], vec![0.0; 24]]), 24, 25);
    assert_out_of_range(Field::of(2, vec![0.0; 25]), &["the number of unknowns is 2", "25 values"]);
    assert_out_of_range(Field::of(0, vec![0.0; 25]), &["the number of unknowns is 0"]);
    for kind in [Laplacian::Optimised, Laplacian::Compact25] {
        let stencils = stencils(&mesh, kind).unwrap();
        assert_wrong_length(stencils.apply(&[0.0; 5]), 5, 25);
        assert_eq!((stencils.row(9999), stencils.row(stencils.patch().len())), (None, None));
        assert!(stencils.row(0).is_some());
    }
    let mut x = mesh.x().to_vec();
    x[7] = [0.5, f64::NAN];
    match mesh.moved(x).unwrap_err() {
        Failure::NonFinite { what: "the mesh", at, value } if *at.node == [1, 2] => assert!(value.is_nan()),
        other => panic!("{other}"),
    }
    let line = Mesh::uniform(Lattice::bounded([2]).unwrap(), [0.0], [1.0]).unwrap();
    let failure = line.moved(vec![[0.0], [f64::INFINITY], [1.0]]).unwrap_err();
    assert!(matches!(failure, Failure::NonFinite { ref at, .. } if *at.node == [1] && at.x.len() == 1), "{failure}");
}
