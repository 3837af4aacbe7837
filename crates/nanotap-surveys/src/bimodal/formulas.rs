//! Formulas by which the software of instruments evaluates the readings of both tones.
//!
//! All of it assumes a force that is small compared with the lever's, amplitudes A₁ ≫ A₂ and much larger than
//! the indentation, and a sphere of radius R on an elastic half space without adhesion. Then the mean
//! force F₀ follows from the first tone and the mean force gradient from the shift of the second:
//!
//! - AM: F₀ = k₁ A₁/(2 Q₁) √((A₀₁/A₁)² − 1); FM: F₀ = k₁ A₁ Δf₁/f₁;
//! - E* = √(8/(R A₁)) k₂² (Δf₂/f₂)² A₁/F₀ (Herruzo, Perrino and Garcia, Nature Communications 5, 3126, 2014;
//!   Garcia and Proksch, Eur. Polym. J. 49, 1897, 2013);
//! - indentation δ = 2 k₂ Δf₂/f₂ √(2 A₁/R)/E*;
//! - virial −k A A₀ cos φ/(2Q), under FM −k A² Δf/f, and energy π k A (A₀ sin φ − A f/f₀)/Q of a tone
//!   (San Paulo and García, Phys. Rev. B 64, 193411, 2001; Cleveland et al., Appl. Phys. Lett. 72, 2613,
//!   1998), with A₀ the free amplitude that the present drive would give at the resonance f₀;
//! - loss tangent (sin φ − A/A₀)/cos φ at resonance (Proksch and Yablon, Appl. Phys.
//!   Lett. 100, 073106, 2012).

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::Serialize;

/// Virial and dissipation of one tone by the formulas of instrument software.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ToneEstimates {
    /// Virial of the tip–sample force in the tone, J; negative where the force repels.
    #[schemars(extend("x-unit" = "J"))]
    pub virial: f64,
    /// Energy that the force takes from the tone in one of its periods, J.
    #[serde(rename = "E_dis")]
    #[schemars(extend("x-unit" = "J"))]
    pub dissipation: f64,
}

/// Estimates of sample properties from both tones; None where the readings allow none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Estimates {
    /// Reduced modulus E* in Pa.
    #[schemars(extend("x-unit" = "Pa"))]
    pub reduced_modulus: Option<f64>,
    /// Largest indentation of the sample, m.
    #[schemars(extend("x-unit" = "m"))]
    pub indentation: Option<f64>,
    /// Loss tangent tan δ from amplitude and phase of the first tone, dimensionless; None unless
    /// its drive is at resonance.
    pub loss_tangent: Option<f64>,
}

/// Calibration and readings of one tone, in SI.
#[derive(Clone, Copy, Debug)]
pub(super) struct Readings {
    /// Stiffness of the mode, N/m, and quality factor.
    pub(super) stiffness: f64,
    pub(super) quality: f64,
    pub(super) resonance: f64,
    /// Frequency of the drive less the resonance, Hz; None unless the loop holds the phase.
    pub(super) shift: Option<f64>,
    pub(super) amplitude: f64,
    /// Free amplitude at resonance under the present strength of the drive, m.
    pub(super) free_amplitude: f64,
    /// Phase lag behind the drive, rad.
    pub(super) phase: f64,
    /// Whether the constant drive is at resonance.
    pub(super) at_resonance: bool,
}

impl Readings {
    pub(super) fn estimates(&self) -> ToneEstimates {
        let (sin, cos) = nanotap_arithmetic::sin_cos(self.phase);
        let scale = self.stiffness * self.amplitude / self.quality;
        let virial = match self.shift {
            Some(shift) => {
                -self.stiffness * self.amplitude * self.amplitude * shift / self.resonance
            }
            None => -0.5 * scale * self.free_amplitude * cos,
        };
        let faster = 1.0 + self.shift.unwrap_or_default() / self.resonance;
        let dissipation = PI * scale * (self.free_amplitude * sin - self.amplitude * faster);
        ToneEstimates {
            virial,
            dissipation,
        }
    }

    /// Returns the mean force on the tip, N, by the formulas of the first tone.
    fn mean_force(&self) -> f64 {
        if let Some(shift) = self.shift {
            return self.stiffness * self.amplitude * shift / self.resonance;
        }
        let ratio = self.free_amplitude / self.amplitude;
        0.5 * self.stiffness * self.amplitude / self.quality * (ratio * ratio - 1.0).sqrt()
    }
}

/// Estimates sample properties from the readings of both tones and the radius of the tip, m.
pub(super) fn estimates([first, second]: &[Readings; 2], radius: Option<f64>) -> Estimates {
    let (sin, cos) = nanotap_arithmetic::sin_cos(first.phase);
    let loss_tangent = (sin - first.amplitude / first.free_amplitude) / cos;
    let force = first.mean_force();
    let gradient = second
        .shift
        .map(|shift| 2.0 * second.stiffness * shift / second.resonance);
    let elastic = radius
        .zip(gradient)
        .filter(|(_, gradient)| force > 0.0 && *gradient > 0.0);
    let modulus = elastic.map(|(radius, gradient)| {
        (0.5 / (radius * first.amplitude)).sqrt() * gradient * gradient * first.amplitude / force
    });
    let indentation = elastic.zip(modulus).map(|((radius, gradient), modulus)| {
        gradient * (2.0 * first.amplitude / radius).sqrt() / modulus
    });
    Estimates {
        reduced_modulus: modulus,
        indentation,
        loss_tangent: (first.at_resonance && loss_tangent.is_finite()).then_some(loss_tangent),
    }
}
