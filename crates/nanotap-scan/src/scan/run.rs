//! Lines of a scan, in sequence or independent of each other.

use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::Control;
use rayon::prelude::*;

use super::instrument::{Instrument, Period};
use super::plan::Plan;
use super::recorder::{LineRecord, LineRecorder, listed};
use super::report::{BranchChange, Direction, ListedPeriod};
use super::state_tracker::StateTracker;
use nanotap_error::Error;
use nanotap_error::ErrorKind;

/// Lines, listed periods and branch changes that a scan recorded.
#[derive(Debug, Default)]
pub(super) struct Recorded {
    pub(super) lines: Vec<LineRecord>,
    pub(super) listed: Vec<ListedPeriod>,
    pub(super) changes: Vec<BranchChange>,
    /// Number of periods before the first line whose command was limited by the range of z.
    pub(super) at_range: usize,
}

impl Recorded {
    pub(super) fn join(&mut self, other: Self) {
        self.lines.extend(other.lines);
        self.listed.extend(other.listed);
        self.changes.extend(other.changes);
        self.at_range += other.at_range;
    }
}

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
    tracker: StateTracker<'a>,
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
        for _ in 0..periods {
            let k = self.k;
            let period = self.run_period(x, y)?;
            let Self {
                tracker,
                instrument,
                ..
            } = self;
            tracker.add(k, line, Direction::Trace, &period, instrument);
        }
        // A change before the line is not in the image.
        self.tracker.changes.clear();
        Ok(())
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
        let mut recorder = LineRecorder::new(plan, line, direction, self.k);
        for index in 0..plan.periods {
            let x = plan.position(index, retrace);
            let k = self.k;
            let period = self.run_period(x, y)?;
            let Self {
                tracker,
                instrument,
                ..
            } = &mut *self;
            tracker.add(k, line, direction, &period, instrument);
            recorder.add(index, &period, tracker);
        }
        let at_range = self.instrument.at_range();
        let (statistics, pixels) = recorder.finish();
        self.recorded.lines.push(LineRecord {
            statistics,
            pixels,
            at_range: at_range - self.at_range,
        });
        self.at_range = at_range;
        Ok(())
    }

    fn finish(mut self) -> Recorded {
        self.recorded.changes = self.tracker.changes;
        self.recorded
    }
}

/// An instrument that has settled before the first line.
#[derive(Debug)]
pub(super) struct Settled<'a> {
    plan: &'a Plan,
    pub(super) instrument: Instrument<'a>,
    tracker: StateTracker<'a>,
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
        let settled = Self {
            plan,
            instrument,
            tracker: StateTracker::new(plan, lever_memory),
            listed: Vec::new(),
            done: AtomicUsize::new(0),
        };
        let mut runner = settled.runner(0, control);
        runner.settle(0, plan.settle)?;
        let (instrument, tracker) = (runner.instrument, runner.tracker);
        let listed = runner.recorded.listed;
        Ok(Self {
            instrument,
            tracker,
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
            tracker: self.tracker.clone(),
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
