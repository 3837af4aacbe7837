//! Errors in building or running a flow.

use thiserror::Error;

/// An error in building or running a flow under a nonlinear force.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum VolterraError {
    /// Sizes of matrices, vectors or lists do not fit together.
    #[error("{what} has {found} entries where {expected} are needed")]
    Shape {
        /// Description of the object whose size is wrong.
        what: &'static str,
        /// Size found: a number of entries, rows or columns.
        found: usize,
        /// Size that fits.
        expected: usize,
    },
    /// A size or count is beyond its limit.
    #[error("{what} is {found}, beyond the limit of {limit}")]
    TooLarge {
        /// Description of the items counted.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Largest number allowed.
        limit: usize,
    },
    /// A number is not finite or lies outside its range.
    #[error("{what} must be {needed}, got {found}")]
    Value {
        /// Description of the quantity.
        what: String,
        /// Value found, in the unit of the quantity; NaN if a required value is missing.
        found: f64,
        /// Description of the values allowed.
        needed: &'static str,
    },
    /// The matrix of the modes has no basis of invariant lines and planes that double
    /// precision can carry.
    #[error(
        "the modes' invariant subspaces rebuild their matrix only to {residual:.1e}: three or \
         more eigenvalues (nearly) coincide, so move the parameters"
    )]
    IllConditioned {
        /// Relative residual of the best basis found, dimensionless.
        residual: f64,
    },
    /// An undamped mode is driven at its own frequency: the linear response is unbounded.
    #[error(
        "the drive at angular frequency {frequency} meets an undamped mode; without the \
         nonlinear force the response grows without bound, so add damping or move the frequency"
    )]
    Resonance {
        /// Angular frequency of the tone, in radians per unit of time (0: the constant force).
        frequency: f64,
    },
    /// The force would change the gap's rate instantly, without inertia between them.
    #[error("the force changes the gap's rate at once: the gap must be a displacement")]
    Inertialess,
    /// The table of laws contains no law of that name.
    #[error("there is no law called {name:?}")]
    UnknownLaw {
        /// Name that was looked up.
        name: String,
    },
    /// Two laws that must not be added.
    #[error("{first} and {second} cannot be added: {reason}")]
    Sum {
        /// Name of the first law of the pair.
        first: &'static str,
        /// Name of the second law of the pair.
        second: &'static str,
        /// Reason why their sum would be wrong.
        reason: &'static str,
    },
    /// The approximate flow does not support a surface that relaxes.
    #[error("the approximate flow does not follow a surface that relaxes")]
    Relaxing,
    /// A force that is written as a formula is wrong.
    #[error("{0}")]
    Formula(#[from] nanotap_formula::FormulaError),
    /// Invalid Maxwell arms.
    #[error("arm {arm} of the relaxing sample: {reason}")]
    Arms {
        /// Number of the invalid arm, counted from 1.
        arm: usize,
        /// Description of what is wrong with this arm.
        reason: &'static str,
    },
    /// The modulus of the solid relaxes to zero.
    #[error(
        "the sample relaxes to nothing: give it a modulus at rest above zero, or a horizon beyond \
         which its slower arms count as elastic"
    )]
    Flows,
    /// The rows of a table do not define a force as a function of the gap.
    #[error("row {row} of the force table: {reason}")]
    Table {
        /// Number of the invalid row, counted from 1.
        row: usize,
        /// Description of what is wrong with this row.
        reason: &'static str,
    },
    /// The work was cancelled from outside.
    #[error("stopped from outside")]
    Cancelled,
    /// The motion left the range of double precision.
    #[error("the motion grew beyond the range of double precision at time {time}")]
    Diverged {
        /// Time at which the motion diverged, in the system's unit of time; in the approximate flow
        /// from the start of the drive period.
        time: f64,
    },
    /// No step, however short, could be certified.
    #[error("no step from time {time} (gap {gap:.3e}) could be certified: {reason}")]
    Uncertified {
        /// Time at which the refused step starts, in the system's unit of time; in the approximate
        /// flow from the start of the drive period.
        time: f64,
        /// Gap at that time, in the unit of the gap.
        gap: f64,
        /// Reason why the last attempt was refused.
        reason: Refusal,
    },
    /// The run needs more steps than are allowed.
    #[error(
        "the limit of {steps} steps was reached at time {time}: the drive's period is too long for the \
         oscillations of the modes in it, or the force changes too fast for them, as under a damping that \
         grows without bound in the contact (`exponential-damping`: a larger `decay_length` or a smaller \
         `damping`)"
    )]
    TooManySteps {
        /// Number of steps taken.
        steps: usize,
        /// Time reached, in the system's unit of time; in the approximate flow from the start of
        /// the drive period.
        time: f64,
    },
    /// The law switched endlessly at one instant.
    #[error("the law switches without end at time {time} (gap {gap:.3e})")]
    Accumulation {
        /// Time of the switches, in the system's unit of time; in the approximate flow from the
        /// start of the drive period.
        time: f64,
        /// Gap at that time, in the unit of the gap.
        gap: f64,
    },
}

/// The reason why a step was not accepted.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Refusal {
    /// Newton's iteration for the forces did not converge.
    #[error("Newton's iteration for the forces does not converge")]
    Newton,
    /// The force's Chebyshev series does not decay, or it disagrees with the law between the nodes.
    #[error("the force is not resolved by the step's polynomial")]
    Unresolved,
    /// The force could amplify an error by more than the error bound allows.
    #[error("the force is so steep that another solution may lie close by")]
    Steep,
    /// A guard is too close to zero to decide whether the law switches.
    #[error("the law's switch cannot be bracketed")]
    Switch,
    /// The gap is at or behind a pole of the force.
    #[error("the gap is at or behind the surface, where the law does not hold")]
    Wall,
}
