use super::words::{indices, place};
use std::fmt;

/// A node of a mesh, and where it is.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodePlace {
    /// Its indices, one for each axis.
    pub node: Box<[usize]>,
    /// Its coordinates, one for each axis.
    pub x: Box<[f64]>,
}

impl NodePlace {
    /// A node by its indices and coordinates.
    pub fn new(node: impl Into<Box<[usize]>>, x: impl Into<Box<[f64]>>) -> Self {
        Self { node: node.into(), x: x.into() }
    }
}

impl fmt::Display for NodePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "node {}, {}", indices(&self.node), place(&self.x))
    }
}
