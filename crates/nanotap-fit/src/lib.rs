//! Measured curves: what instruments' files hold, calibrations of levers, and parameters that a
//! measurement determines.

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
