use crate::error::Result;
use crate::study::{PoissonStudy, Source};
use std::f64::consts::FRAC_PI_2;

/// Error of the slides' model problem with Nx × 0.8 Nx nodes inside, in their norm √(hx hy Σ e²), by the settings that fit
/// their table best.
///
/// # Errors
/// As [`PoissonStudy::solve`].
pub fn slides_error(nx: usize) -> Result<f64> {
    let ny = nx * 4 / 5;
    let text = format!(
        "[study]\nname = \"slides\"\nkind = \"poisson\"\n[domain]\nx = [0.0, 1.5707963267948966]\nbottom = \"0\"\n\
         top = \"1 + cos(x)/4\"\n[grid]\ncells = [{}, {}]\ngrading = {{ toward = \"top\", ratio = 0.75 }}\n\
         [exact]\nu = \"y + x*cos(4*y)\"\n\
         [laplacian]\nkind = \"published\"\npolynomials = \"printed\"\nscaling = \"global\"\n",
        nx + 1,
        ny + 1
    );
    let solved = PoissonStudy::from_source(&Source::new("slides", text))?.solve()?;
    let squares: f64 = solved.u.iter().zip(solved.exact.iter().flatten()).map(|(u, e)| (u - e) * (u - e)).sum();
    Ok((FRAC_PI_2 / (nx + 1) as f64 / (ny + 1) as f64 * squares).sqrt())
}
