//! What makes a sweep impossible, found before anything is computed.

use super::SweepOptions;
use super::follow::Follow;
use super::over::Over;
use super::run::Starts;
use crate::case::CaseError;
use crate::case::{Case, Key};
use crate::study::simulate::{SimulateError, starting_state};
use crate::study::start_box::{SideError, box_with};

/// Most bytes that one chunk may take in memory.
pub(super) const LARGEST_CHUNK: usize = 1 << 30;
/// Most runs of a sweep, and most periods of a run.
const MOST_RUNS: usize = 1_000_000_000;
const MOST_PERIODS: usize = 100_000_000;

/// Why a sweep was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SweepError {
    /// No parameter, or more than two.
    #[error("{count} parameters to vary; one or two can be varied in one sweep")]
    Count {
        /// How many were given.
        count: usize,
    },
    /// One parameter twice.
    #[error("`{name}` is varied twice; vary two different parameters")]
    Twice {
        /// Its name.
        name: &'static str,
    },
    /// Numbers that make no range.
    #[error("`{name}`: {what}")]
    Range {
        /// The parameter.
        name: &'static str,
        /// What is wrong.
        what: String,
    },
    /// A value that makes no case.
    #[error("at {place}: {source}")]
    Model {
        /// The values of the parameters there.
        place: String,
        /// What is wrong.
        source: CaseError,
    },
    /// A start that does not fit.
    #[error(transparent)]
    Start(#[from] SimulateError),
    /// A side of the box of starts that does not fit.
    #[error("the box of starts: {0}")]
    Box(#[from] SideError),
    /// States of different length.
    #[error("a state cannot be given while the number of modes varies: states differ in length")]
    StateWithModes,
    /// A number that must be larger.
    #[error("{what}; at least 1 is needed")]
    Zero {
        /// What was 0.
        what: &'static str,
    },
    /// Too much of something.
    #[error("{what}")]
    TooMuch {
        /// What, and what would do.
        what: String,
    },
}

/// Checks options against the case.
pub(super) fn check(case: &Case, options: &SweepOptions) -> Result<(), SweepError> {
    let over = &options.over;
    if !(1..=2).contains(&over.len()) {
        return Err(SweepError::Count { count: over.len() });
    }
    if over.len() == 2 && over[0].key == over[1].key {
        return Err(SweepError::Twice {
            name: over[0].key.path(),
        });
    }
    for range in over {
        let name = range.key.path();
        range
            .check()
            .map_err(|what| SweepError::Range { name, what })?;
    }
    for (what, number) in [
        ("0 periods to record", options.periods),
        ("0 starts", options.starts.count()),
        ("0 as the longest period", options.max_period),
    ] {
        if number == 0 {
            return Err(SweepError::Zero { what });
        }
    }
    let lanes = options
        .starts
        .count()
        .saturating_mul(options.follow.directions().len().max(1));
    let runs = over
        .iter()
        .fold(lanes, |runs, range| runs.saturating_mul(range.count));
    if runs > MOST_RUNS {
        let what = format!("{runs} runs are too many for one dataset; {MOST_RUNS} at most");
        return Err(SweepError::TooMuch { what });
    }
    if options.periods > MOST_PERIODS {
        let what = format!(
            "{} periods to record are too many; {MOST_PERIODS} at most",
            options.periods
        );
        return Err(SweepError::TooMuch { what });
    }
    corners(case, over)?;
    starts(case, options)
}

/// What a parameter may be is an interval: if the ends of all ranges are right, what lies
/// between is.
fn corners(case: &Case, over: &[Over]) -> Result<(), SweepError> {
    let ends = |range: &Over| {
        if range.count > 1 {
            vec![0, range.count - 1]
        } else {
            vec![0]
        }
    };
    let second = over.get(1).map_or(vec![0], ends);
    for first in ends(&over[0]) {
        for &second in &second {
            let mut place = format!("{} = {}", over[0].key.path(), over[0].value(first));
            let mut corner = over[0].apply(case, first);
            if let Some(range) = over.get(1) {
                corner = range.apply(&corner, second);
                place = format!("{place}, {} = {}", range.key.path(), range.value(second));
            }
            corner
                .model()
                .map_err(|source| SweepError::Model { place, source })?;
        }
    }
    Ok(())
}

/// Starts must fit the models at both ends: the shortest and the longest state.
fn starts(case: &Case, options: &SweepOptions) -> Result<(), SweepError> {
    let modes_vary = options.over.iter().any(|range| range.key == Key::Modes);
    if modes_vary && matches!(options.starts, Starts::Given(_)) {
        return Err(SweepError::StateWithModes);
    }
    for last in [false, true] {
        let end = |case, range: &Over| range.apply(&case, if last { range.count - 1 } else { 0 });
        let model = options.over.iter().fold(case.clone(), end).model();
        let place = "an end of the ranges".to_owned();
        let model = model.map_err(|source| SweepError::Model { place, source })?;
        match &options.starts {
            Starts::Rest => {}
            Starts::Given(state) => drop(starting_state(&model, Some(state))?),
            Starts::Seeded { sides, .. } => drop(box_with(&model, sides)?),
            Starts::Spread { .. } => drop(box_with(&model, &[])?),
        }
    }
    Ok(())
}

/// Whether one chunk fits into memory.
pub(super) fn check_size(bytes: usize, follow: Follow) -> Result<(), SweepError> {
    if bytes <= LARGEST_CHUNK {
        return Ok(());
    }
    let remedy = if follow == Follow::Off {
        "record fewer {periods}, or keep fewer states with {strobe}"
    } else {
        "a followed line is one chunk: record fewer {periods}, keep fewer states with {strobe}, \
         or take fewer values"
    };
    let what = format!(
        "one chunk would take {:.1} GiB of memory, more than {} GiB; {remedy}",
        bytes as f64 / (1u64 << 30) as f64,
        LARGEST_CHUNK >> 30
    );
    Err(SweepError::TooMuch { what })
}

impl From<SweepError> for crate::Error {
    fn from(error: SweepError) -> Self {
        let remedy = match &error {
            SweepError::Count { .. } | SweepError::Twice { .. } | SweepError::Range { .. } => {
                "change {over}"
            }
            SweepError::Model { .. } => "keep {over} where the model makes sense",
            SweepError::Start(_) => "count the numbers of {state}",
            SweepError::Box(_) => "name coordinates of the {box}, as in a1=-1:1",
            SweepError::StateWithModes => "leave {state} out: every run starts from rest",
            SweepError::Zero { .. } => "give 1 or more",
            SweepError::TooMuch { .. } => "take less at a time",
        };
        Self::input(error.to_string(), remedy)
    }
}
