//! Structured meshes of one's own, read from files.

use crate::error::{Error, Result};
use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::read::ZlibDecoder;
use ndarray::{Ix2, OwnedRepr};
use ndarray_npy::NpzReader;
use std::io::{Cursor, Read};
use std::path::Path;

/// The nodes of a structured mesh: their number along each axis, and their positions, last axis fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenMesh {
    /// Nodes along each axis.
    pub nodes: [usize; 2],
    /// Positions.
    pub x: Vec<[f64; 2]>,
}

/// Largest file that is read.
const MOST_BYTES: u64 = 1 << 31;

/// Reads a structured mesh: `.npz` with arrays x and y of shape (nx + 1, ny + 1), a VTK structured grid `.vts` with
/// its points as text or as compressed float64, or one block of PLOT3D, `.xyz` or `.x`, as text or binary
///
/// The first axis is the first index of the arrays, i of the other formats.
///
/// # Errors
/// [`Error::Invalid`] for `mesh` where there is no such file, or where it does not hold one structured mesh in the
/// plane.
pub fn read_mesh(path: &Path) -> Result<GivenMesh> {
    let wrong = |rule: String| Error::invalid("mesh", format!("{:?}", path.display().to_string()), rule);
    let size = std::fs::metadata(path).map_err(|error| wrong(format!("cannot be read: {error}")))?.len();
    if size > MOST_BYTES {
        return Err(wrong(format!("has {size} bytes, and at most {MOST_BYTES} are read")));
    }
    let bytes = std::fs::read(path).map_err(|error| wrong(format!("cannot be read: {error}")))?;
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let read = match extension.as_str() {
        "npz" => of_npz(bytes),
        "vts" => of_vts(&String::from_utf8_lossy(&bytes)),
        "xyz" | "x" | "p3d" | "fmt" => of_plot3d(&bytes),
        _ => Err("has none of the endings .npz, .vts, .xyz and .x, which say what is in it".into()),
    };
    read.map_err(wrong)
}

fn of_npz(bytes: Vec<u8>) -> std::result::Result<GivenMesh, String> {
    let mut npz = NpzReader::new(Cursor::new(bytes)).map_err(|error| format!("is no .npz file: {error}"))?;
    let mut array = |name: &str| {
        let found = npz.by_name::<OwnedRepr<f64>, Ix2>(name);
        found.map_err(|error| format!("needs an array {name} of two axes and of float64: {error}"))
    };
    let [x, y] = [array("x")?, array("y")?];
    if x.dim() != y.dim() {
        return Err(format!("has x of shape {:?} and y of shape {:?}, which must be the same", x.dim(), y.dim()));
    }
    let (n, m) = x.dim();
    Ok(GivenMesh { nodes: [n, m], x: x.iter().zip(&y).map(|(x, y)| [*x, *y]).collect() })
}

/// The text between two others, and what follows.
fn within<'a>(text: &'a str, from: &str, to: &str) -> Option<(&'a str, &'a str)> {
    let start = text.find(from)? + from.len();
    let end = start + text[start..].find(to)?;
    Some((&text[start..end], &text[end..]))
}

fn of_vts(text: &str) -> std::result::Result<GivenMesh, String> {
    let extent = within(text, "<Piece", ">").and_then(|(piece, _)| within(piece, "Extent=\"", "\""));
    let (extent, _) = extent.ok_or("has no <Piece Extent=\"…\">, as a structured grid has")?;
    let ends: Vec<usize> = extent.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let [i, j, k]: [usize; 3] = match ends[..] {
        [a, b, c, d, e, f] if a <= b && c <= d && e <= f => [b - a + 1, d - c + 1, f - e + 1],
        _ => return Err(format!("has the extent \"{extent}\", which is not six numbers in pairs that rise")),
    };
    let (points, _) = within(text, "<Points>", "</Points>").ok_or("has no <Points>")?;
    let (head, rest) = within(points, "<DataArray", ">").ok_or("has no array in <Points>")?;
    let (inside, _) = within(rest, ">", "</DataArray>").ok_or("has an array without an end")?;
    let values = if head.contains("format=\"ascii\"") {
        numbers_of(inside)?
    } else {
        let form = ["vtkZLibDataCompressor", "header_type=\"UInt64\"", "LittleEndian"];
        let known = form.into_iter().all(|word| text.contains(word));
        let inline = known && head.contains("format=\"binary\"") && head.contains("\"Float64\"");
        inline.then(|| inflated(inside.trim())).flatten().ok_or(
            "has points in a form that is not read; write them as text, or inline as compressed Float64 with a UInt64 \
             header",
        )?
    };
    if k != 1 || values.len() != 3 * i * j {
        return Err(format!("has {} numbers for {i} × {j} × {k} points of three coordinates", values.len()));
    }
    Ok(first_fastest([i, j], |k| [values[3 * k], values[3 * k + 1]]))
}

/// The numbers of a compressed inline array: a header of words with the number of blocks, their size, the size of the
/// last one and the compressed size of each, then the blocks.
fn inflated(text: &str) -> Option<Vec<f64>> {
    let word =
        |bytes: &[u8], k: usize| Some(u64::from_le_bytes(bytes.get(8 * k..8 * k + 8)?.try_into().ok()?) as usize);
    // four characters for each three bytes
    let blocks = word(&STANDARD.decode(text.get(..12)?).ok()?, 0)?;
    let header = blocks.checked_add(3)?.checked_mul(8)?.div_ceil(3).checked_mul(4)?;
    let (header, rest) = (STANDARD.decode(text.get(..header)?).ok()?, STANDARD.decode(text.get(header..)?).ok()?);
    let (mut bytes, mut at) = (Vec::new(), 0_usize);
    for block in 0..blocks {
        let end = at.checked_add(word(&header, 3 + block)?)?;
        ZlibDecoder::new(rest.get(at..end)?).take(MOST_BYTES).read_to_end(&mut bytes).ok()?;
        at = end;
    }
    Some(bytes.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}

/// Nodes that are stored with the first axis fastest.
fn first_fastest([n, m]: [usize; 2], x: impl Fn(usize) -> [f64; 2]) -> GivenMesh {
    let x = (0..n).flat_map(|i| (0..m).map(move |j| i + n * j)).map(x).collect();
    GivenMesh { nodes: [n, m], x }
}

fn numbers_of(text: &str) -> std::result::Result<Vec<f64>, String> {
    let separated = text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
    let number = |word: &str| word.replace(['d', 'D'], "e").parse::<f64>();
    separated.map(|word| number(word).map_err(|_| format!("has {word:?} where a number should stand"))).collect()
}

fn of_plot3d(bytes: &[u8]) -> std::result::Result<GivenMesh, String> {
    if let Ok(text) = std::str::from_utf8(bytes)
        && !text.contains('\0')
    {
        let values = numbers_of(text)?;
        let whole = |k: usize| values.get(k).filter(|v| v.fract() == 0.0 && **v >= 0.0).map(|v| *v as usize);
        return block(&whole, &|head| values.len().checked_sub(head), &|k| values[k])
            .ok_or_else(|| not_plot3d(values.len()));
    }
    for reverses in [false, true] {
        let small = if reverses { u32::from_be_bytes } else { u32::from_le_bytes };
        let contents = records(bytes, small).unwrap_or_else(|| bytes.to_vec());
        let whole = |k: usize| {
            let four = contents.get(4 * k..4 * k + 4)?;
            Some(small(four.try_into().ok()?) as usize)
        };
        for width in [8, 4] {
            let number = |first: usize, k: usize| {
                let from = 4 * first + width * k;
                let mut bytes: Vec<u8> = contents[from..from + width].to_vec();
                if reverses {
                    bytes.reverse();
                }
                match *bytes {
                    [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
                    [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
                    _ => f64::NAN,
                }
            };
            for first in 2..=4 {
                let left = contents.len().checked_sub(4 * first);
                let count = left.filter(|left| left % width == 0).map(|left| left / width);
                let found = block(&whole, &|head| count.filter(|_| head == first), &|k| number(first, k - first));
                if let Some(found) = found {
                    return Ok(found);
                }
            }
        }
    }
    Err(not_plot3d(bytes.len()))
}

fn not_plot3d(count: usize) -> String {
    format!(
        "is not one block of PLOT3D in the plane: [1] ni nj [1], then ni × nj values of x, of y and perhaps of z, make \
         no sense of its {count} numbers or bytes"
    )
}

/// One block of PLOT3D: a head of whole numbers, then all x, all y and perhaps all z, the first axis fastest. `left`
/// says how many numbers follow a head of so many.
fn block(
    whole: &dyn Fn(usize) -> Option<usize>,
    left: &dyn Fn(usize) -> Option<usize>,
    number: &dyn Fn(usize) -> f64,
) -> Option<GivenMesh> {
    // with the number of blocks or without, in the plane or one layer of space
    for (first, third) in [(0, false), (0, true), (1, false), (1, true)] {
        if first == 1 && whole(0) != Some(1) || third && whole(first + 2) != Some(1) {
            continue;
        }
        let (Some(n), Some(m)) = (whole(first), whole(first + 1)) else { continue };
        let head = first + 2 + usize::from(third);
        let (Some(count), Some(all)) = (n.checked_mul(m), left(head)) else { continue };
        if count > 0 && (all == count.saturating_mul(2) || third && all == count.saturating_mul(3)) {
            return Some(first_fastest([n, m], |k| [number(head + k), number(head + count + k)]));
        }
    }
    None
}

/// What is in the records of a Fortran file, each between two numbers that say its length; nothing where these do not.
fn records(bytes: &[u8], small: fn([u8; 4]) -> u32) -> Option<Vec<u8>> {
    let length = |at: usize| Some(small(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    let (mut contents, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let size = length(at)?;
        let end = at.checked_add(4)?.checked_add(size)?;
        contents.extend_from_slice(bytes.get(at + 4..end)?);
        if length(end)? != size {
            return None;
        }
        at = end + 4;
    }
    Some(contents)
}
