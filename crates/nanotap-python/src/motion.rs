//! Single motions: modes, runs, orbits, and what is observed of many cases at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap::ErrorKind;
use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::model::Model;
use nanotap::model::beam::Modes;
use nanotap::observe::time_series;
use nanotap::study::modes::{ModesRequest, ModesStudy};
use nanotap::study::orbit::{OrbitRequest, OrbitStudy};
use nanotap::study::registry::{self, Document, Study as _};
use nanotap::study::request::read;
use nanotap::study::simulate::{SimulateReport, SimulateRequest, SimulateStudy};
use nanotap::study::threads::install;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::case::CaseCore;
use crate::failure::Failure;
use crate::study::json;
use crate::watch::watched;

type Row<'py> = Bound<'py, PyArray1<f64>>;
type Rows<'py> = Bound<'py, PyArray2<f64>>;
/// Names of columns, and their numbers row by row.
type Table<'py> = (Vec<String>, Rows<'py>);

fn table(py: Python<'_>, names: Vec<String>, values: Vec<f64>) -> PyResult<Table<'_>> {
    let shape = [values.len() / names.len().max(1), names.len()];
    Ok((names, PyArray1::from_vec(py, values).reshape(shape)?))
}

/// Frequencies (JSON), positions along the beam, and the mode shapes there.
#[pyfunction]
pub(crate) fn modes<'py>(
    py: Python<'py>,
    case: &CaseCore,
    request: &str,
) -> PyResult<(String, Row<'py>, Rows<'py>)> {
    let studied = case.studied(py)?;
    let request: ModesRequest = read(json(request)?).map_err(Failure::from)?;
    let table = ModesStudy::run(&studied, &request, &Control::default()).map_err(Failure::from)?;
    let beam = Modes::new(table.modes).map_err(|error| Failure::input(error.to_string()))?;
    let points = request.points;
    let xi: Vec<f64> = (0..points)
        .map(|point| point as f64 / (points - 1) as f64)
        .collect();
    let shapes: Vec<f64> = xi
        .iter()
        .flat_map(|&xi| beam.shapes(xi).as_slice().to_vec())
        .collect();
    let document =
        serde_json::to_string(&Document::new(&table, &studied)).map_err(Failure::from)?;
    let shapes = PyArray1::from_vec(py, shapes).reshape([points, table.modes])?;
    Ok((document, PyArray1::from_vec(py, xi), shapes))
}

fn series(
    model: &Model,
    start: &[f64],
    periods: usize,
    resolution: usize,
) -> Result<Vec<f64>, Failure> {
    let mut values = Vec::new();
    time_series::sample(model, start, periods, resolution, |row| {
        values.extend_from_slice(row);
    })?;
    Ok(values)
}

/// One run: its document, and its time series or, of fixed steps, its curve. Of the time
/// series `series_periods` are taken.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    case: &CaseCore,
    request: &str,
    series_periods: usize,
) -> PyResult<(String, Table<'py>)> {
    let studied = case.studied(py)?;
    let request: SimulateRequest = read(json(request)?).map_err(Failure::from)?;
    let done = watched(py, None, move |control| {
        let report = SimulateStudy::run(&studied, &request, control)?;
        let document = serde_json::to_string(&Document::new(&report, &studied))?;
        let (names, values) = match &report {
            SimulateReport::Exact(run) => {
                let model = studied.model()?;
                let start = &run.motion.start;
                let values = series(&model, start, series_periods, request.resolution)?;
                (time_series::columns(&model), values)
            }
            SimulateReport::FixedStep(run) => {
                let names = ["tau", "tip", "tip_rate"].map(str::to_owned).to_vec();
                (names, run.curve.concat())
            }
        };
        Ok((document, names, values))
    })?;
    let (document, names, values) = done.result;
    Ok((document, table(py, names, values)?))
}

/// A periodic orbit: its document and the time series of one repetition.
#[pyfunction]
pub(crate) fn orbit<'py>(
    py: Python<'py>,
    case: &CaseCore,
    request: &str,
) -> PyResult<(String, Table<'py>)> {
    let studied = case.studied(py)?;
    let request: OrbitRequest = read(json(request)?).map_err(Failure::from)?;
    let done = watched(py, None, move |control| {
        let model = studied.model()?;
        let found = OrbitStudy::run(&studied, &request, control)?;
        let orbit = &found.motion;
        let values = series(&model, &orbit.state, orbit.period, request.resolution)?;
        Ok((
            serde_json::to_string(&Document::new(&found, &studied))?,
            time_series::columns(&model),
            values,
        ))
    })?;
    let (document, names, values) = done.result;
    Ok((document, table(py, names, values)?))
}

/// What is observed of one case of many: a document, or why there is none.
type Observed = Result<String, String>;

/// The same as Python is told.
type Told = (Option<String>, String);

/// Many cases, each run or brought to its orbit as the study called `name` does, on several
/// threads; one request for all, or one a case. A document (`None` where there is none) and a reason (empty where there is a
/// document) each, and whether Ctrl-C stopped it.
#[pyfunction]
#[pyo3(signature = (cases, name, requests, *, threads=None, progress=None))]
pub(crate) fn observe(
    py: Python<'_>,
    cases: Vec<PyRef<'_, CaseCore>>,
    name: &str,
    requests: Vec<String>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Vec<Told>, bool)> {
    let cases: Vec<Arc<Case>> = cases
        .iter()
        .map(|case| case.studied(py))
        .collect::<PyResult<_>>()?;
    let entry = registry::study(name)
        .ok_or_else(|| Failure::input(format!("there is no study `{name}`")))?;
    let requests = requests
        .iter()
        .map(|request| json(request))
        .collect::<Result<Vec<_>, _>>()?;
    if requests.len() != 1 && requests.len() != cases.len() {
        return Err(Failure::input("one request is needed, or one a case").into());
    }
    let done = watched(py, progress, move |control| {
        let finished = AtomicUsize::new(0);
        let total = cases.len();
        let one = |(index, studied): (usize, &Arc<Case>)| -> Result<Observed, Failure> {
            if control.is_cancelled() {
                return Ok(Err("stopped before its turn".into()));
            }
            let request = requests[index % requests.len()].clone();
            let observed = match entry.document(studied, request, &Control::default()) {
                Ok(document) => Ok(document),
                Err(error) if error.kind == ErrorKind::Numerics => Err(error.to_string()),
                Err(other) => return Err(other.into()),
            };
            let count = finished.fetch_add(1, Ordering::Relaxed) + 1;
            if let Some(progress) = control.progress {
                progress(count, total);
            }
            Ok(observed)
        };
        install(threads, || {
            cases
                .par_iter()
                .enumerate()
                .map(one)
                .collect::<Result<Vec<_>, _>>()
        })?
    })?;
    let pairs = done.result.into_iter().map(|observed| match observed {
        Ok(document) => (Some(document), String::new()),
        Err(reason) => (None, reason),
    });
    Ok((pairs.collect(), done.interrupted))
}

/// What the entries of results mean, and their units: JSON.
#[pyfunction]
pub(crate) fn glossary() -> PyResult<String> {
    Ok(serde_json::to_string(&nanotap::observe::glossary::glossary()).map_err(Failure::from)?)
}
