//! Whether a branch passes an orbit that is known already, at whichever of its strobes.
//!
//! In the plane across the branch in which the known orbit lies, Newton finds the branch's own
//! orbit: the two are one if they agree to a small part of the step. So it is round folds too,
//! beside which the parameter does not tell an orbit from its neighbour.

use crate::continuation::BranchPoint;
use crate::continuation::solver::{BranchSolver, Node};
use crate::map::MapFamily;
use crate::vector::difference;

/// Part of a step within which two orbits in one plane across it are the same.
const SAME: f64 = 1e-3;
/// How far beyond its ends the chord between two points is followed, in its lengths.
const BEYOND: f64 = 0.1;

/// A place where a branch passes a known orbit.
struct Passage {
    /// The step there from the point before.
    at: f64,
    /// The branch's point there.
    node: Node,
    /// The known orbit's strobe at which the branch's orbit begins.
    strobe: usize,
}

/// Where the branch from `from` along its tangent passes an orbit with these strobes at
/// `parameter`, with a step within `reach`; no further beside the tangent than `size`, by which
/// the branch's points move on the way.
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
        let same = solver.separation(node.solution(), known) <= SAME * size;
        same.then_some(Passage { at, node, strobe })
    })
}

/// The step from `from`, no longer than the one that leads to `to`, after which a branch is back
/// at its first node, at any strobe, and on the same way: it is closed.
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
    let reach = (-BEYOND * length, (1.0 + BEYOND) * length);
    passage(solver, &chord, (orbit, parameter), reach, size).is_some()
}
