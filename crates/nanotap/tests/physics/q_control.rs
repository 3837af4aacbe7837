//! Q control against levers that have its spring and its damper by other means.

use nanotap::case::Case;
use nanotap::case::physical::free_response::free_response;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::drive_form::Actuation;
use nanotap::model::parameter::Parameter;
use nanotap::observe::{ObservableSet, measure};
use nanotap::study::modes::ModeTable;
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit};
use nanotap_arithmetic::ComplexFunctions as _;

use crate::contact_laws::{on, own_numbers};
use crate::derivatives::{advance, worst};
use crate::stated;

fn controlled(case: Cantilever, gain: f64, phase: f64) -> Cantilever {
    case.with(Parameter::QControlGain, gain)
        .with(Parameter::QControlPhase, phase)
}

/// One mode, driven at the tip, no tip's mass: φ(1)² = 4, so that a quarter turn adds ∓4 G/Ω₁ to the damping.
fn one_mode() -> Cantilever {
    Cantilever {
        modes: 1,
        alpha1: 0.0,
        alpha2: 0.4,
        alpha3: 0.3,
        omega: 3.4,
        actuation: Actuation::Tip,
        ..Cantilever::paper()
    }
}

/// The first wavenumber of a clamped beam, squared: Ω₁.
const FIRST: f64 = 1.875_104_068_711_961_2 * 1.875_104_068_711_961_2;

#[test]
fn a_quarter_turn_is_a_damper() {
    let (gain, plain) = (0.1, one_mode());
    for (phase, sign) in [(90.0, -1.0), (-90.0, 1.0)] {
        let fed_back = controlled(plain.clone(), gain, phase);
        let damped = Cantilever {
            alpha3: plain.alpha3 + sign * 4.0 * gain / FIRST,
            ..plain.clone()
        };
        let [a, b] = [&fed_back, &damped].map(|case| free_response(case).unwrap());
        assert!((a - b).modulus() < 1e-13 * b.modulus(), "{a} {b}");
        let [a, b] =
            [&fed_back, &damped].map(|case| ModeTable::new(case).unwrap().quality.unwrap()[0]);
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
        let found = |case: Cantilever| {
            orbit(&Case::from(case).model().unwrap(), &OrbitOptions::default()).unwrap()
        };
        let (a, b) = (found(fed_back), found(damped));
        assert!(b.observables.contacts_per_period > 0.0);
        for (a, b) in a.state.iter().zip(&b.state) {
            assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
    }
}

/// Three modes over a Hertzian sample, at a phase that is neither spring nor damper alone. The other lever
/// has the same spring and damper as a force of the sample, at every gap.
#[test]
fn the_loop_is_a_spring_and_a_damper_at_the_tip() {
    const LEVER: &str = "
        [model]
        modes = 3
        [cantilever]
        k = '2 N/m'
        f0 = '70 kHz'
        Q = 100
        [tip]
        radius = '10 nm'
        [sample]
        law = 'hertz'
        modulus = '1 GPa'
        [gap]
        tip = '6 nm'
        [drive]
        actuation = 'tip'
        frequency = '70 kHz'
        force = '0.4 nN'
    ";
    let resonance = std::f64::consts::TAU * 70e3;
    let found = |case: &Case| orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
    for phase in [-90.0_f64, -60.0, 20.0, 60.0] {
        let gain = 0.01;
        let fed_back = stated(&format!(
            "{LEVER} q_control_gain = '{gain} N/m'\n q_control_phase = '{phase} deg'"
        ));
        let (sine, cosine) = phase.to_radians().sin_cos();
        let spring = gain * cosine;
        let damper = gain * sine / resonance;
        let force = format!("{spring:e}*(d - g) + {damper:e}*c*v");
        let force = force.replace("*(d", "*k*(d");
        let text = LEVER
            .replace("law = 'hertz'", &format!("law = 'hertz + formula'\n force = \"{force}\"\n parameters = {{ g = '6 nm', k = '1 N/m', c = '1 N s/m' }}"));
        let [a, b] = [&fed_back, &stated(&text)].map(found);
        let pair = |of: fn(&OrbitReport) -> f64| (of(&a), of(&b));
        let (amplitude, same) = pair(|orbit| orbit.observables.first_harmonic);
        assert!(
            (amplitude / same - 1.0).abs() < 1e-9,
            "{phase}: {amplitude} {same}"
        );
        let (lag, same) = pair(|orbit| orbit.observables.phase);
        assert!((lag - same).abs() < 1e-7, "{phase}: {lag} {same}");
        assert!(a.observables.contacts_per_period > 0.5, "{phase}");
    }
}

/// Under every drive and on every linear law: energy balances, and the derivatives of the map, those by
/// gain and phase included, agree with differences.
#[test]
fn energy_balances_and_derivatives_agree() {
    for actuation in Actuation::ALL {
        for law in ContactLaw::ALL {
            let sample = on(law, 3.1);
            let case = Cantilever {
                modes: 2,
                alpha5: 0.03,
                alpha6: sample.alpha6,
                arms: sample.arms.clone(),
                actuation,
                ..Cantilever::paper().on(law, &own_numbers(&sample))
            };
            let subject = Case::from(controlled(case, 0.05, -40.0));
            let model = subject.model().unwrap();
            let mut state = vec![0.0; model.dimension()];
            state[0] = 0.1;
            let seen = measure(&model, &state, 3, ObservableSet::ALL).unwrap();
            let residual = seen.energy_balance.residual;
            assert!(residual.abs() < 1e-11, "{actuation} {law}: {residual:e}");
            assert!(seen.contacts_per_period > 0.5);
            if law == ContactLaw::SpringDamper {
                state = advance(&subject, &state);
                let error = worst(&subject, &state).unwrap();
                assert!(error < 1e-4, "{actuation}: {error:e}");
            }
        }
    }
}

/// A gain that takes more damping away than there is: 4 G sin θ/Ω₁ > α₃.
#[test]
fn a_lever_that_oscillates_by_itself_is_refused() {
    let limit = 0.3 * FIRST / 4.0;
    assert!(
        Case::from(controlled(one_mode(), 0.99 * limit, 90.0))
            .model()
            .is_ok()
    );
    let refused = Case::from(controlled(one_mode(), 1.01 * limit, 90.0)).model();
    let refused = refused.unwrap_err().to_string();
    assert!(
        refused.contains("q_control_gain") && refused.contains("by itself"),
        "{refused}"
    );
}
