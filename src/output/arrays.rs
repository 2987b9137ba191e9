use crate::simulation::State;
use ndarray::{Array2, arr0};
use ndarray_npy::{NpzWriter, WriteNpzError};
use std::io::Cursor;

/// The last state as the bytes of an `.npz` file: `x`, `y` and the unknowns of shape cells + 1, and `t`.
pub fn final_arrays(unknowns: &[String], state: &State) -> Vec<u8> {
    let lattice = state.mesh.lattice();
    let [n, m] = lattice.cells().map(|n| n + 1);
    let array = |values: Vec<f64>| Array2::from_shape_vec((n, m), values).expect("closed arrays have shape cells + 1");
    let write = || -> Result<Vec<u8>, WriteNpzError> {
        let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
        let x = state.mesh.closed();
        npz.add_array("x", &array(x.iter().map(|x| x[0]).collect()))?;
        npz.add_array("y", &array(x.iter().map(|x| x[1]).collect()))?;
        for (c, name) in unknowns.iter().enumerate() {
            let values: Vec<f64> = state.u.component(c).collect();
            npz.add_array(name.as_str(), &array(lattice.closed(&values).into_owned()))?;
        }
        npz.add_array("t", &arr0(state.t))?;
        Ok(npz.finish()?.into_inner())
    };
    write().expect("writing to memory cannot fail")
}
