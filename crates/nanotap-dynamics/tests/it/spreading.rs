//! Continuation of attractors over grids of parameter values.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::{
    AttractorContinuationOptions, AttractorKind, AttractorsAtValue, CensusOptions, Control,
    DMatrix, MotionKind, StartBox, StartSet, classify, continue_attractors, grid_neighbours,
    share_orbits,
};

use crate::systems::{Cubic, Family, Formula, Logistic, Nested, System};

fn few() -> AttractorContinuationOptions {
    AttractorContinuationOptions {
        census: CensusOptions {
            max_starts: 24,
            ..CensusOptions::default()
        },
    }
}

fn fixed_points(value: &AttractorsAtValue) -> Vec<f64> {
    let mut found: Vec<f64> = value
        .attractors
        .iter()
        .map(|a| match &a.attractor.kind {
            AttractorKind::Periodic(orbit) => {
                assert_eq!(orbit.period, 1);
                orbit.states[0][0]
            }
            other => panic!("{other:?}"),
        })
        .collect();
    found.sort_by(f64::total_cmp);
    found
}

/// The mirror image is started at one value only and found at all values; the two form two
/// branches.
#[test]
fn an_attractor_of_one_value_is_found_at_all() {
    let values: Vec<f64> = (0..41).map(|k| 1.1 + 0.02 * f64::from(k)).collect();
    let starts = |k: usize, _: &System<Cubic>| {
        let mut states = vec![vec![0.5]];
        if k == 17 {
            states.push(vec![-0.5]);
        }
        StartSet::given(states)
    };
    let found = continue_attractors(&Family(Cubic), &values, starts, &few(), &Control::default());
    let branch_of_positive = found[0].attractors[0].branch;
    for (r, value) in values.iter().zip(&found) {
        let expected = (r - 1.0).sqrt();
        let points = fixed_points(value);
        assert_eq!(points.len(), 2, "r = {r}");
        assert!((points[0] + expected).abs() < 1e-12 && (points[1] - expected).abs() < 1e-12);
        for a in &value.attractors {
            let positive = a.attractor.state[0] > 0.0;
            assert_eq!(a.branch == branch_of_positive, positive);
            assert!(a.branch < 2);
        }
    }
    assert_eq!(found[16].attractors[1].found_from, Some(17));
    assert_eq!(found[17].attractors[1].found_from, None);
}

/// The period-3 window of the logistic map, 1 + √8 = 3.828427 … 3.841499 for period 3: it is found
/// on all its grid values, however few the starts.
#[test]
fn a_periodic_window_is_complete() {
    let values: Vec<f64> = (0..31).map(|k| 3.825 + 0.0005 * f64::from(k)).collect();
    let sides = StartBox::new(vec![0.0], vec![1.0]).unwrap();
    let starts = |_: usize, _: &System<Logistic>| StartSet::drawn(sides.clone(), 2);
    let options = AttractorContinuationOptions {
        census: CensusOptions {
            max_starts: 4,
            ..CensusOptions::default()
        },
    };
    let found = continue_attractors(
        &Family(Logistic),
        &values,
        starts,
        &options,
        &Control::default(),
    );
    for (r, value) in values.iter().zip(&found) {
        let has_three = value
            .attractors
            .iter()
            .any(|a| matches!(&a.attractor.kind, AttractorKind::Periodic(o) if o.period == 3));
        let inside = *r > 1.0 + 8f64.sqrt() && *r < 3.8414;
        assert!(!inside || has_three, "r = {r}");
        assert!(*r > 1.0 + 8f64.sqrt() || !has_three, "r = {r}");
    }
}

/// Three columns of two rows: 0 1 2 above 3 4 5.
#[test]
fn neighbours_of_a_grid_value() {
    let neighbours = grid_neighbours(&[3, 2]);
    let found: Vec<_> = (0..6).map(neighbours).collect();
    let exact: [&[usize]; 6] = [&[1, 3], &[0, 2, 4], &[1, 5], &[4, 0], &[3, 5, 1], &[4, 2]];
    assert_eq!(found, exact);
    let along = grid_neighbours(&[3]);
    assert_eq!(
        (0..3).map(along).collect::<Vec<_>>(),
        [vec![1], vec![0, 2], vec![1]]
    );
}

/// Small motions known at one corner of a plane are found everywhere on it.
#[test]
fn attractors_spread_over_a_plane_from_one_corner() {
    let first: Vec<f64> = (0..6).map(|k| 1.2 + 0.1 * f64::from(k)).collect();
    let second: Vec<f64> = (0..5).map(|k| 1e-3 * 1.3f64.powi(k)).collect();
    let at = |k: usize| {
        let (r, s) = (first[k % 6], second[k / 6]);
        Ok(System(Nested { r, s }))
    };
    let mut known = vec![Vec::new(); 30];
    for start in [1.5, -1.5, 4e-4, -4e-4] {
        let settled = classify(&mut at(0).unwrap(), &[start], &few().census.classify);
        let MotionKind::Periodic(orbit) = settled.kind else {
            panic!("{:?}", settled.kind);
        };
        known[0].push(orbit);
    }
    let filled = || {
        share_orbits(
            known.clone(),
            at,
            grid_neighbours(&[6, 5]),
            &few().census.classify,
            &Control::default(),
        )
    };
    let one = filled();
    assert_eq!(one.len(), 30);
    for (k, value) in one.iter().enumerate() {
        let (r, s) = (first[k % 6], second[k / 6]);
        let points = fixed_points(value);
        assert_eq!(points.len(), 4, "r = {r}, s = {s}");
        assert!((points[2] - s * (r - 1.0).sqrt()).abs() < 1e-12);
        assert_eq!(points[3], 2.0);
        assert!(value.attractors.iter().all(|a| a.branch < 4));
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(3)
        .build()
        .unwrap();
    let again = pool.install(filled);
    assert_eq!(format!("{one:?}"), format!("{again:?}"));
}

/// A rest position at `centre`, to which all motions converge. From the left Newton does not find
/// it: where the step of the map is smallest, (x − centre + 1.2)² + 0.15, there is no rest
/// position.
#[derive(Clone)]
struct OneSided {
    centre: f64,
    /// Number of evaluations at states on the last part of the way, where Newton needs one step.
    near: Arc<AtomicUsize>,
}

impl Formula for OneSided {
    const DIMENSION: usize = 1;

    fn image(&self, x: &[f64], out: &mut [f64]) {
        let y = x[0] - self.centre;
        if (1e-9..0.4).contains(&y.abs()) {
            self.near.fetch_add(1, Ordering::Relaxed);
        }
        out[0] = if y < -0.4 {
            x[0] + (y + 1.2).powi(2) + 0.15
        } else {
            self.centre + 0.5 * y
        };
    }

    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        let y = x[0] - self.centre;
        out[(0, 0)] = if y < -0.4 { 1.0 + 2.0 * (y + 1.2) } else { 0.5 };
    }

    fn derivative(&self, _: &[f64], _: &mut [f64]) {}
}

/// If Newton continues an orbit from one value to the next in one direction, no run is made in the
/// other direction.
#[test]
fn a_known_continuation_is_not_repeated_in_the_other_direction() {
    for direction in [1.0, -1.0] {
        let near = Arc::new(AtomicUsize::new(0));
        let centre = |k: usize| direction * (10.0 + k as f64);
        let at = |k: usize| {
            let centre = centre(k);
            let near = Arc::clone(&near);
            Ok(System(OneSided { centre, near }))
        };
        let classify_options = few().census.classify;
        let known: Vec<_> = (0..20)
            .map(|k| {
                match classify(&mut at(k).unwrap(), &[centre(k) + 0.1], &classify_options).kind {
                    MotionKind::Periodic(orbit) => vec![orbit],
                    other => panic!("{other:?}"),
                }
            })
            .collect();
        assert!(near.swap(0, Ordering::Relaxed) > 20);
        let neighbours = grid_neighbours(&[20]);
        let shared = share_orbits(
            known,
            at,
            neighbours,
            &classify_options,
            &Control::default(),
        );
        for (k, value) in shared.iter().enumerate() {
            assert!((fixed_points(value)[0] - centre(k)).abs() < 1e-12);
            assert_eq!((value.attractors.len(), value.attractors[0].branch), (1, 0));
        }
        assert_eq!(near.load(Ordering::Relaxed), 0);
    }
}
