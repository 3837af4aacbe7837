//! Least squares within bounds, by the Levenberg–Marquardt method.
//!
//! Minimises ½|r(x)|² over low ≤ x ≤ high. A step solves (JᵀJ + λD²) p = −Jᵀr for the parameters
//! that are not held by a bound, with D the largest column norms so far (Moré 1978) and λ by
//! Nielsen (IMM-REP-1999-05); steps end at the bounds. Parameters that cannot be zero are varied by
//! their logarithm, so that a stiffness changes by orders of magnitude in few steps and never
//! changes its sign. The crate `levenberg-marquardt` has no bounds and needs another version of
//! nalgebra.
//!
//! Fails by stopping in a local minimum, which several initial values avoid.

use nalgebra::{DMatrix, DVector};

/// A function to be minimised.
pub(super) trait LeastSquares {
    /// The model at some parameters, as far as derivatives need it.
    type Point;

    /// Evaluates the model at `x`; `None` if it does not exist. `from` is a known point and its
    /// parameters.
    fn point(&self, x: &[f64], from: (&[f64], &Self::Point)) -> Option<Self::Point>;

    /// Computes the residuals at `x`.
    fn residuals(&self, x: &[f64], point: &Self::Point) -> DVector<f64>;

    /// Derivatives of the residuals, one column per parameter; `None` if they do not exist.
    fn jacobian(&self, x: &[f64], point: &mut Self::Point) -> Option<DMatrix<f64>>;
}

/// Best values of a minimisation, with residuals and Jacobian there.
pub(super) struct Solution<P> {
    pub(super) x: Vec<f64>,
    pub(super) point: P,
    /// Sum of the squared residuals, |r|².
    pub(super) cost: f64,
    pub(super) residuals: DVector<f64>,
    pub(super) jacobian: DMatrix<f64>,
    pub(super) iterations: usize,
}

/// Largest number of steps, accepted or rejected.
const MAX_STEPS: usize = 60;
/// Largest damping; if no step with it lowers the cost, the minimisation stops.
const MAX_DAMPING: f64 = 1e16;
/// Largest change of a logarithm in one step.
const MAX_LOG_CHANGE: f64 = 2.0;
/// Change of the residuals, in standard errors, below which a value counts as zero.
const NEGLIGIBLE: f64 = 1e-3;

/// True if a value is varied by its logarithm: it is positive and cannot be negative.
fn by_logarithm(x: f64, low: f64) -> bool {
    low >= 0.0 && x > 0.0
}

/// The value after a step from `x`, whose lower bound is `low`.
pub(super) fn stepped(x: f64, step: f64, low: f64) -> f64 {
    if by_logarithm(x, low) {
        x * nanotap_arithmetic::exp(step / x)
    } else {
        x + step
    }
}

/// The step from `x` to another value.
pub(super) fn step_between(x: f64, to: f64, low: f64) -> f64 {
    if by_logarithm(x, low) {
        x * nanotap_arithmetic::ln(to / x)
    } else {
        to - x
    }
}

/// The value after a step that ends at the bounds.
pub(super) fn moved(x: f64, step: f64, (low, high): (f64, f64)) -> f64 {
    let most = if by_logarithm(x, low) {
        MAX_LOG_CHANGE * x
    } else {
        f64::INFINITY
    };
    stepped(x, step.clamp(-most, most), low).clamp(low, high)
}

/// The slope of a step at `x` relative to its slope at `from`, which is the same for logarithms.
pub(super) fn slope_kept(from: f64, x: f64, low: f64) -> f64 {
    if by_logarithm(x, low) && from > 0.0 {
        x / from
    } else {
        1.0
    }
}

/// Minimises from `x` until a step promises less than `enough` of |r|², or a fraction of 1e−10 of
/// it.
pub(super) fn minimise<L: LeastSquares>(
    problem: &L,
    x: Vec<f64>,
    point: L::Point,
    bounds: &[(f64, f64)],
    enough: f64,
) -> Option<Solution<L::Point>> {
    minimise_within(problem, x, point, bounds, enough, MAX_STEPS)
}

/// The same in at most so many steps, accepted or rejected.
pub(super) fn minimise_within<L: LeastSquares>(
    problem: &L,
    x: Vec<f64>,
    mut point: L::Point,
    bounds: &[(f64, f64)],
    enough: f64,
    steps: usize,
) -> Option<Solution<L::Point>> {
    let residuals = problem.residuals(&x, &point);
    let jacobian = problem.jacobian(&x, &mut point)?;
    let start = Solution {
        cost: residuals.norm_squared(),
        x,
        point,
        residuals,
        jacobian,
        iterations: 0,
    };
    let found = descend(problem, start, bounds, enough, steps);
    Some(match without_nothing(problem, &found, bounds) {
        Some(bare) => descend(problem, bare, bounds, enough, steps),
        None => found,
    })
}

/// Sets negligible values to their bound: a logarithm never reaches zero.
fn without_nothing<L: LeastSquares>(
    problem: &L,
    found: &Solution<L::Point>,
    bounds: &[(f64, f64)],
) -> Option<Solution<L::Point>> {
    let Solution { x, jacobian, .. } = found;
    let is_nothing = |j: usize| {
        let shows = x[j] * jacobian.column(j).norm();
        bounds[j].0 == 0.0 && x[j] > 0.0 && shows < NEGLIGIBLE
    };
    if !(0..x.len()).any(is_nothing) {
        return None;
    }
    let bare: Vec<f64> = (0..x.len())
        .map(|j| if is_nothing(j) { 0.0 } else { x[j] })
        .collect();
    let mut point = problem.point(&bare, (x, &found.point))?;
    let residuals = problem.residuals(&bare, &point);
    let cost = residuals.norm_squared();
    if cost > found.cost + NEGLIGIBLE * NEGLIGIBLE {
        return None;
    }
    let jacobian = problem.jacobian(&bare, &mut point)?;
    Some(Solution {
        cost,
        x: bare,
        point,
        residuals,
        jacobian,
        iterations: found.iterations,
    })
}

/// Levenberg–Marquardt steps from a point.
fn descend<L: LeastSquares>(
    problem: &L,
    from: Solution<L::Point>,
    bounds: &[(f64, f64)],
    enough: f64,
    steps: usize,
) -> Solution<L::Point> {
    let Solution {
        mut x,
        mut point,
        mut residuals,
        mut jacobian,
        mut iterations,
        ..
    } = from;
    let count = x.len();
    let mut scale = DVector::from_element(count, 0.0);
    let (mut damping, mut growth) = (1e-3, 2.0);
    for _ in 0..steps {
        let cost = residuals.norm_squared();
        // Units in which a step is one of the logarithm.
        let unit = |j: usize| {
            if by_logarithm(x[j], bounds[j].0) {
                x[j]
            } else {
                1.0
            }
        };
        let mut slopes = jacobian.clone();
        for j in 0..count {
            slopes.column_mut(j).scale_mut(unit(j));
            scale[j] = slopes.column(j).norm().max(scale[j]);
        }
        let gradient = slopes.tr_mul(&residuals);
        // Parameters at a bound that would leave it are fixed; so are those without an effect.
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
        let Some(step) = marquardt(&slopes, &residuals, &free, &scale, damping) else {
            damping *= 10.0;
            continue;
        };
        let mut tried = x.clone();
        for (k, &j) in free.iter().enumerate() {
            tried[j] = moved(x[j], step[k] * unit(j), bounds[j]);
        }
        let taken = DVector::from_fn(count, |j, _| {
            step_between(x[j], tried[j], bounds[j].0) / unit(j)
        });
        let linear = &residuals + &slopes * &taken;
        let promised = cost - linear.norm_squared();
        if promised <= enough.max(1e-10 * cost) || taken.iter().all(|t| *t == 0.0) {
            // A step that ended at a bound, or at the largest change of a logarithm, may promise
            // less than a shorter one.
            let whole = free
                .iter()
                .zip(step.iter())
                .all(|(&j, step)| (taken[j] - step).abs() <= 1e-9 * step.abs());
            if whole || damping > MAX_DAMPING {
                break;
            }
            damping *= growth;
            growth *= 2.0;
            continue;
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
            if damping > MAX_DAMPING {
                break;
            }
        }
    }
    Solution {
        cost: residuals.norm_squared(),
        x,
        point,
        residuals,
        jacobian,
        iterations,
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Deflections a/(1 + 10/k) + 0.1 c a² under loads a, where no c ≥ 0 fits.
    struct Springs;

    const LOADS: [f64; 4] = [1.0, 2.0, 3.0, 4.0];
    const TRUE: [f64; 2] = [3.0, -0.1];

    impl Springs {
        fn deflections(x: &[f64]) -> [f64; 4] {
            LOADS.map(|load| load / (1.0 + 10.0 / x[0]) + 0.1 * x[1] * load * load)
        }
    }

    impl LeastSquares for Springs {
        type Point = ();

        fn point(&self, _x: &[f64], _from: (&[f64], &())) -> Option<()> {
            Some(())
        }

        fn residuals(&self, x: &[f64], _point: &()) -> DVector<f64> {
            let (a, b) = (Self::deflections(x), Self::deflections(&TRUE));
            DVector::from_fn(4, |k, _| a[k] - b[k])
        }

        fn jacobian(&self, x: &[f64], _point: &mut ()) -> Option<DMatrix<f64>> {
            let by_stiffness = 10.0 / (x[0] + 10.0).powi(2);
            Some(DMatrix::from_fn(4, 2, |i, j| {
                LOADS[i] * if j == 0 { by_stiffness } else { 0.1 * LOADS[i] }
            }))
        }
    }

    #[test]
    fn stiffnesses_far_off_and_what_is_not_there_are_found() {
        let bounds = [(0.0, f64::INFINITY); 2];
        for stiffness in [1e-3, 1e3] {
            let start = vec![stiffness, 0.5];
            let found = minimise(&Springs, start, (), &bounds, 1e-16).unwrap();
            // With c = 0 the least squares of 1/(1 + 10/k) are Σ a d/Σ a² = 3/13 − 1/30.
            let ratio = 3.0 / 13.0 - 1.0 / 30.0;
            let best = 10.0 * ratio / (1.0 - ratio);
            assert!((found.x[0] / best - 1.0).abs() < 1e-6, "{:?}", found.x);
            assert_eq!(found.x[1].to_bits(), 0.0f64.to_bits(), "{:?}", found.x);
        }
    }
}
