//! The case file: from TOML and `key=value` words to checked values.
//!
//! A file is one of three things, never a mix. A **dimensionless cantilever** has
//! `[model]` with `modes`, `alpha1` … `alpha6` and `omega` (or their readable names); a
//! one-degree-of-freedom **oscillator** has `[model]` with `kind = "vibro_impact"` (soft
//! stop) or `kind = "impact"` (rigid stop); a **physical cantilever** has `[cantilever]`,
//! `[tip]`, `[sample]`, `[drive]` and `[gap]` with quantities in units, and in `[model]` at
//! most `modes` and `cosine_term`. The keys are those of the table in
//! [`key`](crate::case::key).
//!
//! Nothing is guessed: unknown keys, values of the wrong type or out of range, missing and repeated
//! keys are all reported at once, each with its place and a remedy. An override also replaces
//! alternatives of its key in the file.

mod document;
mod json;
mod problem;
mod reader;
mod refusal;

use std::path::Path;

pub use document::{Document, Entry, Header};
pub use problem::{CaseFileError, Place, Problem, SHOWN, Source};
pub(crate) use reader::{Described, modes, parse_with_scan, word};

use toml::de::{DeTable, DeValue};

use super::force_table::file_named;
use super::{Case, CaseKind, Kind, Value};
use crate::case::key::{Key, Takes};
use crate::input::{self, MAX_CASE_BYTES, Origin};
use crate::model::cantilever::{Cantilever, CosineTerm};
use crate::model::contact::ContactLaw;
use crate::model::drive_form::Actuation;

/// A dimensionless cantilever as a case file, every key written out.
pub fn to_toml(case: &Cantilever) -> String {
    use std::fmt::Write as _;
    let mut text = format!("[model]\nmodes = {}\n", case.modes);
    for parameter in case.parameters() {
        let (key, value) = (Key::of(parameter), case.get(parameter));
        let _ = writeln!(text, "{key} = {value:?}  # {}", key.meaning());
    }
    if case.cosine_term == CosineTerm::Printed {
        text.push_str("cosine_term = \"printed\"\n");
    }
    if case.actuation != Actuation::default() {
        let (name, meaning) = (case.actuation.name(), case.actuation.meaning());
        let _ = writeln!(text, "actuation = \"{name}\"  # {meaning}");
    }
    for (ratio, key) in case.further_tones.iter().zip(Key::TONE_RATIOS) {
        let meaning = key.meaning();
        let _ = writeln!(text, "{key} = \"{ratio}\"  # {meaning}");
    }
    if case.contact != ContactLaw::default() {
        let _ = writeln!(
            text,
            "contact = \"{}\"  # {}",
            case.contact,
            case.contact.meaning()
        );
    }
    if !case.arms.is_empty() {
        let arms = case.arms.iter();
        let arms = arms.map(|[time, stiffness]| format!(", [{time:?}, {stiffness:?}]"));
        let arms: String = arms.collect();
        let key = Key::RelaxationArms;
        let _ = writeln!(text, "{key} = [[\"time\", \"stiffness\"]{arms}]");
    }
    text
}

impl Case {
    /// The case as a file that is read back as the same case: all numbers of the equations, or the
    /// stated physical quantities with `[scan]`.
    pub fn to_toml(&self) -> String {
        use std::fmt::Write as _;
        let quantities = match &self.what {
            CaseKind::Cantilever(cantilever) => return to_toml(cantilever),
            CaseKind::Oscillator(oscillator) => {
                let mut text = format!("[model]\nkind = \"{}\"\n", self.model_kind().name());
                for (key, value) in self
                    .keys()
                    .into_iter()
                    .filter_map(|key| Some((key, oscillator.get(key.oscillator_parameter()?)?)))
                {
                    let _ = writeln!(text, "{} = {value:?}  # {}", key.name(), key.meaning());
                }
                return text;
            }
            CaseKind::Quantities(quantities) => quantities,
        };
        let mut text = String::new();
        let mut section = None;
        // Keys are sorted as in their table, section by section.
        for (key, value) in quantities.stated.iter() {
            if section != Some(key.section()) {
                section = Some(key.section());
                let gap = if text.is_empty() { "" } else { "\n" };
                let _ = writeln!(text, "{gap}[{}]", key.section().name());
            }
            let plain = matches!(
                value,
                Value::Number(_, Kind::Number) | Value::Table(_) | Value::Arms(_)
            );
            let quote = if plain { "" } else { "\"" };
            let _ = writeln!(text, "{} = {quote}{}{quote}", key.name(), value.text());
        }
        if let Some(scan) = self.scan() {
            let _ = write!(text, "\n{}", scan_table(scan));
        }
        text
    }
}

/// The table `[scan]` of a case file.
pub fn scan_table(scan: &serde_json::Map<String, serde_json::Value>) -> String {
    let lines = scan
        .iter()
        .map(|(name, value)| format!("{name} = {}\n", inline(value)));
    format!("[scan]\n{}", lines.collect::<String>())
}

/// A value of JSON on one line of TOML.
fn inline(value: &serde_json::Value) -> String {
    use serde_json::Value;
    match value {
        Value::Object(map) => {
            let entries = map
                .iter()
                .map(|(name, value)| format!("{name} = {}", inline(value)));
            format!("{{ {} }}", entries.collect::<Vec<_>>().join(", "))
        }
        Value::Array(values) => {
            let values: Vec<String> = values.iter().map(inline).collect();
            format!("[{}]", values.join(", "))
        }
        other => other.to_string(),
    }
}

/// The keys that take a table.
const TABLES: [Key; 4] = [
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
