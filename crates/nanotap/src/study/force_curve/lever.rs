//! The lever over the moving sample, stretch by stretch.

use std::sync::Arc;

use nalgebra::DVector;
use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Complex, Flow, Output};
use nanotap_volterra::{ForceSums, SurfaceSums, Tone};

use super::path::{Plan, Stretch};
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
    /// Angular frequency at which the sample moves, model units.
    omega: f64,
    /// State vector of the model at the end of the last stretch.
    state: Vec<f64>,
    /// The beam's part of it at the last beginning of a drive period.
    before: Vec<f64>,
}

/// Results of a stretch.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    pub(super) force: ForceSums,
    /// Of the sample's motion; times are those of the drive period.
    pub(super) surface: SurfaceSums,
    /// The requested signals, in order.
    pub(super) signals: Vec<Signals>,
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
    /// is driven.
    ///
    /// # Errors
    /// When the flow cannot be set up.
    pub(super) fn new(plan: &Plan<'_>) -> Result<Self, Error> {
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
                let sums = LinearSums::new(model, &system, &by_gap, motion);
                Engine::Linear(Box::new(Linear {
                    sums: sums.over_surface(model, &system, motion, plan.path.omega),
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
        let mut state = plan.moving_statics.rest_state(gap)?;
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
            omega: plan.path.omega,
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
        [c, s, u]: [f64; 3],
        at: &[f64],
    ) -> Result<Sums, MotionError> {
        let Stretch { phase, length, .. } = *stretch;
        let beam = self.before.len();
        if phase == 0.0 {
            self.before.copy_from_slice(&self.state[..beam]);
        }
        let end = phase + length;
        let within = |time: &f64| (time - stretch.start + phase).clamp(phase, end);
        let recorded = !at.is_empty();
        let turned = Complex::new(s, -u) * turn(-self.omega * phase);
        let Self { model, state, .. } = self;
        match &mut self.engine {
            Engine::Linear(lever) => {
                let n = state.len();
                lever.state[..n].copy_from_slice(state);
                lever.state[n..].copy_from_slice(&[c - lever.gap, s, u]);
                lever.flow.start(&lever.state, phase)?;
                lever.sums.begin_over(turned);
                let whole = end >= model.period() * (1.0 - 1e-13);
                let mut recorder = Recorder::default();
                let mut both = (&mut lever.sums, &mut recorder);
                match (whole, recorded) {
                    (true, true) => lever.flow.run_period(&mut both)?,
                    (true, false) => lever.flow.run_period(both.0)?,
                    (false, true) => lever.flow.run_until(end, &mut both)?,
                    (false, false) => lever.flow.run_until(end, both.0)?,
                }
                lever.flow.state(&mut lever.state);
                state.copy_from_slice(&lever.state[..n]);
                let signals = if recorded {
                    let trajectory = recorder.finish(Arc::clone(lever.flow.system()));
                    let read = |time: &f64| {
                        let phase = within(time);
                        let regime = trajectory.segment_at(phase)?.regime;
                        Some(lever.signals(model, regime, &trajectory.state_at(phase)?, phase))
                    };
                    at.iter().filter_map(read).collect()
                } else {
                    Vec::new()
                };
                Ok(Sums {
                    force: lever.sums.sums,
                    surface: lever.sums.surface(),
                    signals,
                })
            }
            Engine::Nonlinear(lever) => {
                let system = lever.flow.system_mut();
                system.set_offset(lever.offset + c)?;
                system.set_gap_tone(lever.tone, turned)?;
                let n = system.dimension();
                let memory = state.get(n).filter(|memory| **memory >= 0.0);
                match memory.map(|memory| memory.round() as usize) {
                    Some(branch) => lever.flow.start_on(&state[..n], phase, branch)?,
                    None => lever.flow.start(&state[..n], phase)?,
                }
                let omega = model.frequency();
                let run = lever
                    .flow
                    .run_with_surface_sums(end, omega, lever.tone, recorded)?;
                lever.flow.state(&mut state[..n]);
                if let Some(memory) = state.get_mut(n) {
                    *memory = lever.flow.branch() as f64;
                }
                let drive = model.system.drive();
                let trajectory = run.trajectory.as_ref();
                let read = |time: &f64| {
                    let phase = within(time);
                    let sample = trajectory?.at(phase)?;
                    // A law's memory has no part in the deflection.
                    let mut state = sample.state.as_slice().to_vec();
                    state.resize(model.dimension(), 0.0);
                    Some(Signals {
                        gap: sample.gap,
                        deflection: model.tip.at(drive, &state, phase),
                        force: sample.force,
                        contact: lever.nonlinear.contact[sample.branch],
                    })
                };
                Ok(Sums {
                    force: run.force,
                    surface: run.surface,
                    signals: at.iter().filter_map(read).collect(),
                })
            }
        }
    }

    /// Complex amplitude of the deflection at the drive's frequency over the last drive period, and
    /// its mean.
    pub(super) fn deflection(&self, sums: &ForceSums) -> (Complex, f64) {
        let ends = self.state.iter().zip(&self.before);
        let change: Vec<f64> = ends.map(|(after, before)| after - before).collect();
        self.readout.deflection(&change, sums)
    }
}

impl Linear {
    /// The signals in a regime at a state with the motion of the sample.
    fn signals(&self, model: &Model, regime: usize, state: &[f64], phase: f64) -> Signals {
        let drive = model.system.drive();
        let at = |output: &Output| output.at(drive, state, phase);
        Signals {
            gap: at(&self.height),
            deflection: model.tip.at(drive, &state[..model.dimension()], phase),
            force: at(&self.forces[regime]),
            contact: model.contact[regime],
        }
    }
}

/// Returns `e^{i angle}`, with the angle in rad.
fn turn(angle: f64) -> Complex {
    let (sin, cos) = nanotap_arithmetic::sin_cos(angle);
    Complex::new(cos, sin)
}
