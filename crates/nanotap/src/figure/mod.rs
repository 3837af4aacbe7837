//! The figures: a description of each study's report, which `nanotap-figures` draws.

pub mod approach;
pub mod attractors;
pub mod basin;
pub mod bimodal;
pub mod branch;
pub mod contact;
pub mod contact_laws;
pub mod files;
pub mod fit;
pub mod force_curve;
pub mod modes;
pub mod motion;
pub mod panels;
pub mod reconstruct;
pub mod scan;
pub mod shown;
pub mod sweep;
pub mod window;
