//! The JSON schema of a case, from the table of keys.

use schemars::{Schema, json_schema};
use serde_json::{Map, Value, json};

use super::key::{Default, Entry, Key, Section, Takes};

/// The JSON schema of a case: its tables with their keys, as a case file states them.
///
/// A key of a physical table is a text with its unit, `"65 kHz"`; its range, default and
/// `x-unit` are those of the number in SI. In addition to the words of JSON schema a key has
/// `x-alias`, its second name; `x-symbol`; `x-models`, the kinds of `[model]` that take it; and
/// `x-instead-of`, the keys that state the same quantity and cannot be given with it.
pub fn schema() -> Schema {
    let tables = Section::ALL.into_iter().map(|section| {
        let keys = section.keys();
        let mut keys: Map<_, _> = keys
            .map(|key| (key.name().to_owned(), described(key)))
            .collect();
        if section == Section::Sample {
            let parameters = json!({
                "type": "object",
                "description": "parameters of the formula sample.force, by name",
                "examples": [{"E": "2 GPa", "n": 1.5}],
                "propertyNames": {"pattern": "^[\\p{L}_][\\p{L}\\p{N}_]*$"},
                "additionalProperties": {"type": ["string", "number"]},
            });
            keys.insert("parameters".to_owned(), parameters);
        }
        let table = json!({
            "type": "object",
            "properties": keys,
            "additionalProperties": false,
        });
        (section.name().to_owned(), table)
    });
    let tables: Map<_, _> = tables.collect();
    json_schema!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Case",
        "type": "object",
        "properties": tables,
        "additionalProperties": false,
    })
}

fn described(key: Key) -> Value {
    let entry = key.entry();
    let mut schema = taken(key, entry);
    let mut say = |name: &str, value: Value| {
        schema.insert(name.to_owned(), value);
    };
    say("description", entry.meaning.into());
    match entry.default {
        Default::None => {}
        Default::Number(number) => say("default", plain(number)),
        Default::Word(word) => say("default", word.into()),
    }
    if let Some(alias) = entry.alias {
        say("x-alias", alias.into());
    }
    if !entry.symbol.is_empty() {
        say("x-symbol", entry.symbol.into());
    }
    if !entry.models.is_empty() {
        let models: Vec<&str> = entry.models.iter().map(|model| model.name()).collect();
        say("x-models", models.into());
    }
    let others: Vec<&str> = key.alternatives().map(|(other, _)| other.path()).collect();
    if !others.is_empty() {
        say("x-instead-of", others.into());
    }
    schema.into()
}

/// The type of what a key takes, and the values that are allowed.
fn taken(key: Key, entry: &Entry) -> Map<String, Value> {
    let mut schema = Map::new();
    let mut say = |name: &str, value: Value| {
        schema.insert(name.to_owned(), value);
    };
    match entry.takes {
        Takes::Quantity(kind) if key.is_physical() && kind != super::quantity::Kind::Number => {
            // A bare 0 needs no unit.
            say("type", json!(["string", "number"]));
            say("examples", json!([kind.example()]));
            say("x-quantity", kind.noun().into());
            say("x-unit", kind.si_unit().into());
        }
        Takes::Quantity(_) => say("type", "number".into()),
        Takes::Setpoint => say("type", json!(["number", "string"])),
        Takes::Count(most) => {
            say("type", "integer".into());
            say("minimum", 1.into());
            say("maximum", most.into());
            return schema;
        }
        Takes::Word(words) => {
            say("enum", words.into());
            return schema;
        }
        Takes::Law => {
            say("type", "string".into());
            say("examples", super::stated::laws().into());
            return schema;
        }
        Takes::LeverName | Takes::MaterialName => {
            say("type", "string".into());
            return schema;
        }
        Takes::Formula => {
            say("type", "string".into());
            say("examples", json!(["k*max(-d, 0) - c*v"]));
            return schema;
        }
        Takes::State => {
            say("type", "string".into());
            say("examples", json!(["tip=5 nm"]));
            return schema;
        }
        Takes::Table => {
            say("type", json!(["string", "array"]));
            say(
                "examples",
                json!([
                    "curve.csv",
                    [["gap (nm)", "force (nN)"], [-1, 8.5], [0, 0], [9, 0]]
                ]),
            );
            return schema;
        }
        Takes::Arms => {
            say("type", json!(["string", "array"]));
            say(
                "examples",
                json!([
                    "arms.csv",
                    [["time (us)", "modulus (MPa)"], [0.38, 460], [1.7, 136]]
                ]),
            );
            return schema;
        }
        Takes::Springs => {
            say("type", json!(["string", "array"]));
            say(
                "examples",
                json!([
                    "arms.csv",
                    [["time (us)", "stiffness (N/m)"], [0.5, 50], [4, 10]]
                ]),
            );
            return schema;
        }
        Takes::ModelArms => {
            say("type", "array".into());
            say(
                "examples",
                json!([[["time", "stiffness"], [0.1, 20], [1, 5]]]),
            );
            return schema;
        }
        Takes::LeverModes | Takes::ModelLeverModes => {
            say("type", json!(["string", "array"]));
            let example = if key.is_physical() {
                json!([{"f": "48.913 kHz", "k": "0.9 N/m", "Q": 255}, {"f": "306.194 kHz", "k": "35.2 N/m", "Q": 1002}])
            } else {
                json!([{"frequency": 3.516, "stiffness": 3.09, "quality": 255}])
            };
            say("examples", json!([example]));
            return schema;
        }
        Takes::FrequencyRatio => {
            say("type", json!(["string", "number"]));
            say("examples", json!(["25/4", 6.25]));
            return schema;
        }
    }
    let range = key.range();
    let low = if range.above {
        "exclusiveMinimum"
    } else {
        "minimum"
    };
    let high = if range.below {
        "exclusiveMaximum"
    } else {
        "maximum"
    };
    for (name, bound) in [(low, range.low), (high, range.high)] {
        if bound.is_finite() {
            say(name, plain(bound));
        }
    }
    schema
}

/// A number without the fraction that it does not have.
fn plain(number: f64) -> Value {
    if number.fract() == 0.0 && number.abs() < 1e15 {
        return (number as i64).into();
    }
    number.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_stands_in_its_table_with_what_it_is() {
        let schema = schema().to_value();
        for key in Key::all() {
            let declared = &schema["properties"][key.section().name()]["properties"][key.name()];
            assert!(declared["description"].is_string(), "{key}");
            assert!(
                declared["type"].is_string()
                    || declared["type"].is_array()
                    || declared["enum"].is_array(),
                "{key}"
            );
        }
        let frequency = &schema["properties"]["drive"]["properties"]["frequency"];
        assert_eq!(frequency["x-unit"], "Hz");
        assert_eq!(frequency["exclusiveMinimum"], 0);
        let modes = &schema["properties"]["model"]["properties"]["modes"];
        assert_eq!(modes["default"], crate::DEFAULT_MODES);
    }
}
