use crate::error::{Error, Result};
use libm::{erf, erfc};
use std::f64::consts::PI;

/// Two-phase solutions that depend on one coordinate over √t alone
///
/// ```text
/// planar:       u₁ = T₁ (1 − erf(s/2√(D₁t)) / erf(λ/√D₁))              u₀ = T₀ (1 − erfc(s/2√(D₀t)) / erfc(λ/√D₀))
/// line source:  u₁ = Q/(4πD₁) (E₁(r²/4D₁t) − E₁(λ²/D₁))                u₀ = T₀ (1 − E₁(r²/4D₀t) / E₁(λ²/D₀))
/// ```
///
/// with the front at s = 2λ√t or r = 2λ√t. s is the distance from a wall that rises to the right by an angle, r the
/// distance from the source; λ follows from the condition on the front.
///
/// # Example
/// ```
/// use driftmesh::stefan::Similarity;
/// let exact = Similarity::planar([1.0, -0.5], [1.0, 1.0], 1.0, 0.0, 0.0)?;
/// assert!((exact.lambda() - 0.469851).abs() < 1e-6);
/// # Ok::<(), driftmesh::Error>(())
/// ```
///
/// # Source
/// Carslaw and Jaeger, *Conduction of heat in solids* (1959), 11.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    shape: Shape,
    /// Temperature of the cold phase, far away.
    far: f64,
    /// Diffusivities of the warm and of the cold phase.
    diffusivity: [f64; 2],
    lambda: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    /// Temperature of the wall; sine and cosine of its angle; its distance from the origin.
    Planar {
        wall: f64,
        tilt: [f64; 2],
        offset: f64,
    },
    LineSource {
        strength: f64,
        centre: [f64; 2],
    },
}

impl Similarity {
    /// Neumann's solution: temperatures at the wall and far away, diffusivities below and above the front, mobility,
    /// tilt in degrees, offset of the wall.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless the wall is warm, the other end not, and the tilt below 60 degrees.
    pub fn planar([wall, far]: [f64; 2], diffusivity: [f64; 2], mobility: f64, tilt: f64, offset: f64) -> Result<Self> {
        positive("wall", wall)?;
        cold(far)?;
        if tilt.is_nan() || tilt.abs() > 60.0 {
            return Err(Error::invalid("tilt", tilt, "must be between -60 and 60 degrees"));
        }
        if !offset.is_finite() {
            return Err(Error::invalid("offset", offset, "must be a finite number"));
        }
        let [warm, ice] = diffusivity.map(f64::sqrt);
        let lambda = root(|l| {
            let (w, i) = (l / warm, l / ice);
            let melting = wall * warm * (-w * w).exp() / erf(w);
            let freezing = far * ice / scaled_erfc(i);
            l - mobility / PI.sqrt() * (melting + freezing)
        });
        let lambda = within_reach(lambda, ["wall", "far"], [wall, far])?;
        let (sin, cos) = tilt.to_radians().sin_cos();
        Ok(Self { shape: Shape::Planar { wall, tilt: [sin, cos], offset }, far, diffusivity, lambda })
    }

    /// Melting around a line: heat given off per length and time, temperature far away, diffusivities below and above
    /// the front, mobility, place of the line.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless the strength is positive and the temperature far away not.
    pub fn line_source(
        strength: f64,
        far: f64,
        diffusivity: [f64; 2],
        mobility: f64,
        centre: [f64; 2],
    ) -> Result<Self> {
        positive("strength", strength)?;
        cold(far)?;
        if !centre.iter().all(|c| c.is_finite()) {
            return Err(Error::invalid("centre", format!("{centre:?}"), "must be two finite numbers"));
        }
        let [warm, ice] = diffusivity;
        let lambda = root(|l| {
            let z = l * l;
            let melting = strength / (4.0 * PI) * (-z / warm).exp();
            let freezing = far * ice / scaled_e1(z / ice);
            z - mobility * (melting + freezing)
        });
        let lambda = within_reach(lambda, ["strength", "far"], [strength, far])?;
        Ok(Self { shape: Shape::LineSource { strength, centre }, far, diffusivity, lambda })
    }

    /// The point where the solution is singular, if there is one: a line source.
    pub fn source(&self) -> Option<[f64; 2]> {
        match self.shape {
            Shape::Planar { .. } => None,
            Shape::LineSource { centre, .. } => Some(centre),
        }
    }

    /// λ.
    pub fn lambda(&self) -> f64 {
        self.lambda
    }

    /// The time at which the front is this far from the wall or the source.
    pub fn time(&self, distance: f64) -> f64 {
        (distance / (2.0 * self.lambda)).powi(2)
    }

    /// Height of the front at x; NaN where there is no front above x.
    pub fn height(&self, x: f64, t: f64) -> f64 {
        let s = 2.0 * self.lambda * t.sqrt();
        match self.shape {
            Shape::Planar { tilt: [sin, cos], offset, .. } => (s + offset + x * sin) / cos,
            Shape::LineSource { centre, .. } => centre[1] + (s * s - (x - centre[0]).powi(2)).sqrt(),
        }
    }

    /// Temperature.
    pub fn temperature(&self, [x, y]: [f64; 2], t: f64) -> f64 {
        let front = 2.0 * self.lambda * t.sqrt();
        let [warm, ice] = self.diffusivity;
        match self.shape {
            Shape::Planar { wall, tilt: [sin, cos], offset } => {
                let s = y * cos - x * sin - offset;
                let over = |d: f64| s / (2.0 * (d * t).sqrt());
                match s <= front {
                    true => wall * (1.0 - erf(over(warm)) / erf(self.lambda / warm.sqrt())),
                    false => {
                        // both vanish far away, but their ratio does not
                        let [a, b] = [over(ice), self.lambda / ice.sqrt()];
                        self.far * (1.0 - (b * b - a * a).exp() * scaled_erfc(a) / scaled_erfc(b))
                    }
                }
            }
            Shape::LineSource { strength, centre } => {
                let r2 = (x - centre[0]).powi(2) + (y - centre[1]).powi(2);
                let (over, z) = (|d: f64| r2 / (4.0 * d * t), self.lambda * self.lambda);
                match r2 <= front * front {
                    true => strength / (4.0 * PI * warm) * (e1(over(warm)) - e1(z / warm)),
                    false => {
                        let [a, b] = [over(ice), z / ice];
                        self.far * (1.0 - (b - a).exp() * scaled_e1(a) / scaled_e1(b))
                    }
                }
            }
        }
    }
}

fn positive(key: &str, value: f64) -> Result<()> {
    match value > 0.0 && value.is_finite() {
        true => Ok(()),
        false => Err(Error::invalid(key, value, "must be above 0: the lower phase is the warm one")),
    }
}

fn cold(far: f64) -> Result<()> {
    match far <= 0.0 && far.is_finite() {
        true => Ok(()),
        false => Err(Error::invalid("far", far, "must be 0 or below: the upper phase is the cold one")),
    }
}

/// The root of a function that is negative near 0 and increases; 0 or infinity where it is out of the range of numbers.
fn root(f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (1e-12, 1.0);
    if f(low) > 0.0 {
        return 0.0;
    }
    while f(high).is_nan() || f(high) <= 0.0 {
        high *= 2.0;
        if high > 1e6 {
            return f64::INFINITY;
        }
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle) > 0.0 { high = middle } else { low = middle }
    }
    high
}

/// λ, or an error for the setting that makes the front too fast or too slow.
fn within_reach(lambda: f64, [warm, cold]: [&'static str; 2], [heat, far]: [f64; 2]) -> Result<f64> {
    if lambda == 0.0 {
        return Err(Error::invalid(cold, far, "gives a front that hardly moves; bring it nearer to 0"));
    }
    if lambda.is_infinite() {
        return Err(Error::invalid(warm, heat, "gives a front that runs away; bring it nearer to 0"));
    }
    Ok(lambda)
}

/// e^(z²) erfc z for z ≥ 0, which stays finite where erfc underflows.
fn scaled_erfc(z: f64) -> f64 {
    if z < 20.0 { (z * z).exp() * erfc(z) } else { (1.0 - 0.5 / (z * z)) / (z * PI.sqrt()) }
}

/// The exponential integral E₁(z) = ∫_z^∞ e^−t/t dt, z > 0.
fn e1(z: f64) -> f64 {
    (-z).exp() * scaled_e1(z)
}

/// e^z E₁(z), by a series up to z = 1 and a continued fraction beyond.
fn scaled_e1(z: f64) -> f64 {
    const EULER: f64 = 0.577_215_664_901_532_9;
    if z <= 1.0 {
        let (mut term, mut sum) = (1.0, 0.0);
        for k in 1..40 {
            term *= -z / f64::from(k);
            sum -= term / f64::from(k);
        }
        z.exp() * (sum - EULER - z.ln())
    } else {
        // 1/(z + 1 − 1/(z + 3 − 4/(z + 5 − …))) from the end
        let mut tail = 0.0;
        for k in (1..200).rev() {
            let k = f64::from(k);
            tail = k * k / (z + 2.0 * k + 1.0 - tail);
        }
        1.0 / (z + 1.0 - tail)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of Abramowitz and Stegun, table 5.1, and the meeting of both branches.
    #[test]
    fn exponential_integral() {
        for (z, expected) in
            [(0.5, 0.559_773_594_776_160_1), (1.0, 0.219_383_934_395_520_3), (2.0, 0.048_900_510_708_061_12)]
        {
            assert!((e1(z) / expected - 1.0).abs() < 1e-13, "{z}: {}", e1(z));
        }
        assert!((e1(1.0) / e1(1.0 + 1e-12) - 1.0).abs() < 1e-11);
    }

    #[test]
    fn fronts_move_at_the_published_rates() {
        let planar = Similarity::planar([1.0, -0.5], [1.0; 2], 1.0, 0.0, 0.0).unwrap();
        assert!((planar.lambda() - 0.469851).abs() < 5e-7);
        let source = Similarity::line_source(8.0, -0.3, [1.0; 2], 1.0, [0.0, -0.5]).unwrap();
        assert!((source.lambda() - 0.511282).abs() < 5e-7);
    }

    /// Temperatures are finite, and steepen where they should, for diffusivities that differ by many orders.
    #[test]
    fn diffusivities_may_differ_by_orders_of_magnitude() {
        // cold that spreads fast stops the melting around a line unless there is little of it
        assert!(Similarity::line_source(8.0, -0.3, [1.0, 3000.0], 1.0, [0.0, -0.5]).is_err());
        for (d, far) in [([1.0, 1e-4], -0.3), ([3000.0, 1.0], -0.3), ([1.0, 3000.0], -3e-3), ([1e-6, 1.0], -0.3)] {
            for exact in [
                Similarity::planar([1.0, -0.5], d, 1.0, 0.0, 0.0).unwrap(),
                Similarity::line_source(8.0, far, d, 1.0, [0.0, -0.5]).unwrap(),
            ] {
                let t = exact.time(1.0);
                let h = exact.height(0.0, t);
                let cold: Vec<f64> =
                    (0..50).map(|k| exact.temperature([0.0, h * (1.0 + 0.04 * f64::from(k))], t)).collect();
                assert!(cold.iter().all(|u| u.is_finite()), "{d:?}: {cold:?}");
                assert!(cold[0].abs() < 1e-9 && cold.windows(2).all(|u| u[1] <= u[0]), "{d:?}: {cold:?}");
            }
        }
    }

    /// h_t = L (D₀ u₀_ν − D₁ u₁_ν) by differences, with all parameters different from one.
    #[test]
    fn the_front_condition_holds() {
        let (d, mobility) = ([2.0, 0.7], 0.4);
        for exact in [
            Similarity::planar([1.3, -0.4], d, mobility, 0.0, 0.1).unwrap(),
            Similarity::line_source(5.0, -0.2, d, mobility, [0.0, -0.5]).unwrap(),
        ] {
            let (t, e) = (0.3, 1e-4);
            let h = exact.height(0.0, t);
            let speed = (exact.height(0.0, t + e) - exact.height(0.0, t - e)) / (2.0 * e);
            let u = |y: f64| exact.temperature([0.0, y], t);
            assert!(u(h).abs() < 1e-12);
            let one_sided = |e: f64| (4.0 * u(h + e) - u(h + 2.0 * e)) / (2.0 * e);
            let jump = mobility * (d[1] * one_sided(e) - d[0] * one_sided(-e));
            assert!((speed / jump - 1.0).abs() < 1e-5, "{speed} {jump}");
        }
    }
}
