//! Elementary functions and eigenvalues with the same bits on every machine.
//!
//! The standard library takes sines and exponentials from the platform's mathematics library, which
//! rounds differently from one platform, version and processor to another. The functions here are
//! libm's, in Rust: additions, multiplications and square roots, whose rounding IEEE 754 defines
//! uniquely. A motion, and every file computed from it, is therefore the same on every machine.
//!
//! [`VERSION`] is part of every dataset: results of another arithmetic are not mixed with it.
//!
//! [`CancelFlag`] is here because every crate with long computations polls it.

mod cancel;
pub mod clock;
mod dual;
mod eigenvalues;

pub use cancel::CancelFlag;
pub use dual::{Dual, Scalar};
pub use eigenvalues::eigenvalues;

use nalgebra::{Complex, DMatrix};

/// Name of the arithmetic in datasets. It changes whenever the last digits of a result may change.
pub const VERSION: &str = "2";

/// Returns the sine of `x`, an angle in rad.
#[inline]
pub fn sin(x: f64) -> f64 {
    libm::sin(x)
}

/// Returns the cosine of `x`, an angle in rad.
#[inline]
pub fn cos(x: f64) -> f64 {
    libm::cos(x)
}

/// Returns sine and cosine of `x`, an angle in rad.
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    libm::sincos(x)
}

/// Returns the tangent of `x`, an angle in rad.
#[inline]
pub fn tan(x: f64) -> f64 {
    libm::tan(x)
}

/// Returns the angle in `[−π/2, π/2]`, in rad, whose sine is `x`; NaN for `|x| > 1`.
#[inline]
pub fn asin(x: f64) -> f64 {
    libm::asin(x)
}

/// Returns the angle in `[0, π]`, in rad, whose cosine is `x`; NaN for `|x| > 1`.
#[inline]
pub fn acos(x: f64) -> f64 {
    libm::acos(x)
}

/// Returns the angle in `[−π/2, π/2]`, in rad, whose tangent is `x`.
#[inline]
pub fn atan(x: f64) -> f64 {
    libm::atan(x)
}

/// Returns the angle in `[−π, π]`, in rad, of the point `(x, y)`.
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Returns the hyperbolic sine of `x`.
#[inline]
pub fn sinh(x: f64) -> f64 {
    libm::sinh(x)
}

/// Returns the hyperbolic cosine of `x`.
#[inline]
pub fn cosh(x: f64) -> f64 {
    libm::cosh(x)
}

/// Returns the hyperbolic tangent of `x`.
#[inline]
pub fn tanh(x: f64) -> f64 {
    libm::tanh(x)
}

/// Returns the exponential function, `e^x`.
#[inline]
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Returns the power of 2, `2^x`.
#[inline]
pub fn exp2(x: f64) -> f64 {
    libm::exp2(x)
}

/// Returns `e^x − 1`, accurate for small `x` too.
#[inline]
pub fn exp_m1(x: f64) -> f64 {
    libm::expm1(x)
}

/// Returns the natural logarithm of `x`; NaN for `x < 0`.
#[inline]
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// Returns `ln(1 + x)`, accurate for small `x` too.
#[inline]
pub fn ln_1p(x: f64) -> f64 {
    libm::log1p(x)
}

/// Returns the logarithm of `x` to base 2.
#[inline]
pub fn log2(x: f64) -> f64 {
    libm::log2(x)
}

/// Returns the logarithm of `x` to base 10.
#[inline]
pub fn log10(x: f64) -> f64 {
    libm::log10(x)
}

/// Returns the power `x^y`.
#[inline]
pub fn powf(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
}

/// Returns the real cube root of `x`, with the sign of `x`.
#[inline]
pub fn cbrt(x: f64) -> f64 {
    libm::cbrt(x)
}

/// Returns `√(x² + y²)` without overflow or underflow on the way.
#[inline]
pub fn hypot(x: f64, y: f64) -> f64 {
    libm::hypot(x, y)
}

/// Functions of complex numbers. Their names differ from those of num-complex, which call the
/// platform's functions as soon as any crate in the build requests them.
pub trait ComplexFunctions {
    /// Returns the modulus, `|z|`.
    fn modulus(self) -> f64;
    /// Returns the angle of `z`, in `[−π, π]`, in rad.
    fn argument(self) -> f64;
    /// Returns the exponential function, `e^z`.
    #[must_use]
    fn exponential(self) -> Self;
    /// Returns the square root with non-negative real part.
    #[must_use]
    fn square_root(self) -> Self;
    /// Returns the natural logarithm with an imaginary part in `[−π, π]`.
    #[must_use]
    fn logarithm(self) -> Self;
}

impl ComplexFunctions for Complex<f64> {
    #[inline]
    fn modulus(self) -> f64 {
        hypot(self.re, self.im)
    }

    #[inline]
    fn argument(self) -> f64 {
        atan2(self.im, self.re)
    }

    #[inline]
    fn exponential(self) -> Self {
        from_polar(exp(self.re), self.im)
    }

    #[inline]
    fn square_root(self) -> Self {
        let size = self.modulus();
        let larger = (0.5 * (size + self.re.abs())).sqrt();
        // Subtracting the two would cancel digits.
        let smaller = if larger == 0.0 {
            0.0
        } else {
            0.5 * self.im.abs() / larger
        };
        let (re, im) = if self.re < 0.0 {
            (smaller, larger)
        } else {
            (larger, smaller)
        };
        Self::new(re, im.copysign(self.im))
    }

    #[inline]
    fn logarithm(self) -> Self {
        Self::new(ln(self.modulus()), self.argument())
    }
}

/// Returns the complex number with modulus `r` and argument `theta`, in rad.
#[inline]
pub fn from_polar(r: f64, theta: f64) -> Complex<f64> {
    let (sin, cos) = sin_cos(theta);
    Complex::new(r * cos, r * sin)
}

/// `e^A` of a matrix: the Taylor series of `A/2^s`, squared `s` times.
#[must_use]
pub fn matrix_exp(a: &DMatrix<f64>) -> DMatrix<f64> {
    /// With a norm of at most one half the remainder of the series is `0.5^19/19!`, below 1e-22.
    const TERMS: u32 = 18;
    let size = a
        .column_iter()
        .map(|c| c.iter().map(|x| x.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let halvings = if size > 0.5 {
        (log2(size) + 1.0).ceil().min(1100.0) as u32
    } else {
        0
    };
    let scaled = a * 0.5_f64.powi(halvings as i32);
    let identity = DMatrix::identity(a.nrows(), a.ncols());
    let mut sum = identity.clone();
    for term in (1..=TERMS).rev() {
        sum = &identity + &scaled * sum / f64::from(term);
    }
    for _ in 0..halvings {
        sum = &sum * &sum;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bits of results are the same on every machine and may change only with [`VERSION`].
    #[test]
    fn bits_are_those_of_the_version() {
        let all = [
            sin(1e5),
            cos(2.5),
            tan(0.7),
            asin(0.3),
            acos(0.3),
            atan(3.0),
            atan2(-1.0, 2.0),
            sinh(1.3),
            cosh(1.3),
            tanh(0.3),
            exp(-3.7),
            exp2(0.3),
            exp_m1(1e-5),
            ln(3.0),
            ln_1p(1e-5),
            log2(3.0),
            log10(3.0),
            powf(2.3, 1.7),
            cbrt(3.0),
            hypot(1.0, 3.0),
        ];
        let mut mixed = 0_u64;
        for x in all {
            mixed = mixed.rotate_left(7) ^ x.to_bits();
        }
        assert_eq!(mixed, BITS, "{mixed:#x}");
    }

    /// Bits of this version as first computed, on x86-64.
    const BITS: u64 = 0xf5b5_327f_6e6e_b58b;

    #[test]
    fn complex_functions_agree_with_closed_forms() {
        let z = Complex::new(-0.3, 1.7);
        let root = z.square_root();
        assert!((root * root - z).modulus() < 1e-15 && root.re > 0.0);
        let root = z.conj().square_root();
        assert!((root * root - z.conj()).modulus() < 1e-15);
        assert!((z.logarithm().exponential() - z).modulus() < 1e-15);
        assert_eq!(Complex::new(3.0, 4.0).modulus(), 5.0);
        assert_eq!(Complex::new(0.0, 0.0).square_root(), Complex::new(0.0, 0.0));
    }

    #[test]
    fn a_matrix_exponential_turns_and_decays() {
        let a = DMatrix::from_row_slice(2, 2, &[-0.1, 7.0, -7.0, -0.1]);
        let e = matrix_exp(&a);
        let expected = exp(-0.1) * cos(7.0);
        assert!((e[(0, 0)] - expected).abs() < 1e-14);
        assert!((e[(0, 1)] - exp(-0.1) * sin(7.0)).abs() < 1e-14);
        assert_eq!(matrix_exp(&DMatrix::zeros(3, 3)), DMatrix::identity(3, 3));
    }
}
