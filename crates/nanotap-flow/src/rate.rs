//! The integral of one exponential over a length of time.

use crate::Complex;
use nanotap_arithmetic::ComplexFunctions as _;

/// A rate `λ`, and the method that computes `∫ e^{λs} ds`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rate {
    pub(crate) value: Complex,
    primitive: Primitive,
}

/// The method for `(e^{λs} − 1)/λ`. This quotient loses digits where `|λs|` is small, but the loss
/// is only `ε/|λ|`. Over a period `T` it is negligible, unless `|λ|T` itself is small.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Primitive {
    /// The quotient, with the factor `1/λ`.
    Quotient(Complex),
    /// The Taylor series, for small `|λ|T`.
    Series,
    /// The length itself, for `λ = 0`.
    Length,
}

/// Value of `|λ|T` up to which the Taylor series is used.
const SLOW: f64 = 0.1;

impl Rate {
    /// Selects the method for stretches of up to `period`.
    pub(crate) fn new(value: Complex, period: f64) -> Self {
        let square = value.re * value.re + value.im * value.im;
        let primitive = if square == 0.0 {
            Primitive::Length
        } else if square * (period * period) < SLOW * SLOW {
            Primitive::Series
        } else {
            Primitive::Quotient(value.conj() * (1.0 / square))
        };
        Self { value, primitive }
    }

    /// Returns `∫₀^length e^{λs} ds`, given `end = e^{λ · length}`.
    #[inline(always)]
    pub(crate) fn integral(&self, length: f64, end: Complex) -> Complex {
        match self.primitive {
            Primitive::Quotient(inverse) => (end - 1.0) * inverse,
            Primitive::Length => Complex::new(length, 0.0),
            Primitive::Series => {
                // Σ zⁿ/(n + 1)!
                let z = self.value * length;
                let mut sum = Complex::new(INVERSE_FACTORIALS[ORDER], 0.0);
                for coefficient in INVERSE_FACTORIALS[..ORDER].iter().rev() {
                    sum = sum * z + coefficient;
                }
                sum * length
            }
        }
    }
}

/// Order of the Taylor series. Its first omitted term is at most 0.1¹⁰/11! of the first.
const ORDER: usize = 9;

/// Coefficients `1/(n + 1)!` of the series of `(e^z − 1)/z`.
const INVERSE_FACTORIALS: [f64; ORDER + 1] = {
    let mut all = [1.0; ORDER + 1];
    let mut factorial = 1.0;
    let mut n = 1;
    while n <= ORDER {
        factorial *= (n + 1) as f64;
        all[n] = 1.0 / factorial;
        n += 1;
    }
    all
};

/// Computes `(e^z − 1)/z`, accurate for every `z`.
pub(crate) fn phi1(z: Complex) -> Complex {
    if z.modulus() < 1e-5 {
        return Complex::new(1.0, 0.0) + z * 0.5 + z * z / 6.0;
    }
    // e^{x+iy} − 1 = (e^x − 1) cos y − 2 sin²(y/2) + i e^x sin y
    let half = nanotap_arithmetic::sin(0.5 * z.im);
    let (sin, cos) = nanotap_arithmetic::sin_cos(z.im);
    Complex::new(
        nanotap_arithmetic::exp_m1(z.re) * cos - 2.0 * half * half,
        nanotap_arithmetic::exp(z.re) * sin,
    ) / z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_integral_from_the_end_loses_nothing_to_one_without() {
        let length = 0.7;
        for size in (-60..=14).map(|n| nanotap_arithmetic::exp(f64::from(n) * 0.25)) {
            for angle in (0..32).map(|n| f64::from(n) * std::f64::consts::PI / 16.0) {
                let (sin, cos) = nanotap_arithmetic::sin_cos(angle);
                let z = Complex::new(cos, sin) * size;
                let end = z.exponential();
                let found = Rate::new(z / length, length).integral(length, end);
                let error = (found - phi1(z) * length).modulus();
                // What rounding of e^z, which turns by |z|, and the worst quotient cost.
                let allowed = 2.0 / SLOW * f64::EPSILON * length * end.modulus().max(1.0);
                assert!(error <= allowed, "z = {z}: {error:e} of {allowed:e}");
            }
        }
        assert_eq!(
            Rate::new(Complex::new(0.0, 0.0), length).integral(length, Complex::new(1.0, 0.0)),
            Complex::new(length, 0.0)
        );
    }
}
