//! The continuation loop: steps from a first point until the branch ends.

use std::sync::{Mutex, PoisonError};

use crate::continuation::bifurcation::{Bifurcation, Tests, between};
use crate::continuation::bifurcation_tasks::BifurcationTasks;
use crate::continuation::end::dead_end;
use crate::continuation::orbit_on_branch::closing;
use crate::continuation::period_division::{meeting, shortest_collapse, slipped};
use crate::continuation::solver::{BranchSolver, Node};
use crate::continuation::step::{Rejected, angle, at_range_end, trial};
use crate::continuation::{Branch, BranchEnd, BranchPoint, ContinuationError, ContinuationOptions};
use crate::control::Control;
use crate::map::{MapFamily, StroboscopicMap as _};
use crate::orbit::PeriodicOrbit;

/// Scaled step below which a branch that repeatedly converges to one of shorter period is taken to
/// have met it.
const MIN_COLLAPSE_STEP: f64 = 1e-6;
/// Largest distance of a multiplier beyond −1 at the first point after a flip.
const FLIP_OVERSHOOT: f64 = 0.5;
/// Scaled step below which a flip is accepted without a further reduction.
const MIN_FLIP_STEP: f64 = 1e-6;

/// Largest number of state entries of all points of a branch: 800 MB.
const MAX_STATE_ENTRIES: usize = 100_000_000;

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
        orbit.dimension() - orbit.discrete,
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
            "the range needs finite ends in ascending order, got {low} … {high}"
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
            "steps must satisfy 0 < min ≤ initial ≤ max, got {steps:?}"
        ));
    }
    for scale in [options.state_scale, options.parameter_scale]
        .into_iter()
        .flatten()
    {
        if !(scale > 0.0 && scale.is_finite()) {
            return bad(format!("a scale must be positive, got {scale}"));
        }
    }
    if options.max_angle.is_nan() || options.max_angle <= 0.0 {
        return bad(format!(
            "the largest angle must be positive, got {}",
            options.max_angle
        ));
    }
    Ok(())
}

/// Follows a branch from its first node until it ends.
pub(crate) fn follow<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    first: Node,
    options: &ContinuationOptions,
    control: &Control<'_>,
) -> Result<Branch, ContinuationError> {
    let found = Mutex::new(Vec::new());
    let mut branch = rayon::in_place_scope(|scope| {
        let tasks = BifurcationTasks {
            scope,
            found: &found,
            control,
        };
        step_by_step(solver, first, options, &tasks)
    })?;
    let found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
    branch.add_bifurcations(found, options.range);
    branch.bifurcations.sort_by_key(|b| b.after_point);
    Ok(branch)
}

/// The branch without the bifurcations that other threads locate.
fn step_by_step<'scope, 'a: 'scope, F: MapFamily + 'scope>(
    solver: &mut BranchSolver<'a, F>,
    first: Node,
    options: &ContinuationOptions,
    tasks: &BifurcationTasks<'_, 'scope>,
) -> Result<Branch, ContinuationError> {
    let control = tasks.control;
    let least = solver.size(&first.points);
    let mut tests = tests_at(solver, &first, options.grazings)?;
    let mut arclength = 0.0;
    let mut branch = Branch {
        period: solver.n,
        points: vec![point(solver, &first, &tests, arclength)?],
        bifurcations: Vec::new(),
        end: BranchEnd::PointLimit,
    };
    if options.until_unstable && !branch.points[0].orbit.is_stable() {
        branch.end = BranchEnd::Unstable {
            parameter: first.parameter,
        };
        return Ok(branch);
    }
    let start = first.clone();
    let mut before = None;
    let mut node = first;
    let mut step = options.initial_step;
    let max_points = options
        .max_points
        .min(MAX_STATE_ENTRIES / start.points.len().max(1));
    while branch.points.len() < max_points {
        if control.is_cancelled() {
            break;
        }
        if let Some(progress) = control.progress {
            progress(branch.points.len(), max_points);
        }
        if at_range_end(&node, options) {
            branch.end = BranchEnd::RangeEnd;
            break;
        }
        let mut next = match trial(solver, before.as_ref(), &node, step, options) {
            Ok(next) => next,
            Err(Rejected::Vanished { parameter }) => {
                branch.end = BranchEnd::Vanished { parameter };
                break;
            }
            Err(why) => {
                step *= 0.5;
                if step < options.min_step {
                    if let Some(next) = past_impact(solver, &node, options.range)
                        && let Some(next_tests) = Tests::new(solver, &next, options.grazings)
                    {
                        arclength +=
                            (next.parameter - node.parameter).abs() / solver.parameter_scale;
                        branch
                            .points
                            .push(point(solver, &next, &next_tests, arclength)?);
                        (node, tests, before) = (next, next_tests, None);
                        step = options.initial_step;
                        continue;
                    }
                    if !options.grazings {
                        add_last_tangencies(solver, &mut branch);
                    }
                    branch.end = dead_end(solver, &mut branch, &node, &why);
                    break;
                }
                continue;
            }
        };
        if let Some(m) = slipped(solver, &node, &next) {
            step *= 0.5;
            if step < MIN_COLLAPSE_STEP.max(options.min_step) {
                branch.end = BranchEnd::Collapsed {
                    period: m,
                    parameter: node.parameter,
                };
                break;
            }
            continue;
        }
        if solver.size(&next.points) > options.bound {
            branch.end = BranchEnd::LeftDomain;
            break;
        }
        let mut taken = solver.projection(&node, &next);
        let closed = closing(solver, &start, &node, &next, taken);
        let is_closed = closed.is_some();
        if let Some((at, end)) = closed {
            (taken, next) = (at, end);
        }
        let Some(mut next_tests) = Tests::new(solver, &next, options.grazings) else {
            step *= 0.5;
            if step < options.min_step {
                branch.end = BranchEnd::StepTooSmall {
                    parameter: node.parameter,
                    reason: "the multipliers could not be computed".into(),
                };
                break;
            }
            continue;
        };
        // A multiplier far beyond −1 may have passed several flips.
        let passes_flip = tests.flip > 0.0 && next_tests.flip < -FLIP_OVERSHOOT;
        if passes_flip && !is_closed && step > MIN_FLIP_STEP.max(options.min_step) {
            step *= 0.5;
            continue;
        }
        let index = branch.points.len() - 1;
        if let Some((m, at, mut parameter)) = shortest_collapse(solver, &node, &next, taken) {
            // Bifurcations before the meeting still count.
            if let Ok(near) = solver.along(&node, 0.9 * at) {
                parameter = meeting(solver, &node, &near, m).unwrap_or(parameter);
            }
            if let Ok(near) = solver.along(&node, 0.99 * at)
                && let Some(near_tests) = Tests::new(solver, &near, options.grazings)
            {
                let found = between(
                    solver,
                    [&node, &near],
                    [&tests, &near_tests],
                    0.99 * at,
                    index,
                );
                branch.add_bifurcations(found, options.range);
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
        arclength += taken;
        let reached = point(solver, &next, &next_tests, arclength)?;
        let multiplier = reached.orbit.spectral_radius();
        let turns = node.slope * next.slope < 0.0;
        let unstable = turns || !reached.orbit.is_stable();
        if options.until_unstable && unstable && !options.grazings {
            for (tests, node) in [(&mut tests, &node), (&mut next_tests, &next)] {
                tests.tangencies = solver.tangencies(node).unwrap_or_default();
            }
        }
        let (nodes, changes) = ([&node, &next], [&tests, &next_tests]);
        let found = tasks.between(solver, nodes, changes, taken, index);
        if control.is_cancelled() {
            break;
        }
        branch.add_bifurcations(found, options.range);
        branch.points.push(reached);
        if options.until_unstable && unstable {
            branch.end = BranchEnd::Unstable {
                parameter: node.parameter,
            };
            break;
        }
        if multiplier > options.max_multiplier {
            branch.end = BranchEnd::Repelling {
                parameter: next.parameter,
            };
            break;
        }
        let turn = angle(solver, &node, &next);
        if next.iterations <= 4 && turn < 0.5 * options.max_angle {
            step = (1.5 * step).min(options.max_step);
        } else if next.iterations >= 7 {
            step *= 0.7;
        }
        if options.state_scale.is_none() {
            solver.rescale(&mut next, least);
        }
        before = Some(std::mem::replace(&mut node, next));
        tests = next_tests;
        if is_closed {
            branch.end = BranchEnd::Closed;
            break;
        }
    }
    // A cancelled map may be the reason for the failure of the last step.
    if control.is_cancelled() {
        branch.end = BranchEnd::Cancelled;
    }
    Ok(branch)
}

/// Steps in scaled arclength beyond an impact at drive phase 0.
const PAST_IMPACT: [f64; 4] = [1e-6, 1e-5, 1e-4, 1e-7];
/// Largest distance of the orbit there from its prediction, in scaled arclength.
const SAME_ORBIT: f64 = 1e-2;

/// The next point of a branch of which an impact on a rigid stop falls on drive phase 0 just beyond
/// `node`: the orbit goes on there, but its state at phase 0 jumps to the other side of the impact.
fn past_impact<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    node: &Node,
    (low, high): (f64, f64),
) -> Option<Node> {
    PAST_IMPACT.iter().find_map(|step| {
        let (mut points, parameter) = node.ahead(*step);
        if !(low..=high).contains(&parameter) {
            return None;
        }
        let map = solver.family.at(parameter).ok()?;
        let mut any = false;
        for point in points.chunks_exact_mut(solver.d) {
            if let Some(other) = map.across_impact(point) {
                point.copy_from_slice(&other);
                any = true;
            }
        }
        let next = any.then(|| solver.at_parameter(&points, parameter, node.slope > 0.0));
        let next = next?.ok()?;
        let apart = solver.separation(next.solution(), (&points, parameter));
        (apart <= SAME_ORBIT && next.slope * node.slope > 0.0).then_some(next)
    })
}

/// Points before a dead end whose tangencies show whether it is a grazing.
const LAST_POINTS: usize = 12;

fn add_last_tangencies<F: MapFamily>(solver: &mut BranchSolver<'_, F>, branch: &mut Branch) {
    for point in branch.points.iter_mut().rev().take(LAST_POINTS) {
        let states = point.orbit.states.concat();
        let found = solver.tangencies_at(point.parameter, &states);
        point.tangencies = found.unwrap_or_default();
    }
}

impl Branch {
    /// Adds bifurcations between two points, restricted to the parameter range.
    fn add_bifurcations(&mut self, found: Vec<Bifurcation>, (low, high): (f64, f64)) {
        let inside = |b: &Bifurcation| (low..=high).contains(&b.parameter);
        self.bifurcations.extend(found.into_iter().filter(inside));
    }
}

fn tests_at<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    node: &Node,
    grazings: bool,
) -> Result<Tests, ContinuationError> {
    Tests::new(solver, node, grazings).ok_or(ContinuationError::NoStart {
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
