//! A force table as stated in a case: rows of gap and force, the first one with the units.
//!
//! In a case file it is an array, `table = [["gap (nm)", "force (nN)"], [-1, 8.5], [0, 0], [9,
//! 0]]`, or the name of a CSV file with these columns. Such a file is read relative to the case
//! file, once; the case then contains the array.

use std::path::Path;
use std::sync::Arc;

use nanotap_volterra::laws::polyline::Rows;
use toml::de::DeValue;

use super::quantity::Kind;
use crate::Error;
use crate::case::table::{Entry, Header, Table};

/// Syntax of a table, for remedies.
const SHAPE: &str = "write rows as in [[\"gap (nm)\", \"force (nN)\"], [-1, 8.5], [0, 0], [9, 0]]";

/// Why rows are not a force table.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ForceTableError {
    /// What is wrong, and where.
    pub message: String,
    /// The remedy.
    pub remedy: String,
}

impl From<Error> for ForceTableError {
    fn from(error: Error) -> Self {
        let problem = error.problems.into_iter().next();
        problem.map_or_else(
            || Self::new("no force curve", SHAPE),
            |problem| Self::new(problem.message, problem.remedy.unwrap_or_default()),
        )
    }
}

impl ForceTableError {
    fn new(message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            remedy: remedy.into(),
        }
    }
}

/// A force table: rows of gap in m and force in N.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceTable(Arc<Rows>);

impl ForceTable {
    /// The rows, in m and N.
    pub const fn rows(&self) -> &Arc<Rows> {
        &self.0
    }

    /// The table of a CSV file.
    ///
    /// # Errors
    /// If it cannot be read or is not a force table, with the place.
    pub(crate) fn read(path: &Path) -> Result<Self, ForceTableError> {
        Self::of(&Table::read(path)?)
    }

    /// Parses an array, or the text of a CSV file.
    ///
    /// # Errors
    /// As [`read`](Self::read), and if `text` names a file, which is not opened.
    pub(crate) fn parse(text: &str) -> Result<Self, ForceTableError> {
        if let Some(name) = file_named(text) {
            return Err(ForceTableError::new(
                format!("the file {name} is not opened here"),
                format!("name it in a case file or on the command line, or {SHAPE}"),
            ));
        }
        if text.trim_start().starts_with('[') {
            let array = DeValue::parse(text).ok();
            let table = array.and_then(|array| table_of(array.get_ref()));
            return Self::of(&table.ok_or_else(|| ForceTableError::new("not a table", SHAPE))?);
        }
        Self::of(&Table::parse("the table", text)?)
    }

    /// Creates a force table from the columns `gap` and `force` of a table.
    ///
    /// # Errors
    /// If they are missing, have no unit, or are not a function of the gap.
    pub(crate) fn of(table: &Table) -> Result<Self, ForceTableError> {
        let column = |names: &[&str], kind: Kind, example: &str| {
            let headers = || table.columns.iter().map(|(written, _)| Header::of(written));
            let is = |header: &Header| names.contains(&header.name.to_lowercase().as_str());
            let all: Vec<usize> = headers()
                .enumerate()
                .filter_map(|(k, header)| is(&header).then_some(k))
                .collect();
            let &[place] = all.as_slice() else {
                let found: Vec<&str> = table.columns.iter().map(|(name, _)| &**name).collect();
                let has = if found.is_empty() {
                    "none at all".to_owned()
                } else {
                    found.join(", ")
                };
                let what = if all.is_empty() {
                    "no"
                } else {
                    "more than one"
                };
                return Err(ForceTableError::new(
                    format!(
                        "{} has {what} column `{}`: it has {has}",
                        table.name, names[0],
                    ),
                    format!("name it as in `{example}`"),
                ));
            };
            let refuse = |row, what: String, remedy: String| {
                ForceTableError::new(format!("{}: {what}", table.place(row, place)), remedy)
            };
            let (written, entries) = &table.columns[place];
            let unit = Header::of(written).unit;
            let named = || format!("name it as in `{example}`");
            if unit.is_empty() {
                return Err(refuse(None, "a column without a unit".to_owned(), named()));
            }
            let factor = kind
                .parse(&format!("1 {unit}"))
                .map_err(|error| refuse(None, error.to_string(), named()))?;
            let number = |(row, entry): (usize, &Entry)| {
                let what = match entry {
                    Entry::Number(number) => return Ok(number * factor),
                    Entry::Missing => "missing number".to_owned(),
                    Entry::Text(text) => format!("`{text}` is not a number"),
                };
                Err(refuse(Some(row), what, "give a finite number".to_owned()))
            };
            entries.iter().enumerate().map(number).collect()
        };
        let gaps: Vec<f64> = column(&["gap", "distance", "d"], Kind::Length, "gap (nm)")?;
        let forces: Vec<f64> = column(&["force", "f"], Kind::Force, "force (nN)")?;
        let points: Vec<(f64, f64)> = gaps.into_iter().zip(forces).collect();
        let rows = Rows::new(&points).map_err(|error| {
            let remedy = "give each gap once, in the order of the gaps, and its force";
            ForceTableError::new(format!("{}: {error}", table.name), remedy)
        })?;
        Ok(Self(Arc::new(rows)))
    }

    /// The table as an array that is read back as the same.
    pub(crate) fn text(&self) -> String {
        let rows = self.0.points().iter();
        let rows = rows.map(|(gap, force)| format!("[{gap:?}, {force:?}]"));
        let header = "[\"gap (m)\", \"force (N)\"]".to_owned();
        let all: Vec<String> = std::iter::once(header).chain(rows).collect();
        format!("[{}]", all.join(", "))
    }
}

/// The file that a text names, if it is not a table.
pub(crate) fn file_named(text: &str) -> Option<&str> {
    let name = text.trim();
    (!name.contains('\n') && !name.starts_with('[')).then_some(name)
}

/// Converts an array of rows, of which the first contains the names of the columns.
pub(crate) fn table_of(value: &DeValue<'_>) -> Option<Table> {
    let DeValue::Array(rows) = value else {
        return None;
    };
    let fields = |row: &toml::Spanned<DeValue<'_>>| -> Option<Vec<String>> {
        let DeValue::Array(fields) = row.get_ref() else {
            return None;
        };
        let field = |field: &toml::Spanned<DeValue<'_>>| match field.get_ref() {
            DeValue::Integer(integer) => Some(integer.as_str().to_owned()),
            DeValue::Float(float) => Some(float.as_str().to_owned()),
            DeValue::String(text) => Some(text.clone().into_owned()),
            _ => None,
        };
        fields.iter().map(field).collect()
    };
    let (first, rest) = rows.split_first()?;
    let header = fields(first)?;
    let mut table = Table {
        name: "the table".to_owned(),
        columns: header.into_iter().map(|name| (name, Vec::new())).collect(),
        lines: Vec::new(),
    };
    for row in rest {
        let fields = fields(row).filter(|fields| fields.len() == table.columns.len())?;
        for ((_, column), field) in table.columns.iter_mut().zip(fields) {
            column.push(Entry::of(&field));
        }
    }
    Some(table)
}
