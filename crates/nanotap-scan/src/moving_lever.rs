//! The flow of the lever over a sample that moves, by either engine.

use std::sync::Arc;

use nalgebra::DVector;
use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Complex, Flow, Output};
use nanotap_volterra::{ForceSums, SurfaceSums, Tone};

use crate::moving_sample::{LinearSums, SampleMotion, moved_system};
use nanotap_error::Error;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::nonlinear::Nonlinear;
use nanotap_model::parameter::Parameter;
use nanotap_model::{Model, MotionError, cantilever_model_tangent};

/// Signals at an instant, or their means over a drive period, in the model's units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Signals {
    /// Height of the tip over the undeformed surface.
    pub(super) gap: f64,
    pub(super) deflection: f64,
    pub(super) force: f64,
    pub(super) contact: bool,
}

/// Results of a stretch.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    pub(super) force: ForceSums,
    /// Of a motion of the sample within the drive period; times are those of the period.
    pub(super) surface: SurfaceSums,
    /// The requested signals, in order.
    pub(super) signals: Vec<Signals>,
}

/// The lever over a sample that moves.
#[derive(Clone, Debug)]
pub(super) struct MovingLever {
    model: Arc<Model>,
    motion: SampleMotion,
    engine: Engine,
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
    /// Gap of the model, model units, from which the motion is counted.
    gap: f64,
    height: Output,
    forces: Vec<Output>,
}

/// A nonlinear law, a motion of the sample within the period as a further tone of the gap.
#[derive(Clone, Debug)]
struct Law {
    flow: nanotap_volterra::Flow,
    nonlinear: Arc<Nonlinear>,
    /// Offset of the gap at distance 0, model units.
    offset: f64,
    /// Index of the added tone among the tones of the drive.
    tone: Option<usize>,
}

impl MovingLever {
    /// The lever of a model at distance `gap`, model units, over a sample that moves so.
    ///
    /// # Errors
    /// When the flow cannot be set up.
    pub(super) fn new(
        cantilever: &Cantilever,
        model: Arc<Model>,
        gap: f64,
        motion: SampleMotion,
    ) -> Result<Self, Error> {
        let engine = match &model.nonlinear {
            None => {
                let tangent = cantilever_model_tangent(cantilever, &model, Parameter::Alpha5)?;
                let system = moved_system(&model, &tangent.system, motion)?;
                let by_gap: Vec<f64> = tangent.force.iter().map(|f| f.constant).collect();
                let forces = model.force.iter().zip(&by_gap);
                Engine::Linear(Box::new(Linear {
                    sums: LinearSums::new(&model, &system, &by_gap, motion),
                    height: motion.output(&model, &model.height, 1.0),
                    forces: forces
                        .map(|(force, by)| motion.output(&model, force, *by))
                        .collect(),
                    state: vec![0.0; model.dimension() + motion.states()],
                    flow: Flow::new(Arc::new(system)),
                    gap,
                }))
            }
            Some(nonlinear) => {
                let system = &nonlinear.system;
                let mut drive = system.drive().clone();
                for tone in &mut drive.tones {
                    tone.forcing.apply(|z| *z *= motion.sign);
                    tone.gap *= motion.sign;
                }
                let tone = motion.omega.map(|_| drive.tones.len());
                drive.tones.extend(motion.omega.map(|frequency| Tone {
                    frequency,
                    forcing: DVector::zeros(system.dimension()),
                    gap: Complex::new(0.0, 0.0),
                }));
                let moved = system.driven_by(drive).map_err(MotionError::from)?;
                Engine::Nonlinear(Box::new(Law {
                    offset: moved.drive().offset - gap,
                    flow: nanotap_volterra::Flow::new(Arc::new(moved)),
                    nonlinear: Arc::clone(nonlinear),
                    tone,
                }))
            }
        };
        Ok(Self {
            model,
            motion,
            engine,
        })
    }

    /// Advances a state of the model between two times of a drive period, while the distance is
    /// `c + Re((s − i u) e^{iωt})` with `t` from the first of them, and reads the signals at the
    /// times `at` of the period, in order. Without a motion within the period it is `c`.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn advance(
        &mut self,
        state: &mut [f64],
        [from, to]: [f64; 2],
        [c, s, u]: [f64; 3],
        at: &[f64],
    ) -> Result<Sums, MotionError> {
        let model = &*self.model;
        let turn = |omega: f64| {
            let (sin, cos) = nanotap_arithmetic::sin_cos(-omega * from);
            Complex::new(s, -u) * Complex::new(cos, sin)
        };
        let amplitude = self.motion.omega.map(turn).unwrap_or_default();
        match &mut self.engine {
            Engine::Linear(lever) => {
                let n = state.len();
                lever.state[..n].copy_from_slice(state);
                let added = lever.state[n..].iter_mut();
                for (entry, value) in added.zip([c - lever.gap, s, u]) {
                    *entry = value;
                }
                lever.flow.start(&lever.state, from)?;
                lever.sums.begin(amplitude);
                let whole = to >= model.period() * (1.0 - 1e-13);
                let mut recorder = Recorder::default();
                let mut both = (&mut lever.sums, &mut recorder);
                match (whole, at.is_empty()) {
                    (true, false) => lever.flow.run_period(&mut both)?,
                    (true, true) => lever.flow.run_period(both.0)?,
                    (false, false) => lever.flow.run_until(to, &mut both)?,
                    (false, true) => lever.flow.run_until(to, both.0)?,
                }
                lever.flow.state(&mut lever.state);
                state.copy_from_slice(&lever.state[..n]);
                let signals = if at.is_empty() {
                    Vec::new()
                } else {
                    let trajectory = recorder.finish(Arc::clone(lever.flow.system()));
                    let read = |&phase: &f64| {
                        let regime = trajectory.segment_at(phase)?.regime;
                        Some(lever.signals(model, regime, &trajectory.state_at(phase)?, phase))
                    };
                    at.iter().filter_map(read).collect()
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
                if let Some(tone) = lever.tone {
                    system.set_gap_tone(tone, amplitude)?;
                }
                lever.nonlinear.resume(&mut lever.flow, state, from)?;
                let omega = model.frequency();
                let (force, surface, trajectory) = match lever.tone {
                    None => {
                        let force = lever.flow.run_with_force_sums(to, omega)?;
                        (force, SurfaceSums::default(), None)
                    }
                    Some(tone) => {
                        let recorded = !at.is_empty();
                        let run = lever
                            .flow
                            .run_with_surface_sums(to, omega, tone, recorded)?;
                        (run.force, run.surface, run.trajectory)
                    }
                };
                lever.nonlinear.end(&lever.flow, state);
                let read = |&phase: &f64| {
                    let sample = trajectory.as_ref()?.at(phase)?;
                    // A law's memory has no part in the deflection.
                    let mut state = sample.state.as_slice().to_vec();
                    state.resize(model.dimension(), 0.0);
                    Some(Signals {
                        gap: sample.gap,
                        deflection: model.tip.at(model.system.drive(), &state, phase),
                        force: sample.force,
                        contact: lever.nonlinear.contact[sample.branch],
                    })
                };
                Ok(Sums {
                    force,
                    surface,
                    signals: at.iter().filter_map(read).collect(),
                })
            }
        }
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
