use crate::simulation::{FONT, Picture, png};
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};

/// Curves over logarithmic axes, drawn as SVG and PNG.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// Of the axis along the bottom, and of the one along the side.
    pub labels: [String; 2],
    /// The curves.
    pub curves: Vec<Curve>,
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
}

/// Colours that are told apart by everybody: Okabe and Ito (2008).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];
const SIZE: (u32, u32) = (760, 520);
/// Room around the points, as a factor.
const ROOM: f64 = 1.1;

impl Figure {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        let mut svg = String::new();
        self.plot(&mut svg).expect("drawing into memory cannot fail");
        let png = png(&svg);
        Picture { svg, png }
    }

    fn plot(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        // a font that is registered twice stays the same
        let _ = register_font("DejaVu Sans", FontStyle::Normal, FONT);
        let font = |size: u32| ("DejaVu Sans", size).into_font();
        let points = || self.curves.iter().flat_map(|curve| curve.points.iter().chain(&curve.extrapolated));
        let range = |d: usize| {
            let ends = points().fold([f64::INFINITY, 0.0_f64], |[low, high], p| [low.min(p[d]), high.max(p[d])]);
            (whole(ends[0] / ROOM, f64::floor)..whole(ends[1] * ROOM, f64::ceil)).log_scale()
        };
        let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, font(17))
            .margin(14)
            .x_label_area_size(46)
            .y_label_area_size(74)
            .build_cartesian_2d(range(0), range(1))?;
        chart
            .configure_mesh()
            .x_desc(&self.labels[0])
            .y_desc(&self.labels[1])
            .label_style(font(14))
            .axis_desc_style(font(15))
            .bold_line_style(BLACK.mix(0.15))
            .light_line_style(BLACK.mix(0.04))
            .x_label_formatter(&|x| label(*x))
            .y_label_formatter(&|y| label(*y))
            .draw()?;
        for (curve, colour) in self.curves.iter().zip(COLOURS.iter().cycle()) {
            let mut line: Vec<(f64, f64)> =
                curve.points.iter().chain(&curve.extrapolated).map(|p| (p[0], p[1])).collect();
            line.sort_by(|a, b| a.0.total_cmp(&b.0));
            chart
                .draw_series(LineSeries::new(line, colour.stroke_width(2)))?
                .label(&curve.name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 22, y)], colour.stroke_width(2)));
            chart.draw_series(curve.points.iter().map(|p| Circle::new((p[0], p[1]), 4, colour.filled())))?;
            chart
                .draw_series(curve.extrapolated.iter().map(|p| Circle::new((p[0], p[1]), 5, colour.stroke_width(2))))?;
        }
        chart
            .configure_series_labels()
            .label_font(font(14))
            .background_style(WHITE.mix(0.9))
            .border_style(BLACK.mix(0.4))
            .position(SeriesLabelPosition::UpperRight)
            .draw()?;
        area.present()?;
        Ok(())
    }
}

/// The next power of ten, down or up.
fn whole(x: f64, round: fn(f64) -> f64) -> f64 {
    10_f64.powf(round(x.log10()))
}

/// A number on an axis, as 0.01 or as 1e-5; nothing for those that would stand too close together.
fn label(x: f64) -> String {
    let text = format!("{x:e}");
    match text.split('e').next() {
        Some("1" | "2" | "5") if (1e-2..1e4).contains(&x) => format!("{x}"),
        Some("1" | "2" | "5") => text,
        _ => String::new(),
    }
}
