//! Dual numbers: a value with its first derivatives, so that every formula is written once.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number in a formula: a plain `f64` or one with derivatives.
pub trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Mul<f64, Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
{
    /// Returns a constant: all its derivatives are zero.
    fn constant(value: f64) -> Self;
    /// Returns the value without the derivatives.
    fn value(self) -> f64;
    /// Returns `f` of this number, given the value and the slope of `f` at it.
    #[must_use]
    fn chain(self, value: f64, slope: f64) -> Self;

    /// Returns the square root; for zero and below, where a contact ends, 0 with slope 0.
    #[must_use]
    fn sqrt(self) -> Self {
        let x = self.value();
        if x <= 0.0 {
            return self.chain(0.0, 0.0);
        }
        let root = x.sqrt();
        self.chain(root, 0.5 / root)
    }
    /// Returns the cube root of a number above zero.
    #[must_use]
    fn cbrt(self) -> Self {
        let root = crate::cbrt(self.value());
        self.chain(root, root / (3.0 * self.value()))
    }
    /// Returns the exponential function, `e^x`.
    #[must_use]
    fn exp(self) -> Self {
        let e = crate::exp(self.value());
        self.chain(e, e)
    }
    /// Returns the reciprocal, `1/x`.
    #[must_use]
    fn recip(self) -> Self {
        let r = self.value().recip();
        self.chain(r, -r * r)
    }
    /// Returns the tangent of an angle in rad.
    #[must_use]
    fn tan(self) -> Self {
        let t = crate::tan(self.value());
        self.chain(t, 1.0 + t * t)
    }
    /// Returns sine and cosine of an angle in rad.
    #[must_use]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = crate::sin_cos(self.value());
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    /// Returns the square, `x²`.
    #[must_use]
    fn square(self) -> Self {
        self * self
    }
}

impl Scalar for f64 {
    fn constant(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
    fn chain(self, value: f64, _slope: f64) -> Self {
        value
    }
}

/// A value and its derivatives with respect to `K` variables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const K: usize = 1> {
    /// Value of the number, in the unit of the quantity that it stands for.
    pub value: f64,
    /// Derivatives of the value with respect to the `K` variables, in their order.
    pub slopes: [f64; K],
}

impl<const K: usize> Dual<K> {
    /// Returns independent variable number `index` (from 0, below `K`): its own derivative is 1.
    pub fn variable(value: f64, index: usize) -> Self {
        let mut slopes = [0.0; K];
        slopes[index] = 1.0;
        Self { value, slopes }
    }

    /// Returns a constant: all its derivatives are zero.
    pub const fn constant(value: f64) -> Self {
        Self {
            value,
            slopes: [0.0; K],
        }
    }

    #[inline]
    fn zip(self, other: Self, value: f64, a: f64, b: f64) -> Self {
        let mut slopes = [0.0; K];
        for (k, slope) in slopes.iter_mut().enumerate() {
            *slope = a * self.slopes[k] + b * other.slopes[k];
        }
        Self { value, slopes }
    }
}

impl Dual<1> {
    /// Returns a number with its derivative with respect to the one variable.
    pub const fn new(value: f64, derivative: f64) -> Self {
        Self {
            value,
            slopes: [derivative],
        }
    }

    /// Derivative with respect to the one variable.
    pub const fn derivative(self) -> f64 {
        self.slopes[0]
    }

    /// Converts an angle from degrees to rad.
    #[must_use]
    pub const fn to_radians(self) -> Self {
        Self::new(self.value.to_radians(), self.slopes[0].to_radians())
    }
}

impl<const K: usize> Default for Dual<K> {
    fn default() -> Self {
        Self::constant(0.0)
    }
}

impl<const K: usize> From<f64> for Dual<K> {
    fn from(value: f64) -> Self {
        Self::constant(value)
    }
}

impl<const K: usize> Scalar for Dual<K> {
    #[inline]
    fn constant(value: f64) -> Self {
        Self::constant(value)
    }
    #[inline]
    fn value(self) -> f64 {
        self.value
    }
    #[inline]
    fn chain(self, value: f64, slope: f64) -> Self {
        Self {
            value,
            slopes: self.slopes.map(|s| s * slope),
        }
    }
}

impl<const K: usize> Add for Dual<K> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        self.zip(other, self.value + other.value, 1.0, 1.0)
    }
}

impl<const K: usize> Sub for Dual<K> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self.zip(other, self.value - other.value, 1.0, -1.0)
    }
}

impl<const K: usize> Mul for Dual<K> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        self.zip(other, self.value * other.value, other.value, self.value)
    }
}

impl<const K: usize> Div for Dual<K> {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        // Divided as without derivatives: where a force ends must be one number in both.
        let quotient = self.value / other.value;
        let r = other.value.recip();
        self.zip(other, quotient, r, -quotient * r)
    }
}

impl<const K: usize> Neg for Dual<K> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const K: usize> Mul<f64> for Dual<K> {
    type Output = Self;
    #[inline]
    fn mul(self, other: f64) -> Self {
        self.chain(self.value * other, other)
    }
}

impl<const K: usize> Mul<Dual<K>> for f64 {
    type Output = Dual<K>;
    #[inline]
    fn mul(self, other: Dual<K>) -> Dual<K> {
        other * self
    }
}

impl<const K: usize> Div<f64> for Dual<K> {
    type Output = Self;
    #[inline]
    fn div(self, by: f64) -> Self {
        Self {
            value: self.value / by,
            slopes: self.slopes.map(|slope| slope / by),
        }
    }
}

impl<const K: usize> Add<f64> for Dual<K> {
    type Output = Self;
    #[inline]
    fn add(self, other: f64) -> Self {
        self.chain(self.value + other, 1.0)
    }
}

impl<const K: usize> Sub<f64> for Dual<K> {
    type Output = Self;
    #[inline]
    fn sub(self, other: f64) -> Self {
        self.chain(self.value - other, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn formula<S: Scalar>(x: S, y: S) -> S {
        ((x * y).sqrt() + (x / y).exp() - y.recip().tan() * 0.3 + 1.0).cbrt() - (-x).square() * 2.0
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let (x, y, h) = (0.7, 1.9, 1e-6);
        let d = formula(Dual::<2>::variable(x, 0), Dual::variable(y, 1));
        assert_eq!(d.value, formula(x, y));
        let by_x = (formula(x + h, y) - formula(x - h, y)) / (2.0 * h);
        let by_y = (formula(x, y + h) - formula(x, y - h)) / (2.0 * h);
        assert!((d.slopes[0] - by_x).abs() < 1e-9);
        assert!((d.slopes[1] - by_y).abs() < 1e-9);
        assert_eq!(Dual::<1>::variable(0.0, 0).sqrt().slopes, [0.0]);
    }

    /// To the last digit: the end of a force whose slope has no bound there is compared with gaps.
    #[test]
    fn values_are_those_without_derivatives() {
        for k in 1..1000 {
            let (x, y) = (0.7 + 0.0137 * f64::from(k), 1.9 + 0.0071 * f64::from(k));
            let d = formula(Dual::<1>::variable(x, 0), Dual::constant(y));
            assert_eq!(d.value, formula(x, y), "{x} {y}");
        }
    }
}
