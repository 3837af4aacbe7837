//! Which attractors there are, and what part of a set of starts goes to each.
//!
//! 1. Pilot starts are classified one by one ([`mod@crate::classify`]); orbits that are
//!    the same up to a cyclic shift, within their own error estimates, are merged.
//! 2. Around each stable orbit a contracting neighbourhood is found
//!    ([`crate::neighbourhood`]). A neighbourhood that a start with another
//!    destination enters is discarded.
//! 3. The other starts follow in batches (`batch.rs`). Each is run until it enters a neighbourhood,
//!    or is classified like a pilot; what a batch finds is known to the next. A start on
//!    chaos that is known is recognised, without exponents of its own, by parting from a
//!    neighbour and by the means of its strobe states and their squares.
//! 4. Starts that can be drawn without end ([`StartSet`]) go on until the share of
//!    them that may lead to motions not yet found is bounded ([`Unseen`]) as the
//!    options ask, or the budget is spent. Stable orbits that Newton closed on the way
//!    are attractors too, with a fraction of zero if no start goes there.
//! 5. Motions that do not close are merged when their exponents and the means of their
//!    strobe states and their squares agree within six standard errors.
//! 6. Chaos is claimed as an attractor only if no run escaped from it, with the mean
//!    lifetime that this bounds from below. If runs that outlived every linear
//!    transient escaped while others are still on it, it is transient chaos, with its
//!    lifetime and where the escaped ones went.
//!
//! What happens to a start depends on the map, the starts before it and itself alone,
//! so the result is the same for any number of threads and any order of work.
//!
//! Fails: attractors whose basins are a smaller part of the set of starts than
//! [`Census::unseen`] says are missed; two different chaotic attractors with equal
//! means and mean squares would be merged; an attractor and a chaotic transient beside it
//! are told apart only by the hazard of escape falling with time, as documented at
//! [`Census::transient_chaos`].

mod assemble;
mod batch;
mod confidence;
mod escapes;
mod start_box;
mod start_set;
mod unseen;

use std::sync::atomic::AtomicUsize;

use rayon::prelude::*;

use crate::census::batch::Batch;
use crate::census::escapes::Escapes;
use crate::classify::{
    Chaos, Classified, ClassifyOptions, Known, MotionKind, RECOGNISABLE, RunEnd, Torus,
    UndecidedReason, first_entry, watch,
};
use crate::control::Control;
use crate::lyapunov::LyapunovSpectrum;
use crate::map::StroboscopicMap;
use crate::neighbourhood::Neighbourhood;
use crate::orbit::PeriodicOrbit;
use crate::orbit::search::merge;

pub use confidence::{Fraction, Lifetime};
pub use start_box::{StartBox, StartBoxError};
pub use start_set::{StartOrigin, StartSet};
pub use unseen::Unseen;

/// Pilots that are followed before anything is known at all.
const FIRST_PILOTS: usize = 4;
/// Starts of the first batch after the pilots, of which all others are multiples.
const BATCH: usize = 128;
/// Starts that a thread draws at once, each in a microsecond or two.
const DRAWN_AT_ONCE: usize = 16;
/// Periods for which a start that enters no neighbourhood is left to itself at least,
/// once attractors are known.
const LEAST_PATIENCE: usize = 64;
/// Chaos is watched for so many times the periods after which escapes are counted.
const WATCHED_TRANSIENTS: f64 = 8.0;

/// How a census is taken.
#[derive(Clone, Debug, PartialEq)]
pub struct CensusOptions {
    /// Starts that are classified without knowledge of any orbit's neighbourhood.
    pub pilots: usize,
    /// Budgets of each start.
    pub classify: ClassifyOptions,
    /// Drawn starts go on until the share that may lead to motions not yet found is
    /// below this with 95 % confidence.
    pub unseen: f64,
    /// Drawn starts at most, whatever that bound is then.
    pub max_starts: usize,
    /// Periods of all starts together after which no further batch is begun.
    pub max_periods: usize,
}

impl Default for CensusOptions {
    fn default() -> Self {
        Self {
            pilots: 32,
            classify: ClassifyOptions::default(),
            unseen: 0.002,
            max_starts: 5000,
            max_periods: 2_000_000,
        }
    }
}

/// What a census found.
#[derive(Clone, Debug)]
pub struct Census {
    /// Attractors, most frequent first.
    pub attractors: Vec<Attractor>,
    /// Chaos from which some starts escaped while it was watched.
    ///
    /// Counted are starts that are in no attractor's neighbourhood after three times
    /// the slowest linear decay from the box (64 periods at least). If some of them
    /// escape and others have not yet, the others are on transient chaos, unless all
    /// escapes fell in the first quarter of the time watched and that would happen
    /// with probability below 1 % at a constant rate: then there is an attractor,
    /// with a chaotic transient beside it.
    pub transient_chaos: Option<TransientChaos>,
    /// Starts that left every bound.
    pub unbounded: Fraction,
    /// Starts left undecided, by index.
    pub undecided: Vec<(usize, UndecidedReason)>,
    /// What happened to each start.
    pub outcomes_by_start: Vec<StartOutcome>,
    /// What the fractions are of: all starts of a set of given ones, the drawn starts
    /// of one that is drawn.
    pub counted: usize,
    /// The same counts for every size of the set of starts; empty if none was drawn.
    pub by_size: Vec<SizeCount>,
    /// How much of the set of starts may lead to motions not found; `None` if no start
    /// was drawn.
    pub unseen: Option<Unseen>,
    /// True if the work was stopped before all starts were done.
    pub cancelled: bool,
}

/// What happened to the starts of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct SizeCount {
    /// Its scale, 1 for the largest box.
    pub scale: f64,
    /// Starts of this size.
    pub starts: usize,
    /// Part that goes to each attractor, in the order of [`Census::attractors`].
    pub attractors: Vec<Fraction>,
    /// Part that left every bound.
    pub unbounded: Fraction,
    /// Part left undecided, or on transient chaos.
    pub undecided: Fraction,
}

/// One attractor.
#[derive(Clone, Debug)]
pub struct Attractor {
    /// What it is.
    pub kind: AttractorKind,
    /// What part of the starts goes there.
    pub fraction: Fraction,
    /// Index of the first start that does; `None` if none does and Newton found it.
    pub first_start: Option<usize>,
    /// A state on the attractor.
    pub state: Vec<f64>,
}

/// What an attractor is, with the evidence.
#[derive(Clone, Debug)]
pub enum AttractorKind {
    /// A stable periodic orbit.
    Periodic(PeriodicOrbit),
    /// A torus.
    QuasiPeriodic(Torus),
    /// Chaos, from which none escaped.
    Chaotic {
        /// Exponents, of the first start that found it.
        spectrum: LyapunovSpectrum,
        /// Lower bound on the mean lifetime, over all starts on it.
        lifetime: Lifetime,
    },
}

impl AttractorKind {
    /// Whether both are the same motion: orbits up to a cyclic shift within their error
    /// estimates; chaos and tori by exponents, means and mean squares that agree.
    pub fn is_same_as(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Periodic(a), Self::Periodic(b)) => a.is_same_as(b),
            (Self::QuasiPeriodic(a), Self::QuasiPeriodic(b)) => a.spectrum.agrees_with(&b.spectrum),
            (Self::Chaotic { spectrum: a, .. }, Self::Chaotic { spectrum: b, .. }) => {
                a.agrees_with(b)
            }
            _ => false,
        }
    }
}

/// Chaos that ends.
#[derive(Clone, Debug)]
pub struct TransientChaos {
    /// Exponents while it lasts, of the first start seen on it.
    pub spectrum: LyapunovSpectrum,
    /// Mean lifetime in periods, by maximum likelihood with the wanderers censored.
    pub lifetime: Lifetime,
    /// Starts still on transient chaos at the end.
    pub unescaped: Fraction,
    /// Attractors (by index) that escaped starts went to, with counts.
    pub destinations: Vec<(usize, usize)>,
}

/// What happened to a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartOutcome {
    /// It went to this attractor, and was known to after so many periods.
    Attractor {
        /// Index into [`Census::attractors`].
        index: usize,
        /// Periods run.
        periods: usize,
    },
    /// It was still on the transient chaos after so many periods.
    TransientChaos {
        /// Periods run.
        periods: usize,
    },
    /// It left every bound.
    Unbounded,
    /// Undecided; the reason is in [`Census::undecided`].
    Undecided,
}

/// What one start came to, before attractors are put together.
enum Outcome {
    Orbit { index: usize, periods: usize },
    Torus(Torus, Vec<f64>),
    Chaos(Chaos, Vec<f64>),
    Unbounded,
    Undecided(UndecidedReason),
}

/// Takes the census of all `starts` (each of the map's dimension).
pub fn census<M: StroboscopicMap>(
    map: &M,
    starts: &[Vec<f64>],
    options: &CensusOptions,
    control: &Control<'_>,
) -> Census {
    census_of(map, &StartSet::given(starts.to_vec()), options, control)
}

/// Takes the census of a set of starts.
pub fn census_of<M: StroboscopicMap>(
    map: &M,
    starts: &StartSet,
    options: &CensusOptions,
    control: &Control<'_>,
) -> Census {
    let given = starts.given_count();
    let last = starts
        .len()
        .unwrap_or_else(|| given.saturating_add(options.max_starts));
    let mut work = Work {
        map,
        starts,
        options,
        control,
        done: AtomicUsize::new(0),
        last,
        outcomes: Vec::new(),
        ends: Vec::new(),
        orbits: Vec::new(),
        neighbourhoods: Vec::new(),
        motions: 0,
        chaos: Vec::new(),
        transient_spectrum: None,
        patience: 0,
        periods: 0,
        row: 0,
    };
    // Chaos that the first of the pilots are on need not be measured again by the others.
    let mut pilots = work.follow(options.pilots.clamp(1, FIRST_PILOTS));
    pilots.extend(work.follow(options.pilots.saturating_sub(FIRST_PILOTS)));
    work.know_neighbourhoods(&pilots);
    while work.outcomes.len() < last && !work.is_enough() {
        let classified = work.follow(work.next_batch());
        work.know_neighbourhoods(&classified);
    }
    let mut after = Escapes::after(work.relaxation());
    work.watch_chaos(&mut after);
    assemble::assemble(
        &work.outcomes,
        starts,
        work.orbits,
        after,
        work.transient_spectrum,
        work.row,
        control,
    )
}

/// A census under way.
struct Work<'a, M> {
    map: &'a M,
    starts: &'a StartSet,
    options: &'a CensusOptions,
    control: &'a Control<'a>,
    done: AtomicUsize,
    /// Starts at most.
    last: usize,
    outcomes: Vec<Outcome>,
    /// Least and greatest entries of the starts so far.
    ends: Vec<[f64; 2]>,
    orbits: Vec<PeriodicOrbit>,
    /// Index of an orbit and a neighbourhood of it.
    neighbourhoods: Vec<(usize, Neighbourhood)>,
    /// Orbits whose neighbourhood was looked for.
    motions: usize,
    /// Spectra of the chaotic motions and tori found, one of each.
    chaos: Vec<LyapunovSpectrum>,
    transient_spectrum: Option<LyapunovSpectrum>,
    /// Periods after which most starts are in a neighbourhood, or on chaos that is recognised.
    patience: usize,
    /// Periods run so far.
    periods: usize,
    /// Starts decided since the last new motion, of those that count in the fractions.
    row: usize,
}

impl<M: StroboscopicMap> Work<'_, M> {
    /// True if the next batch is not wanted.
    fn is_enough(&self) -> bool {
        if self.control.is_cancelled() || self.starts.len().is_some() {
            return self.control.is_cancelled();
        }
        Unseen::new(self.found(), self.row).share <= self.options.unseen
            || self.outcomes.len() > self.starts.given_count()
                && self.periods >= self.options.max_periods
    }

    /// Motions found so far.
    fn found(&self) -> usize {
        self.orbits.len() + self.chaos.len()
    }

    /// Starts of the next batch: as many as found nothing new in a row, since threads wait for each
    /// other at the end of a batch. Of those that are drawn, no more than bound and budget ask for if
    /// nothing new comes.
    fn next_batch(&self) -> usize {
        let mut size = self.row;
        if self.starts.len().is_none() {
            let bound = Unseen::row_for(self.found(), self.options.unseen).saturating_sub(self.row);
            let periods = self.options.max_periods.saturating_sub(self.periods) as f64;
            let budget = periods * self.outcomes.len() as f64 / self.periods.max(1) as f64;
            size = size.min(bound).min(budget.ceil() as usize);
        }
        size.div_ceil(BATCH).max(1) * BATCH
    }

    /// Follows the next `size` starts; returns those that were classified.
    fn follow(&mut self, size: usize) -> Vec<usize> {
        let first = self.outcomes.len();
        let range = first..self.last.min(first + size);
        let drawn = range.clone().into_par_iter().with_min_len(DRAWN_AT_ONCE);
        let start = |k| {
            let goes_on = !self.control.is_cancelled();
            goes_on.then(|| self.starts.start(k)).flatten()
        };
        let starts: Vec<_> = drawn.filter_map(start).collect();
        for start in &starts {
            extend(&mut self.ends, start);
        }
        let arrivals = self.run(&starts);
        let known: Vec<usize> = self.neighbourhoods.iter().map(|(i, _)| *i).collect();
        let mut classified = Vec::new();
        for (k, arrival) in range.zip(arrivals) {
            let before = self.found();
            if matches!(arrival, Some(RunEnd::Classified(_))) {
                classified.push(k);
            }
            let outcome = self.outcome(arrival, &known);
            self.periods += assemble::periods_of(&outcome);
            let counts = self.starts.len().is_some()
                || matches!(self.starts.origin(k), Some(StartOrigin::Drawn(_)));
            if self.found() > before {
                self.row = 0;
            } else if counts && !matches!(outcome, Outcome::Undecided(_)) {
                self.row += 1;
            }
            self.outcomes.push(outcome);
        }
        classified
    }

    /// Finds neighbourhoods of the orbits that are new, checks all by the starts that were
    /// `classified` without them, and says how long a start is left to itself from now on.
    fn know_neighbourhoods(&mut self, classified: &[usize]) {
        // A run beside the same neighbourhoods as before would end as it did.
        if self.find_neighbourhoods() {
            self.check_neighbourhoods(classified);
        }
        let sides = self.sides();
        self.patience = self
            .neighbourhoods
            .iter()
            .map(|(_, ball)| ball.expected_entry(&sides) as usize)
            .fold(0, usize::max)
            .clamp(
                LEAST_PATIENCE,
                self.options.classify.max_transient.max(LEAST_PATIENCE),
            );
        let chaotic = |outcome: &&Outcome| matches!(outcome, Outcome::Chaos(..));
        if 2 * self.outcomes.iter().filter(chaotic).count() > self.outcomes.len() {
            self.patience = self.patience.max(RECOGNISABLE);
        }
    }

    /// Sides of the box around the starts so far.
    fn sides(&self) -> Vec<f64> {
        self.ends.iter().map(|[low, high]| high - low).collect()
    }

    fn balls(&self) -> Vec<Neighbourhood> {
        let balls = self.neighbourhoods.iter();
        balls.map(|(_, ball)| ball.clone()).collect()
    }

    fn run(&self, starts: &[Vec<f64>]) -> Vec<Option<RunEnd>> {
        let balls = self.balls();
        let batch = Batch {
            map: self.map,
            starts,
            known: Known {
                balls: &balls,
                chaos: &self.chaos,
                patience: self.patience,
            },
            options: &self.options.classify,
            control: self.control,
            progress: (&self.done, self.last),
        };
        batch.followed()
    }

    fn outcome(&mut self, arrival: Option<RunEnd>, known: &[usize]) -> Outcome {
        let classified = match arrival {
            None => return Outcome::Undecided(UndecidedReason::Cancelled),
            Some(RunEnd::Entered { index, periods }) => {
                return Outcome::Orbit {
                    index: known[index],
                    periods,
                };
            }
            Some(RunEnd::Classified(classified)) => *classified,
        };
        let Classified {
            kind,
            periods,
            state,
            met,
        } = classified;
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
                self.know(&torus.spectrum);
                Outcome::Torus(torus, state)
            }
            MotionKind::Chaotic(chaos) => {
                self.know(&chaos.spectrum);
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

    fn know(&mut self, spectrum: &LyapunovSpectrum) {
        if !self.chaos.iter().any(|k| k.agrees_with(spectrum)) {
            self.chaos.push(spectrum.clone());
        }
    }

    /// Looks for the contracting neighbourhoods of the orbits that are new, and says whether there are
    /// any.
    fn find_neighbourhoods(&mut self) -> bool {
        let new: Vec<(usize, Neighbourhood)> = self.orbits[self.motions..]
            .par_iter()
            .with_max_len(1)
            .enumerate()
            .map_init(
                || self.map.clone(),
                |map, (k, orbit)| {
                    let found = Neighbourhood::around(map, orbit).ok().flatten()?;
                    Some((self.motions + k, found))
                },
            )
            .collect::<Vec<_>>()
            .into_iter()
            .flatten()
            .collect();
        self.motions = self.orbits.len();
        let found = !new.is_empty();
        self.neighbourhoods.extend(new);
        found
    }

    /// How long the starts that were `classified` really took, now that their goal is
    /// known; and a check of the neighbourhoods by starts whose destination was found
    /// without them.
    fn check_neighbourhoods(&mut self, classified: &[usize]) {
        let checked: Vec<usize> = classified
            .iter()
            .copied()
            .filter(|&k| match self.outcomes[k] {
                Outcome::Orbit { index, .. } => {
                    self.neighbourhoods.iter().any(|(i, _)| *i == index)
                }
                _ => false,
            })
            .collect();
        let balls = self.balls();
        let entries: Vec<Option<(usize, usize)>> = checked
            .par_iter()
            .with_max_len(1)
            .map_init(
                || self.map.clone(),
                |map, &k| {
                    if self.control.is_cancelled() {
                        return None;
                    }
                    let periods = assemble::periods_of(&self.outcomes[k]);
                    let start = self.starts.start(k)?;
                    first_entry(map, &start, &balls, periods, &self.options.classify)
                },
            )
            .collect();
        let mut discarded = Vec::new();
        for (k, entry) in checked.into_iter().zip(entries) {
            let (Outcome::Orbit { index, periods }, Some((ball, after))) =
                (&mut self.outcomes[k], entry)
            else {
                continue;
            };
            if self.neighbourhoods[ball].0 == *index {
                *periods = after;
            } else {
                discarded.push(ball);
            }
        }
        let mut position = 0;
        self.neighbourhoods.retain(|_| {
            position += 1;
            !discarded.contains(&(position - 1))
        });
    }

    /// Follows chaotic starts for several times the periods `after` which escapes are
    /// counted: beside a weakly stable orbit, chaos that was watched for less than a
    /// linear transient takes is no evidence of an attractor. Where no stable orbit is known there
    /// is none to be beside. Where starts escaped, the others are watched for as long as a start
    /// may be in transit at all. Where one of them escapes,
    /// escapes count from when it was known to be chaotic.
    fn watch_chaos(&mut self, after: &mut f64) {
        let escaped = |outcome: &Outcome| matches!(outcome, Outcome::Orbit { periods, .. } if *periods as f64 > *after);
        let least = if self.outcomes.iter().any(escaped) {
            self.options.classify.max_transient
        } else {
            0
        };
        let beside = if self.orbits.is_empty() {
            0.0
        } else {
            WATCHED_TRANSIENTS * *after
        };
        let enough = least.max(beside as usize);
        let mut budget = self.options.max_periods;
        let watched: Vec<usize> = (0..self.outcomes.len())
            .filter(|&k| match &self.outcomes[k] {
                Outcome::Chaos(chaos, _) if chaos.observed < enough => {
                    let left = budget.checked_sub(enough - chaos.observed);
                    budget = left.unwrap_or(budget);
                    left.is_some()
                }
                _ => false,
            })
            .collect();
        let balls = self.balls();
        let ends: Vec<Result<Vec<f64>, RunEnd>> = watched
            .par_iter()
            .with_max_len(1)
            .map_init(
                || self.map.clone(),
                |map, &k| match &self.outcomes[k] {
                    Outcome::Chaos(chaos, state) => {
                        let periods = enough - chaos.observed;
                        watch(map, state, &balls, periods, &self.options.classify)
                    }
                    _ => Ok(Vec::new()),
                },
            )
            .collect();
        if self.control.is_cancelled() {
            return;
        }
        let known: Vec<usize> = self.neighbourhoods.iter().map(|(i, _)| *i).collect();
        for (k, end) in watched.into_iter().zip(ends) {
            let Outcome::Chaos(chaos, at) = &mut self.outcomes[k] else {
                continue;
            };
            match end {
                Ok(state) => {
                    chaos.observed = enough;
                    *at = state;
                }
                Err(arrival) => {
                    let (spectrum, observed) = (chaos.spectrum.clone(), chaos.observed);
                    let mut outcome = self.outcome(Some(arrival), &known);
                    if let Outcome::Orbit { periods, .. } = &mut outcome {
                        *periods += observed;
                        self.transient_spectrum.get_or_insert(spectrum);
                        *after = after.min(observed as f64);
                    }
                    self.outcomes[k] = outcome;
                }
            }
        }
    }

    /// The natural length of a transient that is no chaos.
    fn relaxation(&self) -> f64 {
        let sides = self.sides();
        self.neighbourhoods
            .iter()
            .map(|(_, ball)| ball.relaxation(&sides))
            .fold(0.0, f64::max)
    }
}

/// Least and greatest entries of some starts, with those of one more.
fn extend(ends: &mut Vec<[f64; 2]>, start: &[f64]) {
    if ends.is_empty() {
        ends.extend(start.iter().map(|v| [*v, *v]));
    }
    for ([low, high], v) in ends.iter_mut().zip(start) {
        *low = low.min(*v);
        *high = high.max(*v);
    }
}
