//! The motions that a census has found, and their counterparts on the map itself where starts are
//! followed on a coarse map.
//!
//! Starts may be followed on a [coarse](Scheduling::coarse) map. Each motion that they reach is
//! then confirmed once: Newton's method closes its orbit on the map itself, from the coarse orbit's
//! points. Where that fails, and for chaos and tori, the motion is classified on the map itself
//! from a state that the coarse run reached. All starts that reach the same motion share the
//! result.

use crate::census::Outcome;
use crate::classify::{
    Chaos, Classified, ClassifyOptions, KnownMotions, MotionKind, ResetRun, Torus, UndecidedReason,
    classify_on, classify_reset, close_exactly,
};
use crate::control::CancelFlag;
use crate::lyapunov::{LyapunovOptions, LyapunovSpectrum};
use crate::map::StroboscopicMap;
use crate::orbit::search::merge;
use crate::orbit::{PeriodicOrbit, Stability, close_orbit};

/// Largest number of runs on the map itself from states that coarse runs reached.
const MAX_EXACT_RUNS: usize = 8;
/// Largest number of states from which a motion that does not close is classified on the map
/// itself, until one of them gives its kind.
const MAX_TRIES: usize = 4;
/// Largest number of starts that are followed on the map itself because the coarse map fails on
/// them.
const MAX_RETRIES: usize = 64;
/// Largest number of these on which the map itself fails too.
const MAX_FAILED_RETRIES: usize = 4;
/// Budget of all runs on the map itself that confirm motions, as a multiple of the steps of one
/// start: each run serves all starts that reach the motion.
const EXACT_RUN_STEPS: u64 = 4;
/// Largest number of periods over which exponents are measured on the map itself.
const MAX_EXACT_PERIODS: usize = 4000;

pub(super) struct Motions<'a, M> {
    /// The map whose motions are reported.
    exact: M,
    /// Cost of the exact map before the census.
    first_cost: u64,
    /// The map on which starts are followed: the exact one, or its coarse one.
    pub(super) followed: M,
    pub(super) is_coarse: bool,
    /// Budgets of runs on the exact map.
    options: &'a ClassifyOptions,
    /// The same with fewer periods for exponents, for a motion that a coarse run has reached.
    budgets: ClassifyOptions,
    cancel: Option<&'a CancelFlag>,
    /// Stable orbits of the exact map, each once.
    pub(super) orbits: Vec<PeriodicOrbit>,
    /// Unstable orbits of the exact map that Newton's method closed from seeds.
    pub(super) unstable: Vec<PeriodicOrbit>,
    /// Stable orbits of the followed map, each with the outcome of the starts that reach it.
    pub(super) followed_orbits: Vec<(PeriodicOrbit, Outcome)>,
    /// Number of orbits of the exact map that were searched for on the followed one.
    paired: usize,
    exact_runs: usize,
    /// Steps of integration that these runs have taken.
    exact_steps: u64,
    /// Number of starts that were followed on the exact map because the coarse map failed.
    retries: usize,
    failed_retries: usize,
    /// Spectra of chaotic motions and tori of the followed map, each once.
    pub(super) spectra: Vec<LyapunovSpectrum>,
    /// Kind of each of these motions on the exact map, in the same order.
    irregular: Vec<Irregular>,
    /// The outcome of starts that are reset, once one was; periods count from the reset.
    after_reset: Option<Outcome>,
    /// Whether a start escaped from chaos.
    pub(super) has_transient_chaos: bool,
    /// Spectrum of the transient chaos on the exact map.
    pub(super) transient_spectrum: Option<LyapunovSpectrum>,
}

/// A motion that does not close: its kind on the exact map, once a run from one of its states has
/// shown it.
#[derive(Default)]
struct Irregular {
    tries: usize,
    kind: Option<IrregularKind>,
}

#[derive(Clone)]
enum IrregularKind {
    Chaos(Chaos),
    Torus(Torus),
}

impl IrregularKind {
    const fn spectrum(&self) -> &LyapunovSpectrum {
        match self {
            Self::Chaos(chaos) => &chaos.spectrum,
            Self::Torus(torus) => &torus.spectrum,
        }
    }

    /// The outcome of a start that is on this motion at `state`.
    fn outcome(self, state: Vec<f64>) -> Outcome {
        match self {
            Self::Chaos(chaos) => Outcome::Chaos(chaos, state),
            Self::Torus(torus) => Outcome::Torus(torus, state),
        }
    }
}

impl<'a, M: StroboscopicMap> Motions<'a, M> {
    pub(super) fn new(
        map: &M,
        coarse: Option<M>,
        options: &'a ClassifyOptions,
        cancel: Option<&'a CancelFlag>,
    ) -> Self {
        let longest = options.lyapunov.max_periods.min(MAX_EXACT_PERIODS);
        let budgets = ClassifyOptions {
            lyapunov: LyapunovOptions {
                min_periods: options.lyapunov.min_periods.min(longest),
                max_periods: longest,
                ..options.lyapunov.clone()
            },
            ..options.clone()
        };
        Self {
            budgets,
            exact: map.clone(),
            first_cost: map.cost(),
            is_coarse: coarse.is_some(),
            followed: coarse.unwrap_or_else(|| map.clone()),
            options,
            cancel,
            orbits: Vec::new(),
            unstable: Vec::new(),
            followed_orbits: Vec::new(),
            paired: 0,
            exact_runs: 0,
            exact_steps: 0,
            retries: 0,
            failed_retries: 0,
            spectra: Vec::new(),
            irregular: Vec::new(),
            after_reset: None,
            has_transient_chaos: false,
            transient_spectrum: None,
        }
    }

    /// Cost of closing and classifying orbits on the exact map, without the runs that confirm
    /// motions, which have a separate budget.
    pub(super) fn cost(&self) -> u64 {
        self.exact.cost() - self.first_cost - self.exact_steps
    }

    /// Number of motions found so far: orbits, chaotic motions and tori.
    pub(super) fn count(&self) -> usize {
        self.orbits.len() + self.spectra.len()
    }

    /// Closes orbits of known periods near known states.
    pub(super) fn close_seeds(&mut self, seeds: &[(usize, Vec<f64>)]) {
        for (period, state) in seeds {
            let closed = close_orbit(&mut self.exact, state, *period, &self.options.shooting);
            let Ok(orbit) = closed else { continue };
            let known = if orbit.known_stability() == Stability::Stable {
                &mut self.orbits
            } else {
                &mut self.unstable
            };
            merge(known, orbit);
        }
        self.pair_orbits();
    }

    /// The outcome of a start that was followed to its end; where the coarse map failed or left every
    /// bound, the start is followed again on the exact map: only that one says that a motion is
    /// unbounded.
    pub(super) fn outcome(&mut self, mut found: Classified, start: &[f64]) -> Outcome {
        let mut is_exact = !self.is_coarse;
        let is_unbounded = matches!(found.kind, MotionKind::Unbounded);
        let may_retry = self.retries < MAX_RETRIES && self.failed_retries < MAX_FAILED_RETRIES;
        let retries = is_unbounded || is_map_failure(&found.kind) && may_retry;
        if !is_exact && retries {
            self.retries += usize::from(!is_unbounded);
            let exact = self.classify_exactly(start, 0, self.options.max_steps);
            self.failed_retries += usize::from(is_map_failure(&exact.kind));
            for orbit in std::mem::replace(&mut found, exact).met {
                self.follow_orbit(orbit);
            }
            is_exact = true;
        }
        let outcome = self.outcome_on(found, is_exact);
        self.pair_orbits();
        outcome
    }

    /// The outcome of a start that was reset: that of the motion that follows every reset, which is
    /// classified once.
    pub(super) fn reset_outcome(&mut self, reset: ResetRun) -> Outcome {
        let ResetRun {
            periods,
            chaos,
            met,
        } = reset;
        if let Some(spectrum) = chaos {
            self.has_transient_chaos = true;
            self.transient_spectrum.get_or_insert(spectrum);
        }
        for orbit in met {
            self.orbit_outcome(orbit, 0, true);
        }
        let known = self.after_reset.clone();
        let mut outcome = known.unwrap_or_else(|| {
            let known = KnownMotions {
                cancel: self.cancel,
                ..KnownMotions::default()
            };
            let found = classify_reset(&mut self.exact, known, self.options);
            let (after, is_cancelled) = (
                found.periods,
                self.cancel.is_some_and(CancelFlag::is_cancelled),
            );
            let outcome = match self.outcome_on(found, true) {
                Outcome::Undecided(reason) => Outcome::Reset {
                    reason,
                    periods: after,
                },
                other => other,
            };
            if !is_cancelled {
                self.after_reset = Some(outcome.clone());
            }
            outcome
        });
        self.pair_orbits();
        match &mut outcome {
            // The chaos before a reset ends with it, whatever follows.
            Outcome::Orbit { periods: own, .. } | Outcome::Reset { periods: own, .. } => {
                *own = periods;
            }
            _ => {}
        }
        outcome
    }

    /// The outcome of a start that reached a motion of the exact map, or of the coarse one.
    fn outcome_on(&mut self, found: Classified, is_exact: bool) -> Outcome {
        let Classified {
            kind,
            periods,
            state,
            met,
        } = found;
        let outcome = match kind {
            MotionKind::Periodic(orbit) => self.orbit_outcome(orbit, periods, is_exact),
            MotionKind::TransientChaos {
                orbit, spectrum, ..
            } => {
                self.has_transient_chaos = true;
                if is_exact {
                    self.transient_spectrum.get_or_insert(spectrum);
                }
                self.orbit_outcome(orbit, periods, is_exact)
            }
            MotionKind::QuasiPeriodic(torus) => {
                self.irregular_outcome(IrregularKind::Torus(torus), state, periods, is_exact)
            }
            MotionKind::Chaotic(chaos) => {
                self.irregular_outcome(IrregularKind::Chaos(chaos), state, periods, is_exact)
            }
            MotionKind::Unbounded => Outcome::Unbounded,
            MotionKind::Undecided { reason, .. } => Outcome::Undecided(reason),
        };
        for orbit in met {
            self.orbit_outcome(orbit, 0, is_exact);
        }
        outcome
    }

    /// The outcome of a start that reached a stable orbit.
    fn orbit_outcome(&mut self, orbit: PeriodicOrbit, periods: usize, is_exact: bool) -> Outcome {
        if is_exact {
            let index = merge(&mut self.orbits, orbit);
            return Outcome::Orbit { index, periods };
        }
        let index = self.follow_orbit(orbit);
        self.arrival(index, periods)
    }

    /// The outcome of a start that reached orbit number `index` of the followed map.
    pub(super) fn arrival(&self, index: usize, periods: usize) -> Outcome {
        match &self.followed_orbits[index].1 {
            Outcome::Orbit { index, .. } => Outcome::Orbit {
                index: *index,
                periods,
            },
            other => other.clone(),
        }
    }

    /// Classifies the motion from `state` on the exact map, as the end of a start that has run for
    /// `periods` periods.
    fn classify_exactly(&mut self, state: &[f64], periods: usize, max_steps: u64) -> Classified {
        let chaos: Vec<_> = self
            .irregular
            .iter()
            .filter_map(|known| match &known.kind {
                Some(IrregularKind::Chaos(chaos)) => Some(chaos.spectrum.clone()),
                _ => None,
            })
            .collect();
        let known = KnownMotions {
            chaos: &chaos,
            cancel: self.cancel,
            ..KnownMotions::default()
        };
        let budgets = ClassifyOptions {
            max_steps,
            ..self.budgets.clone()
        };
        let mut found = classify_on(&mut self.exact, state, known, &budgets);
        found.periods += periods;
        if let MotionKind::Chaotic(chaos) = &mut found.kind {
            chaos.watched(found.periods);
        }
        found
    }

    /// Classifies as [`classify_exactly`](Self::classify_exactly) a motion that starts have
    /// reached; `None` if the budget of these runs is spent.
    fn confirm(&mut self, state: &[f64], periods: usize) -> Option<Classified> {
        let budget = self.options.max_steps.saturating_mul(EXACT_RUN_STEPS);
        if self.exact_runs >= MAX_EXACT_RUNS || self.exact_steps >= budget {
            return None;
        }
        self.exact_runs += 1;
        let before = self.exact.cost();
        let found = self.classify_exactly(state, periods, budget - self.exact_steps);
        self.exact_steps += self.exact.cost() - before;
        Some(found)
    }

    /// Index of an orbit of the coarse map, confirmed on the map itself if it is new.
    fn follow_orbit(&mut self, orbit: PeriodicOrbit) -> usize {
        let mut known = self.followed_orbits.iter();
        if let Some(index) = known.position(|(known, _)| known.is_same_as(&orbit)) {
            return index;
        }
        let outcome = if let Some(exact) = close_exactly(&mut self.exact, &orbit, self.options) {
            let index = merge(&mut self.orbits, exact);
            if let Some(known) = self.followed_index(index) {
                return known;
            }
            Outcome::Orbit { index, periods: 0 }
        } else if let Some(found) = self.confirm(&orbit.states[0], 0) {
            self.outcome_on(found, true)
        } else {
            Outcome::Undecided(UndecidedReason::NotConfirmed)
        };
        self.followed_orbits.push((orbit.canonical(), outcome));
        self.followed_orbits.len() - 1
    }

    /// Index of the followed orbit that corresponds to an orbit of the exact map.
    fn followed_index(&self, orbit: usize) -> Option<usize> {
        let mut known = self.followed_orbits.iter();
        known.position(
            |(_, outcome)| matches!(outcome, Outcome::Orbit { index, .. } if *index == orbit),
        )
    }

    /// Closes on the followed map the orbits of the exact map that have no counterpart there yet.
    fn pair_orbits(&mut self) {
        for index in self.paired..self.orbits.len() {
            if self.followed_index(index).is_some() {
                continue;
            }
            let orbit = &self.orbits[index];
            let followed = if self.is_coarse {
                let options = self.options.on_coarse_map();
                close_exactly(&mut self.followed, orbit, &options)
            } else {
                Some(orbit.clone())
            };
            if let Some(followed) = followed {
                let outcome = Outcome::Orbit { index, periods: 0 };
                self.followed_orbits.push((followed, outcome));
            }
        }
        self.paired = self.orbits.len();
    }

    /// Index of a spectrum in `spectra`, to which it is added if it is new.
    fn spectrum_index(&mut self, spectrum: &LyapunovSpectrum) -> usize {
        let known = self.spectra.iter().position(|k| k.agrees_with(spectrum));
        known.unwrap_or_else(|| {
            self.spectra.push(spectrum.clone());
            self.irregular.push(Irregular::default());
            self.spectra.len() - 1
        })
    }

    /// The outcome of a start whose motion does not close.
    fn irregular_outcome(
        &mut self,
        found: IrregularKind,
        state: Vec<f64>,
        periods: usize,
        is_exact: bool,
    ) -> Outcome {
        let known = self.spectrum_index(found.spectrum());
        if is_exact {
            self.irregular[known]
                .kind
                .get_or_insert_with(|| found.clone());
            return found.outcome(state);
        }
        let may_try =
            self.irregular[known].kind.is_none() && self.irregular[known].tries < MAX_TRIES;
        if may_try && let Some(found) = self.confirm(&state, periods) {
            self.irregular[known].tries += 1;
            self.irregular[known].kind = match &found.kind {
                MotionKind::Chaotic(chaos) => Some(IrregularKind::Chaos(chaos.clone())),
                MotionKind::TransientChaos { spectrum, .. } => {
                    let chaos = Chaos::of(spectrum.clone(), periods, self.options);
                    Some(IrregularKind::Chaos(chaos))
                }
                MotionKind::QuasiPeriodic(torus) => Some(IrregularKind::Torus(torus.clone())),
                _ => None,
            };
            return self.outcome_on(found, true);
        }
        match &self.irregular[known].kind {
            Some(IrregularKind::Chaos(chaos)) => {
                let chaos = Chaos::of(chaos.spectrum.clone(), periods, self.options);
                Outcome::Chaos(chaos, state)
            }
            Some(torus) => torus.clone().outcome(state),
            None => Outcome::Undecided(UndecidedReason::NotConfirmed),
        }
    }
}

/// Whether a motion is undecided because its map failed.
const fn is_map_failure(kind: &MotionKind) -> bool {
    matches!(
        kind,
        MotionKind::Undecided {
            reason: UndecidedReason::Map { .. },
            ..
        }
    )
}
