//! A force table as stated in a case: rows of gap, force and, if there is one, damping, the first one
//! with the units.
//!
//! In a case file it is an array, `table = [["gap (nm)", "force (nN)"], [-1, 8.5], [0, 0], [9,
//! 0]]`, or the name of a CSV file with these columns. Such a file is read relative to the case
//! file, once; the case then contains the array.

use std::sync::Arc;

use nanotap_volterra::laws::curve::Interpolation;
use nanotap_volterra::laws::prony::Arms;
use nanotap_volterra::laws::table::Rows;
use toml::de::DeValue;

use super::key::Takes;
use super::lever_modes::{self, LeverModes};
use super::quantity::Kind;
use super::stated::Value;
use crate::table::{Entry, Header, Table};
use nanotap_error::Error;

/// Syntax of a table, for remedies.
const SHAPE: &str = "write rows as in [[\"gap (nm)\", \"force (nN)\"], [-1, 8.5], [0, 0], [9, 0]]";
const ARMS_SHAPE: &str =
    "write rows as in [[\"time (us)\", \"modulus (MPa)\"], [0.38, 460], [1.7, 136]]";
const SPRINGS_SHAPE: &str =
    "write rows as in [[\"time (us)\", \"stiffness (N/m)\"], [0.5, 50], [4, 10]]";
const MODEL_ARMS_SHAPE: &str = "write rows as in [[\"time\", \"stiffness\"], [0.1, 20], [1, 5]]";

/// Why rows are not a force table.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ForceTableError {
    /// What is wrong, and where.
    pub message: String,
    /// What to change in the rows.
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
    pub(crate) fn new(message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            remedy: remedy.into(),
        }
    }
}

/// A force table: rows of gap in m, force in N and, if there is one, damping in N s/m.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceTable(Arc<Rows>);

impl ForceTable {
    /// The rows, in m and N.
    pub const fn rows(&self) -> &Arc<Rows> {
        &self.0
    }

    /// Creates a force table from the columns `gap`, `force` and, if there is one, `damping` of a
    /// table. If the table also has a column `damping error`, as a reconstructed force has, a
    /// damping below zero is attributed to the error and counts as zero.
    ///
    /// # Errors
    /// If they are missing, have no unit, or are not a function of the gap.
    pub fn of(table: &Table) -> Result<Self, ForceTableError> {
        let gaps = column(table, &["gap", "distance", "d"], Kind::Length, "gap (nm)")?;
        let forces = column(table, &["force", "f"], Kind::Force, "force (nN)")?;
        let mut damping = if has_values(table, DAMPING) {
            column(table, DAMPING, Kind::Damping, "damping (N s/m)")?
        } else {
            Vec::new()
        };
        if has_values(table, &["damping error"]) {
            for value in &mut damping {
                *value = value.max(0.0);
            }
        }
        let points: Vec<(f64, f64)> = gaps.into_iter().zip(forces).collect();
        let rows = Rows::damped(&points, &damping).map_err(|error| {
            let remedy = "give each gap once, in the order of the gaps, and its force";
            ForceTableError::new(format!("{}: {error}", table.name), remedy)
        })?;
        Ok(Self(Arc::new(rows)))
    }

    /// The same rows with another interpolation between them.
    pub(crate) fn by(&self, interpolation: Interpolation) -> Self {
        Self(Arc::new(self.0.by(interpolation)))
    }

    /// The table as the text of an array that parses to the same table.
    pub fn text(&self) -> String {
        let mut header = "[\"gap (m)\", \"force (N)\"".to_owned();
        if !self.0.damping().is_empty() {
            header.push_str(", \"damping (N s/m)\"");
        }
        let rows = self
            .0
            .points()
            .iter()
            .enumerate()
            .map(|(row, (gap, force))| {
                let damping = self.0.damping().get(row);
                let damping = damping.map_or(String::new(), |damping| format!(", {damping:?}"));
                format!("[{gap:?}, {force:?}{damping}]")
            });
        let all: Vec<String> = std::iter::once(format!("{header}]")).chain(rows).collect();
        format!("[{}]", all.join(", "))
    }
}

/// Names of a column of damping.
const DAMPING: &[&str] = &["damping", "gamma", "γ"];

/// Whether a table has a column of one of these names with a value: a damping that was not measured is
/// a column of empty fields.
fn has_values(table: &Table, names: &[&str]) -> bool {
    table.columns.iter().any(|(written, entries)| {
        let name = Header::of(written).name.to_lowercase();
        names.contains(&name.as_str()) && entries.iter().any(|entry| *entry != Entry::Missing)
    })
}

/// A column of a table, by one of its names, in SI.
///
/// # Errors
/// If it is missing, has no unit, or an entry is not a number.
fn column(
    table: &Table,
    names: &[&str],
    kind: Kind,
    example: &str,
) -> Result<Vec<f64>, ForceTableError> {
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
    if unit.is_empty() && kind != Kind::Number {
        return Err(refuse(None, "a column without a unit".to_owned(), named()));
    }
    let factor = kind
        .parse(format!("1 {unit}").trim_end())
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
}
/// Maxwell arms as stated in a case: rows of time and modulus. Like a force table they are an array,
/// `arms = [["time (us)", "modulus (MPa)"], [0.38, 460], [1.7, 136]]`, with `shear modulus` for a
/// shear modulus, or the name of a CSV file; or each with its unit,
/// `arms = [["460 MPa", "0.38 us"], ["136 MPa", "1.7 us"]]`. The arms of a piecewise-linear sample
/// have a stiffness in place of the modulus; in `[model]` their columns are plain numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmTable {
    arms: Arc<Arms>,
    strength: Strength,
}

/// Quantity that states the strength of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Strength {
    /// Young's or shear modulus, Pa.
    Modulus,
    /// Stiffness of a spring, N/m.
    Stiffness,
    /// Stiffness in model units; its time is in model units too.
    Number,
}

impl Strength {
    const fn kind(self) -> Kind {
        match self {
            Self::Modulus => Kind::Pressure,
            Self::Stiffness => Kind::Stiffness,
            Self::Number => Kind::Number,
        }
    }

    /// Names of the column, and an example of its header.
    const fn column(self, shear: bool) -> (&'static [&'static str], &'static str) {
        match self {
            Self::Modulus if shear => (SHEAR, "shear modulus (MPa)"),
            Self::Modulus => (YOUNG, "modulus (MPa)"),
            Self::Stiffness => (STIFFNESS, "stiffness (N/m)"),
            Self::Number => (STIFFNESS, "stiffness"),
        }
    }
}

impl ArmTable {
    /// The arms, in s and Pa or N/m, or in the model's units.
    pub const fn arms(&self) -> &Arc<Arms> {
        &self.arms
    }

    /// Creates arms from the columns `time` and `modulus`, `shear modulus` or `stiffness` of a table.
    ///
    /// # Errors
    /// If they are missing, have no unit, or a value makes no sense.
    fn of(table: &Table, strength: Strength) -> Result<Self, ForceTableError> {
        let shear = strength == Strength::Modulus && has_values(table, SHEAR);
        let points = if let Some(points) = Self::quantities(table, strength.kind()) {
            points
        } else {
            let (kind, example) = match strength {
                Strength::Number => (Kind::Number, "time"),
                Strength::Modulus | Strength::Stiffness => (Kind::Time, "time (us)"),
            };
            let times = column(table, &["time", "tau", "τ"], kind, example)?;
            let (names, example) = strength.column(shear);
            let strengths = column(table, names, strength.kind(), example)?;
            times.into_iter().zip(strengths).collect()
        };
        let arms = Arms::new(&points, shear).map_err(|error| {
            let remedy = "give each arm a time above zero, and a modulus or stiffness";
            ForceTableError::new(format!("{}: {error}", table.name), remedy)
        })?;
        Ok(Self {
            arms: Arc::new(arms),
            strength,
        })
    }

    /// Times and moduli of rows in which every entry has its unit.
    fn quantities(table: &Table, strength: Kind) -> Option<Vec<(f64, f64)>> {
        let [first, second] = table.columns.as_slice() else {
            return None;
        };
        let read = |(header, entries): &(String, Vec<Entry>), kind: Kind| {
            let texts = entries.iter().map(|entry| match entry {
                Entry::Text(text) => Some(text.as_str()),
                Entry::Number(_) | Entry::Missing => None,
            });
            let all = std::iter::once(Some(header.as_str())).chain(texts);
            all.map(|text| kind.parse(text?).ok())
                .collect::<Option<Vec<f64>>>()
        };
        let pair = |times, moduli| Some((read(times, Kind::Time)?, read(moduli, strength)?));
        let (times, moduli) = pair(first, second).or_else(|| pair(second, first))?;
        Some(times.into_iter().zip(moduli).collect())
    }

    /// The arms as the text of an array that parses to the same arms.
    pub(crate) fn text(&self) -> String {
        let header = match self.strength {
            Strength::Modulus if self.arms.shear() => "\"time (s)\", \"shear modulus (Pa)\"",
            Strength::Modulus => "\"time (s)\", \"modulus (Pa)\"",
            Strength::Stiffness => "\"time (s)\", \"stiffness (N/m)\"",
            Strength::Number => "\"time\", \"stiffness\"",
        };
        let rows = self.arms.points().iter();
        let rows = rows.map(|(time, modulus)| {
            let time = if time.is_infinite() {
                "inf".to_owned()
            } else {
                format!("{time:?}")
            };
            format!("[{time}, {modulus:?}]")
        });
        let all: Vec<String> = std::iter::once(format!("[{header}]")).chain(rows).collect();
        format!("[{}]", all.join(", "))
    }
}

/// Names of a column of Young's moduli, and of shear moduli.
const YOUNG: &[&str] = &["modulus", "e", "young's modulus"];
const SHEAR: &[&str] = &["shear modulus", "g"];
/// Names of a column of stiffnesses.
const STIFFNESS: &[&str] = &["stiffness", "k"];

impl Takes {
    /// The value of a key that takes a table.
    ///
    /// # Errors
    /// If the table's columns are not those of the key.
    pub(crate) fn of_table(self, table: &Table) -> Result<Value, ForceTableError> {
        Ok(match self {
            Self::Arms => Value::Arms(ArmTable::of(table, Strength::Modulus)?),
            Self::Springs => Value::Arms(ArmTable::of(table, Strength::Stiffness)?),
            Self::ModelArms => Value::Arms(ArmTable::of(table, Strength::Number)?),
            Self::LeverModes => Value::LeverModes(LeverModes::of(table, true)?),
            Self::ModelLeverModes => Value::LeverModes(LeverModes::of(table, false)?),
            _ => Value::Table(ForceTable::of(table)?),
        })
    }

    /// The value of a key that takes a table, from the text of an array or of a CSV file.
    ///
    /// # Errors
    /// As [`of_table`](Self::of_table), and if `text` names a file, which is not opened.
    pub(crate) fn parse_table(self, text: &str) -> Result<Value, ForceTableError> {
        let shape = match self {
            Self::Arms => ARMS_SHAPE,
            Self::Springs => SPRINGS_SHAPE,
            Self::ModelArms => MODEL_ARMS_SHAPE,
            Self::LeverModes => lever_modes::SHAPE,
            Self::ModelLeverModes => lever_modes::MODEL_SHAPE,
            _ => SHAPE,
        };
        if let Some(name) = file_named(text) {
            return Err(ForceTableError::new(
                format!("the file {name} is not opened here"),
                format!("name it in a case file or on the command line, or {shape}"),
            ));
        }
        if text.trim_start().starts_with('[') {
            let array = DeValue::parse(text).ok();
            let table = array.and_then(|array| table_of(array.get_ref()));
            return self
                .of_table(&table.ok_or_else(|| ForceTableError::new("not a table", shape))?);
        }
        self.of_table(&Table::parse("the table", text)?)
    }
}

/// The file that a text names, if it is not a table.
pub(crate) fn file_named(text: &str) -> Option<&str> {
    let name = text.trim();
    (!name.is_empty() && !name.contains('\n') && !name.starts_with('[')).then_some(name)
}

/// Converts an array of rows, of which the first contains the names of the columns, or an array of tables
/// whose keys are the columns.
pub(crate) fn table_of(value: &DeValue<'_>) -> Option<Table> {
    let DeValue::Array(rows) = value else {
        return None;
    };
    if let Some(DeValue::Table(_)) = rows.first().map(toml::Spanned::get_ref) {
        return table_of_tables(rows);
    }
    let fields = |row: &toml::Spanned<DeValue<'_>>| -> Option<Vec<String>> {
        let DeValue::Array(fields) = row.get_ref() else {
            return None;
        };
        fields
            .iter()
            .map(|field| text_of(field.get_ref()))
            .collect()
    };
    let (first, rest) = rows.split_first()?;
    let header = fields(first)?;
    let mut table = Table {
        name: "the table".to_owned(),
        columns: header.into_iter().map(|name| (name, Vec::new())).collect(),
        ..Table::default()
    };
    for row in rest {
        let fields = fields(row).filter(|fields| fields.len() == table.columns.len())?;
        for ((_, column), field) in table.columns.iter_mut().zip(fields) {
            column.push(Entry::of(&field));
        }
    }
    Some(table)
}

/// An entry of a table as text.
fn text_of(field: &DeValue<'_>) -> Option<String> {
    match field {
        DeValue::Integer(integer) => Some(integer.as_str().to_owned()),
        DeValue::Float(float) => Some(float.as_str().to_owned()),
        DeValue::String(text) => Some(text.clone().into_owned()),
        _ => None,
    }
}

/// Converts an array of tables: a column a key, in the order in which the keys first occur.
fn table_of_tables(rows: &[toml::Spanned<DeValue<'_>>]) -> Option<Table> {
    let mut table = Table {
        name: "the table".to_owned(),
        ..Table::default()
    };
    for (row, fields) in rows.iter().enumerate() {
        let DeValue::Table(fields) = fields.get_ref() else {
            return None;
        };
        for (name, value) in fields {
            let entry = Entry::of(&text_of(value.get_ref())?);
            let name: &str = name.get_ref();
            let known = table.columns.iter().position(|(other, _)| other == name);
            let place = known.unwrap_or_else(|| {
                table.columns.push((name.to_owned(), Vec::new()));
                table.columns.len() - 1
            });
            let column = &mut table.columns[place].1;
            column.resize(row, Entry::Missing);
            column.push(entry);
        }
    }
    for (_, column) in &mut table.columns {
        column.resize(rows.len(), Entry::Missing);
    }
    Some(table)
}
