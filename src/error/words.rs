//! Parts of messages.

/// Items in parentheses.
pub(super) fn tuple(items: impl IntoIterator<Item = impl std::fmt::Display>) -> String {
    format!("({})", items.into_iter().map(|item| item.to_string()).collect::<Vec<_>>().join(", "))
}

/// Coordinates, one for each axis, with the names of the axes.
pub(super) fn place(x: &[f64]) -> String {
    let named = ["x", "y", "z"].into_iter().zip(x).map(|(name, x)| format!("{name} = {}", short(*x)));
    named.collect::<Vec<_>>().join(", ")
}

/// Indices of a node or a cell, in parentheses where there are several.
pub(super) fn indices(indices: &[usize]) -> String {
    match indices {
        [index] => index.to_string(),
        _ => tuple(indices),
    }
}

/// A number of iterations.
pub(super) fn counted(iterations: usize) -> String {
    if iterations == 1 { "1 iteration".into() } else { format!("{iterations} iterations") }
}

/// What noise may have to do with a mesh that folded.
pub(super) fn noisy(noise: Option<f64>) -> String {
    noise.map_or(String::new(), |noise| {
        format!(
            "; its interface values had a standard error of {:.1} % of the shortest edge: more walks lower it",
            100.0 * noise
        )
    })
}

/// Values of unknowns, as the end of a message.
pub(super) fn given_as(values: &[(String, f64)]) -> String {
    let values: Vec<String> = values.iter().map(|(name, value)| format!("{name} = {}", short(*value))).collect();
    if values.is_empty() { String::new() } else { format!(", where {}", values.join(", ")) }
}

/// What a density of a line breaks.
pub(crate) fn line_rule(what: &str, value: f64) -> &'static str {
    match what {
        "u_x" => "u jumps there, and no mesh resolves a jump: give it a width, as in tanh((x - c)/w)",
        "M" if value.is_nan() => "it has no value there: mend it, or move the ends of the line",
        "M" if value == f64::INFINITY => "it must be finite: bound it, as in min(M, 1e6), or move the ends of the line",
        "M" if value <= 0.0 => "it must be above 0 on the whole line: add a floor, as in max(M, 1e-6)",
        "M" if value > 1e140 => "it is too large for sums: divide it by its largest value, since only its ratios count",
        "M" => {
            "it must be above 0 by more than 1e-14 of its largest on the line, which is rounding: add a floor, as in \
             max(M, 1e-6) where M is about 1"
        }
        _ => "it must be bounded on the whole line",
    }
}

/// A coordinate in a few characters, whatever its size.
pub(super) fn short(x: f64) -> String {
    if x == 0.0 || (1e-3..1e6).contains(&x.abs()) { format!("{x:.4}") } else { format!("{x:.3e}") }
}
