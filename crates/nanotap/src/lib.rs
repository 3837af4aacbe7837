//! Tapping-mode atomic force microscopy, exactly: beam modes, Galerkin matrices,
//! contact laws, observables and studies.
//!
//! The modules depend on each other in this order: a [`model`] holds the equations; a [`case`] is the
//! user's input and maps to a model; [`observe`] computes the observables of a motion; a
//! [`map`](mod@map) is for your own algorithms; a [`study`] runs and reports; a [`figure`] shows a
//! report; a [`dataset`] keeps many motions on disk.

pub mod figure;
pub mod study;

pub use nanotap_case::{self as case, input};
pub use nanotap_dataset as dataset;
pub use nanotap_dynamics::control;
pub use nanotap_error::{self as error, Error, ErrorKind};
pub use nanotap_fit::files;
pub use nanotap_model as model;
pub use nanotap_motions::{Map, map};
pub use nanotap_observe::{self as observe, frame};
pub use nanotap_quantity::number;
