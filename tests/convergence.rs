//! Observed orders of the discretisations, on data that no scheme solves exactly.

use driftmesh::geometry::{Field, Lattice, Mesh};
use driftmesh::physics::{Burgers, Convection, Motion, Physics};
use std::f64::consts::PI;

/// A front wide enough for 16 cells, so that the orders show.
const VISCOSITY: f64 = 0.05;
const FORMS: [Convection; 2] = [Convection::Conservative, Convection::Advective];

/// A smooth mesh that is neither uniform nor orthogonal, and moves with `shift`.
fn distorted(n: usize, shift: f64) -> Mesh<2> {
    let mesh = Mesh::uniform(Lattice::bounded([n, n]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let x = mesh.x().iter().map(|&[s, r]| {
        let (a, b) = ((PI * s).sin(), (PI * r).sin());
        [s + 0.08 * (2.0 * PI * (r + shift)).cos() * a, r + 0.08 * (2.0 * PI * (s - shift)).sin() * b]
    });
    mesh.moved(x.collect()).unwrap()
}

/// Burgers from t = 0.2 over `span` on the meshes of the given times.
fn solve(convection: Convection, span: f64, steps: usize, mesh: impl Fn(f64) -> Mesh<2>) -> (Field, Burgers, Mesh<2>) {
    let mut burgers = Burgers::new(VISCOSITY, convection).unwrap();
    let dt = span / steps as f64;
    let mut old = mesh(0.2);
    let mut u = burgers.initial(0.2, &old);
    for step in 0..steps {
        let t = 0.2 + step as f64 * dt;
        let new = mesh(t + dt);
        u = burgers.step(Motion { t, dt, old: &old, new: &new }, &u).unwrap().0;
        old = new;
    }
    (u, burgers, old)
}

fn largest_difference(a: &Field, b: &Field) -> f64 {
    a.values().iter().zip(b.values()).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

fn error((u, burgers, mesh): (Field, Burgers, Mesh<2>), t: f64) -> f64 {
    largest_difference(&u, &burgers.exact(t, &mesh).unwrap())
}

fn assert_second_order(what: &str, coarse: f64, fine: f64) {
    let order = (coarse / fine).log(4.0);
    assert!((order - 2.0).abs() < 0.1, "{what}: observed order {order:.3} ({coarse:.2e} → {fine:.2e}), expected 2");
}

/// Against the exact solution on a fixed distorted mesh, with steps so small that only space is seen.
#[test]
fn physics_is_second_order_in_space() {
    for form in FORMS {
        let [coarse, fine] = [24, 96].map(|n| error(solve(form, 0.1, 50, |_| distorted(n, 0.1)), 0.3));
        assert_second_order(&format!("{form:?}"), coarse, fine);
    }
}

/// A step whose first residual is far above one, and one where round-off alone exceeds the usual tolerance: Newton
/// converges in a few iterations all the same.
#[test]
fn newton_converges_from_large_residuals_and_down_to_round_off() {
    for (viscosity, n) in [(1.0, 160), (1000.0, 40)] {
        let mut burgers = Burgers::new(viscosity, Convection::Conservative).unwrap();
        let mesh = Mesh::uniform(Lattice::bounded([n, n]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        let u = burgers.initial(0.25, &mesh);
        let motion = Motion { t: 0.25, dt: 0.25, old: &mesh, new: &mesh };
        let (u, work) = burgers.step(motion, &u).unwrap();
        assert!(work.newton_iterations <= 4, "ν = {viscosity}: {work:?}");
        assert!(largest_difference(&u, &burgers.exact(0.5, &mesh).unwrap()) < 1e-4);
    }
}

/// Against very small steps on the same fixed distorted mesh, so that only time is seen.
#[test]
fn physics_is_second_order_in_time() {
    for form in FORMS {
        let after = |steps| solve(form, 0.4, steps, |_| distorted(20, 0.1)).0;
        let reference = after(640);
        let [coarse, fine] = [10, 40].map(|steps| largest_difference(&after(steps), &reference));
        assert_second_order(&format!("{form:?}"), coarse, fine);
    }
}

/// Against the exact solution on a prescribed moving mesh, space and time refined together.
#[test]
fn physics_is_second_order_on_a_moving_mesh() {
    for form in FORMS {
        let [coarse, fine] = [24, 96].map(|n| error(solve(form, 0.2, n / 2, |t| distorted(n, t)), 0.4));
        assert_second_order(&format!("{form:?}"), coarse, fine);
    }
}

fn periodic(n: usize, shift: f64) -> Mesh<2> {
    let mesh = Mesh::uniform(Lattice::new([n, n], [true; 2]).unwrap(), [0.0; 2], [2.0 * PI; 2]).unwrap();
    let x = mesh.x().iter().map(|&[x, y]| [x + 0.3 * shift + 0.3 * (y + shift).cos(), y + 0.3 * (x - shift).sin()]);
    mesh.moved(x.collect()).unwrap()
}

/// Burgers' equation from u = .75 + .5 sin s, s = x + y, on the periodic plane, exact by Hopf and Cole
///
/// U = 2u solves U_t + U U_s = κ U_ss with κ = 2ν. With σ = s − 1.5 t and φ = Σ a_n exp(−κn²t) cos nσ, where a_n are
/// the Fourier coefficients of exp(cos s / 2κ) at the start, u = .75 − κ φ_σ / φ.
fn sine(t: f64, mesh: &Mesh<2>) -> Field {
    const MODES: usize = 40;
    let kappa = 2.0 * VISCOSITY;
    let points: Vec<f64> = (0..200).map(|m| 2.0 * PI * m as f64 / 200.0).collect();
    let a: Vec<f64> = (0..MODES)
        .map(|n| {
            let mean = points.iter().map(|s| (0.5 / kappa * s.cos()).exp() * (n as f64 * s).cos()).sum::<f64>() / 200.0;
            mean * if n == 0 { 1.0 } else { 2.0 } * (-kappa * (n * n) as f64 * t).exp()
        })
        .collect();
    let values = mesh.x().iter().map(|[x, y]| {
        let sigma = x + y - 1.5 * t;
        let modes = || a.iter().enumerate().map(|(n, a)| (n as f64, a));
        let phi: f64 = modes().map(|(n, a)| a * (n * sigma).cos()).sum();
        0.75 + kappa * modes().map(|(n, a)| a * n * (n * sigma).sin()).sum::<f64>() / phi
    });
    Field::scalar(values.collect())
}

/// On a doubly periodic moving mesh, from a field of the caller's own, against the exact solution.
#[test]
fn burgers_is_second_order_on_periodic_axes() {
    for form in FORMS {
        let [coarse, fine] = [40, 120].map(|n| {
            let (mut burgers, dt) = (Burgers::new(VISCOSITY, form).unwrap(), 0.2 / (n / 4) as f64);
            let mut old = periodic(n, 0.0);
            let mut u = sine(0.0, &old);
            for step in 0..n / 4 {
                let new = periodic(n, (step + 1) as f64 * dt);
                u = burgers.step(Motion { t: step as f64 * dt, dt, old: &old, new: &new }, &u).unwrap().0;
                old = new;
            }
            largest_difference(&u, &sine(0.2, &old))
        });
        let order = (coarse / fine).log(3.0);
        assert!((order - 2.0).abs() < 0.1, "{form:?}: observed order {order:.3} ({coarse:.2e} → {fine:.2e})");
    }
}

/// The conservative form keeps ∫u on a uniform periodic mesh at rest, as well as Newton's method is solved.
#[test]
fn burgers_conserves_on_a_periodic_mesh_at_rest() {
    let mesh = Mesh::uniform(Lattice::new([20, 30], [true; 2]).unwrap(), [0.0; 2], [2.0 * PI; 2]).unwrap();
    let mut burgers = Burgers::new(VISCOSITY, Convection::Conservative).unwrap();
    let start = sine(0.0, &mesh);
    let mut u = start.clone();
    for step in 0..20 {
        u = burgers.step(Motion { t: 0.05 * step as f64, dt: 0.05, old: &mesh, new: &mesh }, &u).unwrap().0;
    }
    let [before, after] = [&start, &u].map(|u| burgers.conserved(&mesh, u));
    assert!((before - 0.75 * 4.0 * PI * PI).abs() < 1e-11, "{before}");
    assert!((after - before).abs() < 1e-9 * before, "∫u went from {before} to {after}");
}

/// With one periodic axis, data shifted by a node along it give the solution shifted by a node.
#[test]
fn burgers_does_not_see_where_a_periodic_axis_is_cut() {
    for axis in [0, 1] {
        let lattice = Lattice::new([12, 12], [axis == 0, axis == 1]).unwrap();
        // far behind the front, where the sides say u = 1
        let mesh = Mesh::uniform(lattice, [-30.0; 2], [-29.0; 2]).unwrap();
        let solve = |shift: usize| {
            let values = (0..lattice.len()).map(|k| {
                let (node, other) = (lattice.node(k)[axis] + shift, lattice.node(k)[1 - axis]);
                1.0 + 0.3 * (2.0 * PI * node as f64 / 12.0).sin() * (PI * other as f64 / 12.0).sin()
            });
            let (mut burgers, mut u) =
                (Burgers::new(0.01, Convection::Conservative).unwrap(), Field::scalar(values.collect()));
            for step in 0..5 {
                u = burgers.step(Motion { t: 0.02 * step as f64, dt: 0.02, old: &mesh, new: &mesh }, &u).unwrap().0;
            }
            u
        };
        let (plain, shifted) = (solve(0), solve(1));
        for k in 0..lattice.len() {
            let mut node = lattice.node(k);
            node[axis] = (node[axis] + 1) % 12;
            let (a, b) = (plain.values()[lattice.index(node)], shifted.values()[k]);
            assert!((a - b).abs() < 1e-8, "axis {axis}, node {node:?}: {a} against {b}");
        }
    }
}
