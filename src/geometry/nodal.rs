//! Checks of arrays that hold one value for each node.

use super::{Lattice, Mesh};
use crate::error::Failure;

/// Refuses an array whose length is not the number of nodes.
pub(crate) fn check_length<const D: usize>(
    lattice: &Lattice<D>,
    what: &'static str,
    found: usize,
) -> Result<(), Failure> {
    match found == lattice.len() {
        true => Ok(()),
        false => Err(Failure::WrongLength { what, found, expected: lattice.len() }),
    }
}

/// Refuses values that are not finite, K for each node, by the names of these.
pub(crate) fn check_finite<const D: usize, const K: usize>(
    what: [&'static str; K],
    mesh: &Mesh<D>,
    values: &[[f64; K]],
) -> Result<(), Failure> {
    match values.as_flattened().iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(place) => {
            let (k, c) = (place / K, place % K);
            let at = mesh.node_place(k);
            Err(Failure::NonFinite { what: what[c], value: values[k][c], at })
        }
    }
}

/// Refuses an array whose length is not the number of nodes, and values that are not finite or not above 0.
pub(crate) fn check_positive<const D: usize>(
    mesh: &Mesh<D>,
    what: &'static str,
    values: &[f64],
) -> Result<(), Failure> {
    let Some(k) = values.iter().position(|value| !(value.is_finite() && *value > 0.0)) else { return Ok(()) };
    let (value, at) = (values[k], mesh.node_place(k));
    Err(match value.is_finite() {
        true => Failure::NotPositive { what, value, at },
        false => Failure::NonFinite { what, value, at },
    })
}
