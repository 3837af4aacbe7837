//! The inner loop: a motion from switch to switch in modal coordinates.
//!
//! A motion does not hold its system. Whoever runs it lends the system, so that threads which
//! share one need not count references to it every period.

use crate::crossing::{
    Crossing, Prospect, Start, Statistics, confirm_zero, evaluate_zero, first_crossing_on_lattice,
    first_crossing_with, prospect_on_lattice, whole_search,
};
use crate::flow::{Observer, SegmentView, SwitchView};
use crate::lattice::FallingZero;
#[cfg(target_arch = "x86_64")]
use crate::pack::Fused;
use crate::pack::{self, Library, Math, Pack, Plain, WIDTH};
use crate::signal::{Jet, Signal};
use crate::system::{Exit, ON_SURFACE, Onset, Switch, System, rounding};
use crate::{Complex, FlowError};

/// Where a motion of a [`System`] is, with the work space of going on.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    pub(crate) regime: usize,
    pub(crate) phase: f64,
    /// Modal coordinates, then the tones' phasors, packed: `[re, im]`.
    packed: Vec<[Pack; 2]>,
    /// The work space of a switch.
    next: Vec<[Pack; 2]>,
    /// `e^{λ_k s}` of the stretch that is passed.
    turns: Vec<[Pack; 2]>,
    /// The exit whose guard starts at zero, and how.
    surface: Option<(usize, Start)>,
    signal: Signal,
    /// For observers: modal coordinates and `e^{λ_k s}` as plain numbers.
    modal: Vec<Complex>,
    factors: Vec<Complex>,
    /// A state's length of work space.
    scratch: Vec<f64>,
    pub(crate) statistics: Statistics,
    pub(crate) switches: u64,
    fused: bool,
}

/// A search for the next switch under way.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pending {
    /// It is over.
    Settled(Option<(usize, Crossing)>),
    /// Where the switch is, all but certainly, and the guard there once it is evaluated.
    Zero(FallingZero, (Jet, f64)),
}

/// Switches in a row, hardly any time passing, before chatter is refused.
const STALLED_SWITCHES: u32 = 1000;
/// What counts as hardly any time, as a part of the fastest time scale: what switches again
/// and again so soon does not come to rest in between.
const BRIEF: f64 = 1e-6;
/// An impact sequence ends in sticking when its flights last less than this part
/// of the fastest time scale: what is left of it is below rounding (second order).
const CHATTER_RESOLUTION: f64 = 1e-8;

impl Motion {
    /// The work space of a motion of `system`; call [`Motion::start`] before running it.
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
            modal: Vec::with_capacity(largest),
            factors: Vec::with_capacity(largest),
            scratch: vec![0.0; system.dimension()],
            statistics: Statistics::default(),
            switches: 0,
            fused: pack::fused_available(),
        }
    }

    /// Puts the motion at state `x` (length `n`) and time `phase` within the period.
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
        self.pack_modal(system);
        self.set_phasors(system);
        Ok(())
    }

    /// Writes the state (length `n`) to `x`.
    pub(crate) fn write_state(&self, system: &System, x: &mut [f64]) {
        let regime = &system.regimes()[self.regime];
        let modal = (0..regime.basis().len()).map(|k| self.coordinate(k));
        regime.to_state(system.drive(), modal, self.phase, x);
    }

    /// Runs to the end of the drive period; the phase is then zero.
    pub(crate) fn run_period<O: Observer>(
        &mut self,
        system: &System,
        observer: &mut O,
    ) -> Result<(), FlowError> {
        self.run_until(system, system.drive().period(), observer)?;
        self.begin_period(system);
        observer.period_end();
        Ok(())
    }

    /// Runs over `periods` drive periods without stopping in between.
    pub(crate) fn run_periods(&mut self, system: &System, periods: usize) -> Result<(), FlowError> {
        if system.largest_angle() > pack::LARGEST_ANGLE {
            return self.run_over::<Library>(system, periods);
        }
        #[cfg(target_arch = "x86_64")]
        if self.fused {
            // SAFETY: `fused` is set only where the machine has these instructions.
            return unsafe { self.run_over_fused(system, periods) };
        }
        self.run_over::<Plain>(system, periods)
    }

    /// Runs to time `end` within the same drive period.
    pub(crate) fn run_until<O: Observer>(
        &mut self,
        system: &System,
        end: f64,
        observer: &mut O,
    ) -> Result<(), FlowError> {
        if system.largest_angle() > pack::LARGEST_ANGLE {
            return self.run::<Library, O>(system, end, observer);
        }
        #[cfg(target_arch = "x86_64")]
        if self.fused {
            // SAFETY: `fused` is set only where the machine has these instructions.
            return unsafe { self.run_fused(system, end, observer) };
        }
        self.run::<Plain, O>(system, end, observer)
    }

    fn coordinate(&self, k: usize) -> Complex {
        let [re, im] = &self.packed[k / WIDTH];
        Complex::new(re[k % WIDTH], im[k % WIDTH])
    }

    fn set_coordinate(&mut self, k: usize, q: Complex) {
        let [re, im] = &mut self.packed[k / WIDTH];
        re[k % WIDTH] = q.re;
        im[k % WIDTH] = q.im;
    }

    /// Packs `self.modal`; phasors are zero afterwards.
    fn pack_modal(&mut self, system: &System) {
        let count = self.modal.len() + system.drive().frequencies().len();
        self.packed.clear();
        self.packed.resize(count.div_ceil(WIDTH), [[0.0; WIDTH]; 2]);
        for k in 0..self.modal.len() {
            self.set_coordinate(k, self.modal[k]);
        }
    }

    fn unpack_modal(&mut self, count: usize) {
        self.modal.clear();
        for k in 0..count {
            self.modal.push(self.coordinate(k));
        }
    }

    fn set_phasors(&mut self, system: &System) {
        let modes = system.regimes()[self.regime].basis().len();
        for k in 0..system.drive().frequencies().len() {
            self.set_coordinate(modes + k, system.drive().phasor(k, self.phase));
        }
    }

    /// Sets phase and phasors, which are carried from switch to switch, right.
    #[inline(always)]
    pub(crate) fn begin_period(&mut self, system: &System) {
        self.phase = 0.0;
        let modes = system.regimes()[self.regime].basis().len();
        for k in 0..system.drive().frequencies().len() {
            self.set_coordinate(modes + k, Complex::new(1.0, 0.0));
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn run_over_fused(&mut self, system: &System, periods: usize) -> Result<(), FlowError> {
        self.run_over::<Fused>(system, periods)
    }

    #[inline(always)]
    fn run_over<M: Math>(&mut self, system: &System, periods: usize) -> Result<(), FlowError> {
        let (mut left, mut stalled) = (periods, 0);
        while left > 0 {
            let reach = self.reach_over::<M>(system, left);
            let found = self.next_crossing::<M>(system, reach)?;
            self.go_over::<M>(system, reach, found, &mut left, &mut stalled)?;
        }
        Ok(())
    }

    /// How far it may be looked for a switch at once with `left` periods, this one included,
    /// still to run: never over more than one period's end.
    #[inline(always)]
    pub(crate) fn reach_over<M: Math>(&self, system: &System, left: usize) -> f64 {
        let period = system.drive().period();
        if left > 1 {
            self.reach::<M>(system, self.phase + period)
        } else {
            self.reach::<M>(system, period)
        }
    }

    /// Moves on to the switch that was found within `reach`, or to where the search ended,
    /// and counts the period that ends on the way.
    #[inline(always)]
    pub(crate) fn go_over<M: Math>(
        &mut self,
        system: &System,
        reach: f64,
        found: Option<(usize, Crossing)>,
        left: &mut usize,
        stalled: &mut u32,
    ) -> Result<(), FlowError> {
        let period = system.drive().period();
        let end = if *left > 1 { f64::INFINITY } else { period };
        self.go_on::<M, ()>(system, end, reach, found, stalled, &mut ())?;
        if self.phase >= period {
            if *left > 1 {
                self.phase -= period;
                self.set_phasors(system);
            } else {
                self.begin_period(system);
            }
            *left -= 1;
        }
        Ok(())
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn run_fused<O: Observer>(
        &mut self,
        system: &System,
        end: f64,
        observer: &mut O,
    ) -> Result<(), FlowError> {
        self.run::<Fused, O>(system, end, observer)
    }

    #[inline(always)]
    fn run<M: Math, O: Observer>(
        &mut self,
        system: &System,
        end: f64,
        observer: &mut O,
    ) -> Result<(), FlowError> {
        let mut stalled = 0;
        while self.phase < end {
            let reach = self.reach::<M>(system, end);
            let found = self.next_crossing::<M>(system, reach)?;
            self.go_on::<M, O>(system, end, reach, found, &mut stalled, observer)?;
        }
        Ok(())
    }

    /// How far it may be looked for a switch at once on the way to `end`.
    #[inline(always)]
    pub(crate) fn reach<M: Math>(&self, system: &System, end: f64) -> f64 {
        let left = end - self.phase;
        if M::LIBRARY {
            left
        } else {
            left.min(system.lattice_reach(self.regime))
        }
    }

    /// Moves on to the switch that was found within `reach`, or to where the search ended.
    #[inline(always)]
    pub(crate) fn go_on<M: Math, O: Observer>(
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
        self.pass::<M, O>(system, length, observer);
        let Some((exit, crossing)) = found else {
            if to_the_end {
                self.phase = end;
            }
            return Ok(());
        };
        // Impacts that may end in sticking are followed until they do.
        let sticks = system.prepared(self.regime)[exit].sticking.is_some();
        let brief = if sticks { 0.0 } else { BRIEF } / system.fastest();
        *stalled = if length <= brief.max(f64::EPSILON * system.drive().period()) {
            *stalled + 1
        } else {
            0
        };
        if *stalled > STALLED_SWITCHES {
            return Err(FlowError::Accumulation { time: self.phase });
        }
        self.switch::<M, O>(system, exit, crossing, observer);
        Ok(())
    }

    /// The earliest exit within `left`. Compiled once for each arithmetic, not again for
    /// every observer: it is the largest part of the inner loop.
    #[inline(always)]
    fn next_crossing<M: Math>(
        &mut self,
        system: &System,
        left: f64,
    ) -> Result<Option<(usize, Crossing)>, FlowError> {
        #[cfg(target_arch = "x86_64")]
        if M::FUSED {
            // SAFETY: this arithmetic is in use only where the machine has it.
            return unsafe { self.next_crossing_fused(system, left) };
        }
        if M::LIBRARY {
            self.next_crossing_library(system, left)
        } else {
            self.next_crossing_plain(system, left)
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[inline(never)]
    fn next_crossing_fused(
        &mut self,
        system: &System,
        left: f64,
    ) -> Result<Option<(usize, Crossing)>, FlowError> {
        self.next_crossing_with::<Fused>(system, left)
    }

    #[inline(never)]
    fn next_crossing_plain(
        &mut self,
        system: &System,
        left: f64,
    ) -> Result<Option<(usize, Crossing)>, FlowError> {
        self.next_crossing_with::<Plain>(system, left)
    }

    #[inline(never)]
    fn next_crossing_library(
        &mut self,
        system: &System,
        left: f64,
    ) -> Result<Option<(usize, Crossing)>, FlowError> {
        self.next_crossing_with::<Library>(system, left)
    }

    #[inline(always)]
    fn next_crossing_with<M: Math>(
        &mut self,
        system: &System,
        left: f64,
    ) -> Result<Option<(usize, Crossing)>, FlowError> {
        let regime = &system.regimes()[self.regime];
        let clustered = !regime.basis().clusters.is_empty();
        if clustered {
            self.unpack_modal(regime.basis().len());
        }
        let mut earliest: Option<(usize, Crossing)> = None;
        for (e, exit) in system.prepared(self.regime).iter().enumerate() {
            let horizon = earliest.map_or(left, |(_, c)| c.at);
            if clustered {
                self.signal = Signal::of(
                    regime,
                    system.drive(),
                    &exit.guard,
                    &self.modal,
                    self.phase,
                    horizon,
                );
            } else {
                self.signal.refill::<M>(&exit.kernel, &self.packed, horizon);
            }
            if !self.signal.is_finite() {
                return Err(FlowError::Diverged { time: self.phase });
            }
            let start = self.start_of(e);
            let found = match &exit.lattice {
                Some(lattice) if !M::LIBRARY => first_crossing_on_lattice::<M>(
                    lattice,
                    &mut self.signal,
                    horizon,
                    start,
                    &mut self.statistics,
                ),
                _ => first_crossing_with::<M>(&self.signal, horizon, start, &mut self.statistics),
            };
            if let Some(crossing) = found {
                earliest = Some((e, crossing));
            }
        }
        Ok(earliest)
    }

    /// The first half of the search for the next switch: what can be said before an
    /// exponential is computed. Regimes of one exit are searched so whose lattice follows all
    /// terms; others at once.
    #[inline(always)]
    pub(crate) fn prospect<M: Math>(
        &mut self,
        system: &System,
        reach: f64,
    ) -> Result<Pending, FlowError> {
        let clustered = !system.regimes()[self.regime].basis().clusters.is_empty();
        let ([exit], false) = (system.prepared(self.regime), clustered || M::LIBRARY) else {
            return self.next_crossing::<M>(system, reach).map(Pending::Settled);
        };
        let Some(lattice) = exit.lattice.as_ref().filter(|l| l.is_complete()) else {
            return self.next_crossing::<M>(system, reach).map(Pending::Settled);
        };
        self.signal.refill::<M>(&exit.kernel, &self.packed, reach);
        if !self.signal.is_finite() {
            return Err(FlowError::Diverged { time: self.phase });
        }
        let start = self.start_of(0);
        let statistics = &mut self.statistics;
        let prospect =
            prospect_on_lattice::<M>(lattice, &mut self.signal, reach, start, statistics);
        Ok(match prospect {
            Prospect::Settled(found) => Pending::Settled(found.map(|crossing| (0, crossing))),
            Prospect::Zero(zero) => Pending::Zero(zero, (Jet::default(), 0.0)),
        })
    }

    /// Evaluates what [`Motion::prospect`] left for it.
    #[inline(always)]
    pub(crate) fn evaluate<M: Math>(&mut self, pending: &mut Pending) {
        if let Pending::Zero(zero, evaluated) = pending {
            *evaluated = evaluate_zero::<M>(zero, &mut self.signal, &mut self.statistics);
        }
    }

    /// The second half of the search.
    #[inline(always)]
    pub(crate) fn settle<M: Math>(
        &mut self,
        system: &System,
        reach: f64,
        pending: &Pending,
    ) -> Option<(usize, Crossing)> {
        let (zero, evaluated) = match pending {
            Pending::Settled(found) => return *found,
            Pending::Zero(zero, evaluated) => (zero, *evaluated),
        };
        let confirmed = confirm_zero(zero, evaluated, &self.signal, reach);
        let found = match (confirmed, &system.prepared(self.regime)[0].lattice) {
            (Some(decision), _) => decision.crossing(),
            (None, Some(lattice)) => {
                let start = self.start_of(0);
                let statistics = &mut self.statistics;
                whole_search::<M>(lattice, &mut self.signal, reach, start, statistics)
            }
            (None, None) => None,
        };
        found.map(|crossing| (0, crossing))
    }

    /// How the motion stands to the guard of exit `exit`.
    #[inline(always)]
    fn start_of(&self, exit: usize) -> Start {
        match self.surface {
            Some((surface, start)) if surface == exit => start,
            _ => Start::Inside,
        }
    }

    /// Moves on by `length` within the regime.
    #[inline(always)]
    fn pass<M: Math, O: Observer>(&mut self, system: &System, length: f64, observer: &mut O) {
        let basis = system.regimes()[self.regime].basis();
        self.set_turns::<M>(system, length);
        if !O::IDLE || !basis.clusters.is_empty() {
            self.unpack_modal(basis.len());
            self.factors.clear();
            for k in 0..basis.len() {
                let [re, im] = &self.turns[k / WIDTH];
                self.factors
                    .push(Complex::new(re[k % WIDTH], im[k % WIDTH]));
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
            let turn = [M::load(re), M::load(im)];
            let turned = pack::complex_mul::<M>([M::load(&q[0]), M::load(&q[1])], turn);
            *q = [M::store(turned[0]), M::store(turned[1])];
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

    /// Sets `turns` to `e^{λ_k · length}`, from what the search for the switch evaluated last
    /// if that was near enough.
    #[inline(always)]
    fn set_turns<M: Math>(&mut self, system: &System, length: f64) {
        let rates = &system.packed_rates()[self.regime];
        self.turns.resize(rates.len(), [[0.0; WIDTH]; 2]);
        let near = |at: f64| (length - at).abs() * system.fastest() < pack::SMALL_ANGLE;
        let kept = self.signal.kept_factors().filter(|(at, _)| near(*at));
        if let Some((at, factors)) = kept {
            let rest = M::splat(length - at);
            for ((turn, [re, im]), [decay, frequency]) in
                self.turns.iter_mut().zip(factors).zip(rates)
            {
                let rest = [
                    M::mul(M::load(decay), rest),
                    M::mul(M::load(frequency), rest),
                ];
                let rest = pack::exp_small::<M>(rest);
                let full = pack::complex_mul::<M>([M::load(re), M::load(im)], rest);
                *turn = [M::store(full[0]), M::store(full[1])];
            }
        } else {
            for (turn, [decay, frequency]) in self.turns.iter_mut().zip(rates) {
                let (decay, frequency) = (M::load(decay), M::load(frequency));
                let full = pack::exp_complex::<M>(decay, frequency, M::splat(length));
                *turn = [M::store(full[0]), M::store(full[1])];
            }
        }
    }

    /// Takes exit `exit`.
    #[inline(always)]
    fn switch<M: Math, O: Observer>(
        &mut self,
        system: &System,
        exit: usize,
        crossing: Crossing,
        observer: &mut O,
    ) {
        self.switches += 1;
        let description = &system.exits()[self.regime][exit];
        let prepared = &system.prepared(self.regime)[exit];
        let stuck = prepared.acceleration.is_some() && self.chatter_ends(system, exit, crossing);
        let (switch, twin) = match (&prepared.sticking, stuck) {
            (Some(sticking), true) => (sticking, prepared.sticking_twin),
            _ => (&prepared.switch, prepared.twin),
        };
        if !O::IDLE {
            self.unpack_modal(system.regimes()[self.regime].basis().len());
            observer.switch(&SwitchView {
                system,
                switch,
                exit,
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
        self.change_basis::<M>(switch);
        self.surface = onset.or_else(|| {
            twin.map(|twin| {
                let start = if description.release {
                    Start::Release
                } else if description.reset.is_none() && crossing.refined {
                    // The rate is continuous and here known better than from the sums.
                    Start::Surface {
                        rate: Some(-crossing.rate),
                    }
                } else {
                    Start::Surface { rate: None }
                };
                (twin, start)
            })
        });
        self.regime = switch.to;
    }

    /// How the guard of the next regime starts of which something is known; `None` where
    /// it is well inside.
    fn onset(
        &mut self,
        system: &System,
        taken: &Exit,
        onset: Onset,
        crossing: Crossing,
    ) -> Option<(usize, Start)> {
        let mut state = std::mem::take(&mut self.scratch);
        self.write_state(system, &mut state);
        let found = match onset {
            Onset::AtRest(exit) => {
                // A start beyond the guard's zero leaves at the rate that it has.
                let beyond = crossing.at == 0.0
                    && taken.guard.at(system.drive(), &state, self.phase)
                        < -ON_SURFACE * rounding(&taken.guard, &state);
                let rate = (!beyond).then_some(0.0);
                Some((exit, Start::Surface { rate }))
            }
            Onset::Proportional { exit, factor } => {
                let guard = &system.exits()[taken.target][exit].guard;
                (factor * crossing.rate <= ON_SURFACE * rounding(guard, &state))
                    .then_some((exit, Start::Surface { rate: None }))
            }
        };
        self.scratch = state;
        found
    }

    /// Whether this impact is so slow, and pressed so firmly, that the rest of the
    /// sequence is below rounding.
    fn chatter_ends(&mut self, system: &System, exit: usize, crossing: Crossing) -> bool {
        let prepared = &system.prepared(self.regime)[exit];
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

    #[inline(always)]
    fn change_basis<M: Math>(&mut self, switch: &Switch) {
        switch.packed.apply::<M>(&self.packed, &mut self.next);
        std::mem::swap(&mut self.packed, &mut self.next);
    }
}
