//! A correction between sweeps that reaches all pieces at once: their number no longer matters.

use super::chain::{End, Step, thomas};
use super::schwarz::{Iteration, owner};
use crate::error::Failure;

/// A correction shorter than this share of the whole one is left out.
const SHORTEST: f64 = 1e-3;

/// The glued mesh after one step of Newton's method in the space of hats over M
///
/// ```text
/// (Hᵀ J V) c = −Hᵀ r,   V = hat_j(ξ)/M(x),   H = hat_j(ξ),   r_i = F_{i+½} − F_{i−½}
/// ```
///
/// with a coarse node on each side of every cut, where the glued mesh jumps. J is tridiagonal and a node lies under two
/// hats, so that the coarse system is tridiagonal too. The step is halved until nodes keep their order.
pub(super) fn corrected(iteration: &Iteration<'_>, mesh: Vec<f64>) -> Result<Vec<f64>, Failure> {
    let (chain, n) = (&iteration.chain, iteration.cells);
    let mut nodes = vec![0];
    for pair in iteration.ranges.windows(2) {
        let cut = owner(pair[0][1], pair[1][0]);
        nodes.extend([cut, cut + 1].into_iter().filter(|&c| c > 0 && c < n));
    }
    nodes.push(n);
    nodes.dedup();
    let inner = nodes.len() - 2;
    if inner == 0 {
        return Ok(mesh);
    }
    let step = iteration.old.map(|(old, ratio)| Step { old, ratio });
    let (residual, rows) = chain.linearised(&mesh, [End::Value(mesh[0]), End::Value(mesh[n])], step)?;
    let m = chain.density.at_each(chain.t, &mesh)?;
    // the interval of coarse nodes that each node lies in, and how far along
    let mut places = Vec::with_capacity(n + 1);
    let mut k = 0;
    for i in 0..=n {
        if i > nodes[k + 1] {
            k += 1;
        }
        places.push((k, (i - nodes[k]) as f64 / (nodes[k + 1] - nodes[k]) as f64));
    }
    // hats of a node by number, the ones at both ends of the line left out
    let hats = |i: usize| {
        let (k, along) = places[i];
        [(k, 1.0 - along), (k + 1, along)].into_iter().filter(move |&(j, hat)| hat > 0.0 && j > 0 && j <= inner)
    };
    let mut coarse = vec![[0.0; 3]; inner];
    let mut right = vec![0.0; inner];
    for i in 1..n {
        for (row, test) in hats(i) {
            right[row - 1] -= test * residual[i];
            for (beside, coupling) in (i - 1..).zip(rows[i]) {
                for (column, trial) in hats(beside) {
                    coarse[row - 1][column + 1 - row] += test * coupling * trial / m[beside][0];
                }
            }
        }
    }
    let c = thomas(&coarse, &right);
    let change: Vec<f64> = (0..=n).map(|i| hats(i).map(|(j, hat)| hat * c[j - 1]).sum::<f64>() / m[i][0]).collect();
    let mut share = 1.0;
    while share >= SHORTEST {
        let moved: Vec<f64> = mesh.iter().zip(&change).map(|(x, change)| x + share * change).collect();
        if moved.windows(2).all(|x| x[1] > x[0]) {
            return Ok(moved);
        }
        share *= 0.5;
    }
    Ok(mesh)
}
