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
//! Limits: branches that no motion of approach or retract lies on are not found.

pub(crate) mod distance_sweep;
mod frames;
pub(crate) mod quasistatic;
mod ramp;

use nanotap_case::physical::Remark;
use nanotap_dynamics::{ContinuationOptions, Control, PeriodicOrbit};
use nanotap_figures::Figure;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::branch::{BranchOptions, BranchReport};
use crate::figure::approach::approach_figure;
use crate::frequency_modulation::{
    FrequencyModulationOptions, Modulated, ModulatedInSi, ModulationReport, frequency_modulation,
};
use crate::simulate::Classification;
use distance_sweep::FoundMotion;
use nanotap_case::physical::Kind;
use nanotap_case::units::{NumbersInSi, Units};
use nanotap_case::{Case, Key, ParameterUnit};
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_observe::frame::Frame;
use nanotap_observe::{Clearance, ObservableSet, Observables, PhysicalMotion, measure};
use nanotap_study::FreeMotion;
use nanotap_study::Study;
use nanotap_study::limits::{MAX_DISTANCES, MAX_DOUBLINGS, MAX_PERIOD};
use nanotap_study::request::options;
use nanotap_study::value::{Amount, implied};
pub use quasistatic::{states_at, states_near};

/// Where the default curve begins, in units of the tip's free reach: far enough to see the
/// free motion, and branches that reach beyond it.
pub(crate) const BEYOND: f64 = 1.25;
/// Largest first distance of a sample that acts in contact only, in reaches of the free tip: a
/// farther one takes its number of steps and shows nothing.
const MAX_REACHES: f64 = 1e3;

/// Amplitude at which a curve with a constant least distance ends, as a fraction of its first one.
const LEAST_AMPLITUDE: f64 = 0.02;

/// Direction in which the sample moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// The sample moves towards the tip.
    Approach,
    /// The sample moves away from the tip.
    Retract,
    /// Neither direction: an attractor found at a neighbouring distance that exists at this one
    /// too.
    Neither,
}

impl Way {
    /// Returns the name in documents: `approach`, `retract` or `neither`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Approach => "approach",
            Self::Retract => "retract",
            Self::Neither => "neither",
        }
    }
}

/// The motion at one distance in one direction.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ApproachPoint {
    /// Direction in which the sample moves.
    pub way: Way,
    /// The distance, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub gap: f64,
    /// The distance in m, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub zc: Option<f64>,
    /// Class of the motion at this distance, such as periodic or chaotic.
    pub classification: Classification,
    /// Minimal period in drive periods, if periodic.
    pub period: Option<usize>,
    /// Largest modulus of the Floquet multipliers, dimensionless. `None` unless the motion is
    /// periodic.
    pub spectral_radius: Option<f64>,
    /// Observables in the model's units; none if undecided or unbounded.
    #[serde(flatten)]
    pub observables: Option<Observables>,
    /// The same in SI, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalMotion>,
    /// Reason why the motion is undecided; `None` of other motions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Results of frequency modulation, where amplitude and phase are kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modulation: Option<Modulated>,
    /// The same in SI, of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modulation_si: Option<ModulatedInSi>,
    /// Periodic orbit of the motion with its multipliers; `None` of other motions.
    #[serde(skip)]
    pub orbit: Option<PeriodicOrbit>,
}

impl ApproachPoint {
    /// Describes a motion of `case` in one direction at one distance, in the model's unit of
    /// length.
    pub(crate) fn new(
        case: &Case,
        (way, gap): (Way, f64),
        classification: Classification,
        observables: Option<&Observables>,
        orbit: Option<PeriodicOrbit>,
    ) -> Self {
        let view = case.physical();
        Self {
            way,
            gap,
            zc: view.map(|view| gap * view.scales.length),
            classification,
            period: orbit.as_ref().map(|orbit| orbit.period),
            spectral_radius: orbit.as_ref().map(PeriodicOrbit::spectral_radius),
            physical: observables
                .zip(view)
                .map(|(seen, view)| PhysicalMotion::of(seen, view)),
            observables: observables.copied(),
            reason: None,
            modulation: None,
            modulation_si: None,
            orbit,
        }
    }
}

/// A jump of a slowly moved lever from one motion to another.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct StateJump {
    /// Direction in which the sample moves at the jump.
    pub way: Way,
    /// Distance, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub gap: f64,
    /// Distance in m, for a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub zc: Option<f64>,
    /// Uncertainty of the distance, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub uncertainty: f64,
    /// Uncertainty of the distance in m, for a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub zc_uncertainty: Option<f64>,
    /// What ends the motion before the jump: fold, flip, neimark-sacker, grazing, crossing, or a
    /// sentence.
    pub reason: String,
    /// The motion before the jump, at its end.
    pub before: ApproachPoint,
    /// The motion after the jump.
    pub after: ApproachPoint,
}

/// An interval of distances in which approach and retract show different motions.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Hysteresis {
    /// Nearest distance of the interval, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub near: f64,
    /// Farthest distance of the interval, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub far: f64,
    /// Largest difference between approach and retract in the interval. It is that of the amplitude
    /// at the drive frequency, in the model's unit of length, or, where the amplitude is kept
    /// constant, that of the relative frequency shift, dimensionless.
    pub difference: f64,
    /// The lengths in SI, for a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<NumbersInSi>,
}

impl Hysteresis {
    /// The same with its lengths in SI too.
    fn in_si(self, units: &Units, keeps_amplitude: bool) -> Self {
        let difference = if keeps_amplitude {
            Kind::Number
        } else {
            Kind::Length
        };
        let ends = [
            ("near", Kind::Length, self.near),
            ("far", Kind::Length, self.far),
        ];
        let mut physical = units.in_si(ends);
        if let Some(numbers) = &mut physical {
            numbers.insert("difference", units.scaled(difference, self.difference));
        }
        Self { physical, ..self }
    }
}

/// Approach and retract curves, with the branches behind them.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ApproachReport {
    /// The key of the distance in a case file.
    pub parameter: &'static str,
    /// First and farthest distance of the approach, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub from: f64,
    /// Distance at which the approach turns back, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub to: f64,
    /// Free amplitude A₀ of the tip at the drive frequency, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub free_amplitude: f64,
    /// Phase lag of the free tip behind the drive, degrees in (−180, 180].
    #[schemars(extend("x-unit" = "degree"))]
    pub free_phase: f64,
    /// Distance at which the free motion begins to touch the sample, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub free_reach: f64,
    /// The motions at the requested distances: those of the approach, then those of the retract.
    pub table: Vec<ApproachPoint>,
    /// Jumps of the lever from one motion to another, in order.
    pub jumps: Vec<StateJump>,
    /// Stable orbits at these distances that neither approach nor retract reaches, by descending
    /// distance. They lie on stretches of stable orbits of which approach or retract reaches other
    /// distances.
    pub coexisting: Vec<ApproachPoint>,
    /// Least height of the beam above the sample in the motion at the nearest distance, in the
    /// model's unit of length: where it is not above zero, another part than the tip touches.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub beam_clearance: Option<f64>,
    /// Intervals in which approach and retract differ, with ends as exact as those of the branches.
    pub hysteresis: Vec<Hysteresis>,
    /// Whether approach and retract were compared at all distances. If not, as where the motions are
    /// chaotic or undecided, they may differ at others than those of `hysteresis`.
    pub compared: bool,
    /// Whether the retract ends in the motion with which the approach began; if not, the approach
    /// began too near.
    pub returned: bool,
    /// Branches through the periodic motions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub branches: Option<BranchReport>,
    /// Whether the work was stopped before it was done.
    pub cancelled: bool,
    /// Budgets of steps that were spent, with what is missing for that reason.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<String>,
    /// For a physical case, the factor from distances to m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter_unit: Option<ParameterUnit>,
    /// The lengths in SI, for a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<NumbersInSi>,
    /// Frequency modulation, where amplitude and phase are kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modulation: Option<ModulationReport>,
}

impl ApproachReport {
    /// What is missing, and where the model does not hold.
    pub(crate) fn remarks(&self) -> Vec<Remark> {
        let touches = self.beam_clearance.is_some_and(|height| height <= 0.0);
        let touches = touches.then(|| {
            Remark::warning(
                "at the nearest distance another part of the beam than the tip would pass through the sample: the \
                 model does not hold there",
            )
        });
        let limits = Remark::warnings(&self.limits).into_iter();
        limits.chain(touches).collect()
    }
}

/// Computes an approach and retract curve.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::case::physical::Catalogue;
/// use nanotap::control::Control;
/// use nanotap::study::approach::{ApproachOptions, approach};
/// use std::path::Path;
///
/// let file = Path::new("../../docs/cases/stiff-lever.toml");
/// let case = Case::load(Some(file), &[], &Catalogue::shared())?;
/// let curve = approach(&case, &ApproachOptions::default(), &Control::default())?;
/// let to_metres = curve.parameter_unit.map_or(1.0, |unit| unit.si);
/// let ends = [curve.hysteresis[0].near, curve.hysteresis[0].far].map(|zc| to_metres * zc);
/// // Two motions exist between 19.97 nm and 23.17 nm (docs/cases/approach-curve.md).
/// assert!((ends[0] - 19.974e-9).abs() < 2e-12 && (ends[1] - 23.170e-9).abs() < 2e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the options are invalid for the case.
pub fn approach(
    case: &Case,
    options: &ApproachOptions,
    control: &Control<'_>,
) -> Result<ApproachReport, Error> {
    options.check()?;
    if options.fm {
        return frequency_modulation(case, &options.modulation(), control);
    }
    let key = case.gap_key();
    let distance = |option, given: &Option<_>| implied(case, key, option, given.as_ref());
    let speed = options.speed.as_ref();
    let speed = speed.map(|amount| speed_of(case, amount)).transpose()?;
    let distances = Distances {
        from: distance("from", &options.from)?,
        to: distance("to", &options.to)?,
        points: options.points,
        closest: None,
    };
    let free = FreeMotion::of(&case.model()?);
    let distances = distances.values(case, &free)?;
    let (from, to) = (distances[0], distances[distances.len() - 1]);
    let curve = Curve {
        case,
        options,
        speed,
    };
    let mut found = quasistatic::followed_curve(&curve, &free, &distances, control)?;
    if let Some(exact) = distances_in_si(case, options, [from, to])? {
        // The requested distances, not these in the model's units and back: curves of
        // different levers have the same ones.
        for row in &mut found.table {
            if let Some(k) = distances.iter().position(|gap| *gap == row.gap) {
                row.zc = Some(exact[k]);
            }
        }
    }
    let report = ApproachReport {
        parameter: key.path(),
        from,
        to,
        free_amplitude: free.amplitude,
        free_phase: free.phase,
        free_reach: free.reach,
        beam_clearance: beam_clearance(case, &found.table),
        hysteresis: found.hysteresis,
        compared: found.compared,
        returned: returned(&found.table, speed, free.amplitude),
        table: found.table,
        jumps: found.jumps,
        coexisting: found.coexisting,
        branches: found.branches,
        cancelled: control.is_cancelled(),
        limits: found.limits,
        parameter_unit: case.parameter_unit(key),
        physical: None,
        modulation: None,
    };
    Ok(report.in_si(&case.units()))
}

/// The distances of a physical case in m, from the ends as they are given; `ends` are in the model's
/// unit of length.
fn distances_in_si(
    case: &Case,
    options: &ApproachOptions,
    ends: [f64; 2],
) -> Result<Option<Vec<f64>>, Error> {
    let Some(unit) = case.units().si(Kind::Length) else {
        return Ok(None);
    };
    let end = |option, given: &Option<Amount>, end: f64| match given {
        Some(given) => Ok(implied(case, Key::GapTip, option, Some(given))?.unwrap_or(end * unit)),
        None => Ok::<f64, Error>(end * unit),
    };
    let from = end("from", &options.from, ends[0])?;
    let to = end("to", &options.to, ends[1])?;
    let last = (options.points - 1) as f64;
    let even = |k| even(from, to, k as f64 / last);
    Ok(Some((0..options.points).map(even).collect()))
}

/// The number at a `share` of the way, exact at both ends.
fn even(from: f64, to: f64, share: f64) -> f64 {
    from * (1.0 - share) + to * share
}

impl ApproachReport {
    /// The same with its lengths in SI too.
    pub(crate) fn in_si(mut self, units: &Units) -> Self {
        self.physical = units.in_si([
            ("from", Kind::Length, self.from),
            ("to", Kind::Length, self.to),
            ("free_amplitude", Kind::Length, self.free_amplitude),
            ("free_reach", Kind::Length, self.free_reach),
        ]);
        if let (Some(numbers), Some(height)) = (&mut self.physical, self.beam_clearance) {
            numbers.insert("beam_clearance", units.scaled(Kind::Length, height));
        }
        let keeps_amplitude = self.modulation.is_some();
        let intervals = std::mem::take(&mut self.hysteresis).into_iter();
        self.hysteresis = intervals
            .map(|interval| interval.in_si(units, keeps_amplitude))
            .collect();
        self
    }
}

/// The distances of a curve, in the model's unit of length.
pub(crate) struct Distances {
    /// The first; `None`: 1.25 times the tip's free reach.
    pub(crate) from: Option<f64>,
    /// The last; `None`: 0, where the sample is at the tip's rest position.
    pub(crate) to: Option<f64>,
    /// Number of distances, both ends included; at least 2 are needed.
    pub(crate) points: usize,
    /// Least distance of the oscillation, if it is kept constant.
    pub(crate) closest: Option<f64>,
}

impl Distances {
    /// The distances from far to near.
    ///
    /// # Errors
    /// When there are fewer than two, or they do not descend.
    pub(crate) fn values(&self, case: &Case, free: &FreeMotion) -> Result<Vec<f64>, Error> {
        let closest = self.closest;
        let shown = |distance| case.shown(case.gap_key(), distance);
        if self.points < 2 {
            return Err(Error::input(
                format!(
                    "{} distances make no curve: at least 2 are needed",
                    self.points
                ),
                "give {points} 80",
            ));
        }
        if self.from.is_none() && !(free.reach > 0.0 && free.reach.is_finite()) {
            return Err(Error::input(
                "the drive does not move the tip, so that no distance says where the curve should \
                 begin; give it",
                "give {from}",
            ));
        }
        let from = self.from.unwrap_or(BEYOND * free.reach);
        let to = match (self.to, closest) {
            (Some(to), _) => to,
            (None, Some(closest)) => closest + LEAST_AMPLITUDE * (from - closest),
            (None, None) => 0.0,
        };
        if !(from.is_finite() && to.is_finite() && from > to) {
            return Err(Error::input(
                format!(
                    "an approach goes from far to near: it cannot go from {} to {}; the first \
                     distance must be the greater, both finite",
                    shown(from),
                    shown(to)
                ),
                "change {from} or {to}",
            ));
        }
        let reach = free.reach.max(to.abs());
        if reach > 0.0 && from > MAX_REACHES * reach && case.model()?.nonlinear.is_none() {
            return Err(Error::input(
                format!(
                    "the first distance is {}, but nothing acts on the tip beyond {}: it may be at \
                     most {MAX_REACHES} times as far",
                    shown(from),
                    shown(reach)
                ),
                "leave out {from}, or give its unit",
            ));
        }
        if let Some(closest) = closest
            && (to <= closest || !closest.is_finite())
        {
            return Err(Error::input(
                format!(
                    "an oscillation that comes as near as {} has no amplitude at the distance {}: \
                     the last distance must be the greater",
                    shown(closest),
                    shown(to)
                ),
                "change {to} or {closest}",
            ));
        }
        let last = (self.points - 1) as f64;
        // Amplitudes at a fixed least distance are in equal ratios.
        let between = |share: f64| match closest {
            Some(closest) if share > 0.0 && share < 1.0 => {
                let ratio = (to - closest) / (from - closest);
                closest + (from - closest) * nanotap_arithmetic::powf(ratio, share)
            }
            _ => even(from, to, share),
        };
        Ok((0..self.points).map(|k| between(k as f64 / last)).collect())
    }
}

/// Distances and speed of a curve.
struct Curve<'a> {
    case: &'a Case,
    options: &'a ApproachOptions,
    /// Speed of the sample, in the model's unit of length per unit of time; `None`: so slow that
    /// the lever settles at each distance.
    speed: Option<f64>,
}

/// Drive periods recorded of a motion that is not periodic.
const RECORDED_PERIODS: usize = 256;

impl Curve<'_> {
    /// A motion as a line of the table.
    fn observed(&self, way: Way, gap: f64, model: &Model, motion: FoundMotion) -> ApproachPoint {
        let seen = match (&motion.orbit, motion.classification) {
            (Some(orbit), _) => {
                let start = orbit.states.first().map_or(&[][..], Vec::as_slice);
                measure(model, start, orbit.period, ObservableSet::COMMON).map(Some)
            }
            (None, Classification::Undecided | Classification::Unbounded) => Ok(None),
            (None, _) => measure(
                model,
                &motion.state,
                RECORDED_PERIODS,
                ObservableSet::COMMON,
            )
            .map(Some),
        };
        let (classification, observables, reason) = match seen {
            Ok(Some(seen)) => (motion.classification, Some(seen), None),
            Ok(None) => (motion.classification, None, Some(motion.evidence)),
            Err(error) => (Classification::Undecided, None, Some(error.to_string())),
        };
        ApproachPoint {
            reason,
            ..ApproachPoint::new(
                self.case,
                (way, gap),
                classification,
                observables.as_ref(),
                motion.orbit,
            )
        }
    }
}

/// Returns the options with which the branches of a curve are continued.
fn branching(options: &ApproachOptions) -> BranchOptions {
    BranchOptions {
        switch: Some(options.switch),
        stable_doublings: true,
        max_multiplier: MAX_MULTIPLIER,
        max_step: ContinuationOptions::over(0.0, 1.0).max_step,
        ..BranchOptions::default()
    }
}

/// Growth of disturbances over a period beyond which an unstable branch is left: near the snap-in
/// of an attractive sample it reaches 10⁶, in ever shorter steps.
pub(crate) const MAX_MULTIPLIER: f64 = 1e4;

/// Longest period looked for on the way to a setpoint.
pub(crate) const SETPOINT_PERIODS: usize = 32;

/// Relative difference of amplitudes that is no longer rounding.
const DIFFERENT: f64 = 1e-6;

/// The intervals in which the two ways differ; `difference` says by how much two points do.
pub(crate) fn hysteresis(
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
                    physical: None,
                }),
            }
        }
        open = difference.is_some();
    }
    intervals
}

/// The beam's clearance at the nearest distance on the way there.
pub(crate) fn beam_clearance(case: &Case, table: &[ApproachPoint]) -> Option<f64> {
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

/// Difference of amplitudes, as a fraction of the free amplitude, within which a lever that is
/// moved fast has returned to its first motion.
const RETURNED: f64 = 1e-2;

fn returned(table: &[ApproachPoint], speed: Option<f64>, free_amplitude: f64) -> bool {
    let ends = table.first().zip(table.last());
    ends.is_some_and(|(first, last)| {
        let apart = difference(first, last, free_amplitude);
        apart.is_none() || speed.is_some() && apart.is_some_and(|a| a <= RETURNED * free_amplitude)
    })
}

/// Returns the difference of the amplitudes of two motions at one distance; `None` if they are the
/// same motion as far as is known. Recordings of one chaotic band never agree exactly: amplitudes
/// are compared only where both motions are periodic, otherwise the class is.
fn difference(a: &ApproachPoint, b: &ApproachPoint, free_amplitude: f64) -> Option<f64> {
    let (x, y) = (a.observables.as_ref()?, b.observables.as_ref()?);
    let amplitudes = (x.first_harmonic - y.first_harmonic).abs();
    let periodic = a.period.is_some() && b.period.is_some();
    let differ = a.classification != b.classification
        || a.period != b.period
        || (periodic && amplitudes > DIFFERENT * free_amplitude);
    differ.then_some(amplitudes)
}

options! {
    /// Options of an approach curve.
    pub struct ApproachOptions {
        /// First distance, in units of the case ("30 nm") or as alpha5; default: 1.25 times the
        /// free swing of the tip towards the sample
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub from: Option<Amount> = None,
        /// Last distance of the approach; default: 0
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub to: Option<Amount> = None,
        /// Number of distances in each direction. Under a nonlinear law the lever is followed for at
        /// most 30 million steps of the approximate flow, and as many more are taken for every 100
        /// distances; two evaluations of the force in the exact flow count as a step
        #[schemars(range(min = 2, max = MAX_DISTANCES), extend("x-value" = "P"))]
        pub points: usize = 80,
        /// Also continue coexisting branches, stable and unstable
        #[schemars(extend("x-no" = "Only follow the motion: continue no branches"))]
        pub branches: bool = true,
        /// Number of period doublings to follow, as far as their orbits are stable
        #[schemars(range(min = 0, max = MAX_DOUBLINGS), extend("x-value" = "DEPTH"))]
        pub switch: usize = 1,
        /// Longest period of orbits, in drive periods
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub max_period: usize = 32,
        /// Speed of approach and retract, in units of the case ("500 nm/s") or as alpha5 per unit
        /// of time: the distance changes each drive period; default: quasi-static
        #[schemars(extend("x-value" = "SPEED"))]
        pub speed: Option<Amount> = None,
        /// Frequency modulation: keep the amplitude (the free amplitude of the case) and phase
        /// constant by frequency and strength of the drive, and report the frequency shift
        pub fm: bool = false,
        /// Phase lag kept by frequency modulation, in degrees
        #[schemars(range(min = 0, max = 180), extend("x-value" = "DEGREES"))]
        pub phase: f64 = 90.0,
        /// Frequency shift whose distances to find under frequency modulation, in units of the case
        /// ("-50 Hz") or as omega
        #[schemars(extend("x-value" = "SHIFT"))]
        pub shift: Option<Amount> = None,
        /// Least distance of the oscillation kept by frequency modulation, in units of the case ("1
        /// nm") or as alpha5: the amplitude then changes with the distance
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub closest: Option<Amount> = None,
    }
}

impl ApproachOptions {
    fn check(&self) -> Result<(), Error> {
        let refused = |option, message, remedy| Err(Error::option(option, message, remedy));
        if self.shift.is_some() && !self.fm {
            return refused(
                "shift",
                "the frequency does not shift where the drive holds it",
                "add {fm}, which holds amplitude and phase instead",
            );
        }
        if self.closest.is_some() && !self.fm {
            return refused(
                "closest",
                "the least distance cannot be kept where nothing holds the amplitude",
                "add {fm}, which holds amplitude and phase",
            );
        }
        if self.speed.is_some() && self.fm {
            return refused(
                "speed",
                "frequency modulation follows orbits, at no finite speed",
                "leave away {fm} or {speed}",
            );
        }
        if self.max_period == 0 {
            return Err(Error::input(
                "no motion has the longest period 0: at least 1 is needed",
                "give a {max_period} of 1 or more",
            ));
        }
        Ok(())
    }

    /// Returns the options of frequency modulation that these options contain.
    fn modulation(&self) -> FrequencyModulationOptions {
        FrequencyModulationOptions {
            from: self.from.clone(),
            to: self.to.clone(),
            points: self.points,
            phase: self.phase,
            shift: self.shift.clone(),
            closest: self.closest.clone(),
        }
    }
}

/// Reads a speed, as it is given for a case, in the model's unit of length per unit of time.
///
/// # Errors
/// When it is not a finite speed above zero.
pub fn speed_of(case: &Case, amount: &Amount) -> Result<f64, Error> {
    let refused = |error: String| Error::option("speed", error, "write it as in \"500 nm/s\"");
    let (read, unit) = match case.physical() {
        Some(view) => (Kind::Velocity.parse(amount.text()), view.scales.velocity),
        None => (Kind::Number.parse(amount.text()), 1.0),
    };
    let speed = read.map_err(|error| refused(error.to_string()))? / unit;
    if speed > 0.0 && speed.is_finite() {
        return Ok(speed);
    }
    Err(refused(format!(
        "expected a finite speed above zero, got {amount}"
    )))
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
    type Options = ApproachOptions;
    type Report = ApproachReport;

    fn frames<'a>(case: &Case, report: &'a ApproachReport) -> Vec<Frame<'a>> {
        report.tables(case.units())
    }

    fn figure(case: &Case, report: &ApproachReport) -> Option<Figure> {
        Some(approach_figure(report, &case.units()))
    }

    fn remarks(_: &Case, report: &ApproachReport) -> Vec<Remark> {
        report.remarks()
    }

    fn compute(
        case: &Case,
        options: &ApproachOptions,
        control: &Control<'_>,
    ) -> Result<ApproachReport, Error> {
        approach(case, options, control)
    }
}
