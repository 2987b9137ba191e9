//! A scene as a drawing: cells in the colours of its first values, the lines of the mesh, a curve, axes, a colour bar.

use super::picture::{Canvas, Picture, add_point, point};
use super::sheet::{LEFT, LONGER, SHORTER_AT_LEAST, Sheet, TOP, colour};
use crate::numerics::ends;
use crate::simulation::{Scene, Values};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Opacities with which mesh lines may be drawn: a line beside wide cells is drawn more strongly than one between
/// narrow cells, so that crowded lines do not hide the colours.
const STRENGTHS: [f64; 8] = [0.04, 0.08, 0.13, 0.19, 0.26, 0.35, 0.46, 0.6];
/// Number of tones of mesh lines, white and black included.
const TONES: usize = 5;
/// Mesh lines are white over colours up to this share of the colour map, its dark end.
const WHITE_UP_TO: f64 = 0.35;
/// Mesh lines are black over colours from this share of the colour map on, its bright end.
const BLACK_FROM: f64 = 0.65;
/// Between these shares a white and a black line run side by side, each this far from where one line would be, in units
/// of the drawing: half a pixel of the PNG.
const BESIDE: f64 = 0.25;
/// Opacity that a mesh line gains for each unit of the drawing by which the cell beside it is wider than one unit.
const FADES: f64 = 0.08;
/// Cells drawn along an axis; a finer mesh shows every second, third … line.
const MAX_CELLS: usize = 240;
/// Colour of a curve over the cells.
const CURVE: &str = "#d55e00";

/// Draws a scene.
pub fn draw(title: &str, scene: &Scene) -> Picture {
    Picture::of(&svg(title, scene, None), &mut Canvas::default())
}

/// Draws a scene as SVG; `range` has the values of the first and the last colour, those that occur where nothing is
/// said.
pub(crate) fn svg(title: &str, scene: &Scene, range: Option<[f64; 2]>) -> String {
    let nothing = vec![0.0; scene.points.len()];
    let (unknown, u) = match scene.nodal.first() {
        Some((name, Values::Scalars(u))) => (name.as_str(), &u[..]),
        _ => ("", &nothing[..]),
    };
    let drawing = Drawing::of(scene, u, range);
    let sheet = drawing.sheet;
    let [width, height] = sheet.size;
    let mut s = sheet.begin(title);
    if scene.periodic.contains(&true) {
        let _ = writeln!(
            s,
            "<clipPath id=\"box\"><rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{width:.1}\" height=\"{height:.1}\"/>\
             </clipPath>\n<g clip-path=\"url(#box)\">"
        );
    } else {
        s.push_str("<g>\n");
    }
    drawing.cells(&mut s);
    drawing.mesh_lines(&mut s);
    drawing.curve(&mut s);
    s.push_str("</g>\n");
    sheet.axes(&mut s, &drawing.names());
    sheet.colour_bar(&mut s, unknown, drawing.range);
    if !scene.curve.is_empty() {
        let (x, y) = (sheet.bar(), TOP + height + 20.0);
        let _ = writeln!(
            s,
            "<path d=\"M{x:.1} {:.1}h16\" stroke=\"{CURVE}\" stroke-width=\"2.5\"/>\
             <text x=\"{:.1}\" y=\"{y:.1}\">front</text>",
            y - 4.5,
            x + 25.0
        );
    }
    s.push_str("</svg>\n");
    s
}

/// A scene laid out on the paper.
struct Drawing<'a> {
    scene: &'a Scene,
    u: &'a [f64],
    range: [f64; 2],
    /// The box around the domain.
    sheet: Sheet,
    /// Lines of the mesh that are drawn, along each axis.
    lines: [Vec<usize>; 2],
    /// By how much the mesh is moved each time that it is drawn: a periodic mesh leaves the box on one side and enters
    /// on the other, and is drawn as often as it shows, cut to size.
    shifts: Vec<[f64; 2]>,
}

/// Paths of mesh lines, flat and steep ones, for every tone and every strength.
type Paths = [[[String; STRENGTHS.len()]; TONES]; 2];

impl<'a> Drawing<'a> {
    fn of(scene: &'a Scene, u: &'a [f64], range: Option<[f64; 2]>) -> Self {
        let [wx, wy] = scene.extent;
        let ends = || ends(u.iter().copied());
        let scale = LONGER / wx.max(wy);
        let lines = scene.cells.map(|n| {
            let stride = n.div_ceil(MAX_CELLS);
            (0..n).step_by(stride).chain([n]).collect::<Vec<usize>>()
        });
        let reach = scene.periodic.map(|periodic| if periodic { vec![-1.0, 0.0, 1.0] } else { vec![0.0] });
        let shifts = reach[0].iter().flat_map(|&i| reach[1].iter().map(move |&j| [i * wx, j * wy])).collect();
        let size = [wx, wy].map(|w| (w * scale).max(SHORTER_AT_LEAST));
        let sheet = Sheet { lower: scene.lower, extent: scene.extent, size };
        Self { scene, u, range: range.unwrap_or_else(ends), sheet, lines, shifts }
    }

    fn at(&self, i: usize, j: usize) -> usize {
        i * (self.scene.cells[1] + 1) + j
    }

    /// Names of the axes, with the factor by which the shorter one is stretched.
    fn names(&self) -> Vec<String> {
        let extent = self.scene.extent;
        let scale = LONGER / extent[0].max(extent[1]);
        let stretched = [0, 1].map(|d| self.sheet.size[d] / extent[d] / scale);
        let names = ["x", "y"].into_iter().zip(stretched).map(|(name, factor)| match factor > 1.0 + 1e-9 {
            true => format!("{name}, stretched {} times", factor.round()),
            false => name.into(),
        });
        names.collect()
    }

    /// Whether some of these corners may be seen in the box.
    fn shown(&self, corners: &[usize], shift: [f64; 2]) -> bool {
        let Scene { points: x, lower, extent, .. } = self.scene;
        (0..2).all(|d| {
            let beyond = lower[d] + extent[d];
            !(corners.iter().all(|&k| x[k][d] + shift[d] < lower[d])
                || corners.iter().all(|&k| x[k][d] + shift[d] > beyond))
        })
    }

    fn through(&self, path: &mut String, nodes: impl Iterator<Item = usize>, shift: [f64; 2]) {
        for (n, k) in nodes.enumerate() {
            let x = self.scene.points[k];
            path.push(if n == 0 { 'M' } else { 'L' });
            add_point(path, self.sheet.place([x[0] + shift[0], x[1] + shift[1]]));
        }
    }

    /// Cells, without soft edges, so that no gap shines through; those of one colour together, and neighbours of one
    /// colour as one strip, which is drawn fast.
    fn cells(&self, s: &mut String) {
        let [low, high] = self.range;
        let mut fills: BTreeMap<String, String> = BTreeMap::new();
        for i in self.lines[0].windows(2) {
            let cell = |j: &[usize]| {
                let corners = [self.at(i[0], j[0]), self.at(i[1], j[0]), self.at(i[1], j[1]), self.at(i[0], j[1])];
                let mean = 0.25 * corners.iter().map(|&k| self.u[k]).sum::<f64>();
                (corners, colour((mean - low) / (high - low)))
            };
            let row: Vec<([usize; 4], String)> = self.lines[1].windows(2).map(cell).collect();
            for strip in row.chunk_by(|(_, before), (_, after)| before == after) {
                let path = fills.entry(strip[0].1.clone()).or_default();
                let seen = |shift: &&[f64; 2]| strip.iter().any(|(corners, _)| self.shown(corners, **shift));
                for &shift in self.shifts.iter().filter(seen) {
                    let there = [strip[0].0[0]].into_iter().chain(strip.iter().map(|([.., d], _)| *d));
                    let back = strip.iter().rev().map(|([_, _, c, _], _)| *c).chain([strip[0].0[1]]);
                    self.through(path, there.chain(back), shift);
                    path.push('Z');
                }
            }
        }
        s.push_str("<g shape-rendering=\"crispEdges\">\n");
        for (fill, path) in &fills {
            let _ = writeln!(s, "<path d=\"{path}\" fill=\"{fill}\"/>");
        }
        s.push_str("</g>\n");
    }

    /// Mesh lines, white on dark colours and black on light ones; fainter where cells are few pixels wide, so that the
    /// colours stay what they are; one pixel of the PNG wide, which is drawn fast.
    fn mesh_lines(&self, s: &mut String) {
        let mut paths = Paths::default();
        let neighbours = |lines: &[usize]| -> Vec<[usize; 2]> {
            (0..lines.len()).map(|k| [lines[k], lines[if k + 1 < lines.len() { k + 1 } else { k - 1 }]]).collect()
        };
        for [i, beside] in neighbours(&self.lines[0]) {
            let along = |i: usize| self.lines[1].iter().map(|&j| self.at(i, j)).collect::<Vec<_>>();
            self.mesh_line(&along(i), &along(beside), &mut paths);
        }
        for [j, beside] in neighbours(&self.lines[1]) {
            let along = |j: usize| self.lines[0].iter().map(|&i| self.at(i, j)).collect::<Vec<_>>();
            self.mesh_line(&along(j), &along(beside), &mut paths);
        }
        strokes(s, paths);
    }

    /// Adds one line through these nodes; `beside` are those of the line beside it.
    fn mesh_line(&self, nodes: &[usize], beside: &[usize], paths: &mut Paths) {
        let look = |e: &[usize], beside: usize| {
            let [a, b, c] = [e[0], e[1], beside].map(|k| self.sheet.place(self.scene.points[k]));
            let [e, f] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1]]);
            let wide = (e[0] * f[1] - e[1] * f[0]).abs() / e[0].hypot(e[1]);
            let strength = STRENGTHS.iter().rposition(|strength| FADES * (wide - 1.0) >= *strength)?;
            Some(((b[1] - a[1]).abs() > (b[0] - a[0]).abs(), strength))
        };
        let tone = |e: &[usize]| {
            let part = (0.5 * (self.u[e[0]] + self.u[e[1]]) - self.range[0]) / (self.range[1] - self.range[0]);
            let black = (part - WHITE_UP_TO) / (BLACK_FROM - WHITE_UP_TO);
            (black.clamp(0.0, 1.0) * (TONES - 1) as f64).round() as usize
        };
        let edges: Vec<_> =
            nodes.windows(2).zip(beside).map(|(e, &c)| (e, look(e, c).map(|look| (look, tone(e))))).collect();
        for part in edges.chunk_by(|(_, before), (_, after)| before == after) {
            let Some(((steep, strength), tone)) = part[0].1 else { continue };
            let seen = |shift: &&[f64; 2]| part.iter().any(|(edge, _)| self.shown(edge, **shift));
            for &shift in self.shifts.iter().filter(seen) {
                let nodes = [part[0].0[0]].into_iter().chain(part.iter().map(|(edge, _)| edge[1]));
                self.through(&mut paths[usize::from(steep)][tone][strength], nodes, shift);
            }
        }
    }

    fn curve(&self, s: &mut String) {
        if self.scene.curve.is_empty() {
            return;
        }
        let points: Vec<String> = self.scene.curve.iter().map(|p| point(self.sheet.place(*p))).collect();
        let points = points.join(" ");
        for (colour, width) in [("white", 4.5), (CURVE, 2.5)] {
            let _ = writeln!(
                s,
                "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"/>"
            );
        }
    }
}

/// Draws the paths of mesh lines. Where neither white nor black stands out there is a white line beside a black one,
/// for a jump of the tone would look like a line of its own.
fn strokes(s: &mut String, paths: Paths) {
    let [flat, steep] = paths.map(|tones| tones.into_iter().enumerate());
    let tones = flat.map(|tone| ([0.0, BESIDE], tone)).chain(steep.map(|tone| ([BESIDE, 0.0], tone)));
    for (side, (tone, paths)) in tones {
        let black = tone as f64 / (TONES - 1) as f64;
        let mixed = black > 0.0 && black < 1.0;
        let lines =
            [("#fff", 1.0 - black, -1.0), ("#000", black, 1.0)].into_iter().filter(|(_, share, _)| *share > 0.0);
        for (path, strength) in paths.iter().zip(STRENGTHS).filter(|(path, _)| !path.is_empty()) {
            for (colour, share, way) in lines.clone() {
                let aside = if mixed {
                    format!(" transform=\"translate({} {})\"", way * side[0], way * side[1])
                } else {
                    String::new()
                };
                let _ = writeln!(
                    s,
                    "<path d=\"{path}\"{aside} fill=\"none\" stroke=\"{colour}\" stroke-opacity=\"{:.3}\" \
                     stroke-width=\"0.5\"/>",
                    strength * share
                );
            }
        }
    }
}
