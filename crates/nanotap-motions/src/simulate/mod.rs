//! Simulation of a motion: the transient is discarded, the rest recorded, measured and classified.

pub mod fixed_step;
pub mod one_shot;

use nanotap_case::physical::Remark;
pub use nanotap_dynamics::ClassifyOptions;
use nanotap_dynamics::{
    LyapunovSpectrum, MotionKind, PeriodicOrbit, StroboscopicMap, Torus, classify,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::figure::motion::{fixed_step_figure, one_shot_figure, simulation_figure};
use crate::initial_state::initial_state_note;
use fixed_step::{FixedStepRun, fixed_step_run};
use nanotap_arithmetic::clock::Instant;
use nanotap_case::Case;
use nanotap_case::drive_signal::StatedSignal;
use nanotap_case::state::WrittenState;
use nanotap_case::units::Units;
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_model::model_map::ModelMap;
use nanotap_model::recording::Recording;
use nanotap_model::{Model, MotionError};
use nanotap_observe::PhysicalMotion;
use nanotap_observe::frame::Frame;
use nanotap_observe::model_limits::limits_of;
use nanotap_observe::time_series;
use nanotap_observe::{
    ContactEvent, ObservableSet, Observables, OutOfRange, RecordOptions, contact_table, record,
};
use nanotap_study::Study;
use nanotap_study::in_si::InSi;
use nanotap_study::limits::{MAX_PERIOD, MAX_PERIODS, MAX_SAMPLES, MAX_STATE_NUMBERS};
use nanotap_study::request::options;
use nanotap_study::value::Steps;
use one_shot::{OneShot, one_shot};

/// Class of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Classification {
    /// Converges to a stable periodic orbit, closed by Newton's method.
    Periodic,
    /// Quasi-periodic: the motion covers a torus and does not repeat.
    QuasiPeriodic,
    /// Chaotic during the whole run.
    Chaotic,
    /// Grows beyond every bound.
    Unbounded,
    /// Measured during a transient, as where the distance changes at a finite speed.
    Transient,
    /// Could not be assigned to a class.
    Undecided,
}

impl Classification {
    /// Returns the name in documents, such as `quasi-periodic`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Periodic => "periodic",
            Self::QuasiPeriodic => "quasi-periodic",
            Self::Chaotic => "chaotic",
            Self::Unbounded => "unbounded",
            Self::Transient => "transient",
            Self::Undecided => "undecided",
        }
    }
}

/// Result of a finished run of the exact flow.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Simulation {
    /// Number of drive periods recorded.
    pub periods: usize,
    /// Drive periods of the discarded transient.
    pub transient: usize,
    /// State at the end of the transient, where the recording starts, in the model's units. Its
    /// entries are a_1 … a_N (or x), their rates, then any memory of the sample.
    pub start: Vec<f64>,
    /// Class of the motion, followed on from the end of the transient.
    pub classification: Classification,
    /// Its minimal period in drive periods, if periodic.
    pub period: Option<usize>,
    /// Evidence for the class, in words.
    pub evidence: String,
    /// Lyapunov exponents per drive period, if they were measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lyapunov: Option<Vec<f64>>,
    /// Distance of the end of the recording from the orbit of a periodic motion, as a fraction of
    /// its size. The recording is the orbit itself only where this is of the order of rounding.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_to_orbit: Option<f64>,
    /// States at the end of each of the last requested periods.
    pub strobe: Vec<Vec<f64>>,
    /// Contacts begun and ended, up to a limit.
    pub events: Vec<ContactEvent>,
    /// Number of events that are not listed.
    #[serde(skip_serializing_if = "is_none")]
    pub events_left_out: usize,
    /// Observables of the recorded part.
    #[serde(flatten)]
    pub observables: Observables,
    /// Excursions beyond the range of a nonlinear force law.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub out_of_range: Vec<OutOfRange>,
    /// Speed of the propagation alone, drive periods per second.
    pub periods_per_second: f64,
    /// Evaluations of the gap a drive period; of the force under a nonlinear law.
    pub evaluations_per_period: f64,
    /// Which initial state was followed, and how to list the motions that others lead to.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// The stable orbit to which the motion converges, if periodic.
    #[serde(skip)]
    pub orbit: Option<PeriodicOrbit>,
    /// The first recorded periods, for figures and time series.
    #[serde(skip)]
    pub trajectory: Recording,
}

/// Events listed by default: their JSON stays below 10 MB.
const LISTED_EVENTS: usize = 50_000;

/// Whether a count may be left out of a document.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
pub(crate) const fn is_none(count: &usize) -> bool {
    *count == 0
}

/// Periods recorded for figures; bounds the memory of long runs.
const SHOWN: usize = 512;
/// Distance from a periodic orbit, as a fraction of its size, at which the transient ends.
const ARRIVED: f64 = 1e-11;

/// Runs `model`.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::simulate::{SimulateOptions, simulate};
///
/// let model = Case::from(Cantilever { omega: 3.0, ..Cantilever::paper() }).model()?;
/// let run = simulate(&model, &SimulateOptions::default())?;
/// assert_eq!(run.period, Some(1));
/// // What is recorded is the orbit itself.
/// assert!(run.distance_to_orbit.is_some_and(|distance| distance < 1e-10));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the state does not fit or the flow fails.
pub fn simulate(model: &Model, options: &SimulateOptions) -> Result<Simulation, Error> {
    let mut state = starting_state(model, options.state.as_ref())?;
    check_periods(options.periods)?;
    check_states(model, options.strobe.min(options.periods), "strobe")?;
    let how = options.classify();
    let mut map = ModelMap::new(model);
    let (transient, undecided) = if let Some(transient) = options.transient {
        map.advance_by(&mut state, transient)?;
        (transient, None)
    } else {
        measured_transient(&mut map, &mut state, &how)
    };
    let (periods_per_second, evaluations_per_period) = speed(model, &state, options.periods)?;
    let kept = RecordOptions {
        recorded: SHOWN,
        states: options.strobe,
        events: true,
        each_period: false,
    };
    let observed =
        OutOfRange::observed_with(model, options.observables.unwrap_or(ObservableSet::ALL));
    let mut record = record(model, &state, options.periods, observed, kept)?;
    let events_left_out = record.events.len().saturating_sub(options.events);
    record.events.truncate(options.events);
    let kind = undecided.unwrap_or_else(|| classify(&mut map, &state, &how).kind);
    let named = NamedMotion::of(&kind);
    Ok(Simulation {
        periods: options.periods,
        transient,
        start: state,
        classification: named.classification,
        period: named.orbit.as_ref().map(|o| o.period),
        evidence: named.evidence,
        lyapunov: named.spectrum.map(|s| s.exponents),
        distance_to_orbit: named
            .orbit
            .as_ref()
            .map(|orbit| orbit.nearest(&record.end).1 / orbit.scale()),
        strobe: record.states,
        events: record.events,
        events_left_out,
        out_of_range: OutOfRange::of(model, &record.observables),
        observables: record.observables,
        periods_per_second,
        evaluations_per_period,
        notes: Vec::new(),
        orbit: named.orbit,
        trajectory: record.recording,
    })
}

/// Refuses a run without a recorded period.
pub(crate) fn check_periods(periods: usize) -> Result<(), Error> {
    if periods == 0 {
        return Err(Error::input(
            "expected at least one recorded period, got 0",
            "give 1 or more {periods}",
        ));
    }
    Ok(())
}

/// Refuses to keep more states than fit into memory; `option` is the option that says how many.
pub(crate) fn check_states(
    model: &Model,
    states: usize,
    option: &'static str,
) -> Result<(), Error> {
    let dimension = model.dimension();
    let limit = MAX_STATE_NUMBERS / dimension;
    if states > limit {
        return Err(Error::input(
            format!("{states} states of {dimension} numbers are too many to keep; {limit} at most"),
            format!("give fewer {{{option}}}"),
        ));
    }
    Ok(())
}

/// The state to start from: as given, numbers in the model's units, or that of the model
/// ([`Model::start`]), or rest. A sample
/// with a memory is relaxed where the state does not say otherwise.
///
/// # Errors
/// When its length does not fit, a number is not finite, or it lies behind a rigid stop or a pole of
/// the force law.
pub fn starting_state(model: &Model, state: Option<&WrittenState>) -> Result<Vec<f64>, Error> {
    let refused = |message| Err(Error::input(message, "count the numbers of {state}"));
    let n = model.dimension();
    let Some(state) = state else {
        return Ok(model.first_state());
    };
    let read = state.read(model, &Units::Model);
    let mut state = read.map_err(|error| error.at("state"))?;
    if state.len() + model.memory == n {
        state.resize(n, 0.0);
    }
    if state.len() != n {
        let layout = if model.memory > 0 {
            "the modal amplitudes a_1 … a_N, then their rates, then (if not 0) the sample's memory"
        } else if model.beam.is_some() {
            "the modal amplitudes a_1 … a_N, then their rates"
        } else {
            "x, then its rate"
        };
        return refused(format!(
            "the state has {} numbers where {n} are needed: {layout}",
            state.len()
        ));
    }
    if let Some((k, &value)) = state.iter().enumerate().find(|(_, v)| !v.is_finite()) {
        return refused(format!(
            "number {} of the state is {value}; a finite number is needed",
            k + 1
        ));
    }
    if let Some(stop) = model.rigid_stop.map(|stop| stop.tip)
        && state[0] > stop + BEHIND_STOP * stop.abs().max(state[0].abs())
    {
        return Err(Error::input(
            format!(
                "the state's x = {} lies behind the rigid stop at {stop}",
                state[0]
            ),
            "give a {state} in front of the stop",
        ));
    }
    let pole = model.nonlinear.as_ref().and_then(|law| law.pole());
    if pole.is_some_and(|pole| !pole.is_before(&state)) {
        return Err(Error::input(
            "the state's tip lies in the surface, where the force law has a pole and does not hold",
            "give a {state} in front of the surface",
        ));
    }
    Ok(state)
}

/// Part of a displacement by which a state counts as behind a rigid stop.
const BEHIND_STOP: f64 = 1e-9;

/// Runs until the motion has been named. If it goes to a periodic orbit, the state becomes
/// the orbit's own and the rest of the decay, which the multipliers tell, counts as waited
/// for: near a multiplier of modulus one it takes longer than anyone would run. A motion that is
/// undecided remains so, whatever a run from its last state would show: the second value.
fn measured_transient(
    map: &mut ModelMap,
    state: &mut [f64],
    options: &ClassifyOptions,
) -> (usize, Option<MotionKind>) {
    let classified = classify(map, state, options);
    state.copy_from_slice(&classified.state);
    let orbit = match classified.kind {
        MotionKind::Periodic(orbit) | MotionKind::TransientChaos { orbit, .. } => orbit,
        kind @ MotionKind::Undecided { .. } => return (classified.periods, Some(kind)),
        _ => return (classified.periods, None),
    };
    let (nearest, distance) = orbit.nearest(&classified.state);
    let near = (ARRIVED * orbit.scale()).max(10.0 * orbit.error);
    let decay = -nanotap_arithmetic::ln(orbit.spectral_radius());
    let rest = (nanotap_arithmetic::ln(distance / near) / decay)
        .ceil()
        .max(0.0) as usize;
    if !nearest.is_empty() {
        state.copy_from_slice(nearest);
    }
    (
        classified.periods + rest.next_multiple_of(orbit.period),
        None,
    )
}

/// Measures the speed of the propagation alone, in drive periods per second, and the evaluations of
/// gap or force per period, over the first periods: a long run does not become longer by them.
fn speed(model: &Model, state: &[f64], periods: usize) -> Result<(f64, f64), MotionError> {
    let periods = periods.min(SHOWN);
    let mut map = ModelMap::new(model);
    let mut state = state.to_vec();
    let clock = Instant::now();
    map.advance_by(&mut state, periods)?;
    let seconds = clock.elapsed().as_secs_f64().max(1e-9);
    let evaluations = map.evaluations() as f64;
    Ok((periods as f64 / seconds, evaluations / periods as f64))
}

/// The largest exponent in words.
pub(crate) fn largest_exponent(spectrum: &LyapunovSpectrum) -> String {
    let (value, error) = spectrum.largest();
    // Near zero the digits after the point would say nothing.
    let shown = if value.abs() < 1e-3 {
        format!("{value:.1e} ± {error:.0e}")
    } else {
        format!("{value:.4} ± {error:.4}")
    };
    format!(
        "largest exponent {shown} per period over {} periods",
        spectrum.periods
    )
}

/// Why a motion is periodic, in words.
pub(crate) fn orbit_evidence(orbit: &PeriodicOrbit) -> String {
    if orbit.is_superstable() {
        return format!(
            "the motion sticks to the stop, and one known motion follows every stick: the period-{} orbit \
             is superstable, its multipliers are 0 and its Lyapunov exponents −∞",
            orbit.period
        );
    }
    let largest = orbit.spectral_radius();
    // Six digits would hide on which side of 1 it is.
    let largest = match 1.0 - largest {
        inside if (0.0..5e-6).contains(&inside) => format!("1 − {inside:.1e}"),
        _ => format!("{largest:.6}"),
    };
    format!(
        "Newton closed a period-{} orbit (residual {:.1e}); largest |multiplier| {largest}",
        orbit.period, orbit.residual,
    )
}

/// Why a motion is quasi-periodic, in words.
pub(crate) fn torus_evidence(torus: &Torus) -> String {
    format!(
        "{}; Birkhoff averages agree to {:.1} digits; nearest return {:.1e}",
        largest_exponent(&torus.spectrum),
        torus.birkhoff_digits,
        torus.nearest_return
    )
}

/// A verdict in the words of the output.
#[derive(Clone, Debug)]
pub struct NamedMotion {
    /// Class of the motion.
    pub classification: Classification,
    /// The orbit, if it is periodic.
    pub orbit: Option<PeriodicOrbit>,
    /// Exponents, if they were measured.
    pub spectrum: Option<LyapunovSpectrum>,
    /// Evidence for the class, in words.
    pub evidence: String,
}

impl NamedMotion {
    /// Translates a verdict into class, orbit, exponents and evidence.
    pub fn of(verdict: &MotionKind) -> Self {
        let (exponent, periodic) = (largest_exponent, orbit_evidence);
        let (classification, orbit, spectrum, evidence) = match verdict {
            MotionKind::Periodic(orbit) => {
                (Classification::Periodic, Some(orbit), None, periodic(orbit))
            }
            MotionKind::TransientChaos {
                orbit,
                spectrum,
                lasted,
            } => (
                Classification::Periodic,
                Some(orbit),
                Some(spectrum),
                format!(
                    "chaotic for about {lasted} periods ({}), then: {}",
                    exponent(spectrum),
                    periodic(orbit)
                ),
            ),
            MotionKind::QuasiPeriodic(torus) => (
                Classification::QuasiPeriodic,
                None,
                Some(&torus.spectrum),
                torus_evidence(torus),
            ),
            MotionKind::Chaotic(chaos) => (
                Classification::Chaotic,
                None,
                Some(&chaos.spectrum),
                format!(
                    "{}; no escape in {} periods of this one run (mean lifetime above {:.0} at 95 %)",
                    exponent(&chaos.spectrum),
                    chaos.observed,
                    chaos.lifetime_above
                ),
            ),
            MotionKind::Unbounded => (
                Classification::Unbounded,
                None,
                None,
                "the motion left every bound".to_owned(),
            ),
            MotionKind::Undecided { reason, spectrum } => (
                Classification::Undecided,
                None,
                spectrum.as_ref(),
                reason.to_string(),
            ),
        };
        Self {
            classification,
            orbit: orbit.cloned(),
            spectrum: spectrum.cloned(),
            evidence,
        }
    }
}

/// How a motion is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The exact flow: no time step, no contact missed
    #[default]
    Exact,
    /// The paper's method, to compare: Runge–Kutta steps that switch on their grid
    Rk4,
}

/// Where Runge–Kutta steps look at the regime.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Grid {
    /// Once a step
    #[default]
    Step,
    /// At every stage of a step
    Stage,
}

options! {
    /// Options of one run.
    pub struct SimulateOptions {
        /// Number of recorded drive periods
        #[schemars(range(min = 1, max = MAX_RECORDED), extend("x-value" = "P"))]
        pub periods: usize = 50,
        /// Drive periods of the discarded transient; default: until the motion has settled; 0: none
        #[schemars(range(min = 0, max = MAX_PERIODS), extend("x-value" = "T"))]
        pub transient: Option<usize> = None,
        /// Initial state at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v), or some by name, as in
        /// tip=5nm; of a physical case in m and m/s, or with units; default: rest
        #[schemars(extend("x-value" = "STATE"))]
        pub state: Option<WrittenState> = None,
        /// Number of last states at drive phase 0 to keep
        #[schemars(range(min = 0, max = MAX_LISTED), extend("x-value" = "K"))]
        pub strobe: usize = 1,
        /// Maximum number of listed contacts and releases
        #[schemars(range(min = 0, max = MAX_LISTED), extend("x-value" = "K"))]
        pub events: usize = LISTED_EVENTS,
        /// Longest period of orbits, in drive periods
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub max_period: usize = ClassifyOptions::default().max_period,
        /// Observables to measure; default: all, including the clearance of the beam
        #[schemars(extend("x-value" = "NAME,…"))]
        pub observables: Option<ObservableSet> = None,
        /// Samples per drive period in the time series
        #[schemars(range(min = 1, max = MAX_SAMPLES), extend("x-value" = "S"))]
        pub resolution: usize = 200,
        /// Method of computation
        pub method: Method = Method::default(),
        /// For rk4: steps per drive period, in free flight and (after a comma) in contact
        #[schemars(extend("x-value" = "FREE,CONTACT"))]
        pub steps: Steps = Steps::default(),
        /// For rk4: where within a step the regime is checked
        pub switching: Grid = Grid::default(),
        /// Signal of one shot in place of the periodic drive: "pulse 5us", "chirp 60kHz 90kHz 5ms",
        /// "sinc 200kHz 1ms times 40", or a file with the columns time and drive; its 1 is the case's
        /// drive. Then `periods` counts those after its end
        #[schemars(extend("x-value" = "SIGNAL"))]
        pub drive_signal: Option<StatedSignal> = None,
    }
}

/// Most drive periods recorded: their events fill some hundred megabytes.
pub const MAX_RECORDED: usize = 2_000_000;
/// Most events, and states at drive phase 0, that are listed.
const MAX_LISTED: usize = 1_000_000;

impl SimulateOptions {
    /// Budgets for naming the motion.
    fn classify(&self) -> ClassifyOptions {
        ClassifyOptions {
            max_period: self.max_period,
            ..ClassifyOptions::default()
        }
    }
}

/// Result of a simulation by one of the two methods.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum SimulateReport {
    /// Result of the exact flow, for a physical case also in SI.
    Exact(Box<InSi<Simulation>>),
    /// Result of fixed time steps, in the model's units.
    FixedStep(Box<FixedStepRun>),
    /// Result under a signal of one shot, for a physical case also in SI.
    OneShot(Box<InSi<OneShot>>),
}

impl SimulateReport {
    /// Calls `row` for `resolution` equidistant instants in each of the first `periods` drive periods, as
    /// [`time_series::sample`] does; under a signal of one shot, in all. Fixed time steps have their own
    /// grid, and no row.
    ///
    /// # Errors
    /// If there would be too many rows, or the flow fails.
    pub fn sample(
        &self,
        case: &Case,
        options: &SimulateOptions,
        periods: usize,
        row: &mut dyn FnMut(&[f64]),
    ) -> Result<(), Error> {
        match self {
            Self::FixedStep(_) => {}
            Self::Exact(run) => {
                let (start, periods) = (&run.motion.start, periods.min(run.motion.periods));
                time_series::sample(&case.model()?, start, periods, options.resolution, row)?;
            }
            Self::OneShot(run) => {
                if let Some(read) = options.signal(case)? {
                    let start = &run.motion.start;
                    one_shot::sample(case, &read, start, options.resolution, row)?;
                }
            }
        }
        Ok(())
    }
}

/// Study that simulates one motion and classifies it.
#[derive(Clone, Copy, Debug)]
pub struct SimulateStudy;

impl Study for SimulateStudy {
    const NAME: &'static str = "simulate";
    const ABOUT: &'static str = "Simulate a motion: its steady state or its transient";
    type Options = SimulateOptions;
    type Report = SimulateReport;

    const COUNTED: &'static str = "pieces of the signal";

    /// The grid of a run with fixed steps. The exact motion is a function of time: `--out` and Python
    /// sample it as finely as asked.
    fn frames<'a>(case: &Case, report: &'a SimulateReport) -> Vec<Frame<'a>> {
        match report {
            SimulateReport::Exact(run) => vec![contact_table(&run.motion.events, case.units())],
            SimulateReport::OneShot(run) => vec![contact_table(&run.motion.events, case.units())],
            SimulateReport::FixedStep(run) => vec![run.curve_table(case.units())],
        }
    }

    fn figure(case: &Case, report: &SimulateReport) -> Option<Figure> {
        let (model, units) = (case.model().ok()?, case.units());
        Some(match report {
            SimulateReport::Exact(run) => simulation_figure(&model, &run.motion, &units),
            SimulateReport::FixedStep(run) => fixed_step_figure(&model, run, &units),
            SimulateReport::OneShot(run) => one_shot_figure(&run.motion, &units),
        })
    }

    fn remarks(_: &Case, report: &SimulateReport) -> Vec<Remark> {
        match report {
            SimulateReport::Exact(run) => {
                let (motion, physical) = (&run.motion, run.physical.as_ref());
                let mut remarks = limits_of(&motion.observables, physical, &motion.out_of_range);
                remarks.extend(Remark::notes(&motion.notes));
                remarks
            }
            SimulateReport::OneShot(run) => {
                let (motion, physical) = (&run.motion, run.physical.as_ref());
                limits_of(&motion.observables, physical, &motion.out_of_range)
            }
            SimulateReport::FixedStep(run) => {
                let mut remarks = Remark::notes(&run.notes);
                remarks.push(Remark::warning(
                    "rk4 is the paper's method, kept to show the effect of a time step; its results are not \
                     certified",
                ));
                remarks
            }
        }
    }

    fn compute(
        case: &Case,
        options: &SimulateOptions,
        control: &Control<'_>,
    ) -> Result<SimulateReport, Error> {
        let options = &SimulateOptions {
            state: case.state_of(options.state.as_ref())?,
            ..options.clone()
        };
        if let Some(read) = options.signal(case)? {
            let motion = one_shot(case, &read, options, control)?;
            let resolved = case.physical();
            let physical = resolved.map(|of| PhysicalMotion::alone(&motion.observables, None, of));
            return Ok(SimulateReport::OneShot(Box::new(InSi { motion, physical })));
        }
        let model = case.model()?;
        let given = options.state.is_some();
        if options.method == Method::Rk4 {
            let mut run = fixed_step_run(&model, options)?;
            run.notes.push(initial_state_note(&model, given, None));
            return Ok(SimulateReport::FixedStep(Box::new(run)));
        }
        let mut motion = simulate(&model, options)?;
        let found = motion.orbit.as_ref().map(|orbit| &*orbit.states[0]);
        let note = initial_state_note(&model, given, found);
        motion.notes.push(note);
        let physical = case.physical().map(|resolved| {
            PhysicalMotion::alone(&motion.observables, None, resolved)
                .with_strobe(&motion.strobe, resolved)
        });
        Ok(SimulateReport::Exact(Box::new(InSi { motion, physical })))
    }
}
