//! Experiments against closed forms, invariants and independent methods.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod approach;
mod bimodal;
mod branches;
mod extremes;
mod fit;
mod force_curve_fit;
mod identities;
mod levers;
mod measured_modes;
mod modes_that_matter;
mod noise;
mod physical_quantities;
mod reconstruct;
mod requests;
mod setpoint;
mod tones;
mod units;
mod upset;
