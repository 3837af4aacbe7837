//! The lever over the moving sample, stretch by stretch.

use std::sync::Arc;

use nanotap_flow::Complex;
use nanotap_volterra::ForceSums;

use super::path::{Plan, Stretch};
use crate::moving_lever::{MovingLever, Sums};
use crate::moving_sample::{Readout, SampleMotion};
use nanotap_error::Error;
use nanotap_model::MotionError;

/// The lever and its state.
#[derive(Clone, Debug)]
pub(super) struct Lever {
    moving: MovingLever,
    readout: Readout,
    /// State vector of the model at the end of the last stretch.
    state: Vec<f64>,
    /// The beam's part of it at the last beginning of a drive period.
    before: Vec<f64>,
}

impl Lever {
    /// The lever of a plan, at rest at the first distance; in the free steady motion about it, if it
    /// is driven.
    ///
    /// # Errors
    /// When the flow cannot be set up.
    pub(super) fn new(plan: &Plan<'_>) -> Result<Self, Error> {
        let model = &plan.model;
        let gap = plan.path.from;
        let motion = SampleMotion {
            sign: 1.0,
            omega: Some(plan.path.omega),
        };
        let there = plan.case.with(plan.case.gap_key(), gap);
        let cantilever = nanotap_study::cantilever(&there, "force-curve")?;
        let beam = 2 * cantilever.modes;
        let mut state = plan.moving_statics.rest_state(gap)?;
        if plan.driven {
            let tone = &model.system.regimes()[0].response().tones[0];
            for (entry, z) in state.iter_mut().zip(tone.iter()) {
                *entry += z.re;
            }
        }
        Ok(Self {
            moving: MovingLever::new(cantilever, Arc::new(model.clone()), gap, motion)?,
            readout: Readout::new(model, beam, 1.0)?,
            before: vec![0.0; beam],
            state,
        })
    }

    /// Advances by a stretch, while the distance is `c + Re((s − i u) e^{iωt})` from its start on,
    /// and reads the signals at the times `at`, in order, from the start of the curve.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn advance(
        &mut self,
        stretch: &Stretch,
        distance: [f64; 3],
        at: &[f64],
    ) -> Result<Sums, MotionError> {
        let Stretch { phase, length, .. } = *stretch;
        if phase == 0.0 {
            let beam = self.before.len();
            self.before.copy_from_slice(&self.state[..beam]);
        }
        let end = phase + length;
        let within = |time: &f64| (time - stretch.start + phase).clamp(phase, end);
        let phases: Vec<f64> = at.iter().map(within).collect();
        self.moving
            .advance(&mut self.state, [phase, end], distance, &phases)
    }

    /// Complex amplitude of the deflection at the drive's frequency over the last drive period, and
    /// its mean.
    pub(super) fn deflection(&self, sums: &ForceSums) -> (Complex, f64) {
        let ends = self.state.iter().zip(&self.before);
        let change: Vec<f64> = ends.map(|(after, before)| after - before).collect();
        self.readout.deflection(&change, sums)
    }
}
