//! A user's equation as physics: where it starts, and how it is stepped.

use super::FormulaLaw;
use super::checks::WIGGLES;
use crate::error::Failure;
use crate::geometry::{Cells, Field, Mesh, dot};
use crate::numerics::linear::{RobustLine, RobustTransport};
use crate::numerics::{ends, larger};
use crate::physics::finite_volumes::Law;
use crate::physics::prescribed::evaluate;
use crate::physics::sides::Open;
use crate::physics::{Forcing, Motion, Physics, nodal};
use crate::work::Work;

/// A front is unresolved where the cell Péclet number of an edge exceeds this and the unknown changes by more than
/// [`CHANGES`] over the edge.
const WIDE: f64 = 10.0;
/// Change of an unknown over an edge, as a share of its range, above which a front may be unresolved.
const CHANGES: f64 = 0.3;

impl<const D: usize, const B: usize, const P: usize, const K: usize, Solver> Physics<D>
    for FormulaLaw<D, B, P, K, Solver>
where
    Solver: Default + Send + Sync,
    Self: Stepped<D, B>,
    Mesh<D>: Cells<D>,
{
    fn unknowns(&self) -> Vec<String> {
        self.names.to_vec()
    }

    fn initial(&self, t: f64, mesh: &Mesh<D>) -> Field {
        Field::nodal(evaluate(&self.initial, t, mesh))
    }

    fn side_values(&self, t: f64, x: [f64; D], beyond: [[bool; 2]; D]) -> Vec<Option<f64>> {
        self.given(t, x, beyond).to_vec()
    }

    fn check(&self, t: f64, mesh: &Mesh<D>, u: &Field) -> Result<(), Failure> {
        let values = u.values().as_chunks::<B>().0;
        if let Some(place) = u.values().iter().position(|u| !u.is_finite()) {
            let (k, c) = (place / B, place % B);
            return Err(self.failure(format!("`pde.initial.{}`", self.names[c]), values[k][c], mesh, k, None));
        }
        self.check_sides(t, mesh)?;
        self.check_exact(t, mesh)?;
        let nodes = self.nodes(t, &mesh.images(), values);
        for (k, node) in nodes.iter().enumerate() {
            if let Some(worst) = node.iter().position(|v| !v.is_finite()) {
                let given = Some(&values[k]).filter(|_| self.of_unknowns[worst]);
                return Err(self.failure(self.what(worst), node[worst], mesh, k, given));
            }
        }
        self.check_diffusivities(mesh, &nodes, [WIGGLES; B], |k| k)
    }

    fn exact(&self, t: f64, mesh: &Mesh<D>) -> Option<Field> {
        let unknown = |exact| evaluate(exact, t, mesh).into_flattened();
        let known: Vec<Vec<f64>> = self.exact.iter().map(|(_, exact)| unknown(exact)).collect();
        (!known.is_empty()).then(|| Field::joined(&known).expect("each has one value a node"))
    }

    fn forcing(&self, t: f64, x: &[[f64; D]], beyond: &[[[bool; 2]; D]], u: &[f64]) -> Vec<Forcing> {
        let timed = |c: usize| {
            (0..D).flat_map(move |d| [(d, 0), (d, 1)]).filter(move |&(d, end)| self.sides[c][d][end].takes_time::<D>())
        };
        if !self.timed.are_some() && (0..B).all(|c| timed(c).next().is_none()) {
            return Vec::new();
        }
        let u = u.as_chunks::<B>().0;
        let sources = self.timed.at(t, x, |k| u[k]);
        let mut all = Vec::with_capacity(B * x.len());
        for ((k, x), beyond) in x.iter().enumerate().zip(beyond) {
            for (c, source) in sources[k].into_iter().enumerate() {
                let mut forcing = Forcing { source, ..Forcing::default() };
                for (d, end) in timed(c).filter(|&(d, end)| beyond[d][end]) {
                    match &self.sides[c][d][end] {
                        Open::Value(formula) => {
                            forcing.value = formula.eval(&x.iter().copied().chain([t]).collect::<Vec<f64>>());
                        }
                        Open::Flux(flux) => {
                            let place: Vec<f64> = x.iter().copied().chain(u[k]).chain([t]).collect();
                            forcing.inflow += flux.value.eval(&place);
                        }
                        Open::Closed | Open::Outflow => {}
                    }
                }
                all.push(forcing);
            }
        }
        all
    }

    fn keeps_range(&self) -> Vec<bool> {
        self.kinds.keeps_range.to_vec()
    }

    fn forms_shocks(&self) -> bool {
        self.kinds.forms_shocks
    }

    fn instantaneous(&self) -> Vec<bool> {
        self.terms.algebraic().to_vec()
    }

    fn unresolved_flux(&self, t: f64, mesh: &Mesh<D>, u: &Field) -> Option<(usize, usize, f64)> {
        let (lattice, values) = (mesh.lattice(), u.values().as_chunks::<B>().0);
        let nodes = self.nodes(t, &mesh.images(), values);
        let (limited, damped) = (self.limited().unknowns, self.kinds.damped);
        let mut worst: Option<(usize, usize, f64)> = None;
        for c in (0..B).filter(|&c| !limited[c] && !damped[c]) {
            let [low, high] = ends(u.component(c));
            for (axis, s) in lattice.strides().into_iter().enumerate() {
                let inside = |k: &usize| lattice.node(*k)[axis] + 1 < lattice.nodes()[axis];
                for k in (0..lattice.len()).filter(inside) {
                    let change = (values[k + s][c] - values[k][c]).abs();
                    let way: [f64; D] = std::array::from_fn(|d| mesh.x()[k + s][d] - mesh.x()[k][d]);
                    let along = |k: usize| dot(std::array::from_fn(|d| Self::slope(&nodes[k], d, c, c)), way).abs();
                    let spread = |k: usize| Self::value(&nodes[k], Self::DIFFUSIVITY, c);
                    let peclet = along(k).max(along(k + s)) / spread(k).max(spread(k + s));
                    let wide = spread(k) > 0.0 && peclet > WIDE && change > CHANGES * (high - low);
                    if wide && worst.is_none_or(|(_, _, most)| peclet > most) {
                        worst = Some((c, k, peclet));
                    }
                }
            }
        }
        worst
    }

    fn widest_cells(&self, t: f64, mesh: &Mesh<D>, u: &Field) -> Vec<f64> {
        // a source of place and time alone lets nothing grow
        if !(0..B).any(|c| self.of_unknowns[Self::SOURCE * B + c]) {
            return Vec::new();
        }
        let nodes = self.nodes(t, &mesh.images(), u.values().as_chunks::<B>().0);
        let spread =
            |c: usize| nodes.iter().fold(0.0, |most, node| larger(most, Self::value(node, Self::DIFFUSIVITY, c)));
        let spread: [f64; B] = std::array::from_fn(spread);
        let widest = |node: &[f64; K]| {
            let width = |c: usize| match Self::slope(node, Self::SOURCE, c, c) {
                rate if rate > 0.0 && spread[c] > 0.0 => (spread[c] / rate).sqrt(),
                _ => f64::INFINITY,
            };
            (0..B).map(width).fold(f64::INFINITY, f64::min)
        };
        let widest: Vec<f64> = nodes.iter().map(widest).collect();
        if widest.iter().all(|w| w.is_infinite()) { Vec::new() } else { widest }
    }

    fn growth_rates(&self, t: f64, mesh: &Mesh<D>, u: &Field) -> Vec<f64> {
        if !(0..B).any(|c| self.of_unknowns[Self::SOURCE * B + c]) {
            return Vec::new();
        }
        let nodes = self.nodes(t, &mesh.images(), u.values().as_chunks::<B>().0);
        let rates = nodes.iter().flat_map(|node| (0..B).map(|c| Self::slope(node, Self::SOURCE, c, c).max(0.0)));
        let rates: Vec<f64> = rates.collect();
        if rates.iter().any(|rate| *rate > 0.0) { rates } else { Vec::new() }
    }

    fn known(&self) -> Vec<usize> {
        self.exact.iter().map(|(c, _)| *c).collect()
    }

    fn areas(&self, mesh: &Mesh<D>) -> Vec<f64> {
        (self.cells)(mesh).areas().to_vec()
    }

    fn step(&mut self, motion: Motion<'_, D>, u: &Field) -> Result<(Field, Work), Failure> {
        let start = nodal::<D, B>(motion, u)?;
        let end = motion.t + motion.dt;
        self.check_sides(end, motion.new)?;
        let (values, work) = self.advanced(motion, start)?;
        self.check_exact(end, motion.new)?;
        Ok((Field::nodal(values), work))
    }
}

/// A step of finite volumes, whose stencils differ between the line and the plane.
trait Stepped<const D: usize, const B: usize> {
    fn advanced(&mut self, motion: Motion<'_, D>, start: &[[f64; B]]) -> Result<(Vec<[f64; B]>, Work), Failure>;
}

macro_rules! stepped {
    ($D:literal, $Solver:ty) => {
        impl<const B: usize, const P: usize, const K: usize> Stepped<$D, B> for FormulaLaw<$D, B, P, K, $Solver> {
            fn advanced(
                &mut self,
                motion: Motion<'_, $D>,
                start: &[[f64; B]],
            ) -> Result<(Vec<[f64; B]>, Work), Failure> {
                let mut volumes = std::mem::take(&mut self.volumes);
                let stepped = volumes.step(self, motion, start);
                self.volumes = volumes;
                stepped
            }
        }
    };
}

stepped!(1, RobustLine);
stepped!(2, RobustTransport<B>);
