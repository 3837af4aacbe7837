//! The exact flow of a harmonically forced piecewise-linear system.
//!
//! A [`System`] has regimes, each a linear equation `ẋ = A x + f(t)` with a
//! harmonic `f`, and transitions that lead from one regime to another when a guard (a
//! scalar linear in the state, with harmonic terms) falls to zero, optionally
//! through a reset such as a coefficient of restitution. Inside a regime the
//! solution is written down in closed form in the eigenbasis of `A`; nothing is
//! stepped in time, no contact can be missed, and every derivative is exact.
//!
//! - [`regime`]: one linear regime, its spectral basis and its forced response;
//! - [`signal`]: what any linear output is inside a regime, a sum of decaying
//!   complex exponentials; [`search`], [`extrema`] and [`integral`] work on it;
//! - [`system`]: regimes and transitions together, with every switch a precomputed
//!   change of basis; [`flow`] runs it, [`Ensemble`] many motions side by side, [`trajectory`] records it;
//! - [`accumulate`]: exact observables of a motion while it runs, at the price of the motion;
//! - [`jacobian`] and [`sensitivity`]: derivatives with respect to the state and
//!   to any parameter; [`variation`]: of functionals of the motion;
//! - [`fixed_step`]: the Runge–Kutta method that switches on its grid, kept to
//!   show what it does wrong.
//!
//! Nothing here knows of periods, attractors or microscopes.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]
// The inner loop is compiled once for any machine and once inside a function for machines
// with vector registers; only what is inlined there gets their instructions.
#![allow(clippy::inline_always)]

pub mod accumulate;
mod double_double;
pub mod drive;
mod ensemble;
pub mod error;
pub mod extrema;
pub mod fixed_step;
pub mod flow;
mod functional;
pub mod harmonic;
pub mod integral;
pub mod jacobian;
mod motion;
mod observer;
mod prepared_basis;
mod rate;
pub mod regime;
mod relaxation;
pub mod search;
pub mod sensitivity;
pub mod signal;
mod simd;
pub mod spectral;
pub mod system;
pub mod trajectory;
pub mod variation;

/// The vector instructions of the inner loops, in words: results are the same with all, times are
/// not.
pub fn vector_instructions() -> &'static str {
    simd::vector_instructions()
}

/// The complex numbers used throughout.
pub type Complex = nalgebra::Complex<f64>;

pub use drive::Drive;
pub use ensemble::{Ensemble, Stretches};
pub use error::FlowError;
pub use flow::{Flow, Observer};
pub use harmonic::{HarmonicVector, Output};
pub use prepared_basis::PreparedBasis;
pub use regime::Regime;
pub use spectral::SpectralBasis;
pub use system::{Onset, Reset, Sticking, System, Transition};
pub use trajectory::{Event, Trajectory};
