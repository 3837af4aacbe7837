//! The inner loop: a motion from switch to switch in modal coordinates.
//!
//! A motion does not hold its system. The caller lends the system, so that threads which
//! share one need not count references to it every period.

use crate::observer::{Observer, SegmentView, SwitchView};
use crate::search::tabulated::Followed;
use crate::search::{BySteps, Crossing, Start, Statistics, on_table, sign_changes};
use crate::signal::Signal;
use crate::simd::{self, ComplexVector, Library, Simd, Work, layout};
use crate::system::{ON_SURFACE, Onset, Switch, System, Transition, rounding};
use crate::{Complex, Drive, FlowError, Output};

/// The position of a motion of a [`System`], with its work space.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    pub(crate) regime: usize,
    pub(crate) phase: f64,
    /// Modal coordinates, then the tones' phasors, packed: `[re, im]`.
    pub(crate) packed: Vec<ComplexVector>,
    /// The work space of a switch.
    next: Vec<ComplexVector>,
    /// Factors `e^{λ_k s}` of the present stretch.
    turns: Vec<ComplexVector>,
    /// Transition whose guard starts at zero, and how it starts.
    pub(crate) surface: Option<(usize, Start)>,
    signal: Signal,
    followed: Followed,
    /// For observers: modal coordinates and `e^{λ_k s}` as plain numbers.
    modal: Vec<Complex>,
    factors: Vec<Complex>,
    /// Work space of the length of a state.
    scratch: Vec<f64>,
    pub(crate) statistics: Statistics,
    pub(crate) switches: u64,
    /// How often it was released from rest on a rigid stop.
    pub(crate) releases: u64,
    /// Longest touch of a rigid stop that is ignored, in the system's unit of time; 0 for none.
    pub(crate) longest_passed_touch: f64,
}

/// Largest number of consecutive switches within [`BRIEF`] before chatter is reported as an error.
const STALLED_SWITCHES: u32 = 1000;
/// Interval between switches that counts as chatter, as a fraction of the fastest time scale.
pub(crate) const BRIEF: f64 = 1e-6;
/// Duration, as a fraction of the fastest time scale, below which a touch is computed from its rate
/// and acceleration alone.
const SHORTEST_TOUCH: f64 = 1e-6;
/// Duration of a flight, as a fraction of the fastest time scale, below which an impact sequence
/// ends in sticking: the rest of the sequence is below rounding (second order).
const CHATTER_RESOLUTION: f64 = 1e-8;

impl Motion {
    /// Creates the work space of a motion of `system`; call [`Motion::start`] before running it.
    pub(crate) fn new(system: &System) -> Self {
        let largest = system
            .regimes()
            .iter()
            .map(|r| r.basis().len())
            .max()
            .unwrap_or(0);
        Self {
            regime: 0,
            phase: 0.0,
            packed: Vec::new(),
            next: Vec::new(),
            turns: Vec::new(),
            surface: None,
            signal: Signal::default(),
            followed: Followed::default(),
            modal: Vec::with_capacity(largest),
            factors: Vec::with_capacity(largest),
            scratch: vec![0.0; system.dimension()],
            statistics: Statistics::default(),
            switches: 0,
            releases: 0,
            longest_passed_touch: 0.0,
        }
    }

    /// Sets the motion to state `x` (length `n`) at time `phase` within the period.
    pub(crate) fn start(
        &mut self,
        system: &System,
        x: &[f64],
        phase: f64,
    ) -> Result<(), FlowError> {
        let (regime, surface) = system.start_at(x, phase)?;
        self.regime = regime;
        self.phase = phase;
        self.surface = surface;
        let regime = &system.regimes()[regime];
        self.modal
            .resize(regime.basis().len(), Complex::new(0.0, 0.0));
        regime.to_modal(system.drive(), x, phase, &mut self.scratch, &mut self.modal);
        self.store_modal(system);
        self.set_phasors(system);
        Ok(())
    }

    /// Does the same as `start` for input that may be invalid.
    pub(crate) fn start_checked(
        &mut self,
        system: &System,
        x: &[f64],
        phase: f64,
    ) -> Result<(), FlowError> {
        let n = system.dimension();
        if x.len() != n {
            return Err(FlowError::Shape {
                what: "the state",
                found: x.len(),
                expected: n,
            });
        }
        if !x.iter().all(|v| v.is_finite()) || !phase.is_finite() {
            return Err(FlowError::NotFinite { what: "the state" });
        }
        self.start(system, x, phase)
    }

    /// Writes the state (length `n`) to `x`.
    pub(crate) fn write_state(&self, system: &System, x: &mut [f64]) {
        let regime = &system.regimes()[self.regime];
        let modal = (0..regime.basis().len()).map(|k| self.coordinate(k));
        regime.to_state(system.drive(), modal, self.phase, x);
    }

    /// Runs to the end of the drive period; the phase is then zero, or under tones that do not repeat
    /// the period.
    pub(crate) fn run_period<O: Observer>(
        &mut self,
        system: &System,
        observer: &mut O,
    ) -> Result<(), FlowError> {
        self.run_until(system, system.drive().period(), observer)?;
        if system.drive().repeats() {
            self.begin_period(system);
        }
        observer.period_end();
        Ok(())
    }

    /// Runs over `periods` drive periods without stopping in between.
    pub(crate) fn run_periods(&mut self, system: &System, periods: usize) -> Result<(), FlowError> {
        if periods > 1 && !system.drive().repeats() {
            return Err(FlowError::Drive {
                what: "several periods of tones that do not repeat".into(),
            });
        }
        in_arithmetic(
            system,
            Over {
                motion: self,
                system,
                periods,
            },
        )
    }

    /// Runs to time `end` within the same drive period.
    pub(crate) fn run_until<O: Observer>(
        &mut self,
        system: &System,
        end: f64,
        observer: &mut O,
    ) -> Result<(), FlowError> {
        in_arithmetic(
            system,
            Until {
                motion: self,
                system,
                end,
                observer,
            },
        )
    }

    fn coordinate(&self, k: usize) -> Complex {
        layout::get(&self.packed, k)
    }

    fn set_coordinate(&mut self, k: usize, q: Complex) {
        layout::set(&mut self.packed, k, q);
    }

    /// Packs `self.modal`; phasors are zero afterwards.
    fn store_modal(&mut self, system: &System) {
        let count = self.modal.len() + system.drive().frequencies().len();
        self.packed.clear();
        let vectors = layout::vectors_for(count);
        self.packed.resize(vectors, ComplexVector::default());
        for k in 0..self.modal.len() {
            self.set_coordinate(k, self.modal[k]);
        }
    }

    fn load_modal(&mut self, count: usize) {
        self.modal.clear();
        for k in 0..count {
            self.modal.push(self.coordinate(k));
        }
    }

    pub(crate) fn set_phasors(&mut self, system: &System) {
        let modes = system.regimes()[self.regime].basis().len();
        for k in 0..system.drive().frequencies().len() {
            self.set_coordinate(modes + k, system.drive().phasor(k, self.phase));
        }
    }

    /// Begins a drive period: sets phase and phasors, which are carried from switch to switch, to
    /// their exact values at phase 0.
    #[inline(always)]
    fn begin_period(&mut self, system: &System) {
        self.phase = 0.0;
        let modes = system.regimes()[self.regime].basis().len();
        for k in 0..system.drive().frequencies().len() {
            self.set_coordinate(modes + k, Complex::new(1.0, 0.0));
        }
    }

    #[inline(always)]
    fn run_over<S: Simd>(&mut self, system: &System, periods: usize) -> Result<(), FlowError> {
        let (mut left, mut stalled) = (periods, 0);
        while left > 0 {
            self.run_stretch::<S>(system, &mut left, &mut stalled)?;
        }
        Ok(())
    }

    /// Advances to the next switch, or as far as a switch can be searched for at once, with `left`
    /// periods (including the present one) still to run. It passes at most one end of a period,
    /// which is counted.
    #[inline(always)]
    pub(crate) fn run_stretch<S: Simd>(
        &mut self,
        system: &System,
        left: &mut usize,
        stalled: &mut u32,
    ) -> Result<(), FlowError> {
        system.check_cancel()?;
        let period = system.drive().period();
        let ends = if *left > 1 {
            [self.phase + period, f64::INFINITY]
        } else {
            [period; 2]
        };
        let reach = self.reach::<S>(system, ends[0]);
        let found = self.next_crossing::<S>(system, reach)?;
        self.go_on::<S, ()>(system, ends[1], reach, found, stalled, &mut ())?;
        if count_period(&mut self.phase, left, system.drive()) {
            self.set_phasors(system);
        }
        Ok(())
    }

    #[inline(always)]
    fn run<S: Simd, O: Observer>(
        &mut self,
        system: &System,
        end: f64,
        observer: &mut O,
    ) -> Result<(), FlowError> {
        let mut stalled = 0;
        while self.phase < end {
            system.check_cancel()?;
            let reach = self.reach::<S>(system, end);
            let found = self.next_crossing::<S>(system, reach)?;
            self.go_on::<S, O>(system, end, reach, found, &mut stalled, observer)?;
        }
        Ok(())
    }

    /// Returns how far ahead, on the way to `end`, a switch can be searched for at once.
    #[inline(always)]
    fn reach<S: Simd>(&self, system: &System, end: f64) -> f64 {
        let left = end - self.phase;
        if S::LIBRARY {
            left
        } else {
            left.min(system.table_reach(self.regime))
        }
    }

    /// Advances to the switch found within `reach`, or to the end of the search.
    #[inline(always)]
    fn go_on<S: Simd, O: Observer>(
        &mut self,
        system: &System,
        end: f64,
        reach: f64,
        found: Option<(usize, Crossing)>,
        stalled: &mut u32,
        observer: &mut O,
    ) -> Result<(), FlowError> {
        let to_the_end = reach >= end - self.phase;
        let length = found.map_or(reach, |(_, crossing)| crossing.at);
        self.pass::<S, O>(system, length, observer);
        let Some((transition, crossing)) = found else {
            if to_the_end {
                self.phase = end;
            }
            return Ok(());
        };
        // Impacts that may end in sticking are followed until they do.
        let sticks = system.prepared(self.regime)[transition].sticking.is_some();
        let brief = if sticks { 0.0 } else { BRIEF } / system.fastest();
        *stalled = if length <= brief.max(f64::EPSILON * system.drive().period()) {
            *stalled + 1
        } else {
            0
        };
        if *stalled > STALLED_SWITCHES {
            return Err(FlowError::Accumulation { time: self.phase });
        }
        if sticks && self.longest_passed_touch > 0.0 {
            let left = (end - self.phase).min(self.longest_passed_touch);
            if let Some(touch) = self.touch(system, transition, crossing, left) {
                self.pass::<S, O>(system, touch, observer);
                self.surface = Some((transition, Start::Surface { rate: None }));
                return Ok(());
            }
        }
        self.switch::<S, O>(system, transition, crossing, observer);
        Ok(())
    }

    /// Returns the earliest transition within `left`. It is compiled once per arithmetic, not for
    /// every observer, since it is the largest part of the inner loop.
    #[inline(always)]
    fn next_crossing<S: Simd>(
        &mut self,
        system: &System,
        left: f64,
    ) -> Result<Option<(usize, Crossing)>, FlowError> {
        S::apart(NextCrossing {
            motion: self,
            system,
            left,
        })
    }

    #[inline(always)]
    fn next_crossing_with<S: Simd>(
        &mut self,
        system: &System,
        left: f64,
    ) -> Result<Option<(usize, Crossing)>, FlowError> {
        let regime = &system.regimes()[self.regime];
        let clustered = !regime.basis().clusters.is_empty();
        if clustered {
            self.load_modal(regime.basis().len());
        }
        let mut earliest: Option<(usize, Crossing)> = None;
        for (e, transition) in system.prepared(self.regime).iter().enumerate() {
            let horizon = earliest.map_or(left, |(_, c)| c.at);
            if clustered {
                self.signal = Signal::of(
                    regime,
                    system.drive(),
                    &transition.guard,
                    &self.modal,
                    self.phase,
                    horizon,
                );
            } else {
                self.signal
                    .refill::<S>(&transition.kernel, &self.packed, horizon);
            }
            if !self.signal.is_finite() {
                return Err(FlowError::Diverged { time: self.phase });
            }
            let start = self.start_of(e);
            let found = match &transition.table {
                Some(table) if !S::LIBRARY => on_table::first_crossing::<S>(
                    table,
                    &mut self.signal,
                    &mut self.followed,
                    horizon,
                    start,
                    &mut self.statistics,
                ),
                _ => BySteps {
                    signal: &self.signal,
                    length: horizon,
                    from: 0.0,
                    limit: horizon,
                    start,
                    statistics: &mut self.statistics,
                }
                .run::<S>(),
            };
            if let Some(crossing) = found {
                earliest = Some((e, crossing));
            }
        }
        Ok(earliest)
    }

    /// Returns how the guard of transition `transition` starts.
    #[inline(always)]
    fn start_of(&self, transition: usize) -> Start {
        match self.surface {
            Some((surface, start)) if surface == transition => start,
            _ => Start::Inside,
        }
    }

    /// Advances by `length` within the regime.
    #[inline(always)]
    fn pass<S: Simd, O: Observer>(&mut self, system: &System, length: f64, observer: &mut O) {
        let basis = system.regimes()[self.regime].basis();
        self.set_turns::<S>(system, length);
        if !O::IDLE || !basis.clusters.is_empty() {
            self.load_modal(basis.len());
            self.factors.clear();
            for k in 0..basis.len() {
                self.factors.push(layout::get(&self.turns, k));
            }
            observer.segment(&SegmentView {
                system,
                regime: self.regime,
                phase: self.phase,
                length,
                modal: &self.modal,
                factors: &self.factors,
                packed: &self.packed,
                turns: &self.turns,
            });
        }
        for (q, [re, im]) in self.packed.iter_mut().zip(&self.turns) {
            let turn = [S::load(re), S::load(im)];
            let turned = simd::complex_mul::<S>([S::load(&q[0]), S::load(&q[1])], turn);
            *q = [S::store(turned[0]), S::store(turned[1])];
        }
        if !basis.clusters.is_empty() {
            // Coordinates whose eigenvalues coincide mix.
            basis.apply(&mut self.modal, length, &self.factors);
            for k in 0..self.modal.len() {
                self.set_coordinate(k, self.modal[k]);
            }
        }
        self.phase += length;
        if length > 0.0 {
            self.surface = None;
        }
    }

    /// Sets `turns` to `e^{λ_k · length}`, from the last evaluation of the search for the switch if
    /// that was close enough.
    #[inline(always)]
    fn set_turns<S: Simd>(&mut self, system: &System, length: f64) {
        let rates = &system.packed_rates()[self.regime];
        self.turns.resize(rates.len(), ComplexVector::default());
        let near = |at: f64| (length - at).abs() * system.fastest() < simd::SMALL_ANGLE;
        let kept = self.signal.kept_factors().filter(|(at, _)| near(*at));
        if let Some((at, factors)) = kept {
            let rest = S::splat(length - at);
            for ((turn, [re, im]), [decay, frequency]) in
                self.turns.iter_mut().zip(factors).zip(rates)
            {
                let rest = [
                    S::mul(S::load(decay), rest),
                    S::mul(S::load(frequency), rest),
                ];
                let rest = simd::exp_small::<S>(rest);
                let full = simd::complex_mul::<S>([S::load(re), S::load(im)], rest);
                *turn = [S::store(full[0]), S::store(full[1])];
            }
        } else {
            for (turn, [decay, frequency]) in self.turns.iter_mut().zip(rates) {
                let (decay, frequency) = (S::load(decay), S::load(frequency));
                let full = simd::exp_complex::<S>(decay, frequency, S::splat(length));
                *turn = [S::store(full[0]), S::store(full[1])];
            }
        }
    }

    /// Applies transition `transition`: its reset, and the change of modal coordinates.
    #[inline(always)]
    fn switch<S: Simd, O: Observer>(
        &mut self,
        system: &System,
        transition: usize,
        crossing: Crossing,
        observer: &mut O,
    ) {
        self.switches += 1;
        let description = &system.transitions()[self.regime][transition];
        let prepared = &system.prepared(self.regime)[transition];
        let stuck =
            prepared.acceleration.is_some() && self.chatter_ends(system, transition, crossing);
        self.releases += u64::from(description.release);
        let (switch, reverse) = match (&prepared.sticking, stuck) {
            (Some(sticking), true) => (sticking, prepared.sticking_reverse),
            _ => (&prepared.switch, prepared.reverse),
        };
        if !O::IDLE {
            self.load_modal(system.regimes()[self.regime].basis().len());
            observer.switch(&SwitchView {
                system,
                switch,
                transition,
                stuck,
                phase: self.phase,
                rate: crossing.rate,
                grazing: crossing.grazing,
                modal: &self.modal,
            });
        }
        let onset = description
            .onset
            .and_then(|onset| self.onset(system, description, onset, crossing));
        self.change_basis::<S>(switch);
        if stuck {
            self.set_on_stop(system, &description.guard, switch.to);
        }
        self.surface = onset.or_else(|| {
            reverse.map(|reverse| {
                let start = if description.release {
                    Start::Release
                } else {
                    // Of a state that is continuous, known better than from the sums.
                    let rate = switch.rate_after.filter(|_| crossing.refined);
                    let rate = rate.map(|after| -after.of(crossing.rate));
                    Start::Surface { rate }
                };
                (reverse, start)
            })
        });
        self.regime = switch.to;
    }

    /// Returns how long the guard of a rigid stop would stay below zero without the stop, if it
    /// rises again within `longest`.
    fn touch(
        &mut self,
        system: &System,
        transition: usize,
        crossing: Crossing,
        longest: f64,
    ) -> Option<f64> {
        let regime = &system.regimes()[self.regime];
        let guard = &system.prepared(self.regime)[transition].guard;
        self.load_modal(regime.basis().len());
        let of = |length| {
            let drive = system.drive();
            Signal::of(regime, drive, guard, &self.modal, self.phase, length)
        };
        let rate = of(longest).differentiated(longest);
        let curvature = rate.differentiated(longest).at(0.0);
        // To leading order.
        let expected = -2.0 * crossing.rate / curvature;
        let comes_back = curvature > 0.0 && expected <= 0.5 * longest;
        if !comes_back {
            return None;
        }
        if expected * system.fastest() <= SHORTEST_TOUCH {
            return Some(expected.max(0.0));
        }
        let signal = of(2.0 * expected);
        let changes = sign_changes(&signal, 2.0 * expected);
        changes.into_iter().find(|at| *at >= 0.5 * expected)
    }

    /// Returns how a guard of the next regime starts whose initial value is known exactly; `None`
    /// if it is well inside.
    fn onset(
        &mut self,
        system: &System,
        taken: &Transition,
        onset: Onset,
        crossing: Crossing,
    ) -> Option<(usize, Start)> {
        let mut state = std::mem::take(&mut self.scratch);
        self.write_state(system, &mut state);
        let found = match onset {
            Onset::AtRest(transition) => {
                // A start beyond the guard's zero leaves at the rate that it has.
                let beyond = crossing.at == 0.0
                    && taken.guard.at(system.drive(), &state, self.phase)
                        < -ON_SURFACE * rounding(&taken.guard, &state);
                let rate = (!beyond).then_some(0.0);
                Some((transition, Start::Surface { rate }))
            }
            Onset::Proportional { transition, factor } => {
                let guard = &system.transitions()[taken.target][transition].guard;
                (factor * crossing.rate <= ON_SURFACE * rounding(guard, &state))
                    .then_some((transition, Start::Surface { rate: None }))
            }
        };
        self.scratch = state;
        found
    }

    /// Reports whether this impact is so slow, and the acceleration towards the stop so large, that
    /// the rest of the sequence is below rounding.
    fn chatter_ends(&mut self, system: &System, transition: usize, crossing: Crossing) -> bool {
        let prepared = &system.prepared(self.regime)[transition];
        let Some(acceleration) = &prepared.acceleration else {
            return false;
        };
        let mut state = std::mem::take(&mut self.scratch);
        self.write_state(system, &mut state);
        let pressed = -acceleration.at(system.drive(), &state, self.phase);
        self.scratch = state;
        let fastest = self
            .signal
            .fastest()
            .max(std::f64::consts::TAU / system.drive().period());
        // Flights last about 2|ġ|/a; a must keep its sign for far longer than that.
        pressed > 0.0 && -crossing.rate * fastest <= CHATTER_RESOLUTION * pressed
    }

    /// Sets a motion that comes to rest on a rigid stop exactly on it: all sticking motions are
    /// then equal, independent of earlier rounding errors.
    fn set_on_stop(&mut self, system: &System, guard: &Output, to: usize) {
        let (regime, drive) = (&system.regimes()[to], system.drive());
        let mut state = std::mem::take(&mut self.scratch);
        let modal = (0..regime.basis().len()).map(|k| self.coordinate(k));
        regime.to_state(drive, modal, self.phase, &mut state);
        let off = guard.at(drive, &state, self.phase) / guard.row.norm_squared();
        for (x, row) in state.iter_mut().zip(guard.row.iter()) {
            *x -= off * row;
        }
        let mut modal = vec![Complex::new(0.0, 0.0); regime.basis().len()];
        let mut scratch = vec![0.0; state.len()];
        regime.to_modal(drive, &state, self.phase, &mut scratch, &mut modal);
        for (k, q) in modal.into_iter().enumerate() {
            self.set_coordinate(k, q);
        }
        self.scratch = state;
    }

    #[inline(always)]
    fn change_basis<S: Simd>(&mut self, switch: &Switch) {
        switch.packed.apply::<S>(&self.packed, &mut self.next);
        std::mem::swap(&mut self.packed, &mut self.next);
    }
}

/// Reports whether a drive period has ended at `phase`. If so, counts it and sets the phase to that
/// in the next period; after the last period the phase is zero. Under tones that do not repeat it
/// stays.
#[inline(always)]
pub(crate) fn count_period(phase: &mut f64, left: &mut usize, drive: &Drive) -> bool {
    let period = drive.period();
    let ended = *phase >= period;
    if ended {
        *phase = match (drive.repeats(), *left > 1) {
            (false, _) => period,
            (true, true) => *phase - period,
            (true, false) => 0.0,
        };
        *left -= 1;
    }
    ended
}

/// Runs the work in the arithmetic that suits the system: with library functions if angles are too
/// large for the built-in ones.
fn in_arithmetic<W: Work>(system: &System, work: W) -> W::Output {
    if system.largest_angle() > simd::LARGEST_ANGLE {
        work.run::<Library>()
    } else {
        simd::dispatch(work)
    }
}

/// The arguments of [`Motion::run_until`], for the dispatch to an arithmetic.
struct Until<'a, O> {
    motion: &'a mut Motion,
    system: &'a System,
    end: f64,
    observer: &'a mut O,
}

impl<O: Observer> Work for Until<'_, O> {
    type Output = Result<(), FlowError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        self.motion
            .run::<S, O>(self.system, self.end, self.observer)
    }
}

/// The arguments of [`Motion::run_periods`], for the dispatch to an arithmetic.
struct Over<'a> {
    motion: &'a mut Motion,
    system: &'a System,
    periods: usize,
}

impl Work for Over<'_> {
    type Output = Result<(), FlowError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        self.motion.run_over::<S>(self.system, self.periods)
    }
}

/// The arguments of the search for the earliest transition, for the dispatch to an arithmetic.
struct NextCrossing<'a> {
    motion: &'a mut Motion,
    system: &'a System,
    left: f64,
}

impl Work for NextCrossing<'_> {
    type Output = Result<Option<(usize, Crossing)>, FlowError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        self.motion.next_crossing_with::<S>(self.system, self.left)
    }
}
