//! Properties that hold for every system, tested on random ones.

use std::convert::Infallible;

use nanotap_dynamics::{
    CensusOptions, ClassifyOptions, Control, DMatrix, LyapunovOptions, MotionKind, Neighbourhood,
    ShootingOptions, StartBox, StartOutcome, StroboscopicMap, census, classify, close_orbit,
};
use proptest::prelude::*;

use crate::systems::{Henon, Logistic, System, advanced};

/// x → A x + b.
#[derive(Clone, Debug)]
struct Affine {
    matrix: DMatrix<f64>,
    offset: Vec<f64>,
}

impl nanotap_dynamics::Scheduling for Affine {}

impl StroboscopicMap for Affine {
    type Error = Infallible;

    fn dimension(&self) -> usize {
        self.offset.len()
    }

    fn period(&self) -> f64 {
        1.0
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
        let image: Vec<f64> = self
            .matrix
            .row_iter()
            .zip(&self.offset)
            .map(|(row, b)| {
                b + row
                    .iter()
                    .zip(state.iter())
                    .map(|(a, x)| a * x)
                    .sum::<f64>()
            })
            .collect();
        state.copy_from_slice(&image);
        Ok(())
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), Infallible> {
        jacobian.copy_from(&self.matrix);
        self.advance(state)
    }
}

prop_compose! {
    /// A contracting affine map of dimension 4 (row sums below 0.97).
    fn contraction()(
        entries in prop::collection::vec(-1.0f64..1.0, 16),
        offset in prop::collection::vec(-3.0f64..3.0, 4),
        size in 0.1f64..0.97,
    ) -> Affine {
        let matrix = DMatrix::from_row_slice(4, 4, &entries);
        let widest = matrix.row_iter().map(|r| r.abs().sum()).fold(0.0, f64::max);
        Affine { matrix: matrix * (size / widest.max(1e-3)), offset }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Every start of a contraction converges to its only fixed point (1 − A)⁻¹ b.
    #[test]
    fn contractions_converge_to_their_fixed_point(
        map in contraction(),
        start in prop::collection::vec(-50.0f64..50.0, 4),
    ) {
        let classified = classify(&mut map.clone(), &start, &ClassifyOptions::default());
        let MotionKind::Periodic(orbit) = classified.kind else {
            return Err(TestCaseError::fail(format!("{:?}", classified.kind)));
        };
        let offset = DMatrix::from_column_slice(4, 1, &map.offset);
        let exact = (DMatrix::identity(4, 4) - &map.matrix).lu().solve(&offset).unwrap();
        prop_assert_eq!(orbit.period, 1);
        for (x, e) in orbit.states[0].iter().zip(exact.iter()) {
            prop_assert!((x - e).abs() <= 1e-11 * exact.amax().max(50.0));
        }
        // The multipliers' sum and product are the trace and determinant of A.
        let sum: f64 = orbit.multipliers.iter().map(|m| m.re).sum();
        prop_assert!((sum - map.matrix.trace()).abs() < 1e-12);
        let determinant = map.matrix.determinant().abs().ln();
        prop_assert!((orbit.log_determinant - determinant).abs() < 1e-9);
    }

    /// Every start in a contracting ball is nearer after one return, stays in the ball, and
    /// converges to the orbit.
    #[test]
    fn balls_contract(a in 0.05f64..0.36, u in -1.0f64..1.0, v in -1.0f64..1.0) {
        let mut map = System(Henon { a, b: 0.3 });
        let fixed = map.0.fixed_point();
        let orbit = close_orbit(&mut map, &fixed, 1, &ShootingOptions::default()).unwrap();
        let ball = Neighbourhood::around(&mut map, &orbit).unwrap().unwrap();
        let extents = ball.extents();
        let start = [fixed[0] + u * extents[0], fixed[1] + v * extents[1]];
        prop_assume!(ball.contains(&start));
        prop_assert!(ball.holds(&mut map, &start, &mut [0.0; 2]).unwrap());
        let next = advanced(&mut map, &start, 1);
        prop_assert!(ball.contains(&next));
        let end = advanced(&mut map, &start, 20_000);
        prop_assert!((end[0] - fixed[0]).abs() < 1e-9);
    }

    /// Every start of a census has exactly one outcome, and the fractions add up to one.
    #[test]
    fn every_start_is_counted_once(r in 1.1f64..4.0, seed: u64) {
        let starts = StartBox::new(vec![-0.2], vec![1.2]).unwrap().starts(seed, 24);
        let options = CensusOptions {
            pilots: 8,
            classify: ClassifyOptions {
                lyapunov: LyapunovOptions { min_periods: 500, max_periods: 1000, ..LyapunovOptions::default() },
                birkhoff_periods: 256,
                ..ClassifyOptions::default()
            },
            ..CensusOptions::default()
        };
        let result = census(&System(Logistic(r)), &starts, &options, &Control::default());
        let attracted: usize = result.attractors.iter().map(|a| a.fraction.count).sum();
        let unescaped = result.transient_chaos.as_ref().map_or(0, |t| t.unescaped.count);
        prop_assert_eq!(
            attracted + unescaped + result.unbounded.count + result.undecided.len(),
            starts.len()
        );
        for (index, attractor) in result.attractors.iter().enumerate() {
            let outcomes_by_start = result.outcomes_by_start.iter().filter(
                |f| matches!(f, StartOutcome::Attractor { index: i, .. } if *i == index),
            );
            prop_assert_eq!(outcomes_by_start.count(), attractor.fraction.count);
        }
        // All starts outside [0, 1] are unbounded, none inside.
        for (start, outcome_of_start) in starts.iter().zip(&result.outcomes_by_start) {
            let inside = (0.0..=1.0).contains(&start[0]);
            prop_assert_eq!(*outcome_of_start != StartOutcome::Unbounded, inside);
        }
        // The logistic map has at most one attractor (negative Schwarzian derivative).
        prop_assert!(result.attractors.len() <= 1, "{:?}", result.attractors);
    }
}
