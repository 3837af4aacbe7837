//! `nanotap schema`: the declarations agree with options and reports.

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
