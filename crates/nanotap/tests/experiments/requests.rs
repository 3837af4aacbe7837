//! Requests as a browser or a script may send them: every study refuses an invalid request with a
//! reason that names it.

use nanotap::case::Case;
use nanotap::control::{CancelFlag, Control};
use nanotap::study::registry::STUDIES;
use nanotap::{Error, ErrorKind};
use proptest::prelude::*;
use serde_json::{Value, json};

/// Values that are invalid for every option.
fn hostile() -> impl Strategy<Value = Value> {
    prop::sample::select(vec![
        json!(-1),
        json!(0.5),
        json!(1e308),
        json!(-1e18),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(""),
        json!("nan"),
        json!("inf"),
        json!("a1=1:2:18446744073709551615"),
        json!("\u{0}\u{202e}"),
        json!([null]),
        json!([[[]]]),
        json!({"": {"": 1e308}}),
        json!("x".repeat(100_000)),
    ])
}

fn run(at: usize, request: Value) -> Result<(), Error> {
    // Long computations are cancelled before they start.
    let stop = CancelFlag::new();
    stop.cancel();
    let control = Control {
        cancel: Some(&stop),
        progress: None,
    };
    let words = "modes=1 alpha1=0.1 alpha2=0.1 alpha3=0.1 alpha4=20 alpha6=0.2 omega=20";
    let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
    let case = Case::parse(None, &words).unwrap();
    let study = &STUDIES[at];
    if let Some(plan) = study.dataset {
        plan(&case, request.clone(), &control).map(drop)?;
    }
    let run = study.answer;
    run.map_or(Ok(()), |run| run(&case, request, &control).map(drop))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn options_with_hostile_values(
        at in 0..STUDIES.len(), option in 0..64_usize, value in hostile(),
    ) {
        let schema = (STUDIES[at].request)();
        let names: Vec<String> = schema.get("properties").and_then(Value::as_object)
            .map(|properties| properties.keys().cloned().collect()).unwrap_or_default();
        prop_assume!(!names.is_empty());
        let name = &names[option % names.len()];
        let mut request = serde_json::Map::new();
        request.insert(name.clone(), value);
        if let Err(error) = run(at, Value::Object(request)) {
            let text = error.to_string();
            prop_assert!(!text.is_empty() && text.len() < 5_000, "{}", text.len());
        }
    }

    #[test]
    fn invalid_requests_are_refused(at in 0..STUDIES.len(), value in hostile()) {
        let error = run(at, value).unwrap_err();
        prop_assert_eq!(error.kind, ErrorKind::BadInput);
    }
}
