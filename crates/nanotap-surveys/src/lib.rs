//! Studies of many motions, or of a motion's surroundings: over quantities, starts, laws, modes,
//! levers, noise and a second tone.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod basin;
pub mod bimodal;
pub mod contact_laws;
pub mod convergence;
pub mod figure;
pub mod lever;
pub mod mode_share;
pub mod modes;
pub mod noise;
pub mod setpoint_map;
pub mod sweep;
pub mod window;
