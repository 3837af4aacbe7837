//! Why a branch does not go on.

use crate::continuation::bifurcation::{Bifurcation, BifurcationKind};
use crate::continuation::solver::{BranchSolver, Node};
use crate::continuation::step::Rejected;
use crate::continuation::{Branch, BranchEnd, BranchPoint};
use crate::map::MapFamily;

/// What stopped the branch at the shortest step: an extremum that reaches zero just
/// there is a grazing that the orbit does not survive. The last few points may lie
/// beyond it already, with a touch too soft for Newton to notice and the extremum
/// gone.
pub(crate) fn dead_end<F: MapFamily>(
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
        parameter: node.parameter,
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
            let earlier = a.tangencies.iter().min_by(|x, y| {
                let [x, y] = [x, y].map(|e| [e.time - t.time, e.value - t.value].map(f64::abs));
                x[0].total_cmp(&y[0]).then(x[1].total_cmp(&y[1]))
            })?;
            let rate = (t.value - earlier.value) / (b.parameter - a.parameter);
            let parameter = b.parameter - t.value / rate;
            parameter
                .is_finite()
                .then_some((parameter, t.time, t.value))
        })
        .collect()
}
