//! Jumps, which no mesh resolves.

use super::need::between;
use crate::geometry::{Lattice, Mesh, strides};
use crate::numerics::larger;

/// Shares of the range of u by which it changes over an edge of the mesh: from the first on the edge may hold a jump,
/// from the second on it does.
const SHARES: [f64; 2] = [0.25, 0.5];

/// How far u jumps, from 0 to 1: 1 where an edge of the mesh that is shorter than the first of some `lengths`, in equal
/// cells, holds much of the range of u. One that is longer than the second holds no jump as yet: a shorter one may
/// resolve what is in it.
pub(super) fn jump<const D: usize>(mesh: &Mesh<D>, u: &[f64], range: f64, lengths: [f64; 2]) -> f64 {
    if largest_step(mesh.lattice(), u) <= SHARES[0] * range {
        return 0.0;
    }
    let logs = lengths.map(f64::ln);
    edges(mesh, u).fold(0.0, |most, (length, change)| {
        larger(most, between(SHARES, change / range) * (1.0 - between(logs, length.ln())))
    })
}

/// The length of each edge of a mesh, in equal cells, and the size of the change of u over it.
pub(crate) fn edges<'a, const D: usize>(mesh: &'a Mesh<D>, u: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
    let (mesh, lattice) = (mesh.parameters(), mesh.lattice());
    let (x, u, cells) = (mesh.closed(), lattice.closed(u), lattice.cells());
    let size: [f64; D] = std::array::from_fn(|d| mesh.extent()[d] / cells[d] as f64);
    let nodes = cells.map(|n| n + 1);
    let strides = strides(nodes);
    let ends = (0..D).flat_map(move |d| {
        let below = (0..nodes.iter().product()).filter(move |k| k / strides[d] % nodes[d] < cells[d]);
        below.map(move |k| (k, k + strides[d]))
    });
    ends.map(move |(a, b)| {
        let way = (0..D).map(|c| ((x[b][c] - x[a][c]) / size[c]).powi(2)).sum::<f64>().sqrt();
        (way, (u[b] - u[a]).abs())
    })
}

/// The largest difference between neighbouring nodes.
pub(crate) fn largest_step<const D: usize>(lattice: &Lattice<D>, u: &[f64]) -> f64 {
    let (nodes, wraps, steps) = (lattice.nodes(), lattice.periodic(), lattice.strides());
    (0..D).fold(0.0, |most, axis| {
        let (n, s) = (nodes[axis], steps[axis]);
        u.chunks_exact(n * s).fold(most, |most, block| {
            let inner = block.iter().zip(&block[s..]).fold(most, |most, (a, b)| larger(most, b - a));
            let over = block[..s].iter().zip(&block[(n - 1) * s..]).map(|(a, b)| b - a);
            if wraps[axis] { over.fold(inner, larger) } else { inner }
        })
    })
}
