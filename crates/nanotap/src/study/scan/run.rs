//! Lines of a scan, in sequence or independent of each other.

use nanotap_arithmetic::ComplexFunctions as _;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::Control;
use rayon::prelude::*;

use super::instrument::{Instrument, Period};
use super::plan::Plan;
use super::recorder::{BranchTracker, LineRecord, LineRecorder, listed};
use super::report::{BranchChange, Direction, ListedPeriod, MethodError};
use crate::Error;

/// What a scan recorded.
#[derive(Debug, Default)]
pub(super) struct Recorded {
    pub(super) lines: Vec<LineRecord>,
    pub(super) listed: Vec<ListedPeriod>,
    pub(super) changes: Vec<BranchChange>,
    pub(super) comparison: Comparison,
    /// Periods at an end of the range of z.
    pub(super) at_range: usize,
}

/// Differences of a fast run from an exact one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Comparison {
    pub(super) periods: usize,
    height: [f64; 2],
    amplitude: [f64; 2],
}

impl Comparison {
    fn add(&mut self, fast: &Period, exact: &Period) {
        self.periods += 1;
        let differences = [
            fast.z - exact.z,
            fast.deflection.modulus() - exact.deflection.modulus(),
        ];
        for (sums, difference) in [&mut self.height, &mut self.amplitude]
            .into_iter()
            .zip(differences)
        {
            sums[0] = sums[0].max(difference.abs());
            sums[1] += difference * difference;
        }
    }

    fn join(&mut self, other: &Self) {
        self.periods += other.periods;
        for (own, other) in [&mut self.height, &mut self.amplitude]
            .into_iter()
            .zip([other.height, other.amplitude])
        {
            own[0] = own[0].max(other[0]);
            own[1] += other[1];
        }
    }

    /// As reported; `None` where nothing was compared.
    pub(super) fn report(&self) -> Option<MethodError> {
        let rms = |squares: f64| (squares / self.periods as f64).sqrt();
        (self.periods > 0).then(|| MethodError {
            periods: self.periods,
            height_max: self.height[0],
            height_rms: rms(self.height[1]),
            amplitude_max: self.amplitude[0],
            amplitude_rms: rms(self.amplitude[1]),
        })
    }
}

impl Recorded {
    fn join(&mut self, other: Self) {
        self.lines.extend(other.lines);
        self.listed.extend(other.listed);
        self.changes.extend(other.changes);
        self.comparison.join(&other.comparison);
        self.at_range += other.at_range;
    }
}

/// Stretches of a line and direction on which a fast run is compared, the steepest place apart.
const COMPARED_STRETCHES: usize = 4;
/// Part of a line that one such stretch is, and the fewest periods of it.
const COMPARED_PART: usize = 250;
const COMPARED_PERIODS: usize = 60;
/// Periods after which the flag that cancels the work is looked at, and progress reported.
const POLL: usize = 256;

/// A run over lines.
struct Runner<'a, 'c> {
    plan: &'a Plan,
    control: &'c Control<'c>,
    done: &'c AtomicUsize,
    total: usize,
    instrument: Instrument<'a>,
    /// An exact instrument for comparisons.
    exact: Option<Instrument<'a>>,
    tracker: BranchTracker,
    recorded: Recorded,
    /// Number of the next period.
    k: usize,
}

impl Runner<'_, '_> {
    fn run_period(&mut self, x: f64, y: f64) -> Result<Period, Error> {
        if self.k.is_multiple_of(POLL) {
            if self.control.is_cancelled() {
                return Err(Error::stopped());
            }
            let done = self.done.fetch_add(POLL, Ordering::Relaxed) + POLL;
            if let Some(progress) = self.control.progress {
                progress(done.min(self.total), self.total);
            }
        }
        let (surface, material) = (self.plan.surface.height(x, y), self.plan.material(x));
        let period = self.instrument.run_period(x, surface, material)?;
        if self.plan.list.binary_search(&self.k).is_ok() {
            self.recorded.listed.push(listed(self.k, &period));
        }
        self.k += 1;
        Ok(period)
    }

    fn settle(&mut self, line: usize, periods: usize) -> Result<(), Error> {
        let (x, y) = (self.plan.position(0, false), self.plan.line_position(line));
        (0..periods).try_for_each(|_| self.run_period(x, y).map(|_| ()))
    }

    fn run_line(&mut self, line: usize) -> Result<(), Error> {
        self.run_direction(line, Direction::Trace)?;
        if self.plan.retrace {
            self.run_direction(line, Direction::Retrace)?;
        }
        Ok(())
    }

    fn run_direction(&mut self, line: usize, direction: Direction) -> Result<(), Error> {
        let plan = self.plan;
        let retrace = direction == Direction::Retrace;
        let y = plan.line_position(line);
        let (starts, length) = if self.exact.is_some() {
            compared_stretches(plan, y, retrace)
        } else {
            (Vec::new(), 0)
        };
        let mut left = 0;
        let mut recorder = LineRecorder::new(plan, line, direction, self.k);
        for index in 0..plan.periods {
            let x = plan.position(index, retrace);
            if starts.contains(&index) {
                left = length;
                if let Some(exact) = &mut self.exact {
                    exact.go_on_from(&self.instrument);
                }
            }
            let k = self.k;
            let period = self.run_period(x, y)?;
            if let Some(exact) = self.exact.as_mut().filter(|_| left > 0) {
                left -= 1;
                let other = exact.run_period(x, period.surface, plan.material(x))?;
                self.recorded.comparison.add(&period, &other);
            }
            self.tracker.add(k, line, direction, &period);
            recorder.add(index, &period);
        }
        self.recorded.lines.push(recorder.finish());
        Ok(())
    }

    fn finish(mut self) -> Recorded {
        self.recorded.at_range = self.instrument.at_range();
        self.recorded.changes = self.tracker.finish();
        self.recorded
    }
}

/// Where comparisons begin on a line, and their length.
fn compared_stretches(plan: &Plan, y: f64, retrace: bool) -> (Vec<usize>, usize) {
    let n = plan.periods;
    let length = (n / COMPARED_PART).max(COMPARED_PERIODS).min(n);
    let height = |index: usize| plan.surface.height(plan.position(index, retrace), y);
    let mut steepest = (0.0, 0);
    let mut before = height(0);
    for index in 1..n {
        let here = height(index);
        let change = (here - before).abs();
        if change > steepest.0 {
            steepest = (change, index);
        }
        before = here;
    }
    let even = (0..COMPARED_STRETCHES).map(|j| (2 * j + 1) * n / (2 * COMPARED_STRETCHES));
    let mut starts: Vec<usize> = even.collect();
    if steepest.0 > 0.0 {
        starts.push(steepest.1.saturating_sub(2));
    }
    starts.sort_unstable();
    starts.dedup();
    (starts, length)
}

/// Runs the plan. The second result is the instrument after settling.
pub(super) fn run<'a>(
    plan: &'a Plan,
    lever_memory: f64,
    control: &Control<'_>,
) -> Result<(Recorded, Instrument<'a>), Error> {
    let instrument = Instrument::new(plan)?;
    let exact = if plan.method == super::options::Method::Fast && !instrument.is_exact() {
        Some(instrument.exact()?)
    } else {
        None
    };
    let directions = 1 + usize::from(plan.retrace);
    let per_line = plan.periods * directions + plan.line_settle.unwrap_or(0);
    let done = AtomicUsize::new(0);
    let mut runner = Runner {
        plan,
        control,
        done: &done,
        total: plan.settle + plan.lines * per_line,
        instrument,
        exact,
        tracker: BranchTracker::new(lever_memory),
        recorded: Recorded::default(),
        k: 0,
    };
    runner.settle(0, plan.settle)?;
    let settled = runner.instrument.clone();
    let Some(line_settle) = plan.line_settle else {
        for line in 0..plan.lines {
            runner.run_line(line)?;
        }
        return Ok((runner.finish(), settled));
    };
    let mut all = Recorded {
        listed: std::mem::take(&mut runner.recorded.listed),
        ..Recorded::default()
    };
    let lines: Vec<Result<Recorded, Error>> = (0..plan.lines)
        .into_par_iter()
        .with_max_len(1)
        .map(|line| {
            let mut runner = Runner {
                plan,
                control,
                done: &done,
                total: runner.total,
                instrument: settled.clone(),
                exact: runner.exact.clone(),
                tracker: BranchTracker::new(lever_memory),
                recorded: Recorded::default(),
                k: plan.settle + line * per_line,
            };
            runner.settle(line, line_settle)?;
            runner.run_line(line)?;
            Ok(runner.finish())
        })
        .collect();
    for line in lines {
        all.join(line?);
    }
    Ok((all, settled))
}
