//! Importance of the modes.

use nanotap::control::Control;
use nanotap::model::cantilever::Cantilever;
use nanotap::study::convergence::{ConvergenceOptions, convergence};

/// Far from the sample each mode is an independent damped oscillator: its energy, and its share of
/// the tip's motion, follow from a_j = (Ω² − iα3Ω) I_j α2/(β_j⁴ − Ω² + iα3Ω) (no tip mass).
#[test]
fn shares_of_a_free_lever_are_the_closed_form() {
    let case = Cantilever {
        alpha1: 0.0,
        alpha5: 100.0,
        omega: 20.0,
        ..Cantilever::paper()
    };
    let found = convergence(
        &case,
        &ConvergenceOptions {
            largest: 4,
            ..ConvergenceOptions::default()
        },
        &Control::default(),
    )
    .unwrap();
    let modes = nanotap::model::beam::Modes::new(4).unwrap();
    let square = case.omega * case.omega;
    let response: Vec<nalgebra::Complex<f64>> = (0..4)
        .map(|j| {
            let load = nalgebra::Complex::new(square, -case.alpha3 * case.omega);
            let impedance =
                nalgebra::Complex::new(modes.stiffness[j] - square, case.alpha3 * case.omega);
            load * modes.integral[j] / impedance
        })
        .collect();
    let energy: Vec<f64> = (0..4)
        .map(|j| (square + modes.stiffness[j]) * response[j].norm_sqr())
        .collect();
    let tip: nalgebra::Complex<f64> = (0..4).map(|j| response[j] * modes.tip[j]).sum();
    let shares = &found.readings.mode_shares;
    for (j, share) in shares.iter().enumerate() {
        let expected = energy[j] / energy.iter().sum::<f64>();
        assert!(
            (share.energy - expected).abs() < 1e-9,
            "{share:?} {expected}"
        );
        let expected = (response[j] * modes.tip[j] * tip.conj()).re / tip.norm_sqr();
        assert!((share.tip - expected).abs() < 1e-9, "{share:?} {expected}");
        assert!(share.force.is_none());
    }
    // Near its second resonance (Ω₂ = 22.03) the lever oscillates in its second mode.
    assert!(shares[1].energy > 0.9);
}

/// Shares sum to one, and "enough" follows from the differences.
#[test]
fn enough_is_the_smallest_number_with_small_differences_from_there_on() {
    let case = Cantilever {
        alpha1: 0.0,
        omega: 20.0,
        ..Cantilever::paper()
    };
    let tolerance = 0.05;
    let options = ConvergenceOptions {
        largest: 6,
        tolerance,
        period: Some(1),
    };
    let found = convergence(&case, &options, &Control::default()).unwrap();
    let report = &found.readings;
    let sum = |of: fn(&nanotap::study::mode_share::ModeShare) -> f64| -> f64 {
        report.mode_shares.iter().map(of).sum()
    };
    assert!((sum(|s| s.energy) - 1.0).abs() < 1e-12);
    assert!((sum(|s| s.tip) - 1.0).abs() < 1e-10);
    assert!((sum(|s| s.force.unwrap()) - 1.0).abs() < 1e-10);
    let within = |n: usize| {
        report.reading_differences[n - 1].is_some_and(|d| {
            d.first_harmonic <= tolerance
                && d.phase.to_radians() <= tolerance
                && d.dissipation <= tolerance
                && d.peak_force <= tolerance
        })
    };
    match report.enough_readings.all {
        Some(n) => {
            assert!((n..=6).all(within) && (n == 1 || !within(n - 1)));
            assert!(report.reading_verdict.contains(&format!("{n} mode")));
        }
        None => assert!(!within(5)),
    }
    // 0 vs 0: the relative difference is 0.
    let last = report.reading_differences[5].unwrap();
    assert_eq!(
        (last.first_harmonic, last.phase, last.peak_force),
        (0.0, 0.0, 0.0)
    );
}

/// A chaotic motion has no single value: the verdict reports this.
#[test]
fn a_motion_without_an_orbit_is_undecided() {
    let found = convergence(
        &Cantilever::paper(),
        &ConvergenceOptions {
            largest: 3,
            ..ConvergenceOptions::default()
        },
        &Control::default(),
    )
    .unwrap();
    assert!(found.readings.reading_verdict.starts_with("undecided"));
    assert!(
        found.motions[2]
            .reason
            .as_ref()
            .is_some_and(|r| r.contains("not periodic"))
    );
    assert!(found.readings.enough_readings.all.is_none());
}
