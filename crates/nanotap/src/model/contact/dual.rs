//! A number with its derivative with respect to one parameter: what a law is made of is
//! written once and differentiated by the rules.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A value and its derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Dual {
    pub(crate) value: f64,
    pub(crate) derivative: f64,
}

impl Dual {
    pub(crate) const fn new(value: f64, derivative: f64) -> Self {
        Self { value, derivative }
    }

    /// Sine and cosine of an angle in degrees.
    pub(crate) fn sin_cos_degrees(self) -> (Self, Self) {
        let (sin, cos) = nanotap_arithmetic::sin_cos(self.value.to_radians());
        let rate = self.derivative.to_radians();
        (Self::new(sin, cos * rate), Self::new(cos, -sin * rate))
    }

    /// A number that no parameter changes.
    pub(crate) const fn constant(value: f64) -> Self {
        Self::new(value, 0.0)
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.value + other.value, self.derivative + other.derivative)
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.value, -self.derivative)
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::new(
            self.value * other.value,
            self.derivative * other.value + self.value * other.derivative,
        )
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self::new(
            value,
            (self.derivative - value * other.derivative) / other.value,
        )
    }
}

impl From<f64> for Dual {
    fn from(value: f64) -> Self {
        Self::constant(value)
    }
}

impl Mul<f64> for Dual {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self::new(self.value * factor, self.derivative * factor)
    }
}

impl Mul<Dual> for f64 {
    type Output = Dual;
    fn mul(self, other: Dual) -> Dual {
        other * self
    }
}

impl Div<f64> for Dual {
    type Output = Self;
    fn div(self, by: f64) -> Self {
        Self::new(self.value / by, self.derivative / by)
    }
}

impl Dual {
    /// The square root; zero of zero has no derivative.
    pub(crate) fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Self::new(root, 0.5 * self.derivative / root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_agree_with_central_differences() {
        let formula = |x: Dual| (x * x - Dual::constant(3.0)) / (x + Dual::constant(0.5)) - -x;
        let (x, h) = (1.7, 1e-5);
        let at = |x| formula(Dual::constant(x)).value;
        let difference = (at(x + h) - at(x - h)) / (2.0 * h);
        assert!((formula(Dual::new(x, 1.0)).derivative - difference).abs() < 1e-9);
    }
}
