use super::beyond::Beyond;
use super::chain::{Chain, End, Law, Step};
use super::coarse;
use crate::error::Failure;
use crate::parallel;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::borrow::Cow;
use std::fmt;

/// How subdomains of a line exchange what they know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Overlapping pieces with each other's values at their ends.
    Classical {
        /// In which order.
        sweep: Sweep,
        /// M frozen at the last iterate: a linear solve a piece.
        linearized: bool,
        /// What is done between sweeps.
        coarse: Coarse,
    },
    /// Pieces that meet, with the flux of the rest of the domain as the law at their ends: I iterations.
    Optimal {
        /// Panels of the trapezoidal rule for the integrals; exact where there are none. In time there are no
        /// integrals.
        panels: Option<usize>,
    },
    /// Pieces that meet, with F ± p x as the law at their ends.
    Optimized {
        /// p.
        robin: Robin,
    },
}

/// The order in which pieces are solved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Sweep {
    /// All from the last iterate.
    #[default]
    Parallel,
    /// From left to right, with the newest values.
    Alternating,
}

/// What is done between sweeps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Coarse {
    /// Nothing.
    #[default]
    None,
    /// A correction of the glued mesh on two coarse nodes an interface.
    Galerkin,
    /// The same, as a change of ∫M instead of x: nothing overshoots, however M varies.
    Integral,
}

/// p of Robin conditions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Robin {
    /// The same everywhere.
    Value(f64),
    /// M̃/α for two pieces, M̃ = M at the mean of both sides' last values; `Lagged` for more.
    Auto,
    /// M̃/(1 − ξ) at the right end of a piece, M̃/ξ at the left end. In time M̃ √θ coth(√θ L), θ = τ/(Δt M̃), for M̃/L.
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
        struct Visitor;
        impl de::Visitor<'_> for Visitor {
            type Value = Robin;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, \"auto\" or \"lagged\"")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Robin, E> {
                match text {
                    "auto" => Ok(Robin::Auto),
                    "lagged" => Ok(Robin::Lagged),
                    _ => Err(E::invalid_value(de::Unexpected::Str(text), &self)),
                }
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Robin, E> {
                Ok(Robin::Value(value as f64))
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Robin, E> {
                Ok(Robin::Value(value as f64))
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Robin, E> {
                Ok(Robin::Value(value))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

/// Nodes of each piece.
pub(super) type Pieces = Vec<Vec<f64>>;

/// One iteration between the pieces of a line.
pub(super) struct Iteration<'a> {
    pub chain: Chain<'a>,
    /// First and last node of each piece.
    pub ranges: &'a [[usize; 2]],
    pub method: Method,
    /// The mesh before, and τ/Δt, where there is time.
    pub old: Option<(&'a [f64], f64)>,
    /// Cells of the whole line.
    pub cells: usize,
}

impl Iteration<'_> {
    /// The pieces of a mesh.
    pub fn cut(&self, mesh: &[f64]) -> Pieces {
        self.ranges.iter().map(|&[first, last]| mesh[first..=last].to_vec()).collect()
    }

    /// One mesh from the pieces: each node from the piece whose half of the overlap it lies in.
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

    /// The next iterate, and the linear solves that it took.
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

    /// What a piece is told at its left end.
    fn left_end(&self, pieces: &[Vec<f64>], s: usize) -> Result<End<'_>, Failure> {
        let first = self.ranges[s][0];
        match self.method {
            _ if s == 0 => Ok(End::Value(pieces[0][0])),
            Method::Classical { .. } => Ok(End::Value(pieces[s - 1][first - self.ranges[s - 1][0]])),
            _ => self.end(pieces, s - 1, Side::Left),
        }
    }

    /// What a piece is told at its right end.
    pub fn right_end(&self, pieces: &[Vec<f64>], s: usize) -> Result<End<'_>, Failure> {
        let [first, last] = self.ranges[s];
        match (self.method, self.ranges.get(s + 1)) {
            (_, None) => Ok(End::Value(pieces[s][last - first])),
            (Method::Classical { .. }, Some(next)) => Ok(End::Value(pieces[s + 1][last - next[0]])),
            _ => self.end(pieces, s, Side::Right),
        }
    }

    /// One piece from all.
    fn solve(&self, pieces: &[Vec<f64>], s: usize) -> Result<(Vec<f64>, usize), Failure> {
        let ends = [self.left_end(pieces, s)?, self.right_end(pieces, s)?];
        match (self.method, ends) {
            (Method::Classical { linearized: true, .. }, [End::Value(left), End::Value(right)]) => {
                Ok((self.chain.frozen(&pieces[s], [left, right], self.step(s))?, 1))
            }
            _ => self.chain.solve(&pieces[s], ends, self.step(s)),
        }
    }

    /// The law where pieces j and j + 1 meet, for the `Right` end of the left one or the `Left` end of the right one,
    /// with what the other knows.
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
        // in time the flux at the cut is that of the cell beside it, and what half a cell adds
        let more = self.old.map_or(0.0, |(old, ratio)| Step { old, ratio }.half(self.chain.h, cut, x)[0]);
        Ok(End::Flux { g: flux + sign * more - self.chain.law(law, x)?, law })
    }

    /// p: for a flux that answers a node like that of the rest, M̃/L without time and M̃ √θ coth(√θ L), θ = τ/(Δt M̃),
    /// with it, L the length of the rest.
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

/// The last node that the left one of two pieces owns, which end and begin there.
pub(super) fn owner(last: usize, first: usize) -> usize {
    (first + last) / 2
}
