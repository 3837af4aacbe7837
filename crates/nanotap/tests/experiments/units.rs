//! Every study of the registry answers a physical case in SI: each object of its JSON that holds
//! an observable with a dimension in the model's units also holds it in SI.

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::observe::table::OBSERVABLES;
use nanotap::study::registry::STUDIES;
use serde_json::{Value, json};

/// A lever on a spring and damper: one mode, so that every study is quick.
fn lever() -> Case {
    let words = [
        "cantilever.k=2.8 N/m",
        "cantilever.f0=75 kHz",
        "cantilever.Q=200",
        "sample.stiffness=20 N/m",
        "sample.loss_tangent=0.1",
        "drive.actuation=tip",
        "drive.frequency=75 kHz",
        "drive.free_amplitude=20 nm",
        "gap.tip=15 nm",
        "modes=1",
    ];
    Case::parse(None, &words.map(str::to_owned)).unwrap()
}

/// A request that shows as much as the study can; `None` of studies whose answers are not about
/// motions of this case.
fn request(study: &str) -> Option<Value> {
    Some(match study {
        "attractors" => json!({"starts": 20, "unstable": 2}),
        "branch" => json!({"parameter": "gap.tip", "from": "30 nm", "to": "10 nm"}),
        "approach" => json!({"points": 6}),
        "fm" => json!({"points": 3, "from": "25 nm", "to": "19 nm"}),
        "convergence" => json!({"largest": 2}),
        // Their columns are those of the data, and their units are given with them.
        "fit" | "reconstruct" | "image-states"
        // In SI as a whole.
        | "bimodal" | "force-curve" | "lever" => return None,
        _ => json!({}),
    })
}

/// Places of objects that hold observables in the model's units only.
fn without_si(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Array(entries) => {
            for entry in entries {
                without_si(entry, &format!("{path}[]"), found);
            }
        }
        Value::Object(entries) => {
            // The loop's settings, whose free motion is in SI above; numbers of modes and
            // relative differences by the observable's name.
            let by_name = [
                "fm.modulation",
                "convergence.enough_readings",
                "convergence.reading_differences[]",
            ];
            if by_name.contains(&path) {
                return;
            }
            let physical = entries.get("physical").or(entries.get("modulation_si"));
            for observable in OBSERVABLES {
                let in_model = entries.get(observable.name).is_some_and(Value::is_number);
                let in_si = physical.and_then(|physical| physical.get(observable.si_name));
                if in_model && observable.dimension.kind().is_some() && in_si.is_none() {
                    found.push(format!("{path}.{}", observable.name));
                }
            }
            for (name, entry) in entries {
                // The case has its own, and derivatives are by one key each.
                if !["physical", "modulation_si", "case", "derivatives"].contains(&name.as_str()) {
                    without_si(entry, &format!("{path}.{name}"), found);
                }
            }
        }
        _ => {}
    }
}

#[test]
fn every_motion_of_every_study_is_told_in_si() {
    let case = lever();
    for study in STUDIES {
        let (Some(run), Some(request)) = (study.answer, request(study.name)) else {
            continue;
        };
        let answer = match run(&case, request, &Control::default()) {
            Ok(answer) => answer,
            // A scan needs its table in the case.
            Err(error) if error.to_string().contains("[scan]") => continue,
            Err(error) => panic!("{}: {error}", study.name),
        };
        let mut found = Vec::new();
        for frame in answer.frames() {
            let csv = frame.csv();
            let widths: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
            assert_eq!(
                widths.len(),
                frame.rows + 1,
                "{} {}",
                study.name,
                frame.name
            );
            assert!(widths.iter().all(|width| *width == widths[0]), "{csv}");
            let shown = frame.shown_columns();
            assert!(!shown.is_empty(), "{} {}", study.name, frame.name);
        }
        let answer: Value = serde_json::from_str(&answer.document().unwrap()).unwrap();
        without_si(&answer, study.name, &mut found);
        found.sort();
        found.dedup();
        assert_eq!(found, Vec::<String>::new());
    }
}

/// A number without a unit is in SI in every option that takes a quantity.
#[test]
fn numbers_without_a_unit_are_in_si() {
    let case = lever();
    let ask = |study: &str, request: Value| -> Value {
        let entry = nanotap::study::registry::study(study).unwrap();
        let text = entry.document(&case, request, &Control::default()).unwrap();
        serde_json::from_str(&text).unwrap()
    };
    for (study, bare, quantity) in [
        (
            "approach",
            json!({"points": 3, "branches": false, "from": 25e-9, "to": 5e-9}),
            json!({"points": 3, "branches": false, "from": "25 nm", "to": "5 nm"}),
        ),
        (
            "branch",
            json!({"parameter": "gap.tip", "from": 15e-9, "to": 18e-9}),
            json!({"parameter": "gap.tip", "from": "15 nm", "to": "18 nm"}),
        ),
        (
            "fm",
            json!({"points": 3, "from": 25e-9, "to": 19e-9, "shift": 20.0}),
            json!({"points": 3, "from": "25 nm", "to": "19 nm", "shift": "20 Hz"}),
        ),
        (
            "attractors",
            json!({"starts": 5, "box": ["a1=-1e-9:1e-9", "v1=-1e-3:1e-3"]}),
            json!({"starts": 5, "box": {"a1": ["-1 nm", "1 nm"], "v1": ["-1 mm/s", "1 mm/s"]}}),
        ),
    ] {
        assert_eq!(ask(study, bare), ask(study, quantity), "{study}");
    }
}

/// The distances of curves of different levers are the requested ones, to the bit.
#[test]
fn levers_have_the_same_distances() {
    let distances = |case: &Case| -> Vec<f64> {
        let entry = nanotap::study::registry::study("approach").unwrap();
        let request = json!({"points": 13, "branches": false, "from": "30 nm", "to": "1 nm"});
        let text = entry.document(case, request, &Control::default()).unwrap();
        let answer: Value = serde_json::from_str(&text).unwrap();
        let rows = answer["table"].as_array().unwrap();
        rows.iter().map(|row| row["zc"].as_f64().unwrap()).collect()
    };
    let case = lever();
    let other = case.with(case.key("cantilever.k").unwrap(), 3.1);
    let other = other.with(other.key("gap.beam").unwrap(), 7.3e-6);
    let expected = distances(&case);
    assert_eq!(distances(&other), expected);
    assert_eq!(expected[0], 30e-9);
    assert_eq!(expected[12], 1e-9);
}
