//! A motion as a table, a row an instant: for files and for Python.

use std::sync::Arc;

use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Flow, Output};

use crate::model::recording::each_period;
use crate::model::{Model, MotionError};

/// Most rows of a time series, in all: they fill some gigabytes.
pub const MOST_ROWS: usize = 10_000_000;

/// The columns before the state.
const COLUMNS: [&str; 6] = ["tau", "tip", "tip_rate", "gap", "force", "contact"];

/// The columns of [`sample`], in order: `tau`, `tip` (W or x), `tip_rate`, `gap`, `force`,
/// `contact` (1 in contact, else 0), then the state (`a1 … aN, v1 … vN` and `s1` of a sample
/// with a memory, or `x, v`).
pub fn columns(model: &Model) -> Vec<String> {
    let mut names: Vec<String> = COLUMNS.map(str::to_owned).to_vec();
    names.extend(state_names(model));
    names
}

/// What the numbers of a state are called.
pub fn state_names(model: &Model) -> Vec<String> {
    if model.beam.is_none() {
        return vec!["x".to_owned(), "v".to_owned()];
    }
    let n = (model.dimension() - model.memory) / 2;
    let named = |letter: char, count: usize| (1..=count).map(move |i| format!("{letter}{i}"));
    named('a', n)
        .chain(named('v', n))
        .chain(named('s', model.memory))
        .collect()
}

/// A state of a beam as one with `modes` modes: more are at rest, fewer are cut off. The
/// last `memory` numbers are the sample's.
pub(crate) fn with_modes(state: &[f64], memory: usize, modes: usize) -> Vec<f64> {
    let (beam, sample) = state.split_at(state.len().saturating_sub(memory));
    let (displacements, velocities) = beam.split_at(beam.len() / 2);
    let fitted = |block: &[f64]| {
        let mut block = block.to_vec();
        block.resize(modes, 0.0);
        block
    };
    [fitted(displacements), fitted(velocities), sample.to_vec()].concat()
}

/// Hands `periods` drive periods from the state `start` at drive phase 0 to `row`,
/// `resolution` equally spaced instants each and the very end; memory is that of one
/// period.
///
/// # Errors
/// When there would be more than [`MOST_ROWS`] rows, and when the flow fails.
pub fn sample(
    model: &Model,
    start: &[f64],
    periods: usize,
    resolution: usize,
    mut row: impl FnMut(&[f64]),
) -> Result<(), MotionError> {
    let rows = periods.saturating_mul(resolution).saturating_add(1);
    if rows > MOST_ROWS {
        let most = MOST_ROWS;
        return Err(MotionError::TooManyRows { rows, most });
    }
    let outputs = Outputs::new(model);
    let instants = |period: usize| {
        let last = usize::from(period + 1 == periods);
        (0..resolution + last).map(|k| model.period() * k as f64 / resolution as f64)
    };
    if let Some(nonlinear) = &model.nonlinear {
        let (mut end, mut count) = (start.to_vec(), 0);
        return each_period(nonlinear, &mut end, periods, |_, period| {
            let tau = count as f64 * model.period();
            for phase in instants(count) {
                let Some(sample) = period.at(phase.min(period.span().1)) else {
                    continue;
                };
                let mut state = sample.state.as_slice().to_vec();
                if nonlinear.remembers {
                    state.push(sample.branch as f64);
                }
                let contact = nonlinear.contact[sample.branch];
                row(&outputs.row(model, contact, sample.force, &state, phase, tau + phase));
            }
            count += 1;
        });
    }
    let mut flow = Flow::new(Arc::clone(&model.system));
    flow.start(start, 0.0)?;
    let mut state = vec![0.0; model.dimension()];
    for period in 0..periods {
        let mut recorder = Recorder::default();
        flow.run_period(&mut recorder)?;
        let trajectory = recorder.finish(Arc::clone(&model.system));
        for phase in instants(period) {
            let Some(segment) = trajectory.segment_at(phase) else {
                continue;
            };
            let Some(at) = trajectory.state_at(phase) else {
                continue;
            };
            state.copy_from_slice(&at);
            let tau = period as f64 * model.period() + phase;
            let contact = model.contact[segment.regime];
            let force = model.force[segment.regime].at(model.system.drive(), &state, phase);
            row(&outputs.row(model, contact, force, &state, phase, tau));
        }
    }
    Ok(())
}

struct Outputs {
    tip_rate: Output,
}

impl Outputs {
    fn new(model: &Model) -> Self {
        Self {
            tip_rate: model.tip_rate(),
        }
    }

    fn row(
        &self,
        model: &Model,
        contact: bool,
        force: f64,
        state: &[f64],
        phase: f64,
        tau: f64,
    ) -> Vec<f64> {
        let at = |output: &Output| output.at(model.system.drive(), state, phase);
        let mut row = vec![
            tau,
            at(&model.tip),
            at(&self.tip_rate),
            at(&model.height),
            force,
            f64::from(u8::from(contact)),
        ];
        row.extend_from_slice(state);
        // In contact the surface is where the tip holds it. A memory that the end of the contact
        // sets anew knows nothing of that.
        if model.memory_reset.is_some() && contact {
            row[COLUMNS.len() + model.dimension() - model.memory] = at(&model.height);
        }
        row
    }
}
