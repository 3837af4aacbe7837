//! Why a motion was given no name.

use crate::failure::MapFailure;
use crate::orbit::PeriodicOrbit;

/// The reason why a motion was left undecided.
#[derive(Clone, Debug, thiserror::Error)]
pub enum UndecidedReason {
    /// The start does not fit the map.
    #[error("bad start: {0}")]
    BadStart(String),
    /// The map failed during the run.
    #[error("after {periods} periods: {failure}")]
    Map {
        /// Drive periods run before the failure.
        periods: usize,
        /// The failure of the map.
        failure: MapFailure,
    },
    /// The run stays on an orbit that does not attract.
    #[error(
        "the run sits on a period-{} orbit that does not attract (largest |multiplier| {:.9})",
        .0.period, .0.spectral_radius()
    )]
    OnOrbitThatDoesNotAttract(Box<PeriodicOrbit>),
    /// The motion repeats, but the orbit is not isolated.
    #[error(
        "the motion repeats after {period} periods (to {closure:.1e}), but the orbit is not isolated"
    )]
    NotIsolated {
        /// Period after which it repeats, in drive periods.
        period: usize,
        /// Largest distance between two recent states one period apart, in units of the state.
        closure: f64,
    },
    /// The largest exponent is negative, but no orbit closed.
    #[error(
        "the largest exponent is negative ({exponent:.3e} ± {error:.1e} per period), but no orbit of period up to {max_period} closed"
    )]
    NothingCloses {
        /// Largest Lyapunov exponent, natural logarithm per drive period.
        exponent: f64,
        /// Standard error of the exponent, per drive period.
        error: f64,
        /// Longest period that was tried, in drive periods.
        max_period: usize,
    },
    /// The exponent is zero within errors, but the map contracts volumes, so a torus of one
    /// dimension less than the state is impossible.
    #[error(
        "the largest exponent is zero within errors ({exponent:.3e} ± {error:.1e} per period) and no orbit of period up to {max_period} closed in {observed} periods; it is no torus, for the map shrinks all volumes by e^{contraction:.3e} a period at least"
    )]
    NoTorusHere {
        /// Largest Lyapunov exponent, natural logarithm per drive period.
        exponent: f64,
        /// Standard error of the exponent, per drive period.
        error: f64,
        /// Least contraction of volumes: natural logarithm of the factor by which they shrink per
        /// drive period, at least; positive.
        contraction: f64,
        /// Longest period that was tried, in drive periods.
        max_period: usize,
        /// Drive periods run, the transient included.
        observed: usize,
    },
    /// The exponent is zero within errors, but the map has one variable only, so it has no torus.
    #[error(
        "the largest exponent is zero within errors ({exponent:.3e} ± {error:.1e} per period) and no orbit of period up to {max_period} closed in {observed} periods; it is no torus, for the map has one variable only"
    )]
    NoTorusOnALine {
        /// Largest Lyapunov exponent, natural logarithm per drive period.
        exponent: f64,
        /// Standard error of the exponent, per drive period.
        error: f64,
        /// Longest period that was tried, in drive periods.
        max_period: usize,
        /// Drive periods run, the transient included.
        observed: usize,
    },
    /// The exponent is not clearly positive to the end, and averages do not converge as on a torus.
    #[error(
        "neither a torus nor chaos can be shown: the largest exponent is {exponent:.3e} ± {error:.1e} per period, and Birkhoff averages agree to {digits:.1} digits only"
    )]
    NeitherTorusNorChaos {
        /// Largest Lyapunov exponent, natural logarithm per drive period.
        exponent: f64,
        /// Standard error of the exponent, per drive period.
        error: f64,
        /// Number of decimal digits to which Birkhoff averages of two stretches agree.
        digits: f64,
    },
    /// The motion is reset to one known state, and what follows is not known
    /// ([`AfterReset::Open`](crate::AfterReset::Open)).
    #[error("{0}")]
    Reset(String),
    /// The exact map did not confirm the motion that its coarse map reached.
    #[error(
        "the approximate flow comes to a motion that the exact flow did not confirm from any state tried"
    )]
    NotConfirmed,
    /// The run took the largest number of steps.
    #[error(
        "the run was followed for {periods} periods, up to the budget of {steps} steps of the approximate flow"
    )]
    Budget {
        /// Drive periods run until then.
        periods: usize,
        /// The budget, [`ClassifyOptions::max_steps`](crate::ClassifyOptions::max_steps), in steps
        /// of time integration.
        steps: u64,
    },
    /// The work was cancelled before this start was done.
    #[error("stopped before it was done")]
    Cancelled,
}
