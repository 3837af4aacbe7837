//! The motions of a case: what repeats, is it stable, where does it begin and end.
//!
//! [`simulate`] follows one motion; [`orbit`] closes one; [`attractors`] takes a census of all;
//! [`branch`] and [`approach`] follow orbits while a quantity varies; [`setpoint`] solves for the
//! distance that a feedback would hold; [`upset`] finds the smallest knock to another motion.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod approach;
pub mod attractors;
pub mod branch;
pub mod branch_frames;
pub mod event;
pub mod figure;
pub mod frequency_modulation;
pub mod initial_state;
pub mod lyapunov;
pub mod map;
pub mod orbit;
pub mod proof;
pub mod setpoint;
pub mod short_run;
pub mod simulate;
pub mod upset;

pub use map::Map;
