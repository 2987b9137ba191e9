//! Limited fluxes: no new extrema, whatever the mesh does; and bounds.

use crate::runs::{HEAD, distance, line, plane};
use driftmesh::study::{Kind, MovingLine, MovingRun, Source};

/// The least and the largest value of an unknown.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], u| [l.min(u), h.max(u)])
}

/// A front passes an unknown that only sits there: its range stays, and it is as near to its data as where the mesh
/// rests, whatever its shape.
#[test]
fn what_only_sits_there_is_left_as_it_is() {
    type Shape = (&'static str, fn(f64) -> f64);
    let shapes: [Shape; 3] = [
        ("0.5*(1 + tanh((x - 30)/4))", |x| 0.5 * (1.0 + ((x - 30.0) / 4.0).tanh())),
        ("min(max((x - 28)/4, 0), 1)", |x| ((x - 28.0) / 4.0).clamp(0.0, 1.0)),
        ("0.5*(1 + tanh(x - 30))", |x| 0.5 * (1.0 + (x - 30.0).tanh())),
    ];
    for (shape, exact) in shapes {
        let run = |generator: &str| {
            line(&format!(
                r#"
                [domain]
                lower = [0.0]
                upper = [64.0]
                [grid]
                cells = [64]
                [time]
                start = 0.0
                end = 2.5
                [pde]
                kind = "formula"
                unknowns = ["u", "w"]
                diffusivity = {{ u = "8" }}
                source = {{ u = "(u - u^3)/0.0361 + 10" }}
                initial.u = "0.227759606941801 - 0.918899713971633*tanh(1.20907857101531*(x - 16))"
                initial.w = "{shape}"
                boundary = {{ u = "no-flux", w = "no-flux" }}
                [mesh]
                generator = {{ kind = "{generator}" }}
                "#
            ))
        };
        let [moving, fixed] = ["whole", "fixed"].map(run);
        let [low, high] = range(moving.state.as_ref().unwrap().u.component(1));
        assert!(low > -1e-6 && high < 1.0 + 1e-6, "{shape}: {low} to {high}");
        let [moving, fixed] = [&moving, &fixed].map(|run| distance(run, 1, exact));
        println!("{shape}: {moving} beside {fixed}");
        assert!(moving < 0.05 + 1.1 * fixed, "{shape}: {moving} beside {fixed}");
    }
}

/// Sod's shock tube, 100 cells: half of the error of equal cells, no density outside of its range. The exact density is
/// that of Toro, *Riemann Solvers and Numerical Methods for Fluid Dynamics* (2009), table 4.2, and of similarity.
#[test]
fn a_shock_tube_gains() {
    let exact = |x: f64| {
        let (s, gamma) = ((x - 0.5) / 0.2, 1.4_f64);
        let (sound, pressure, speed) = (gamma.sqrt(), 0.303_130_178_050_646_f64, 0.927_452_620_048_950);
        let behind = pressure.powf(1.0 / gamma);
        let (tail, shock) = (speed - sound * pressure.powf(0.5 * (gamma - 1.0) / gamma), 1.752_155_731_932_5);
        match s {
            s if s < -sound => 1.0,
            s if s < tail => (2.0 / (gamma + 1.0) - (gamma - 1.0) / ((gamma + 1.0) * sound) * s).powf(5.0),
            s if s < speed => behind,
            s if s < shock => 0.265_573_711_705_307,
            _ => 0.125,
        }
    };
    let error = |generator: &str| {
        let run = line(&format!(
            r#"
            [grid]
            cells = [100]
            [time]
            start = 0.0
            end = 0.2
            [pde]
            kind = "formula"
            unknowns = ["rho", "m", "E"]
            flux = {{ rho = ["m"], m = ["m^2/rho + 0.4*(E - 0.5*m^2/rho)"], E = ["m/rho*(1.4*E - 0.2*m^2/rho)"] }}
            initial = {{ rho = "if(x < 0.5, 1, 0.125)", m = "0", E = "if(x < 0.5, 2.5, 0.25)" }}
            boundary = {{ rho = "outflow", m = "outflow", E = "outflow" }}
            [mesh]
            generator = {{ kind = "{generator}" }}
            "#
        ));
        let [low, high] = range(run.state.as_ref().unwrap().u.component(0));
        assert!(low > 0.125 - 1e-9 && high < 1.0 + 1e-9, "{generator}: {low} to {high}");
        distance(&run, 0, exact)
    };
    let [moving, fixed] = ["whole", "fixed"].map(error);
    assert!(moving < 0.5 * fixed && fixed < 0.01, "{moving} beside {fixed}");
}

/// Buckley and Leverett's displacement: the front is where a run on 2000 cells has it, within two cells, on cells that
/// stay and that move, whatever the diffusion; central fluxes have it at the wrong place, which is said.
#[test]
fn a_flux_that_is_not_convex_has_its_front() {
    let run = |generator: &str, diffusivity: &str, scheme: &str| {
        line(&format!(
            r#"
            [grid]
            cells = [60]
            [time]
            start = 0.0
            end = 0.5
            [pde]
            kind = "formula"
            {scheme}
            unknowns = ["u"]
            flux = {{ u = ["u^2/(u^2 + 0.5*(1 - u)^2)"] }}
            diffusivity = {{ u = "{diffusivity}" }}
            initial = {{ u = "0.5*(1 - tanh((x - 0.05)/0.01))" }}
            boundary = {{ u = "if(x < 0.5, 1, 0)" }}
            [mesh]
            generator = {{ kind = "{generator}" }}
            "#
        ))
    };
    let said = |run: &MovingRun<1>| run.record.warnings.iter().any(|said| said.contains("too wide for central fluxes"));
    let front = |run: &MovingRun<1>| {
        let state = run.state.as_ref().unwrap();
        let u: Vec<f64> = state.u.component(0).collect();
        let k = u.windows(2).position(|u| u[0] >= 0.3 && u[1] < 0.3).unwrap();
        let [x, y] = [0, 1].map(|n| state.mesh.x()[k + n][0]);
        x + (y - x) * (u[k] - 0.3) / (u[k] - u[k + 1])
    };
    assert!(said(&run("fixed", "0.001", "scheme = \"central\"")));
    for generator in ["fixed", "whole"] {
        for (scheme, diffusivity) in [("", "1e-3"), ("", "1e-4"), ("", "1e-5"), ("scheme = \"limited\"", "1e-3")] {
            let run = run(generator, diffusivity, scheme);
            assert!(!said(&run));
            // 0.7423 on 2000 cells
            let off = front(&run) - 0.7423;
            println!("{generator}, {diffusivity}, {scheme}: {off:.4}");
            assert!(off.abs() < 2.0 / 60.0, "{generator}, {diffusivity}, {scheme}: {off}");
            let [low, high] = range(run.state.as_ref().unwrap().u.component(0));
            assert!(low > -0.02 && high < 1.02, "{generator}, {diffusivity}, {scheme}: {low} to {high}");
        }
    }
}

/// Layers of Burgers' own equation form in the plane where no cell resolves them: the run completes within the range of
/// its data, on cells that move and that stay.
#[test]
fn layers_form_in_the_plane() {
    for (generator, lowest) in [("whole", 0.745), ("fixed", 0.7)] {
        let run = plane(&format!(
            r#"
            [domain]
            upper = [1.0, 0.05]
            periodic = [false, true]
            [grid]
            cells = [80, 2]
            [time]
            start = 0.0
            end = 1.0
            [pde]
            kind = "burgers"
            viscosity = 1e-4
            initial = "sin(2*pi*x) + 0.5*sin(pi*x)"
            boundary = "0"
            [mesh]
            generator = {{ kind = "{generator}" }}
            "#
        ));
        assert!(run.record.warnings.is_empty(), "{:?}", run.record.warnings);
        let [low, high] = range(run.state.unwrap().u.component(0));
        // the exact solution has -0.1142 and 0.7557 at the end
        assert!(low > -0.116 && (lowest..0.757).contains(&high), "{generator}: {low} to {high}");
    }
}

/// A wave that goes along with what is limited, on a mesh that is moved about: order 2 in the mean, and ∫u stays.
#[test]
fn a_smooth_wave_is_second_order() {
    let error = |cells: usize| {
        let run = plane(&format!(
            r#"
            [domain]
            periodic = [true, true]
            [grid]
            cells = [{cells}, {cells}]
            [time]
            start = 0.0
            end = 0.5
            step = {}
            [pde]
            kind = "formula"
            unknowns = ["g", "u"]
            flux = {{ u = ["u", "0.5*u"] }}
            initial = {{ g = "1 + 0.5*sin(2*pi*x)*cos(2*pi*(y - t))", u = "2 + sin(2*pi*x)*sin(2*pi*y)" }}
            exact = {{ u = "2 + sin(2*pi*(x - t))*sin(2*pi*(y - 0.5*t))" }}
            [monitor]
            kind = "given"
            of = "1 + 0.5*sin(2*pi*x)*cos(2*pi*(y - t))"
            [mesh]
            relaxation = 0.05
            "#,
            0.4 / cells as f64
        ));
        let report = run.record.reports.last().unwrap();
        assert!(report.conserved.drift.abs() < 1e-12, "{}", report.conserved.drift);
        let state = run.state.unwrap();
        let exact = |[x, y]: [f64; 2]| {
            use std::f64::consts::PI;
            2.0 + (2.0 * PI * (x - 0.5)).sin() * (2.0 * PI * (y - 0.25)).sin()
        };
        let off = state.mesh.x().iter().zip(state.u.component(1)).map(|(x, u)| (u - exact(*x)).abs());
        off.sum::<f64>() / state.mesh.x().len() as f64
    };
    let errors = [32, 64].map(error);
    let order = (errors[0] / errors[1]).log2();
    assert!(errors[0] < 0.02 && order > 1.7, "{errors:?}, order {order:.2}");
}

/// Fisher's wave from a blob: u stays between its states, and the front goes with the speed 2.
#[test]
fn a_reaction_keeps_its_states() {
    let run = plane(
        r#"
        [domain]
        lower = [0.0, 0.0]
        upper = [200.0, 10.0]
        periodic = [false, true]
        [grid]
        cells = [100, 4]
        [time]
        start = 0.0
        end = 30.0
        [pde]
        kind = "formula"
        unknowns = ["u"]
        diffusivity = { u = "1" }
        source = { u = "u*(1 - u)" }
        initial = { u = "exp(-(x - 100)^2/4)" }
        boundary = { u = "no-flux" }
        "#,
    );
    let [low, high] = range(run.state.as_ref().unwrap().u.component(0));
    assert!(low >= 0.0 && high <= 1.0, "{low} to {high}");
}

/// An obstacle: u_t = u_xx − 2 above u ≥ 0 with u = ¼ at x = 0 comes to rest at (½ − x)² up to x = ½ and 0 from there.
#[test]
fn an_obstacle_is_met() {
    let error = |cells: usize| {
        let run = line(&format!(
            r#"
            [grid]
            cells = [{cells}]
            [time]
            start = 0.0
            end = 2.0
            [pde]
            kind = "formula"
            unknowns = ["u"]
            diffusivity = {{ u = "1" }}
            source = {{ u = "-2" }}
            initial = {{ u = "0.25" }}
            boundary = {{ u = {{ left = "0.25", right = "no-flux" }} }}
            bounds = {{ u = [0, inf] }}
            "#
        ));
        let state = run.state.unwrap();
        let off = state.mesh.x().iter().zip(state.u.component(0));
        assert!(state.u.values().iter().all(|u| *u >= 0.0));
        off.map(|([x], u)| (u - (0.5 - x).max(0.0).powi(2)).abs()).fold(0.0, f64::max)
    };
    let errors = [41, 83].map(error);
    assert!(errors[0] < 1e-3 && errors[1] < 3e-4, "{errors:?}");
}

/// Bounds that are no bounds are told where they are.
#[test]
fn bounds_in_the_wrong_order_are_refused() {
    let refused = |bounds: &str| {
        let text = format!(
            "{HEAD}[grid]\ncells = [20]\n[time]\nstart = 0\nend = 1\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\n\
             diffusivity = {{ u = \"1\" }}\ninitial = {{ u = \"0.5\" }}\nboundary = {{ u = \"no-flux\" }}\n\
             bounds = {bounds}\n"
        );
        match MovingLine::from_source(&Source::new("line.toml", text)) {
            Err(error) => error.to_string(),
            Ok(study) => match study.compute() {
                Err(error) => error.to_string(),
                Ok((_, failure)) => failure.map(|error| error.to_string()).unwrap_or_default(),
            },
        }
    };
    let said = refused("{ u = [1, 0] }");
    assert!(said.contains("bounds.u") && said.contains("exchange them"), "{said}");
    let said = refused("{ v = [0, 1] }");
    assert!(said.contains("bounds.v") && said.contains("unknowns"), "{said}");
    let said = refused("{ u = [\"x\", \"0.5\"] }");
    assert!(said.contains("the lower bound of u") && said.contains("x = "), "{said}");
}
