//! The census: fractions, chaos, and the list of unstable orbits.

use std::sync::Mutex;

use nanotap_dynamics::{
    AttractorKind, CancelFlag, Census, CensusOptions, ClassifyOptions, Control, LyapunovOptions,
    Neighbourhood, OrbitSearch, ShootingOptions, StartBox, StartOutcome, StartSet, census,
    census_of, find_orbits,
};
use rayon::ThreadPoolBuilder;

use crate::systems::{
    ChaosAndRest, Cubic, Focus, Formula, Henon, Logistic, Nested, OpenTent, System, Turning,
    TwoShells,
};

fn starts(low: &[f64], high: &[f64], count: usize) -> Vec<Vec<f64>> {
    StartBox::new(low.to_vec(), high.to_vec())
        .unwrap()
        .starts(1, count)
}

fn taken<F: Formula>(system: F, starts: &[Vec<f64>], options: &CensusOptions) -> Census {
    census(&System(system), starts, options, &Control::default())
}

/// Two mirror-image attractors share a symmetric box evenly; starts beyond √(r+1) escape: (2.5 −
/// √2.5)/2.5 of [−2.5, 2.5] at r = 1.5.
#[test]
fn fractions_match_the_exact_basins() {
    let result = taken(
        Cubic(1.5),
        &starts(&[-2.5], &[2.5], 1000),
        &CensusOptions::default(),
    );
    assert_eq!(result.attractors.len(), 2);
    let lost = 1.0 - 2.5f64.sqrt() / 2.5;
    assert!((result.unbounded.estimate - lost).abs() < 2e-3);
    for attractor in &result.attractors {
        let AttractorKind::Periodic(orbit) = &attractor.kind else {
            panic!()
        };
        assert!((orbit.states[0][0].abs() - 0.5f64.sqrt()).abs() < 1e-15);
        let expected = 0.5 * (1.0 - lost);
        assert!(attractor.fraction.low < expected && expected < attractor.fraction.high);
    }
    assert!(result.undecided.is_empty());
    assert!(result.transient_chaos.is_none());
}

/// The same bits on one thread and on several, for starts that go to orbits, escape or are chaotic,
/// in sequence and in batches; the same counts with another number of pilots.
#[test]
fn the_result_does_not_depend_on_threads_or_pilots() {
    fn on<F: Formula>(system: F, threads: usize, pilots: usize) -> Census {
        let low = [-1.5, -0.5];
        let high = [1.5, 0.5];
        let points = starts(&low[..F::DIMENSION], &high[..F::DIMENSION], 300);
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let options = CensusOptions {
            pilots,
            ..CensusOptions::default()
        };
        pool.install(|| taken(system, &points, &options))
    }
    fn assert_same<F: Formula>(system: &F) {
        let one = on(system.clone(), 1, 32);
        for threads in [2, 4] {
            let more = on(system.clone(), threads, 32);
            assert_eq!(format!("{one:?}"), format!("{more:?}"));
        }
        let fewer = on(system.clone(), 2, 5);
        let counts =
            |c: &Census| -> Vec<usize> { c.attractors.iter().map(|a| a.fraction.count).collect() };
        assert_eq!(counts(&one), counts(&fewer));
    }
    assert_same(&Cubic(1.5));
    assert_same(&Henon { a: 0.9, b: 0.3 });
    assert_same(&Henon { a: 1.4, b: 0.3 });
}

/// Hénon's attractor: one chaotic attractor without escape; all other starts are unbounded.
#[test]
fn chaos_has_a_pooled_bound_of_its_lifetime() {
    let result = taken(
        Henon { a: 1.4, b: 0.3 },
        &starts(&[-0.5, -0.2], &[0.5, 0.2], 40),
        &CensusOptions::default(),
    );
    assert_eq!(result.attractors.len(), 1);
    let AttractorKind::Chaotic { spectrum, lifetime } = &result.attractors[0].kind else {
        panic!()
    };
    let (largest, error) = spectrum.largest();
    assert!((largest - 0.41922).abs() < 5.0 * error);
    let watched: usize = result
        .outcomes_by_start
        .iter()
        .map(|f| match f {
            StartOutcome::Attractor { periods, .. } => *periods,
            _ => 0,
        })
        .sum();
    assert_eq!(lifetime.escapes, 0);
    assert!(lifetime.low > 0.2 * watched as f64 && lifetime.low < watched as f64 / 2.99);
    assert!(result.transient_chaos.is_none());
}

/// A quarter of |y| ≤ 2 lies beyond 3/2. Starts after the first eight are recognised by the means
/// of the known attractors. The second attractor has the same mean state and exponents as the
/// first.
#[test]
fn coexisting_chaos_with_equal_means_is_distinguished() {
    let options = CensusOptions {
        pilots: 8,
        ..CensusOptions::default()
    };
    let starts = starts(&[-0.9, -2.0], &[0.9, 2.0], 200);
    let result = taken(TwoShells, &starts, &options);
    assert_eq!(result.attractors.len(), 2);
    for (start, outcome) in starts.iter().zip(&result.outcomes_by_start) {
        let StartOutcome::Attractor { index, .. } = *outcome else {
            panic!("{start:?}: {outcome:?}")
        };
        let beyond = result.attractors[index].state[1].abs() > 1.5;
        assert_eq!(beyond, start[1].abs() >= 1.5);
    }
    for attractor in &result.attractors {
        let AttractorKind::Chaotic { spectrum, lifetime } = &attractor.kind else {
            panic!()
        };
        let (largest, error) = spectrum.largest();
        assert!((largest - 2f64.ln()).abs() < 5.0 * error);
        assert_eq!(lifetime.escapes, 0);
    }
}

/// Periods for which the chaotic starts after the first four, which are measured, were watched.
/// Every start leads to the circle |z| = 1 and rotates on it by the golden mean.
#[test]
fn one_torus_is_one_attractor() {
    let map = Turning {
        angle: std::f64::consts::TAU * 0.618_033_988_749_895,
        gain: 0.2,
    };
    let result = taken(
        map,
        &starts(&[0.2, 0.2], &[1.2, 1.2], 12),
        &CensusOptions::default(),
    );
    assert_eq!(result.attractors.len(), 1);
    assert!(matches!(
        result.attractors[0].kind,
        AttractorKind::QuasiPeriodic(_)
    ));
    assert!(result.undecided.is_empty());
}

fn watched_periods(result: &Census) -> Vec<usize> {
    let chaotic =
        |index: usize| matches!(result.attractors[index].kind, AttractorKind::Chaotic { .. });
    let outcomes = result.outcomes_by_start[4..].iter();
    let periods = outcomes.filter_map(|outcome| match outcome {
        StartOutcome::Attractor { index, periods } if chaotic(*index) => Some(*periods),
        _ => None,
    });
    periods.collect()
}

/// A start recognised on known chaos is not observed further if no stable orbit is known. Otherwise
/// it is observed for at least eight times the 64 periods after which escapes are counted.
#[test]
fn chaos_near_a_stable_orbit_is_observed_for_several_transients() {
    let options = CensusOptions {
        pilots: 4,
        ..CensusOptions::default()
    };
    let henon = Henon { a: 1.4, b: 0.3 };
    let alone = taken(henon, &starts(&[-0.5, -0.2], &[0.5, 0.2], 40), &options);
    let recognised = watched_periods(&alone);
    assert!(!recognised.is_empty());
    assert!(
        recognised
            .iter()
            .all(|periods| (256..8 * 64).contains(periods)),
        "{recognised:?}"
    );
    let both = starts(&[-0.9, -1.5], &[0.9, 1.5], 60);
    let census = taken(ChaosAndRest, &both, &options);
    assert_eq!(census.attractors.len(), 2);
    let watched = watched_periods(&census);
    assert!(!watched.is_empty());
    assert!(
        watched.iter().all(|&periods| periods >= 8 * 64),
        "{watched:?}"
    );
}

/// Geometric lifetimes with mean 1/ln(s/2) = 1/ln 1.001 ≈ 1000.5: some starts escape, some do not,
/// and no chaotic attractor is reported.
#[test]
fn transient_chaos_has_its_exact_lifetime() {
    let options = CensusOptions {
        classify: ClassifyOptions {
            lyapunov: LyapunovOptions {
                min_periods: 1500,
                max_periods: 1500,
                ..LyapunovOptions::default()
            },
            ..ClassifyOptions::default()
        },
        ..CensusOptions::default()
    };
    let result = taken(OpenTent(2.002), &starts(&[0.0], &[1.0], 400), &options);
    assert_eq!(result.attractors.len(), 1);
    let transient = result.transient_chaos.unwrap();
    let exact = 1.0 / 1.001f64.ln();
    assert!(
        transient.lifetime.low < exact && exact < transient.lifetime.high,
        "{transient:?}"
    );
    assert!((transient.lifetime.mean / exact - 1.0).abs() < 0.15);
    assert!(transient.unescaped.count > 0);
    // If starts escape, the others are observed for as long as a transient may last.
    let whole = options.classify.max_transient;
    assert!(
        result
            .outcomes_by_start
            .iter()
            .all(|outcome| match outcome {
                StartOutcome::TransientChaos { periods } => *periods >= whole,
                _ => true,
            })
    );
    assert_eq!(
        transient.destinations,
        vec![(0, transient.lifetime.escapes)]
    );
    assert!((transient.spectrum.unwrap().largest().0 - 2.002f64.ln()).abs() < 1e-12);
}

/// A slow focus is one periodic attractor, not transient chaos.
#[test]
fn slow_decay_is_not_transient_chaos() {
    let result = taken(
        Focus {
            radius: 0.999,
            angle: 1.0,
        },
        &starts(&[-5.0, -5.0], &[5.0, 5.0], 50),
        &CensusOptions::default(),
    );
    assert_eq!(result.attractors.len(), 1);
    assert_eq!(result.attractors[0].fraction.count, 50);
    assert!(result.transient_chaos.is_none());
}

#[test]
fn a_cancelled_census_reports_it_and_progress_is_called() {
    let cancel = CancelFlag::new();
    cancel.cancel();
    let control = Control {
        cancel: Some(&cancel),
        progress: None,
    };
    let points = starts(&[0.0], &[1.0], 10);
    let result = census(
        &System(Logistic(3.2)),
        &points,
        &CensusOptions::default(),
        &control,
    );
    assert!(result.cancelled);
    assert!(result.attractors.is_empty());
    assert_eq!(result.undecided.len(), result.outcomes_by_start.len());
    // Most of many starts are never generated.
    let cancel = CancelFlag::new();
    let stop = |_, _| cancel.cancel();
    let control = Control {
        cancel: Some(&cancel),
        progress: Some(&stop),
    };
    let many = starts(&[0.0], &[1.0], 100_000);
    let options = CensusOptions::default();
    let result = census(&System(Logistic(3.2)), &many, &options, &control);
    assert!(result.cancelled && result.outcomes_by_start.len() < 10_000);
    assert!(result.undecided.len() < result.outcomes_by_start.len());
    let heard = Mutex::new(Vec::new());
    let progress = |done, total| heard.lock().unwrap().push((done, total));
    let control = Control {
        cancel: None,
        progress: Some(&progress),
    };
    let result = census(
        &System(Logistic(3.2)),
        &points,
        &CensusOptions::default(),
        &control,
    );
    assert!(!result.cancelled);
    let mut heard = heard.into_inner().unwrap();
    heard.sort_unstable();
    assert_eq!(heard, (1..=10).map(|k| (k, 10)).collect::<Vec<_>>());
}

/// The logistic map at r = 4 has exactly 2, 1, 2, 3, 6 orbits of period 1 … 5
/// (Moreau's necklace count of 2ⁿ points).
#[test]
fn every_orbit_of_the_full_logistic_map_is_found() {
    let search = OrbitSearch {
        max_period: 5,
        ..OrbitSearch::default()
    };
    let points = starts(&[0.0], &[1.0], 200);
    let orbits = find_orbits(
        &System(Logistic(4.0)),
        &points,
        &search,
        &Control::default(),
    );
    let counts: Vec<usize> = (1..=5)
        .map(|n| orbits.iter().filter(|o| o.period == n).count())
        .collect();
    assert_eq!(counts, [2, 1, 2, 3, 6]);
    // All multipliers are ±2ⁿ except that of the fixed point 0, which is 4.
    for orbit in &orbits {
        let expected = if orbit.scale() < 1e-12 {
            4.0
        } else {
            2f64.powi(orbit.period as i32)
        };
        assert!((orbit.spectral_radius() / expected - 1.0).abs() < 1e-9);
    }
}

/// One invariant circle is one attractor, from any start and in any census; one with faster
/// attraction, ln(1 − 2g), is another.
#[test]
fn a_torus_is_counted_once() {
    let torus = |gain: f64, side: f64| {
        let mut result = taken(
            Turning { angle: 2.4, gain },
            &starts(&[-side, -side], &[side, side], 12),
            &CensusOptions::default(),
        );
        assert_eq!(result.attractors.len(), 1);
        let kind = result.attractors.remove(0).kind;
        assert!(matches!(kind, AttractorKind::QuasiPeriodic(_)));
        kind
    };
    let kind = torus(0.2, 1.2);
    assert!(kind.is_same_as(&torus(0.2, 0.7)));
    assert!(!kind.is_same_as(&torus(0.3, 1.2)));
}

/// Newton with at most three steps finds nothing from afar, but it converges from a near recurrence
/// of a chaotic run: the fixed point in the Hénon attractor.
#[test]
fn orbits_are_found_where_a_run_nearly_repeats() {
    let henon = Henon { a: 1.4, b: 0.3 };
    let found = |run: usize, bound: f64| {
        let search = OrbitSearch {
            max_period: 1,
            run,
            bound,
            shooting: ShootingOptions {
                max_iterations: 3,
                ..ShootingOptions::default()
            },
        };
        let start = vec![vec![0.1, 0.1]];
        find_orbits(&System(henon.clone()), &start, &search, &Control::default())
    };
    assert!(found(0, 1e8).is_empty());
    assert!(found(20_000, 1.0).is_empty());
    let orbits = found(20_000, 1e8);
    let fixed = &orbits[0];
    assert_eq!(fixed.period, 1);
    assert!((fixed.states[0][0] - henon.fixed_point()[0]).abs() < 1e-9);
    assert_eq!(orbits.len(), 1);
}

/// The ball of the cubic map at x* = √(r−1) contracts where |f'| < 1, that is for x² > (r−1)/3 and
/// x² < (r+1)/3; a larger ball must fail.
#[test]
fn neighbourhoods_stay_within_the_contracting_interval() {
    let mut map = System(Cubic(1.5));
    let orbit =
        nanotap_dynamics::close_orbit(&mut map, &[0.7], 1, &ShootingOptions::default()).unwrap();
    let ball = Neighbourhood::around(&mut map, &orbit).unwrap().unwrap();
    let half = ball.extents()[0];
    let centre = 0.5f64.sqrt();
    // |f'| ≤ 3/4, the required rate, holds within 0.159; the trial radii lose a factor (3/4)² at most.
    assert!(half > 0.159 * 0.56, "{half}");
    assert!(centre - half > (0.5f64 / 3.0).sqrt() && centre + half < (2.5f64 / 3.0).sqrt());
    assert!(ball.contains(&[centre + 0.05]));
    // A return that does not contract, here under another map, is rejected.
    let mut scratch = [0.0];
    let mut holds = |r: f64| ball.holds(&mut System(Cubic(r)), &[centre + 0.05], &mut scratch);
    assert!(holds(1.5).unwrap());
    assert!(!holds(1.7).unwrap());
}

/// Attractors within 1e-4 of the box are found by starts of all sizes and counted for each size:
/// all starts of the smallest size go there, half to each.
#[test]
fn small_motions_are_found_by_small_starts() {
    let s = 1e-4;
    let map = System(Nested { r: 1.5, s });
    let sides = StartBox::new(vec![-3.0], vec![3.0]).unwrap();
    let one_size = StartSet::drawn(sides.clone(), 1);
    let alone = census_of(
        &map,
        &one_size,
        &CensusOptions {
            max_starts: 300,
            ..CensusOptions::default()
        },
        &Control::default(),
    );
    assert_eq!(alone.attractors.len(), 2);
    let scales: Vec<f64> = (0..6).map(|k| 0.1f64.powi(k)).collect();
    let spread = StartSet::spread(&sides, &[0.0], &scales, 1).unwrap();
    let found = census_of(
        &map,
        &spread,
        &CensusOptions::default(),
        &Control::default(),
    );
    assert_eq!(found.attractors.len(), 4);
    assert_eq!(found.by_size.len(), 6);
    // 3e-5 < s √2.5: the smallest box lies entirely in the two small basins.
    let smallest = found.by_size.last().unwrap();
    for (a, part) in found.attractors.iter().zip(&smallest.attractors) {
        let expected = if a.state[0].abs() < 1.0 { 0.5 } else { 0.0 };
        assert!(part.low <= expected && expected <= part.high, "{part:?}");
    }
    let counted: usize = found.by_size.iter().map(|s| s.starts).sum();
    assert_eq!(counted, found.counted);
    let unseen = found.unseen.unwrap();
    assert!(unseen.share <= CensusOptions::default().unseen);
    assert_eq!(unseen.motions, 4);
}

/// Starts are drawn until the bound is reached, and no further; a budget ends the census earlier,
/// with a correspondingly larger bound.
#[test]
fn the_census_stops_once_the_bound_is_reached() {
    let sides = StartBox::new(vec![-1.0], vec![1.0]).unwrap();
    let set = StartSet::drawn(sides, 5).with_given([vec![0.3]]);
    let of = |options: &CensusOptions| {
        census_of(&System(Cubic(1.5)), &set, options, &Control::default())
    };
    // Two motions: ln(0.05/6) = −4.787, over ln(1 − p).
    for (share, row) in [(0.01, 477), (0.002, 2392)] {
        let found = of(&CensusOptions {
            unseen: share,
            ..CensusOptions::default()
        });
        let unseen = found.unseen.unwrap();
        assert!((row..row + 128).contains(&unseen.starts), "{unseen:?}");
        assert_eq!(found.counted + 1, found.outcomes_by_start.len());
    }
    let few = of(&CensusOptions {
        max_starts: 100,
        ..CensusOptions::default()
    });
    assert_eq!(few.counted, 100);
    assert!(few.unseen.unwrap().share > 0.04);
    // Without the budget a batch ends at 1952 starts.
    let budget = 3000;
    let short = of(&CensusOptions {
        max_periods: budget,
        ..CensusOptions::default()
    });
    let periods = short.outcomes_by_start.iter().map(|outcome| match outcome {
        StartOutcome::Attractor { periods, .. } => *periods,
        other => panic!("{other:?}"),
    });
    let enough = budget * short.counted / periods.sum::<usize>();
    assert!(
        short.counted.abs_diff(enough) < 128,
        "{} instead of {enough}",
        short.counted
    );
}

/// A motion known at a neighbouring value is found from its state, although no drawn start leads
/// there.
#[test]
fn given_states_are_tried_but_not_counted_as_starts() {
    let map = System(Nested { r: 1.5, s: 1e-9 });
    let sides = StartBox::new(vec![-3.0], vec![3.0]).unwrap();
    let set = StartSet::drawn(sides, 1).with_given([vec![1e-9]]);
    let options = CensusOptions {
        max_starts: 64,
        ..CensusOptions::default()
    };
    let found = census_of(&map, &set, &options, &Control::default());
    assert_eq!(found.attractors.len(), 3);
    assert_eq!(found.attractors[2].fraction.count, 0);
    assert_eq!(found.attractors[2].first_start, Some(0));
    let total: usize = found.attractors.iter().map(|a| a.fraction.count).sum();
    assert_eq!(total, 64);
}
