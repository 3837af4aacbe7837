//! Bias of a smoothed force, added to its standard errors.
//!
//! The standard errors of the penalised least squares hold for a force that is as smooth everywhere as
//! it is on average. At a kink, and between rows that are far apart, it is not resolved.

use nanotap_arithmetic::exp;

use super::nodes::Nodes;
use super::smooth::Smooth;

/// Part of a range of distances without rows that counts as the width of the average.
const GAP: f64 = 0.6;
/// Distance over which a bias decays, in such widths.
const DECAY: f64 = 1.0 / 3.0;

/// Standard errors of a decrease of the force at the far end above which it is significant.
const SIGNIFICANT_DECREASE: f64 = 2.0;

/// Upper estimate of the error of the level of the force. A constant force has no first harmonic, so the rows determine the
/// force up to a constant, and it is taken as zero beyond the last node. If the force still falls off
/// at `far`, the closest approach of the farthest row, the constant is that of a tail: of the slowest
/// of the usual ones, the van der Waals force of a sphere, which goes as the distance to the power −2.
pub(super) fn level(force: &Smooth, nodes: &Nodes, far: f64) -> f64 {
    // The tail halves between these distances.
    let near = far / std::f64::consts::SQRT_2;
    if near <= nodes.0[0] {
        return 0.0;
    }
    let at = |x: f64| {
        let (k, weight) = nodes.place(x);
        let nearest = if weight < 0.5 { k } else { k + 1 };
        let nearest = nearest.min(force.coefficients.len() - 1);
        [nodes.value(&force.coefficients, x), force.error(nearest)]
    };
    let ([inner, inner_error], [outer, outer_error]) = (at(near), at(far));
    let decrease = inner - outer;
    if decrease.abs()
        > SIGNIFICANT_DECREASE * (inner_error * inner_error + outer_error * outer_error).sqrt()
    {
        decrease.abs() + outer.abs()
    } else {
        0.0
    }
}

/// Adds to standard errors what is not known between rows: `values` are those of a function at the
/// distances `x`, `measured` those at the sorted closest approaches of the rows. Between two rows each
/// value between theirs is as likely, and what lies outside is doubtful by as much; beyond the last row all of
/// it is an assumption.
pub(super) fn widen_between(values: &mut [[f64; 2]], x: &[f64], measured: &[(f64, f64)]) {
    for ([value, error], x) in values.iter_mut().zip(x) {
        let above = measured.partition_point(|(closest, _)| closest <= x);
        let at = |k: usize| measured.get(k).map_or(0.0, |(_, value)| *value);
        let (one, other) = (at(above.saturating_sub(1)), at(above));
        let (low, high) = (one.min(other), one.max(other));
        let bias = if above == measured.len() {
            value.abs()
        } else {
            (*value - value.clamp(low, high)).abs() + (high - low) / 12f64.sqrt()
        };
        *error = (*error * *error + bias * bias).sqrt();
    }
}

/// Adds the bias to the variances of the force: its largest curvature near a node times 3/4 of the
/// variance of a uniform average that is as wide as the node's own, or as a gap between the sorted
/// closest approaches. Beyond the last of them the force is an assumption, and its bias the force.
/// A bias acts on the nodes nearby, too.
pub(super) fn widen(force: &mut Smooth, nodes: &Nodes, closest: &[f64]) {
    let (x, values) = (&nodes.0, &force.coefficients);
    let count = values.len();
    let value = |k: usize| values.get(k).copied().unwrap_or(0.0);
    let slope = |k: usize| (value(k + 1) - value(k)) / (x[k + 1] - x[k]);
    let curvature = |k: usize| 2.0 * (slope(k) - slope(k - 1)) / (x[k + 1] - x[k - 1]);
    let curvatures: Vec<f64> = (1..count).map(|k| curvature(k).abs()).collect();
    let biases: Vec<[f64; 2]> = (0..count)
        .map(|k| {
            let above = closest.partition_point(|at| *at <= x[k]);
            let spacing = 0.5 * (x[k + 1] - x[k.saturating_sub(1)]);
            let own = spacing / force.averages.row(k).norm_squared();
            if above == closest.len() {
                return [value(k), own];
            }
            let gap = if above == 0 {
                0.0
            } else {
                closest[above] - closest[above - 1]
            };
            let width = own.max(GAP * gap);
            let near = (1..count).filter(|j| (x[*j] - x[k]).abs() <= 0.5 * width);
            let largest = near.map(|j| curvatures[j - 1]).fold(0.0, f64::max);
            [largest * width * width / 16.0, width]
        })
        .collect();
    for k in 0..count {
        let decayed = biases
            .iter()
            .zip(x)
            .map(|([bias, width], at)| bias.abs() * exp(-(x[k] - at).abs() / (DECAY * width)));
        let bias = decayed.fold(0.0, f64::max);
        force.covariance[(k, k)] += bias * bias;
    }
}
