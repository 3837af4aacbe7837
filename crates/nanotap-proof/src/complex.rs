//! Rectangles of complex numbers.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

use nalgebra::Complex;

use crate::interval::Interval;

/// The complex numbers whose real and imaginary parts lie in two intervals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Interval of the real parts.
    pub re: Interval,
    /// Interval of the imaginary parts.
    pub im: Interval,
}

impl Rectangle {
    /// The rectangle that contains 0 only.
    pub const ZERO: Self = Self::real(Interval::ZERO);
    /// The rectangle that contains 1 only.
    pub const ONE: Self = Self::real(Interval::ONE);

    /// The rectangle with the given real and imaginary parts.
    pub const fn new(re: Interval, im: Interval) -> Self {
        Self { re, im }
    }

    /// The rectangle of real numbers `re`.
    pub const fn real(re: Interval) -> Self {
        Self::new(re, Interval::ZERO)
    }

    /// The rectangle that contains `z` only.
    pub fn point(z: Complex<f64>) -> Self {
        Self::new(Interval::point(z.re), Interval::point(z.im))
    }

    /// The rectangle of imaginary numbers `i · im`.
    pub const fn imaginary(im: Interval) -> Self {
        Self::new(Interval::ZERO, im)
    }

    /// Returns the rectangle of the complex conjugates.
    #[must_use]
    pub fn conj(self) -> Self {
        Self::new(self.re, -self.im)
    }

    /// Returns an enclosure of the product with the real numbers of `factor`.
    #[must_use]
    pub fn scale(self, factor: Interval) -> Self {
        Self::new(self.re * factor, self.im * factor)
    }

    /// Returns an enclosure of the exponential function, e^z.
    #[must_use]
    pub fn exp(self) -> Self {
        let size = self.re.exp();
        if self.im == Interval::ZERO {
            return Self::real(size);
        }
        let (sin, cos) = self.im.sin_cos();
        Self::new(size * cos, size * sin)
    }

    /// A number near the centre.
    pub fn middle(self) -> Complex<f64> {
        Complex::new(self.re.middle(), self.im.middle())
    }

    /// Bounds of the absolute value.
    pub fn modulus(self) -> Interval {
        (self.re.square() + self.im.square()).sqrt()
    }

    /// An upper bound of the absolute value.
    pub fn magnitude(self) -> f64 {
        self.modulus().hi()
    }

    /// Whether the rectangles have no number in common.
    pub fn is_disjoint(self, other: Self) -> bool {
        self.re.is_disjoint(other.re) || self.im.is_disjoint(other.im)
    }

    /// Whether all bounds are finite.
    pub fn is_finite(self) -> bool {
        self.re.is_finite() && self.im.is_finite()
    }
}

impl From<Interval> for Rectangle {
    fn from(re: Interval) -> Self {
        Self::real(re)
    }
}

impl Add for Rectangle {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }
}

impl AddAssign for Rectangle {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Neg for Rectangle {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.re, -self.im)
    }
}

impl Sub for Rectangle {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Rectangle {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::new(
            self.re * other.re - self.im * other.im,
            self.re * other.im + self.im * other.re,
        )
    }
}

impl Div for Rectangle {
    type Output = Self;
    /// The quotient; the whole plane if the divisor may be zero.
    fn div(self, other: Self) -> Self {
        let size = other.re.square() + other.im.square();
        let up = self * other.conj();
        Self::new(up.re / size, up.im / size)
    }
}

impl std::iter::Sum for Rectangle {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::ZERO, |sum, x| sum + x)
    }
}
