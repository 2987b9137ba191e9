//! Moving meshes in one dimension, through studies.

use driftmesh::error::Error;
use driftmesh::study::{Begin, Kind, MovingLine, MovingMesh, MovingRun, Source};

/// A study of a line: tables without `[study]`.
fn study(text: &str) -> Result<MovingLine, Error> {
    let head = "[study]\nname = \"line\"\nkind = \"moving-mesh\"\n";
    MovingLine::from_source(&Source::new("line.toml", format!("{head}{text}")))
}

fn run(text: &str) -> MovingRun<1> {
    let (run, failure) = study(text).unwrap().compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    run
}

/// x and the first unknown at the end.
fn solution(run: &MovingRun<1>) -> Vec<[f64; 2]> {
    let state = run.state.as_ref().unwrap();
    state.mesh.x().iter().zip(state.u.component(0)).map(|(x, u)| [x[0], u]).collect()
}

fn l_inf(run: &MovingRun<1>) -> f64 {
    run.record.reports.last().unwrap().error.unwrap().linf
}

/// u of Burgers' equation with u = sin 2πx + a sin πx at t = 0 and 0 at both ends, by Cole and Hopf's transformation:
/// the mean of (x − y)/t with the weight exp(−(U(y) + (x − y)²/2t)/2ν), U being the integral of u at t = 0.
fn cole_hopf([viscosity, a]: [f64; 2], t: f64, x: f64) -> f64 {
    use std::f64::consts::PI;
    let integral = |y: f64| (1.0 - (2.0 * PI * y).cos()) / (2.0 * PI) + a * (1.0 - (PI * y).cos()) / PI;
    let n = 40_000;
    let y = |k: usize| x + 4.0 * (k as f64 / n as f64 - 0.5);
    let exponent = |k: usize| -(integral(y(k)) + (x - y(k)).powi(2) / (2.0 * t)) / (2.0 * viscosity);
    let most = (0..=n).map(exponent).fold(f64::NEG_INFINITY, f64::max);
    let [above, below] = (0..=n).fold([0.0, 0.0], |[above, below], k| {
        let weight = (exponent(k) - most).exp();
        [above + weight * (x - y(k)) / t, below + weight]
    });
    above / below
}

const LAYERS: &str = r#"
    [grid]
    cells = [80]
    [time]
    start = 0.0
    end = 1.0
    report = [0.2, 0.6, 1.0]
    [pde]
    kind = "formula"
    unknowns = ["u"]
    flux = { u = ["u^2/2"] }
    diffusivity = { u = "1e-4" }
    initial = { u = "sin(2*pi*x) + 0.5*sin(pi*x)" }
    boundary = { u = "0" }
"#;

/// Two layers of width 1e-4 that form out of smooth data and merge, on 80 cells: the mean error is below 2e-3 at first
/// and 1e-3 at the end, and the range that of the exact solution to half a per cent.
#[test]
fn layers_form_and_merge() {
    for (end, largest, allowed) in [(0.2, 1.367, 2e-3), (1.0, 0.7557, 1e-3)] {
        let text = LAYERS.replace("end = 1.0", &format!("end = {end:?}"));
        let run = run(&text.replace("[0.2, 0.6, 1.0]", "[]"));
        let found = solution(&run);
        let most = found.iter().fold(0.0_f64, |m, [_, u]| m.max(*u));
        let exact = found.iter().map(|[x, _]| cole_hopf([1e-4, 0.5], end, *x)).fold(0.0_f64, f64::max);
        assert!((exact / largest - 1.0).abs() < 2e-3, "the exact solution has {exact}");
        assert!((most / exact - 1.0).abs() < 5e-3, "t = {end}: {most} where it is {exact}");
        let error = |w: &[[f64; 2]]| {
            let [a, b] = [0, 1].map(|k| (w[k][1] - cole_hopf([1e-4, 0.5], end, w[k][0])).abs());
            0.5 * (a + b) * (w[1][0] - w[0][0])
        };
        let l1: f64 = found.windows(2).map(error).sum();
        assert!(l1 < allowed, "t = {end}: {l1:e}");
    }
}

/// The steady layer of a sine, with ν = 5e-4, soon after it has formed: its largest error falls with the cells.
#[test]
fn a_layer_that_forms_is_followed_on_any_cells() {
    let text = LAYERS.replace("end = 1.0", "end = 0.25").replace("[0.2, 0.6, 1.0]", "[]").replace("1e-4", "5e-4");
    let text = text.replace(" + 0.5*sin(pi*x)", "");
    for (cells, allowed) in [(48, 1.5e-2), (64, 1e-2), (96, 6e-3), (160, 3e-3)] {
        let run = run(&text.replace("[80]", &format!("[{cells}]")));
        let exact = |x: f64| cole_hopf([5e-4, 0.0], 0.25, x);
        let off = solution(&run).iter().fold(0.0_f64, |m, [x, u]| m.max((u - exact(*x)).abs()));
        assert!(off < allowed, "{cells} cells: {off:e}");
    }
}

/// Two layers take at most 5000 Newton iterations, in the median over seven lattices: how often steps are tried again
/// while the layers form differs by half from one lattice to the next.
#[test]
fn layers_that_form_take_no_more_than_5000_newton_iterations() {
    let mut counts = [50, 60, 70, 80, 90, 100, 120].map(|cells| {
        let text = LAYERS.replace("cells = [80]", &format!("cells = [{cells}]"));
        run(&text.replace("[0.2, 0.6, 1.0]", "[]")).record.work.work.newton_iterations
    });
    counts.sort_unstable();
    assert!(counts[3] <= 5000, "{counts:?}");
}

/// Nodes that have gone round a periodic line many times are as exact as at the start: a pulse on many cells goes round
/// twenty times, with steps that are given or automatic.
#[test]
fn nodes_far_from_their_box_move_on() {
    for step in ["step = 0.01", ""] {
        let run = run(&format!(
            r#"
            [domain]
            periodic = [true]
            [grid]
            cells = [240]
            [time]
            start = 0.0
            end = 20.0
            {step}
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["u"] }}
            initial = {{ u = "exp((cos(2*pi*x) - 1)/0.035)" }}
            exact = {{ u = "exp((cos(2*pi*(x - t)) - 1)/0.035)" }}
            "#
        ));
        let (error, steps) = (l_inf(&run), run.record.work.steps);
        assert!(error < 2e-3 && steps <= 2000, "{step}: {error:e} after {steps} steps");
    }
}

/// On a mesh that stays layers form without overshoots, unless fluxes are to be central, which is said.
#[test]
fn what_overshoots_is_said() {
    let text = LAYERS.replace("end = 1.0", "end = 0.2").replace("[0.2, 0.6, 1.0]", "[]");
    for (scheme, overshoots) in [("", false), ("scheme = \"central\"\n", true)] {
        let run = run(&format!("{text}{scheme}[mesh]\ngenerator = {{ kind = \"fixed\" }}\n"));
        let most = solution(&run).iter().fold(0.0_f64, |m, [_, u]| m.max(*u));
        let said = run.record.warnings.iter().filter(|warning| warning.contains("`u` leaves the range of its data"));
        let expected = (overshoots, usize::from(overshoots));
        assert_eq!((most > 1.4, said.count()), expected, "{most}: {:?}", run.record.warnings);
    }
}

/// The front of Burgers' equation, a hundredth as wide as a uniform cell, is followed to a few thousandths.
#[test]
fn the_front_is_followed() {
    for viscosity in [1e-3, 1e-4] {
        let error = l_inf(&run(&format!(
            "[grid]\ncells = [40]\n[time]\nstart = 0.25\nend = 1.0\n[pde]\nkind = \"burgers\"\n\
             viscosity = {viscosity:?}\n"
        )));
        assert!(error < 5e-3, "viscosity {viscosity}: {error:e}");
    }
}

/// A front of u_t = D u_xx + k u (1 − u)(u − ¼) goes with the speed √(Dk/2)/2, however thin it is: cells that grow
/// through it do not change it by much.
#[test]
fn fronts_between_stable_states_have_their_speed() {
    let speed = 0.4;
    for (width, cells, allowed) in [(1.0 / 120.0, 40, 2e-2), (1.0 / 400.0, 40, 4e-2), (1.0 / 400.0, 80, 1e-2)] {
        let (d, exact) = (2.0 * speed * width, format!("1/(1+exp((x-0.3-{speed}*t)/{width:e}))"));
        let error = l_inf(&run(&format!(
            "[grid]\ncells = [{cells}]\n[time]\nstart = 0.0\nend = 1.0\n[pde]\nkind = \"formula\"\n\
             unknowns = [\"u\"]\ndiffusivity = {{ u = \"{d:e}\" }}\n\
             source = {{ u = \"{:e}*u*(1-u)*(u-0.25)\" }}\ninitial = {{ u = \"{exact}\" }}\n\
             boundary = {{ u = \"no-flux\" }}\nexact = {{ u = \"{exact}\" }}\n",
            2.0 * d / (width * width)
        )));
        assert!(error < allowed, "width {width:e}, {cells} cells: {error:e}");
    }
}

/// Fronts into a state that grows by itself, too thin for equal cells: u_t = D u_xx + k u (1 − u²) and with u (1 − u),
/// with D constant and with D = εu, run away no more than on a mesh that stays.
#[test]
fn fronts_into_growing_states_do_not_run_away() {
    let cubic = ("1e-4", "5*u*(1-u^2)", "1/(1+exp((x-0.2-0.04743416490252569*t)/0.006324555320336759))");
    let square = ("1e-4", "10*u*(1-u)", "(1+exp((x-0.2-5/sqrt(6)*sqrt(1e-3)*t)/sqrt(6e-5)))^(-2)");
    let degenerate = ("1e-3*u", "10*u*(1-u)", "max(1-exp(70.71067811865476*(x-0.2-0.07071067811865475*t)),0)");
    for ((d, source, exact), cells, share) in [
        (cubic, 50, 1.1),
        (cubic, 100, 1.1),
        (cubic, 200, 1.1),
        (square, 50, 1.2),
        (square, 100, 0.6),
        (square, 200, 0.6),
        (degenerate, 50, 0.5),
        (degenerate, 100, 0.5),
    ] {
        let l2 = |generator: &str| {
            let run = run(&format!(
                "[grid]\ncells = [{cells}]\n[time]\nstart = 0.0\nend = 8.0\n[mesh]\n\
                 generator = {{ kind = \"{generator}\" }}\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\n\
                 diffusivity = {{ u = \"{d}\" }}\nsource = {{ u = \"{source}\" }}\n\
                 initial = {{ u = \"{exact}\" }}\nboundary = {{ u = \"no-flux\" }}\nexact = {{ u = \"{exact}\" }}\n"
            ));
            if cells == 50 {
                let said = run.record.warnings.iter().any(|said| said.contains("small values grow in cells"));
                assert!(said, "{:?}", run.record.warnings);
            }
            run.record.reports.last().unwrap().error.unwrap().l2
        };
        let (moved, stayed) = (l2("whole"), l2("fixed"));
        assert!(moved < share * stayed, "{source}, {cells} cells: {moved:e} for {stayed:e}");
    }
}

/// A root of an unknown that is 0 has no finite slope; the error says what to write, and with that the study runs.
#[test]
fn a_root_at_zero_is_mended_as_its_error_says() {
    let study = |source: &str| {
        study(&format!(
            "[grid]\ncells = [40]\n[time]\nstart = 0.0\nend = 0.1\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\n\
             diffusivity = {{ u = \"0.01\" }}\nsource = {{ u = \"{source}\" }}\n\
             initial = {{ u = \"max(1 - 10*(x - 0.5)^2, 0)\" }}\nboundary = {{ u = \"no-flux\" }}\n"
        ))
        .unwrap()
        .compute()
    };
    for source in ["-sqrt(u)", "-sqrt(max(u, 0))"] {
        let error = study(source).err().unwrap();
        assert!(error.to_string().contains("the derivative of `pde.source.u` by u is -inf"), "{error}");
        let help = error.help().unwrap();
        assert!(help.contains("max(…, 1e-9)") && !help.contains("time.step"), "{help}");
    }
    assert!(study("-sqrt(max(u, 1e-9))").ok().unwrap().1.is_none());
}

/// Heat from a point in a ball has order 2 and keeps its content to round-off, on cells that are moved about by what
/// the mesh is made to follow.
#[test]
fn spheres_are_second_order_and_conserve() {
    let kernel = "(4*pi*t)^(-1.5)*exp(-x^2/(4*t))";
    let error = |cells: usize, step: f64| {
        let run = run(&format!(
            r#"
            [domain]
            lower = [0.0]
            upper = [8.0]
            coordinates = "spherical"
            [grid]
            cells = [{cells}]
            [time]
            start = 0.2
            end = 0.6
            step = {step}
            [pde]
            kind = "formula"
            unknowns = ["u"]
            diffusivity = {{ u = "1" }}
            initial = {{ u = "{kernel}" }}
            exact = {{ u = "{kernel}" }}
            boundary = {{ u = "no-flux" }}
            [monitor]
            kind = "given"
            of = "1 + 0.4*sin(2*x - 3*t)"
            "#
        ));
        let report = run.record.reports.last().unwrap();
        assert!(report.conserved.drift.abs() < 1e-13, "{:?}", report.conserved);
        assert!(run.record.travelled > 0.01, "the mesh has moved by {}", run.record.travelled);
        l_inf(&run)
    };
    let order = (error(40, 0.02) / error(80, 0.01)).log2();
    assert!((1.7..2.5).contains(&order), "order {order:.2}");
}

/// A wave on a periodic line goes round ten times and keeps its error.
#[test]
fn a_wave_goes_round_ten_times() {
    let errors = [1.0, 10.0].map(|end| {
        l_inf(&run(&format!(
            r#"
            [domain]
            periodic = [true]
            [grid]
            cells = [40]
            [time]
            start = 0.0
            end = {end:?}
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["u"] }}
            initial = {{ u = "tanh(15*sin(2*pi*x))" }}
            exact = {{ u = "tanh(15*sin(2*pi*(x - t)))" }}
            "#
        )))
    });
    assert!(errors[0] < 0.01 && errors[1] < 3.0 * errors[0].max(1e-3), "{errors:?}");
}

/// A line is what a strip of two cells with closed sides is: the same steps, nodes and values but for the solvers.
#[test]
fn a_line_is_a_strip() {
    let text = |grid: &str, flux: &str, boundary: &str| {
        format!(
            r#"
            [study]
            name = "strip"
            kind = "moving-mesh"
            {grid}
            [time]
            start = 0.0
            end = 0.3
            step = 0.005
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = {flux} }}
            diffusivity = {{ u = "1e-3" }}
            source = {{ u = "u*(1 - u)" }}
            initial = {{ u = "0.5*(1 - tanh((x - 0.3)/0.02))" }}
            boundary = {{ u = "{boundary}" }}
            "#
        )
    };
    let line = text("[grid]\ncells = [40]", r#"["u"]"#, "no-flux");
    let line = MovingLine::from_source(&Source::new("line.toml", line)).unwrap().compute().unwrap().0;
    let strip = text("[domain]\nupper = [1.0, 0.05]\n[grid]\ncells = [40, 2]", r#"["u", "0"]"#, "no-flux");
    let strip = MovingMesh::from_source(&Source::new("strip.toml", strip)).unwrap().compute().unwrap().0;
    let (line, strip) = (line.state.unwrap(), strip.state.unwrap());
    assert_eq!(line.step, strip.step);
    for k in 0..=40 {
        let (x, u) = (line.mesh.x()[k][0], line.u.values()[k]);
        let (y, v) = (strip.mesh.x()[3 * k + 1][0], strip.u.values()[3 * k + 1]);
        assert!((x - y).abs() < 2e-3 && (u - v).abs() < 2e-2, "node {k}: {x} and {y}, {u} and {v}");
    }
}

/// A run that is ended and resumed has the bits of one that is not.
#[test]
fn a_line_goes_on_to_the_bit() {
    let text = LAYERS.replace("end = 1.0", "end = 0.2").replace("[0.2, 0.6, 1.0]", "[]");
    let text = format!("{text}[output]\ncheckpoint = {{ steps = 20 }}\n");
    let study = study(&text).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let whole = study.compute().unwrap().0;
    let path = directory.path().join("run");
    struct Ends(usize);
    impl driftmesh::simulation::Observer for Ends {
        fn observe(
            &mut self,
            _: driftmesh::simulation::Event,
            snapshot: &driftmesh::simulation::Snapshot<'_>,
        ) -> driftmesh::Result<()> {
            self.0 = snapshot.step;
            Ok(())
        }

        fn interrupts(&self) -> bool {
            self.0 >= 50
        }
    }
    let ended = study.run(&path, Begin::Anew, &mut [&mut Ends(0)]).unwrap();
    assert!(matches!(ended.failure, Some(Error::Interrupted(_))), "{:?}", ended.failure);
    let resumed = study.run(&path, Begin::Resumed, &mut []).unwrap().run;
    assert_eq!(whole.state, resumed.state);
}

/// Settings that make no sense on a line are refused by name.
#[test]
fn nonsense_is_refused_by_name() {
    let rest = "[time]\nstart = 0.0\nend = 1.0\n[pde]\nkind = \"burgers\"\nviscosity = 0.01\n";
    let refused = |table: &str| study(&format!("{table}{rest}")).unwrap_err().to_string();
    let grid = "[grid]\ncells = [40]\n";
    for (table, said) in [
        (format!("[domain]\nlower = [0.0, 0.0]\n{grid}"), "expected an array of length 1, found 2"),
        (format!("[domain]\nlower = [-1.0]\ncoordinates = \"spherical\"\n{grid}"), "`domain.lower` is [-1]"),
        (format!("[domain]\nperiodic = [true]\ncoordinates = \"cylindrical\"\n{grid}"), "a radius is not periodic"),
        (format!("[domain]\ncoordinates = \"cylindrical\"\n{grid}"), "is along x"),
        (format!("[domain]\nperiodic = [true]\n{grid}"), "needs a bounded line"),
    ] {
        let error = refused(&table);
        assert!(error.contains(said), "{table}: {error}");
    }
}

/// On a periodic line a mesh goes along with what moves, unless another unknown does not: a wave that rests, or has
/// half of the speed, beside one that is carried. l2 is that of equal cells at most.
#[test]
fn a_mesh_does_not_sweep_over_what_rests() {
    for (speed, exact) in [("0", "cos(2*pi*x)"), ("0.5", "cos(2*pi*(x - t/2))"), ("-1", "cos(2*pi*(x + t))")] {
        let error = |generator: &str| {
            let run = run(&format!(
                r#"
                [domain]
                lower = [-0.5]
                upper = [0.5]
                periodic = [true]
                [grid]
                cells = [60]
                {generator}
                [time]
                start = 0.0
                end = 3.0
                [pde]
                kind = "formula"
                unknowns = ["a", "b"]
                flux = {{ a = ["a"], b = ["{speed}*b"] }}
                diffusivity = {{ a = "1e-5", b = "1e-5" }}
                initial = {{ a = "sin(2*pi*x)", b = "cos(2*pi*x)" }}
                exact = {{ a = "exp(-4*pi^2*1e-5*t)*sin(2*pi*(x - t))", b = "exp(-4*pi^2*1e-5*t)*{exact}" }}
                "#
            ));
            run.record.reports.last().unwrap().error.unwrap().l2
        };
        let (moving, fixed) = (error(""), error("[mesh]\ngenerator = { kind = \"fixed\" }"));
        println!("b at {speed}: {moving:.2e} for {fixed:.2e}");
        assert!(moving <= 1.05 * fixed, "b at {speed}: {moving:e} for {fixed:e}");
    }
}

/// A top hat that is carried ten times around, while its flanks widen until equal cells would resolve them.
#[test]
fn a_carried_shape_keeps_its_mesh_while_it_widens() {
    let flanks = |t: &str| {
        let half = |sign: &str| format!("erf((0.2 {sign} (mod(x - t + 0.75, 1) - 0.5))/sqrt(4e-4*{t}))");
        format!("0.5*({} + {})", half("-"), half("+"))
    };
    let of = |generator: &str| {
        run(&format!(
            r#"
            [domain]
            lower = [-0.5]
            upper = [0.5]
            periodic = [true]
            [grid]
            cells = [80]
            {generator}
            [time]
            start = 0.25
            end = 10.25
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["u"] }}
            diffusivity = {{ u = "1e-4" }}
            initial = {{ u = "{}" }}
            exact = {{ u = "{}" }}
            "#,
            flanks("0.25"),
            flanks("t"),
        ))
    };
    let (moving, fixed) = (of(""), of("[mesh]\ngenerator = { kind = \"fixed\" }"));
    let l2 = |run: &MovingRun<1>| run.record.reports.last().unwrap().error.unwrap().l2;
    println!("{:.2e} for {:.2e}", l2(&moving), l2(&fixed));
    assert!(l2(&moving) < l2(&fixed) / 10.0);
    let steps = moving.record.work.steps;
    assert!(steps < 500, "{steps} steps");
    assert!(solution(&moving).iter().all(|[_, u]| (-1e-3..=1.001).contains(u)));
}

/// A shock without viscosity forms and goes around: the mesh, whose cells there are a hundredth of equal ones, takes
/// ten times the steps of these (632), and not a hundred times.
#[test]
fn shocks_without_viscosity_do_not_take_steps_without_end() {
    let run = run(r#"
        [domain]
        periodic = [true]
        [grid]
        cells = [80]
        [time]
        start = 0.0
        end = 1.0
        [pde]
        kind = "formula"
        unknowns = ["u"]
        flux = { u = ["u^2/2"] }
        initial = { u = "0.5 + sin(2*pi*x)" }
        "#);
    let steps = run.record.work.steps;
    println!("{steps} steps");
    assert!(steps < 10_000, "{steps} steps");
}
