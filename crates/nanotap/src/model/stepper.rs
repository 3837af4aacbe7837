//! Steps of a model's flow from any instant of the drive period.

use nanotap_flow::Flow;

use super::{Model, MotionError};

/// The flow of a model from any instant of the drive period.
pub(crate) enum Stepper {
    Linear(Box<Flow>),
    /// With the branch of the law at the beginning of the step, where the law remembers it.
    Nonlinear(Box<nanotap_volterra::Flow>),
}

impl Stepper {
    pub(crate) fn new(model: &Model) -> Self {
        match &model.nonlinear {
            None => Self::Linear(Box::new(Flow::new(model.system.clone()))),
            Some(nonlinear) => Self::Nonlinear(Box::new(nanotap_volterra::Flow::new(
                nonlinear.system.clone(),
            ))),
        }
    }

    /// State and branch after a step from time `from` to `to` of a drive period; `whole` is its length.
    pub(crate) fn step(
        &mut self,
        state: &[f64],
        branch: Option<usize>,
        [from, to, whole]: [f64; 3],
    ) -> Result<(Vec<f64>, Option<usize>), MotionError> {
        let mut after = state.to_vec();
        match self {
            Self::Linear(flow) => {
                flow.start(state, from)?;
                if to < whole {
                    flow.run_until(to, &mut ())?;
                } else {
                    flow.run_period(&mut ())?;
                }
                flow.state(&mut after);
                Ok((after, None))
            }
            Self::Nonlinear(flow) => {
                match branch {
                    Some(branch) => flow.start_on(state, from, branch)?,
                    None => flow.start(state, from)?,
                }
                flow.run_until(to)?;
                flow.state(&mut after);
                Ok((after, branch.map(|_| flow.branch())))
            }
        }
    }
}

impl Model {
    /// The entries of a state that vary continuously, and the branch that the law remembers.
    pub(crate) fn split(&self, state: &[f64]) -> (Vec<f64>, Option<usize>) {
        match &self.nonlinear {
            None => (state.to_vec(), None),
            Some(nonlinear) => {
                let n = nonlinear.system.dimension();
                let branch = state
                    .get(n)
                    .filter(|branch| nonlinear.remembers && **branch >= 0.0);
                (
                    state[..n].to_vec(),
                    branch.map(|branch| branch.round() as usize),
                )
            }
        }
    }

    /// The state with these entries that vary continuously and this branch.
    pub(crate) fn joined(&self, mut state: Vec<f64>, branch: Option<usize>) -> Vec<f64> {
        if self.nonlinear.as_ref().is_some_and(|law| law.remembers) {
            state.push(branch.map_or(-1.0, |branch| branch as f64));
        }
        state
    }
}
