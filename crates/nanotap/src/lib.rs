//! Tapping-mode atomic force microscopy, exactly: beam modes, Galerkin matrices,
//! contact laws, observables and experiments.

pub mod beam;
pub mod case;
pub mod case_file;
pub mod exact_beam;
pub mod galerkin;
pub mod parameter;
pub mod physical;
pub mod spectrum;
