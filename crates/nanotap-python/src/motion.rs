//! Single motions: modes, runs, orbits, and observables of many cases at once.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap::case::Case;
use nanotap::case::physical::Remark;
use nanotap::control::Control;
use nanotap::frame::Frame;
use nanotap::map::MAX_NUMBERS;
use nanotap::model::Model;
use nanotap::model::beam::Modes;
use nanotap::observe::OBSERVABLES;
use nanotap::observe::time_series::{self, state_names};
use nanotap::study::in_si::InSi;
use nanotap::study::modes::{ModesOptions, ModesStudy, shape_table};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, OrbitStudy};
use nanotap::study::registry::{Answer, Answered, Document, Study as _};
use nanotap::study::request::read;
use nanotap::study::setpoint::at_setpoint;
use nanotap::study::simulate::{SimulateOptions, SimulateReport, SimulateStudy};
use nanotap::study::threads::install;
use nanotap::{Error, ErrorKind};
use nanotap_figures::Figure;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;
use serde::Serialize;

use crate::case::CaseCore;
use crate::columns::{Column, Entries, columns, entries};
use crate::document::{document, python};
use crate::failure::Failure;
use crate::study::{ReportCore, json};
use crate::watch::{watched, watched_alone};

type Row<'py> = Bound<'py, PyArray1<f64>>;
type Rows<'py> = Bound<'py, PyArray2<f64>>;
/// Names of columns, and their numbers row by row.
type Table<'py> = (Vec<String>, Rows<'py>);

fn table(py: Python<'_>, names: Vec<String>, values: Vec<f64>) -> PyResult<Table<'_>> {
    let shape = [values.len() / names.len().max(1), names.len()];
    Ok((names, PyArray1::from_vec(py, values).reshape(shape)?))
}

/// Frequencies and mode shapes of a case: first the shapes at points along the beam.
struct ModesAnswer {
    kept: Answered<ModesStudy>,
    beam: Modes,
    points: usize,
}

impl Answer for ModesAnswer {
    fn document(&self) -> Result<String, Error> {
        self.kept.document()
    }

    fn frames(&self) -> Vec<Frame<'_>> {
        let mut tables = self.kept.frames();
        for (table, name) in tables.iter_mut().zip(["free", "contact"]) {
            table.name = name;
        }
        tables.insert(0, shape_table(&self.beam, self.points));
        tables
    }

    fn figure(&self) -> Option<Figure> {
        self.kept.figure()
    }

    fn remarks(&self) -> Vec<Remark> {
        self.kept.remarks()
    }
}

/// Frequencies, positions along the beam, and the mode shapes there.
#[pyfunction]
pub(crate) fn modes<'py>(
    py: Python<'py>,
    case: &CaseCore,
    request: &str,
) -> PyResult<(ReportCore, Row<'py>, Rows<'py>)> {
    let case = case.studied(py)?;
    let request: ModesOptions = read(json(request)?).map_err(Failure::from)?;
    let report = ModesStudy::run(&case, &request, &Control::default()).map_err(Failure::from)?;
    let beam = Modes::new(report.modes).map_err(|error| Failure::input(error.to_string()))?;
    let (points, width) = (request.points, report.modes);
    let xi: Vec<f64> = (0..points)
        .map(|point| point as f64 / (points - 1) as f64)
        .collect();
    let shapes: Vec<f64> = xi
        .iter()
        .flat_map(|&xi| beam.shapes(xi).as_slice().to_vec())
        .collect();
    let shapes = PyArray1::from_vec(py, shapes).reshape([points, width])?;
    let kept = Answered { case, report };
    let answer = ModesAnswer { kept, beam, points };
    Ok((ReportCore::new(answer), PyArray1::from_vec(py, xi), shapes))
}

/// The numbers of a time series of so many drive periods, which `sample` passes row by row.
fn rows<E: Into<Error>>(
    model: &Model,
    periods: usize,
    resolution: usize,
    sample: impl FnOnce(&mut dyn FnMut(&[f64])) -> Result<(), E>,
) -> Result<Vec<f64>, Failure> {
    let numbers = periods
        .saturating_mul(resolution)
        .saturating_mul(time_series::columns(model).len());
    if numbers > MAX_NUMBERS {
        let words =
            format!("a time series of {numbers} numbers is too long; {MAX_NUMBERS} at most");
        return Err(Failure(Error::input(
            words,
            "take fewer {periods} or a lower {resolution}",
        )));
    }
    let mut values = Vec::new();
    sample(&mut |row| values.extend_from_slice(row)).map_err(|error| Failure(error.into()))?;
    Ok(values)
}

/// A report on one motion.
#[derive(Serialize)]
#[serde(untagged)]
enum MotionReport {
    Run(SimulateReport),
    Orbit(Box<InSi<OrbitReport>>),
}

/// A motion of a case, with its time series of so many samples a period as the first table.
struct MotionAnswer {
    case: Arc<Case>,
    report: MotionReport,
    options: MotionOptions,
}

/// The options of a run or an orbit.
enum MotionOptions {
    Run(Box<SimulateOptions>),
    Orbit(OrbitOptions),
}

impl MotionAnswer {
    /// The model of the motion and the rows of its time series.
    fn series(&self) -> Result<(Model, Vec<Vec<f64>>), Error> {
        let (case, model) = (&self.case, self.case.model()?);
        let mut rows = Vec::new();
        let mut row = |row: &[f64]| rows.push(row.to_vec());
        match (&self.report, &self.options) {
            (MotionReport::Run(SimulateReport::FixedStep(run)), _) => {
                run.curve.iter().for_each(|point| row(point));
            }
            (MotionReport::Run(run), MotionOptions::Run(options)) => {
                run.sample(case, options, usize::MAX, &mut row)?;
            }
            (MotionReport::Orbit(orbit), MotionOptions::Orbit(options)) => {
                let (start, periods) = (&orbit.motion.state, orbit.motion.period);
                time_series::sample(&model, start, periods, options.resolution, row)?;
            }
            _ => {}
        }
        Ok((model, rows))
    }
}

impl Answer for MotionAnswer {
    fn document(&self) -> Result<String, Error> {
        Ok(serde_json::to_string(&Document::new(
            &self.report,
            &self.case,
        ))?)
    }

    fn frames(&self) -> Vec<Frame<'_>> {
        let series = self.series().ok();
        let series = series
            .map(|(model, rows)| time_series::table(state_names(&model), rows, self.case.units()));
        let further = match &self.report {
            MotionReport::Orbit(orbit) => OrbitStudy::frames(&self.case, orbit),
            // Its table is the curve, which is the series.
            MotionReport::Run(SimulateReport::FixedStep(_)) => Vec::new(),
            MotionReport::Run(run) => SimulateStudy::frames(&self.case, run),
        };
        series.into_iter().chain(further).collect()
    }

    fn figure(&self) -> Option<Figure> {
        match &self.report {
            MotionReport::Run(run) => SimulateStudy::figure(&self.case, run),
            MotionReport::Orbit(orbit) => OrbitStudy::figure(&self.case, orbit),
        }
    }

    fn remarks(&self) -> Vec<Remark> {
        match &self.report {
            MotionReport::Run(run) => SimulateStudy::remarks(&self.case, run),
            MotionReport::Orbit(orbit) => OrbitStudy::remarks(&self.case, orbit),
        }
    }
}

/// A run: its document, its values as columns of one row, its report, and `series_periods` of its
/// time series or, for fixed steps, its curve.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    case: &CaseCore,
    request: &str,
    series_periods: usize,
) -> PyResult<(Bound<'py, PyAny>, Vec<Column>, ReportCore, Table<'py>)> {
    let case = case.studied(py)?;
    let mut request: SimulateOptions = read(json(request)?).map_err(Failure::from)?;
    if let Some(signal) = &mut request.drive_signal {
        signal.read_file().map_err(Failure::from)?;
    }
    let done = watched_alone(py, None, move |control| {
        let report = SimulateStudy::run(&case, &request, control)?;
        let (names, values) = if let SimulateReport::FixedStep(run) = &report {
            let [time, tip, rate, ..] = time_series::motion_columns();
            (vec![time, tip, rate], run.curve.concat())
        } else {
            let case = case.cancelled_by(control);
            let model = case.model()?;
            let periods = match &report {
                SimulateReport::OneShot(run) => run.motion.periods.ceil() as usize,
                _ => series_periods,
            };
            let values = rows(&model, periods, request.resolution, |row| {
                report.sample(&case, &request, series_periods, row)
            })?;
            (time_series::columns(&model), values)
        };
        let (document, report) = (document(&report)?, MotionReport::Run(report));
        let answer = MotionAnswer {
            case,
            report,
            options: MotionOptions::Run(Box::new(request)),
        };
        Ok((document, answer, names, values))
    })?;
    let (report, answer, names, values) = done.result;
    let (series, document) = (table(py, names, values)?, python(py, &report)?);
    let columns = columns(py, &[Some(entries(report))])?;
    Ok((document, columns, ReportCore::new(answer), series))
}

/// A periodic orbit: its document and its report.
#[pyfunction]
pub(crate) fn orbit<'py>(
    py: Python<'py>,
    case: &CaseCore,
    request: &str,
) -> PyResult<(Bound<'py, PyAny>, ReportCore)> {
    let case = case.studied(py)?;
    let request: OrbitOptions = read(json(request)?).map_err(Failure::from)?;
    // An orbit of a given period may have to be searched for from starts all over.
    let searched = request.period.is_some() && request.state.is_none();
    let work = move |control: &Control<'_>| {
        let found = OrbitStudy::run(&case, &request, control)?;
        let (document, report) = (document(&found)?, MotionReport::Orbit(Box::new(found)));
        Ok((
            document,
            MotionAnswer {
                case,
                report,
                options: MotionOptions::Orbit(request),
            },
        ))
    };
    let done = if searched {
        watched(py, None, work)?
    } else {
        watched_alone(py, None, work)?
    };
    let (document, answer) = done.result;
    Ok((python(py, &document)?, ReportCore::new(answer)))
}

/// The time series of so many periods from a state.
#[pyfunction]
pub(crate) fn series<'py>(
    py: Python<'py>,
    case: &CaseCore,
    state: Vec<f64>,
    periods: usize,
    resolution: usize,
) -> PyResult<Table<'py>> {
    let studied = case.studied(py)?;
    let done = watched_alone(py, None, move |control| {
        let model = studied.cancelled_by(control).model()?;
        let values = rows(&model, periods, resolution, |row| {
            time_series::sample(&model, &state, periods, resolution, row)
        })?;
        Ok((time_series::columns(&model), values))
    })?;
    let (names, values) = done.result;
    table(py, names, values)
}

/// The report of one motion of a study that has one.
fn report(
    name: &str,
    case: &Case,
    request: serde_json::Value,
    control: &Control<'_>,
) -> Result<serde_json::Value, Error> {
    match name {
        SimulateStudy::NAME => {
            let report = SimulateStudy::run(case, &read(request)?, control)?;
            Ok(serde_json::to_value(&report)?)
        }
        OrbitStudy::NAME => {
            // Single results alone show harmonics.
            let request = OrbitOptions {
                harmonics: 0,
                ..read(request)?
            };
            Ok(serde_json::to_value(&OrbitStudy::run(
                case, &request, control,
            )?)?)
        }
        other => Err(Error::input(
            format!("{other} is not a study of single motions"),
            format!("there are {} and {}", SimulateStudy::NAME, OrbitStudy::NAME),
        )),
    }
}

/// The columns of the results, the reason of each failure (empty on success), the names of the
/// entries along `state` and `energy`, and whether Ctrl-C stopped the work.
type Found = (
    Vec<Column>,
    Vec<String>,
    [(&'static str, Vec<String>); 2],
    bool,
);

/// Many variants of a case, each run or brought to its orbit as the study called `name` does, on
/// several threads: `keys` are those that vary, `words` the `key=value` words of each variant, and
/// `requests` one for all, or one a variant.
#[pyfunction]
#[pyo3(signature = (case, keys, words, name, requests, *, threads=None, progress=None))]
pub(crate) fn observe(
    py: Python<'_>,
    case: &CaseCore,
    keys: Vec<String>,
    words: Vec<Vec<String>>,
    name: &str,
    requests: Vec<String>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Found> {
    let variants = case.variants(py, &keys)?;
    let requests = requests
        .iter()
        .map(|request| json(request))
        .collect::<Result<Vec<_>, _>>()?;
    if requests.len() != 1 && requests.len() != words.len() {
        return Err(Failure::input("one request is needed, or one a case").into());
    }
    let name = name.to_owned();
    let done = watched(py, progress, move |control| {
        let finished = AtomicUsize::new(0);
        let total = words.len();
        let one =
            |(index, words): (usize, &Vec<String>)| -> Result<Result<Entries, String>, Failure> {
                if control.is_cancelled() {
                    return Ok(Err("stopped before its turn".into()));
                }
                let request = requests[index % requests.len()].clone();
                let alone = Control {
                    cancel: control.cancel,
                    progress: None,
                };
                let found = variants
                    .with(words, &alone)
                    .and_then(|case| Ok(at_setpoint(case, &alone)?.0))
                    .and_then(|case| report(&name, &case, request, &alone));
                let found = match found {
                    _ if control.is_cancelled() => {
                        return Ok(Err("stopped before it was done".into()));
                    }
                    Ok(report) => Ok(entries(report)),
                    Err(error) if error.kind == ErrorKind::Numerics => Err(error.to_string()),
                    Err(other) => return Err(other.into()),
                };
                let count = finished.fetch_add(1, Ordering::Relaxed) + 1;
                if let Some(progress) = control.progress {
                    progress(count, total);
                }
                Ok(found)
            };
        let found = install(threads, || {
            let all = words.par_iter().enumerate().map(one);
            all.collect::<Result<Vec<_>, _>>()
        })??;
        // One state's names for each dimension.
        let mut names: BTreeMap<usize, Vec<String>> = BTreeMap::new();
        for (found, words) in found.iter().zip(&words) {
            if let Ok(entries) = found
                && !names.contains_key(&entries.dimension)
            {
                let case = at_setpoint(variants.with(words, control)?, control)?.0;
                names.insert(entries.dimension, state_names(&case.model()?));
            }
        }
        Ok((found, names))
    })?;
    let (found, names) = done.result;
    let widest = names.values().next_back().cloned().unwrap_or_default();
    let balanced = found.iter().flatten().find(|one| !one.energies.is_empty());
    let energies = balanced.map_or_else(Vec::new, |one| one.energies.clone());
    let (mut reports, mut reasons) = (Vec::new(), Vec::new());
    for one in found {
        match one {
            Ok(mut entries) => {
                if entries.dimension != widest.len() {
                    entries.among(&names[&entries.dimension], &widest);
                }
                reports.push(Some(entries));
                reasons.push(String::new());
            }
            Err(reason) => {
                reports.push(None);
                reasons.push(reason);
            }
        }
    }
    let labels = [("state", widest), ("energy", energies)];
    Ok((columns(py, &reports)?, reasons, labels, done.interrupted))
}

/// Meaning and units of the entries of results, JSON.
#[pyfunction]
pub(crate) fn glossary() -> PyResult<String> {
    Ok(serde_json::to_string(&nanotap::observe::glossary::glossary()).map_err(Failure::from)?)
}

/// The labels of the axes of observables, by name.
#[pyfunction]
pub(crate) fn labels() -> BTreeMap<&'static str, &'static str> {
    OBSERVABLES.iter().map(|o| (o.name, o.label)).collect()
}
