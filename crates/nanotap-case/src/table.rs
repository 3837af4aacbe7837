//! Tables of named columns, each with its unit, as a file or a program gives them.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::quantity::Quantity;
use super::recording::{self, Recording};
use crate::input::{self, MAX_TABLE_BYTES, Origin};
use afm_files::Document;
use nanotap_error::Error;

/// Most rows of a table.
pub const MAX_ROWS: usize = 1_000_000;
/// Most entries of a table, in all columns: 24 bytes of memory each.
const MAX_ENTRIES: usize = 16_000_000;

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
    /// What the reader of an instrument's file says of it, such as which height is the distance.
    pub remarks: Vec<String>,
}

impl Table {
    /// Reads the first curve of an instrument's file (all formats of `afm-files`) or a CSV file, in UTF-8, in
    /// UTF-16 with a byte order mark, or in Latin-1. Fields of a CSV file are separated by commas, semicolons or
    /// tabs, its first line names the columns, the next may contain their units, and lines that
    /// begin with `#` are skipped. Where commas in numbers cannot be separators, they are decimal
    /// commas, which `notes` states.
    ///
    /// # Errors
    /// When the file cannot be read or is not such a table; the message has line and column.
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::read_from(path, Origin::User, None)
    }

    /// As [`read`](Self::read), with the curve of this number, from 0, of an instrument's file.
    ///
    /// # Errors
    /// As [`read`](Self::read), and if there is no such curve.
    pub fn read_curve(path: &Path, number: usize) -> Result<Self, Error> {
        Self::read_from(path, Origin::User, Some(number))
    }

    /// As [`read`](Self::read), of a file that the user or another file names.
    pub(crate) fn read_from(
        path: &Path,
        origin: Origin,
        curve: Option<usize>,
    ) -> Result<Self, Error> {
        let name = path.display().to_string();
        Self::of_bytes(&name, input::read(path, MAX_TABLE_BYTES, origin)?, curve)
    }

    /// As [`read`](Self::read), of a file's content; of an instrument's file the curve of this number, from
    /// 0, or the first.
    ///
    /// # Errors
    /// As [`read_curve`](Self::read_curve).
    pub fn of_bytes(name: &str, bytes: Vec<u8>, curve: Option<usize>) -> Result<Self, Error> {
        if recording::is_recording(name, &bytes) {
            let recorded = recording::parse(name, bytes, curve);
            return recorded
                .map(|recorded| Self::of_recording(name, recorded))
                .map_err(|error| {
                    Error::input(
                        format!("{name}: {error}"),
                        "export the curve as text, with the names of the columns in the first line",
                    )
                });
        }
        if curve.is_some_and(|number| number > 0) {
            return Err(Error::option(
                "curve",
                format!("{name} is a table, which has no numbered curves"),
                "leave {curve} out, or fit one curve of a table with a column `curve`",
            ));
        }
        let text = text_of(bytes).ok_or_else(|| {
            Error::input(
                format!("{name} is not a text (UTF-8, UTF-16 with a byte order mark, or Latin-1)"),
                "export the curve as text, with the names of the columns in the first line",
            )
        })?;
        Self::parse(name, &text)
    }

    /// The curve of this number, from 0, of an instrument's file that is open under this name.
    ///
    /// # Errors
    /// If there is no such curve, it is damaged, or it has no complete row.
    pub fn of_document(name: &str, document: &Document, number: usize) -> Result<Self, Error> {
        let recorded = recording::of_document(document, number).map_err(|error| {
            let message = format!("{name}, curve {number}: {error}");
            Error::input(message, "`nanotap files` lists what a file holds")
        })?;
        Ok(Self::of_recording(name, recorded))
    }

    /// The table of an instrument's file.
    pub(super) fn of_recording(name: &str, recorded: Recording) -> Self {
        let column = |(header, numbers): (String, Vec<f64>)| {
            (header, numbers.into_iter().map(Entry::Number).collect())
        };
        let mut columns: Vec<_> = recorded.columns.into_iter().map(column).collect();
        if !recorded.directions.is_empty() {
            let words = recorded.directions.into_iter();
            let words = words.map(|word| Entry::Text(word.to_owned()));
            columns.push(("direction".to_owned(), words.collect()));
        }
        Self {
            name: name.to_owned(),
            columns,
            lines: Vec::new(),
            notes: recorded.notes,
            remarks: recorded.remarks,
        }
    }

    /// Reads the text of such a file.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(name: &str, text: &str) -> Result<Self, Error> {
        // The reader counts line feeds alone as lines.
        let text = &if text.contains('\r') {
            Cow::Owned(text.replace("\r\n", "\n").replace('\r', "\n"))
        } else {
            Cow::Borrowed(text)
        };
        let text = text.trim_start_matches('\u{feff}');
        let Head { separator, skipped } = Head::of(text);
        let before: usize = text.split_inclusive('\n').take(skipped).map(str::len).sum();
        let content = text.as_bytes().get(before..).unwrap_or_default();
        // A last line without an end may be cut within a number.
        let is_cut = |error: &csv::Error| {
            let at = error.position().map_or(0, |at| at.byte() as usize);
            let is_short = match error.kind() {
                csv::ErrorKind::UnequalLengths {
                    expected_len, len, ..
                } => len < expected_len,
                _ => false,
            };
            is_short && !content.get(at..).unwrap_or_default().contains(&b'\n')
        };
        let mut configured = csv::ReaderBuilder::new();
        configured
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .delimiter(separator);
        let mut reader = configured.from_reader(content);
        let refuse = |error: &csv::Error| {
            let line = error.position().map_or(1, csv::Position::line) + skipped as u64;
            let what = match error.kind() {
                csv::ErrorKind::UnequalLengths {
                    expected_len, len, ..
                } => format!("{len} fields where the header names {expected_len} columns"),
                _ => error.to_string(),
            };
            Error::input(
                format!("{name}, line {line}: {what}"),
                "give each row a field for every column, and separate columns by semicolons if \
                 numbers have decimal commas",
            )
        };
        let header = reader.headers().map_err(|error| refuse(&error))?.clone();
        if header.is_empty() {
            return Err(Error::input(
                format!("{name} is empty"),
                "give a table with the names of the columns in the first line",
            ));
        }
        if header.iter().all(|word| decimal(word).is_some()) {
            return Err(Error::input(
                format!("{name} begins with numbers, without names of columns"),
                "name the columns in the first line, each with its unit, as in `distance (nm)`",
            ));
        }
        // Two passes keep the numbers alone in memory.
        let first = reader.position().clone();
        let mut record = csv::StringRecord::new();
        let mut commas = Commas::default();
        let mut units = None;
        let mut rows = 0;
        let mut lines = Vec::new();
        let mut remarks = Vec::new();
        if skipped > 0 {
            remarks.push(format!(
                "lines before the names of the columns, left out: {skipped}"
            ));
        }
        loop {
            match reader.read_record(&mut record) {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) if is_cut(&error) => {
                    remarks.push("the last line is cut off and left out".to_owned());
                    break;
                }
                Err(error) => return Err(refuse(&error)),
            }
            if rows == 0 && is_units(&record) {
                units = Some(record.clone());
            } else {
                record.iter().for_each(|field| commas.see(field));
                // The position of the record itself is that of a comment before it.
                let end = reader.position();
                let is_ended = content[..end.byte() as usize].ends_with(b"\n");
                lines.push(end.line() - u64::from(is_ended) + skipped as u64);
            }
            rows += 1;
            if rows * header.len() > MAX_ENTRIES {
                return Err(Error::input(
                    format!("{name} has more than {MAX_ENTRIES} entries"),
                    "keep fewer columns or rows",
                ));
            }
            if rows - usize::from(units.is_some()) > MAX_ROWS {
                return Err(Error::input(
                    format!("{name} has more than {MAX_ROWS} rows"),
                    "keep fewer",
                ));
            }
        }
        let unit_of = |column: usize| units.as_ref()?.get(column).map(unit);
        let rows = rows - usize::from(units.is_some());
        let named = header.iter().enumerate().map(|(column, word)| {
            let own = Header::of(word).unit;
            let unit = unit_of(column).filter(|unit| own.is_empty() && !unit.is_empty());
            let header = unit.map_or_else(|| word.to_owned(), |unit| format!("{word} ({unit})"));
            (header, Vec::with_capacity(rows))
        });
        let mut table = Self {
            name: name.to_owned(),
            columns: named.collect(),
            lines,
            remarks,
            ..Self::default()
        };
        let has_commas = commas.are_decimal(separator);
        if has_commas {
            let note = "numbers are read with decimal commas".to_owned();
            table.notes.push((DECIMAL_COMMAS.to_owned(), note));
        }
        let rest = &content[first.byte() as usize..];
        let mut reader = configured.has_headers(false).from_reader(rest);
        for row in 0..rows + usize::from(units.is_some()) {
            reader
                .read_record(&mut record)
                .map_err(|error| refuse(&error))?;
            if row == 0 && units.is_some() {
                continue;
            }
            for ((_, column), field) in table.columns.iter_mut().zip(&record) {
                let number = decimal(field).filter(|_| has_commas && field.contains(','));
                column.push(number.map_or_else(|| Entry::of(field), Entry::Number));
            }
        }
        // A separator at the end of each line makes a column without name and content.
        let is_empty = |(header, column): &mut (String, Vec<Entry>)| {
            header.is_empty() && column.iter().all(|entry| *entry == Entry::Missing)
        };
        while table.columns.len() > 1 && table.columns.pop_if(is_empty).is_some() {}
        Ok(table)
    }

    /// The same table with its rows in reverse order.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let mut table = self.clone();
        for (_, column) in &mut table.columns {
            column.reverse();
        }
        table.lines.reverse();
        table
    }

    /// Keeps the rows, by their index, for which `keeps` is true.
    pub fn retain_rows(&mut self, keeps: impl Fn(usize) -> bool) {
        let mut row = 0..;
        self.lines.retain(|_| row.next().is_some_and(&keeps));
        for (_, column) in &mut self.columns {
            let mut row = 0..;
            column.retain(|_| row.next().is_some_and(&keeps));
        }
    }

    /// Returns the table if all columns have one length, which a program may get wrong.
    ///
    /// # Errors
    /// If two columns have different lengths, or there are more than [`MAX_ROWS`] rows.
    pub fn checked(self) -> Result<Self, Error> {
        let lengths = || self.columns.iter().map(|(header, c)| (header, c.len()));
        let mut pairs = lengths().zip(lengths().skip(1));
        if let Some(((one, rows), (other, others))) = pairs.find(|((_, a), (_, b))| a != b) {
            return Err(Error::input(
                format!(
                    "{}: column `{one}` has {rows} entries, column `{other}` has {others}",
                    self.name
                ),
                "give all columns one length, with a missing value where nothing was measured",
            ));
        }
        if self.rows() > MAX_ROWS {
            return Err(Error::input(
                format!("{} has more than {MAX_ROWS} rows", self.name),
                "keep fewer",
            ));
        }
        Ok(self)
    }

    /// Returns the number of rows: the length of the longest column.
    pub fn rows(&self) -> usize {
        self.columns.iter().map(|(_, c)| c.len()).max().unwrap_or(0)
    }

    /// Text for messages that names the place of an entry: table, line, column.
    pub fn place(&self, row: Option<usize>, column: usize) -> String {
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
pub struct Header {
    /// Name without the unit.
    pub name: String,
    /// Unit as written, empty if there is none.
    pub unit: String,
}

impl Header {
    /// The last pair of brackets contains the unit, as in `Height (measured) (m)`.
    pub fn of(written: &str) -> Self {
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

    /// Whether a column with the header `written` is called `name`, with or without its unit.
    pub fn is_called(written: &str, name: &str) -> bool {
        written == name || Self::of(written).name == name
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

/// Name of the note that numbers were read with decimal commas.
pub const DECIMAL_COMMAS: &str = "DecimalCommas";

/// The text in bytes of UTF-8, of UTF-16 with a byte order mark, or of Latin-1.
fn text_of(bytes: Vec<u8>) -> Option<String> {
    let wide = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let (pairs, rest) = bytes.as_chunks();
        let units: Vec<u16> = pairs.iter().map(|pair| unit(*pair)).collect();
        String::from_utf16(&units).ok().filter(|_| rest.is_empty())
    };
    match &bytes[..] {
        [0xff, 0xfe, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => wide(rest, u16::from_be_bytes),
        _ => String::from_utf8(bytes).map_or_else(|error| latin(error.as_bytes()), Some),
    }
}

/// The text of Latin-1, in which a byte is a character, unless some are control characters.
fn latin(bytes: &[u8]) -> Option<String> {
    let is_text = |byte: &u8| b"\t\r\n".contains(byte) || !char::from(*byte).is_control();
    let is_latin = bytes.iter().all(is_text);
    is_latin.then(|| bytes.iter().map(|byte| char::from(*byte)).collect())
}

/// The number that a field contains, with a decimal point or a decimal comma.
fn decimal(field: &str) -> Option<f64> {
    field.replacen(',', ".", 1).parse().ok()
}

/// What commas in the numbers of a table may be.
#[derive(Clone, Copy, Debug, Default)]
struct Commas {
    /// A comma that may group thousands, and one that may not.
    groups: bool,
    separates: bool,
    /// A number with a decimal point.
    has_point: bool,
}

impl Commas {
    fn see(&mut self, field: &str) {
        if field.contains(',') && decimal(field).is_some() {
            let unsigned = field.trim_start_matches(['-', '+']);
            let (whole, part) = unsigned.split_once(',').unwrap_or_default();
            let may_group =
                (1..=3).contains(&whole.len()) && !whole.starts_with('0') && part.len() == 3;
            self.groups |= may_group;
            self.separates |= !may_group;
        }
        self.has_point |=
            !self.has_point && field.contains('.') && field.replace(',', "").parse::<f64>().is_ok();
    }

    /// Whether they are decimal commas. They are not if another number has a decimal point, or if all of
    /// them may group thousands in a table whose separator is a comma.
    const fn are_decimal(self, separator: u8) -> bool {
        let is_decimal = self.separates || (self.groups && separator != b',');
        is_decimal && !self.has_point
    }
}

/// A unit in the row under the header, without brackets.
fn unit(field: &str) -> &str {
    let inner = |open, close| field.strip_prefix(open)?.strip_suffix(close);
    inner('[', ']').or(inner('(', ')')).unwrap_or(field).trim()
}

/// Whether a row contains units: no number, and at least one unit that is known.
fn is_units(row: &csv::StringRecord) -> bool {
    let is_known = |unit: &str| unit == "°" || format!("1 {unit}").parse::<Quantity>().is_ok();
    let mut fields = row.iter().map(unit).filter(|field| !field.is_empty());
    row.iter().all(|field| decimal(field).is_none()) && fields.any(is_known)
}

/// Where a text has the names of its columns, and what separates its fields.
struct Head {
    separator: u8,
    /// Lines before the names.
    skipped: usize,
}

/// Separators of fields.
const SEPARATORS: [u8; 3] = *b"\t;,";
/// Most lines before the names of the columns.
const MAX_HEAD: usize = 200;

impl Head {
    /// A file of Excel may begin with a line that states the separator, such as `sep=;`. The names are in the
    /// first line after it that is no comment, unless the lines below have another number of fields.
    fn of(text: &str) -> Self {
        let lines = text.lines().take(MAX_HEAD).enumerate();
        let mut lines = lines
            .filter(|(_, line)| !line.starts_with('#') && !line.trim().is_empty())
            .peekable();
        let stated = lines.next_if(|(_, line)| stated_separator(line).is_some());
        let skipped = stated.map_or(0, |(line, _)| line + 1);
        let stated = stated.and_then(|(_, line)| stated_separator(line));
        let lines: Vec<(usize, &str)> = lines.collect();
        // The most frequent one in the first line.
        let count = |mark: &u8| {
            let first = lines.first().map_or("", |(_, line)| line);
            first.bytes().filter(|b| b == mark).count()
        };
        let separator = stated.or_else(|| SEPARATORS.into_iter().max_by_key(count));
        let separator = separator.unwrap_or(b',');
        let possible = stated
            .as_ref()
            .map_or(&SEPARATORS[..], std::slice::from_ref);
        let names = |separator: &u8| Some((names(&lines, *separator)?, *separator));
        match possible.iter().find_map(names) {
            Some((at, separator)) if at > 0 => Self {
                separator,
                skipped: lines[at].0,
            },
            _ => Self { separator, skipped },
        }
    }
}

/// The separator that a line states for Excel.
fn stated_separator(line: &str) -> Option<u8> {
    let line = line
        .trim_start()
        .trim_end_matches([' ', '\r'])
        .trim_matches('"');
    let (word, mark) = line.split_at_checked(4)?;
    let is_one = word.eq_ignore_ascii_case("sep=") && mark.len() == 1;
    is_one.then(|| mark.as_bytes()[0])
}

/// The line, by its index, that names the columns: the first of the last lines that have one number of
/// fields. The very last may be cut.
fn names(lines: &[(usize, &str)], separator: u8) -> Option<usize> {
    let fields = |(_, line): &(usize, &str)| line.split(char::from(separator)).count();
    let whole = &lines[..lines.len().checked_sub(1)?];
    let count = fields(whole.last()?);
    let other = whole.iter().rposition(|line| fields(line) != count);
    let first = other.map_or(0, |other| other + 1);
    let mut words = lines[first].1.split(char::from(separator));
    let are_words = words.all(|word| decimal(word.trim()).is_none());
    (count > 1 && are_words).then_some(first)
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
        #[serde(deny_unknown_fields)]
        struct Given {
            #[serde(default)]
            name: Option<String>,
            columns: Map<String, Value>,
            #[serde(default)]
            lines: Vec<u64>,
            #[serde(default)]
            notes: BTreeMap<String, String>,
        }
        let given = Given::deserialize(deserializer)?;
        let column = |(header, values): (String, Value)| {
            let entries = serde_json::from_value::<Vec<Entry>>(values)
                .map_err(|_| D::Error::custom(format!("{header}: a list is needed")))?;
            Ok((header, entries))
        };
        let columns = given.columns.into_iter().map(column);
        let table = Self {
            name: given.name.unwrap_or_else(|| "data".to_owned()),
            columns: columns.collect::<Result<_, D::Error>>()?,
            lines: given.lines,
            notes: given.notes.into_iter().collect(),
            remarks: Vec::new(),
        };
        table.checked().map_err(D::Error::custom)
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
                "lines": {"type": "array", "items": {"type": "integer", "minimum": 0}},
                "notes": {"type": "object", "additionalProperties": {"type": "string"}},
            },
            "required": ["columns"],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_keep_their_lines_below_comments_and_units() {
        let text = "# made by hand\nz,d\nnm,nm\n1,2\n# a comment\n3,\n";
        let table = Table::parse("t", text).unwrap();
        assert_eq!(table.columns[0].0, "z (nm)");
        assert_eq!(table.columns[0].1, [Entry::Number(1.0), Entry::Number(3.0)]);
        assert_eq!(table.columns[1].1, [Entry::Number(2.0), Entry::Missing]);
        assert_eq!(table.lines, [4, 6]);
        let error = Table::parse("t", "z,d\n1,2\n3\n").unwrap_err();
        assert!(error.message().contains("line 3"), "{}", error.message());
    }

    #[test]
    fn what_programs_write_above_the_names_is_left_out() {
        let text = "sep=;\r\nz (nm);d (nm)\r\n1,5;2\r\n";
        let table = Table::parse("t", text).unwrap();
        assert_eq!(
            table.columns[0],
            ("z (nm)".to_owned(), vec![Entry::Number(1.5)])
        );
        assert_eq!(table.lines, [3]);
        let text = "Instrument: A, B\nDate: 1.2.2020\n\nHöhe;Kraft\nnm;nN\n1,5;2\n2,5;3\n";
        let table = Table::parse("t", text).unwrap();
        assert_eq!(table.columns[1].0, "Kraft (nN)");
        assert_eq!(table.columns[0].1, [Entry::Number(1.5), Entry::Number(2.5)]);
        assert_eq!(table.lines, [6, 7]);
        assert_eq!(table.remarks.len(), 1);
        // Words that may be of the table are kept.
        let table = Table::parse("t", "way,z\napproach,\nretract,2\n").unwrap();
        assert_eq!(table.columns[0].0, "way");
        let error = Table::parse("t", "Operator;Max\nz;d\n1;2\n3\n4;5\n").unwrap_err();
        assert!(error.message().contains("line 4"), "{}", error.message());
    }

    #[test]
    fn separators_at_the_end_of_lines_make_no_column() {
        let table = Table::parse("t", "z,d,\n1,2,\n3,4,\n").unwrap();
        assert_eq!(table.columns.len(), 2);
        assert_eq!(table.columns[1].1, [Entry::Number(2.0), Entry::Number(4.0)]);
        // With content it is a column, whose name is missing.
        let table = Table::parse("t", "z,d,\n1,2,5\n3,4,\n").unwrap();
        assert_eq!(table.columns.len(), 3);
    }

    #[test]
    fn a_last_line_that_is_cut_off_is_left_out() {
        let table = Table::parse("t", "z,d\n1,2\n3").unwrap();
        assert_eq!(table.columns[1].1, [Entry::Number(2.0)]);
        assert!(table.remarks[0].contains("cut off"), "{:?}", table.remarks);
        // A line that has its end is not cut off.
        assert!(Table::parse("t", "z,d\n1,2\n3\n").is_err());
    }

    #[test]
    fn commas_are_decimal_where_they_cannot_be_anything_else() {
        let first = |text: &str| Table::parse("t", text).unwrap().columns[0].1[0].clone();
        assert_eq!(first("z;d\n1,5;2\n"), Entry::Number(1.5));
        assert_eq!(first("z;d\n1,500;2\n"), Entry::Number(1.5));
        assert_eq!(first("z,d\n\"1,5\",2\n"), Entry::Number(1.5));
        // It may group thousands, and the separator is a comma.
        assert_eq!(first("z,d\n\"1,500\",2\n"), Entry::Text("1,500".to_owned()));
        assert_eq!(first("z;d\n1,500;2.5\n"), Entry::Text("1,500".to_owned()));
    }
}
