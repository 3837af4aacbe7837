//! Conservative force and dissipation from a measured curve, without a contact law.
//!
//! Amplitude and phase, or frequency shift and excitation, give the first harmonic of the force at
//! each distance (module `lever`). Force and damping are the smooth functions of the distance whose
//! averages over the oscillations are these harmonics (module `inversion`): piecewise linear, with a
//! penalty on their roughness whose weight follows from the evidence. Rows of both branches and
//! directions go into one system of equations; none is differentiated or joined across a jump.
//!
//! Standard errors are those of the penalised least squares and the bias of the smoothing (module
//! `bias`). No force is reported beyond the closest approach, and none that the data do not determine.

mod bias;
mod inversion;
mod lever_response;
mod motion;
mod nodes;
mod report;
mod rows;
mod smooth;

use nanotap_arithmetic::powf;
use nanotap_case::physical::Remark;
use nanotap_dynamics::Control;
use nanotap_figures::Figure;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use report::{
    ForceCurve, ForceMinimum, Inflection, PlainCurve, ReconstructMethod, ReconstructReport,
    ReconstructedRow, WayCurve,
};

use crate::figure::reconstruct::reconstruct_figure;
use nanotap_case::Case;
use nanotap_case::physical::Kind as Quantity;
use nanotap_case::table::Table;
use nanotap_error::Error;
use nanotap_fit::fit::Data;
use nanotap_fit::fit::instrument::{self, wrapped};
use nanotap_motions::approach::Way;
use nanotap_motions::frequency_modulation::average::sader_jarvis;
use nanotap_observe::frame::Frame;
use nanotap_quantity::number::significant;
use nanotap_study::Study;
use nanotap_study::value::Amount;

use inversion::{Inversion, Inverted, Measured};
use lever_response::{Lever, Method};
use nodes::Kernel;
use rows::{Excitation, Kind, Readings, floors};

/// Standard errors of a row's phase by which the phase of free rows may change.
const DRIFT: f64 = 3.0;
/// Fewest rows that feel the sample.
const MIN_ROWS: usize = 8;
/// Number of such rows below which a warning is given.
const FEW_ROWS: usize = 25;
/// Greatest spacing of the nodes: in m, or for a dimensionless case as a fraction of the free
/// amplitude.
const WIDEST: [f64; 2] = [30e-12, 1.0 / 600.0];
/// Decrease of the amplitude, or frequency shift, above which a row feels the sample, as a fraction
/// of the free amplitude or the largest shift.
const FELT: f64 = 0.05;
/// Fewest rows that feel the sample in a direction that is inverted alone.
const ROWS_OF_A_WAY: usize = 15;
/// Mean squared residual, in standard errors, above which a warning is given.
const WORST_CHI2: f64 = 4.0;
/// Least force, in standard errors of the noise, above which it is reported as a minimum.
const SIGNIFICANT_MINIMUM: f64 = 3.0;
/// Range of distances without a row, in spacings of the nodes, that is a gap.
const GAP: f64 = 8.0;
/// Least number of rows of a bin in which approach and retract are compared.
const ROWS_OF_A_BIN: usize = 12;
/// Normal deviate above which the residuals of approach and retract differ: one curve in a thousand.
const DIFFERENT: f64 = 3.09;
/// Largest number of rows of the inversion.
const MAX_ROWS: usize = 2000;

/// Options of a reconstruction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReconstructOptions {
    /// Measured curves: tables whose columns are named as in `distance (nm)`, `amplitude (nm)`,
    /// `phase (deg)`, or `frequency_shift (Hz)`
    #[schemars(extend("x-own" = true))]
    pub data: Vec<Table>,
    /// Columns of the data that count; without it, all
    #[schemars(extend("x-value" = "NAME,…"))]
    pub columns: Vec<String>,
    /// Conversions of columns, as in Amp="58 nm/V", Phase=90-x, Zsnsr=-x or Ch3=amplitude
    #[schemars(extend("x-value" = "NAME=RULE"))]
    pub convert: Vec<String>,
    /// Free amplitude, as in "20 nm"; without it, that of the rows far from the sample
    #[schemars(extend("x-value" = "AMPLITUDE"))]
    pub free_amplitude: Option<Amount>,
    /// Free phase as measured, degrees; without it, that of the rows far from the sample
    #[schemars(extend("x-value" = "DEGREES"))]
    pub free_phase: Option<f64>,
    /// Standard error of an amplitude, as in "0.02 nm"; without it, from the scatter of the rows
    #[schemars(extend("x-value" = "AMPLITUDE"))]
    pub amplitude_error: Option<Amount>,
    /// Standard error of a phase, degrees; without it, from the scatter of the rows
    #[schemars(extend("x-value" = "DEGREES"))]
    pub phase_error: Option<f64>,
    /// Phase that was held under frequency modulation, degrees
    #[schemars(range(min = 0, max = 180), extend("x-value" = "DEGREES"))]
    pub phase: f64,
    /// Longer curves are averaged to about this many rows
    #[schemars(range(min = 20, max = MAX_ROWS), extend("x-value" = "ROWS"))]
    pub rows: usize,
}

impl Default for ReconstructOptions {
    fn default() -> Self {
        Self {
            data: Vec::new(),
            columns: Vec::new(),
            convert: Vec::new(),
            free_amplitude: None,
            free_phase: None,
            amplitude_error: None,
            phase_error: None,
            phase: 90.0,
            rows: 500,
        }
    }
}

/// Study that reconstructs force and dissipation from measured curves.
#[derive(Clone, Copy, Debug)]
pub struct ReconstructStudy;

impl Study for ReconstructStudy {
    const NAME: &'static str = "reconstruct";
    const ABOUT: &'static str = "Force and dissipation against distance from a measured curve";
    const COUNTED: &'static str = "passes";
    const ANY_DISTANCE: bool = true;
    type Options = ReconstructOptions;
    type Report = ReconstructReport;

    fn frames<'a>(_: &Case, report: &'a ReconstructReport) -> Vec<Frame<'a>> {
        vec![report.force_table(), report.summary_table()]
    }

    fn figure(_: &Case, report: &ReconstructReport) -> Option<Figure> {
        Some(reconstruct_figure(report))
    }

    fn remarks(_: &Case, report: &ReconstructReport) -> Vec<Remark> {
        Remark::warnings(&report.remarks)
    }

    fn compute(
        case: &Case,
        options: &ReconstructOptions,
        control: &Control<'_>,
    ) -> Result<ReconstructReport, Error> {
        reconstruct(case, options, control)
    }
}

/// Rows, ready for the inversion.
struct Prepared {
    readings: Readings,
    measured: Vec<Measured>,
    method: Method,
    gains: Vec<nanotap_flow::Complex>,
    has_damping: bool,
    free: [f64; 2],
    free_rows: usize,
    errors: [f64; 2],
    widest: f64,
    /// Angular frequency of the drive, rad/s or model units.
    angular_frequency: f64,
    remarks: Vec<String>,
}

/// Reconstructs force and dissipation.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::case::physical::Catalogue;
/// use nanotap::case::table::Table;
/// use nanotap::control::Control;
/// use nanotap::study::reconstruct::{ReconstructOptions, reconstruct};
/// use std::path::Path;
///
/// let file = Path::new("../../docs/cases/stiff-lever.toml");
/// let case = Case::load(Some(file), &[], &Catalogue::shared())?;
/// let data = Table::read(Path::new("../../docs/cases/polystyrene-curve.csv"))?;
/// let options = ReconstructOptions { data: vec![data], ..ReconstructOptions::default() };
/// let found = reconstruct(&case, &options, &Control::default())?;
/// // The sample is stiff: the tip indents it by less than 1.5 nm, at forces up to some 30 nN.
/// assert!(found.closest > -1.5e-9 && found.table.force.iter().any(|force| *force > 10e-9));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the data are not understood, too few rows feel the sample, no smooth force describes them,
/// or the work is cancelled.
pub fn reconstruct(
    case: &Case,
    options: &ReconstructOptions,
    control: &Control<'_>,
) -> Result<ReconstructReport, Error> {
    if options.data.is_empty() {
        return Err(Error::option("data", "there are no data", "give a table"));
    }
    let measured = instrument::prepared(case, &options.data, &options.convert, &options.columns)?;
    let data = Data::read(case, &measured.tables, &measured.columns)?;
    let prepared = Prepared::of(case, &data, options, measured.notes)?;
    let inverted = prepared.invert(None, control)?;
    let ways = prepared.ways(&inverted, control)?;
    if ways.is_empty() {
        inverted.check_residuals()?;
    }
    Ok(prepared.report(case, &inverted, ways))
}

impl Prepared {
    fn of(
        case: &Case,
        data: &Data,
        options: &ReconstructOptions,
        mut remarks: Vec<String>,
    ) -> Result<Self, Error> {
        let readings = Readings::of(data)?;
        let lever = Lever::of(case)?;
        if readings.incomplete > 0 {
            remarks.push(format!(
                "rows without all values, left out: {}",
                readings.incomplete
            ));
        }
        if data.left_out > 0 {
            remarks.push(format!(
                "rows of neither direction, left out: {}",
                data.left_out
            ));
        }
        match readings.kind {
            Kind::Amplitude => Self::amplitude(case, readings, &lever, options, remarks),
            Kind::Frequency { .. } => Self::frequency(case, readings, &lever, options, remarks),
        }
    }

    fn amplitude(
        case: &Case,
        mut readings: Readings,
        lever: &Lever,
        options: &ReconstructOptions,
        mut remarks: Vec<String>,
    ) -> Result<Self, Error> {
        let length = |option: &str, given: &Option<Amount>| match given {
            None => Ok(None),
            Some(amount) => length_of(case, amount).map_err(|e| e.at(option)).map(Some),
        };
        let level = readings.free_level();
        let given_amplitude = length("free_amplitude", &options.free_amplitude)?;
        if level.is_none() && (given_amplitude.is_none() || options.free_phase.is_none()) {
            remarks.push(
                "no rows are far from the sample: the free amplitude and phase are those of the \
                 case where they are not given"
                    .to_owned(),
            );
        }
        let amplitude = given_amplitude
            .or(level.map(|level| level.amplitude))
            .unwrap_or(lever.free_amplitude);
        let phase = options
            .free_phase
            .or(level.map(|level| level.phase))
            .unwrap_or(lever.free_phase);
        let scatter = readings.scatter(amplitude);
        let least = floors(readings.kind, [amplitude, 0.0]);
        let given = [
            length("amplitude_error", &options.amplitude_error)?,
            options.phase_error,
        ];
        let errors = errors(given, scatter, least, ["amplitude_error", "phase_error"])?;
        if let (None, Some(level)) = (options.free_phase, level)
            && level.drift.abs() > DRIFT * errors[1]
        {
            remarks.push(format!(
                "the phase changes by {}° over the {} rows whose median, {}°, is taken as free: if the \
                 sample acts there, the dissipation is wrong; give free_phase, or rows farther away",
                significant(level.drift.abs(), 2),
                level.rows,
                significant(level.phase, 5)
            ));
        }
        for row in &mut readings.rows {
            row.values[1] = lever.free_phase + wrapped(row.values[1] - phase);
        }
        let readings = averaged(readings, options.rows, errors, &mut remarks)?;
        let (method, gains) = lever.amplitude_modulation(amplitude)?;
        let physical = case.is_physical();
        let measured = measured(&readings, errors, least, |row| {
            row.values[0] < (1.0 - FELT) * amplitude
        });
        Ok(Self {
            measured,
            method,
            gains,
            has_damping: true,
            free: [amplitude, phase],
            free_rows: match (given_amplitude, options.free_phase) {
                (Some(_), Some(_)) => 0,
                _ => level.map_or(0, |level| level.rows),
            },
            errors,
            widest: if physical {
                WIDEST[0]
            } else {
                WIDEST[1] * amplitude
            },
            angular_frequency: lever.angular_frequency(),
            remarks,
            readings,
        })
    }

    fn frequency(
        case: &Case,
        mut readings: Readings,
        lever: &Lever,
        options: &ReconstructOptions,
        mut remarks: Vec<String>,
    ) -> Result<Self, Error> {
        let Kind::Frequency {
            relative,
            excitation,
        } = readings.kind
        else {
            return Err(Error::numerics("no frequency shift"));
        };
        let (method, gains, free) = lever.frequency_modulation(case, options.phase)?;
        for row in &mut readings.rows {
            let [shift, second] = &mut row.values;
            let [shift_error, second_error] = &mut row.errors;
            if !relative {
                *shift /= free.frequency;
                *shift_error = shift_error.map(|error| error / free.frequency);
            }
            if excitation == Some(Excitation::Ratio) {
                *second = free.loss * (*second - 1.0 - *shift);
                *second_error = second_error.map(|error| error * free.loss);
            }
        }
        let largest = [0, 1].map(|index| {
            let values = readings.rows.iter().map(|row| row.values[index].abs());
            values.filter(|value| value.is_finite()).fold(0.0, f64::max)
        });
        if largest[0] == 0.0 {
            return Err(Error::option(
                "data",
                "the frequency shift is zero in all rows",
                "give rows in which the sample is felt",
            ));
        }
        let least = floors(
            readings.kind,
            [largest[0], largest[1].max(1e-3 * free.loss)],
        );
        let errors = errors([None; 2], readings.scatter(0.0), least, ["", ""])?;
        let readings = averaged(readings, options.rows, errors, &mut remarks)?;
        let Method::Frequency { amplitude, .. } = method else {
            return Err(Error::numerics("no frequency shift"));
        };
        let mut measured = measured(&readings, errors, least, |row| {
            row.values[0].abs() > FELT * largest[0]
        });
        if excitation.is_none() {
            for row in &mut measured {
                row.values[1] = 0.0;
            }
        }
        Ok(Self {
            measured,
            method,
            gains,
            has_damping: excitation.is_some(),
            free: [amplitude, options.phase],
            free_rows: 0,
            errors,
            widest: if case.is_physical() {
                WIDEST[0]
            } else {
                WIDEST[1] * amplitude
            },
            angular_frequency: free.angular_frequency,
            remarks,
            readings,
        })
    }

    /// Inverts all rows, or those of one direction.
    fn invert(&self, way: Option<Way>, control: &Control<'_>) -> Result<Inverted, Error> {
        let rows = self.measured.iter().zip(&self.readings.rows);
        let rows = rows.filter(|(_, row)| way.is_none() || row.way == way);
        let rows: Vec<Measured> = rows.map(|(measured, _)| *measured).collect();
        let felt = rows.iter().filter(|row| row.informative).count();
        if felt < MIN_ROWS {
            return Err(Error::option(
                "data",
                format!("{felt} rows feel the sample; {MIN_ROWS} are needed, 25 are enough"),
                "measure more distances, or come nearer to the sample",
            ));
        }
        Inversion {
            rows: &rows,
            method: &self.method,
            gains: &self.gains,
            has_damping: self.has_damping,
            widest: self.widest,
        }
        .run(control)
    }

    /// Returns whether the residuals of the common force differ between approach and retract: in bins
    /// of the closest approach, where both have rows, their means differ by more than the scatter.
    fn ways_differ(&self, inverted: &Inverted) -> bool {
        let both = self
            .measured
            .iter()
            .zip(&self.readings.rows)
            .zip(&inverted.rows);
        let felt = both.filter(|((measured, row), _)| measured.informative && row.way.is_some());
        let mut rows: Vec<(f64, Option<Way>, f64)> = felt
            .map(|((_, row), inverted)| (inverted.closest, row.way, inverted.residual))
            .collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut bins, mut within, mut freedom) = (Vec::new(), 0.0, 0.0);
        for bin in rows.chunks(ROWS_OF_A_BIN.max(rows.len() / 12)) {
            let mut difference = [0.0; 2];
            let mut parts = [0.0; 2];
            for (k, way) in [Way::Approach, Way::Retract].into_iter().enumerate() {
                let of = bin.iter().filter(|row| row.1 == Some(way));
                let residuals: Vec<f64> = of.map(|row| row.2).collect();
                let count = residuals.len() as f64;
                difference[k] = residuals.iter().sum::<f64>() / count;
                parts[k] = 1.0 / count;
                within += residuals
                    .iter()
                    .map(|r| (r - difference[k]).powi(2))
                    .sum::<f64>();
                freedom += (count - 1.0).max(0.0);
            }
            let [approach, retract] = difference;
            let squared = (approach - retract).powi(2) / (parts[0] + parts[1]);
            if squared.is_finite() {
                bins.push(squared);
            }
        }
        // Wilson and Hilferty: the cube root of χ²/n is nearly normal.
        let count = bins.len() as f64;
        let ratio = bins.iter().sum::<f64>() / count / (within / freedom);
        let variance = 2.0 / (9.0 * count);
        (powf(ratio, 1.0 / 3.0) - 1.0 + variance) / variance.sqrt() > DIFFERENT
    }

    /// Inverts approach and retract separately, if both have enough rows and the residuals of the common
    /// force differ between them.
    fn ways(&self, common: &Inverted, control: &Control<'_>) -> Result<Vec<WayCurve>, Error> {
        let both = [Way::Approach, Way::Retract];
        let felt = |way: Way| {
            let rows = self.measured.iter().zip(&self.readings.rows);
            rows.filter(|(m, row)| m.informative && row.way == Some(way))
                .count()
        };
        if both.iter().any(|way| felt(*way) < ROWS_OF_A_WAY) || !self.ways_differ(common) {
            return Ok(Vec::new());
        }
        let silent = Control {
            progress: None,
            ..*control
        };
        let mut alone = Vec::new();
        for way in both {
            let inverted = self.invert(Some(way), &silent);
            match inverted.and_then(|one| one.check_residuals().map(|()| one)) {
                Ok(inverted) => alone.push(inverted),
                Err(_) if !control.is_cancelled() => return Ok(Vec::new()),
                Err(error) => return Err(error),
            }
        }
        let curves = both.into_iter().zip(&alone).map(|(way, inverted)| {
            let table = self.curve(inverted);
            let minimum = minimum(&table, inverted);
            WayCurve {
                way,
                table,
                minimum,
            }
        });
        Ok(curves.collect())
    }

    /// Returns force and dissipation from the least distance that is resolved outwards.
    fn curve(&self, inverted: &Inverted) -> ForceCurve {
        let nodes = &inverted.nodes;
        let (force, damping) = (&inverted.force, &inverted.damping);
        let amplitude = self.free[0];
        let factor = std::f64::consts::PI * amplitude * amplitude;
        let count = nodes.0.len();
        let first = nodes.0.partition_point(|x| *x < inverted.low);
        let coefficient =
            |of: &smooth::Smooth, k: usize| of.coefficients.get(k).copied().unwrap_or(0.0);
        let error = |of: &smooth::Smooth, k: usize| if k + 1 < count { of.error(k) } else { 0.0 };
        let unit = 1.0 / self.angular_frequency;
        let x = &nodes.0[first..];
        let mut closest: Vec<f64> = inverted.rows.iter().map(|row| row.closest).collect();
        closest.sort_by(f64::total_cmp);
        let widened = |mut values: Vec<[f64; 2]>, at: &dyn Fn(f64) -> f64| {
            let rows: Vec<(f64, f64)> = closest.iter().map(|x| (*x, at(*x))).collect();
            bias::widen_between(&mut values, x, &rows);
            values
        };
        let dissipation = |x: f64| {
            let weights = nodes.average(Kernel::Damping, x, amplitude);
            damping.sum(&weights).map(|value| factor * value)
        };
        let dissipated = widened(x.iter().map(|x| dissipation(*x)).collect(), &|x| {
            dissipation(x)[0]
        });
        let coefficients = (first..count)
            .map(|k| [coefficient(damping, k), error(damping, k)].map(|value| unit * value));
        let damped = widened(coefficients.collect(), &|x| {
            unit * nodes.value(&damping.coefficients, x)
        });
        // A quantity that was not measured has no values.
        let measured = |values: Vec<f64>| -> Vec<Option<f64>> {
            let values = values.into_iter();
            values
                .map(|value| self.has_damping.then_some(value))
                .collect()
        };
        let along = |of: &dyn Fn(usize) -> f64| -> Vec<f64> { (first..count).map(of).collect() };
        ForceCurve {
            distance: x.to_vec(),
            force: along(&|k| coefficient(force, k)),
            force_error: along(&|k| error(force, k)),
            dissipation: measured(dissipated.iter().map(|pair| pair[0]).collect()),
            dissipation_error: measured(dissipated.iter().map(|pair| pair[1]).collect()),
            damping: measured(damped.iter().map(|pair| pair[0]).collect()),
            damping_error: measured(damped.iter().map(|pair| pair[1]).collect()),
        }
    }

    fn report(&self, case: &Case, inverted: &Inverted, ways: Vec<WayCurve>) -> ReconstructReport {
        let table = self.curve(inverted);
        let mut remarks = self.remarks.clone();
        if !ways.is_empty() {
            remarks.push(
                "approach and retract contradict a common force: the sample or the instrument changed, or the \
                 force depends on the past. Both are reported; the common force is their compromise"
                    .to_owned(),
            );
        }
        let felt = self.measured.iter().filter(|row| row.informative).count();
        if felt < FEW_ROWS {
            remarks.push(format!(
                "only {felt} rows feel the sample: with fewer than {FEW_ROWS} the force is rough"
            ));
        }
        let closest = inverted.rows.iter().map(|row| row.closest);
        let closest = closest.fold(f64::INFINITY, f64::min);
        let length = if case.is_physical() {
            Quantity::Length
        } else {
            Quantity::Number
        };
        let shown = |distance: f64| length.format_digits(distance, 3);
        let minimum = minimum(&table, inverted);
        if let Some(minimum) = minimum
            && let Some([low, high]) = gap(inverted, minimum.distance)
        {
            remarks.push(format!(
                "no row has its closest approach between {} and {}, where the minimum of the force lies: \
                 other rows determine it, and its depth and distance are uncertain",
                shown(low),
                shown(high)
            ));
        }
        let inflections = inflections(&table, closest, inverted.rows[0].amplitude);
        for inflection in &inflections {
            remarks.push(format!(
                "near the distance {} the force has an inflection at which this amplitude does not \
                 determine it (the test of Sader and others, 2018, gives {:.2}, below -1): measure with a \
                 smaller or larger amplitude",
                shown(inflection.distance),
                inflection.factor
            ));
        }
        if self.has_damping && inverted.force.chi2 > WORST_CHI2 {
            remarks.push(format!(
                "the residuals are {:.1} times the standard errors: the rows contradict each other, or \
                 their errors are larger; the force's standard errors are widened by as much",
                inverted.force.chi2.sqrt()
            ));
        }
        let has_damping = damped(&table);
        let rows = self.readings.rows.iter().zip(&inverted.rows);
        let rows = rows.map(|(row, inverted)| ReconstructedRow {
            curve: self.readings.curves[row.curve].clone(),
            way: row.way,
            line: row.line,
            count: row.count,
            distance: row.distance,
            closest: inverted.closest,
            amplitude: inverted.amplitude,
            dissipation: self.has_damping.then_some(inverted.dissipated[0]),
            dissipation_error: self.has_damping.then_some(inverted.dissipated[1]),
            residual: inverted.residual,
        });
        let rows: Vec<ReconstructedRow> = rows.collect();
        let sader_jarvis = match self.method {
            Method::Frequency {
                stiffness,
                amplitude,
            } => {
                let shifts: Vec<(f64, f64)> = self
                    .readings
                    .rows
                    .iter()
                    .map(|row| (row.distance - amplitude, row.values[0]))
                    .collect();
                let force = sader_jarvis(&shifts, amplitude, stiffness);
                Some(PlainCurve {
                    distance: shifts.iter().map(|(distance, _)| *distance).collect(),
                    force,
                })
            }
            Method::Amplitude { .. } => None,
        };
        ReconstructReport {
            method: match self.method {
                Method::Amplitude { .. } => ReconstructMethod::AmplitudeModulation,
                Method::Frequency { .. } => ReconstructMethod::FrequencyModulation,
            },
            physical: case.is_physical(),
            table,
            minimum,
            closest,
            has_damping,
            free_amplitude: self.free[0],
            free_phase: self.free[1],
            free_rows: self.free_rows,
            errors: self.errors,
            freedom: inverted.force.freedom,
            chi2: inverted.force.chi2,
            rows,
            ways,
            inflections,
            sader_jarvis,
            remarks,
        }
    }
}

/// Inflection points of the force at which an oscillation of `amplitude` does not determine it: the
/// test of J. E. Sader, B. D. Hughes, F. Huber and F. J. Giessibl, Nat. Nanotechnol. 13, 1088 (2018).
/// Inflections that the standard errors allow to be absent are left out.
fn inflections(table: &ForceCurve, closest: f64, amplitude: f64) -> Vec<Inflection> {
    let resolved = report::even_nodes(&table.distance);
    let stride = (resolved / 40).max(1);
    let points: Vec<[f64; 3]> = (0..resolved)
        .step_by(stride)
        .map(|k| [table.distance[k], table.force[k], table.force_error[k]])
        .collect();
    let curvatures: Vec<[f64; 4]> = points
        .windows(3)
        .map(|w| {
            let step = w[1][0] - w[0][0];
            let curvature = (w[2][1] - 2.0 * w[1][1] + w[0][1]) / (step * step);
            let error = 6f64.sqrt() * w[1][2] / (step * step);
            [
                w[1][0],
                curvature,
                error,
                (w[2][1] - w[0][1]) / (2.0 * step),
            ]
        })
        .collect();
    let mut found = Vec::new();
    for pair in curvatures.windows(2) {
        let ([x, low, low_error, slope], [y, high, high_error, other]) = (pair[0], pair[1]);
        if low * high >= 0.0 || low.abs() < low_error || high.abs() < high_error {
            continue;
        }
        let part = low / (low - high);
        let distance = x + part * (y - x);
        let slope = slope + part * (other - slope);
        let depth = distance - closest;
        let ratio = (high - low) / (y - x) / slope;
        let factor = 0.25 * depth * depth * ratio;
        if factor < -1.0 {
            let amplitudes = [(-1.0 / ratio).sqrt(), 0.5 * depth];
            if (amplitudes[0]..amplitudes[1]).contains(&amplitude) {
                found.push(Inflection {
                    distance,
                    factor,
                    amplitudes,
                });
            }
        }
    }
    found
}

/// Returns the range about a distance in which no row has its closest approach, if it is wide.
fn gap(inverted: &Inverted, distance: f64) -> Option<[f64; 2]> {
    let closest = inverted.rows.iter().map(|row| row.closest);
    let low = closest
        .clone()
        .filter(|x| *x <= distance)
        .fold(f64::NEG_INFINITY, f64::max);
    let high = closest
        .filter(|x| *x > distance)
        .fold(f64::INFINITY, f64::min);
    let width = high - low;
    (width.is_finite() && width > GAP * inverted.nodes.spacing()).then_some([low, high])
}

/// Returns the most attractive force, if it exceeds its standard error, and the part of it that follows
/// from the noise three times.
fn minimum(table: &ForceCurve, inverted: &Inverted) -> Option<ForceMinimum> {
    let least =
        (0..table.force.len()).min_by(|a, b| table.force[*a].total_cmp(&table.force[*b]))?;
    let (force, force_error) = (table.force[least], table.force_error[least]);
    let beyond = inverted.nodes.0.len() - table.force.len();
    let noise = inverted.noise.get(beyond + least)?;
    let [distance, force] = vertex(table, least).unwrap_or([table.distance[least], force]);
    (force < -force_error && force < -SIGNIFICANT_MINIMUM * noise).then_some(ForceMinimum {
        force,
        force_error,
        distance,
    })
}

/// Returns distance and force of the vertex of the parabola through a lowest node and its neighbours, so
/// that the minimum does not depend on where the nodes are.
fn vertex(table: &ForceCurve, least: usize) -> Option<[f64; 2]> {
    let (before, after) = (least.checked_sub(1)?, least + 1);
    let (x, y) = (&table.distance, &table.force);
    let slope = |a: usize, b: usize| Some((y.get(b)? - y[a]) / (x[b] - x[a]));
    let (low, high) = (slope(before, least)?, slope(least, after)?);
    let curvature = (high - low) / (x[after] - x[before]);
    if curvature <= 0.0 {
        return None;
    }
    // Newton's form: y = y0 + low (x − x0) + curvature (x − x0)(x − x1).
    let distance = 0.5 * (x[before] + x[least] - low / curvature);
    let from = distance - x[before];
    let force = y[before] + low * from + curvature * from * (distance - x[least]);
    Some([distance, force])
}

/// Returns whether the dissipation is above three standard errors somewhere.
fn damped(table: &ForceCurve) -> bool {
    let both = table.dissipation.iter().zip(&table.dissipation_error);
    both.filter_map(|(value, error)| value.zip(*error))
        .any(|(value, error)| error > 0.0 && value > 3.0 * error)
}

/// Averages curves that are longer than `rows`, and adds a remark.
fn averaged(
    readings: Readings,
    rows: usize,
    errors: [f64; 2],
    remarks: &mut Vec<String>,
) -> Result<Readings, Error> {
    if !(20..=MAX_ROWS).contains(&rows) {
        return Err(Error::option(
            "rows",
            format!("{rows} is out of range"),
            format!("give a whole number from 20 to {MAX_ROWS}"),
        ));
    }
    let count = readings.rows.len();
    if count <= rows {
        return Ok(readings);
    }
    let readings = readings.averaged(rows, errors);
    remarks.push(format!(
        "{count} rows were averaged to {}; the option `rows` sets how many",
        readings.rows.len()
    ));
    Ok(readings)
}

/// Parses a length: in m, or a plain number for a dimensionless case.
fn length_of(case: &Case, amount: &Amount) -> Result<f64, Error> {
    let value = if case.is_physical() {
        Quantity::Length
            .parse(amount.text())
            .map_err(|error| Error::input(error.to_string(), "write it as in 20 nm"))?
    } else {
        amount.text().parse().map_err(|_| {
            Error::input(
                format!("`{amount}` is not a number"),
                "a dimensionless case has its own unit of length",
            )
        })?
    };
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(Error::input(
            format!("{amount} is not positive"),
            "give a length above zero",
        ))
    }
}

/// Standard errors of a row: given, or from the scatter, and no less than the least.
fn errors(
    given: [Option<f64>; 2],
    scatter: [Option<f64>; 2],
    least: [f64; 2],
    options: [&str; 2],
) -> Result<[f64; 2], Error> {
    let mut errors = least;
    for index in 0..2 {
        match given[index] {
            Some(error) if !(error > 0.0 && error.is_finite()) => {
                return Err(Error::option(
                    options[index],
                    format!("{error} is not a standard error"),
                    "give a number above zero",
                ));
            }
            Some(error) => errors[index] = error.max(least[index]),
            None => errors[index] = scatter[index].unwrap_or(0.0).max(least[index]),
        }
    }
    Ok(errors)
}

/// Converts readings to rows for the inversion, with their standard errors.
fn measured(
    readings: &Readings,
    errors: [f64; 2],
    least: [f64; 2],
    is_felt: impl Fn(&rows::Reading) -> bool,
) -> Vec<Measured> {
    let of = |row: &rows::Reading| {
        let part = 1.0 / (row.count as f64).sqrt();
        Measured {
            distance: row.distance,
            values: row.values,
            errors: [0, 1].map(|k| row.errors[k].unwrap_or(part * errors[k]).max(least[k])),
            informative: is_felt(row),
        }
    };
    readings.rows.iter().map(of).collect()
}
