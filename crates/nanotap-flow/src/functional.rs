//! Functionals of outputs along a motion: extrema, integrals, products, Fourier coefficients.

use nalgebra::Complex;
use nanotap_arithmetic::Scalar;

/// A functional of the outputs `C` along a motion, at angular frequencies `F`. By default outputs are
/// numbers in a list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Functional<C = usize, F = f64> {
    /// The least value.
    Least(C),
    /// The greatest value.
    Greatest(C),
    /// `∫ g dt`.
    Integral(C),
    /// `∫ g h dt`; with itself, of the square.
    Product(C, C),
    /// `∫ g e^{−iωt} dt`. Twice this over the duration `D`, `c = (2/D) ∫ g e^{−iωt} dt`, is the
    /// amplitude of the component `Re(c e^{iωt})`.
    Fourier(C, F),
}

impl<C, F> Functional<C, F> {
    /// The same functional of other outputs and frequencies.
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
    /// The output of an extremum, and its sign: −1 of a least value, 1 of a greatest one.
    pub const fn extremum(self) -> Option<(usize, f64)> {
        match self {
            Self::Least(g) => Some((g, -1.0)),
            Self::Greatest(g) => Some((g, 1.0)),
            _ => None,
        }
    }

    /// The angular frequency of a Fourier coefficient.
    pub const fn frequency(self) -> Option<f64> {
        match self {
            Self::Fourier(_, omega) => Some(omega),
            _ => None,
        }
    }

    /// Its value over no time: infinite of an extremum.
    pub fn initial<D: Scalar>(self) -> Complex<D> {
        let value = self
            .extremum()
            .map_or(0.0, |(_, sign)| -sign * f64::INFINITY);
        Complex::new(D::constant(value), D::constant(0.0))
    }

    /// Adds a node of a quadrature of this weight, where outputs have these values and a Fourier
    /// coefficient at ω the phase `phase(ω) = ωt`, to an integral. Extrema stay as they are.
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
