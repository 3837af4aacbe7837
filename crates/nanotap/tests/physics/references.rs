//! States and event times against 50-digit references: `tests/reference/*.json`, made
//! with mpmath at 60 digits by two independent methods (eigenbasis and Taylor series).

use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap_dynamics::StroboscopicMap;
use nanotap_flow::Trajectory;
use serde_json::Value;

fn reference(name: &str) -> Value {
    let path = format!("{}/tests/reference/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_str().unwrap().parse().unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn case_of(reference: &Value) -> Cantilever {
    let alpha = |k: &str| number(&reference["alpha"][k]);
    Cantilever {
        modes: reference["N"].as_u64().unwrap() as usize,
        alpha1: alpha("1"),
        alpha2: alpha("2"),
        alpha3: alpha("3"),
        alpha4: alpha("4"),
        alpha5: alpha("5"),
        alpha6: alpha("6"),
        omega: number(&reference["Omega"]),
        ..Cantilever::paper()
    }
}

/// Largest errors of states and event times over the first 20 periods from rest.
fn errors(name: &str) -> (f64, f64) {
    let reference = reference(name);
    let model = Model::cantilever(&case_of(&reference)).unwrap();
    let trajectory = Trajectory::record(&model.system, &vec![0.0; model.dimension()], 20).unwrap();
    let mut worst_state: f64 = 0.0;
    let mut map = ModelMap::new(&model);
    let mut state = vec![0.0; model.dimension()];
    for k in 1..=20 {
        map.advance(&mut state).unwrap();
        if let Some(expected) = reference["states"].get(k.to_string()) {
            let mut expected_state = numbers(&expected["a"]);
            expected_state.extend(numbers(&expected["adot"]));
            for (got, expected) in state.iter().zip(expected_state) {
                worst_state = worst_state.max((got - expected).abs());
            }
        }
    }
    let events = reference["events"].as_array().unwrap();
    assert_eq!(
        trajectory.events().len(),
        events.len(),
        "{name}: number of switches"
    );
    let mut worst_time: f64 = 0.0;
    for (got, expected) in trajectory.events().iter().zip(events) {
        worst_time = worst_time.max((got.time - number(&expected["tau"])).abs());
        let kind = if got.to == 1 {
            "contact_start"
        } else {
            "contact_end"
        };
        assert_eq!(expected["kind"], kind);
    }
    (worst_state, worst_time)
}

/// Chaotic: errors grow by 240 in 20 periods. Required: 1e-9 and 1e-11.
#[test]
fn chaotic_run_at_omega_2_6() {
    let (state, time) = errors("W1_Om2.6_N3");
    assert!(state < 1e-12, "state error {state:e}");
    assert!(time < 1e-12, "event error {time:e}");
}

/// Undamped, Eq. (24).
#[test]
fn undamped_runs_of_eq_24() {
    for name in ["eq24_Om4.1_N1", "eq24_Om4.1_N3"] {
        let (state, time) = errors(name);
        assert!(state < 1e-11, "{name}: state error {state:e}");
        assert!(time < 1e-11, "{name}: event error {time:e}");
    }
}

/// Regular motion for 200 periods and 400 switches at Ω = 3.5. Required: 1e-10.
#[test]
fn regular_run_of_200_periods() {
    let reference = reference("regular_Om3.5_long200");
    let case = Cantilever {
        omega: 3.5,
        ..Cantilever::paper()
    };
    let model = Model::cantilever(&case).unwrap();
    let trajectory = Trajectory::record(&model.system, &[0.0; 6], 200).unwrap();
    let mut map = ModelMap::new(&model);
    let mut state = vec![0.0; 6];
    for k in 1..=200 {
        map.advance(&mut state).unwrap();
        for (got, expected) in state
            .iter()
            .zip(numbers(&reference["states"][k.to_string()]))
        {
            assert!(
                (got - expected).abs() < 1e-12,
                "period {k}: {got} {expected}"
            );
        }
    }
    let events = numbers(&reference["events"]);
    assert_eq!(events.len(), trajectory.events().len());
    for (got, expected) in trajectory.events().iter().zip(events) {
        assert!((got.time - expected).abs() < 1e-11);
    }
}
