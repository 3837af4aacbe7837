//! Measurement of a piecewise-linear motion during a run.
//!
//! The functionals that observables require are accumulated by `nanotap_flow`'s
//! [accumulator](nanotap_flow::accumulate): extrema from zeros of rates, integrals in closed form,
//! never from samples.

use std::sync::Arc;

use nanotap_flow::accumulate::{Accumulator, Plan, Request};
use nanotap_flow::flow::{Observer, SegmentView, SwitchView};
use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Flow, FlowError};

use super::begins_contact;
use super::clearance::ClearanceSearch;
use super::contact_event::Contacts;
use super::energy::{Ends, end_phase, stored_by_sample};
use super::functional::{Functional, Requirements, Signal};
use super::measured::{Beginnings, Impacts, MeasuredValues};
use super::number::Phasor;
use super::record::{Engine, Measurements, RecordOptions, Run};
use super::table::ObservableSet;
use nanotap_model::recording::Recording;
use nanotap_model::{Model, MotionError};

/// The measurement of motions of a piecewise-linear model.
pub(super) struct PiecewiseLinear<'a> {
    model: &'a Model,
    required: Requirements,
    /// The index of each required functional in the plan.
    numbers: Vec<usize>,
    plan: Arc<Plan>,
}

impl<'a> PiecewiseLinear<'a> {
    /// Prepares the measurement of the observables `set`.
    ///
    /// # Errors
    /// If a number of the model is not finite.
    pub(super) fn new(model: &'a Model, set: ObservableSet) -> Result<Self, FlowError> {
        let required = Requirements::of(model, set);
        let mut request = Request::new();
        let signals = required.signals.iter();
        let outputs: Vec<usize> = signals
            .map(|signal| request.output_by_regime(&signal.outputs(model)))
            .collect();
        let functionals = required.numbered(model).into_iter();
        let numbers = functionals.map(|f| request.add(f.map(|signal| outputs[signal], |f| f)));
        Ok(Self {
            numbers: numbers.collect(),
            plan: request.plan(&model.system)?,
            model,
            required,
        })
    }

    fn number(&self, functional: Functional) -> Option<usize> {
        let all = &self.required.functionals;
        let at = all.iter().position(|known| *known == functional)?;
        Some(self.numbers[at])
    }
}

impl Engine for PiecewiseLinear<'_> {
    fn start(
        &self,
        state: &[f64],
        options: RecordOptions,
    ) -> Result<Box<dyn Run + '_>, MotionError> {
        let mut flow = Flow::new(Arc::clone(&self.model.system));
        flow.start(state, 0.0)?;
        let required = &self.required;
        let clearance = required.clearance.then(|| ClearanceSearch::new(self.model));
        let mut measurement = Measurement {
            of: self,
            accumulator: Accumulator::new(&self.plan),
            ends: required.stored.then(Ends::default),
            clearance: clearance.flatten(),
            per_period: Vec::new(),
            contacts: options.events.then(|| Contacts::of(self.model)),
            recorder: Recorder::default(),
            records: false,
        };
        if measurement.clearance.is_some() {
            measurement.restart_each_period(Functional::Least(Signal::Height));
        }
        if options.each_period {
            measurement.restart_each_period(Functional::Least(Signal::Tip));
            measurement.restart_each_period(Functional::Greatest(Signal::Tip));
        }
        Ok(Box::new(ExactRun {
            start: (flow.regime(), state.to_vec()),
            flow,
            measurement,
        }))
    }
}

/// Relative difference of states below which a motion has closed.
const CLOSED: f64 = 1e-9;

/// A run of the exact flow, which is measured.
struct ExactRun<'a> {
    /// Regime and state at the start.
    start: (usize, Vec<f64>),
    flow: Flow,
    measurement: Measurement<'a>,
}

impl Run for ExactRun<'_> {
    fn period(&mut self, record: bool) -> Result<(), MotionError> {
        self.measurement.records = record;
        Ok(self.flow.run_period(&mut self.measurement)?)
    }

    fn continue_from(&mut self, state: &[f64]) -> Result<(), MotionError> {
        let mut other = self.flow.clone();
        other.start(state, 0.0)?;
        if other.regime() == self.flow.regime() {
            self.flow = other;
        }
        Ok(())
    }

    fn state(&self) -> Vec<f64> {
        let mut state = vec![0.0; self.flow.system().dimension()];
        self.flow.state(&mut state);
        state
    }

    fn finish(self: Box<Self>) -> Result<Measurements, MotionError> {
        let model = self.measurement.of.model;
        let (before, after) = (&self.start.1, self.state());
        let size = before.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let changes = before.iter().zip(&after).map(|(a, b)| (a - b).abs());
        // A closed orbit gains nothing, and needs no powers.
        let gain = if changes.fold(0.0, f64::max) <= CLOSED * size {
            0.0
        } else {
            stored_by_sample(model, self.flow.regime(), &after, end_phase(model))
                - stored_by_sample(model, self.start.0, before, 0.0)
        };
        Ok(self.measurement.finish(gain)?)
    }
}

/// The accumulated measurements of a motion: an observer of its flow.
struct Measurement<'a> {
    of: &'a PiecewiseLinear<'a>,
    accumulator: Accumulator,
    ends: Option<Ends>,
    clearance: Option<ClearanceSearch>,
    per_period: Vec<PerPeriodExtremum>,
    contacts: Option<Contacts<'a>>,
    recorder: Recorder,
    /// Whether the present period is recorded.
    records: bool,
}

/// An extremum that restarts in every drive period.
struct PerPeriodExtremum {
    /// Index of the functional in the plan.
    number: usize,
    is_least: bool,
    /// Extremum over all finished periods.
    overall: f64,
    /// Extremum of each finished period.
    each: Vec<f64>,
}

impl PerPeriodExtremum {
    fn with(&self, value: f64) -> f64 {
        if self.is_least {
            value.min(self.overall)
        } else {
            value.max(self.overall)
        }
    }
}

impl Measurement<'_> {
    /// Restarts an extremum in each period, if it is required.
    fn restart_each_period(&mut self, functional: Functional) {
        let Some(number) = self.of.number(functional) else {
            return;
        };
        if self.per_period.iter().all(|known| known.number != number) {
            self.per_period.push(PerPeriodExtremum {
                number,
                is_least: matches!(functional, Functional::Least(_)),
                overall: f64::NAN,
                each: Vec::new(),
            });
        }
    }

    fn per_period(&self, functional: Functional) -> Option<&PerPeriodExtremum> {
        let number = self.of.number(functional)?;
        self.per_period.iter().find(|known| known.number == number)
    }

    fn each(&self, functional: Functional) -> Vec<f64> {
        let known = self.per_period(functional);
        known.map_or_else(Vec::new, |known| known.each.clone())
    }

    fn finish(mut self, stored_by_sample: f64) -> Result<Measurements, FlowError> {
        let (lows, highs) = (
            self.each(Functional::Least(Signal::Tip)),
            self.each(Functional::Greatest(Signal::Tip)),
        );
        let model = self.of.model;
        let (gathered, search) = (&self.accumulator, self.clearance.take());
        let found = if gathered.duration() > 0.0 {
            let clearance = search.map(|search| search.finish(model)).transpose()?;
            let value = |(functional, number): (&Functional, &usize)| {
                let mut value = Phasor::from(gathered.values()[*number]);
                // The ends of periods belong to the whole.
                if let Some(known) = self.per_period(*functional) {
                    value.re = known.with(value.re);
                }
                (*functional, value)
            };
            let functionals = self.of.required.functionals.iter();
            Some(MeasuredValues {
                values: functionals.zip(&self.of.numbers).map(value).collect(),
                duration: gathered.duration(),
                periods: gathered.periods(),
                contact_time: contact_regimes(model).map(|r| gathered.time_in(r)).sum(),
                contacts: contacts(model, gathered),
                stored: self.ends.as_ref().map_or(0.0, |ends| ends.gain(model)),
                stored_by_sample,
                clearance: clearance.flatten(),
                impacts: impacts(model, gathered),
                tone_phases: model.tone_phases.clone(),
            })
        } else {
            None
        };
        Ok(Measurements {
            found,
            lows,
            highs,
            events: self.contacts.map_or_else(Vec::new, Contacts::events),
            recording: Recording::PiecewiseLinear(self.recorder.finish(Arc::clone(&model.system))),
        })
    }
}

/// Returns the indices of the regimes in contact.
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

/// Sums up the contacts that began, over all pairs of regimes.
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

/// The impacts on a rigid stop.
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
        if self.records {
            self.recorder.segment(segment);
        }
    }

    fn switch(&mut self, switch: &SwitchView<'_>) {
        self.accumulator.switch(switch);
        if let Some(contacts) = &mut self.contacts {
            contacts.switch(switch);
        }
        if self.records {
            self.recorder.switch(switch);
        }
    }

    fn period_end(&mut self) {
        for extremum in &mut self.per_period {
            let value = self.accumulator.take(extremum.number);
            extremum.overall = extremum.with(value);
            extremum.each.push(value);
        }
        let height = self.per_period(Functional::Least(Signal::Height));
        let lowest = height.and_then(|height| height.each.last().copied());
        if let Some((clearance, lowest)) = self.clearance.as_mut().zip(lowest) {
            clearance.period_end(lowest);
        }
        self.accumulator.period_end();
        if let Some(contacts) = &mut self.contacts {
            contacts.period_end();
        }
        if self.records {
            self.recorder.period_end();
        }
    }
}
