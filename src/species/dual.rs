use std::ops::{Add, Div, Mul, Neg, Sub};

/// A value with its derivative along one direction, by forward differentiation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Dual {
    pub value: f64,
    pub slope: f64,
}

impl Dual {
    /// The n-th power.
    pub fn powi(self, n: i32) -> Self {
        let slope = if n == 0 { 0.0 } else { f64::from(n) * self.value.powi(n - 1) * self.slope };
        Self { value: self.value.powi(n), slope }
    }
}

impl From<f64> for Dual {
    fn from(value: f64) -> Self {
        Self { value, slope: 0.0 }
    }
}

impl Add for Dual {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: self.slope + other.slope }
    }
}

impl Sub for Dual {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slope: self.slope - other.slope }
    }
}

impl Neg for Dual {
    type Output = Self;

    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}

impl Mul for Dual {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self { value: self.value * other.value, slope: self.slope * other.value + self.value * other.slope }
    }
}

impl Mul<Dual> for f64 {
    type Output = Dual;

    fn mul(self, other: Dual) -> Dual {
        Dual { value: self * other.value, slope: self * other.slope }
    }
}

impl Div for Dual {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, slope: (self.slope - value * other.slope) / other.value }
    }
}

#[cfg(test)]
mod tests {
    use super::Dual;

    /// f(x) = x³/(1 − 2x) − 3x at x = 2: f = −26/3, f′ = (3x²(1 − 2x) + 2x³)/(1 − 2x)² − 3 = −47/9.
    #[test]
    fn derivatives_are_those_on_paper() {
        let x = Dual { value: 2.0, slope: 1.0 };
        let f = x.powi(3) / (Dual::from(1.0) - 2.0 * x) - 3.0 * x;
        assert!((f.value + 26.0 / 3.0).abs() < 1e-14 && (f.slope + 47.0 / 9.0).abs() < 1e-14, "{f:?}");
    }
}
