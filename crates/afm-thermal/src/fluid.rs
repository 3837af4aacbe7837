//! The fluid around a lever, and the hydrodynamic function of a thin rectangular lever in it.
//!
//! On a beam of width b that moves at ω the fluid acts with (π/4) ρ b² ω² Γ(ω) times the deflection a
//! length (J. E. Sader, J. Appl. Phys. 84, 64 (1998)). Γ is that of a circular cylinder,
//! 1 + 4i K₁(z)/(√(i Re) K₀(z)) with z = −i √(i Re) and Re = ρωb²/(4η), times Sader's fit for a thin
//! blade.

use std::f64::consts::TAU;

use nalgebra::Complex;
use nanotap_arithmetic::{ComplexFunctions as _, exp, log10, powf};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::error::{positive, require};

/// Reynolds numbers for which the hydrodynamic function is known.
pub const REYNOLDS: [f64; 2] = [1e-6, 1e4];

/// Zero of the Celsius scale, K.
const CELSIUS: f64 = 273.15;

/// A fluid; SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Fluid {
    /// Density ρ, kg/m³.
    pub density: f64,
    /// Dynamic viscosity η, Pa s.
    pub viscosity: f64,
}

impl Fluid {
    /// Dry air at this temperature in K and at 101,325 Pa: an ideal gas with Sutherland's viscosity
    /// (F. M. White, Viscous Fluid Flow, table 1-2).
    ///
    /// # Errors
    /// If the temperature is not between 100 and 1900 K.
    pub fn air(temperature: f64) -> Result<Self, Error> {
        let is_valid = (100.0..=1900.0).contains(&temperature);
        require(
            is_valid,
            "the temperature of air in K",
            temperature,
            "100 to 1900",
        )?;
        let ratio = temperature / 273.0;
        Ok(Self {
            density: 101_325.0 / (287.055 * temperature),
            viscosity: 1.716e-5 * powf(ratio, 1.5) * (273.0 + 111.0) / (temperature + 111.0),
        })
    }

    /// Water at this temperature in K and at 101,325 Pa (density: S. C. McCutcheon et al. in Handbook of
    /// Hydrology, 1993; viscosity: J. Kestin et al., J. Phys. Chem. Ref. Data 7, 941 (1978)).
    ///
    /// # Errors
    /// If the temperature is not between 273.15 and 373.15 K.
    pub fn water(temperature: f64) -> Result<Self, Error> {
        let t = temperature - CELSIUS;
        let is_valid = (0.0..=100.0).contains(&t);
        require(
            is_valid,
            "the temperature of water in K",
            temperature,
            "273.15 to 373.15",
        )?;
        let c = 20.0 - t;
        let decades = c / (t + 96.0) * (1.2364 - 1.37e-3 * c + 5.7e-6 * c * c);
        let expansion = (t + 288.9414) / (508_929.2 * (t + 68.12963)) * (t - 3.9863) * (t - 3.9863);
        Ok(Self {
            density: 1000.0 * (1.0 - expansion),
            viscosity: 1.002e-3 * exp(decades * std::f64::consts::LN_10),
        })
    }

    /// Re = ρωb²/(4η) of a beam of width `width` in m at `frequency` in Hz.
    ///
    /// # Errors
    /// If the hydrodynamic function is not known there ([`REYNOLDS`]).
    pub fn reynolds(&self, width: f64, frequency: f64) -> Result<f64, Error> {
        positive("the density of the fluid in kg/m³", self.density)?;
        positive("the viscosity of the fluid in Pa s", self.viscosity)?;
        let reynolds = self.density * TAU * frequency * width * width / (4.0 * self.viscosity);
        if (REYNOLDS[0]..=REYNOLDS[1]).contains(&reynolds) {
            Ok(reynolds)
        } else {
            Err(Error::Reynolds { reynolds })
        }
    }
}

/// Γ of a thin rectangular blade at Reynolds number Re = ρωb²/(4η), time as e^{−iωt}; for Re in
/// [`REYNOLDS`].
pub fn hydrodynamic_function(reynolds: f64) -> Complex<f64> {
    let polynomial = |coefficients: &[f64]| {
        let tau = log10(reynolds);
        coefficients.iter().rev().fold(0.0, |sum, c| sum * tau + c)
    };
    let real = polynomial(&[
        0.91324, -0.48274, 0.46842, -0.12886, 0.044055, -0.0035117, 0.00069085,
    ]) / polynomial(&[
        1.0, -0.56964, 0.48690, -0.13444, 0.045155, -0.0035862, 0.00069085,
    ]);
    let imaginary = polynomial(&[
        -0.024134,
        -0.029256,
        0.016294,
        -0.00010961,
        0.000064577,
        -0.000044510,
    ]) / polynomial(&[
        1.0, -0.59702, 0.55182, -0.18357, 0.079156, -0.014369, 0.0028361,
    ]);
    Complex::new(real, imaginary) * cylinder(reynolds)
}

/// Γ of a circular cylinder.
fn cylinder(reynolds: f64) -> Complex<f64> {
    let root = Complex::new(0.0, reynolds).square_root();
    let i = Complex::new(0.0, 1.0);
    Complex::new(1.0, 0.0) + 4.0 * i * bessel_ratio(-i * root) / root
}

/// K₁(z)/K₀(z) for |arg z| ≤ π/4, from K_ν(z) = ∫₀^∞ e^{−z cosh t} cosh νt dt. The integrand is
/// analytic for |Im t| < π/4 and as wide as |z|^(−1/2), so that the trapezoidal rule converges
/// like e^{−π²/(2h)} and better.
fn bessel_ratio(z: Complex<f64>) -> Complex<f64> {
    let step = 0.1 / (1.0 + z.modulus()).sqrt();
    let (mut first, mut zeroth) = (Complex::new(0.5, 0.0), Complex::new(0.5, 0.0));
    for k in 1..1000 {
        let t = step * f64::from(k);
        let cosh = nanotap_arithmetic::cosh(t);
        let exponent = z * (1.0 - cosh);
        if exponent.re < -60.0 {
            break;
        }
        let value = exponent.exponential();
        zeroth += value;
        first += value * cosh;
    }
    first / zeroth
}

#[cfg(test)]
mod tests {
    use super::*;

    /// K₁(1)/K₀(1) = 0.601907230197235/0.421024438240708 (Abramowitz and Stegun, table 9.8).
    #[test]
    fn the_ratio_of_bessel_functions() {
        let ratio = bessel_ratio(Complex::new(1.0, 0.0));
        assert!((ratio.re - 0.601_907_230_197_235 / 0.421_024_438_240_708).abs() < 1e-13);
        assert_eq!(ratio.im, 0.0);
    }

    /// By SciPy's K₀ and K₁ of complex argument and the same fit.
    #[test]
    fn the_hydrodynamic_function() {
        for (reynolds, real, imaginary) in REFERENCES {
            let found = hydrodynamic_function(reynolds);
            assert!((found.re / real - 1.0).abs() < 1e-11, "{reynolds}: {found}");
            let error = (found.im / imaginary - 1.0).abs();
            assert!(error < 1e-11, "{reynolds}: {found}");
        }
    }

    /// Reynolds number, real and imaginary part.
    const REFERENCES: [(f64, f64, f64); 6] = [
        (1e-4, 1.268_223_317_562_542e3, 7.936_999_500_577_785e3),
        (0.1, 1.048_487_968_924_215e1, 2.182_753_122_136_921e1),
        (1.0, 3.733_959_493_046_819, 4.074_610_833_672_524),
        (10.0, 1.918_318_106_250_274, 9.816_219_701_685_386e-1),
        (100.0, 1.326_272_250_865_219, 2.961_017_062_188_785e-1),
        (1e4, 1.042_045_090_229_725, 3.554_598_027_951_009e-2),
    ];

    /// Water: IAPWS-95 and IAPWS 2008, as tabulated by NIST. Air: E. W. Lemmon and R. T. Jacobsen, Int.
    /// J. Thermophys. 25, 21 (2004), at 300 K.
    #[test]
    fn air_and_water() {
        for (celsius, density, viscosity) in [
            (20.0, 998.21, 1.0016e-3),
            (25.0, 997.05, 0.8900e-3),
            (40.0, 992.22, 0.6527e-3),
        ] {
            let water = Fluid::water(CELSIUS + celsius).unwrap();
            assert!((water.density / density - 1.0).abs() < 3e-4, "{water:?}");
            assert!(
                (water.viscosity / viscosity - 1.0).abs() < 3e-3,
                "{water:?}"
            );
        }
        let air = Fluid::air(300.0).unwrap();
        assert!((air.density / 1.1770 - 1.0).abs() < 1e-3, "{air:?}");
        assert!((air.viscosity / 1.854e-5 - 1.0).abs() < 5e-3, "{air:?}");
        assert!(Fluid::water(200.0).is_err() && Fluid::air(f64::NAN).is_err());
    }

    #[test]
    fn reynolds_numbers_outside_the_fit_are_refused() {
        let water = Fluid::water(298.15).unwrap();
        assert!(water.reynolds(40e-6, 20e3).is_ok());
        assert!(water.reynolds(1.0, 1e6).is_err());
    }
}
