//! Many periods in one call give the same motion as single periods.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::{Drive, Ensemble, Flow, HarmonicVector, Output, Regime, System, Transition};

/// Two coupled masses, one of which hits soft stops on both sides: regimes with two transitions and
/// with one.
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
    let transitions = vec![
        vec![
            Transition::new(right.clone(), 1),
            Transition::new(left.clone(), 2),
        ],
        vec![Transition::new(right.scaled(-1.0), 0)],
        vec![Transition::new(left.scaled(-1.0), 0)],
    ];
    let regimes = vec![
        regime(0, 0.0, 0.0),
        regime(1, 30.0, 0.4),
        regime(2, 12.0, -0.5),
    ];
    Arc::new(System::new(drive.clone(), regimes, transitions).unwrap())
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

/// A run over several periods is the same motion as runs of single periods.
#[test]
fn many_periods_in_one_call() {
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

/// If a regime has two exits, many motions are computed in sequence and agree to the last bit.
#[test]
fn systems_with_two_exits_are_computed_in_sequence() {
    let system = system();
    let starts: Vec<f64> = (0..6).flat_map(start).collect();
    let (mut together, mut alone) = (starts.clone(), starts);
    let results = Ensemble::new(system.clone()).advance(&mut together, &[3; 6]);
    assert!(results.iter().all(Result::is_ok), "{results:?}");
    for x in alone.chunks_exact_mut(4) {
        let mut flow = Flow::new(system.clone());
        flow.start(x, 0.0).unwrap();
        flow.run_periods(3).unwrap();
        flow.state(x);
    }
    assert_eq!(together, alone);
}
