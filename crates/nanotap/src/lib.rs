//! Tapping-mode atomic force microscopy, exactly: beam modes, Galerkin matrices,
//! contact laws, observables and studies.
//!
//! The modules depend on each other in this order: a [`model`] holds the equations; a [`case`] is the
//! user's input and maps to a model; [`observe`] computes the observables of a motion; a
//! [`map`](mod@map) is for your own algorithms; a [`study`] runs and reports; a [`figure`] shows a
//! report; a [`dataset`] keeps many motions on disk.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod case;
pub mod dataset;
pub mod error;
pub mod figure;
pub mod files;
pub mod frame;
pub mod input;
pub mod map;
pub mod model;
pub mod number;
pub mod observe;
pub mod study;

pub use error::{Error, ErrorKind};
pub use map::Map;
pub use nanotap_dynamics::control;
