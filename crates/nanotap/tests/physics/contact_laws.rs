//! Properties of every contact law.

use nanotap::case::Case;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::parameter::Parameter;
use nanotap::observe::{ObservableSet, measure};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap_flow::Trajectory;
use proptest::prelude::*;

use crate::derivatives::{advance, worst};
use crate::located_runge_kutta::Independent;

/// The paper's case on a sample of a law, with the paper's spring and damper.
pub(crate) fn on(law: ContactLaw, omega: f64) -> Cantilever {
    let case = Cantilever::paper().with(Parameter::Omega, omega);
    match law {
        ContactLaw::SpringDamper | ContactLaw::KelvinVoigt => case.on(law, &[]),
        ContactLaw::StandardLinearSolid => case.with(Parameter::Alpha6, 0.0).on(law, &[40.0, 0.05]),
        ContactLaw::GeneralisedMaxwell => Cantilever {
            alpha6: 0.0,
            arms: vec![[0.2, 15.0], [0.5, 20.0], [3.0, 5.0]],
            ..case.on(law, &[1.0, 1.0])
        },
        ContactLaw::MovingSurface => case.on(law, &[60.0, 8.0, 0.4]),
    }
}

/// The numbers that only the law of a case has.
pub(crate) fn own_numbers(case: &Cantilever) -> Vec<f64> {
    Parameter::of_law(case.contact)
        .map(|own| case.get(own))
        .collect()
}

/// The parameter of this name.
pub(crate) fn parameter(name: &str) -> Parameter {
    Parameter::find(name).unwrap()
}

/// States, contacts, peak force and dissipated energy, in flight as well, compared with an
/// independent integration.
#[test]
fn every_law_agrees_with_located_runge_kutta() {
    for law in ContactLaw::ALL {
        for omega in [2.6, 20.0] {
            let case = Cantilever {
                modes: 2,
                alpha5: 0.05,
                ..on(law, omega)
            };
            let start = [0.1, 0.01, 0.2, -0.3];
            let independent = Independent::new(&case).run(&start, 5, 3000);
            let model = Model::cantilever(&case).unwrap();
            let mut state = start.to_vec();
            state.resize(model.dimension(), 0.0);
            let run = Trajectory::record(&model.system, &state, 5).unwrap();
            let end = run.state_at(run.end()).unwrap();
            for (exact, stepped) in end.iter().zip(independent.beam.iter()) {
                assert!(
                    (exact - stepped).abs() < 2e-8,
                    "{law} {omega}: {end:?} {}",
                    independent.beam
                );
            }
            let seen = measure(&model, &state, 5, ObservableSet::ALL).unwrap();
            let contacts = (seen.contacts_per_period * 5.0).round() as usize;
            assert_eq!(contacts, independent.contacts, "{law} {omega}");
            let lost = seen.energy_balance.sample_damping;
            assert!(
                (lost / independent.dissipated - 1.0).abs() < 1e-6,
                "{law} {omega}: {lost} {}",
                independent.dissipated
            );
            // The integration evaluates forces at its steps only.
            assert!((seen.peak_force / independent.force[1] - 1.0).abs() < 1e-2);
            let pulls = independent.force[0] < -1e-6;
            assert_eq!(
                seen.least_force < -1e-12,
                pulls,
                "{law}: {}",
                seen.least_force
            );
            let may_pull = [ContactLaw::SpringDamper, ContactLaw::MovingSurface];
            assert_eq!(pulls, may_pull.contains(&law));
            assert!(seen.energy_balance.residual.abs() < 1e-11);
        }
    }
}

/// Jacobians and the derivatives with respect to every parameter compared with differences of
/// fourth order; states in flight over a recovering surface, in contact, and at immediate
/// separation.
#[test]
fn derivatives_of_every_law() {
    for law in ContactLaw::ALL {
        for modes in [1, 3] {
            let case = Cantilever {
                alpha5: 0.02,
                ..on(law, 2.6)
            };
            let subject = Case::from(case.with_modes(modes));
            let model = subject.model().unwrap();
            let mut state = vec![0.0; model.dimension()];
            for _ in 0..5 {
                state = advance(&subject, &state);
            }
            let mut starts = vec![state.clone()];
            // Deep in the sample, at rest and moving outwards.
            for speed in [0.0, 3.0] {
                let mut state = vec![0.0; model.dimension()];
                (state[0], state[modes]) = (-0.1, speed);
                starts.push(state);
            }
            for start in starts {
                let error = worst(&subject, &start).unwrap();
                assert!(error < 2e-6, "{law}, N = {modes}, {start:?}: {error:e}");
            }
        }
    }
}

/// A periodic motion balances its energy and its volumes to rounding.
#[test]
fn orbits_of_every_law_balance_energy_and_volume() {
    for law in ContactLaw::ALL {
        for (omega, modes) in [(20.0, 3), (2.6, 3), (20.0, 6)] {
            let model = Model::cantilever(&on(law, omega).with_modes(modes)).unwrap();
            let options = OrbitOptions {
                period: Some(1),
                ..OrbitOptions::default()
            };
            let found = orbit(&model, &options).unwrap();
            let balance = &found.observables.energy_balance;
            assert!(balance.residual.abs() < 1e-11, "{law} {omega}: {balance:?}");
            assert!(
                found.determinant_defect < 1e-8,
                "{law} {omega}: {:e}",
                found.determinant_defect
            );
            assert!(!found.events.is_empty());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// For random parameters and states: the run continues, the sample never supplies energy, a
    /// recovering surface never pulls, and only contact ends contact.
    #[test]
    fn samples_are_passive(
        law in 0..5_usize, modes in 1..5_usize, omega in 0.5..25.0_f64,
        stiffness in 0.0..200.0_f64, damping in 1e-6..20.0_f64, gap in -0.2..0.3_f64,
        a in -0.3..0.3_f64, v in -3.0..3.0_f64, memory in -0.3..0.3_f64,
    ) {
        let law = ContactLaw::ALL[law];
        let mut case = Cantilever { modes, omega, alpha4: stiffness, alpha5: gap, ..Cantilever::paper() };
        case.alpha6 = if law.has_damper() { damping } else { 0.0 };
        case = case.on(law, &match law {
            ContactLaw::StandardLinearSolid => vec![3.0 * damping, 0.1 * damping],
            ContactLaw::MovingSurface => {
                vec![1.0 + 0.5 * stiffness, damping, 3.0 * gap.max(0.0)]
            }
            ContactLaw::GeneralisedMaxwell => vec![1.0, 1.0],
            _ => Vec::new(),
        });
        if law == ContactLaw::GeneralisedMaxwell {
            case.arms = vec![[0.1 * damping, damping], [1.0, 0.3 * damping]];
        }
        let model = Model::cantilever(&case).unwrap();
        let mut state = vec![0.0; model.dimension()];
        (state[0], state[modes]) = (a, v);
        if model.memory > 0 {
            state[2 * modes] = memory;
        }
        let run = Trajectory::record(&model.system, &state, 8).unwrap();
        let seen = measure(&model, &state, 8, ObservableSet::ALL).unwrap();
        prop_assert!(seen.energy_balance.sample_damping >= 0.0);
        if ![ContactLaw::SpringDamper, ContactLaw::MovingSurface].contains(&law) {
            let scale = seen.peak_force.max(stiffness * (a.abs() + memory.abs())) + 1e-3;
            // A start in the sample may be one that pulls, for zero time.
            prop_assert!(seen.least_force >= -1e-10 * scale, "{}", seen.least_force);
        }
        for pair in run.events().windows(2) {
            prop_assert!(pair[0].to == pair[1].from);
        }
        // The map at the start of each period finds the regime of the run.
        for k in 0..8 {
            let t = f64::from(k) * model.period();
            let segment = run.segment_at(t).unwrap();
            let (regime, _) = model.system.regime_at(&run.state_at(t).unwrap(), 0.0).unwrap();
            let guard = &model.system.transitions()[segment.regime][0].guard;
            let inside = guard.at(model.system.drive(), &run.state_at(t).unwrap(), 0.0);
            prop_assert!(regime == segment.regime || inside.abs() < 1e-9, "{k}: {inside}");
        }
    }
}

/// Without a damper, or with one that has no time to act, every law is the paper's spring.
#[test]
fn without_a_damper_every_law_is_the_papers_spring() {
    let spring = Cantilever {
        alpha6: 0.0,
        ..Cantilever::paper()
    };
    let recovers = Cantilever {
        contact: ContactLaw::KelvinVoigt,
        ..spring.clone()
    };
    let solid = spring
        .clone()
        .on(ContactLaw::StandardLinearSolid, &[30.0, 0.0]);
    let [expected, recovered, relaxed] = [spring, recovers, solid].map(|case| {
        let subject = Case::from(case);
        let mut state = vec![0.0; subject.model().unwrap().dimension()];
        (0..20).for_each(|_| state = advance(&subject, &state));
        state
    });
    for (k, x) in expected.iter().enumerate() {
        assert!((x - recovered[k]).abs() < 1e-13 && (x - relaxed[k]).abs() < 1e-13);
    }
    assert_eq!((recovered[6], relaxed[6]), (0.0, 0.0));
}

/// Further parameters of a law can be varied like the paper's.
#[test]
fn a_case_has_the_parameters_of_its_law() {
    let of = |law| Case::from(on(law, 2.6));
    let names = |law| -> Vec<&str> { of(law).keys().iter().map(|k| k.name()).collect() };
    assert!(names(ContactLaw::KelvinVoigt).contains(&"alpha6"));
    let solid = names(ContactLaw::StandardLinearSolid);
    assert!(solid.contains(&"relaxation_time") && !solid.contains(&"alpha6"));
    assert!(of(ContactLaw::SpringDamper).key("relaxation_time").is_err());
    let wrong = Cantilever::paper().with(parameter("relaxation_time"), 0.1);
    let refused = Model::cantilever(&wrong).unwrap_err().to_string();
    assert!(refused.contains("standard-linear-solid"), "{refused}");
}
