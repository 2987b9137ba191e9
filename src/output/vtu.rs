use crate::simulation::{Scene, Values};
use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{Compression, write::ZlibEncoder};
use std::fmt::Write;
use std::io::Write as _;

/// VTK's numbers of the shapes of cells.
const LINE: u8 = 3;
const QUAD: u8 = 9;

/// A series of unstructured grids over one lattice, as `.vtu` files with compressed inline arrays.
#[derive(Debug)]
pub(crate) struct Grid {
    /// Number of cells of each document.
    count: usize,
    /// The text of the cells, which is the same in all documents.
    topology: String,
}

impl Grid {
    /// Quadrilaterals; pieces of a line where there are no cells along the second axis.
    pub fn new(cells: [usize; 2]) -> Self {
        let row = cells[1] + 1;
        match cells {
            [pieces, 0] => Self::of(LINE, (0..pieces).map(|k| [k, k + 1])),
            _ => {
                let corners = (0..cells[0]).flat_map(|i| (0..cells[1]).map(move |j| i * row + j));
                Self::of(QUAD, corners.map(|k| [k, k + row, k + row + 1, k + 1]))
            }
        }
    }

    /// Cells of one shape, by the nodes at their corners.
    fn of<const N: usize>(shape: u8, cells: impl Iterator<Item = [usize; N]> + Clone) -> Self {
        let count = cells.clone().count();
        let mut xml = Xml::of("<Cells>\n".into());
        xml.array("Int64", "connectivity", 1, cells.flatten().map(|k| (k as u64).to_le_bytes()));
        xml.array("Int64", "offsets", 1, (1..=count).map(|n| ((N * n) as u64).to_le_bytes()));
        xml.array("UInt8", "types", 1, std::iter::repeat_n([shape], count));
        Self { count, topology: xml.text + "</Cells>\n" }
    }

    /// One document.
    pub fn document(&self, scene: &Scene) -> String {
        let mut xml = Xml::of(format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n<UnstructuredGrid>\n\
             <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<Points>\n",
            scene.points.len(),
            self.count
        ));
        xml.vectors("Points", &scene.points);
        xml.text.push_str("</Points>\n");
        xml.text.push_str(&self.topology);
        for (tag, fields) in [("PointData", &scene.nodal), ("CellData", &scene.in_cells)] {
            let _ = writeln!(xml.text, "<{tag}>");
            for (name, values) in fields {
                xml.values(name, values);
            }
            let _ = writeln!(xml.text, "</{tag}>");
        }
        xml.text + "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
    }
}

/// A scene as one structured grid, a `.vts` file whose first axis is the first index of the arrays.
pub(crate) fn structured(scene: &Scene) -> String {
    let [n, m] = scene.cells;
    let mut xml = Xml::of(format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"StructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n\
         <StructuredGrid WholeExtent=\"0 {n} 0 {m} 0 0\">\n<Piece Extent=\"0 {n} 0 {m} 0 0\">\n<Points>\n"
    ));
    let nodes = [n + 1, m + 1];
    xml.vectors("Points", &first_fastest(&scene.points, nodes));
    xml.text.push_str("</Points>\n");
    for (tag, fields, size) in [("PointData", &scene.nodal, nodes), ("CellData", &scene.in_cells, [n, m])] {
        let _ = writeln!(xml.text, "<{tag}>");
        for (name, values) in fields {
            let values = match values {
                Values::Scalars(v) => Values::Scalars(first_fastest(v, size)),
                Values::Vectors(v) => Values::Vectors(first_fastest(v, size)),
                Values::Numbers(v) => Values::Numbers(first_fastest(v, size)),
            };
            xml.values(name, &values);
        }
        let _ = writeln!(xml.text, "</{tag}>");
    }
    xml.text + "</Piece>\n</StructuredGrid>\n</VTKFile>\n"
}

/// Values of an array whose last axis is the fastest, with the first one the fastest.
fn first_fastest<T: Copy>(values: &[T], [n, m]: [usize; 2]) -> Vec<T> {
    (0..m).flat_map(|j| (0..n).map(move |i| values[i * m + j])).collect()
}

/// The file that puts others in time.
pub(crate) fn collection(files: impl Iterator<Item = (f64, String)>) -> String {
    let entries: String = files.map(|(t, file)| format!("<DataSet timestep=\"{t}\" file=\"{file}\"/>\n")).collect();
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
         <Collection>\n{entries}</Collection>\n</VTKFile>\n"
    )
}

/// A document in the making. Its arrays share one compressor: a new one costs more than a small array.
struct Xml {
    text: String,
    encoder: ZlibEncoder<Vec<u8>>,
}

impl Xml {
    fn of(text: String) -> Self {
        Self { text, encoder: ZlibEncoder::new(Vec::new(), Compression::fast()) }
    }

    fn values(&mut self, name: &str, values: &Values) {
        match values {
            Values::Scalars(v) => self.array("Float64", name, 1, v.iter().map(|v| v.to_le_bytes())),
            Values::Vectors(v) => self.vectors(name, v),
            Values::Numbers(v) => self.array("Int32", name, 1, v.iter().map(|n| (*n as i32).to_le_bytes())),
        }
    }

    /// VTK's vectors have three components.
    fn vectors(&mut self, name: &str, values: &[[f64; 2]]) {
        let three = |v: &[f64; 2]| {
            let mut bytes = [0; 24];
            bytes[..8].copy_from_slice(&v[0].to_le_bytes());
            bytes[8..16].copy_from_slice(&v[1].to_le_bytes());
            bytes
        };
        self.array("Float64", name, 3, values.iter().map(three));
    }

    /// One array: a header of block count, block size, last block size and compressed size, then the one block.
    fn array<const N: usize>(
        &mut self,
        kind: &str,
        name: &str,
        components: usize,
        values: impl Iterator<Item = [u8; N]>,
    ) {
        let mut bytes = Vec::new();
        values.for_each(|value| bytes.extend_from_slice(&value));
        let written = self.encoder.write_all(&bytes).and_then(|()| self.encoder.reset(Vec::new()));
        let compressed = written.expect("writing to memory cannot fail");
        let size = bytes.len() as u64;
        let header: Vec<u8> = [1, size, size, compressed.len() as u64].into_iter().flat_map(u64::to_le_bytes).collect();
        let parts = if components > 1 { format!(" NumberOfComponents=\"{components}\"") } else { String::new() };
        let name = escape(name);
        let _ = write!(self.text, "<DataArray type=\"{kind}\" Name=\"{name}\"{parts} format=\"binary\">");
        STANDARD.encode_string(header, &mut self.text);
        STANDARD.encode_string(compressed, &mut self.text);
        self.text.push_str("</DataArray>\n");
    }
}

/// A name as an attribute value.
fn escape(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
