//! The figures: of each study's report, a description that `nanotap-figures` draws.

pub mod approach;
pub mod attractors;
pub mod basin;
pub mod branch;
pub mod contact;
pub mod contact_laws;
pub mod fit;
pub mod modes;
pub mod motion;
pub mod panels;
pub mod reconstruct;
pub mod shown;
pub mod sweep;
pub mod window;
