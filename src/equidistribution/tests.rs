use super::*;

const U81: &str = "(1 - exp(20*x)) / (1 - exp(20))";

fn line(density: LineDensity, cells: usize, face: FaceDensity) -> Line {
    Line { face, ..Line::new(density, cells) }
}

fn square() -> LineDensity {
    LineDensity::formula("x^2 + 1").unwrap()
}

fn layer() -> LineDensity {
    LineDensity::arclength(U81).unwrap()
}

fn classical(sweep: Sweep, linearized: bool) -> Method {
    Method::Classical { sweep, linearized, coarse: Coarse::None }
}

fn until(tolerance: f64) -> Stop {
    Stop { iterations: 4000, tolerance: Some(tolerance), measure: Measure::Error }
}

fn exactly(iterations: usize) -> Stop {
    Stop { iterations, tolerance: None, measure: Measure::Error }
}

/// Two pieces of 100 cells by their overlap.
fn two(alpha: usize, beta: usize) -> Vec<[usize; 2]> {
    vec![[0, beta], [alpha, 100]]
}

fn iterate(line: &Line, ranges: &[[usize; 2]], method: Method, stop: Stop) -> History {
    line.iterate(0.0, ranges, method, &line.uniform(), None, stop).unwrap()
}

/// The continuous meshes, from the integral form.
#[test]
fn exact_meshes() {
    let xi = [0.1, 0.25, 0.5, 0.75, 0.9];
    for (density, expected) in [
        (square(), [0.13255693, 0.32218535, 0.59607164, 0.81773167, 0.93100813]),
        (layer(), [0.18336210, 0.45840525, 0.88222053, 0.96943518, 0.98988916]),
    ] {
        let found = Line::new(density, 10).exact(0.0, &xi).unwrap();
        assert!(found.iter().zip(expected).all(|(x, e)| (x - e).abs() < 1e-8), "{found:?} against {expected:?}");
    }
    assert!((layer().integral(0.0, 0.0, 1.0).unwrap() - 1.83362100753).abs() < 1e-11);
}

/// Where M jumps, exact integrals have the nodes of the continuous mesh.
#[test]
fn a_density_may_jump() {
    for (left, right) in [(1.0, 20.0), (100.0, 1.0), (1.0, 50.0)] {
        let density = LineDensity::formula(&format!("if(x < 0.3, {left}, {right})")).unwrap();
        let up_to_jump = 0.3 * left;
        let whole = up_to_jump + 0.7 * right;
        let line = line(density, 100, FaceDensity::Exact);
        assert!((line.density.integral(0.0, 0.0, 1.0).unwrap() / whole - 1.0).abs() < 1e-14);
        let place = |g: f64| if g < up_to_jump { g / left } else { 0.3 + (g - up_to_jump) / right };
        let mesh = line.solve(0.0, &line.uniform(), None).unwrap().0;
        let xi: Vec<f64> = (0..=100).map(|i| i as f64 / 100.0).collect();
        for found in [mesh, line.exact(0.0, &xi).unwrap()] {
            let off = found.iter().zip(&xi).map(|(x, xi)| (x - place(xi * whole)).abs()).fold(0.0, f64::max);
            assert!(off < 1e-10, "{left}, {right}: off by {off:e}");
        }
    }
}

/// Second order by trapezoids, half their error by midpoints, and round-off by exact integrals.
#[test]
fn discrete_meshes_converge() {
    for (cells, expected) in [(20, 1.03e-4), (40, 2.57e-5), (80, 6.43e-6), (160, 1.61e-6), (320, 4.02e-7)] {
        let error = |face| {
            let line = line(square(), cells, face);
            let mesh = line.solve(0.0, &line.uniform(), None).unwrap().0;
            let xi: Vec<f64> = (0..=cells).map(|i| i as f64 / cells as f64).collect();
            let exact = line.exact(0.0, &xi).unwrap();
            mesh.iter().zip(exact).map(|(x, e)| (x - e).abs()).fold(0.0, f64::max)
        };
        let trapezoid = error(FaceDensity::Trapezoid);
        assert!((trapezoid / expected - 1.0).abs() < 5e-3, "{cells}: {trapezoid:e}");
        assert!((error(FaceDensity::Midpoint) / trapezoid - 0.5).abs() < 0.01);
        assert!(error(FaceDensity::Exact) < 1e-12);
    }
}

/// Table 8.1 as measured independently.
#[test]
fn table_8_1() {
    let line = line(layer(), 100, FaceDensity::Trapezoid);
    let jumps = |ranges: &[[usize; 2]], method, tolerance: f64, expected: [f64; 6]| {
        let history = iterate(&line, ranges, method, exactly(10));
        for (k, expected) in expected.into_iter().enumerate() {
            let found = history.iterates[2 * k].largest_jump.unwrap();
            assert!((found - expected).abs() < tolerance, "{method:?}, {}: {found} against {expected}", 2 * k);
        }
    };
    let overlap = two(48, 52);
    let cut = [[0, 50], [50, 100]];
    jumps(
        &overlap,
        classical(Sweep::Parallel, false),
        1e-6,
        [0.362538, 0.052048, 0.049766, 0.047822, 0.046166, 0.044756],
    );
    jumps(
        &overlap,
        classical(Sweep::Parallel, true),
        1e-6,
        [0.362538, 0.129063, 0.100581, 0.057124, 0.047890, 0.047061],
    );
    jumps(
        &cut,
        Method::Optimized { robin: Robin::Value(3.70) },
        5e-5,
        [0.3625, 0.04158, 0.03661, 0.03664, 0.0366, 0.0366],
    );
    jumps(&cut, Method::Optimal { panels: Some(20) }, 5e-5, [0.3625, 0.03673, 0.03664, 0.0366, 0.0366, 0.0366]);
    let uniform = iterate(&line, &overlap, classical(Sweep::Parallel, false), exactly(0)).iterates[0];
    assert!((uniform.interpolation_error.unwrap() - 0.004529).abs() < 1e-6, "{uniform:?}");
    let mesh = line.solve(0.0, &line.uniform(), None).unwrap().0;
    let rest =
        line.iterate(0.0, &overlap, classical(Sweep::Parallel, false), &mesh, None, exactly(0)).unwrap().iterates[0];
    assert!((rest.interpolation_error.unwrap() - 0.000413).abs() < 1e-6, "{rest:?}");
    assert!((rest.largest_jump.unwrap() - 0.036639).abs() < 1e-6, "{rest:?}");
}

/// Theorem 3.2: the asymptotic contraction and the iterations to 1e-10 of all four classical variants.
#[test]
fn classical_two_pieces() {
    let line_of = |density| line(density, 100, FaceDensity::Trapezoid);
    for (alpha, beta, rho, counts) in [
        (48, 52, 0.85207, [259, 130, 260, 131]),
        (45, 55, 0.66942, [105, 53, 105, 53]),
        (40, 60, 0.44444, [53, 27, 53, 27]),
    ] {
        let variants = [
            (Sweep::Parallel, false),
            (Sweep::Alternating, false),
            (Sweep::Parallel, true),
            (Sweep::Alternating, true),
        ];
        for ((sweep, linearized), expected) in variants.into_iter().zip(counts) {
            let history = iterate(&line_of(square()), &two(alpha, beta), classical(sweep, linearized), until(1e-10));
            let count = history.iterates.len() - 1;
            assert!(count.abs_diff(expected) <= 1, "{alpha}/{beta} {sweep:?} {linearized}: {count} against {expected}");
            let rate = if sweep == Sweep::Parallel { rho } else { rho * rho };
            // the theorem is of the nonlinear iteration
            if !linearized {
                let on = iterate(&line_of(square()), &two(alpha, beta), classical(sweep, linearized), until(2e-11));
                // twice the tolerance for twice the exponent
                let tolerance = if sweep == Sweep::Parallel { 1e-4 } else { 2e-4 };
                assert!((on.observed.unwrap() - rate).abs() < tolerance, "{:?} against {rate}", on.observed);
                assert!((history.prediction.predicted.unwrap() - rate).abs() < 1e-5, "{:?}", history.prediction);
            }
        }
    }
    let variants =
        [(Sweep::Parallel, false), (Sweep::Alternating, false), (Sweep::Parallel, true), (Sweep::Alternating, true)];
    for ((sweep, linearized), expected) in variants.into_iter().zip([111, 56, 122, 65_usize]) {
        let history = iterate(&line_of(layer()), &two(45, 55), classical(sweep, linearized), until(1e-10));
        let count = history.iterates.len() - 1;
        assert!(count.abs_diff(expected) <= 1, "layer {sweep:?} {linearized}: {count} against {expected}");
    }
}

/// Theorem 4.1 with exact integrals, for any number of pieces; second order by trapezoids.
#[test]
fn optimal_conditions_end() {
    for cells in [20, 80, 320] {
        let line = line(square(), cells, FaceDensity::Exact);
        for pieces in [2, 4, 5] {
            let cuts: Vec<[usize; 2]> = (0..pieces).map(|s| [s * cells / pieces, (s + 1) * cells / pieces]).collect();
            let history = iterate(&line, &cuts, Method::Optimal { panels: None }, exactly(pieces));
            let error = history.iterates[pieces].error;
            assert!(error < 1e-12, "{cells} cells, {pieces} pieces: {error:e} after {pieces}");
        }
    }
    for (cells, expected) in [(20, 3.6e-5), (80, 2.4e-6), (320, 1.5e-7)] {
        let line = line(square(), cells, FaceDensity::Trapezoid);
        let half = [[0, cells / 2], [cells / 2, cells]];
        let error = iterate(&line, &half, Method::Optimal { panels: None }, exactly(2)).iterates[2].error;
        assert!((error / expected - 1.0).abs() < 0.03, "{cells}: {error:e} against {expected:e}");
    }
}

/// Theorem 5.2 and the rate between its lines.
#[test]
fn optimised_two_pieces() {
    let line = line(square(), 100, FaceDensity::Exact);
    for (p, rate, bound, count) in
        [(2.0, Some(0.02276), Some(0.4286), 12), (2.71, None, None, 4), (4.0, Some(0.03692), Some(1.0 / 3.0), 14)]
    {
        let history = iterate(&line, &[[0, 50], [50, 100]], Method::Optimized { robin: Robin::Value(p) }, until(1e-10));
        assert!((history.iterates.len() - 1).abs_diff(count) <= 1, "p = {p}: {}", history.iterates.len() - 1);
        if let (Some(rate), Some(bound)) = (rate, bound) {
            let history =
                iterate(&line, &[[0, 50], [50, 100]], Method::Optimized { robin: Robin::Value(p) }, exactly(20));
            assert!((history.observed.unwrap() - rate).abs() < 1e-4, "p = {p}: {:?}", history.observed);
            assert!((history.prediction.predicted.unwrap() - rate).abs() < 1e-4, "p = {p}: {:?}", history.prediction);
            assert!((history.prediction.bound.unwrap() - bound).abs() < 1e-4, "p = {p}: {:?}", history.prediction);
        }
    }
    // a cut away from the middle: lagged p needs no tuning
    for robin in [Robin::Auto, Robin::Lagged] {
        let history = iterate(&line, &[[0, 20], [20, 100]], Method::Optimized { robin }, until(1e-10));
        let count = history.iterates.len() - 1;
        assert!((3..=8).contains(&count), "{robin:?}: {count}");
    }
    for pieces in [3, 4, 8] {
        let cells = 96;
        let line = Line { cells, ..line.clone() };
        let cuts: Vec<[usize; 2]> = (0..pieces).map(|s| [s * cells / pieces, (s + 1) * cells / pieces]).collect();
        let history = iterate(&line, &cuts, Method::Optimized { robin: Robin::Lagged }, until(1e-10));
        assert!(history.iterates.len() - 1 <= 2 * pieces + 4, "{pieces}: {}", history.iterates.len() - 1);
    }
}

/// Theorem 6.5: equal pieces that overlap by half contract by cos²(π/(I + 1)).
#[test]
fn many_pieces() {
    for (pieces, expected) in [(2_usize, 0.25), (4, 0.654508), (8, 0.883022)] {
        let width = 40;
        let cells = width / 2 * (pieces + 1);
        let line = line(square(), cells, FaceDensity::Exact);
        let ranges: Vec<[usize; 2]> = (0..pieces).map(|s| [s * width / 2, s * width / 2 + width]).collect();
        let history = iterate(&line, &ranges, classical(Sweep::Parallel, false), until(1e-11));
        let exact = (std::f64::consts::PI / (pieces as f64 + 1.0)).cos().powi(2);
        assert!((exact - expected).abs() < 1e-5);
        assert!((history.observed.unwrap() - exact).abs() < 1e-4, "{pieces}: {:?} against {exact}", history.observed);
        assert!((history.prediction.predicted.unwrap() - exact).abs() < 1e-9, "{pieces}: {:?}", history.prediction);
        let bound = (std::f64::consts::FRAC_PI_2 / (pieces as f64 + 1.0)).cos().powi(2);
        assert!((history.prediction.bound.unwrap() - bound).abs() < 1e-12 && bound > exact, "{pieces}");
    }
}

/// Theorem 7.2, one step.
#[test]
fn in_time() {
    let line = line(square(), 100, FaceDensity::Trapezoid);
    let old = line.mapped(|xi| xi * xi);
    for (ratio, rate, bound) in [(1.0, 0.65295, 0.65845), (100.0, 0.14704, 0.24248)] {
        let history = line
            .iterate(0.0, &two(45, 55), classical(Sweep::Parallel, false), &old, Some((&old, ratio)), until(1e-11))
            .unwrap();
        assert!((history.observed.unwrap() - rate).abs() < 2e-4, "{ratio}: {:?} against {rate}", history.observed);
        assert!((history.prediction.bound.unwrap() - bound).abs() < 1e-5, "{ratio}: {:?}", history.prediction);
    }
}

/// Figure 8.5, and the counterexample to theorem 3.4.
#[test]
fn steep_densities() {
    let density = |c: f64| LineDensity::formula(&format!("{c}*(x - 0.5)^2 + 1")).unwrap();
    let count = |c: f64, linearized: bool, start: f64| {
        let line = line(density(c), 100, FaceDensity::Trapezoid);
        let start = line.mapped(|xi| xi.powf(start));
        let method = classical(Sweep::Parallel, linearized);
        line.iterate(0.0, &two(45, 55), method, &start, None, until(1e-8)).unwrap().iterates.len() - 1
    };
    for (start, linearized, counts) in [
        (1.0, true, [55, 19, 46, 91, 343]),
        (1.0, false, [66, 77, 86, 91, 96]),
        (1.3, true, [83, 93, 110, 116, 305]),
        (1.3, false, [82, 83, 88, 92, 96]),
    ] {
        for (c, expected) in [1.0, 10.0, 50.0, 100.0, 300.0].into_iter().zip(counts) {
            let found = count(c, linearized, start);
            let off = if linearized && c == 300.0 { 3 } else { 1 };
            assert!(found.abs_diff(expected) <= off, "C = {c}, {linearized}, ξ^{start}: {found} against {expected}");
        }
    }
    let line = line(density(300.0), 100, FaceDensity::Trapezoid);
    let history =
        iterate(&line, &two(48, 52), classical(Sweep::Parallel, true), Stop { iterations: 600, ..until(1e-10) });
    assert!(!history.converged);
    let smallest = history.iterates[500..].iter().map(|i| i.error).fold(f64::INFINITY, f64::min);
    assert!(smallest > 0.03, "{smallest}");
    assert!(iterate(&line, &two(48, 52), classical(Sweep::Parallel, false), until(1e-10)).converged);
}

/// The coarse correction: as many iterations for 64 pieces as for 2.
#[test]
fn coarse_correction() {
    let method = Method::Classical { sweep: Sweep::Parallel, linearized: false, coarse: Coarse::Galerkin };
    let c300 = || LineDensity::formula("300*(x - 0.5)^2 + 1").unwrap();
    type Row = (&'static str, fn() -> LineDensity, &'static [usize]);
    let rows: [Row; 3] = [
        ("x²+1", square, &[3, 3, 3, 3, 3, 3]),
        ("u₈₁", layer, &[7, 8, 10, 9, 9, 9]),
        ("C = 300", c300, &[10, 9, 9, 9, 8]),
    ];
    for (name, density, counts) in rows {
        for (pieces, expected) in [2, 4, 8, 16, 32, 64].into_iter().zip(counts) {
            let line = line(density(), 8 * pieces + 2, FaceDensity::Trapezoid);
            let ranges: Vec<[usize; 2]> = (0..pieces).map(|s| [8 * s, 8 * s + 10]).collect();
            let found = iterate(&line, &ranges, method, until(1e-8)).iterates.len() - 1;
            assert!(found.abs_diff(*expected) <= 1, "{name}, {pieces} pieces: {found} against {expected}");
        }
    }
}

/// The correction of ∫M: no density makes it take many more iterations for many pieces than for two, not even one for
/// which the correction of x takes more than a hundred.
#[test]
fn coarse_correction_of_the_integral() {
    let method = |coarse| Method::Classical { sweep: Sweep::Parallel, linearized: false, coarse };
    let count = |text: &str, pieces: usize, coarse| {
        let density = LineDensity::formula(text).unwrap();
        let line = line(density, 8 * pieces + 2, FaceDensity::Trapezoid);
        let ranges: Vec<[usize; 2]> = (0..pieces).map(|s| [8 * s, 8 * s + 10]).collect();
        let history = iterate(&line, &ranges, method(coarse), until(1e-8));
        assert!(history.converged, "{text}, {pieces} pieces");
        history.count()
    };
    let spike = "1 + 100*exp(-1000*(x - 0.5)^2)";
    assert!(count(spike, 16, Coarse::Galerkin) > 100);
    for text in [spike, "x^2 + 1", "300*(x - 0.5)^2 + 1", "1 + 30*sin(pi*x)^2", "exp(-6*x)"] {
        let counts = [2, 4, 8, 16, 32, 64].map(|pieces| count(text, pieces, Coarse::Integral));
        assert!(counts.iter().all(|n| 2 * n <= 3 * counts[0].max(8)), "{text}: {counts:?}");
    }
}

/// Optimal conditions in time end after as many iterations as pieces, optimised ones find the same mesh without a
/// number set, and both find that of one domain: half cells at the cuts count.
#[test]
fn conditions_in_time() {
    let line = line(square(), 96, FaceDensity::Trapezoid);
    let old = line.mapped(|xi| xi * xi);
    for ratio in [1.0, 100.0, 1e4] {
        for pieces in [2, 3, 4] {
            let cuts: Vec<[usize; 2]> = (0..pieces).map(|s| [s * 96 / pieces, (s + 1) * 96 / pieces]).collect();
            let run = |method, stop| line.iterate(0.0, &cuts, method, &old, Some((&old, ratio)), stop).unwrap();
            let optimal = run(Method::Optimal { panels: None }, exactly(pieces));
            assert!(optimal.iterates[pieces].error < 1e-11, "{ratio}, {pieces}: {:e}", optimal.iterates[pieces].error);
            let lagged = run(Method::Optimized { robin: Robin::Lagged }, until(1e-10));
            assert!(lagged.converged && lagged.count() <= 2 * pieces + 8, "{ratio}, {pieces}: {}", lagged.count());
        }
    }
}

/// The bound of theorem 7.2 is of the parallel sweep: alternating, its square bounds two iterations.
#[test]
fn alternating_in_time_contracts_by_the_square() {
    let line = line(square(), 100, FaceDensity::Trapezoid);
    let old = line.mapped(|xi| xi * xi);
    let run = |sweep| {
        line.iterate(0.0, &two(45, 55), classical(sweep, false), &old, Some((&old, 1.0)), until(1e-11)).unwrap()
    };
    let [parallel, alternating] =
        [Sweep::Parallel, Sweep::Alternating].map(|sweep| run(sweep).prediction.bound.unwrap());
    assert!((alternating - parallel * parallel).abs() < 1e-12);
    let observed = run(Sweep::Alternating).observed.unwrap();
    assert!(observed <= alternating && observed > 0.9 * alternating, "{observed} against {alternating}");
}
