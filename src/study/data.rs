//! `[data]`: tables of values that formulas name as functions.

use crate::error::{Error, Result};
use crate::formula::{Interpolation, Table, with_tables};
use crate::ranks::Ranks;
use ndarray::{ArrayD, IxDyn, OwnedRepr};
use ndarray_npy::ReadNpyExt;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// `[data]`: tables from files, by the names under which every formula of the study may call them.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct DataTables {
    files: BTreeMap<String, TableFile>,
    /// What is in the files, once they are read.
    #[serde(skip)]
    #[schemars(skip)]
    tables: Vec<Arc<Table>>,
}

/// A file with values at places: its name, or a table with the keys below.
#[derive(Debug, Clone, PartialEq)]
pub struct TableFile {
    /// `.csv` with the columns place and value, or with a raster; or `.npy`. A path that is not absolute begins where
    /// the study file lies.
    pub file: PathBuf,
    /// 1, linear between two places, or 3, cubics that do not leave the range of the values around.
    pub order: u8,
    /// The first place along each axis of values at equal distances: one number, or two for a raster.
    pub lower: Option<Vec<f64>>,
    /// The last place along each axis of values at equal distances.
    pub upper: Option<Vec<f64>>,
    /// What was in the file, as a checksum, which a study has that was run: another file is refused.
    pub content: Option<String>,
}

/// The keys of a table in `[data]`.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TableKeys {
    /// `.csv` with the columns place and value, or with a raster: a line for each place along x, with the values along
    /// y. Or `.npy`, such an array. A path that is not absolute begins where the study file lies.
    file: String,
    /// 1, linear between two places (the default), or 3, monotone cubics.
    #[serde(default = "linear")]
    order: u8,
    /// The first place along each axis, for values at equal distances: one number, or two for a raster.
    #[serde(default)]
    lower: Option<Places>,
    /// The last place along each axis, for values at equal distances: one number, or two for a raster.
    #[serde(default)]
    upper: Option<Places>,
    /// A checksum of the file, which the study of a run directory has: a file that changed is then refused.
    #[serde(default)]
    content: Option<String>,
}

fn linear() -> u8 {
    1
}

/// A number, or one for each axis.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a number, or one for each axis such as [0.0, 0.0]")]
enum Places {
    One(f64),
    Each(Vec<f64>),
}

impl From<Places> for Vec<f64> {
    fn from(places: Places) -> Self {
        match places {
            Places::One(place) => vec![place],
            Places::Each(places) => places,
        }
    }
}

impl<'de> Deserialize<'de> for TableFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = TableKeys;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a file, or a table such as { file = \"bed.csv\", order = 3 }")
            }

            fn visit_str<E: de::Error>(self, file: &str) -> Result<TableKeys, E> {
                Ok(TableKeys { file: file.into(), order: linear(), lower: None, upper: None, content: None })
            }

            fn visit_map<A: de::MapAccess<'de>>(self, map: A) -> Result<TableKeys, A::Error> {
                TableKeys::deserialize(de::value::MapAccessDeserializer::new(map))
            }
        }
        let TableKeys { file, order, lower, upper, content } = deserializer.deserialize_any(Visitor)?;
        let [lower, upper] = [lower, upper].map(|places| places.map(Vec::from));
        Ok(Self { file: file.into(), order, lower, upper, content })
    }
}

impl Serialize for TableFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("file", &self.file.to_string_lossy())?;
        map.serialize_entry("order", &self.order)?;
        for (key, places) in [("lower", &self.lower), ("upper", &self.upper)] {
            places.iter().try_for_each(|places| map.serialize_entry(key, places))?;
        }
        self.content.iter().try_for_each(|content| map.serialize_entry("content", content))?;
        map.end()
    }
}

impl JsonSchema for TableFile {
    fn schema_name() -> Cow<'static, str> {
        "TableFile".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let keys = generator.subschema_for::<TableKeys>();
        json_schema!({ "anyOf": [{ "type": "string", "description": "A file with values at places." }, keys] })
    }
}

/// Largest file that is read.
const MOST_BYTES: u64 = 1 << 30;
/// Characters of a checksum that are kept.
const CHECKSUM: usize = 16;

impl DataTables {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// Lets paths that are not absolute begin in a directory.
    pub(super) fn lie_in(&mut self, directory: &Path) {
        self.files.values_mut().for_each(|table| table.file = directory.join(&table.file));
    }

    /// Reads the files, unless that is done, and notes what is in them.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the key of the first table that cannot be one.
    pub(super) fn load(&mut self) -> Result<()> {
        if self.tables.len() == self.files.len() {
            return Ok(());
        }
        let load = |(name, of): (&String, &mut TableFile)| of.load(name).map(Arc::new);
        self.tables = self.files.iter_mut().map(load).collect::<Result<_>>()?;
        Ok(())
    }

    /// Reads formulas that may name the tables.
    pub(super) fn known<R>(&self, read: impl FnOnce() -> R) -> R {
        with_tables(&self.tables, read)
    }

    /// Says so where a formula asked beyond the ends of a table.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut said = Vec::new();
        for table in &self.tables {
            for (axis, far) in table.outside().into_iter().enumerate() {
                let (range, name) = (table.range(axis), table.name());
                for (end, place) in far.into_iter().enumerate() {
                    let Some(place) = place else { continue };
                    let word = ["first", "last"][end];
                    let which = if table.axes() == 1 { "" } else { [" along x", " along y"][axis] };
                    said.push(format!(
                        "`data.{name}` reaches from {:?} to {:?}{which}, and formulas asked for {place:?}: beyond its \
                         ends its {word} value counts",
                        range[0], range[1]
                    ));
                }
            }
        }
        said
    }
}

impl TableFile {
    fn load(&mut self, name: &str) -> Result<Table> {
        let key = format!("data.{name}");
        let shown = format!("{:?}", self.file.display().to_string());
        let wrong = |rule: String| Error::invalid(key.as_str(), &shown, rule);
        let interpolation = match self.order {
            1 => Interpolation::Linear,
            3 => Interpolation::Monotone,
            order => {
                let rule = "must be 1, linear between two places, or 3, for monotone cubics";
                return Err(Error::invalid(format!("{key}.order"), order, rule));
            }
        };
        let bytes = bytes_of(&self.file).map_err(wrong)?;
        let content = blake3::hash(&bytes).to_hex()[..CHECKSUM].to_string();
        if let Some(before) = self.content.as_ref().filter(|before| **before != content) {
            let rule = format!(
                "the file {} is another one now, {content}; put the former one back, or leave `content` out",
                self.file.display()
            );
            return Err(Error::invalid(format!("{key}.content"), format!("{before:?}"), rule));
        }
        self.content = Some(content);
        let extension = self.file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let rows = match extension.as_str() {
            "npy" => rows_of_npy(&bytes),
            "csv" | "txt" | "dat" => rows_of_csv(&bytes),
            _ => Err("has none of the endings .csv and .npy, which say what is in it".into()),
        };
        let (places, values) = rows.and_then(|rows| self.placed(rows)).map_err(wrong)?;
        Table::new(name, places, values, interpolation).map_err(|what| match what.contains("the table `") {
            true => Error::invalid(key.as_str(), "given", format!("{what}; take another name")),
            false => wrong(what),
        })
    }

    /// Places and values, from the rows of a file.
    fn placed(&self, rows: Vec<Vec<f64>>) -> Result<(Vec<Vec<f64>>, Vec<f64>), String> {
        let (count, width) = (rows.len(), rows.first().map_or(0, Vec::len));
        if let Some(k) = rows.iter().position(|row| row.len() != width) {
            return Err(format!("has {} numbers in row {}, and {width} in the first one", rows[k].len(), k + 1));
        }
        let ends = match (&self.lower, &self.upper) {
            (None, None) if width == 2 => {
                let column = |c: usize| rows.iter().map(|row| row[c]).collect::<Vec<f64>>();
                return Ok((vec![column(0)], column(1)));
            }
            (None, None) => {
                return Err(format!(
                    "has {count} rows of {width} numbers: without `lower` and `upper` it needs two columns, place and \
                     value; for a raster give both, as lower = [0.0, 0.0], upper = [1.0, 1.0]"
                ));
            }
            (Some(lower), Some(upper)) => [lower, upper],
            _ => return Err("has one of `lower` and `upper`; give both, or leave both out".into()),
        };
        let nodes = match [ends[0].len(), ends[1].len()] {
            [1, 1] if width == 1 || count == 1 => vec![count * width],
            [2, 2] => vec![count, width],
            [1, 1] => {
                return Err(format!(
                    "has {count} rows of {width} numbers, which is a raster; give two numbers in `lower` and `upper`"
                ));
            }
            [a, b] => return Err(format!("has {a} numbers in `lower` and {b} in `upper`, where both need one or two")),
        };
        let mut places = Vec::new();
        for (axis, nodes) in nodes.into_iter().enumerate() {
            let [low, high] = ends.map(|ends| ends[axis]);
            if !(low.is_finite() && high.is_finite() && low < high) {
                return Err(format!("reaches from `lower` {low:?} to `upper` {high:?}, which must be above"));
            }
            if nodes < 2 {
                return Err(format!("has {count} rows of {width} numbers, and needs two or more along each axis"));
            }
            let last = (nodes - 1) as f64;
            places.push((0..nodes).map(|k| low + (high - low) * (k as f64 / last)).collect());
        }
        Ok((places, rows.concat()))
    }
}

/// The bytes of a file, which rank 0 reads and sends to the others.
fn bytes_of(path: &Path) -> Result<Vec<u8>, String> {
    Ranks::here().from_first(|| read(path))
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    let about = std::fs::metadata(path).map_err(|error| format!("cannot be read: {error}"))?;
    if !about.is_file() {
        return Err("is no file".into());
    }
    if about.len() > MOST_BYTES {
        return Err(format!("has {} bytes, and at most {MOST_BYTES} are read", about.len()));
    }
    std::fs::read(path).map_err(|error| format!("cannot be read: {error}"))
}

/// The numbers of a text whose columns commas, semicolons or tabs separate. The first line may name them.
fn rows_of_csv(bytes: &[u8]) -> Result<Vec<Vec<f64>>, String> {
    let separator = [b';', b'\t', b','].into_iter().find(|separator| bytes.contains(separator)).unwrap_or(b',');
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(separator)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(bytes);
    let mut rows = Vec::new();
    for (n, record) in reader.records().enumerate() {
        let record = record.map_err(|error| format!("is no table of numbers: {error}"))?;
        let line = record.position().map_or(n as u64 + 1, csv::Position::line);
        let numbers: Vec<Result<f64, _>> = record.iter().map(|entry| entry.parse::<f64>()).collect();
        match numbers.iter().position(Result::is_err) {
            None => rows.push(numbers.into_iter().flatten().collect()),
            // names of the columns
            Some(_) if n == 0 && numbers.iter().all(Result::is_err) => {}
            Some(k) => return Err(format!("has {:?} in line {line}, where a number should stand", &record[k])),
        }
    }
    match rows.is_empty() {
        true => Err("has no numbers".into()),
        false => Ok(rows),
    }
}

/// The rows of an array of float64 or float32.
fn rows_of_npy(bytes: &[u8]) -> Result<Vec<Vec<f64>>, String> {
    type Wide = ndarray::ArrayBase<OwnedRepr<f64>, IxDyn>;
    type Narrow = ndarray::ArrayBase<OwnedRepr<f32>, IxDyn>;
    let array: ArrayD<f64> = match Wide::read_npy(bytes) {
        Ok(array) => array,
        Err(error) => match Narrow::read_npy(bytes) {
            Ok(array) => array.mapv(f64::from),
            Err(_) => return Err(format!("is no array of float64 or float32: {error}")),
        },
    };
    match *array.shape() {
        [_] => Ok(array.iter().map(|value| vec![*value]).collect()),
        [_, width] if width > 0 => {
            let values: Vec<f64> = array.iter().copied().collect();
            Ok(values.chunks(width).map(<[f64]>::to_vec).collect())
        }
        ref shape => Err(format!("has an array of shape {shape:?}, where one or two axes are needed")),
    }
}
