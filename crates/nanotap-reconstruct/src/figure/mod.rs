//! The figure of a recovered force.

pub mod reconstruct;
