//! Many motions of one system, eight at a time: each has a lane of a vector register.
//!
//! The motions are not synchronous: one may be in flight while another is in contact, and they switch
//! at different times. Motions in the same regime are searched for their next switches together, at
//! any drive phase, since time is counted from the last switch. Operations with long latency
//! (divisions, the exponentials of a time that has just been found) are thereby done for eight at once.
//!
//! The lanes share the common case: a stretch that a table certifies, ended by a switch that a few
//! evaluations locate. In any other case (a grazing touch, a shallow dip, an end within the interval of
//! a switch) the lane follows this stretch alone, as [`Flow`](crate::Flow) does. The result of a motion
//! does not depend on the others in the batch.

use crate::motion::{BRIEF, Motion, count_period};
use crate::regime::Kernel;
use crate::search::Start;
use crate::search::interval::{Cubic, Quintic};
use crate::search::near::Near;
use crate::search::side_by_side::{self, Intervals, Signals};
use crate::search::tabulated::Table;
use crate::search::walk::Bounds;
use crate::signal::NOISE;
use crate::simd::{
    self, ComplexOctet, ComplexVector, LANES, LARGEST_ANGLE, Octet, SMALL_ANGLE, Simd, Wide,
    WideWork, layout,
};
use crate::system::{PreparedTransition, System};
use crate::{FlowError, Regime};
use std::collections::VecDeque;
use std::sync::Arc;

/// Number of evaluations of the guard near a switch after which a lane is followed alone.
const MAX_EVALUATIONS: usize = 3;

/// The work space of many motions of a [`System`]. Cloning shares the system.
#[derive(Clone, Debug)]
pub struct Ensemble {
    system: Arc<System>,
    /// Whether its motions can be followed eight at a time.
    fits: bool,
    /// Motion that follows single lanes, and starts and ends all of them.
    alone: Motion,
    members: Vec<Member>,
    /// Members waiting in each regime, by number.
    waiting: Vec<VecDeque<usize>>,
    pack: Pack,
    stretches: Stretches,
    /// States at the ends of periods, if they are requested.
    strobe: Option<Strobe>,
}

/// The states of all members at the ends of their periods.
#[derive(Clone, Debug)]
struct Strobe {
    /// States of each member, in sequence.
    passed: Vec<Vec<f64>>,
    /// Forced response of each regime at phase 0.
    responses: Vec<Vec<f64>>,
    /// States at the end of the period in which the present stretch begins, one lane each.
    now: Vec<Octet>,
}

/// Numbers of stretches between switches that were followed eight at a time and alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stretches {
    /// Number of stretches that were followed eight at a time.
    pub together: u64,
    /// Number of stretches that were followed one at a time, as [`Flow`](crate::Flow) does.
    pub alone: u64,
}

/// One motion: the lane's part of a [`Motion`].
#[derive(Clone, Debug)]
struct Member {
    regime: usize,
    phase: f64,
    packed: Vec<ComplexVector>,
    surface: Option<(usize, Start)>,
    /// Number of periods still to run, the present one included.
    left: usize,
    stalled: u32,
    failure: Option<FlowError>,
}

/// The work space of eight motions in one regime, one lane each.
#[derive(Clone, Debug, Default)]
struct Pack {
    /// Modal coordinates and phasors, and those after the switch.
    coordinates: Vec<ComplexOctet>,
    switched: Vec<ComplexOctet>,
    /// Amplitudes of all terms of the guard.
    amplitudes: Vec<ComplexOctet>,
    /// `e^{λ_k s}` at the times that were evaluated last.
    factors: Vec<ComplexOctet>,
}

/// Sums over the amplitudes of the guard in each lane.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// Sum of the terms' absolute values, constant included.
    size: Octet,
    /// Bound of the third derivative of the guard.
    third: Octet,
    /// Rate of the guard at the start.
    rate: Octet,
    /// Sums with the table's weights of the fine grid.
    weighted: [Octet; 4],
}

/// The next switch of each lane, as far as the search determined it.
struct Switches {
    /// Lanes that reach a switch, one bit each.
    found: u32,
    /// Lanes in which the switch is not certain, one bit each.
    uncertain: u32,
    /// Time of the switch from the start of the stretch, or the time at which the search ended.
    at: Octet,
    /// Remaining time from the last evaluation of the exponentials to `at`.
    rest: Octet,
}

impl Ensemble {
    /// Creates an ensemble of motions of `system`.
    pub fn new(system: Arc<System>) -> Self {
        Self {
            fits: Self::fits(&system),
            alone: Motion::new(&system),
            members: Vec::new(),
            waiting: vec![VecDeque::new(); system.regimes().len()],
            pack: Pack::default(),
            stretches: Stretches::default(),
            strobe: None,
            system,
        }
    }

    /// Reports whether motions of `system` can be followed eight at a time: each regime must have
    /// exactly one guard, which is tabulated and about which nothing is known except that it starts
    /// at zero. Motions of other systems run in sequence.
    pub fn fits(system: &System) -> bool {
        let simple = |regime: usize| {
            let ([prepared], [transition]) = (
                system.prepared(regime),
                system.transitions()[regime].as_slice(),
            ) else {
                return false;
            };
            prepared.table.as_ref().is_some_and(side_by_side::fits)
                && prepared.sticking.is_none()
                && !transition.release
                && transition.onset.is_none()
        };
        system.largest_angle() <= LARGEST_ANGLE && (0..system.regimes().len()).all(simple)
    }

    /// Returns the numbers of stretches so far, of systems whose motions can be followed together.
    pub fn stretches(&self) -> Stretches {
        self.stretches
    }

    /// Advances each state (row by row, of length `n`, at phase 0) by its number of drive periods in
    /// `periods`. If a motion cannot be followed, its state is unchanged and the reason is returned.
    ///
    /// # Panics
    /// If the numbers of states and of `periods` differ.
    pub fn advance(&mut self, states: &mut [f64], periods: &[usize]) -> Vec<Result<(), FlowError>> {
        let n = self.system.dimension();
        assert_eq!(states.len(), n * periods.len(), "a state for each motion");
        if !self.fits {
            let each = states.chunks_exact_mut(n).zip(periods);
            return each
                .map(|(x, &periods)| self.advance_alone(x, periods))
                .collect();
        }
        // Lent to the inner loop: threads that share it need not count references to it.
        let system = Arc::clone(&self.system);
        self.begin(&system, states, periods);
        simd::dispatch_wide(RunAll(self, &system));
        self.end(&system, states, periods)
    }

    /// Advances the states as [`Ensemble::advance`], and writes the states of each motion at the
    /// ends of all its periods, in sequence, to its entry of `passed`, which is cleared first. The
    /// last of them is the final state, unless the motion could not be followed to the end.
    ///
    /// # Panics
    /// If the numbers of states, of entries in `passed` and of `periods` differ.
    pub fn advance_through(
        &mut self,
        states: &mut [f64],
        periods: &[usize],
        passed: &mut [Vec<f64>],
    ) -> Vec<Result<(), FlowError>> {
        assert_eq!(passed.len(), periods.len(), "a place for each motion");
        if !self.fits {
            let n = self.system.dimension();
            let each = states.chunks_exact_mut(n).zip(periods).zip(passed);
            let through = each.map(|((x, &periods), passed)| {
                passed.clear();
                (0..periods).try_for_each(|_| {
                    self.advance_alone(x, 1)?;
                    passed.extend_from_slice(x);
                    Ok(())
                })
            });
            return through.collect();
        }
        self.strobe = Some(Strobe::new(&self.system, passed));
        let results = self.advance(states, periods);
        if let Some(mut strobe) = self.strobe.take() {
            passed.swap_with_slice(&mut strobe.passed);
        }
        results
    }

    /// Creates one member for each state, at phase 0.
    fn begin(&mut self, system: &System, states: &[f64], periods: &[usize]) {
        self.members.clear();
        for (x, &left) in states.chunks_exact(system.dimension()).zip(periods) {
            let failure = self.alone.start_checked(system, x, 0.0).err();
            let member = Member {
                regime: self.alone.regime,
                phase: 0.0,
                packed: self.alone.packed.clone(),
                surface: self.alone.surface,
                left: if failure.is_some() { 0 } else { left },
                stalled: 0,
                failure,
            };
            if member.left > 0 {
                self.waiting[member.regime].push_back(self.members.len());
            }
            self.members.push(member);
        }
    }

    /// Writes the states that the members have reached.
    fn end(
        &mut self,
        system: &System,
        states: &mut [f64],
        periods: &[usize],
    ) -> Vec<Result<(), FlowError>> {
        let Self {
            members,
            alone,
            strobe,
            ..
        } = self;
        let each = states
            .chunks_exact_mut(system.dimension())
            .zip(members.drain(..))
            .zip(periods);
        let each = each.enumerate();
        each.map(|(number, ((x, member), periods))| match member.failure {
            Some(failure) => Err(failure),
            None if *periods == 0 => Ok(()),
            None => {
                member.hand_to(system, alone);
                alone.write_state(system, x);
                if let Some(strobe) = strobe {
                    strobe.passed[number].extend_from_slice(x);
                }
                Ok(())
            }
        })
        .collect()
    }

    fn advance_alone(&mut self, x: &mut [f64], periods: usize) -> Result<(), FlowError> {
        if periods == 0 {
            return Ok(());
        }
        self.alone.start_checked(&self.system, x, 0.0)?;
        self.alone.run_periods(&self.system, periods)?;
        self.alone.write_state(&self.system, x);
        Ok(())
    }

    #[inline(always)]
    fn run_all<W: Wide>(&mut self, system: &System) {
        let fullest = |waiting: &[VecDeque<usize>]| {
            let lengths = waiting.iter().map(VecDeque::len).enumerate();
            lengths.max_by_key(|(_, length)| *length)
        };
        while let Some((regime, 1..)) = fullest(&self.waiting) {
            if system.check_cancel().is_err() {
                self.cancel();
                return;
            }
            let waiting = &mut self.waiting[regime];
            let count = waiting.len().min(LANES);
            // Lanes that are left over do what the first does.
            let first = waiting[0];
            let mut members = [first; LANES];
            for member in &mut members[..count] {
                *member = waiting.pop_front().unwrap_or(first);
            }
            self.run_together::<W>(system, regime, &members, count);
            for &member in &members[..count] {
                let Member { regime, left, .. } = self.members[member];
                if left > 0 {
                    self.waiting[regime].push_back(member);
                }
            }
        }
    }

    /// Cancels all motions that are still running.
    fn cancel(&mut self) {
        for member in self
            .waiting
            .iter_mut()
            .flat_map(|waiting| waiting.drain(..))
        {
            self.members[member].failure = Some(FlowError::Cancelled);
        }
    }

    /// Runs members of one regime to their next switches, or to the end of the searchable time.
    #[inline(always)]
    fn run_together<W: Wide>(
        &mut self,
        system: &System,
        regime: usize,
        members: &[usize; LANES],
        count: usize,
    ) {
        let prepared = &system.prepared(regime)[0];
        let Some(table) = &prepared.table else {
            return;
        };
        let kernel = &prepared.kernel;
        self.pack
            .gather::<W>(system, kernel.count, &self.members, members);
        let sums = self.pack.amplitudes::<W>(kernel, table);
        let mut signals = Signals {
            kernel,
            table,
            amplitudes: &self.pack.amplitudes,
            sums: sums.weighted,
            size: sums.size,
            reach: [0.0; LANES],
            on_surface: 0,
            rate: sums.rate,
            idle: 0,
        };
        let longest = side_by_side::reach(table);
        for (lane, &member) in members.iter().enumerate() {
            let member = &self.members[member];
            let bit = 1 << lane;
            signals.reach[lane] = member.reach(system).min(longest);
            match member.surface {
                None | Some((_, Start::Inside)) => {}
                Some((_, Start::Surface { rate })) => {
                    signals.on_surface |= bit;
                    signals.rate[lane] = rate.unwrap_or(sums.rate[lane]);
                }
                // Only one motion alone can leave.
                Some((_, Start::Release | Start::Flat { .. })) => signals.idle |= bit,
            }
            if !sums.size[lane].is_finite() {
                signals.idle |= bit;
            }
        }
        let (reach, idle) = (signals.reach, signals.idle);
        let (intervals, bounds) = signals.first_open::<W>();
        let switches = self.pack.switches::<W>(
            system,
            prepared,
            &sums,
            &intervals,
            &bounds,
            table.fine.step,
            reach,
        );
        let brief = BRIEF / system.fastest();
        let mut known = !(switches.uncertain | idle);
        for (lane, length) in switches.at.iter().enumerate() {
            let bit = 1 << lane;
            if switches.found & bit != 0 && *length <= brief {
                known &= !bit;
            }
        }
        self.strobe_within::<W>(system, regime, members, known, &switches.at);
        self.pack.pass::<W>(kernel, switches.rest);
        if switches.found != 0 {
            let rows = system.regimes()[prepared.switch.to].basis().len();
            self.pack.switch::<W>(prepared, rows);
        }
        for (lane, &number) in members.iter().enumerate().take(count) {
            let bit = 1 << lane;
            let length = switches.at[lane];
            let switched = switches.found & bit != 0;
            let member = &mut self.members[number];
            let left = member.left;
            if known & bit != 0 {
                self.stretches.together += 1;
                member.go_on(system, &self.pack, prepared, lane, length, switched);
            } else {
                self.stretches.alone += 1;
                member.go_on_alone::<W::One>(system, &mut self.alone);
            }
            if let Some(strobe) = &mut self.strobe
                && 0 < member.left
                && member.left < left
            {
                let state = strobe.now.iter().map(|values| values[lane]);
                strobe.passed[number].extend(state);
            }
        }
    }

    /// Computes the states at the ends of periods within stretches, if they are requested; the
    /// lanes in `known` end at these times.
    #[inline(always)]
    fn strobe_within<W: Wide>(
        &mut self,
        system: &System,
        regime: usize,
        members: &[usize; LANES],
        known: u32,
        ends: &Octet,
    ) {
        let Some(strobe) = &mut self.strobe else {
            return;
        };
        let period = system.drive().period();
        let (mut ahead, mut some) = (Octet::default(), false);
        for (lane, &member) in members.iter().enumerate() {
            let phase = self.members[member].phase;
            // The end of a stretch that is passed alone is not known.
            if known & (1 << lane) == 0 || phase + ends[lane] >= period {
                (ahead[lane], some) = (period - phase, true);
            }
        }
        if some {
            let regime = (&system.regimes()[regime], &strobe.responses[regime]);
            self.pack.states_after::<W>(regime, ahead, &mut strobe.now);
        }
    }
}

impl Strobe {
    /// Creates the storage for members of `system`; it takes the vectors of `passed` and clears
    /// them.
    fn new(system: &System, passed: &mut [Vec<f64>]) -> Self {
        let emptied = |passed: &mut Vec<f64>| {
            passed.clear();
            std::mem::take(passed)
        };
        let at_phase_0 = |regime: &Regime| regime.response().at(system.drive(), 0.0);
        let responses = system.regimes().iter().map(at_phase_0);
        Self {
            passed: passed.iter_mut().map(emptied).collect(),
            responses: responses.map(|x| x.as_slice().to_vec()).collect(),
            now: vec![Octet::default(); system.dimension()],
        }
    }
}

impl Member {
    /// Returns how far ahead a switch can be searched for at once, as for a single motion.
    #[inline(always)]
    fn reach(&self, system: &System) -> f64 {
        let period = system.drive().period();
        let left = if self.left > 1 {
            period
        } else {
            period - self.phase
        };
        left.min(system.table_reach(self.regime))
    }

    /// Takes over the result of a lane: `length` of time passed, with or without a switch at its
    /// end.
    #[inline(always)]
    fn go_on(
        &mut self,
        system: &System,
        pack: &Pack,
        prepared: &PreparedTransition,
        lane: usize,
        length: f64,
        switched: bool,
    ) {
        let period = system.drive().period();
        let to_the_end = !switched && self.left == 1 && length >= period - self.phase;
        self.phase = if to_the_end {
            period
        } else {
            self.phase + length
        };
        self.stalled = 0;
        if switched {
            self.regime = prepared.switch.to;
            let rate = None;
            self.surface = prepared.reverse.map(|k| (k, Start::Surface { rate }));
        } else if length > 0.0 {
            self.surface = None;
        }
        let coordinates = if switched {
            &pack.switched
        } else {
            &pack.coordinates
        };
        let modes = coordinates.len() - system.drive().frequencies().len();
        self.packed.resize(
            layout::vectors_for(coordinates.len()),
            ComplexVector::default(),
        );
        for (k, [re, im]) in coordinates.iter().enumerate().take(modes) {
            let (vector, place) = layout::place(k);
            self.packed[vector][0][place] = re[lane];
            self.packed[vector][1][place] = im[lane];
        }
        count_period(&mut self.phase, &mut self.left, system.drive());
    }

    /// Continues to the next switch as a motion outside a batch does.
    #[inline(always)]
    fn go_on_alone<S: Simd>(&mut self, system: &System, alone: &mut Motion) {
        self.hand_to(system, alone);
        match alone.run_stretch::<S>(system, &mut self.left, &mut self.stalled) {
            Ok(()) => {
                self.regime = alone.regime;
                self.phase = alone.phase;
                self.packed.clone_from(&alone.packed);
                self.surface = alone.surface;
            }
            Err(failure) => {
                self.failure = Some(failure);
                self.left = 0;
            }
        }
    }

    /// Copies this member's state to `motion`. Phasors follow from the phase.
    fn hand_to(&self, system: &System, motion: &mut Motion) {
        motion.regime = self.regime;
        motion.phase = self.phase;
        motion.packed.clone_from(&self.packed);
        motion.surface = self.surface;
        motion.set_phasors(system);
    }
}

impl Pack {
    /// Assigns a lane to each member.
    #[inline(always)]
    fn gather<W: Wide>(
        &mut self,
        system: &System,
        count: usize,
        all: &[Member],
        members: &[usize; LANES],
    ) {
        self.coordinates.resize(count, ComplexOctet::default());
        let tones = system.drive().frequencies();
        let (modal, phasors) = self.coordinates.split_at_mut(count - tones.len());
        let mut phase = Octet::default();
        for (lane, &member) in members.iter().enumerate() {
            let Member {
                packed, phase: own, ..
            } = &all[member];
            phase[lane] = *own;
            for (k, [re, im]) in modal.iter_mut().enumerate() {
                let (vector, place) = layout::place(k);
                re[lane] = packed[vector][0][place];
                im[lane] = packed[vector][1][place];
            }
        }
        let phase = W::load(&phase);
        for (phasor, frequency) in phasors.iter_mut().zip(tones) {
            let (sine, cosine) = simd::sin_cos::<W>(W::mul(W::splat(*frequency), phase));
            *phasor = W::store_complex([cosine, sine]);
        }
    }

    /// Computes the amplitudes of the guard's terms, and sums over them.
    #[inline(always)]
    fn amplitudes<W: Wide>(&mut self, kernel: &Kernel, table: &Table) -> Sums {
        let zero = W::splat(0.0);
        let (mut size, mut third) = (W::splat(kernel.constant.abs()), zero);
        let (mut first, mut weighted) = (zero, [zero; 4]);
        self.amplitudes
            .resize(kernel.count, ComplexOctet::default());
        let terms = self.amplitudes.iter_mut().zip(&self.coordinates);
        for (k, (amplitude, q)) in terms.enumerate() {
            let (vector, place) = layout::place(k);
            let terms = &kernel.vectors[vector];
            let weight = [
                W::splat(terms.weight[0][place]),
                W::splat(terms.weight[1][place]),
            ];
            let a = simd::complex_mul::<W>(weight, W::load_complex(q));
            let norm = W::sqrt(W::fma(a[0], a[0], W::mul(a[1], a[1])));
            size = W::add(size, norm);
            third = W::fma(norm, W::splat(terms.cube[place]), third);
            first = W::fma(W::splat(terms.decay[place]), a[0], first);
            first = W::fnma(W::splat(terms.frequency[place]), a[1], first);
            for (sum, weight) in weighted.iter_mut().zip(&table.fine.weights[vector]) {
                *sum = W::fma(norm, W::splat(weight[place]), *sum);
            }
            *amplitude = W::store_complex(a);
        }
        Sums {
            size: W::store(size),
            third: W::store(third),
            rate: W::store(first),
            weighted: [
                W::store(weighted[0]),
                W::store(weighted[1]),
                W::store(weighted[2]),
                W::store(weighted[3]),
            ],
        }
    }

    /// Locates the switches within the intervals by Newton's method with two more derivatives,
    /// starting at the zero of the interval's quintic. In lanes without an interval, the factors
    /// are those of the end of the search.
    #[inline(always)]
    fn switches<W: Wide>(
        &mut self,
        system: &System,
        prepared: &PreparedTransition,
        sums: &Sums,
        intervals: &Intervals<W>,
        bounds: &Bounds<W>,
        width: f64,
        reach: Octet,
    ) -> Switches {
        let (kernel, found) = (&prepared.kernel, intervals.found);
        let quintic = Quintic::<W> {
            width: W::splat(width),
            ends: intervals.ends,
        };
        let zero = W::splat(0.0);
        let gentlest = W::sub(zero, quintic.rates()[1]);
        let [above, under] = [quintic.ends[0][0], W::sub(zero, quintic.ends[1][0])];
        // Above zero at one end, below at the other, and falling all the way.
        let mut uncertain = W::below(above, bounds.error)
            | W::below(under, bounds.error)
            | W::below(gentlest, W::splat(f64::MIN_POSITIVE));
        let falls = !W::below(gentlest, bounds.rate_error);
        let (start, length) = (intervals.start, W::load(&reach));
        let end = W::add(start, W::splat(width));
        let mut open = found & !uncertain;
        let mut at = W::store(W::fma(quintic.zero(), quintic.width, start));
        for lane in 0..LANES {
            if open & (1 << lane) == 0 {
                at[lane] = reach[lane];
            }
        }
        let mut rest = [0.0; LANES];
        for evaluation in 0..MAX_EVALUATIONS {
            let from = W::load(&at);
            let near = Near::<W> {
                cubic: self.evaluate::<W>(kernel, from),
                third: W::load(&sums.third),
                fastest: W::splat(kernel.fastest),
                noise: W::mul(W::splat(NOISE), W::load(&sums.size)),
                length,
            };
            if evaluation == 0 {
                uncertain |= !falls & near.not_unique(gentlest, bounds.error);
                open &= !uncertain;
            }
            let step = near.cubic.step();
            let turn = W::mul(W::abs(step), W::splat(system.fastest()));
            let last = !near.goes_on(step, near.cubic.slope(step))
                & !W::below(W::splat(SMALL_ANGLE), turn);
            let next = W::add(from, step);
            // A switch lies before the end of the stretch, and Newton's method stays in the interval.
            let lost = W::below(next, zero)
                | (last & W::below(length, next))
                | (!last & (W::below(next, start) | W::below(end, next)));
            uncertain |= open & lost;
            let (step, next) = (W::store(step), W::store(next));
            let going_on = open & !lost & !last;
            for lane in 0..LANES {
                let bit = 1 << lane;
                if open & last & !lost & bit != 0 {
                    rest[lane] = step[lane];
                } else if going_on & bit != 0 {
                    at[lane] = next[lane];
                }
            }
            open = going_on;
            if open == 0 {
                break;
            }
        }
        uncertain |= open;
        Switches {
            found,
            uncertain: found & uncertain,
            at: W::store(W::add(W::load(&at), W::load(&rest))),
            rest,
        }
    }

    /// Evaluates the guard and its first three derivatives at time `at`, and keeps the
    /// exponentials.
    #[inline(always)]
    fn evaluate<W: Wide>(&mut self, kernel: &Kernel, at: W::Register) -> Cubic<W> {
        let zero = W::splat(0.0);
        let mut sums = [W::splat(kernel.constant), zero, zero, zero];
        self.factors.resize(kernel.count, ComplexOctet::default());
        for (k, (factor, a)) in self.factors.iter_mut().zip(&self.amplitudes).enumerate() {
            let rate = kernel.rate(k);
            let powers = [rate, rate * rate, rate * rate * rate];
            let (decay, frequency) = (W::splat(rate.re), W::splat(rate.im));
            let turned = simd::exp_complex::<W>(decay, frequency, at);
            let [re, im] = simd::complex_mul::<W>(W::load_complex(a), turned);
            sums[0] = W::add(sums[0], re);
            for (sum, power) in sums[1..].iter_mut().zip(powers) {
                *sum = W::fma(W::splat(power.re), re, *sum);
                *sum = W::fnma(W::splat(power.im), im, *sum);
            }
            *factor = W::store_complex(turned);
        }
        let [value, rate, curvature, jerk] = sums;
        Cubic {
            value,
            rate,
            curvature,
            jerk,
        }
    }

    /// Advances the lanes by the last evaluated times and the remaining times `rest`.
    #[inline(always)]
    fn pass<W: Wide>(&mut self, kernel: &Kernel, rest: Octet) {
        let rest = W::load(&rest);
        for (k, (q, factor)) in self.coordinates.iter_mut().zip(&self.factors).enumerate() {
            let rate = kernel.rate(k);
            let z = [
                W::mul(W::splat(rate.re), rest),
                W::mul(W::splat(rate.im), rest),
            ];
            let turn = simd::complex_mul::<W>(W::load_complex(factor), simd::exp_small::<W>(z));
            *q = W::store_complex(simd::complex_mul::<W>(W::load_complex(q), turn));
        }
    }

    /// Computes the states after the times `ahead`, at phase 0 of the drive, where the forced
    /// response of the regime is known.
    #[inline(always)]
    fn states_after<W: Wide>(
        &self,
        (regime, response): (&Regime, &Vec<f64>),
        ahead: Octet,
        states: &mut [Octet],
    ) {
        let (basis, ahead) = (regime.basis(), W::load(&ahead));
        for (state, response) in states.iter_mut().zip(response) {
            *state = [*response; LANES];
        }
        let columns = basis.right.as_slice().chunks_exact(states.len());
        let terms = basis.eigenvalues.iter().zip(columns);
        for ((rate, column), q) in terms.zip(&self.coordinates) {
            let (decay, frequency) = (W::splat(rate.re), W::splat(rate.im));
            let turn = simd::exp_complex::<W>(decay, frequency, ahead);
            let [re, im] = simd::complex_mul::<W>(W::load_complex(q), turn);
            for (state, r) in states.iter_mut().zip(column) {
                let sum = W::fma(W::splat(r.re), re, W::load(state));
                *state = W::store(W::fnma(W::splat(r.im), im, sum));
            }
        }
    }

    /// Changes the basis as at a switch, to `rows` modal coordinates.
    #[inline(always)]
    fn switch<W: Wide>(&mut self, prepared: &PreparedTransition, rows: usize) {
        let tones = self.coordinates.len() - prepared.guard.modal.len();
        self.switched.resize(rows + tones, ComplexOctet::default());
        let map = &prepared.switch.packed;
        map.apply_wide::<W>(&self.coordinates, rows, &mut self.switched);
        let phasors = &self.coordinates[self.coordinates.len() - tones..];
        self.switched[rows..].copy_from_slice(phasors);
    }
}

/// The arguments of [`Ensemble::run_all`], for the dispatch to vector instructions.
struct RunAll<'a>(&'a mut Ensemble, &'a System);

impl WideWork for RunAll<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        self.0.run_all::<W>(self.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Plain, Twice};
    use crate::{Drive, HarmonicVector, Output, Regime, Transition};
    use nalgebra::{DMatrix, DVector, RowDVector};

    /// A mass on a spring that taps another.
    fn system() -> Arc<System> {
        let drive = Drive::single(2.6).unwrap();
        let regime = |index: usize, stiffness: f64| {
            let matrix = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -9.0 - stiffness, -0.3]);
            let push = DVector::from_vec(vec![0.0, 1.0]);
            let forcing = HarmonicVector::zeros(2, 1).with_tone(0, &push, &(0.2 * &push));
            Regime::new(index, matrix, forcing, &drive).unwrap()
        };
        let gap = Output::linear(RowDVector::from_row_slice(&[1.0, 0.0]), 1);
        let transitions = vec![
            vec![Transition::new(gap.clone(), 1)],
            vec![Transition::new(gap.scaled(-1.0), 0)],
        ];
        let regimes = vec![regime(0, 0.0), regime(1, 40.0)];
        Arc::new(System::new(drive.clone(), regimes, transitions).unwrap())
    }

    fn states() -> Vec<f64> {
        (0..40).map(|k| 0.1 * f64::from(k % 7) - 0.3).collect()
    }

    /// Numbers side by side in registers, in two or one, are those of any machine.
    #[test]
    fn every_arithmetic_gives_the_same_bits() {
        let system = system();
        let mut ensemble = Ensemble::new(Arc::clone(&system));
        let (mut plain, mut fastest) = (states(), states());
        ensemble.begin(&system, &plain, &[9; 20]);
        RunAll(&mut ensemble, &system).run::<Twice<Plain>>();
        let results = ensemble.end(&system, &mut plain, &[9; 20]);
        assert!(results.iter().all(Result::is_ok));
        ensemble.advance(&mut fastest, &[9; 20]);
        assert_eq!(plain, fastest);
        assert_ne!(plain, states());
    }
}
