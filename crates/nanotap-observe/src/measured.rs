//! Measurements of a motion, from which observables are computed.

use super::clearance::Clearance;
use super::energy::{EnergyBalance, PowerTerm, balance};
use super::functional::{Functional, Requirements, Signal, Tone};
use super::number::{Number, Phasor, above_rounding};
use super::table::{ObservableSet, Observables};
use nanotap_model::Model;

/// The measurements of a motion. Before a run there are none, and reading one records that it is
/// required.
pub(super) struct Measured<'a, D = f64> {
    pub(super) model: &'a Model,
    pub(super) required: Requirements,
    pub(super) found: Option<MeasuredValues<D>>,
}

/// The measurements of a motion.
pub(super) struct MeasuredValues<D> {
    /// The values of the required functionals, in their order.
    pub(super) values: Vec<(Functional, Phasor<D>)>,
    /// Duration of the motion, in model units.
    pub(super) duration: D,
    /// Number of completed drive periods.
    pub(super) periods: u64,
    /// Total time in contact, in model units.
    pub(super) contact_time: D,
    pub(super) contacts: Beginnings<D>,
    /// Gain of stored energy over the motion, in model units.
    pub(super) stored: D,
    /// Gain of energy stored in the sample.
    pub(super) stored_by_sample: D,
    pub(super) clearance: Option<Clearance<D>>,
    pub(super) impacts: Impacts<D>,
    /// Phases of further tones in radians.
    pub(super) tone_phases: Vec<D>,
}

impl MeasuredValues<f64> {
    /// Computes the observables of `set` from the measurements.
    pub(super) fn observables(self, model: &Model, set: ObservableSet) -> Observables {
        Observables::read(set, &mut Measured::of(model, Some(self)))
    }
}

/// Number and greatest speed of the contacts that began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Beginnings<D> {
    pub(super) count: u64,
    pub(super) grazing: u64,
    pub(super) greatest_speed: D,
}

/// The impacts on a rigid stop, if there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Impacts<D> {
    /// Sum of the impulses on the tip.
    pub(super) impulse: D,
    /// Integral of force times tip displacement over the impacts.
    pub(super) virial: D,
    /// Energy loss in the impacts.
    pub(super) energy: D,
}

impl<D: Number> Impacts<D> {
    /// Impacts on a stop with mass, restitution and position `[m, r, x]`. `bounced` and `stuck` are
    /// the sums of the speeds and of their squares at impacts that bounce, and at those after which
    /// the tip rests on the stop.
    pub(super) fn new([mass, restitution, tip]: [D; 3], bounced: [D; 2], stuck: [D; 2]) -> Self {
        let one = D::from(1.0);
        let impulse = mass * ((one + restitution) * bounced[0] + stuck[0]);
        let kept = restitution * restitution;
        Self {
            impulse,
            virial: impulse * tip,
            energy: mass * ((one - kept) * bounced[1] + stuck[1]) * 0.5,
        }
    }
}

impl<'a, D: Number> Measured<'a, D> {
    /// Creates measurements from those found, or `None` before the run.
    pub(super) fn of(model: &'a Model, found: Option<MeasuredValues<D>>) -> Self {
        Self {
            model,
            required: Requirements::default(),
            found,
        }
    }

    /// The value of a functional; 0 before the run.
    fn value(&mut self, functional: Functional) -> Phasor<D> {
        let Some(found) = &self.found else {
            self.required.add(functional);
            return Phasor::default();
        };
        let known = found.values.iter().find(|(known, _)| *known == functional);
        let unknown = Phasor {
            re: D::from(f64::NAN),
            im: D::default(),
        };
        known.map_or(unknown, |(_, value)| *value)
    }

    fn gathered(&self, read: impl Fn(&MeasuredValues<D>) -> D) -> D {
        self.found.as_ref().map_or_else(D::default, read)
    }

    /// Returns the minimum of a signal, in model units.
    pub(super) fn least(&mut self, signal: Signal) -> D {
        self.value(Functional::Least(signal)).re
    }

    /// Returns the maximum of a signal, in model units.
    pub(super) fn greatest(&mut self, signal: Signal) -> D {
        self.value(Functional::Greatest(signal)).re
    }

    /// Minimum and maximum of a signal.
    pub(super) fn range(&mut self, signal: Signal) -> [D; 2] {
        [self.least(signal), self.greatest(signal)]
    }

    /// The time mean of a signal.
    pub(super) fn mean(&mut self, signal: Signal) -> D {
        self.value(Functional::Integral(signal)).re / self.duration()
    }

    /// Returns the integral `∫ a b dt` over the motion.
    fn product(&mut self, a: Signal, b: Signal) -> D {
        self.value(Functional::Product(a, b)).re
    }

    /// Time mean of the force of the sample on the tip, including impulses of a rigid stop.
    pub(super) fn mean_force(&mut self) -> D {
        self.mean(Signal::Force) + self.gathered(|found| found.impacts.impulse) / self.duration()
    }

    /// Time mean of the tip deflection, 0 if it is only rounding.
    pub(super) fn mean_deflection(&mut self) -> D {
        let reach = self.reach();
        above_rounding(self.mean(Signal::Tip), reach)
    }

    /// Largest distance of the tip from its place at rest.
    fn reach(&mut self) -> f64 {
        let [low, high] = self.range(Signal::Tip);
        low.value().abs().max(high.value().abs())
    }

    /// Time mean of force times tip deflection along the deflection, 0 if it is only rounding.
    pub(super) fn virial(&mut self) -> D {
        let virial = self.mean_virial() * self.along_tip();
        let force = self.peak_force().value().max(-self.least_force().value());
        let reach = self.reach();
        above_rounding(virial, force * reach)
    }

    /// Time mean of force times tip deflection, including impulses of a rigid stop.
    pub(super) fn mean_virial(&mut self) -> D {
        let impacts = self.gathered(|found| found.impacts.virial) / self.duration();
        self.mean_product(Signal::Force, Signal::Tip) + impacts
    }

    /// Time mean of the product of two signals.
    pub(super) fn mean_product(&mut self, a: Signal, b: Signal) -> D {
        self.product(a, b) / self.duration()
    }

    /// The component `Re(c e^{iωt})` of a signal at a drive frequency.
    pub(super) fn component(&mut self, signal: Signal, tone: Tone) -> Phasor<D> {
        let c = self.value(Functional::Fourier(signal, tone));
        let duration = self.duration();
        Phasor {
            re: c.re * 2.0 / duration,
            im: c.im * 2.0 / duration,
        }
    }

    /// Returns the duration of the motion, in model units; 1 before the run.
    pub(super) fn duration(&self) -> D {
        self.found
            .as_ref()
            .map_or(1.0.into(), |found| found.duration)
    }

    /// Returns the duration of the motion in drive periods.
    pub(super) fn periods(&self) -> f64 {
        let whole = self.found.as_ref().map_or(0, |found| found.periods);
        if whole > 0 {
            whole as f64
        } else {
            self.duration().value() / self.model.period()
        }
    }

    /// Returns the total time in contact, in model units; 0 before the run.
    pub(super) fn contact_time(&self) -> D {
        self.gathered(|found| found.contact_time)
    }

    /// Returns number and greatest speed of the contacts that began; zero before the run.
    pub(super) fn contacts(&self) -> Beginnings<D> {
        self.found
            .as_ref()
            .map_or_else(Beginnings::default, |found| found.contacts)
    }

    /// Time mean of the force in contact; `None` without contact.
    pub(super) fn mean_contact_force(&mut self) -> Option<D> {
        let impulse = self.value(Functional::Integral(Signal::ContactForce)).re;
        let time = self.contact_time();
        (time.value() > 0.0).then(|| impulse / time)
    }

    /// True if the model is a beam.
    pub(super) fn is_beam(&self) -> bool {
        self.model.beam.is_some()
    }

    /// 1 if the tip deflection points away from the sample, as W of the cantilever; −1 if it points
    /// towards the sample, as x of an oscillator.
    pub(super) fn along_tip(&self) -> f64 {
        if self.is_beam() { 1.0 } else { -1.0 }
    }

    /// Greatest force with which the sample pushes the tip, 0 if it only pulls. Impacts on a rigid stop
    /// are impulses and do not count.
    pub(super) fn peak_force(&mut self) -> D {
        self.greatest(Signal::Force).at_least(0.0)
    }

    /// Minimum force of the sample on the tip: negative if it pulls, as the paper's damper does on
    /// a receding tip. A force that vanishes at the end of contact counts as 0.
    pub(super) fn least_force(&mut self) -> D {
        /// Largest force, as a part of the peak force, that is the rounding of zero.
        const ROUNDING: f64 = 1e-12;
        let (least, peak) = (self.least(Signal::Force), self.peak_force());
        if least.value().abs() <= ROUNDING * peak.value() {
            0.0.into()
        } else {
            least
        }
    }

    /// Largest depth of the tip below the resting surface, 0 if the tip does not reach it. Under a
    /// nonlinear law contact begins at the intermolecular distance a0: δ = a0 − d.
    pub(super) fn indentation(&mut self) -> D {
        if let Some(nonlinear) = &self.model.nonlinear {
            let Some(surface) = nonlinear.contact_gap() else {
                return D::default();
            };
            return (-self.least(Signal::Height) + D::from(surface)).at_least(0.0);
        }
        (-self.least(Signal::Height)).at_least(0.0)
    }

    /// Work of the tip on the sample per drive period, −∫ F V̇_T dt, plus the loss in impacts: the
    /// dissipation in the sample, for any law. 0 if it is only the rounding of the energy stored
    /// and returned by the contact, force times indentation.
    pub(super) fn dissipation(&mut self) -> D {
        let work = self.impacts() + self.work_on_sample();
        let work = work / self.periods();
        let (force, depth) = if self.model.nonlinear.is_some() {
            // Attraction stores energy without contact, and an orbit closes to the rounding of the
            // deflection, which a force may bend much farther than the tip moves.
            let [near, far] = self.range(Signal::Height);
            let bent = self.reach();
            let pull = -self.least(Signal::Force).value();
            (
                self.peak_force().value().max(pull),
                (far.value() - near.value()).max(bent),
            )
        } else {
            (self.peak_force().value(), self.indentation().value())
        };
        // The derivative of what does not depend on anything is no more than rounding either.
        if above_rounding(work, force * depth).value() == 0.0 {
            0.0.into()
        } else {
            work
        }
    }

    /// Net work of the tip on the sample.
    fn work_on_sample(&mut self) -> D {
        let stored = self.gathered(|found| found.stored_by_sample);
        -self.product(Signal::Force, Signal::HeightRate) - stored
    }

    /// Energy loss in impacts on a rigid stop.
    fn impacts(&self) -> D {
        self.gathered(|found| found.impacts.energy)
    }

    /// The component of the tip deflection at a further tone, if there is one, relative to the
    /// phase of the tone; 0 is the second tone.
    pub(super) fn further_tone(&mut self, k: usize) -> Option<Phasor<D>> {
        self.product_of_tones(Tone::Further(k), k, 1.0)
    }

    /// The component of the tip deflection at 2ω₁ − ω₂.
    pub(super) fn first_sideband(&mut self) -> Option<Phasor<D>> {
        self.product_of_tones(Tone::FirstSideband, 0, -1.0)
    }

    /// The component of the tip deflection at 2ω₂ − ω₁.
    pub(super) fn second_sideband(&mut self) -> Option<Phasor<D>> {
        self.product_of_tones(Tone::SecondSideband, 0, 2.0)
    }

    /// The component of the tip deflection at a product of the first tone and so many `times` a
    /// further one, relative to the phases of both; `None` without that tone, or at a frequency of
    /// zero or less.
    fn product_of_tones(&mut self, tone: Tone, further: usize, times: f64) -> Option<Phasor<D>> {
        self.model.system.drive().frequencies().get(further + 1)?;
        if tone.frequency(self.model) <= 0.0 {
            return None;
        }
        let own =
            self.gathered(|found| found.tone_phases.get(further).copied().unwrap_or_default());
        let seen = self.component(Signal::Tip, tone);
        Some(seen.turned_back(own * D::from(times)))
    }

    /// The reading of an optical lever at the drive frequency: the slope at the tip, converted to a
    /// deflection as if a static force at the tip had bent the beam. Such a beam has the slope
    /// 3W/2, so the reading is ⅔ ∂W/∂ξ; for the first mode of the bare beam, whose slope is 1.3765
    /// W, it is 0.918 W.
    pub(super) fn optical_lever(&mut self) -> Option<Phasor<D>> {
        let reads = |m: &mut Self| {
            let slope = m.component(Signal::Slope, Tone::First);
            slope.times((2.0 / 3.0).into())
        };
        self.is_beam().then(|| reads(self))
    }

    /// The component of the tip's height at the drive frequency for a beam with a moving base:
    /// deflection plus base. With the base at rest it equals the deflection.
    pub(super) fn tip_motion(&mut self) -> Option<Phasor<D>> {
        let base = &self.model.beam.as_ref()?.base;
        let moves = base.tones.iter().any(|tone| tone.norm_sqr() > 0.0);
        moves.then(|| self.component(Signal::Height, Tone::First))
    }

    /// The energy balance of drive and losses.
    pub(super) fn energy_balance(&mut self) -> EnergyBalance<D> {
        self.required.stored = true;
        let model = self.model;
        let mut work = |terms: Vec<PowerTerm>| -> D {
            terms.into_iter().fold(D::default(), |sum, a| {
                sum + self.product(Signal::Power(a), Signal::Power(a.other()))
            })
        };
        let beam = work(PowerTerm::of_beam(model));
        if D::VARIES {
            // For a periodic orbit, over which no energy is stored.
            let sample = self.dissipation() * self.periods();
            return balance(beam + sample, beam, sample, D::default());
        }
        let drive = work(PowerTerm::of_drive(model));
        let sample = if model.nonlinear.is_some() {
            self.work_on_sample()
        } else {
            work(PowerTerm::of_sample(model))
        };
        let stored = self.gathered(|found| found.stored);
        balance(drive, beam, sample + self.impacts(), stored)
    }

    /// The lowest point of the beam.
    pub(super) fn clearance(&mut self) -> Option<Clearance<D>> {
        self.required.clearance = true;
        // The end of the beam is at a fixed height above the tip.
        self.least(Signal::Height);
        self.found.as_ref()?.clearance
    }
}
