//! A rectangular lever in a fluid: the mass that moves with it, and its damping.
//!
//! On a beam of width b that swings at ω the fluid acts with (π/4) ρ b² ω² Γ(ω) times the
//! deflection a length (J. E. Sader, J. Appl. Phys. 84, 64 (1998)): Γ_r adds (π/4) ρ b² Γ_r to its
//! mass a length, Γ_i damps it. Γ is that of a circular cylinder, 1 + 4i K₁(z)/(√(i Re) K₀(z)) with
//! z = −i √(i Re) and Re = ρωb²/(4η), times Sader's fit for a thin blade. The second and third mode have
//! the Γ of their own frequency and wavelength ([`Blade`]). Near a surface all three have that of a blade
//! over a wall.

use nalgebra::Complex;
use nanotap_arithmetic::ComplexFunctions as _;
use std::f64::consts::TAU;

use super::blade::Blade;
use super::error::PhysicalError;
use super::reader::Reader;
use crate::key::Key;
use crate::quantity::Kind;

/// Reynolds numbers for which the fit holds.
const REYNOLDS: [f64; 2] = [1e-6, 1e4];

/// The fluid around a lever; SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fluid {
    /// Density ρ of the fluid, kg/m³.
    pub density: f64,
    /// Dynamic viscosity η of the fluid, Pa s.
    pub viscosity: f64,
    /// Height of the lever over a parallel surface, m; `None` far from any surface.
    pub height: Option<f64>,
}

impl Fluid {
    /// Reads the fluid of `[cantilever]`.
    pub(crate) fn read(reader: Reader<'_>) -> Result<Option<Self>, PhysicalError> {
        let [density, viscosity] = [Key::FluidDensity, Key::FluidViscosity];
        let missing = |key| PhysicalError::missing(key, "a fluid has a density and a viscosity");
        let height = reader.number(Key::LeverHeight)?;
        match (reader.number(density)?, reader.number(viscosity)?) {
            (None, None) if height.is_some() => Err(PhysicalError::missing(
                density,
                "the height over the surface matters to the fluid between",
            )),
            (None, None) => Ok(None),
            (Some(density), Some(viscosity)) => Ok(Some(Self {
                density,
                viscosity,
                height,
            })),
            (Some(_), None) => Err(missing(viscosity)),
            (None, Some(_)) => Err(missing(density)),
        }
    }

    /// Re = ρωb²/(4η) of a beam of width `width` in m at `frequency` in Hz.
    pub fn reynolds(self, width: f64, frequency: f64) -> f64 {
        self.density * TAU * frequency * width * width / (4.0 * self.viscosity)
    }

    /// The blade of a mode with this wavenumber at `frequency` in Hz.
    pub(super) fn blade(self, width: f64, frequency: f64, wavenumber: f64) -> Blade {
        Blade {
            wavenumber: wavenumber * width,
            reynolds: self.reynolds(width, frequency),
            gap: self.height.map(|height| height / width),
        }
    }

    /// Γ of the first mode at a frequency in Hz.
    pub(super) fn on_lever(
        self,
        width: f64,
        frequency: f64,
    ) -> Result<Complex<f64>, PhysicalError> {
        let reynolds = self.reynolds(width, frequency);
        if let Some(height) = self
            .height
            .filter(|height| *height < Blade::MIN_GAP * width)
        {
            return Err(PhysicalError::impossible(
                Key::LeverHeight,
                Kind::Length.format(height),
                format!(
                    "below {} of the lever's width the fluid is a film whose thickness the slope and the \
                     bending of the lever determine; here it must be at least {}",
                    Blade::MIN_GAP,
                    Kind::Length.format(Blade::MIN_GAP * width)
                ),
            ));
        }
        let over_surface = self.height.and_then(|_| {
            let blade = self.blade(width, frequency, 0.0);
            blade.hydrodynamic_function()
        });
        if let Some(gamma) = over_surface {
            return Ok(gamma);
        }
        if (REYNOLDS[0]..=REYNOLDS[1]).contains(&reynolds) && self.height.is_none() {
            return Ok(hydrodynamic_function(reynolds));
        }
        Err(PhysicalError::impossible(
            Key::FluidViscosity,
            Kind::Viscosity.format(self.viscosity),
            format!(
                "the lever's Reynolds number ρωb²/(4η) would be {reynolds:.3e}, and the hydrodynamic \
                 function is known from 1e-6 to {:e}",
                self.height.map_or(REYNOLDS[1], |_| Blade::REYNOLDS[1])
            ),
        ))
    }
}

/// Γ of a thin rectangular blade at Reynolds number Re = ρωb²/(4η), time as e^{−iωt}.
pub fn hydrodynamic_function(reynolds: f64) -> Complex<f64> {
    let polynomial = |coefficients: &[f64]| {
        let tau = nanotap_arithmetic::log10(reynolds);
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
            assert!(
                (found.im / imaginary - 1.0).abs() < 1e-11,
                "{reynolds}: {found}"
            );
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
}
