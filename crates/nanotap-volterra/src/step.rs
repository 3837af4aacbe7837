//! One step: Newton for the forces at the nodes, and the tests that it must pass.

use crate::error::Refusal;
use crate::kernel::{CHECKS, MAX_NODES, Table, TimeMap};
pub(crate) use crate::linear::largest;
use crate::linear::{
    add_product, add_rows, dot, factor, largest_sum, largest_terms, next_term, solve,
};
use crate::quadrature::series;
use crate::system::System;

/// Number of Newton steps after which a shorter step is tried.
const MAX_ITERATIONS: usize = 20;
/// Fraction of the allowed error at which the iteration ends.
const LEFT: f64 = 0.05;
/// Fraction of a residual that its correction may leave to the next one.
const ENOUGH: f64 = 0.0003;
/// The same fraction on a step with a fixed end, whose place is found to rounding.
const ENOUGH_AT_END: f64 = 1e-6;
/// Number of terms of a correction's series after which a factorisation is tried.
const MAX_TERMS: usize = 16;
/// Largest amplification `κ = ∫|G| |∂F|` on one step: an error of the force grows by at most
/// `cosh √(2κ)`, which is 27.
const STEEPEST: f64 = 8.0;
/// Size of the tail of the law, as a multiple of the allowed error, above which the step is given
/// up: along the first guess of the motion, and along the second.
const HOPELESS: [f64; 2] = [1e7, 1e4];

/// A step with its forces. Points are the nodes, then the check points.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) map: TimeMap,
    pub(crate) index: usize,
    pub(crate) branch: usize,
    /// Time of its start, in the system's unit of time.
    pub(crate) start: f64,
    pub(crate) length: f64,
    /// Value of the variable at which it is cut, 1 if it is not.
    pub(crate) end: f64,
    /// Modal coordinates at its start.
    pub(crate) modal: Vec<f64>,
    /// Gap at the start, if a switch fixed it.
    pub(crate) pinned_start: Option<f64>,
    /// Gap at the end, if a switch fixes it.
    pub(crate) pinned_end: Option<f64>,
    /// Forces at the nodes.
    pub(crate) forces: Vec<f64>,
    /// Coefficients of the force in `T_j(2u − 1)`.
    pub(crate) coefficients: Vec<f64>,
    /// Gap at the points.
    pub(crate) gap: Vec<f64>,
    pub(crate) rate: Vec<f64>,
    /// Derivative of the law by the gap at the nodes.
    pub(crate) by_gap: Vec<f64>,
    pub(crate) by_rate: Vec<f64>,
    /// How the force's derivative is singular at the pinned end(s): see
    /// [`Approach::Half`](crate::law::Approach::Half).
    pub(crate) moving_start: bool,
    pub(crate) moving_end: bool,
}

impl Step {
    pub(crate) fn new(system: &System) -> Self {
        let n = system.kernel().nodes;
        Self {
            map: TimeMap::Plain,
            index: 0,
            branch: 0,
            start: 0.0,
            length: 0.0,
            end: 1.0,
            modal: vec![0.0; system.dimension()],
            pinned_start: None,
            pinned_end: None,
            forces: vec![0.0; n],
            coefficients: vec![0.0; n],
            gap: vec![0.0; n + CHECKS],
            rate: vec![0.0; n + CHECKS],
            by_gap: vec![0.0; n],
            by_rate: vec![0.0; n],
            moving_start: false,
            moving_end: false,
        }
    }

    /// Returns the time of variable `u`.
    pub(crate) fn time(&self, u: f64) -> f64 {
        self.start + self.map.time(self.length, u)
    }

    /// Returns the time of its (cut) end.
    pub(crate) fn end_time(&self) -> f64 {
        self.time(self.end)
    }

    /// Returns bounds of the law's derivatives by the gap and by its rate, at the nodes.
    pub(crate) fn slopes(&self) -> [f64; 2] {
        [largest(&self.by_gap), largest(&self.by_rate)]
    }

    /// Returns the force at variable `u`.
    pub(crate) fn force_at(&self, u: f64) -> f64 {
        series(&self.coefficients, u)
    }

    /// Writes the modal coordinates at variable `u` to `out`.
    pub(crate) fn modal_at(&self, system: &System, u: f64, out: &mut [f64]) {
        let kernel = system.kernel_on(self.branch);
        if u >= 1.0 {
            let table = kernel.table(self.map, self.index);
            advance_free(system, table, &self.modal, out);
            add_product(&table.carry, &self.forces, out);
        } else {
            kernel.partial(
                self.map,
                self.length,
                u,
                &self.modal,
                &self.coefficients,
                out,
            );
        }
        system.spare_surface(self.branch, self.map.time(self.length, u), out);
    }
}

/// Writes `e^{Bh} y`, the modal coordinates without a force at the end of the step, to `out`.
pub(crate) fn advance_free(system: &System, table: &Table, y: &[f64], out: &mut [f64]) {
    for (block, e) in system
        .kernel()
        .modes()
        .blocks()
        .iter()
        .zip(&table.exponentials)
    {
        let s = block.start;
        if block.size == 1 {
            out[s] = e[0][0] * y[s];
        } else {
            out[s] = e[0][0] * y[s] + e[0][1] * y[s + 1];
            out[s + 1] = e[1][0] * y[s] + e[1][1] * y[s + 1];
        }
    }
}

/// The accuracy of a solved step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quality {
    /// Larger value of the force's tail and its defect between the nodes, as a fraction of the
    /// allowed error.
    pub(crate) error: f64,
    /// Part of the error that grows with the step's length; what the iteration left does not.
    pub(crate) truncation: f64,
    /// Whether the error is at the level of rounding.
    pub(crate) rounding: bool,
    /// Amplification of an error by the force, as a fraction of the largest allowed.
    pub(crate) steepness: f64,
}

/// Work space of the solver, and its cost so far.
#[derive(Clone, Debug)]
pub(crate) struct Solver {
    base_gap: Vec<f64>,
    base_rate: Vec<f64>,
    /// Change of the gap at the points as the start moves along the motion; below it, that of the
    /// rate.
    shift_gap: Vec<f64>,
    shift_rate: Vec<f64>,
    residual: Vec<f64>,
    /// Term of [`Solver::correct`], its effect on gap and rate, and the sums of these.
    term: Vec<f64>,
    image: [Vec<f64>; 2],
    change: [Vec<f64>; 2],
    matrix: Vec<f64>,
    pivots: Vec<usize>,
    column: Vec<f64>,
    slope: Vec<f64>,
    /// Forces that the law gives at the nodes.
    evaluated: Vec<f64>,
    /// Whether the law needs the rate.
    pub(crate) rates: bool,
    /// Bounds of the gap and its rate on the present step.
    scale: (f64, f64),
    /// The law's derivative by the gap at a pinned end.
    end_slope: f64,
    pub(crate) statistics: Statistics,
}

/// Numbers of operations in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Number of accepted steps.
    pub steps: u64,
    /// Number of steps that were tried and refused.
    pub refused: u64,
    /// Number of Newton iterations for the forces; 0 in the approximate flow.
    pub iterations: u64,
    /// Number of evaluations of the law.
    pub evaluations: u64,
    /// Number of factorisations, for derivatives and where no series converges.
    pub factorisations: u64,
    /// Number of switches between branches of the law.
    pub switches: u64,
}

impl Solver {
    pub(crate) fn new(system: &System) -> Self {
        let n = system.kernel().nodes;
        let rows = n + CHECKS;
        Self {
            base_gap: vec![0.0; rows],
            base_rate: vec![0.0; rows],
            shift_gap: vec![0.0; rows],
            shift_rate: vec![0.0; rows],
            residual: vec![0.0; n],
            term: vec![0.0; n],
            image: [vec![0.0; n], vec![0.0; n]],
            change: [vec![0.0; n], vec![0.0; n]],
            matrix: vec![0.0; n * n],
            pivots: vec![0; n],
            column: vec![0.0; n],
            slope: vec![0.0; system.dimension()],
            evaluated: vec![0.0; n],
            rates: system.law().depends_on_rate(),
            scale: (0.0, 0.0),
            end_slope: 0.0,
            statistics: Statistics::default(),
        }
    }

    /// Computes the gap and its rate at the points without the step's force.
    fn free(&mut self, system: &System, table: &Table, step: &Step) {
        let rows = self.base_gap.len();
        self.base_gap.fill(system.gap_constant);
        self.base_rate.fill(0.0);
        let adhesion = system.adhesion(step.branch);
        if adhesion != 0.0 {
            add_product(&table.rate_unit, &[-adhesion], &mut self.base_rate);
        }
        let phasors = system.phasors(step.map, step.index);
        for (k, (tone, amplitude)) in system
            .drive()
            .tones
            .iter()
            .zip(&system.gap_tones)
            .enumerate()
        {
            let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * step.start);
            let re = amplitude.re * cos - amplitude.im * sin;
            let im = amplitude.re * sin + amplitude.im * cos;
            let phasors = &phasors[2 * k * rows..2 * (k + 1) * rows];
            add_product(phasors, &[re, -im], &mut self.base_gap);
            if system.needs_rate && system.second_is_rate() {
                let rate = [-tone.frequency * im, -tone.frequency * re];
                add_product(phasors, &rate, &mut self.base_rate);
            }
        }
        if let Some((tone, frequency)) = system.signal() {
            let (sin, cos) = nanotap_arithmetic::sin_cos(frequency * step.start);
            let phasors = &phasors[2 * tone * rows..2 * (tone + 1) * rows];
            add_product(phasors, &[cos, -sin], &mut self.base_rate);
        }
        add_product(&table.gap, &step.modal, &mut self.base_gap);
        if system.needs_rate {
            add_product(&table.rate, &step.modal, &mut self.base_rate);
        }
    }

    /// Computes the gap and its rate at the nodes for the step's present forces.
    fn follow(&self, table: &Table, step: &mut Step) {
        let n = step.forces.len();
        let rows = n + CHECKS;
        let constant = step.forces.iter().all(|force| *force == step.forces[0]);
        let add = |matrix: &[f64], unit: &[f64], base: &[f64], out: &mut [f64]| {
            if constant {
                for ((out, base), unit) in out.iter_mut().zip(base).zip(unit) {
                    *out = base + step.forces[0] * unit;
                }
            } else {
                out.copy_from_slice(&base[..n]);
                add_rows(matrix, rows, &step.forces, out);
            }
        };
        add(
            &table.gap_force,
            &table.gap_unit,
            &self.base_gap,
            &mut step.gap[..n],
        );
        if self.rates {
            add(
                &table.rate_force,
                &table.rate_unit,
                &self.base_rate,
                &mut step.rate[..n],
            );
        }
    }

    /// Evaluates the law at the nodes for the step's present gap and rate; `residual` becomes the
    /// law's values minus the forces. Returns by how much the gap exceeds the pinned end.
    fn evaluate(&mut self, system: &System, step: &mut Step) -> f64 {
        let n = step.forces.len();
        let law = system.law();
        let mut excess = 0.0;
        if let Some(level) = step.pinned_end {
            excess = step.gap[n - 1] - level;
            step.gap[n - 1] = level;
        }
        if let Some(level) = step.pinned_start {
            step.gap[0] = level;
        }
        law.forces(
            step.branch,
            &step.gap[..n],
            &step.rate[..n],
            [&mut self.evaluated, &mut step.by_gap, &mut step.by_rate],
        );
        for ((r, law), force) in self
            .residual
            .iter_mut()
            .zip(&self.evaluated)
            .zip(&step.forces)
        {
            *r = law - force;
        }
        // Where the gap is held its slope is of no use to Newton, and may be infinite.
        if step.pinned_end.is_some() {
            self.end_slope = std::mem::take(&mut step.by_gap[n - 1]);
        }
        if step.moving_start {
            step.by_gap[0] = 0.0;
        }
        self.statistics.evaluations += n as u64;
        excess
    }

    /// Computes gap and rate at all points for the solved forces.
    fn complete(&mut self, system: &System, table: &Table, step: &mut Step) {
        let n = step.forces.len();
        step.gap.copy_from_slice(&self.base_gap);
        add_product(&table.gap_force, &step.forces, &mut step.gap);
        step.rate.copy_from_slice(&self.base_rate);
        if system.needs_rate {
            add_product(&table.rate_force, &step.forces, &mut step.rate);
        }
        if let Some(level) = step.pinned_end {
            step.gap[n - 1] = level;
        }
        if let Some(level) = step.pinned_start {
            step.gap[0] = level;
        }
    }

    /// Factors `1 − ∂F_d W − ∂F_v W'` at the present point.
    pub(crate) fn factor(&mut self, table: &Table, step: &Step) -> bool {
        let n = step.forces.len();
        let rows = n + CHECKS;
        for node in 0..n {
            let gap = &table.gap_force[node * rows..node * rows + n];
            let rate = &table.rate_force[node * rows..node * rows + n];
            let out = &mut self.matrix[node * n..(node + 1) * n];
            for i in 0..n {
                out[i] = -step.by_gap[i] * gap[i] - step.by_rate[i] * rate[i];
            }
            out[node] += 1.0;
        }
        self.statistics.factorisations += 1;
        factor(&mut self.matrix, n, &mut self.pivots)
    }

    /// Solves with the last factors, in place.
    pub(crate) fn back_substitute(&self, x: &mut [f64]) {
        solve(&self.matrix, x.len(), &self.pivots, x);
    }

    /// Turns `residual` into the correction of the forces, `(1 − ∂F_d W − ∂F_v W')⁻¹` of it, by
    /// the series of that inverse: it converges as every Volterra equation's does, like that of
    /// `cosh √(2κ)`, and a term costs a product. Terms are summed until the next is `enough`;
    /// what the sum does to gap and rate is left in `change`. Returns the size of that next term, if
    /// it comes to that.
    fn correct(&mut self, table: &Table, step: &Step, enough: f64) -> Option<f64> {
        let n = step.forces.len();
        let rows = n + CHECKS;
        self.term.copy_from_slice(&self.residual);
        self.change[0].fill(0.0);
        self.change[1].fill(0.0);
        for _ in 0..MAX_TERMS {
            self.image[0].fill(0.0);
            add_rows(&table.gap_force, rows, &self.term, &mut self.image[0]);
            if self.rates {
                self.image[1].fill(0.0);
                add_rows(&table.rate_force, rows, &self.term, &mut self.image[1]);
            }
            let slopes: [&[f64]; 2] = [&step.by_gap, &step.by_rate];
            let images = [&self.image[0][..], &self.image[1][..]];
            next_term(slopes, images, &mut self.change, &mut self.term);
            let size = largest(&self.term);
            if size <= enough {
                return Some(size);
            }
            for (x, t) in self.residual.iter_mut().zip(&self.term) {
                *x += t;
            }
        }
        None
    }

    /// As [`Self::correct`] for a step with a fixed end, of `residual` or of `column`, as far as
    /// the end needs it. Returns what the correction does to the gap at the end.
    fn correct_end(&mut self, table: &Table, step: &Step, of_column: bool) -> Option<f64> {
        let (n, rows) = (step.forces.len(), step.gap.len());
        if of_column {
            std::mem::swap(&mut self.residual, &mut self.column);
        }
        let mut asked = [0.0; MAX_NODES];
        asked[..n].copy_from_slice(&self.residual);
        let size = largest(&self.residual);
        let mut effect = None;
        if self.correct(table, step, ENOUGH_AT_END * size).is_some() {
            effect = Some(self.change[0][n - 1]);
        } else if self.factor(table, step) {
            self.residual.copy_from_slice(&asked[..n]);
            solve(&self.matrix, n, &self.pivots, &mut self.residual);
            let last_row = table.gap_force[n - 1..].iter().step_by(rows);
            effect = Some(last_row.zip(&self.residual).map(|(w, x)| w * x).sum());
        }
        if of_column {
            std::mem::swap(&mut self.residual, &mut self.column);
        }
        effect
    }

    /// Solves the step for its forces.
    pub(crate) fn solve(&mut self, system: &System, step: &mut Step) -> Result<Quality, Refusal> {
        let table = system.kernel_on(step.branch).table(step.map, step.index);
        step.length = table.length;
        step.end = 1.0;
        self.free(system, table, step);
        if system.vanishes(step.branch) {
            step.forces.fill(0.0);
            step.coefficients.fill(0.0);
            step.by_gap.fill(0.0);
            step.by_rate.fill(0.0);
            step.gap.copy_from_slice(&self.base_gap);
            step.rate.copy_from_slice(&self.base_rate);
            if let Some(level) = step.pinned_start {
                step.gap[0] = level;
            }
            return Ok(Quality {
                error: 0.0,
                truncation: 0.0,
                rounding: true,
                steepness: 0.0,
            });
        }
        let first = step.pinned_start.unwrap_or(self.base_gap[0]);
        let start = system
            .law()
            .force(step.branch, first, self.base_rate[0])
            .value;
        step.forces.fill(start);
        self.scale = gap_scale(system, &step.modal);
        // No rate is known before the second.
        let mut last = 0.0;
        self.follow(table, step);
        for round in 0..MAX_ITERATIONS {
            self.statistics.iterations += 1;
            self.evaluate(system, step);
            let size = largest(&self.residual);
            if !size.is_finite() {
                return Err(Refusal::Newton);
            }
            let (allowed, rounding) = self.allowed(system, table, step);
            if size <= 0.1 * allowed {
                self.add_residual(step);
                return self.assess(system, table, step, allowed, rounding);
            }
            // Where the law along the first guesses is far from resolved, so is its solution.
            if round < HOPELESS.len() {
                let error = self.tail_of_law(system) / allowed;
                if error > HOPELESS[round] {
                    return Ok(Quality {
                        error,
                        truncation: error,
                        rounding: false,
                        steepness: 0.0,
                    });
                }
            }
            // What will be left after this correction: what its series leaves, and no more than
            // by the bound of a plain iteration, or by the rate of the last two corrections.
            let enough = (ENOUGH * size).max(0.5 * LEFT * allowed);
            let rate = steepness(table, step).min(size / last);
            last = size;
            let summed = self.correct(table, step, enough);
            let left = (rate * size).max(summed.unwrap_or(0.0));
            if summed.is_none() {
                self.residual
                    .iter_mut()
                    .zip(&self.evaluated)
                    .zip(&step.forces)
                    .for_each(|((r, law), force)| *r = law - force);
                if !self.factor(table, step) {
                    return Err(Refusal::Newton);
                }
                solve(
                    &self.matrix,
                    step.forces.len(),
                    &self.pivots,
                    &mut self.residual,
                );
            }
            self.add_residual(step);
            if left <= LEFT * allowed {
                return self.assess(system, table, step, allowed, rounding);
            }
            if summed.is_some() {
                let [gap, rate] = &self.change;
                for (v, change) in step.gap.iter_mut().zip(gap) {
                    *v += change;
                }
                if self.rates {
                    for (v, change) in step.rate.iter_mut().zip(rate) {
                        *v += change;
                    }
                }
            } else {
                self.follow(table, step);
            }
        }
        Err(Refusal::Newton)
    }

    fn add_residual(&self, step: &mut Step) {
        for (force, r) in step.forces.iter_mut().zip(&self.residual) {
            *force += r;
        }
    }

    /// Returns the size of the last two coefficients of the law's values at the nodes.
    fn tail_of_law(&self, system: &System) -> f64 {
        let [one, other] = &system.kernel().last_coefficients;
        dot(one, &self.evaluated).abs() + dot(other, &self.evaluated).abs()
    }

    /// Solves a step that ends where the gap reaches `step.pinned_end`, by moving its start
    /// along `before`, the step it continues; `step.start` is the first guess.
    pub(crate) fn solve_end(
        &mut self,
        system: &System,
        before: &Step,
        step: &mut Step,
    ) -> Result<Quality, Refusal> {
        let kernel = system.kernel_on(step.branch);
        let table = kernel.table(step.map, step.index);
        step.length = table.length;
        step.end = 1.0;
        let n = step.forces.len();
        let (earliest, latest) = (before.start, before.time(1.0));
        self.scale = gap_scale(system, &before.modal);
        let scale = self.scale.0;
        let mut moved = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            self.statistics.iterations += 1;
            let u = before
                .map
                .variable(before.length, step.start - before.start);
            let first = moved.is_infinite();
            if kernel.along_tangent(moved) {
                for (y, s) in step.modal.iter_mut().zip(&self.slope) {
                    *y += moved * s;
                }
            } else {
                before.modal_at(system, u, &mut step.modal);
            }
            self.free(system, table, step);
            if first {
                step.forces.fill(before.force_at(u));
            }
            self.follow(table, step);
            let excess = self.evaluate(system, step);
            let size = largest(&self.residual);
            if !(size.is_finite() && excess.is_finite()) {
                return Err(Refusal::Newton);
            }
            let floor = 8.0 * f64::EPSILON * scale;
            let (allowed, rounding) = self.allowed(system, table, step);
            if size <= 0.1 * allowed && excess.abs() <= floor {
                return self.assess_end(system, table, step, allowed, rounding);
            }
            self.shift(system, table, step, before.force_at(u));
            for i in 0..n {
                self.column[i] =
                    step.by_gap[i] * self.shift_gap[i] + step.by_rate[i] * self.shift_rate[i];
            }
            let (Some(by_residual), Some(by_start)) = (
                self.correct_end(table, step, false),
                self.correct_end(table, step, true),
            ) else {
                return Err(Refusal::Newton);
            };
            let delta = -(excess + by_residual) / (self.shift_gap[n - 1] + by_start);
            if !delta.is_finite() {
                return Err(Refusal::Newton);
            }
            // Late times are too coarse for the gap at the end to be less than its own rounding.
            if delta.abs() <= 2.0 * f64::EPSILON * step.start.abs() && size <= allowed {
                return self.assess_end(system, table, step, allowed, rounding);
            }
            let start = step.start + delta;
            moved = start - step.start;
            step.start = start;
            for ((force, r), c) in step.forces.iter_mut().zip(&self.residual).zip(&self.column) {
                *force += r + c * delta;
            }
            if step.start < earliest || step.start > latest {
                return Err(Refusal::Switch);
            }
        }
        Err(Refusal::Newton)
    }

    /// Tests a step with a fixed end after the last correction of its forces.
    fn assess_end(
        &mut self,
        system: &System,
        table: &Table,
        step: &mut Step,
        allowed: f64,
        rounding: f64,
    ) -> Result<Quality, Refusal> {
        self.add_residual(step);
        if !step.moving_end {
            // A variation at fixed time changes the gap at the end.
            let last = step.forces.len() - 1;
            step.by_gap[last] = self.end_slope;
        }
        self.assess(system, table, step, allowed, rounding)
    }

    /// Computes the changes of gap and rate at the points as the start of the step moves along the
    /// motion, on which the force at the start is `force`.
    pub(crate) fn shift(&mut self, system: &System, table: &Table, step: &Step, force: f64) {
        let kernel = system.kernel_on(step.branch);
        kernel.modes().apply(&step.modal, &mut self.slope);
        for (s, b) in self.slope.iter_mut().zip(&kernel.source) {
            *s += b * force;
        }
        self.tone_shift(system, table, step);
        add_product(&table.gap, &self.slope, &mut self.shift_gap);
        add_product(&table.rate, &self.slope, &mut self.shift_rate);
    }

    /// Computes the part of [`Self::shift`] due to the drive, at fixed modal coordinates.
    pub(crate) fn tone_shift(&mut self, system: &System, table: &Table, step: &Step) {
        for (i, time) in table.times.iter().enumerate() {
            let forced = system.forced_gap(step.start + time);
            self.shift_gap[i] = forced[1];
            self.shift_rate[i] = if let Some((_, frequency)) = system.signal() {
                -frequency * nanotap_arithmetic::sin(frequency * (step.start + time))
            } else if system.second_is_rate() {
                forced[2]
            } else {
                0.0
            };
        }
    }

    /// Returns the last result of [`Self::shift`]: the changes of gap and rate at the points.
    pub(crate) fn shifts(&self) -> (&[f64], &[f64]) {
        (&self.shift_gap, &self.shift_rate)
    }

    /// Returns the allowed error of the force (by the tolerance or by rounding), and the part from
    /// rounding alone.
    fn allowed(&self, system: &System, table: &Table, step: &Step) -> (f64, f64) {
        let wanted = system.options().tolerance / (table.length * system.kernel().reach);
        let slopes: [&[f64]; 2] = [&step.by_gap, &step.by_rate];
        let size = largest_terms(&step.forces, slopes, self.scale.into());
        let rounding = 2.0 * f64::EPSILON * size;
        (wanted.max(rounding), rounding)
    }

    /// Tests a solved step and returns its accuracy, or why it is refused.
    fn assess(
        &mut self,
        system: &System,
        table: &Table,
        step: &mut Step,
        allowed: f64,
        rounding: f64,
    ) -> Result<Quality, Refusal> {
        let n = step.forces.len();
        self.complete(system, table, step);
        step.coefficients.fill(0.0);
        add_product(
            &system.kernel().coefficients,
            &step.forces,
            &mut step.coefficients,
        );
        let tail = step.coefficients[n - 1].abs() + step.coefficients[n - 2].abs();
        let mut between = [0.0; CHECKS];
        add_product(&table.between, &step.forces, &mut between);
        let mut defect: f64 = 0.0;
        for (k, force) in between.iter().enumerate() {
            let law = system
                .law()
                .force(step.branch, step.gap[n + k], step.rate[n + k]);
            defect = defect.max((force - law.value).abs());
        }
        self.statistics.evaluations += CHECKS as u64;
        let steepness = steepness(table, step);
        if steepness > STEEPEST || steepness.is_nan() {
            return Err(Refusal::Steep);
        }
        let error = tail.max(0.25 * defect);
        // The iteration stops with so much left of what the law says between the nodes.
        let truncation = if 0.25 * defect <= LEFT * allowed {
            tail
        } else {
            error
        };
        Ok(Quality {
            error: error / allowed,
            truncation: truncation / allowed,
            rounding: error <= 2.0 * rounding,
            steepness: steepness / STEEPEST,
        })
    }
}

/// Computes `max |∂F_d| ∫|G| + |∂F_v| ∫|G'|` over the nodes.
fn steepness(table: &Table, step: &Step) -> f64 {
    largest_sum(
        &step.by_gap,
        &table.gap_sums,
        &step.by_rate,
        &table.rate_sums,
    )
}

/// Returns bounds of the gap and of the law's second argument over the following motion, for
/// estimates of rounding errors.
pub(crate) fn gap_scale(system: &System, y: &[f64]) -> (f64, f64) {
    let kernel = system.kernel();
    let [tones, rate] = system.gap_sizes;
    let mut gap = system.gap_constant.abs() + tones;
    let mut second = match system.signal() {
        Some(_) => 1.0,
        None if system.second_is_rate() => rate,
        None => 0.0,
    };
    for (k, y) in y.iter().enumerate() {
        gap += (kernel.readout[k] * y).abs();
        second += (kernel.second_readout[k] * y).abs();
    }
    (gap, second)
}
