use super::super::{Form, MeshOperator, Relaxation, Whole};
use super::*;
use crate::numerics::difference::Gradient;
use crate::numerics::larger;
use crate::setting::Auto;
use std::f64::consts::TAU;

fn mesh(cells: [usize; 2], periodic: [bool; 2]) -> Mesh<2> {
    Mesh::uniform(Lattice::new(cells, periodic).unwrap(), [-1.0, 2.0], [1.0, 3.0]).unwrap()
}

/// A smooth density with a ridge and a bump of the given height.
fn density(mesh: &Mesh<2>, height: f64) -> Density {
    let wave = |s: f64| (TAU * s).cos() - 1.0;
    let at = |[x, y]: [f64; 2]| [0.5 * (x + 1.0), y - 2.0];
    let rho = |[s, r]: [f64; 2]| 1.0 + height * ((2.0 * wave(s + r)).exp() + (3.0 * (wave(s - 0.3) + wave(r))).exp());
    mesh.x().iter().map(|&x| rho(at(x))).collect()
}

/// A step with its exact solution.
struct Step {
    equation: Mmpde,
    mesh: Mesh<2>,
    rho: Density,
    dt: f64,
    operator: MeshOperator<2>,
    new: Vec<[f64; 2]>,
    exact: Vec<[f64; 2]>,
    decomposition: Decomposition,
}

impl Step {
    fn new(equation: Mmpde, mesh: Mesh<2>, height: f64, dt: f64, subdomains: [usize; 2]) -> Self {
        let rho = density(&mesh, height);
        Self::with(equation, mesh, rho, dt, subdomains)
    }

    fn with(equation: Mmpde, mesh: Mesh<2>, rho: Density, dt: f64, subdomains: [usize; 2]) -> Self {
        let operator = equation.operator(mesh.lattice(), &rho, dt).unwrap();
        let mut new = mesh.x().to_vec();
        move_sides(&equation, &mesh, &rho, dt, &mut new, &mut Robust::default()).unwrap();
        let exact = Whole::to(1e-9).step(&equation, &mesh, &rho, dt).unwrap().mesh.x().to_vec();
        let decomposition = Decomposition::new(mesh.lattice(), subdomains).unwrap();
        Self { equation, mesh, rho, dt, operator, new, exact, decomposition }
    }

    fn problem(&self, seed: u64) -> Problem<'_> {
        Problem::new(&self.equation, &self.operator, &self.mesh, &self.rho, self.dt, &self.new, seed, 0)
    }

    fn estimate(&self, estimator: &dyn Estimator) -> (Estimates, Strips) {
        let mut strips = Strips::<2, 5>::new(&self.decomposition);
        let found = estimator.estimate(&self.problem(1), &self.decomposition.points(), &mut strips).unwrap();
        (found, strips)
    }

    /// Root mean square over both coordinates of all interface points.
    fn error(&self, x: impl Fn(usize) -> [f64; 2]) -> f64 {
        let points = self.decomposition.points();
        let squares = points.iter().enumerate().flat_map(|(p, &k)| {
            let x = x(p);
            [0, 1].map(|c| (x[c] - self.exact[k][c]).powi(2))
        });
        (squares.sum::<f64>() / (2 * points.len()) as f64).sqrt()
    }

    fn error_of(&self, estimator: &dyn Estimator) -> f64 {
        let (found, _) = self.estimate(estimator);
        self.error(|p| found.points[p].x)
    }

    fn do_nothing(&self) -> f64 {
        let points = self.decomposition.points();
        self.error(|p| self.mesh.x()[points[p]])
    }
}

const SIDES: [[bool; 2]; 4] = [[false, false], [true, false], [false, true], [true, true]];

fn forms() -> [Mmpde; 2] {
    [Form::Gradient(Gradient::Central), Form::Conservative]
        .map(|form| Mmpde { relaxation: Relaxation::Time(1.0), form })
}

/// M w = 0 with w = 1 around a subdomain and its strip: w on the subdomain is the influence of all that lies beyond. It
/// is about what the width is chosen for, times the root of the contrast of ρ.
#[test]
fn what_lies_beyond_a_strip_does_not_matter() {
    for (equation, periodic) in forms().into_iter().flat_map(|form| SIDES.map(|periodic| (form, periodic))) {
        for (a, height) in [(0.1, 0.0), (0.5, 3.0), (2.0, 30.0), (6.0, 3.0)] {
            let start = mesh([90, 60], periodic);
            let dt = a / 3600.0;
            let step = Step::new(equation, start, height, dt, [2, 2]);
            let width = strips::Reach::alone(&step.problem(0), &step.decomposition);
            assert!((2..=30).contains(&width), "a = {a}: {width} nodes");
            let lattice = step.mesh.lattice();
            let mut ring = vec![[1.0]; lattice.len()];
            lattice.sides().for_each(|k| ring[k] = [0.0]);
            let mut influence = 0.0;
            for (patch, own) in step.decomposition.extended([width; 2]) {
                let zero = vec![[0.0]; lattice.len()];
                let solver = &mut Robust::<1>::default();
                let (w, _) = step.operator.solve::<5, 1>(patch, &zero, &ring, [[0.0]; 2], solver, [1.0]).unwrap();
                let mut nodal = zero.clone();
                patch.scatter(lattice, &w, &mut nodal, [[0.0]; 2]);
                influence = own.iter().fold(influence, |m, &k| larger(m, nodal[k][0]));
            }
            let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max]
                .map(|f| step.rho.largest().iter().copied().reduce(f).unwrap());
            // two cuts meet in a corner, and where √ρ bends down the influence of both falls more slowly
            let bound = 4.0 * strips::BEYOND * (high / low).sqrt();
            assert!(influence < bound, "a = {a}, {periodic:?}: {influence:e} above {bound:e}");
            assert!(influence > 1e-5, "a = {a}: the strip is wider than it need be, {influence:e}");
        }
    }
}

/// A subdomain reads its strip and the ring around it, and nothing further away: what is read is counted by the
/// formula, and a mesh that is changed anywhere else gives the same bits.
#[test]
fn strips_read_what_they_count() {
    for (cells, subdomains, width) in [(40, 4, 4), (40, 4, 8), (60, 3, 5), (64, 8, 2)] {
        let side = cells / subdomains;
        let step = |start: Mesh<2>| Step::new(Mmpde::published(), start, 5.0, 1e-3, [subdomains; 2]);
        let plain = step(mesh([cells; 2], [true; 2]));
        let (found, strips) = plain.estimate(&Strip::plain(width));
        assert_eq!(strips.read(), (side + 2 * width + 1).pow(2) - side.pow(2));
        assert_eq!((found.exchanges, strips.gathered()), (1, 0));
        // inside the second subdomain along both axes, and everything outside what it reads
        let node = [2 * side - 1, 2 * side];
        let lattice = *plain.mesh.lattice();
        let near = |i: usize| (side - width..=2 * side + width).contains(&i);
        let far: Vec<usize> = (0..lattice.len()).filter(|&k| !lattice.node(k).map(near).contains(&true)).collect();
        let at = plain.decomposition.points().binary_search(&lattice.index(node)).unwrap();
        let moved = |nodes: &[usize]| {
            let mut x = plain.mesh.x().to_vec();
            nodes.iter().for_each(|&k| x[k][0] += 1e-3);
            let changed = plain.mesh.moved(x).unwrap();
            let step = Step::with(Mmpde::published(), changed, plain.rho.clone(), 1e-3, [subdomains; 2]);
            step.estimate(&Strip::plain(width)).0.points[at].x
        };
        assert!(!far.is_empty() || 2 * width + side + 1 >= cells);
        assert_eq!(moved(&far), found.points[at].x, "{cells} cells, {width} nodes");
        assert_ne!(moved(&[lattice.index([2 * side + width, 2 * side])]), found.points[at].x);
    }
    // of 2 × 2 subdomains with sides, the last reads most: it does not answer for the side
    let step = Step::new(Mmpde::published(), mesh([40; 2], [false; 2]), 5.0, 1e-3, [2; 2]);
    let (_, strips) = step.estimate(&Strip::plain(6));
    assert_eq!(strips.read(), (20 + 6_usize).pow(2) - 19 * 19);
    // the coarse lattice has one unknown for 2 × 2, sides left out
    let (_, strips) = step.estimate(&Strip { coarse: Auto::Value(2), ..Strip::plain(4) });
    assert_eq!(strips.gathered(), 19 * 19);
}

/// A thirtieth of doing nothing after one exchange, whatever the form, the sides, the size, the division and the
/// stiffness, and a hundredth of the shortest edge by as many as it takes; the same bits from strips that are used
/// again.
#[test]
fn strips_are_good_at_any_stiffness() {
    for (equation, periodic) in forms().into_iter().flat_map(|form| SIDES.map(|periodic| (form, periodic))) {
        for (cells, subdomains) in [([40, 40], [4, 4]), ([61, 44], [3, 2]), ([48, 96], [1, 6])] {
            for dt in [1e-4, 1e-3, 1e-2, 0.1] {
                let step = Step::new(equation, mesh(cells, periodic), 5.0, dt, subdomains);
                let strip = Strip { exchanges: Auto::Value(1), ..Strip::default() };
                let (found, mut strips) = step.estimate(&strip);
                let (error, still) = (step.error(|p| found.points[p].x), step.do_nothing());
                assert!(error < still / 30.0, "{periodic:?}, {cells:?}, Δt = {dt}: {error:e} of {still:e}");
                let (enough, _) = step.estimate(&Strip::default());
                let (error, edge) = (step.error(|p| enough.points[p].x), step.mesh.shortest_edge());
                assert!(enough.exchanges == 1 || dt > 1e-4, "{} exchanges", enough.exchanges);
                assert!(error < 0.01 * edge, "{periodic:?}, {cells:?}, Δt = {dt}: {error:e} of {edge:e}");
                let points = step.decomposition.points();
                let again = strip.estimate(&step.problem(1), &points, &mut strips).unwrap();
                let x = |found: &Estimates| found.points.iter().map(|estimate| estimate.x).collect::<Vec<_>>();
                assert_eq!(x(&again), x(&found));
            }
        }
    }
}

/// Wider strips are better, e^-θ a node without a coarse lattice; more exchanges too.
#[test]
fn wider_strips_and_more_exchanges_are_better() {
    let step = Step::new(Mmpde::published(), mesh([80, 80], [false, true]), 5.0, 2.5e-4, [4, 4]);
    let errors = [2, 5, 8, 11, 14].map(|width| step.error_of(&Strip::plain(width)));
    let theta = strips::decay(&step.problem(0))[0];
    for pair in errors.windows(2) {
        let seen = (pair[0] / pair[1]).ln() / 3.0;
        assert!((0.8..1.6).contains(&(seen / theta)), "{seen} a node, {theta} expected: {errors:?}");
    }
    let exchanges = |n| step.error_of(&Strip { exchanges: Auto::Value(n), ..Strip::plain(3) });
    let errors = [1, 2, 4].map(exchanges);
    assert!(errors[1] < 0.2 * errors[0] && errors[2] < 0.2 * errors[1], "{errors:?}");
}

/// Walks take the bias of the strips away: over 400 seeds their mean is nearer to the solution than the strips are, and
/// within three standard errors.
#[test]
fn walks_take_the_bias_of_strips_away() {
    for periodic in [[false, false], [true, true]] {
        let step = Step::new(Mmpde::published(), mesh([24, 20], periodic), 8.0, 2e-3, [3, 2]);
        let points: Vec<usize> = step.decomposition.points().into_iter().step_by(7).collect();
        let mut strips = Strips::<2, 5>::new(&step.decomposition);
        let walk = ResidualWalk::default();
        let runs: Vec<Estimates> =
            (0..400).map(|seed| walk.estimate(&step.problem(seed), &points, &mut strips).unwrap()).collect();
        assert!(runs.iter().all(|run| run.walks == 10 && run.exchanges == 1));
        let handed_on = runs.iter().map(|run| run.handed_on).sum::<usize>() as f64;
        let walks = (400 * 10 * points.len()) as f64;
        assert!((1e-3..0.1).contains(&(handed_on / walks)), "{} of all walks handed on", handed_on / walks);
        let (mut bias, mut left) = (0.0, 0.0);
        for (p, &k) in points.iter().enumerate() {
            for c in 0..2 {
                let n = runs.len() as f64;
                let mean = runs.iter().map(|run| run.points[p].x[c]).sum::<f64>() / n;
                let variance = runs.iter().map(|run| (run.points[p].x[c] - mean).powi(2)).sum::<f64>() / (n - 1.0);
                let (error, standard) = ((mean - step.exact[k][c]).abs(), (variance / n).sqrt());
                assert!(error < 4.0 * standard + 1e-12, "node {k}: {error:e}, ± {standard:e}");
                bias += (runs[0].guess[k][c] - step.exact[k][c]).powi(2);
                left += error * error;
            }
        }
        assert!(left < 0.2 * bias, "{periodic:?}: {:e} left of {:e}", left.sqrt(), bias.sqrt());
    }
}

/// With a number of sweeps the strips give what sweeps over the whole lattice would, to the last bits.
#[test]
fn sweeps_in_strips_are_those_of_the_whole_lattice() {
    use crate::numerics::linear::{LatticeMatrix, Smoother, relax};
    let step = Step::new(Mmpde::published(), mesh([40, 40], [false, true]), 5.0, 1e-3, [4, 4]);
    let (lattice, problem) = (*step.mesh.lattice(), step.problem(1));
    for smoother in [Smoother::Jacobi, Smoother::Chebyshev] {
        let walk = ResidualWalk { sweeps: Auto::Value(4), walks: 1, smoother };
        let (found, _) = step.estimate(&walk);
        let patch = crate::geometry::Patch::whole(&lattice);
        let matrix: LatticeMatrix<2, 5> = step.operator.matrix(patch);
        let right = step.operator.right(patch, step.mesh.x(), step.mesh.jump());
        let mut x = patch.gather(&lattice, &step.new, step.mesh.jump());
        relax(&matrix, &right, &mut x, smoother, 4, lattice_walk::lowest(&problem));
        let mut swept = step.new.clone();
        patch.scatter(&lattice, &x, &mut swept, step.mesh.jump());
        for k in step.decomposition.points() {
            assert!((0..2).all(|c| (swept[k][c] - found.guess[k][c]).abs() < 1e-14), "{smoother:?}, node {k}");
        }
    }
}
