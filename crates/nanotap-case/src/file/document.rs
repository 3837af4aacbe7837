//! A case as written: tables of keys and values with their places, from a TOML file and from
//! `key=value` overrides.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

use crate::force_table::table_of;
use crate::table::Table;

use super::json;
use super::problem::{CaseFileError, Place, Problem, Source};

/// Value of a key as written in a case file or an override.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A whole number, written without a decimal point.
    Integer(i64),
    /// A number; not always a finite one.
    Number(f64),
    /// Text: a quantity with its unit, or a name.
    Text(String),
    /// An array of rows of one length.
    Rows(Table),
    /// A type that no key accepts: a boolean, a date, another array, a table. Its name, with
    /// article.
    Other(&'static str),
}

impl Value {
    /// Name of the type, with article.
    pub const fn noun(&self) -> &'static str {
        match self {
            Self::Integer(_) | Self::Number(_) => "a number",
            Self::Text(_) => "text",
            Self::Rows(_) => "an array",
            Self::Other(noun) => noun,
        }
    }
}

/// Stands for an empty value, which removes the key.
const NOTHING: Value = Value::Other("nothing");

/// An entry `key = value` of a case file, or an override.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The table that contains it; empty at the top of a file.
    pub table: String,
    /// The key, without its table.
    pub key: String,
    /// Parsed value of the entry.
    pub value: Value,
    /// The value as written, for messages.
    pub written: String,
    /// Place of the key in the case file or override.
    pub key_place: Place,
    /// Place of the value in the case file or override.
    pub value_place: Place,
}

impl Entry {
    /// The value as text; `None` if it is neither text nor a number.
    pub fn text(&self) -> Option<String> {
        match &self.value {
            Value::Text(text) => Some(text.clone()),
            Value::Integer(integer) => Some(integer.to_string()),
            Value::Number(number) => Some(number.to_string()),
            Value::Rows(_) | Value::Other(_) => None,
        }
    }

    /// True if it removes its key.
    pub fn is_nothing(&self) -> bool {
        self.value == NOTHING
    }

    /// True if it is an override.
    pub fn is_override(&self) -> bool {
        matches!(self.key_place, Place::Override(_))
    }
}

/// The header of a table, `[name]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// The name between the brackets.
    pub name: String,
    /// Place of the name in the case file.
    pub place: Place,
}

/// Everything in a case file and its overrides, in order, before validation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    /// The file, if there is one.
    pub source: Option<Source>,
    /// Headers of the tables in the file.
    pub headers: Vec<Header>,
    /// The entries of the file, then the overrides.
    pub entries: Vec<Entry>,
    /// Table `[scan]` of the file: options of the study `scan`.
    pub scan: Option<serde_json::Map<String, serde_json::Value>>,
}

/// Table of a case file that contains options of the study of the same name.
const SCAN: &str = "scan";

/// Table inside a table: its keys are those of the outer one, with the name of the inner one before them.
const NESTED: &str = "sample.parameters";

impl Document {
    /// Reads a TOML text.
    ///
    /// # Errors
    /// If the text is not TOML; points to the place.
    pub fn parse(source: Source) -> Result<Self, CaseFileError> {
        let mut document = Self::default();
        let (table, errors) = DeTable::parse_recoverable(&source.text);
        if !errors.is_empty() {
            let problems = errors
                .iter()
                .map(|error| not_toml(error, &source.text))
                .collect();
            return Err(CaseFileError::all(Some(source), problems));
        }
        for (key, value) in table.get_ref() {
            let name: &str = key.get_ref();
            let place = Place::Span(key.span());
            if let (SCAN, DeValue::Table(inner)) = (name, value.get_ref()) {
                document.scan = Some(json::table(inner));
            } else if let DeValue::Table(inner) = value.get_ref() {
                document.headers.push(Header {
                    name: name.to_owned(),
                    place,
                });
                for (key, value) in inner {
                    let nested = match value.get_ref() {
                        DeValue::Table(nested) => Some(nested),
                        _ => None,
                    };
                    let whole = format!("{name}.{}", key.get_ref());
                    let Some(nested) = nested.filter(|_| NESTED == whole) else {
                        let entry = entry(name, key.get_ref(), key.span(), value, &source);
                        document.entries.push(entry);
                        continue;
                    };
                    for (inner, value) in nested {
                        let key = format!("{}.{}", key.get_ref(), inner.get_ref());
                        let entry = entry(name, &key, inner.span(), value, &source);
                        document.entries.push(entry);
                    }
                }
            } else {
                document
                    .entries
                    .push(entry("", name, key.span(), value, &source));
            }
        }
        // The reader hands tables out by name; people read them by place.
        document
            .entries
            .sort_by_key(|entry| entry.key_place.offset());
        document.headers.sort_by_key(|header| header.place.offset());
        document.source = Some(source);
        Ok(document)
    }

    /// Adds a `key=value` override. A key without a table belongs to `[model]`, and a value that is
    /// not TOML is text: `sample.stiffness=20 N/m`. An empty value (`sample.modulus=`) removes the
    /// key.
    ///
    /// # Errors
    /// If there is no `=` or no key.
    pub fn set(&mut self, written: &str) -> Result<(), Problem> {
        let place = Place::Override(written.to_owned());
        let shape = "write a key and a value, as in omega=2.6";
        let Some((name, value)) = written.split_once('=') else {
            return Err(Problem::new(place, "no `=` in it").help(shape));
        };
        let (name, value) = (name.trim(), value.trim());
        let (table, key) = name.split_once('.').unwrap_or(("model", name));
        if key.is_empty() || table.is_empty() {
            return Err(Problem::new(place, "no key before the `=`").help(shape));
        }
        if table.trim() == SCAN {
            let toml = |value: &str| {
                DeValue::parse(value).map_or_else(
                    |_| {
                        let number = value.parse().map(|x: f64| x.into());
                        number.unwrap_or_else(|_| value.into())
                    },
                    |value| json::json(value.get_ref()),
                )
            };
            let read = serde_json::from_str(value).unwrap_or_else(|_| toml(value));
            let options = self.scan.get_or_insert_default();
            json::put(options, key, (!value.is_empty()).then_some(read));
            return Ok(());
        }
        let read = |value: &str| {
            DeValue::parse(value).map_or_else(
                // Shorter ways to write a number than TOML's: .1, 1.
                |_| {
                    let number = value.parse().map(Value::Number);
                    number.unwrap_or_else(|_| Value::Text(value.to_owned()))
                },
                |value| judge(value.get_ref()),
            )
        };
        let parsed = if value.is_empty() {
            NOTHING
        } else {
            read(value)
        };
        self.entries.push(Entry {
            table: table.trim().to_owned(),
            key: key.trim().to_owned(),
            value: parsed,
            written: shortened(value),
            key_place: place.clone(),
            value_place: place,
        });
        Ok(())
    }
}

fn entry(
    table: &str,
    key: &str,
    key_span: Range<usize>,
    value: &toml::Spanned<DeValue<'_>>,
    source: &Source,
) -> Entry {
    Entry {
        table: table.to_owned(),
        key: key.to_owned(),
        value: judge(value.get_ref()),
        written: shortened(source.text.get(value.span()).unwrap_or_default()),
        key_place: Place::Span(key_span),
        value_place: Place::Span(value.span()),
    }
}

fn judge(value: &DeValue<'_>) -> Value {
    match value {
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
            .map_or_else(
                // Too long for a machine integer, but still a number.
                |_| Value::Number(integer.as_str().parse().unwrap_or(f64::INFINITY)),
                Value::Integer,
            ),
        DeValue::Float(float) => Value::Number(float.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::String(text) => Value::Text(text.clone().into_owned()),
        DeValue::Boolean(_) => Value::Other("a boolean"),
        DeValue::Datetime(_) => Value::Other("a date"),
        DeValue::Array(_) => table_of(value).map_or(Value::Other("an array"), Value::Rows),
        DeValue::Table(_) => Value::Other("a table"),
    }
}

/// A value shortened for use in a sentence.
fn shortened(written: &str) -> String {
    /// Most characters of a value that a message repeats.
    const LONGEST: usize = 40;
    let line = written.lines().next().unwrap_or_default();
    if line.len() == written.len() && line.chars().count() <= LONGEST {
        return written.to_owned();
    }
    let start: String = line.chars().take(LONGEST).collect();
    format!("{start}…")
}

/// The message of the TOML parser, with its place inside the text.
fn not_toml(error: &toml::de::Error, text: &str) -> Problem {
    let boundary = |offset: usize| {
        let mut offset = offset.min(text.len());
        while !text.is_char_boundary(offset) {
            offset -= 1;
        }
        offset
    };
    let place = error.span().map_or(Place::Whole, |span| {
        let start = boundary(span.start);
        Place::Span(start..boundary(span.end).max(start))
    });
    let message = error.message().trim().replace('\n', ", ");
    if message.contains("duplicate key") {
        return Problem::new(place, "duplicate key")
            .label("given a second time here")
            .help("keep one of the two");
    }
    Problem::new(place, format!("not TOML: {message}"))
        .help("a case file is lines like `omega = 2.6` under a header like `[model]`")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value_of(written: &str) -> Value {
        let mut document = Document::default();
        document.set(&format!("x={written}")).unwrap();
        document.entries.remove(0).value
    }

    #[test]
    fn set_reads_numbers_quantities_and_bare_words() {
        assert_eq!(value_of("3"), Value::Integer(3));
        assert_eq!(value_of("2.6"), Value::Number(2.6));
        assert_eq!(value_of(".1"), Value::Number(0.1));
        assert_eq!(value_of("-2."), Value::Number(-2.0));
        assert_eq!(value_of("1e999"), Value::Number(f64::INFINITY));
        assert_eq!(value_of("99999999999999999999"), Value::Number(1e20));
        assert!(matches!(value_of("nan"), Value::Number(number) if number.is_nan()));
        assert_eq!(value_of("20 N/m"), Value::Text("20 N/m".into()));
        assert_eq!(value_of("\"20 N/m\""), Value::Text("20 N/m".into()));
        assert_eq!(value_of("printed"), Value::Text("printed".into()));
        assert_eq!(value_of("true"), Value::Other("a boolean"));
        assert_eq!(value_of("[1, 2]"), Value::Other("an array"));
    }

    #[test]
    fn set_finds_the_table() {
        let mut document = Document::default();
        document.set("omega=1").unwrap();
        document.set("sample.stiffness = 20 N/m").unwrap();
        let tables: Vec<_> = document
            .entries
            .iter()
            .map(|entry| entry.table.as_str())
            .collect();
        assert_eq!(tables, ["model", "sample"]);
        for bad in ["", "omega", "=3", ".x=1", "model.=1", " = "] {
            assert!(document.set(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn every_duplicate_and_slip_is_pointed_at() {
        let source = Source {
            name: "c.toml".into(),
            text: "[model]\nomega = 1\nomega = 2\n".into(),
        };
        let error = Document::parse(source).unwrap_err();
        assert!(
            error.to_string().starts_with("c.toml:3:1: duplicate key"),
            "{error}"
        );
    }
}
