//! A motion as a table with one row per instant, for files and for Python.

use std::rc::Rc;

use nanotap_flow::Output;

use crate::dimension::Dimension;
use crate::frame::{Form, Frame, Rows};
use nanotap_case::Case;
use nanotap_case::quantity::Kind;
use nanotap_case::units::Units;
use nanotap_model::recording::Recording;
use nanotap_model::{Model, MotionError};

/// Largest number of rows of a time series: they take some gigabytes.
pub const MAX_ROWS: usize = 10_000_000;

/// A column of a time series.
pub(crate) struct SeriesColumn {
    pub(crate) name: &'static str,
    /// Name in SI.
    si_name: &'static str,
    pub(crate) words: &'static str,
    pub(crate) dimension: Dimension,
}

const fn column(
    [name, si_name]: [&'static str; 2],
    words: &'static str,
    dimension: Dimension,
) -> SeriesColumn {
    SeriesColumn {
        name,
        si_name,
        words,
        dimension,
    }
}

/// The columns before the state.
pub(crate) const COLUMNS: [SeriesColumn; 6] = [
    column(["tau", "time"], "time", Dimension::Time),
    column(["tip"; 2], "tip deflection W", Dimension::Length),
    column(
        ["tip_rate"; 2],
        "rate of the tip deflection",
        Dimension::Velocity,
    ),
    column(["gap"; 2], "gap between tip and sample", Dimension::Length),
    column(
        ["force"; 2],
        "force of the sample on the tip",
        Dimension::Force,
    ),
    column(["contact"; 2], "1 in contact, else 0", Dimension::Number),
];

/// The columns of [`sample`], in order: `tau`, `tip` (W or x), `tip_rate`, `gap`, `force`,
/// `contact` (1 in contact, otherwise 0), then the state (`a1 … aN, v1 … vN` and `s1` for a sample
/// with memory, or `x, v`).
pub fn columns(model: &Model) -> Vec<String> {
    let names = motion_columns().into_iter();
    names.chain(state_names(model)).collect()
}

/// The columns before the state.
pub fn motion_columns() -> [String; COLUMNS.len()] {
    COLUMNS.map(|column| column.name.to_owned())
}

/// The heads of the columns in these units. States stay in the model's units.
pub fn heads(model: &Model, units: &Units) -> Vec<String> {
    let of_motion = COLUMNS.map(|column| match (units, column.dimension.kind()) {
        (Units::Si(_), Some(kind)) => units.column(column.si_name, kind),
        _ => column.name.to_owned(),
    });
    let states = state_names(model).into_iter();
    let states = states.map(|name| units.state_column(&name));
    of_motion.into_iter().chain(states).collect()
}

/// A row in the units of its [`heads`].
pub fn scaled<'a>(row: &'a [f64], units: &'a Units) -> impl Iterator<Item = f64> + 'a {
    row.iter().enumerate().map(|(k, value)| {
        let kind = COLUMNS.get(k).and_then(|column| column.dimension.kind());
        kind.map_or(*value, |kind| units.scaled(kind, *value))
    })
}

/// The rows of [`sample`], or their first columns, as a table in `units`; `states` are the names of the
/// entries of a state.
pub fn table(states: Vec<String>, rows: Vec<Vec<f64>>, units: Units) -> Frame<'static> {
    let width = rows.first().map_or(0, Vec::len);
    let (count, rows) = (rows.len(), Rc::new(rows));
    let value = |k: usize| {
        let rows = Rc::clone(&rows);
        move |row: usize| rows[row][k]
    };
    let mut table = Rows::new("series", 0..count, Some(units));
    for (k, column) in COLUMNS.iter().enumerate().take(width) {
        let shown = (column.dimension, Form::Digits(5));
        table = table.column(column.name, "", shown, value(k));
        table = table.label(column.words).si_name(column.si_name);
    }
    for (k, name) in states
        .into_iter()
        .enumerate()
        .take(width.saturating_sub(COLUMNS.len()))
    {
        let dimension = match units.of_entry(&name) {
            Some((Kind::Length, _)) => Dimension::Unit("g0"),
            Some(_) => Dimension::Unit("g0/T"),
            None => Dimension::Number,
        };
        let shown = (dimension, Form::Digits(5));
        table = table.column(name, "", shown, value(COLUMNS.len() + k));
        table = table.label("entry of the state");
    }
    table.frame()
}

/// Names of the entries of a state.
pub fn state_names(model: &Model) -> Vec<String> {
    model.state_names()
}

/// The names of the entries of a state of `case`; none if it has no model.
pub fn entry_names(case: &Case) -> Vec<String> {
    case.model()
        .map_or_else(|_| Vec::new(), |model| state_names(&model))
}

/// Converts a state of a beam to `modes` modes: additional modes are at rest, others are cut off.
/// The last `memory` entries are the sample's.
pub fn with_modes(state: &[f64], memory: usize, modes: usize) -> Vec<f64> {
    let (beam, sample) = state.split_at(state.len().saturating_sub(memory));
    let (displacements, velocities) = beam.split_at(beam.len() / 2);
    let fitted = |block: &[f64]| {
        let mut block = block.to_vec();
        block.resize(modes, 0.0);
        block
    };
    [fitted(displacements), fitted(velocities), sample.to_vec()].concat()
}

/// The row of a recording that began a time `before` after that of the series, at a time from the
/// recording's beginning; `None` for an empty recording. `tip_rate` is [`Model::tip_rate`].
pub fn row_at(
    model: &Model,
    tip_rate: &Output,
    recording: &Recording,
    [time, before]: [f64; 2],
) -> Option<Vec<f64>> {
    let instant = recording.instant(time)?;
    let at = |output: &Output| output.at(model.system.drive(), &instant.state, time);
    let contact = model.touches(instant.regime);
    let mut numbers = vec![
        before + time,
        at(&model.tip),
        at(tip_rate),
        at(&model.height),
        model.force_at(&instant),
        f64::from(u8::from(contact)),
    ];
    numbers.extend_from_slice(&instant.state);
    model.set_surface(&mut numbers[COLUMNS.len()..], contact, at(&model.height));
    Some(numbers)
}

/// Calls `row` for `resolution` equidistant instants in each of `periods` drive periods from the
/// state `start` at drive phase 0, and for the end. The memory needed is that of one period.
///
/// # Errors
/// If there would be more than [`MAX_ROWS`] rows, or the flow fails.
pub fn sample(
    model: &Model,
    start: &[f64],
    periods: usize,
    resolution: usize,
    mut row: impl FnMut(&[f64]),
) -> Result<(), MotionError> {
    let rows = periods.saturating_mul(resolution).saturating_add(1);
    if rows > MAX_ROWS {
        return Err(MotionError::TooManyRows {
            rows,
            most: MAX_ROWS,
        });
    }
    let tip_rate = model.tip_rate();
    let mut record = model.recorder(start)?;
    for period in 0..periods {
        let recording = record(1)?;
        let last = usize::from(period + 1 == periods);
        for k in 0..resolution + last {
            let phase = model.period() * k as f64 / resolution as f64;
            let before = period as f64 * model.period();
            if let Some(numbers) = row_at(model, &tip_rate, &recording, [phase, before]) {
                row(&numbers);
            }
        }
    }
    Ok(())
}
