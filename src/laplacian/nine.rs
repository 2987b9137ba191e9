//! Weights on the eight neighbours of a node, for several nodes side by side, one in each lane.

// loops over places of several arrays of one length, which the compiler makes vectors of
#![allow(clippy::needless_range_loop)]

use super::{Laplacian, Polynomials, Scaling};
use crate::numerics::lanes::{LANES, Lanes, Qr};

/// The neighbours of a node relative to it, in units of its local length.
pub(super) struct Neighbourhood {
    /// The eight neighbours in the order of `LatticeMatrix::POINTS`.
    pub e: [[Lanes; 2]; 8],
    /// The local unit of length.
    pub h: Lanes,
}

/// Weights of the neighbours in local units, and the condition number.
pub(super) type Weights = ([Lanes; 8], Lanes);

/// The nine-point rows (the node, then its eight neighbours) of up to [`LANES`] nodes of one lattice row
///
/// ```text
/// rows[l][0] = −Σ a_j,   rows[l][1 + j] = a_j / h²
/// ```
pub(super) struct Batch<'a> {
    pub laplacian: &'a Laplacian,
    /// Spacing of the lattice along the first axis.
    pub spacing: f64,
    /// Padded positions: the lattice rows before, of and after the nodes, each two longer than `rows`.
    pub x: [&'a [[f64; 2]]; 3],
    pub rows: &'a mut [[f64; 9]],
    pub conditions: &'a mut [f64],
}

impl pulp::WithSimd for Batch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { laplacian, spacing, x, rows, conditions } = self;
        match laplacian {
            Laplacian::Optimised => each(x, rows, conditions, optimised),
            Laplacian::Harmonic => each(x, rows, conditions, harmonic),
            Laplacian::Mapped => each(x, rows, conditions, mapped),
            Laplacian::Published { polynomials, scaling } => {
                let printed = *polynomials == Polynomials::Printed;
                let unit = match scaling {
                    Scaling::None => Some(1.0),
                    Scaling::Global => Some(spacing),
                    Scaling::Local => None,
                };
                each(x, rows, conditions, |near| published(near, printed, unit));
            }
            Laplacian::Compact25 => {}
        }
    }
}

#[inline(always)]
fn each(
    x: [&[[f64; 2]]; 3],
    rows: &mut [[f64; 9]],
    conditions: &mut [f64],
    weights: impl Fn(&Neighbourhood) -> Weights,
) {
    let count = rows.len();
    for first in (0..count).step_by(LANES) {
        let mut e = [[Lanes::ZERO; 2]; 8];
        // the last group may be shorter, and repeats its last node
        for l in 0..LANES {
            let j = (first + l).min(count - 1) + 1;
            let centre = x[1][j];
            let near = [x[0][j], x[2][j], x[1][j - 1], x[1][j + 1], x[0][j - 1], x[0][j + 1], x[2][j - 1], x[2][j + 1]];
            for (e, near) in e.iter_mut().zip(near) {
                e[0].0[l] = near[0] - centre[0];
                e[1].0[l] = near[1] - centre[1];
            }
        }
        let mut h = Lanes::ZERO;
        for e in &e {
            h = h.max(e[0].abs()).max(e[1].abs());
        }
        let unit = Lanes::ONE / h;
        for e in &mut e {
            *e = [e[0] * unit, e[1] * unit];
        }
        let (mut a, condition) = weights(&Neighbourhood { e, h });
        let unit = unit * unit;
        let mut sum = Lanes::ZERO;
        let mut terms = Lanes::ZERO;
        for (a, e) in a.iter_mut().zip(&e) {
            terms += a.abs() * e[0].abs().max(e[1].abs());
            *a = *a * unit;
            sum += *a;
        }
        // the condition number also counts the size of the terms that cancel in Σ a_j d_j
        let condition = condition.max(terms);
        for l in 0..LANES.min(count - first) {
            let row = &mut rows[first + l];
            row[0] = -sum.0[l];
            for (row, a) in row[1..].iter_mut().zip(&a) {
                *row = a.0[l];
            }
            conditions[first + l] = condition.0[l];
        }
    }
}

/// The Laplacians of x, y, xy, x² − y² and x² at the node: 2 for x², 0 for the others.
#[inline(always)]
fn laplacians() -> [Lanes; 5] {
    let mut c = [Lanes::ZERO; 5];
    c[4] = Lanes::splat(2.0);
    c
}

/// x, y, xy, x² − y² and x² at a point.
#[inline(always)]
fn quadratics([x, y]: [Lanes; 2]) -> [Lanes; 5] {
    let (xx, yy) = (x * x, y * y);
    [x, y, x * y, xx - yy, xx]
}

/// Exact for all quadratics; among those, the smallest Σ(|d_j|³ a_j)².
#[inline(always)]
fn optimised(near: &Neighbourhood) -> Weights {
    let mut columns = [[Lanes::ZERO; 8]; 5];
    let mut shares = [Lanes::ZERO; 8];
    for j in 0..8 {
        let [x, y] = near.e[j];
        let r2 = x * x + y * y;
        let share = Lanes::ONE / (r2 * r2.sqrt());
        for (column, p) in columns.iter_mut().zip(quadratics(near.e[j])) {
            column[j] = p * share;
        }
        shares[j] = share;
    }
    let qr = Qr::new(columns);
    let mut a = qr.shortest(&laplacians());
    for j in 0..8 {
        a[j] = a[j] * shares[j];
    }
    // in flat cells the weights differ by orders of magnitude, so the residual is corrected once
    let correction = qr.shortest(&missing(near, &a));
    for j in 0..8 {
        a[j] += correction[j] * shares[j];
    }
    (a, qr.condition())
}

/// The errors of the weights for the five quadratics.
#[inline(always)]
fn missing(near: &Neighbourhood, a: &[Lanes; 8]) -> [Lanes; 5] {
    let mut c = laplacians();
    for j in 0..8 {
        for (c, p) in c.iter_mut().zip(quadratics(near.e[j])) {
            *c -= a[j] * p;
        }
    }
    c
}

/// Exact for all quadratics. The other three degrees of freedom make the values for harmonic polynomials of degrees 3
/// to 5 as small as possible, in the unit of the coordinates.
#[inline(always)]
fn harmonic(near: &Neighbourhood) -> Weights {
    let (mut columns, mut rest) = ([[Lanes::ZERO; 8]; 5], [[Lanes::ZERO; 8]; 6]);
    for j in 0..8 {
        for (column, p) in columns.iter_mut().zip(quadratics(near.e[j])) {
            column[j] = p;
        }
        // h³, h⁴ and h⁵, divided by h³
        let scales = [Lanes::ONE, Lanes::ONE, near.h, near.h, near.h * near.h, near.h * near.h];
        for ((row, p), scale) in rest.iter_mut().zip(harmonics(near.e[j], false)).zip(scales) {
            row[j] = p * scale;
        }
    }
    let qr = Qr::new(columns);
    let mut a = qr.forward(&laplacians());
    // in the basis Q the first five coordinates are determined by the quadratics, and the last three are free
    let (mut free, mut fixed) = ([[Lanes::ZERO; 6]; 3], [Lanes::ZERO; 6]);
    for (k, row) in rest.iter_mut().enumerate() {
        qr.multiply_transposed(row);
        for i in 0..5 {
            fixed[k] -= row[i] * a[i];
        }
        for i in 0..3 {
            free[i][k] = row[5 + i];
        }
    }
    let freedoms = Qr::new(free);
    let z = freedoms.least_squares(fixed);
    a[5..].copy_from_slice(&z);
    qr.multiply(&mut a);
    let correction = qr.shortest(&missing(near, &a));
    for j in 0..8 {
        a[j] += correction[j];
    }
    (a, qr.condition().max(freedoms.condition()))
}

/// The harmonic polynomials of degrees 3 to 5; with `printed`, three of them as the source prints them.
#[inline(always)]
fn harmonics([x, y]: [Lanes; 2], printed: bool) -> [Lanes; 6] {
    let (xx, yy, xy) = (x * x, y * y, x * y);
    let [cubic_x, cubic_y, quartic] = match printed {
        true => [xx * x - xx * y * 3.0, yy * y - x * yy * 3.0, xx * xx + xx * yy * 6.0 - yy * yy],
        false => [xx * x - x * yy * 3.0, yy * y - xx * y * 3.0, xx * xx - xx * yy * 6.0 + yy * yy],
    };
    let quintic = |x: Lanes, xx: Lanes, yy: Lanes| x * (xx * xx - xx * yy * 10.0 + yy * yy * 5.0);
    [cubic_x, cubic_y, xy * (xx - yy), quartic, quintic(y, yy, xx), quintic(x, xx, yy)]
}

/// The published least squares on eleven weighted polynomials, in coordinates divided by `unit`, or by the local
/// length.
#[inline(always)]
fn published(near: &Neighbourhood, printed: bool, unit: Option<f64>) -> Weights {
    // coordinates divided by `unit` are e s
    let s = unit.map_or(Lanes::ONE, |unit| near.h * (1.0 / unit));
    let mut columns = [[Lanes::ZERO; 11]; 8];
    for j in 0..8 {
        let p = [near.e[j][0] * s, near.e[j][1] * s];
        let [x, y, xy, difference, xx] = quadratics(p);
        let weighted = [x * 100.0, y * 100.0, xy * 10.0, xx * 10.0, difference * 10.0];
        columns[j][..5].copy_from_slice(&weighted);
        columns[j][5..].copy_from_slice(&harmonics(p, printed));
    }
    let mut b = [Lanes::ZERO; 11];
    b[3] = Lanes::splat(20.0);
    let qr = Qr::new(columns);
    let mut a = qr.least_squares(b);
    for a in &mut a {
        *a = *a * s * s;
    }
    (a, qr.condition())
}

// indices of the neighbours in `Neighbourhood::e`
const WEST: usize = 0;
const EAST: usize = 1;
const SOUTH: usize = 2;
const NORTH: usize = 3;
const SW: usize = 4;
const NW: usize = 5;
const SE: usize = 6;
const NE: usize = 7;

/// The conservative curvilinear form, with metrics by central differences on faces.
#[inline(always)]
fn mapped(near: &Neighbourhood) -> Weights {
    let e = &near.e;
    let dot = |a: [Lanes; 2], b: [Lanes; 2]| a[0] * b[0] + a[1] * b[1];
    let cross = |a: [Lanes; 2], b: [Lanes; 2]| a[0] * b[1] - a[1] * b[0];
    let mut a = [Lanes::ZERO; 8];
    // a face between the node and a neighbour; `along` runs along it, over two pairs of nodes
    let mut face = |out: usize, [up, up_out, down, down_out]: [Option<usize>; 4]| {
        let at = |k: Option<usize>| k.map_or([Lanes::ZERO; 2], |k| e[k]);
        let across = e[out];
        let [p, q, r, s] = [up, up_out, down, down_out].map(at);
        let along = [0, 1].map(|c| (p[c] + q[c] - r[c] - s[c]) * 0.25);
        let area = cross(across, along).abs();
        a[out] += dot(along, along) / area;
        let mixed = dot(across, along) / area * 0.25;
        for (k, sign) in [(up, -1.0), (up_out, -1.0), (down, 1.0), (down_out, 1.0)] {
            if let Some(k) = k {
                a[k] += mixed * sign;
            }
        }
    };
    face(EAST, [Some(NORTH), Some(NE), Some(SOUTH), Some(SE)]);
    face(WEST, [Some(NORTH), Some(NW), Some(SOUTH), Some(SW)]);
    face(NORTH, [Some(EAST), Some(NE), Some(WEST), Some(NW)]);
    face(SOUTH, [Some(EAST), Some(SE), Some(WEST), Some(SW)]);
    let [x_xi, x_eta] = [(EAST, WEST), (NORTH, SOUTH)].map(|(u, d)| [0, 1].map(|c| (e[u][c] - e[d][c]) * 0.5));
    let area = cross(x_xi, x_eta);
    for a in &mut a {
        *a = *a / area;
    }
    (a, (dot(x_xi, x_xi) * dot(x_eta, x_eta)).sqrt() / area)
}
