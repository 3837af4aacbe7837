//! Why a flow cannot be built or run.

use thiserror::Error;

/// What can go wrong in building or running a flow under a nonlinear force.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum VolterraError {
    /// Sizes of matrices, vectors or lists do not fit together.
    #[error("{what} has {found} entries where {expected} are needed")]
    Shape {
        /// The thing whose size is wrong.
        what: &'static str,
        /// Its size.
        found: usize,
        /// The size that would fit.
        expected: usize,
    },
    /// A size or count is beyond its limit.
    #[error("{what} is {found}, beyond the limit of {limit}")]
    TooLarge {
        /// The thing counted.
        what: &'static str,
        /// How many.
        found: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A number is not finite or lies outside the range in which it makes sense.
    #[error("{what} must be {needed}, got {found}")]
    Value {
        /// The quantity.
        what: String,
        /// Its value.
        found: f64,
        /// What would do.
        needed: &'static str,
    },
    /// The matrix of the modes has no basis of invariant lines and planes that double
    /// precision can carry.
    #[error(
        "the modes' invariant subspaces rebuild their matrix only to {residual:.1e}: three or \
         more eigenvalues (nearly) coincide, so move the parameters"
    )]
    IllConditioned {
        /// Relative residual of the best basis found.
        residual: f64,
    },
    /// An undamped mode is driven at its own frequency: the linear response is unbounded.
    #[error(
        "the drive at angular frequency {frequency} meets an undamped mode; without the \
         nonlinear force the response grows without bound, so add damping or move the frequency"
    )]
    Resonance {
        /// Angular frequency of the tone (0: the constant force).
        frequency: f64,
    },
    /// The force would act on the gap's rate without inertia in between.
    #[error("the force changes the gap's rate at once: the gap must be a displacement")]
    Inertialess,
    /// No law of that name.
    #[error("there is no law called {name:?}")]
    UnknownLaw {
        /// The name given.
        name: String,
    },
    /// Laws that must not be added.
    #[error("{first} and {second} cannot be added: {reason}")]
    Sum {
        /// One law.
        first: &'static str,
        /// The other.
        second: &'static str,
        /// Why not.
        reason: &'static str,
    },
    /// The approximate flow has no surface that relaxes.
    #[error("the approximate flow does not follow a surface that relaxes")]
    Relaxing,
    /// Maxwell arms that make no sense.
    #[error("arm {arm} of the relaxing sample: {reason}")]
    Arms {
        /// Counted from 1.
        arm: usize,
        /// What is wrong there.
        reason: &'static str,
    },
    /// A solid without a modulus at rest.
    #[error(
        "the sample relaxes to nothing: give it a modulus at rest above zero, or a horizon beyond \
         which its slower arms count as elastic"
    )]
    Flows,
    /// A table of a force is no function.
    #[error("row {row} of the force table: {reason}")]
    Table {
        /// Counted from 1.
        row: usize,
        /// What is wrong there.
        reason: &'static str,
    },
    /// The work was cancelled from outside.
    #[error("stopped from outside")]
    Cancelled,
    /// The motion left the range of double precision.
    #[error("the motion grew beyond the range of double precision at time {time}")]
    Diverged {
        /// When.
        time: f64,
    },
    /// No step however short could be certified.
    #[error("no step from time {time} (gap {gap}) could be certified: {reason}")]
    Uncertified {
        /// When.
        time: f64,
        /// The gap there.
        gap: f64,
        /// What the last attempt failed by.
        reason: Refusal,
    },
    /// More steps were needed than are allowed.
    #[error(
        "the limit of {steps} steps was reached at time {time}: the force changes too fast for the \
         modes, as under a damping that grows without bound in the contact: with \
         `exponential-damping` raise `decay_length` or lower `damping`"
    )]
    TooManySteps {
        /// The steps taken.
        steps: usize,
        /// The time reached.
        time: f64,
    },
    /// The law switched again and again at one instant.
    #[error("the law switches without end at time {time} (gap {gap})")]
    Accumulation {
        /// When.
        time: f64,
        /// The gap there.
        gap: f64,
    },
}

/// Why a step was not accepted.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Refusal {
    /// Newton's iteration for the forces did not converge.
    #[error("Newton's iteration for the forces does not converge")]
    Newton,
    /// The force's Chebyshev series does not fall off, or it disagrees with the law between
    /// the nodes.
    #[error("the force is not resolved by the step's polynomial")]
    Unresolved,
    /// The force could amplify an error beyond what the defect allows for.
    #[error("the force is so steep that another solution may lie close by")]
    Steep,
    /// A guard is too close to zero to decide whether the law switches.
    #[error("the law's switch cannot be bracketed")]
    Switch,
}
