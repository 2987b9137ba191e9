use super::*;
use crate::geometry::{Lattice, Patch, check_unfolded};
use crate::numerics::difference::Gradient;
use crate::numerics::linear::{LatticeMatrix, LinearSolver, SparseLu};
use proptest::prelude::*;

const DT: f64 = 1e-3;

fn mesh(cells: [usize; 2], periodic: [bool; 2]) -> Mesh<2> {
    Mesh::uniform(Lattice::new(cells, periodic).unwrap(), [-1.0, 2.0], [1.0, 3.0]).unwrap()
}

/// A smooth density with a bump of the given height, periodic on the box.
fn bump(mesh: &Mesh<2>, height: f64, centre: f64) -> Vec<f64> {
    let wave = |s: f64| (2.0 * std::f64::consts::PI * (s - centre)).cos();
    let place = |x: [f64; 2]| [0.5 * (x[0] + 1.0), x[1] - 2.0];
    mesh.x().iter().map(|&x| place(x)).map(|[s, r]| 1.0 + height * (2.0 * (wave(s) + wave(r) - 2.0)).exp()).collect()
}

fn advance(generator: &mut dyn MeshGenerator, mesh: &Mesh<2>, rho: &[f64], steps: usize) -> Mesh<2> {
    (0..steps).fold(mesh.clone(), |mesh, _| generator.step(&Mmpde::default(), &mesh, rho, DT).unwrap().mesh)
}

fn largest_difference(a: &Mesh<2>, b: &Mesh<2>) -> f64 {
    let pairs = a.x().as_flattened().iter().zip(b.x().as_flattened());
    pairs.fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

/// The laws of every generator, on every kind of lattice.
fn laws<G: MeshGenerator>(make: impl Fn() -> G) {
    let advance = |mesh: &Mesh<2>, rho: &[f64], steps: usize| advance(&mut make(), mesh, rho, steps);
    for periodic in [[false, false], [true, false], [false, true], [true, true]] {
        let start = mesh([24, 17], periodic);
        // constant ρ leaves a uniform mesh at rest, to the last bit: there is nothing to solve
        let rest = advance(&start, &vec![3.7; start.x().len()], 3);
        assert_eq!(rest, start, "periodic {periodic:?}");
        // ρ → cρ changes nothing; a power of two not even a bit
        let rho = bump(&start, 5.0, 0.3);
        let moved = advance(&start, &rho, 20);
        check_unfolded(&moved).unwrap();
        let doubled: Vec<f64> = rho.iter().map(|r| 2.0 * r).collect();
        assert_eq!(advance(&start, &doubled, 20), moved);
        let scaled: Vec<f64> = rho.iter().map(|r| 0.123 * r).collect();
        let difference = largest_difference(&advance(&start, &scaled, 20), &moved);
        assert!(difference < 1e-13, "ρ → cρ moved the mesh by {difference:e}");
        // side nodes stay exactly on the box
        let (nodes, lattice) = (start.lattice().nodes(), start.lattice());
        for (k, x) in moved.x().iter().enumerate() {
            for d in (0..2).filter(|&d| !periodic[d]) {
                let at = lattice.node(k)[d];
                let side = [(0, start.lower()[d]), (nodes[d] - 1, start.upper()[d])];
                assert!(side.iter().all(|&(end, value)| at != end || x[d] == value), "node {k} left its side");
            }
        }
    }
}

#[test]
fn whole_keeps_the_laws() {
    laws(Whole::default);
}

#[test]
fn fixed_keeps_the_laws() {
    laws(Fixed::default);
}

/// Nodes are drawn to where ρ is large: the cell at the bump shrinks, and equidistribution improves.
#[test]
fn the_mesh_follows_its_density() {
    let start = mesh([30, 30], [false; 2]);
    let density = |mesh: &Mesh<2>| -> Vec<f64> {
        mesh.x().iter().map(|[x, y]| 1.0 + 8.0 * (-20.0 * (x * x + (y - 2.5).powi(2))).exp()).collect()
    };
    let mut generator = Whole::default();
    let moved = (0..300).fold(start.clone(), |mesh, _| {
        generator.step(&Mmpde { relaxation: 0.1, ..Mmpde::default() }, &mesh, &density(&mesh), DT).unwrap().mesh
    });
    let figure = |mesh: &Mesh<2>| crate::geometry::quality(mesh, &density(mesh)).equidistribution;
    assert!(figure(&moved) < 0.5 * figure(&start), "{} from {}", figure(&moved), figure(&start));
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
            let rho: Vec<f64> = start.x().iter().map(|&[s, r]| 1.0 / (slope(s) * slope(r))).collect();
            let equation = Mmpde { relaxation: 1.0, gradient };
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

/// Implicit Euler: with ρ frozen, halving the step halves the distance to the mesh of very small steps.
#[test]
fn the_mesh_equation_is_first_order_in_time() {
    let start = mesh([16, 16], [false; 2]);
    let rho = bump(&start, 5.0, 0.4);
    let after = |steps: usize| {
        let dt = 0.1 / steps as f64;
        let mut generator = Whole::default();
        (0..steps).fold(start.clone(), |m, _| generator.step(&Mmpde::default(), &m, &rho, dt).unwrap().mesh)
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
    fn a_step_solves_its_system(n in 4_usize..30, m in 4_usize..30, px: bool, py: bool, height in 0.0..50.0_f64, log_dt in -4.0..0.0_f64) {
        let start = mesh([n, m], [px, py]);
        let rho = bump(&start, height, 0.3);
        let dt = 10_f64.powf(log_dt);
        let equation = Mmpde { relaxation: 1.0, gradient: Gradient::Log };
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

#[test]
fn a_density_that_does_not_fit_is_refused() {
    let start = mesh([5, 5], [false; 2]);
    let error = Whole::default().step(&Mmpde::default(), &start, &[1.0; 7], DT).unwrap_err();
    assert_eq!(error, Failure::WrongLength { what: "the density", found: 7, expected: 36 });
}
