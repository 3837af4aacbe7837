//! The document of any study as tables, from the schema of its report.

use nanotap::case::Case;
use nanotap::case::key::Section;
use nanotap::case::quantity::Kind;
use nanotap::case::{Key, Value as Stated};
use nanotap::frame::Frame;
use serde_json::{Map, Value, json};

/// Rows of a table that are shown.
const MAX_ROWS: usize = 200;
/// Columns of a table that are shown.
const MAX_COLUMNS: usize = 12;
/// Numbers of a list that are shown.
const MAX_NUMBERS: usize = 8;

/// The tables of a document: its values, then one for each list of objects. What the document has in
/// SI, too, is shown in SI alone.
pub(crate) fn tables(document: &Value, schema: &Value) -> Vec<Value> {
    let mut values = Vec::new();
    let mut lists = Vec::new();
    let report = alternative(document, schema);
    let si = Field::of(schema, report, "physical").node;
    let in_si = document["physical"].as_object().into_iter().flatten();
    let in_si: Vec<String> = in_si
        .map(|(name, _)| Field::of(schema, si, name).words)
        .collect();
    let fields = document.as_object().into_iter().flatten();
    for (name, value) in fields.filter(|(name, _)| !["case", "version"].contains(&name.as_str())) {
        let field = Field::of(schema, report, name);
        if !field.words.is_empty() && in_si.contains(&field.words) {
            continue;
        }
        match value {
            Value::Array(rows) if rows.first().is_some_and(Value::is_object) => {
                lists.push(list(name, rows, &field, schema));
            }
            Value::Object(inner) => {
                for (name, value) in inner {
                    let field = Field::of(schema, field.node, name);
                    values.extend(field.row(name, value));
                }
            }
            value => values.extend(field.row(name, value)),
        }
    }
    if !values.is_empty() {
        lists.insert(0, table("", &[("", ""), ("", "")], &values));
    }
    lists
}

/// The alternative of a report that describes most of a document's fields; the report itself if it has
/// none.
fn alternative<'a>(document: &Value, schema: &'a Value) -> &'a Value {
    let names = || document.as_object().into_iter().flatten();
    let described = |report: &&Value| {
        let known = |name: &String| report["properties"].get(name).is_some();
        names().filter(|(name, _)| known(name)).count()
    };
    let all = schema["anyOf"].as_array().into_iter().flatten();
    let all = all.map(|one| resolved(schema, one));
    all.max_by_key(described).unwrap_or(schema)
}

/// A table as the page reads it: heads with their meanings, and rows of cells.
pub(crate) fn table(title: &str, heads: &[(&str, &str)], rows: &[Value]) -> Value {
    json!({ "title": title, "heads": heads, "rows": rows })
}

/// A frame as a table with a title: the heads and cells of the terminal, with labels as their meanings.
pub(crate) fn of_frame(title: &str, frame: &Frame<'_>) -> Value {
    let shown = frame.shown(0..frame.rows.min(MAX_ROWS));
    let heads = shown.heads.iter();
    let heads: Vec<(&str, &str)> = heads
        .map(|(head, meaning, _)| (head.as_str(), meaning.as_str()))
        .collect();
    let rows: Vec<Value> = shown.rows.iter().map(|cells| row(cells, None)).collect();
    table(title, &heads, &rows)
}

/// Columns of a frame by their names, also those that only files have, as a table with these names.
pub(crate) fn of_columns(frame: &Frame<'_>, names: &[&str]) -> (Value, Vec<Vec<String>>) {
    let named = |name: &&str| frame.columns.iter().find(|column| column.name == *name);
    let columns: Vec<_> = names.iter().filter_map(named).collect();
    let heads = columns.iter();
    let heads = heads.map(|column| json!([frame.head(column), column.label]));
    let names = columns.iter().map(|column| &column.name);
    let head = json!({
        "title": "",
        "names": names.collect::<Vec<_>>(),
        "heads": heads.collect::<Vec<_>>(),
    });
    let cells = |row| {
        columns
            .iter()
            .map(|column| frame.text(column, row))
            .collect()
    };
    (head, (0..frame.rows).map(cells).collect())
}

/// A row of cells. With changes to the case, a click on it makes them.
pub(crate) fn row(cells: &[String], set: Option<&Map<String, Value>>) -> Value {
    json!({ "cells": cells, "set": set })
}

/// A list of objects as a table.
fn list(name: &str, rows: &[Value], of: &Field<'_>, root: &Value) -> Value {
    let items = resolved(root, &of.node["items"]);
    let mut names: Vec<&String> = Vec::new();
    for row in rows.iter().take(MAX_ROWS).filter_map(Value::as_object) {
        for (name, value) in row {
            if !names.contains(&name) && names.len() < MAX_COLUMNS && cell(value, None).is_some() {
                names.push(name);
            }
        }
    }
    let fields: Vec<Field<'_>> = names
        .iter()
        .map(|name| Field::of(root, items, name))
        .collect();
    let titles: Vec<String> = names.iter().map(|name| name.replace('_', " ")).collect();
    let heads: Vec<(&str, &str)> = titles
        .iter()
        .zip(&fields)
        .map(|(title, field)| (title.as_str(), field.words.as_str()))
        .collect();
    let shown = rows.iter().take(MAX_ROWS).map(|one| {
        let cells = names.iter().zip(&fields);
        let cells = cells.map(|(name, field)| cell(&one[name.as_str()], field.kind));
        let cells: Vec<String> = cells.map(Option::unwrap_or_default).collect();
        row(&cells, None)
    });
    let more = match rows.len() {
        count if count > MAX_ROWS => format!("{}, the first {MAX_ROWS} of {count}", of.title(name)),
        _ => of.title(name),
    };
    table(&more, &heads, &shown.collect::<Vec<_>>())
}

/// A field of a report in its schema.
struct Field<'a> {
    node: &'a Value,
    /// The first sentence of its description.
    words: String,
    /// What it measures, by its declared unit.
    kind: Option<Kind>,
}

impl<'a> Field<'a> {
    fn of(root: &'a Value, parent: &'a Value, name: &str) -> Self {
        let own = &parent["properties"][name];
        let described = own["description"].as_str();
        let node = resolved(root, own);
        let described = described.or_else(|| node["description"].as_str());
        let text: Vec<&str> = described.unwrap_or_default().split_whitespace().collect();
        let text = text.join(" ");
        let words = text.split(". ").next().unwrap_or_default();
        let words = words.trim_end_matches('.').to_owned();
        let kind = own["x-unit"].as_str().and_then(Kind::of_si_unit);
        Self { node, words, kind }
    }

    /// Its words without the unit, which the value has.
    fn title(&self, name: &str) -> String {
        let unit = self.kind.map_or("", Kind::si_unit);
        let words = self.words.trim_end_matches(", dimensionless");
        let words = words.trim_end_matches(unit);
        let words = match self.kind {
            Some(_) => words.trim_end_matches(", ").trim_end_matches(" in "),
            None => words,
        };
        if words.is_empty() {
            name.replace('_', " ")
        } else {
            words.to_owned()
        }
    }

    fn row(&self, name: &str, value: &Value) -> Option<Value> {
        Some(row(&[self.title(name), cell(value, self.kind)?], None))
    }
}

/// A node of a schema without references and without the alternative `null`.
fn resolved<'a>(root: &'a Value, node: &'a Value) -> &'a Value {
    let mut node = node;
    for _ in 0..4 {
        let name = node["$ref"]
            .as_str()
            .and_then(|path| path.rsplit('/').next());
        let some = ["anyOf", "allOf", "oneOf"].iter().find_map(|key| {
            let mut among = node[*key].as_array()?.iter();
            among.find(|one| one["type"] != "null")
        });
        node = match (name, some) {
            (Some(name), _) => &root["$defs"][name],
            (None, Some(some)) => some,
            (None, None) => return node,
        };
    }
    node
}

/// A value as text; `None` for one that does not fit in a cell.
fn cell(value: &Value, kind: Option<Kind>) -> Option<String> {
    let number = |value: f64| kind.unwrap_or(Kind::Number).format_digits(value, 5);
    Some(match value {
        Value::Null => String::new(),
        Value::Bool(true) => "yes".to_owned(),
        Value::Bool(false) => "no".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(value) => number(value.as_f64()?),
        Value::Array(all) if all.len() <= MAX_NUMBERS => {
            let cells = all.iter().map(|one| match one {
                Value::Array(_) | Value::Object(_) => None,
                one => cell(one, kind),
            });
            cells.collect::<Option<Vec<String>>>()?.join(", ")
        }
        Value::Array(all) if !all.iter().any(|one| one.is_array() || one.is_object()) => {
            format!("{} values", all.len())
        }
        _ => return None,
    })
}

/// What the page must state to go from one case to another: keys with their values, empty where the
/// other case does not state them.
pub(crate) fn changes(from: &Case, to: &Case) -> Map<String, Value> {
    let differs = |key: &Key| from.stated(*key) != to.stated(*key);
    Key::all()
        .filter(|key| key.section() != Section::Model && differs(key))
        .map(|key| {
            let text = to.stated(key).map(Stated::text).unwrap_or_default();
            (key.path().to_owned(), text.into())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_becomes_tables_with_units_from_its_schema() {
        let schema = json!({
            "properties": {
                "free": { "description": "Free amplitude, m.", "x-unit": "m" },
                "rows": { "description": "The rows.", "items": { "$ref": "#/$defs/Row" } },
            },
            "$defs": { "Row": { "properties": {
                "k": { "description": "Stiffness in N/m. More.", "x-unit": "N/m" },
            } } },
        });
        let document = json!({
            "free": 1e-8, "verdict": "good", "case": {}, "many": vec![0; 20],
            "rows": [{ "k": 40.0, "curve": [[1, 2]] }],
        });
        let tables = tables(&document, &schema);
        assert_eq!(tables.len(), 2);
        let cells: Vec<&Value> = tables[0]["rows"]
            .as_array()
            .unwrap()
            .iter()
            .map(|row| &row["cells"])
            .collect();
        assert!(cells.contains(&&json!(["Free amplitude", "10 nm"])));
        assert!(cells.contains(&&json!(["verdict", "good"])));
        assert!(cells.contains(&&json!(["many", "20 values"])));
        assert_eq!(tables[1]["title"], "The rows");
        assert_eq!(tables[1]["heads"], json!([["k", "Stiffness in N/m"]]));
        assert_eq!(tables[1]["rows"][0]["cells"], json!(["40 N/m"]));
    }
}
