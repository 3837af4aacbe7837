//! A periodic orbit by Newton, with its stability and what can be read off it.

use nanotap_dynamics::{
    Complex, Control, OrbitSearch, PeriodicOrbit, SettleOptions, ShootingError, ShootingOptions,
    Stability, Verdict, close_orbit, close_orbit_from_points, find_orbits, settle,
};
use nanotap_flow::{FlowError, Trajectory};
use serde::Serialize;

use crate::model::Model;
use crate::observables::{Observables, Spectrum};
use crate::simulate::{ContactEvent, Named, SimulateError, contact_events, starting_state};
use crate::start_box::default_box;
use crate::strobe::Strobe;

/// How to look for an orbit.
#[derive(Clone, Debug, PartialEq)]
pub struct OrbitOptions {
    /// Its period; `None`: the one where the run settles.
    pub period: Option<usize>,
    /// Where to start; `None`: where a run from rest settles.
    pub state: Option<Vec<f64>>,
    /// Harmonics of the drive frequency reported.
    pub harmonics: usize,
    /// Budgets of the run from rest.
    pub settle: SettleOptions,
    /// Newton's budgets.
    pub shooting: ShootingOptions,
}

impl Default for OrbitOptions {
    fn default() -> Self {
        Self {
            period: None,
            state: None,
            harmonics: 20,
            settle: SettleOptions::default(),
            shooting: ShootingOptions::default(),
        }
    }
}

/// Why no orbit was found.
#[derive(Clone, Debug, thiserror::Error)]
pub enum OrbitError {
    /// A period of 0.
    #[error("a period of at least 1 is needed, 0 was given")]
    NoPeriod,
    /// The start makes no sense.
    #[error(transparent)]
    Start(#[from] SimulateError),
    /// The flow failed.
    #[error(transparent)]
    Flow(#[from] FlowError),
    /// Newton found nothing.
    #[error(transparent)]
    Newton(#[from] ShootingError),
    /// There may be none.
    #[error(
        "no orbit of period {period} was found, neither near the motion nor from starts all over the box \
         of states; say --state to look near one"
    )]
    NotFound {
        /// The period asked for.
        period: usize,
    },
    /// The run settles on something that is not periodic.
    #[error(
        "the run from this start is not periodic ({evidence}); say --period to look for an orbit of that period"
    )]
    NotPeriodic {
        /// What it is.
        evidence: String,
    },
}

/// A periodic orbit and everything that is known about it.
#[derive(Clone, Debug, Serialize)]
pub struct OrbitReport {
    /// Minimal period in drive periods.
    pub period: usize,
    /// State at drive phase 0.
    pub state: Vec<f64>,
    /// States at phase 0 of all its periods.
    pub states: Vec<Vec<f64>>,
    /// Largest entry of Pⁿ(x) − x.
    pub residual: f64,
    /// Estimated distance of the state from the true orbit.
    pub error: f64,
    /// Floquet multipliers, real and imaginary part, largest modulus first.
    pub multipliers: Vec<[f64; 2]>,
    /// Whether every multiplier is inside the unit circle.
    pub stable: bool,
    /// What the multipliers say, in a word: stable, unstable or marginal.
    pub stability: &'static str,
    /// |log|det DPⁿ| − trace formula|: zero to rounding of an exact Jacobian.
    pub determinant_defect: f64,
    /// Contacts begun and ended.
    pub events: Vec<ContactEvent>,
    /// What can be read off it.
    #[serde(flatten)]
    pub observables: Observables,
    /// Harmonics, distortion and phase.
    #[serde(flatten)]
    pub spectrum: Spectrum,
    /// Its full length, for figures.
    #[serde(skip)]
    pub trajectory: Trajectory,
}

/// Finds a periodic orbit of `model`.
///
/// # Errors
/// When none is found, with the reason.
pub fn orbit(model: &Model, options: &OrbitOptions) -> Result<OrbitReport, OrbitError> {
    if options.period == Some(0) {
        return Err(OrbitError::NoPeriod);
    }
    let start = starting_state(model, options.state.as_deref())?;
    let mut map = Strobe::new(model);
    let found = match (options.period, &options.state) {
        (Some(period), Some(_)) => close_orbit(&mut map, &start, period, &options.shooting)?,
        (period, _) => settled(model, &mut map, &start, period, options)?,
    };
    report(model, &found, options.harmonics)
}

/// The orbit where a run from `start` settles, or one of the asked period: near its end, or
/// anywhere.
fn settled(
    model: &Model,
    map: &mut Strobe,
    start: &[f64],
    period: Option<usize>,
    options: &OrbitOptions,
) -> Result<PeriodicOrbit, OrbitError> {
    let end = settle(map, start, &options.settle);
    if let Verdict::Periodic(orbit) | Verdict::TransientChaos { orbit, .. } = &end.verdict
        && period.is_none_or(|p| p % orbit.period == 0)
    {
        return Ok(orbit.clone());
    }
    match period {
        None => Err(OrbitError::NotPeriodic {
            evidence: Named::of(&end.verdict).evidence,
        }),
        Some(period) => near_recurrence(map, &end.state, period, &options.shooting)
            .ok()
            .filter(|orbit| orbit.period == period)
            .map_or_else(|| searched(model, map, period, options), Ok),
    }
}

/// Starts in the default box from which Newton is tried.
const SEARCHED_STARTS: usize = 64;
/// Periods run from each of them in search of near returns.
const SEARCHED_PERIODS: usize = 256;

/// An orbit of just this period, the least unstable one that Newton finds from starts all
/// over the default box; failing that, what it finds from where the run ended.
fn searched(
    model: &Model,
    map: &mut Strobe,
    period: usize,
    options: &OrbitOptions,
) -> Result<PeriodicOrbit, OrbitError> {
    let starts = default_box(model)
        .map(|b| b.starts(1, SEARCHED_STARTS))
        .unwrap_or_default();
    let search = OrbitSearch {
        max_period: period,
        run: SEARCHED_PERIODS.max(8 * period),
        shooting: options.shooting.clone(),
        ..OrbitSearch::default()
    };
    let found = find_orbits(map, &starts, &search, &Control::default());
    found
        .into_iter()
        .find(|orbit| orbit.period == period)
        .ok_or(OrbitError::NotFound { period })
}

/// States looked at for a near return.
const RECURRENCE_PERIODS: usize = 2000;
/// Near returns given to Newton.
const RECURRENCE_TRIES: usize = 12;

/// Closes an orbit of the given period from the nearest returns of a wandering motion.
fn near_recurrence(
    map: &mut Strobe,
    state: &[f64],
    period: usize,
    shooting: &ShootingOptions,
) -> Result<PeriodicOrbit, OrbitError> {
    use nanotap_dynamics::StroboscopicMap as _;
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
        match close_orbit_from_points(map, &points, period, shooting) {
            Ok(orbit) if orbit.period == period => return Ok(orbit),
            Ok(orbit) => smaller = Some(orbit),
            Err(error) => last = Some(error),
        }
    }
    match (smaller, last) {
        (Some(orbit), _) => Ok(orbit),
        (None, Some(error)) => Err(error.into()),
        (None, None) => Err(OrbitError::NoPeriod),
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
) -> Result<OrbitReport, OrbitError> {
    let start = orbit.states.first().cloned().unwrap_or_default();
    let trajectory = Trajectory::record(&model.system, &start, orbit.period)?;
    let observables = Observables::of(model, &trajectory).ok_or(OrbitError::NoPeriod)?;
    Ok(OrbitReport {
        period: orbit.period,
        state: start,
        states: orbit.states.clone(),
        residual: orbit.residual,
        error: orbit.error,
        multipliers: orbit
            .multipliers
            .iter()
            .map(|m: &Complex<f64>| [m.re, m.im])
            .collect(),
        stable: orbit.is_stable(),
        stability: match orbit.stability {
            Stability::Stable => "stable",
            Stability::Unstable { .. } => "unstable",
            Stability::Marginal => "marginal",
        },
        determinant_defect: (orbit.log_determinant - log_determinant(model, &trajectory)).abs(),
        events: contact_events(model, &trajectory, 0.0),
        spectrum: Spectrum::of(model, &trajectory, orbit.period, harmonics),
        observables,
        trajectory,
    })
}

/// log|det DPⁿ| from Liouville's formula: every switch has determinant ±(product of
/// the resets), every segment e^{tr A · length}.
fn log_determinant(model: &Model, trajectory: &Trajectory) -> f64 {
    let flow: f64 = trajectory
        .segments()
        .iter()
        .map(|s| model.system.regimes()[s.regime].matrix().trace() * s.length)
        .sum();
    // A rigid impact's saltation has determinant r² (the reset once, the change of
    // time of flight once).
    let impacts: f64 = trajectory
        .events()
        .iter()
        .filter_map(|e| {
            let exit = model.system.exits()[e.from]
                .iter()
                .find(|x| x.target == e.to)?;
            let reset = exit.reset.as_ref()?;
            Some(2.0 * reset.matrix.determinant().abs().ln())
        })
        .sum();
    flow + impacts
}
