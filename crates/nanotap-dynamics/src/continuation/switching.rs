//! Branch switching at a flip, onto the branch of doubled period.
//!
//! At a flip the linearised return map has an eigenvector v with v → −v. The doubled orbit starts
//! as x_k + a v_k in the first pass and x_k − a v_k in the second, while the parameter changes by
//! O(a²) only (O(a^{3/2}) if the flip is at a grazing). v is the solution of the antiperiodic
//! Newton system, which is accurate for long unstable orbits too. The first point of the branch is
//! the flip itself. The amplitude a is so small that no multiplier crosses −1 before the second
//! point: far along a cascade a fixed step would miss the next flips.
//!
//! Fails if Newton finds no orbit of doubled period for any a between 1e-2 and 1e-6 of the orbit's
//! size.

use crate::continuation::bifurcation::{Bifurcation, BifurcationKind, flip_test};
use crate::continuation::follow::{check, follow, solver_for};
use crate::continuation::solver::Node;
use crate::continuation::{Branch, ContinuationError, ContinuationOptions};
use crate::control::Control;
use crate::map::MapFamily;
use crate::orbit::block_cyclic::BlockCyclic;
use crate::random::unit;
use crate::vector::{dot, norm};

/// Follows the doubled branch from a flip.
///
/// # Errors
/// If the bifurcation is not a flip, the options are invalid, or no doubled orbit is found.
pub fn switch_at_flip<F: MapFamily>(
    family: &F,
    flip: &Bifurcation,
    options: &ContinuationOptions,
    control: &Control<'_>,
) -> Result<Branch, ContinuationError> {
    if flip.kind != BifurcationKind::Flip {
        return Err(ContinuationError::NotAFlip);
    }
    check(options, flip.parameter)?;
    let mut doubled = flip.orbit.clone();
    doubled.period *= 2;
    doubled.states.extend(flip.orbit.states.iter().cloned());
    let mut solver = solver_for(family, &doubled, options);
    let failed = |reason: &str| ContinuationError::NoStart {
        parameter: flip.parameter,
        reason: reason.into(),
    };
    let half = antiperiodic_vector(&flip.node, solver.d)
        .ok_or_else(|| failed("the direction of the doubled branch could not be computed"))?;
    let mut tangent = half.clone();
    tangent.extend(half.iter().map(|v| -v));
    let length = solver.product(&tangent, 0.0, &tangent, 0.0).sqrt();
    for t in &mut tangent {
        *t /= length;
    }
    let mut points = flip.node.points.clone();
    points.extend_from_slice(&flip.node.points);
    let mut jacobians = flip.node.jacobians.clone();
    jacobians.extend_from_slice(&flip.node.jacobians);
    let start = Node {
        parameter: flip.parameter,
        points,
        jacobians,
        residual: 0.0,
        tangent,
        slope: 0.0,
        iterations: 0,
    };
    let before = flip_test(&start.jacobians).unwrap_or(0.0);
    let mut amplitude = options.initial_step.min(1e-2);
    let mut found = None;
    while amplitude >= 1e-6 {
        if let Ok(node) = solver.along(&start, amplitude) {
            let gap = solver.gap(&node, solver.n / 2);
            let expected: Vec<f64> = start.tangent[..solver.continuous]
                .iter()
                .map(|t| 2.0 * amplitude * t)
                .collect();
            let share = dot(&gap, &expected) / dot(&expected, &expected);
            let inside = (options.range.0..=options.range.1).contains(&node.parameter);
            if inside && (0.5..1.5).contains(&share) && solver.size(&node.points) <= options.bound {
                found = Some(amplitude);
                let change = flip_test(&node.jacobians).map_or(0.0, |after| (after - before).abs());
                if change <= MULTIPLIER_STEP {
                    break;
                }
            }
        }
        amplitude *= 0.5;
    }
    let initial_step =
        found.ok_or_else(|| failed("no orbit of doubled period was found near it"))?;
    let options = ContinuationOptions {
        initial_step,
        min_step: options.min_step.min(initial_step),
        ..options.clone()
    };
    follow(&mut solver, start, &options, control)
}

/// Largest change of the distance of the multipliers from −1 in the first step.
const MULTIPLIER_STEP: f64 = 0.5;

/// v_0 … v_{n−1} with A_k v_k = v_{k+1}, v_n = −v_0.
fn antiperiodic_vector(node: &Node, d: usize) -> Option<Vec<f64>> {
    let n = node.jacobians.len();
    let mut jacobians = node.jacobians.clone();
    // −A_{n−1} v_{n−1} = v_0 closes the cycle periodically.
    let last = jacobians.last_mut()?;
    *last = -last.clone();
    let zeros = vec![0.0; n * d];
    let border: Vec<f64> = (0..n * d).map(|i| unit(i as u64) + 0.5).collect();
    let mut row: Vec<f64> = (0..d).map(|i| unit(1000 + i as u64) + 0.5).collect();
    let mut system = BlockCyclic::new(d, n);
    system.factor(&jacobians, &zeros, Some(&border));
    let mut out = vec![0.0; n * d];
    // The second pass uses the vector itself as border, for good conditioning.
    for _ in 0..2 {
        system.solve_bordered(&row, 0.0, 1.0, false, &mut out)?;
        let length = norm(&out[..d]);
        if !(length.is_finite() && length > 0.0) {
            return None;
        }
        row = out[..d].iter().map(|v| v / length).collect();
    }
    Some(out)
}
