//! Which attractors there are, and what part of a set of starts goes to each.
//!
//! Where the map has a [coarse](crate::Scheduling::coarse) one, starts are followed on that, and each
//! motion that they come to is confirmed on the map itself (`motions.rs`).
//!
//! 0. Orbits near seeds are closed ([`StartSet::with_seeds`]).
//! 1. Pilot starts are classified one by one ([`mod@crate::classify`]); orbits that are
//!    the same up to a cyclic shift, within their own error estimates, are merged.
//! 2. Around each stable orbit a contracting neighbourhood is found
//!    ([`crate::neighbourhood`]). A neighbourhood that a start with another
//!    destination enters is discarded.
//! 3. The other starts follow in batches (`batch.rs`). Each is run until it enters a neighbourhood,
//!    or is classified like a pilot; what a batch finds is known to the next. A start on
//!    chaos that is known is recognised, without measuring its exponents, by diverging from a
//!    neighbour and by the means of its strobe states and their squares.
//! 4. Starts that can be drawn without end ([`StartSet`]) go on until the share of
//!    them that may lead to motions not yet found is bounded ([`UndiscoveredFraction`]) as the
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
//! means and mean squares would be merged; an attractor and a chaotic transient near it
//! are distinguished only by the hazard of escape falling with time, as documented at
//! [`Census::transient_chaos`].

mod assemble;
mod batch;
mod check;
mod confidence;
mod escapes;
mod motions;
mod start_box;
mod start_set;
mod undiscovered;

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::census::batch::{Batch, Progress};
use crate::census::escapes::{Escapes, escape_after};
use crate::census::motions::Motions;
use crate::classify::{
    Chaos, ClassifyOptions, KnownMotions, RECOGNISABLE, RunEnd, Torus, UndecidedReason,
    first_entry, watch,
};
use crate::control::Control;
use crate::lyapunov::LyapunovSpectrum;
use crate::map::StroboscopicMap;
use crate::neighbourhood::Neighbourhood;
use crate::orbit::PeriodicOrbit;

pub use check::{CheckedStart, ExactOutcome, check_starts};
pub use confidence::{Fraction, Lifetime};
pub use start_box::{StartBox, StartBoxError, Wall};
pub use start_set::{StartOrigin, StartSet};
pub use undiscovered::UndiscoveredFraction;

/// Number of pilots that are followed before any motion is known.
const FIRST_PILOTS: usize = 4;
/// Number of starts in the first batch after the pilots; larger batches are multiples of it.
const BATCH: usize = 128;
/// Number of starts that a thread draws at a time; each takes a microsecond or two.
const DRAWN_AT_ONCE: usize = 16;
/// Smallest number of periods for which a start that enters no neighbourhood is run before it is
/// examined, once attractors are known.
const MIN_WAIT_PERIODS: usize = 64;
/// The same wait on a coarse map, as a multiple of the expected time to enter a neighbourhood.
const COARSE_WAIT_FACTOR: f64 = 1.3;
/// Longest such wait on a coarse map, in periods.
const MAX_COARSE_WAIT_PERIODS: usize = 2048;
/// Largest number of periods for which all chaotic starts together are watched on a coarse map.
const WATCHED_TOGETHER: usize = 400_000;
/// Largest number of rounds in which they are watched: each takes as long as all before it.
const WATCH_ROUNDS: u32 = 4;
/// On a coarse map chaos is watched until the whole census has taken this multiple of
/// [`CensusOptions::max_steps`].
const WATCHED_STEPS: u64 = 2;
/// Number of escapes at which a lifetime is known well enough.
const ENOUGH_ESCAPES: usize = 16;
/// Number of pilots on a coarse map when orbits are known from seeds.
const COARSE_PILOTS: usize = 8;
/// The search for one trapping region may take the steps of the census divided by this.
const REGION_STEPS: u64 = 4;
/// Chaos is watched for this multiple of the periods after which escapes are counted.
const WATCHED_TRANSIENTS: f64 = 8.0;

/// Options of a census: how many starts are followed, and for how long.
#[derive(Clone, Debug, PartialEq)]
pub struct CensusOptions {
    /// Number of starts that are classified without knowledge of any orbit's neighbourhood.
    pub pilots: usize,
    /// Options of the classification of each start.
    pub classify: ClassifyOptions,
    /// Drawn starts go on until the fraction of starts (0 to 1) that may lead to motions not yet
    /// found is below this with 95 % confidence.
    pub unseen: f64,
    /// Largest number of drawn starts, even if that bound is not reached.
    pub max_starts: usize,
    /// Drive periods of all starts together after which no further batch is begun.
    pub max_periods: usize,
    /// Steps of time integration of all the work after which no further batch is begun, as the map
    /// counts them ([`Scheduling::cost`](crate::Scheduling::cost)). [`ClassifyOptions::max_steps`] limits a start.
    pub max_steps: u64,
}

impl Default for CensusOptions {
    fn default() -> Self {
        Self {
            pilots: 32,
            classify: ClassifyOptions::default(),
            unseen: 0.002,
            max_starts: 5000,
            max_periods: 2_000_000,
            max_steps: 60_000_000,
        }
    }
}

/// Result of a census: the attractors, and the fraction of the starts that goes to each.
#[derive(Clone, Debug)]
pub struct Census {
    /// Attractors in descending order of their fractions.
    pub attractors: Vec<Attractor>,
    /// Chaos from which some starts escaped while it was watched.
    ///
    /// Counted are starts that are in no attractor's neighbourhood after three times
    /// the slowest linear decay from the box (64 periods at least). If some of them
    /// escape and others have not yet, the others are on transient chaos, unless all
    /// escapes fell in the first quarter of the time watched and that would happen
    /// with probability below 1 % at a constant rate: then there is an attractor,
    /// with a chaotic transient near it.
    pub transient_chaos: Option<TransientChaos>,
    /// Fraction of the starts that left every bound.
    pub unbounded: Fraction,
    /// Starts left undecided: index of the start and the reason.
    pub undecided: Vec<(usize, UndecidedReason)>,
    /// Outcome of each start, in order of the starts.
    pub outcomes_by_start: Vec<StartOutcome>,
    /// Number of starts that the fractions refer to: all starts of a given set, or the drawn starts
    /// of a set that is drawn.
    pub counted: usize,
    /// The same fractions for each size of the set of starts; empty if none was drawn.
    pub by_size: Vec<SizeCount>,
    /// Bound on the fraction of the starts that may lead to motions not found; `None` if no start
    /// was drawn.
    pub unseen: Option<UndiscoveredFraction>,
    /// Unstable orbits that Newton's method closed near seeds.
    pub unstable: Vec<PeriodicOrbit>,
    /// Whether starts were followed on the map's [coarse](crate::Scheduling::coarse) one. Counts
    /// and fractions are then those of the coarse map; orbits and spectra are always the map's own.
    pub followed_coarsely: bool,
    /// Why no further start was followed.
    pub end: CensusEnd,
    /// True if the work was stopped before all starts were done.
    pub cancelled: bool,
}

/// The reason why a census followed no further start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CensusEnd {
    /// All given starts were followed, or the work was stopped.
    AllStarts,
    /// The share that may lead to motions not found is below [`CensusOptions::unseen`].
    BoundMet,
    /// The largest number of drawn starts, [`CensusOptions::max_starts`], was reached.
    MaxStarts,
    /// The starts took all drive periods of [`CensusOptions::max_periods`].
    MaxPeriods,
    /// The work took all time steps of [`CensusOptions::max_steps`].
    MaxSteps,
}

/// Outcomes of the starts of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct SizeCount {
    /// Factor by which the box of starts is shrunk; 1 for the full box.
    pub scale: f64,
    /// Number of starts drawn with this size.
    pub starts: usize,
    /// Fraction of them that goes to each attractor, in the order of [`Census::attractors`].
    pub attractors: Vec<Fraction>,
    /// Fraction of them that left every bound.
    pub unbounded: Fraction,
    /// Fraction of them left undecided, or on transient chaos.
    pub undecided: Fraction,
}

/// An attractor with the fraction of the starts that goes to it.
#[derive(Clone, Debug)]
pub struct Attractor {
    /// Kind of the attractor, with the evidence for it.
    pub kind: AttractorKind,
    /// Fraction of the starts that goes to it.
    pub fraction: Fraction,
    /// Index of the first start that goes to it; `None` if none does and Newton's method found it.
    pub first_start: Option<usize>,
    /// A state on the attractor at drive phase 0, of the map's dimension.
    pub state: Vec<f64>,
}

/// Kind of an attractor, with the evidence for it.
#[derive(Clone, Debug)]
pub enum AttractorKind {
    /// A stable periodic orbit.
    Periodic(PeriodicOrbit),
    /// A torus: the motion is quasi-periodic.
    QuasiPeriodic(Torus),
    /// Chaos from which no start escaped.
    Chaotic {
        /// Lyapunov exponents, from the first start that found it.
        spectrum: LyapunovSpectrum,
        /// Mean lifetime over all starts on it; with no escape only its lower bound is finite.
        lifetime: Lifetime,
    },
}

impl AttractorKind {
    /// Returns whether both are the same motion: orbits up to a cyclic shift within their error
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

/// Chaos that ends: its lifetime, and where the starts that escaped from it went.
#[derive(Clone, Debug)]
pub struct TransientChaos {
    /// Lyapunov exponents while it lasts, from the first start seen on it; `None` if they were
    /// measured only on the map's [coarse](crate::Scheduling::coarse) one.
    pub spectrum: Option<LyapunovSpectrum>,
    /// Mean lifetime in drive periods, by maximum likelihood; starts that have not escaped are
    /// censored.
    pub lifetime: Lifetime,
    /// Fraction of the starts that are still on transient chaos at the end.
    pub unescaped: Fraction,
    /// Attractors that escaped starts went to: index into [`Census::attractors`] and number of
    /// starts.
    pub destinations: Vec<(usize, usize)>,
}

/// Outcome of one start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartOutcome {
    /// It went to an attractor.
    Attractor {
        /// Index into [`Census::attractors`].
        index: usize,
        /// Drive periods after which that was known.
        periods: usize,
    },
    /// It was still on the transient chaos at the end of its run.
    TransientChaos {
        /// Drive periods run.
        periods: usize,
    },
    /// A state exceeded the bound or overflowed.
    Unbounded,
    /// Undecided; the reason is in [`Census::undecided`].
    Undecided,
}

/// Outcome of one start, before starts are grouped into attractors.
#[derive(Clone)]
enum Outcome {
    Orbit {
        index: usize,
        periods: usize,
    },
    Torus(Torus, Vec<f64>),
    Chaos(Chaos, Vec<f64>),
    Unbounded,
    Undecided(UndecidedReason),
    /// It was reset after so many periods ([`StroboscopicMap::resets`]), and what follows is left
    /// undecided.
    Reset {
        reason: UndecidedReason,
        periods: usize,
    },
}

/// Takes a census of `starts`, each of the map's dimension.
pub fn census<M: StroboscopicMap>(
    map: &M,
    starts: &[Vec<f64>],
    options: &CensusOptions,
    control: &Control<'_>,
) -> Census {
    census_of(map, &StartSet::given(starts.to_vec()), options, control)
}

/// Takes a census of a set of starts, given or drawn.
pub fn census_of<M: StroboscopicMap>(
    map: &M,
    starts: &StartSet,
    options: &CensusOptions,
    control: &Control<'_>,
) -> Census {
    let coarse = map.coarse().and_then(|coarse| {
        let work = Work::begin(map, Some(coarse), starts, options, control);
        (!work.fails_mostly()).then_some(work)
    });
    // Where the coarse map cannot follow the pilots, the map itself does.
    let work = coarse.unwrap_or_else(|| Work::begin(map, None, starts, options, control));
    work.finish()
}

/// A census in progress.
struct Work<'a, M> {
    motions: Motions<'a, M>,
    /// Budgets of each start on the map that is followed.
    followed_options: ClassifyOptions,
    starts: &'a StartSet,
    options: &'a CensusOptions,
    control: &'a Control<'a>,
    done: AtomicUsize,
    /// Cost of all the work so far, as the starts that are being followed add to it.
    spent: AtomicU64,
    /// Largest number of starts.
    last: usize,
    outcomes: Vec<Outcome>,
    /// Smallest and largest value of each entry of the starts so far.
    ends: Vec<[f64; 2]>,
    /// Index of an orbit of the followed map and a neighbourhood of it.
    neighbourhoods: Vec<(usize, Neighbourhood)>,
    /// Number of orbits of the followed map whose neighbourhood was searched for.
    searched: usize,
    /// Periods after which most starts are in a neighbourhood, or on chaos that is recognised.
    max_wait_periods: usize,
    /// Drive periods run so far, over all starts.
    periods: usize,
    /// Cost of the starts and trapping regions so far.
    cost: u64,
    /// Starts decided since the last new motion, of those that count in the fractions.
    starts_since_discovery: usize,
}

impl<'a, M: StroboscopicMap> Work<'a, M> {
    /// Closes the seeds and follows the pilots.
    fn begin(
        map: &M,
        coarse: Option<M>,
        starts: &'a StartSet,
        options: &'a CensusOptions,
        control: &'a Control<'a>,
    ) -> Self {
        let given = starts.given_count();
        let last = starts
            .len()
            .unwrap_or_else(|| given.saturating_add(options.max_starts));
        let mut work = Work {
            motions: Motions::new(map, coarse, &options.classify, control.cancel),
            followed_options: options.classify.clone(),
            starts,
            options,
            control,
            done: AtomicUsize::new(0),
            spent: AtomicU64::new(0),
            last,
            outcomes: Vec::new(),
            ends: Vec::new(),
            neighbourhoods: Vec::new(),
            searched: 0,
            max_wait_periods: 0,
            periods: 0,
            cost: 0,
            starts_since_discovery: 0,
        };
        if work.motions.is_coarse {
            work.followed_options = options.classify.on_coarse_map();
        }
        work.motions.close_seeds(starts.seeds());
        if work.motions.count() > 0 {
            work.update_trapping_regions(&[]);
        }
        let count = if work.motions.is_coarse && !work.neighbourhoods.is_empty() {
            options.pilots.min(COARSE_PILOTS)
        } else {
            options.pilots
        };
        // Chaos that the first of the pilots are on need not be measured again by the others.
        let mut pilots = work.follow(count.clamp(1, FIRST_PILOTS));
        let more = count.saturating_sub(FIRST_PILOTS);
        let more = if starts.len().is_some() {
            more
        } else {
            more.min(work.affordable_starts())
        };
        pilots.extend(work.follow(more));
        work.update_trapping_regions(&pilots);
        work
    }

    /// Follows starts until enough is known.
    fn finish(mut self) -> Census {
        while self.outcomes.len() < self.last && !self.is_enough() {
            let classified = self.follow(self.next_batch());
            self.update_trapping_regions(&classified);
        }
        let mut after = Escapes::after(self.relaxation());
        self.watch_chaos(&mut after);
        self.assemble(after)
    }

    /// Whether most starts could not be followed.
    fn fails_mostly(&self) -> bool {
        let failed =
            |outcome: &&Outcome| matches!(outcome, Outcome::Undecided(UndecidedReason::Map { .. }));
        let failed = self.outcomes.iter().filter(failed).count();
        2 * failed > self.outcomes.len() && !self.control.is_cancelled()
    }

    /// Returns whether no further batch is needed.
    fn is_enough(&self) -> bool {
        if self.control.is_cancelled() || self.starts.len().is_some() {
            return self.control.is_cancelled();
        }
        self.is_bound_met()
            || self.outcomes.len() > self.starts.given_count()
                && (self.periods >= self.options.max_periods || self.is_budget_spent())
    }

    fn is_budget_spent(&self) -> bool {
        self.total_cost() >= self.options.max_steps
    }

    /// Cost of all the work so far.
    fn total_cost(&self) -> u64 {
        self.cost + self.motions.cost()
    }

    fn is_bound_met(&self) -> bool {
        UndiscoveredFraction::new(self.motions.count(), self.starts_since_discovery).share
            <= self.options.unseen
    }

    /// Why no further start was followed.
    fn end(&self) -> CensusEnd {
        if self.starts.len().is_some() || self.control.is_cancelled() {
            CensusEnd::AllStarts
        } else if self.is_bound_met() {
            CensusEnd::BoundMet
        } else if self.outcomes.len() >= self.last {
            CensusEnd::MaxStarts
        } else if self.is_budget_spent() {
            CensusEnd::MaxSteps
        } else {
            CensusEnd::MaxPeriods
        }
    }

    /// Starts of the next batch: as many as found nothing new in a row, since threads wait for each
    /// other at the end of a batch. Of those that are drawn, no more than bound and budget ask for if
    /// nothing new comes.
    fn next_batch(&self) -> usize {
        let mut size = self.starts_since_discovery;
        if self.starts.len().is_none() {
            let bound =
                UndiscoveredFraction::starts_needed(self.motions.count(), self.options.unseen)
                    .saturating_sub(self.starts_since_discovery);
            let periods = self.options.max_periods.saturating_sub(self.periods) as f64;
            let budget = periods * self.outcomes.len() as f64 / self.periods.max(1) as f64;
            size = size.min(bound).min(budget.ceil() as usize);
        }
        let size = size.div_ceil(BATCH).max(1) * BATCH;
        size.min(self.affordable_starts().max(FIRST_PILOTS))
    }

    /// Number of further starts that the budget of steps suffices for, at the cost of those so far.
    fn affordable_starts(&self) -> usize {
        let steps = self.options.max_steps.saturating_sub(self.total_cost());
        let starts = steps.saturating_mul(self.outcomes.len() as u64) / self.cost.max(1);
        usize::try_from(starts).unwrap_or(usize::MAX)
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
        for ((k, arrival), start) in range.zip(arrivals).zip(&starts) {
            let before = self.motions.count();
            let arrival = arrival.map(|(arrival, cost)| {
                self.cost += cost;
                arrival
            });
            if matches!(arrival, Some(RunEnd::Classified(_))) {
                classified.push(k);
            }
            let outcome = self.outcome(arrival, &known, start);
            self.periods += assemble::periods_of(&outcome);
            let counts = self.starts.len().is_some()
                || matches!(self.starts.origin(k), Some(StartOrigin::Drawn(_)));
            if self.motions.count() > before {
                self.starts_since_discovery = 0;
            } else if counts && !matches!(outcome, Outcome::Undecided(_) | Outcome::Reset { .. }) {
                self.starts_since_discovery += 1;
            }
            self.outcomes.push(outcome);
        }
        classified
    }

    /// Finds neighbourhoods of the new orbits, checks all of them with the starts that were
    /// `classified` without them, and updates how long a start is run before it is examined.
    fn update_trapping_regions(&mut self, classified: &[usize]) {
        // With the same trapping regions as before a run would end as it did.
        if self.find_neighbourhoods() {
            self.check_neighbourhoods(classified);
        }
        let sides = self.sides();
        let trapping_regions = self.neighbourhoods.iter();
        let entries = trapping_regions.map(|(_, region)| region.expected_entry(&sides));
        let entry = entries.fold(0.0, f64::max);
        let longest = self.options.classify.max_transient.max(MIN_WAIT_PERIODS);
        self.max_wait_periods = if self.motions.is_coarse {
            let max_wait_periods = (COARSE_WAIT_FACTOR * entry) as usize + MIN_WAIT_PERIODS;
            max_wait_periods.min(longest.max(MAX_COARSE_WAIT_PERIODS))
        } else {
            (entry as usize).clamp(MIN_WAIT_PERIODS, longest)
        };
        let chaotic = |outcome: &&Outcome| matches!(outcome, Outcome::Chaos(..));
        if 2 * self.outcomes.iter().filter(chaotic).count() > self.outcomes.len() {
            self.max_wait_periods = self.max_wait_periods.max(RECOGNISABLE);
        }
        if self.motions.is_coarse {
            let transient = self.options.classify.max_transient;
            self.followed_options.max_transient = transient.max(2 * self.max_wait_periods);
        }
    }

    /// Sides of the box around the starts so far.
    fn sides(&self) -> Vec<f64> {
        self.ends.iter().map(|[low, high]| high - low).collect()
    }

    fn trapping_regions(&self) -> Vec<Neighbourhood> {
        let trapping_regions = self.neighbourhoods.iter();
        trapping_regions.map(|(_, region)| region.clone()).collect()
    }

    /// The motions that a run can be recognised by, with these neighbourhoods.
    fn known<'k>(&'k self, trapping_regions: &'k [Neighbourhood]) -> KnownMotions<'k> {
        KnownMotions {
            trapping_regions,
            chaos: &self.motions.spectra,
            max_wait_periods: self.max_wait_periods,
            cancel: self.control.cancel,
        }
    }

    /// Number of starts at which the census ends if no other motion is found, and if the work does
    /// not take all its steps before.
    fn expected_starts(&self) -> usize {
        if self.starts.len().is_some() {
            return self.last;
        }
        let followed = self.outcomes.len();
        let needed = UndiscoveredFraction::starts_needed(self.motions.count(), self.options.unseen)
            .saturating_sub(self.starts_since_discovery);
        let bound = followed.max(self.starts.given_count()) + needed;
        let in_periods = followed as f64 * self.options.max_periods as f64;
        let affordable = match self.periods {
            0 => usize::MAX,
            periods => (in_periods / periods as f64) as usize,
        };
        bound.min(affordable).min(self.last).max(followed)
    }

    fn run(&self, starts: &[Vec<f64>]) -> Vec<Option<(RunEnd, u64)>> {
        self.spent.store(self.total_cost(), Ordering::Relaxed);
        let is_drawn = self.starts.len().is_none();
        let trapping_regions = self.trapping_regions();
        let batch = Batch {
            map: &self.motions.followed,
            starts,
            known: self.known(&trapping_regions),
            options: &self.followed_options,
            control: self.control,
            progress: Progress {
                done: &self.done,
                cost: &self.spent,
                most: self
                    .expected_starts()
                    .max(self.outcomes.len() + starts.len()),
                budget: is_drawn.then_some(self.options.max_steps),
            },
        };
        batch.followed()
    }

    /// What a start has come to that arrived there.
    fn outcome(&mut self, arrival: Option<RunEnd>, known: &[usize], start: &[f64]) -> Outcome {
        match arrival {
            None => Outcome::Undecided(UndecidedReason::Cancelled),
            Some(RunEnd::Entered { index, periods }) => self.motions.arrival(known[index], periods),
            Some(RunEnd::Classified(classified)) => self.motions.outcome(*classified, start),
            Some(RunEnd::Reset(reset)) => self.motions.reset_outcome(*reset),
        }
    }

    /// Looks for the contracting neighbourhoods of the orbits that are new, and says whether there are
    /// any.
    fn find_neighbourhoods(&mut self) -> bool {
        let motions = &self.motions;
        let orbits = &motions.followed_orbits;
        for (orbit, _) in &orbits[self.searched..] {
            for (own, region) in &mut self.neighbourhoods {
                if motions.is_coarse && !orbits[*own].0.is_same_as(orbit) {
                    region.keep_clear_of(orbit);
                }
            }
        }
        let found: Vec<(Option<Neighbourhood>, u64)> = (self.searched..orbits.len())
            .into_par_iter()
            .with_max_len(1)
            .map_init(
                || motions.followed.clone(),
                |map, own| {
                    let orbit = &orbits[own].0;
                    let others = orbits.iter().map(|(orbit, _)| orbit);
                    let others = others.enumerate().filter(|(k, _)| *k != own);
                    let others = others.map(|(_, other)| other).chain(&motions.unstable);
                    let before = map.cost();
                    let found = if self.control.is_cancelled() {
                        return (None, 0);
                    } else if motions.is_coarse {
                        let steps = self.options.max_steps / REGION_STEPS;
                        Neighbourhood::over_block(map, orbit, others, steps)
                    } else {
                        Neighbourhood::around(map, orbit)
                    };
                    (found.ok().flatten(), map.cost() - before)
                },
            )
            .collect();
        let first = self.searched;
        self.searched = orbits.len();
        let known = self.neighbourhoods.len();
        for (k, (neighbourhood, cost)) in found.into_iter().enumerate() {
            self.cost += cost;
            let found = neighbourhood.map(|neighbourhood| (first + k, neighbourhood));
            self.neighbourhoods.extend(found);
        }
        self.neighbourhoods.len() > known
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
                    let mut leads = self
                        .neighbourhoods
                        .iter()
                        .map(|(own, _)| self.leads_to(*own));
                    leads.any(|other| other == Some(index))
                }
                _ => false,
            })
            .collect();
        let trapping_regions = self.trapping_regions();
        let entries: Vec<Option<(usize, usize)>> = checked
            .par_iter()
            .with_max_len(1)
            .map_init(
                || self.motions.followed.clone(),
                |map, &k| {
                    if self.control.is_cancelled() {
                        return None;
                    }
                    let periods = assemble::periods_of(&self.outcomes[k]);
                    let start = self.starts.start(k)?;
                    let known = KnownMotions {
                        trapping_regions: &trapping_regions,
                        cancel: self.control.cancel,
                        ..KnownMotions::default()
                    };
                    first_entry(map, &start, known, periods, &self.followed_options)
                },
            )
            .collect();
        let mut discarded = Vec::new();
        let leads: Vec<_> = self
            .neighbourhoods
            .iter()
            .map(|(own, _)| self.leads_to(*own))
            .collect();
        for (k, entry) in checked.into_iter().zip(entries) {
            let (Outcome::Orbit { index, periods }, Some((region, after))) =
                (&mut self.outcomes[k], entry)
            else {
                continue;
            };
            if leads[region] == Some(*index) {
                *periods = after;
            } else {
                discarded.push(region);
            }
        }
        let mut position = 0;
        self.neighbourhoods.retain(|_| {
            position += 1;
            !discarded.contains(&(position - 1))
        });
    }

    /// Index of the orbit to which starts lead that come to an orbit of the followed map.
    fn leads_to(&self, own: usize) -> Option<usize> {
        match self.motions.followed_orbits[own].1 {
            Outcome::Orbit { index, .. } => Some(index),
            _ => None,
        }
    }

    /// Follows chaotic starts for several times the periods `after` which escapes are
    /// counted: near a weakly stable orbit, chaos that was watched for less than a
    /// linear transient takes is no evidence of an attractor. Where no stable orbit is known there
    /// is none to be near. Where starts escaped, the others are watched for as long as a start
    /// may be in transit at all. Where one of them escapes,
    /// escapes count from when it was known to be chaotic.
    fn watch_chaos(&mut self, after: &mut f64) {
        let escaped = |outcome: &Outcome| escape_after(outcome, *after).is_some();
        let least = if self.outcomes.iter().any(escaped) {
            self.options.classify.max_transient
        } else {
            0
        };
        let near_orbit = if self.motions.orbits.is_empty() {
            0.0
        } else {
            WATCHED_TRANSIENTS * *after
        };
        let enough = least.max(near_orbit as usize);
        let chaotic = |outcome: &&Outcome| matches!(outcome, Outcome::Chaos(..));
        let chaotic = self.outcomes.iter().filter(chaotic).count();
        let together = WATCHED_TOGETHER / chaotic.max(1);
        let mut budget = self.options.max_periods;
        if self.motions.is_coarse {
            let steps = self.options.max_steps.saturating_mul(WATCHED_STEPS);
            let steps = steps.saturating_sub(self.total_cost());
            let affordable = steps.saturating_mul(self.periods as u64) / self.cost.max(1);
            budget = budget.min(WATCHED_TOGETHER).min(affordable as usize);
        }
        if self.motions.is_coarse && together > enough {
            for round in (0..WATCH_ROUNDS).rev() {
                self.watch_for(enough.max(together >> round), after, &mut budget);
                self.find_neighbourhoods();
                if Escapes::count(&self.outcomes, *after).escaped.len() >= ENOUGH_ESCAPES {
                    break;
                }
            }
        } else {
            self.watch_for(enough, after, &mut budget);
        }
    }

    /// Follows chaotic starts until each was for so many periods, as long as the budget lasts.
    fn watch_for(&mut self, enough: usize, after: &mut f64, budget: &mut usize) {
        let watched: Vec<usize> = (0..self.outcomes.len())
            .filter(|&k| match &self.outcomes[k] {
                Outcome::Chaos(chaos, _) if chaos.observed < enough => {
                    let left = budget.checked_sub(enough - chaos.observed);
                    *budget = left.unwrap_or(*budget);
                    left.is_some()
                }
                _ => false,
            })
            .collect();
        let trapping_regions = self.trapping_regions();
        let known = self.known(&trapping_regions);
        let ends: Vec<Result<Vec<f64>, RunEnd>> = watched
            .par_iter()
            .with_max_len(1)
            .map_init(
                || self.motions.followed.clone(),
                |map, &k| match &self.outcomes[k] {
                    Outcome::Chaos(chaos, state) => {
                        let periods = enough - chaos.observed;
                        watch(map, state, known, periods, &self.followed_options)
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
            // What was seen before the work was stopped stands.
            if self.control.is_cancelled() {
                return;
            }
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
                    let start = at.clone();
                    let mut outcome = self.outcome(Some(arrival), &known, &start);
                    if let Outcome::Orbit { periods, .. } | Outcome::Reset { periods, .. } =
                        &mut outcome
                    {
                        *periods += observed;
                        self.motions.has_transient_chaos = true;
                        self.motions.transient_spectrum.get_or_insert(spectrum);
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
            .map(|(_, region)| region.relaxation(&sides))
            .fold(0.0, f64::max)
    }

    fn assemble(self, after: f64) -> Census {
        let end = self.end();
        let motions = self.motions;
        let census = assemble::assemble(
            &self.outcomes,
            self.starts,
            motions.orbits,
            after,
            (motions.has_transient_chaos, motions.transient_spectrum),
            self.starts_since_discovery,
        );
        Census {
            unstable: motions.unstable,
            followed_coarsely: motions.is_coarse,
            end,
            cancelled: self.control.is_cancelled(),
            ..census
        }
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
