//! Lyapunov spectra and Birkhoff averages.

use std::convert::Infallible;

use nanotap_dynamics::{
    DMatrix, LyapunovOptions, LyapunovSpectrum, StroboscopicMap, birkhoff_digits, lyapunov_spectrum,
};

use crate::systems::{Focus, Formula, Henon, Logistic, System, Turning, advanced};

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
    let mut x = advanced(&mut map, &[0.1, 0.1], 100);
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

/// A map with one Jacobian for all states, whose log|det| is known independently.
#[derive(Clone)]
struct Constant {
    jacobian: DMatrix<f64>,
    log_determinant: Option<f64>,
}

impl nanotap_dynamics::Scheduling for Constant {}

impl StroboscopicMap for Constant {
    type Error = Infallible;

    fn dimension(&self) -> usize {
        self.jacobian.nrows()
    }

    fn period(&self) -> f64 {
        1.0
    }

    fn advance(&mut self, _state: &mut [f64]) -> Result<(), Infallible> {
        Ok(())
    }

    fn advance_with_jacobian(
        &mut self,
        _state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), Infallible> {
        jacobian.copy_from(&self.jacobian);
        Ok(())
    }

    fn advance_with_jacobian_and_determinant(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<Option<f64>, Infallible> {
        self.advance_with_jacobian(state, jacobian)?;
        Ok(self.log_determinant)
    }
}

fn exponents_of(entries: &[f64], log_determinant: Option<f64>) -> LyapunovSpectrum {
    let d = entries.len().isqrt();
    let mut map = Constant {
        jacobian: DMatrix::from_row_slice(d, d, entries),
        log_determinant,
    };
    lyapunov_spectrum(&mut map, &mut vec![0.0; d], &fixed(64)).unwrap()
}

/// (1, 1/2) (1, 1)ᵀ, of rank one, stretches by 3/2. The remainder of a determinant of 3/2 e⁻⁶⁰,
/// which a double-precision Jacobian cannot show, is assigned to the direction that is lost in
/// rounding. A direction that is not lost keeps its measured length.
#[test]
fn the_determinant_replaces_what_the_jacobian_lost() {
    let first = 1.5f64.ln();
    let lost = exponents_of(&[1.0, 1.0, 0.5, 0.5], Some(first - 60.0));
    assert!((lost.exponents[0] - first).abs() < 1e-13);
    assert!(
        (lost.exponents[1] + 60.0).abs() < 1e-12,
        "{:?}",
        lost.exponents
    );
    assert!((lost.log_determinant - (first - 60.0)).abs() < 1e-12);
    let seen = exponents_of(&[2.0, 0.0, 0.0, 0.5], Some(-0.25));
    assert!((seen.exponents[1] + 2f64.ln()).abs() < 1e-13);
    assert_eq!(seen.log_determinant, -0.25);
    // Without an independent value it is that of the Jacobian: 3 · 4 − 2 · 1.
    let own = exponents_of(&[3.0, 2.0, 1.0, 4.0], None);
    assert!((own.log_determinant - 10f64.ln()).abs() < 1e-13);
}

/// Directions that are mapped to zero do not affect the exponents of the others.
#[test]
fn vanishing_directions_do_not_affect_the_others() {
    let s = exponents_of(&[0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0], None);
    assert!(
        (s.exponents[0] - 2f64.ln()).abs() < 1e-12,
        "{:?}",
        s.exponents
    );
    let nothing = f64::MIN_POSITIVE.ln();
    assert!((s.exponents[1] - nothing).abs() < 1e-9);
    assert!((s.exponents[2] - nothing).abs() < 1e-9);
}

/// x → −ρ x: the mean is zero to all digits; the mean square decreases by ρ²ᵀ from one part of T
/// periods to the next, about ρᵀ e^(±…) in the middle of each; in units of the squared spread, 4.
#[test]
fn mean_squares_of_a_slow_spiral_are_not_those_of_a_torus() {
    let mut map = Constant {
        jacobian: DMatrix::from_element(1, 1, 0.0),
        log_determinant: None,
    };
    // At rest there is nothing to compare: all digits.
    assert_eq!(birkhoff_digits(&mut map, &mut [3.0], 100).unwrap(), 16.0);
    let mut spiral = System(Alternating {
        rho: 0.9999,
        noise: 0.0,
        unit: 1.0,
    });
    let digits = birkhoff_digits(&mut spiral, &mut [1.0, 0.0], 1000).unwrap();
    let expected = -((0.9999f64.powi(1000) - 0.9999f64.powi(3000)) / 4.0).log10();
    assert!((digits - expected).abs() < 0.02, "{digits} {expected}");
}

/// x → −ρ x together with a chaotic number of size `noise` (Ulam's map), both in a unit.
#[derive(Clone, Debug)]
struct Alternating {
    rho: f64,
    noise: f64,
    unit: f64,
}

impl Formula for Alternating {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = -self.rho * x[0];
        let size = self.noise * self.unit;
        out[1] = if size == 0.0 {
            0.0
        } else {
            size * (1.0 - 2.0 * (x[1] / size).powi(2))
        };
    }
    fn jacobian(&self, _x: &[f64], out: &mut DMatrix<f64>) {
        out.fill(0.0);
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
}

/// A coordinate with 1e-10 of the motion of the others is rounding; one with 1e-2 is not, in any
/// unit.
#[test]
fn tiny_coordinates_do_not_count_in_any_unit() {
    for unit in [1.0, 1e-6, 1e6] {
        let digits = |noise: f64| {
            let mut map = System(Alternating {
                rho: 1.0,
                noise,
                unit,
            });
            birkhoff_digits(&mut map, &mut [unit, 0.3 * noise * unit], 1000).unwrap()
        };
        assert!(digits(1e-11) > 14.0, "{unit}: {}", digits(1e-11));
        assert!(digits(1e-2) < 5.0, "{unit}: {}", digits(1e-2));
    }
}

/// A rotation about a distant centre gives the digits of one about the origin, except for those
/// that its states have lost.
#[test]
fn a_mean_far_from_zero_costs_no_digits() {
    let (s, c) = 2.4f64.sin_cos();
    let centre = 1e6;
    let mut x = [centre + 1.0, centre];
    let mut map = System(Shifted { s, c, centre });
    assert!(birkhoff_digits(&mut map, &mut x, 2000).unwrap() > 8.0);
}

#[derive(Clone, Debug)]
struct Shifted {
    s: f64,
    c: f64,
    centre: f64,
}

impl Formula for Shifted {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let (u, v) = (x[0] - self.centre, x[1] - self.centre);
        out[0] = self.centre + self.c * u - self.s * v;
        out[1] = self.centre + self.s * u + self.c * v;
    }
    fn jacobian(&self, _x: &[f64], out: &mut DMatrix<f64>) {
        out.fill(0.0);
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
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
    let mut x = advanced(&mut map, &[0.3, 0.1], 200);
    let s = lyapunov_spectrum(&mut map, &mut x, &fixed(20_000)).unwrap();
    assert!(s.exponents[0].abs() < 1e-10);
    assert!((s.exponents[1] - (1.0f64 - 2.0 * gain).ln()).abs() < 1e-10);
}

/// An adaptive run stops once the error bars are small enough, and at the latest at its limit.
#[test]
fn the_length_follows_the_requested_error() {
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

/// Both exponents of a stable focus are ln ρ.
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
fn birkhoff_digits_distinguish_a_torus_from_chaos() {
    let golden = 2.0 * std::f64::consts::PI * 0.618_033_988_749_894_9;
    let mut torus = System(Turning {
        angle: golden,
        gain: 0.2,
    });
    let mut x = advanced(&mut torus, &[0.3, 0.1], 200);
    assert!(birkhoff_digits(&mut torus, &mut x, 4000).unwrap() > 12.0);
    // A spiral that loses 1e-7 of its size per revolution is not yet a torus.
    let mut spiral = System(Focus {
        radius: 1.0 - 1e-7,
        angle: golden,
    });
    let digits = birkhoff_digits(&mut spiral, &mut [3.0, 0.0], 4000).unwrap();
    assert!(digits < 5.0, "{digits}");
    let mut chaos = System(Henon { a: 1.4, b: 0.3 });
    let mut x = advanced(&mut chaos, &[0.1, 0.1], 200);
    assert!(birkhoff_digits(&mut chaos, &mut x, 4000).unwrap() < 4.0);
}
