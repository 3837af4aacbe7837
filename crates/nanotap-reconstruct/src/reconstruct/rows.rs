//! The rows of a measured curve: the columns that are used, the free level, the noise, and averages
//! of many rows.

use nanotap_error::Error;
use nanotap_fit::fit::instrument::{median, wrapped};
use nanotap_fit::fit::thin::bins;
use nanotap_fit::fit::{Data, Row};
use nanotap_motions::approach::Way;
use nanotap_observe::table::shown_phase;

/// Least number of rows of the free level.
const MIN_FREE: usize = 3;
/// Least number of rows for a standard error from third differences.
const MIN_SCATTER: usize = 8;
/// A running mean this far from the free level, relative, is not free.
const FREE_RANGE: f64 = 0.01;
/// Least standard errors: relative to the free amplitude or the largest shift, and in degrees.
const FLOORS: [f64; 2] = [1e-4, 0.01];

/// Quantities that the columns contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Amplitude and phase at a constant drive.
    Amplitude,
    /// Frequency shift, and perhaps the excitation.
    Frequency {
        /// Whether the shift is relative to the free frequency.
        relative: bool,
        /// Quantity by which the excitation is measured, if it is.
        excitation: Option<Excitation>,
    },
}

/// Quantity by which the excitation of frequency modulation is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Excitation {
    /// The drive's strength over that of the free lever.
    Ratio,
    /// Dissipated energy per period.
    Energy,
}

/// A measured row, or the average of several.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    pub(super) curve: usize,
    pub(super) way: Option<Way>,
    /// Line of the file, or row from 1.
    pub(super) line: u64,
    /// Number of rows that were averaged.
    pub(super) count: usize,
    pub(super) distance: f64,
    /// Amplitude and phase (degrees), or shift and excitation; NaN where not measured.
    pub(super) values: [f64; 2],
    /// Standard errors of `values`, if they are given.
    pub(super) errors: [Option<f64>; 2],
}

/// All rows in the order of measurement.
#[derive(Clone, Debug)]
pub(super) struct Readings {
    pub(super) kind: Kind,
    pub(super) rows: Vec<Reading>,
    /// Names of the curves, by index.
    pub(super) curves: Vec<String>,
    /// Number of rows that lack a value and are left out.
    pub(super) incomplete: usize,
}

impl Readings {
    /// # Errors
    /// When amplitude and phase, or the frequency shift, are missing, or a value is impossible.
    pub(super) fn of(data: &Data) -> Result<Self, Error> {
        let column = |name: &str| data.columns.iter().position(|c| c.quantity.name() == name);
        let missing = |what: &str| {
            Error::option(
                "data",
                format!("no column has the {what}"),
                "`reconstruct` needs distance, amplitude and phase, or distance and frequency \
                 shift: name the columns as in `amplitude (nm)`",
            )
        };
        let shift = ["frequency_shift", "relative_shift"].map(column);
        let (kind, places) = match shift {
            [None, None] => {
                let amplitude = column("first_harmonic").ok_or_else(|| missing("amplitude"))?;
                let phase = column("phase").ok_or_else(|| missing("phase"))?;
                (Kind::Amplitude, [Some(amplitude), Some(phase)])
            }
            [absolute, relative] => {
                let energy = column("drive_dissipation").map(|k| (k, Excitation::Energy));
                let ratio = column("drive_ratio").map(|k| (k, Excitation::Ratio));
                let excitation = energy.or(ratio);
                let kind = Kind::Frequency {
                    relative: absolute.is_none(),
                    excitation: excitation.map(|(_, what)| what),
                };
                (kind, [absolute.or(relative), excitation.map(|(k, _)| k)])
            }
        };
        if !data
            .swept
            .first()
            .is_some_and(|swept| nanotap_fit::fit::is_distance(swept.key))
        {
            return Err(missing("distance"));
        }
        let mut readings = Self {
            kind,
            rows: Vec::new(),
            curves: data.curves.iter().map(|curve| curve.name.clone()).collect(),
            incomplete: 0,
        };
        for (curve, measured) in data.curves.iter().enumerate() {
            for row in &measured.rows {
                readings.add(curve, &measured.name, row, places)?;
            }
        }
        Ok(readings)
    }

    fn add(
        &mut self,
        curve: usize,
        name: &str,
        row: &Row,
        places: [Option<usize>; 2],
    ) -> Result<(), Error> {
        let value = |place: Option<usize>| place.and_then(|k| row.values[k]);
        let values = places.map(value);
        if values[0].is_none() || places[1].is_some() && values[1].is_none() {
            self.incomplete += 1;
            return Ok(());
        }
        let first = values[0].unwrap_or_default();
        if self.kind == Kind::Amplitude && first <= 0.0 {
            return Err(Error::input(
                format!(
                    "{name}, line {}: the amplitude {first} is not positive",
                    row.line
                ),
                "check the amplitude's offset and conversion, or leave the row away",
            ));
        }
        self.rows.push(Reading {
            curve,
            way: row.way,
            line: row.line,
            count: 1,
            distance: row.at[0],
            values: values.map(|value| value.unwrap_or(f64::NAN)),
            errors: places.map(|place| place.and_then(|k| row.errors[k])),
        });
        Ok(())
    }

    /// Rows of one curve and direction, in the order of measurement.
    fn segments(&self) -> impl Iterator<Item = &[Reading]> {
        self.rows
            .chunk_by(|a, b| a.curve == b.curve && a.way == b.way)
    }

    /// Returns the level far from the sample: median amplitude and phase, and the number of rows
    /// with it.
    pub(super) fn free_level(&self) -> Option<FreeLevel> {
        let mut free: Vec<Reading> = Vec::new();
        let mut drift: f64 = 0.0;
        for segment in self.segments() {
            let mut rows = segment.to_vec();
            rows.sort_by(|a, b| b.distance.total_cmp(&a.distance));
            let rows = &rows[..free_rows(&rows)];
            let own = phase_drift(rows);
            if own.abs() > drift.abs() {
                drift = own;
            }
            free.extend(rows);
        }
        if free.len() < MIN_FREE {
            return None;
        }
        let reference = free[0].values[1];
        let amplitude = median(free.iter().map(|row| row.values[0]).collect());
        let turn = median(
            free.iter()
                .map(|row| wrapped(row.values[1] - reference))
                .collect(),
        );
        Some(FreeLevel {
            amplitude,
            phase: shown_phase(reference + turn),
            drift,
            rows: free.len(),
        })
    }

    /// Standard errors from third differences, where they are not given: of the rows that are at
    /// least 0.97 of `free` where there are enough.
    pub(super) fn scatter(&self, free: f64) -> [Option<f64>; 2] {
        [0, 1].map(|index| {
            let of = |far: bool| -> Vec<f64> {
                let differences = self.segments().flat_map(|segment| {
                    let rows = segment.iter();
                    let rows = rows.filter(|row| {
                        !far || self.kind != Kind::Amplitude || row.values[0] > 0.97 * free
                    });
                    let values: Vec<f64> = rows.map(|row| row.values[index]).collect();
                    let third = |w: &[f64]| {
                        let step = |k: usize| {
                            let step = w[k + 1] - w[k];
                            if index == 1 && self.kind == Kind::Amplitude {
                                wrapped(step)
                            } else {
                                step
                            }
                        };
                        step(2) - 2.0 * step(1) + step(0)
                    };
                    values.windows(4).map(third).collect::<Vec<f64>>()
                });
                differences.filter(|value| value.is_finite()).collect()
            };
            let estimate = |far: bool| {
                let deviations: Vec<f64> = of(far).iter().map(|value| value.abs()).collect();
                let enough = deviations.len() >= MIN_SCATTER;
                enough.then(|| 1.4826 * median(deviations) / 20f64.sqrt())
            };
            // Few far rows are uncertain, and all rows may be too far apart.
            match (estimate(true), estimate(false)) {
                (Some(far), Some(all)) if far < 0.6 * all => Some(far),
                (far, all) => all.or(far),
            }
        })
    }

    /// Averages of consecutive rows, at most about `count` in all, with the standard errors
    /// `errors` of one row.
    pub(super) fn averaged(&self, count: usize, errors: [f64; 2]) -> Self {
        let segments = self.segments().count().max(1);
        let count = (count / segments).max(1);
        let mut rows = Vec::new();
        for segment in self.segments() {
            let of =
                |of: &dyn Fn(&Reading) -> f64| -> Vec<f64> { segment.iter().map(of).collect() };
            let values = [0, 1].map(|index| of(&|row| row.values[index]));
            let bins = bins(&of(&|row| row.distance), &values, &errors, count);
            rows.extend(bins.into_iter().map(|bin| mean(&segment[bin])));
        }
        Self {
            rows,
            ..self.clone()
        }
    }
}

/// Amplitude and phase of the rows far from the sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct FreeLevel {
    /// Median amplitude, m or model units.
    pub(super) amplitude: f64,
    /// Median phase lag, degrees.
    pub(super) phase: f64,
    /// By how much the phase changes over the rows of a segment, by a straight line, degrees: the largest.
    pub(super) drift: f64,
    /// Number of rows with this level.
    pub(super) rows: usize,
}

/// By how much the phase changes over rows, by a straight line, degrees.
fn phase_drift(rows: &[Reading]) -> f64 {
    let Some(first) = rows.first() else {
        return 0.0;
    };
    let points: Vec<[f64; 2]> = rows
        .iter()
        .map(|row| [row.distance, wrapped(row.values[1] - first.values[1])])
        .collect();
    let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64;
    let centre = [mean(0), mean(1)];
    let sum = |of: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(of).sum::<f64>();
    let square = sum(&|p| (p[0] - centre[0]).powi(2));
    let slope = sum(&|p| (p[0] - centre[0]) * (p[1] - centre[1])) / square;
    let span = points[points.len() - 1][0] - points[0][0];
    let drift = slope * span;
    if drift.is_finite() { drift } else { 0.0 }
}

/// How many of the rows, the farthest first, are free: those before the amplitude leaves its
/// level, less a fifth, and of many the farther half.
fn free_rows(rows: &[Reading]) -> usize {
    let far = (rows.len() / 20).max(5).min(rows.len());
    let level = median(rows[..far].iter().map(|row| row.values[0]).collect());
    let width = (rows.len() / 100).max(1);
    let deviates = |window: &[Reading]| {
        let mean = window.iter().map(|row| row.values[0]).sum::<f64>() / window.len() as f64;
        (mean / level - 1.0).abs() > FREE_RANGE
    };
    let before = rows.windows(width).position(deviates).unwrap_or(rows.len());
    let kept = before * 4 / 5;
    if kept >= 20 { kept / 2 } else { kept }
}

/// The mean of several rows; its standard errors are those of a row over √n.
fn mean(rows: &[Reading]) -> Reading {
    let (count, first) = (rows.len() as f64, rows[0]);
    let average = |of: &dyn Fn(&Reading) -> f64| rows.iter().map(of).sum::<f64>() / count;
    let value = |index: usize| {
        let start = first.values[index];
        start + average(&|row| row.values[index] - start)
    };
    let error = |index: usize| {
        let squares: Option<f64> = rows.iter().map(|r| Some(r.errors[index]?.powi(2))).sum();
        squares.map(|squares| squares.sqrt() / count)
    };
    Reading {
        count: rows.len(),
        distance: average(&|row| row.distance),
        values: [value(0), value(1)],
        errors: [error(0), error(1)],
        ..first
    }
}

/// Least standard errors of amplitude and phase, or of shift and energy, whose largest values
/// are `sizes`.
pub(super) fn floors(kind: Kind, sizes: [f64; 2]) -> [f64; 2] {
    match kind {
        Kind::Amplitude => [FLOORS[0] * sizes[0], FLOORS[1]],
        Kind::Frequency { .. } => sizes.map(|size| (FLOORS[0] * size).max(f64::MIN_POSITIVE)),
    }
}
