//! The case: what a user states, in dimensionless numbers or in physical quantities, read
//! from files and words, and mapped to the model.
//!
//! A [`Case`] has values by [`Key`]; all keys stand in one table. Parsing a file, `key=value`
//! words, refusals, units, sweeps and branches go through it, and numbers stay numbers all
//! the way.
//!
//! # What is stated, and what varies
//!
//! A value that is *stated*, in a file or set beside it, stands in place of whatever says the
//! same in another way (`drive.amplitude` in place of `drive.free_amplitude`), and all that
//! else was stated still holds: with a stated free amplitude, another frequency is another
//! strength of the drive.
//!
//! A value that *varies* in a study ([`Case::with`]: a sweep, a branch, a window) is one knob
//! of one instrument, and the others stay as they are: the drive keeps its own amplitude (a
//! piezo its voltage), the sample its distance, g₀ its length, and a second tone its place
//! among the harmonics of the first. [`Case::held`] says which numbers these are. Stated
//! beside the varied value they give the same point again.

pub mod document;
mod error;
mod family;
pub mod file;
pub mod force_table;
pub mod key;
pub mod near_name;
pub mod physical;
mod quantities;
pub mod quantity;
pub mod schema;
mod stated;
pub mod table;
pub(crate) mod under_law;
pub mod units;

use std::path::Path;
use std::sync::Arc;

use nanotap_dynamics::{CancelFlag, Control};
use schemars::JsonSchema;
use serde::{Serialize, Serializer};

pub use error::{CaseError, NoSuchKey, ValueOfKeyError};
pub use family::{Family, PlaneFamily};
pub use key::Key;
pub use stated::{Value, ValueError};

use file::{CaseFileError, Described, Source};
use key::ModelKind;
use near_name::near_name;
use physical::{Catalogue, Kind, Physical, Remark, Scales};
use quantities::{Quantities, Slopes};
use stated::Replaced;
use units::Units;

use crate::model::cantilever::Cantilever;
use crate::model::oscillator::{Oscillator, OscillatorParameter, Stop};
use crate::model::{Model, ModelTangent, Tangent, cantilever_model_tangent};
use crate::number::shortest;

/// How many modes a case has that does not say.
pub const DEFAULT_MODES: usize = 3;

/// A checked case: a cantilever, dimensionless or in physical quantities, or an oscillator.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    title: Arc<str>,
    what: What,
    /// What ends the motions of its models from outside.
    cancel: CancelFlag,
}

/// The kinds of case.
#[derive(Clone, Debug, PartialEq)]
enum What {
    Cantilever(Cantilever),
    Oscillator(Oscillator),
    Quantities(Box<Quantities>),
}

/// What a key of the dimensionless model is in SI.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct ParameterUnit {
    /// The quantity: "drive frequency f".
    pub quantity: &'static str,
    /// Its SI unit.
    pub unit: &'static str,
    /// The SI value of 1.
    pub si: f64,
    /// What it measures.
    #[serde(skip)]
    pub kind: Kind,
}

impl From<Cantilever> for Case {
    fn from(cantilever: Cantilever) -> Self {
        Self::new(What::Cantilever(cantilever))
    }
}

impl From<Oscillator> for Case {
    fn from(oscillator: Oscillator) -> Self {
        Self::new(What::Oscillator(oscillator))
    }
}

impl Case {
    fn new(what: What) -> Self {
        Self {
            title: "case".into(),
            what,
            cancel: CancelFlag::default(),
        }
    }

    /// The case of the file at `path`, if one is given, with the `key=value` words of
    /// `overrides` in place of what it says; levers and materials are those of `catalogue`.
    ///
    /// # Errors
    /// Everything that is wrong with the file and the words, each with its place, and with the
    /// force curve that one of them names.
    pub fn load(
        path: Option<&Path>,
        overrides: &[String],
        catalogue: &Arc<Catalogue>,
    ) -> Result<Self, CaseFileError> {
        let overrides = file::with_tables(overrides)?;
        Self::parse_with(path.map(file::read).transpose()?, &overrides, catalogue)
    }

    /// The case of a text and of `key=value` words, with the built-in levers and materials.
    ///
    /// # Errors
    /// As [`load`](Self::load), less what can go wrong in reading.
    pub fn parse(source: Option<Source>, overrides: &[String]) -> Result<Self, CaseFileError> {
        Self::parse_with(source, overrides, &Catalogue::shared())
    }

    /// The same with levers and materials of `catalogue`.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_with(
        source: Option<Source>,
        overrides: &[String],
        catalogue: &Arc<Catalogue>,
    ) -> Result<Self, CaseFileError> {
        let title = source.as_ref().map(|source| source.name.clone());
        let what = match file::parse(source, overrides)? {
            Described::Cantilever(cantilever) => What::Cantilever(cantilever),
            Described::Oscillator(oscillator) => What::Oscillator(oscillator),
            Described::Physical(stated) => {
                let catalogue = Arc::clone(catalogue);
                let quantities = Quantities::new(stated, catalogue);
                What::Quantities(Box::new(quantities.possible()?))
            }
        };
        let case = Self::new(what);
        Ok(match title {
            Some(title) => case.called(&title),
            None => case,
        })
    }

    /// The same under another name in headings.
    #[must_use]
    pub fn called(mut self, title: &str) -> Self {
        self.title = title.into();
        self
    }

    /// The same, whose models' motions end with an error once `control` cancels the work; with a
    /// control that cannot, the same.
    #[must_use]
    pub fn cancelled_by(&self, control: &Control<'_>) -> Self {
        self.with_flag(control.cancel.unwrap_or(&self.cancel))
    }

    /// The same, whose models' motions end with an error once `flag` is set or its budget spent.
    #[must_use]
    pub(crate) fn with_flag(&self, flag: &CancelFlag) -> Self {
        Self {
            cancel: flag.clone(),
            ..self.clone()
        }
    }

    /// The same, whose models' motions may go on for a moment after the work was cancelled: for
    /// reports of what is finished.
    #[must_use]
    pub(crate) fn with_grace(&self) -> Self {
        Self {
            cancel: self.cancel.with_grace(),
            ..self.clone()
        }
    }

    /// What ends the motions of its models from outside.
    pub fn cancel(&self) -> &CancelFlag {
        &self.cancel
    }

    /// What it is called in a heading.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The dimensionless cantilever that it is; `None` of an oscillator, and where physical
    /// quantities make no sense.
    pub fn cantilever(&self) -> Option<&Cantilever> {
        match &self.what {
            What::Cantilever(cantilever) => Some(cantilever),
            What::Oscillator(_) => None,
            What::Quantities(_) => self.physical().map(|view| &view.cantilever),
        }
    }

    /// The oscillator that it is, if it is one.
    pub const fn oscillator(&self) -> Option<&Oscillator> {
        match &self.what {
            What::Oscillator(oscillator) => Some(oscillator),
            _ => None,
        }
    }

    /// What is known of it in SI, if it is a physical case and makes sense.
    pub fn physical(&self) -> Option<&Physical> {
        match &self.what {
            What::Quantities(quantities) => quantities.view.as_deref().ok(),
            _ => None,
        }
    }

    /// Whether it was stated in physical quantities.
    pub const fn is_physical(&self) -> bool {
        matches!(self.what, What::Quantities(_))
    }

    /// What had to be assumed, and what puts it in doubt.
    pub fn remarks(&self) -> Vec<Remark> {
        let (What::Quantities(quantities), Some(view)) = (&self.what, self.physical()) else {
            return Vec::new();
        };
        let mut remarks = view.remarks(quantities.reader());
        remarks.extend(quantities.notes.iter().cloned());
        remarks.extend(self.replaced());
        remarks
    }

    /// What its file says and does not count, because a key that was set beside it says the same.
    pub fn replaced(&self) -> Vec<Remark> {
        let What::Quantities(quantities) = &self.what else {
            return Vec::new();
        };
        let replaced = quantities.stated.origin.replaced.iter();
        let words = |Replaced { key, written, by }: &Replaced| {
            Remark::note(format!(
                "{by}, set beside the file, takes the place of its {key} = {written}"
            ))
        };
        replaced.map(words).collect()
    }

    /// The numbers of the equations that it has.
    pub fn keys(&self) -> Vec<Key> {
        match &self.what {
            What::Oscillator(oscillator) => crate::model::oscillator::OscillatorParameter::ALL
                .into_iter()
                .filter(|parameter| oscillator.get(*parameter).is_some())
                .map(Key::of_oscillator)
                .collect(),
            _ => self.cantilever().map_or_else(Vec::new, |cantilever| {
                cantilever.parameters().into_iter().map(Key::of).collect()
            }),
        }
    }

    /// The key that is called `name` and can vary, with or without `model.` before it: a
    /// number of the equations, or a quantity of a physical case.
    ///
    /// # Errors
    /// [`NoSuchKey`] with what there is and the nearest name.
    pub fn key(&self, name: &str) -> Result<Key, NoSuchKey> {
        let plain = name.strip_prefix("model.").unwrap_or(name);
        let keys = self.keys();
        if let Some(key) = self.model_kind().key(plain)
            && keys.contains(&key)
        {
            return Ok(key);
        }
        if self.is_physical() && name.contains('.') && plain == name {
            return match Key::find(name) {
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
        Err(NoSuchKey::unknown(plain, &keys))
    }

    fn model_kind(&self) -> ModelKind {
        match &self.what {
            What::Oscillator(oscillator) => match oscillator.stop {
                Stop::Soft { .. } => ModelKind::VibroImpact,
                Stop::Rigid { .. } => ModelKind::Impact,
            },
            _ => ModelKind::Cantilever,
        }
    }

    /// The value of a key, in SI of a physical quantity; NaN where the case does not have it.
    pub fn get(&self, key: Key) -> f64 {
        let found = match (&self.what, key.entry().means) {
            (What::Oscillator(oscillator), key::Means::Oscillator(parameter)) => {
                oscillator.get(parameter)
            }
            (What::Oscillator(_), _) => None,
            (_, key::Means::Cantilever(parameter)) => {
                self.cantilever().map(|case| case.get(parameter))
            }
            (_, _) if key == Key::Modes => self.cantilever().map(|case| case.modes as f64),
            (What::Quantities(quantities), _) => quantities.get(key),
            _ => None,
        };
        found.unwrap_or(f64::NAN)
    }

    /// What a physical case states of a key.
    pub fn stated(&self, key: Key) -> Option<&Value> {
        match &self.what {
            What::Quantities(quantities) => quantities.stated.get(key),
            _ => None,
        }
    }

    /// The same case with one value varied (unchanged where it does not have the key). What
    /// stays is said in the module's documentation; whether the value makes sense, by
    /// [`model`](Self::model).
    #[must_use]
    pub fn with(&self, key: Key, value: f64) -> Self {
        let what = match (&self.what, key.entry().means) {
            (What::Cantilever(cantilever), key::Means::Cantilever(parameter)) => {
                What::Cantilever(cantilever.clone().with(parameter, value))
            }
            (What::Cantilever(cantilever), _) if key == Key::Modes => {
                What::Cantilever(cantilever.clone().with_modes(value as usize))
            }
            (What::Oscillator(oscillator), key::Means::Oscillator(parameter)) => {
                What::Oscillator(oscillator.with(parameter, value))
            }
            (What::Quantities(quantities), means) => match means {
                key::Means::Oscillator(_) => return self.clone(),
                _ => What::Quantities(Box::new(quantities.with(key, value))),
            },
            _ => return self.clone(),
        };
        Self {
            title: Arc::clone(&self.title),
            what,
            cancel: self.cancel.clone(),
        }
    }

    /// The numbers that stay while a quantity varies though they were not stated as such:
    /// stated beside the value of `key` they give the same case again. Empty where all that
    /// was stated simply stays.
    pub fn held(&self, key: Key) -> Vec<(Key, f64)> {
        let What::Quantities(quantities) = &self.what else {
            return Vec::new();
        };
        let (true, Ok(view)) = (key.is_physical(), &quantities.view) else {
            return Vec::new();
        };
        let held = view.held(&quantities.stated);
        held.iter()
            .filter(|(other, value)| {
                let same = quantities.stated.get(*other) == Some(*value);
                let said = same && quantities.stated.said(*other).is_some();
                !said && *other != key && !key.alternatives().any(|(same, _)| same == *other)
            })
            .filter_map(|(other, _)| Some((other, held.number(other)?)))
            .collect()
    }

    /// Its model.
    ///
    /// # Errors
    /// When it makes no sense or cannot be solved in closed form.
    pub fn model(&self) -> Result<Model, CaseError> {
        let model = match &self.what {
            What::Cantilever(cantilever) => Model::cantilever(cantilever)?,
            What::Oscillator(oscillator) => oscillator.model()?,
            What::Quantities(quantities) => {
                let model = Model::cantilever(&quantities.view()?.cantilever)?;
                let start = quantities.start.as_ref();
                Model {
                    start: start.map(|state| with_modes(state, &model)),
                    ..model
                }
            }
        };
        Ok(model.cancelled_by(&self.cancel))
    }

    /// How its map changes with the value of a key.
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

    /// The derivative of its model with respect to the value of a key.
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
            (What::Oscillator(oscillator), key::Means::Oscillator(parameter)) => {
                Some((oscillator, parameter))
            }
            _ => None,
        }
    }

    /// The numbers of a cantilever's equations that change with a key, each with its derivative.
    fn parameters_by(&self, key: Key) -> Result<Slopes, CaseError> {
        match (&self.what, key.entry().means) {
            (What::Oscillator(_), _) => Ok(Slopes::default()),
            (_, key::Means::Cantilever(parameter)) => Ok((vec![(parameter, 1.0)], Vec::new())),
            (What::Quantities(quantities), _) if key.is_physical() => {
                quantities.view()?;
                Ok(quantities.derivatives(key)?)
            }
            _ => Ok(Slopes::default()),
        }
    }

    /// The keys of the numbers of a cantilever's equations that change with a key, each with its
    /// derivative.
    pub(crate) fn numbers_by(&self, key: Key) -> Result<Vec<(Key, f64)>, CaseError> {
        let (slopes, _) = self.parameters_by(key)?;
        Ok(slopes
            .into_iter()
            .map(|(parameter, by)| (Key::of(parameter), by))
            .collect())
    }

    /// The units of the model beside a value of a key, below and above it, and how far apart
    /// these values are; `None` where the units do not follow from the key.
    pub(crate) fn scales_beside(
        &self,
        key: Key,
    ) -> Result<Option<(Scales, Scales, f64)>, CaseError> {
        let What::Quantities(quantities) = &self.what else {
            return Ok(None);
        };
        if !key.is_physical() {
            return Ok(None);
        }
        let (low, high, width) = quantities.beside(key)?;
        Ok(Some((low.scales, high.scales, width)))
    }

    /// Its maps along one key.
    pub fn family(&self, key: Key) -> Family {
        Family {
            case: self.clone(),
            key,
        }
    }

    /// The units in which to show it.
    pub fn units(&self) -> Units {
        Units::of(self.physical().map(|view| &view.scales))
    }

    /// What a key is in SI, if the case is physical.
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
        let rows = view.mapping();
        let row = rows.iter().find(|row| row.parameter == parameter)?;
        Some(ParameterUnit {
            quantity: row.quantity,
            unit: row.kind.si_unit(),
            si: view.scales.of(parameter, view.cantilever.actuation),
            kind: row.kind,
        })
    }

    /// A value of a key to ten digits, of a physical case in SI with a prefix.
    pub fn shown(&self, key: Key, value: f64) -> String {
        const DIGITS: usize = 10;
        self.parameter_unit(key).map_or_else(
            || {
                let rounded = format!("{value:.*e}", DIGITS - 1);
                shortest(rounded.parse().unwrap_or(value))
            },
            |unit| unit.kind.format_digits(unit.si * value, DIGITS),
        )
    }

    /// A value of a key from text: a number of the dimensionless model, of a physical case
    /// also as a quantity with its unit.
    ///
    /// # Errors
    /// When `text` is neither.
    pub fn value(&self, key: Key, text: &str) -> Result<f64, ValueOfKeyError> {
        let of_quantity = |error| ValueOfKeyError::Quantity {
            key,
            text: text.to_owned(),
            error: Box::new(error),
        };
        if key.is_physical() {
            return key.kind().parse(text).map_err(of_quantity);
        }
        if let Ok(value) = text.trim().parse::<f64>() {
            return Ok(value);
        }
        match self.parameter_unit(key) {
            Some(unit) => unit
                .kind
                .parse(text)
                .map(|si| si / unit.si)
                .map_err(of_quantity),
            None => Err(ValueOfKeyError::NotANumber {
                text: text.to_owned(),
            }),
        }
    }

    /// The key of the distance between tip and sample, in the model's unit of length.
    pub const fn gap_key(&self) -> Key {
        match self.what {
            What::Oscillator(_) => Key::OscillatorGap,
            _ => Key::Alpha5,
        }
    }

    /// The same with another frequency and strength of the drive, as numbers of the equations.
    #[must_use]
    pub fn with_drive(&self, frequency: f64, strength: f64) -> Self {
        let [frequency_key, strength_key] = self.drive_keys();
        self.with(frequency_key, frequency)
            .with(strength_key, strength)
    }

    /// The keys of the drive's frequency and strength among the numbers of the equations.
    pub const fn drive_keys(&self) -> [Key; 2] {
        match self.what {
            What::Oscillator(_) => [Key::OscillatorOmega, Key::Forcing],
            _ => [Key::Omega, Key::Alpha2],
        }
    }

    /// Drive frequency, in the model's unit; NaN where physical quantities make no sense.
    pub fn omega(&self) -> f64 {
        match &self.what {
            What::Oscillator(oscillator) => oscillator.omega,
            _ => self.cantilever().map_or(f64::NAN, |case| case.omega),
        }
    }

    /// Whether its stop is rigid: contact is an instant there.
    pub fn has_rigid_stop(&self) -> bool {
        self.model_kind() == ModelKind::Impact
    }

    /// Whether the distance is left to a setpoint: `drive.setpoint` without `gap.tip`.
    pub fn leaves_distance_to_setpoint(&self) -> bool {
        match &self.what {
            What::Quantities(quantities) => {
                quantities.stated.has(Key::DriveSetpoint) && !quantities.stated.has(Key::GapTip)
            }
            _ => false,
        }
    }

    /// The same with its distance left to the setpoint, if `original` leaves its distance so.
    #[must_use]
    pub(crate) fn leaving_distance_as(self, original: &Self) -> Self {
        let (What::Quantities(quantities), Some(setpoint)) =
            (&self.what, original.stated(Key::DriveSetpoint))
        else {
            return self;
        };
        if !original.leaves_distance_to_setpoint() {
            return self;
        }
        let mut quantities = quantities.clone();
        quantities.stated.remove(Key::GapTip);
        quantities.stated.put(Key::DriveSetpoint, setpoint.clone());
        Self {
            what: What::Quantities(Box::new(quantities.mapped(true))),
            ..self
        }
    }

    /// The same with the tip at `distance` (in m) from the sample, where its setpoint is
    /// reached, and a note that says so. Its motions start from `state`, at drive phase 0. The
    /// unit of length stays; the beam, which moves with the tip, is out of place by less than the
    /// free amplitude.
    ///
    /// # Errors
    /// When the quantities make no sense there.
    pub fn at_distance(
        &self,
        distance: f64,
        note: Remark,
        state: Vec<f64>,
    ) -> Result<Self, CaseFileError> {
        let What::Quantities(quantities) = &self.what else {
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
        quantities.notes.push(note);
        quantities.start = Some(state);
        Ok(Self {
            title: Arc::clone(&self.title),
            what: What::Quantities(Box::new(quantities.mapped(true).possible()?)),
            cancel: self.cancel.clone(),
        })
    }
}

/// A state with as many modes as a model has: more are at rest, fewer are left out.
fn with_modes(state: &[f64], model: &Model) -> Vec<f64> {
    let dimension = model.dimension();
    let [own, wanted] = [state.len(), dimension].map(|n| n.saturating_sub(model.memory) / 2);
    let mut resized = vec![0.0; dimension];
    let shared = own.min(wanted);
    resized[..shared].copy_from_slice(&state[..shared]);
    resized[wanted..wanted + shared].copy_from_slice(&state[own..own + shared]);
    for (to, from) in resized[2 * wanted..].iter_mut().zip(&state[2 * own..]) {
        *to = *from;
    }
    resized
}

impl Serialize for Case {
    /// The numbers of the equations by key; of a physical case also its quantities as text,
    /// by `section.key`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let quantities = match &self.what {
            What::Cantilever(cantilever) => return cantilever.serialize(serializer),
            What::Oscillator(oscillator) => return oscillator.serialize(serializer),
            What::Quantities(quantities) => quantities,
        };
        let cantilever = self.cantilever();
        quantities.document(cantilever).serialize(serializer)
    }
}

impl NoSuchKey {
    fn unknown(given: &str, keys: &[Key]) -> Self {
        let names: Vec<&'static str> = keys.iter().map(|key| key.path()).collect();
        let hint = near_name(given, names.iter().copied())
            .map_or_else(String::new, |name| format!(" (did you mean `{name}`?)"));
        Self::Unknown {
            given: given.to_owned(),
            known: names.join(", "),
            hint,
        }
    }
}
