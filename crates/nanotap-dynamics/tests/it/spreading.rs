//! Attractors over grids of parameter values.

use std::convert::Infallible;

use nanotap_dynamics::{
    AttractorKind, CensusOptions, Control, DMatrix, GlobalOptions, GlobalValue, StartBox, StartSet,
    StroboscopicMap, TwoParameterFamily, attractors_along, attractors_over,
};

use crate::systems::{Cubic, Family, Logistic, Nested, System};

fn few() -> GlobalOptions {
    GlobalOptions {
        census: CensusOptions {
            max_starts: 24,
            ..CensusOptions::default()
        },
    }
}

fn fixed_points(value: &GlobalValue) -> Vec<f64> {
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

/// The mirror image is started at one value only, and known at all; the two form two
/// branches.
#[test]
fn what_one_value_shows_all_know() {
    let values: Vec<f64> = (0..41).map(|k| 1.1 + 0.02 * f64::from(k)).collect();
    let starts = |k: usize, _: &System<Cubic>| {
        let mut states = vec![vec![0.5]];
        if k == 17 {
            states.push(vec![-0.5]);
        }
        StartSet::given(states)
    };
    let found = attractors_along(&Family(Cubic), &values, starts, &few(), &Control::default());
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
    assert_eq!(found[16].attractors[1].shown_by, Some(17));
    assert_eq!(found[17].attractors[1].shown_by, None);
}

/// The period-3 window of the logistic map, 1 + √8 = 3.828427 … 3.841499 for its period
/// 3: found where the grid has it, however few the starts.
#[test]
fn a_window_keeps_its_period() {
    let values: Vec<f64> = (0..31).map(|k| 3.825 + 0.0005 * f64::from(k)).collect();
    let sides = StartBox::new(vec![0.0], vec![1.0]).unwrap();
    let starts = |_: usize, _: &System<Logistic>| StartSet::drawn(sides.clone(), 2);
    let options = GlobalOptions {
        census: CensusOptions {
            max_starts: 4,
            ..CensusOptions::default()
        },
    };
    let found = attractors_along(
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

struct NestedPlane;

impl TwoParameterFamily for NestedPlane {
    type Map = System<Nested>;
    type Error = Infallible;

    fn at(&self, r: f64, s: f64) -> Result<System<Nested>, Infallible> {
        Ok(System(Nested { r, s }))
    }

    fn advance_with_derivatives(
        &self,
        _: [f64; 2],
        map: &mut System<Nested>,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        _: [&mut [f64]; 2],
    ) -> Result<(), Infallible> {
        map.advance_with_jacobian(state, jacobian)
    }
}

/// Small motions met at one corner of a plane are known all over it.
#[test]
fn a_plane_fills_from_one_corner() {
    let first: Vec<f64> = (0..6).map(|k| 1.2 + 0.1 * f64::from(k)).collect();
    let second: Vec<f64> = (0..5).map(|k| 1e-3 * 1.3f64.powi(k)).collect();
    let starts = |k: usize, _: &System<Nested>| {
        let mut states = vec![vec![1.5], vec![-1.5]];
        if k == 0 {
            states.extend([vec![4e-4], vec![-4e-4]]);
        }
        StartSet::given(states)
    };
    let one = attractors_over(
        &NestedPlane,
        &first,
        &second,
        starts,
        &few(),
        &Control::default(),
    );
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
    let again = pool.install(|| {
        attractors_over(
            &NestedPlane,
            &first,
            &second,
            starts,
            &few(),
            &Control::default(),
        )
    });
    assert_eq!(format!("{one:?}"), format!("{again:?}"));
}
