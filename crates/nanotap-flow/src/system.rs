//! A piecewise-linear system: its regimes and the transitions between them.

use crate::harmonic::{HarmonicVector, Output};
use crate::regime::{Kernel, KernelFrame, ModalOutput, Regime};
use crate::search::Start;
use crate::search::tabulated::Table;
use crate::simd::affine::AffineMap;
use crate::simd::linear::LinearMap;
use crate::simd::{ComplexVector, layout};
use crate::{Complex, Drive, FlowError};
use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::{CancelFlag, ComplexFunctions as _};

/// A jump of the state at a switch: `x⁺ = matrix · x⁻ + offset(t)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Reset {
    /// Matrix that multiplies the state before the switch, `n × n`.
    pub matrix: DMatrix<f64>,
    /// Offset that is added to the state, of length `n`.
    pub offset: HarmonicVector,
}

/// The end of chatter: once an impact is so slow that the rest of the sequence moves the motion by
/// less than rounding, `reset` (the perfectly inelastic impact) is applied and the motion continues
/// in `regime`.
#[derive(Clone, Debug, PartialEq)]
pub struct Sticking {
    /// Number of the regime in which the guard stays at zero.
    pub regime: usize,
    /// Jump of the perfectly inelastic impact, after which the guard and its rate are zero.
    pub reset: Reset,
}

/// Exact initial value of a guard of the next regime at a switch. Sums of exponentials give it only
/// up to rounding, so that the guard would cross immediately or never.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Onset {
    /// The guard of this transition starts with value and rate zero, as when two bodies part that
    /// no longer press on each other. (If the motion starts beyond the guard of the transition
    /// taken, only the value is zero.)
    AtRest(usize),
    /// The guard of `transition` starts at `factor` times the rate of the guard of the transition
    /// taken, as when the tip reaches a damper. At a grazing touch this is zero.
    Proportional {
        /// Number of the transition of the next regime.
        transition: usize,
        /// Ratio of the guard's initial value to the rate of the guard taken; zero or negative, as
        /// that rate is, so that the guard starts at or above zero.
        factor: f64,
    },
}

impl Onset {
    /// Returns the transition of the next regime to which the onset refers.
    pub const fn transition(self) -> usize {
        match self {
            Self::AtRest(transition) | Self::Proportional { transition, .. } => transition,
        }
    }
}

/// An exit of a regime: when `guard` falls to zero, the motion continues in `target`, after `reset`
/// if there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// Guard: positive inside the regime; the transition is taken where it falls to zero.
    pub guard: Output,
    /// Number of the regime in which the motion continues.
    pub target: usize,
    /// Jump of the state; `None` if it is continuous.
    pub reset: Option<Reset>,
    /// Sticking regime that ends chatter; `None` if the transition cannot chatter.
    pub sticking: Option<Sticking>,
    /// Whether the next regime begins with guard, rate and acceleration all zero
    /// by definition (release from sticking).
    pub release: bool,
    /// Exact initial value of one of the next regime's guards, if none of them is this transition's
    /// own (which is recognised and starts at zero).
    pub onset: Option<Onset>,
}

impl Transition {
    /// Creates a continuous switch to `target` when `guard` falls to zero.
    pub fn new(guard: Output, target: usize) -> Self {
        Self {
            guard,
            target,
            reset: None,
            sticking: None,
            release: false,
            onset: None,
        }
    }

    /// Adds a jump of the state.
    #[must_use]
    pub fn with_reset(mut self, reset: Reset) -> Self {
        self.reset = Some(reset);
        self
    }

    /// Adds a sticking regime in which chatter ends.
    #[must_use]
    pub fn with_sticking(mut self, sticking: Sticking) -> Self {
        self.sticking = Some(sticking);
        self
    }

    /// Adds the initial value of one of the next regime's guards.
    #[must_use]
    pub fn with_onset(mut self, onset: Onset) -> Self {
        self.onset = Some(onset);
        self
    }

    /// Marks a release from sticking: the target's guard starts with value, rate and acceleration
    /// zero.
    #[must_use]
    pub fn as_release(mut self) -> Self {
        self.release = true;
        self
    }
}

/// A harmonically forced piecewise-linear system, ready to run.
#[derive(Clone, Debug, PartialEq)]
pub struct System {
    dimension: usize,
    drive: Drive,
    regimes: Vec<Regime>,
    transitions: Vec<Vec<Transition>>,
    switches: Vec<Vec<PreparedTransition>>,
    /// Reach of the tables of each regime's guards, in the system's unit of time.
    reaches: Vec<f64>,
    /// `[Re λ, Im λ]` of each regime's modal coordinates and tones, packed.
    rates: Vec<Vec<ComplexVector>>,
    /// The largest `|λ|` of any regime or tone.
    fastest: f64,
    /// Flag that cancels its motions.
    cancel: CancelFlag,
}

/// A transition prepared for the inner loop.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PreparedTransition {
    /// The guard in modal coordinates of the regime it leaves.
    pub(crate) guard: ModalOutput,
    /// The same guard in the packed layout of the inner loop.
    pub(crate) kernel: Kernel,
    /// Table of the guard's exponentials, if it can be tabulated.
    pub(crate) table: Option<Table>,
    /// The change of basis of the plain switch.
    pub(crate) switch: Switch,
    /// The change of basis into the sticking regime.
    pub(crate) sticking: Option<Switch>,
    /// Transition of the target regime whose guard is the negative of this one (or the same, at an
    /// impact), so that it starts at zero.
    pub(crate) reverse: Option<usize>,
    /// Such a transition of the sticking regime.
    pub(crate) sticking_reverse: Option<usize>,
    /// The guard's acceleration in the target regime, for the detection of chatter.
    pub(crate) acceleration: Option<Output>,
}

/// A switch from one regime to another as a change of modal coordinates:
/// `q⁺ = matrix · q⁻ + offset(t)` with real and imaginary parts stacked.
#[derive(Clone, Debug, PartialEq)]
pub struct Switch {
    /// Number of the regime that the switch leaves.
    pub from: usize,
    /// Number of the regime that the switch enters.
    pub to: usize,
    /// `2m⁺ × 2m⁻`, acting on `[Re q; Im q]`.
    pub(crate) matrix: DMatrix<f64>,
    /// The same change of coordinates with the parts of the tones' phasors and of the constant,
    /// packed.
    pub(crate) packed: AffineMap,
    /// The constant saltation `1 + u hᵀ` where the vector field's jump is
    /// proportional to the guard's rate; then the map is smooth through grazing.
    pub(crate) saltation: Option<DVector<f64>>,
    /// `matrix` with the constant saltation in it: the switch of a Jacobian.
    pub(crate) tangent: Option<LinearMap>,
    /// For a continuous state: the guard's rate after the switch, `factor · rate + constant`, if it
    /// follows from the rate before it alone.
    pub(crate) rate_after: Option<RateAfter>,
}

/// The guard's rate after a switch, `factor · rate + constant`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RateAfter {
    pub(crate) factor: f64,
    pub(crate) constant: f64,
}

impl RateAfter {
    const SAME: Self = Self {
        factor: 1.0,
        constant: 0.0,
    };

    pub(crate) fn of(self, rate: f64) -> f64 {
        self.factor * rate + self.constant
    }
}

impl Switch {
    /// Returns log|det| (dimensionless) of the saltation matrix of a switch without a reset at
    /// which the guard has this rate. By the matrix determinant lemma, the determinant is the ratio
    /// of the guard's rates after and before the switch. `None` if the rate after the switch does
    /// not follow from that before.
    pub fn log_determinant(&self, rate: f64) -> Option<f64> {
        self.rate_after.map(|after| {
            if after.constant == 0.0 {
                nanotap_arithmetic::ln(after.factor.abs())
            } else {
                nanotap_arithmetic::ln((after.of(rate) / rate).abs())
            }
        })
    }

    /// Reports whether the guard's rate jumps even where the guard falls arbitrarily slowly, so
    /// that a grazing motion is not close to one that just misses.
    pub fn breaks_grazing(&self) -> bool {
        self.rate_after.is_some_and(|after| after.constant != 0.0)
    }

    /// Reports whether the switch preserves volumes at any rate.
    pub fn keeps_volume(&self) -> bool {
        self.rate_after == Some(RateAfter::SAME)
    }
}

/// Creates the switch of packed coordinates: modal coordinates first, then phasors.
fn packed_switch(
    matrix: &DMatrix<f64>,
    to_modal: &DMatrix<f64>,
    shift: &HarmonicVector,
) -> AffineMap {
    let (to, from) = (matrix.nrows() / 2, matrix.ncols() / 2);
    let tones = shift.tones.len();
    let mut switch = AffineMap::with_capacity(to + tones, 2 * (from + tones) + 1);
    let mut change = DVector::zeros(2 * to);
    for part in 0..2 {
        for k in 0..from {
            switch.push(matrix.column(part * from + k).as_slice(), None);
        }
        for (tone, z) in shift.tones.iter().enumerate() {
            // Re(z e^{iωt}) = Re z cos − Im z sin.
            let part_of = |z: &Complex| if part == 0 { z.re } else { -z.im };
            change.gemv(1.0, to_modal, &z.map(|z| part_of(&z)), 0.0);
            // A phasor goes on as it is.
            switch.push(change.as_slice(), Some((to + tone, part)));
        }
    }
    change.gemv(1.0, to_modal, &shift.constant, 0.0);
    switch.push(change.as_slice(), None);
    switch
}

impl System {
    /// Creates a system from regimes and transitions (`transitions[r]` lead out of regime `r`).
    ///
    /// # Errors
    /// If sizes do not fit or a transition names a missing regime.
    pub fn new(
        drive: Drive,
        regimes: Vec<Regime>,
        transitions: Vec<Vec<Transition>>,
    ) -> Result<Self, FlowError> {
        let dimension = regimes.first().map_or(0, |r| r.matrix().nrows());
        if dimension == 0 {
            return Err(FlowError::Shape {
                what: "the list of regimes",
                found: 0,
                expected: 1,
            });
        }
        if transitions.len() != regimes.len() {
            return Err(FlowError::Shape {
                what: "the list of transitions",
                found: transitions.len(),
                expected: regimes.len(),
            });
        }
        let tones = drive.frequencies().len();
        for regime in &regimes {
            let found = regime.matrix().nrows();
            if found != dimension {
                return Err(FlowError::Shape {
                    what: "a regime's matrix",
                    found,
                    expected: dimension,
                });
            }
        }
        for transition in transitions.iter().flatten() {
            transition.guard.check("a guard", dimension, tones)?;
            let targets = std::iter::once(transition.target)
                .chain(transition.sticking.as_ref().map(|s| s.regime));
            for target in targets {
                if target >= regimes.len() {
                    return Err(FlowError::Target {
                        target,
                        regimes: regimes.len(),
                    });
                }
            }
            if let Some(onset) = transition.onset
                && onset.transition() >= transitions[transition.target].len()
            {
                return Err(FlowError::Shape {
                    what: "the transitions of a regime whose guard's onset is known",
                    found: transitions[transition.target].len(),
                    expected: onset.transition() + 1,
                });
            }
            for reset in transition
                .reset
                .iter()
                .chain(transition.sticking.as_ref().map(|s| &s.reset))
            {
                let (rows, columns) = reset.matrix.shape();
                for found in [rows, columns] {
                    if found != dimension {
                        return Err(FlowError::Shape {
                            what: "a reset's matrix",
                            found,
                            expected: dimension,
                        });
                    }
                }
                reset.offset.check("a reset's offset", dimension, tones)?;
            }
        }
        let mut system = Self {
            dimension,
            drive,
            regimes,
            transitions,
            switches: Vec::new(),
            reaches: Vec::new(),
            rates: Vec::new(),
            fastest: 0.0,
            cancel: CancelFlag::default(),
        };
        system.switches = (0..system.regimes.len())
            .map(|r| {
                system.transitions[r]
                    .iter()
                    .map(|transition| system.prepare(r, transition))
                    .collect()
            })
            .collect();
        system.reaches = system
            .switches
            .iter()
            .map(|transitions| {
                transitions
                    .iter()
                    .filter_map(|transition| transition.table.as_ref())
                    .map(Table::reach)
                    .fold(f64::INFINITY, f64::min)
            })
            .collect();
        system.rates = system
            .regimes
            .iter()
            .map(|r| packed_rates(r, &system.drive))
            .collect();
        let rates = system.rates.iter().flatten();
        for (r, regime) in system.regimes.iter().enumerate() {
            let rates = regime.basis().eigenvalues.iter();
            let turns = rates.map(|z| z.im.abs()).fold(0.0, f64::max) * system.drive.period();
            if turns > MAX_TURNS * std::f64::consts::TAU {
                return Err(FlowError::TooFast {
                    regime: r,
                    oscillations: turns / std::f64::consts::TAU,
                    limit: MAX_TURNS,
                });
            }
        }
        system.fastest = rates
            .flat_map(|[re, im]| {
                re.iter()
                    .zip(im)
                    .map(|(re, im)| nanotap_arithmetic::hypot(*re, *im))
            })
            .fold(0.0, f64::max);
        Ok(system)
    }

    /// Returns the same system, whose motions end with [`FlowError::Cancelled`] once `cancel` is
    /// set.
    #[must_use]
    pub fn cancelled_by(mut self, cancel: CancelFlag) -> Self {
        self.cancel = cancel;
        self
    }

    /// Returns the flag that cancels its motions.
    pub fn cancel(&self) -> &CancelFlag {
        &self.cancel
    }

    /// Returns an error once its motions are cancelled.
    #[inline]
    pub(crate) fn check_cancel(&self) -> Result<(), FlowError> {
        if self.cancel.is_cancelled() {
            Err(FlowError::Cancelled)
        } else {
            Ok(())
        }
    }

    /// Calls `visit` with every constant of forcings, guards and resets and what was prepared from
    /// them, in the same order for all systems of one structure. Between two systems that differ in
    /// constant forces and thresholds only, these numbers vary linearly and nothing else does.
    pub fn each_constant(&mut self, visit: &mut dyn FnMut(&mut f64)) {
        for regime in &mut self.regimes {
            regime.each_constant(visit);
        }
        for transition in self.transitions.iter_mut().flatten() {
            visit(&mut transition.guard.constant);
            let inelastic = transition.sticking.as_mut().map(|s| &mut s.reset);
            for reset in transition.reset.iter_mut().chain(inelastic) {
                reset.offset.constant.iter_mut().for_each(&mut *visit);
            }
        }
        for prepared in self.switches.iter_mut().flatten() {
            visit(&mut prepared.guard.constant);
            visit(&mut prepared.kernel.constant);
            if let Some(acceleration) = &mut prepared.acceleration {
                visit(&mut acceleration.constant);
            }
            prepared.switch.packed.each_constant(visit);
            if let Some(sticking) = &mut prepared.sticking {
                sticking.packed.each_constant(visit);
            }
        }
    }

    /// Returns the dimension `n` of the state.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Returns the drive that all regimes share.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Returns the regimes, by number.
    pub fn regimes(&self) -> &[Regime] {
        &self.regimes
    }

    /// Returns the transitions out of each regime, by number of the regime.
    pub fn transitions(&self) -> &[Vec<Transition>] {
        &self.transitions
    }

    /// Returns the largest angle, in radians, through which any term turns in a drive period.
    pub(crate) fn largest_angle(&self) -> f64 {
        self.fastest * self.drive.period()
    }

    /// Returns the largest `|λ|` of any regime or tone.
    pub(crate) fn fastest(&self) -> f64 {
        self.fastest
    }

    pub(crate) fn packed_rates(&self) -> &[Vec<ComplexVector>] {
        &self.rates
    }

    /// Returns the reach of the tables of a regime's guards, in time.
    pub(crate) fn table_reach(&self, regime: usize) -> f64 {
        self.reaches[regime]
    }

    /// Returns the regime and the transition of the rigid stop that ends in sticking in `regime`;
    /// `None` if the motion does not stick in `regime`.
    pub(crate) fn stop_of(&self, regime: usize) -> Option<(usize, usize)> {
        let sticks = |e: &Transition| e.sticking.as_ref().is_some_and(|s| s.regime == regime);
        let mut out = self.transitions.iter().enumerate();
        out.find_map(|(from, out)| Some((from, out.iter().position(sticks)?)))
    }

    /// Reports whether the motion sticks to a rigid stop in `regime`: its state is then that of the
    /// stop.
    pub fn sticks(&self, regime: usize) -> bool {
        self.stop_of(regime).is_some()
    }

    /// Returns the switch of a transition; `None` if there is no such transition.
    pub fn switch_of(&self, regime: usize, transition: usize) -> Option<&Switch> {
        let prepared = self.switches.get(regime)?.get(transition)?;
        Some(&prepared.switch)
    }

    pub(crate) fn prepared(&self, regime: usize) -> &[PreparedTransition] {
        &self.switches[regime]
    }

    /// Returns the regime in which a motion starts at state `x` and time `t`, and the transition
    /// whose guard starts at zero. It is the first regime whose guards are all positive; a guard
    /// that is zero within rounding counts as positive if its first non-zero derivative is. A
    /// sticking regime is entered only from a state that sticks. If no regime contains the state,
    /// it is one whose transition is already passed and resets the state to one that the next
    /// regime contains; the transition is taken at once.
    ///
    /// # Errors
    /// [`FlowError::NoRegime`] if there is none.
    pub fn regime_at(&self, x: &[f64], t: f64) -> Result<(usize, Option<usize>), FlowError> {
        let (regime, surface) = self.start_at(x, t)?;
        Ok((regime, surface.map(|(transition, _)| transition)))
    }

    /// As [`System::regime_at`], and returns how the guard that starts at zero rises.
    pub(crate) fn start_at(
        &self,
        x: &[f64],
        t: f64,
    ) -> Result<(usize, Option<(usize, Start)>), FlowError> {
        let exact = |_: usize, output: &Output| ON_SURFACE * rounding(output, x);
        if let Some(found) = self.regime_within(x, t, &exact) {
            return Ok(found);
        }
        // On a rigid stop, a state that was computed a moment after an impact lies off the
        // surface by the rounding of the whole motion, not of this state alone.
        let computed =
            |r: usize, output: &Output| ON_SURFACE * self.motion_rounding(r, output, x, t);
        if let Some(found) = self.regime_within(x, t, &computed) {
            return Ok(found);
        }
        if let Some(regime) = self.left_at_once(x, t, &exact) {
            return Ok((regime, None));
        }
        // Moving into the stop: in flight, and the impact is now.
        (0..self.regimes.len())
            .find(|&r| {
                self.may_stick(r, x, t, &computed)
                    && self.transitions[r].iter().all(|transition| {
                        transition.guard.at(&self.drive, x, t) >= -computed(r, &transition.guard)
                    })
            })
            .map(|r| (r, None))
            .ok_or(FlowError::NoRegime)
    }

    /// Returns the first regime that contains the state; outputs within `tolerance` count as zero.
    fn regime_within(
        &self,
        x: &[f64],
        t: f64,
        tolerance: &impl Fn(usize, &Output) -> f64,
    ) -> Option<(usize, Option<(usize, Start)>)> {
        self.transitions
            .iter()
            .enumerate()
            .find_map(|(r, transitions)| {
                if !self.may_stick(r, x, t, tolerance) {
                    return None;
                }
                let mut surface = None;
                let inside = transitions.iter().enumerate().all(|(e, transition)| {
                    let value = transition.guard.at(&self.drive, x, t);
                    if value.abs() <= tolerance(r, &transition.guard) {
                        let start = self.rises(r, &transition.guard, x, t, tolerance);
                        surface = start.map(|start| (e, start));
                        return start.is_some();
                    }
                    value > 0.0
                });
                inside.then_some((r, surface))
            })
    }

    /// Returns the regime whose transition is already passed and resets the state to one that the
    /// next regime contains.
    fn left_at_once(
        &self,
        x: &[f64],
        t: f64,
        tolerance: &impl Fn(usize, &Output) -> f64,
    ) -> Option<usize> {
        let state = DVector::from_column_slice(x);
        let leads_on = |transition: &Transition| {
            let Some(reset) = transition
                .reset
                .as_ref()
                .filter(|_| transition.sticking.is_none())
            else {
                return false;
            };
            let after = &reset.matrix * &state + reset.offset.at(&self.drive, t);
            let held = self.regime_within(after.as_slice(), t, tolerance);
            transition.guard.at(&self.drive, x, t) <= 0.0
                && held.is_some_and(|(r, _)| r == transition.target)
        };
        (0..self.regimes.len()).find(|&r| self.transitions[r].iter().any(leads_on))
    }

    /// Reports whether regime `r` is not a sticking regime, or is one in which this state sticks:
    /// guard and rate of the impact are zero.
    fn may_stick(
        &self,
        r: usize,
        x: &[f64],
        t: f64,
        tolerance: &impl Fn(usize, &Output) -> f64,
    ) -> bool {
        let mut impacts = self
            .transitions
            .iter()
            .enumerate()
            .flat_map(|(from, transitions)| {
                let leads_here =
                    move |e: &&Transition| e.sticking.as_ref().is_some_and(|s| s.regime == r);
                transitions
                    .iter()
                    .filter(leads_here)
                    .map(move |e| (from, e))
            });
        let Some((from, impact)) = impacts.next() else {
            return true;
        };
        let regime = &self.regimes[from];
        let rate = impact
            .guard
            .rate(regime.matrix(), regime.forcing(), &self.drive);
        [&impact.guard, &rate]
            .iter()
            .all(|output| output.at(&self.drive, x, t).abs() <= 2.0 * tolerance(from, output))
    }

    /// Returns how a guard that is zero rises, if it does, by its first derivative that does not
    /// vanish.
    fn rises(
        &self,
        r: usize,
        guard: &Output,
        x: &[f64],
        t: f64,
        tolerance: &impl Fn(usize, &Output) -> f64,
    ) -> Option<Start> {
        let regime = &self.regimes[r];
        let mut output = guard.clone();
        for vanishing in 1..=FLATTEST {
            output = output.rate(regime.matrix(), regime.forcing(), &self.drive);
            let derivative = output.at(&self.drive, x, t);
            if derivative.abs() > tolerance(r, &output) {
                return (derivative > 0.0).then_some(if vanishing == 1 {
                    Start::Surface { rate: None }
                } else {
                    Start::Flat {
                        vanishing,
                        derivative,
                    }
                });
            }
        }
        // Nothing moves it.
        Some(Start::Surface { rate: None })
    }

    /// Returns the rounding error of an output along the motion through this state: that of all its
    /// modal terms, which cancel in the output itself.
    fn motion_rounding(&self, r: usize, output: &Output, x: &[f64], t: f64) -> f64 {
        let regime = &self.regimes[r];
        let modal = regime.project(output);
        let mut q = vec![Complex::new(0.0, 0.0); regime.basis().len()];
        regime.to_modal(&self.drive, x, t, &mut vec![0.0; x.len()], &mut q);
        let own: f64 = modal
            .modal
            .iter()
            .zip(&q)
            .map(|(w, q)| (w * q).modulus())
            .sum();
        let forced: f64 = modal.tones.iter().map(|z| z.modulus()).sum();
        f64::EPSILON * (own + forced + modal.constant.abs()) + rounding(output, x)
    }

    fn prepare(&self, from: usize, transition: &Transition) -> PreparedTransition {
        let acceleration = transition.sticking.as_ref().map(|_| {
            let target = &self.regimes[transition.target];
            transition
                .guard
                .rate(target.matrix(), target.forcing(), &self.drive)
                .rate(target.matrix(), target.forcing(), &self.drive)
        });
        let guard = self.regimes[from].project(&transition.guard);
        let kernel = KernelFrame::new(&self.regimes[from], &self.drive).kernel(&guard);
        let clustered = !self.regimes[from].basis().clusters.is_empty();
        let mut switch = self.switch(
            from,
            transition.target,
            transition.reset.as_ref(),
            &transition.guard,
        );
        if transition.release {
            // What stuck goes on as it was, with guard, rate and acceleration zero.
            switch.rate_after = Some(RateAfter::SAME);
        }
        PreparedTransition {
            table: (!clustered)
                .then(|| Table::new(&kernel, self.drive.period()))
                .flatten(),
            kernel,
            guard,
            switch,
            sticking: transition
                .sticking
                .as_ref()
                .map(|s| self.switch(from, s.regime, Some(&s.reset), &transition.guard)),
            reverse: if transition.release {
                // After release the guard that starts at zero is the impact's.
                self.transitions[transition.target]
                    .iter()
                    .position(|e| e.sticking.as_ref().is_some_and(|s| s.regime == from))
            } else {
                self.reverse(&transition.guard, transition.target)
            },
            sticking_reverse: transition
                .sticking
                .as_ref()
                .and_then(|s| self.reverse(&transition.guard, s.regime)),
            acceleration,
        }
    }

    /// Returns the transition of `target` whose guard is `guard` or its negative.
    fn reverse(&self, guard: &Output, target: usize) -> Option<usize> {
        let reversed = guard.scaled(-1.0);
        self.transitions[target]
            .iter()
            .position(|e| e.guard == reversed || e.guard == *guard)
    }

    fn switch(&self, from: usize, to: usize, reset: Option<&Reset>, guard: &Output) -> Switch {
        let (a, b) = (&self.regimes[from], &self.regimes[to]);
        // The state of [Re q⁻; Im q⁻], and [Re q⁺; Im q⁺] of the state.
        let from_modal = a.prepared().stacked_right();
        let to_modal = b.prepared().stacked_left();
        let (matrix, shift) = match reset {
            None => (to_modal * from_modal, a.response().clone()),
            Some(reset) => (
                to_modal * &reset.matrix * from_modal,
                a.response().mapped(&reset.matrix).plus(1.0, &reset.offset),
            ),
        };
        let shift = shift.plus(-1.0, b.response());
        let packed = packed_switch(&matrix, to_modal, &shift);
        let saltation = self.constant_saltation(from, to, reset, guard);
        // With J the jump, L (J + u hᵀ) R = L J R + (L u)(hᵀ R).
        let tangent = saltation.as_ref().map(|u| {
            let mut tangent = matrix.clone();
            let row = (&guard.row * from_modal).transpose();
            tangent.ger(1.0, &(to_modal * u), &row, 1.0);
            LinearMap::of(&tangent)
        });
        Switch {
            from,
            to,
            matrix,
            packed,
            saltation,
            tangent,
            rate_after: match reset {
                None => self.rate_after(from, to, guard),
                Some(_) => None,
            },
        }
    }

    /// Returns `u` with `f⁺(x⁺) − R f⁻(x⁻) − ρ̇ = u ġ` for every state on the guard's zero set, if
    /// such a `u` exists.
    fn constant_saltation(
        &self,
        from: usize,
        to: usize,
        reset: Option<&Reset>,
        guard: &Output,
    ) -> Option<DVector<f64>> {
        let (a, b) = (&self.regimes[from], &self.regimes[to]);
        let (matrix, forcing) = self.field_jump(from, to, reset);
        let rate = guard.rate(a.matrix(), a.forcing(), &self.drive);
        let rate = flat(rate.row.iter(), rate.constant, rate.tones.iter());
        // Orthonormal basis of the span of ġ and g.
        let mut e1 = flat(guard.row.iter(), guard.constant, guard.tones.iter());
        e1 /= e1.norm();
        let mut e2 = rate.clone();
        e2.axpy(-e1.dot(&rate), &e1, 1.0);
        let across = e2.norm();
        if across <= 1e-12 * rate.norm() {
            return None;
        }
        e2 /= across;
        let mut u = DVector::zeros(self.dimension);
        for i in 0..self.dimension {
            let tones = forcing.tones.iter().map(|z| &z[i]);
            let mut rest = flat(matrix.row(i).iter(), forcing.constant[i], tones);
            let (size, along) = (rest.norm(), e2.dot(&rest));
            rest.axpy(-e1.dot(&rest), &e1, 1.0);
            rest.axpy(-along, &e2, 1.0);
            let (af, bf) = (a.matrix().row(i).norm(), b.matrix().row(i).norm());
            let rest = rest.norm();
            if rest > 1e-12 * size && rest > 1e-14 * (af + bf) {
                return None;
            }
            u[i] = along / across;
        }
        Some(u)
    }

    /// Returns the guard's rate in `to` as a function of that in `from`, on the guard's zero set.
    fn rate_after(&self, from: usize, to: usize, guard: &Output) -> Option<RateAfter> {
        let rate = |r: usize| {
            let regime = &self.regimes[r];
            let rate = guard.rate(regime.matrix(), regime.forcing(), &self.drive);
            flat(rate.row.iter(), rate.constant, rate.tones.iter())
        };
        let (before, after) = (rate(from), rate(to));
        let size = before.norm() + after.norm();
        let mut jump = after - &before;
        // Along the guard itself, which is zero, it may differ.
        let mut zero = flat(guard.row.iter(), guard.constant, guard.tones.iter());
        zero /= zero.norm();
        jump.axpy(-zero.dot(&jump), &zero, 1.0);
        if jump.norm() <= NEGLIGIBLE * size {
            return Some(RateAfter::SAME);
        }
        // The jump is α ġ + β: solved as the nearest such sum, which must be the jump itself.
        let mut rest = before;
        rest.axpy(-zero.dot(&rest), &zero, 1.0);
        let mut one = DVector::zeros(jump.len());
        one[self.dimension] = 1.0;
        one.axpy(-zero.dot(&one), &zero, 1.0);
        let (rr, ro, oo) = (rest.norm_squared(), rest.dot(&one), one.norm_squared());
        let (rj, oj) = (rest.dot(&jump), one.dot(&jump));
        let determinant = rr * oo - ro * ro;
        if determinant <= NEGLIGIBLE * rr * oo {
            return None;
        }
        let mut alpha = (rj * oo - oj * ro) / determinant;
        let mut beta = (oj * rr - rj * ro) / determinant;
        if beta.abs() * oo.sqrt() <= NEGLIGIBLE * size {
            (alpha, beta) = (rj / rr, 0.0);
        }
        jump.axpy(-alpha, &rest, 1.0);
        jump.axpy(-beta, &one, 1.0);
        (jump.norm() <= NEGLIGIBLE * size).then_some(RateAfter {
            factor: 1.0 + alpha,
            constant: beta,
        })
    }

    /// Returns `f⁺(Rx + ρ, t) − R f⁻(x, t) − ρ̇` as an affine function of the state.
    fn field_jump(
        &self,
        from: usize,
        to: usize,
        reset: Option<&Reset>,
    ) -> (DMatrix<f64>, HarmonicVector) {
        let (a, b) = (&self.regimes[from], &self.regimes[to]);
        match reset {
            None => (b.matrix() - a.matrix(), b.forcing().plus(-1.0, a.forcing())),
            Some(reset) => (
                b.matrix() * &reset.matrix - &reset.matrix * a.matrix(),
                b.forcing()
                    .plus(1.0, &reset.offset.mapped(b.matrix()))
                    .plus(-1.0, &a.forcing().mapped(&reset.matrix))
                    .plus(-1.0, &reset.offset.rate(&self.drive)),
            ),
        }
    }

    /// The saltation matrix (`n × n`) of transition `transition` of regime `from` (into its
    /// sticking regime if `stuck`) at state `x` before the switch and time `t`.
    ///
    /// Constant wherever the field's jump is proportional to the guard's rate;
    /// otherwise `R + (f⁺ − R f⁻ − ρ̇) hᵀ/ġ`, singular at grazing.
    pub fn saltation(
        &self,
        from: usize,
        transition: usize,
        stuck: bool,
        x: &DVector<f64>,
        t: f64,
    ) -> DMatrix<f64> {
        let description = &self.transitions[from][transition];
        let prepared = &self.switches[from][transition];
        let (switch, reset) = match (&description.sticking, &prepared.sticking) {
            (Some(sticking), Some(switch)) if stuck => (switch, Some(&sticking.reset)),
            _ => (&prepared.switch, description.reset.as_ref()),
        };
        let n = self.dimension;
        let jump = reset.map_or_else(|| DMatrix::identity(n, n), |r| r.matrix.clone());
        let h = &description.guard.row;
        if let Some(u) = &switch.saltation {
            return jump + u * h;
        }
        let (matrix, forcing) = self.field_jump(from, switch.to, reset);
        let change = matrix * x + forcing.at(&self.drive, t);
        let regime = &self.regimes[from];
        let rate = description
            .guard
            .rate(regime.matrix(), regime.forcing(), &self.drive);
        jump + change * h / rate.at(&self.drive, x.as_slice(), t)
    }
}

fn packed_rates(regime: &Regime, drive: &Drive) -> Vec<ComplexVector> {
    let tones = drive.frequencies().iter().map(|&w| Complex::new(0.0, w));
    let rates: Vec<Complex> = regime
        .basis()
        .eigenvalues
        .iter()
        .copied()
        .chain(tones)
        .collect();
    layout::list(&rates)
}

/// Relative size below which a difference counts as rounding.
const NEGLIGIBLE: f64 = 1e-13;

/// Largest number of oscillations of a mode in one drive period.
const MAX_TURNS: f64 = 1e7;

/// Number of derivatives that are examined of a guard that starts at zero.
const FLATTEST: usize = 6;

/// Number of rounding errors within which a guard counts as zero, and the state as on its surface:
/// a state computed just after a switch is no closer.
pub(crate) const ON_SURFACE: f64 = 32.0;

/// Returns the size of rounding errors in an output's value.
pub(crate) fn rounding(output: &Output, x: &[f64]) -> f64 {
    let linear: f64 = output.row.iter().zip(x).map(|(r, x)| (r * x).abs()).sum();
    let harmonic: f64 = output.tones.iter().map(|z| z.modulus()).sum();
    f64::EPSILON * (linear + output.constant.abs() + harmonic)
}

/// Returns an affine-harmonic scalar as one vector, for projections.
fn flat<'a>(
    row: impl ExactSizeIterator<Item = &'a f64>,
    constant: f64,
    tones: impl ExactSizeIterator<Item = &'a Complex>,
) -> DVector<f64> {
    let mut all = Vec::with_capacity(row.len() + 1 + 2 * tones.len());
    all.extend(row);
    all.push(constant);
    all.extend(tones.flat_map(|z| [z.re, z.im]));
    DVector::from_vec(all)
}
