//! Several motions of one system at once.
//!
//! The motions do not touch each other, and each is computed by the very same operations as
//! a [`Flow`] alone ([`Flow::run_periods`]), to the last bit. But the work is dealt out in turns: all motions look
//! for their next switch on the lattice, then all evaluate it, then all move on. A single
//! motion waits for one operation after the other; here the processor always has another
//! motion's operations to go on with.

use crate::motion::Pending;
#[cfg(target_arch = "x86_64")]
use crate::pack::Fused;
use crate::pack::{self, Library, Math, Plain};
use crate::{Flow, FlowError, System};
use std::sync::Arc;

/// Motions of one system.
#[derive(Clone, Debug)]
pub struct Ensemble {
    system: Arc<System>,
    lanes: Vec<Lane>,
}

/// One motion and what it is at.
#[derive(Clone, Debug)]
struct Lane {
    flow: Flow,
    pending: Pending,
    reach: f64,
    stalled: u32,
    /// Periods still to run.
    left: usize,
    failure: Option<FlowError>,
}

impl Ensemble {
    /// `size` motions of `system`; start each before running them.
    pub fn new(system: &Arc<System>, size: usize) -> Self {
        let lane = Lane {
            flow: Flow::new(Arc::clone(system)),
            pending: Pending::Settled(None),
            reach: 0.0,
            stalled: 0,
            left: 0,
            failure: None,
        };
        Self {
            system: Arc::clone(system),
            lanes: vec![lane; size],
        }
    }

    /// How many motions there are.
    pub fn len(&self) -> usize {
        self.lanes.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.lanes.is_empty()
    }

    /// Puts motion `i` at state `x` (length `n`) at drive phase 0.
    ///
    /// # Errors
    /// As [`Flow::start`].
    ///
    /// # Panics
    /// When there is no motion `i`.
    pub fn start(&mut self, i: usize, x: &[f64]) -> Result<(), FlowError> {
        let lane = &mut self.lanes[i];
        lane.failure = None;
        lane.flow.start(x, 0.0)
    }

    /// The flow of motion `i`: its state, its regime, its statistics.
    ///
    /// # Panics
    /// When there is no motion `i`.
    pub fn flow(&self, i: usize) -> &Flow {
        &self.lanes[i].flow
    }

    /// Runs every motion over `periods` drive periods. A motion that fails stays where it
    /// failed; the others go on.
    ///
    /// # Errors
    /// Motion and reason of the first that failed, as in [`Flow::run_periods`].
    pub fn run_periods(&mut self, periods: usize) -> Result<(), (usize, FlowError)> {
        for lane in &mut self.lanes {
            lane.left = if lane.failure.is_none() { periods } else { 0 };
        }
        if self.system.largest_angle() > pack::LARGEST_ANGLE {
            self.run::<Library>();
        } else {
            self.run_with_vectors();
        }
        let failed = |(i, lane): (usize, &Lane)| lane.failure.clone().map(|reason| (i, reason));
        self.lanes
            .iter()
            .enumerate()
            .find_map(failed)
            .map_or(Ok(()), Err)
    }

    fn run_with_vectors(&mut self) {
        #[cfg(target_arch = "x86_64")]
        if pack::fused_available() {
            // SAFETY: the machine has these instructions.
            return unsafe { self.run_fused() };
        }
        self.run::<Plain>();
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn run_fused(&mut self) {
        self.run::<Fused>();
    }

    #[inline(always)]
    fn run<M: Math>(&mut self) {
        let system = &*self.system;
        let mut running = true;
        while running {
            for lane in &mut self.lanes {
                lane.look::<M>(system);
            }
            for lane in &mut self.lanes {
                if lane.left > 0 {
                    lane.flow.motion.evaluate::<M>(&mut lane.pending);
                }
            }
            running = false;
            for lane in &mut self.lanes {
                lane.move_on::<M>(system);
                running |= lane.left > 0;
            }
        }
    }
}

impl Lane {
    /// Looks for the next switch as far as the lattice tells.
    #[inline(always)]
    fn look<M: Math>(&mut self, system: &System) {
        if self.left == 0 {
            return;
        }
        self.reach = self.flow.motion.reach_over::<M>(system, self.left);
        match self.flow.motion.prospect::<M>(system, self.reach) {
            Ok(pending) => self.pending = pending,
            Err(reason) => self.fail(reason),
        }
    }

    /// Goes to the switch, or to where the search ended.
    #[inline(always)]
    fn move_on<M: Math>(&mut self, system: &System) {
        if self.left == 0 {
            return;
        }
        let (reach, stalled) = (self.reach, &mut self.stalled);
        let found = self.flow.motion.settle::<M>(system, reach, &self.pending);
        let gone = self
            .flow
            .motion
            .go_over::<M>(system, reach, found, &mut self.left, stalled);
        if let Err(reason) = gone {
            self.fail(reason);
        }
    }

    #[cold]
    fn fail(&mut self, reason: FlowError) {
        self.failure = Some(reason);
        self.left = 0;
    }
}
