//! Parameters from measured curves: stiffness, damping, distance and calibration for which the
//! model reproduces the data.
//!
//! Each row of the data is a position (a distance, a drive frequency, any key of the case) at which
//! a periodic orbit was observed. The curve determines which of the coexisting orbits it is
//! (`branches.rs`). The derivatives of the observables with respect to every free parameter are
//! exact, by the implicit function theorem ([`Derivative`](nanotap_observe::Derivative)), and the
//! Levenberg–Marquardt method finds the minimum (`solve.rs`).
//!
//! The first fit is rough: residuals are relative to the spread of their column, large ones count
//! by their logarithm, and the fit starts from the values of the case and, if these do not describe
//! the data, from others. Then the branches are assigned again and the fit is repeated in standard
//! errors, until the branches no longer change. Unknown standard errors are estimated from the
//! residuals.
//!
//! A curve under frequency modulation consists of orbits with given amplitude and phase; frequency
//! and strength of the drive are unknowns (`problem/held.rs`).
//!
//! A force curve is one of rests of the lever: neither its drive nor its motion counts
//! (`problem/rest.rs`).
//!
//! Errors of the instrument are parameters too (`terms.rs`); those that the residuals show and that
//! are not free are suggested (`suggestions.rs`). Other minima that describe the data about as well
//! are searched for and reported (`rivals.rs`).
//!
//! Fails by stopping in a local minimum (`fits` is false then, as a warning), and where the data
//! belong to a motion that is not periodic.

mod baseline;
mod blocks;
mod branches;
mod data;
mod effort;
mod force_curve;
mod force_curve_table;
mod guess;
mod implied_case;
pub mod instrument;
mod jumps;
mod laws;
mod map;
mod parameters;
mod problem;
mod profile;
mod quantity;
mod report;
mod reporting;
mod rivals;
mod search;
mod selection;
mod solve;
mod statistics;
mod suggestions;
pub(crate) mod terms;
pub mod thin;

use nanotap_case::physical::Remark;
use nanotap_dynamics::Control;

use crate::figure::fit::fit_figure;
pub use data::is_distance;
pub use data::{Column, Curve, Data, Row, SweptKey};
pub use force_curve_table::force_curve_table;
pub use implied_case::{ImpliedWords, implied_words};
pub(crate) use map::OF_FORCES;
pub use map::{FitMap, FitMapReport, MapFile, MappedParameter};
pub use nanotap_case::table::{Entry, MAX_ROWS, Table};
use nanotap_figures::Figure;
use nanotap_observe::frame::Frame;
pub use quantity::Quantity;
pub use report::{
    ComparedLaw, CurveCase, Estimate, FitReport, FittedColumn, FittedForceCurve, FittedJump,
    FittedParameter, FittedRow, OtherOrbit, Reading, Rival, RivalParameter, Suggestion,
    Undetermined,
};

pub use selection::Segment;

use effort::Effort;
use guess::begin_from_free_rows;
use instrument::Channels;
use parameters::{begin, correct, keep_physical, parameters, starts};
use problem::Problem;
use problem::held::Loop;
use search::Search;
use selection::{Contact, MAX_SELECTIONS, Selection};
use solve::LeastSquares as _;

use nanotap_case::Case;
use nanotap_error::Error;
use nanotap_motions::setpoint::at_setpoint;
use nanotap_study::Study;
use nanotap_study::request::options;
use nanotap_study::value::{Amount, Intervals};

/// Largest number of initial values of a fit.
const MAX_STARTS: usize = 1000;
/// Largest number of evaluations of a curve.
const MAX_EVALUATIONS: usize = 1_000_000;
/// Name of the zero of the phase.
const PHASE: &str = "phase.offset";
/// Longest period of the orbits in drive periods.
const MAX_PERIOD: usize = 64;

options! {
    /// Options of a fit.
    pub struct FitOptions {
        /// Measured curves: tables whose columns are named as in `distance (nm)`, `amplitude (nm)`,
        /// `phase (deg)`
        #[schemars(extend("x-own" = true))]
        pub data: Vec<Table> = Vec::new(),
        /// Parameters to find: keys of the case, gap.offset, NAME.offset or NAME.scale of a column, and
        /// terms of the instrument: NAME.tilt, NAME.curvature, NAME.interference, NAME.drag, gap.drift,
        /// gap.backlash. Of a force curve for which no key is named, the sample's modulus, the contact point, the
        /// baseline and the adhesion of the law are found
        #[schemars(extend("x-value" = "KEY,…"))]
        pub free: Vec<String> = Vec::new(),
        /// Parameters to find with one value per curve
        #[schemars(extend("x-value" = "KEY,…"))]
        pub per_curve: Vec<String> = Vec::new(),
        /// Conversions of columns, as in Amp="58 nm/V", Phase=90-x, Zsnsr=-x or Ch3=amplitude
        #[schemars(extend("x-value" = "NAME=RULE"))]
        pub convert: Vec<String> = Vec::new(),
        /// Initial values of free parameters, and fixed corrections of columns, as in
        /// gap.offset="10.3 nm"
        #[schemars(extend("x-value" = "NAME=VALUE"))]
        pub start: Vec<String> = Vec::new(),
        /// Bounds of parameters, as in sample.stiffness="1 N/m:100 N/m"
        #[schemars(extend("x-value" = "KEY=LOW:HIGH"))]
        pub bounds: Intervals = Intervals::default(),
        /// Columns of the data to use; default: all
        #[schemars(extend("x-value" = "NAME,…"))]
        pub columns: Vec<String> = Vec::new(),
        /// Columns that name the pixel of a force volume, as in x,y: one fit a pixel, into a dataset
        #[schemars(extend("x-value" = "NAME,…"))]
        pub pixels: Vec<String> = Vec::new(),
        /// A map in an instrument's file, of which `data` has a curve
        #[serde(skip)]
        pub map: MapFile = MapFile::default(),
        /// Values of parameters, in SI, from which the search begins: those of a curve near by
        #[serde(skip)]
        pub near: Vec<(String, f64)> = Vec::new(),
        /// Segment of a curve to fit; default for a force curve: its approach under an elastic law, both
        /// under one with adhesion or losses
        pub segment: Option<Segment> = None,
        /// Rows to fit: their numbers, or forces from the baseline, or indentations from the contact
        /// point, as in rows=100:2000, force="0.1 nN:2 nN" or indentation="-1 um:300 nm"
        #[schemars(extend("x-value" = "NAME=LOW:HIGH"))]
        pub range: Intervals = Intervals::default(),
        /// Radius of the tip, as in "40 nm", in place of the case's
        #[schemars(extend("x-value" = "LENGTH"))]
        pub tip_radius: Option<Amount> = None,
        /// Half angle of a conical tip, as in "20 deg", in place of the case's
        #[schemars(extend("x-value" = "ANGLE"))]
        pub half_angle: Option<Amount> = None,
        /// Stiffness of the lever, as in "0.05 N/m", in place of the case's and of the file's header
        #[schemars(extend("x-value" = "STIFFNESS"))]
        pub spring_constant: Option<Amount> = None,
        /// Poisson's ratio of the sample, in place of the case's; without a case 0.5
        #[schemars(extend("x-value" = "RATIO"))]
        pub poisson: Option<Amount> = None,
        /// Contact laws to compare, as in hertz,dmt; default: the law of the case
        #[schemars(extend("x-value" = "LAW,…"))]
        pub laws: Vec<String> = Vec::new(),
        /// Average longer curves to about this many rows; 0: use every row
        #[schemars(range(min = 0, max = MAX_ROWS), extend("x-value" = "ROWS"))]
        pub rows: usize = 100,
        /// Initial values to try until the data are described
        #[schemars(range(min = 1, max = MAX_STARTS), extend("x-value" = "S"))]
        pub starts: usize = 8,
        /// Seed of the further initial values
        #[schemars(extend("x-value" = "K"))]
        pub seed: u64 = 0,
        /// Longest period of the orbits, in drive periods
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub max_period: usize = 4,
        /// Use the locations of jumps at folds as data
        #[schemars(extend("x-no" = "Only the rows count, not the places of jumps"))]
        pub jumps: bool = true,
        /// Phase lag that the loop maintains, in degrees, for curves of a frequency shift
        #[schemars(range(min = 0, max = 180), extend("x-value" = "DEGREES"))]
        pub phase: f64 = 90.0,
        /// Intervals from the profile of the likelihood
        #[schemars(extend("x-no" = "Intervals from the standard errors alone"))]
        pub profile: bool = true,
        /// Search for other minima that describe the data about as well
        #[schemars(extend("x-no" = "Do not search for other minima"))]
        pub rivals: bool = true,
        /// Evaluations of the whole curve after which the search ends with what is known; default: 60
        /// under a nonlinear law, else no limit
        #[schemars(range(min = 1, max = MAX_EVALUATIONS), extend("x-value" = "E"))]
        pub evaluations: Option<usize> = None,
    }
}

/// A fit of the model to measured curves.
#[derive(Clone, Copy, Debug)]
pub struct FitStudy;

impl Study for FitStudy {
    const NAME: &'static str = "fit";
    const ABOUT: &'static str = "Fit parameters of lever and sample to measured curves";
    const COUNTED: &'static str = "starts";
    const ANY_DISTANCE: bool = true;
    const PARTIAL: bool = true;
    type Options = FitOptions;
    type Report = FitReport;

    fn frames<'a>(_: &Case, report: &'a FitReport) -> Vec<Frame<'a>> {
        vec![
            report.row_table(),
            report.law_table(),
            report.parameter_table(),
            force_curve_table(&report.force_curves),
        ]
    }

    fn figure(_: &Case, report: &FitReport) -> Option<Figure> {
        Some(fit_figure(report))
    }

    fn remarks(_: &Case, report: &FitReport) -> Vec<Remark> {
        let prepared = Remark::notes(&report.preparation).into_iter();
        prepared.chain(Remark::warnings(&report.remarks)).collect()
    }

    fn compute(
        case: &Case,
        request: &FitOptions,
        control: &Control<'_>,
    ) -> Result<FitReport, Error> {
        fit(case, request, control)
    }
}

/// Finds the free parameters, for each of the laws to compare.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::case::physical::Catalogue;
/// use nanotap::case::table::Table;
/// use nanotap::control::Control;
/// use nanotap::study::fit::{FitOptions, fit};
/// use std::path::Path;
///
/// let file = Path::new("../../docs/cases/stiff-lever.toml");
/// let case = Case::load(Some(file), &[], &Catalogue::shared())?;
/// let data = Table::read(Path::new("../../docs/cases/polystyrene-curve.csv"))?;
/// let options = FitOptions {
///     data: vec![data],
///     free: ["sample.modulus", "gap.offset"].map(str::to_owned).to_vec(),
///     profile: false,
///     ..FitOptions::default()
/// };
/// let found = fit(&case, &options, &Control::default())?;
/// // The curve was made with 4 GPa, and with distances 0.3 nm too large.
/// let [modulus, offset] = [0, 1].map(|k| found.parameters[k].value);
/// assert!((modulus - 4e9).abs() < 0.2e9 && (offset.abs() - 0.3e-9).abs() < 0.05e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If the data or the parameters are invalid, or no orbit is found for the data.
pub fn fit(case: &Case, request: &FitOptions, control: &Control<'_>) -> Result<FitReport, Error> {
    let case = &implied_case::with_options(case, request)?;
    if names(&request.laws).is_empty() {
        return fit_one(case, request, control);
    }
    // All laws describe the same rows.
    let same_rows = FitOptions {
        segment: segment_of_laws(case, request),
        ..request.clone()
    };
    laws::compare(case, &same_rows, control)
}

/// The segment that all laws of a request describe; that of the request, if the data are not force
/// curves.
fn segment_of_laws(case: &Case, request: &FitOptions) -> Option<Segment> {
    let columns = names(&request.columns);
    let is_force_curve =
        |table: &Table| instrument::is_plain_force_curve(table, &columns, &request.convert);
    let of_force_curves = request.data.iter().all(is_force_curve);
    let default = || of_force_curves.then(|| selection::default_segment(case, request));
    request.segment.or_else(default)
}

/// Finds the free parameters under the law of the case. Rows in whose order the tip may have moved
/// either way, and that the model does not describe, are tried in the other order.
fn fit_one(case: &Case, request: &FitOptions, control: &Control<'_>) -> Result<FitReport, Error> {
    let run = |request: &FitOptions| -> Result<(FitReport, bool), Error> {
        let mut selection = Selection::of(case, request)?;
        let mut rounds = MAX_SELECTIONS;
        loop {
            let found = with_search(case, request, &selection, control, |search, channels| {
                let knows_way = search.problem.data.rows().any(|row| row.way.is_some());
                let swept = search.problem.data.swept.first();
                let by_distance = swept.is_some_and(|swept| data::is_distance(swept.key));
                let is_rest = search.problem.data.is_force_curve();
                let mut report = search.run()?;
                if is_rest {
                    report = force_curve::compared_by_force(search, report);
                }
                let contacts = Contact::of(search, &report);
                report.force_curves = force_curve::summaries(search, &report, &contacts, channels);
                Ok((report, knows_way || !by_distance || is_rest, contacts))
            });
            let (mut report, is_known, contacts) = found?;
            let is_other = selection.needs_contact() && selection.refine(contacts);
            rounds -= 1;
            if is_other && rounds == 0 {
                report.remarks.push(
                    "the range of forces or indentations selects other rows after every fit: select \
                     rows by their numbers"
                        .to_owned(),
                );
            }
            if !is_other || rounds == 0 || control.is_cancelled() {
                return Ok((report, is_known));
            }
        }
    };
    let (found, is_known) = run(request)?;
    let [table] = &request.data[..] else {
        return Ok(found);
    };
    let is_described = found.fits && !found.misfit;
    if is_known || is_described || control.is_cancelled() {
        return Ok(found);
    }
    let turned = FitOptions {
        data: vec![table.reversed()],
        ..request.clone()
    };
    match run(&turned) {
        Ok((mut other, _)) if other.fits && !other.misfit => {
            other.turned = true;
            other.preparation.push(
                "the rows are read in the other order, in which the model describes them: state a \
                 column `direction` (approach, retract) to fix it"
                    .to_owned(),
            );
            Ok(other)
        }
        _ => Ok(found),
    }
}

/// Calls `work` with the data and parameters of a request.
fn with_search<R>(
    case: &Case,
    request: &FitOptions,
    selection: &Selection,
    control: &Control<'_>,
    work: impl FnOnce(&Search<'_>, &[Channels]) -> Result<R, Error>,
) -> Result<R, Error> {
    if request.data.is_empty() {
        return Err(Error::option("data", "no data were given", "give a table"));
    }
    if !request.pixels.is_empty() {
        return Err(Error::option(
            "pixels",
            "the fits of a force volume are a dataset",
            "write it with `fit --out NAME.zarr`, or in Python with `fit_map`",
        ));
    }
    let columns = names(&request.columns);
    let averaged = blocks::averaged(request, &columns);
    let tables = averaged.as_ref().unwrap_or(&request.data);
    let measured = instrument::prepared(case, tables, &request.convert, &columns)?;
    drop(averaged);
    let mut preparation = measured.notes;
    let mut channels = measured.channels;
    let mut data = Data::read(case, &measured.tables, &measured.columns)?;
    drop(measured.tables);
    let sets_distance = data.swept.iter().any(|s| data::is_distance(s.key));
    // The distance of the case is irrelevant if the rows set it.
    let case = if sets_distance {
        case.clone()
    } else {
        at_setpoint(case.clone(), control)?.0
    };
    data.measure_ramp();
    let mut free = terms::expanded(names(&request.free), &data)?;
    let mut per_curve = terms::expanded(names(&request.per_curve), &data)?;
    let starts = starts(&request.start)?;
    // A zero that was read from noisy rows is known no better than they are.
    let has_phase = data.columns.iter().any(|c| c.quantity.name() == "phase");
    let mut known = free.iter().chain(&per_curve);
    let is_known = known.any(|n| n == PHASE) || starts.iter().any(|(name, _)| name == PHASE);
    if measured.guessed_phase && has_phase && !is_known {
        let own = if data.curves.len() > 1 {
            &mut per_curve
        } else {
            &mut free
        };
        own.push(PHASE.to_owned());
        preparation.push(
            "phase.offset is free too, because the zero of the phase is a guess: state the phase with \
             the option `convert` to fix it"
                .to_owned(),
        );
    }
    let corrected = correct(&case, &mut data, &starts, |name| {
        free.iter().chain(&per_curve).any(|free| free == name)
    })?;
    preparation.extend(corrected);
    preparation.extend(selection.apply(&case, &mut data)?);
    for channels in &mut channels {
        let own = data
            .curves
            .iter()
            .find(|curve| curve.name == channels.table);
        channels.rows = own.map_or(channels.rows, |curve| curve.rows.len());
    }
    if data.is_force_curve()
        && free
            .iter()
            .chain(&per_curve)
            .all(|name| terms::is_term(name))
    {
        let note = force_curve::free_by_default(&case, &data, &mut free, &mut per_curve)?;
        preparation.push(note);
    }
    data.add_free_scatter();
    preparation.extend(data.average(request.rows));
    if data.is_force_curve() {
        preparation.extend(baseline::assumptions(&case, &data)?);
    }
    let mut parameters = parameters(&case, &data, &free, &per_curve, &request.bounds)?;
    begin(&case, &data, &mut parameters, &starts)?;
    preparation.extend(begin_from_free_rows(&case, &data, &mut parameters));
    terms::begin_interference(&data, &mut parameters);
    keep_physical(&mut parameters, &request.bounds);
    let held = data
        .is_modulated()
        .then(|| Loop::of(&case, request.phase))
        .transpose()?;
    let is_nonlinear = case.model().is_ok_and(|model| model.nonlinear.is_some());
    let effort = Effort::new(request.evaluations, data.rows().count(), is_nonlinear);
    let search = Search {
        preparation: &preparation,
        problem: Problem {
            case: &case,
            data: &data,
            parameters: &parameters,
            max_period: request.max_period,
            noise: Vec::new(),
            robust: None,
            jumps: Vec::new(),
            held,
            effort: &effort,
        },
        request,
        control,
    };
    work(&search, &channels)
}

/// The measured curves of a fit as the model reads them: converted, not averaged.
///
/// # Errors
/// If the data or a conversion is invalid.
pub fn measured(case: &Case, request: &FitOptions) -> Result<Data, Error> {
    let columns = names(&request.columns);
    let measured = instrument::prepared(case, &request.data, &request.convert, &columns)?;
    Data::read(case, &measured.tables, &measured.columns)
}

/// Residuals of measured curves for given values of the free parameters, for users' solvers.
#[derive(Clone, Debug, PartialEq)]
pub struct Residuals {
    /// Model minus measured value in standard errors, row by row and column by column; 0 for
    /// missing values. Without a standard error in the data, it is 3 % of the spread of the column.
    pub residuals: Vec<f64>,
    /// Exact derivatives, one column per parameter in the order of `free` and `per_curve`.
    pub jacobian: nalgebra::DMatrix<f64>,
}

/// Computes the residuals at `values` of the free parameters, on the branches of the data.
///
/// # Errors
/// As [`fit`], and if the number of values is wrong or the residuals have no derivatives.
pub fn residuals(
    case: &Case,
    request: &FitOptions,
    values: &[f64],
    control: &Control<'_>,
) -> Result<Residuals, Error> {
    let case = &implied_case::with_options(case, request)?;
    let selection = Selection::of(case, request)?;
    with_search(case, request, &selection, control, |search, _| {
        let count = search.problem.parameters.len();
        if values.len() != count {
            return Err(Error::input(
                format!("got {} values for {count} parameters", values.len()),
                "give one value per parameter",
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

/// Names, of which one text may contain several.
fn names(given: &[String]) -> Vec<String> {
    let parts = given.iter().flat_map(|text| text.split(','));
    let names = parts.map(str::trim).filter(|name| !name.is_empty());
    names.map(str::to_owned).collect()
}
