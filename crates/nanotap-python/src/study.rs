//! Studies: attractors, branches, exponents, convergence, the paper.

use std::path::PathBuf;

use nanotap::Error;
use nanotap::study::fit::Table;
use nanotap::study::lyapunov::{LyapunovOptions, LyapunovStudy};
use nanotap::study::registry::{self, Document, Study as _};
use nanotap::study::request::read;
use nanotap::study::threads::install;
use nanotap_paper::{Options as PaperOptions, report_so_far, section_names};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::case::CaseCore;
use crate::failure::Failure;
use crate::watch::watched;

/// A study: from the JSON of its request to its document, and whether Ctrl-C stopped it.
#[pyfunction]
#[pyo3(signature = (name, case, request, *, threads=None, progress=None))]
pub(crate) fn study(
    py: Python<'_>,
    name: &str,
    case: &CaseCore,
    request: &str,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, bool)> {
    let entry =
        registry::study(name).ok_or_else(|| Failure::input(format!("unknown study `{name}`")))?;
    let request = json(request)?;
    // Solved for once a case, not once a study.
    let case = if entry.any_distance {
        case.at_any_distance()
    } else {
        case.studied(py)?
    };
    let done = watched(py, progress, move |control| {
        Ok(install(threads, || {
            entry.document(&case, request, control)
        })??)
    })?;
    Ok((done.result, done.interrupted))
}

/// The studies: name, what each is about, what its progress counts, and the JSON schema of its
/// request.
#[pyfunction]
pub(crate) fn studies() -> Vec<(&'static str, &'static str, &'static str, String)> {
    let row = |entry: &registry::StudyEntry| {
        let schema = (entry.request)().as_value().to_string();
        (entry.name, entry.about, entry.counted, schema)
    };
    registry::STUDIES.iter().map(row).collect()
}

/// The JSON schema of a study's report, in which columns have `x-unit` and `x-label`.
#[pyfunction]
pub(crate) fn report_schema(name: &str) -> PyResult<String> {
    let entry = registry::study(name);
    let entry = entry.ok_or_else(|| Failure::input(format!("unknown study `{name}`")))?;
    Ok((entry.report)().as_value().to_string())
}

/// A table of measured values from a CSV file, as JSON.
#[pyfunction]
pub(crate) fn table(path: PathBuf) -> PyResult<String> {
    let table = Table::read(&path).map_err(Failure::from)?;
    let text = serde_json::to_string(&table).map_err(Error::from);
    Ok(text.map_err(Failure::from)?)
}

/// The JSON of a request.
pub(crate) fn json(request: &str) -> Result<serde_json::Value, Failure> {
    serde_json::from_str(request)
        .map_err(|error| Failure::input(format!("the request is not JSON: {error}")))
}

/// Lyapunov exponents (JSON) and the points of a section: phase in drive periods, tip, its
/// rate, the gap's rate, then the state.
#[pyfunction]
pub(crate) fn lyapunov<'py>(
    py: Python<'py>,
    case: &CaseCore,
    request: &str,
) -> PyResult<(String, Bound<'py, PyArray2<f64>>)> {
    let studied = case.studied(py)?;
    let request: LyapunovOptions = read(json(request)?).map_err(Failure::from)?;
    let done = watched(py, None, move |control| {
        let report = LyapunovStudy::run(&studied, &request, control)?;
        let rows = report.section.iter().flat_map(|p| {
            [p.phase, p.tip, p.tip_rate, p.gap_rate]
                .into_iter()
                .chain(p.state.iter().copied())
        });
        let width = 4 + report.section.first().map_or(0, |p| p.state.len());
        Ok((
            serde_json::to_string(&Document::new(&report, &studied))?,
            rows.collect::<Vec<f64>>(),
            width,
        ))
    })?;
    let (document, values, width) = done.result;
    let shape = [values.len() / width, width];
    Ok((document, PyArray1::from_vec(py, values).reshape(shape)?))
}

/// Recomputes the paper, with report and figures in the folder `out`: JSON, and whether Ctrl-C
/// stopped it.
#[pyfunction]
#[pyo3(signature = (*, out, only, quick, threads, progress))]
pub(crate) fn paper(
    py: Python<'_>,
    out: PathBuf,
    only: Vec<String>,
    quick: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, bool)> {
    let done = watched(py, progress, move |control| {
        // Before the work, not after it.
        std::fs::create_dir_all(&out)
            .map_err(|error| Error::files(format!("cannot make {}: {error}", out.display())))?;
        let options = PaperOptions { only, quick };
        let (report, _) = install(threads, || report_so_far(&options, control))??;
        let written = report.write(&out)?;
        Ok(serde_json::to_string(&report.document(&out, &written))?)
    })?;
    Ok((done.result, done.interrupted))
}

/// The names of the report's sections.
#[pyfunction]
pub(crate) fn paper_sections() -> Vec<&'static str> {
    section_names().collect()
}
