//! The motions that a census has found, and what those of a coarse map are on the map itself.
//!
//! Starts may be followed on a [coarse](StroboscopicMap::coarse) map. Each motion that they come to is
//! then confirmed once: Newton closes its orbit on the map itself, from the coarse orbit's points;
//! where that fails, and of chaos and tori, the motion is classified on the map itself from a state
//! that the coarse one came to. All starts that come to the same motion share the result.

use crate::census::Outcome;
use crate::classify::{
    Chaos, Classified, ClassifyOptions, Known, MotionKind, Torus, UndecidedReason, classify_on,
    close_exactly,
};
use crate::control::CancelFlag;
use crate::lyapunov::{LyapunovOptions, LyapunovSpectrum};
use crate::map::StroboscopicMap;
use crate::orbit::search::merge;
use crate::orbit::{PeriodicOrbit, close_orbit};

/// Runs on the map itself from states that coarse runs came to, at most.
const MAX_EXACT_RUNS: usize = 8;
/// States of a motion that does not close from which it is classified exactly, until one shows what
/// it is.
const MAX_TRIES: usize = 4;
/// Starts on which the coarse map fails that are followed on the map itself, at most.
const MAX_RETRIES: usize = 64;
/// The same where that fails too.
const MAX_FAILED_RETRIES: usize = 4;
/// Periods for which exponents are measured on the map itself at most.
const MAX_EXACT_PERIODS: usize = 4000;

pub(super) struct Motions<'a, M> {
    /// The map itself.
    exact: M,
    /// Its cost at first.
    first_cost: u64,
    /// The map that starts are followed on: the same, or its coarse one.
    pub(super) followed: M,
    pub(super) is_coarse: bool,
    /// Budgets on the map itself.
    options: &'a ClassifyOptions,
    /// The same for a motion that a coarse one has come to.
    budgets: ClassifyOptions,
    cancel: Option<&'a CancelFlag>,
    /// Stable orbits of the map itself, each once.
    pub(super) orbits: Vec<PeriodicOrbit>,
    /// Unstable orbits of it to which seeds led.
    pub(super) unstable: Vec<PeriodicOrbit>,
    /// Stable orbits of the followed map, and what the starts that come to each have come to.
    pub(super) followed_orbits: Vec<(PeriodicOrbit, Outcome)>,
    /// Orbits of the map itself that were looked for on the followed one.
    paired: usize,
    exact_runs: usize,
    /// Starts on which the coarse map failed that were followed on the map itself.
    retries: usize,
    failed_retries: usize,
    /// Spectra of chaotic motions and tori of the followed map, one of each.
    pub(super) spectra: Vec<LyapunovSpectrum>,
    /// What each of these is.
    irregular: Vec<Irregular>,
    /// Spectrum of chaos from which a start escaped.
    pub(super) transient_spectrum: Option<LyapunovSpectrum>,
}

/// What a motion that does not close is on the map itself, once a state of it has shown that.
#[derive(Default)]
struct Irregular {
    tries: usize,
    kind: Option<IrregularKind>,
}

enum IrregularKind {
    Chaos(LyapunovSpectrum),
    Torus(Torus),
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
            retries: 0,
            failed_retries: 0,
            spectra: Vec::new(),
            irregular: Vec::new(),
            transient_spectrum: None,
        }
    }

    /// Cost of what was closed and classified on the map itself.
    pub(super) fn cost(&self) -> u64 {
        self.exact.cost() - self.first_cost
    }

    /// Motions found so far.
    pub(super) fn count(&self) -> usize {
        self.orbits.len() + self.spectra.len()
    }

    /// Closes orbits of known periods near known states.
    pub(super) fn close_seeds(&mut self, seeds: &[(usize, Vec<f64>)]) {
        for (period, state) in seeds {
            let closed = close_orbit(&mut self.exact, state, *period, &self.options.shooting);
            let Ok(orbit) = closed else { continue };
            let known = if orbit.is_stable() {
                &mut self.orbits
            } else {
                &mut self.unstable
            };
            merge(known, orbit);
        }
        self.pair_orbits();
    }

    /// What a start came to that was followed to its end: on the map itself, where the coarse one
    /// failed.
    pub(super) fn outcome(&mut self, mut found: Classified, start: &[f64]) -> Outcome {
        let retries = self.retries < MAX_RETRIES && self.failed_retries < MAX_FAILED_RETRIES;
        if self.is_coarse && is_map_failure(&found.kind) && retries {
            self.retries += 1;
            let exact = self.classify_exactly(start, 0);
            if is_map_failure(&exact.kind) {
                self.failed_retries += 1;
            } else {
                found.met.into_iter().for_each(|orbit| {
                    self.follow_orbit(orbit);
                });
                let outcome = self.exact_outcome(exact);
                self.pair_orbits();
                return outcome;
            }
            found.kind = exact.kind;
        }
        if !self.is_coarse {
            let outcome = self.exact_outcome(found);
            self.pair_orbits();
            return outcome;
        }
        let Classified {
            kind,
            periods,
            state,
            met,
        } = found;
        let outcome = match kind {
            MotionKind::Periodic(orbit) => {
                let index = self.follow_orbit(orbit);
                self.arrival(index, periods)
            }
            MotionKind::TransientChaos {
                orbit, spectrum, ..
            } => {
                self.transient_spectrum.get_or_insert(spectrum);
                let index = self.follow_orbit(orbit);
                self.arrival(index, periods)
            }
            MotionKind::QuasiPeriodic(torus) => {
                self.irregular_outcome(&torus.spectrum, state, periods)
            }
            MotionKind::Chaotic(chaos) => self.irregular_outcome(&chaos.spectrum, state, periods),
            MotionKind::Unbounded => Outcome::Unbounded,
            MotionKind::Undecided { reason, .. } => Outcome::Undecided(reason),
        };
        for orbit in met {
            self.follow_orbit(orbit);
        }
        self.pair_orbits();
        outcome
    }

    /// What a start has come to that arrived at an orbit of the followed map.
    pub(super) fn arrival(&self, index: usize, periods: usize) -> Outcome {
        match &self.followed_orbits[index].1 {
            Outcome::Orbit { index, .. } => Outcome::Orbit {
                index: *index,
                periods,
            },
            other => other.clone(),
        }
    }

    /// What a motion of the map itself is to the census.
    fn exact_outcome(&mut self, found: Classified) -> Outcome {
        let Classified {
            kind,
            periods,
            state,
            met,
        } = found;
        let outcome = match kind {
            MotionKind::Periodic(orbit) => Outcome::Orbit {
                index: merge(&mut self.orbits, orbit),
                periods,
            },
            MotionKind::TransientChaos {
                orbit, spectrum, ..
            } => {
                self.transient_spectrum.get_or_insert(spectrum);
                Outcome::Orbit {
                    index: merge(&mut self.orbits, orbit),
                    periods,
                }
            }
            MotionKind::QuasiPeriodic(torus) => {
                let known = self.spectrum_index(&torus.spectrum);
                self.irregular[known]
                    .kind
                    .get_or_insert_with(|| IrregularKind::Torus(torus.clone()));
                Outcome::Torus(torus, state)
            }
            MotionKind::Chaotic(chaos) => {
                let known = self.spectrum_index(&chaos.spectrum);
                self.irregular[known]
                    .kind
                    .get_or_insert_with(|| IrregularKind::Chaos(chaos.spectrum.clone()));
                Outcome::Chaos(chaos, state)
            }
            MotionKind::Unbounded => Outcome::Unbounded,
            MotionKind::Undecided { reason, .. } => Outcome::Undecided(reason),
        };
        for orbit in met {
            merge(&mut self.orbits, orbit);
        }
        outcome
    }

    /// Classifies the motion from a state on the map itself, as the end of a start that has run for
    /// so many periods.
    fn classify_exactly(&mut self, state: &[f64], periods: usize) -> Classified {
        let chaos: Vec<_> = self
            .irregular
            .iter()
            .filter_map(|known| match &known.kind {
                Some(IrregularKind::Chaos(spectrum)) => Some(spectrum.clone()),
                _ => None,
            })
            .collect();
        let known = Known {
            chaos: &chaos,
            cancel: self.cancel,
            ..Known::default()
        };
        let mut found = classify_on(&mut self.exact, state, known, &self.budgets);
        found.periods += periods;
        if let MotionKind::Chaotic(chaos) = &mut found.kind {
            chaos.watched(found.periods);
        }
        found
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
        } else if self.exact_runs < MAX_EXACT_RUNS {
            self.exact_runs += 1;
            let found = self.classify_exactly(&orbit.states[0], 0);
            self.exact_outcome(found)
        } else {
            Outcome::Undecided(UndecidedReason::NotConfirmed)
        };
        self.followed_orbits.push((orbit.canonical(), outcome));
        self.followed_orbits.len() - 1
    }

    /// Index of the followed orbit that stands for an orbit of the map itself.
    fn followed_index(&self, orbit: usize) -> Option<usize> {
        let mut known = self.followed_orbits.iter();
        known.position(
            |(_, outcome)| matches!(outcome, Outcome::Orbit { index, .. } if *index == orbit),
        )
    }

    /// Finds the orbits of the map itself on the followed one, where they are not known yet.
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

    /// Index of a spectrum among those known, after adding it if it is new.
    fn spectrum_index(&mut self, spectrum: &LyapunovSpectrum) -> usize {
        let known = self.spectra.iter().position(|k| k.agrees_with(spectrum));
        known.unwrap_or_else(|| {
            self.spectra.push(spectrum.clone());
            self.irregular.push(Irregular::default());
            self.spectra.len() - 1
        })
    }

    /// What a start has come to whose motion on the coarse map does not close.
    fn irregular_outcome(
        &mut self,
        spectrum: &LyapunovSpectrum,
        state: Vec<f64>,
        periods: usize,
    ) -> Outcome {
        let known = self.spectrum_index(spectrum);
        let may_try = self.irregular[known].tries < MAX_TRIES && self.exact_runs < MAX_EXACT_RUNS;
        if self.irregular[known].kind.is_none() && may_try {
            self.irregular[known].tries += 1;
            self.exact_runs += 1;
            let found = self.classify_exactly(&state, periods);
            self.irregular[known].kind = match &found.kind {
                MotionKind::Chaotic(Chaos { spectrum, .. })
                | MotionKind::TransientChaos { spectrum, .. } => {
                    Some(IrregularKind::Chaos(spectrum.clone()))
                }
                MotionKind::QuasiPeriodic(torus) => Some(IrregularKind::Torus(torus.clone())),
                _ => None,
            };
            return self.exact_outcome(found);
        }
        match &self.irregular[known].kind {
            Some(IrregularKind::Chaos(spectrum)) => {
                let chaos = Chaos::of(spectrum.clone(), periods, self.options);
                Outcome::Chaos(chaos, state)
            }
            Some(IrregularKind::Torus(torus)) => Outcome::Torus(torus.clone(), state),
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
