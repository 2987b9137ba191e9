//! A user's equation as a conservation law.

mod checks;
mod kinds;
mod layers;
mod loads;
mod states;
mod stepped;
mod weights;

use super::bounds::Bounds;
use super::finite_volumes::{
    Block, Crossing, FiniteVolumes, Law, Limited, Point, Side, Sloped, Steep, Stepper, Stored,
};
use super::formula_pde::Formulas;
use super::sides::Open;
use super::terms::Terms;
use crate::error::{Failure, Result};
use crate::formula::Program;
use crate::geometry::{Cells, DualCells, Mesh, dot, length, strides};
use crate::parallel;
use checks::{BEYOND, WIGGLES};
use kinds::Kinds;
use layers::Layers;
use loads::Loads;

/// B unknowns in D dimensions. P = D + B is the number of values that the formulas take at a node, K = (D + 2) B (B +
/// 1) that of the values they give.
pub(super) struct FormulaLaw<const D: usize, const B: usize, const P: usize, const K: usize, Solver> {
    names: [String; B],
    kinds: Kinds<B>,
    nodal: Program<P, K>,
    /// Whether each of the values of `nodal` depends on unknowns.
    of_unknowns: [bool; K],
    initial: Program<D, B>,
    /// What holds for each unknown at the lower and the upper end of each axis.
    sides: [[[Open; 2]; D]; B],
    /// The exact solution, for the unknowns that have one.
    exact: Vec<(usize, Program<D, 1>)>,
    has_source: bool,
    stepper: Stepper,
    bounds: Bounds<D, B>,
    terms: Terms<D, B>,
    layers: Layers<P, B>,
    loads: Loads<P, B>,
    /// The sources that depend on time.
    timed: Loads<P, B>,
    cells: fn(&Mesh<D>) -> DualCells<D>,
    volumes: FiniteVolumes<B, D, Solver>,
}

impl<const D: usize, const B: usize, const P: usize, const K: usize, Solver: Default> FormulaLaw<D, B, P, K, Solver> {
    /// Index of the diffusivity among the quantities of an equation, in the order of [`Formulas::nodal`]: after the
    /// fluxes along all axes.
    const DIFFUSIVITY: usize = D;
    /// Index of the source among the quantities of an equation.
    const SOURCE: usize = D + 1;
    /// Number of quantities of an equation.
    const QUANTITIES: usize = D + 2;

    /// The equation of some formulas, integrated over dual cells.
    pub fn new(formulas: Formulas<D>, cells: fn(&Mesh<D>) -> DualCells<D>, stepper: Stepper, cartesian: bool) -> Self {
        let kinds = Kinds::of(&formulas, cartesian);
        let Formulas { names, nodal, initial, sides, exact, terms, bounds, .. } = formulas;
        let exact = exact.iter().enumerate().filter_map(|(c, f)| Some((c, Program::new([f.as_ref()?]))));
        Self {
            names: std::array::from_fn(|c| names[c].clone()),
            loads: Loads::new(std::array::from_fn(|c| Some(&nodal[Self::SOURCE * B + c]).filter(|_| kinds.loaded[c]))),
            timed: Loads::new(std::array::from_fn(|c| {
                Some(&nodal[Self::SOURCE * B + c]).filter(|source| source.depends_on(P))
            })),
            terms: Terms::new(&terms, &names),
            layers: Layers::new(std::array::from_fn(|c| &nodal[Self::DIFFUSIVITY * B + c])),
            bounds: Bounds::new(
                &names,
                &bounds,
                std::array::from_fn(|c| (0..D).map(|d| &nodal[d * B + c]).collect()),
                std::array::from_fn(|c| Some(&nodal[Self::SOURCE * B + c]).filter(|_| kinds.reacts[c])),
            ),
            has_source: (0..B).any(|c| nodal[Self::SOURCE * B + c].text() != "0"),
            of_unknowns: std::array::from_fn(|k| (0..B).any(|c| nodal[k].depends_on(D + c))),
            nodal: Program::new(std::array::from_fn(|k| &nodal[k])),
            initial: Program::new(std::array::from_fn(|c| &initial[c])),
            sides: std::array::from_fn(|c| sides[c].clone()),
            exact: exact.collect(),
            cells,
            stepper,
            kinds,
            volumes: FiniteVolumes::default(),
        }
    }

    /// A quantity of equation c at a node.
    #[inline(always)]
    fn value(node: &[f64; K], quantity: usize, c: usize) -> f64 {
        node[quantity * B + c]
    }

    /// The derivative of that quantity by unknown e.
    #[inline(always)]
    fn slope(node: &[f64; K], quantity: usize, c: usize, e: usize) -> f64 {
        node[(Self::QUANTITIES * (1 + e) + quantity) * B + c]
    }

    /// The name, for messages, of the k-th value at a node.
    fn what(&self, k: usize) -> String {
        let (row, quantity, name) = (k / (Self::QUANTITIES * B), k / B % Self::QUANTITIES, &self.names[k % B]);
        let key = match quantity {
            quantity if quantity == Self::DIFFUSIVITY => format!("`pde.diffusivity.{name}`"),
            quantity if quantity == Self::SOURCE => format!("`pde.source.{name}`"),
            axis => format!("`pde.flux.{name}[{axis}]`"),
        };
        if row == 0 { key } else { format!("the derivative of {key} by {}", self.names[row - 1]) }
    }

    fn failure(&self, what: String, value: f64, mesh: &Mesh<D>, k: usize, u: Option<&[f64; B]>) -> Failure {
        let given = u.map_or(Vec::new(), |u| self.names.iter().cloned().zip(*u).collect());
        let at = mesh.node_place(k);
        Failure::Formula { what, value, at, given }
    }

    /// The node at a place of padded arrays. In the ring it is the node of which there is an image or a repetition.
    fn node(mesh: &Mesh<D>, place: usize) -> usize {
        let (nodes, wraps) = (mesh.lattice().nodes(), mesh.lattice().periodic());
        let strides = strides(nodes.map(|n| n + 2));
        mesh.lattice().index(std::array::from_fn(|d| {
            let (n, along) = (nodes[d], place / strides[d] % (nodes[d] + 2));
            if wraps[d] { (along + n - 1) % n } else { along.clamp(1, n) - 1 }
        }))
    }

    /// The values given at a place on some sides; in a corner those of the first axis count.
    fn given(&self, t: f64, x: [f64; D], beyond: [[bool; 2]; D]) -> [Option<f64>; B] {
        let place: Vec<f64> = x.into_iter().chain([t]).collect();
        std::array::from_fn(|c| {
            let ends = (0..D).flat_map(|d| [(d, 0), (d, 1)]).filter(|&(d, end)| beyond[d][end]);
            ends.into_iter().find_map(|(d, end)| match &self.sides[c][d][end] {
                Open::Value(formula) => Some(formula.eval(&place)),
                _ => None,
            })
        })
    }
}

impl<const D: usize, const B: usize, const P: usize, const K: usize, Solver> Law<B, D>
    for FormulaLaw<D, B, P, K, Solver>
where
    Solver: Default + Sync,
{
    type Node = [f64; K];
    /// Newton's method has converged once every residual is below this share of the size of its unknown: smaller than
    /// usual, since an error may grow exponentially, as in an unstable state ahead of a front.
    const TOLERANCE: f64 = 1e-9;

    fn names(&self) -> [&'static str; B] {
        std::array::from_fn(|c| {
            [
                "the first unknown",
                "the second unknown",
                "the third unknown",
                "the fourth unknown",
                "the fifth unknown",
                "the sixth unknown",
                "the seventh unknown",
                "the eighth unknown",
            ][c]
        })
    }

    fn nodes(&self, t: f64, x: &[[f64; D]], u: &[[f64; B]]) -> Vec<[f64; K]> {
        let mut nodes = vec![[0.0; K]; x.len()];
        parallel::for_each_piece(&mut nodes, |begin, nodes| {
            let points: Vec<[f64; P]> = (x[begin..].iter().zip(&u[begin..]).take(nodes.len()))
                .map(|(x, u)| std::array::from_fn(|v| if v < D { x[v] } else { u[v - D] }))
                .collect();
            self.nodal.eval_each(&points, &[t], nodes);
        });
        nodes
    }

    fn check(&self, mesh: &Mesh<D>, u: &[[f64; B]], nodes: &[[f64; K]]) -> Result<(), Failure> {
        let Some(place) = nodes.iter().position(|node| node.iter().any(|v| !v.is_finite())) else {
            let least = self.kinds.vanishes.map(|vanishes| if vanishes { BEYOND } else { WIGGLES });
            return self.check_diffusivities(mesh, nodes, least, |place| Self::node(mesh, place));
        };
        let k = Self::node(mesh, place);
        let values = &u[place];
        if let Some(c) = values.iter().position(|u| !u.is_finite()) {
            return Err(self.failure(format!("the unknown {}", self.names[c]), values[c], mesh, k, None));
        }
        let worst = nodes[place].iter().position(|v| !v.is_finite()).unwrap_or_default();
        let given = Some(values).filter(|_| self.of_unknowns[worst]);
        Err(self.failure(self.what(worst), nodes[place][worst], mesh, k, given))
    }

    #[inline(always)]
    fn convection(&self, below: &[f64; K], above: &[f64; K], normal: [f64; D]) -> Crossing<B> {
        let through = |flux: [f64; D]| 0.5 * dot(flux, normal);
        let value = |node: &[f64; K], c| through(std::array::from_fn(|d| Self::value(node, d, c)));
        let slope = |node: &[f64; K], c, e| through(std::array::from_fn(|d| Self::slope(node, d, c, e)));
        crossing(below, above, value, slope)
    }

    #[inline(always)]
    fn diffusivity(&self, below: &[f64; K], above: &[f64; K]) -> Crossing<B> {
        // where a solution goes slightly beyond the values for which it is positive, nothing diffuses
        let value = |node: &[f64; K], c| 0.5 * Self::value(node, Self::DIFFUSIVITY, c).max(0.0);
        let slope = |node: &[f64; K], c, e| match Self::value(node, Self::DIFFUSIVITY, c) < 0.0 {
            true => 0.0,
            false => 0.5 * Self::slope(node, Self::DIFFUSIVITY, c, e),
        };
        crossing(below, above, value, slope)
    }

    #[inline(always)]
    fn source(&self, node: &[f64; K]) -> Option<([f64; B], Block<B>)> {
        let value = std::array::from_fn(|c| Self::value(node, Self::SOURCE, c));
        let slope = std::array::from_fn(|c| std::array::from_fn(|e| Self::slope(node, Self::SOURCE, c, e)));
        self.has_source.then_some((value, slope))
    }

    fn side(&self, t: f64, x: [f64; D], beyond: [[bool; 2]; D]) -> [Option<f64>; B] {
        self.given(t, x, beyond)
    }

    fn open_sides(&self) -> &[(usize, usize)] {
        &self.kinds.open
    }

    fn leaving(
        &self,
        (axis, end): (usize, usize),
        (t, x): (f64, [f64; D]),
        (node, u): (&[f64; K], &[f64; B]),
        normal: [f64; D],
    ) -> ([f64; B], Block<B>) {
        let size = length(normal);
        let place: Vec<f64> = x.into_iter().chain(*u).chain([t]).collect();
        let (mut value, mut by) = ([0.0; B], [[0.0; B]; B]);
        for c in 0..B {
            match &self.sides[c][axis][end] {
                Open::Value(_) | Open::Closed => {}
                Open::Outflow => {
                    value[c] = dot(std::array::from_fn(|d| Self::value(node, d, c)), normal);
                    by[c] = std::array::from_fn(|e| dot(std::array::from_fn(|d| Self::slope(node, d, c, e)), normal));
                }
                Open::Flux(flux) => {
                    value[c] = -size * flux.value.eval(&place);
                    by[c] = std::array::from_fn(|e| -size * flux.slopes[e].eval(&place));
                }
            }
        }
        (value, by)
    }

    fn shares_mass(&self) -> [bool; B] {
        self.kinds.shares
    }

    fn weights(&self, t: f64, mesh: &Mesh<D>, u: &[[f64; B]]) -> [f64; B] {
        self.weights_of_neighbours(|| self.nodes(t, &mesh.images(), u), u)
    }

    fn bounds(
        &self,
        (t, x): (f64, &[[f64; D]]),
        mesh: &Mesh<D>,
        u: &[[f64; B]],
        sides: &[Side<B>],
    ) -> Result<Vec<[[f64; 2]; B]>, Failure> {
        let own = self.kept((t, x), u, sides, &self.bounds.states);
        self.bounds.at(t, mesh, own)
    }

    fn vanishing_diffusion(&self) -> [bool; B] {
        self.kinds.vanishes
    }

    fn empty(&self, at: (f64, &[[f64; D]]), u: &[[f64; B]], sides: &[Side<B>]) -> [[f64; 2]; B] {
        self.kept(at, u, sides, &self.kinds.vanishing)
    }

    fn has_loads(&self) -> bool {
        self.loads.are_some()
    }

    fn loads(&self, t: f64, mesh: &Mesh<D>, x: &[[f64; D]], u: [f64; B]) -> Result<Vec<[f64; B]>, Failure> {
        let loads = self.loads.at(t, x, |_| u);
        match loads.as_flattened().iter().position(|value| !value.is_finite()) {
            None => Ok(loads),
            Some(place) => {
                let (p, c) = (place / B, place % B);
                let near = |k: &usize| distance(mesh.x()[*k], x[p]);
                let k = (0..mesh.x().len()).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap_or_default();
                let what = format!("`pde.source.{}` near", self.names[c]);
                Err(self.failure(what, loads[p][c], mesh, k, None))
            }
        }
    }

    fn limited(&self) -> Limited<B> {
        self.kinds.limited
    }

    fn damped(&self) -> [bool; B] {
        self.kinds.damped
    }

    fn has_own_flux(&self) -> [bool; B] {
        self.kinds.has_own_flux
    }

    fn has_layers(&self) -> bool {
        self.layers.are_some()
    }

    fn through_layers(&self, t: f64, mesh: &Mesh<D>, edges: &[[[f64; D]; 2]]) -> Vec<[Option<f64>; B]> {
        self.layers.through(t, mesh, edges)
    }

    fn has_steep(&self) -> bool {
        self.terms.have_fluxes()
    }

    fn steep(&self, at: (f64, &[Point<B, D>]), mesh: &Mesh<D>) -> Result<Vec<Steep<B, D>>, Failure> {
        self.terms.fluxes(at, mesh, |place| Self::node(mesh, place))
    }

    fn has_sloped(&self) -> bool {
        self.terms.have_sources()
    }

    fn sloped(&self, at: (f64, &[Point<B, D>]), mesh: &Mesh<D>) -> Result<Vec<Sloped<B, D>>, Failure> {
        self.terms.sources(at, mesh, |place| Self::node(mesh, place))
    }

    fn stored(&self, at: (f64, &[[f64; D]], &[[f64; B]]), mesh: &Mesh<D>) -> Result<Vec<Stored<B>>, Failure> {
        match self.terms.have_storage() {
            true => self.terms.storage(at, mesh, |place| Self::node(mesh, place)),
            false => Ok(Vec::new()),
        }
    }

    fn algebraic(&self) -> [bool; B] {
        self.terms.algebraic()
    }

    fn stepper(&self) -> Stepper {
        self.stepper
    }

    fn cells(&self, mesh: &Mesh<D>) -> DualCells<D>
    where
        Mesh<D>: Cells<D>,
    {
        (self.cells)(mesh)
    }
}

fn distance<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    length(std::array::from_fn::<f64, D, _>(|d| a[d] - b[d]))
}

/// The sum of the contributions of two nodes.
#[inline(always)]
fn crossing<const B: usize, N>(
    below: &N,
    above: &N,
    value: impl Fn(&N, usize) -> f64,
    slope: impl Fn(&N, usize, usize) -> f64,
) -> Crossing<B> {
    let by = |node: &N| std::array::from_fn(|c| std::array::from_fn(|e| slope(node, c, e)));
    Crossing {
        value: std::array::from_fn(|c| value(below, c) + value(above, c)),
        by_below: by(below),
        by_above: by(above),
    }
}

#[cfg(test)]
mod tests;
