//! The figures of these studies.

pub mod files;
pub mod fit;
pub mod reconstruct;
