//! Several motions at once are the same motions, to the last bit.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::{
    Drive, Ensemble, Exit, Flow, FlowError, HarmonicVector, Output, Regime, System,
};

/// Two coupled masses, one of which hits springy stops on both sides: regimes with two exits
/// and with one.
fn system() -> Arc<System> {
    let drive = Drive::new(TAU / 1.1, &[1]).unwrap();
    let regime = |index: usize, stiffness: f64, at: f64| {
        let matrix = DMatrix::from_row_slice(
            4,
            4,
            &[
                0.0,
                0.0,
                1.0,
                0.0, //
                0.0,
                0.0,
                0.0,
                1.0, //
                -2.0 - stiffness,
                1.0,
                -0.2,
                0.05, //
                1.0,
                -9.0,
                0.05,
                -0.2,
            ],
        );
        let force = |v: f64| DVector::from_vec(vec![0.0, 0.0, v, 0.0]);
        let forcing = HarmonicVector::zeros(4, 1)
            .with_tone(0, &force(1.5), &force(0.3))
            .with_constant(&force(stiffness * at));
        Regime::new(index, matrix, forcing, &drive).unwrap()
    };
    let x = Output::linear(RowDVector::from_row_slice(&[1.0, 0.0, 0.0, 0.0]), 1);
    let (right, left) = (x.scaled(-1.0).with_constant(0.4), x.with_constant(0.5));
    let exits = vec![
        vec![Exit::new(right.clone(), 1), Exit::new(left.clone(), 2)],
        vec![Exit::new(right.scaled(-1.0), 0)],
        vec![Exit::new(left.scaled(-1.0), 0)],
    ];
    let regimes = vec![
        regime(0, 0.0, 0.0),
        regime(1, 30.0, 0.4),
        regime(2, 12.0, -0.5),
    ];
    Arc::new(System::new(drive.clone(), regimes, exits).unwrap())
}

fn start(i: usize) -> [f64; 4] {
    let i = i as f64;
    [
        0.3 * (1.3 * i).sin(),
        0.2 * (0.7 * i).cos(),
        (2.1 * i).sin(),
        -(0.4 * i).cos(),
    ]
}

#[test]
fn every_motion_is_the_one_it_is_alone() {
    let system = system();
    for size in [1, 3, 8] {
        let mut ensemble = Ensemble::new(&system, size);
        for i in 0..size {
            ensemble.start(i, &start(i)).unwrap();
        }
        ensemble.run_periods(30).unwrap();
        ensemble.run_periods(7).unwrap();
        for i in 0..size {
            let mut alone = Flow::new(Arc::clone(&system));
            alone.start(&start(i), 0.0).unwrap();
            alone.run_periods(30).unwrap();
            alone.run_periods(7).unwrap();
            let (mut a, mut b) = ([0.0; 4], [0.0; 4]);
            ensemble.flow(i).state(&mut a);
            alone.state(&mut b);
            assert_eq!(a, b, "motion {i} of {size}");
            assert_eq!(ensemble.flow(i).switches(), alone.switches());
            assert!(alone.switches() > 37, "the motions must switch");
        }
    }
}

/// Running on over the ends of periods is the same motion as stopping at each.
#[test]
fn periods_may_be_run_in_one_go() {
    let system = system();
    for i in 0..6 {
        let (mut one_go, mut stopping) = (Flow::new(system.clone()), Flow::new(system.clone()));
        one_go.start(&start(i), 0.0).unwrap();
        stopping.start(&start(i), 0.0).unwrap();
        one_go.run_periods(12).unwrap();
        for _ in 0..12 {
            stopping.run_period(&mut ()).unwrap();
        }
        let (mut a, mut b) = ([0.0; 4], [0.0; 4]);
        one_go.state(&mut a);
        stopping.state(&mut b);
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() < 1e-10, "{i}: {a} {b}");
        }
        assert_eq!(one_go.switches(), stopping.switches());
        assert_eq!(one_go.phase(), 0.0);
    }
}

/// One motion that diverges does not stop the others, and is named.
#[test]
fn a_failing_motion_is_named_and_the_others_go_on() {
    let drive = Drive::single(1.0).unwrap();
    let matrix = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 25.0, 0.0]);
    let regime = Regime::new(0, matrix, HarmonicVector::zeros(2, 1), &drive).unwrap();
    let guard = Output::linear(RowDVector::from_row_slice(&[1.0, 0.0]), 1).with_constant(1.0);
    let exits = vec![vec![Exit::new(guard, 0)]];
    let system = Arc::new(System::new(drive, vec![regime], exits).unwrap());
    let mut ensemble = Ensemble::new(&system, 3);
    ensemble.start(0, &[0.0, 0.0]).unwrap();
    ensemble.start(1, &[1.0, 5.0]).unwrap();
    ensemble.start(2, &[0.0, 0.0]).unwrap();
    let (which, reason) = ensemble.run_periods(40).unwrap_err();
    assert_eq!(which, 1);
    assert!(matches!(reason, FlowError::Diverged { .. }), "{reason}");
    let mut state = [1.0; 2];
    ensemble.flow(2).state(&mut state);
    assert_eq!(state, [0.0, 0.0]);
    assert!(ensemble.start(0, &[f64::NAN, 0.0]).is_err());
}
