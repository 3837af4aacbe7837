//! The keys of a case file.

use std::fmt::Write as _;

use serde_json::Value;

use super::schema::{bare, kind, meaning, range};
use super::{code, head, row};

const INTRODUCTION: &str = "\
# The keys of a case file

A case states either `[model]` alone, in the model's own units, or a lever, a sample and a drive in
physical units under the other tables; never a mix (`modes`, and what else the model chooses rather
than the instrument has, may stand in `[model]` beside them). A quantity is a text with its unit,
`\"65.7 kHz\"`; the range and the default are those of the number in SI. `--set KEY=VALUE` takes the
same keys, those of the other tables with the table's name before them:
`--set drive.frequency=\"65 kHz\"`. An unknown key is refused with the nearest one that exists.

This page is made of the table of keys in the program; `nanotap schema case` prints the same as a
JSON schema.
";

pub(super) fn page() -> String {
    let schema = nanotap::case::schema::schema().to_value();
    let mut text = INTRODUCTION.to_owned();
    let tables = schema["properties"].as_object().into_iter().flatten();
    for (name, table) in tables {
        let _ = write!(text, "\n## `[{name}]`\n\n");
        text += &head(&[
            "key",
            "",
            "what it is",
            "takes",
            "range",
            "without it",
            "instead of",
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
