//! Terms of an equation that depend on gradients of the unknowns, and storage.

use super::finite_volumes::{Point, Sloped, Steep, Stored};
use crate::error::Failure;
use crate::formula::{Formula, Program};
use crate::geometry::Mesh;
use crate::parallel;

/// Number of values that formulas of terms take at a place: coordinates, unknowns, their derivatives along all axes,
/// one unknown after the other, and t in all that remain.
const PLACES: usize = 20;

/// A formula, and which entry of a result it gives.
struct Term<To> {
    to: To,
    program: Program<PLACES, 1>,
    what: String,
}

/// An entry of [`Steep`].
#[derive(Clone, Copy)]
enum OfFlux {
    Value(usize, usize),
    ByValue(usize, usize, usize),
    BySlope(usize, usize, usize, usize),
}

/// An entry of [`Sloped`].
#[derive(Clone, Copy)]
enum OfSource {
    Value(usize),
    ByValue(usize, usize),
    BySlope(usize, usize, usize),
}

/// An entry of [`Stored`].
#[derive(Clone, Copy)]
enum OfStorage {
    Value(usize),
    ByValue(usize, usize),
}

/// The formulas of terms that depend on gradients, and of storages: of coordinates, unknowns, their derivatives and t;
/// none where an unknown has no such term.
#[derive(Debug, Clone, Default)]
pub(super) struct TermFormulas<const D: usize> {
    /// The flux of each unknown along each axis.
    pub fluxes: Vec<Option<[Formula; D]>>,
    pub sources: Vec<Option<Formula>>,
    pub storage: Vec<Option<Formula>>,
}

impl<const D: usize> TermFormulas<D> {
    /// Whether an unknown has a flux by gradients.
    pub fn has_flux(&self, c: usize) -> bool {
        self.fluxes.get(c).is_some_and(Option::is_some)
    }

    /// Whether an unknown has a source by gradients.
    pub fn has_source(&self, c: usize) -> bool {
        self.sources.get(c).is_some_and(Option::is_some)
    }

    /// Whether something else than an unknown itself is stored.
    pub fn has_storage(&self, c: usize) -> bool {
        self.storage.get(c).is_some_and(Option::is_some)
    }
}

/// Terms that depend on gradients, and storages, compiled with their derivatives.
pub(super) struct Terms<const D: usize, const B: usize> {
    fluxes: Vec<Term<OfFlux>>,
    sources: Vec<Term<OfSource>>,
    storage: Vec<Term<OfStorage>>,
    /// The unknowns that have a storage of their own.
    stored: [bool; B],
    /// The unknowns whose storage is 0.
    algebraic: [bool; B],
}

impl<const D: usize, const B: usize> Terms<D, B> {
    /// Compiles formulas; `names` are those of the unknowns.
    pub fn new(formulas: &TermFormulas<D>, names: &[String]) -> Self {
        let mut fluxes = Vec::new();
        for (c, along) in formulas.fluxes.iter().enumerate() {
            for (d, formula) in along.iter().flatten().enumerate() {
                let what = format!("what `pde.flux` and `pde.diffusivity` make of {}", names[c]);
                push(&mut fluxes, OfFlux::Value(c, d), formula, &what);
                for e in 0..B {
                    derived(&mut fluxes, OfFlux::ByValue(c, e, d), formula, D + e, &what);
                    for j in 0..D {
                        derived(&mut fluxes, OfFlux::BySlope(c, e, j, d), formula, D + B + e * D + j, &what);
                    }
                }
            }
        }
        let mut sources = Vec::new();
        for (c, formula) in formulas.sources.iter().enumerate() {
            let Some(formula) = formula else { continue };
            let what = format!("`pde.source.{}`", names[c]);
            push(&mut sources, OfSource::Value(c), formula, &what);
            for e in 0..B {
                derived(&mut sources, OfSource::ByValue(c, e), formula, D + e, &what);
                for j in 0..D {
                    derived(&mut sources, OfSource::BySlope(c, e, j), formula, D + B + e * D + j, &what);
                }
            }
        }
        let mut storage = Vec::new();
        for (c, formula) in formulas.storage.iter().enumerate() {
            let Some(formula) = formula else { continue };
            let what = format!("`pde.storage.{}`", names[c]);
            push(&mut storage, OfStorage::Value(c), formula, &what);
            (0..B).for_each(|e| derived(&mut storage, OfStorage::ByValue(c, e), formula, D + e, &what));
        }
        let of = |c: usize| formulas.storage.get(c).and_then(Option::as_ref);
        Self {
            fluxes,
            sources,
            storage,
            stored: std::array::from_fn(|c| of(c).is_some()),
            algebraic: std::array::from_fn(|c| of(c).is_some_and(|formula| formula.eval(&[]) == 0.0)),
        }
    }

    /// Whether there is a flux by gradients.
    pub fn have_fluxes(&self) -> bool {
        !self.fluxes.is_empty()
    }

    /// Whether there is a source by gradients.
    pub fn have_sources(&self) -> bool {
        !self.sources.is_empty()
    }

    /// Whether something else than an unknown itself is stored.
    pub fn have_storage(&self) -> bool {
        !self.storage.is_empty()
    }

    /// The unknowns that have no time derivative.
    pub fn algebraic(&self) -> [bool; B] {
        self.algebraic
    }

    /// Fluxes at places with values of the unknowns and their gradients.
    ///
    /// # Errors
    /// [`Failure::Formula`] where one is not finite; `node` says which node of `mesh` belongs to a place.
    pub fn fluxes(
        &self,
        (t, points): (f64, &[Point<B, D>]),
        mesh: &Mesh<D>,
        node: impl Fn(usize) -> usize,
    ) -> Result<Vec<Steep<B, D>>, Failure> {
        let put = |steep: &mut Steep<B, D>, to: OfFlux, value: f64| match to {
            OfFlux::Value(c, d) => steep.flux[c][d] = value,
            OfFlux::ByValue(c, e, d) => steep.by_value[c][e][d] = value,
            OfFlux::BySlope(c, e, j, d) => steep.by_slope[c][e][j][d] = value,
        };
        evaluated(&self.fluxes, Steep::NONE, put, (t, points), mesh, node)
    }

    /// Sources at places with values of the unknowns and their gradients.
    ///
    /// # Errors
    /// As [`fluxes`](Self::fluxes).
    pub fn sources(
        &self,
        (t, points): (f64, &[Point<B, D>]),
        mesh: &Mesh<D>,
        node: impl Fn(usize) -> usize,
    ) -> Result<Vec<Sloped<B, D>>, Failure> {
        let put = |sloped: &mut Sloped<B, D>, to: OfSource, value: f64| match to {
            OfSource::Value(c) => sloped.value[c] = value,
            OfSource::ByValue(c, e) => sloped.by_value[c][e] = value,
            OfSource::BySlope(c, e, j) => sloped.by_slope[c][e][j] = value,
        };
        evaluated(&self.sources, Sloped::NONE, put, (t, points), mesh, node)
    }

    /// What is stored at places with values of the unknowns.
    ///
    /// # Errors
    /// As [`fluxes`](Self::fluxes).
    pub fn storage(
        &self,
        (t, x, u): (f64, &[[f64; D]], &[[f64; B]]),
        mesh: &Mesh<D>,
        node: impl Fn(usize) -> usize,
    ) -> Result<Vec<Stored<B>>, Failure> {
        let put = |stored: &mut Stored<B>, to: OfStorage, value: f64| match to {
            OfStorage::Value(c) => stored.value[c] = value,
            OfStorage::ByValue(c, e) => stored.by_value[c][e] = value,
        };
        let points: Vec<Point<B, D>> =
            x.iter().zip(u).map(|(x, u)| Point { x: *x, u: *u, slopes: [[0.0; D]; B] }).collect();
        let mut stored = evaluated(&self.storage, Stored::NONE, put, (t, &points), mesh, node)?;
        for (stored, u) in stored.iter_mut().zip(u) {
            for c in (0..B).filter(|&c| !self.stored[c]) {
                stored.value[c] = u[c];
                stored.by_value[c][c] = 1.0;
            }
        }
        Ok(stored)
    }
}

fn push<To>(terms: &mut Vec<Term<To>>, to: To, formula: &Formula, what: &str) {
    terms.push(Term { to, program: Program::new([formula]), what: what.into() });
}

/// Adds the derivative of a formula by a variable, if it depends on it. That it can be taken was seen when the formula
/// was read.
fn derived<To>(terms: &mut Vec<Term<To>>, to: To, formula: &Formula, variable: usize, what: &str) {
    if formula.depends_on(variable)
        && let Ok(derivative) = formula.derivative(variable)
    {
        push(terms, to, &derivative, &format!("the derivative of {what} by {}", formula.variables()[variable]));
    }
}

fn evaluated<const D: usize, const B: usize, To: Copy + Sync, R: Copy + Send>(
    terms: &[Term<To>],
    none: R,
    put: impl Fn(&mut R, To, f64) + Sync,
    (t, points): (f64, &[Point<B, D>]),
    mesh: &Mesh<D>,
    node: impl Fn(usize) -> usize,
) -> Result<Vec<R>, Failure> {
    // a value that is not finite, the term and the place
    let mut results = vec![(none, None::<(usize, f64)>); points.len()];
    parallel::for_each_piece(&mut results, |begin, results| {
        let places = points[begin..].iter().take(results.len()).map(|point| {
            let mut place = [t; PLACES];
            let slopes = point.slopes.as_flattened();
            let values = point.x.iter().chain(&point.u).chain(slopes);
            place.iter_mut().zip(values).for_each(|(to, value)| *to = *value);
            place
        });
        let places: Vec<[f64; PLACES]> = places.collect();
        let mut values = vec![[0.0]; places.len()];
        for (n, term) in terms.iter().enumerate() {
            term.program.eval_each(&places, &[], &mut values);
            for ((result, wrong), [value]) in results.iter_mut().zip(&values) {
                put(result, term.to, *value);
                if !value.is_finite() {
                    *wrong = wrong.or(Some((n, *value)));
                }
            }
        }
    });
    if let Some((place, (n, value))) =
        results.iter().enumerate().find_map(|(place, (_, wrong))| Some((place, (*wrong)?)))
    {
        let at = mesh.node_place(node(place));
        return Err(Failure::Formula { what: terms[n].what.clone(), value, at, given: Vec::new() });
    }
    Ok(results.into_iter().map(|(result, _)| result).collect())
}
