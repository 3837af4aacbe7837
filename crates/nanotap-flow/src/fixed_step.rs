//! The paper's own method: fourth-order Runge–Kutta with a fixed step in each
//! regime, switching on the grid, for comparison.
//!
//! The switch is detected up to a step late, so the method is of first order with
//! an integrator of any order, and the delay acts like a small random force:
//! subharmonics appear that the system does not have.

use crate::system::System;
use crate::{Complex, Drive, FlowError, HarmonicVector, Regime};
use nalgebra::{DMatrix, DVector};

/// How often in a step the guards are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switching {
    /// Once per step: all four stages use the regime found at its start.
    EveryStep,
    /// At every stage: each evaluation of the field checks the guards.
    EveryStage,
}

/// A fixed-step Runge–Kutta integration of a system whose resets are continuous.
#[derive(Clone, Debug)]
pub struct FixedStep<'a> {
    system: &'a System,
    /// Number of steps per drive period in each regime.
    steps: Vec<u32>,
    switching: Switching,
    regime: usize,
    state: DVector<f64>,
    /// Combined whole step of each regime; empty if every stage checks the guards.
    whole: Vec<WholeStep>,
    /// Phasors `e^{iω_k t}` of the tones at the state's phase.
    phasors: Vec<Complex>,
    next: DVector<f64>,
    /// Work space of a step taken stage by stage: where the field is taken, and the field.
    stage: DVector<f64>,
    rate: DVector<f64>,
}

/// All four stages of a step of one length in one regime. The field `A x + c + Re(z e^{iωt})`
/// is linear, so they come to `R x + c' + Re(z' e^{iωt})` with, for `Z = h A`,
/// `R = I + Z + Z²/2 + Z³/6 + Z⁴/24`.
#[derive(Clone, Debug)]
struct WholeStep {
    length: f64,
    matrix: DMatrix<f64>,
    added: HarmonicVector,
    /// Factors `e^{iω_k h}` by which the tones' phasors advance in a step.
    turns: Vec<Complex>,
}

impl WholeStep {
    fn new(regime: &Regime, drive: &Drive, length: f64) -> Self {
        let n = regime.matrix().nrows();
        let one = DMatrix::identity(n, n);
        let z = regime.matrix() * length;
        // What the field's own part at the start, the middle and the end of a step adds.
        let start = (&one + &z * (&one + &z * (&one + &z * 0.5) * 0.5)) * (length / 6.0);
        let middle = (&one * 4.0 + &z * (&one * 2.0 + &z * 0.5)) * (length / 6.0);
        let end = &one * (length / 6.0);
        let turns = |t: f64| -> Vec<Complex> {
            let tones = 0..drive.frequencies().len();
            tones.map(|k| drive.phasor(k, t)).collect()
        };
        let later = |t: f64| HarmonicVector {
            constant: regime.forcing().constant.clone(),
            tones: regime
                .forcing()
                .tones
                .iter()
                .zip(turns(t))
                .map(|(tone, turn)| tone * turn)
                .collect(),
        };
        Self {
            length,
            matrix: &one + &z * (&one + &z * (&one + &z * (&one + &z * 0.25) / 3.0) * 0.5),
            added: later(0.0)
                .mapped(&start)
                .plus(1.0, &later(0.5 * length).mapped(&middle))
                .plus(1.0, &later(length).mapped(&end)),
            turns: turns(length),
        }
    }

    /// Writes the state after the step from `x`, where the tones are at `phasors`, to `next`.
    fn take(&self, phasors: &mut [Complex], x: &DVector<f64>, next: &mut DVector<f64>) {
        let next = next.as_mut_slice();
        self.added
            .write_where_tones_are(phasors.iter().copied(), next);
        let columns = self.matrix.as_slice().chunks_exact(next.len());
        for (column, x) in columns.zip(x.as_slice()) {
            for (next, m) in next.iter_mut().zip(column) {
                *next += m * x;
            }
        }
        for (phasor, turn) in phasors.iter_mut().zip(&self.turns) {
            *phasor *= turn;
        }
    }
}

/// Largest deviation, as a fraction of the period, of the sum of a period's steps from it by
/// rounding.
const ROUNDING: f64 = 1e-12;

impl<'a> FixedStep<'a> {
    /// Creates an integration from state `x`, phase 0, with `steps[r]` steps per drive period in
    /// regime `r`.
    ///
    /// # Errors
    /// If sizes do not fit, a step count is zero, or no regime contains the state.
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
        let drive = system.drive();
        let whole = match switching {
            Switching::EveryStep => system
                .regimes()
                .iter()
                .zip(steps)
                .map(|(regime, &steps)| {
                    WholeStep::new(regime, drive, drive.period() / f64::from(steps))
                })
                .collect(),
            Switching::EveryStage => Vec::new(),
        };
        Ok(Self {
            system,
            steps: steps.to_vec(),
            switching,
            regime,
            state: DVector::from_column_slice(x),
            whole,
            phasors: vec![Complex::new(1.0, 0.0); drive.frequencies().len()],
            next: DVector::zeros(x.len()),
            stage: DVector::zeros(x.len()),
            rate: DVector::zeros(x.len()),
        })
    }

    /// Returns the present state, of length `n`.
    pub fn state(&self) -> &[f64] {
        self.state.as_slice()
    }

    /// Runs one drive period and returns the number of switches. `watch` receives each step's phase
    /// and state. The run ends early once the system is cancelled.
    pub fn run_period(&mut self, mut watch: impl FnMut(f64, &[f64])) -> u32 {
        let period = self.system.drive().period();
        let mut phase = 0.0;
        let mut switches = 0;
        self.phasors.fill(Complex::new(1.0, 0.0));
        while phase < period * (1.0 - ROUNDING) && self.system.check_cancel().is_ok() {
            let step = period / f64::from(self.steps[self.regime]);
            let left = period - phase;
            // What is left of the period is a step but for the rounding of their sum.
            let step = if left < step - ROUNDING * period {
                left
            } else {
                step
            };
            match self.whole.get(self.regime) {
                Some(whole) if whole.length == step => {
                    whole.take(&mut self.phasors, &self.state, &mut self.next);
                    std::mem::swap(&mut self.state, &mut self.next);
                }
                // Stages that look at the guards; a step cut short by the period's end.
                _ => self.step(phase, step),
            }
            phase += step;
            watch(phase, self.state.as_slice());
            if let Some(next) = self.target(self.state.as_slice(), &self.phasors) {
                self.regime = next;
                switches += 1;
            }
        }
        switches
    }

    /// Returns the regime to which a guard of the present one sends the state `x`, where the tones
    /// are at `phasors`.
    fn target(&self, x: &[f64], phasors: &[Complex]) -> Option<usize> {
        self.system.transitions()[self.regime]
            .iter()
            .find(|e| e.guard.where_tones_are(phasors, x) <= 0.0)
            .map(|e| e.target)
    }

    /// Writes the field at `self.stage`, where the tones are at `phasors`, to `self.rate`.
    fn field(&mut self, phasors: &[Complex]) {
        let mut regime = self.regime;
        let x = self.stage.as_slice();
        if self.switching == Switching::EveryStage
            && let Some(target) = self.target(x, phasors)
        {
            regime = target;
        }
        let regime = &self.system.regimes()[regime];
        let rate = self.rate.as_mut_slice();
        let tones = phasors.iter().copied();
        regime.forcing().write_where_tones_are(tones, rate);
        self.rate.gemv(1.0, regime.matrix(), &self.stage, 1.0);
    }

    /// Takes a step of length `h` from phase `t`, stage by stage.
    fn step(&mut self, t: f64, h: f64) {
        let drive = self.system.drive();
        let tones = 0..drive.frequencies().len();
        let at = |t: f64| -> Vec<Complex> { tones.clone().map(|k| drive.phasor(k, t)).collect() };
        let (middle, end) = (at(t + 0.5 * h), at(t + h));
        let start = std::mem::replace(&mut self.phasors, end.clone());
        let stages = [
            (0.0, &start, 1.0),
            (0.5, &middle, 2.0),
            (0.5, &middle, 2.0),
            (1.0, &end, 1.0),
        ];
        self.next.copy_from(&self.state);
        self.rate.fill(0.0);
        for (part, phasors, weight) in stages {
            self.stage.copy_from(&self.state);
            self.stage.axpy(part * h, &self.rate, 1.0);
            self.field(phasors);
            self.next.axpy(weight * h / 6.0, &self.rate, 1.0);
        }
        std::mem::swap(&mut self.state, &mut self.next);
    }
}
