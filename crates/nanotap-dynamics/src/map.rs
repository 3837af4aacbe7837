//! The interface between a system and its analysis: the stroboscopic map `P`, which takes the state
//! at drive phase 0 to the state one drive period later.

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::reset::AfterReset;

/// A local extremum of a switching function along one drive period.
///
/// A motion grazes when one of these values crosses zero: a contact appears or vanishes there, and
/// the map is only once differentiable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangency {
    /// Drive phase of the extremum as a fraction of the period, in `[0, 1)`.
    pub phase: f64,
    /// Value of the switching function, in its own unit; its sign distinguishes contact from a near
    /// miss.
    pub value: f64,
}

/// Success, or the error of a map.
pub type Advanced<M> = Result<(), <M as StroboscopicMap>::Error>;

/// How the evaluations of a map are best arranged: in batches, on several threads, or on a cheaper map.
/// The defaults suit a map that is cheap and takes one state at a time: `impl Scheduling for MyMap {}`.
pub trait Scheduling: Sized {
    /// Whether a period takes so much longer than to wake a thread that the periods of an orbit are
    /// worth computing in parallel.
    fn is_costly(&self) -> bool {
        false
    }

    /// Work done so far, in steps of an approximate flow; 0 where a period is in closed form. A clone
    /// goes on from the same number. Budgets of work are measured by it.
    fn cost(&self) -> u64 {
        0
    }

    /// Adds the cost of work that a clone did for this map.
    fn add_cost(&mut self, cost: u64) {
        let _ = cost;
    }

    /// A cheaper, approximate map of the same state, for following transients; `None` where this
    /// map is cheap itself. Nothing is reported from it.
    fn coarse(&self) -> Option<Self> {
        None
    }

    /// Number of states in a batch of [`advance_each`](Self::advance_each); 1 where it takes them in
    /// sequence.
    fn batch_size(&self) -> usize {
        1
    }

    /// Replaces each of `states` (row by row, of length `dimension`) by `Pᵏ` of it, with `k` from
    /// `periods`, whose length is the number of states. A batch may be faster than
    /// [`advance_by`](StroboscopicMap::advance_by) of each; the result of one state does not depend on the
    /// others, and differs from that by rounding only. A state that cannot be followed is of no
    /// use afterwards.
    fn advance_each(&mut self, states: &mut [f64], periods: &[usize]) -> Vec<Advanced<Self>>
    where
        Self: StroboscopicMap,
    {
        in_sequence(self, states, periods)
    }

    /// As [`advance_each`](Self::advance_each), and puts the states at the ends of all periods of each
    /// state, row by row, into its entry of `passed`, as far as it can be followed.
    fn advance_each_through(
        &mut self,
        states: &mut [f64],
        periods: &[usize],
        passed: &mut [Vec<f64>],
    ) -> Vec<Advanced<Self>>
    where
        Self: StroboscopicMap,
    {
        in_sequence_through(self, states, periods, passed)
    }
}

/// The stroboscopic map of a periodically forced system.
///
/// An implementation owns its work space, hence `&mut self`. A parallel analysis clones the map
/// once per task, so a clone must be cheap (shared, immutable data in an `Arc`). The same state
/// must give the same bits on every clone and in every call.
pub trait StroboscopicMap: Scheduling + Clone + Send + Sync {
    /// Why a period could not be computed.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Returns the number of entries of a state.
    fn dimension(&self) -> usize;

    /// Length of one drive period, in the system's unit of time.
    fn period(&self) -> f64;

    /// Returns the number of trailing entries of the state that are whole numbers set by the map,
    /// such as whether an adhesive neck exists. They jump from orbit to orbit along a branch;
    /// Newton's method takes them from the map.
    fn discrete_entries(&self) -> usize {
        0
    }

    /// Replaces `state` (length `dimension`) by `P(state)`.
    ///
    /// # Errors
    /// When the period cannot be computed from this state.
    fn advance(&mut self, state: &mut [f64]) -> Result<(), Self::Error>;

    /// Replaces `state` by `P^periods(state)`; a flow that need not stop in between may be
    /// faster than [`advance`](Self::advance) over and over.
    ///
    /// # Errors
    /// When a period cannot be computed.
    fn advance_by(&mut self, state: &mut [f64], periods: usize) -> Result<(), Self::Error> {
        (0..periods).try_for_each(|_| self.advance(state))
    }

    /// Replaces `state` by `P(state)` and `jacobian` (`dimension × dimension`)
    /// by `DP(state)`.
    ///
    /// # Errors
    /// When the period cannot be computed from this state.
    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), Self::Error>;

    /// As [`advance_with_jacobian`](Self::advance_with_jacobian), and log|det DP| by other
    /// means than the Jacobian (the trace of the equations, integrated), where the system has
    /// any: exact where the determinant of a matrix drowns in rounding. `None` where it has
    /// none.
    ///
    /// # Errors
    /// When the period cannot be computed from this state.
    fn advance_with_jacobian_and_determinant(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<Option<f64>, Self::Error> {
        self.advance_with_jacobian(state, jacobian)?;
        Ok(None)
    }

    /// An upper bound on log|det DP| over all states, infinite where none is known. A
    /// negative one says that the map shrinks every volume: it has no torus of one
    /// dimension less than the state, and if planar none at all.
    fn log_determinant_bound(&self) -> f64 {
        f64::INFINITY
    }

    /// From now on motions pass through a rigid stop that they hardly touch. Beyond its grazing an
    /// orbit then continues smoothly, as if without contact, so that the grazing can be located and
    /// followed. A map without rigid stops does nothing.
    fn pass_touches(&mut self) {}

    /// Of a state slightly behind a rigid stop, where no motion is: the state of the motion that has
    /// just hit the stop, if this one moves on behind it, or is about to hit it, if this one comes from
    /// there. So an orbit goes on where an impact passes drive phase 0 and its state there jumps.
    fn across_impact(&self, state: &[f64]) -> Option<Vec<f64>> {
        let _ = state;
        None
    }

    /// Returns how often motions of this map have lost the memory of their past so far, as by coming to
    /// rest in one known state: from there all go on alike ([`after_reset`](Self::after_reset)). A clone
    /// goes on from the same number. A map with resets takes one state at a time
    /// ([`batch_size`](Scheduling::batch_size) is 1), so that each belongs to one motion.
    fn resets(&self) -> u64 {
        0
    }

    /// Returns the motion that follows a reset; `None` for a map without resets. It may take long when
    /// it is first called; clones share the result.
    fn after_reset(&self) -> Option<Arc<AfterReset>> {
        None
    }

    /// Appends all local extrema of the switching functions over the period that starts at `state`,
    /// in order of phase, and replaces `state` by `P(state)`. A smooth system leaves `tangencies`
    /// unchanged.
    ///
    /// # Errors
    /// When the period cannot be computed from this state.
    fn advance_with_tangencies(
        &mut self,
        state: &mut [f64],
        tangencies: &mut Vec<Tangency>,
    ) -> Result<(), Self::Error> {
        let _ = tangencies;
        self.advance(state)
    }
}

/// [`Scheduling::advance_each`], one state at a time.
pub fn in_sequence<M: StroboscopicMap>(
    map: &mut M,
    states: &mut [f64],
    periods: &[usize],
) -> Vec<Advanced<M>> {
    let each = states.chunks_exact_mut(map.dimension()).zip(periods);
    each.map(|(state, &periods)| map.advance_by(state, periods))
        .collect()
}

/// [`Scheduling::advance_each_through`], one state at a time.
pub fn in_sequence_through<M: StroboscopicMap>(
    map: &mut M,
    states: &mut [f64],
    periods: &[usize],
    passed: &mut [Vec<f64>],
) -> Vec<Advanced<M>> {
    let each = states.chunks_exact_mut(map.dimension()).zip(periods);
    each.zip(passed)
        .map(|((state, &periods), passed)| {
            passed.clear();
            (0..periods).try_for_each(|_| {
                map.advance(state)?;
                passed.extend_from_slice(state);
                Ok(())
            })
        })
        .collect()
}

/// A one-parameter family of stroboscopic maps, for continuation in one parameter.
pub trait MapFamily: Sync {
    /// The map at one parameter value.
    type Map: StroboscopicMap;
    /// Why there is no map at a parameter value.
    type Error: std::error::Error + Send + Sync + 'static;

    /// The map at `parameter`.
    /// The map at this parameter value.
    /// # Errors
    /// If the system does not exist at this parameter value.
    fn at(&self, parameter: f64) -> Result<Self::Map, Self::Error>;

    /// Replaces `state` by `P(state; parameter)`, `jacobian` by `∂P/∂state` and
    /// `derivative` (length `dimension`) by `∂P/∂parameter`. `map` is `self.at(parameter)`.
    ///
    /// # Errors
    /// When the period cannot be computed from this state.
    fn advance_with_derivatives(
        &self,
        parameter: f64,
        map: &mut Self::Map,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivative: &mut [f64],
    ) -> Result<(), <Self::Map as StroboscopicMap>::Error>;
}

/// A two-parameter family of stroboscopic maps, for continuation of bifurcations.
pub trait TwoParameterFamily: Sync {
    /// The map at one pair of values.
    type Map: StroboscopicMap;
    /// Why there is no map at a pair of values.
    type Error: std::error::Error + Send + Sync + 'static;

    /// The map at a pair of values.
    ///
    /// # Errors
    /// When the values make no sense for the system.
    fn at(&self, first: f64, second: f64) -> Result<Self::Map, Self::Error>;

    /// Replaces `state` by `P(state)`, `jacobian` by `∂P/∂state` and the two
    /// derivatives (length `dimension` each) by `∂P/∂first` and `∂P/∂second`. `map`
    /// is `self.at(parameters[0], parameters[1])`.
    ///
    /// # Errors
    /// When the period cannot be computed from this state.
    fn advance_with_derivatives(
        &self,
        parameters: [f64; 2],
        map: &mut Self::Map,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: [&mut [f64]; 2],
    ) -> Result<(), <Self::Map as StroboscopicMap>::Error>;
}
