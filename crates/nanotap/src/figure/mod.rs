//! The figures: a description of each study's report, which `nanotap-figures` draws.

pub mod approach;
pub mod attractors;
#[cfg(feature = "dataset")]
pub mod basin;
#[cfg(feature = "fm")]
pub mod bimodal;
pub mod branch;
pub mod contact;
pub mod contact_laws;
#[cfg(feature = "fit")]
pub mod fit;
pub mod force_curve;
pub mod modes;
pub mod motion;
pub mod panels;
#[cfg(feature = "fit")]
pub mod reconstruct;
pub mod scan;
pub mod shown;
pub mod study;
#[cfg(feature = "dataset")]
pub mod sweep;
#[cfg(feature = "dataset")]
pub mod window;
