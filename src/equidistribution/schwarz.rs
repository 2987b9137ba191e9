use super::beyond::Beyond;
use super::chain::{Chain, Equations, Step};
use super::coarse;
use super::conditions::{End, Law};
use crate::error::Failure;
use crate::parallel;
use crate::setting::{Scalar, scalar};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::borrow::Cow;

/// What neighbouring subdomains of a line exchange in each iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Overlapping subdomains exchange the positions of their end nodes.
    Classical {
        /// The order in which subdomains are solved.
        sweep: Sweep,
        /// M is taken from the previous iterate, so that a subdomain costs one linear solve.
        linearized: bool,
        /// The coarse correction between iterations.
        coarse: Coarse,
    },
    /// Subdomains meet in a node and take the flux of the rest of the line as boundary condition: as many iterations as
    /// subdomains.
    Optimal {
        /// Panels of the trapezoidal rule for ∫M over the rest of the line; none means the exact integral. In time
        /// there is no such integral.
        panels: Option<usize>,
    },
    /// Subdomains meet in a node and exchange Robin conditions F ± p x.
    Optimized {
        /// The parameter p.
        robin: Robin,
    },
}

/// The order in which subdomains are solved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Sweep {
    /// All at once, from the previous iterate.
    #[default]
    Parallel,
    /// From left to right, each with the newest values of its left neighbour.
    Alternating,
}

/// A coarse correction of all subdomains at once between iterations.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Coarse {
    /// No correction.
    #[default]
    None,
    /// A Galerkin correction of the glued mesh on two coarse nodes at each cut.
    Galerkin,
    /// The same correction, applied to ∫M instead of x: it does not overshoot, however M varies.
    Integral,
}

/// The parameter p of Robin conditions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Robin {
    /// The same p at every cut.
    Value(f64),
    /// M̃/α for two subdomains that meet at ξ = α, with M̃ = M at the mean of both sides' last values; `lagged` for
    /// more of them.
    Auto,
    /// From the previous iterate: M̃/(1 − ξ) at the right end of a subdomain, M̃/ξ at the left end. In time M̃ √θ
    /// coth(√θ L) with θ = τ/(Δt M̃), in place of M̃/L.
    Lagged,
}

impl Serialize for Robin {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Value(p) => serializer.serialize_f64(*p),
            Self::Auto => serializer.serialize_str("auto"),
            Self::Lagged => serializer.serialize_str("lagged"),
        }
    }
}

impl JsonSchema for Robin {
    fn schema_name() -> Cow<'static, str> {
        "Robin".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "type": "number" }, { "enum": ["auto", "lagged"] }] })
    }
}

impl<'de> Deserialize<'de> for Robin {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const EXPECTED: &str = "a number, \"auto\" or \"lagged\"";
        scalar(deserializer, EXPECTED, |found| match found {
            Scalar::Text("auto") => Ok(Self::Auto),
            Scalar::Text("lagged") => Ok(Self::Lagged),
            Scalar::Text(text) => Err(de::Error::invalid_value(de::Unexpected::Str(text), &EXPECTED)),
            Scalar::Signed(value) => Ok(Self::Value(value as f64)),
            Scalar::Unsigned(value) => Ok(Self::Value(value as f64)),
            Scalar::Real(value) => Ok(Self::Value(value)),
        })
    }
}

/// The nodes of each piece.
pub(super) type Pieces = Vec<Vec<f64>>;

/// What one Schwarz iteration between the pieces of a line needs.
pub(super) struct Iteration<'a> {
    pub chain: Chain<'a>,
    /// The first and the last node of each piece.
    pub ranges: &'a [[usize; 2]],
    pub method: Method,
    /// The mesh before the time step, and τ/Δt; none without time.
    pub old: Option<(&'a [f64], f64)>,
    /// Number of cells of the whole line.
    pub cells: usize,
}

impl Iteration<'_> {
    /// The nodes of a mesh, piece by piece.
    pub fn cut(&self, mesh: &[f64]) -> Pieces {
        self.ranges.iter().map(|&[first, last]| mesh[first..=last].to_vec()).collect()
    }

    /// One mesh from the pieces: a node in an overlap is taken from the piece in whose half of the overlap it lies.
    pub fn glue(&self, pieces: &[Vec<f64>]) -> Vec<f64> {
        let mut mesh = Vec::with_capacity(self.cells + 1);
        for (s, (piece, [first, last])) in pieces.iter().zip(self.ranges).enumerate() {
            let to = self.ranges.get(s + 1).map_or(*last, |next| owner(*last, next[0]));
            mesh.extend_from_slice(&piece[mesh.len() - first..=to - first]);
        }
        mesh
    }

    fn step(&self, s: usize) -> Option<Step<'_>> {
        let [first, last] = self.ranges[s];
        self.old.map(|(old, ratio)| Step { old: &old[first..=last], ratio })
    }

    /// The next iterate, and the number of linear solves.
    pub fn next(&self, pieces: &[Vec<f64>]) -> Result<(Pieces, usize), Failure> {
        match self.method {
            Method::Classical { sweep: Sweep::Alternating, .. } => {
                let (mut pieces, mut solves) = (pieces.to_vec(), 0);
                for s in 0..pieces.len() {
                    let (piece, cost) = self.solve(&pieces, s)?;
                    pieces[s] = piece;
                    solves += cost;
                }
                Ok((pieces, solves))
            }
            Method::Classical { coarse: coarse @ (Coarse::Galerkin | Coarse::Integral), .. } => {
                let (next, solves) = self.sweep(pieces)?;
                let mesh = coarse::corrected(self, self.glue(&next), coarse)?;
                Ok((self.cut(&mesh), solves + 1))
            }
            _ => self.sweep(pieces),
        }
    }

    fn sweep(&self, pieces: &[Vec<f64>]) -> Result<(Pieces, usize), Failure> {
        let numbers: Vec<usize> = (0..pieces.len()).collect();
        let solved = parallel::map_large(self.cells, &numbers, |&s| self.solve(pieces, s));
        let mut next = Vec::with_capacity(pieces.len());
        let mut solves = 0;
        for piece in solved {
            let (piece, cost) = piece?;
            next.push(piece);
            solves += cost;
        }
        Ok((next, solves))
    }

    /// The boundary condition at the left end of piece s.
    fn left_end(&self, pieces: &[Vec<f64>], s: usize) -> Result<End<'_>, Failure> {
        let first = self.ranges[s][0];
        match self.method {
            _ if s == 0 => Ok(End::Value(pieces[0][0])),
            Method::Classical { .. } => Ok(End::Value(pieces[s - 1][first - self.ranges[s - 1][0]])),
            _ => self.end(pieces, s - 1, Side::Left),
        }
    }

    /// The boundary condition at the right end of piece s.
    pub fn right_end(&self, pieces: &[Vec<f64>], s: usize) -> Result<End<'_>, Failure> {
        let [first, last] = self.ranges[s];
        match (self.method, self.ranges.get(s + 1)) {
            (_, None) => Ok(End::Value(pieces[s][last - first])),
            (Method::Classical { .. }, Some(next)) => Ok(End::Value(pieces[s + 1][last - next[0]])),
            _ => self.end(pieces, s, Side::Right),
        }
    }

    /// The next iterate of piece s, from the last iterates of all pieces.
    fn solve(&self, pieces: &[Vec<f64>], s: usize) -> Result<(Vec<f64>, usize), Failure> {
        let ends = [self.left_end(pieces, s)?, self.right_end(pieces, s)?];
        match (self.method, ends) {
            (Method::Classical { linearized: true, .. }, [End::Value(left), End::Value(right)]) => {
                Ok((self.chain.frozen(&pieces[s], [left, right], self.step(s))?, 1))
            }
            _ => Equations { chain: &self.chain, ends, step: self.step(s) }.solve(&pieces[s]),
        }
    }

    /// The condition at the node where pieces j and j + 1 meet, from the last iterate of the other piece: for the
    /// `Right` end of piece j or the `Left` end of piece j + 1.
    fn end(&self, pieces: &[Vec<f64>], j: usize, side: Side) -> Result<End<'_>, Failure> {
        let cut = self.ranges[j][1];
        let xi = cut as f64 / self.cells as f64;
        let (left, right) = (&pieces[j], &pieces[j + 1]);
        let n = left.len() - 1;
        let law = match (self.method, self.old) {
            (Method::Optimal { .. }, Some((old, ratio))) => Law::Beyond(match side {
                Side::Right => Beyond { old: &old[cut..], ratio, cut_at_left: true },
                Side::Left => Beyond { old: &old[..=cut], ratio, cut_at_left: false },
            }),
            (Method::Optimal { panels }, None) => match side {
                Side::Right => Law::Rest { to: self.chain.ends[1], length: 1.0 - xi, panels },
                Side::Left => Law::Rest { to: self.chain.ends[0], length: -xi, panels },
            },
            _ => {
                let p = self.robin(xi, 0.5 * (left[n] + right[0]), side)?;
                Law::Robin { slope: if side == Side::Right { -p } else { p } }
            }
        };
        let (flux, x, sign) = match side {
            Side::Right => (self.chain.flux(right[0], right[1])?, right[0], -1.0),
            Side::Left => (self.chain.flux(left[n - 1], left[n])?, left[n], 1.0),
        };
        // in time the flux at the cut is that in the middle of the cell beside it, and what half a cell adds
        let more = self.old.map_or(0.0, |(old, ratio)| Step { old, ratio }.half(self.chain.h, cut, x)[0]);
        Ok(End::Flux { g: flux + sign * more - law.at(&self.chain, x)?[0], law })
    }

    /// p that makes the flux answer a displacement of the node as the rest of the line, of length L in ξ, would: M̃/L
    /// without time, and M̃ √θ coth(√θ L) with θ = τ/(Δt M̃) in time.
    fn robin(&self, xi: f64, x: f64, side: Side) -> Result<f64, Failure> {
        let Method::Optimized { robin } = self.method else { return Ok(0.0) };
        let like_rest = |length: f64| -> Result<f64, Failure> {
            let m = self.chain.density.at(self.chain.t, x)?[0];
            Ok(match self.old {
                None => m / length,
                Some((_, ratio)) => {
                    let root = (ratio / m).sqrt();
                    m * root / (root * length).tanh()
                }
            })
        };
        match (robin, side) {
            (Robin::Value(p), _) => Ok(p),
            (Robin::Auto, _) if self.ranges.len() == 2 => like_rest(xi),
            (_, Side::Right) => like_rest(1.0 - xi),
            (_, Side::Left) => like_rest(xi),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    Left,
    Right,
}

/// The last node that the left one of two neighbouring pieces owns, given the last node of the left and the first of
/// the right one.
pub(super) fn owner(last: usize, first: usize) -> usize {
    (first + last) / 2
}
