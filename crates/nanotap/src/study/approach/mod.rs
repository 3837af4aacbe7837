//! Approach and retract curves: the sample is brought near in steps, then taken away, and at
//! each distance the motion is followed from where the one before ended, so that hysteresis
//! shows. Through every periodic motion found, branches are continued in the distance, stable
//! and unstable, with their folds, flips and grazings located.
//!
//! A motion counts only if [`classify()`](nanotap_dynamics::classify()) could name it: a periodic
//! one is the orbit itself, closed by Newton and seen to be approached; a chaotic or
//! quasi-periodic one is described by a recording; of what is undecided no numbers are given.
//! Attractors met at one distance are then tried at the distances beside it, until none gains
//! one: what coexists with both ways is part of the report.
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
//! Fails: a jump is located to a step of the distance only (the fold behind it exactly, where
//! its branch was followed); of branches that no motion on the way lies on nothing is known.

pub mod frequency_modulation;
mod meanwhile;
mod steps;
mod walk;

use std::sync::mpsc::Sender;

use nanotap_dynamics::{
    Attractor, AttractorKind, ClassifyOptions, Control, PeriodicOrbit, grid_neighbours,
    orbits_shared,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::case::{Case, CaseError, Key, ParameterUnit};
use crate::model::Model;
use crate::model::strobe::Strobe;
use crate::observe::{Clearance, Observables, PhysicalMotion, Set, measure};
use crate::study::FreeMotion;
use crate::study::branch::{BranchError, BranchOptions, BranchReport, BranchesThrough};
use crate::study::kind::Study;
use crate::study::limits::{MOST_DISTANCES, MOST_DOUBLINGS, MOST_PERIOD};
use crate::study::simulate::Classification;
use crate::study::sweep::SweepOptions;
use crate::study::value::Amount;
use frequency_modulation::{
    HeldError, Modulated, ModulatedInSi, ModulationReport, modulated_approach,
};
use meanwhile::{Seed, following};
use walk::Walk;

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
    /// The motions in the order in which they were met: there, then back.
    pub table: Vec<ApproachPoint>,
    /// Attractors that neither way met at a distance, but that those of the distances beside it
    /// lead to, by descending distance.
    pub coexisting: Vec<ApproachPoint>,
    /// Least height of the beam above the sample in the motion at the nearest distance, in the
    /// model's unit of length: where it is not above zero, another part than the tip touches.
    pub beam_clearance: Option<f64>,
    /// Where the two ways differ.
    pub hysteresis: Vec<Hysteresis>,
    /// Whether the way back ends in the motion with which the way there began; if not, it
    /// begins too near.
    pub returned: bool,
    /// Branches through the periodic motions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub branches: Option<BranchReport>,
    /// Whether the work was stopped before it was done.
    pub cancelled: bool,
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
    let curve = Curve {
        case,
        options,
        classify: budgets(options),
    };
    let quiet = Control {
        progress: None,
        ..*control
    };
    let curve = &curve;
    // What both ways meet, each as soon as it is known, then what coexists with it.
    let motions = |met: Option<Sender<Seed>>| {
        let walk = Walk {
            case,
            classify: &ClassifyOptions {
                first_look: walk::FIRST_LOOK,
                ..curve.classify.clone()
            },
            distances: &distances,
            observed: &|way, gap, model, met| curve.observed(way, gap, model, met),
            told: &|point| {
                if let Some((met, seed)) = met.as_ref().zip(point.seed()) {
                    // It cannot fail: whoever follows listens until the walk is over.
                    let _ = met.send(seed);
                }
            },
        };
        let table = walk.there_and_back(control)?;
        drop(met);
        let coexisting = curve.coexisting(&distances, &table, &quiet)?;
        Ok::<_, CaseError>((table, coexisting))
    };
    let how = branching(key, (from, to), options);
    let branches = options.branches.then(|| BranchesThrough::new(case, &how));
    let mut branches = branches.transpose()?;
    let (table, coexisting) = match &mut branches {
        Some(branches) => following(branches, |met| motions(Some(met)), &quiet),
        None => motions(None),
    }?;
    let branches = branches.and_then(|mut branches| {
        branches.follow(coexisting.iter().filter_map(ApproachPoint::seed), &quiet);
        let any = !branches.is_empty() && !control.is_cancelled();
        any.then(|| branches.report(&quiet))
    });
    Ok(ApproachReport {
        parameter: key.path(),
        from,
        to,
        free_amplitude: free.amplitude,
        free_phase: free.phase,
        free_reach: free.reach,
        beam_clearance: beam_clearance(case, &table),
        hysteresis: hysteresis(&table, |a, b| difference(a, b, free.amplitude)),
        returned: returned(&table, free.amplitude),
        table,
        coexisting,
        branches,
        cancelled: control.is_cancelled(),
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
    // Amplitudes at a kept least distance stand in equal ratios.
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

/// Each motion is one of many: a sweep's budgets, but for the patience that a lever of high
/// quality factor needs.
fn budgets(options: &ApproachOptions) -> ClassifyOptions {
    let sweep = SweepOptions {
        max_period: options.max_period,
        ..SweepOptions::new(Vec::new())
    };
    ClassifyOptions {
        max_transient: 2048,
        ..sweep.classify()
    }
}

/// How a curve is taken.
struct Curve<'a> {
    case: &'a Case,
    options: &'a ApproachOptions,
    classify: ClassifyOptions,
}

impl Curve<'_> {
    /// What neither way met at a distance, but the attractors of the distances beside it lead to.
    fn coexisting(
        &self,
        distances: &[f64],
        table: &[ApproachPoint],
        control: &Control<'_>,
    ) -> Result<Vec<ApproachPoint>, CaseError> {
        let case = self.case;
        let model = |k: usize| case.with(case.gap_key(), distances[k]).model();
        let mut known: Vec<Vec<PeriodicOrbit>> = vec![Vec::new(); distances.len()];
        for (step, orbit) in table.iter().enumerate() {
            let there = step.min(2 * distances.len() - 1 - step);
            let orbits = &mut known[there];
            if let Some(orbit) = &orbit.orbit
                && !orbits.iter().any(|other| other.is_same_as(orbit))
            {
                orbits.push(orbit.clone());
            }
        }
        let at = |k: usize| model(k).map_or_else(|e| Err(e.to_string()), |m| Ok(Strobe::new(&m)));
        let neighbours = grid_neighbours(&[distances.len()]);
        let shared = orbits_shared(known, at, neighbours, &self.classify, control);
        let mut found = Vec::new();
        for (k, value) in shared.into_iter().enumerate() {
            let gained = value
                .attractors
                .into_iter()
                .filter(|a| a.shown_by.is_some());
            for Attractor { kind, state, .. } in gained.map(|a| a.attractor) {
                let (classification, orbit) = match kind {
                    AttractorKind::Periodic(orbit) => (Classification::Periodic, Some(orbit)),
                    AttractorKind::QuasiPeriodic(_) => (Classification::QuasiPeriodic, None),
                    AttractorKind::Chaotic { .. } => (Classification::Chaotic, None),
                };
                let met = Met {
                    classification,
                    evidence: String::new(),
                    orbit,
                    state,
                };
                let point = self.observed(Way::Neither, distances[k], &model(k)?, met);
                // Chaos that one of the ways met is the same chaos as far as is known.
                let here = table
                    .iter()
                    .filter(|p| p.gap.to_bits() == point.gap.to_bits());
                if here
                    .into_iter()
                    .all(|p| difference(p, &point, 0.0).is_some())
                {
                    found.push(point);
                }
            }
        }
        Ok(found)
    }

    /// A motion as a line of the table.
    fn observed(&self, way: Way, gap: f64, model: &Model, met: Met) -> ApproachPoint {
        let seen = match (&met.orbit, met.classification) {
            (Some(orbit), _) => {
                let start = orbit.states.first().map_or(&[][..], Vec::as_slice);
                measure(model, start, orbit.period, Set::COMMON).map(Some)
            }
            (None, Classification::Undecided | Classification::Unbounded) => Ok(None),
            (None, _) => measure(model, &met.state, self.options.periods, Set::COMMON).map(Some),
        };
        let (classification, observables, reason) = match seen {
            Ok(Some(seen)) => (met.classification, Some(seen), None),
            Ok(None) => (met.classification, None, Some(met.evidence)),
            Err(error) => (Classification::Undecided, None, Some(error.to_string())),
        };
        let view = self.case.physical();
        ApproachPoint {
            way,
            gap,
            zc: view.map(|view| gap * view.scales.length),
            classification,
            period: met.orbit.as_ref().map(|orbit| orbit.period),
            spectral_radius: met.orbit.as_ref().map(PeriodicOrbit::spectral_radius),
            physical: observables
                .as_ref()
                .zip(view)
                .map(|(seen, view)| PhysicalMotion::of(seen, view)),
            observables,
            reason,
            modulation: None,
            modulation_si: None,
            orbit: met.orbit,
        }
    }
}

/// A motion as it was found.
struct Met {
    classification: Classification,
    evidence: String,
    orbit: Option<PeriodicOrbit>,
    state: Vec<f64>,
}

impl ApproachPoint {
    /// The orbit whose branch is followed, where the motion is one.
    fn seed(&self) -> Option<Seed> {
        Some((self.gap, self.orbit.clone()?))
    }
}

/// How branches are followed.
fn branching(key: Key, (from, to): (f64, f64), options: &ApproachOptions) -> BranchOptions {
    BranchOptions {
        doublings: options.doublings,
        max_multiplier: STRONGEST,
        ..BranchOptions::over(key, from, to)
    }
}

/// Growth of disturbances over a period beyond which an orbit is no part of what is met: near the
/// snap-in of an attractive sample unstable branches reach 10⁶, in ever shorter steps.
const STRONGEST: f64 = 1e4;

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

fn returned(table: &[ApproachPoint], free_amplitude: f64) -> bool {
    table
        .first()
        .zip(table.last())
        .is_some_and(|(first, last)| difference(first, last, free_amplitude).is_none())
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

/// What an approach curve is asked for.
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
    /// Distances each way
    #[schemars(range(min = 2, max = MOST_DISTANCES), extend("x-value" = "P"))]
    pub points: usize,
    /// Also continue the branches that coexist, stable and unstable
    #[schemars(extend("x-no" = "Only follow the motion: continue no branches"))]
    pub branches: bool,
    /// Doublings of branches to follow
    #[schemars(range(min = 0, max = MOST_DOUBLINGS), extend("x-value" = "DEPTH"))]
    pub switch: usize,
    /// Longest period looked for
    #[schemars(range(min = 1, max = MOST_PERIOD), extend("x-value" = "N"))]
    pub max_period: usize,
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
        Ok(ApproachOptions {
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
            ApproachError::Model(error) => error.clone().into(),
            ApproachError::Branch(error) => error.clone().into(),
            ApproachError::Held(error) => error.clone().into(),
        }
    }
}
