use super::files::{Column, RunFiles};
use crate::output::{Curve, Figure, Scale};

/// Curves of `history.csv` that belong into one plot.
struct Group {
    /// Name of its files.
    name: &'static str,
    title: &'static str,
    label: &'static str,
    scale: Scale,
    /// Whether it belongs to studies of a line, or to the others.
    line: bool,
    /// The columns, each with its text in the legend.
    columns: &'static [(&'static str, &'static str)],
}

const GROUPS: [Group; 11] = [
    Group {
        name: "error",
        title: "Error over time",
        label: "error (units of the solution)",
        scale: Scale::Logarithmic,
        line: false,
        columns: &[("error_linf", "largest error"), ("error_l2", "root mean square error")],
    },
    Group {
        name: "front-error",
        title: "Error of the front over time",
        label: "error of the height (units of y)",
        scale: Scale::Logarithmic,
        line: false,
        columns: &[("front_error_linf", "largest error of the front")],
    },
    Group {
        name: "front-position",
        title: "Position of the front",
        label: "height (units of y)",
        scale: Scale::Linear,
        line: false,
        columns: &[("front_mean", "mean"), ("front_min", "lowest point"), ("front_max", "highest point")],
    },
    Group {
        name: "temperature",
        title: "Temperatures of the walls",
        label: "temperature (units of u)",
        scale: Scale::Linear,
        line: false,
        columns: &[
            ("bottom_temperature", "mean of the bottom"),
            ("top_temperature", "mean of the top"),
            ("temperature_min", "lowest"),
            ("temperature_max", "highest"),
        ],
    },
    Group {
        name: "quality",
        title: "Quality of the mesh over time",
        label: "Q and scaled Jacobian (dimensionless)",
        scale: Scale::Logarithmic,
        line: false,
        columns: &[("q_max", "largest Q"), ("q_mean", "mean Q"), ("min_scaled_jacobian", "smallest corner Jacobian")],
    },
    Group {
        name: "contraction",
        title: "Contraction of a Schwarz iteration",
        label: "factor an iteration (dimensionless)",
        scale: Scale::Linear,
        line: false,
        columns: &[("contraction_observed", "observed"), ("contraction_predicted", "predicted bound")],
    },
    Group {
        name: "error",
        title: "Distance to the single-domain mesh",
        label: "distance (units of x)",
        scale: Scale::Logarithmic,
        line: true,
        columns: &[("error_linf", "largest over the subdomains")],
    },
    Group {
        name: "contraction",
        title: "Contraction of a Schwarz iteration",
        label: "factor in two iterations (dimensionless)",
        scale: Scale::Linear,
        line: true,
        columns: &[("observed_rate", "observed"), ("bound", "bound")],
    },
    Group {
        name: "quality",
        title: "Quality of the mesh over time",
        label: "share of the mean (dimensionless)",
        scale: Scale::Logarithmic,
        line: true,
        columns: &[("equidistribution", "largest share of M in a cell"), ("shortest_cell", "shortest cell")],
    },
    Group {
        name: "energy",
        title: "Imbalance of heat over time",
        label: "share of the heat that was moved (dimensionless)",
        scale: Scale::Logarithmic,
        line: false,
        columns: &[
            ("energy_imbalance", "fluxes by weighted residual"),
            ("energy_imbalance_by_differences", "fluxes by differences"),
        ],
    },
    Group {
        name: "steps",
        title: "Length of the time steps",
        label: "step (units of t)",
        scale: Scale::Logarithmic,
        line: false,
        columns: &[("dt", "step"), ("step_limit", "longest stable step")],
    },
];

/// A first value below this share of the second one is rounding, and is left out.
const ROUNDING: f64 = 1e-6;

/// Plots of a history over time, without those that would show nothing.
pub fn of(run: &RunFiles) -> Vec<(&'static str, Figure)> {
    let column = |name: &str| run.history.iter().find(|column| column.name == name);
    let Some(t) = column("t") else { return Vec::new() };
    let study = run.word("study");
    let line = run.word("kind") == "equidistribution";
    let drawn = |group: &Group| {
        let curves: Vec<Curve> = (group.columns.iter())
            .filter_map(|(name, words)| Some(curve(words, t, column(name)?, group.scale)))
            .filter(|curve| curve.points.len() > 1)
            .collect();
        // constant time steps need no plot: they are in the study
        let changes = |curve: &Curve| curve.points.iter().any(|p| (p[1] / curve.points[0][1] - 1.0).abs() > 1e-6);
        let worth = group.line == line && !curves.is_empty() && (group.name != "steps" || curves.iter().any(changes));
        worth.then(|| {
            let figure = Figure {
                title: format!("{study}: {}", group.title),
                labels: ["time t".into(), group.label.into()],
                scales: [Scale::Linear, group.scale],
                curves,
                ..Figure::default()
            };
            (group.name, figure)
        })
    };
    GROUPS.iter().filter_map(drawn).collect()
}

/// A column over time.
fn curve(name: &str, t: &Column, column: &Column, scale: Scale) -> Curve {
    let placed = |v: f64| scale == Scale::Linear || v > 0.0;
    let mut points: Vec<[f64; 2]> = (t.values.iter().zip(&column.values))
        .filter_map(|(t, v)| Some([(*t)?, (*v)?]))
        .filter(|p| placed(p[1]))
        .collect();
    // the start is given, so that its error is rounding: it would stretch a logarithmic axis over all powers of ten
    if let [first, second, ..] = points[..]
        && scale == Scale::Logarithmic
        && first[1] < ROUNDING * second[1]
    {
        points.remove(0);
    }
    Curve { name: name.into(), points, plain: true, ..Curve::default() }.outlined()
}

#[cfg(test)]
mod tests {
    /// Of other names a plot would stay when another run replaces this one.
    #[test]
    fn plots_are_among_the_pictures_of_a_run() {
        super::GROUPS.iter().for_each(|group| assert!(crate::output::names::PICTURES.contains(&group.name)));
    }
}
