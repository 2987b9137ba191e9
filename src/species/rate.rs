use super::dual::Dual;
use crate::formula::{Formula, Mistake};

/// A formula with its exact derivatives by everything that it takes.
#[derive(Debug, Clone)]
pub struct Rate {
    formula: Formula,
    /// By each variable; none where the formula does not take it.
    partial: Vec<Option<Formula>>,
}

impl Rate {
    /// Differentiates a formula.
    ///
    /// # Errors
    /// As [`Formula::derivative`].
    pub fn new(formula: Formula) -> Result<Self, Mistake> {
        let by = |k: usize| formula.depends_on(k).then(|| formula.derivative(k)).transpose();
        Ok(Self { partial: (0..formula.variables().len()).map(by).collect::<Result<_, _>>()?, formula })
    }

    /// The formula.
    pub fn formula(&self) -> &Formula {
        &self.formula
    }

    /// Whether it is this number everywhere.
    pub fn is(&self, number: f64) -> bool {
        self.partial.iter().all(Option::is_none) && self.formula.eval(&[]) == number
    }

    pub(super) fn at(&self, given: &[Dual]) -> Dual {
        let values: Vec<f64> = given.iter().map(|given| given.value).collect();
        let moved = self.partial.iter().zip(given).filter(|(_, given)| given.slope != 0.0);
        let slope = moved.filter_map(|(by, given)| Some(by.as_ref()?.eval(&values) * given.slope)).sum();
        Dual { value: self.formula.eval(&values), slope }
    }
}
