use crate::error::Failure;

/// One or more unknowns at every node of a lattice
///
/// The values of one node stand together: component c of node k is `values[k * components + c]`. A scalar field is
/// therefore simply one value a node in lattice order.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    components: usize,
    values: Vec<f64>,
}

impl Field {
    /// A field of one unknown.
    pub fn scalar(values: Vec<f64>) -> Self {
        Self { components: 1, values }
    }

    /// A field of K unknowns from their values at every node.
    ///
    /// # Example
    /// ```
    /// let field = driftmesh::geometry::Field::nodal(vec![[1.0, 2.0], [3.0, 4.0]]);
    /// assert_eq!(field.component(1).collect::<Vec<_>>(), [2.0, 4.0]);
    /// ```
    pub fn nodal<const K: usize>(values: Vec<[f64; K]>) -> Self {
        Self { components: K, values: values.into_flattened() }
    }

    /// A field of a number of unknowns from all values, node by node.
    ///
    /// # Example
    /// ```
    /// let field = driftmesh::geometry::Field::of(2, vec![1.0, 2.0, 3.0, 4.0])?;
    /// assert_eq!(field.component(1).collect::<Vec<_>>(), [2.0, 4.0]);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Failure::OutOfRange`] where the number of values is no multiple of the number of unknowns, or that is 0.
    pub fn of(components: usize, values: Vec<f64>) -> Result<Self, Failure> {
        if components == 0 || !values.len().is_multiple_of(components) {
            let rule = format!("{} values must be as many for every node", values.len());
            return Err(Failure::OutOfRange {
                what: "the number of unknowns".into(),
                value: components.to_string(),
                rule,
            });
        }
        Ok(Self { components, values })
    }

    /// A field from the values of each unknown at all nodes.
    ///
    /// # Example
    /// ```
    /// let field = driftmesh::geometry::Field::joined(&[vec![1.0, 3.0], vec![2.0, 4.0]])?;
    /// assert_eq!(field.values(), [1.0, 2.0, 3.0, 4.0]);
    /// # Ok::<(), driftmesh::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Failure::WrongLength`] where an unknown has another number of nodes than the first.
    pub fn joined(unknowns: &[Vec<f64>]) -> Result<Self, Failure> {
        let nodes = unknowns.first().map_or(0, Vec::len);
        if let Some(other) = unknowns.iter().find(|values| values.len() != nodes) {
            return Err(Failure::WrongLength { what: "an unknown", found: other.len(), expected: nodes });
        }
        let values = (0..nodes).flat_map(|k| unknowns.iter().map(move |values| values[k])).collect();
        Ok(Self { components: unknowns.len().max(1), values })
    }

    /// Number of unknowns at a node.
    pub fn components(&self) -> usize {
        self.components
    }

    /// All values, node by node.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The values of each node.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = &[f64]> + '_ {
        self.values.chunks_exact(self.components)
    }

    /// All values, to be changed.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// One unknown at all nodes.
    pub fn component(&self, c: usize) -> impl ExactSizeIterator<Item = f64> + '_ {
        self.values.iter().skip(c).step_by(self.components).copied()
    }
}

/// The largest |value|, computed in vectors. A NaN does not show in it.
#[inline(always)]
pub(crate) fn largest(values: &[f64]) -> f64 {
    let (lanes, rest) = values.as_chunks::<8>();
    let more = |m: f64, value: f64| if value.abs() > m { value.abs() } else { m };
    let most = lanes.iter().fold([0.0; 8], |m, values| std::array::from_fn(|l| more(m[l], values[l])));
    most.iter().chain(rest).fold(0.0, |m, &value| more(m, value))
}

#[cfg(test)]
mod tests {
    use super::largest;

    #[test]
    fn the_largest_is_found_wherever_it_stands() {
        for (length, place) in (1..30).flat_map(|length| (0..length).map(move |place| (length, place))) {
            let values: Vec<f64> = (0..length).map(|k| if k == place { -7.0 } else { k as f64 / 30.0 }).collect();
            assert_eq!(largest(&values), 7.0);
        }
        assert_eq!(largest(&[]), 0.0);
    }
}
