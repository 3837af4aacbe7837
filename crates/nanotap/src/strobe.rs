//! The stroboscopic map of a model: the joint between the exact flow and the
//! analysis of its motions.

use std::sync::Arc;

use nalgebra::DMatrix;
use nanotap_dynamics::{StroboscopicMap, Tangency};
use nanotap_flow::extrema::sign_changes;
use nanotap_flow::flow::{Observer, SegmentView};
use nanotap_flow::signal::Signal;
use nanotap_flow::{Flow, FlowError, Output, System};

use crate::model::Model;

/// The map from the state at drive phase 0 to the state one drive period later.
#[derive(Clone, Debug)]
pub struct Strobe {
    flow: Flow,
    gap: Arc<Output>,
}

impl Strobe {
    /// The map of `model`.
    pub fn new(model: &Model) -> Self {
        Self { flow: Flow::new(Arc::clone(&model.system)), gap: Arc::new(model.gap.clone()) }
    }

    /// The flow it runs.
    pub fn flow(&self) -> &Flow {
        &self.flow
    }
}

impl StroboscopicMap for Strobe {
    type Error = FlowError;

    fn dimension(&self) -> usize {
        self.flow.system().dimension()
    }

    fn period(&self) -> f64 {
        self.flow.system().drive().period()
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), FlowError> {
        self.flow.start(state, 0.0)?;
        self.flow.run_period(&mut ())?;
        self.flow.state(state);
        Ok(())
    }

    fn advance_with_jacobian(&mut self, state: &mut [f64], jacobian: &mut DMatrix<f64>) -> Result<(), FlowError> {
        self.flow.start(state, 0.0)?;
        self.flow.run_period_with_jacobian(jacobian)?;
        self.flow.state(state);
        Ok(())
    }

    fn advance_with_tangencies(
        &mut self,
        state: &mut [f64],
        tangencies: &mut Vec<Tangency>,
    ) -> Result<(), FlowError> {
        self.flow.start(state, 0.0)?;
        let mut collector = GapExtrema { gap: &self.gap, tangencies };
        self.flow.run_period(&mut collector)?;
        self.flow.state(state);
        Ok(())
    }
}

/// Collects the local extrema of the gap over a period.
struct GapExtrema<'a> {
    gap: &'a Output,
    tangencies: &'a mut Vec<Tangency>,
}

impl Observer for GapExtrema<'_> {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let system: &System = segment.system;
        let regime = segment.regime();
        let gap = regime.project(self.gap);
        let signal = Signal::of(regime, system.drive(), &gap, segment.modal, segment.phase, segment.length);
        let rate = signal.differentiated(segment.length);
        for s in sign_changes(&rate, segment.length) {
            let phase = (segment.phase + s) / system.drive().period();
            self.tangencies.push(Tangency { phase, value: signal.at(s) });
        }
    }
}
