//! Nonlinear force laws from the case file to the observables.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod averaging;
mod census;
mod common;
mod derivatives;
mod frequency_modulation;
mod grazing;
mod memory;
mod permanent_contact;
mod prony;
mod reference;
mod refusals;
mod studies;
mod table;
