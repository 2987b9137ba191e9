//! No folded mesh is accepted: what fails is tried again within limits, and what does not move is named.

use driftmesh::geometry::check_unfolded;
use driftmesh::simulation::{Event, Observer, Record, Snapshot, State};
use driftmesh::study::{Kind, MovingMesh, MovingRun, Source};
use driftmesh::{Error, Failure, Result};
use std::path::Path;

fn study(name: &str, assignments: &[&str]) -> MovingMesh {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(format!("{name}.toml"));
    let mut source = Source::read(&file).unwrap();
    assignments.iter().for_each(|assignment| source.set(assignment).unwrap());
    MovingMesh::from_source(&source).unwrap()
}

/// Keeps the times of all states, none of which is folded.
#[derive(Default)]
struct Times(Vec<f64>);

impl Observer for Times {
    fn observe(&mut self, event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        check_unfolded(&snapshot.state::<2>().unwrap().mesh)?;
        if event != Event::Finished {
            self.0.push(snapshot.t);
        }
        Ok(())
    }
}

struct Ran {
    state: State,
    record: Record,
    times: Vec<f64>,
    failure: Option<Error>,
}

fn ran(study: &MovingMesh) -> Ran {
    let mut simulation = study.simulation().unwrap();
    let (mut record, mut times) = (Record::default(), Times::default());
    let mut state = study.start(&simulation, &mut record, &mut []).unwrap();
    let failure = simulation.run(&mut state, &mut record, &mut [&mut times]).err();
    Ran { state, record, times: times.0, failure }
}

fn failure(ran: &Ran) -> &Failure {
    match &ran.failure {
        Some(Error::Failed { failure, .. }) => failure,
        other => panic!("{other:?}"),
    }
}

const OFF: &str = "safety={substeps=1, smoothing=0, halvings=0}";
/// Case B with ten times the density: without a retry its mesh folds.
const STEEP: [&str; 5] =
    ["monitor.strength.relative=300", "time.step=5e-3", "time.end=0.5", "time.report=[0.3,0.5]", "monitor.smoothing=0"];

/// The plain method folds and says so; with retries the same study ends, at the times of its schedule, and every
/// rejected step is accounted for.
#[test]
fn a_steep_density_folds_without_retries_only() {
    let plain = ran(&study("burgers-b-conservative", &[&STEEP[..], &[OFF]].concat()));
    assert!(matches!(failure(&plain), Failure::Folded { jacobian, .. } if *jacobian <= 0.0), "{:?}", plain.failure);
    let safe = ran(&study("burgers-b-conservative", &STEEP));
    assert!(safe.failure.is_none(), "{:?}", safe.failure);
    let schedule = study("burgers-b-conservative", &STEEP).simulation().unwrap().schedule;
    assert_eq!(safe.times, (0..=50).map(|n| schedule.time(n)).collect::<Vec<_>>());
    assert_eq!(safe.record.reports.iter().map(|report| report.t).collect::<Vec<_>>(), [0.3, 0.5]);
    let driftmesh::simulation::Retries { substeps, smoothed, shortened } = safe.record.safety;
    assert!(substeps > 0, "{:?}", safe.record.safety);
    assert_eq!(safe.record.work.rejected_steps, substeps + smoothed + shortened);
}

/// Each means alone is used, and no other.
#[test]
fn each_means_has_its_own_limit() {
    let with = |safety: &str| {
        let safety = format!("safety={safety}");
        let all = [&STEEP[..], &[&safety]].concat();
        ran(&study("burgers-b-conservative", &all)).record.safety
    };
    let parts = with("{substeps=16, smoothing=0, halvings=0}");
    assert!(parts.substeps > 0 && parts.smoothed == 0 && parts.shortened == 0, "{parts:?}");
    let passes = with("{substeps=1, smoothing=8, halvings=0}");
    assert!(passes.substeps == 0 && passes.smoothed > 0 && passes.shortened == 0, "{passes:?}");
    let halves = with("{substeps=1, smoothing=0, halvings=8}");
    assert!(halves.substeps == 0 && halves.smoothed == 0 && halves.shortened > 0, "{halves:?}");
}

/// When all is spent the run ends with the name of what failed, at a state that is good.
#[test]
fn spent_limits_end_a_run_by_name() {
    let set = ["monitor.strength.relative=1e9", "monitor.smoothing=0", "time.step=0.05", "mesh.relaxation=1e-4"];
    let ran =
        ran(&study("burgers-b-conservative", &[&set[..], &["safety={substeps=2, smoothing=1, halvings=1}"]].concat()));
    let folded = failure(&ran);
    assert!(matches!(folded, Failure::Folded { .. }), "{folded}");
    check_unfolded(&ran.state.mesh).unwrap();
    assert!(ran.record.safety.shortened >= 1, "{:?}", ran.record.safety);
}

/// A time step in which Newton's method stalls is done in parts, and met at its end.
#[test]
fn a_stalled_step_is_divided() {
    let set = ["pde.viscosity=1e-4", "time.step=0.5", "mesh.generator.kind=fixed", "time.report=[1.25]"];
    let plain = ran(&study("burgers-b-conservative", &[&set[..], &[OFF]].concat()));
    assert!(matches!(failure(&plain), Failure::NewtonStalled { .. }), "{:?}", plain.failure);
    let safe = ran(&study("burgers-b-conservative", &set));
    assert!(safe.failure.is_none(), "{:?}", safe.failure);
    assert!(safe.record.safety.shortened > 0 && safe.record.work.steps == 2, "{:?}", safe.record);
    assert_eq!((safe.state.t, safe.state.step), (1.25, 2));
}

/// Retries decide by numbers that do not depend on threads.
#[test]
fn retries_have_the_same_bits_on_any_number_of_threads() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ran(&study("burgers-b-conservative", &STEEP)))
    };
    let [one, three] = [1, 3].map(on);
    assert!(one.record.safety.substeps > 0);
    assert_eq!((one.state, one.record.safety), (three.state, three.record.safety));
}

/// Burgers' front on a mesh that stays, by steps of a tolerance or of a length.
fn front(time: &[&str]) -> Ran {
    let set = [
        "grid.cells=[20,20]",
        "pde.viscosity=0.02",
        "mesh.generator.kind=fixed",
        "time.end=0.75",
        "time.report=[0.4,0.75]",
    ];
    let ran = ran(&study("burgers", &[&set[..], time].concat()));
    assert!(ran.failure.is_none(), "{:?}", ran.failure);
    ran
}

/// Against very small steps on the same mesh the error falls with every halving of the tolerance, as its power 2/3: a
/// step of length Δt is off by Δt³, all of them by Δt².
#[test]
fn halving_the_tolerance_lowers_the_error() {
    let exact = front(&["time.step=1e-4"]).state.u;
    let tolerances: Vec<f64> = (0..6).map(|n| 5e-4 / f64::from(1 << n)).collect();
    let errors: Vec<f64> = tolerances
        .iter()
        .map(|tolerance| {
            let ran = front(&[&format!("time.tolerance={tolerance}")]);
            assert!(ran.times.contains(&0.4) && ran.state.t == 0.75);
            let pairs = ran.state.u.values().iter().zip(exact.values());
            pairs.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()))
        })
        .collect();
    assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
    let power = (errors[0] / errors[5]).ln() / 32_f64.ln();
    assert!((0.55..0.85).contains(&power), "the error falls with the tolerance to the power {power:.2}: {errors:?}");
}

/// A first step that is far too long is rejected, and no step is longer than the one given.
#[test]
fn steps_of_a_tolerance_are_rejected_and_bounded() {
    let long = front(&["time.tolerance=1e-4", "time.step=0.2"]);
    assert!(long.record.work.rejected_steps > 0, "{:?}", long.record.work);
    assert_eq!(long.record.safety, Default::default());
    let short = front(&["time.tolerance=0.1", "time.step=0.01"]);
    assert!(short.times.windows(2).all(|t| t[1] - t[0] < 0.01 * (4.0 / 3.0) + 1e-12), "{:?}", short.times);
    assert!(short.record.work.steps >= 37, "{:?}", short.record.work);
}

/// What a tolerance does not go with is refused by name.
#[test]
fn a_tolerance_alone_decides() {
    let refused = |set: &[&str]| {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/burgers.toml");
        let mut source = Source::read(&file).unwrap();
        set.iter().for_each(|assignment| source.set(assignment).unwrap());
        MovingMesh::from_source(&source).unwrap_err().to_string()
    };
    let said = refused(&["time.tolerance=1e-3", "time.step=auto"]);
    assert!(said.contains("`time.step` is \"auto\", but time.tolerance decides"), "{said}");
    let uniform = ["mesh.generator={kind=\"fixed\"}", "time.stepper=rk4", "time.tolerance=1e-3"];
    let said = refused(&uniform);
    assert!(said.contains("`time.tolerance`") && said.contains("rk4"), "{said}");
    let said = refused(&["pde={kind=\"prescribed\", u=\"x*t\"}", "time.tolerance=1e-3"]);
    assert!(said.contains("no error in time"), "{said}");
    assert!(refused(&["time.tolerance=1.0"]).contains("between 1e-5"));
    assert!(refused(&["safety.substeps=0"]).contains("`safety.substeps` is 0"));
}

/// The warning that the mesh does not move, if there is one.
fn resting(assignments: &[&str]) -> Option<String> {
    let short = ["grid.cells=[16,16]", "pde.viscosity=0.01", "time.end=0.75", "time.report=[0.75]", "time.step=0.01"];
    let (MovingRun { record, .. }, failure) = study("burgers", &[&short[..], assignments].concat()).compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    let mut warnings = record.warnings.into_iter().filter(|warning| warning.starts_with("the mesh does not move"));
    let warning = warnings.next();
    assert!(warnings.next().is_none());
    warning
}

/// Each reason by its name.
#[test]
fn a_mesh_that_does_not_move_is_named() {
    let arclength = "monitor.kind=arclength";
    for (set, reason) in [
        (
            vec!["mesh.relaxation=1e4", "mesh.start=uniform"],
            "it follows in about τ = 1.000e4, and the run lasts 5.000e-1",
        ),
        (vec!["mesh.relaxation={steps=100000}", "mesh.start=uniform"], "τ = 1.000e3"),
        (vec![arclength, "monitor.strength.absolute=0"], "`monitor.strength` is 0"),
        (vec![arclength, "monitor.smoothing=1000"], "`monitor.smoothing` = 1000 passes"),
        (vec![arclength, "monitor.of=\"0*u\""], "since what it follows is: 0*u"),
        (vec![arclength, "monitor.strength.absolute=1e-5"], "raise `monitor.strength`"),
    ] {
        let said = resting(&set).unwrap_or_else(|| panic!("{set:?} is not warned of"));
        assert!(said.contains(reason), "{set:?}: {said}");
    }
}

/// A mesh that moves is not, whatever moves it, nor one that is made to stay or need not move.
#[test]
fn a_mesh_that_moves_is_not_warned_of() {
    for set in [
        vec![],
        vec!["mesh.start=uniform"],
        vec!["mesh.start=uniform", "mesh.form=gradient", "mesh.relaxation=0.3", "monitor.kind=arclength"],
        vec!["mesh.generator={kind=\"stochastic\", subdomains=[2,2]}"],
        vec!["mesh.generator={kind=\"fixed\"}"],
        vec!["time.end=0.3", "time.report=[0.3]"],
    ] {
        assert_eq!(resting(&set), None, "{set:?}");
    }
}

/// Case B with ten times its density: all of it.
#[test]
#[ignore = "seconds: make slow"]
fn case_b_with_ten_times_the_density_completes() {
    let ran = ran(&study("burgers-b-conservative", &["monitor.strength.relative=300"]));
    assert!(ran.failure.is_none() && ran.record.work.steps == 1000, "{:?}", ran.failure);
}

/// Case B with a fifth of its viscosity on 81 × 81 nodes: the conservative form does, with [safety] or without.
#[test]
#[ignore = "many seconds: make slow"]
fn case_b_with_a_thin_front_completes() {
    let set = ["pde.viscosity=1e-3", "grid.cells=[80,80]"];
    for off in [&[][..], &[OFF]] {
        let ran = ran(&study("burgers-b-conservative", &[&set[..], off].concat()));
        assert!(ran.failure.is_none(), "{off:?}: {:?}", ran.failure);
        let worst = ran.record.reports.iter().map(|report| report.error.unwrap().linf).fold(0.0, f64::max);
        assert!(worst < 0.1, "{off:?}: {worst}");
    }
}
