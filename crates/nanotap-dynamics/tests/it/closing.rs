//! Newton's method, minimal periods and multipliers.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::{
    DMatrix, DivergenceReason, PeriodicOrbit, ShootingError, ShootingOptions, Stability,
    StroboscopicMap, close_orbit,
};

use crate::systems::{Flagged, Focus, Formula, Henon, Logistic, System};

/// If the flag of the guess differs from that of the orbit, Newton takes it from the map; flags do
/// not count in distances. Fixed points: μ below 1, μ + 1/50 above.
#[test]
fn discrete_entries_are_taken_from_the_map() {
    let options = ShootingOptions::default();
    let closed = |mu: f64, guess: [f64; 2]| {
        close_orbit(&mut System(Flagged(mu)), &guess, 1, &options).unwrap()
    };
    let below = closed(0.9, [0.8, 0.0]);
    let above = closed(1.1, [0.9, 0.0]);
    for (orbit, x, flag) in [(&below, 0.9, 0.0), (&above, 1.12, 1.0)] {
        assert!((orbit.states[0][0] - x).abs() < 1e-15);
        assert_eq!(orbit.states[0][1], flag);
        assert!((orbit.scale() - x).abs() < 1e-15);
    }
    assert!((above.distance_to(&below).1 - 0.22).abs() < 1e-15);
    // The flag of the start differs from that of the orbit, too.
    assert!(closed(0.9, [0.95, 1.0]).is_same_as(&below));
}

#[test]
fn the_henon_fixed_point_closes_to_rounding() {
    let mut map = System(Henon { a: 0.3, b: 0.3 });
    let exact = map.0.fixed_point();
    let orbit = close_orbit(&mut map, &[0.5, 0.0], 1, &ShootingOptions::default()).unwrap();
    assert_eq!(orbit.period, 1);
    assert!((orbit.states[0][0] - exact[0]).abs() < 1e-15);
    assert!((orbit.states[0][1] - exact[1]).abs() < 1e-15);
    assert!(orbit.error < 1e-13 && orbit.residual < 1e-15);
    // μ² + 2 a x μ − b = 0.
    let p = map.0.a * exact[0];
    let root = (p * p + map.0.b).sqrt();
    assert!((orbit.multipliers[0].re - (-p - root)).abs() < 1e-14);
    assert!((orbit.multipliers[1].re - (-p + root)).abs() < 1e-14);
    assert!((orbit.log_determinant - 0.3f64.ln()).abs() < 1e-14);
    assert_eq!(orbit.stability, Stability::Stable);
}

/// Period 4 requested at a fixed point gives the fixed point: 1 and 2 are tried.
#[test]
fn a_multiple_of_the_period_gives_the_minimal_period() {
    let mut map = System(Logistic(2.8));
    for period in [2, 3, 4, 12] {
        let orbit = close_orbit(&mut map, &[0.6], period, &ShootingOptions::default()).unwrap();
        assert_eq!(orbit.period, 1);
        assert!((orbit.states[0][0] - (1.0 - 1.0 / 2.8)).abs() < 1e-15);
    }
}

/// Just past the doubling at r = 3 the two points are ±√(r−3)·const apart, and the fixed point
/// still exists: the two orbits must be distinguished at any distance.
#[test]
fn a_doubled_orbit_is_distinguished_from_its_parent_near_the_flip() {
    for excess in [1e-2, 1e-4, 1e-6, 1e-8] {
        let r: f64 = 3.0 + excess;
        let mut map = System(Logistic(r));
        let root = ((r + 1.0) * (r - 3.0)).sqrt();
        let exact = (r + 1.0 + root) / (2.0 * r);
        let orbit = close_orbit(&mut map, &[exact], 2, &ShootingOptions::default()).unwrap();
        assert_eq!(orbit.period, 2, "at r = 3 + {excess}");
        let high = orbit.states[0][0].max(orbit.states[1][0]);
        assert!((high - exact).abs() <= 10.0 * orbit.error);
        // μ = 4 + 2r − r².
        let multiplier = 4.0 + 2.0 * r - r * r;
        assert!((orbit.multipliers[0].re - multiplier).abs() < 1e-9);
        let parent = close_orbit(&mut map, &[1.0 - 1.0 / r], 2, &ShootingOptions::default());
        assert!(parent.is_err() || parent.unwrap().period == 1);
    }
}

/// A period-17 orbit of the chaotic Hénon map: errors of single shooting would grow by e^{0.42·17}
/// ≈ 1260, and more along unfavourable segments.
#[test]
fn long_unstable_orbits_close_and_repeat() {
    let mut map = System(Henon { a: 1.4, b: 0.3 });
    let mut start = vec![0.1, 0.1];
    let mut closed = 0;
    for _ in 0..400 {
        map.advance(&mut start).unwrap();
        let Ok(orbit) = close_orbit(&mut map, &start, 17, &ShootingOptions::default()) else {
            continue;
        };
        assert!(orbit.period == 17 || orbit.period == 1);
        if orbit.period == 17 {
            closed += 1;
            assert!(orbit.residual < 1e-14);
            assert_eq!(
                orbit.stability,
                Stability::Unstable {
                    unstable_dimension: 1
                }
            );
            // |det| = b^17, although the other multiplier is in the thousands.
            let sum: f64 = orbit.multipliers.iter().map(|m| m.modulus().ln()).sum();
            assert!((sum - 17.0 * 0.3f64.ln()).abs() < 1e-8);
        }
    }
    assert!(closed > 10, "{closed}");
}

#[test]
fn an_undamped_oscillator_is_marginal() {
    let mut map = System(Focus {
        radius: 1.0,
        angle: 1.0,
    });
    let orbit = close_orbit(&mut map, &[0.0, 0.0], 1, &ShootingOptions::default()).unwrap();
    assert_eq!(orbit.stability, Stability::Marginal);
}

/// Below its fold (a < −(1−b)²/4) the Hénon map has no fixed point.
#[test]
fn without_an_orbit_newton_reports_a_failure() {
    let mut map = System(Henon { a: -0.2, b: 0.3 });
    let error = close_orbit(&mut map, &[1.0, 0.0], 1, &ShootingOptions::default()).unwrap_err();
    assert!(matches!(
        error,
        ShootingError::Diverged { .. } | ShootingError::Singular { .. }
    ));
}

/// x → x + c + x², whose fixed points meet at c = 0: beyond it, the multiplier where Newton stalls
/// shows how far.
#[derive(Clone, Debug)]
struct Saddle(f64);

impl Formula for Saddle {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] + self.0 + x[0] * x[0];
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = 1.0 + 2.0 * x[0];
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out[0] = 1.0;
    }
}

#[test]
fn a_stall_near_a_fold_has_its_own_reason() {
    let options = ShootingOptions {
        residual_tolerance: 1e-15,
        ..ShootingOptions::default()
    };
    let stalled = |c: f64, options: &ShootingOptions| {
        close_orbit(&mut System(Saddle(c)), &[0.1], 1, options).unwrap_err()
    };
    match stalled(1e-12, &options) {
        ShootingError::Singular {
            distance, residual, ..
        } => {
            assert!(distance < 1e-6, "{distance}");
            assert!((residual / 1e-12 - 1.0).abs() < 0.1, "{residual}");
        }
        other => panic!("{other}"),
    }
    let reason = |error: ShootingError| match error {
        ShootingError::Diverged { reason, .. } => reason,
        other => panic!("{other}"),
    };
    let far = reason(stalled(1e-3, &options));
    assert_eq!(far, DivergenceReason::NoDescent);
    let unexplained = ShootingOptions {
        explains_stalls: false,
        ..options
    };
    let near = reason(stalled(1e-12, &unexplained));
    assert_eq!(near, DivergenceReason::NoDescent);
}

/// Every point is shifted by the same amount: no orbit closes, and a multiplier is 1.
#[derive(Clone, Debug)]
struct Shift;

impl Formula for Shift {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] + 0.125;
        out[1] = 0.5 * x[1];
    }
    fn jacobian(&self, _x: &[f64], out: &mut DMatrix<f64>) {
        out.copy_from(&DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.5]));
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
}

#[test]
fn a_shift_is_singular() {
    let error = close_orbit(
        &mut System(Shift),
        &[0.5, 0.5],
        1,
        &ShootingOptions::default(),
    );
    let Err(ShootingError::Singular { distance, .. }) = error else {
        panic!("{error:?}")
    };
    assert_eq!(distance, 0.0);
}

/// x → x − atan x: Newton's full step from beyond 1.3917 leads away from 0 (a well-known example),
/// a shorter one does not.
#[derive(Clone, Debug)]
struct Arctangent;

impl Formula for Arctangent {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] - x[0].atan();
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = 1.0 - 1.0 / (1.0 + x[0] * x[0]);
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out[0] = 0.0;
    }
}

#[test]
fn steps_that_lead_away_are_shortened() {
    for start in [1.5, 5.0, 20.0] {
        let found = close_orbit(
            &mut System(Arctangent),
            &[start],
            1,
            &ShootingOptions::default(),
        );
        assert!(found.unwrap().states[0][0].abs() < 1e-12);
    }
}

/// The fixed point 3/4 of the full logistic map has the multiplier −2.
#[test]
fn unstable_orbits_are_rejected_on_request() {
    let closed = |max_growth: f64| {
        let options = ShootingOptions {
            max_growth,
            ..ShootingOptions::default()
        };
        close_orbit(&mut System(Logistic(4.0)), &[0.76], 1, &options)
    };
    let Err(ShootingError::Diverged {
        iterations, reason, ..
    }) = closed(1.5)
    else {
        panic!("closed")
    };
    assert_eq!((iterations, reason), (0, DivergenceReason::Unstable));
    assert!((closed(3.0).unwrap().multipliers[0].re + 2.0).abs() < 1e-14);
}

/// The Hénon map in other units, with each result rounded to 40 bits, as for a map that is
/// integrated to a tolerance.
#[derive(Clone, Debug)]
struct Coarse(f64);

impl Formula for Coarse {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let bits = 2f64.powi(40);
        Henon { a: 0.3, b: 0.3 }.image(&[x[0] / self.0, x[1] / self.0], out);
        for value in out {
            *value = self.0 * ((*value * bits).round() / bits);
        }
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        Henon { a: 0.3, b: 0.3 }.jacobian(&[x[0] / self.0, x[1] / self.0], out);
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
}

#[test]
fn the_requested_accuracy_is_relative_to_the_orbit() {
    let exact = Henon { a: 0.3, b: 0.3 }.fixed_point();
    for unit in [1e-6, 1.0, 1e6] {
        for max_iterations in [40, 4] {
            let options = ShootingOptions {
                max_iterations,
                ..ShootingOptions::default()
            };
            let guess = [0.9 * unit, 0.3 * unit];
            let orbit = close_orbit(&mut System(Coarse(unit)), &guess, 1, &options).unwrap();
            assert!((orbit.states[0][0] / unit - exact[0]).abs() < 1e-11);
            assert!(orbit.error < 1e-11 * unit);
        }
    }
    let options = ShootingOptions {
        max_iterations: 1,
        ..ShootingOptions::default()
    };
    let error = close_orbit(&mut System(Coarse(1e6)), &[5e6, 0.0], 1, &options).unwrap_err();
    let ShootingError::Diverged {
        iterations, reason, ..
    } = error
    else {
        panic!("{error}")
    };
    assert_eq!((iterations, reason), (1, DivergenceReason::TooManySteps));
}

/// Neighbouring orbits of period 2: the smallest over shifts of the largest distance; of equal
/// values the first shift.
#[test]
fn the_distance_of_orbits_is_over_all_their_states() {
    let fixed = close_orbit(
        &mut System(Logistic(2.8)),
        &[0.6],
        1,
        &ShootingOptions::default(),
    )
    .unwrap();
    let orbit = |states: [f64; 2]| PeriodicOrbit {
        period: 2,
        states: states.iter().map(|x| vec![*x]).collect(),
        ..fixed.clone()
    };
    assert_eq!(orbit([0.0, 5.0]).distance_to(&orbit([0.0, 1.0])), (0, 4.0));
    assert_eq!(orbit([0.0, 5.0]).distance_to(&orbit([4.0, 0.5])), (1, 1.0));
    assert_eq!(orbit([0.0, 1.0]).distance_to(&orbit([0.5, 0.5])), (0, 0.5));
    assert_eq!(orbit([0.0, 1.0]).distance_to(&fixed), (0, f64::INFINITY));
}

/// Every point of a rigid rotation by a rational angle is periodic: not isolated.
#[test]
fn a_continuum_of_orbits_is_singular() {
    let mut map = System(Focus {
        radius: 1.0,
        angle: std::f64::consts::FRAC_PI_2,
    });
    let error = close_orbit(&mut map, &[3.0, 0.3], 4, &ShootingOptions::default());
    match error {
        Err(ShootingError::Singular { distance, .. }) => assert!(distance < 1e-12),
        // Its centre is the fixed point, which is a valid result too.
        Ok(orbit) => assert_eq!(orbit.period, 1),
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn bad_guesses_are_refused() {
    let mut map = System(Logistic(3.0));
    let options = ShootingOptions::default();
    for (guess, period) in [
        (vec![], 1),
        (vec![0.1, 0.2], 1),
        (vec![f64::NAN], 1),
        (vec![0.1], 0),
    ] {
        assert!(matches!(
            close_orbit(&mut map, &guess, period, &options),
            Err(ShootingError::BadGuess(_))
        ));
    }
    assert!(matches!(
        close_orbit(&mut map, &[1e300], 3, &options),
        Err(ShootingError::Map(_))
    ));
}
