use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{Compression, write::ZlibEncoder};
use std::fmt::Write;
use std::io::Write as _;

/// VTK's number of the quadrilateral.
const QUAD: u8 = 9;

/// An unstructured grid of quadrilaterals as a `.vtu` file with compressed inline arrays.
///
/// `points` has shape cells + 1 in lattice order, and so has each of `fields`.
pub(super) fn document(cells: [usize; 2], points: &[[f64; 2]], fields: &[(&str, Vec<f64>)]) -> String {
    let count = cells[0] * cells[1];
    let row = cells[1] + 1;
    let corners = (0..cells[0]).flat_map(|i| {
        (0..cells[1]).flat_map(move |j| {
            let k = (i * row + j) as u64;
            let row = row as u64;
            [k, k + row, k + row + 1, k + 1]
        })
    });
    let mut xml = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n<UnstructuredGrid>\n",
    );
    let mut line = |text: String| {
        xml.push_str(&text);
        xml.push('\n');
    };
    line(format!("<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{count}\">", points.len()));
    line("<Points>".into());
    line(array("Float64", "Points", 3, points.iter().flat_map(|p| [p[0], p[1], 0.0]).flat_map(f64::to_le_bytes)));
    line("</Points>\n<Cells>".into());
    line(array("Int64", "connectivity", 1, corners.flat_map(u64::to_le_bytes)));
    line(array("Int64", "offsets", 1, (1..=count as u64).flat_map(|n| (4 * n).to_le_bytes())));
    line(array("UInt8", "types", 1, std::iter::repeat_n(QUAD, count)));
    line("</Cells>\n<PointData>".into());
    for (name, values) in fields {
        line(array("Float64", &escape(name), 1, values.iter().flat_map(|v| v.to_le_bytes())));
    }
    line("</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>".into());
    xml
}

/// One array: a header of block count, block size, last block size and compressed size, then the one block.
fn array(kind: &str, name: &str, components: usize, bytes: impl Iterator<Item = u8>) -> String {
    let bytes: Vec<u8> = bytes.collect();
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    let compressed = encoder.write_all(&bytes).and_then(|()| encoder.finish()).expect("writing to memory cannot fail");
    let size = bytes.len() as u64;
    let header: Vec<u8> = [1, size, size, compressed.len() as u64].into_iter().flat_map(u64::to_le_bytes).collect();
    let mut text = String::new();
    let parts = if components > 1 { format!(" NumberOfComponents=\"{components}\"") } else { String::new() };
    let _ = write!(text, "<DataArray type=\"{kind}\" Name=\"{name}\"{parts} format=\"binary\">");
    STANDARD.encode_string(header, &mut text);
    STANDARD.encode_string(compressed, &mut text);
    text.push_str("</DataArray>");
    text
}

/// A name as an attribute value.
fn escape(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
