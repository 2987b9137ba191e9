use super::sides::{jump, size};
use super::{Contraction, Decomposition, Interface, MeshGenerator, MeshOperator, Mmpde, Moved, move_sides};
use crate::error::{Error, Failure, Result};
use crate::geometry::{Lattice, Mesh, Patch};
use crate::numerics::larger;
use crate::numerics::linear::Robust;
use crate::parallel;
use crate::setting::pair;
use crate::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Overlapping subdomains, solved in parallel and iterated
///
/// Each iteration solves the step on every subdomain with the newest values of its neighbours on the ring around it;
/// each node takes its value from the subdomain that it belongs to (restricted additive Schwarz). Rows of the mesh
/// operator sum to one, so an error of size one on a ring makes one of at most
///
/// ```text
/// M w = 0 inside,   w = 1 on the artificial ring,   w = 0 on the sides of the domain
/// ```
///
/// inside, and the largest w at a node on another subdomain's ring bounds the contraction of an iteration.
///
/// # Source
/// Gander, *Schwarz methods over the course of time* (2008); Gander and Haynes (2012) for mesh equations.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Schwarz {
    /// Along each axis.
    #[serde(deserialize_with = "pair")]
    pub subdomains: [usize; 2],
    /// Cells that neighbouring subdomains share.
    #[serde(default = "overlap")]
    pub overlap: usize,
    /// The iteration stops where its last change is at most this share of the largest coordinate.
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    /// Most iterations a step.
    #[serde(default = "iterations")]
    pub iterations: usize,
    #[serde(skip)]
    line: Robust<1>,
    #[serde(skip)]
    parts: Parts,
}

fn overlap() -> usize {
    2
}

fn tolerance() -> f64 {
    1e-10
}

fn iterations() -> usize {
    1000
}

/// The subdomains of a lattice with the memory of their solvers.
#[derive(Debug, Clone, Default)]
struct Parts {
    lattice: Option<Lattice<2>>,
    parts: Vec<Part>,
    /// Nodes on the ring of some subdomain, bounded sides left out.
    rings: Vec<usize>,
}

#[derive(Debug, Clone)]
struct Part {
    patch: Patch<2>,
    /// The nodes that it answers for: where they are in its padded vectors, and on which axes beyond the seam.
    own: Vec<Own>,
    plane: Robust<2>,
    point: Robust<1>,
}

#[derive(Debug, Clone, Copy)]
struct Own {
    node: usize,
    place: usize,
    beyond: [bool; 2],
}

impl Schwarz {
    /// Overlapping subdomains with the default tolerance.
    pub fn new(subdomains: [usize; 2], overlap: usize) -> Self {
        let (tolerance, iterations) = (tolerance(), iterations());
        Self { subdomains, overlap, tolerance, iterations, line: Robust::default(), parts: Parts::default() }
    }

    /// Refuses settings out of range for a lattice.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self, lattice: &Lattice<2>) -> Result<()> {
        Decomposition::new(lattice, self.subdomains)?;
        if self.overlap == 0 {
            return Err(Error::invalid(
                "overlap",
                0,
                "without overlap the iteration does not converge; set it to 1 or more",
            ));
        }
        if !(self.tolerance.is_finite() && self.tolerance >= 1e-12) {
            return Err(Error::invalid("tolerance", self.tolerance, "must be a finite number, 1e-12 or more"));
        }
        if self.iterations == 0 {
            return Err(Error::invalid("iterations", 0, "must be 1 or more"));
        }
        Ok(())
    }
}

impl Parts {
    fn prepare(&mut self, lattice: &Lattice<2>, subdomains: [usize; 2], overlap: usize) -> Result<(), Failure> {
        if self.lattice == Some(*lattice) {
            return Ok(());
        }
        let decomposition = Decomposition::new(lattice, subdomains)
            .map_err(|_| Failure::Subdomains { subdomains, cells: lattice.cells() })?;
        let extended = decomposition.extended([overlap / 2, overlap - overlap / 2]);
        let mut on_ring = vec![false; lattice.len()];
        for (patch, _) in &extended {
            ring(patch, lattice).for_each(|k| on_ring[k] = true);
        }
        *self = Self {
            lattice: Some(*lattice),
            parts: extended.into_iter().map(|(patch, own)| Part::new(lattice, patch, &own)).collect(),
            rings: (0..lattice.len()).filter(|&k| on_ring[k] && !decomposition.on_side(k)).collect(),
        };
        Ok(())
    }

    /// The bound on the contraction.
    fn predict(&mut self, operator: &MeshOperator<2>, mesh: &Mesh<2>) -> Result<(f64, Work), Failure> {
        let lattice = mesh.lattice();
        let mut side = vec![[1.0]; lattice.len()];
        lattice.sides().for_each(|k| side[k] = [0.0]);
        let zero = vec![[0.0]; lattice.len()];
        let solved = parallel::map_mut(&mut self.parts, |part| {
            operator.solve::<5, 1>(part.patch, &zero, &side, [[0.0]; 2], &mut part.point, [1.0])
        });
        let mut bound = zero.clone();
        let mut work = Work::default();
        for (part, solved) in self.parts.iter().zip(solved) {
            let (w, cost) = solved?;
            work += cost;
            part.own.iter().for_each(|own| bound[own.node] = w[own.place]);
        }
        Ok((self.rings.iter().map(|&k| bound[k][0]).fold(0.0, larger), work))
    }
}

impl Part {
    fn new(lattice: &Lattice<2>, patch: Patch<2>, own: &[usize]) -> Self {
        let mut owned = vec![false; lattice.len()];
        own.iter().for_each(|&k| owned[k] = true);
        let own = (patch.entries(lattice).zip(patch.places()))
            .filter(|((node, _), _)| owned[*node])
            .map(|((node, beyond), place)| Own { node, place, beyond })
            .collect();
        Self { patch, own, plane: Robust::default(), point: Robust::default() }
    }
}

/// Nodes of the ring around a patch, without its corners; on a wrapping axis there is none.
fn ring<'a>(patch: &'a Patch<2>, lattice: &'a Lattice<2>) -> impl Iterator<Item = usize> + 'a {
    let nodes = lattice.nodes();
    let strides = lattice.strides();
    (0..2).filter(|&d| !patch.wraps[d]).flat_map(move |d| {
        let ends = [patch.origin[d] + nodes[d] - 1, patch.origin[d] + patch.size[d]];
        ends.into_iter().flat_map(move |end| {
            (0..patch.size[1 - d])
                .map(move |k| end % nodes[d] * strides[d] + (patch.origin[1 - d] + k) % nodes[1 - d] * strides[1 - d])
        })
    })
}

impl MeshGenerator for Schwarz {
    fn step(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &[f64], dt: f64) -> Result<Moved, Failure> {
        let lattice = mesh.lattice();
        self.parts.prepare(lattice, self.subdomains, self.overlap)?;
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        let mut work = move_sides(equation, mesh, rho, dt, &mut x, &mut self.line)?;
        let started = Instant::now();
        let (predicted, cost) = self.parts.predict(&operator, mesh)?;
        work += cost;
        let seconds = started.elapsed().as_secs_f64();

        let (jump, size) = (jump(mesh), size(mesh));
        let tolerance = self.tolerance * size[0].max(size[1]);
        let mut changes: Vec<f64> = Vec::new();
        loop {
            let solved = parallel::map_mut(&mut self.parts.parts, |part| {
                operator.solve::<5, 2>(part.patch, mesh.x(), &x, jump, &mut part.plane, size)
            });
            let mut change = 0.0;
            let mut next = x.clone();
            for (part, solved) in self.parts.parts.iter().zip(solved) {
                let (inside, cost) = solved?;
                work += cost;
                for &Own { node, place, beyond } in &part.own {
                    let turn = [0, 1].map(|d| if beyond[d] { jump[d][d] } else { 0.0 });
                    next[node] = [0, 1].map(|c| inside[place][c] - turn[c]);
                    change = (0..2).map(|c| next[node][c] - x[node][c]).fold(change, larger);
                }
            }
            x = next;
            changes.push(change);
            let iterations = changes.len();
            if change <= tolerance || self.parts.rings.is_empty() {
                break;
            }
            if iterations == self.iterations || !change.is_finite() {
                return Err(Failure::SchwarzStalled { change, tolerance, iterations });
            }
        }
        // the first change is the step itself, the later ones are corrections of the rings
        let observed = match changes.as_slice() {
            [_, second, .., last] if *second > 0.0 => (last / second).powf(1.0 / (changes.len() - 2) as f64),
            [_, ..] => 0.0,
            [] => unreachable!("at least one iteration was done"),
        };
        let contraction = Some(Contraction { iterations: changes.len(), predicted, observed });
        let points = self.parts.rings.len();
        let interface = Interface { points, standard_error: None, noise: None, sweeps: 0, contraction, seconds };
        Ok(Moved { mesh: mesh.moved(x)?, work, interface: Some(interface) })
    }
}
