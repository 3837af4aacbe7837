//! Classification of the motion from one start.

use nanotap_dynamics::{
    Chaos, ClassifyOptions, LyapunovOptions, MotionKind, UndecidedReason, classify, classify_beside,
};

use crate::systems::{
    Calming, Cubic, DelayedLogistic, Focus, Henon, Logistic, OpenTent, System, Turning,
};

fn period_of(verdict: &MotionKind) -> usize {
    match verdict {
        MotionKind::Periodic(orbit) => {
            assert!(orbit.is_stable());
            orbit.period
        }
        other => panic!("not periodic: {other:?}"),
    }
}

/// Logistic map: periods 1, 2, 4, the period-3 window, and a fixed point 1e-5 before its doubling,
/// where 1 − |μ| = 1e-5: neither a long period nor chaos.
#[test]
fn known_periods_are_found() {
    let options = ClassifyOptions::default();
    for (r, period) in [
        (2.9, 1),
        (3.2, 2),
        (3.5, 4),
        (3.83, 3),
        (2.99999, 1),
        (3.55, 8),
    ] {
        let classified = classify(&mut System(Logistic(r)), &[0.3], &options);
        assert_eq!(period_of(&classified.kind), period, "r = {r}");
    }
}

/// A focus with |μ| = 0.9999 whose angle is near 2π/5: strobe points nearly repeat after 5 periods
/// for thousands of periods.
#[test]
fn slow_decay_is_not_a_long_period() {
    let mut map = System(Focus {
        radius: 0.9999,
        angle: 2.0 * std::f64::consts::PI / 5.0 + 1e-4,
    });
    let classified = classify(&mut map, &[40.0, 0.0], &ClassifyOptions::default());
    assert_eq!(period_of(&classified.kind), 1);
    assert!(classified.periods <= 64, "{}", classified.periods);
}

#[test]
fn the_henon_attractor_is_chaotic_with_a_bound() {
    let classified = classify(
        &mut System(Henon { a: 1.4, b: 0.3 }),
        &[0.1, 0.1],
        &ClassifyOptions::default(),
    );
    let MotionKind::Chaotic(chaos) = classified.kind else {
        panic!("{:?}", classified.kind)
    };
    let (largest, error) = chaos.spectrum.largest();
    assert!((largest - 0.41922).abs() < 5.0 * error);
    assert_eq!(chaos.lifetime_above, chaos.observed as f64 / 3.0);
}

/// Past its Neimark–Sacker point at a = 2 the delayed logistic map moves on a
/// closed curve.
#[test]
fn tori_are_reported_with_their_evidence() {
    for start in [[0.6, 0.5], [0.45, 0.5]] {
        let classified = classify(
            &mut System(DelayedLogistic(2.05)),
            &start,
            &ClassifyOptions::default(),
        );
        let MotionKind::QuasiPeriodic(torus) = classified.kind else {
            panic!("{:?}", classified.kind)
        };
        assert!(torus.birkhoff_digits > 7.0);
        assert!(torus.spectrum.largest().0.abs() < 1e-3);
        assert!(torus.spectrum.exponents[1] < -0.01);
        assert!(torus.nearest_return > 1e-6);
    }
}

/// A rotation by a rational angle is periodic from every start, but none of its orbits is isolated:
/// neither "periodic" nor "quasi-periodic" would be right.
#[test]
fn a_rational_rotation_is_undecided_with_a_reason() {
    let mut map = System(Turning {
        angle: 2.0 * std::f64::consts::PI * 3.0 / 7.0,
        gain: 0.2,
    });
    let classified = classify(&mut map, &[0.3, 0.4], &ClassifyOptions::default());
    let MotionKind::Undecided { reason, .. } = classified.kind else {
        panic!("{:?}", classified.kind)
    };
    assert!(
        matches!(
            reason,
            UndecidedReason::NotIsolated { period: 7, .. }
                | UndecidedReason::OnOrbitThatDoesNotAttract(_)
        ),
        "{reason}"
    );
}

/// Survival probability 2/s per period with s = 2.002: thousands of chaotic periods, then the sink.
#[test]
fn transient_chaos_is_not_an_attractor() {
    let options = ClassifyOptions {
        max_transient: 64,
        lyapunov: LyapunovOptions {
            min_periods: 256,
            max_periods: 100_000,
            absolute_error: 0.0,
            relative_error: 0.0,
            ..LyapunovOptions::default()
        },
        ..ClassifyOptions::default()
    };
    let mut seen = 0;
    for k in 0..12 {
        let start = [0.05 + 0.07 * f64::from(k)];
        let classified = classify(&mut System(OpenTent(2.002)), &start, &options);
        match classified.kind {
            MotionKind::TransientChaos {
                orbit, spectrum, ..
            } => {
                seen += 1;
                assert_eq!(orbit.states[0], vec![2.0]);
                assert!((spectrum.largest().0 - 2.002f64.ln()).abs() < 1e-12);
            }
            MotionKind::Periodic(orbit) => assert_eq!(orbit.states[0], vec![2.0]),
            other => panic!("{other:?}"),
        }
    }
    assert!(seen > 3, "{seen}");
}

#[test]
fn a_growing_motion_is_unbounded() {
    let classified = classify(
        &mut System(Henon { a: 1.4, b: 0.3 }),
        &[3.0, 3.0],
        &ClassifyOptions::default(),
    );
    assert!(matches!(classified.kind, MotionKind::Unbounded));
    assert!(classified.periods < 20);
}

/// Started exactly on an unstable fixed point, the run never leaves it; it is not an attractor.
#[test]
fn a_run_on_an_unstable_orbit_is_not_called_an_attractor() {
    let classified = classify(
        &mut System(Logistic(3.5)),
        &[0.0],
        &ClassifyOptions::default(),
    );
    assert!(matches!(
        classified.kind,
        MotionKind::Undecided {
            reason: UndecidedReason::OnOrbitThatDoesNotAttract(_),
            ..
        }
    ));
}

/// An undamped oscillator beats for ever: a torus with exponents zero.
#[test]
fn an_undamped_beat_is_a_torus() {
    let mut map = System(Focus {
        radius: 1.0,
        angle: 1.0,
    });
    let classified = classify(&mut map, &[0.0, 0.0], &ClassifyOptions::default());
    assert!(
        matches!(classified.kind, MotionKind::QuasiPeriodic(_)),
        "{:?}",
        classified.kind
    );
}

#[test]
fn bad_starts_are_refused() {
    for start in [vec![], vec![0.1, 0.2], vec![f64::INFINITY]] {
        let classified = classify(
            &mut System(Logistic(3.5)),
            &start,
            &ClassifyOptions::default(),
        );
        assert!(matches!(
            classified.kind,
            MotionKind::Undecided {
                reason: UndecidedReason::BadStart(_),
                ..
            }
        ));
    }
}

/// At r = 5/2 the cubic map x → r x − x³ has two chaotic attractors, mirror images of each other. A
/// start on a known one takes over its exponents and is observed as long as a start whose exponents
/// are measured. Neither is confused with the other, nor with the fixed point that is stable at r =
/// 3/2.
#[test]
fn known_chaos_is_distinguished_from_other_motions() {
    let options = ClassifyOptions::default();
    let mut map = System(Cubic(2.5));
    let chaotic = |kind: MotionKind| -> Chaos {
        match kind {
            MotionKind::Chaotic(chaos) => chaos,
            other => panic!("not chaotic: {other:?}"),
        }
    };
    let upper = chaotic(classify(&mut map, &[0.3], &options).kind);
    let lower = chaotic(classify(&mut map, &[-0.3], &options).kind);
    let known = [lower.spectrum.clone(), upper.spectrum.clone()];

    let recognised = classify_beside(&mut map, &[0.5], &known, &options);
    let measured = &options.lyapunov;
    let least = options.max_transient + measured.alignment + measured.min_periods;
    assert!(recognised.periods >= least, "{}", recognised.periods);
    let second = chaotic(recognised.kind);
    assert_eq!(second.spectrum, upper.spectrum);
    assert_eq!(second.observed, recognised.periods);

    let unlike = classify_beside(&mut map, &[0.5], &known[..1], &options);
    assert_ne!(chaotic(unlike.kind).spectrum, lower.spectrum);

    let fixed = classify_beside(&mut System(Cubic(1.5)), &[0.5], &known, &options);
    assert_eq!(period_of(&fixed.kind), 1);
}

/// A rotating circle whose third coordinate is chaotic (λ = ln 2) until it escapes through a narrow
/// gap, after 1100 to 1500 periods: the first exponents are those of a transient, and the motion is
/// a torus.
#[test]
fn a_torus_after_a_chaotic_transient_is_a_torus() {
    let mut tried = 0;
    for k in 0..400 {
        let start = [1.0, 0.0, 0.1 + 1e-3 * f64::from(k)];
        let mut z = start[2];
        let left = (0..1500).find(|_| {
            z = Calming::step(z);
            z < 0.0
        });
        if left.is_none_or(|left| left < 1100) {
            continue;
        }
        tried += 1;
        let end = classify(&mut System(Calming), &start, &ClassifyOptions::default());
        let MotionKind::QuasiPeriodic(torus) = &end.kind else {
            panic!("{start:?}: {:?}", end.kind)
        };
        let (exponent, error) = torus.spectrum.largest();
        assert!(exponent.abs() < 1e-3 && error < 1e-3, "{exponent} {error}");
        assert_eq!(torus.spectrum.neutral_directions(), 1);
    }
    assert!(tried > 3, "{tried}");
}
