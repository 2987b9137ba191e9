//! The shallow water equations on periodic moving meshes: orders against an exact solution, and what is conserved.

use driftmesh::Failure;
use driftmesh::geometry::{DualCells, Field, Lattice, Mesh};
use driftmesh::physics::{Motion, Physics, ShallowWater, WaterForm};
use std::f64::consts::PI;

const FORMS: [WaterForm; 2] = [WaterForm::Flux, WaterForm::Advective];

fn water(form: WaterForm) -> ShallowWater {
    ShallowWater { form, ..ShallowWater::default() }
}

fn square(n: usize) -> Mesh<2> {
    Mesh::uniform(Lattice::new([n, n], [true; 2]).unwrap(), [0.0; 2], [2.0 * PI; 2]).unwrap()
}

/// A smooth periodic mesh that is neither uniform nor orthogonal, and moves with t.
fn distorted(n: usize, t: f64) -> Mesh<2> {
    let mesh = square(n);
    let x = mesh
        .x()
        .iter()
        .map(|&[x, y]| [x + 0.25 * (y + 2.0 * t).cos() + 0.1 * (2.0 * x).sin(), y + 0.25 * (x - t).sin() - 0.1 * t]);
    mesh.moved(x.collect()).unwrap()
}

/// A mesh with every node up to `reach` cells away from its uniform place.
fn random(n: usize, reach: f64, seed: &mut u64) -> Mesh<2> {
    let mesh = square(n);
    let mut shift = || {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        2.0 * reach * ((*seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 2.0 * PI / n as f64
    };
    mesh.moved(mesh.x().iter().map(|x| [x[0] + shift(), x[1] + shift()]).collect()).unwrap()
}

/// The simple wave that runs along (1, 1)/√2, exact until it breaks at t = 2.36
///
/// c = √h is carried with the speed 3c − 2: c = C(x + y − √2 (3c − 2) t), C(θ) = 1 + sin(θ)/10, U = 2(c − 1).
fn simple_wave(t: f64, mesh: &Mesh<2>) -> Field {
    let values = mesh.x().iter().map(|&[x, y]| {
        let mut c = 1.0;
        for _ in 0..50 {
            let theta = x + y - 2_f64.sqrt() * (3.0 * c - 2.0) * t;
            let slope = 1.0 + 0.1 * theta.cos() * 2_f64.sqrt() * 3.0 * t;
            c -= (c - 1.0 - 0.1 * theta.sin()) / slope;
        }
        let u = 2_f64.sqrt() * (c - 1.0);
        [c * c, u, u]
    });
    Field::nodal(values.collect())
}

fn run(
    water: &mut ShallowWater,
    mut u: Field,
    dt: f64,
    steps: usize,
    mesh: impl Fn(f64) -> Mesh<2>,
) -> (Field, Mesh<2>) {
    let mut old = mesh(0.0);
    for step in 0..steps {
        let new = mesh((step + 1) as f64 * dt);
        u = water.step(Motion { t: step as f64 * dt, dt, old: &old, new: &new }, &u).unwrap().0;
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

/// Mass, both momenta and energy, by dual areas.
fn totals(mesh: &Mesh<2>, u: &Field) -> [f64; 4] {
    let mut sums = [0.0; 4];
    for (area, w) in DualCells::new(mesh).areas().iter().zip(u.values().as_chunks::<3>().0) {
        let [h, u, v] = w;
        let density = [*h, h * u, h * v, 0.5 * h * (u * u + v * v) + 0.5 * h * h];
        sums = std::array::from_fn(|c| sums[c] + area * density[c]);
    }
    sums
}

/// Against the exact simple wave on a mesh that moves with the same steps, space and time refined together.
#[test]
fn both_forms_are_second_order_on_a_moving_mesh() {
    for form in FORMS {
        let [coarse, fine] = [32, 96].map(|n| {
            let mesh = |t| distorted(n, t);
            let (u, end) = run(&mut water(form), simple_wave(0.0, &mesh(0.0)), 1.6 / n as f64, n / 2, mesh);
            largest_difference(&u, &simple_wave(0.8, &end))
        });
        assert_second_order(&format!("{form:?}"), coarse, fine, 3.0);
    }
}

/// Against the exact simple wave on a distorted mesh at rest, with steps so small that only space is seen.
#[test]
fn both_forms_are_second_order_in_space() {
    for form in FORMS {
        let [coarse, fine] = [24, 72].map(|n| {
            let mesh = |_| distorted(n, 0.3);
            let (u, end) = run(&mut water(form), simple_wave(0.0, &mesh(0.0)), 0.004, 50, mesh);
            largest_difference(&u, &simple_wave(0.2, &end))
        });
        assert_second_order(&format!("{form:?}"), coarse, fine, 3.0);
    }
}

/// Against very small steps on the same moving mesh, so that only time is seen.
#[test]
fn both_forms_are_second_order_in_time() {
    for form in FORMS {
        let after = |steps: usize| {
            let mesh = |t| distorted(16, t);
            run(&mut water(form), simple_wave(0.0, &mesh(0.0)), 1.2 / steps as f64, steps, mesh).0
        };
        let reference = after(640);
        let [coarse, fine] = [10, 40].map(|steps| largest_difference(&after(steps), &reference));
        assert_second_order(&format!("{form:?}"), coarse, fine, 4.0);
    }
}

/// Water that moves as a whole does so whatever the mesh does: to round-off in every step between random meshes, and
/// within what Newton leaves over 200 of them.
#[test]
fn a_constant_state_stays_constant_on_random_meshes() {
    for form in FORMS {
        let (mut water, mut seed) = (water(form), 5);
        let constant = Field::nodal(vec![[10.0, 3.0, -2.0]; 12 * 12]);
        let (mut u, mut old) = (constant.clone(), random(12, 0.3, &mut seed));
        let mut one_step = 0.0_f64;
        for _ in 0..200 {
            let new = random(12, 0.3, &mut seed);
            let motion = Motion { t: 0.0, dt: 0.02, old: &old, new: &new };
            one_step = one_step.max(largest_difference(&water.step(motion, &constant).unwrap().0, &constant));
            u = water.step(motion, &u).unwrap().0;
            old = new;
        }
        let all_steps = largest_difference(&u, &constant);
        println!("{form:?}: {one_step:.1e} in a step, {all_steps:.1e} in 200");
        assert!(one_step < 1e-13, "{form:?}: off by {one_step:.1e} of 10 in one step");
        assert!(all_steps < 1e-11, "{form:?}: off by {all_steps:.1e} of 10 in 200 steps");
    }
}

/// Mass and momentum of the flux form hold to round-off over 50 steps of a breaking pile between random meshes.
#[test]
fn mass_and_momentum_are_conserved_to_round_off() {
    let (mut water, mut seed) = (water(WaterForm::Flux), 9);
    let mut old = random(24, 0.2, &mut seed);
    let mut u = water.initial(0.0, &old);
    let start = totals(&old, &u);
    for _ in 0..50 {
        let new = random(24, 0.2, &mut seed);
        u = water.step(Motion { t: 0.0, dt: 0.01, old: &old, new: &new }, &u).unwrap().0;
        old = new;
    }
    let end = totals(&old, &u);
    assert!((water.conserved(&old, &u) / start[0] - 1.0).abs() < 1e-14, "mass {start:?} {end:?}");
    let momentum = start[0] * 12.5_f64.sqrt();
    println!("drift {:.1e} {:.1e} {:.1e}", end[0] / start[0] - 1.0, end[1] / momentum, end[2] / momentum);
    assert!(end[1].abs().max(end[2].abs()) < 1e-14 * momentum, "momentum {end:?}");
}

/// On a mesh at rest the fluxes conserve energy: what drifts is the trapezoid's and falls with Δt² at least.
#[test]
fn energy_drifts_by_the_time_step_alone() {
    let drift = |steps: usize| {
        let mesh = |_| distorted(32, 0.0);
        let mut water = water(WaterForm::Flux);
        let start = water.initial(0.0, &mesh(0.0));
        let (u, end) = run(&mut water, start.clone(), 0.4 / steps as f64, steps, mesh);
        (totals(&end, &u)[3] / totals(&end, &start)[3] - 1.0).abs()
    };
    let (coarse, fine) = (drift(10), drift(40));
    println!("energy {coarse:.1e} {fine:.1e}");
    assert!(coarse < 1e-4 && fine < coarse / 14.0, "energy drifts by {coarse:.1e}, {fine:.1e}");
}

/// The dam break is symmetric under mirrors and exchange of the axes.
#[test]
fn the_dam_break_keeps_its_symmetry() {
    for form in FORMS {
        let (n, mesh) = (30, |_| square(30));
        let mut water = water(form);
        let start = water.initial(0.0, &square(n));
        let (u, _) = run(&mut water, start, 0.02, 20, mesh);
        let at = |i: usize, j: usize| u.values().as_chunks::<3>().0[i % n * n + j % n];
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let ([h, u, v], mirrored, exchanged) = (at(i, j), at(n - i, j), at(j, i));
            let off = [h - mirrored[0], u + mirrored[1], v - mirrored[2], h - exchanged[0], u - exchanged[2]];
            assert!(off.iter().all(|d| d.abs() < 1e-9), "{form:?}: node ({i}, {j}) is off by {off:?}");
        }
    }
}

/// Seen from a frame that moves along, with the mesh, nothing changes but the velocity.
#[test]
fn a_moving_frame_changes_nothing() {
    for form in FORMS {
        let frame = [3.0, -1.5];
        let mut water = water(form);
        let start = water.initial(0.0, &square(24));
        let boosted = start.values().as_chunks::<3>().0.iter().map(|[h, u, v]| [*h, u + frame[0], v + frame[1]]);
        let (still, _) = run(&mut water, start.clone(), 0.02, 10, |_| square(24));
        let (moving, _) = run(&mut water, Field::nodal(boosted.collect()), 0.02, 10, |t| {
            let mesh = square(24);
            mesh.moved(mesh.x().iter().map(|x| [x[0] + frame[0] * t, x[1] + frame[1] * t]).collect()).unwrap()
        });
        let pairs = still.component(0).zip(moving.component(0));
        let off = pairs.chain(still.component(1).zip(moving.component(1).map(|u| u - frame[0])));
        let off = off.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(off < 1e-9, "{form:?}: off by {off:.1e}");
    }
}

/// The same bits on one thread and on two, on a lattice above the size at which threads are used.
#[test]
fn results_do_not_depend_on_threads() {
    for form in FORMS {
        let step = || {
            let [old, new] = [0.0, 0.01].map(|t| distorted(130, t));
            let mut water = water(form);
            let start = water.initial(0.0, &old);
            water.step(Motion { t: 0.0, dt: 0.01, old: &old, new: &new }, &start).unwrap().0
        };
        let [one, two] = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(step));
        assert!(one.values().iter().zip(two.values()).all(|(a, b)| a.to_bits() == b.to_bits()), "{form:?}");
    }
}

/// What does not fit is refused, never indexed.
#[test]
fn what_does_not_fit_is_refused() {
    let (mut water, mesh, other) = (water(WaterForm::Flux), square(8), square(9));
    let u = water.initial(0.0, &mesh);
    let motion = Motion { t: 0.0, dt: 0.01, old: &other, new: &mesh };
    assert!(matches!(water.step(motion, &u), Err(Failure::WrongLength { what: "the old mesh", .. })));
    let motion = Motion { t: 0.0, dt: 0.01, old: &mesh, new: &mesh };
    let short = Field::scalar(vec![1.0; 64]);
    assert!(matches!(water.step(motion, &short), Err(Failure::WrongLength { what: "the solution", .. })));
}
