//! The case: read, resolved, and shown.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use nanotap::case::document::CaseDocument;
use nanotap::case::file::{self, Source};
use nanotap::case::key::{ModelKind, Section};
use nanotap::case::physical::{Catalogue, Kind, Severity};
use nanotap::case::quantity::Quantity;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::input::{self, MAX_CASE_BYTES, Origin};
use nanotap::observe::time_series::state_names;
use nanotap::study::setpoint::{SetpointReport, SolvedCase, at_setpoint, case_tables};
use pyo3::prelude::*;
use serde_json::Value;

use crate::failure::Failure;
use crate::study::table_of;
use crate::watch::watched;

/// A checked case. It keeps the texts that it was made of, so that it can be made again with
/// changes, also in another process.
#[pyclass(frozen, module = "nanotap._nanotap")]
pub(crate) struct CaseCore {
    case: Arc<Case>,
    source: Option<Source>,
    overrides: Vec<String>,
    catalogues: Vec<(String, String)>,
    /// Folder to which names of files in `[scan]` are relative.
    folder: PathBuf,
    at_setpoint: OnceLock<Solved>,
}

/// A case at its setpoint, and the result of the solution if it was solved for.
type Solved = (Arc<Case>, Option<SetpointReport>);

impl CaseCore {
    /// The case, even if its distance still has to be solved for.
    pub(crate) fn at_any_distance(&self) -> Arc<Case> {
        Arc::clone(&self.case)
    }

    /// The case; if its distance follows from the setpoint, that is solved for once.
    pub(crate) fn studied(&self, py: Python<'_>) -> PyResult<Arc<Case>> {
        Ok(Arc::clone(&self.solved(py)?.0))
    }

    /// The case as a study takes it: at any distance if the study solves for distances itself.
    pub(crate) fn studied_unless(&self, solves: bool, py: Python<'_>) -> PyResult<Arc<Case>> {
        if solves {
            return Ok(self.at_any_distance());
        }
        self.studied(py)
    }

    fn solved(&self, py: Python<'_>) -> PyResult<&Solved> {
        if let Some(solved) = self.at_setpoint.get() {
            return Ok(solved);
        }
        if !self.case.leaves_distance_to_setpoint() {
            return Ok(self
                .at_setpoint
                .get_or_init(|| (self.at_any_distance(), None)));
        }
        let case = Case::clone(&self.case);
        let done = watched(py, None, move |control| Ok(at_setpoint(case, control)?))?;
        let (case, report) = done.result;
        Ok(self.at_setpoint.get_or_init(|| (Arc::new(case), report)))
    }

    /// The case with keys that vary; one of them may be the distance.
    pub(crate) fn variants(&self, py: Python<'_>, keys: &[String]) -> PyResult<Variants> {
        let distance = [Key::GapTip, self.case.gap_key()];
        let of_distance =
            |name: &String| self.case.key(name).is_ok_and(|key| distance.contains(&key));
        let start = self.studied_unless(keys.iter().any(of_distance), py)?;
        Ok(Variants {
            case: self.at_any_distance(),
            start,
            source: self.source.clone(),
            overrides: self.overrides.clone(),
            catalogue: catalogue_of(&self.catalogues)?,
            folder: self.folder.clone(),
        })
    }

    fn with_case(&self, case: Case) -> Self {
        Self {
            case: Arc::new(case),
            source: self.source.clone(),
            overrides: self.overrides.clone(),
            catalogues: self.catalogues.clone(),
            folder: self.folder.clone(),
            at_setpoint: OnceLock::new(),
        }
    }

    fn make(
        source: Option<Source>,
        overrides: Vec<String>,
        catalogues: Vec<(String, String)>,
        folder: PathBuf,
    ) -> Result<Self, Failure> {
        let catalogue = catalogue_of(&catalogues)?;
        let case = Case::parse_with(source.clone(), &overrides, &catalogue)?;
        Ok(Self {
            case: Arc::new(case.in_folder(&folder)),
            source,
            overrides,
            catalogues,
            folder,
            at_setpoint: OnceLock::new(),
        })
    }
}

/// The built-in catalogue, extended by further ones.
fn catalogue_of(others: &[(String, String)]) -> Result<Arc<Catalogue>, Failure> {
    let mut catalogue = Catalogue::shared();
    for (origin, text) in others {
        Arc::make_mut(&mut catalogue).extend(text, origin)?;
    }
    Ok(catalogue)
}

/// A case with keys that vary, by the rule of every study: everything else stays constant, as
/// described at [`Case::held`].
pub(crate) struct Variants {
    case: Arc<Case>,
    /// The case from which numbers vary.
    start: Arc<Case>,
    source: Option<Source>,
    overrides: Vec<String>,
    catalogue: Arc<Catalogue>,
    folder: PathBuf,
}

impl Variants {
    /// The case with these `key=value` words applied.
    pub(crate) fn with(
        &self,
        words: &[String],
        control: &Control<'_>,
    ) -> Result<Case, nanotap::Error> {
        let mut stated = Vec::new();
        let mut numbers = Vec::new();
        for word in words {
            let (name, text) = word.split_once('=').unwrap_or((word, ""));
            let quoted: Option<String> = serde_json::from_str(text).ok();
            let number = self.case.key(name).ok().and_then(|key| {
                let value = self.case.value(key, quoted.as_deref().unwrap_or(text));
                Some((key, value.ok()?))
            });
            match number {
                // A new setpoint changes the distance, and a word or a table restates the case.
                Some((key, value)) if key != Key::DriveSetpoint => numbers.push((key, value)),
                _ => stated.push((name, word.clone())),
            }
        }
        let case = if stated.is_empty() {
            self.start.as_ref().clone()
        } else {
            let kept = self.overrides.iter().filter(|word| {
                let name = word.split('=').next().unwrap_or_default();
                stated.iter().all(|(other, _)| *other != name)
            });
            let words: Vec<String> = kept
                .cloned()
                .chain(stated.iter().map(|(_, word)| word.clone()))
                .collect();
            let case = Case::parse_with(self.source.clone(), &words, &self.catalogue)?;
            let case = case.in_folder(&self.folder);
            let case = case.in_model_units(self.case.is_in_model_units());
            at_setpoint(case, control)?.0
        };
        Ok(numbers
            .iter()
            .fold(case, |case, &(key, value)| case.with(key, value)))
    }

    /// The quantities that stay constant, though not stated, while keys of these names vary; in SI.
    pub(crate) fn held(&self, names: &[String]) -> nanotap::case::Held {
        let keys: Vec<Key> = names
            .iter()
            .filter_map(|name| self.case.key(name).ok())
            .collect();
        self.start.held(&keys)
    }
}

#[pymethods]
impl CaseCore {
    /// From the name and text of a case file, if there is one, `key=value` words for it, names and
    /// texts of catalogues, and the folder to which names of files in `[scan]` are relative.
    #[new]
    fn new(
        source: Option<(String, String)>,
        overrides: Vec<String>,
        catalogues: Vec<(String, String)>,
        folder: PathBuf,
    ) -> PyResult<Self> {
        let source = source.map(|(name, text)| Source { name, text });
        let overrides = file::with_tables(&overrides).map_err(Failure::from)?;
        Ok(Self::make(source, overrides, catalogues, folder)?)
    }

    /// The same with other values of `keys`, as `key=value` words, by the rule of arrays.
    fn varied(&self, py: Python<'_>, keys: Vec<String>, words: Vec<String>) -> PyResult<Self> {
        let case = self
            .variants(py, &keys)?
            .with(&words, &Control::default())
            .map_err(Failure::from)?;
        Ok(self.with_case(case))
    }

    /// The same with results in the model's units, or in SI.
    fn in_model_units(&self, model_units: bool) -> Self {
        let case = self.case.as_ref().clone();
        self.with_case(case.in_model_units(model_units))
    }

    /// Whether results of a physical case are in the model's units.
    #[getter]
    fn model_units(&self) -> bool {
        self.case.is_in_model_units()
    }

    /// What stays while keys of these names vary although it was not stated, in SI, as JSON.
    fn held(&self, py: Python<'_>, keys: Vec<String>) -> PyResult<String> {
        let held = self.variants(py, &keys)?.held(&keys);
        Ok(serde_json::to_string(&held).map_err(Failure::from)?)
    }

    /// The same from paths.
    #[staticmethod]
    fn from_file(
        path: PathBuf,
        overrides: Vec<String>,
        catalogues: Vec<PathBuf>,
    ) -> PyResult<Self> {
        let source = file::read(&path).map_err(Failure::from)?;
        let overrides = file::with_tables(&overrides).map_err(Failure::from)?;
        let catalogues = catalogues
            .iter()
            .map(|path| Ok((path.display().to_string(), text_of(path)?)))
            .collect::<Result<_, Failure>>()?;
        let folder = path.parent().unwrap_or_else(|| Path::new(""));
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        Ok(Self::make(Some(source), overrides, catalogues, folder)?)
    }

    /// The texts that it was made of.
    #[getter]
    #[expect(
        clippy::type_complexity,
        reason = "the arguments of `new`, as they are"
    )]
    fn made_of(
        &self,
    ) -> (
        Option<(String, String)>,
        Vec<String>,
        Vec<(String, String)>,
        PathBuf,
    ) {
        let source = self.source.as_ref();
        (
            source.map(|source| (source.name.clone(), source.text.clone())),
            self.overrides.clone(),
            self.catalogues.clone(),
            self.folder.clone(),
        )
    }

    /// The document of the case, JSON; where the distance is left to a setpoint, the numbers that depend
    /// on it are not those that are studied.
    #[getter]
    fn document(&self) -> PyResult<String> {
        Ok(serde_json::to_string(&CaseDocument::of(&self.case)).map_err(Failure::from)?)
    }

    /// What was stated, by `section.key`, and numbers of the equations, JSON.
    #[getter]
    fn stated(&self) -> PyResult<String> {
        Ok(serde_json::to_string(&*self.case).map_err(Failure::from)?)
    }

    /// The document of the case as it is studied, its distance solved for, JSON.
    #[getter]
    fn document_at_setpoint(&self, py: Python<'_>) -> PyResult<String> {
        let (case, report) = self.solved(py)?;
        let document = SolvedCase::of(case, report.clone());
        Ok(serde_json::to_string(&document).map_err(Failure::from)?)
    }

    /// Every distance at which an orbit has the setpoint amplitude, JSON; `None` where the
    /// distance is given.
    #[getter]
    fn setpoint(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let report = self.solved(py)?.1.as_ref().map(serde_json::to_string);
        Ok(report.transpose().map_err(Failure::from)?)
    }

    /// The tables of the case column by column, JSON, at the setpoint.
    #[getter]
    fn tables(&self, py: Python<'_>) -> PyResult<String> {
        let (case, report) = self.solved(py)?;
        let mut frames = case_tables(case);
        frames.extend(report.as_ref().map(SetpointReport::solution_table));
        let tables: Vec<Value> = frames.iter().map(table_of).collect();
        Ok(serde_json::to_string(&tables).map_err(Failure::from)?)
    }

    /// Assumptions (`note`) and warnings (`warning`) of a physical case.
    #[getter]
    fn remarks(&self) -> Vec<(&'static str, String)> {
        let remarks = self.case.remarks();
        remarks
            .into_iter()
            .map(|remark| {
                let severity = match remark.severity {
                    Severity::Note => "note",
                    Severity::Warning => "warning",
                };
                (severity, remark.text)
            })
            .collect()
    }

    /// The case file, with the distance of a setpoint; `dimensionless` with the numbers of the
    /// equations in place of physical quantities.
    fn toml(&self, py: Python<'_>, dimensionless: bool) -> PyResult<String> {
        let case = self.studied(py)?;
        let Some(numbers) = case.cantilever().filter(|_| dimensionless) else {
            return Ok(case.to_toml());
        };
        if numbers.law.is_some() {
            return Err(Failure::input(
                "a nonlinear force law has no dimensionless case file; leave dimensionless out",
            )
            .into());
        }
        Ok(file::to_toml(numbers))
    }

    /// Tables and keys of the case as it was stated, JSON.
    #[getter]
    fn inputs(&self) -> PyResult<String> {
        Ok(serde_json::to_string(&self.case.inputs()).map_err(Failure::from)?)
    }

    /// Whether its distance is left to a setpoint.
    #[getter]
    fn leaves_distance_to_setpoint(&self) -> bool {
        self.case.leaves_distance_to_setpoint()
    }

    /// Whether its parameters were given in physical units.
    #[getter]
    fn is_physical(&self) -> bool {
        self.case.is_physical()
    }

    /// Keys, symbols and values of the parameters that can be varied.
    #[getter]
    fn parameters(&self) -> Vec<(&'static str, &'static str, f64)> {
        let keys = self.case.keys();
        keys.into_iter()
            .map(|key| (key.name(), key.symbol(), self.case.get(key)))
            .collect()
    }

    /// The names of the entries of a state.
    #[getter]
    fn state_names(&self) -> PyResult<Vec<String>> {
        Ok(state_names(&self.case.model().map_err(Failure::from)?))
    }
}

/// The text of a catalogue.
fn text_of(path: &Path) -> Result<String, Failure> {
    Ok(input::text(path, MAX_CASE_BYTES, Origin::User)?)
}

/// The text of a catalogue.
#[pyfunction]
pub(crate) fn catalogue_text(path: PathBuf) -> PyResult<String> {
    Ok(text_of(&path)?)
}

/// A key of a case file: its name, its second name, and its SI unit (empty without a unit).
type KeyRow = (&'static str, &'static str, &'static str);

/// The keys of a case file by table.
#[pyfunction]
pub(crate) fn case_keys() -> Vec<(&'static str, Vec<KeyRow>)> {
    let row = |key: Key| {
        let unit = match key.kind() {
            Kind::Number => "",
            kind => kind.si_unit(),
        };
        (key.name(), key.alias().unwrap_or(key.name()), unit)
    };
    let of = |section: Section| match section {
        Section::Model => ModelKind::Cantilever.keys().map(row).collect(),
        section => section.keys().map(row).collect(),
    };
    Section::ALL
        .map(|section| (section.name(), of(section)))
        .to_vec()
}

/// A quantity of a key, given by its path, in SI; of another key a plain number.
#[pyfunction]
pub(crate) fn in_si(key: &str, text: &str) -> PyResult<f64> {
    // A parameter of a formula has the kind of its value.
    let own = text
        .parse::<Quantity>()
        .ok()
        .filter(|_| Key::is_parameter(key));
    let own = own.and_then(|read| Kind::of(read.dimension));
    let kind = Key::find(key).map(Key::kind).or(own);
    let read = kind.unwrap_or(Kind::Number).parse(text);
    Ok(read.map_err(|error| Failure::input(format!("{key}: {error}")))?)
}

/// The SI unit of a quantity; empty for a pure number.
#[pyfunction]
pub(crate) fn si_unit_of(text: &str) -> &'static str {
    let kind = text.parse::<Quantity>().ok();
    let kind = kind.and_then(|read| Kind::of(read.dimension));
    kind.and_then(Kind::dimensional).map_or("", Kind::si_unit)
}

/// A link that holds the text of a case file, to the published page or to another copy of it.
#[pyfunction]
pub(crate) fn link(case: &str, page: Option<&str>) -> String {
    nanotap_explorer::link::link(page.unwrap_or(nanotap_explorer::link::PAGE), case)
}

/// Title of the axis of a key, given by its path and symbol; the path itself if it is not a key.
#[pyfunction]
pub(crate) fn label(path: &str, symbol: &str) -> String {
    let is = |key: &Key| key.path() == path && key.symbol() == symbol;
    Key::all()
        .find(is)
        .map_or_else(|| path.to_owned(), Key::label)
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
