//! The map as a library user sees it: one state and many, derivatives over several periods, the
//! motion between strobes, errors.

use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::map::{Map, MapError};
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap_dynamics::{Scheduling as _, StroboscopicMap};

fn regular() -> Map {
    let case = Cantilever {
        omega: 3.0,
        ..Cantilever::paper()
    };
    Map::new(&Case::from(case)).unwrap()
}

fn largest(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max)
}

#[test]
fn many_states_agree_with_single_ones_and_can_be_cancelled() {
    let map = regular();
    let mut states: Vec<f64> = (0..20 * 6)
        .map(|k| 0.05 * (f64::from(k) * 1.7).sin())
        .collect();
    let alone: Vec<f64> = states
        .chunks(6)
        .flat_map(|state| map.apply(state, 1500).unwrap())
        .collect();
    let cancel = nanotap::control::CancelFlag::new();
    cancel.cancel();
    let stopped = Control {
        cancel: Some(&cancel),
        ..Control::default()
    };
    let mut left = states.clone();
    let refused = map.apply_all(&mut left, 1500, &stopped);
    assert!(matches!(refused, Err(MapError::Stopped)));
    let mut in_halves = states.clone();
    map.apply_all(&mut states, 1500, &Control::default())
        .unwrap();
    assert!(largest(&states, &alone) < 1e-12);
    // A result does not depend on the other states.
    for half in in_halves.chunks_mut(10 * 6) {
        map.apply_all(half, 1500, &Control::default()).unwrap();
    }
    assert_eq!(states, in_halves);
}

/// With one contact, with a stop that resets the state, and under a nonlinear law: each of many
/// states passes through the same states as alone, in batches or in sequence.
#[test]
fn strobe_states_of_many_motions_agree_with_single_ones() {
    let stop = Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.1,
        forcing: 1.0,
        omega: 2.5,
        gap: 0.2,
        stop: Stop::Rigid { restitution: 0.8 },
    };
    let hertz = [
        "modes=1",
        "cantilever.k=0.9 N/m",
        "cantilever.f0=100 kHz",
        "cantilever.Q=200",
        "tip.radius=5 nm",
        "drive.actuation=tip",
        "drive.frequency=100 kHz",
        "drive.free_amplitude=20 nm",
        "gap.tip=18 nm",
        "sample.law=hertz",
        "sample.modulus=1 GPa",
        "sample.poisson=0.3",
    ];
    let hertz = Case::parse(None, &hertz.map(str::to_owned)).unwrap();
    let models = [
        (Model::cantilever(&Cantilever::paper()).unwrap(), true),
        (stop.model().unwrap(), false),
        (hertz.model().unwrap(), false),
    ];
    for (model, side_by_side) in models {
        let mut map = ModelMap::new(&model);
        assert_eq!(map.batch_size() > 1, side_by_side);
        let d = map.dimension();
        let numbers = 0..u32::try_from(10 * d).unwrap();
        let starts: Vec<f64> = numbers.map(|k| 0.05 * (f64::from(k) * 1.7).sin()).collect();
        let periods: Vec<usize> = (0..10).map(|k| k % 4).collect();
        let (mut ends, mut passed) = (starts.clone(), vec![vec![1.0]; 10]);
        let results = map.advance_each_through(&mut ends, &periods, &mut passed);
        assert!(results.iter().all(Result::is_ok), "{results:?}");
        for (k, start) in starts.chunks_exact(d).enumerate() {
            let mut state = start.to_vec();
            assert_eq!(passed[k].len(), d * periods[k]);
            for passed in passed[k].chunks_exact(d) {
                map.advance(&mut state).unwrap();
                assert!(largest(passed, &state) < 1e-11);
            }
            assert!(largest(&ends[k * d..][..d], &state) < 1e-11);
        }
    }
}

#[test]
fn derivatives_over_several_periods() {
    let map = regular();
    let state = map.apply(&[0.0; 6], 40).unwrap();
    let keys = [Key::Alpha4, Key::Omega];
    let exact = map.linearised(&state, 3, &keys).unwrap();
    assert!(largest(&exact.state, &map.apply(&state, 3).unwrap()) < 1e-13);
    for (k, &key) in keys.iter().enumerate() {
        let (value, h) = (map.case().get(key), 1e-5 * map.case().get(key));
        let at = |h: f64| {
            let moved = Map::new(&map.case().with(key, value + h)).unwrap();
            moved.apply(&state, 3).unwrap()
        };
        let (a, b, c, d) = (at(-2.0 * h), at(-h), at(h), at(2.0 * h));
        let slope: Vec<f64> = (0..6)
            .map(|i| (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * h))
            .collect();
        let scale = slope.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        assert!(largest(exact.derivatives.column(k).as_slice(), &slope) < 1e-7 * scale);
    }
}

#[test]
fn a_motion_does_not_depend_on_its_division() {
    let map = regular();
    let start = map.apply(&[0.0; 6], 40).unwrap();
    let period = map.period();
    let whole = map.flow(&start, 0.0, 2.5 * period).unwrap();
    assert!(!whole.events().is_empty());
    let strobe = whole.at(period).state;
    assert!(largest(&strobe, &map.apply(&start, 1).unwrap()) < 1e-13);
    let rest = map.flow(&whole.at(0.3).state, 0.3, period).unwrap();
    let (a, b) = (rest.at(0.3 + period), whole.at(0.3 + period));
    assert!(largest(&a.state, &b.state) < 1e-12);
    assert_eq!(a.contact, b.contact);
    for event in whole.events() {
        assert!(whole.at(event.tau).gap.abs() < 1e-12);
    }
    let nothing = map.flow(&start, 0.0, 0.0).unwrap();
    assert_eq!(nothing.at(1.0).state, start);
    for (from, length) in [(period, 1.0), (0.0, -1.0), (0.0, f64::NAN), (0.0, 1e9)] {
        let refused = map.flow(&start, from, length);
        assert!(matches!(refused, Err(MapError::Span { .. })));
    }
}
