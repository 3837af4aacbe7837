//! What can be read off a motion: extrema, contact, forces, energy, harmonics,
//! beam clearance. Everything is exact on the piecewise closed form: extrema from
//! roots of rates, integrals in closed form, never from samples.

mod clearance;
mod energy;
mod harmonics;

pub use clearance::Clearance;
pub use energy::EnergyBalance;
pub(crate) use harmonics::lag;
pub use harmonics::{Harmonic, Spectrum};

use nanotap_flow::Trajectory;
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
    /// Time mean of W.
    pub mean_deflection: f64,
    /// Root mean square of W about its mean.
    pub rms_deflection: f64,
    /// Least and greatest gap V_T.
    pub gap_range: [f64; 2],
    /// Part of the time in contact.
    pub contact_fraction: f64,
    /// Contacts begun a drive period.
    pub contacts_per_period: f64,
    /// Greatest force of the sample on the tip (0 without contact; impacts of a rigid
    /// stop are impulses and not counted).
    pub peak_force: f64,
    /// Time mean of that force.
    pub mean_force: f64,
    /// Greatest speed of approach at which a contact begins.
    pub impact_speed: f64,
    /// Least and greatest slope at the tip, what an optical lever reads; of a beam.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope_range: Option<[f64; 2]>,
    /// Energy fed and drained.
    pub energy_balance: EnergyBalance,
    /// Least height of the beam above the sample; of a beam.
    #[serde(flatten)]
    pub beam_clearance: Option<Clearance>,
    /// Contacts that only graze, within rounding.
    pub grazing_contacts: usize,
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
        let (gap_low, gap_high) = trajectory.signal(&model.gap).range()?;
        let force = trajectory.signal_by_regime(&model.force);
        let (_, peak) = force.range()?;
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
        let slope_range = model.beam.as_ref().and_then(|beam| {
            let (low, high) = trajectory.signal(&beam.slope).range()?;
            Some([low.value, high.value])
        });
        Some(Self {
            periods: duration / model.period(),
            tip_max: high.value,
            tip_min: low.value,
            amplitude: 0.5 * (high.value - low.value),
            mean_deflection: mean,
            rms_deflection: (mean_square - mean * mean).max(0.0).sqrt(),
            gap_range: [gap_low.value, gap_high.value],
            contact_fraction: contact / duration,
            contacts_per_period: begins.clone().count() as f64 / (duration / model.period()),
            peak_force: peak.value.max(0.0),
            mean_force: force.mean(),
            impact_speed: begins.clone().map(|e| -e.rate).fold(0.0, f64::max),
            slope_range,
            energy_balance: EnergyBalance::of(model, trajectory),
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
            mean_deflection,
            rms_deflection: (mean(square(self), square(next)) - mean_deflection.powi(2))
                .max(0.0)
                .sqrt(),
            gap_range: hull(self.gap_range, next.gap_range),
            contact_fraction: mean(self.contact_fraction, next.contact_fraction),
            contacts_per_period: mean(self.contacts_per_period, next.contacts_per_period),
            peak_force: self.peak_force.max(next.peak_force),
            mean_force: mean(self.mean_force, next.mean_force),
            impact_speed: self.impact_speed.max(next.impact_speed),
            slope_range: self
                .slope_range
                .zip(next.slope_range)
                .map(|(a, b)| hull(a, b)),
            energy_balance: self.energy_balance.joined(&next.energy_balance),
            beam_clearance: clearance,
            grazing_contacts: self.grazing_contacts + next.grazing_contacts,
        }
    }
}

/// Whether a switch begins a contact: from flight into contact, or an impact.
pub fn begins_contact(model: &Model, from: usize, to: usize) -> bool {
    !model.contact[from] && (model.contact[to] || from == to)
}
