//! Least squares within bounds, by Levenberg and Marquardt's method.
//!
//! minimise ½|r(x)|² over low ≤ x ≤ high. A step solves (JᵀJ + λD²) p = −Jᵀr for the parameters
//! that no bound holds, D the largest column norms seen (Moré 1978), λ as Nielsen has it
//! (IMM-REP-1999-05); steps end at the bounds. The kept crate `levenberg-marquardt` knows no
//! bounds and stands on another version of nalgebra.
//!
//! Fails by stopping in a local minimum: that is what several starts are for.

use nalgebra::{DMatrix, DVector};

/// What is to be made small.
pub(super) trait LeastSquares {
    /// The model at some parameters, as far as derivatives need it.
    type Point;

    /// The model at `x`; `None` where there is none. `from` is a point already evaluated,
    /// at its parameters.
    fn point(&self, x: &[f64], from: (&[f64], &Self::Point)) -> Option<Self::Point>;

    /// The residuals.
    fn residuals(&self, x: &[f64], point: &Self::Point) -> DVector<f64>;

    /// Their derivatives, a column a parameter; `None` where they have none.
    fn jacobian(&self, x: &[f64], point: &mut Self::Point) -> Option<DMatrix<f64>>;
}

/// Where it ended.
pub(super) struct Solution<P> {
    pub(super) x: Vec<f64>,
    pub(super) point: P,
    /// |r|².
    pub(super) cost: f64,
    pub(super) jacobian: DMatrix<f64>,
    pub(super) iterations: usize,
}

/// Most steps, taken or refused.
const MOST_STEPS: usize = 60;

/// Minimises from `x` until a step promises less than
/// `enough` of |r|², or a part of 1e−10 of it.
pub(super) fn minimise<L: LeastSquares>(
    problem: &L,
    mut x: Vec<f64>,
    mut point: L::Point,
    bounds: &[(f64, f64)],
    enough: f64,
) -> Option<Solution<L::Point>> {
    let count = x.len();
    let mut residuals = problem.residuals(&x, &point);
    let mut jacobian = problem.jacobian(&x, &mut point)?;
    let mut scale = DVector::from_element(count, 0.0);
    let (mut damping, mut growth) = (1e-3, 2.0);
    let mut iterations = 0;
    for _ in 0..MOST_STEPS {
        let cost = residuals.norm_squared();
        let gradient = jacobian.tr_mul(&residuals);
        for j in 0..count {
            scale[j] = jacobian.column(j).norm().max(scale[j]);
        }
        // A bound holds a parameter that would leave it; so does what nothing depends on.
        let free: Vec<usize> = (0..count)
            .filter(|&j| {
                let (low, high) = bounds[j];
                let held_low = x[j] <= low && gradient[j] > 0.0;
                let held_high = x[j] >= high && gradient[j] < 0.0;
                scale[j] > 0.0 && !held_low && !held_high
            })
            .collect();
        if free.is_empty() {
            break;
        }
        let Some(step) = marquardt(&jacobian, &residuals, &free, &scale, damping) else {
            damping *= 10.0;
            continue;
        };
        let mut tried = x.clone();
        for (k, &j) in free.iter().enumerate() {
            tried[j] = (x[j] + step[k]).clamp(bounds[j].0, bounds[j].1);
        }
        let taken = DVector::from_fn(count, |j, _| tried[j] - x[j]);
        let linear = &residuals + &jacobian * &taken;
        let promised = cost - linear.norm_squared();
        if promised <= enough.max(1e-10 * cost) || taken.iter().all(|t| *t == 0.0) {
            break;
        }
        let better = problem.point(&tried, (&x, &point)).and_then(|at| {
            let residuals = problem.residuals(&tried, &at);
            let gained = cost - residuals.norm_squared();
            (gained > 0.0).then_some((at, residuals, gained / promised))
        });
        let accepted = better.and_then(|(mut at, residuals, ratio)| {
            let jacobian = problem.jacobian(&tried, &mut at)?;
            Some((at, residuals, ratio, jacobian))
        });
        if let Some((at, r, ratio, j)) = accepted {
            (x, point, residuals, jacobian) = (tried, at, r, j);
            iterations += 1;
            damping *= (1.0 - (2.0 * ratio - 1.0).powi(3)).clamp(1.0 / 9.0, 2.0);
            growth = 2.0;
        } else {
            damping *= growth;
            growth *= 2.0;
            if damping > 1e16 {
                break;
            }
        }
    }
    Some(Solution {
        cost: residuals.norm_squared(),
        x,
        point,
        jacobian,
        iterations,
    })
}

/// The step of the free parameters: least squares of [J; √λ D] p = [−r; 0] by QR.
fn marquardt(
    jacobian: &DMatrix<f64>,
    residuals: &DVector<f64>,
    free: &[usize],
    scale: &DVector<f64>,
    damping: f64,
) -> Option<DVector<f64>> {
    let (rows, columns) = (residuals.len(), free.len());
    let stacked = DMatrix::from_fn(rows + columns, columns, |i, k| {
        if i < rows {
            jacobian[(i, free[k])] / scale[free[k]]
        } else if i - rows == k {
            damping.sqrt()
        } else {
            0.0
        }
    });
    let right = DVector::from_fn(
        rows + columns,
        |i, _| {
            if i < rows { -residuals[i] } else { 0.0 }
        },
    );
    let qr = stacked.qr();
    let projected = qr.q().tr_mul(&right);
    let scaled = qr.r().solve_upper_triangular(&projected)?;
    let step = DVector::from_fn(columns, |k, _| scaled[k] / scale[free[k]]);
    step.iter().all(|s| s.is_finite()).then_some(step)
}
