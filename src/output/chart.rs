//! A figure as SVG.

use super::figure::{COLOURS, Curve, Figure, Scale};
use super::sheet::{Frame, LEFT, TOP, escape};
use super::ticks::{Ticks, log_marks, short};
use std::fmt::Write;

/// Width and height of a plot, without what is around it, in units of the drawing.
pub(super) const PLOT: [f64; 2] = [520.0, 318.0];
/// Room to the right of a plot, in units of the drawing.
const RIGHT: f64 = 24.0;
/// Number of marks of a curve beyond which they are drawn smaller.
const MANY: usize = 40;
/// Height of a row of the legend, in units of the drawing.
pub(super) const ROW: f64 = 22.0;
/// Width of what a legend has beside its words: a piece of each line, and margins; in units of the drawing.
pub(super) const BESIDE: f64 = 64.0;
/// Width of a letter of the legend, in units of the drawing: that of wide ones, so that the words find room.
pub(super) const LETTER: f64 = 7.5;

/// A figure, and where its axes begin and end.
struct Chart<'a> {
    figure: &'a Figure,
    ends: [[f64; 2]; 2],
}

pub(super) fn svg(figure: &Figure) -> String {
    let chart = Chart { figure, ends: [figure.ends(0), figure.ends(1)] };
    let frame = Frame { size: PLOT, right: RIGHT };
    let mut s = frame.begin(&figure.title);
    chart.axes(&mut s, &frame);
    for (curve, colour) in figure.curves.iter().zip(COLOURS.into_iter().cycle()) {
        chart.curve(&mut s, curve, &hex(colour));
    }
    if figure.is_named() {
        chart.legend(&mut s);
    }
    s.push_str("</svg>\n");
    s
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn circle(s: &mut String, [x, y]: [f64; 2], radius: f64, paint: &str) {
    let _ = writeln!(s, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" {paint}/>");
}

impl Chart<'_> {
    /// Where a value is along an axis, as a share of its length.
    fn share(&self, value: f64, d: usize) -> f64 {
        let [low, high] = self.ends[d];
        match self.figure.scales[d] {
            Scale::Linear => (value - low) / (high - low),
            Scale::Logarithmic => (value / low).ln() / (high / low).ln(),
        }
    }

    fn place(&self, p: [f64; 2]) -> [f64; 2] {
        [LEFT + self.share(p[0], 0) * PLOT[0], TOP + (1.0 - self.share(p[1], 1)) * PLOT[1]]
    }

    /// Axes with their names and labels, over the lines of a grid.
    fn axes(&self, s: &mut String, frame: &Frame) {
        let mut names = self.figure.labels.clone();
        let marks = [0, 1].map(|d| {
            let (bold, light, labels) = match self.figure.scales[d] {
                Scale::Linear => {
                    let ticks = Ticks::between(self.ends[d][0], self.ends[d][1]);
                    names[d] = ticks.named(&names[d]);
                    let (places, labels): (Vec<f64>, Vec<String>) = ticks.marks.into_iter().unzip();
                    (places, Vec::new(), labels)
                }
                Scale::Logarithmic => {
                    let [bold, light] = log_marks(self.ends[d]);
                    let labels = bold.iter().map(|value| short(*value)).collect();
                    (bold, light, labels)
                }
            };
            grid(s, d, light.iter().map(|value| self.share(*value, d)), 0.04);
            grid(s, d, bold.iter().map(|value| self.share(*value, d)), 0.15);
            bold.into_iter().map(|value| self.share(value, d)).zip(labels).collect::<Vec<_>>()
        });
        frame.axes(s, &marks, &names);
    }

    /// The line of a curve, and its marks.
    fn curve(&self, s: &mut String, curve: &Curve, colour: &str) {
        let shown = |points: &[[f64; 2]]| -> Vec<[f64; 2]> {
            points.iter().filter(|p| self.figure.shown(p)).map(|p| self.place(*p)).collect()
        };
        if !curve.scattered {
            let points: Vec<String> = self
                .figure
                .line(curve)
                .into_iter()
                .map(|p| {
                    let [x, y] = self.place(p);
                    format!("{x:.2},{y:.2}")
                })
                .collect();
            let (stroke, opacity, width) = if curve.faint { ("#000", 0.25, 1) } else { (colour, 1.0, 2) };
            let _ = writeln!(
                s,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{stroke}\" stroke-opacity=\"{opacity}\" \
                 stroke-width=\"{width}\"/>",
                points.join(" ")
            );
        }
        if curve.plain {
            return;
        }
        let (measured, open) = (shown(&curve.points), shown(&curve.extrapolated));
        let radius = if measured.len() > MANY { 2.0 } else { 4.0 };
        measured.into_iter().for_each(|p| circle(s, p, radius, &format!("fill=\"{colour}\"")));
        let paint = format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"");
        open.into_iter().for_each(|p| circle(s, p, 5.0, &paint));
    }

    /// Names of the curves in a corner, at the top right where none is free.
    fn legend(&self, s: &mut String) {
        /// Room between the legend and the frame, and within the legend, in units of the drawing.
        const MARGIN: f64 = 8.0;
        let [right, upper] = self.figure.free_corner().unwrap_or([true, true]);
        let named: Vec<(&Curve, [u8; 3])> = self
            .figure
            .curves
            .iter()
            .zip(COLOURS.into_iter().cycle())
            .filter(|(curve, _)| !curve.name.is_empty())
            .collect();
        let letters = named.iter().map(|(curve, _)| curve.name.chars().count()).max().unwrap_or(0);
        let size = [BESIDE + LETTER * letters as f64 - 2.0 * MARGIN, ROW * named.len() as f64 + MARGIN];
        let x = if right { LEFT + PLOT[0] - MARGIN - size[0] } else { LEFT + MARGIN };
        let y = if upper { TOP + MARGIN } else { TOP + PLOT[1] - MARGIN - size[1] };
        let _ = writeln!(
            s,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"white\" fill-opacity=\"0.9\" \
             stroke=\"#000\" stroke-opacity=\"0.4\"/>",
            size[0], size[1]
        );
        for (k, (curve, colour)) in named.into_iter().enumerate() {
            let (x, y) = (x + MARGIN, y + 0.5 * MARGIN + ROW * (k as f64 + 0.5));
            match curve.scattered {
                true => circle(s, [x + 11.0, y], 4.0, &format!("fill=\"{}\"", hex(colour))),
                false => {
                    let _ =
                        writeln!(s, "<path d=\"M{x:.1} {y:.1}h22\" stroke=\"{}\" stroke-width=\"2\"/>", hex(colour));
                }
            }
            let _ = writeln!(s, "<text x=\"{:.1}\" y=\"{:.1}\">{}</text>", x + 30.0, y + 4.5, escape(&curve.name));
        }
    }
}

/// Lines across an axis at shares of its length.
fn grid(s: &mut String, d: usize, shares: impl Iterator<Item = f64>, opacity: f64) {
    let [width, height] = PLOT;
    let line = |share: f64| match d {
        0 => format!("M{:.1} {TOP}v{height}", LEFT + share * width),
        _ => format!("M{LEFT} {:.1}h{width}", TOP + (1.0 - share) * height),
    };
    let path: String = shares.map(line).collect();
    if !path.is_empty() {
        let _ = writeln!(
            s,
            "<path d=\"{path}\" fill=\"none\" stroke=\"#000\" stroke-opacity=\"{opacity}\" \
             shape-rendering=\"crispEdges\"/>"
        );
    }
}
