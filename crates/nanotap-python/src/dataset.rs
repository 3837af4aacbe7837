//! Sweeps and basins: plans whose chunks are computed here or elsewhere, and the stores that hold
//! them.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nanotap::case::physical::Kind;
use nanotap::control::Control;
use nanotap::dataset::gsf::Field;
use nanotap::dataset::{self, Share, Store, StoreError, Values, Work, WorkError, files, table};
use nanotap::number::shortest;
use nanotap::study::DatasetStudy as _;
use nanotap::study::fit::{FitMap, FitOptions};
use nanotap::study::registry;
use nanotap::study::request::read;
use nanotap::study::threads::{checked, install};
use nanotap::study::window::Window;
use nanotap_figures::Figure;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::IntoPyObjectExt as _;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::case::CaseCore;
use crate::failure::Failure;
use crate::study::{entry, json};
use crate::watch::watched;

/// A checked plan of a sweep or basin; its chunks are pure functions of it.
#[pyclass(frozen, module = "nanotap._nanotap")]
pub(crate) struct Recipe {
    recipe: Arc<registry::DatasetPlan>,
}

#[pymethods]
impl Recipe {
    /// The plan of the study `name` for a case; the key `file` of a fit's request is the path of a map.
    /// What chunks need, such as the attractors of a basin, is computed now.
    #[new]
    #[pyo3(signature = (name, case, request, *, threads=None, progress=None))]
    fn new(
        py: Python<'_>,
        name: &str,
        case: &CaseCore,
        request: &str,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let entry = entry(name)?;
        let mut request = json(request)?;
        let file = request.as_object_mut().and_then(|all| all.remove("file"));
        let file = file.and_then(|file| file.as_str().map(PathBuf::from));
        let any_distance = (entry.any_distance)(&request).map_err(Failure::from)?;
        let case = case.studied_unless(any_distance, py)?;
        let done = watched(py, progress, move |control| {
            Ok(install(threads, || match &file {
                Some(path) => {
                    let options: FitOptions = read(request)?;
                    let name = path.display().to_string();
                    let options = options.of_map(&name, nanotap::files::open(path)?)?;
                    FitMap::prepare(&case, &options, control)
                }
                None => entry.plan(&case, request, control),
            })??)
        })?;
        Ok(Self {
            recipe: Arc::new(done.result),
        })
    }

    /// Number of chunks.
    #[getter]
    fn chunks(&self) -> usize {
        self.recipe.schema().grid.chunks()
    }

    /// Computes the missing chunks of a share in the store at `path`; returns whether Ctrl-C
    /// stopped it.
    #[pyo3(signature = (path, *, share, threads, progress))]
    fn compute(
        &self,
        py: Python<'_>,
        path: PathBuf,
        share: &str,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<bool> {
        let threads = checked(threads).map_err(Failure::from)?.unwrap_or(0);
        let share: Share = share
            .parse()
            .map_err(|error: dataset::ShareError| Failure::input(error.to_string()))?;
        let store = self.store(&path)?;
        let recipe = Arc::clone(&self.recipe);
        let done = watched(py, progress, move |control| {
            let work = Work {
                share,
                threads,
                control: *control,
            };
            computed(&recipe, store, &work)
        })?;
        Ok(done.interrupted)
    }

    /// The files of one chunk; the same bytes on every machine.
    fn chunk_files<'py>(
        &self,
        py: Python<'py>,
        chunk: usize,
    ) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let recipe = Arc::clone(&self.recipe);
        let done = watched(py, None, move |control| {
            recipe
                .chunk_files(chunk, control)
                .ok_or_else(|| Failure::input(format!("no chunk {chunk}")))
        })?;
        let files = done.result.iter().map(|file| PyBytes::new(py, file));
        Ok(files.collect())
    }

    /// Opens the store at `path` for many chunks that are computed elsewhere.
    fn receiver(&self, path: PathBuf) -> PyResult<Receiver> {
        Ok(Receiver {
            store: self.store(&path)?,
            recipe: Arc::clone(&self.recipe),
        })
    }
}

impl Recipe {
    fn store(&self, path: &Path) -> Result<Store, Failure> {
        Ok(Store::create_or_resume(path, self.recipe.schema().clone())?)
    }
}

/// A store that takes chunks computed elsewhere.
#[pyclass(frozen, module = "nanotap._nanotap")]
pub(crate) struct Receiver {
    store: Store,
    recipe: Arc<registry::DatasetPlan>,
}

#[pymethods]
impl Receiver {
    /// The missing chunks.
    #[getter]
    fn missing(&self) -> Vec<usize> {
        (0..self.store.chunks())
            .filter(|chunk| !self.store.is_finished(*chunk))
            .collect()
    }

    /// Stores the files of a chunk.
    fn take(&self, chunk: usize, files: Vec<Vec<u8>>) -> PyResult<()> {
        Ok(self
            .store
            .take_files(chunk, &files)
            .map_err(Failure::from)?)
    }

    /// Finishes a store with all chunks: does the work that needs them all, and removes partial
    /// files of interrupted work.
    fn finish(&self) -> PyResult<()> {
        if self.store.missing() > 0 {
            return Ok(());
        }
        let work = Work {
            share: Share::WHOLE,
            threads: 0,
            control: Control::default(),
        };
        let store = Store::open(self.store.path()).map_err(Failure::from)?;
        Ok(computed(&self.recipe, store, &work)?)
    }
}

/// Computes the missing chunks, and joins the chunks of a dataset that is finished.
fn computed(recipe: &registry::DatasetPlan, store: Store, work: &Work<'_>) -> Result<(), Failure> {
    match recipe.compute(&store, work) {
        Ok(()) => Ok(dataset::finish(store).map(drop)?),
        Err(WorkError::Cancelled { .. } | WorkError::Neighbours) => Ok(()),
        Err(error) => Err(nanotap::Error::from(error).into()),
    }
}

/// Merges partial datasets: JSON.
#[pyfunction]
pub(crate) fn merge(py: Python<'_>, sources: Vec<PathBuf>, out: PathBuf) -> PyResult<String> {
    let done = watched(py, None, move |_| {
        Ok(serde_json::to_string(&dataset::merge(&sources, &out)?)?)
    })?;
    Ok(done.result)
}

/// The values of a dataset in memory.
type Loaded = (Vec<(String, usize, usize)>, Vec<(String, Py<PyAny>)>);

/// The values of the variables of a dataset, row-major, after the range of entries along each axis;
/// `None` if no chunk is finished. With `part` only the entries up to the last finished chunk.
#[pyfunction]
pub(crate) fn load(py: Python<'_>, path: PathBuf, part: bool) -> PyResult<Option<Loaded>> {
    let done = watched(py, None, move |_| {
        let store = Store::open(&path)?;
        let grid = &store.schema().grid;
        let block = if part {
            dataset::finished_block(&store)
        } else {
            Some(grid.whole())
        };
        let Some(block) = block else {
            return Ok(None);
        };
        let variables = store.schema().variables.iter().enumerate();
        let column = |(k, variable): (usize, &dataset::Variable)| {
            Ok((variable.name.clone(), dataset::column(&store, &block, k)?))
        };
        let columns = variables
            .map(column)
            .collect::<Result<Vec<_>, StoreError>>()?;
        let axes = grid.axes.iter().zip(&block.ranges);
        let ranges = axes.map(|(axis, range)| (axis.name.clone(), range.start, range.end));
        Ok(Some((ranges.collect::<Vec<_>>(), columns)))
    })?;
    let Some((ranges, columns)) = done.result else {
        return Ok(None);
    };
    let array = |(name, values)| {
        let array = match values {
            Values::Real(values) => PyArray1::from_vec(py, values).into_py_any(py)?,
            Values::Whole(values) => PyArray1::from_vec(py, values).into_py_any(py)?,
            Values::Code(values) => PyArray1::from_vec(py, values).into_py_any(py)?,
            Values::Text(words) => words.into_py_any(py)?,
        };
        Ok((name, array))
    };
    let columns = columns.into_iter().map(array).collect::<PyResult<_>>()?;
    Ok(Some((ranges, columns)))
}

/// The summary of a finished dataset: JSON.
#[pyfunction]
pub(crate) fn summary(path: PathBuf) -> PyResult<String> {
    let summary = || -> Result<String, Failure> {
        Ok(registry::summarised(&Store::open(&path)?)?.document()?)
    };
    Ok(summary()?)
}

/// The window at each point of a finished sweep over two parameters: JSON.
#[pyfunction]
pub(crate) fn window(path: PathBuf) -> PyResult<String> {
    let window = || -> Result<String, Failure> {
        Ok(serde_json::to_string(&Window::kept(&Store::open(&path)?)?)?)
    };
    Ok(window()?)
}

/// The figure of a finished dataset, as `svg`, `png`, `pdf` or its description as `json`.
#[pyfunction]
pub(crate) fn figure<'py>(
    py: Python<'py>,
    path: PathBuf,
    format: &str,
) -> PyResult<Bound<'py, PyBytes>> {
    let format = format.to_owned();
    let done = watched(py, None, move |_| {
        let summary = registry::summarised(&Store::open(&path)?)?;
        let figure = summary.figure().unwrap_or_default();
        drawn(&figure, &format)
    })?;
    Ok(PyBytes::new(py, &done.result))
}

fn drawn(figure: &Figure, format: &str) -> Result<Vec<u8>, Failure> {
    Ok(match format {
        "svg" => figure.to_svg()?.into_bytes(),
        "png" => figure.to_png(200.0)?,
        "pdf" => figure.to_pdf()?,
        "json" => figure.to_json()?.into_bytes(),
        other => {
            return Err(Failure::input(format!(
                "unknown figure format `{other}`: expected svg, png, pdf or json"
            )));
        }
    })
}

/// Error of a table that is written: of its file, or of the store.
enum TableError {
    System(std::io::Error),
    Store(StoreError),
}

impl From<std::io::Error> for TableError {
    fn from(error: std::io::Error) -> Self {
        Self::System(error)
    }
}

impl From<StoreError> for TableError {
    fn from(error: StoreError) -> Self {
        Self::Store(error)
    }
}

/// Writes the table of a finished dataset as CSV; the file appears whole or not at all.
#[pyfunction]
pub(crate) fn write_table(path: PathBuf, out: PathBuf) -> PyResult<()> {
    let write = || -> Result<(), Failure> {
        let store = Store::open(&path)?;
        let refuse = |error: std::io::Error| -> Failure {
            nanotap::Error::files(format!("cannot write {}: {error}", out.display())).into()
        };
        let written = files::write_with(&out, |file| {
            table::csv(&store, |piece| {
                Ok::<_, TableError>(file.write_all(piece.as_bytes())?)
            })
        });
        written.map_err(|error| match error {
            TableError::System(error) => refuse(error),
            TableError::Store(error) => error.into(),
        })
    };
    Ok(write()?)
}

/// The cells of a column of a table.
#[derive(FromPyObject)]
pub(crate) enum Cells {
    Words(Vec<String>),
    Counts(Vec<i64>),
    Numbers(Vec<f64>),
}

impl Cells {
    fn text(&self, row: usize) -> Option<String> {
        match self {
            Self::Words(words) => words.get(row).cloned(),
            Self::Counts(counts) => counts.get(row).map(ToString::to_string),
            Self::Numbers(numbers) => numbers.get(row).map(|number| match number {
                missing if missing.is_nan() => String::new(),
                number => shortest(*number),
            }),
        }
    }
}

/// Columns as a CSV file, each with its name, its unit, which is shown if it is one of SI, and its
/// cells; missing numbers are empty.
#[pyfunction]
pub(crate) fn csv(columns: Vec<(String, String, Cells)>) -> String {
    let head = |(name, unit, _): &(String, String, Cells)| match Kind::of_si_unit(unit) {
        Some(kind) if !kind.si_unit().is_empty() => format!("{name} ({unit})"),
        _ => name.clone(),
    };
    let mut text = columns.iter().map(head).collect::<Vec<_>>().join(",") + "\n";
    let row = |row: usize| -> Option<Vec<String>> {
        columns.iter().map(|(.., cells)| cells.text(row)).collect()
    };
    for cells in (0..).map_while(row).take_while(|cells| !cells.is_empty()) {
        text += &(cells.join(",") + "\n");
    }
    text
}

/// A map as a file of Gwyddion's.
#[pyfunction]
pub(crate) fn gsf<'py>(
    py: Python<'py>,
    title: String,
    x: PyReadonlyArray1<'_, f64>,
    y: PyReadonlyArray1<'_, f64>,
    values: PyReadonlyArray1<'_, f64>,
    axis_unit: String,
    value_unit: String,
) -> PyResult<Bound<'py, PyBytes>> {
    let row = |values: PyReadonlyArray1<'_, f64>| values.as_array().to_vec();
    let field = Field {
        title,
        x: row(x),
        y: row(y),
        values: row(values),
        axis_unit,
        value_unit,
    };
    let file = field
        .to_gsf()
        .map_err(|error| Failure::input(error.to_string()))?;
    Ok(PyBytes::new(py, &file))
}
