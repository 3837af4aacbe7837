//! All states at a setpoint, however the lever comes to them.
//!
//! The lever is followed from far to the sample's own position and back. Its motions where the approach
//! ends are sampled from several initial states, too, and from motions with the amplitude of the setpoint
//! and several phases, at distances of about this amplitude; there the orbits that averaging
//! finds are closed, too: few starts may lead to them. Each branch on the way, and each to which a
//! start leads, is continued round its folds, and every orbit on it that is at the setpoint is
//! closed by Newton. A feedback loop holds those that are stable and on which the held quantity
//! changes with the distance as it does on the approach.
//!
//! Fails by omission: orbits on branches that neither the lever nor a start comes to.

use nanotap_case::Case;
use nanotap_case::physical::Held;
use nanotap_dynamics::{
    AttractorKind, Census, CensusOptions, Control, PeriodicOrbit, ShootingOptions, census,
    close_orbit,
};
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;
use nanotap_study::FreeMotion;
use nanotap_study::averaged_orbits::averaged_orbits;
use nanotap_study::start_box::default_starts;

use super::{
    HeldQuantity, OTHERS_STEPS, Search, SetpointSolution, Trace, approach, cancelled, from_far,
    held_quantity,
};
use crate::approach::distance_sweep::{DistanceSweep, End, Piece, Place};
use crate::short_run::short_run;

/// Initial states of the search for states at a setpoint.
#[derive(Clone, Copy, Debug)]
pub struct StateSearch {
    /// Number of initial states where the approach ends.
    pub starts: usize,
    /// Seed of the initial states.
    pub seed: u64,
    /// Longest period of orbits, in drive periods.
    pub max_period: usize,
}

/// The states at a setpoint.
#[derive(Clone, Debug)]
pub struct SetpointStates {
    /// Orbits that a feedback loop holds at the setpoint, from far to near.
    pub states: Vec<SetpointSolution>,
    /// Why other states may be missing.
    pub undecided: Option<Undecided>,
}

/// Why states at a setpoint may be missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Undecided {
    /// The budget of steps was spent.
    Budget,
    /// A motion that does not repeat, or only after a long time, is or may be at the setpoint.
    NotPeriodic,
    /// A branch could not be followed to its end.
    NotFollowed,
    /// The motion from an initial state could not be classified.
    UnclassifiedStart,
    /// The case has no model at these values.
    NoModel,
}

impl Undecided {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Budget,
        Self::NotPeriodic,
        Self::NotFollowed,
        Self::UnclassifiedStart,
        Self::NoModel,
    ];

    /// Name in data, such as `not-periodic`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Budget => "budget",
            Self::NotPeriodic => "not-periodic",
            Self::NotFollowed => "not-followed",
            Self::UnclassifiedStart => "unclassified-start",
            Self::NoModel => "no-model",
        }
    }

    /// Describes it in words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Budget => "the budget of steps was spent",
            Self::NotPeriodic => "a motion that does not repeat may be at the setpoint",
            Self::NotFollowed => "a branch could not be followed to its end",
            Self::UnclassifiedStart => "the motion from an initial state could not be classified",
            Self::NoModel => "the case has no model there",
        }
    }
}

/// Finds the states at the setpoint of a case.
///
/// # Errors
/// When the case has no setpoint of amplitude, phase or peak force, makes no sense, or the work was
/// cancelled.
pub fn states_at_setpoint(
    case: &Case,
    options: &StateSearch,
    control: &Control<'_>,
) -> Result<SetpointStates, Error> {
    let (held, free) = held_quantity(case)?;
    let mut search = Search::new(case, held, free);
    let (mut sweep, place) = from_far(case, &[held], free, control)?;
    let searches = std::slice::from_mut(&mut search);
    let (mut pieces, place) = approach(&mut sweep, place, searches, control)?;
    let mut reasons: Vec<Undecided> = Vec::new();
    let reached = search.result(&sweep).ok();
    reasons.extend(spent(&sweep));
    sweep.allow_steps(OTHERS_STEPS);
    let at = reached
        .as_ref()
        .map_or_else(|| place_gap(&place), |r| r.gap);
    let (inward, place) = sweep.way(place, 0.0, |_, _| false);
    let (outward, _) = sweep.way(place, sweep.farthest(), |_, _| false);
    reasons.extend(spent(&sweep));
    sweep.allow_steps(OTHERS_STEPS);
    reasons.extend(sampled(&mut sweep, at, options, control)?);
    let amplitude = match held.setpoint {
        Held::Amplitude(_) => held.target,
        _ => reached
            .as_ref()
            .map_or(free.amplitude, |r| r.observables.first_harmonic),
    };
    let expected = Expected { free, amplitude };
    expected.follow_near(&mut sweep, at, Starts::All, options.max_period, control)?;
    reasons.extend(spent(&sweep));
    sweep.allow_steps(u64::MAX);
    pieces.extend(inward);
    for way in [&pieces, &outward] {
        reasons.extend(passed(&held, &sweep, way));
    }
    let (mut states, _) = search.others(&sweep, reached.as_ref(), at, control);
    states.extend(reached);
    if control.is_cancelled() {
        return Err(cancelled());
    }
    states.retain(|state| state.stable);
    states.sort_by(|a, b| b.gap.total_cmp(&a.gap));
    states.retain(|state| {
        let rises = slope_from_far(&held, &sweep, state, free.amplitude);
        if rises.is_none() {
            reasons.push(Undecided::NotFollowed);
        }
        rises == Some(true)
    });
    Ok(SetpointStates {
        states,
        undecided: reasons.into_iter().min(),
    })
}

fn spent(sweep: &DistanceSweep<'_>) -> Option<Undecided> {
    sweep.spent_budget().map(|_| Undecided::Budget)
}

const fn place_gap(place: &Place) -> f64 {
    match place {
        Place::On { gap, .. } | Place::Off { gap, .. } => *gap,
    }
}

/// Distances at which motions with the amplitude of the setpoint are started, over that amplitude: a stiff
/// sample lets the tip tap where both are the same, a soft one or an attraction lets it come nearer.
const DISTANCES: [f64; 3] = [1.0, 0.9, 0.8];
/// Phase lags behind the drive of these motions, degrees: from strong repulsion to strong attraction.
const LAGS: [f64; 5] = [30.0, 60.0, 90.0, 120.0, 150.0];

/// Under which forces motions are started to find states.
#[derive(Clone, Copy, Debug)]
pub(super) enum Starts {
    /// Under every force.
    All,
    /// Under a piecewise-linear one, whose motions averaging does not know.
    WhereNotAveraged,
}

/// Motions with the amplitude of the setpoint, near which the states are expected.
pub(super) struct Expected {
    pub(super) free: FreeMotion,
    pub(super) amplitude: f64,
}

impl Expected {
    /// States at drive phase 0 of free motions with this amplitude and each lag.
    fn starts(&self, model: &Model) -> Vec<Vec<f64>> {
        let Some(free) = model.system.regimes().first() else {
            return Vec::new();
        };
        let (drive, response) = (model.system.drive(), free.response());
        let ratio = self.amplitude / self.free.amplitude;
        let start = |lag: &f64| {
            let time = drive.period() * (self.free.phase - lag) / 360.0;
            let moved = response.at(drive, time);
            let mut state = vec![0.0; model.dimension()];
            for (entry, value) in state.iter_mut().zip(moved.iter()) {
                *entry = ratio * value;
            }
            model.stop_at_wall(&mut state);
            state
        };
        let starts = LAGS.iter().map(start);
        starts
            .filter(|state| state.iter().all(|value| value.is_finite()))
            .collect()
    }

    /// Continues the branches to which these motions lead, at the distance where the approach ends and at
    /// those where the states are expected, and those that averaging knows.
    pub(super) fn follow_near(
        &self,
        sweep: &mut DistanceSweep<'_>,
        at: f64,
        starts: Starts,
        max_period: usize,
        control: &Control<'_>,
    ) -> Result<(), Error> {
        let expected = DISTANCES.map(|distance| distance * self.amplitude);
        for gap in [at].into_iter().chain(expected) {
            let model = sweep.model(gap)?;
            // Averaging knows the motions under a nonlinear force in a fraction of the time.
            let starts = match (starts, &model.nonlinear) {
                (Starts::WhereNotAveraged, Some(_)) => Vec::new(),
                _ => self.starts(&model),
            };
            // What one of these few starts does not decide is left to the others.
            let found = followed(&model, &starts, max_period, control);
            let attractors = found.attractors.into_iter();
            let orbits = attractors.filter_map(|attractor| match attractor.kind {
                AttractorKind::Periodic(orbit) => Some(orbit),
                _ => None,
            });
            let averaged = averaged_orbits(&model).into_iter();
            for orbit in orbits.chain(averaged.filter(PeriodicOrbit::is_stable)) {
                sweep.on(gap, orbit);
            }
        }
        Ok(())
    }
}

/// The motions to which initial states lead.
fn followed(
    model: &Model,
    starts: &[Vec<f64>],
    max_period: usize,
    control: &Control<'_>,
) -> Census {
    let census_options = CensusOptions {
        classify: short_run(max_period),
        ..CensusOptions::default()
    };
    let quiet = Control {
        progress: None,
        ..*control
    };
    census(&ModelMap::new(model), starts, &census_options, &quiet)
}

/// Continues the branches to which initial states at a distance lead.
fn sampled(
    sweep: &mut DistanceSweep<'_>,
    gap: f64,
    options: &StateSearch,
    control: &Control<'_>,
) -> Result<Vec<Undecided>, Error> {
    let model = sweep.model(gap)?;
    let set = default_starts(&model, options.seed)?;
    let starts: Vec<Vec<f64>> = (0..options.starts).filter_map(|k| set.start(k)).collect();
    let found = followed(&model, &starts, options.max_period, control);
    let mut reasons = Vec::new();
    if !found.undecided.is_empty() || found.transient_chaos.is_some() {
        reasons.push(Undecided::UnclassifiedStart);
    }
    for attractor in found.attractors {
        match attractor.kind {
            AttractorKind::Periodic(orbit) => {
                sweep.on(gap, orbit);
            }
            _ => reasons.push(Undecided::NotPeriodic),
        }
    }
    Ok(reasons)
}

/// Why a state may be missing that the lever passed on the pieces of a way.
fn passed(held: &HeldQuantity, sweep: &DistanceSweep<'_>, pieces: &[Piece]) -> Vec<Undecided> {
    let mut reasons = Vec::new();
    // The last value, unless the lever jumped after it.
    let mut before: Option<f64> = None;
    for piece in pieces {
        if matches!(piece.end, End::Lost(_)) {
            reasons.push(Undecided::NotFollowed);
        }
        let trace = held.trace(sweep, piece);
        let last = match &trace {
            Trace::Orbits(orbits) => orbits.last().map(|(.., value)| *value),
            Trace::Averages(values) => {
                let all = before.iter().chain(values.iter().map(|(_, value)| value));
                let all: Vec<f64> = all.copied().collect();
                let above = |value: &f64| *value > held.target;
                if all.iter().any(|value| value.is_nan())
                    || all.iter().any(above) && !all.iter().all(above)
                {
                    reasons.push(Undecided::NotPeriodic);
                }
                all.last().copied()
            }
        };
        before = last.filter(|_| !piece.jumps);
    }
    reasons
}

/// Step of the distance over the free amplitude by which the slope of the held quantity is measured.
const SLOPE_STEP: f64 = 1e-6;

/// Whether the held quantity goes towards its value far from the sample as the distance grows; `None`
/// if no orbit closes next to this one.
fn slope_from_far(
    held: &HeldQuantity,
    sweep: &DistanceSweep<'_>,
    state: &SetpointSolution,
    free_amplitude: f64,
) -> Option<bool> {
    let side = |step: f64| {
        let gap = state.gap + step * free_amplitude;
        let model = sweep.model(gap).ok()?;
        let mut map = ModelMap::new(&model);
        let options = ShootingOptions::default();
        let orbit = close_orbit(&mut map, &state.state, state.period, &options).ok()?;
        let orbit: PeriodicOrbit = Some(orbit).filter(PeriodicOrbit::is_stable)?;
        let value = super::value_at(held, sweep, gap, &orbit);
        let change = (value - held.target) * (held.far - held.target);
        (change != 0.0 && change.is_finite()).then_some((change > 0.0) == (step > 0.0))
    };
    side(SLOPE_STEP).or_else(|| side(-SLOPE_STEP))
}
