//! Scatter of measured values, known without a model, and averages of many rows.
//!
//! Averages are of consecutive rows whose bins have equal parts of the path in distance and values,
//! so that knees and steep parts keep their rows and flat ones do not; a jump ends a bin. Where the
//! curve bends, the mean of the rows lies off it: the bend is known from the rows of the bin and
//! of as many on either side, and taken off. Where it is large, the value is that of a parabola
//! through the rows of the bin. Standard errors follow from the scatter within the bins.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::baseline::baseline_rows;
use super::data::{Column, Curve, Data, Row, is_distance};
use super::instrument::{far_and_doubtful_rows, median, wrapped};
use super::statistics::span;
use super::terms::Ramp;

/// Scatter of the values of a column about smooth curves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scatter {
    /// Standard deviation of one row, or of one whose relative error is 1.
    pub(crate) error: f64,
    /// Degrees of freedom of that standard deviation.
    pub(crate) freedom: f64,
}

/// A step this many standard errors high is a jump.
const JUMP: f64 = 10.0;
/// The distance counts as this part of a value's range in the length of the path.
const DISTANCE_SHARE: f64 = 0.15;
/// Fewest rows of a bin to which a parabola is fitted.
const MIN_PARABOLA: usize = 8;
/// A parabola through the bin alone is used where the bend is more than this many standard errors of
/// the mean.
const BENT: f64 = 1.0;
/// A bin with a bend of more than this many standard errors of its mean is halved.
const SPLIT: f64 = 0.5;
/// Fewest rows of each half of a bin.
const MIN_SPLIT: usize = 5;
/// Share of the noise in the path.
const NOISE_OF_PATH: f64 = 0.35;
/// Rows whose worth the scatter of all bins has in that of one bin.
const PRIOR: f64 = 20.0;
/// Variances of bins that noise would exceed as seldom as a normal deviate exceeds this value do not
/// count in the common one.
const OUTLYING: f64 = 4.0;
/// A slope of the free rows of more than this many standard errors is a drift.
const DRIFT: f64 = 2.0;
/// A row after the free ones is one of them within so many standard errors of their level.
const ON_LEVEL: f64 = 2.5;
/// Fewest free rows of a curve and direction whose scatter counts.
const MIN_FREE: usize = 4;
/// Least scatter, relative to the largest value; of an angle, in degrees.
const FLOORS: [f64; 2] = [1e-4, 0.01];

/// Bins of consecutive rows, at most about `count`: `values` are the columns, `errors` the standard
/// errors of one row.
pub fn bins(
    distance: &[f64],
    values: &[Vec<f64>],
    errors: &[f64],
    count: usize,
) -> Vec<Range<usize>> {
    let rows = distance.len();
    let range = |of: &[f64]| {
        let [low, high] = span(of.iter().copied().filter(|value| value.is_finite()));
        if high > low { high - low } else { 1.0 }
    };
    let smooth = |of: &[f64], k: usize, half: usize| {
        let near = &of[k.saturating_sub(half)..(k + half + 1).min(rows)];
        near.iter().sum::<f64>() / near.len() as f64
    };
    let ranges: Vec<f64> = values.iter().map(|column| range(column)).collect();
    // As many rows on either side as leave little noise in the path: bins that end where the noise is
    // large have less scatter within them than between them.
    let [least, most] = [4, 1].map(|part| rows / (part * count).max(1));
    let half = |(error, range): (&f64, &f64)| {
        let rows = rows as f64 * error / (NOISE_OF_PATH * range);
        (rows as usize).clamp(least, most)
    };
    let halves: Vec<usize> = errors.iter().zip(&ranges).map(half).collect();
    let across = range(distance) / DISTANCE_SHARE;
    let mut path = vec![0.0];
    let mut breaks = vec![false];
    for k in 1..rows {
        let mut square = ((distance[k] - distance[k - 1]) / across).powi(2);
        for ((column, range), half) in values.iter().zip(&ranges).zip(&halves) {
            let step = (smooth(column, k, *half) - smooth(column, k - 1, *half)) / range;
            square += if step.is_finite() { step * step } else { 0.0 };
        }
        path.push(path[k - 1] + square.sqrt());
        breaks.push(is_jump(values, errors, k));
    }
    let whole = path.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
    let place = |k: usize| (path[k] / whole * count as f64).min(count as f64 - 1.0) as usize;
    let mut bins = Vec::new();
    let mut first = 0;
    for k in 1..=rows {
        if k == rows || breaks[k] || place(k) != place(first) {
            bins.push(first..k);
            first = k;
        }
    }
    bins
}

/// Whether the values of a row are far from those of the row before.
fn is_jump(values: &[Vec<f64>], errors: &[f64], row: usize) -> bool {
    let mut steps = values.iter().zip(errors);
    steps.any(|(of, error)| (of[row] - of[row - 1]).abs() > JUMP * error)
}

/// The rows of a bin and as many on either side, up to a jump.
fn neighbourhood(values: &[Vec<f64>], errors: &[f64], bin: &Range<usize>) -> Range<usize> {
    let rows = values.first().map_or(0, Vec::len);
    let (mut first, mut end) = (bin.start, bin.end);
    while first > bin.start.saturating_sub(bin.len()) && !is_jump(values, errors, first) {
        first -= 1;
    }
    while end < (bin.end + bin.len()).min(rows) && !is_jump(values, errors, end) {
        end += 1;
    }
    first..end
}

/// The standard deviation of the values in a sequence of rows, from third differences, which a
/// smooth curve hardly has.
pub(super) fn scatter_of_row(values: &[f64]) -> f64 {
    let third = |w: &[f64]| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs();
    let differences: Vec<f64> = values.windows(4).map(third).collect();
    let known: Vec<f64> = differences.into_iter().filter(|d| d.is_finite()).collect();
    1.4826 * median(known) / 20f64.sqrt()
}

/// Consecutive rows of one direction, as columns.
struct Segment<'a> {
    rows: &'a [Row],
    distance: Vec<f64>,
    /// One per column; angles without jumps by a turn, NaN where nothing was measured.
    values: Vec<Vec<f64>>,
}

impl<'a> Segment<'a> {
    fn of(rows: &'a [Row], columns: &[Column]) -> Self {
        let values = columns.iter().enumerate().map(|(index, column)| {
            let mut last = f64::NAN;
            let rows = rows.iter().map(|row| {
                let value = row.values[index].unwrap_or(f64::NAN);
                let value = if column.quantity.is_angle() && last.is_finite() {
                    last + wrapped(value - last)
                } else {
                    value
                };
                if value.is_finite() {
                    last = value;
                }
                value
            });
            rows.collect()
        });
        Self {
            rows,
            distance: rows.iter().map(|row| row.at[0]).collect(),
            values: values.collect(),
        }
    }
}

/// The segments of a curve.
fn segments<'a>(curve: &'a Curve, columns: &'a [Column]) -> impl Iterator<Item = Segment<'a>> {
    let same = |a: &Row, b: &Row| a.way == b.way && a.at[1..] == b.at[1..];
    let parts = curve.rows.chunk_by(same);
    parts.map(|rows| Segment::of(rows, columns))
}

/// A polynomial in the distance through some rows, by least squares.
struct Polynomial {
    /// Its value at the mean distance.
    value: f64,
    /// The standard error of that value, for rows with standard error 1.
    error: f64,
    /// How far it lies from the mean of the rows there.
    bend: f64,
    /// Covariances of that and the coefficients of 1, u and u², for rows with standard error 1. u is
    /// the distance from the first number in units of the second.
    bend_covariance: [f64; 3],
    u: [f64; 2],
    /// Mean of u² over the rows.
    square: f64,
    /// Sum of the squared residuals, and their degrees of freedom.
    squares: f64,
    freedom: f64,
}

impl Polynomial {
    /// Fits a polynomial of the given degree; `None` if the rows do not determine it.
    fn of(distance: &[f64], values: &[f64], degree: usize) -> Option<Self> {
        let count = distance.len();
        if count <= degree {
            return None;
        }
        let mean = distance.iter().sum::<f64>() / count as f64;
        let size = distance
            .iter()
            .fold(0.0, |m: f64, x| m.max((x - mean).abs()));
        if degree > 0 && size == 0.0 {
            return None;
        }
        let u = |k: usize| (distance[k] - mean) / size.max(f64::MIN_POSITIVE);
        let square = (0..count).map(|k| u(k) * u(k)).sum::<f64>() / count as f64;
        let matrix = DMatrix::from_fn(count, degree + 1, |k, j| match j {
            0 => 1.0,
            1 => u(k),
            _ => u(k) * u(k),
        });
        let covariance = matrix.tr_mul(&matrix).try_inverse()?;
        let right = DVector::from_column_slice(values);
        let found = &covariance * matrix.tr_mul(&right);
        let residuals = right - matrix * &found;
        let known = found.iter().all(|c| c.is_finite());
        known.then(|| Self {
            u: [mean, size.max(f64::MIN_POSITIVE)],
            square,
            value: found[0],
            error: covariance[(0, 0)].sqrt(),
            bend: if degree > 1 { found[2] * square } else { 0.0 },
            bend_covariance: [0, 1, 2].map(|k| {
                if degree > 1 {
                    covariance[(2, k)] * square
                } else {
                    0.0
                }
            }),
            squares: residuals.norm_squared(),
            freedom: (count - degree - 1) as f64,
        })
    }

    /// Returns the variance that subtracting this `part` of the bend adds to that of the mean of
    /// some of the rows, for rows with standard error 1.
    fn variance_without_bend(&self, distance: &[f64], part: f64) -> f64 {
        let [middle, size] = self.u;
        let powers = distance.iter().map(|z| (z - middle) / size);
        let sums = powers.fold([0.0; 3], |[a, b, c], u| [a + 1.0, b + u, c + u * u]);
        let shared = self.bend_covariance.iter().zip(sums);
        let shared: f64 = shared.map(|(c, sum)| c * sum / sums[0]).sum();
        let square = self.square * self.bend_covariance[2];
        part * part * square - 2.0 * part * shared
    }
}

/// The level of some rows, or a line through them where they drift, and whether they do: a slope
/// costs a degree of freedom of few.
fn level_or_line(distance: &[f64], values: &[f64], rows: &[usize]) -> Option<(Polynomial, bool)> {
    let pick = |of: &[f64]| -> Vec<f64> { rows.iter().map(|k| of[*k]).collect() };
    let (distance, values) = (pick(distance), pick(values));
    let level = Polynomial::of(&distance, &values, 0)?;
    let Some(line) = Polynomial::of(&distance, &values, 1) else {
        return Some((level, false));
    };
    let share = (level.squares - line.squares) / (line.squares / line.freedom);
    Some(if share > DRIFT * DRIFT {
        (line, true)
    } else {
        (level, false)
    })
}

/// Whether a value lies on the level of others, which do not drift.
fn is_level(distance: &[f64], values: &[f64], rows: &[usize], row: usize) -> bool {
    level_or_line(distance, values, rows).is_some_and(|(level, drifts)| {
        let error = (level.squares / level.freedom).sqrt() * (1.0 + level.error.powi(2)).sqrt();
        !drifts && (values[row] - level.value).abs() <= ON_LEVEL * error
    })
}

impl Data {
    /// The scatter of each column in the rows far from the sample, about their level in every curve
    /// and direction, or about a line if they drift; nothing if the distance is not what varies, or
    /// too few rows are far.
    pub(super) fn add_free_scatter(&mut self) {
        let amplitude = self
            .columns
            .iter()
            .position(|c| matches!(c.quantity.name(), "first_harmonic" | "amplitude"));
        let is_force_curve = self.is_force_curve();
        let level = if is_force_curve { Some(0) } else { amplitude };
        let (Some(level), true) = (level, self.varies_distance()) else {
            return;
        };
        let mut sums = vec![(0.0, 0.0); self.columns.len()];
        let mut known = Vec::new();
        for (index, curve) in self.curves.iter().enumerate() {
            let mut before = 0;
            for segment in segments(curve, &self.columns) {
                let of_level = &segment.values[level];
                let [mut free, doubtful] = if is_force_curve {
                    baseline_rows(&segment.distance, of_level)
                } else {
                    far_and_doubtful_rows(&segment.distance, of_level)
                };
                let first = before;
                before += segment.rows.len();
                if free.len() < MIN_FREE {
                    continue;
                }
                for row in doubtful {
                    let mut columns = segment.values.iter();
                    if !columns.all(|values| is_level(&segment.distance, values, &free, row)) {
                        break;
                    }
                    free.push(row);
                }
                known.extend(free.iter().map(|row| (index, first + row)));
                for (values, sum) in segment.values.iter().zip(&mut sums) {
                    let found = level_or_line(&segment.distance, values, &free);
                    if let Some((of, _)) = found {
                        sum.0 += of.squares;
                        sum.1 += of.freedom;
                    }
                }
            }
        }
        for (curve, row) in known {
            self.curves[curve].rows[row].is_free = true;
        }
        for (index, (squares, freedom)) in sums.into_iter().enumerate() {
            if freedom > 0.0 {
                self.columns[index].scatter = Some(Scatter {
                    error: (squares / freedom).sqrt().max(self.floor(index)),
                    freedom,
                });
            }
        }
    }

    /// Smallest scatter that counts as one.
    fn floor(&self, column: usize) -> f64 {
        if self.columns[column].quantity.is_angle() {
            return FLOORS[1];
        }
        let values = self.rows().filter_map(|row| row.values[column]);
        FLOORS[0] * values.fold(0.0, |m: f64, value| m.max(value.abs()))
    }

    /// True if the first of the positions is a distance.
    fn varies_distance(&self) -> bool {
        self.swept
            .first()
            .is_some_and(|swept| is_distance(swept.key))
    }

    /// Averages of consecutive rows, about `count` in all, if there are more than twice as many:
    /// says how many rows became how many.
    pub(super) fn average(&mut self, count: usize) -> Option<String> {
        let rows = self.rows().count();
        if count == 0 || rows <= 2 * count || !self.varies_distance() {
            return None;
        }
        let mut binned: Vec<(usize, Vec<Row>, Vec<Bin>)> = Vec::new();
        for (index, curve) in self.curves.iter().enumerate() {
            for segment in segments(curve, &self.columns) {
                let errors: Vec<f64> = segment
                    .values
                    .iter()
                    .enumerate()
                    .map(|(column, values)| scatter_of_row(values).max(self.floor(column)))
                    .collect();
                let share = (count * segment.rows.len()).div_ceil(rows).max(2);
                let ranges = bins(&segment.distance, &segment.values, &errors, share);
                let mut made = Vec::new();
                for range in ranges {
                    Bin::add(&segment, &errors, range, &mut made);
                }
                binned.push((index, segment.rows.to_vec(), made));
            }
        }
        let scatter: Vec<Scatter> = (0..self.columns.len())
            .map(|column| {
                let bins = binned.iter().flat_map(|(_, _, bins)| bins);
                common(bins.filter_map(|bin| bin.fits[column].as_ref()))
            })
            .map(|(variance, freedom)| Scatter {
                error: variance.sqrt(),
                freedom,
            })
            .collect();
        for curve in &mut self.curves {
            curve.rows.clear();
        }
        for (curve, rows, bins) in binned {
            let made = bins.iter().map(|bin| bin.row(&rows, &scatter));
            self.curves[curve].rows.extend(made);
        }
        for (index, of) in scatter.into_iter().enumerate() {
            let floor = self.floor(index);
            self.columns[index].scatter = (of.freedom > 0.0).then(|| Scatter {
                error: of.error.max(floor),
                ..of
            });
        }
        let averages = self.rows().count();
        Some(format!(
            "{rows} rows were averaged to {averages}, with standard errors from their scatter; the \
             option `rows` sets how many, 0 uses every row"
        ))
    }
}

/// Mean square of the distances from their mean.
fn spread(distance: &[f64]) -> f64 {
    let count = distance.len() as f64;
    let mean = distance.iter().sum::<f64>() / count;
    distance.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / count
}

/// Consecutive rows that become one.
struct Bin {
    range: Range<usize>,
    distance: f64,
    /// The polynomials of each column: the mean, and a parabola or a line.
    fits: Vec<Option<Fits>>,
}

struct Fits {
    mean: f64,
    count: usize,
    /// How far the mean lies from the curve, and the variance of the mean without that for rows with
    /// standard error 1: the rows of the bin are among those that the bend is known from.
    bend: f64,
    variance: f64,
    best: Option<Polynomial>,
}

impl Bin {
    /// Adds the bin of these rows, in halves if the curve bends too much in it.
    fn add(segment: &Segment<'_>, errors: &[f64], range: Range<usize>, to: &mut Vec<Self>) {
        let bin = Self::of(segment, errors, range);
        let bends = bin.fits.iter().zip(errors).any(|(fits, error)| {
            let bent = |of: &Fits| of.bend.abs() * (of.count as f64).sqrt() > SPLIT * error;
            fits.as_ref().is_some_and(bent)
        });
        if bends && bin.range.len() >= 2 * MIN_SPLIT {
            let middle = bin.range.start + bin.range.len() / 2;
            for half in [bin.range.start..middle, middle..bin.range.end] {
                Self::add(segment, errors, half, to);
            }
        } else {
            to.push(bin);
        }
    }

    fn of(segment: &Segment<'_>, errors: &[f64], range: Range<usize>) -> Self {
        let around = neighbourhood(&segment.values, errors, &range);
        let fits = segment.values.iter().map(|values| {
            let pick = |range: &Range<usize>| -> (Vec<f64>, Vec<f64>) {
                let known = range.clone().filter(|k| values[*k].is_finite());
                known.map(|k| (segment.distance[k], values[k])).unzip()
            };
            let (distance, values) = pick(&range);
            let degree = match values.len() {
                0 => return None,
                1..3 => 0,
                3..MIN_PARABOLA => 1,
                _ => 2,
            };
            let (wide, of_wide) = pick(&around);
            let parabola = (wide.len() >= MIN_PARABOLA)
                .then(|| Polynomial::of(&wide, &of_wide, 2))
                .flatten();
            let part = spread(&distance) / spread(&wide);
            let of_mean = 1.0 / values.len() as f64;
            let variance = |p: &Polynomial| of_mean + p.variance_without_bend(&distance, part);
            Some(Fits {
                mean: values.iter().sum::<f64>() * of_mean,
                count: values.len(),
                bend: parabola.as_ref().map_or(0.0, |p| part * p.bend),
                variance: parabola.as_ref().map_or(of_mean, variance),
                best: (degree > 0)
                    .then(|| Polynomial::of(&distance, &values, degree))
                    .flatten(),
            })
        });
        Self {
            fits: fits.collect(),
            distance: segment.distance[range.clone()].iter().sum::<f64>() / range.len() as f64,
            range,
        }
    }

    /// The average, with errors relative to the common scatter where the rows give none.
    fn row(&self, rows: &[Row], scatter: &[Scatter]) -> Row {
        let rows = &rows[self.range.clone()];
        let mut row = rows[0].clone();
        row.at[0] = self.distance;
        row.ramp = Ramp::mean(rows);
        row.count = rows.iter().map(|row| row.count).sum();
        // The scatter of averages is known from their own rows.
        row.is_free = false;
        for (column, fits) in self.fits.iter().enumerate() {
            let Some(fits) = fits else {
                (row.values[column], row.errors[column]) = (None, None);
                continue;
            };
            let common = scatter[column].error;
            let mut own = common;
            let of_mean = 1.0 / fits.count as f64;
            let (mut value, mut part) = (fits.mean - fits.bend, fits.variance.sqrt());
            if let Some(best) = &fits.best {
                let (given, freedom) = (common * common, best.freedom);
                own = ((PRIOR * given + best.squares) / (PRIOR + freedom)).sqrt();
                let is_parabola = best.bend_covariance[2] > 0.0;
                if is_parabola && fits.bend.abs() > BENT * of_mean.sqrt() * own {
                    (value, part) = (best.value, best.error);
                }
            }
            row.values[column] = Some(value);
            let squares: Option<f64> = rows.iter().map(|r| Some(r.errors[column]?.powi(2))).sum();
            row.errors[column] = squares
                .map(|sum| (sum / fits.count as f64).sqrt() * part)
                .filter(|_| fits.count == rows.len());
            row.relative[column] = if common > 0.0 {
                own / common * part
            } else {
                part
            };
        }
        row
    }
}

/// The common variance of bins, and its degrees of freedom. Bins in which something else happens
/// than noise do not count.
fn common<'a>(fits: impl Iterator<Item = &'a Fits>) -> (f64, f64) {
    let known: Vec<(f64, f64)> = fits
        .filter_map(|fits| fits.best.as_ref())
        .filter(|best| best.freedom > 0.0)
        .map(|best| (best.squares / best.freedom, best.freedom))
        .collect();
    let relative = known
        .iter()
        .map(|(variance, of)| variance / quantile(*of, 0.0));
    let middle = median(relative.collect());
    let counted = known
        .iter()
        .filter(|(variance, of)| *variance <= middle * quantile(*of, OUTLYING));
    let (sum, freedom) = counted.fold((0.0, 0.0), |(sum, freedom), (variance, of)| {
        (sum + variance * of, freedom + of)
    });
    (if freedom > 0.0 { sum / freedom } else { 0.0 }, freedom)
}

/// χ² over its degrees of freedom that a normal deviate `z` corresponds to (Wilson and Hilferty,
/// PNAS 17, 684 (1931)).
fn quantile(freedom: f64, z: f64) -> f64 {
    let variance = 2.0 / (9.0 * freedom);
    (1.0 - variance + z * variance.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_end_at_jumps_and_keep_knees() {
        // Flat, a slope, and a jump by 5 in the middle of the slope.
        let distance: Vec<f64> = (0..400).map(|k| 0.05 * f64::from(k)).collect();
        let value = |x: f64| if x < 10.0 { 10.0 } else { x } + if x > 15.0 { 5.0 } else { 0.0 };
        let values: Vec<f64> = distance.iter().map(|x| value(*x)).collect();
        let found = bins(&distance, &[values], &[0.1], 20);
        assert!(found.windows(2).all(|w| w[0].end == w[1].start));
        assert!(
            found
                .iter()
                .any(|bin| distance[bin.start] > 15.0 && distance[bin.start - 1] <= 15.0)
        );
        let flat = found
            .iter()
            .filter(|bin| distance[bin.end - 1] < 9.0)
            .count();
        let steep = found
            .iter()
            .filter(|bin| distance[bin.start] > 10.0)
            .count();
        assert!(
            flat < 5 && steep > 10 && found.len() <= 23,
            "{flat} {steep}"
        );
    }

    #[test]
    fn quantiles_of_chi_squared_are_those_of_tables() {
        // Abramowitz & Stegun, table 26.8: the median and the 0.1 % point of 2 and of 10 degrees.
        for (freedom, z, value) in [(2.0, 0.0, 1.386), (10.0, 0.0, 9.342), (10.0, 3.09, 29.588)] {
            let found = freedom * quantile(freedom, z);
            assert!((found / value - 1.0).abs() < 0.02, "{freedom} {found}");
        }
    }

    #[test]
    fn averages_lie_on_a_bent_curve_and_have_the_errors_of_means() {
        // A parabola in bins of 5 and of 12 rows; the mean of the outer ones lies off it by less
        // than its standard error.
        let distance: Vec<f64> = (0..60).map(|k| 0.1 * f64::from(k)).collect();
        let values: Vec<f64> = distance.iter().map(|x| 3.0 + x + 0.2 * x * x).collect();
        let segment = Segment {
            rows: &[],
            distance: distance.clone(),
            values: vec![values],
        };
        for count in [5, 12] {
            let bin = Bin::of(&segment, &[0.5], 20..20 + count);
            let fits = bin.fits[0].as_ref().unwrap();
            let at = 3.0 + bin.distance + 0.2 * bin.distance * bin.distance;
            assert!((fits.mean - fits.bend - at).abs() < 1e-12, "{count}");
            assert!(fits.bend.abs() > 1e-3);
            // The average is linear in the values: its variance is the sum of its squared weights.
            let weight = |row: usize| {
                let mut segment = Segment {
                    rows: &[],
                    distance: distance.clone(),
                    values: vec![vec![0.0; distance.len()]],
                };
                segment.values[0][row] = 1.0;
                let bin = Bin::of(&segment, &[0.5], 20..20 + count);
                let fits = bin.fits[0].as_ref().unwrap();
                fits.mean - fits.bend
            };
            let variance: f64 = (0..distance.len()).map(|row| weight(row).powi(2)).sum();
            assert!((variance / fits.variance - 1.0).abs() < 1e-12, "{count}");
        }
    }

    #[test]
    fn a_parabola_gives_the_curve_where_the_mean_does_not() {
        let distance: Vec<f64> = (0..11).map(|k| f64::from(k) - 5.0).collect();
        let values: Vec<f64> = distance.iter().map(|x| 2.0 + x + 0.5 * x * x).collect();
        let found = Polynomial::of(&distance, &values, 2).unwrap();
        assert!((found.value - 2.0).abs() < 1e-12 && found.squares < 1e-20);
        // The mean of x² over −5 … 5 in steps of 1 is 10.
        assert!((found.bend - 5.0).abs() < 1e-12);
    }
}
