//! The paper around a picture or a plot: its title, a frame with axes, a bar of colours.

use super::ticks::Ticks;
use std::fmt::Write;

/// Longer edge of the box, in units of the drawing.
pub(super) const LONGER: f64 = 640.0;
/// The box of a long and narrow domain is stretched to this width, in units of the drawing.
pub(super) const SHORTER_AT_LEAST: f64 = 160.0;
/// Room beside the frame, in units of the drawing: for labels and title, and on the right for the bar of colours.
pub(super) const LEFT: f64 = 76.0;
pub(super) const TOP: f64 = 48.0;
const RIGHT: f64 = 116.0;
const BOTTOM: f64 = 64.0;
/// From the box to the bar of colours, in units of the drawing.
const BAR: f64 = 24.0;
/// Number of stripes of one colour in the bar.
const BANDS: usize = 64;
/// Width of a letter, as a share of the size of its font.
const WIDE: f64 = 0.64;

/// The frame around a picture or a plot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// Its width and height in units of the drawing.
    pub size: [f64; 2],
    /// Room to the right of it, in units of the drawing.
    pub right: f64,
}

impl Frame {
    /// The beginning of an SVG document: white paper with a title.
    pub fn begin(&self, title: &str) -> String {
        let [width, height] = self.size;
        let (w, h) = (LEFT + width + self.right, TOP + height + BOTTOM);
        let mut s = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w:.0} {h:.0}\" width=\"{w:.0}\" \
             height=\"{h:.0}\" font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\" font-size=\"13\" \
             fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
        );
        heading(&mut s, title, width, w);
        s
    }

    /// Adds the frame, its marks, each a share of the length of its axis and a label, and the names of both axes.
    pub fn axes(&self, s: &mut String, marks: &[Vec<(f64, String)>; 2], names: &[String; 2]) {
        let [width, height] = self.size;
        let bottom = TOP + height;
        let _ = writeln!(
            s,
            "<g stroke=\"#222\" fill=\"none\"><rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{width:.1}\" \
             height=\"{height:.1}\"/></g>"
        );
        for (share, label) in &marks[0] {
            let x = LEFT + share * width;
            let _ = writeln!(
                s,
                "<path d=\"M{x:.1} {bottom:.1}v5\" stroke=\"#222\"/><text x=\"{x:.1}\" y=\"{:.1}\" \
                 text-anchor=\"middle\">{label}</text>",
                bottom + 20.0
            );
        }
        for (share, label) in &marks[1] {
            let y = bottom - share * height;
            let _ = writeln!(
                s,
                "<path d=\"M{LEFT} {y:.1}h-5\" stroke=\"#222\"/><text x=\"{:.1}\" y=\"{:.1}\" \
                 text-anchor=\"end\">{label}</text>",
                LEFT - 9.0,
                y + 4.5
            );
        }
        let [along, up] = [0, 1].map(|d| escape(&names[d]));
        let (x, y) = (LEFT + 0.5 * width, TOP + 0.5 * height);
        let below = bottom + 44.0;
        let _ =
            writeln!(s, "<text x=\"{x:.1}\" y=\"{below:.1}\" text-anchor=\"middle\" font-size=\"14\">{along}</text>");
        let beside = y + 5.0;
        let turned = if up.len() == 1 { String::new() } else { format!(" transform=\"rotate(-90 20 {beside:.1})\"") };
        let _ =
            writeln!(s, "<text x=\"20\" y=\"{beside:.1}\" text-anchor=\"middle\" font-size=\"14\"{turned}>{up}</text>");
    }
}

/// A box of the plane, and its size on the paper.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sheet {
    /// Its corner of the smallest coordinates.
    pub lower: [f64; 2],
    /// Its width and height in the plane.
    pub extent: [f64; 2],
    /// Its width and height in units of the drawing.
    pub size: [f64; 2],
}

impl Sheet {
    fn frame(&self) -> Frame {
        Frame { size: self.size, right: RIGHT }
    }

    /// The beginning of an SVG document: white paper with a title.
    pub fn begin(&self, title: &str) -> String {
        self.frame().begin(title)
    }

    /// Where a point of the plane is on the paper.
    pub fn place(&self, p: [f64; 2]) -> [f64; 2] {
        let Self { lower, extent, size: [width, height] } = *self;
        [LEFT + (p[0] - lower[0]) / extent[0] * width, TOP + height - (p[1] - lower[1]) / extent[1] * height]
    }

    /// The left edge of the bar of colours.
    pub fn bar(&self) -> f64 {
        LEFT + self.size[0] + BAR
    }

    /// Adds the box and its axes.
    pub fn axes(&self, s: &mut String, names: &[impl AsRef<str>]) {
        let Self { lower, extent, .. } = *self;
        let ticks = [0, 1].map(|d| Ticks::between(lower[d], lower[d] + extent[d]));
        let named = [0, 1].map(|d| ticks[d].named(names[d].as_ref()));
        let [along, up] = ticks;
        let marks = [(along, 0), (up, 1)].map(|(ticks, d)| {
            ticks.marks.into_iter().map(|(value, label)| ((value - lower[d]) / extent[d], label)).collect()
        });
        self.frame().axes(s, &marks, &named);
    }

    /// Adds the bar of colours for values from `low` to `high`, named after the unknown.
    pub fn colour_bar(&self, s: &mut String, unknown: &str, [low, high]: [f64; 2]) {
        let (x, height) = (self.bar(), self.size[1]);
        let band = height / BANDS as f64;
        for k in 0..BANDS {
            let y = TOP + height - (k + 1) as f64 * band;
            let fill = colour((k as f64 + 0.5) / BANDS as f64);
            let _ = writeln!(
                s,
                "<rect x=\"{x:.1}\" y=\"{y:.2}\" width=\"16\" height=\"{:.2}\" fill=\"{fill}\"/>",
                band + 0.3
            );
        }
        let _ = writeln!(
            s,
            "<rect x=\"{x:.1}\" y=\"{TOP}\" width=\"16\" height=\"{height:.1}\" fill=\"none\" stroke=\"#222\"/>"
        );
        let ticks = Ticks::between(low, high);
        for (value, label) in &ticks.marks {
            let y = if high > low { TOP + height - (value - low) / (high - low) * height } else { TOP + 0.5 * height };
            let _ = writeln!(
                s,
                "<path d=\"M{:.1} {y:.1}h5\" stroke=\"#222\"/><text x=\"{:.1}\" y=\"{:.1}\">{label}</text>",
                x + 16.0,
                x + 25.0,
                y + 4.5
            );
        }
        // over the bar, or up to the edge of the drawing where it is too wide for that
        let name = ticks.named(unknown);
        let right = x - BAR + RIGHT - 10.0;
        let length = 14.0 * WIDE * name.chars().count() as f64;
        let (place, anchor) = if x + 8.0 + 0.5 * length < right { (x + 8.0, "middle") } else { (right, "end") };
        let _ = writeln!(
            s,
            "<text x=\"{place:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" font-size=\"{:.1}\">{}</text>",
            TOP - 12.0,
            14.0 * ((right - 10.0) / length).min(1.0),
            escape(&name)
        );
    }
}

/// The title, over the box; over the whole drawing where it is too wide for that, and as small as it needs to be; in
/// two lines where that would be too small to read.
fn heading(s: &mut String, title: &str, width: f64, whole: f64) {
    /// Size of the font of a title that fits, in units of the drawing.
    const SIZE: f64 = 15.0;
    /// Size of the font below which a title is divided into two lines, in units of the drawing.
    const LEGIBLE: f64 = 10.0;
    let letters = |line: &str| line.chars().count();
    let fitting = |line: &str| SIZE.min((whole - 20.0) / (WIDE * letters(line) as f64));
    let middle = |(place, _): &(usize, &str)| letters(&title[..*place]).abs_diff(letters(title) / 2);
    let (head, tail) = match title.match_indices([' ', '-', '_', '.']).min_by_key(middle) {
        Some((place, _)) if fitting(title) < LEGIBLE => title.split_at(place + 1),
        _ => (title, ""),
    };
    let lines: &[(&str, f64)] = if tail.is_empty() { &[(head, 20.0)] } else { &[(head, 12.0), (tail, 24.0)] };
    let largest = if tail.is_empty() { SIZE } else { LEGIBLE };
    for (line, y) in lines {
        let size = fitting(line).min(largest);
        let centre = if size * WIDE * letters(line) as f64 <= width { LEFT + 0.5 * width } else { 0.5 * whole };
        let _ = writeln!(
            s,
            "<text x=\"{centre:.1}\" y=\"{y}\" text-anchor=\"middle\" font-size=\"{size:.1}\">{}</text>",
            escape(line.trim())
        );
    }
}

/// The colour of a share of the colour map; that of its middle for NaN.
pub(super) fn colour(fraction: f64) -> String {
    let c = colorous::VIRIDIS.eval_continuous(if fraction.is_finite() { fraction.clamp(0.0, 1.0) } else { 0.5 });
    format!("#{c:x}")
}

pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
