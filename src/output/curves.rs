use super::picture::{
    BAR, BOTTOM, Canvas, LEFT, LONGER, Picture, RIGHT, SHORTER_AT_LEAST, TOP, axes, colour, colour_bar, heading,
};
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
    let (width, height) = (LONGER, (0.6 * LONGER).max(SHORTER_AT_LEAST));
    let (w, h) = (LEFT + width + RIGHT, TOP + height + BOTTOM);
    let mut s = String::new();
    let _ = writeln!(
        s,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w:.0} {h:.0}\" width=\"{w:.0}\" height=\"{h:.0}\" \
         font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\" font-size=\"13\" fill=\"#222\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>"
    );
    heading(&mut s, title, width);
    let ends = curves.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (t, _)| (l.min(*t), h.max(*t)));
    for (t, y) in curves {
        let points = x.iter().zip(y).map(|(x, y)| {
            let px = LEFT + (x - lower[0]) / extent[0] * width;
            let py = TOP + height - (y - lower[1]) / extent[1] * height;
            format!("{px:.2},{py:.2}")
        });
        let _ = writeln!(
            s,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>",
            points.collect::<Vec<_>>().join(" "),
            colour((t - ends.0) / (ends.1 - ends.0))
        );
    }
    axes(&mut s, lower, extent, [width, height], &["x", "y"]);
    colour_bar(&mut s, parameter, ends.0, ends.1, LEFT + width + BAR, height);
    s.push_str("</svg>\n");
    Picture::of(&s, &mut Canvas::default())
}
