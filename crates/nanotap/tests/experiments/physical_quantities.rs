//! Variation of quantities of a physical case.

use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::model::parameter::Parameter;
use nanotap::study::branch::{BranchOptions, branch};
use nanotap_dynamics::{DMatrix, MapFamily as _, StroboscopicMap as _};

use crate::approach::{STIFF, studied};

fn varied(lever: &Case, key: &str, text: &str) -> (Key, f64) {
    let key = lever.key(key).unwrap();
    (key, lever.value(key, text).unwrap())
}

/// A value that is set is the same as in a case file. The drive that follows from the free
/// amplitude is that at the case's own frequency.
#[test]
fn a_quantity_set_is_the_case_with_that_quantity() {
    let lever = studied(STIFF, &[]);
    let base = lever.physical().unwrap();
    for (key, text, set) in [
        ("cantilever.Q", "300", "cantilever.Q=300"),
        ("sample.loss_tangent", "0.3", "sample.loss_tangent=0.3"),
        ("tip.radius", "20 nm", "tip.radius=20 nm"),
        ("gap.tip", "18 nm", "gap.tip=18 nm"),
        (
            "drive.free_amplitude",
            "30 nm",
            "drive.free_amplitude=30 nm",
        ),
    ] {
        let (key, value) = varied(&lever, key, text);
        let found = lever.with(key, value);
        let expected = studied(STIFF, &[set]);
        let (found, expected) = (found.cantilever().unwrap(), expected.cantilever().unwrap());
        for parameter in [
            Parameter::Alpha1,
            Parameter::Alpha4,
            Parameter::Alpha6,
            Parameter::Omega,
        ] {
            let (a, b) = (found.get(parameter), expected.get(parameter));
            assert!(
                (a - b).abs() <= 1e-12 * b.abs(),
                "{set}: {parameter} {a} {b}"
            );
        }
        // In units of g0, which is constant; the free amplitude is that of the case file unless the
        // lever itself changes.
        if set.starts_with("cantilever") {
            assert_eq!(found.alpha2.to_bits(), base.cantilever.alpha2.to_bits());
        } else {
            let ratio = found.alpha2 / expected.alpha2;
            let gaps = found.alpha5 / expected.alpha5;
            assert!((ratio / gaps - 1.0).abs() < 1e-9, "{set}: {ratio} {gaps}");
        }
    }
    let (key, value) = varied(&lever, "drive.frequency", "340 kHz");
    let found = lever.with(key, value);
    let found = found.cantilever().unwrap();
    assert!((found.alpha2 / base.cantilever.alpha2 - 1.0).abs() < 1e-12);
    assert!((found.omega / base.cantilever.omega - 340.0 / (330.0 * 1.001)).abs() < 1e-9);
    // The damper of a loss tangent changes with the frequency.
    assert!(
        (found.alpha6 * found.omega / (base.cantilever.alpha6 * base.cantilever.omega) - 1.0).abs()
            < 1e-9
    );
}

/// The derivative of the map with respect to a quantity, including everything that depends on it,
/// compared with central differences of the map.
#[test]
fn derivatives_include_everything_that_depends_on_a_quantity() {
    let lever = studied(STIFF, &[]);
    for (name, text) in [
        ("drive.frequency", "330.5 kHz"),
        ("cantilever.k", "40 N/m"),
        ("cantilever.f0", "329 kHz"),
        ("gap.tip", "15 nm"),
        ("sample.damping", "1e-6 N s/m"),
        ("drive.free_amplitude", "25 nm"),
    ] {
        let (key, value) = varied(&lever, name, text);
        let family = lever.family(key);
        let start = vec![-1.2e-3, 1e-5, 1e-4, 0.0];
        let mut state = start.clone();
        let (mut jacobian, mut found) = (DMatrix::zeros(4, 4), vec![0.0; 4]);
        let mut map = family.at(value).unwrap();
        family
            .advance_with_derivatives(value, &mut map, &mut state, &mut jacobian, &mut found)
            .unwrap();
        let step = 1e-6 * value;
        let at = |value: f64| {
            let mut state = start.clone();
            family.at(value).unwrap().advance(&mut state).unwrap();
            state
        };
        let (low, high) = (at(value - step), at(value + step));
        // The derivative by a quantity without effect (f0, if the drive is relative to it) is zero
        // to the rounding of the states.
        let floor = 1e-3 * 1.2e-3 / value;
        let size = found.iter().fold(floor, |s: f64, v| s.max(v.abs()));
        for k in 0..4 {
            let expected = (high[k] - low[k]) / (2.0 * step);
            assert!(
                (found[k] - expected).abs() < 2e-5 * size,
                "{name}: {found:?} {expected}"
            );
        }
    }
}

/// A fold along `gap.tip` in metres is the one along α5, times g0.
#[test]
fn a_branch_in_metres_is_the_branch_in_the_models_units() {
    let lever = studied(STIFF, &[]);
    let g0 = lever.physical().unwrap().scales.length;
    let folds = |subject: &Case, key: Key, unit: f64| -> Vec<f64> {
        let options = BranchOptions {
            period: Some(1),
            ..BranchOptions::over(key, 24e-9 / unit, 10e-9 / unit)
        };
        let report = branch(subject, &options, &Control::default()).unwrap();
        report
            .bifurcations
            .iter()
            .filter(|b| b.kind == "fold")
            .map(|b| b.parameter * unit)
            .collect()
    };
    let (key, _) = varied(&lever, "gap.tip", "24 nm");
    let found = folds(&lever, key, 1.0);
    let expected = folds(&lever, lever.gap_key(), g0);
    assert_eq!(found.len(), 2);
    for (a, b) in found.iter().zip(&expected) {
        assert!((a / b - 1.0).abs() < 1e-7, "{found:?} {expected:?}");
    }
}

#[test]
fn keys_that_cannot_vary_are_refused_by_name() {
    let lever = studied(STIFF, &[]);
    for (name, words) in [
        ("drive.frequenzy", "did you mean `drive.frequency`"),
        ("sample.material", "a name, not a quantity"),
        ("drive.setpoint", "vary gap.tip"),
        ("lever.k", "there are cantilever.k"),
    ] {
        let error = lever.key(name).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains(name), "{error}");
    }
    let key = lever.key("drive.frequency").unwrap();
    let error = lever.value(key, "325 nm").unwrap_err().to_string();
    assert!(
        error.contains("expected a frequency") && error.contains("a length"),
        "{error}"
    );
    // Numbers of the equations may vary together with quantities.
    let both = lever.with(key, 340e3).with(Key::Alpha4, 3.0);
    assert_eq!(both.get(Key::Alpha4), 3.0);
    assert_eq!(
        both.physical().unwrap().parameters.get(Parameter::Omega),
        340e3
    );
    let none = lever.with(key, -1.0).model().unwrap_err().to_string();
    assert!(
        none.contains("drive.frequency") && none.contains("above zero"),
        "{none}"
    );
}

/// A varied value together with the constant numbers, set on the case file, gives the same case.
#[test]
fn constant_numbers_reproduce_a_point() {
    let lever = studied(STIFF, &[]);
    for (name, text) in [
        ("drive.frequency", "340 kHz"),
        ("cantilever.k", "30 N/m"),
        ("gap.tip", "12 nm"),
        ("drive.free_amplitude", "25 nm"),
    ] {
        let (key, value) = varied(&lever, name, text);
        let found = lever.with(key, value);
        let mut words = vec![format!("{name}={text}")];
        for (held, value) in lever.held(&[key]) {
            words.push(format!("{held}={value:e}"));
        }
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let again = studied(STIFF, &words);
        for parameter in Parameter::every() {
            let at = |case: &Case| case.cantilever().unwrap().get(parameter);
            let (a, b) = (at(&found), at(&again));
            assert!(
                (a - b).abs() <= 1e-12 * b.abs(),
                "{words:?}: {parameter} {a} {b}"
            );
        }
    }
}
