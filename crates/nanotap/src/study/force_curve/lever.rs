//! The lever over the moving sample, stretch by stretch.

use std::sync::Arc;

use nalgebra::DVector;
use nanotap_flow::{Complex, Flow, Output};
use nanotap_volterra::{ForceSums, Tone};

use super::path::Plan;
use crate::Error;
use crate::model::nonlinear::Nonlinear;
use crate::model::parameter::Parameter;
use crate::model::{Model, MotionError, cantilever_model_tangent};
use crate::study::moving_sample::{LinearSums, Readout, SampleMotion, moved_system};

/// Signals at an instant, or their means over a drive period, in the model's units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Signals {
    /// Height of the tip over the undeformed surface.
    pub(super) gap: f64,
    pub(super) deflection: f64,
    pub(super) force: f64,
    pub(super) contact: bool,
}

/// The lever and its state.
#[derive(Clone, Debug)]
pub(super) struct Lever {
    engine: Engine,
    model: Model,
    readout: Readout,
    /// State vector of the model at the end of the last stretch.
    state: Vec<f64>,
    before: Vec<f64>,
}

#[derive(Clone, Debug)]
enum Engine {
    Linear(Box<Linear>),
    Nonlinear(Box<Law>),
}

/// A piecewise-linear sample, its motion as further states.
#[derive(Clone, Debug)]
struct Linear {
    flow: Flow,
    sums: LinearSums,
    state: Vec<f64>,
    /// Gap of the model, model units: the first distance, from which the motion is counted.
    gap: f64,
    height: Output,
    forces: Vec<Output>,
}

/// A nonlinear law, the motion of the sample as a further tone of the gap.
#[derive(Clone, Debug)]
struct Law {
    flow: nanotap_volterra::Flow,
    nonlinear: Arc<Nonlinear>,
    /// Offset of the gap at distance 0, model units.
    offset: f64,
    /// Index of the added tone among the tones of the drive.
    tone: usize,
}

impl Lever {
    /// The lever of a plan, at rest at the first distance; in the free steady motion about it, if it
    /// is driven. The harmonic of forces is that at `omega`.
    ///
    /// # Errors
    /// When the flow cannot be set up.
    pub(super) fn new(plan: &Plan<'_>, omega: Option<f64>) -> Result<Self, Error> {
        let model = &plan.model;
        let cantilever = &plan.view.cantilever;
        let beam = 2 * cantilever.modes;
        let gap = plan.path.from;
        let motion = SampleMotion {
            sign: 1.0,
            omega: Some(plan.path.omega),
        };
        let engine = match &model.nonlinear {
            None => {
                let there = plan.case.with(plan.case.gap_key(), gap);
                let cantilever = crate::study::cantilever(&there, "force-curve")?;
                let tangent = cantilever_model_tangent(cantilever, model, Parameter::Alpha5)?;
                let system = moved_system(model, &tangent.system, motion)?;
                let by_gap: Vec<f64> = tangent.force.iter().map(|f| f.constant).collect();
                let forces = model.force.iter().zip(&by_gap);
                Engine::Linear(Box::new(Linear {
                    sums: LinearSums::new(model, &system, &by_gap, motion, omega),
                    height: motion.output(model, &model.height, 1.0),
                    forces: forces
                        .map(|(force, by)| motion.output(model, force, *by))
                        .collect(),
                    state: vec![0.0; model.dimension() + motion.states()],
                    flow: Flow::new(Arc::new(system)),
                    gap,
                }))
            }
            Some(nonlinear) => {
                let system = &nonlinear.system;
                let mut drive = system.drive().clone();
                let tone = drive.tones.len();
                drive.tones.push(Tone {
                    frequency: plan.path.omega,
                    forcing: DVector::zeros(system.dimension()),
                    gap: Complex::new(0.0, 0.0),
                });
                let moved = system.driven_by(drive).map_err(MotionError::from)?;
                Engine::Nonlinear(Box::new(Law {
                    offset: system.drive().offset - gap,
                    flow: nanotap_volterra::Flow::new(Arc::new(moved)),
                    nonlinear: Arc::clone(nonlinear),
                    tone,
                }))
            }
        };
        let mut state = plan.statics.rest_state(gap)?;
        if plan.driven {
            let tone = &model.system.regimes()[0].response().tones[0];
            for (entry, z) in state.iter_mut().zip(tone.iter()) {
                *entry += z.re;
            }
        }
        Ok(Self {
            engine,
            readout: Readout::new(model, beam, 1.0)?,
            model: model.clone(),
            before: vec![0.0; beam],
            state,
        })
    }

    /// Advances by `length` from drive phase `phase` (as a time), at most to the end of the drive
    /// period, while the distance is `c + Re((s − i u) e^{iωt})` from now on.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn advance(
        &mut self,
        phase: f64,
        length: f64,
        [c, s, u]: [f64; 3],
        omega: f64,
        harmonic: f64,
    ) -> Result<ForceSums, MotionError> {
        let beam = self.before.len();
        self.before.copy_from_slice(&self.state[..beam]);
        match &mut self.engine {
            Engine::Linear(lever) => {
                let n = self.state.len();
                lever.state[..n].copy_from_slice(&self.state);
                lever.state[n..].copy_from_slice(&[c - lever.gap, s, u]);
                lever.flow.start(&lever.state, phase)?;
                lever.sums.begin();
                let end = phase + length;
                let period = self.model.period();
                if end >= period * (1.0 - 1e-13) {
                    lever.flow.run_period(&mut lever.sums)?;
                } else {
                    lever.flow.run_until(end, &mut lever.sums)?;
                }
                lever.flow.state(&mut lever.state);
                self.state.copy_from_slice(&lever.state[..n]);
                Ok(lever.sums.sums)
            }
            Engine::Nonlinear(lever) => {
                let turned = Complex::new(s, -u) * turn(-omega * phase);
                let system = lever.flow.system_mut();
                system.set_offset(lever.offset + c)?;
                system.set_gap_tone(lever.tone, turned)?;
                let n = system.dimension();
                let memory = self.state.get(n).filter(|memory| **memory >= 0.0);
                match memory.map(|memory| memory.round() as usize) {
                    Some(branch) => lever.flow.start_on(&self.state[..n], phase, branch)?,
                    None => lever.flow.start(&self.state[..n], phase)?,
                }
                let sums = lever.flow.run_with_force_sums(phase + length, harmonic)?;
                lever.flow.state(&mut self.state[..n]);
                if let Some(memory) = self.state.get_mut(n) {
                    *memory = lever.flow.branch() as f64;
                }
                Ok(sums)
            }
        }
    }

    /// Signals at the end of the last stretch, which was at drive phase `phase`.
    pub(super) fn instant(&self, phase: f64) -> Signals {
        let drive = self.model.system.drive();
        match &self.engine {
            Engine::Linear(lever) => {
                let regime = lever.flow.regime();
                let at = |output: &Output| output.at(drive, &lever.state, phase);
                Signals {
                    gap: at(&lever.height),
                    deflection: self.model.tip.at(drive, &self.state, phase),
                    force: at(&lever.forces[regime]),
                    contact: self.model.contact[regime],
                }
            }
            Engine::Nonlinear(lever) => {
                let (gap, rate) = lever.flow.gap();
                let branch = lever.flow.branch();
                let system = &lever.nonlinear.system;
                let second = system.second_argument(phase, rate, &self.state[..system.dimension()]);
                Signals {
                    gap,
                    deflection: self.model.tip.at(drive, &self.state, phase),
                    force: system.law().force(branch, gap, second).value,
                    contact: lever.nonlinear.contact[branch],
                }
            }
        }
    }

    /// Complex amplitude of the deflection at the drive's frequency over the last stretch, a whole
    /// drive period, and its mean.
    pub(super) fn deflection(&self, sums: &ForceSums) -> (Complex, f64) {
        let ends = self.state.iter().zip(&self.before);
        let change: Vec<f64> = ends.map(|(after, before)| after - before).collect();
        self.readout.deflection(&change, sums)
    }
}

/// Returns `e^{i angle}`, with the angle in rad.
fn turn(angle: f64) -> Complex {
    let (sin, cos) = nanotap_arithmetic::sin_cos(angle);
    Complex::new(cos, sin)
}
