//! The explicit solver on a uniform mesh: orders, threads, conservation, and what it refuses.

use driftmesh::Failure;
use driftmesh::geometry::{Field, Lattice, Mesh};
use driftmesh::physics::{Burgers, Convection, Motion, Physics, UniformBurgers};
use driftmesh::study::{Kind, MovingMesh, MovingRun, Source};
use std::f64::consts::PI;

fn burgers(viscosity: f64) -> Burgers {
    Burgers::new(viscosity, Convection::Conservative).unwrap()
}

fn mesh(cells: [usize; 2]) -> Mesh<2> {
    Mesh::uniform(Lattice::bounded(cells).unwrap(), [0.0; 2], [1.0; 2]).unwrap()
}

/// The largest error at t = .5 from t = .25, of a front wide enough for a few cells.
fn error(order: usize, cells: [usize; 2]) -> f64 {
    let mesh = mesh(cells);
    let mut burgers = UniformBurgers::new(burgers(0.02), order).unwrap();
    let u = burgers.initial(0.25, &mesh);
    let (u, _) = burgers.step(Motion { t: 0.25, dt: 0.25, old: &mesh, new: &mesh }, &u).unwrap();
    let exact = burgers.exact(0.5, &mesh).unwrap();
    u.values().iter().zip(exact.values()).fold(0.0, |m, (u, e)| m.max((u - e).abs()))
}

/// Against the exact front, with different spacings along both axes; substeps shrink like h², so only space is seen.
#[test]
fn orders_are_two_and_four() {
    for order in [2, 4] {
        let (coarse, fine) = (error(order, [60, 50]), error(order, [120, 100]));
        let ratio = coarse / fine / 2_f64.powi(order as i32);
        assert!(
            (ratio - 1.0).abs() < 0.15,
            "order {order}: {coarse:.2e} → {fine:.2e}, {ratio:.3} of the ratio expected"
        );
    }
}

/// Bounded and periodic, with several bands and with rows that they do not divide evenly.
#[test]
fn any_number_of_threads_gives_the_same_bits() {
    for order in [2, 4] {
        for periodic in [[false; 2], [true; 2]] {
            let mesh = Mesh::uniform(Lattice::new([411, 67], periodic).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
            let on = |threads: usize| {
                let mut burgers = burgers(0.01);
                if periodic[0] {
                    burgers = burgers.from("sin(2*pi*x)*cos(2*pi*y)", None).unwrap();
                }
                let mut uniform = UniformBurgers::new(burgers, order).unwrap();
                let u = uniform.initial(0.25, &mesh);
                let motion = Motion { t: 0.25, dt: 0.005, old: &mesh, new: &mesh };
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let (u, work) = pool.install(|| uniform.step(motion, &u).unwrap());
                assert!(work.substeps > 10);
                u.values().iter().map(|u| u.to_bits()).collect::<Vec<_>>()
            };
            let one = on(1);
            assert!([2, 4].into_iter().all(|threads| on(threads) == one), "order {order}, periodic {periodic:?}");
        }
    }
}

/// A band computes its neighbours' rows as they do: moving a periodic solution along an axis moves its result.
#[test]
fn bands_do_not_show() {
    let (cells, by) = ([410, 9], 57);
    let mesh = Mesh::uniform(Lattice::new(cells, [true; 2]).unwrap(), [0.0; 2], [41.0, 0.9]).unwrap();
    let values: Vec<f64> = (0..mesh.x().len()).map(|k| ((k * k % 101) as f64 * 0.1).sin()).collect();
    let shifted = |values: &[f64]| [&values[by * cells[1]..], &values[..by * cells[1]]].concat();
    for order in [2, 4] {
        let mut uniform = UniformBurgers::new(burgers(0.1).from("0", None).unwrap(), order).unwrap();
        let mut after = |values: Vec<f64>| {
            let motion = Motion { t: 0.0, dt: 0.1, old: &mesh, new: &mesh };
            uniform.step(motion, &Field::scalar(values)).unwrap().0.values().to_vec()
        };
        assert!(shifted(&after(values.clone())) == after(shifted(&values)), "order {order}");
    }
}

/// Without sides ∫u stays, to round-off, and a constant stays to the last bit.
#[test]
fn periodic_axes_conserve() {
    let mesh = Mesh::uniform(Lattice::new([30, 40], [true; 2]).unwrap(), [0.0; 2], [2.0 * PI; 2]).unwrap();
    for order in [2, 4] {
        let run = |initial: &str| {
            let mut uniform = UniformBurgers::new(burgers(0.1).from(initial, None).unwrap(), order).unwrap();
            let u = uniform.initial(0.0, &mesh);
            let (v, _) = uniform.step(Motion { t: 0.0, dt: 2.0, old: &mesh, new: &mesh }, &u).unwrap();
            let mass = [&u, &v].map(|u| uniform.conserved(&mesh, u));
            (u, v, (mass[1] / mass[0] - 1.0).abs())
        };
        let (u, v, drift) = run("0.75 + 0.5*sin(x + y) + 0.2*cos(y)");
        assert!(u.values()[0] != v.values()[0] && drift < 1e-13, "order {order}: {drift:.1e}");
        let (u, v, _) = run("0.75");
        assert!(u.values().iter().zip(v.values()).all(|(u, v)| (u - v).abs() < 1e-13), "order {order}");
    }
}

/// Side values from a formula, on one axis: the same front, given by hand.
#[test]
fn sides_follow_a_formula() {
    let front = "1/(1 + exp((x - t/2)/0.1))"; // u_t + u u_x = 0.05 u_xx, constant along y
    let mesh = Mesh::uniform(Lattice::new([80, 8], [false, true]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let given = burgers(0.05).from(front, Some(front)).unwrap();
    let mut uniform = UniformBurgers::new(given, 2).unwrap();
    let u = uniform.initial(0.2, &mesh);
    let (u, _) = uniform.step(Motion { t: 0.2, dt: 0.4, old: &mesh, new: &mesh }, &u).unwrap();
    let exact = uniform.initial(0.6, &mesh);
    assert!(u.values().iter().zip(exact.values()).all(|(u, e)| (u - e).abs() < 1e-3));
}

#[test]
fn only_the_uniform_mesh_will_do() {
    let uniform = mesh([8, 8]);
    let mut x = uniform.x().to_vec();
    x[40][1] += 0.01;
    let bent = uniform.moved(x).unwrap();
    let mut physics = UniformBurgers::new(burgers(0.1), 2).unwrap();
    let u = physics.initial(0.0, &uniform);
    for (old, new) in [(&uniform, &bent), (&bent, &uniform), (&bent, &bent)] {
        let failure = physics.step(Motion { t: 0.0, dt: 0.1, old, new }, &u).unwrap_err();
        assert!(matches!(failure, Failure::NotUniform { axis: 1, ref at, .. } if *at.node == [4, 4]), "{failure}");
    }
    let mut bare = UniformBurgers::new(burgers(0.1).from("x", None).unwrap(), 2).unwrap();
    let failure = bare.step(Motion { t: 0.0, dt: 0.1, old: &uniform, new: &uniform }, &u).unwrap_err();
    assert_eq!(failure.name(), "not-periodic");
    let mut holed = u.clone();
    holed.values_mut()[40] = f64::NAN;
    let motion = Motion { t: 0.0, dt: 0.1, old: &uniform, new: &uniform };
    assert_eq!(physics.step(motion, &holed).unwrap_err().name(), "non-finite");
}

/// As a study, in one outer step; and what does not go with it is refused with the remedy.
#[test]
fn studies_choose_it() {
    let study = |assignments: &[&str]| {
        let mut source = Source::new("study", include_str!("../studies/burgers-uniform-conservative.toml"));
        assignments.iter().for_each(|assignment| source.set(assignment).unwrap());
        MovingMesh::from_source(&source)
    };
    let span = ["time.end=0.75", "time.report=[0.75]", "time.step=1.0", "pde.viscosity=0.05", "time.stepper=\"rk4\""];
    let with = |more: &[&str]| study(&[&span[..], more].concat());
    let (MovingRun { record, .. }, failure) = with(&["time.order=4"]).unwrap().compute().unwrap();
    assert!(failure.is_none());
    assert_eq!([record.work.steps, record.work.work.substeps], [1, 162]);
    assert!(record.reports[0].error.unwrap().linf < 2e-5);
    assert!(with(&[]).unwrap().to_toml().contains("order = 2"));

    for (more, key, remedy) in [
        (&["mesh.generator.kind=whole"][..], "`time.stepper` is \"rk4\"", "set mesh.generator to { kind = \"fixed\" }"),
        (&["pde={kind=\"prescribed\", u=\"x\"}"], "`time.stepper` is \"rk4\"", "leave time.stepper out"),
        (&["pde.convection=advective"], "`time.stepper` is \"rk4\"", "pde.convection to \"conservative\""),
        (&["time.order=3"], "`time.order` is 3", "must be 2 or 4"),
        (&["time.order=4", "pde.initial=\"x\"", "pde.boundary=\"x\""], "`time.order` is 4", "set it to 2"),
    ] {
        let error = with(more).unwrap_err().to_string();
        assert!(error.contains(key) && error.contains(remedy), "{error}");
    }
    let error = study(&["time.order=4"]).unwrap_err().to_string();
    assert!(error.contains("only stepper = \"rk4\" has one"), "{error}");
}
