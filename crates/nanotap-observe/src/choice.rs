//! Parsing of a choice of observables from their names.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::table::{OBSERVABLES, Observable, ObservableSet};
use nanotap_case::near_name::near_name;

impl Serialize for ObservableSet {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter().map(|observable| observable.name))
    }
}

impl<'de> Deserialize<'de> for ObservableSet {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let names = Vec::<String>::deserialize(deserializer)?;
        names.iter().try_fold(Self::NONE, |set, name| {
            let known = OBSERVABLES
                .iter()
                .find(|o| o.name == name || o.si_name == name);
            let known = known.ok_or_else(|| D::Error::custom(unknown(name)))?;
            Ok(set.with(known))
        })
    }
}

fn unknown(name: &str) -> String {
    let names: Vec<&str> = OBSERVABLES.iter().map(|o: &Observable| o.name).collect();
    let hint = near_name(name, names.iter().copied()).map_or_else(
        || format!("; there are {}", names.join(", ")),
        |near| format!("; did you mean `{near}`?"),
    );
    format!("unknown observable `{name}`{hint}")
}

impl JsonSchema for ObservableSet {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Observables".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": "array", "items": {"type": "string"}})
    }
}
