//! Progress of long work on standard error, and Ctrl-C, which stops it and keeps finished results.
//!
//! On a terminal one line is overwritten; where standard error is redirected, a new line is written
//! after 2 s and then at growing intervals.

use std::io::{IsTerminal as _, Write as _};
use std::sync::{LazyLock, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use nanotap::case::Case;
use nanotap::control::{CancelFlag, Control};
use nanotap::study::Study;

use crate::failure::Failure;
use crate::threads::ThreadsArgument;

/// Exit code after Ctrl-C or SIGTERM.
pub(crate) const INTERRUPTED: u8 = 130;

/// Set by the first Ctrl-C or SIGTERM.
static STOP: LazyLock<CancelFlag> = LazyLock::new(CancelFlag::new);
/// On a terminal, work shorter than this reports nothing.
const DELAY: Duration = Duration::from_millis(700);
/// Time between two writes of the line on a terminal.
const INTERVAL: Duration = Duration::from_millis(200);
/// Time to the first line where standard error is redirected; from then on it doubles.
const FIRST_LINE: Duration = Duration::from_secs(2);
/// Longest time between two such lines.
const LONGEST_INTERVAL: Duration = Duration::from_secs(300);
/// Longest time in which cancelled work without results to keep must end.
const STOPPING: Duration = Duration::from_millis(900);
/// Longest time in which cancelled work that keeps finished results must end.
const KEEPING: Duration = Duration::from_secs(5);

/// The progress line of the program, shared by its threads.
static LINE: Mutex<Line> = Mutex::new(Line {
    work: None,
    saving: false,
    written: false,
    ended: true,
});

/// State of the progress line on standard error.
struct Line {
    work: Option<Counted>,
    /// Whether results of cancelled work are being written.
    saving: bool,
    /// Whether the line is on the terminal now.
    written: bool,
    /// Whether the program is done, or reports nothing.
    ended: bool,
}

/// Work with a count of finished items.
#[derive(Clone, Copy)]
struct Counted {
    /// Name of the work, as shown on the line.
    what: &'static str,
    /// Name of the items, in the plural.
    noun: &'static str,
    /// Whether finished results are kept when it is cancelled.
    keeps: bool,
    /// Time from which the items are counted, and the number of them that were done then.
    begun: Instant,
    first: usize,
    done: usize,
    total: usize,
}

/// Starts to report on standard error what the program does and how much is done, until [`end`].
pub(crate) fn begin() {
    line().ended = false;
    let begun = Instant::now();
    let terminal = std::io::stderr().is_terminal();
    thread::spawn(move || {
        let mut interval = if terminal { DELAY } else { FIRST_LINE };
        loop {
            thread::sleep(interval);
            if !line().write(begun, terminal) {
                return;
            }
            interval = if terminal {
                INTERVAL
            } else {
                LONGEST_INTERVAL.min(2 * interval)
            };
        }
    });
}

/// Erases the line; it may be written again.
pub(crate) fn clear() {
    line().clear();
}

/// Erases the line and ends the reports: the result follows.
pub(crate) fn end() {
    let mut line = line();
    line.clear();
    line.ended = true;
}

/// Runs a study on so many threads, as [`watched`] does.
pub(crate) fn study<S: Study>(
    case: &Case,
    options: &S::Options,
    threads: &ThreadsArgument,
) -> Result<S::Report, Failure>
where
    S::Options: Sync,
    S::Report: Send,
{
    watched(S::NAME, S::COUNTED, S::PARTIAL, |control| {
        threads.install(|| S::run(case, options, control))
    })?
}

/// Runs `work` with a control that reports its count on the line and is cancelled by Ctrl-C. `what`
/// names the work, `noun` the counted items; `keeps`: cancelled work leaves its finished results.
pub(crate) fn watched<R>(
    what: &'static str,
    noun: &'static str,
    keeps: bool,
    work: impl FnOnce(&Control<'_>) -> R,
) -> R {
    let counted = |(begun, first): (Instant, usize), done: usize, total: usize| Counted {
        what,
        noun,
        keeps,
        begun,
        first,
        done,
        total,
    };
    line().work = Some(counted((Instant::now(), 0), 0, 0));
    // What precedes the first item, such as the search for known states, says nothing about the
    // time of the others.
    let first = OnceLock::new();
    let report = |done: usize, total: usize| {
        let since = *first.get_or_init(|| (Instant::now(), done));
        // A thread that does not get the line at once skips this report.
        if let Ok(mut line) = LINE.try_lock() {
            line.work = Some(counted(since, done, total));
        }
    };
    let control = Control {
        progress: Some(&report),
        ..control()
    };
    let result = work(&control);
    let mut line = line();
    line.work = None;
    line.saving |= keeps && is_stopped();
    line.clear();
    result
}

/// A control that Ctrl-C cancels.
pub(crate) fn control() -> Control<'static> {
    Control {
        cancel: Some(&STOP),
        progress: None,
    }
}

/// Whether Ctrl-C was pressed or SIGTERM came.
pub(crate) fn is_stopped() -> bool {
    STOP.is_cancelled()
}

/// The line, also after a panic elsewhere.
fn line() -> MutexGuard<'static, Line> {
    LINE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes Ctrl-C and SIGTERM cancel the work, and a second one end the program at once.
pub(crate) fn listen() -> Result<(), Failure> {
    LazyLock::force(&STOP);
    ctrlc::set_handler(|| {
        if is_stopped() {
            std::process::exit(INTERRUPTED.into());
        }
        STOP.cancel();
        thread::spawn(end_late);
    })
    .map_err(|error| Failure::numerics(format!("cannot listen for Ctrl-C: {error}")))
}

/// Ends the program if cancelled work does not end by itself.
fn end_late() {
    let begun = Instant::now();
    thread::sleep(STOPPING);
    loop {
        let (keeps, saving) = {
            let line = line();
            (line.work.is_some_and(|work| work.keeps), line.saving)
        };
        if saving {
            return;
        }
        if !keeps || begun.elapsed() > KEEPING {
            clear();
            anstream::eprintln!("{}", crate::style::error("stopped before it was done"));
            std::process::exit(INTERRUPTED.into());
        }
        thread::sleep(INTERVAL);
    }
}

impl Line {
    /// Overwrites the line on a terminal, or appends one; returns whether to go on.
    fn write(&mut self, begun: Instant, terminal: bool) -> bool {
        if self.ended {
            return false;
        }
        let words = self.words(begun);
        let mut stream = std::io::stderr().lock();
        let _ = if terminal {
            write!(stream, "\r\x1b[K{words}")
        } else {
            writeln!(stream, "{words}")
        };
        let _ = stream.flush();
        self.written = terminal;
        true
    }

    fn words(&self, begun: Instant) -> String {
        let work = self.work.map(|work| (work, work.begun.elapsed()));
        words(work, begun.elapsed(), is_stopped())
    }

    fn clear(&mut self) {
        if std::mem::take(&mut self.written) {
            let mut stream = std::io::stderr().lock();
            let _ = write!(stream, "\r\x1b[K");
            let _ = stream.flush();
        }
    }
}

/// Text of the line after `elapsed` of the whole program and the given time of the counted work.
fn words(work: Option<(Counted, Duration)>, elapsed: Duration, stopping: bool) -> String {
    let so_far = format!("{} so far", duration(elapsed.as_secs_f64()));
    let words = match work {
        Some((work, spent)) if work.done > 0 => {
            let left = work.total.saturating_sub(work.done);
            let Counted {
                what,
                first,
                done,
                total,
                noun,
                ..
            } = work;
            let left = match done {
                // What follows on all of them is not counted.
                done if done >= total => format!("finishing, {so_far}"),
                done if done <= first => so_far,
                done => {
                    let left = spent.as_secs_f64() * left as f64 / (done - first) as f64;
                    format!("about {} left", duration(left))
                }
            };
            format!("{what}: {done} of {total} {noun}, {left}")
        }
        Some((work, _)) if work.total > 0 => {
            format!("{}: 0 of {} {}, {so_far}", work.what, work.total, work.noun)
        }
        Some((work, _)) => format!("{}: {so_far}", work.what),
        None => format!("working, {so_far}"),
    };
    if stopping {
        format!("{words}, stopping")
    } else {
        words
    }
}

/// `8 s`, `3 min`, `2.5 h`.
fn duration(seconds: f64) -> String {
    if seconds < 90.0 {
        format!("{seconds:.0} s")
    } else if seconds < 5400.0 {
        format!("{:.0} min", seconds / 60.0)
    } else {
        format!("{:.1} h", seconds / 3600.0)
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::{Counted, duration, words};

    #[test]
    fn durations_are_short() {
        assert_eq!(duration(8.4), "8 s");
        assert_eq!(duration(180.0), "3 min");
        assert_eq!(duration(9000.0), "2.5 h");
    }

    #[test]
    fn the_line_says_how_far_the_work_is() {
        let seconds = Duration::from_secs;
        let counted = |done, total| Counted {
            what: "attractors",
            noun: "starts",
            keeps: true,
            begun: Instant::now(),
            first: 0,
            done,
            total,
        };
        let second = |done, total| Counted {
            first: 5,
            ..counted(done, total)
        };
        for (work, said) in [
            (None, "working, 12 s so far"),
            (Some(counted(0, 0)), "attractors: 12 s so far"),
            (
                Some(counted(0, 40)),
                "attractors: 0 of 40 starts, 12 s so far",
            ),
            // 10 of 40 in 4 s: 30 are left, which take 12 s.
            (
                Some(counted(10, 40)),
                "attractors: 10 of 40 starts, about 12 s left",
            ),
            // Before the fifth something else was done: 5 of 40 in 4 s, 30 are left.
            (
                Some(second(10, 40)),
                "attractors: 10 of 40 starts, about 24 s left",
            ),
            (
                Some(second(5, 40)),
                "attractors: 5 of 40 starts, 12 s so far",
            ),
            (
                Some(counted(40, 40)),
                "attractors: 40 of 40 starts, finishing, 12 s so far",
            ),
        ] {
            let work = work.map(|work| (work, seconds(4)));
            assert_eq!(words(work, seconds(12), false), said);
            assert_eq!(words(work, seconds(12), true), format!("{said}, stopping"));
        }
    }
}
