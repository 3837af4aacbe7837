//! A motion under a signal of one shot: the transient while it lasts, and the ring-down after it.
//!
//! The lever begins at rest, or in a given state, and the signal takes the place of the periodic
//! drive. Nothing repeats, so that no orbit, phase or energy per period is reported; extremes,
//! contacts and energies are those of the whole run, as exact as under a periodic drive.

use schemars::JsonSchema;
use serde::Serialize;

use std::sync::Arc;

use super::{Classification, SimulateOptions, is_none, starting_state};
use crate::figure::motion::contact_intervals;
use nanotap_case::Case;
use nanotap_case::drive_signal::ReadSignal;
use nanotap_dynamics::Control;
use nanotap_error::Error;
use nanotap_flow::Output;
use nanotap_model::drive_signal::DriveSignal;
use nanotap_model::recording::MotionPiece;
use nanotap_model::{Model, MotionError};
use nanotap_observe::{
    ContactEvent, ContactEventKind, ObservableSet, Observables, OutOfRange, RecordOptions,
    Recorded, record, time_series,
};
use nanotap_quantity::number::significant;

/// Result of a run under a signal of one shot.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct OneShot {
    /// The signal, as it was given, or the name of its table.
    pub drive_signal: String,
    /// Length of the signal in periods of the case's drive.
    #[schemars(extend("x-unit" = "drive periods"))]
    pub signal_periods: f64,
    /// Length of the run in periods of the case's drive.
    pub periods: f64,
    /// Kind of motion: always a transient.
    pub classification: Classification,
    /// What was followed, in words.
    pub evidence: String,
    /// State at the beginning of the signal, in the model's units.
    pub start: Vec<f64>,
    /// The state at the end of the run, in the model's units.
    pub strobe: Vec<Vec<f64>>,
    /// Number of contacts begun.
    pub contacts: usize,
    /// Time of the first contact, in drive periods from the beginning of the signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "drive periods"))]
    pub first_contact: Option<f64>,
    /// Time at which the last contact begins, in drive periods from the beginning of the signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "drive periods"))]
    pub last_contact: Option<f64>,
    /// Contacts begun and ended, up to a limit.
    pub events: Vec<ContactEvent>,
    /// Number of events that are not listed.
    #[serde(skip_serializing_if = "is_none")]
    pub events_left_out: usize,
    /// Observables of the whole run.
    #[serde(flatten)]
    pub observables: Observables,
    /// Excursions beyond the range of a nonlinear force law.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub out_of_range: Vec<OutOfRange>,
    /// Curves of the whole run, for figures.
    #[serde(skip)]
    pub curves: Curves,
}

/// Curves over the time in drive periods, lengths in the model's unit.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    /// The signal, in units of the drive's amplitude.
    pub signal: Vec<(f64, f64)>,
    /// Tip deflection.
    pub tip: Vec<(f64, f64)>,
    /// Surface of the sample, relative to the base.
    pub surface: Vec<(f64, f64)>,
    /// Beginning and end of each contact.
    pub contacts: Vec<(f64, f64)>,
}

/// Points of a curve per drive period, and most in all.
const POINTS: (f64, f64) = (64.0, 20_000.0);

impl SimulateOptions {
    /// The signal of `drive_signal` for a case; `None` without one. A case that holds a setpoint keeps
    /// the distance that its motion under the periodic drive has.
    ///
    /// # Errors
    /// When the signal is not valid, the case is no lever, or another option does not apply.
    pub fn signal(&self, case: &Case) -> Result<Option<ReadSignal>, Error> {
        let Some(stated) = &self.drive_signal else {
            return Ok(None);
        };
        let plain = Self::default();
        let unused = [
            ("transient", self.transient != plain.transient),
            ("strobe", self.strobe != plain.strobe),
            ("max_period", self.max_period != plain.max_period),
            ("observables", self.observables != plain.observables),
            ("method", self.method != plain.method),
        ];
        if let Some((name, _)) = unused.into_iter().find(|(_, given)| *given) {
            return Err(Error::option(
                name,
                "a signal of one shot has no transient, strobe, classification or time step to choose",
                format!("leave out {{{name}}} or {{drive_signal}}"),
            ));
        }
        if case.cantilever().is_none() {
            return Err(Error::option(
                "drive_signal",
                "an oscillator has no drive of one shot",
                "leave out {drive_signal}, or give a lever",
            ));
        }
        stated.read(case, self.periods).map(Some)
    }
}

/// The motion under one piece of a signal.
struct PieceRun<'a> {
    model: &'a Model,
    recorded: &'a Recorded,
    /// Length of the run before it, in drive periods and in model units of time.
    before: [f64; 2],
    piece: &'a DriveSignal,
}

/// Runs a case piece by piece from `state`, and shows each; the progress counts them. Returns the last
/// state.
fn follow(
    case: &Case,
    read: &ReadSignal,
    mut state: Vec<f64>,
    control: &Control<'_>,
    mut each: impl FnMut(&PieceRun<'_>),
) -> Result<Vec<f64>, Error> {
    let kept = RecordOptions {
        recorded: 1,
        states: 0,
        events: true,
        each_period: false,
    };
    let (mut before, mut touching) = ([0.0; 2], None);
    for (done, piece) in read.pieces.iter().enumerate() {
        if let Some(progress) = control.progress {
            progress(done, read.pieces.len());
        }
        let Some(driven) = case.under_signal(&Arc::new(piece.clone())) else {
            break;
        };
        let model = driven.model()?;
        let set = OutOfRange::observed_with(&model, OBSERVED);
        let recorded = record(&model, &state, 1, set, kept)?;
        let pieces = recorded.recording.pieces();
        let touches = |of: Option<&MotionPiece>| of.map(|of| model.touches(of.regime));
        let begins = touches(pieces.first());
        if touching.is_some() && begins != touching && !within_rounding(pieces.first()) {
            return Err(Error::numerics(
                "a state between two pieces of the signal is possible in contact and in flight",
            ));
        }
        touching = touches(pieces.last());
        each(&PieceRun {
            model: &model,
            recorded: &recorded,
            before,
            piece,
        });
        before = [before[0] + piece.length, before[1] + model.period()];
        state = recorded.end;
    }
    Ok(state)
}

/// What is measured on each piece.
const OBSERVED: ObservableSet = ObservableSet::EXTREMES.union(ObservableSet::ENERGY_BALANCE);

/// Time, in units of √(mL⁴/(EI)), below which contact that begins at the end of a piece counts as
/// belonging to the next.
const ROUNDING: f64 = 1e-9;

fn within_rounding(first: Option<&MotionPiece>) -> bool {
    first.is_some_and(|first| first.length < ROUNDING)
}

/// Runs a case under a signal.
///
/// # Errors
/// When the state does not fit, the flow fails, or the case's work was cancelled.
pub fn one_shot(
    case: &Case,
    read: &ReadSignal,
    options: &SimulateOptions,
    control: &Control<'_>,
) -> Result<OneShot, Error> {
    let model = case.model()?;
    let start = match &options.state {
        Some(state) => starting_state(&model, Some(state))?,
        None => model.rest(),
    };
    let window = read.window();
    let (mut seen, mut events, mut curves) = (None, Vec::new(), Curves::default());
    let mut contacts: Vec<f64> = Vec::new();
    let step = window / (POINTS.0 * window).min(POINTS.1).ceil();
    let last = follow(case, read, start.clone(), control, |run| {
        let observables = &run.recorded.observables;
        seen = Some(seen.map_or(*observables, |seen| {
            joined(&seen, run.before[0], observables, run.piece.length)
        }));
        let scale = run.piece.length / run.model.period();
        for event in &run.recorded.events {
            let tau = run.before[1] + event.tau;
            if event.kind != ContactEventKind::ContactEnd {
                contacts.push(run.before[0] + scale * event.tau);
            }
            events.push(ContactEvent { tau, ..*event });
        }
        curves.add(run, step);
    })?;
    let observables = seen.unwrap_or(Observables::UNKNOWN);
    let events_left_out = events.len().saturating_sub(options.events);
    events.truncate(options.events);
    Ok(OneShot {
        drive_signal: read.words.clone(),
        signal_periods: read.length,
        periods: window,
        classification: Classification::Transient,
        evidence: format!(
            "a signal of one shot over {} drive periods, followed for {} periods",
            significant(read.length, 4),
            significant(window, 4)
        ),
        start,
        strobe: vec![last],
        contacts: contacts.len(),
        first_contact: contacts.first().copied(),
        last_contact: contacts.last().copied(),
        events,
        events_left_out,
        out_of_range: OutOfRange::of(&model, &observables),
        observables,
        curves,
    })
}

/// Calls `row` for `resolution` equidistant instants in each drive period of a run, as
/// [`time_series::sample`] does.
///
/// # Errors
/// If there would be too many rows, or the flow fails.
pub fn sample(
    case: &Case,
    read: &ReadSignal,
    start: &[f64],
    resolution: usize,
    row: &mut dyn FnMut(&[f64]),
) -> Result<(), Error> {
    let rows = (read.window() * resolution as f64).ceil();
    if rows > time_series::MAX_ROWS as f64 {
        return Err(MotionError::TooManyRows {
            rows: rows as usize,
            most: time_series::MAX_ROWS,
        }
        .into());
    }
    let window = read.window();
    follow(case, read, start.to_vec(), &Control::default(), |run| {
        let scale = run.model.period() / run.piece.length;
        let tip_rate = run.model.tip_rate();
        // The very end belongs to the series.
        let end = run.before[0] + run.piece.length;
        let last = (end >= window).then_some(end);
        for time in grid(run.before[0], run.piece.length, 1.0 / resolution as f64).chain(last) {
            let time = scale * (time - run.before[0]);
            let place = [time, run.before[1]];
            if let Some(numbers) =
                time_series::row_at(run.model, &tip_rate, &run.recorded.recording, place)
            {
                row(&numbers);
            }
        }
    })?;
    Ok(())
}

/// Multiples of `step` from `begin` up to, not including, its end.
fn grid(begin: f64, length: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (begin / step).ceil();
    let count = ((begin + length) / step).ceil() - first;
    (0..count.max(0.0) as usize).map(move |k| step * (first + k as f64))
}

/// The observables of two runs in sequence, over `periods` and `more` drive periods.
fn joined(seen: &Observables, periods: f64, next: &Observables, more: f64) -> Observables {
    let (most, least) = (f64::max, f64::min);
    Observables {
        tip_max: most(seen.tip_max, next.tip_max),
        tip_min: least(seen.tip_min, next.tip_min),
        indentation: most(seen.indentation, next.indentation),
        peak_force: most(seen.peak_force, next.peak_force),
        least_force: least(seen.least_force, next.least_force),
        impact_speed: most(seen.impact_speed, next.impact_speed),
        gap_range: [
            least(seen.gap_range[0], next.gap_range[0]),
            most(seen.gap_range[1], next.gap_range[1]),
        ],
        contact_fraction: (periods * seen.contact_fraction + more * next.contact_fraction)
            / (periods + more),
        energy_balance: seen.energy_balance.followed_by(&next.energy_balance),
        periods: periods + more,
        ..*seen
    }
}

impl Curves {
    /// Adds a piece and the motion under it, at multiples of `step` drive periods.
    fn add(&mut self, run: &PieceRun<'_>, step: f64) {
        let (model, recording) = (run.model, &run.recorded.recording);
        let scale = model.period() / run.piece.length;
        let over_time = |output: &Output| {
            let curve = recording.curve(output);
            let at = move |time: f64| Some((time, curve.at(scale * (time - run.before[0]))?));
            grid(run.before[0], run.piece.length, step).filter_map(at)
        };
        let signal = |time| (time, run.piece.at(time - run.before[0]));
        self.signal
            .extend(grid(run.before[0], run.piece.length, step).map(signal));
        self.tip.extend(over_time(&model.tip));
        self.surface.extend(over_time(&model.surface()));
        for (from, to) in contact_intervals(model, recording, 1.0) {
            let ends = [from, to].map(|part| run.before[0] + run.piece.length * part);
            match self.contacts.last_mut() {
                // A piece ended during the contact.
                Some(last) if ends[0] - last.1 < 1e-9 => last.1 = ends[1],
                _ => self.contacts.push(ends.into()),
            }
        }
    }
}
