//! Views of a running flow: stretches within a regime, switches, ends of periods.

use nalgebra::{DMatrix, DVector};

use crate::Complex;
use crate::regime::{ModalOutput, Regime};
use crate::signal::Signal;
use crate::simd::ComplexVector;
use crate::system::{Reset, Switch, System, Transition};

/// A stretch within one regime and one drive period.
#[derive(Clone, Copy, Debug)]
pub struct SegmentView<'a> {
    /// System whose motion is observed.
    pub system: &'a System,
    /// Number of the regime, from 0.
    pub regime: usize,
    /// Time of its start within its drive period, `0 ≤ phase < T`, in the system's unit of time.
    pub phase: f64,
    /// Length in time, in the system's unit of time; the stretch lies within one drive period.
    pub length: f64,
    /// Modal coordinates at its start, of length `m`.
    pub modal: &'a [Complex],
    /// Factors `e^{λ_k · length}` of the modal coordinates, of length `m`.
    pub factors: &'a [Complex],
    /// Modal coordinates and the tones' phasors at its start, and the factors by which the stretch
    /// multiplies them.
    pub(crate) packed: &'a [ComplexVector],
    pub(crate) turns: &'a [ComplexVector],
}

impl SegmentView<'_> {
    /// Returns the regime of the stretch.
    pub fn regime(&self) -> &Regime {
        &self.system.regimes()[self.regime]
    }

    /// Returns an output over the stretch as a signal.
    pub fn signal(&self, output: &ModalOutput) -> Signal {
        let drive = self.system.drive();
        let (regime, modal) = (self.regime(), self.modal);
        Signal::of(regime, drive, output, modal, self.phase, self.length)
    }
}

/// A switch from one regime to another.
#[derive(Clone, Copy, Debug)]
pub struct SwitchView<'a> {
    /// System whose motion is observed.
    pub system: &'a System,
    /// Change of modal coordinates at the switch.
    pub switch: &'a Switch,
    /// Number of the transition, among those out of `switch.from`.
    pub transition: usize,
    /// Whether the switch ended chatter: the motion continues in the sticking regime.
    pub stuck: bool,
    /// Time of the switch within its drive period, in the system's unit of time.
    pub phase: f64,
    /// Rate of the guard before the switch, at most 0, in units of the guard per unit of time.
    pub rate: f64,
    /// Whether the guard only grazed zero, within rounding.
    pub grazing: bool,
    /// Modal coordinates before the switch, in the regime that it leaves.
    pub modal: &'a [Complex],
}

impl SwitchView<'_> {
    /// Returns the regime that the switch leaves.
    pub fn from(&self) -> &Regime {
        &self.system.regimes()[self.switch.from]
    }

    /// Returns the transition that was taken.
    pub fn transition(&self) -> &Transition {
        &self.system.transitions()[self.switch.from][self.transition]
    }

    /// Returns the jump of the state; `None` if it is continuous.
    pub fn reset(&self) -> Option<&Reset> {
        let transition = self.transition();
        if self.stuck {
            transition.sticking.as_ref().map(|sticking| &sticking.reset)
        } else {
            transition.reset.as_ref()
        }
    }

    /// Returns the state before the switch, of length `n`.
    pub fn state(&self) -> DVector<f64> {
        let mut x = DVector::zeros(self.system.dimension());
        let modal = self.modal.iter().copied();
        let drive = self.system.drive();
        self.from()
            .to_state(drive, modal, self.phase, x.as_mut_slice());
        x
    }

    /// Returns the saltation matrix (`n × n`) at the state `x` before the switch.
    pub fn saltation(&self, x: &DVector<f64>) -> DMatrix<f64> {
        let (from, transition) = (self.switch.from, self.transition);
        self.system
            .saltation(from, transition, self.stuck, x, self.phase)
    }
}

/// An observer of a flow, such as a recorder, a Jacobian or a sensitivity.
pub trait Observer {
    /// Whether it ignores everything, so that the flow prepares nothing for it.
    const IDLE: bool = false;
    /// Called after each stretch within one regime.
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let _ = segment;
    }
    /// Called at each switch from one regime to another.
    fn switch(&mut self, switch: &SwitchView<'_>) {
        let _ = switch;
    }
    /// Called after each drive period; the phase is zero again.
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
