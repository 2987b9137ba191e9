//! Formulas of a few variables, with exact derivatives of any order.
//!
//! A [`Formula`] is parsed from text with the names of its variables: `x y t` for a prescribed field, `u v x y t` for a
//! PDE, `x` for a density. A [`Program`] evaluates several formulas at many points and computes common parts once.
//!
//! | | |
//! |---|---|
//! | numbers | `1`, `.5`, `1e-3`, `2.5E+4`; the constants `pi` and `e` |
//! | operators | `+ - * / ^ ( )`; `^` binds tighter than a sign, and to the right: `-2^2` is -4, `2^3^2` is 512 |
//! | functions | `sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs erf floor min max`; `log` is to base e |
//! | angles | `atan2(y, x)` is the angle of the point (x, y), from −π to π |
//! | tables | a [`Table`] is a function by its name within [`with_tables`] |
//! | remainders | `mod(a, b)` is a − b ⌊a/b⌋, which has the sign of b: `mod(-1, 3)` is 2, `mod(1, -3)` is -2 |
//! | cases | `if(x < 0, a, b)`, with one of `< <= > >= == !=` in its first place and nowhere else |
//!
//! Arithmetic is that of `f64`: `1/0` is infinite, `sqrt(-1)` is NaN, and NaN passes through `min` and `max` too.
//! Powers with whole exponents up to 32 are products, so that `x^2` is exact for negative `x`.
//!
//! # Derivatives
//!
//! Derivatives are formulas again. Where a function has none, a side is chosen: |f|′ = 0 at f = 0; `min`, `max` and
//! `if` have the derivative of the branch that is taken, and `min` and `max` of equal arguments that of the first one;
//! `floor(f)` has 0 everywhere, and `mod(f, g)` has f′ − ⌊f/g⌋ g′, also where they jump.
//!
//! ```text
//! (fᶜ)′ = c fᶜ⁻¹ f′,   (f^g)′ = g f^(g−1) f′ + f^g log(f) g′
//! ```
//!
//! The second rule applies only where g depends on the variable; its last term is 0 where f^g is. Terms that do not
//! depend on the variable are dropped, even where they would multiply an infinite value.

mod derivative;
mod graph;
mod parse;
mod program;
mod table;
mod tokens;

#[cfg(test)]
mod tests;

pub use program::Program;
pub use table::{Interpolation, Table, with_tables};

use crate::error::Error;
use graph::{Graph, Node};
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// Longest text that is parsed, in bytes.
pub const MAX_LENGTH: usize = 10_000;
/// Deepest nesting of parentheses, signs and powers: the parser calls itself for each.
pub const MAX_DEPTH: usize = 100;
/// Largest number of operations in a derivative, with equal ones counted once.
pub const MAX_OPERATIONS: usize = 100_000;

/// What is wrong with a formula, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Mistake {
    /// What is wrong.
    pub message: String,
    /// The bytes of the text to point at, on character boundaries; empty where no part of the text is wrong.
    pub at: Range<usize>,
    /// The remedy, where there is one.
    pub help: Option<String>,
}

impl Mistake {
    /// The error of a setting with this text.
    pub(crate) fn of(self, key: &str, text: &str) -> Error {
        let Self { message, at, help } = self;
        Error::Formula { key: key.into(), text: text.into(), at, message, help }
    }

    fn new(at: Range<usize>, message: impl Into<String>) -> Self {
        Self { message: message.into(), at, help: None }
    }

    fn help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }
}

/// A formula of named variables
///
/// # Example
/// ```
/// use driftmesh::formula::Formula;
/// let u = Formula::parse("x^2*y + sin(t)", &["x", "y", "t"])?;
/// assert_eq!(u.eval(&[-3.0, 2.0, 0.0]), 18.0);
/// // u_x = 2xy, u_xx = 2y
/// let u_x = u.derivative(0)?;
/// assert_eq!(u_x.eval(&[-3.0, 2.0, 0.0]), -12.0);
/// assert_eq!(u_x.derivative(0)?.eval(&[-3.0, 2.0, 0.0]), 4.0);
/// assert_eq!(u_x.to_string(), "∂/∂x (x^2*y + sin(t))");
///
/// let mistake = Formula::parse("2x + y", &["x", "y"]).unwrap_err();
/// assert_eq!((mistake.at, mistake.help.unwrap().as_str()), (0..2, "write 2*x"));
/// # Ok::<(), driftmesh::formula::Mistake>(())
/// ```
#[derive(Debug, Clone)]
pub struct Formula {
    text: String,
    variables: Vec<String>,
    /// Variables by which it was differentiated, in that order.
    by: Vec<usize>,
    /// Operands before operations; the last one is the value.
    nodes: Vec<Node>,
    tables: Vec<Arc<Table>>,
}

impl Formula {
    /// Reads a formula of the given variables.
    ///
    /// # Errors
    /// A [`Mistake`] where the text is no formula, is longer than [`MAX_LENGTH`] or nested deeper than [`MAX_DEPTH`];
    /// also where the name of a variable is not a name, occurs twice, or is that of a function or constant (`at` is
    /// then empty).
    pub fn parse(text: &str, variables: &[&str]) -> Result<Self, Mistake> {
        let (graph, root) = parse::parse(text, variables)?;
        let variables = variables.iter().map(|name| name.to_string()).collect();
        let (nodes, tables) = (graph.only(root), graph.tables().to_vec());
        Ok(Self { text: text.into(), variables, by: Vec::new(), nodes, tables })
    }

    /// The text that was parsed. A derivative has the text of the original formula.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The names of its variables, in the order of their values.
    pub fn variables(&self) -> &[String] {
        &self.variables
    }

    /// Whether the formula contains the variable: `0*x` does, and the derivative of `3*x` by `x` does not.
    pub fn depends_on(&self, variable: usize) -> bool {
        self.nodes.iter().any(|node| matches!(node, Node::Variable(v) if *v as usize == variable))
    }

    /// The numbers that the formula names, and those that follow from them alone.
    pub(crate) fn constants(&self) -> impl Iterator<Item = f64> {
        self.nodes.iter().filter_map(|node| match node {
            Node::Constant(bits) => Some(f64::from_bits(*bits)),
            _ => None,
        })
    }

    /// The partial derivative by a variable, given by its place in [`Formula::variables`].
    ///
    /// # Errors
    /// A [`Mistake`] if it takes more than [`MAX_OPERATIONS`], or if there is no such variable.
    pub fn derivative(&self, variable: usize) -> Result<Self, Mistake> {
        let Some(name) = self.variables.get(variable) else {
            let message = format!("there is no variable {variable} of {}", self.variables.len());
            return Err(Mistake::new(0..0, message));
        };
        let mut graph = Graph::default();
        graph.import(&self.nodes, &self.tables);
        let Some(root) = graph.derivative(variable as u32) else {
            let message = format!("the derivative by {name} takes more than {MAX_OPERATIONS} operations");
            return Err(Mistake::new(0..self.text.len(), message).help("write a shorter formula"));
        };
        let by = self.by.iter().copied().chain([variable]).collect();
        let (text, variables, tables) = (self.text.clone(), self.variables.clone(), self.tables.clone());
        Ok(Self { by, nodes: graph.only(root), text, variables, tables })
    }

    /// The value at one point; a variable without a value counts as NaN. A [`Program`] is faster for many points.
    pub fn eval(&self, values: &[f64]) -> f64 {
        let (mut small, mut large) = ([0.0; 64], Vec::new());
        let done = match small.get_mut(..self.nodes.len()) {
            Some(done) => done,
            None => {
                large.resize(self.nodes.len(), 0.0);
                large.as_mut_slice()
            }
        };
        for (k, node) in self.nodes.iter().enumerate() {
            let (done, to) = done.split_at_mut(k);
            match *node {
                Node::Variable(v) => to[0] = values.get(v as usize).copied().unwrap_or(f64::NAN),
                node => program::step(node, done, 1, &mut to[..1], &self.tables),
            }
        }
        done.last().copied().unwrap_or(f64::NAN)
    }
}

/// The text, a derivative with the variables it was taken by in front: `∂/∂y ∂/∂x (x*y)`.
impl fmt::Display for Formula {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.by.is_empty() {
            return f.write_str(&self.text);
        }
        self.by.iter().rev().try_for_each(|&variable| write!(f, "∂/∂{} ", self.variables[variable]))?;
        write!(f, "({})", self.text)
    }
}

/// Formulas are equal if they are written alike: the same text, variables and derivatives.
impl PartialEq for Formula {
    fn eq(&self, other: &Self) -> bool {
        (&self.text, &self.variables, &self.by) == (&other.text, &other.variables, &other.by)
    }
}
