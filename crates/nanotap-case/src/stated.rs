//! Stated values of a case by key, with their places.

use std::sync::Arc;

use super::file::{CaseFileError, Header, Place, Problem, Source};
use super::force_table::{ArmTable, ForceTable, ForceTableError};
use super::key::{Key, Takes};
use super::lever_modes::LeverModes;
use super::quantity::{Kind, Quantity, QuantityError};
use super::state::WrittenState;
use nanotap_volterra::VolterraError;

use nanotap_model::contact::ContactLaw;
use nanotap_model::drive_form::{FrequencyRatio, RatioError};
use nanotap_model::sample_law::SampleLaw;
use nanotap_model::words::plain;

/// A value of a key.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number with the kind of quantity that it measures, in SI or of the dimensionless model.
    Number(f64, Kind),
    /// One of the key's words.
    Word(&'static str),
    /// A name of the catalogue, the names of nonlinear laws, or a formula.
    Name(Arc<str>),
    /// A ratio of two frequencies of the drive.
    Ratio(FrequencyRatio),
    /// Rows of gap and force.
    Table(ForceTable),
    /// Maxwell arms of a sample that relaxes.
    Arms(ArmTable),
    /// A state at drive phase 0.
    State(WrittenState),
    /// Measured modes of a lever.
    LeverModes(LeverModes),
}

impl Value {
    /// Returns the value as text that parses to the same value.
    pub fn text(&self) -> String {
        match self {
            Self::Number(value, kind) => kind.format_exact(*value),
            Self::Word(word) => (*word).to_owned(),
            Self::Name(name) => name.to_string(),
            Self::Ratio(ratio) => ratio.to_string(),
            Self::Table(table) => table.text(),
            Self::Arms(arms) => arms.text(),
            Self::State(state) => state.text(),
            Self::LeverModes(modes) => modes.text(),
        }
    }
}

/// Why a text is not a value of a key.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// The text is not the quantity that the key takes.
    #[error(transparent)]
    Quantity(#[from] QuantityError),
    /// The text is not one of the key's words.
    #[error("\"{given}\" is not one of {}", quoted(words))]
    Word {
        /// Text as given.
        given: String,
        /// Words that the key takes.
        words: &'static [&'static str],
    },
    /// The text is not a ratio of frequencies.
    #[error(transparent)]
    Ratio(#[from] RatioError),
    /// The text is not a table of the kind that the key takes.
    #[error(transparent)]
    Table(#[from] ForceTableError),
    /// The text is not a state.
    #[error(transparent)]
    State(#[from] nanotap_error::Error),
    /// The text does not name a contact law.
    #[error("unknown law \"{given}\"; the laws are {}", laws().join(", "))]
    Law {
        /// Name that is not a contact law.
        given: String,
    },
}

/// The names of all laws: of linear contacts, then of nonlinear forces.
pub(crate) fn laws() -> Vec<&'static str> {
    let linear = ContactLaw::ALL.map(ContactLaw::name);
    let further = SampleLaw::all().filter(|name| !linear.contains(name));
    linear.into_iter().chain(further).collect()
}

/// The linear contact that a text names as one of its words, or nonlinear laws by their names.
fn law(text: &str) -> Result<Value, ValueError> {
    if let Ok(law) = text.parse::<ContactLaw>() {
        return Ok(Value::Word(law.name()));
    }
    let terms = SampleLaw::terms(text).map_err(|error| ValueError::Law {
        given: match error {
            VolterraError::UnknownLaw { name } => name,
            _ => text.to_owned(),
        },
    })?;
    let names: Vec<&str> = terms.iter().map(|term| term.entry.name).collect();
    Ok(Value::Name(names.join(" + ").into()))
}

/// Words in quotes, separated by commas.
pub(crate) fn quoted(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
    quoted.join(", ")
}

impl Key {
    /// Parses a value of this key. Numbers of `[model]` have no unit; quantities have their own.
    ///
    /// # Errors
    /// [`ValueError`] with what was expected.
    pub fn read(self, text: &str) -> Result<Value, ValueError> {
        Ok(match self.entry().takes {
            Takes::Quantity(kind) => Value::Number(kind.parse(text)?, kind),
            Takes::Count(_) => Value::Number(Kind::Number.parse(text)?, Kind::Number),
            Takes::Setpoint => {
                let read = text.parse::<Quantity>().ok();
                let mut kinds =
                    [Kind::Length, Kind::Force, Kind::Angle, Kind::Frequency].into_iter();
                let is_read = |kind: &Kind| read.is_some_and(|r| r.dimension == kind.dimension());
                let kind = kinds.find(is_read).unwrap_or(Kind::Number);
                Value::Number(kind.parse(text)?, kind)
            }
            Takes::Word(words) => {
                let given = plain(text);
                let word = words.iter().find(|word| plain(word) == given);
                Value::Word(word.ok_or_else(|| ValueError::Word {
                    given: text.to_owned(),
                    words,
                })?)
            }
            Takes::Law => law(text)?,
            Takes::LeverName | Takes::MaterialName | Takes::Formula => Value::Name(text.into()),
            Takes::FrequencyRatio => Value::Ratio(text.parse()?),
            Takes::State => Value::State(WrittenState::parse(text)?),
            takes @ (Takes::Table
            | Takes::Arms
            | Takes::Springs
            | Takes::ModelArms
            | Takes::LeverModes
            | Takes::ModelLeverModes) => takes.parse_table(text)?,
        })
    }
}

/// Where and how a value was written.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Said {
    /// The name that was typed, without its table.
    pub(crate) name: String,
    /// The value as text, without any change.
    pub(crate) written: String,
    pub(crate) key_place: Place,
    pub(crate) value_place: Place,
}

/// A value of the file that an override of another key replaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Replaced {
    /// Key in the file whose value is replaced.
    pub(crate) key: Key,
    /// Value in the file, as written.
    pub(crate) written: String,
    /// Key that the override sets.
    pub(crate) by: Key,
}

/// The case file, with the places of its tables and values.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Origin {
    /// The file, if there is one.
    pub(crate) source: Option<Source>,
    /// Headers of the tables in the file.
    pub(crate) headers: Vec<Header>,
    /// Name, text and place of each value, as written.
    pub(crate) said: Vec<(Key, Said)>,
    /// Values of the file that overrides of other keys replace.
    pub(crate) replaced: Vec<Replaced>,
}

/// The values that are stated, by key.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Stated {
    /// Keys and values, sorted by key.
    values: Vec<(Key, Value)>,
    /// Keys whose values differ from those that were written.
    changed: Vec<Key>,
    pub(crate) origin: Arc<Origin>,
}

impl Stated {
    pub(crate) fn get(&self, key: Key) -> Option<&Value> {
        let at = self.values.binary_search_by_key(&key, |(key, _)| *key);
        at.ok().map(|at| &self.values[at].1)
    }

    pub(crate) fn has(&self, key: Key) -> bool {
        self.get(key).is_some()
    }

    /// The number of a key, in the unit of its kind; `None` if the value is not a number.
    pub(crate) fn number(&self, key: Key) -> Option<f64> {
        match self.get(key)? {
            Value::Number(value, _) => Some(*value),
            _ => None,
        }
    }

    /// Iterates over keys and values in the order of the keys.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (Key, &Value)> {
        self.values.iter().map(|(key, value)| (*key, value))
    }

    /// Sets a value of a key as it was written.
    pub(crate) fn put(&mut self, key: Key, value: Value) {
        match self.values.binary_search_by_key(&key, |(key, _)| *key) {
            Ok(at) => self.values[at].1 = value,
            Err(at) => self.values.insert(at, (key, value)),
        }
    }

    /// Changes the number of a key and removes the alternatives of the key.
    pub(crate) fn set(&mut self, key: Key, value: f64) {
        self.set_of_kind(key, value, key.kind());
    }

    /// As [`set`](Self::set), for a key that takes several kinds of quantities.
    pub(crate) fn set_of_kind(&mut self, key: Key, value: f64, kind: Kind) {
        for (other, _) in key.alternatives() {
            self.remove(other);
        }
        let value = Value::Number(value, kind);
        if self.get(key) == Some(&value) {
            return;
        }
        self.put(key, value);
        if !self.changed.contains(&key) {
            self.changed.push(key);
        }
    }

    pub(crate) fn remove(&mut self, key: Key) {
        self.values.retain(|(other, _)| *other != key);
    }

    /// How and where the value of a key was written; `None` if it has changed since.
    pub(crate) fn said(&self, key: Key) -> Option<&Said> {
        let said = self.origin.said.iter().find(|(other, _)| *other == key);
        said.filter(|_| self.has(key) && !self.changed.contains(&key))
            .map(|(_, said)| said)
    }

    /// The value as it was written; after a change, formatted with its unit.
    pub(crate) fn written(&self, key: Key) -> String {
        self.said(key).map_or_else(
            || match self.get(key) {
                Some(Value::Number(value, kind)) => kind.format(*value),
                Some(other) => other.text(),
                None => String::new(),
            },
            |said| said.written.clone(),
        )
    }

    /// The place to which an error about a key points: its value, an override, or its table.
    pub(crate) fn place(&self, key: Key) -> Place {
        if let Some(said) = self.said(key) {
            return said.value_place.clone();
        }
        if self.changed.contains(&key) {
            return Place::Override(format!("{key}={}", self.written(key)));
        }
        let name = key.section().name();
        let header = self.origin.headers.iter().find(|h| h.name == name);
        header.map_or(Place::Whole, |header| header.place.clone())
    }

    /// Creates an error with one problem, which concerns `key`.
    pub(crate) fn refused(&self, key: Option<Key>, message: String) -> CaseFileError {
        let place = key.map_or(Place::Whole, |key| self.place(key));
        let problem = Problem::new(place, message).key(key.map(Key::path));
        CaseFileError::one(self.origin.source.clone(), problem)
    }
}
