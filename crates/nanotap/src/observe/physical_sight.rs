//! What a motion looks like, in SI.

use serde::Serialize;

use crate::case::physical::Resolved;
use crate::case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use crate::figure::branch::Shown;
use crate::study::branch::Sight;

/// The columns of an experiment's curve; SI units, angles in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PhysicalSight {
    /// Amplitude A at the drive's frequency, m.
    #[serde(rename = "A")]
    pub first_harmonic: f64,
    /// A over the free amplitude A₀ of the case.
    #[serde(rename = "A_ratio")]
    pub amplitude_ratio: f64,
    /// Phase behind the drive, degrees.
    pub phase: f64,
    /// Greatest tip deflection, m.
    pub tip_max: f64,
    /// Least tip deflection, m.
    pub tip_min: f64,
    /// Half of peak to peak of the tip deflection, m.
    pub amplitude: f64,
    /// Mean deflection, m.
    pub mean_deflection: f64,
    /// Greatest force of the sample on the tip, N.
    #[serde(rename = "F_max")]
    pub peak_force: f64,
    /// Mean force, N.
    pub mean_force: f64,
    /// Greatest depth of the tip below the resting surface, m.
    pub indentation: f64,
    /// Time in contact in one drive period, s.
    pub contact_time: f64,
    /// Energy that the sample takes in one drive period, J.
    #[serde(rename = "E_dis")]
    pub dissipation: f64,
    /// The same, eV.
    #[serde(rename = "E_dis_eV")]
    pub dissipation_ev: f64,
    /// Virial ⟨F W⟩, J.
    pub virial: f64,
    /// The same, eV.
    #[serde(rename = "virial_eV")]
    pub virial_ev: f64,
    /// Greatest speed at which a contact begins, m/s.
    pub impact_speed: f64,
}

impl PhysicalSight {
    /// What a picture shows of it; `None` where SI says no more than the model.
    pub(crate) const fn shown(&self, shown: Shown) -> Option<f64> {
        Some(match shown {
            Shown::TipMax => self.tip_max,
            Shown::TipMin => self.tip_min,
            Shown::Amplitude => self.amplitude,
            Shown::FirstHarmonic => self.first_harmonic,
            Shown::PeakForce => self.peak_force,
            Shown::Dissipation => self.dissipation,
            Shown::Indentation => self.indentation,
            Shown::ImpactSpeed => self.impact_speed,
            Shown::Phase | Shown::ContactFraction | Shown::SpectralRadius => return None,
        })
    }

    /// `sight`, of a motion of the case `resolved`, in SI.
    pub fn of(sight: &Sight, resolved: &Resolved) -> Self {
        let scales = &resolved.scales;
        let first_harmonic = sight.first_harmonic * scales.length;
        let dissipation = sight.dissipation * scales.energy;
        let virial = sight.virial * scales.energy;
        Self {
            first_harmonic,
            amplitude_ratio: first_harmonic / resolved.free_amplitude,
            phase: sight.phase,
            tip_max: sight.tip_max * scales.length,
            tip_min: sight.tip_min * scales.length,
            amplitude: sight.amplitude * scales.length,
            mean_deflection: sight.mean_deflection * scales.length,
            peak_force: sight.peak_force * scales.force,
            mean_force: sight.mean_force * scales.force,
            indentation: sight.indentation * scales.length,
            contact_time: sight.contact_time * scales.time,
            dissipation,
            dissipation_ev: dissipation / JOULES_PER_ELECTRONVOLT,
            virial,
            virial_ev: virial / JOULES_PER_ELECTRONVOLT,
            impact_speed: sight.impact_speed * scales.velocity,
        }
    }
}
