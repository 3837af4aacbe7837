//! One drive period of the lever above a sample that has moved: the exact map, and the signals of
//! the period.
//!
//! A period runs from drive phase 180° to 540°. The tip is then far from the sample whatever the
//! phase lag between 0° and 180°, so that a step of the gap does no work on the sample. Inside, the
//! drive's tone has the opposite sign and the period runs from phase 0.
//!
//! With the free lever `ẋ = A x + f(t) + b F`, the component of the deflection at the drive's
//! frequency follows from the change of the state over the period and from the force alone:
//! `(iΩ − A) ∫ x e^{−iΩt} dt = ∫ (f + b F) e^{−iΩt} dt − (x(T) − x(0))`.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::{Complex, Flow};
use nanotap_volterra::ForceSums;

use crate::Error;
use crate::case::Case;
use crate::model::nonlinear::Nonlinear;
use crate::model::parameter::Parameter;
use crate::model::{MotionError, cantilever_model_tangent};
use crate::study::moving_sample::{LinearSums, Readout, SampleMotion, moved_system};

/// Signals of one drive period, in the model's units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PeriodSignals {
    /// Complex amplitude of the deflection at the drive's frequency, with the phase relative to
    /// drive phase 0.
    pub(super) deflection: Complex,
    /// Complex amplitude of the force at the drive's frequency, with the phase relative to drive
    /// phase 0.
    pub(super) force: Complex,
    /// Mean force of the sample on the tip over the period, model units; positive if it repels.
    pub(super) mean_force: f64,
    /// Mean deflection of the tip over the period, model units.
    pub(super) mean_deflection: f64,
    /// Largest force of the sample on the tip, model units, at least 0.
    pub(super) peak_force: f64,
    /// Time in contact over the period, 0 to 1.
    pub(super) contact: f64,
    /// Energy that the tip gives to the sample in the period, model units.
    pub(super) dissipation: f64,
}

/// The lever above one material.
#[derive(Clone, Debug)]
pub(super) struct Lever {
    flow: LeverFlow,
    readout: Readout,
    /// State entries of the beam; the rest is the sample's.
    beam: usize,
    /// State entries that vary continuously.
    continuous: usize,
    dimension: usize,
    free_start: Vec<f64>,
    free_deflection: Complex,
}

#[derive(Clone, Debug)]
enum LeverFlow {
    Linear(Box<LinearLever>),
    Nonlinear(Box<NonlinearLever>),
}

/// A piecewise-linear sample: the change of the gap is one more state, which stays constant.
#[derive(Clone, Debug)]
struct LinearLever {
    flow: Flow,
    sums: LinearSums,
    state: Vec<f64>,
    /// Gap of the model, model units, from which its change is counted.
    gap: f64,
}

/// A lever under a nonlinear law, with the exact flow.
#[derive(Clone, Debug)]
struct NonlinearLever {
    flow: nanotap_volterra::Flow,
    law: LawState,
    /// Offset of the gap at distance 0, model units.
    offset: f64,
}

/// Properties of a nonlinear model that a step of one period uses.
#[derive(Clone, Copy, Debug)]
struct LawState {
    dimension: usize,
    remembers: bool,
    period: f64,
    omega: f64,
}

impl LawState {
    /// The branch that the law remembers, after the beam's part of a state.
    fn branch(self, state: &[f64]) -> Option<usize> {
        let memory = state.get(self.dimension).filter(|_| self.remembers)?;
        (*memory >= 0.0).then_some(memory.round() as usize)
    }

    fn remember(self, state: &mut [f64], branch: usize) {
        if self.remembers {
            state[self.dimension] = branch as f64;
        }
    }
}

impl Lever {
    /// Creates the lever of `case`.
    ///
    /// # Errors
    /// When the case has no model, a second tone, or a rigid sample.
    pub(super) fn new(case: &Case) -> Result<Self, Error> {
        let model = case.model()?;
        let cantilever = crate::study::cantilever(case, "scan")?;
        crate::study::without_signal(case, "a scan")?;
        if model.system.drive().frequencies().len() != 1 {
            return Err(Error::input(
                "a scan needs a drive of one tone",
                "leave out the second tone of the drive",
            ));
        }
        let gap = case.get(case.gap_key());
        let beam = 2 * cantilever.modes;
        let readout = Readout::new(&model, beam, -1.0)?;
        let response = model.system.regimes()[0].response();
        let free: DVector<f64> = &response.constant - response.tones[0].map(|z| z.re);
        let free_deflection = model.system.regimes()[0].project(&model.tip).tones[0];
        let flow = match &model.nonlinear {
            None => {
                let tangent = cantilever_model_tangent(cantilever, &model, Parameter::Alpha5)?;
                let motion = SampleMotion {
                    sign: -1.0,
                    omega: None,
                };
                let system = moved_system(&model, &tangent.system, motion)?;
                let forces: Vec<f64> = tangent.force.iter().map(|f| f.constant).collect();
                LeverFlow::Linear(Box::new(LinearLever {
                    sums: LinearSums::new(&model, &system, &forces, motion),
                    flow: Flow::new(Arc::new(system)),
                    state: vec![0.0; model.dimension() + 1],
                    gap,
                }))
            }
            Some(nonlinear) => {
                let system = turned_system(nonlinear)?;
                let law = LawState {
                    dimension: system.dimension(),
                    remembers: nonlinear.remembers,
                    period: nonlinear.period,
                    omega: model.frequency(),
                };
                LeverFlow::Nonlinear(Box::new(NonlinearLever {
                    offset: system.drive().offset - gap,
                    flow: nanotap_volterra::Flow::new(system),
                    law,
                }))
            }
        };
        Ok(Self {
            continuous: match flow {
                LeverFlow::Linear(_) => model.dimension(),
                LeverFlow::Nonlinear(_) => beam,
            },
            flow,
            readout,
            beam,
            dimension: model.dimension(),
            free_start: free.as_slice().to_vec(),
            free_deflection,
        })
    }

    /// State of the steady motion far from the sample, at drive phase 180°.
    pub(super) fn free_start(&self) -> Vec<f64> {
        self.free_start.clone()
    }

    /// Complex amplitude of the deflection far from the sample.
    pub(super) const fn free_deflection(&self) -> Complex {
        self.free_deflection
    }

    /// Amplitude of a force at the drive's frequency that alone moves the lever by the free
    /// amplitude.
    pub(super) fn free_force(&self) -> f64 {
        self.free_deflection.modulus() / self.readout.compliance().max(f64::MIN_POSITIVE)
    }

    /// Takes over the beam's part of a state from a lever above another material. The sample is
    /// relaxed, and detached where the gap allows it.
    pub(super) fn take_over(&self, state: &mut Vec<f64>) {
        let beam = self.beam;
        state.resize(self.dimension, 0.0);
        let memory = match &self.flow {
            LeverFlow::Linear(_) => 0.0,
            // No branch is remembered.
            LeverFlow::Nonlinear(_) => -1.0,
        };
        state[beam..].fill(memory);
    }

    /// Replaces `state` at drive phase 180° by the state one period later, the sample at distance
    /// `gap` in the model's unit of length.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn advance(
        &mut self,
        state: &mut [f64],
        gap: f64,
    ) -> Result<PeriodSignals, MotionError> {
        let mut change: [f64; MAX_CHANGE] = [0.0; MAX_CHANGE];
        let change = &mut change[..self.beam];
        change.copy_from_slice(&state[..self.beam]);
        let sums = match &mut self.flow {
            LeverFlow::Linear(lever) => lever.advance(state, gap)?,
            LeverFlow::Nonlinear(lever) => lever.advance(state, gap)?,
        };
        for (before, after) in change.iter_mut().zip(&*state) {
            *before = after - *before;
        }
        let (deflection, mean_deflection) = self.readout.deflection(change, &sums);
        let period = self.readout.period();
        Ok(PeriodSignals {
            deflection,
            mean_deflection,
            force: self.readout.at_phase_zero(sums.harmonic),
            mean_force: sums.impulse / period,
            peak_force: sums.peak,
            contact: sums.contact / period,
            dissipation: -sums.work,
        })
    }

    /// The derivative of the map by state and gap by central differences: columns of the state,
    /// then of the gap; rows of the state, then of the real and imaginary part of the deflection.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn linearised(
        &mut self,
        state: &[f64],
        gap: f64,
        scale: f64,
    ) -> Result<DMatrix<f64>, MotionError> {
        let n = self.continuous;
        let step = DIFFERENCE * scale;
        let mut result = DMatrix::zeros(n + 2, n + 1);
        for column in 0..=n {
            let mut ends = [DVector::zeros(n + 2), DVector::zeros(n + 2)];
            for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
                let (mut state, mut gap) = (state.to_vec(), gap);
                match state.get_mut(column).filter(|_| column < n) {
                    Some(entry) => *entry += sign * step,
                    None => gap += sign * step,
                }
                let signals = self.advance(&mut state, gap)?;
                for (to, value) in end.iter_mut().zip(&state[..n]) {
                    *to = *value;
                }
                (end[n], end[n + 1]) = (signals.deflection.re, signals.deflection.im);
            }
            result.set_column(column, &((&ends[1] - &ends[0]) / (2.0 * step)));
        }
        Ok(result)
    }

    /// Number of state entries that vary continuously.
    pub(super) const fn continuous_dimension(&self) -> usize {
        self.continuous
    }
}

/// Step of a difference quotient, as a part of the free amplitude.
const DIFFERENCE: f64 = 1e-6;
/// Entries of the largest beam's state.
const MAX_CHANGE: usize = 2 * crate::model::beam::MAX_MODES;

/// The law's system with the drive half a period later.
fn turned_system(nonlinear: &Nonlinear) -> Result<Arc<nanotap_volterra::System>, Error> {
    let system = &nonlinear.system;
    let mut drive = system.drive().clone();
    for tone in &mut drive.tones {
        tone.forcing.neg_mut();
        tone.gap = -tone.gap;
    }
    let turned = system.driven_by(drive).map_err(MotionError::from)?;
    Ok(Arc::new(turned))
}

impl LinearLever {
    fn advance(&mut self, state: &mut [f64], gap: f64) -> Result<ForceSums, MotionError> {
        let n = state.len();
        self.state[..n].copy_from_slice(state);
        self.state[n] = gap - self.gap;
        self.flow.start(&self.state, 0.0)?;
        self.sums.begin();
        self.flow.run_period(&mut self.sums)?;
        self.flow.state(&mut self.state);
        state.copy_from_slice(&self.state[..n]);
        Ok(self.sums.sums)
    }
}

impl NonlinearLever {
    fn advance(&mut self, state: &mut [f64], gap: f64) -> Result<ForceSums, MotionError> {
        let law = self.law;
        self.flow.system_mut().set_offset(self.offset + gap)?;
        let beam = &state[..law.dimension];
        match law.branch(state) {
            Some(branch) => self.flow.start_on(beam, 0.0, branch)?,
            None => self.flow.start(beam, 0.0)?,
        }
        let sums = self.flow.run_with_force_sums(law.period, law.omega)?;
        self.flow.state(&mut state[..law.dimension]);
        law.remember(state, self.flow.branch());
        Ok(sums)
    }
}
