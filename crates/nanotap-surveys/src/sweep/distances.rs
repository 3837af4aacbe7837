//! The distances of a sweep over setpoints, `drive.setpoint=0.5:0.9:9` or `1nN:5nN:5`: at every value
//! the distance at which the setpoint is first reached on a slow approach from far
//! ([`setpoint`](nanotap_motions::setpoint)).
//!
//! One approach serves all setpoints at a value of the other parameter. Where a setpoint is not
//! reached there is no distance, and no motion is reported there.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::Control;
use rayon::prelude::*;

use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_motions::setpoint::{ReachedDistance, reached_distances};
use nanotap_study::over::Over;

/// The distance at each value of the parameters, or why it has none, the first parameter fastest.
pub(super) type Distances = Arc<Vec<Result<ReachedDistance, String>>>;

/// Whether a setpoint is among the parameters.
pub(super) fn has_setpoint(over: &[Over]) -> bool {
    over.iter().any(|over| over.key == Key::DriveSetpoint)
}

/// Solves for the distances of a sweep over setpoints; `None` of another sweep.
///
/// # Errors
/// When the distance is varied too, or the work was cancelled.
pub(super) fn solved(
    case: &Case,
    over: &[Over],
    control: &Control<'_>,
) -> Result<Option<Distances>, Error> {
    let Some(axis) = over.iter().position(|over| over.key == Key::DriveSetpoint) else {
        return Ok(None);
    };
    let distance = |over: &&Over| [Key::GapTip, case.gap_key()].contains(&over.key);
    if let Some(distance) = over.iter().find(distance) {
        return Err(Error::input(
            format!(
                "`{}` and `drive.setpoint`: the setpoint is solved for the distance",
                distance.key.path()
            ),
            "vary one of the two in {over}",
        ));
    }
    let other = over.get(1 - axis);
    let count = over[axis].count;
    let lines = other.map_or(1, |other| other.count);
    let done = AtomicUsize::new(0);
    let quiet = Control {
        progress: None,
        ..*control
    };
    let found: Vec<_> = (0..lines)
        .into_par_iter()
        .with_max_len(1)
        .map(|line| {
            let case = other.map_or_else(|| case.clone(), |other| other.apply(case, line));
            let cases: Vec<Case> = (0..count).map(|k| over[axis].apply(&case, k)).collect();
            let found = reached_distances(&cases, &quiet);
            if let Some(progress) = control.progress {
                progress(done.fetch_add(1, Ordering::Relaxed) + 1, lines);
            }
            found
        })
        .collect();
    let mut rows = Vec::with_capacity(lines);
    for row in found {
        // A line that cannot be approached has no distances; the others count.
        rows.push(match row {
            Ok(row) => row,
            Err(error) if control.is_cancelled() => return Err(error),
            Err(error) => vec![Err(error.message()); count],
        });
    }
    let columns = over[0].count;
    let points = lines * count;
    let at = |k: usize| {
        let place = [k % columns, k / columns];
        rows[if other.is_some() { place[1 - axis] } else { 0 }][place[axis]].clone()
    };
    Ok(Some(Arc::new((0..points).map(at).collect())))
}
