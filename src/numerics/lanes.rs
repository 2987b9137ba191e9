//! Small dense matrices, eight at a time, one in each lane of a vector.
//!
//! Everything is inlined into its caller, so that [`pulp`] can compile the whole for wider vectors. Products and sums
//! are not fused: a lane has the same bits on every machine.

// loops over places of several arrays of one length, which the compiler makes vectors of
#![allow(clippy::needless_range_loop)]

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Number of matrices that are treated side by side.
pub(crate) const LANES: usize = 8;

/// One number of each of several problems that are solved side by side.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Lanes(pub [f64; LANES]);

impl Lanes {
    pub const ZERO: Self = Self([0.0; LANES]);
    pub const ONE: Self = Self([1.0; LANES]);

    #[inline(always)]
    pub fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn each(mut self, f: impl Fn(f64) -> f64) -> Self {
        for l in 0..LANES {
            self.0[l] = f(self.0[l]);
        }
        self
    }

    #[inline(always)]
    fn with(mut self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        for l in 0..LANES {
            self.0[l] = f(self.0[l], other.0[l]);
        }
        self
    }

    #[inline(always)]
    pub fn sqrt(self) -> Self {
        self.each(f64::sqrt)
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        self.each(f64::abs)
    }

    /// The larger of two numbers; a NaN does not show in it.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        self.with(other, |a, b| if b > a { b } else { a })
    }

    /// `a` with the sign of `self`.
    #[inline(always)]
    fn sign_of(self, a: Self) -> Self {
        self.with(a, |sign, a| a.copysign(sign))
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $f:expr) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(other, $f)
            }
        }
    };
}
operator!(Add, add, |a, b| a + b);
operator!(Sub, sub, |a, b| a - b);
operator!(Mul, mul, |a, b| a * b);
operator!(Div, div, |a, b| a / b);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(|a| -a)
    }
}

impl Mul<f64> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self.each(|a| a * factor)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Lanes {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

/// A = Q R by Householder's reflections, A of M rows and N ≤ M columns
///
/// # Source
/// Golub and Van Loan, *Matrix computations* (2013), 5.2.
#[derive(Debug, Clone)]
pub(crate) struct Qr<const M: usize, const N: usize> {
    /// R above the diagonal, the reflectors from the diagonal downwards; column by column.
    columns: [[Lanes; M]; N],
    /// 2/vᵀv of each reflector v.
    beta: [Lanes; N],
    diagonal: [Lanes; N],
    condition: Lanes,
}

impl<const M: usize, const N: usize> Qr<M, N> {
    /// Factorises the matrix with these columns.
    #[inline(always)]
    pub fn new(mut columns: [[Lanes; M]; N]) -> Self {
        let (mut beta, mut diagonal, mut condition) = ([Lanes::ZERO; N], [Lanes::ZERO; N], Lanes::ONE);
        for k in 0..N {
            let mut below = Lanes::ZERO;
            for i in k..M {
                below += columns[k][i] * columns[k][i];
            }
            let mut above = Lanes::ZERO;
            for i in 0..k {
                above += columns[k][i] * columns[k][i];
            }
            let norm = below.sqrt();
            condition = condition.max((below + above).sqrt() / norm);
            let head = columns[k][k];
            diagonal[k] = -head.sign_of(norm);
            columns[k][k] = head - diagonal[k];
            beta[k] = Lanes::ONE / (norm * (norm + head.abs()));
            for c in k + 1..N {
                let mut product = Lanes::ZERO;
                for i in k..M {
                    product += columns[k][i] * columns[c][i];
                }
                product = product * beta[k];
                for i in k..M {
                    let v = columns[k][i];
                    columns[c][i] -= product * v;
                }
            }
        }
        Self { columns, beta, diagonal, condition }
    }

    /// A condition number: the largest ratio of a column's length to that of its part orthogonal to the columns before
    /// it. It does not change when columns are scaled, and is infinite or NaN where they are dependent.
    #[inline(always)]
    pub fn condition(&self) -> Lanes {
        self.condition
    }

    #[inline(always)]
    fn reflect(&self, k: usize, x: &mut [Lanes; M]) {
        let v = &self.columns[k];
        let mut product = Lanes::ZERO;
        for i in k..M {
            product += v[i] * x[i];
        }
        product = product * self.beta[k];
        for i in k..M {
            x[i] -= product * v[i];
        }
    }

    /// Q x in place.
    #[inline(always)]
    pub fn multiply(&self, x: &mut [Lanes; M]) {
        for k in (0..N).rev() {
            self.reflect(k, x);
        }
    }

    /// Qᵀ x in place.
    #[inline(always)]
    pub fn multiply_transposed(&self, x: &mut [Lanes; M]) {
        for k in 0..N {
            self.reflect(k, x);
        }
    }

    /// z with Rᵀ z = c, filled up with zeros, so that Q z is the shortest solution of Aᵀ x = c.
    #[inline(always)]
    pub fn forward(&self, c: &[Lanes; N]) -> [Lanes; M] {
        let mut z = [Lanes::ZERO; M];
        for k in 0..N {
            let mut rest = c[k];
            for i in 0..k {
                rest -= self.columns[k][i] * z[i];
            }
            z[k] = rest / self.diagonal[k];
        }
        z
    }

    /// The shortest x with Aᵀ x = c.
    #[inline(always)]
    pub fn shortest(&self, c: &[Lanes; N]) -> [Lanes; M] {
        let mut x = self.forward(c);
        self.multiply(&mut x);
        x
    }

    /// The x that makes |A x − b| smallest.
    #[inline(always)]
    pub fn least_squares(&self, mut b: [Lanes; M]) -> [Lanes; N] {
        self.multiply_transposed(&mut b);
        let mut x = [Lanes::ZERO; N];
        for k in (0..N).rev() {
            let mut rest = b[k];
            for c in k + 1..N {
                rest -= self.columns[c][k] * x[c];
            }
            x[k] = rest / self.diagonal[k];
        }
        x
    }
}
