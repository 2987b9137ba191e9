//! The mesh equation: its order, its forms, its solution.

use super::*;
use crate::geometry::check_unfolded;
use crate::numerics::difference::Gradient;
use crate::numerics::linear::{LatticeMatrix, LinearSolver};
use proptest::prelude::*;

/// 200 smooth densities of contrasts up to 10⁴: the conservative form is symmetric over its volumes, walks on it have
/// probabilities that stop with 1/(1 + Σw) = 1/(1 + 2a_x + 2a_y), conjugate gradients converge, and no mesh folds on
/// its way to rest.
#[test]
fn the_conservative_form_carries_any_density() {
    let [_, equation] = forms();
    let mut state = 7_u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    for case in 0..200 {
        let periodic = [[false, false], [true, false], [false, true], [true, true]][case % 4];
        let start = mesh([18 + case % 7, 18], periodic);
        let (contrast, modes) = (4.0 * random(), [(); 4].map(|()| [1 + case % 3, 1 + case % 2].map(|m| m as f64)));
        let phases = modes.map(|_| [random(), random()]);
        let wave = |[x, y]: [f64; 2]| {
            let part = |([m, n], [a, b]): ([f64; 2], [f64; 2])| {
                (2.0 * PI * (m * 0.5 * x + a)).sin() * (2.0 * PI * (n * y + b)).sin()
            };
            modes.into_iter().zip(phases).map(part).sum::<f64>() / 4.0
        };
        let exponents: Vec<f64> = start.x().iter().map(|&x| wave(x)).collect();
        let [low, high] =
            [f64::min as fn(f64, f64) -> f64, f64::max].map(|f| exponents.iter().copied().reduce(f).unwrap());
        let rho: Density = exponents.iter().map(|e| 10_f64.powf(contrast * (e - low) / (high - low))).collect();

        let lattice = *start.lattice();
        let operator = equation.operator(&lattice, &rho, DT).unwrap();
        operator.check_weights(&start).unwrap();
        let a = equation.stiffness(&lattice, DT);
        let patch = Patch::whole(&lattice);
        for k in patch.nodes(&lattice) {
            let total: f64 = operator.weights()[k].as_flattened().iter().sum();
            assert!(a[0] != a[1] || (total - 4.0 * a[0]).abs() < 1e-9 * total);
        }
        // W_i w_ik = W_k w_ki, told without W: around every square of inner nodes both ways give the same product
        let ([n, m], w) = (lattice.nodes(), operator.weights());
        for (i, j) in (1..n - 2).flat_map(|i| (1..m - 2).map(move |j| (i, j))) {
            let [p, q, r, s] = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|node| lattice.index(node));
            let (there, back) =
                (w[p][0][1] * w[q][1][1] * w[r][0][0] * w[s][1][0], w[p][1][1] * w[s][0][1] * w[r][1][0] * w[q][0][0]);
            assert!((there / back - 1.0).abs() < 1e-12, "case {case} at ({i}, {j})");
        }
        let mut whole = Whole::default();
        let mut moved = start.clone();
        for step in 0..30 {
            let Moved { mesh, work, .. } = whole.step(&equation, &moved, &rho, DT).unwrap();
            check_unfolded(&mesh).unwrap_or_else(|failure| panic!("case {case}, step {step}: {failure}"));
            // two of the solves are those of both coordinates, one after another on the sides
            assert!(work.linear_iterations < 100, "case {case}: {} iterations", work.linear_iterations);
            moved = mesh;
        }
        assert!(largest_difference(&moved, &start) > 1e-4 || contrast < 0.1, "case {case} does not move");
    }
}

/// The conservative form is solved to the share of the shortest edge that is asked for, a hundredth where nothing is
/// said, and no better than that needs; the gradient form to 1e-12 of the largest coordinate. ARCHITECTURE.md says so.
#[test]
fn steps_are_as_exact_as_the_pages_say() {
    let start = mesh([24, 18], [false; 2]);
    let rho = bump(&start, 30.0, 0.3);
    let off = |equation: &Mmpde, mut whole: Whole| {
        let moved = whole.step(equation, &start, &rho, DT).unwrap().mesh;
        largest_difference(&moved, &exact_step(equation, &start, &rho))
    };
    let ([gradient, conservative], edge) = (forms(), start.shortest_edge());
    let [default, finer] = [Whole::default(), Whole::to(1e-7)].map(|whole| off(&conservative, whole) / edge);
    println!("{default:.1e} and {finer:.1e} of the shortest edge");
    assert!((1e-6..=1e-2).contains(&default) && finer <= 1e-7, "{default:.1e}, {finer:.1e}");
    let exact = off(&gradient, Whole::default());
    assert!(exact < 1e-11, "{exact:.1e}");
    let page = include_str!("../../../ARCHITECTURE.md").split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(page.contains("by conjugate gradients to a hundredth of the shortest edge"));
}

/// The published displacement form X = x − Lξ, whose source is b L (the paper prints b (1 + L)), gives the same mesh.
#[test]
fn displacements_give_the_mesh_of_the_variables_themselves() {
    for periodic in [[true, false], [false, true], [true, true]] {
        let start = mesh([20, 15], periodic);
        let rho = bump(&start, 5.0, 0.3);
        let moved = advance(&mut Whole::default(), &start, &rho, 3);
        let (equation, lattice, extent) = (Mmpde::published(), *start.lattice(), start.extent());
        let b = Gradient::Central.of_log(&lattice, rho.largest());
        // L ξ of every node, measured from the corner of the box: only for periodic axes are displacements periodic
        let linear: Vec<[f64; 2]> = start.x().to_vec();
        let patch = Patch::whole(&lattice);
        let matrix: LatticeMatrix<2, 5> = equation.operator(&lattice, &rho, DT).unwrap().matrix(patch);
        let mut x = start.clone();
        for _ in 0..3 {
            let mut sides = x.x().to_vec();
            move_sides(&equation, &x, &rho, DT, &mut sides, &mut Default::default()).unwrap();
            let displacement = |x: &[[f64; 2]]| -> Vec<[f64; 2]> {
                x.iter().zip(&linear).map(|(x, l)| [0, 1].map(|c| x[c] - l[c])).collect()
            };
            let old = displacement(x.x());
            let right: Vec<[f64; 2]> =
                patch.nodes(&lattice).map(|k| [0, 1].map(|c| old[k][c] + DT * b[k][c] * extent[c])).collect();
            let mut values = displacement(&sides);
            let mut padded = patch.gather(&lattice, &values, [[0.0; 2]; 2]);
            SparseLu::default().solve(&matrix, &right, &mut padded, [1e-13; 2]).unwrap();
            patch.scatter(&lattice, &padded, &mut values, [[0.0; 2]; 2]);
            let positions = values.iter().zip(&linear).map(|(v, l)| [0, 1].map(|c| v[c] + l[c])).collect();
            x = x.moved(positions).unwrap();
        }
        let difference = largest_difference(&x, &moved);
        assert!(difference < 1e-9, "periodic {periodic:?}: off by {difference:e}");
    }
}

/// With ρ = 1/(g'(ξ) g'(η)) frozen, x = g(ξ), y = g(η) is the steady mesh; the discrete one meets it with order 2.
#[test]
fn the_mesh_equation_is_second_order_in_space() {
    let g = |s: f64| s + 0.1 * (2.0 * std::f64::consts::PI * s).sin();
    let slope = |s: f64| 1.0 + 0.2 * std::f64::consts::PI * (2.0 * std::f64::consts::PI * s).cos();
    for gradient in [Gradient::Central, Gradient::Log] {
        let error = |n: usize| {
            let lattice = Lattice::bounded([n, n]).unwrap();
            let start = Mesh::uniform(lattice, [0.0; 2], [1.0; 2]).unwrap();
            let rho: Density = start.x().iter().map(|&[s, r]| 1.0 / (slope(s) * slope(r))).collect();
            let equation = Mmpde { relaxation: Relaxation::Time(1.0), form: Form::Gradient(gradient) };
            // three steps of 100 relaxation times leave 1e-9 of the start
            let steady =
                (0..3).fold(start.clone(), |m, _| Whole::default().step(&equation, &m, &rho, 100.0).unwrap().mesh);
            let exact: Vec<[f64; 2]> = start.x().iter().map(|&[s, r]| [g(s), g(r)]).collect();
            largest_difference(&steady, &start.moved(exact).unwrap())
        };
        let order = (error(16) / error(64)).log(4.0);
        assert!((order - 2.0).abs() < 0.1, "{gradient:?}: observed order {order:.3}, expected 2");
    }
}

/// Of a density for each axis, which changes along its own axis alone, each spaces the nodes along its axis by itself:
/// edges are inversely proportional to the mean of ρ at their ends, whatever the other density is, and whoever solves.
#[test]
fn each_axis_has_its_own_density() {
    let start = mesh([24, 16], [false; 2]);
    let [across, up] = [24, 16].map(|n| {
        (0..=n).map(|i| 1.0 + 30.0 * (-0.5 * (i as f64 - 0.7 * n as f64).powi(2)).exp()).collect::<Vec<f64>>()
    });
    let lattice = *start.lattice();
    let of = |d: usize, line: &[f64]| (0..lattice.len()).map(|k| line[lattice.node(k)[d]]).collect::<Vec<f64>>();
    let rho = Density::of_axes([of(0, &across), of(1, &up)]).unwrap();
    let place = |line: &[f64], i: usize| {
        let edges: Vec<f64> = line.windows(2).map(|ends| 2.0 / (ends[0] + ends[1])).collect();
        edges[..i].iter().sum::<f64>() / edges.iter().sum::<f64>()
    };
    let exact = (0..lattice.len())
        .map(|k| lattice.node(k))
        .map(|[i, j]| [start.lower()[0] + 2.0 * place(&across, i), start.lower()[1] + place(&up, j)]);
    let exact = start.moved(exact.collect()).unwrap();
    let equation = Mmpde { relaxation: Relaxation::Time(1.0), form: Form::Conservative };
    let mut schwarz = Schwarz::new([2, 2], 3);
    schwarz.tolerance = Some(1e-10);
    let generators: [Box<dyn MeshGenerator>; 2] = [Box::new(Whole::to(1e-9)), Box::new(schwarz)];
    for mut generator in generators {
        let steady = (0..4).fold(start.clone(), |m, _| generator.step(&equation, &m, &rho, 1e3).unwrap().mesh);
        assert!(largest_difference(&steady, &exact) < 1e-8, "{:e}", largest_difference(&steady, &exact));
    }
}

/// Implicit Euler: with ρ frozen, halving the step halves the distance to the mesh of very small steps.
#[test]
fn the_mesh_equation_is_first_order_in_time() {
    let start = mesh([16, 16], [false; 2]);
    let rho = bump(&start, 5.0, 0.4);
    let after = |steps: usize| {
        let dt = 0.1 / steps as f64;
        let mut generator = Whole::default();
        (0..steps).fold(start.clone(), |m, _| generator.step(&Mmpde::published(), &m, &rho, dt).unwrap().mesh)
    };
    let reference = after(2048);
    let [coarse, fine] = [8, 32].map(|steps| largest_difference(&after(steps), &reference));
    let order = (coarse / fine).log(4.0);
    assert!((order - 1.0).abs() < 0.1, "observed order {order:.3}, expected 1");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    /// A step is the solution of its own system, checked against a sparse LU.
    #[test]
    fn a_step_solves_its_system(
        n in 4_usize..30,
        m in 4_usize..30,
        px: bool,
        py: bool,
        height in 0.0..50.0_f64,
        log_dt in -4.0..0.0_f64,
    ) {
        let start = mesh([n, m], [px, py]);
        let rho = bump(&start, height, 0.3);
        let dt = 10_f64.powf(log_dt);
        let equation = Mmpde { relaxation: Relaxation::Time(1.0), form: Form::Gradient(Gradient::Log) };
        let Moved { mesh: moved, work, .. } = Whole::default().step(&equation, &start, &rho, dt).unwrap();
        prop_assert!(work.linear_solves >= 2);
        let lattice = start.lattice();
        let patch = Patch::whole(lattice);
        let matrix: LatticeMatrix<2, 5> = equation.operator(lattice, &rho, dt).unwrap().matrix(patch);
        let right: Vec<[f64; 2]> = patch.nodes(lattice).map(|k| start.x()[k]).collect();
        // the direct solver starts from the old mesh between the new sides
        let mut guess = start.x().to_vec();
        lattice.sides().for_each(|k| guess[k] = moved.x()[k]);
        let [w, h] = start.extent();
        let mut x = patch.gather(lattice, &guess, [[w, 0.0], [0.0, h]]);
        SparseLu::default().solve(&matrix, &right, &mut x, [1e-10; 2]).unwrap();
        for (node, place) in patch.nodes(lattice).zip(patch.places()) {
            for (a, b) in moved.x()[node].iter().zip(x[place]) {
                prop_assert!((a - b).abs() < 2e-10);
            }
        }
    }
}
