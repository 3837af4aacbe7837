//! TOML values as JSON, for the tables of a case file that are options of a study.

use serde_json::{Map, Value};
use toml::de::{DeTable, DeValue};

/// A TOML value as JSON; a date is its text.
pub(super) fn json(value: &DeValue<'_>) -> Value {
    match value {
        DeValue::String(text) => text.as_ref().into(),
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
            .map_or_else(|_| number(integer.as_str()), Value::from),
        DeValue::Float(float) => number(float.as_str()),
        DeValue::Boolean(value) => (*value).into(),
        DeValue::Datetime(date) => date.to_string().into(),
        DeValue::Array(array) => array.iter().map(|value| json(value.get_ref())).collect(),
        DeValue::Table(inner) => Value::Object(table(inner)),
    }
}

/// A number; one that JSON does not have as its text.
fn number(text: &str) -> Value {
    let parsed = text.parse().ok().and_then(serde_json::Number::from_f64);
    parsed.map_or_else(|| text.into(), Value::Number)
}

/// A TOML table as JSON.
pub(super) fn table(table: &DeTable<'_>) -> Map<String, Value> {
    let each = table.iter();
    each.map(|(key, value)| (key.get_ref().to_string(), json(value.get_ref())))
        .collect()
}

/// Puts a value at a path of names separated by dots; none takes it away.
pub(super) fn put(table: &mut Map<String, Value>, path: &str, value: Option<Value>) {
    let Some((name, rest)) = path.split_once('.') else {
        match value {
            Some(value) => table.insert(path.trim().to_owned(), value),
            None => table.remove(path.trim()),
        };
        return;
    };
    let inner = table
        .entry(name.trim())
        .or_insert_with(|| Value::Object(Map::new()));
    if !inner.is_object() {
        *inner = Value::Object(Map::new());
    }
    if let Value::Object(inner) = inner {
        put(inner, rest, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_leads_into_tables() {
        let mut table = Map::new();
        put(&mut table, "lock_in.order", Some(2.into()));
        put(&mut table, "lines", Some(3.into()));
        put(&mut table, "lock_in.time_constant", Some("1 us".into()));
        put(&mut table, "lock_in.order", None);
        let expected = serde_json::json!({"lock_in": {"time_constant": "1 us"}, "lines": 3});
        assert_eq!(Value::Object(table), expected);
    }
}
