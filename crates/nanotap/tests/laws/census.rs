//! Default censuses, compared with motions that independent programs found.

use nanotap::case::Case;
use nanotap::control::Control;
use nanotap::study::attractors::{
    Attractors, AttractorsOptions, AttractorsStudy, EndReport, attractors,
};
use nanotap::study::registry::Study as _;
use serde_json::Value;

use crate::averaging::{cases, numbers};

/// Largest relative distance between equal orbits.
const ORBIT_TOLERANCE: f64 = 1e-6;

fn has_orbit(found: &Attractors, expected: &Value) -> bool {
    let state = numbers(&expected["state"]);
    let scale = state.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let is_there = |other: &Vec<f64>| {
        let apart = state.iter().zip(other).map(|(a, b)| (a - b).abs());
        apart.fold(0.0, f64::max) < ORBIT_TOLERANCE * scale
    };
    let mut orbits = found.attractors.iter().filter_map(|a| a.orbit.as_ref());
    orbits.any(|orbit| expected["period"] == orbit.period && orbit.states.iter().any(is_there))
}

/// Every stable orbit of the reference cases is found, including the attractive state of c08, whose
/// basin contains less than 0.1 % of the starts, and the periods 8 and 18 of c06. Cases whose
/// census takes more than a second are left out; averaging alone finds their orbits.
#[test]
fn nonlinear_censuses_find_the_expected_orbits() {
    for (name, model, expected) in cases() {
        if ["c03", "c04", "c11"]
            .iter()
            .any(|slow| name.starts_with(slow))
        {
            continue;
        }
        let options = AttractorsOptions::default();
        let found = attractors(&model, &options, &Control::default()).unwrap();
        let orbits = expected["orbits"].as_array().unwrap().iter();
        for orbit in orbits.filter(|orbit| orbit["stable"] == true) {
            assert!(
                has_orbit(&found, orbit),
                "{name}: no period {}",
                orbit["period"]
            );
        }
        let unseen = found.unseen.unwrap();
        assert!(unseen.target == 0.01 && unseen.fraction <= 0.01, "{name}");
        assert_eq!(found.end, EndReport::BoundMet, "{name}");
        assert!(found.followed_at.is_some(), "{name}");
    }
}

/// Default censuses of random piecewise-linear cases (`tests/reference/census_linear.json`): every
/// motion was confirmed by an independent program. Cases that take more than half a second are left
/// out.
#[test]
fn piecewise_linear_censuses_find_the_expected_motions() {
    let text = include_str!("../reference/census_linear.json");
    let reference: Value = serde_json::from_str(text).unwrap();
    for (number, case) in reference["cases"].as_array().unwrap().iter().enumerate() {
        if [1, 3, 9, 13].contains(&number) {
            continue;
        }
        let keys = case["set"].as_object().unwrap().iter();
        let keys: Vec<String> = keys.map(|(key, value)| format!("{key}={value}")).collect();
        let case_of_keys = Case::parse(None, &keys).unwrap();
        let options = AttractorsOptions::default();
        let found = AttractorsStudy::run(&case_of_keys, &options, &Control::default()).unwrap();
        assert!(found.followed_at.is_none());
        let motions = case["motions"].as_array().unwrap();
        assert!(found.attractors.len() >= motions.len(), "{number}");
        for motion in motions {
            let tip = motion["tip_max"].as_f64().unwrap();
            let share = motion["share"].as_f64().unwrap();
            let mut attractors = found.attractors.iter();
            let there = attractors.any(|a| {
                a.orbit.as_ref().is_some_and(|orbit| {
                    motion["period"] == orbit.period
                        && (orbit.observables.tip_max / tip - 1.0).abs() < 1e-5
                        && (a.share.fraction - share).abs() < 0.02
                })
            });
            assert!(there, "{number}: no {motion}");
        }
    }
}
