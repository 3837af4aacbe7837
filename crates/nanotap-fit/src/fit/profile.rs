//! 95 % intervals from the profile of the likelihood: where the least chi2 with one parameter fixed
//! exceeds the least of all by the square of Student's (or the normal) quantile.

use super::effort::Part;
use super::problem::{Point, Problem};
use super::solve::{
    LeastSquares as _, Solution, minimise_within, moved, slope_kept, step_between, stepped,
};
use super::statistics::Information;

/// Largest number of evaluations of the profile on each side.
const MAX_EVALUATIONS: usize = 6;
/// Largest number of steps of the other parameters per evaluation.
const MAX_STEPS: usize = 4;
/// Largest number of steps of a fit of the other parameters.
const MAX_MINIMISING: usize = 20;
/// Smallest predicted gain of chi2 for which a step is taken.
const MIN_GAIN: f64 = 1e-3;
/// Accuracy of the quantile, in standard errors.
const QUANTILE_TOLERANCE: f64 = 0.01;

/// Result of the profiles of the likelihood for all parameters.
pub(super) enum Profile {
    /// The interval of each parameter; an end is missing if it is undetermined or beyond a bound.
    Intervals(Vec<[Option<f64>; 2]>),
    /// Parameters with a smaller chi2 than the best values, which are therefore a local minimum.
    Lower(Vec<f64>),
}

/// Computes the intervals of half-widths `widths` in standard errors, unless chi2 nearby is lower by
/// more than `deeper`.
pub(super) fn profile(
    problem: &Problem<'_>,
    best: &Solution<Point>,
    information: &Information,
    widths: &[f64],
    deeper: f64,
) -> Profile {
    let mut intervals = Vec::new();
    for k in 0..best.x.len() {
        let mut ends = [None; 2];
        for (side, interval_end) in [-1.0, 1.0].into_iter().zip(&mut ends) {
            let Some(error) = information.errors[k].filter(|error| *error > 0.0) else {
                continue;
            };
            match end(
                problem,
                best,
                information,
                (k, error),
                side,
                (widths[k], deeper),
            ) {
                End::At(value) => *interval_end = Some(value),
                End::None => {}
                End::Lower(x) => return Profile::Lower(x),
            }
        }
        intervals.push(ends);
    }
    Profile::Intervals(intervals)
}

/// One end of an interval.
enum End {
    At(f64),
    None,
    Lower(Vec<f64>),
}

/// The minimum of chi2 with one parameter fixed.
struct ConstrainedMinimum {
    x: Vec<f64>,
    point: Point,
    chi2: f64,
}

/// The value of a parameter at which its profile reaches the quantile on one side. Regula falsi on
/// the square root of the gain of chi2, which is linear for a linear model, starting from the
/// standard error. Each evaluation starts from the end of the last one inside the interval.
fn end(
    problem: &Problem<'_>,
    best: &Solution<Point>,
    information: &Information,
    (k, error): (usize, f64),
    side: f64,
    (width, deeper): (f64, f64),
) -> End {
    let bounds: Vec<(f64, f64)> = problem.parameters.iter().map(|p| p.bounds).collect();
    let (low, high) = bounds[k];
    let at = |t: f64| stepped(best.x[k], side * t * error, low);
    // Gain of chi2 and the minimum, at this many standard errors from the best value.
    let mut inner: (f64, f64, Option<ConstrainedMinimum>) = (0.0, 0.0, None);
    let mut outer: Option<(f64, f64)> = None;
    let mut t = width;
    for _ in 0..MAX_EVALUATIONS {
        if problem.effort.ends(Part::Intervals) {
            break;
        }
        let value = at(t);
        if value < low || value > high {
            return End::None;
        }
        let (from, before) = match &inner.2 {
            Some(near) => (&near.x, &near.point),
            None => (&best.x, &best.point),
        };
        let x: Vec<f64> = (0..best.x.len())
            .map(|j| {
                let step = if j == k {
                    return value;
                } else if inner.2.is_some() {
                    let gone = step_between(best.x[j], from[j], bounds[j].0);
                    gone * t / inner.0
                } else {
                    // Its value for a linear model.
                    side * t * error * information.covariance[(j, k)]
                        / information.covariance[(k, k)]
                };
                stepped(best.x[j], step, bounds[j].0).clamp(bounds[j].0, bounds[j].1)
            })
            .collect();
        let found = problem
            .point(&x, (from, before))
            .and_then(|point| least(problem, x, point, best, k));
        if let Some(found) = &found
            && found.chi2 < best.cost - deeper
        {
            return End::Lower(found.x.clone());
        }
        // At the end of a branch the profile is discontinuous.
        let gained = found.as_ref().map_or(f64::INFINITY, |found| {
            (found.chi2 - best.cost).max(0.0).sqrt()
        });
        if (gained - width).abs() < QUANTILE_TOLERANCE {
            return End::At(value);
        }
        if gained < width {
            inner = (t, gained, found);
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
    let value = at(t);
    if value >= low && value <= high {
        End::At(value)
    } else {
        End::None
    }
}

/// The least chi2 with parameter `k` fixed, from a nearby point; `None` if rows lose their orbits.
///
/// It uses steps with the Jacobian at the best values, which is accurate nearby. If these do not
/// end in a minimum, because the valley of chi2 is curved, the other parameters are fitted.
fn least(
    problem: &Problem<'_>,
    x: Vec<f64>,
    point: Point,
    best: &Solution<Point>,
    k: usize,
) -> Option<ConstrainedMinimum> {
    let lost = |point: &Point| point.iter().filter(|row| row.lost).count();
    let most = lost(&best.point);
    if lost(&point) > most {
        return None;
    }
    let StepResult { x, point, least } = few_steps(problem, x, point, best, k)?;
    if let Some(chi2) = least {
        return Some(ConstrainedMinimum { x, point, chi2 });
    }
    let held = x[k];
    let parameters = problem.parameters.iter().enumerate();
    let bounds: Vec<(f64, f64)> = parameters
        .map(|(j, p)| if j == k { (held, held) } else { p.bounds })
        .collect();
    let solution = minimise_within(problem, x, point, &bounds, MIN_GAIN, MAX_MINIMISING)?;
    (lost(&solution.point) <= most).then_some(ConstrainedMinimum {
        x: solution.x,
        point: solution.point,
        chi2: solution.cost,
    })
}

/// Result of a few steps.
struct StepResult {
    x: Vec<f64>,
    point: Point,
    /// chi2 after them, if no further step promises to reduce it.
    least: Option<f64>,
}

/// Takes a few steps with the Jacobian of a nearby point.
fn few_steps(
    problem: &Problem<'_>,
    mut x: Vec<f64>,
    mut point: Point,
    best: &Solution<Point>,
    k: usize,
) -> Option<StepResult> {
    let others = best.jacobian.clone().remove_column(k);
    let mut residuals = problem.residuals(&x, &point);
    let mut cost = residuals.norm_squared();
    if others.ncols() == 0 {
        let least = Some(cost);
        return Some(StepResult { x, point, least });
    }
    // Combinations that the data do not determine are not changed.
    let mut normal = others.tr_mul(&others);
    for j in 0..normal.ncols() {
        normal[(j, j)] = (1.0 + 1e-10) * normal[(j, j)] + f64::MIN_POSITIVE;
    }
    let factor = normal.lu();
    let mut least = None;
    for _ in 0..MAX_STEPS {
        let step = factor.solve(&others.tr_mul(&residuals))?;
        let promised = cost - (&residuals - &others * &step).norm_squared();
        if promised.is_nan() || promised <= MIN_GAIN {
            least = Some(cost);
            break;
        }
        let mut next = x.clone();
        for (index, step) in (0..x.len()).filter(|j| *j != k).zip(step.iter()) {
            let bounds = problem.parameters[index].bounds;
            let kept = slope_kept(best.x[index], x[index], bounds.0);
            next[index] = moved(x[index], -step * kept, bounds);
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
    Some(StepResult { x, point, least })
}
