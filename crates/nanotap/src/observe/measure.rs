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
use nanotap_flow::{Complex, FlowError};

use super::begins_contact;
use super::clearance::ClearanceSearch;
use super::energy::Ends;
use super::measured::{Beginnings, Found, Impacts, Measured, Need, Signal, Tone};
use super::number::Phasor;
use super::table::{Observables, Set};
use crate::model::Model;

/// Where it is found.
#[derive(Clone, Copy, Debug)]
enum Key {
    Extremum(ExtremumKey),
    Integral(IntegralKey),
    Product(ProductKey),
    Fourier(FourierKey),
}

impl Need {
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
            impacts: impacts(self.model, gathered),
            second_phase: self.model.second_phase,
        };
        Ok(found.observables(self.model, self.set))
    }
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
    }
    all
}

/// What impacts on a rigid stop did.
fn impacts(model: &Model, gathered: &Accumulator) -> Impacts<f64> {
    let Some(stop) = model.rigid_stop else {
        return Impacts::default();
    };
    let (mut bounced, mut stuck) = ([0.0; 2], [0.0; 2]);
    for (from, to) in beginnings(model) {
        let some = gathered.switches(from, to);
        let sums = if from == to { &mut bounced } else { &mut stuck };
        sums[0] += some.speeds;
        sums[1] += some.squared_speeds;
    }
    Impacts::new([stop.mass, stop.restitution, stop.tip], bounced, stuck)
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
