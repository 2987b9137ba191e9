//! Formulas against the built-in equation, and their Newton's matrix.

use super::super::finite_volumes::tests::order_of_newton;
use super::*;
use crate::geometry::Lattice;
use crate::numerics::linear::RobustTransport;
use crate::physics::{Burgers, BurgersFlux, Convection, FormulaPde, Motion, Physics};

/// Burgers' equation solved as well as a formula is.
struct Tight(Burgers);

impl Law<1> for Tight {
    type Node = f64;
    const TOLERANCE: f64 = <FormulaLaw<2, 1, 3, 8, RobustTransport<1>> as Law<1>>::TOLERANCE;

    fn names(&self) -> [&'static str; 1] {
        self.0.names()
    }

    fn nodes(&self, t: f64, x: &[[f64; 2]], u: &[[f64; 1]]) -> Vec<f64> {
        self.0.nodes(t, x, u)
    }

    fn convection(&self, a: &f64, b: &f64, normal: [f64; 2]) -> Crossing<1> {
        self.0.convection(a, b, normal)
    }

    fn diffusivity(&self, a: &f64, b: &f64) -> Crossing<1> {
        Law::diffusivity(&self.0, a, b)
    }

    fn damped(&self) -> [bool; 1] {
        self.0.damped()
    }

    fn has_own_flux(&self) -> [bool; 1] {
        self.0.has_own_flux()
    }

    fn side(&self, t: f64, x: [f64; 2], beyond: [[bool; 2]; 2]) -> [Option<f64>; 1] {
        self.0.side(t, x, beyond)
    }
}

/// The matrix of Newton's method is the derivative of the residual for two unknowns that convect, diffuse and make
/// each other: what a step leaves out falls with the square of its length.
#[test]
fn newton_converges_quadratically() {
    let pde: FormulaPde = toml::from_str(
        r#"
        unknowns = ["u", "v"]
        flux = { u = ["u^2/2", "u*v"], v = ["u*v", "0.3*v^2"] }
        diffusivity = { u = "0.05*(1 + u*v)", v = "0.04*(1 + v^2 + 0.2*x)" }
        source = { u = "u*(1 - v) + sin(x + t)", v = "u*v - v^2" }
        initial = { u = "1 + 0.3*sin(2*x)*cos(y)", v = "0.5 + 0.2*cos(x - y)" }
        boundary = { u = "1", v = "no-flux" }
        "#,
    )
    .unwrap();
    let law: FormulaLaw<2, 2, 4, 24, RobustTransport<2>> =
        FormulaLaw::new(pde.read().unwrap(), DualCells::new, Stepper::Trapezoid, true);
    let square = Mesh::uniform(Lattice::bounded([9, 8]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let mesh = |t: f64| {
        let bent = |x: f64, y: f64| x + 0.07 * (std::f64::consts::TAU * x).sin() * (5.0 * y + 3.0 * t).cos();
        square.moved(square.x().iter().map(|&[x, y]| [bent(x, y), bent(y, x)]).collect()).unwrap()
    };
    let [old, new] = [0.0, 0.1].map(mesh);
    let u = law.initial(0.0, &old);
    let motion = Motion { t: 0.0, dt: 0.1, old: &old, new: &new };
    let order = order_of_newton(&law, motion, u.values().as_chunks::<2>().0);
    assert!((order - 2.0).abs() < 0.1, "order {order:.3}");
}

/// The same with a tensor, cross diffusion, gradients in a flux and in a source, and storage.
#[test]
fn newton_converges_quadratically_with_gradients() {
    let pde: FormulaPde = toml::from_str(
        r#"
        unknowns = ["u", "v"]
        flux = { u = ["u*v_x", "u*v_y*x"] }
        diffusivity = { u = [["1 + u^2", "0.3"], ["0.2*v", "0.5"]], v = { v = "1 + u_x^2", u = "0.3*u" } }
        source = { u = "u_x*v_y + sin(x + t)", v = "u*v - v_x^2" }
        storage = { u = "u + u^3", v = "v + 0.3*u*v" }
        initial = { u = "1 + 0.3*sin(2*x)*cos(y)", v = "0.5 + 0.2*cos(x - y)" }
        boundary = { u = "1", v = "no-flux" }
        "#,
    )
    .unwrap();
    let law: FormulaLaw<2, 2, 4, 24, RobustTransport<2>> =
        FormulaLaw::new(pde.read().unwrap(), DualCells::new, Stepper::Trapezoid, true);
    let square = Mesh::uniform(Lattice::bounded([9, 8]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let mesh = |t: f64| {
        let bent = |x: f64, y: f64| x + 0.07 * (std::f64::consts::TAU * x).sin() * (5.0 * y + 3.0 * t).cos();
        square.moved(square.x().iter().map(|&[x, y]| [bent(x, y), bent(y, x)]).collect()).unwrap()
    };
    let [old, new] = [0.0, 0.1].map(mesh);
    let u = law.initial(0.0, &old);
    let motion = Motion { t: 0.0, dt: 0.1, old: &old, new: &new };
    let order = order_of_newton(&law, motion, u.values().as_chunks::<2>().0);
    assert!((order - 2.0).abs() < 0.1, "order {order:.3}");
}

/// Burgers' equation with central fluxes is the same equation as formulas, to round-off over 50 steps of a moving
/// mesh.
#[test]
fn burgers_as_formulas_is_burgers() {
    let viscosity = 0.01;
    let front = format!("1/(1 + exp((x + y - t)/{}))", 2.0 * viscosity);
    let pde: FormulaPde = toml::from_str(&format!(
        r#"
        unknowns = ["u"]
        flux = {{ u = ["0.5*u^2", "0.5*u^2"] }}
        diffusivity = {{ u = {viscosity} }}
        initial = {{ u = "{front}" }}
        boundary = {{ u = "{front}" }}
        exact = {{ u = "{front}" }}
        "#
    ))
    .unwrap();
    let mut written = pde.stepped(Stepper::Trapezoid).unwrap();
    let mut builtin = Burgers::new(viscosity, Convection::Flux).unwrap();
    builtin.flux = BurgersFlux::Central;
    let (law, mut volumes) = (Tight(builtin.clone()), FiniteVolumes::<1>::default());
    let square = Mesh::uniform(Lattice::bounded([30, 30]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let mesh = |t: f64| {
        let bent = |x: f64, y: f64| x + 0.1 * (std::f64::consts::TAU * x).sin() * (5.0 * y + 3.0 * t).cos();
        square.moved(square.x().iter().map(|&[x, y]| [bent(x, y), bent(y, x)]).collect()).unwrap()
    };
    let (dt, start) = (2e-3, 0.3);
    let mut old = mesh(start);
    let mut ours = written.initial(start, &old);
    let mut theirs: Vec<[f64; 1]> = builtin.initial(start, &old).values().iter().map(|u| [*u]).collect();
    for step in 0..50 {
        let t = start + f64::from(step) * dt;
        let new = mesh(t + dt);
        let motion = Motion { t, dt, old: &old, new: &new };
        ours = written.step(motion, &ours).unwrap().0;
        theirs = volumes.step(&law, motion, &theirs).unwrap().0;
        let off = ours.values().iter().zip(theirs.as_flattened()).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(off < 1e-13, "off by {off:.1e} after step {step}");
        old = new;
    }
    let end = start + 50.0 * dt;
    let [ours, theirs] = [written.exact(end, &old), builtin.exact(end, &old)].map(Option::unwrap);
    assert!(ours.values().iter().zip(theirs.values()).all(|(a, b)| (a - b).abs() < 1e-13));
}
