//! Search for the best values: a rough fit that finds the branches, a fine one in standard errors,
//! and other initial values if the data are not described.

use nalgebra::DMatrix;

use super::FitOptions;
use super::branches::Rows;
use super::data::Data;
use super::effort::Part;
use super::jumps::Jump;
use super::parameters::Parameter;
use super::problem::{MAX_RINGING, Point, Problem};
use super::report::FitReport;
use super::solve::{Solution, minimise};
use super::statistics::{exceeding, persistence, range};
use nanotap_dynamics::control::Control;
use nanotap_dynamics::random::Random;
use nanotap_error::Error;

/// Problem and options of a search for the best values.
pub(super) struct Search<'a> {
    /// Sentences on what was done to the data before the fit.
    pub(super) preparation: &'a [String],
    pub(super) problem: Problem<'a>,
    pub(super) request: &'a FitOptions,
    pub(super) control: &'a Control<'a>,
}

/// A fit with known branches.
pub(super) struct SearchedFit {
    pub(super) solution: Solution<Point>,
    pub(super) noise: Vec<f64>,
    pub(super) jumps: Vec<Jump>,
    pub(super) candidates: Vec<Rows>,
    pub(super) steps: usize,
}

/// Standard error of a rough fit, as a fraction of a column's spread.
pub(super) const ROUGH_ERROR: f64 = 0.03;
/// Rough standard errors above which a residual counts by its logarithm.
pub(super) const ROBUST_LIMIT: f64 = 3.0;
/// Largest number of rows of a curve in a rough fit.
const MAX_ROUGH_ROWS: usize = 50;
/// Mean squared rough residual above which the data are not described.
const MAX_MISFIT: f64 = 1.0;
/// Number of residuals of a column from which on their signs distinguish noise from a misfit.
const MIN_RESIDUALS: usize = 12;
/// Largest mean squared residual of a description, relative to the column's spread.
const SMALL_MISFIT: f64 = 0.1;
/// Largest correlation of neighbouring residuals of noise, in standard errors.
const MAX_CORRELATION: f64 = 2.0;
/// Probability of chi2 below which the model does not describe the data.
pub(super) const MIN_PROBABILITY: f64 = 1e-6;
/// Relative difference below which two misfits are equal.
const MISFIT_TOLERANCE: f64 = 1e-3;
/// Relative difference below which two misfits of rough fits are equal.
const ROUGH_TOLERANCE: f64 = 0.02;
/// Mean cost of a value up to which rough fits are not converged well enough to be compared.
const MIN_ROUGH: f64 = 0.01;
/// Jumps of a force curve there and back.
const JUMPS: usize = 2;
/// Cost of a row without an orbit in a rough fit.
const LOST_COST: f64 = 100.0;
/// Relative change of a standard error from one round to the next that is far from settled.
const UNSETTLED: f64 = 0.1;
/// Largest number of times that branches are assigned again.
const MAX_ROUNDS: usize = 6;

impl<'a> Search<'a> {
    pub(super) fn run(&self) -> Result<FitReport, Error> {
        let mut best: Option<SearchedFit> = None;
        let mut others: Vec<SearchedFit> = Vec::new();
        let mut least_rough = 0.0;
        let mut tried = 0;
        for start in self.starts() {
            if self.control.is_cancelled() || tried > 0 && self.problem.effort.ends(Part::Starts) {
                break;
            }
            tried += 1;
            let (x, rough) = self.rough(start);
            // A minimum that is not lower is not computed in full, where a rough fit tells.
            let tolerance = ROUGH_TOLERANCE * least_rough;
            if least_rough > MIN_ROUGH && rough > least_rough - tolerance {
                if rough <= least_rough + tolerance {
                    break;
                }
                continue;
            }
            let found = self.fine(x);
            if let Some(report) = self.control.progress {
                report(tried, self.request.starts.max(1));
            }
            let Some(found) = found else { continue };
            least_rough = if best.is_some() {
                least_rough.min(rough)
            } else {
                rough
            };
            let good = self.describes(&found) && self.is_trusted(&found);
            let misfit = self.misfit(&found);
            let least = best.as_ref().map(|best| self.misfit(best));
            if least.is_none_or(|least| misfit < least) {
                others.extend(best.replace(found));
            } else {
                others.push(found);
            }
            // Two initial values that lead to the same minimum are enough to accept it.
            if good || least.is_some_and(|least| (misfit - least).abs() <= MISFIT_TOLERANCE * least)
            {
                break;
            }
        }
        let best = best.ok_or_else(|| {
            if self.control.is_cancelled() {
                Error::new(
                    nanotap_error::ErrorKind::Stopped,
                    "stopped before the first fit was finished",
                )
            } else {
                Error::numerics(format!(
                    "no periodic orbit was found for the data, from {tried} initial value(s)"
                ))
                .remedy("change the case, or give {bounds} and more {starts}")
            }
        })?;
        let is_accepted = self.describes(&best) && self.is_trusted(&best);
        let (best, rivals) = if self.request.rivals && is_accepted {
            self.rivals(best, others)
        } else {
            (best, Vec::new())
        };
        Ok(self.report(best, &rivals, tried))
    }

    /// Initial values, each computed when it is needed: those of a curve near by, if there is one; those of
    /// a scan, if it finds better ones than the case's, and those of the case; then others within the bounds
    /// or a factor of four, with the best offset of the distance.
    fn starts(&self) -> impl Iterator<Item = Vec<f64>> {
        let mut random = Random::new(self.request.seed ^ 0x9e37_79b9_7f4a_7c15);
        let parameters = self.problem.parameters;
        let near = &self.request.near;
        let value_near = |p: &Parameter| near.iter().find(|(name, _)| *name == p.name);
        let near = parameters
            .iter()
            .map(|p| value_near(p).map(|(_, value)| value.clamp(p.bounds.0, p.bounds.1)));
        let near: Option<Vec<f64>> = near.collect();
        let own: Vec<f64> = parameters.iter().map(|p| p.start).collect();
        let scan = std::iter::once_with({
            let own = own.clone();
            move || self.scanned(&own)
        });
        let further = std::iter::repeat_with(move || {
            let start = parameters.iter().map(|p| {
                let u = random.uniform();
                let (mut low, mut high) = if p.start > 0.0 && p.bounds.0 >= 0.0 {
                    (0.25 * p.start, 4.0 * p.start)
                } else {
                    (p.start - p.size, p.start + p.size)
                };
                if self.request.bounds.0.iter().any(|b| b.name == p.name) {
                    (low, high) = p.bounds;
                }
                let (low, high) = (low.max(p.bounds.0), high.min(p.bounds.1));
                if low > 0.0 {
                    low * nanotap_arithmetic::powf(high / low, u)
                } else {
                    low + u * (high - low)
                }
            });
            let start: Vec<f64> = start.collect();
            self.with_best_offset(&start).unwrap_or(start)
        });
        let first = near.into_iter().chain(scan.flatten()).chain([own]);
        first.chain(further).take(self.request.starts.max(1))
    }

    /// The problem with other weights.
    pub(super) fn weighted(&self, noise: Vec<f64>, robust: Option<f64>) -> Problem<'a> {
        Problem {
            noise,
            robust,
            jumps: Vec::new(),
            ..self.problem
        }
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.problem.parameters.iter().map(|p| p.bounds).collect()
    }

    /// Standard errors before any are known.
    pub(super) fn rough_noise(&self) -> Vec<f64> {
        let columns = self.problem.data.columns.iter();
        columns
            .map(|c| ROUGH_ERROR * c.spread.max(f64::MIN_POSITIVE))
            .collect()
    }

    /// Fits from initial values until branches and parameters are approximately right, and returns
    /// the mean cost of a value; infinite without a fit.
    fn rough(&self, x: Vec<f64>) -> (Vec<f64>, f64) {
        self.rough_within(x, MAX_ROUGH_ROWS, MAX_ROUNDS)
    }

    /// The same with at most so many rows of a curve, and so many assignments of branches.
    pub(super) fn rough_within(
        &self,
        mut x: Vec<f64>,
        rows: usize,
        rounds: usize,
    ) -> (Vec<f64>, f64) {
        let mut mean = f64::INFINITY;
        let mut problem = self.weighted(self.rough_noise(), Some(ROBUST_LIMIT));
        // Given errors are much smaller; they are used in the end, as are all rows.
        let plain = rough_data(problem.data, rows);
        problem.data = &plain;
        let mut before: Option<Vec<usize>> = None;
        let mut known: Option<Vec<Rows>> = None;
        for _ in 0..rounds {
            if self.control.is_cancelled() {
                break;
            }
            let (point, candidates) = problem.discover(&x, known.as_deref());
            if self.control.is_cancelled() {
                break;
            }
            known = Some(candidates);
            let branches = branches_of(&point);
            if before.as_ref() == Some(&branches) {
                break;
            }
            let count = problem.data.count() as f64;
            match minimise(&problem, x.clone(), point, &self.bounds(), 1e-4 * count) {
                Some(solution) => {
                    // Rows without an orbit cost as those that are far off.
                    let lost = solution.point.iter().filter(|row| row.lost).count() as f64;
                    mean = (solution.cost + LOST_COST * lost) / count;
                    x = solution.x;
                }
                None => break,
            }
            before = Some(branches);
        }
        (x, mean)
    }

    /// Continues the fit to the minimum in standard errors.
    pub(super) fn fine(&self, mut x: Vec<f64>) -> Option<SearchedFit> {
        let mut noise = self.rough_noise();
        let mut found: Option<SearchedFit> = None;
        let mut steps = 0;
        for _ in 0..MAX_ROUNDS {
            if self.control.is_cancelled() {
                break;
            }
            let problem = self.weighted(noise.clone(), None);
            // The parameters change little from here on; but a branch that ended too early reaches
            // its last row now.
            let is_whole = |found: &&SearchedFit| !found.solution.point.iter().any(|row| row.lost);
            let known = found.as_ref().filter(is_whole);
            let known = known.map(|found| found.candidates.as_slice());
            let (mut point, candidates) = problem.discover(&x, known);
            if self.control.is_cancelled() {
                break;
            }
            if point.iter().all(|row| row.lost) {
                return None;
            }
            let branches = branches_of(&point);
            noise = self.noise(&x, &point, &self.shared_freedom());
            let mut problem = self.weighted(noise.clone(), None);
            if self.request.jumps {
                problem.find_jumps(&x, &mut point);
            }
            let solution = minimise(&problem, x.clone(), point, &self.bounds(), 1e-8);
            let solution = match solution {
                None if self.control.is_cancelled() => break,
                solution => solution?,
            };
            steps += solution.iterations;
            x.clone_from(&solution.x);
            let freedom = self.freedom_of_columns(&solution.jacobian);
            let after = self.noise(&x, &solution.point, &freedom);
            let settled = noise
                .iter()
                .zip(&after)
                .all(|(a, b)| (a - b).abs() <= 1e-3 * a);
            let same = found
                .as_ref()
                .is_some_and(|found| branches_of(&found.solution.point) == branches);
            found = Some(SearchedFit {
                solution,
                noise: noise.clone(),
                jumps: problem.jumps,
                candidates,
                steps,
            });
            if settled && same {
                return found;
            }
            noise = after;
        }
        // Noise that is far from settled, as that of data without any, is that of the last residuals.
        found.map(|found| {
            let mut all = found.noise.iter().zip(&noise);
            if all.all(|(a, b)| (a / b - 1.0).abs() < UNSETTLED) {
                found
            } else {
                self.with_noise(found, noise)
            }
        })
    }

    /// The same fit with other standard errors of the columns that give none.
    fn with_noise(&self, mut found: SearchedFit, noise: Vec<f64>) -> SearchedFit {
        let columns = noise.len();
        for (row, of) in self.problem.data.rows().enumerate() {
            for (column, new) in noise.iter().enumerate() {
                if of.errors[column].is_none() {
                    let factor = found.noise[column] / new;
                    let at = row * columns + column;
                    found.solution.residuals[at] *= factor;
                    found.solution.jacobian.row_mut(at).scale_mut(factor);
                }
            }
        }
        found.solution.cost = found.solution.residuals.norm_squared();
        found.noise = noise;
        found
    }

    /// Standard error of a value in each column, from its residuals and their degrees of freedom;
    /// zero for a column without residuals.
    fn noise(&self, x: &[f64], point: &Point, freedom: &[f64]) -> Vec<f64> {
        let columns = self.problem.data.columns.iter().enumerate();
        columns
            .map(|(index, column)| {
                let squares = self.relative_squares(x, point, index);
                let mean = squares / freedom[index].max(1.0);
                // Rounding of the model.
                mean.sqrt()
                    .max(1e-10 * column.spread)
                    .max(f64::MIN_POSITIVE)
            })
            .collect()
    }

    /// Degrees of freedom of the columns before the leverages of the rows are known: the parameters
    /// belong to all values equally.
    fn shared_freedom(&self) -> Vec<f64> {
        let data = self.problem.data;
        let part = 1.0 - self.problem.parameters.len() as f64 / data.count() as f64;
        let count = |index: usize| {
            data.rows()
                .filter(|row| row.values[index].is_some())
                .count()
        };
        (0..data.columns.len())
            .map(|index| part * count(index) as f64)
            .collect()
    }

    /// Degrees of freedom of the columns: rows with an effect minus the sum of their leverages.
    pub(super) fn freedom_of_columns(&self, jacobian: &DMatrix<f64>) -> Vec<f64> {
        let data = self.problem.data;
        let columns = data.columns.len();
        let basis = range(jacobian);
        let mut freedom = vec![0.0; columns];
        for (row, of) in data.rows().enumerate() {
            for (column, freedom) in freedom.iter_mut().enumerate() {
                if of.values[column].is_some() {
                    *freedom += 1.0 - basis.row(row * columns + column).norm_squared();
                }
            }
        }
        freedom
    }

    /// Sum of the squared differences of a column in units of the rows' relative errors.
    pub(super) fn relative_squares(&self, x: &[f64], point: &Point, column: usize) -> f64 {
        let rows = self.problem.rows();
        let known = rows.iter().zip(point.iter()).filter(|(_, p)| !p.lost);
        known
            .filter_map(|((curve, row), point)| {
                let value = point.values[column];
                let difference = self.problem.difference(x, *curve, row, column, value)?;
                Some((difference / row.relative[column]).powi(2))
            })
            .sum()
    }

    /// Model minus measured values of a column, for rows with both.
    pub(super) fn differences(&self, x: &[f64], point: &Point, column: usize) -> Vec<f64> {
        let curves = self.problem.data.curves.iter().enumerate();
        let rows = curves.flat_map(|(curve, of)| of.rows.iter().map(move |row| (curve, row)));
        rows.zip(point.iter())
            .filter(|(_, point)| !point.lost)
            .filter_map(|((curve, row), point)| {
                let value = point.values[column];
                self.problem.difference(x, curve, row, column, value)
            })
            .collect()
    }

    /// Mean squared residual relative to the spreads; rows without an orbit count fully.
    fn misfit(&self, found: &SearchedFit) -> f64 {
        let data = self.problem.data;
        let (mut sum, mut count) = (0.0, 0);
        for (index, column) in data.columns.iter().enumerate() {
            let differences = self.differences(&found.solution.x, &found.solution.point, index);
            count += differences.len();
            let size = column.spread.max(f64::MIN_POSITIVE);
            sum += differences.iter().map(|d| (d / size).powi(2)).sum::<f64>();
        }
        let lost = data.count() - count.min(data.count());
        (sum + lost.saturating_sub(self.ringing()) as f64) / data.count() as f64
    }

    /// Most rows that may be lost without a doubt: a force curve rings after its jumps.
    fn ringing(&self) -> usize {
        if self.problem.data.is_force_curve() {
            JUMPS * (MAX_RINGING + 1) * self.problem.data.curves.len()
        } else {
            0
        }
    }

    /// True if all standard errors were given.
    pub(super) fn all_given(&self) -> bool {
        let rows = self.problem.data.rows();
        let mut values = rows.flat_map(|row| row.values.iter().zip(&row.errors));
        values.all(|(value, error)| value.is_none() || error.is_some())
    }

    /// Number of measured values with an orbit, and of jumps, minus parameters.
    pub(super) fn freedom(&self, found: &SearchedFit) -> usize {
        let (x, point) = (&found.solution.x, &found.solution.point);
        let columns = 0..self.problem.data.columns.len();
        let values: usize = columns.map(|c| self.differences(x, point, c).len()).sum();
        (values + found.jumps.len())
            .saturating_sub(self.problem.parameters.len())
            .max(1)
    }

    /// True if the model describes the data: the residuals are small, or noise.
    fn describes(&self, found: &SearchedFit) -> bool {
        (self.misfit(found) < MAX_MISFIT * ROUGH_ERROR * ROUGH_ERROR || self.leaves_noise(found))
            && (!self.all_given() || self.probability(found) > MIN_PROBABILITY)
    }

    /// True if no test distinguishes the residuals from noise and no parameter ended at a limit of
    /// what is physical.
    fn is_trusted(&self, found: &SearchedFit) -> bool {
        let all = self.problem.parameters.iter().zip(&found.solution.x);
        let mut limited = all.filter(|(p, _)| p.is_limited);
        let inside =
            limited.all(|(p, value)| *value == 0.0 || (p.bounds.0 < *value && *value < p.bounds.1));
        inside && self.not_noise(found).is_empty()
    }

    /// True if the residuals are smaller than the spread, do not keep their sign from row to row,
    /// and have no outlier, as far as there are enough of them.
    fn leaves_noise(&self, found: &SearchedFit) -> bool {
        let (x, point) = (&found.solution.x, &found.solution.point);
        let lost = point.iter().filter(|row| row.lost).count();
        let columns = self.problem.data.columns.iter().enumerate();
        lost <= self.ringing()
            && columns.into_iter().all(|(index, column)| {
                let left = self.differences(x, point, index);
                let squares: f64 = left.iter().map(|d| (d / column.spread).powi(2)).sum();
                let largest = left
                    .iter()
                    .fold(0.0, |m: f64, d| m.max((d / column.spread).abs()));
                let count = left.len() as f64;
                // The largest of n normal deviates is about √(2 ln n).
                let usual = (2.0 * nanotap_arithmetic::ln(count)).sqrt() + 0.5;
                left.len() >= MIN_RESIDUALS
                    && largest < usual * (squares / count).sqrt()
                    && squares < SMALL_MISFIT * count
                    && persistence(&left) < MAX_CORRELATION
            })
    }

    pub(super) fn probability(&self, found: &SearchedFit) -> f64 {
        exceeding(self.chi2(found), self.freedom(found) as f64)
    }
}

/// The branch of every row.
pub(super) fn branches_of(point: &Point) -> Vec<usize> {
    point.iter().map(|row| row.branch).collect()
}

/// The data without their errors, and of a curve of more than `rows` every n-th row.
fn rough_data(data: &Data, rows: usize) -> Data {
    let mut rough = data.clone();
    for curve in &mut rough.curves {
        let stride = curve.rows.len().div_ceil(rows).max(1);
        curve.rows = curve.rows.iter().step_by(stride).cloned().collect();
        for row in &mut curve.rows {
            row.errors.iter_mut().for_each(|error| *error = None);
        }
    }
    rough
}
