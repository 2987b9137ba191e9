//! Invariants of the fluxes, the geometric conservation law, and Newton's matrix against the residual.

use super::*;
use crate::geometry::{Lattice, padded};
use crate::numerics::larger;
use crate::numerics::linear::BlockMatrix;
use crate::physics::{Burgers, BurgersFlux, Convection, Motion, Physics};

/// A mesh of the unit square with every node up to 0.3 cells away from its uniform place, side nodes on their
/// sides.
fn random(cells: [usize; 2], periodic: [bool; 2], seed: u64) -> Mesh<2> {
    let mesh = Mesh::uniform(Lattice::new(cells, periodic).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let x = (mesh.x().iter().enumerate()).map(|(k, x)| {
        let sides = mesh.lattice().beyond(k);
        std::array::from_fn(|d| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let shift = 0.6 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) / cells[d] as f64;
            x[d] + if sides[d].contains(&true) { 0.0 } else { shift }
        })
    });
    mesh.moved(x.collect()).unwrap()
}

fn burgers(flux: BurgersFlux, initial: &str, boundary: Option<&str>) -> Burgers {
    let mut burgers = Burgers::new(0.01, Convection::Flux).unwrap().from(initial, boundary).unwrap();
    burgers.flux = flux;
    burgers
}

const FLUXES: [BurgersFlux; 3] = [BurgersFlux::Product, BurgersFlux::Energy, BurgersFlux::Central];
const WAVE: &str = "1.5 + sin(2*pi*x)*cos(2*pi*y)";

/// Without viscosity, on a random mesh at rest, Σ A ln u changes only by round-off with the product flux, and Σ A
/// u² with the energy-conserving one; neither does with the other.
#[test]
fn each_flux_keeps_its_own_invariant() {
    let mesh = random([13, 17], [true, true], 5);
    let (cells, dt) = (DualCells::new(&mesh), 1.0);
    let x = padded(mesh.lattice(), mesh.x(), [[1.0, 0.0], [0.0, 1.0]]);
    let swept = cells.swept(&cells);
    let rates = |flux: BurgersFlux| -> [f64; 2] {
        let mut law = burgers(flux, WAVE, None);
        law.viscosity = 0.0;
        let u = law.initial(0.0, &mesh);
        let u = padded(mesh.lattice(), u.values().as_chunks::<1>().0, [[0.0]; 2]);
        let half = Half { dt, t: 0.0, mesh: &mesh, cells: &cells, x: &x, swept: &swept, stretched: &[] };
        let faces = half.view(&law, &u).unwrap().faces;
        let sum = |f: fn(f64) -> f64| cells.patch().places().map(|k| half.leaving(&faces, k)[0] * f(u[k][0])).sum();
        [sum(|u| 1.0 / u), sum(|u| u)]
    };
    let [[log, not_square], [not_log, square]] = [BurgersFlux::Product, BurgersFlux::Energy].map(rates);
    assert!(log.abs() < 1e-14 && square.abs() < 1e-14, "{log:e}, {square:e}");
    assert!(not_square.abs() > 1e-6 && not_log.abs() > 1e-6, "{not_square:e}, {not_log:e}");
}

/// On meshes that jump about at random, a constant stays constant, and ∫u changes only by round-off.
#[test]
fn random_motion_keeps_constants_and_sums() {
    for (flux, periodic) in
        FLUXES.into_iter().flat_map(|flux| [[true, true], [false, true], [false, false]].map(|p| (flux, p)))
    {
        let all = periodic == [true, true];
        for initial in ["0.7", WAVE] {
            let mut physics = burgers(flux, initial, (!all).then_some(initial));
            let mut mesh = random([9, 12], periodic, 1);
            let mut u = physics.initial(0.0, &mesh);
            let sum = physics.conserved(&mesh, &u);
            for step in 2..8 {
                let new = random([9, 12], periodic, step);
                let motion = Motion { t: 0.0, dt: 1e-3, old: &mesh, new: &new };
                u = physics.step(motion, &u).unwrap().0;
                mesh = new;
            }
            if initial == "0.7" {
                let off = u.values().iter().fold(0.0_f64, |m, u| m.max((u - 0.7).abs()));
                assert!(off < 1e-14, "{flux:?} on {periodic:?}: off by {off:e}");
            }
            let drift = (physics.conserved(&mesh, &u) - sum) / sum;
            assert!(!all || drift.abs() < 1e-14, "{flux:?}: drift {drift:e}");
        }
    }
}

/// The order in ε of what a Newton step leaves out
///
/// ```text
/// max |R(u + ε v) − R(u) − ε J v| = O(ε^order)
/// ```
///
/// R being the residual at the end of a step, J the matrix of [`FiniteVolumes::step`] and v random: 2 where J is
/// the derivative, and Newton's method converges quadratically; 1 where an entry of it is wrong.
pub(in crate::physics) fn order_of_newton<const B: usize, L: Law<B>>(
    law: &L,
    motion: Motion<'_>,
    u: &[[f64; B]],
) -> f64 {
    let Motion { t, dt, old, new } = motion;
    let lattice = new.lattice();
    let [old_cells, cells] = [old, new].map(DualCells::new);
    let (patch, swept) = (*cells.patch(), old_cells.swept(&cells));
    let [from, x] = [old, new].map(|mesh| padded(lattice, mesh.x(), mesh.jump()));
    let weights = law.weights(t, old, u);
    let shared = weights.iter().any(|weight| *weight != 0.0);
    let stretched = if shared { stretched([&old_cells, &cells], [&from, &x]) } else { Vec::new() };
    let excess = shared.then(|| Excess::of(new, weights));
    let half = Half { dt, t: t + dt, mesh: new, cells: &cells, x: &x, swept: &swept, stretched: &stretched };
    let nothing = vec![[0.0; B]; patch.len()];
    let residual = |u: &[[f64; B]]| -> Vec<[f64; B]> {
        let mut residual = nothing.clone();
        half.residual(law, excess.as_ref(), &half.view(law, u).unwrap(), [&nothing, &[]], u, &mut residual);
        residual
    };
    let mut u = padded(lattice, u, [[0.0; B]; 2]);
    Half::repeat_sides(&patch, &mut u);
    let mut state = 7_u64;
    let mut direction = u.clone();
    for value in direction.as_flattened_mut() {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        *value = (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
    }
    Half::repeat_sides(&patch, &mut direction);

    let mut matrix = BlockMatrix::<2, 9, B>::zero_blocks(patch);
    let places: Vec<usize> = patch.places().collect();
    let sides: Vec<Side<B>> = lattice.sides().map(|i| Side { i, k: places[i], given: [None; B] }).collect();
    // of −residual
    half.matrix(law, excess.as_ref(), &half.view(law, &u).unwrap(), &sides, &mut matrix);
    let mut product = vec![[0.0; B]; patch.padded_len()];
    matrix.multiply(&direction, &mut product);

    let start = residual(&u);
    let left = |epsilon: f64| {
        let ahead = u.iter().zip(&direction).map(|(u, v)| std::array::from_fn(|c| u[c] + epsilon * v[c]));
        let ahead = residual(&ahead.collect::<Vec<[f64; B]>>());
        let all = patch.places().enumerate().flat_map(|(i, k)| {
            let (start, ahead, product) = (start[i], ahead[i], product[k]);
            (0..B).map(move |c| ahead[c] - start[c] + epsilon * product[c])
        });
        all.fold(0.0, larger)
    };
    (left(4e-3) / left(1e-3)).log(4.0)
}

/// With every flux the matrix of Newton's method is the derivative of the residual, on a moving mesh with bounded
/// and periodic sides: what a step leaves out falls with the square of its length.
#[test]
fn newton_converges_quadratically() {
    for (flux, periodic) in FLUXES.into_iter().flat_map(|flux| [[false, true], [true, false]].map(|p| (flux, p))) {
        let [old, new] = [3, 4].map(|seed| random([8, 9], periodic, seed));
        let physics = burgers(flux, WAVE, Some(WAVE));
        let u = physics.initial(0.0, &old);
        let motion = Motion { t: 0.0, dt: 2e-2, old: &old, new: &new };
        let order = order_of_newton(&physics, motion, u.values().as_chunks::<1>().0);
        assert!((order - 2.0).abs() < 0.1, "{flux:?} on {periodic:?}: order {order:.3}");
    }
}
