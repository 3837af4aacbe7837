//! Report of a fit.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use nanotap_case::key::Key;
use nanotap_case::quantity::Kind;
use nanotap_motions::approach::Way;
use nanotap_observe::frame::{Frame, Rows, columns, frame};
use nanotap_quantity::number::significant;

/// Report of a fit. Values are in SI for a physical case, otherwise in the model's units; phases in
/// degrees.
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is an independent answer, and a field in JSON"
)]
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FitReport {
    /// The free parameters with values and standard errors, in the order of the request.
    pub parameters: Vec<FittedParameter>,
    /// Sum of the squared residuals of values and jumps, each in standard errors; dimensionless.
    pub chi2: f64,
    /// Number of measured values and jumps minus number of parameters.
    pub degrees_of_freedom: usize,
    /// Probability of a larger chi2 by chance, 0 to 1, if all standard errors were given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_value: Option<f64>,
    /// Akaike's criterion, −2 ln L + 2 p. Of two laws fitted to the same data, the one with the
    /// smaller value describes them better for its number of parameters, significantly if the
    /// difference is above about ten. It does not show whether either law is right. It is over the
    /// rows with an orbit; of compared laws, over those that have one under each of them.
    pub aic: f64,
    /// Schwarz's criterion, −2 ln L + p ln n, whose penalty grows with the logarithm of the number
    /// of measured values.
    pub bic: f64,
    /// Number of rows without an orbit, which do not count.
    #[serde(default)]
    pub rows_without_orbit: usize,
    /// The likelihood of every row.
    #[serde(skip)]
    pub(super) likelihood: Likelihood,
    /// Contact law of this fit, if several were compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// The compared laws, in the order of the request.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub laws: Vec<ComparedLaw>,
    /// Whether the model describes the data.
    pub fits: bool,
    /// Reason if it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Whether the residuals are not the noise of the data: the law, the branch or an offset is not
    /// theirs.
    #[serde(default)]
    pub misfit: bool,
    /// Whether the rows were read in the other order.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub turned: bool,
    /// Sentences that warn of what makes the result doubtful.
    pub remarks: Vec<String>,
    /// What was done to the data before the fit: conversions, guesses, fixed corrections, averages.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub preparation: Vec<String>,
    /// Other minima that describe the data about as well, and what would decide.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rivals: Vec<Rival>,
    /// Corrections and terms of the instrument that the residuals show, the clearest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub suggestions: Vec<Suggestion>,
    /// Combinations of parameters that the data do not determine.
    pub undetermined: Vec<Undetermined>,
    /// Correlations of the parameters, in their order; 0 for undetermined ones.
    pub correlations: Vec<Vec<f64>>,
    /// The measured quantities and their residuals.
    pub columns: Vec<FittedColumn>,
    /// Key of the case that varies along the curves.
    pub swept: String,
    /// Its unit in SI, `1` if there is none.
    pub swept_unit: String,
    /// What the fit of each force curve says of sample and contact.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force_curves: Vec<FittedForceCurve>,
    /// The rows, curve by curve.
    pub rows: Vec<FittedRow>,
    /// Jumps of the data from one branch to another at a fold.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub jumps: Vec<FittedJump>,
    /// Orbits at the rows on which the data are not.
    pub others: Vec<OtherOrbit>,
    /// Number of Levenberg–Marquardt steps of the final fit, after the search for branches.
    pub iterations: usize,
    /// Number of initial values that were tried.
    pub starts: usize,
    /// The case of the best fit as a file; if parameters differ between curves, that of the first.
    pub case_file: String,
    /// The case of each curve, if parameters differ between curves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub case_files: Vec<CurveCase>,
    /// Whether the computation was cancelled before it was finished.
    pub cancelled: bool,
}

impl FitReport {
    /// The rows of the data: measured and model values of each column, and the residuals.
    pub fn row_table<'a>(&'a self) -> Frame<'a> {
        let unit = |unit: &str| match unit {
            "1" => String::new(),
            unit => format!(" ({unit})"),
        };
        let at = format!("{}{}", self.swept, unit(&self.swept_unit));
        let mut rows = columns! { Rows::new("rows", &self.rows, None);
            "curve", "curve", Plain => |row| unseparated(&row.curve);
            "line", "line", Plain => |row| row.line as usize;
            at, self.swept.clone(), Digits(5) => |row| row.at;
            "branch", "branch", Plain => |row| row.branch;
        };
        for column in &self.columns {
            let (name, unit) = (&column.name, unit(&column.unit));
            let [measured, model] = ["", " model"].map(|word| format!("{name}{word}{unit}"));
            let reading = move |row: &'a FittedRow| row.readings.get(name);
            rows = columns! { rows;
                measured, "measured", Digits(5) => move |row| reading(row)?.measured;
                model, "model", Digits(5) => move |row| reading(row)?.model;
                format!("{name} residual"), "residual", Digits(3) => move |row| reading(row)?.residual;
            };
        }
        rows.frame()
    }

    /// The free parameters, each with the unit of its numbers in files. A value in brackets is no result:
    /// the data do not determine it, and it stands where the fit happened to leave it.
    pub fn parameter_table(&self) -> Frame<'_> {
        const UNKNOWN: &str = "not determined";
        let value = |p: &FittedParameter| match (p.text(p.value), p.standard_error) {
            (value, Some(_)) => value,
            (value, None) => format!("({value})"),
        };
        let interval = |p: &FittedParameter| {
            let end = |end: Option<f64>| end.map_or_else(|| "?".to_owned(), |end| p.text(end));
            match p.interval {
                [None, None] => UNKNOWN.to_owned(),
                [low, high] => format!("{} to {}", end(low), end(high)),
            }
        };
        let error = |p: &FittedParameter| {
            p.standard_error
                .map_or_else(|| UNKNOWN.to_owned(), |error| p.text(error))
        };
        frame! { Rows::new("parameters", &self.parameters, None);
            "", "parameter", Plain => |p| named(&p.key, p.curve.as_deref());
            .label("key of the case, or correction of a column");
            "", "value", Plain => value;
            .align(Right); .label("of the best fit");
            "", "standard error", Plain => error;
            .align(Right);
            "", "95 % interval", Plain => interval;
            "", "began at", Plain => |p| p.text(p.start);
            .align(Right); .label("initial value");
            "key", "", Plain => |p| &p.key; .only_in_files();
            "curve", "", Plain => |p| p.curve.as_deref().map(unseparated); .only_in_files();
            "value", "value", Digits(5) => |p| p.value; .only_in_files();
            "standard_error", "standard error", Digits(5) => |p| p.standard_error; .only_in_files();
            "low", "lower end of the 95 % interval", Digits(5) => |p| p.interval[0]; .only_in_files();
            "high", "upper end of the 95 % interval", Digits(5) => |p| p.interval[1]; .only_in_files();
            "start", "initial value", Digits(5) => |p| p.start; .only_in_files();
            "unit", "unit of the numbers", Plain => |p| &p.unit; .only_in_files();
        }
    }

    /// The laws that were compared.
    pub fn law_table(&self) -> Frame<'_> {
        frame! { Rows::new("laws", &self.laws, None);
            "law", "law", Plain => |law| &law.law;
            "aic", "AIC", Digits(6) => |law| law.aic;
            "bic", "BIC", Digits(6) => |law| law.bic;
            "above_best", "above the least", Digits(3) => |law| law.above_best;
            "weight", "weight", Digits(3) => |law| law.weight;
            "rows_without_orbit", "rows without an orbit", Plain => |law| law.rows_without_orbit;
            "fits", "fits", Plain => |law| if law.fits { "yes" } else { "no" };
            .aligned(Right, Right);
        }
    }
}

/// The name of a curve without what separates cells of a file.
fn unseparated(curve: &str) -> String {
    curve.replace([',', '"', '\n'], " ")
}

/// The name of a parameter, with the curve to which alone it applies.
fn named(key: &str, curve: Option<&str>) -> String {
    curve.map_or_else(|| key.to_owned(), |curve| format!("{key} of {curve}"))
}

/// A number of a parameter with its unit, as a reader sees it.
pub(super) fn quantity(key: &str, unit: &str, value: f64) -> String {
    let kind = Key::find(key).map(Key::kind);
    match kind.or_else(|| Kind::of_si_unit(unit)) {
        Some(kind) => kind.format_digits(value, 5),
        None if unit == "1" => significant(value, 5),
        None => format!("{} {unit}", significant(value, 5)),
    }
}

/// A value of a fit with its errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Its standard error; missing if the data do not determine it.
    pub standard_error: Option<f64>,
    /// Ends of its 95 % interval; an end is missing if it is not within the bounds.
    pub interval: [Option<f64>; 2],
}

impl Estimate {
    /// The estimate of the negative quantity.
    pub(super) fn negated(self) -> Self {
        let [low, high] = self.interval;
        Self {
            value: -self.value,
            interval: [high.map(|end| -end), low.map(|end| -end)],
            ..self
        }
    }
}

/// What the fit of a force curve says of sample and contact. Values that are not free are missing among
/// the estimates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FittedForceCurve {
    /// Name of the curve.
    pub curve: String,
    /// Young's modulus of the sample, Pa.
    pub modulus: Option<Estimate>,
    /// Contact point, m: the distance, as the file counts it, at which the undeflected tip meets the
    /// undeformed surface.
    pub contact_point: Option<Estimate>,
    /// Deflection or force far from the sample, in `baseline_unit`.
    pub baseline: Option<Estimate>,
    /// Unit of the baseline.
    pub baseline_unit: String,
    /// Lowest force of the model on the way back, N, under a law that attracts.
    #[schemars(extend("x-unit" = "N"))]
    pub adhesion_force: Option<f64>,
    /// Contact law; missing for the linear default.
    pub law: Option<String>,
    /// Radius of the tip, m, if the law has one.
    #[schemars(extend("x-unit" = "m"))]
    pub tip_radius: Option<f64>,
    /// Half angle of the tip, rad, if the law has one.
    #[schemars(extend("x-unit" = "rad"))]
    pub half_angle: Option<f64>,
    /// Poisson's ratio of the sample.
    pub poisson: Option<f64>,
    /// Segment whose rows were fitted; missing if the rows do not say.
    pub segment: Option<String>,
    /// Number of rows that were fitted, before they were averaged.
    pub rows: usize,
    /// Name of the distance in the file.
    pub distance: String,
    /// Name of the deflection or the force in the file.
    pub deflection: String,
    /// Stiffness of the lever, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub spring_constant: f64,
    /// Where that comes from: `header` of the file, or `case`.
    pub spring_constant_from: String,
    /// Stiffness of the lever in the header of the file, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub spring_constant_in_header: Option<f64>,
    /// Sensitivity in the header of the file, m/V.
    #[schemars(extend("x-unit" = "m/V"))]
    pub sensitivity_in_header: Option<f64>,
    /// Largest force, N.
    #[schemars(extend("x-unit" = "N"))]
    pub largest_force: f64,
    /// Largest indentation, m.
    #[schemars(extend("x-unit" = "m"))]
    pub largest_indentation: f64,
    /// Root mean square of the residuals as a force, N.
    #[schemars(extend("x-unit" = "N"))]
    pub residual_force: f64,
    /// Sentences on what to be careful of.
    pub cautions: Vec<String>,
}

/// The likelihood of the rows of a fit.
#[derive(Clone, Debug, Default)]
pub(super) struct Likelihood {
    pub(super) rows: Vec<RowLikelihood>,
    /// Number of parameters, estimated standard errors among them.
    pub(super) parameters: usize,
}

/// The likelihood of a row.
#[derive(Clone, Debug)]
pub(super) struct RowLikelihood {
    /// Its curve and line.
    pub(super) row: (String, u64),
    /// −2 ln L of its values.
    pub(super) deviance: f64,
    /// Number of its values.
    pub(super) values: usize,
    /// Whether it has no orbit.
    pub(super) lost: bool,
}

impl Likelihood {
    /// The rows with an orbit.
    pub(super) fn with_orbit(&self) -> BTreeSet<(String, u64)> {
        let rows = self.rows.iter().filter(|row| !row.lost);
        rows.map(|row| row.row.clone()).collect()
    }

    /// The criteria of Akaike and of Schwarz over some of the rows.
    pub(super) fn criteria(&self, over: &BTreeSet<(String, u64)>) -> [f64; 2] {
        let rows = || self.rows.iter().filter(|row| over.contains(&row.row));
        let deviance: f64 = rows().map(|row| row.deviance).sum();
        let values: usize = rows().map(|row| row.values).sum();
        let parameters = self.parameters as f64;
        let prices = [2.0, nanotap_arithmetic::ln(values.max(1) as f64)];
        prices.map(|price| deviance + price * parameters)
    }
}

/// A contact law among others that were fitted to the same data.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct ComparedLaw {
    /// Name of the contact law, as in `sample.law`.
    pub law: String,
    /// Whether the law describes the data.
    pub fits: bool,
    /// Reason if it does not, or if it could not be fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Akaike's criterion over the rows that have an orbit under every law; missing if nothing was
    /// fitted, or if more than half of the rows have no orbit.
    pub aic: Option<f64>,
    /// Schwarz's criterion, −2 ln L + p ln n, over the same rows; missing where Akaike's is.
    pub bic: Option<f64>,
    /// Difference of Akaike's criterion from the smallest one.
    pub above_best: Option<f64>,
    /// Akaike's weight, exp(−above/2) over the sum of all: the share of the evidence, if one of
    /// these laws is right.
    pub weight: Option<f64>,
    /// Number of rows without an orbit under this law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows_without_orbit: Option<usize>,
    /// Sum of the squared residuals, each in standard errors; dimensionless.
    pub chi2: Option<f64>,
    /// Number of measured values minus number of parameters.
    pub degrees_of_freedom: Option<usize>,
    /// The free parameters of this law with values and standard errors.
    pub parameters: Vec<FittedParameter>,
    /// Sentences that warn of what makes the fit of this law doubtful.
    pub remarks: Vec<String>,
    /// Case of the best fit with this law, as a file.
    pub case_file: Option<String>,
}

/// The best case of one curve among several.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct CurveCase {
    /// Name of the curve.
    pub curve: String,
    /// Case of the best fit for this curve, as a file.
    pub case_file: String,
}

/// A free parameter with its best value and standard error.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FittedParameter {
    /// The key of the case, or `NAME.offset`, `NAME.scale` of a column.
    pub key: String,
    /// Name of the curve to which the parameter applies; without it, all curves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<String>,
    /// Best value, in `unit`.
    pub value: f64,
    /// Standard error of the best value, in `unit`; missing if the data do not determine it.
    pub standard_error: Option<f64>,
    /// Part of the standard error that `cantilever.k_error` causes, in `unit`; without it, none is stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness_error: Option<f64>,
    /// Ends of the 95 % interval, in `unit`; an end is missing if it is not within the bounds.
    pub interval: [Option<f64>; 2],
    /// Unit of the values in SI, `1` if there is none.
    pub unit: String,
    /// Initial value of the fit, in `unit`.
    pub start: f64,
    /// Whether the best value is at a bound.
    pub at_bound: bool,
}

impl FittedParameter {
    /// A number of the parameter with its unit, as a reader sees it.
    pub fn text(&self, value: f64) -> String {
        quantity(&self.key, &self.unit, value)
    }
}

/// Another minimum that describes the data about as well as the best fit.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Rival {
    /// The free parameters there, in the order of the request.
    pub parameters: Vec<RivalParameter>,
    /// Akaike's criterion less that of the best fit, over the rows where both have orbits.
    pub above_best: f64,
    /// Sum of the squared residuals there, each in standard errors; dimensionless.
    pub chi2: f64,
    /// Column that would decide between this minimum and the best fit; missing if none is known.
    pub decides: Option<String>,
    /// Sentence that says what would decide.
    pub words: String,
}

/// A free parameter in another minimum.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct RivalParameter {
    /// Name of the parameter.
    pub key: String,
    /// Name of the curve to which the parameter applies; without it, all curves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<String>,
    /// Its value there, in `unit`.
    pub value: f64,
    /// Its standard error, in `unit`; missing if the data do not determine it there.
    pub standard_error: Option<f64>,
    /// Unit of the values in SI, `1` if there is none.
    pub unit: String,
}

impl RivalParameter {
    /// The parameter with its value and error, as a reader sees them.
    pub fn words(&self) -> String {
        let name = named(&self.key, self.curve.as_deref());
        let text = |value| quantity(&self.key, &self.unit, value);
        match self.standard_error {
            Some(error) => {
                format!(
                    "{name} = {} (standard error {})",
                    text(self.value),
                    text(error)
                )
            }
            None => format!("{name} not determined"),
        }
    }
}

/// A correction or a term of the instrument that the residuals show and that is not free.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Suggestion {
    /// Name of the parameter.
    pub key: String,
    /// Its value to first order, of an interference its period, in `unit`.
    pub value: f64,
    /// Unit of the value in SI, `1` if there is none.
    pub unit: String,
    /// By how much Akaike's criterion would fall, to first order.
    pub fall_of_aic: f64,
    /// Correlation of the term, less what the free parameters can describe, with the residuals,
    /// −1 to 1.
    pub correlation: f64,
    /// The parameters to name in `free`: those of the request, the suggestions before this one, and
    /// this one.
    pub free: Vec<String>,
    /// Sentence that describes it.
    pub words: String,
}

/// A combination of parameters that the data do not determine.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Undetermined {
    /// Sentence that describes the combination.
    pub words: String,
    /// Names of the parameters in the combination, those with the largest changes first.
    pub keys: Vec<String>,
    /// Changes of these parameters relative to their sizes; the vector of all changes has length 1.
    pub direction: Vec<f64>,
    /// Change of all residuals for this change, in standard errors: at most 1, or zero to rounding.
    pub singular_value: f64,
}

/// A column of measured values with the size of its residuals.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FittedColumn {
    /// Name of the column in the data.
    pub name: String,
    /// Name of the observable or reading that the column contains.
    pub observable: String,
    /// Unit of the values here.
    pub unit: String,
    /// Root mean square of measured minus model values, in `unit`.
    pub residual: f64,
    /// Standard error of the values for which the rows give none, in `unit`.
    pub standard_error: f64,
    /// Whether a standard error of the column was estimated from the residuals.
    pub estimated: bool,
}

/// A row of the data with the model's values.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FittedRow {
    /// Name of the curve to which the row belongs.
    pub curve: String,
    /// Line in the file, or number of the row from 1.
    pub line: u64,
    /// Direction of the abscissa, if given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub way: Option<Way>,
    /// Value of the swept key with its offset, in [`FitReport::swept_unit`].
    pub at: f64,
    /// Index of the branch on which the orbit lies; missing if the row has no orbit.
    pub branch: Option<usize>,
    /// Period of the orbit, in drive periods.
    pub period: Option<usize>,
    /// Measured and model values, by the names of the columns.
    pub readings: BTreeMap<String, Reading>,
}

/// A measured value with the value of the model.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    /// Measured value, in [`FittedColumn::unit`]; missing if nothing was measured.
    pub measured: Option<f64>,
    /// Model value with scale and offset, in [`FittedColumn::unit`]; missing if the row has no
    /// orbit.
    pub model: Option<f64>,
    /// Measured minus model value, in standard errors.
    pub residual: Option<f64>,
}

/// A jump of the data from a branch that ends in a fold.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FittedJump {
    /// Name of the curve on which the data jump.
    pub curve: String,
    /// The lines of the rows before and after it.
    pub lines: [u64; 2],
    /// Values of the swept key in the rows before and after the jump, with offsets, in
    /// [`FitReport::swept_unit`].
    pub between: [f64; 2],
    /// The branches before and after it.
    pub branches: [usize; 2],
    /// Value of the swept key at the fold where the model's branch ends, in
    /// [`FitReport::swept_unit`].
    pub fold: f64,
    /// Middle of the rows minus the fold, in standard errors, which are the distance of the rows
    /// over √12.
    pub residual: f64,
}

/// An orbit at a row on which the data are not.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct OtherOrbit {
    /// Name of the curve to which the row belongs.
    pub curve: String,
    /// Value of the swept key in the row, with its offset, in [`FitReport::swept_unit`].
    pub at: f64,
    /// Index of the branch on which this orbit lies.
    pub branch: usize,
    /// Model values on this orbit with scales and offsets, by the names of the columns.
    pub readings: BTreeMap<String, f64>,
}
