//! Formulas as a graph in which no two nodes are equal: repeated parts take memory and time once.

use super::program;
use super::table::Table;
use std::collections::HashMap;
use std::sync::Arc;

/// Index of a node. Operands stand before the operation, so that every traversal of a graph is a loop.
pub(super) type Id = u32;

/// Operations of one operand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Unary {
    Negate,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Log,
    Sqrt,
    Abs,
    Erf,
    Floor,
    /// −1, 0, 1 or NaN. It is not in the language, and only derivatives of `abs` contain it.
    Sign,
}

/// Operations of two operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Min,
    Max,
    /// With the sign of the second operand.
    Modulo,
    /// The angle of the point (second operand, first operand).
    Atan2,
}

/// The comparison in the first place of `if`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Comparison {
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    Unequal,
}

/// One operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Node {
    /// The bits of the number, which unlike the number can be hashed.
    Constant(u64),
    Variable(u32),
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    /// A power with a whole exponent, computed as a product.
    Power(Id, i32),
    /// Left and right side of the comparison, the value if it holds, and the value if not.
    Choice(Comparison, [Id; 4]),
    /// A table at a place, by its number, and how often it is differentiated along each of its axes. The operand of a
    /// table of one axis stands twice.
    Table(u32, [Id; 2], [u8; 2]),
}

/// Whole powers above this are computed by `powf`: a long product loses digits.
const MAX_PRODUCT: f64 = 32.0;

impl Node {
    /// This operation with each operand replaced by `to` of it.
    pub fn map(self, mut to: impl FnMut(Id) -> Id) -> Self {
        match self {
            Self::Constant(_) | Self::Variable(_) => self,
            Self::Unary(f, a) => Self::Unary(f, to(a)),
            Self::Binary(f, a, b) => Self::Binary(f, to(a), to(b)),
            Self::Power(a, n) => Self::Power(to(a), n),
            Self::Choice(c, ids) => Self::Choice(c, ids.map(to)),
            Self::Table(table, ids, orders) => Self::Table(table, ids.map(to), orders),
        }
    }

    /// Calls a function for each operand.
    pub fn each(self, mut visit: impl FnMut(Id)) {
        self.map(|id| {
            visit(id);
            id
        });
    }
}

/// The nodes in the order in which they were made, with an index to find equal ones.
#[derive(Default)]
pub(super) struct Graph {
    nodes: Vec<Node>,
    places: HashMap<Node, Id>,
    /// The tables that nodes name.
    tables: Vec<Arc<Table>>,
}

impl Graph {
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The tables that the nodes name.
    pub fn tables(&self) -> &[Arc<Table>] {
        &self.tables
    }

    /// Adds a table that nodes may name.
    pub fn know(&mut self, table: &Arc<Table>) {
        if !self.tables.iter().any(|known| known.number() == table.number()) {
            self.tables.push(table.clone());
        }
    }

    /// A number.
    pub fn constant(&mut self, value: f64) -> Id {
        self.place(Node::Constant(value.to_bits()))
    }

    /// The number that a node stands for, if it is a constant.
    pub fn value(&self, id: Id) -> Option<f64> {
        match self.nodes[id as usize] {
            Node::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Adds an operation, simplified where that changes no value. `0*x` and `x + 0` stay, because of NaN, ∞ and −0.
    pub fn push(&mut self, node: Node) -> Id {
        use Binary::{Divide, Multiply, Power, Subtract};
        if let Some(value) = self.folded(node) {
            return self.constant(value);
        }
        let number = |id| self.value(id);
        match node {
            Node::Binary(Multiply, a, b) | Node::Binary(Multiply, b, a) if number(b) == Some(1.0) => a,
            Node::Binary(Multiply, a, b) | Node::Binary(Multiply, b, a) if number(b) == Some(-1.0) => {
                self.push(Node::Unary(Unary::Negate, a))
            }
            Node::Binary(Divide, a, b) if number(b) == Some(1.0) => a,
            Node::Binary(Subtract, a, b) if number(b).is_some_and(|b| b.to_bits() == 0) => a,
            Node::Unary(Unary::Negate, a) => match self.nodes[a as usize] {
                Node::Unary(Unary::Negate, inner) => inner,
                _ => self.place(node),
            },
            Node::Binary(Power, a, b) => match number(b) {
                Some(n) if n.fract() == 0.0 && n.abs() <= MAX_PRODUCT => self.push(Node::Power(a, n as i32)),
                _ => self.place(node),
            },
            Node::Power(_, 0) => self.constant(1.0),
            Node::Power(a, 1) => a,
            Node::Choice(_, [_, _, a, b]) if a == b => a,
            Node::Choice(c, [l, r, a, b]) => match (number(l), number(r)) {
                (Some(l), Some(r)) if c.holds(l, r) => a,
                (Some(_), Some(_)) => b,
                _ => self.place(node),
            },
            _ => self.place(node),
        }
    }

    /// The value of an operation if all its operands are constants.
    fn folded(&self, node: Node) -> Option<f64> {
        let (mut operands, mut known) = (Vec::new(), true);
        let local = node.map(|id| {
            known &= self.value(id).is_some();
            operands.push(self.value(id).unwrap_or_default());
            operands.len() as Id - 1
        });
        let mut value = [0.0];
        (known && !operands.is_empty()).then(|| program::step(local, &operands, 1, &mut value, &self.tables))?;
        Some(value[0])
    }

    /// Adds a node without simplification, unless there is an equal one.
    fn place(&mut self, node: Node) -> Id {
        let node = match node {
            // a + b and b + a are the same to the last bit
            Node::Binary(f @ (Binary::Add | Binary::Multiply), a, b) => Node::Binary(f, a.min(b), a.max(b)),
            node => node,
        };
        *self.places.entry(node).or_insert_with(|| {
            self.nodes.push(node);
            self.nodes.len() as Id - 1
        })
    }

    /// Copies the nodes of another graph, and returns their new indices.
    pub fn import(&mut self, nodes: &[Node], tables: &[Arc<Table>]) -> Vec<Id> {
        tables.iter().for_each(|table| self.know(table));
        let mut ids = Vec::with_capacity(nodes.len());
        for node in nodes {
            let id = self.place(node.map(|id| ids[id as usize]));
            ids.push(id);
        }
        ids
    }

    /// The nodes that the value of one node depends on; the node itself comes last.
    pub fn only(&self, root: Id) -> Vec<Node> {
        let mut needed = vec![false; root as usize + 1];
        needed[root as usize] = true;
        for (k, node) in self.nodes[..=root as usize].iter().enumerate().rev() {
            if needed[k] {
                node.each(|id| needed[id as usize] = true);
            }
        }
        reordered(&self.nodes, (0..=root).filter(|&id| needed[id as usize])).0
    }
}

/// The nodes in another order, in which operands still come first, and the new index of each.
pub(super) fn reordered(nodes: &[Node], order: impl Iterator<Item = Id>) -> (Vec<Node>, Vec<Id>) {
    let (mut out, mut places) = (Vec::new(), vec![0; nodes.len()]);
    for id in order {
        places[id as usize] = out.len() as Id;
        out.push(nodes[id as usize].map(|id| places[id as usize]));
    }
    (out, places)
}
