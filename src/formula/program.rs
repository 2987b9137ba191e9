use super::Formula;
use super::graph::{Binary, Comparison, Graph, Id, Node, Unary, reordered};
use super::table::Table;
use std::sync::Arc;

/// Number of doubles in the registers of one block of points: they fit the second-level cache.
const CACHE: usize = 16384;

/// Several formulas compiled for evaluation at many points, with common parts computed once
///
/// The first P variables have a value at each point. The others, such as the time, are shared by all points of a call,
/// and what depends on these alone is computed once in a call. Variables of different formulas are the same if they
/// have the same index, whatever their names.
///
/// Points are evaluated in blocks, one operation after the other. Every value has the same bits as that of
/// [`Formula::eval`].
///
/// # Example
/// ```
/// use driftmesh::formula::{Formula, Program};
/// let u = Formula::parse("x*y^2 + t", &["x", "y", "t"])?;
/// let program = Program::new([&u, &u.derivative(0)?, &u.derivative(1)?]);
/// let mut out = [[0.0; 3]; 2];
/// program.eval_each(&[[1.0, 2.0], [3.0, -1.0]], &[0.5], &mut out);
/// // u, u_x = y², u_y = 2xy at t = 0.5
/// assert_eq!(out, [[4.5, 4.0, 4.0], [3.5, 1.0, -6.0]]);
/// # Ok::<(), driftmesh::formula::Mistake>(())
/// ```
#[derive(Debug, Clone)]
pub struct Program<const P: usize, const K: usize> {
    /// Operands before operations, and before all others the `shared` ones that do not depend on variables of a point.
    pub(super) nodes: Vec<Node>,
    shared: usize,
    roots: [Id; K],
    tables: Vec<Arc<Table>>,
}

impl<const P: usize, const K: usize> Program<P, K> {
    /// Compiles K formulas.
    pub fn new(formulas: [&Formula; K]) -> Self {
        let mut graph = Graph::default();
        let roots =
            formulas.map(|formula| graph.import(&formula.nodes, &formula.tables).last().copied().unwrap_or_default());
        let mut shared: Vec<bool> = Vec::with_capacity(graph.nodes().len());
        for node in graph.nodes() {
            let mut own = !matches!(node, Node::Variable(v) if (*v as usize) < P);
            node.each(|id| own &= shared[id as usize]);
            shared.push(own);
        }
        let (first, then): (Vec<Id>, Vec<Id>) = (0..shared.len() as Id).partition(|&id| shared[id as usize]);
        let (nodes, places) = reordered(graph.nodes(), first.iter().chain(&then).copied());
        let tables = graph.tables().to_vec();
        Self { nodes, shared: first.len(), roots: roots.map(|id| places[id as usize]), tables }
    }

    /// The values of all formulas at one point.
    pub fn eval(&self, point: [f64; P], shared: &[f64]) -> [f64; K] {
        let mut out = [[f64::NAN; K]];
        self.eval_each(&[point], shared, &mut out);
        out[0]
    }

    /// The values of all formulas at every point, for as many points as the shorter of both slices holds. `shared`
    /// holds the values of the variables from index P on; a missing value counts as NaN.
    pub fn eval_each(&self, points: &[[f64; P]], shared: &[f64], out: &mut [[f64; K]]) {
        let width = (CACHE / self.nodes.len().max(1)).clamp(8, 128).min(points.len()).max(1);
        let mut rows = vec![0.0; self.nodes.len() * width];
        for k in 0..self.shared {
            let (done, to) = rows.split_at_mut(k * width);
            match self.nodes[k] {
                Node::Variable(v) => to[..width].fill(shared.get(v as usize - P).copied().unwrap_or(f64::NAN)),
                node => step(node, done, width, &mut to[..width], &self.tables),
            }
        }
        for (points, out) in points.chunks(width).zip(out.chunks_mut(width)) {
            for k in self.shared..self.nodes.len() {
                let (done, to) = rows.split_at_mut(k * width);
                let to = &mut to[..points.len()];
                match self.nodes[k] {
                    Node::Variable(v) => to.iter_mut().zip(points).for_each(|(to, point)| *to = point[v as usize]),
                    node => step(node, done, width, to, &self.tables),
                }
            }
            for (k, root) in self.roots.iter().enumerate() {
                let values = &rows[*root as usize * width..];
                out.iter_mut().zip(values).for_each(|(out, value)| out[k] = *value);
            }
        }
    }
}

/// One operation on rows of `width` values, the results of which go to `to`. Variables are set by the caller.
///
/// Every operation is defined here alone, for one point, for many points and for constants. The function is inlined, so
/// that for one point the loops over rows disappear.
#[inline(always)]
pub(super) fn step(node: Node, done: &[f64], width: usize, to: &mut [f64], tables: &[Arc<Table>]) {
    let lanes = to.len();
    let row = |id: Id| &done[id as usize * width..][..lanes];
    match node {
        Node::Constant(bits) => to.fill(f64::from_bits(bits)),
        Node::Variable(_) => debug_assert!(false, "a variable has no value here"),
        Node::Unary(f, a) => {
            let a = row(a);
            match f {
                Unary::Negate => each(to, a, |a| -a),
                Unary::Sin => each(to, a, f64::sin),
                Unary::Cos => each(to, a, f64::cos),
                Unary::Tan => each(to, a, f64::tan),
                Unary::Asin => each(to, a, f64::asin),
                Unary::Acos => each(to, a, f64::acos),
                Unary::Atan => each(to, a, f64::atan),
                Unary::Sinh => each(to, a, f64::sinh),
                Unary::Cosh => each(to, a, f64::cosh),
                Unary::Tanh => each(to, a, f64::tanh),
                Unary::Exp => each(to, a, f64::exp),
                Unary::Log => each(to, a, f64::ln),
                Unary::Sqrt => each(to, a, f64::sqrt),
                Unary::Abs => each(to, a, f64::abs),
                Unary::Erf => each(to, a, libm::erf),
                Unary::Floor => each(to, a, f64::floor),
                Unary::Sign => each(to, a, |a| if a == 0.0 || a.is_nan() { a } else { a.signum() }),
            }
        }
        Node::Binary(f, a, b) => {
            let (a, b) = (row(a), row(b));
            match f {
                Binary::Add => pairs(to, a, b, |a, b| a + b),
                Binary::Subtract => pairs(to, a, b, |a, b| a - b),
                Binary::Multiply => pairs(to, a, b, |a, b| a * b),
                Binary::Divide => pairs(to, a, b, |a, b| a / b),
                Binary::Power => pairs(to, a, b, f64::powf),
                // the functions of the standard library drop NaN
                Binary::Min => pairs(to, a, b, |a, b| if b < a || b.is_nan() { b } else { a }),
                Binary::Max => pairs(to, a, b, |a, b| if b > a || b.is_nan() { b } else { a }),
                Binary::Modulo => pairs(to, a, b, modulo),
                Binary::Atan2 => pairs(to, a, b, f64::atan2),
            }
        }
        Node::Power(a, n) => {
            let a = row(a);
            match n {
                // a square takes no loop in each lane
                2 => each(to, a, |a| power(a, 2)),
                3 => each(to, a, |a| power(a, 3)),
                4 => each(to, a, |a| power(a, 4)),
                -1 => each(to, a, |a| power(a, -1)),
                -2 => each(to, a, |a| power(a, -2)),
                n => each(to, a, |a| power(a, n)),
            }
        }
        Node::Choice(comparison, [left, right, a, b]) => {
            let sides = row(left).iter().zip(row(right));
            for ((to, (l, r)), (a, b)) in to.iter_mut().zip(sides).zip(row(a).iter().zip(row(b))) {
                *to = if comparison.holds(*l, *r) { *a } else { *b };
            }
        }
        Node::Table(number, [a, b], orders) => {
            let Some(table) = tables.iter().find(|table| table.number() == number) else {
                return to.fill(f64::NAN);
            };
            pairs(to, row(a), row(b), |a, b| table.slope([a, b], orders));
        }
    }
}

#[inline(always)]
fn each(to: &mut [f64], a: &[f64], f: impl Fn(f64) -> f64) {
    to.iter_mut().zip(a).for_each(|(to, a)| *to = f(*a));
}

#[inline(always)]
fn pairs(to: &mut [f64], a: &[f64], b: &[f64], f: impl Fn(f64, f64) -> f64) {
    to.iter_mut().zip(a).zip(b).for_each(|((to, a), b)| *to = f(*a, *b));
}

/// a − b ⌊a/b⌋ without the rounding of the quotient: what `%` leaves is exact, and has the sign of a.
#[inline(always)]
fn modulo(a: f64, b: f64) -> f64 {
    let rest = a % b;
    match rest {
        0.0 => rest.copysign(b),
        _ if (rest < 0.0) != (b < 0.0) => rest + b,
        _ => rest,
    }
}

/// aⁿ by repeated squaring; the result of `powi` may be rounded differently from call to call.
#[inline(always)]
fn power(a: f64, n: i32) -> f64 {
    let (mut square, mut rest, mut product) = (a, n.unsigned_abs(), 1.0);
    while rest > 0 {
        if rest & 1 == 1 {
            product *= square;
        }
        square *= square;
        rest >>= 1;
    }
    if n < 0 { 1.0 / product } else { product }
}

impl Comparison {
    /// Whether the comparison holds; with NaN only `!=` does.
    #[inline]
    pub fn holds(self, left: f64, right: f64) -> bool {
        match self {
            Self::Less => left < right,
            Self::LessEqual => left <= right,
            Self::Greater => left > right,
            Self::GreaterEqual => left >= right,
            Self::Equal => left == right,
            Self::Unequal => left != right,
        }
    }
}
