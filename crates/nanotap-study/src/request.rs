//! The options of a study: a plain struct whose fields, with their documentation, defaults
//! and ranges, are declared once. Every front end reads the declaration from its JSON schema:
//! the terminal makes flags of it, Python keyword arguments, and both give back JSON, which
//! [`read`] checks and turns into the struct.
//!
//! In addition to JSON schema's words a property may have `x-value` (what the terminal calls a
//! value in its help), `x-bare` (the value of a flag that is given without one) and
//! `x-required`; for one with `x-own` the terminal has a hand-written option.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use schemars::generate::SchemaSettings;
use schemars::transform::transform_subschemas;
use schemars::{JsonSchema, Schema};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use nanotap_case::near_name::near_name;
use nanotap_error::Error;
use nanotap_quantity::number::shortest;

/// Declares the options of a study: each field with its documentation, its schema and its default.
#[macro_export]
macro_rules! options {
    (
        $(#[$about:meta])*
        pub struct $name:ident {
            $($(#[$of_field:meta])* pub $field:ident: $type:ty = $default:expr,)*
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[derive(schemars::JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $($(#[$of_field])* pub $field: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $($field: $default,)*
                }
            }
        }
    };
}
pub use options;

/// The JSON schema of a document: what recurs is under `$defs`.
///
/// JSON has neither infinity nor NaN, and a number of a computation may not exist: it is undefined (a
/// ratio to an amplitude of 0, the exponent of a motion that sticks), infinite, or too large for a
/// double. Such a number is `null`, so every real number of a document is a number or null. Counts always
/// exist.
pub fn answer_schema<T: JsonSchema>() -> Schema {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    let settings = settings.with_transform(numbers_may_not_exist);
    settings.into_generator().into_root_schema_for::<T>()
}

/// Allows null for every real number of a schema.
fn numbers_may_not_exist(schema: &mut Schema) {
    transform_subschemas(&mut numbers_may_not_exist, schema);
    match schema.get_mut("type") {
        Some(kind) if kind == "number" => *kind = json!(["number", "null"]),
        Some(Value::Array(kinds)) => {
            let null = Value::from("null");
            if kinds.iter().any(|kind| kind == "number") && !kinds.contains(&null) {
                kinds.push(null);
            }
        }
        _ => {}
    }
}

/// The JSON schema of a request, without references to definitions elsewhere.
pub fn schema<T: JsonSchema>() -> Schema {
    let settings = SchemaSettings::draft2020_12().with(|s| s.inline_subschemas = true);
    let mut schema = settings.into_generator().into_root_schema_for::<T>();
    // The title is part of what the terminal prints.
    if let Some(name) = T::schema_name().strip_suffix("Options") {
        schema.insert("title".into(), format!("{name}Request").into());
    }
    let required: Vec<Value> = properties(&schema)
        .filter(Property::is_required)
        .map(|property| property.name.into())
        .collect();
    if !required.is_empty() {
        schema.insert("required".into(), required.into());
    }
    schema
}

/// The options of a request, in the order of its struct.
pub fn properties(schema: &Schema) -> impl Iterator<Item = Property<'_>> {
    let properties = schema.get("properties").and_then(Value::as_object);
    properties
        .into_iter()
        .flatten()
        .map(|(name, schema)| Property { name, schema })
}

/// One option, as the schema declares it.
#[derive(Clone, Copy, Debug)]
pub struct Property<'a> {
    /// Name of the option, as in a JSON request.
    pub name: &'a str,
    /// JSON schema of the option's value, with its description and default.
    pub schema: &'a Value,
}

impl<'a> Property<'a> {
    /// Returns the description of the option, on one line.
    pub fn description(&self) -> String {
        let text = self.schema["description"].as_str().unwrap_or_default();
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Returns the default value; `None` if it is null or an empty list.
    pub fn default(&self) -> Option<&'a Value> {
        self.schema
            .get("default")
            .filter(|value| !value.is_null() && **value != Value::Array(Vec::new()))
    }

    /// Returns whether the option must be given.
    pub fn is_required(&self) -> bool {
        self.schema.get("x-required") == Some(&Value::Bool(true))
    }

    /// Whether a value may be of this JSON type.
    pub fn allows(&self, kind: &str) -> bool {
        match &self.schema["type"] {
            Value::String(only) => only == kind,
            Value::Array(kinds) => kinds.iter().any(|known| known == kind),
            _ => self
                .alternatives()
                .any(|alternative| alternative["type"] == kind),
        }
    }

    /// Returns the words that the option accepts, each with its description.
    pub fn words(&self) -> Vec<(&'a str, &'a str)> {
        let listed = |schema: &'a Value| {
            let enumerated = schema["enum"].as_array().into_iter().flatten();
            enumerated.filter_map(Value::as_str).map(|word| (word, ""))
        };
        let described = |schema: &'a Value| {
            let about = schema["description"].as_str().unwrap_or_default();
            schema["const"].as_str().map(|word| (word, about))
        };
        std::iter::once(self.schema)
            .chain(self.alternatives())
            .flat_map(|schema| listed(schema).chain(described(schema)))
            .collect()
    }

    fn alternatives(&self) -> impl Iterator<Item = &'a Value> + use<'a> {
        let of = |schema: &'a Value| {
            ["oneOf", "anyOf"]
                .into_iter()
                .filter_map(|key| schema[key].as_array())
                .flatten()
        };
        // An enumeration that may be missing stands one step further in.
        of(self.schema).chain(of(self.schema).flat_map(of))
    }

    /// Parses a text, as typed at a terminal, as JSON of a type that the option allows. Any other
    /// text stays a string, which [`read`] refuses with the reason.
    pub fn parsed(&self, text: &str) -> Value {
        let text = text.trim();
        let number = || {
            let whole = text.parse::<u64>().map(Value::from);
            let real = || text.parse::<f64>().ok().map(Value::from);
            whole.ok().or_else(real).filter(|value| !value.is_null())
        };
        let list = || text.split(',').map(|part| element(part.trim())).collect();
        if self.allows("string") {
            return text.into();
        }
        if (self.allows("number") || self.allows("integer"))
            && let Some(number) = number()
        {
            return number;
        }
        if self.allows("array") {
            return Value::Array(list());
        }
        match text {
            "true" => true.into(),
            "false" => false.into(),
            _ => text.into(),
        }
    }

    /// Whether `value` can be the option's.
    ///
    /// # Errors
    /// What is wrong, and what would be right.
    fn check(&self, value: &Value) -> Result<(), Error> {
        let refuse = |remedy: String| Err(Error::option(self.name, text_of(value), remedy));
        let words = self.words();
        match value {
            Value::String(word) if !words.is_empty() => {
                if words.iter().any(|(known, _)| known == word) {
                    return Ok(());
                }
                let known: Vec<&str> = words.iter().map(|(known, _)| *known).collect();
                refuse(format!("there are {}", known.join(", ")))
            }
            Value::String(_) if self.allows("string") => Ok(()),
            Value::Bool(_) if self.allows("boolean") => Ok(()),
            Value::Array(_) if self.allows("array") => self.check_elements(value),
            Value::Object(_) if self.allows("object") => Ok(()),
            Value::Number(number) => {
                // As 1e3 or 20.0 only where every whole number is a different double.
                let is_exact = |x: f64| x.fract() == 0.0 && x.abs() <= 9_007_199_254_740_992.0;
                let whole =
                    number.is_u64() || number.is_i64() || number.as_f64().is_some_and(is_exact);
                let fits = self.allows("number") || (self.allows("integer") && whole);
                if !fits {
                    return refuse(self.wanted());
                }
                let given = number.as_f64().unwrap_or(f64::NAN);
                if self.in_range(given) {
                    return Ok(());
                }
                let what = format!("{} is out of range", shortest(given));
                Err(Error::option(self.name, what, self.wanted()))
            }
            _ => refuse(self.wanted()),
        }
    }

    fn check_elements(&self, value: &Value) -> Result<(), Error> {
        let items = &self.schema["items"];
        let of = Property {
            name: self.name,
            schema: items,
        };
        let numbers = |error: Error| match items["type"].as_str() {
            Some("number") => error.remedy("numbers are needed, as in 0.1,-0.02,0.3"),
            _ => error,
        };
        if items["type"].is_null() {
            return Ok(());
        }
        value
            .as_array()
            .into_iter()
            .flatten()
            .try_for_each(|element| of.check(element).map_err(numbers))
    }

    fn bound(&self, keys: [&str; 2]) -> Option<(f64, bool)> {
        let inclusive = self.schema[keys[0]].as_f64().map(|bound| (bound, true));
        inclusive.or_else(|| self.schema[keys[1]].as_f64().map(|bound| (bound, false)))
    }

    fn least(&self) -> Option<(f64, bool)> {
        self.bound(["minimum", "exclusiveMinimum"])
    }

    fn most(&self) -> Option<(f64, bool)> {
        self.bound(["maximum", "exclusiveMaximum"])
    }

    fn in_range(&self, value: f64) -> bool {
        let above = |(bound, itself)| value > bound || (itself && value == bound);
        let below = |(bound, itself)| value < bound || (itself && value == bound);
        self.least().is_none_or(above) && self.most().is_none_or(below)
    }

    /// Describes in words what a valid value is.
    fn wanted(&self) -> String {
        let noun = if self.allows("integer") {
            "a whole number"
        } else if self.allows("number") {
            "a number"
        } else if self.allows("boolean") {
            "true or false"
        } else if self.allows("array") {
            "a list"
        } else {
            "a text"
        };
        let range = match (self.least(), self.most()) {
            (Some((low, true)), Some((high, true))) => format!(" from {low} to {high}"),
            (Some((low, _)), Some((high, _))) => format!(" between {low} and {high}"),
            (Some((low, true)), None) => format!(" from {low} on"),
            (Some((low, false)), None) => format!(" above {low}"),
            (None, Some((high, _))) => format!(" up to {high}"),
            (None, None) => String::new(),
        };
        format!("{noun}{range} is needed")
    }
}

/// One of several values separated by commas.
fn element(text: &str) -> Value {
    text.parse::<u64>()
        .map(Value::from)
        .or_else(|_| text.parse::<f64>().map(Value::from))
        .ok()
        .filter(|value| !value.is_null())
        .unwrap_or_else(|| text.into())
}

fn text_of(value: &Value) -> String {
    match value {
        Value::String(text) => format!("`{text}` is not right"),
        Value::Null => "it must be given".into(),
        other => format!("{other} is not right"),
    }
}

/// Reads a request from a JSON object; missing options have their defaults.
///
/// # Errors
/// An option that there is not, with the nearest name; a value of the wrong type or out of
/// range, with what would be right.
pub fn read<R: JsonSchema + DeserializeOwned>(given: Value) -> Result<R, Error> {
    let schema = &*known_schema::<R>();
    let Value::Object(given) = given else {
        return Err(Error::input(
            text_of(&given),
            "an object with the options is needed",
        ));
    };
    // Nothing given is what is left out.
    let given: Map<String, Value> = given.into_iter().filter(|(_, v)| !v.is_null()).collect();
    for (name, value) in &given {
        let Some(property) = properties(schema).find(|property| property.name == name) else {
            let known: Vec<&str> = properties(schema).map(|property| property.name).collect();
            let remedy = match near_name(name, known.iter().copied()) {
                Some(near) => format!("did you mean {{{near}}}?"),
                None => format!("there are {}", known.join(", ")),
            };
            return Err(Error::option(name, "unknown option", remedy));
        };
        property.check(value)?;
    }
    for property in properties(schema).filter(Property::is_required) {
        if !given.contains_key(property.name) {
            return Err(Error::option(
                property.name,
                "it must be given",
                property.description(),
            ));
        }
    }
    let given = whole_numbers(schema, given);
    serde_json::from_value(Value::Object(given.clone())).map_err(|error| {
        // Types of their own say what is wrong with a value, but not where: each is tried alone.
        let culprit = given.iter().find(|(name, value)| {
            let alone = Map::from_iter([((*name).clone(), (*value).clone())]);
            serde_json::from_value::<R>(Value::Object(alone)).is_err()
        });
        let error = Error::new(nanotap_error::ErrorKind::BadInput, error.to_string());
        match culprit {
            Some((name, _)) => error.at(name),
            None => error,
        }
    })
}

/// The schema of a request, made once: that takes longer than many a motion.
fn known_schema<R: JsonSchema>() -> Arc<Schema> {
    static KNOWN: Mutex<BTreeMap<Cow<'static, str>, Arc<Schema>>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let of = known.entry(R::schema_id());
    Arc::clone(of.or_insert_with(|| Arc::new(schema::<R>())))
}

/// Returns the request with whole numbers such as 1e3 or 20.0 written as integers.
fn whole_numbers(schema: &Schema, mut given: Map<String, Value>) -> Map<String, Value> {
    for property in properties(schema).filter(|p| p.allows("integer") && !p.allows("number")) {
        if let Some(value) = given.get_mut(property.name)
            && let Some(number) = value.as_f64().filter(|_| !value.is_u64())
        {
            *value = (number as u64).into();
        }
    }
    given
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemars::JsonSchema;
    use serde::{Deserialize, Serialize};

    /// A request with an option of every kind.
    #[derive(Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    struct Sample {
        /// How many
        #[schemars(range(min = 1, max = 100))]
        count: usize,
        /// A part
        #[schemars(range(min = 0.0, max = 1.0))]
        part: f64,
        /// A row of numbers
        state: Option<Vec<f64>>,
        /// A word
        way: Option<Way>,
    }

    impl Default for Sample {
        fn default() -> Self {
            Self {
                count: 5,
                part: 0.5,
                state: None,
                way: None,
            }
        }
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    enum Way {
        /// To greater values
        Up,
        /// To smaller ones
        Down,
    }

    #[test]
    fn what_is_left_out_has_its_default_and_whole_floats_count() {
        assert_eq!(read::<Sample>(json!({})).unwrap(), Sample::default());
        let given = json!({"count": 1e2, "way": "down", "state": [1, 2.5], "part": null});
        let read: Sample = super::read(given).unwrap();
        assert_eq!(read.part, 0.5);
        assert_eq!(read.count, 100);
        assert_eq!(read.way, Some(Way::Down));
        assert_eq!(read.state, Some(vec![1.0, 2.5]));
    }

    #[test]
    fn refusals_name_the_option_and_what_would_be_right() {
        for (given, words) in [
            (
                json!({"count": 0}),
                "count: 0 is out of range; a whole number from 1 to 100 is needed",
            ),
            (
                json!({"count": 1e9}),
                "count: 1000000000 is out of range; a whole number from 1 to 100 is needed",
            ),
            (
                json!({"count": "x"}),
                "count: `x` is not right; a whole number from 1 to 100 is needed",
            ),
            (
                json!({"count": 1.5}),
                "count: 1.5 is not right; a whole number from 1 to 100 is needed",
            ),
            (
                json!({"part": 2}),
                "part: 2 is out of range; a number from 0 to 1 is needed",
            ),
            (
                json!({"cuont": 2}),
                "cuont: unknown option; did you mean count?",
            ),
            (
                json!({"way": "left"}),
                "way: `left` is not right; there are up, down",
            ),
            (
                json!({"state": ["a"]}),
                "state: `a` is not right; numbers are needed, as in 0.1,-0.02,0.3",
            ),
        ] {
            assert_eq!(read::<Sample>(given).unwrap_err().to_string(), words);
        }
    }

    #[test]
    fn texts_of_the_terminal_become_what_they_stand_for() {
        let schema = schema::<Sample>();
        let parsed = |name: &str, text: &str| {
            properties(&schema)
                .find(|property| property.name == name)
                .unwrap()
                .parsed(text)
        };
        assert_eq!(parsed("count", "7"), json!(7));
        assert_eq!(parsed("part", ".5"), json!(0.5));
        assert_eq!(parsed("state", "1, -2.5"), json!([1, -2.5]));
        assert_eq!(parsed("way", "up"), json!("up"));
    }
}
