//! Computer-assisted proofs of periodic orbits of harmonically forced piecewise-linear systems.
//!
//! Between switches the motion of such a system has a closed form. With intervals, rounded
//! outwards, in place of numbers, an approximate orbit becomes a theorem: an orbit exists near it,
//! it is the only one within a stated distance, it switches at enclosed times and nowhere else, and
//! its multipliers lie in stated discs.
//!
//! [`interval`] has intervals of real numbers and their elementary functions, [`system`] the system
//! and its flow, [`orbit`] existence and uniqueness by Krawczyk's operator, and [`multipliers`]
//! stability.

// With NaN nothing may be proved: `!(a < b)` is true then, and `a >= b` is not.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod complex;
pub mod eigen;
mod flight;
pub mod interval;
pub mod matrix;
pub mod multipliers;
pub mod orbit;
pub mod system;

pub use complex::Rectangle;
pub use interval::Interval;
pub use matrix::Matrix;
pub use multipliers::{Disc, Multipliers, Stability};
pub use orbit::{Alone, Candidate, EnclosedSwitch, Switch, Theorem, prove};
pub use system::{HarmonicVector, Output, RegimeParts, Reset, System, Transition};

/// Why an orbit could not be proved. It may exist nevertheless.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProofError {
    /// Eigenvalues of a regime coincide, as at critical damping.
    #[error("two eigenvalues of regime {regime} are too near to each other to be told apart")]
    Eigenvalues {
        /// Index of the regime.
        regime: usize,
    },
    /// A regime is driven at a resonance without damping.
    #[error("regime {regime} is driven at an undamped resonance")]
    Resonance {
        /// Index of the regime.
        regime: usize,
    },
    /// The test of existence does not contract: no orbit is near, it is not isolated (at a fold),
    /// or it is too sensitive to rounding.
    #[error("no orbit was isolated near the computed one: none is there, or a fold is near")]
    NoIsolatedOrbit,
    /// A guard could not be shown to keep its sign.
    #[error("flight {flight} may graze {at} after its start: its sign could not be decided there")]
    Grazing {
        /// Index of the flight, from 0.
        flight: usize,
        /// Time since the start of the flight.
        at: f64,
    },
    /// The orbit may be several repetitions of a shorter one.
    #[error("its period may be {period} already")]
    ShorterPeriod {
        /// The shorter period, in drive periods.
        period: usize,
    },
    /// The number of equations exceeds the limit.
    #[error("its switches make {unknowns} equations; at most {limit} are solved")]
    TooLarge {
        /// Number of equations.
        unknowns: usize,
        /// Largest number of equations.
        limit: usize,
    },
    /// The work was cancelled from outside.
    #[error("stopped from outside")]
    Cancelled,
    /// The approximate orbit is not an orbit of this system.
    #[error("what was given is no orbit: {what}")]
    Candidate {
        /// Reason.
        what: &'static str,
    },
}
