//! Recognition of a known orbit on a branch, whichever strobe it starts from.
//!
//! Newton finds the orbit of the branch in the plane perpendicular to the branch that contains the
//! known orbit. The two are the same if they agree to a small fraction of the step. This also works
//! near folds, where two orbits have nearly the same parameter value.

use crate::continuation::BranchPoint;
use crate::continuation::solver::{BranchSolver, Node};
use crate::map::MapFamily;
use crate::vector::difference;

/// Largest distance of equal orbits, as a fraction of the step.
const ORBIT_TOLERANCE: f64 = 1e-3;
/// How far the chord between two points is extended beyond its ends, as a fraction of its length.
const CHORD_EXTENSION: f64 = 0.1;

/// A point where a branch contains a known orbit.
struct Passage {
    /// Step from the previous point.
    at: f64,
    /// Solution of the branch at this point.
    node: Node,
    /// Strobe of the known orbit with which the branch's orbit begins.
    strobe: usize,
}

/// Finds the point where the branch from `from` along its tangent contains an orbit with these
/// strobes at `parameter`, for steps within `reach`. The point lies at most `size` away from the
/// tangent; `size` is the distance by which the branch's points move on the way.
fn passage<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    from: &Node,
    (points, parameter): (&[f64], f64),
    reach: (f64, f64),
    size: f64,
) -> Option<Passage> {
    (0..solver.n).find_map(|strobe| {
        let (before, after) = points.split_at(strobe * solver.d);
        let known = [after, before].concat();
        let way = difference(&known, &from.points);
        let at = solver.product(&way, parameter - from.parameter, &from.tangent, from.slope);
        let known = (known.as_slice(), parameter);
        let (points, value) = from.ahead(at);
        let near = solver.separation((&points, value), known) <= size;
        if !near || !(reach.0..=reach.1).contains(&at) {
            return None;
        }
        let node = solver.along(from, at).ok()?;
        let same = solver.separation(node.solution(), known) <= ORBIT_TOLERANCE * size;
        same.then_some(Passage { at, node, strobe })
    })
}

/// Step from `from`, at most the one that leads to `to`, after which the branch returns to its
/// first node, at any strobe and in the same direction: the branch is closed.
pub(crate) fn closing<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    first: &Node,
    from: &Node,
    to: &Node,
    step: f64,
) -> Option<(f64, Node)> {
    let size = solver.separation(from.solution(), to.solution());
    let reach = (f64::MIN_POSITIVE, step);
    let passage = passage(solver, from, first.solution(), reach, size)?;
    let Passage { at, node, strobe } = passage;
    let mut tangent = first.tangent.clone();
    tangent.rotate_left(strobe * solver.d);
    let onwards = solver.product(&node.tangent, node.slope, &tangent, first.slope) > 0.0;
    onwards.then_some((at, node))
}

/// True if an orbit lies between two neighbouring points of a branch.
pub(crate) fn lies_between<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    (a, b): (&BranchPoint, &BranchPoint),
    (orbit, parameter): (&[f64], f64),
) -> bool {
    let (points, end) = (a.orbit.flat(), b.orbit.flat());
    let way = difference(&end, &points);
    let slope = b.parameter - a.parameter;
    let size = solver.separation((&points, a.parameter), (&end, b.parameter));
    let length = solver.product(&way, slope, &way, slope).sqrt();
    let chord = Node {
        parameter: a.parameter,
        points,
        jacobians: Vec::new(),
        residual: 0.0,
        tangent: way.iter().map(|x| x / length).collect(),
        slope: slope / length,
        iterations: 0,
    };
    let reach = (-CHORD_EXTENSION * length, (1.0 + CHORD_EXTENSION) * length);
    passage(solver, &chord, (orbit, parameter), reach, size).is_some()
}
