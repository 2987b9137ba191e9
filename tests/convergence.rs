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
