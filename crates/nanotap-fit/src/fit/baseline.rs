//! First values of a force curve: its baseline, its pull-off force and its deepest row, before
//! anything is fitted.
//!
//! The lever at rest is cheap: a scan over moduli puts the pull-off force of each model on that of the
//! data, and the curve onto the deepest row by the offset of the distance.

use nanotap_arithmetic::{exp, ln};

use super::data::Data;
use super::guess::with;
use super::instrument::median;
use super::parameters::{Parameter, Target};
use super::problem::Problem;
use super::search::{ROBUST_LIMIT, Search};
use super::solve::LeastSquares as _;
use super::statistics::span;
use super::thin::scatter_of_row;
use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_scan::force_curve::RestLever;

/// Fewest rows from which anything is guessed.
const MIN_ROWS: usize = 12;
/// Farthest rows, as a part of all, that are taken for the baseline first.
const FIRST: f64 = 0.1;
/// A row this many standard deviations of one off the farthest ones is no baseline.
const OFF: f64 = 4.0;
/// Factors of the stiffness of the contact: up to so many decades either way, each looked at, and the best
/// one to this part of a decade.
const DECADES: (i32, f64) = (5, 0.25);
/// A scan counts if it lowers the cost by this factor: of many rows few may be in contact.
const BETTER: f64 = 0.999;
/// Rounds in which the pull-off force and its parameter meet.
const ROUNDS: usize = 12;
/// Relative change of the parameter in a round up to which they have met.
const CLOSE: f64 = 1e-3;
/// Least power with which the pull-off force changes with its parameter, and the inverse of the
/// largest.
const MIN_POWER: f64 = 0.2;
/// Rounds in which the offset and the adhesion meet.
const MEETINGS: usize = 2;
/// Cost of a row without a rest.
const LOST: f64 = 100.0;
/// A baseline this part of the range of the values off zero is reported.
const OFF_ZERO: f64 = 0.01;

/// The rows far from the sample, where nothing pulls or pushes the lever, the farthest first, and
/// rows after them that may be such.
pub(super) fn baseline_rows(distance: &[f64], values: &[f64]) -> [Vec<usize>; 2] {
    if values.len() < MIN_ROWS || values.iter().any(|value| !value.is_finite()) {
        return [Vec::new(), Vec::new()];
    }
    let mut sorted: Vec<usize> = (0..distance.len()).collect();
    sorted.sort_by(|a, b| distance[*b].total_cmp(&distance[*a]));
    let of = |rows: &[usize]| -> Vec<f64> { rows.iter().map(|k| values[*k]).collect() };
    let first = ((FIRST * sorted.len() as f64) as usize).max(MIN_ROWS / 2);
    let level = median(of(&sorted[..first]));
    let off = of(&sorted[..first])
        .iter()
        .map(|v| (v - level).abs())
        .collect();
    let scatter = scatter_of_row(&of(&sorted)).max(1.4826 * median(off));
    // Rows are off where three in sequence are, on the average.
    let leaves = |rows: &[usize]| (median(of(rows)) - level).abs() > OFF * scatter / 3f64.sqrt();
    let end = sorted.windows(3).position(leaves).unwrap_or(sorted.len());
    sorted.truncate(end.max(3));
    let doubtful = sorted.split_off((end * 4 / 5).max(3));
    [sorted, doubtful]
}

/// Returns the assumptions of a fit of a force curve, as sentences.
///
/// # Errors
/// When the case has no lever at rest.
pub(super) fn assumptions(case: &Case, data: &Data) -> Result<Vec<String>, Error> {
    RestLever::of(&case.with(data.swept[0].key, 0.0))?;
    Ok(vec![
        "force curve: the lever is at rest at every row; its drive, viscous forces and the ringing \
         after jumps do not count"
            .to_owned(),
    ])
}

/// The baseline of a force curve as the first value of its offset; says where it is not zero and no
/// offset is free.
pub(super) fn begin_from_baseline(data: &Data, parameters: &mut [Parameter]) -> Option<String> {
    let mut note = None;
    for (curve, of) in data.curves.iter().enumerate() {
        for (index, column) in data.columns.iter().enumerate() {
            let known = of.rows.iter();
            let known = known.filter_map(|row| Some((row.at[0], row.values[index]?)));
            let (distance, values): (Vec<f64>, Vec<f64>) = known.unzip();
            let [rows, _] = baseline_rows(&distance, &values);
            if rows.is_empty() {
                continue;
            }
            let level = median(rows.iter().map(|k| values[*k]).collect());
            let mut is_free = false;
            for parameter in parameters.iter_mut() {
                if parameter.target != Target::Offset(index) || !parameter.is_of(curve) {
                    continue;
                }
                is_free = true;
                let (low, high) = parameter.bounds;
                if !parameter.is_given && (low..=high).contains(&level) {
                    parameter.start = level;
                }
            }
            let [least, most] = span(values.iter().copied());
            if !is_free && level.abs() > OFF_ZERO * (most - least) {
                let unit = column.quantity.unit(true);
                note = Some(format!(
                    "the {} of the rows far from the sample is {level:.3e} {unit}: name \
                     {}.offset in `free` if it is one of the instrument",
                    column.name, column.name
                ));
            }
        }
    }
    note
}

impl Search<'_> {
    /// Better first values than `own`, if the scan finds some.
    pub(super) fn scanned_rests(&self, own: &[f64]) -> Option<Vec<f64>> {
        let parameters = self.problem.parameters;
        let own_cost = self.cost_of_rests(own);
        let keys = [Key::SampleModulus, Key::SampleStiffness];
        let stiffnesses: Vec<usize> = (0..own.len())
            .filter(|k| parameters[*k].is_unknown_of(&keys))
            .collect();
        let mut best: Option<(f64, f64, Vec<f64>)> = None;
        let mut look = |power: f64| {
            if self.control.is_cancelled() {
                return 0.0;
            }
            let mut x = own.to_vec();
            for k in &stiffnesses {
                let factor = nanotap_arithmetic::powf(10.0, power);
                let (low, high) = parameters[*k].bounds;
                x[*k] = (x[*k] * factor).clamp(low, high);
            }
            let x = self.aligned(&x);
            let cost = self.cost_of_rests(&x);
            if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                best = Some((cost, power, x));
            }
            best.as_ref().map_or(0.0, |(_, power, _)| *power)
        };
        let mut centre = look(0.0);
        if !stiffnesses.is_empty() {
            for power in 1..=DECADES.0 {
                look(f64::from(power));
                centre = look(-f64::from(power));
            }
            let mut step = 0.5;
            while step >= DECADES.1 {
                let middle = centre;
                look(middle + step);
                centre = look(middle - step);
                step /= 2.0;
            }
        }
        best.filter(|(cost, ..)| *cost < BETTER * own_cost)
            .map(|(.., x)| x)
    }

    fn cost_of_rests(&self, x: &[f64]) -> f64 {
        let problem = self.weighted(self.rough_noise(), Some(ROBUST_LIMIT));
        let (point, _) = problem.discover(x, None);
        // Rows without a rest cost as those that are far off.
        let lost = point.iter().filter(|row| row.lost).count() as f64;
        problem.residuals(x, &point).norm_squared() + LOST * lost
    }

    /// These values with the pull-off force of the data, if a parameter of the adhesion is free, and
    /// with offsets of the distance that put the model on the deepest rows.
    pub(super) fn aligned(&self, x: &[f64]) -> Vec<f64> {
        let problem = &self.problem;
        let mut x = x.to_vec();
        for _ in 0..MEETINGS {
            let mut adheres = false;
            for curve in 0..problem.data.curves.len() {
                if let Some((k, value)) = self.adhesion(&x, curve) {
                    adheres = true;
                    x = with(&x, k, value);
                }
                if let Some((k, offset)) = self.offset_of_rests(&x, curve) {
                    x = with(&x, k, offset);
                }
            }
            if !adheres {
                break;
            }
        }
        x
    }

    /// Values of a curve without scales and offsets, and the distance of each.
    fn values_of_curve(problem: &Problem<'_>, x: &[f64], curve: usize) -> Vec<[f64; 2]> {
        let rows = problem.data.curves[curve].rows.iter();
        let known = rows.filter_map(|row| {
            let value = problem.unread(x, curve, row, 0, row.values[0]?);
            Some([problem.place(x, curve, row)[0], value])
        });
        known.collect()
    }

    /// The offset of the distance, by its index, that puts the model on the deepest row of a curve.
    fn offset_of_rests(&self, x: &[f64], curve: usize) -> Option<(usize, f64)> {
        let problem = &self.problem;
        let k = problem
            .parameters
            .iter()
            .position(|p| matches!(p.target, Target::Place(0)) && !p.is_given && p.is_of(curve))?;
        // Not the highest value: after its jumps the lever overshoots.
        let values = Self::values_of_curve(problem, x, curve).into_iter();
        let [at, value] = values.min_by(|a, b| a[0].total_cmp(&b[0]))?;
        let quantity = problem.data.columns[0].quantity.rest()?;
        // Whatever the zero of the data is, the surface of the model is at 0.
        let moved = with(x, k, x[k] - at);
        let rested = problem.rested(&moved, curve)?;
        let distance = rested.distance_of(quantity, value)?;
        let (low, high) = problem.parameters[k].bounds;
        Some((k, (moved[k] + distance).clamp(low, high)))
    }

    /// The parameter of the adhesion, by its index, with a value nearer to the pull-off force of a
    /// curve.
    fn adhesion(&self, x: &[f64], curve: usize) -> Option<(usize, f64)> {
        let problem = &self.problem;
        let keys = [
            Key::SampleWorkOfAdhesion,
            Key::SampleAdhesionForce,
            Key::SampleHamaker,
        ];
        let mut parameters = problem.parameters.iter();
        let k = parameters.position(|p| p.is_unknown_of(&keys) && p.is_of(curve))?;
        let values = Self::values_of_curve(problem, x, curve).into_iter();
        let [_, least] = values.min_by(|a, b| a[1].total_cmp(&b[1]))?;
        let quantity = problem.data.columns[0].quantity.rest()?;
        let (low, high) = problem.parameters[k].bounds;
        let pull_off = |value: f64| {
            let rested = problem.rested(&with(x, k, value), curve)?;
            rested.pull_off(quantity)
        };
        // On a stiff sample the pull-off force is proportional to the parameter, on a soft one it
        // goes as a power of it, which the last two values tell.
        let mut value = x[k];
        let mut power = 1.0;
        let mut before: Option<[f64; 2]> = None;
        for _ in 0..ROUNDS {
            let excess = ln(pull_off(value)? / least);
            if let Some([of, other]) = before.filter(|[_, other]| *other != excess) {
                power = ((excess - other) / ln(value / of)).clamp(MIN_POWER, 1.0 / MIN_POWER);
            }
            before = Some([value, excess]);
            let next = (value * exp(-excess / power)).clamp(low, high);
            if !next.is_finite() || next <= 0.0 {
                return None;
            }
            if (next / value - 1.0).abs() < CLOSE {
                break;
            }
            value = next;
        }
        Some((k, value))
    }
}
