//! Sader's method: k from resonance frequency, quality factor and dimensions seen from above.

use std::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::positive;
use crate::{Error, Fluid, hydrodynamic_function};

/// Dimensions of a rectangular lever seen from above.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Plan {
    /// Length L, m.
    pub length: f64,
    /// Width b, m.
    pub width: f64,
}

impl Plan {
    /// Static spring constant in N/m, k = 0.1906 ρ b² L Q Γᵢ(Re) ω0² (J. E. Sader et al., Rev. Sci.
    /// Instrum. 70, 3967 (1999)), with f0 in Hz and Q of the lever in this fluid. For L ≫ b ≫ thickness
    /// and Q ≫ 1.
    ///
    /// # Errors
    /// If a number is not above zero, or the Reynolds number is outside 1e-6 to 1e4.
    pub fn stiffness(&self, f0: f64, q: f64, fluid: &Fluid) -> Result<f64, Error> {
        for (name, value) in [
            ("the length of the lever in m", self.length),
            ("the width of the lever in m", self.width),
            ("the resonance frequency in Hz", f0),
            ("the quality factor", q),
        ] {
            positive(name, value)?;
        }
        let omega = TAU * f0;
        let gamma = hydrodynamic_function(fluid.reynolds(self.width, f0)?).im;
        let area = self.width * self.width * self.length;
        Ok(0.1906 * fluid.density * area * q * gamma * omega * omega)
    }
}

/// A lever of the same shape with a known spring constant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReferenceLever {
    /// Spring constant, N/m.
    pub stiffness: f64,
    /// Resonance frequency in the same fluid, Hz.
    pub frequency: f64,
    /// Quality factor in the same fluid.
    pub quality: f64,
}

impl ReferenceLever {
    /// Spring constant in N/m of a lever of the same shape and dimensions seen from above, of any
    /// shape: k = k_ref (Q f0^1.3)/(Q_ref f0_ref^1.3) (J. E. Sader et al., Rev. Sci. Instrum. 83,
    /// 103705 (2012)).
    ///
    /// # Errors
    /// If a number is not finite and above zero.
    pub fn stiffness(&self, f0: f64, q: f64) -> Result<f64, Error> {
        for (name, value) in [
            (
                "the spring constant of the reference in N/m",
                self.stiffness,
            ),
            ("the frequency of the reference in Hz", self.frequency),
            ("the quality factor of the reference", self.quality),
            ("the resonance frequency in Hz", f0),
            ("the quality factor", q),
        ] {
            positive(name, value)?;
        }
        let frequencies = nanotap_arithmetic::powf(f0 / self.frequency, 1.3);
        Ok(self.stiffness * q / self.quality * frequencies)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the function `sader` that Nanosurf publishes in NSFopen 2.2.4 for a lever of 225 × 40 µm,
    /// ρ = 1.18 kg/m³ and η = 18.6 µPa s, evaluated with SciPy: f0 = 179.8 kHz, Q = 442.
    #[test]
    fn a_lever_in_air_as_its_maker_computes_it() {
        let plan = Plan {
            length: 225e-6,
            width: 40e-6,
        };
        let air = Fluid {
            density: 1.18,
            viscosity: 1.86e-5,
        };
        let k = plan.stiffness(179.8e3, 442.0, &air).unwrap();
        assert!((k / NANOSURF - 1.0).abs() < 1e-9, "{k}");
    }

    const NANOSURF: f64 = 25.368_227_335;

    #[test]
    fn faulty_numbers_are_refused() {
        let plan = Plan {
            length: 225e-6,
            width: f64::NAN,
        };
        assert!(
            plan.stiffness(1e5, 100.0, &Fluid::air(298.0).unwrap())
                .is_err()
        );
        let reference = ReferenceLever {
            stiffness: 2.0,
            frequency: 70e3,
            quality: 200.0,
        };
        assert!(reference.stiffness(-1.0, 2.0).is_err());
        assert_eq!(reference.stiffness(70e3, 200.0).unwrap(), 2.0);
        let stiffer = reference.stiffness(140e3, 200.0).unwrap();
        // 2^1.3.
        assert!((stiffer / 2.0 - 2.462_288_826_689_833).abs() < 1e-12);
    }
}
