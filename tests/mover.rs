//! The mover rests where its density rests, follows where it moves, and never makes things worse than equal cells.

use driftmesh::density::{Monitor, RootGradient};
use driftmesh::geometry::{Lattice, Mesh, check_unfolded, node_areas};
use driftmesh::meshing::{Form, Whole};
use driftmesh::mover::{Ending, Followed, Gait, Mover, adapted};
use driftmesh::simulation::{Record, State};
use driftmesh::study::{Kind, MovingMesh, MovingRun, Source};
use std::f64::consts::PI;

/// Steps of a mover with nothing set, from equal cells, after u(x, step); `watch` sees each new mesh and the way of its
/// fastest node in uniform cells.
fn follow(
    lattice: Lattice<2>,
    upper: [f64; 2],
    steps: usize,
    u: impl Fn([f64; 2], usize) -> f64,
    mut watch: impl FnMut(usize, &Mesh<2>, f64),
) {
    let mut mover = Mover::new(Whole::default());
    let mut mesh = Mesh::uniform(lattice, [0.0; 2], upper).unwrap();
    let mut gait = Gait::at_rest(&mesh);
    let cell = (0..2).map(|d| upper[d] / lattice.cells()[d] as f64).fold(f64::INFINITY, f64::min);
    for n in 0..steps {
        let u: Vec<f64> = mesh.x().iter().map(|&x| u(x, n)).collect();
        let rho = RootGradient::default().density(&mesh, &u, None).unwrap();
        let step = mover.step(&mesh, &gait, Followed { u: &u, rho: &rho }, 1.0).unwrap();
        check_unfolded(&step.moved.mesh).unwrap();
        watch(n, &step.moved.mesh, step.moved.mesh.farthest(&mesh) / cell);
        (mesh, gait) = (step.moved.mesh, step.gait);
    }
}

fn standing_fronts_rest(cells: usize) {
    for w in [50.0, 100.0, 200.0, 400.0, 1000.0] {
        let front = |[x, y]: [f64; 2], _| f64::tanh(w * (x + 0.09 * (2.0 * PI * y).sin() - 0.5));
        let lattice = Lattice::bounded([cells, cells]).unwrap();
        follow(lattice, [1.0; 2], 401, front, |n, _, way| match n {
            150 => assert!(way <= 5e-2, "{cells}², w = {w}: {way:e} cells in step {n}"),
            400 => assert!(way <= 1e-3, "{cells}², w = {w}: {way:e} cells in step {n}"),
            _ => {}
        });
    }
}

/// A front that stands still, as thick as half a cell or a fiftieth of one: the mesh comes to rest around it.
#[test]
fn a_mesh_rests_around_a_standing_front_of_any_width() {
    standing_fronts_rest(20);
    standing_fronts_rest(40);
}

/// The same on 81 × 81 nodes.
#[test]
#[ignore = "takes a minute"]
fn a_fine_mesh_rests_around_a_standing_front_of_any_width() {
    standing_fronts_rest(80);
}

/// Strips are no harder than squares: layers and ridges anywhere, on bounded and periodic axes.
#[test]
fn strips_rest() {
    for (n, w) in [(32, 60.0), (64, 250.0), (100, 20.0), (100, 1500.0), (200, 150.0)] {
        for (centre, periodic) in [(0.5, false), (0.31, false), (0.77, true)] {
            let u = |[x, _]: [f64; 2], _| {
                let z = x - centre;
                let place = if periodic { (2.0 * PI * z).sin() / (2.0 * PI) } else { z };
                (w * place).tanh()
            };
            let lattice = Lattice::new([n, 4], [periodic, true]).unwrap();
            follow(lattice, [1.0, 0.1], 400, u, |step, _, way| {
                assert!(
                    step < 380 || way < 1e-3,
                    "{n} cells, w = {w} at {centre}, periodic: {periodic}: {way:e} in {step}"
                );
            });
        }
    }
}

/// A thin front that moves by a sixth of a cell a step, as many times its own width in a run as it is thin: the median
/// of the interpolation error in the middle of cells is that of a mesh that rests around it.
#[test]
fn a_moving_front_is_followed_with_nothing_set() {
    let (dt, still) = (0.004, 200);
    let front = |[x, y]: [f64; 2], t: f64| f64::tanh(100.0 * (x + 0.09 * (2.0 * PI * y).sin() - 0.2 - t));
    let time = |n: usize| n.saturating_sub(still) as f64 * dt;
    let mut errors = Vec::new();
    follow(
        Lattice::bounded([40, 40]).unwrap(),
        [1.0; 2],
        still + 125,
        |x, n| front(x, time(n)),
        |n, mesh, _| {
            if n < still {
                return;
            }
            let t = time(n + 1);
            let (x, mut worst) = (mesh.x(), 0.0_f64);
            for k in (0..40 * 41).filter(|k| k % 41 < 40) {
                let corners = [k, k + 1, k + 41, k + 42];
                let mean = corners.iter().map(|&k| front(x[k], t)).sum::<f64>() / 4.0;
                let middle = [0, 1].map(|d| corners.iter().map(|&k| x[k][d]).sum::<f64>() / 4.0);
                worst = worst.max((mean - front(middle, t)).abs());
            }
            errors.push(worst);
        },
    );
    errors.sort_by(f64::total_cmp);
    assert!(errors[errors.len() / 2] <= 0.06, "median {}", errors[errors.len() / 2]);
}

/// A layer takes the same share of the nodes whatever its width, and whatever changes outside it.
#[test]
fn a_layer_has_the_same_share_of_the_nodes_whatever_its_width() {
    let share = |w: f64, slope: f64| {
        let mut inside = 0;
        let u = |[x, _]: [f64; 2], _| (w * (x - 0.5)).tanh() - slope * (x - 0.5);
        follow(Lattice::bounded([60, 4]).unwrap(), [1.0, 0.1], 300, u, |n, mesh, _| {
            if n == 299 {
                inside = mesh.x().iter().filter(|x| (x[0] - 0.5).abs() < 4.0 / w).count();
            }
        });
        inside as f64 / (61.0 * 5.0)
    };
    let shares = [share(60.0, 0.0), share(240.0, 0.0), share(960.0, 0.0), share(240.0, 2.0)];
    assert!(shares.iter().all(|share| (0.55..0.75).contains(share)), "{shares:?}");
}

/// Noise, single hot nodes and steps, with contrasts up to 10⁶, on lattices and boxes of any shape: no step folds.
#[test]
fn no_data_folds_a_mesh() {
    let mut state = 7_u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    for case in 0..200 {
        let cells = [0; 2].map(|_| 3 + (30.0 * random()) as usize);
        let lattice = Lattice::new(cells, [random() < 0.5, random() < 0.5]).unwrap();
        let upper = [0; 2].map(|_| 10.0_f64.powf(4.0 * random() - 2.0));
        let contrast = 10.0_f64.powf(6.0 * random());
        let (hot, cut) = ((random() * lattice.len() as f64) as usize, random());
        let noise: Vec<f64> = (0..lattice.len()).map(|_| random()).collect();
        let mut mover = Mover::new(Whole::default());
        let mut mesh = Mesh::uniform(lattice, [0.0; 2], upper).unwrap();
        let mut gait = Gait::at_rest(&mesh);
        for _ in 0..10 {
            let u: Vec<f64> = match case % 4 {
                0 => noise.iter().map(|u| u.powi(8)).collect(),
                1 => (0..lattice.len()).map(|k| f64::from(u8::from(k == hot))).collect(),
                2 => mesh.x().iter().map(|x| f64::from(u8::from(x[0] / upper[0] < cut))).collect(),
                _ => noise.clone(),
            };
            let rho = match case % 3 {
                0 => u.iter().map(|u| 1.0 + contrast * u).collect(),
                _ => RootGradient::default().density(&mesh, &u, None).unwrap(),
            };
            let step = mover.step(&mesh, &gait, Followed { u: &u, rho: &rho }, 0.01);
            let step = step.unwrap_or_else(|failure| panic!("case {case}: {failure}"));
            check_unfolded(&step.moved.mesh).unwrap();
            (mesh, gait) = (step.moved.mesh, step.gait);
        }
    }
}

/// An equation with its exact solution.
struct Problem {
    name: &'static str,
    /// `[domain]` and `[grid]`.
    place: &'static str,
    time: [f64; 2],
    /// `[pde]`, in which U stands for the exact solution at t and U0 for that at the start.
    pde: &'static str,
    exact: String,
}

const SQUARE: &str = "[grid]\ncells = [40, 40]\n";
const TORUS: &str = "[domain]\nperiodic = [true, true]\n[grid]\ncells = [40, 40]\n";
const FORMULA: &str = "kind = \"formula\"\nunknowns = [\"u\"]\ninitial = { u = \"U0\" }\nexact = { u = \"U\" }\n";

impl Problem {
    fn study(&self, set: &[&str]) -> MovingMesh {
        let [start, end] = self.time;
        let at_start = self.exact.replace('T', &format!("({start:?})"));
        let pde =
            self.pde.replace("FORMULA", FORMULA).replace("U0", &at_start).replace('U', &self.exact.replace('T', "t"));
        let text = format!(
            "[study]\nname = \"problem\"\nkind = \"moving-mesh\"\n{}[time]\nstart = {start:?}\nend = {end:?}\n[pde]\n\
             {pde}\n",
            self.place
        );
        let mut source = Source::new(self.name, text);
        set.iter().for_each(|assignment| source.set(assignment).unwrap());
        MovingMesh::from_source(&source).unwrap_or_else(|error| panic!("{}: {error}", self.name))
    }

    fn l2(&self, set: &[&str]) -> f64 {
        let (MovingRun { record, .. }, failure) = self.study(set).compute().unwrap();
        assert!(failure.is_none(), "{}: {failure:?}", self.name);
        record.reports.last().unwrap().error.unwrap().l2
    }

    /// l2 over that on equal cells.
    fn share(&self) -> f64 {
        self.l2(&[]) / self.l2(&["mesh.generator.kind=fixed"])
    }
}

fn problem(name: &'static str, place: &'static str, time: [f64; 2], pde: &'static str, exact: &str) -> Problem {
    Problem { name, place, time, pde, exact: exact.into() }
}

const MOVED: &str = "FORMULAflux = { u = [\"0.4*u\", \"0\"] }\nboundary = { u = \"U\" }";
const AROUND: &str = "FORMULAflux = { u = [\"u\", \"0\"] }";

/// Where equal cells resolve the solution the mesh leaves it alone, or nearly so.
#[test]
fn what_equal_cells_resolve_is_left_alone() {
    let turned = "[domain]\nlower = [-0.75, -0.75]\nupper = [0.75, 0.75]\n[grid]\ncells = [40, 40]\n";
    let wide = "[domain]\nlower = [-3.0, -3.0]\nupper = [3.0, 3.0]\n[grid]\ncells = [40, 40]\n";
    let problems = [
        problem("a wave", TORUS, [0.0, 1.0], AROUND, "sin(2*pi*(x - T))"),
        problem("two waves", TORUS, [0.0, 1.0], AROUND, "sin(4*pi*(x - T))"),
        problem("a blob", SQUARE, [0.0, 1.0], MOVED, "exp(-((x-0.3-0.4*T)^2 + (y-0.5)^2)/0.0288)"),
        problem("a thick front", SQUARE, [0.25, 1.25], "kind = \"burgers\"\nviscosity = 0.03", ""),
        problem(
            "heat",
            SQUARE,
            [0.0, 1.0],
            "FORMULAdiffusivity = { u = \"0.01\" }\nboundary = { u = \"U\" }",
            "1/(1 + 2*T)*exp(-((x-0.5)^2 + (y-0.5)^2)/(0.02 + 0.04*T))",
        ),
        problem("a broad layer", SQUARE, [0.0, 1.0], MOVED, "tanh(6*(x - 0.3 - 0.4*T))"),
        problem(
            "Fisher's wave",
            SQUARE,
            [0.0, 1.0],
            "FORMULAdiffusivity = { u = \"0.01\" }\nsource = { u = \"u*(1 - u)\" }\nboundary = { u = \"U\" }",
            "(1 + exp((x - 0.3 - 0.2041241452*T)/0.2449489743))^(-2)",
        ),
        problem(
            "decay",
            SQUARE,
            [0.0, 1.0],
            "FORMULAdiffusivity = { u = \"0.02\" }\nboundary = { u = \"U\" }",
            "exp(-0.16*pi^2*T)*sin(2*pi*x)*sin(2*pi*y)",
        ),
        problem(
            "a blob that turns",
            turned,
            [0.0, 3.0],
            "FORMULAflux = { u = [\"-y*u\", \"x*u\"] }\nboundary = { u = \"U\" }",
            "exp(-((x - 0.25*cos(T))^2 + (y - 0.25*sin(T))^2)/0.0288)",
        ),
        problem(
            "Barenblatt's solution",
            wide,
            [1.0, 2.0],
            "FORMULAdiffusivity = { u = \"2*max(u, 0)\" }\nboundary = { u = \"U\" }",
            "max(0, T^(-0.5)*(0.3 - (x^2 + y^2)/(16*T^0.5)))",
        ),
    ];
    for problem in problems {
        let share = problem.share();
        assert!(share <= 1.2, "{}: {share:.2} times the error of equal cells", problem.name);
    }
}

/// Where equal cells do not resolve the solution the error is a third of theirs at most.
#[test]
fn what_is_thin_is_resolved() {
    // width 2 √(2 D/k) and speed √(D k/2) (1 − 2 a) of u_t = D u_xx + k u (1 − u)(u − a)
    let bistable =
        "FORMULAdiffusivity = { u = \"1e-3\" }\nsource = { u = \"5*u*(1 - u)*(u - 0.1)\" }\nboundary = { u = \"U\" }";
    let problems = [
        problem("front, 5e-3", SQUARE, [0.25, 0.75], "kind = \"burgers\"\nviscosity = 0.005", ""),
        problem("front, 2e-3", SQUARE, [0.25, 0.75], "kind = \"burgers\"\nviscosity = 0.002", ""),
        problem("front, 1e-3", SQUARE, [0.25, 0.75], "kind = \"burgers\"\nviscosity = 0.001", ""),
        problem("a layer", SQUARE, [0.0, 1.0], MOVED, "tanh(60*(x - 0.3 - 0.4*T))"),
        problem(
            "an oblique layer",
            SQUARE,
            [0.0, 1.0],
            "FORMULAflux = { u = [\"0.4*u\", \"0.4*u\"] }\nboundary = { u = \"U\" }",
            "tanh(80*(x + 0.5*y - 0.4 - 0.6*T))",
        ),
        problem(
            "three fronts",
            SQUARE,
            [0.0, 0.15],
            "FORMULAflux = { u = [\"u\", \"0\"] }\nboundary = { u = \"U\" }",
            "tanh((x-T-0.1)/0.004) + tanh((x-T-0.4)/0.004) + tanh((x-T-0.7)/0.004)",
        ),
        problem(
            "eight fronts",
            "[grid]\ncells = [80, 8]\n",
            [0.0, 0.1],
            "FORMULAflux = { u = [\"0.25*u\", \"0\"] }\nboundary = { u = \"U\" }",
            "tanh(10*sin(8*pi*(x - 0.3 - 0.25*T)))",
        ),
        problem("a ridge", SQUARE, [0.0, 1.0], MOVED, "exp(-((x - 0.3 - 0.4*T)/0.02)^2)"),
        problem("a pulse", TORUS, [0.0, 1.0], AROUND, "exp(200*(cos(2*pi*(x - T)) - 1))"),
        problem("a bistable wave", SQUARE, [0.0, 2.0], bistable, "0.5*(1 - tanh((x - 0.3 - 0.04*T)/0.04))"),
        problem(
            "a boundary layer",
            SQUARE,
            [0.0, 1.0],
            "FORMULAflux = { u = [\"u\", \"0\"] }\ndiffusivity = { u = \"0.01\" }\nboundary = { u = \"U\" }",
            "(exp((x - 1)/0.01) - exp(-100))/(1 - exp(-100))",
        ),
        problem(
            "a bent layer",
            "[domain]\nperiodic = [true, false]\n[grid]\ncells = [40, 40]\n",
            [0.0, 1.0],
            "FORMULAflux = { u = [\"u\", \"0\"] }\nboundary = { u = \"U\" }",
            "tanh(60*(y - 0.5 - 0.1*sin(2*pi*(x - T))))",
        ),
    ];
    for problem in problems {
        let share = problem.share();
        assert!(share <= 1.0 / 3.0, "{}: {share:.3} of the error of equal cells", problem.name);
    }
}

/// A spike that has gone leaves a wave that equal cells resolve: the mesh goes back to them, although wide cells at the
/// crests of the wave hold no more of its range than equal ones.
#[test]
fn a_mesh_goes_back_to_equal_cells_where_a_spike_has_gone() {
    let pde = "FORMULAdiffusivity = { u = \"1e-9\" }\nsource = { u = \"-5*(u - sin(2*pi*x))\" }";
    let exact = "sin(2*pi*x) + exp(-5*T)*exp(-((x - 0.5)/0.01)^2)";
    let strip = "[domain]\nupper = [1.0, 0.1]\nperiodic = [true, true]\n[grid]\ncells = [40, 4]\n";
    let spike = problem("a spike", strip, [0.0, 10.0], pde, exact);
    let (MovingRun { record, .. }, failure) = spike.study(&[]).compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    let error = record.reports.last().unwrap().error.unwrap();
    assert!(error.linf < 1e-4, "{error:?}");
}

/// A wave that goes round ten times keeps its error, in steps of many times its width, and the mesh goes along.
#[test]
fn a_wave_goes_round_and_round() {
    let strip = "[domain]\nupper = [1.0, 0.1]\nperiodic = [true, true]\n[grid]\ncells = [80, 8]\n";
    for sharpness in [50, 400] {
        let exact = format!("exp({sharpness}*(cos(2*pi*(x - T)) - 1))");
        let wave = problem("a wave", strip, [0.0, 10.0], AROUND, &exact);
        let (MovingRun { record, .. }, failure) = wave.study(&["time.report=[1.0, 10.0]"]).compute().unwrap();
        assert!(failure.is_none(), "{failure:?}");
        let [first, last] = [0, 1].map(|k| record.reports[k].error.unwrap().linf);
        assert!(
            first < 5e-3 && last < 1.1 * first && record.work.steps < 100,
            "{first:e}, {last:e}, {:?}",
            record.work
        );
    }
}

/// Burgers' saw tooth on periodic axes forms its shocks within the run: it ends.
#[test]
fn a_saw_tooth_forms_on_a_periodic_mesh() {
    let pde = "kind = \"burgers\"\nviscosity = 1e-3\ninitial = \"0.75 + 0.5*sin(2*pi*(x + y))\"";
    let (MovingRun { record, .. }, failure) =
        problem("a saw tooth", TORUS, [0.0, 5.0], pde, "").study(&[]).compute().unwrap();
    assert!(failure.is_none() && record.work.steps < 300, "{failure:?} after {:?}", record.work);
}

/// What stands still is not damaged by a mesh that starts far from where it wants to be, with steps of any length.
#[test]
fn the_journey_harms_nothing() {
    for (cells, width) in [(30, 0.15), (60, 0.05), (120, 0.05)] {
        for step in [0.05, 0.01] {
            let place =
                format!("[domain]\nupper = [3.0, 0.1]\nperiodic = [false, true]\n[grid]\ncells = [{cells}, 4]\n");
            let study = Problem {
                name: "a layer that stands",
                place: Box::leak(place.into_boxed_str()),
                time: [0.0, 1.0],
                pde: "FORMULAdiffusivity = { u = \"1e-9\" }\nboundary = { u = \"if(x < 1.5, 1, 0)\" }",
                exact: format!("0.5*(1 - tanh((x - 1)/{width}))"),
            };
            let study = study.study(&["mesh.start=uniform", &format!("time.step={step}")]);
            let (MovingRun { record, .. }, failure) = study.compute().unwrap();
            let error = record.reports[0].error.unwrap().linf;
            assert!(failure.is_none() && error <= 5e-3, "{cells} cells, width {width}, Δt = {step}: {error:e}");
        }
    }
}

/// A jump inside starts like any other data, and ends five times better than on equal cells.
#[test]
fn a_jump_is_a_start() {
    let strip = "[domain]\nupper = [3.0, 0.1]\nperiodic = [false, true]\n[grid]\ncells = [60, 4]\n";
    let pde = "FORMULAdiffusivity = { u = \"0.02\" }\nboundary = { u = \"if(x < 1.5, 1, 0)\" }";
    let exact = "if(T < 1e-12, if(x < 1.01, 1, 0), 0.5*(1 + erf((1.01 - x)/sqrt(0.08*T + 1e-30))))";
    let share = problem("a jump", strip, [0.0, 1.0], pde, exact).share();
    assert!(share < 0.2, "{share:.3} of the error of equal cells");
}

/// Sources that are formulas of x see the image of a node that went round: ∫u grows by what the source gave.
#[test]
fn formulas_see_the_image_of_a_node() {
    let strip = "[domain]\nupper = [1.0, 0.1]\nperiodic = [true, true]\n[grid]\ncells = [60, 4]\n";
    let pde = "kind = \"formula\"\nunknowns = [\"u\"]\nflux = { u = [\"u\", \"0\"] }\n\
               diffusivity = { u = \"1e-5\" }\nsource = { u = \"0.01*exp(-((x - 0.5)/0.1)^2)\" }\n\
               initial = { u = \"exp(40*(cos(2*pi*x) - 1))\" }";
    let study = problem("a source", strip, [0.0, 3.0], pde, "").study(&[]);
    let mut simulation = study.simulation().unwrap();
    let mut record = Record::default();
    let mut state = study.start(&simulation, &mut record, &mut []).unwrap();
    let content = |state: &State| -> f64 {
        let areas = driftmesh::geometry::DualCells::new(&state.mesh);
        areas.areas().iter().zip(state.u.component(0)).map(|(area, u)| area * u).sum()
    };
    let before = content(&state);
    simulation.run(&mut state, &mut record, &mut []).unwrap();
    let farthest = state.mesh.x().iter().map(|x| x[0]).fold(0.0, f64::max);
    assert!(farthest > 3.0, "the mesh went along to {farthest} only");
    let (given, found) = (0.01 * 0.1 * 3.0 * 0.1 * PI.sqrt(), content(&state) - before);
    assert!((found / given - 1.0).abs() < 2e-2, "{found} of {given}");
}

/// A mesh that is fixed stays, on periodic axes too, where others go along with what they follow.
#[test]
fn a_fixed_mesh_stays() {
    let wave = problem("a wave", TORUS, [0.0, 0.2], AROUND, "sin(2*pi*(x - T))");
    let study = wave.study(&["mesh.generator.kind=fixed"]);
    let mut simulation = study.simulation().unwrap();
    let mut record = Record::default();
    let mut state = study.start(&simulation, &mut record, &mut []).unwrap();
    let mesh = state.mesh.clone();
    simulation.run(&mut state, &mut record, &mut []).unwrap();
    assert_eq!(state.mesh, mesh);
}

/// A fixed, small step is no worse than an automatic one that is five times longer: where the front rounds the corners,
/// it is done in parts.
#[test]
fn a_small_step_is_no_worse_than_a_long_one() {
    let study = include_str!("../studies/burgers.toml").replace("end = 1.25", "end = 1.25\nstep = 2e-3");
    let study = MovingMesh::from_source(&Source::new("the study", study)).unwrap();
    let (MovingRun { record: summary, .. }, failure) = study.compute().unwrap();
    assert!(failure.is_none() && summary.work.steps == 500);
    for report in summary.reports {
        let error = report.error.unwrap().linf;
        assert!(error < 1.3e-2, "{error:e} at t = {}", report.t);
    }
}

/// A large mesh starts from a coarser one that has come to rest, so that few of its own steps are left.
#[test]
fn a_large_mesh_starts_from_a_coarser_one() {
    let mesh = Mesh::uniform(Lattice::bounded([320, 20]).unwrap(), [0.0; 2], [16.0, 1.0]).unwrap();
    let (mut on_large, mut on_coarser) = (0, 0);
    let start = adapted(mesh, Form::Conservative, |mesh| {
        *(if mesh.lattice().cells()[0] == 320 { &mut on_large } else { &mut on_coarser }) += 1;
        let u: Vec<f64> = mesh.x().iter().map(|[x, y]| f64::tanh(20.0 * (x + y - 9.0))).collect();
        let rho = RootGradient::default().density(mesh, &u, None)?;
        Ok((u, rho))
    })
    .unwrap();
    assert_eq!(start.end, Ending::AtRest);
    assert!(on_coarser > on_large, "{on_coarser} steps on coarser meshes, {on_large} on the mesh itself");
}

/// A pulse that spreads until equal cells resolve it: the mesh takes its time on the way back to them.
#[test]
fn the_way_back_to_equal_cells_harms_nothing() {
    for (cells, w) in [(200, 0.02), (100, 0.03), (60, 0.05)] {
        let exact = format!("{w}/sqrt({0} + 0.004*t)*exp(-(x-0.5)^2/({0} + 0.004*t))", w * w);
        let study = |generator: &str| {
            let text = format!(
                "[study]\nname = \"pulse\"\nkind = \"moving-mesh\"\n[grid]\ncells = [{cells}, 2]\n[time]\nstart = 0.0\n\
                 end = 2.0\nreport = [0.5, 1.0, 2.0]\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\n\
                 diffusivity = {{ u = \"0.001\" }}\ninitial = {{ u = \"exp(-(x-0.5)^2/{})\" }}\n\
                 boundary = {{ u = \"no-flux\" }}\nexact = {{ u = \"{exact}\" }}\n\
                 [mesh]\ngenerator = {{ kind = \"{generator}\" }}\n",
                w * w
            );
            let (MovingRun { record: summary, .. }, failure) =
                MovingMesh::from_source(&Source::new("pulse", text)).unwrap().compute().unwrap();
            assert!(failure.is_none(), "{failure:?}");
            summary.reports.iter().map(|report| report.error.unwrap().l2).collect::<Vec<f64>>()
        };
        let (moving, fixed) = (study("whole"), study("fixed"));
        let worse = moving.iter().zip(&fixed).any(|(a, b)| *a > 1.2 * b);
        assert!(!worse, "{cells} cells: {moving:?} and, of equal cells, {fixed:?}");
    }
}

/// A side that is kept at another value than the initial solution: the layer that begins there has its cells from the
/// start.
#[test]
fn a_layer_that_begins_at_a_side_is_seen() {
    for (cells, diffusivity) in [(20, 1e-3), (40, 3e-4), (40, 1e-3)] {
        let text = format!(
            "[study]\nname = \"wall\"\nkind = \"moving-mesh\"\n[domain]\nlower = [0.0, 0.0]\nupper = [1.0, 1.0]\n\
             periodic = [false, true]\n[grid]\ncells = [{cells}, 2]\n[time]\nstart = 0.0\nend = 0.3\n\
             report = [0.1, 0.3]\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\n\
             diffusivity = {{ u = \"{diffusivity}\" }}\n\
             initial = {{ u = \"0\" }}\n\
             boundary = {{ u = \"if(x < 0.5, 1, 0)\" }}\n\
             exact = {{ u = \"if(x <= 0, 1, 1 - erf(x/sqrt(4*{diffusivity}*max(t, 1e-14))))\" }}\n"
        );
        let (MovingRun { record: summary, .. }, failure) =
            MovingMesh::from_source(&Source::new("wall", text)).unwrap().compute().unwrap();
        assert!(failure.is_none(), "{failure:?}");
        let errors: Vec<f64> = summary.reports.iter().map(|report| report.error.unwrap().l2).collect();
        assert!(errors.iter().all(|error| *error < 6e-3), "{cells} cells, D = {diffusivity}: {errors:?}");
    }
}

/// Jumps that are given, standing, moving and in time, and noise: nothing has to be solved for, and the run ends in
/// time.
#[test]
fn given_jumps_complete() {
    for u in [
        "if(x < 0.5123, 0, 1)",
        "if(x < 0.3 + t, 0, 1)",
        "if((x-0.5)^2 + (y-0.5)^2 < 0.09, 1, 0)",
        "sin(1e5*x)*cos(7.7e4*y)",
        "if(t < 0.05, tanh((x-0.3)/0.01), tanh((x-0.7)/0.01))",
    ] {
        let text = format!(
            "[study]\nname = \"jump\"\nkind = \"moving-mesh\"\n[grid]\ncells = [24, 24]\n[time]\nstart = 0.0\n\
             end = 0.1\n[pde]\nkind = \"prescribed\"\nu = \"{u}\"\n"
        );
        let (MovingRun { record: summary, .. }, failure) =
            MovingMesh::from_source(&Source::new("jump", text)).unwrap().compute().unwrap();
        assert!(failure.is_none() && summary.work.steps <= 1000, "{u}: {failure:?}");
    }
}

/// Steps of any lengths: what a mesh learns in short ones does not throw it about in a long one.
#[test]
fn a_mesh_rests_in_steps_of_unequal_length() {
    let mut mover = Mover::new(Whole::default());
    let mut mesh = Mesh::uniform(Lattice::bounded([40, 40]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
    let mut gait = Gait::at_rest(&mesh);
    for n in 0..600 {
        let u: Vec<f64> = mesh.x().iter().map(|x| ((x[0] - 0.4) / 0.02).tanh()).collect();
        let rho = RootGradient::default().density(&mesh, &u, None).unwrap();
        let dt = if n % 11 == 10 { 0.1 } else { 1e-3 };
        let step = mover.step(&mesh, &gait, Followed { u: &u, rho: &rho }, dt).unwrap();
        let way = 40.0 * step.moved.mesh.farthest(&mesh);
        assert!(n < 580 || way < 1e-2, "{way} cells in step {n}");
        (mesh, gait) = (step.moved.mesh, step.gait);
    }
}

/// A circle that shrinks by its curvature, u_t = Δu + (u − u³)/ε² with ε = .005: its radius falls like √(.09 − 2t).
/// The front is half as wide as a uniform cell.
#[test]
fn a_circle_shrinks_by_its_curvature() {
    let text = "[study]\nname = \"circle\"\nkind = \"moving-mesh\"\n[grid]\ncells = [80, 80]\n[time]\nstart = 0.0\n\
                end = 0.03\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\ndiffusivity = { u = \"1\" }\n\
                source = { u = \"(u - u^3)/2.5e-05\" }\n\
                initial = { u = \"-tanh((sqrt((x-0.5)^2 + (y-0.5)^2) - 0.3)/0.007071067812)\" }\n\
                boundary = { u = \"no-flux\" }\n";
    let study = MovingMesh::from_source(&Source::new("circle", text)).unwrap();
    let (MovingRun { state, .. }, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    let state = state.unwrap();
    let area: f64 = node_areas(&state.mesh).iter().zip(state.u.component(0)).map(|(a, u)| 0.5 * a * (1.0 + u)).sum();
    let radius = (area / std::f64::consts::PI).sqrt();
    assert!((radius / 0.03_f64.sqrt() - 1.0).abs() < 0.05, "{radius}");
}
