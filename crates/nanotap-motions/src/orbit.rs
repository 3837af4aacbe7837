//! Periodic orbits by Newton's method, with stability and observables.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_case::physical::Remark;
use std::collections::BTreeMap;

use nalgebra::DVector;
use nanotap_dynamics::{
    ClassifyOptions, Complex, Control, MotionKind, OrbitSearch, PeriodicOrbit, Scheduling as _,
    ShootingOptions, Stability, StroboscopicMap as _, check_size, classify, close_orbit,
    close_orbit_from_points, find_orbits,
};
use nanotap_figures::Figure;
use nanotap_flow::Trajectory;
use schemars::JsonSchema;
use serde::Serialize;

use crate::approach::SETPOINT_PERIODS;
use crate::figure::motion::orbit_figure;
use crate::initial_state::initial_state_note;
use crate::proof::{ProofReport, Prover};
use crate::simulate::{NamedMotion, starting_state};
use crate::upset::{Knocks, upset};
use nanotap_case::Case;
use nanotap_case::state::WrittenState;
use nanotap_case::units::Units;
use nanotap_error::Error;
use nanotap_model::model_map::ModelMap;
use nanotap_model::recording::{NonlinearRecording, Recording};
use nanotap_model::{MemoryReset, Model};
use nanotap_observe::PhysicalMotion;
use nanotap_observe::frame::{FileUnit, Frame, Rows, frame};
use nanotap_observe::model_limits::limits_of;
use nanotap_observe::{
    ContactEvent, Derivative, Dimension, ObservableSet, Observables, OutOfRange, RecordOptions,
    Recorder, Spectrum,
};
use nanotap_study::Study;
use nanotap_study::in_si::InSi;
use nanotap_study::limits::{MAX_PERIOD, MAX_SAMPLES};
use nanotap_study::request::options;
use nanotap_study::start_box::default_box;

/// A periodic orbit with its stability and observables.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct OrbitReport {
    /// Minimal period in drive periods.
    pub period: usize,
    /// State at drive phase 0, in the model's units. Its entries are a_1 … a_N (or x), their rates,
    /// then any memory of the sample.
    pub state: Vec<f64>,
    /// States at drive phase 0 of all its periods.
    pub states: Vec<Vec<f64>>,
    /// Largest entry of P(x_k) − x_{k+1} over the states of the orbit, in the model's units.
    pub residual: f64,
    /// Estimated distance of the states from the exact orbit (largest entry), in the model's units.
    pub error: f64,
    /// Floquet multipliers, real and imaginary part, largest modulus first.
    pub multipliers: Vec<[f64; 2]>,
    /// Whether every multiplier is inside the unit circle, or the orbit is proved to be stable.
    pub stable: bool,
    /// Drive periods in which a small disturbance of a stable orbit falls to 1/e, by the largest
    /// multiplier.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decay_periods: Option<f64>,
    /// Stability by the multipliers, or as it is proved: stable, unstable or marginal; undecided
    /// where the multipliers contradict the trace formula.
    pub stability: &'static str,
    /// |log|det DPⁿ| − trace formula|, dimensionless: zero to rounding of an exact Jacobian, and
    /// without meaning where the smallest multiplier is lost in rounding. Where the memory of a
    /// sample is reset at the end of each contact, the determinant is zero, and the product of the
    /// other multipliers is used.
    pub determinant_defect: f64,
    /// Beginnings and ends of contact during one repetition of the orbit.
    pub events: Vec<ContactEvent>,
    /// Observables in the model's units.
    #[serde(flatten)]
    pub observables: Observables,
    /// Harmonics, distortion and phase of the tip deflection.
    #[serde(flatten)]
    pub spectrum: Spectrum,
    /// Derivatives by the requested keys.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub derivatives: BTreeMap<&'static str, Derivative>,
    /// Excursions beyond the range of a nonlinear force law.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub out_of_range: Vec<OutOfRange>,
    /// The smallest knock found on the tip that upsets it, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upset: Option<Knocks>,
    /// Result of the proof by interval arithmetic, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proof: Option<ProofReport>,
    /// Which initial state was followed, and how to list the motions that others lead to.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Recording of one repetition of the orbit, for figures.
    #[serde(skip)]
    pub trajectory: Recording,
}

/// The harmonics of an orbit as a table, for the drive frequency `omega` in the model's units.
pub fn harmonic_table(spectrum: &Spectrum, omega: f64, units: Units) -> Frame<'_> {
    let mut unknown = Vec::new();
    if units == Units::Model {
        unknown.push("frequency");
    }
    let is_known = match &units {
        Units::Model => true,
        Units::Si(scales) => Dimension::Slope.si(scales).is_some(),
    };
    if !is_known || spectrum.harmonics.iter().all(|h| h.slope.is_none()) {
        unknown.push("slope");
    }
    let bare: FileUnit = (|number| number, "");
    frame! { Rows::new("harmonics", &spectrum.harmonics, Some(units));
        "order", "order", Digits(5) => |h| h.order;
        "frequency", "frequency", (Frequency, Digits(5)) => move |h| h.order * omega;
        "tip", "tip", (Length, Digits(5)) => |h| h.tip;
        "tip_lag_degrees", "lag", (Angle, Digits(5)) => |h| h.tip_phase; .in_files(bare);
        "force", "force", (Force, Digits(5)) => |h| h.force;
        "force_lag_degrees", "lag", (Angle, Digits(5)) => |h| h.force_phase; .in_files(bare);
        "slope", "slope", (Slope, Digits(5)) => |h| h.slope; .in_files(bare);
        .without(&unknown);
    }
}

impl OrbitReport {
    /// Tries to prove it. A proved stability replaces what the multipliers
    /// leave open next to the unit circle.
    pub fn prove(&mut self, prover: &Prover) {
        let proof = prover.report(&self.trajectory, self.period);
        if let Some(decided) = proof.theorem.as_ref().map(|theorem| theorem.stability)
            && decided != "undecided"
        {
            self.stability = decided;
            self.stable = decided == "stable";
        }
        self.proof = Some(proof);
    }
}

/// The largest modulus of a report's multipliers; 0 of none.
pub fn spectral_radius(multipliers: &[[f64; 2]]) -> f64 {
    let moduli = multipliers
        .iter()
        .map(|[re, im]| nanotap_arithmetic::hypot(*re, *im));
    moduli.fold(0.0, f64::max)
}

/// Drive periods in which a small disturbance of an orbit falls to 1/e; `None` where it does not.
fn decay_periods(multipliers: &[[f64; 2]], period: usize) -> Option<f64> {
    let radius = spectral_radius(multipliers);
    (radius > 0.0 && radius < 1.0).then(|| -(period as f64) / nanotap_arithmetic::ln(radius))
}

/// Most harmonics of the drive frequency that are reported.
pub const MAX_HARMONICS: usize = 100_000;

/// Finds a periodic orbit of `model`.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::orbit::{OrbitOptions, orbit, spectral_radius};
///
/// let model = Case::from(Cantilever { omega: 20.0, ..Cantilever::paper() }).model()?;
/// let found = orbit(&model, &OrbitOptions::default())?;
/// assert!(found.period == 1 && found.stable);
/// // The largest multiplier, as `nanotap orbit` prints it.
/// assert!((spectral_radius(&found.multipliers) - 0.978321).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When no orbit is found, with the reason.
pub fn orbit(model: &Model, options: &OrbitOptions) -> Result<OrbitReport, Error> {
    if options.period == Some(0) {
        return Err(no_period());
    }
    if options.harmonics > MAX_HARMONICS {
        return Err(Error::input(
            format!(
                "{} harmonics are too many; {MAX_HARMONICS} at most",
                options.harmonics
            ),
            "give fewer {harmonics}",
        ));
    }
    check_size(model.dimension(), options.period.unwrap_or(1))?;
    let start = starting_state(model, options.state.as_ref())?;
    let mut map = ModelMap::new(model);
    let found = match (options.period, &options.state) {
        (Some(period), Some(_)) => {
            close_orbit(&mut map, &start, period, &ShootingOptions::default())?
        }
        (period, state) => {
            let own = state
                .is_none()
                .then(|| at_setpoint(model, &mut map, &start));
            let own = own.flatten();
            match own.filter(|orbit| period.is_none_or(|p| p % orbit.period == 0)) {
                Some(orbit) => orbit,
                None => settled(model, &mut map, &start, period)?,
            }
        }
    };
    let observables = options.observables.unwrap_or(ObservableSet::ALL);
    report_on(model, &found, options.harmonics, observables)
}

/// The error of a period of 0.
pub fn no_period() -> Error {
    Error::input(
        "a period of at least 1 is needed, 0 was given",
        "give {period} 1 or more",
    )
}

/// The orbit of a setpoint, on which its motion starts: in a run its approach would be nothing but
/// rounding, and one that is unstable without the feedback would be left.
fn at_setpoint(model: &Model, map: &mut ModelMap, start: &[f64]) -> Option<PeriodicOrbit> {
    model.start.as_ref()?;
    let mut state = start.to_vec();
    (1..=SETPOINT_PERIODS).find_map(|period| {
        map.advance(&mut state).ok()?;
        let size = start.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let back = state
            .iter()
            .zip(start)
            .all(|(x, y)| (x - y).abs() <= ON_ORBIT * size);
        let orbit = back.then(|| close_orbit(map, start, period, &ShootingOptions::default()));
        let near = |orbit: &PeriodicOrbit| orbit.nearest(start).1 <= ON_ORBIT * orbit.scale();
        orbit?.ok().filter(near)
    })
}

/// Distance from an orbit, as a fraction of its size, within which a state counts as on it.
const ON_ORBIT: f64 = 1e-6;

/// Finds the orbit to which a run from `start` converges, or one of the requested period: near the
/// end of the run, or else anywhere.
fn settled(
    model: &Model,
    map: &mut ModelMap,
    start: &[f64],
    period: Option<usize>,
) -> Result<PeriodicOrbit, Error> {
    let slow = model.nonlinear.as_ref().filter(|law| law.is_slow());
    if let Some(Ok(guess)) = slow.map(|law| law.settled_from(start))
        && let Ok(orbit) = close_orbit(map, &guess, 1, &ShootingOptions::default())
        && !matches!(orbit.stability, Stability::Unstable { .. })
        && period.is_none_or(|p| p % orbit.period == 0)
    {
        return Ok(orbit);
    }
    let end = classify(map, start, &ClassifyOptions::default());
    if let MotionKind::Periodic(orbit) | MotionKind::TransientChaos { orbit, .. } = &end.kind
        && period.is_none_or(|p| p % orbit.period == 0)
    {
        return Ok(orbit.clone());
    }
    match period {
        None => Err(Error::numerics(format!(
            "the run from this start is not periodic ({})",
            NamedMotion::of(&end.kind).evidence
        ))
        .remedy("give the {period} of an orbit to look for")),
        Some(period) => near_recurrence(map, &end.state, period)
            .ok()
            .filter(|orbit| orbit.period == period)
            .map_or_else(|| searched(model, map, period), Ok),
    }
}

/// Starts in the default box from which Newton is tried; a quarter of them where a period is costly.
const SEARCHED_STARTS: usize = 64;
/// Periods run from each of them in search of near returns.
const SEARCHED_PERIODS: usize = 256;

/// An orbit of just this period, the least unstable one that Newton finds from starts all
/// over the default box; failing that, what it finds from where the run ended.
fn searched(model: &Model, map: &mut ModelMap, period: usize) -> Result<PeriodicOrbit, Error> {
    let count = SEARCHED_STARTS / if map.is_costly() { 4 } else { 1 };
    let starts = default_box(model)
        .map(|b| b.starts(1, count))
        .unwrap_or_default();
    let search = OrbitSearch {
        max_period: period,
        run: SEARCHED_PERIODS.max(8 * period),
        ..OrbitSearch::default()
    };
    let control = Control {
        cancel: Some(model.system.cancel()),
        progress: None,
    };
    let found = find_orbits(map, &starts, &search, &control);
    found
        .into_iter()
        .find(|orbit| orbit.period == period)
        .ok_or_else(|| {
            Error::numerics(format!(
                "no orbit of period {period} was found, neither near the motion nor from starts \
                 all over the box of states"
            ))
            .remedy("give a {state} near one")
        })
}

/// States looked at for a near return.
const RECURRENCE_PERIODS: usize = 2000;
/// Near returns given to Newton.
const RECURRENCE_TRIES: usize = 12;

/// Closes an orbit of the given period from the nearest returns of a motion that does not repeat.
fn near_recurrence(
    map: &mut ModelMap,
    state: &[f64],
    period: usize,
) -> Result<PeriodicOrbit, Error> {
    let shooting = ShootingOptions::default();
    let mut states = vec![state.to_vec()];
    for k in 0..RECURRENCE_PERIODS + period {
        let mut next = states[k].clone();
        map.advance(&mut next)?;
        states.push(next);
    }
    let distance =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    let mut order: Vec<usize> = (0..RECURRENCE_PERIODS).collect();
    order.sort_by(|&a, &b| {
        distance(&states[a], &states[a + period])
            .total_cmp(&distance(&states[b], &states[b + period]))
    });
    let mut last = None;
    let mut smaller = None;
    for &k in order.iter().take(RECURRENCE_TRIES) {
        let points: Vec<f64> = states[k..k + period].concat();
        match close_orbit_from_points(map, &points, period, &shooting) {
            Ok(orbit) if orbit.period == period => return Ok(orbit),
            Ok(orbit) => smaller = Some(orbit),
            Err(error) => last = Some(error),
        }
    }
    match (smaller, last) {
        (Some(orbit), _) => Ok(orbit),
        (None, Some(error)) => Err(error.into()),
        (None, None) => Err(no_period()),
    }
}

/// Everything about a closed orbit of `model`.
///
/// # Errors
/// When the flow along it fails.
pub fn report(
    model: &Model,
    orbit: &PeriodicOrbit,
    harmonics: usize,
) -> Result<OrbitReport, Error> {
    report_on(model, orbit, harmonics, ObservableSet::ALL)
}

fn report_on(
    model: &Model,
    orbit: &PeriodicOrbit,
    harmonics: usize,
    observables: ObservableSet,
) -> Result<OrbitReport, Error> {
    let start = orbit.states.first().cloned().unwrap_or_default();
    let kept = RecordOptions {
        recorded: orbit.period,
        events: true,
        ..RecordOptions::default()
    };
    let observed = OutOfRange::observed_with(model, observables);
    let seen = Recorder::new(model, observed)?.record_orbit(orbit, 0, kept)?;
    let determinant_defect = match &seen.recording {
        Recording::PiecewiseLinear(trajectory) => determinant_defect(model, orbit, trajectory),
        Recording::Nonlinear(recording) => nonlinear_defect(orbit, recording),
    };
    let agrees = determinant_defect <= allowed_defect(orbit);
    let stability = orbit.known_stability();
    Ok(OrbitReport {
        period: orbit.period,
        state: start,
        states: orbit.states.clone(),
        residual: orbit.residual,
        error: orbit.error,
        decay_periods: decay_periods(&pairs(&orbit.multipliers), orbit.period),
        multipliers: pairs(&orbit.multipliers),
        stable: agrees && stability == Stability::Stable,
        stability: if agrees {
            stability.name()
        } else {
            "undecided"
        },
        determinant_defect,
        events: seen.events,
        spectrum: Spectrum::of(model, &seen.recording, orbit.period, harmonics),
        out_of_range: OutOfRange::of(model, &seen.observables),
        observables: seen.observables,
        derivatives: BTreeMap::new(),
        upset: None,
        proof: None,
        notes: Vec::new(),
        trajectory: seen.recording,
    })
}

/// The largest disagreement of multipliers and trace formula that is called agreement.
pub const MAX_DETERMINANT_DEFECT: f64 = 1e-8;
/// A bound of what rounding leaves in a multiplier.
const MULTIPLIER_ROUNDING: f64 = 1e-11;

/// Returns the allowed difference of the multipliers from the trace formula: rounding matters most
/// in the smallest multiplier that is not zero.
fn allowed_defect(orbit: &PeriodicOrbit) -> f64 {
    let moduli = orbit.multipliers.iter().map(|m| m.modulus());
    let smallest = moduli.filter(|m| *m > 0.0).fold(1.0, f64::min);
    MAX_DETERMINANT_DEFECT.max(MULTIPLIER_ROUNDING / smallest)
}

/// Multipliers as reports list them.
pub(super) fn pairs(multipliers: &[Complex<f64>]) -> Vec<[f64; 2]> {
    multipliers.iter().map(|m| [m.re, m.im]).collect()
}

/// Returns the difference of the multipliers of an orbit under a nonlinear force from Liouville's
/// formula; a law's memory has the multiplier zero.
fn nonlinear_defect(orbit: &PeriodicOrbit, recording: &NonlinearRecording) -> f64 {
    let nonlinear = recording.nonlinear();
    let periods = recording.periods().iter();
    let expected: f64 = periods
        .map(|period| nonlinear.log_determinant(period))
        .sum();
    let found = if nonlinear.remembers {
        let kept = &orbit.multipliers[..orbit.multipliers.len().saturating_sub(1)];
        kept.iter()
            .map(|m| nanotap_arithmetic::ln(m.modulus()))
            .sum()
    } else {
        orbit.log_determinant
    };
    (found - expected).abs()
}

/// Returns the difference of the multipliers from Liouville's formula.
fn determinant_defect(model: &Model, orbit: &PeriodicOrbit, trajectory: &Trajectory) -> f64 {
    let expected = log_determinant(model, trajectory);
    match &model.memory_reset {
        Some(memory_reset) if !trajectory.events().is_empty() => {
            // One direction is lost, and its multiplier is zero.
            let kept = &orbit.multipliers[..orbit.multipliers.len().saturating_sub(1)];
            let found: f64 = kept
                .iter()
                .map(|m| nanotap_arithmetic::ln(m.modulus()))
                .sum();
            (found - expected - log_remembered(model, memory_reset, trajectory)).abs()
        }
        // Both vanish where the motion sticks.
        _ if orbit.log_determinant == expected => 0.0,
        _ => (orbit.log_determinant - expected).abs(),
    }
}

/// Returns what a memory that is reset at the end of each contact adds to log|det| of the rest.
///
/// With S the saltation where contact begins, Φ the flow of a flight of length t and p the
/// tip's row, a contact, a flight and the next contact's beginning map the beam's state by
/// S Φ + κ e^{rt} pᵀ, κ the kick per change of memory. By the lemma on determinants its
/// determinant is that of S Φ times 1 + e^{rt} pᵀ Φ⁻¹ κ, since S⁻¹κ = κ.
fn log_remembered(model: &Model, memory_reset: &MemoryReset, trajectory: &Trajectory) -> f64 {
    let flight = &model.system.regimes()[0];
    let basis = flight.basis();
    let tip = &model.height.row;
    let back = |length: f64| {
        if !basis.clusters.is_empty() {
            return nanotap_arithmetic::matrix_exp(&(flight.matrix() * -length))
                * &memory_reset.kick;
        }
        let kicked = &basis.left * memory_reset.kick.map(|v| Complex::new(v, 0.0));
        let turned = kicked.zip_map(
            &DVector::from_column_slice(&basis.eigenvalues),
            |q, rate| q * (rate * -length).exponential(),
        );
        (&basis.right * turned).map(|z| z.re)
    };
    let factor = |length: f64| {
        1.0 + nanotap_arithmetic::exp(memory_reset.rate * length) * (tip * back(length))[0]
    };
    flights(model, trajectory)
        .map(|length| nanotap_arithmetic::ln(factor(length).abs()))
        .sum()
}

/// Lengths of the flights between contacts of one repetition of an orbit.
fn flights(model: &Model, trajectory: &Trajectory) -> impl Iterator<Item = f64> {
    let begins: Vec<f64> = trajectory
        .events()
        .iter()
        .filter(|e| model.contact[e.to])
        .map(|e| e.time)
        .collect();
    let (end, whole) = (trajectory.end(), begins.len());
    trajectory
        .events()
        .iter()
        .filter(|e| !model.contact[e.to])
        .map(move |e| {
            let next = begins.iter().copied().find(|t| *t > e.time);
            let around = || begins.first().map_or(end, |t| t + end);
            (next.unwrap_or_else(around) - e.time) * f64::from(u8::from(whole > 0))
        })
        .collect::<Vec<_>>()
        .into_iter()
}

/// log|det DPⁿ| of an orbit from the trace of the equations, integrated along it, and its switches;
/// `None` where a memory of the sample is reset, whose multiplier is zero.
///
/// # Errors
/// When the flow along it fails.
pub(crate) fn log_determinant_by_trace(
    model: &Model,
    orbit: &PeriodicOrbit,
) -> Result<Option<f64>, Error> {
    let kept = RecordOptions {
        recorded: orbit.period,
        ..RecordOptions::default()
    };
    let recorder = Recorder::new(model, ObservableSet::COMMON)?;
    Ok(match recorder.record_orbit(orbit, 0, kept)?.recording {
        Recording::PiecewiseLinear(trajectory) => model
            .memory_reset
            .is_none()
            .then(|| log_determinant(model, &trajectory)),
        Recording::Nonlinear(recording) => {
            let nonlinear = recording.nonlinear();
            let periods = recording.periods().iter();
            let sum = periods
                .map(|period| nonlinear.log_determinant(period))
                .sum();
            (!nonlinear.remembers).then_some(sum)
        }
    })
}

/// log|det DPⁿ| from Liouville's formula: every impact has determinant ±(product of the
/// resets), every other switch that of its saltation, every segment e^{tr A · length}.
fn log_determinant(model: &Model, trajectory: &Trajectory) -> f64 {
    let mut segments = trajectory.segments().iter();
    if segments.any(|s| model.system.sticks(s.regime)) {
        return f64::NEG_INFINITY;
    }
    // A memory that is forgotten is left out, and its jump with it.
    let forgets = model.memory_reset.as_ref();
    let forgotten = match forgets {
        Some(f) if !trajectory.events().is_empty() => f.rate * trajectory.end(),
        _ => 0.0,
    };
    let flow: f64 = trajectory
        .segments()
        .iter()
        .map(|s| model.system.regimes()[s.regime].matrix().trace() * s.length)
        .sum::<f64>()
        - forgotten;
    // A rigid impact's saltation has determinant r² (the reset once, the change of
    // time of flight once).
    let impacts: f64 = trajectory
        .events()
        .iter()
        .filter_map(|e| {
            let transition = model.system.transitions()[e.from]
                .iter()
                .find(|x| x.target == e.to)?;
            let Some(reset) = &transition.reset else {
                return Some(e.log_determinant.unwrap_or(f64::NAN));
            };
            let impact = || 2.0 * nanotap_arithmetic::ln(reset.matrix.determinant().abs());
            forgets.is_none().then(impact)
        })
        .sum();
    flow + impacts
}

options! {
    /// Options of a periodic orbit.
    pub struct OrbitOptions {
        /// Period in drive periods; default: that of the motion to which a run converges
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub period: Option<usize> = None,
        /// State near the orbit, at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v), or some by name, as in
        /// tip=5nm; of a physical case in m and m/s, or with units
        #[schemars(extend("x-value" = "STATE"))]
        pub state: Option<WrittenState> = None,
        /// Number of reported harmonics of the drive frequency
        #[schemars(range(min = 0, max = MAX_HARMONICS), extend("x-value" = "H"))]
        pub harmonics: usize = 20,
        /// Observables to measure; default: all, including the clearance of the beam
        #[schemars(extend("x-value" = "NAME,…"))]
        pub observables: Option<ObservableSet> = None,
        /// Samples per drive period in the time series
        #[schemars(range(min = 1, max = MAX_SAMPLES), extend("x-value" = "S"))]
        pub resolution: usize = 200,
        /// Keys of the case for derivatives of the orbit and its observables; the same quantities
        /// stay constant as in a sweep
        #[schemars(extend("x-value" = "KEY,…"))]
        pub derivatives: Vec<String> = Vec::new(),
        /// Look for the smallest knock on the tip after which the lever goes to another motion
        pub upset: bool = false,
        /// Prove existence, local uniqueness and stability by interval arithmetic
        pub prove: bool = false,
    }
}

/// A periodic orbit by Newton's method.
#[derive(Clone, Copy, Debug)]
pub struct OrbitStudy;

impl Study for OrbitStudy {
    const NAME: &'static str = "orbit";
    const ABOUT: &'static str = "Compute a periodic orbit by Newton's method, stable or not";
    type Options = OrbitOptions;
    type Report = InSi<OrbitReport>;

    fn frames<'a>(case: &Case, report: &'a InSi<OrbitReport>) -> Vec<Frame<'a>> {
        let spectrum = &report.motion.spectrum;
        vec![harmonic_table(spectrum, case.omega(), case.units())]
    }

    fn figure(case: &Case, report: &InSi<OrbitReport>) -> Option<Figure> {
        Some(orbit_figure(
            &case.model().ok()?,
            &report.motion,
            &case.units(),
        ))
    }

    fn remarks(_: &Case, report: &InSi<OrbitReport>) -> Vec<Remark> {
        let (orbit, physical) = (&report.motion, report.physical.as_ref());
        let mut remarks = limits_of(&orbit.observables, physical, &orbit.out_of_range);
        remarks.extend(Remark::notes(&orbit.notes));
        remarks
    }

    fn compute(
        case: &Case,
        options: &OrbitOptions,
        control: &Control<'_>,
    ) -> Result<InSi<OrbitReport>, Error> {
        let keys = options.derivatives.iter();
        let keys = keys
            .map(|name| case.key(name))
            .collect::<Result<Vec<_>, _>>()?;
        let model = case.model()?;
        let observables = options.observables.unwrap_or(ObservableSet::ALL);
        let options = &OrbitOptions {
            state: case.state_of(options.state.as_ref())?,
            ..options.clone()
        };
        let mut found = orbit(&model, options)?;
        let given = options.state.is_some();
        let note = initial_state_note(&model, given, Some(&found.state));
        found.notes.push(note);
        for key in keys {
            let at = (found.state.as_slice(), found.period);
            let derivative =
                Derivative::of(case, &model, key, at, &found.observables, observables)?;
            found.derivatives.insert(key.path(), derivative);
        }
        if options.upset {
            let at = (found.state.as_slice(), found.period);
            found.upset = Some(upset(case, at, control)?);
        }
        if options.prove {
            found.prove(&Prover::new(case));
        }
        let physical = case.physical().map(|resolved| {
            PhysicalMotion::alone(&found.observables, Some(&found.spectrum), resolved)
                .with_state(&found.state, resolved)
        });
        Ok(InSi {
            motion: found,
            physical,
        })
    }
}
