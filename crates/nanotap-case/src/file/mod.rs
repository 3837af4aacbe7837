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

use std::collections::BTreeMap;
use std::path::Path;

pub use document::{Document, Entry, Header};
pub use problem::{CaseFileError, Place, Problem, SHOWN, Source};
pub(crate) use reader::{Described, modes, parse_with_scan, word};
pub use writer::{scan_table, to_toml};

use toml::de::{DeTable, DeValue};

use super::force_table::{ForceTableError, file_named};
use crate::included;
use crate::input::{self, MAX_CASE_BYTES, Origin};
use crate::key::{Key, Takes};
use crate::table::Table;
use writer::FILES;

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
    let folder = path.parent().unwrap_or_else(|| Path::new(""));
    with_rows(text_of(path)?, |name| {
        Ok(Table::read_from(&folder.join(name), Origin::File, None)?)
    })
}

/// The text of a case file with all files that it names in it, from their contents by name: tables as
/// arrays, a profile or an image as an address `data:…`.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::case::file::{Source, including};
///
/// let text = "[model]\nomega = 3.0\n[scan]\nprofile = 'step.csv'\n".to_owned();
/// let source = Source { name: "case.toml".into(), text };
/// let files = [("step.csv".to_owned(), b"0\n1e-8\n".to_vec())].into();
/// let whole = including(source, &files)?;
/// assert!(whole.text.contains("profile = \"data:;name=step.csv;base64,"));
/// # Ok::<(), nanotap::case::file::CaseFileError>(())
/// ```
///
/// # Errors
/// If a file that it names is not among these, or is not such a table.
pub fn including(
    source: Source,
    files: &BTreeMap<String, Vec<u8>>,
) -> Result<Source, CaseFileError> {
    let given = |path: &str| {
        let name = path.rsplit(['/', '\\']).next().unwrap_or(path);
        let found = files.get_key_value(name);
        found.ok_or_else(|| {
            ForceTableError::new(
                format!("the case names the file {path}"),
                format!("open {name} together with the case file"),
            )
        })
    };
    let mut source = with_rows(source, |path| {
        let (name, bytes) = given(path)?;
        Ok(Table::of_bytes(name, bytes.clone(), None)?)
    })?;
    for option in FILES {
        let named = text_at("scan", &[option], &source.text);
        let Some((span, path)) = named.filter(|(_, path)| !included::is_address(path)) else {
            continue;
        };
        let (name, bytes) = given(&path).map_err(|error| {
            let problem = Problem::new(Place::Span(span.clone()), error.to_string());
            CaseFileError::one(Some(source.clone()), problem.help(error.remedy))
        })?;
        let address = included::address(name, bytes);
        source.text.replace_range(span, &format!("\"{address}\""));
    }
    Ok(source)
}

/// The text of a case with the rows of the tables that it names.
fn with_rows(
    mut source: Source,
    read: impl Fn(&str) -> Result<Table, ForceTableError>,
) -> Result<Source, CaseFileError> {
    for key in TABLES {
        let names = [Some(key.name()), key.alias()];
        let names: Vec<&str> = names.into_iter().flatten().collect();
        let named = text_at(key.section().name(), &names, &source.text);
        let named = named.and_then(|(span, text)| Some((span, file_named(&text)?.to_owned())));
        let Some((span, name)) = named else {
            continue;
        };
        let value = read(&name).and_then(|table| key.entry().takes.of_table(&table));
        let value = value.map_err(|error| {
            let problem = refused(key, Place::Span(span.clone()), &error);
            CaseFileError::one(Some(source.clone()), problem)
        })?;
        source.text.replace_range(span, &value.text());
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
        let read = Table::read_from(Path::new(name), Origin::User, None);
        let value = read.map_err(ForceTableError::from);
        let value = value.and_then(|table| key.entry().takes.of_table(&table));
        let value = value.map_err(|error| {
            CaseFileError::one(None, refused(key, Place::Override(word.clone()), &error))
        })?;
        Ok(format!("{}={}", key.path(), value.text()))
    };
    words.iter().map(word).collect()
}

/// The problem of a table of a key, named at `place`, that cannot be read.
fn refused(key: Key, place: Place, error: &ForceTableError) -> Problem {
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
}

/// The text of the first of some keys of a section that a case file states as text, and its place.
fn text_at(section: &str, keys: &[&str], text: &str) -> Option<(std::ops::Range<usize>, String)> {
    let (tables, _) = DeTable::parse_recoverable(text);
    let DeValue::Table(section) = tables.get_ref().get(section)?.get_ref() else {
        return None;
    };
    let value = keys.iter().find_map(|key| section.get(*key))?;
    let DeValue::String(text) = value.get_ref() else {
        return None;
    };
    Some((value.span(), text.clone().into_owned()))
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
