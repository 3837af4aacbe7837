//! One run of a sweep, and the runs of one piece of work.

use std::ops::Range;

use nanotap_dynamics::{
    Classified, ClassifyOptions, LyapunovSpectrum, MotionKind, PeriodicOrbit, Scheduling as _,
    StroboscopicMap, classify_beside,
};

use super::{Runs, SweepOptions};
use nanotap_case::Case;
use nanotap_case::physical::Scales;
use nanotap_case::units::Units;
use nanotap_dataset::Block;
use nanotap_model::model_map::ModelMap;
use nanotap_model::{Model, MotionError};
use nanotap_motions::map::UNINTERRUPTED;
use nanotap_motions::short_run::short_run;
use nanotap_motions::simulate::{Classification, NamedMotion};
use nanotap_observe::time_series::with_modes;
use nanotap_observe::{ObservableSet, Observables, RecordOptions, Recorded, Recorder};
use nanotap_study::start_box::{box_with, default_starts};

/// Initial states of the runs at each value of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Starts {
    /// At rest, or in the motion of the setpoint.
    Rest,
    /// In one given state, in the model's units. Its entries are a_1 … a_N (or x), their rates,
    /// then any memory of the sample.
    Given(Vec<f64>),
    /// In quasi-random states of a box, drawn with a seed.
    Seeded {
        /// Number of initial states at each value.
        count: usize,
        /// Seed of the quasi-random states.
        seed: u64,
        /// Sides of the box they are in, by the name of the entry of the state; the others
        /// [fit the case](nanotap_study::start_box) at each value.
        sides: Vec<(String, f64, f64)>,
    },
    /// Rest, the linear responses, and draws of every size
    /// ([`default_starts`](nanotap_study::start_box::default_starts)).
    Spread {
        /// Number of initial states at each value.
        count: usize,
        /// Seed of the states that are drawn.
        seed: u64,
    },
}

impl Starts {
    /// Returns the number of initial states at each value.
    pub fn count(&self) -> usize {
        match self {
            Self::Rest | Self::Given(_) => 1,
            Self::Seeded { count, .. } | Self::Spread { count, .. } => *count,
        }
    }

    /// The `index`-th one, for `model`.
    fn state(&self, index: usize, model: &Model) -> Vec<f64> {
        match self {
            Self::Rest => model.first_state(),
            Self::Given(state) => state.clone(),
            // A box that cannot be had was refused when the sweep was made.
            Self::Seeded { seed, sides, .. } => box_with(model, sides)
                .map_or_else(|_| model.rest(), |sides| sides.start(*seed, index as u64)),
            Self::Spread { seed, .. } => default_starts(model, *seed)
                .ok()
                .and_then(|starts| starts.start(index))
                .unwrap_or_else(|| model.rest()),
        }
    }
}

/// Result of one run, as a row of the dataset.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    pub(super) classification: Classification,
    /// Minimal period, 0 if it is not periodic.
    pub(super) period: usize,
    /// Drive periods of the discarded transient.
    pub(super) transient: usize,
    pub(super) observables: Observables,
    /// Largest modulus of a multiplier of the orbit.
    pub(super) multiplier: f64,
    /// Largest exponent a drive period, and its standard error.
    pub(super) lyapunov: f64,
    pub(super) lyapunov_error: f64,
    /// Greatest and least tip deflection of each recorded period; shorter, or empty, if
    /// the motion could not be recorded.
    pub(super) highs: Vec<f64>,
    pub(super) lows: Vec<f64>,
    /// States at the ends of the last recorded periods.
    pub(super) strobe: Vec<Vec<f64>>,
    /// Distance that was solved for the setpoint, m.
    pub(super) distance: f64,
}

impl Outcome {
    fn unknown(classification: Classification, transient: usize) -> Self {
        Self {
            classification,
            period: 0,
            transient,
            observables: Observables::UNKNOWN,
            multiplier: f64::NAN,
            lyapunov: f64::NAN,
            lyapunov_error: f64::NAN,
            highs: Vec::new(),
            lows: Vec::new(),
            strobe: Vec::new(),
            distance: f64::NAN,
        }
    }

    fn named(named: &NamedMotion, transient: usize) -> Self {
        let mut outcome = Self::unknown(named.classification, transient);
        if let Some(orbit) = &named.orbit {
            outcome.period = orbit.period;
            outcome.multiplier = orbit.spectral_radius();
            // Exact for an orbit; the chaos it may have been before does not count.
            outcome.lyapunov = nanotap_arithmetic::ln(outcome.multiplier) / orbit.period as f64;
        } else if let Some(spectrum) = &named.spectrum {
            (outcome.lyapunov, outcome.lyapunov_error) = spectrum.largest();
        }
        outcome
    }
}

/// The runs from every start of `block` at its `item`-th value of the first parameter;
/// `None` when it was stopped.
pub(super) fn at_value(
    runs: &Runs,
    block: &Block,
    item: usize,
    cancelled: &impl Fn() -> bool,
) -> Option<Vec<Outcome>> {
    let axis = runs.axis();
    let mut entry: Vec<usize> = block.ranges.iter().map(|r| r.start).collect();
    entry[axis] += item;
    let starts = block.ranges[axis + 1].clone();
    let mut outcomes = from_starts(runs, &entry, starts, cancelled)?;
    let distance = runs.distance(runs.index(&entry));
    for outcome in &mut outcomes {
        outcome.distance = distance;
    }
    Some(outcomes)
}

/// The runs from some starts at an entry of the grid; `None` when it was stopped.
fn from_starts(
    runs: &Runs,
    entry: &[usize],
    starts: Range<usize>,
    cancelled: &impl Fn() -> bool,
) -> Option<Vec<Outcome>> {
    let case = runs.case_of(runs.index(entry));
    let model = case.as_ref().and_then(|case| case.model().ok());
    let (Some(case), Some(model)) = (case, model) else {
        // Driven at an undamped resonance, or no distance: there is no bounded motion to name.
        return Some(vec![
            Outcome::unknown(Classification::Undecided, 0);
            starts.len()
        ]);
    };
    let mut runner = Runner::new(&case, &model, &runs.options);
    let states = starts.map(|start| runs.starts.state(start, &model));
    if let Some(transient) = runs.options.transient {
        return runner.all_after(&states.collect::<Vec<_>>(), transient, cancelled);
    }
    states
        .map(|state| (!cancelled()).then(|| runner.classified(&state).0))
        .collect()
}

/// The runs along a line of the first parameter, each from the last state of the one
/// before; `None` when it was stopped.
pub(super) fn along_line(
    runs: &Runs,
    block: &Block,
    cancelled: &impl Fn() -> bool,
) -> Option<Vec<Outcome>> {
    let axis = runs.axis();
    let mut entry: Vec<usize> = block.ranges.iter().map(|r| r.start).collect();
    let line = block.ranges[axis].clone();
    let lane = block.ranges[axis + 1].start;
    let (start, up) = runs.lane(lane);
    let order: Vec<usize> = if up {
        line.clone().collect()
    } else {
        line.clone().rev().collect()
    };
    let mut outcomes: Vec<Option<Outcome>> = vec![None; line.len()];
    let mut last: Option<Vec<f64>> = None;
    for index in order {
        if cancelled() {
            return None;
        }
        entry[axis] = index;
        let case = runs.case_of(runs.index(&entry));
        let model = case.as_ref().and_then(|case| case.model().ok());
        let (Some(case), Some(model)) = (case, model) else {
            outcomes[index] = Some(Outcome::unknown(Classification::Undecided, 0));
            continue;
        };
        let state = last.take().map_or_else(
            || runs.starts.state(start, &model),
            |state| {
                let modes = (model.dimension() - model.memory) / 2;
                let mut state = with_modes(&state, model.memory, modes);
                model.stop_at_wall(&mut state);
                state
            },
        );
        let (outcome, end) = Runner::new(&case, &model, &runs.options).run(&state);
        outcomes[index] = Some(outcome);
        // A motion that ran off is not followed; the next value starts anew.
        last = end;
    }
    outcomes.into_iter().collect()
}

impl Runs {
    /// The start and the direction (true is up) of a lane.
    pub(super) fn lane(&self, lane: usize) -> (usize, bool) {
        let starts = self.starts.count();
        let directions = self.options.follow.directions();
        (
            lane % starts,
            directions.get(lane / starts).copied().unwrap_or(true),
        )
    }
}

/// Runs one model again and again.
struct Runner<'a> {
    options: &'a SweepOptions,
    classify: ClassifyOptions,
    map: ModelMap,
    /// Stable orbits that starts went to.
    known: Vec<PeriodicOrbit>,
    /// Exponents of chaotic motions that starts went to.
    chaos: Vec<LyapunovSpectrum>,
    /// Recorder that measures every motion.
    recorder: Result<Recorder<'a>, MotionError>,
    /// Units that convert observables to SI; `None` where they stay in the model's units.
    scales: Option<Scales>,
}

impl<'a> Runner<'a> {
    fn new(case: &Case, model: &'a Model, options: &'a SweepOptions) -> Self {
        Self {
            scales: match case.units() {
                Units::Si(scales) => Some(scales),
                Units::Model => None,
            },
            options,
            classify: short_run(options.max_period),
            map: ModelMap::new(model),
            known: Vec::new(),
            chaos: Vec::new(),
            recorder: Recorder::new(model, ObservableSet::COMMON),
        }
    }

    /// Runs from `start`; the state at the end, unless the motion ran off.
    fn run(&mut self, start: &[f64]) -> (Outcome, Option<Vec<f64>>) {
        match self.options.transient {
            None => self.classified(start),
            Some(transient) => self.after(start, transient),
        }
    }

    /// The motion that the run was found to go to.
    fn classified(&mut self, start: &[f64]) -> (Outcome, Option<Vec<f64>>) {
        let classified = self.beside_known(start);
        let named = NamedMotion::of(&classified.kind);
        let outcome = Outcome::named(&named, classified.periods);
        match &named.orbit {
            Some(orbit) => {
                let from = orbit.nearest(&classified.state).0;
                self.recorded(outcome, from, Some(orbit))
            }
            None if named.classification == Classification::Unbounded => (outcome, None),
            None => self.recorded(outcome, &classified.state, None),
        }
    }

    /// The motions from all these starts after a number of periods, which are passed together; `None`
    /// when it was stopped.
    fn all_after(
        &mut self,
        starts: &[Vec<f64>],
        transient: usize,
        cancelled: &impl Fn() -> bool,
    ) -> Option<Vec<Outcome>> {
        let mut outcomes = Vec::with_capacity(starts.len());
        for starts in starts.chunks(self.map.batch_size()) {
            let mut states = starts.concat();
            let mut failures = vec![None; starts.len()];
            for done in (0..transient).step_by(UNINTERRUPTED) {
                if cancelled() {
                    return None;
                }
                // A motion that has failed is not followed any further.
                let now = (transient - done).min(UNINTERRUPTED);
                let periods: Vec<usize> = failures
                    .iter()
                    .map(|failure| if failure.is_none() { now } else { 0 })
                    .collect();
                let advanced = self.map.advance_each(&mut states, &periods);
                for (failure, result) in failures.iter_mut().zip(advanced) {
                    *failure = failure.or(result.err().as_ref().map(class_of));
                }
            }
            let each = states.chunks_exact(self.map.dimension()).zip(failures);
            for (state, failure) in each {
                if cancelled() {
                    return None;
                }
                outcomes.push(match failure {
                    Some(class) => Outcome::unknown(class, transient),
                    None => self.settled(state, transient).0,
                });
            }
        }
        Some(outcomes)
    }

    /// The motion after a number of periods.
    fn after(&mut self, start: &[f64], transient: usize) -> (Outcome, Option<Vec<f64>>) {
        let mut state = start.to_vec();
        match self.map.advance_by(&mut state, transient) {
            Ok(()) => self.settled(&state, transient),
            Err(error) => (Outcome::unknown(class_of(&error), transient), None),
        }
    }

    /// The motion that has come to `state` after a number of periods.
    fn settled(&mut self, state: &[f64], transient: usize) -> (Outcome, Option<Vec<f64>>) {
        let named = self.kind_of(state);
        let outcome = Outcome::named(&named, transient);
        match &named.orbit {
            // What repeats is recorded once.
            Some(orbit) if is_on(orbit, state) => {
                let from = orbit.nearest(state).0;
                self.recorded(outcome, from, Some(orbit))
            }
            _ => self.recorded(outcome, state, None),
        }
    }

    /// Classifies the motion from `state`. If it is on an orbit that an earlier start reached, that
    /// orbit is the result.
    fn kind_of(&mut self, state: &[f64]) -> NamedMotion {
        if let Some(orbit) = self.known.iter().find(|orbit| is_on(orbit, state)) {
            return NamedMotion::of(&MotionKind::Periodic(orbit.clone()));
        }
        let named = NamedMotion::of(&self.beside_known(state).kind);
        self.known.extend(named.orbit.clone());
        named
    }

    /// Classifies the motion from `state`, in comparison with the chaos that earlier starts
    /// reached.
    fn beside_known(&mut self, state: &[f64]) -> Classified {
        let classified = classify_beside(&mut self.map, state, &self.chaos, &self.classify);
        if let MotionKind::Chaotic(chaos) = &classified.kind
            && !self.chaos.contains(&chaos.spectrum)
        {
            self.chaos.push(chaos.spectrum.clone());
        }
        classified
    }

    fn watch(
        &self,
        from: &[f64],
        orbit: Option<&PeriodicOrbit>,
        periods: usize,
        kept: RecordOptions,
    ) -> Result<Recorded, MotionError> {
        let recorder = self.recorder.as_ref().map_err(Clone::clone)?;
        let first = orbit.and_then(|orbit| orbit.states.iter().position(|state| state == from));
        match orbit.zip(first) {
            Some((orbit, first)) => recorder.record_orbit(orbit, first, kept),
            None => recorder.record(from, periods, kept),
        }
    }

    /// Records the motion from `from`; with `orbit`, of which that is a state, one repetition is recorded
    /// and used for all periods.
    fn recorded(
        &self,
        mut outcome: Outcome,
        from: &[f64],
        orbit: Option<&PeriodicOrbit>,
    ) -> (Outcome, Option<Vec<f64>>) {
        let periods = self.options.periods;
        let turn = orbit.map_or(periods, |orbit| orbit.period);
        let kept = RecordOptions {
            states: turn,
            each_period: true,
            ..RecordOptions::default()
        };
        let Recorded {
            observables,
            states,
            lows,
            highs,
            ..
        } = match self.watch(from, orbit, turn, kept) {
            Ok(watched) => watched,
            Err(error) => return (Outcome::unknown(class_of(&error), outcome.transient), None),
        };
        let scales = self.scales.as_ref();
        outcome.observables = scales.map_or(observables, |scales| observables.in_si(scales));
        let length = scales.map_or(1.0, |scales| scales.length);
        outcome.highs = (0..periods).map(|k| length * highs[k % turn]).collect();
        outcome.lows = (0..periods).map(|k| length * lows[k % turn]).collect();
        let first = periods - self.options.strobe();
        outcome.strobe = (first..periods).map(|k| states[k % turn].clone()).collect();
        let end = states[(periods - 1) % turn].clone();
        (outcome, Some(end))
    }
}

/// Distance from an orbit, as a fraction of its size, below which a motion is on it: the recording
/// then differs by no more.
const ARRIVED: f64 = 1e-10;

/// Whether a motion that goes to an orbit has come to it.
pub(super) fn is_on(orbit: &PeriodicOrbit, state: &[f64]) -> bool {
    orbit.nearest(state).1 <= (ARRIVED * orbit.scale()).max(10.0 * orbit.error)
}

/// Returns the class of a motion that the flow could not follow.
fn class_of(error: &MotionError) -> Classification {
    if error.is_unbounded() {
        Classification::Unbounded
    } else {
        Classification::Undecided
    }
}
