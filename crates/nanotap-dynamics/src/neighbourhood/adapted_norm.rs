//! A norm in which a stable monodromy matrix contracts in every step.
//!
//! The Euclidean distance to a stable orbit may grow at first (complex multipliers in badly scaled
//! coordinates). With H = Σ_k (Mᵀ/ρ)^k W (M/ρ)^k for a rate ρ between the spectral radius and 1, ‖M
//! δ‖_H ≤ ρ ‖δ‖_H for every δ: the linearised distance decreases by the factor ρ in every return.
//! The sum is computed by doubling (squared Smith iteration), so rates near 1 are as cheap.
//!
//! Fails (returns `None`) if the spectral radius is not below 1, or so close to 1 that H is not
//! positive definite after rounding.

use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{DMatrix, DVector};

/// A few units in the last place.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// The norm ‖δ‖_H = |Lᵀδ|, H = L Lᵀ.
#[derive(Clone, Debug)]
pub(crate) struct AdaptedNorm {
    d: usize,
    /// Lᵀ, row major: row i has its first nonzero entry at column i.
    upper: Vec<f64>,
    upper_matrix: DMatrix<f64>,
    /// The matrix L⁻ᵀ, d × d.
    inverse: DMatrix<f64>,
    /// Contraction rate of the linearised return map in this norm.
    rate: f64,
}

impl AdaptedNorm {
    /// The norm for a monodromy matrix with this spectral radius.
    pub(crate) fn new(monodromy: &DMatrix<f64>, spectral_radius: f64) -> Option<Self> {
        let d = monodromy.nrows();
        let usable = d > 0
            && monodromy.ncols() == d
            && spectral_radius < 1.0
            && monodromy.iter().all(|v| v.is_finite());
        if !usable {
            return None;
        }
        // Half way to 1: H is ill-conditioned for rates near the spectral radius.
        let rate = 0.5 * (1.0 + spectral_radius);
        let mut balanced = monodromy.clone();
        let weights = balance_parlett_reinsch(&mut balanced);
        let mut h = DMatrix::from_diagonal(&weights.map(|w| 1.0 / (w * w)));
        let mut power = monodromy / rate;
        for _ in 0..60 {
            let term = power.transpose() * &h * &power;
            if term.iter().any(|v| !v.is_finite()) {
                return None;
            }
            let done = term.amax() <= 1e-14 * h.amax();
            h += term;
            if done {
                break;
            }
            power = &power * &power;
        }
        let upper = h.cholesky()?.l().transpose();
        let inverse = upper.clone().try_inverse()?;
        Some(Self {
            d,
            upper: upper.transpose().as_slice().to_vec(),
            upper_matrix: upper,
            inverse,
            rate,
        })
    }

    /// Contraction rate required of the nonlinear return map: half way between the linear rate and
    /// 1.
    pub(crate) fn rate_of_return(&self) -> f64 {
        0.5 * (1.0 + self.rate)
    }

    /// Returns the distance ‖a − b‖_H of two states.
    #[inline]
    pub(crate) fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.d {
            let row = &self.upper[i * self.d..(i + 1) * self.d];
            let mut v = 0.0;
            for j in i..self.d {
                v += row[j] * (a[j] - b[j]);
            }
            sum += v * v;
        }
        sum.sqrt()
    }

    /// Distance below which rounding hides any contraction: the sum of the closing error of the
    /// orbit and a few units in the last place of its state.
    pub(crate) fn floor(&self, center: &[f64], image: &[f64]) -> f64 {
        let off: Vec<f64> = center
            .iter()
            .enumerate()
            .map(|(i, x)| {
                x * if i % 2 == 0 {
                    1.0 + ROUNDING
                } else {
                    1.0 - ROUNDING
                }
            })
            .collect();
        10.0 * (self.distance(center, image) + self.distance(center, &off))
    }

    /// Half widths of the bounding box of the unit ball, one per coordinate.
    pub(crate) fn extents(&self) -> Vec<f64> {
        self.inverse.row_iter().map(|r| r.norm()).collect()
    }

    /// Radius of the ball whose largest half width is `scale`.
    pub(crate) fn radius(&self, scale: f64) -> f64 {
        scale / self.extents().into_iter().fold(0.0, f64::max)
    }

    /// The vector on the unit ball for a `direction` on the Euclidean unit sphere: L⁻ᵀ direction.
    pub(crate) fn unit_vector(&self, direction: &[f64], out: &mut [f64]) {
        for (o, row) in out.iter_mut().zip(self.inverse.row_iter()) {
            *o = row.iter().zip(direction).map(|(a, b)| a * b).sum();
        }
    }

    /// Lᵀ `away`, whose Euclidean length is ‖`away`‖_H.
    pub(crate) fn coordinates(&self, away: &DVector<f64>) -> DVector<f64> {
        &self.upper_matrix * away
    }

    /// True if a matrix has an operator norm of at most `rate` in this norm: the
    /// matrix rate² − BᵀB, B = Lᵀ A L⁻ᵀ, has a Cholesky factor.
    pub(crate) fn is_contracted_by(&self, matrix: &DMatrix<f64>, rate: f64) -> bool {
        let image = &self.upper_matrix * matrix * &self.inverse;
        let mut slack = image.transpose() * image;
        slack.neg_mut();
        for i in 0..self.d {
            slack[(i, i)] += rate * rate;
        }
        slack.iter().all(|v| v.is_finite()) && slack.cholesky().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The defining property, for a badly scaled, non-normal matrix whose Euclidean norm is a
    /// thousand times its spectral radius.
    #[test]
    fn the_linear_map_contracts_by_the_rate() {
        let m = DMatrix::from_row_slice(2, 2, &[0.9, 700.0, 0.0, 0.85]);
        let norm = AdaptedNorm::new(&m, 0.9).unwrap();
        assert!((norm.rate - 0.95).abs() < 1e-15);
        assert!(norm.is_contracted_by(&m, 0.95 + 1e-9));
        // No norm of a matrix is below its spectral radius.
        assert!(!norm.is_contracted_by(&m, 0.89));
        let x = [0.3, -0.2];
        let y = [0.9 * 0.3 - 700.0 * 0.2, -0.85 * 0.2];
        let zero = [0.0, 0.0];
        assert!(norm.distance(&y, &zero) <= 0.95 * norm.distance(&x, &zero) * (1.0 + 1e-12));
    }

    #[test]
    fn an_unstable_matrix_has_none() {
        assert!(AdaptedNorm::new(&DMatrix::from_row_slice(1, 1, &[1.1]), 1.1).is_none());
        assert!(AdaptedNorm::new(&DMatrix::from_row_slice(1, 1, &[1.0]), 1.0).is_none());
    }
}
