use std::array::from_fn;

/// Central differences of order 2·G for −(u²/2)_x − (u²/2)_y + ν (u_xx + u_yy)
///
/// ```text
/// R_i = centre u_i + Σ_axes Σ_{k=1…G} [ linear_k (u_{i+k} + u_{i−k}) − flux_k (u²_{i+k} − u²_{i−k}) ]
/// ```
///
/// Differences of fluxes telescope, so that R sums to zero over periodic axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stencil<const G: usize> {
    centre: f64,
    linear: [[f64; G]; 2],
    flux: [[f64; G]; 2],
}

/// Weights of u_{i±k} in h² u″, and ± in h u′.
fn weights(order: usize, k: usize) -> [f64; 2] {
    match (order, k) {
        (2, 1) => [1.0, 1.0 / 2.0],
        (_, 1) => [4.0 / 3.0, 2.0 / 3.0],
        _ => [-1.0 / 12.0, -1.0 / 12.0],
    }
}

impl<const G: usize> Stencil<G> {
    pub(super) fn new(viscosity: f64, spacing: [f64; 2]) -> Self {
        let linear = spacing.map(|h| from_fn(|k| viscosity / (h * h) * weights(2 * G, k + 1)[0]));
        let flux = spacing.map(|h| from_fn(|k| 0.5 / h * weights(2 * G, k + 1)[1]));
        let centre = -2.0 * linear.as_flattened().iter().sum::<f64>();
        Self { centre, linear, flux }
    }

    /// The stencil of s·R.
    pub(super) fn scaled(&self, s: f64) -> Self {
        let times = |weights: [[f64; G]; 2]| weights.map(|axis| axis.map(|w| s * w));
        Self { centre: s * self.centre, linear: times(self.linear), flux: times(self.flux) }
    }

    /// The longest stable step of classical RK4 for speeds up to `speed` along both axes
    ///
    /// The linearised R multiplies the wave exp(i(θk + φl)) by λ(θ, φ). The step is stable where the polynomial of RK4
    /// maps every Δt·λ into the unit disc. The real and the imaginary part, diffusion and convection, are taken
    /// together.
    pub(super) fn stable_step(&self, speed: f64) -> f64 {
        /// Number of angles θ in (0, π] along each axis at which the step must be stable.
        const ANGLES: usize = 16;
        let axis = |d: usize| -> [[f64; 2]; ANGLES] {
            from_fn(|a| {
                let theta = std::f64::consts::PI * (a + 1) as f64 / ANGLES as f64;
                (0..G).fold([0.0; 2], |[re, im], k| {
                    let (sin, cos) = ((k + 1) as f64 * theta).sin_cos();
                    [re + 2.0 * self.linear[d][k] * (cos - 1.0), im - 4.0 * speed * self.flux[d][k] * sin]
                })
            })
        };
        let (x, y) = (axis(0), axis(1));
        let stable = |dt: f64| {
            x.iter().all(|[re_x, im_x]| {
                y.iter().all(|[re_y, im_y]| {
                    let z = [dt * (re_x + re_y), dt * (im_x + im_y)];
                    // 1 + z(1 + z/2(1 + z/3(1 + z/4)))
                    let [re, im] = (1..=4).rev().fold([1.0, 0.0], |[re, im], n| {
                        [1.0 + (z[0] * re - z[1] * im) / n as f64, (z[0] * im + z[1] * re) / n as f64]
                    });
                    re * re + im * im <= 1.0 + 1e-12
                })
            })
        };
        // a step is never stable if it moves a wave past −2.7853 on the real axis or 3 on the imaginary one
        let furthest = |part: usize| [&x, &y].map(|w| w.iter().fold(0.0_f64, |m, z| m.max(z[part].abs())));
        let [re, im] = [furthest(0), furthest(1)].map(|[x, y]| x + y);
        let (mut low, mut high) = (0.0, (2.7853 / re).min(3.0 / im));
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if stable(middle) { low = middle } else { high = middle }
        }
        low
    }

    /// R along a row: `to[j] = finish(j, R_j)`, where `row(k)` is the padded row k rows further on.
    ///
    /// It is inlined into its callers and uses slices of one length, so that the compiler can vectorise it.
    #[inline(always)]
    pub(super) fn apply<'a>(
        &self,
        row: impl Fn(isize) -> &'a [f64],
        to: &mut [f64],
        finish: impl Fn(usize, f64) -> f64,
    ) {
        let m = to.len();
        let here = row(0);
        let centre = &here[G..][..m];
        let pairs: [[[&[f64]; 2]; 2]; G] = from_fn(|k| {
            let k = k + 1;
            let across = [row(-(k as isize)), row(k as isize)].map(|row| &row[G..][..m]);
            [across, [&here[G - k..][..m], &here[G + k..][..m]]]
        });
        for j in 0..m {
            let mut r = self.centre * centre[j];
            for (k, axes) in pairs.iter().enumerate() {
                for (d, [before, after]) in axes.iter().enumerate() {
                    // a² − b² = (a + b)(a − b), where diffusion uses the same sum
                    let (a, b) = (after[j], before[j]);
                    r += (a + b) * (self.linear[d][k] - self.flux[d][k] * (a - b));
                }
            }
            to[j] = finish(j, r);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Stencil;

    /// Known limits: 2.785 h²/8ν of diffusion alone at order 2, 3/4 of it at order 4; 2√2 h/2u of convection alone.
    #[test]
    fn stable_steps_are_the_known_ones() {
        let h = 0.1;
        let close = |step: f64, limit: f64| assert!((step / limit - 1.0).abs() < 0.01, "{step}, expected {limit}");
        close(Stencil::<1>::new(2.0, [h; 2]).stable_step(0.0), 2.7853 * h * h / 16.0);
        close(Stencil::<2>::new(2.0, [h; 2]).stable_step(0.0), 0.75 * 2.7853 * h * h / 16.0);
        close(Stencil::<1>::new(1e-9, [h; 2]).stable_step(3.0), 8.0_f64.sqrt() * h / 6.0);
    }
}
