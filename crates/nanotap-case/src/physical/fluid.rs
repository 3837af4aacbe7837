//! A rectangular lever in a fluid: the mass that moves with it, and its damping.
//!
//! On a beam of width b that swings at ω the fluid acts with (π/4) ρ b² ω² Γ(ω) times the
//! deflection a length (J. E. Sader, J. Appl. Phys. 84, 64 (1998)): Γ_r adds (π/4) ρ b² Γ_r to its
//! mass a length, Γ_i damps it. [`hydrodynamic_function`] is the Γ of the first mode at
//! Re = ρωb²/(4η). The second and third mode have the Γ of their own frequency and wavelength
//! ([`Blade`]). Near a surface all three have that of a blade over a wall.

use std::f64::consts::TAU;

pub use afm_thermal::hydrodynamic_function;

use afm_thermal::REYNOLDS;
use nalgebra::Complex;

use super::blade::Blade;
use super::error::PhysicalError;
use super::reader::Reader;
use crate::key::Key;
use crate::quantity::Kind;

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
