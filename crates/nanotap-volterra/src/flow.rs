//! Running a system: from step to step and from switch to switch.

use crate::VolterraError;
use crate::bracket::{Fall, first_fall};
use crate::error::Refusal;
use crate::kernel::{LENGTHS, TimeMap};
use crate::law::{Approach, Exit, Guard};
use crate::linear::add_product;
use crate::quadrature::derivative;
use crate::step::{Quality, Solver, Statistics, Step, gap_scale};
use crate::system::System;
use std::sync::Arc;

/// Number of switches at one instant above which an endless sequence of switches is reported.
const MOST_SWITCHES_AT_ONCE: usize = 64;
/// Number of evaluations of the force in closed form that cost as much as a step of the approximate
/// flow.
const STEP_EVALUATIONS: u64 = 2;
/// Cost of a factorisation in such steps.
const FACTORISATION_COST: u64 = 8;
/// Number of modal coordinates whose linear part of an evaluation costs as much as a force in closed
/// form.
const COORDINATES_PER_FORCE: u64 = 6;
/// Length number of the first step of a run: a quarter of the longest step.
const FIRST_INDEX: usize = 4;
/// Length of a step that is to pass the end of a piece of a curve, as a multiple of the time to
/// that end.
const PAST_END: f64 = 1.45;
/// Fraction of its size to which a guard that is not certainly positive must be resolved.
const RESOLVED: f64 = 1e-11;
/// The same fraction on the first step after a switch.
const RESOLVED_FRESH: f64 = 1e-8;
/// Rounding error in a gap or its rate, as a fraction of the size of their terms: just before a
/// switch a guard is hardly larger, and no shorter step resolves it better.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A switch of the law from one branch to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switch {
    /// Time of the switch, in the system's unit of time.
    pub time: f64,
    /// Number of the branch that is left.
    pub from: usize,
    /// Number of the exit among those of the branch that is left.
    pub exit: usize,
    /// Number of the branch that is entered.
    pub to: usize,
    /// Gap at the switch, in the unit of the gap; exactly the level of a guard at a gap.
    pub gap: f64,
    /// Rate of the gap at the switch, in units of the gap per unit of time; negative on approach.
    pub rate: f64,
}

/// An observer of a run.
pub(crate) trait Observer {
    /// Whether perturbations of the motion are followed: steps must then resolve the effect of
    /// every mode on the force, not only of those that move.
    const PERTURBS: bool = false;
    /// Called after each step, up to `step.end`, with the modal coordinates `end` there.
    fn step(&mut self, system: &System, solver: &mut Solver, step: &Step, end: &[f64]);
    /// Called when the law switches after that step, at modal coordinates `modal`.
    fn switch(&mut self, system: &System, switch: &Switch, exit: &Exit, modal: &[f64]);
}

impl Observer for () {
    fn step(&mut self, _: &System, _: &mut Solver, _: &Step, _: &[f64]) {}
    fn switch(&mut self, _: &System, _: &Switch, _: &Exit, _: &[f64]) {}
}

impl<A: Observer> Observer for Option<A> {
    const PERTURBS: bool = A::PERTURBS;
    fn step(&mut self, system: &System, solver: &mut Solver, step: &Step, end: &[f64]) {
        if let Some(observer) = self {
            observer.step(system, solver, step, end);
        }
    }
    fn switch(&mut self, system: &System, switch: &Switch, exit: &Exit, modal: &[f64]) {
        if let Some(observer) = self {
            observer.switch(system, switch, exit, modal);
        }
    }
}

impl<A: Observer, B: Observer> Observer for (&mut A, &mut B) {
    const PERTURBS: bool = A::PERTURBS || B::PERTURBS;
    fn step(&mut self, system: &System, solver: &mut Solver, step: &Step, end: &[f64]) {
        self.0.step(system, solver, step, end);
        self.1.step(system, solver, step, end);
    }
    fn switch(&mut self, system: &System, switch: &Switch, exit: &Exit, modal: &[f64]) {
        self.0.switch(system, switch, exit, modal);
        self.1.switch(system, switch, exit, modal);
    }
}

/// A motion of a [`System`] with its work space. Cloning shares the system's tables.
#[derive(Debug)]
pub struct Flow {
    pub(crate) system: Arc<System>,
    time: f64,
    branch: usize,
    modal: Vec<f64>,
    /// Gap at the last switch, until the next step.
    pinned: Option<f64>,
    /// Behaviour of the force after the switch that has just happened.
    onset: Option<Approach>,
    solver: Solver,
    step: Step,
    /// Last accepted step, not yet passed to the observer: a step that ends a contact may cut it.
    pending: Step,
    has_pending: bool,
    /// Whether `work.modal` holds the modal coordinates at its end.
    reached: bool,
    /// Length numbers that were accepted last, by branch.
    hints: Vec<usize>,
    /// Length numbers of the first steps after a switch, for contact with a moving surface: the
    /// last steps before a switch may be so short that rounding hides the gap.
    first_hints: Vec<usize>,
    work: Work,
    /// Cost of work done by clones.
    added_cost: u64,
}

impl Clone for Flow {
    /// Clones the flow with a separate system: threads that share one would wait for each other at
    /// its reference count in every period.
    fn clone(&self) -> Self {
        Self {
            system: Arc::new(System::clone(&self.system)),
            time: self.time,
            branch: self.branch,
            modal: self.modal.clone(),
            pinned: self.pinned,
            onset: self.onset,
            solver: self.solver.clone(),
            step: self.step.clone(),
            pending: self.pending.clone(),
            has_pending: self.has_pending,
            reached: self.reached,
            hints: self.hints.clone(),
            first_hints: self.first_hints.clone(),
            work: self.work.clone(),
            added_cost: self.added_cost,
        }
    }
}

#[derive(Clone, Debug, Default)]
struct Work {
    values: Vec<f64>,
    series: Vec<f64>,
    slope: Vec<f64>,
    curvature: Vec<f64>,
    scratch: Vec<f64>,
    modal: Vec<f64>,
}

/// The place at which a guard falls on a step.
#[derive(Clone, Copy, Debug)]
struct GuardFall {
    exit: usize,
    u: f64,
}

enum Attempt {
    /// The step is accepted without an event; the next length number may be lower by this.
    Whole(usize),
    /// The law switches on the step.
    Falls(GuardFall),
    /// A shorter step, of this length number, must be tried.
    Shorter(usize, Refusal),
    /// A singular exit of this number is reached about this time after the start.
    Ends(usize, f64),
}

impl Flow {
    /// Creates a flow of `system`, at time 0 in the state zero.
    pub fn new(system: Arc<System>) -> Self {
        let n = system.kernel().nodes;
        let zeros = vec![0.0; n];
        let mut flow = Self {
            time: 0.0,
            branch: 0,
            modal: vec![0.0; system.dimension()],
            pinned: None,
            onset: None,
            solver: Solver::new(&system),
            step: Step::new(&system),
            pending: Step::new(&system),
            has_pending: false,
            reached: false,
            hints: vec![FIRST_INDEX; system.law().branches()],
            first_hints: vec![FIRST_INDEX; system.law().branches()],
            work: Work {
                values: zeros.clone(),
                series: zeros.clone(),
                slope: zeros.clone(),
                curvature: zeros,
                scratch: Vec::new(),
                modal: vec![0.0; system.dimension()],
            },
            added_cost: 0,
            system,
        };
        let state = vec![0.0; flow.system.dimension()];
        // The state zero is finite and of the right length.
        let _ = flow.start(&state, 0.0);
        flow
    }

    /// Returns the system whose motion this is.
    pub fn system(&self) -> &Arc<System> {
        &self.system
    }

    /// Returns the system for a change of its offset; a copy if it is shared. Restart the motion
    /// afterwards.
    pub fn system_mut(&mut self) -> &mut System {
        Arc::make_mut(&mut self.system)
    }

    /// Returns the cost of the runs so far.
    pub fn statistics(&self) -> Statistics {
        self.solver.statistics
    }

    /// Returns the cost of the runs so far, in steps of the approximate flow.
    pub fn cost(&self) -> u64 {
        let statistics = self.solver.statistics;
        let linear = self.system.dimension() as u64 / COORDINATES_PER_FORCE;
        let evaluations = self.system.law().cost().max(linear) * statistics.evaluations;
        evaluations / STEP_EVALUATIONS
            + FACTORISATION_COST * statistics.factorisations
            + self.added_cost
    }

    /// Adds the cost of work done by a clone.
    pub fn add_cost(&mut self, cost: u64) {
        self.added_cost += cost;
    }

    /// Returns the time reached, in the system's unit of time.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Returns the number of the present branch of the law.
    pub fn branch(&self) -> usize {
        self.branch
    }

    /// Sets the motion to state `x` at time `time`, on the branch that the law takes without a
    /// history.
    ///
    /// # Errors
    /// If the length is wrong or a value is not finite.
    pub fn start(&mut self, x: &[f64], time: f64) -> Result<(), VolterraError> {
        let n = self.system.dimension();
        if x.len() != n {
            return Err(VolterraError::Shape {
                what: "the state",
                found: x.len(),
                expected: n,
            });
        }
        if let Some(&found) = x.iter().chain([&time]).find(|v| !v.is_finite()) {
            return Err(VolterraError::Value {
                what: "an entry of the state or the time".into(),
                found,
                needed: "finite",
            });
        }
        self.put(x, time, self.system.branch_at(time, x));
        Ok(())
    }

    fn put(&mut self, x: &[f64], time: f64, branch: usize) {
        self.time = time;
        self.branch = branch;
        self.system.to_modal(time, x, &mut self.modal);
        self.pinned = None;
        self.onset = None;
        self.has_pending = false;
    }

    /// As [`Flow::start`], on a branch that the law remembers.
    ///
    /// # Errors
    /// As [`Flow::start`], and when there is no such branch.
    pub fn start_on(&mut self, x: &[f64], time: f64, branch: usize) -> Result<(), VolterraError> {
        let branches = self.system.law().branches();
        if branch >= branches {
            return Err(VolterraError::TooLarge {
                what: "the number of the branch",
                found: branch,
                limit: branches - 1,
            });
        }
        self.start(x, time)?;
        self.put(x, time, branch);
        Ok(())
    }

    /// Writes the state, of length `n`, to `x`.
    pub fn state(&self, x: &mut [f64]) {
        self.system.to_state(self.time, &self.modal, x);
    }

    /// Returns the gap and its rate.
    pub fn gap(&self) -> (f64, f64) {
        self.system.gap_of(self.time, &self.modal)
    }

    /// Runs to time `end`.
    ///
    /// # Errors
    /// If no step could be certified, the motion diverges, or the law switches endlessly.
    pub fn run_until(&mut self, end: f64) -> Result<(), VolterraError> {
        self.run(end, &mut ())
    }

    pub(crate) fn run<O: Observer>(
        &mut self,
        end: f64,
        observer: &mut O,
    ) -> Result<(), VolterraError> {
        let mut spent = self.cost();
        let result = self.run_steps(end, observer, &mut spent);
        self.system.cancel().spend(self.cost() - spent);
        result
    }

    /// Runs the steps to time `end`; `spent` is the cost already charged to the budget.
    fn run_steps<O: Observer>(
        &mut self,
        end: f64,
        observer: &mut O,
        spent: &mut u64,
    ) -> Result<(), VolterraError> {
        let system = self.system.clone();
        if !end.is_finite() {
            return Err(VolterraError::Value {
                what: "the end of the run".into(),
                found: end,
                needed: "finite",
            });
        }
        // The same start gives the same motion, whatever was run before.
        self.hints.fill(FIRST_INDEX);
        self.first_hints.fill(FIRST_INDEX);
        let most = system.options().max_steps;
        let mut at_once = (self.time, 0);
        for count in 0.. {
            if self.time >= end {
                self.commit_pending(&system, end, observer);
                return Ok(());
            }
            system.cancel().spend(self.cost() - *spent);
            *spent = self.cost();
            if system.cancel().is_cancelled() {
                return Err(VolterraError::Cancelled);
            }
            if count >= most {
                return Err(VolterraError::TooManySteps {
                    steps: count,
                    time: self.time,
                });
            }
            let Some((exit, u)) = self.advance(&system, end, observer)? else {
                continue;
            };
            if self.step.time(u) >= end {
                self.step.end = u;
                std::mem::swap(&mut self.step, &mut self.pending);
                self.has_pending = true;
                self.reached = false;
                self.pinned = None;
                self.onset = None;
                self.time = end;
                continue;
            }
            self.switch(&system, exit, u, observer)?;
            if self.time - at_once.0 > 1e-13 * system.kernel().length(0) {
                at_once = (self.time, 0);
            }
            at_once.1 += 1;
            if at_once.1 > MOST_SWITCHES_AT_ONCE {
                return Err(VolterraError::Accumulation {
                    time: self.time,
                    gap: self.gap().0,
                });
            }
        }
        Ok(())
    }

    /// Tries steps until one is accepted. Returns the exit taken on it and where, if the law
    /// switches; the step is then in `self.step`, and all steps before it have been passed to the
    /// observer.
    fn advance<O: Observer>(
        &mut self,
        system: &System,
        end: f64,
        observer: &mut O,
    ) -> Result<Option<(usize, f64)>, VolterraError> {
        let (map, moving) = match self.onset {
            None | Some(Approach::Analytic) => (TimeMap::Plain, false),
            Some(Approach::ThreeHalves) => (TimeMap::Start, false),
            Some(Approach::Half) => (TimeMap::Start, true),
        };
        let first = self.onset.is_some() && !system.second_is_rate();
        let mut index = if first {
            self.first_hints[self.branch]
        } else {
            self.hints[self.branch]
        };
        if system.law().is_piecewise() {
            index = index.max(self.index_to_end(system));
        }
        let mut refused = false;
        loop {
            if index >= LENGTHS {
                return Err(self.uncertified(Refusal::Unresolved));
            }
            self.prepare(map, index, moving);
            let solved = self.solver.solve(system, &mut self.step);
            match self.judge(system, solved, O::PERTURBS) {
                Attempt::Whole(growth) => {
                    let growth = if refused { 0 } else { growth };
                    self.hints[self.branch] = index.saturating_sub(growth);
                    if first {
                        self.first_hints[self.branch] = self.hints[self.branch];
                    }
                    self.accept(system, end, observer)?;
                    return Ok(None);
                }
                Attempt::Falls(found) => {
                    self.hints[self.branch] = index;
                    self.commit_pending(system, f64::INFINITY, observer);
                    return Ok(Some((found.exit, found.u)));
                }
                Attempt::Shorter(next, reason) => {
                    self.solver.statistics.refused += 1;
                    refused = true;
                    if next >= LENGTHS {
                        return Err(self.uncertified(reason));
                    }
                    index = next;
                }
                Attempt::Ends(exit, after) => {
                    if self.has_pending && self.end_step(system, exit, after, O::PERTURBS) {
                        let start = self.step.start;
                        if start >= end {
                            self.time = end;
                            self.commit_pending(system, end, observer);
                            return Ok(None);
                        }
                        self.commit_to_step(system, observer);
                        return Ok(Some((exit, 1.0)));
                    }
                    self.solver.statistics.refused += 1;
                    refused = true;
                    let half = system.kernel().index_below(0.5 * after);
                    match half {
                        Some(next) => index = next.max(index + 1),
                        None => return Err(self.uncertified(Refusal::Switch)),
                    }
                }
            }
        }
    }

    fn prepare(&mut self, map: TimeMap, index: usize, moving: bool) {
        let step = &mut self.step;
        step.map = map;
        step.index = index;
        step.branch = self.branch;
        step.start = self.time;
        step.modal.copy_from_slice(&self.modal);
        step.pinned_start = self.pinned;
        step.pinned_end = None;
        step.moving_start = moving;
        step.moving_end = false;
    }

    fn judge(
        &mut self,
        system: &System,
        solved: Result<Quality, Refusal>,
        perturbs: bool,
    ) -> Attempt {
        let index = self.step.index;
        let quality = match solved {
            Ok(quality) => quality,
            Err(reason) => return Attempt::Shorter(index + 2, reason),
        };
        // A singular exit is passed: the step means nothing beyond, but says about when.
        let mut passed: Option<(usize, f64)> = None;
        // No exit is reached before the last node that is inside of it.
        let mut inside = 0.0;
        let n = self.step.forces.len();
        for (number, exit) in system.exits(self.branch).iter().enumerate() {
            self.guard_values(system, exit, n);
            if let Some(i) = (1..n).find(|&i| self.work.values[i] < 0.0) {
                let (a, b) = (self.work.values[i - 1].max(0.0), self.work.values[i]);
                let nodes = &system.kernel().points;
                let u = nodes[i - 1] + (nodes[i] - nodes[i - 1]) * a / (a - b);
                let time = self.step.map.time(self.step.length, u);
                if passed.is_none_or(|(_, t)| time < t) {
                    passed = Some((number, time));
                    inside = nodes[i - 1];
                }
            }
        }
        if let Some((number, time)) = passed
            && system.exits(self.branch)[number].before != Approach::Analytic
        {
            // The series says better when than the chord between two nodes. Just after a switch
            // it begins at zero, where rounding may let it fall at once.
            let exit = system.exits(self.branch)[number];
            self.guard_values(system, &exit, n);
            self.guard_series(system);
            if self.onset.is_some() {
                self.deflate(system);
            }
            let time = match first_fall(&self.work.series, &mut self.work.scratch) {
                Fall::At(u) if u > inside => self.step.map.time(self.step.length, u),
                _ => time,
            };
            return Attempt::Ends(number, time);
        }
        let degree = match self.step.map {
            TimeMap::Plain => n as f64,
            TimeMap::Start | TimeMap::End => 0.5 * n as f64,
        };
        // An error that is no number is too large as well.
        if quality.error > 1.0 || quality.error.is_nan() {
            let notches = (2.0 * nanotap_arithmetic::log2(quality.error) / degree)
                .ceil()
                .clamp(1.0, 8.0) as usize;
            let mut next = index + notches;
            // No need to resolve what lies beyond a switch.
            if let Some((_, time)) = passed
                && let Some(below) = system.kernel().index_below(1.5 * time)
            {
                next = next.max(below);
            }
            return Attempt::Shorter(next, Refusal::Unresolved);
        }
        let branch = self.branch;
        let (map, slopes) = (self.step.map, perturbs.then(|| self.step.slopes()));
        let resolves = |index: usize| {
            slopes.is_none_or(|slopes| system.kernel_on(branch).resolves(map, index, slopes))
        };
        if !resolves(index) {
            let next = (index + 1..LENGTHS).find(|&next| resolves(next));
            return Attempt::Shorter(next.unwrap_or(LENGTHS), Refusal::Unresolved);
        }
        match self.first_switch(system) {
            Err(reason) => Attempt::Shorter(index + 1, reason),
            Ok(Some(found)) => {
                let exit = &system.exits(self.branch)[found.exit];
                if exit.before == Approach::Analytic {
                    Attempt::Falls(found)
                } else {
                    Attempt::Ends(found.exit, self.step.map.time(self.step.length, found.u))
                }
            }
            Ok(None) => {
                let growth = if quality.rounding {
                    2
                } else {
                    (2.0 * nanotap_arithmetic::log2(0.5 / quality.truncation) / degree)
                        .floor()
                        .clamp(0.0, 3.0) as usize
                };
                // The steepness grows with the length at least as fast as that.
                let fits = |growth: &usize| {
                    let longer = quality.steepness.powi(2) * 0.5_f64.powi(-(*growth as i32));
                    longer <= 1.0 && resolves(index.saturating_sub(*growth))
                };
                let longest = (0..=growth).rev().find(fits);
                Attempt::Whole(longest.unwrap_or(0))
            }
        }
    }

    /// Accepts the step in `self.step`.
    fn accept<O: Observer>(
        &mut self,
        system: &System,
        end: f64,
        observer: &mut O,
    ) -> Result<(), VolterraError> {
        self.commit_pending(system, f64::INFINITY, observer);
        std::mem::swap(&mut self.step, &mut self.pending);
        self.has_pending = true;
        self.pending.modal_at(system, 1.0, &mut self.work.modal);
        self.reached = true;
        self.modal.copy_from_slice(&self.work.modal);
        self.time = self.pending.time(1.0);
        self.pinned = None;
        self.onset = None;
        if self.modal.iter().any(|y| !y.is_finite()) {
            return Err(VolterraError::Diverged { time: self.time });
        }
        if self.time <= self.pending.start && self.time < end {
            return Err(self.uncertified(Refusal::Unresolved));
        }
        Ok(())
    }

    /// Passes the pending step to the observer, cut at time `until` if that lies on it.
    fn commit_pending<O: Observer>(&mut self, system: &System, until: f64, observer: &mut O) {
        if !self.has_pending {
            return;
        }
        self.has_pending = false;
        let step = &mut self.pending;
        if step.end_time() >= until {
            step.end = step.map.variable(step.length, until - step.start);
            step.modal_at(system, step.end, &mut self.work.modal);
            self.modal.copy_from_slice(&self.work.modal);
            self.time = until;
        } else if !self.reached {
            step.modal_at(system, step.end, &mut self.work.modal);
        }
        self.solver.statistics.steps += 1;
        observer.step(system, &mut self.solver, step, &self.work.modal);
    }

    /// Passes the pending step to the observer, cut at the start of the step in `self.step`.
    fn commit_to_step<O: Observer>(&mut self, system: &System, observer: &mut O) {
        self.has_pending = false;
        let step = &mut self.pending;
        self.time = self.step.start;
        step.end = step.map.variable(step.length, self.time - step.start);
        self.modal.copy_from_slice(&self.step.modal);
        self.solver.statistics.steps += 1;
        observer.step(system, &mut self.solver, step, &self.step.modal);
    }

    /// Returns the length number of a step that just passes the end of the branch, at the present
    /// rate.
    fn index_to_end(&self, system: &System) -> usize {
        let (gap, rate) = system.gap_of(self.time, &self.modal);
        let times = system
            .exits(self.branch)
            .iter()
            .map(|exit| match exit.guard {
                Guard::Falls(level) | Guard::Rises(level) => (level - gap) / rate,
                Guard::Turns | Guard::Own(_) => f64::INFINITY,
            });
        let ahead = times.filter(|time| *time > 0.0 && time.is_finite());
        let below = |time: f64| system.kernel().index_below(PAST_END * time);
        ahead.reduce(f64::min).and_then(below).unwrap_or(0)
    }

    /// Cuts the step in `self.step` at `u`, passes it to the observer and takes exit `number`.
    fn switch<O: Observer>(
        &mut self,
        system: &System,
        number: usize,
        u: f64,
        observer: &mut O,
    ) -> Result<(), VolterraError> {
        let exit = system.exits(self.branch)[number];
        let level = match exit.guard {
            Guard::Falls(level) | Guard::Rises(level) => Some(level),
            Guard::Turns | Guard::Own(_) => None,
        };
        self.step.end = u;
        self.step.modal_at(system, u, &mut self.modal);
        // The gap's series is good to rounding and its tail; the modes know it better.
        if let Some(level) = level
            && u < 1.0
        {
            let scale = gap_scale(system, &self.step.modal).0;
            for _ in 0..3 {
                let time = self.step.end_time();
                let (gap, rate) = system.gap_of(time, &self.modal);
                let slope = rate * self.step.map.rate(self.step.length, self.step.end);
                let next = self.step.end - (gap - level) / slope;
                let near = (gap - level).abs() <= 2.0 * f64::EPSILON * scale;
                if near || !(next > 0.0 && next <= 1.0) || next == self.step.end {
                    break;
                }
                let time_shift = self.step.time(next) - time;
                let kernel = system.kernel_on(self.branch);
                if kernel.along_tangent(time_shift) {
                    let force = self.step.force_at(self.step.end);
                    kernel.modes().apply(&self.modal, &mut self.work.modal);
                    for ((y, slope), b) in self
                        .modal
                        .iter_mut()
                        .zip(&self.work.modal)
                        .zip(&kernel.source)
                    {
                        *y += time_shift * (slope + b * force);
                    }
                } else {
                    self.step.modal_at(system, next, &mut self.modal);
                }
                self.step.end = next;
            }
        }
        self.time = self.step.end_time();
        self.solver.statistics.steps += 1;
        self.solver.statistics.switches += 1;
        observer.step(system, &mut self.solver, &self.step, &self.modal);
        let (gap, rate) = system.gap_of(self.time, &self.modal);
        let switch = Switch {
            time: self.time,
            from: self.branch,
            exit: number,
            to: exit.target,
            gap: level.unwrap_or(gap),
            rate,
        };
        observer.switch(system, &switch, &exit, &self.modal);
        self.branch = exit.target;
        self.pinned = level;
        self.onset = Some(exit.after);
        if self.modal.iter().any(|y| !y.is_finite()) {
            return Err(VolterraError::Diverged { time: self.time });
        }
        Ok(())
    }

    /// Tries the step that ends the branch through the singular exit `number`, about `after` from
    /// now, starting somewhere on the pending step. The step is left in `self.step`.
    fn end_step(&mut self, system: &System, number: usize, after: f64, perturbs: bool) -> bool {
        let kernel = system.kernel();
        let exit = system.exits(self.branch)[number];
        let (Guard::Falls(level) | Guard::Rises(level)) = exit.guard else {
            return false;
        };
        let Some(below) = kernel.index_below(after) else {
            return false;
        };
        let Some(index) = below.checked_sub(1) else {
            return false;
        };
        let length = kernel.length(index);
        if length - after > 0.8 * self.pending.length {
            return false;
        }
        self.prepare(TimeMap::End, index, false);
        let step = &mut self.step;
        step.start = self.time + after - length;
        step.pinned_start = None;
        step.pinned_end = Some(level);
        step.moving_end = exit.before == Approach::Half;
        match self.solver.solve_end(system, &self.pending, step) {
            Ok(quality) if quality.error <= 1.0 => {}
            _ => return false,
        }
        if perturbs && !kernel.resolves(TimeMap::End, index, self.step.slopes()) {
            return false;
        }
        // Inside until the end, and no other way out before it.
        let n = self.step.forces.len();
        self.guard_values(system, &exit, n);
        if self.work.values[..n - 1]
            .iter()
            .any(|g| *g <= 0.0 || g.is_nan())
        {
            return false;
        }
        system
            .exits(self.branch)
            .iter()
            .enumerate()
            .all(|(other, exit)| {
                other == number || {
                    self.guard_values(system, exit, n);
                    self.guard_series(system);
                    first_fall(&self.work.series, &mut self.work.scratch) == Fall::None
                }
            })
    }

    /// Computes the values of a guard at the nodes, in `self.work.values`.
    fn guard_values(&mut self, system: &System, exit: &Exit, n: usize) {
        let step = &self.step;
        for i in 0..n {
            self.work.values[i] = match exit.guard {
                Guard::Falls(level) => step.gap[i] - level,
                Guard::Rises(level) => level - step.gap[i],
                Guard::Turns => -step.rate[i],
                Guard::Own(index) => system.law().guard(index, step.gap[i], step.rate[i]).value,
            };
        }
    }

    /// Computes the Chebyshev series of `self.work.values`.
    fn guard_series(&mut self, system: &System) {
        self.work.series.fill(0.0);
        add_product(
            &system.kernel().coefficients,
            &self.work.values,
            &mut self.work.series,
        );
    }

    /// Returns the first switch on the step in `self.step`.
    fn first_switch(&mut self, system: &System) -> Result<Option<GuardFall>, Refusal> {
        let n = self.step.forces.len();
        let fresh = self.onset.is_some();
        let mut found: Option<GuardFall> = None;
        for (number, exit) in system.exits(self.branch).iter().enumerate() {
            self.guard_values(system, exit, n);
            let size = crate::step::largest(&self.work.values);
            self.guard_series(system);
            // On a moving surface no switch pins the gap.
            let zero = match exit.guard {
                Guard::Own(index) if fresh && !system.second_is_rate() => {
                    self.own_rounding(system, index)
                }
                _ => 0.0,
            };
            if fresh && self.work.values[0].abs() <= zero.max(1e-9 * size) {
                self.deflate(system);
            }
            let c = &self.work.series;
            let rest: f64 = c[1..].iter().map(|c| c.abs()).sum();
            let tail = c[n - 1].abs() + c[n - 2].abs() + c[n - 3].abs();
            if c[0] > rest + 10.0 * tail + self.unresolved(system, exit) {
                continue;
            }
            let rounding = match exit.guard {
                // After division by the time since the switch, rounding weighs more near it.
                _ if fresh => RESOLVED_FRESH * (c[0].abs() + rest),
                Guard::Falls(_) | Guard::Rises(_) => {
                    ROUNDING * gap_scale(system, &self.step.modal).0
                }
                Guard::Turns => ROUNDING * gap_scale(system, &self.step.modal).1,
                Guard::Own(index) => self.own_rounding(system, index),
            };
            if tail > rounding.max(RESOLVED * (c[0].abs() + rest)) {
                return Err(Refusal::Switch);
            }
            if let Fall::At(u) = first_fall(&self.work.series, &mut self.work.scratch)
                && found.is_none_or(|f| u < f.u)
            {
                found = Some(GuardFall { exit: number, u });
            }
        }
        Ok(found)
    }

    /// Returns the rounding error in a guard of the law's own, from those of gap and rate.
    fn own_rounding(&self, system: &System, index: usize) -> f64 {
        let (gap, rate) = gap_scale(system, &self.step.modal);
        let own = system
            .law()
            .guard(index, self.step.gap[0], self.step.rate[0]);
        ROUNDING * (own.by_gap.abs() * gap + own.by_rate.abs() * rate)
    }

    /// Divides a guard that starts at zero by the time since the start, and recomputes its series.
    fn deflate(&mut self, system: &System) {
        let table = system.kernel().table(self.step.map, self.step.index);
        let work = &mut self.work;
        derivative(&work.series, &mut work.slope);
        let at_zero = |c: &[f64]| crate::quadrature::series(c, 0.0);
        work.values[0] = match self.step.map {
            TimeMap::Start => {
                derivative(&work.slope, &mut work.curvature);
                at_zero(&work.curvature) / (2.0 * table.length)
            }
            _ => at_zero(&work.slope) / table.length,
        };
        for (value, time) in work.values.iter_mut().zip(&table.times).skip(1) {
            *value /= time;
        }
        self.guard_series(system);
    }

    /// Returns twice the amplitude in the gap of the modes too fast for the step's polynomial.
    fn unresolved(&self, system: &System, exit: &Exit) -> f64 {
        if !matches!(exit.guard, Guard::Falls(_) | Guard::Rises(_)) {
            return 0.0;
        }
        let kernel = system.kernel();
        let n = self.step.forces.len() as f64;
        kernel
            .modes()
            .blocks()
            .iter()
            .zip(&kernel.rates)
            .filter(|(_, rate)| **rate * self.step.length > n)
            .map(|(block, _)| {
                let norm = |v: &[f64]| {
                    v[block.start..block.start + block.size]
                        .iter()
                        .map(|x| x * x)
                        .sum::<f64>()
                        .sqrt()
                };
                2.0 * norm(&kernel.readout) * norm(&self.step.modal)
            })
            .sum()
    }

    fn uncertified(&self, reason: Refusal) -> VolterraError {
        VolterraError::Uncertified {
            time: self.time,
            gap: self.gap().0,
            reason,
        }
    }
}
