//! Measured curves: what instruments' files hold, parameters that a measurement determines, and forces
//! without a law.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod calibrate;
pub mod figure;
pub mod files;
pub mod fit;
pub mod reconstruct;
