use super::picture::{Canvas, Picture};
use super::sheet::{LONGER, Sheet, colour};
use crate::numerics::ends;
use std::fmt::Write;

/// Draws curves over common x, coloured by a parameter such as the time, within the box from `lower` to `upper`.
///
/// Each curve is a parameter with one y for each x.
pub fn draw_curves(
    title: &str,
    parameter: &str,
    x: &[f64],
    curves: &[(f64, Vec<f64>)],
    lower: [f64; 2],
    upper: [f64; 2],
) -> Picture {
    let extent = [upper[0] - lower[0], upper[1] - lower[1]];
    // heights change little beside the width of a box: both axes are drawn to a size of their own
    let sheet = Sheet { lower, extent, size: [LONGER, 0.6 * LONGER] };
    let mut s = sheet.begin(title);
    let [first, last] = ends(curves.iter().map(|(t, _)| *t));
    for (t, y) in curves {
        let points = x.iter().zip(y).map(|(x, y)| {
            let [x, y] = sheet.place([*x, *y]);
            format!("{x:.2},{y:.2}")
        });
        let _ = writeln!(
            s,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>",
            points.collect::<Vec<_>>().join(" "),
            colour((t - first) / (last - first))
        );
    }
    sheet.axes(&mut s, &["x", "y"]);
    sheet.colour_bar(&mut s, parameter, [first, last]);
    s.push_str("</svg>\n");
    Picture::of(&s, &mut Canvas::default())
}
