//! For any input a study gives a result or an error: no panic, and no allocation of unchecked size.

use nanotap::case::Case;
use nanotap::control::{CancelFlag, Control};
use nanotap::study::registry::{STUDIES, StudyEntry, study};
use nanotap::study::request::properties;
use proptest::prelude::*;
use serde_json::{Value, json};

const PAPER: [&str; 7] = [
    "modes=2",
    "alpha1=0.1",
    "alpha2=0.1",
    "alpha3=0.1",
    "alpha4=20",
    "alpha6=0.2",
    "omega=2.6",
];

/// Runs a study, cancelled before its first step; returns the error message if it refuses.
fn run(study: &StudyEntry, case: &Case, request: Value) -> Result<(), String> {
    let stop = CancelFlag::new();
    stop.cancel();
    let control = Control {
        cancel: Some(&stop),
        progress: None,
    };
    match (study.answer, study.dataset) {
        (Some(run), _) => run(case, request, &control).map(drop),
        (None, Some(plan)) => plan(case, request, &control).map(drop),
        (None, None) => Ok(()),
    }
    .map_err(|error| error.to_string())
}

/// Every count has a largest value, which the error message names.
#[test]
fn every_count_has_a_limit_that_its_error_names() {
    let case = Case::parse(None, &PAPER.map(str::to_owned)).unwrap();
    for study in STUDIES {
        let schema = (study.request)();
        for property in properties(&schema).filter(|p| p.allows("integer") && !p.allows("number")) {
            // A seed is not a count.
            if property.name == "seed" {
                continue;
            }
            let limit = property.schema["maximum"].as_f64();
            let limit = limit.unwrap_or_else(|| panic!("{} {}", study.name, property.name));
            for given in [json!(limit + 1.0), json!(1e18), json!(u64::MAX), json!(-1)] {
                let request = json!({ property.name: given });
                let refusal = run(study, &case, request).unwrap_err();
                assert!(
                    refusal.starts_with(property.name) && refusal.contains(&limit.to_string()),
                    "{}: {refusal}",
                    study.name
                );
            }
        }
    }
}

/// A number of any size, in most cases an invalid one.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => (-9.0..3.0_f64).prop_map(|digits| 10_f64.powf(digits)),
        1 => prop::sample::select(vec![0.0, -0.0, -1.0, 1e308, 5e-324, 1e-300, f64::MAX, 1e12]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Numbers of a case of any size: a run of few periods, a table of modes, an orbit.
    #[test]
    fn no_number_of_a_case_breaks_a_study(
        modes in 1..7_usize,
        numbers in prop::array::uniform6(number()),
        omega in prop_oneof![4 => 1.0..1e4_f64, 1 => number()],
        contact in prop::sample::select(vec!["", "kelvin-voigt", "moving-surface"]),
        state in prop::option::of(number()),
    ) {
        // A motion that decays or oscillates a million times per drive period takes too long to
        // compute here.
        prop_assume!(!(1e-300..0.5).contains(&omega) && numbers[2] < 1.0);
        let mut words = vec![format!("modes={modes}"), format!("omega={omega:e}")];
        for (k, value) in numbers.iter().enumerate() {
            words.push(format!("alpha{}={value:e}", k + 1));
        }
        if !contact.is_empty() {
            words.push(format!("contact={contact}"));
        }
        let Ok(case) = Case::parse(None, &words) else {
            return Ok(());
        };
        let state = state.map(|value| vec![value; 2 * modes]);
        let requests = [
            ("modes", json!({"points": 5})),
            ("simulate", json!({"periods": 2, "transient": 1, "state": state, "max_period": 2})),
            ("lyapunov", json!({"periods": 2, "transient": 1})),
            ("attractors", json!({"starts": 1, "max_period": 2})),
        ];
        for (name, request) in requests {
            // A result or an error, but it returns.
            let _ = run(study(name).unwrap(), &case, request);
        }
    }
}
