//! The figures of these studies.

pub mod approach;
pub mod attractors;
pub mod branch;
pub mod contact;
pub mod motion;
pub mod panels;
pub mod plotted_quantity;
