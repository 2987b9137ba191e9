use super::files::RunFiles;
use super::frame::Frame;
use crate::numerics::ends;
use crate::parallel::map;
use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{Compression, write::ZlibEncoder};
use serde_json::{Value, json};
use std::io::Write;

/// The data of the viewer on the page.
pub struct Viewer {
    /// What the viewer shows, as JSON that cannot end a script element.
    pub data: String,
    /// Whether it shows a line.
    pub line: bool,
    /// Whether there is more than one frame, and what the frames are numbered by.
    pub moves: bool,
    pub clock: &'static str,
    /// A note on what is not shown.
    pub thinned: Option<String>,
}

/// Bytes that the frames may take, so that the page stays below 5 MB.
const BUDGET: usize = 4_300_000;
/// Share of the budget that a guess of the number of frames aims at.
const ROOM: f64 = 0.96;
/// Largest number of guesses of the number of frames that fit.
const GUESSES: usize = 3;
/// Number of levels of a quantised value, less one: it takes three bytes.
const LEVELS: f64 = (1 << 24) as f64 - 1.0;
/// Length of a base64 text over that of its bytes.
const TEXT: f64 = 4.0 / 3.0;

impl Viewer {
    /// The frames of a run, as many as fit into the budget; none where it has no frames.
    pub fn of(run: &mut RunFiles) -> Option<Self> {
        let counts = [0, 1].map(|series| run.series[series].frames.len());
        let first = (0..counts[0]).find_map(|place| run.frames(0, &[place]).pop())?;
        // bytes of a frame without compression
        let arrays = (2 + first.fields.len() + first.cell_fields.len()) * if counts[1] > 0 { 2 } else { 1 };
        let size = |stride: usize| {
            let nodes: usize = first.cells.iter().map(|n| n.div_ceil(stride) + 1).product();
            (3 * nodes * arrays) as f64 * TEXT
        };
        let least = counts[0].min(2) as f64;
        let stride = (1..).find(|&stride| size(stride) * least <= BUDGET as f64).unwrap_or(1);
        let share = BUDGET as f64 / (size(stride) * counts[0].max(counts[1]) as f64);
        let mut packed = Packed::of(run, counts, share, stride)?;
        // the compression reached so far tells about how many more frames fit
        let mut guess = ROOM * share * BUDGET as f64 / packed.bytes() as f64;
        for _ in 0..GUESSES {
            if share >= 1.0 || guess < 1.2 * share {
                break;
            }
            let more = Packed::of(run, counts, guess, stride)?;
            if more.bytes() <= BUDGET {
                packed = more;
                break;
            }
            guess *= ROOM * BUDGET as f64 / more.bytes() as f64;
        }
        let shown = packed.meshes[0].shown;
        let mut left_out = Vec::new();
        // what is damaged is told of elsewhere
        if packed.wanted < counts[0] {
            left_out.push(format!("{shown} of {} frames", counts[0]));
        }
        if stride > 1 {
            left_out.push(format!("one mesh line in {stride}"));
        }
        let thinned = (!left_out.is_empty()).then(|| {
            format!(
                "Shown here: {}, which keeps this page below 5 MB. run.pvd opens everything in ParaView.",
                left_out.join(", ")
            )
        });
        run.notes.extend(thinned.clone());
        let data = packed.json(run).to_string().replace('<', "\\u003c");
        Some(Self { data, line: first.cells[1] == 0, moves: shown > 1, clock: clock(run), thinned })
    }
}

struct Packed {
    first: Frame,
    /// Frames of the run that were asked for.
    wanted: usize,
    stride: usize,
    /// The box that is shown.
    ends: [[f64; 2]; 2],
    meshes: Vec<PackedSeries>,
}

struct PackedSeries {
    shown: usize,
    json: Value,
    cuts: [Vec<usize>; 2],
    data: String,
}

impl Packed {
    fn of(run: &mut RunFiles, counts: [usize; 2], share: f64, stride: usize) -> Option<Self> {
        let mut first = None;
        let mut ends = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        let mut meshes = Vec::new();
        for (series, count) in counts.into_iter().enumerate() {
            let frames = run.frames(series, &spread(count, share));
            for x in frames.iter().flat_map(|frame| &frame.x) {
                ends = [[0, 1].map(|d| ends[0][d].min(x[d])), [0, 1].map(|d| ends[1][d].max(x[d]))];
            }
            let Some(one) = frames.first() else { continue };
            meshes.push(PackedSeries::of(&frames, stride));
            first.get_or_insert_with(|| one.clone());
        }
        Some(Self { first: first?, wanted: spread(counts[0], share).len(), stride, ends, meshes })
    }

    fn bytes(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.data.len()).sum()
    }

    fn json(&self, run: &RunFiles) -> Value {
        let line = self.first.cells[1] == 0;
        let pair = |key: &str| Some([run.corner(key, 0)?, run.corner(key, 1)?]);
        // a periodic mesh leaves its box, any other fills it
        let [lower, upper] = match (pair("lower"), pair("upper")) {
            (Some(lower), Some(upper)) => [lower, upper],
            // iterates of a line may leave it
            _ if line => [("lower", 0.0), ("upper", 1.0)].map(|(key, x)| [run.corner(key, 0).unwrap_or(x), 0.0]),
            _ => self.ends,
        };
        let kinds = [&["mesh", "generator"][..], &["compare", "generator"][..]];
        let meshes = self.meshes.iter().zip(kinds).map(|(mesh, keys)| {
            let kind = run.setting(&[keys, &["kind"]].concat()).and_then(toml::Value::as_str);
            let parts = run.setting(&[keys, &["subdomains"]].concat()).and_then(toml::Value::as_array);
            let parts = parts.map(|n| n.iter().map(ToString::to_string).collect::<Vec<_>>().join(" × "));
            let name = match (kind, parts) {
                (Some(kind), Some(parts)) => format!("{kind}, {parts} subdomains"),
                (Some(kind), None) => kind.to_string(),
                (None, _) => String::new(),
            };
            let mut json = mesh.json.clone();
            json["name"] = name.into();
            // only around a periodic or closed axis something changes at its beginning
            let around = |d: usize| run.wraps(d) || run.closes(d);
            let cuts = [0, 1].map(|d| mesh.cuts[d].iter().filter(|&&cut| cut > 0 || around(d)).collect::<Vec<_>>());
            json["cuts"] = match run.front() {
                Some(front) if front <= self.first.cells[1] => json!([[], [(front + self.stride / 2) / self.stride]]),
                _ => json!(cuts),
            };
            json["data"] = mesh.data.as_str().into();
            json
        });
        let maps = [("viridis", colorous::VIRIDIS), ("cividis", colorous::CIVIDIS)].map(|(name, map)| {
            let colours = (0..256).map(|k| format!("{:x}", map.eval_rational(k, 256))).collect::<String>();
            json!({ "name": name, "colours": colours })
        });
        json!({
            "cells": self.first.cells, "stride": self.stride,
            "lower": lower, "extent": [upper[0] - lower[0], upper[1] - lower[1]],
            "periodic": [run.wraps(0), run.wraps(1)],
            "between": if run.front().is_some() { "front" } else { "subdomains" },
            "line": line,
            "clock": clock(run),
            "maps": maps, "meshes": meshes.collect::<Vec<_>>(),
        })
    }
}

/// What numbers the frames: t, iterations, or nothing.
pub fn clock(run: &RunFiles) -> &'static str {
    match run.word("kind") {
        "poisson" => "",
        "equidistribution" if run.setting(&["time"]).is_none() => {
            if run.setting(&["schwarz"]).is_some() {
                "iteration"
            } else {
                ""
            }
        }
        _ => "t",
    }
}

impl PackedSeries {
    fn of(frames: &[Frame], stride: usize) -> Self {
        let first = &frames[0];
        let lines = first.cells.map(|n| (0..n).step_by(stride).chain([n]).collect::<Vec<usize>>());
        let row = first.cells[1] + 1;
        let nodes: Vec<usize> = lines[0].iter().flat_map(|i| lines[1].iter().map(move |j| i * row + j)).collect();
        let (inside, count) = (&first.cell_fields, first.cells[0]);
        let fields = first.fields.iter().chain(inside).map(|(name, _)| name.as_str());
        let (names, nodal) = (["x", "y"].into_iter().chain(fields), 2 + first.fields.len());
        let packed = map(&names.enumerate().collect::<Vec<_>>(), |&(a, name)| {
            let at = |frame: &Frame, k: usize| match a {
                0 | 1 => frame.x[k][a],
                _ if a < nodal => frame.fields[a - 2].1[k],
                // the cell behind a node, and the last once more
                _ => frame.cell_fields[a - nodal].1[k.min(count - 1)],
            };
            let all = || frames.iter().flat_map(|frame| nodes.iter().map(move |&k| at(frame, k)));
            let [low, high] = ends(all());
            // a density that nothing asked for is the same everywhere
            let needless = low == high && a >= 2 && first.fields.len() > 1 && ["rho", "mesh density"].contains(&name);
            (!needless).then(|| {
                let bytes = pack(all().map(|v| quantised(v, low, high)), nodes.len());
                (json!({ "name": name, "low": low, "high": high, "inside": a >= nodal }), bytes)
            })
        });
        let (arrays, bytes): (Vec<Value>, Vec<Vec<u8>>) = packed.into_iter().flatten().unzip();
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(4));
        let data =
            encoder.write_all(&bytes.concat()).and_then(|()| encoder.finish()).expect("writing to memory cannot fail");
        let json = json!({
            "times": frames.iter().map(|frame| frame.t).collect::<Vec<_>>(),
            "lines": lines.map(|lines| lines.len()),
            "arrays": arrays,
        });
        // a cut is shown at the nearest line
        let cuts = first.cuts.clone().map(|cuts| cuts.into_iter().map(|cut| (cut + stride / 2) / stride).collect());
        Self { shown: frames.len(), json, cuts, data: STANDARD.encode(data) }
    }
}

/// A value as one of 2²⁴ levels.
fn quantised(v: f64, low: f64, high: f64) -> u32 {
    // halves, since the difference of two large numbers may overflow
    let part = (0.5 * v - 0.5 * low) / (0.5 * high - 0.5 * low);
    if part.is_finite() { (part * LEVELS).round() as u32 } else { 0 }
}

/// Levels of an array, frame after frame, as differences from the frame before and then from the node before: first the
/// low bytes of all of them, then the middle and the high ones.
fn pack(levels: impl Iterator<Item = u32>, nodes: usize) -> Vec<u8> {
    let levels: Vec<u32> = levels.collect();
    let since = |k: usize| levels[k].wrapping_sub(if k >= nodes { levels[k - nodes] } else { 0 });
    let differences: Vec<u32> = (0..levels.len())
        .map(|k| if k % nodes == 0 { since(k) } else { since(k).wrapping_sub(since(k - 1)) })
        .collect();
    (0..3).flat_map(|byte| differences.iter().map(move |d| (d >> (8 * byte)) as u8)).collect()
}

/// Places of a share of the frames, evenly spread, the first and the last among them.
fn spread(count: usize, share: f64) -> Vec<usize> {
    let shown = ((count as f64 * share) as usize).clamp(count.min(2), count);
    (0..shown).map(|k| if shown == 1 { count - 1 } else { k * (count - 1) / (shown - 1) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_and_the_last_frame_are_always_shown() {
        assert_eq!(spread(101, 0.05), [0, 25, 50, 75, 100]);
        assert_eq!(spread(3, 0.01), [0, 2]);
        assert_eq!(spread(1, 0.5), [0]);
        assert_eq!(spread(4, 2.0), [0, 1, 2, 3]);
        assert!(spread(0, 1.0).is_empty());
    }

    /// Sums undo the differences, modulo 2²⁴.
    #[test]
    fn packed_levels_come_back() {
        let levels = [5_u32, 16_777_215, 0, 70_000, 3, 9];
        let bytes = pack(levels.into_iter(), 3);
        let mut back: Vec<u32> = (0..6)
            .map(|k| u32::from(bytes[k]) | u32::from(bytes[6 + k]) << 8 | u32::from(bytes[12 + k]) << 16)
            .collect();
        for k in 0..6 {
            let before = if k % 3 == 0 { 0 } else { back[k - 1].wrapping_sub(if k > 3 { back[k - 4] } else { 0 }) };
            back[k] = back[k].wrapping_add(before).wrapping_add(if k >= 3 { back[k - 3] } else { 0 }) & 0xff_ffff;
        }
        assert_eq!(back, levels);
    }

    #[test]
    fn levels_span_the_range_and_survive_constant_and_huge_values() {
        assert_eq!([quantised(1.0, 1.0, 3.0), quantised(3.0, 1.0, 3.0)], [0, (1 << 24) - 1]);
        assert_eq!(quantised(2.0, 2.0, 2.0), 0);
        assert_eq!(quantised(0.0, -f64::MAX, f64::MAX), 1 << 23);
    }
}
