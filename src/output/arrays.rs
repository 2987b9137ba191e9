use crate::simulation::{Scene, Values};
use ndarray::{Array2, arr0};
use ndarray_npy::{NpzWriter, WriteNpzError};
use std::io::Cursor;

/// A scene as the bytes of an `.npz` file: `x`, `y` and the numbers at the nodes of shape cells + 1, and `t`.
pub fn final_arrays(scene: &Scene) -> Vec<u8> {
    let [n, m] = scene.cells.map(|n| n + 1);
    let array = |values: Vec<f64>| Array2::from_shape_vec((n, m), values).expect("closed arrays have shape cells + 1");
    let write = || -> Result<Vec<u8>, WriteNpzError> {
        let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
        npz.add_array("x", &array(scene.points.iter().map(|x| x[0]).collect()))?;
        npz.add_array("y", &array(scene.points.iter().map(|x| x[1]).collect()))?;
        for (name, values) in &scene.nodal {
            if let Values::Scalars(values) = values {
                npz.add_array(name.as_str(), &array(values.clone()))?;
            }
        }
        npz.add_array("t", &arr0(scene.t))?;
        Ok(npz.finish()?.into_inner())
    };
    write().expect("writing to memory cannot fail")
}
