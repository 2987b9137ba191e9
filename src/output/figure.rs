use super::picture::{Canvas, FONT, Picture, Ticks};
use plotters::coord::combinators::{BindKeyPoints, LogCoord};
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};
use std::fmt::Write;

/// Curves over linear or logarithmic axes, drawn as SVG and PNG.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// Of the axis along the bottom, and of the one along the side.
    pub labels: [String; 2],
    /// Of the same axes.
    pub scales: [Scale; 2],
    /// The curves.
    pub curves: Vec<Curve>,
    /// Points that have room in any case, also where no curve goes.
    pub room: Vec<[f64; 2]>,
}

/// Of an axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Scale {
    /// Powers of ten; values of 0 or less are left out.
    #[default]
    Logarithmic,
    /// Equal steps.
    Linear,
}

/// One curve of a [`Figure`].
#[derive(Debug, Clone, Default)]
pub struct Curve {
    /// What the legend says.
    pub name: String,
    /// Measured points, as filled marks.
    pub points: Vec<[f64; 2]>,
    /// Points that were not measured, as open marks; lines through all of them, from left to right.
    pub extrapolated: Vec<[f64; 2]>,
    /// A line alone, without marks, in the order of the points.
    pub plain: bool,
    /// Thin and grey: what is there beside what is meant.
    pub faint: bool,
    /// Marks without a line.
    pub scattered: bool,
}

/// Colours that are told apart by everybody: Okabe and Ito (2008).
pub(crate) const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];
const SIZE: (u32, u32) = (620, 430);
/// Parts of a pixel: the drawing library places by whole numbers.
const FINE: u32 = 8;
/// Narrow stretches along the bottom of a plot.
const STRETCHES: f64 = 150.0;
/// More marks than this are small.
const MANY: usize = 40;
/// Size of the plot itself, of a row of the legend, and of what is beside its words, in pixels; a letter is so wide at
/// most.
const PLOT: [f64; 2] = [508.0, 320.0];
const ROW: f64 = 22.0;
const BESIDE: f64 = 64.0;
const LETTER: f64 = 7.5;
/// Letters of a title at its full size.
const LETTERS: f64 = 64.0;
/// Places on a line between two points that are looked at.
const BETWEEN: usize = 16;
/// Room above and below a curve, as a share.
const EDGE: f64 = 0.02;
/// Room around the points, as a factor.
const ROOM: f64 = 1.05;
/// Figures that round numbers begin with, and what may be rounding.
const ROUND: [f64; 3] = [1.0, 2.0, 5.0];
const SLACK: f64 = 1e-9;
/// A logarithmic axis ends at powers of ten where it spans more than this, and at no round numbers where it spans less.
const MANY_POWERS: f64 = 1e4;
const NARROW: f64 = 4.0;
/// Powers with a label, at most.
const MOST_POWERS: i32 = 9;

impl Curve {
    /// As few points as show the same, with their order along the bottom: of each narrow stretch its first and last,
    /// its lowest and its highest.
    pub(crate) fn outlined(mut self) -> Self {
        let ends = [self.points.first(), self.points.last()].map(|end| end.map_or(0.0, |p| p[0]));
        let stretch = |p: &[f64; 2]| ((p[0] - ends[0]) / (ends[1] - ends[0]) * STRETCHES).floor();
        if self.points.len() as f64 <= 2.0 * STRETCHES {
            return self;
        }
        let outline = |part: &[[f64; 2]]| {
            let places = || (0..part.len()).map(|k| (k, part[k][1]));
            let low = places().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(k, _)| k);
            let high = places().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(k, _)| k);
            let mut kept = vec![0, low, high, part.len() - 1];
            kept.sort_unstable();
            kept.dedup();
            kept.into_iter().map(|k| part[k]).collect::<Vec<_>>()
        };
        self.points = self.points.chunk_by(|a, b| stretch(a) == stretch(b)).flat_map(outline).collect();
        self
    }
}

impl Figure {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        Picture::of(&self.svg(), &mut Canvas::default())
    }

    /// Draws it for a page that has the font.
    pub fn svg(&self) -> String {
        let mut svg = String::new();
        self.plot(&mut svg).expect("drawing into memory cannot fail");
        // lines of the grid are sharp
        let svg = with_opacity_of_paint(&svg).replace("<line ", "<line shape-rendering=\"crispEdges\" ");
        // shown at its size, in units that are finer
        let size = |fine: u32| format!("width=\"{}\" height=\"{}\"", SIZE.0 * fine, SIZE.1 * fine);
        svg.replacen(&size(FINE), &size(1), 1)
    }

    fn plot(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        use Scale::{Linear, Logarithmic};
        let range = |d: usize| self.ends(d)[0]..self.ends(d)[1];
        let plain = |d: usize| RangedCoordf64::from(range(d));
        let log = |d: usize| {
            let [bold, light] = log_marks(self.ends(d));
            LogCoord::from(range(d).log_scale()).with_key_points(bold).with_light_points(light)
        };
        match self.scales {
            [Logarithmic, Logarithmic] => self.chart(svg, log(0), log(1)),
            [Linear, Logarithmic] => self.chart(svg, plain(0), log(1)),
            [Logarithmic, Linear] => self.chart(svg, log(0), plain(1)),
            [Linear, Linear] => self.chart(svg, plain(0), plain(1)),
        }
    }

    /// Whether a point has a place.
    fn shown(&self, point: &&[f64; 2]) -> bool {
        let placed = |d: usize| point[d].is_finite() && (self.scales[d] == Scale::Linear || point[d] > 0.0);
        placed(0) && placed(1)
    }

    /// From where to where an axis goes: around the points, and from mark to mark where it is logarithmic; further up
    /// where a legend would find no free corner.
    fn ends(&self, d: usize) -> [f64; 2] {
        let [low, high] = self.around(d);
        if d == 0 || !self.is_named() || self.free_corner().is_some() {
            return [low, high];
        }
        let room = self.legend()[1] / (1.0 - self.legend()[1]);
        match self.scales[d] {
            Scale::Linear => [low, high + room * (high - low)],
            Scale::Logarithmic => [low, high * (high / low).powf(room)],
        }
    }

    fn around(&self, d: usize) -> [f64; 2] {
        let points =
            self.curves.iter().flat_map(|curve| curve.points.iter().chain(&curve.extrapolated)).chain(&self.room);
        let around = |[low, high]: [f64; 2], p: &[f64; 2]| [low.min(p[d]), high.max(p[d])];
        let [low, high] = points.filter(|p| self.shown(p)).fold([f64::INFINITY, f64::NEG_INFINITY], around);
        match self.scales[d] {
            _ if low > high => [1.0, 10.0],
            Scale::Logarithmic => {
                let [low, high] = [low / ROOM, high * ROOM];
                // powers of ten where there are many, else what begins with 1, 2 or 5, and neither in a narrow range
                let round = match high / low {
                    wide if wide > MANY_POWERS => [1.0].as_slice(),
                    wide if wide > NARROW => &ROUND,
                    _ => return [low, high],
                };
                // a little more, so that both ends are marked
                [below(low, round) * (1.0 - SLACK), above(high, round) * (1.0 + SLACK)]
            }
            Scale::Linear if low == high => [low - 0.5, high + 0.5],
            // a curve does not lie on the frame
            Scale::Linear if d == 1 => [low - EDGE * (high - low), high + EDGE * (high - low)],
            Scale::Linear => [low, high],
        }
    }

    /// What a curve goes through, as it is drawn.
    fn line(&self, curve: &Curve) -> Vec<[f64; 2]> {
        let mut line: Vec<[f64; 2]> =
            curve.points.iter().chain(&curve.extrapolated).filter(|p| self.shown(p)).copied().collect();
        if !curve.plain {
            line.sort_by(|a, b| a[0].total_cmp(&b[0]));
        }
        line
    }

    /// Whether there is a legend.
    fn is_named(&self) -> bool {
        self.curves.iter().any(|curve| !curve.name.is_empty())
    }

    /// Width and height of the legend, as shares of the plot.
    fn legend(&self) -> [f64; 2] {
        let names = || self.curves.iter().map(|curve| curve.name.chars().count()).filter(|letters| *letters > 0);
        let size = [BESIDE + LETTER * names().max().unwrap_or(0) as f64, ROW * (names().count() + 1) as f64];
        [0, 1].map(|d| (size[d] / PLOT[d]).min(0.5))
    }

    /// A corner of the plot where no curve would lie under the legend.
    fn free_corner(&self) -> Option<SeriesLabelPosition> {
        let on = |x: f64, d: usize| if self.scales[d] == Scale::Linear { x } else { x.log10() };
        let ends = [0, 1].map(|d| self.around(d).map(|end| on(end, d)));
        let place = |p: &[f64; 2]| [0, 1].map(|d| (on(p[d], d) - ends[d][0]) / (ends[d][1] - ends[d][0]));
        let lines: Vec<Vec<[f64; 2]>> =
            self.curves.iter().map(|curve| self.line(curve).iter().map(place).collect()).collect();
        let legend = self.legend();
        let under =
            |p: [f64; 2], corner: [bool; 2]| (0..2).all(|d| if corner[d] { 1.0 - p[d] } else { p[d] } < legend[d]);
        let crossed = |line: &[[f64; 2]], corner: [bool; 2]| {
            let between = |w: &[[f64; 2]]| {
                (0..=BETWEEN).any(|k| {
                    let s = k as f64 / BETWEEN as f64;
                    under([0, 1].map(|d| w[0][d] + s * (w[1][d] - w[0][d])), corner)
                })
            };
            line.first().is_some_and(|p| under(*p, corner)) || line.windows(2).any(between)
        };
        let corners = [
            ([true, true], SeriesLabelPosition::UpperRight),
            ([false, false], SeriesLabelPosition::LowerLeft),
            ([true, false], SeriesLabelPosition::LowerRight),
            ([false, true], SeriesLabelPosition::UpperLeft),
        ];
        let free = |corner: [bool; 2]| !lines.iter().any(|line| crossed(line, corner));
        corners.into_iter().find(|(corner, _)| free(*corner)).map(|(_, position)| position)
    }

    fn chart<X, Y>(&self, svg: &mut String, x: X, y: Y) -> Result<(), Box<dyn std::error::Error>>
    where
        X: Ranged<ValueType = f64> + ValueFormatter<f64> + 'static,
        Y: Ranged<ValueType = f64> + ValueFormatter<f64> + 'static,
    {
        // a font that is registered twice stays the same
        let _ = register_font("DejaVu Sans", FontStyle::Normal, FONT);
        let font = |size: u32| ("DejaVu Sans", size * FINE).into_font();
        let area = SVGBackend::with_string(svg, (SIZE.0 * FINE, SIZE.1 * FINE)).into_drawing_area();
        area.fill(&WHITE)?;
        // room above the title, and between it and the plot; a long one is smaller
        let inner = area.margin(8 * FINE as i32, 0, 0, 0);
        let share = (LETTERS / self.title.chars().count() as f64).min(1.0);
        let heading = ("DejaVu Sans", (17.0 * FINE as f64 * share) as u32).into_font();
        let below = inner.titled(&self.title, heading)?.margin(4 * FINE as i32, 0, 0, 0);
        let mut chart = ChartBuilder::on(&below)
            .margin(14 * FINE)
            .margin_right(24 * FINE)
            .x_label_area_size(46 * FINE)
            .y_label_area_size(74 * FINE)
            .build_cartesian_2d(x, y)?;
        let plain =
            [0, 1].map(|d| (self.scales[d] == Scale::Linear).then(|| Ticks::between(self.ends(d)[0], self.ends(d)[1])));
        let names =
            [0, 1].map(|d| plain[d].as_ref().map_or(self.labels[d].clone(), |ticks| ticks.named(&self.labels[d])));
        let label = |value: f64, d: usize| plain[d].as_ref().map_or_else(|| short(value), |ticks| ticks.label(value));
        let light = |d: usize| usize::from(plain[d].is_none());
        chart
            .configure_mesh()
            .x_desc(&names[0])
            .y_desc(&names[1])
            .label_style(font(15))
            .axis_desc_style(font(16))
            .axis_style(BLACK.stroke_width(FINE))
            .set_all_tick_mark_size(5 * FINE)
            .bold_line_style(BLACK.mix(0.15).stroke_width(FINE))
            .light_line_style(BLACK.mix(0.04).stroke_width(FINE))
            .x_max_light_lines(light(0))
            .y_max_light_lines(light(1))
            .x_label_formatter(&|x| label(*x, 0))
            .y_label_formatter(&|y| label(*y, 1))
            .draw()?;
        for (curve, colour) in self.curves.iter().zip(COLOURS.iter().cycle()) {
            let measured = || curve.points.iter().filter(|p| self.shown(p)).map(|p| (p[0], p[1]));
            let open = || curve.extrapolated.iter().filter(|p| self.shown(p)).map(|p| (p[0], p[1]));
            let line = self.line(curve).into_iter().filter(|_| !curve.scattered).map(|[x, y]| (x, y));
            let style = if curve.faint { BLACK.mix(0.25).stroke_width(FINE) } else { colour.stroke_width(2 * FINE) };
            let drawn = chart.draw_series(LineSeries::new(line, style))?;
            if !curve.name.is_empty() {
                let (fine, scattered) = (FINE as i32, curve.scattered);
                drawn.label(&curve.name).legend(move |(x, y)| match scattered {
                    true => Circle::new((x + 11 * fine, y), 4 * FINE, colour.filled()).into_dyn(),
                    false => PathElement::new([(x, y), (x + 22 * fine, y)], colour.stroke_width(2 * FINE)).into_dyn(),
                });
            }
            if !curve.plain {
                let size = FINE * if measured().count() > MANY { 2 } else { 4 };
                chart.draw_series(measured().map(|p| Circle::new(p, size, colour.filled())))?;
                chart.draw_series(open().map(|p| Circle::new(p, 5 * FINE, colour.stroke_width(2 * FINE))))?;
            }
        }
        if self.is_named() {
            chart
                .configure_series_labels()
                .label_font(font(15))
                .background_style(WHITE.mix(0.9))
                .border_style(BLACK.mix(0.4).stroke_width(FINE))
                .margin(8 * FINE)
                .legend_area_size(30 * FINE)
                .position(self.free_corner().unwrap_or(SeriesLabelPosition::UpperRight))
                .draw()?;
        }
        area.present()?;
        Ok(())
    }
}

/// A drawing in which nothing has both a fill and a stroke, with the opacity of elements as that of their paint: it
/// looks the same, and takes no layer for each of them.
fn with_opacity_of_paint(svg: &str) -> String {
    let mut parts = svg.split(" opacity=\"");
    let mut out = parts.next().unwrap_or_default().to_string();
    for part in parts {
        let (value, rest) = part.split_once('"').unwrap_or((part, ""));
        if value != "1" {
            let _ = write!(out, " fill-opacity=\"{value}\" stroke-opacity=\"{value}\"");
        }
        out.push_str(rest);
    }
    out
}

/// The largest number not above x that begins with one of these figures, which begin with 1.
fn below(x: f64, round: &[f64]) -> f64 {
    let ten = 10_f64.powf((x.log10() + SLACK).floor());
    round.iter().map(|m| m * ten).rfind(|m| *m <= x * (1.0 + SLACK)).unwrap_or(ten)
}

/// The smallest one not below x.
fn above(x: f64, round: &[f64]) -> f64 {
    let ten = 10_f64.powf((x.log10() + SLACK).floor());
    round.iter().chain(&[10.0]).map(|m| m * ten).find(|m| *m >= x * (1.0 - SLACK)).unwrap_or(10.0 * ten)
}

/// Where a logarithmic axis has labels, and where it has lines between them.
fn log_marks([low, high]: [f64; 2]) -> [Vec<f64>; 2] {
    let inside = |v: &f64| (low * (1.0 - SLACK)..=high * (1.0 + SLACK)).contains(v);
    let [first, last] = [low, high].map(|end| end.log10().floor() as i32);
    let decades = (last - first).max(1);
    let beginning = |with: &[f64], every: i32| -> Vec<f64> {
        let powers = (first..=last).filter(|k| k.rem_euclid(every) == 0).map(|k| 10_f64.powi(k));
        powers.flat_map(|ten| with.iter().map(move |m| m * ten)).filter(inside).collect()
    };
    let every = (decades + MOST_POWERS - 1) / MOST_POWERS;
    let all = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
    let between = if every == 1 { beginning(&all, 1) } else { beginning(&[1.0], 1) };
    for bold in [beginning(&[1.0], every), beginning(&ROUND, 1)] {
        if bold.len() >= 3 {
            return [bold, between];
        }
    }
    [Ticks::between(low, high).places().filter(inside).collect(), Vec::new()]
}

/// A number on a logarithmic axis, as 0.001 or as 1e-4.
fn short(x: f64) -> String {
    if (0.00099..1.1e4).contains(&x) {
        return format!("{}", (x * 1e6).round() / 1e6);
    }
    let text = format!("{x:.4e}");
    let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A single spike among ten thousand values is drawn, and a jump stands where it is, also where most values stand
    /// before it.
    #[test]
    fn an_outline_keeps_spikes_and_jumps() {
        let values = (0..10_000).map(|k| [k as f64, if k == 4321 { 50.0 } else { 1.0 }]);
        let curve = Curve { points: values.collect(), ..Curve::default() }.outlined();
        assert!(curve.points.len() <= 4 * 151 && curve.points.contains(&[4321.0, 50.0]));
        assert!(curve.points.is_sorted_by(|a, b| a[0] <= b[0]));
        // few values up to 0.9, and thousands from there on
        let jump = (0..90).map(|k| [k as f64 / 100.0, 1.0]).chain((0..5000).map(|k| [0.9 + k as f64 * 2e-5, 7.0]));
        let curve = Curve { points: jump.collect(), ..Curve::default() }.outlined();
        for p in (0..90).map(|k| [k as f64 / 100.0, 1.0]).chain([[0.9, 7.0]]) {
            assert!(curve.points.contains(&p), "{p:?} is lost");
        }
    }

    /// Many powers of ten, few of them, and less than one: each axis has enough labels, no two alike, and ends near its
    /// points.
    #[test]
    fn logarithmic_axes_have_labels_that_differ() {
        for (low, high, ends) in [
            (1e-16, 3e-3, [1e-17, 1e-2]),
            (2e-5, 0.9, [1e-5, 1.0]),
            (1.0, 30.0, [0.5, 50.0]),
            (1.0, 1000.0, [0.5, 2000.0]),
            (0.0072, 0.0077, [0.0072 / 1.05, 0.0077 * 1.05]),
            (1.0, 1.0, [1.0 / 1.05, 1.05]),
            (3e-300, 5e300, [1e-300, 1e301]),
        ] {
            let points = vec![[0.0, low], [1.0, high]];
            let scales = [Scale::Linear, Scale::Logarithmic];
            let figure = Figure { scales, curves: vec![Curve { points, ..Curve::default() }], ..Figure::default() };
            let around = figure.around(1);
            assert!((0..2).all(|k| (around[k] / ends[k] - 1.0).abs() < 1e-6), "{low} to {high}: {around:?}");
            let [bold, light] = log_marks(around);
            let labels: std::collections::BTreeSet<String> = bold.iter().map(|v| short(*v)).collect();
            assert!(labels.len() == bold.len() && (3..=10).contains(&bold.len()), "{low} to {high}: {bold:?}");
            assert!(bold.iter().chain(&light).all(|v| around[0] <= *v && *v <= around[1]), "{bold:?} {light:?}");
        }
    }

    /// Curves through all four corners: the axis goes further up, and the legend stands above them.
    #[test]
    fn a_legend_finds_room() {
        let curve = |name: &str, points: Vec<[f64; 2]>| Curve { name: name.into(), points, ..Curve::default() };
        let crossed = |scale: Scale| Figure {
            scales: [Scale::Linear, scale],
            curves: vec![curve("up", vec![[0.0, 1.1], [1.0, 9.0]]), curve("down", vec![[0.0, 9.0], [1.0, 1.1]])],
            ..Figure::default()
        };
        for scale in [Scale::Linear, Scale::Logarithmic] {
            let mut figure = crossed(scale);
            assert!(figure.free_corner().is_none());
            let [height, upper] = [figure.legend()[1], figure.ends(1)[1]];
            let [low, high] = figure.around(1).map(|end| if scale == Scale::Linear { end } else { end.log10() });
            let upper = if scale == Scale::Linear { upper } else { upper.log10() };
            assert!(((high - low) / (upper - low) - (1.0 - height)).abs() < 1e-12, "{low} {high} {upper}");
            // one of them alone leaves two corners
            figure.curves.pop();
            assert!(matches!(figure.free_corner(), Some(SeriesLabelPosition::LowerRight)));
            assert_eq!(figure.ends(1), figure.around(1));
        }
    }
}
