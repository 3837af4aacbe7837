//! Descriptions of the values in a JSON schema.

use serde_json::Value;

/// The type of a value: `number`, `list of text`, a choice of words, another table.
pub(crate) fn kind(schema: &Value) -> String {
    if let Some(name) = schema["$ref"].as_str() {
        let name = name.rsplit('/').next().unwrap_or_default();
        return format!("[{name}](#{})", name.to_lowercase());
    }
    if let Some(word) = schema["const"].as_str() {
        return format!("`{word}`");
    }
    if let Some(words) = schema["enum"].as_array() {
        let words: Vec<String> = words
            .iter()
            .map(|word| format!("`{}`", bare(word)))
            .collect();
        return words.join(", ");
    }
    for choice in ["anyOf", "oneOf"] {
        if let Some(choices) = schema[choice].as_array() {
            let kinds: Vec<String> = choices
                .iter()
                .filter(|schema| schema["type"] != "null")
                .map(kind)
                .collect();
            return kinds.join(" or ");
        }
    }
    let types = match &schema["type"] {
        Value::String(name) => vec![name.as_str()],
        Value::Array(names) => names.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    let kinds: Vec<String> = types
        .into_iter()
        .filter(|&name| name != "null")
        .map(|name| match name {
            "array" => match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
                (Some(least), Some(most)) if least == most => {
                    format!("{least} {}", several(&kind(&schema["items"])))
                }
                _ => format!("list of {}", several(&kind(&schema["items"]))),
            },
            "string" => "text".to_owned(),
            "boolean" => "true or false".to_owned(),
            other => other.to_owned(),
        })
        .collect();
    if kinds.is_empty() {
        return "any".to_owned();
    }
    kinds.join(" or ")
}

/// The plural of a kind.
fn several(kind: &str) -> String {
    match kind.split_once(' ') {
        Some(("list", rest)) => format!("lists {rest}"),
        None if kind.chars().all(char::is_alphabetic) => format!("{kind}s"),
        _ => kind.to_owned(),
    }
}

/// The range of allowed values.
pub(crate) fn range(schema: &Value) -> String {
    if let (Some(_), Some(_)) = (schema["minimum"].as_f64(), schema["maximum"].as_f64()) {
        return format!(
            "{} … {}",
            bound(&schema["minimum"]),
            bound(&schema["maximum"])
        );
    }
    let bounds = [
        ("minimum", "≥"),
        ("exclusiveMinimum", ">"),
        ("maximum", "≤"),
        ("exclusiveMaximum", "<"),
    ];
    let given = bounds.iter().filter(|(name, _)| !schema[*name].is_null());
    let words: Vec<String> = given
        .map(|(name, sign)| format!("{sign} {}", bound(&schema[*name])))
        .collect();
    words.join(", ")
}

/// A bound as text; the smallest positive number stands for "above zero".
fn bound(value: &Value) -> String {
    match value.as_f64() {
        Some(f64::MIN_POSITIVE) => "0".to_owned(),
        Some(number) if number != 0.0 && number.abs() >= 1e6 => format!("{number:e}"),
        _ => bare(value),
    }
}

/// Formats a JSON value without quotes.
pub(crate) fn bare(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        Value::Array(items) if items.is_empty() => "none".to_owned(),
        other => other.to_string(),
    }
}

/// The description of a value.
pub(crate) fn meaning(schema: &Value) -> String {
    schema["description"]
        .as_str()
        .unwrap_or_default()
        .to_owned()
}
