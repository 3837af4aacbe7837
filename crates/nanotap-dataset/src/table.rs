//! A dataset as a table with one row per entry of the grid.

use std::fmt::Write as _;

use super::error::StoreError;
use super::schema::{Attributes, Coordinate, Schema, Values, Variable};
use super::store::Store;
use nanotap_quantity::number::shortest;

/// Writes the table as CSV to `sink`, in pieces: the coordinates, then every variable without
/// further dimensions. Codes are written as the names in `flag_meanings`; missing values are empty.
///
/// # Errors
/// If a chunk is missing or cannot be read, or if `sink` fails.
pub fn csv<E: From<StoreError>>(
    store: &Store,
    mut sink: impl FnMut(&str) -> Result<(), E>,
) -> Result<(), E> {
    store.require_all()?;
    let schema = store.schema();
    let labels = labels(schema);
    let columns: Vec<usize> = (0..schema.variables.len())
        .filter(|v| schema.variables[*v].tail.is_empty())
        .collect();
    let names = labels.iter().map(|(label, ..)| label.clone());
    let variables = columns.iter().map(|v| &schema.variables[*v]);
    let variables = variables.map(|v| with_unit(&v.name, &v.attributes));
    sink(&(names.chain(variables).collect::<Vec<_>>().join(",") + "\n"))?;
    for chunk in 0..store.chunks() {
        let block = schema.grid.block(chunk);
        let mut values = Vec::with_capacity(columns.len());
        for column in &columns {
            values.push((
                &schema.variables[*column],
                store.read_chunk(&block, *column)?,
            ));
        }
        let mut rows = String::new();
        for (flat, entry) in block.entries().enumerate() {
            let mut cells: Vec<String> = labels
                .iter()
                .map(|(_, axis, values)| cell(values, entry[*axis]))
                .collect();
            cells.extend(
                values
                    .iter()
                    .map(|(variable, values)| named(variable, values, flat)),
            );
            let _ = writeln!(rows, "{}", cells.join(","));
        }
        sink(&rows)?;
    }
    Ok(())
}

/// The header of a column, with the unit if the numbers are in SI. Numbers without a unit or in the
/// model's units have the name only.
fn with_unit(name: &str, attributes: &Attributes) -> String {
    let unit = attributes.get("units").and_then(|unit| unit.as_str());
    let si = |unit: &&str| unit.split('/').all(|part| SI.contains(&part));
    match unit.filter(si) {
        Some(unit) => format!("{name} ({unit})"),
        None => name.to_owned(),
    }
}

/// Symbols of SI units; a unit is SI if each of its parts between slashes is one of these.
const SI: [&str; 10] = ["m", "s", "kg", "N", "N s", "J", "W", "Hz", "Pa", "rad"];

/// The coordinates along the axes of the grid: header, axis, values.
fn labels(schema: &Schema) -> Vec<(String, usize, &Values)> {
    let mut labels = Vec::new();
    for (axis, dimension) in schema.grid.axes.iter().enumerate() {
        let mut along: Vec<&Coordinate> = schema
            .coordinates
            .iter()
            .filter(|c| c.dimensions.as_slice() == std::slice::from_ref(&dimension.name))
            .collect();
        // The axis itself comes before other coordinates along it.
        along.sort_by_key(|c| c.name != dimension.name);
        labels.extend(
            along
                .into_iter()
                .map(|c| (with_unit(&c.name, &c.attributes), axis, &c.values)),
        );
    }
    labels
}

fn named(variable: &Variable, values: &Values, index: usize) -> String {
    let meanings = variable
        .attributes
        .get("flag_meanings")
        .and_then(|m| m.as_str());
    match (values, meanings) {
        (Values::Code(codes), Some(meanings)) => {
            let code = usize::from(codes[index]);
            meanings.split(' ').nth(code).unwrap_or_default().to_owned()
        }
        _ => cell(values, index),
    }
}

fn cell(values: &Values, index: usize) -> String {
    match values {
        Values::Real(v) if v[index].is_nan() => String::new(),
        Values::Real(v) => shortest(v[index]),
        Values::Whole(v) => v[index].to_string(),
        Values::Code(v) => v[index].to_string(),
        Values::Text(v) => v[index].clone(),
    }
}
