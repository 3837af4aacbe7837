//! Report of a reconstruction.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use nanotap_case::physical::quantity::{JOULES_PER_ELECTRONVOLT, format_electronvolts};
use nanotap_case::units::Units;
use nanotap_motions::approach::Way;
use nanotap_observe::frame::{FileUnit, Frame, Rows, frame};
use nanotap_quantity::Kind;
use nanotap_quantity::number::{counted, significant};

/// Force and dissipation from a measured curve. Values are in SI for a physical case, otherwise in
/// model units; phases in degrees.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ReconstructReport {
    /// Method by which the curve was measured.
    pub method: ReconstructMethod,
    /// Whether values are in SI: true for a physical case.
    pub physical: bool,
    /// Force and dissipation against distance, from the least distance that is resolved on.
    pub table: ForceCurve,
    /// Lowest force of `table`; missing unless it is attractive by more than its
    /// standard error, and than three of the noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimum: Option<ForceMinimum>,
    /// Closest approach of all rows, m or model units; negative inside the sample.
    pub closest: f64,
    /// Whether the dissipation is above three standard errors somewhere.
    pub has_damping: bool,
    /// Free amplitude, m or model units: of the tip's deflection, or in frequency modulation of the
    /// tip.
    pub free_amplitude: f64,
    /// Free phase as measured, in degrees; in frequency modulation the phase that is held.
    #[schemars(extend("x-unit" = "degree"))]
    pub free_phase: f64,
    /// Number of rows from which the free level is known; 0 if it was given or is the case's.
    pub free_rows: usize,
    /// Standard errors of a row's two values: amplitude (m or model units) and phase (degrees), or
    /// relative frequency shift and energy (J or model units).
    pub errors: [f64; 2],
    /// Effective number of parameters of the force.
    pub freedom: f64,
    /// Mean squared residual of the rows in standard errors, dimensionless.
    pub chi2: f64,
    /// The rows, or averages of several.
    pub rows: Vec<ReconstructedRow>,
    /// Force from approach and retract separately, if the residuals of `table` differ between them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ways: Vec<WayCurve>,
    /// Inflection points at which the force is not determined by a curve of this amplitude.
    pub inflections: Vec<Inflection>,
    /// Force by the formula of Sader and Jarvis; only in frequency modulation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sader_jarvis: Option<PlainCurve>,
    /// Sentences on assumptions and on what makes the result doubtful.
    pub remarks: Vec<String>,
}

/// Method by which a curve was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReconstructMethod {
    /// Amplitude and phase at a constant drive.
    AmplitudeModulation,
    /// Frequency shift at constant amplitude and phase.
    FrequencyModulation,
}

/// Force and dissipation at increasing distances, linear between them. All vectors have the same
/// length.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ForceCurve {
    /// Distances between tip and sample, m or model units, the closest first.
    pub distance: Vec<f64>,
    /// Conservative force on the tip, N or model units, positive when it pushes the tip away.
    pub force: Vec<f64>,
    /// Standard errors of the force, N or model units.
    pub force_error: Vec<f64>,
    /// Energy that a sinusoidal oscillation with the free amplitude loses in a period when its
    /// closest approach is this distance, J or model units; `None` (JSON: null) at all distances if
    /// no column has the phase or the excitation.
    pub dissipation: Vec<Option<f64>>,
    /// Standard errors of the dissipation, J or model units; `None` like it.
    pub dissipation_error: Vec<Option<f64>>,
    /// Damping coefficient of the force against the tip's velocity, N s/m or model units; `None` like
    /// the dissipation.
    pub damping: Vec<Option<f64>>,
    /// Standard errors of the damping coefficient, N s/m or model units; `None` like it.
    pub damping_error: Vec<Option<f64>>,
}

/// The lowest force of a curve, which is attractive.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ForceMinimum {
    /// Lowest force, N or model units; negative.
    pub force: f64,
    /// Standard error of the lowest force, N or model units.
    pub force_error: f64,
    /// Distance at which the force is lowest, m or model units.
    pub distance: f64,
}

/// A row, or the average of several.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ReconstructedRow {
    /// Name of the curve to which the row belongs.
    pub curve: String,
    /// Direction of the row, if the data have one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub way: Option<Way>,
    /// Line in the file, or number of the row from 1; for an average, of the first row.
    pub line: u64,
    /// Number of rows that were averaged.
    pub count: usize,
    /// Distance of the tip at rest from the sample, m or model units.
    pub distance: f64,
    /// Closest approach of the tip in the oscillation, m or model units; negative inside the
    /// sample.
    pub closest: f64,
    /// Amplitude of the tip, m or model units, a driven base's motion included.
    pub amplitude: f64,
    /// Energy that the sample takes in a period, J or model units; `None` (JSON: null) if it was not
    /// measured.
    pub dissipation: Option<f64>,
    /// Standard error of this energy, J or model units; `None` like it.
    pub dissipation_error: Option<f64>,
    /// Residual of the force's in-phase part, in standard errors.
    pub residual: f64,
}

/// The force from one direction alone.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct WayCurve {
    /// Direction of the rows that were used.
    pub way: Way,
    /// Force and dissipation from the rows in this direction.
    pub table: ForceCurve,
    /// Lowest force of `table`; missing unless it is attractive by more than its
    /// standard error, and than three of the noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimum: Option<ForceMinimum>,
}

/// An inflection point of the force that fails the test of Sader and others (2018).
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Inflection {
    /// Distance of the inflection point, m or model units.
    pub distance: f64,
    /// (d²/4) F‴/F′, dimensionless, with d counted from the closest approach: below −1 amplitudes
    /// exist for which the force is not determined.
    pub factor: f64,
    /// Smallest and largest of these amplitudes, m or model units.
    pub amplitudes: [f64; 2],
}

/// A force against distance without standard errors. Both vectors have the same length.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct PlainCurve {
    /// Distances between tip and sample at the closest approach, m or model units.
    pub distance: Vec<f64>,
    /// Force on the tip, N or model units, positive when it pushes the tip away.
    pub force: Vec<f64>,
}

impl ReconstructReport {
    /// Returns how many rows of the table are worth showing: up to where the force has fallen to 3
    /// % of its largest value or to its standard error.
    pub fn shown_rows(&self) -> usize {
        let table = &self.table;
        let even = even_nodes(&table.distance);
        let largest = table.force[..even]
            .iter()
            .fold(0.0, |m: f64, f| m.max(f.abs()));
        let felt = table.force.iter().zip(&table.force_error);
        let last = felt.enumerate().filter(|(_, (force, error))| {
            force.abs() > 0.03 * largest && force.abs() > 2.0 * **error
        });
        let last = last.map(|(k, _)| k + 2).next_back().unwrap_or(0);
        last.max(even).min(table.distance.len())
    }

    /// What the whole says of the force, a line a quantity.
    pub fn summary_table(&self) -> Frame<'_> {
        let shown = |kind: Kind, value: f64, digits: usize| {
            let kind = if self.physical { kind } else { Kind::Number };
            kind.format_digits(value, digits)
        };
        let minimum = |minimum: &ForceMinimum| {
            let [force, error] = [(minimum.force, 4), (minimum.force_error, 2)]
                .map(|(value, digits)| shown(Kind::Force, value, digits));
            let at = shown(Kind::Length, minimum.distance, 4);
            format!("{force} ± {error} at {at}")
        };
        let dissipated = self.rows.iter().filter_map(|row| row.dissipation);
        let dissipation = match dissipated.reduce(f64::max) {
            None => "not measured".to_owned(),
            Some(_) if !self.has_damping => "not determined".to_owned(),
            Some(joules) if self.physical => format_electronvolts(joules),
            Some(energy) => significant(energy, 4),
        };
        let source = match (self.method, self.free_rows) {
            (ReconstructMethod::FrequencyModulation, _) => "held".to_owned(),
            (_, 0) => "given".to_owned(),
            (_, rows) => format!("from {}", counted(rows, "row", "rows")),
        };
        let lines = [
            ("minimum of the force", self.minimum.as_ref().map(minimum)),
            (
                "closest approach",
                Some(shown(Kind::Length, self.closest, 4)),
            ),
            ("largest dissipation of a row", Some(dissipation)),
            (
                "free amplitude and phase",
                Some(format!(
                    "{}, {}° ({source})",
                    shown(Kind::Length, self.free_amplitude, 5),
                    significant(self.free_phase, 5)
                )),
            ),
            (
                "mean squared residual",
                Some(format!("{} in standard errors", significant(self.chi2, 3))),
            ),
            ("effective parameters", Some(significant(self.freedom, 3))),
        ];
        let known = lines
            .into_iter()
            .filter_map(|(name, text)| Some((name, text?)));
        frame! { Rows::new("summary", known, None);
            "quantity", "", Plain => |(name, _)| name;
            "value", "", Plain => |(_, text)| text;
        }
    }

    /// The force against the distance; in files in nm, nN, eV and N s/m, as `sample.law = "table"`
    /// reads it, or in model units.
    pub fn force_table(&self) -> Frame<'_> {
        let curve = &self.table;
        let clear = |list: &'_ [Option<f64>], k: usize| list[k].filter(|_| self.has_damping);
        let nano: fn(f64) -> f64 = |value| 1e9 * value;
        let ev: FileUnit = (|joules| 1.0 / JOULES_PER_ELECTRONVOLT * joules, "eV");
        let units = (!self.physical).then_some(Units::Model);
        frame! { Rows::new("table", 0..curve.distance.len(), units);
            "distance", "distance", (Length, Quantity([4, 4])) => |k| curve.distance[k];
            .in_files((nano, "nm"));
            "force", "force", (Force, Quantity([4, 4])) => |k| curve.force[k];
            .in_files((nano, "nN"));
            "force error", "standard error", (Force, Quantity([2, 2])) => |k| curve.force_error[k];
            .in_files((nano, "nN"));
            "dissipation", "", (Energy, Plain) => |k| curve.dissipation[k];
            .in_files(ev);
            .only_in_files();
            "dissipation error", "", (Energy, Plain) => |k| curve.dissipation_error[k];
            .in_files(ev);
            .only_in_files();
            "damping", "", (Unit("N s/m"), Plain) => |k| curve.damping[k];
            .only_in_files();
            "damping error", "", (Unit("N s/m"), Plain) => |k| curve.damping_error[k];
            .only_in_files();
            "", "dissipation", (Energy, Quantity([4, 4])) => move |k| clear(&curve.dissipation, k);
            "", "standard error", (Energy, Quantity([4, 4])) =>
                move |k| clear(&curve.dissipation_error, k);
            .aligned(Point, Point);
        }
    }
}

/// Returns how many distances from the first one on are evenly spaced.
pub(super) fn even_nodes(distance: &[f64]) -> usize {
    let steps = distance.windows(2).map(|w| w[1] - w[0]);
    let first = steps.clone().next().unwrap_or(0.0);
    let even = steps.take_while(|step| *step <= 1.001 * first).count();
    (even + 1).min(distance.len())
}
