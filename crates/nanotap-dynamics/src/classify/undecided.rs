//! Why a motion was given no name.

use crate::failure::MapFailure;
use crate::orbit::PeriodicOrbit;

/// Why a motion was left undecided.
#[derive(Clone, Debug, thiserror::Error)]
pub enum UndecidedReason {
    /// The start does not fit the map.
    #[error("bad start: {0}")]
    BadStart(String),
    /// The map could not be followed.
    #[error("after {periods} periods: {failure}")]
    Map {
        /// Periods run.
        periods: usize,
        /// What failed.
        failure: MapFailure,
    },
    /// The run sits on an orbit that does not attract.
    #[error(
        "the run sits on a period-{} orbit that does not attract (largest |multiplier| {:.9})",
        .0.period, .0.spectral_radius()
    )]
    OnOrbitThatDoesNotAttract(Box<PeriodicOrbit>),
    /// It repeats, but the orbit is not isolated.
    #[error(
        "the motion repeats after {period} periods (to {closure:.1e}), but the orbit is not isolated"
    )]
    NotIsolated {
        /// Period.
        period: usize,
        /// How nearly it repeats.
        closure: f64,
    },
    /// Largest exponent negative, but nothing closed.
    #[error(
        "the largest exponent is negative ({exponent:.3e} ± {error:.1e} per period), but no orbit of period up to {max_period} closed"
    )]
    NothingCloses {
        /// Largest exponent.
        exponent: f64,
        /// Its standard error.
        error: f64,
        /// Longest period tried.
        max_period: usize,
    },
    /// The exponent is zero within errors, but the map has no room for a torus.
    #[error(
        "the largest exponent is zero within errors ({exponent:.3e} ± {error:.1e} per period) and no orbit of period up to {max_period} closed in {observed} periods; it is no torus, for the map shrinks all volumes by e^{contraction:.3e} a period at least"
    )]
    NoTorusHere {
        /// Largest exponent.
        exponent: f64,
        /// Its standard error.
        error: f64,
        /// How fast volumes shrink at least, natural logarithm per period.
        contraction: f64,
        /// Longest period tried.
        max_period: usize,
        /// Periods run.
        observed: usize,
    },
    /// The exponent is zero within errors, but a line holds no closed curve.
    #[error(
        "the largest exponent is zero within errors ({exponent:.3e} ± {error:.1e} per period) and no orbit of period up to {max_period} closed in {observed} periods; it is no torus, for the map has one variable only"
    )]
    NoTorusOnALine {
        /// Largest exponent.
        exponent: f64,
        /// Its standard error.
        error: f64,
        /// Longest period tried.
        max_period: usize,
        /// Periods run.
        observed: usize,
    },
    /// The exponent is not positive beyond doubt to the end, and averages do not converge as on a
    /// torus.
    #[error(
        "neither a torus nor chaos can be shown: the largest exponent is {exponent:.3e} ± {error:.1e} per period, and Birkhoff averages agree to {digits:.1} digits only"
    )]
    NeitherTorusNorChaos {
        /// Largest exponent.
        exponent: f64,
        /// Its standard error.
        error: f64,
        /// Digits of agreement.
        digits: f64,
    },
    /// The map itself does not go where its coarse map goes.
    #[error(
        "the approximate flow comes to a motion that the exact flow did not confirm from any state tried"
    )]
    NotConfirmed,
    /// The budget of steps was spent.
    #[error(
        "the run was followed for {periods} periods, up to the budget of {steps} steps of the approximate flow"
    )]
    Budget {
        /// Periods run.
        periods: usize,
        /// [`ClassifyOptions::max_steps`](crate::ClassifyOptions::max_steps).
        steps: u64,
    },
    /// The work was stopped before this start was done.
    #[error("stopped before it was done")]
    Cancelled,
}
