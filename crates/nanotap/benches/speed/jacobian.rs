//! The period map with its derivatives.

use divan::Bencher;
use nalgebra::DMatrix;
use nanotap::case::Key;
use nanotap::model::model_map::ModelMap;
use nanotap_dynamics::StroboscopicMap;

use crate::cases::{self, MODES};

/// The map alone, as analysis calls it: from state to state.
#[divan::bench(args = MODES)]
fn map(bencher: Bencher<'_, '_>, modes: usize) {
    let (mut map, state) = on_attractor(modes);
    bencher
        .with_inputs(|| state.clone())
        .bench_local_refs(|state| map.advance(state).expect("a bounded motion"));
}

/// The map with its Jacobian.
#[divan::bench(args = MODES)]
fn map_with_jacobian(bencher: Bencher<'_, '_>, modes: usize) {
    let (mut map, state) = on_attractor(modes);
    let mut jacobian = DMatrix::zeros(2 * modes, 2 * modes);
    bencher
        .with_inputs(|| state.clone())
        .bench_local_refs(|state| {
            map.advance_with_jacobian(state, &mut jacobian)
                .expect("a bounded motion");
        });
}

/// The map with its Jacobian and its derivative with respect to Ω.
#[divan::bench(args = MODES)]
fn map_with_parameter(bencher: Bencher<'_, '_>, modes: usize) {
    let case = cases::paper(modes);
    let model = cases::model(&case);
    let tangent = cases::subject(&case)
        .tangent(&model, Key::Omega)
        .expect("a smooth family");
    let mut map = ModelMap::with_tangents(&model, vec![tangent]);
    let (_, state) = on_attractor(modes);
    let mut jacobian = DMatrix::zeros(2 * modes, 2 * modes);
    let mut derivative = DMatrix::zeros(2 * modes, 1);
    bencher
        .with_inputs(|| state.clone())
        .bench_local_refs(|state| {
            map.advance_with_derivatives(state, &mut jacobian, &mut derivative)
                .expect("a bounded motion");
        });
}

/// The paper's case and a state on its attractor.
fn on_attractor(modes: usize) -> (ModelMap, Vec<f64>) {
    let case = cases::paper(modes);
    let mut state = vec![0.0; 2 * modes];
    cases::settled(&case).state(&mut state);
    (ModelMap::new(&cases::model(&case)), state)
}
