use super::files::RunFiles;
use crate::error::{Error, Result};
use crate::simulation::{Sheet, write_file};
use gif::{Encoder, Repeat};
use std::collections::HashMap;

/// Frames of an animation at most; more are thinned.
const MOST: usize = 120;
/// Hundredths of a second that all frames take together, about, and that one takes at least and at most.
const WHOLE: usize = 500;
const ONE: [usize; 2] = [4, 25];
/// The last frame stays.
const LAST: u16 = 150;
/// Colours of a drawing: the map itself, under light and under dark lines of two strengths, and greys.
const PURE: usize = 96;
const BLENDED: usize = 33;
const STRENGTHS: [f64; 2] = [0.25, 0.5];
const GREYS: usize = 26;
/// Of a front, and of its soft edge on white.
const FRONT: [[u8; 3]; 2] = [[213, 94, 0], [234, 174, 128]];

/// Writes `animation.gif`: the mesh over the first unknown, in colours that mean the same in all frames.
pub fn write(run: &mut RunFiles) -> Result<()> {
    let path = run.directory.join("animation.gif");
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
    let Some((unknown, _)) = first.fields.first() else { return Ok(()) };
    let around = |[l, h]: [f64; 2], v: f64| [l.min(v), h.max(v)];
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let range = frames.iter().flat_map(|frame| &frame.fields[0].1).copied().fold(none, around);
    let all = [0, 1].map(|d| frames.iter().flat_map(|frame| &frame.x).map(|x| x[d]).fold(none, around));
    let number = |key: &str, d: usize| {
        let value = run.setting(&["domain", key])?.get(d)?;
        value.as_float().or(value.as_integer().map(|n| n as f64))
    };
    let lower = [0, 1].map(|d| number("lower", d).unwrap_or(all[d][0]));
    let upper = [0, 1].map(|d| number("upper", d).unwrap_or(all[d][1]));
    let periodic =
        [0, 1].map(|d| run.setting(&["domain", "periodic"]).and_then(|axes| axes.get(d)?.as_bool()).unwrap_or(false));
    let each = (WHOLE / frames.len()).clamp(ONE[0], ONE[1]) as u16;

    let unwritable = |error: gif::EncodingError| Error::Unwritable { path: path.clone(), reason: error.to_string() };
    let front = run.front();
    let mut palette = Palette::new();
    let mut encoder: Option<Encoder<Vec<u8>>> = None;
    for (k, frame) in frames.iter().enumerate() {
        let along =
            |j: usize| (0..=frame.cells[0]).filter_map(move |i| frame.x.get(i * (frame.cells[1] + 1) + j).copied());
        let line: Vec<[f64; 2]> = front.filter(|j| *j <= frame.cells[1]).map_or(Vec::new(), |j| along(j).collect());
        let sheet = Sheet {
            title: &format!("{}, t = {:.4}", run.word("study"), frame.t),
            unknown,
            cells: frame.cells,
            periodic,
            lower,
            extent: [upper[0] - lower[0], upper[1] - lower[1]],
            x: &frame.x,
            u: &frame.fields[0].1,
            range: Some(range),
            line: &line,
        };
        let pixels = sheet.pixels();
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

/// The colours of all frames.
struct Palette {
    colours: Vec<[u8; 3]>,
    found: HashMap<[u8; 3], u8>,
}

impl Palette {
    fn new() -> Self {
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

    /// The colour that is nearest.
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

    /// Every colour of the map, bare or under a mesh line, is met within a few levels; black, white and a front exactly.
    #[test]
    fn the_palette_meets_the_colours_of_the_drawings() {
        let mut palette = Palette::new();
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
