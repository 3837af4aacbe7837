//! Computer-assisted proofs of periodic orbits of harmonically forced piecewise-linear systems.
//!
//! Between switches the motion of such a system has a closed form. With intervals, rounded
//! outwards, in place of numbers, an approximate orbit becomes a theorem: an orbit exists near it,
//! it is the only one within a stated distance, it switches at enclosed times and nowhere else, and
//! its multipliers lie in stated discs.
//!
//! [`interval`] has intervals of real numbers and their elementary functions, [`system`] the system
//! and its flow, [`orbit`] existence and uniqueness by Krawczyk's operator, [`multipliers`]
//! stability, and [`sticking`] the orbits that come to rest on a rigid stop.

// With NaN nothing may be proved: `!(a < b)` is then true, while `a >= b` is not.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod complex;
pub mod eigen;
mod flight;
pub mod interval;
pub mod matrix;
pub mod multipliers;
pub mod orbit;
pub mod sticking;
pub mod system;

pub use complex::Rectangle;
pub use interval::Interval;
pub use matrix::Matrix;
pub use multipliers::{Disc, Multipliers, Stability};
pub use orbit::{Candidate, EnclosedSwitch, Isolation, Switch, Theorem, prove};
pub use sticking::{EnclosedRest, RigidStop, prove_sticking};
pub use system::{HarmonicVector, Output, RegimeParts, Reset, System, Transition};

/// The reason why an orbit could not be proved. It may exist nevertheless.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProofError {
    /// Eigenvalues of a regime coincide, as at critical damping.
    #[error("two eigenvalues of regime {regime} are too close to be separated")]
    Eigenvalues {
        /// Index of the regime in the system.
        regime: usize,
    },
    /// A regime is driven at a resonance without damping.
    #[error("regime {regime} is driven at an undamped resonance")]
    Resonance {
        /// Index of the regime in the system.
        regime: usize,
    },
    /// The existence test does not contract: there is no orbit nearby, it is not isolated (at a
    /// fold), or it is too sensitive to rounding.
    #[error(
        "no isolated orbit was found near the computed one: it may not exist, a fold may be near, or errors may \
         grow too fast along it"
    )]
    NoIsolatedOrbit,
    /// A guard could not be shown to keep its sign.
    #[error(
        "flight {flight} may graze at time {at} after its start: the sign of a guard is undecided"
    )]
    Grazing {
        /// Index of the flight, from 0.
        flight: usize,
        /// Time since the start of the flight, in the system's unit.
        at: f64,
    },
    /// The orbit may be a repetition of a shorter one.
    #[error("its minimal period may be {period}")]
    ShorterPeriod {
        /// The shorter period, in drive periods.
        period: usize,
    },
    /// The chatter before a rest could not be enclosed.
    #[error("its impacts could not be shown to end in sticking")]
    NoRest,
    /// The number of equations exceeds the limit.
    #[error("its switches give {unknowns} equations; the limit is {limit}")]
    TooLarge {
        /// Number of equations of the orbit.
        unknowns: usize,
        /// Largest number of equations that is allowed.
        limit: usize,
    },
    /// The computation was cancelled before the proof was finished.
    #[error("cancelled")]
    Cancelled,
    /// The approximate orbit is not an orbit of this system.
    #[error("the candidate is not an orbit: {what}")]
    Candidate {
        /// The condition that the candidate violates.
        what: &'static str,
    },
}
