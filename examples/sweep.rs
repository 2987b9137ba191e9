//! Hundreds of random studies: each must end completed or with a named failure, never with NaN, a panic or a folded mesh.
//!
//! ```text
//! cargo run --release -p driftmesh --example sweep -- 500
//! ```
//! prints the share that completed and, name by name, what the others failed with.

use driftmesh::study::{self, MovingMesh, Source};
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

/// What came of a sweep.
#[derive(Debug, Default)]
pub struct Sweep {
    /// Studies that ran to their end.
    pub completed: usize,
    /// How many needed `[safety]`.
    pub rescued: usize,
    /// Failures by name, with the settings of each.
    pub failed: BTreeMap<&'static str, Vec<String>>,
    /// What must not happen, with the settings.
    pub broken: Vec<String>,
}

/// Draws settings: Vigna's splitmix64, the same numbers everywhere.
struct Draw(u64);

impl Draw {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn log(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    fn whole(&mut self, low: usize, high: usize) -> usize {
        low + ((high - low + 1) as f64 * self.unit()) as usize
    }

    fn one<'a>(&mut self, of: &[&'a str]) -> &'a str {
        of[self.whole(0, of.len() - 1)]
    }
}

/// A random study, as text.
fn drawn(number: u64) -> String {
    let mut draw = Draw(number << 32);
    let (strength, smoothing, viscosity) = (draw.log(1.0, 1000.0), draw.whole(0, 6), draw.log(1e-3, 1e-1));
    let cells = [draw.whole(8, 32), draw.whole(8, 32)];
    let parts = cells.map(|cells| draw.whole(1, 8.min(cells / 2)));
    let subdomains = format!("subdomains = {parts:?}");
    let estimator = draw.one(&[
        "{ kind = \"residual-walk\" }",
        "{ kind = \"residual-walk\", sweeps = 6, walks = 10, smoother = \"jacobi\" }",
        "{ kind = \"grid-walk\", walks = 100 }",
        "{ kind = \"grid-walk\", walks = 30, increment = true }",
        "{ kind = \"monte-carlo\", paths = 300, substeps = 5 }",
        "{ kind = \"monte-carlo\", paths = 200, substeps = 5, antithetic = true, control_variate = true }",
        "{ kind = \"monte-carlo\", paths = 256, substeps = 5, sobol = true }",
    ]);
    let generator = match draw.one(&["whole", "stochastic", "stochastic", "schwarz"]) {
        "stochastic" => format!("{{ kind = \"stochastic\", {subdomains}, seed = {number}, estimator = {estimator} }}"),
        "schwarz" => format!("{{ kind = \"schwarz\", {subdomains}, overlap = 1, iterations = 500 }}"),
        kind => format!("{{ kind = \"{kind}\" }}"),
    };
    let periodic =
        "[domain]\nlower = [0, 0]\nupper = [6.283185307179586, 6.283185307179586]\nperiodic = [true, true]\n";
    let initial = "initial = \"0.75 + 0.5*sin(x + y)\"";
    let (domain, pde, [start, end]) = match draw.one(&["front", "front", "periodic", "water", "formula"]) {
        "front" => {
            let convection = draw.one(&["flux", "conservative", "advective"]);
            let pde = format!("kind = \"burgers\"\nviscosity = {viscosity}\nconvection = \"{convection}\"");
            ("", pde, [0.25, 0.35])
        }
        "periodic" => (periodic, format!("kind = \"burgers\"\nviscosity = {viscosity}\n{initial}"), [0.0, 0.5]),
        "water" => {
            let form = draw.one(&["flux", "advective"]);
            (periodic, format!("kind = \"shallow-water\"\nform = \"{form}\""), [0.0, 0.3])
        }
        _ => {
            let pde = format!(
                "kind = \"formula\"\nunknowns = [\"u\"]\nflux = {{ u = [\"u\", \"0.5*u^2\"] }}\ndiffusivity = {{ u = \"{viscosity}\" }}\n\
                 initial = {{ u = \"exp(-50*((x - 0.4)^2 + (y - 0.4)^2))\" }}\nboundary = {{ u = \"no-flux\" }}"
            );
            ("", pde, [0.0, 0.2])
        }
    };
    let steps = draw.whole(10, 40);
    let step = match draw.one(&["fixed", "fixed", "auto"]) {
        "fixed" => format!("step = {}", (end - start) / steps as f64),
        _ => String::new(),
    };
    let monitor = match draw.one(&["arclength", "arclength", "auto"]) {
        "arclength" => {
            let gradient = draw.one(&["central", "log", "safe"]);
            format!(
                "kind = \"arclength\"\nstrength = {{ relative = {strength} }}\nsmoothing = {smoothing}\ngradient = \"{gradient}\""
            )
        }
        kind => format!("kind = \"{kind}\""),
    };
    let relaxation = match draw.one(&["number", "steps", "default"]) {
        "number" => format!("relaxation = {}", draw.log(0.05, 2.0)),
        "steps" => format!("relaxation = {{ steps = {} }}", draw.log(5.0, 100.0)),
        _ => String::new(),
    };
    let (form, mesh) = (draw.one(&["gradient", "conservative"]), draw.one(&["uniform", "adapted"]));
    format!(
        "[study]\nname = \"sweep-{number}\"\nkind = \"moving-mesh\"\n{domain}[grid]\ncells = {cells:?}\n[time]\nstart = {start}\nend = {end}\n{step}\n\
         [pde]\n{pde}\n[monitor]\n{monitor}\n[mesh]\n{relaxation}\nform = \"{form}\"\nstart = \"{mesh}\"\ngenerator = {generator}\n"
    )
}

/// Runs so many random studies.
pub fn sweep(count: u64) -> Sweep {
    let mut sweep = Sweep::default();
    for number in 0..count {
        let text = drawn(number);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            MovingMesh::from_source(&Source::new("sweep.toml", text.as_str())).and_then(|study| study::compute(&study))
        }));
        let (record, failure) = match outcome {
            Err(_) => {
                sweep.broken.push(format!("panic\n{text}"));
                continue;
            }
            Ok(Err(error)) => (None, Some(error)),
            Ok(Ok((record, failure))) => (Some(record), failure),
        };
        let reports = record.iter().flat_map(|record| &record.reports);
        for report in reports {
            let error = report.error.map_or([0.0; 2], |error| [error.linf, error.l2]);
            let figures = [error[0], error[1], report.quality.q_max, report.quality.q_mean, report.conserved.mass];
            if !(figures.iter().all(|f| f.is_finite()) && report.quality.min_scaled_jacobian > 0.0) {
                sweep.broken.push(format!("{report:?}\n{text}"));
            }
        }
        sweep.rescued += usize::from(record.is_some_and(|record| record.safety != Default::default()));
        match failure {
            None => sweep.completed += 1,
            Some(driftmesh::Error::Failed { failure, .. }) => {
                sweep.failed.entry(failure.name()).or_default().push(format!("{failure}\n{text}"));
            }
            Some(error) => sweep.broken.push(format!("{error}\n{text}")),
        }
    }
    sweep
}

#[allow(dead_code)] // the test of the sweep has a `main` of its own
fn main() -> ExitCode {
    let count = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(500);
    let sweep = sweep(count);
    for (name, failed) in &sweep.failed {
        println!("--- {name}: {}", failed.len());
        failed.iter().for_each(|text| println!("{text}"));
    }
    sweep.broken.iter().for_each(|text| println!("--- BROKEN\n{text}"));
    println!(
        "{count} studies: {} completed ({:.1} %), {} of them with the help of [safety]",
        sweep.completed,
        100.0 * sweep.completed as f64 / count as f64,
        sweep.rescued
    );
    sweep.failed.iter().for_each(|(name, failed)| println!("  {name:<18}{:>4}", failed.len()));
    println!("  broken            {:>4}", sweep.broken.len());
    ExitCode::from(u8::from(!sweep.broken.is_empty()))
}
