mod parts;

use super::overlap::residual;
use super::sides::size;
use super::{Contraction, Decomposition, Interface, MeshGenerator, Mmpde, Moved, move_sides};
use crate::error::{Error, Failure, Result};
use crate::geometry::{Density, Lattice, Mesh};
use crate::numerics::linear::Robust;
use crate::ranks::Ranks;
use crate::setting::{Auto, Axes};
use parts::Parts;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Overlapping subdomains, solved in parallel and iterated until they agree
///
/// In an iteration every subdomain solves the step with the newest values of its neighbours on the ring around it. Then
/// each node takes its value from the subdomain that owns it (restricted additive Schwarz). Rows of the mesh operator
/// sum to one, so that an error of one on the ring makes an error inside of at most w with
///
/// ```text
/// M w = 0 inside,   w = 1 on the artificial ring,   w = 0 on the sides of the domain
/// ```
///
/// The largest w at a node on another subdomain's ring bounds the contraction of an iteration.
///
/// With `method = "optimized"` the correction c satisfies Robin's condition ∂_n c + p c = g, where g comes from the
/// neighbour. Its discrete form exchanges c_g − β c_i, with g a node of the ring, i the one beside it inside, and β =
/// 1/(1 + p h). For a single wave, β = e^−θ would be exact:
///
/// ```text
/// ρ(φ) = (β − z)/(1 − β z) z^(overlap − 1),   z = e^−θ,   cosh θ = 1 + (1 + 2 a_t (1 − cos φ)) / (2 a_n)
/// ```
///
/// is the factor by which an iteration reduces a wave cos φj along a single cut, for a constant density and a =
/// Δt/(τh²) across (n) and along (t) the cut. p = "auto" minimises the largest of these factors. Where subdomains have
/// corners this is no bound, and none is reported.
///
/// # Source
/// Gander, *Schwarz methods over the course of time* (2008); Gander and Haynes (2012) for mesh equations.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(from = "Written<D>")]
#[schemars(rename = "Schwarz")]
pub struct Schwarz<const D: usize = 2, const S: usize = 5> {
    /// Number of subdomains along each axis.
    pub subdomains: Axes<usize, D>,
    /// Cells that neighbouring subdomains share.
    pub overlap: usize,
    /// What neighbours exchange: positions (`"classical"`) or Robin's conditions (`"optimized"`).
    pub method: Transmission,
    /// p > 0 of Robin's condition ∂_n c + p c for the correction c of the mesh, with lengths measured in the unit
    /// square of ξ; "auto" takes the p for which the slowest wave along a cut converges fastest.
    pub robin: Auto<f64>,
    /// The iteration ends once it changes no node by more than this share of the largest coordinate. Without a
    /// tolerance it ends after `iterations`, which is no failure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Number of iterations in a step; the largest number where there is a tolerance.
    pub iterations: usize,
    #[serde(skip)]
    line: Robust<1>,
    #[serde(skip)]
    parts: Parts<D, S>,
}

/// What neighbouring subdomains exchange.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Transmission {
    /// The positions of nodes.
    #[default]
    Classical,
    /// Robin's conditions, which take fewer iterations.
    #[serde(alias = "optimised")]
    Optimized,
}

/// A [`Schwarz`] as a study writes it.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Schwarz_{D}")]
struct Written<const D: usize> {
    /// Number of subdomains along each axis.
    subdomains: Axes<usize, D>,
    /// Cells that neighbouring subdomains share; 2 by default.
    overlap: Option<usize>,
    /// What neighbours exchange: positions (`"classical"`) or Robin's conditions (`"optimized"`).
    #[serde(default)]
    method: Transmission,
    /// p > 0 of Robin's condition ∂_n c + p c, which neighbours exchange with `method = "optimized"`: c is the
    /// correction of the mesh, and lengths are measured in the unit square of ξ. "auto" takes the p for which the
    /// slowest wave along a cut converges fastest.
    #[serde(default)]
    robin: Auto<f64>,
    /// Largest change of a node in the last iteration, as a share of the largest coordinate. 1e-10 where neither this
    /// nor `iterations` is given.
    tolerance: Option<f64>,
    /// Number of iterations in a step. With a tolerance it is the largest number, 1000 by default.
    iterations: Option<usize>,
}

impl<const D: usize, const S: usize> From<Written<D>> for Schwarz<D, S> {
    fn from(written: Written<D>) -> Self {
        let Written { subdomains, overlap, method, robin, tolerance, iterations } = written;
        let tolerance = if iterations.is_none() { tolerance.or(Some(TOLERANCE)) } else { tolerance };
        Self {
            method,
            robin,
            tolerance,
            iterations: iterations.unwrap_or(ITERATIONS),
            ..Self::new(*subdomains, overlap.unwrap_or(OVERLAP))
        }
    }
}

/// Number of cells that neighbouring subdomains share where a study gives none.
const OVERLAP: usize = 2;
/// Tolerance where a study gives neither this nor a number of iterations, as a share of the largest coordinate: far
/// below the shortest edge of any mesh.
const TOLERANCE: f64 = 1e-10;
/// Largest number of iterations where a study gives none.
const ITERATIONS: usize = 1000;

impl<const D: usize, const S: usize> Schwarz<D, S> {
    /// Overlapping subdomains with the default tolerance.
    pub fn new(subdomains: [usize; D], overlap: usize) -> Self {
        Self {
            subdomains: subdomains.into(),
            overlap,
            method: Transmission::Classical,
            robin: Auto::Auto,
            tolerance: Some(TOLERANCE),
            iterations: ITERATIONS,
            line: Robust::default(),
            parts: Parts::default(),
        }
    }

    /// Refuses settings out of range for a lattice.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn check(&self, lattice: &Lattice<D>) -> Result<()> {
        Decomposition::new(lattice, *self.subdomains)?;
        Ranks::here().check_subdomains(&*self.subdomains)?;
        if self.overlap == 0 {
            return Err(Error::invalid(
                "overlap",
                0,
                "without overlap the iteration does not converge; set it to 1 or more",
            ));
        }
        if let Some(tolerance) = self.tolerance.filter(|t| !(t.is_finite() && *t >= 1e-12)) {
            return Err(Error::invalid("tolerance", tolerance, "must be a finite number, 1e-12 or more"));
        }
        if self.iterations == 0 {
            return Err(Error::invalid("iterations", 0, "must be 1 or more"));
        }
        match self.robin {
            Auto::Value(p) if self.method == Transmission::Classical => Err(Error::invalid(
                "robin",
                p,
                "classical conditions have none; set method to \"optimized\", or leave it out",
            )),
            Auto::Value(p) if !(p.is_finite() && p > 0.0) => {
                Err(Error::invalid("robin", p, "p must be a finite number above 0, or \"auto\""))
            }
            _ => Ok(()),
        }
    }

    /// β across each axis.
    fn reflection(&self, equation: &Mmpde, lattice: &Lattice<D>, dt: f64) -> [f64; D] {
        let a = equation.stiffness(lattice, dt);
        std::array::from_fn(|d| {
            if let Auto::Value(p) = self.robin {
                return 1.0 / (1.0 + p * lattice.spacing()[d]);
            }
            let decay = |along: f64| (-(1.0 + (1.0 + along) / (2.0 * a[d])).acosh()).exp();
            let Some(e) = (0..D).find(|&e| e != d) else { return decay(0.0) };
            let waves = (1..=WAVES).map(|m| std::f64::consts::PI * m as f64 / WAVES as f64);
            let slow = std::f64::consts::PI / lattice.cells()[e] as f64;
            let z: Vec<f64> =
                (std::iter::once(slow).chain(waves)).map(|phi| decay(2.0 * a[e] * (1.0 - phi.cos()))).collect();
            let largest = |beta: f64| {
                let left = z.iter().map(|z| ((beta - z) / (1.0 - beta * z)).abs() * z.powi(self.overlap as i32 - 1));
                left.fold(0.0, f64::max)
            };
            let all = (0..TRIALS).map(|m| m as f64 / TRIALS as f64);
            all.min_by(|a, b| largest(*a).total_cmp(&largest(*b))).unwrap_or(0.0)
        })
    }
}

/// Number of waves along a cut among which p = "auto" looks for the one that converges slowest.
const WAVES: usize = 64;
/// Number of values of β among which p = "auto" looks for the one whose slowest wave converges fastest.
const TRIALS: usize = 200;

impl<const D: usize, const S: usize> Schwarz<D, S> {
    /// One step.
    fn advance(&mut self, equation: &Mmpde, mesh: &Mesh<D>, rho: &Density, dt: f64) -> Result<Moved<D>, Failure> {
        let lattice = mesh.lattice();
        self.parts.prepare(lattice, *self.subdomains, self.overlap)?;
        self.check(lattice).map_err(Failure::refusing)?;
        let operator = equation.operator(lattice, rho, dt)?;
        let mut x = mesh.x().to_vec();
        let mut work = move_sides(equation, mesh, rho, dt, &mut x, &mut self.line)?;
        let started = Instant::now();
        let (beta, predicted) = if self.method == Transmission::Optimized {
            (self.reflection(equation, lattice, dt), None)
        } else {
            let (predicted, cost) = self.parts.predict(&operator, mesh)?;
            work += cost;
            ([0.0; D], Some(predicted))
        };
        let seconds = started.elapsed().as_secs_f64();

        let residual = residual(&operator, mesh.x(), &x, mesh.jump());
        self.parts.set(&operator, &residual, beta);
        let size = size(mesh);
        let tolerance =
            self.tolerance.map(|tolerance| size.iter().fold(0.0, |most: f64, size| most.max(*size)) * tolerance);
        let mut c = vec![[0.0; D]; lattice.len()];
        let mut changes: Vec<f64> = Vec::new();
        loop {
            let (change, cost) = self.parts.iterate(&mut c, beta, size)?;
            work += cost;
            changes.push(change);
            let iterations = changes.len();
            if tolerance.is_some_and(|tolerance| change <= tolerance) || self.parts.rings() == 0 {
                break;
            }
            if iterations == self.iterations || !change.is_finite() {
                match tolerance {
                    None if change.is_finite() => break,
                    _ => {
                        let tolerance = tolerance.unwrap_or(f64::INFINITY);
                        return Err(Failure::SchwarzStalled { change, tolerance, iterations });
                    }
                }
            }
        }
        self.parts.share(&mut c);
        x.iter_mut().zip(&c).for_each(|(x, c)| (0..D).for_each(|k| x[k] += c[k]));
        let contraction = Some(Contraction { iterations: changes.len(), predicted, observed: observed(&changes) });
        let interface = Interface {
            points: self.parts.rings(),
            exchanges: changes.len(),
            read: self.parts.read(),
            contraction,
            seconds,
            ..Interface::default()
        };
        Ok(Moved { mesh: mesh.moved(x)?, work, interface: Some(interface) })
    }
}

impl MeshGenerator<1> for Schwarz<1, 3> {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<1>, rho: &Density, dt: f64) -> Result<Moved<1>, Failure> {
        self.advance(equation, mesh, rho, dt)
    }
}

impl MeshGenerator for Schwarz {
    fn solve(&mut self, equation: &Mmpde, mesh: &Mesh<2>, rho: &Density, dt: f64) -> Result<Moved, Failure> {
        self.advance(equation, mesh, rho, dt)
    }
}

/// The mean factor between successive changes. The first change is the step itself and does not count; later ones come
/// from corrections of the rings.
fn observed(changes: &[f64]) -> f64 {
    match changes {
        [_, second, .., last] if *second > 0.0 => (last / second).powf(1.0 / (changes.len() - 2) as f64),
        _ => 0.0,
    }
}
