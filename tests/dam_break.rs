//! The collapsing pile of water of `studies/dam-break.toml`: what is conserved, and the solution of the radial
//! equations.

use driftmesh::geometry::{DualCells, Field, Mesh};
use driftmesh::output::Summary;
use driftmesh::simulation::{Event, Observer, Snapshot};
use driftmesh::study::{Begin, Kind, MovingFigures, MovingMesh, Source};
use std::f64::consts::PI;

/// What a run passed through: mass, both momenta and energy by dual areas, and its last state.
#[derive(Default)]
struct Passed {
    totals: Vec<[f64; 4]>,
    last: Option<(f64, Mesh<2>, Field)>,
}

impl Observer for Passed {
    fn observe(&mut self, _event: Event, snapshot: &Snapshot<'_>) -> driftmesh::Result<()> {
        let state = snapshot.state::<2>().unwrap();
        let mut sums = [0.0; 4];
        for (area, [h, u, v]) in DualCells::new(&state.mesh).areas().iter().zip(state.u.values().as_chunks::<3>().0) {
            let density = [*h, h * u, h * v, 0.5 * h * (u * u + v * v) + 0.5 * h * h];
            sums = std::array::from_fn(|c| sums[c] + area * density[c]);
        }
        self.totals.push(sums);
        self.last = Some((state.t, state.mesh.clone(), state.u.clone()));
        Ok(())
    }
}

fn rerun(assignments: &[&str]) -> (Summary<MovingFigures>, Passed) {
    let mut source = Source::new("dam-break.toml", include_str!("../studies/dam-break.toml"));
    assignments.iter().for_each(|assignment| source.set(assignment).unwrap());
    let study = MovingMesh::from_source(&source).unwrap();
    let (out, mut passed) = (tempfile::tempdir().unwrap(), Passed::default());
    let finished = study.run(&out.path().join("run"), Begin::Anew, &mut [&mut passed]).unwrap();
    assert!(finished.failure.is_none(), "{assignments:?}: {:?}", finished.failure);
    (finished.summary, passed)
}

/// Largest |R_max − 1| and the largest distance of the mesh from the reference over the reports.
fn worst(summary: &Summary<MovingFigures>) -> [f64; 2] {
    let all = summary.figures.reports.iter().map(|report| report.comparison.expect("the study compares"));
    all.fold([0.0; 2], |m, c| [m[0].max((c.r_max - 1.0).abs()), m[1].max(c.mesh_rms)])
}

/// Mass and momentum to round-off on the moving mesh, energy to the order of the scheme; 4 × 4 subdomains make the mesh
/// of the single domain, with the default and with eight sweeps by Jacobi.
#[test]
fn mass_and_momentum_are_conserved_and_subdomains_agree() {
    let (summary, passed) = rerun(&[]);
    let start = passed.totals[0];
    let momentum = start[0] * 12.5_f64.sqrt();
    for now in &passed.totals {
        assert!((now[0] / start[0] - 1.0).abs() < 1e-13, "mass {now:?}");
        assert!(now[1].abs().max(now[2].abs()) < 1e-13 * momentum, "momentum {now:?}");
        assert!((now[3] / start[3] - 1.0).abs() < 1e-5, "energy {:.2e}", now[3] / start[3] - 1.0);
    }
    for report in &summary.figures.reports {
        assert!(report.conserved.drift.abs() <= 1e-14, "drift {:e}", report.conserved.drift);
        assert!(report.quality.q_max < 1.05 && report.quality.min_scaled_jacobian > 0.6, "{:?}", report.quality);
    }
    let work = summary.figures.work.work;
    assert_eq!([summary.figures.work.steps, work.newton_iterations, work.linear_solves], [30, 90, 2130]);
    assert_eq!(work.direct_solves(), 0);
    assert!(worst(&summary)[0] < 1e-3 && worst(&summary)[1] < 1e-4, "{:?}", worst(&summary));
    let jacobi = "mesh.generator.estimator={kind=\"residual-walk\", sweeps=8, smoother=\"jacobi\"}";
    let (eight, _) = rerun(&[jacobi, "monitor.smoothing=0"]);
    assert!(
        eight.figures.reports.iter().all(|report| report.comparison.unwrap().r_max >= 0.995),
        "{:?}",
        worst(&eight)
    );
}

/// Depth and radial velocity at r = (i + ½) Δr
///
/// ```text
/// h_t + w h_r + h (w_r + w/r) = 0,   w_t + w w_r + g h_r = 0,   g = 1
/// ```
///
/// by central differences of fourth order and the classical Runge-Kutta method: an implementation of its own, in one
/// dimension and at rest.
#[derive(Clone)]
struct Radial {
    spacing: f64,
    values: Vec<[f64; 2]>,
}

/// Where the radial equations end: the water there is still.
const END: f64 = 3.6;
/// Radius of the pile: so large that its slope at the centre, where r has a kink, is two ten-thousandths of its
/// steepest.
const RADIUS: f64 = 1.5;

impl Radial {
    /// The pile of the study, of a larger radius.
    fn pile(points: usize) -> Self {
        let spacing = END / points as f64;
        let r = |i: usize| (i as f64 + 0.5) * spacing;
        let depth = |r: f64| 10.0 + 1.25 * (1.0 - ((r - RADIUS) / 0.3).tanh());
        Self { spacing, values: (0..points).map(|i| [depth(r(i)), 0.0]).collect() }
    }

    /// At any place: h is even and w odd about the centre, and the end goes on as it is.
    fn at(values: &[[f64; 2]], i: isize) -> [f64; 2] {
        match usize::try_from(i) {
            Ok(i) => values[i.min(values.len() - 1)],
            Err(_) => {
                let [h, w] = values[(-1 - i) as usize];
                [h, -w]
            }
        }
    }

    fn rates(&self, values: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let rate = |i: usize| {
            let at = |step: isize| Self::at(values, i as isize + step);
            let slope = [0, 1].map(|c| (8.0 * (at(1)[c] - at(-1)[c]) - (at(2)[c] - at(-2)[c])) / (12.0 * self.spacing));
            let ([h, w], r) = (values[i], (i as f64 + 0.5) * self.spacing);
            [-(w * slope[0] + h * (slope[1] + w / r)), -(w * slope[1] + slope[0])]
        };
        (0..values.len()).map(rate).collect()
    }

    fn advance(&mut self, end: f64, steps: usize) {
        let dt = end / steps as f64;
        for _ in 0..steps {
            let ahead = |rates: &[[f64; 2]], share: f64| -> Vec<[f64; 2]> {
                let moved = |(u, rate): (&[f64; 2], &[f64; 2])| [0, 1].map(|c| u[c] + share * dt * rate[c]);
                self.values.iter().zip(rates).map(moved).collect()
            };
            let first = self.rates(&self.values);
            let second = self.rates(&ahead(&first, 0.5));
            let third = self.rates(&ahead(&second, 0.5));
            let fourth = self.rates(&ahead(&third, 1.0));
            for (i, u) in self.values.iter_mut().enumerate() {
                for c in 0..2 {
                    u[c] += dt / 6.0 * (first[i][c] + 2.0 * (second[i][c] + third[i][c]) + fourth[i][c]);
                }
            }
        }
    }

    /// [h, w] at any radius, by the cubic through four points.
    fn value(&self, r: f64) -> [f64; 2] {
        let place = r / self.spacing - 0.5;
        let (first, s) = (place.floor() as isize, place - place.floor());
        let weights = [
            -s * (s - 1.0) * (s - 2.0) / 6.0,
            (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0,
            -(s + 1.0) * s * (s - 2.0) / 2.0,
            (s + 1.0) * s * (s - 1.0) / 6.0,
        ];
        let points = [-1, 0, 1, 2].map(|step| Self::at(&self.values, first + step));
        [0, 1].map(|c| (0..4).map(|k| weights[k] * points[k][c]).sum())
    }
}

/// Largest errors of depth and velocity against the radial solution, where the box is far enough away for it to hold.
fn errors(radial: &Radial, (mesh, u): (&Mesh<2>, &Field)) -> [f64; 2] {
    let nodes = mesh.images().iter().map(|[x, y]| [x - PI, y - PI]).collect::<Vec<_>>();
    let mut largest = [0.0_f64; 2];
    for (&[x, y], [h, u, v]) in nodes.iter().zip(u.values().as_chunks::<3>().0) {
        let r = x.hypot(y);
        if r > 2.8 {
            continue;
        }
        let [depth, speed] = radial.value(r);
        let direction = if r > 0.0 { [x / r, y / r] } else { [0.0; 2] };
        largest[0] = largest[0].max((h - depth).abs());
        largest[1] = largest[1].max((u - speed * direction[0]).hypot(v - speed * direction[1]));
    }
    largest
}

/// The pile on the moving mesh is the one of the radial equations, to second order in cells and steps together. These
/// are converged themselves: four times as coarse, they are off by less than a fiftieth of what the study leaves.
#[test]
fn the_pile_is_that_of_the_radial_equations() {
    let [radial, coarse] = [1440, 360].map(|points| {
        let mut radial = Radial::pile(points);
        radial.advance(0.15, points / 2);
        radial
    });
    let apart = (0..56).map(|k| f64::from(k) / 20.0).map(|r| (radial.value(r)[0] - coarse.value(r)[0]).abs());
    let apart = apart.fold(0.0, f64::max);
    let [forty, eighty] = [("40", "5e-3"), ("80", "2.5e-3")].map(|(cells, step)| {
        let settings = [format!("grid.cells=[{cells}, {cells}]"), format!("time.step={step}")];
        let whole = "mesh.generator={kind=\"whole\"}";
        let (_, passed) = rerun(&[&settings[0], &settings[1], whole, &format!("pde.radius={RADIUS}")]);
        let (t, mesh, u) = passed.last.unwrap();
        assert_eq!(t, 0.15);
        errors(&radial, (&mesh, &u))
    });
    println!("the reference {apart:.1e}, depth and velocity {forty:.4?} and {eighty:.4?}");
    assert!(apart < 2e-2 * forty[0], "the radial equations are not converged: {apart:.1e} beside {:.1e}", forty[0]);
    for (what, [coarse, fine]) in ["depth", "velocity"].iter().zip([0, 1].map(|c| [forty[c], eighty[c]])) {
        let order = (coarse / fine).log2();
        assert!((order - 2.0).abs() < 0.3, "{what}: {coarse:.2e} and {fine:.2e}, order {order:.2}");
    }
}
