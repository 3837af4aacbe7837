//! Setpoints solved for the distance.

use nanotap::control::Control;
use nanotap::study::approach::gap_key;
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap::study::setpoint::{SetpointError, solve_setpoint};

use crate::approach::{STIFF, studied};

/// Without `gap.tip`, the setpoint decides.
fn held(set: &[&str]) -> nanotap::study::studied::Studied {
    studied(&STIFF.replace("[gap]\ntip = \"15 nm\"\n", ""), set)
}

/// At the chosen distance the tapping orbit has the setpoint amplitude, and so has every
/// other solution at its own: each is run again from its state.
#[test]
fn every_solution_has_the_amplitude_of_the_setpoint() {
    let lever = held(&["drive.setpoint=0.8"]);
    assert!(lever.leaves_distance_to_setpoint());
    let report = solve_setpoint(&lever, &Control::default()).unwrap();
    assert!((report.amplitude / 16e-9 - 1.0).abs() < 1e-12);
    for solution in &report.solutions {
        let model = lever
            .subject
            .with(gap_key(&lever.subject), solution.gap)
            .model()
            .unwrap();
        let options = OrbitOptions {
            period: Some(solution.period),
            state: Some(solution.state.clone()),
            ..OrbitOptions::default()
        };
        let found = orbit(&model, &options).unwrap();
        let amplitude =
            found.observables.first_harmonic * lever.resolved.as_ref().unwrap().scales.length;
        assert!((amplitude / 16e-9 - 1.0).abs() < 1e-9, "{amplitude}");
        assert_eq!(found.stable, solution.stable);
    }
    let zc = report.zc();
    // The tip taps on the surface: the distance is a little less than the amplitude.
    assert!(zc > 14e-9 && zc < 16e-9, "{zc}");
    let at = lever.at_setpoint(&Control::default()).unwrap();
    let resolved = at.resolved.as_ref().unwrap();
    assert!((resolved.parameters.tip_gap / zc - 1.0).abs() < 1e-12);
    let found = orbit(&at.model().unwrap(), &OrbitOptions::default()).unwrap();
    let ratio = found.observables.first_harmonic * resolved.scales.length / 20e-9;
    assert!((ratio - 0.8).abs() < 1e-9, "{ratio}");
}

/// Where the motion jumps on approach from A0 to 1.06 A0, so that an amplitude of 1.02 A0 …
/// is none that the feedback could reach from above; an amplitude below all is not reached.
#[test]
fn a_setpoint_that_is_not_reached_is_refused() {
    let soft = held(&["drive.setpoint=1e-4"]);
    let error = solve_setpoint(&soft, &Control::default()).unwrap_err();
    assert!(matches!(error, SetpointError::NotReached { .. }), "{error}");
    let given = studied(STIFF, &[]);
    assert!(matches!(
        solve_setpoint(&given, &Control::default()),
        Err(SetpointError::None)
    ));
}

/// A distance that is given is not overruled.
#[test]
fn a_given_distance_stays() {
    let lever = studied(STIFF, &["drive.setpoint=0.8"]);
    assert!(!lever.leaves_distance_to_setpoint());
    let same = lever.clone().at_setpoint(&Control::default()).unwrap();
    assert!(same.setpoint.is_none());
    assert_eq!(same.subject, lever.subject);
}
