//! Lyapunov spectra and Birkhoff averages.

use nanotap_dynamics::{LyapunovOptions, birkhoff_digits, lyapunov_spectrum};

use crate::systems::{Focus, Henon, Logistic, System, Turning, thrown};

fn fixed(periods: usize) -> LyapunovOptions {
    LyapunovOptions {
        min_periods: periods,
        max_periods: periods,
        ..LyapunovOptions::default()
    }
}

/// λ₁ = 0.41922 (Sprott 2003), sum ln b exactly.
#[test]
fn the_henon_attractor_has_the_published_spectrum() {
    let mut map = System(Henon { a: 1.4, b: 0.3 });
    let mut x = thrown(&mut map, &[0.1, 0.1], 100);
    let s = lyapunov_spectrum(&mut map, &mut x, &fixed(200_000)).unwrap();
    let (largest, error) = s.largest();
    assert!(error < 2e-3);
    assert!(
        (largest - 0.41922).abs() < 4.0 * error + 1e-5,
        "{largest} {error}"
    );
    assert!((s.exponents[0] + s.exponents[1] - 0.3f64.ln()).abs() < 1e-10);
    // 1 + 0.41922/1.62319.
    assert!((s.kaplan_yorke_dimension() - 1.2583).abs() < 2e-3);
}

#[test]
fn the_full_logistic_map_has_ln_2() {
    let mut map = System(Logistic(4.0));
    let s = lyapunov_spectrum(&mut map, &mut [0.123], &fixed(100_000)).unwrap();
    let (largest, error) = s.largest();
    assert!((largest - 2f64.ln()).abs() < 5.0 * error.max(1e-4));
}

/// A torus: 0 along it, ln(1 − 2g) across, both converging as 1/T.
#[test]
fn a_rigidly_turning_circle_has_exponent_zero() {
    let gain = 0.2;
    let mut map = System(Turning { angle: 2.4, gain });
    let mut x = thrown(&mut map, &[0.3, 0.1], 200);
    let s = lyapunov_spectrum(&mut map, &mut x, &fixed(20_000)).unwrap();
    assert!(s.exponents[0].abs() < 1e-10);
    assert!((s.exponents[1] - (1.0f64 - 2.0 * gain).ln()).abs() < 1e-10);
}

/// An adaptive run stops once the bars are met, and no later than allowed.
#[test]
fn the_length_follows_the_error_asked_for() {
    let mut map = System(Henon { a: 1.4, b: 0.3 });
    let run = |relative_error| {
        let options = LyapunovOptions {
            min_periods: 500,
            max_periods: 60_000,
            absolute_error: 0.0,
            relative_error,
            ..LyapunovOptions::default()
        };
        lyapunov_spectrum(&mut map.clone(), &mut [0.1, 0.1], &options).unwrap()
    };
    let loose = run(0.05);
    let tight = run(0.008);
    assert!(tight.periods > loose.periods && tight.periods <= 60_000);
    assert!(tight.errors[0] <= 0.008 * tight.exponents[0]);
    let mut x = [0.5, f64::NAN];
    assert!(lyapunov_spectrum(&mut map, &mut x, &fixed(10)).is_err());
}

/// Exponents of a stable focus are ln ρ, both.
#[test]
fn a_focus_decays_at_the_logarithm_of_its_multiplier() {
    let mut map = System(Focus {
        radius: 0.9,
        angle: 0.7,
    });
    let s = lyapunov_spectrum(&mut map, &mut [5.0, 1.0], &fixed(1000)).unwrap();
    for e in &s.exponents {
        assert!((e - 0.9f64.ln()).abs() < 1e-12);
    }
    assert_eq!(s.kaplan_yorke_dimension(), 0.0);
}

#[test]
fn birkhoff_digits_tell_a_torus_from_chaos() {
    let golden = 2.0 * std::f64::consts::PI * 0.618_033_988_749_894_9;
    let mut torus = System(Turning {
        angle: golden,
        gain: 0.2,
    });
    let mut x = thrown(&mut torus, &[0.3, 0.1], 200);
    assert!(birkhoff_digits(&mut torus, &mut x, 4000).unwrap() > 12.0);
    // A spiral that loses 1e-7 of its size per turn is no torus yet.
    let mut spiral = System(Focus {
        radius: 1.0 - 1e-7,
        angle: golden,
    });
    let digits = birkhoff_digits(&mut spiral, &mut [3.0, 0.0], 4000).unwrap();
    assert!(digits < 5.0, "{digits}");
    let mut chaos = System(Henon { a: 1.4, b: 0.3 });
    let mut x = thrown(&mut chaos, &[0.1, 0.1], 200);
    assert!(birkhoff_digits(&mut chaos, &mut x, 4000).unwrap() < 4.0);
}
