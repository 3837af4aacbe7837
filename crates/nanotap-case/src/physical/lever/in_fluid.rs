//! A lever in a fluid: added mass and damping.

use std::f64::consts::{PI, TAU};

use super::{Lever, Mode};
use crate::physical::error::PhysicalError;
use crate::physical::fluid::Fluid;
use crate::physical::remark::Remark;
use crate::quantity::Kind;
use nanotap_model::parameter::{Numbers, Parameter};

/// Largest number of iterations for the resonance in the fluid; each gains about a digit.
const MAX_ITERATIONS: usize = 60;

impl Fluid {
    /// The same lever of this width in the fluid. `lever` is that in vacuum; its stiffness and
    /// tip stay, the beam's mass, first resonance and quality factor become those in the fluid.
    pub(crate) fn around(
        self,
        lever: &Lever,
        width: f64,
        length: f64,
    ) -> Result<Lever, PhysicalError> {
        let tip = lever.tip_mass();
        let unit = PI / 4.0 * self.density * width * width * length;
        let mut found = *lever;
        // The added mass falls slowly with the frequency, so that this contracts.
        for _ in 0..MAX_ITERATIONS {
            let last = found.f0;
            let gamma = self.on_lever(width, last)?;
            found.beam_mass = lever.beam_mass + unit * gamma.re;
            found = found.with_tip(tip)?;
            if (found.f0 - last).abs() <= 1e-14 * last {
                break;
            }
        }
        let gamma = self.on_lever(width, found.f0)?;
        // The whole damper CL is unit ω Γ_i, and α3 = CL T/(mL).
        let damper = unit * TAU * found.f0 * gamma.im;
        let alpha3 = damper * found.time_unit() / found.beam_mass;
        found.quality_factor = 1.0;
        found.quality_factor = found.damping() / alpha3;
        Ok(found)
    }

    /// Frequency, quality factor and stiffness at the tip of the second and third mode of `lever`,
    /// which is that in the fluid: each swings with the mass and the damping that Γ has at its own
    /// frequency and wavelength. In SI; 0 beyond the `count` modes, and where Γ is not known.
    pub(crate) fn higher_modes(
        self,
        lever: &Lever,
        width: f64,
        length: f64,
        count: usize,
    ) -> Result<Numbers, PhysicalError> {
        let unit = PI / 4.0 * self.density * width * width * length;
        let dry = lever.beam_mass - unit * self.on_lever(width, lever.f0)?.re;
        let mut found = Numbers::ZERO;
        for k in 1..count.min(3) {
            let mut mode = lever.mode(k, lever.beam_mass)?;
            let gamma_of = |mode: &Mode| {
                self.blade(width, mode.frequency, mode.wavenumber / length)
                    .hydrodynamic_function()
            };
            for _ in 0..MAX_ITERATIONS {
                let Some(gamma) = gamma_of(&mode) else {
                    return Ok(found);
                };
                let last = mode.frequency;
                mode = lever.mode(k, dry + unit * gamma.re)?;
                if (mode.frequency - last).abs() <= 1e-14 * last {
                    break;
                }
            }
            let Some(gamma) = gamma_of(&mode) else {
                return Ok(found);
            };
            let mass = dry + unit * gamma.re;
            let share = lever.mode(k, mass)?.tip_share;
            // The beam's ∫φ² and the tip's φ(1)², of a mode that is 1 at the tip.
            let modal = mass / share + lever.tip_mass();
            let numbers = [
                mode.frequency,
                modal * share / (unit * gamma.im),
                modal * (TAU * mode.frequency).powi(2),
            ];
            let of_mode = Parameter::MEASURED.into_iter().skip(k - 1).step_by(2);
            for (parameter, number) in of_mode.zip(numbers) {
                found.set(parameter, number);
            }
        }
        Ok(found)
    }

    /// Note that reports resonance and quality factor in the fluid, with their source.
    pub(crate) fn remark(self, lever: &Lever, width: f64) -> Remark {
        let (over, source) = self.height.map_or((String::new(), "Sader 1998"), |height| {
            let height = Kind::Length.format(height);
            (format!(", {height} over a surface"), "Green and Sader 2005")
        });
        Remark::note(format!(
            "in a fluid of {} and {}{over} the lever resonates at {} with Q = {} (Re = {}; {source}), a \
             given f0 is that in vacuum; mass and damping of the second and third mode follow from \
             their frequency and wavelength (Van Eysden and Sader 2007), those of any beyond are \
             those of the first",
            Kind::Density.format(self.density),
            Kind::Viscosity.format(self.viscosity),
            Kind::Frequency.format(lever.f0),
            Kind::Number.format(lever.quality_factor),
            Kind::Number.format(self.reynolds(width, lever.f0)),
        ))
    }
}
