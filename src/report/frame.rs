use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::read::ZlibDecoder;
use std::io::Read;
use std::path::Path;

/// A frame of a run: a mesh, and the fields on it.
#[derive(Debug, Clone)]
pub struct Frame {
    pub t: f64,
    /// Number of cells along both axes; 0 along the second axis of a line.
    pub cells: [usize; 2],
    /// Nodes, of shape cells + 1.
    pub x: Vec<[f64; 2]>,
    /// Values at the nodes, by name.
    pub fields: Vec<(String, Vec<f64>)>,
    /// Values in the cells of a line, by name. For other meshes they are computed from the nodes.
    pub cell_fields: Vec<(String, Vec<f64>)>,
    /// The nodes along each axis at which another subdomain begins.
    pub cuts: [Vec<usize>; 2],
}

impl Frame {
    /// Reads a `.vtu` file as runs write it.
    pub fn read(path: &Path, t: f64) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|error| error.to_string())?;
        let arrays: Vec<Array<'_>> = arrays(&text);
        let array = |section: &str, name: &str| {
            let found = arrays.iter().find(|array| array.section == section && array.name == name);
            found.ok_or(format!("it has no array {name:?}"))
        };
        let points = doubles(array("Points", "Points")?)?;
        let x: Vec<[f64; 2]> = points.chunks_exact(3).map(|p| [p[0], p[1]]).collect();
        // The first cell lists node (1, 0), the first one of the second row. Cells of a line have a node each.
        let row = integers::<8>(array("Cells", "connectivity")?, 2)?.get(1).copied().unwrap_or(0);
        let corners = integers::<8>(array("Cells", "offsets")?, 1)?.first().copied().unwrap_or(0);
        let fits = if corners == 2 { row == 1 } else { row > 1 };
        if !fits || x.len() < 2 * row || !x.len().is_multiple_of(row) {
            return Err("its nodes are not those of a structured mesh".into());
        }
        let cells = [x.len() / row - 1, row - 1];
        let scalars = |section: &str, count: usize| {
            let found = arrays.iter().filter(|array| array.section == section && array.scalar && array.real);
            let read = found.map(|array| match doubles(array)? {
                values if values.len() == count => Ok((array.name.clone(), values)),
                values => Err(format!("{:?} has {} values for {count} places", array.name, values.len())),
            });
            read.collect::<Result<Vec<_>, String>>()
        };
        let fields = scalars("PointData", x.len())?;
        let cell_fields = if corners == 2 { scalars("CellData", cells[0])? } else { Vec::new() };
        let values = fields.iter().chain(&cell_fields).flat_map(|(_, values)| values);
        if !x.as_flattened().iter().chain(values).all(|v| v.is_finite()) {
            return Err("it holds a value that is not finite".into());
        }
        let count = cells[0] * cells[1].max(1);
        // an unknown may have the name of a field
        let numbers = |name: &str| {
            let found = array("CellData", name).or_else(|_| array("CellData", &format!("{name} of cells")));
            found.and_then(|array| integers::<4>(array, count)).ok()
        };
        // subdomains of a line may overlap
        let overlap = numbers("overlap").filter(|more| more.len() == count).unwrap_or_else(|| vec![0; count]);
        let cuts = match numbers("subdomain").filter(|of| of.len() == count) {
            Some(subdomains) => cuts(cells, &subdomains.into_iter().zip(overlap).collect::<Vec<_>>()),
            None => Default::default(),
        };
        Ok(Self { t, cells, x, fields, cell_fields, cuts })
    }

    /// Whether both frames belong to one series: the same cells and fields.
    pub fn fits(&self, other: &Self) -> bool {
        let names = |frame: &Self| {
            frame.fields.iter().chain(&frame.cell_fields).map(|(name, _)| name.clone()).collect::<Vec<_>>()
        };
        self.cells == other.cells && names(self) == names(other)
    }
}

/// Indices along the first row and the first column at which the subdomain changes; 0 for a change across a periodic
/// axis.
fn cuts<T: PartialEq>([n, m]: [usize; 2], subdomains: &[T]) -> [Vec<usize>; 2] {
    let changes = |count: usize, stride: usize| {
        (0..count).filter(|&k| subdomains[k * stride] != subdomains[(k + count - 1) % count * stride]).collect()
    };
    [changes(n, m.max(1)), changes(m, 1)]
}

/// An array of a file, not yet decoded.
struct Array<'a> {
    section: &'a str,
    name: String,
    scalar: bool,
    /// Of floating point.
    real: bool,
    text: &'a str,
}

/// The arrays of a file that a run wrote, in which each stands on a line of its own.
fn arrays(text: &str) -> Vec<Array<'_>> {
    let mut section = "";
    let mut arrays = Vec::new();
    for line in text.lines() {
        match line.strip_prefix("<DataArray ").and_then(|line| line.strip_suffix("</DataArray>")?.split_once('>')) {
            Some((head, text)) => {
                let name = attribute(head, "Name").unwrap_or_default();
                let scalar = attribute(head, "NumberOfComponents").is_none();
                let real = attribute(head, "type").is_some_and(|kind| kind == "Float64");
                arrays.push(Array { section, name, scalar, real, text });
            }
            None => section = line.trim_start_matches('<').trim_end_matches('>'),
        }
    }
    arrays
}

/// An attribute of a tag.
pub fn attribute(tag: &str, name: &str) -> Option<String> {
    let (_, rest) = tag.split_once(&format!("{name}=\""))?;
    let (value, _) = rest.split_once('"')?;
    Some(value.replace("&quot;", "\"").replace("&lt;", "<").replace("&amp;", "&"))
}

fn doubles(array: &Array<'_>) -> Result<Vec<f64>, String> {
    let bytes = bytes(array, usize::MAX)?;
    Ok(bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes"))).collect())
}

/// The first `count` numbers, of N bytes each.
fn integers<const N: usize>(array: &Array<'_>, count: usize) -> Result<Vec<usize>, String> {
    let number = |b: &[u8]| b.iter().rev().fold(0, |n, &byte| n << 8 | usize::from(byte));
    Ok(bytes(array, N * count)?.chunks_exact(N).map(number).collect())
}

/// Decodes a block after a header of four numbers, up to a number of bytes.
fn bytes(array: &Array<'_>, most: usize) -> Result<Vec<u8>, String> {
    /// Letters of base64 that hold the header: four numbers of eight bytes.
    const HEADER: usize = 44;
    let damaged = |what: &str| format!("its array {:?} is damaged ({what})", array.name);
    let compressed = array.text.get(HEADER..).ok_or_else(|| damaged("too short"))?;
    let compressed = STANDARD.decode(compressed).map_err(|error| damaged(&error.to_string()))?;
    let mut bytes = Vec::new();
    let mut decoder = ZlibDecoder::new(compressed.as_slice()).take(most as u64);
    decoder.read_to_end(&mut bytes).map_err(|error| damaged(&error.to_string()))?;
    Ok(bytes)
}
