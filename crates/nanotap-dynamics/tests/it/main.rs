//! All methods on systems with known answers.
#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]
#![allow(missing_docs)]

mod systems;

mod branching;
mod circling;
mod classifying;
mod closing;
mod confirming;
mod counting;
mod exponents;
mod properties;
mod resetting;
mod slicing;
mod spreading;
mod tracing;
