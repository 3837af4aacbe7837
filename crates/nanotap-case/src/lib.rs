//! The case: dimensionless numbers or physical quantities, read from files and overrides, and
//! mapped to the model.
//!
//! A [`Case`] has values by [`Key`]; all keys are declared in one table, which is used for parsing,
//! overrides, error messages, units, sweeps and branches.
//!
//! # What is stated, and what varies
//!
//! A value that is *stated*, in a file or by an override, replaces its alternatives
//! (`drive.amplitude` replaces `drive.free_amplitude`); everything else that was stated remains
//! valid. With a stated free amplitude, another frequency therefore means another strength of the
//! drive.
//!
//! A value that *varies* in a study ([`Case::with`]: a sweep, a branch, a window) changes alone, as
//! one control of an instrument does. Constant are the drive amplitude (the voltage of a piezo),
//! the distance of the sample, g₀, and the ratio of a second tone to the first. [`Case::held`]
//! lists these numbers; stated together with the varied value they give the same point.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

mod catalogue_levers;
pub mod document;
pub mod drive_signal;
mod error;
mod family;
pub mod file;
pub mod force_table;
mod included;
pub mod input;
pub mod key;
pub mod lever_modes;
mod moving_gap;
pub mod physical;
mod quantities;
mod recording;
pub mod schema;
pub mod state;
mod stated;
pub mod table;
pub mod under_law;
pub mod units;

use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

use nanotap_dynamics::{CancelFlag, Control};
use schemars::JsonSchema;
use serde::{Serialize, Serializer};

pub use nanotap_quantity::{self as quantity, near_name};

pub use error::{CaseError, NoSuchKey, ValueOfKeyError};
pub use family::{Family, PlaneFamily};
pub use key::Key;
pub use moving_gap::MovingGap;
pub use stated::{Value, ValueError};
pub use under_law::LawChange;

use file::{CaseFileError, Described, Source};
use key::{ModelKind, Section, plausible};
use near_name::near_name;
use physical::drive::FIRST;
use physical::{Catalogue, Kind, Physical, Remark, Scales};
use quantities::{Quantities, Slopes};
use state::WrittenState;
use stated::Replaced;
use units::Units;

use nanotap_model::cantilever::Cantilever;
use nanotap_model::drive_form::FrequencyRatio;
use nanotap_model::drive_signal::DriveSignal;
use nanotap_model::oscillator::{Oscillator, OscillatorParameter, Stop};
use nanotap_model::{Model, ModelTangent, Tangent, cantilever_model_tangent};
use nanotap_quantity::number::shortest;

/// Default number of beam modes of a case.
pub const DEFAULT_MODES: usize = 3;

/// A checked case: a cantilever, dimensionless or in physical quantities, or an oscillator.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    title: Arc<str>,
    what: CaseKind,
    /// Table `[scan]` of its file, with the words that were set in addition.
    scan: Option<Arc<serde_json::Map<String, serde_json::Value>>>,
    /// Folder to which names of files in `[scan]` are relative; `None` where files are not read.
    folder: Option<Arc<Path>>,
    /// Flag that cancels the motions of its models.
    cancel: CancelFlag,
    /// Whether results of a physical case are in the model's units.
    model_units: bool,
}

/// Kind of a case, with its data.
#[expect(clippy::large_enum_variant, reason = "cases are few")]
#[derive(Clone, Debug, PartialEq)]
enum CaseKind {
    Cantilever(Cantilever),
    Oscillator(Oscillator),
    Quantities(Box<Quantities>),
}

/// SI unit of a key of the dimensionless model.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct ParameterUnit {
    /// The quantity: "drive frequency f".
    pub quantity: &'static str,
    /// SI unit of the quantity.
    pub unit: &'static str,
    /// SI value of the number 1, in the unit `unit`.
    pub si: f64,
    /// Kind of the quantity, which determines how it is shown.
    #[serde(skip)]
    pub kind: Kind,
}

/// Keys of a physical case that stay constant while others vary, with their values in SI.
pub type Held = BTreeMap<&'static str, f64>;

impl From<Cantilever> for Case {
    fn from(cantilever: Cantilever) -> Self {
        Self::new(CaseKind::Cantilever(cantilever))
    }
}

/// Parses the text of a case file, with the built-in levers and materials.
///
/// ```
/// use nanotap::case::Case;
///
/// let case: Case = "
///     [cantilever]
///     k = '2.8 N/m'
///     f0 = '75 kHz'
///     Q = 200
///     [sample]
///     stiffness = '20 N/m'
///     [drive]
///     frequency = '75 kHz'
///     free_amplitude = '20 nm'
///     [gap]
///     tip = '10 nm'
/// ".parse()?;
/// // α4 = 3 K1/k.
/// let cantilever = case.cantilever().ok_or("a lever")?;
/// assert!((cantilever.alpha4 - 3.0 * 20.0 / 2.8).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl FromStr for Case {
    type Err = CaseFileError;

    fn from_str(text: &str) -> Result<Self, CaseFileError> {
        let source = Source {
            name: "case".to_owned(),
            text: text.to_owned(),
        };
        Self::parse(Some(source), &[])
    }
}

impl From<Oscillator> for Case {
    fn from(oscillator: Oscillator) -> Self {
        Self::new(CaseKind::Oscillator(oscillator))
    }
}

impl Case {
    fn new(what: CaseKind) -> Self {
        Self {
            title: "case".into(),
            what,
            scan: None,
            folder: None,
            cancel: CancelFlag::default(),
            model_units: false,
        }
    }

    /// Loads the case file at `path`, if given, with the `key=value` words of `overrides` and the
    /// levers and materials of `catalogue`.
    ///
    /// # Errors
    /// All problems of the file, the words and a force table that one of them names, each with its
    /// place.
    pub fn load(
        path: Option<&Path>,
        overrides: &[String],
        catalogue: &Arc<Catalogue>,
    ) -> Result<Self, CaseFileError> {
        let overrides = file::with_tables(overrides)?;
        let case = Self::parse_with(path.map(file::read).transpose()?, &overrides, catalogue)?;
        let folder = path.and_then(Path::parent).unwrap_or_else(|| Path::new(""));
        Ok(case.in_folder(folder))
    }

    /// Parses a case from a text and `key=value` words, with the built-in levers and materials.
    ///
    /// # Errors
    /// As [`load`](Self::load), without those of reading files.
    pub fn parse(source: Option<Source>, overrides: &[String]) -> Result<Self, CaseFileError> {
        Self::parse_with(source, overrides, &Catalogue::shared())
    }

    /// As [`parse`](Self::parse), with the levers and materials of `catalogue`.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_with(
        source: Option<Source>,
        overrides: &[String],
        catalogue: &Arc<Catalogue>,
    ) -> Result<Self, CaseFileError> {
        let title = source.as_ref().map(|source| source.name.clone());
        let (described, scan) = file::parse_with_scan(source, overrides)?;
        let what = match described {
            Described::Cantilever(cantilever) => CaseKind::Cantilever(cantilever),
            Described::Oscillator(oscillator) => CaseKind::Oscillator(oscillator),
            Described::Physical(stated) => {
                let catalogue = Arc::clone(catalogue);
                let quantities = Quantities::new(stated, catalogue);
                CaseKind::Quantities(Box::new(quantities.validated()?))
            }
        };
        let case = Self {
            scan: scan.map(Arc::new),
            ..Self::new(what)
        };
        Ok(match title {
            Some(title) => case.called(&title),
            None => case,
        })
    }

    /// Sets the title of the case.
    #[must_use]
    pub fn called(mut self, title: &str) -> Self {
        self.title = title.into();
        self
    }

    /// The same case, whose motions end with an error once `control` cancels the computation.
    #[must_use]
    pub fn cancelled_by(&self, control: &Control<'_>) -> Self {
        self.with_flag(control.cancel.unwrap_or(&self.cancel))
    }

    /// The same case, whose motions end with an error once `flag` is set or its budget is spent.
    #[must_use]
    pub fn with_flag(&self, flag: &CancelFlag) -> Self {
        Self {
            cancel: flag.clone(),
            ..self.clone()
        }
    }

    /// The same case, whose motions may continue for a moment after a cancellation: for reports of
    /// finished parts.
    #[must_use]
    pub fn with_grace(&self) -> Self {
        Self {
            cancel: self.cancel.with_grace(),
            ..self.clone()
        }
    }

    /// The table `[scan]` of its file, as JSON: options of the study `scan`.
    pub fn scan(&self) -> Option<&serde_json::Map<String, serde_json::Value>> {
        self.scan.as_deref()
    }

    /// The same case, read in `folder`, to which the names of files in `[scan]` are relative.
    #[must_use]
    pub fn in_folder(self, folder: &Path) -> Self {
        Self {
            folder: Some(folder.into()),
            ..self
        }
    }

    /// The name and the content, of at most `most` bytes, of a file that `[scan]` names: relative to the
    /// case file, or included in the case.
    ///
    /// # Errors
    /// When it cannot be read, or the case was not read from a file: nothing is then read from disk.
    pub fn file(&self, name: &str, most: u64) -> Result<(String, Vec<u8>), nanotap_error::Error> {
        if included::is_address(name) {
            let (name, bytes) = included::content(name).ok_or_else(|| {
                nanotap_error::Error::input(
                    "a file that is included in the case is damaged",
                    "name the file",
                )
            })?;
            return Ok((name.to_owned(), bytes));
        }
        let path = self.relative_file(name).ok_or_else(|| {
            nanotap_error::Error::input(
                format!("{name}: a case that was not read from a file cannot name other files"),
                "load the case from a file",
            )
        })?;
        let bytes = input::read(&path, most, input::Origin::File)?;
        Ok((path.display().to_string(), bytes))
    }

    /// The path of a file that `[scan]` names, if it is one on disk.
    fn relative_file(&self, name: &str) -> Option<std::path::PathBuf> {
        let folder = self.folder.as_ref()?;
        (!included::is_address(name)).then(|| folder.join(name))
    }

    /// The same case with `key=value` words that replace what it states.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn restated(&self, words: &[String]) -> Result<Self, CaseFileError> {
        let source = Source {
            name: self.title.to_string(),
            text: self.to_toml(),
        };
        let catalogue = match &self.what {
            CaseKind::Quantities(quantities) => quantities.catalogue(),
            _ => Catalogue::shared(),
        };
        let restated = Self::parse_with(Some(source), words, &catalogue)?;
        Ok(Self {
            what: restated.what,
            ..self.clone()
        })
    }

    /// A written state, if there is one, in the model's units.
    ///
    /// # Errors
    /// As [`WrittenState::read`].
    pub fn state_of(
        &self,
        written: Option<&WrittenState>,
    ) -> Result<Option<WrittenState>, nanotap_error::Error> {
        written.map(|state| state.of_case(self)).transpose()
    }

    /// Flag that cancels the motions of its models.
    pub fn cancel(&self) -> &CancelFlag {
        &self.cancel
    }

    /// Returns the title of the case, for figures and reports.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The dimensionless cantilever; `None` for an oscillator, and if the physical quantities are
    /// invalid.
    pub fn cantilever(&self) -> Option<&Cantilever> {
        match &self.what {
            CaseKind::Cantilever(cantilever) => Some(cantilever),
            CaseKind::Oscillator(_) => None,
            CaseKind::Quantities(_) => self.physical().map(|view| &view.cantilever),
        }
    }

    /// The oscillator, if the case is one.
    pub const fn oscillator(&self) -> Option<&Oscillator> {
        match &self.what {
            CaseKind::Oscillator(oscillator) => Some(oscillator),
            _ => None,
        }
    }

    /// The view in SI, for a valid physical case.
    pub fn physical(&self) -> Option<&Physical> {
        match &self.what {
            CaseKind::Quantities(quantities) => quantities.view.as_deref().ok(),
            _ => None,
        }
    }

    /// Returns true if the case was stated in physical quantities.
    pub const fn is_physical(&self) -> bool {
        matches!(self.what, CaseKind::Quantities(_))
    }

    /// Returns the assumptions made and the warnings for a physical case; empty for others.
    pub fn remarks(&self) -> Vec<Remark> {
        let (CaseKind::Quantities(quantities), Some(view)) = (&self.what, self.physical()) else {
            return Vec::new();
        };
        let mut remarks = view.remarks(quantities.reader());
        remarks.extend(quantities.notes.iter().cloned());
        remarks.extend(self.replaced());
        remarks
    }

    /// Notes about entries of the file that overrides replace.
    pub fn replaced(&self) -> Vec<Remark> {
        let CaseKind::Quantities(quantities) = &self.what else {
            return Vec::new();
        };
        let replaced = quantities.stated.origin.replaced.iter();
        let words = |Replaced { key, written, by }: &Replaced| {
            Remark::note(format!(
                "{by}, set in addition to the file, replaces its {key} = {written}"
            ))
        };
        replaced.map(words).collect()
    }

    /// Returns the keys of the numbers of the equations.
    pub fn keys(&self) -> Vec<Key> {
        match &self.what {
            CaseKind::Oscillator(oscillator) => nanotap_model::oscillator::OscillatorParameter::ALL
                .into_iter()
                .filter(|parameter| oscillator.get(*parameter).is_some())
                .map(Key::of_oscillator)
                .collect(),
            _ => self.cantilever().map_or_else(Vec::new, |cantilever| {
                cantilever.parameters().into_iter().map(Key::of).collect()
            }),
        }
    }

    /// Returns the keys of the parameters of a stated formula.
    pub fn formula_keys(&self) -> Vec<Key> {
        let CaseKind::Quantities(quantities) = &self.what else {
            return Vec::new();
        };
        let keys = quantities.stated.iter().map(|(key, _)| key);
        keys.filter(|key| key.is_of_formula()).collect()
    }

    /// The key called `name` (with or without `model.`) that can vary: a number of the equations,
    /// or a quantity of a physical case.
    ///
    /// # Errors
    /// [`NoSuchKey`] with the nearest name, or the names that may be meant.
    pub fn key(&self, name: &str) -> Result<Key, NoSuchKey> {
        let plain = name.strip_prefix("model.").unwrap_or(name);
        let keys = self.keys();
        if let Some(key) = self.model_kind().key(plain)
            && keys.contains(&key)
        {
            return Ok(key);
        }
        if self.is_physical() && name.contains('.') && plain == name {
            let mut of_formula = self.formula_keys().into_iter();
            return match Key::find(name).or_else(|| of_formula.find(|key| key.path() == name)) {
                Some(key) => key
                    .cannot_vary()
                    .map_or(Ok(key), |reason| Err(NoSuchKey::Fixed { key, reason })),
                None => Err(NoSuchKey::unknown(
                    name,
                    &Key::all()
                        .filter(|key| key.is_physical() && key.cannot_vary().is_none())
                        .collect::<Vec<_>>(),
                )),
            };
        }
        if self.is_physical() {
            let varies = |key: &Key| key.is_physical() && key.cannot_vary().is_none();
            let same = Key::all().filter(|key| varies(key) && key.name() == plain);
            let same: Vec<String> = same.map(|key| format!("`{key}`")).collect();
            if !same.is_empty() {
                return Err(NoSuchKey::Unknown {
                    given: plain.to_owned(),
                    hint: format!("did you mean {}?", same.join(" or ")),
                });
            }
            if near_name(plain, keys.iter().map(|key| key.path())).is_none() {
                return Err(NoSuchKey::Unknown {
                    given: plain.to_owned(),
                    hint: error::NAME_A_QUANTITY.to_owned(),
                });
            }
        }
        Err(NoSuchKey::unknown(plain, &keys))
    }

    fn model_kind(&self) -> ModelKind {
        match &self.what {
            CaseKind::Oscillator(oscillator) => match oscillator.stop {
                Stop::Soft { .. } => ModelKind::VibroImpact,
                Stop::Rigid { .. } => ModelKind::Impact,
            },
            _ => ModelKind::Cantilever,
        }
    }

    /// Value of a key, in SI for a physical quantity; NaN if the case does not have it.
    pub fn get(&self, key: Key) -> f64 {
        let found = match (&self.what, key.entry().means) {
            (CaseKind::Oscillator(oscillator), key::Means::Oscillator(parameter)) => {
                oscillator.get(parameter)
            }
            (CaseKind::Oscillator(_), _) => None,
            (_, key::Means::Cantilever(parameter)) => {
                self.cantilever().map(|case| case.get(parameter))
            }
            (_, _) if key == Key::Modes => self.cantilever().map(|case| case.modes as f64),
            (CaseKind::Quantities(quantities), _) => quantities.get(key),
            _ => None,
        };
        found.unwrap_or(f64::NAN)
    }

    /// Returns the stated value of a key of a physical case; `None` if it is not stated.
    pub fn stated(&self, key: Key) -> Option<&Value> {
        match &self.what {
            CaseKind::Quantities(quantities) => quantities.stated.get(key),
            _ => None,
        }
    }

    /// Returns the relative standard error of the lever's spring constant; `None` if it is not stated or
    /// zero.
    pub fn stiffness_error(&self) -> Option<f64> {
        match self.stated(Key::LeverKError)? {
            Value::Number(error, _) => Some(*error).filter(|error| *error > 0.0),
            _ => None,
        }
    }

    /// The same case with one value varied (unchanged if it does not have the key). The
    /// documentation of the module lists what stays constant; [`model`](Self::model) checks the
    /// value.
    #[must_use]
    pub fn with(&self, key: Key, value: f64) -> Self {
        let what = match (&self.what, key.entry().means) {
            (CaseKind::Cantilever(cantilever), key::Means::Cantilever(parameter)) => {
                CaseKind::Cantilever(cantilever.clone().with(parameter, value))
            }
            (CaseKind::Cantilever(cantilever), _) if key == Key::Modes => {
                CaseKind::Cantilever(cantilever.clone().with_modes(value as usize))
            }
            (CaseKind::Oscillator(oscillator), key::Means::Oscillator(parameter)) => {
                CaseKind::Oscillator(oscillator.with(parameter, value))
            }
            (CaseKind::Quantities(quantities), means) => match means {
                key::Means::Oscillator(_) => return self.clone(),
                _ => CaseKind::Quantities(Box::new(quantities.with(key, value))),
            },
            _ => return self.clone(),
        };
        Self {
            what,
            ..self.clone()
        }
    }

    /// The same case with a setpoint: a fraction of the free amplitude, or an amplitude, a peak force,
    /// a phase or a frequency shift in SI. A case without physical quantities is unchanged.
    #[must_use]
    pub fn with_setpoint(&self, value: f64, kind: Kind) -> Self {
        let CaseKind::Quantities(quantities) = &self.what else {
            return self.clone();
        };
        self.with_quantities(quantities.with_of_kind(Key::DriveSetpoint, value, kind))
    }

    /// The numbers that stay constant while `keys` vary, although they were not stated, in SI: stated
    /// together with values of the keys they give the same case. Empty if the stated values stay
    /// constant.
    pub fn held(&self, keys: &[Key]) -> Held {
        let CaseKind::Quantities(quantities) = &self.what else {
            return Held::new();
        };
        let (true, Ok(view)) = (keys.iter().any(|key| key.is_physical()), &quantities.view) else {
            return Held::new();
        };
        let replaced = |other: Key| {
            let same =
                |key: &Key| *key == other || key.alternatives().any(|(same, _)| same == other);
            // At a frequency shift the drive follows from the amplitude that is held.
            let shift = matches!(view.held, Some(physical::Held::Shift(_)));
            let follows = shift && FIRST.contains(&other);
            keys.iter().any(same) || keys.contains(&Key::DriveSetpoint) && follows
        };
        let held = view.implied_constants(&quantities.stated);
        held.iter()
            .filter(|(other, value)| {
                let same = quantities.stated.get(*other) == Some(*value);
                let said = same && quantities.stated.said(*other).is_some();
                !said && !replaced(*other)
            })
            .filter_map(|(other, _)| Some((other.path(), held.number(other)?)))
            .collect()
    }

    /// Checks that the tones of the drive repeat together.
    ///
    /// # Errors
    /// [`CaseError::Tones`] with the nearest ratio at which they do.
    pub fn repeats(&self) -> Result<(), CaseError> {
        let tones = self
            .cantilever()
            .map_or(&[][..], |case| &case.further_tones);
        for ratio in tones.iter().filter(|ratio| !ratio.repeats()) {
            FrequencyRatio::of(ratio.value())?;
        }
        Ok(())
    }

    /// Builds the model of the case.
    ///
    /// # Errors
    /// If the case is invalid or has no solution in closed form, or its tones never repeat together.
    pub fn model(&self) -> Result<Model, CaseError> {
        self.repeats()?;
        let model = match &self.what {
            CaseKind::Cantilever(cantilever) => Model::cantilever(cantilever)?,
            CaseKind::Oscillator(oscillator) => oscillator.model()?,
            CaseKind::Quantities(quantities) => {
                let view = quantities.view()?;
                let mut model = Model::cantilever(&view.cantilever)?;
                model.start = quantities.start(&model, &Units::Si(view.scales))?;
                model
            }
        };
        Ok(model.cancelled_by(&self.cancel))
    }

    /// Derivative of the map of the case with respect to a key.
    ///
    /// # Errors
    /// As [`model`](Self::model).
    pub fn tangent(&self, model: &Model, key: Key) -> Result<Tangent, CaseError> {
        if let Some((oscillator, parameter)) = self.oscillator_parameter(key) {
            return Ok(oscillator.tangent(model, parameter)?.into());
        }
        let Some(cantilever) = self.cantilever() else {
            return Ok(Tangent::zeros(model));
        };
        let (slopes, law) = self.parameters_by(key)?;
        Ok(Tangent::along(cantilever, model, &slopes, &law)?)
    }

    /// Derivative of the model of the case with respect to a key.
    ///
    /// # Errors
    /// As [`model`](Self::model).
    pub fn model_tangent(&self, model: &Model, key: Key) -> Result<ModelTangent, CaseError> {
        if let Some((oscillator, parameter)) = self.oscillator_parameter(key) {
            return Ok(oscillator.model_tangent(model, parameter)?);
        }
        let mut sum = ModelTangent::zeros(model);
        let Some(cantilever) = self.cantilever() else {
            return Ok(sum);
        };
        for (parameter, slope) in self.parameters_by(key)?.0 {
            let tangent = cantilever_model_tangent(cantilever, model, parameter)?;
            sum.add(slope, &tangent);
        }
        Ok(sum)
    }

    fn oscillator_parameter(&self, key: Key) -> Option<(&Oscillator, OscillatorParameter)> {
        match (&self.what, key.entry().means) {
            (CaseKind::Oscillator(oscillator), key::Means::Oscillator(parameter)) => {
                Some((oscillator, parameter))
            }
            _ => None,
        }
    }

    /// The parameters of the cantilever that depend on a key, with their derivatives.
    fn parameters_by(&self, key: Key) -> Result<Slopes, CaseError> {
        match (&self.what, key.entry().means) {
            (CaseKind::Oscillator(_), _) => Ok(Slopes::default()),
            (_, key::Means::Cantilever(parameter)) => Ok((vec![(parameter, 1.0)], Vec::new())),
            (CaseKind::Quantities(quantities), _) if key.is_physical() => {
                quantities.view()?;
                Ok(quantities.derivatives(key)?)
            }
            _ => Ok(Slopes::default()),
        }
    }

    /// The keys of the parameters of the cantilever that depend on a key, with their derivatives.
    ///
    /// # Errors
    /// When the case is not valid.
    pub fn numbers_by(&self, key: Key) -> Result<Vec<(Key, f64)>, CaseError> {
        let (slopes, _) = self.parameters_by(key)?;
        Ok(slopes
            .into_iter()
            .map(|(parameter, by)| (Key::of(parameter), by))
            .collect())
    }

    /// The units of the model slightly below and above the value of a key, and the distance of
    /// these values; `None` if the units do not depend on the key.
    ///
    /// # Errors
    /// When the case is not valid at a neighbouring value.
    pub fn scales_beside(&self, key: Key) -> Result<Option<(Scales, Scales, f64)>, CaseError> {
        let CaseKind::Quantities(quantities) = &self.what else {
            return Ok(None);
        };
        if !key.is_physical() {
            return Ok(None);
        }
        let (low, high, width) = quantities.bracket(key)?;
        Ok(Some((low.scales, high.scales, width)))
    }

    /// Returns the maps of the case with one free key.
    pub fn family(&self, key: Key) -> Family {
        Family {
            case: self.clone(),
            key,
        }
    }

    /// Returns the units for display: SI for a physical case, unless model units were selected.
    pub fn units(&self) -> Units {
        let view = self.physical().filter(|_| !self.model_units);
        Units::of(view.map(|view| &view.scales))
    }

    /// The same case with results, and numbers without a unit, in the model's units if `model_units`,
    /// otherwise in SI.
    #[must_use]
    pub fn in_model_units(self, model_units: bool) -> Self {
        Self {
            model_units,
            ..self
        }
    }

    /// Whether results of a physical case are in the model's units.
    pub const fn is_in_model_units(&self) -> bool {
        self.model_units
    }

    /// SI unit of a key, for a physical case.
    pub fn parameter_unit(&self, key: Key) -> Option<ParameterUnit> {
        let view = self.physical()?;
        let Some(parameter) = key.parameter() else {
            // Its values are in SI already.
            return key.is_physical().then(|| ParameterUnit {
                quantity: key.path(),
                unit: key.kind().si_unit(),
                si: 1.0,
                kind: key.kind(),
            });
        };
        if self.model_units {
            return None;
        }
        let rows = view.mapping();
        let row = rows.iter().find(|row| row.parameter == parameter)?;
        Some(ParameterUnit {
            quantity: row.quantity,
            unit: row.kind.si_unit(),
            si: view.scales.of(parameter, view.cantilever.actuation),
            kind: row.kind,
        })
    }

    /// A value of a key with ten digits; for a physical case in SI with a prefix.
    pub fn shown(&self, key: Key, value: f64) -> String {
        /// Significant digits of a value in a message or a table.
        const DIGITS: usize = 10;
        self.parameter_unit(key).map_or_else(
            || {
                let rounded = format!("{value:.*e}", DIGITS - 1);
                shortest(rounded.parse().unwrap_or(value))
            },
            |unit| unit.kind.format_digits(unit.si * value, DIGITS),
        )
    }

    /// A key with its value, as in `gap.tip = 20.32 nm`: of a physical case in SI, a number of the
    /// equations as the quantity of the case file that it represents.
    pub fn named(&self, key: Key, value: f64) -> String {
        let shown = self.shown(key, value);
        format!("{} = {shown}", self.quantity_of(key).path())
    }

    /// The quantity of the case file that a number of the equations represents in a physical case, one
    /// that has a value if there are several; any other key is its own.
    fn quantity_of(&self, key: Key) -> Key {
        let (Some(parameter), Some(unit)) = (key.parameter(), self.parameter_unit(key)) else {
            return key;
        };
        let represents = |of: &Key| {
            let feeds = of.entry().feeds.or_else(|| of.law_number());
            of.is_physical()
                && of.cannot_vary().is_none()
                && feeds == Some(parameter)
                && of.kind() == unit.kind
        };
        let all = || Key::all().filter(represents);
        let with_value = all().find(|of| self.get(*of).is_finite());
        with_value.or_else(|| all().next()).unwrap_or(key)
    }

    /// Parses a value of a key that an option implies, as `from` of an approach curve: of a
    /// physical case a number without a unit is in SI.
    ///
    /// # Errors
    /// If `text` is neither a number nor a quantity of the key's kind.
    pub fn implied_value(&self, key: Key, text: &str) -> Result<f64, ValueOfKeyError> {
        let unit = self.parameter_unit(key);
        let (kind, si) = match &unit {
            Some(unit) => (unit.kind, unit.si),
            None if key.is_physical() => (key.kind(), 1.0),
            None => {
                return text
                    .trim()
                    .parse()
                    .map_err(|_| ValueOfKeyError::NotANumber {
                        text: text.to_owned(),
                    });
            }
        };
        let value = kind
            .parse(text)
            .map_err(|error| ValueOfKeyError::Quantity {
                key: self.quantity_of(key),
                text: text.to_owned(),
                error: Box::new(error),
            })?;
        let section = match kind {
            Kind::Length if !key.is_physical() => Section::Gap,
            _ => key.section(),
        };
        match plausible::meant(key, section, kind, value) {
            Some(meant) if text.trim().parse::<f64>().is_ok() => {
                Err(ValueOfKeyError::Implausible {
                    text: text.to_owned(),
                    shown: kind.format(value),
                    meant,
                })
            }
            _ => Ok(value / si),
        }
    }

    /// Parses a value of a key: a number of the dimensionless model, or for a physical case also a
    /// quantity with its unit.
    ///
    /// # Errors
    /// If `text` is neither.
    pub fn value(&self, key: Key, text: &str) -> Result<f64, ValueOfKeyError> {
        if !key.is_physical()
            && let Ok(value) = text.trim().parse::<f64>()
        {
            return Ok(value);
        }
        self.implied_value(key, text)
    }

    /// Key of the tip–sample distance in the model's unit of length.
    pub const fn gap_key(&self) -> Key {
        match self.what {
            CaseKind::Oscillator(_) => Key::OscillatorGap,
            _ => Key::Alpha5,
        }
    }

    /// The same case with another frequency and strength of the drive, in the model's units.
    #[must_use]
    pub fn with_drive(&self, frequency: f64, strength: f64) -> Self {
        let [frequency_key, strength_key] = self.drive_keys();
        self.with(frequency_key, frequency)
            .with(strength_key, strength)
    }

    /// The same case under a signal of one shot in place of its periodic drive, at its distance;
    /// `None` for an oscillator.
    pub fn under_signal(&self, signal: &Arc<DriveSignal>) -> Option<Self> {
        let mut driven = self.clone();
        let cantilever = match &mut driven.what {
            CaseKind::Cantilever(cantilever) => cantilever,
            CaseKind::Quantities(quantities) => &mut quantities.view.as_mut().ok()?.cantilever,
            CaseKind::Oscillator(_) => return None,
        };
        cantilever.further_tones.clear();
        cantilever.signal = Some(Arc::clone(signal));
        Some(driven)
    }

    /// Keys of the frequency and strength of the drive in the model's units.
    pub const fn drive_keys(&self) -> [Key; 2] {
        match self.what {
            CaseKind::Oscillator(_) => [Key::OscillatorOmega, Key::Forcing],
            _ => [Key::Omega, Key::Alpha2],
        }
    }

    /// Drive frequency in the model's unit; NaN if the physical quantities are invalid.
    pub fn omega(&self) -> f64 {
        match &self.what {
            CaseKind::Oscillator(oscillator) => oscillator.omega,
            _ => self.cantilever().map_or(f64::NAN, |case| case.omega),
        }
    }

    /// Returns true for an oscillator with a rigid stop, whose contacts are instantaneous.
    pub fn has_rigid_stop(&self) -> bool {
        self.model_kind() == ModelKind::Impact
    }

    /// True if the distance follows from a setpoint: `drive.setpoint` without `gap.tip`.
    pub fn leaves_distance_to_setpoint(&self) -> bool {
        match &self.what {
            CaseKind::Quantities(quantities) => {
                quantities.stated.has(Key::DriveSetpoint) && !quantities.stated.has(Key::GapTip)
            }
            _ => false,
        }
    }

    /// The same case with its distance following from the setpoint, if that of `original` does.
    #[must_use]
    pub fn leaving_distance_as(self, original: &Self) -> Self {
        let (CaseKind::Quantities(quantities), Some(setpoint)) =
            (&self.what, original.stated(Key::DriveSetpoint))
        else {
            return self;
        };
        if !original.leaves_distance_to_setpoint() {
            return self;
        }
        let mut quantities = quantities.clone();
        quantities.stated.remove(Key::GapTip);
        quantities.stated.remove(Key::DriveStart);
        quantities.stated.put(Key::DriveSetpoint, setpoint.clone());
        Self {
            what: CaseKind::Quantities(Box::new(quantities.mapped(true))),
            ..self
        }
    }

    /// The same case whose motions start from `state` at drive phase 0.
    #[must_use]
    pub fn starting_from(mut self, state: &[f64]) -> Self {
        if let CaseKind::Quantities(quantities) = &mut self.what {
            quantities.put_start(state);
        }
        self
    }

    /// The same case with the tip at `distance` (m) from the sample, where its setpoint is reached,
    /// with a note. Its motions start from `state` at drive phase 0. The unit of length is
    /// unchanged; the distance of the beam is then off by less than the free amplitude. A `drive` of
    /// another frequency (Hz) and strength (N, or m of a base) takes the place of the stated one.
    ///
    /// # Errors
    /// If the quantities are invalid there.
    pub fn at_distance(
        &self,
        distance: f64,
        drive: Option<[f64; 2]>,
        note: Remark,
        state: &[f64],
    ) -> Result<Self, CaseFileError> {
        let CaseKind::Quantities(quantities) = &self.what else {
            return Ok(self.clone());
        };
        let mut quantities = quantities.clone();
        let beam = quantities.view.as_ref().map(|view| view.scales.length);
        let tip = Value::Number(distance, Kind::Length);
        quantities.stated.put(Key::GapTip, tip);
        if let Ok(beam) = beam {
            let beam = Value::Number(beam, Kind::Length);
            quantities.stated.put(Key::GapBeam, beam);
        }
        if let (Some([frequency, strength]), Some(view)) = (drive, self.physical()) {
            quantities.stated.set(Key::DriveFrequency, frequency);
            quantities.stated.set(view.strength_key(FIRST), strength);
        }
        quantities.notes.push(note);
        let mut quantities = quantities.mapped(true).validated()?;
        quantities.put_start(state);
        Ok(self.with_quantities(quantities))
    }

    /// The same case with other quantities.
    fn with_quantities(&self, quantities: Quantities) -> Self {
        Self {
            what: CaseKind::Quantities(Box::new(quantities)),
            ..self.clone()
        }
    }
}

impl Serialize for Case {
    /// The numbers of the equations by key; for a physical case also its quantities as text, by
    /// `section.key`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let quantities = match &self.what {
            CaseKind::Cantilever(cantilever) => return cantilever.serialize(serializer),
            CaseKind::Oscillator(oscillator) => return oscillator.serialize(serializer),
            CaseKind::Quantities(quantities) => quantities,
        };
        let cantilever = self.cantilever();
        quantities.document(cantilever).serialize(serializer)
    }
}

impl NoSuchKey {
    fn unknown(given: &str, keys: &[Key]) -> Self {
        let names: Vec<&'static str> = keys.iter().map(|key| key.path()).collect();
        let section = given.split_once('.').map_or("", |(section, _)| section);
        let of_section = |name: &&&str| name.split_once('.').is_some_and(|(of, _)| of == section);
        let mut listed: Vec<&str> = names.iter().filter(of_section).copied().collect();
        if listed.is_empty() {
            listed.clone_from(&names);
        }
        let hint = near_name(given, names.iter().copied()).map_or_else(
            || format!("there are {}", listed.join(", ")),
            |name| format!("did you mean `{name}`?"),
        );
        Self::Unknown {
            given: given.to_owned(),
            hint,
        }
    }
}
