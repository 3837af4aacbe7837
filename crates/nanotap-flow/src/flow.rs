//! Running a system: from switch to switch in modal coordinates, one drive period
//! at a time.

use crate::FlowError;
use crate::motion::Motion;
pub use crate::observer::{Observer, SegmentView, SwitchView};
use crate::search::Statistics;
use crate::system::System;
use std::sync::Arc;

/// A motion of a [`System`] with its work space. Cloning shares the system.
#[derive(Clone, Debug)]
pub struct Flow {
    pub(crate) system: Arc<System>,
    pub(crate) motion: Motion,
}

impl Flow {
    /// Creates a flow of `system`; call [`Flow::start`] before running it.
    pub fn new(system: Arc<System>) -> Self {
        Self {
            motion: Motion::new(&system),
            system,
        }
    }

    /// Returns the system whose motion this is.
    pub fn system(&self) -> &Arc<System> {
        &self.system
    }

    /// Returns the system for a change of its constants; a copy if it is shared. Restart the motion
    /// afterwards.
    pub fn system_mut(&mut self) -> &mut System {
        Arc::make_mut(&mut self.system)
    }

    /// Ignores a rigid stop that the motion would leave by itself within a time `longest`. Beyond a
    /// grazing the flow then continues smoothly, as without the stop.
    pub fn pass_touches(&mut self, longest: f64) {
        self.motion.longest_passed_touch = longest;
    }

    /// Returns the cost of the searches for switches so far.
    pub fn statistics(&self) -> Statistics {
        self.motion.statistics
    }

    /// Returns the number of switches since the flow was created.
    pub fn switches(&self) -> u64 {
        self.motion.switches
    }

    /// Returns how often the motion was released from rest on a rigid stop since the flow was created.
    pub fn releases(&self) -> u64 {
        self.motion.releases
    }

    /// Returns the number of the present regime.
    pub fn regime(&self) -> usize {
        self.motion.regime
    }

    /// Returns the time within the drive period, in the system's unit of time.
    pub fn phase(&self) -> f64 {
        self.motion.phase
    }

    /// Sets the motion to state `x` (length `n`) at time `phase` within the period.
    ///
    /// # Errors
    /// If a value is not finite, the length is wrong, or no regime contains the state.
    pub fn start(&mut self, x: &[f64], phase: f64) -> Result<(), FlowError> {
        self.motion.start_checked(&self.system, x, phase)
    }

    /// Writes the state (length `n`) to `x`.
    pub fn state(&self, x: &mut [f64]) {
        self.motion.write_state(&self.system, x);
    }

    /// Runs to the end of the drive period; the phase is then zero.
    ///
    /// # Errors
    /// If the motion diverges, or chatters without a sticking regime to end in.
    pub fn run_period<O: Observer>(&mut self, observer: &mut O) -> Result<(), FlowError> {
        self.motion.run_period(&self.system, observer)
    }

    /// Runs from phase 0 over `periods` drive periods without stopping at the ends of those in
    /// between. A flight that lasts from one period into the next is then a single stretch, so this
    /// is faster than [`Flow::run_period`] and agrees with it up to rounding.
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
