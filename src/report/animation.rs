use super::files::RunFiles;
use crate::error::{Error, Result};
use crate::simulation::{Sheet, write_file};
use gif::{Encoder, Repeat};

/// Frames of an animation at most; more are thinned.
const MOST: usize = 120;
/// Hundredths of a second that all frames take together, about, and that one takes at least and at most.
const WHOLE: usize = 500;
const ONE: [usize; 2] = [4, 25];
/// The last frame stays.
const LAST: u16 = 150;
/// Of the search for 256 colours, 1 to 30: slow and best to fast.
const SPEED: i32 = 20;

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
    let mut encoder: Option<Encoder<Vec<u8>>> = None;
    for (k, frame) in frames.iter().enumerate() {
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
        };
        let mut pixels = sheet.pixels();
        let [width, height] = pixels.size.map(|n| n.min(u32::from(u16::MAX)) as u16);
        let encoder = match &mut encoder {
            Some(encoder) => encoder,
            none => {
                let mut first = Encoder::new(Vec::new(), width, height, &[]).map_err(unwritable)?;
                first.set_repeat(Repeat::Infinite).map_err(unwritable)?;
                none.insert(first)
            }
        };
        let mut image = gif::Frame::from_rgba_speed(width, height, &mut pixels.rgba, SPEED);
        image.delay = if k + 1 == frames.len() { LAST } else { each };
        encoder.write_frame(&image).map_err(unwritable)?;
    }
    match encoder {
        Some(encoder) => write_file(&path, &encoder.into_inner().map_err(|error| unwritable(error.into()))?),
        None => Ok(()),
    }
}
