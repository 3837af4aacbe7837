//! Why a flow cannot be built or run.

use thiserror::Error;

/// An error in building or running a piecewise-linear flow.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum FlowError {
    /// Sizes of matrices, vectors or tone lists do not fit together.
    #[error("{what} has {found} entries where {expected} are needed")]
    Shape {
        /// Description of the object whose size is wrong.
        what: &'static str,
        /// Size found: a number of entries, rows or columns.
        found: usize,
        /// Size that fits.
        expected: usize,
    },
    /// A number is not finite.
    #[error("{what} holds a value that is not a finite number")]
    NotFinite {
        /// Description of the object that contains it.
        what: &'static str,
    },
    /// The drive's period or a harmonic is invalid.
    #[error("the drive needs a positive, finite period and harmonics of at least 1, got {what}")]
    Drive {
        /// Description of the invalid period or harmonic.
        what: String,
    },
    /// An undamped mode is driven at its own frequency: no bounded response exists.
    #[error(
        "regime {regime}: the drive at angular frequency {frequency} meets an undamped mode at \
         {mode}; the response grows without bound, so add damping or move the frequency"
    )]
    Resonance {
        /// Number of the regime, from 0.
        regime: usize,
        /// Angular frequency of the drive's tone, in radians per unit of time (0 for the constant
        /// force).
        frequency: f64,
        /// Angular frequency of the undamped mode, in radians per unit of time.
        mode: f64,
    },
    /// The eigenbasis of a regime is too ill-conditioned to carry double precision.
    #[error(
        "regime {regime}: the eigenbasis loses {digits} digits even with close eigenvalues \
         grouped; rescale the state or move the parameters"
    )]
    IllConditioned {
        /// Number of the regime, from 0.
        regime: usize,
        /// Number of decimal digits lost, 0 to 16.
        digits: u32,
    },
    /// A mode is too fast, compared with the drive, to be followed over a period.
    #[error(
        "regime {regime}: its fastest mode oscillates {oscillations:.3e} times in one drive \
         period, and at most {limit:.0e} are followed; raise the drive's frequency"
    )]
    TooFast {
        /// Number of the regime, from 0.
        regime: usize,
        /// Number of oscillations of the fastest mode in one drive period.
        oscillations: f64,
        /// Largest number of oscillations per period that is supported.
        limit: f64,
    },
    /// The starting state lies in no regime.
    #[error(
        "the starting state lies in no regime: every regime's transition is already passed there"
    )]
    NoRegime,
    /// The work was cancelled from outside.
    #[error("stopped from outside")]
    Cancelled,
    /// The motion left the range of double precision.
    #[error("the motion grew beyond the range of double precision at time {time}")]
    Diverged {
        /// Time within the drive period, in the system's unit of time.
        time: f64,
    },
    /// Switches accumulate at one instant, and no sticking regime was given.
    #[error(
        "switches accumulate at time {time} (chatter) and the transition names no sticking regime \
         in which the motion could go on"
    )]
    Accumulation {
        /// Time within the drive period, in the system's unit of time.
        time: f64,
    },
    /// A transition names a regime that does not exist.
    #[error("a transition leads to regime {target}, but there are {regimes}")]
    Target {
        /// Number of the regime that the transition names, from 0.
        target: usize,
        /// Number of regimes of the system.
        regimes: usize,
    },
}
