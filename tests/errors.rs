//! Every variant of the library's errors, triggered once and read.

use driftmesh::density::{Arclength, Given, Monitor};
use driftmesh::equidistribution::{Coarse, FaceDensity, Line, LineDensity, Measure, Method, Stop, Sweep};
use driftmesh::error::Unfit;
use driftmesh::geometry::{Density, Field, Lattice, Mesh, Patch, check_unfolded};
use driftmesh::meshing::{EstimatorKind, GridWalk, MeshGenerator, Mmpde, Schwarz, Stochastic, Whole};
use driftmesh::numerics::linear::{LatticeMatrix, LinearSolver, Robust};
use driftmesh::output::RunDirectory;
use driftmesh::physics::{Burgers, Convection, FormulaPde, Motion, Physics, Prescribed, ShallowWater, UniformBurgers};
use driftmesh::simulation::Schedule;
use driftmesh::study::{Begin, Kind, MovingMesh, Source};
use driftmesh::{Error, Failure};
use std::collections::BTreeSet;
use std::sync::Mutex;

#[path = "../examples/errors.rs"]
mod reference;

/// Names of the failures that were triggered.
static TRIGGERED: Mutex<BTreeSet<&str>> = Mutex::new(BTreeSet::new());

fn mesh() -> Mesh<2> {
    Mesh::uniform(Lattice::bounded([8, 8]).unwrap(), [0.0; 2], [1.0; 2]).unwrap()
}

/// The message, the remedy and the exit status of an error.
fn assert_says(error: impl Into<Error>, message: &[&str], help: Option<&str>, failure: bool) {
    let error = error.into();
    if let Error::Failed { failure, .. } = &error {
        TRIGGERED.lock().unwrap().insert(failure.name());
    }
    for part in message {
        assert!(error.to_string().contains(part), "{part:?} is not in {error}");
    }
    match (help, error.help()) {
        (Some(part), Some(said)) => assert!(said.contains(part), "{part:?} is not in {said}"),
        (None, None) => {}
        (wanted, said) => panic!("help is {said:?}, wanted {wanted:?}"),
    }
    assert_eq!(error.is_failure(), failure);
}

#[test]
fn folded() {
    let mut x = mesh().x().to_vec();
    x[40] = [0.9, 0.9];
    let error = check_unfolded(&mesh().moved(x).unwrap()).unwrap_err();
    assert_eq!(error.name(), "mesh-folded");
    assert_says(error, &["the mesh folded: cell (", "scaled Jacobian -"], Some("smoothing of the density"), true);
}

#[test]
fn non_finite() {
    let mut u = vec![0.0; 81];
    u[10] = f64::NAN;
    let error = Arclength::default().density(&mesh(), &u, None).unwrap_err();
    assert_eq!(error.name(), "non-finite");
    assert_says(error, &["the mesh density is NaN at node (0, 0)"], Some("time step"), true);

    let mut burgers = Burgers::new(0.01, Convection::Conservative).unwrap();
    let motion = Motion { t: 0.0, dt: 1e-3, old: &mesh(), new: &mesh() };
    let error = burgers.step(motion, &Field::scalar(u)).unwrap_err();
    assert_says(error, &["u is NaN at node (1, 1), x = 0.1250, y = 0.1250"], Some("time step"), true);
}

/// A formula says what it was given.
#[test]
fn formula() {
    let pde = "unknowns = [\"u\"]\nsource = { u = \"sqrt(u - x)\" }\ninitial = { u = 0.1 }";
    let mut pde = toml::from_str::<FormulaPde>(pde).unwrap().into_physics().unwrap();
    let (u, motion) = (pde.initial(0.0, &mesh()), Motion { t: 0.0, dt: 1e-3, old: &mesh(), new: &mesh() });
    let error = pde.step(motion, &u).unwrap_err();
    assert_eq!(error.name(), "formula");
    let message = "`pde.source.u` is NaN at node (1, 0), x = 0.1250, y = 0.0000, where u = 0.1000";
    assert_says(error, &[message], Some("mend the formula"), true);
}

#[test]
fn not_positive() {
    let mesh = Mesh::uniform(Lattice::new([8, 8], [true; 2]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let mut values = vec![[1.0, 0.0, 0.0]; 64];
    values[9][0] = -0.25;
    let motion = Motion { t: 0.0, dt: 1e-3, old: &mesh, new: &mesh };
    let error = ShallowWater::default().step(motion, &Field::nodal(values)).unwrap_err();
    assert_eq!(error.name(), "not-positive");
    let message = "the depth h is -2.500e-1, not positive, at node (1, 1), x = 0.1250, y = 0.1250";
    assert_says(error, &[message], Some("time step"), true);
}

/// Diffusivities that are formulas, negative from the start on, or later.
#[test]
fn negative_diffusivities() {
    // that of the start at once, the other once it is
    for (diffusivity, when) in [("0.5 - x", "t = 0.0"), ("0.03 - t", "t = 0.0")] {
        let text = format!(
            "[study]\nname = \"negative\"\nkind = \"moving-mesh\"\n[grid]\ncells = [10, 10]\n\
             [time]\nstart = 0\nend = 0.4\nstep = 0.01\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\n\
             initial = {{ u = \"sin(3*x)\" }}\nboundary = {{ u = \"no-flux\" }}\n\
             diffusivity = {{ u = \"{diffusivity}\" }}\n"
        );
        let study = driftmesh::study::Study::from_source(&driftmesh::study::Source::new("the study", text)).unwrap();
        let out = tempfile::tempdir().unwrap();
        let error = study.run(out.path(), Begin::Anew, &mut []).map_or_else(|error| error, |failure| failure.unwrap());
        assert_says(error, &["the diffusivity of a formula is -", when], Some("mend the formula"), true);
    }
}

/// Water that a step leaves dry is refused too: two nodes throw it out faster than there is any.
#[test]
fn run_dry() {
    let mesh = Mesh::uniform(Lattice::new([16, 2], [true; 2]).unwrap(), [0.0; 2], [16.0, 2.0]).unwrap();
    let velocity = |k: usize| [0.0, 40.0, 0.0, -40.0][k / 2 % 4];
    let values: Vec<[f64; 3]> = (0..32).map(|k| [1.0, velocity(k), 0.0]).collect();
    let motion = Motion { t: 0.0, dt: 0.05, old: &mesh, new: &mesh };
    let error = ShallowWater::default().step(motion, &Field::nodal(values)).unwrap_err();
    assert_says(error, &["the depth h is -"], Some("time step"), true);
}

#[test]
fn not_periodic() {
    let mut water = ShallowWater::default();
    let u = water.initial(0.0, &mesh());
    let motion = Motion { t: 0.0, dt: 1e-3, old: &mesh(), new: &mesh() };
    let error = water.step(motion, &u).unwrap_err();
    assert_eq!(error.name(), "not-periodic");
    assert_says(
        error,
        &["shallow water equations need periodic axes, but axis 0"],
        Some("periodic axes to [true, true]"),
        true,
    );
}

#[test]
fn not_uniform() {
    let mut x = mesh().x().to_vec();
    x[40][0] += 0.01;
    let bent = mesh().moved(x).unwrap();
    let mut burgers = UniformBurgers::new(Burgers::new(0.1, Convection::Conservative).unwrap(), 2).unwrap();
    let u = burgers.initial(0.0, &mesh());
    let motion = Motion { t: 0.0, dt: 1e-3, old: &mesh(), new: &bent };
    let error = burgers.step(motion, &u).unwrap_err();
    assert_eq!(error.name(), "not-uniform");
    let message = ["rk4 needs the uniform mesh", "axis 0 node (4, 4), x = 0.5100, y = 0.5000, is off by 1.0e-2"];
    assert_says(error, &message, Some("generator to { kind = \"fixed\" }"), true);
}

#[test]
fn many_substeps() {
    let mut burgers = UniformBurgers::new(Burgers::new(1e9, Convection::Conservative).unwrap(), 4).unwrap();
    let u = burgers.initial(0.0, &mesh());
    let motion = Motion { t: 0.0, dt: 1.0, old: &mesh(), new: &mesh() };
    let error = burgers.step(motion, &u).unwrap_err();
    assert_eq!(error.name(), "many-substeps");
    assert_says(
        error,
        &["would take 2.6e11 explicit substeps for speeds up to 5.0e-1"],
        Some("leave the stepper"),
        true,
    );
    for huge in [1e150, 1e308] {
        let error = burgers.step(motion, &Field::scalar(vec![huge; 81])).unwrap_err();
        assert_eq!(error.name(), "many-substeps");
    }
}

#[test]
fn newton_stalled() {
    let mut burgers = Burgers::new(1e-6, Convection::Conservative).unwrap();
    let u = burgers.initial(0.5, &mesh());
    let motion = Motion { t: 0.5, dt: 10.0, old: &mesh(), new: &mesh() };
    let error = burgers.step(motion, &u).unwrap_err();
    assert_eq!(error.name(), "newton-stalled");
    assert_says(error, &["Newton's method stalled: residual", "iterations"], Some("time step"), true);
}

#[test]
fn vanishing_step() {
    let text = "[study]\nname = \"blow-up\"\nkind = \"moving-mesh\"\n[grid]\ncells = [40, 40]\n[time]\nstart = 0\n\
                end = 1\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\nsource = { u = \"u^2\" }\n\
                diffusivity = { u = \"1e-4\" }\n\
                initial = { u = \"1 + exp(-((x-0.5)^2 + (y-0.5)^2)/0.1^2)\" }\nboundary = { u = \"no-flux\" }";
    let study = MovingMesh::from_source(&Source::new("blow-up.toml", text)).unwrap();
    let (_, failure) = study.compute().unwrap();
    let message = ["time steps shrank to", "the solution grows faster than any step can follow"];
    assert_says(failure.unwrap(), &message, Some("the end of the run"), true);
}

#[test]
fn linear_stalled() {
    let singular = LatticeMatrix::<2, 5>::zero(Patch { origin: [1; 2], size: [3; 2], wraps: [false; 2] });
    let error = Robust::default().solve(&singular, &[[1.0]; 9], &mut [[0.0]; 25], [1e-9]).unwrap_err();
    assert_eq!(error.name(), "linear-stalled");
    assert_says(
        error,
        &["linear system of 9 unknowns", "residual 1.0e0"],
        Some("relaxation of the mesh equation"),
        true,
    );
}

/// One step of a generator under a density that rises at once.
fn step(mut generator: impl MeshGenerator, height: f64, dt: f64) -> Failure {
    let rho: Density = mesh().x().iter().map(|[x, _]| if *x < 0.4 { 1.0 } else { height }).collect();
    generator.step(&Mmpde::published(), &mesh(), &rho, dt).unwrap_err()
}

#[test]
fn steep_density() {
    let error = step(Stochastic::new([2, 2], 0, EstimatorKind::default()), 1e3, 1e-3);
    assert_eq!(error.name(), "steep-density");
    let message = "the density is too steep for random walks: |b|h = 499.500 at node (3, 1), x = 0.3750, y = 0.1250";
    assert_says(error, &[message, "at most 2"], Some("gradient of the density to \"safe\""), true);
}

#[test]
fn noisy_interface() {
    let walks = EstimatorKind::GridWalk(GridWalk { walks: 2, increment: false });
    let error = step(Stochastic::new([2, 2], 0, walks), 1.5, 1.0);
    assert_eq!(error.name(), "noisy-interface");
    let message = ["interface values are too noisy: standard error", "shortest edge", "Δt/(τh²) = 64"];
    assert_says(error, &message, Some("walks or paths of the estimator"), true);
}

#[test]
fn long_walks() {
    let walks = EstimatorKind::GridWalk(GridWalk { walks: 1 << 31, increment: false });
    let error = step(Stochastic::new([2, 2], 0, walks), 1.5, 1.0);
    assert_eq!(error.name(), "long-walks");
    let message = ["2147483648 random walks from each of 13 points", "Δt/(τh²) = 6.4e1", "jumps a walk"];
    assert_says(error, &message, Some("relaxation of the mesh equation"), true);
}

#[test]
fn schwarz_stalled() {
    let mut schwarz = Schwarz::new([2, 2], 1);
    schwarz.iterations = 2;
    let error = step(schwarz, 1.5, 1.0);
    assert_eq!(error.name(), "schwarz-stalled");
    assert_says(error, &["the Schwarz iteration stalled: change", "after 2 iterations"], Some("overlap"), true);
}

#[test]
fn subdomains() {
    let error = step(Stochastic::new([9, 2], 0, EstimatorKind::default()), 1.5, 1e-3);
    assert_eq!(error.name(), "subdomains");
    assert_says(error, &["[9, 2] subdomains do not fit [8, 8] cells"], Some("one subdomain"), true);
}

/// A formula shows its place; a density that is negative or not a number somewhere says where.
#[test]
fn formulas() {
    let refused = |u: Option<&str>, rho: Option<&str>| {
        Prescribed { u: u.map(Into::into), rho: rho.map(Into::into) }.check().unwrap_err()
    };
    let error = refused(Some("x + sinn(y)"), None);
    assert_says(error, &["`u`: ", "sinn", "\n      ^^^^"], Some("sin"), false);
    assert_says(refused(None, None), &["`u` is not given", "needs a formula"], None, false);
    assert_says(refused(Some("1"), Some("1")), &["`rho`", "only one of u and rho"], None, false);
    let burgers = Burgers::new(0.1, Convection::Conservative).unwrap();
    assert_says(burgers.clone().from("x +", None).unwrap_err(), &["`initial`: "], None, false);
    let prescribed = Prescribed { rho: Some("0.5 - x".into()), ..Prescribed::default() }.field().unwrap();
    let rho: Vec<f64> = prescribed.initial(0.0, &mesh()).values().to_vec();
    let error = Given::default().density(&mesh(), &rho, None).unwrap_err();
    let message = "the mesh density is 0.000e0, not positive, at node (4, 0), x = 0.5000, y = 0.0000";
    assert_says(error, &[message], Some("mend the formula"), true);
}

#[test]
fn not_a_box() {
    let mut x = mesh().x().to_vec();
    x[0] = [0.01, 0.0];
    let error =
        Whole::default().step(&Mmpde::default(), &mesh().moved(x).unwrap(), &vec![1.0; 81].into(), 1e-3).unwrap_err();
    assert_eq!(error.name(), "not-a-box");
    let message = "the mesh does not fill its box: along axis 0 node (0, 0), x = 0.0100, y = 0.0000, is off";
    assert_says(error, &[message, "by 1.0e-2"], Some("map it to the domain"), true);
}

#[test]
fn out_of_range() {
    let error = Whole::default().step(&Mmpde::default(), &mesh(), &vec![1.0; 81].into(), -1.0).unwrap_err();
    assert_eq!(error.name(), "out-of-range");
    assert_says(error, &["the time step is -1, but must be a finite number above 0"], Some("give a value"), true);
}

#[test]
fn wrong_length() {
    let error = Whole::default().step(&Mmpde::published(), &mesh(), &vec![1.0; 3].into(), 1e-3).unwrap_err();
    assert_eq!(error.name(), "wrong-length");
    assert_says(error, &["the density has 3 values, but the lattice has 81 nodes"], Some("lattice order"), true);
    assert!(matches!(mesh().moved(vec![]).unwrap_err(), Failure::WrongLength { found: 0, expected: 81, .. }));
}

#[test]
fn failed_at_a_moment() {
    let failure = mesh().moved(vec![[f64::NAN; 2]; 81]).unwrap_err();
    let moment = Some(driftmesh::error::Moment { t: 0.312, step: 62 });
    assert_says(
        Error::Failed { failure, moment },
        &["at t = 0.312000 (step 62): the mesh is NaN"],
        Some("time step"),
        true,
    );
}

#[test]
fn invalid() {
    assert_says(Burgers::new(-1.0, Convection::Advective).unwrap_err(), &["`viscosity` is -1, but must"], None, false);
    assert_says(Lattice::bounded([1, 5]).unwrap_err(), &["`cells` is [1, 5]", "at least 2"], None, false);
    assert_says(Lattice::bounded([usize::MAX, 5]).unwrap_err(), &["cannot be counted"], None, false);
    let dry = ShallowWater { pile: -10.0, ..ShallowWater::default() };
    assert_says(dry.check().unwrap_err(), &["`pile` is -10", "above -depth = -10"], None, false);
    let steep = ShallowWater { width: 0.0, ..ShallowWater::default() };
    assert_says(steep.check().unwrap_err(), &["`width` is 0", "above 0"], None, false);
    assert_says(Schedule::new(1.0, 0.0, 0.1, vec![]).unwrap_err(), &["`end` is 0"], None, false);
}

#[test]
fn study() {
    let mut source = Source::new("my.toml", include_str!("../studies/burgers-b-stochastic.toml"));
    source.set("pde.viscosty=1").unwrap();
    let error = MovingMesh::from_source(&source).unwrap_err();
    assert_says(
        error,
        &["unknown key `viscosty`", "--set:1:5", "    ^^^^^^^^"],
        Some("did you mean `viscosity`?"),
        false,
    );
}

#[test]
fn unreadable() {
    let error = Source::read(std::path::Path::new("no/such/study.toml")).unwrap_err();
    assert_says(error, &["cannot read no/such/study.toml"], None, false);
}

/// Each file is named with what is wrong with it, and the remedy depends on that.
#[test]
fn unfit_checkpoints() {
    let error = |unfit: Unfit| Error::Checkpoint { refused: vec![("out/checkpoint.0".into(), unfit)] };
    let other = Unfit::Study { key: "time.step".into(), was: "0.01".into(), is: "not given".into() };
    let said =
        "cannot go on: out/checkpoint.0: it belongs to a study in which `time.step` is 0.01; here it is not given";
    assert_says(error(other), &[said], Some("study.toml"), false);
    let version = Unfit::Version { found: "0.0.9".into() };
    assert_says(error(version), &["it was written by driftmesh 0.0.9, and this is"], Some("that version"), false);
    let earlier = Unfit::Earlier { was: 2.0, is: 1.5 };
    assert_says(error(earlier), &["complete up to t = 2, and here it would end at t = 1.5"], Some("later"), false);
    assert_says(error(Unfit::Missing), &["it is not there, and a complete run"], Some("leave --resume out"), false);
    assert_says(error(Unfit::Foreign), &["it is no checkpoint"], Some("leave --resume out"), false);
    let damaged = Unfit::Damaged("its checksum does not match".into());
    assert_says(error(damaged), &["it is damaged: its checksum"], Some("leave --resume out"), false);
    let beside = Unfit::Beside { file: "history.csv".into(), reason: "it is short".into() };
    assert_says(error(beside), &["history.csv does not go with it: it is short"], Some("leave --resume out"), false);
}

#[test]
fn unwritable_busy_and_foreign() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("file"), "").unwrap();
    let error = RunDirectory::claim(&place.path().join("file/below")).unwrap_err();
    assert!(matches!(error, Error::Unwritable { .. } | Error::Unreadable { .. }), "{error}");
    let claimed = RunDirectory::claim(&place.path().join("mine")).unwrap();
    std::fs::remove_dir_all(claimed.path()).unwrap();
    assert_says(
        claimed.write("summary.json", b"{}").unwrap_err(),
        &["cannot write", "summary.json"],
        Some("free some space"),
        true,
    );

    let held = RunDirectory::claim(&place.path().join("held")).unwrap();
    let error = RunDirectory::claim(held.path()).unwrap_err();
    assert_says(error, &["another run is writing to", "held"], Some("--out"), false);
    drop(held);
    RunDirectory::claim(&place.path().join("held")).unwrap();

    let error = RunDirectory::check(place.path()).unwrap_err();
    assert_says(error, &["is not empty and was not written by driftmesh", "file"], Some("--out"), false);
}

/// A mesh of 4 × 4 cells from its mapping of the unit square.
fn image(map: impl Fn([f64; 2]) -> [f64; 2]) -> Mesh<2> {
    let lattice = Lattice::bounded([4, 4]).unwrap();
    let x = (0..lattice.len()).map(|k| map(lattice.node(k).map(|i| i as f64 / 4.0)));
    Mesh::mapped(lattice, x.collect()).unwrap()
}

#[test]
fn self_touching() {
    let around = image(|[s, r]| [(1.0 + s) * (7.0 * r).cos(), (1.0 + s) * (7.0 * r).sin()]);
    let failure = driftmesh::geometry::check_simple(&around).unwrap_err();
    assert_says(failure, &["touches itself", "in cells ("], Some("map of the domain"), true);
}

/// Cells so small that weights overflow.
#[test]
fn degenerate_stencil() {
    use driftmesh::laplacian::{Laplacian, stencils};
    let tiny = image(|x| x.map(|x| 1e-155 * x));
    for kind in [Laplacian::Optimised, Laplacian::Harmonic, Laplacian::Mapped, Laplacian::Compact25] {
        let error = stencils(&tiny, kind).unwrap_err();
        assert_says(error, &["give no Laplacian", "node (1, 1)"], Some("distortion"), true);
    }
}

/// A front at height `h` below the lid y = 2, temperatures 1 and −1 at the walls.
struct Flat(fn(f64) -> f64, f64);

impl driftmesh::stefan::Problem for Flat {
    fn boundary(&self, phase: usize, _x: [f64; 2], _t: f64) -> f64 {
        if phase == driftmesh::stefan::LOWER { self.1 } else { -self.1 }
    }

    fn initial(&self, _phase: usize, [x, y]: [f64; 2]) -> f64 {
        self.1 * (self.0(x) - y)
    }

    fn initial_front(&self, x: f64) -> f64 {
        self.0(x)
    }

    fn exact_front(&self, _x: f64, _t: f64) -> Option<f64> {
        None
    }

    fn exact(&self, _x: [f64; 2], _t: f64) -> Option<f64> {
        None
    }
}

#[test]
fn fronts() {
    use driftmesh::stefan::{Columns, Front, Material, Stepping};
    let mut front = {
        let columns = Columns::new([0.0, 1.0], [&|_| 0.0, &|_| 2.0], [10, 8, 8], 1.5).unwrap();
        Front::new(columns, Material::diffusing([1.0, 1.0], 1.0).unwrap())
    };
    front.stepping = Stepping::Explicit;
    let start = |problem: Flat| front.start(&problem, 0.0).unwrap_err();
    assert_says(start(Flat(|_| 3.0, 1.0)), &["left the box", "the top at y = 2.0"], Some("the end of the run"), true);
    assert_says(
        start(Flat(|_| -1.0, 1.0)),
        &["left the box", "the bottom at y = 0.0"],
        Some("the end of the run"),
        true,
    );
    assert_says(start(Flat(|_| 1.999, 1.0)), &["the upper phase vanishes at x = "], Some("the end of the run"), true);
    assert_says(
        start(Flat(|x| if x < 0.5 { 0.1 } else { 1.9 }, 1.0)),
        &["stops being a graph"],
        Some("the cells"),
        true,
    );
    assert_says(start(Flat(|_| 1.0, -1.0)), &["wrong side", "ill-posed"], Some("initial"), true);
    let problem = Flat(|_| 1.0, 1.0);
    let mut state = front.start(&problem, 0.0).unwrap();
    let before = state.clone();
    let error = front.step(&problem, &mut state, 1.0).unwrap_err();
    assert_says(error, &["past the stability limit"], Some("stepping of the front"), true);
    assert_eq!(state, before);
    let error = front.step(&Flat(|_| 1.0, -1.0), &mut state, 1e-3).unwrap_err();
    assert_says(error, &["the bottom is at -1"], Some("the end of the run"), true);
}

#[test]
fn not_a_run() {
    let directory = tempfile::tempdir().unwrap();
    let error = driftmesh::report::build(directory.path()).unwrap_err();
    assert_says(error, &["is no run directory: it has no summary.json"], Some("driftmesh run"), false);
}

#[test]
fn line_density() {
    let line = Line::new(LineDensity::formula("sqrt(0.5 - x)").unwrap(), 10);
    let error = line.solve(0.0, &line.uniform(), None).unwrap_err();
    assert_says(
        error,
        &["M is 0e0 at x = 0.5", "above 0 on the whole line: add a floor"],
        Some("change the density so"),
        true,
    );
}

#[test]
fn line_stalled() {
    let line = Line::new(LineDensity::formula("if(x < 0.3, 1, 50)").unwrap(), 100);
    let error = line.solve(0.0, &line.uniform(), None).unwrap_err();
    assert_says(error, &["stalled on the line", "residual"], Some("face density"), true);
}

/// Iterates of the linearised method pass each other, and a layer may be thinner than numbers tell apart.
#[test]
fn line_meshes_out_of_order() {
    let line = Line::new(LineDensity::arclength("tanh(10*(x - 0.3))").unwrap(), 100);
    let method = Method::Classical { sweep: Sweep::Parallel, linearized: true, coarse: Coarse::None };
    let stop = Stop { iterations: 50, tolerance: None, measure: Measure::Error };
    let history = line.iterate(0.0, &[[0, 51], [49, 100]], method, &line.uniform(), None, stop).unwrap();
    let message = ["the subdomains do not agree on an order: after 50 iterations node"];
    assert_says(history.missed(method, stop).unwrap(), &message, Some("raise the iterations"), true);
    let far = LineDensity::arclength("tanh((x - 1000000.3)/1e-8)").unwrap();
    let thin = Line { face: FaceDensity::Exact, ends: [1e6, 1e6 + 1.0], ..Line::new(far, 1000) };
    let message = ["of 1000 cells and the one before it are the same number, x = 1000000."];
    assert_says(thin.equidistributed(0.0).unwrap_err(), &message, Some("the cells"), true);
}

#[test]
fn not_converged() {
    let line = Line::new(LineDensity::formula("x^2 + 1").unwrap(), 20);
    let method = Method::Classical { sweep: Sweep::Parallel, linearized: false, coarse: Coarse::None };
    let stop = Stop { iterations: 3, tolerance: Some(1e-10), measure: Measure::Increment };
    let history = line.iterate(0.0, &[[0, 11], [9, 20]], method, &line.uniform(), None, stop).unwrap();
    let failure = history.missed(method, stop).unwrap();
    assert_eq!(failure.name(), "not-converged");
    assert_says(
        failure,
        &["the increment is", "after 3 iterations", "more would do"],
        Some("raise the iterations"),
        true,
    );
    // what cannot be iterated at all is a mistake
    let alone = line.iterate(0.0, &[[0, 10], [10, 20]], method, &line.uniform(), None, stop).unwrap_err();
    assert_says(alone, &["do not overlap"], None, false);
    let short = line.solve(0.0, &[0.0, 1.0], None).unwrap_err();
    assert_says(short, &["`guess` is 2 nodes, but 20 cells have 21"], None, false);
}

/// An observer that ends the run after the third step.
struct Impatient;

impl driftmesh::simulation::Observer for Impatient {
    fn observe(
        &mut self,
        _event: driftmesh::simulation::Event,
        snapshot: &driftmesh::simulation::Snapshot<'_>,
    ) -> driftmesh::Result<()> {
        let state = snapshot.state::<2>().unwrap();
        match state.step {
            3 => Err(Error::Interrupted(driftmesh::error::Moment { t: state.t, step: state.step })),
            _ => Ok(()),
        }
    }
}

/// The last good state is there, and the summary says why the run ended.
#[test]
fn interrupted_runs_leave_their_last_state() {
    let directory = tempfile::tempdir().unwrap();
    let source = driftmesh::study::Source::read("studies/burgers-b-conservative.toml".as_ref()).unwrap();
    let study = driftmesh::study::Study::from_source(&source).unwrap();
    let failure = study.run(directory.path(), Begin::Anew, &mut [&mut Impatient]).unwrap().unwrap();
    assert_says(failure, &["interrupted at t = 0.253", "(step 3)"], None, true);
    let summary = std::fs::read_to_string(directory.path().join("summary.json")).unwrap();
    assert!(summary.contains("\"status\": \"interrupted\"") && directory.path().join("final.npz").is_file());
}

/// No failure is without a test, and the page about them is that of the code.
#[test]
fn every_failure_is_triggered_and_documented() {
    let tests = [
        folded,
        non_finite,
        formula,
        not_positive,
        not_periodic,
        not_uniform,
        many_substeps,
        newton_stalled,
        vanishing_step,
        linear_stalled,
        steep_density,
        noisy_interface,
        long_walks,
        schwarz_stalled,
        subdomains,
        not_a_box,
        out_of_range,
        wrong_length,
        self_touching,
        degenerate_stencil,
        fronts,
        line_density,
        line_stalled,
        line_meshes_out_of_order,
        not_converged,
    ];
    tests.iter().for_each(|trigger| trigger());
    let triggered = TRIGGERED.lock().unwrap().clone();
    let missing: Vec<&str> = Failure::all().map(|[name, _]| name).filter(|name| !triggered.contains(name)).collect();
    assert!(missing.is_empty(), "no test triggers {missing:?}");
    let page = include_str!("../docs/errors.md");
    assert!(
        page == reference::page(),
        "docs/errors.md is old: cargo run --release -p driftmesh --example errors > docs/errors.md"
    );
}
