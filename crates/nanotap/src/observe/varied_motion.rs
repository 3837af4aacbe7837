//! How what is read off a motion under a nonlinear force changes.
//!
//! The engine gives the change of the motion along the whole run ([`nanotap_volterra::variation`]);
//! here integrals, Fourier coefficients and extrema are taken of it, by the quadrature that their
//! values come from, period by period.

use std::sync::Arc;

use nalgebra::DMatrix;
use nanotap_flow::Complex;
use nanotap_flow::variation::{Varied, Wanted};
use nanotap_volterra::{Flow, Parameter, Reading, VariedOutput};

use crate::model::MotionError;
use crate::model::nonlinear::Nonlinear;

/// One way in which a motion changes.
#[derive(Clone, Debug)]
pub(super) struct Change {
    /// Of the state at its beginning.
    pub(super) start: Vec<f64>,
    /// Of drive, distance and law; none where they stay.
    pub(super) parameter: Option<Parameter>,
    /// Of ln T.
    pub(super) log_period: f64,
}

/// What was gathered, as [`Wanted`] lists it.
#[derive(Clone, Debug, Default)]
pub(super) struct Gathered {
    pub(super) integrals: Vec<Varied<f64>>,
    pub(super) products: Vec<Varied<f64>>,
    pub(super) fouriers: Vec<Varied<Complex>>,
    pub(super) extrema: Vec<Varied<f64>>,
    /// Of the greatest speed at which a contact began.
    pub(super) greatest_speed: Varied<f64>,
    pub(super) contact_time: Varied<f64>,
    pub(super) duration: Varied<f64>,
}

impl Gathered {
    fn nothing(wanted: &Wanted) -> Self {
        Self {
            integrals: vec![Varied::default(); wanted.integrals.len()],
            products: vec![Varied::default(); wanted.products.len()],
            fouriers: vec![Varied::default(); wanted.fouriers.len()],
            extrema: wanted
                .extrema
                .iter()
                .map(|(_, sign)| Varied {
                    value: -sign * f64::INFINITY,
                    change: 0.0,
                })
                .collect(),
            ..Self::default()
        }
    }

    /// Adds what a place of the quadrature gives, of the change number `column`.
    fn add(
        &mut self,
        at: &Reading<'_>,
        wanted: &Wanted,
        column: usize,
        (before, log_period): (f64, f64),
    ) {
        let wider = at.widening[column];
        for (sum, &g) in self.integrals.iter_mut().zip(&wanted.integrals) {
            sum.value += at.weight * at.values[g];
            sum.change += at.weight * at.change(g, column) + at.values[g] * wider;
        }
        for (sum, &(a, b)) in self.products.iter_mut().zip(&wanted.products) {
            let (x, y) = (at.values[a], at.values[b]);
            sum.value += at.weight * x * y;
            sum.change += at.weight * (at.change(a, column) * y + x * at.change(b, column));
            sum.change += x * y * wider;
        }
        for (sum, &(g, omega)) in self.fouriers.iter_mut().zip(&wanted.fouriers) {
            let (sin, cos) = nanotap_arithmetic::sin_cos(omega * (before + at.time));
            let factor = Complex::new(cos, -sin);
            // The frequency falls as the period grows; what ran before ends at the same phase.
            let turn = omega * (log_period * at.time - at.shifts[column]);
            let value = factor * at.values[g];
            let change = factor * at.change(g, column) + value * Complex::new(0.0, turn);
            sum.value += value * at.weight;
            sum.change += change * at.weight + value * wider;
        }
    }
}

/// Follows `periods` drive periods from `state` and gathers, for each of the changes, what is
/// `wanted` of the outputs; `rate` is that of the tip's height. Changes that come with a parameter
/// stand last.
///
/// # Errors
/// When the flow fails.
pub(super) fn gather(
    nonlinear: &Arc<Nonlinear>,
    state: &[f64],
    periods: usize,
    changes: &[Change],
    (outputs, wanted): (&[VariedOutput], &Wanted),
    rate: Option<&VariedOutput>,
) -> Result<Vec<Gathered>, MotionError> {
    let n = nonlinear.system.dimension();
    let period = nonlinear.period;
    let touches = &nonlinear.contact;
    let parameters: Vec<Parameter> = changes.iter().filter_map(|c| c.parameter.clone()).collect();
    let moves: Vec<f64> = changes.iter().map(|c| period * c.log_period).collect();
    let mut starts = DMatrix::from_fn(n, changes.len(), |i, k| changes[k].start[i]);
    let mut all = vec![Gathered::nothing(wanted); changes.len()];
    let fastest = wanted.fouriers.iter().fold(0.0, |m: f64, (_, w)| m.max(*w));
    let mut flow = Flow::new(Arc::clone(&nonlinear.system));
    let mut state = state.to_vec();
    for count in 0..periods {
        nonlinear.start(&mut flow, &state)?;
        let run = flow.record_with_changes(period, &moves, &starts, &parameters)?;
        nonlinear.end(&flow, &mut state);
        let before = count as f64 * period;
        run.visit(outputs, fastest, |at| {
            for (column, gathered) in all.iter_mut().enumerate() {
                let log_period = changes[column].log_period;
                gathered.add(at, wanted, column, (before, log_period));
            }
        });
        if !wanted.extrema.is_empty() {
            let nodes = run.motion().nodes();
            for (k, &(output, sign)) in wanted.extrema.iter().enumerate() {
                let [least, largest] = run.range(&nodes, &outputs[output]);
                let found = if sign < 0.0 { least } else { largest };
                for (gathered, change) in all.iter_mut().zip(found.changes) {
                    let known = &mut gathered.extrema[k];
                    if sign * found.value > sign * known.value {
                        *known = Varied {
                            value: found.value,
                            change,
                        };
                    }
                }
            }
        }
        if let Some(rate) = rate {
            let begins = |from: usize, to: usize| !touches[from] && touches[to];
            for speed in run.before_switches(rate, begins) {
                for (gathered, change) in all.iter_mut().zip(speed.changes) {
                    if -speed.value > gathered.greatest_speed.value {
                        gathered.greatest_speed = Varied {
                            value: -speed.value,
                            change: -change,
                        };
                    }
                }
            }
        }
        let contact = run.motion().fraction(|branch| touches[branch]) * period;
        for (column, gathered) in all.iter_mut().enumerate() {
            let time = &mut gathered.contact_time;
            time.value += contact;
            time.change += run.time_on(column, |branch| touches[branch]);
            gathered.duration.value += period;
            gathered.duration.change += moves[column];
        }
        starts.copy_from(run.at_end());
        if count + 1 < periods && moves.iter().any(|by| *by != 0.0) {
            // The next period begins at the same phase, later.
            let mut field = vec![0.0; n];
            nonlinear
                .system
                .field(period, &state[..n], flow.branch(), &mut field);
            for (column, by) in moves.iter().enumerate() {
                for (i, field) in field.iter().enumerate() {
                    starts[(i, column)] += field * by;
                }
            }
        }
    }
    Ok(all)
}
