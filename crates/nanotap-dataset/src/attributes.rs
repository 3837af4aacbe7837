//! Attributes that identify a dataset, and the differences between two sets of them.

use serde::Serialize;
use serde_json::Value;

use super::schema::Attributes;
use nanotap_case::Case;

/// The first attributes of every dataset: title, kind, the program's version, and the case as JSON
/// text (which every file format can store).
pub fn of_case(title: &str, kind: &str, case: &Case) -> Attributes {
    let mut attributes = Attributes::new();
    attributes.insert("Conventions".into(), "CF-1.11".into());
    attributes.insert("title".into(), title.into());
    attributes.insert("kind".into(), kind.into());
    attributes.insert("nanotap_version".into(), env!("CARGO_PKG_VERSION").into());
    // The last digits of results depend on the arithmetic: chunks of different versions are not
    // mixed.
    attributes.insert("arithmetic".into(), nanotap_arithmetic::VERSION.into());
    attributes.insert("case".into(), text(case));
    attributes
}

/// Converts `value` to JSON text for an attribute.
pub fn text(value: &impl Serialize) -> Value {
    serde_json::to_string(value).unwrap_or_default().into()
}

/// Lists the differences between two sets of attributes, one per key: `omega: 2.6 there, 3 here`.
/// JSON texts are compared entry by entry.
pub fn differences(there: &Value, here: &Value) -> Vec<String> {
    let mut found = Vec::new();
    compare("", there, here, &mut found);
    found
}

fn compare(path: &str, there: &Value, here: &Value, found: &mut Vec<String>) {
    let (there, here) = (&opened(there), &opened(here));
    if there == here {
        return;
    }
    let (Value::Object(a), Value::Object(b)) = (there, here) else {
        found.push(format!(
            "{path}: {} there, {} here",
            short(there),
            short(here)
        ));
        return;
    };
    let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
    keys.sort();
    keys.dedup();
    for key in keys {
        let path = if path.is_empty() {
            key.clone()
        } else {
            format!("{path}.{key}")
        };
        let missing = Value::Null;
        compare(
            &path,
            a.get(key).unwrap_or(&missing),
            b.get(key).unwrap_or(&missing),
            found,
        );
    }
}

/// Parses JSON text in an attribute; other values are returned unchanged.
fn opened(value: &Value) -> Value {
    match value {
        Value::String(text) if text.starts_with(['{', '[']) => {
            serde_json::from_str(text).unwrap_or_else(|_| value.clone())
        }
        _ => value.clone(),
    }
}

fn short(value: &Value) -> String {
    /// Most characters of a value that a message repeats.
    const LONGEST: usize = 60;
    if value.is_null() {
        return "nothing".into();
    }
    let text = value.to_string();
    if text.chars().count() <= LONGEST {
        return text;
    }
    format!("{} …", text.chars().take(LONGEST).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn differences_name_the_key_inside_json_text() {
        let there = json!({"case": "{\"omega\":2.6,\"modes\":3}", "seed": 1});
        let here = json!({"case": "{\"omega\":3.0,\"modes\":3}", "seed": 1, "starts": 8});
        assert_eq!(
            differences(&there, &here),
            [
                "case.omega: 2.6 there, 3.0 here",
                "starts: nothing there, 8 here"
            ]
        );
        assert!(differences(&there, &there).is_empty());
    }
}
