//! `nanotap schema`: the declarations agree with options and reports.

use nanotap::study::registry::STUDIES;
use serde_json::Value;

use crate::util::Folder;

fn schema(name: &str) -> Value {
    Folder::new().run(&["schema", name]).json()
}

#[test]
fn a_document_has_the_entries_that_its_schema_declares() {
    let folder = Folder::with_paper_case();
    for study in [
        &["modes"][..],
        &["orbit"],
        &["attractors", "--starts", "6"],
        &["lyapunov", "--periods", "200"],
        &["convergence", "--largest", "2"],
    ] {
        let arguments = [
            &[study[0], "case.toml", "--set", "omega=3", "--json"],
            &study[1..],
        ]
        .concat();
        let document = folder.run(&arguments).json();
        let entries = document.as_object().unwrap();
        let declared = schema(study[0])["report"].take();
        for name in entries.keys() {
            assert!(
                declared["properties"][name].is_object(),
                "{study:?}: {name}"
            );
        }
        for name in declared["required"].as_array().unwrap() {
            assert!(entries.contains_key(name.as_str().unwrap()), "{name}");
        }
    }
}

#[test]
fn a_case_states_its_keys_with_dimension_and_range() {
    let schema = schema("case");
    let frequency = &schema["properties"]["drive"]["properties"]["frequency"];
    assert_eq!(frequency["x-unit"], "Hz");
    assert_eq!(frequency["exclusiveMinimum"], 0);
}

#[test]
fn an_unknown_schema_is_refused_with_the_known_ones() {
    Folder::new()
        .run(&["schema", "orbits"])
        .refused(&["unknown study `orbits`", "orbit", "case"]);
}

/// Units that descriptions name.
const UNITS: [&str; 16] = [
    "m", "N", "J", "W", "s", "Hz", "Pa", "kg", "K", "rad", "m/s", "N/m", "N s/m", "m/V", "1/s",
    "degrees",
];

/// The unit that a description names after a comma or `in`; `None` if there is none, or if the unit depends
/// on the case.
fn described(description: &str) -> Option<&'static str> {
    let names = |unit: &&&str| {
        ["", ".", ";", ",", ":"].iter().any(|end| {
            [", ", " in "].iter().any(|start| {
                let named = format!("{start}{unit}{end}");
                description.ends_with(&named)
                    || !end.is_empty() && description.contains(&format!("{named} "))
            })
        })
    };
    let mut named = UNITS.iter().filter(names);
    let unit = named.next()?;
    (named.next().is_none() && !description.contains("model units")).then_some(unit)
}

/// Numbers whose description names a unit that they do not declare.
fn undeclared(schema: &Value, place: &str, found: &mut Vec<String>) {
    if let Some(parts) = schema.as_object() {
        let is_number = |one: &Value| {
            one["type"] == "number"
                || one["type"]
                    .as_array()
                    .is_some_and(|types| types.contains(&"number".into()))
        };
        let named = schema["description"].as_str().and_then(described);
        if let Some(unit) = named
            && is_number(schema)
            && schema["x-unit"].is_null()
        {
            found.push(format!("{place}: {unit}"));
        }
        for (name, part) in parts {
            undeclared(part, &format!("{place}/{name}"), found);
        }
    }
    for part in schema.as_array().into_iter().flatten() {
        undeclared(part, place, found);
    }
}

#[test]
fn a_number_of_a_report_declares_the_unit_that_its_description_names() {
    assert_eq!(described("Lowest force, N, or none."), Some("N"));
    assert_eq!(described("Amplitude of the base, m, or a force, N."), None);
    assert_eq!(described("Smallest number in use."), None);
    let mut found = Vec::new();
    for study in STUDIES {
        undeclared((study.report)().as_value(), study.name, &mut found);
    }
    assert_eq!(found, Vec::<String>::new());
}
