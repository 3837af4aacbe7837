//! Experiments against closed forms, invariants and independent methods.

mod approach;
mod branches;
mod extremes;
mod fit;
mod identities;
mod modes_that_matter;
mod physical_quantities;
mod setpoint;
