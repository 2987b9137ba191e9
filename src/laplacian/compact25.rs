//! The compact scheme Σ a_j u(x_j) = Σ b_j Δu(x_j) on 5 × 5 points, exact for polynomials up to degree 5.

// loops over places of several arrays of one length, which the compiler makes vectors of
#![allow(clippy::needless_range_loop)]

use super::{Stencils, degenerate, stencils::Window};
use crate::error::{Error, Result};
use crate::geometry::{Mesh, Patch};
use crate::numerics::lanes::{LANES, Lanes, Qr};
use crate::parallel;

/// Exponents of the monomials up to degree 3, which are the Laplacians of polynomials up to degree 5.
const SOURCES: [[i32; 2]; 10] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2], [3, 0], [2, 1], [1, 2], [0, 3]];

/// c in the weighting (c + r²)^(−P/2) of points by their distance r, in units of the distance to the nearest
/// neighbours: it keeps the node itself from an infinite weight.
const SOFT: f64 = 0.3;

/// Stencils of a mesh that is not folded.
pub(super) fn stencils(mesh: &Mesh<2>, patch: Patch<2>) -> Result<Stencils> {
    let lattice = mesh.lattice();
    if lattice.periodic() != [false; 2] || lattice.cells().iter().any(|&n| n < 4) {
        let rule = "needs bounded axes of at least 4 cells; take another kind, or raise grid.cells";
        return Err(Error::invalid("laplacian.kind", "\"compact25\"", rule));
    }
    let groups: Vec<usize> = (0..patch.len()).step_by(LANES).collect();
    let solved = parallel::map(&groups, |&first| {
        let mut group = Group::new(mesh, &patch, first);
        pulp::Arch::new().dispatch(&mut group);
        group
    });
    let (mut rows, mut conditions) = (Vec::with_capacity(patch.len()), Vec::with_capacity(patch.len()));
    for (first, group) in groups.iter().zip(solved) {
        for l in 0..LANES.min(patch.len() - first) {
            let h2 = group.h.0[l] * group.h.0[l];
            let (a, b) = (group.a.map(|a| a.0[l] / h2), group.b.map(|b| b.0[l]));
            if !a.iter().chain(&b).all(|w| w.is_finite()) {
                return Err(degenerate(mesh, &patch, first + l, f64::INFINITY).into());
            }
            rows.push(Window { first: group.first[l], a, b });
            conditions.push(group.condition.0[l]);
        }
    }
    Ok(Stencils::twenty_five(mesh, patch, rows, &conditions))
}

/// Nodes that are computed side by side, with the points around them.
struct Group {
    first: [[usize; 2]; LANES],
    e: [[Lanes; 2]; 25],
    h: Lanes,
    a: [Lanes; 25],
    b: [Lanes; 25],
    condition: Lanes,
}

impl Group {
    fn new(mesh: &Mesh<2>, patch: &Patch<2>, first: usize) -> Self {
        let (lattice, x) = (mesh.lattice(), mesh.x());
        let nodes = lattice.nodes();
        let zero = Lanes::ZERO;
        let (mut e, mut h, mut corner) = ([[zero; 2]; 25], Lanes::ONE, [[0; 2]; LANES]);
        for l in 0..LANES {
            let node = super::node(patch, (first + l).min(patch.len() - 1));
            let origin: [usize; 2] = std::array::from_fn(|d| (node[d].max(2) - 2).min(nodes[d] - 5));
            let centre = x[lattice.index(node)];
            let away = |i: usize, j: usize| {
                let there = x[lattice.index([i, j])];
                [there[0] - centre[0], there[1] - centre[1]]
            };
            let mut unit = 0.0_f64;
            for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
                let d = away(node[0] + i - 1, node[1] + j - 1);
                unit = unit.max(d[0].abs()).max(d[1].abs());
            }
            for p in 0..25 {
                let d = away(origin[0] + p / 5, origin[1] + p % 5);
                e[p][0].0[l] = d[0] / unit;
                e[p][1].0[l] = d[1] / unit;
            }
            h.0[l] = unit;
            corner[l] = origin;
        }
        Self { first: corner, e, h, a: [zero; 25], b: [zero; 25], condition: Lanes::ONE }
    }
}

impl pulp::WithSimd for &mut Group {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let mut share = [Lanes::ZERO; 25];
        let (mut harmonic, mut cubic) = ([[Lanes::ZERO; 25]; 12], [[Lanes::ZERO; 25]; 10]);
        for p in 0..25 {
            let [x, y] = self.e[p];
            let r2 = x * x + y * y;
            share[p] = Lanes::ONE / ((r2 + Lanes::splat(SOFT)) * (r2 + Lanes::splat(SOFT)));
            // the real and imaginary parts of (x + iy)ⁿ, then r²
            let (mut re, mut im) = (Lanes::ONE, Lanes::ZERO);
            harmonic[0][p] = share[p];
            for n in 0..5 {
                (re, im) = (re * x - im * y, re * y + im * x);
                harmonic[1 + 2 * n][p] = re * share[p];
                harmonic[2 + 2 * n][p] = im * share[p];
            }
            harmonic[11][p] = r2 * share[p];
            for (column, [m, n]) in cubic.iter_mut().zip(SOURCES) {
                column[p] = power(x, m) * power(y, n) * share[p];
            }
        }
        let mut c = [Lanes::ZERO; 12];
        c[11] = Lanes::splat(4.0);
        let qr = Qr::new(harmonic);
        let mut a = qr.shortest(&c);
        for p in 0..25 {
            a[p] = a[p] * share[p];
        }
        // the value of the stencil for a polynomial whose Laplacian is each monomial
        let mut d = [Lanes::ZERO; 10];
        for (d, exponents) in d.iter_mut().zip(SOURCES) {
            for p in 0..25 {
                *d += a[p] * inverse(self.e[p], exponents);
            }
        }
        let sources = Qr::new(cubic);
        let mut b = sources.shortest(&d);
        for p in 0..25 {
            b[p] = b[p] * share[p];
        }
        self.a = a;
        self.b = b;
        self.condition = qr.condition().max(sources.condition());
    }
}

#[inline(always)]
fn power(x: Lanes, n: i32) -> Lanes {
    let mut product = Lanes::ONE;
    for _ in 0..n {
        product = product * x;
    }
    product
}

/// A polynomial p with Δp = x^m y^n: Σ (−1)^k m!/(m + 2k + 2)! x^(m + 2k + 2) ∂_y^2k y^n.
#[inline(always)]
fn inverse([x, y]: [Lanes; 2], [m, n]: [i32; 2]) -> Lanes {
    let mut sum = Lanes::ZERO;
    let (mut factor, mut up, mut down) = (1.0, m, n);
    while down >= 0 {
        factor /= f64::from((up + 1) * (up + 2));
        up += 2;
        sum += power(x, up) * power(y, down) * factor;
        factor *= -f64::from(down * (down - 1));
        down -= 2;
    }
    sum
}
