//! All parallel loops of the library.
//!
//! Work is divided by the size of the arrays alone, never by the number of threads, and each piece is computed
//! independently. Sums are added piece by piece in order. Results therefore have the same bits for any number of
//! threads.

use rayon::prelude::*;

/// Arrays shorter than this stay on one thread: distributing them costs more than it saves.
const WORTHWHILE: usize = 1 << 14;
/// Smallest number of elements in a piece.
const PIECE: usize = 1 << 12;

/// Calls `f(number, row)` for every row of an array cut into rows of `len`.
pub(crate) fn for_each_row<T: Send>(array: &mut [T], len: usize, f: impl Fn(usize, &mut [T]) + Sync) {
    for_each_row_pair(array, len, &mut vec![(); array.len()], len, |q, row, _| f(q, row));
}

/// Calls `f(number, row of a, row of b)` for every row of two arrays cut into as many rows.
pub(crate) fn for_each_row_pair<A: Send, B: Send>(
    a: &mut [A],
    len_a: usize,
    b: &mut [B],
    len_b: usize,
    f: impl Fn(usize, &mut [A], &mut [B]) + Sync,
) {
    if a.len() < WORTHWHILE {
        for (q, (a, b)) in a.chunks_exact_mut(len_a).zip(b.chunks_exact_mut(len_b)).enumerate() {
            f(q, a, b);
        }
    } else {
        (a.par_chunks_exact_mut(len_a).zip(b.par_chunks_exact_mut(len_b)).enumerate())
            .with_min_len(PIECE.div_ceil(len_a))
            .for_each(|(q, (a, b))| f(q, a, b));
    }
}

/// Calls `f(first place, piece)` for pieces of an array of any length.
pub(crate) fn for_each_piece<T: Send>(array: &mut [T], f: impl Fn(usize, &mut [T]) + Sync) {
    if array.len() < WORTHWHILE {
        array.chunks_mut(PIECE).enumerate().for_each(|(p, piece)| f(p * PIECE, piece));
    } else {
        array.par_chunks_mut(PIECE).enumerate().for_each(|(p, piece)| f(p * PIECE, piece));
    }
}

/// Runs two independent pieces of work in parallel.
pub(crate) fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    rayon::join(a, b)
}

/// `f` of every item, in order; in parallel if the items have enough elements in all.
pub(crate) fn map_large<T: Sync, R: Send>(elements: usize, items: &[T], f: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    if elements < WORTHWHILE { items.iter().map(f).collect() } else { map(items, f) }
}

/// `f` of every item, in order; for items that are each worth a thread.
pub(crate) fn map<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    items.par_iter().map(f).collect()
}

/// `f` of every item, in order, for items that `f` changes.
pub(crate) fn map_mut<T: Send, R: Send>(items: &mut [T], f: impl Fn(&mut T) -> R + Sync + Send) -> Vec<R> {
    items.par_iter_mut().map(f).collect()
}

/// Sum over all pieces of `len` elements of `f(range)`, in order.
pub(crate) fn sum<const K: usize>(len: usize, f: impl Fn(std::ops::Range<usize>) -> [f64; K] + Sync) -> [f64; K] {
    let add = |mut total: [f64; K], part: [f64; K]| {
        (0..K).for_each(|c| total[c] += part[c]);
        total
    };
    let piece = |p: usize| f(p * PIECE..((p + 1) * PIECE).min(len));
    let pieces = 0..len.div_ceil(PIECE);
    if len < WORTHWHILE {
        pieces.map(piece).fold([0.0; K], add)
    } else {
        pieces.into_par_iter().map(piece).collect::<Vec<_>>().into_iter().fold([0.0; K], add)
    }
}

/// Calls `f(first column, rows)` for groups of neighbouring columns of an array cut into rows of `len`: for
/// recurrences that run down the columns.
pub(crate) fn for_each_column_group<T: Send>(array: &mut [T], len: usize, f: impl Fn(usize, &mut [&mut [T]]) + Sync) {
    let size = array.len();
    let rows = array.chunks_exact_mut(len);
    if size < WORTHWHILE {
        return f(0, &mut rows.collect::<Vec<_>>());
    }
    let width = (PIECE / (size / len)).clamp(16, len);
    let mut groups: Vec<Vec<&mut [T]>> = (0..len.div_ceil(width)).map(|_| Vec::new()).collect();
    for row in rows {
        groups.iter_mut().zip(row.chunks_mut(width)).for_each(|(group, part)| group.push(part));
    }
    groups.into_par_iter().enumerate().for_each(|(g, mut group)| f(g * width, &mut group));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same bits on one thread and on four, on both sides of the threshold.
    #[test]
    fn sums_do_not_depend_on_threads() {
        for len in [100, WORTHWHILE - 1, WORTHWHILE, 100_001] {
            let term = |k: usize| (k as f64 * 0.7).sin() * 10_f64.powi((k % 7) as i32);
            let total = || sum::<1>(len, |range| [range.map(term).sum()]);
            let [one, four] =
                [1, 4].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(total));
            assert_eq!(one[0].to_bits(), four[0].to_bits());
        }
    }

    #[test]
    fn column_groups_cover_every_element_once() {
        for (rows, len) in [(5, 7), (200, 131), (3, 40_000)] {
            let mut array = vec![0_usize; rows * len];
            for_each_column_group(&mut array, len, |first, group| {
                for (i, row) in group.iter_mut().enumerate() {
                    for (j, value) in row.iter_mut().enumerate() {
                        *value += 1 + i * len + first + j;
                    }
                }
            });
            assert!(array.iter().enumerate().all(|(k, &value)| value == k + 1));
        }
    }
}
