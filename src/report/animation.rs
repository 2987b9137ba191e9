use super::files::RunFiles;
use super::frame::Frame;
use super::viewer::clock;
use crate::error::{Error, Result};
use crate::output::{COLOURS, Canvas, Curve, Figure, Picture, Scale, names, svg, write_file};
use crate::simulation::{Scene, Values};
use gif::{Encoder, Repeat};
use std::collections::HashMap;

/// Largest number of frames of an animation; of a run with more, evenly spaced ones are taken.
const MOST: usize = 120;
/// Time that an animation takes, about, in hundredths of a second.
const WHOLE: usize = 500;
/// Shortest and longest time of a frame, in hundredths of a second.
const ONE: [usize; 2] = [4, 25];
/// Time of the last frame, in hundredths of a second: long enough to be looked at.
const LAST: u16 = 150;
/// Number of colours of the palette that are those of the map itself.
const PURE: usize = 96;
/// Number of colours of the map that are blended with a light and with a dark mesh line, for each opacity of a line.
const BLENDED: usize = 33;
/// Opacities of mesh lines that have colours of their own.
const STRENGTHS: [f64; 2] = [0.25, 0.5];
/// Number of greys in the palette.
const GREYS: usize = 26;
/// Steps from white to the colour of a curve.
const STEPS: usize = 128;
/// Largest over smallest density above which its axis is logarithmic.
const MUCH: f64 = 30.0;
/// Colours of a front, and of its antialiased edge on white.
const FRONT: [[u8; 3]; 2] = [[213, 94, 0], [234, 174, 128]];

/// Writes `animation.gif`: the mesh over the first unknown, with the same colours in all frames.
pub fn write(run: &mut RunFiles) -> Result<()> {
    let path = run.directory.join(names::ANIMATION);
    let count = run.series[0].frames.len();
    let shown: Vec<usize> = (0..count).step_by(count.div_ceil(MOST).max(1)).chain(count.checked_sub(1)).collect();
    let mut places = shown;
    places.dedup();
    if places.len() < count {
        run.notes.push(format!("animation.gif shows {} of {count} frames", places.len()));
    }
    let frames = run.frames(0, &places);
    let Some(first) = frames.first() else {
        run.notes.push("animation.gif is not written: there is no frame".into());
        return Ok(());
    };
    let Some(draw) = drawing(run, &frames) else { return Ok(()) };
    let each = (WHOLE / frames.len()).clamp(ONE[0], ONE[1]) as u16;

    let unwritable = Error::unwritable::<gif::EncodingError>(&path);
    let mut palette = if first.cells[1] == 0 { Palette::of_curves() } else { Palette::of_maps() };
    let mut encoder: Option<Encoder<Vec<u8>>> = None;
    let mut canvas = Canvas::default();
    for (k, frame) in frames.iter().enumerate() {
        let pixels = canvas.pixels(&draw(frame));
        let [width, height] = pixels.size.map(|n| n.min(u32::from(u16::MAX)) as u16);
        let encoder = match &mut encoder {
            Some(encoder) => encoder,
            none => {
                let mut first =
                    Encoder::new(Vec::new(), width, height, palette.colours.as_flattened()).map_err(unwritable)?;
                first.set_repeat(Repeat::Infinite).map_err(unwritable)?;
                none.insert(first)
            }
        };
        let buffer: Vec<u8> = pixels.rgba.chunks_exact(4).map(|p| palette.nearest([p[0], p[1], p[2]])).collect();
        let delay = if k + 1 == frames.len() { LAST } else { each };
        let image = gif::Frame { width, height, delay, buffer: buffer.into(), ..gif::Frame::default() };
        encoder.write_frame(&image).map_err(unwritable)?;
    }
    match encoder {
        Some(encoder) => write_file(&path, &encoder.into_inner().map_err(unwritable)?),
        None => Ok(()),
    }
}

fn title(run: &RunFiles, frame: &Frame) -> String {
    match clock(run) {
        "" => run.word("study").into(),
        "iteration" => format!("{}, iteration {}", run.word("study"), frame.t),
        _ => {
            // the same number of decimals in all frames, so that the text does not jump
            let times = &run.series[0].frames;
            let span = times.last().map_or(0.0, |(last, _)| last - times[0].0);
            let decimals = (3.0 - span.log10()).ceil().clamp(2.0, 12.0);
            match decimals < 9.0 {
                true => format!("{}, t = {:.*}", run.word("study"), decimals as usize, frame.t),
                false => format!("{}, t = {:.3e}", run.word("study"), frame.t),
            }
        }
    }
}

/// A function that draws a frame as SVG.
type Drawing<'a> = Box<dyn Fn(&Frame) -> String + 'a>;

/// The function that draws these frames: the mesh over the first field.
fn drawing<'a>(run: &'a RunFiles, frames: &'a [Frame]) -> Option<Drawing<'a>> {
    let first = frames.first()?;
    let (field, _) = first.fields.first()?;
    Some(if first.cells[1] == 0 { of_line(run, frames, field) } else { of_mesh(run, frames, field) })
}

/// Draws `mesh.png` and `.svg` from the last frame, for a run that ended before it drew them.
pub fn still(run: &mut RunFiles) -> Result<()> {
    let Some(last) = run.series[0].frames.len().checked_sub(1) else { return Ok(()) };
    if run.directory.join("mesh.png").exists() {
        return Ok(());
    }
    let frames = run.frames(0, &[last]);
    let picture = drawing(run, &frames).map(|draw| Picture::of(&draw(&frames[0]), &mut Canvas::default()));
    picture.map_or(Ok(()), |picture| picture.write(&run.directory, names::MESH))
}

/// Draws the first field over a line, through all nodes.
fn of_line<'a>(run: &'a RunFiles, frames: &[Frame], field: &'a str) -> Drawing<'a> {
    // nodes of an iterate may lie outside the line
    let line = run.corner("lower", 0).unwrap_or(0.0)..=run.corner("upper", 0).unwrap_or(1.0);
    let points = move |frame: &Frame| -> Vec<[f64; 2]> {
        let all = frame.x.iter().zip(&frame.fields[0].1).map(|(x, v)| [x[0], *v]);
        all.filter(|p| line.contains(&p[0])).collect()
    };
    let all = frames.iter().flat_map(&points);
    let none = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    let ends = all.fold(none, |[l, h], p| [[0, 1].map(|d| l[d].min(p[d])), [0, 1].map(|d| h[d].max(p[d]))]);
    let spans_much = field == "M" && ends[1][1] > MUCH * ends[0][1];
    Box::new(move |frame| {
        let figure = Figure {
            title: title(run, frame),
            labels: ["x".into(), field.into()],
            scales: [Scale::Linear, if spans_much { Scale::Logarithmic } else { Scale::Linear }],
            curves: vec![Curve { points: points(frame), ..Curve::default() }],
            room: ends.to_vec(),
        };
        figure.svg()
    })
}

/// Draws the mesh over the first field.
fn of_mesh<'a>(run: &'a RunFiles, frames: &[Frame], unknown: &'a str) -> Drawing<'a> {
    let around = |[l, h]: [f64; 2], v: f64| [l.min(v), h.max(v)];
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let range = frames.iter().flat_map(|frame| &frame.fields[0].1).copied().fold(none, around);
    let all = [0, 1].map(|d| frames.iter().flat_map(|frame| &frame.x).map(|x| x[d]).fold(none, around));
    let lower = [0, 1].map(|d| run.corner("lower", d).unwrap_or(all[d][0]));
    let upper = [0, 1].map(|d| run.corner("upper", d).unwrap_or(all[d][1]));
    let periodic = [0, 1].map(|d| run.wraps(d));
    let front = run.front();
    Box::new(move |frame| {
        let along =
            |j: usize| (0..=frame.cells[0]).filter_map(move |i| frame.x.get(i * (frame.cells[1] + 1) + j).copied());
        let scene = Scene {
            t: frame.t,
            step: 0,
            cells: frame.cells,
            periodic,
            closed: [0, 1].map(|d| run.closes(d)),
            lower,
            extent: [upper[0] - lower[0], upper[1] - lower[1]],
            points: frame.x.clone(),
            nodal: vec![(unknown.into(), Values::Scalars(frame.fields[0].1.clone()))],
            density: None,
            in_cells: Vec::new(),
            curve: front.filter(|j| *j <= frame.cells[1]).map_or(Vec::new(), |j| along(j).collect()),
        };
        svg(&title(run, frame), &scene, Some(range))
    })
}

/// The palette of all frames.
struct Palette {
    colours: Vec<[u8; 3]>,
    found: HashMap<[u8; 3], u8>,
}

impl Palette {
    /// A palette for curves: black and the first colour of a plot, in all steps to white.
    fn of_curves() -> Self {
        let steps = |colour: [u8; 3]| {
            (0..STEPS).map(move |k| colour.map(|c| (255 - (255 - usize::from(c)) * k / (STEPS - 1)) as u8))
        };
        Self { colours: steps([0; 3]).chain(steps(COLOURS[0])).collect(), found: HashMap::new() }
    }

    /// A palette for meshes over a colour map.
    fn of_maps() -> Self {
        let map = |k: usize, of: usize| colorous::VIRIDIS.eval_rational(k, of).as_array();
        let mut colours: Vec<[u8; 3]> = (0..PURE).map(|k| map(k, PURE)).collect();
        for (strength, line) in STRENGTHS.into_iter().flat_map(|s| [(s, 255.0), (s, 0.0)]) {
            let mix = |c: u8| (f64::from(c) + strength * (line - f64::from(c))).round() as u8;
            colours.extend((0..BLENDED).map(|k| map(k, BLENDED).map(mix)));
        }
        colours.extend((0..GREYS).map(|k| [(k * 255 / (GREYS - 1)) as u8; 3]));
        colours.extend(FRONT);
        Self { colours, found: HashMap::new() }
    }

    /// The index of the nearest colour.
    fn nearest(&mut self, colour: [u8; 3]) -> u8 {
        let distance = |other: &[u8; 3]| -> i32 {
            other.iter().zip(colour).map(|(a, b)| (i32::from(*a) - i32::from(b)).pow(2)).sum()
        };
        let place = || self.colours.iter().enumerate().min_by_key(|(_, other)| distance(other)).map_or(0, |(k, _)| k);
        *self.found.entry(colour).or_insert_with(|| place() as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every colour of the map, bare or under a mesh line, is met within a few levels; black, white and a front
    /// exactly.
    #[test]
    fn the_palette_meets_the_colours_of_the_drawings() {
        let mut palette = Palette::of_maps();
        assert_eq!(palette.colours.len(), 256);
        for k in 0..500 {
            let bare = colorous::VIRIDIS.eval_rational(k, 500).as_array();
            let under = bare.map(|c| ((u16::from(c) + 255) / 2) as u8);
            for colour in [bare, under] {
                let place = palette.nearest(colour);
                let met = palette.colours[usize::from(place)];
                let off = met.iter().zip(colour).map(|(a, b)| a.abs_diff(b)).max().unwrap();
                assert!(off <= 6, "{colour:?} is shown as {met:?}");
            }
        }
        for exact in [[0; 3], [255; 3], FRONT[0]] {
            let place = palette.nearest(exact);
            assert_eq!(palette.colours[usize::from(place)], exact);
        }
    }
}
