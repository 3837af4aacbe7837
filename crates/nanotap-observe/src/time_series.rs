//! A motion as a table with one row per instant, for files and for Python.

use nanotap_flow::Output;

use nanotap_case::Case;
use nanotap_case::quantity::Kind;
use nanotap_case::units::Units;
use nanotap_model::recording::Recording;
use nanotap_model::{Model, MotionError};

/// Largest number of rows of a time series: they take some gigabytes.
pub const MAX_ROWS: usize = 10_000_000;

/// The columns before the state.
const COLUMNS: [&str; 6] = ["tau", "tip", "tip_rate", "gap", "force", "contact"];

/// The columns of [`sample`], in order: `tau`, `tip` (W or x), `tip_rate`, `gap`, `force`,
/// `contact` (1 in contact, otherwise 0), then the state (`a1 … aN, v1 … vN` and `s1` for a sample
/// with memory, or `x, v`).
pub fn columns(model: &Model) -> Vec<String> {
    let mut names: Vec<String> = COLUMNS.map(str::to_owned).to_vec();
    names.extend(state_names(model));
    names
}

/// Columns of a physical case in SI: their heads without the unit, by index.
const IN_SI: [(&str, Kind); 5] = [
    ("time", Kind::Time),
    ("tip", Kind::Length),
    ("tip_rate", Kind::Velocity),
    ("gap", Kind::Length),
    ("force", Kind::Force),
];

/// The heads of the columns in these units. States stay in the model's units.
pub fn heads(model: &Model, units: &Units) -> Vec<String> {
    let names = columns(model).into_iter().enumerate();
    let head = |(k, name): (usize, String)| match (units, IN_SI.get(k)) {
        (Units::Si(_), Some((name, kind))) => units.column(name, *kind),
        _ => units.state_column(&name),
    };
    names.map(head).collect()
}

/// A row in the units of its [`heads`].
pub fn scaled<'a>(row: &'a [f64], units: &'a Units) -> impl Iterator<Item = f64> + 'a {
    row.iter().enumerate().map(|(k, value)| match IN_SI.get(k) {
        Some((_, kind)) => units.scaled(*kind, *value),
        None => *value,
    })
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
