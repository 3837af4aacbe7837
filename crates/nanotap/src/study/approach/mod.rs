//! Approach and retract curves: the sample is brought near and taken away so slowly that the
//! lever always settles (`distance_sweep.rs`). Branches of stable orbits are continued in the
//! distance, and where one ends the flow from there gives the motion to which the lever jumps.
//! So jumps and hysteresis are those of the branches: they do not depend on the distances at
//! which the curve is written. Through every stretch of stable orbits found, branches are
//! continued, stable and unstable, with their folds, flips and grazings located.
//!
//! A periodic motion is an orbit closed by Newton; a chaotic or quasi-periodic one is described
//! by a recording; of what is undecided no numbers are given.
//!
//! With [`ApproachOptions::speed`] the distance changes each drive period instead and the lever
//! is given no time to settle.
//!
//! The distance is the gap between tip and sample at rest, `alpha5` of the cantilever (zc of
//! AFM people, with which the piezo moves) and `gap` of an oscillator. The model's unit of
//! length stays that of the case: the beam's own gap changes with the tip's, but only whether
//! the beam touches depends on it.
//!
//! With [`ApproachOptions::phase`] amplitude and phase are held by frequency and strength of the
//! drive, as in frequency modulation: see [`frequency_modulation`].
//! Orbits are then continued from distance to distance.
//!
//! Limits: branches that no motion of approach or retract lies on are not found.

pub(in crate::study) mod distance_sweep;
pub mod frequency_modulation;
pub(in crate::study) mod quasistatic;
mod ramp;

use nanotap_dynamics::{Control, PeriodicOrbit};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::case::physical::Kind;
use crate::case::{Case, CaseError, Key, ParameterUnit};
use crate::model::{Model, MotionError};
use crate::observe::{Clearance, Observables, PhysicalMotion, Set, measure};
use crate::study::FreeMotion;
use crate::study::branch::{BranchError, BranchOptions, BranchReport};
use crate::study::kind::Study;
use crate::study::limits::{MOST_DISTANCES, MOST_DOUBLINGS, MOST_PERIOD};
use crate::study::simulate::Classification;
use crate::study::value::Amount;
use distance_sweep::FoundMotion;
use frequency_modulation::{
    HeldError, Modulated, ModulatedInSi, ModulationReport, modulated_approach,
};
pub use quasistatic::{states_at, states_near};

/// How to approach. Distances are in the model's unit of length.
#[derive(Clone, Debug, PartialEq)]
pub struct ApproachOptions {
    /// Where to begin, far away; `None`: 1.25 times the tip's free reach.
    pub from: Option<f64>,
    /// Where to turn back; `None`: 0, where the sample stands at the tip's rest position.
    pub to: Option<f64>,
    /// Distances each way, both ends included.
    pub points: usize,
    /// Whether branches are continued through the periodic motions found.
    pub branches: bool,
    /// Doublings of these that are followed.
    pub doublings: usize,
    /// Longest period looked for.
    pub max_period: usize,
    /// Periods recorded of a motion that is not periodic.
    pub periods: usize,
    /// Speed with which the distance changes, in the model's unit of length a unit of time;
    /// `None`: so slowly that the lever always settles.
    pub speed: Option<f64>,
    /// The phase in degrees that is held together with the case's free amplitude, by frequency
    /// and strength of the drive; `None`: the drive stays as it is.
    pub phase: Option<f64>,
    /// The frequency shift, in the model's unit, whose distances are to be found where amplitude
    /// and phase are held.
    pub shift: Option<f64>,
    /// The least distance of the oscillation that is kept where amplitude and phase are held: the
    /// amplitude then changes with the distance.
    pub closest: Option<f64>,
}

impl Default for ApproachOptions {
    fn default() -> Self {
        Self {
            from: None,
            to: None,
            points: 80,
            branches: true,
            doublings: 1,
            max_period: 32,
            periods: 256,
            speed: None,
            phase: None,
            shift: None,
            closest: None,
        }
    }
}

/// Where the default curve begins, in units of the tip's free reach: far enough to see the
/// free motion, and branches that reach beyond it.
const BEYOND: f64 = 1.25;

/// Where a curve at a kept least distance ends, as a part of the amplitude with which it begins.
const LEAST_AMPLITUDE: f64 = 0.02;

/// Why there is no curve.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ApproachError {
    /// Fewer than two distances.
    #[error("{given} distances make no curve: at least 2 are needed")]
    Points {
        /// What was given.
        given: usize,
    },
    /// Distances that are none, or the wrong way round.
    #[error(
        "an approach goes from far to near: it cannot go from {from} to {to}; the first distance \
         must be the greater, both finite"
    )]
    Range {
        /// Where it was to begin.
        from: f64,
        /// Where it was to end.
        to: f64,
    },
    /// No amplitude is left.
    #[error(
        "an oscillation that comes as near as {closest} has no amplitude at the distance {to}: the \
         last distance must be the greater"
    )]
    Closest {
        /// The least distance that was to be kept.
        closest: f64,
        /// Where the curve was to end.
        to: f64,
    },
    /// Nothing moves.
    #[error(
        "the drive does not move the tip, so that no distance says where the curve should \
         begin; give it"
    )]
    NoDrive,
    /// Nothing to record.
    #[error("at least one period must be recorded of motions that are not periodic")]
    NoPeriods,
    /// A speed that is none.
    #[error("the distance cannot change at a speed of {given}: a finite one above zero is needed")]
    Speed {
        /// What was given.
        given: f64,
    },
    /// A speed that takes too long.
    #[error(
        "at this speed the lever takes {needed:.3e} drive periods there and back; {most} are \
         followed at most"
    )]
    Slow {
        /// Drive periods there and back.
        needed: f64,
        /// The most that are followed.
        most: usize,
    },
    /// A speed that leaves no period for a distance.
    #[error("at this speed less than a drive period passes between two written distances")]
    Fast,
    /// The flow failed.
    #[error("at the distance {gap}: {error}")]
    Flow {
        /// Where.
        gap: f64,
        /// Why.
        error: MotionError,
    },
    /// A longest period of 0.
    #[error("no motion has the longest period 0: at least 1 is needed")]
    NoPeriod,
    /// The case makes no sense.
    #[error(transparent)]
    Model(#[from] CaseError),
    /// The branches could not be followed.
    #[error(transparent)]
    Branch(#[from] BranchError),
    /// No orbit has the amplitude and phase that are to be held.
    #[error(transparent)]
    Held(#[from] HeldError),
}

/// Which way the sample moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// Towards the tip.
    Approach,
    /// Away from it.
    Retract,
    /// Neither way: an attractor of a neighbouring distance that is one here too.
    Neither,
}

impl Way {
    /// The word for it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Approach => "approach",
            Self::Retract => "retract",
            Self::Neither => "neither",
        }
    }
}

/// The motion at one distance on one way.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ApproachPoint {
    /// Which way.
    pub way: Way,
    /// The distance, in the model's unit of length.
    pub gap: f64,
    /// The distance in m, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zc: Option<f64>,
    /// What the motion is.
    pub classification: Classification,
    /// Its minimal period, if periodic.
    pub period: Option<usize>,
    /// Largest |multiplier|, if periodic.
    pub spectral_radius: Option<f64>,
    /// What it looks like; nothing if undecided or unbounded.
    #[serde(flatten)]
    pub observables: Option<Observables>,
    /// The same in SI, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalMotion>,
    /// Why it is undecided, if it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// What frequency modulation tells, where amplitude and phase are held.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modulation: Option<Modulated>,
    /// The same in SI, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modulation_si: Option<ModulatedInSi>,
    /// The orbit.
    #[serde(skip)]
    pub orbit: Option<PeriodicOrbit>,
}

/// A jump of a slowly moved lever from one motion to another.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct StateJump {
    /// Which way.
    pub way: Way,
    /// Where, in the model's unit of length.
    pub gap: f64,
    /// The same in m, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zc: Option<f64>,
    /// How well that is known, in the model's unit of length.
    pub uncertainty: f64,
    /// What ends the motion before it: fold, flip, neimark-sacker, grazing, crossing, or a
    /// sentence.
    pub reason: String,
    /// The motion before it, at its end.
    pub before: ApproachPoint,
    /// The motion after it.
    pub after: ApproachPoint,
}

/// An interval of distances in which approach and retract show different motions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Hysteresis {
    /// Nearest distance of the interval, in the model's unit of length.
    pub near: f64,
    /// Farthest distance.
    pub far: f64,
    /// Greatest difference of the amplitude at the drive's frequency within it; of the relative
    /// frequency shift where the amplitude is held.
    pub difference: f64,
}

/// Approach and retract curves, with the branches behind them.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ApproachReport {
    /// The key of the distance in a case file.
    pub parameter: &'static str,
    /// Where the approach begins.
    pub from: f64,
    /// Where it turns back.
    pub to: f64,
    /// Free amplitude A₀ at the drive's frequency.
    pub free_amplitude: f64,
    /// Free phase, degrees behind the drive.
    pub free_phase: f64,
    /// Distance at which the free motion begins to touch.
    pub free_reach: f64,
    /// The motions at the requested distances: those of the approach, then those of the retract.
    pub table: Vec<ApproachPoint>,
    /// Where the lever changes from one motion to another by a jump, in the order of the way.
    pub jumps: Vec<StateJump>,
    /// Stable orbits of the same distances on neither way, that lie on stretches of stable orbits
    /// on which a way is at other distances, by descending distance.
    pub coexisting: Vec<ApproachPoint>,
    /// Least height of the beam above the sample in the motion at the nearest distance, in the
    /// model's unit of length: where it is not above zero, another part than the tip touches.
    pub beam_clearance: Option<f64>,
    /// Where the two ways differ, its ends as exact as those of the branches.
    pub hysteresis: Vec<Hysteresis>,
    /// Whether the way back ends in the motion with which the way there began; if not, it
    /// begins too near.
    pub returned: bool,
    /// Branches through the periodic motions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub branches: Option<BranchReport>,
    /// Whether the work was stopped before it was done.
    pub cancelled: bool,
    /// Budgets of steps that were spent, with what is missing for that.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<String>,
    /// Of a physical case: what a distance is to be multiplied with for SI.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter_unit: Option<ParameterUnit>,
    /// Frequency modulation, where amplitude and phase are held.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modulation: Option<ModulationReport>,
}

/// Brings the sample near and takes it away.
///
/// # Errors
/// [`ApproachError`] when the options make no sense for the case.
pub fn approach(
    case: &Case,
    options: &ApproachOptions,
    control: &Control<'_>,
) -> Result<ApproachReport, ApproachError> {
    if let Some(phase) = options.phase {
        return modulated_approach(case, options, phase, control);
    }
    let key = case.gap_key();
    let free = FreeMotion::of(&case.model()?);
    let distances = distances(&free, options)?;
    let (from, to) = (distances[0], distances[distances.len() - 1]);
    let curve = Curve { case, options };
    let found = quasistatic::found(&curve, &free, &distances, control)?;
    Ok(ApproachReport {
        parameter: key.path(),
        from,
        to,
        free_amplitude: free.amplitude,
        free_phase: free.phase,
        free_reach: free.reach,
        beam_clearance: beam_clearance(case, &found.table),
        hysteresis: found.hysteresis,
        returned: returned(&found.table, options.speed, free.amplitude),
        table: found.table,
        jumps: found.jumps,
        coexisting: found.coexisting,
        branches: found.branches,
        cancelled: control.is_cancelled(),
        limits: found.limits,
        parameter_unit: case.parameter_unit(key),
        modulation: None,
    })
}

/// The distances from far to near.
pub(in crate::study) fn distances(
    free: &FreeMotion,
    options: &ApproachOptions,
) -> Result<Vec<f64>, ApproachError> {
    if options.points < 2 {
        return Err(ApproachError::Points {
            given: options.points,
        });
    }
    if options.periods == 0 {
        return Err(ApproachError::NoPeriods);
    }
    if options.max_period == 0 {
        return Err(ApproachError::NoPeriod);
    }
    if let Some(given) = options.speed
        && !(given > 0.0 && given.is_finite())
    {
        return Err(ApproachError::Speed { given });
    }
    if options.from.is_none() && !(free.reach > 0.0 && free.reach.is_finite()) {
        return Err(ApproachError::NoDrive);
    }
    let from = options.from.unwrap_or(BEYOND * free.reach);
    let to = match (options.to, options.closest) {
        (Some(to), _) => to,
        (None, Some(closest)) => closest + LEAST_AMPLITUDE * (from - closest),
        (None, None) => from.min(0.0),
    };
    if !(from.is_finite() && to.is_finite() && from > to) {
        return Err(ApproachError::Range { from, to });
    }
    if let Some(closest) = options.closest
        && (to <= closest || !closest.is_finite())
    {
        return Err(ApproachError::Closest { closest, to });
    }
    let last = (options.points - 1) as f64;
    // Amplitudes at a kept least distance are in equal ratios.
    let between = |share: f64| match options.closest {
        Some(closest) if share > 0.0 && share < 1.0 => {
            let ratio = (to - closest) / (from - closest);
            closest + (from - closest) * nanotap_arithmetic::powf(ratio, share)
        }
        // Both ends exactly.
        _ => from * (1.0 - share) + to * share,
    };
    Ok((0..options.points)
        .map(|k| between(k as f64 / last))
        .collect())
}

/// How a curve is written.
struct Curve<'a> {
    case: &'a Case,
    options: &'a ApproachOptions,
}

impl Curve<'_> {
    /// A motion as a line of the table.
    fn observed(&self, way: Way, gap: f64, model: &Model, motion: FoundMotion) -> ApproachPoint {
        let seen = match (&motion.orbit, motion.classification) {
            (Some(orbit), _) => {
                let start = orbit.states.first().map_or(&[][..], Vec::as_slice);
                measure(model, start, orbit.period, Set::COMMON).map(Some)
            }
            (None, Classification::Undecided | Classification::Unbounded) => Ok(None),
            (None, _) => measure(model, &motion.state, self.options.periods, Set::COMMON).map(Some),
        };
        let (classification, observables, reason) = match seen {
            Ok(Some(seen)) => (motion.classification, Some(seen), None),
            Ok(None) => (motion.classification, None, Some(motion.evidence)),
            Err(error) => (Classification::Undecided, None, Some(error.to_string())),
        };
        let view = self.case.physical();
        ApproachPoint {
            way,
            gap,
            zc: view.map(|view| gap * view.scales.length),
            classification,
            period: motion.orbit.as_ref().map(|orbit| orbit.period),
            spectral_radius: motion.orbit.as_ref().map(PeriodicOrbit::spectral_radius),
            physical: observables
                .as_ref()
                .zip(view)
                .map(|(seen, view)| PhysicalMotion::of(seen, view)),
            observables,
            reason,
            modulation: None,
            modulation_si: None,
            orbit: motion.orbit,
        }
    }
}

/// How branches are followed.
fn branching(key: Key, (from, to): (f64, f64), options: &ApproachOptions) -> BranchOptions {
    BranchOptions {
        doublings: options.doublings,
        stable_doublings: true,
        max_multiplier: MAX_MULTIPLIER,
        ..BranchOptions::over(key, from, to)
    }
}

/// Growth of disturbances over a period beyond which an unstable branch is left: near the snap-in
/// of an attractive sample it reaches 10⁶, in ever shorter steps.
pub(in crate::study) const MAX_MULTIPLIER: f64 = 1e4;

/// Longest period looked for on the way to a setpoint.
pub(in crate::study) const SETPOINT_PERIODS: usize = 32;

/// Relative difference of amplitudes that is no longer rounding.
const DIFFERENT: f64 = 1e-6;

/// The intervals in which the two ways differ; `difference` says by how much two points do.
pub(in crate::study) fn hysteresis(
    table: &[ApproachPoint],
    difference: impl Fn(&ApproachPoint, &ApproachPoint) -> Option<f64>,
) -> Vec<Hysteresis> {
    let back: Vec<&ApproachPoint> = table.iter().filter(|p| p.way == Way::Retract).collect();
    let mut intervals: Vec<Hysteresis> = Vec::new();
    let mut open = false;
    for there in table.iter().filter(|p| p.way == Way::Approach) {
        // The same numbers, since both ways take the same list.
        let found = back.iter().find(|p| p.gap.to_bits() == there.gap.to_bits());
        let difference = found.and_then(|back| difference(there, back));
        if let Some(difference) = difference {
            match intervals.last_mut().filter(|_| open) {
                Some(interval) => {
                    interval.near = there.gap;
                    interval.difference = interval.difference.max(difference);
                }
                None => intervals.push(Hysteresis {
                    near: there.gap,
                    far: there.gap,
                    difference,
                }),
            }
        }
        open = difference.is_some();
    }
    intervals
}

/// The beam's clearance at the nearest distance on the way there.
pub(in crate::study) fn beam_clearance(case: &Case, table: &[ApproachPoint]) -> Option<f64> {
    let nearest = table.iter().rfind(|p| p.way == Way::Approach)?;
    let orbit = nearest.orbit.as_ref()?;
    let mut there = case.with(case.gap_key(), nearest.gap);
    if let Some(modulation) = &nearest.modulation {
        there = there.with_drive(modulation.drive_frequency, modulation.drive_strength);
    }
    let model = there.model().ok()?;
    let start = orbit.states.first()?;
    let clearance = Clearance::of(&model, start, orbit.period).ok()??;
    // The sample moves towards the whole lever; the model's beam stands where the case has it.
    let moved = case
        .physical()
        .map_or(0.0, |view| nearest.gap - view.cantilever.alpha5);
    Some(clearance.height + moved)
}

/// Part of the free amplitude within which a lever that is moved fast has returned.
const RETURNED: f64 = 1e-2;

fn returned(table: &[ApproachPoint], speed: Option<f64>, free_amplitude: f64) -> bool {
    let ends = table.first().zip(table.last());
    ends.is_some_and(|(first, last)| {
        let apart = difference(first, last, free_amplitude);
        apart.is_none() || speed.is_some() && apart.is_some_and(|a| a <= RETURNED * free_amplitude)
    })
}

/// How much two motions at one distance differ; `None` if they are one as far as is known.
/// Recordings of one chaotic band never agree to the digit, so that only what both periodic
/// motions are, or the class, counts.
fn difference(a: &ApproachPoint, b: &ApproachPoint, free_amplitude: f64) -> Option<f64> {
    let (x, y) = (a.observables.as_ref()?, b.observables.as_ref()?);
    let amplitudes = (x.first_harmonic - y.first_harmonic).abs();
    let periodic = a.period.is_some() && b.period.is_some();
    let differ = a.classification != b.classification
        || a.period != b.period
        || (periodic && amplitudes > DIFFERENT * free_amplitude);
    differ.then_some(amplitudes)
}

/// Options of an approach curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ApproachRequest {
    /// Distance at which to begin, in units of the case ("30 nm") or as alpha5; without it, 1.25
    /// times what the free tip swings towards the sample
    #[schemars(extend("x-value" = "DISTANCE"))]
    pub from: Option<Amount>,
    /// Distance at which to turn back; without it, 0
    #[schemars(extend("x-value" = "DISTANCE"))]
    pub to: Option<Amount>,
    /// Distances each way. Under a nonlinear law the lever is followed for 40 million steps of the
    /// approximate flow at most, and as many are taken for the rows, where a step of the exact flow
    /// counts as 100
    #[schemars(range(min = 2, max = MOST_DISTANCES), extend("x-value" = "P"))]
    pub points: usize,
    /// Also continue the branches that coexist, stable and unstable
    #[schemars(extend("x-no" = "Only follow the motion: continue no branches"))]
    pub branches: bool,
    /// Doublings of branches to follow, as far as their orbits are stable
    #[schemars(range(min = 0, max = MOST_DOUBLINGS), extend("x-value" = "DEPTH"))]
    pub switch: usize,
    /// Longest period looked for
    #[schemars(range(min = 1, max = MOST_PERIOD), extend("x-value" = "N"))]
    pub max_period: usize,
    /// Speed of the approach and of the retraction, in units of the case ("500 nm/s") or as alpha5
    /// a unit of time: the distance changes each drive period and the lever does not settle;
    /// without it, both are so slow that it always does
    #[schemars(extend("x-value" = "SPEED"))]
    pub speed: Option<Amount>,
    /// Frequency modulation: hold amplitude (the case's free amplitude) and phase by frequency and
    /// strength of the drive, and tell the frequency shift
    pub fm: bool,
    /// Phase behind the drive that frequency modulation holds, in degrees
    #[schemars(range(min = 0, max = 180), extend("x-value" = "DEGREES"))]
    pub phase: f64,
    /// Frequency shift of frequency modulation whose distances are to be found, in units of the
    /// case ("-50 Hz") or as omega
    #[schemars(extend("x-value" = "SHIFT"))]
    pub shift: Option<Amount>,
    /// Least distance of the oscillation that frequency modulation keeps, in units of the case
    /// ("1 nm") or as alpha5: the amplitude then changes with the distance
    #[schemars(extend("x-value" = "DISTANCE"))]
    pub closest: Option<Amount>,
}

impl Default for ApproachRequest {
    fn default() -> Self {
        let options = ApproachOptions::default();
        Self {
            from: None,
            to: None,
            points: options.points,
            branches: options.branches,
            switch: options.doublings,
            max_period: options.max_period,
            speed: None,
            fm: false,
            phase: 90.0,
            shift: None,
            closest: None,
        }
    }
}

impl ApproachRequest {
    /// How to approach, in the model's unit of length.
    ///
    /// # Errors
    /// When a distance is none.
    pub fn options(&self, case: &Case) -> Result<ApproachOptions, Error> {
        let key = case.gap_key();
        let distance = |option: &str, given: &Option<Amount>| {
            let read = |amount: &Amount| case.value(key, amount.text());
            let read = given.as_ref().map(read).transpose();
            read.map_err(|error| Error::from(error).at(option))
        };
        let [frequency, _] = case.drive_keys();
        let read = |amount: &Amount| case.value(frequency, amount.text());
        let shift = self.shift.as_ref().map(read).transpose();
        if self.shift.is_some() && !self.fm {
            return Err(Error::option(
                "shift",
                "the frequency does not shift where the drive holds it",
                "add {fm}, which holds amplitude and phase instead",
            ));
        }
        if self.closest.is_some() && !self.fm {
            return Err(Error::option(
                "closest",
                "the least distance cannot be kept where nothing holds the amplitude",
                "add {fm}, which holds amplitude and phase",
            ));
        }
        if self.speed.is_some() && self.fm {
            return Err(Error::option(
                "speed",
                "frequency modulation follows orbits, at no finite speed",
                "leave away {fm} or {speed}",
            ));
        }
        let speed = self.speed.as_ref().map(|amount| speed_of(case, amount));
        Ok(ApproachOptions {
            speed: speed.transpose()?,
            closest: distance("closest", &self.closest)?,
            shift: shift.map_err(|error| Error::from(error).at("shift"))?,
            from: distance("from", &self.from)?,
            to: distance("to", &self.to)?,
            points: self.points,
            branches: self.branches,
            doublings: self.switch,
            max_period: self.max_period,
            phase: self.fm.then_some(self.phase),
            ..ApproachOptions::default()
        })
    }
}

/// A speed in the model's unit of length a unit of time, as it is given of a case.
fn speed_of(case: &Case, amount: &Amount) -> Result<f64, Error> {
    if let Ok(speed) = amount.text().parse::<f64>() {
        return Ok(speed);
    }
    let refused = |error: String| Error::option("speed", error, "write it as in \"500 nm/s\"");
    let speed = Kind::Velocity.parse(amount.text());
    let speed = speed.map_err(|error| refused(error.to_string()))?;
    let view = case.physical().ok_or_else(|| {
        refused("a dimensionless case has no unit of length: a plain number is needed".to_owned())
    })?;
    Ok(speed / view.scales.velocity)
}

/// An approach and retract curve.
#[derive(Clone, Copy, Debug)]
pub struct ApproachStudy;

impl Study for ApproachStudy {
    const NAME: &'static str = "approach";
    const ABOUT: &'static str = "Amplitude, phase, force and energy against the distance to the \
                                 sample, both ways, with the branches that coexist";
    const COUNTED: &'static str = "distances";
    const ANY_DISTANCE: bool = true;
    const PARTIAL: bool = true;
    type Request = ApproachRequest;
    type Report = ApproachReport;

    fn compute(
        case: &Case,
        request: &ApproachRequest,
        control: &Control<'_>,
    ) -> Result<ApproachReport, Error> {
        Ok(approach(case, &request.options(case)?, control)?)
    }
}

impl From<ApproachError> for crate::Error {
    fn from(error: ApproachError) -> Self {
        let input = |remedy| Self::input(error.to_string(), remedy);
        match &error {
            ApproachError::Points { .. } => input("give {points} 80"),
            ApproachError::Range { .. } => input("change {from} or {to}"),
            ApproachError::Closest { .. } => input("change {to} or {closest}"),
            ApproachError::NoDrive => input("give {from}"),
            ApproachError::NoPeriod => input("give a {max_period} of 1 or more"),
            ApproachError::NoPeriods => input("give 1 or more {periods}"),
            ApproachError::Speed { .. } => input("change {speed}"),
            ApproachError::Slow { .. } => {
                input("raise {speed}, or leave it away: the lever then settles at each distance")
            }
            ApproachError::Fast => input("lower {speed} or {points}"),
            ApproachError::Flow { .. } => Self::numerics(error.to_string()),
            ApproachError::Model(error) => error.clone().into(),
            ApproachError::Branch(error) => error.clone().into(),
            ApproachError::Held(error) => error.clone().into(),
        }
    }
}
