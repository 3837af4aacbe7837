//! First values from a coarse scan, before anything is fitted.
//!
//! An offset of the distance moves a curve as a whole: the model's curve, computed once over a
//! wider range, gives the misfit for every offset by interpolation. The scan is around the offset
//! of the case, or around the one that puts the knee of the amplitude at its free value if these
//! are far apart. If no offset describes the data, the stiffness of the contact is varied too.

use rayon::prelude::*;

use super::baseline::begin_from_baseline;
use super::data::{Curve, Data, Row, is_distance};
use super::instrument::{self, far_rows, median, tapping_line, wrapped};
use super::parameters::{Parameter, Target};
use super::problem::Problem;
use super::search::{ROUGH_ERROR, Search};
use super::statistics::span;
use nanotap_case::{Case, Key};

/// Number of distances of the model's curve.
const POINTS: usize = 60;
/// Number of offsets of the scan.
const OFFSETS: usize = 81;
/// Range of the scan on each side: a part of the free amplitude, and at least this, in m.
const REACH: (f64, f64) = (0.3, 3e-9);
/// If the knee of the curve is more than this many free amplitudes from the case's offset, the scan
/// is centred on the knee.
const FAR: f64 = 2.0;
/// Factors of the stiffness of the contact.
const FACTORS: [f64; 4] = [1.0 / 16.0, 0.25, 4.0, 16.0];
/// Mean cost of a value that needs no further factors: a residual of about two rough errors.
const DESCRIBED: f64 = 0.5;
/// The scan counts if it lowers the cost by this factor.
const BETTER: f64 = 0.8;

/// A free amplitude of the data that differs from the case's by more than this part is reported.
const OTHER_FREE: f64 = 0.02;

/// The model's values at a distance, of each motion there.
struct Place {
    distance: f64,
    /// Motions at this distance: the index of the branch and the model's values, one per column.
    motions: Vec<(usize, Vec<f64>)>,
}

/// Offsets of the distance to try.
struct Scan {
    /// Index of the curve that is scanned.
    curve: usize,
    /// Index of the offset among the parameters.
    offset: usize,
    offsets: Vec<f64>,
}

impl Search<'_> {
    /// The offsets to try; `None` if the distance has none, or nothing is known of it.
    fn scan(&self) -> Option<Scan> {
        let data = self.problem.data;
        let amplitude = data
            .columns
            .iter()
            .position(|c| matches!(c.quantity.name(), "first_harmonic" | "amplitude"))?;
        let is_scanned = |p: &Parameter| {
            matches!(p.target, Target::Place(0)) && !p.is_given && is_distance(data.swept[0].key)
        };
        let offset = self.problem.parameters.iter().position(is_scanned)?;
        if self.problem.held.is_some() || data.swept.len() > 1 {
            return None;
        }
        let parameter = &self.problem.parameters[offset];
        let curve = parameter.curve.unwrap_or(0);
        let rows = &data.curves[curve].rows;
        let known = rows
            .iter()
            .filter_map(|row| Some((row.at[0], row.values[amplitude]?)));
        let (distance, amplitudes): (Vec<f64>, Vec<f64>) = known.unzip();
        let far = far_rows(&distance, &amplitudes);
        if far.is_empty() {
            return None;
        }
        let free = median(far.iter().map(|k| amplitudes[*k]).collect());
        let knee = tapping_line(&distance, &amplitudes).map(|line| free - line.knee(free));
        let centre = match knee {
            Some(knee) if (knee - parameter.start).abs() > FAR * free => knee,
            _ => parameter.start,
        };
        let least = if self.problem.case.is_physical() {
            REACH.1
        } else {
            0.0
        };
        let reach = (REACH.0 * free).max(least);
        let (low, high) = parameter.bounds;
        let offsets: Vec<f64> = (0..OFFSETS)
            .map(|k| centre + reach * (2.0 * k as f64 / (OFFSETS - 1) as f64 - 1.0))
            .chain([parameter.start])
            .filter(|of| (low..=high).contains(of))
            .collect();
        Some(Scan {
            curve,
            offset,
            offsets,
        })
    }

    /// These values with the best offset of the distance.
    pub(super) fn with_best_offset(&self, x: &[f64]) -> Option<Vec<f64>> {
        if self.problem.data.is_force_curve() {
            return Some(self.aligned(x));
        }
        let scan = self.scan()?;
        let (_, of, _) = self.best_offset((scan.curve, scan.offset), x, &scan.offsets)?;
        Some(with(x, scan.offset, of))
    }

    /// Better first values than `own`, if the scan finds some.
    pub(super) fn scanned(&self, own: &[f64]) -> Option<Vec<f64>> {
        if self.problem.data.is_force_curve() {
            return self.scanned_rests(own);
        }
        let Scan {
            curve,
            offset,
            offsets,
        } = self.scan()?;
        let rows = &self.problem.data.curves[curve].rows;
        let first = self.best_offset((curve, offset), own, &offsets)?;
        let values = rows.iter().flat_map(|row| &row.values).flatten().count() as f64;
        let stiffness = self.problem.parameters.iter().position(|p| {
            let keys = [Key::SampleModulus, Key::SampleStiffness, Key::Alpha4];
            p.is_unknown_of(&keys) && p.is_of(curve)
        });
        let mut best = (first.0, with(own, offset, first.1));
        if let Some(stiffness) = stiffness.filter(|_| first.0 > DESCRIBED * values) {
            let others = FACTORS.par_iter().filter_map(|factor| {
                let (low, high) = self.problem.parameters[stiffness].bounds;
                let x = with(own, stiffness, (factor * own[stiffness]).clamp(low, high));
                let (cost, of, _) = self.best_offset((curve, offset), &x, &offsets)?;
                Some((cost, with(&x, offset, of)))
            });
            let others: Vec<(f64, Vec<f64>)> = others.collect();
            for other in others {
                if other.0 < best.0 {
                    best = other;
                }
            }
        }
        (best.0 < BETTER * first.2).then_some(best.1)
    }

    /// The least cost over offsets, that offset, and the cost at the offset of `x`.
    fn best_offset(
        &self,
        (curve, offset): (usize, usize),
        x: &[f64],
        offsets: &[f64],
    ) -> Option<(f64, f64, f64)> {
        let rows = &self.problem.data.curves[curve].rows;
        let [near, far] = span(rows.iter().map(|row| row.at[0]));
        let [least, most] = span(offsets.iter().copied());
        let at_zero = with(x, offset, 0.0);
        let model = self.model_curve(&at_zero, curve, near + least, far + most)?;
        let cost = |of: f64| -> f64 {
            rows.iter()
                .map(|row| self.cost(&at_zero, curve, row, of, &model))
                .sum()
        };
        let costs = offsets.iter().map(|of| (cost(*of), *of));
        let (cost_there, there) = costs.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((cost_there, there, cost(x[offset])))
    }

    /// The model's curve between two distances, the farthest first.
    fn model_curve(&self, x: &[f64], curve: usize, near: f64, far: f64) -> Option<Vec<Place>> {
        let data = self.problem.data;
        let mut template = data.curves[curve].rows.first()?.clone();
        template.values.fill(None);
        let rows = (0..POINTS).map(|k| {
            let mut row: Row = template.clone();
            row.at[0] = far + (near - far) * k as f64 / (POINTS - 1) as f64;
            row
        });
        let wide = Curve {
            name: String::new(),
            rows: rows.collect(),
        };
        let count = data.curves.len();
        let empty = Curve {
            name: String::new(),
            rows: Vec::new(),
        };
        let mut curves = vec![empty; count];
        curves[curve] = wide;
        let data = Data {
            curves,
            ..data.clone()
        };
        let problem = Problem {
            data: &data,
            ..self.weighted(self.rough_noise(), None)
        };
        let (_, found) = problem.discover(x, None);
        let rows = data.curves[curve].rows.par_iter().zip(&found[curve]);
        let places: Vec<Place> = rows
            .map(|(row, candidates)| Place {
                distance: row.at[0],
                motions: candidates
                    .iter()
                    .filter_map(|c| Some((c.branch, problem.values(x, curve, &row.at, c)?)))
                    .collect(),
            })
            .collect();
        (!self.control.is_cancelled()).then_some(places)
    }

    /// Returns the cost of a row at an offset: that of the nearest motion there.
    fn cost(&self, x: &[f64], curve: usize, row: &Row, offset: f64, model: &[Place]) -> f64 {
        let at = row.at[0] + offset;
        let count = model.len() - 1;
        let (first, last) = (model[0].distance, model[count].distance);
        let place = (at - first) / (last - first) * count as f64;
        let k = (place.max(0.0) as usize).min(count - 1);
        let part = place - k as f64;
        let nearest = usize::from(part > 0.5);
        let columns = &self.problem.data.columns;
        let of = |values: &dyn Fn(usize) -> f64| -> f64 {
            let costs = columns.iter().enumerate().filter_map(|(index, column)| {
                let difference = self
                    .problem
                    .difference(x, curve, row, index, values(index))?;
                let size = ROUGH_ERROR * column.spread.max(f64::MIN_POSITIVE);
                Some(nanotap_arithmetic::ln_1p(
                    (difference / (3.0 * size)).powi(2),
                ))
            });
            costs.sum()
        };
        let here = &model[k + nearest].motions;
        let there = &model[k + 1 - nearest].motions;
        let costs = here.iter().map(|(branch, values)| {
            let other = there.iter().find(|(known, _)| known == branch);
            let weight = if nearest == 0 { part } else { 1.0 - part };
            of(&|index| match other {
                Some((_, other)) => values[index] + weight * (other[index] - values[index]),
                None => values[index],
            })
        });
        // A row without a motion costs as one that is far off.
        let none = 5.0 * row.values.iter().flatten().count() as f64;
        costs.fold(none, f64::min)
    }
}

/// Amplitude and phase far from the sample as first values of the free amplitude and of the phase's
/// offset; says where the case has another free amplitude that is not free.
pub(super) fn begin_from_free_rows(
    case: &Case,
    data: &Data,
    parameters: &mut [Parameter],
) -> Option<String> {
    if data.is_force_curve() {
        return begin_from_baseline(data, parameters);
    }
    let column = |name: &str| data.columns.iter().position(|c| c.quantity.name() == name);
    let amplitude = column("first_harmonic").filter(|_| is_distance(data.swept[0].key))?;
    let phase = column("phase");
    let mut level: Vec<f64> = Vec::new();
    let mut turns: Vec<f64> = Vec::new();
    let lag = instrument::free_lag(case);
    for curve in &data.curves {
        for rows in curve.rows.chunk_by(|a, b| a.way == b.way) {
            let known = rows
                .iter()
                .filter_map(|row| Some((row, row.values[amplitude]?)));
            let (rows, values): (Vec<&Row>, Vec<f64>) = known.unzip();
            let distance: Vec<f64> = rows.iter().map(|row| row.at[0]).collect();
            for k in far_rows(&distance, &values) {
                level.push(values[k]);
                let turn = phase.and_then(|phase| Some(wrapped(rows[k].values[phase]? - lag?)));
                turns.extend(turn);
            }
        }
    }
    let free = Some(median(level)).filter(|free| *free > 0.0)?;
    let turn = median(turns);
    let mut is_free = false;
    for parameter in parameters {
        let (target, found) = match parameter.target {
            Target::Key(Key::DriveFreeAmplitude) => (true, free),
            Target::Offset(of) if Some(of) == phase && turn.is_finite() => (false, turn),
            Target::Scale(of) | Target::Offset(of) if of == amplitude => {
                is_free = true;
                continue;
            }
            _ => continue,
        };
        is_free |= target;
        let (low, high) = parameter.bounds;
        if !parameter.is_given && (low..=high).contains(&found) {
            parameter.start = found;
        }
    }
    let stated = case.get(Key::DriveFreeAmplitude);
    let differs = stated.is_finite() && (free / stated - 1.0).abs() > OTHER_FREE && !is_free;
    differs.then(|| {
        format!(
            "the amplitude of the rows far from the sample is {:.3} times the free amplitude of the \
             case: correct one of them, or name drive.free_amplitude in `free`",
            free / stated
        )
    })
}

/// Returns the parameters with the one at `index` set to `value`.
pub(super) fn with(x: &[f64], index: usize, value: f64) -> Vec<f64> {
    let mut x = x.to_vec();
    x[index] = value;
    x
}
