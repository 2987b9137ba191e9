use super::*;
use crate::numerics::linear::Pcg;
use proptest::prelude::*;

/// (1 + a) on a lattice of given couplings along both axes, scaled by a field of any contrast.
fn sample(size: [usize; 2], wraps: [bool; 2], a: [f64; 2], cell: impl Fn([usize; 2]) -> f64) -> LatticeMatrix<2, 5> {
    let patch = Patch { origin: [1, 1], size, wraps };
    let mut matrix = LatticeMatrix::<2, 5>::zero(patch);
    let at = |i: usize, j: usize| cell([i % size[0], j % size[1]]);
    for (k, row) in matrix.rows.iter_mut().enumerate() {
        let (i, j) = (k / size[1], k % size[1]);
        let below = |i: usize, n: usize, wraps: bool| {
            if i > 0 {
                i - 1
            } else if wraps {
                n - 1
            } else {
                0
            }
        };
        let (here, down, left) = (at(i, j), at(below(i, size[0], wraps[0]), j), at(i, below(j, size[1], wraps[1])));
        let (up, right) = (at(i + 1, j), at(i, j + 1));
        let mean = |x: f64, y: f64| 0.5 * (x + y);
        *row = [
            0.0,
            -a[0] * mean(here, down),
            -a[0] * mean(here, if i + 1 < size[0] || wraps[0] { up } else { here }),
            -a[1] * mean(here, left),
            -a[1] * mean(here, if j + 1 < size[1] || wraps[1] { right } else { here }),
        ];
        row[0] = here - row[1..].iter().sum::<f64>();
    }
    matrix
}

fn iterations(a: &LatticeMatrix<2, 5>, exactness: f64) -> usize {
    let n = a.rows.len();
    let b: Vec<[f64; 2]> = (0..n).map(|k| [(0.37 * k as f64).sin(), (0.11 * k as f64).cos()]).collect();
    let mut x = vec![[0.0; 2]; a.patch.padded_len()];
    let weights: Vec<f64> = a.rows.iter().map(|row| row[0]).collect();
    let largest = a.rows.iter().fold(f64::INFINITY, |m, row| m.min(row[0]));
    Pcg::default().solve(a, &weights, &b, &mut x, [exactness / largest; 2]).unwrap()
}

proptest! {
    /// The cycle is symmetric, and its spectrum lies in (0, 1]: v·Mv > 0, and Mv never overshoots, in any network.
    #[test]
    fn the_cycle_is_an_inner_product(
        n in 1_usize..20,
        m in 1_usize..20,
        wx: bool,
        wy: bool,
        log_a in -3.0..6.0_f64,
        skew in -3.0..3.0_f64,
        seed: u64,
    ) {
        let cell = |[i, j]: [usize; 2]| {
            let mixed = (seed ^ (i * 1009 + j) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            10_f64.powf(6.0 * (mixed >> 11) as f64 / (1_u64 << 53) as f64)
        };
        let a = sample([n, m], [wx, wy], [10_f64.powf(log_a), 10_f64.powf(log_a + skew)], cell);
        let mut multigrid = Multigrid::<2, 2>::default();
        prop_assert!(multigrid.build(&a));
        let len = a.patch.padded_len();
        let mut r = vec![[0.0; 2]; len];
        for k in a.patch.places() {
            r[k] = [(0.7 * (k as f64 + seed as f64 % 97.0)).sin(), (1.3 * k as f64).cos()];
        }
        let mut z = vec![[0.0; 2]; len];
        // nothing is left of an earlier cycle
        multigrid.cycle(&vec![[1.0, -2.0]; len], &mut z);
        multigrid.cycle(&r, &mut z);
        a.patch.wrap(&mut z);
        let product = |u: usize, v: usize| -> f64 { a.patch.places().map(|k| r[k][u] * z[k][v]).sum() };
        // a node that is its own neighbour draws nothing from itself, but for rounding
        let largest = a.rows.iter().fold(0.0_f64, |m, row| m.max(row[0]));
        let lost = if (wx && n == 1) || (wy && m == 1) { f64::EPSILON * largest } else { 0.0 };
        prop_assert!((product(0, 1) - product(1, 0)).abs() <= (1e-9 + lost) * (product(0, 0) * product(1, 1)).sqrt());
        let mut az = vec![[0.0; 2]; len];
        a.multiply(&z, &mut az);
        for c in 0..2 {
            let energy: f64 = a.patch.places().map(|k| z[k][c] * az[k][c]).sum();
            let norm = product(c, c);
            prop_assert!(norm > 0.0 && energy <= (1.0 + 1e-9 + lost) * norm, "{energy} {norm}");
        }
    }
}

/// At most a third more iterations on 64 times as many nodes, bounded and periodic, of odd and even numbers, with
/// any ratio of couplings, where the coefficient is smooth.
#[test]
fn iterations_do_not_grow_with_the_lattice() {
    for (wraps, ratio) in
        [([false; 2], 1.0), ([true; 2], 1.0), ([true, false], 1.0), ([false; 2], 100.0), ([true; 2], 1e-3)]
    {
        let counts = [31, 64, 127, 250].map(|n| {
            let wave = |[i, j]: [usize; 2]| {
                (4.0 * ((0.2 * i as f64 * 31.0 / n as f64).sin() * (0.3 * j as f64 * 31.0 / n as f64).cos())).exp()
            };
            let a = 1e2 * (n * n) as f64;
            iterations(&sample([n, n + 1], wraps, [a, ratio * a], wave), 1e-8)
        });
        assert!(3 * counts[3] <= 4 * counts[0] && counts[3] <= 20, "{wraps:?} {ratio} {counts:?}");
    }
}
