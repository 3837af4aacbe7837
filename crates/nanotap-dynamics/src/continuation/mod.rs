//! Branches of periodic orbits in one parameter, stable and unstable, by
//! pseudo-arclength continuation of all strobe points.
//!
//! The arclength is measured in (x_0, λ), scaled by the *present* size of the orbit and the length
//! of the parameter range: through a resonance the orbit grows by a factor of hundreds, and a step
//! of 1 % of its size at the foot would be 0.01 % at the top. A step along the tangent is corrected
//! by Newton in the plane perpendicular to it. It is halved when Newton converges slowly, when the
//! tangent turns by too much, or when the correction is large (another branch); otherwise it is
//! lengthened. The map need only be C¹: at a 3/2-power grazing the tangent is continuous but turns
//! fast, and the step control shortens the steps.
//!
//! Fails with a typed [`BranchEnd`]. The continuation may jump to another branch that comes within
//! one step with nearly the same direction; shorter steps prevent that.

pub mod bifurcation;
mod bifurcation_tasks;
mod criticality;
pub mod diagram;
mod end;
mod follow;
mod orbit_on_branch;
mod period_division;
pub(crate) mod solver;
mod step;
pub mod switching;

use std::fmt;

use crate::control::Control;
use crate::failure::MapFailure;
use crate::map::MapFamily;
use crate::orbit::{PeriodicOrbit, ShootingError};
use follow::{check, follow, solver_for};

pub use bifurcation::{Bifurcation, BifurcationKind};
pub use criticality::Criticality;
pub use diagram::{Diagram, DiagramBranch, DiagramOptions, assemble_diagram};
pub use solver::OrbitTangency;
pub use switching::switch_at_flip;

/// Options of the continuation of a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct ContinuationOptions {
    /// Range of the parameter, lower end first, in units of the parameter.
    pub range: (f64, f64),
    /// First step in scaled arclength (1 is the whole range).
    pub initial_step: f64,
    /// Shortest step in scaled arclength.
    pub min_step: f64,
    /// Longest step in scaled arclength.
    pub max_step: f64,
    /// Largest turn of the tangent over one step, in radians.
    pub max_angle: f64,
    /// Number of points at which the branch is cut.
    pub max_points: usize,
    /// Largest entry of a state inside the domain, in units of the state.
    pub bound: f64,
    /// Unit of the state along the arc, in units of the state. Default: the largest entry of the
    /// present orbit, but at least that of the first orbit.
    pub state_scale: Option<f64>,
    /// Unit of the parameter along the arc, in units of the parameter. Default: the length of the
    /// range.
    pub parameter_scale: Option<f64>,
    /// Residual, in units of the orbit's scale, at which a stalled Newton iteration is accepted.
    /// Set it to the accuracy of the map.
    pub residual_tolerance: f64,
    /// Whether the branch ends at its first orbit that is not stable.
    pub until_unstable: bool,
    /// Whether grazings are located all along the branch; otherwise only before the orbit at which
    /// [`until_unstable`](Self::until_unstable) ends it.
    pub grazings: bool,
    /// Largest multiplier: beyond it the branch ends as [`BranchEnd::Repelling`].
    pub max_multiplier: f64,
}

impl ContinuationOptions {
    /// Default options for a parameter range, whose ends may be in either order.
    pub fn over(from: f64, to: f64) -> Self {
        Self {
            range: (from.min(to), from.max(to)),
            initial_step: 2e-3,
            min_step: 1e-10,
            max_step: 3e-2,
            max_angle: 0.2,
            max_points: 5000,
            bound: 1e8,
            state_scale: None,
            parameter_scale: None,
            residual_tolerance: 1e-10,
            until_unstable: false,
            grazings: true,
            max_multiplier: f64::INFINITY,
        }
    }
}

/// Direction in which a branch is followed from its first orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Towards larger parameter values at the first point.
    Increasing,
    /// Towards smaller parameter values at the first point.
    Decreasing,
}

/// One point of a branch.
#[derive(Clone, Debug)]
pub struct BranchPoint {
    /// Parameter value of the point, in units of the parameter.
    pub parameter: f64,
    /// The orbit at this value, with multipliers and stability.
    pub orbit: PeriodicOrbit,
    /// Scaled arclength from the first point, dimensionless, with the scales of each step.
    pub arclength: f64,
    /// dλ/ds: positive where the branch runs towards larger parameter values.
    pub slope: f64,
    /// Extrema of the switching functions along the orbit.
    pub tangencies: Vec<OrbitTangency>,
}

/// A branch of periodic orbits with one period.
#[derive(Clone, Debug)]
pub struct Branch {
    /// Period of its orbits in drive periods.
    pub period: usize,
    /// Points in order of arclength.
    pub points: Vec<BranchPoint>,
    /// Bifurcations in order of arclength.
    pub bifurcations: Vec<Bifurcation>,
    /// Reason why it ends; [`BranchEnd::is_failure`] distinguishes an end from a cut.
    pub end: BranchEnd,
}

/// The reason why a branch ends.
#[derive(Clone, Debug)]
pub enum BranchEnd {
    /// The parameter reached an end of its range.
    RangeEnd,
    /// The branch returned to its first orbit, at any strobe of it.
    Closed,
    /// The branch met one of shorter period (at a flip of that branch, if the period halves).
    Collapsed {
        /// Period of the other branch in drive periods.
        period: usize,
        /// Parameter value where they meet, extrapolated from the last points; the error is about
        /// the square of the last step. For the exact value follow the other branch, whose flip is
        /// located exactly.
        parameter: f64,
    },
    /// The orbit shrank to a point at an end of the range, where the map is not differentiable: for
    /// example drive amplitude zero with a tip that touches the sample at rest.
    Vanished {
        /// Parameter value where it vanished.
        parameter: f64,
    },
    /// A state exceeded the bound.
    LeftDomain,
    /// The corrector failed at the shortest step.
    StepTooSmall {
        /// Parameter value of the last point.
        parameter: f64,
        /// Reason why the corrector failed, in words.
        reason: String,
    },
    /// An extremum of a switching function reached zero, and the orbit does not exist beyond it (a
    /// hard impact).
    Grazing {
        /// Parameter value of the grazing.
        parameter: f64,
    },
    /// The orbit is no longer stable, and [`ContinuationOptions::until_unstable`] is set. The last
    /// point is the first one that is not stable.
    Unstable {
        /// Last parameter value at which it was stable.
        parameter: f64,
    },
    /// A multiplier exceeded [`ContinuationOptions::max_multiplier`].
    Repelling {
        /// Parameter value of the last point.
        parameter: f64,
    },
    /// The largest number of points was reached.
    PointLimit,
    /// The caller cancelled the computation.
    Cancelled,
}

impl BranchEnd {
    /// Describes the end in words; `shown` formats a parameter value.
    pub fn words(&self, shown: impl Fn(f64) -> String) -> String {
        match self {
            Self::RangeEnd => "the end of the parameter range".into(),
            Self::Closed => "the branch is closed".into(),
            Self::Collapsed { period, parameter } => {
                format!(
                    "the branch meets a branch of period {period} at {}",
                    shown(*parameter)
                )
            }
            Self::Vanished { parameter } => {
                format!("the orbit shrinks to a point at {}", shown(*parameter))
            }
            Self::LeftDomain => "a state left the domain".into(),
            Self::StepTooSmall { parameter, reason } => format!(
                "no further point beyond {} at the shortest step: {reason}",
                shown(*parameter)
            ),
            Self::Grazing { parameter } => {
                format!(
                    "the orbit grazes at {}, where the multipliers of orbits with this contact grow \
                     without bound",
                    shown(*parameter)
                )
            }
            Self::Unstable { parameter } => {
                format!("the orbit is not stable beyond {}", shown(*parameter))
            }
            Self::Repelling { parameter } => format!(
                "the orbit is too unstable to be followed beyond {}",
                shown(*parameter)
            ),
            Self::PointLimit => "the allowed number of points".into(),
            Self::Cancelled => "stopped by the caller".into(),
        }
    }

    /// True if the branch was cut: what lies beyond its last point is unknown.
    pub fn is_failure(&self) -> bool {
        match self {
            Self::RangeEnd
            | Self::Closed
            | Self::Collapsed { .. }
            | Self::Vanished { .. }
            | Self::Unstable { .. }
            | Self::Grazing { .. }
            | Self::Repelling { .. } => false,
            Self::LeftDomain | Self::StepTooSmall { .. } | Self::PointLimit | Self::Cancelled => {
                true
            }
        }
    }
}

impl fmt::Display for BranchEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words(|parameter| parameter.to_string()))
    }
}

/// The reason why a branch could not be started.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ContinuationError {
    /// An option is invalid; the text says why.
    #[error("invalid continuation options: {0}")]
    BadOptions(String),
    /// The given orbit is not an orbit at this parameter value.
    // Callers state the value, in their units.
    #[error("the corrector found no orbit at the first value of the parameter: {reason}")]
    NoStart {
        /// Parameter value of the given orbit.
        parameter: f64,
        /// Reason why the corrector failed, in words.
        reason: String,
    },
    /// The given bifurcation is not a flip.
    #[error("branch switching needs a flip")]
    NotAFlip,
    /// The map failed at the first point.
    #[error(transparent)]
    Map(#[from] MapFailure),
    /// The multipliers of the first orbit could not be computed.
    #[error(transparent)]
    Orbit(#[from] ShootingError),
}

/// Follows the branch through `orbit` at `parameter` in one direction.
///
/// # Errors
/// If the options are invalid or the orbit is not an orbit at this parameter value. Later failures
/// are reported in [`Branch::end`].
pub fn continue_orbit<F: MapFamily>(
    family: &F,
    parameter: f64,
    orbit: &PeriodicOrbit,
    direction: Direction,
    options: &ContinuationOptions,
    control: &Control<'_>,
) -> Result<Branch, ContinuationError> {
    check(options, parameter)?;
    let mut solver = solver_for(family, orbit, options);
    let first = solver
        .at_parameter(&orbit.flat(), parameter, direction == Direction::Increasing)
        .map_err(|e| ContinuationError::NoStart {
            parameter,
            reason: e.to_string(),
        })?;
    follow(&mut solver, first, options, control)
}
