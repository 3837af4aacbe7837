//! Running a system: from switch to switch in modal coordinates, one drive period
//! at a time.

use crate::motion::Motion;
use crate::regime::Regime;
use crate::search::Statistics;
use crate::simd::ComplexVector;
use crate::system::{Switch, System};
use crate::{Complex, FlowError};
use std::sync::Arc;

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
    /// Whether it ended chatter: the motion goes on in the sticking regime.
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

/// Something that watches a flow: a recorder, a Jacobian, a sensitivity.
pub trait Observer {
    /// Whether it watches nothing, so that nothing need be prepared for it.
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

/// A motion of a [`System`] with its work space. Cloning shares the system.
#[derive(Clone, Debug)]
pub struct Flow {
    pub(crate) system: Arc<System>,
    pub(crate) motion: Motion,
}

impl Flow {
    /// A flow of `system`; call [`Flow::start`] before running it.
    pub fn new(system: Arc<System>) -> Self {
        Self {
            motion: Motion::new(&system),
            system,
        }
    }

    /// The system.
    pub fn system(&self) -> &Arc<System> {
        &self.system
    }

    /// What the searches for switches have cost so far.
    pub fn statistics(&self) -> Statistics {
        self.motion.statistics
    }

    /// Switches so far.
    pub fn switches(&self) -> u64 {
        self.motion.switches
    }

    /// The regime the motion is in.
    pub fn regime(&self) -> usize {
        self.motion.regime
    }

    /// The time within the drive period.
    pub fn phase(&self) -> f64 {
        self.motion.phase
    }

    /// Puts the motion at state `x` (length `n`) and time `phase` within the period.
    ///
    /// # Errors
    /// When a value is not finite, the length is wrong, or no regime holds the state.
    pub fn start(&mut self, x: &[f64], phase: f64) -> Result<(), FlowError> {
        let n = self.system.dimension();
        if x.len() != n {
            return Err(FlowError::Shape {
                what: "the state",
                found: x.len(),
                expected: n,
            });
        }
        if !x.iter().all(|v| v.is_finite()) || !phase.is_finite() {
            return Err(FlowError::NotFinite { what: "the state" });
        }
        self.motion.start(&self.system, x, phase)
    }

    /// Writes the state (length `n`) to `x`.
    pub fn state(&self, x: &mut [f64]) {
        self.motion.write_state(&self.system, x);
    }

    /// Runs to the end of the drive period; the phase is then zero.
    ///
    /// # Errors
    /// When the motion diverges, or chatters with no sticking regime to end in.
    pub fn run_period<O: Observer>(&mut self, observer: &mut O) -> Result<(), FlowError> {
        self.motion.run_period(&self.system, observer)
    }

    /// Runs from phase 0 over `periods` drive periods without stopping at the ends of those
    /// in between: a flight that lasts from one period into the next is one flight, so that
    /// this is faster than [`Flow::run_period`] and agrees with it to rounding.
    ///
    /// # Errors
    /// As [`Flow::run_period`].
    pub fn run_periods(&mut self, periods: usize) -> Result<(), FlowError> {
        self.motion.run_periods(&self.system, periods)
    }

    /// Runs to time `end` within the same drive period.
    ///
    /// # Errors
    /// As [`Flow::run_period`].
    pub fn run_until<O: Observer>(&mut self, end: f64, observer: &mut O) -> Result<(), FlowError> {
        self.motion.run_until(&self.system, end, observer)
    }
}
