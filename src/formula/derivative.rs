//! The rules of differentiation, applied to the graph of a formula.

use super::MAX_OPERATIONS;
use super::graph::{Binary, Comparison, Graph, Id, Node, Unary};

/// The operations of a graph as the rules are written.
impl Graph {
    fn unary(&mut self, f: Unary, a: Id) -> Id {
        self.push(Node::Unary(f, a))
    }

    fn binary(&mut self, f: Binary, a: Id, b: Id) -> Id {
        self.push(Node::Binary(f, a, b))
    }

    fn times(&mut self, a: Id, b: Id) -> Id {
        self.binary(Binary::Multiply, a, b)
    }

    fn over(&mut self, a: Id, b: Id) -> Id {
        self.binary(Binary::Divide, a, b)
    }

    /// a + b, where `None` stands for the derivative of an operand that does not depend on the variable.
    fn plus(&mut self, a: Option<Id>, b: Option<Id>) -> Option<Id> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.binary(Binary::Add, a, b)),
            (a, b) => a.or(b),
        }
    }

    fn minus(&mut self, a: Option<Id>, b: Option<Id>) -> Option<Id> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.binary(Binary::Subtract, a, b)),
            (None, Some(b)) => Some(self.unary(Unary::Negate, b)),
            (a, None) => a,
        }
    }

    /// The derivative of the branch that a comparison selects.
    fn choice(&mut self, comparison: Comparison, left: Id, right: Id, [a, b]: [Option<Id>; 2]) -> Option<Id> {
        a.or(b)?;
        let zero = self.constant(0.0);
        Some(self.push(Node::Choice(comparison, [left, right, a.unwrap_or(zero), b.unwrap_or(zero)])))
    }

    /// Derivative of the last node; `None` if it takes too many operations.
    ///
    /// Every node gets its derivative once, from those of its operands, however often it is used. The number of nodes
    /// thus grows by at most a constant factor with each order.
    pub fn derivative(&mut self, variable: u32) -> Option<Id> {
        let mut d: Vec<Option<Id>> = Vec::with_capacity(self.nodes().len());
        for id in 0..self.nodes().len() {
            let derivative = self.rule(id as Id, &d, variable).filter(|&d| self.value(d) != Some(0.0));
            d.push(derivative);
            if self.nodes().len() > MAX_OPERATIONS {
                return None;
            }
        }
        let zero = self.constant(0.0);
        Some(d.last().copied().flatten().unwrap_or(zero))
    }

    /// Derivative of one node, given those of the nodes before it; `None` for zero.
    fn rule(&mut self, id: Id, d: &[Option<Id>], variable: u32) -> Option<Id> {
        let d = |a: Id| d[a as usize];
        match self.nodes()[id as usize] {
            Node::Constant(_) => None,
            Node::Variable(v) => (v == variable).then(|| self.constant(1.0)),
            Node::Unary(f, a) => self.chain(f, id, a, d(a)?),
            Node::Power(a, n) => {
                let da = d(a)?;
                let (n, below) = (self.constant(f64::from(n)), self.push(Node::Power(a, n - 1)));
                let outer = self.times(n, below);
                Some(self.times(outer, da))
            }
            Node::Binary(Binary::Add, a, b) => self.plus(d(a), d(b)),
            Node::Binary(Binary::Subtract, a, b) => self.minus(d(a), d(b)),
            Node::Binary(Binary::Multiply, a, b) => {
                let left = d(a).map(|da| self.times(da, b));
                let right = d(b).map(|db| self.times(a, db));
                self.plus(left, right)
            }
            Node::Binary(Binary::Divide, a, b) => {
                // q′ = (a′ − q b′) / b
                let right = d(b).map(|db| self.times(id, db));
                let top = self.minus(d(a), right)?;
                Some(self.over(top, b))
            }
            Node::Binary(Binary::Power, a, b) => {
                let base = d(a).map(|da| {
                    let one = self.constant(1.0);
                    let less = self.binary(Binary::Subtract, b, one);
                    let below = self.binary(Binary::Power, a, less);
                    let outer = self.times(b, below);
                    self.times(outer, da)
                });
                let exponent = d(b).and_then(|db| {
                    let log = self.unary(Unary::Log, a);
                    let outer = self.times(id, log);
                    let term = self.times(outer, db);
                    // 0^g = 0 for every g > 0, but its rule contains log 0, which would give NaN
                    let zero = self.constant(0.0);
                    self.choice(Comparison::Equal, id, zero, [None, Some(term)])
                });
                self.plus(base, exponent)
            }
            Node::Binary(Binary::Min, a, b) => self.choice(Comparison::Less, b, a, [d(b), d(a)]),
            Node::Binary(Binary::Max, a, b) => self.choice(Comparison::Greater, b, a, [d(b), d(a)]),
            Node::Binary(Binary::Modulo, a, b) => {
                // a − b ⌊a/b⌋ with ⌊a/b⌋ as it is
                let right = d(b).map(|db| {
                    let quotient = self.over(a, b);
                    let whole = self.unary(Unary::Floor, quotient);
                    self.times(whole, db)
                });
                self.minus(d(a), right)
            }
            Node::Binary(Binary::Atan2, a, b) => self.angle([a, b], [d(a), d(b)]),
            Node::Choice(comparison, [left, right, a, b]) => self.choice(comparison, left, right, [d(a), d(b)]),
            Node::Table(table, at, orders) => self.along(table, at, orders, at.map(d)),
        }
    }

    /// atan2(a, b)′ = (b a′ − a b′)/(a² + b²)
    fn angle(&mut self, [a, b]: [Id; 2], [da, db]: [Option<Id>; 2]) -> Option<Id> {
        let (left, right) = (da.map(|da| self.times(b, da)), db.map(|db| self.times(a, db)));
        let top = self.minus(left, right)?;
        let (a, b) = (self.times(a, a), self.times(b, b));
        let square = self.binary(Binary::Add, a, b);
        Some(self.over(top, square))
    }

    /// The slopes of a table along its axes, each times the derivative of its operand.
    fn along(&mut self, number: u32, at: [Id; 2], orders: [u8; 2], d: [Option<Id>; 2]) -> Option<Id> {
        let table = self.tables().iter().find(|table| table.number() == number)?.clone();
        let mut sum = None;
        for axis in 0..table.axes() {
            if orders[axis] >= table.degree() {
                continue;
            }
            let mut next = orders;
            next[axis] += 1;
            let term = d[axis].map(|d| {
                let slope = self.push(Node::Table(number, at, next));
                self.times(slope, d)
            });
            sum = self.plus(sum, term);
        }
        sum
    }

    /// asin(a)′ = a′/√(1 − a²) = −acos(a)′, atan(a)′ = a′/(1 + a²)
    fn inverse(&mut self, f: Unary, a: Id, da: Id) -> Id {
        let (one, square) = (self.constant(1.0), self.times(a, a));
        if f == Unary::Atan {
            let bottom = self.binary(Binary::Add, one, square);
            return self.over(da, bottom);
        }
        let rest = self.binary(Binary::Subtract, one, square);
        let bottom = self.unary(Unary::Sqrt, rest);
        let slope = self.over(da, bottom);
        if f == Unary::Acos { self.unary(Unary::Negate, slope) } else { slope }
    }

    /// f(a)′ = f′(a) a′, with `id` the place of f(a) itself.
    fn chain(&mut self, f: Unary, id: Id, a: Id, da: Id) -> Option<Id> {
        let one = self.constant(1.0);
        let outer = match f {
            Unary::Negate => return Some(self.unary(Unary::Negate, da)),
            Unary::Log => return Some(self.over(da, a)),
            Unary::Sqrt => {
                let two = self.constant(2.0);
                let bottom = self.times(two, id);
                return Some(self.over(da, bottom));
            }
            Unary::Sign | Unary::Floor => return None,
            Unary::Sin => self.unary(Unary::Cos, a),
            Unary::Cos => {
                let sin = self.unary(Unary::Sin, a);
                self.unary(Unary::Negate, sin)
            }
            Unary::Tan => {
                let square = self.times(id, id);
                self.binary(Binary::Add, one, square)
            }
            Unary::Asin | Unary::Acos | Unary::Atan => return Some(self.inverse(f, a, da)),
            Unary::Sinh => self.unary(Unary::Cosh, a),
            Unary::Cosh => self.unary(Unary::Sinh, a),
            Unary::Tanh => {
                let square = self.times(id, id);
                self.binary(Binary::Subtract, one, square)
            }
            Unary::Exp => id,
            Unary::Abs => self.unary(Unary::Sign, a),
            Unary::Erf => {
                let square = self.times(a, a);
                let falling = self.unary(Unary::Negate, square);
                let bell = self.unary(Unary::Exp, falling);
                let scale = self.constant(std::f64::consts::FRAC_2_SQRT_PI);
                self.times(scale, bell)
            }
        };
        Some(self.times(outer, da))
    }
}
