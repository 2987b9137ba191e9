//! Fronts with published data in SI units against Neumann's solution, whose constant is found here by itself.

use driftmesh::study::{FrontCourse, Kind, Source, StefanStudy};
use std::path::Path;

fn rerun(name: &str) -> FrontCourse {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(format!("{name}.toml"));
    let study = StefanStudy::from_source(&Source::read(&file).unwrap()).unwrap();
    assert_eq!(study.warnings().unwrap(), Vec::<String>::new(), "{name}");
    let (run, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{name}: {failure:?}");
    run.course
}

/// λ of a front at 2λ√(D₁t), from temperatures above melting at the wall and far away, by bisection of
/// k₁ T₁ e^(−λ²)/(√D₁ erf λ) + k₀ T₀ e^(−(νλ)²)/(√D₀ erfc νλ) = Λ λ √(π D₁), ν = √(D₁/D₀).
fn lambda([wall, far]: [f64; 2], k: [f64; 2], c: [f64; 2], latent: f64) -> f64 {
    let d = [k[0] / c[0], k[1] / c[1]];
    let nu = (d[0] / d[1]).sqrt();
    let excess = |l: f64| {
        let warm = k[0] * wall * (-l * l).exp() / (d[0].sqrt() * libm::erf(l));
        let cold = k[1] * far * (-(nu * l).powi(2)).exp() / (d[1].sqrt() * libm::erfc(nu * l));
        warm + cold - latent * l * (std::f64::consts::PI * d[0]).sqrt()
    };
    let (mut low, mut high) = (1e-6, 3.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if excess(middle) > 0.0 { low = middle } else { high = middle }
    }
    low
}

/// The way of the front in a study, from where and when it starts to its end: within a thousandth.
#[test]
fn fronts_with_published_data_are_right_to_a_thousandth() {
    // temperatures at wall and far away, conductivities, capacities, latent heat, start and seconds
    let water = ([0.6, 2.2], [4.18e6, 1.92e6], 3.06e8);
    let ice = ([2.2, 0.6], [1.92e6, 4.18e6], 3.06e8);
    for (name, ends, (k, c, latent), start, seconds) in [
        ("gallium", [8.22, -1.48], ([32.0; 2], [6093.0 * 381.5; 2], 6093.0 * 80160.0), 0.01, 3600.0),
        ("octadecane", [10.0, 0.0], ([0.2; 2], [800.0 * 1250.0; 2], 800.0 * 1.25e5), 0.005, 86400.0),
        ("tin", [3.0, 0.0], ([60.0; 2], [7500.0 * 200.0; 2], 7500.0 * 6e4), 0.005, 3600.0),
        ("ice-and-water", [20.0, -5.0], water, 0.01, 36000.0),
        ("lake-ice", [20.0, -4.0], ice, 0.0, 864000.0),
    ] {
        let course = rerun(name);
        let root = lambda(ends, k, c, latent) * 2.0 * (k[0] / c[0]).sqrt();
        let exact = root * (seconds + (start / root).powi(2)).sqrt();
        let found = if name == "lake-ice" { 3.0 - course.state.front[2] } else { course.state.front[2] };
        let energy = course.reports[0].energy_imbalance.unwrap();
        println!("{name}: {found} m, exact {exact} m, {:.1e}; heat {energy:.1e}", found / exact - 1.0);
        assert!((found / exact - 1.0).abs() < 1e-3, "{name}: {found}, not {exact}");
        assert!(energy < 1e-3, "{name}: {energy:e}");
    }
}
