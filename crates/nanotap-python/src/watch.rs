//! Work on a separate thread: progress is reported, signals are handled, panics are caught, and the
//! interpreter is free meanwhile.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use nanotap::control::{CancelFlag, Control};
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::failure::Failure;

/// Time between two checks of signals and progress.
const INTERVAL: Duration = Duration::from_millis(50);
/// Time for which a thread polls for a message before it sleeps: waking it takes as long as many a
/// motion, and the next of many calls usually comes earlier.
const AWAKE: Duration = Duration::from_micros(250);
/// Time that cancelled work may take to end. Work that takes longer is left to end by itself: it
/// uses no Python objects.
const PATIENCE: Duration = Duration::from_millis(900);
/// The same for work that reports its progress, whose finished part is worth waiting for. A second
/// Ctrl-C does not wait.
const LONG_PATIENCE: Duration = Duration::from_secs(5);

/// Result of watched work.
pub(crate) struct Watched<R> {
    /// The result; if the work was stopped, the part that was finished.
    pub(crate) result: R,
    /// Whether Ctrl-C stopped the work.
    pub(crate) interrupted: bool,
}

/// Runs `work` with a control that calls `progress(done, total)` and stops at Ctrl-C; its parallel
/// parts run on the threads of this process.
///
/// # Errors
/// Those of the work, those that `progress` raises, `KeyboardInterrupt` if the work did not react
/// to the cancellation, and `RuntimeError` for a panic.
pub(crate) fn watched<R: Send + 'static>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Control<'_>) -> Result<R, Failure> + Send + 'static,
) -> PyResult<Watched<R>> {
    let work = move |control: &Control<'_>| threads_of_this_process()?.install(|| work(control));
    watched_alone(py, progress, work)
}

/// The same for work without parallel parts: waking the threads of this process would take longer
/// than many a motion.
///
/// # Errors
/// As [`watched`].
pub(crate) fn watched_alone<R: Send + 'static>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Control<'_>) -> Result<R, Failure> + Send + 'static,
) -> PyResult<Watched<R>> {
    let cancel = CancelFlag::new();
    let counts = Arc::new([AtomicUsize::new(0), AtomicUsize::new(0)]);
    let (sender, receiver) = channel();
    let inside = (cancel.clone(), Arc::clone(&counts));
    elsewhere(Box::new(move || {
        let (cancel, counts) = inside;
        let report = |done: usize, total: usize| {
            counts[0].fetch_max(done, Ordering::Relaxed);
            counts[1].store(total, Ordering::Relaxed);
        };
        let control = Control {
            cancel: Some(&cancel),
            progress: Some(&report),
        };
        let result = catch_unwind(AssertUnwindSafe(|| work(&control)));
        Box::new(move || {
            // The receiver may be gone.
            let _ = sender.send(result);
        })
    }))
    .map_err(|error| PyRuntimeError::new_err(format!("cannot start a thread: {error}")))?;
    py.detach(move || {
        let mut stopped: Option<(Instant, PyErr)> = None;
        let mut reported = (0, 0);
        loop {
            let done = match soon(&receiver).map_or_else(|| receiver.recv_timeout(INTERVAL), Ok) {
                Ok(done) => Some(done),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(PyRuntimeError::new_err("the work ended without a result"));
                }
            };
            let seen = (
                counts[0].load(Ordering::Relaxed),
                counts[1].load(Ordering::Relaxed),
            );
            if stopped.is_none() && (done.is_none() || seen != reported) {
                reported = seen;
                if let Err(error) = Python::attach(|py| look(py, progress.as_ref(), seen)) {
                    cancel.cancel();
                    stopped = Some((Instant::now(), error));
                }
            }
            if let (Some(_), None) = (&stopped, &done) {
                Python::attach(|py| look(py, None, seen))?;
            }
            let patience = if seen.1 > 0 { LONG_PATIENCE } else { PATIENCE };
            match (done, stopped.take()) {
                (None, Some((since, error))) if since.elapsed() > patience => return Err(error),
                (None, still) => stopped = still,
                (Some(done), stopped) => return ended(done, stopped.map(|(_, error)| error)),
            }
        }
    })
}

/// Handles pending signals and reports progress to Python.
fn look(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    (done, total): (usize, usize),
) -> PyResult<()> {
    py.check_signals()?;
    if let (Some(progress), true) = (progress, total > 0) {
        progress.call1(py, (done, total))?;
    }
    Ok(())
}

type Outcome<R> = std::thread::Result<Result<R, Failure>>;

fn ended<R>(done: Outcome<R>, stopped: Option<PyErr>) -> PyResult<Watched<R>> {
    let interrupted = stopped.is_some();
    if let Some(error) = stopped {
        let by_hand = Python::attach(|py| error.is_instance_of::<PyKeyboardInterrupt>(py));
        if !by_hand || !matches!(done, Ok(Ok(_))) {
            return Err(error);
        }
    }
    match done {
        Ok(result) => Ok(Watched {
            result: result?,
            interrupted,
        }),
        Err(panic) => {
            let words = panic
                .downcast_ref::<&str>()
                .map(|words| (*words).to_owned())
                .or_else(|| panic.downcast_ref::<String>().cloned())
                .unwrap_or_default();
            Err(PyRuntimeError::new_err(format!(
                "a mistake inside nanotap, please report it: {words}"
            )))
        }
    }
}

/// Waits for a message for [`AWAKE`] at most, without sleeping; other threads run meanwhile.
fn soon<T>(messages: &Receiver<T>) -> Option<T> {
    let since = Instant::now();
    loop {
        match messages.try_recv() {
            Ok(message) => return Some(message),
            Err(TryRecvError::Disconnected) => return None,
            Err(TryRecvError::Empty) if since.elapsed() > AWAKE => return None,
            Err(TryRecvError::Empty) => std::thread::yield_now(),
        }
    }
}

/// Work that returns the call which reports its result.
type Job = Box<dyn FnOnce() -> Box<dyn FnOnce()> + Send>;

/// Runs `job` on an idle thread, or on a new one: starting a thread takes longer than many a
/// motion.
fn elsewhere(job: Job) -> io::Result<()> {
    static IDLE: Mutex<OfThisProcess<Vec<Sender<Job>>>> = Mutex::new(OfThisProcess(None));
    const MAX_IDLE: usize = 8;
    let idle = lock(&IDLE).get_or_make(|| Ok(Vec::new()))?.pop();
    let mut job = match idle {
        Some(thread) => match thread.send(job) {
            Ok(()) => return Ok(()),
            Err(unsent) => unsent.0,
        },
        None => job,
    };
    let (sender, jobs) = channel();
    let work = move || {
        loop {
            let tell = job();
            // Before the result is reported: a process that forks then must not find the list
            // locked.
            let stays = lock(&IDLE)
                .get_or_make(|| Ok(Vec::new()))
                .is_ok_and(|idle| {
                    let stays = idle.len() < MAX_IDLE;
                    idle.extend(stays.then(|| sender.clone()));
                    stays
                });
            tell();
            if !stays {
                return;
            }
            match soon(&jobs).map_or_else(|| jobs.recv(), Ok) {
                Ok(next) => job = next,
                Err(_) => return,
            }
        }
    };
    std::thread::Builder::new()
        .name("nanotap".into())
        .spawn(work)?;
    Ok(())
}

/// A value that belongs to one process, such as its threads. Threads do not survive a fork: a child
/// that waited for those of its parent would wait for ever, so it creates its own.
struct OfThisProcess<T>(Option<(u32, T)>);

impl<T> OfThisProcess<T> {
    fn get_or_make(&mut self, make: impl FnOnce() -> io::Result<T>) -> io::Result<&mut T> {
        let process = std::process::id();
        if self.0.as_ref().is_none_or(|(owner, _)| *owner != process) {
            // The parent's can be neither used nor joined.
            std::mem::forget(self.0.replace((process, make()?)));
        }
        self.0
            .as_mut()
            .map(|(_, one)| one)
            .ok_or_else(|| io::ErrorKind::NotFound.into())
    }
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the thread pool of this process, with one thread per core.
fn threads_of_this_process() -> Result<Arc<ThreadPool>, Failure> {
    static POOL: Mutex<OfThisProcess<Arc<ThreadPool>>> = Mutex::new(OfThisProcess(None));
    let make = || {
        let pool = ThreadPoolBuilder::new().build();
        pool.map(Arc::new).map_err(io::Error::other)
    };
    let mut pool = lock(&POOL);
    let pool = pool.get_or_make(make).map_err(|error| {
        Failure(nanotap::Error::numerics(format!(
            "cannot start a thread a core: {error}"
        )))
    })?;
    Ok(Arc::clone(pool))
}
