//! Lines of a scan, in sequence or independent of each other.

use nanotap_arithmetic::ComplexFunctions as _;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::Control;
use rayon::prelude::*;

use super::instrument::{Instrument, Period};
use super::plan::Plan;
use super::recorder::{BranchTracker, LineRecord, LineRecorder, listed};
use super::report::{BranchChange, Direction, ListedPeriod, MethodError};
use crate::{Error, ErrorKind};

/// Lines, listed periods and branch changes that a scan recorded.
#[derive(Debug, Default)]
pub(super) struct Recorded {
    pub(super) lines: Vec<LineRecord>,
    pub(super) listed: Vec<ListedPeriod>,
    pub(super) changes: Vec<BranchChange>,
    /// Number of periods before the first line whose command was limited by the range of z.
    pub(super) at_range: usize,
}

/// Differences of a fast run from an exact one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Comparison {
    pub(super) periods: usize,
    /// Largest difference of the height, m, and sum of its squares, m².
    pub(super) height: [f64; 2],
    pub(super) amplitude: [f64; 2],
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

    pub(super) fn join(&mut self, other: &Self) {
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
    pub(super) fn join(&mut self, other: Self) {
        self.lines.extend(other.lines);
        self.listed.extend(other.listed);
        self.changes.extend(other.changes);
        self.at_range += other.at_range;
    }
}

/// Number of stretches of a line and direction on which a fast run is compared, in addition to the
/// steepest place.
const COMPARED_STRETCHES: usize = 4;
/// Part of a line that one such stretch is, and the fewest periods of it.
const COMPARED_PART: usize = 250;
const COMPARED_PERIODS: usize = 60;
/// Number of periods between two checks of the flag that cancels the work; progress is reported
/// then.
const POLL: usize = 256;

/// State of a run over lines in sequence.
struct Runner<'a, 'c> {
    plan: &'a Plan,
    control: &'c Control<'c>,
    done: &'c AtomicUsize,
    total: usize,
    instrument: Instrument<'a>,
    /// Exact instrument for comparisons, if the method is fast.
    exact: Option<Instrument<'a>>,
    tracker: BranchTracker,
    recorded: Recorded,
    /// Number of the next period.
    k: usize,
    /// Number of periods, up to the last line, whose command was limited by the range of z.
    at_range: usize,
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
        let mut comparison = Comparison::default();
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
                comparison.add(&period, &other);
            }
            self.tracker.add(k, line, direction, &period);
            recorder.add(index, &period);
        }
        let at_range = self.instrument.at_range();
        let (statistics, pixels) = recorder.finish();
        self.recorded.lines.push(LineRecord {
            statistics,
            pixels,
            comparison,
            at_range: at_range - self.at_range,
        });
        self.at_range = at_range;
        Ok(())
    }

    fn finish(mut self) -> Recorded {
        self.recorded.changes = self.tracker.finish();
        self.recorded
    }
}

/// Returns where comparisons begin on a line, and their length.
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

/// An instrument that has settled before the first line.
#[derive(Debug)]
pub(super) struct Settled<'a> {
    plan: &'a Plan,
    /// Number of periods in which a disturbance of the lever falls by the factor e.
    lever_memory: f64,
    pub(super) instrument: Instrument<'a>,
    /// Exact instrument for comparisons, if the method is fast.
    exact: Option<Instrument<'a>>,
    listed: Vec<ListedPeriod>,
    /// Number of periods that were run, for the progress.
    done: AtomicUsize,
}

impl<'a> Settled<'a> {
    pub(super) fn new(
        plan: &'a Plan,
        lever_memory: f64,
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        let instrument = Instrument::new(plan)?;
        let exact = if plan.method == super::options::Method::Fast && !instrument.is_exact() {
            Some(instrument.exact()?)
        } else {
            None
        };
        let settled = Self {
            plan,
            lever_memory,
            instrument,
            exact,
            listed: Vec::new(),
            done: AtomicUsize::new(0),
        };
        let mut runner = settled.runner(0, control);
        runner.settle(0, plan.settle)?;
        let (instrument, listed) = (runner.instrument, runner.recorded.listed);
        Ok(Self {
            instrument,
            listed,
            ..settled
        })
    }

    /// Creates a runner that continues from here with drive period `k`.
    fn runner<'c>(&'c self, k: usize, control: &'c Control<'c>) -> Runner<'a, 'c> {
        Runner {
            plan: self.plan,
            control,
            done: &self.done,
            total: self.plan.total_periods(),
            instrument: self.instrument.clone(),
            exact: self.exact.clone(),
            tracker: BranchTracker::new(self.lever_memory),
            recorded: Recorded::default(),
            k,
            at_range: self.instrument.at_range(),
        }
    }

    /// Runs a line that settles separately before it.
    pub(super) fn independent_line(
        &self,
        line: usize,
        control: &Control<'_>,
    ) -> Result<Recorded, Error> {
        let plan = self.plan;
        let mut runner = self.runner(plan.settle + line * plan.periods_per_line(), control);
        runner.settle(line, plan.line_settle.unwrap_or(0))?;
        runner.run_line(line)?;
        Ok(runner.finish())
    }

    /// Every line, those that are finished if the work was cancelled.
    pub(super) fn lines(&self, control: &Control<'_>) -> Result<Recorded, Error> {
        let lines = 0..self.plan.lines;
        let mut all = Recorded {
            listed: self.listed.clone(),
            at_range: self.instrument.at_range(),
            ..Recorded::default()
        };
        if self.plan.line_settle.is_none() {
            let mut runner = self.runner(self.plan.settle, control);
            for line in lines {
                match runner.run_line(line) {
                    Err(error) if is_stopped(&error) => {
                        runner.recorded.lines.retain(|l| l.statistics.line < line);
                        break;
                    }
                    done => done?,
                }
            }
            all.join(runner.finish());
        } else {
            let finished: Vec<Result<Recorded, Error>> = lines
                .into_par_iter()
                .with_max_len(1)
                .map(|line| self.independent_line(line, control))
                .collect();
            for line in finished {
                match line {
                    Err(error) if is_stopped(&error) => {}
                    line => all.join(line?),
                }
            }
        }
        if all.lines.is_empty() {
            return Err(Error::stopped());
        }
        Ok(all)
    }
}

fn is_stopped(error: &Error) -> bool {
    error.kind == ErrorKind::Stopped
}
