//! Detection of a branch that meets one of shorter period.

use crate::continuation::bifurcation::collapse;
use crate::continuation::solver::{BranchSolver, Node};
use crate::map::MapFamily;
use crate::vector::norm;

/// Returns the first proper divisor of the period whose branch is met, with the step and the
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

/// Returns the divisor of the period to whose branch Newton has converged: the difference of the
/// states that many periods apart has nearly vanished within one step.
pub(crate) fn slipped<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    from: &Node,
    to: &Node,
) -> Option<usize> {
    let n = solver.n;
    let gap = |node: &Node, m: usize| norm(&solver.gap(node, m));
    (1..n).find(|&m| n.is_multiple_of(m) && gap(to, m) <= 1e-3 * gap(from, m))
}

/// Where the difference f of states `m` periods apart vanishes, extrapolated from two nodes on one
/// side: near a flip (or any symmetric bifurcation) the parameter is an even function of f.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::continuation::solver::tests::{bare, solver};

    /// Both points of the period-2 orbit of the logistic map, which bifurcates at r = 3.
    fn doubled(r: f64) -> Node {
        let root = ((r + 1.0) * (r - 3.0)).sqrt();
        bare(r, &[r + 1.0 + root, r + 1.0 - root].map(|x| x / (2.0 * r)))
    }

    /// The gap is √((r + 1)(r − 3))/r: its square is nearly linear near r = 3, where it vanishes.
    #[test]
    fn a_doubled_branch_points_to_where_it_was_born() {
        let solver = solver(2);
        for (far, near) in [(3.004, 3.0004), (3.001, 3.0002)] {
            let met = meeting(&solver, &doubled(far), &doubled(near), 1).unwrap();
            let curvature: f64 = (far - 3.0) * (near - 3.0);
            assert!((met - 3.0).abs() < curvature, "{met}");
        }
        // Still too far away: the gap has hardly shrunk.
        assert_eq!(meeting(&solver, &doubled(3.04), &doubled(3.02), 1), None);
    }

    #[test]
    fn a_gap_that_vanishes_in_one_step_is_a_slip() {
        let node = |points: &[f64]| bare(3.0, points);
        let from = node(&[0.1, 0.6, 0.2, 0.9]);
        let whole = [0.3, 0.5, 0.3 + 1e-5, 0.5];
        assert_eq!(slipped(&solver(4), &from, &node(&whole)), Some(2));
        let fixed = [0.3, 0.3 + 1e-5, 0.3, 0.3];
        assert_eq!(slipped(&solver(4), &from, &node(&fixed)), Some(1));
        assert_eq!(slipped(&solver(4), &from, &from), None);
    }
}
