//! Studies: attractors, branches, exponents, convergence, the paper.

use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use nanotap::Error;
use nanotap::case::Case;
use nanotap::case::physical::Catalogue;
use nanotap::frame::{Cell, Column, Frame};
use nanotap::study::calibrate::{
    CalibrateOptions, CalibrateReport, calibrate_file, calibrate_table,
};
use nanotap::study::fit::{FitOptions, Table, implied_words};
use nanotap::study::lyapunov::{LyapunovOptions, LyapunovStudy};
use nanotap::study::registry::{self, Answer, Answered, Study as _, StudyEntry};
use nanotap::study::request::{answer_schema, read};
use nanotap::study::threads::install;
use nanotap_paper::{Options as PaperOptions, report_so_far, section_names};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::case::CaseCore;
use crate::failure::Failure;
use crate::watch::watched;

/// The report of a study, with the tables and the figure that front ends show of it. They are made
/// when they are needed.
#[pyclass(frozen, module = "nanotap._nanotap")]
pub(crate) struct ReportCore(Mutex<Box<dyn Answer>>);

impl ReportCore {
    pub(crate) fn new(answer: impl Answer + 'static) -> Self {
        Self(Mutex::new(Box::new(answer)))
    }

    /// Does `work` on the report without the interpreter lock.
    fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&dyn Answer) -> Result<R, Error> + Send,
    ) -> PyResult<R> {
        let done = py.detach(|| {
            let answer = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            work(&**answer)
        });
        Ok(done.map_err(Failure::from)?)
    }
}

#[pymethods]
impl ReportCore {
    /// The document, JSON.
    #[getter]
    fn document(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |answer| {
            let document = answer.document()?;
            Ok(document)
        })
    }

    /// The tables column by column, JSON.
    #[getter]
    fn tables(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |answer| {
            let tables: Vec<Value> = answer.frames().iter().map(table_of).collect();
            Ok(serde_json::to_string(&tables)?)
        })
    }

    /// What the terminal prints beside the report.
    #[getter]
    fn messages(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.with(py, |answer| {
            Ok(answer.remarks().iter().map(ToString::to_string).collect())
        })
    }

    /// The CSV file that the terminal writes; `None` if there is none.
    #[getter]
    fn csv(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.with(py, |answer| Ok(answer.frames().first().map(Frame::csv)))
    }

    /// The figure, JSON; `None` if there is none.
    #[getter]
    fn figure(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.with(py, |answer| {
            let figure = answer.figure().map(|figure| figure.to_json());
            Ok(figure.transpose()?)
        })
    }
}

/// A table, column by column as in its CSV file.
pub(crate) fn table_of(frame: &Frame<'_>) -> Value {
    let column = |column: &Column<'_>| {
        let value = |row| match frame.cell(column, row) {
            Cell::Empty => Value::Null,
            Cell::Word(word) => word.into(),
            Cell::Count(count) => count.into(),
            Cell::Number(number) => number.into(),
        };
        json!({
            "name": frame.name(column),
            "label": column.label,
            "unit": frame.declared_unit(column.dimension),
            "values": (0..frame.rows).map(value).collect::<Vec<Value>>(),
        })
    };
    // A file may have a quantity twice, in two units; here it is in SI.
    let mut names = HashSet::new();
    let named = frame.columns.iter().filter(|c| !c.name.is_empty());
    let once = named.filter(|c| names.insert(frame.name(c)));
    let columns: Vec<Value> = once.map(column).collect();
    json!({ "name": frame.name, "columns": columns })
}

/// A study: from the JSON of its request to its report, and whether Ctrl-C stopped it.
#[pyfunction]
#[pyo3(signature = (name, case, request, *, threads=None, progress=None))]
pub(crate) fn study(
    py: Python<'_>,
    name: &str,
    case: &CaseCore,
    request: &str,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(ReportCore, bool)> {
    let entry = entry(name)?;
    let request = json(request)?;
    let any_distance = (entry.any_distance)(&request).map_err(Failure::from)?;
    let case = case.studied_unless(any_distance, py)?;
    let done = watched(py, progress, move |control| {
        Ok(install(threads, || entry.answer(&case, request, control))??)
    })?;
    Ok((ReportCore(Mutex::new(done.result)), done.interrupted))
}

/// The study of this name.
pub(crate) fn entry(name: &str) -> Result<&'static StudyEntry, Failure> {
    registry::study(name).ok_or_else(|| Failure::input(format!("unknown study `{name}`")))
}

/// The studies: name, what each is about, what its progress counts, and the JSON schema of its
/// request.
#[pyfunction]
pub(crate) fn studies() -> Vec<(&'static str, &'static str, &'static str, String)> {
    let row = |entry: &StudyEntry| {
        let schema = (entry.request)().as_value().to_string();
        (entry.name, entry.about, entry.counted, schema)
    };
    registry::STUDIES.iter().map(row).collect()
}

/// The calibration, which has no case and so is none of the studies.
const CALIBRATE: &str = "calibrate";

/// The JSON schema of a study's report, in which columns have `x-unit` and `x-label`.
#[pyfunction]
pub(crate) fn report_schema(name: &str) -> PyResult<String> {
    let schema = if name == CALIBRATE {
        answer_schema::<CalibrateReport>()
    } else {
        (entry(name)?.report)()
    };
    Ok(schema.as_value().to_string())
}

/// Calibrates a lever from a file or from the JSON of a table.
#[pyfunction]
pub(crate) fn calibrate(
    py: Python<'_>,
    path: Option<PathBuf>,
    table: Option<String>,
    request: &str,
) -> PyResult<ReportCore> {
    let options: CalibrateOptions = read(json(request)?).map_err(Failure::from)?;
    let done = watched(py, None, move |_| {
        Ok(if let Some(path) = path {
            calibrate_file(&path, &options)?
        } else {
            let table: Table = serde_json::from_str(&table.unwrap_or_default())?;
            calibrate_table(&table, &options)?
        })
    })?;
    Ok(ReportCore::new(done.result))
}

/// A table of measured values from a CSV file or an instrument's file, of which the first curve or the
/// one with this number, as JSON, with the line of each row.
#[pyfunction]
#[pyo3(signature = (path, curve=None))]
pub(crate) fn table(path: PathBuf, curve: Option<usize>) -> PyResult<String> {
    let table = match curve {
        Some(number) => Table::read_curve(&path, number),
        None => Table::read(&path),
    };
    let table = table.map_err(Failure::from)?;
    let mut value = serde_json::to_value(&table).map_err(Failure::from)?;
    value["lines"] = json!(table.lines);
    Ok(value.to_string())
}

/// The case of a force curve without one, from the request of its fit: `key=value` words, and sentences
/// on what is assumed.
#[pyfunction]
pub(crate) fn implied_case(request: &str) -> PyResult<(Vec<String>, Vec<String>)> {
    let request: FitOptions = read(json(request)?).map_err(Failure::from)?;
    let catalogue = Catalogue::shared();
    let load = |words: &[String]| Case::parse_with(None, words, &catalogue);
    let implied = implied_words(&request, &[], load).map_err(Failure::from)?;
    Ok((implied.words, implied.notes))
}

/// The JSON of a request.
pub(crate) fn json(request: &str) -> Result<Value, Failure> {
    serde_json::from_str(request)
        .map_err(|error| Failure::input(format!("the request is not JSON: {error}")))
}

/// Lyapunov exponents, and the points of a section: phase in drive periods, tip, its rate, the gap's
/// rate, then the state.
#[pyfunction]
pub(crate) fn lyapunov<'py>(
    py: Python<'py>,
    case: &CaseCore,
    request: &str,
) -> PyResult<(ReportCore, Bound<'py, PyArray2<f64>>)> {
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
        let rows: Vec<f64> = rows.collect();
        let case = studied;
        Ok((Answered::<LyapunovStudy> { case, report }, rows, width))
    })?;
    let (kept, values, width) = done.result;
    let shape = [values.len() / width, width];
    let rows = PyArray1::from_vec(py, values).reshape(shape)?;
    Ok((ReportCore::new(kept), rows))
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
