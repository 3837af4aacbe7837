//! The paper's own method: fourth-order Runge–Kutta with a fixed step in each
//! regime, switching on the grid. It is here to show what it does wrong.
//!
//! The switch is noticed up to a step late, so the method is of first order
//! whatever the order of the integrator, and the delay acts like a small random
//! force: subharmonics appear that the system does not have.

use crate::system::System;
use crate::{FlowError, Output};
use nalgebra::DVector;

/// Where within a step the regime is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switching {
    /// Once a step: all four stages use the regime found at its start.
    EveryStep,
    /// At every stage: each evaluation of the field looks at the guards.
    EveryStage,
}

/// A fixed-step Runge–Kutta integration of a system whose resets are continuous.
#[derive(Clone, Debug)]
pub struct FixedStep<'a> {
    system: &'a System,
    /// Steps a drive period in each regime.
    steps: Vec<u32>,
    switching: Switching,
    regime: usize,
    state: DVector<f64>,
}

impl<'a> FixedStep<'a> {
    /// Starts at state `x`, phase 0, with `steps[r]` steps a drive period in regime `r`.
    ///
    /// # Errors
    /// When sizes do not fit, a step count is zero, or no regime holds the state.
    pub fn new(
        system: &'a System,
        x: &[f64],
        steps: &[u32],
        switching: Switching,
    ) -> Result<Self, FlowError> {
        if steps.len() != system.regimes().len() {
            let expected = system.regimes().len();
            return Err(FlowError::Shape {
                what: "the list of step counts",
                found: steps.len(),
                expected,
            });
        }
        if steps.contains(&0) {
            return Err(FlowError::Shape {
                what: "a step count",
                found: 0,
                expected: 1,
            });
        }
        if x.len() != system.dimension() {
            let expected = system.dimension();
            return Err(FlowError::Shape {
                what: "the state",
                found: x.len(),
                expected,
            });
        }
        if x.iter().any(|v| !v.is_finite()) {
            return Err(FlowError::NotFinite { what: "the state" });
        }
        let (regime, _) = system.regime_at(x, 0.0)?;
        Ok(Self {
            system,
            steps: steps.to_vec(),
            switching,
            regime,
            state: DVector::from_column_slice(x),
        })
    }

    /// The state.
    pub fn state(&self) -> &[f64] {
        self.state.as_slice()
    }

    /// One drive period; returns how many switches were noticed. `watch` sees each
    /// step's phase and state.
    pub fn run_period(&mut self, mut watch: impl FnMut(f64, &[f64])) -> u32 {
        let period = self.system.drive().period();
        let mut phase = 0.0;
        let mut switches = 0;
        while phase < period * (1.0 - 1e-12) {
            let step = (period / f64::from(self.steps[self.regime])).min(period - phase);
            self.step(phase, step);
            phase += step;
            watch(phase, self.state.as_slice());
            if let Some(next) = self.passed(phase) {
                self.regime = next;
                switches += 1;
            }
        }
        switches
    }

    fn passed(&self, t: f64) -> Option<usize> {
        self.system.transitions()[self.regime]
            .iter()
            .find(|e| self.value(&e.guard, &self.state, t) <= 0.0)
            .map(|e| e.target)
    }

    fn value(&self, output: &Output, x: &DVector<f64>, t: f64) -> f64 {
        output.at(self.system.drive(), x.as_slice(), t)
    }

    fn field(&self, x: &DVector<f64>, t: f64) -> DVector<f64> {
        let mut regime = self.regime;
        if self.switching == Switching::EveryStage {
            let transitions = &self.system.transitions()[regime];
            if let Some(e) = transitions
                .iter()
                .find(|e| self.value(&e.guard, x, t) <= 0.0)
            {
                regime = e.target;
            }
        }
        self.system.regimes()[regime].field(self.system.drive(), x, t)
    }

    fn step(&mut self, t: f64, h: f64) {
        let x = &self.state;
        let k1 = self.field(x, t);
        let k2 = self.field(&(x + &k1 * (0.5 * h)), t + 0.5 * h);
        let k3 = self.field(&(x + &k2 * (0.5 * h)), t + 0.5 * h);
        let k4 = self.field(&(x + &k3 * h), t + h);
        self.state += (k1 + 2.0 * (k2 + k3) + k4) * (h / 6.0);
    }
}
