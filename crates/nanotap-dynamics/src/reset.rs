//! Motions that lose the memory of their past: they come to one known state, from which all of them
//! go on alike.

use crate::orbit::PeriodicOrbit;

/// The motion that follows a reset, the same after every one.
#[derive(Clone, Debug)]
pub enum AfterReset {
    /// It is reset again, and so repeats exactly from then on: on a superstable orbit, all multipliers of
    /// which are zero.
    Closes(PeriodicOrbit),
    /// It is not known to be reset again.
    Open {
        /// Its first state at drive phase 0 after the reset, in units of the state.
        state: Vec<f64>,
        /// Why a motion that is reset again in the precision of the map is left undecided.
        is_reset_again: String,
        /// Why a motion that is not, and does not come to an orbit or a torus, is left undecided.
        is_not_reset_again: String,
    },
}

impl AfterReset {
    /// Whether all motions that are reset go to this orbit.
    pub fn closes(&self, orbit: &PeriodicOrbit) -> bool {
        matches!(self, Self::Closes(own) if own.is_same_as(orbit))
    }
}
