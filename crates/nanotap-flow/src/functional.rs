//! Functionals of outputs along a motion: extrema, integrals, products, Fourier coefficients.

use nalgebra::Complex;
use nanotap_arithmetic::Scalar;

/// A functional of the outputs `C` along a motion, at angular frequencies `F`. By default outputs are
/// numbers in a list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Functional<C = usize, F = f64> {
    /// Least value of the output along the motion, in the units of the output.
    Least(C),
    /// Greatest value of the output along the motion, in the units of the output.
    Greatest(C),
    /// Integral `∫ g dt` of the output along the motion, in units of the output times time.
    Integral(C),
    /// Integral `∫ g h dt` of a product; the integral of the square if both outputs are the same.
    Product(C, C),
    /// Fourier integral `∫ g e^{−iωt} dt`. Over a duration `D`, `c = (2/D) ∫ g e^{−iωt} dt` is the
    /// complex amplitude of the component `Re(c e^{iωt})`.
    Fourier(C, F),
}

impl<C, F> Functional<C, F> {
    /// Returns the same functional with outputs and frequencies converted.
    pub fn map<D, G>(
        self,
        mut output: impl FnMut(C) -> D,
        frequency: impl FnOnce(F) -> G,
    ) -> Functional<D, G> {
        match self {
            Self::Least(g) => Functional::Least(output(g)),
            Self::Greatest(g) => Functional::Greatest(output(g)),
            Self::Integral(g) => Functional::Integral(output(g)),
            Self::Product(g, h) => Functional::Product(output(g), output(h)),
            Self::Fourier(g, omega) => Functional::Fourier(output(g), frequency(omega)),
        }
    }
}

impl Functional {
    /// Returns the output of an extremum and its sign: −1 for a least value, 1 for a greatest one.
    pub const fn extremum(self) -> Option<(usize, f64)> {
        match self {
            Self::Least(g) => Some((g, -1.0)),
            Self::Greatest(g) => Some((g, 1.0)),
            _ => None,
        }
    }

    /// Returns the angular frequency of a Fourier coefficient.
    pub const fn frequency(self) -> Option<f64> {
        match self {
            Self::Fourier(_, omega) => Some(omega),
            _ => None,
        }
    }

    /// Returns the value over an empty motion: infinite for an extremum, 0 otherwise.
    pub fn initial<D: Scalar>(self) -> Complex<D> {
        let value = self
            .extremum()
            .map_or(0.0, |(_, sign)| -sign * f64::INFINITY);
        Complex::new(D::constant(value), D::constant(0.0))
    }

    /// Adds a quadrature node of this weight to an integral; `values` are those of the outputs
    /// there, and `phase(ω) = ωt` is the phase of a Fourier coefficient at ω. Extrema do not
    /// change.
    #[inline]
    pub fn add_node<D: Scalar>(
        self,
        sum: &mut Complex<D>,
        weight: D,
        values: &[D],
        phase: impl FnOnce(f64) -> D,
    ) {
        match self {
            Self::Least(_) | Self::Greatest(_) => {}
            Self::Integral(g) => sum.re = sum.re + weight * values[g],
            Self::Product(g, h) => sum.re = sum.re + weight * values[g] * values[h],
            Self::Fourier(g, omega) => {
                let (sin, cos) = phase(omega).sin_cos();
                let value = weight * values[g];
                sum.re = sum.re + cos * value;
                sum.im = sum.im - sin * value;
            }
        }
    }
}
