//! The figures of these studies.

pub mod force_curve;
pub mod scan;
