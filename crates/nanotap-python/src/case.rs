//! The case: read, resolved, and shown.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use nanotap::case::document::{CaseDocument, MappingDocument};
use nanotap::case::file::{self, CaseFile, PHYSICAL_KEYS, Source};
use nanotap::case::physical::{Catalogue, Severity};
use nanotap::model::parameter::Parameter;
use nanotap::observe::time_series::state_names;
use nanotap::study::studied::Studied;
use pyo3::prelude::*;

use crate::failure::Failure;
use crate::watch::watched;

/// A checked case. It keeps what it was made of, text for text, so that it can be made
/// again with changes, and elsewhere.
#[pyclass(frozen, module = "nanotap._nanotap")]
pub(crate) struct CaseCore {
    studied: Arc<Studied>,
    source: Option<Source>,
    overrides: Vec<String>,
    catalogues: Vec<(String, String)>,
    at_setpoint: OnceLock<Arc<Studied>>,
}

impl CaseCore {
    /// What it describes, whether or not its distance is left to the setpoint.
    pub(crate) fn at_any_distance(&self) -> Arc<Studied> {
        Arc::clone(&self.studied)
    }

    /// What it describes; where its distance is left to the setpoint, that is solved for,
    /// once.
    pub(crate) fn studied(&self, py: Python<'_>) -> PyResult<Arc<Studied>> {
        if !self.studied.leaves_distance_to_setpoint() {
            return Ok(self.at_any_distance());
        }
        if let Some(solved) = self.at_setpoint.get() {
            return Ok(Arc::clone(solved));
        }
        let studied = Studied::clone(&self.studied);
        let done = watched(py, None, move |control| Ok(studied.at_setpoint(control)?))?;
        let solved = self.at_setpoint.get_or_init(|| Arc::new(done.result));
        Ok(Arc::clone(solved))
    }

    fn make(
        source: Option<Source>,
        overrides: Vec<String>,
        catalogues: Vec<(String, String)>,
    ) -> Result<Self, Failure> {
        let mut catalogue = Catalogue::builtin()?;
        for (origin, text) in &catalogues {
            catalogue.extend(text, origin)?;
        }
        let title = source
            .as_ref()
            .map_or_else(|| "case".to_owned(), |source| source.name.clone());
        let file = CaseFile::parse(source.clone(), &overrides)?;
        Ok(Self {
            studied: Arc::new(Studied::resolve(title, file, &catalogue)?),
            source,
            overrides,
            catalogues,
            at_setpoint: OnceLock::new(),
        })
    }
}

#[pymethods]
impl CaseCore {
    /// From the name and text of a case file, if there is one, `key=value` words beside it,
    /// and names and texts of catalogues.
    #[new]
    fn new(
        source: Option<(String, String)>,
        overrides: Vec<String>,
        catalogues: Vec<(String, String)>,
    ) -> PyResult<Self> {
        let source = source.map(|(name, text)| Source { name, text });
        Ok(Self::make(source, overrides, catalogues)?)
    }

    /// The same from paths.
    #[staticmethod]
    fn from_file(
        path: PathBuf,
        overrides: Vec<String>,
        catalogues: Vec<PathBuf>,
    ) -> PyResult<Self> {
        let source = file::read(&path).map_err(Failure::from)?;
        let catalogues = catalogues
            .iter()
            .map(|path| Ok((path.display().to_string(), text_of(path)?)))
            .collect::<Result<_, Failure>>()?;
        Ok(Self::make(Some(source), overrides, catalogues)?)
    }

    /// What it was made of.
    #[getter]
    #[expect(
        clippy::type_complexity,
        reason = "the arguments of `new`, as they are"
    )]
    fn made_of(&self) -> (Option<(String, String)>, Vec<String>, Vec<(String, String)>) {
        let source = self.source.as_ref();
        (
            source.map(|source| (source.name.clone(), source.text.clone())),
            self.overrides.clone(),
            self.catalogues.clone(),
        )
    }

    /// The document of the case, JSON.
    #[getter]
    fn document(&self) -> PyResult<String> {
        Ok(serde_json::to_string(&CaseDocument::of(&self.studied)).map_err(Failure::from)?)
    }

    /// The document of the case as it is studied, its distance solved for, JSON.
    #[getter]
    fn document_at_setpoint(&self, py: Python<'_>) -> PyResult<String> {
        let studied = self.studied(py)?;
        Ok(serde_json::to_string(&CaseDocument::of(&studied)).map_err(Failure::from)?)
    }

    /// Every distance at which an orbit has the setpoint amplitude, JSON; `None` where the
    /// distance is given.
    #[getter]
    fn setpoint(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let studied = self.studied(py)?;
        let report = studied.setpoint.as_ref().map(serde_json::to_string);
        Ok(report.transpose().map_err(Failure::from)?)
    }

    /// Of a physical case, every parameter beside its physical quantity, JSON.
    #[getter]
    fn mapping(&self) -> PyResult<String> {
        let rows: Vec<MappingDocument> = self
            .studied
            .resolved
            .iter()
            .flat_map(nanotap::case::physical::Resolved::mapping)
            .map(MappingDocument::from)
            .collect();
        Ok(serde_json::to_string(&rows).map_err(Failure::from)?)
    }

    /// Assumptions (`note`) and doubts (`warning`) about a physical case.
    #[getter]
    fn remarks(&self) -> Vec<(&'static str, String)> {
        let remarks = self.studied.resolved.iter().flat_map(|r| &r.remarks);
        remarks
            .map(|remark| {
                let severity = match remark.severity {
                    Severity::Note => "note",
                    Severity::Warning => "warning",
                };
                (severity, remark.text.clone())
            })
            .collect()
    }

    /// The dimensionless case file; `None` of an oscillator.
    #[getter]
    fn toml(&self) -> Option<String> {
        self.studied.subject.case().map(|case| file::to_toml(&case))
    }

    /// Whether its parameters were given in physical units.
    #[getter]
    fn is_physical(&self) -> bool {
        self.studied.resolved.is_some()
    }

    /// Keys, symbols and values of the parameters that can be varied.
    #[getter]
    fn parameters(&self) -> Vec<(&'static str, &'static str, f64)> {
        let subject = &self.studied.subject;
        let keys = subject.keys();
        keys.into_iter()
            .map(|key| (key.name(), key.symbol(), subject.get(key)))
            .collect()
    }

    /// The names of the entries of a state.
    #[getter]
    fn state_names(&self) -> PyResult<Vec<String>> {
        Ok(state_names(&self.studied.model().map_err(Failure::from)?))
    }
}

fn text_of(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path)
        .map_err(|error| Failure::input(format!("{}: cannot be read: {error}", path.display())))
}

/// The keys of a case file by table, each with the other names that it goes by.
#[pyfunction]
pub(crate) fn case_keys() -> Vec<(&'static str, Vec<(&'static str, &'static str)>)> {
    let model = Parameter::ALL.map(|p| (p.name(), p.alias())).to_vec();
    let physical = PHYSICAL_KEYS
        .iter()
        .map(|(table, keys)| (*table, keys.iter().map(|key| (*key, *key)).collect()));
    std::iter::once(("model", model)).chain(physical).collect()
}

/// The built-in levers and materials: kind, name, source.
#[pyfunction]
pub(crate) fn catalogue() -> PyResult<Vec<(&'static str, String, String)>> {
    let catalogue = Catalogue::builtin().map_err(Failure::from)?;
    let levers = catalogue
        .levers()
        .map(|lever| ("lever", lever.name.clone(), lever.source.clone()));
    let materials = catalogue
        .materials()
        .map(|material| ("material", material.name.clone(), material.source.clone()));
    Ok(levers.chain(materials).collect())
}
