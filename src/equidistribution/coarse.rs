//! A correction between sweeps that reaches all pieces at once: their number no longer matters.

use super::chain::{End, Step};
use super::cumulative::Cumulative;
use super::schwarz::{Coarse, Iteration, owner};
use crate::error::Failure;
use crate::numerics::linear::tridiagonal;

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
///
/// Σ c_j hat_j is the change of ∫M up to a node. [`Coarse::Galerkin`] divides it by M at the old node, which is right
/// for small changes only: where M varies over the way of a node, nodes pass each other, and halved steps are taken
/// over and over. [`Coarse::Integral`] moves each node to where ∫M has changed by so much, which is right for changes
/// of any size.
pub(super) fn corrected(iteration: &Iteration<'_>, mesh: Vec<f64>, coarse: Coarse) -> Result<Vec<f64>, Failure> {
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
    let mut system = vec![[0.0; 3]; inner];
    let mut right = vec![0.0; inner];
    for i in 1..n {
        for (row, test) in hats(i) {
            right[row - 1] -= test * residual[i];
            for (beside, coupling) in (i - 1..).zip(rows[i]) {
                for (column, trial) in hats(beside) {
                    system[row - 1][column + 1 - row] += test * coupling * trial / m[beside][0];
                }
            }
        }
    }
    let c = tridiagonal(&system, &right);
    // of ∫M up to each node
    let change: Vec<f64> = (0..=n).map(|i| hats(i).map(|(j, hat)| hat * c[j - 1]).sum()).collect();
    let integral = chain.cumulative.filter(|_| coarse == Coarse::Integral);
    let mut share = 1.0;
    while share >= SHORTEST {
        let moved = match integral {
            Some(integral) => along(integral, &mesh, &change, share),
            None => Some((0..=n).map(|i| mesh[i] + share * change[i] / m[i][0]).collect()),
        };
        match moved {
            Some(moved) if moved.windows(2).all(|x| x[1] > x[0]) => return Ok(moved),
            _ => share *= 0.5,
        }
    }
    Ok(mesh)
}

/// The nodes where ∫M has changed by a share of so much; none where that is no order of nodes on the line.
fn along(integral: &Cumulative, mesh: &[f64], change: &[f64], share: f64) -> Option<Vec<f64>> {
    let n = mesh.len() - 1;
    let wanted: Vec<f64> = mesh.iter().zip(change).map(|(x, change)| integral.up_to(*x) + share * change).collect();
    wanted.windows(2).all(|g| g[1] > g[0]).then(|| {
        let mut moved = integral.inverted(wanted.into_iter());
        (moved[0], moved[n]) = (mesh[0], mesh[n]);
        moved
    })
}
