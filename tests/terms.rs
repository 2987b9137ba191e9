//! Tensors, cross diffusion, gradients in fluxes, diffusivities and sources, storage: against exact solutions.

use crate::runs::{HEAD, line, plane};
use driftmesh::study::{Kind, MovingMesh, Source};

/// The order of the largest error from n to 2n cells and half the step, of a mesh that is moved about.
fn order(pde: &str) -> f64 {
    let error = |cells: usize| {
        let run = plane(&format!(
            r#"
            [grid]
            cells = [{cells}, {cells}]
            [time]
            start = 0.0
            end = 0.2
            step = {}
            [monitor]
            kind = "given"
            of = "1 + 0.5*sin(2*pi*x)*cos(pi*(y - t))"
            [mesh]
            relaxation = 0.05
            [pde]
            kind = "formula"
            {pde}
            "#,
            0.4 / cells as f64
        ));
        run.record.reports.last().unwrap().error.unwrap().linf
    };
    let errors = [12, 24].map(error);
    println!("{errors:?}");
    (errors[0] / errors[1]).log2()
}

/// u_t = ∇·(D∇u) + S with a full tensor, u = sin(x + 2y − t) and S = cos(…)(−1) + (D₁₁ + 4 D₂₂ + 4 D₁₂) sin(…).
#[test]
fn a_tensor_is_second_order() {
    let order = order(
        r#"
        unknowns = ["u"]
        diffusivity = { u = [["1", "0.3"], ["0.3", "0.5"]] }
        source = { u = "-cos(x + 2*y - t) + 4.2*sin(x + 2*y - t)" }
        initial = { u = "sin(x + 2*y - t)" }
        boundary = { u = "sin(x + 2*y - t)" }
        exact = { u = "sin(x + 2*y - t)" }
        "#,
    );
    assert!(order > 1.7, "{order:.2}");
}

/// The same with one diffusivity an axis, 1 along x and .1 along y.
#[test]
fn diffusivities_by_axis_are_second_order() {
    let order = order(
        r#"
        unknowns = ["u"]
        diffusivity = { u = ["1", 0.1] }
        source = { u = "-cos(x + 2*y - t) + 1.4*sin(x + 2*y - t)" }
        initial = { u = "sin(x + 2*y - t)" }
        boundary = { u = "sin(x + 2*y - t)" }
        exact = { u = "sin(x + 2*y - t)" }
        "#,
    );
    assert!(order > 1.7, "{order:.2}");
}

/// Cross diffusion and a flux by the gradient of another unknown: u_t = ∇·(∇u − u∇v) = Δu − u_x v_x − u_y v_y − uΔv
/// with v = x² + y: v_x = 2x, v_y = 1, Δv = 2, and u = e^{−t} sin x + 2.
#[test]
fn gradients_of_others_are_second_order() {
    let source = "-exp(-t)*sin(x) + exp(-t)*sin(x) + 2*x*exp(-t)*cos(x) + 2*(exp(-t)*sin(x) + 2)";
    let exact = "exp(-t)*sin(x) + 2";
    for how in [
        r#"diffusivity = { u = { u = "1", v = "-u" }, v = "1" }"#,
        "diffusivity = { u = \"1\", v = \"1\" }\nflux = { u = [\"u*v_x\", \"u*v_y\"] }",
    ] {
        let order = order(&format!(
            r#"
            unknowns = ["u", "v"]
            {how}
            source = {{ u = "{source}", v = "-2" }}
            initial = {{ u = "{exact}", v = "x^2 + y" }}
            boundary = {{ u = "{exact}", v = "x^2 + y" }}
            exact = {{ u = "{exact}", v = "x^2 + y" }}
            "#
        ));
        assert!(order > 1.7, "{how}: {order:.2}");
    }
}

/// Gradients in a diffusivity and in a source: u_t = ∇·((1 + |∇u|²)∇u) + u_x² + S with u = t + x² − y/2, for which
/// the flux is (2x (1.25 + 4x²), …), its divergence 2.5 + 24x², u_x² = 4x², and S = 1 − 2.5 − 28x².
#[test]
fn gradients_of_itself_are_second_order() {
    let order = order(
        r#"
        unknowns = ["u"]
        diffusivity = { u = "1 + u_x^2 + u_y^2" }
        source = { u = "u_x^2 - 1.5 - 28*x^2" }
        initial = { u = "t + x^2 - y/2" }
        boundary = { u = "t + x^2 - y/2" }
        exact = { u = "t + x^2 - y/2" }
        "#,
    );
    assert!(order > 1.7, "{order:.2}");
}

/// (u + u²/2)_t = Δu + S with u = 2 + sin(x + y − t): (1 + u) u_t = −(1 + u) cos(…), Δu = −2 sin(…).
#[test]
fn storage_is_second_order() {
    let order = order(
        r#"
        unknowns = ["u"]
        storage = { u = "u + u^2/2" }
        diffusivity = { u = "1" }
        source = { u = "-(3 + sin(x + y - t))*cos(x + y - t) + 2*sin(x + y - t)" }
        initial = { u = "2 + sin(x + y - t)" }
        boundary = { u = "2 + sin(x + y - t)" }
        exact = { u = "2 + sin(x + y - t)" }
        "#,
    );
    assert!(order > 1.7, "{order:.2}");
}

/// An unknown without time derivative: 0 = Δp + u with u_t = Δu; u = e^{−π²t} sin πx and p = u/π², on a line too.
#[test]
fn an_elliptic_unknown_is_second_order() {
    let pde = r#"
        unknowns = ["u", "p"]
        storage = { p = 0 }
        diffusivity = { u = "1", p = "1" }
        source = { p = "u" }
        initial = { u = "sin(pi*x)", p = "0" }
        boundary = { u = "exp(-pi^2*t)*sin(pi*x)", p = "exp(-pi^2*t)*sin(pi*x)/pi^2" }
        exact = { u = "exp(-pi^2*t)*sin(pi*x)", p = "exp(-pi^2*t)*sin(pi*x)/pi^2" }
        "#;
    let order = order(pde);
    assert!(order > 1.7, "{order:.2}");
    let run = line(&format!(
        "[grid]\ncells = [40]\n[time]\nstart = 0.0\nend = 0.1\n[pde]\nkind = \"formula\"\n{}",
        pde.replace(
            "boundary = { u = \"exp(-pi^2*t)*sin(pi*x)\", p = \"exp(-pi^2*t)*sin(pi*x)/pi^2\" }",
            "boundary = { u = 0, p = 0 }"
        )
    ));
    let off = run.record.reports.last().unwrap().error.unwrap().linf;
    assert!(off < 1e-3, "{off}");
}

/// A diffusivity that jumps from 1 to 100: −(D u')' = 1 at rest has u = x (c − x/2) up to the jump at a, and
/// u = (1 − x)(x + 1 − 2c)/200 from there; c follows from the jump. At a node it is exact, as the parabolas are; within
/// an edge of length h, of which eight places are asked, the jump is off by up to h/16, and u by u' times as much, u'
/// being at most ½.
#[test]
fn a_jump_of_the_diffusivity_counts_where_it_is() {
    for (a, cells) in [(0.5, [20, 40]), (0.4137, [20, 40])] {
        // (1 − a)(a + 1 − 2c)/200 = a (c − a/2)
        let c = ((1.0 - a * a) / 200.0 + 0.5 * a * a) / (a + (1.0 - a) / 100.0);
        let exact = |x: f64| if x < a { x * (c - 0.5 * x) } else { (1.0 - x) * (x + 1.0 - 2.0 * c) / 200.0 };
        let errors = cells.map(|cells| {
            let run = line(&format!(
                r#"
                [grid]
                cells = [{cells}]
                [time]
                start = 0.0
                end = 5.0
                [pde]
                kind = "formula"
                unknowns = ["u"]
                diffusivity = {{ u = "if(x < {a}, 1, 100)" }}
                source = {{ u = "1" }}
                initial = {{ u = "0" }}
                boundary = {{ u = 0 }}
                [mesh]
                generator = {{ kind = "fixed" }}
                "#
            ));
            let state = run.state.unwrap();
            let off = state.mesh.x().iter().zip(state.u.component(0)).map(|([x], u)| (u - exact(*x)).abs());
            off.fold(0.0, f64::max)
        });
        for (error, cells) in errors.into_iter().zip(cells) {
            let most = if a == 0.5 { 1e-10 } else { 0.5 / 16.0 / cells as f64 };
            assert!(error < most, "{a}, {cells} cells: {error:e}");
        }
    }
}

/// A source of place is integrated over cells that grow: what it balances by diffusion is no worse than on equal cells,
/// and second order on cells that are moved about.
#[test]
fn sources_of_place_are_integrated() {
    let error = |cells: usize, mesh: &str| {
        let run = plane(&format!(
            r#"
            [grid]
            cells = [{cells}, {cells}]
            [time]
            start = 0.0
            end = 2.0
            [pde]
            kind = "formula"
            unknowns = ["u"]
            diffusivity = {{ u = "0.05" }}
            source = {{ u = "40*(1 - 200*((x - 0.5)^2 + (y - 0.5)^2))*exp(-200*((x - 0.5)^2 + (y - 0.5)^2))" }}
            initial = {{ u = "exp(-200*((x - 0.5)^2 + (y - 0.5)^2))" }}
            boundary = {{ u = "exp(-200*((x - 0.5)^2 + (y - 0.5)^2))" }}
            exact = {{ u = "exp(-200*((x - 0.5)^2 + (y - 0.5)^2))" }}
            {mesh}
            "#
        ));
        run.record.reports.last().unwrap().error.unwrap().l2
    };
    let given = "[mesh]\nrelaxation = 0.05\n[monitor]\nkind = \"given\"\n\
                 of = \"1 + 9*exp(-20*((x - 0.5)^2 + (y - 0.5)^2))\"";
    for cells in [16, 24] {
        let [moving, fixed] = ["", "[mesh]\ngenerator = { kind = \"fixed\" }"].map(|mesh| error(cells, mesh));
        assert!(moving < fixed, "{cells}: {moving:e} beside {fixed:e}");
    }
    let errors = [24, 48].map(|cells| error(cells, given));
    let order = (errors[0] / errors[1]).log2();
    assert!((1.7..2.6).contains(&order), "{errors:?}, order {order:.2}");
}

/// What cannot be is told by its key.
#[test]
fn terms_that_make_no_sense_are_refused() {
    let refused = |more: &str| {
        let text = format!(
            "{HEAD}[grid]\ncells = [20, 20]\n[time]\nstart = 0\nend = 1\n[pde]\nkind = \"formula\"\n\
             unknowns = [\"u\"]\ninitial = {{ u = \"0.5\" }}\nboundary = {{ u = \"no-flux\" }}\n{more}\n"
        );
        MovingMesh::from_source(&Source::new("plane.toml", text)).map(|_| ()).unwrap_err().to_string()
    };
    for (more, key, words) in [
        ("diffusivity = { u = [\"1\"] }", "diffusivity.u", "there are 2 axes"),
        ("diffusivity = { u = { v = \"1\" } }", "diffusivity.u.v", "unknowns"),
        ("storage = { u = \"u_x\" }", "storage.u", "gradients"),
        ("storage = { u = \"u^2\" }\nscheme = \"limited\"", "storage.u", "limited"),
        ("diffusivity = { u = [\"w\", \"1\"] }", "diffusivity.u[0]", "w"),
    ] {
        let said = refused(more);
        assert!(said.contains(key) && said.contains(words), "{more}: {said}");
    }
}
