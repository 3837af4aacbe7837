//! What can be read off a motion: extrema, contact, forces, energy, harmonics,
//! beam clearance. Everything is exact on the piecewise closed form: extrema from
//! roots of rates, integrals in closed form, never from samples.

mod clearance;
mod energy;
mod harmonics;
pub mod mode_share;
mod physical_motion;
mod physical_sight;
pub mod time_series;

pub use clearance::Clearance;
pub use energy::EnergyBalance;
pub(crate) use harmonics::lag;
pub use harmonics::{Harmonic, Spectrum};
pub use physical_motion::{PhysicalHarmonic, PhysicalMotion};
pub use physical_sight::PhysicalSight;

use nanotap_flow::trajectory::PiecewiseSignal;
use nanotap_flow::{Complex, Trajectory};
use serde::Serialize;

use crate::model::Model;

/// Observables of a recorded motion, in the model's own units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Observables {
    /// Length of time observed, in drive periods (a run says it as `periods`).
    #[serde(skip)]
    pub periods: f64,
    /// Greatest tip displacement W.
    pub tip_max: f64,
    /// Least tip displacement W.
    pub tip_min: f64,
    /// Half of peak to peak of W.
    pub amplitude: f64,
    /// Amplitude of W at the drive's frequency: what a lock-in amplifier reads, A.
    pub first_harmonic: f64,
    /// Lag of W at the drive's frequency behind the drive sin Ωτ (of a driven base: behind
    /// the base's displacement), degrees in (−180, 180]; 90 at the free resonance of a
    /// lever with high Q.
    pub phase: f64,
    /// The component of W at the drive's frequency: Re(c e^{iΩτ}).
    #[serde(skip)]
    pub fundamental: Complex,
    /// The same of the second tone, if there is one.
    #[serde(flatten)]
    pub second_tone: Option<SecondTone>,
    /// Time mean of W.
    pub mean_deflection: f64,
    /// Root mean square of W about its mean.
    pub rms_deflection: f64,
    /// Least and greatest gap V_T, the tip's height over the undeformed surface.
    pub gap_range: [f64; 2],
    /// Part of the time in contact.
    pub contact_fraction: f64,
    /// Time in contact in one drive period, in units of τ.
    pub contact_time: f64,
    /// Greatest depth of the tip below the resting surface, 0 if it never gets there.
    pub indentation: f64,
    /// Contacts begun a drive period.
    pub contacts_per_period: f64,
    /// Greatest force of the sample on the tip (0 without contact; impacts of a rigid
    /// stop are impulses and not counted).
    pub peak_force: f64,
    /// Least force: below zero where the sample pulls, as the paper's damper does on a tip
    /// that leaves.
    pub least_force: f64,
    /// Time mean of that force.
    pub mean_force: f64,
    /// Energy that the sample takes in one drive period, E_dis.
    pub dissipation: f64,
    /// Time mean of force times deflection, ⟨F W⟩, the force counted along W: negative where
    /// a repelling sample pushes while the tip is deflected towards it. Impacts of a rigid
    /// stop are not counted.
    pub virial: f64,
    /// Mean power of the drive.
    pub drive_power: f64,
    /// Mean power that the sample takes.
    pub sample_power: f64,
    /// Greatest speed of approach at which a contact begins.
    pub impact_speed: f64,
    /// Least and greatest slope ∂W/∂ξ at the tip; of a beam.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope_range: Option<[f64; 2]>,
    /// What an optical lever reads; of a beam.
    #[serde(flatten)]
    pub optical_lever: Option<OpticalLever>,
    /// Energy fed and drained.
    pub energy_balance: EnergyBalance,
    /// Least height of the beam above the sample; of a beam.
    #[serde(flatten)]
    pub beam_clearance: Option<Clearance>,
    /// Contacts that only graze, within rounding.
    pub grazing_contacts: usize,
}

/// What an optical lever reads: the slope at the tip, taken for a deflection as if a static
/// force at the tip had bent the beam. Such a beam has the slope 3W/2, so W is taken to be
/// ⅔ ∂W/∂ξ; the bare beam's first mode, whose slope is 1.3765 W, then reads 0.918 W.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OpticalLever {
    /// Amplitude of ⅔ ∂W/∂ξ at the drive's frequency.
    #[serde(rename = "optical_amplitude")]
    pub amplitude: f64,
    /// Its phase, counted as the deflection's.
    #[serde(rename = "optical_phase")]
    pub phase: f64,
    /// Its component at the drive's frequency: Re(c e^{iΩτ}).
    #[serde(skip)]
    pub fundamental: Complex,
}

/// The tip deflection at the frequency of a second tone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SecondTone {
    /// Its amplitude.
    #[serde(rename = "tone2_response")]
    pub amplitude: f64,
    /// Its lag behind the second tone itself, degrees in (−180, 180].
    #[serde(rename = "tone2_lag")]
    pub phase: f64,
    /// The component Re(c e^{iwτ}), turned back by the tone's own phase.
    #[serde(skip)]
    pub component: Complex,
}

impl SecondTone {
    fn of(component: Complex) -> Self {
        Self {
            amplitude: component.norm(),
            phase: lag(component),
            component,
        }
    }

    fn read(model: &Model, tip: &PiecewiseSignal) -> Option<Self> {
        let omega = *model.system.drive().frequencies().get(1)?;
        let own = Complex::new(0.0, -model.second_phase).exp();
        Some(Self::of(tip.fourier(omega) * own))
    }
}

impl OpticalLever {
    fn of(fundamental: Complex) -> Self {
        Self {
            amplitude: fundamental.norm(),
            phase: lag(fundamental),
            fundamental,
        }
    }
}

impl Observables {
    /// Observables of `trajectory`, a recording of `model`; `None` of an empty one.
    pub fn of(model: &Model, trajectory: &Trajectory) -> Option<Self> {
        let duration = trajectory.end();
        if duration <= 0.0 {
            return None;
        }
        let tip = trajectory.signal(&model.tip);
        let (low, high) = tip.range()?;
        let (gap_low, gap_high) = trajectory.signal(&model.height).range()?;
        let force = trajectory.signal_by_regime(&model.force);
        let (least, peak) = force.range()?;
        let mean = tip.mean();
        let mean_square = tip.product_integral(&tip) / duration;
        let begins = trajectory
            .events()
            .iter()
            .filter(|e| begins_contact(model, e.from, e.to));
        let contact: f64 = (0..model.contact.len())
            .filter(|&r| model.contact[r])
            .map(|r| trajectory.time_in(r))
            .sum();
        let omega = model.frequency();
        let slope = model
            .beam
            .as_ref()
            .map(|beam| trajectory.signal(&beam.slope));
        let slope_range = slope.as_ref().and_then(|slope| {
            let (low, high) = slope.range()?;
            Some([low.value, high.value])
        });
        let optical_lever = slope
            .as_ref()
            .map(|slope| OpticalLever::of(slope.fourier(omega) * (2.0 / 3.0)));
        let fundamental = tip.fourier(omega);
        let periods = duration / model.period();
        let energy_balance = EnergyBalance::of(model, trajectory);
        Some(Self {
            periods,
            tip_max: high.value,
            tip_min: low.value,
            amplitude: 0.5 * (high.value - low.value),
            first_harmonic: fundamental.norm(),
            phase: lag(fundamental),
            fundamental,
            second_tone: SecondTone::read(model, &tip),
            mean_deflection: mean,
            rms_deflection: (mean_square - mean * mean).max(0.0).sqrt(),
            gap_range: [gap_low.value, gap_high.value],
            contact_fraction: contact / duration,
            contact_time: contact / periods,
            indentation: (-gap_low.value).max(0.0),
            contacts_per_period: begins.clone().count() as f64 / (duration / model.period()),
            peak_force: peak.value.max(0.0),
            least_force: least.value,
            mean_force: force.mean(),
            dissipation: energy_balance.sample_damping / periods,
            virial: virial(model, &force, &tip),
            drive_power: energy_balance.drive_work / duration,
            sample_power: energy_balance.sample_damping / duration,
            impact_speed: begins.clone().map(|e| -e.rate).fold(0.0, f64::max),
            slope_range,
            optical_lever,
            energy_balance,
            beam_clearance: Clearance::of(model, trajectory),
            grazing_contacts: begins.filter(|e| e.grazing).count(),
        })
    }

    /// Observables of this stretch and the one that follows it together.
    #[must_use]
    pub fn joined(&self, next: &Self) -> Self {
        let periods = self.periods + next.periods;
        let mean = |a: f64, b: f64| (a * self.periods + b * next.periods) / periods;
        let tip_max = self.tip_max.max(next.tip_max);
        let tip_min = self.tip_min.min(next.tip_min);
        let mean_deflection = mean(self.mean_deflection, next.mean_deflection);
        let fundamental =
            (self.fundamental * self.periods + next.fundamental * next.periods) / periods;
        let second_tone = self.second_tone.zip(next.second_tone).map(|(a, b)| {
            SecondTone::of((a.component * self.periods + b.component * next.periods) / periods)
        });
        let optical_lever = self.optical_lever.zip(next.optical_lever).map(|(a, b)| {
            OpticalLever::of(
                (a.fundamental * self.periods + b.fundamental * next.periods) / periods,
            )
        });
        let square = |o: &Self| o.rms_deflection.powi(2) + o.mean_deflection.powi(2);
        let hull = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let clearance = match (self.beam_clearance, next.beam_clearance) {
            (Some(a), Some(b)) => Some(if b.height < a.height {
                Clearance {
                    period: b.period + self.periods,
                    ..b
                }
            } else {
                a
            }),
            (a, b) => a.or(b),
        };
        Self {
            periods,
            tip_max,
            tip_min,
            amplitude: 0.5 * (tip_max - tip_min),
            first_harmonic: fundamental.norm(),
            phase: lag(fundamental),
            fundamental,
            second_tone,
            mean_deflection,
            rms_deflection: (mean(square(self), square(next)) - mean_deflection.powi(2))
                .max(0.0)
                .sqrt(),
            gap_range: hull(self.gap_range, next.gap_range),
            contact_fraction: mean(self.contact_fraction, next.contact_fraction),
            contact_time: mean(self.contact_time, next.contact_time),
            indentation: self.indentation.max(next.indentation),
            contacts_per_period: mean(self.contacts_per_period, next.contacts_per_period),
            peak_force: self.peak_force.max(next.peak_force),
            least_force: self.least_force.min(next.least_force),
            mean_force: mean(self.mean_force, next.mean_force),
            dissipation: mean(self.dissipation, next.dissipation),
            virial: mean(self.virial, next.virial),
            drive_power: mean(self.drive_power, next.drive_power),
            sample_power: mean(self.sample_power, next.sample_power),
            impact_speed: self.impact_speed.max(next.impact_speed),
            slope_range: self
                .slope_range
                .zip(next.slope_range)
                .map(|(a, b)| hull(a, b)),
            optical_lever,
            energy_balance: self.energy_balance.joined(&next.energy_balance),
            beam_clearance: clearance,
            grazing_contacts: self.grazing_contacts + next.grazing_contacts,
        }
    }
}

/// ⟨F W⟩ of a force that pushes the tip away from the sample. The cantilever's W points away
/// from it, an oscillator's x towards its stop.
pub(crate) fn virial(model: &Model, force: &PiecewiseSignal, tip: &PiecewiseSignal) -> f64 {
    let away = if model.beam.is_some() { 1.0 } else { -1.0 };
    away * force.product_integral(tip) / tip.duration()
}

/// Work of the tip on the sample, −∫ F V̇_T dt, and what impacts take: over a period of an
/// orbit what the sample dissipates, whatever it is made of.
pub(crate) fn contact_work(model: &Model, trajectory: &Trajectory, force: &PiecewiseSignal) -> f64 {
    let drive = model.system.drive();
    let rates: Vec<_> = model
        .system
        .regimes()
        .iter()
        .map(|r| model.height.rate(r.matrix(), r.forcing(), drive))
        .collect();
    let impacts: f64 = trajectory
        .events()
        .iter()
        .filter(|e| begins_contact(model, e.from, e.to))
        .map(|e| e.rate * e.rate)
        .sum();
    model.impact_loss * impacts - force.product_integral(&trajectory.signal_by_regime(&rates))
}

/// `work` on a sample, or 0 where it is the rounding of what the contact stores and gives back,
/// force times indentation.
pub(crate) fn above_rounding(work: f64, peak_force: f64, indentation: f64) -> f64 {
    const ROUNDING: f64 = 1e-12;
    if work.abs() <= ROUNDING * peak_force * indentation {
        0.0
    } else {
        work
    }
}

/// Whether a switch begins a contact: from flight into contact, or an impact.
pub fn begins_contact(model: &Model, from: usize, to: usize) -> bool {
    !model.contact[from] && (model.contact[to] || from == to)
}
