//! Measured curves and images: what instruments' files hold, calibrations of levers,
//! parameters that a measurement determines, and the states of an image.

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
pub mod image_states;
