//! The reason why a branch ends.

use crate::continuation::bifurcation::{Bifurcation, BifurcationKind};
use crate::continuation::solver::{BranchSolver, Node};
use crate::continuation::step::Rejected;
use crate::continuation::{Branch, BranchEnd, BranchPoint, OrbitTangency};
use crate::map::MapFamily;

/// Distance to a grazing, as a fraction of the range, within which the grazing is the reason for
/// the end.
const GRAZING_DISTANCE: f64 = 1e-6;
/// Largest distance of the grazing orbit from the branch's last orbit, in scaled arclength.
const MAX_ORBIT_DISTANCE: f64 = 1e-2;

/// Finds the reason why no point was found at the shortest step. An extremum that reaches zero
/// there is a grazing that the orbit does not survive. The last few points may lie beyond it
/// already: the contact is too weak for Newton to notice, and the extremum has vanished.
pub(crate) fn dead_end<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    branch: &mut Branch,
    node: &Node,
    why: &Rejected,
) -> BranchEnd {
    let count = branch.points.len();
    let near = |parameter: f64| {
        (parameter - node.parameter).abs() <= GRAZING_DISTANCE * solver.parameter_scale
    };
    if let Some(touch) = locate_grazing(solver, node)
        && near(touch.node.parameter)
        && let Ok(orbit) = solver.orbit(&touch.node)
    {
        let parameter = touch.node.parameter;
        branch.bifurcations.push(Bifurcation {
            kind: BifurcationKind::Grazing { time: touch.time },
            criticality: None,
            parameter,
            uncertainty: touch.uncertainty,
            orbit,
            after_point: count - 1,
            node: touch.node,
        });
        return BranchEnd::Grazing { parameter };
    }
    let grazing = (count.saturating_sub(6).max(1)..count)
        .flat_map(|k| vanishing(solver, &branch.points[..=k]))
        .filter(|(parameter, ..)| near(*parameter))
        .min_by(|x, y| x.2.abs().total_cmp(&y.2.abs()));
    if let Some((parameter, time, _)) = grazing
        && let Ok(orbit) = solver.orbit(node)
    {
        branch.bifurcations.push(Bifurcation {
            kind: BifurcationKind::Grazing { time },
            criticality: None,
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

/// The orbit at a grazing near the end of a branch.
struct GrazingOrbit {
    node: Node,
    /// Time in drive periods, from the first state of the orbit.
    time: f64,
    /// Last change of the parameter in the secant iteration.
    uncertainty: f64,
}

/// The orbit near `node` at which the extremum of a switching function that is nearest to zero
/// vanishes, by the secant method. Contacts of rigid stops are ignored
/// ([`StroboscopicMap::pass_touches`](crate::map::StroboscopicMap::pass_touches)), so that orbits
/// depend smoothly on the parameter on both sides of the grazing.
fn locate_grazing<F: MapFamily>(solver: &BranchSolver<'_, F>, node: &Node) -> Option<GrazingOrbit> {
    let mut passing = solver.another();
    passing.passes_touches = true;
    let mut at = |from: &Node, parameter: f64, near: Option<OrbitTangency>| {
        let node = passing.at_parameter(&from.points, parameter, true).ok()?;
        let tangencies = passing.tangencies(&node).ok()?;
        let apart = |t: &OrbitTangency| near.map_or(t.value.abs(), |n| (n.time - t.time).abs());
        let nearest = |a: &OrbitTangency, b: &OrbitTangency| apart(a).total_cmp(&apart(b));
        Some((tangencies.into_iter().min_by(nearest)?, node))
    };
    let (first, start) = at(node, node.parameter, None)?;
    let mut below = (node.parameter, first.value);
    let aside = node.parameter + 1e-7 * solver.parameter_scale;
    let (mut here, mut found) = at(&start, aside, Some(first))?;
    for _ in 0..20 {
        let before = found.parameter;
        let rate = (here.value - below.1) / (before - below.0);
        below = (before, here.value);
        let next = before - here.value / rate;
        let away = (next - node.parameter).abs() / solver.parameter_scale;
        if away.is_nan() || away > 1e3 * GRAZING_DISTANCE {
            return None;
        }
        (here, found) = at(&found, next, Some(here))?;
        let uncertainty = (next - before).abs();
        if uncertainty <= 1e-13 * next.abs().max(solver.parameter_scale) || here.value == below.1 {
            let (time, same) = (here.time, (node.solution(), found.solution()));
            let is_same = solver.separation(same.0, same.1) <= MAX_ORBIT_DISTANCE;
            return is_same.then_some(GrazingOrbit {
                node: found,
                time,
                uncertainty,
            });
        }
    }
    None
}

/// For every tangency of the last of some points: the parameter at which its value extrapolates to
/// zero, its time in drive periods, and its value.
fn vanishing<F: MapFamily>(
    solver: &BranchSolver<'_, F>,
    points: &[BranchPoint],
) -> Vec<(f64, f64, f64)> {
    let Some((b, before)) = points.split_last() else {
        return Vec::new();
    };
    // Far enough back that the rate is not dominated by rounding.
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

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::continuation::solver::tests::{bare, solver};
    use crate::continuation::step;
    use crate::orbit::{PeriodicOrbit, Stability};

    fn at(parameter: f64, tangencies: &[(f64, f64)]) -> BranchPoint {
        BranchPoint {
            parameter,
            orbit: PeriodicOrbit {
                period: 1,
                states: vec![vec![0.5]],
                residual: 0.0,
                error: 0.0,
                multipliers: Vec::new(),
                log_determinant: 0.0,
                stability: Stability::Marginal,
                margin: 0.0,
                discrete: 0,
            },
            arclength: 0.0,
            slope: 1.0,
            tangencies: tangencies
                .iter()
                .map(|&(time, value)| OrbitTangency { time, value })
                .collect(),
        }
    }

    /// Two extrema that fall in proportion to the parameter, and two at the same time, each one matched
    /// with the one of equal value. A point that is too near to give a rate is skipped.
    #[test]
    fn extrema_are_extrapolated_to_zero() {
        let points = [
            at(0.1, &[(0.2, 0.4), (0.6, 3.0), (0.6, -1.0)]),
            at(0.2 - 1e-9, &[(0.2, 7.0), (0.6, 7.0), (0.6, -7.0)]),
            at(0.2, &[(0.22, 0.3), (0.61, 2.9), (0.61, -0.8)]),
        ];
        let found = vanishing(&solver(1), &points);
        let expected = [(0.5, 0.22, 0.3), (3.1, 0.61, 2.9), (0.6, 0.61, -0.8)];
        assert_eq!(found.len(), 3);
        for (f, e) in found.iter().zip(expected) {
            assert!((f.0 - e.0).abs() < 1e-12, "{f:?} {e:?}");
            assert_eq!((f.1, f.2), (e.1, e.2));
        }
        assert!(vanishing(&solver(1), &points[..1]).is_empty());
    }

    /// A branch that stops 1e-7 before an extremum vanishes ends in a grazing; 1e-5 before it, the
    /// branch is cut.
    #[test]
    fn a_branch_that_stops_at_a_touch_has_grazed() {
        for (short, grazes) in [(1e-7, true), (1e-5, false)] {
            let mut branch = Branch {
                period: 1,
                points: vec![
                    at(2.0, &[(0.25, 1.0 + short), (0.75, 1.0)]),
                    at(3.0, &[(0.25, short), (0.75, 1.5)]),
                ],
                bifurcations: Vec::new(),
                end: BranchEnd::RangeEnd,
            };
            let node = Node {
                jacobians: vec![DMatrix::from_element(1, 1, -1.0)],
                ..bare(3.0, &[2.0 / 3.0])
            };
            let end = dead_end(&solver(1), &mut branch, &node, &step::Rejected::Turn);
            if !grazes {
                assert!(
                    matches!(end, BranchEnd::StepTooSmall { parameter, .. } if parameter == 3.0)
                );
                assert!(branch.bifurcations.is_empty());
                continue;
            }
            let BranchEnd::Grazing { parameter } = end else {
                panic!("{end}")
            };
            assert!((parameter - 3.0 - short).abs() < 1e-12);
            let [grazing] = &branch.bifurcations[..] else {
                panic!()
            };
            assert_eq!(grazing.kind, BifurcationKind::Grazing { time: 0.25 });
            assert!((grazing.uncertainty - short).abs() < 1e-12);
            assert_eq!(grazing.after_point, 1);
        }
    }
}
