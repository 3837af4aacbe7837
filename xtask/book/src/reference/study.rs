//! The options and the report of a study.

use std::fmt::Write as _;

use nanotap::study::registry::StudyEntry;
use serde_json::Value;

use super::schema::{bare, kind, meaning, range};
use super::{code, head, row};

pub(super) fn page(entry: &StudyEntry) -> String {
    let request = (entry.request)().to_value();
    let report = (entry.report)().to_value();
    let name = entry.name;
    let mut text = format!(
        "# {name}\n\n{}.\n\nCommand: `nanotap {name}`. [Python](../python.md): `nanotap.{}`. This page is \
         generated from the study's schema, which `nanotap schema {name}` prints; options of the \
         command line only are listed by `nanotap {name} --help`.\n\n## Options\n\n",
        entry.about,
        name.replace('-', "_"),
    );
    text += &head(&["option", "meaning", "value", "range", "default"]);
    for (name, schema) in request["properties"].as_object().into_iter().flatten() {
        text += &row(&[
            code(&format!("--{}", name.replace('_', "-"))),
            meaning(schema),
            kind(schema),
            range(schema),
            bare(&schema["default"]),
        ]);
    }
    text += "\n## JSON document\n\n`--json` prints these entries; Python's results have the same names.\n\n";
    text += &entries(&report);
    for part in [&request, &report] {
        for (name, schema) in part["$defs"].as_object().into_iter().flatten() {
            text += &definition(name, schema);
        }
    }
    text
}

/// A table of the entries of an object.
fn entries(schema: &Value) -> String {
    let required: Vec<&str> = schema["required"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    let mut text = head(&["entry", "meaning", "type", "unit", "always"]);
    for (name, schema) in schema["properties"].as_object().into_iter().flatten() {
        text += &row(&[
            code(name),
            meaning(schema),
            kind(schema),
            bare(&schema["x-unit"]),
            (if required.contains(&name.as_str()) {
                "yes"
            } else {
                ""
            })
            .to_owned(),
        ]);
    }
    text
}

/// A table to which entries of other tables refer.
fn definition(name: &str, schema: &Value) -> String {
    let mut text = format!("\n### {name}\n\n");
    let about = meaning(schema);
    if !about.is_empty() {
        let _ = write!(text, "{}\n\n", super::plain(&about));
    }
    if schema["properties"].is_object() {
        return text + &entries(schema);
    }
    if let Some(choices) = schema["oneOf"].as_array().or(schema["anyOf"].as_array()) {
        for choice in choices {
            let _ = writeln!(
                text,
                "- {} {}",
                kind(choice),
                super::plain(&meaning(choice))
            );
        }
        return text;
    }
    text + &format!("{}\n", kind(schema))
}
