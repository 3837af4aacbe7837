//! A motion in SI units, in the words of the laboratory.

use serde::Serialize;

use super::{Harmonic, Observables, Spectrum};
use crate::case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use crate::case::physical::{Resolved, Scales};

/// What an experimenter would measure of a motion; SI units, angles in degrees.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhysicalMotion {
    /// Greatest tip deflection, m.
    pub tip_max: f64,
    /// Least tip deflection, m.
    pub tip_min: f64,
    /// Half of peak to peak of the tip deflection, m.
    pub amplitude: f64,
    /// Amplitude A at the drive's frequency, m: what a lock-in amplifier reads.
    #[serde(rename = "A")]
    pub first_harmonic: f64,
    /// A over the free amplitude A₀: the setpoint ratio of this motion.
    #[serde(rename = "A_ratio")]
    pub amplitude_ratio: f64,
    /// Lag of the deflection at the drive's frequency behind `phase_reference`, degrees in
    /// (−180, 180]: 90 at the free resonance.
    pub phase: f64,
    /// What the phase is counted from.
    pub phase_reference: &'static str,
    /// Time mean of the deflection, m.
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
    /// Mean power of the drive, W.
    pub drive_power: f64,
    /// Mean power that the sample takes, W.
    pub sample_power: f64,
    /// Greatest speed at which a contact begins, m/s.
    pub impact_speed: f64,
    /// Drive frequency, Hz.
    pub frequency: f64,
    /// Amplitude that an optical lever, calibrated by a static force, reads at the drive's
    /// frequency, m.
    pub optical_amplitude: Option<f64>,
    /// Its phase, degrees.
    pub optical_phase: Option<f64>,
    /// Least and greatest slope dw/dx at the tip; where the lever's length is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope_range: Option<[f64; 2]>,
    /// Harmonics of the drive's frequency; of a periodic motion.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub harmonics: Vec<PhysicalHarmonic>,
}

/// One component of a periodic motion; SI units, angles in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PhysicalHarmonic {
    /// Frequency as a multiple of the drive's.
    pub order: f64,
    /// Frequency, Hz.
    pub frequency: f64,
    /// Amplitude of the tip deflection, m.
    pub tip: f64,
    /// Its lag behind sin(order · ωt), degrees in (−180, 180].
    pub tip_phase: f64,
    /// Amplitude of the force, N.
    pub force: f64,
    /// Its lag, degrees.
    pub force_phase: f64,
    /// Amplitude of the slope dw/dx at the tip; where the lever's length is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope: Option<f64>,
}

impl PhysicalMotion {
    /// `o`, a motion of the case `resolved`, in SI; with `spectrum` its harmonics too.
    pub fn of(o: &Observables, spectrum: Option<&Spectrum>, resolved: &Resolved) -> Self {
        let scales = &resolved.scales;
        let dissipation = o.dissipation * scales.energy;
        let virial = o.virial * scales.energy;
        let first_harmonic = o.first_harmonic * scales.length;
        Self {
            tip_max: o.tip_max * scales.length,
            tip_min: o.tip_min * scales.length,
            amplitude: o.amplitude * scales.length,
            first_harmonic,
            amplitude_ratio: first_harmonic / resolved.free_amplitude,
            phase: o.phase,
            phase_reference: resolved.phase_reference(),
            mean_deflection: o.mean_deflection * scales.length,
            peak_force: o.peak_force * scales.force,
            mean_force: o.mean_force * scales.force,
            indentation: o.indentation * scales.length,
            contact_time: o.contact_time * scales.time,
            dissipation,
            dissipation_ev: dissipation / JOULES_PER_ELECTRONVOLT,
            virial,
            virial_ev: virial / JOULES_PER_ELECTRONVOLT,
            drive_power: o.drive_power * scales.power,
            sample_power: o.sample_power * scales.power,
            impact_speed: o.impact_speed * scales.velocity,
            frequency: resolved.case.omega * scales.frequency,
            optical_amplitude: o.optical_lever.map(|l| l.amplitude * scales.length),
            optical_phase: o.optical_lever.map(|l| l.phase),
            slope_range: o
                .slope_range
                .zip(scales.slope)
                .map(|(range, unit)| range.map(|s| s * unit)),
            harmonics: spectrum.map_or_else(Vec::new, |spectrum| {
                spectrum
                    .harmonics
                    .iter()
                    .map(|h| PhysicalHarmonic::of(h, resolved.case.omega, scales))
                    .collect()
            }),
        }
    }
}

impl PhysicalHarmonic {
    fn of(h: &Harmonic, omega: f64, scales: &Scales) -> Self {
        Self {
            order: h.order,
            frequency: h.order * omega * scales.frequency,
            tip: h.tip * scales.length,
            tip_phase: h.tip_phase,
            force: h.force * scales.force,
            force_phase: h.force_phase,
            slope: h.slope.zip(scales.slope).map(|(s, unit)| s * unit),
        }
    }
}
