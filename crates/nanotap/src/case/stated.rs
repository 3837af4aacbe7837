//! Stated values of a case by key, with their places.

use std::sync::Arc;

use super::file::{CaseFileError, Header, Place, Problem, Source};
use super::force_table::{ArmTable, ForceTable, ForceTableError};
use super::key::{Key, Takes};
use super::quantity::{Kind, Quantity, QuantityError};
use nanotap_volterra::VolterraError;

use crate::model::contact::ContactLaw;
use crate::model::drive_form::{FrequencyRatio, RatioError};
use crate::model::sample_law::SampleLaw;
use crate::model::words::plain;

/// A value of a key.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number in SI, or of the dimensionless model, and what it measures.
    Number(f64, Kind),
    /// One of a key's words.
    Word(&'static str),
    /// A name of the catalogue, or of nonlinear laws.
    Name(Arc<str>),
    /// A ratio of frequencies.
    Ratio(FrequencyRatio),
    /// Rows of gap and force.
    Table(ForceTable),
    /// Maxwell arms.
    Arms(ArmTable),
}

impl Value {
    /// The value as text that is read back as the same.
    pub fn text(&self) -> String {
        match self {
            Self::Number(value, kind) => kind.format_exact(*value),
            Self::Word(word) => (*word).to_owned(),
            Self::Name(name) => name.to_string(),
            Self::Ratio(ratio) => ratio.to_string(),
            Self::Table(table) => table.text(),
            Self::Arms(arms) => arms.text(),
        }
    }
}

/// Why a text is not a value of a key.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// Not the quantity that the key takes.
    #[error(transparent)]
    Quantity(#[from] QuantityError),
    /// None of the key's words.
    #[error("\"{given}\" is not one of {}", quoted(words))]
    Word {
        /// The given text.
        given: String,
        /// What could be.
        words: &'static [&'static str],
    },
    /// No ratio of frequencies.
    #[error(transparent)]
    Ratio(#[from] RatioError),
    /// No force curve.
    #[error(transparent)]
    Table(#[from] ForceTableError),
    /// No contact law.
    #[error("unknown law \"{given}\"; the laws are {}", laws().join(", "))]
    Law {
        /// The name that is none.
        given: String,
    },
}

/// The names of all laws: of linear contacts, then of nonlinear forces.
pub(crate) fn laws() -> Vec<&'static str> {
    let linear = ContactLaw::ALL.map(ContactLaw::name);
    let further = SampleLaw::all().filter(|name| !linear.contains(name));
    linear.into_iter().chain(further).collect()
}

/// A linear contact as one of its words; nonlinear laws as their names.
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

/// Words in quotes, in a row.
pub(crate) fn quoted(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
    quoted.join(", ")
}

impl Key {
    /// The value that a text says. Numbers of `[model]` have no unit, quantities have theirs.
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
            Takes::LeverName | Takes::MaterialName => Value::Name(text.into()),
            Takes::FrequencyRatio => Value::Ratio(text.parse()?),
            takes @ (Takes::Table | Takes::Arms | Takes::Springs | Takes::ModelArms) => {
                takes.parse_table(text)?
            }
        })
    }
}

/// Where and how a value was written.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Said {
    /// The name that was typed, without its table.
    pub(crate) name: String,
    /// The value as typed.
    pub(crate) written: String,
    /// Place of the key.
    pub(crate) key_place: Place,
    /// Place of the value.
    pub(crate) value_place: Place,
}

/// A value of the file that an override of another key replaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Replaced {
    /// The key of the file.
    pub(crate) key: Key,
    /// Its value, as it was written.
    pub(crate) written: String,
    /// The key that was set.
    pub(crate) by: Key,
}

/// The file that places point into, and who said what there.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Origin {
    /// The file, if there is one.
    pub(crate) source: Option<Source>,
    /// Its tables.
    pub(crate) headers: Vec<Header>,
    /// Place of each value.
    pub(crate) said: Vec<(Key, Said)>,
    /// What the file says and does not count.
    pub(crate) replaced: Vec<Replaced>,
}

/// The values that are stated, by key.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Stated {
    /// Sorted by key.
    values: Vec<(Key, Value)>,
    /// The keys whose values are no longer those that were written.
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

    /// The number of a key; of one that takes several kinds, whatever it measures.
    pub(crate) fn number(&self, key: Key) -> Option<f64> {
        match self.get(key)? {
            Value::Number(value, _) => Some(*value),
            _ => None,
        }
    }

    /// All values.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (Key, &Value)> {
        self.values.iter().map(|(key, value)| (*key, value))
    }

    /// States a value as it was written.
    pub(crate) fn put(&mut self, key: Key, value: Value) {
        match self.values.binary_search_by_key(&key, |(key, _)| *key) {
            Ok(at) => self.values[at].1 = value,
            Err(at) => self.values.insert(at, (key, value)),
        }
    }

    /// Changes a number, in place of all that says the same.
    pub(crate) fn set(&mut self, key: Key, value: f64) {
        self.set_of_kind(key, value, key.kind());
    }

    /// The same of a key that takes several kinds.
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

    /// Place of a value that is unchanged.
    pub(crate) fn said(&self, key: Key) -> Option<&Said> {
        let said = self.origin.said.iter().find(|(other, _)| *other == key);
        said.filter(|_| self.has(key) && !self.changed.contains(&key))
            .map(|(_, said)| said)
    }

    /// A value as it was written; else as numbers are shown.
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

    /// Where a complaint about a key belongs: at its value, or at its table.
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

    /// An error of one problem about a key.
    pub(crate) fn refused(&self, key: Option<Key>, message: String) -> CaseFileError {
        let place = key.map_or(Place::Whole, |key| self.place(key));
        let problem = Problem::new(place, message).key(key.map(Key::path));
        CaseFileError::one(self.origin.source.clone(), problem)
    }
}
