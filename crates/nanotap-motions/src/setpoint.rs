//! The distance at which the amplitude, the peak force or the phase reaches its setpoint, as a
//! feedback loop finds it.
//!
//! The feedback comes from far and slowly: the lever follows its branch of stable orbits, and
//! jumps where that ends (see [`approach`](crate::approach)). It stops at the first distance at
//! which the held quantity has come from its value far from the sample to the setpoint: the amplitude
//! of the first harmonic, as a lock-in amplifier reads it, has fallen to it, the peak force has risen
//! to it, the phase has changed to it either way. The orbit there is closed by Newton at distances
//! chosen by regula falsi. Motions that are not periodic are passed as long as their averages stay on
//! the far side of the setpoint. Where the quantity jumps past the setpoint instead, or the motion
//! there is not periodic, nothing is chosen and the reason is given.
//!
//! Then the lever goes on to the sample's own position and back to the chosen distance: the other
//! stable orbits there are reported too, and, from the branches of all these continued round
//! their folds, the other orbits at the setpoint. So are, at some distances, the branches that averaging
//! knows, and under piecewise-linear forces those to which motions with the amplitude of the setpoint and
//! several phases lead: a repulsive state far from the attractive one that the approach reaches is found
//! by them.
//!
//! A setpoint that is a frequency shift is one of frequency modulation ([`frequency_modulation`]):
//! amplitude and phase are held too, at those of the free lever and 90°, and the first distance on
//! approach at which the shift has its value is chosen. Frequency and strength of the drive there take
//! the place of the case's own.
//!
//! Fails by omission: orbits on branches that none of these meets, and a setpoint that the quantity
//! passes twice between two neighbouring orbits of a branch.

use nanotap_dynamics::{
    BranchPoint, ContinuationOptions, Control, DiagramOptions, PeriodicOrbit, ShootingOptions,
    assemble_diagram, close_orbit, close_orbit_from_points,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::approach::distance_sweep::{
    DistanceSweep, FoundMotion, Motion, Piece, Place, budget_text, is_same,
};
use crate::approach::{ApproachReport, BEYOND, MAX_MULTIPLIER, SETPOINT_PERIODS, Way};
use crate::frequency_modulation::{self, FrequencyModulationOptions};
use nanotap_case::document::{CaseDocument, WithoutDistanceDocument, equilibria};
use nanotap_case::physical::{Held, Kind, Physical, Remark};
use nanotap_case::units::Units;
use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_error::ErrorDocument;
use nanotap_error::ErrorKind;
use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;
use nanotap_model::nonlinear::Equilibrium;
use nanotap_observe::frame::{Cell, Frame, Rows, frame};
use nanotap_observe::table::{Observable, shown_phase};
use nanotap_observe::{ObservableSet, Observables, OutOfRange, PhysicalMotion, measure};
use nanotap_quantity::number::significant;
use nanotap_study::FreeMotion;
use nanotap_study::value::Amount;

mod margin;
mod near;
mod states;

pub use margin::end_at_setpoint;
pub use near::{NearOrbit, orbit_at_setpoint};
pub use states::{SetpointStates, StateSearch, Undecided, states_at_setpoint};

use states::{Expected, Starts};

/// A distance at which an orbit has the setpoint amplitude.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SetpointSolution {
    /// The distance, in the model's unit of length.
    pub gap: f64,
    /// Distance between tip and sample at rest, m.
    #[schemars(extend("x-unit" = "m"))]
    pub zc: f64,
    /// Period of the orbit, in drive periods.
    pub period: usize,
    /// Whether every Floquet multiplier of the orbit is inside the unit circle.
    pub stable: bool,
    /// Largest modulus of the Floquet multipliers, dimensionless.
    pub spectral_radius: f64,
    /// Whether the approach stops at this distance.
    pub reached: bool,
    /// Whether the mean force attracts or repels: `attractive` or `repulsive`.
    pub branch: &'static str,
    /// State at drive phase 0, in the model's units. Its entries are a_1 … a_N (or x), their rates,
    /// then any memory of the sample.
    pub state: Vec<f64>,
    /// Observables in the model's units.
    #[serde(flatten)]
    pub observables: Observables,
    /// Observables in SI units.
    pub physical: PhysicalMotion,
}

/// Another stable orbit at the chosen distance.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SetpointState {
    /// Period of the orbit, in drive periods.
    pub period: usize,
    /// Largest modulus of the Floquet multipliers, dimensionless.
    pub spectral_radius: f64,
    /// State at drive phase 0, in the model's units. Its entries are a_1 … a_N (or x), their rates,
    /// then any memory of the sample.
    pub state: Vec<f64>,
    /// Observables in the model's units.
    #[serde(flatten)]
    pub observables: Observables,
    /// Observables in SI units.
    pub physical: PhysicalMotion,
}

/// The drive that keeps amplitude and phase at a frequency shift.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SetpointDrive {
    /// Frequency of the drive, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub frequency: f64,
    /// Strength of the drive: the force in N, or the amplitude of a driven base in m.
    pub strength: f64,
    /// Strength of the drive over that of the free lever, dimensionless.
    pub ratio: f64,
}

/// Solution of a setpoint for the distance.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SetpointReport {
    /// Quantity that is held: `amplitude`, `peak_force`, `phase` or `frequency_shift`.
    pub held: &'static str,
    /// Setpoint of that quantity: amplitude over A₀, force in N, phase in degrees, or shift in Hz.
    pub setpoint: f64,
    /// The drive at a frequency shift.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drive: Option<SetpointDrive>,
    /// Amplitude A at the setpoint over the free amplitude A₀, dimensionless.
    pub ratio: f64,
    /// Amplitude A at the setpoint, m.
    #[schemars(extend("x-unit" = "m"))]
    pub amplitude: f64,
    /// Distances at which an orbit is at the setpoint, from far to near: on the branches that the approach
    /// meets, and on those that averaging knows, or motions of several phases lead to, at distances of about
    /// the setpoint's amplitude. A branch that none of these meets is missing.
    pub solutions: Vec<SetpointSolution>,
    /// Index in `solutions` of the one that the approach reaches.
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

    /// The distances at which an orbit is at the setpoint. Quantities are in SI.
    pub fn solution_table(&self) -> Frame<'_> {
        let way = |s: &SetpointSolution| match (s.stable, s.reached) {
            (true, true) => "stable, reached on approach",
            (true, false) => "stable",
            (false, true) => "unstable, reached on approach",
            (false, false) => "unstable",
        };
        frame! { Rows::new("solutions", &self.solutions, None);
            "gap.tip", "gap.tip", (Length, Prefixed(5)) => |s| s.zc;
            "period", "period", Plain => |s| s.period;
            "phase", "phase", (Angle, Digits(4)) => |s| s.observables.phase;
            "E_dis", "E_dis", (Energy, Quantity([4, 4])) => |s| s.physical.observables.dissipation;
            "F_max", "F_max", (Force, Prefixed(4)) => |s| s.physical.observables.peak_force;
            "", "", Plain => way;
            "stable", "stable", Plain => |s| s.stable; .only_in_files();
            "reached", "reached on approach", Plain => |s| s.reached; .only_in_files();
        }
    }

    /// Describes the held quantity with its value, as in "the peak force is 1 nN".
    pub fn held_value(&self) -> String {
        match self.held {
            "peak_force" => format!("the peak force is {}", Kind::Force.format(self.setpoint)),
            "phase" => format!("the phase is {}°", Kind::Number.format(self.setpoint)),
            "frequency_shift" => format!(
                "the frequency shift is {}",
                Kind::Frequency.format(self.setpoint)
            ),
            _ => format!(
                "the amplitude is {}, {} of A0",
                Kind::Length.format(self.amplitude),
                Kind::Number.format_digits(self.ratio, 4)
            ),
        }
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
                "; {others} more orbit{} with this {}, {stable} of them stable, at {}",
                if others == 1 { "" } else { "s" },
                self.held.replace('_', " "),
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
        let amplitude = format!(
            "A = {} (A/A0 = {})",
            Kind::Length.format(self.amplitude),
            Kind::Number.format(self.ratio)
        );
        let branch = self.solutions.get(self.chosen).map_or("", |s| s.branch);
        let reached = match self.held {
            "amplitude" => format!("the setpoint {amplitude} is reached on approach"),
            "phase" => format!(
                "the setpoint of the phase, {}°, is reached on the {branch} branch with {amplitude}",
                Kind::Number.format(self.setpoint)
            ),
            "frequency_shift" => format!(
                "the frequency shift {} is reached on approach, where the feedback of amplitude and phase \
                 drives with {} times the free lever's strength,",
                Kind::Frequency.format(self.setpoint),
                Kind::Number.format_digits(self.drive.map_or(f64::NAN, |drive| drive.ratio), 4),
            ),
            _ => format!(
                "the setpoint of the peak force, {}, is reached on the {branch} branch with \
                 {amplitude}",
                Kind::Force.format(self.setpoint)
            ),
        };
        Remark::note(format!(
            "{reached} at gap.tip = {}{more}{bistable}{cut}",
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
    let view = case.physical().ok_or_else(no_setpoint)?;
    let setpoint = view.held.ok_or_else(no_setpoint)?;
    if let Held::Shift(shift) = setpoint {
        return solve_shift(case, shift, &moving_tip(case)?, control);
    }
    let (held, free) = held_quantity(case)?;
    let mut search = Search::new(case, held, free);
    let (mut sweep, place) = from_far(case, &[held], free, control)?;
    let searches = std::slice::from_mut(&mut search);
    let (_, place) = approach(&mut sweep, place, searches, control)?;
    let reached = search.result(&sweep)?;
    // What a lever shows at this distance that comes from near.
    sweep.allow_steps(OTHERS_STEPS);
    let (_, place) = sweep.way(place, 0.0, |_, _| false);
    sweep.way(place, reached.gap, |_, _| false);
    let budget = sweep.spent_budget();
    // What the approach does not meet, as a repulsive state far from the attractive one that it reaches.
    sweep.allow_steps(OTHERS_STEPS);
    let expected = Expected {
        free,
        amplitude: reached.observables.first_harmonic,
    };
    let starts = Starts::WhereNotAveraged;
    expected.follow_near(&mut sweep, reached.gap, starts, SETPOINT_PERIODS, control)?;
    let budget = budget.or(sweep.spent_budget()).map(budget_text);
    sweep.allow_steps(u64::MAX);
    let (mut solutions, other_states) = search.others(&sweep, Some(&reached), reached.gap, control);
    if control.is_cancelled() {
        return Err(cancelled());
    }
    let amplitude_ratio = reached.observables.first_harmonic / free.amplitude;
    solutions.push(reached);
    solutions.sort_by(|a, b| b.gap.total_cmp(&a.gap));
    let chosen = solutions.iter().position(|s| s.reached).unwrap_or(0);
    let (name, value, ratio) = match setpoint {
        Held::Amplitude(ratio) => ("amplitude", ratio, ratio),
        Held::PeakForce(force) => ("peak_force", force, amplitude_ratio),
        Held::Phase(phase) => ("phase", phase, amplitude_ratio),
        Held::Shift(shift) => ("frequency_shift", shift, amplitude_ratio),
    };
    Ok(SetpointReport {
        held: name,
        setpoint: value,
        drive: None,
        ratio,
        amplitude: ratio * view.free_amplitude,
        solutions,
        chosen,
        other_states,
        budget,
    })
}

/// The error of a case without a setpoint.
fn no_setpoint() -> Error {
    Error::input(
        "the case has no setpoint: give drive.setpoint, as in setpoint = 0.8",
        "give drive.setpoint",
    )
}

/// The free motion of a case whose drive moves the tip.
fn moving_tip(case: &Case) -> Result<FreeMotion, Error> {
    let free = FreeMotion::of(&case.model()?);
    if !(free.reach > 0.0 && free.reach.is_finite()) {
        return Err(nothing_to_hold());
    }
    Ok(free)
}

/// The held quantity of a case, and its free motion.
fn held_quantity(case: &Case) -> Result<(HeldQuantity, FreeMotion), Error> {
    let view = case.physical().ok_or_else(no_setpoint)?;
    let setpoint = view.held.ok_or_else(no_setpoint)?;
    let free = moving_tip(case)?;
    let held = HeldQuantity::new(setpoint, &free, view.scales.force)?;
    Ok((held, free))
}

/// Solves a frequency shift, in Hz, for the distance.
fn solve_shift(
    case: &Case,
    shift: f64,
    free: &FreeMotion,
    control: &Control<'_>,
) -> Result<SetpointReport, Error> {
    // What depends on the frequency, as a loss tangent, is that of the frequency with the shift.
    let case = &at_shift(case, shift, free)?;
    let unit = case.physical().ok_or_else(no_setpoint)?.scales.length;
    let mut options = FrequencyModulationOptions {
        shift: Some(Amount::from(format!("{shift} Hz").as_str())),
        ..FrequencyModulationOptions::default()
    };
    let curve_from = |options: &FrequencyModulationOptions| {
        frequency_modulation::frequency_modulation(case, options, control)
    };
    let is_passed = |curve: &ApproachReport| {
        let first = curve.table.iter().find_map(|p| p.modulation_si);
        first.is_some_and(|first| first.frequency_shift / shift >= 1.0)
    };
    let mut curve = curve_from(&options)?;
    // Then the shift is passed beyond the reach of the tip already: two points say from where it is not.
    let mut far = BEYOND;
    while is_passed(&curve) && far <= FARTHEST && !control.is_cancelled() {
        far *= 2.0;
        let distance = |far: f64| {
            let text = format!("{:e} m", far * free.reach * unit);
            Some(Amount::from(text.as_str()))
        };
        options.from = distance(far);
        curve = curve_from(&FrequencyModulationOptions {
            to: distance(0.95 * far),
            points: 2,
            ..options.clone()
        })?;
    }
    if far > BEYOND {
        curve = curve_from(&options)?;
    }
    if control.is_cancelled() {
        return Err(cancelled());
    }
    let shown = |shift: f64| Kind::Frequency.format(shift);
    let refused = || {
        let shifts = curve.table.iter().filter_map(|p| p.modulation_si);
        let shifts: Vec<f64> = shifts.map(|m| m.frequency_shift).collect();
        let [low, high] = [f64::min, f64::max].map(|f| shifts.iter().copied().fold(f64::NAN, f));
        let ended = curve.modulation.as_ref().and_then(|m| m.ended.first());
        let ended = ended.map_or_else(String::new, |end| format!(" ({})", end.reason));
        Error::numerics(format!(
            "the frequency shift {} is not reached on approach, on which shifts go from {} to \
             {}{ended}; change drive.setpoint, or give gap.tip",
            shown(shift),
            shown(low),
            shown(high),
        ))
    };
    let found = curve.modulation.as_ref().and_then(|m| m.setpoints.as_ref());
    let found = found
        .into_iter()
        .flatten()
        .filter(|p| p.way == Way::Approach);
    let mut solutions: Vec<SetpointSolution> = Vec::new();
    let mut drive = None;
    for point in found {
        let (Some(orbit), Some(observables), Some(physical), Some(zc), Some(si), Some(modulated)) = (
            &point.orbit,
            point.observables,
            &point.physical,
            point.zc,
            point.modulation_si,
            point.modulation,
        ) else {
            continue;
        };
        let reached = drive.is_none();
        drive.get_or_insert(SetpointDrive {
            frequency: si.frequency,
            strength: si.drive_strength,
            ratio: modulated.drive_ratio,
        });
        solutions.push(SetpointSolution {
            gap: point.gap,
            zc,
            period: orbit.period,
            stable: orbit.is_stable(),
            spectral_radius: orbit.spectral_radius(),
            reached,
            branch: branch_of(&observables),
            state: orbit.states.first().cloned().unwrap_or_default(),
            observables,
            physical: physical.clone(),
        });
    }
    let first = solutions.first().ok_or_else(refused)?;
    let amplitude = first.physical.observables.first_harmonic;
    Ok(SetpointReport {
        held: "frequency_shift",
        setpoint: shift,
        drive,
        ratio: first.observables.first_harmonic / free.amplitude,
        amplitude,
        solutions,
        chosen: 0,
        other_states: Vec::new(),
        budget: None,
    })
}

/// The case at the frequency of the free lever with a shift, in Hz, with the same free amplitude.
fn at_shift(case: &Case, shift: f64, free: &FreeMotion) -> Result<Case, Error> {
    let held = frequency_modulation::Held {
        amplitude: free.amplitude,
        phase: FrequencyModulationOptions::default().phase,
    };
    let lever = frequency_modulation::FreeOscillation::of(case, held.check()?)?;
    let Some(view) = case.physical() else {
        return Ok(case.clone());
    };
    let frequency = lever.frequency * view.scales.frequency + shift;
    if frequency <= 0.0 {
        return Err(Error::input(
            format!(
                "a frequency shift of {} leaves no frequency",
                Kind::Frequency.format(shift)
            ),
            "change drive.setpoint",
        ));
    }
    Ok(case
        .with(Key::DriveFrequency, frequency)
        .with(Key::DriveFreeAmplitude, view.free_amplitude))
}

/// The name of the branch of an orbit.
const fn branch_of(seen: &Observables) -> &'static str {
    if seen.mean_force < 0.0 {
        "attractive"
    } else {
        "repulsive"
    }
}

/// Prepares an approach that begins where no setpoint is reached yet, and the place where the lever is
/// there. Long-range attraction, as that of a voltage, changes the motion far beyond the reach of the tip.
///
/// # Errors
/// When there is no such distance, or the case has no model.
fn from_far<'a>(
    case: &Case,
    setpoints: &[HeldQuantity],
    free: FreeMotion,
    control: &'a Control<'a>,
) -> Result<(DistanceSweep<'a>, Place), Error> {
    let mut far = FARTHER;
    loop {
        let range = (0.0, far * free.reach);
        let mut sweep = DistanceSweep::new(case, range, free.reach, SETPOINT_PERIODS, control)?;
        let place = sweep.free()?;
        let passed = setpoints.iter().find_map(|held| {
            let value = value_in(held, &sweep, &place);
            held.is_reached(value).then_some((held, value))
        });
        let Some((held, value)) = passed else {
            return Ok((sweep, place));
        };
        if far >= FARTHEST {
            let distance = distance_text(case, sweep.farthest());
            return Err(Error::numerics(format!(
                "the setpoint {} is passed before the tip is near: {} at {distance} already, the \
                 farthest distance that is looked at; change drive.setpoint, or give gap.tip",
                held.words(),
                held.state(value),
            )));
        }
        far *= 2.0;
    }
}

/// The held quantity in a place; NaN where it cannot be measured.
fn value_in(held: &HeldQuantity, sweep: &DistanceSweep<'_>, place: &Place) -> f64 {
    let gap = sweep.farthest();
    match place {
        Place::On { stretch, .. } => sweep
            .orbit_at(*stretch, gap)
            .map_or(f64::NAN, |orbit| value_at(held, sweep, gap, &orbit)),
        Place::Off { .. } => value_from(held, sweep, gap, &sweep.state(place), AVERAGED_PERIODS),
    }
}

/// Follows the lever from a place far away until every search has ended; the pieces of its way, and the
/// place where it is then.
fn approach(
    sweep: &mut DistanceSweep<'_>,
    place: Place,
    searches: &mut [Search<'_>],
    control: &Control<'_>,
) -> Result<(Vec<Piece>, Place), Error> {
    sweep.piece_a_step = true;
    let (pieces, place) = sweep.way(place, 0.0, |sweep, piece| {
        let Some(first) = searches.iter().find(|search| search.found.is_none()) else {
            return true;
        };
        let trace = first.held.trace(sweep, piece);
        let open = searches.iter_mut().filter(|search| search.found.is_none());
        let ended: Vec<bool> = open
            .map(|search| search.ends_in(sweep, piece, &trace))
            .collect();
        ended.into_iter().all(|ended| ended)
    });
    sweep.piece_a_step = false;
    if control.is_cancelled() {
        return Err(cancelled());
    }
    let nearest = pieces.last().map(|piece| piece.to);
    for search in searches {
        search.nearest_gap = nearest.unwrap_or(sweep.farthest());
    }
    Ok((pieces, place))
}

/// A distance at which a setpoint is first reached from far.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachedDistance {
    /// Distance at which the setpoint is reached, m.
    pub zc: f64,
    /// State of the orbit at drive phase 0.
    pub state: Vec<f64>,
    /// The drive there, at a frequency shift.
    pub drive: Option<SetpointDrive>,
}

/// The distances at which the setpoints of these cases, which differ in nothing else and hold
/// the same quantity, are first reached from far, on one approach; the reason where one is not reached.
/// Frequency shifts have an approach each.
///
/// # Errors
/// When a case is not possible, the lever is not driven, or the work was cancelled.
pub fn reached_distances(
    cases: &[Case],
    control: &Control<'_>,
) -> Result<Vec<Result<ReachedDistance, String>>, Error> {
    let Some(case) = cases.first() else {
        return Ok(Vec::new());
    };
    let free = moving_tip(case)?;
    let held = case.physical().and_then(|view| view.held);
    if matches!(held, Some(Held::Shift(_))) {
        return shifted_distances(cases, control);
    }
    let mut searches = Vec::with_capacity(cases.len());
    for case in cases {
        case.model()?;
        let Some((view, held)) = case.physical().and_then(|view| Some((view, view.held?))) else {
            return Err(Error::input(
                "a setpoint is one of physical quantities",
                "give the case in physical quantities",
            ));
        };
        let held = HeldQuantity::new(held, &free, view.scales.force)?;
        searches.push(Search::new(case, held, free));
    }
    let setpoints: Vec<HeldQuantity> = searches.iter().map(|search| search.held).collect();
    let (mut sweep, place) = from_far(case, &setpoints, free, control)?;
    approach(&mut sweep, place, &mut searches, control)?;
    let results = searches.iter_mut().map(|search| search.result(&sweep));
    Ok(results
        .map(|result| match result {
            Ok(found) => Ok(ReachedDistance {
                zc: found.zc,
                state: found.state,
                drive: None,
            }),
            Err(error) => Err(error.message()),
        })
        .collect())
}

/// The error of a setpoint where the drive does not move the tip.
fn nothing_to_hold() -> Error {
    Error::input(
        "the drive does not move the tip, so that no setpoint can be held",
        "give drive.free_amplitude",
    )
}

/// Finds the distances at which frequency shifts are reached, on an approach for each case.
fn shifted_distances(
    cases: &[Case],
    control: &Control<'_>,
) -> Result<Vec<Result<ReachedDistance, String>>, Error> {
    let solved = cases.par_iter().with_max_len(1);
    let solved = solved.map(|case| match solve_setpoint(case, control) {
        Ok(found) => Ok(Ok(ReachedDistance {
            zc: found.zc(),
            state: found
                .solutions
                .get(found.chosen)
                .map_or_else(Vec::new, |solution| solution.state.clone()),
            drive: found.drive,
        })),
        Err(error) if control.is_cancelled() => Err(error),
        Err(error) => Ok(Err(error.message())),
    });
    solved.collect()
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
    let state = report.solutions.get(report.chosen).map(|s| &s.state[..]);
    let drive = report.drive.map(|drive| [drive.frequency, drive.strength]);
    let state = state.unwrap_or_default();
    let there = case.at_distance(report.zc(), drive, report.remark(), state)?;
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
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SolvedCase {
    /// Document of the case, with its physical quantities and the numbers of the equations.
    #[serde(flatten)]
    pub case: CaseDocument,
    /// Solution of the setpoint for the distance, if it was solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub setpoint_solved: Option<SetpointReport>,
    /// Excursions of the rest position beyond the range of a nonlinear force law.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub out_of_range: Vec<OutOfRange>,
}

/// A case whose distance is left to a setpoint that was not solved for: what does not depend on the
/// distance.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct UnsolvedCase {
    /// Document of the case without its distance.
    #[serde(flatten)]
    pub case: WithoutDistanceDocument,
    /// Why the setpoint is not solved for here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// Why the setpoint is not reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<ErrorDocument>,
}

/// A case as a document, at its setpoint or without a distance.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum CaseReport {
    /// A case with its distance.
    Solved(Box<SolvedCase>),
    /// A case whose setpoint was not solved for.
    Unsolved(Box<UnsolvedCase>),
}

impl UnsolvedCase {
    /// The document of a case whose setpoint is not solved for, with the reason.
    pub fn of(case: &Case) -> Self {
        Self {
            case: WithoutDistanceDocument::of(case),
            note: None,
            error: None,
        }
    }
}

/// Why the setpoint of a case is not solved for where nothing else needs its distance: a drive with
/// several tones has loops for them. `None` for a case with a distance or one tone.
pub fn note_of_several_tones(case: &Case) -> Option<String> {
    let tones = case
        .cantilever()
        .map_or(0, |lever| lever.further_tones.len());
    let is_left = case.leaves_distance_to_setpoint() && tones > 0;
    is_left.then(|| {
        "the distance is left to the setpoint and the drive has several tones: `bimodal` follows \
         them with their loops and finds the distance; with gap.tip the case is shown at a distance"
            .to_owned()
    })
}

/// The tables of a case: its numbers, of a physical one with the quantities that they stand for, and
/// where the undriven lever rests, if the sample attracts.
pub fn case_tables(case: &Case) -> Vec<Frame<'static>> {
    let Some(view) = case.physical() else {
        return vec![number_table(case)];
    };
    let rests = equilibria(case);
    let mut tables = vec![mapping_table(view)];
    if !rests.is_empty() {
        tables.push(rest_table(rests, Units::Si(view.scales)));
    }
    tables
}

/// The numbers of a dimensionless case.
fn number_table(case: &Case) -> Frame<'static> {
    let of_key = |key: Key, value: f64| {
        let cell = Cell::Number(value);
        let alias = key.alias().unwrap_or(key.name());
        (key.symbol(), key.name(), alias, cell, key.meaning())
    };
    let lever = case.cantilever();
    let mut rows: Vec<(_, _, _, Cell, _)> = match lever {
        Some(lever) => (lever.parameters().into_iter())
            .map(|parameter| of_key(Key::of(parameter), lever.get(parameter)))
            .collect(),
        None => (case.keys().into_iter())
            .map(|key| of_key(key, case.get(key)))
            .collect(),
    };
    if let Some(lever) = lever {
        let modes = Cell::Count(lever.modes);
        rows.insert(0, ("N", "modes", "", modes, "beam modes"));
        let contact = Cell::Word(lever.contact.name().to_owned());
        rows.push(("", "contact", "", contact, lever.contact.meaning()));
    }
    let without: &[&str] = if lever.is_some() { &[] } else { &["alias"] };
    frame! { Rows::new("numbers", rows, None);
        "symbol", "", Plain => |(symbol, ..)| symbol;
        "key", "key", Plain => |(_, key, ..)| key;
        "alias", "or", Plain => |(_, _, alias, ..)| alias;
        "value", "value", Plain => |(.., value, _)| value;
        .align(Point);
        "meaning", "meaning", Plain => |(.., meaning)| meaning;
        .without(without);
    }
}

/// The numbers of the equations with the quantities that they stand for.
fn mapping_table(view: &Physical) -> Frame<'static> {
    frame! { Rows::new("mapping", view.mapping(), None);
        "symbol", "", Plain => |row| Key::of(row.parameter).symbol();
        "parameter", "key", Plain => |row| row.parameter.name();
        "value", "value", Digits(6) => |row| row.value;
        "formula", "is", Plain => |row| row.formula;
        "quantity", "of", Plain => |row| row.quantity;
        "", "", Plain => |row| row.kind.format(row.si);
        "si", "quantity in SI", Digits(6) => |row| row.si; .only_in_files();
        "unit", "its unit", Plain => |row| row.kind.si_unit(); .only_in_files();
    }
}

/// Where the undriven lever rests.
fn rest_table(all: Vec<Equilibrium>, units: Units) -> Frame<'static> {
    let way = |rest: Equilibrium| match (rest.stable, rest.contact) {
        (true, true) => "stable, in contact",
        (true, false) => "stable",
        (false, true) => "unstable, in contact",
        (false, false) => "unstable",
    };
    frame! { Rows::new("equilibria", all, Some(units));
        "gap", "gap", (Length, Prefixed(4)) => |rest| rest.gap;
        "deflection", "deflection", (Length, Prefixed(4)) => |rest| rest.deflection;
        "force", "force", (Force, Prefixed(4)) => |rest| rest.force;
        "", "", Plain => way;
        "stable", "stable", Plain => |rest| rest.stable; .only_in_files();
        "contact", "in contact", Plain => |rest| rest.contact; .only_in_files();
    }
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

/// Steps of the approximate flow after which the search for other states at the setpoint ends, and
/// which their branches may take.
const OTHERS_STEPS: u64 = 20_000_000;
/// Points to which each of these branches may always be followed.
const MIN_POINTS: usize = 16;

/// First distance of the approach, as a multiple of the reach of the free tip.
const FARTHER: f64 = 2.0;
/// Multiple of the reach beyond which no approach begins, however far the sample acts.
const FARTHEST: f64 = 256.0;

/// The quantity that is held, in the model's units; a phase in degrees.
#[derive(Clone, Copy, Debug)]
struct HeldQuantity {
    setpoint: Held,
    target: f64,
    /// Value of the quantity far from the sample.
    far: f64,
    /// A₀, and the unit of force in N.
    free_amplitude: f64,
    force_unit: f64,
}

impl HeldQuantity {
    fn new(setpoint: Held, free: &FreeMotion, force_unit: f64) -> Result<Self, Error> {
        let (target, far) = match setpoint {
            Held::Amplitude(ratio) => (ratio * free.amplitude, free.amplitude),
            Held::PeakForce(force) => (force / force_unit, 0.0),
            Held::Phase(phase) => (near_phase(phase, free.phase), free.phase),
            Held::Shift(_) => {
                return Err(Error::input(
                    "setpoints that vary must all be frequency shifts, or none",
                    "give setpoints of one kind",
                ));
            }
        };
        if target == far {
            return Err(Error::input(
                "the setpoint is the phase far from the sample: every distance would do",
                "change drive.setpoint",
            ));
        }
        Ok(Self {
            setpoint,
            target,
            far,
            free_amplitude: free.amplitude,
            force_unit,
        })
    }

    const fn is_amplitude(&self) -> bool {
        matches!(self.setpoint, Held::Amplitude(_))
    }

    fn set(&self) -> ObservableSet {
        match self.setpoint {
            Held::Amplitude(_) | Held::Phase(_) | Held::Shift(_) => ObservableSet::FIRST_HARMONIC,
            Held::PeakForce(_) => Observable::named("peak_force")
                .map_or(ObservableSet::COMMON, |peak| ObservableSet::NONE.with(peak)),
        }
    }

    fn of(&self, seen: &Observables) -> f64 {
        match self.setpoint {
            Held::Amplitude(_) => seen.first_harmonic,
            Held::PeakForce(_) => seen.peak_force,
            Held::Phase(_) | Held::Shift(_) => near_phase(seen.phase, self.far),
        }
    }

    /// Whether a value is at the setpoint or beyond it, seen from far.
    fn is_reached(&self, value: f64) -> bool {
        if self.far > self.target {
            value <= self.target
        } else {
            value >= self.target
        }
    }

    /// The value of two that is the nearer to the setpoint.
    fn nearer(&self, a: f64, b: f64) -> f64 {
        if self.far > self.target {
            a.min(b)
        } else {
            a.max(b)
        }
    }

    fn value_text(&self, value: f64) -> String {
        match self.setpoint {
            Held::Amplitude(_) => format!("{:.3}", value / self.free_amplitude),
            Held::PeakForce(_) => Kind::Force.format(value * self.force_unit),
            Held::Phase(_) | Held::Shift(_) => format!("{value:.2}°"),
        }
    }

    /// Describes the setpoint in words, as in `A/A0 = 0.8`.
    fn words(&self) -> String {
        match self.setpoint {
            Held::Amplitude(ratio) => format!("A/A0 = {ratio}"),
            Held::PeakForce(force) => format!("peak force = {}", Kind::Force.format(force)),
            Held::Phase(phase) => format!("phase = {}°", significant(phase, 8)),
            Held::Shift(shift) => format!("frequency shift = {}", Kind::Frequency.format(shift)),
        }
    }

    /// Describes a value of the held quantity in words, as in `A/A0 is 0.8`.
    fn state(&self, value: f64) -> String {
        let name = match self.setpoint {
            Held::Amplitude(_) => "A/A0",
            Held::PeakForce(_) => "the peak force",
            Held::Phase(_) | Held::Shift(_) => "the phase",
        };
        format!("{name} is {}", self.value_text(value))
    }

    const fn remedy(&self) -> &'static str {
        if self.is_amplitude() {
            "raise"
        } else {
            "change"
        }
    }
}

/// A phase in degrees within half a turn of another.
fn near_phase(phase: f64, of: f64) -> f64 {
    phase - 360.0 * ((phase - of) / 360.0).round()
}

/// A distance in the model's unit of length as text.
fn distance_text(case: &Case, gap: f64) -> String {
    let view = case.physical();
    view.map_or_else(
        || gap.to_string(),
        |view| Kind::Length.format(gap * view.scales.length),
    )
}

/// The search for the setpoint along the way from far.
struct Search<'a> {
    case: &'a Case,
    held: HeldQuantity,
    free: FreeMotion,
    /// The distance and the value last passed.
    before: Option<(f64, f64)>,
    /// The value nearest to the setpoint, and the distance at which the way ended.
    nearest: f64,
    nearest_gap: f64,
    found: Option<Result<SetpointSolution, Error>>,
}

/// Distances along a piece of the way with the values there.
enum Trace {
    /// Distance, orbit and value for each orbit of a branch.
    Orbits(Vec<(f64, PeriodicOrbit, f64)>),
    /// Distance and averaged value of a motion without a branch.
    Averages(Vec<(f64, f64)>),
}

/// Drive periods over which a motion without a branch is averaged.
const AVERAGED_PERIODS: usize = 256;

/// An orbit of a branch and the value of the held quantity.
#[derive(Clone, Debug)]
struct Sample<'a> {
    gap: f64,
    orbit: &'a PeriodicOrbit,
    value: f64,
}

impl<'a> Sample<'a> {
    /// An orbit with its distance and value.
    const fn of((gap, orbit, value): &'a (f64, PeriodicOrbit, f64)) -> Self {
        Self {
            gap: *gap,
            orbit,
            value: *value,
        }
    }
}

/// The held quantity of an orbit at a distance; NaN where it cannot be measured.
fn value_at(
    held: &HeldQuantity,
    sweep: &DistanceSweep<'_>,
    gap: f64,
    orbit: &PeriodicOrbit,
) -> f64 {
    let start = orbit.states.first().map_or(&[][..], Vec::as_slice);
    value_from(held, sweep, gap, start, orbit.period)
}

/// Returns the held quantity over `periods` drive periods from a state; NaN where it cannot be
/// measured.
fn value_from(
    held: &HeldQuantity,
    sweep: &DistanceSweep<'_>,
    gap: f64,
    start: &[f64],
    periods: usize,
) -> f64 {
    let model = sweep.model(gap).ok();
    let seen = model.and_then(|m| measure(&m, start, periods, held.set()).ok());
    seen.map_or(f64::NAN, |seen| held.of(&seen))
}

impl HeldQuantity {
    /// The values along a piece of the way.
    fn trace(&self, sweep: &DistanceSweep<'_>, piece: &Piece) -> Trace {
        let stretch = match &piece.motion {
            Motion::Periodic(stretch) => *stretch,
            Motion::OnGrid(found) => {
                let average = |(gap, motion): &(f64, FoundMotion)| {
                    let value = value_from(self, sweep, *gap, &motion.state, AVERAGED_PERIODS);
                    (*gap, value)
                };
                return Trace::Averages(found.par_iter().map(average).collect());
            }
        };
        Trace::Orbits(self.along_stretch(sweep, stretch, [piece.from, piece.to]))
    }

    /// Distance, orbit and value for each orbit of a stretch between two distances, the first one first.
    fn along_stretch(
        &self,
        sweep: &DistanceSweep<'_>,
        stretch: usize,
        [from, to]: [f64; 2],
    ) -> Vec<(f64, PeriodicOrbit, f64)> {
        let points = &sweep.stretches[stretch].points;
        let (low, high) = (from.min(to), from.max(to));
        let inside = points
            .iter()
            .filter(|p| p.parameter > low && p.parameter < high);
        let mut gaps: Vec<(f64, Option<PeriodicOrbit>)> = vec![(low, sweep.orbit_at(stretch, low))];
        gaps.extend(inside.map(|p| (p.parameter, Some(p.orbit.clone()))));
        gaps.push((high, sweep.orbit_at(stretch, high)));
        if from > to {
            gaps.reverse();
        }
        let orbits: Vec<(f64, PeriodicOrbit)> = gaps
            .into_iter()
            .filter_map(|(gap, orbit)| Some((gap, orbit?)))
            .collect();
        let valued = orbits.into_par_iter().with_max_len(1).map(|(gap, orbit)| {
            let value = value_at(self, sweep, gap, &orbit);
            (gap, orbit, value)
        });
        valued.collect()
    }
}

impl<'a> Search<'a> {
    const fn new(case: &'a Case, held: HeldQuantity, free: FreeMotion) -> Self {
        Self {
            case,
            held,
            free,
            before: None,
            nearest: held.far,
            nearest_gap: f64::INFINITY,
            found: None,
        }
    }
}

impl Search<'_> {
    /// The orbit that was found once the way has ended, or why there is none.
    fn result(&mut self, sweep: &DistanceSweep<'_>) -> Result<SetpointSolution, Error> {
        if let Some(found) = self.found.take() {
            return found;
        }
        let words = self.held.words();
        let remedy = self.held.remedy();
        Err(Error::numerics(match sweep.spent_budget() {
            Some(steps) => format!(
                "the setpoint {words} was not reached: {}, to gap.tip = {}; give gap.tip, or \
                 {remedy} drive.setpoint",
                budget_text(steps),
                distance_text(self.case, self.nearest_gap),
            ),
            None => format!(
                "the setpoint {words} is not reached on the way to the sample's own position \
                 (gap.tip = 0), nearest to it {}; {remedy} drive.setpoint, or give gap.tip",
                self.held.state(self.nearest),
            ),
        }))
    }

    /// Whether the search ends in a piece of the way.
    fn ends_in(&mut self, sweep: &DistanceSweep<'_>, piece: &Piece, trace: &Trace) -> bool {
        let held = self.held;
        let orbits = match trace {
            Trace::Orbits(orbits) => orbits,
            Trace::Averages(values) => return self.ends_without_orbit(sweep, piece, values),
        };
        let mut before: Option<Sample<'_>> = None;
        for (gap, orbit, value) in orbits {
            let value = *value;
            let here = Sample {
                gap: *gap,
                orbit,
                value,
            };
            self.nearest = held.nearer(self.nearest, value);
            if held.is_reached(value) {
                let jumped = |(from, before): (f64, f64)| {
                    let (name, of) = match held.setpoint {
                        Held::Amplitude(_) => ("amplitude", " of A0"),
                        Held::PeakForce(_) => ("peak force", ""),
                        Held::Phase(_) | Held::Shift(_) => ("phase", ""),
                    };
                    Err(Error::numerics(format!(
                        "on approach the {name} jumps past the setpoint {}: from {} to {}{of} \
                         between gap.tip = {} and {}; change drive.setpoint, or give gap.tip",
                        held.words(),
                        held.value_text(before),
                        held.value_text(value),
                        distance_text(self.case, from),
                        distance_text(self.case, *gap)
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
                    // Beyond the setpoint from the first: it is not reached from far.
                    (_, None) => None,
                };
                return true;
            }
            self.before = Some((*gap, value));
            before = Some(here);
        }
        false
    }

    /// Whether the search ends in a piece of the way whose motion is not periodic.
    fn ends_without_orbit(
        &mut self,
        sweep: &DistanceSweep<'_>,
        piece: &Piece,
        values: &[(f64, f64)],
    ) -> bool {
        let held = self.held;
        for &(gap, value) in values {
            if value.is_nan() || held.is_reached(value) {
                let motion = sweep.motion_at(piece, gap);
                let what = match (&motion.orbit, motion.evidence.as_str()) {
                    (Some(_), _) => "of a long period".to_owned(),
                    (None, "") => motion.classification.name().to_owned(),
                    (None, why) => format!("{} ({why})", motion.classification.name()),
                };
                self.found = Some(Err(Error::numerics(format!(
                    "on approach the motion is {what} at gap.tip = {}, before the setpoint {} is \
                     reached: it has no {} to hold; change drive.setpoint, or give gap.tip",
                    distance_text(self.case, gap),
                    held.words(),
                    match held.setpoint {
                        Held::Amplitude(_) => "amplitude",
                        Held::PeakForce(_) => "peak force",
                        Held::Phase(_) | Held::Shift(_) => "phase",
                    }
                ))));
                return true;
            }
            self.nearest = held.nearer(self.nearest, value);
            self.before = Some((gap, value));
        }
        false
    }

    /// The orbits at the setpoint other than the one that is reached, and the other stable orbits at a
    /// distance: on the branches of these orbits and of those that the lever was seen on.
    fn others(
        &self,
        sweep: &DistanceSweep<'_>,
        reached: Option<&SetpointSolution>,
        at: f64,
        control: &Control<'_>,
    ) -> (Vec<SetpointSolution>, Vec<SetpointState>) {
        let mut solutions: Vec<SetpointSolution> = Vec::new();
        let mut seeds: Vec<(f64, PeriodicOrbit)> = Vec::new();
        for (k, stretch) in sweep.stretches.iter().enumerate() {
            let orbit = stretch.holds(at).then(|| sweep.orbit_at(k, at));
            if let Some(orbit) = orbit.flatten().filter(PeriodicOrbit::is_stable)
                && !seeds.iter().any(|(_, other)| is_same(other, &orbit))
            {
                seeds.push((at, orbit));
            }
        }
        let is_reached = |orbit: &PeriodicOrbit| {
            reached.is_some_and(|reached| {
                orbit.period == reached.period
                    && orbit.nearest(&reached.state).1 <= 1e-6 * orbit.scale()
            })
        };
        let others = seeds.iter().filter(|(_, orbit)| !is_reached(orbit));
        let states = others
            .filter_map(|(gap, orbit)| self.state(*gap, orbit))
            .collect();
        for (k, stretch) in sweep.stretches.iter().enumerate() {
            let [low, high] = [0, 1].map(|end| stretch.ends[end].0);
            let trace = self.held.along_stretch(sweep, k, [low, high]);
            let samples: Vec<Sample<'_>> = trace.iter().map(Sample::of).collect();
            let before = solutions.len();
            self.add_crossings(sweep, &samples, reached, &mut solutions);
            if solutions.len() > before
                && !stretch.holds(at)
                && let Some((gap, orbit, _)) = trace.get(trace.len() / 2)
            {
                seeds.push((*gap, orbit.clone()));
            }
        }
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
            let values: Vec<f64> = points
                .par_iter()
                .with_max_len(1)
                .map(|p| value_at(&self.held, sweep, p.parameter, &p.orbit))
                .collect();
            let samples = points.iter().zip(&values).map(|(point, &value)| Sample {
                gap: point.parameter,
                orbit: &point.orbit,
                value,
            });
            let samples: Vec<Sample<'_>> = samples.collect();
            self.add_crossings(sweep, &samples, reached, &mut solutions);
        }
        (solutions, states)
    }

    /// Adds the orbits at the setpoint between neighbouring orbits of a branch, unless they are known.
    fn add_crossings(
        &self,
        sweep: &DistanceSweep<'_>,
        samples: &[Sample<'_>],
        reached: Option<&SetpointSolution>,
        solutions: &mut Vec<SetpointSolution>,
    ) {
        for pair in samples.windows(2) {
            if (pair[0].value > self.held.target) == (pair[1].value > self.held.target) {
                continue;
            }
            let Some(solution) = self.crossing(sweep, &pair[0], &pair[1]) else {
                continue;
            };
            let known = |s: &SetpointSolution| self.is_same_crossing(sweep, s, &solution);
            if !solutions.iter().chain(reached).any(known) {
                solutions.push(solution);
            }
        }
    }

    /// Whether two orbits at the setpoint are one, found twice. Where the held quantity hardly changes with
    /// the distance, as far from the sample, rounding alone moves the distance at which it has its value:
    /// the orbit halfway is then at the setpoint, too.
    fn is_same_crossing(
        &self,
        sweep: &DistanceSweep<'_>,
        a: &SetpointSolution,
        b: &SetpointSolution,
    ) -> bool {
        let reach = self.free.reach.max(b.gap.abs());
        let apart = (a.gap - b.gap).abs();
        let alike = (a.observables.phase - b.observables.phase).abs() < 1e-4;
        if a.period != b.period || !alike || apart > SAME_DISTANCE * reach {
            return false;
        }
        let halfway = || {
            let gap = 0.5 * (a.gap + b.gap);
            let model = sweep.model(gap).ok()?;
            let mut map = ModelMap::new(&model);
            let options = ShootingOptions::default();
            let orbit = close_orbit(&mut map, &a.state, a.period, &options).ok()?;
            Some(value_at(&self.held, sweep, gap, &orbit))
        };
        let at_setpoint =
            |value: f64| (value - self.held.target).abs() <= SAME_VALUE * self.held.target.abs();
        apart <= CERTAINLY_SAME * reach || halfway().is_some_and(at_setpoint)
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
            physical: PhysicalMotion::of(&observables, view).with_state(&state, view),
            state,
            observables,
        })
    }
}

/// Difference of the distances, over the reach or the larger distance, within which two orbits are one.
const CERTAINLY_SAME: f64 = 1e-9;
/// The same within which two orbits can be one.
const SAME_DISTANCE: f64 = 1e-3;
/// Relative error of the held quantity within which the orbit between two is at the setpoint: some ten times
/// that to which an orbit at the setpoint is closed.
const SAME_VALUE: f64 = 1e-11;

/// Steps of regula falsi at most.
const STEPS: usize = 60;

impl Search<'_> {
    /// The orbit between two of a branch that is at the setpoint.
    fn crossing(
        &self,
        sweep: &DistanceSweep<'_>,
        a: &Sample<'_>,
        b: &Sample<'_>,
    ) -> Option<SetpointSolution> {
        crossing(self.case, &self.held, &|gap| sweep.model(gap).ok(), a, b)
    }
}

/// The model of a case at a distance.
type ModelAt<'a> = &'a dyn Fn(f64) -> Option<Model>;

/// The orbit between two of a branch that is at the setpoint.
fn crossing(
    case: &Case,
    held: &HeldQuantity,
    model_at: ModelAt<'_>,
    a: &Sample<'_>,
    b: &Sample<'_>,
) -> Option<SetpointSolution> {
    let target = held.target;
    let (mut low, mut high) = ((0.0, a.value), (1.0, b.value));
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
        let (gap, orbit, observables) = orbit_between(model_at, a, b, t)?;
        let value = held.of(&observables);
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
    if (held.of(&observables) - target).abs() > 1e-6 * target.abs() {
        return None;
    }
    solution(case, gap, &orbit, &observables)
}

/// An orbit at the setpoint.
fn solution(
    case: &Case,
    gap: f64,
    orbit: &PeriodicOrbit,
    observables: &Observables,
) -> Option<SetpointSolution> {
    let view = case.physical()?;
    let state = orbit.states.first().cloned().unwrap_or_default();
    Some(SetpointSolution {
        gap,
        zc: gap * view.scales.length,
        period: orbit.period,
        stable: orbit.is_stable(),
        spectral_radius: orbit.spectral_radius(),
        reached: false,
        branch: branch_of(observables),
        physical: PhysicalMotion::of(observables, view).with_state(&state, view),
        state,
        observables: *observables,
    })
}

/// The orbit at a share `t` of the way from one orbit of a branch to the next.
fn orbit_between(
    model_at: ModelAt<'_>,
    a: &Sample<'_>,
    b: &Sample<'_>,
    t: f64,
) -> Option<(f64, PeriodicOrbit, Observables)> {
    let gap = a.gap + t * (b.gap - a.gap);
    let [from, to] = [a, b].map(|sample| sample.orbit.states.concat());
    let points: Vec<f64> = from.iter().zip(&to).map(|(x, y)| x + t * (y - x)).collect();
    let (orbit, observables) = closed(&model_at(gap)?, &points, a.orbit.period)?;
    Some((gap, orbit, observables))
}

/// The orbit of a period near the states of another one, and what is measured on it.
fn closed(model: &Model, points: &[f64], period: usize) -> Option<(PeriodicOrbit, Observables)> {
    let mut map = ModelMap::new(model);
    let options = ShootingOptions::default();
    let orbit = close_orbit_from_points(&mut map, points, period, &options).ok()?;
    measured(model, orbit, period)
}

/// An orbit and what is measured on it, unless its period is another one.
fn measured(
    model: &Model,
    orbit: PeriodicOrbit,
    period: usize,
) -> Option<(PeriodicOrbit, Observables)> {
    let start = orbit.states.first()?;
    let observables = measure(model, start, orbit.period, ObservableSet::COMMON).ok()?;
    (orbit.period == period).then_some((orbit, observables))
}
