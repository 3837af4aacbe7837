//! Reports on many motions as columns: the numbers, words and vectors of one length that every
//! report has, under the names that single results have.

use std::collections::BTreeMap;

use nanotap::study::orbit::spectral_radius;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::IntoPyObjectExt as _;
use pyo3::prelude::*;
use serde_json::{Map, Value};

/// A value in a report: a number, a word or a vector.
#[derive(Clone, Debug, PartialEq)]
enum Entry {
    Flag(bool),
    Whole(i64),
    Number(f64),
    Word(String),
    /// Numbers along the dimension with this name.
    Row(&'static str, Vec<f64>),
}

/// The values of one report with their names, in the order of the report.
#[derive(Clone, Debug)]
pub(crate) struct Entries {
    all: Vec<(String, Entry)>,
    /// Number of entries of a state.
    pub(crate) dimension: usize,
    /// Names of the energies in the energy balance.
    pub(crate) energies: Vec<String>,
}

/// Collects the values of a report on a motion.
pub(crate) fn entries(mut report: Value) -> Entries {
    let mut all = Vec::new();
    let state = report.get("state").or_else(|| report.get("start"));
    let dimension = state.and_then(Value::as_array).map_or(0, Vec::len);
    let balance = report.get("energy_balance").and_then(Value::as_object);
    let energies = balance.into_iter().flat_map(Map::keys).cloned().collect();
    let Some(report) = report.as_object_mut() else {
        return Entries {
            all,
            dimension,
            energies,
        };
    };
    if let Some(Value::Array(multipliers)) = report.remove("multipliers") {
        let pair = |pair: &Value| [0, 1].map(|k| pair[k].as_f64().unwrap_or(f64::NAN));
        let multipliers: Vec<[f64; 2]> = multipliers.iter().map(pair).collect();
        let radius = spectral_radius(&multipliers);
        all.push(("spectral_radius".into(), Entry::Number(radius)));
    }
    if let Some(Value::Array(rows)) = report.remove("strobe") {
        let numbers = rows
            .iter()
            .flat_map(|row| row.as_array().into_iter().flatten());
        let numbers = numbers.filter_map(Value::as_f64).collect();
        all.push(("strobe".into(), Entry::Row("strobe_period", numbers)));
    }
    gather(report, "", dimension, &mut all);
    Entries {
        all,
        dimension,
        energies,
    }
}

impl Entries {
    /// Arranges states with the entries `own` as states with the entries `names`; missing entries
    /// are NaN.
    pub(crate) fn among(&mut self, own: &[String], names: &[String]) {
        for (_, entry) in &mut self.all {
            let Entry::Row("state" | "strobe_period", row) = entry else {
                continue;
            };
            let states = row.chunks(own.len().max(1));
            let wide = states.flat_map(|state| {
                names.iter().map(|name| {
                    let at = own.iter().position(|known| known == name);
                    at.map_or(f64::NAN, |at| state[at])
                })
            });
            *row = wide.collect();
        }
    }
}

fn gather(
    report: &Map<String, Value>,
    before: &str,
    dimension: usize,
    all: &mut Vec<(String, Entry)>,
) {
    for (name, value) in report {
        let full = format!("{before}{name}");
        let entry = match value {
            // The evidence for a classification is a text.
            Value::String(_) if name == "evidence" => continue,
            Value::Object(energies) if name == "energy_balance" => {
                let numbers = energies.values().map(|v| v.as_f64().unwrap_or(f64::NAN));
                Entry::Row("energy", numbers.collect())
            }
            Value::Object(inner) => {
                gather(inner, &format!("{full}_"), dimension, all);
                continue;
            }
            // Values of another shape belong to single results.
            Value::Array(_) if !before.is_empty() && !name.ends_with("_range") => continue,
            Value::Array(numbers) => {
                let numbers: Option<Vec<f64>> = numbers.iter().map(Value::as_f64).collect();
                let Some(numbers) = numbers else { continue };
                let along = if name.ends_with("_range") {
                    "bound"
                } else if numbers.len() != dimension {
                    continue;
                } else if name.starts_with("lyapunov") {
                    "exponent"
                } else {
                    "state"
                };
                // `state` is the dimension along which states lie.
                let full = if name == "state" {
                    "orbit_state".into()
                } else {
                    full
                };
                all.push((full, Entry::Row(along, numbers)));
                continue;
            }
            Value::Bool(flag) => Entry::Flag(*flag),
            Value::String(word) => Entry::Word(word.clone()),
            Value::Null => Entry::Number(f64::NAN),
            Value::Number(number) => match number.as_i64() {
                Some(whole) => Entry::Whole(whole),
                None => Entry::Number(number.as_f64().unwrap_or(f64::NAN)),
            },
        };
        all.push((full, entry));
    }
}

/// A column: its name, the dimension within an entry (empty of a scalar), and its values, one
/// entry after the other.
pub(crate) type Column = (String, &'static str, Py<PyAny>);

/// Arranges many reports, some of which may be missing, as columns. Values that differ in shape are
/// left out.
pub(crate) fn columns(py: Python<'_>, reports: &[Option<Entries>]) -> PyResult<Vec<Column>> {
    let mut names: Vec<&str> = Vec::new();
    let mut known: BTreeMap<&str, Vec<Option<&Entry>>> = BTreeMap::new();
    for (index, report) in reports.iter().enumerate() {
        for (name, entry) in report.iter().flat_map(|report| &report.all) {
            let column = known.entry(name).or_insert_with(|| {
                names.push(name);
                vec![None; reports.len()]
            });
            column[index] = Some(entry);
        }
    }
    let mut made = Vec::new();
    for name in names {
        if let Some((along, values)) = values(py, &known[name])? {
            made.push((name.to_owned(), along, values));
        }
    }
    Ok(made)
}

/// The values of one column, with the dimension within an entry.
fn values(
    py: Python<'_>,
    column: &[Option<&Entry>],
) -> PyResult<Option<(&'static str, Py<PyAny>)>> {
    let present = || column.iter().copied().flatten();
    let Some(first) = present().next() else {
        return Ok(None);
    };
    if let Entry::Row(along, row) = first {
        let mut all = Vec::with_capacity(column.len() * row.len());
        for entry in column {
            match entry {
                Some(Entry::Row(_, other)) if other.len() == row.len() => all.extend(other),
                Some(_) => return Ok(None),
                None => all.resize(all.len() + row.len(), f64::NAN),
            }
        }
        let shape = [column.len(), row.len()];
        let array = PyArray1::from_vec(py, all).reshape(shape)?;
        return Ok(Some((along, array.into_py_any(py)?)));
    }
    if matches!(first, Entry::Word(_)) {
        let word = |entry: Option<&Entry>| match entry {
            Some(Entry::Word(word)) => Some(word.clone()),
            Some(_) => None,
            None => Some(String::new()),
        };
        let words: Option<Vec<String>> = column.iter().copied().map(word).collect();
        let words = words.map(|words| words.into_py_any(py)).transpose()?;
        return Ok(words.map(|words| ("", words)));
    }
    let all_are = |is: fn(&Entry) -> bool| column.iter().all(|e| e.is_some_and(is));
    let array = if all_are(|e| matches!(e, Entry::Flag(_))) {
        let flags = present().map(|e| matches!(e, Entry::Flag(true)));
        PyArray1::from_vec(py, flags.collect()).into_py_any(py)?
    } else if all_are(|e| matches!(e, Entry::Whole(_))) {
        let whole = present().map(|e| match e {
            Entry::Whole(number) => *number,
            _ => 0,
        });
        PyArray1::from_vec(py, whole.collect()).into_py_any(py)?
    } else {
        let number = |entry: Option<&Entry>| match entry {
            None => Some(f64::NAN),
            Some(Entry::Number(number)) => Some(*number),
            Some(Entry::Whole(number)) => Some(*number as f64),
            Some(Entry::Flag(flag)) => Some(f64::from(u8::from(*flag))),
            Some(Entry::Word(_) | Entry::Row(..)) => None,
        };
        let numbers: Option<Vec<f64>> = column.iter().copied().map(number).collect();
        let Some(numbers) = numbers else {
            return Ok(None);
        };
        PyArray1::from_vec(py, numbers).into_py_any(py)?
    };
    Ok(Some(("", array)))
}
