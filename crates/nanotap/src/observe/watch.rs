//! Runs a motion and watches it, whichever engine it runs on.

use std::sync::Arc;

use nanotap_flow::Flow;
use nanotap_flow::trajectory::Recorder;

use super::clearance::Clearance;
use super::contact_event::{ContactEvent, Contacts};
use super::gather::Gatherer;
use super::measure::Measurement;
use super::table::{Observables, Set};
use crate::model::nonlinear::Nonlinear;
use crate::model::recording::{Recording, each_period};
use crate::model::{Model, MotionError};

/// What is kept of a motion beside its observables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// The first so many periods as a recording.
    pub recorded: usize,
    /// The states at the ends of the last so many periods.
    pub states: usize,
    /// The contacts.
    pub events: bool,
    /// The extrema of the tip deflection in every period, where they are measured.
    pub each_period: bool,
}

/// A motion that was watched.
#[derive(Clone, Debug)]
pub struct Watched {
    /// What can be read off it.
    pub observables: Observables,
    /// Its first periods.
    pub recording: Recording,
    /// States at the ends of its last periods, and the very last one.
    pub states: Vec<Vec<f64>>,
    /// The state at its end.
    pub end: Vec<f64>,
    /// Its contacts.
    pub events: Vec<ContactEvent>,
    /// Least tip deflection of each period.
    pub lows: Vec<f64>,
    /// Greatest tip deflection of each period.
    pub highs: Vec<f64>,
}

/// Watches motions of one model: what its observables need is worked out once.
pub struct Watcher<'a> {
    model: &'a Model,
    set: Set,
    engine: Engine<'a>,
}

enum Engine<'a> {
    /// With the measurement before any motion ran.
    Exact(Box<Measurement<'a>>),
    Nonlinear(&'a Arc<Nonlinear>),
}

impl<'a> Watcher<'a> {
    /// For the observables `set` of `model`.
    ///
    /// # Errors
    /// When a number of the model is not finite.
    pub fn new(model: &'a Model, set: Set) -> Result<Self, MotionError> {
        let engine = match &model.nonlinear {
            Some(nonlinear) => Engine::Nonlinear(nonlinear),
            None => Engine::Exact(Box::new(Measurement::new(model, set)?)),
        };
        Ok(Self { model, set, engine })
    }

    /// Watches `periods` drive periods from `start` at drive phase 0.
    ///
    /// # Errors
    /// When the flow fails.
    pub fn watch(&self, start: &[f64], periods: usize, kept: Kept) -> Result<Watched, MotionError> {
        match &self.engine {
            Engine::Exact(measurement) => {
                exact(self.model, (**measurement).clone(), start, periods, kept)
            }
            Engine::Nonlinear(nonlinear) => {
                let gatherer = Gatherer::new(self.model, nonlinear, self.set, start);
                under_a_law(nonlinear, gatherer, start, periods, kept)
            }
        }
    }
}

/// Watches `periods` drive periods of `model` from `start` at drive phase 0.
///
/// # Errors
/// When the flow fails.
pub fn watch(
    model: &Model,
    start: &[f64],
    periods: usize,
    set: Set,
    kept: Kept,
) -> Result<Watched, MotionError> {
    Watcher::new(model, set)?.watch(start, periods, kept)
}

fn under_a_law(
    nonlinear: &Arc<Nonlinear>,
    mut gatherer: Gatherer<'_>,
    start: &[f64],
    periods: usize,
    kept: Kept,
) -> Result<Watched, MotionError> {
    let mut end = start.to_vec();
    let (mut states, mut recorded) = (Vec::new(), Vec::new());
    let mut count = 0;
    each_period(nonlinear, &mut end, periods, |state, period| {
        gatherer.take(state, &period);
        count += 1;
        if count + kept.states > periods {
            states.push(state.to_vec());
        }
        if count <= kept.recorded {
            recorded.push(period);
        }
    })?;
    Ok(Watched {
        lows: gatherer.lows(),
        highs: gatherer.highs(),
        events: gatherer.events(),
        recording: Recording::of_periods(nonlinear, recorded),
        observables: gatherer.observables(),
        states,
        end,
    })
}

fn exact(
    model: &Model,
    mut measurement: Measurement<'_>,
    start: &[f64],
    periods: usize,
    kept: Kept,
) -> Result<Watched, MotionError> {
    if kept.each_period {
        measurement = measurement.of_each_period();
    }
    let mut contacts = Contacts::of(model);
    let mut recorder = Recorder::default();
    let mut flow = Flow::new(Arc::clone(&model.system));
    flow.start(start, 0.0)?;
    let mut states = Vec::new();
    for k in 0..periods {
        match (kept.events, k < kept.recorded) {
            (false, false) => flow.run_period(&mut measurement)?,
            (false, true) => flow.run_period(&mut (&mut measurement, &mut recorder))?,
            (true, false) => flow.run_period(&mut (&mut measurement, &mut contacts))?,
            (true, true) => {
                let mut both = (&mut measurement, &mut contacts);
                flow.run_period(&mut (&mut both, &mut recorder))?;
            }
        }
        if k + 1 + kept.states > periods {
            let mut state = vec![0.0; model.dimension()];
            flow.state(&mut state);
            states.push(state);
        }
    }
    let mut end = vec![0.0; model.dimension()];
    flow.state(&mut end);
    Ok(Watched {
        lows: measurement.lows().to_vec(),
        highs: measurement.highs().to_vec(),
        observables: measurement.observables()?,
        recording: Recording::Exact(recorder.finish(Arc::clone(&model.system))),
        events: contacts.events(),
        states,
        end,
    })
}

/// Measures `periods` drive periods of `model` from `state` at drive phase 0.
///
/// # Errors
/// When the flow fails.
pub fn measure(
    model: &Model,
    state: &[f64],
    periods: usize,
    set: Set,
) -> Result<Observables, MotionError> {
    Ok(watch(model, state, periods, set, Kept::default())?.observables)
}

impl Clearance {
    /// Over `periods` drive periods from `state` at drive phase 0; `None` if the model is no
    /// beam.
    ///
    /// # Errors
    /// When the flow fails.
    pub fn of(model: &Model, state: &[f64], periods: usize) -> Result<Option<Self>, MotionError> {
        let seen = measure(model, state, periods, Set::CLEARANCE)?;
        let place = seen.beam_clearance.zip(seen.beam_clearance_xi);
        Ok(place
            .zip(seen.beam_clearance_period)
            .map(|((height, xi), period)| Self { height, xi, period }))
    }
}
