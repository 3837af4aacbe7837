//! Derivatives of the map under nonlinear laws with respect to the state and to quantities of the
//! case, compared with fourth-order central differences.

use nalgebra::DMatrix;
use nanotap::case::{Case, Key};
use nanotap::model::model_map::ModelMap;
use nanotap_dynamics::StroboscopicMap;

use crate::common::{DMT, air};

/// Largest difference relative to the largest entry of the column.
pub(crate) fn worst(case: &Case, keys: &[Key], state: &[f64]) -> f64 {
    let model = case.model().unwrap();
    let tangents = keys.iter().map(|k| case.tangent(&model, *k).unwrap());
    let n = model.dimension();
    let (mut jacobian, mut derivatives) = (DMatrix::zeros(n, n), DMatrix::zeros(n, keys.len()));
    ModelMap::with_tangents(&model, tangents.collect())
        .advance_with_derivatives(&mut state.to_vec(), &mut jacobian, &mut derivatives)
        .unwrap();
    let advanced = |case: &Case, state: &[f64]| {
        let mut end = state.to_vec();
        let mut map = ModelMap::new(&case.model().unwrap());
        map.advance(&mut end).unwrap();
        end
    };
    let difference = |f: &dyn Fn(f64) -> Vec<f64>, h: f64| -> Vec<f64> {
        let (a, b, c, d) = (f(-2.0 * h), f(-h), f(h), f(2.0 * h));
        (0..n)
            .map(|i| (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * h))
            .collect()
    };
    let mut worst: f64 = 0.0;
    let mut compare = |exact: &[f64], estimate: &[f64], what: &str| {
        let scale = exact
            .iter()
            .map(|v| v.abs())
            .fold(f64::MIN_POSITIVE, f64::max);
        for (a, b) in exact.iter().zip(estimate) {
            let error = (a - b).abs() / scale;
            assert!(error < 1e-6, "{what}: {exact:?} {estimate:?}");
            worst = worst.max(error);
        }
    };
    let size = state.iter().map(|v| v.abs()).fold(0.0, f64::max);
    for j in 0..n {
        let moved = |h: f64| {
            let mut x = state.to_vec();
            x[j] += h;
            advanced(case, &x)
        };
        let estimate = difference(&moved, 1e-5 * size);
        compare(jacobian.column(j).as_slice(), &estimate, "state");
    }
    for (k, key) in keys.iter().enumerate() {
        let value = case.get(*key);
        let moved = |h: f64| advanced(&case.with(*key, value + h), state);
        let estimate = difference(&moved, 1e-5 * value.abs());
        compare(derivatives.column(k).as_slice(), &estimate, key.path());
    }
    worst
}

#[test]
fn by_state_and_by_every_kind_of_quantity() {
    // Through the contact, with two modes.
    let mut words = DMT.to_vec();
    words.push("modes=2");
    let case = air(20.0, 10.0, &words);
    let scale = 1e-9 / case.physical().unwrap().scales.length;
    let omega = case.model().unwrap().frequency();
    let state = [
        -3.0 * scale,
        0.1 * scale,
        7.0 * scale * omega,
        0.5 * scale * omega,
    ];
    let keys = [
        Key::GapTip,
        Key::DriveForce,
        Key::DriveFrequency,
        Key::SampleModulus,
        Key::SampleHamaker,
        Key::SampleIntermolecularDistance,
        Key::TipRadius,
        Key::LeverQ,
        Key::LeverK,
        Key::Alpha5,
        Key::Omega,
        Key::Alpha3,
    ];
    let worst = worst(&case, &keys, &state);
    assert!(worst < 1e-6, "{worst}");
}
