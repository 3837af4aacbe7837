//! The keys of a case file.

use std::fmt::Write as _;

use serde_json::Value;

use super::schema::{bare, kind, meaning, range};
use super::{code, head, row};

const INTRODUCTION: &str = "\
# The keys of a case file

A case has either `[model]` alone, in the model's own units, or a lever, a sample and a drive in
physical units in the other tables, but not both. The exception are keys that belong to the model and
not to the instrument, such as `modes`: they may be given in `[model]` of a physical case. A quantity is
a string with its unit, `\"65.7 kHz\"`; range and default refer to its value in SI. `--set KEY=VALUE`
takes the same keys, those of the other tables with the table's name as prefix:
`--set drive.frequency=\"65 kHz\"`. An unknown key is an error, and the message names the nearest
known key.

This page is generated from the program's table of keys; `nanotap schema case` prints the same table
as a JSON schema.
";

pub(super) fn page() -> String {
    let schema = nanotap::case::schema::schema().to_value();
    let mut text = INTRODUCTION.to_owned();
    let tables = schema["properties"].as_object().into_iter().flatten();
    for (name, table) in tables {
        let _ = write!(text, "\n## `[{name}]`\n\n");
        text += &head(&[
            "key", "symbol", "meaning", "value", "range", "default", "replaces",
        ]);
        for (key, schema) in table["properties"].as_object().into_iter().flatten() {
            text += &entry(key, schema);
        }
    }
    text
}

fn entry(key: &str, schema: &Value) -> String {
    let mut names = code(key);
    if let Some(alias) = schema["x-alias"].as_str() {
        let _ = write!(names, " or `{alias}`");
    }
    let takes = match (schema["x-quantity"].as_str(), schema["x-unit"].as_str()) {
        (Some(quantity), Some(unit)) => {
            let example = bare(&schema["examples"][0]);
            format!("{quantity} ({unit}), as `\"{example}\"`")
        }
        _ => match schema["examples"].as_array() {
            Some(words) => {
                let words: Vec<String> = words.iter().map(|word| code(&bare(word))).collect();
                words.join(", ")
            }
            None => kind(schema),
        },
    };
    let mut what = meaning(schema);
    if let Some(models) = schema["x-models"].as_array() {
        let oscillators = models.iter().filter(|&model| model != "cantilever").count();
        if oscillators > 0 && oscillators == models.len() {
            let models: Vec<String> = models.iter().map(|model| code(&bare(model))).collect();
            let _ = write!(what, " ({})", models.join(", "));
        }
    }
    let others: Vec<String> = schema["x-instead-of"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|other| code(&bare(other)))
        .collect();
    row(&[
        names,
        bare(&schema["x-symbol"]),
        what,
        takes,
        range(schema),
        bare(&schema["default"]),
        others.join(", "),
    ])
}
