//! Basins on a slice.

use nanotap_dynamics::{
    BasinOptions, Basins, CensusOptions, Control, Label, Slice, SliceAxis, StartBox, census,
};

use crate::systems::{ChaosAndRest, Cubic, Formula, Henon, System};
use nanotap_dynamics::DMatrix;

/// Two uncoupled cubic maps: four attractors, one in each quadrant.
#[derive(Clone, Debug)]
struct TwoCubics;

impl Formula for TwoCubics {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        Cubic(1.4).image(&x[..1], &mut out[..1]);
        Cubic(1.6).image(&x[1..], &mut out[1..]);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out.fill(0.0);
        out[(0, 0)] = 1.4 - 3.0 * x[0] * x[0];
        out[(1, 1)] = 1.6 - 3.0 * x[1] * x[1];
    }
    fn derivative(&self, _x: &[f64], _out: &mut [f64]) {}
}

fn axis(coordinate: usize, from: f64, to: f64, count: usize) -> SliceAxis {
    SliceAxis {
        coordinate,
        from,
        to,
        count,
    }
}

#[test]
fn each_quadrant_is_the_basin_of_one_attractor() {
    let map = System(TwoCubics);
    let starts = StartBox::new(vec![-1.0, -1.0], vec![1.0, 1.0])
        .unwrap()
        .starts(1, 64);
    let found = census(
        &map,
        &starts,
        &CensusOptions::default(),
        &Control::default(),
    );
    assert_eq!(found.attractors.len(), 4);
    let slice = Slice::new(
        vec![0.0, 0.0],
        axis(0, -1.0, 1.0, 40),
        axis(1, -1.0, 1.0, 30),
    )
    .unwrap();
    let basins = Basins::new(
        &map,
        slice.clone(),
        &found.attractors,
        BasinOptions::default(),
    )
    .unwrap();
    let all = basins.chunk(&mut map.clone(), 0..basins.len());
    let mut state = [0.0; 2];
    for (index, label) in all.iter().enumerate() {
        slice.state(index, &mut state);
        let Label::Attractor(k) = label else {
            panic!("{state:?} {label:?}")
        };
        let goal = &found.attractors[*k as usize].state;
        assert!(goal[0] * state[0] > 0.0 && goal[1] * state[1] > 0.0);
    }
    // Chunks are parts of the whole; the last one is cut at the end.
    assert_eq!(basins.chunk(&mut map.clone(), 100..250), all[100..250]);
    assert_eq!(basins.chunk(&mut map.clone(), 1190..5000), all[1190..]);
    // The saddle at the origin is a fixed point: no label.
    let origin = Slice::new(vec![0.0, 0.0], axis(0, 0.0, 0.0, 1), axis(1, 0.0, 0.0, 1)).unwrap();
    let basins = Basins::new(&map, origin, &found.attractors, BasinOptions::default()).unwrap();
    assert_eq!(basins.chunk(&mut map.clone(), 0..1), [Label::Unsettled]);
}

#[test]
fn chaotic_attractors_are_labelled_by_their_box() {
    let map = System(Henon { a: 1.4, b: 0.3 });
    let starts = vec![vec![0.1, 0.1]];
    let found = census(
        &map,
        &starts,
        &CensusOptions::default(),
        &Control::default(),
    );
    let slice = Slice::new(
        vec![0.0, 0.0],
        axis(0, -2.0, 2.0, 21),
        axis(1, -2.0, 2.0, 21),
    )
    .unwrap();
    let options = BasinOptions {
        max_periods: 500,
        ..BasinOptions::default()
    };
    let basins = Basins::new(&map, slice, &found.attractors, options).unwrap();
    let labels = basins.chunk(&mut map.clone(), 0..basins.len());
    assert!(labels.contains(&Label::Attractor(0)) && labels.contains(&Label::Unbounded));
    assert!(
        labels
            .iter()
            .all(|l| matches!(l, Label::Attractor(0) | Label::Unbounded))
    );
    // The centre of the slice is in the attractor's basin, a far corner is not.
    assert_eq!(labels[10 * 21 + 10], Label::Attractor(0));
    assert_eq!(labels[0], Label::Unbounded);
}

/// A rest position near a chaotic attractor is not in the box of its states, whose sides along the
/// constant coordinate have zero length.
#[test]
fn a_rest_position_near_a_chaotic_attractor_is_not_in_its_box() {
    let map = System(ChaosAndRest);
    let starts = vec![vec![0.1, -1.0]];
    let found = census(
        &map,
        &starts,
        &CensusOptions::default(),
        &Control::default(),
    );
    let slice = Slice::new(vec![0.0, 0.0], axis(0, -0.9, 0.9, 4), axis(1, -1.0, 1.0, 2)).unwrap();
    let options = BasinOptions {
        max_periods: 500,
        ..BasinOptions::default()
    };
    let basins = Basins::new(&map, slice, &found.attractors, options).unwrap();
    let labels = basins.chunk(&mut map.clone(), 0..8);
    assert_eq!(labels[..4], [Label::Attractor(0); 4]);
    assert_eq!(labels[4..], [Label::Unsettled; 4]);
}

/// Row by row, the first axis fastest.
#[test]
fn points_of_a_slice_are_numbered_row_by_row() {
    let slice = Slice::new(
        vec![7.0, 7.0, 7.0],
        axis(2, 0.0, 1.0, 3),
        axis(0, 10.0, 40.0, 4),
    )
    .unwrap();
    assert_eq!(slice.len(), 12);
    assert!(!slice.is_empty());
    let state = |index: usize| {
        let mut out = [0.0; 3];
        slice.state(index, &mut out);
        out
    };
    assert_eq!(state(1), [10.0, 7.0, 0.5]);
    assert_eq!(state(5), [20.0, 7.0, 1.0]);
    assert_eq!(state(9), [40.0, 7.0, 0.0]);
}

#[test]
fn invalid_slices_are_refused() {
    for (x, y) in [
        (axis(0, 0.0, 1.0, 0), axis(1, 0.0, 1.0, 2)),
        (axis(0, 0.0, f64::NAN, 3), axis(1, 0.0, 1.0, 2)),
        (axis(2, 0.0, 1.0, 3), axis(1, 0.0, 1.0, 2)),
        (axis(1, 0.0, 1.0, 3), axis(1, 0.0, 1.0, 2)),
    ] {
        assert!(Slice::new(vec![0.0, 0.0], x, y).is_err());
    }
}
