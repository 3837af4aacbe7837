//! What a sweep keeps of a stretch of motion, gathered while it runs.

use nanotap_flow::Complex;
use nanotap_flow::extrema::sign_changes;
use nanotap_flow::flow::{Observer, SegmentView, SwitchView};
use nanotap_flow::integral::{fourier_integral, integral, product_integral};
use nanotap_flow::regime::ModalOutput;
use nanotap_flow::signal::Signal;

use crate::case::physical::Scales;
use crate::model::Model;
use crate::observe::{above_rounding, begins_contact, lag};

/// Watches a flow: exact extrema from roots of rates, contact, force.
pub(super) struct Record<'a> {
    model: &'a Model,
    tip: Vec<ModalOutput>,
    force: Vec<ModalOutput>,
    gap: Vec<ModalOutput>,
    gap_rate: Vec<ModalOutput>,
    /// Extremes of W in the period under way.
    low: f64,
    high: f64,
    /// Least and greatest W of each finished period.
    pub(super) lows: Vec<f64>,
    pub(super) highs: Vec<f64>,
    time: f64,
    contact_time: f64,
    contacts: usize,
    tip_integral: f64,
    /// ∫ W e^{−iΩt} dt.
    fundamental: Complex,
    force_integral: f64,
    /// ∫ F W dt, the force counted along W.
    virial: f64,
    /// Work on the sample, −∫ F V̇ dt, and what impacts take.
    work: f64,
    lowest_gap: f64,
    peak_force: f64,
    impact_speed: f64,
}

impl<'a> Record<'a> {
    pub(super) fn new(model: &'a Model) -> Self {
        let regimes = model.system.regimes();
        Self {
            model,
            tip: regimes.iter().map(|r| r.project(&model.tip)).collect(),
            force: regimes
                .iter()
                .zip(&model.force)
                .map(|(r, f)| r.project(f))
                .collect(),
            gap: regimes.iter().map(|r| r.project(&model.height)).collect(),
            gap_rate: regimes
                .iter()
                .map(|r| {
                    let rate = model
                        .height
                        .rate(r.matrix(), r.forcing(), model.system.drive());
                    r.project(&rate)
                })
                .collect(),
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            lows: Vec::new(),
            highs: Vec::new(),
            time: 0.0,
            contact_time: 0.0,
            contacts: 0,
            tip_integral: 0.0,
            fundamental: Complex::new(0.0, 0.0),
            force_integral: 0.0,
            virial: 0.0,
            work: 0.0,
            lowest_gap: f64::INFINITY,
            peak_force: 0.0,
            impact_speed: 0.0,
        }
    }

    /// Observables of all finished periods; not numbers if there is none.
    pub(super) fn observables(&self) -> Observables {
        let high = self.highs.iter().copied().fold(f64::NAN, f64::max);
        let low = self.lows.iter().copied().fold(f64::NAN, f64::min);
        let periods = self.highs.len() as f64;
        let first = self.fundamental * 2.0 / self.time;
        let known = |value: f64| if periods > 0.0 { value } else { f64::NAN };
        Observables {
            tip_max: high,
            tip_min: low,
            amplitude: 0.5 * (high - low),
            mean_deflection: self.tip_integral / self.time,
            contact_fraction: self.contact_time / self.time,
            contacts_per_period: self.contacts as f64 / periods,
            first_harmonic: first.norm(),
            phase: known(lag(first)),
            mean_force: self.force_integral / self.time,
            indentation: known((-self.lowest_gap).max(0.0)),
            dissipation: above_rounding(self.work / periods, self.peak_force, -self.lowest_gap),
            virial: self.virial / self.time,
            peak_force: known(self.peak_force),
            impact_speed: known(self.impact_speed),
        }
    }
}

/// Observables of a stretch; the words are those of [`crate::observe::Observables`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Observables {
    pub(super) tip_max: f64,
    pub(super) tip_min: f64,
    pub(super) amplitude: f64,
    pub(super) mean_deflection: f64,
    pub(super) contact_fraction: f64,
    pub(super) contacts_per_period: f64,
    pub(super) first_harmonic: f64,
    pub(super) phase: f64,
    pub(super) mean_force: f64,
    pub(super) indentation: f64,
    pub(super) dissipation: f64,
    pub(super) virial: f64,
    pub(super) peak_force: f64,
    pub(super) impact_speed: f64,
}

impl Observables {
    /// The same in SI.
    pub(super) fn in_si(&self, scales: &Scales) -> Self {
        Self {
            tip_max: self.tip_max * scales.length,
            tip_min: self.tip_min * scales.length,
            amplitude: self.amplitude * scales.length,
            mean_deflection: self.mean_deflection * scales.length,
            first_harmonic: self.first_harmonic * scales.length,
            mean_force: self.mean_force * scales.force,
            indentation: self.indentation * scales.length,
            dissipation: self.dissipation * scales.energy,
            virial: self.virial * scales.energy,
            peak_force: self.peak_force * scales.force,
            impact_speed: self.impact_speed * scales.velocity,
            ..*self
        }
    }

    pub(super) const UNKNOWN: Self = Self {
        tip_max: f64::NAN,
        tip_min: f64::NAN,
        amplitude: f64::NAN,
        mean_deflection: f64::NAN,
        contact_fraction: f64::NAN,
        contacts_per_period: f64::NAN,
        first_harmonic: f64::NAN,
        phase: f64::NAN,
        mean_force: f64::NAN,
        indentation: f64::NAN,
        dissipation: f64::NAN,
        virial: f64::NAN,
        peak_force: f64::NAN,
        impact_speed: f64::NAN,
    };
}

impl Observer for Record<'_> {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let length = segment.length;
        if length <= 0.0 {
            return;
        }
        let (drive, regime) = (segment.system.drive(), segment.regime());
        let signal =
            |output| Signal::of(regime, drive, output, segment.modal, segment.phase, length);
        let extremes = |signal: &Signal| {
            let rate = signal.differentiated(length);
            let roots = sign_changes(&rate, length);
            let all = roots.into_iter().chain([0.0, length]).map(|s| signal.at(s));
            all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                (l.min(v), h.max(v))
            })
        };
        let tip = signal(&self.tip[segment.regime]);
        let (low, high) = extremes(&tip);
        self.low = self.low.min(low);
        self.high = self.high.max(high);
        self.tip_integral += integral(&tip, length);
        let omega = drive.frequencies().first().copied().unwrap_or(0.0);
        self.fundamental += fourier_integral(&tip, segment.phase, length, omega);
        self.time += length;
        if self.model.contact[segment.regime] {
            self.contact_time += length;
            let force = signal(&self.force[segment.regime]);
            let (_, peak) = extremes(&force);
            self.peak_force = self.peak_force.max(peak);
            let (low, _) = extremes(&signal(&self.gap[segment.regime]));
            self.lowest_gap = self.lowest_gap.min(low);
            self.force_integral += integral(&force, length);
            let away = if self.model.beam.is_some() { 1.0 } else { -1.0 };
            self.virial += away * product_integral(&force, &tip, length);
            let rate = signal(&self.gap_rate[segment.regime]);
            self.work -= product_integral(&force, &rate, length);
        }
    }

    fn switch(&mut self, switch: &SwitchView<'_>) {
        if begins_contact(self.model, switch.switch.from, switch.switch.to) {
            self.contacts += 1;
            self.impact_speed = self.impact_speed.max(-switch.rate);
            self.work += self.model.impact_loss * switch.rate * switch.rate;
        }
    }

    fn period_end(&mut self) {
        self.lows
            .push(std::mem::replace(&mut self.low, f64::INFINITY));
        self.highs
            .push(std::mem::replace(&mut self.high, f64::NEG_INFINITY));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::cantilever::Cantilever;
    use crate::observe::Observables as Full;
    use nanotap_flow::{Flow, Trajectory};

    /// The same numbers as the observables of a recorded trajectory, which are computed
    /// otherwise.
    #[test]
    fn agrees_with_the_observables_of_a_trajectory() {
        for omega in [2.6, 20.0] {
            let model = Model::cantilever(&Cantilever {
                omega,
                ..Cantilever::paper()
            })
            .unwrap();
            let mut flow = Flow::new(model.system.clone());
            let start = vec![0.1, 0.0, 0.0, 0.3, 0.0, 0.0];
            flow.start(&start, 0.0).unwrap();
            let mut record = Record::new(&model);
            for _ in 0..20 {
                flow.run_period(&mut record).unwrap();
            }
            let found = record.observables();
            let trajectory = Trajectory::record(&model.system, &start, 20).unwrap();
            let expected = Full::of(&model, &trajectory).unwrap();
            for (a, b) in [
                (found.tip_max, expected.tip_max),
                (found.tip_min, expected.tip_min),
                (found.amplitude, expected.amplitude),
                (found.mean_deflection, expected.mean_deflection),
                (found.contact_fraction, expected.contact_fraction),
                (found.contacts_per_period, expected.contacts_per_period),
                (found.peak_force, expected.peak_force),
                (found.impact_speed, expected.impact_speed),
                (found.first_harmonic, expected.first_harmonic),
                (found.phase, expected.phase),
                (found.mean_force, expected.mean_force),
                (found.indentation, expected.indentation),
                (found.virial, expected.virial),
            ] {
                assert!(
                    (a - b).abs() < 1e-9 * b.abs().max(1.0),
                    "{found:?} {expected:?}"
                );
            }
            assert_eq!(record.highs.len(), 20);
        }
    }
}
