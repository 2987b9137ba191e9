use super::surface::{Bilinear, Grid, Surface};
use super::{MonteCarlo, Problem};
use crate::elementary::ln;
use crate::meshing::Form;
use crate::numerics::difference::{Gradient, derivative};
use crate::random::uniform;

/// Number of paths that are computed side by side.
pub(super) const LANES: usize = 8;

/// One number for each of these paths.
pub(super) type Lanes = [f64; LANES];

/// The fields in which paths move, in units of the lattice spacing.
pub(super) struct Domain {
    grid: Grid,
    /// The drift b Δs.
    drift: Bilinear<2>,
    /// The standard deviation √(2Δs) of an increment along each axis.
    spread: [f64; 2],
    /// 1/Δs along each axis, which multiplies a product of two distances.
    sharpness: [f64; 2],
    /// ∇_ξ of both coordinates: x along ξ, x along η, y along ξ, y along η.
    slopes: Bilinear<4>,
    old: Surface,
    new: Surface,
    /// Substeps in the time step, over which a side moves from old to new.
    substeps: f64,
    /// Whether to subtract the martingale of the control variate.
    control: bool,
    /// Whether to weight exits instead of drawing them.
    weigh: bool,
    /// Exponent of a Brownian bridge above which it counts as not leaving.
    far: f64,
    /// The distance from a side beyond which the exponent is always above `far`.
    margin: [f64; 2],
}

/// The state of paths on their way.
struct Paths {
    at: [Lanes; 2],
    /// The weight of each path that has not left yet.
    inside: Lanes,
    martingale: [Lanes; 2],
    paid: [Lanes; 2],
}

impl Domain {
    pub fn new(problem: &Problem<'_>, settings: &MonteCarlo) -> Self {
        let substeps = settings.substeps;
        let (mesh, lattice) = (problem.mesh, problem.mesh.lattice());
        let ds = problem.dt / (problem.equation.relaxation.over(problem.dt) * substeps as f64);
        let n = lattice.cells().map(|n| n as f64);
        let gradient = match problem.equation.form {
            Form::Gradient(gradient) => gradient,
            Form::Conservative => Gradient::Log,
        };
        let b = gradient.of_log(lattice, problem.rho.largest());
        let drift: Vec<[f64; 2]> = b.iter().map(|b| [b[0] * n[0] * ds, b[1] * n[1] * ds]).collect();
        let jump = mesh.jump();
        let [along_xi, along_eta] = [0, 1].map(|d| derivative(lattice, mesh.x(), d, jump[d]));
        let slopes: Vec<[f64; 4]> = (along_xi.iter().zip(&along_eta))
            .map(|(a, b)| [a[0] / n[0], b[0] / n[1], a[1] / n[0], b[1] / n[1]])
            .collect();
        let weigh = settings.antithetic || settings.sobol || settings.control_variate;
        // weighted, e⁻⁴⁰ = 4e-18 does not count; drawn, no random number is below 2⁻³³ = e⁻²²·⁹
        let far: f64 = if weigh { 40.0 } else { 23.0 };
        Self {
            grid: Grid::new(lattice),
            drift: Bilinear::new(lattice, &drift),
            spread: n.map(|n| n * (2.0 * ds).sqrt()),
            sharpness: n.map(|n| 1.0 / (ds * n * n)),
            slopes: Bilinear::new(lattice, &slopes),
            old: Surface::new(lattice, mesh.x(), jump),
            new: Surface::new(lattice, problem.new, jump),
            substeps: substeps as f64,
            control: settings.control_variate,
            weigh,
            far,
            margin: n.map(|n| n * (far * ds).sqrt()),
        }
    }

    /// The sums that the first `count` paths collect, and the steps that they took together. `words` gives the random
    /// words of a step and side that decide their exits.
    #[inline(always)]
    pub fn walk(
        &self,
        from: [f64; 2],
        increments: &[[Lanes; 2]],
        count: usize,
        words: &dyn Fn(u32) -> [[u32; LANES]; 4],
    ) -> ([Lanes; 2], usize) {
        let mut paths = Paths {
            at: from.map(|x| [x; LANES]),
            inside: std::array::from_fn(|l| if l < count { 1.0 } else { 0.0 }),
            martingale: [[0.0; LANES]; 2],
            paid: [[0.0; LANES]; 2],
        };
        let mut steps = 0;
        for (step, w) in increments.iter().enumerate() {
            let walking = paths.inside.iter().filter(|&&inside| inside > 0.0).count();
            if walking == 0 {
                break;
            }
            steps += walking;
            let next = self.advance(&mut paths, w);
            for d in 0..2 {
                if self.grid.periodic[d] || !self.near(&paths, &next, d) {
                    continue;
                }
                for end in 0..2 {
                    let exponents = self.exponents(&paths, &next, d, end);
                    if exponents.iter().any(|&exponent| exponent <= self.far) {
                        let side = (2 * d + end) as u32;
                        let parts = self.parts(&exponents, || words(4 * step as u32 + side));
                        self.leave(&mut paths, &next, step, d, end, parts);
                    }
                }
            }
            paths.at = next;
        }
        for l in (0..count).filter(|&l| paths.inside[l] > 0.0) {
            let end = self.old.at(&self.grid.place([paths.at[0][l], paths.at[1][l]]));
            (0..2).for_each(|c| paths.paid[c][l] += paths.inside[l] * (end[c] - paths.martingale[c][l]));
        }
        (paths.paid, steps)
    }

    /// The next points of all paths, and their contributions to the control variate.
    #[inline(always)]
    fn advance(&self, paths: &mut Paths, w: &[Lanes; 2]) -> [Lanes; 2] {
        let (mut cell, mut share) = ([[0.0; LANES]; 2], [[0.0; LANES]; 2]);
        for d in 0..2 {
            for l in 0..LANES {
                let at = paths.at[d][l] - self.grid.turns(d, paths.at[d][l]) * self.grid.cells[d];
                cell[d][l] = self.grid.cell(d, at);
                share[d][l] = at - cell[d][l];
            }
        }
        let mut position = [0; LANES];
        for l in 0..LANES {
            position[l] = self.drift.position([cell[0][l], cell[1][l]]);
        }
        let mut drift = [[0.0; LANES]; 2];
        for l in 0..LANES {
            [drift[0][l], drift[1][l]] = self.drift.at(position[l], [share[0][l], share[1][l]]);
        }
        let noise = [0, 1].map(|d| w[d].map(|w| self.spread[d] * w));
        if self.control {
            for l in 0..LANES {
                let slope = self.slopes.at(position[l], [share[0][l], share[1][l]]);
                for c in 0..2 {
                    paths.martingale[c][l] += slope[2 * c] * noise[0][l] + slope[2 * c + 1] * noise[1][l];
                }
            }
        }
        [0, 1].map(|d| std::array::from_fn(|l| paths.at[d][l] + drift[d][l] + noise[d][l]))
    }

    /// Whether any path is so near to a side of axis d that it may leave.
    #[inline(always)]
    fn near(&self, paths: &Paths, next: &[Lanes; 2], d: usize) -> bool {
        // two distances of at least the margin have an exponent of at least `far`
        let (low, high) = (self.margin[d], self.grid.cells[d] - self.margin[d]);
        let mut near = false;
        for l in 0..LANES {
            let (at, next) = (paths.at[d][l], next[d][l]);
            near |= (at < low) | (next < low) | (at > high) | (next > high);
        }
        near
    }

    /// Distances from both sides across axis d.
    #[inline(always)]
    fn distances(&self, d: usize, x: f64) -> [f64; 2] {
        [x, self.grid.cells[d] - x]
    }

    /// −ln of the probability that a bridge from here to `next` meets a side; ∞ for paths that have left.
    #[inline(always)]
    fn exponents(&self, paths: &Paths, next: &[Lanes; 2], d: usize, end: usize) -> Lanes {
        let mut out = [0.0; LANES];
        for l in 0..LANES {
            let [before, after] = [paths.at[d][l], next[d][l]].map(|x| self.distances(d, x)[end]);
            out[l] = if paths.inside[l] > 0.0 { before * after * self.sharpness[d] } else { f64::INFINITY };
        }
        out
    }

    /// The weight of each path that leaves: all or nothing if drawn, a share if weighted.
    #[inline(always)]
    fn parts(&self, exponents: &Lanes, words: impl Fn() -> [[u32; LANES]; 4]) -> Lanes {
        let mut parts = [0.0; LANES];
        if self.weigh {
            for l in (0..LANES).filter(|&l| exponents[l] <= self.far) {
                parts[l] = (-exponents[l]).exp().min(1.0);
            }
        } else {
            let [words, ..] = words();
            for l in 0..LANES {
                parts[l] = if ln(uniform(words[l])) < -exponents[l] { 1.0 } else { 0.0 };
            }
        }
        parts
    }

    /// Adds, for the weights that leave on the way to `next`, the position on the side.
    #[inline(always)]
    fn leave(&self, paths: &mut Paths, next: &[Lanes; 2], step: usize, d: usize, end: usize, parts: Lanes) {
        for l in 0..LANES {
            let weight = paths.inside[l] * parts[l];
            if weight > 0.0 {
                let ends = [&paths.at, next].map(|x| [x[0][l], x[1][l]]);
                let exit = self.exit(ends, d, end, step);
                (0..2).for_each(|c| paths.paid[c][l] += weight * (exit[c] - paths.martingale[c][l]));
                paths.inside[l] *= 1.0 - parts[l];
            }
        }
    }

    /// The position on a side across axis d, where and when a path meets it.
    #[inline(always)]
    fn exit(&self, [at, next]: [[f64; 2]; 2], d: usize, end: usize, step: usize) -> [f64; 2] {
        let [before, after] = [at, next].map(|x| self.distances(d, x[d])[end]);
        let part = before / (before + after.abs()).max(f64::MIN_POSITIVE);
        let mut exit = [0, 1].map(|e| at[e] + part * (next[e] - at[e]));
        exit[d] = if end == 0 { 0.0 } else { self.grid.cells[d] };
        if !self.grid.periodic[1 - d] {
            exit[1 - d] = exit[1 - d].clamp(0.0, self.grid.cells[1 - d]);
        }
        let elapsed = (step as f64 + part) / self.substeps;
        let place = self.grid.place(exit);
        let (old, new) = (self.old.at(&place), self.new.at(&place));
        [0, 1].map(|c| new[c] + elapsed * (old[c] - new[c]))
    }
}
