//! Random studies: each is completed or ends with a named error, and no mesh that a run shows is folded or off its box.

use crate::targets::line::dice::Dice;
use driftmesh::geometry::{Mesh, check_unfolded};
use driftmesh::simulation::{Event, Observer, Record, Retries, Snapshot};
use driftmesh::study::{Kind, MovingMesh, Source};
use driftmesh::{Error, Result};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Study number `n`.
fn study(n: u64) -> (String, MovingMesh) {
    let mut dice = Dice(n.wrapping_mul(0xD1B5_4A32_D192_ED03));
    let text = text(n, &mut dice);
    let study = MovingMesh::from_source(&Source::new("study.toml", &text));
    let study = study.unwrap_or_else(|error| panic!("study {n} is none: {error}\n{text}"));
    (text, study)
}

/// The study as text. Dice are cast in the order of the tables, so that a number stays the study that it is.
fn text(n: u64, dice: &mut Dice) -> String {
    let cells = [dice.whole(24, 40), dice.whole(24, 40)];
    let (pde, start, periodic) = pde(dice);
    let span = dice.between(0.05, 0.5) * if pde.contains("shallow-water") { 0.4 } else { 1.0 };
    let step = step(dice, span);
    let monitor = monitor(dice);
    let mesh = mesh(n, dice);
    format!(
        "[study]\nname = \"sweep-{n}\"\nkind = \"moving-mesh\"\n[domain]\nperiodic = {:?}\n[grid]\ncells = {cells:?}\n\
         [time]\nstart = {start}\nend = {}\n{step}\n[pde]\n{pde}\n[monitor]\n{monitor}\n[mesh]\n{mesh}\n",
        [periodic; 2],
        start + span
    )
}

/// An equation, the time at which it begins, and whether its axes are periodic.
fn pde(dice: &mut Dice) -> (String, f64, bool) {
    let viscosity = dice.between(1e-3, 1e-1);
    match dice.whole(0, 9) {
        0..=2 => {
            let convection = dice.of(["conservative", "advective", "flux"]);
            (format!("kind = \"burgers\"\nviscosity = {viscosity}\nconvection = \"{convection}\""), 0.25, false)
        }
        3..=4 => {
            let wave = "0.75 + 0.5*sin(2*pi*(x + y))";
            (format!("kind = \"burgers\"\nviscosity = {viscosity}\ninitial = \"{wave}\""), 0.0, true)
        }
        5..=6 => {
            let form = dice.of(["flux", "advective"]);
            let pile = dice.between(0.1, 2.5);
            let water = "gravity = 1.0\ndepth = 10.0\nradius = 0.2\nwidth = 0.06";
            (format!("kind = \"shallow-water\"\nform = \"{form}\"\npile = {pile}\n{water}"), 0.0, true)
        }
        7 => {
            let fisher = "unknowns = [\"u\"]\nsource = { u = \"8*u*(1 - u)\" }\nboundary = { u = \"no-flux\" }\n\
                          initial = { u = \"exp(-40*((x-0.3)^2 + (y-0.3)^2))\" }";
            (format!("kind = \"formula\"\n{fisher}\ndiffusivity = {{ u = {viscosity} }}"), 0.0, false)
        }
        8 => {
            let bump = "unknowns = [\"u\"]\nflux = { u = [\"u\", \"0.5*u\"] }\n\
                        initial = { u = \"exp(sin(2*pi*x) + sin(2*pi*y))\" }";
            (format!("kind = \"formula\"\n{bump}\ndiffusivity = {{ u = {viscosity} }}"), 0.0, true)
        }
        _ => {
            let both = "unknowns = [\"u\", \"v\"]\nflux = { u = [\"0.5*u^2\", \"0.5*u^2\"] }\n\
                        source = { v = \"u*(1 - v)\" }\n\
                        initial = { u = \"exp(-50*((x-0.3)^2+(y-0.3)^2))\", v = \"0\" }\n\
                        boundary = { u = \"0\", v = \"no-flux\" }";
            (format!("kind = \"formula\"\n{both}\ndiffusivity = {{ u = {viscosity}, v = 0.01 }}"), 0.0, false)
        }
    }
}

/// The time step of a run that lasts for `span`.
fn step(dice: &mut Dice, span: f64) -> String {
    match dice.whole(0, 3) {
        0 | 1 => format!("step = {}", span / dice.whole(20, 60) as f64),
        2 => "step = \"auto\"".into(),
        _ => format!("tolerance = {}", dice.between(1e-4, 1e-2)),
    }
}

fn monitor(dice: &mut Dice) -> String {
    match dice.whole(0, 5) {
        0 => "kind = \"auto\"".into(),
        _ => {
            let (strength, smoothing) = (dice.between(1.0, 1000.0), dice.whole(0, 6));
            let gradient = dice.of(["central", "log", "safe"]);
            format!(
                "kind = \"arclength\"\nstrength = {{ relative = {strength} }}\nsmoothing = {smoothing}\n\
                 gradient = \"{gradient}\""
            )
        }
    }
}

/// How the mesh moves.
fn mesh(n: u64, dice: &mut Dice) -> String {
    let relaxation = match dice.whole(0, 1) {
        0 => dice.between(0.05, 1.0).to_string(),
        _ => format!("{{ steps = {}, prediction = {} }}", dice.whole(10, 40), dice.of([0.0, 0.2])),
    };
    let (form, begin) = (dice.of(["gradient", "conservative"]), dice.of(["uniform", "adapted"]));
    let subdomains = [dice.whole(1, 8), dice.whole(1, 8)];
    let generator = match dice.whole(0, 9) {
        0 => "{ kind = \"fixed\" }".into(),
        1..=3 => "{ kind = \"whole\" }".into(),
        4..=5 => format!("{{ kind = \"schwarz\", subdomains = {subdomains:?}, overlap = {} }}", dice.whole(1, 2)),
        _ => {
            let estimator = estimator(dice);
            format!("{{ kind = \"stochastic\", subdomains = {subdomains:?}, seed = {n}, estimator = {estimator} }}")
        }
    };
    format!("relaxation = {relaxation}\nform = \"{form}\"\nstart = \"{begin}\"\ngenerator = {generator}")
}

fn estimator(dice: &mut Dice) -> String {
    match dice.whole(0, 3) {
        0 => "{ kind = \"residual-walk\" }".into(),
        3 => "{ kind = \"strip\" }".into(),
        1 => format!("{{ kind = \"grid-walk\", walks = {} }}", dice.whole(100, 1000)),
        _ => {
            let (paths, substeps) = (dice.whole(100, 1000), dice.whole(1, 4));
            format!("{{ kind = \"monte-carlo\", paths = {paths}, substeps = {substeps} }}")
        }
    }
}

/// Looks at every state of a run.
struct Watch;

impl Observer for Watch {
    fn observe(&mut self, _event: Event, snapshot: &Snapshot<'_>) -> Result<()> {
        let state = snapshot.state::<2>().unwrap();
        assert_sound(&state.mesh);
        assert!(state.u.values().iter().all(|u| u.is_finite()), "u is not finite at t = {}", state.t);
        Ok(())
    }
}

/// No cell is folded, and no node of a side has left it by a bit.
fn assert_sound(mesh: &Mesh<2>) {
    check_unfolded(mesh).unwrap();
    let lattice = mesh.lattice();
    for (k, x) in mesh.x().iter().enumerate() {
        for (d, [below, above]) in lattice.beyond(k).into_iter().enumerate() {
            assert!(!below || x[d] == mesh.lower()[d], "node {k} is at {x:?}");
            assert!(!above || x[d] == mesh.upper()[d], "node {k} is at {x:?}");
        }
    }
}

/// How a study ended: whether `[safety]` was needed, and the name of the error and what it says, if it was not
/// completed.
fn ended(n: u64) -> (bool, Option<(String, String)>) {
    let (text, study) = study(n);
    let mut record = Record::default();
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        let mut simulation = study.simulation()?;
        let mut state = study.start(&simulation, &mut record, &mut [])?;
        simulation.run(&mut state, &mut record, &mut [&mut Watch])?;
        assert_eq!(state.t, study.time.end, "it ends elsewhere");
        Ok(())
    }));
    let settings = || text.lines().skip(5).collect::<Vec<_>>().join("; ");
    let failed = match outcome {
        Ok(Ok(())) => None,
        Ok(Err(error @ Error::Failed { .. })) => {
            let Error::Failed { failure, .. } = &error else { unreachable!() };
            Some((failure.name().into(), format!("study {n}: {error}, {:?}\n    {}", record.safety, settings())))
        }
        Ok(Err(error)) => panic!("study {n}: {error}\n{text}"),
        Err(_) => panic!("study {n} panicked or showed what it must not\n{text}"),
    };
    (record.safety != Retries::default(), failed)
}

fn sweep(numbers: &[u64]) {
    let count = numbers.len();
    let timed = |n| {
        let begun = std::time::Instant::now();
        let ended = ended(n);
        let seconds = begun.elapsed().as_secs_f64();
        println!("study {n}: {seconds:.1} s");
        ended
    };
    let ended: Vec<_> = numbers.par_iter().copied().map(timed).collect();
    let mut names: BTreeMap<&str, usize> = BTreeMap::new();
    for (name, said) in ended.iter().filter_map(|(_, failed)| failed.as_ref()) {
        *names.entry(name).or_default() += 1;
        println!("{said}");
    }
    let share = |n: usize| 100.0 * n as f64 / count as f64;
    let completed = share(ended.iter().filter(|(_, failed)| failed.is_none()).count());
    let rescued = share(ended.iter().filter(|(needed, failed)| *needed && failed.is_none()).count());
    println!(
        "{count} studies: {completed:.1} % completed, {rescued:.1} % with the help of [safety]; the others: {names:?}"
    );
    assert!(completed >= 90.0, "only {completed:.1} % are completed");
}

/// Those of the first seventeen that take seconds; in 2, 6, 10 and 13 walks are so noisy that a hundred steps are tried
/// again, which takes minutes.
#[test]
fn random_studies_end_as_they_should() {
    sweep(&[0, 1, 3, 4, 5, 7, 8, 9, 11, 12, 14, 15, 16]);
}

#[test]
#[ignore = "minutes: make slow"]
fn five_hundred_random_studies_end_as_they_should() {
    sweep(&(0..500).collect::<Vec<_>>());
}
