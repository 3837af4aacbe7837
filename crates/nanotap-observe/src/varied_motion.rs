//! Derivatives of functionals of a motion under a nonlinear force.
//!
//! The engine computes the derivative of the motion along the whole run
//! ([`nanotap_volterra::variation`]). Integrals, Fourier coefficients and extrema are taken of it,
//! with the quadrature of their values, period by period.

use std::sync::Arc;

use nalgebra::{Complex, DMatrix};
use nanotap_arithmetic::Dual;
use nanotap_flow::accumulate::Functional;
use nanotap_volterra::{Flow, Parameter, VariedOutput};

use nanotap_model::MotionError;
use nanotap_model::nonlinear::Nonlinear;

/// A direction in which a motion varies.
#[derive(Clone, Debug)]
pub(super) struct Change {
    /// Change of the initial state.
    pub(super) start: Vec<f64>,
    /// Change of drive, distance and law; `None` if they are constant.
    pub(super) parameter: Option<Parameter>,
    /// Change of ln T, where T is the drive period.
    pub(super) log_period: f64,
}

/// Measurements of a motion with their derivatives in one direction.
#[derive(Clone, Debug, Default)]
pub(super) struct Varied {
    /// Values of the functionals, with their derivatives.
    pub(super) values: Vec<Complex<Dual>>,
    /// Largest speed at which a contact began.
    pub(super) greatest_speed: Dual,
    /// Total time in contact, in model units.
    pub(super) contact_time: Dual,
    /// Duration of the motion, in model units.
    pub(super) duration: Dual,
}

/// What is measured of a motion.
pub(super) struct Wanted<'a> {
    pub(super) outputs: &'a [VariedOutput],
    /// Whether each output is 0 unless tip and sample touch.
    pub(super) of_contact: &'a [bool],
    /// Functionals of the outputs.
    pub(super) functionals: &'a [Functional],
}

/// Follows `periods` drive periods from `state` and computes, for each of the changes, the
/// functionals of the outputs. `rate` is the rate of the tip's height. Changes with a parameter
/// come last.
///
/// # Errors
/// If the flow fails.
pub(super) fn gather(
    nonlinear: &Arc<Nonlinear>,
    state: &[f64],
    periods: usize,
    changes: &[Change],
    Wanted {
        outputs,
        of_contact,
        functionals,
    }: Wanted<'_>,
    rate: Option<&VariedOutput>,
) -> Result<Vec<Varied>, MotionError> {
    let n = nonlinear.system.dimension();
    let period = nonlinear.period;
    let touches = &nonlinear.contact;
    let parameters: Vec<Parameter> = changes.iter().filter_map(|c| c.parameter.clone()).collect();
    let moves: Vec<f64> = changes.iter().map(|c| period * c.log_period).collect();
    let mut starts = DMatrix::from_fn(n, changes.len(), |i, k| changes[k].start[i]);
    let initial = Varied {
        values: functionals.iter().map(|f| f.initial()).collect(),
        ..Varied::default()
    };
    let mut all = vec![initial; changes.len()];
    let frequencies = functionals.iter().filter_map(|f| f.frequency());
    let fastest = frequencies.fold(0.0, f64::max);
    let mut flow = Flow::new(Arc::clone(&nonlinear.system));
    let mut state = state.to_vec();
    for count in 0..periods {
        nonlinear.start(&mut flow, &state)?;
        let run = flow.record_with_changes(period, &moves, &starts, &parameters)?;
        nonlinear.end(&flow, &mut state);
        let before = count as f64 * period;
        run.visit(outputs, fastest, |at| {
            let is_zero = |output: usize| of_contact[output] && !touches[at.branch];
            for (column, varied) in all.iter_mut().enumerate() {
                let numbers = 0..outputs.len();
                let value = |output| {
                    if is_zero(output) {
                        Dual::default()
                    } else {
                        Dual::new(at.values[output], at.change(output, column))
                    }
                };
                let values: Vec<Dual> = numbers.map(value).collect();
                let weight = Dual::new(at.weight, at.widening[column]);
                // The frequency falls as the period grows; the previous periods end at the same
                // phase.
                let turn = at.shifts[column] - changes[column].log_period * at.time;
                let time = Dual::new(before + at.time, turn);
                for (sum, functional) in varied.values.iter_mut().zip(functionals) {
                    functional.add_node(sum, weight, &values, |omega| omega * time);
                }
            }
        });
        let nodes = run.motion().nodes();
        for (k, functional) in functionals.iter().enumerate() {
            let Some((output, sign)) = functional.extremum() else {
                continue;
            };
            let [least, greatest] = run.range(&nodes, &outputs[output]);
            let found = if sign < 0.0 { least } else { greatest };
            for (varied, change) in all.iter_mut().zip(found.changes) {
                let known = &mut varied.values[k].re;
                if sign * found.value > sign * known.value {
                    *known = Dual::new(found.value, change);
                }
            }
        }
        if let Some(rate) = rate {
            let begins = |from: usize, to: usize| !touches[from] && touches[to];
            for speed in run.before_switches(rate, begins) {
                for (varied, change) in all.iter_mut().zip(speed.changes) {
                    if -speed.value > varied.greatest_speed.value {
                        varied.greatest_speed = -Dual::new(speed.value, change);
                    }
                }
            }
        }
        let touching = |branch: usize| touches[branch];
        let contact = run.motion().time_on(touching);
        for (column, varied) in all.iter_mut().enumerate() {
            let time = Dual::new(contact, run.time_on(column, touching));
            varied.contact_time = varied.contact_time + time;
            varied.duration = varied.duration + Dual::new(period, moves[column]);
        }
        starts.copy_from(run.at_end());
        if count + 1 < periods && moves.iter().any(|by| *by != 0.0) {
            // The next period begins at the same phase, later.
            let mut field = vec![0.0; n];
            let branch = flow.branch();
            nonlinear
                .system
                .field(period, &state[..n], branch, &mut field);
            for (column, by) in moves.iter().enumerate() {
                for (i, field) in field.iter().enumerate() {
                    starts[(i, column)] += field * by;
                }
            }
        }
    }
    Ok(all)
}
