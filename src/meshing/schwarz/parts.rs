use super::super::overlap::{Local, Part};
use super::super::ring::{Trace, ring, traces};
use super::super::{Decomposition, MeshOperator};
use crate::error::Failure;
use crate::geometry::{Lattice, Mesh};
use crate::numerics::larger;
use crate::numerics::linear::Robust;
use crate::ranks::Ranks;
use crate::work::Work;

/// The subdomains of a lattice with the memory of their solvers.
#[derive(Debug, Clone, Default)]
pub(super) struct Parts<const D: usize, const S: usize> {
    lattice: Option<Lattice<D>>,
    parts: Vec<Part<D, S>>,
    /// For each part its nodes on the ring, for Robin's conditions.
    traces: Vec<Vec<Trace>>,
    /// For each part the places in its padded vectors that other parts read.
    told: Vec<Vec<usize>>,
    /// The right-hand sides of a step, without the contributions of Robin's conditions.
    right: Vec<Vec<[f64; D]>>,
    /// Nodes that lie on the ring of some subdomain, without those on bounded sides.
    rings: Vec<usize>,
    point: Vec<Robust<1>>,
}

impl<const D: usize, const S: usize> Parts<D, S> {
    /// Makes what depends on the lattice alone, for this and later steps.
    pub fn prepare(&mut self, lattice: &Lattice<D>, subdomains: [usize; D], overlap: usize) -> Result<(), Failure> {
        if self.lattice == Some(*lattice) {
            return Ok(());
        }
        let decomposition = Decomposition::new(lattice, subdomains)
            .map_err(|_| Failure::Subdomains { subdomains: subdomains.into(), cells: lattice.cells().into() })?;
        let extended = decomposition.extended([overlap / 2, overlap - overlap / 2]);
        let mut on_ring = vec![false; lattice.len()];
        for (patch, _) in &extended {
            ring(patch, lattice).for_each(|bound| on_ring[bound.node] = true);
        }
        let parts: Vec<Part<D, S>> = extended.into_iter().map(|(patch, own)| Part::new(lattice, patch, own)).collect();
        let mut owner = vec![usize::MAX; lattice.len()];
        for (number, part) in parts.iter().enumerate() {
            part.own.iter().for_each(|&(node, _)| owner[node] = number);
        }
        let all_traces: Vec<Vec<Trace>> = parts.iter().map(|part| traces(part, &parts, &owner, lattice)).collect();
        *self = Self {
            lattice: Some(*lattice),
            told: told(lattice, &parts, &all_traces, &owner),
            traces: all_traces,
            rings: (0..lattice.len()).filter(|&k| on_ring[k] && !decomposition.on_side(k)).collect(),
            point: vec![Robust::default(); parts.len()],
            right: Vec::new(),
            parts,
        };
        Ok(())
    }

    /// The bound on the contraction of an iteration.
    pub fn predict(&mut self, operator: &MeshOperator<D>, mesh: &Mesh<D>) -> Result<(f64, Work), Failure> {
        let lattice = mesh.lattice();
        let mut side = vec![[1.0]; lattice.len()];
        lattice.sides().for_each(|k| side[k] = [0.0]);
        let zero = vec![[0.0]; lattice.len()];
        let mut all: Vec<(&Part<D, S>, &mut Robust<1>)> = self.parts.iter().zip(&mut self.point).collect();
        let rings = &self.rings;
        let solved = Ranks::here().map_mut(&mut all, |(part, solver)| {
            let (w, work) = operator.solve::<S, 1>(part.patch, &zero, &side, [[0.0]; D], *solver, [1.0])?;
            let on_rings = part.own.iter().filter(|(node, _)| rings.binary_search(node).is_ok());
            Ok((on_rings.map(|&(_, place)| w[place][0]).fold(0.0, larger), work))
        });
        let (mut bound, mut work) = (0.0, Work::default());
        for solved in solved {
            let (w, cost): (f64, Work) = solved?;
            work += cost;
            bound = larger(bound, w);
        }
        Ok((bound, work))
    }

    /// Sets up the systems of a step, of the parts that this rank owns. Robin's condition c_g = β c_i + given is
    /// eliminated: its unknown part goes to the matrix.
    pub fn set(&mut self, operator: &MeshOperator<D>, residual: &[[f64; D]], beta: [f64; D]) {
        let (ranks, all) = (Ranks::here(), self.parts.len());
        for (number, (part, traces)) in self.parts.iter_mut().zip(&mut self.traces).enumerate() {
            part.correction.clear();
            if !ranks.owns(number, all) {
                continue;
            }
            part.prepare(operator, residual);
            for trace in traces.iter_mut().filter(|_| beta != [0.0; D]) {
                let (row, ring) = (&mut part.matrix.rows[trace.row], 1 + 2 * trace.axis + usize::from(trace.upper));
                trace.weight = -std::mem::take(&mut row[ring]);
                row[0] -= beta[trace.axis] * trace.weight;
            }
        }
        self.right = self.parts.iter().map(|part| part.right.clone()).collect();
    }

    /// One iteration, from corrections `c` at all nodes; returns the largest change. `beta` is that of Robin's
    /// conditions, and 0 for classical ones.
    pub fn iterate(&mut self, c: &mut [[f64; D]], beta: [f64; D], size: [f64; D]) -> Result<(f64, Work), Failure> {
        let lattice = self.lattice.as_ref().expect("parts are prepared first");
        let robin = beta != [0.0; D];
        let before: Vec<Vec<[f64; D]>> =
            if robin { self.parts.iter().map(|part| part.correction.clone()).collect() } else { Vec::new() };
        let (newest, own) = (&*c, &self.right);
        let (ranks, count) = (Ranks::here(), self.parts.len());
        let mut all: Vec<_> = self.parts.iter_mut().zip(&self.traces).zip(&self.told).enumerate().collect();
        let solved = ranks.map_mut(&mut all, |(number, ((part, traces), told))| {
            part.start(lattice, newest);
            let work = match robin {
                false => part.correct(Local::Solve { share: 0.0 }, size)?,
                true => reflect(part, traces, &own[*number], &before, beta, size)?,
            };
            let changes = part.own.iter().flat_map(|&(node, place)| {
                let (new, old) = (part.correction[place], newest[node]);
                (0..D).map(move |k| new[k] - old[k])
            });
            let told: Vec<[f64; D]> = told.iter().map(|&place| part.correction[place]).collect();
            Ok((work, changes.fold(0.0, larger), told))
        });
        let (mut change, mut work) = (0.0, Work::default());
        for (number, (solved, part)) in solved.into_iter().zip(&mut self.parts).enumerate() {
            let (cost, largest, told) = solved?;
            work += cost;
            change = larger(change, largest);
            if !ranks.owns(number, count) {
                part.correction.resize(part.patch.padded_len(), [0.0; D]);
                self.told[number].iter().zip(told).for_each(|(&place, value)| part.correction[place] = value);
            }
            part.own.iter().for_each(|&(node, place)| c[node] = part.correction[place]);
        }
        Ok((change, work))
    }

    /// Gives all corrections to all ranks, which know those of others only where their own parts read them.
    pub fn share(&mut self, c: &mut [[f64; D]]) {
        let corrections = Ranks::here().map_mut(&mut self.parts, |part| part.own_correction());
        for (part, correction) in self.parts.iter().zip(corrections) {
            part.own.iter().zip(correction).for_each(|(&(node, _), value)| c[node] = value);
        }
    }

    /// Number of nodes on rings, at which subdomains meet.
    pub fn rings(&self) -> usize {
        self.rings.len()
    }

    /// Nodes that a part reads from its neighbours in an iteration; the largest number over the parts.
    pub fn read(&self) -> usize {
        let read = |lattice: &Lattice<D>| self.parts.iter().map(|part| part.read(lattice)).max();
        self.lattice.as_ref().and_then(read).unwrap_or(0)
    }
}

/// One solve of a part with Robin's conditions, from the corrections `before` of all parts.
fn reflect<const D: usize, const S: usize>(
    part: &mut Part<D, S>,
    traces: &[Trace],
    own: &[[f64; D]],
    before: &[Vec<[f64; D]>],
    beta: [f64; D],
    size: [f64; D],
) -> Result<Work, Failure> {
    part.right.copy_from_slice(own);
    for trace in traces {
        // a part that has not been solved yet has no corrections
        let at = |place: usize| before[trace.other].get(place).copied().unwrap_or([0.0; D]);
        let (ring, inner) = (at(trace.other_ring), at(trace.other_inner));
        let given: [f64; D] = std::array::from_fn(|c| ring[c] - beta[trace.axis] * inner[c]);
        (0..D).for_each(|c| part.right[trace.row][c] += trace.weight * given[c]);
        part.correction[trace.ring] = given;
    }
    let work = part.correct(Local::Solve { share: 0.0 }, size)?;
    for trace in traces {
        let inner = part.correction[trace.inner];
        (0..D).for_each(|c| part.correction[trace.ring][c] += beta[trace.axis] * inner[c]);
    }
    Ok(work)
}

/// For each part the places in its padded vectors that other parts read: at nodes that it owns and others hold, corners
/// of their rings included, and, for Robin's conditions, on both sides of their rings.
fn told<const D: usize, const S: usize>(
    lattice: &Lattice<D>,
    parts: &[Part<D, S>],
    traces: &[Vec<Trace>],
    owner: &[usize],
) -> Vec<Vec<usize>> {
    let numbers: Vec<[f64; 1]> = (0..lattice.len()).map(|node| [node as f64]).collect();
    let mut read = vec![false; lattice.len()];
    for (number, part) in parts.iter().enumerate() {
        let held = part.patch.gather(lattice, &numbers, [[0.0]; D]);
        let nodes = held.into_iter().map(|[node]| node as usize);
        nodes.filter(|&node| owner[node] != number).for_each(|node| read[node] = true);
    }
    let own = |part: &Part<D, S>| part.own.iter().filter(|(node, _)| read[*node]).map(|&(_, place)| place).collect();
    let mut told: Vec<Vec<usize>> = parts.iter().map(own).collect();
    for trace in traces.iter().flatten() {
        told[trace.other].extend([trace.other_ring, trace.other_inner]);
    }
    for places in &mut told {
        places.sort_unstable();
        places.dedup();
    }
    told
}
