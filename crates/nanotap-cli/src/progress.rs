//! Long work at the terminal: a line that says how far it is, and Ctrl-C that stops it
//! and keeps what is done.

use std::io::{IsTerminal as _, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use nanotap::control::Control;

use crate::failure::Failure;

/// Whether somebody pressed Ctrl-C.
static STOP: AtomicBool = AtomicBool::new(false);
/// Nothing is said of work shorter than this.
const PATIENCE: Duration = Duration::from_millis(700);
/// Time between two lines.
const INTERVAL: Duration = Duration::from_millis(200);

/// What the line says; one program has one line.
static LINE: Mutex<Line> = Mutex::new(Line {
    work: None,
    written: false,
    ended: true,
});

/// The line on standard error that is written over itself.
struct Line {
    work: Option<Counted>,
    /// Whether it stands on the terminal now.
    written: bool,
    /// Whether the program is done, or nobody watches.
    ended: bool,
}

/// Work that counts what it has done.
#[derive(Clone, Copy)]
struct Counted {
    noun: &'static str,
    begun: Instant,
    done: usize,
    total: usize,
}

/// From now on a line says that the program works, and how far it is, until [`end`].
pub(crate) fn begin() {
    if !std::io::stderr().is_terminal() {
        return;
    }
    line().ended = false;
    let begun = Instant::now();
    thread::spawn(move || {
        thread::sleep(PATIENCE);
        while line().tick(begun) {
            thread::sleep(INTERVAL);
        }
    });
}

/// Takes the line away; it may come back.
pub(crate) fn clear() {
    line().clear();
}

/// Takes the line away for good: the result follows.
pub(crate) fn end() {
    let mut line = line();
    line.clear();
    line.ended = true;
}

/// Does `work` with a control that counts on the line and stops at Ctrl-C; a second Ctrl-C ends
/// the program at once. `noun` is what is counted.
pub(crate) fn watched<R>(
    noun: &'static str,
    work: impl FnOnce(&Control<'_>) -> R,
) -> Result<R, Failure> {
    listen()?;
    let counted = |done: usize, total: usize, begun: Instant| Counted {
        noun,
        begun,
        done,
        total,
    };
    let begun = Instant::now();
    line().work = Some(counted(0, 0, begun));
    let report = |done: usize, total: usize| {
        // Whoever cannot have the line at once leaves it to the next.
        if let Ok(mut line) = LINE.try_lock() {
            line.work = Some(counted(done, total, begun));
        }
    };
    let control = Control {
        cancel: Some(&STOP),
        progress: Some(&report),
    };
    let result = work(&control);
    let mut line = line();
    line.work = None;
    line.clear();
    Ok(result)
}

/// The line, also after a panic elsewhere.
fn line() -> MutexGuard<'static, Line> {
    LINE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Hears Ctrl-C from now on.
fn listen() -> Result<(), Failure> {
    static LISTENING: AtomicBool = AtomicBool::new(false);
    if LISTENING.swap(true, Ordering::SeqCst) {
        return Ok(());
    }
    ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::SeqCst) {
            // What the shell says of a program that Ctrl-C ended.
            std::process::exit(130);
        }
    })
    .map_err(|error| Failure::numerics(format!("cannot listen for Ctrl-C: {error}")))
}

impl Line {
    /// Writes the line anew; whether to go on.
    fn tick(&mut self, begun: Instant) -> bool {
        if self.ended {
            return false;
        }
        let words = words(
            self.work.map(|work| (work, work.begun.elapsed())),
            begun.elapsed(),
            STOP.load(Ordering::Relaxed),
        );
        let mut stream = std::io::stderr().lock();
        let _ = write!(stream, "\r\x1b[K{words}");
        let _ = stream.flush();
        self.written = true;
        true
    }

    fn clear(&mut self) {
        if std::mem::take(&mut self.written) {
            let mut stream = std::io::stderr().lock();
            let _ = write!(stream, "\r\x1b[K");
            let _ = stream.flush();
        }
    }
}

/// What the line says after `elapsed` of the whole and so long of the counted work.
fn words(work: Option<(Counted, Duration)>, elapsed: Duration, stopping: bool) -> String {
    let so_far = format!("{} so far", duration(elapsed.as_secs_f64()));
    let words = match work {
        Some((work, spent)) if work.done > 0 => {
            let left = work.total.saturating_sub(work.done);
            let left = spent.as_secs_f64() * left as f64 / work.done as f64;
            let (
                Counted {
                    done, total, noun, ..
                },
                left,
            ) = (work, duration(left));
            format!("{done} of {total} {noun}, about {left} left")
        }
        Some((work, _)) if work.total > 0 => {
            format!("0 of {} {}, {so_far}", work.total, work.noun)
        }
        _ => format!("working, {so_far}"),
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
        let counted = |done| Counted {
            noun: "starts",
            begun: Instant::now(),
            done,
            total: 40,
        };
        for (work, said) in [
            (None, "working, 12 s so far"),
            (Some(counted(0)), "0 of 40 starts, 12 s so far"),
            // 10 of 40 in 4 s: 30 are left, which take 12 s.
            (Some(counted(10)), "10 of 40 starts, about 12 s left"),
        ] {
            let work = work.map(|work| (work, seconds(4)));
            assert_eq!(words(work, seconds(12), false), said);
            assert_eq!(words(work, seconds(12), true), format!("{said}, stopping"));
        }
    }
}
