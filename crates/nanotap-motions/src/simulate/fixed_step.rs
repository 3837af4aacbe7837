//! The paper's method, to compare with the exact flow: fourth-order Runge–Kutta with a fixed
//! step in each regime, switching on the grid.
//!
//! Its contacts begin and end up to a step late,
//! which acts like a small force that differs from period to period: what looks like a
//! subharmonic of a high period can be a product of the step. Therefore the period read off its
//! strobe points is called apparent, and is reported
//! with the verdict of the exact flow on the same motion.

use std::collections::VecDeque;

use nanotap_dynamics::classify;
use nanotap_flow::fixed_step::FixedStep;
use nanotap_flow::fixed_step::Switching;
use schemars::JsonSchema;
use serde::Serialize;

use crate::simulate::{
    Classification, Grid, NamedMotion, SimulateOptions, check_periods, check_states, is_none,
    starting_state,
};
use nanotap_arithmetic::clock::Instant;
use nanotap_case::units::Units;
use nanotap_error::Error;
use nanotap_model::model_map::ModelMap;
use nanotap_model::{FlowError, Model};
use nanotap_observe::ContactEventKind;
use nanotap_observe::frame::Frame;
use nanotap_observe::time_series;

/// Drive periods discarded first, unless the options say otherwise.
const TRANSIENT: usize = 500;

/// A switch, where the grid noticed it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct GridEvent {
    /// Time of the grid point from the end of the transient, in the model's unit of time.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Time.model_unit()))]
    pub tau: f64,
    /// Kind of the switch: `contact_start` or `contact_end`.
    pub kind: &'static str,
}

/// Result of a finished run with fixed time steps.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FixedStepRun {
    /// Method of integration, always `rk4`.
    pub method: &'static str,
    /// Steps a drive period in free flight and in contact.
    pub steps: [u32; 2],
    /// Where within a step the regime is checked: `every_step` or `every_stage`.
    pub switching: &'static str,
    /// Number of drive periods recorded.
    pub periods: usize,
    /// Drive periods of the discarded transient.
    pub transient: usize,
    /// State at the end of the transient, in the model's units. Its entries are a_1 … a_N (or x),
    /// their rates, then any memory of the sample.
    pub start: Vec<f64>,
    /// Smallest n for which the strobe points repeat after n periods to
    /// [`APPARENT_CLOSURE`] of their size; proves nothing.
    pub apparent_period: Option<usize>,
    /// Largest difference of strobe points one apparent period apart, as a fraction of their size.
    /// Without an apparent period it is the smallest for any period that was tried.
    pub closure: f64,
    /// Longest apparent period looked for: half of the recording, 64 at most.
    pub longest_apparent: usize,
    /// Largest tip displacement on the grid, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub tip_max: f64,
    /// Least tip displacement on the grid, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub tip_min: f64,
    /// Half of the peak-to-peak tip displacement, in the model's unit of length.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub amplitude: f64,
    /// Contact time / period, from the lengths of the steps.
    pub contact_fraction: f64,
    /// States at the end of each of the last requested periods.
    pub strobe: Vec<Vec<f64>>,
    /// Switches noticed, the first of them.
    pub events: Vec<GridEvent>,
    /// Number of events that are not listed.
    #[serde(skip_serializing_if = "is_none")]
    pub events_left_out: usize,
    /// Speed, drive periods per second.
    pub periods_per_second: f64,
    /// The exact flow from the last state.
    pub exact: ExactVerdict,
    /// Which initial state was followed, and how to list the motions that others lead to.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Time, tip displacement and its rate, for figures: the first recorded periods.
    #[serde(skip)]
    pub curve: Vec<[f64; 3]>,
    /// All strobe points of the recording, tip displacement and its rate, for figures.
    #[serde(skip)]
    pub strobe_curve: Vec<[f64; 2]>,
}

impl FixedStepRun {
    /// Time, tip displacement and its rate at every step of the first recorded periods.
    pub fn curve_table(&self, units: Units) -> Frame<'static> {
        let rows = self.curve.iter().map(|point| point.to_vec());
        time_series::table(Vec::new(), rows.collect(), units)
    }
}

impl FixedStepRun {}

/// Classification by the exact flow.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ExactVerdict {
    /// Class of the motion according to the exact flow.
    pub classification: Classification,
    /// Period in drive periods; `None` unless the motion is periodic.
    pub period: Option<usize>,
    /// Evidence for the class, in words.
    pub evidence: String,
}

/// Return distance, relative to the motion's size, below which a run looks periodic.
pub const APPARENT_CLOSURE: f64 = 1e-6;
/// Longest apparent period looked for.
const LONGEST_APPARENT: usize = 64;
/// Largest number of drive periods kept for figures.
const CURVE_PERIODS: usize = 64;
/// Largest number of steps kept for figures.
const CURVE_POINTS: usize = 2_000_000;

/// Runs `model` with fixed steps.
///
/// # Errors
/// When the start does not fit, the stop is rigid, or the run overflows.
pub fn fixed_step_run(model: &Model, options: &SimulateOptions) -> Result<FixedStepRun, Error> {
    let state = starting_state(model, options.state.as_ref())?;
    let transient = options.transient.unwrap_or(TRANSIENT);
    let refused = |message| {
        Err(Error::input(
            message,
            "leave {method} out: the exact flow runs it",
        ))
    };
    check_periods(options.periods)?;
    check_states(model, options.strobe.min(options.periods), "strobe")?;
    if model.nonlinear.is_some() {
        return refused(
            "under a nonlinear force law there are no linear regimes for the fixed-step method to run",
        );
    }
    if model
        .system
        .transitions()
        .iter()
        .flatten()
        .any(|e| e.reset.is_some())
    {
        return refused(
            "fixed steps know no jumps of the state: neither rigid impacts nor a Kelvin–Voigt \
             surface, which is left without force, can be run this way",
        );
    }
    let steps = options.steps.0;
    let (switching, switching_name) = match options.switching {
        Grid::Step => (Switching::EveryStep, "every_step"),
        Grid::Stage => (Switching::EveryStage, "every_stage"),
    };
    let run = FixedStep::new(&model.system, &state, &steps, switching);
    let mut run = run.map_err(|error| match error {
        FlowError::Shape { .. } => Error::input(error.to_string(), "give 1 or more {steps}"),
        error => error.into(),
    })?;
    let clock = Instant::now();
    for period in 0..transient {
        run.run_period(|_, _| {});
        check(model, run.state(), period)?;
    }
    let start = run.state().to_vec();
    let mut grid = Observed::new(model, &start, options.events);
    // As many of the last states as are listed or compared.
    let kept = options.strobe.max(2 * LONGEST_APPARENT);
    let mut strobes: VecDeque<Vec<f64>> = VecDeque::new();
    let mut strobe_curve = Vec::with_capacity(options.periods);
    let rate = model.tip_rate();
    let at = |o: &nanotap_flow::Output, x: &[f64]| o.at(model.system.drive(), x, 0.0);
    for period in 0..options.periods {
        run.run_period(|phase, x| grid.see(period, phase, x));
        check(model, run.state(), transient + period)?;
        strobe_curve.push([at(&model.tip, run.state()), at(&rate, run.state())]);
        if strobes.len() == kept {
            strobes.pop_front();
        }
        strobes.push_back(run.state().to_vec());
    }
    let seconds = clock.elapsed().as_secs_f64().max(1e-9);
    let mut strobes = Vec::from(strobes);
    let (apparent_period, closure) = apparent_period(&strobes);
    let last = strobes.last().cloned().unwrap_or_default();
    let named =
        NamedMotion::of(&classify(&mut ModelMap::new(model), &last, &options.classify()).kind);
    Ok(FixedStepRun {
        method: "rk4",
        steps,
        switching: switching_name,
        periods: options.periods,
        transient,
        start,
        apparent_period,
        closure,
        longest_apparent: LONGEST_APPARENT.min(options.periods / 2),
        tip_max: grid.high,
        tip_min: grid.low,
        amplitude: 0.5 * (grid.high - grid.low),
        contact_fraction: grid.in_contact / (options.periods as f64 * model.period()),
        strobe_curve,
        strobe: strobes.split_off(strobes.len().saturating_sub(options.strobe)),
        events: grid.events,
        events_left_out: grid.events_left_out,
        periods_per_second: (transient + options.periods) as f64 / seconds,
        exact: ExactVerdict {
            classification: named.classification,
            period: named.orbit.map(|o| o.period),
            evidence: named.evidence,
        },
        notes: Vec::new(),
        curve: grid.curve,
    })
}

/// An error once the work is cancelled, or where the state is not finite after a period.
fn check(model: &Model, state: &[f64], period: usize) -> Result<(), Error> {
    if model.system.cancel().is_cancelled() {
        return Err(Error::stopped());
    }
    if state.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(Error::numerics(format!(
            "the fixed-step run grew beyond the range of double precision in period {period}: take \
             more steps"
        )))
    }
}

/// Quantities that are read off the grid.
struct Observed<'a> {
    model: &'a Model,
    rate: nanotap_flow::Output,
    low: f64,
    high: f64,
    in_contact: f64,
    contact: bool,
    before: f64,
    events: Vec<GridEvent>,
    /// Largest number of listed events, and the number of those that are not listed.
    most_events: usize,
    events_left_out: usize,
    curve: Vec<[f64; 3]>,
}

impl<'a> Observed<'a> {
    fn new(model: &'a Model, start: &[f64], most_events: usize) -> Self {
        let drive = model.system.drive();
        let tip = model.tip.at(drive, start, 0.0);
        let rate = model.tip_rate();
        Self {
            low: tip,
            high: tip,
            in_contact: 0.0,
            contact: model.gap.at(drive, start, 0.0) <= 0.0,
            before: 0.0,
            events: Vec::new(),
            most_events,
            events_left_out: 0,
            curve: vec![[0.0, tip, rate.at(drive, start, 0.0)]],
            rate,
            model,
        }
    }

    fn see(&mut self, period: usize, phase: f64, x: &[f64]) {
        let drive = self.model.system.drive();
        let tau = period as f64 * self.model.period() + phase;
        let tip = self.model.tip.at(drive, x, phase);
        self.low = self.low.min(tip);
        self.high = self.high.max(tip);
        if self.contact {
            self.in_contact += tau - self.before;
        }
        self.before = tau;
        let contact = self.model.gap.at(drive, x, phase) <= 0.0;
        if contact != self.contact {
            let kind = if contact {
                ContactEventKind::ContactStart.name()
            } else {
                ContactEventKind::ContactEnd.name()
            };
            if self.events.len() < self.most_events {
                self.events.push(GridEvent { tau, kind });
            } else {
                self.events_left_out += 1;
            }
            self.contact = contact;
        }
        if period < CURVE_PERIODS && self.curve.len() < CURVE_POINTS {
            self.curve.push([tau, tip, self.rate.at(drive, x, phase)]);
        }
    }
}

/// The smallest period to which the last strobe points repeat, and how nearly.
fn apparent_period(strobes: &[Vec<f64>]) -> (Option<usize>, f64) {
    let largest = |a: &[f64]| a.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let tail = &strobes[strobes.len().saturating_sub(2 * LONGEST_APPARENT)..];
    let scale = tail
        .iter()
        .map(|x| largest(x))
        .fold(f64::MIN_POSITIVE, f64::max);
    let mut nearest = f64::INFINITY;
    for n in 1..=(tail.len() / 2).min(LONGEST_APPARENT) {
        let closure = tail
            .iter()
            .zip(&tail[n..])
            .map(|(a, b)| {
                a.iter()
                    .zip(b)
                    .map(|(a, b)| (a - b).abs())
                    .fold(0.0, f64::max)
            })
            .fold(0.0, f64::max)
            / scale;
        nearest = nearest.min(closure);
        if closure <= APPARENT_CLOSURE {
            return (Some(n), closure);
        }
    }
    (None, nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_error::ErrorKind;
    use nanotap_model::cantilever::Cantilever;
    use nanotap_model::parameter::Parameter;
    use nanotap_study::value::Steps;

    /// Without contact the method is of fourth order and finds the forced response.
    #[test]
    fn without_contact_it_converges_to_the_exact_flow() {
        let case = Cantilever::paper()
            .with_modes(1)
            .with(Parameter::Alpha5, 10.0)
            .with(Parameter::Alpha3, 1.0);
        let model = Model::cantilever(&case).unwrap();
        let run = |steps| {
            let options = SimulateOptions {
                periods: 128,
                steps: Steps([steps; 2]),
                transient: Some(60),
                ..Default::default()
            };
            fixed_step_run(&model, &options).unwrap()
        };
        let exact = crate::orbit::orbit(&model, &crate::orbit::OrbitOptions::default()).unwrap();
        let error = |run: &FixedStepRun| (run.strobe[0][0] - exact.state[0]).abs();
        let (coarse, fine) = (run(50), run(100));
        assert_eq!(
            (fine.apparent_period, fine.exact.period),
            (Some(1), Some(1))
        );
        let order = (error(&coarse) / error(&fine)).log2();
        assert!((order - 4.0).abs() < 0.3, "{order}");
        assert!(fine.events.is_empty() && fine.contact_fraction == 0.0);
    }

    /// A contact is noticed at a grid point, never before it happens and less than a
    /// step late.
    #[test]
    fn contacts_are_noticed_late() {
        let case = Cantilever::paper().with(Parameter::Omega, 3.0);
        let model = Model::cantilever(&case).unwrap();
        let exact = crate::orbit::orbit(&model, &crate::orbit::OrbitOptions::default()).unwrap();
        let steps = 4000;
        let options = SimulateOptions {
            steps: Steps([steps; 2]),
            state: Some(exact.state.clone().into()),
            transient: Some(0),
            periods: 2,
            ..Default::default()
        };
        let run = fixed_step_run(&model, &options).unwrap();
        assert_eq!(run.events[0].kind, "contact_start");
        let late = run.events[0].tau - exact.events[0].tau;
        let step = model.period() / f64::from(steps);
        assert!(late > -0.01 * step && late < 1.01 * step, "{late} {step}");
    }

    #[test]
    fn what_it_cannot_do_is_refused() {
        let model = Model::cantilever(&Cantilever::paper()).unwrap();
        let refused = |steps| {
            let options = SimulateOptions {
                steps: Steps(steps),
                transient: Some(2000),
                ..Default::default()
            };
            fixed_step_run(&model, &options).unwrap_err()
        };
        assert!(refused([3, 3]).message().contains("take more steps"));
        assert_eq!(refused([0, 10]).kind, ErrorKind::BadInput);
    }
}
