use super::paths::{LANES, Lanes};
use super::{MonteCarlo, Problem};
use crate::elementary::ln;
use crate::meshing::Form;
use crate::numerics::difference::{Gradient, derivative};
use crate::random::uniform;

/// The fields in which paths move on a line, in units of the lattice spacing.
pub(super) struct Segment {
    cells: usize,
    periodic: bool,
    /// The drift b Δs at the nodes, a periodic line with its first node again at the end.
    drift: Vec<f64>,
    /// x_ξ at the same nodes.
    slopes: Vec<f64>,
    /// x at the nodes −1 … cells + 1.
    places: Vec<f64>,
    /// Length of the line, by which x grows with each turn around a periodic one.
    length: f64,
    /// The standard deviation √(2Δs) of an increment.
    spread: f64,
    /// 1/Δs, which multiplies a product of two distances.
    sharpness: f64,
    /// Whether to subtract the martingale of the control variate.
    control: bool,
    /// Whether to weight exits instead of drawing them.
    weigh: bool,
    /// Exponent of a Brownian bridge above which it counts as not leaving.
    far: f64,
}

/// A path on its way.
struct Path {
    at: f64,
    /// The weight that has not left yet.
    inside: f64,
    martingale: f64,
    paid: f64,
}

impl Segment {
    pub fn new(problem: &Problem<'_, 1>, settings: &MonteCarlo) -> Self {
        let (mesh, lattice) = (problem.mesh, problem.mesh.lattice());
        let ds = problem.dt / (problem.equation.relaxation.over(problem.dt) * settings.substeps as f64);
        let ([cells], [periodic], [[length]]) = (lattice.cells(), lattice.periodic(), mesh.jump());
        let n = cells as f64;
        let gradient = match problem.equation.form {
            Form::Gradient(gradient) => gradient,
            Form::Conservative => Gradient::Log,
        };
        let of_nodes = |values: Vec<[f64; 1]>, scale: f64| -> Vec<f64> {
            lattice.closed(&values).iter().map(|[value]| scale * value).collect()
        };
        let weigh = settings.antithetic || settings.sobol || settings.control_variate;
        Self {
            cells,
            periodic,
            drift: of_nodes(gradient.of_log(lattice, problem.rho.largest()), n * ds),
            slopes: of_nodes(derivative(lattice, mesh.x(), 0, [length]), 1.0 / n),
            places: around(mesh.x().as_flattened(), periodic, length),
            length,
            spread: n * (2.0 * ds).sqrt(),
            sharpness: 1.0 / (ds * n * n),
            control: settings.control_variate,
            weigh,
            // weighted, e⁻⁴⁰ = 4e-18 does not count; drawn, no random number is below 2⁻³³ = e⁻²²·⁹
            far: if weigh { 40.0 } else { 23.0 },
        }
    }

    /// The sums that the first `count` paths collect, and the steps that they took together. `words` gives the random
    /// words of a step and end that decide their exits.
    pub fn walk(
        &self,
        [from]: [f64; 1],
        increments: &[[Lanes; 2]],
        count: usize,
        words: &dyn Fn(u32) -> [[u32; LANES]; 4],
    ) -> ([Lanes; 1], usize) {
        let (mut paid, mut steps) = ([0.0; LANES], 0);
        for (l, paid) in paid.iter_mut().enumerate().take(count) {
            let mut path = Path { at: from, inside: 1.0, martingale: 0.0, paid: 0.0 };
            for (step, [w, _]) in increments.iter().enumerate() {
                if path.inside <= 0.0 {
                    break;
                }
                steps += 1;
                self.advance(&mut path, w[l], |end| words(4 * step as u32 + end)[0][l]);
            }
            *paid = path.paid + path.inside * (self.place(path.at) - path.martingale);
        }
        ([paid], steps)
    }

    /// One step of a path, for a standard normal number.
    fn advance(&self, path: &mut Path, w: f64, word: impl Fn(u32) -> u32) {
        let noise = self.spread * w;
        let next = path.at + self.linear(&self.drift, path.at) + noise;
        if self.control {
            path.martingale += self.linear(&self.slopes, path.at) * noise;
        }
        let n = self.cells as f64;
        for end in (0..2).filter(|_| !self.periodic) {
            let [before, after] = [path.at, next].map(|x| if end == 0 { x } else { n - x });
            let exponent = before * after * self.sharpness;
            if exponent > self.far || path.inside <= 0.0 {
                continue;
            }
            let part = match self.weigh {
                true => (-exponent).exp().min(1.0),
                false => f64::from(u8::from(ln(uniform(word(end))) < -exponent)),
            };
            let exit = self.places[if end == 0 { 1 } else { self.cells + 1 }];
            path.paid += path.inside * part * (exit - path.martingale);
            path.inside *= 1.0 - part;
        }
        path.at = next;
    }

    /// Turns around a periodic line, the cell of a point and its share of that cell; the first or the last cell for a
    /// point outside a bounded line.
    fn cell(&self, at: f64) -> (f64, usize, f64) {
        let n = self.cells as f64;
        let turns = if self.periodic { (at / n).floor() } else { 0.0 };
        let at = at - turns * n;
        let cell = at.floor().clamp(0.0, n - 1.0);
        (turns, cell as usize, at - cell)
    }

    fn linear(&self, values: &[f64], at: f64) -> f64 {
        let (_, cell, share) = self.cell(at);
        values[cell] + share * (values[cell + 1] - values[cell])
    }

    /// x by the cubic through two nodes on either side.
    fn place(&self, at: f64) -> f64 {
        let (turns, cell, s) = self.cell(at);
        let (before, after, beyond) = (s + 1.0, s - 1.0, s - 2.0);
        let weights = [
            -s * after * beyond / 6.0,
            0.5 * before * after * beyond,
            -0.5 * before * s * beyond,
            before * s * after / 6.0,
        ];
        turns * self.length + weights.iter().zip(&self.places[cell..]).map(|(weight, x)| weight * x).sum::<f64>()
    }
}

/// Values at the nodes −1 … cells + 1: images on a periodic line, and the cubic through the nearest four nodes, or the
/// parabola through three, beyond the ends of a bounded one.
fn around(x: &[f64], periodic: bool, length: f64) -> Vec<f64> {
    let n = x.len();
    let (below, above): (f64, Vec<f64>) = match periodic {
        true => (x[n - 1] - length, vec![x[0] + length, if n == 1 { x[0] + 2.0 * length } else { x[1] + length }]),
        false => {
            let back: Vec<f64> = x.iter().rev().copied().collect();
            (extrapolated(x), vec![extrapolated(&back)])
        }
    };
    [vec![below], x.to_vec(), above].concat()
}

/// The value before the first of at least three.
fn extrapolated(x: &[f64]) -> f64 {
    match x {
        [a, b, c, d, ..] => 4.0 * a - 6.0 * b + 4.0 * c - d,
        _ => 3.0 * x[0] - 3.0 * x[1] + x[2],
    }
}
