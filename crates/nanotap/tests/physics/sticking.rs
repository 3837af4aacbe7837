//! Sticking at a rigid stop: the one motion that follows it, and what is reported about motions that stick.

use nanotap::control::Control;
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap::model::release::{Release, ReleaseMotion};
use nanotap::study::attractors::{AttractorsOptions, attractors};
use nanotap::study::lyapunov::{ExponentSource, LyapunovOptions, lyapunov};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap::study::simulate::{Classification, SimulateOptions, simulate};

use crate::impact_oscillator::rigid;

/// The release orbits of `stick_reference.json`: mpmath 1.3 at the two numbers of digits that each case
/// states, which agree. Where the reference finds no stick within its search, none may be claimed there.
#[test]
fn the_release_orbits_are_those_of_the_reference() {
    let path = format!(
        "{}/tests/reference/stick_reference.json",
        env!("CARGO_MANIFEST_DIR")
    );
    let document: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut closed = 0;
    for case in document["cases"].as_array().unwrap() {
        let number = |key: &str| -> f64 { case[key].as_str().unwrap().parse().unwrap() };
        let oscillator = Oscillator {
            damping: number("damping"),
            gap: number("gap"),
            ..rigid(number("omega"), number("restitution"))
        };
        let release = Release::new(&oscillator).unwrap();
        match (release.motion(), case["period"].as_u64()) {
            (
                ReleaseMotion::Sticks {
                    period,
                    stuck_after,
                    states,
                },
                Some(expected),
            ) => {
                assert_eq!(*period as u64, expected, "{case}");
                assert_eq!(states.len(), *period);
                let reference: f64 = case["t_stick_over_T"].as_str().unwrap().parse().unwrap();
                assert!(
                    (stuck_after - reference).abs() < 1e-14 * reference,
                    "{stuck_after} {case}"
                );
                closed += 1;
            }
            (ReleaseMotion::Open { .. }, None) => {}
            // The same program as the reference's, with 160 digits and 520 periods: 490.912585214727 and
            // 456.90021802261.
            (ReleaseMotion::Sticks { period, .. }, None) if oscillator.omega == 2.855 => {
                assert_eq!(*period, 491);
            }
            (ReleaseMotion::Sticks { period, .. }, None) if oscillator.omega == 2.89 => {
                assert_eq!(*period, 457);
            }
            (other, _) => panic!("{other:?} {case}"),
        }
    }
    assert_eq!(closed, 9);
}

/// At ω = 2.9 and 2.87 all starts come to the superstable orbit of the reference, in every study; none is
/// called chaotic.
#[test]
fn motions_that_stick_are_on_the_superstable_orbit() {
    for (omega, period) in [(2.9, 170), (2.87, 75), (2.86, 7)] {
        let model = rigid(omega, 0.8).model().unwrap();
        let options = AttractorsOptions {
            starts: Some(32),
            ..AttractorsOptions::default()
        };
        let found = attractors(&model, &options, &Control::default()).unwrap();
        let [only] = &found.attractors[..] else {
            panic!("{omega}: {} attractors", found.attractors.len())
        };
        assert_eq!(only.classification, Classification::Periodic);
        assert_eq!(only.share.count, 32);
        assert_eq!(only.lyapunov, [f64::NEG_INFINITY; 2]);
        let report = only.orbit.as_ref().unwrap();
        assert_eq!(report.period, period);
        assert_eq!(
            (report.stability, report.determinant_defect),
            ("stable", 0.0)
        );
        assert_eq!(report.multipliers, [[0.0; 2]; 2]);
        // A period's rounding only, though errors grow by 1e39 over the orbit.
        assert!(report.residual < 1e-11, "{}", report.residual);
        let balance = report.observables.energy_balance;
        assert!(balance.residual.abs() < 1e-9, "{balance:?}");
        let closed = orbit(&model, &OrbitOptions::default()).unwrap();
        assert_eq!((closed.period, closed.stable), (period, true));
        let run = simulate(&model, &SimulateOptions::default()).unwrap();
        assert_eq!(run.period, Some(period));
        let spectrum = lyapunov(
            &model,
            &LyapunovOptions {
                points: 10,
                ..LyapunovOptions::default()
            },
            &Control::default(),
        )
        .unwrap();
        assert_eq!(spectrum.exponents, [f64::NEG_INFINITY; 2]);
        assert_eq!(spectrum.sum_by_trace, f64::NEG_INFINITY);
    }
}

/// With damping 0.05 and a gap of 0.25, the motion from rest at ω = 2.4 comes to the linear response,
/// which does not touch the stop: both exponents are −cT/2 = −π c/ω a drive period exactly, −0.06545. An
/// average over a run has the impacts of its transient in it.
#[test]
fn exponents_of_a_closed_orbit_are_those_of_its_multipliers() {
    let oscillator = Oscillator {
        damping: 0.05,
        gap: 0.25,
        ..rigid(2.4, 0.7)
    };
    let options = LyapunovOptions {
        state: Some(vec![0.0, 0.0].into()),
        points: 10,
        ..LyapunovOptions::default()
    };
    let report = lyapunov(&oscillator.model().unwrap(), &options, &Control::default()).unwrap();
    let exact = -std::f64::consts::PI * 0.05 / 2.4;
    assert_eq!(report.source, ExponentSource::Multipliers);
    for exponent in &report.exponents {
        assert!((exponent - exact).abs() < 1e-12, "{exponent} {exact}");
    }
    assert!((report.sum_by_trace - 2.0 * exact).abs() < 1e-12);
    assert!(report.determinant_defect.unwrap() < 1e-11);
}

/// The check of Jacobians against the trace comes out as rounding along chaos with impacts, and it is
/// not the sum itself: ẍ + x = cos 2.8t without damping and with a soft stop of restitution below one.
#[test]
fn the_trace_is_compared_in_every_period() {
    let oscillator = Oscillator {
        damping: 0.1,
        gap: 0.0,
        stop: Stop::Soft {
            stiffness: 100.0,
            damping: 1.0,
        },
        ..rigid(2.8, 0.8)
    };
    let options = LyapunovOptions {
        points: 10,
        periods: 2000,
        ..LyapunovOptions::default()
    };
    let report = lyapunov(&oscillator.model().unwrap(), &options, &Control::default()).unwrap();
    assert!(report.determinant_defect.unwrap() < 1e-9, "{report:?}");
}

/// Whatever the parameters, a motion that has come to rest on its stop is not called chaotic, and
/// neither is the motion that leaves from there.
#[test]
fn motions_that_stick_are_never_called_chaotic() {
    // Of the reference, those that do not close within its search, and those that do.
    for (omega, damping, gap, restitution) in [
        (2.9, 0.0, 0.1, 0.8),
        (2.855, 0.0, 0.0, 0.8),
        (2.4, 0.05, 0.25, 0.7),
        (2.895, 0.0, 0.0, 0.8),
        (3.3, 0.02, 0.05, 0.6),
    ] {
        let oscillator = Oscillator {
            damping,
            gap,
            ..rigid(omega, restitution)
        };
        // At the stop, at rest, pressed on it at drive phase 0.
        let options = SimulateOptions {
            state: Some(vec![gap, 0.0].into()),
            periods: 4,
            ..SimulateOptions::default()
        };
        let model = oscillator.model().unwrap();
        let run = simulate(&model, &options).unwrap();
        let sticks_again = matches!(
            Release::new(&oscillator).unwrap().motion(),
            ReleaseMotion::Sticks { .. }
        );
        let allowed: &[Classification] = if sticks_again {
            &[Classification::Periodic]
        } else {
            // It may leave the stop for a stable orbit.
            &[Classification::Undecided, Classification::Periodic]
        };
        assert!(
            allowed.contains(&run.classification),
            "{omega}: {:?}",
            run.classification
        );
    }
}
