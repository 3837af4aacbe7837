//! The case file: from TOML and `key=value` words to checked values.
//!
//! A file is one of three things, never a mix. A **dimensionless cantilever** has
//! `[model]` with `modes`, `alpha1` … `alpha6` and `omega` (or their readable names); a
//! one-degree-of-freedom **oscillator** has `[model]` with `kind = "vibro_impact"` (soft
//! stop) or `kind = "impact"` (rigid stop); a **physical cantilever** has `[cantilever]`,
//! `[tip]`, `[sample]`, `[drive]` and `[gap]` with quantities in units, and in `[model]` at
//! most `modes` and `cosine_term`. The keys are those of the table in
//! [`key`](crate::key).
//!
//! Nothing is guessed: unknown keys, values of the wrong type or out of range, missing and repeated
//! keys are all reported at once, each with its place and a remedy. An override also replaces
//! alternatives of its key in the file.

mod document;
mod json;
mod problem;
mod reader;
mod refusal;
mod writer;

use std::path::Path;

pub use document::{Document, Entry, Header};
pub use problem::{CaseFileError, Place, Problem, SHOWN, Source};
pub(crate) use reader::{Described, modes, parse_with_scan, word};
pub use writer::{scan_table, to_toml};

use toml::de::{DeTable, DeValue};

use super::Value;
use super::force_table::file_named;
use crate::input::{self, MAX_CASE_BYTES, Origin};
use crate::key::{Key, Takes};

/// The keys that take a table.
const TABLES: [Key; 6] = [
    Key::LeverModes,
    Key::ModelLeverModes,
    Key::SampleTable,
    Key::SampleArms,
    Key::SampleRelaxationArms,
    Key::RelaxationArms,
];

/// Reads the text of a case file. A force table or Maxwell arms that it names, by a path relative to
/// the case file, become an array in the text: nothing else of a case is read from disk.
///
/// # Errors
/// If the file or its table does not exist, cannot be read or is invalid.
pub fn read(path: &Path) -> Result<Source, CaseFileError> {
    let mut source = text_of(path)?;
    for key in TABLES {
        let Some((span, name)) = table_named(key, &source.text) else {
            continue;
        };
        let folder = path.parent().unwrap_or_else(|| Path::new(""));
        let place = Place::Span(span.clone());
        let table = table(key, &folder.join(name), Origin::File, place)
            .map_err(|problem| CaseFileError::one(Some(source.clone()), problem))?;
        source.text.replace_range(span, &table.text());
    }
    Ok(source)
}

/// Replaces the name of a table in the `key=value` words of a command line by its rows.
///
/// # Errors
/// If it is not such a table.
pub fn with_tables(words: &[String]) -> Result<Vec<String>, CaseFileError> {
    let word = |word: &String| {
        let named = word.split_once('=').and_then(|(name, text)| {
            let key = Key::find(name.trim()).filter(|key| TABLES.contains(key))?;
            Some((key, text))
        });
        let quoted = |text: &str| match DeValue::parse(text.trim()).ok()?.into_inner() {
            DeValue::String(name) => Some(name.into_owned()),
            _ => None,
        };
        let text = named.map(|(_, text)| quoted(text).unwrap_or_else(|| text.to_owned()));
        let (Some((key, _)), Some(name)) = (named, text.as_deref().and_then(file_named)) else {
            return Ok(word.clone());
        };
        let place = Place::Override(word.clone());
        let table = table(key, Path::new(name), Origin::User, place);
        let table = table.map_err(|problem| CaseFileError::one(None, problem))?;
        Ok(format!("{}={}", key.path(), table.text()))
    };
    words.iter().map(word).collect()
}

/// Reads the table of a key in a file, named at `place`.
fn table(key: Key, path: &Path, origin: Origin, place: Place) -> Result<Value, Problem> {
    key.entry().takes.read_table(path, origin).map_err(|error| {
        let help = if error.remedy.is_empty() {
            match key.entry().takes {
                Takes::Arms => "name a CSV file with columns of time and modulus",
                Takes::Springs | Takes::ModelArms => {
                    "name a CSV file with columns of time and stiffness"
                }
                Takes::LeverModes => "name a CSV file with columns f (kHz), k (N/m) and Q",
                Takes::ModelLeverModes => {
                    "name a CSV file with columns of frequency, stiffness and quality"
                }
                _ => "name a CSV file with columns of gap and force",
            }
        } else {
            error.remedy.as_str()
        };
        Problem::new(place, error.to_string())
            .help(help)
            .key(Some(key.path()))
    })
}

/// The file that the text of a case names as the table of a key, and its place.
fn table_named(key: Key, text: &str) -> Option<(std::ops::Range<usize>, String)> {
    let (tables, _) = DeTable::parse_recoverable(text);
    let section = tables.get_ref().get(key.section().name())?;
    let DeValue::Table(section) = section.get_ref() else {
        return None;
    };
    let alias = || section.get(key.alias()?);
    let value = section.get(key.name()).or_else(alias)?;
    let DeValue::String(name) = value.get_ref() else {
        return None;
    };
    Some((value.span(), file_named(name)?.to_owned()))
}

fn text_of(path: &Path) -> Result<Source, CaseFileError> {
    let text = input::text(path, MAX_CASE_BYTES, Origin::User).map_err(|error| {
        let problem = Problem::new(Place::Whole, error.to_string());
        CaseFileError::one(None, problem.help("name a TOML file with a case in it"))
    })?;
    let name = path.display().to_string();
    Ok(Source { name, text })
}

#[cfg(test)]
mod tests;
