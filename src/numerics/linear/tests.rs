use super::*;
use proptest::prelude::*;

/// A matrix like the library's own: I plus diffusion of strength `a` and skewed couplings, corners if S has them.
fn sample<const S: usize>(size: [usize; 2], wraps: [bool; 2], a: f64, seed: u64) -> LatticeMatrix<2, S> {
    let mut matrix = LatticeMatrix::zero(Patch { origin: [1, 1], size, wraps });
    let mut state = seed;
    for row in &mut matrix.rows {
        for entry in &mut row[1..] {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            *entry = -a * (0.2 + (state >> 40) as f64 / (1_u64 << 24) as f64);
        }
        for corner in &mut row[5.min(S)..] {
            *corner *= 0.1;
        }
        row[0] = 1.0 - row[1..].iter().sum::<f64>();
    }
    matrix
}

fn wave(n: usize) -> Vec<[f64; 2]> {
    (0..n).map(|k| [(0.37 * k as f64).sin(), 1.0 + (0.11 * k as f64).cos()]).collect()
}

fn compare<const S: usize>(matrix: &LatticeMatrix<2, S>) {
    let b = wave(matrix.rows.len());
    let mut fast = wave(matrix.patch.padded_len());
    matrix.patch.wrap(&mut fast);
    let mut exact = fast.clone();
    Bicgstab::default().solve(matrix, &b, &mut fast, [1e-12; 2]).expect("the iteration converges");
    SparseLu::default().solve(matrix, &b, &mut exact, [1e-12; 2]).expect("the factorisation exists");
    for (f, e) in fast.as_flattened().iter().zip(exact.as_flattened()) {
        assert!((f - e).abs() < 1e-10, "{f} against {e}");
    }
}

proptest! {
    /// The fast solver and the direct one agree to 1e-10 on stars and nine points, bounded and wrapped, any strength.
    #[test]
    fn both_solvers_agree(n in 2_usize..24, m in 2_usize..24, wx: bool, wy: bool, log_a in -2.0..2.0_f64, seed: u64) {
        compare(&sample::<5>([n, m], [wx, wy], 10_f64.powf(log_a), seed));
        compare(&sample::<9>([n, m], [wx, wy], 10_f64.powf(log_a), seed));
    }
}

/// A block system as a step of waves makes it: diagonal blocks near [[1, 0, 0], [u, h, 0], [v, 0, h]], neighbours at
/// most `a` in each entry.
fn block_sample<const S: usize>(size: [usize; 2], wraps: [bool; 2], a: f64, seed: u64) -> BlockMatrix<2, S, 3> {
    let mut matrix = BlockMatrix::<2, S, 3>::zero_blocks(Patch { origin: [1, 1], size, wraps });
    let mut state = seed;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f64 / (1_u64 << 23) as f64 - 1.0
    };
    for row in &mut matrix.rows {
        row.iter_mut().flatten().flatten().for_each(|entry| *entry = a * random());
        let (h, u, v) = (2.0 + random(), random(), random());
        let own = [[1.0, 0.0, 0.0], [u, h, 0.0], [v, 0.0, h]];
        (0..9).for_each(|k| row[0][k / 3][k % 3] += own[k / 3][k % 3]);
    }
    matrix
}

fn compare_blocks<const S: usize>(matrix: &BlockMatrix<2, S, 3>) {
    let values = |n: usize| -> Vec<[f64; 3]> {
        wave(n).into_iter().enumerate().map(|(k, [a, b])| [a, b, (0.2 * k as f64).cos()]).collect()
    };
    let b = values(matrix.rows.len());
    let mut fast = values(matrix.patch.padded_len());
    matrix.patch.wrap(&mut fast);
    let mut exact = fast.clone();
    let mut other = fast.clone();
    BlockBicgstab::default().solve(matrix, &b, &mut fast, [1e-12, 2e-12, 3e-12]).expect("the iteration converges");
    if let Some(matrix) = nine_points(matrix) {
        TransportBicgstab::default().solve(&matrix, &b, &mut other, [1e-12; 3]).expect("the iteration converges");
        fast.extend(other);
        exact.extend_from_within(..);
    }
    let n = matrix.patch.padded_len();
    SparseLu::default().solve(matrix, &b, &mut exact[..n], [1e-12; 3]).expect("the factorisation exists");
    if exact.len() > n {
        exact.copy_within(..n, n);
    }
    for (f, e) in fast.as_flattened().iter().zip(exact.as_flattened()) {
        assert!((f - e).abs() < 1e-10, "{f} against {e}");
    }
}

/// The same matrix, where it has nine points.
fn nine_points<const S: usize>(matrix: &BlockMatrix<2, S, 3>) -> Option<BlockMatrix<2, 9, 3>> {
    let rows: Option<Vec<_>> = matrix.rows.iter().map(|row| row.as_slice().try_into().ok()).collect();
    Some(BlockMatrix { patch: matrix.patch, rows: rows? })
}

proptest! {
    /// Conjugate gradients and the direct solver agree to 1e-9 on symmetric matrices whose couplings differ by up to
    /// 10⁴, each unknown to its own tolerance.
    #[test]
    fn conjugate_gradients_agree(
        n in 2_usize..24,
        m in 2_usize..24,
        wx: bool,
        wy: bool,
        log_a in -2.0..2.0_f64,
        seed: u64,
    ) {
        let mut matrix = LatticeMatrix::<2, 5>::zero(Patch { origin: [1, 1], size: [n, m], wraps: [wx, wy] });
        let strength = |i: usize, j: usize, d: u64| {
            let mixed = (seed ^ (i * 1009 + j) as u64 ^ (d << 32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            -10_f64.powf(log_a + 4.0 * (mixed >> 11) as f64 / (1_u64 << 53) as f64)
        };
        let weights: Vec<f64> = (0..n * m).map(|k| 1.0 + (k % 7) as f64).collect();
        for (k, row) in matrix.rows.iter_mut().enumerate() {
            let (i, j) = (k / m, k % m);
            // the coupling above a node is the one below its neighbour, also around the axis; on the last line without
            // one
            let below = |i: usize, wraps: bool, n: usize| if i > 0 { i } else if wraps { n } else { 0 };
            (row[1], row[2]) = (strength(below(i, wx, n), j, 0), strength(i + 1, j, 0));
            (row[3], row[4]) = (strength(i, below(j, wy, m), 1), strength(i, j + 1, 1));
            row[0] = weights[k] - row[1..].iter().sum::<f64>();
        }
        let b = wave(n * m);
        let mut fast = wave(matrix.patch.padded_len());
        matrix.patch.wrap(&mut fast);
        let mut exact = fast.clone();
        Pcg::default().solve(&matrix, &weights, &b, &mut fast, [1e-11; 2]).expect("it converges");
        SparseLu::default().solve(&matrix, &b, &mut exact, [1e-8; 2]).expect("the factorisation exists");
        for (f, e) in fast.as_flattened().iter().zip(exact.as_flattened()) {
            assert!((f - e).abs() < 1e-9, "{f} against {e}");
        }
    }

    /// The iteration and the direct solver agree to 1e-10 on blocks too.
    #[test]
    fn both_block_solvers_agree(n in 2_usize..20, m in 2_usize..20, wx: bool, wy: bool, a in 0.0..0.1_f64, seed: u64) {
        compare_blocks(&block_sample::<5>([n, m], [wx, wy], a, seed));
        compare_blocks(&block_sample::<9>([n, m], [wx, wy], 0.5 * a, seed));
    }
}

/// A singular block on the diagonal stops the iteration, not the direct solver; a singular system stops both.
#[test]
fn blocks_fall_back_on_the_direct_solver() {
    let mut matrix = block_sample::<5>([5, 4], [true, false], 0.1, 7);
    matrix.rows[3][0] = [[0.0; 3]; 3];
    let mut x = vec![[0.0; 3]; 42];
    assert!(BlockBicgstab::default().solve(&matrix, &[[1.0; 3]; 20], &mut x, [1e-12; 3]).is_err());
    let work = RobustBlock::default().solve(&matrix, &[[1.0; 3]; 20], &mut x, [1e-11; 3]).unwrap();
    assert_eq!([work.linear_solves, work.direct_unstarted, work.direct_stalled], [1, 1, 0], "{work:?}");
    matrix.rows[3] = [[[0.0; 3]; 3]; 5];
    let error = RobustBlock::default().solve(&matrix, &[[1.0; 3]; 20], &mut x, [1e-11; 3]).unwrap_err();
    assert!(matches!(error, Failure::LinearStalled { .. }), "{error}");
}

/// In one dimension the alternating-direction factorisation is the inverse itself: one iteration, any strength.
#[test]
fn one_dimension_takes_one_iteration() {
    for a in [0.1, 10.0, 1e4] {
        let mut matrix = LatticeMatrix::<1, 3>::zero(Patch { origin: [1], size: [40], wraps: [false] });
        matrix.rows.fill([1.0 + 2.0 * a, -0.9 * a, -1.1 * a]);
        let mut x = vec![[0.0]; 42];
        x[41] = [1.0];
        let work = Bicgstab::default().solve(&matrix, &[[0.5]; 40], &mut x, [1e-11]).unwrap();
        assert_eq!(work.linear_iterations, 1, "a = {a}");
    }
}

/// A singular matrix is reported with its residual, never returned as a solution.
#[test]
fn a_singular_system_is_refused() {
    let matrix = LatticeMatrix::<2, 5>::zero(Patch { origin: [1, 1], size: [4, 4], wraps: [false; 2] });
    let mut x = vec![[0.0]; 36];
    let error = Robust::default().solve(&matrix, &[[1.0]; 16], &mut x, [1e-10]).unwrap_err();
    assert!(matches!(error, Failure::LinearStalled { unknowns: 16, .. }), "{error}");
}

/// Where the fast solver cannot start (no positive pivots), the direct one steps in, and the work says so: two
/// right-hand sides that could not begin.
#[test]
fn the_fallback_solves_what_the_iteration_cannot() {
    let mut matrix = LatticeMatrix::<2, 5>::zero(Patch { origin: [1, 1], size: [5, 4], wraps: [false; 2] });
    matrix.rows.fill([-3.0, 1.0, 0.5, 0.25, 0.125]);
    let mut x = vec![[0.0; 2]; 42];
    assert!(Bicgstab::default().solve(&matrix, &[[1.0, 2.0]; 20], &mut x, [1e-12; 2]).is_err());
    let work = Robust::default().solve(&matrix, &[[1.0, 2.0]; 20], &mut x, [1e-12; 2]).unwrap();
    let expected = Work { linear_solves: 2, direct_unstarted: 2, ..Work::default() };
    assert_eq!((work, work.direct_solves()), (expected, 2));
}

/// A solver that gives up after seven iterations.
struct GivesUp;

impl LinearSolver<2, 5, 1> for GivesUp {
    fn solve(
        &mut self,
        _: &LatticeMatrix<2, 5>,
        _: &[[f64; 1]],
        x: &mut [[f64; 1]],
        _: [f64; 1],
    ) -> Result<Work, Failure> {
        x.fill([f64::NAN]);
        Err(Failure::LinearStalled { unknowns: 20, residual: 1.0, tolerance: 0.1, iterations: 7 })
    }
}

/// An iteration that stalls is told apart from one that cannot begin, its iterations are counted, and what it left of
/// the guess is forgotten.
#[test]
fn a_stalled_iteration_is_counted_with_its_reason() {
    let matrix = sample::<5>([5, 4], [false; 2], 1.0, 3);
    let mut x = vec![[0.0]; 42];
    let work = Fallback(GivesUp, SparseLu::default()).solve(&matrix, &[[1.0]; 20], &mut x, [1e-12]).unwrap();
    let expected = Work { linear_solves: 1, linear_iterations: 7, direct_stalled: 1, ..Work::default() };
    assert_eq!(work, expected);
    assert!(x.iter().all(|[x]| x.is_finite()));
}

/// A step of diffusion in cells that are up to 30 times as long as wide, obliquely, with flow and with given values on
/// one side: with coarse levels, which there are from 200² nodes on, the number of products does not grow with the
/// lattice, though a step couples ever more cells.
#[test]
fn products_do_not_grow_with_the_lattice() {
    let products = |n: usize, wraps: [bool; 2]| {
        let patch = Patch { origin: [0; 2], size: [n, n + 3], wraps };
        let mut matrix = BlockMatrix::<2, 9, 1>::zero_blocks(patch);
        for (i, row) in matrix.rows.iter_mut().enumerate() {
            let [x, y] = [(i / (n + 3)) as f64 / n as f64, (i % (n + 3)) as f64 / n as f64];
            let steep = 1.0 + 30.0 * (-((x + 0.3 * y - 0.6) / 0.1).powi(2)).exp();
            // Δt D/h², along both axes and across them, and the Courant number
            let [along, across, cross, flow] =
                [steep * steep, 1.0, 0.4 * steep, 0.02 * steep].map(|v| v * (n as f64 / 32.0).powi(2));
            let flow = flow / (n as f64 / 32.0);
            let entries = [0.0, along + flow, along - flow, across, across, cross, -cross, -cross, cross];
            for (block, entry) in row.iter_mut().zip(entries) {
                block[0][0] = -entry;
            }
            row[0][0][0] = 1.0 + entries.iter().sum::<f64>();
            if !wraps[0] && i < n + 3 {
                *row = [[[0.0]]; 9];
                row[0][0][0] = 1.0;
            }
        }
        let b: Vec<[f64; 1]> = (0..patch.len()).map(|i| [(0.37 * i as f64).sin()]).collect();
        let mut x = vec![[0.0]; patch.padded_len()];
        let work = TransportBicgstab::default().solve(&matrix, &b, &mut x, [1e-6]).expect("the iteration converges");
        work.linear_iterations
    };
    for wraps in [[false, false], [true, false], [true, true]] {
        let counts = [208, 304, 448].map(|n| products(n, wraps));
        println!("{wraps:?}: {counts:?}");
        assert!(counts.iter().all(|count| *count <= 16), "{wraps:?}: {counts:?}");
    }
}
