//! A coarse correction between sweeps. It reaches all subdomains at once, so that the number of iterations does not
//! grow with theirs.

use super::chain::{Equations, Step};
use super::conditions::End;
use super::cumulative::Cumulative;
use super::schwarz::{Coarse, Iteration, owner};
use crate::error::Failure;
use crate::numerics::linear::tridiagonal;

/// The coarse step is halved while it disorders nodes; below this share of it the correction is left out.
const SHORTEST: f64 = 1e-3;

/// The glued mesh after one Newton step in the space spanned by the hat functions over M
///
/// ```text
/// (Hᵀ J V) c = −Hᵀ r,   V = hat_j(ξ)/M(x),   H = hat_j(ξ),   r_i = F_{i+½} − F_{i−½}
/// ```
///
/// with a coarse node on either side of every cut, where the glued mesh has a kink. J is tridiagonal and every node
/// lies under at most two hats, so that the coarse system is tridiagonal too. The step is halved until nodes keep their
/// order.
///
/// Σ c_j hat_j is the change of ∫M up to a node. [`Coarse::Galerkin`] divides it by M at the old node, which is its
/// linearisation: where M varies much between the old node and the new one, nodes pass each other and the step is
/// halved over and over. [`Coarse::Integral`] moves each node to where ∫M has changed by that amount, which holds for
/// changes of any size.
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
    let ends = [mesh[0], mesh[n]].map(End::Value);
    let (residual, rows) = Equations { chain, ends, step }.linearised(&mesh)?;
    let m = chain.density.at_each(chain.t, &mesh)?;
    // for each node the interval between coarse nodes that it lies in, and its place there from 0 to 1
    let mut places = Vec::with_capacity(n + 1);
    let mut k = 0;
    for i in 0..=n {
        if i > nodes[k + 1] {
            k += 1;
        }
        places.push((k, (i - nodes[k]) as f64 / (nodes[k + 1] - nodes[k]) as f64));
    }
    // the hats that a node lies under, with their values; those at both ends of the line are no unknowns
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
    // the change of ∫M up to each node
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

/// The nodes at which ∫M up to the old nodes has changed by a share of `change`; none where these are out of order.
fn along(integral: &Cumulative, mesh: &[f64], change: &[f64], share: f64) -> Option<Vec<f64>> {
    let n = mesh.len() - 1;
    let wanted: Vec<f64> = mesh.iter().zip(change).map(|(x, change)| integral.up_to(*x) + share * change).collect();
    wanted.windows(2).all(|g| g[1] > g[0]).then(|| {
        let mut moved = integral.inverted(wanted.into_iter());
        (moved[0], moved[n]) = (mesh[0], mesh[n]);
        moved
    })
}
