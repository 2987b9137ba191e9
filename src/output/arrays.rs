use crate::simulation::{Scene, Values};
use ndarray::{ArrayD, arr0};
use ndarray_npy::{NpzWriter, WriteNpzError};
use std::io::Cursor;

/// A scene as the bytes of an `.npz` file: `x`, `y` and the numbers at the nodes of shape cells + 1, and `t`. Arrays of
/// a line have one axis, and there is no `y`.
pub fn final_arrays(scene: &Scene) -> Vec<u8> {
    let [n, m] = scene.cells.map(|n| n + 1);
    let shape = if m == 1 { vec![n] } else { vec![n, m] };
    let array =
        |values: Vec<f64>| ArrayD::from_shape_vec(shape.clone(), values).expect("closed arrays have shape cells + 1");
    let write = || -> Result<Vec<u8>, WriteNpzError> {
        let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
        npz.add_array("x", &array(scene.points.iter().map(|x| x[0]).collect()))?;
        if m > 1 {
            npz.add_array("y", &array(scene.points.iter().map(|x| x[1]).collect()))?;
        }
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
