//! Moving meshes in domains that are not boxes.

use driftmesh::density::{Monitor, RootGradient};
use driftmesh::formula::Formula;
use driftmesh::geometry::{
    BetweenCurves, Chart, Degree, DualCells, FormulaMap, Interpolator, Lattice, Mesh, check_unfolded, interpolate,
    remap,
};
use driftmesh::meshing::{EstimatorKind, MeshGenerator, Mmpde, Schwarz, Stochastic, Whole};
use driftmesh::mover::{Followed, Gait, Mover};
use std::f64::consts::PI;
use std::sync::Arc;

fn formula(text: &str, variables: &[&str]) -> Formula {
    Formula::parse(text, variables).unwrap()
}

fn image(x: &str, y: &str, closed: [bool; 2]) -> Arc<Chart> {
    let map = [x, y].map(|text| formula(text, &["s", "r"]));
    Arc::new(Chart::oriented(FormulaMap::new(map).unwrap(), closed, true).unwrap())
}

fn between(x: [f64; 2], bottom: &str, top: &str) -> Arc<Chart> {
    let curves = [bottom, top].map(|text| formula(text, &["x"]));
    Arc::new(Chart::new(BetweenCurves::new(x, curves).unwrap(), [false; 2]).unwrap())
}

/// The circle of radius 1.15 around (−0.1, 0.05), and those around it, by ζ + 1/ζ: s across, r around.
fn joukowski() -> [String; 2] {
    let (a, b) = ("(-0.1+1.15*(1+2*s)*cos(2*pi*r))", "(0.05+1.15*(1+2*s)*sin(2*pi*r))");
    [format!("{a}*(1 + 1/({a}^2 + {b}^2))"), format!("{b}*(1 - 1/({a}^2 + {b}^2))")]
}

/// The domains that every claim is tested on.
fn domains() -> Vec<(&'static str, Arc<Chart>)> {
    let [x, y] = joukowski();
    vec![
        ("annulus", image("(1+s)*cos(2*pi*r)", "(1+s)*sin(2*pi*r)", [false, true])),
        ("half annulus", image("(1+s)*cos(pi*r)", "(1+s)*sin(pi*r)", [false; 2])),
        ("wavy channel", between([0.0, 2.0], "0.15*sin(2*pi*x)", "1 + 0.15*cos(3*x)")),
        ("aerofoil", image(&x, &y, [false, true])),
        ("parallelogram", image("s + 0.5*r", "r", [false; 2])),
        ("bump channel", between([0.0, 2.0], "0.4*exp(-20*(x-1)^2)", "1")),
    ]
}

/// About n² cells in the shape of a domain.
fn mesh(name: &str, chart: &Arc<Chart>, n: usize) -> Mesh<2> {
    let cells = match name {
        "annulus" | "aerofoil" => [n / 2, 2 * n],
        "half annulus" => [2 * n / 3, 3 * n / 2],
        "parallelogram" => [n, n],
        _ => [3 * n / 2, 2 * n / 3],
    };
    Mesh::charted(Lattice::new(cells, chart.closed()).unwrap(), chart.clone()).unwrap()
}

type Field = Box<dyn Fn([f64; 2]) -> f64>;

/// A ring, a spiral and a front that crosses the domain, in coordinates in which the box around it is [−1, 1]².
fn features(chart: &Chart) -> Vec<(&'static str, Field)> {
    let (lower, upper) = chart.ends();
    let normal = move |x: [f64; 2]| [0, 1].map(|d| 2.0 * (x[d] - lower[d]) / (upper[d] - lower[d]) - 1.0);
    let of = move |f: fn(f64, f64) -> f64| -> Field {
        Box::new(move |x| {
            let [x, y] = normal(x);
            f(x, y)
        })
    };
    vec![
        ("ring", of(|x, y| (50.0 * ((x - 0.2).hypot(y - 0.1) - 0.6)).tanh())),
        ("spiral", of(|x, y| (30.0 * (y * (3.0 * x.hypot(y)).cos() + x * (3.0 * x.hypot(y)).sin())).tanh())),
        ("front", of(|x, y| (50.0 * (x + 0.6 * y - 0.1)).tanh())),
    ]
}

/// The largest and the mean error with which a mesh interpolates a function.
fn errors(mesh: &Mesh<2>, f: &Field) -> [f64; 2] {
    let fine = mesh.resampled(mesh.lattice().cells().map(|n| 4 * n)).unwrap();
    let u: Vec<f64> = mesh.x().iter().map(|x| f(*x)).collect();
    let at = Interpolator::new(mesh.parameters(), fine.parameters().x(), Degree::Linear).unwrap().values(&u);
    let off: Vec<f64> = at.iter().zip(fine.x()).map(|(u, x)| (u - f(*x)).abs()).collect();
    let cells = DualCells::new(&fine);
    let sum = off.iter().zip(cells.areas()).map(|(e, a)| e * a).sum::<f64>();
    [off.iter().copied().fold(0.0, f64::max), sum / fine.volume()]
}

/// The mesh after so many steps on a function, or at rest.
fn followed(start: &Mesh<2>, f: &Field, generator: impl MeshGenerator + 'static, steps: usize) -> Mesh<2> {
    let mut mover = Mover::new(generator);
    let (mut now, mut gait) = (start.clone(), Gait::at_rest(start));
    for _ in 0..steps {
        let u: Vec<f64> = now.x().iter().map(|x| f(*x)).collect();
        let rho = RootGradient::default().density(&now, &u, None).unwrap();
        let step = mover.step(&now, &gait, Followed { u: &u, rho: &rho }, 1.0).unwrap();
        let still = step.moved.mesh.parameters().farthest(now.parameters()) < 1e-4;
        (now, gait) = (step.moved.mesh, step.gait);
        if still {
            break;
        }
    }
    check_unfolded(&now).unwrap();
    now
}

/// The mean error of interpolation of a moved mesh is at most a quarter of that of equal cells.
#[test]
fn moved_meshes_are_four_times_as_good() {
    for (name, chart) in domains() {
        for (what, f) in features(&chart) {
            let start = mesh(name, &chart, 40);
            let moved = followed(&start, &f, Whole::default(), 100);
            let ([before, mean_before], [after, mean]) = (errors(&start, &f), errors(&moved, &f));
            let ratio = mean / mean_before;
            println!("{name:14} {what:7} {before:.3} {:.3} | {mean_before:.4} {ratio:.3}", after / before);
            assert!(ratio < 0.25, "{name}, {what}: {ratio:.3} of the error of equal cells");
        }
    }
}

/// Nodes all over the place, those on sides on their sides; along a closed axis also a turn further.
fn shaken(mesh: &Mesh<2>, seed: u64, turn: f64) -> Mesh<2> {
    let (lattice, places) = (mesh.lattice(), mesh.parameters());
    let mut state = seed;
    let s = places.x().iter().enumerate().map(|(k, s)| {
        let (node, cells) = (lattice.node(k), lattice.cells());
        std::array::from_fn(|d| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let shift = 0.5 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) / cells[d] as f64;
            let wraps = lattice.periodic()[d];
            let inside = wraps || !(node[d] == 0 || node[d] == cells[d]);
            s[d] + if inside { shift } else { 0.0 } + if wraps { turn } else { 0.0 }
        })
    });
    mesh.placed(s.collect()).unwrap()
}

/// Dual cells add up to the domain, and grow by what their faces sweep, wherever the nodes are on curved sides. The
/// volumes are those of calculus where it gives them.
#[test]
fn cells_tile_the_domain_and_grow_by_what_their_faces_sweep() {
    let known = [3.0 * PI, 1.5 * PI, 2.0 + 0.15 * 6.0_f64.sin() / 3.0, f64::NAN, 1.0, f64::NAN];
    for ((name, chart), known) in domains().into_iter().zip(known) {
        assert!(known.is_nan() || (chart.volume() / known - 1.0).abs() < 1e-13, "{name}: {}", chart.volume());
        let start = mesh(name, &chart, 36);
        let [old, new] = [(1, 0.0), (2, 0.3)].map(|(seed, turn)| DualCells::new(&shaken(&start, seed, turn)));
        let swept = old.swept(&new);
        let strides = new.patch().padded_strides();
        assert!((new.areas().iter().sum::<f64>() / chart.volume() - 1.0).abs() < 1e-12, "{name}");
        assert!(new.areas().iter().all(|area| *area > 0.0), "{name}");
        for (i, k) in new.patch().places().enumerate() {
            let outward: f64 = (0..2).map(|d| swept[k][d] - swept[k - strides[d]][d]).sum();
            let growth = new.areas()[i] - old.areas()[i];
            assert!((growth - outward).abs() < 1e-13 * chart.volume(), "{name}: {growth} against {outward}");
        }
    }
}

/// A conservative transfer keeps ∫u and constants; interpolation is of second order; both know closed axes.
#[test]
fn fields_are_carried_on_curved_domains() {
    for (name, chart) in domains() {
        let start = mesh(name, &chart, 36);
        let [old, new] = [(3, 0.0), (4, 1.2)].map(|(seed, turn)| shaken(&start, seed, turn));
        let u: Vec<f64> = old.x().iter().map(|[x, y]| (x + 0.3 * y).sin() + 2.0).collect();
        let sum =
            |mesh: &Mesh<2>, u: &[f64]| -> f64 { DualCells::new(mesh).areas().iter().zip(u).map(|(a, u)| a * u).sum() };
        let carried = remap(&old, &u, &new).unwrap();
        let off = sum(&new, &carried) / sum(&old, &u) - 1.0;
        assert!(off.abs() < 1e-12, "{name}: {off:.1e}");
        let constant = remap(&old, &vec![3.7; u.len()], &new).unwrap();
        // round-off of the areas swept along sides, as a share of the smallest cell
        let smallest = DualCells::new(&new).areas().iter().copied().fold(f64::INFINITY, f64::min);
        let off = constant.iter().map(|u| (u - 3.7).abs()).fold(0.0, f64::max);
        assert!(off < 1e-14 * chart.volume() / smallest, "{name}: {off:.1e}");
        let error = |n: usize| {
            let start = mesh(name, &chart, n);
            let [old, new] = [(3, 0.0), (4, 1.2)].map(|(seed, turn)| shaken(&start, seed, turn));
            let exact = |mesh: &Mesh<2>| -> Vec<f64> { mesh.x().iter().map(|[x, y]| (x + 0.3 * y).sin()).collect() };
            let off = interpolate(&old, &exact(&old), &new).into_iter().zip(exact(&new)).map(|(a, b)| (a - b).abs());
            off.fold(0.0, f64::max)
        };
        let order = (error(40) / error(160)).log(4.0);
        assert!((1.6..2.4).contains(&order), "{name}: order {order:.2}");
    }
}

/// Any point of the domain is found, the ones between a side and its chords as well; others are told of.
#[test]
fn points_are_located_on_curved_domains() {
    for (name, chart) in domains() {
        let mesh = mesh(name, &chart, 36);
        let places: Vec<[f64; 2]> = (0..400).map(|k| [0.618, 0.755].map(|s| (s * k as f64).fract())).collect();
        let sides = (0..40).flat_map(|k| [[0.0, k as f64 / 40.0], [k as f64 / 40.0, 1.0]]);
        let points: Vec<[f64; 2]> = places.into_iter().chain(sides).map(|s| chart.at(s)).collect();
        let u: Vec<f64> = mesh.x().iter().map(|[x, y]| (x + 0.3 * y).sin()).collect();
        let at = Interpolator::new(&mesh, &points, Degree::Cubic).unwrap_or_else(|k| panic!("{name}: {:?}", points[k]));
        let off = at.values(&u).into_iter().zip(&points).map(|(u, [x, y])| (u - (x + 0.3 * y).sin()).abs());
        let off = off.fold(0.0, f64::max);
        assert!(off < 2e-3, "{name}: {off:.1e}");
        let (lower, upper) = chart.ends();
        let outside = [lower[0] - 0.01, 0.5 * (lower[1] + upper[1])];
        assert_eq!(Interpolator::new(&mesh, &[points[0], outside], Degree::Linear).err(), Some(1), "{name}");
    }
}

/// Schwarz and strips lead to the mesh of one solve, also around a closed axis.
#[test]
fn subdomains_lead_to_the_same_mesh() {
    let settings = |text: &str| serde_json::from_str::<Schwarz>(text).unwrap();
    for (name, chart) in domains().into_iter().take(3) {
        let f = &features(&chart)[0].1;
        let start = mesh(name, &chart, 32);
        let whole = followed(&start, f, Whole::to(1e-6), 4);
        let schwarz = followed(&start, f, settings(r#"{"subdomains": [2, 2], "overlap": 4, "tolerance": 1e-9}"#), 4);
        let strips = followed(&start, f, Stochastic::new([2, 2], 1, EstimatorKind::default()), 4);
        for (method, mesh, most) in [("schwarz", schwarz, 1e-5), ("stochastic", strips, 2e-2)] {
            let off = mesh.farthest(&whole) / whole.shortest_edge();
            assert!(off < most, "{name}, {method}: {off:.1e} of the shortest edge");
        }
    }
    let _ = Mmpde::default();
}
