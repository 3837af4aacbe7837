//! Branches of periodic orbits in one parameter, stable and unstable, by
//! pseudo-arclength continuation of all strobe points.
//!
//! The arc is measured in (x_0, λ), scaled by the orbit's size and the length of the
//! parameter range. A step along the tangent is corrected by Newton in the plane
//! across it; it is halved when Newton is slow, the tangent turns by too much, or the
//! correction is large (another branch), and lengthened when all is easy. The map
//! need only be C¹: at a 3/2-power grazing the tangent is continuous but turns fast,
//! and the steps shorten by themselves.
//!
//! Fails: with a typed [`BranchEnd`]. A branch may jump to another one that comes
//! within a step of it with nearly the same direction; shorter steps prevent that.

use crate::bifurcation::{Bifurcation, BifurcationKind, Tests, between, collapse};
use crate::branch_solver::{BranchSolver, CorrectorFailure, Node, OrbitTangency};
use crate::control::Control;
use crate::failure::MapFailure;
use crate::map::MapFamily;
use crate::orbit::PeriodicOrbit;
use crate::shooting::ShootingError;
use crate::vector::{distance, norm};

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
    /// Unit of the state along the arc; by default the largest entry of the first
    /// orbit.
    pub state_scale: Option<f64>,
    /// Unit of the parameter along the arc; by default the length of the range.
    pub parameter_scale: Option<f64>,
    /// Residual, in units of the orbit's scale, at which a stalled Newton iteration
    /// is accepted: the accuracy of the map.
    pub residual_tolerance: f64,
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
    /// Why it ends.
    pub end: BranchEnd,
}

/// Why a branch ends.
#[derive(Clone, Debug, thiserror::Error)]
pub enum BranchEnd {
    /// The parameter reached an end of its range.
    #[error("the end of the parameter range")]
    RangeEnd,
    /// The branch came back to its first point.
    #[error("the branch is closed")]
    Closed,
    /// Its period divided: it ran into a branch of shorter period (at a flip of that
    /// branch, if the period halves).
    #[error("the branch meets one of period {period} at {parameter}")]
    Collapsed {
        /// Period of the other branch.
        period: usize,
        /// Where they meet, extrapolated from the last points: about as exact as the
        /// square of the last step. Where it matters, follow the other branch, whose
        /// flip is located exactly.
        parameter: f64,
    },
    /// A state outgrew the bound.
    #[error("a state left the domain")]
    LeftDomain,
    /// No point was found at the shortest step.
    #[error("no further point at the shortest step: {reason}")]
    StepTooSmall {
        /// What failed there.
        reason: String,
    },
    /// An extremum of a switching function reached zero and the orbit does not go on
    /// beyond (a hard impact).
    #[error("the orbit ends where it grazes, at {parameter}")]
    Grazing {
        /// Where.
        parameter: f64,
    },
    /// The allowed number of points was used up.
    #[error("the allowed number of points")]
    PointLimit,
    /// The caller stopped it.
    #[error("stopped by the caller")]
    Cancelled,
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

pub(crate) fn solver_for<'a, F: MapFamily>(
    family: &'a F,
    orbit: &PeriodicOrbit,
    options: &ContinuationOptions,
) -> BranchSolver<'a, F> {
    let size = orbit.scale();
    let default = if size > 0.0 { size } else { 1.0 };
    BranchSolver::new(
        family,
        orbit.dimension(),
        orbit.period,
        options.state_scale.unwrap_or(default),
        options
            .parameter_scale
            .unwrap_or(options.range.1 - options.range.0),
        options.residual_tolerance,
    )
}

pub(crate) fn check(
    options: &ContinuationOptions,
    parameter: f64,
) -> Result<(), ContinuationError> {
    let bad = |reason: String| Err(ContinuationError::BadOptions(reason));
    let (low, high) = options.range;
    if !(low < high && (high - low).is_finite()) {
        return bad(format!(
            "the range {low} … {high} must run upwards between finite numbers"
        ));
    }
    if !(low..=high).contains(&parameter) {
        return bad(format!(
            "the parameter {parameter} is outside the range {low} … {high}"
        ));
    }
    let steps = [options.min_step, options.initial_step, options.max_step];
    if !(steps[0] > 0.0 && steps[0] <= steps[1] && steps[1] <= steps[2] && steps[2].is_finite()) {
        return bad(format!(
            "steps must satisfy 0 < min ≤ initial ≤ max, {steps:?} given"
        ));
    }
    for scale in [options.state_scale, options.parameter_scale]
        .into_iter()
        .flatten()
    {
        if !(scale > 0.0 && scale.is_finite()) {
            return bad(format!("a scale must be positive, {scale} given"));
        }
    }
    if options.max_angle.is_nan() || options.max_angle <= 0.0 {
        return bad(format!(
            "the largest angle must be positive, {} given",
            options.max_angle
        ));
    }
    Ok(())
}

/// Scaled step at which a branch that keeps slipping onto one of shorter period is
/// taken to have met it.
const SHORTEST_MEETING: f64 = 1e-6;

/// Why a trial step was not taken.
enum Rejected {
    Corrector(CorrectorFailure),
    Turn,
    Jump,
}

impl std::fmt::Display for Rejected {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Corrector(failure) => write!(f, "{failure}"),
            Self::Turn => write!(f, "the tangent turns too fast"),
            Self::Jump => write!(f, "the correction is as large as the step"),
        }
    }
}

/// Steps from a first node until the branch ends.
pub(crate) fn follow<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    first: Node,
    options: &ContinuationOptions,
    control: &Control<'_>,
) -> Result<Branch, ContinuationError> {
    let mut tests = tests_at(solver, &first)?;
    let mut arclength = 0.0;
    let mut branch = Branch {
        period: solver.n,
        points: vec![point(solver, &first, &tests, arclength)?],
        bifurcations: Vec::new(),
        end: BranchEnd::PointLimit,
    };
    let start = first.clone();
    let mut node = first;
    let mut step = options.initial_step;
    while branch.points.len() < options.max_points {
        if control.is_cancelled() {
            branch.end = BranchEnd::Cancelled;
            break;
        }
        if let Some(progress) = control.progress {
            progress(branch.points.len(), options.max_points);
        }
        if at_range_end(&node, options) {
            branch.end = BranchEnd::RangeEnd;
            break;
        }
        let next = match trial(solver, &node, step, options) {
            Ok(next) => next,
            Err(why) => {
                step *= 0.5;
                if step < options.min_step {
                    branch.end = dead_end(solver, &mut branch, &node, &why);
                    break;
                }
                continue;
            }
        };
        if let Some(m) = slipped(solver, &node, &next) {
            step *= 0.5;
            if step < SHORTEST_MEETING.max(options.min_step) {
                branch.end = BranchEnd::Collapsed {
                    period: m,
                    parameter: node.parameter,
                };
                break;
            }
            continue;
        }
        if norm(&next.points) > options.bound {
            branch.end = BranchEnd::LeftDomain;
            break;
        }
        let Some(next_tests) = Tests::new(solver, &next) else {
            step *= 0.5;
            if step < options.min_step {
                branch.end = BranchEnd::StepTooSmall {
                    reason: "the multipliers could not be computed".into(),
                };
                break;
            }
            continue;
        };
        let index = branch.points.len() - 1;
        let taken = projection(solver, &node, &next);
        if let Some((m, at, mut parameter)) = shortest_collapse(solver, &node, &next, taken) {
            // What happens before the meeting still counts.
            if let Ok(near) = solver.along(&node, 0.9 * at) {
                parameter = meeting(solver, &node, &near, m).unwrap_or(parameter);
            }
            if let Ok(near) = solver.along(&node, 0.99 * at)
                && let Some(near_tests) = Tests::new(solver, &near)
            {
                let found = between(solver, &node, &tests, &near_tests, 0.99 * at, index);
                branch.bifurcations.extend(found);
                branch
                    .points
                    .push(point(solver, &near, &near_tests, arclength + 0.99 * at)?);
            }
            branch.end = BranchEnd::Collapsed {
                period: m,
                parameter,
            };
            break;
        }
        let found = between(solver, &node, &tests, &next_tests, taken, index);
        branch.bifurcations.extend(found);
        arclength += taken;
        branch
            .points
            .push(point(solver, &next, &next_tests, arclength)?);
        let turn = angle(solver, &node, &next);
        if next.iterations <= 4 && turn < 0.5 * options.max_angle {
            step = (1.5 * step).min(options.max_step);
        } else if next.iterations >= 7 {
            step *= 0.7;
        }
        let closed = branch.points.len() > 8 && is_return(solver, &start, &next, taken);
        node = next;
        tests = next_tests;
        if closed {
            branch.end = BranchEnd::Closed;
            break;
        }
    }
    Ok(branch)
}

fn tests_at<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    node: &Node,
) -> Result<Tests, ContinuationError> {
    Tests::new(solver, node).ok_or(ContinuationError::NoStart {
        parameter: node.parameter,
        reason: "its multipliers or tangencies could not be computed".into(),
    })
}

fn point<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    node: &Node,
    tests: &Tests,
    arclength: f64,
) -> Result<BranchPoint, ContinuationError> {
    Ok(BranchPoint {
        parameter: node.parameter,
        orbit: solver.orbit(node)?,
        arclength,
        slope: node.slope,
        tangencies: tests.tangencies.clone(),
    })
}

/// True if the branch is at an end of the range and heading out of it.
fn at_range_end(node: &Node, options: &ContinuationOptions) -> bool {
    let margin = 1e-12 * (options.range.1 - options.range.0);
    node.slope > 0.0 && node.parameter >= options.range.1 - margin
        || node.slope < 0.0 && node.parameter <= options.range.0 + margin
}

/// One step, onto the end of the range if it would lead out.
fn trial<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    node: &Node,
    step: f64,
    options: &ContinuationOptions,
) -> Result<Node, Rejected> {
    let (low, high) = options.range;
    let outside = |parameter: f64| {
        if parameter > high {
            Some(high)
        } else if parameter < low {
            Some(low)
        } else {
            None
        }
    };
    let onto = |solver: &mut BranchSolver<'_, F>, end: f64| {
        solver
            .onto_parameter(node, end)
            .map_err(Rejected::Corrector)
    };
    let next = if let Some(end) = outside(node.parameter + step * node.slope) {
        onto(solver, end)?
    } else {
        let next = solver.along(node, step).map_err(Rejected::Corrector)?;
        match outside(next.parameter) {
            Some(end) => onto(solver, end)?,
            None => next,
        }
    };
    // At the shortest steps a turn is a kink, to be passed.
    let forgiving = step < 1e3 * options.min_step;
    if !forgiving && angle(solver, node, &next) > options.max_angle {
        return Err(Rejected::Turn);
    }
    let taken = projection(solver, node, &next);
    let predicted: Vec<f64> = node.points[..solver.d]
        .iter()
        .zip(&node.tangent)
        .map(|(x, t)| x + taken * t)
        .collect();
    let correction = distance(&predicted, &next.points[..solver.d]) / solver.state_scale;
    if taken <= 0.0 || !forgiving && correction > 0.5 * taken {
        return Err(Rejected::Jump);
    }
    Ok(next)
}

/// Scaled arclength from one node to the next, along the tangent of the first.
fn projection<F: MapFamily>(solver: &BranchSolver<'_, F>, from: &Node, to: &Node) -> f64 {
    let shift: Vec<f64> = to.points[..solver.d]
        .iter()
        .zip(&from.points)
        .map(|(p, q)| p - q)
        .collect();
    solver.product(
        &shift,
        to.parameter - from.parameter,
        &from.tangent,
        from.slope,
    )
}

fn angle<F: MapFamily>(solver: &BranchSolver<'_, F>, a: &Node, b: &Node) -> f64 {
    solver
        .product(&a.tangent, a.slope, &b.tangent, b.slope)
        .clamp(-1.0, 1.0)
        .acos()
}

/// The first proper divisor of the period whose branch was met, the step and the
/// parameter there.
fn shortest_collapse<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    from: &Node,
    to: &Node,
    step: f64,
) -> Option<(usize, f64, f64)> {
    let n = solver.n;
    (1..n).filter(|m| n.is_multiple_of(*m)).find_map(|m| {
        let (at, parameter) = collapse(solver, from, to, step, m)?;
        Some((m, at, parameter))
    })
}

/// The divisor of the period whose branch Newton has slipped onto: the difference of
/// states that many periods apart has all but vanished within one step.
fn slipped<F: MapFamily>(solver: &BranchSolver<'_, F>, from: &Node, to: &Node) -> Option<usize> {
    let (n, d) = (solver.n, solver.d);
    let gap = |node: &Node, m: usize| distance(&node.points[..d], &node.points[m * d..(m + 1) * d]);
    (1..n).find(|&m| n.is_multiple_of(m) && gap(to, m) <= 1e-3 * gap(from, m))
}

/// Where the difference f of states `m` periods apart vanishes, from two nodes on one
/// side: beside a flip (or any symmetric birth) the parameter is even in f.
fn meeting<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    far: &Node,
    near: &Node,
    m: usize,
) -> Option<f64> {
    let d = solver.d;
    let gap = |node: &Node| distance(&node.points[..d], &node.points[m * d..(m + 1) * d]);
    let ratio = (gap(near) / gap(far)).powi(2);
    (ratio < 0.25).then(|| (near.parameter - ratio * far.parameter) / (1.0 - ratio))
}

/// True if `node` is the first node again, in any phase and in the same direction.
fn is_return<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    start: &Node,
    node: &Node,
    step: f64,
) -> bool {
    if (node.parameter - start.parameter).abs() / solver.parameter_scale > 0.6 * step {
        return false;
    }
    let mut turned = node.clone();
    (0..solver.n).any(|_| {
        turned.points.rotate_left(solver.d);
        turned.tangent.rotate_left(solver.d);
        solver.separation(&turned, start) <= 0.6 * step
            && solver.product(&turned.tangent, turned.slope, &start.tangent, start.slope) > 0.0
    })
}

/// What stopped the branch at the shortest step: an extremum that reaches zero just
/// there is a grazing that the orbit does not survive. The last few points may lie
/// beyond it already, with a touch too soft for Newton to notice and the extremum
/// gone.
fn dead_end<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    branch: &mut Branch,
    node: &Node,
    why: &Rejected,
) -> BranchEnd {
    let count = branch.points.len();
    let grazing = (count.saturating_sub(6).max(1)..count)
        .flat_map(|k| vanishing(solver, &branch.points[..=k]))
        .filter(|(parameter, ..)| {
            (parameter - node.parameter).abs() <= 1e-6 * solver.parameter_scale
        })
        .min_by(|x, y| x.2.abs().total_cmp(&y.2.abs()));
    if let Some((parameter, time, _)) = grazing
        && let Ok(orbit) = solver.orbit(node)
    {
        branch.bifurcations.push(Bifurcation {
            kind: BifurcationKind::Grazing { time },
            parameter,
            uncertainty: (parameter - node.parameter).abs(),
            orbit,
            after_point: count - 1,
            node: node.clone(),
        });
        return BranchEnd::Grazing { parameter };
    }
    BranchEnd::StepTooSmall {
        reason: why.to_string(),
    }
}

/// For every tangency of the last of some points: the parameter at which its value
/// extrapolates to zero, its time and its value.
fn vanishing<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    points: &[BranchPoint],
) -> Vec<(f64, f64, f64)> {
    let Some((b, before)) = points.split_last() else {
        return Vec::new();
    };
    // Far enough back for the rate not to be rounding.
    let far = 1e-7 * solver.parameter_scale;
    let Some(a) = before
        .iter()
        .rev()
        .find(|p| (p.parameter - b.parameter).abs() >= far)
        .or(before.last())
    else {
        return Vec::new();
    };
    b.tangencies
        .iter()
        .filter_map(|t| {
            let earlier = a
                .tangencies
                .iter()
                .min_by(|x, y| (x.time - t.time).abs().total_cmp(&(y.time - t.time).abs()))?;
            let rate = (t.value - earlier.value) / (b.parameter - a.parameter);
            let parameter = b.parameter - t.value / rate;
            parameter
                .is_finite()
                .then_some((parameter, t.time, t.value))
        })
        .collect()
}
