//! What a fit found.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::study::approach::Way;

/// What a fit found. Values are in SI of a physical case, else in the model's units; phases in
/// degrees.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FitReport {
    /// The free parameters.
    pub parameters: Vec<FittedParameter>,
    /// Sum of the squared residuals in standard errors.
    pub chi2: f64,
    /// Measured values and jumps less parameters.
    pub degrees_of_freedom: usize,
    /// The probability of a larger chi2 by chance; where all standard errors were given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_value: Option<f64>,
    /// Akaike's criterion, −2 ln L + 2 p: of two laws fitted to the same data the one with the
    /// smaller value describes them better for its parameters, by more than chance where the
    /// difference is above some ten. It says nothing of whether either is right. A row without
    /// an orbit counts as missed by the whole spread of its column.
    pub aic: f64,
    /// Schwarz's criterion, −2 ln L + p ln n: the same with parameters counted by the logarithm
    /// of how many values were measured.
    pub bic: f64,
    /// The contact law of this fit, where several were compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// The laws that were compared, in the order of the request.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub laws: Vec<ComparedLaw>,
    /// Whether the model describes the data.
    pub fits: bool,
    /// Why not, if it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// What puts the result in doubt.
    pub remarks: Vec<String>,
    /// Combinations of parameters that the data do not determine.
    pub undetermined: Vec<Undetermined>,
    /// Correlations of the parameters, in their order; 0 of what is not determined.
    pub correlations: Vec<Vec<f64>>,
    /// What was measured, and how well.
    pub columns: Vec<FittedColumn>,
    /// Key of the case that varies along the curves.
    pub swept: String,
    /// Its unit in SI, `1` for none.
    pub swept_unit: String,
    /// The rows, curve after curve.
    pub rows: Vec<FittedRow>,
    /// Where the data jump from one branch to another at a fold.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub jumps: Vec<FittedJump>,
    /// Orbits at the rows that the data are not on.
    pub others: Vec<OtherOrbit>,
    /// Steps of Levenberg and Marquardt in all.
    pub iterations: usize,
    /// Starts that were tried.
    pub starts: usize,
    /// The case of the best fit as a file; where parameters are one a curve, that of the first.
    pub case_file: String,
    /// Where parameters are one a curve, the case of each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub case_files: Vec<CurveCase>,
    /// Whether the work was stopped before it was done.
    pub cancelled: bool,
}

/// A contact law among others that were fitted to the same data.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ComparedLaw {
    /// Its name.
    pub law: String,
    /// Whether it describes the data.
    pub fits: bool,
    /// Why not, or why it could not be fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Akaike's criterion; none where nothing was fitted.
    pub aic: Option<f64>,
    /// Schwarz's criterion.
    pub bic: Option<f64>,
    /// How much Akaike's criterion is above the least.
    pub above_best: Option<f64>,
    /// Akaike's weight, exp(−above/2) over its sum: how the evidence is shared out if one of
    /// these laws is right.
    pub weight: Option<f64>,
    /// Sum of the squared residuals in standard errors.
    pub chi2: Option<f64>,
    /// Measured values less parameters.
    pub degrees_of_freedom: Option<usize>,
    /// Its free parameters.
    pub parameters: Vec<FittedParameter>,
    /// What puts its fit in doubt.
    pub remarks: Vec<String>,
    /// Its best case as a file.
    pub case_file: Option<String>,
}

/// The best case of one curve among several.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct CurveCase {
    /// The curve.
    pub curve: String,
    /// Its case as a file.
    pub case_file: String,
}

/// A parameter that was free.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FittedParameter {
    /// The key of the case, or `NAME.offset`, `NAME.scale` of a column.
    pub key: String,
    /// The curve that it belongs to; without it, all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<String>,
    /// The best value.
    pub value: f64,
    /// Its standard error; none where the data do not determine it.
    pub standard_error: Option<f64>,
    /// 95 % interval; an end is missing where there is none within the bounds.
    pub interval: [Option<f64>; 2],
    /// Its unit in SI, `1` for none.
    pub unit: String,
    /// Where the fit began.
    pub start: f64,
    /// Whether it ended at a bound.
    pub at_bound: bool,
}

/// A combination of parameters that the data do not determine.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Undetermined {
    /// What is not determined, in words.
    pub words: String,
    /// The parameters that are part of it.
    pub keys: Vec<String>,
    /// Their changes, in parts of their sizes, of length 1 together.
    pub direction: Vec<f64>,
    /// Standard errors by which the residuals change together for this change: below 1.
    pub singular_value: f64,
}

/// An observable that was measured.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FittedColumn {
    /// What the data call it.
    pub name: String,
    /// The observable.
    pub observable: String,
    /// Its unit here.
    pub unit: String,
    /// Root mean square of its residuals.
    pub residual: f64,
    /// Standard error of a value where the rows give none.
    pub standard_error: f64,
    /// Whether that was estimated from the residuals.
    pub estimated: bool,
}

/// A row of the data with what the model says.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FittedRow {
    /// Its curve.
    pub curve: String,
    /// Its line in the file, or its number from 1.
    pub line: u64,
    /// Which way the abscissa went, where the data say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub way: Option<Way>,
    /// Where it was measured, offset included.
    pub at: f64,
    /// The branch that it lies on.
    pub branch: Option<usize>,
    /// Period of the orbit, in drive periods.
    pub period: Option<usize>,
    /// What was measured, by the names of the columns.
    pub readings: BTreeMap<String, Reading>,
}

/// One measured value.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    /// As measured.
    pub measured: Option<f64>,
    /// As the model has it, scale and offset included.
    pub model: Option<f64>,
    /// Measured less model, in standard errors.
    pub residual: Option<f64>,
}

/// A jump of the data from a branch that ends in a fold.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FittedJump {
    /// The curve.
    pub curve: String,
    /// The lines of the rows before and after it.
    pub lines: [u64; 2],
    /// Where these rows were measured, offset included.
    pub between: [f64; 2],
    /// The branches before and after it.
    pub branches: [usize; 2],
    /// Where the model's branch ends.
    pub fold: f64,
    /// Middle of the rows less that, in standard errors: their distance over √12.
    pub residual: f64,
}

/// An orbit at a row that the data are not on.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct OtherOrbit {
    /// The curve.
    pub curve: String,
    /// Where.
    pub at: f64,
    /// Its branch.
    pub branch: usize,
    /// What would be measured on it, by the names of the columns.
    pub readings: BTreeMap<String, f64>,
}
