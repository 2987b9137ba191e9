use serde::Serialize;
use serde_json::{Map, Value};

/// A table of the page, made from the summary of any kind of study.
#[derive(Debug, Serialize)]
pub struct Table {
    pub title: String,
    pub head: Vec<String>,
    pub rows: Vec<Vec<String>>,
    /// Words of the table, with their meanings.
    pub words: Vec<[&'static str; 2]>,
}

/// Seconds that a part of a run took.
#[derive(Debug, Serialize)]
pub struct Part {
    pub name: String,
    pub seconds: String,
    /// Share of the whole run, in percent.
    pub percent: f64,
}

/// Keys of a summary that are shown elsewhere on the page.
const ELSEWHERE: [&str; 8] = ["schema", "study", "kind", "version", "status", "seconds", "warnings", "mesh"];
/// Above this number of records each report is a row, in the order of the file; up to it each quantity is.
const MANY: usize = 8;
/// Number of rows shown at the beginning, and at the end, of a longer table.
const SHOWN: usize = 250;

/// Names of the entries of a summary, by the end of their paths, with their meanings where these are not plain.
const NAMES: [(&str, &str, &str); 62] = [
    ("t", "t", ""),
    ("n", "iteration", ""),
    ("error.linf", "largest error", "over the nodes, against the exact solution"),
    ("error.l2", "root mean square error", "over the area, against the exact solution"),
    ("error.l2_integral", "square root of ∫ error²", "grows with the area"),
    ("quality.q_max", "largest Q", "of a cell: 1 for a square, more for one that is stretched or sheared"),
    ("quality.q_mean", "mean Q", ""),
    (
        "quality.min_scaled_jacobian",
        "smallest corner Jacobian",
        "over that of equal cells; positive as long as no cell is folded",
    ),
    ("quality.equidistribution", "equidistribution", "largest over mean density × size of a cell; 1 is perfect"),
    ("quality.shortest_cell", "shortest cell", "over the mean one; negative where nodes have changed their order"),
    ("quality.error_linf", "distance from the continuous mesh", "largest, of up to a thousand nodes"),
    ("conserved.mass", "integral of the first unknown", ""),
    ("conserved.drift", "change of the integral", "since the start, over its size there"),
    (
        "benefit.mesh",
        "interpolation error of this mesh",
        "largest, of what the mesh follows: estimated from every other node",
    ),
    ("benefit.uniform", "interpolation error of equal cells", "the same for as many equal cells"),
    ("interface.points", "points between subdomains", ""),
    ("interface.standard_error", "standard error of interface points", "root mean square over both coordinates"),
    ("interface.noise", "… over the shortest edge", ""),
    ("interface.sweeps", "sweeps before the walks", ""),
    ("interface.walks", "walks or paths from each point", ""),
    ("interface.exchanges", "exchanges between neighbours", "in the last step"),
    ("interface.read", "nodes read from neighbours", "by the subdomain with the most, in one exchange"),
    ("interface.gathered", "coarse unknowns gathered", "in one exchange"),
    ("interface.handed_on", "walks handed on", "to another subdomain, in the last step"),
    ("contraction.iterations", "Schwarz iterations", "in the last step"),
    ("contraction.predicted", "contraction, predicted", "bound on the factor by which an iteration shrinks the error"),
    ("contraction.observed", "contraction, observed", ""),
    (
        "comparison.r_max",
        "largest Q, reference over this mesh",
        "the reference is the run of [compare]; 1 where both are as good",
    ),
    ("comparison.r_mean", "mean Q, reference over this mesh", ""),
    ("comparison.cell_max", "… largest in one cell", ""),
    ("comparison.mesh_rms", "distance of the meshes", "root mean square over the nodes"),
    ("rate.stride", "in so many iterations", ""),
    ("rate.observed", "observed", ""),
    ("rate.predicted", "predicted", "by theory, for the error in the end; – where no theory says"),
    ("parallel.ranks", "processes", ""),
    ("parallel.messages", "messages from other processes a step", ""),
    ("parallel.bytes", "bytes from other processes a step", ""),
    ("rate.bound", "predicted bound", ""),
    ("front.mean", "mean height of the front", ""),
    ("front.range", "its lowest and highest point", ""),
    ("front.error_linf", "largest error of the front", "against the exact solution"),
    (
        "front.doubt",
        "doubt of the front",
        "share of its way by which the front would change with gradients over one more row",
    ),
    ("front.bare", "bare walls", "share of the columns at which a phase is missing"),
    ("energy_imbalance", "imbalance of heat", "as a share of what was moved, with fluxes by weighted residual"),
    ("energy_imbalance_by_differences", "… with fluxes by differences", ""),
    ("step_limit", "longest stable step", "of the explicit front, as estimated"),
    ("error_linf", "largest error", "against the discrete solution on one domain"),
    ("increment", "increment", "how far a node has moved at most since the iteration before"),
    ("interpolation_error", "interpolation error", "largest error of linear interpolation on the glued mesh"),
    ("largest_jump", "largest jump", "twice the largest change of u over a cell"),
    ("points_per_second", "stencils a second", ""),
    ("nonnegative_fraction", "share without negative weights", ""),
    ("exact_degree", "exact to degree", "of polynomials"),
    ("safety.substeps", "steps tried again with mesh sub-steps", ""),
    ("safety.smoothed", "steps tried again with more smoothing", ""),
    ("safety.shortened", "steps tried again shorter", ""),
    ("linear_iterations", "iterations of linear solvers", ""),
    ("direct_unstarted", "systems left to sparse elimination", "the iteration could not begin"),
    ("direct_stalled", "systems left to sparse elimination", "the iteration ended above its tolerance"),
    ("newton_iterations", "iterations of Newton's method", ""),
    ("path_steps", "steps of random paths", ""),
    ("iterations_to_tolerance", "iterations to the tolerance", ""),
];

/// All tables of a summary.
pub fn of(summary: &Map<String, Value>) -> Vec<Table> {
    let mut tables = Vec::new();
    let mut loose = Vec::new();
    for (key, value) in summary.iter().filter(|(key, _)| !ELSEWHERE.contains(&key.as_str())) {
        match value {
            // failures are shown at the top of the page
            Value::Object(object) if object.contains_key("message") => {}
            Value::Array(records) if records.iter().any(Value::is_object) => {
                let last = key == "iterations" && summary.contains_key("iterations_per_step");
                tables.push(of_records(if last { "iterations of the last step" } else { key }, records));
            }
            Value::Array(records) if records.is_empty() => {}
            // a contraction of which nothing is known is left out
            Value::Object(rate) if key == "rate" && rate.iter().all(|(key, v)| key == "stride" || v.is_null()) => {}
            Value::Object(_) if ["work", "parallel", "safety"].contains(&key.as_str()) => {
                // counters that stayed 0 are left out
                loose.extend(flat(value, key).into_iter().filter(|(_, v)| v.as_f64() != Some(0.0)));
            }
            Value::Object(_) => {
                let rows = flat(value, key);
                let words = meanings(rows.iter().map(|(path, _)| path.as_str()));
                let rows = rows.iter().map(|(path, value)| vec![name(path), shown(value)]).collect();
                tables.push(Table { title: title(key), head: Vec::new(), rows, words });
            }
            Value::Null => {}
            // that of the last step is left out if there are those of all steps
            _ if key == "iterations_to_tolerance" && summary.contains_key("iterations_per_step") => {}
            _ => loose.push((key.clone(), value.clone())),
        }
    }
    if !loose.is_empty() {
        let rows = loose.iter().map(|(path, value)| vec![name(path), shown(value)]).collect();
        tables.push(Table { title: "Work".into(), head: Vec::new(), rows, words: Vec::new() });
    }
    tables
}

/// A table of records: few stand side by side, with a quantity in each row; many stand below each other.
fn of_records(key: &str, records: &[Value]) -> Table {
    let flat: Vec<Vec<(String, Value)>> = records.iter().map(|record| flat(record, "")).collect();
    let mut paths: Vec<&String> = Vec::new();
    for (path, _) in flat.iter().flatten() {
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    // quantities that no record has are left out
    let said = |path: &str, value: &Value| !(value.is_null() || path.starts_with("interface.") && *value == 0);
    paths.retain(|path| flat.iter().flatten().any(|(other, value)| other == *path && said(path, value)));
    // those of the first unknown are there under its name, too
    if paths.iter().any(|path| of_unknown(path).is_some()) {
        paths.retain(|path| !["conserved.mass", "conserved.drift"].contains(&path.as_str()));
    }
    let at = |record: &[(String, Value)], path: &String| {
        record.iter().find(|(other, _)| other == path).map_or("–".into(), |(_, value)| shown(value))
    };
    let words = meanings(paths.iter().map(|path| path.as_str()));
    let (head, rows) = if records.len() > MANY {
        let row = |record: &Vec<(String, Value)>| paths.iter().map(|path| at(record, path)).collect::<Vec<_>>();
        let mut rows: Vec<Vec<String>> = flat.iter().take(SHOWN).map(row).collect();
        // of very many rows the first and the last are shown
        let rest = &flat[rows.len()..];
        if rest.len() > SHOWN {
            rows.push(paths.iter().map(|_| "…".into()).collect());
        }
        rows.extend(rest[rest.len().saturating_sub(SHOWN)..].iter().map(row));
        (paths.iter().map(|path| name(path)).collect(), rows)
    } else {
        let line =
            |path: &&String| [name(path)].into_iter().chain(flat.iter().map(|record| at(record, path))).collect();
        let mut lines: Vec<Vec<String>> = paths.iter().map(line).collect();
        if lines.is_empty() { (Vec::new(), lines) } else { (lines.remove(0), lines) }
    };
    Table { title: title(key), head, rows, words }
}

/// Seconds of the parts of a run, longest first.
pub fn seconds(summary: &Map<String, Value>) -> (Option<String>, Vec<Part>) {
    let Some(Value::Object(seconds)) = summary.get("seconds") else { return (None, Vec::new()) };
    let wall = seconds.get("wall").and_then(Value::as_f64).unwrap_or(0.0);
    let mut parts: Vec<(String, f64)> = (seconds.iter())
        .filter(|(key, _)| !["wall", "cpu"].contains(&key.as_str()))
        .filter_map(|(key, value)| Some((key.replace('_', " "), value.as_f64()?)))
        .filter(|(_, seconds)| *seconds > 0.0)
        .collect();
    let rest = wall - parts.iter().map(|(_, seconds)| seconds).sum::<f64>();
    if rest > 0.01 * wall {
        parts.push(("other".into(), rest));
    }
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    let part = |(name, seconds): (String, f64)| Part {
        name,
        seconds: format!("{seconds:.3}"),
        percent: (100.0 * seconds / wall).clamp(0.0, 100.0),
    };
    ((wall > 0.0).then(|| format!("{wall:.3}")), parts.into_iter().map(part).collect())
}

/// Values with the path to each.
fn flat(value: &Value, path: &str) -> Vec<(String, Value)> {
    match value {
        Value::Object(object) => (object.iter())
            .flat_map(|(key, value)| flat(value, &if path.is_empty() { key.clone() } else { format!("{path}.{key}") }))
            .collect(),
        _ => vec![(path.to_string(), value.clone())],
    }
}

/// The unknown whose integral a path is of, and the path that this quantity has without it.
fn of_unknown(path: &str) -> Option<(&str, &'static str)> {
    let inner = path.strip_prefix("conserved.")?;
    let mass = inner.strip_suffix(".mass").map(|unknown| (unknown, "conserved.mass"));
    mass.or_else(|| inner.strip_suffix(".drift").map(|unknown| (unknown, "conserved.drift")))
}

fn known(path: &str) -> Option<&'static (&'static str, &'static str, &'static str)> {
    let path = of_unknown(path).map_or(path, |(_, plain)| plain);
    let ends = |(key, ..): &&(&str, &str, &str)| path == *key || path.ends_with(&format!(".{key}"));
    NAMES.iter().filter(ends).max_by_key(|(key, ..)| key.len())
}

pub fn name(path: &str) -> String {
    match of_unknown(path) {
        Some((unknown, "conserved.mass")) => return format!("integral of {unknown}"),
        Some((unknown, _)) => return format!("change of the integral of {unknown}"),
        None => {}
    }
    let last = path.rsplit('.').next().unwrap_or(path);
    known(path).map_or_else(|| last.replace('_', " "), |(_, name, _)| (*name).into())
}

fn meanings<'a>(paths: impl Iterator<Item = &'a str>) -> Vec<[&'static str; 2]> {
    let told = paths.filter_map(known).filter(|(_, _, words)| !words.is_empty());
    let mut meanings: Vec<_> = told.map(|(_, name, words)| [*name, *words]).collect();
    meanings.dedup();
    meanings
}

fn title(key: &str) -> String {
    let words = match key {
        "reports" => "Figures at the report times",
        "rate" => "Contraction of the error",
        "error" => "Error",
        "stencil" => "Stencils of the Laplacian",
        other => other,
    };
    let words = words.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}

fn shown(value: &Value) -> String {
    match value {
        Value::Null => "–".into(),
        Value::Bool(yes) => if *yes { "yes" } else { "no" }.into(),
        Value::Number(n) if n.is_f64() => number(n.as_f64().unwrap_or(0.0)),
        Value::Number(n) => n.to_string(),
        Value::String(text) => text.clone(),
        Value::Array(values) if values.len() <= 4 => values.iter().map(shown).collect::<Vec<_>>().join(" … "),
        Value::Array(values) => format!("{} values", values.len()),
        Value::Object(_) => String::new(),
    }
}

/// Five digits, as a power of ten where it is very large or small.
fn number(x: f64) -> String {
    let digits = if x == 0.0 {
        "0".into()
    } else if (1e-3..1e6).contains(&x.abs()) {
        let decimals = (4 - x.abs().log10().floor() as i32).max(0) as usize;
        let text = format!("{x:.decimals$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
    } else {
        format!("{x:.3e}")
    };
    digits.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_five_digits() {
        for (x, text) in [(1.25, "1.25"), (0.75, "0.75"), (123456.0, "123456"), (-2.13e-5, "−2.130e−5"), (0.0, "0")]
        {
            assert_eq!(number(x), text);
        }
        assert_eq!(number(0.0308123), "0.030812");
    }

    #[test]
    fn a_name_is_found_by_the_longest_end_of_its_path() {
        assert_eq!(name("front.error_linf"), "largest error of the front");
        assert_eq!(name("interface.contraction.observed"), "contraction, observed");
        assert_eq!(name("work.newton_iterations"), "iterations of Newton's method");
        assert_eq!(name("work.rejected_steps"), "rejected steps");
    }

    /// The integrals of unknowns bear their names; of a run that knew that of the first alone there is that.
    #[test]
    fn integrals_are_told_by_the_names_of_their_unknowns() {
        let amount = |mass: f64| serde_json::json!({"mass": mass, "drift": 0.0});
        let old = serde_json::json!({"reports": [{"t": 0.5, "conserved": amount(2.0)}]});
        let table = of(old.as_object().unwrap()).remove(0);
        assert_eq!(table.rows, [["integral of the first unknown", "2"], ["change of the integral", "0"]]);
        let mut conserved = amount(2.0);
        conserved["u"] = amount(2.0);
        conserved["unknown mass"] = amount(3.0);
        let new = serde_json::json!({"reports": [{"t": 0.5, "conserved": conserved}]});
        let rows = of(new.as_object().unwrap()).remove(0).rows;
        assert_eq!(rows.len(), 4, "{rows:?}");
        assert!(rows.contains(&vec!["integral of u".to_string(), "2".into()]), "{rows:?}");
        assert!(rows.contains(&vec!["integral of unknown mass".to_string(), "3".into()]), "{rows:?}");
    }

    /// Three reports stand side by side, a hundred iterations below each other; a record may lack a value.
    #[test]
    fn few_records_are_columns_and_many_are_rows() {
        let summary = serde_json::json!({"reports": [{"t": 0.5, "error": {"l2": 1e-3}}, {"t": 1.0}]});
        let table = of(summary.as_object().unwrap()).remove(0);
        assert_eq!(table.head, ["t", "0.5", "1"]);
        assert_eq!(table.rows, [["root mean square error", "0.001", "–"]]);
        let iterations: Vec<Value> = (0..100).map(|n| serde_json::json!({"n": n, "increment": 0.5})).collect();
        let summary = serde_json::json!({"iterations": iterations});
        let table = of(summary.as_object().unwrap()).remove(0);
        assert_eq!((table.head.len(), table.rows.len()), (2, 100));
        let iterations: Vec<Value> = (0..9000).map(|n| serde_json::json!({"n": n})).collect();
        let summary = serde_json::json!({"iterations": iterations});
        let table = of(summary.as_object().unwrap()).remove(0);
        let shown = |k: usize| table.rows[k][0].as_str();
        assert_eq!([shown(0), shown(249), shown(250), shown(251), shown(500)], ["0", "249", "…", "8750", "8999"]);
        assert_eq!(table.rows.len(), 501);
    }
}
