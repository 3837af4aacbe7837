//! Checks of a sweep before anything is computed.

use super::distances::has_setpoint;
use super::follow::Follow;
use super::options::SweepOptions;
use super::run::Starts;
use nanotap_case::{Case, Key};
use nanotap_dataset::store::MAX_CHUNK_BYTES;
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_motions::simulate::starting_state;
use nanotap_study::over::Over;
use nanotap_study::start_box::box_with;
use nanotap_study::target::Target;

/// Most bytes that one chunk may take in memory.
pub(super) const LARGEST_CHUNK: usize = MAX_CHUNK_BYTES;
/// Most runs of a sweep.
const MAX_RUNS: usize = 1_000_000_000;
/// Most periods of a run.
const MAX_PERIODS: usize = 100_000_000;

/// Checks options against the case.
pub(super) fn check(
    case: &Case,
    options: &SweepOptions,
    over: &[Over],
    starts: &Starts,
) -> Result<(), Error> {
    let refused = |message: String| Err(Error::input(message, "change {over}"));
    if !(1..=2).contains(&over.len()) {
        return refused(format!(
            "{} parameters to vary; one or two can be varied in one sweep",
            over.len()
        ));
    }
    for (what, number) in [
        ("0 periods to record", options.periods),
        ("0 starts", starts.count()),
        ("0 as the longest period", options.max_period),
    ] {
        if number == 0 {
            return Err(Error::input(
                format!("{what}; at least 1 is needed"),
                "give 1 or more",
            ));
        }
    }
    let lanes = starts
        .count()
        .saturating_mul(options.follow.directions().len().max(1));
    let runs = over
        .iter()
        .fold(lanes, |runs, range| runs.saturating_mul(range.count));
    if runs > MAX_RUNS {
        return Err(too_much(format!(
            "{runs} runs are too many for one dataset; {MAX_RUNS} at most"
        )));
    }
    if options.periods > MAX_PERIODS {
        return Err(too_much(format!(
            "{} periods to record are too many; {MAX_PERIODS} at most",
            options.periods
        )));
    }
    if has_setpoint(over) && options.follow != Follow::Off {
        return Err(Error::option(
            "follow",
            "expected `off` where drive.setpoint varies: each of its distances is approached from far",
            "leave {follow} out",
        ));
    }
    corners(case, over)?;
    fits(case, over, starts)
}

/// Conditions on the number of motions need more than one start.
pub(super) fn targets(targets: &[Target], starts: &Starts) -> Result<(), Error> {
    match targets.iter().find(|target| target.counts_states()) {
        Some(target) if starts.count() < 2 => Err(Error::option(
            "where",
            format!("`{target}`: from one start one motion is found"),
            "sample several {starts}, or use a window",
        )),
        _ => Ok(()),
    }
}

/// The error of a sweep that is too large.
fn too_much(message: String) -> Error {
    Error::input(message, "take less at a time")
}

/// The model of a case at `place`, which an error names.
pub(super) fn model(case: &Case, place: &str) -> Result<Model, Error> {
    case.model().map_err(|error| {
        Error::input(
            format!("at {place}: {error}"),
            "keep {over} where the model makes sense",
        )
    })
}

/// Checks the models at the ends of the ranges, which must be of different parameters.
/// What a parameter may be is an interval: if the ends of all ranges are right, what lies
/// between is.
pub(crate) fn corners(case: &Case, over: &[Over]) -> Result<(), Error> {
    if let [x, y] = over
        && x.key == y.key
    {
        let twice = format!(
            "`{}` is varied twice; vary two different parameters",
            x.key.path()
        );
        return Err(Error::input(twice, "change {over}"));
    }
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
            let mut place = over[0].named(case, first);
            let mut corner = over[0].apply(case, first);
            if let Some(range) = over.get(1) {
                corner = range.apply(&corner, second);
                place = format!("{place}, {}", range.named(case, second));
            }
            model(&corner, &place)?;
        }
    }
    Ok(())
}

/// Starts must fit the models at both ends: the shortest and the longest state.
fn fits(case: &Case, over: &[Over], starts: &Starts) -> Result<(), Error> {
    let modes_vary = over.iter().any(|range| range.key == Key::Modes);
    if modes_vary && matches!(starts, Starts::Given(_)) {
        return Err(Error::input(
            "a state cannot be given while the number of modes varies: states differ in length",
            "leave {state} out: every run starts from rest",
        ));
    }
    for last in [false, true] {
        let end = |case, range: &Over| range.apply(&case, if last { range.count - 1 } else { 0 });
        let model = model(&over.iter().fold(case.clone(), end), "an end of the ranges")?;
        let sides: &[_] = match starts {
            Starts::Rest => continue,
            Starts::Given(state) => {
                starting_state(&model, Some(&state.clone().into()))?;
                continue;
            }
            Starts::Seeded { sides, .. } => sides,
            Starts::Spread { .. } => &[],
        };
        box_with(&model, sides).map_err(|error| {
            Error::input(
                format!("the box of starts: {}", error.message()),
                "name coordinates of the {box}, as in a1=-1:1",
            )
        })?;
    }
    Ok(())
}

/// Whether one chunk fits into memory.
pub(super) fn check_size(bytes: usize, follow: Follow) -> Result<(), Error> {
    if bytes <= LARGEST_CHUNK {
        return Ok(());
    }
    let remedy = if follow == Follow::Off {
        "record fewer {periods}, or keep fewer states with {strobe}"
    } else {
        "a followed line is one chunk: record fewer {periods}, keep fewer states with {strobe}, \
         or take fewer values"
    };
    Err(too_much(format!(
        "one chunk would take {:.1} GiB of memory, more than {} GiB; {remedy}",
        bytes as f64 / (1u64 << 30) as f64,
        LARGEST_CHUNK >> 30
    )))
}
