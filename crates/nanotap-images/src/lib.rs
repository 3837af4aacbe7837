//! Measured images: the state of the lever at each pixel, the steps that are the lever's and not
//! the surface's, and the corrected heights.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod figure;
pub mod image_states;
