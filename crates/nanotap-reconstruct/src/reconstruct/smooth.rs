//! Linear least squares with a smoothness penalty whose weight follows from the evidence.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use nanotap_arithmetic::{ln, powf};

use nanotap_error::Error;

/// Decades of the weight that are tried, relative to the ratio of the traces.
const DECADES: [f64; 2] = [-12.0, 8.0];
/// Weights tried over all decades, then about the best of them.
const TRIALS: [usize; 2] = [21, 7];
/// Relative amount added to the diagonal of the normal equations.
const RIDGE: f64 = 1e-11;

/// A smooth function that describes measured values.
#[derive(Clone, Debug)]
pub(super) struct Smooth {
    /// Coefficients of the function: its values at all nodes but the last, where it is zero.
    pub(super) coefficients: Vec<f64>,
    /// Covariance of the coefficients.
    pub(super) covariance: DMatrix<f64>,
    /// What the coefficients are of the true ones without noise: each row is an average of them.
    pub(super) averages: DMatrix<f64>,
    /// Effective number of parameters: trace of the hat matrix.
    pub(super) freedom: f64,
    /// Mean squared residual in standard errors, dimensionless.
    pub(super) chi2: f64,
}

/// Normal equations in standard errors, with the penalty.
struct Equations<'a> {
    rows: DMatrix<f64>,
    values: DVector<f64>,
    normal: DMatrix<f64>,
    projected: DVector<f64>,
    roughness: &'a DMatrix<f64>,
    penalty: DMatrix<f64>,
    /// Weight at which normal equations and penalty have the same trace.
    balanced: f64,
}

/// Solution at one weight of the penalty.
struct Trial {
    coefficients: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    cost: f64,
    /// Factor of the variances: 1, or more where the residuals exceed the standard errors.
    scale: f64,
}

impl Smooth {
    /// The function whose weighted sums, `rows`, are `values` within `errors`.
    ///
    /// # Errors
    /// When the equations are singular at every weight.
    pub(super) fn of(
        rows: &DMatrix<f64>,
        values: &[f64],
        errors: &[f64],
        roughness: &DMatrix<f64>,
    ) -> Result<Self, Error> {
        let mut scaled = rows.clone();
        for (mut row, error) in scaled.row_iter_mut().zip(errors) {
            row /= *error;
        }
        let values =
            DVector::from_iterator(values.len(), values.iter().zip(errors).map(|(v, e)| v / e));
        let (normal, penalty) = (scaled.tr_mul(&scaled), roughness.tr_mul(roughness));
        let equations = Equations {
            projected: scaled.tr_mul(&values),
            balanced: normal.trace() / penalty.trace(),
            rows: scaled,
            values,
            normal,
            penalty,
            roughness,
        };
        let (decade, _) = equations.best(DECADES, TRIALS[0]);
        let step = (DECADES[1] - DECADES[0]) / (TRIALS[0] - 1) as f64;
        let near = [
            (decade - step).max(DECADES[0]),
            (decade + step).min(DECADES[1]),
        ];
        let (_, trial) = equations.best(near, TRIALS[1]);
        let trial = trial.ok_or_else(|| Error::numerics("the force has no smooth solution"))?;
        let residuals = equations.residuals(&trial.coefficients);
        let mut covariance = trial.factor.inverse();
        let averages = &covariance * &equations.normal;
        let freedom = averages.trace();
        covariance *= trial.scale;
        Ok(Self {
            coefficients: trial.coefficients.iter().copied().collect(),
            covariance,
            averages,
            freedom,
            chi2: residuals.norm_squared() / residuals.len() as f64,
        })
    }

    /// A function that is zero everywhere.
    pub(super) fn zero(unknowns: usize) -> Self {
        Self {
            coefficients: vec![0.0; unknowns],
            covariance: DMatrix::zeros(unknowns, unknowns),
            averages: DMatrix::zeros(unknowns, unknowns),
            freedom: 0.0,
            chi2: 0.0,
        }
    }

    /// A weighted sum of the coefficients, with its standard error.
    pub(super) fn sum(&self, weights: &[f64]) -> [f64; 2] {
        let value = weights.iter().zip(&self.coefficients).map(|(w, c)| w * c);
        let weights = DVector::from_column_slice(weights);
        let variance = weights.dot(&(&self.covariance * &weights));
        [value.sum(), variance.max(0.0).sqrt()]
    }

    /// Standard error of a coefficient.
    pub(super) fn error(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }
}

impl Equations<'_> {
    fn residuals(&self, coefficients: &DVector<f64>) -> DVector<f64> {
        &self.values - &self.rows * coefficients
    }

    /// The decade of least cost among `count` between `ends`.
    fn best(&self, ends: [f64; 2], count: usize) -> (f64, Option<Trial>) {
        let step = (ends[1] - ends[0]) / (count - 1) as f64;
        let mut best: (f64, Option<Trial>) = (ends[0], None);
        for k in 0..count {
            let decade = ends[0] + k as f64 * step;
            let Some(trial) = self.at(decade) else {
                continue;
            };
            if best.1.as_ref().is_none_or(|known| trial.cost < known.cost) {
                best = (decade, Some(trial));
            }
        }
        best
    }

    /// Minus twice the logarithm of the evidence at a weight, the noise no less than stated.
    fn at(&self, decade: f64) -> Option<Trial> {
        let weight = self.balanced * powf(10.0, decade);
        let mut matrix = &self.normal + &self.penalty * weight;
        for k in 0..matrix.nrows() {
            matrix[(k, k)] *= 1.0 + RIDGE;
        }
        let factor = Cholesky::new(matrix)?;
        let coefficients = factor.solve(&self.projected);
        let residuals = self.residuals(&coefficients).norm_squared();
        let rough = (self.roughness * &coefficients).norm_squared();
        let count = self.values.len() as f64;
        let squares = residuals + weight * rough;
        let scale = (squares / count).max(1.0);
        let diagonal = factor.l_dirty().diagonal();
        let determinant: f64 = diagonal.iter().map(|d| 2.0 * ln(*d)).sum();
        let rank = self.roughness.nrows() as f64;
        let cost = squares / scale + count * ln(scale) + determinant - rank * ln(weight);
        cost.is_finite().then_some(Trial {
            coefficients,
            factor,
            cost,
            scale,
        })
    }
}
