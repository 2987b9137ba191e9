//! A figure drawn by `plotters`.

use super::figure::{COLOURS, Curve, Figure, Scale};
use super::picture::FONT;
use super::ticks::{Ticks, log_marks, short};
use plotters::coord::combinators::{BindKeyPoints, LogCoord};
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};
use std::error::Error;
use std::fmt::Write;

/// Width and height of a figure, in pixels.
const SIZE: (u32, u32) = (620, 430);
/// Parts of a pixel in which everything is placed: the drawing library knows whole numbers only.
const FINE: u32 = 8;
/// Number of letters of a title beyond which it is drawn smaller.
const LETTERS: f64 = 64.0;
/// Number of marks of a curve beyond which they are drawn smaller.
const MANY: usize = 40;

/// An axis of a chart.
trait Axis: Ranged<ValueType = f64> + ValueFormatter<f64> + 'static {}

impl<T: Ranged<ValueType = f64> + ValueFormatter<f64> + 'static> Axis for T {}

type Chart<'a, X, Y> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<X, Y>>;

/// A figure as SVG.
pub(super) fn svg(figure: &Figure) -> String {
    let mut svg = String::new();
    figure.plot(&mut svg).expect("drawing into memory cannot fail");
    // lines of the grid are sharp
    let svg = with_opacity_of_paint(&svg).replace("<line ", "<line shape-rendering=\"crispEdges\" ");
    // shown at its size, in units that are finer
    let size = |fine: u32| format!("width=\"{}\" height=\"{}\"", SIZE.0 * fine, SIZE.1 * fine);
    svg.replacen(&size(FINE), &size(1), 1)
}

fn font(size: u32) -> FontDesc<'static> {
    ("DejaVu Sans", size * FINE).into_font()
}

impl Figure {
    fn plot(&self, svg: &mut String) -> Result<(), Box<dyn Error>> {
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

    fn chart<X: Axis, Y: Axis>(&self, svg: &mut String, x: X, y: Y) -> Result<(), Box<dyn Error>> {
        // a font that is registered twice stays the same
        let _ = register_font("DejaVu Sans", FontStyle::Normal, FONT);
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
        self.draw_axes(&mut chart)?;
        for (curve, colour) in self.curves.iter().zip(COLOURS.into_iter().cycle()) {
            self.draw_curve(&mut chart, curve, colour)?;
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

    /// Draws axes, their names and labels, and the grid.
    fn draw_axes<X: Axis, Y: Axis>(&self, chart: &mut Chart<'_, X, Y>) -> Result<(), Box<dyn Error>> {
        let ticks = [0, 1].map(|d| {
            let [low, high] = self.ends(d);
            (self.scales[d] == Scale::Linear).then(|| Ticks::between(low, high))
        });
        let names =
            [0, 1].map(|d| ticks[d].as_ref().map_or(self.labels[d].clone(), |ticks| ticks.named(&self.labels[d])));
        let label = |value: f64, d: usize| ticks[d].as_ref().map_or_else(|| short(value), |ticks| ticks.label(value));
        let light = |d: usize| usize::from(ticks[d].is_none());
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
        Ok(())
    }

    /// Draws the line of a curve, its marks, and its row of the legend.
    fn draw_curve<X: Axis, Y: Axis>(
        &self,
        chart: &mut Chart<'_, X, Y>,
        curve: &Curve,
        colour: RGBColor,
    ) -> Result<(), Box<dyn Error>> {
        let shown = |points: &[[f64; 2]]| -> Vec<(f64, f64)> {
            points.iter().filter(|p| self.shown(p)).map(|p| (p[0], p[1])).collect()
        };
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
            let (measured, open) = (shown(&curve.points), shown(&curve.extrapolated));
            let size = FINE * if measured.len() > MANY { 2 } else { 4 };
            chart.draw_series(measured.into_iter().map(|p| Circle::new(p, size, colour.filled())))?;
            chart.draw_series(open.into_iter().map(|p| Circle::new(p, 5 * FINE, colour.stroke_width(2 * FINE))))?;
        }
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
