//! The crate `differential-equations` with its terminal events.

use differential_equations::prelude::*;

use crate::cantilever::{Cantilever, State};
use crate::work::AtPeriodEnd;

/// Periods asked for in one call.
const PERIODS_A_CALL: usize = 20;

struct Problem<'a> {
    cantilever: &'a Cantilever,
    regime: usize,
}

impl ODE<f64, State> for Problem<'_> {
    fn diff(&self, t: f64, y: &State, dy: &mut State) {
        self.cantilever.rates(self.regime, t, y, dy);
    }
}

impl Event<f64, State> for Problem<'_> {
    fn config(&self) -> EventConfig {
        let direction = if self.regime == 0 {
            CrossingDirection::Negative
        } else {
            CrossingDirection::Positive
        };
        EventConfig::default().direction(direction).terminal()
    }

    fn event(&self, t: f64, y: &State) -> f64 {
        self.cantilever.gap(t, y)
    }
}

pub fn follow(
    tolerance: f64,
    cantilever: &Cantilever,
    start: State,
    periods: usize,
    at_end: AtPeriodEnd<'_>,
) {
    let (mut t, mut y, mut done) = (0.0, start, 0);
    let mut regime = cantilever.regime_at(t, &start);
    while done < periods {
        let last = periods.min(done + PERIODS_A_CALL);
        let ends: Vec<f64> = (done + 1..=last)
            .map(|k| k as f64 * cantilever.period())
            .collect();
        let end = ends[ends.len() - 1];
        let problem = Problem { cantilever, regime };
        let method = ExplicitRungeKutta::dop853()
            .rtol(tolerance)
            .atol(tolerance)
            .max_steps(10_000_000);
        let solution = IVP::ode(&problem, t, end, y)
            .method(method)
            .t_eval(ends)
            .event(&problem)
            .solve()
            .expect("a solution");
        let stopped = matches!(solution.status, Status::Interrupted);
        for (time, state) in solution.t.iter().zip(&solution.y) {
            // The event stands in the list too.
            let expected = (done + 1) as f64 * cantilever.period();
            if done < last && (time - expected).abs() < 1e-9 {
                done += 1;
                if !at_end(done, state) {
                    return;
                }
            }
        }
        let reached = solution.t.len() - 1;
        (t, y) = (solution.t[reached], solution.y[reached]);
        if stopped {
            regime = 1 - regime;
        }
    }
}
