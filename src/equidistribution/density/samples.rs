use crate::error::{Error, Result};

/// M at some places, linear between them and constant beyond.
#[derive(Clone)]
pub(super) struct Samples {
    x: Vec<f64>,
    m: Vec<f64>,
    /// ∫M from the first place to each.
    integral: Vec<f64>,
}

impl Samples {
    /// # Errors
    /// [`Error::Invalid`] as [`LineDensity::sampled`](super::LineDensity::sampled) says.
    pub fn new(x: Vec<f64>, m: Vec<f64>) -> Result<Self> {
        if x.len() < 2 || x.len() != m.len() {
            let rule = format!("must have two places or more and one value each, not {}", m.len());
            return Err(Error::invalid("density", format!("{} places", x.len()), rule));
        }
        if let Some(k) = (1..x.len()).find(|&k| {
            let twice = x[k] == x[k - 1] && k > 1 && x[k] > x[k - 2] && k + 1 < x.len();
            !((x[k] > x[k - 1] || twice) && (x[k] - x[0]).is_finite())
        }) {
            let rule = format!(
                "places must be finite and grow from left to right, twice the same where M jumps; place {} is {}",
                k - 1,
                x[k - 1]
            );
            return Err(Error::invalid("density", format!("at {} in place {k}", x[k]), rule));
        }
        if let Some(k) = m.iter().position(|m| !(m.is_finite() && *m > 0.0)) {
            return Err(Error::invalid("density", format!("{} at {}", m[k], x[k]), "it must be finite and above 0"));
        }
        let mut integral = vec![0.0];
        let mut sum = 0.0;
        for k in 1..x.len() {
            sum += 0.5 * (m[k - 1] + m[k]) * (x[k] - x[k - 1]);
            integral.push(sum);
        }
        Ok(Self { x, m, integral })
    }

    /// The interval that x lies in, and the distance of x from its beginning.
    fn place(&self, x: f64) -> (usize, f64) {
        let k = self.x.partition_point(|at| *at <= x).clamp(1, self.x.len() - 1) - 1;
        (k, x - self.x[k])
    }

    /// M_x on interval k.
    fn slope(&self, k: usize) -> f64 {
        (self.m[k + 1] - self.m[k]) / (self.x[k + 1] - self.x[k])
    }

    /// M and M_x.
    pub fn at(&self, x: f64) -> [f64; 2] {
        let (k, along) = self.place(x);
        match x.clamp(self.x[0], self.x[self.x.len() - 1]) {
            end if end != x => [self.m[if along < 0.0 { 0 } else { k + 1 }], 0.0],
            _ => [self.m[k] + along * self.slope(k), self.slope(k)],
        }
    }

    /// ∫M from the first place to x.
    pub fn up_to(&self, x: f64) -> f64 {
        let inside = x.clamp(self.x[0], self.x[self.x.len() - 1]);
        let (k, along) = self.place(inside);
        self.integral[k] + along * (self.m[k] + 0.5 * along * self.slope(k)) + (x - inside) * self.at(x)[0]
    }

    /// The places between a and b with these two themselves: M is linear between neighbours.
    pub fn breaks(&self, a: f64, b: f64) -> Vec<f64> {
        let mut breaks = vec![a];
        breaks.extend(self.x.iter().filter(|x| **x > a && **x < b));
        breaks.push(b);
        breaks.dedup();
        breaks
    }

    /// M at the ends of a piece on which it is linear, as limits from inside the piece.
    pub fn between(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let middle = 0.5 * (a + b);
        let ([m, slope], half) = (self.at(middle), 0.5 * (b - a));
        [m - half * slope, m + half * slope]
    }
}
