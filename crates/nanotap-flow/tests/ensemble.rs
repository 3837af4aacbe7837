//! Motions in an ensemble agree with single motions.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::{Drive, Ensemble, Flow, FlowError, HarmonicVector, Output, Regime};
use nanotap_flow::{System, Transition};
use proptest::prelude::*;

/// Masses on separate springs, each (frequency, damping, weight), whose weighted sum is the
/// position of a tip. The gap between tip and surface moves with the drive, and the surface is a
/// spring and a damper.
#[derive(Clone, Debug)]
struct Tip {
    masses: Vec<(f64, f64, f64)>,
    stiffness: f64,
    damping: f64,
    drive: f64,
    frequency: f64,
    gap: f64,
}

impl Tip {
    fn system(&self) -> Arc<System> {
        let n = self.masses.len();
        let drive = Drive::single(self.frequency).unwrap();
        let tip = RowDVector::from_fn(2 * n, |_, j| if j < n { self.masses[j].2 } else { 0.0 });
        let gap = Output::linear(tip, 1)
            .with_tone(0, self.drive, 0.0)
            .with_constant(self.gap);
        let regime = |index: usize, stiffness: f64, damping: f64| {
            let mut matrix = DMatrix::zeros(2 * n, 2 * n);
            let mut push = DVector::zeros(2 * n);
            for (i, &(frequency, own, weight)) in self.masses.iter().enumerate() {
                matrix[(i, n + i)] = 1.0;
                matrix[(n + i, i)] = -frequency * frequency;
                matrix[(n + i, n + i)] = -2.0 * own * frequency;
                for (j, &(_, _, other)) in self.masses.iter().enumerate() {
                    matrix[(n + i, j)] -= stiffness * weight * other;
                    matrix[(n + i, n + j)] -= damping * weight * other;
                }
                push[n + i] = -weight;
            }
            let forcing = HarmonicVector::zeros(2 * n, 1)
                .with_tone(
                    0,
                    &(&push * (stiffness * self.drive)),
                    &(&push * (damping * self.drive * self.frequency)),
                )
                .with_constant(&(&push * (stiffness * self.gap)));
            Regime::new(index, matrix, forcing, &drive).unwrap()
        };
        let regimes = vec![regime(0, 0.0, 0.0), regime(1, self.stiffness, self.damping)];
        let transitions = vec![
            vec![Transition::new(gap.clone(), 1)],
            vec![Transition::new(gap.scaled(-1.0), 0)],
        ];
        Arc::new(System::new(drive, regimes, transitions).unwrap())
    }

    /// Three masses: about two contacts per period, like the paper's lever at Ω = 2.6.
    fn lever() -> Self {
        Self {
            masses: vec![(3.0, 0.02, 1.8), (19.4, 0.003, -1.9), (56.0, 0.001, 2.0)],
            stiffness: 20.0,
            damping: 0.2,
            drive: 0.3,
            frequency: 2.6,
            gap: 0.0,
        }
    }
}

/// States of `2n` numbers each, of the size of typical motions.
fn states(n: usize, count: usize) -> Vec<f64> {
    let number = |k: usize| 0.15 * ((k * k) as f64 * 0.37 + k as f64 * 1.3).sin();
    (0..2 * n * count).map(number).collect()
}

fn alone(system: &Arc<System>, states: &[f64], periods: &[usize]) -> Vec<f64> {
    let mut flow = Flow::new(Arc::clone(system));
    let mut all = states.to_vec();
    for (x, &periods) in all.chunks_exact_mut(system.dimension()).zip(periods) {
        flow.start(x, 0.0).unwrap();
        flow.run_periods(periods).unwrap();
        flow.state(x);
    }
    all
}

fn together(system: &Arc<System>, states: &[f64], periods: &[usize]) -> Vec<f64> {
    let mut all = states.to_vec();
    let results = Ensemble::new(Arc::clone(system)).advance(&mut all, periods);
    assert!(results.iter().all(Result::is_ok), "{results:?}");
    all
}

/// Largest difference between states that are equal up to rounding: 1e-9 of their size, or more
/// where neighbours diverge by chaos.
fn rounding(system: &Arc<System>, states: &[f64], periods: &[usize]) -> f64 {
    let ends = alone(system, states, periods);
    let perturbed: Vec<f64> = states.iter().map(|x| x * (1.0 + 1e-14)).collect();
    let separated = alone(system, &perturbed, periods);
    let apart = ends.iter().zip(&separated).map(|(a, b)| (a - b).abs());
    let size = ends.iter().fold(1.0, |size: f64, x| size.max(x.abs()));
    1e-9 * size + 1e3 * apart.fold(0.0, f64::max)
}

fn tips() -> impl Strategy<Value = Tip> {
    let mass = (
        (0.0..4.0_f64).prop_map(f64::exp),
        0.001..0.1_f64,
        prop_oneof![-2.0..-0.5_f64, 0.5..2.0_f64],
    );
    (
        proptest::collection::vec(mass, 1..7),
        1.0..100.0_f64,
        0.0..0.5_f64,
        0.05..0.5_f64,
        0.5..10.0_f64,
        -0.2..0.3_f64,
    )
        .prop_map(|(masses, stiffness, damping, drive, frequency, gap)| Tip {
            masses,
            stiffness,
            damping,
            drive,
            frequency,
            gap,
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// A few periods of random systems.
    #[test]
    fn motions_in_an_ensemble_agree_with_single_motions(
        tip in tips(),
        periods in proptest::collection::vec(0..4_usize, 1..20),
    ) {
        let system = tip.system();
        let states = states(tip.masses.len(), periods.len());
        let expected = alone(&system, &states, &periods);
        let found = together(&system, &states, &periods);
        let rounding = rounding(&system, &states, &periods);
        for (a, b) in found.iter().zip(&expected) {
            prop_assert!((a - b).abs() < rounding, "{a} {b}");
        }
    }

    /// The states at the ends of all periods are those of a single motion after as many periods,
    /// and the last one is the final state.
    #[test]
    fn the_states_of_every_period_are_those_of_a_single_motion(tip in tips(), count in 1..20_usize) {
        let system = tip.system();
        let n = system.dimension();
        let starts = states(tip.masses.len(), count);
        let periods: Vec<usize> = (0..count).map(|k| k % 4).collect();
        let (mut ends, mut passed) = (starts.clone(), vec![vec![7.0]; count]);
        let mut ensemble = Ensemble::new(Arc::clone(&system));
        let results = ensemble.advance_through(&mut ends, &periods, &mut passed);
        prop_assert!(results.iter().all(Result::is_ok), "{:?}", results);
        for k in 0..count {
            let (start, end) = (&starts[k * n..][..n], &ends[k * n..][..n]);
            prop_assert_eq!(passed[k].len(), n * periods[k]);
            prop_assert!(periods[k] == 0 || &passed[k][n * (periods[k] - 1)..] == end);
            for (period, state) in passed[k].chunks_exact(n).enumerate() {
                let expected = alone(&system, start, &[period + 1]);
                let rounding = rounding(&system, start, &[period + 1]);
                for (a, b) in state.iter().zip(&expected) {
                    prop_assert!((a - b).abs() < rounding, "{} {}", a, b);
                }
            }
        }
    }

    /// A result does not depend on the other motions or on their order.
    #[test]
    fn neighbours_do_not_matter(tip in tips(), count in 1..20_usize) {
        let system = tip.system();
        let n = system.dimension();
        let states = states(tip.masses.len(), count);
        let periods: Vec<usize> = (0..count).map(|k| 1 + k % 5).collect();
        let all = together(&system, &states, &periods);
        let each = states.chunks_exact(n).zip(&periods).zip(all.chunks_exact(n));
        for ((state, periods), expected) in each {
            prop_assert_eq!(together(&system, state, &[*periods]), expected);
        }
        let reversed: Vec<f64> = states.rchunks_exact(n).flatten().copied().collect();
        let order: Vec<usize> = periods.iter().rev().copied().collect();
        let back = together(&system, &reversed, &order);
        let expected: Vec<f64> = all.rchunks_exact(n).flatten().copied().collect();
        prop_assert_eq!(back, expected);
    }
}

/// If the gap reaches zero once per flight only, hardly any segment is computed for a single
/// motion.
#[test]
fn nearly_all_segments_are_computed_together() {
    let tip = Tip {
        masses: vec![(3.0, 0.02, 1.8), (19.4, 0.01, -1.0), (56.0, 0.01, 0.5)],
        ..Tip::lever()
    };
    let mut ensemble = Ensemble::new(tip.system());
    let mut states = states(3, 40);
    let results = ensemble.advance(&mut states, &[100; 40]);
    assert!(results.iter().all(Result::is_ok));
    let stretches = ensemble.stretches();
    assert!(stretches.together > 40 * 150, "{stretches:?}");
    assert!(stretches.alone * 25 < stretches.together, "{stretches:?}");
}

/// More motions than lanes, with different numbers of periods, zero included: each stops at its own
/// end.
#[test]
fn each_motion_has_its_own_number_of_periods() {
    // The motions converge to an orbit, so that rounding stays small over a hundred periods.
    let tip = Tip {
        drive: 0.1,
        gap: 0.25,
        ..Tip::lever()
    };
    let system = tip.system();
    let states = states(3, 11);
    let periods: Vec<usize> = (0..11).map(|k| 10 * k).collect();
    let expected = alone(&system, &states, &periods);
    let found = together(&system, &states, &periods);
    for (a, b) in found.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-10, "{a} {b}");
    }
    assert_eq!(found[..6], states[..6], "no period changes nothing");
}

/// An invalid state is refused, and the others continue.
#[test]
fn one_invalid_state_does_not_affect_the_others() {
    let system = Tip::lever().system();
    let mut states = states(3, 3);
    let good = states.clone();
    states[7] = f64::NAN;
    let results = Ensemble::new(Arc::clone(&system)).advance(&mut states, &[2; 3]);
    assert!(matches!(results[1], Err(FlowError::NotFinite { .. })));
    assert!(results[0].is_ok() && results[2].is_ok());
    let expected = together(&system, &good, &[2; 3]);
    assert_eq!(states[..6], expected[..6]);
    assert_eq!(states[12..], expected[12..]);
    let (mut states, mut passed) = (good, [const { Vec::new() }; 3]);
    states[7] = f64::NAN;
    let results = Ensemble::new(system).advance_through(&mut states, &[2; 3], &mut passed);
    assert!(results[0].is_ok() && results[1].is_err() && results[2].is_ok());
    assert_eq!(passed.map(|passed| passed.len()), [12, 0, 12]);
}
