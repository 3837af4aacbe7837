//! How far a value of the case may change before a state ends, while the setpoint is held.
//!
//! The feedback holds the setpoint by the distance, which is solved for along the way: at each value of
//! the key the orbit expected on the line through the two orbits before it is closed by Newton, at
//! distances chosen by the secant rule, until the held quantity is at its setpoint. Steps are halved
//! where this fails, so that the end is known to [`SHORTEST`]: a fold, or a loss of stability. An
//! amplitude is held in metres, as an instrument holds it: with another free amplitude the setpoint is
//! another part of it.
//!
//! Fails by omission: a state that ends and exists again beyond a gap is followed to the gap alone.

use nanotap_case::physical::{Held, Kind};
use nanotap_case::{Case, Key};
use nanotap_dynamics::{Control, PeriodicOrbit, ShootingOptions, close_orbit};
use nanotap_error::Error;
use nanotap_model::model_map::ModelMap;
use nanotap_observe::Observables;
use nanotap_study::FreeMotion;

use super::{HeldQuantity, NearOrbit, cancelled, closed, orbit_at_setpoint};

/// First step of the key, over the whole way.
const FIRST: f64 = 1e-3;
/// Longest step of the key, over the whole way.
const LONGEST: f64 = 1.0 / 32.0;
/// Step, over the value of the key, below which the state has ended.
const SHORTEST: f64 = 1e-6;
/// Values of the key at most.
const MAX_VALUES: usize = 500;
/// Distances at most at one value of the key.
const MAX_DISTANCES: usize = 12;
/// Difference of distances from which the first slope of the held quantity is computed, over the free
/// amplitude.
const DIFFERENCE: f64 = 1e-4;
/// Deviation from the setpoint, over it, at which the distance is found.
const TOLERANCE: f64 = 1e-10;
/// Part of its expected change by which an orbit may differ from what is expected.
const UNEXPECTED: f64 = 0.5;
/// The same as a part of its size, where hardly a change is expected.
const LEAST_CHANGE: f64 = 1e-4;

/// An orbit at the setpoint, in m.
#[derive(Clone)]
struct Place {
    /// Value of the key.
    value: f64,
    gap: f64,
    points: Vec<f64>,
    /// Change of the held quantity with the distance, in the model's units.
    slope: f64,
}

impl Place {
    /// The place at another value of the key, on the line through this place and the one before it.
    fn beyond(&self, before: &Self, value: f64) -> Self {
        let share = (value - self.value) / (self.value - before.value);
        let on_line = |now: f64, before: f64| now + share * (now - before);
        let pairs = self.points.iter().zip(&before.points);
        Self {
            value,
            gap: on_line(self.gap, before.gap),
            points: pairs.map(|(now, before)| on_line(*now, *before)).collect(),
            slope: self.slope,
        }
    }

    /// Largest difference of distance and points from another place.
    fn differs(&self, other: &Self) -> f64 {
        let pairs = self.points.iter().zip(&other.points);
        let points = pairs.map(|(a, b)| (a - b).abs());
        points.fold((self.gap - other.gap).abs(), f64::max)
    }

    fn size(&self) -> f64 {
        self.points.iter().fold(0.0, |most, x| most.max(x.abs()))
    }
}

/// The interval of a key in which a stable state ends on the way to the value `to`, while the setpoint of
/// the case is held: the last value with the state, and the first one without it. `None` if it is
/// followed all the way. An amplitude is held in m.
///
/// # Errors
/// When the case has no setpoint of amplitude, phase or peak force, no stable orbit of the setpoint is
/// near, or the work was cancelled.
pub fn end_at_setpoint(
    case: &Case,
    near: &NearOrbit,
    key: Key,
    to: f64,
    control: &Control<'_>,
) -> Result<Option<[f64; 2]>, Error> {
    let case = in_metres(case);
    let from = case.get(key);
    let first = orbit_at_setpoint(&case, near)?;
    if !first.stable {
        return Err(Error::numerics("no stable orbit of the setpoint is near"));
    }
    let unit = case.physical().map_or(1.0, |view| view.scales.length);
    let orbit = near_orbit(&case, first.gap, &first.state, near.period)
        .ok_or_else(|| Error::numerics("no orbit of the setpoint is near"))?;
    let mut last = Place {
        value: from,
        gap: first.gap * unit,
        points: orbit.states.concat().iter().map(|x| x * unit).collect(),
        slope: f64::NAN,
    };
    let mut before: Option<Place> = None;
    let whole = to - from;
    let mut step = FIRST * whole;
    for _ in 0..MAX_VALUES {
        if control.is_cancelled() {
            return Err(cancelled());
        }
        let left = to - last.value;
        let value = if step.abs() < left.abs() {
            last.value + step
        } else {
            to
        };
        let expected = match &before {
            Some(before) => last.beyond(before, value),
            None => Place {
                value,
                ..last.clone()
            },
        };
        let least = LEAST_CHANGE * last.size();
        let most = match &before {
            Some(_) => least.max(UNEXPECTED * expected.differs(&last)),
            None => UNEXPECTED * last.size(),
        };
        let next = at_setpoint(&case.with(key, value), &expected, near.period);
        match next.filter(|next| next.differs(&expected) <= most) {
            Some(_) if value == to => return Ok(None),
            Some(next) => {
                before = Some(std::mem::replace(&mut last, next));
                step = (2.0 * step).clamp(-LONGEST * whole.abs(), LONGEST * whole.abs());
            }
            None if (value - last.value).abs() <= SHORTEST * last.value.abs() => {
                return Ok(Some([last.value, value]));
            }
            None => step = 0.5 * (value - last.value),
        }
    }
    Err(Error::numerics(
        "the end of the state was not reached in the allowed number of steps",
    ))
}

/// The case with an amplitude of its setpoint in m, in place of a part of the free amplitude.
fn in_metres(case: &Case) -> Case {
    match case.physical().and_then(|view| Some((view, view.held?))) {
        Some((view, Held::Amplitude(ratio))) => {
            case.with_setpoint(ratio * view.free_amplitude, Kind::Length)
        }
        _ => case.clone(),
    }
}

/// The orbit of a period near a state at a distance.
fn near_orbit(case: &Case, gap: f64, state: &[f64], period: usize) -> Option<PeriodicOrbit> {
    let model = case.with(case.gap_key(), gap).model().ok()?;
    let mut map = ModelMap::new(&model);
    close_orbit(&mut map, state, period, &ShootingOptions::default()).ok()
}

/// The stable orbit at the setpoint of a case near an expected place.
fn at_setpoint(case: &Case, expected: &Place, period: usize) -> Option<Place> {
    let view = case.physical()?;
    let unit = view.scales.length;
    let free = FreeMotion::of(&case.model().ok()?);
    let held = HeldQuantity::new(view.held?, &free, view.scales.force).ok()?;
    let close = |gap: f64, points: &[f64]| -> Option<(PeriodicOrbit, Observables)> {
        closed(
            &case.with(case.gap_key(), gap).model().ok()?,
            points,
            period,
        )
    };
    let points: Vec<f64> = expected.points.iter().map(|x| x / unit).collect();
    let mut gap = expected.gap / unit;
    let (mut orbit, seen) = close(gap, &points)?;
    let mut value = held.of(&seen);
    let mut slope = expected.slope;
    if slope.is_nan() {
        let difference = DIFFERENCE * free.amplitude;
        let (_, seen) = close(gap + difference, &orbit.states.concat())?;
        slope = (held.of(&seen) - value) / difference;
    }
    for _ in 0..MAX_DISTANCES {
        if (value - held.target).abs() <= TOLERANCE * held.target.abs() {
            let points = orbit.states.concat();
            return orbit.is_stable().then(|| Place {
                value: expected.value,
                gap: gap * unit,
                points: points.iter().map(|x| x * unit).collect(),
                slope,
            });
        }
        let change = (held.target - value) / slope;
        let (next, seen) = close(gap + change, &orbit.states.concat())?;
        let reached = held.of(&seen);
        slope = (reached - value) / change;
        (gap, orbit, value) = (gap + change, next, reached);
    }
    None
}
