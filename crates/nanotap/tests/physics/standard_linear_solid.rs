//! The spring with a relaxing arm.

use std::f64::consts::TAU;

use nanotap::case::Case;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::parameter::Parameter;
use nanotap::observe::{ObservableSet, measure};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap_flow::Trajectory;

use crate::contact_laws::{on, parameter};
use crate::derivatives::advance;

fn solid() -> Cantilever {
    on(ContactLaw::StandardLinearSolid, 20.0)
}

fn after(case: &Cantilever, periods: usize) -> Vec<f64> {
    let subject = Case::from(case.clone());
    let mut state = vec![0.0; subject.model().unwrap().dimension()];
    (0..periods).for_each(|_| state = advance(&subject, &state));
    state
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

/// An arm that relaxes at once leaves the spring α4; one that never relaxes adds its own spring.
#[test]
fn limits_of_the_relaxation_time_are_springs() {
    let spring = |stiffness| Cantilever {
        alpha4: stiffness,
        ..on(ContactLaw::SpringDamper, 20.0).with(Parameter::Alpha6, 0.0)
    };
    let (relaxed, instantaneous) = (after(&spring(20.0), 30), after(&spring(60.0), 30));
    for (time, expected) in [(1e-6, &relaxed), (0.0, &relaxed), (1e6, &instantaneous)] {
        let found = after(&solid().with(parameter("relaxation_time"), time), 30);
        assert!(
            distance(&found, expected) < 2e-3,
            "{time}: {found:?} {expected:?}"
        );
        let nearer = if time < 1.0 { time * 0.1 } else { time * 10.0 };
        let near = after(&solid().with(parameter("relaxation_time"), nearer), 30);
        assert!(distance(&near, expected) <= 0.2 * distance(&found, expected) + 1e-12);
    }
}

/// In the limit of a stiff arm with the same damper the surface is a Kelvin–Voigt one.
#[test]
fn a_stiff_arm_is_a_kelvin_voigt_surface() {
    let expected = after(&on(ContactLaw::KelvinVoigt, 20.0), 30);
    let mut last = f64::INFINITY;
    for stiffness in [1e3, 1e4, 1e5, 1e6] {
        let time = Cantilever::paper().alpha6 / stiffness;
        let case = solid().on(ContactLaw::StandardLinearSolid, &[stiffness, time]);
        let found = distance(&after(&case, 30)[..6], &expected[..6]);
        assert!(found < 0.2 * last, "{stiffness}: {found}");
        last = found;
    }
    assert!(last < 1e-3, "{last}");
}

/// Pressed in at rest and driven, the sample is indented harmonically: the loop of force and
/// indentation has the area π δ₀² k ωτ/(1 + ω²τ²), and the stiffness is the storage modulus α4 + k
/// ω²τ²/(1 + ω²τ²).
#[test]
fn harmonic_indentation_dissipates_according_to_the_loss_modulus() {
    for (omega, time) in [(2.6, 0.01), (2.6, 0.4), (20.0, 0.05), (20.0, 3.0)] {
        let case = Cantilever {
            alpha2: 1e-3,
            alpha5: -0.4,
            ..on(ContactLaw::StandardLinearSolid, omega).with(parameter("relaxation_time"), time)
        };
        let model = Model::cantilever(&case).unwrap();
        let options = OrbitOptions {
            period: Some(1),
            ..OrbitOptions::default()
        };
        let found = orbit(&model, &options).unwrap();
        assert!(found.events.is_empty(), "the tip stays in contact");
        let height = found.trajectory.curve(&model.height);
        let force = found.trajectory.force(&model);
        let (indented, pushed) = (-height.fourier(omega), force.fourier(omega));
        let turn = omega * time;
        let arm = case.get(parameter("relaxation_stiffness"));
        let lost = TAU / 2.0 * indented.norm_sqr() * arm * turn / (1.0 + turn * turn);
        let taken = found.observables.energy_balance.sample_damping;
        assert!(
            (taken / lost - 1.0).abs() < 1e-9,
            "{omega} {time}: {taken} {lost}"
        );
        let modulus = pushed / indented;
        let storage = case.alpha4 + arm * turn * turn / (1.0 + turn * turn);
        assert!((modulus.re / storage - 1.0).abs() < 1e-9);
    }
}

/// Force and gap vanish together, and the free surface recovers with the retardation time
/// τ (α4 + k)/α4, slower than the force relaxes.
#[test]
fn the_free_surface_recovers_with_its_retardation_time() {
    let case = solid().with(parameter("relaxation_time"), 0.3);
    let model = Model::cantilever(&case).unwrap();
    let run = Trajectory::record(&model.system, &after(&case, 30), 12).unwrap();
    let surface = |t: f64| {
        let gap = run.signal(&model.gap).at(t).unwrap();
        run.signal(&model.height).at(t).unwrap() - gap
    };
    let [arm, time] = ["relaxation_stiffness", "relaxation_time"].map(|of| case.get(parameter(of)));
    let retardation = time * (case.alpha4 + arm) / case.alpha4;
    let mut flights = 0;
    for pair in run.events().windows(2).filter(|p| !model.contact[p[0].to]) {
        let (start, end) = (pair[0].time + 1e-9, pair[1].time - 1e-9);
        let expected = surface(start) * (-(end - start) / retardation).exp();
        assert!((surface(end) - expected).abs() < 1e-12);
        flights += 1;
    }
    assert!(flights > 1);
    let seen = measure(&model, &after(&case, 30), 12, ObservableSet::ALL).unwrap();
    assert!(seen.least_force > -1e-12 && seen.peak_force > 0.1);
}
