//! The derivative of a model with respect to one parameter.

use nanotap_flow::Output;
use nanotap_flow::sensitivity::SystemTangent;

use crate::{Model, RigidStop};

/// The derivative of a [`Model`], of its system and its outputs, at constant state and drive phase.
/// Tip and slope do not depend on any parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelTangent {
    /// Derivative of the piecewise-linear system.
    pub system: SystemTangent,
    /// Derivative of the tip's height V_T over the undeformed surface.
    pub height: Output,
    /// Derivative of the displacement of the base of a beam.
    pub base: Output,
    /// Derivative of the force of the sample on the tip; an entry per regime.
    pub force: Vec<Output>,
    /// Derivatives of the two factors of each product in the power lost in the beam's own damping.
    pub beam_power: Vec<[Output; 2]>,
    /// Derivatives of the phases of further tones, in rad.
    pub tone_phases: Vec<f64>,
    /// Derivatives of the numbers of the rigid stop.
    pub rigid_stop: RigidStop,
}

impl ModelTangent {
    /// Returns the zero derivative of `model`.
    pub fn zeros(model: &Model) -> Self {
        let zero = model.tip.scaled(0.0);
        let products = model.power().first().map_or(0, |power| power.beam.len());
        Self {
            system: SystemTangent::zeros(&model.system),
            height: zero.clone(),
            base: zero.clone(),
            force: vec![zero.clone(); model.force.len()],
            beam_power: vec![[zero.clone(), zero]; products],
            tone_phases: vec![0.0; model.tone_phases.len()],
            rigid_stop: RigidStop::default(),
        }
    }

    /// Adds `factor · other`: the chain rule for a change of several parameters.
    pub fn add(&mut self, factor: f64, other: &Self) {
        self.system.add(factor, &other.system);
        let outputs = |of: &Self| -> Vec<Output> {
            let single = [&of.height, &of.base].into_iter().chain(&of.force);
            single
                .chain(of.beam_power.iter().flatten())
                .cloned()
                .collect()
        };
        let mine = [&mut self.height, &mut self.base].into_iter();
        let mine = mine.chain(&mut self.force);
        for (mine, more) in mine
            .chain(self.beam_power.iter_mut().flatten())
            .zip(outputs(other))
        {
            *mine = mine.plus(factor, &more);
        }
        for (mine, more) in self.tone_phases.iter_mut().zip(&other.tone_phases) {
            *mine += factor * more;
        }
        let (stop, more) = (&mut self.rigid_stop, &other.rigid_stop);
        stop.mass += factor * more.mass;
        stop.restitution += factor * more.restitution;
        stop.tip += factor * more.tip;
    }
}
