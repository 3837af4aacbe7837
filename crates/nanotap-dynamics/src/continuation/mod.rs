//! Branches of periodic orbits in one parameter, stable and unstable, by
//! pseudo-arclength continuation of all strobe points.
//!
//! The arc is measured in (x_0, λ), scaled by the size of the orbit *as it is now* and
//! the length of the parameter range: through a resonance the orbit grows by a factor of
//! hundreds, and a step that was a per cent of it at the foot would be a hundredth of a
//! per cent at the top. A step along the tangent is corrected by Newton in the plane
//! across it; it is halved when Newton is slow, the tangent turns by too much, or the
//! correction is large (another branch), and lengthened when all is easy. The map
//! need only be C¹: at a 3/2-power grazing the tangent is continuous but turns fast,
//! and the steps shorten by themselves.
//!
//! Fails: with a typed [`BranchEnd`]. A branch may jump to another one that comes
//! within a step of it with nearly the same direction; shorter steps prevent that.

pub mod bifurcation;
pub mod diagram;
mod end;
mod follow;
mod locating;
mod meeting;
mod passing;
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
pub use diagram::{Diagram, DiagramBranch, DiagramOptions, assemble_diagram};
pub use solver::OrbitTangency;
pub use switching::switch_at_flip;

/// How a branch is followed.
#[derive(Clone, Debug, PartialEq)]
pub struct ContinuationOptions {
    /// Range of the parameter, lower end first.
    pub range: (f64, f64),
    /// First step, as a fraction of the scaled arc (1 is the whole range).
    pub initial_step: f64,
    /// Shortest step.
    pub min_step: f64,
    /// Longest step.
    pub max_step: f64,
    /// Largest turn of the tangent over one step, in radians.
    pub max_angle: f64,
    /// Points after which the branch is cut.
    pub max_points: usize,
    /// A state with an entry above this has left the domain.
    pub bound: f64,
    /// Unit of the state along the arc; by default the largest entry of the orbit as it
    /// is now, but not below that of the first.
    pub state_scale: Option<f64>,
    /// Unit of the parameter along the arc; by default the length of the range.
    pub parameter_scale: Option<f64>,
    /// Residual, in units of the orbit's scale, at which a stalled Newton iteration
    /// is accepted: the accuracy of the map.
    pub residual_tolerance: f64,
    /// Whether the branch ends at its first orbit that is not stable.
    pub until_unstable: bool,
    /// Whether grazings are located all along the branch; otherwise only before the orbit at which
    /// [`until_unstable`](Self::until_unstable) ends it.
    pub grazings: bool,
    /// The branch is left where a disturbance grows by more than this in the orbit's period.
    pub max_multiplier: f64,
}

impl ContinuationOptions {
    /// Defaults for a parameter range (in either order).
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

/// Which way to set out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Towards larger parameters.
    Increasing,
    /// Towards smaller parameters.
    Decreasing,
}

/// One point of a branch.
#[derive(Clone, Debug)]
pub struct BranchPoint {
    /// The parameter.
    pub parameter: f64,
    /// The orbit there, with multipliers and stability.
    pub orbit: PeriodicOrbit,
    /// Scaled arclength from the first point.
    pub arclength: f64,
    /// dλ/ds: positive where the branch runs towards larger parameters.
    pub slope: f64,
    /// Extrema of the switching functions along the orbit.
    pub tangencies: Vec<OrbitTangency>,
}

/// A branch of orbits of one period.
#[derive(Clone, Debug)]
pub struct Branch {
    /// Period of its orbits.
    pub period: usize,
    /// Points in order along the arc.
    pub points: Vec<BranchPoint>,
    /// Bifurcations in order along the arc.
    pub bifurcations: Vec<Bifurcation>,
    /// Why it ends; [`BranchEnd::is_failure`] tells whether it should have gone on.
    pub end: BranchEnd,
}

/// Why a branch ends.
#[derive(Clone, Debug)]
pub enum BranchEnd {
    /// The parameter reached an end of its range.
    RangeEnd,
    /// The branch came back to its first orbit, at any strobe of it.
    Closed,
    /// Its period divided: it ran into a branch of shorter period (at a flip of that
    /// branch, if the period halves).
    Collapsed {
        /// Period of the other branch.
        period: usize,
        /// Where they meet, extrapolated from the last points: about as exact as the
        /// square of the last step. Where it matters, follow the other branch, whose
        /// flip is located exactly.
        parameter: f64,
    },
    /// The orbit shrank to a point at an end of the range, where the map is not
    /// differentiable: a drive of amplitude zero on a tip that touches at rest.
    Vanished {
        /// Where.
        parameter: f64,
    },
    /// A state outgrew the bound.
    LeftDomain,
    /// No point was found at the shortest step.
    StepTooSmall {
        /// The last point.
        parameter: f64,
        /// What failed there.
        reason: String,
    },
    /// An extremum of a switching function reached zero and the orbit does not go on
    /// beyond (a hard impact).
    Grazing {
        /// Where.
        parameter: f64,
    },
    /// The orbit is no longer stable, and the branch was to end there. The last point is the
    /// first that is not stable.
    Unstable {
        /// The last parameter at which it was stable.
        parameter: f64,
    },
    /// Its multipliers passed [`ContinuationOptions::max_multiplier`].
    Repelling {
        /// Where.
        parameter: f64,
    },
    /// The allowed number of points was used up.
    PointLimit,
    /// The caller stopped it.
    Cancelled,
}

impl BranchEnd {
    /// In words, a value of the parameter as `shown` writes it.
    pub fn words(&self, shown: impl Fn(f64) -> String) -> String {
        match self {
            Self::RangeEnd => "the end of the parameter range".into(),
            Self::Closed => "the branch is closed".into(),
            Self::Collapsed { period, parameter } => {
                format!(
                    "the branch meets one of period {period} at {}",
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
                "the orbit repels too strongly to be met beyond {}",
                shown(*parameter)
            ),
            Self::PointLimit => "the allowed number of points".into(),
            Self::Cancelled => "stopped by the caller".into(),
        }
    }

    /// True if the branch was cut rather than came to an end: what lies beyond is not
    /// known.
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

/// Why a branch could not be begun.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ContinuationError {
    /// Options that make no sense.
    #[error("bad continuation options: {0}")]
    BadOptions(String),
    /// The orbit given is not one at this parameter.
    #[error("no orbit could be corrected at parameter {parameter}: {reason}")]
    NoStart {
        /// The parameter.
        parameter: f64,
        /// What failed.
        reason: String,
    },
    /// The point given is not of the right kind.
    #[error("branches are switched at flips only")]
    NotAFlip,
    /// The map failed at the first point.
    #[error(transparent)]
    Map(#[from] MapFailure),
    /// The first orbit's multipliers could not be computed.
    #[error(transparent)]
    Orbit(#[from] ShootingError),
}

/// Follows the branch through `orbit` at `parameter` one way.
///
/// # Errors
/// If the options make no sense or the orbit is not one at this parameter; what
/// happens later is told by [`Branch::end`].
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
