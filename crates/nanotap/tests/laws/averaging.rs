//! Orbits from averaging, and the approximate map, on reference cases.
//!
//! `tests/reference/census` contains cases and their orbits, closed by the exact flow, from a
//! census with an independent program.

use nanotap::case::Case;
use nanotap::case::file::Source;
use nanotap::model::Model;
use nanotap::model::model_map::ModelMap;
use nanotap::study::averaged_orbits::averaged_orbits;
use nanotap_dynamics::{Scheduling as _, StroboscopicMap};
use std::path::Path;

/// The cases of the folder with their expected orbits.
pub(crate) fn cases() -> Vec<(String, Model, serde_json::Value)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/census");
    let read = |name: &Path| std::fs::read_to_string(name).unwrap();
    let mut names: Vec<_> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|end| end == "toml"))
        .collect();
    names.sort();
    let case = |path: &std::path::PathBuf| {
        let expected = read(&path.with_extension("expected.json"));
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let source = Source {
            name: name.clone(),
            text: read(path),
        };
        let case = Case::parse(Some(source), &[]).unwrap();
        let model = case.model().unwrap();
        (name, model, serde_json::from_str(&expected).unwrap())
    };
    names.iter().map(case).collect()
}

pub(crate) fn numbers(value: &serde_json::Value) -> Vec<f64> {
    let values = value.as_array().unwrap().iter();
    values.map(|v| v.as_f64().unwrap()).collect()
}

#[test]
fn averaging_finds_every_period_1_orbit() {
    let cases = cases();
    assert_eq!(cases.len(), 11);
    for (name, model, expected) in cases {
        let orbits = averaged_orbits(&model);
        for expected in expected["orbits"].as_array().unwrap() {
            if expected["period"] != 1 {
                continue;
            }
            let state = numbers(&expected["state"]);
            let scale = state.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let found = orbits.iter().find(|orbit| {
                let pairs = orbit.states[0].iter().zip(&state);
                pairs.fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) < 1e-6 * scale
            });
            let Some(orbit) = found else {
                panic!("{name}: no orbit at {state:?}");
            };
            assert_eq!(orbit.is_stable(), expected["stable"], "{name}");
            let largest = expected["largest_multiplier"].as_f64().unwrap();
            let radius = orbit.spectral_radius();
            assert!(
                (radius - largest).abs() < 1e-6 * largest,
                "{name}: {radius} {largest}"
            );
        }
    }
}

/// Starting on an orbit, the approximate map stays on it within its error.
#[test]
fn the_approximate_map_preserves_orbits() {
    for (name, model, expected) in cases() {
        let mut exact = ModelMap::new(&model);
        let mut coarse = exact.coarse().unwrap();
        assert!(coarse.coarse().is_none());
        for expected in expected["orbits"].as_array().unwrap() {
            let mut state = numbers(&expected["state"]);
            state.resize(coarse.dimension(), 0.0);
            let scale = state.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let (mut end, mut near) = (state.clone(), state);
            exact.advance(&mut end).unwrap();
            coarse.advance(&mut near).unwrap();
            let pairs = near.iter().zip(&end);
            let off = pairs.fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / scale;
            assert!(off < 1e-4, "{name}: {off:.1e}");
        }
    }
}
