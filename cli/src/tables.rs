//! What the program says of a run on the terminal, kind by kind.

use crate::terminal::moment;
use driftmesh::meshing::Interface;
use driftmesh::output::Summary;
use driftmesh::simulation::Retries;
use driftmesh::study::{
    EquidistributionStudy, FrontSummary, Kind, LineFigures, MovingFigures, MovingLine, MovingMesh, NumberedIterate,
    PoissonFigures, PoissonStudy, Running, SpeciesReport, SpeciesStudy, StefanStudy, UniformEquivalent,
};

/// What is said of a run in a few lines.
pub trait Told: Kind {
    /// What was found, and how long it took.
    fn table(summary: &SummaryOf<Self>) -> String;

    /// What takes another computation to say.
    ///
    /// # Errors
    /// What hinders that.
    fn more(&self, _summary: &SummaryOf<Self>) -> driftmesh::Result<Option<String>> {
        Ok(None)
    }

    /// What there is of a run that failed.
    fn left(summary: &SummaryOf<Self>) -> String;
}

pub type SummaryOf<K> = Summary<<<K as Kind>::Run as Running>::Figures>;

impl Told for MovingMesh {
    fn table(summary: &Summary<MovingFigures>) -> String {
        moving(summary)
    }

    fn more(&self, summary: &Summary<MovingFigures>) -> driftmesh::Result<Option<String>> {
        uniform(self, summary)
    }

    fn left(summary: &Summary<MovingFigures>) -> String {
        last_good(summary.figures.work.steps)
    }
}

impl Told for MovingLine {
    fn table(summary: &Summary<MovingFigures>) -> String {
        moving(summary)
    }

    fn left(summary: &Summary<MovingFigures>) -> String {
        last_good(summary.figures.work.steps)
    }
}

/// The reports of a moving mesh, what adaptation brought, and what all of it cost.
fn moving(summary: &Summary<MovingFigures>) -> String {
    let compared = summary.figures.reports.iter().any(|report| report.comparison.is_some());
    let mut text = String::new();
    if !summary.figures.reports.is_empty() {
        text += "       t     l_inf        l2   Q max  Q mean   min J  equidist";
        text += if compared { "   R max  R mean  mesh rms\n" } else { "\n" };
    }
    for report in &summary.figures.reports {
        let [linf, l2] = report.error.map_or(["-".into(), "-".into()], |e| [e.linf, e.l2].map(|e| format!("{e:.3e}")));
        let q = report.quality;
        let smallest = match q.min_scaled_jacobian {
            small if small > 0.0 && small < 1e-3 => format!("{small:.0e}"),
            j => format!("{j:.4}"),
        };
        text += &format!(
            "{:>8} {linf:>9} {l2:>9} {:7.3} {:7.3} {smallest:>7} {:9.3}",
            moment(report.t),
            q.q_max,
            q.q_mean,
            q.equidistribution
        );
        if let Some(c) = report.comparison {
            text += &format!(" {:7.4} {:7.4} {:9.1e}", c.r_max, c.r_mean, c.mesh_rms);
        }
        text.push('\n');
    }
    if let Some((t, benefit)) = summary.figures.reports.last().and_then(|report| Some((report.t, report.benefit?))) {
        text += &format!(
            "benefit  interpolation error about {:.1e} on this mesh, {:.1e} on as many equal cells (t = {})\n",
            benefit.mesh,
            benefit.uniform,
            moment(t)
        );
    }
    let last = summary.figures.reports.last().and_then(|report| Some((report.t, report.interface?)));
    if let Some((t, interface)) = last.filter(|(_, interface)| interface.points > 0) {
        text += &interfaces(t, &interface);
    }
    text + &cost(summary)
}

impl Told for StefanStudy {
    fn table(summary: &Summary<FrontSummary>) -> String {
        let mut text = String::new();
        if !summary.figures.reports.is_empty() {
            text += "       t  front mean       min       max  front error  u error    energy  3-point  step limit\n";
        }
        for report in &summary.figures.reports {
            let figure = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.2e}"));
            text += &format!(
                "{:>8} {:11.6} {:9.6} {:9.6} {:>12} {:>8} {:>9} {:>8} {:>11}\n",
                moment(report.t),
                report.front.mean,
                report.front.range[0],
                report.front.range[1],
                figure(report.front.error_linf),
                figure(report.error.map(|error| error.linf)),
                figure(report.energy_imbalance),
                figure(report.energy_imbalance_by_differences),
                figure(report.step_limit)
            );
        }
        let (work, s) = (summary.figures.work, summary.seconds);
        text += &format!("work     {} steps, {} linear solves", work.steps, work.work.linear_solves);
        if work.work.newton_iterations > 0 {
            text += &format!(", {} Newton iterations", work.work.newton_iterations);
        }
        text + &format!(
            "\nseconds  {:.2} (pde {:.2}, output {:.2}), {} threads",
            s.wall, s.parts.pde, s.output, summary.parallel.threads
        )
    }

    fn left(summary: &Summary<FrontSummary>) -> String {
        last_good(summary.figures.work.steps)
    }
}

impl Told for SpeciesStudy {
    fn table(summary: &Summary<FrontSummary<SpeciesReport>>) -> String {
        let mut text = String::new();
        if !summary.figures.reports.is_empty() {
            text += "       t     front  velocity   species      content       inflow     consumed  imbalance\n";
        }
        for report in &summary.figures.reports {
            let fronts = report.front.x.iter().zip(&report.front.velocity);
            let mut fronts = fronts.map(|(x, velocity)| format!("{x:9.6} {velocity:9.2e}"));
            let mut species = report.species.iter().map(|(name, total)| {
                let [content, inflow, consumed] = [total.content, total.inflow, total.consumed];
                format!("{name:>9} {content:12.6} {inflow:12.6} {consumed:12.6} {:10.1e}", total.imbalance)
            });
            let mut time = Some(moment(report.t));
            loop {
                let (front, total) = (fronts.next(), species.next());
                if front.is_none() && total.is_none() {
                    break;
                }
                let time = time.take().unwrap_or_default();
                text += &format!("{time:>8} {:19} {}\n", front.unwrap_or_default(), total.unwrap_or_default());
            }
        }
        let (work, s) = (summary.figures.work, summary.seconds);
        text + &format!(
            "work     {} steps, {} rejected, {} Newton iterations\n\
             seconds  {:.2} (pde {:.2}, output {:.2}), {} threads",
            work.steps,
            work.rejected_steps,
            work.work.newton_iterations,
            s.wall,
            s.parts.pde,
            s.output,
            summary.parallel.threads
        )
    }

    fn left(summary: &Summary<FrontSummary<SpeciesReport>>) -> String {
        last_good(summary.figures.work.steps)
    }
}

impl Told for EquidistributionStudy {
    fn table(summary: &Summary<LineFigures>) -> String {
        let mut text = String::new();
        let figure = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.3e}"));
        if !summary.figures.iterations.is_empty() {
            if summary.figures.iterations_per_step.is_some() {
                text += "the last step:\n";
            }
            text += "       n     error  increment  largest jump  interpolation  linear solves\n";
            for it in shown(&summary.figures.iterations) {
                text += &format!(
                    "{:8} {:9.3e} {:>10} {:>13} {:>14} {:14}\n",
                    it.n,
                    it.error_linf,
                    it.increment.map_or("-".into(), |increment| format!("{increment:.3e}")),
                    figure(it.largest_jump),
                    figure(it.interpolation_error),
                    it.linear_solves
                );
            }
            let rate = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.5}"));
            let r = summary.figures.rate;
            text += &format!(
                "rate     observed {}, predicted {}, at most {} (in two iterations)\n",
                rate(r.observed),
                rate(r.predicted),
                rate(r.bound)
            );
            if let Some(n) = summary.figures.iterations_to_tolerance {
                text += &format!("met      the tolerance after {n} iterations\n");
            }
        }
        if let Some(per) = summary.figures.iterations_per_step {
            text += &format!(
                "steps    {}, each of {:.1} iterations ({} to {})\n",
                summary.figures.work.steps, per.mean, per.min, per.max
            );
        }
        if let Some(q) = summary.figures.quality {
            text += &format!(
                "mesh     equidistribution {:.4}, shortest cell {:.3e} of the mean",
                q.equidistribution, q.shortest_cell
            );
            text += &q.error_linf.map_or(String::new(), |error| format!(", {error:.3e} from the continuous one"));
            text += "\n";
        }
        let s = summary.seconds;
        text + &format!(
            "seconds  {:.2} (mesh {:.2}, output {:.2}), {} linear solves, {} threads",
            s.wall, s.parts.mesh, s.output, summary.figures.work.linear_solves, summary.parallel.threads
        )
    }

    fn left(_summary: &Summary<LineFigures>) -> String {
        "the last mesh and every iteration up to it are".into()
    }
}

impl Told for PoissonStudy {
    fn table(summary: &Summary<PoissonFigures>) -> String {
        let mut text = String::new();
        if let Some(error) = summary.figures.error {
            text += &format!("error    l_inf {:.3e}, l2 {:.3e}\n", error.linf, error.l2);
        }
        if let Some(stencil) = summary.figures.stencil {
            let degree = stencil.exact_degree.map_or("none".into(), |degree| degree.to_string());
            text += &format!(
                "stencils exact to degree {degree}, {:.1} % without negative weights, {:.2e} a second\n",
                100.0 * stencil.nonnegative_fraction,
                stencil.points_per_second
            );
        }
        let s = summary.seconds;
        text + &format!(
            "seconds  {:.2} (stencils {:.3}, solve {:.2}, output {:.2}), {} threads",
            s.wall, s.parts.stencils, s.parts.solve, s.output, summary.parallel.threads
        )
    }

    fn left(_summary: &Summary<PoissonFigures>) -> String {
        "the solution is".into()
    }
}

/// Work, steps that were tried again, and seconds of a moving mesh.
fn cost(summary: &Summary<MovingFigures>) -> String {
    let (total, s) = (summary.figures.work, summary.seconds);
    let mut text = format!(
        "work     {} steps, {} Newton iterations, {} linear solves in {} iterations",
        total.steps, total.work.newton_iterations, total.work.linear_solves, total.work.linear_iterations
    );
    if total.work.direct_solves() > 0 {
        text += &format!(", {} of them by elimination", total.work.direct_solves());
    }
    if total.work.substeps > 0 {
        text += &format!(", {} explicit substeps", total.work.substeps);
    }
    if total.work.path_steps > 0 {
        text += &format!(", {} path steps", total.work.path_steps);
    }
    let Retries { substeps, smoothed, shortened } = summary.figures.safety;
    if total.rejected_steps > 0 {
        text += &format!("\nrejected {} steps", total.rejected_steps);
        let again = [(substeps, "with mesh sub-steps"), (smoothed, "with more smoothing"), (shortened, "shortened")];
        let again: Vec<String> = again.iter().filter(|(n, _)| *n > 0).map(|(n, how)| format!("{n} {how}")).collect();
        if !again.is_empty() {
            text += &format!(", tried again {}", again.join(", "));
        }
    }
    text += &format!("\nseconds  {:.2} (", s.wall);
    if s.parts.interface > 0.0 {
        text += &format!("interface {:.2}, ", s.parts.interface);
    }
    text + &format!(
        "mesh {:.2}, pde {:.2}, monitor {:.2}, output {:.2}), {} threads",
        s.parts.mesh, s.parts.pde, s.parts.monitor, s.output, summary.parallel.threads
    )
}

fn last_good(step: usize) -> String {
    format!("everything up to the last good state (step {step}) is")
}

/// The uniform meshes with the errors of the reports, where they can be told.
fn uniform(study: &MovingMesh, summary: &Summary<MovingFigures>) -> driftmesh::Result<Option<String>> {
    let mut found = Vec::new();
    for report in &summary.figures.reports {
        found.extend(study.uniform_equivalent(report)?);
    }
    let Some(UniformEquivalent { thicker, .. }) = found.first().copied() else { return Ok(None) };
    let nodes: Vec<String> = found.iter().map(|at| format!("{} × {}", at.nodes[0], at.nodes[1])).collect();
    let scaled = if thicker > 1.0 { format!(", scaled from a front {thicker} times as thick") } else { String::new() };
    Ok(Some(format!("uniform  about {} nodes have the same l_inf (order 2{scaled})", nodes.join(", "))))
}

/// Iterations that are shown: the first ones, then ever fewer, and the last.
fn shown(iterations: &[NumberedIterate]) -> impl Iterator<Item = &NumberedIterate> {
    let last = iterations.len().saturating_sub(1);
    let round = |n: usize| n <= 10 || [1, 2, 5].iter().any(|d| (0..7).any(|power| n == d * 10_usize.pow(power)));
    iterations.iter().filter(move |it| round(it.n) || it.n == last)
}

/// How well the subdomains fit together at the last report.
fn interfaces(t: f64, interface: &Interface) -> String {
    let mut text = format!("between  {} interface points at t = {t}", interface.points);
    if let (Some(error), Some(noise)) = (interface.standard_error, interface.noise) {
        text += &format!(", standard error {error:.1e}, {noise:.1e} of the shortest edge");
    }
    if interface.sweeps > 0 {
        text += &format!(", {} sweeps a step", interface.sweeps);
    }
    if interface.walks == 0 && interface.contraction.is_none() {
        text += ", by strips alone";
    }
    if interface.read > 0 {
        let times = if interface.exchanges == 1 { "once".into() } else { format!("{} times", interface.exchanges) };
        text += &format!(", up to {} nodes read from neighbours {times} a step", interface.read);
    }
    if interface.gathered > 0 {
        text += &format!(", {} coarse ones gathered", interface.gathered);
    }
    if let Some(c) = interface.contraction {
        text += &format!(", {} iterations a step, contraction {:.3}", c.iterations, c.observed);
        if let Some(predicted) = c.predicted {
            text += &format!(" (at most {predicted:.3})");
        }
    }
    text + "\n"
}
