//! Equations written as formulas: orders against an exact solution, what is conserved, and how mistakes are shown.

use driftmesh::geometry::{DualCells, Field, Lattice, Mesh};
use driftmesh::physics::{FormulaPde, Motion, Physics};
use driftmesh::simulation::Record;
use driftmesh::study::{Kind, MovingMesh, MovingRun, Source};
use driftmesh::{Error, Failure};

fn physics(text: &str) -> Box<dyn Physics> {
    toml::from_str::<FormulaPde>(text).unwrap().into_physics().unwrap()
}

fn square(n: usize) -> Mesh<2> {
    Mesh::uniform(Lattice::bounded([n, n]).unwrap(), [0.0; 2], [1.0; 2]).unwrap()
}

/// A smooth mesh that is neither uniform nor orthogonal, and moves with t, also along the sides.
fn distorted(n: usize, t: f64) -> Mesh<2> {
    let (mesh, turn) = (square(n), std::f64::consts::TAU);
    let bent = |x: f64, y: f64| x + 0.07 * (turn * x).sin() * (turn * y + 2.0 * t).cos();
    mesh.moved(mesh.x().iter().map(|&[x, y]| [bent(x, y), bent(y, x + 0.3)]).collect()).unwrap()
}

/// A mesh with every node up to a fifth of a cell away from its uniform place, those of sides along these.
fn random(n: usize, seed: &mut u64) -> Mesh<2> {
    let mesh = square(n);
    let moved = mesh.x().iter().map(|x| {
        x.map(|x| {
            *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let shift = 0.4 * ((*seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) / n as f64;
            if x == 0.0 || x == 1.0 { x } else { x + shift }
        })
    });
    mesh.moved(moved.collect()).unwrap()
}

/// Two unknowns that convect, diffuse and make each other, with a source that gives them an exact solution.
fn manufactured() -> Box<dyn Physics> {
    let (sin, cos) = ("sin(x - y + t)", "cos(x - y + t)");
    let derivatives = [
        ("Uxx", "(-1.2*sin(2*x + t)*cos(y))".into()),
        ("Uyy", "(-0.3*sin(2*x + t)*cos(y))".into()),
        ("Ut", "(0.3*cos(2*x + t)*cos(y))".into()),
        ("Ux", "(0.6*cos(2*x + t)*cos(y))".into()),
        ("Uy", "(-0.3*sin(2*x + t)*sin(y))".into()),
        ("U", "(1 + 0.3*sin(2*x + t)*cos(y))".into()),
        ("Vxx", format!("(-0.2*{cos})")),
        ("Vyy", format!("(-0.2*{cos})")),
        ("Vt", format!("(-0.2*{sin})")),
        ("Vx", format!("(-0.2*{sin})")),
        ("Vy", format!("(0.2*{sin})")),
        ("V", format!("(0.5 + 0.2*{cos})")),
    ];
    let exact = |text: &str| derivatives.iter().fold(text.to_string(), |text, (name, value)| text.replace(name, value));
    let convection = ["U*Ux + Uy*V + U*Vy", "Vx*U + V*Ux + 0.6*V*Vy"];
    let diffusion = [
        "0.05*((1 + U*V)*(Uxx + Uyy) + (Ux*V + U*Vx)*Ux + (Uy*V + U*Vy)*Uy)",
        "0.04*((1 + V^2 + 0.2*x)*(Vxx + Vyy) + (2*V*Vx + 0.2)*Vx + 2*V*Vy*Vy)",
    ];
    let sources = [
        format!("u*(1 - v) + Ut + {} - {} - U*(1 - V)", convection[0], diffusion[0]),
        format!("u*v - v^2 + Vt + {} - {} - U*V + V^2", convection[1], diffusion[1]),
    ];
    let [u, v] = ["U", "V"].map(exact);
    let [source_u, source_v] = sources.map(|text| exact(&text));
    physics(&format!(
        r#"
        unknowns = ["u", "v"]
        flux = {{ u = ["u^2/2", "u*v"], v = ["u*v", "0.3*v^2"] }}
        diffusivity = {{ u = "0.05*(1 + u*v)", v = "0.04*(1 + v^2 + 0.2*x)" }}
        source = {{ u = "{source_u}", v = "{source_v}" }}
        initial = {{ u = "{u}", v = "{v}" }}
        boundary = {{ u = "{u}", v = "{v}" }}
        exact = {{ u = "{u}", v = "{v}" }}
        "#
    ))
}

fn run(physics: &mut dyn Physics, end: f64, steps: usize, mesh: impl Fn(f64) -> Mesh<2>) -> (Field, Mesh<2>) {
    let mut old = mesh(0.0);
    let mut u = physics.initial(0.0, &old);
    let dt = end / steps as f64;
    for step in 0..steps {
        let new = mesh((step + 1) as f64 * dt);
        u = physics.step(Motion { t: step as f64 * dt, dt, old: &old, new: &new }, &u).unwrap().0;
        old = new;
    }
    (u, old)
}

fn largest_difference(a: &Field, b: &Field) -> f64 {
    a.values().iter().zip(b.values()).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

fn assert_second_order(what: &str, coarse: f64, fine: f64, factor: f64) {
    let order = (coarse / fine).log(factor);
    println!("{what}: {coarse:.3e} → {fine:.3e}, order {order:.3}");
    assert!((order - 2.0).abs() < 0.1, "{what}: observed order {order:.3} ({coarse:.2e} → {fine:.2e}), expected 2");
}

/// Against the exact solution of two coupled unknowns with nonlinear F, D and S, space and time refined together.
#[test]
fn two_unknowns_are_second_order_on_meshes_at_rest_and_moving() {
    for (what, speed) in [("at rest", 0.0), ("moving", 1.0)] {
        let [coarse, fine] = [16, 48].map(|n| {
            let mut physics = manufactured();
            let (u, end) = run(physics.as_mut(), 0.5, n / 2, |t| distorted(n, speed * t));
            largest_difference(&u, &physics.exact(0.5, &end).unwrap())
        });
        assert_second_order(what, coarse, fine, 3.0);
    }
}

/// Against very small steps on the same moving mesh, so that only time is seen.
#[test]
fn two_unknowns_are_second_order_in_time() {
    let after = |steps| run(manufactured().as_mut(), 1.0, steps, |t| distorted(12, 2.0 * t)).0;
    let reference = after(640);
    let [coarse, fine] = [10, 40].map(|steps| largest_difference(&after(steps), &reference));
    assert_second_order("time", coarse, fine, 4.0);
}

/// Steps so small that only space is seen.
#[test]
fn two_unknowns_are_second_order_in_space() {
    let [coarse, fine] = [16, 48].map(|n| {
        let mut physics = manufactured();
        let (u, end) = run(physics.as_mut(), 0.02, 10, |_| distorted(n, 0.4));
        largest_difference(&u, &physics.exact(0.02, &end).unwrap())
    });
    assert_second_order("space", coarse, fine, 3.0);
}

/// 1e-9 takes eight iterations at most in the two stages of a step in which waves cross two cells, as it does where
/// Newton's method converges quadratically, which is measured beside the Jacobian itself. With a transposed one it
/// stalls.
#[test]
fn newton_takes_few_iterations() {
    let [old, new] = [0.0, 0.1].map(|t| distorted(16, t));
    let mut physics = manufactured();
    let start = physics.initial(0.0, &old);
    let (_, work) = physics.step(Motion { t: 0.0, dt: 0.1, old: &old, new: &new }, &start).unwrap();
    println!("{} iterations", work.newton_iterations);
    assert!((2..=8).contains(&work.newton_iterations), "{work:?}");
}

/// Σ A u and Σ A v hold to round-off in a box whose sides let nothing pass, on random meshes.
#[test]
fn what_cannot_leave_stays() {
    let mut physics = physics(
        r#"
        unknowns = ["u", "v"]
        flux = { u = ["u^2/2", "u*v"], v = ["v", "0"] }
        diffusivity = { u = "0.05 + u^2/20", v = "0.02" }
        initial = { u = "1 + sin(6*x)*cos(4*y)", v = "1e-6*exp(-10*x)" }
        boundary = { u = "no-flux", v = "no-flux" }
        "#,
    );
    let totals = |mesh: &Mesh<2>, u: &Field| {
        let areas = DualCells::new(mesh).areas().to_vec();
        [0, 1].map(|c| areas.iter().zip(u.component(c)).map(|(area, u)| area * u).sum::<f64>())
    };
    let mut seed = 3;
    let mut old = random(16, &mut seed);
    let mut u = physics.initial(0.0, &old);
    let start = totals(&old, &u);
    for _ in 0..50 {
        let new = random(16, &mut seed);
        u = physics.step(Motion { t: 0.0, dt: 0.02, old: &old, new: &new }, &u).unwrap().0;
        old = new;
    }
    let end = totals(&old, &u);
    for c in 0..2 {
        let drift = end[c] / start[c] - 1.0;
        println!("unknown {c}: drift {drift:.1e}");
        assert!(drift.abs() < 2e-14, "unknown {c} drifts by {drift:.1e}");
    }
    assert!((physics.conserved(&old, &u) / start[0] - 1.0).abs() < 2e-14);
}

/// Sides without flow leave a constant as it is, wherever the mesh goes.
#[test]
fn a_constant_state_stays_constant_on_random_meshes() {
    let mut physics = physics(
        r#"
        unknowns = ["u", "v", "w", "z"]
        diffusivity = { u = "u^2", v = "0.1", w = "1 + x" }
        initial = { u = "10", v = "-3", w = "1e-3", z = "2" }
        boundary = { u = "no-flux", v = "no-flux", w = "no-flux", z = "no-flux" }
        "#,
    );
    let mut seed = 5;
    let mut old = random(12, &mut seed);
    let constant = physics.initial(0.0, &old);
    let mut u = constant.clone();
    for _ in 0..100 {
        let new = random(12, &mut seed);
        u = physics.step(Motion { t: 0.0, dt: 0.02, old: &old, new: &new }, &u).unwrap().0;
        old = new;
    }
    let off = largest_difference(&u, &constant);
    println!("off by {off:.1e} of 10");
    assert!(off < 1e-12, "off by {off:.1e} of 10 after 100 steps");
}

/// An unknown that starts as 0, one that is a million times smaller, and one that hardly changes in a step are all
/// solved: u = 1e-8 t, v = 1e6 exp(−t), w = exp(−t).
#[test]
fn unknowns_of_any_size_are_solved() {
    let mut physics = physics(
        r#"
        unknowns = ["u", "v", "w"]
        source = { u = "1e-8", v = "-v", w = "-w" }
        initial = { u = "0", v = "1e6", w = "1" }
        boundary = { u = "no-flux", v = "no-flux", w = "no-flux" }
        "#,
    );
    let (u, _) = run(physics.as_mut(), 1.0, 10_000, |_| square(4));
    for [u, v, w] in u.values().as_chunks::<3>().0 {
        assert!((u / 1e-8 - 1.0).abs() < 1e-6, "u = {u:e}");
        assert!(
            (v / 1e6 / (-1_f64).exp() - 1.0).abs() < 1e-7 && (w / (-1_f64).exp() - 1.0).abs() < 1e-7,
            "{v:e} {w:e}"
        );
    }
}

/// The same bits on one thread and on two, on a lattice above the size at which threads are used.
#[test]
fn results_do_not_depend_on_threads() {
    let step = || {
        let [old, new] = [0.0, 0.01].map(|t| distorted(130, t));
        let mut physics = manufactured();
        let start = physics.initial(0.0, &old);
        physics.step(Motion { t: 0.0, dt: 0.01, old: &old, new: &new }, &start).unwrap().0
    };
    let [one, two] = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(step));
    assert!(one.values().iter().zip(two.values()).all(|(a, b)| a.to_bits() == b.to_bits()));
}

const STUDY: &str = r#"
[study]
name = "mine"
kind = "moving-mesh"

[grid]
cells = [8, 8]

[time]
start = 0.0
end = 0.2
step = 0.1

[pde]
kind = "formula"
unknowns = ["u", "v"]
flux = { u = ["0.5*u^2", "0"] }
diffusivity = { u = "0.05", v = 0.01 }
source = { v = "u*(1 - v)" }
initial = { u = "x*(1 - x)*y*(1 - y)", v = "0" }
boundary = { u = "0", v = "no-flux" }
"#;

fn study(assignments: &[&str]) -> Result<MovingMesh, Error> {
    let mut source = Source::new("mine.toml", STUDY);
    assignments.iter().for_each(|assignment| source.set(assignment).unwrap());
    MovingMesh::from_source(&source)
}

fn computed(assignments: &[&str]) -> Result<Record, Error> {
    let (MovingRun { record, .. }, failure) = study(assignments)?.compute()?;
    failure.map_or(Ok(record), Err)
}

/// Every mistake is shown at its place, and what is set on top of a table leaves the rest of it.
#[test]
fn mistakes_are_located() {
    study(&["pde.initial.u=\"x\"", "pde.diffusivity.u=0.5", "pde.boundary.v=\"0\""]).unwrap();
    let wrong = [
        (r#"pde.flux.u=["u", "2*w"]"#, "`pde.flux.u[1]`: unknown name `w`", "--set:1:21", "w"),
        (r#"pde.source.v="u*(1 - v""#, "`pde.source.v`: this parenthesis", "--set:1:17", "("),
        (r#"pde.initial.u="v""#, "`pde.initial.u`: unknown name `v`", "--set:1:16", "v"),
        (r#"pde.exact.u="y +""#, "`pde.exact.u`: something is missing", "--set:1:16", "+"),
        (r#"pde.flux.v=["u"]"#, "expected an array of length 2, found 1", "--set:1:12", r#"["u"]"#),
        (r#"pde.diffusivity.u=-1"#, "`pde.diffusivity.u`: the diffusivity is -1", "--set:1:19", "-1"),
        (r#"pde.unknowns=["u", "x"]"#, r#"`pde.unknowns[1]` is "x", but x, y and t"#, "--set:1:20", r#""x""#),
        (r#"pde.unknowns=["u", "pi"]"#, "name of a constant", "--set:1:20", r#""pi""#),
        (r#"pde.unknowns=["sin", "u"]"#, "name of a function", "--set:1:15", r#""sin""#),
        (r#"pde.unknowns=["u", "u"]"#, "given twice", "--set:1:20", r#""u""#),
        (r#"pde.unknowns=["u", "kind"]"#, "`kind` is a key", "--set:1:20", r#""kind""#),
        (r#"pde.unknowns=["a", "b", "c", "d", "e2"]"#, "1 to 4 names", "--set:1:14", r#"["a", "b", "c", "d", "e2"]"#),
        (r#"pde.unknowns=["u", "v", "w"]"#, "`pde.initial` is not given for `w`", "mine.toml:20:1", "initial"),
        (r#"pde.source.w="1""#, "`w` is not among pde.unknowns", "--set:1:14", r#""1""#),
        (
            "domain.periodic=[true, true]",
            "`pde.boundary` is given for `u`, but both axes",
            "mine.toml:21:1",
            "boundary",
        ),
        (r#"pde.boundary.v="No flux""#, "`pde.boundary.v`: ", "--set:1:17", "No"),
        (r#"monitor={ kind = "auto", of = "u + w" }"#, "`monitor.of`: unknown name `w`", "--set:1:36", "w"),
    ];
    let missing = study(&[r#"pde.unknowns=["u", "v", "w"]"#, "pde.initial.w=0"]).unwrap_err().to_string();
    assert!(missing.contains("`pde.boundary` is not given for `w`") && missing.contains("mine.toml:21:1"), "{missing}");
    for (assignment, message, place, marked) in wrong {
        let error = study(&[assignment]).unwrap_err();
        let Error::Study(diagnostic) = &error else { panic!("{assignment}: {error}") };
        let text = error.to_string();
        assert!(text.contains(message) && text.contains(place), "{assignment}: {text}");
        let shown: String = diagnostic.text.chars().skip(diagnostic.caret - 1).take(diagnostic.width).collect();
        assert!(shown.starts_with(marked), "{assignment}: {text}");
    }
}

/// A formula without a value is named with its node and the unknowns there, at the start and later on.
#[test]
fn formulas_without_a_value_are_named() {
    let wrong = [
        (r#"pde.initial.u="1/x""#, 0, "`pde.initial.u` is inf at node (0, 0), x = 0.0000"),
        (r#"pde.exact.u="sqrt(0.05 - t)""#, 1, "`pde.exact.u` is NaN at node (0, 0)"),
        (r#"pde.boundary.u="sqrt(0.05 - t)""#, 1, "`pde.boundary.u` is NaN at node (0, 0)"),
        (
            r#"pde.source.v="log(v)""#,
            0,
            "`pde.source.v` is -inf at node (0, 0), x = 0.0000, y = 0.0000, where u = 0.0000",
        ),
        (r#"pde.source.v="sqrt(v)""#, 0, "the derivative of `pde.source.v` by v is inf"),
        (r#"pde.diffusivity.v="sqrt(0.15 - t)""#, 2, "`pde.diffusivity.v` is NaN"),
        (r#"pde.flux.v=["1/(t - 0.1)", 0]"#, 1, "`pde.flux.v[0]` is inf"),
        (r#"monitor={ kind = "auto", of = "1/v" }"#, 0, "`monitor.of` is inf at node (0, 0)"),
    ];
    for (assignment, step, message) in wrong {
        let error = computed(&[assignment]).unwrap_err();
        assert!(matches!(error, Error::Failed { failure: Failure::Formula { .. }, .. }), "{assignment}: {error}");
        let text = error.to_string();
        assert!(text.contains(message) && text.contains(&format!("(step {step})")), "{assignment}: {text}");
        assert!(error.help().unwrap().starts_with("mend the formula"));
    }
}

/// Formulas that are not periodic on periodic axes and sides that contradict the start are said, by their keys.
#[test]
fn contradictions_are_said() {
    let said = |assignments: &[&str]| study(assignments).unwrap().warnings().unwrap();
    assert_eq!(said(&[]), Vec::<String>::new());
    let warnings = said(&["pde.boundary.u=\"0.5\""]);
    assert!(warnings.len() == 1 && warnings[0].contains("`pde.boundary.u` is not `pde.initial.u`"), "{warnings:?}");
    let warnings = said(&["domain.periodic=[true, false]", "pde.exact.v=\"x\""]);
    assert!(warnings.len() == 1 && warnings[0].contains("`pde.exact.v` is not periodic along x"), "{warnings:?}");
}

/// The errors of a report are those of the unknowns that have an exact solution.
#[test]
fn errors_are_those_of_the_unknowns_known() {
    let decay = [
        "pde.flux.u=[0, 0]",
        "pde.source.v=-v",
        "pde.initial.v=1",
        "pde.boundary.u=no-flux",
        "mesh.generator.kind=fixed",
        "time.stepper=trapezoid",
    ];
    let with = |more: &[&str]| computed(&[&decay, more].concat()).unwrap().reports[0].error;
    assert!(with(&[]).is_none());
    let error = with(&["pde.exact.v=\"exp(-t)\""]).unwrap();
    let left = (0.95_f64 / 1.05).powi(2) - (-0.2_f64).exp();
    assert!((error.linf / left.abs() - 1.0).abs() < 1e-6 && (error.l2 / left.abs() - 1.0).abs() < 1e-6, "{error:?}");
}

/// A mesh follows any unknown of any equation, or a formula of them; the first unknown by name changes no bit.
#[test]
fn meshes_follow_what_they_are_told() {
    let short = ["time.end=0.05", "time.report=[0.05]", "mesh.generator={ kind = \"whole\" }"];
    let water = |of: &str| {
        let mut source = Source::new("dam.toml", include_str!("../studies/dam-break.toml"));
        short.iter().chain([&format!("monitor.of={of}").as_str()]).for_each(|set| source.set(set).unwrap());
        let study = MovingMesh::from_source(&source).unwrap();
        let (MovingRun { record, .. }, failure) = study.compute().unwrap();
        assert!(failure.is_none(), "{failure:?}");
        record.reports[0].quality
    };
    let [h, again, shifted, u] = ["h", "\"h\"", "\"h + 3\"", "u"].map(water);
    assert_eq!(h, again);
    assert!((h.q_max / shifted.q_max - 1.0).abs() < 1e-9, "{h:?} {shifted:?}");
    assert!((h.q_max / u.q_max - 1.0).abs() > 1e-3, "{h:?} {u:?}");
}
