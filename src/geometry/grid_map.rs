//! The map whose image is a structured mesh of one's own.

use super::points::lagrange;
use super::{Chart, Lattice, Map, Mesh, check_unfolded};
use crate::error::{Error, Result};
use std::sync::Arc;

/// The smooth map through the nodes of a structured mesh
///
/// ```text
/// map(i/n, j/m) = x_ij,   between them cubic along each axis, with slopes ∂x/∂i, ∂x/∂j, ∂²x/∂i∂j at the nodes
/// ```
///
/// Slopes are those of the polynomial through the five nearest nodes of a line, so that curves of sides are continued
/// with order 4 and have no kinks.
///
/// # Example
/// ```
/// use driftmesh::geometry::{Chart, GridMap};
/// // 9 × 5 nodes of a quarter ring
/// let node = |i: usize, j: usize| {
///     let (angle, radius) = (i as f64 / 8.0 * std::f64::consts::FRAC_PI_2, 2.0 - j as f64 / 4.0);
///     [radius * angle.cos(), radius * angle.sin()]
/// };
/// let x = (0..9).flat_map(|i| (0..5).map(move |j| node(i, j))).collect();
/// let chart = Chart::new(GridMap::new([9, 5], x, [false; 2])?, [false; 2])?;
/// let [x, y] = chart.at([0.31, 0.0]);
/// assert!((x.hypot(y) - 2.0).abs() < 1e-4);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug)]
pub struct GridMap {
    cells: [usize; 2],
    /// x, ∂x/∂i, ∂x/∂j and ∂²x/∂i∂j at each node, last axis fastest.
    nodes: Vec<[[f64; 2]; 4]>,
}

/// Number of nodes of a line whose polynomial gives a slope.
const WINDOW: usize = 5;

impl GridMap {
    /// Through the positions of `nodes` along each axis, last axis fastest. On a closed axis the last nodes are the
    /// first ones again.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there are fewer than three nodes along an axis, where their number is not that of the
    /// positions, and for the first one that is not finite.
    pub fn new(nodes: [usize; 2], x: Vec<[f64; 2]>, closed: [bool; 2]) -> Result<Self> {
        let shape = format!("({}, {})", nodes[0], nodes[1]);
        if nodes.iter().any(|n| *n < 3) {
            return Err(Error::invalid("mesh", format!("shape {shape}"), "needs at least 3 nodes along each axis"));
        }
        if nodes[0].checked_mul(nodes[1]) != Some(x.len()) {
            let rule = format!("must have one position a node, and there are {}", x.len());
            return Err(Error::invalid("mesh", format!("shape {shape}"), rule));
        }
        if let Some(k) = x.iter().position(|x| !x.iter().all(|x| x.is_finite())) {
            let place = format!("({:?}, {:?}) at node ({}, {})", x[k][0], x[k][1], k / nodes[1], k % nodes[1]);
            return Err(Error::invalid("mesh", place, "every position must be a finite number; mend it there"));
        }
        let slopes = |values: &[[f64; 2]], axis: usize| -> Vec<[f64; 2]> {
            let stride = [nodes[1], 1][axis];
            let at = |k: usize| {
                let i = k / stride % nodes[axis];
                let first = k - i * stride;
                stencil(i, nodes[axis], closed[axis]).into_iter().fold([0.0; 2], |sum, (node, weight)| {
                    std::array::from_fn(|c| sum[c] + weight * values[first + node * stride][c])
                })
            };
            (0..values.len()).map(at).collect()
        };
        let [along, across] = [slopes(&x, 0), slopes(&x, 1)];
        let mixed = slopes(&along, 1);
        let nodes_of = |k: usize| [x[k], along[k], across[k], mixed[k]];
        Ok(Self { cells: nodes.map(|n| n - 1), nodes: (0..x.len()).map(nodes_of).collect() })
    }

    /// The cell of a place, and where in it the place lies.
    fn cell(&self, s: [f64; 2]) -> ([usize; 2], [f64; 2]) {
        let at: [f64; 2] = [0, 1].map(|d| s[d] * self.cells[d] as f64);
        let cell = [0, 1].map(|d| (at[d].max(0.0) as usize).min(self.cells[d] - 1));
        (cell, [0, 1].map(|d| at[d] - cell[d] as f64))
    }

    /// Σ over the corners of a cell, with these weights of values and slopes along each axis.
    fn sum(&self, cell: [usize; 2], weights: [[[f64; 2]; 2]; 2]) -> [f64; 2] {
        let mut x = [0.0; 2];
        for corner in 0..4 {
            let [i, j] = [corner & 1, corner >> 1];
            let data = self.nodes[(cell[0] + i) * (self.cells[1] + 1) + cell[1] + j];
            let ([v, dv], [w, dw]) = (weights[0][i], weights[1][j]);
            for c in 0..2 {
                x[c] += (v * w) * data[0][c] + (dv * w) * data[1][c] + (v * dw) * data[2][c] + (dv * dw) * data[3][c];
            }
        }
        x
    }
}

impl Chart<2> {
    /// The domain of a structured mesh, from the positions of `nodes` along each axis, last axis fastest. On a closed
    /// axis, which may run either way, the last nodes are the first ones again.
    ///
    /// # Errors
    /// [`Error::Invalid`] as [`GridMap::new`] and [`Chart::new`], and where a cell of the mesh is folded.
    pub fn through(nodes: [usize; 2], x: Vec<[f64; 2]>, closed: [bool; 2]) -> Result<Arc<Self>> {
        let chart = Self::oriented(GridMap::new(nodes, x, closed)?, closed, false).map_err(|error| match error {
            Error::Invalid { key, value, .. } if key == "map" => {
                let rule = "its first axis must turn into its second against the clock; reverse one of them, as by \
                            x[::-1] and y[::-1]";
                Error::invalid("mesh", value, rule)
            }
            other => other,
        })?;
        let chart = Arc::new(chart);
        let mesh = Mesh::charted(Lattice::new(nodes.map(|n| n - 1), closed)?, chart.clone())?;
        match check_unfolded(&mesh) {
            Ok(()) => Ok(chart),
            Err(failure) => {
                let shape = format!("of shape ({}, {})", nodes[0], nodes[1]);
                Err(Error::invalid("mesh", shape, format!("{failure}; mend it there")))
            }
        }
    }
}

impl Map for GridMap {
    fn at(&self, s: [f64; 2]) -> [f64; 2] {
        let (cell, t) = self.cell(s);
        self.sum(cell, t.map(hermite))
    }

    fn slopes(&self, s: [f64; 2]) -> [[f64; 2]; 2] {
        let (cell, t) = self.cell(s);
        let (values, slopes) = (t.map(hermite), t.map(hermite_slopes));
        let [along, across] = [self.sum(cell, [slopes[0], values[1]]), self.sum(cell, [values[0], slopes[1]])];
        [along.map(|x| x * self.cells[0] as f64), across.map(|x| x * self.cells[1] as f64)]
    }

    fn pieces(&self) -> [usize; 2] {
        self.cells
    }
}

/// The nodes whose values, with these weights, give the slope of a line at its node i.
fn stencil(i: usize, count: usize, closed: bool) -> Vec<(usize, f64)> {
    let distinct = if closed { count - 1 } else { count };
    // an odd number around a node of a closed line
    let window = if closed && distinct < WINDOW { 3 } else { WINDOW.min(distinct) };
    let first = match closed {
        true => i + distinct - window / 2,
        false => i.saturating_sub(window / 2).min(count - window),
    };
    let at = if closed { (window / 2) as f64 } else { (i - first) as f64 };
    (0..window).map(|k| ((first + k) % distinct, lagrange(window, k, at).1)).collect()
}

/// For the lower and the upper end of the unit interval, Hermite's cubics at a place: of the value, and of the slope.
fn hermite(t: f64) -> [[f64; 2]; 2] {
    let u = 1.0 - t;
    [[u * u * (1.0 + 2.0 * t), t * u * u], [t * t * (1.0 + 2.0 * u), -u * t * t]]
}

fn hermite_slopes(t: f64) -> [[f64; 2]; 2] {
    let u = 1.0 - t;
    [[-6.0 * t * u, u * (1.0 - 3.0 * t)], [6.0 * t * u, t * (3.0 * t - 2.0)]]
}
