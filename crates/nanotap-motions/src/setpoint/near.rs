//! The orbit at a setpoint near a known one, without an approach.

use nanotap_case::Case;
use nanotap_dynamics::{PeriodicOrbit, ShootingOptions, close_orbit};
use nanotap_error::Error;
use nanotap_model::model_map::ModelMap;
use nanotap_observe::Observables;
use nanotap_study::FreeMotion;

use super::{HeldQuantity, Sample, SetpointSolution, closed, crossing, measured, solution};

/// An orbit near which one at the setpoint is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct NearOrbit {
    /// The distance, in the model's unit of length.
    pub gap: f64,
    /// Period of the orbit, in drive periods.
    pub period: usize,
    /// State near the orbit at drive phase 0, in the model's units.
    pub state: Vec<f64>,
    /// Whether it is stable.
    pub stable: bool,
}

/// First step of the distance from a nearby orbit, over the free amplitude.
const FIRST_STEP: f64 = 1e-3;
/// Longest step of the distance, over the free amplitude.
const LONGEST_STEP: f64 = 0.02;
/// Steps of the distance at most.
const DISTANCE_STEPS: usize = 60;
/// Shortest step before the branch is given up, over the free amplitude.
const SHORTEST_STEP: f64 = 1e-6;
/// Part of an orbit's size by which the orbit after the first step may differ.
const FIRST_CHANGE: f64 = 0.05;
/// Part of its expected change by which a later one may differ from what is expected.
const UNEXPECTED: f64 = 0.5;
/// The same as a part of its size, where hardly a change is expected.
const LEAST_CHANGE: f64 = 1e-6;

/// An orbit on the way to the setpoint.
struct Step {
    gap: f64,
    orbit: PeriodicOrbit,
    observables: Observables,
}

impl Step {
    fn at(gap: f64, (orbit, observables): (PeriodicOrbit, Observables)) -> Self {
        Self {
            gap,
            orbit,
            observables,
        }
    }

    fn points(&self) -> Vec<f64> {
        self.orbit.states.concat()
    }

    /// Number of directions in which a disturbance grows.
    fn growing(&self) -> usize {
        let multipliers = self.orbit.multipliers.iter();
        multipliers
            .filter(|multiplier| multiplier.norm_sqr() > 1.0)
            .count()
    }
}

/// The orbit at the setpoint of a case to which the branch of a nearby orbit leads, stable or not: some
/// ten orbits instead of an approach.
///
/// The branch is followed by secants in the distance, each orbit expected on the line through the two
/// before it, so that it ends at a fold: an orbit beyond one is not found.
///
/// # Errors
/// When the case has no setpoint of amplitude, phase or peak force, no orbit of this stability is near,
/// or the branch ends before the setpoint.
pub fn orbit_at_setpoint(case: &Case, near: &NearOrbit) -> Result<SetpointSolution, Error> {
    let free = FreeMotion::of(&case.model()?);
    let view = case.physical();
    let (Some(view), Some(setpoint)) = (view, view.and_then(|view| view.held)) else {
        return Err(Error::input(
            "the case has no setpoint: give drive.setpoint, as in setpoint = 0.8",
            "give drive.setpoint",
        ));
    };
    let held = HeldQuantity::new(setpoint, &free, view.scales.force)?;
    let key = case.gap_key();
    let model_at = |gap: f64| case.with(key, gap).model().ok();
    let ended = || Error::numerics("the branch ends before the setpoint");
    let model = case.with(key, near.gap).model()?;
    let mut map = ModelMap::new(&model);
    let options = ShootingOptions::default();
    let first = close_orbit(&mut map, &near.state, near.period, &options);
    let first = first.map_err(|error| Error::numerics(format!("no orbit is near: {error}")))?;
    if first.is_stable() != near.stable {
        return Err(Error::numerics("no orbit of this stability is near"));
    }
    let first = measured(&model, first, near.period).ok_or_else(ended)?;
    let mut last = Step::at(near.gap, first);
    let mut before: Option<(f64, Vec<f64>)> = None;
    let unit = free.amplitude;
    let mut step = FIRST_STEP * unit;
    for _ in 0..DISTANCE_STEPS {
        let value = held.of(&last.observables);
        if (value - held.target).abs() <= 1e-12 * held.target.abs() {
            let found = solution(case, last.gap, &last.orbit, &last.observables);
            return found.ok_or_else(ended);
        }
        let from = last.points();
        let (expected, most) = match &before {
            Some((gap, points)) => {
                let share = step / (last.gap - gap);
                let change: Vec<f64> = from
                    .iter()
                    .zip(points)
                    .map(|(x, y)| share * (x - y))
                    .collect();
                let size = change.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
                let least = LEAST_CHANGE * last.orbit.scale();
                let points = from.iter().zip(&change).map(|(x, dx)| x + dx).collect();
                (points, least.max(UNEXPECTED * size))
            }
            None => (from.clone(), FIRST_CHANGE * last.orbit.scale()),
        };
        let gap = last.gap + step;
        let next = model_at(gap).and_then(|model| closed(&model, &expected, near.period));
        let next = next.map(|found| Step::at(gap, found)).filter(|next| {
            let points = next.points();
            let off = points.iter().zip(&expected).map(|(x, y)| (x - y).abs());
            next.growing() == last.growing() && off.fold(0.0, f64::max) <= most
        });
        let Some(next) = next else {
            step *= 0.5;
            if step.abs() < SHORTEST_STEP * unit {
                break;
            }
            continue;
        };
        let reached = held.of(&next.observables);
        if (value > held.target) != (reached > held.target) {
            let [a, b] = [(&last, value), (&next, reached)].map(|(step, value)| Sample {
                gap: step.gap,
                orbit: &step.orbit,
                value,
            });
            return crossing(case, &held, &model_at, &a, &b).ok_or_else(ended);
        }
        let wanted = (held.target - reached) * step / (reached - value);
        let most = LONGEST_STEP * unit;
        before = Some((last.gap, from));
        // A little farther, so that the setpoint lies between two orbits.
        step = if wanted.is_finite() {
            (1.0 + 1e-3) * wanted
        } else {
            step
        };
        step = step.clamp(-most, most);
        last = next;
    }
    Err(ended())
}
