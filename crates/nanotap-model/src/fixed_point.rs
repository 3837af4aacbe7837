//! Fixed-point numbers of many digits, for motions whose errors grow by a hundred powers of ten.

use std::ops::{Add, Mul, Neg, Sub};

/// A number of N words of 64 bits, of which one is the signed whole part: multiples of 2^(−64 (N − 1))
/// below 2⁶³. The bits do not depend on the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Fixed<const N: usize>([u64; N]);

/// Digits of 2π after the point.
const TAU_FRACTION: &str = "2831853071795864769252867665590057683943387987502116419498891846156328125724179972560696506842341359642961730265646132941876892191011644634507188162569622";

impl<const N: usize> Fixed<N> {
    /// Zero.
    pub(super) const ZERO: Self = Self([0; N]);

    /// Returns the smallest positive number.
    pub(super) fn unit() -> f64 {
        0.5_f64.powi(64 * (N as i32 - 1))
    }

    /// Converts a whole number.
    pub(super) fn whole(value: i64) -> Self {
        let mut words = [0; N];
        words[N - 1] = value.cast_unsigned();
        Self(words)
    }

    /// Returns 2π.
    pub(super) fn tau() -> Self {
        let digits = TAU_FRACTION.bytes().rev();
        let fraction = digits.fold(Self::ZERO, |sum, digit| {
            (sum + Self::whole(i64::from(digit - b'0'))).over(10)
        });
        fraction + Self::whole(6)
    }

    /// Converts a double below 2⁶² in modulus; bits below the smallest positive number are lost.
    pub(super) fn new(value: f64) -> Self {
        let (mut rest, mut words) = (value.abs(), [0; N]);
        for word in words.iter_mut().rev() {
            // Both the part and what is left are exact.
            let part = rest.floor();
            *word = part as u64;
            rest = (rest - part) * 18_446_744_073_709_551_616.0;
        }
        if value < 0.0 {
            -Self(words)
        } else {
            Self(words)
        }
    }

    /// Returns the nearest double, but for a few units in its last place.
    pub(super) fn to_f64(self) -> f64 {
        let size = self.size();
        let words = size.0.iter().rev();
        let mut weight = 1.0;
        let mut sum = 0.0;
        for word in words {
            sum += *word as f64 * weight;
            weight *= 0.5_f64.powi(64);
        }
        if self.is_negative() { -sum } else { sum }
    }

    const fn is_negative(self) -> bool {
        self.0[N - 1] >> 63 == 1
    }

    fn size(self) -> Self {
        if self.is_negative() { -self } else { self }
    }

    /// Returns the quotient by a small positive number. Words are divided in halves: few machines divide
    /// 128 bits at once.
    #[must_use]
    pub(super) fn over(self, divisor: u32) -> Self {
        let divisor = u64::from(divisor);
        let mut rest: u64 = 0;
        let mut words = self.size().0;
        for word in words.iter_mut().rev() {
            let high = (rest << 32) | (*word >> 32);
            let low = (high % divisor) << 32 | (*word & 0xffff_ffff);
            *word = (high / divisor) << 32 | (low / divisor);
            rest = low % divisor;
        }
        if self.is_negative() {
            -Self(words)
        } else {
            Self(words)
        }
    }

    /// Returns the product with a small number; the caller excludes an overflow.
    #[must_use]
    pub(super) fn times(self, factor: u64) -> Self {
        let mut carry: u128 = 0;
        let mut words = self.size().0;
        for word in &mut words {
            let part = u128::from(*word) * u128::from(factor) + carry;
            *word = part as u64;
            carry = part >> 64;
        }
        if self.is_negative() {
            -Self(words)
        } else {
            Self(words)
        }
    }

    /// Returns the quotient; the divisor's reciprocal is below 2⁶². Newton's method doubles the digits of
    /// the reciprocal in each step.
    #[must_use]
    pub(super) fn divided_by(self, divisor: Self) -> Self {
        let one = Self::whole(1);
        let mut reciprocal = Self::new(1.0 / divisor.to_f64());
        let mut digits = 1;
        while digits < 2 * N {
            reciprocal = reciprocal + reciprocal * (one - divisor * reciprocal);
            digits *= 2;
        }
        self * reciprocal
    }
}

impl<const N: usize> Add for Fixed<N> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (mut words, mut carry) = (self.0, false);
        for (word, more) in words.iter_mut().zip(other.0) {
            let (sum, first) = word.overflowing_add(more);
            let (sum, second) = sum.overflowing_add(u64::from(carry));
            (*word, carry) = (sum, first || second);
        }
        Self(words)
    }
}

impl<const N: usize> Neg for Fixed<N> {
    type Output = Self;

    fn neg(self) -> Self {
        let mut words = self.0.map(|word| !word);
        for word in &mut words {
            let (sum, carry) = word.overflowing_add(1);
            *word = sum;
            if !carry {
                break;
            }
        }
        Self(words)
    }
}

impl<const N: usize> Sub for Fixed<N> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const N: usize> Mul for Fixed<N> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let (a, b) = (self.size().0, other.size().0);
        // The whole product, 2N words of which 2 (N − 1) are fraction.
        let (mut low, mut high) = ([0_u64; N], [0_u64; N]);
        for (i, &x) in a.iter().enumerate() {
            let mut carry: u128 = 0;
            for (j, &y) in b.iter().enumerate() {
                let place = i + j;
                let word = if place < N {
                    &mut low[place]
                } else {
                    &mut high[place - N]
                };
                let sum = u128::from(x) * u128::from(y) + u128::from(*word) + carry;
                *word = sum as u64;
                carry = sum >> 64;
            }
            // No product has reached this word yet.
            high[i] = carry as u64;
        }
        let mut words = [low[N - 1]; N];
        words[1..].copy_from_slice(&high[..N - 1]);
        if self.is_negative() == other.is_negative() {
            Self(words)
        } else {
            -Self(words)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums, products and quotients of fractions, to the last words; 355/113 − π is known.
    #[test]
    fn arithmetic_is_exact_to_the_last_words() {
        type Number = Fixed<8>;
        let rounding = |size: f64| size * Number::unit();
        for (a, b) in [(1, 3_i32), (-7, 11), (355, 113), (-12_345, 7)] {
            let quotient = Number::whole(a).divided_by(Number::whole(i64::from(b)));
            let rest = quotient * Number::whole(i64::from(b)) - Number::whole(a);
            assert!(rest.to_f64().abs() <= rounding(1e6), "{a}/{b}");
            let exact = Number::whole(a).over(b.unsigned_abs());
            assert!((quotient - exact).to_f64().abs() <= rounding(1e6));
            let expected = a as f64 / f64::from(b);
            assert!((quotient.to_f64() - expected).abs() <= 1e-15 * expected.abs());
        }
        let apart = Number::whole(355).over(113) - Number::tau().over(2);
        // mpmath 1.3: 355/113 − π.
        assert!((apart.to_f64() - 2.667_641_890_624_223e-7).abs() < 1e-21);
        for value in [0.0, -0.1, 1e18, -3e-40, 2.5] {
            assert!((Number::new(value).to_f64() - value).abs() <= 1e-15 * value.abs());
        }
        let square = Number::new(-1.5e-30) * Number::new(2e-30);
        assert!((square.to_f64() / -3e-60 - 1.0).abs() < 1e-15);
        assert_eq!(Number::new(0.25).times(12), Number::whole(3));
    }
}
