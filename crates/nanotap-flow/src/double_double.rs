//! Arithmetic in twice double precision. It only decides on which side of zero a signal's extremum
//! lies when double precision cannot distinguish it from rounding.
//!
//! Error-free sums and products after Dekker and Knuth.

use crate::Complex;
use crate::simd::fused;

/// A sum of two doubles, the second below the rounding of the first.
#[derive(Clone, Copy)]
pub(crate) struct Dd(pub(crate) f64, pub(crate) f64);

impl Dd {
    const ZERO: Self = Self(0.0, 0.0);

    /// Converts a double exactly.
    pub(crate) fn new(a: f64) -> Self {
        Self(a, 0.0)
    }

    /// Returns the exact sum of two doubles.
    fn two_sum(a: f64, b: f64) -> Self {
        let s = a + b;
        let t = s - a;
        Self(s, (a - (s - t)) + (b - t))
    }

    /// Returns the exact product of two doubles.
    pub(crate) fn two_product(a: f64, b: f64) -> Self {
        let p = a * b;
        Self(p, fused(a, b, -p))
    }

    pub(crate) fn add(self, other: Self) -> Self {
        let s = Self::two_sum(self.0, other.0);
        let t = Self::two_sum(self.1, other.1);
        let u = Self::two_sum(s.0, s.1 + t.0);
        Self::two_sum(u.0, u.1 + t.1)
    }

    pub(crate) fn multiply(self, other: Self) -> Self {
        let p = Self::two_product(self.0, other.0);
        Self::two_sum(p.0, p.1 + (self.0 * other.1 + self.1 * other.0))
    }

    fn negated(self) -> Self {
        Self(-self.0, -self.1)
    }

    fn scaled(self, power_of_two: f64) -> Self {
        Self(self.0 * power_of_two, self.1 * power_of_two)
    }
}

/// A complex number in twice double precision: real and imaginary part.
#[derive(Clone, Copy)]
pub(crate) struct ComplexDd(pub(crate) Dd, pub(crate) Dd);

impl ComplexDd {
    pub(crate) fn new(z: Complex) -> Self {
        Self(Dd::new(z.re), Dd::new(z.im))
    }

    pub(crate) fn add(self, other: Self) -> Self {
        Self(self.0.add(other.0), self.1.add(other.1))
    }

    pub(crate) fn multiply(self, other: Self) -> Self {
        Self(
            self.0
                .multiply(other.0)
                .add(self.1.multiply(other.1).negated()),
            self.0.multiply(other.1).add(self.1.multiply(other.0)),
        )
    }

    /// Computes `e^z` by halving the argument, summing a Taylor series, and squaring the result
    /// back.
    pub(crate) fn exp(self) -> Self {
        let size = self.0.0.abs() + self.1.0.abs();
        let halvings = if size > 0.02 {
            nanotap_arithmetic::log2(size / 0.02).ceil() as i32
        } else {
            0
        };
        let scale = 0.5_f64.powi(halvings);
        let z = Self(self.0.scaled(scale), self.1.scaled(scale));
        // Sum e^z − 1, which keeps the small part's digits through the squarings.
        let mut term = z;
        let mut sum = z;
        for n in 2..18 {
            let n = f64::from(n);
            // 1/n in twice double precision: one Newton correction.
            let inverse = Dd::two_sum(1.0 / n, fused(1.0 / n, -n, 1.0) / n);
            let inverse = Self(inverse, Dd::ZERO);
            term = term.multiply(z).multiply(inverse);
            sum = sum.add(term);
        }
        for _ in 0..halvings {
            // (1 + d)² − 1 = 2d + d²
            sum = Self(sum.0.scaled(2.0), sum.1.scaled(2.0)).add(sum.multiply(sum));
        }
        sum.add(Self(Dd::new(1.0), Dd::ZERO))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// cos² + sin² = 1 and eᵃ e⁻ᵃ = 1 hold far beyond double precision.
    #[test]
    fn exponential_has_twice_double_precision() {
        let e = ComplexDd(Dd::ZERO, Dd::two_product(2.9, 3.7)).exp();
        let one = e.0.multiply(e.0).add(e.1.multiply(e.1)).add(Dd::new(-1.0));
        assert!((one.0 + one.1).abs() < 1e-28, "{}", one.0 + one.1);
        let (sin, cos) = (2.9_f64 * 3.7).sin_cos();
        assert!((e.0.0 - cos).abs() < 1e-15 && (e.1.0 - sin).abs() < 1e-15);
        // e^a e^{-a} = 1 with a not a double.
        let a = Dd::two_product(0.3, 1.7);
        let product = ComplexDd(a, Dd::ZERO)
            .exp()
            .multiply(ComplexDd(a.negated(), Dd::ZERO).exp());
        let rest = product.0.add(Dd::new(-1.0));
        assert!((rest.0 + rest.1).abs() < 1e-29);
    }
}
