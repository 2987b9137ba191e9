//! Published problems in one dimension, against exact solutions or the tables in `published/`, which
//! `published/references.py` makes with NumPy and SciPy. The layers of Burgers' equation that form and merge are in
//! `moving_line.rs`.

use crate::runs::{HEAD, line as run};
use driftmesh::error::Error;
use driftmesh::study::{Kind, MovingLine, MovingRun, Source};
use std::path::Path;

/// How a run ended, and its failure.
type Ended = (MovingRun<1>, Option<Error>);

/// A study of a line, which may fail: tables without `[study]`.
fn ended(text: &str) -> Ended {
    MovingLine::from_source(&Source::new("published.toml", format!("{HEAD}{text}"))).unwrap().compute().unwrap()
}

/// A file of `studies/` on so many cells.
fn run_study(name: &str, cells: usize) -> MovingRun<1> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("studies/{name}.toml"));
    let mut source = Source::read(&file).unwrap();
    source.set(&format!("grid.cells=[{cells}]")).unwrap();
    let (run, failure) = MovingLine::from_source(&source).unwrap().compute().unwrap();
    assert!(failure.is_none(), "{name}: {failure:?}");
    run
}

/// Nodes and the values of an unknown at the end.
fn solution(run: &MovingRun<1>, unknown: usize) -> (Vec<f64>, Vec<f64>) {
    let state = run.state.as_ref().unwrap();
    (state.mesh.x().iter().map(|[x]| *x).collect(), state.u.component(unknown).collect())
}

/// A table with a head: its columns.
fn table(text: &str) -> Vec<Vec<f64>> {
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|row| row.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    (0..rows[0].len()).map(|c| rows.iter().map(|row| row[c]).collect()).collect()
}

/// Linear interpolation.
fn at(x: &[f64], u: &[f64], point: f64) -> f64 {
    let k = x.partition_point(|x| *x <= point).clamp(1, x.len() - 1);
    u[k - 1] + (point - x[k - 1]) / (x[k] - x[k - 1]) * (u[k] - u[k - 1])
}

/// The largest and the mean distance of an unknown from a table, and the sum of all, as shares of its range there.
fn off(run: &MovingRun<1>, unknown: usize, reference: &[Vec<f64>]) -> [f64; 2] {
    let (x, u) = solution(run, unknown);
    let exact = &reference[unknown + 1];
    let range =
        exact.iter().fold(f64::NEG_INFINITY, |m, v| m.max(*v)) - exact.iter().fold(f64::INFINITY, |m, v| m.min(*v));
    distances(&x, &u, |point| at(&reference[0], exact, point)).map(|distance| distance / range)
}

/// The largest and the mean distance from a function.
fn distances(x: &[f64], u: &[f64], exact: impl Fn(f64) -> f64) -> [f64; 2] {
    let off: Vec<f64> = x.iter().zip(u).map(|(x, u)| (u - exact(*x)).abs()).collect();
    let mean = x.windows(2).zip(off.windows(2)).map(|(x, off)| 0.5 * (off[0] + off[1]) * (x[1] - x[0])).sum::<f64>();
    [off.iter().fold(0.0, |most, off| f64::max(most, *off)), mean / (x[x.len() - 1] - x[0])]
}

/// Where u falls below a level, the last time on the way to the right, and the length of the cell there.
fn falls_below(x: &[f64], u: &[f64], level: f64) -> [f64; 2] {
    let k = u.iter().rposition(|u| *u >= level).unwrap();
    let h = x[k + 1] - x[k];
    [x[k] + (u[k] - level) / (u[k] - u[k + 1]) * h, h]
}

/// A flame front that a heated wall ignites and that runs to the other end.
///
/// Dwyer and Sanders, *Modeling of unsteady combustion phenomena* (1978); Verwer, Blom, Furzeland and Zegeling, *A
/// moving grid method for one-dimensional PDEs based on the method of lines* (1989).
#[test]
fn the_flame_of_dwyer_and_sanders() {
    let reference = table(include_str!("published/flame.csv"));
    for (cells, largest, mean) in [(40, 0.30, 6e-3), (80, 0.08, 1.5e-3), (160, 0.031, 6e-4)] {
        let run = run_study("flame", cells);
        for unknown in 0..2 {
            let found = off(&run, unknown, &reference);
            println!("flame, {cells} cells: {found:?}, {} steps", run.record.work.steps);
            assert!(found[0] < largest && found[1] < mean, "{cells} cells, unknown {unknown}: {found:?}");
        }
    }
}

/// A spot that ignites in the middle and burns to a front which runs to the cold wall.
///
/// Adjerid and Flaherty, *A moving finite element method with error estimation and refinement for one-dimensional time
/// dependent partial differential equations* (1986).
#[test]
fn the_hot_spot_of_adjerid_and_flaherty() {
    let reference = table(include_str!("published/hot-spot.csv"));
    for (cells, allowed) in [(40, 5e-3), (160, 2e-3)] {
        let run = run(&format!(
            r#"
            [grid]
            cells = [{cells}]
            [time]
            start = 0.0
            end = 0.29
            [pde]
            kind = "formula"
            unknowns = ["u"]
            diffusivity = {{ u = "1" }}
            source = {{ u = "0.25*(2 - u)*exp(20 - 20/u)" }}
            initial = {{ u = "1" }}
            boundary = {{ u = {{ left = "no-flux", right = "1" }} }}
            "#
        ));
        let found = off(&run, 0, &reference);
        println!("hot spot, {cells} cells: {found:?}, {} steps", run.record.work.steps);
        assert!(found[0] < allowed, "{cells} cells: {found:?}");
    }
}

/// Two waves that meet, destroy most of each other, and go on: no diffusion, and a stiff reaction.
///
/// Madsen, in *PDE Software: Modules, Interfaces and Systems* (1984), as given by Verwer and others (1989).
#[test]
fn the_opposite_waves_of_madsen() {
    let reference = table(include_str!("published/opposite-waves.csv"));
    for (cells, largest, mean) in [(40, 0.08, 6e-3), (80, 0.03, 2e-3)] {
        let run = run_study("opposite-waves", cells);
        for unknown in 0..2 {
            let found = off(&run, unknown, &reference);
            println!("opposite waves, {cells} cells: {found:?}, {} steps", run.record.work.steps);
            assert!(found[0] < largest && found[1] < mean, "{cells} cells, unknown {unknown}: {found:?}");
        }
    }
}

/// Pulses of two components that split and travel apart, of second order.
///
/// Gray and Scott, *Autocatalytic reactions in the isothermal continuous stirred tank reactor* (1984); Doelman, Kaper
/// and Zegeling, *Pattern formation in the one-dimensional Gray–Scott model* (1997).
#[test]
fn the_pulses_of_gray_and_scott() {
    let reference = table(include_str!("published/pulses.csv"));
    let found = [40, 80].map(|cells| off(&run_study("pulses", cells), 1, &reference));
    println!("pulses: {found:?}");
    assert!(found[0][0] < 0.06 && found[1][0] < 0.015, "{found:?}");
    assert!((found[0][1] / found[1][1]).log2() > 1.7, "{found:?}");
}

/// The times of blow-up of u_t = u_xx + f(u) with u = 0 at the ends: to 1e-4, and the run says that it is one.
///
/// Budd, Huang and Russell, *Moving mesh methods for problems with blow-up* (1996). The references are of
/// `published/references.py`.
#[test]
fn blow_ups_are_followed_to_their_time_and_named() {
    for (source, initial, exact, relative) in
        [("u^2", "20*sin(pi*x)", 0.082_437_5, 1.1e-3), ("exp(u)", "5*sin(pi*x)", 0.009_841_95, 5e-3)]
    {
        for cells in [40, 80, 160] {
            let (run, failure) = ended(&format!(
                "[grid]\ncells = [{cells}]\n[time]\nstart = 0.0\nend = 1.0\n[pde]\nkind = \"formula\"\n\
                 unknowns = [\"u\"]\ndiffusivity = {{ u = \"1\" }}\nsource = {{ u = \"{source}\" }}\n\
                 initial = {{ u = \"{initial}\" }}\nboundary = {{ u = \"0\" }}\n"
            ));
            let Some(Error::Failed { moment: Some(moment), .. }) = failure else { panic!("{failure:?}") };
            let off = moment.t - exact;
            println!("{source}, {cells} cells: t = {:.7}, off by {off:.1e}, {:.1e} of it", moment.t, off / exact);
            assert!(off.abs() < 1e-4 && off.abs() < relative * exact, "{source}, {cells} cells: {off:e}");
            let said = run.record.warnings.iter().find(|said| said.starts_with("blow-up: `u`")).unwrap();
            assert!(said.contains("x = 0.50") || said.contains("x = 0.49"), "{said}");
        }
    }
}

/// Steps of a given error may be too long for the mesh to follow a layer that forms and rests, ε u'' + u u' = u: the
/// run then says so, and says nothing where the layer is resolved.
#[test]
fn a_layer_that_the_mesh_misses_is_said() {
    let warnings = |cells: usize| {
        let run = run(&format!(
            "[grid]\ncells = [{cells}]\n[time]\nstart = 0.0\nend = 10.0\ntolerance = 1e-4\n[pde]\n\
             kind = \"formula\"\nunknowns = [\"u\"]\nflux = {{ u = [\"-u^2/2\"] }}\n\
             diffusivity = {{ u = \"1e-3\" }}\nsource = {{ u = \"-u\" }}\ninitial = {{ u = \"-7/6 + 8/3*x\" }}\n\
             boundary = {{ u = {{ left = \"-7/6\", right = \"3/2\" }} }}\n"
        ));
        let (x, u) = solution(&run, 0);
        let k = (0..cells).max_by(|a, b| (u[a + 1] - u[*a]).total_cmp(&(u[b + 1] - u[*b]))).unwrap();
        let missed = u[k + 1] - u[k] > 0.4 * (8.0 / 3.0);
        let said = run.record.warnings.iter().any(|said| said.contains("the mesh has not come to a layer of it"));
        println!("{cells} cells: {:.2} within one cell at x = {:.4}, {}", u[k + 1] - u[k], x[k], x[k + 1] - x[k]);
        assert_eq!(said, missed, "{cells} cells: {:?}", run.record.warnings);
        missed
    };
    let missed = [40, 120].map(warnings);
    println!("missed: {missed:?}");
    assert!(!missed[1]);
}

/// What grows to a bound, however fast, is no blow-up.
#[test]
fn a_fast_growth_to_a_bound_is_no_blow_up() {
    let run =
        run("[grid]\ncells = [40]\n[time]\nstart = 0.0\nend = 1.0\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\n\
         diffusivity = { u = \"1e-3\" }\nsource = { u = \"1e4*u*(1 - u)\" }\n\
         initial = { u = \"0.01*sin(pi*x)\" }\nboundary = { u = \"no-flux\" }\n");
    assert!(!run.record.warnings.iter().any(|said| said.contains("blow-up")), "{:?}", run.record.warnings);
}

/// Barenblatt's solution of u_t = Δ(u^m) in a ball: its order away from the front is 1.8 at least, and the front, where
/// u is a hundredth of its largest value, is right to one cell.
///
/// Barenblatt, *On some unsteady motions of a liquid and gas in a porous medium* (1952); Pattle (1959).
#[test]
fn the_porous_medium_of_barenblatt() {
    for (m, level) in [(2.0_f64, 1e-2), (4.0, 1e-1)] {
        let (beta, end, start) = (1.0 / (3.0 * (m - 1.0) + 2.0), 1.0_f64, 0.01_f64);
        let (alpha, k) = (3.0 * beta, (m - 1.0) * beta / (2.0 * m));
        let formula = |t: &str| {
            let power = 1.0 / (m - 1.0);
            format!("({t})^(-{alpha})*max({k} - {k}*x^2*({t})^(-{}), 0)^{power}", 2.0 * beta)
        };
        let exact = |x: f64| (k - k * x * x).max(0.0).powf(1.0 / (m - 1.0));
        let errors = [40, 80, 160].map(|cells| {
            let run = run(&format!(
                r#"
                [grid]
                cells = [{cells}]
                [domain]
                upper = [1.5]
                coordinates = "spherical"
                [time]
                start = {start}
                end = {end:?}
                tolerance = 1e-4
                [pde]
                kind = "formula"
                unknowns = ["u"]
                diffusivity = {{ u = "{m}*u^{}" }}
                initial = {{ u = "{}" }}
                boundary = {{ u = "no-flux" }}
                "#,
                m - 1.0,
                formula(&start.to_string()),
            ));
            let (x, u) = solution(&run, 0);
            let largest = exact(0.0);
            let [front, cell] = falls_below(&x, &u, level * largest);
            let there = (1.0 - level.powf(m - 1.0)).sqrt();
            let count = x.partition_point(|x| *x < 0.8);
            let [away, _] = distances(&x[..count], &u[..count], exact);
            let drift = run.record.reports.last().unwrap().conserved.drift;
            println!("m = {m}, {cells} cells: {away:.1e} away, front off by {:.2} cells", (front - there) / cell);
            assert!((front - there).abs() < cell, "m = {m}, {cells} cells: {front} where it is {there}");
            assert!(drift.abs() < 1e-12, "{drift:e}");
            away
        });
        let order = (errors[0] / errors[2]).log(4.0);
        assert!(order > 1.8, "m = {m}: order {order:.2} of {errors:?}");
    }
}

/// A soliton keeps its shape; the third derivative is the slope of an unknown without a time derivative, w = u_x.
///
/// Korteweg and de Vries (1895); Zabusky and Kruskal, *Interaction of solitons in a collisionless plasma* (1965).
#[test]
fn the_soliton_of_korteweg_and_de_vries() {
    let error = |cells| run_study("soliton", cells).record.reports.last().unwrap().error.unwrap().linf;
    let errors = [80, 160].map(error);
    println!("soliton: {errors:?}");
    assert!(errors[0] < 0.02 && (errors[0] / errors[1]).log2() > 1.5, "{errors:?}");
}

/// A wave into a state that grows by itself, with its exact profile and speed 5 √(kD/6).
///
/// Fisher, *The wave of advance of advantageous genes* (1937); Ablowitz and Zeppetella (1979) for the solution.
#[test]
fn the_wave_of_fisher() {
    for (cells, allowed) in [(40, 5e-2), (160, 2e-2)] {
        let (k, d) = (10.0_f64, 1e-3_f64);
        let speed = 5.0 * (k * d / 6.0).sqrt();
        let exact = |t: &str| format!("(1 + exp((x - 0.2 - {speed}*{t})/{}))^(-2)", (6.0 * d / k).sqrt());
        let (start, at_t) = (exact("0"), exact("t"));
        let run = run(&format!(
            "[grid]\ncells = [{cells}]\n[time]\nstart = 0.0\nend = 3.0\n[pde]\nkind = \"formula\"\n\
             unknowns = [\"u\"]\ndiffusivity = {{ u = \"{d}\" }}\nsource = {{ u = \"{k}*u*(1 - u)\" }}\n\
             initial = {{ u = \"{start}\" }}\nexact = {{ u = \"{at_t}\" }}\nboundary = {{ u = \"{at_t}\" }}\n"
        ));
        let error = run.record.reports.last().unwrap().error.unwrap();
        println!("Fisher, {cells} cells: {error:?}");
        assert!(error.l2 < allowed, "{cells} cells: {error:?}");
    }
}
