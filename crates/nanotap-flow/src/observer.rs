//! What can be seen of a flow while it runs: stretches within a regime, switches, ends of periods.

use nalgebra::{DMatrix, DVector};

use crate::Complex;
use crate::regime::{ModalOutput, Regime};
use crate::signal::Signal;
use crate::simd::ComplexVector;
use crate::system::{Reset, Switch, System, Transition};

/// A stretch within one regime and one drive period.
#[derive(Clone, Copy, Debug)]
pub struct SegmentView<'a> {
    /// The system.
    pub system: &'a System,
    /// The regime's number.
    pub regime: usize,
    /// When it starts, within its drive period (`0 ≤ phase < T`).
    pub phase: f64,
    /// How long it lasts.
    pub length: f64,
    /// Modal coordinates at its start.
    pub modal: &'a [Complex],
    /// `e^{λ_k · length}`.
    pub factors: &'a [Complex],
    /// Modal coordinates and the tones' phasors at its start, and what they are multiplied by
    /// on the way.
    pub(crate) packed: &'a [ComplexVector],
    pub(crate) turns: &'a [ComplexVector],
}

impl SegmentView<'_> {
    /// The regime.
    pub fn regime(&self) -> &Regime {
        &self.system.regimes()[self.regime]
    }

    /// An output over the stretch.
    pub fn signal(&self, output: &ModalOutput) -> Signal {
        let drive = self.system.drive();
        let (regime, modal) = (self.regime(), self.modal);
        Signal::of(regime, drive, output, modal, self.phase, self.length)
    }
}

/// A switch from one regime to another.
#[derive(Clone, Copy, Debug)]
pub struct SwitchView<'a> {
    /// The system.
    pub system: &'a System,
    /// The change of modal coordinates.
    pub switch: &'a Switch,
    /// The number of the transition taken out of `switch.from`.
    pub transition: usize,
    /// Whether it ended chatter: the motion continues in the sticking regime.
    pub stuck: bool,
    /// When it happens, within its drive period.
    pub phase: f64,
    /// The guard's rate before it.
    pub rate: f64,
    /// Whether the guard only grazed zero, within rounding.
    pub grazing: bool,
    /// Modal coordinates before it.
    pub modal: &'a [Complex],
}

impl SwitchView<'_> {
    /// The regime that it leaves.
    pub fn from(&self) -> &Regime {
        &self.system.regimes()[self.switch.from]
    }

    /// The transition taken.
    pub fn transition(&self) -> &Transition {
        &self.system.transitions()[self.switch.from][self.transition]
    }

    /// The jump of the state; none if it is continuous.
    pub fn reset(&self) -> Option<&Reset> {
        let transition = self.transition();
        if self.stuck {
            transition.sticking.as_ref().map(|sticking| &sticking.reset)
        } else {
            transition.reset.as_ref()
        }
    }

    /// The state before it.
    pub fn state(&self) -> DVector<f64> {
        let mut x = DVector::zeros(self.system.dimension());
        let modal = self.modal.iter().copied();
        let drive = self.system.drive();
        self.from()
            .to_state(drive, modal, self.phase, x.as_mut_slice());
        x
    }

    /// The saltation matrix at the state `x` before it.
    pub fn saltation(&self, x: &DVector<f64>) -> DMatrix<f64> {
        let (from, transition) = (self.switch.from, self.transition);
        self.system
            .saltation(from, transition, self.stuck, x, self.phase)
    }
}

/// An observer of a flow: a recorder, a Jacobian, a sensitivity.
pub trait Observer {
    /// Whether it observes nothing, so that nothing need be prepared for it.
    const IDLE: bool = false;
    /// A stretch within one regime was completed.
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let _ = segment;
    }
    /// A switch happened.
    fn switch(&mut self, switch: &SwitchView<'_>) {
        let _ = switch;
    }
    /// A drive period was completed; the phase is zero again.
    fn period_end(&mut self) {}
}

impl Observer for () {
    const IDLE: bool = true;
}

impl<A: Observer, B: Observer> Observer for (&mut A, &mut B) {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        self.0.segment(segment);
        self.1.segment(segment);
    }
    fn switch(&mut self, switch: &SwitchView<'_>) {
        self.0.switch(switch);
        self.1.switch(switch);
    }
    fn period_end(&mut self) {
        self.0.period_end();
        self.1.period_end();
    }
}
