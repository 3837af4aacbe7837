//! The case: what a user states, read from files and words, in dimensionless numbers or in
//! physical quantities, and mapped to the model's parameters.

pub mod document;
pub mod file;
pub mod near_name;
pub mod physical;
pub mod physical_subject;
pub mod subject;
pub mod units;
