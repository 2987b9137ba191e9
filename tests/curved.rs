//! Studies of moving meshes in domains that are not boxes.

use crate::runs::{HEAD, plane};
use driftmesh::error::Error;
use driftmesh::geometry::Mesh;
use driftmesh::study::{Begin, Kind, MovingMesh, PoissonStudy, Source};

fn study(text: &str) -> Result<MovingMesh, Error> {
    MovingMesh::from_source(&Source::new("curved.toml", format!("{HEAD}{text}")))
}

const ANNULUS: &str = r#"
    [domain]
    map = { x = "(1 + r)*cos(2*pi*s)", y = "(1 + r)*sin(2*pi*s)" }
    closed = [false, true]
"#;
const CHANNEL: &str = r#"
    [domain]
    x = [0.0, 2.0]
    bottom = "0.15*sin(3*x)"
    top = "1 + 0.15*cos(2*x)"
"#;
const PARALLELOGRAM: &str = r#"
    [domain]
    map = { x = "s + 0.5*r", y = "r" }
"#;

/// u = sin(x + y/2 − t), carried along at (1, 0.3) and diffused, on a mesh that moves.
fn manufactured(domain: &str, [n, m]: [usize; 2], kind: &str) -> f64 {
    let wave = "sin(x + 0.5*y - t)";
    let (flux, source) = match kind {
        "advection" => (r#"["u", "0.3*u"]"#, "0.15*cos(x + 0.5*y - t) + 0.0625*sin(x + 0.5*y - t)"),
        // u u_x + u u_y with u = wave
        _ => (
            r#"["0.5*u^2", "0.5*u^2"]"#,
            "-cos(x + 0.5*y - t) + 1.5*sin(x + 0.5*y - t)*cos(x + 0.5*y - t) + 0.0625*sin(x + 0.5*y - t)",
        ),
    };
    let text = format!(
        r#"{domain}
        [grid]
        cells = [{n}, {m}]
        [time]
        start = 0.0
        end = 0.4
        step = {step}
        [pde]
        kind = "formula"
        flux = {{ u = {flux} }}
        diffusivity = {{ u = "0.05" }}
        source = {{ u = "{source}" }}
        initial = {{ u = "{wave}" }}
        boundary = {{ u = "{wave}" }}
        exact = {{ u = "{wave}" }}
        unknowns = ["u"]
        scheme = "central"
        [monitor]
        kind = "arclength"
        strength = {{ relative = 5.0 }}
        smoothing = 0
        of = "exp(-5*((x - 1.2)^2 + (y - 0.5 - 0.3*t)^2)) + 0*u"
        [mesh]
        relaxation = 0.2
        "#,
        step = 0.8 / n as f64
    );
    let run = plane(&text);
    let cell = 1.0 / n as f64;
    assert!(run.record.travelled > 0.2 * cell, "the mesh moved by {}", run.record.travelled);
    run.record.reports.last().unwrap().error.unwrap().l2
}

#[test]
fn advection_and_diffusion_are_of_second_order() {
    for (name, domain, [n, m]) in
        [("annulus", ANNULUS, [12, 48]), ("channel", CHANNEL, [40, 20]), ("parallelogram", PARALLELOGRAM, [24, 24])]
    {
        for kind in ["advection", "burgers"] {
            let [coarse, fine] = [1, 2].map(|k| manufactured(domain, [k * n, k * m], kind));
            let order = (coarse / fine).log2();
            println!("{name}, {kind}: order {order:.2} from {coarse:.2e} to {fine:.2e}");
            assert!((1.75..2.4).contains(&order), "{name}, {kind}: order {order:.2} from {coarse:.2e} to {fine:.2e}");
        }
    }
}

/// A blob that is carried around between walls, by a mesh that follows it: nothing is lost, although its nodes slide
/// along curved sides.
#[test]
fn mass_is_kept_to_rounding() {
    for (name, domain, cells) in [
        ("annulus", ANNULUS, "[16, 60]"),
        ("channel", CHANNEL, "[40, 20]"),
        ("parallelogram", PARALLELOGRAM, "[24, 24]"),
    ] {
        let text = format!(
            r#"{domain}
            [grid]
            cells = {cells}
            [time]
            start = 0.0
            end = 0.3
            step = 0.01
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["-y*u", "x*u"] }}
            diffusivity = {{ u = "0.005" }}
            initial = {{ u = "1 + exp(-40*((x - 1.1)^2 + (y - 0.3)^2))" }}
            boundary = {{ u = "no-flux" }}
            "#
        );
        let run = plane(&text);
        let drift = run.record.reports.last().unwrap().conserved.drift;
        assert!(drift.abs() < 1e-12, "{name}: {drift:.1e}");
        assert!(run.record.travelled > 0.02, "{name}: {}", run.record.travelled);
        let start = study(&text).unwrap().uniform_mesh().unwrap();
        let end = &run.state.as_ref().unwrap().mesh;
        let lattice = start.lattice();
        let along: f64 = lattice
            .sides()
            .map(|k| (0..2).map(|d| (start.x()[k][d] - end.x()[k][d]).powi(2)).sum::<f64>().sqrt())
            .fold(0.0, f64::max);
        assert!(along > 0.02, "{name}: nodes on sides moved by {along:.1e}");
        for k in lattice.sides() {
            let [x, y] = end.x()[k];
            let off = match name {
                "annulus" => (x.hypot(y) - 1.0).abs().min((x.hypot(y) - 2.0).abs()),
                "channel" => [x, x - 2.0, y - 0.15 * (3.0 * x).sin(), y - 1.0 - 0.15 * (2.0 * x).cos()]
                    .into_iter()
                    .map(f64::abs)
                    .fold(f64::INFINITY, f64::min),
                _ => {
                    [y, y - 1.0, x - 0.5 * y, x - 0.5 * y - 1.0].map(f64::abs).into_iter().fold(f64::INFINITY, f64::min)
                }
            };
            assert!(off < 1e-12, "{name}: node {k} is off its curve by {off:.1e}");
        }
    }
}

/// The same problem in a box and in the box turned by 0.6 has the same numbers.
#[test]
fn a_turned_box_has_the_numbers_of_the_box() {
    let (c, s) = (0.6_f64.cos(), 0.6_f64.sin());
    let text = |domain: &str, x: &str, y: &str| {
        format!(
            r#"{domain}
            [grid]
            cells = [24, 24]
            [time]
            start = 0.0
            end = 0.2
            step = 0.01
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["0", "0"] }}
            diffusivity = {{ u = "0.01" }}
            initial = {{ u = "tanh(15*({x} + 0.5*{y} - 0.7))" }}
            boundary = {{ u = "no-flux" }}
            "#
        )
    };
    let flat = plane(&text("", "x", "y"));
    let domain = format!("[domain]\nmap = {{ x = \"{c}*s - {s}*r\", y = \"{s}*s + {c}*r\" }}\n");
    let turned = plane(&text(&domain, &format!("({c}*x + {s}*y)"), &format!("({c}*y - {s}*x)")));
    let [a, b] = [&flat, &turned].map(|run| run.state.as_ref().unwrap());
    for (a, b) in a.u.values().iter().zip(b.u.values()) {
        assert!((a - b).abs() < 1e-10, "{a} and {b}");
    }
    for (a, b) in a.mesh.x().iter().zip(b.mesh.parameters().x()) {
        assert!((0..2).all(|d| (a[d] - b[d]).abs() < 1e-10), "{a:?} and {b:?}");
    }
    let [a, b] = [&flat, &turned].map(|run| run.record.reports.last().unwrap().quality);
    assert!((a.q_max - b.q_max).abs() < 1e-10 && (a.min_scaled_jacobian - b.min_scaled_jacobian).abs() < 1e-10);
    assert!((a.equidistribution - b.equidistribution).abs() < 1e-10);
}

/// A run in two parts has the bits of one in one.
#[test]
fn runs_go_on_where_they_ended() {
    let text = |end: &str| {
        format!(
            r#"
            [study]
            name = "part"
            kind = "moving-mesh"
            {ANNULUS}
            [grid]
            cells = [12, 40]
            [time]
            start = 0.0
            end = {end}
            step = 0.02
            [pde]
            kind = "prescribed"
            u = "tanh(20*(x - 1 + t))"
            "#
        )
    };
    let directory = tempfile::tempdir().unwrap();
    let of = |end: &str| MovingMesh::from_source(&Source::new("part.toml", text(end))).unwrap();
    let (long, parts) = (directory.path().join("long"), directory.path().join("parts"));
    of("0.4").run(&long, Begin::Anew, &mut []).unwrap();
    of("0.2").run(&parts, Begin::Anew, &mut []).unwrap();
    of("0.4").run(&parts, Begin::Resumed, &mut []).unwrap();
    let read = |path: &std::path::Path| std::fs::read(path.join("final.npz")).unwrap();
    assert_eq!(read(&long), read(&parts));
    // the mesh of a run is that of another domain
    let again = format!(
        "[domain]\nmesh = {:?}\nclosed = [false, true]\n[grid]\ncells = [12, 40]\n[time]\nstart = 0.0\nend = 0.1\n\
         step = 0.02\n[pde]\nkind = \"prescribed\"\nu = \"tanh(20*(x - 1 + t))\"\n",
        long.join("final.npz").display().to_string()
    );
    let mesh = &plane(&again).state.unwrap().mesh;
    for (k, [x, y]) in mesh.x().iter().enumerate().filter(|(k, _)| mesh.lattice().on_side(*k)) {
        let off = (x.hypot(*y) - 1.0).abs().min((x.hypot(*y) - 2.0).abs());
        assert!(off < 0.02, "node {k} is off its circle by {off:.1e}");
    }
}

/// One clear error with the place, the value and what to do.
#[test]
fn domains_that_are_none_are_refused() {
    let with = |domain: &str, boundary: &str| {
        study(&format!(
            "[domain]\n{domain}\n[grid]\ncells = [8, 8]\n[time]\nstart = 0.0\nend = 0.1\n[pde]\nkind = \"formula\"\n\
             unknowns = [\"u\"]\ndiffusivity = {{ u = \"1\" }}\ninitial = {{ u = \"x\" }}\n{boundary}\n"
        ))
        .and_then(|mut study| study.resolve())
        .expect_err(domain)
        .to_string()
    };
    let no_flux = "boundary = { u = \"no-flux\" }";
    let cases = [
        (r#"map = { x = "s*(1 - s)", y = "r" }"#, no_flux, ["domain.map", "area"]),
        (r#"map = { x = "s + 0.6*sin(2*pi*s)*r", y = "r" }"#, no_flux, ["domain.map", "cell"]),
        (r#"map = { x = "log(s)", y = "r" }"#, no_flux, ["domain.map.x", "-inf at (0, 0)"]),
        (
            "map = { x = \"(1+r)*cos(6*s)\", y = \"(1+r)*sin(6*s)\" }\nclosed = [false, true]",
            no_flux,
            ["domain.closed", "apart by 5.6"],
        ),
        ("closed = [true, false]", no_flux, ["domain.closed", "periodic"]),
        ("map = { x = \"s\", y = \"r\" }\nupper = [2, 1]", no_flux, ["domain.upper", "leave it out"]),
        ("map = { x = \"s\", y = \"r\" }\nperiodic = [true, false]", no_flux, ["domain.periodic", "closed"]),
        ("mesh = \"no-such-file.npz\"", no_flux, ["domain.mesh", "cannot be read"]),
        ("x = [0, 1]\nbottom = \"x\"\ntop = \"0.5\"", no_flux, ["domain.top", "meets bottom at x = 0.5"]),
        (
            "map = { x = \"(1+r)*cos(2*pi*s)\", y = \"(1+r)*sin(2*pi*s)\" }\nclosed = [false, true]",
            "[pde.boundary.u]\nleft = \"0\"\nright = \"0\"\nbottom = \"1\"",
            ["pde.boundary.u.bottom", "the sides here are left, right"],
        ),
    ];
    for (domain, boundary, words) in cases {
        let error = with(domain, boundary);
        assert!(words.iter().all(|word| error.contains(word)), "{domain}: {error}");
    }
}

/// Poisson's equation around a full ring, whatever way the closed parameter runs.
#[test]
fn closed_rings_are_solved() {
    let error = |n: usize, turn: &str| {
        let text = format!(
            "[study]\nname = \"ring\"\nkind = \"poisson\"\n[domain]\nmap = {{ x = \"(1+r)*cos(2*pi*{turn})\", \
             y = \"(1+r)*sin(2*pi*{turn})\" }}\nclosed = [true, false]\n[grid]\ncells = [{}, {n}]\n\
             [exact]\nu = \"x^3 - 3*x*y^2 + x*y^3\"\n[sides]\nneumann = [\"top\"]\n",
            4 * n
        );
        let study = PoissonStudy::from_source(&Source::new("ring.toml", text)).unwrap();
        let (run, failure) = study.compute().unwrap();
        assert!(failure.is_none(), "{failure:?}");
        run.solved.unwrap().error.unwrap().linf
    };
    for turn in ["s", "(1-s)"] {
        let order = (error(10, turn) / error(40, turn)).log(4.0);
        assert!((1.8..3.2).contains(&order), "{turn}: order {order:.2}");
    }
    let _: Option<Mesh<2>> = None;
}

/// The example studies keep their figures: smallest scaled Jacobian, error of interpolation, and of Burgers' front its
/// largest error.
#[test]
fn example_studies_keep_their_figures() {
    let file = |name: &str| format!("{}/studies/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let mut wrong = 0;
    for (name, jacobian, interpolation, linf) in [
        ("bump-around-ring", 0.2801, 6.662e-3, None),
        ("bump-channel", 0.0701, 1.541e-3, Some(5.871e-3)),
        ("aerofoil", 1.330e-2, 1.189e-2, None),
    ] {
        let study = MovingMesh::from_source(&Source::read(file(name).as_ref()).unwrap()).unwrap();
        let (run, failure) = study.compute().unwrap();
        assert!(failure.is_none(), "{name}: {failure:?}");
        assert!(run.record.warnings.is_empty(), "{name}: {:?}", run.record.warnings);
        let report = run.record.reports.last().unwrap();
        let found = [
            (report.quality.min_scaled_jacobian, Some(jacobian)),
            (report.benefit.unwrap().mesh, Some(interpolation)),
            (report.error.map_or(0.0, |error| error.linf), linf),
        ];
        for (found, expected) in found.into_iter().filter_map(|(found, expected)| Some((found, expected?))) {
            println!("{name}: {found:e}, expected {expected:e}");
            wrong += usize::from((found / expected - 1.0).abs() >= 0.02);
        }
    }
    assert_eq!(wrong, 0, "figures that are more than 2 % off");
}
