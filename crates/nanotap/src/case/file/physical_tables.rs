//! The tables of a physical case as written, and the way into [`physical`](crate::case::physical).

use std::collections::BTreeMap;

use super::document::{Entry, Header, Value};
use super::problem::{CaseFileError, Place, Problem, Source};
use crate::case::physical::{Catalogue, PhysicalCase, PhysicalError, Resolved, Sections};
use crate::model::cantilever::CosineTerm;

/// The tables of a physical case and their keys.
pub use crate::case::physical::SECTIONS as PHYSICAL_KEYS;

/// A physical case whose keys are known and whose quantities are still text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhysicalTables {
    /// The file that the places point into.
    pub source: Option<Source>,
    /// The headers of the file.
    pub headers: Vec<Header>,
    /// `model.modes`, or the default.
    pub modes: usize,
    /// `model.cosine_term`, or the default.
    pub cosine_term: CosineTerm,
    /// The entries by table and key, those set beside the file already in place.
    pub entries: BTreeMap<(&'static str, &'static str), Entry>,
}

impl PhysicalTables {
    /// The entry `table.key`, if it was given.
    pub fn get(&self, table: &str, key: &str) -> Option<&Entry> {
        let at = |(t, k): &&(&'static str, &'static str)| *t == table && *k == key;
        self.entries
            .keys()
            .find(at)
            .and_then(|found| self.entries.get(found))
    }

    /// Sets a key to a text, as if it had been set beside the file; a key that there is not
    /// is left out.
    pub fn set(&mut self, table: &str, key: &str, text: &str) {
        let Some((table, keys)) = PHYSICAL_KEYS.iter().find(|(name, _)| *name == table) else {
            return;
        };
        let Some(key) = keys.iter().find(|name| **name == key) else {
            return;
        };
        let place = Place::Override(format!("{table}.{key}={text}"));
        let entry = Entry {
            table: (*table).to_owned(),
            key: (*key).to_owned(),
            value: Value::Text(text.to_owned()),
            written: text.to_owned(),
            key_place: place.clone(),
            value_place: place,
        };
        self.entries.insert((*table, *key), entry);
    }

    /// Takes a key out, if it is there.
    pub fn remove(&mut self, table: &str, key: &str) {
        self.entries.retain(|(t, k), _| *t != table || *k != key);
    }

    /// Reads the quantities and resolves the case.
    ///
    /// # Errors
    /// What is wrong with the quantities, pointing into the file.
    pub fn resolve(&self, catalogue: &Catalogue) -> Result<Resolved, CaseFileError> {
        PhysicalCase::from_sections(&self.sections(), self.modes, self.cosine_term, catalogue)
            .and_then(|case| case.resolve())
            .map_err(|error| CaseFileError::one(self.source.clone(), self.located(&error)))
    }

    fn sections(&self) -> Sections {
        let mut sections = Sections::new();
        for ((table, key), entry) in &self.entries {
            // What is no text was refused before.
            let Some(text) = entry.text() else { continue };
            sections
                .entry((*table).to_owned())
                .or_default()
                .insert((*key).to_owned(), text);
        }
        sections
    }

    /// The error as a problem at the value that it speaks of, or at its table.
    fn located(&self, error: &PhysicalError) -> Problem {
        let place = error.key().and_then(|path| {
            let (table, key) = path.split_once('.')?;
            let value = self.get(table, key).map(|entry| entry.value_place.clone());
            let header = || self.headers.iter().find(|header| header.name == table);
            value.or_else(|| header().map(|header| header.place.clone()))
        });
        // An override is named by its own words already.
        Problem::new(place.unwrap_or(Place::Whole), error.to_string())
    }
}
