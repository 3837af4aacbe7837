//! Where a branch runs into one of shorter period.

use crate::continuation::bifurcation::collapse;
use crate::continuation::solver::{BranchSolver, Node};
use crate::map::MapFamily;
use crate::vector::norm;

/// The first proper divisor of the period whose branch was met, the step and the
/// parameter there.
pub(crate) fn shortest_collapse<F: MapFamily>(
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
pub(crate) fn slipped<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    from: &Node,
    to: &Node,
) -> Option<usize> {
    let n = solver.n;
    let gap = |node: &Node, m: usize| norm(&solver.gap(node, m));
    (1..n).find(|&m| n.is_multiple_of(m) && gap(to, m) <= 1e-3 * gap(from, m))
}

/// Where the difference f of states `m` periods apart vanishes, from two nodes on one
/// side: beside a flip (or any symmetric birth) the parameter is even in f.
pub(crate) fn meeting<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    far: &Node,
    near: &Node,
    m: usize,
) -> Option<f64> {
    let gap = |node: &Node| norm(&solver.gap(node, m));
    let ratio = (gap(near) / gap(far)).powi(2);
    (ratio < 0.25).then(|| (near.parameter - ratio * far.parameter) / (1.0 - ratio))
}
