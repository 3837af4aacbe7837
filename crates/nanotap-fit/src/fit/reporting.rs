//! Construction of the report from the best values.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use nanotap_case::{Case, Key};
use nanotap_quantity::number::shortest;

use super::MAX_PERIOD;
use super::branches::settle;
use super::data::{Column, Data, Row};
use super::jumps::Jump;
use super::parameters::{self, Parameter, Target};
use super::problem::{Problem, RowPoint};
use super::profile::{Profile, profile};
use super::report::{
    CurveCase, FitReport, FittedColumn, FittedJump, FittedParameter, FittedRow, Likelihood,
    OtherOrbit, Reading, RowLikelihood, Undetermined,
};
use super::search::{MIN_PROBABILITY, Search, SearchedFit, branches_of};
use super::solve::LeastSquares as _;
use super::statistics::{self, Information, Sequences, information, student};

/// Smallest reduction of chi2 near the best values that counts.
const MIN_REDUCTION: f64 = 0.1;
/// Largest number of times that a fit continues from a lower chi2 of its profile.
const MAX_CONTINUATIONS: usize = 4;
/// Level of the test whether the size of the residuals is that of noise, the only test that sees
/// much in few rows.
const LEVEL: f64 = 0.01;
/// Level of the test whether the signs of the residuals are those of noise.
const LEVEL_OF_SIGNS: f64 = 0.005;
/// Chance up to which the size of a column's residuals is named.
const LARGER: f64 = 0.05;
/// Fewest neighbouring rows whose residuals are tested for their signs.
const MIN_SEQUENCE: usize = 8;
/// Residuals below this part of a column's spread are rounding.
const MIN_RESIDUAL: f64 = 1e-5;
/// Half-width of a 95 % interval of a normal variable, in standard errors.
const STANDARD_ERRORS_95: f64 = 1.959_963_984_540_054;
/// Largest number of rows that a remark lists.
const MAX_LISTED_ROWS: usize = 8;

/// Standard errors from the end of the model's branch beyond which a jump contradicts the model. Its
/// place is between two rows, less than two of them from the middle.
const MAX_JUMP: f64 = 5.0;
/// So many rows of a force curve may lie beyond the end of their branch, which noise moves.
const MAX_ENDED: usize = 2;

impl Search<'_> {
    /// The problem with the standard errors and the jumps of a result.
    pub(super) fn problem_of(&self, found: &SearchedFit) -> Problem<'_> {
        let mut problem = self.weighted(found.noise.clone(), None);
        problem.jumps.clone_from(&found.jumps);
        problem
    }

    /// The likelihood of every row: −2 ln L of its values, without the places of jumps, because
    /// another law may have no fold.
    pub(super) fn likelihood(&self, found: &SearchedFit) -> Likelihood {
        let data = self.problem.data;
        let x = &found.solution.x;
        let rows = self
            .problem
            .rows()
            .into_iter()
            .zip(found.solution.point.iter());
        let row = |((curve, row), point): ((usize, &Row), &RowPoint)| {
            let known = (0..data.columns.len()).filter(|column| row.values[*column].is_some());
            let deviance = known.clone().map(|column| {
                let error =
                    row.errors[column].unwrap_or(row.relative[column] * found.noise[column]);
                let value = point.values[column];
                let difference = self.problem.difference(x, curve, row, column, value);
                let residual = if point.lost {
                    data.columns[column].spread / error
                } else {
                    difference.unwrap_or(0.0) / error
                };
                residual * residual + nanotap_arithmetic::ln(std::f64::consts::TAU * error * error)
            });
            RowLikelihood {
                row: (data.curves[curve].name.clone(), row.line),
                deviance: deviance.sum(),
                values: known.count(),
                lost: point.lost,
            }
        };
        let estimated = |column: &usize| {
            let mut rows = data.rows();
            rows.any(|row| row.values[*column].is_some() && row.errors[*column].is_none())
        };
        let estimated = (0..data.columns.len()).filter(estimated).count();
        Likelihood {
            rows: rows.map(row).collect(),
            parameters: self.problem.parameters.len() + estimated,
        }
    }

    /// Sum of the squared residuals of the priors.
    fn squared_priors(&self, found: &SearchedFit) -> f64 {
        let all = self.problem.prior_residuals(&found.solution.x);
        all.iter().map(|residual| residual * residual).sum()
    }

    /// Sum of the squared residuals of values and jumps.
    pub(super) fn chi2(&self, found: &SearchedFit) -> f64 {
        found.solution.cost - self.squared_priors(found)
    }

    /// Creates the report of a result from this many initial values.
    pub(super) fn report(
        &self,
        found: SearchedFit,
        rivals: &[SearchedFit],
        starts: usize,
    ) -> FitReport {
        let (found, intervals) = self.with_intervals(found);
        let found = &found;
        let rivals = self.report_rivals(found, &intervals, rivals);
        let (case, data) = (self.problem.case, self.problem.data);
        let parameters = self.problem.parameters;
        let problem = self.problem_of(found);
        let x = &found.solution.x;
        let information = self.information(found);
        let given = self.all_given();
        let shifts = self.by_stiffness(&problem, found, &information);
        let fitted = Self::fitted(&problem, found, &information, intervals, shifts.as_deref());
        let p_value = given.then(|| self.probability(found));
        let columns = self.columns(found);
        let misfit = self.not_noise(found);
        let (reason, mut remarks) = self.judge(found, p_value, &fitted, &misfit);
        remarks.extend(self.problem.effort.words());
        let undetermined = undetermined(&information, parameters, data);
        let swept = data.swept[0].key;
        let best = |case_of_curve: Case| case_of_curve.leaving_distance_as(case).to_toml();
        let cases = problem.cases(x).into_iter().map(best).enumerate();
        let cases: Vec<String> = cases
            .map(|(curve, file)| self.corrections(x, curve) + &file)
            .collect();
        let curves = data
            .curves
            .iter()
            .zip(&cases)
            .map(|(curve, file)| CurveCase {
                curve: curve.name.clone(),
                case_file: file.clone(),
            });
        let case_files = if parameters.iter().any(|p| p.curve.is_some()) {
            curves.collect()
        } else {
            Vec::new()
        };
        let likelihood = self.likelihood(found);
        let with_orbit = likelihood.with_orbit();
        let [aic, bic] = likelihood.criteria(&with_orbit);
        FitReport {
            chi2: self.chi2(found),
            degrees_of_freedom: self.freedom(found),
            p_value,
            aic,
            bic,
            rows_without_orbit: likelihood.rows.len() - with_orbit.len(),
            likelihood,
            law: None,
            laws: Vec::new(),
            fits: reason.is_none(),
            reason,
            misfit: !misfit.is_empty(),
            turned: false,
            remarks,
            preparation: self.preparation.to_vec(),
            rivals,
            suggestions: self.suggestions(found),
            undetermined,
            correlations: (0..parameters.len())
                .map(|i| information.correlations.row(i).iter().copied().collect())
                .collect(),
            columns,
            force_curves: Vec::new(),
            swept: swept.path().to_owned(),
            swept_unit: parameters::unit_of(swept).to_owned(),
            rows: rows(&problem, found),
            others: others(&problem, found),
            jumps: jumps(&problem, found),
            iterations: found.steps,
            starts,
            case_file: cases[0].clone(),
            case_files,
            cancelled: self.control.is_cancelled(),
            parameters: fitted,
        }
    }

    /// The columns with their residuals.
    fn columns(&self, found: &SearchedFit) -> Vec<FittedColumn> {
        let (case, data) = (self.problem.case, self.problem.data);
        let (x, point) = (&found.solution.x, &found.solution.point);
        let column = |(index, column): (usize, &Column)| {
            let differences = self.differences(x, point, index);
            let squares: f64 = differences.iter().map(|d| d * d).sum();
            let mut of = data.rows().filter(|row| row.values[index].is_some());
            FittedColumn {
                name: column.name.clone(),
                observable: column.quantity.name().to_owned(),
                unit: column.quantity.unit(case.is_physical()).to_owned(),
                residual: (squares / differences.len().max(1) as f64).sqrt(),
                standard_error: found.noise[index],
                estimated: of.any(|row| row.errors[index].is_none()),
            }
        };
        data.columns.iter().enumerate().map(column).collect()
    }

    /// A comment for the case file of a curve: the corrections of its data, as the option `start`
    /// takes them.
    fn corrections(&self, x: &[f64], curve: usize) -> String {
        let (case, data) = (self.problem.case, self.problem.data);
        let own = self
            .problem
            .parameters
            .iter()
            .zip(x)
            .filter(|(p, _)| p.is_of(curve) && !matches!(p.target, parameters::Target::Key(_)));
        let comment = own.map(|(p, value)| {
            let (name, value) = (&p.name, shortest(*value));
            match p.unit(data, case).as_str() {
                "1" => format!("# start: {name}={value}\n"),
                unit => format!("# start: {name}={value} {unit}\n"),
            }
        });
        comment.collect()
    }

    /// Information about the parameters from the Jacobian at the best values.
    pub(super) fn information(&self, found: &SearchedFit) -> Information {
        let parameters = self.problem.parameters.iter();
        let sizes: Vec<f64> = parameters
            .zip(&found.solution.x)
            .map(|(p, value)| match p.target {
                parameters::Target::Key(_) if *value != 0.0 => value.abs(),
                // Starts spread over a tenth of what the data could show at all.
                _ => 10.0 * p.size,
            })
            .collect();
        information(&found.solution.jacobian, &sizes)
    }

    /// The intervals of the parameters. If chi2 is lower near the best values, the fit continues
    /// from there.
    fn with_intervals(&self, mut found: SearchedFit) -> (SearchedFit, Vec<[Option<f64>; 2]>) {
        let mut rounds = MAX_CONTINUATIONS;
        loop {
            let information = self.information(&found);
            let widths = self.widths(&found, &information);
            let profiled = self.request.profile && !self.control.is_cancelled();
            let profiled = profiled.then(|| {
                let problem = self.problem_of(&found);
                let deeper = if rounds > 0 {
                    MIN_REDUCTION
                } else {
                    f64::INFINITY
                };
                profile(&problem, &found.solution, &information, &widths, deeper)
            });
            let Some(profiled) = profiled.filter(|_| !self.control.is_cancelled()) else {
                let values = found.solution.x.iter().zip(&information.errors);
                let symmetric = values.zip(&widths).map(|((value, error), width)| {
                    [-1.0, 1.0].map(|side| error.map(|error| value + side * width * error))
                });
                let intervals = symmetric.collect();
                return (found, intervals);
            };
            match profiled {
                Profile::Intervals(intervals) => return (found, intervals),
                Profile::Lower(x) => {
                    rounds -= 1;
                    match self.fine(x) {
                        Some(better) if self.is_better(&better, &found) => found = better,
                        _ => rounds = 0,
                    }
                }
            }
        }
    }

    /// Half-widths of the intervals in standard errors. The variance of a parameter is a sum over
    /// the columns, whose noise is known with their own degrees of freedom (Satterthwaite,
    /// Biometrics Bulletin 2, 110 (1946)); given errors are known.
    fn widths(&self, found: &SearchedFit, information: &Information) -> Vec<f64> {
        let data = self.problem.data;
        let columns = data.columns.len();
        let jacobian = &found.solution.jacobian;
        let freedom = self.freedom_of_columns(jacobian);
        let changed = jacobian * &information.covariance;
        let width = |k: usize| {
            let mut shares = vec![0.0; columns];
            for (row, of) in data.rows().enumerate() {
                for (column, share) in shares.iter_mut().enumerate() {
                    if of.errors[column].is_none() {
                        *share += changed[(row * columns + column, k)].powi(2);
                    }
                }
            }
            let whole: f64 = changed.column(k).norm_squared();
            let uncertain = shares.iter().zip(&freedom);
            let uncertain: f64 = uncertain
                .map(|(share, nu)| share * share / nu.max(1.0))
                .sum();
            student(if uncertain > 0.0 {
                (whole * whole / uncertain).max(1.0)
            } else {
                f64::INFINITY
            })
        };
        (0..self.problem.parameters.len()).map(width).collect()
    }

    /// Why the residuals are not noise, at a level of one and a half per cent: they are larger than the scatter
    /// that is known without the model, or keep their sign from row to row.
    pub(super) fn not_noise(&self, found: &SearchedFit) -> Vec<String> {
        let data = self.problem.data;
        let columns = &self.columns(found);
        let p_value = self.all_given().then(|| self.probability(found));
        let basis = statistics::range(&found.solution.jacobian);
        let mut reasons: Vec<String> = Vec::new();
        // Fisher's combination of the columns: -2 Σ ln p is χ² of two degrees of freedom each.
        let (mut sum, mut larger) = (0.0, Vec::new());
        for (index, column) in columns.iter().enumerate() {
            let Some(scatter) = data.columns[index].scatter.filter(|_| column.estimated) else {
                continue;
            };
            let (squares, freedom) = self.touched(found, &basis, index);
            let ratio = squares / freedom.max(1.0) / scatter.error.powi(2);
            let chance = statistics::exceeding_ratio(ratio, [freedom, scatter.freedom]);
            sum -= 2.0 * nanotap_arithmetic::ln(chance.max(f64::MIN_POSITIVE));
            larger.push((chance, column, ratio.sqrt()));
        }
        if statistics::exceeding(sum, 2.0 * larger.len() as f64) < LEVEL {
            let least = larger.iter().fold(1.0, |least: f64, (p, ..)| least.min(*p));
            let shown = larger.iter().filter(|(p, ..)| *p <= least.max(LARGER));
            reasons.extend(shown.map(|(_, column, ratio)| {
                format!(
                    "the residuals of {} are {ratio:.1} times as large as the scatter of \
                     neighbouring rows",
                    column.name
                )
            }));
        }
        if let Some(p) = p_value.filter(|p| (MIN_PROBABILITY..LEVEL).contains(p)) {
            reasons.push(format!(
                "chi2 exceeds its value by chance with probability {p:.1e}"
            ));
        }
        let sequences = self.sequences(found);
        let most = sequences.iter().flatten().map(Vec::len).max().unwrap_or(0);
        let of_rows = Sequences {
            columns: &sequences,
            basis: &basis,
        };
        let resolved = columns.iter().zip(&data.columns);
        let resolved = resolved
            .into_iter()
            .any(|(fitted, column)| fitted.residual > MIN_RESIDUAL * column.spread);
        if most >= MIN_SEQUENCE
            && resolved
            && of_rows.is_chance_below(LEVEL_OF_SIGNS, found.solution.residuals.as_slice())
        {
            reasons.push("the residuals keep their sign from row to row".to_owned());
        }
        let farthest = self.jumps_off(found).fold(0.0, f64::max);
        if farthest > MAX_JUMP {
            reasons.push(format!(
                "a jump of the data is {farthest:.0} standard errors of its place from where the branch \
                 of the model ends (on approach and retraction it ends at different distances, and noise \
                 can end it early; without the jumps as data the rows alone count)"
            ));
        }
        let point = found.solution.point.iter();
        let ended = point.filter(|row| row.lost && row.rest.is_some()).count();
        if ended > MAX_ENDED * data.curves.len() {
            reasons.push(format!(
                "{ended} rows lie beyond the end of the branch on which the lever rests"
            ));
        }
        reasons
    }

    /// Sum of the squared differences of a column, in units of the rows' relative errors, and their
    /// degrees of freedom, of the rows from which its scatter was not taken.
    fn touched(&self, found: &SearchedFit, basis: &DMatrix<f64>, column: usize) -> (f64, f64) {
        let (x, point) = (&found.solution.x, &found.solution.point);
        let columns = self.problem.data.columns.len();
        let rows = self.problem.rows().into_iter().zip(point.iter());
        let of = |(index, ((curve, row), point)): (usize, ((usize, &Row), &RowPoint))| {
            let value = point.values[column];
            let known = !point.lost && !row.is_free;
            let difference = known.then(|| self.problem.difference(x, curve, row, column, value));
            let leverage = basis.row(index * columns + column).norm_squared();
            let difference = difference.flatten()? / row.relative[column];
            Some((difference * difference, 1.0 - leverage))
        };
        let all = rows.enumerate().filter_map(of);
        all.fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
    }

    /// Indices of the residuals of neighbouring rows in one direction, by column.
    fn sequences(&self, found: &SearchedFit) -> Vec<Vec<Vec<usize>>> {
        let data = self.problem.data;
        let columns = data.columns.len();
        let of = |column: usize| {
            let mut sequences: Vec<Vec<usize>> = Vec::new();
            let mut before = None;
            let rows = self
                .problem
                .rows()
                .into_iter()
                .zip(found.solution.point.iter());
            for (index, ((curve, row), point)) in rows.enumerate() {
                let place = Some((curve, row.way));
                if place != before {
                    sequences.push(Vec::new());
                    before = place;
                }
                if let (Some(sequence), Some(_), false) =
                    (sequences.last_mut(), row.values[column], point.lost)
                {
                    sequence.push(index * columns + column);
                }
            }
            sequences
        };
        (0..columns).map(of).collect()
    }

    /// True if one fit describes as much of the data better than another.
    pub(super) fn is_better(&self, this: &SearchedFit, other: &SearchedFit) -> bool {
        let deviance = |of: &SearchedFit| self.whole_criterion(of) + self.squared_jumps(of);
        this.jumps.len() >= other.jumps.len() && deviance(this) < deviance(other)
    }

    /// Akaike's criterion over all rows, where the values of one without an orbit count as residuals
    /// of their column's spread: between fits of one law, a lost row is no gain.
    pub(super) fn whole_criterion(&self, found: &SearchedFit) -> f64 {
        let likelihood = self.likelihood(found);
        let deviance: f64 = likelihood.rows.iter().map(|row| row.deviance).sum();
        deviance + self.squared_priors(found) + 2.0 * likelihood.parameters as f64
    }

    /// Contribution of the jumps to chi2.
    fn squared_jumps(&self, found: &SearchedFit) -> f64 {
        self.jumps_off(found).map(|off| off * off).sum()
    }

    /// How far each jump is from the end of the model's branch, in standard errors of its place.
    fn jumps_off(&self, found: &SearchedFit) -> impl Iterator<Item = f64> {
        let problem = self.problem_of(found);
        let (x, point) = (&found.solution.x, &found.solution.point);
        let off = (0..found.jumps.len()).map(|k| problem.jump_residual(x, point, k).abs());
        off.collect::<Vec<_>>().into_iter()
    }

    fn fitted(
        problem: &Problem<'_>,
        found: &SearchedFit,
        information: &Information,
        intervals: Vec<[Option<f64>; 2]>,
        shifts: Option<&[f64]>,
    ) -> Vec<FittedParameter> {
        let data = problem.data;
        let x = &found.solution.x;
        let all = problem.parameters.iter().zip(x).zip(intervals);
        all.zip(&information.errors)
            .enumerate()
            .map(|(k, (((parameter, value), interval), error))| {
                let shift = shifts.map_or(0.0, |shifts| shifts[k].abs());
                // Independent errors add in squares; so do the half-widths of their intervals.
                let wider = |end: f64| {
                    let half = nanotap_arithmetic::hypot(end - value, STANDARD_ERRORS_95 * shift);
                    value + half.copysign(end - value)
                };
                FittedParameter {
                    key: parameter.name.clone(),
                    curve: parameter.curve.map(|curve| data.curves[curve].name.clone()),
                    value: *value,
                    standard_error: error.map(|error| nanotap_arithmetic::hypot(error, shift)),
                    stiffness_error: shifts.map(|_| shift),
                    interval: if shift > 0.0 {
                        interval.map(|end| end.map(wider))
                    } else {
                        interval
                    },
                    unit: parameter.unit(data, problem.case),
                    start: parameter.start,
                    at_bound: *value <= parameter.bounds.0 || *value >= parameter.bounds.1,
                }
            })
            .collect()
    }

    /// Changes of the best values for one standard error of the spring constant, to first order:
    /// −(JᵀJ)⁻¹Jᵀ ∂r/∂k δk. `None` if no error is stated, or the spring constant is fitted.
    fn by_stiffness(
        &self,
        problem: &Problem<'_>,
        found: &SearchedFit,
        information: &Information,
    ) -> Option<Vec<f64>> {
        let case = problem.case;
        let error = case.stiffness_error()?;
        let keys = [Key::LeverK1, Key::LeverK];
        let is_fitted = |p: &Parameter| keys.iter().any(|key| p.target == Target::Key(*key));
        if problem.parameters.iter().any(is_fitted) || self.control.is_cancelled() {
            return None;
        }
        let is_k1 = case.stated(Key::LeverK1).is_some();
        let key = if is_k1 { Key::LeverK1 } else { Key::LeverK };
        let stiffness = case.get(key);
        let mut parameters = problem.parameters.to_vec();
        parameters.push(Parameter {
            name: key.path().to_owned(),
            target: Target::Key(key),
            curve: None,
            start: stiffness,
            bounds: (0.0, f64::INFINITY),
            size: stiffness,
            is_given: true,
            is_limited: false,
            prior: None,
        });
        let problem = Problem {
            parameters: &parameters,
            ..problem.clone()
        };
        let mut x = found.solution.x.clone();
        let count = x.len();
        x.push(stiffness);
        let jacobian = problem.jacobian(&x, &mut found.solution.point.clone())?;
        let by_stiffness = jacobian.column(count) * (error * stiffness);
        let gradient = jacobian.columns(0, count).tr_mul(&by_stiffness);
        let shifts = -(&information.covariance * gradient);
        shifts
            .iter()
            .all(|of| of.is_finite())
            .then(|| shifts.iter().copied().collect())
    }

    /// Lists the rows without an orbit, and the motion of the lever there.
    fn without_orbit(&self, found: &SearchedFit) -> String {
        let (problem, x) = (&self.problem, &found.solution.x);
        let rows = problem.rows();
        let points = found.solution.point.iter();
        let lost: Vec<_> = rows.iter().zip(points).filter(|(_, p)| p.lost).collect();
        let lines: Vec<String> = lost
            .iter()
            .take(MAX_LISTED_ROWS)
            .map(|(r, _)| r.1.line.to_string())
            .collect();
        let lines = lines.join(", ")
            + if lost.len() > MAX_LISTED_ROWS {
                ", …"
            } else {
                ""
            };
        if problem.held.is_some() {
            return format!(
                "{} of {} rows have no orbit with the given amplitude and phase and do not \
                 count: lines {lines}",
                lost.len(),
                rows.len()
            );
        }
        if problem.data.is_force_curve() {
            return format!(
                "{} of {} rows do not count: the lever rings after a jump there, or has no rest on their \
                 branch: lines {lines}",
                lost.len(),
                rows.len()
            );
        }
        let cases = problem.cases(x);
        let longer = lost
            .iter()
            .take(MAX_LISTED_ROWS)
            .filter_map(|((curve, row), _)| {
                let case = problem.case_at(&cases[*curve], &problem.place(x, *curve, row));
                let orbit = settle(&case.model().ok()?, None, MAX_PERIOD)?;
                (orbit.period > problem.max_period).then_some(orbit.period)
            });
        let longer: Vec<usize> = longer.collect();
        let said = match longer.iter().max() {
            None => String::new(),
            Some(most) => {
                let periods: Vec<String> = longer.iter().map(usize::to_string).collect();
                format!(
                    "; from rest the motion there repeats after {} periods, which a \
                     max_period of {most} takes",
                    periods.join(", ")
                )
            }
        };
        format!(
            "{} of {} rows have no periodic orbit of up to {} drive periods on their branch and do \
             not count: lines {lines}{said}",
            lost.len(),
            rows.len(),
            problem.max_period
        )
    }

    /// Whether the residuals are as large as the variation of the data.
    pub(super) fn is_nothing(&self, found: &SearchedFit) -> bool {
        let fitted = self.columns(found);
        let columns = fitted.iter().zip(&self.problem.data.columns);
        columns
            .into_iter()
            .all(|(fitted, column)| fitted.residual > 0.5 * column.spread)
    }

    /// Determines why the model does not describe the data, and adds other warnings.
    fn judge(
        &self,
        found: &SearchedFit,
        p_value: Option<f64>,
        parameters: &[FittedParameter],
        misfit: &[String],
    ) -> (Option<String>, Vec<String>) {
        let data = self.problem.data;
        let point = &found.solution.point;
        let mut remarks = Vec::new();
        if data.left_out > 0 {
            remarks.push(format!(
                "{} rows of neither direction are left out: the motion of a curve follows from its \
                 own rows",
                data.left_out
            ));
        }
        let lost = point.iter().filter(|row| row.lost).count();
        if lost > 0 {
            remarks.push(self.without_orbit(found));
        }
        let all = parameters.iter().zip(self.problem.parameters);
        for (parameter, of) in all.filter(|(p, _)| p.at_bound) {
            let limit = of.is_limited && parameter.value != 0.0;
            remarks.push(if limit {
                format!(
                    "{} ended at {} {}, the limit of what is physical: the data do not determine it, \
                     or the law is not theirs; the option `bounds` sets other limits",
                    parameter.key,
                    shortest(parameter.value),
                    parameter.unit
                )
            } else {
                format!(
                    "{} ended at a bound: its standard error and interval do not hold",
                    parameter.key
                )
            });
        }
        if !misfit.is_empty() {
            remarks.push(format!(
                "{}: the law, the branch or an offset is not that of the data, and values and \
                 intervals are not to be trusted",
                misfit.join("; ")
            ));
        }
        let unlikely = p_value.filter(|p| *p < MIN_PROBABILITY).map(|_| {
            format!(
                "chi2 = {:.4e} with {} degrees of freedom: the residuals are larger than the \
                 standard errors that the data give",
                self.chi2(found),
                self.freedom(found)
            )
        });
        let reason = if 2 * lost > point.len() {
            let motion = if data.is_force_curve() {
                "rest"
            } else {
                "periodic orbit"
            };
            Some(format!("more than half of the rows have no {motion}"))
        } else if self.is_nothing(found) {
            Some("the residuals are as large as the variation of the data".to_owned())
        } else {
            unlikely
        };
        (reason, remarks)
    }
}

/// The rows with the model's values.
fn rows(problem: &Problem<'_>, found: &SearchedFit) -> Vec<FittedRow> {
    let data = problem.data;
    let x = &found.solution.x;
    let rows = problem.rows().into_iter();
    rows.zip(found.solution.point.iter())
        .map(|((curve, row), point)| {
            let known = !point.lost;
            let readings = data.columns.iter().enumerate().map(|(index, column)| {
                let value = point.values[index];
                let difference = problem.difference(x, curve, row, index, value);
                let residual = difference.map(|d| -d / problem.error(row, index));
                let reading = Reading {
                    measured: row.values[index],
                    model: known.then(|| problem.read(x, curve, row, index, value)),
                    residual: residual.filter(|_| known),
                };
                (column.name.clone(), reading)
            });
            FittedRow {
                curve: data.curves[curve].name.clone(),
                line: row.line,
                way: row.way,
                at: problem.place(x, curve, row)[0],
                branch: known.then_some(point.branch),
                period: point.orbit.as_ref().filter(|_| known).map(|o| o.period),
                readings: readings.collect(),
            }
        })
        .collect()
}

/// The jumps of the data with their folds.
fn jumps(problem: &Problem<'_>, found: &SearchedFit) -> Vec<FittedJump> {
    let (x, point) = (&found.solution.x, &found.solution.point);
    let rows = problem.rows();
    let jump = |(index, jump): (usize, &Jump)| {
        let fold = point.folds[index].as_ref()?;
        let residual = -problem.jump_residual(x, point, index);
        let offset = fold.at - jump.at() + residual * jump.error();
        Some(FittedJump {
            curve: problem.data.curves[jump.curve].name.clone(),
            lines: jump.rows.map(|row| rows[row].1.line),
            between: jump.between.map(|at| at + offset),
            branches: jump.rows.map(|row| point[row].branch),
            fold: fold.at,
            residual,
        })
    };
    found.jumps.iter().enumerate().filter_map(jump).collect()
}

/// The values of the orbits on which the data are not.
fn others(problem: &Problem<'_>, found: &SearchedFit) -> Vec<OtherOrbit> {
    let data = problem.data;
    let x = &found.solution.x;
    let chosen = branches_of(&found.solution.point);
    let mut others = Vec::new();
    let mut first = 0;
    for (curve, rows) in found.candidates.iter().enumerate() {
        for (row, candidates) in rows.iter().enumerate() {
            let measured = &data.curves[curve].rows[row];
            let at = problem.place(x, curve, measured);
            let others_here = candidates
                .iter()
                .filter(|c| c.branch != chosen[first + row]);
            for candidate in others_here {
                let values = problem.values(x, curve, &at, candidate);
                let Some(values) = values else { continue };
                let columns = data.columns.iter().zip(values).enumerate();
                let readings = columns.map(|(index, (column, value))| {
                    (
                        column.name.clone(),
                        problem.read(x, curve, measured, index, value),
                    )
                });
                others.push(OtherOrbit {
                    curve: data.curves[curve].name.clone(),
                    at: at[0],
                    branch: candidate.branch,
                    readings: readings.collect::<BTreeMap<_, _>>(),
                });
            }
        }
        first += rows.len();
    }
    others
}

/// Descriptions of what the data do not determine.
fn undetermined(
    information: &Information,
    parameters: &[Parameter],
    data: &Data,
) -> Vec<Undetermined> {
    let name = |k: usize| match parameters[k].curve {
        Some(curve) => format!("{} of {}", parameters[k].name, data.curves[curve].name),
        None => parameters[k].name.clone(),
    };
    let in_words = |direction: &statistics::Direction| {
        let largest = direction.along.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let mut parts: Vec<usize> = (0..parameters.len())
            .filter(|&k| direction.along[k].abs() > 0.02 * largest)
            .collect();
        parts.sort_by(|a, b| {
            direction.along[*b]
                .abs()
                .total_cmp(&direction.along[*a].abs())
        });
        let first = direction.along[parts[0]];
        let words = if parts.len() == 1 {
            format!("the data do not determine {}", name(parts[0]))
        } else {
            let change = |&k: &usize| {
                let relative = direction.along[k] / first;
                format!("{} by {:+.3} %", name(k), relative)
            };
            let changes: Vec<String> = parts.iter().map(change).collect();
            let names: Vec<String> = parts.iter().map(|k| name(*k)).collect();
            format!(
                "the data do not separate {}: changing {} does not change the measured values",
                names.join(" and "),
                changes.join(" and ")
            )
        };
        Undetermined {
            words,
            keys: parts.iter().map(|k| name(*k)).collect(),
            direction: parts.iter().map(|k| direction.along[*k]).collect(),
            singular_value: direction.singular_value,
        }
    };
    information.undetermined.iter().map(in_words).collect()
}
