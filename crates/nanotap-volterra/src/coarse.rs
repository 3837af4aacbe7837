//! A cheap, approximate flow for following transients.
//!
//! Steps of tabulated lengths `T/16 · 2⁻ˡ` carry the modes by their exponentials, the drive by
//! rotated phasors and the force by the exponential Runge–Kutta method of order 4 of Cox and
//! Matthews (J. Comput. Phys. 176, 2002): the force is a parabola in time through its values at
//! the start, the middle and the end of a step, integrated exactly against the modes, so that
//! modes much faster than a step follow quasi-statically. Since the force is one scalar, a step
//! costs four evaluations of the law and some 30 products a mode.
//!
//! The step is chosen by how far the values of the force in it differ, which overestimates the
//! error: at the default tolerance one period is off by some 1e-7 of the amplitude, near grazing
//! by up to 1e-4. Near a pole of the force all its values in a step may be small although the step
//! leads through the pole: a step of which a stage, the end or the least gap between them lies at or
//! behind the pole has an infinite error. A switch of the law is
//! located on partial steps. The motion at the end is a
//! smooth function of the start only to that error. Nothing is certified here; results are
//! computed by [`Flow`](crate::Flow).

use crate::VolterraError;
use crate::error::Refusal;
use crate::gap_table::GapTable;
use crate::law::{Approach, Exit, Guard};
use crate::modes::Block;
use crate::step::Statistics;
use crate::system::System;
use nalgebra::DMatrix;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Number of tabulated step lengths; the longest is a sixteenth of the fastest tone's period.
const LEVELS: usize = 20;
/// Level of the step length with which a period starts.
const FIRST_LEVEL: usize = 2;
/// Largest change of the gap's rate by a step's estimated error, as a fraction of the drive's
/// frequency times the size of the motion.
pub const TOLERANCE: f64 = 2e-5;
/// Fraction of the allowed error below which the next step is twice as long.
const GROWTH: f64 = 1.0 / 12.0;
/// Fraction of the amplitude that is the size of the motion if the gap is smaller.
const SWING: f64 = 0.3;
/// Overshoot at which a switch is located, as a fraction of the size of the motion: if the force
/// jumps, and if it is continuous.
const BEYOND: [f64; 2] = [1e-8, 1e-6];
/// Angle, in radians, through which a mode may turn on half a step and still be resolved by the
/// search for switches.
const RESOLVED: f64 = 1.5;
/// Amplitude of unresolved modes, as a fraction of the size of the motion, above which steps near a
/// switch are shortened.
const UNRESOLVED: f64 = 1e-4;
/// Largest number of steps tried in one oscillation of the fastest tone.
const MAX_STEPS: u64 = 20_000;
/// Number of evaluations of the force in an explicit step.
const STEP_EVALUATIONS: u64 = 4;
/// Number of steps between two updates of the budget and checks of the cancel flag.
const POLL: u64 = 64;
/// Number of switches at one instant above which an endless sequence of switches is reported.
const MAX_SWITCHES_AT_ONCE: usize = 64;
/// Largest number of branches for which switches are located; a law with more, whose gap and rate
/// determine the branch, is evaluated by lookup.
const MAX_LOCATED_BRANCHES: usize = 8;
/// Decay exponent of a disturbance over a step, by the damping of the force, above which the step
/// is implicit.
const STIFF: f64 = 1.0;
/// Fraction of the allowed error to which the forces of an implicit step are iterated.
const CONVERGED: f64 = 0.02;
/// Largest number of iterations for the forces of an implicit step.
const MAX_ITERATIONS: usize = 10;
/// Largest number of steps of the bracketed search for a switch.
const MAX_BISECTIONS: usize = 48;

/// An approximate motion of a [`System`] over drive periods, with its work space. Cloning shares
/// the tables.
#[derive(Clone, Debug)]
pub struct Coarse {
    tables: Arc<Tables>,
    work: Work,
}

#[derive(Clone, Debug)]
struct Work {
    now: Motion,
    next: Motion,
    /// Level of a partial step, recomputed for each length.
    part: Level,
    stages: Stages,
    /// Derivatives of the modal coordinates, column after column; empty if they are not computed.
    columns: Vec<[f64; 2]>,
    /// Size of the motion, in the unit of the gap.
    size: f64,
    statistics: Statistics,
}

#[derive(Debug)]
struct Tables {
    system: Arc<System>,
    period: f64,
    levels: Vec<Level>,
    table: GapTable,
    /// Rows that give the gap, its rate and its acceleration from each block's coordinates.
    readout: Vec<[f64; 2]>,
    rate_readout: Vec<[f64; 2]>,
    acceleration_readout: Vec<[f64; 2]>,
    source: Vec<[f64; 2]>,
    /// Acceleration of the gap under a unit force.
    mobility: f64,
    /// Change of the gap's rate by the forces at which their iteration ends.
    converged: f64,
    /// State of the forced response at phase 0.
    forced: Vec<f64>,
    /// Angular frequency that scales the allowed error.
    frequency: f64,
    /// Lowest and highest gap of each branch.
    bounds: Vec<[f64; 2]>,
    /// Gap at and behind which the law does not hold, because the force has a pole there; −∞ if it
    /// has none.
    pole: f64,
    /// Exits of each branch; empty if switches are not located.
    exits: Vec<Vec<CoarseExit>>,
    /// Whether the exits of each branch depend on the gap alone.
    by_gap_alone: Vec<bool>,
    /// Whether the branch is determined anew at each evaluation.
    by_lookup: bool,
    max_steps: u64,
}

#[derive(Clone, Copy, Debug)]
struct CoarseExit {
    exit: Exit,
    /// Overshoot at which the switch is located, as a fraction of the size of the motion; see
    /// [`BEYOND`].
    beyond: f64,
}

/// The position of a motion within a period, with gap, rate and force there.
#[derive(Clone, Debug)]
struct Motion {
    time: f64,
    branch: usize,
    modal: Vec<[f64; 2]>,
    /// `(cos ωt, sin ωt)` of each tone.
    phasors: Vec<[f64; 2]>,
    gap: f64,
    rate: f64,
    force: f64,
}

/// The stages of a step: gap, rate and force at each.
#[derive(Clone, Copy, Debug, Default)]
struct Stages {
    gaps: [f64; 4],
    rates: [f64; 4],
    forces: [f64; 4],
    /// Whether the second stage is at a third of the step and its force unknown, as in an
    /// [`ImplicitLevel`].
    implicit: bool,
    /// Number of evaluations of the force and its slopes.
    evaluations: u64,
}

/// An implicit step. The force is a straight line in time through its values at a third and at the
/// end of the step, both unknown: the Radau IIA method of order 3 with exponentials of the modes.
/// It remains stable under a damping that is much faster than the step.
#[derive(Clone, Copy, Debug, Default)]
struct ImplicitLevel {
    /// Weights of the two forces in gap and rate at a third, in the middle and at the end.
    weights: [[[f64; 2]; 2]; 3],
}

/// The block's coordinates in an [`ImplicitLevel`].
#[derive(Clone, Copy, Debug, Default)]
struct ImplicitBlock {
    /// Exponential `e^{Bh/3}` of the block over a third of the step.
    third: [[f64; 2]; 2],
    /// Weights of the two forces in the coordinates at the end.
    weights: [[f64; 2]; 2],
}

/// Quantities of a step that depend on its length only.
#[derive(Clone, Debug, Default)]
struct Level {
    length: f64,
    blocks: Vec<BlockStep>,
    /// `(cos, sin)` of the angle through which each tone turns in half a step.
    turns: Vec<[f64; 2]>,
    /// Gap and rate in the middle from a unit force in the stage before.
    middle: [f64; 2],
    /// Gap and rate of the fourth stage from a unit force in the first stage; for the third stage
    /// they are twice `middle`.
    fourth: [f64; 2],
    /// Gap and rate at the end from the three weighted forces.
    end: [[f64; 2]; 3],
    /// Blocks that the search for switches cannot resolve.
    unresolved: Vec<usize>,
    implicit: ImplicitLevel,
    implicit_blocks: Vec<ImplicitBlock>,
    /// `(cos, sin)` of the angle through which each tone turns in a third of a step.
    third_turns: Vec<[f64; 2]>,
}

#[derive(Clone, Copy, Debug, Default)]
struct BlockStep {
    /// Exponential `e^{Bh/2}` of the block over half a step.
    half: [[f64; 2]; 2],
    /// Weights in the coordinates at the end of the forces at the start, in the middle (each of the
    /// two) and at the end.
    weights: [[f64; 2]; 3],
}

fn product(m: &[[f64; 2]; 2], [x, y]: [f64; 2]) -> [f64; 2] {
    [m[0][0] * x + m[0][1] * y, m[1][0] * x + m[1][1] * y]
}

fn square([[a, b], [c, d]]: &[[f64; 2]; 2]) -> [[f64; 2]; 2] {
    [
        [a * a + b * c, a * b + b * d],
        [c * a + d * c, c * b + d * d],
    ]
}

fn dot([a, b]: [f64; 2], [x, y]: [f64; 2]) -> f64 {
    a * x + b * y
}

/// Computes `∫₀¹ e^{Bhσ} σʲ dσ b` for `j = 0, 1, 2`, given `e^{Bh}`.
fn moments(block: &Block, h: f64, exp: &[[f64; 2]; 2], b: [f64; 2]) -> [[f64; 2]; 3] {
    let mut out = [[0.0; 2]; 3];
    let reach = block.rate() * h;
    if reach < 1.0 {
        // The last term is below 1e-16 of the first.
        let terms = if reach < 0.02 { 8 } else { 18 };
        let mut term = b;
        for k in 0..terms {
            for (j, sum) in out.iter_mut().enumerate() {
                let factor = 1.0 / (k + j + 1) as f64;
                sum[0] += factor * term[0];
                sum[1] += factor * term[1];
            }
            let factor = h / (k + 1) as f64;
            let next = product(&block.matrix, term);
            term = [factor * next[0], factor * next[1]];
        }
        return out;
    }
    // By parts, from (Bh)⁻¹.
    let [[m00, m01], [m10, m11]] = block.matrix;
    let solve = |v: [f64; 2]| {
        if block.size == 1 {
            return [v[0] / (m00 * h), 0.0];
        }
        let determinant = (m00 * m11 - m01 * m10) * h;
        [
            (m11 * v[0] - m01 * v[1]) / determinant,
            (m00 * v[1] - m10 * v[0]) / determinant,
        ]
    };
    let end = product(exp, b);
    out[0] = solve([end[0] - b[0], end[1] - b[1]]);
    out[1] = solve([end[0] - out[0][0], end[1] - out[0][1]]);
    out[2] = solve([end[0] - 2.0 * out[1][0], end[1] - 2.0 * out[1][1]]);
    out
}

impl Level {
    /// Computes the quantities of an implicit step of its length.
    fn set_implicit(&mut self, system: &System, parts: &Readouts<'_>) {
        let h = self.length;
        self.implicit_blocks.clear();
        self.third_turns.clear();
        self.implicit = ImplicitLevel::default();
        for (k, block) in system.kernel().modes().blocks().iter().enumerate() {
            let source = parts.source[k];
            let third = block.exp(h / 3.0);
            let half = self.blocks[k].half;
            let [t0, t1, _] = moments(block, h / 3.0, &third, source);
            let [s0, s1, _] = moments(block, 0.5 * h, &half, source);
            let [m0, m1, _] = moments(block, h, &square(&half), source);
            // Of the straight line through the two forces.
            let combined =
                |h: f64, [a, b]: [f64; 2], [c, d]: [f64; 2], m0: [f64; 2], m1: [f64; 2]| {
                    [
                        [0, 1].map(|i| h * (a * m0[i] + b * m1[i])),
                        [0, 1].map(|i| h * (c * m0[i] + d * m1[i])),
                    ]
                };
            let end = combined(h, [0.0, 1.5], [1.0, -1.5], m0, m1);
            let places = [
                combined(h / 3.0, [1.0, 0.5], [0.0, -0.5], t0, t1),
                combined(0.5 * h, [0.75, 0.75], [0.25, -0.75], s0, s1),
                end,
            ];
            for (sums, forces) in self.implicit.weights.iter_mut().zip(places) {
                for (sum, weights) in sums.iter_mut().zip(forces) {
                    sum[0] += dot(parts.readout[k], weights);
                    sum[1] += dot(parts.rate_readout[k], weights);
                }
            }
            self.implicit_blocks.push(ImplicitBlock {
                third,
                weights: end,
            });
        }
        let tones = system.drive().tones.iter();
        self.third_turns.extend(tones.map(|tone| {
            let (sin, cos) = nanotap_arithmetic::sin_cos(h * tone.frequency / 3.0);
            [cos, sin]
        }));
    }

    /// Computes the quantities of a step of length `h`.
    fn set(&mut self, system: &System, parts: &Readouts<'_>, h: f64) {
        let kernel = system.kernel();
        self.length = h;
        self.blocks.clear();
        self.turns.clear();
        self.unresolved.clear();
        let (mut middle, mut fourth, mut end) = ([0.0; 2], [0.0; 2], [[0.0; 2]; 3]);
        for (k, block) in kernel.modes().blocks().iter().enumerate() {
            let half = block.exp(0.5 * h);
            let full = square(&half);
            let source = parts.source[k];
            let [a, ..] = moments(block, 0.5 * h, &half, source);
            let [m0, m1, m2] = moments(block, h, &full, source);
            let a = [0.5 * h * a[0], 0.5 * h * a[1]];
            let weights = [
                [0, 1].map(|i| h * (2.0 * m2[i] - m1[i])),
                [0, 1].map(|i| 2.0 * h * (m1[i] - m2[i])),
                [0, 1].map(|i| h * (m0[i] - 3.0 * m1[i] + 2.0 * m2[i])),
            ];
            let carried = product(&half, a);
            for (i, readout) in [parts.readout[k], parts.rate_readout[k]]
                .into_iter()
                .enumerate()
            {
                middle[i] += dot(readout, a);
                fourth[i] += dot(readout, carried) - dot(readout, a);
                for (sum, weight) in end.iter_mut().zip(weights) {
                    sum[i] += dot(readout, weight);
                }
            }
            self.blocks.push(BlockStep { half, weights });
            if block.rate() * 0.5 * h > RESOLVED {
                self.unresolved.push(k);
            }
        }
        self.middle = middle;
        self.fourth = fourth;
        self.end = end;
        let tones = system.drive().tones.iter();
        self.turns.extend(tones.map(|tone| {
            let (sin, cos) = nanotap_arithmetic::sin_cos(0.5 * h * tone.frequency);
            [cos, sin]
        }));
    }
}

/// The tables from which a [`Level`] is computed, in addition to the system.
struct Readouts<'a> {
    readout: &'a [[f64; 2]],
    rate_readout: &'a [[f64; 2]],
    source: &'a [[f64; 2]],
}

impl Tables {
    fn new(system: &Arc<System>, period: f64) -> Result<Self, VolterraError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(VolterraError::Value {
                what: "the period".into(),
                found: period,
                needed: "positive and finite",
            });
        }
        if system.law().surface().is_some() || system.law().takes_signal() {
            return Err(VolterraError::Relaxing);
        }
        let kernel = system.kernel();
        let blocks = kernel.modes().blocks();
        let parts = |v: &[f64]| -> Vec<[f64; 2]> {
            let second = |block: &Block| {
                if block.size == 2 {
                    v[block.start + 1]
                } else {
                    0.0
                }
            };
            blocks.iter().map(|b| [v[b.start], second(b)]).collect()
        };
        let readout = parts(&kernel.readout);
        let rate_readout = parts(&kernel.rate_readout);
        let source = parts(&kernel.source);
        let times_b = |row: [f64; 2], m: &[[f64; 2]; 2]| {
            [
                row[0] * m[0][0] + row[1] * m[1][0],
                row[0] * m[0][1] + row[1] * m[1][1],
            ]
        };
        let acceleration_readout = rate_readout
            .iter()
            .zip(blocks)
            .map(|(row, block)| times_b(*row, &block.matrix))
            .collect();
        let tones = &system.drive().tones;
        let fastest = tones.iter().map(|t| t.frequency).fold(0.0, f64::max);
        let oscillations = (fastest * period / TAU).round().max(1.0);
        let longest = period / (16.0 * oscillations);
        for block in blocks {
            let [[a, b], [c, d]] = block.matrix;
            let rate = block.rate();
            let determinant = if block.size == 1 {
                a * a
            } else {
                (a * d - b * c).abs()
            };
            if rate * longest >= 1.0 && determinant <= 1e-12 * rate * rate {
                return Err(VolterraError::IllConditioned {
                    residual: f64::INFINITY,
                });
            }
        }
        let of = Readouts {
            readout: &readout,
            rate_readout: &rate_readout,
            source: &source,
        };
        let levels = (0..LEVELS)
            .map(|l| {
                let mut level = Level::default();
                level.set(system, &of, longest / (1_u64 << l) as f64);
                if system.law().depends_on_rate() {
                    level.set_implicit(system, &of);
                }
                level
            })
            .collect();
        let law = system.law();
        let by_lookup =
            law.branches() > MAX_LOCATED_BRANCHES && !law.remembers() && !law.depends_on_rate();
        let branches = if by_lookup { 1 } else { law.branches() };
        let mut bounds = vec![[f64::NEG_INFINITY, f64::INFINITY]; branches];
        let mut exits = vec![Vec::new(); branches];
        if !by_lookup {
            for branch in 0..branches {
                for exit in system.exits(branch) {
                    let jump = match exit.guard {
                        Guard::Falls(level) => {
                            bounds[branch][0] = bounds[branch][0].max(level);
                            Some(level)
                        }
                        Guard::Rises(level) => {
                            bounds[branch][1] = bounds[branch][1].min(level);
                            Some(level)
                        }
                        Guard::Turns | Guard::Own(_) => None,
                    };
                    let continuous = jump.is_some_and(|level| {
                        let [a, b] = [branch, exit.target].map(|b| law.value(b, level, 0.0));
                        (a - b).abs() <= 1e-9 * a.abs().max(b.abs()) && !law.depends_on_rate()
                    });
                    exits[branch].push(CoarseExit {
                        exit: *exit,
                        beyond: BEYOND[usize::from(continuous)],
                    });
                }
            }
        }
        let mut forced = vec![0.0; system.dimension()];
        system.write_forced(0.0, &mut forced);
        let [swing, speed] = system.gap_sizes;
        let slowest = kernel.rates.iter().copied().filter(|r| *r > 0.0);
        let frequency = if swing > 0.0 {
            speed / swing
        } else {
            slowest
                .fold(f64::INFINITY, f64::min)
                .min(TAU / period * oscillations)
        };
        Ok(Self {
            mobility: (rate_readout.iter().zip(&source))
                .map(|(r, b)| dot(*r, *b))
                .sum::<f64>()
                .abs(),
            period,
            levels,
            converged: CONVERGED
                * TOLERANCE
                * frequency
                * system.drive().offset.abs().max(SWING * swing),
            table: GapTable::new(system),
            readout,
            rate_readout,
            acceleration_readout,
            source,
            forced,
            frequency,
            bounds,
            pole: law.pole().unwrap_or(f64::NEG_INFINITY),
            by_gap_alone: exits
                .iter()
                .map(|exits: &Vec<CoarseExit>| {
                    let mut guards = exits.iter().map(|exit| exit.exit.guard);
                    guards.all(|guard| matches!(guard, Guard::Falls(_) | Guard::Rises(_)))
                })
                .collect(),
            exits,
            by_lookup,
            max_steps: MAX_STEPS.saturating_mul(oscillations as u64),
            system: Arc::clone(system),
        })
    }

    fn readouts(&self) -> Readouts<'_> {
        Readouts {
            readout: &self.readout,
            rate_readout: &self.rate_readout,
            source: &self.source,
        }
    }

    /// Returns the force on a branch; beyond the gaps of the branch, the force at their end.
    fn force(&self, branch: usize, gap: f64, rate: f64) -> f64 {
        let law = self.system.law();
        if self.by_lookup {
            return law.value(law.branch_at(gap, rate), gap, rate);
        }
        // The bounds of a law with extreme constants may be in reverse order or not numbers.
        let [low, high] = self.bounds[branch];
        self.table
            .force(&self.system, branch, gap.max(low).min(high), rate)
    }

    /// Returns the derivatives of [`Self::force`] by gap and rate; at the end of a branch those
    /// inside it.
    fn slopes(&self, branch: usize, gap: f64, rate: f64) -> [f64; 2] {
        let law = self.system.law();
        if self.by_lookup {
            let force = law.force(law.branch_at(gap, rate), gap, rate);
            return [force.by_gap, force.by_rate];
        }
        let [low, high] = self.bounds[branch];
        self.table
            .slopes(&self.system, branch, gap.max(low).min(high), rate)
    }

    /// Reports whether the law holds at all of these gaps.
    fn holds_at(&self, gaps: &[f64]) -> bool {
        gaps.iter().all(|gap| *gap > self.pole)
    }

    fn guard(&self, guard: Guard, gap: f64, rate: f64) -> f64 {
        match guard {
            Guard::Falls(level) => gap - level,
            Guard::Rises(level) => level - gap,
            Guard::Turns => -rate,
            Guard::Own(index) => self.system.law().guard(index, gap, rate).value,
        }
    }

    /// Returns the guard's derivatives by gap and rate.
    fn guard_slopes(&self, guard: Guard, gap: f64, rate: f64) -> [f64; 2] {
        match guard {
            Guard::Falls(_) => [1.0, 0.0],
            Guard::Rises(_) => [-1.0, 0.0],
            Guard::Turns => [0.0, -1.0],
            Guard::Own(index) => {
                let own = self.system.law().guard(index, gap, rate);
                [own.by_gap, own.by_rate]
            }
        }
    }

    /// Sets gap and rate of `motion` from its coordinates and phasors.
    fn read(&self, motion: &mut Motion) {
        let (mut gap, mut rate) = (self.system.gap_constant, 0.0);
        let tones = self.system.drive().tones.iter().zip(&self.system.gap_tones);
        for ((tone, z), [cos, sin]) in tones.zip(&motion.phasors) {
            gap += z.re * cos - z.im * sin;
            rate -= tone.frequency * (z.re * sin + z.im * cos);
        }
        for (k, y) in motion.modal.iter().enumerate() {
            gap += dot(self.readout[k], *y);
            rate += dot(self.rate_readout[k], *y);
        }
        (motion.gap, motion.rate) = (gap, rate);
    }

    /// Computes a step, explicit or implicit; returns the estimate of its error in the gap's rate.
    fn step_by(
        &self,
        implicit: bool,
        level: &Level,
        from: &Motion,
        to: &mut Motion,
        stages: &mut Stages,
    ) -> f64 {
        if implicit {
            self.implicit_step(level, from, to, stages)
        } else {
            self.step(level, from, to, stages)
        }
    }

    /// Returns the exponent by which the damping of the force reduces a disturbance of the rate in
    /// a step.
    fn stiffness(&self, level: &Level, from: &Motion) -> f64 {
        let [_, by_rate] = self.slopes(from.branch, from.gap, from.rate);
        -by_rate * self.mobility * level.length
    }

    /// Computes an implicit step as [`step`](Self::step) does an explicit one, with the two forces
    /// of [`ImplicitLevel`] by Newton's method. The error is infinite if that does not converge, or
    /// if the law does not hold at one of the gaps.
    fn implicit_step(
        &self,
        level: &Level,
        from: &Motion,
        to: &mut Motion,
        stages: &mut Stages,
    ) -> f64 {
        let constant = self.system.gap_constant;
        // Gap and rate at a third, in the middle and at the end without the force.
        let mut places = [[constant, 0.0]; 3];
        let tones = self.system.drive().tones.iter().zip(&self.system.gap_tones);
        for (k, (tone, z)) in tones.enumerate() {
            let turned = |[c, s]: [f64; 2], [turn_c, turn_s]: [f64; 2]| {
                [c * turn_c - s * turn_s, c * turn_s + s * turn_c]
            };
            let from = from.phasors[k];
            let middle = turned(from, level.turns[k]);
            let end = turned(middle, level.turns[k]);
            for (place, [c, s]) in
                places
                    .iter_mut()
                    .zip([turned(from, level.third_turns[k]), middle, end])
            {
                place[0] += z.re * c - z.im * s;
                place[1] -= tone.frequency * (z.re * s + z.im * c);
            }
            to.phasors[k] = end;
        }
        for (k, block) in level.blocks.iter().enumerate() {
            let third = product(&level.implicit_blocks[k].third, from.modal[k]);
            let half = product(&block.half, from.modal[k]);
            let full = product(&block.half, half);
            for (place, y) in places.iter_mut().zip([third, half, full]) {
                place[0] += dot(self.readout[k], y);
                place[1] += dot(self.rate_readout[k], y);
            }
            to.modal[k] = full;
        }
        let weights = &level.implicit.weights;
        let at = |place: usize, forces: [f64; 2]| {
            [0, 1].map(|i| {
                places[place][i]
                    + weights[place][0][i] * forces[0]
                    + weights[place][1][i] * forces[1]
            })
        };
        let unit = level.length * self.mobility;
        let branch = from.branch;
        // A force that would change the rate by more than the motion's own size does not last.
        let lasts = CONVERGED * TOLERANCE * unit * from.force.abs() <= self.converged;
        let mut forces = [if lasts { from.force } else { 0.0 }; 2];
        let mut change = f64::INFINITY;
        stages.evaluations = 0;
        for _ in 0..MAX_ITERATIONS {
            // Two forces, their slopes and the equations for both take as long as eight forces.
            stages.evaluations += 8;
            let [third, end] = [at(0, forces), at(2, forces)];
            let residuals = [
                self.force(branch, third[0], third[1]) - forces[0],
                self.force(branch, end[0], end[1]) - forces[1],
            ];
            let slopes = [third, end].map(|[gap, rate]| self.slopes(branch, gap, rate));
            // One minus the derivative of the forces by the forces.
            let matrix = [0, 1]
                .map(|i| [0, 1].map(|j| f64::from(i == j) - dot(slopes[i], weights[2 * i][j])));
            let Some(step) = solve(&matrix, residuals) else {
                return f64::INFINITY;
            };
            let before = change;
            change = unit * step[0].abs().max(step[1].abs());
            forces = [forces[0] + step[0], forces[1] + step[1]];
            if change.is_nan() || change > 4.0 * before {
                return f64::INFINITY;
            }
            if change <= self.converged {
                break;
            }
        }
        if change > self.converged {
            return f64::INFINITY;
        }
        for (y, block) in to.modal.iter_mut().zip(&level.implicit_blocks) {
            for i in 0..2 {
                y[i] += block.weights[0][i] * forces[0] + block.weights[1][i] * forces[1];
            }
        }
        let [third, middle, end] = [0, 1, 2].map(|place| at(place, forces));
        (to.gap, to.rate) = (end[0], end[1]);
        to.time = from.time + level.length;
        to.branch = branch;
        let mean = 0.75 * forces[0] + 0.25 * forces[1];
        *stages = Stages {
            gaps: [from.gap, third[0], middle[0], end[0]],
            rates: [from.rate, third[1], middle[1], end[1]],
            forces: [from.force, mean, mean, forces[1]],
            implicit: true,
            evaluations: stages.evaluations + 1,
        };
        if !self.holds_at(&stages.gaps[1..]) {
            return f64::INFINITY;
        }
        // What the line misses of the force at the start, as far as the damping leaves it.
        let missed = from.force - 1.5 * forces[0] + 0.5 * forces[1];
        let [_, by_rate] = self.slopes(branch, end[0], end[1]);
        unit * missed.abs() / (6.0 * (1.0 + unit * by_rate.abs()))
    }

    /// Computes one explicit step; returns the estimate of its error in the gap's rate, infinite if
    /// the law does not hold at one of the gaps.
    #[inline]
    fn step(&self, level: &Level, from: &Motion, to: &mut Motion, stages: &mut Stages) -> f64 {
        let constant = self.system.gap_constant;
        let (mut mid, mut end) = ([constant, 0.0], [constant, 0.0]);
        let tones = self.system.drive().tones.iter().zip(&self.system.gap_tones);
        for (k, (tone, z)) in tones.enumerate() {
            let ([c, s], [turn_c, turn_s]) = (from.phasors[k], level.turns[k]);
            let (c, s) = (c * turn_c - s * turn_s, c * turn_s + s * turn_c);
            mid[0] += z.re * c - z.im * s;
            mid[1] -= tone.frequency * (z.re * s + z.im * c);
            let (c, s) = (c * turn_c - s * turn_s, c * turn_s + s * turn_c);
            end[0] += z.re * c - z.im * s;
            end[1] -= tone.frequency * (z.re * s + z.im * c);
            to.phasors[k] = [c, s];
        }
        for (k, block) in level.blocks.iter().enumerate() {
            let half = product(&block.half, from.modal[k]);
            let full = product(&block.half, half);
            mid[0] += dot(self.readout[k], half);
            mid[1] += dot(self.rate_readout[k], half);
            end[0] += dot(self.readout[k], full);
            end[1] += dot(self.rate_readout[k], full);
            to.modal[k] = full;
        }
        let branch = from.branch;
        let k1 = from.force;
        let second = [0, 1].map(|i| mid[i] + level.middle[i] * k1);
        let k2 = self.force(branch, second[0], second[1]);
        let third = [0, 1].map(|i| mid[i] + level.middle[i] * k2);
        let k3 = self.force(branch, third[0], third[1]);
        let fourth = [0, 1].map(|i| end[i] + level.fourth[i] * k1 + 2.0 * level.middle[i] * k3);
        let k4 = self.force(branch, fourth[0], fourth[1]);
        for (y, block) in to.modal.iter_mut().zip(&level.blocks) {
            for i in 0..2 {
                y[i] += block.weights[0][i] * k1
                    + block.weights[1][i] * (k2 + k3)
                    + block.weights[2][i] * k4;
            }
        }
        let [gap, rate] = [0, 1].map(|i| {
            end[i] + level.end[0][i] * k1 + level.end[1][i] * (k2 + k3) + level.end[2][i] * k4
        });
        (to.gap, to.rate) = (gap, rate);
        to.time = from.time + level.length;
        to.branch = branch;
        *stages = Stages {
            gaps: [from.gap, second[0], third[0], fourth[0]],
            rates: [from.rate, second[1], third[1], fourth[1]],
            forces: [k1, k2, k3, k4],
            implicit: false,
            evaluations: 3,
        };
        if !self.holds_at(&stages.gaps[1..]) || gap <= self.pole {
            return f64::INFINITY;
        }
        level.length * self.mobility * ((k1 - k2 - k3 + k4).abs() + (k2 - k3).abs()) / 6.0
    }

    /// Carries derivatives of the modal coordinates along the step with these stages to `end_gap`.
    /// If the slope by the gap is infinite at an end of the step, its mean over the step replaces
    /// it at all stages.
    fn carry(
        &self,
        level: &Level,
        branch: usize,
        stages: &Stages,
        mean_slope_to: Option<f64>,
        columns: &mut [[f64; 2]],
    ) {
        let mut slopes: [[f64; 2]; 4] =
            std::array::from_fn(|i| self.slopes(branch, stages.gaps[i], stages.rates[i]));
        if let Some(end) = mean_slope_to {
            let [start, rate] = [stages.gaps[0], stages.rates[2]];
            let rise = self.force(branch, end, rate) - self.force(branch, start, rate);
            let mean = if end == start {
                0.0
            } else {
                rise / (end - start)
            };
            for slope in &mut slopes {
                slope[0] = mean;
                // Numbers with derivatives make 0 · ∞ of it where it vanishes.
                if !slope[1].is_finite() {
                    slope[1] = 0.0;
                }
            }
        }
        if stages.implicit {
            self.carry_implicitly(level, [slopes[1], slopes[3]], columns);
            return;
        }
        for column in columns.chunks_exact_mut(level.blocks.len()) {
            let (mut start, mut mid, mut end) = ([0.0; 2], [0.0; 2], [0.0; 2]);
            for (k, (y, block)) in column.iter_mut().zip(&level.blocks).enumerate() {
                let readouts = [self.readout[k], self.rate_readout[k]];
                let half = product(&block.half, *y);
                let full = product(&block.half, half);
                for i in 0..2 {
                    start[i] += dot(readouts[i], *y);
                    mid[i] += dot(readouts[i], half);
                    end[i] += dot(readouts[i], full);
                }
                *y = full;
            }
            let k1 = dot(slopes[0], start);
            let k2 = dot(slopes[1], [0, 1].map(|i| mid[i] + level.middle[i] * k1));
            let k3 = dot(slopes[2], [0, 1].map(|i| mid[i] + level.middle[i] * k2));
            let k4 = dot(
                slopes[3],
                [0, 1].map(|i| end[i] + level.fourth[i] * k1 + 2.0 * level.middle[i] * k3),
            );
            for (y, block) in column.iter_mut().zip(&level.blocks) {
                for i in 0..2 {
                    y[i] += block.weights[0][i] * k1
                        + block.weights[1][i] * (k2 + k3)
                        + block.weights[2][i] * k4;
                }
            }
        }
    }

    /// Carries derivatives as [`carry`](Self::carry) does, over an implicit step with these slopes
    /// at its two forces.
    fn carry_implicitly(&self, level: &Level, slopes: [[f64; 2]; 2], columns: &mut [[f64; 2]]) {
        let weights = &level.implicit.weights;
        let matrix =
            [0, 1].map(|i| [0, 1].map(|j| f64::from(i == j) - dot(slopes[i], weights[2 * i][j])));
        for column in columns.chunks_exact_mut(level.blocks.len()) {
            let (mut third, mut end) = ([0.0; 2], [0.0; 2]);
            for (k, y) in column.iter_mut().enumerate() {
                let readouts = [self.readout[k], self.rate_readout[k]];
                let part = product(&level.implicit_blocks[k].third, *y);
                let half = &level.blocks[k].half;
                *y = product(half, product(half, *y));
                for i in 0..2 {
                    third[i] += dot(readouts[i], part);
                    end[i] += dot(readouts[i], *y);
                }
            }
            let free = [dot(slopes[0], third), dot(slopes[1], end)];
            let forces = solve(&matrix, free).unwrap_or_default();
            for (y, block) in column.iter_mut().zip(&level.implicit_blocks) {
                for i in 0..2 {
                    y[i] += block.weights[0][i] * forces[0] + block.weights[1][i] * forces[1];
                }
            }
        }
    }

    /// Applies to the derivatives the saltation of a switch before which the force is `before`.
    fn saltate(&self, guard: Guard, motion: &Motion, before: f64, columns: &mut [[f64; 2]]) {
        let jump = motion.force - before;
        if jump == 0.0 {
            return;
        }
        let [by_gap, by_rate] = self.guard_slopes(guard, motion.gap, motion.rate);
        let mut speed = by_gap * motion.rate;
        if by_rate != 0.0 {
            let mut acceleration = 0.0;
            for (k, y) in motion.modal.iter().enumerate() {
                acceleration += dot(self.acceleration_readout[k], *y)
                    + dot(self.rate_readout[k], self.source[k]) * before;
            }
            let tones = self.system.drive().tones.iter().zip(&self.system.gap_tones);
            for ((tone, z), [cos, sin]) in tones.zip(&motion.phasors) {
                acceleration -= tone.frequency * tone.frequency * (z.re * cos - z.im * sin);
            }
            speed += by_rate * acceleration;
        }
        for column in columns.chunks_exact_mut(motion.modal.len()) {
            let mut change = 0.0;
            for (k, y) in column.iter().enumerate() {
                change +=
                    by_gap * dot(self.readout[k], *y) + by_rate * dot(self.rate_readout[k], *y);
            }
            let kick = jump * change / speed;
            for (y, b) in column.iter_mut().zip(&self.source) {
                y[0] += b[0] * kick;
                y[1] += b[1] * kick;
            }
        }
    }

    /// Returns twice the amplitude in the gap of the modes that the search for switches on a step
    /// of this length does not resolve.
    fn unresolved(&self, level: &Level, motion: &Motion) -> f64 {
        let norm = |[x, y]: [f64; 2]| (x * x + y * y).sqrt();
        let modes = level.unresolved.iter();
        modes
            .map(|&k| 2.0 * norm(self.readout[k]) * norm(motion.modal[k]))
            .sum()
    }
}

/// Solves two linear equations; `None` if they are singular.
fn solve([[a, b], [c, d]]: &[[f64; 2]; 2], [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let determinant = a * d - b * c;
    let solution = [(d * x - b * y) / determinant, (a * y - c * x) / determinant];
    solution.iter().all(|v| v.is_finite()).then_some(solution)
}

/// A part of a step between two points at which gap and rate are known.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    start: f64,
    length: f64,
    /// Value and slope in time of a function at both ends.
    values: [f64; 2],
    slopes: [f64; 2],
}

impl Stretch {
    /// Returns the cubic through values and slopes, at a fraction of the stretch.
    fn at(&self, x: f64) -> f64 {
        let (y, s) = (1.0 - x, self.length);
        let [a, b] = self.values;
        y * y * ((1.0 + 2.0 * x) * a + x * s * self.slopes[0])
            + x * x * ((1.0 + 2.0 * y) * b - y * s * self.slopes[1])
    }

    /// Returns the fraction at which the cubic is least, if it lies inside, with values falling
    /// before and rising after it.
    fn minimum(&self) -> Option<f64> {
        if !(self.slopes[0] < 0.0 && self.slopes[1] > 0.0) {
            return None;
        }
        // The derivative is a parabola that rises through zero once: p + q x + r x².
        let rise = (self.values[1] - self.values[0]) / self.length;
        let p = self.slopes[0];
        let q = 6.0 * rise - 4.0 * self.slopes[0] - 2.0 * self.slopes[1];
        let r = 3.0 * (self.slopes[0] + self.slopes[1]) - 6.0 * rise;
        let root = (q * q - 4.0 * p * r).max(0.0).sqrt();
        let x = if q > 0.0 {
            -2.0 * p / (q + root)
        } else {
            (root - q) / (2.0 * r)
        };
        Some(if x.is_finite() {
            x.clamp(0.0, 1.0)
        } else {
            0.5
        })
    }

    /// Returns the fraction at which the cubic falls to zero between 0 and `end`, given opposite
    /// signs there.
    fn root(&self, end: f64) -> f64 {
        let (mut low, mut high) = (0.0, end);
        for _ in 0..20 {
            let x = 0.5 * (low + high);
            if self.at(x) > 0.0 {
                low = x;
            } else {
                high = x;
            }
        }
        0.5 * (low + high)
    }
}

/// The time at which a guard is expected to fall on a step, and a later time at which it has
/// fallen.
#[derive(Clone, Copy, Debug)]
struct Fall {
    exit: CoarseExit,
    time: f64,
    until: f64,
}

impl Coarse {
    /// Creates the approximate flow of `system` over periods of length `period`, which must be a
    /// multiple of the period of every tone.
    ///
    /// # Errors
    /// If the period is not positive and finite, or a mode neither restores nor decays.
    pub fn new(system: &Arc<System>, period: f64) -> Result<Self, VolterraError> {
        let tables = Arc::new(Tables::new(system, period)?);
        let motion = Motion {
            time: 0.0,
            branch: 0,
            modal: vec![[0.0; 2]; tables.source.len()],
            phasors: vec![[1.0, 0.0]; system.drive().tones.len()],
            gap: 0.0,
            rate: 0.0,
            force: 0.0,
        };
        let work = Work {
            next: motion.clone(),
            now: motion,
            part: Level::default(),
            stages: Stages::default(),
            columns: Vec::new(),
            size: 1.0,
            statistics: Statistics::default(),
        };
        Ok(Self { tables, work })
    }

    /// Returns the cost of the runs so far.
    pub fn statistics(&self) -> Statistics {
        self.work.statistics
    }

    /// Returns the cost of the runs so far: evaluations of the force, in units of an explicit step.
    pub fn cost(&self) -> u64 {
        self.work.cost()
    }

    /// Replaces `state` at drive phase 0 by the state after `periods` periods and returns the
    /// branch of the law there. The motion begins on `branch` if gap and rate allow it, otherwise
    /// on the branch that the law takes without a history.
    ///
    /// # Errors
    /// If the state has the wrong length or is not finite, or the motion diverges, takes too many
    /// steps, or switches endlessly.
    pub fn run_periods(
        &mut self,
        state: &mut [f64],
        branch: Option<usize>,
        periods: usize,
    ) -> Result<usize, VolterraError> {
        let Self { tables, work } = self;
        work.columns.clear();
        work.begin(tables, state, branch)?;
        for _ in 0..periods {
            work.period(tables)?;
        }
        Ok(work.end(tables, state))
    }

    /// As [`Coarse::run_periods`] over one period, with the Jacobian (`n × n`) by the state, from
    /// the equations linearised along the steps.
    ///
    /// # Errors
    /// As [`Coarse::run_periods`].
    pub fn run_with_jacobian(
        &mut self,
        state: &mut [f64],
        branch: Option<usize>,
        jacobian: &mut DMatrix<f64>,
    ) -> Result<usize, VolterraError> {
        let Self { tables, work } = self;
        work.columns.clear();
        work.begin(tables, state, branch)?;
        let by_modal = work.period_with_columns(tables)?;
        let modes = tables.system.kernel().modes();
        jacobian.copy_from(&(modes.right() * by_modal * modes.left()));
        Ok(work.end(tables, state))
    }
}

impl Work {
    /// Runs one period with derivatives by modal coordinates.
    fn period_with_columns(&mut self, tables: &Tables) -> Result<DMatrix<f64>, VolterraError> {
        let blocks = tables.system.kernel().modes().blocks();
        let n = tables.system.dimension();
        self.columns.resize(n * blocks.len(), [0.0; 2]);
        for (k, block) in blocks.iter().enumerate() {
            for j in 0..block.size {
                self.columns[(block.start + j) * blocks.len() + k][j] = 1.0;
            }
        }
        self.period(tables)?;
        let mut out = DMatrix::zeros(n, n);
        for (c, column) in self.columns.chunks_exact(blocks.len()).enumerate() {
            for (block, y) in blocks.iter().zip(column) {
                for i in 0..block.size {
                    out[(block.start + i, c)] = y[i];
                }
            }
        }
        Ok(out)
    }

    fn begin(
        &mut self,
        tables: &Tables,
        state: &[f64],
        branch: Option<usize>,
    ) -> Result<(), VolterraError> {
        let system = &tables.system;
        if state.len() != system.dimension() {
            return Err(VolterraError::Shape {
                what: "the state",
                found: state.len(),
                expected: system.dimension(),
            });
        }
        if let Some(&found) = state.iter().find(|v| !v.is_finite()) {
            return Err(VolterraError::Value {
                what: "an entry of the state".into(),
                found,
                needed: "finite",
            });
        }
        let modes = system.kernel().modes();
        let left = modes.left();
        for (y, block) in self.now.modal.iter_mut().zip(modes.blocks()) {
            *y = [0.0; 2];
            for i in 0..block.size {
                for (j, (x, forced)) in state.iter().zip(&tables.forced).enumerate() {
                    y[i] += left[(block.start + i, j)] * (x - forced);
                }
            }
        }
        self.now.branch = 0;
        self.rewind(tables);
        if !tables.holds_at(&[self.now.gap]) {
            return Err(VolterraError::Uncertified {
                time: 0.0,
                gap: self.now.gap,
                reason: Refusal::Wall,
            });
        }
        if !tables.by_lookup {
            let (gap, rate) = (self.now.gap, self.now.rate);
            let possible = |b: &usize| {
                let mut exits = tables.exits.get(*b).into_iter().flatten();
                *b < tables.exits.len()
                    && exits.all(|e| tables.guard(e.exit.guard, gap, rate) >= 0.0)
            };
            let branch = branch.filter(possible);
            self.now.branch = branch.unwrap_or_else(|| system.law().branch_at(gap, rate));
            self.now.force = tables.force(self.now.branch, gap, rate);
        }
        Ok(())
    }

    /// Sets the motion's time to phase 0 and measures its size.
    fn rewind(&mut self, tables: &Tables) {
        let now = &mut self.now;
        now.time = 0.0;
        now.phasors.fill([1.0, 0.0]);
        tables.read(now);
        now.force = tables.force(now.branch, now.gap, now.rate);
        let mut amplitude = tables.system.gap_sizes[0];
        for (y, r) in now.modal.iter().zip(&tables.readout) {
            amplitude += (dot(*y, *y) * dot(*r, *r)).sqrt();
        }
        let offset = tables.system.drive().offset;
        let size = (SWING * amplitude).max(offset.abs());
        self.size = if size > 0.0 { size } else { 1.0 };
    }

    /// Writes the state and returns the branch.
    fn end(&self, tables: &Tables, state: &mut [f64]) -> usize {
        let modes = tables.system.kernel().modes();
        let right = modes.right();
        state.copy_from_slice(&tables.forced);
        for (y, block) in self.now.modal.iter().zip(modes.blocks()) {
            for j in 0..block.size {
                for (i, x) in state.iter_mut().enumerate() {
                    *x += right[(i, block.start + j)] * y[j];
                }
            }
        }
        if tables.by_lookup {
            tables.system.law().branch_at(self.now.gap, self.now.rate)
        } else {
            self.now.branch
        }
    }

    /// Runs one period from phase 0.
    fn period(&mut self, tables: &Tables) -> Result<(), VolterraError> {
        let mut spent = self.cost();
        let result = self.steps(tables, &mut spent);
        tables.system.cancel().spend(self.cost() - spent);
        result
    }

    /// Returns the evaluations of the force so far, in units of an explicit step.
    const fn cost(&self) -> u64 {
        self.statistics.evaluations / STEP_EVALUATIONS
    }

    /// Runs the steps of a period; `spent` is the cost already charged to the budget.
    fn steps(&mut self, tables: &Tables, spent: &mut u64) -> Result<(), VolterraError> {
        self.rewind(tables);
        let end = tables.period;
        let allowed = TOLERANCE * tables.frequency * self.size;
        let mut l = FIRST_LEVEL;
        let mut at_once = (0.0, 0);
        // Whether the slope of the force is infinite where the step begins.
        let mut steep = false;
        // After a switch the new branch may end at once.
        let mut fresh = true;
        let mut implicit = false;
        let rate_dependent = tables.system.law().depends_on_rate();
        let mut tried = 0;
        while end - self.now.time > 1e-13 * end {
            if tried % POLL == 0 {
                let (cancel, cost) = (tables.system.cancel(), self.cost());
                cancel.spend(cost - *spent);
                *spent = cost;
                if cancel.is_cancelled() {
                    return Err(VolterraError::Cancelled);
                }
            }
            tried += 1;
            if tried > tables.max_steps {
                return Err(VolterraError::TooManySteps {
                    steps: tried as usize,
                    time: self.now.time,
                });
            }
            let mut fall = if fresh { self.fallen(tables) } else { None };
            fresh = false;
            if fall.is_none() {
                let rest = end - self.now.time;
                let tabulated = tables.levels[l].length < rest;
                if !tabulated {
                    self.part.set(&tables.system, &tables.readouts(), rest);
                    if implicit {
                        self.part.set_implicit(&tables.system, &tables.readouts());
                    }
                }
                let level = if tabulated {
                    &tables.levels[l]
                } else {
                    &self.part
                };
                let mut error =
                    tables.step_by(implicit, level, &self.now, &mut self.next, &mut self.stages);
                self.statistics.evaluations += self.stages.evaluations;
                let mut refused = error > allowed || error.is_nan();
                if !refused {
                    match search(
                        tables,
                        level,
                        &self.now,
                        &self.next,
                        &self.stages,
                        self.size,
                        allowed,
                    ) {
                        Search::Refused => refused = true,
                        Search::BehindPole => (refused, error) = (true, f64::INFINITY),
                        Search::Fall(found) => fall = Some(found),
                        Search::None => {}
                    }
                }
                // A damping that is fast for the step makes it implicit.
                if rate_dependent && (refused || implicit) {
                    let stiff = tables.stiffness(level, &self.now) > STIFF;
                    if refused && stiff && !implicit {
                        implicit = true;
                        continue;
                    }
                    implicit = stiff;
                }
                if refused && l + 1 < LEVELS {
                    l += 1;
                    while !tabulated && l + 1 < LEVELS && tables.levels[l].length >= rest {
                        l += 1;
                    }
                    self.statistics.refused += 1;
                    continue;
                }
                if !error.is_finite() {
                    return Err(VolterraError::Uncertified {
                        time: self.now.time,
                        gap: self.now.gap,
                        reason: Refusal::Unresolved,
                    });
                }
                if fall.is_none() {
                    if !self.columns.is_empty() {
                        let to = steep.then_some(self.next.gap);
                        let branch = self.now.branch;
                        tables.carry(level, branch, &self.stages, to, &mut self.columns);
                    }
                    std::mem::swap(&mut self.now, &mut self.next);
                    self.now.force = tables.force(self.now.branch, self.now.gap, self.now.rate);
                    self.statistics.evaluations += 1;
                    self.statistics.steps += 1;
                    steep = false;
                    if error < GROWTH * allowed {
                        l = l.saturating_sub(1);
                    }
                    continue;
                }
            }
            let Some(fall) = fall else { continue };
            if !self.switch(tables, fall, steep, implicit)? {
                steep = false;
                continue;
            }
            steep = fall.exit.exit.after == Approach::Half;
            fresh = true;
            l = (l + 1).min(LEVELS - 1);
            if self.now.time - at_once.0 > 1e-13 * end {
                at_once = (self.now.time, 0);
            }
            at_once.1 += 1;
            if at_once.1 > MAX_SWITCHES_AT_ONCE {
                return Err(VolterraError::Accumulation {
                    time: self.now.time,
                    gap: self.now.gap,
                });
            }
        }
        let y = self.now.modal.iter().flatten();
        if y.chain([&self.now.force]).any(|y| !y.is_finite()) {
            return Err(VolterraError::Diverged { time: end });
        }
        Ok(())
    }

    /// Returns the exit through which the motion has already left its branch, if there is one.
    fn fallen(&self, tables: &Tables) -> Option<Fall> {
        let now = &self.now;
        let exits = tables.exits[now.branch].iter();
        let mut left = exits.filter(|exit| {
            let beyond = exit_tolerance(tables, exit, now, self.size);
            tables.guard(exit.exit.guard, now.gap, now.rate) < -1.5 * beyond
        });
        left.next().map(|exit| Fall {
            exit: *exit,
            time: 0.0,
            until: 0.0,
        })
    }

    /// Advances by partial steps to the time at which the guard of `fall` has just fallen, and
    /// switches. Returns whether it has switched: if the guard does not fall, the motion only
    /// advances to the end of the search.
    fn switch(
        &mut self,
        tables: &Tables,
        fall: Fall,
        steep: bool,
        implicit: bool,
    ) -> Result<bool, VolterraError> {
        let exit = fall.exit.exit;
        let beyond = exit_tolerance(tables, &fall.exit, &self.now, self.size);
        let mut fell = true;
        if fall.until > 0.0 {
            let value = |m: &Motion| tables.guard(exit.guard, m.gap, m.rate) + 0.5 * beyond;
            let (mut low, mut high) = (0.0, fall.until);
            let mut at_low = value(&self.now).max(0.0);
            let mut at_high = None;
            let mut time = fall.time;
            let mut error = 0.0;
            for count in 0..MAX_BISECTIONS {
                self.part.set(&tables.system, &tables.readouts(), time);
                if implicit {
                    self.part.set_implicit(&tables.system, &tables.readouts());
                }
                let (part, stages) = (&self.part, &mut self.stages);
                error = tables.step_by(implicit, part, &self.now, &mut self.next, stages);
                self.statistics.evaluations += self.stages.evaluations;
                let found = value(&self.next);
                fell = found <= 0.5 * beyond;
                if found.abs() <= 0.5 * beyond || high - low <= 1e-14 * tables.period {
                    break;
                }
                if found > 0.0 {
                    (low, at_low) = (time, found);
                } else {
                    (high, at_high) = (time, Some(found));
                }
                let slope = match exit.guard {
                    Guard::Falls(_) => self.next.rate,
                    Guard::Rises(_) => -self.next.rate,
                    Guard::Turns | Guard::Own(_) => 0.0,
                };
                let newton = time - found / slope;
                time = if slope < 0.0 && newton > low && newton <= high && count % 4 != 3 {
                    newton
                } else {
                    match at_high {
                        Some(at_high) if count % 3 != 2 && at_low > at_high => {
                            low + (high - low) * at_low / (at_low - at_high)
                        }
                        _ => 0.5 * (low + high),
                    }
                };
            }
            let is_finite = self.next.modal.iter().flatten().all(|y| y.is_finite());
            if !(is_finite && error < f64::INFINITY) {
                return Err(VolterraError::Uncertified {
                    time: self.now.time,
                    gap: self.now.gap,
                    reason: Refusal::Switch,
                });
            }
            if !self.columns.is_empty() {
                let steep = steep || exit.before == Approach::Half;
                let (to, branch) = (steep.then_some(self.next.gap), self.now.branch);
                tables.carry(&self.part, branch, &self.stages, to, &mut self.columns);
            }
            std::mem::swap(&mut self.now, &mut self.next);
            self.statistics.steps += 1;
        }
        let before = tables.force(self.now.branch, self.now.gap, self.now.rate);
        self.now.force = before;
        self.statistics.evaluations += 1;
        if fell {
            self.now.branch = exit.target;
            self.now.force = tables.force(exit.target, self.now.gap, self.now.rate);
            self.statistics.evaluations += 1;
            self.statistics.switches += 1;
            tables.saltate(exit.guard, &self.now, before, &mut self.columns);
        }
        Ok(fell)
    }
}

/// Returns how far beyond zero a guard is located, in the unit of the guard.
fn exit_tolerance(tables: &Tables, exit: &CoarseExit, motion: &Motion, size: f64) -> f64 {
    let beyond = exit.beyond * size;
    match exit.exit.guard {
        Guard::Falls(_) | Guard::Rises(_) => beyond,
        Guard::Turns => beyond * tables.frequency,
        Guard::Own(index) => {
            let own = tables.system.law().guard(index, motion.gap, motion.rate);
            beyond * (own.by_gap.abs() + own.by_rate.abs() * tables.frequency)
        }
    }
}

enum Search {
    None,
    Fall(Fall),
    Refused,
    /// The least gap lies at or behind a pole of the force.
    BehindPole,
}

/// Searches for the first fall of a guard on a step, and reports whether the least gap on it meets
/// a force that the step has not evaluated.
fn search(
    tables: &Tables,
    level: &Level,
    from: &Motion,
    to: &Motion,
    stages: &Stages,
    size: f64,
    allowed: f64,
) -> Search {
    let half = 0.5 * level.length;
    // The middle with the second of its forces.
    let gaps = [from.gap, stages.gaps[2], to.gap];
    let rates = [from.rate, stages.rates[2], to.rate];
    let [low, high] = tables.bounds[from.branch];
    let turns = rates[0] * rates[1] <= 0.0 || rates[1] * rates[2] <= 0.0;
    let inside = gaps[1] > low && gaps[1] < high && gaps[2] > low && gaps[2] < high;
    if inside && !turns && tables.by_gap_alone[from.branch] && level.unresolved.is_empty() {
        return Search::None;
    }
    let mut first: Option<Fall> = None;
    let mut least = gaps[0].min(gaps[1]).min(gaps[2]);
    let stretch = |k: usize, sign: f64, level: f64| Stretch {
        start: k as f64 * half,
        length: half,
        values: [gaps[k], gaps[k + 1]].map(|gap| sign * (gap - level)),
        slopes: [rates[k], rates[k + 1]].map(|rate| sign * rate),
    };
    let minimum = (0..2).find_map(|k| {
        let stretch = stretch(k, 1.0, 0.0);
        stretch.minimum().map(|x| (k, x, stretch.at(x)))
    });
    if let Some((k, x, gap)) = minimum {
        least = least.min(gap);
        if gap <= tables.pole {
            return Search::BehindPole;
        }
        let force = tables.force(from.branch, gap, 0.0);
        let [k1, k2, k3, k4] = stages.forces;
        let (u, middle) = (0.5 * (k as f64 + x), 0.5 * (k2 + k3));
        let expected = k1 * (1.0 - u) * (1.0 - 2.0 * u)
            + middle * 4.0 * u * (1.0 - u)
            + k4 * u * (2.0 * u - 1.0);
        if level.length * tables.mobility * (force - expected).abs() / 6.0 > 4.0 * allowed
            && low < gap
        {
            return Search::Refused;
        }
    }
    for exit in &tables.exits[from.branch] {
        let beyond = exit_tolerance(tables, exit, from, size);
        let guard = exit.exit.guard;
        let line = match guard {
            Guard::Falls(level) => Some((1.0, level)),
            Guard::Rises(level) => Some((-1.0, level)),
            Guard::Turns | Guard::Own(_) => None,
        };
        let found = (0..2).find_map(|k| {
            let Some((sign, at)) = line else {
                let [a, b] =
                    [k, k + 1].map(|k| tables.guard(guard, gaps[k], rates[k]) + 0.5 * beyond);
                return (b < 0.0).then(|| {
                    let start = k as f64 * half;
                    let part = if a > 0.0 { a / (a - b) } else { 0.0 };
                    (start + half * part, start + half)
                });
            };
            let stretch = stretch(k, sign, at - 0.5 * sign * beyond);
            let until = if stretch.values[1] < 0.0 {
                1.0
            } else {
                stretch.minimum().filter(|x| stretch.at(*x) < 0.0)?
            };
            Some((
                stretch.start + half * stretch.root(until),
                stretch.start + half * until,
            ))
        });
        if let Some((time, until)) = found
            && first.is_none_or(|fall| time < fall.time)
        {
            first = Some(Fall {
                exit: *exit,
                time: time.max(1e-3 * level.length),
                until,
            });
        }
    }
    if first.is_none() && !level.unresolved.is_empty() {
        let margin = tables.unresolved(level, from);
        let most = gaps[0].max(gaps[1]).max(gaps[2]);
        if margin > UNRESOLVED * size && (least - margin < low || most + margin > high) {
            return Search::Refused;
        }
    }
    first.map_or(Search::None, Search::Fall)
}
