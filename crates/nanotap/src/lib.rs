//! Tapping-mode atomic force microscopy, exactly: beam modes, Galerkin matrices,
//! contact laws, observables and studies.
//!
//! The modules depend on each other in this order: a [`model`] holds the equations; a [`case`] is the
//! user's input and maps to a model; [`observe`] computes the observables of a motion; a
//! [`map`](mod@map) is for your own algorithms; a [`study`] runs and reports; a `figure` shows a
//! report; a `dataset` keeps many motions on disk.
//!
//! Features, all on by default: `dataset` (sweeps, windows and basins), `figures` (SVG, PNG, PDF),
//! `fit`, `fm` (frequency modulation) and `proof` (proofs of orbits). Without them the crate has
//! the engines, the contact laws, the case and the other studies.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]
#![cfg_attr(
    not(all(
        feature = "dataset",
        feature = "figures",
        feature = "fit",
        feature = "fm",
        feature = "proof"
    )),
    allow(
        dead_code,
        unused_imports,
        reason = "some helpers serve only the features that are off"
    )
)]

pub mod case;
#[cfg(feature = "dataset")]
pub mod dataset;
pub mod error;
#[cfg(feature = "figures")]
pub mod figure;
pub mod input;
pub mod map;
pub mod model;
pub mod number;
pub mod observe;
pub mod study;

pub use error::{Error, ErrorKind};
pub use map::Map;
pub use nanotap_dynamics::control;
