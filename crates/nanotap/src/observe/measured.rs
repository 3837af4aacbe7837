//! Measurements of a motion, from which observables are read.

use super::above_rounding;
use super::clearance::Clearance;
use super::energy::{EnergyBalance, PowerTerm, balance};
use super::functional::{Functional, Requirements, Signal, Tone};
use super::number::{Number, Phasor};
use super::table::{ObservableSet, Observables};
use crate::model::Model;

/// The measurements that observables are read from. Before a run there are none, and reading notes
/// which are required.
pub(super) struct Measured<'a, D = f64> {
    pub(super) model: &'a Model,
    pub(super) required: Requirements,
    pub(super) found: Option<Found<D>>,
}

/// The measurements of a motion.
pub(super) struct Found<D> {
    /// The values of the required functionals, in their order.
    pub(super) values: Vec<(Functional, Phasor<D>)>,
    /// Length of time.
    pub(super) duration: D,
    /// Whole drive periods.
    pub(super) periods: u64,
    /// Time in contact.
    pub(super) contact_time: D,
    pub(super) contacts: Beginnings<D>,
    /// Gain of stored energy.
    pub(super) stored: D,
    /// The part of it that a nonlinear law stores.
    pub(super) stored_by_sample: D,
    pub(super) clearance: Option<Clearance<D>>,
    pub(super) impacts: Impacts<D>,
    /// Phase of the second tone in rad.
    pub(super) second_phase: D,
}

impl Found<f64> {
    /// The observables.
    pub(super) fn observables(self, model: &Model, set: ObservableSet) -> Observables {
        Observables::read(set, &mut Measured::of(model, Some(self)))
    }
}

/// The contacts that began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Beginnings<D> {
    pub(super) count: u64,
    pub(super) grazing: u64,
    pub(super) greatest_speed: D,
}

/// The impacts on a rigid stop, if there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Impacts<D> {
    /// Sum of their impulses on the tip.
    pub(super) impulse: D,
    /// Integral of force times tip displacement over the impacts.
    pub(super) virial: D,
    /// Energy that they took.
    pub(super) energy: D,
}

impl<D: Number> Impacts<D> {
    /// Of a stop of mass, restitution and position `[m, r, x]`: `bounced` and `stuck` are the sums
    /// of the speeds and of their squares at impacts that bounce, and at those after which the
    /// tip rests on the stop.
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
    /// With these measurements, or before the run.
    pub(super) fn of(model: &'a Model, found: Option<Found<D>>) -> Self {
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

    fn gathered(&self, read: impl Fn(&Found<D>) -> D) -> D {
        self.found.as_ref().map_or_else(D::default, read)
    }

    /// The least value of a signal.
    pub(super) fn least(&mut self, signal: Signal) -> D {
        self.value(Functional::Least(signal)).re
    }

    /// Its greatest value.
    pub(super) fn greatest(&mut self, signal: Signal) -> D {
        self.value(Functional::Greatest(signal)).re
    }

    /// Both.
    pub(super) fn range(&mut self, signal: Signal) -> [D; 2] {
        [self.least(signal), self.greatest(signal)]
    }

    /// The time mean of a signal.
    pub(super) fn mean(&mut self, signal: Signal) -> D {
        self.value(Functional::Integral(signal)).re / self.duration()
    }

    /// `∫ a b dt`.
    fn product(&mut self, a: Signal, b: Signal) -> D {
        self.value(Functional::Product(a, b)).re
    }

    /// The time mean of the force of the sample on the tip, impulses of a rigid stop included.
    pub(super) fn mean_force(&mut self) -> D {
        self.mean(Signal::Force) + self.gathered(|found| found.impacts.impulse) / self.duration()
    }

    /// The time mean of force times tip deflection, impulses of a rigid stop included.
    pub(super) fn mean_virial(&mut self) -> D {
        let impacts = self.gathered(|found| found.impacts.virial) / self.duration();
        self.mean_product(Signal::Force, Signal::Tip) + impacts
    }

    /// The time mean of the product of two signals.
    pub(super) fn mean_product(&mut self, a: Signal, b: Signal) -> D {
        self.product(a, b) / self.duration()
    }

    /// The component `Re(c e^{iωt})` of a signal at a frequency of the drive.
    pub(super) fn component(&mut self, signal: Signal, tone: Tone) -> Phasor<D> {
        let c = self.value(Functional::Fourier(signal, tone));
        let duration = self.duration();
        Phasor {
            re: c.re * 2.0 / duration,
            im: c.im * 2.0 / duration,
        }
    }

    /// How long the motion ran.
    pub(super) fn duration(&self) -> D {
        self.found
            .as_ref()
            .map_or(1.0.into(), |found| found.duration)
    }

    /// The same in drive periods.
    pub(super) fn periods(&self) -> f64 {
        let whole = self.found.as_ref().map_or(0, |found| found.periods);
        if whole > 0 {
            whole as f64
        } else {
            self.duration().value() / self.model.period()
        }
    }

    /// Time in contact.
    pub(super) fn contact_time(&self) -> D {
        self.gathered(|found| found.contact_time)
    }

    /// The contacts that began.
    pub(super) fn contacts(&self) -> Beginnings<D> {
        self.found
            .as_ref()
            .map_or_else(Beginnings::default, |found| found.contacts)
    }

    /// The time mean of the force while tip and sample touch; `None` without contact.
    pub(super) fn mean_contact_force(&mut self) -> Option<D> {
        let impulse = self.mean(Signal::Force) * self.duration();
        let time = self.contact_time();
        (time.value() > 0.0).then(|| impulse / time)
    }

    /// Whether the model is a beam.
    pub(super) fn is_beam(&self) -> bool {
        self.model.beam.is_some()
    }

    /// 1 where the tip deflection points away from the sample, as the cantilever's W does;
    /// −1 where it points towards it, as an oscillator's x.
    pub(super) fn along_tip(&self) -> f64 {
        if self.is_beam() { 1.0 } else { -1.0 }
    }

    /// Greatest force of the sample on the tip: 0 without contact; impacts of a rigid stop are
    /// impulses and do not count.
    pub(super) fn peak_force(&mut self) -> D {
        self.greatest(Signal::Force).at_least(0.0)
    }

    /// Least force of the sample on the tip: below zero where it pulls, as the paper's damper
    /// does on a tip that leaves. A force that vanishes where contact ends is 0.
    pub(super) fn least_force(&mut self) -> D {
        const ROUNDING: f64 = 1e-12;
        let (least, peak) = (self.least(Signal::Force), self.peak_force());
        if least.value().abs() <= ROUNDING * peak.value() {
            0.0.into()
        } else {
            least
        }
    }

    /// Greatest depth of the tip below the resting surface, 0 if it never gets there. Under a
    /// nonlinear law contact begins at its intermolecular distance a0: δ = a0 − d.
    pub(super) fn indentation(&mut self) -> D {
        if let Some(nonlinear) = &self.model.nonlinear {
            let Some(surface) = nonlinear.contact_gap() else {
                return D::default();
            };
            return (-self.least(Signal::Height) + D::from(surface)).at_least(0.0);
        }
        (-self.least(Signal::Height)).at_least(0.0)
    }

    /// Work of the tip on the sample a drive period, −∫ F V̇_T dt, and what impacts take: what
    /// the sample dissipates, whatever it is made of. 0 where it is the rounding of what the
    /// contact stores and gives back, force times indentation.
    pub(super) fn dissipation(&mut self) -> D {
        let work = self.impacts() + self.work_on_sample();
        let work = work / self.periods();
        let (force, depth) = if self.model.nonlinear.is_some() {
            // An attraction stores without contact.
            let [near, far] = self.range(Signal::Height);
            let pull = -self.least(Signal::Force).value();
            (
                self.peak_force().value().max(pull),
                (far.value() - near.value()),
            )
        } else {
            (self.peak_force().value(), self.indentation().value())
        };
        if above_rounding(work.value(), force, depth) == 0.0 {
            0.0.into()
        } else {
            work
        }
    }

    /// What the tip gives the sample and does not get back.
    fn work_on_sample(&mut self) -> D {
        let stored = self.gathered(|found| found.stored_by_sample);
        -self.product(Signal::Force, Signal::HeightRate) - stored
    }

    /// What impacts on a rigid stop take.
    fn impacts(&self) -> D {
        self.gathered(|found| found.impacts.energy)
    }

    /// The component of the tip deflection at the second tone, if there is one, turned back by
    /// the tone's own phase.
    pub(super) fn second_tone(&mut self) -> Option<Phasor<D>> {
        self.model.system.drive().frequencies().get(1)?;
        let own = self.gathered(|found| found.second_phase);
        Some(self.component(Signal::Tip, Tone::Second).turned_back(own))
    }

    /// What an optical lever reads at the drive's frequency: the slope at the tip, taken for a
    /// deflection as if a static force at the tip had bent the beam. Such a beam has the slope
    /// 3W/2, so that W is taken to be ⅔ ∂W/∂ξ; the bare beam's first mode, whose slope is
    /// 1.3765 W, then reads 0.918 W.
    pub(super) fn optical_lever(&mut self) -> Option<Phasor<D>> {
        let reads = |m: &mut Self| {
            let slope = m.component(Signal::Slope, Tone::First);
            slope.times((2.0 / 3.0).into())
        };
        self.is_beam().then(|| reads(self))
    }

    /// The component of the tip's height at the drive's frequency, of a beam whose base moves:
    /// deflection and base together. With the base at rest the tip moves as it is deflected.
    pub(super) fn tip_motion(&mut self) -> Option<Phasor<D>> {
        let base = &self.model.beam.as_ref()?.base;
        let moves = base.tones.iter().any(|tone| tone.norm_sqr() > 0.0);
        moves.then(|| self.component(Signal::Height, Tone::First))
    }

    /// What the drive feeds in, and what takes it.
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
            // Of a periodic orbit, along which nothing is stored.
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

    /// Where the beam comes nearest to the sample.
    pub(super) fn clearance(&mut self) -> Option<Clearance<D>> {
        self.required.clearance = true;
        // The beam's end stands a fixed height over the tip.
        self.least(Signal::Height);
        self.found.as_ref()?.clearance
    }
}
