//! Piecewise-linear functions of the distance: their nodes, integrals and roughness.

use nalgebra::DMatrix;
use nanotap_arithmetic::asin;
use std::f64::consts::PI;

/// Growth of the spacing beyond the finely resolved range.
const GROWTH: f64 = 1.08;
/// Least number of evenly spaced nodes. With fewer, the penalty on the roughness would hold for less
/// than the range over which a force changes.
const MIN_EVEN_NODES: f64 = 60.0;
/// Largest number of evenly spaced nodes.
const MAX_EVEN_NODES: f64 = 200.0;
/// Upper limit of the number of nodes beyond them.
const MAX_OUTER_NODES: usize = 200;

/// Increasing distances between which a function is linear. It is constant below the first and
/// zero from the last on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Nodes(pub(super) Vec<f64>);

impl Nodes {
    /// Nodes from one spacing below `low`, evenly spaced up to `fine` (`widest` apart, or more
    /// over a long range),
    /// then with growing spacing to beyond `far`.
    pub(super) fn new(low: f64, fine: f64, far: f64, widest: f64) -> Self {
        let width = (fine - low).max(MIN_EVEN_NODES * widest);
        let mut spacing = widest.max(width / MAX_EVEN_NODES);
        let count = (width / spacing).ceil() as usize + 2;
        let mut nodes: Vec<f64> = (0..count)
            .map(|k| low + (k as f64 - 1.0) * spacing)
            .collect();
        let mut last = nodes[count - 1];
        for _ in 0..MAX_OUTER_NODES {
            if last >= far + spacing {
                break;
            }
            spacing *= GROWTH;
            last += spacing;
            nodes.push(last);
        }
        Self(nodes)
    }

    /// How many coefficients a function has: the last node's value is zero.
    pub(super) fn unknowns(&self) -> usize {
        self.0.len() - 1
    }

    /// Spacing of the evenly spaced nodes.
    pub(super) fn spacing(&self) -> f64 {
        self.0[1] - self.0[0]
    }

    /// The interval of `x` and the weight of its upper node.
    pub(super) fn place(&self, x: f64) -> (usize, f64) {
        let nodes = &self.0;
        let at = nodes.partition_point(|node| *node <= x).saturating_sub(1);
        let at = at.min(nodes.len() - 2);
        let weight = (x - nodes[at]) / (nodes[at + 1] - nodes[at]);
        (at, weight.clamp(0.0, 1.0))
    }

    /// Value at `x` of the function with these coefficients.
    pub(super) fn value(&self, coefficients: &[f64], x: f64) -> f64 {
        Self::at(coefficients, self.place(x))
    }

    /// Value at a [`place`](Self::place) of the function with these coefficients.
    pub(super) fn at(coefficients: &[f64], (at, weight): (usize, f64)) -> f64 {
        let coefficient = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
        (1.0 - weight) * coefficient(at) + weight * coefficient(at + 1)
    }

    /// Mean error of the linear interpolation about each node, F″h²/12, of a function with these
    /// coefficients.
    pub(super) fn interpolation_errors(&self, coefficients: &[f64]) -> Vec<f64> {
        let nodes = &self.0;
        let value = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
        let slope = |k: usize| (value(k + 1) - value(k)) / (nodes[k + 1] - nodes[k]);
        let inner = (1..self.unknowns()).map(|k| {
            let width = 0.5 * (nodes[k + 1] - nodes[k - 1]);
            (slope(k) - slope(k - 1)) * width / 12.0
        });
        std::iter::once(0.0).chain(inner).collect()
    }

    /// Second differences times the product of the neighbouring spacings.
    pub(super) fn roughness(&self) -> DMatrix<f64> {
        let (nodes, count) = (&self.0, self.unknowns());
        let mut rows = DMatrix::zeros(count - 1, count);
        for k in 0..count - 1 {
            let (before, after) = (nodes[k + 1] - nodes[k], nodes[k + 2] - nodes[k + 1]);
            rows[(k, k)] = 2.0 * after / (before + after);
            rows[(k, k + 1)] = -2.0;
            if k + 2 < count {
                rows[(k, k + 2)] = 2.0 * before / (before + after);
            }
        }
        rows
    }

    /// Weights of the coefficients in the average `kernel` of a sinusoidal oscillation of
    /// `amplitude` that comes as near as `closest`.
    pub(super) fn average(&self, kernel: Kernel, closest: f64, amplitude: f64) -> Vec<f64> {
        let nodes = &self.0;
        let mut weights = vec![0.0; nodes.len()];
        let at = |x: f64| (x - closest) / amplitude - 1.0;
        let integrals = |u: f64| kernel.integrals(u.clamp(-1.0, 1.0));
        let (mut low, mut before) = (at(nodes[0]), integrals(at(nodes[0])));
        // Constant below the first node.
        weights[0] += before[0] - kernel.integrals(-1.0)[0];
        for k in 0..nodes.len() - 1 {
            let high = at(nodes[k + 1]);
            let after = integrals(high);
            let (zeroth, first) = (after[0] - before[0], after[1] - before[1]);
            let upper = (first - low * zeroth) / (high - low);
            weights[k] += zeroth - upper;
            weights[k + 1] += upper;
            (low, before) = (high, after);
        }
        weights.truncate(self.unknowns());
        weights.iter().map(|weight| 2.0 / PI * weight).collect()
    }
}

/// Averages of a force over a sinusoidal oscillation, (2/π) ∫ F(D + a (1 + u)) w(u) du over −1 … 1.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kernel {
    /// First cosine coefficient: w = u/√(1 − u²).
    Cosine,
    /// Twice the mean: w = 1/√(1 − u²).
    Mean,
    /// Damping: w = √(1 − u²).
    Damping,
}

impl Kernel {
    /// Antiderivatives of w(u) and u w(u).
    fn integrals(self, u: f64) -> [f64; 2] {
        let root = (1.0 - u * u).max(0.0).sqrt();
        let arc = asin(u);
        match self {
            Self::Cosine => [-root, 0.5 * (arc - u * root)],
            Self::Mean => [arc, -root],
            Self::Damping => [0.5 * (arc + u * root), -root * root * root / 3.0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_has_mean_only_and_a_spring_its_stiffness() {
        let nodes = Nodes(vec![-1.0, 0.5, 3.0, 4.0, 60.0]);
        let of = |kernel, coefficients: [f64; 4]| -> f64 {
            let weights = nodes.average(kernel, 0.0, 1.0);
            weights.iter().zip(coefficients).map(|(w, c)| w * c).sum()
        };
        let constant = [1.0; 4];
        assert!(of(Kernel::Cosine, constant).abs() < 1e-15);
        assert!((of(Kernel::Mean, constant) - 2.0).abs() < 1e-15);
        assert!((of(Kernel::Damping, constant) - 1.0).abs() < 1e-15);
        let spring = [-1.0, 0.5, 3.0, 4.0];
        assert!((of(Kernel::Cosine, spring) - 1.0).abs() < 1e-15);
        assert!((nodes.value(&spring, 1.5) - 1.5).abs() < 1e-15);
        assert_eq!(nodes.value(&spring, 90.0), 0.0);
    }
}
