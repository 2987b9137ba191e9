//! Burgers' equation by differences at the nodes.

use super::{Burgers, Convection};
use crate::error::Failure;
use crate::geometry::{Field, Patch, check_finite};
use crate::numerics::larger;
use crate::numerics::linear::{LatticeMatrix, LinearSolver};
use crate::parallel;
use crate::physics::Motion;
use crate::physics::curvilinear::Stencils;
use crate::work::Work;

/// Newton's method has converged once the largest residual is below this; u is of size one.
const TOLERANCE: f64 = 1e-10;
/// Number of Newton steps after which a time step is given up.
const MAX_NEWTON: usize = 20;

/// R at one node: the coefficients of its linear part on the nine points, and those of ∂_x + ∂_y for the convection.
#[derive(Clone, Copy)]
struct Row {
    linear: [f64; 9],
    flux: [f64; 4],
    convection: Convection,
}

impl Row {
    const ZERO: Self = Self { linear: [0.0; 9], flux: [0.0; 4], convection: Convection::Conservative };

    fn value(&self, u: &[f64; 9]) -> f64 {
        let linear: f64 = self.linear.iter().zip(u).map(|(l, u)| l * u).sum();
        let star = self.flux.iter().zip(&u[1..5]);
        linear
            - match self.convection {
                Convection::Conservative | Convection::Flux => 0.5 * star.map(|(s, u)| s * u * u).sum::<f64>(),
                Convection::Advective => u[0] * star.map(|(s, u)| s * u).sum::<f64>(),
            }
    }

    fn derivative(&self, u: &[f64; 9]) -> [f64; 9] {
        let mut row = self.linear;
        for (k, s) in self.flux.iter().enumerate() {
            match self.convection {
                Convection::Conservative | Convection::Flux => row[k + 1] -= s * u[k + 1],
                Convection::Advective => {
                    row[k + 1] -= s * u[0];
                    row[0] -= s * u[k + 1];
                }
            }
        }
        row
    }
}

/// The nodes within the sides while a step goes on.
struct Inside {
    patch: Patch<2>,
    dt: f64,
    /// Offsets of the nine points of a stencil in padded vectors.
    offsets: [isize; 9],
    /// Velocity of the nodes, padded.
    velocity: Vec<[f64; 2]>,
}

impl Inside {
    fn around(&self, u: &[[f64; 1]], k: usize) -> [f64; 9] {
        self.offsets.map(|o| u[k.wrapping_add_signed(o)][0])
    }

    /// Sets one entry for each node from its index and its place in padded vectors, in parallel by rows.
    fn set<T: Send>(&self, entries: &mut [T], value: impl Fn(usize, usize) -> T + Sync) {
        let n = self.patch.pencil_len();
        parallel::for_each_row(entries, n, |p, entries| {
            for (entry, (i, k)) in entries.iter_mut().zip((p * n..).zip(self.patch.pencil(p)..)) {
                *entry = value(i, k);
            }
        });
    }

    /// R of all nodes on a mesh with these stencils.
    fn rows(&self, burgers: &Burgers, stencils: &Stencils) -> Vec<Row> {
        let mut rows = vec![Row::ZERO; self.patch.len()];
        self.set(&mut rows, |i, k| burgers.row(&stencils.gradient[i], &stencils.laplacian[i], self.velocity[k]));
        rows
    }
}

impl Burgers {
    /// A step of the difference forms.
    pub(super) fn step_by_differences(&mut self, motion: Motion<'_>, u: &Field) -> Result<(Field, Work), Failure> {
        let Motion { t, dt, old, new } = motion;
        let lattice = new.lattice();
        let patch = Patch::whole(lattice);
        let jump = new.jump();
        let [x_old, x_new] = [old, new].map(|mesh| patch.gather(lattice, mesh.x(), jump));
        let velocity = x_old.iter().zip(&x_new).map(|(a, b)| [0, 1].map(|d| (b[d] - a[d]) / dt)).collect();
        let inside = Inside { patch, dt, offsets: LatticeMatrix::<2, 9>::zero(patch).offsets(), velocity };

        // the first half of the step, from known values
        let stencils_old = match self.newest.take() {
            Some((mesh, stencils)) if mesh == *old => stencils,
            _ => Stencils::new(&patch, &x_old),
        };
        let u_old = patch.gather(lattice, u.values().as_chunks::<1>().0, [[0.0]; 2]);
        let rows = inside.rows(self, &stencils_old);
        let mut known = vec![0.0; patch.len()];
        inside.set(&mut known, |i, k| u_old[k][0] + 0.5 * dt * rows[i].value(&inside.around(&u_old, k)));

        // the second half, from new side values and, as a first guess, the old values inside
        let stencils = Stencils::new(&patch, &x_new);
        let rows = inside.rows(self, &stencils);
        let mut solution = u.clone();
        for k in lattice.sides() {
            // a side without a formula keeps its values
            solution.values_mut()[k] = self.side_value(t + dt, new.image(new.x()[k])).unwrap_or(u.values()[k]);
        }
        let mut u_new = patch.gather(lattice, solution.values().as_chunks::<1>().0, [[0.0]; 2]);
        let (work, stalled) = self.newton(&inside, &rows, &known, &mut u_new)?;
        patch.scatter(lattice, &u_new, solution.values_mut().as_chunks_mut::<1>().0, [[0.0]; 2]);
        check_finite(["u"], new, solution.values().as_chunks().0)?;
        self.newest = Some((new.clone(), stencils));
        stalled.map_or(Ok((solution, work)), Err)
    }

    /// Newton's method for the padded values `u` at the end of a step; with why it did not converge, where it did not.
    fn newton(
        &mut self,
        inside: &Inside,
        rows: &[Row],
        known: &[f64],
        u: &mut [[f64; 1]],
    ) -> Result<(Work, Option<Failure>), Failure> {
        let Inside { patch, dt, .. } = inside;
        let mut matrix = LatticeMatrix::<2, 9>::zero(*patch);
        let size = u.iter().fold(1.0, |m, [u]| larger(m, *u));
        // where Δt·ν/h² is large, round-off alone leaves residuals above the tolerance
        let stiffest = rows.iter().fold(0.0, |m, row| larger(m, row.linear.iter().map(|l| l.abs()).sum()));
        let wanted = size * TOLERANCE.max(8.0 * f64::EPSILON * (1.0 + dt * stiffest));
        let mut work = Work::default();
        let mut residual = vec![[0.0]; patch.len()];
        loop {
            inside.set(&mut residual, |i, k| [known[i] - u[k][0] + 0.5 * dt * rows[i].value(&inside.around(u, k))]);
            let largest = residual.iter().fold(0.0, |m, [r]| larger(m, *r));
            if largest <= wanted {
                return Ok((work, None));
            }
            let iterations = work.newton_iterations;
            if iterations == MAX_NEWTON || !largest.is_finite() {
                let stalled = Failure::NewtonStalled { residual: largest, tolerance: wanted, iterations };
                return Ok((work, Some(stalled)));
            }
            inside.set(&mut matrix.rows, |i, k| {
                let mut entries = rows[i].derivative(&inside.around(u, k)).map(|d| -0.5 * dt * d);
                entries[0] += 1.0;
                entries
            });
            let mut correction = vec![[0.0]; patch.padded_len()];
            // Newton's method squares the residual, so that a much more accurate linear solve is wasted
            let tolerance = [(0.01 * largest * (largest / size).min(1.0)).max(0.1 * wanted)];
            work += self.solver.solve(&matrix, &residual, &mut correction, tolerance)?;
            work.newton_iterations += 1;
            u.iter_mut().zip(&correction).for_each(|(u, c)| u[0] += c[0]);
        }
    }

    /// R at one node that moves with velocity v.
    fn row(&self, gradient: &[[f64; 2]; 4], laplacian: &[f64; 9], v: [f64; 2]) -> Row {
        let mut linear = laplacian.map(|w| self.viscosity * w);
        for (l, g) in linear[1..5].iter_mut().zip(gradient) {
            *l += v[0] * g[0] + v[1] * g[1];
        }
        Row { linear, flux: gradient.map(|g| g[0] + g[1]), convection: self.convection }
    }
}
