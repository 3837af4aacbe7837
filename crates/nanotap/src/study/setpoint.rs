//! The distance at which the amplitude has its setpoint: what the feedback loop finds.
//!
//! All branches of an approach curve are searched for the setpoint amplitude A_set (of the
//! first harmonic, as a lock-in amplifier reads it). Each crossing is closed by Newton at
//! distances chosen by regula falsi, so that every solution is an orbit with its multipliers.
//! The feedback comes from far: it stops at the first distance on the approach at which the
//! followed motion's amplitude falls to A_set. Where the amplitude jumps past A_set instead,
//! or the motion there is not periodic, nothing is chosen and the reason is given.
//!
//! Fails by omission: solutions on branches that no motion of the curve lies on.

use nanotap_dynamics::{Control, PeriodicOrbit, ShootingOptions, close_orbit_from_points};
use serde::Serialize;

use super::approach::{
    ApproachError, ApproachOptions, ApproachPoint, ApproachReport, Way, approach,
};
use crate::case::Case;
use crate::case::document::CaseDocument;
use crate::case::physical::{Kind, Remark};
use crate::model::strobe::Strobe;
use crate::observe::{Observables, OutOfRange, PhysicalMotion, Set, measure};
use crate::study::branch::PointReport;

/// Why no distance was chosen.
#[derive(Clone, Debug, thiserror::Error)]
pub enum SetpointError {
    /// The case has no setpoint.
    #[error("the case has no setpoint: give drive.setpoint, as in setpoint = 0.8")]
    None,
    /// There is no curve.
    #[error(transparent)]
    Approach(#[from] ApproachError),
    /// The amplitude never falls so far.
    #[error(
        "the setpoint A/A0 = {ratio} is not reached on the way to the sample's own position \
         (gap.tip = 0), where A/A0 is {least:.3}; raise drive.setpoint, or give gap.tip"
    )]
    NotReached {
        /// The setpoint.
        ratio: f64,
        /// The least amplitude on the way, over A₀.
        least: f64,
    },
    /// The amplitude jumps past the setpoint.
    #[error(
        "on approach the amplitude jumps past the setpoint A/A0 = {ratio}: from {before:.3} to \
         {after:.3} of A0 between gap.tip = {from} and {to}; change drive.setpoint, or give gap.tip"
    )]
    Jump {
        /// The setpoint.
        ratio: f64,
        /// Amplitude before the jump, over A₀.
        before: f64,
        /// Amplitude after it.
        after: f64,
        /// Distance before it.
        from: String,
        /// Distance after it.
        to: String,
    },
    /// The motion has no one amplitude there.
    #[error(
        "on approach the motion is {what} at gap.tip = {at}, before the setpoint A/A0 = {ratio} \
         is reached: it has no amplitude to hold; change drive.setpoint, or give gap.tip"
    )]
    NotPeriodic {
        /// What it is.
        what: &'static str,
        /// Where.
        at: String,
        /// The setpoint.
        ratio: f64,
    },
    /// The work was stopped.
    #[error("stopped before the setpoint was solved for")]
    Cancelled,
}

/// One distance at which an orbit has the setpoint amplitude.
#[derive(Clone, Debug, Serialize)]
pub struct SetpointSolution {
    /// The distance, in the model's unit of length.
    pub gap: f64,
    /// The distance in m.
    pub zc: f64,
    /// Period of the orbit.
    pub period: usize,
    /// Whether it attracts.
    pub stable: bool,
    /// Largest |multiplier|.
    pub spectral_radius: f64,
    /// Whether the approach stops here.
    pub reached: bool,
    /// State at drive phase 0.
    pub state: Vec<f64>,
    /// What it looks like.
    #[serde(flatten)]
    pub observables: Observables,
    /// The same in SI.
    pub physical: PhysicalMotion,
}

/// The setpoint solved for the distance.
#[derive(Clone, Debug, Serialize)]
pub struct SetpointReport {
    /// A_set/A₀.
    pub ratio: f64,
    /// A_set in m.
    pub amplitude: f64,
    /// All distances at which an orbit has this amplitude, the farthest first.
    pub solutions: Vec<SetpointSolution>,
    /// Which of them the approach reaches.
    pub chosen: usize,
}

impl SetpointReport {
    /// The distance that the approach reaches, in m.
    pub fn zc(&self) -> f64 {
        self.solutions.get(self.chosen).map_or(f64::NAN, |s| s.zc)
    }

    /// What was solved, in a sentence.
    pub fn remark(&self) -> Remark {
        let others = self.solutions.len() - 1;
        let stable = self
            .solutions
            .iter()
            .filter(|s| !s.reached && s.stable)
            .count();
        let more = match others {
            0 => String::new(),
            _ => format!(
                "; {others} more orbit{} with this amplitude, {stable} of them stable, at {}",
                if others == 1 { "" } else { "s" },
                self.solutions
                    .iter()
                    .filter(|s| !s.reached)
                    .map(|s| Kind::Length.format(s.zc))
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        };
        Remark::note(format!(
            "the setpoint A = {} (A/A0 = {}) is reached on approach at gap.tip = {}{more}",
            Kind::Length.format(self.amplitude),
            Kind::Number.format(self.ratio),
            Kind::Length.format(self.zc()),
        ))
    }
}

/// Distances of the curve that is searched.
const POINTS: usize = 60;

/// Solves the setpoint of a physical case for the distance.
///
/// # Errors
/// [`SetpointError`] when there is none to solve, or none is reached on approach.
pub fn solve_setpoint(case: &Case, control: &Control<'_>) -> Result<SetpointReport, SetpointError> {
    let view = case.physical().ok_or(SetpointError::None)?;
    let ratio = view.setpoint.ok_or(SetpointError::None)?;
    let options = ApproachOptions {
        points: POINTS,
        ..ApproachOptions::default()
    };
    let curve = approach(case, &options, control)?;
    if curve.cancelled {
        return Err(SetpointError::Cancelled);
    }
    let target = ratio * curve.free_amplitude;
    let (before, after) = bracket(&curve, ratio, target)?;
    let mut solutions = all_solutions(case, &curve, target);
    // The map may have ended one that was being solved for.
    if control.is_cancelled() {
        return Err(SetpointError::Cancelled);
    }
    // What the approach reaches lies between two of its distances, on a branch that attracts.
    let step = before.gap - after.gap;
    let reached = solutions
        .iter()
        .enumerate()
        .filter(|(_, s)| {
            s.stable
                && s.gap <= before.gap + 1e-9 * step
                && s.gap >= after.gap - 1e-9 * step
                && Some(s.period) == after.period
        })
        .max_by(|a, b| a.1.gap.total_cmp(&b.1.gap))
        .map(|(k, _)| k);
    let amplitude = |p: &ApproachPoint| {
        p.observables
            .map_or(f64::NAN, |s| s.first_harmonic / curve.free_amplitude)
    };
    let Some(chosen) = reached else {
        return Err(SetpointError::Jump {
            ratio,
            before: amplitude(before),
            after: amplitude(after),
            from: told(before),
            to: told(after),
        });
    };
    solutions[chosen].reached = true;
    Ok(SetpointReport {
        ratio,
        amplitude: ratio * view.free_amplitude,
        solutions,
        chosen,
    })
}

/// The case at the distance where its setpoint is reached, and how that was found; a case
/// that does not leave its distance to a setpoint stays as it is.
///
/// # Errors
/// As [`solve_setpoint`].
pub fn at_setpoint(
    case: Case,
    control: &Control<'_>,
) -> Result<(Case, Option<SetpointReport>), SetpointError> {
    if !case.leaves_distance_to_setpoint() {
        return Ok((case, None));
    }
    let report = solve_setpoint(&case.cancelled_by(control), control)?;
    let there = case.at_distance(report.zc(), report.remark());
    let there = there.map_err(|error| ApproachError::Model(Box::new(error).into()))?;
    Ok((there, Some(report)))
}

/// A case as a document, with how its setpoint was solved for the distance.
#[derive(Clone, Debug, Serialize)]
pub struct SolvedCase {
    /// The case.
    #[serde(flatten)]
    pub case: CaseDocument,
    /// How its setpoint was solved, if it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub setpoint_solved: Option<SetpointReport>,
    /// What of the range of a nonlinear force law the undriven lever leaves where it rests.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub out_of_range: Vec<OutOfRange>,
}

impl SolvedCase {
    /// The document of a case at its setpoint.
    pub fn of(case: &Case, setpoint_solved: Option<SetpointReport>) -> Self {
        let model = case.model();
        Self {
            case: CaseDocument::of(case),
            setpoint_solved,
            out_of_range: model.map_or_else(|_| Vec::new(), |model| OutOfRange::at_rest(&model)),
        }
    }
}

/// The distance of a point in words.
fn told(point: &ApproachPoint) -> String {
    point
        .zc
        .map_or_else(|| point.gap.to_string(), |zc| Kind::Length.format(zc))
}

/// The points of the approach between which the amplitude first falls to the target.
fn bracket(
    curve: &ApproachReport,
    ratio: f64,
    target: f64,
) -> Result<(&ApproachPoint, &ApproachPoint), SetpointError> {
    let there: Vec<&ApproachPoint> = curve
        .table
        .iter()
        .filter(|p| p.way == Way::Approach)
        .collect();
    let mut least = f64::INFINITY;
    for pair in there.windows(2) {
        let (before, after) = (pair[0], pair[1]);
        let Some(observables) = after.observables.filter(|_| after.period.is_some()) else {
            return Err(SetpointError::NotPeriodic {
                what: after.classification.name(),
                at: told(after),
                ratio,
            });
        };
        least = least.min(observables.first_harmonic);
        if observables.first_harmonic <= target {
            return Ok((before, after));
        }
    }
    Err(SetpointError::NotReached {
        ratio,
        least: least / curve.free_amplitude,
    })
}

/// Every crossing of the target on every branch, the farthest first.
fn all_solutions(case: &Case, curve: &ApproachReport, target: f64) -> Vec<SetpointSolution> {
    let Some(branches) = &curve.branches else {
        return Vec::new();
    };
    let mut found: Vec<SetpointSolution> = Vec::new();
    for pair in branches.points.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        let excess = |p: &PointReport| p.observables.first_harmonic - target;
        if a.branch != b.branch || (excess(a) > 0.0) == (excess(b) > 0.0) {
            continue;
        }
        if let Some(solution) = crossing(case, a, b, target) {
            let near = 1e-9 * curve.free_reach.max(solution.gap.abs());
            let known = |s: &SetpointSolution| {
                s.period == solution.period
                    && (s.gap - solution.gap).abs() <= near
                    && (s.observables.phase - solution.observables.phase).abs() < 1e-4
            };
            if !found.iter().any(known) {
                found.push(solution);
            }
        }
    }
    found.sort_by(|a, b| b.gap.total_cmp(&a.gap));
    found
}

/// Steps of regula falsi at most.
const STEPS: usize = 60;

/// The orbit between two points of a branch that has the target amplitude.
fn crossing(
    case: &Case,
    a: &PointReport,
    b: &PointReport,
    target: f64,
) -> Option<SetpointSolution> {
    let view = case.physical()?;
    let (mut low, mut high) = (
        (0.0, a.observables.first_harmonic),
        (1.0, b.observables.first_harmonic),
    );
    let mut closed: Option<(f64, PeriodicOrbit, Observables)> = None;
    for _ in 0..STEPS {
        // The curve is nearly straight between two points of a branch.
        let slope = (high.1 - low.1) / (high.0 - low.0);
        let middle = low.0 + (target - low.1) / slope;
        let t = if middle.is_finite() && middle > low.0 && middle < high.0 {
            middle
        } else {
            0.5 * (low.0 + high.0)
        };
        let (gap, orbit, observables) = orbit_between(case, a, b, t)?;
        let value = observables.first_harmonic;
        closed = Some((gap, orbit, observables));
        if (value - target).abs() <= 1e-12 * target.abs() || high.0 - low.0 < 1e-14 {
            break;
        }
        if (value > target) == (low.1 > target) {
            low = (t, value);
        } else {
            high = (t, value);
        }
    }
    let (gap, orbit, observables) = closed?;
    // Where a fold lies between the points, Newton may have closed the other orbit.
    if (observables.first_harmonic - target).abs() > 1e-6 * target.abs() {
        return None;
    }
    Some(SetpointSolution {
        gap,
        zc: gap * view.scales.length,
        period: orbit.period,
        stable: orbit.is_stable(),
        spectral_radius: orbit.spectral_radius(),
        reached: false,
        state: orbit.states.first().cloned().unwrap_or_default(),
        physical: PhysicalMotion::of(&observables, view),
        observables,
    })
}

/// The orbit at a share `t` of the way from one point of a branch to the next.
fn orbit_between(
    case: &Case,
    a: &PointReport,
    b: &PointReport,
    t: f64,
) -> Option<(f64, PeriodicOrbit, Observables)> {
    use nanotap_dynamics::StroboscopicMap as _;
    let gap = a.parameter + t * (b.parameter - a.parameter);
    let model = case.with(case.gap_key(), gap).model().ok()?;
    let mut map = Strobe::new(&model);
    let mut state: Vec<f64> = a
        .state
        .iter()
        .zip(&b.state)
        .map(|(x, y)| x + t * (y - x))
        .collect();
    let mut points = Vec::new();
    for _ in 0..a.period {
        points.extend_from_slice(&state);
        map.advance(&mut state).ok()?;
    }
    let orbit =
        close_orbit_from_points(&mut map, &points, a.period, &ShootingOptions::default()).ok()?;
    let start = orbit.states.first()?;
    let observables = measure(&model, start, orbit.period, Set::COMMON).ok()?;
    (orbit.period == a.period).then_some((gap, orbit, observables))
}

impl From<SetpointError> for crate::Error {
    fn from(error: SetpointError) -> Self {
        match error {
            SetpointError::Approach(error) => error.into(),
            SetpointError::Cancelled => Self::new(crate::ErrorKind::Stopped, error.to_string()),
            SetpointError::None => Self::input(error.to_string(), "give drive.setpoint"),
            other => Self::numerics(other.to_string()),
        }
    }
}
