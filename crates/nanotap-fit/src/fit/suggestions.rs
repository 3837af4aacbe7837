//! Corrections and terms of the instrument that the residuals of a fit show.
//!
//! Each candidate that is not free is added to the parameters at the value that changes nothing. Its
//! column of the Jacobian, less what the free parameters can describe, gives to first order by how
//! much the squared residuals, and with them Akaike's criterion, would fall. The best candidate is
//! reported, then the best one of what it leaves.
//!
//! Fails by naming an effect of the instrument where the law is wrong: both leave residuals that are
//! not noise.

use nalgebra::{DMatrix, DVector};
use nanotap_quantity::number::shortest;

use super::parameters::{Parameter, Target, nuisance};
use super::problem::Problem;
use super::report::Suggestion;
use super::search::{Search, SearchedFit};
use super::solve::LeastSquares as _;
use super::statistics::{range, span};
use super::terms::{PERIODS, Term, periods};

/// Least fall of Akaike's criterion that is reported: noise reaches it with one of the candidates in
/// less than one of 200 fits.
const MIN_FALL: f64 = 14.0;
/// Largest number of suggestions.
const MAX_SUGGESTIONS: usize = 3;
/// Part of a column that the free parameters must leave, so that it is not one of them.
const MIN_PART: f64 = 1e-3;
/// Fewest rows per period of interference.
const ROWS_PER_PERIOD: f64 = 4.0;

/// A correction that might be added, with its effect on the residuals.
struct Candidate {
    /// Names of its parameters.
    key: String,
    target: Target,
    unit: String,
    /// Value that changes nothing.
    neutral: f64,
    /// Period of interference, m.
    period: Option<f64>,
    /// Number of parameters, and how many tries are equivalent to the search for the period.
    parameters: f64,
    tries: f64,
    /// Change of the residuals by its parameters.
    columns: DMatrix<f64>,
}

/// What is left of the residuals with a candidate.
struct Effect {
    fall: f64,
    correlation: f64,
    value: f64,
    residuals: DVector<f64>,
    basis: DMatrix<f64>,
}

impl Search<'_> {
    /// Corrections that the residuals of a fit show, the clearest first.
    pub(super) fn suggestions(&self, found: &SearchedFit) -> Vec<Suggestion> {
        // To first order nothing follows from a fit that has not found the curve.
        let lost = found.solution.point.iter().filter(|row| row.lost).count();
        if self.is_nothing(found) || 2 * lost > found.solution.point.len() {
            return Vec::new();
        }
        let problem = self.problem_of(found);
        let Some(candidates) = self.candidates(&problem, found) else {
            return Vec::new();
        };
        let mut residuals = found.solution.residuals.clone();
        let columns = self.problem.data.columns.len();
        for (row, point) in found.solution.point.iter().enumerate() {
            if point.lost {
                residuals.rows_mut(row * columns, columns).fill(0.0);
            }
        }
        let mut basis = range(&found.solution.jacobian);
        let mut suggested: Vec<Suggestion> = Vec::new();
        while suggested.len() < MAX_SUGGESTIONS {
            let is_new = |of: &&Candidate| suggested.iter().all(|known| known.key != of.key);
            let effects = candidates.iter().filter(is_new).filter_map(|candidate| {
                let effect = self.effect(found, candidate, &residuals, &basis)?;
                Some((candidate, effect))
            });
            let best = effects.max_by(|a, b| a.1.fall.total_cmp(&b.1.fall));
            let Some((candidate, effect)) = best.filter(|(_, effect)| effect.fall > MIN_FALL)
            else {
                break;
            };
            let free = self.request.free.iter().cloned();
            let known = suggested.iter().map(|s| s.key.clone());
            let free = free.chain(known).chain([candidate.key.clone()]);
            suggested.push(Suggestion {
                key: candidate.key.clone(),
                value: candidate.period.unwrap_or(effect.value),
                unit: candidate.unit.clone(),
                fall_of_aic: effect.fall,
                correlation: effect.correlation,
                free: free.collect(),
                words: self.words(candidate, &effect),
            });
            (residuals, basis) = (effect.residuals, effect.basis);
        }
        suggested
    }

    /// The corrections that these data could have and that are not free.
    fn candidates(&self, problem: &Problem<'_>, found: &SearchedFit) -> Option<Vec<Candidate>> {
        let data = self.problem.data;
        let mut names: Vec<(String, &str)> = Vec::new();
        for column in &data.columns {
            // The zero of a lock-in amplifier is known, and an angle has no scale.
            let is_amplitude = matches!(column.quantity.name(), "first_harmonic" | "amplitude");
            let of_column = ["offset", "scale", "tilt", "curvature", "drag"];
            let of_column = of_column.into_iter().filter(|what| match *what {
                "offset" => !is_amplitude,
                "scale" => !column.quantity.is_angle(),
                _ => true,
            });
            names.extend(of_column.map(|what| (column.name.clone(), what)));
        }
        names.extend(["offset", "drift", "backlash"].map(|what| ("gap".to_owned(), what)));
        let own = self.problem.parameters;
        let added = names.into_iter().filter_map(|(of, what)| {
            let name = format!("{of}.{what}");
            let parameter = nuisance(self.problem.case, data, &name, &of, what).ok()?;
            let is_free = own.iter().any(|p| p.target == parameter.target);
            (!is_free).then_some(parameter)
        });
        let added: Vec<Parameter> = added.collect();
        let all: Vec<Parameter> = own.iter().chain(&added).cloned().collect();
        let extended = Problem {
            parameters: &all,
            ..problem.clone()
        };
        let neutral = |parameter: &Parameter| match parameter.target {
            Target::Scale(_) => 1.0,
            _ => 0.0,
        };
        let mut x = found.solution.x.clone();
        x.extend(added.iter().map(neutral));
        let rows = found.solution.residuals.len();
        let jacobian = extended.jacobian(&x, &mut found.solution.point.clone())?;
        let single = added.iter().enumerate().map(|(k, parameter)| Candidate {
            key: parameter.name.clone(),
            target: parameter.target,
            unit: parameter.unit(data, self.problem.case),
            neutral: neutral(parameter),
            period: None,
            parameters: 1.0,
            tries: 1.0,
            columns: jacobian.view((0, own.len() + k), (rows, 1)).into_owned(),
        });
        let mut candidates: Vec<Candidate> = single.collect();
        for column in 0..data.columns.len() {
            candidates.extend(self.interference(problem, found, column));
        }
        Some(candidates)
    }

    /// Interference in a column, one candidate per period.
    fn interference(
        &self,
        problem: &Problem<'_>,
        found: &SearchedFit,
        column: usize,
    ) -> Vec<Candidate> {
        let data = self.problem.data;
        let name = format!("{}.interference", data.columns[column].name);
        let target = Target::Term(Term::Sine, column);
        let is_free = self.problem.parameters.iter().any(|p| p.target == target);
        let of = data.columns[column].name.as_str();
        let possible = nuisance(self.problem.case, data, &name, of, "interference_sine");
        if is_free || possible.is_err() {
            return Vec::new();
        }
        let rows = problem.rows();
        let known = rows.iter().filter(|(_, row)| row.values[column].is_some());
        let range = span(known.clone().map(|(_, row)| row.depth()));
        let width = range[1] - range[0];
        let [low, high] = PERIODS;
        let fewest = ROWS_PER_PERIOD * width / known.count() as f64;
        let columns = data.columns.len();
        let of_period = |period: f64| {
            let count = found.solution.residuals.len();
            let mut change = DMatrix::zeros(count, 2);
            for (index, ((_, row), point)) in
                rows.iter().zip(found.solution.point.iter()).enumerate()
            {
                if point.lost || row.values[column].is_none() {
                    continue;
                }
                let angle = std::f64::consts::TAU * row.depth() / period;
                let (sine, cosine) = nanotap_arithmetic::sin_cos(angle);
                let error = problem.error(row, column);
                change[(index * columns + column, 0)] = sine / error;
                change[(index * columns + column, 1)] = cosine / error;
            }
            change
        };
        let tries = width / low - width / high;
        let all = periods(range, [low.max(fewest), high]).into_iter();
        let candidate = |period: f64| Candidate {
            key: name.clone(),
            target,
            unit: "m".to_owned(),
            neutral: 0.0,
            period: Some(period),
            parameters: 3.0,
            tries: tries.max(1.0),
            columns: of_period(period),
        };
        all.map(candidate).collect()
    }

    /// The effect of a candidate on residuals, where `basis` spans what is free already.
    fn effect(
        &self,
        found: &SearchedFit,
        candidate: &Candidate,
        residuals: &DVector<f64>,
        basis: &DMatrix<f64>,
    ) -> Option<Effect> {
        let mut basis = basis.clone();
        let mut left = residuals.clone();
        let (mut value, mut part) = (0.0, 0.0);
        for column in candidate.columns.column_iter() {
            let own = column.into_owned();
            // Twice: the first projection leaves a rounding error of the whole.
            let mut further = &own - &basis * basis.tr_mul(&own);
            further -= &basis * basis.tr_mul(&further);
            let size = further.norm();
            if size.is_nan() || size <= MIN_PART * own.norm() || size == 0.0 {
                return None;
            }
            let direction = further / size;
            let along = direction.dot(&left);
            value = candidate.neutral - along / size;
            part = -along;
            left -= along * &direction;
            let last = basis.ncols();
            basis = basis.insert_column(last, 0.0);
            basis.set_column(last, &direction);
        }
        let squares = residuals.norm_squared();
        let correlation = if candidate.columns.ncols() == 1 {
            part / squares.sqrt()
        } else {
            (1.0 - left.norm_squared() / squares).max(0.0).sqrt()
        };
        let price = 2.0 * candidate.parameters + 2.0 * nanotap_arithmetic::ln(candidate.tries);
        Some(Effect {
            fall: self.fall_of_deviance(found, residuals, &left, &basis) - price,
            correlation,
            value,
            residuals: left,
            basis,
        })
    }

    /// By how much −2 ln L falls with other residuals. A standard error that was estimated is that
    /// of the residuals.
    fn fall_of_deviance(
        &self,
        found: &SearchedFit,
        before: &DVector<f64>,
        after: &DVector<f64>,
        basis: &DMatrix<f64>,
    ) -> f64 {
        let data = self.problem.data;
        let columns = data.columns.len();
        let rows = data.rows().zip(found.solution.point.iter());
        let rows: Vec<_> = rows.collect();
        let mut fall = before.norm_squared() - after.norm_squared();
        for column in 0..columns {
            let (mut freedom, mut squares) = (0.0, [0.0, 0.0]);
            for (index, (row, point)) in rows.iter().enumerate() {
                let estimated = row.values[column].is_some() && row.errors[column].is_none();
                if point.lost || !estimated {
                    continue;
                }
                let at = index * columns + column;
                freedom += 1.0 - basis.row(at).norm_squared();
                squares[0] += before[at].powi(2);
                squares[1] += after[at].powi(2);
            }
            let [first, last] = squares;
            if freedom > 0.0 && last > 0.0 {
                fall += freedom * nanotap_arithmetic::ln(first / last) - (first - last);
            }
        }
        fall
    }

    fn words(&self, candidate: &Candidate, effect: &Effect) -> String {
        let data = self.problem.data;
        let name = |column: usize| data.columns[column].name.as_str();
        let shows = match (candidate.target, candidate.period) {
            (Target::Term(_, column), Some(period)) => format!(
                "{} carries a sinusoid, as by the interference of light of {:.0} nm",
                name(column),
                2e9 * period
            ),
            (Target::Term(Term::Tilt, column), _) => {
                format!("the baseline of {} is tilted", name(column))
            }
            (Target::Term(Term::Curvature, column), _) => {
                format!("the baseline of {} is curved", name(column))
            }
            (Target::Term(Term::Drag, column), _) => format!(
                "{} differs between approach and retract, as by the drag of the medium",
                name(column)
            ),
            (Target::Term(Term::Drift, _), _) => "the distance drifts".to_owned(),
            (Target::Term(..), _) => {
                "approach and retract have different zeros of the distance".to_owned()
            }
            (Target::Scale(column), _) => format!("{} has another sensitivity", name(column)),
            (Target::Offset(column), _) => format!("{} has an offset", name(column)),
            (Target::Place(_) | Target::Key(_), _) => "the distance has another zero".to_owned(),
        };
        let value = if let Some(period) = candidate.period {
            format!("a period of {:.0} nm", 1e9 * period)
        } else {
            let value = format!("{:.2e}", effect.value);
            let unit = match candidate.unit.as_str() {
                "1" => String::new(),
                unit => format!(" {unit}"),
            };
            format!(
                "about {}{unit}",
                shortest(value.parse().unwrap_or(effect.value))
            )
        };
        format!(
            "the residuals look as if {shows}: with {} free ({value}) Akaike's criterion falls by some \
             {:.0}, to first order; its correlation with the residuals is {:+.2}",
            candidate.key, effect.fall, effect.correlation
        )
    }
}
