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
use nanotap_flow::Complex;

use crate::moving_lever::MovingLever;
use crate::moving_sample::{Readout, SampleMotion};
use nanotap_case::Case;
use nanotap_error::Error;
use nanotap_model::MotionError;

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
    moving: MovingLever,
    /// Whether the sample is a nonlinear law.
    is_nonlinear: bool,
    readout: Readout,
    /// State entries of the beam; the rest is the sample's.
    beam: usize,
    /// State entries that vary continuously.
    continuous: usize,
    dimension: usize,
    free_start: Vec<f64>,
    free_deflection: Complex,
}

impl Lever {
    /// Creates the lever of `case`.
    ///
    /// # Errors
    /// When the case has no model, a second tone, or a rigid sample.
    pub(super) fn new(case: &Case) -> Result<Self, Error> {
        let model = Arc::new(case.model()?);
        let cantilever = nanotap_study::cantilever(case, "scan")?;
        nanotap_study::without_signal(case, "a scan")?;
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
        let motion = SampleMotion {
            sign: -1.0,
            omega: None,
        };
        Ok(Self {
            continuous: if model.nonlinear.is_some() {
                beam
            } else {
                model.dimension()
            },
            is_nonlinear: model.nonlinear.is_some(),
            moving: MovingLever::new(cantilever, Arc::clone(&model), gap, motion)?,
            readout,
            beam,
            dimension: model.dimension(),
            free_start: free.as_slice().to_vec(),
            free_deflection,
        })
    }

    /// State at drive phase 180° with this one of the beam, or without it of the steady motion far from
    /// the sample; the sample is relaxed.
    pub(super) fn start(&self, beam: Option<&[f64]>) -> Vec<f64> {
        let mut state = self.free_start.clone();
        if let Some(beam) = beam {
            state[..self.beam].copy_from_slice(beam);
        }
        state
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
        // Under a law no branch is remembered.
        let memory = if self.is_nonlinear { -1.0 } else { 0.0 };
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
        let period = self.readout.period();
        let distance = [gap, 0.0, 0.0];
        let sums = self.moving.advance(state, [0.0, period], distance, &[])?;
        let sums = sums.force;
        for (before, after) in change.iter_mut().zip(&*state) {
            *before = after - *before;
        }
        let (deflection, mean_deflection) = self.readout.deflection(change, &sums);
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
const MAX_CHANGE: usize = 2 * nanotap_model::beam::MAX_MODES;
