use super::LineDensity;
use crate::error::Failure;

/// The way of a Newton step along which ∫M, not x, changes evenly
///
/// In g = ∫M the steady problem is linear, whatever M is. A step δ from x that overshoots where M varies goes straight in
/// g:  G(x(s)) = G(x) + s M(x) δ,  G the piecewise linear interpolant of ∫M at equal places.
#[derive(Debug, Clone)]
pub(super) struct Path {
    first: f64,
    spacing: f64,
    g: Vec<f64>,
}

/// Pieces of the interpolant.
const PIECES: usize = 4096;

impl Path {
    pub fn new(density: &LineDensity, t: f64, [a, b]: [f64; 2]) -> Result<Self, Failure> {
        let spacing = (b - a) / PIECES as f64;
        let middles: Vec<f64> = (0..PIECES).map(|k| a + (k as f64 + 0.5) * spacing).collect();
        let mut g = vec![0.0];
        let mut sum = 0.0;
        for [m, _] in density.at_each(t, &middles)? {
            sum += m * spacing;
            g.push(sum);
        }
        Ok(Self { first: a, spacing, g })
    }

    /// Where x comes as ∫M changes by so much.
    pub fn along(&self, x: f64, change: f64) -> f64 {
        // beyond the ends G goes on as in their pieces
        let piece = |k: f64| k.clamp(0.0, (PIECES - 1) as f64) as usize;
        let slope = |k: usize| (self.g[k + 1] - self.g[k]) / self.spacing;
        let place = |k: usize| self.first + k as f64 * self.spacing;
        let k = piece(((x - self.first) / self.spacing).floor());
        let g = self.g[k] + slope(k) * (x - place(k)) + change;
        let k = piece(self.g.partition_point(|at| *at <= g) as f64 - 1.0);
        place(k) + (g - self.g[k]) / slope(k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Straight where M is constant, slower where it is large; what goes and comes back is where it was.
    #[test]
    fn moves_along_the_integral() {
        let path = |m: &str| Path::new(&LineDensity::formula(m).unwrap(), 0.0, [0.0, 2.0]).unwrap();
        let even = path("3");
        for (x, change) in [(0.5, 0.7), (1.5, -1.2), (1.9, 0.5), (0.1, -0.4)] {
            assert!((even.along(x, 3.0 * change) - (x + change)).abs() < 1e-12);
        }
        // ∫M = x²
        assert!((path("2*x + 1e-9").along(0.5, 0.5) - 0.75_f64.sqrt()).abs() < 1e-6);
    }
}
