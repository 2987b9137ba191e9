//! Diffusion that vanishes at a value of its unknown: fronts without a foot.

use driftmesh::error::{Error, Failure};
use driftmesh::geometry::Field;
use driftmesh::simulation::Record;
use driftmesh::study::{Kind, MovingLine, MovingMesh, Source};

const HEAD: &str = "[study]\nname = \"degenerate\"\nkind = \"moving-mesh\"\n";

fn line(text: &str) -> (Field, Record) {
    let study = MovingLine::from_source(&Source::new("line.toml", format!("{HEAD}{text}"))).unwrap();
    let (run, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{failure:?}\n{text}");
    (run.state.unwrap().u, run.record)
}

fn plane(text: &str) -> (Field, Record) {
    let study = MovingMesh::from_source(&Source::new("plane.toml", format!("{HEAD}{text}"))).unwrap();
    let (run, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{failure:?}\n{text}");
    (run.state.unwrap().u, run.record)
}

type Outcome = ([f64; 2], Option<f64>, f64);

/// The least and the largest value of the first unknown at the end, l2 there, and the drift of its integral.
fn outcome((u, record): &(Field, Record)) -> Outcome {
    let range = u.component(0).fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], u| [l.min(u), h.max(u)]);
    let last = record.reports.last().unwrap();
    (range, last.error.map(|error| error.l2), last.conserved.drift)
}

/// Barenblatt's solution of u_t = Δ(u^m) in d dimensions, (t^−a (C − k r²/t^2b)₊^(1/(m−1))) with C = 0.04, times s and
/// with lengths l times as long: the equation is then u_t = Δ(u^m) l² s^(1−m).
fn barenblatt(m: f64, d: f64, [s, l]: [f64; 2]) -> [String; 2] {
    let a = d / (d * (m - 1.0) + 2.0);
    let (b, k) = (a / d, a * (m - 1.0) / (2.0 * m * d));
    let r2 = if d == 1.0 { "x^2" } else { "(x^2 + y^2)" };
    let solution = format!("{s}*t^(-{a})*max(0.04 - {k}*{r2}/{}/t^{}, 0)^{}", l * l, 2.0 * b, 1.0 / (m - 1.0));
    [format!("{}*u^{}", m * l * l * s.powf(1.0 - m), m - 1.0), solution]
}

fn porous(m: f64, units: [f64; 2], cells: usize, end: f64, fixed: bool) -> Outcome {
    let [diffusivity, solution] = barenblatt(m, 1.0, units);
    let generator = if fixed { "[mesh]\ngenerator = { kind = \"fixed\" }\n" } else { "" };
    outcome(&line(&format!(
        r#"
        [domain]
        lower = [{}]
        upper = [{}]
        [grid]
        cells = [{cells}]
        {generator}
        [time]
        start = 0.01
        end = {end}
        [pde]
        kind = "formula"
        unknowns = ["u"]
        diffusivity = {{ u = "{diffusivity}" }}
        initial = {{ u = "{solution}" }}
        exact = {{ u = "{solution}" }}
        boundary = {{ u = "no-flux" }}
        "#,
        -2.0 * units[1],
        2.0 * units[1],
    )))
}

/// Barenblatt's fronts for m = 2, 3 and 5 are never negative, keep their mass, and have at most a half of the error on
/// a mesh at rest, in the mean of three times and two numbers of cells; in other units, too.
#[test]
fn barenblatts_fronts_are_followed_without_undershoots() {
    for (m, units) in [(2.0, [1.0, 1.0]), (3.0, [1.0, 1.0]), (3.0, [1e-5, 300.0]), (5.0, [1.0, 1.0])] {
        let mut ratio = 0.0;
        let times = [0.05, 0.6, 10.0];
        for (cells, end) in [40, 80].into_iter().flat_map(|cells| times.map(|end| (cells, end))) {
            let ([least, _], l2, drift) = porous(m, units, cells, end, false);
            assert!(least >= 0.0 && drift.abs() < 1e-12, "{m} {cells} {end}: {least:e} {drift:e}");
            let resting = porous(m, units, cells, end, true).1.unwrap();
            println!("m = {m}, {cells} cells, t = {end}: {:.2e} for {resting:.2e}", l2.unwrap());
            ratio += (l2.unwrap() / resting).ln() / 6.0;
        }
        println!("m = {m}: {:.3}", ratio.exp());
        assert!(ratio.exp() < 0.5, "{m}: {}", ratio.exp());
    }
}

/// The same in the plane, on 24 × 24 and 32 × 32 cells, in the mean of three times.
#[test]
fn a_pile_spreads_in_the_plane() {
    for (m, cells, most) in [(2.0, 24, 0.5), (3.0, 32, 0.8)] {
        let [diffusivity, solution] = barenblatt(m, 2.0, [1.0, 1.0]);
        let of = |end: f64, generator: &str| {
            outcome(&plane(&format!(
                r#"
                [domain]
                lower = [-2.0, -2.0]
                upper = [2.0, 2.0]
                [grid]
                cells = [{cells}, {cells}]
                {generator}
                [time]
                start = 0.05
                end = {end}
                [pde]
                kind = "formula"
                unknowns = ["u"]
                diffusivity = {{ u = "{diffusivity}" }}
                initial = {{ u = "{solution}" }}
                exact = {{ u = "{solution}" }}
                boundary = {{ u = "no-flux" }}
                "#
            )))
        };
        let mut ratio = 0.0;
        for end in [0.2, 1.0, 5.0] {
            let ([least, _], l2, drift) = of(end, "");
            let resting = of(end, "[mesh]\ngenerator = { kind = \"fixed\" }").1.unwrap();
            println!("m = {m}, {cells}², t = {end}: {:.2e} for {resting:.2e}", l2.unwrap());
            assert!(least >= 0.0 && drift.abs() < 1e-12, "{m}: {least:e} {drift:e}");
            ratio += (l2.unwrap() / resting).ln() / 3.0;
        }
        println!("m = {m}: {:.3}", ratio.exp());
        assert!(ratio.exp() < most, "{m}: {}", ratio.exp());
    }
}

/// A flood into a dry rock: saturations carried by u²/(u² + (1 − u)²) whose diffusion vanishes at 0 and at 1 stay
/// between these.
#[test]
fn saturations_stay_between_dry_and_full() {
    for (cells, end) in [(40, 0.1), (40, 0.4), (80, 0.25), (80, 0.4)] {
        let run = line(&format!(
            r#"
            [grid]
            cells = [{cells}]
            [time]
            start = 0.0
            end = {end}
            [pde]
            kind = "formula"
            unknowns = ["u"]
            flux = {{ u = ["u^2/(u^2 + (1 - u)^2)"] }}
            diffusivity = {{ u = "0.04*u*(1 - u)" }}
            initial = {{ u = "max(1 - 3*x, 0)" }}
            boundary = {{ u = "max(1 - 3*x, 0)" }}
            "#
        ));
        let ([least, most], ..) = outcome(&run);
        assert!(least >= 0.0 && most <= 1.0, "{cells} {end}: {least:e} {most}");
        let left = run.1.warnings.iter().any(|warning| warning.contains("leaves the range"));
        assert!(!left, "{:?}", run.1.warnings);
    }
}

/// Where data themselves make a diffusivity negative, it is refused at the start.
#[test]
fn negative_diffusivities_of_data_are_refused() {
    let study = format!(
        r#"{HEAD}
        [grid]
        cells = [20]
        [time]
        start = 0.0
        end = 1.0
        [pde]
        kind = "formula"
        unknowns = ["u"]
        diffusivity = {{ u = "2*u" }}
        initial = {{ u = "x - 0.05" }}
        boundary = {{ u = "x - 0.05" }}
        "#
    );
    let computed = MovingLine::from_source(&Source::new("line.toml", study)).unwrap().compute();
    let refused = computed.map_or_else(Some, |(_, failure)| failure);
    assert!(matches!(&refused, Some(Error::Failed { failure: Failure::NotPositive { .. }, .. })), "{refused:?}");
}

/// Where a pile has become so wide that equal cells resolve it, the mesh goes back to these: its error is then not much
/// larger than theirs.
#[test]
fn a_pile_that_has_spread_has_equal_cells() {
    for (m, at) in [(2.0, -1.7), (3.0, 0.4)] {
        let [diffusivity, solution] = barenblatt(m, 1.0, [2.5, 2.5]);
        let solution = solution.replace("x^2", &format!("(x - {at})^2"));
        let of = |end: f64, generator: &str| {
            outcome(&line(&format!(
                r#"
                [domain]
                lower = [-7.5]
                upper = [7.5]
                [grid]
                cells = [80]
                {generator}
                [time]
                start = 0.01
                end = {end}
                [pde]
                kind = "formula"
                unknowns = ["u"]
                diffusivity = {{ u = "{diffusivity}" }}
                initial = {{ u = "{solution}" }}
                exact = {{ u = "{solution}" }}
                boundary = {{ u = "no-flux" }}
                "#
            )))
        };
        let ratios = [1.0, 5.0, 20.0].map(|end| {
            let [moving, fixed] = ["", "[mesh]\ngenerator = { kind = \"fixed\" }"].map(|by| of(end, by).1.unwrap());
            println!("m = {m}, t = {end}: {moving:.2e} for {fixed:.2e}");
            moving / fixed
        });
        assert!(ratios.iter().all(|ratio| *ratio < 1.5), "m = {m}: {ratios:?}");
    }
}
