//! Events that a user defines: where an observable of an orbit has a value, `F_max = 1 nN`.
//!
//! On a branch an event lies between two points at which the observable is on either side of the
//! value; it is located by regula falsi, with an orbit closed at every trial. In two parameters the
//! curve is followed in the plane of the parameters: a step along the tangent, then along the gradient
//! of the observable, by differences, until the value is met.
//!
//! Fails: two crossings between neighbouring points are missed. A curve ends where the orbit folds,
//! although the event may go on along the other side of the fold.

use std::fmt;

use nanotap_dynamics::{PeriodicOrbit, ShootingOptions, close_orbit};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::branch::{CurveReport, PointReport};
use nanotap_case::{Case, Key};
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_model::model_map::ModelMap;
use nanotap_observe::table::shown_phase;
use nanotap_observe::{Observable, ObservableSet, Observables, measure};
use nanotap_study::target::{limit, unknown};

/// An observable and its value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Event {
    text: String,
    observable: &'static Observable,
    value: f64,
}

/// An orbit of a branch at which an event happens.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct EventReport {
    /// The event, as it was given.
    pub event: String,
    /// Orbit of the branch at which the event happens.
    #[serde(flatten)]
    pub point: PointReport,
}

/// Width of the bracket at which a crossing counts as located, as a fraction of the first bracket.
const BRACKET: f64 = 1e-12;
/// Largest number of trials of the regula falsi.
const TRIALS: usize = 60;
/// Longest and shortest step along a curve, in units of the window.
const STEPS: [f64; 2] = [0.02, 1e-4];
/// Difference of the parameters for a gradient, in units of the window.
const DIFFERENCE: f64 = 1e-5;
/// Accuracy of a point of a curve, in units of the window.
const ACCURACY: f64 = 1e-9;
/// Points of each half of a curve.
const POINTS: usize = 1000;

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Event {
    /// Reads an event such as `F_max = 1 nN`; values in SI for a physical case.
    pub(super) fn parse(text: &str, case: &Case) -> Result<Self, Error> {
        let wrong = |what: String| {
            Error::option(
                "event",
                format!("`{text}`: {what}"),
                "write an observable, = and a value, as in \"F_max = 1 nN\"",
            )
        };
        let (name, value) = text
            .split_once('=')
            .ok_or_else(|| wrong("expected =, got none".to_owned()))?;
        let named = |o: &&Observable| o.name == name.trim() || o.si_name == name.trim();
        let observable = ObservableSet::COMMON.iter().find(named);
        let observable = observable.ok_or_else(|| wrong(unknown(name.trim(), &[])))?;
        let value = limit(observable, value.trim(), case.is_physical()).map_err(wrong)?;
        Ok(Self {
            text: text.trim().to_owned(),
            observable,
            value,
        })
    }

    /// How far the observable is above the value; `None` if it is not a number.
    fn excess(&self, case: &Case, observables: &Observables) -> Option<f64> {
        let in_si = |view: &nanotap_case::physical::Physical| observables.in_si(&view.scales);
        let seen = case.physical().map_or_else(|| *observables, in_si);
        let value = (self.observable.of)(&seen).number()?;
        let value = if self.observable.name == "phase" {
            shown_phase(value)
        } else {
            value
        };
        let excess = value - self.value;
        excess.is_finite().then_some(excess)
    }
}

/// An orbit, and how far its observable is above the value of the event.
struct MeasuredOrbit {
    orbit: PeriodicOrbit,
    excess: f64,
}

impl MeasuredOrbit {
    fn state(&self) -> &[f64] {
        &self.orbit.states[0]
    }
}

/// Closes the orbit near `state` and measures its excess; `None` where either fails.
fn measured_orbit(
    case: &Case,
    state: &[f64],
    period: usize,
    event: &Event,
) -> Option<MeasuredOrbit> {
    let model = case.model().ok()?;
    let mut map = ModelMap::new(&model);
    let orbit = close_orbit(&mut map, state, period, &ShootingOptions::default()).ok()?;
    let start = orbit.states.first()?;
    let observables = measure(&model, start, period, ObservableSet::COMMON).ok()?;
    let excess = event.excess(case, &observables)?;
    Some(MeasuredOrbit { orbit, excess })
}

/// The values of the parameter and the orbits at which an event happens, between neighbouring points
/// of branches, each with the number of its branch. A crossing near which an orbit cannot be closed
/// is left out.
pub(super) fn along(
    case: &Case,
    key: Key,
    points: &[PointReport],
    event: &Event,
    control: &Control<'_>,
) -> Vec<(usize, f64, PeriodicOrbit)> {
    let excess = |p: &PointReport| event.excess(&case.with(key, p.parameter), &p.observables);
    let excesses: Vec<Option<f64>> = points.par_iter().map(excess).collect();
    (1..points.len())
        .into_par_iter()
        .with_max_len(1)
        .filter(|_| !control.is_cancelled())
        .filter_map(|k| {
            let [a, b] = [&points[k - 1], &points[k]];
            let values = [excesses[k - 1]?, excesses[k]?];
            let (parameter, orbit) = (a.branch == b.branch)
                .then(|| between(case, key, [a, b], values, event))
                .flatten()?;
            Some((a.branch, parameter, orbit))
        })
        .collect()
}

/// Where an event happens between two points with these excesses; `None` if it does not, or an orbit
/// cannot be closed.
fn between(
    case: &Case,
    key: Key,
    [a, b]: [&PointReport; 2],
    [mut below, mut above]: [f64; 2],
    event: &Event,
) -> Option<(f64, PeriodicOrbit)> {
    let (mut low, mut high) = (0.0, 1.0);
    if below * above > 0.0 || below == above {
        return None;
    }
    let size = below.abs().max(above.abs());
    let mut best: Option<(f64, MeasuredOrbit)> = None;
    for trial in 0..TRIALS {
        let part = if trial % 3 == 2 {
            0.5 * (low + high)
        } else {
            low + (high - low) * below / (below - above)
        };
        let parameter = a.parameter + part * (b.parameter - a.parameter);
        let guess: Vec<f64> = (a.state.iter().zip(&b.state))
            .map(|(x, y)| x + part * (y - x))
            .collect();
        let at = measured_orbit(&case.with(key, parameter), &guess, a.period, event)?;
        let (found, closer) = (at.excess, best.as_ref());
        if closer.is_none_or(|(_, known)| found.abs() < known.excess.abs()) {
            best = Some((parameter, at));
        }
        if found == 0.0 || high - low <= BRACKET {
            break;
        }
        if (found > 0.0) == (below > 0.0) {
            (low, below) = (part, found);
        } else {
            (high, above) = (part, found);
        }
    }
    // Where the value leaps there is no event.
    best.filter(|(_, seen)| seen.excess.abs() <= 1e-6 * size)
        .map(|(parameter, seen)| (parameter, seen.orbit))
}

/// A window of two parameters, in which points are parts from 0 to 1.
pub(super) struct Window<'a> {
    pub(super) case: &'a Case,
    pub(super) keys: [Key; 2],
    /// Lower and upper end of each.
    pub(super) ranges: [[f64; 2]; 2],
}

impl Window<'_> {
    fn values(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| {
            let [low, high] = self.ranges[k];
            low + at[k] * (high - low)
        })
    }

    fn place(&self, values: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| {
            let [low, high] = self.ranges[k];
            (values[k] - low) / (high - low)
        })
    }

    fn orbit_at(
        &self,
        at: [f64; 2],
        state: &[f64],
        period: usize,
        event: &Event,
    ) -> Option<MeasuredOrbit> {
        let [first, second] = self.values(at);
        let case = self.case.with(self.keys[0], first);
        measured_orbit(&case.with(self.keys[1], second), state, period, event)
    }

    /// The gradient of the excess.
    fn gradient(
        &self,
        at: [f64; 2],
        here: &MeasuredOrbit,
        period: usize,
        event: &Event,
    ) -> Option<[f64; 2]> {
        let mut slope = [0.0; 2];
        for k in 0..2 {
            let mut there = at;
            // Towards the middle of the window.
            there[k] += if at[k] < 0.5 { DIFFERENCE } else { -DIFFERENCE };
            let seen = self.orbit_at(there, here.state(), period, event)?;
            slope[k] = (seen.excess - here.excess) / (there[k] - at[k]);
        }
        let norm = nanotap_arithmetic::hypot(slope[0], slope[1]);
        (norm > 0.0 && norm.is_finite()).then_some(slope)
    }

    /// The curve of an event through an orbit at these values.
    pub(super) fn curve(
        &self,
        values: [f64; 2],
        (state, period): (&[f64], usize),
        event: &Event,
        control: &Control<'_>,
    ) -> Option<CurveReport> {
        let start = self.place(values);
        let here = self.orbit_at(start, state, period, event)?;
        let gradient = self.gradient(start, &here, period, event)?;
        let mut halves: Vec<(Vec<[f64; 2]>, &'static str)> = Vec::new();
        for sign in [-1.0, 1.0] {
            let first = MeasuredOrbit {
                orbit: here.orbit.clone(),
                excess: here.excess,
            };
            let half = self.half(start, first, gradient, sign, (period, event), control);
            let closed = half.1 == CLOSED;
            halves.push(half);
            if closed {
                halves.push((Vec::new(), CLOSED));
                break;
            }
        }
        let (ahead, end) = halves.pop()?;
        let (mut points, begin) = halves.pop()?;
        points.reverse();
        points.push(start);
        points.extend(ahead);
        let values: Vec<[f64; 2]> = points.into_iter().map(|at| self.values(at)).collect();
        let meets = |end: &'static str| (end == LOST).then_some("cut");
        Some(CurveReport {
            kind: "event",
            event: Some(event.text.clone()),
            period,
            first: values.iter().map(|v| v[0]).collect(),
            second: values.iter().map(|v| v[1]).collect(),
            ends: [begin, end].map(str::to_owned),
            meets: [begin, end].map(meets),
        })
    }

    /// One half of a curve, from its start on.
    fn half(
        &self,
        start: [f64; 2],
        mut here: MeasuredOrbit,
        mut gradient: [f64; 2],
        sign: f64,
        (period, event): (usize, &Event),
        control: &Control<'_>,
    ) -> (Vec<[f64; 2]>, &'static str) {
        let mut points: Vec<[f64; 2]> = Vec::new();
        let mut at = start;
        let mut step = STEPS[0];
        let mut tangent: Option<[f64; 2]> = None;
        while points.len() < POINTS {
            if control.is_cancelled() {
                return (points, "stopped");
            }
            let norm = nanotap_arithmetic::hypot(gradient[0], gradient[1]);
            let along = [-sign * gradient[1] / norm, sign * gradient[0] / norm];
            // The gradient may turn round, the way along the curve does not.
            let along = match tangent {
                Some(t) if t[0] * along[0] + t[1] * along[1] < 0.0 => along.map(|v| -v),
                _ => along,
            };
            let ahead = [0, 1].map(|k| at[k] + step * along[k]);
            // Onto the edge of the window in a last step.
            let inside = |at: [f64; 2]| at.iter().all(|v| (0.0..=1.0).contains(v));
            let leaves = !inside(ahead);
            let found = (!leaves)
                .then(|| self.corrected(ahead, &here, gradient, (period, event)))
                .flatten();
            let next = found.and_then(|(there, seen)| {
                let slope = self.gradient(there, &seen, period, event)?;
                let turn = (gradient[0] * slope[0] + gradient[1] * slope[1])
                    / (norm * nanotap_arithmetic::hypot(slope[0], slope[1]));
                (turn.abs() > 0.9 && inside(there)).then_some((there, seen, slope))
            });
            let Some((there, seen, slope)) = next else {
                step *= 0.5;
                if step < STEPS[1] {
                    return (points, if leaves { EDGE } else { LOST });
                }
                continue;
            };
            (at, here, gradient, tangent) = (there, seen, slope, Some(along));
            points.push(at);
            let back = nanotap_arithmetic::hypot(at[0] - start[0], at[1] - start[1]);
            if points.len() > 8 && back < step {
                points.push(start);
                return (points, CLOSED);
            }
            step = (1.5 * step).min(STEPS[0]);
        }
        (points, "it is longer than the points allowed")
    }

    /// The point of the curve in the direction of the gradient.
    fn corrected(
        &self,
        from: [f64; 2],
        near: &MeasuredOrbit,
        gradient: [f64; 2],
        (period, event): (usize, &Event),
    ) -> Option<([f64; 2], MeasuredOrbit)> {
        let norm = nanotap_arithmetic::hypot(gradient[0], gradient[1]);
        let normal = gradient.map(|v| v / norm);
        let (mut at, mut slope) = (from, norm);
        let mut seen = self.orbit_at(at, near.state(), period, event)?;
        for _ in 0..8 {
            let move_by = -seen.excess / slope;
            if move_by.abs() > STEPS[0] {
                return None;
            }
            if move_by.abs() <= ACCURACY {
                return Some((at, seen));
            }
            let there = [0, 1].map(|k| at[k] + move_by * normal[k]);
            let next = self.orbit_at(there, seen.state(), period, event)?;
            let secant = (next.excess - seen.excess) / move_by;
            if secant != 0.0 && secant.is_finite() {
                slope = secant;
            }
            (at, seen) = (there, next);
        }
        None
    }
}

/// Reasons of the end of a curve.
const EDGE: &str = "the edge of the window";
const CLOSED: &str = "it is closed";
const LOST: &str = "the orbit cannot be closed, or the observable leaps";
