//! Tables of named columns, each with its unit, as a file or a program gives them.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value, json};

use crate::Error;

/// Most rows of a table.
pub const MAX_ROWS: usize = 1_000_000;
/// Most bytes of a file.
const MAX_BYTES: u64 = 256 << 20;

/// An entry of a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Entry {
    /// An empty field, or a number that is NaN.
    Missing,
    /// A number in the unit of the column's header.
    Number(f64),
    /// A text that is not a number.
    Text(String),
}

/// A table: columns of one length, each with its name and, in brackets, its unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Name of the table for messages, such as the path of its file.
    pub name: String,
    /// Columns: the header as it was written, and the entries.
    pub columns: Vec<(String, Vec<Entry>)>,
    /// Line of each row in its file; empty if the table was not read from a file.
    pub lines: Vec<u64>,
    /// Notes on the measurement from the file of an instrument: name and text.
    pub notes: Vec<(String, String)>,
}

impl Table {
    /// Reads an instrument's file (`.ibw`, `.jpk-force`, `.nid`) or a CSV file. Fields of a CSV
    /// file are separated by commas, semicolons or tabs, its first line names the columns, and
    /// lines that begin with `#` are skipped.
    ///
    /// # Errors
    /// When the file cannot be read or is not such a table; the message has line and column.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let name = path.display().to_string();
        let refuse = |error: std::io::Error| Error::files(format!("cannot read {name}: {error}"));
        let size = std::fs::metadata(path).map_err(refuse)?.len();
        if size > MAX_BYTES {
            return Err(Error::input(
                format!("{name} has {size} bytes; {MAX_BYTES} at most"),
                "keep fewer rows",
            ));
        }
        let bytes = std::fs::read(path).map_err(refuse)?;
        #[cfg(feature = "fit")]
        if let Some(recorded) = super::recording::parse(&name, &bytes) {
            return recorded;
        }
        let text = String::from_utf8(bytes).map_err(|_| {
            Error::input(
                format!("{name} is not a text (UTF-8)"),
                "export the curve as text, with the names of the columns in the first line",
            )
        })?;
        Self::parse(&name, &text)
    }

    /// Reads the text of such a file.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(name: &str, text: &str) -> Result<Self, Error> {
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .delimiter(delimiter(text))
            .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
        let refuse = |error: &csv::Error| {
            let line = error.position().map_or(1, csv::Position::line);
            let what = match error.kind() {
                csv::ErrorKind::UnequalLengths {
                    expected_len, len, ..
                } => format!("{len} fields where the header names {expected_len} columns"),
                _ => error.to_string(),
            };
            Error::input(
                format!("{name}, line {line}: {what}"),
                "give each row a field for every column",
            )
        };
        let header = reader.headers().map_err(|error| refuse(&error))?.clone();
        let named = header.iter().map(|word| (word.to_owned(), Vec::new()));
        let mut table = Self {
            name: name.to_owned(),
            columns: named.collect(),
            ..Self::default()
        };
        for record in reader.records() {
            let record = record.map_err(|error| refuse(&error))?;
            if table.lines.len() == MAX_ROWS {
                return Err(Error::input(
                    format!("{name} has more than {MAX_ROWS} rows"),
                    "keep fewer",
                ));
            }
            let line = record.position().map_or(0, csv::Position::line);
            table.lines.push(line);
            for ((_, column), field) in table.columns.iter_mut().zip(&record) {
                column.push(Entry::of(field));
            }
        }
        Ok(table)
    }

    /// The same table with its rows in reverse order.
    #[must_use]
    pub(crate) fn reversed(&self) -> Self {
        let mut table = self.clone();
        for (_, column) in &mut table.columns {
            column.reverse();
        }
        table.lines.reverse();
        table
    }

    /// Returns the number of rows: the length of the longest column.
    pub fn rows(&self) -> usize {
        self.columns.iter().map(|(_, c)| c.len()).max().unwrap_or(0)
    }

    /// Text for messages that names the place of an entry: table, line, column.
    pub(crate) fn place(&self, row: Option<usize>, column: usize) -> String {
        let header = self.columns.get(column).map_or("", |(header, _)| header);
        let column = column + 1;
        let line = match row {
            None => Some(1),
            Some(row) => self.lines.get(row).copied(),
        };
        match (line.filter(|_| !self.lines.is_empty()), row) {
            (Some(line), _) => format!("{}, line {line}, column {column} `{header}`", self.name),
            (None, Some(row)) => format!("{}, `{header}`, row {}", self.name, row + 1),
            (None, None) => format!("{}, `{header}`", self.name),
        }
    }
}

/// Header of a column, split into name and unit.
#[derive(Clone, Debug)]
pub(crate) struct Header {
    pub(crate) name: String,
    pub(crate) unit: String,
}

impl Header {
    pub(crate) fn of(written: &str) -> Self {
        let written = written.trim();
        let parts = [('(', ')'), ('[', ']')]
            .into_iter()
            .find_map(|(open, close)| {
                let inner = written.strip_suffix(close)?;
                let mut depth = 0;
                let (place, _) = inner.char_indices().rev().find(|(_, c)| {
                    let found = *c == open && depth == 0;
                    depth += i32::from(*c == close) - i32::from(*c == open);
                    found
                })?;
                Some((&inner[..place], &inner[place + 1..]))
            });
        let (name, unit) = parts.unwrap_or((written, ""));
        Self {
            name: name.trim().to_owned(),
            unit: unit.trim().to_owned(),
        }
    }
}

impl Entry {
    pub(crate) fn of(field: &str) -> Self {
        match field.parse::<f64>() {
            _ if field.is_empty() => Self::Missing,
            Ok(number) if number.is_nan() => Self::Missing,
            Ok(number) => Self::Number(number),
            Err(_) => Self::Text(field.to_owned()),
        }
    }
}

/// Separator of the fields: comma, semicolon or tab, whichever occurs most often in the header.
fn delimiter(text: &str) -> u8 {
    let header = text
        .lines()
        .find(|line| !line.starts_with('#') && !line.trim().is_empty());
    let count = |mark: u8| header.map_or(0, |line| line.bytes().filter(|b| *b == mark).count());
    [b'\t', b';', b',']
        .into_iter()
        .max_by_key(|mark| count(*mark))
        .unwrap_or(b',')
}

impl Serialize for Table {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let columns: Map<String, Value> = self
            .columns
            .iter()
            .map(|(header, column)| (header.clone(), json!(column)))
            .collect();
        let mut table = json!({"name": self.name, "columns": columns});
        if !self.notes.is_empty() {
            let notes = self.notes.iter();
            let notes: Map<String, Value> = notes.map(|(k, v)| (k.clone(), json!(v))).collect();
            table["notes"] = json!(notes);
        }
        table.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Table {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
    /// The last pair of brackets contains the unit, as in `Height (measured) (m)`.
        #[serde(deny_unknown_fields)]
        struct Given {
            #[serde(default)]
            name: Option<String>,
            columns: Map<String, Value>,
            #[serde(default)]
            notes: BTreeMap<String, String>,
        }
        let given = Given::deserialize(deserializer)?;
        let column = |(header, values): (String, Value)| {
            let entries = serde_json::from_value::<Vec<Entry>>(values)
                .map_err(|_| D::Error::custom(format!("{header}: a list is needed")))?;
            Ok((header, entries))
        };

    /// Whether a column with the header `written` is called `name`, with or without its unit.
    pub(crate) fn is_called(written: &str, name: &str) -> bool {
        written == name || Self::of(written).name == name
    }
        let columns = given.columns.into_iter().map(column);
        Ok(Self {
            name: given.name.unwrap_or_else(|| "data".to_owned()),
            columns: columns.collect::<Result<_, D::Error>>()?,
            lines: Vec::new(),
            notes: given.notes.into_iter().collect(),
        })
    }
}

impl JsonSchema for Table {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Table".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let column = json!({"type": "array", "items": {"type": ["number", "string", "null"]}});
        json_schema!({
            "type": "object",
            "properties": {
                "name": {"type": "string"},
                "columns": {"type": "object", "additionalProperties": column},
                "notes": {"type": "object", "additionalProperties": {"type": "string"}},
            },
            "required": ["columns"],
        })
    }
}
