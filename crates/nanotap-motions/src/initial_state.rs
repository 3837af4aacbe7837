//! Which initial state a study followed, where others may lead to other motions.

use nanotap_dynamics::{
    ClassifyOptions, LyapunovOptions, MotionKind, PeriodicOrbit, SameMotion, classify,
};

use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;
use nanotap_study::averaged_orbits::averaged_orbits;
use nanotap_study::start_box::default_starts;

/// Drive periods for which a run from another initial state is followed, to see whether another
/// motion exists.
const FOLLOWED: usize = 256;
/// Periods of the first tone in a drive period above which no other motion is looked for: each run and
/// each step of Newton's method is as many times as long.
const MAX_REPETITION: usize = 16;
/// Steps of time integration of such a run, at most.
const MAX_STEPS: u64 = 1_000_000;

/// States which initial state was followed, and how to list the motions that others lead to.
///
/// Names a period where another stable motion is known: from averaging, or from rest and the linear
/// responses to the drive, with which a census begins, too. Where none is known, others may exist.
/// `given` says whether the initial state was given; `found` is a state of the orbit that it led to.
pub fn initial_state_note(model: &Model, given: bool, found: Option<&[f64]>) -> String {
    let start = match (given, &model.start) {
        (true, _) => "the motion from the given state",
        (false, Some(_)) => "the motion at the setpoint",
        (false, None) => "the motion from rest",
    };
    let other = found.and_then(|found| another_orbit(model, found));
    let others = match other {
        Some(orbit) => format!(
            "other initial states lead to other motions, one of period {} among them",
            orbit.period
        ),
        None => "other initial states may lead to other motions".to_owned(),
    };
    format!("this is {start}; {others}: `attractors` lists them")
}

/// A stable orbit other than that through `found` that little work finds.
fn another_orbit(model: &Model, found: &[f64]) -> Option<PeriodicOrbit> {
    let differs = |orbit: &PeriodicOrbit| {
        let same = 10.0 * orbit.error + SameMotion::TOLERANCE * orbit.scale();
        orbit.is_stable() && orbit.nearest(found).1 > same
    };
    // There even a few runs take long, and over a surface that relaxes slowly.
    let nonlinear = model.nonlinear.as_ref();
    if model.repetition() > MAX_REPETITION || nonlinear.is_some_and(|law| law.is_slow()) {
        return None;
    }
    let mut averaged = averaged_orbits(model).into_iter();
    if let Some(orbit) = averaged.find(differs) {
        return Some(orbit);
    }
    let starts = default_starts(model, 1).ok()?;
    let options = ClassifyOptions {
        max_transient: FOLLOWED,
        long_period: ClassifyOptions::default().max_period,
        lyapunov: LyapunovOptions {
            alignment: 0,
            min_periods: 64,
            max_periods: 64,
            ..LyapunovOptions::default()
        },
        birkhoff_periods: 16,
        max_steps: MAX_STEPS,
        ..ClassifyOptions::default()
    };
    let mut map = ModelMap::new(model);
    (0..starts.given_count())
        .filter_map(|k| starts.start(k))
        .find_map(|start| match classify(&mut map, &start, &options).kind {
            MotionKind::Periodic(orbit) if differs(&orbit) => Some(orbit),
            _ => None,
        })
}
