use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{Compression, write::ZlibEncoder};
use std::fmt::Write;
use std::io::Write as _;

/// VTK's number of the quadrilateral.
const QUAD: u8 = 9;

/// A named array with one value, or the two components of a vector, for each point or cell.
#[derive(Debug)]
pub(super) enum Values {
    Scalars(Vec<f64>),
    Vectors(Vec<[f64; 2]>),
    Numbers(Vec<usize>),
}

/// A series of unstructured grids of quadrilaterals over one lattice, as `.vtu` files with compressed inline arrays.
#[derive(Debug)]
pub(super) struct Grid {
    cells: [usize; 2],
    /// The cells of all documents.
    topology: String,
}

impl Grid {
    pub fn new(cells: [usize; 2]) -> Self {
        let (count, row) = (cells[0] * cells[1], cells[1] + 1);
        let corners = (0..cells[0]).flat_map(|i| (0..cells[1]).map(move |j| i * row + j));
        let connectivity = corners.flat_map(|k| [k, k + row, k + row + 1, k + 1]);
        let mut topology = String::from("<Cells>\n");
        array(&mut topology, "Int64", "connectivity", 1, connectivity.map(|k| (k as u64).to_le_bytes()));
        array(&mut topology, "Int64", "offsets", 1, (1..=count as u64).map(|n| (4 * n).to_le_bytes()));
        array(&mut topology, "UInt8", "types", 1, std::iter::repeat_n([QUAD], count));
        topology.push_str("</Cells>\n");
        Self { cells, topology }
    }

    /// One document: `points` and `nodes` have shape cells + 1 in lattice order, `cells` one value a cell.
    pub fn document(&self, points: &[[f64; 2]], nodes: &[(String, Values)], cells: &[(String, Values)]) -> String {
        let count = self.cells[0] * self.cells[1];
        let mut xml = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n<UnstructuredGrid>\n\
             <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{count}\">\n<Points>\n",
            points.len()
        );
        vectors(&mut xml, "Points", points);
        xml.push_str("</Points>\n");
        xml.push_str(&self.topology);
        for (tag, fields) in [("PointData", nodes), ("CellData", cells)] {
            let _ = writeln!(xml, "<{tag}>");
            for (name, values) in fields {
                match values {
                    Values::Scalars(v) => array(&mut xml, "Float64", name, 1, v.iter().map(|v| v.to_le_bytes())),
                    Values::Vectors(v) => vectors(&mut xml, name, v),
                    Values::Numbers(v) => {
                        array(&mut xml, "Int32", name, 1, v.iter().map(|n| (*n as i32).to_le_bytes()))
                    }
                }
            }
            let _ = writeln!(xml, "</{tag}>");
        }
        xml.push_str("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
        xml
    }
}

/// VTK's vectors have three components.
fn vectors(xml: &mut String, name: &str, values: &[[f64; 2]]) {
    let three = |v: &[f64; 2]| {
        let mut bytes = [0; 24];
        bytes[..8].copy_from_slice(&v[0].to_le_bytes());
        bytes[8..16].copy_from_slice(&v[1].to_le_bytes());
        bytes
    };
    array(xml, "Float64", name, 3, values.iter().map(three));
}

/// One array: a header of block count, block size, last block size and compressed size, then the one block.
fn array<const N: usize>(
    xml: &mut String,
    kind: &str,
    name: &str,
    components: usize,
    values: impl Iterator<Item = [u8; N]>,
) {
    let mut bytes = Vec::new();
    values.for_each(|value| bytes.extend_from_slice(&value));
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    let compressed = encoder.write_all(&bytes).and_then(|()| encoder.finish()).expect("writing to memory cannot fail");
    let size = bytes.len() as u64;
    let header: Vec<u8> = [1, size, size, compressed.len() as u64].into_iter().flat_map(u64::to_le_bytes).collect();
    let parts = if components > 1 { format!(" NumberOfComponents=\"{components}\"") } else { String::new() };
    let _ = write!(xml, "<DataArray type=\"{kind}\" Name=\"{}\"{parts} format=\"binary\">", escape(name));
    STANDARD.encode_string(header, xml);
    STANDARD.encode_string(compressed, xml);
    xml.push_str("</DataArray>\n");
}

/// A name as an attribute value.
fn escape(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
