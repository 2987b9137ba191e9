//! Sources, inflows and side values that come and go within a time much shorter than steps would be without them.

use driftmesh::study::{Kind, MovingLine, MovingMesh, Source};

const HEAD: &str = "[study]\nname = \"forced\"\nkind = \"moving-mesh\"\n";

/// l_inf at the end on a line of 40 cells over t = 0…1, and what was warned of.
fn on_line(time: &str, pde: &str) -> (f64, Vec<String>) {
    let text = format!(
        "{HEAD}[domain]\nlower = [0.0]\nupper = [1.0]\n[grid]\ncells = [40]\n[time]\nstart = 0.0\nend = 1.0\n{time}\n\
         [pde]\nkind = \"formula\"\nunknowns = [\"u\"]\ninitial = {{ u = \"0\" }}\n{pde}"
    );
    let study = MovingLine::from_source(&Source::new("forced.toml", text)).unwrap();
    let (run, failure) = study.compute().unwrap();
    assert!(failure.is_none(), "{failure:?}");
    (run.record.reports.last().unwrap().error.unwrap().linf, run.record.warnings)
}

/// A source of the whole line that brings 1 within τ, around whatever time: u = (1 + erf((t − t₀)/τ))/2.
fn pulse(center: f64, width: f64) -> String {
    format!(
        "diffusivity = {{ u = \"0.1\" }}\nboundary = {{ u = \"no-flux\" }}\n\
         source = {{ u = \"{}*exp(-((t - {center})/{width})^2)\" }}\n\
         exact = {{ u = \"0.5*(1 + erf((t - {center})/{width}))\" }}",
        1.0 / (width * std::f64::consts::PI.sqrt())
    )
}

#[test]
fn a_pulse_of_a_source_is_not_stepped_over() {
    for (center, width) in [(0.53, 1e-3), (0.2, 5e-3), (0.777, 2e-3)] {
        let (error, _) = on_line("report = [1.0]", &pulse(center, width));
        assert!(error < 5e-3, "{center}, {width}: {error:.2e}");
    }
}

/// Heat that flows in through the left side within 1e-3 spreads as from a point: 2 exp(−x²/4Dt)/√(4πDt).
#[test]
fn a_pulse_of_an_inflow_is_not_stepped_over() {
    let (error, _) = on_line(
        "report = [1.0]",
        "diffusivity = { u = \"0.01\" }\n\
         boundary = { u = { left = { flux = \"1000/sqrt(pi)*exp(-((t-0.53)/1e-3)^2)\" }, right = \"no-flux\" } }\n\
         exact = { u = \"if(t<0.53,0,2*exp(-x^2/(0.04*max(t-0.53,1e-9)))/sqrt(4*pi*0.01*max(t-0.53,1e-9)))\" }",
    );
    assert!(error < 0.1, "{error:.2e}");
}

/// Where a solution is the same everywhere, its change in time is what steps follow.
#[test]
fn an_oscillation_without_a_place_is_followed() {
    let (error, _) = on_line(
        "report = [0.325, 0.525, 0.925]",
        "diffusivity = { u = \"0.1\" }\nboundary = { u = \"no-flux\" }\n\
         source = { u = \"2*pi*20*sin(2*pi*20*t)\" }\nexact = { u = \"1-cos(2*pi*20*t)\" }",
    );
    assert!(error < 5e-3, "{error:.2e}");
}

/// Steps of a given length stay as they are; a run in which they pass over something says so, and values that grow from
/// below the smallest number stop no step.
#[test]
fn given_steps_that_pass_over_a_pulse_say_so() {
    let (error, warnings) = on_line("step = 0.02", &pulse(0.53, 1e-3));
    assert!(error > 0.1, "{error:.2e}");
    assert!(warnings.iter().any(|said| said.contains("the source of `u` changes within a step")), "{warnings:?}");
    for step in ["1e-3", "1e-4"] {
        let (error, warnings) = on_line(&format!("step = {step}"), &pulse(0.53, 2e-2));
        assert!(
            error < 1e-2 && !warnings.iter().any(|said| said.contains("within a step")),
            "{error:.2e}: {warnings:?}"
        );
    }
}

/// A hot side of the plane for 1e-2 of the run: as much heat flows in as in a run with steps a tenth as long as that.
#[test]
fn a_pulse_of_a_side_value_is_not_stepped_over() {
    let mass = |step: &str| {
        let text = format!(
            "{HEAD}[grid]\ncells = [24, 4]\n[domain]\nlower = [0.0, 0.0]\nupper = [1.0, 0.2]\n[time]\nstart = 0.0\n\
             end = 1.0\n{step}\n[pde]\nkind = \"formula\"\nunknowns = [\"u\"]\ninitial = {{ u = \"0\" }}\n\
             diffusivity = {{ u = \"0.1\" }}\nboundary = {{ u = {{ left = \"exp(-((t-0.63)/0.005)^2)\", \
             right = \"no-flux\", bottom = \"no-flux\", top = \"no-flux\" }} }}\n"
        );
        let study = MovingMesh::from_source(&Source::new("forced.toml", text)).unwrap();
        let (run, failure) = study.compute().unwrap();
        assert!(failure.is_none(), "{failure:?}");
        run.record.reports.last().unwrap().conserved.mass
    };
    let [free, fine] = ["report = [0.66]", "report = [0.66]\nstep = 5e-4"].map(mass);
    assert!((free - fine).abs() < 0.1 * fine.abs() && fine > 0.0, "{free:.3e}, {fine:.3e}");
}
