//! What a motion that was followed on a coarse map is on the map itself.
//!
//! A coarse map is near the map in every period, but its motions may differ: an orbit may have
//! another period near a flip, or be missing near a fold. So an orbit counts only if Newton
//! closes it on the map, from the coarse orbit's points and near them, and its multipliers there say
//! stable. In any other case the run goes on exactly from where the coarse one ended, within the
//! budgets of [`ClassifyOptions`], and has the name that it gets there.
//!
//! Fails: where the exact motion from a start goes to another attractor than the coarse one, as it
//! does from states within the coarse map's error of a basin's boundary.

use crate::classify::{
    Classified, ClassifyOptions, KnownMotions, MotionKind, UndecidedReason, classify_on,
};
use crate::map::StroboscopicMap;
use crate::orbit::{PeriodicOrbit, close_orbit_from_points};

/// Distance of an exact orbit from the coarse one, as a part of its size, up to which it is that.
const NEAR: f64 = 0.02;

/// The stable orbit of `map` that an orbit of its coarse map stands for; `None` if Newton closes none
/// near it.
pub(crate) fn close_exactly<M: StroboscopicMap>(
    map: &mut M,
    coarse: &PeriodicOrbit,
    options: &ClassifyOptions,
) -> Option<PeriodicOrbit> {
    let points = coarse.flat();
    let orbit = close_orbit_from_points(map, &points, coarse.period, &options.shooting).ok()?;
    let is_near = orbit.distance_to(coarse).1 <= NEAR * coarse.scale() + 10.0 * coarse.error;
    (is_near && orbit.is_stable()).then_some(orbit)
}

/// The motion of `map` that was `found` from `start` on its coarse map. Chaos that is `known` was
/// measured on the map itself.
pub(crate) fn confirm<M: StroboscopicMap>(
    map: &mut M,
    mut found: Classified,
    start: &[f64],
    known: KnownMotions<'_>,
    options: &ClassifyOptions,
) -> Classified {
    let met: Vec<_> = std::mem::take(&mut found.met)
        .iter()
        .filter_map(|orbit| close_exactly(map, orbit, options))
        .collect();
    let closed = match &found.kind {
        MotionKind::Periodic(orbit) | MotionKind::TransientChaos { orbit, .. } => {
            close_exactly(map, orbit, options)
        }
        _ => None,
    };
    if let (MotionKind::Periodic(orbit) | MotionKind::TransientChaos { orbit, .. }, Some(closed)) =
        (&mut found.kind, closed)
    {
        *orbit = closed;
        found.state = orbit.nearest(&found.state).0.to_vec();
        found.met = met;
        return found;
    }
    let from = match &found.kind {
        MotionKind::Chaotic(chaos) if known.chaos.contains(&chaos.spectrum) => return found,
        MotionKind::Undecided {
            reason: UndecidedReason::BadStart(_) | UndecidedReason::Cancelled,
            ..
        } => return found,
        // The coarse map may have failed where the map does not.
        MotionKind::Unbounded
        | MotionKind::Undecided {
            reason: UndecidedReason::Map { .. },
            ..
        } => start,
        _ => &found.state,
    };
    let mut exact = classify_on(map, from, known, options);
    exact.periods += found.periods;
    exact.met.extend(met);
    exact
}
