//! Computer-assisted proofs of periodic orbits of harmonically forced piecewise-linear systems.
//!
//! Between switches such a system moves in closed form. With numbers replaced by intervals
//! that are rounded outwards, an approximate orbit becomes a theorem: an orbit exists near it,
//! it is the only one within a stated distance, it switches at enclosed times and nowhere
//! else, and its multipliers lie in stated discs.
//!
//! In [`interval`] are intervals of real numbers and their elementary functions, in [`system`] the
//! system and its flow, in [`orbit`] existence and uniqueness from Krawczyk's operator, and in
//! [`multipliers`] stability.

// Where a number is none, nothing is proved: `!(a < b)` says so and `a >= b` does not.
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

/// Why an orbit is not proved. It may exist nevertheless.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProofError {
    /// Eigenvalues of a regime meet, as at critical damping.
    #[error("two eigenvalues of regime {regime} are too near to each other to be told apart")]
    Eigenvalues {
        /// The regime.
        regime: usize,
    },
    /// A regime is driven at a resonance without damping.
    #[error("regime {regime} is driven at an undamped resonance")]
    Resonance {
        /// The regime.
        regime: usize,
    },
    /// The test of existence does not contract: no orbit is near, or it is not isolated (at a
    /// fold), or it is too sensitive to rounding.
    #[error("no orbit was isolated near the computed one: none is there, or a fold is near")]
    NoIsolatedOrbit,
    /// A guard could not be shown to keep its sign.
    #[error("flight {flight} may graze {at} after its start: its sign could not be decided there")]
    Grazing {
        /// The number of the flight, from 0.
        flight: usize,
        /// Time since its start.
        at: f64,
    },
    /// It may be a shorter orbit, several times over.
    #[error("its period may be {period} already")]
    ShorterPeriod {
        /// The shorter period.
        period: usize,
    },
    /// More equations than are solved.
    #[error("its switches make {unknowns} equations; at most {limit} are solved")]
    TooLarge {
        /// How many.
        unknowns: usize,
        /// How many at most.
        limit: usize,
    },
    /// The work was cancelled from outside.
    #[error("stopped from outside")]
    Cancelled,
    /// The approximate orbit is no orbit of this system.
    #[error("what was given is no orbit: {what}")]
    Candidate {
        /// What is wrong.
        what: &'static str,
    },
}
