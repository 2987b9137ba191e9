use super::chart::{self, BESIDE, LETTER, PLOT, ROW};
use super::picture::{Canvas, Picture};
use super::ticks::{ROUND, above, below};

/// Curves over linear or logarithmic axes, drawn as SVG and PNG.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// Labels of the axis along the bottom and of the one along the side.
    pub labels: [String; 2],
    /// Scales of the axis along the bottom and of the one along the side.
    pub scales: [Scale; 2],
    /// The curves.
    pub curves: Vec<Curve>,
    /// Points that have room in any case, also where no curve goes.
    pub room: Vec<[f64; 2]>,
}

/// How values lie along an axis.
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
pub(crate) const COLOURS: [[u8; 3]; 6] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [86, 180, 233], [230, 159, 0]];
/// Equal stretches along the bottom into which [`Curve::outlined`] divides a curve: some three pixels each, within
/// which a curve shows no more than where it begins and ends, and how far up and down it goes.
const STRETCHES: f64 = 150.0;
/// Equal parts of a line between two points whose ends are looked at, to see whether the legend would cover it.
const PARTS: usize = 16;
/// Room below and above the curves on a linear axis, as a share of their height: a curve does not lie on the frame.
const EDGE: f64 = 0.02;
/// Room around the points on a logarithmic axis, as a factor.
const ROOM: f64 = 1.05;
/// The ends of a logarithmic axis lie this share of themselves beyond round numbers, so that rounding leaves both ends
/// marked.
const BEYOND: f64 = 1e-9;
/// A logarithmic axis ends at powers of ten where the ratio of its ends is above this.
const MANY_POWERS: f64 = 1e4;
/// A logarithmic axis does not end at round numbers where the ratio of its ends is below this: they would be too far
/// away.
const NARROW: f64 = 4.0;

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
        chart::svg(self)
    }

    /// Whether a point has a place.
    pub(super) fn shown(&self, point: &&[f64; 2]) -> bool {
        let placed = |d: usize| point[d].is_finite() && (self.scales[d] == Scale::Linear || point[d] > 0.0);
        placed(0) && placed(1)
    }

    /// From where to where an axis goes: around the points, and from mark to mark where it is logarithmic; further up
    /// where a legend would find no free corner.
    pub(super) fn ends(&self, d: usize) -> [f64; 2] {
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

    /// From where to where an axis goes around the points alone.
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
                [below(low, round) * (1.0 - BEYOND), above(high, round) * (1.0 + BEYOND)]
            }
            Scale::Linear if low == high => [low - 0.5, high + 0.5],
            Scale::Linear if d == 1 => [low - EDGE * (high - low), high + EDGE * (high - low)],
            Scale::Linear => [low, high],
        }
    }

    /// What a curve goes through, as it is drawn.
    pub(super) fn line(&self, curve: &Curve) -> Vec<[f64; 2]> {
        let mut line: Vec<[f64; 2]> =
            curve.points.iter().chain(&curve.extrapolated).filter(|p| self.shown(p)).copied().collect();
        if !curve.plain {
            line.sort_by(|a, b| a[0].total_cmp(&b[0]));
        }
        line
    }

    /// Whether there is a legend.
    pub(super) fn is_named(&self) -> bool {
        self.curves.iter().any(|curve| !curve.name.is_empty())
    }

    /// Width and height of the legend, as shares of the plot.
    fn legend(&self) -> [f64; 2] {
        let names = || self.curves.iter().map(|curve| curve.name.chars().count()).filter(|letters| *letters > 0);
        let size = [BESIDE + LETTER * names().max().unwrap_or(0) as f64, ROW * (names().count() + 1) as f64];
        [0, 1].map(|d| (size[d] / PLOT[d]).min(0.5))
    }

    /// A corner of the plot where no curve would lie under the legend: whether it is on the right, and at the top.
    pub(super) fn free_corner(&self) -> Option<[bool; 2]> {
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
                (0..=PARTS).any(|k| {
                    let s = k as f64 / PARTS as f64;
                    under([0, 1].map(|d| w[0][d] + s * (w[1][d] - w[0][d])), corner)
                })
            };
            line.first().is_some_and(|p| under(*p, corner)) || line.windows(2).any(between)
        };
        let free = |corner: &[bool; 2]| !lines.iter().any(|line| crossed(line, *corner));
        [[true, true], [false, false], [true, false], [false, true]].into_iter().find(free)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::ticks::{log_marks, short};

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
            assert_eq!(figure.free_corner(), Some([true, false]));
            assert_eq!(figure.ends(1), figure.around(1));
        }
    }
}
