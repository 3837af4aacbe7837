//! The curve at a finite speed: the distance changes each drive period, by the period's length
//! times the speed, and the lever is given no time to settle.

use nanotap_dynamics::Control;

use super::quasistatic::MOVING;
use super::{ApproachPoint, Curve, Way};
use nanotap_case::MovingGap;
use nanotap_error::Error;
use nanotap_model::{Model, MotionError};
use nanotap_observe::{ObservableSet, measure};

/// Most drive periods there and back.
const MAX_PERIODS: usize = 2_000_000;

/// The rows at these distances, from far to near and back, from a state at the first. Each is
/// observed over the one period in which the lever is there.
pub(super) fn ramp(
    curve: &Curve<'_>,
    speed: f64,
    distances: &[f64],
    start: &[f64],
    control: &Control<'_>,
) -> Result<Vec<ApproachPoint>, Error> {
    let case = curve.case;
    let mut lever = MovingGap::new(&case.with(case.gap_key(), distances[0]))?;
    let step = speed * lever.period();
    let span = distances[0] - distances[distances.len() - 1];
    let needed = 2.0 * span / step;
    if needed.is_nan() || needed > MAX_PERIODS as f64 {
        return Err(Error::input(
            format!(
                "at this speed the lever takes {needed:.3e} drive periods there and back; \
                 {MAX_PERIODS} are followed at most"
            ),
            "raise {speed}, or leave it away: the lever then settles at each distance",
        ));
    }
    let there = distances.iter().map(|&gap| (Way::Approach, gap));
    let back = distances.iter().rev().map(|&gap| (Way::Retract, gap));
    let turn = distances.len() - 1;
    // Periods from the first distance to each, there and then back.
    let whole = |gap: f64| ((distances[0] - gap) / step).round() as usize;
    if distances
        .windows(2)
        .any(|pair| whole(pair[0]) == whole(pair[1]))
    {
        return Err(Error::input(
            "at this speed less than a drive period passes between two written distances",
            "lower {speed} or {points}",
        ));
    }
    let mut state = start.to_vec();
    let mut before = distances[0];
    let mut table = Vec::with_capacity(2 * distances.len());
    for (row_index, (way, gap)) in there.chain(back).enumerate() {
        if control.is_cancelled() {
            break;
        }
        // The last of the periods from the distance before is written.
        let first = row_index == 0 || row_index == turn + 1;
        let periods = if first {
            1
        } else {
            whole(gap).abs_diff(whole(before))
        };
        for k in 1..=periods {
            let share = k as f64 / periods as f64;
            let at = before * (1.0 - share) + gap * share;
            let failed =
                |error: MotionError| Error::numerics(format!("at the distance {at}: {error}"));
            lever.set(at).map_err(failed)?;
            if k == periods {
                let here = lever.model().map_err(failed)?;
                table.push(row(curve, way, gap, here, &state).map_err(failed)?);
            }
            lever.advance(&mut state).map_err(failed)?;
            if control.is_cancelled() {
                break;
            }
        }
        if let Some(progress) = control.progress {
            progress(table.len(), 2 * distances.len());
        }
        before = gap;
    }
    Ok(table)
}

fn row(
    curve: &Curve<'_>,
    way: Way,
    gap: f64,
    model: &Model,
    state: &[f64],
) -> Result<ApproachPoint, MotionError> {
    let seen = measure(model, state, 1, ObservableSet::COMMON)?;
    Ok(ApproachPoint::new(
        curve.case,
        (way, gap),
        MOVING,
        Some(&seen),
        None,
    ))
}
