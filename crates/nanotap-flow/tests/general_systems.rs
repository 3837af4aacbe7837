//! Systems other than microscopes: several tones, several regimes, every kind of damping, and
//! invalid input.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::fixed_step::{FixedStep, Switching};
use nanotap_flow::{Drive, Flow, FlowError, HarmonicVector, Output, Regime, System, Transition};

/// m = 1 between two springy stops at ±0.5 of different stiffness: three regimes, driven
/// by a tone and its third harmonic.
fn between_stops(damping: f64, stops: [f64; 2]) -> System {
    let drive = Drive::new(TAU / 1.3, &[1, 3]).unwrap();
    let lower = |v: f64| DVector::from_vec(vec![0.0, v]);
    let regime = |index: usize, stiffness: f64, at: f64| {
        let matrix = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0 - stiffness, -damping]);
        let forcing = HarmonicVector::zeros(2, 2)
            .with_tone(0, &lower(0.2), &lower(1.4))
            .with_tone(1, &lower(0.9), &lower(0.0))
            .with_constant(&lower(stiffness * at));
        Regime::new(index, matrix, forcing, &drive).unwrap()
    };
    let x = Output::linear(RowDVector::from_row_slice(&[1.0, 0.0]), 2);
    let right = x.scaled(-1.0).with_constant(0.5);
    let left = x.with_constant(0.5);
    System::new(
        drive.clone(),
        vec![
            regime(0, 0.0, 0.0),
            regime(1, stops[0], 0.5),
            regime(2, stops[1], -0.5),
        ],
        vec![
            vec![
                Transition::new(right.clone(), 1),
                Transition::new(left.clone(), 2),
            ],
            vec![Transition::new(right.scaled(-1.0), 0)],
            vec![Transition::new(left.scaled(-1.0), 0)],
        ],
    )
    .unwrap()
}

/// Two tones and three regimes against Runge–Kutta with steps so fine that its late
/// switching (first order in the step) no longer matters at the tolerance; with light,
/// critical (in flight: ẍ + 2ẋ + x) and heavy damping.
#[test]
fn two_tones_and_three_regimes_agree_with_fine_runge_kutta() {
    for (damping, tolerance) in [(0.1, 2e-4), (2.0, 5e-5), (9.0, 5e-5)] {
        let system = Arc::new(between_stops(damping, [20.0, 11.0]));
        assert_eq!(system.drive().harmonics(), [1, 3]);
        let start = [0.3, -0.4];
        let mut flow = Flow::new(Arc::clone(&system));
        flow.start(&start, 0.0).unwrap();
        let mut steps =
            FixedStep::new(&system, &start, &[200_000; 3], Switching::EveryStage).unwrap();
        for _ in 0..3 {
            flow.run_period(&mut ()).unwrap();
            steps.run_period(|_, _| {});
        }
        let mut state = [0.0; 2];
        flow.state(&mut state);
        for (exact, stepped) in state.iter().zip(steps.state()) {
            assert!(
                (exact - stepped).abs() < tolerance,
                "damping {damping}: {exact} {stepped}"
            );
        }
        assert!(damping > 5.0 || flow.switches() > 4, "{}", flow.switches());
    }
}

/// A step that crosses a stop. If contact is tested once per step, the stop has no effect within
/// it, as if it did not exist; if it is tested in every stage, the stop acts.
#[test]
fn a_stop_acts_within_a_step_only_if_every_stage_tests_contact() {
    let first_step = |stops: [f64; 2], switching: Switching| {
        let system = between_stops(0.1, stops);
        let mut steps = FixedStep::new(&system, &[0.49, 1.0], &[50; 3], switching).unwrap();
        let mut first = None;
        steps.run_period(|_, state| first = first.take().or_else(|| Some(state.to_vec())));
        first.unwrap()
    };
    let unfelt = first_step([0.0, 0.0], Switching::EveryStage);
    assert!(unfelt[0] > 0.5, "the step passes the stop");
    let unlooked = first_step([20.0, 11.0], Switching::EveryStep);
    for (a, b) in unlooked.iter().zip(&unfelt) {
        assert!((a - b).abs() < 1e-13, "{unlooked:?} {unfelt:?}");
    }
    let felt = first_step([20.0, 11.0], Switching::EveryStage);
    assert!(felt[1] < unfelt[1] - 1e-3, "{felt:?} {unfelt:?}");
}

/// A stop that the drive moves, `x + 0.3 + Re((0.2 − 0.1i) e^{iωt})` away, springy and damped.
fn on_a_moving_stop() -> System {
    let drive = Drive::new(TAU / 1.3, &[1, 3]).unwrap();
    let (k, c) = (20.0, 0.7);
    let lower = |v: f64| DVector::from_vec(vec![0.0, v]);
    let gap = Output::linear(RowDVector::from_row_slice(&[1.0, 0.0]), 2)
        .with_tone(0, 0.2, -0.1)
        .with_constant(0.3);
    let forcing = HarmonicVector::zeros(2, 2)
        .with_tone(0, &lower(0.4), &lower(1.1))
        .with_tone(1, &lower(-0.6), &lower(0.3));
    let flight = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0, -0.1]);
    let contact = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0 - k, -0.1 - c]);
    let pressed = forcing.clone().with_constant(&lower(-0.3 * k)).with_tone(
        0,
        &lower(0.4 - 0.2 * k),
        &lower(1.1 + 0.1 * k),
    );
    System::new(
        drive.clone(),
        vec![
            Regime::new(0, flight, forcing, &drive).unwrap(),
            Regime::new(1, contact, pressed, &drive).unwrap(),
        ],
        vec![
            vec![Transition::new(gap.clone(), 1)],
            vec![Transition::new(gap.scaled(-1.0), 0)],
        ],
    )
    .unwrap()
}

/// The classical method, written here stage by stage, gives the same steps and switches, with
/// contact tested once per step or in every stage, for a moving stop and for steps that do not
/// divide the rest of the period.
#[test]
fn steps_are_the_four_stages_of_the_classical_method() {
    for switching in [Switching::EveryStep, Switching::EveryStage] {
        let switches = compare_steps(&on_a_moving_stop(), [97, 140], switching);
        assert!(switches >= 40, "{switches}");
    }
}

/// Number of switches in twenty periods.
fn compare_steps(system: &System, counts: [u32; 2], switching: Switching) -> u32 {
    let start = [0.2, 0.3];
    let period = system.drive().period();
    let tones = |all: &[nanotap_flow::Complex], t: f64| -> f64 {
        let frequencies = system.drive().frequencies().iter();
        let pairs = all.iter().zip(frequencies);
        pairs
            .map(|(z, w)| z.re * (w * t).cos() - z.im * (w * t).sin())
            .sum()
    };
    let beyond = |regime: usize, x: &DVector<f64>, t: f64| {
        let guard = &system.transitions()[regime][0].guard;
        (&guard.row * x)[0] + guard.constant + tones(guard.tones.as_slice(), t) <= 0.0
    };
    let field = |regime: usize, x: &DVector<f64>, t: f64| {
        let other = switching == Switching::EveryStage && beyond(regime, x, t);
        let regime = &system.regimes()[if other { 1 - regime } else { regime }];
        let forcing = regime.forcing();
        DVector::from_fn(2, |i, _| {
            let here: Vec<_> = forcing.tones.iter().map(|tone| tone[i]).collect();
            (regime.matrix().row(i) * x)[0] + forcing.constant[i] + tones(&here, t)
        })
    };
    let mut steps = FixedStep::new(system, &start, &counts, switching).unwrap();
    let (mut x, mut regime, mut all) = (DVector::from_column_slice(&start), 0, 0);
    for _ in 0..20 {
        let (mut t, mut switches) = (0.0, 0);
        let mut passed = Vec::new();
        let noticed = steps.run_period(|phase, state| passed.push((phase, state.to_vec())));
        for (phase, state) in &passed {
            let h = (period / f64::from(counts[regime])).min(period - t);
            let k1 = field(regime, &x, t);
            let k2 = field(regime, &(&x + &k1 * (h / 2.0)), t + h / 2.0);
            let k3 = field(regime, &(&x + &k2 * (h / 2.0)), t + h / 2.0);
            let k4 = field(regime, &(&x + &k3 * h), t + h);
            x += (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
            t += h;
            assert!((phase - t).abs() < 1e-12, "{phase} {t}");
            assert!((x[0] - state[0]).abs().max((x[1] - state[1]).abs()) < 1e-12);
            if beyond(regime, &x, t) {
                regime = 1 - regime;
                switches += 1;
            }
        }
        assert!((t - period).abs() < 1e-12);
        assert_eq!(noticed, switches);
        assert_eq!(steps.state(), passed.last().unwrap().1);
        all += switches;
    }
    all
}

/// The same map whether the period is run in one piece or in several.
#[test]
fn a_run_may_be_divided_anywhere() {
    let system = Arc::new(between_stops(0.1, [20.0, 11.0]));
    let period = system.drive().period();
    let run = |cuts: u32| {
        let mut flow = Flow::new(Arc::clone(&system));
        flow.start(&[0.3, -0.4], 0.0).unwrap();
        for cut in 1..=cuts {
            flow.run_until(period * f64::from(cut) / f64::from(cuts), &mut ())
                .unwrap();
        }
        let mut state = [0.0; 2];
        flow.state(&mut state);
        state
    };
    let whole = run(1);
    for cuts in [2, 7, 100] {
        for (a, b) in whole.iter().zip(run(cuts)) {
            assert!((a - b).abs() < 1e-12, "{cuts} cuts: {a} {b}");
        }
    }
}

/// An undamped mode driven at its own frequency has no bounded response; at a nearby frequency, or
/// with any damping, it has one.
#[test]
fn undamped_resonance_is_refused_with_a_reason() {
    let build = |omega: f64, damping: f64| {
        let drive = Drive::single(omega).unwrap();
        let force = DVector::from_vec(vec![0.0, 1.0]);
        let forcing = HarmonicVector::zeros(2, 1).with_tone(0, &force, &DVector::zeros(2));
        let matrix = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -4.0, -damping]);
        Regime::new(0, matrix, forcing, &drive)
    };
    let refused = build(2.0, 0.0);
    assert!(
        matches!(refused, Err(FlowError::Resonance { .. })),
        "{refused:?}"
    );
    assert!(refused.unwrap_err().to_string().contains("add damping"));
    let nearby = build(2.0 + 1e-6, 0.0).unwrap();
    // x = sin ωt / (4 − ω²)
    let omega = 2.0 + 1e-6;
    let expected = 1.0 / (4.0 - omega * omega);
    assert!((nearby.response().tones[0][0].im / -expected - 1.0).abs() < 1e-6);
    assert!(build(2.0, 1e-9).is_ok());
}

/// Invalid arguments of the constructors are errors that state the problem.
#[test]
fn bad_input_is_refused() {
    assert!(matches!(
        Drive::single(f64::NAN),
        Err(FlowError::Drive { .. })
    ));
    assert!(matches!(
        Drive::new(1.0, &[0]),
        Err(FlowError::Drive { .. })
    ));
    let drive = Drive::single(1.0).unwrap();
    let regime = |matrix: DMatrix<f64>, n: usize| {
        Regime::new(0, matrix, HarmonicVector::zeros(n, 1), &drive)
    };
    assert!(matches!(
        regime(DMatrix::zeros(0, 0), 0),
        Err(FlowError::Shape { .. })
    ));
    assert!(matches!(
        regime(DMatrix::zeros(2, 3), 2),
        Err(FlowError::Shape { .. })
    ));
    assert!(matches!(
        regime(DMatrix::zeros(2, 2), 3),
        Err(FlowError::Shape { .. })
    ));
    let infinite = DMatrix::from_element(1, 1, f64::INFINITY);
    assert!(matches!(
        regime(infinite, 1),
        Err(FlowError::NotFinite { .. })
    ));
    let one = regime(DMatrix::from_element(1, 1, -1.0), 1).unwrap();
    let guard = Output::linear(RowDVector::from_row_slice(&[1.0]), 1);
    let lost = System::new(
        drive.clone(),
        vec![one.clone()],
        vec![vec![Transition::new(guard, 7)]],
    );
    assert!(matches!(
        lost,
        Err(FlowError::Target {
            target: 7,
            regimes: 1
        })
    ));
    let system = Arc::new(System::new(drive, vec![one], vec![Vec::new()]).unwrap());
    let mut flow = Flow::new(system);
    assert!(matches!(
        flow.start(&[f64::NAN], 0.0),
        Err(FlowError::NotFinite { .. })
    ));
    assert!(matches!(
        flow.start(&[1.0, 2.0], 0.0),
        Err(FlowError::Shape { .. })
    ));
}
