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
        /// Panels of the trapezoidal rule for the integrals; exact where there are none.
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
}

/// p of Robin conditions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Robin {
    /// The same everywhere.
    Value(f64),
    /// M̃/α for two pieces, M̃ = M at the mean of both sides' last values; `Lagged` for more.
    Auto,
    /// M̃/(1 − ξ) at the right end of a piece, M̃/ξ at the left end.
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
            Method::Classical { coarse: Coarse::Galerkin, .. } => {
                let (next, solves) = self.sweep(pieces)?;
                let mesh = coarse::corrected(self, self.glue(&next))?;
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

    /// One piece from all.
    fn solve(&self, pieces: &[Vec<f64>], s: usize) -> Result<(Vec<f64>, usize), Failure> {
        let [first, last] = self.ranges[s];
        if let Method::Classical { linearized, .. } = self.method {
            let own = &pieces[s];
            let left = if s == 0 { own[0] } else { pieces[s - 1][first - self.ranges[s - 1][0]] };
            let right = match self.ranges.get(s + 1) {
                None => own[last - first],
                Some(next) => pieces[s + 1][last - next[0]],
            };
            return match linearized {
                true => Ok((self.chain.frozen(own, [left, right], self.step(s))?, 1)),
                false => self.chain.solve(own, [End::Value(left), End::Value(right)], self.step(s)),
            };
        }
        let ends = [
            if s == 0 { End::Value(pieces[s][0]) } else { self.end(pieces, s - 1, Side::Left)? },
            if s + 1 == pieces.len() { End::Value(pieces[s][last - first]) } else { self.end(pieces, s, Side::Right)? },
        ];
        self.chain.solve(&pieces[s], ends, self.step(s))
    }

    /// The law where pieces j and j + 1 meet, for the `Right` end of the left one or the `Left` end of the right one, with
    /// what the other knows.
    fn end(&self, pieces: &[Vec<f64>], j: usize, side: Side) -> Result<End, Failure> {
        let xi = self.ranges[j][1] as f64 / self.cells as f64;
        let (left, right) = (&pieces[j], &pieces[j + 1]);
        let n = left.len() - 1;
        let law = match self.method {
            Method::Optimal { panels } => match side {
                Side::Right => Law::Rest { to: self.chain.ends[1], length: 1.0 - xi, panels },
                Side::Left => Law::Rest { to: self.chain.ends[0], length: -xi, panels },
            },
            _ => {
                let p = self.robin(xi, 0.5 * (left[n] + right[0]), side)?;
                Law::Robin { slope: if side == Side::Right { -p } else { p } }
            }
        };
        let (flux, x) = match side {
            Side::Right => (self.chain.flux(right[0], right[1])?, right[0]),
            Side::Left => (self.chain.flux(left[n - 1], left[n])?, left[n]),
        };
        Ok(End::Flux { g: flux - self.chain.law(law, x)?, law })
    }

    fn robin(&self, xi: f64, x: f64, side: Side) -> Result<f64, Failure> {
        let Method::Optimized { robin } = self.method else { return Ok(0.0) };
        let m = || Ok(self.chain.density.at(self.chain.t, x)?[0]);
        Ok(match (robin, side) {
            (Robin::Value(p), _) => p,
            (Robin::Auto, _) if self.ranges.len() == 2 => m()? / xi,
            (_, Side::Right) => m()? / (1.0 - xi),
            (_, Side::Left) => m()? / xi,
        })
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
