//! Public problems as studies, against exact solutions and independent references, and beside equal cells. The values
//! that SciPy gives are printed by `python tests/python/problems.py`.

use crate::runs::line;
use driftmesh::study::MovingRun;

/// An unknown over x, linear between the nodes.
struct Profile {
    x: Vec<f64>,
    u: Vec<f64>,
}

impl Profile {
    fn of(run: &MovingRun<1>, unknown: usize) -> Self {
        let state = run.state.as_ref().unwrap();
        Self { x: state.mesh.x().iter().map(|[x]| *x).collect(), u: state.u.component(unknown).collect() }
    }

    fn at(&self, x: f64) -> f64 {
        let k = self.x.partition_point(|at| *at < x).clamp(1, self.x.len() - 1);
        let share = (x - self.x[k - 1]) / (self.x[k] - self.x[k - 1]);
        (1.0 - share) * self.u[k - 1] + share * self.u[k]
    }

    /// ∫|u − exact| by 20 places in each cell.
    fn distance(&self, exact: impl Fn(f64) -> f64) -> f64 {
        let cells = self.x.windows(2).flat_map(|x| (0..20).map(move |k| (x[0], x[1] - x[0], (k as f64 + 0.5) / 20.0)));
        cells.map(|(x, h, share)| (self.at(x + share * h) - exact(x + share * h)).abs() * h / 20.0).sum()
    }

    fn largest_error(&self, exact: impl Fn(f64) -> f64) -> f64 {
        self.x.iter().zip(&self.u).fold(0.0, |off, (x, u)| (u - exact(*x)).abs().max(off))
    }
}

/// A run on the mesh that moves, and one on equal cells.
fn both(text: &str) -> [MovingRun<1>; 2] {
    ["whole", "fixed"].map(|generator| line(&format!("{text}\n[mesh]\ngenerator = {{ kind = \"{generator}\" }}\n")))
}

/// Robertson's kinetics, rates from .04 to 3e7: within 1e-4 of SciPy, for an unknown of 1e-5 of its own size.
#[test]
fn robertsons_kinetics_are_those_of_scipy() {
    let run = line(
        r#"
        [grid]
        cells = [4]
        [time]
        start = 0.0
        end = 40.0
        tolerance = 1e-5
        [pde]
        kind = "formula"
        unknowns = ["a", "b", "c"]
        source = { a = "1e4*b*c - 0.04*a", b = "0.04*a - 1e4*b*c - 3e7*b^2", c = "3e7*b^2" }
        initial = { a = "1", b = "0", c = "0" }
        boundary = { a = "no-flux", b = "no-flux", c = "no-flux" }
        [mesh]
        generator = { kind = "fixed" }
        "#,
    );
    let state = run.state.as_ref().unwrap();
    for (c, known) in [0.7158270687671204, 9.185534766424266e-06, 0.28416374569811426].into_iter().enumerate() {
        let off = state.u.component(c).map(|u| (u / known - 1.0).abs()).fold(0.0, f64::max);
        assert!(off < 1e-4, "{c}: {off:e}");
    }
}

/// An American put with strike 100, rate .05, volatility .2 and a year to go: within .5 % of a binomial tree.
#[test]
fn an_american_put_is_that_of_a_binomial_tree() {
    let tree = |price: f64| -> f64 {
        let value = |steps: usize| {
            let dt = 1.0 / steps as f64;
            let up = (0.2 * dt.sqrt()).exp();
            let (p, discount) = (((0.05 * dt).exp() - 1.0 / up) / (up - 1.0 / up), (-0.05 * dt).exp());
            let exercised = |m: usize, j: usize| (100.0 - price * up.powi(m as i32 - 2 * j as i32)).max(0.0);
            let mut values: Vec<f64> = (0..=steps).map(|j| exercised(steps, j)).collect();
            for m in (0..steps).rev() {
                let held = values.windows(2).map(|next| discount * (p * next[0] + (1.0 - p) * next[1]));
                values = held.enumerate().map(|(j, value)| value.max(exercised(m, j))).collect();
            }
            values[0]
        };
        0.5 * (value(1000) + value(1001))
    };
    // V_τ = ½σ²x² V_xx + r x V_x − r V in the form of a conservation law
    let runs = both(
        r#"
        [domain]
        lower = [0.0]
        upper = [300.0]
        [grid]
        cells = [100]
        [time]
        start = 0.0
        end = 1.0
        [pde]
        kind = "formula"
        unknowns = ["v"]
        flux = { v = ["-(0.05 - 0.04)*x*v"] }
        diffusivity = { v = "0.02*x^2" }
        source = { v = "-(2*0.05 - 0.04)*v" }
        initial = { v = "max(100 - x, 0)" }
        bounds = { v = ["max(100 - x, 0)", inf] }
        boundary = { v = { left = "100", right = "0" } }
        "#,
    );
    let off = runs.each_ref().map(|run| {
        let found = Profile::of(run, 0);
        [85.0, 90.0, 100.0, 110.0, 120.0].map(|x| (found.at(x) / tree(x) - 1.0).abs()).into_iter().fold(0.0, f64::max)
    });
    assert!(off[0] < 5e-3 && off[0] < 1.001 * off[1], "{off:?}");
}

/// A uniform scheme of second order for gas of γ = 1.4 in equal cells: van Leer's limited slopes of density, velocity
/// and pressure, fluxes of Harten, Lax and van Leer, Heun's steps. Returns the density in the cells.
fn van_leer(cells: usize, length: f64, end: f64, left: [f64; 3], right: [f64; 3]) -> Vec<f64> {
    let pressure = |u: [f64; 3]| 0.4 * (u[2] - 0.5 * u[1] * u[1] / u[0]);
    let conserved = |w: [f64; 3]| [w[0], w[0] * w[1], w[2] / 0.4 + 0.5 * w[0] * w[1] * w[1]];
    let flux = |u: [f64; 3]| [u[1], u[1] * u[1] / u[0] + pressure(u), u[1] / u[0] * (u[2] + pressure(u))];
    let sound = |u: [f64; 3]| (1.4 * pressure(u) / u[0]).sqrt();
    let hll = |l: [f64; 3], r: [f64; 3]| {
        let low = (l[1] / l[0] - sound(l)).min(r[1] / r[0] - sound(r)).min(0.0);
        let high = (l[1] / l[0] + sound(l)).max(r[1] / r[0] + sound(r)).max(0.0);
        let (f, g) = (flux(l), flux(r));
        [0, 1, 2].map(|c| (high * f[c] - low * g[c] + low * high * (r[c] - l[c])) / (high - low))
    };
    let change = |u: &[[f64; 3]]| -> Vec<[f64; 3]> {
        let w: Vec<[f64; 3]> = u.iter().map(|u| [u[0], u[1] / u[0], pressure(*u)]).collect();
        let at = |k: isize| w[k.clamp(0, w.len() as isize - 1) as usize];
        let slope = |k: isize| {
            [0, 1, 2].map(|c| {
                let (a, b) = (at(k)[c] - at(k - 1)[c], at(k + 1)[c] - at(k)[c]);
                if a * b > 0.0 { 2.0 * a * b / (a + b) } else { 0.0 }
            })
        };
        let toward = |k: isize, side: f64| conserved([0, 1, 2].map(|c| at(k)[c] + 0.5 * side * slope(k)[c]));
        let faces: Vec<[f64; 3]> = (0..=u.len() as isize).map(|k| hll(toward(k - 1, 1.0), toward(k, -1.0))).collect();
        faces.windows(2).map(|f| [0, 1, 2].map(|c| (f[0][c] - f[1][c]) * cells as f64 / length)).collect()
    };
    let mut u: Vec<[f64; 3]> = (0..cells).map(|k| conserved(if 2 * k < cells { left } else { right })).collect();
    let mut t = 0.0;
    while t < end {
        let fastest = u.iter().fold(0.0, |m: f64, u| m.max((u[1] / u[0]).abs() + sound(*u)));
        let dt = (0.4 * length / cells as f64 / fastest).min(end - t);
        let step = |u: &[[f64; 3]]| -> Vec<[f64; 3]> {
            let change = change(u);
            u.iter().zip(change).map(|(u, d)| [0, 1, 2].map(|c| u[c] + dt * d[c])).collect()
        };
        let twice = step(&step(&u));
        u.iter_mut().zip(twice).for_each(|(u, v)| *u = [0, 1, 2].map(|c| 0.5 * (u[c] + v[c])));
        t += dt;
    }
    u.into_iter().map(|u| u[0]).collect()
}

/// Sod's tube in pascals, 10 m and 100 cells: at most half of the error of van Leer's scheme in equal cells.
#[test]
fn a_shock_tube_in_pascals_gains() {
    // in units of the state on the left, at t = .0061 √1e5/10; Toro (2009), table 4.2
    let t = 0.0061 * 1e5_f64.sqrt() / 10.0;
    let exact = |x: f64| {
        let (s, gamma) = ((0.1 * x - 0.5) / t, 1.4_f64);
        let (sound, pressure, speed) = (gamma.sqrt(), 0.303_130_178_050_646_f64, 0.927_452_620_048_950);
        let tail = speed - sound * pressure.powf(0.5 * (gamma - 1.0) / gamma);
        match s {
            s if s < -sound => 1.0,
            s if s < tail => (2.0 / (gamma + 1.0) - (gamma - 1.0) / ((gamma + 1.0) * sound) * s).powf(5.0),
            s if s < speed => pressure.powf(1.0 / gamma),
            s if s < 1.752_155_731_932_5 => 0.265_573_711_705_307,
            _ => 0.125,
        }
    };
    let [moving, fixed] = both(
        r#"
        [domain]
        lower = [0.0]
        upper = [10.0]
        [grid]
        cells = [100]
        [time]
        start = 0.0
        end = 0.0061
        [pde]
        kind = "formula"
        unknowns = ["rho", "m", "E"]
        flux = { rho = ["m"], m = ["m^2/rho + 0.4*(E - 0.5*m^2/rho)"], E = ["m/rho*(1.4*E - 0.2*m^2/rho)"] }
        initial = { rho = "if(x < 5, 1, 0.125)", m = "0", E = "if(x < 5, 2.5e5, 2.5e4)" }
        boundary = { rho = "outflow", m = "outflow", E = "outflow" }
        "#,
    )
    .map(|run| Profile::of(&run, 0));
    assert!(moving.u.iter().all(|rho| (0.125 - 1e-9..=1.0 + 1e-9).contains(rho)));
    let cells = van_leer(100, 10.0, 0.0061, [1.0, 0.0, 1e5], [0.125, 0.0, 1e4]);
    let of_cells: f64 = (cells.iter().enumerate())
        .map(|(k, rho)| {
            (0..20).map(|s| 0.005 * (rho - exact(0.1 * k as f64 + 0.005 * (s as f64 + 0.5))).abs()).sum::<f64>()
        })
        .sum();
    let [moving, fixed] = [moving, fixed].map(|found| found.distance(exact));
    println!("moving {moving:.4}, fixed {fixed:.4}, van Leer {of_cells:.4}");
    assert!(moving < 0.5 * of_cells && moving < 0.5 * fixed, "{moving} beside {fixed} and {of_cells}");
}

/// A dam breaks over a dry bed (Ritter 1892): no depth below 0, and a third of the error of equal cells. The velocity
/// is m/h, without the digits of films thinner than a hundredth of the depth, 2hm/(h² + max(h², 1e-4)).
#[test]
fn a_dam_breaks_over_a_dry_bed() {
    let runs = both(
        r#"
        [domain]
        lower = [-1.0]
        upper = [1.0]
        [grid]
        cells = [100]
        [time]
        start = 0.0
        end = 0.4
        [pde]
        kind = "formula"
        unknowns = ["h", "m"]
        flux = { h = ["m"], m = ["2*h*m^2/(h^2 + max(h^2, 1e-4)) + h^2/2"] }
        initial = { h = "if(x < 0, 1, 0)", m = "0" }
        boundary = { h = "outflow", m = "outflow" }
        "#,
    );
    let [moving, fixed] = runs.map(|run| {
        let depth = Profile::of(&run, 0);
        assert!(depth.u.iter().all(|h| *h >= 0.0));
        depth.distance(|x| match x / 0.4 {
            s if s < -1.0 => 1.0,
            s if s < 2.0 => (2.0 - s) * (2.0 - s) / 9.0,
            _ => 0.0,
        })
    });
    assert!(moving < fixed / 3.0 && moving < 3e-3, "{moving} beside {fixed}");
}

/// Cells that follow what they give off (Keller and Segel), on a disc with more than the mass 8π that draws together in
/// one point: the density at the centre, seven times that of the start by then, within .4 % of SciPy on 1600 cells by
/// steps of either kind, although the initial value of what they give off, which has no time derivative, is a guess.
#[test]
fn cells_draw_together() {
    for steps in ["", "tolerance = 1e-3"] {
        let run = line(&format!(
            r#"
        [domain]
        coordinates = "cylindrical"
        [grid]
        cells = [320]
        [time]
        start = 0.0
        end = 0.05
        {steps}
        [pde]
        kind = "formula"
        unknowns = ["u", "v"]
        flux = {{ u = ["u*v_x"] }}
        diffusivity = {{ u = "1", v = "1" }}
        source = {{ v = "u - 10*(1 - exp(-12))" }}
        storage = {{ v = 0 }}
        initial = {{ u = "120*exp(-12*x^2)", v = "0" }}
        boundary = {{ u = "no-flux", v = {{ left = "no-flux", right = "0" }} }}
        [monitor]
        kind = "auto"
        of = "u"
        "#,
        ));
        let centre = Profile::of(&run, 0).u[0];
        println!("Keller and Segel: {centre}");
        assert!((centre / 847.04 - 1.0).abs() < 0.004, "{steps}: {centre}");
    }
}

/// Halfar's dome of ice with Glen's exponent 3, whose flux takes H⁵|H_x|²: no depth below 0, and less error than equal
/// cells, at an order of 1.25.
#[test]
fn a_dome_of_ice_spreads() {
    let error = |cells: usize, generator: &str| {
        let run = line(&format!(
            r#"
            [domain]
            lower = [-3.0]
            upper = [3.0]
            [grid]
            cells = [{cells}]
            [time]
            start = 1.0
            end = 8.0
            [pde]
            kind = "formula"
            unknowns = ["H"]
            diffusivity = {{ H = "max(H, 0)^5*H_x^2" }}
            initial = {{ H = "max(0, 1 - 7/4*(1/11)^(1/3)*abs(x)^(4/3))^(3/7)" }}
            boundary = {{ H = "0" }}
            [mesh]
            generator = {{ kind = "{generator}" }}
            "#
        ));
        let found = Profile::of(&run, 0);
        assert!(found.u.iter().all(|h| *h >= 0.0), "{generator} {cells}: {:?}", found.u);
        let scale = 8.0_f64.powf(-1.0 / 11.0);
        let exact = |x: f64| {
            let rest = 1.0 - 1.75 * (1.0_f64 / 11.0).cbrt() * (x.abs() * scale).powf(4.0 / 3.0);
            scale * rest.max(0.0).powf(3.0 / 7.0)
        };
        found.distance(exact)
    };
    let [coarse, fine] = [60, 320].map(|cells| error(cells, "whole"));
    let fixed = error(320, "fixed");
    println!("ice: {coarse:.2e}, {fine:.2e}, fixed {fixed:.2e}");
    assert!((coarse / fine).log(320.0 / 60.0) > 1.25 && fine < fixed, "{coarse:e}, {fine:e} beside {fixed:e}");
}

/// The layer of charges at a wall (Gouy and Chapman), a hundredth of the length wide: second order, a twentieth of the
/// error of equal cells.
#[test]
fn a_layer_of_charges_is_second_order() {
    let error = |cells: usize| {
        both(&format!(
            r#"
            [grid]
            cells = [{cells}]
            [time]
            start = 0.0
            end = 30.0
            [pde]
            kind = "formula"
            unknowns = ["u"]
            diffusivity = {{ u = "1e-4" }}
            source = {{ u = "-sinh(u)" }}
            initial = {{ u = "4*(1 - x)^8" }}
            boundary = {{ u = {{ left = "4", right = "0" }} }}
            "#
        ))
        .map(|run| {
            let exact = |x: f64| {
                let layer = 1.0_f64.tanh() * (-100.0 * x).exp();
                2.0 * ((1.0 + layer) / (1.0 - layer)).ln()
            };
            Profile::of(&run, 0).largest_error(exact)
        })
    };
    let [coarse, fine] = [20, 80].map(error);
    println!("layer of charges: {coarse:?}, {fine:?}");
    assert!((coarse[0] / fine[0]).log(4.0) > 1.8 && fine[0] < fine[1] / 20.0, "{coarse:?}, {fine:?}");
}

/// An electrolyte between electrodes that let nothing through (Poisson, Nernst and Planck) comes to the rest of
/// Poisson's and Boltzmann's equation, at second order.
#[test]
fn an_electrolyte_comes_to_rest() {
    let error = |cells: usize| {
        let run = line(&format!(
            r#"
            [domain]
            lower = [0.0]
            upper = [10.0]
            [grid]
            cells = [{cells}]
            [time]
            start = 0.0
            end = 200.0
            [pde]
            kind = "formula"
            unknowns = ["cp", "cn", "phi"]
            flux = {{ cp = ["-cp*phi_x"], cn = ["cn*phi_x"] }}
            diffusivity = {{ cp = "1", cn = "1", phi = "1" }}
            source = {{ phi = "cp - cn" }}
            storage = {{ phi = 0 }}
            initial = {{ cp = "1", cn = "1", phi = "x/5 - 1" }}
            boundary = {{ cp = "no-flux", cn = "no-flux", phi = "x/5 - 1" }}
            "#
        ));
        let [cations, anions] = [0, 1].map(|c| Profile::of(&run, c));
        let ends = [cations.u[0], anions.u[anions.u.len() - 1]];
        ends.map(|found| (found - 2.621914295008985).abs()).into_iter().fold(0.0, f64::max)
    };
    let [coarse, fine] = [20, 40].map(error);
    println!("electrolyte: {coarse:.2e}, {fine:.2e}");
    assert!((coarse / fine).log2() > 1.5 && fine < 1e-3, "{coarse:e}, {fine:e}");
}

/// Water enters a column of dry soil (Celia, Bouloutas and Zarba 1990), by its head with the water content as storage:
/// within 1 % of SciPy on twenty times as many cells.
#[test]
fn water_enters_dry_soil() {
    let run = line(
        r#"
        [domain]
        lower = [0.0]
        upper = [40.0]
        [grid]
        cells = [40]
        [time]
        start = 0.0
        end = 360.0
        [pde]
        kind = "formula"
        unknowns = ["h"]
        flux = { h = ["-0.00944*1.175e6/(1.175e6 + abs(h)^4.74)"] }
        diffusivity = { h = "0.00944*1.175e6/(1.175e6 + abs(h)^4.74)" }
        storage = { h = "0.075 + 1.611e6*0.212/(1.611e6 + abs(h)^3.96)" }
        initial = { h = "-61.5" }
        boundary = { h = { left = "-61.5", right = "-20.7" } }
        "#,
    );
    let found = Profile::of(&run, 0);
    for (x, head) in [
        (20.0, -60.79427304192106),
        (25.0, -37.11586102178308),
        (28.0, -27.798678865072585),
        (30.0, -25.073651078092414),
    ] {
        let off = (found.at(x) / head - 1.0).abs();
        assert!(off < 0.01, "{x}: {} for {head}", found.at(x));
    }
}

/// A slab with the heat 1 flowing in that radiates u⁴ at its other side comes to rest at u = 2 − x.
#[test]
fn a_slab_radiates_what_flows_in() {
    let run = line(
        r#"
        [grid]
        cells = [10]
        [time]
        start = 0.0
        end = 20.0
        [pde]
        kind = "formula"
        unknowns = ["u"]
        diffusivity = { u = "1" }
        initial = { u = "0" }
        boundary = { u = { left = { flux = "1" }, right = { flux = "-u^4" } } }
        "#,
    );
    let off = Profile::of(&run, 0).largest_error(|x| 2.0 - x);
    assert!(off < 1e-6, "{off:e}");
}
