//! The numbers from which observables are computed: plain, or with a derivative.

use std::ops::Div;

use nalgebra::Complex;
use nanotap_arithmetic::{Dual, Scalar};

/// A real number, with or without a derivative.
pub(super) trait Number: Scalar + Default + From<f64> + Div<f64, Output = Self> {
    /// Whether it has a derivative.
    const VARIES: bool;
    /// Returns the larger of the number and `low`.
    fn at_least(self, low: f64) -> Self;
    /// Returns √(x² + y²), with x the number itself.
    fn hypotenuse(self, y: Self) -> Self;
    /// Returns the angle of the point (`x`, self) in degrees.
    fn degrees(self, x: Self) -> Self;
    /// Returns sine and cosine of an angle in radians.
    fn turn(self) -> (Self, Self);
    /// Returns the square root; its derivative at zero is infinite.
    fn root(self) -> Self;
}

impl Number for f64 {
    const VARIES: bool = false;

    fn at_least(self, low: f64) -> Self {
        self.max(low)
    }

    fn hypotenuse(self, y: Self) -> Self {
        nanotap_arithmetic::hypot(self, y)
    }

    fn degrees(self, x: Self) -> Self {
        nanotap_arithmetic::atan2(self, x).to_degrees()
    }

    fn turn(self) -> (Self, Self) {
        nanotap_arithmetic::sin_cos(self)
    }

    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Number for Dual {
    const VARIES: bool = true;

    fn at_least(self, low: f64) -> Self {
        if self.value >= low { self } else { low.into() }
    }

    fn hypotenuse(self, y: Self) -> Self {
        let value = nanotap_arithmetic::hypot(self.value, y.value);
        let change = self.value * self.derivative() + y.value * y.derivative();
        Self::new(value, change / value)
    }

    fn degrees(self, x: Self) -> Self {
        let size = self.value * self.value + x.value * x.value;
        let change = (x.value * self.derivative() - self.value * x.derivative()) / size;
        let value = nanotap_arithmetic::atan2(self.value, x.value);
        Self::new(value.to_degrees(), change.to_degrees())
    }

    fn turn(self) -> (Self, Self) {
        self.sin_cos()
    }

    fn root(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root)
    }
}

/// The component `Re(c e^{iωt})` of a signal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Phasor<D> {
    pub(super) re: D,
    pub(super) im: D,
}

impl<D> From<Complex<D>> for Phasor<D> {
    fn from(c: Complex<D>) -> Self {
        Self { re: c.re, im: c.im }
    }
}

impl<D: Number> Phasor<D> {
    /// Returns the amplitude |c| of the component.
    pub(super) fn norm(self) -> D {
        self.re.hypotenuse(self.im)
    }

    /// Phase lag φ: `Re(c e^{iθ}) = |c| sin(θ − φ)`, degrees in (−180, 180].
    pub(crate) fn lag(self) -> D {
        let degrees = -self.re.degrees(D::from(0.0) - self.im);
        if degrees.value() <= -180.0 {
            degrees + 360.0
        } else {
            degrees
        }
    }

    /// Returns the component multiplied by `factor`.
    pub(super) fn times(self, factor: D) -> Self {
        Self {
            re: self.re * factor,
            im: self.im * factor,
        }
    }

    /// Rotates back by an angle in radians.
    pub(super) fn turned_back(self, angle: D) -> Self {
        let (sin, cos) = angle.turn();
        Self {
            re: self.re * cos + self.im * sin,
            im: self.im * cos - self.re * sin,
        }
    }
}

/// `value`, or 0 if it is only the rounding of a sum of terms of the given size; its derivative
/// stays.
pub(super) fn above_rounding<D: Number>(value: D, size: f64) -> D {
    /// Largest value, as a part of the size of the terms, that is the rounding of zero.
    const ROUNDING: f64 = 1e-12;
    if value.value().abs() <= ROUNDING * size {
        value - D::from(value.value())
    } else {
        value
    }
}
