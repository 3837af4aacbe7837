//! The crate `ode_solvers`, which has no events: integrated a period at a time with a test
//! of the gap after each step; the crossing by the Illinois method on the end of a short
//! integration from the step before.

use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dopri5, System, Vector6};

use crate::cantilever::{Cantilever, State};
use crate::work::AtPeriodEnd;

type Vector = Vector6<f64>;

struct Problem<'a> {
    cantilever: &'a Cantilever,
    regime: usize,
    stops: bool,
}

impl System<f64, Vector> for Problem<'_> {
    fn system(&self, t: f64, y: &Vector, dy: &mut Vector) {
        self.cantilever
            .rates(self.regime, t, y.as_slice(), dy.as_mut_slice());
    }

    fn solout(&mut self, t: f64, y: &Vector, _: &Vector) -> bool {
        let gap = self.cantilever.gap(t, y.as_slice());
        self.stops
            && if self.regime == 0 {
                gap <= 0.0
            } else {
                gap > 0.0
            }
    }
}

/// Times and states of each step from `from` to `to`.
fn steps(
    problem: Problem<'_>,
    from: f64,
    to: f64,
    y: Vector,
    tolerance: f64,
) -> Vec<(f64, Vector)> {
    let mut solver = Dopri5::from_param(
        problem,
        from,
        to,
        to - from,
        y,
        tolerance,
        tolerance,
        0.9,
        0.04,
        0.2,
        10.0,
        to - from,
        0.0,
        1_000_000,
        1_000_000_000,
        OutputType::Sparse,
    );
    solver.integrate().expect("a solution");
    let states = solver.y_out().iter().copied();
    solver.x_out().iter().copied().zip(states).collect()
}

pub fn follow(
    tolerance: f64,
    cantilever: &Cantilever,
    start: State,
    periods: usize,
    at_end: AtPeriodEnd<'_>,
) {
    let (mut t, mut y) = (0.0, Vector::from(start));
    let mut regime = cantilever.regime_at(t, &start);
    for period in 1..=periods {
        let end = period as f64 * cantilever.period();
        while t < end {
            let sign = if regime == 0 { 1.0 } else { -1.0 };
            let problem = |stops| Problem {
                cantilever,
                regime,
                stops,
            };
            let path = steps(problem(true), t, end, y, tolerance);
            let (reached, state) = path[path.len() - 1];
            if sign * cantilever.gap(reached, state.as_slice()) > 0.0 {
                (t, y) = (end, state);
                break;
            }
            let (before, from) = path[path.len() - 2];
            let state_after = |s: f64| {
                let path = steps(problem(false), before, before + s, from, tolerance);
                let state = path[path.len() - 1].1;
                (state, sign * cantilever.gap(before + s, state.as_slice()))
            };
            let found = zero(state_after, reached - before);
            regime = 1 - regime;
            if let Some((s, state)) = found {
                (t, y) = (before + s, state);
            }
        }
        if !at_end(period, y.as_slice()) {
            return;
        }
    }
}

/// Where the gap, positive just after 0 and not at `length`, is zero, and the state there;
/// none where it never is positive.
fn zero(state_after: impl Fn(f64) -> (Vector, f64), length: f64) -> Option<(f64, Vector)> {
    let (mut high, mut low) = (length, 0.0);
    let (mut state, mut at_high) = state_after(high);
    // The start may lie on the surface: halve until a moment inside is found.
    let mut at_low = 0.0;
    for k in 1..=40 {
        low = length * 0.5_f64.powi(k);
        at_low = state_after(low).1;
        if at_low > 0.0 {
            break;
        }
    }
    if at_low <= 0.0 {
        return None;
    }
    let (mut s, mut side) = (high, 0);
    for _ in 0..60 {
        s = (low * at_high - high * at_low) / (at_high - at_low);
        if !(s > low && s < high) {
            s = 0.5 * (low + high);
        }
        let value;
        (state, value) = state_after(s);
        if value > 0.0 {
            (low, at_low) = (s, value);
            if side == 1 {
                at_high *= 0.5;
            }
            side = 1;
        } else {
            (high, at_high) = (s, value);
            if side == -1 {
                at_low *= 0.5;
            }
            side = -1;
        }
        if value.abs() < 1e-15 || high - low < 1e-14 {
            break;
        }
    }
    Some((s, state))
}
