//! Numbers with which a program calculates: single ones, and several with their derivatives side by side,
//! so that each calculation is one for all of them.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Sub};

use nanotap_arithmetic::Scalar;

/// Number of values that are calculated together.
pub const LANES: usize = 8;

/// A number of a program.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Returns a constant.
    fn constant(value: f64) -> Self;
    /// Returns a function of the number, which gives value and slope.
    #[must_use]
    fn of(self, function: impl Fn(f64) -> [f64; 2]) -> Self;
    /// Returns a function of two numbers, which gives value and both slopes.
    #[must_use]
    fn of_both(self, other: Self, function: impl Fn(f64, f64) -> [f64; 3]) -> Self;
}

impl<S: Scalar> Number for S {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::constant(value)
    }

    #[inline(always)]
    fn of(self, function: impl Fn(f64) -> [f64; 2]) -> Self {
        let [value, slope] = function(self.value());
        self.chain(value, slope)
    }

    #[inline(always)]
    fn of_both(self, other: Self, function: impl Fn(f64, f64) -> [f64; 3]) -> Self {
        let [value, by_self, by_other] = function(self.value(), other.value());
        self.chain(value, by_self) + other.chain(0.0, by_other)
    }
}

/// [`LANES`] values with their derivatives by `K` variables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lanes<const K: usize> {
    /// The values.
    pub values: [f64; LANES],
    /// The derivatives by each variable.
    pub slopes: [[f64; LANES]; K],
}

impl<const K: usize> Lanes<K> {
    /// Returns values of the variable of this number.
    #[inline(always)]
    pub(crate) fn variable(values: [f64; LANES], number: usize) -> Self {
        let mut slopes = [[0.0; LANES]; K];
        if let Some(slopes) = slopes.get_mut(number) {
            *slopes = [1.0; LANES];
        }
        Self { values, slopes }
    }

    /// Returns these values with the slopes `a` times those of this and `b` times those of another.
    #[inline(always)]
    fn zip(self, other: &Self, values: [f64; LANES], a: [f64; LANES], b: [f64; LANES]) -> Self {
        let slopes = from_fn(|k| from_fn(|l| a[l] * self.slopes[k][l] + b[l] * other.slopes[k][l]));
        Self { values, slopes }
    }
}

impl<const K: usize> Add for Lanes<K> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            values: from_fn(|l| self.values[l] + other.values[l]),
            slopes: from_fn(|k| from_fn(|l| self.slopes[k][l] + other.slopes[k][l])),
        }
    }
}

impl<const K: usize> Sub for Lanes<K> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            values: from_fn(|l| self.values[l] - other.values[l]),
            slopes: from_fn(|k| from_fn(|l| self.slopes[k][l] - other.slopes[k][l])),
        }
    }
}

impl<const K: usize> Mul for Lanes<K> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let values = from_fn(|l| self.values[l] * other.values[l]);
        self.zip(&other, values, other.values, self.values)
    }
}

impl<const K: usize> Div for Lanes<K> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let quotient: [f64; LANES] = from_fn(|l| self.values[l] / other.values[l]);
        let inverse: [f64; LANES] = other.values.map(f64::recip);
        self.zip(
            &other,
            quotient,
            inverse,
            from_fn(|l| -quotient[l] * inverse[l]),
        )
    }
}

impl<const K: usize> Number for Lanes<K> {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self {
            values: [value; LANES],
            slopes: [[0.0; LANES]; K],
        }
    }

    #[inline(always)]
    fn of(self, function: impl Fn(f64) -> [f64; 2]) -> Self {
        let both: [[f64; 2]; LANES] = self.values.map(function);
        Self {
            values: both.map(|[value, _]| value),
            slopes: self
                .slopes
                .map(|slopes| from_fn(|l| slopes[l] * both[l][1])),
        }
    }

    #[inline(always)]
    fn of_both(self, other: Self, function: impl Fn(f64, f64) -> [f64; 3]) -> Self {
        let all: [[f64; 3]; LANES] = from_fn(|l| function(self.values[l], other.values[l]));
        let [values, a, b] = from_fn(|part| all.map(|of| of[part]));
        self.zip(&other, values, a, b)
    }
}
