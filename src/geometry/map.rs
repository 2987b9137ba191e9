//! Maps of the unit square into the plane.

use crate::error::Result;
use crate::formula::Formula;
use std::fmt;

/// A smooth map of the unit square into the plane, that is one to one inside.
pub trait Map<const D: usize = 2>: fmt::Debug + Send + Sync {
    /// x at a place s.
    fn at(&self, s: [f64; D]) -> [f64; D];

    /// ∂x/∂s along each axis at a place.
    fn slopes(&self, s: [f64; D]) -> [[f64; D]; D];

    /// Number of equal pieces along each axis within which the map is smooth.
    fn pieces(&self) -> [usize; D] {
        [PIECES; D]
    }
}

/// Number of equal pieces of a side over which its area is integrated one by one.
const PIECES: usize = 64;

/// Another map with its axes exchanged, and taken from their other ends.
#[derive(Debug)]
pub(super) struct Turned {
    pub map: Box<dyn Map>,
    pub exchanged: bool,
    pub reversed: [bool; 2],
}

impl Turned {
    fn place(&self, s: [f64; 2]) -> [f64; 2] {
        let [s, r] = [0, 1].map(|d| if self.reversed[d] { 1.0 - s[d] } else { s[d] });
        if self.exchanged { [r, s] } else { [s, r] }
    }
}

impl Map for Turned {
    fn pieces(&self) -> [usize; 2] {
        let [n, m] = self.map.pieces();
        if self.exchanged { [m, n] } else { [n, m] }
    }

    fn at(&self, s: [f64; 2]) -> [f64; 2] {
        self.map.at(self.place(s))
    }

    fn slopes(&self, s: [f64; 2]) -> [[f64; 2]; 2] {
        let slopes = self.map.slopes(self.place(s));
        [0, 1].map(|d| {
            let slope = slopes[if self.exchanged { 1 - d } else { d }];
            if self.reversed[d] { slope.map(|x| -x) } else { slope }
        })
    }
}

/// A map given by formulas of two parameters.
#[derive(Debug)]
pub struct FormulaMap {
    x: [Formula; 2],
    slopes: [[Formula; 2]; 2],
}

impl FormulaMap {
    /// The map with these x and y, formulas of the two parameters.
    ///
    /// # Errors
    /// [`Error::Formula`](crate::Error::Formula) where a derivative is too long.
    pub fn new(x: [Formula; 2]) -> Result<Self> {
        let slope =
            |d: usize, c: usize| x[c].derivative(d).map_err(|mistake| mistake.of(["map.x", "map.y"][c], x[c].text()));
        let slopes = [[slope(0, 0)?, slope(0, 1)?], [slope(1, 0)?, slope(1, 1)?]];
        Ok(Self { x, slopes })
    }
}

impl Map for FormulaMap {
    fn at(&self, s: [f64; 2]) -> [f64; 2] {
        self.x.each_ref().map(|formula| formula.eval(&s))
    }

    fn slopes(&self, s: [f64; 2]) -> [[f64; 2]; 2] {
        self.slopes.each_ref().map(|along| along.each_ref().map(|formula| formula.eval(&s)))
    }
}

/// Between two curves: x goes from one number to another along the first axis, y from the lower curve to the upper one
/// along the second.
#[derive(Debug)]
pub struct BetweenCurves {
    x: [f64; 2],
    curves: [Formula; 2],
    slopes: [Formula; 2],
}

impl BetweenCurves {
    /// Between `bottom` and `top`, formulas of x.
    ///
    /// # Errors
    /// [`Error::Formula`](crate::Error::Formula) where a derivative is too long.
    pub fn new(x: [f64; 2], curves: [Formula; 2]) -> Result<Self> {
        let slope =
            |c: usize| curves[c].derivative(0).map_err(|mistake| mistake.of(["bottom", "top"][c], curves[c].text()));
        let slopes = [slope(0)?, slope(1)?];
        Ok(Self { x, curves, slopes })
    }
}

impl Map for BetweenCurves {
    fn at(&self, [s, r]: [f64; 2]) -> [f64; 2] {
        let [left, right] = self.x;
        let x = if s == 1.0 { right } else { left + (right - left) * s };
        let [bottom, top] = self.curves.each_ref().map(|curve| curve.eval(&[x]));
        [x, if r == 1.0 { top } else { bottom + (top - bottom) * r }]
    }

    fn slopes(&self, [s, r]: [f64; 2]) -> [[f64; 2]; 2] {
        let (x, width) = (self.x[0] + (self.x[1] - self.x[0]) * s, self.x[1] - self.x[0]);
        let [bottom, top] = self.curves.each_ref().map(|curve| curve.eval(&[x]));
        let [below, above] = self.slopes.each_ref().map(|slope| slope.eval(&[x]));
        [[width, width * (below + (above - below) * r)], [0.0, top - bottom]]
    }
}
