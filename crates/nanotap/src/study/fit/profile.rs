//! 95 % intervals by the profile of the likelihood: where the least chi2 with one parameter held
//! exceeds the least of all by the square of Student's (or the normal) quantile.

use nalgebra::DMatrix;

use super::problem::{Point, Problem};
use super::solve::{LeastSquares as _, Solution, minimise};
use super::statistics::Information;

/// Looks at the profile on each side.
const LOOKS: usize = 6;
/// Steps of the other parameters at each look.
const STEPS: usize = 4;
/// What a step must promise of chi2 to be taken.
const FLAT: f64 = 1e-3;
/// How well the quantile is met, in standard errors.
const CLOSE: f64 = 0.01;

/// The interval of each parameter; no end where it is not determined, or beyond a bound.
pub(super) fn intervals(
    problem: &Problem<'_>,
    best: &Solution<Point>,
    information: &Information,
    width: f64,
) -> Vec<[Option<f64>; 2]> {
    (0..best.x.len())
        .map(|k| {
            let error = information.errors[k];
            [-1.0, 1.0].map(|side| {
                let error = error.filter(|error| *error > 0.0)?;
                end(problem, best, information, (k, error), side, width)
            })
        })
        .collect()
}

/// Where the profile of a parameter reaches the quantile on one side: of the root of what chi2
/// gained, which is straight where the model is linear, by regula falsi from the standard error.
fn end(
    problem: &Problem<'_>,
    best: &Solution<Point>,
    information: &Information,
    (k, error): (usize, f64),
    side: f64,
    width: f64,
) -> Option<f64> {
    let bounds: Vec<(f64, f64)> = problem.parameters.iter().map(|p| p.bounds).collect();
    let (low, high) = bounds[k];
    let mut inner = (0.0, 0.0);
    let mut outer: Option<(f64, f64)> = None;
    // In standard errors from the best value.
    let mut t = width;
    for _ in 0..LOOKS {
        let value = best.x[k] + side * t * error;
        if value < low || value > high {
            return None;
        }
        // Where the others would be if the model were linear.
        let shift = side * t * error / information.covariance[(k, k)];
        let x: Vec<f64> = (0..best.x.len())
            .map(|j| {
                let to = best.x[j] + shift * information.covariance[(j, k)];
                to.clamp(bounds[j].0, bounds[j].1)
            })
            .collect();
        let gained = problem.point(&x, (&best.x, &best.point)).and_then(|point| {
            let least = least(problem, x, point, best, k)?;
            Some((least - best.cost).max(0.0).sqrt())
        });
        // Where a branch ends the profile has a wall.
        let gained = gained.unwrap_or(f64::INFINITY);
        if (gained - width).abs() < CLOSE {
            return Some(value);
        }
        if gained < width {
            inner = (t, gained);
        } else {
            outer = Some((t, gained));
        }
        t = match outer {
            None => t * (width / gained.max(0.25 * width)).min(3.0),
            Some((wall, at)) if !at.is_finite() => 0.5 * (inner.0 + wall),
            Some((far, at)) => {
                let share = (width - inner.1) / (at - inner.1);
                inner.0 + share.clamp(0.05, 0.95) * (far - inner.0)
            }
        };
    }
    let value = best.x[k] + side * t * error;
    (value >= low && value <= high).then_some(value)
}

/// The least chi2 with parameter `k` held, from a point near it; `None` where rows have no orbit
/// that had one.
///
/// By steps with the Jacobian at the best values, which is good near by; where these do not end in
/// a minimum, because the valley of chi2 bends, by a fit of the others.
fn least(
    problem: &Problem<'_>,
    x: Vec<f64>,
    point: Point,
    best: &Solution<Point>,
    k: usize,
) -> Option<f64> {
    let lost = |point: &Point| point.iter().filter(|row| row.lost).count();
    let most = lost(&best.point);
    if lost(&point) > most {
        return None;
    }
    let steps = few_steps(problem, x, point, &best.jacobian, k)?;
    if steps.least.is_some() {
        return steps.least;
    }
    let held = steps.x[k];
    let parameters = problem.parameters.iter().enumerate();
    let bounds: Vec<(f64, f64)> = parameters
        .map(|(j, p)| if j == k { (held, held) } else { p.bounds })
        .collect();
    let solution = minimise(problem, steps.x, steps.point, &bounds, FLAT)?;
    (lost(&solution.point) <= most).then_some(solution.cost)
}

/// Where a few steps led.
struct Steps {
    x: Vec<f64>,
    point: Point,
    /// chi2 there, if no further step promises to make it less.
    least: Option<f64>,
}

/// As far as a few steps with a Jacobian of near by come.
fn few_steps(
    problem: &Problem<'_>,
    mut x: Vec<f64>,
    mut point: Point,
    jacobian: &DMatrix<f64>,
    k: usize,
) -> Option<Steps> {
    let others = jacobian.clone().remove_column(k);
    let mut residuals = problem.residuals(&x, &point);
    let mut cost = residuals.norm_squared();
    if others.ncols() == 0 {
        let least = Some(cost);
        return Some(Steps { x, point, least });
    }
    // What the data do not determine stays where it is.
    let mut normal = others.tr_mul(&others);
    for j in 0..normal.ncols() {
        normal[(j, j)] = (1.0 + 1e-10) * normal[(j, j)] + f64::MIN_POSITIVE;
    }
    let factor = normal.lu();
    let mut least = None;
    for _ in 0..STEPS {
        let step = factor.solve(&others.tr_mul(&residuals))?;
        let promised = cost - (&residuals - &others * &step).norm_squared();
        if promised.is_nan() || promised <= FLAT {
            least = Some(cost);
            break;
        }
        let mut next = x.clone();
        for (index, step) in (0..x.len()).filter(|j| *j != k).zip(step.iter()) {
            let (low, high) = problem.parameters[index].bounds;
            next[index] = (x[index] - step).clamp(low, high);
        }
        let Some(at) = problem.point(&next, (&x, &point)) else {
            break;
        };
        let then = problem.residuals(&next, &at);
        if then.norm_squared() >= cost {
            break;
        }
        (x, point, cost) = (next, at, then.norm_squared());
        residuals = then;
    }
    Some(Steps { x, point, least })
}
