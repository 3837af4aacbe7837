//! Motions that lose the memory of their past: chaos with a hole, through which motions come to one
//! known state.

use std::convert::Infallible;
use std::sync::Arc;

use nanotap_dynamics::{
    AfterReset, AttractorKind, CensusOptions, ClassifyOptions, Control, DMatrix, MotionKind,
    PeriodicOrbit, Scheduling, StroboscopicMap, UndecidedReason, census, classify,
};

/// x → 4x (1 − x), with a reset to x = 2 from a hole around 1/2; 2 stays where it is, or goes on to
/// `after`.
#[derive(Clone)]
struct Holed {
    /// Width of the hole.
    width: f64,
    /// Where a motion goes from 2.
    after: f64,
    outcome: Arc<AfterReset>,
    resets: u64,
}

/// The density of x → 4x (1 − x) is 1/(π √(x (1 − x))), 2/π at 1/2: a motion comes to the hole once in
/// so many periods.
const LIFETIME: f64 = 4000.0;

impl Holed {
    fn new(after: f64, outcome: AfterReset) -> Self {
        Self {
            width: std::f64::consts::FRAC_PI_2 / LIFETIME,
            after,
            outcome: Arc::new(outcome),
            resets: 0,
        }
    }

    /// The motion that is reset rests at 2.
    fn at_rest() -> Self {
        let orbit = PeriodicOrbit::superstable(vec![vec![2.0]], 0.0, 1e-15);
        Self::new(2.0, AfterReset::Closes(orbit))
    }

    /// It goes on from 0.3 in an unknown way.
    fn open() -> Self {
        let outcome = AfterReset::Open {
            state: vec![0.3],
            is_reset_again: "again".into(),
            is_not_reset_again: "once".into(),
        };
        Self::new(0.3, outcome)
    }
}

impl Scheduling for Holed {}

impl StroboscopicMap for Holed {
    type Error = Infallible;

    fn dimension(&self) -> usize {
        1
    }

    fn period(&self) -> f64 {
        1.0
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
        let mut jacobian = DMatrix::zeros(1, 1);
        self.advance_with_jacobian(state, &mut jacobian)
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), Infallible> {
        let x = state[0];
        jacobian[(0, 0)] = 0.0;
        if x == 2.0 {
            state[0] = self.after;
        } else if (x - 0.5).abs() < 0.5 * self.width {
            self.resets += 1;
            state[0] = 2.0;
        } else {
            jacobian[(0, 0)] = 4.0 - 8.0 * x;
            state[0] = 4.0 * x * (1.0 - x);
        }
        Ok(())
    }

    fn resets(&self) -> u64 {
        self.resets
    }

    fn after_reset(&self) -> Option<Arc<AfterReset>> {
        Some(Arc::clone(&self.outcome))
    }
}

fn starts(count: u32) -> Vec<Vec<f64>> {
    // Multiples of the golden section.
    let part = |k: u32| (f64::from(k + 1) * 0.618_033_988_749_894_9).fract();
    (0..count).map(|k| vec![part(k)]).collect()
}

/// A reset ends the run, on the orbit that is known to follow.
#[test]
fn a_motion_that_is_reset_is_on_the_known_orbit() {
    let mut chaotic = 0;
    for start in starts(8) {
        let found = classify(&mut Holed::at_rest(), &start, &ClassifyOptions::default());
        match found.kind {
            MotionKind::Periodic(orbit) => assert!(orbit.is_superstable()),
            MotionKind::TransientChaos {
                orbit, spectrum, ..
            } => {
                assert!(orbit.is_superstable());
                // ln 2 a period.
                assert!((spectrum.exponents[0] - 2.0_f64.ln()).abs() < 0.05);
                chaotic += 1;
            }
            // Not reset so far.
            MotionKind::Chaotic(_) => {}
            other => panic!("{other:?}"),
        }
    }
    assert!(chaotic > 0, "some runs are measured before they are reset");
}

/// Where nothing is known of what follows, a motion that is reset is neither chaotic nor anything else.
#[test]
fn a_motion_that_is_reset_is_not_called_chaotic() {
    let mut undecided = 0;
    for start in starts(8) {
        let found = classify(&mut Holed::open(), &start, &ClassifyOptions::default());
        match found.kind {
            MotionKind::Undecided {
                reason: UndecidedReason::Reset(_),
                ..
            } => undecided += 1,
            MotionKind::Chaotic(chaos) => assert!(chaos.observed < found.periods + 1),
            other => panic!("{other:?}"),
        }
    }
    assert!(undecided > 0);
}

/// A reset is an escape, whether or not the motion that follows is known: the lifetime is that of the hole.
#[test]
fn resets_are_escapes_from_transient_chaos() {
    for map in [Holed::at_rest(), Holed::open()] {
        let found = census(
            &map,
            &starts(128),
            &CensusOptions::default(),
            &Control::default(),
        );
        let is_chaos =
            |a: &nanotap_dynamics::Attractor| matches!(a.kind, AttractorKind::Chaotic { .. });
        assert!(!found.attractors.iter().any(is_chaos));
        let transient = found.transient_chaos.unwrap();
        let lifetime = transient.lifetime;
        assert!(lifetime.escapes > 15, "{lifetime:?}");
        // Within six standard errors.
        let allowed = 6.0 / (lifetime.escapes as f64).sqrt();
        assert!(
            (lifetime.mean / LIFETIME).ln().abs() < allowed,
            "{lifetime:?}"
        );
    }
}
