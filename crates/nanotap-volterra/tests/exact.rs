//! A spring-damper contact, compared with the engine that solves it in closed form.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;

use common::beam;
use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::{
    Drive as ExactDrive, Flow as ExactFlow, HarmonicVector, Output, Regime, System as ExactSystem,
    Transition,
};
use nanotap_volterra::{Flow, laws};
use std::f64::consts::TAU;
use std::sync::Arc;

const K: f64 = 1.0;
const Q: f64 = 20.0;
const AMPLITUDE: f64 = 10.0;

/// The same modes with the contact as a second linear regime.
fn exact(count: usize, stiffness: f64, damping: f64, a0: f64, zc: f64) -> ExactSystem {
    let drive = ExactDrive::single(1.0).unwrap();
    let n = 2 * count;
    let mut free = DMatrix::zeros(n, n);
    let mut gap = RowDVector::zeros(n);
    let mut rate = RowDVector::zeros(n);
    let mut column = DVector::zeros(n);
    let mut cosine = DVector::zeros(n);
    for (m, (kappa, c, sign)) in common::beam_modes(count, Q).into_iter().enumerate() {
        free[(m, count + m)] = 1.0;
        free[(count + m, m)] = -kappa;
        free[(count + m, count + m)] = -c;
        gap[m] = sign;
        rate[count + m] = sign;
        column[count + m] = sign / K;
        cosine[count + m] = sign * AMPLITUDE / Q;
    }
    let forcing = HarmonicVector::zeros(n, 1).with_tone(0, &DVector::zeros(n), &cosine);
    // F = k (a0 − zc − row x) − c row ẋ.
    let contact = &free - &column * (&gap * stiffness + &rate * damping);
    let pushed = forcing
        .clone()
        .with_constant(&(&column * (stiffness * (a0 - zc))));
    let tones = vec![nanotap_flow::Complex::new(0.0, 0.0)];
    let outside = Output {
        row: gap.clone(),
        constant: zc - a0,
        tones: tones.clone(),
    };
    let inside = Output {
        row: -gap,
        constant: a0 - zc,
        tones,
    };
    let regimes = vec![
        Regime::new(0, free, forcing, &drive).unwrap(),
        Regime::new(1, contact, pushed, &drive).unwrap(),
    ];
    let transitions = vec![
        vec![Transition::new(outside, 1)],
        vec![Transition::new(inside, 0)],
    ];
    ExactSystem::new(drive, regimes, transitions).unwrap()
}

#[test]
fn a_spring_and_damper_move_as_in_the_exact_engine() {
    for (count, stiffness, damping) in [(1, 5.0, 0.0), (3, 5.0, 0.3), (3, 40.0, 0.0), (6, 8.0, 1.0)]
    {
        let (a0, zc) = (0.2, 6.0);
        let law = laws::build(
            "spring-damper",
            &[
                ("stiffness", stiffness),
                ("damping", damping),
                ("contact_distance", a0),
            ],
        )
        .unwrap();
        let mut ours = Flow::new(Arc::new(beam(law, count, K, Q, AMPLITUDE, zc, 20)));
        let mut theirs = ExactFlow::new(Arc::new(exact(count, stiffness, damping, a0, zc)));
        let mut x = vec![0.0; 2 * count];
        x[0] = 7.0;
        x[count] = 2.0;
        theirs.start(&x, 0.0).unwrap();
        let mut y = x.clone();
        for period in 1..=3 {
            theirs.run_period(&mut ()).unwrap();
            theirs.state(&mut y);
            ours.start(&x, 0.0).unwrap();
            ours.run_until(TAU).unwrap();
            ours.state(&mut x);
            for m in 0..count {
                let omega = common::beam_modes(count, Q)[m].0.sqrt();
                let error = (x[m] - y[m])
                    .abs()
                    .max((x[count + m] - y[count + m]).abs() / omega);
                assert!(
                    error < 1e-11 * 10.0,
                    "{count} modes, mode {m} after {period} periods: {error:e}"
                );
            }
        }
        assert!(ours.statistics().switches >= 2);
    }
}
