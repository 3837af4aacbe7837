//! Single motions: modes, runs, orbits, and what is observed of many cases at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap::ErrorKind;
use nanotap::case::Case;
use nanotap::model::Model;
use nanotap::model::beam::Modes;
use nanotap::observe::PhysicalMotion;
use nanotap::observe::time_series;
use nanotap::study::fixed_step::{FixedStepOptions, FixedStepRun, Switching, fixed_step_run};
use nanotap::study::modes::ModeTable;
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit as find_orbit};
use nanotap::study::simulate::{SettleOptions, SimulateOptions, Simulation, simulate as run};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use rayon::prelude::*;
use serde::Serialize;

use crate::case::CaseCore;
use crate::failure::Failure;
use crate::watch::{on_threads, watched};

/// A result with what it is in SI.
#[derive(Serialize)]
struct Document<'a, R: Serialize> {
    #[serde(flatten)]
    result: &'a R,
    #[serde(skip_serializing_if = "Option::is_none")]
    physical: Option<PhysicalMotion>,
}

fn run_document(run: &Simulation, studied: &Case) -> Result<String, Failure> {
    let physical = studied
        .physical()
        .map(|resolved| PhysicalMotion::alone(&run.observables, None, resolved));
    Ok(serde_json::to_string(&Document {
        result: run,
        physical,
    })?)
}

/// The document of an orbit.
pub(crate) fn orbit_document(orbit: &OrbitReport, studied: &Case) -> Result<String, Failure> {
    let physical = studied
        .physical()
        .map(|resolved| PhysicalMotion::alone(&orbit.observables, Some(&orbit.spectrum), resolved));
    Ok(serde_json::to_string(&Document {
        result: orbit,
        physical,
    })?)
}

/// A state as numpy holds it.
pub(crate) fn numbers(state: Option<PyReadonlyArray1<'_, f64>>) -> Option<Vec<f64>> {
    state.map(|state| state.as_array().to_vec())
}

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
    points: usize,
) -> PyResult<(String, Row<'py>, Rows<'py>)> {
    let studied = case.studied(py)?;
    let Some(case) = studied.cantilever() else {
        return Err(oscillator(&studied, "modes").into());
    };
    let table = ModeTable::new(case).map_err(Failure::from)?;
    let beam = Modes::new(case.modes).map_err(|error| Failure::input(error.to_string()))?;
    let step = 1.0 / points.saturating_sub(1).max(1) as f64;
    let xi: Vec<f64> = (0..points).map(|point| point as f64 * step).collect();
    let shapes: Vec<f64> = xi
        .iter()
        .flat_map(|&xi| beam.shapes(xi).as_slice().to_vec())
        .collect();
    let document = serde_json::to_string(&table).map_err(Failure::from)?;
    let shapes = PyArray1::from_vec(py, shapes).reshape([points, case.modes])?;
    Ok((document, PyArray1::from_vec(py, xi), shapes))
}

/// A case of the wrong kind.
pub(crate) fn oscillator(studied: &Case, command: &str) -> Failure {
    Failure::input(format!(
        "{}: `{command}` needs a cantilever; this is an oscillator",
        studied.title()
    ))
}

fn settle(max_period: usize) -> SettleOptions {
    SettleOptions {
        max_period,
        ..SettleOptions::default()
    }
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

/// One run: its document and `series` periods of its time series.
#[pyfunction]
#[pyo3(signature = (case, *, periods, transient, state, strobe, max_period, series_periods, resolution))]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    case: &CaseCore,
    periods: usize,
    transient: Option<usize>,
    state: Option<PyReadonlyArray1<'_, f64>>,
    strobe: usize,
    max_period: usize,
    series_periods: usize,
    resolution: usize,
) -> PyResult<(String, Table<'py>)> {
    let studied = case.studied(py)?;
    let options = SimulateOptions {
        periods,
        transient,
        state: numbers(state),
        strobe,
        settle: settle(max_period),
        ..SimulateOptions::default()
    };
    let done = watched(py, None, move |_| {
        let model = studied.model()?;
        let run = run(&model, &options)?;
        let values = series(&model, &run.start, series_periods, resolution)?;
        Ok((
            run_document(&run, &studied)?,
            time_series::columns(&model),
            values,
        ))
    })?;
    let (document, names, values) = done.result;
    Ok((document, table(py, names, values)?))
}

/// One run of the paper's fixed-step method: its document and its curve.
#[pyfunction]
#[pyo3(signature = (case, *, periods, transient, state, strobe, max_period, steps, every_stage))]
pub(crate) fn fixed_step<'py>(
    py: Python<'py>,
    case: &CaseCore,
    periods: usize,
    transient: Option<usize>,
    state: Option<PyReadonlyArray1<'_, f64>>,
    strobe: usize,
    max_period: usize,
    steps: [u32; 2],
    every_stage: bool,
) -> PyResult<(String, Table<'py>)> {
    let studied = case.studied(py)?;
    let options = FixedStepOptions {
        periods,
        transient: transient.unwrap_or(FixedStepOptions::default().transient),
        state: numbers(state),
        strobe,
        steps,
        switching: if every_stage {
            Switching::EveryStage
        } else {
            Switching::EveryStep
        },
        settle: settle(max_period),
    };
    let done = watched(py, None, move |_| {
        let run: FixedStepRun = fixed_step_run(&studied.model()?, &options)?;
        Ok((serde_json::to_string(&run)?, run.curve.concat()))
    })?;
    let (document, values) = done.result;
    let names = ["tau", "tip", "tip_rate"].map(str::to_owned).to_vec();
    Ok((document, table(py, names, values)?))
}

/// A periodic orbit: its document and the time series of one repetition.
#[pyfunction]
#[pyo3(signature = (case, *, period, state, harmonics, resolution))]
pub(crate) fn orbit<'py>(
    py: Python<'py>,
    case: &CaseCore,
    period: Option<usize>,
    state: Option<PyReadonlyArray1<'_, f64>>,
    harmonics: usize,
    resolution: usize,
) -> PyResult<(String, Table<'py>)> {
    let studied = case.studied(py)?;
    let options = OrbitOptions {
        period,
        state: numbers(state),
        harmonics,
        ..OrbitOptions::default()
    };
    let done = watched(py, None, move |_| {
        let model = studied.model()?;
        let found = find_orbit(&model, &options)?;
        let values = series(&model, &found.state, found.period, resolution)?;
        Ok((
            orbit_document(&found, &studied)?,
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

/// How each of many cases is observed.
#[derive(Clone)]
enum Observe {
    Run(SimulateOptions),
    Orbit(OrbitOptions),
}

impl Observe {
    fn one(&self, studied: &Case) -> Result<String, Failure> {
        let model = studied.model()?;
        match self {
            Self::Run(options) => run_document(&run(&model, options)?, studied),
            Self::Orbit(options) => orbit_document(&find_orbit(&model, options)?, studied),
        }
    }
}

/// Many cases, each run or brought to its orbit, on several threads: a document (`None`
/// where there is none) and a reason (empty where there is a document) each, and whether
/// Ctrl-C stopped it.
#[pyfunction]
#[pyo3(signature = (cases, *, orbits, periods, transient, period, state, strobe, max_period, harmonics, threads, progress))]
pub(crate) fn observe(
    py: Python<'_>,
    cases: Vec<PyRef<'_, CaseCore>>,
    orbits: bool,
    periods: usize,
    transient: Option<usize>,
    period: Option<usize>,
    state: Option<PyReadonlyArray1<'_, f64>>,
    strobe: usize,
    max_period: usize,
    harmonics: usize,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Vec<Told>, bool)> {
    let cases: Vec<Arc<Case>> = cases
        .iter()
        .map(|case| case.studied(py))
        .collect::<PyResult<_>>()?;
    let state = numbers(state);
    let how = if orbits {
        Observe::Orbit(OrbitOptions {
            period,
            state,
            harmonics,
            settle: settle(max_period),
            ..OrbitOptions::default()
        })
    } else {
        Observe::Run(SimulateOptions {
            periods,
            transient,
            state,
            strobe,
            settle: settle(max_period),
            ..SimulateOptions::default()
        })
    };
    let done = watched(py, progress, move |control| {
        let finished = AtomicUsize::new(0);
        let total = cases.len();
        let one = |studied: &Arc<Case>| -> Result<Observed, Failure> {
            if control.is_cancelled() {
                return Ok(Err("stopped before its turn".into()));
            }
            let observed = match how.one(studied) {
                Ok(document) => Ok(document),
                Err(Failure(error)) if error.kind == ErrorKind::Numerics => Err(error.to_string()),
                Err(other) => return Err(other),
            };
            let count = finished.fetch_add(1, Ordering::Relaxed) + 1;
            if let Some(progress) = control.progress {
                progress(count, total);
            }
            Ok(observed)
        };
        on_threads(threads, || {
            cases.par_iter().map(one).collect::<Result<Vec<_>, _>>()
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
