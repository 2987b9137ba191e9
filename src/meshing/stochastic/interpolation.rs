use super::super::{Cut, Decomposition};
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Estimates a sample of the nodes of each cut, and interpolates the others
///
/// It interpolates, by the cubic through the four nearest samples, the correction to the estimator's own guess (the old
/// mesh, or its sweeps). The correction is small and smooth where the mesh itself is neither. Crossings of cuts always
/// belong to the sample, and nodes on bounded sides are known anyway.
///
/// # Source
/// Section 3.6 of Bihlo, Haynes and Walsh (2015).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Interpolation {
    /// Number of nodes of each cut that are estimated, not counting crossings.
    pub sample: usize,
    /// How the estimated nodes are placed along a cut.
    #[serde(default)]
    pub placement: Placement,
}

/// Placement of the estimated nodes along a cut.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Placement {
    /// With the same ∫ρ dξ along the cut between neighbours.
    #[default]
    Density,
    /// Evenly spaced.
    Uniform,
}

impl Interpolation {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an empty sample.
    pub fn check(&self) -> Result<()> {
        if self.sample == 0 {
            return Err(Error::invalid("sample", 0, "an interface needs at least 1 node to be estimated"));
        }
        Ok(())
    }

    /// The nodes to estimate, in ascending order.
    pub(super) fn sample(&self, decomposition: &Decomposition, rho: &[f64]) -> Vec<usize> {
        let lines = decomposition.lines();
        let mut points: Vec<usize> = crossings(&lines);
        for cut in &lines {
            let inner: Vec<usize> = cut.nodes.iter().copied().filter(|&k| !decomposition.on_side(k)).collect();
            points.extend(self.place(&inner, rho));
        }
        points.retain(|&k| !decomposition.on_side(k));
        points.sort_unstable();
        points.dedup();
        points
    }

    /// The estimated nodes of one line of nodes.
    fn place(&self, inner: &[usize], rho: &[f64]) -> Vec<usize> {
        let (n, wanted) = (inner.len(), self.sample);
        if wanted >= n {
            return inner.to_vec();
        }
        let weight = |k: usize| if self.placement == Placement::Density { rho[k] } else { 1.0 };
        // ∫ρ up to the middle of the interval that each node stands for
        let total: f64 = inner.iter().map(|&k| weight(k)).sum();
        let mut next = 0;
        let mut sum = 0.0;
        let mut chosen = Vec::with_capacity(wanted);
        for (place, &k) in inner.iter().enumerate() {
            sum += weight(k);
            let target = (chosen.len() as f64 + 0.5) / wanted as f64 * total;
            let (left, needed) = (n - place, wanted - chosen.len());
            if needed > 0 && place >= next && (sum > target || left == needed) {
                chosen.push(k);
                next = place + 1;
            }
        }
        chosen
    }
}

/// Nodes that lie on two cuts.
fn crossings(lines: &[Cut]) -> Vec<usize> {
    let (across, along): (Vec<&Cut>, Vec<&Cut>) = lines.iter().partition(|cut| cut.along == 1);
    let on = |lines: &[&Cut]| lines.iter().flat_map(|cut| cut.nodes.iter().copied()).collect::<Vec<usize>>();
    let (first, second) = (on(&across), on(&along));
    let second: std::collections::HashSet<usize> = second.into_iter().collect();
    first.into_iter().filter(|k| second.contains(k)).collect()
}

/// Interpolates on all cuts of `x`, which holds estimates at `points` and `guess` elsewhere.
pub(super) fn fill(
    decomposition: &Decomposition,
    mesh: &Mesh<2>,
    points: &[usize],
    guess: &[[f64; 2]],
    x: &mut [[f64; 2]],
) {
    let lattice = mesh.lattice();
    for cut in decomposition.lines() {
        let n = cut.nodes.len();
        let known = |k: usize| points.binary_search(&k).is_ok() || decomposition.on_side(k);
        let mut samples: Vec<(f64, [f64; 2])> = (cut.nodes.iter().enumerate())
            .filter(|&(_, &k)| known(k))
            .map(|(i, &k)| (i as f64, [0, 1].map(|c| x[k][c] - guess[k][c])))
            .collect();
        if lattice.periodic()[cut.along] {
            let period = n as f64;
            let images = |turn: f64| samples.iter().map(move |&(i, e)| (i + turn * period, e)).collect::<Vec<_>>();
            samples = [images(-1.0), images(0.0), images(1.0)].concat();
        }
        for (i, &k) in cut.nodes.iter().enumerate().filter(|&(_, &k)| !known(k)) {
            let correction = through_nearest(&samples, i as f64);
            x[k] = [0, 1].map(|c| guess[k][c] + correction[c]);
        }
    }
}

/// The value at a place of the polynomial through the nearest samples: up to four, two on either side if there are any.
fn through_nearest(samples: &[(f64, [f64; 2])], at: f64) -> [f64; 2] {
    let above = samples.partition_point(|(i, _)| *i < at);
    let first = above.saturating_sub(2).min(samples.len().saturating_sub(4));
    let near = &samples[first..samples.len().min(first + 4)];
    let mut sum = [0.0; 2];
    for (m, (i, value)) in near.iter().enumerate() {
        let others = near.iter().enumerate().filter(|&(l, _)| l != m);
        let weight: f64 = others.map(|(_, (j, _))| (at - j) / (i - j)).product();
        (0..2).for_each(|c| sum[c] += weight * value[c]);
    }
    sum
}
