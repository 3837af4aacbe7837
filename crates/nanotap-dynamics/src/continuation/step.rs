//! One step along a branch: prediction, correction and acceptance.

use crate::continuation::ContinuationOptions;
use crate::continuation::solver::{BranchSolver, CorrectorFailure, Node};
use crate::map::MapFamily;
use crate::vector::{distance, norm};

/// Why a trial step was rejected.
pub(crate) enum Rejected {
    Corrector(CorrectorFailure),
    Turn,
    Jump,
    /// The orbit is a point at the end of the range.
    Vanished {
        parameter: f64,
    },
}

/// Largest size of a predicted orbit that counts as a point, as a fraction of the orbit's size.
const POINT_SIZE: f64 = 1e-6;
/// Largest jump of the Jacobian where an orbit shrinks to a point, as a fraction of its size.
const MAX_JACOBIAN_JUMP: f64 = 0.1;

impl std::fmt::Display for Rejected {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Corrector(failure) => write!(f, "{failure}"),
            Self::Turn => write!(f, "the tangent turns too fast"),
            Self::Vanished { .. } => write!(f, "the orbit shrinks to a point"),
            Self::Jump => write!(f, "the correction is as large as the step"),
        }
    }
}

/// True if the branch is at an end of the range and leaves it.
pub(crate) fn at_range_end(node: &Node, options: &ContinuationOptions) -> bool {
    let margin = 1e-12 * (options.range.1 - options.range.0);
    node.slope > 0.0 && node.parameter >= options.range.1 - margin
        || node.slope < 0.0 && node.parameter <= options.range.0 + margin
}

/// One trial step, shortened to the end of the range if it would leave it. `before` is the node
/// before this one, if any.
pub(crate) fn trial<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    before: Option<&Node>,
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
        let next = solver
            .onto_parameter(node, end)
            .map_err(Rejected::Corrector);
        if is_point_at(node, end)
            && !next
                .as_ref()
                .is_ok_and(|next| is_differentiable(node, next))
        {
            return Err(Rejected::Vanished { parameter: end });
        }
        next
    };
    let next = if let Some(end) = outside(node.parameter + step * node.slope) {
        onto(solver, end)?
    } else {
        let next = match before {
            Some(before) => solver.along_cubic(node, step, [before, node]),
            None => solver.along(node, step),
        };
        let next = next.map_err(Rejected::Corrector)?;
        match outside(next.parameter) {
            Some(end) => onto(solver, end)?,
            None => next,
        }
    };
    // At the shortest steps a turn of the tangent is a kink, which is accepted.
    let accepts_kinks = step < 1e3 * options.min_step;
    if !accepts_kinks && angle(solver, node, &next) > options.max_angle {
        return Err(Rejected::Turn);
    }
    let taken = solver.projection(node, &next);
    let (predicted, _) = node.ahead(taken);
    let c = solver.continuous;
    let correction = distance(&predicted[..c], &next.points[..c]) / solver.state_scale;
    if taken <= 0.0 || !accepts_kinks && correction > 0.5 * taken {
        return Err(Rejected::Jump);
    }
    Ok(next)
}

/// True if the linear prediction of the orbit has no size at `end`.
fn is_point_at(node: &Node, end: f64) -> bool {
    let step = (end - node.parameter) / node.slope;
    let left = node
        .points
        .iter()
        .zip(&node.tangent)
        .fold(0.0, |m: f64, (x, t)| m.max((x + step * t).abs()));
    left <= POINT_SIZE * norm(&node.points)
}

/// True if the map's derivative is continuous from one node to the next. It is not where a
/// homogeneous map (all motions scale with the drive) is evaluated at drive amplitude zero.
fn is_differentiable(node: &Node, next: &Node) -> bool {
    node.jacobians.iter().zip(&next.jacobians).all(|(a, b)| {
        let jump = (a - b).amax();
        jump <= MAX_JACOBIAN_JUMP * a.amax()
    })
}

pub(crate) fn angle<F: MapFamily>(solver: &BranchSolver<'_, F>, a: &Node, b: &Node) -> f64 {
    nanotap_arithmetic::acos(
        solver
            .product(&a.tangent, a.slope, &b.tangent, b.slope)
            .clamp(-1.0, 1.0),
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::continuation::solver::tests::bare;

    /// An orbit whose size is proportional to its parameter, predicted at zero along its tangent.
    #[test]
    fn an_orbit_as_large_as_its_drive_is_a_point_without_it() {
        let at = |offset: f64| Node {
            tangent: vec![3.0, -2.0],
            slope: 0.5,
            ..bare(0.25, &[1.5 + offset, -1.0])
        };
        assert!(is_point_at(&at(0.0), 0.0));
        assert!(is_point_at(&at(1e-6), 0.0));
        assert!(!is_point_at(&at(1e-5), 0.0));
        assert!(!is_point_at(&at(0.0), 0.125));
        assert!(!is_point_at(&at(0.0), -0.25));
    }

    #[test]
    fn a_branch_goes_on_while_its_derivative_does() {
        let with = |entry: f64| Node {
            jacobians: vec![DMatrix::from_row_slice(1, 2, &[40.0, entry])],
            ..bare(0.0, &[0.0])
        };
        assert!(is_differentiable(&with(1.0), &with(4.9)));
        assert!(!is_differentiable(&with(1.0), &with(5.1)));
    }

    /// Only in the outward direction, within rounding of the end.
    #[test]
    fn a_range_ends_where_it_is_left() {
        let options = ContinuationOptions::over(100.0, 300.0);
        for (parameter, slope, ends) in [
            (300.0, 1.0, true),
            (300.0, -1.0, false),
            (300.0 - 1e-10, 1.0, true),
            (300.0 - 3e-10, 1.0, false),
            (100.0, -1.0, true),
            (100.0, 1.0, false),
            (100.0 + 1e-10, -1.0, true),
            (100.0 + 3e-10, -1.0, false),
            (300.0, 0.0, false),
            (100.0, 0.0, false),
        ] {
            let node = Node {
                slope,
                ..bare(parameter, &[0.0])
            };
            assert_eq!(at_range_end(&node, &options), ends, "{parameter} {slope}");
        }
    }
}
