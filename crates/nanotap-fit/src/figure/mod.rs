//! The figures of these studies.

pub mod calibrate;
pub mod files;
pub mod fit;
