//! A piecewise-linear system: its regimes and the exits between them.

use crate::crossing::Start;
use crate::harmonic::{HarmonicVector, Output};
use crate::lattice::Lattice;
use crate::pack::{Math, Pack, WIDTH};
use crate::regime::{Kernel, ModalOutput, Regime};
use crate::{Complex, Drive, FlowError};
use nalgebra::{DMatrix, DVector};

/// A jump of the state at a switch: `x⁺ = matrix · x⁻ + offset(t)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Reset {
    /// `n × n`.
    pub matrix: DMatrix<f64>,
    /// Of length `n`.
    pub offset: HarmonicVector,
}

/// Where impacts end that pile up (chatter): once an impact is so slow that the
/// rest of the sequence moves the motion by less than rounding, `reset` (the
/// perfectly inelastic impact) is applied and the motion goes on in `regime`.
#[derive(Clone, Debug, PartialEq)]
pub struct Sticking {
    /// The regime in which the guard stays at zero.
    pub regime: usize,
    /// The inelastic impact.
    pub reset: Reset,
}

/// What is known by definition of a guard of the next regime at a switch. Sums of
/// exponentials know it to rounding only, which would make it cross at once or never.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Onset {
    /// The guard of this exit starts with value and rate zero: two bodies part that no
    /// longer press on each other. (Of a start beyond the guard of the exit taken, with
    /// value zero only.)
    AtRest(usize),
    /// The guard of exit `exit` starts at `factor` times the rate of the guard of the exit
    /// taken: a damper is met. At a grazing touch that is zero.
    Proportional {
        /// Which exit of the next regime.
        exit: usize,
        /// Zero or negative, since the rate is.
        factor: f64,
    },
}

impl Onset {
    /// The exit of the next regime that it speaks of.
    pub const fn exit(self) -> usize {
        match self {
            Self::AtRest(exit) | Self::Proportional { exit, .. } => exit,
        }
    }
}

/// A way out of a regime: when `guard` falls to zero, the motion goes on in
/// `target`, after `reset` if there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct Exit {
    /// Positive inside the regime.
    pub guard: Output,
    /// The next regime.
    pub target: usize,
    /// The jump of the state, none if it is continuous.
    pub reset: Option<Reset>,
    /// What ends chatter, if the exit can chatter.
    pub sticking: Option<Sticking>,
    /// Whether the next regime begins with guard, rate and acceleration all zero
    /// by definition (release from sticking).
    pub release: bool,
    /// What is known of the next regime's guards, where none of them is this exit's own
    /// (which is recognised and starts at zero).
    pub onset: Option<Onset>,
}

impl Exit {
    /// A continuous switch to `target` when `guard` falls to zero.
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

    /// With a jump of the state.
    #[must_use]
    pub fn with_reset(mut self, reset: Reset) -> Self {
        self.reset = Some(reset);
        self
    }

    /// With a sticking regime for chatter to end in.
    #[must_use]
    pub fn with_sticking(mut self, sticking: Sticking) -> Self {
        self.sticking = Some(sticking);
        self
    }

    /// With what is known of the next regime's guards.
    #[must_use]
    pub fn with_onset(mut self, onset: Onset) -> Self {
        self.onset = Some(onset);
        self
    }

    /// As a release from sticking: the target's guard starts with value, rate and
    /// acceleration zero.
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
    exits: Vec<Vec<Exit>>,
    switches: Vec<Vec<PreparedExit>>,
    /// How far the lattices of each regime's guards reach.
    reaches: Vec<f64>,
    /// `[Re λ, Im λ]` of each regime's modal coordinates and tones, packed.
    rates: Vec<Vec<[Pack; 2]>>,
    /// The largest `|λ|` of any regime or tone.
    fastest: f64,
}

/// What an exit needs at run time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PreparedExit {
    /// The guard in modal coordinates of the regime it leaves.
    pub(crate) guard: ModalOutput,
    /// The same, packed.
    pub(crate) kernel: Kernel,
    /// The points at which it is tabulated, where that can be.
    pub(crate) lattice: Option<Lattice>,
    /// The change of basis of the plain switch.
    pub(crate) switch: Switch,
    /// The change of basis into the sticking regime.
    pub(crate) sticking: Option<Switch>,
    /// In the target regime, the exit whose guard is this one reversed (or the
    /// same, at an impact), so that it starts at zero.
    pub(crate) twin: Option<usize>,
    /// The same in the sticking regime.
    pub(crate) sticking_twin: Option<usize>,
    /// The guard's acceleration in the target regime, for telling chatter.
    pub(crate) acceleration: Option<Output>,
}

/// A switch from one regime to another as a change of modal coordinates:
/// `q⁺ = matrix · q⁻ + offset(t)` with real and imaginary parts stacked.
#[derive(Clone, Debug, PartialEq)]
pub struct Switch {
    /// The regime it leaves.
    pub from: usize,
    /// The regime it enters.
    pub to: usize,
    /// `2m⁺ × 2m⁻`, acting on `[Re q; Im q]`.
    pub(crate) matrix: DMatrix<f64>,
    /// The same with what the tones' phasors and the constant add, packed.
    pub(crate) packed: PackedSwitch,
    /// The constant saltation `1 + u hᵀ` where the vector field's jump is
    /// proportional to the guard's rate; then the map is smooth through grazing.
    pub(crate) saltation: Option<DVector<f64>>,
    /// `matrix` with the constant saltation in it: the switch of a Jacobian.
    pub(crate) tangent: Option<DMatrix<f64>>,
    /// State from `[Re q⁻; Im q⁻]`, `n × 2m⁻`.
    pub(crate) from_modal: DMatrix<f64>,
    /// `[Re q⁺; Im q⁺]` from the state, `2m⁺ × n`.
    pub(crate) to_modal: DMatrix<f64>,
}

/// A switch for packed coordinates: modal coordinates first, then phasors. The columns
/// multiply, in this order, the real parts, the imaginary parts, and one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PackedSwitch {
    /// `[re, im]` packs of each column, column after column.
    pub(crate) columns: Vec<[Pack; 2]>,
    /// Packs a column.
    pub(crate) packs: usize,
}

impl PackedSwitch {
    fn new(matrix: &DMatrix<f64>, to_modal: &DMatrix<f64>, shift: &HarmonicVector) -> Self {
        let (to, from) = (matrix.nrows() / 2, matrix.ncols() / 2);
        let tones = shift.tones.len();
        let packs = (to + tones).div_ceil(WIDTH);
        let count = 2 * (from + tones) + 1;
        let mut switch = Self {
            columns: Vec::with_capacity(count * packs),
            packs,
        };
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

    /// Writes the coordinates and phasors after the switch to `out`.
    #[inline(always)]
    pub(crate) fn apply<M: Math>(&self, packed: &[[Pack; 2]], out: &mut Vec<[Pack; 2]>) {
        let packs = self.packs;
        let (linear, constant) = self.columns.split_at(self.columns.len() - packs);
        let (real, imaginary) = linear.split_at(linear.len() / 2);
        out.resize(packs, [[0.0; WIDTH]; 2]);
        for (i, out) in out.iter_mut().enumerate() {
            // A sum for each part of the inputs: two short chains instead of a long one.
            let mut sums = [
                [M::load(&constant[i][0]), M::load(&constant[i][1])],
                [M::splat(0.0); 2],
            ];
            for (part, (columns, sum)) in [real, imaginary].into_iter().zip(&mut sums).enumerate() {
                for (columns, inputs) in columns.chunks(WIDTH * packs).zip(packed) {
                    for (column, &x) in columns.chunks_exact(packs).zip(&inputs[part]) {
                        let x = M::splat(x);
                        sum[0] = M::fma(M::load(&column[i][0]), x, sum[0]);
                        sum[1] = M::fma(M::load(&column[i][1]), x, sum[1]);
                    }
                }
            }
            let [a, b] = sums;
            *out = [M::store(M::add(a[0], b[0])), M::store(M::add(a[1], b[1]))];
        }
    }

    /// Adds a column, real parts first, with a one in coordinate and part `one`.
    fn push(&mut self, column: &[f64], one: Option<(usize, usize)>) {
        let start = self.columns.len();
        self.columns.resize(start + self.packs, [[0.0; WIDTH]; 2]);
        let packs = &mut self.columns[start..];
        let (real, imaginary) = column.split_at(column.len() / 2);
        for (part, values) in [real, imaginary].into_iter().enumerate() {
            for (values, pack) in values.chunks(WIDTH).zip(packs.iter_mut()) {
                pack[part][..values.len()].copy_from_slice(values);
            }
        }
        if let Some((k, part)) = one {
            packs[k / WIDTH][part][k % WIDTH] = 1.0;
        }
    }
}

impl System {
    /// Joins regimes and exits (`exits[r]` lead out of regime `r`).
    ///
    /// # Errors
    /// When sizes do not fit or an exit leads nowhere.
    pub fn new(
        drive: Drive,
        regimes: Vec<Regime>,
        exits: Vec<Vec<Exit>>,
    ) -> Result<Self, FlowError> {
        let dimension = regimes.first().map_or(0, |r| r.matrix().nrows());
        if dimension == 0 {
            return Err(FlowError::Shape {
                what: "the list of regimes",
                found: 0,
                expected: 1,
            });
        }
        if exits.len() != regimes.len() {
            return Err(FlowError::Shape {
                what: "the list of exits",
                found: exits.len(),
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
        for exit in exits.iter().flatten() {
            exit.guard.check("a guard", dimension, tones)?;
            let targets =
                std::iter::once(exit.target).chain(exit.sticking.as_ref().map(|s| s.regime));
            for target in targets {
                if target >= regimes.len() {
                    return Err(FlowError::Target {
                        target,
                        regimes: regimes.len(),
                    });
                }
            }
            if let Some(onset) = exit.onset
                && onset.exit() >= exits[exit.target].len()
            {
                return Err(FlowError::Shape {
                    what: "the exits of a regime whose guard's onset is known",
                    found: exits[exit.target].len(),
                    expected: onset.exit() + 1,
                });
            }
            for reset in exit
                .reset
                .iter()
                .chain(exit.sticking.as_ref().map(|s| &s.reset))
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
            exits,
            switches: Vec::new(),
            reaches: Vec::new(),
            rates: Vec::new(),
            fastest: 0.0,
        };
        system.switches = (0..system.regimes.len())
            .map(|r| {
                system.exits[r]
                    .iter()
                    .map(|exit| system.prepare(r, exit))
                    .collect()
            })
            .collect();
        system.reaches = system
            .switches
            .iter()
            .map(|exits| {
                exits
                    .iter()
                    .filter_map(|exit| exit.lattice.as_ref())
                    .map(Lattice::reach)
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
            if turns > MOST_TURNS * std::f64::consts::TAU {
                return Err(FlowError::TooFast {
                    regime: r,
                    oscillations: turns / std::f64::consts::TAU,
                    limit: MOST_TURNS,
                });
            }
        }
        system.fastest = rates
            .flat_map(|[re, im]| re.iter().zip(im).map(|(re, im)| re.hypot(*im)))
            .fold(0.0, f64::max);
        Ok(system)
    }

    /// Dimension of the state.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The drive.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The regimes.
    pub fn regimes(&self) -> &[Regime] {
        &self.regimes
    }

    /// The exits of each regime.
    pub fn exits(&self) -> &[Vec<Exit>] {
        &self.exits
    }

    /// The largest angle that any term turns through in a drive period.
    pub(crate) fn largest_angle(&self) -> f64 {
        self.fastest * self.drive.period()
    }

    /// The largest `|λ|` of any regime or tone.
    pub(crate) fn fastest(&self) -> f64 {
        self.fastest
    }

    pub(crate) fn packed_rates(&self) -> &[Vec<[Pack; 2]>] {
        &self.rates
    }

    /// How far the lattices of a regime's guards reach.
    pub(crate) fn lattice_reach(&self, regime: usize) -> f64 {
        self.reaches[regime]
    }

    pub(crate) fn prepared(&self, regime: usize) -> &[PreparedExit] {
        &self.switches[regime]
    }

    /// The regime in which a motion starts at state `x` and time `t`: the first
    /// whose guards are all positive, a guard that is zero within rounding counting
    /// as positive when its first non-zero derivative is. Says as well which guard
    /// starts at zero. A sticking regime is entered only from a state that sticks. Where
    /// no regime holds the state, it is one whose passed exit resets it to a state that
    /// the next regime holds; the exit is taken at once.
    ///
    /// # Errors
    /// [`FlowError::NoRegime`] when there is none.
    pub fn regime_at(&self, x: &[f64], t: f64) -> Result<(usize, Option<usize>), FlowError> {
        let (regime, surface) = self.start_at(x, t)?;
        Ok((regime, surface.map(|(exit, _)| exit)))
    }

    /// The same, with how the guard that starts at zero rises.
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
                    && self.exits[r]
                        .iter()
                        .all(|exit| exit.guard.at(&self.drive, x, t) >= -computed(r, &exit.guard))
            })
            .map(|r| (r, None))
            .ok_or(FlowError::NoRegime)
    }

    /// The first regime that holds the state, outputs within `tolerance` being zero.
    fn regime_within(
        &self,
        x: &[f64],
        t: f64,
        tolerance: &impl Fn(usize, &Output) -> f64,
    ) -> Option<(usize, Option<(usize, Start)>)> {
        self.exits.iter().enumerate().find_map(|(r, exits)| {
            if !self.may_stick(r, x, t, tolerance) {
                return None;
            }
            let mut surface = None;
            let inside = exits.iter().enumerate().all(|(e, exit)| {
                let value = exit.guard.at(&self.drive, x, t);
                if value.abs() <= tolerance(r, &exit.guard) {
                    let start = self.rises(r, &exit.guard, x, t, tolerance);
                    surface = start.map(|start| (e, start));
                    return start.is_some();
                }
                value > 0.0
            });
            inside.then_some((r, surface))
        })
    }

    /// The regime whose passed exit resets the state to one that the next regime holds.
    fn left_at_once(
        &self,
        x: &[f64],
        t: f64,
        tolerance: &impl Fn(usize, &Output) -> f64,
    ) -> Option<usize> {
        let state = DVector::from_column_slice(x);
        let leads_on = |exit: &Exit| {
            let Some(reset) = exit.reset.as_ref().filter(|_| exit.sticking.is_none()) else {
                return false;
            };
            let after = &reset.matrix * &state + reset.offset.at(&self.drive, t);
            let held = self.regime_within(after.as_slice(), t, tolerance);
            exit.guard.at(&self.drive, x, t) <= 0.0 && held.is_some_and(|(r, _)| r == exit.target)
        };
        (0..self.regimes.len()).find(|&r| self.exits[r].iter().any(leads_on))
    }

    /// Whether regime `r` is no sticking regime, or one in which this state sticks:
    /// guard and rate of the impact are zero.
    fn may_stick(
        &self,
        r: usize,
        x: &[f64],
        t: f64,
        tolerance: &impl Fn(usize, &Output) -> f64,
    ) -> bool {
        let mut impacts = self.exits.iter().enumerate().flat_map(|(from, exits)| {
            let leads_here = move |e: &&Exit| e.sticking.as_ref().is_some_and(|s| s.regime == r);
            exits.iter().filter(leads_here).map(move |e| (from, e))
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

    /// How a guard that is zero rises, if it does: by its first derivative that does not vanish.
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

    /// The size of rounding errors that an output has along the motion through this state:
    /// that of all its modal terms, which cancel in the output itself.
    fn motion_rounding(&self, r: usize, output: &Output, x: &[f64], t: f64) -> f64 {
        let regime = &self.regimes[r];
        let modal = regime.project(output);
        let mut q = vec![Complex::new(0.0, 0.0); regime.basis().len()];
        regime.to_modal(&self.drive, x, t, &mut vec![0.0; x.len()], &mut q);
        let own: f64 = modal
            .modal
            .iter()
            .zip(&q)
            .map(|(w, q)| (w * q).norm())
            .sum();
        let forced: f64 = modal.tones.iter().map(|z| z.norm()).sum();
        f64::EPSILON * (own + forced + modal.constant.abs()) + rounding(output, x)
    }

    fn prepare(&self, from: usize, exit: &Exit) -> PreparedExit {
        let acceleration = exit.sticking.as_ref().map(|_| {
            let target = &self.regimes[exit.target];
            exit.guard
                .rate(target.matrix(), target.forcing(), &self.drive)
                .rate(target.matrix(), target.forcing(), &self.drive)
        });
        let guard = self.regimes[from].project(&exit.guard);
        let kernel = Kernel::new(&self.regimes[from], &self.drive, &guard);
        let clustered = !self.regimes[from].basis().clusters.is_empty();
        PreparedExit {
            lattice: (!clustered)
                .then(|| Lattice::new(&kernel, self.drive.period()))
                .flatten(),
            kernel,
            guard,
            switch: self.switch(from, exit.target, exit.reset.as_ref(), &exit.guard),
            sticking: exit
                .sticking
                .as_ref()
                .map(|s| self.switch(from, s.regime, Some(&s.reset), &exit.guard)),
            twin: if exit.release {
                // After release the guard that starts at zero is the impact's.
                self.exits[exit.target]
                    .iter()
                    .position(|e| e.sticking.as_ref().is_some_and(|s| s.regime == from))
            } else {
                self.twin(&exit.guard, exit.target)
            },
            sticking_twin: exit
                .sticking
                .as_ref()
                .and_then(|s| self.twin(&exit.guard, s.regime)),
            acceleration,
        }
    }

    /// The exit of `target` whose guard is `guard` or its negative.
    fn twin(&self, guard: &Output, target: usize) -> Option<usize> {
        let reversed = guard.scaled(-1.0);
        self.exits[target]
            .iter()
            .position(|e| e.guard == reversed || e.guard == *guard)
    }

    fn switch(&self, from: usize, to: usize, reset: Option<&Reset>, guard: &Output) -> Switch {
        let (a, b) = (&self.regimes[from], &self.regimes[to]);
        let n = self.dimension;
        let (right, left) = (&a.basis().right, &b.basis().left);
        let (ma, mb) = (right.ncols(), left.nrows());
        // x⁻ = Re(R q) = [Re R, −Im R] [Re q; Im q]
        let from_modal = DMatrix::from_fn(n, 2 * ma, |i, k| {
            if k < ma {
                right[(i, k)].re
            } else {
                -right[(i, k - ma)].im
            }
        });
        let to_modal = DMatrix::from_fn(2 * mb, n, |k, i| {
            if k < mb {
                left[(k, i)].re
            } else {
                left[(k - mb, i)].im
            }
        });
        let (matrix, shift) = match reset {
            None => (&to_modal * &from_modal, a.response().clone()),
            Some(reset) => (
                &to_modal * &reset.matrix * &from_modal,
                a.response().mapped(&reset.matrix).plus(1.0, &reset.offset),
            ),
        };
        let shift = shift.plus(-1.0, b.response());
        let packed = PackedSwitch::new(&matrix, &to_modal, &shift);
        let saltation = self.constant_saltation(from, to, reset, guard);
        // With J the jump, L (J + u hᵀ) R = L J R + (L u)(hᵀ R).
        let tangent = saltation.as_ref().map(|u| {
            let mut tangent = matrix.clone();
            let row = (&guard.row * &from_modal).transpose();
            tangent.ger(1.0, &(&to_modal * u), &row, 1.0);
            tangent
        });
        Switch {
            from,
            to,
            matrix,
            packed,
            saltation,
            tangent,
            from_modal,
            to_modal,
        }
    }

    /// `u` with `f⁺(x⁺) − R f⁻(x⁻) − ρ̇ = u ġ` for every state on the guard's zero
    /// set, where such a `u` exists.
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

    /// `f⁺(Rx + ρ, t) − R f⁻(x, t) − ρ̇` as an affine function of the state.
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

    /// The saltation matrix (`n × n`) of exit `exit` of regime `from` (into its
    /// sticking regime if `stuck`) at state `x` before the switch and time `t`.
    ///
    /// Constant wherever the field's jump is proportional to the guard's rate;
    /// otherwise `R + (f⁺ − R f⁻ − ρ̇) hᵀ/ġ`, singular at grazing.
    pub fn saltation(
        &self,
        from: usize,
        exit: usize,
        stuck: bool,
        x: &DVector<f64>,
        t: f64,
    ) -> DMatrix<f64> {
        let description = &self.exits[from][exit];
        let prepared = &self.switches[from][exit];
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

fn packed_rates(regime: &Regime, drive: &Drive) -> Vec<[Pack; 2]> {
    let tones = drive.frequencies().iter().map(|&w| Complex::new(0.0, w));
    let rates: Vec<Complex> = regime
        .basis()
        .eigenvalues
        .iter()
        .copied()
        .chain(tones)
        .collect();
    let mut packs = vec![[[0.0; WIDTH]; 2]; rates.len().div_ceil(WIDTH)];
    for (k, rate) in rates.into_iter().enumerate() {
        packs[k / WIDTH][0][k % WIDTH] = rate.re;
        packs[k / WIDTH][1][k % WIDTH] = rate.im;
    }
    packs
}

/// Oscillations of a mode in one drive period that are followed.
const MOST_TURNS: f64 = 1e7;

/// Derivatives of a guard that are looked at where it starts at zero.
const FLATTEST: usize = 6;

/// A state is on a surface when its guard is within this many rounding errors of zero: a
/// state computed a moment after a switch is no nearer.
pub(crate) const ON_SURFACE: f64 = 32.0;

/// The size of rounding errors in an output's value.
pub(crate) fn rounding(output: &Output, x: &[f64]) -> f64 {
    let linear: f64 = output.row.iter().zip(x).map(|(r, x)| (r * x).abs()).sum();
    let harmonic: f64 = output.tones.iter().map(|z| z.norm()).sum();
    f64::EPSILON * (linear + output.constant.abs() + harmonic)
}

/// An affine-harmonic scalar as one vector, for projections.
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
