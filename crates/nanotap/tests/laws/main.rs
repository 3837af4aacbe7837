//! Nonlinear force laws from the case file to what is observed.

mod common;
mod derivatives;
mod reference;
mod refusals;
