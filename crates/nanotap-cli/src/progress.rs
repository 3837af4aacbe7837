//! Long work at the terminal: a line that says how far it is, and Ctrl-C that stops it
//! and keeps what is done.

use std::io::{IsTerminal as _, Write as _};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nanotap::control::Control;

use crate::failure::Failure;
use crate::output::Output;

/// Whether somebody pressed Ctrl-C.
static STOP: AtomicBool = AtomicBool::new(false);
/// Nothing is said of work shorter than this.
const PATIENCE: Duration = Duration::from_millis(700);
/// Time between two lines.
const INTERVAL: Duration = Duration::from_millis(100);

/// Does `work` with a control that reports to the terminal and stops at Ctrl-C; a second
/// Ctrl-C ends the program at once. `noun` is what is counted.
pub(crate) fn watched<R>(
    output: &Output,
    noun: &'static str,
    work: impl FnOnce(&Control<'_>) -> R,
) -> Result<R, Failure> {
    listen()?;
    let line = Line::new(noun, output);
    let report = |done: usize, total: usize| line.show(done, total);
    let control = Control {
        cancel: Some(&STOP),
        progress: Some(&report),
    };
    let result = work(&control);
    line.clear();
    Ok(result)
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

/// One line on standard error, written over itself.
struct Line {
    noun: &'static str,
    shown: bool,
    begun: Instant,
    last: Mutex<Option<Instant>>,
}

impl Line {
    fn new(noun: &'static str, output: &Output) -> Self {
        let shown = !output.is_quiet() && std::io::stderr().is_terminal();
        Self {
            noun,
            shown,
            begun: Instant::now(),
            last: Mutex::new(None),
        }
    }

    fn show(&self, done: usize, total: usize) {
        if !self.shown || self.begun.elapsed() < PATIENCE {
            return;
        }
        // Whoever cannot have the line at once leaves it to the next.
        let Ok(mut last) = self.last.try_lock() else {
            return;
        };
        if last.is_some_and(|at| at.elapsed() < INTERVAL) {
            return;
        }
        *last = Some(Instant::now());
        let left = self.begun.elapsed().as_secs_f64() * (total.saturating_sub(done)) as f64
            / done.max(1) as f64;
        let stop = if STOP.load(Ordering::Relaxed) {
            ", stopping"
        } else {
            ""
        };
        let mut stream = std::io::stderr().lock();
        let _ = write!(
            stream,
            "\r\x1b[K{done} of {total} {}, about {} left{stop}",
            self.noun,
            duration(left)
        );
        let _ = stream.flush();
    }

    fn clear(&self) {
        let written = self.last.lock().is_ok_and(|last| last.is_some());
        if written {
            let mut stream = std::io::stderr().lock();
            let _ = write!(stream, "\r\x1b[K");
            let _ = stream.flush();
        }
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
    use super::duration;

    #[test]
    fn durations_are_short() {
        assert_eq!(duration(8.4), "8 s");
        assert_eq!(duration(180.0), "3 min");
        assert_eq!(duration(9000.0), "2.5 h");
    }
}
