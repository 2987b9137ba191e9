use super::columns::{LOWER, UPPER};
use super::material::Material;
use crate::error::{Error, Result};
use libm::{erf, erfc};
use std::f64::consts::PI;

/// Two-phase solutions that depend on one coordinate over √t alone
///
/// ```text
/// planar:       u₁ = T₁ (1 − erf(s/2√(D₁t)) / erf(λ/√D₁))              u₀ = T₀ (1 − erfc(s/2√(D₀t)) / erfc(λ/√D₀))
/// line source:  u₁ = Q/(4πk₁) (E₁(r²/4D₁t) − E₁(λ²/D₁))                u₀ = T₀ (1 − E₁(r²/4D₀t) / E₁(λ²/D₀))
/// ```
///
/// and growth into a melt below its melting temperature, in which u₁ = 0 and u₀ is as above, flat or around a centre;
/// with temperatures above that of melting, and the front at s = 2λ√t or r = 2λ√t. s is the distance from a wall that
/// rises to the right by an angle, r the distance from the source; λ follows from the condition on the front.
///
/// # Example
/// ```
/// use driftmesh::stefan::{Material, Similarity};
/// let material = Material::diffusing([1.0, 1.0], 1.0)?;
/// let exact = Similarity::planar([1.0, -0.5], material, 0.0, 0.0)?;
/// assert!((exact.lambda() - 0.469851).abs() < 1e-6);
/// # Ok::<(), driftmesh::Error>(())
/// ```
///
/// # Source
/// Carslaw and Jaeger, *Conduction of heat in solids* (1959), 11.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    shape: Shape,
    /// Temperature of the cold phase, far away, above that of melting.
    far: f64,
    material: Material,
    lambda: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    /// Temperature of the wall above that of melting; sine and cosine of its angle; its distance from the origin.
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
    /// Neumann's solution: temperatures at the wall and far away, tilt in degrees, offset of the wall.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless the wall is warm, the other end not, and the tilt below 60 degrees.
    pub fn planar([wall, far]: [f64; 2], material: Material, tilt: f64, offset: f64) -> Result<Self> {
        let given = [wall, far];
        warm("wall", wall, material.melting)?;
        cold(far, material.melting)?;
        let [wall, far] = given.map(|u| u - material.melting);
        let [sin, cos] = tilted(tilt, offset)?;
        let [warm, ice] = [LOWER, UPPER].map(|phase| material.diffusivity(phase).sqrt());
        let [warm_k, ice_k] = material.conductivity;
        let lambda = root(|l| {
            let (w, i) = (l / warm, l / ice);
            let melting = wall * warm_k / warm * (-w * w).exp() / erf(w);
            let freezing = far * ice_k / ice / scaled_erfc(i);
            l - (melting + freezing) / (material.latent_heat * PI.sqrt())
        });
        let lambda = within_reach(lambda, ["wall", "far"], given)?;
        Ok(Self { shape: Shape::Planar { wall, tilt: [sin, cos], offset }, far, material, lambda })
    }

    /// Melting around a line: heat given off per length and time, temperature far away, place of the line.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless the strength is positive and the temperature far away not.
    pub fn line_source(strength: f64, far: f64, material: Material, centre: [f64; 2]) -> Result<Self> {
        warm("strength", strength, 0.0)?;
        cold(far, material.melting)?;
        let given = far;
        let far = far - material.melting;
        if !centre.iter().all(|c| c.is_finite()) {
            return Err(Error::invalid("centre", format!("{centre:?}"), "must be two finite numbers"));
        }
        let [warm, ice] = [LOWER, UPPER].map(|phase| material.diffusivity(phase));
        let lambda = root(|l| {
            let z = l * l;
            let melting = strength / (4.0 * PI) * (-z / warm).exp();
            let freezing = far * material.conductivity[UPPER] / scaled_e1(z / ice);
            z - (melting + freezing) / material.latent_heat
        });
        let lambda = within_reach(lambda, ["strength", "far"], [strength, given])?;
        Ok(Self { shape: Shape::LineSource { strength, centre }, far, material, lambda })
    }

    /// A flat front that grows into a melt of temperature `far`: λ √π e^(λ²/D) erfc(λ/√D) = C (T_m − T₀) √D / Λ.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless the melt is colder than melting, by less than Λ/C, and the tilt below 60 degrees.
    pub fn planar_growth(far: f64, material: Material, tilt: f64, offset: f64) -> Result<Self> {
        let cold = undercooling(far, &material)?;
        let d = material.diffusivity(UPPER);
        let lambda = root(|l| {
            let heat = -cold * material.conductivity[UPPER] / d.sqrt() / scaled_erfc(l / d.sqrt());
            l - heat / (material.latent_heat * PI.sqrt())
        });
        let lambda = within_reach(lambda, ["far", "far"], [far, far])?;
        let [sin, cos] = tilted(tilt, offset)?;
        Ok(Self { shape: Shape::Planar { wall: 0.0, tilt: [sin, cos], offset }, far: cold, material, lambda })
    }

    /// A disc that grows into a melt of temperature `far`: λ² e^(λ²/D) E₁(λ²/D) = k (T_m − T₀) / Λ.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless the melt is colder than melting, by less than Λ/C.
    ///
    /// # Source
    /// Frank, *Radially symmetric phase growth controlled by diffusion* (1950).
    pub fn disc_growth(far: f64, material: Material, centre: [f64; 2]) -> Result<Self> {
        let cold = undercooling(far, &material)?;
        if !centre.iter().all(|c| c.is_finite()) {
            return Err(Error::invalid("centre", format!("{centre:?}"), "must be two finite numbers"));
        }
        let d = material.diffusivity(UPPER);
        let lambda = root(|l| {
            let z = l * l;
            z + cold * material.conductivity[UPPER] / material.latent_heat / scaled_e1(z / d)
        });
        let lambda = within_reach(lambda, ["far", "far"], [far, far])?;
        Ok(Self { shape: Shape::LineSource { strength: 0.0, centre }, far: cold, material, lambda })
    }

    /// The point where the solution is singular, if there is one: a line source.
    pub fn source(&self) -> Option<[f64; 2]> {
        match self.shape {
            Shape::LineSource { centre, strength } if strength > 0.0 => Some(centre),
            _ => None,
        }
    }

    /// Whether nothing depends on x.
    pub fn is_flat(&self) -> bool {
        matches!(self.shape, Shape::Planar { tilt: [sin, _], .. } if sin == 0.0)
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
        let [warm, ice] = [LOWER, UPPER].map(|phase| self.material.diffusivity(phase));
        let above = match self.shape {
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
                    true => strength / (4.0 * PI * self.material.conductivity[LOWER]) * (e1(over(warm)) - e1(z / warm)),
                    false => {
                        let [a, b] = [over(ice), z / ice];
                        self.far * (1.0 - (b - a).exp() * scaled_e1(a) / scaled_e1(b))
                    }
                }
            }
        };
        self.material.melting + above
    }
}

/// Sine and cosine of the tilt of a wall.
fn tilted(tilt: f64, offset: f64) -> Result<[f64; 2]> {
    if tilt.is_nan() || tilt.abs() > 60.0 {
        return Err(Error::invalid("tilt", tilt, "must be between -60 and 60 degrees"));
    }
    if !offset.is_finite() {
        return Err(Error::invalid("offset", offset, "must be a finite number"));
    }
    let (sin, cos) = tilt.to_radians().sin_cos();
    Ok([sin, cos])
}

/// The temperature of a melt above that of melting: below 0, by less than what lets no front be slow enough.
fn undercooling(far: f64, material: &Material) -> Result<f64> {
    let [cold, most] = [far - material.melting, material.latent_heat / material.capacity[UPPER]];
    match cold < 0.0 && -cold < most {
        true => Ok(cold),
        false => {
            let rule = format!("must be below {} by less than {most}, latent heat over capacity", material.melting);
            Err(Error::invalid("far", far, rule))
        }
    }
}

fn warm(key: &str, value: f64, melting: f64) -> Result<()> {
    match value > melting && value.is_finite() {
        true => Ok(()),
        false => Err(Error::invalid(key, value, format!("must be above {melting}: the lower phase is the warm one"))),
    }
}

fn cold(far: f64, melting: f64) -> Result<()> {
    match far <= melting && far.is_finite() {
        true => Ok(()),
        false => {
            let rule = format!("must be {melting} or below: the upper phase is the cold one");
            Err(Error::invalid("far", far, rule))
        }
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

    fn of(diffusivity: [f64; 2]) -> Material {
        Material::diffusing(diffusivity, 1.0).unwrap()
    }

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
        let planar = Similarity::planar([1.0, -0.5], of([1.0; 2]), 0.0, 0.0).unwrap();
        assert!((planar.lambda() - 0.469851).abs() < 5e-7);
        let source = Similarity::line_source(8.0, -0.3, of([1.0; 2]), [0.0, -0.5]).unwrap();
        assert!((source.lambda() - 0.511282).abs() < 5e-7);
    }

    /// Temperatures are finite, and steepen where they should, for diffusivities that differ by many orders.
    #[test]
    fn diffusivities_may_differ_by_orders_of_magnitude() {
        // cold that spreads fast stops the melting around a line unless there is little of it
        assert!(Similarity::line_source(8.0, -0.3, of([1.0, 3000.0]), [0.0, -0.5]).is_err());
        for (d, far) in [([1.0, 1e-4], -0.3), ([3000.0, 1.0], -0.3), ([1.0, 3000.0], -3e-3), ([1e-6, 1.0], -0.3)] {
            for exact in [
                Similarity::planar([1.0, -0.5], of(d), 0.0, 0.0).unwrap(),
                Similarity::line_source(8.0, far, of(d), [0.0, -0.5]).unwrap(),
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

    /// Λ h_t = k₀ u₀_ν − k₁ u₁_ν by differences, with all parameters different from one.
    #[test]
    fn the_front_condition_holds() {
        let material = Material::new([2.0, 0.7], [1.5, 0.8], 2.5, 0.3).unwrap();
        for exact in [
            Similarity::planar([1.6, -0.1], material, 0.0, 0.1).unwrap(),
            Similarity::line_source(5.0, 0.1, material, [0.0, -0.5]).unwrap(),
        ] {
            let (t, e) = (0.3, 1e-4);
            let h = exact.height(0.0, t);
            let speed = (exact.height(0.0, t + e) - exact.height(0.0, t - e)) / (2.0 * e);
            let u = |y: f64| exact.temperature([0.0, y], t) - material.melting;
            assert!(u(h).abs() < 1e-12);
            let one_sided = |e: f64| (4.0 * u(h + e) - u(h + 2.0 * e)) / (2.0 * e);
            let [below, above] = material.conductivity;
            let jump = (above * one_sided(e) - below * one_sided(-e)) / material.latent_heat;
            assert!((speed / jump - 1.0).abs() < 1e-5, "{speed} {jump}");
        }
    }
}
