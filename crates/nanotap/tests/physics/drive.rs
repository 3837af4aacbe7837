//! Base and direct actuation, with one tone and with two.

use nanotap::case::Case;
use nanotap::case::physical::free_response::response_at;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::drive_form::Actuation;
use nanotap::model::parameter::Parameter;
use nanotap::observe::{ObservableSet, Spectrum, measure};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::{Complex, Flow};

use crate::contact_laws::{on, own_numbers};
use crate::derivatives::{advance, worst};

/// Two tones, the second at 25/4 of the first, with this actuation.
fn two_tones(actuation: Actuation) -> Cantilever {
    let case = Cantilever {
        actuation,
        alpha2: if actuation == Actuation::Base {
            0.1
        } else {
            0.6
        },
        tone2_ratio: Some("25/4".parse().unwrap()),
        omega: 3.1,
        ..Cantilever::paper()
    };
    let amplitude = if actuation == Actuation::Base {
        0.01
    } else {
        0.4
    };
    case.with(Parameter::Tone2Amplitude, amplitude)
        .with(Parameter::Tone2Phase, 35.0)
}

/// Far from the sample the motion is the sum of the responses to both tones, each with the
/// amplitude and phase of its closed form.
#[test]
fn tones_superpose_in_free_flight() {
    for actuation in Actuation::ALL {
        let case = Cantilever {
            alpha5: 50.0,
            ..two_tones(actuation)
        };
        let model = Model::cantilever(&case).unwrap();
        let found = orbit(&model, &OrbitOptions::default()).unwrap();
        assert!(found.events.is_empty() && found.period == 1);
        let o = &found.observables;
        let tones = [
            (case.alpha2, case.omega, o.first_harmonic, o.phase),
            (
                case.get(Parameter::Tone2Amplitude),
                6.25 * case.omega,
                o.tone2_response.unwrap(),
                o.tone2_lag.unwrap(),
            ),
        ];
        for (drive, frequency, amplitude, phase) in tones {
            let z = response_at(&case, frequency).unwrap();
            assert!(
                (amplitude / (drive * z.modulus()) - 1.0).abs() < 1e-10,
                "{actuation}"
            );
            let off = (phase + z.argument().to_degrees()).rem_euclid(360.0);
            assert!(off.min(360.0 - off) < 1e-8, "{actuation}: {off}");
        }
        // There is no other motion.
        let power = 0.5 * (o.first_harmonic.powi(2) + o.tone2_response.unwrap().powi(2));
        assert!((o.rms_deflection.powi(2) / power - 1.0).abs() < 1e-10);
        let spectrum = Spectrum::of(&model, &found.trajectory, 1, 8);
        let at = |order: f64| {
            let found = spectrum
                .harmonics
                .iter()
                .find(|h| (h.order - order).abs() < 1e-12);
            found.unwrap().tip
        };
        assert!((at(1.0) - o.first_harmonic).abs() < 1e-12);
        assert!((at(6.25) - o.tone2_response.unwrap()).abs() < 1e-12);
        assert!(at(2.0) < 1e-12 && at(0.25) < 1e-12);
    }
}

/// Under a slow force a beam deflects by L³/3EI per unit force at its tip and L³/8EI per unit of
/// evenly distributed force; under slow motion it follows its base.
#[test]
fn slow_drives_are_static() {
    let slow = |actuation| Cantilever {
        actuation,
        ..Cantilever::paper().with_modes(50)
    };
    let response = |actuation| response_at(&slow(actuation), 1e-3).unwrap();
    for (actuation, expected) in [
        (Actuation::Tip, 1.0 / 3.0),
        (Actuation::Distributed, 1.0 / 8.0),
        (Actuation::Base, 0.0),
    ] {
        let found = response(actuation);
        assert!(
            (found - Complex::new(expected, 0.0)).modulus() < 1e-4,
            "{actuation}: {found}"
        );
    }
}

/// With contacts, every actuation and both tones: derivatives with respect to all parameters,
/// including those of the second tone, and a closed energy balance.
#[test]
fn every_drive_has_its_derivatives_and_balances_its_energy() {
    for actuation in Actuation::ALL {
        for law in ContactLaw::ALL {
            let sample = on(law, 3.1);
            let case = Cantilever {
                modes: 2,
                alpha5: 0.03,
                alpha6: sample.alpha6,
                ..two_tones(actuation).on(law, &own_numbers(&sample))
            };
            let subject = Case::from(case);
            let model = subject.model().unwrap();
            let mut state = vec![0.0; model.dimension()];
            state[0] = 0.1;
            let seen = measure(&model, &state, 3, ObservableSet::ALL).unwrap();
            assert!(
                seen.energy_balance.residual.abs() < 1e-11,
                "{actuation} {law}"
            );
            assert!(seen.contacts_per_period > 0.5);
            if law != ContactLaw::SpringDamper {
                continue;
            }
            state = advance(&subject, &state);
            // Differences over four drive periods of a stiff spring have their own rounding.
            let error = worst(&subject, &state).unwrap();
            assert!(error < 1e-4, "{actuation}: {error:e}");
        }
    }
}

/// After one period of the first tone a second tone at 3/2 of its frequency has advanced by an
/// additional half turn: the same motion as with its phase shifted by half a turn.
#[test]
fn phases_and_times_agree() {
    let case = Cantilever {
        tone2_ratio: Some("3/2".parse().unwrap()),
        ..two_tones(Actuation::Base)
    };
    let first = std::f64::consts::TAU / case.omega;
    let run = |case: &Cantilever, state: &[f64], from: f64| {
        let model = Model::cantilever(case).unwrap();
        let mut flow = Flow::new(model.system.clone());
        flow.start(state, from).unwrap();
        flow.run_until(from + first, &mut ()).unwrap();
        let mut end = vec![0.0; state.len()];
        flow.state(&mut end);
        (end, flow.switches())
    };
    let start = [0.05, 0.01, 0.0, -0.2, 0.1, 0.0];
    let turned = case.clone().with(
        Parameter::Tone2Phase,
        case.get(Parameter::Tone2Phase) + 180.0,
    );
    let (later, switches) = run(&case, &start, first);
    let (now, _) = run(&turned, &start, 0.0);
    assert!(switches > 0);
    for (a, b) in later.iter().zip(&now) {
        assert!((a - b).abs() < 1e-12, "{later:?} {now:?}");
    }
    // A second tone of amplitude zero has no effect, except on the length of the period.
    let silent = case.clone().with(Parameter::Tone2Amplitude, 0.0);
    let single = Cantilever {
        tone2_ratio: None,
        ..silent.clone().with(Parameter::Tone2Phase, 0.0)
    };
    let (a, b) = (run(&silent, &start, 0.0).0, run(&single, &start, 0.0).0);
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-13));
}
