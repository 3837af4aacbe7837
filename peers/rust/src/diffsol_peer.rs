//! The crate `diffsol` with its root finding. Methods: `tsit45` and `bdf`.

use std::cell::Cell;
use std::rc::Rc;

use diffsol::{NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason};

use crate::cantilever::{Cantilever, State};
use crate::work::AtPeriodEnd;

type Matrix = NalgebraMat<f64>;

fn state_of(y: &<Matrix as diffsol::MatrixCommon>::V) -> State {
    std::array::from_fn(|i| y[i])
}

pub fn follow(
    implicit: bool,
    tolerance: f64,
    cantilever: &Cantilever,
    start: State,
    periods: usize,
    at_end: AtPeriodEnd<'_>,
) {
    let regime = Rc::new(Cell::new(cantilever.regime_at(0.0, &start)));
    let (rates, product, gap) = (cantilever.clone(), cantilever.clone(), cantilever.clone());
    let (in_rates, in_product) = (Rc::clone(&regime), Rc::clone(&regime));
    let problem = OdeBuilder::<Matrix>::new()
        .rtol(tolerance)
        .atol([tolerance])
        .rhs_implicit(
            move |y: &[f64], _: &[f64], t: f64, dy: &mut [f64]| {
                rates.rates(in_rates.get(), t, y, dy);
            },
            move |_: &[f64], _: &[f64], _: f64, v: &[f64], out: &mut [f64]| {
                product.jacobian_product(in_product.get(), v, out);
            },
        )
        .init(
            move |_: &[f64], _: f64, y: &mut [f64]| y.copy_from_slice(&start),
            start.len(),
        )
        .root(
            move |y: &[f64], _: &[f64], t: f64, g: &mut [f64]| g[0] = gap.gap(t, y),
            1,
        )
        .build()
        .expect("a problem");
    let mut done = 0;
    macro_rules! run {
        ($solver:expr) => {{
            let mut solver = $solver.expect("a solver");
            while done < periods {
                let stop = solver.step().expect("a step");
                let root = match stop {
                    OdeSolverStopReason::RootFound(t, _) => Some(t),
                    _ => None,
                };
                let reached = root.unwrap_or_else(|| solver.state().t);
                while done < periods && (done + 1) as f64 * cantilever.period() <= reached {
                    done += 1;
                    let time = done as f64 * cantilever.period();
                    let y = solver.interpolate(time).expect("a time within the step");
                    if !at_end(done, &state_of(&y)) {
                        return;
                    }
                }
                let Some(t) = root else { continue };
                solver.state_mut_back(t).expect("a time within the step");
                let y = state_of(solver.state().y);
                // A root that was just left shows again; its rate tells where it leads.
                regime.set(usize::from(cantilever.gap_rate(t, &y) < 0.0));
                let mut dy = [0.0; 6];
                cantilever.rates(regime.get(), t, &y, &mut dy);
                let state = solver.state_mut();
                for (i, value) in dy.into_iter().enumerate() {
                    state.dy[i] = value;
                }
            }
        }};
    }
    if implicit {
        run!(problem.bdf::<NalgebraLU<f64>>());
    } else {
        run!(problem.tsit45());
    }
}
