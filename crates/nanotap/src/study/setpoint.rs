//! The distance at which the amplitude reaches its setpoint, as a feedback loop finds it.
//!
//! The feedback comes from far and slowly: the lever follows its branch of stable orbits, and
//! jumps where that ends (see [`approach`](super::approach)). It stops at the first distance at
//! which the amplitude of the first harmonic, as a lock-in amplifier reads it, has fallen to the
//! setpoint A_set. The orbit there is closed by Newton at distances chosen by regula falsi.
//! Where the amplitude jumps past A_set instead, or the motion there is not periodic, nothing is
//! chosen and the reason is given.
//!
//! Then the lever goes on to the sample's own position and back to the chosen distance: the other
//! stable orbits there are reported too, and, from the branches of all these continued round
//! their folds, the other orbits with the amplitude A_set.
//!
//! Fails by omission: orbits on other branches.

use nanotap_dynamics::{
    BranchPoint, ContinuationOptions, Control, DiagramOptions, PeriodicOrbit, ShootingOptions,
    assemble_diagram, close_orbit_from_points,
};
use rayon::prelude::*;
use serde::Serialize;

use super::FreeMotion;
use super::approach::distance_sweep::{DistanceSweep, Motion, Piece, budget_text, is_same};
use super::approach::{MAX_MULTIPLIER, SETPOINT_PERIODS, no_drive};
use crate::case::Case;
use crate::case::document::CaseDocument;
use crate::case::physical::{Kind, Remark};
use crate::model::model_map::ModelMap;
use crate::observe::table::shown_phase;
use crate::observe::{ObservableSet, Observables, OutOfRange, PhysicalMotion, measure};
use crate::{Error, ErrorKind};

/// A distance at which an orbit has the setpoint amplitude.
#[derive(Clone, Debug, Serialize)]
pub struct SetpointSolution {
    /// The distance, in the model's unit of length.
    pub gap: f64,
    /// The distance in m.
    pub zc: f64,
    /// Period of the orbit.
    pub period: usize,
    /// Whether it is stable.
    pub stable: bool,
    /// Largest |multiplier|.
    pub spectral_radius: f64,
    /// Whether the approach stops at this distance.
    pub reached: bool,
    /// State at drive phase 0.
    pub state: Vec<f64>,
    /// Observables in the model's units.
    #[serde(flatten)]
    pub observables: Observables,
    /// The same in SI.
    pub physical: PhysicalMotion,
}

/// Another stable orbit at the chosen distance.
#[derive(Clone, Debug, Serialize)]
pub struct SetpointState {
    /// Period in drive periods.
    pub period: usize,
    /// Largest |multiplier|.
    pub spectral_radius: f64,
    /// State at drive phase 0.
    pub state: Vec<f64>,
    /// Observables in the model's units.
    #[serde(flatten)]
    pub observables: Observables,
    /// The same in SI.
    pub physical: PhysicalMotion,
}

/// Solution of a setpoint for the distance.
#[derive(Clone, Debug, Serialize)]
pub struct SetpointReport {
    /// A_set/A₀.
    pub ratio: f64,
    /// A_set in m.
    pub amplitude: f64,
    /// All distances at which an orbit has this amplitude, from far to near.
    pub solutions: Vec<SetpointSolution>,
    /// Index of the one that the approach reaches.
    pub chosen: usize,
    /// Other stable orbits at the distance that the approach reaches.
    pub other_states: Vec<SetpointState>,
    /// Why other states may be missing, if the search for them ended at its budget.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<String>,
}

impl SetpointReport {
    /// The distance that the approach reaches, in m.
    pub fn zc(&self) -> f64 {
        self.solutions.get(self.chosen).map_or(f64::NAN, |s| s.zc)
    }

    /// The solution, in a sentence.
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
        let also: Vec<String> = self
            .other_states
            .iter()
            .map(|other| {
                format!(
                    "A = {}, phase {}°",
                    Kind::Length.format(other.physical.observables.first_harmonic),
                    Kind::Number.format_digits(shown_phase(other.observables.phase), 4)
                )
            })
            .collect();
        let bistable = if also.is_empty() {
            String::new()
        } else {
            format!(
                "; bistable: the lever may also be at {}",
                also.join(", or at ")
            )
        };
        let budget = self.budget.as_ref();
        let cut = budget.map_or_else(String::new, |reason| {
            format!("; other states may be missing: {reason}")
        });
        Remark::note(format!(
            "the setpoint A = {} (A/A0 = {}) is reached on approach at gap.tip = {}{more}{bistable}{cut}",
            Kind::Length.format(self.amplitude),
            Kind::Number.format(self.ratio),
            Kind::Length.format(self.zc()),
        ))
    }
}

/// Solves the setpoint of a physical case for the distance.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::case::physical::Catalogue;
/// use nanotap::control::Control;
/// use nanotap::study::setpoint::solve_setpoint;
/// use std::path::Path;
///
/// let file = Path::new("../../docs/cases/stiff-lever.toml");
/// let case = Case::load(Some(file), &[], &Catalogue::shared())?;
/// let report = solve_setpoint(&case, &Control::default())?;
/// // A = 0.8 A₀ at 15.20 nm (docs/cases/stiff-lever.md).
/// assert!((report.zc() - 15.201e-9).abs() < 2e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When there is none to solve, or none is reached on approach.
pub fn solve_setpoint(case: &Case, control: &Control<'_>) -> Result<SetpointReport, Error> {
    let none = || {
        Error::input(
            "the case has no setpoint: give drive.setpoint, as in setpoint = 0.8",
            "give drive.setpoint",
        )
    };
    let view = case.physical().ok_or_else(none)?;
    let ratio = view.setpoint.ok_or_else(none)?;
    let free = FreeMotion::of(&case.model()?);
    if !(free.reach > 0.0 && free.reach.is_finite()) {
        return Err(no_drive());
    }
    let target = ratio * free.amplitude;
    let mut search = Search {
        case,
        ratio,
        target,
        free,
        before: None,
        least: f64::INFINITY,
        found: None,
    };
    let range = (0.0, FARTHER * free.reach);
    let mut sweep = DistanceSweep::new(case, range, free.reach, SETPOINT_PERIODS, control)?;
    let place = sweep.free()?;
    // A motion that does not close ends the search.
    sweep.stops_on_grid = true;
    let (pieces, place) = sweep.way(place, 0.0, |sweep, piece| search.ends_in(sweep, piece));
    sweep.stops_on_grid = false;
    if control.is_cancelled() {
        return Err(cancelled());
    }
    if let Some(steps) = sweep.spent_budget() {
        return Err(Error::numerics(format!(
            "the setpoint A/A0 = {ratio} was not reached: {}, to gap.tip = {}; give gap.tip, or raise \
             drive.setpoint",
            budget_text(steps),
            search.shown(pieces.last().map_or(range.1, |piece| piece.to))
        )));
    }
    let reached = search.found.take().unwrap_or_else(|| {
        Err(Error::numerics(format!(
            "the setpoint A/A0 = {ratio} is not reached on the way to the sample's own position \
             (gap.tip = 0), where A/A0 is {:.3}; raise drive.setpoint, or give gap.tip",
            search.least / free.amplitude
        )))
    })?;
    // What a lever shows at this distance that comes from near.
    sweep.allow_steps(OTHERS_STEPS);
    let (_, place) = sweep.way(place, 0.0, |_, _| false);
    sweep.way(place, reached.gap, |_, _| false);
    let budget = sweep.spent_budget().map(budget_text);
    sweep.allow_steps(u64::MAX);
    let (mut solutions, other_states) = search.others(&sweep, &reached, control);
    if control.is_cancelled() {
        return Err(cancelled());
    }
    solutions.push(reached);
    solutions.sort_by(|a, b| b.gap.total_cmp(&a.gap));
    let chosen = solutions.iter().position(|s| s.reached).unwrap_or(0);
    Ok(SetpointReport {
        ratio,
        amplitude: ratio * view.free_amplitude,
        solutions,
        chosen,
        other_states,
        budget,
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
) -> Result<(Case, Option<SetpointReport>), Error> {
    if !case.leaves_distance_to_setpoint() {
        return Ok((case, None));
    }
    let report = solve_setpoint(&case.cancelled_by(control), control)?;
    let state = report.solutions.get(report.chosen).map(|s| s.state.clone());
    let there = case.at_distance(report.zc(), report.remark(), state.unwrap_or_default())?;
    Ok((there, Some(report)))
}

/// The error of a search that was cancelled.
fn cancelled() -> Error {
    Error::new(
        ErrorKind::Stopped,
        "stopped before the setpoint was solved for",
    )
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
    /// Excursions of the rest position beyond the range of a nonlinear force law.
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

/// Steps of the approximate flow after which other states at the setpoint are looked for no longer,
/// and which their branches may take.
const OTHERS_STEPS: u64 = 20_000_000;
/// Points to which each of these branches may always be followed.
const MIN_POINTS: usize = 16;

/// How much farther than the free tip swings the way begins.
const FARTHER: f64 = 2.0;

/// The search for the setpoint along the way from far.
struct Search<'a> {
    case: &'a Case,
    ratio: f64,
    /// The amplitude at the setpoint, in the model's unit.
    target: f64,
    free: FreeMotion,
    /// The distance and the amplitude last passed.
    before: Option<(f64, f64)>,
    least: f64,
    found: Option<Result<SetpointSolution, Error>>,
}

/// An orbit of a branch and its amplitude.
#[derive(Clone, Debug)]
struct Sample<'a> {
    gap: f64,
    orbit: &'a PeriodicOrbit,
    amplitude: f64,
}

/// Amplitude at the drive's frequency of an orbit at a distance; NaN where it cannot be measured.
fn amplitude(sweep: &DistanceSweep<'_>, gap: f64, orbit: &PeriodicOrbit) -> f64 {
    let start = orbit.states.first().map_or(&[][..], Vec::as_slice);
    let model = sweep.model(gap).ok();
    let seen =
        model.and_then(|m| measure(&m, start, orbit.period, ObservableSet::FIRST_HARMONIC).ok());
    seen.map_or(f64::NAN, |seen| seen.first_harmonic)
}

impl Search<'_> {
    /// The distance in words.
    fn shown(&self, gap: f64) -> String {
        self.case.physical().map_or_else(
            || gap.to_string(),
            |view| Kind::Length.format(gap * view.scales.length),
        )
    }

    /// Whether the search ends in a piece of the way.
    fn ends_in(&mut self, sweep: &DistanceSweep<'_>, piece: &Piece) -> bool {
        let stretch = match &piece.motion {
            Motion::Periodic(stretch) => *stretch,
            Motion::OnGrid(_) => {
                let motion = sweep.motion_at(piece, piece.entered);
                let what = match motion.orbit {
                    Some(_) => "of a long period",
                    None => motion.classification.name(),
                };
                self.found = Some(Err(Error::numerics(format!(
                    "on approach the motion is {what} at gap.tip = {}, before the setpoint A/A0 = \
                     {} is reached: it has no amplitude to hold; change drive.setpoint, or give \
                     gap.tip",
                    self.shown(piece.from),
                    self.ratio
                ))));
                return true;
            }
        };
        let points = &sweep.stretches[stretch].points;
        let inside = points
            .iter()
            .rev()
            .filter(|p| p.parameter < piece.from && p.parameter > piece.to);
        let mut gaps: Vec<(f64, Option<PeriodicOrbit>)> =
            vec![(piece.from, sweep.orbit_at(stretch, piece.from))];
        gaps.extend(inside.map(|p| (p.parameter, Some(p.orbit.clone()))));
        gaps.push((piece.to, sweep.orbit_at(stretch, piece.to)));
        let orbits: Vec<(f64, PeriodicOrbit)> = gaps
            .into_iter()
            .filter_map(|(gap, orbit)| Some((gap, orbit?)))
            .collect();
        let amplitudes: Vec<f64> = orbits
            .par_iter()
            .with_max_len(1)
            .map(|(gap, orbit)| amplitude(sweep, *gap, orbit))
            .collect();
        let mut before: Option<Sample<'_>> = None;
        for ((gap, orbit), amplitude) in orbits.iter().zip(amplitudes) {
            let here = Sample {
                gap: *gap,
                orbit,
                amplitude,
            };
            self.least = self.least.min(amplitude);
            if amplitude <= self.target {
                let jumped = |(from, above): (f64, f64)| {
                    Err(Error::numerics(format!(
                        "on approach the amplitude jumps past the setpoint A/A0 = {}: from {:.3} \
                         to {:.3} of A0 between gap.tip = {} and {}; change drive.setpoint, or \
                         give gap.tip",
                        self.ratio,
                        above / self.free.amplitude,
                        amplitude / self.free.amplitude,
                        self.shown(from),
                        self.shown(*gap)
                    )))
                };
                let crossed = before.as_ref().map(|last| {
                    self.crossing(sweep, last, &here)
                        .map(|found| SetpointSolution {
                            reached: true,
                            ..found
                        })
                });
                self.found = match (crossed, self.before) {
                    (Some(Some(found)), _) => Some(Ok(found)),
                    (_, Some(above)) => Some(jumped(above)),
                    // Below the setpoint from the first: nothing is reached from above.
                    (_, None) => None,
                };
                return true;
            }
            self.before = Some((*gap, amplitude));
            before = Some(here);
        }
        false
    }

    /// The other orbits with the setpoint's amplitude, and the other stable orbits at the chosen
    /// distance, on the branch of the orbit that is reached.
    fn others(
        &self,
        sweep: &DistanceSweep<'_>,
        reached: &SetpointSolution,
        control: &Control<'_>,
    ) -> (Vec<SetpointSolution>, Vec<SetpointState>) {
        let mut solutions: Vec<SetpointSolution> = Vec::new();
        let mut seeds: Vec<(f64, PeriodicOrbit)> = Vec::new();
        for (k, stretch) in sweep.stretches.iter().enumerate() {
            let orbit = stretch
                .holds(reached.gap)
                .then(|| sweep.orbit_at(k, reached.gap));
            if let Some(orbit) = orbit.flatten().filter(PeriodicOrbit::is_stable)
                && !seeds.iter().any(|(_, other)| is_same(other, &orbit))
            {
                seeds.push((reached.gap, orbit));
            }
        }
        let is_reached = |orbit: &PeriodicOrbit| {
            orbit.period == reached.period
                && orbit.nearest(&reached.state).1 <= 1e-6 * orbit.scale()
        };
        let others = seeds.iter().filter(|(_, orbit)| !is_reached(orbit));
        let states = others
            .filter_map(|(gap, orbit)| self.state(*gap, orbit))
            .collect();
        let over = ContinuationOptions::over(0.0, sweep.farthest());
        let max_points = sweep.points_in(OTHERS_STEPS) / seeds.len().max(1);
        let options = DiagramOptions {
            continuation: ContinuationOptions {
                max_points: max_points.max(MIN_POINTS).min(over.max_points),
                grazings: false,
                max_multiplier: MAX_MULTIPLIER,
                ..over
            },
            doublings: 0,
            stable_doublings: false,
            max_branches: 8,
        };
        let quiet = Control {
            progress: None,
            ..*control
        };
        let family = self.case.family(self.case.gap_key());
        let diagram = assemble_diagram(&family, &seeds, &options, &quiet);
        for branch in &diagram.branches {
            let points: &[BranchPoint] = &branch.branch.points;
            let amplitudes: Vec<f64> = points
                .par_iter()
                .with_max_len(1)
                .map(|p| amplitude(sweep, p.parameter, &p.orbit))
                .collect();
            for (pair, both) in points.windows(2).zip(amplitudes.windows(2)) {
                let [a, b] = [0, 1].map(|k| Sample {
                    gap: pair[k].parameter,
                    orbit: &pair[k].orbit,
                    amplitude: both[k],
                });
                if (a.amplitude > self.target) != (b.amplitude > self.target)
                    && let Some(solution) = self.crossing(sweep, &a, &b)
                {
                    let near = 1e-9 * self.free.reach.max(solution.gap.abs());
                    let known = |s: &SetpointSolution| {
                        s.period == solution.period
                            && (s.gap - solution.gap).abs() <= near
                            && (s.observables.phase - solution.observables.phase).abs() < 1e-4
                    };
                    if !solutions.iter().chain([reached]).any(known) {
                        solutions.push(solution);
                    }
                }
            }
        }
        (solutions, states)
    }

    /// A stable orbit at the chosen distance, measured.
    fn state(&self, gap: f64, orbit: &PeriodicOrbit) -> Option<SetpointState> {
        let view = self.case.physical()?;
        let model = self.case.with(self.case.gap_key(), gap).model().ok()?;
        let state = orbit.states.first()?.clone();
        let observables = measure(&model, &state, orbit.period, ObservableSet::COMMON).ok()?;
        Some(SetpointState {
            period: orbit.period,
            spectral_radius: orbit.spectral_radius(),
            state,
            physical: PhysicalMotion::of(&observables, view),
            observables,
        })
    }
}

/// Steps of regula falsi at most.
const STEPS: usize = 60;

impl Search<'_> {
    /// The orbit between two of a branch that has the target amplitude.
    fn crossing(
        &self,
        sweep: &DistanceSweep<'_>,
        a: &Sample<'_>,
        b: &Sample<'_>,
    ) -> Option<SetpointSolution> {
        let view = self.case.physical()?;
        let target = self.target;
        let (mut low, mut high) = ((0.0, a.amplitude), (1.0, b.amplitude));
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
            let (gap, orbit, observables) = orbit_between(sweep, a, b, t)?;
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
}

/// The orbit at a share `t` of the way from one orbit of a branch to the next.
fn orbit_between(
    sweep: &DistanceSweep<'_>,
    a: &Sample<'_>,
    b: &Sample<'_>,
    t: f64,
) -> Option<(f64, PeriodicOrbit, Observables)> {
    let gap = a.gap + t * (b.gap - a.gap);
    let model = sweep.model(gap).ok()?;
    let mut map = ModelMap::new(&model);
    let [from, to] = [a, b].map(|sample| sample.orbit.states.concat());
    let points: Vec<f64> = from.iter().zip(&to).map(|(x, y)| x + t * (y - x)).collect();
    let period = a.orbit.period;
    let options = ShootingOptions::default();
    let orbit = close_orbit_from_points(&mut map, &points, period, &options).ok()?;
    let start = orbit.states.first()?;
    let observables = measure(&model, start, orbit.period, ObservableSet::COMMON).ok()?;
    (orbit.period == period).then_some((gap, orbit, observables))
}
