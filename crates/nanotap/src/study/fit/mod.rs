//! Parameters from measured curves: what stiffness, damping, distance and calibration make the
//! model say what was measured.
//!
//! Each row of the data is a place (a distance, a drive frequency, any key of the case) at which
//! a periodic orbit was observed. Which of the coexisting orbits it is follows from the curve
//! itself (`branches.rs`); how what is observed changes with every free parameter is known exactly,
//! by the implicit function theorem ([`Derivative`](crate::observe::Derivative)), and Levenberg
//! and Marquardt's method does the rest (`solve.rs`).
//!
//! First comes a rough fit: residuals count in parts of the columns' spread and, where they are
//! large, by their logarithm, from the case's own values and, as long as nothing describes the
//! data, from others. Then the branches are found again and the fit is repeated in standard
//! errors, until the branches stay. Standard errors that are not given are those of the
//! residuals.
//!
//! A curve under frequency modulation is one of orbits at held amplitude and phase, with frequency
//! and strength of the drive as unknowns (`problem/held.rs`).
//!
//! Fails by stopping in a local minimum (of which `fits` warns), and where the data lie on a
//! motion that is not periodic.

mod branches;
mod data;
pub(crate) mod instrument;
mod jumps;
mod laws;
mod parameters;
mod problem;
mod profile;
mod quantity;
mod report;
mod reporting;
mod search;
mod solve;
mod statistics;

use nanotap_dynamics::Control;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::case::table::{Entry, MOST_ROWS, Table};
pub(crate) use data::is_distance;
pub use data::{Column, Curve, Data, Row, Swept};
pub use quantity::Quantity;
pub use report::{
    ComparedLaw, CurveCase, FitReport, FittedColumn, FittedJump, FittedParameter, FittedRow,
    OtherOrbit, Reading, Undetermined,
};

use parameters::parameters;
use problem::Problem;
use problem::held::Loop;
use search::Search;
use solve::LeastSquares as _;

use crate::Error;
use crate::case::Case;
use crate::study::kind::Study;
use crate::study::setpoint::at_setpoint;
use crate::study::value::Intervals;

/// Most starts of a fit.
const MOST_STARTS: usize = 1000;
/// Longest period of the orbits.
const MOST_PERIOD: usize = 64;

/// What a fit is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FitRequest {
    /// Measured curves: tables whose columns are named as in `distance (nm)`, `amplitude (nm)`,
    /// `phase (deg)`
    #[schemars(extend("x-own" = true))]
    pub data: Vec<Table>,
    /// Parameters to find: keys of the case, gap.offset, and NAME.offset or NAME.scale of a column
    #[schemars(extend("x-value" = "KEY,…"))]
    pub free: Vec<String>,
    /// Parameters to find, one value a curve
    #[schemars(extend("x-value" = "KEY,…"))]
    pub per_curve: Vec<String>,
    /// Bounds of parameters, as in sample.stiffness="1 N/m:100 N/m"
    #[schemars(extend("x-value" = "KEY=LOW:HIGH"))]
    pub bounds: Intervals,
    /// Columns of the data that count; without it, all
    #[schemars(extend("x-value" = "NAME,…"))]
    pub columns: Vec<String>,
    /// Contact laws to compare, as in hertz,dmt; without it, the case's own
    #[schemars(extend("x-value" = "LAW,…"))]
    pub laws: Vec<String>,
    /// Starts to try as long as nothing describes the data
    #[schemars(range(min = 1, max = MOST_STARTS), extend("x-value" = "S"))]
    pub starts: usize,
    /// Seed of the further starts
    #[schemars(extend("x-value" = "K"))]
    pub seed: u64,
    /// Longest period of the orbits looked for
    #[schemars(range(min = 1, max = MOST_PERIOD), extend("x-value" = "N"))]
    pub max_period: usize,
    /// The place at which the data jump from a branch that ends in a fold counts too
    #[schemars(extend("x-no" = "Only the rows count, not the places of jumps"))]
    pub jumps: bool,
    /// Phase behind the drive that the loop held, in degrees, of curves of a frequency shift
    #[schemars(range(min = 0, max = 180), extend("x-value" = "DEGREES"))]
    pub phase: f64,
    /// Intervals by the profile of the likelihood
    #[schemars(extend("x-no" = "Intervals from the standard errors alone"))]
    pub profile: bool,
}

impl Default for FitRequest {
    fn default() -> Self {
        Self {
            data: Vec::new(),
            free: Vec::new(),
            per_curve: Vec::new(),
            bounds: Intervals::default(),
            columns: Vec::new(),
            laws: Vec::new(),
            starts: 8,
            seed: 0,
            max_period: 4,
            jumps: true,
            phase: 90.0,
            profile: true,
        }
    }
}

/// A fit of the model to measured curves.
#[derive(Clone, Copy, Debug)]
pub struct FitStudy;

impl Study for FitStudy {
    const NAME: &'static str = "fit";
    const ABOUT: &'static str = "Parameters of lever and sample from measured curves";
    const COUNTED: &'static str = "starts";
    const ANY_DISTANCE: bool = true;
    const PARTIAL: bool = true;
    type Request = FitRequest;
    type Report = FitReport;

    fn compute(
        case: &Case,
        request: &FitRequest,
        control: &Control<'_>,
    ) -> Result<FitReport, Error> {
        fit(case, request, control)
    }
}

/// Finds the free parameters, under each of the laws that are to be compared.
///
/// # Errors
/// When the data or the parameters are not understood, or no orbit is found where the data are.
pub fn fit(case: &Case, request: &FitRequest, control: &Control<'_>) -> Result<FitReport, Error> {
    if names(&request.laws).is_empty() {
        fit_one(case, request, control)
    } else {
        laws::compare(case, request, control)
    }
}

/// The same under the law that the case has.
fn fit_one(case: &Case, request: &FitRequest, control: &Control<'_>) -> Result<FitReport, Error> {
    #[expect(
        clippy::redundant_closure_for_method_calls,
        reason = "the method itself is not general enough in its lifetime"
    )]
    with_search(case, request, control, |search| search.run())
}

/// Does `work` on the data and parameters of a request.
fn with_search<R>(
    case: &Case,
    request: &FitRequest,
    control: &Control<'_>,
    work: impl FnOnce(&Search<'_>) -> Result<R, Error>,
) -> Result<R, Error> {
    if request.data.is_empty() {
        return Err(Error::option("data", "there are no data", "give a table"));
    }
    let data = Data::read(case, &request.data, &names(&request.columns))?;
    let sets_distance = data.swept.iter().any(|s| data::is_distance(s.key));
    // Which distance the case has does not matter where the rows set it.
    let case = if sets_distance {
        case.clone()
    } else {
        at_setpoint(case.clone(), control)?.0
    };
    let free = names(&request.free);
    let per_curve = names(&request.per_curve);
    let parameters = parameters(&case, &data, &free, &per_curve, &request.bounds)?;
    let held = data
        .is_modulated()
        .then(|| Loop::of(&case, request.phase))
        .transpose()?;
    work(&Search {
        problem: Problem {
            case: &case,
            data: &data,
            parameters: &parameters,
            max_period: request.max_period,
            noise: Vec::new(),
            robust: None,
            jumps: Vec::new(),
            held,
        },
        request,
        control,
    })
}

/// Residuals of measured curves at some values of the free parameters, for solvers of one's own.
#[derive(Clone, Debug, PartialEq)]
pub struct Residuals {
    /// Model less measured value in standard errors, a column of the data after the other in
    /// each row; 0 where nothing was measured. Where the data give no standard error it is 3 % of
    /// the column's spread.
    pub residuals: Vec<f64>,
    /// Their exact derivatives, a column a parameter in the order of `free` and `per_curve`.
    pub jacobian: nalgebra::DMatrix<f64>,
}

/// The residuals at `values` of the free parameters, on the branches that the data are on.
///
/// # Errors
/// As [`fit`], and when there are not as many values as parameters or no derivatives there.
pub fn residuals(
    case: &Case,
    request: &FitRequest,
    values: &[f64],
    control: &Control<'_>,
) -> Result<Residuals, Error> {
    with_search(case, request, control, |search| {
        let count = search.problem.parameters.len();
        if values.len() != count {
            return Err(Error::input(
                format!("{} values for {count} parameters", values.len()),
                "give one a parameter",
            ));
        }
        let problem = search.weighted(search.rough_noise(), None);
        let (mut point, _) = problem.discover(values, None);
        let residuals = problem.residuals(values, &point);
        let jacobian = problem.jacobian(values, &mut point);
        Ok(Residuals {
            residuals: residuals.as_slice().to_vec(),
            jacobian: jacobian
                .ok_or_else(|| Error::numerics("the residuals have no derivatives there"))?,
        })
    })
}

/// Names, of which several may stand in one text.
fn names(given: &[String]) -> Vec<String> {
    let parts = given.iter().flat_map(|text| text.split(','));
    let names = parts.map(str::trim).filter(|name| !name.is_empty());
    names.map(str::to_owned).collect()
}
