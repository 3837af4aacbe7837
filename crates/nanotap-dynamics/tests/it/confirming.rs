//! Motions that are followed on an approximate map and confirmed on the exact one.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::{
    AttractorKind, CancelFlag, Census, CensusEnd, CensusOptions, ClassifyOptions, Control, DMatrix,
    MotionKind, PeriodicOrbit, StartBox, StartSet, StroboscopicMap, UndecidedReason, census_of,
    classify,
};

use crate::systems::{Cubic, Formula, Logistic, Nested, System};

/// A map with another one as its approximation, and the numbers of periods advanced on each.
#[derive(Clone)]
struct Pair<F> {
    map: System<F>,
    coarse: Option<F>,
    exact_periods: Arc<AtomicUsize>,
    coarse_periods: Arc<AtomicUsize>,
}

impl<F> Pair<F> {
    fn new(exact: F, coarse: F) -> Self {
        Self {
            map: System(exact),
            coarse: Some(coarse),
            exact_periods: Arc::default(),
            coarse_periods: Arc::default(),
        }
    }

    fn count(&self) {
        let periods = match self.coarse {
            Some(_) => &self.exact_periods,
            None => &self.coarse_periods,
        };
        periods.fetch_add(1, Ordering::Relaxed);
    }

    fn periods(&self) -> [usize; 2] {
        [&self.exact_periods, &self.coarse_periods].map(|periods| periods.load(Ordering::Relaxed))
    }
}

impl<F: Formula> nanotap_dynamics::Scheduling for Pair<F> {
    fn coarse(&self) -> Option<Self> {
        let coarse = self.coarse.clone()?;
        Some(Self {
            map: System(coarse),
            coarse: None,
            ..self.clone()
        })
    }
}

impl<F: Formula> StroboscopicMap for Pair<F> {
    type Error = Infallible;

    fn dimension(&self) -> usize {
        self.map.dimension()
    }

    fn period(&self) -> f64 {
        self.map.period()
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
        self.count();
        self.map.advance(state)
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), Infallible> {
        self.count();
        self.map.advance_with_jacobian(state, jacobian)
    }
}

fn drawn(low: f64, high: f64) -> StartSet {
    StartSet::drawn(StartBox::new(vec![low], vec![high]).unwrap(), 1)
}

fn taken<F: Formula>(map: &Pair<F>, starts: &StartSet) -> Census {
    let options = CensusOptions {
        unseen: 0.01,
        ..CensusOptions::default()
    };
    census_of(map, starts, &options, &Control::default())
}

fn orbits(census: &Census) -> Vec<&PeriodicOrbit> {
    let orbits = census.attractors.iter().map(|a| match &a.kind {
        AttractorKind::Periodic(orbit) => orbit,
        other => panic!("{other:?}"),
    });
    orbits.collect()
}

/// The fixed points of r x − x³ are ±√(r − 1), and half of the starts lead to each.
#[test]
fn orbits_are_those_of_the_exact_map() {
    let map = Pair::new(Cubic(1.6), Cubic(1.601));
    let found = taken(&map, &drawn(-1.0, 1.0));
    assert!(found.followed_coarsely);
    assert_eq!(found.end, CensusEnd::BoundMet);
    assert_eq!(found.attractors.len(), 2);
    for (orbit, attractor) in orbits(&found).iter().zip(&found.attractors) {
        assert!((orbit.states[0][0].abs() - 0.6f64.sqrt()).abs() < 1e-14);
        assert!((orbit.multipliers[0].re - (3.0 - 2.0 * 1.6)).abs() < 1e-12);
        assert!(attractor.fraction.low < 0.5 && 0.5 < attractor.fraction.high);
    }
    let [exact, coarse] = map.periods();
    assert!(exact < 100 && coarse > 10 * exact, "{exact} {coarse}");
}

/// r x (1 − x) doubles its period at r = 3: the approximate map is on one side, the exact one on
/// the other.
#[test]
fn the_period_is_that_of_the_exact_map() {
    for (exact, coarse, period) in [(3.02, 2.98, 2), (2.98, 3.02, 1)] {
        let mut map = Pair::new(Logistic(exact), Logistic(coarse));
        let named = classify(&mut map, &[0.3], &ClassifyOptions::default());
        let MotionKind::Periodic(orbit) = &named.kind else {
            panic!("{named:?}")
        };
        assert_eq!(orbit.period, period);
        let found = taken(&map, &drawn(0.1, 0.9));
        assert_eq!(found.attractors.len(), 1);
        assert_eq!(orbits(&found)[0].period, period);
        assert_eq!(found.attractors[0].fraction.count, found.counted);
    }
}

/// At 3.83 there is a stable period 3, at 3.9 there is none: it is not reported.
#[test]
fn a_motion_of_the_approximate_map_only_is_not_reported() {
    let mut map = Pair::new(Logistic(3.9), Logistic(3.83));
    let named = classify(&mut map, &[0.3], &ClassifyOptions::default());
    assert!(matches!(named.kind, MotionKind::Chaotic(_)), "{named:?}");
    let found = taken(&map, &drawn(0.1, 0.9));
    assert_eq!(found.attractors.len(), 1);
    let kind = &found.attractors[0].kind;
    assert!(matches!(kind, AttractorKind::Chaotic { .. }), "{kind:?}");
}

/// The exponent at r = 4 is ln 2; that of the approximate map at 3.9 is 0.5.
#[test]
fn exponents_are_those_of_the_exact_map() {
    let map = Pair::new(Logistic(4.0), Logistic(3.999));
    let found = taken(&map, &drawn(0.1, 0.9));
    assert_eq!(found.attractors.len(), 1);
    let AttractorKind::Chaotic { spectrum, .. } = &found.attractors[0].kind else {
        panic!("{found:?}")
    };
    let (exponent, error) = spectrum.largest();
    assert!((exponent - 2f64.ln()).abs() < 5.0 * error + 2e-3);
    let [exact, coarse] = map.periods();
    assert!(coarse > 20 * exact, "{exact} {coarse}");
}

/// At 3.8285, near the window of period 3 (from 1 + √8 = 3.828427), the orbit is reached after
/// chaos that the approximate map at 3.82 does not leave.
#[test]
fn chaos_that_only_the_exact_map_leaves_is_not_an_attractor() {
    let mut map = Pair::new(Logistic(3.84), Logistic(3.82));
    let named = classify(&mut map, &[0.3], &ClassifyOptions::default());
    let MotionKind::Periodic(orbit) = &named.kind else {
        panic!("{named:?}")
    };
    assert_eq!(orbit.period, 3);
    let found = taken(&map, &drawn(0.1, 0.9));
    let mut kinds = found.attractors.iter().map(|a| &a.kind);
    assert!(kinds.all(|kind| matches!(kind, AttractorKind::Periodic(orbit) if orbit.period == 3)));
}

/// A motion with a basin of 1e-9 of the starts, from a seed near it; the unstable orbit at 0, on
/// the boundary of two basins, is known too.
#[test]
fn orbits_from_seeds_are_attractors_without_starts() {
    let nested = Nested { r: 1.5, s: 1e-9 };
    let map = Pair::new(nested.clone(), nested);
    let start = drawn(-3.0, 3.0);
    let found = taken(
        &map,
        &start
            .clone()
            .with_seeds([(1, vec![6e-10]), (1, vec![1e-15])]),
    );
    assert_eq!(found.attractors.len(), 3);
    assert_eq!(found.attractors[2].fraction.count, 0);
    assert_eq!(found.attractors[2].first_start, None);
    assert_eq!(found.unstable.len(), 1);
    assert_eq!(taken(&map, &start).attractors.len(), 2);
}

/// After the signal each thread advances its motion for about one period and examines it once.
#[test]
fn a_cancelled_census_of_chaos_ends_soon() {
    let map = Pair::new(Logistic(3.9), Logistic(3.9001));
    let cancel = CancelFlag::new();
    let at = AtomicUsize::new(0);
    let stop = |done, _| {
        if done == 100 {
            cancel.cancel();
            at.store(map.periods().iter().sum(), Ordering::Relaxed);
        }
    };
    let control = Control {
        cancel: Some(&cancel),
        progress: Some(&stop),
    };
    let found = census_of(&map, &drawn(0.1, 0.9), &CensusOptions::default(), &control);
    assert!(found.cancelled);
    let after = map.periods().iter().sum::<usize>() - at.load(Ordering::Relaxed);
    assert!(after < 20_000, "{after}");
}

/// A map whose periods cost 100 steps each.
#[derive(Clone)]
struct Counted {
    map: System<Logistic>,
    cost: u64,
}

impl nanotap_dynamics::Scheduling for Counted {
    fn cost(&self) -> u64 {
        self.cost
    }
}

impl StroboscopicMap for Counted {
    type Error = Infallible;

    fn dimension(&self) -> usize {
        1
    }

    fn period(&self) -> f64 {
        1.0
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
        self.cost += 100;
        self.map.advance(state)
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), Infallible> {
        self.cost += 100;
        self.map.advance_with_jacobian(state, jacobian)
    }
}

/// Chaos at 3.9 takes thousands of periods to measure: a run of 20,000 steps at most is left
/// undecided after 200 periods.
#[test]
fn a_run_ends_at_its_budget_of_steps() {
    let mut map = Counted {
        map: System(Logistic(3.9)),
        cost: 7,
    };
    let options = ClassifyOptions {
        max_steps: 20_000,
        ..ClassifyOptions::default()
    };
    let found = classify(&mut map, &[0.3], &options);
    let MotionKind::Undecided { reason, .. } = found.kind else {
        panic!("{:?}", found.kind)
    };
    let UndecidedReason::Budget { periods, steps } = reason else {
        panic!("{reason}")
    };
    assert_eq!(steps, 20_000);
    assert!((20..=202).contains(&periods), "{periods}");
}

/// The census ends at its budget, whatever the number of threads, and says so.
#[test]
fn a_census_ends_at_its_budget_of_steps() {
    let map = Counted {
        map: System(Logistic(3.9)),
        cost: 0,
    };
    let options = CensusOptions {
        max_steps: 400_000,
        classify: ClassifyOptions {
            max_steps: 10_000,
            ..ClassifyOptions::default()
        },
        ..CensusOptions::default()
    };
    let taken = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let census = || census_of(&map, &drawn(0.1, 0.9), &options, &Control::default());
        pool.build().unwrap().install(census)
    };
    let found = taken(1);
    assert_eq!(found.end, CensusEnd::MaxSteps);
    let starts = found.outcomes_by_start.len();
    assert!((32..80).contains(&starts), "{starts}");
    assert_eq!(found.undecided.len(), starts);
    assert!(found.undecided[0].1.to_string().contains("10000 steps"));
    assert_eq!(taken(3).outcomes_by_start, found.outcomes_by_start);
}

/// x ↦ r x − x³, whose coarse map fails beyond 0.8.
#[derive(Clone)]
struct FailsBeyond {
    map: System<Cubic>,
    is_coarse: bool,
}

impl nanotap_dynamics::Scheduling for FailsBeyond {
    fn coarse(&self) -> Option<Self> {
        (!self.is_coarse).then(|| Self {
            is_coarse: true,
            ..self.clone()
        })
    }
}

impl StroboscopicMap for FailsBeyond {
    type Error = std::io::Error;

    fn dimension(&self) -> usize {
        1
    }

    fn period(&self) -> f64 {
        1.0
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), Self::Error> {
        if self.is_coarse && state[0].abs() > 0.8 {
            return Err(std::io::Error::other("too far"));
        }
        let Ok(()) = self.map.advance(state);
        Ok(())
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), Self::Error> {
        let Ok(()) = self.map.advance_with_jacobian(state, jacobian);
        Ok(())
    }
}

/// The fixed points are at ±√0.3 = ±0.548.
#[test]
fn a_start_on_which_the_coarse_map_fails_is_followed_on_the_map_itself() {
    let map = FailsBeyond {
        map: System(Cubic(1.3)),
        is_coarse: false,
    };
    let starts = StartSet::given(
        (0..40)
            .map(|k| vec![0.05 * f64::from(k - 20) + 0.025])
            .collect(),
    );
    let found = census_of(
        &map,
        &starts,
        &CensusOptions::default(),
        &Control::default(),
    );
    assert!(found.followed_coarsely);
    assert!(found.undecided.is_empty(), "{:?}", found.undecided);
    let counts: Vec<usize> = found.attractors.iter().map(|a| a.fraction.count).collect();
    assert_eq!(counts, [20, 20]);
}
