//! One start followed until its motion is known.

use crate::control::CancelFlag;

use crate::classify::approach::approaches;
use crate::classify::birkhoff::birkhoff_digits;
use crate::classify::candidates::candidate_periods;
use crate::classify::{Chaos, Classified, ClassifyOptions, MotionKind, Torus, UndecidedReason};
use crate::failure::{MapFailure, advance, finite};
use crate::lyapunov::{LyapunovRun, LyapunovSpectrum, StrobeMeans};
use crate::map::StroboscopicMap;
use crate::neighbourhood::Neighbourhood;
use crate::orbit::{PeriodicOrbit, ShootingOptions, close_orbit_from_points};
use crate::reset::AfterReset;
use crate::vector::{distance, norm};

/// Number of standard errors by which a positive exponent must exceed zero.
const CLEAR: f64 = 5.0;
/// Number of Newton steps from a guess: near an orbit half as many are needed, and far from one
/// Newton's method would only wander to some orbit that the run does not go to.
const CLOSING_STEPS: usize = 10;
/// Smallest fraction of a Newton step from a guess: near the orbit that a run goes to full steps
/// succeed.
const SHORTEST_STEP: f64 = 0.5;
/// Growth of the linearised return beyond which a near return does not indicate a stable orbit:
/// where a run does go to one, the linearised return shrinks in the end.
const MAX_GUESS_GROWTH: f64 = 100.0;
/// Largest closure, as a fraction of the motion's spread, of a period worth trying.
const WORTH_TRYING: f64 = 0.2;
/// The same for periods beyond [`ClassifyOptions::max_period`], where Newton's method costs more.
const LONG_WORTH_TRYING: f64 = 1e-2;
/// The same in the last search before a motion is called anything but periodic.
const LAST_WORTH_TRYING: f64 = 0.1;
/// Periods after which the means of a run may show that it is on known chaos.
pub(crate) const RECOGNISABLE: usize = 256;
/// Largest number of times their budget for which exponents are measured, where chaotic transients
/// end.
const LONGEST_MEASUREMENT: usize = 4;
/// Largest error of an orbit, as a fraction of its size, that decides whether a run is on it: a
/// coarse map determines it less accurately.
const DETERMINED: f64 = 1e-8;
/// Initial distance of a neighbour, in standard deviations of the motion.
const NEIGHBOUR: f64 = 1e-9;
/// Factor by which the distance of a neighbour grows on chaos.
const DIVERGENCE: f64 = 1e5;
/// Largest number of periods in which it grows by this factor.
pub(super) const MAX_DIVERGENCE_PERIODS: usize = 512;

/// Motions that are known before a start is followed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct KnownMotions<'a> {
    /// Neighbourhoods of attracting orbits: a run that enters one is not followed further.
    pub(crate) trapping_regions: &'a [Neighbourhood],
    /// Exponents and means of chaotic motions and tori.
    pub(crate) chaos: &'a [LyapunovSpectrum],
    /// Periods after which most runs are in one of the neighbourhoods, or on known chaos: before
    /// that, examining a run costs more than waiting.
    pub(crate) max_wait_periods: usize,
    /// A run stops within a period after this becomes true.
    pub(crate) cancel: Option<&'a CancelFlag>,
}

/// End of a run: a known neighbourhood, or a classified motion.
#[derive(Clone, Debug)]
pub(crate) enum RunEnd {
    /// It entered the neighbourhood of a known attractor, after this many periods.
    Entered {
        index: usize,
        periods: usize,
    },
    Classified(Box<Classified>),
    /// It lost the memory of its past ([`StroboscopicMap::resets`]).
    Reset(Box<ResetRun>),
}

/// A run that was reset.
#[derive(Clone, Debug)]
pub(crate) struct ResetRun {
    /// Drive periods run.
    pub(crate) periods: usize,
    /// Exponents before the reset, if they were measured and show chaos.
    pub(crate) chaos: Option<LyapunovSpectrum>,
    /// Stable orbits that Newton closed on the way.
    pub(crate) met: Vec<PeriodicOrbit>,
}

/// Classifies the motion that follows a reset: its orbit, or what a run from its first state comes to.
pub(crate) fn classify_reset<M: StroboscopicMap>(
    map: &mut M,
    known: KnownMotions<'_>,
    options: &ClassifyOptions,
) -> Classified {
    let after = map.after_reset();
    let (state, is_reset_again, is_not_reset_again) = match after.as_deref() {
        Some(AfterReset::Open {
            state,
            is_reset_again,
            is_not_reset_again,
        }) => (state, is_reset_again, is_not_reset_again),
        Some(AfterReset::Closes(orbit)) => {
            return Classified {
                state: orbit.states[0].clone(),
                kind: MotionKind::Periodic(orbit.clone()),
                periods: 0,
                met: Vec::new(),
            };
        }
        None => {
            let failure = MapFailure::NotFinite;
            let reason = UndecidedReason::Map {
                periods: 0,
                failure,
            };
            return Classified {
                kind: undecided(reason, None),
                periods: 0,
                state: Vec::new(),
                met: Vec::new(),
            };
        }
    };
    let open = |reason: &String, periods, met| Classified {
        kind: undecided(UndecidedReason::Reset(reason.clone()), None),
        periods,
        state: state.clone(),
        met,
    };
    match follow_start(map, state, known, options) {
        RunEnd::Reset(again) => open(is_reset_again, again.periods, again.met),
        RunEnd::Classified(end) => match end.kind {
            MotionKind::Chaotic(_)
            | MotionKind::Undecided {
                reason:
                    UndecidedReason::NothingCloses { .. }
                    | UndecidedReason::NoTorusHere { .. }
                    | UndecidedReason::NoTorusOnALine { .. }
                    | UndecidedReason::NeitherTorusNorChaos { .. },
                ..
            } => open(is_not_reset_again, end.periods, end.met),
            _ => *end,
        },
        RunEnd::Entered { .. } => open(is_not_reset_again, 0, Vec::new()),
    }
}

pub(crate) fn follow_start<M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    known: KnownMotions<'_>,
    options: &ClassifyOptions,
) -> RunEnd {
    if let Some(end) = refused(start, map.dimension()) {
        return end;
    }
    let mut run = Run::new(start, known, options);
    let how = run.follow(map);
    run.ended(how)
}

/// The end of a start that is not a state of dimension `d`; `None` if it is one.
pub(super) fn refused(start: &[f64], d: usize) -> Option<RunEnd> {
    let reason = if start.len() != d || d == 0 {
        format!("{} numbers given, {d} needed", start.len())
    } else {
        let bad = start.iter().find(|v| !v.is_finite())?;
        format!("{bad} is not finite")
    };
    Some(RunEnd::Classified(Box::new(Classified {
        kind: undecided(UndecidedReason::BadStart(reason), None),
        periods: 0,
        state: start.to_vec(),
        met: Vec::new(),
    })))
}

/// Returns the first of the neighbourhoods that a start enters within `periods` periods, and the
/// number of periods until then.
pub(crate) fn first_entry<M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    known: KnownMotions<'_>,
    periods: usize,
    options: &ClassifyOptions,
) -> Option<(usize, usize)> {
    let mut run = Run::new(start, known, options);
    match run.run_to(map, periods) {
        Err(Stop::Entered(index)) => Some((index, run.periods)),
        _ => None,
    }
}

/// Follows a motion for `periods` more periods; returns its state then, or where it went instead.
pub(crate) fn watch<M: StroboscopicMap>(
    map: &mut M,
    state: &[f64],
    known: KnownMotions<'_>,
    periods: usize,
    options: &ClassifyOptions,
) -> Result<Vec<f64>, RunEnd> {
    let mut run = Run::new(state, known, options);
    if let Err(stop) = run.run_to(map, periods) {
        return Err(run.stopped(stop));
    }
    // It may have gone to an orbit that no other start found.
    if !run.guesses(longest(options), LONG_WORTH_TRYING).is_empty() {
        let guesses = run.guesses_at_look();
        match run.close(map, guesses) {
            Ok(Some(kind)) => return Err(run.classified(kind)),
            Ok(None) => {}
            Err(stop) => return Err(run.stopped(stop)),
        }
    }
    Ok(run.state)
}

fn undecided(reason: UndecidedReason, spectrum: Option<LyapunovSpectrum>) -> MotionKind {
    MotionKind::Undecided { reason, spectrum }
}

/// The reason why following a start ended early.
pub(super) enum Stop {
    Entered(usize),
    Unbounded,
    Cancelled,
    Budget,
    Reset,
    Failed(MapFailure),
}

impl From<MapFailure> for Stop {
    fn from(failure: MapFailure) -> Self {
        Self::Failed(failure)
    }
}

pub(super) struct Run<'a> {
    d: usize,
    pub(super) state: Vec<f64>,
    scratch: Vec<f64>,
    pub(super) periods: usize,
    /// Cost of the map when the first period was over.
    first_cost: Option<u64>,
    /// The latest strobe states, oldest first: at least as many as twice the longest period.
    recent: Vec<f64>,
    keep: usize,
    /// Periods after which the run is examined next, unless a budget ends before.
    target: usize,
    /// Periods before which neighbourhoods are not checked.
    next_entry: usize,
    known: KnownMotions<'a>,
    options: &'a ClassifyOptions,
    closing: ShootingOptions,
    met: Vec<PeriodicOrbit>,
    /// Exponents measured so far, if they show chaos.
    chaos_before: Option<LyapunovSpectrum>,
}

/// Guesses from which Newton's method has still to close orbits, and the closed orbits that are not
/// the run's.
pub(super) struct Guesses {
    left: std::vec::IntoIter<(usize, Vec<f64>)>,
    tried: Vec<PeriodicOrbit>,
}

impl Guesses {
    fn new(guesses: Vec<(usize, Vec<f64>)>) -> Self {
        Self {
            left: guesses.into_iter(),
            tried: Vec::new(),
        }
    }
}

/// An orbit that Newton closed near a run.
pub(super) enum Closed {
    /// Its multipliers show that it attracts.
    Attracting(PeriodicOrbit),
    /// It does not attract, but the run is on it.
    Occupied(PeriodicOrbit),
}

/// Next action after a run was examined.
pub(super) enum AfterLook {
    /// The motion is classified: the run ends.
    Known(MotionKind),
    /// The run may be on known chaos; a neighbour decides.
    MaybeChaos(ChaosMatch),
    /// The run goes on to the next examination.
    GoOn,
    /// The motion does not close: its exponents are measured.
    Measure,
}

/// Known chaos whose means agree with those of a run.
pub(super) struct ChaosMatch {
    pub(super) spectrum: LyapunovSpectrum,
    /// Standard deviations of the run's states.
    deviations: Vec<f64>,
}

impl ChaosMatch {
    /// A state displaced by [`NEIGHBOUR`] standard deviations in each entry.
    pub(super) fn neighbour(&self, state: &[f64]) -> Vec<f64> {
        let apart = self.deviations.iter().map(|s| NEIGHBOUR * s);
        state
            .iter()
            .zip(apart)
            .map(|(x, apart)| x + apart)
            .collect()
    }

    /// Whether a neighbour is [`DIVERGENCE`] times as far away as at first, more than any linear
    /// transient explains.
    pub(super) fn has_diverged(&self, state: &[f64], neighbour: &[f64]) -> bool {
        let distances = neighbour.iter().zip(state).zip(&self.deviations);
        let apart = distances.fold(0.0f64, |far, ((a, b), s)| far.max((a - b).abs() / s));
        apart > DIVERGENCE * NEIGHBOUR
    }
}

impl<'a> Run<'a> {
    pub(super) fn new(
        start: &[f64],
        known: KnownMotions<'a>,
        options: &'a ClassifyOptions,
    ) -> Self {
        let keep = (2 * longest(options)).max(options.first_look) * start.len();
        Self {
            d: start.len(),
            state: start.to_vec(),
            scratch: start.to_vec(),
            periods: 0,
            first_cost: None,
            recent: start.to_vec(),
            keep,
            target: options.first_look.max(known.max_wait_periods).max(1),
            next_entry: 0,
            known,
            options,
            closing: ShootingOptions {
                max_iterations: options.shooting.max_iterations.min(CLOSING_STEPS),
                max_growth: MAX_GUESS_GROWTH,
                min_damping: options.shooting.min_damping.max(SHORTEST_STEP),
                explains_stalls: false,
                ..options.shooting.clone()
            },
            met: Vec::new(),
            chaos_before: None,
        }
    }

    pub(super) fn ended(self, how: Result<MotionKind, Stop>) -> RunEnd {
        match how {
            Ok(kind) => self.classified(kind),
            Err(stop) => self.stopped(stop),
        }
    }

    fn classified(self, kind: MotionKind) -> RunEnd {
        RunEnd::Classified(Box::new(Classified {
            kind,
            periods: self.periods,
            state: self.state,
            met: self.met,
        }))
    }

    fn stopped(self, stop: Stop) -> RunEnd {
        let periods = self.periods;
        match stop {
            Stop::Entered(index) => RunEnd::Entered { index, periods },
            Stop::Unbounded => self.classified(MotionKind::Unbounded),
            Stop::Cancelled => self.classified(undecided(UndecidedReason::Cancelled, None)),
            Stop::Budget => {
                let steps = self.options.max_steps;
                self.classified(undecided(UndecidedReason::Budget { periods, steps }, None))
            }
            Stop::Reset => RunEnd::Reset(Box::new(ResetRun {
                periods,
                chaos: self.chaos_before,
                met: self.met,
            })),
            Stop::Failed(failure) => {
                let reason = UndecidedReason::Map { periods, failure };
                self.classified(undecided(reason, None))
            }
        }
    }

    fn follow<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<MotionKind, Stop> {
        loop {
            self.run_to_look(map)?;
            let after = self.at_look(map)?;
            if let Some(kind) = self.after_look(map, after)? {
                return Ok(kind);
            }
        }
    }

    /// Runs until it is time to examine the motion.
    pub(super) fn run_to_look<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<(), Stop> {
        self.run_to(map, self.next_look())
    }

    /// Runs until `periods` periods are over.
    fn run_to<M: StroboscopicMap>(&mut self, map: &mut M, periods: usize) -> Result<(), Stop> {
        while self.periods < periods {
            self.step(map)?;
        }
        Ok(())
    }

    /// Completes an examination: the kind of the motion, or `None` if the run goes on.
    fn after_look<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        mut after: AfterLook,
    ) -> Result<Option<MotionKind>, Stop> {
        if let AfterLook::MaybeChaos(chaos) = after {
            if self.diverges_from_neighbour(map, &chaos)? {
                return Ok(Some(self.chaotic(chaos.spectrum)));
            }
            after = self.go_on();
        }
        match after {
            AfterLook::Known(kind) => Ok(Some(kind)),
            AfterLook::Measure => self.measure(map).map(Some),
            AfterLook::GoOn | AfterLook::MaybeChaos(_) => Ok(None),
        }
    }

    /// Number of periods after which the run is examined next.
    pub(super) fn next_look(&self) -> usize {
        self.target.min(self.options.max_transient)
    }

    /// Examines the run: tries to close its motion and to recognise known chaos.
    pub(super) fn at_look<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<AfterLook, Stop> {
        let guesses = self.guesses_at_look();
        self.looked(map, guesses)
    }

    /// Examines the run with these guesses for Newton's method.
    fn looked<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        guesses: Guesses,
    ) -> Result<AfterLook, Stop> {
        if let Some(kind) = self.close(map, guesses)? {
            return Ok(AfterLook::Known(kind));
        }
        if self.periods >= RECOGNISABLE.min(self.options.max_transient)
            && let Some(chaos) = self.matching_chaos()
        {
            return Ok(AfterLook::MaybeChaos(chaos));
        }
        Ok(self.go_on())
    }

    /// Goes on after an examination that found nothing: to the next one, or to measuring exponents.
    pub(super) fn go_on(&mut self) -> AfterLook {
        if self.target >= self.options.max_transient {
            return AfterLook::Measure;
        }
        self.target *= 2;
        AfterLook::GoOn
    }

    fn step<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<(), Stop> {
        let resets = map.resets();
        // A motion that runs off ends in an overflow; that is what it is.
        match advance(map, &mut self.state) {
            Err(MapFailure::NotFinite) => return Err(Stop::Unbounded),
            other => other?,
        }
        self.after_period(map)?;
        Self::check_reset(map, resets)
    }

    /// Ends the run if it was reset since there were `before` resets.
    fn check_reset<M: StroboscopicMap>(map: &M, before: u64) -> Result<(), Stop> {
        if map.resets() == before {
            Ok(())
        } else {
            Err(Stop::Reset)
        }
    }

    /// Steps as [`Run::step`], to a state that is known already.
    pub(super) fn step_to<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        state: &[f64],
    ) -> Result<(), Stop> {
        self.state.copy_from_slice(state);
        finite(state).map_err(|_| Stop::Unbounded)?;
        self.after_period(map)
    }

    /// Bookkeeping after every period: history, bounds, known neighbourhoods.
    #[inline]
    fn after_period<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<(), Stop> {
        self.periods += 1;
        if self.recent.len() >= 4 * self.keep {
            let cut = self.recent.len() - self.keep;
            self.recent.copy_within(cut.., 0);
            self.recent.truncate(self.keep);
        }
        self.recent.extend_from_slice(&self.state);
        if norm(&self.state) > self.options.bound {
            return Err(Stop::Unbounded);
        }
        if self.known.cancel.is_some_and(CancelFlag::is_cancelled) {
            return Err(Stop::Cancelled);
        }
        let cost = map.cost();
        if cost > self.largest_cost(cost) {
            return Err(Stop::Budget);
        }
        if self.periods < self.next_entry {
            return Ok(());
        }
        for (index, region) in self.known.trapping_regions.iter().enumerate() {
            if region.contains(&self.state) {
                if region.holds(map, &self.state, &mut self.scratch)? {
                    return Err(Stop::Entered(index));
                }
                self.next_entry = self.periods + region.retry();
            }
        }
        Ok(())
    }

    /// Cost of the map at which the budget is spent.
    fn largest_cost(&mut self, cost: u64) -> u64 {
        let first = *self.first_cost.get_or_insert(cost);
        first.saturating_add(self.options.max_steps)
    }

    /// Whether the budget suffices for Newton's method on an orbit of this period.
    fn affords(&self, cost: u64, period: usize) -> bool {
        let spent = cost - self.first_cost.unwrap_or(cost);
        let a_period = spent / self.periods.max(1) as u64;
        let needed = a_period.saturating_mul((self.closing.max_iterations * period) as u64);
        spent.saturating_add(needed) <= self.options.max_steps
    }

    /// Guesses from which Newton's method is to close the motion.
    pub(super) fn guesses_at_look(&self) -> Guesses {
        let long = longest(self.options);
        let mut guesses = self.guesses(self.options.max_period, WORTH_TRYING);
        if self.periods >= 2 * long {
            let more = self.guesses(long, LONG_WORTH_TRYING);
            guesses.extend(
                more.into_iter()
                    .filter(|(n, _)| *n > self.options.max_period),
            );
        }
        if !guesses.iter().any(|(n, _)| *n == 1) {
            guesses.push((1, self.state.clone()));
        }
        // A slow spiral around a fixed point has its centre at the mean.
        guesses.push((1, self.recent_mean()));
        Guesses::new(guesses)
    }

    /// Guesses from the latest states: the periods, up to `longest`, after which they most nearly
    /// repeat.
    fn guesses(&self, longest: usize, worth_trying: f64) -> Vec<(usize, Vec<f64>)> {
        let allowed = worth_trying * self.recent_spread(2 * longest);
        candidate_periods(&self.recent, self.d, longest)
            .into_iter()
            .take(3)
            .filter(|c| c.closure <= allowed && c.period * self.d <= self.recent.len())
            .map(|c| {
                let from = self.recent.len() - c.period * self.d;
                (c.period, self.recent[from..].to_vec())
            })
            .collect()
    }

    /// The next orbit that Newton closes: one that attracts, or one that the run sits on.
    pub(super) fn next_orbit<M: StroboscopicMap>(
        &self,
        map: &mut M,
        guesses: &mut Guesses,
    ) -> Option<Closed> {
        for (period, points) in guesses.left.by_ref() {
            if !self.affords(map.cost(), period) {
                continue;
            }
            let Ok(orbit) = close_orbit_from_points(map, &points, period, &self.closing) else {
                continue;
            };
            if guesses.tried.iter().any(|t| t.is_same_as(&orbit)) {
                continue;
            }
            if orbit.is_stable() {
                return Some(Closed::Attracting(orbit));
            }
            let mut states = orbit.states.iter();
            let reach = 10.0 * orbit.error.min(DETERMINED * orbit.scale());
            if states.any(|x| distance(x, &self.state) <= reach) {
                return Some(Closed::Occupied(orbit));
            }
            guesses.tried.push(orbit);
        }
        None
    }

    /// Kind of the motion according to a closed orbit; `None` if the run does not go to it.
    pub(super) fn verdict<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        closed: Closed,
        guesses: &mut Guesses,
    ) -> Result<Option<MotionKind>, Stop> {
        let orbit = match closed {
            Closed::Attracting(orbit) => orbit,
            Closed::Occupied(orbit) => {
                let reason = UndecidedReason::OnOrbitThatDoesNotAttract(Box::new(orbit));
                return Ok(Some(undecided(reason, None)));
            }
        };
        let largest_cost = self.largest_cost(map.cost());
        if approaches(map, &self.state, &orbit, largest_cost)? {
            return Ok(Some(MotionKind::Periodic(orbit)));
        }
        if !self.met.iter().any(|m| m.is_same_as(&orbit)) {
            self.met.push(orbit.clone());
        }
        guesses.tried.push(orbit);
        Ok(None)
    }

    /// Tries to close the motion; returns its kind if it goes to a stable orbit or stays on
    /// another.
    fn close<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        mut guesses: Guesses,
    ) -> Result<Option<MotionKind>, Stop> {
        while let Some(closed) = self.next_orbit(map, &mut guesses) {
            if let Some(kind) = self.verdict(map, closed, &mut guesses)? {
                return Ok(Some(kind));
            }
        }
        Ok(None)
    }

    fn recent_mean(&self) -> Vec<f64> {
        let rows = self.recent.chunks_exact(self.d);
        let window = rows.len().min(2 * self.options.max_period).max(1);
        let mut mean = vec![0.0; self.d];
        for row in rows.rev().take(window) {
            for (m, v) in mean.iter_mut().zip(row) {
                *m += v / window as f64;
            }
        }
        mean
    }

    /// Largest distance of one of the last `count` states from the last one.
    fn recent_spread(&self, count: usize) -> f64 {
        self.recent
            .chunks_exact(self.d)
            .rev()
            .take(count)
            .fold(0.0, |m: f64, row| m.max(distance(row, &self.state)))
    }

    /// The known chaotic motion whose means agree with those of the strobe states after the first
    /// quarter.
    fn matching_chaos(&self) -> Option<ChaosMatch> {
        let mut known = self.known.chaos.iter().filter(|k| is_chaotic(k)).peekable();
        known.peek()?;
        let settled = (self.periods - self.periods / 4).min(self.recent.len() / self.d);
        let means = StrobeMeans::of(&self.recent[self.recent.len() - settled * self.d..], self.d);
        let deviations = means.deviations();
        let telling = means.is_comparable();
        let found = known.find(|k| telling && k.strobe.agree_with(&means));
        found.map(|spectrum| ChaosMatch {
            spectrum: spectrum.clone(),
            deviations,
        })
    }

    /// Returns whether a neighbour of the state diverges from it within [`MAX_DIVERGENCE_PERIODS`]
    /// periods. The run advances by these periods too.
    fn diverges_from_neighbour<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        chaos: &ChaosMatch,
    ) -> Result<bool, Stop> {
        let mut neighbour = chaos.neighbour(&self.state);
        for _ in 0..MAX_DIVERGENCE_PERIODS {
            self.step(map)?;
            if advance(map, &mut neighbour).is_err() {
                return Ok(false);
            }
            if chaos.has_diverged(&self.state, &neighbour) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    pub(super) fn chaotic(&self, spectrum: LyapunovSpectrum) -> MotionKind {
        MotionKind::Chaotic(Chaos::of(spectrum, self.periods, self.options))
    }

    /// Measures the exponents of a motion that does not close, looking for an escape after every
    /// doubling. If the last half of the run differs from the rest, or is not chaotic although the
    /// whole run is, everything before it was a transient and is discarded.
    pub(super) fn measure<M: StroboscopicMap>(&mut self, map: &mut M) -> Result<MotionKind, Stop> {
        let budget = &self.options.lyapunov;
        let mut exponents = LyapunovRun::new(self.d);
        for _ in 0..budget.alignment {
            self.step_with(map, &mut exponents)?;
        }
        let mut before: Option<LyapunovSpectrum> = None;
        let first = budget.min_periods.max(64);
        let (mut measured, mut target, mut end) = (first / 2, first, budget.max_periods);
        self.record(map, &mut exponents, measured)?;
        let mut early = exponents.spectrum();
        let spectrum = loop {
            let stretch = target - measured;
            if 2 * stretch >= exponents.periods() {
                early = exponents.spectrum();
                exponents.begin_last_stretch();
            }
            self.record(map, &mut exponents, stretch)?;
            measured = target;
            let guesses = self.guesses_at_look();
            if let Some(kind) = self.close(map, guesses)? {
                return Ok(match (kind, before.filter(is_chaotic)) {
                    (MotionKind::Periodic(orbit), Some(spectrum)) => MotionKind::TransientChaos {
                        orbit,
                        spectrum,
                        lasted: self.periods,
                    },
                    (kind, _) => kind,
                });
            }
            let last = exponents.last_spectrum();
            let calmed_down = is_chaotic(&exponents.spectrum()) && !stays_chaotic(&last);
            if calmed_down {
                end = (measured + budget.max_periods).min(LONGEST_MEASUREMENT * budget.max_periods);
            }
            if calmed_down || !early.agrees_with(&last) {
                exponents.keep_last_stretch();
            }
            let spectrum = exponents.spectrum();
            let known = self.known.chaos.iter();
            let is_known = known.clone().any(|k| k.agrees_with(&spectrum));
            if is_chaotic(&spectrum) {
                let stays = stays_chaotic(&exponents.last_spectrum());
                let mut tori = known.filter(|k| !is_chaotic(k));
                let is_on_torus = tori.any(|k| k.strobe.agree_with(&last.strobe));
                if stays
                    && !is_on_torus
                    && (budget.is_met_by(&spectrum) || is_known || measured >= end)
                {
                    return Ok(self.chaotic(spectrum));
                }
            } else if is_known && spectrum.is_comparable() {
                // Perhaps on a torus that is known.
                let kind = self.neither_periodic_nor_chaotic(map, spectrum.clone())?;
                if !matches!(kind, MotionKind::Undecided { .. }) {
                    return Ok(kind);
                }
            }
            if measured >= end {
                break spectrum;
            }
            before = Some(spectrum);
            target = (measured + exponents.periods()).min(end);
        };
        self.neither_periodic_nor_chaotic(map, spectrum)
    }

    /// Runs for more periods, which count in the averages.
    fn record<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        exponents: &mut LyapunovRun,
        periods: usize,
    ) -> Result<(), Stop> {
        for _ in 0..periods {
            self.step_with(map, exponents)?;
            exponents.record(&self.state);
        }
        Ok(())
    }

    fn step_with<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        exponents: &mut LyapunovRun,
    ) -> Result<(), Stop> {
        let resets = map.resets();
        match exponents.step(map, &mut self.state) {
            Err(MapFailure::NotFinite) => return Err(Stop::Unbounded),
            other => other?,
        }
        self.after_period(map)?;
        if let Err(stop) = Self::check_reset(map, resets) {
            let spectrum = exponents.spectrum();
            self.chaos_before = is_chaotic(&spectrum).then_some(spectrum);
            return Err(stop);
        }
        Ok(())
    }

    /// A motion without a clearly positive exponent that did not close so far.
    fn neither_periodic_nor_chaotic<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        spectrum: LyapunovSpectrum,
    ) -> Result<MotionKind, Stop> {
        let longest_period = longest(self.options);
        let (exponent, error) = spectrum.largest();
        while self.recent.len() < 2 * longest_period * self.d {
            self.step(map)?;
        }
        let last_guesses = self.guesses(longest_period, LAST_WORTH_TRYING);
        if let Some(kind) = self.close(map, Guesses::new(last_guesses))? {
            return Ok(kind);
        }
        let zero = spectrum.zero();
        if exponent < -zero {
            return Ok(undecided(
                UndecidedReason::NothingCloses {
                    exponent,
                    error,
                    max_period: longest_period,
                },
                Some(spectrum),
            ));
        }
        let nearest = candidate_periods(&self.recent, self.d, longest_period)
            .first()
            .copied();
        let spread = self.recent_spread(usize::MAX);
        if let Some(c) = nearest.filter(|c| c.closure <= 1e-9 * spread) {
            return Ok(undecided(
                UndecidedReason::NotIsolated {
                    period: c.period,
                    closure: c.closure,
                },
                Some(spectrum),
            ));
        }
        if self.d == 1 {
            return Ok(undecided(
                UndecidedReason::NoTorusOnALine {
                    exponent,
                    error,
                    max_period: longest_period,
                    observed: self.periods,
                },
                Some(spectrum),
            ));
        }
        // A torus of one dimension less than the state encloses a volume, which the map
        // would have to keep.
        let neutral = spectrum.neutral_directions();
        let contraction = map.log_determinant_bound();
        if neutral + 1 >= self.d && contraction < 0.0 {
            return Ok(undecided(
                UndecidedReason::NoTorusHere {
                    exponent,
                    error,
                    contraction: -contraction,
                    max_period: longest_period,
                    observed: self.periods,
                },
                Some(spectrum),
            ));
        }
        let stretch = self.options.birkhoff_periods.max(16);
        let digits = birkhoff_digits(map, &mut self.state, stretch)?;
        self.periods += 2 * stretch;
        if digits >= self.options.torus_digits && exponent <= zero {
            return Ok(MotionKind::QuasiPeriodic(Torus {
                spectrum,
                birkhoff_digits: digits,
                nearest_return: nearest.map_or(f64::INFINITY, |c| c.closure),
                observed: self.periods,
                longest_period,
            }));
        }
        Ok(undecided(
            UndecidedReason::NeitherTorusNorChaos {
                exponent,
                error,
                digits,
            },
            Some(spectrum),
        ))
    }
}

/// Longest period that is ever tried, in drive periods.
fn longest(options: &ClassifyOptions) -> usize {
    options.long_period.max(options.max_period)
}

/// Whether the largest exponent is clearly positive: by more than five standard errors, and with a
/// total growth that no initial frame explains.
fn is_chaotic(spectrum: &LyapunovSpectrum) -> bool {
    is_positive(spectrum, CLEAR, 20.0)
}

/// The same for the last half of a run, whose error is larger by a factor √2 and whose growth is
/// half.
fn stays_chaotic(last: &LyapunovSpectrum) -> bool {
    is_positive(last, CLEAR * std::f64::consts::FRAC_1_SQRT_2, 10.0)
}

fn is_positive(spectrum: &LyapunovSpectrum, clear: f64, growth: f64) -> bool {
    let (exponent, error) = spectrum.largest();
    exponent > clear * error && exponent * spectrum.periods as f64 > growth
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[derive(Clone)]
    pub(in crate::classify) struct Logistic(pub(in crate::classify) f64);

    impl crate::Scheduling for Logistic {}

    impl StroboscopicMap for Logistic {
        type Error = std::convert::Infallible;

        fn dimension(&self) -> usize {
            1
        }

        fn period(&self) -> f64 {
            1.0
        }

        fn advance(&mut self, state: &mut [f64]) -> Result<(), Self::Error> {
            state[0] *= self.0 * (1.0 - state[0]);
            Ok(())
        }

        fn advance_with_jacobian(
            &mut self,
            state: &mut [f64],
            jacobian: &mut DMatrix<f64>,
        ) -> Result<(), Self::Error> {
            jacobian[(0, 0)] = self.0 * (1.0 - 2.0 * state[0]);
            self.advance(state)
        }
    }

    /// 3.2 x (1 − x) has a stable orbit of period 2, at 3.9 it is chaotic; no neighbourhood is known.
    #[test]
    fn a_motion_that_is_watched_may_go_to_an_orbit_that_nobody_knows() {
        let options = ClassifyOptions::default();
        let watched = |r: f64| {
            watch(
                &mut Logistic(r),
                &[0.3],
                KnownMotions::default(),
                200,
                &options,
            )
        };
        let Err(RunEnd::Classified(end)) = watched(3.2) else {
            panic!("the orbit was not noticed")
        };
        assert!(matches!(&end.kind, MotionKind::Periodic(orbit) if orbit.period == 2));
        assert!(watched(3.9).is_ok());
    }
}
