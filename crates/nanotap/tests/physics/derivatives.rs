//! Derivatives of the stroboscopic map compared with central differences, and the 3/2 power at
//! grazing.

use nalgebra::DMatrix;
use nanotap::case::{Case, Key};
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap_dynamics::StroboscopicMap;

pub(crate) fn advance(subject: &Case, state: &[f64]) -> Vec<f64> {
    let mut x = state.to_vec();
    ModelMap::new(&subject.model().unwrap())
        .advance(&mut x)
        .unwrap();
    x
}

/// The state after a period, and the number of switches.
fn counted(subject: &Case, state: &[f64]) -> (Vec<f64>, usize) {
    let system = subject.model().unwrap().system;
    let run = nanotap_flow::Trajectory::record(&system, state, 1).unwrap();
    (advance(subject, state), run.events().len())
}

/// Largest relative difference between the exact derivative and a fourth-order central difference,
/// over the Jacobian and every parameter; `None` if a contact begins or ends within the
/// differences, where the map has a kink or jump.
pub(crate) fn worst(subject: &Case, state: &[f64]) -> Option<f64> {
    worst_over(subject, state, 1e-5)
}

/// The same with differences over `step` in the state, and the same fraction of a parameter.
pub(crate) fn worst_over(subject: &Case, state: &[f64], step: f64) -> Option<f64> {
    let model = subject.model().unwrap();
    let keys: Vec<Key> = subject.keys();
    let tangents: Vec<_> = keys
        .iter()
        .map(|k| subject.tangent(&model, *k).unwrap())
        .collect();
    let n = state.len();
    let (mut jacobian, mut derivatives) = (DMatrix::zeros(n, n), DMatrix::zeros(n, keys.len()));
    ModelMap::with_tangents(&model, tangents)
        .advance_with_derivatives(&mut state.to_vec(), &mut jacobian, &mut derivatives)
        .unwrap();
    let switches = counted(subject, state).1;
    let difference = |f: &dyn Fn(f64) -> (Vec<f64>, usize), h: f64| -> Option<Vec<f64>> {
        let around = [-2.0 * h, -h, h, 2.0 * h].map(f);
        if around.iter().any(|(_, count)| *count != switches) {
            return None;
        }
        let [a, b, c, d] = around.map(|(x, _)| x);
        let of = |i: usize| (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * h);
        Some((0..n).map(of).collect())
    };
    let mut worst: f64 = 0.0;
    let mut compare = |exact: &[f64], estimate: &[f64]| {
        let scale = exact.iter().map(|v| v.abs()).fold(1e-3, f64::max);
        for (a, b) in exact.iter().zip(estimate) {
            worst = worst.max((a - b).abs() / scale);
        }
    };
    for j in 0..n {
        let moved = |h: f64| {
            let mut x = state.to_vec();
            x[j] += h;
            counted(subject, &x)
        };
        compare(jacobian.column(j).as_slice(), &difference(&moved, step)?);
    }
    for (p, key) in keys.iter().enumerate() {
        let value = subject.get(*key);
        // Parameters with a bound are tested away from it.
        let moved = |h: f64| counted(&subject.with(*key, value + h), state);
        compare(
            derivatives.column(p).as_slice(),
            &difference(&moved, step * value.abs().max(0.1))?,
        );
    }
    Some(worst)
}

#[test]
fn cantilever_with_contacts() {
    let case = Cantilever {
        alpha5: 0.02,
        ..Cantilever::paper()
    };
    for modes in [1, 3, 5] {
        let subject = Case::from(case.clone().with_modes(modes));
        let mut state = vec![0.0; 2 * modes];
        for _ in 0..5 {
            state = advance(&subject, &state);
        }
        let error = worst(&subject, &state).unwrap();
        assert!(error < 1e-6, "N = {modes}: {error:e}");
    }
}

#[test]
fn oscillators_with_soft_and_rigid_stops() {
    let soft = Stop::Soft {
        stiffness: 30.0,
        damping: 0.4,
    };
    let rigid = Stop::Rigid { restitution: 0.8 };
    for stop in [soft, rigid] {
        let subject = Case::from(Oscillator {
            mass: 1.3,
            stiffness: 1.1,
            damping: 0.15,
            forcing: 0.9,
            omega: 2.4,
            gap: 0.1,
            stop,
        });
        let error = worst(&subject, &[-0.2, 0.5]).unwrap();
        assert!(error < 1e-6, "{stop:?}: {error:e}");
    }
}

/// Critically damped contact: without a basis of eigenvectors, the matrix exponential of the
/// augmented system gives the sensitivities.
#[test]
fn critically_damped_contact() {
    // m = 1, k + k₁ = 16, c + c₁ = 8: a double eigenvalue −4.
    let subject = Case::from(Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.2,
        forcing: 1.0,
        omega: 1.7,
        gap: 0.1,
        stop: Stop::Soft {
            stiffness: 15.0,
            damping: 7.8,
        },
    });
    assert!(
        !subject.model().unwrap().system.regimes()[1]
            .basis()
            .clusters
            .is_empty()
    );
    let error = worst(&subject, &[-0.2, 0.5]).unwrap();
    assert!(error < 1e-6, "{error:e}");
}

/// Near grazing |P − P_free| scales as the penetration to the power 3/2: over five decades of
/// penetration the local slope stays near 1.5.
#[test]
fn grazing_is_of_the_three_halves_type() {
    // A lever that just misses: α5 sets the least gap over the run; state and drive are fixed.
    let free = Cantilever {
        alpha5: 1.0,
        ..Cantilever {
            omega: 3.1,
            ..Cantilever::paper()
        }
    };
    let start = [0.03, 0.0, 0.0, 0.1, 0.0, 0.0];
    let model = Model::cantilever(&free).unwrap();
    let run = nanotap_flow::Trajectory::record(&model.system, &start, 1).unwrap();
    let (lowest, _) = run.signal(&model.gap).range().unwrap();
    let unhindered = run.state_at(run.end()).unwrap();
    let deviation = |depth: f64| -> f64 {
        let case = Cantilever {
            alpha5: 1.0 - lowest.value - depth,
            ..free.clone()
        };
        let state = advance(&Case::from(case), &start);
        state
            .iter()
            .zip(&unhindered)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    for decade in 3..8 {
        let depth = 10.0_f64.powi(-decade);
        let slope = (deviation(depth) / deviation(0.25 * depth)).ln() / 4.0_f64.ln();
        assert!(
            (slope - 1.5).abs() < 0.05,
            "penetration {depth:e}: slope {slope}"
        );
    }
    assert_eq!(deviation(-1e-9), deviation(-1e-3));
}
