//! What a reconstruction found.

use std::fmt::Write as _;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use crate::number::shortest;
use crate::study::approach::Way;

/// Force and dissipation from a measured curve. Values are in SI of a physical case, else in the
/// model's units; phases in degrees.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ReconstructReport {
    /// How the curve was measured.
    pub method: ReconstructMethod,
    /// Whether values are in SI.
    pub physical: bool,
    /// Force and dissipation against distance.
    pub table: ForceCurve,
    /// The most attractive force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimum: Option<ForceMinimum>,
    /// Closest approach of all rows.
    pub closest: f64,
    /// Whether the damping is larger than its standard error somewhere.
    pub has_damping: bool,
    /// Free amplitude: of the tip's deflection, or in frequency modulation of the tip.
    pub free_amplitude: f64,
    /// Free phase as measured, in degrees; in frequency modulation the phase that is held.
    pub free_phase: f64,
    /// Rows from which the free level is known; 0 where it was given or is the case's.
    pub free_rows: usize,
    /// Standard errors of a row's two values: amplitude and phase in degrees, or relative frequency
    /// shift and energy.
    pub errors: [f64; 2],
    /// Effective number of parameters of the force.
    pub freedom: f64,
    /// Mean squared residual of the rows in standard errors.
    pub chi2: f64,
    /// The rows, or averages of several.
    pub rows: Vec<ReconstructedRow>,
    /// Approach and retract alone, where they differ by more than three standard errors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ways: Vec<WayCurve>,
    /// Inflection points at which the force is not determined by a curve of this amplitude.
    pub inflections: Vec<Inflection>,
    /// The force by the formula of Sader and Jarvis, of frequency modulation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sader_jarvis: Option<PlainCurve>,
    /// Assumptions and warnings.
    pub remarks: Vec<String>,
}

/// How a curve was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReconstructMethod {
    /// Amplitude and phase at a constant drive.
    AmplitudeModulation,
    /// Frequency shift at constant amplitude and phase.
    FrequencyModulation,
}

/// Force and dissipation at increasing distances: linear between them.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ForceCurve {
    /// Distance between tip and sample, the closest first.
    pub distance: Vec<f64>,
    /// Conservative force on the tip, positive when it pushes the tip away.
    pub force: Vec<f64>,
    /// Its standard error.
    pub force_error: Vec<f64>,
    /// Energy that a sinusoidal oscillation with the free amplitude loses in a period when it comes
    /// as near as this distance.
    pub dissipation: Vec<f64>,
    /// Its standard error.
    pub dissipation_error: Vec<f64>,
    /// Coefficient of the force's part that is against the tip's velocity.
    pub damping: Vec<f64>,
    /// Its standard error.
    pub damping_error: Vec<f64>,
}

/// The most attractive force.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ForceMinimum {
    /// Force.
    pub force: f64,
    /// Its standard error.
    pub force_error: f64,
    /// Where it is.
    pub distance: f64,
}

/// A row, or the average of several.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ReconstructedRow {
    /// Its curve.
    pub curve: String,
    /// Its direction, where the data have one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub way: Option<Way>,
    /// Line of its file, or row from 1; of several the first.
    pub line: u64,
    /// How many rows were averaged.
    pub count: usize,
    /// Distance at rest.
    pub distance: f64,
    /// Closest approach.
    pub closest: f64,
    /// Amplitude of the tip, a driven base's motion included.
    pub amplitude: f64,
    /// Energy that the sample takes in a period.
    pub dissipation: f64,
    /// Its standard error.
    pub dissipation_error: f64,
    /// Residual of the force's in-phase part, in standard errors.
    pub residual: f64,
}

/// The force from one direction alone.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct WayCurve {
    /// Which direction.
    pub way: Way,
    /// Force and dissipation.
    pub table: ForceCurve,
    /// The most attractive force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimum: Option<ForceMinimum>,
}

/// An inflection point of the force that fails the test of Sader and others (2018).
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Inflection {
    /// Where it is.
    pub distance: f64,
    /// (d²/4) F‴/F′ with d counted from the closest approach: below −1 amplitudes exist for which
    /// the force is not determined.
    pub factor: f64,
    /// These amplitudes, from and to.
    pub amplitudes: [f64; 2],
}

/// A force without errors.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct PlainCurve {
    /// Distance between tip and sample.
    pub distance: Vec<f64>,
    /// Force.
    pub force: Vec<f64>,
}

impl ReconstructReport {
    /// How many rows of the table are worth showing: up to where the force has fallen to 3 % of
    /// its largest value or to its standard error.
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
        let last = last.map(|(k, _)| k + 2).last().unwrap_or(0);
        last.max(even).min(table.distance.len())
    }

    /// The table as CSV, which `sample.law = "table"` reads.
    pub fn csv(&self) -> String {
        let (length, force, energy) = if self.physical {
            (
                (1e9, " (nm)"),
                (1e9, " (nN)"),
                (1.0 / JOULES_PER_ELECTRONVOLT, " (eV)"),
            )
        } else {
            ((1.0, ""), (1.0, ""), (1.0, ""))
        };
        let damping = if self.physical { " (N s/m)" } else { "" };
        let mut csv = format!(
            "distance{0},force{1},force error{1},dissipation{2},dissipation error{2},\
             damping{3},damping error{3}\n",
            length.1, force.1, energy.1, damping
        );
        let table = &self.table;
        for k in 0..table.distance.len() {
            let cells = [
                length.0 * table.distance[k],
                force.0 * table.force[k],
                force.0 * table.force_error[k],
                energy.0 * table.dissipation[k],
                energy.0 * table.dissipation_error[k],
                table.damping[k],
                table.damping_error[k],
            ];
            let _ = writeln!(csv, "{}", cells.map(shortest).join(","));
        }
        csv
    }
}

/// How many distances from the first on are evenly spaced.
pub(super) fn even_nodes(distance: &[f64]) -> usize {
    let steps = distance.windows(2).map(|w| w[1] - w[0]);
    let first = steps.clone().next().unwrap_or(0.0);
    let even = steps.take_while(|step| *step <= 1.001 * first).count();
    (even + 1).min(distance.len())
}
