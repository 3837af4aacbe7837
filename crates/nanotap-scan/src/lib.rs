//! Studies in which the lever moves over or towards the sample: images under feedback and force
//! curves.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod figure;
pub mod force_curve;
pub mod moving_lever;
pub mod moving_sample;
pub mod scan;
