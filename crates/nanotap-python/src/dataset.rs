//! Sweeps and basins: recipes whose chunks are computed here or elsewhere, and the stores
//! that hold them.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::dataset::gsf::Field;
use nanotap::dataset::{self, Schema, Share, Store, Work, WorkError, table};
use nanotap::study::basin::{self, Basin, BasinOptions, SliceRange};
use nanotap::study::sweep::{self, Follow, Over, Starts, Sweep, SweepOptions};
use nanotap::study::window::Window;
use nanotap_figures::Figure;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::case::CaseCore;
use crate::failure::Failure;
use crate::motion::numbers;
use crate::watch::{on_threads, watched};

/// What is computed.
enum Kind {
    Sweep(Box<Sweep>),
    Basin(Box<Basin>),
}

impl Kind {
    fn schema(&self) -> &Schema {
        match self {
            Self::Sweep(sweep) => sweep.schema(),
            Self::Basin(basin) => basin.schema(),
        }
    }

    fn compute(&self, store: &Store, work: &Work<'_>) -> Result<(), WorkError> {
        match self {
            Self::Sweep(sweep) => sweep.compute(store, work),
            Self::Basin(basin) => basin.compute(store, work),
        }
    }

    fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>> {
        match self {
            Self::Sweep(sweep) => sweep.chunk_files(chunk, control),
            Self::Basin(basin) => basin.chunk_files(chunk, control),
        }
    }
}

/// A sweep or basin that was checked: its chunks are pure functions of it.
#[pyclass(frozen, module = "nanotap._nanotap")]
pub(crate) struct Recipe {
    kind: Arc<Kind>,
}

#[pymethods]
impl Recipe {
    /// A sweep over one or two parameters, each written as the terminal does.
    #[staticmethod]
    #[pyo3(signature = (case, *, over, starts, seed, sides, state, follow, periods, strobe, transient, max_period))]
    fn sweep(
        py: Python<'_>,
        case: &CaseCore,
        over: Vec<String>,
        starts: Option<usize>,
        seed: u64,
        sides: Vec<(String, f64, f64)>,
        state: Option<PyReadonlyArray1<'_, f64>>,
        follow: Option<&str>,
        periods: usize,
        strobe: Option<usize>,
        transient: Option<usize>,
        max_period: usize,
    ) -> PyResult<Self> {
        let studied = case.studied(py)?;
        let over = over
            .iter()
            .map(|given| Over::parse(given, &studied))
            .collect::<Result<Vec<_>, _>>()
            .map_err(Failure::from)?;
        let starts = match (starts, numbers(state)) {
            (Some(count), _) => Starts::Seeded { count, seed, sides },
            (None, Some(state)) => Starts::Given(state),
            (None, None) => Starts::Rest,
        };
        let follow = follow
            .map_or(Ok(Follow::Off), str::parse)
            .map_err(Failure::input)?;
        let options = SweepOptions {
            starts,
            follow,
            periods,
            strobe: strobe.unwrap_or(periods).min(periods),
            transient,
            max_period,
            ..SweepOptions::new(over)
        };
        let sweep = Sweep::new(Case::clone(&studied), options).map_err(Failure::from)?;
        Ok(Self {
            kind: Arc::new(Kind::Sweep(Box::new(sweep))),
        })
    }

    /// Basins on a slice, its axes written as the terminal does. The census that finds the
    /// attractors runs now.
    #[staticmethod]
    #[pyo3(signature = (case, *, x, y, state, attractors, starts, seed, periods, max_period, threads, progress))]
    fn basin(
        py: Python<'_>,
        case: &CaseCore,
        x: &str,
        y: &str,
        state: Option<PyReadonlyArray1<'_, f64>>,
        attractors: Option<Vec<Vec<f64>>>,
        starts: usize,
        seed: u64,
        periods: usize,
        max_period: usize,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let studied = case.studied(py)?;
        let range = |given: &str| SliceRange::parse(given).map_err(Failure::from);
        let options = BasinOptions {
            state: numbers(state),
            attractors,
            starts,
            seed,
            periods,
            max_period,
            ..BasinOptions::new(range(x)?, range(y)?)
        };
        let done = watched(py, progress, move |control| {
            let basin = on_threads(threads, || Basin::new(&studied, &options, control))??;
            Ok(basin)
        })?;
        Ok(Self {
            kind: Arc::new(Kind::Basin(Box::new(done.result))),
        })
    }

    /// Number of chunks.
    #[getter]
    fn chunks(&self) -> usize {
        self.kind.schema().grid.chunks()
    }

    /// Computes the chunks of a share that the store at `path` lacks; says whether Ctrl-C
    /// stopped it.
    #[pyo3(signature = (path, *, share, threads, progress))]
    fn compute(
        &self,
        py: Python<'_>,
        path: PathBuf,
        share: &str,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<bool> {
        let share: Share = share
            .parse()
            .map_err(|error: dataset::ShareError| Failure::input(error.to_string()))?;
        let store = self.store(&path)?;
        let kind = Arc::clone(&self.kind);
        let done = watched(py, progress, move |control| {
            let work = Work {
                share,
                threads,
                control: *control,
            };
            match kind.compute(&store, &work) {
                Ok(()) | Err(WorkError::Cancelled { .. }) => Ok(()),
                Err(WorkError::Store(error)) => Err(error.into()),
            }
        })?;
        Ok(done.interrupted)
    }

    /// The files of one chunk: the same bytes wherever it is computed.
    fn chunk_files<'py>(
        &self,
        py: Python<'py>,
        chunk: usize,
    ) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let kind = Arc::clone(&self.kind);
        let done = watched(py, None, move |control| {
            kind.chunk_files(chunk, control)
                .ok_or_else(|| Failure::input(format!("there is no chunk {chunk}")))
        })?;
        let files = done.result.iter().map(|file| PyBytes::new(py, file));
        Ok(files.collect())
    }

    /// Opens the store at `path` for many chunks that are computed elsewhere.
    fn receiver(&self, path: PathBuf) -> PyResult<Receiver> {
        Ok(Receiver {
            store: self.store(&path)?,
        })
    }
}

impl Recipe {
    fn store(&self, path: &Path) -> Result<Store, Failure> {
        Ok(Store::create_or_resume(path, self.kind.schema().clone())?)
    }
}

/// A store that takes chunks computed elsewhere.
#[pyclass(frozen, module = "nanotap._nanotap")]
pub(crate) struct Receiver {
    store: Store,
}

#[pymethods]
impl Receiver {
    /// The chunks that it lacks.
    #[getter]
    fn missing(&self) -> Vec<usize> {
        (0..self.store.chunks())
            .filter(|chunk| !self.store.is_finished(*chunk))
            .collect()
    }

    /// Takes the files of a chunk.
    fn take(&self, chunk: usize, files: Vec<Vec<u8>>) -> PyResult<()> {
        Ok(self
            .store
            .take_files(chunk, &files)
            .map_err(Failure::from)?)
    }

    /// Removes what killed work left half-written, once every chunk is there.
    fn tidy(&self) -> PyResult<bool> {
        Ok(self.store.tidy().map_err(Failure::from)?)
    }
}

/// Puts together what several machines computed: JSON.
#[pyfunction]
pub(crate) fn merge(py: Python<'_>, sources: Vec<PathBuf>, out: PathBuf) -> PyResult<String> {
    let done = watched(py, None, move |_| {
        Ok(serde_json::to_string(&dataset::merge(&sources, &out)?)?)
    })?;
    Ok(done.result)
}

fn opened(path: &Path) -> Result<(Store, String), Failure> {
    let store = Store::open(path)?;
    let kind = store.schema().attributes.get("kind");
    let kind = kind.and_then(|kind| kind.as_str()).unwrap_or_default();
    let kind = kind.to_owned();
    Ok((store, kind))
}

/// What the runs, or the points of the slice, of a finished dataset came to: JSON.
#[pyfunction]
pub(crate) fn summary(path: PathBuf) -> PyResult<String> {
    let summary = || -> Result<String, Failure> {
        let (store, kind) = opened(&path)?;
        Ok(if kind == "basin" {
            serde_json::to_string(&basin::shares(&store)?)?
        } else {
            serde_json::to_string(&sweep::summary(&store)?)?
        })
    };
    Ok(summary()?)
}

/// What there is at each point of a finished sweep over two parameters: JSON.
#[pyfunction]
pub(crate) fn window(path: PathBuf) -> PyResult<String> {
    let window = || -> Result<String, Failure> {
        let (store, _) = opened(&path)?;
        Ok(serde_json::to_string(&Window::of(&store)?)?)
    };
    Ok(window()?)
}

/// The terminal's picture of a finished dataset, as `svg`, `png` or `pdf`.
#[pyfunction]
pub(crate) fn figure<'py>(
    py: Python<'py>,
    path: PathBuf,
    format: &str,
) -> PyResult<Bound<'py, PyBytes>> {
    let format = format.to_owned();
    let done = watched(py, None, move |_| {
        let (store, kind) = opened(&path)?;
        let figure = if kind == "basin" {
            basin::figure(&store)?
        } else {
            sweep::figure(&store)?
        };
        drawn(&figure, &format)
    })?;
    Ok(PyBytes::new(py, &done.result))
}

fn drawn(figure: &Figure, format: &str) -> Result<Vec<u8>, Failure> {
    Ok(match format {
        "svg" => figure.to_svg()?.into_bytes(),
        "png" => figure.to_png(200.0)?,
        "pdf" => figure.to_pdf()?,
        other => {
            return Err(Failure::input(format!(
                "`{other}` is no format that can be drawn; there are svg, png and pdf"
            )));
        }
    })
}

/// Writes the table of a finished dataset as CSV; the file appears whole or not at all.
#[pyfunction]
pub(crate) fn write_table(path: PathBuf, out: PathBuf) -> PyResult<()> {
    let write = || -> Result<(), Failure> {
        let (store, _) = opened(&path)?;
        let refuse = |error: std::io::Error| -> Failure {
            nanotap::Error::files(format!("cannot write {}: {error}", out.display())).into()
        };
        let temporary = out.with_file_name(format!(".{}.csv.tmp", std::process::id()));
        let written = File::create(&temporary).map_err(refuse).and_then(|file| {
            let mut file = BufWriter::new(file);
            table::csv::<Failure>(&store, |piece| {
                file.write_all(piece.as_bytes()).map_err(refuse)
            })?;
            file.flush().map_err(refuse)?;
            std::fs::rename(&temporary, &out).map_err(refuse)
        });
        if written.is_err() {
            let _ = std::fs::remove_file(&temporary);
        }
        written
    };
    Ok(write()?)
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
