//! 95 % intervals by the profile of the likelihood: where the least chi2 with one parameter held
//! exceeds the least of all by the square of Student's (or the normal) quantile.

use super::problem::{Point, Problem};
use super::solve::{
    LeastSquares as _, Solution, minimise, moved, slope_kept, step_between, stepped,
};
use super::statistics::Information;

/// Looks at the profile on each side.
const LOOKS: usize = 6;
/// Steps of the other parameters at each look.
const STEPS: usize = 4;
/// What a step must promise of chi2 to be taken.
const FLAT: f64 = 1e-3;
/// How well the quantile is met, in standard errors.
const CLOSE: f64 = 0.01;

/// What the profiles tell.
pub(super) enum Profile {
    /// The interval of each parameter; no end where it is not determined, or beyond a bound.
    Intervals(Vec<[Option<f64>; 2]>),
    /// Parameters at which chi2 is less than at the best values: those are a local minimum.
    Lower(Vec<f64>),
}

/// The intervals of half-width `width` in standard errors, unless chi2 is lower by more than
/// `deeper` next to them.
pub(super) fn profile(
    problem: &Problem<'_>,
    best: &Solution<Point>,
    information: &Information,
    width: f64,
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
                (width, deeper),
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

/// Where chi2 is least with one parameter held.
struct Least {
    x: Vec<f64>,
    point: Point,
    chi2: f64,
}

/// Where the profile of a parameter reaches the quantile on one side: of the root of what chi2
/// gained, which is straight where the model is linear, by regula falsi from the standard error.
/// Each look begins where the one before it ended inside the interval, as the others went from the
/// best values to there.
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
    // What chi2 gained and where, so many standard errors from the best value.
    let mut inner: (f64, f64, Option<Least>) = (0.0, 0.0, None);
    let mut outer: Option<(f64, f64)> = None;
    let mut t = width;
    for _ in 0..LOOKS {
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
                    // Where it would be if the model were linear.
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
        // Where a branch ends the profile has a wall.
        let gained = found.as_ref().map_or(f64::INFINITY, |found| {
            (found.chi2 - best.cost).max(0.0).sqrt()
        });
        if (gained - width).abs() < CLOSE {
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
) -> Option<Least> {
    let lost = |point: &Point| point.iter().filter(|row| row.lost).count();
    let most = lost(&best.point);
    if lost(&point) > most {
        return None;
    }
    let Steps { x, point, least } = few_steps(problem, x, point, best, k)?;
    if let Some(chi2) = least {
        return Some(Least { x, point, chi2 });
    }
    let held = x[k];
    let parameters = problem.parameters.iter().enumerate();
    let bounds: Vec<(f64, f64)> = parameters
        .map(|(j, p)| if j == k { (held, held) } else { p.bounds })
        .collect();
    let solution = minimise(problem, x, point, &bounds, FLAT)?;
    (lost(&solution.point) <= most).then_some(Least {
        x: solution.x,
        point: solution.point,
        chi2: solution.cost,
    })
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
    best: &Solution<Point>,
    k: usize,
) -> Option<Steps> {
    let others = best.jacobian.clone().remove_column(k);
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
    Some(Steps { x, point, least })
}
