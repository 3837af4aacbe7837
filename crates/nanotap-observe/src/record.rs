//! Recording of motions.

use nanotap_dynamics::PeriodicOrbit;

use super::clearance::Clearance;
use super::contact_event::ContactEvent;
use super::measure::PiecewiseLinear;
use super::measured::MeasuredValues;
use super::nonlinear::Nonlinear;
use super::table::{ObservableSet, Observables};
use nanotap_model::recording::Recording;
use nanotap_model::{Model, MotionError};

/// What to record in addition to the observables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordOptions {
    /// Number of drive periods at the beginning that are recorded.
    pub recorded: usize,
    /// Number of drive periods whose final states are recorded, counted from the end.
    pub states: usize,
    /// Whether contact events are listed.
    pub events: bool,
    /// Whether the extrema of the tip deflection in every period are listed, if they are
    /// observables of the set.
    pub each_period: bool,
}

/// A recorded motion, with its observables.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// The observables, in the model's units.
    pub observables: Observables,
    /// Recording of the first periods.
    pub recording: Recording,
    /// States at the ends of its last periods, in order.
    pub states: Vec<Vec<f64>>,
    /// State at the end of the last period, in model units.
    pub end: Vec<f64>,
    /// Contact events in order of time; of a piecewise-linear model, only if they were requested.
    pub events: Vec<ContactEvent>,
    /// Smallest tip deflection of each period, in the model's units.
    pub lows: Vec<f64>,
    /// Largest tip deflection of each period, in the model's units.
    pub highs: Vec<f64>,
}

/// The engine of a model, prepared for the measurement of its motions.
pub(super) trait Engine {
    /// Starts a run at drive phase 0.
    fn start(
        &self,
        state: &[f64],
        options: RecordOptions,
    ) -> Result<Box<dyn Run + '_>, MotionError>;
}

/// A motion with measurement during the run.
pub(super) trait Run {
    /// Runs one drive period and records it if `record`.
    fn period(&mut self, record: bool) -> Result<(), MotionError>;
    /// Goes on from another state at the end of a period, if it is in the same regime. A run that does
    /// not need it goes on as it is.
    fn continue_from(&mut self, state: &[f64]) -> Result<(), MotionError> {
        let _ = state;
        Ok(())
    }
    /// Returns the present state, in model units.
    fn state(&self) -> Vec<f64>;
    /// The measurements over the periods so far.
    fn finish(self: Box<Self>) -> Result<Measurements, MotionError>;
}

/// The measurements of a run.
pub(super) struct Measurements {
    /// `None` for a run of zero length.
    pub(super) found: Option<MeasuredValues<f64>>,
    pub(super) recording: Recording,
    pub(super) events: Vec<ContactEvent>,
    pub(super) lows: Vec<f64>,
    pub(super) highs: Vec<f64>,
}

/// Records motions of one model, whose engine is prepared once.
pub struct Recorder<'a> {
    model: &'a Model,
    set: ObservableSet,
    engine: Box<dyn Engine + 'a>,
}

impl<'a> Recorder<'a> {
    /// Prepares the observables `set` of `model`.
    ///
    /// # Errors
    /// If a number of the model is not finite.
    pub fn new(model: &'a Model, set: ObservableSet) -> Result<Self, MotionError> {
        let engine: Box<dyn Engine + 'a> = match &model.nonlinear {
            Some(nonlinear) => Box::new(Nonlinear::new(model, nonlinear, set)),
            None => Box::new(PiecewiseLinear::new(model, set)?),
        };
        Ok(Self { model, set, engine })
    }

    /// Records `periods` drive periods from `start` at drive phase 0.
    ///
    /// # Errors
    /// If the flow fails.
    pub fn record(
        &self,
        start: &[f64],
        periods: usize,
        options: RecordOptions,
    ) -> Result<Recorded, MotionError> {
        self.record_along(start, &[], periods, options)
    }

    /// Records one repetition of an orbit from its state number `first`. Along a superstable orbit,
    /// errors may grow by many powers of ten before they vanish, so each period begins with the orbit's own
    /// state.
    ///
    /// # Errors
    /// If the flow fails, or the orbit has no such state.
    pub fn record_orbit(
        &self,
        orbit: &PeriodicOrbit,
        first: usize,
        options: RecordOptions,
    ) -> Result<Recorded, MotionError> {
        let mut states = orbit.states.clone();
        let count = states.len();
        states.rotate_left(first.min(count));
        let start = states.first().cloned().unwrap_or_default();
        let along = if orbit.is_superstable() {
            &states[..]
        } else {
            &[]
        };
        self.record_along(&start, along, orbit.period, options)
    }

    /// Records `periods` drive periods from `start`, each of which begins with its state of `along`, where
    /// there is one.
    fn record_along(
        &self,
        start: &[f64],
        along: &[Vec<f64>],
        periods: usize,
        options: RecordOptions,
    ) -> Result<Recorded, MotionError> {
        let mut run = self.engine.start(start, options)?;
        let mut states = Vec::new();
        for k in 0..periods {
            if let Some(state) = along.get(k).filter(|_| k > 0) {
                run.continue_from(state)?;
            }
            run.period(k < options.recorded)?;
            if k + 1 + options.states > periods {
                states.push(run.state());
            }
        }
        let end = run.state();
        let measured = run.finish()?;
        let observables = |found: MeasuredValues<f64>| found.observables(self.model, self.set);
        Ok(Recorded {
            observables: measured.found.map_or(Observables::UNKNOWN, observables),
            recording: measured.recording,
            states,
            end,
            events: measured.events,
            lows: measured.lows,
            highs: measured.highs,
        })
    }
}

/// Records `periods` drive periods of `model` from `start` at drive phase 0.
///
/// # Errors
/// If the flow fails.
pub fn record(
    model: &Model,
    start: &[f64],
    periods: usize,
    set: ObservableSet,
    options: RecordOptions,
) -> Result<Recorded, MotionError> {
    Recorder::new(model, set)?.record(start, periods, options)
}

/// Measures `periods` drive periods of `model` from `state` at drive phase 0.
///
/// # Errors
/// If the flow fails.
pub fn measure(
    model: &Model,
    state: &[f64],
    periods: usize,
    set: ObservableSet,
) -> Result<Observables, MotionError> {
    Ok(record(model, state, periods, set, RecordOptions::default())?.observables)
}

impl Clearance {
    /// The clearance over `periods` drive periods from `state` at drive phase 0; `None` for a model
    /// that is not a beam.
    ///
    /// # Errors
    /// If the flow fails.
    pub fn of(model: &Model, state: &[f64], periods: usize) -> Result<Option<Self>, MotionError> {
        let seen = measure(model, state, periods, ObservableSet::CLEARANCE)?;
        let place = seen.beam_clearance.zip(seen.beam_clearance_xi);
        Ok(place
            .zip(seen.beam_clearance_period)
            .map(|((height, xi), period)| Self { height, xi, period }))
    }
}
