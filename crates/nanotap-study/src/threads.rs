//! How many threads work on a study. The result is the same for any number.

use crate::limits::MAX_THREADS;
use nanotap_error::Error;

/// The number of threads, if it is available; `None`: one per core.
///
/// # Errors
/// When there are none, or more than any machine has.
pub fn checked(threads: Option<usize>) -> Result<Option<usize>, Error> {
    match threads {
        Some(number) if !(1..=MAX_THREADS).contains(&number) => Err(Error::option(
            "threads",
            format!("{number} cannot work"),
            format!("give a whole number from 1 to {MAX_THREADS}"),
        )),
        other => Ok(other),
    }
}

/// Runs `work` on this number of threads; `None`: one per core.
///
/// # Errors
/// As [`checked`], and when the threads cannot be started.
pub fn install<R: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> R + Send,
) -> Result<R, Error> {
    let Some(threads) = checked(threads)? else {
        return Ok(work());
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map(|pool| pool.install(work))
        .map_err(|error| Error::numerics(format!("cannot start {threads} threads: {error}")))
}
