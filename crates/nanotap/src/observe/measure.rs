//! Measures a motion while it runs.
//!
//! What observables are read from is gathered by `nanotap_flow`'s
//! [accumulator](nanotap_flow::accumulate): extrema from zeros of rates, integrals in closed
//! form, nothing from samples. An observable says what it needs by asking for it: before the
//! run every observable that is wanted reads once from nothing, which notes what is to be
//! gathered; afterwards it reads again, from what was.

use std::sync::Arc;

use nanotap_flow::accumulate::{
    Accumulator, Channel, ExtremumKey, FourierKey, IntegralKey, Plan, ProductKey, Request,
};
use nanotap_flow::flow::{Observer, SegmentView, SwitchView};
use nanotap_flow::{Complex, FlowError, Output};

use super::clearance::{Clearance, ClearanceSearch};
use super::energy::{Ends, EnergyBalance, PowerTerm, balance};
use super::number::{Number, Phasor};
use super::table::{Observables, Set};
use super::{above_rounding, begins_contact};
use crate::model::nonlinear::Nonlinear;
use crate::model::{Model, MotionError};

/// A scalar along a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Signal {
    /// Tip deflection W.
    Tip,
    /// Height of the tip over the undeformed surface, V_T.
    Height,
    /// Its rate.
    HeightRate,
    /// Force of the sample on the tip.
    Force,
    /// Slope at the tip; 0 of an oscillator.
    Slope,
    /// A factor of a power that is fed in or taken.
    Power(PowerTerm),
}

impl Signal {
    /// What it is in a model with a nonlinear law.
    pub(super) fn reading(self, model: &Model, nonlinear: &Nonlinear) -> nanotap_volterra::Output {
        nonlinear.output(&self.outputs(model)[0], self.force_part(nonlinear))
    }

    /// How much of a nonlinear law's force is in it beside its output.
    pub(super) fn force_part(self, nonlinear: &Nonlinear) -> f64 {
        match self {
            Self::Force => 1.0,
            Self::Power(term) => term.force_part(nonlinear),
            _ => 0.0,
        }
    }

    /// What it is in `model`, an entry a regime.
    pub(super) fn outputs(self, model: &Model) -> Vec<Output> {
        let same = |output: &Output| vec![output.clone(); model.system.regimes().len()];
        match self {
            Self::Tip => same(&model.tip),
            Self::Height => same(&model.height),
            Self::HeightRate => {
                let drive = model.system.drive();
                let rate =
                    |r: &nanotap_flow::Regime| model.height.rate(r.matrix(), r.forcing(), drive);
                model.system.regimes().iter().map(rate).collect()
            }
            Self::Force => model.force.clone(),
            Self::Slope => same(
                &model
                    .beam
                    .as_ref()
                    .map_or_else(|| model.tip.scaled(0.0), |beam| beam.slope.clone()),
            ),
            Self::Power(term) => term.outputs(model),
        }
    }
}

/// A frequency of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tone {
    /// The drive's, of several tones the first.
    First,
    /// The second tone's.
    Second,
    /// So many times the drive's.
    Harmonic(u32),
}

/// What is gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Need {
    Least(Signal),
    Greatest(Signal),
    Integral(Signal),
    Product(Signal, Signal),
    Fourier(Signal, Tone),
}

/// Where it is found.
#[derive(Clone, Copy, Debug)]
enum Key {
    Extremum(ExtremumKey),
    Integral(IntegralKey),
    Product(ProductKey),
    Fourier(FourierKey),
}

impl Need {
    /// The signals that it is made of.
    pub(super) const fn signals(&self) -> (Signal, Option<Signal>) {
        match *self {
            Self::Least(signal)
            | Self::Greatest(signal)
            | Self::Integral(signal)
            | Self::Fourier(signal, _) => (signal, None),
            Self::Product(a, b) => (a, Some(b)),
        }
    }

    /// What it is of no time.
    pub(super) const fn nothing(&self) -> Complex {
        Complex::new(
            match self {
                Self::Least(_) => f64::INFINITY,
                Self::Greatest(_) => f64::NEG_INFINITY,
                _ => 0.0,
            },
            0.0,
        )
    }

    /// Adds it to `request`; `channel` says where its signals are there.
    fn key(
        self,
        request: &mut Request,
        mut channel: impl FnMut(&mut Request, Signal) -> Channel,
        model: &Model,
    ) -> Key {
        match self {
            Self::Least(signal) => {
                let channel = channel(request, signal);
                Key::Extremum(request.least(channel))
            }
            Self::Greatest(signal) => {
                let channel = channel(request, signal);
                Key::Extremum(request.greatest(channel))
            }
            Self::Integral(signal) => {
                let channel = channel(request, signal);
                Key::Integral(request.integral(channel))
            }
            Self::Product(a, b) => {
                let (a, b) = (channel(request, a), channel(request, b));
                Key::Product(request.product(a, b))
            }
            Self::Fourier(signal, tone) => {
                let channel = channel(request, signal);
                Key::Fourier(request.fourier(channel, frequency(model, tone)))
            }
        }
    }
}

impl Key {
    /// What was gathered.
    fn value(self, accumulator: &Accumulator) -> Complex {
        match self {
            Self::Extremum(key) => accumulator.extremum(key).into(),
            Self::Integral(key) => accumulator.integral(key).into(),
            Self::Product(key) => accumulator.product(key).into(),
            Self::Fourier(key) => accumulator.fourier(key),
        }
    }
}

/// What a choice of observables needs, made ready for one model.
#[derive(Debug)]
struct Needs {
    plan: Arc<Plan>,
    keys: Vec<(Need, Key)>,
    /// Whether stored energy is wanted.
    ends: bool,
    clearance: bool,
}

/// What a choice of observables asks for.
pub(super) struct Asked {
    pub(super) needs: Vec<Need>,
    /// Whether the beam's least height is wanted.
    pub(super) clearance: bool,
    ends: bool,
}

impl Asked {
    pub(super) fn of(model: &Model, set: Set) -> Self {
        let mut measured = Measured::<f64>::nothing(model);
        Observables::read(set, &mut measured);
        Self {
            needs: measured.asked,
            clearance: measured.asked_clearance,
            ends: measured.asked_ends,
        }
    }
}

impl Needs {
    fn of(model: &Model, set: Set) -> Result<Self, FlowError> {
        let asked = Asked::of(model, set);
        let mut request = Request::new();
        let mut channels: Vec<(Signal, Channel)> = Vec::new();
        let mut channel = |request: &mut Request, signal: Signal| {
            if let Some((_, known)) = channels.iter().find(|(s, _)| *s == signal) {
                return *known;
            }
            let new = request.output_by_regime(&signal.outputs(model));
            channels.push((signal, new));
            new
        };
        let keys = asked
            .needs
            .into_iter()
            .map(|need| (need, need.key(&mut request, &mut channel, model)))
            .collect();
        Ok(Self {
            plan: request.plan(&model.system)?,
            keys,
            ends: asked.ends,
            clearance: asked.clearance,
        })
    }

    fn extremum(&self, need: Need) -> Option<ExtremumKey> {
        self.keys.iter().find_map(|&(known, key)| match key {
            Key::Extremum(key) if known == need => Some(key),
            _ => None,
        })
    }
}

pub(super) fn frequency(model: &Model, tone: Tone) -> f64 {
    match tone {
        Tone::First => model.frequency(),
        Tone::Second => {
            let second = model.system.drive().frequencies().get(1).copied();
            second.unwrap_or_else(|| model.frequency())
        }
        Tone::Harmonic(order) => f64::from(order) * model.frequency(),
    }
}

/// Measures a motion of a model: an observer of its flow. A clone that was made before the run
/// measures another motion, for much less than a new one.
#[derive(Clone)]
pub struct Measurement<'a> {
    model: &'a Model,
    set: Set,
    needs: Arc<Needs>,
    accumulator: Accumulator,
    ends: Option<Ends>,
    clearance: Option<ClearanceSearch>,
    taken: Vec<Taken>,
}

/// An extremum that begins anew with every drive period.
#[derive(Clone)]
struct Taken {
    need: Need,
    key: ExtremumKey,
    /// Over all periods that have ended.
    overall: f64,
    /// Of the last one.
    last: f64,
    /// Of each of them.
    each: Vec<f64>,
    keeps_each: bool,
}

impl Taken {
    fn new(need: Need, key: ExtremumKey) -> Self {
        Self {
            need,
            key,
            overall: f64::NAN,
            last: f64::NAN,
            each: Vec::new(),
            keeps_each: false,
        }
    }

    fn together(&self, value: f64) -> f64 {
        match self.need {
            Need::Least(_) => value.min(self.overall),
            _ => value.max(self.overall),
        }
    }

    fn take(&mut self, accumulator: &mut Accumulator) {
        let value = accumulator.take_extremum(self.key);
        self.overall = self.together(value);
        self.last = value;
        if self.keeps_each {
            self.each.push(value);
        }
    }
}

impl<'a> Measurement<'a> {
    /// Of the observables `set` of a motion of `model` that is still to run.
    ///
    /// # Errors
    /// When a number of the model is not finite.
    pub fn new(model: &'a Model, set: Set) -> Result<Self, FlowError> {
        let needs = Arc::new(Needs::of(model, set)?);
        let clearance = needs
            .clearance
            .then(|| ClearanceSearch::new(model))
            .flatten();
        let mut measurement = Self {
            model,
            set,
            accumulator: Accumulator::new(&needs.plan),
            ends: needs.ends.then(Ends::default),
            taken: Vec::new(),
            clearance,
            needs,
        };
        if measurement.clearance.is_some() {
            measurement.take(Need::Least(Signal::Height), false);
        }
        Ok(measurement)
    }

    /// Keeps the extrema of the tip deflection in every drive period too, where the choice of
    /// observables has them.
    #[must_use]
    pub fn of_each_period(mut self) -> Self {
        self.take(Need::Least(Signal::Tip), true);
        self.take(Need::Greatest(Signal::Tip), true);
        self
    }

    /// Outputs that are one share an extremum.
    fn take(&mut self, need: Need, keeps_each: bool) {
        let Some(key) = self.needs.extremum(need) else {
            return;
        };
        match self.taken.iter_mut().find(|taken| taken.key == key) {
            Some(known) => known.keeps_each |= keeps_each,
            None => self.taken.push(Taken {
                keeps_each,
                ..Taken::new(need, key)
            }),
        }
    }

    fn taken(&self, need: Need) -> Option<&Taken> {
        let key = self.needs.extremum(need)?;
        self.taken.iter().find(|taken| taken.key == key)
    }

    fn each(&self, need: Need) -> &[f64] {
        self.taken(need).map_or(&[], |taken| &taken.each)
    }

    /// Least tip deflection of each drive period so far.
    pub fn lows(&self) -> &[f64] {
        self.each(Need::Least(Signal::Tip))
    }

    /// Greatest tip deflection of each drive period so far.
    pub fn highs(&self) -> &[f64] {
        self.each(Need::Greatest(Signal::Tip))
    }

    /// The observables of what ran so far.
    ///
    /// # Errors
    /// When the beam's least height could not be found.
    pub fn observables(mut self) -> Result<Observables, FlowError> {
        if self.accumulator.duration() <= 0.0 {
            return Ok(Observables::UNKNOWN);
        }
        let clearance = match self.clearance.take() {
            Some(search) => search.found(self.model)?,
            None => None,
        };
        let values = self.needs.keys.iter().map(|&(need, key)| {
            let value = Phasor::from(key.value(&self.accumulator));
            // What was taken at the ends of periods belongs to the whole.
            let whole = self.taken(need).map(|taken| Phasor {
                re: taken.together(value.re),
                im: 0.0,
            });
            (need, whole.unwrap_or(value))
        });
        let gathered = &self.accumulator;
        let found = Found {
            values: values.collect(),
            duration: gathered.duration(),
            periods: gathered.periods(),
            contact_time: contact_regimes(self.model)
                .map(|r| gathered.time_in(r))
                .sum(),
            contacts: contacts(self.model, gathered),
            stored: self.ends.as_ref().map_or(0.0, |ends| ends.gain(self.model)),
            stored_by_sample: 0.0,
            clearance,
            impact_loss: self.model.impact_loss,
            second_phase: self.model.second_phase,
        };
        Ok(found.observables(self.model, self.set))
    }
}

/// The regimes that are contact.
pub(super) fn contact_regimes(model: &Model) -> impl Iterator<Item = usize> + '_ {
    (0..model.contact.len()).filter(|&regime| model.contact[regime])
}

/// Pairs of regimes between which a contact begins.
pub(super) fn beginnings(model: &Model) -> impl Iterator<Item = (usize, usize)> + '_ {
    let regimes = model.contact.len();
    (0..regimes)
        .flat_map(move |from| (0..regimes).map(move |to| (from, to)))
        .filter(|&(from, to)| begins_contact(model, from, to))
}

/// The contacts that began.
fn contacts(model: &Model, gathered: &Accumulator) -> Beginnings<f64> {
    let mut all = Beginnings::<f64>::default();
    for (from, to) in beginnings(model) {
        let some = gathered.switches(from, to);
        all.count += some.count;
        all.grazing += some.grazing;
        all.greatest_speed = all.greatest_speed.max(some.greatest_speed);
        all.squared_speeds += some.squared_speeds;
    }
    all
}

impl Observer for Measurement<'_> {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        self.accumulator.segment(segment);
        if let Some(ends) = &mut self.ends {
            ends.segment(segment);
        }
        if let Some(clearance) = &mut self.clearance {
            clearance.segment(segment);
        }
    }

    fn switch(&mut self, switch: &SwitchView<'_>) {
        self.accumulator.switch(switch);
    }

    fn period_end(&mut self) {
        for taken in &mut self.taken {
            taken.take(&mut self.accumulator);
        }
        let lowest = self
            .taken(Need::Least(Signal::Height))
            .map(|taken| taken.last);
        if let Some((clearance, lowest)) = self.clearance.as_mut().zip(lowest) {
            clearance.period_end(lowest);
        }
        self.accumulator.period_end();
    }
}

/// Where the beam comes nearest to the sample over `periods` drive periods from `state`.
pub(super) fn measure_clearance(
    model: &Model,
    state: &[f64],
    periods: usize,
) -> Result<Option<Clearance>, MotionError> {
    let seen = super::measure(model, state, periods, Set::CLEARANCE)?;
    let (height, xi) = (seen.beam_clearance, seen.beam_clearance_xi);
    Ok(height
        .zip(xi)
        .zip(seen.beam_clearance_period)
        .map(|((height, xi), period)| Clearance { height, xi, period }))
}

/// What observables are read from. Before a run it is empty, and notes what they ask for.
pub(super) struct Measured<'a, D = f64> {
    pub(super) model: &'a Model,
    pub(super) asked: Vec<Need>,
    asked_ends: bool,
    asked_clearance: bool,
    pub(super) found: Option<Found<D>>,
}

/// What was gathered of a motion.
pub(super) struct Found<D> {
    pub(super) values: Vec<(Need, Phasor<D>)>,
    pub(super) duration: D,
    /// Whole drive periods.
    pub(super) periods: u64,
    pub(super) contact_time: D,
    pub(super) contacts: Beginnings<D>,
    /// Gain of stored energy.
    pub(super) stored: D,
    /// The part of it that a nonlinear law stores.
    pub(super) stored_by_sample: D,
    pub(super) clearance: Option<Clearance<D>>,
    /// What an impact takes, as a factor of the square of its speed.
    pub(super) impact_loss: D,
    /// Phase of the second tone in rad.
    pub(super) second_phase: D,
}

impl Found<f64> {
    /// The observables.
    pub(super) fn observables(self, model: &Model, set: Set) -> Observables {
        let mut measured = Measured {
            found: Some(self),
            ..Measured::nothing(model)
        };
        Observables::read(set, &mut measured)
    }
}

/// The contacts that began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Beginnings<D> {
    pub(super) count: u64,
    pub(super) grazing: u64,
    pub(super) greatest_speed: D,
    pub(super) squared_speeds: D,
}

impl<'a, D: Number> Measured<'a, D> {
    /// Before the run.
    pub(super) const fn nothing(model: &'a Model) -> Self {
        Self {
            model,
            asked: Vec::new(),
            asked_ends: false,
            asked_clearance: false,
            found: None,
        }
    }

    /// What was gathered; 0 before the run.
    fn value(&mut self, need: Need) -> Phasor<D> {
        if let Some(found) = &self.found {
            let known = found.values.iter().find(|(known, _)| *known == need);
            let nothing = Phasor {
                re: D::from(f64::NAN),
                im: D::default(),
            };
            known.map_or(nothing, |(_, value)| *value)
        } else {
            if !self.asked.contains(&need) {
                self.asked.push(need);
            }
            Phasor::default()
        }
    }

    fn gathered(&self, read: impl Fn(&Found<D>) -> D) -> D {
        self.found.as_ref().map_or_else(D::default, read)
    }

    /// The least value of a signal.
    pub(super) fn least(&mut self, signal: Signal) -> D {
        self.value(Need::Least(signal)).re
    }

    /// Its greatest value.
    pub(super) fn greatest(&mut self, signal: Signal) -> D {
        self.value(Need::Greatest(signal)).re
    }

    /// Both.
    pub(super) fn range(&mut self, signal: Signal) -> [D; 2] {
        [self.least(signal), self.greatest(signal)]
    }

    /// The time mean of a signal.
    pub(super) fn mean(&mut self, signal: Signal) -> D {
        self.value(Need::Integral(signal)).re / self.duration()
    }

    /// `∫ a b dt`.
    fn product(&mut self, a: Signal, b: Signal) -> D {
        self.value(Need::Product(a, b)).re
    }

    /// The time mean of the product of two signals.
    pub(super) fn mean_product(&mut self, a: Signal, b: Signal) -> D {
        self.product(a, b) / self.duration()
    }

    /// The component `Re(c e^{iωt})` of a signal at a frequency of the drive.
    pub(super) fn component(&mut self, signal: Signal, tone: Tone) -> Phasor<D> {
        let c = self.value(Need::Fourier(signal, tone));
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
            self.duration().plain() / self.model.period()
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
        if least.plain().abs() <= ROUNDING * peak.plain() {
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
            let pull = -self.least(Signal::Force).plain();
            (
                self.peak_force().plain().max(pull),
                (far.plain() - near.plain()),
            )
        } else {
            (self.peak_force().plain(), self.indentation().plain())
        };
        if above_rounding(work.plain(), force, depth) == 0.0 {
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
        self.gathered(|found| found.impact_loss * found.contacts.squared_speeds)
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
        self.asked_ends = true;
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
        self.asked_clearance = true;
        // The beam's end stands a fixed height over the tip.
        self.least(Signal::Height);
        self.found.as_ref()?.clearance
    }
}
