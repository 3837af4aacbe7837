//! Computation of the chunks of a store on several threads.
//!
//! Threads take the items of the chunks in order, and the thread that completes a chunk writes it.
//! All threads are busy until the end, at most one more chunk than there are threads is in memory,
//! and the bytes do not depend on the threads.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use nanotap_dynamics::Control;

use super::error::StoreError;
use super::grid::Block;
use super::schema::Values;
use super::share::Share;
use super::store::Store;

/// Options of the computation of a dataset.
#[derive(Clone, Copy, Debug)]
pub struct Work<'a> {
    /// Share of the chunks that this run computes.
    pub share: Share,
    /// Number of threads; 0: one per core.
    pub threads: usize,
    /// Cancellation, and progress in items left to compute.
    pub control: Control<'a>,
}

/// Why the computation ended early.
#[derive(Debug, thiserror::Error)]
pub enum WorkError {
    /// Cancelled; the finished chunks are in the store.
    #[error("stopped; {finished} of {total} chunks are finished")]
    Cancelled {
        /// Number of finished chunks of the share.
        finished: usize,
        /// Number of chunks of the share.
        total: usize,
    },
    /// Cancelled after the last chunk.
    #[error(
        "stopped; every chunk is finished, but orbits have not been continued to neighbouring values"
    )]
    Neighbours,
    /// A computation failed, or the threads could not be started.
    #[error(transparent)]
    Failed(Box<nanotap_error::Error>),
    /// Reading or writing the store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// Results received for one chunk.
struct Pending<T> {
    results: Vec<Option<T>>,
    left: usize,
}

/// Computes and writes every unfinished chunk of the share. `items` returns the number of items of
/// a chunk (at least one), `compute` computes one (`None` if cancelled), and `assemble` creates the
/// columns of a chunk from its items.
///
/// # Errors
/// If the computation is cancelled or the store fails.
pub fn work<T: Send>(
    store: &Store,
    how: &Work<'_>,
    items: impl Fn(&Block) -> usize,
    compute: impl Fn(&Block, usize) -> Option<T> + Sync,
    assemble: impl Fn(&Block, Vec<T>) -> Vec<Values> + Sync,
) -> Result<(), WorkError> {
    let grid = &store.schema().grid;
    let mine: Vec<usize> = (0..store.chunks())
        .filter(|c| how.share.holds(*c))
        .collect();
    let todo: Vec<Block> = mine
        .iter()
        .filter(|c| !store.is_finished(**c))
        .map(|c| grid.block(*c))
        .collect();
    let counts: Vec<usize> = todo.iter().map(|b| items(b).max(1)).collect();
    let total: usize = counts.iter().sum();
    let done = AtomicUsize::new(0);
    if let Some(progress) = how.control.progress {
        progress(0, total);
    }
    let next = Mutex::new((0, 0));
    let pending: Mutex<BTreeMap<usize, Pending<T>>> = Mutex::new(BTreeMap::new());
    let stopped = AtomicBool::new(false);
    let failure: Mutex<Option<StoreError>> = Mutex::new(None);

    let take = || {
        let mut next = lock(&next);
        let (position, item) = *next;
        let count = *counts.get(position)?;
        *next = if item + 1 < count {
            (position, item + 1)
        } else {
            (position + 1, 0)
        };
        Some((position, item))
    };
    let deliver = |position: usize, item: usize, result: T| {
        let mut pending = lock(&pending);
        let entry = pending.entry(position).or_insert_with(|| Pending {
            results: (0..counts[position]).map(|_| None).collect(),
            left: counts[position],
        });
        entry.results[item] = Some(result);
        entry.left -= 1;
        if entry.left == 0 {
            pending.remove(&position)
        } else {
            None
        }
    };
    let worker = || {
        while !how.control.is_cancelled() && !stopped.load(Ordering::Relaxed) {
            let Some((position, item)) = take() else {
                break;
            };
            let block = &todo[position];
            let Some(result) = compute(block, item) else {
                break;
            };
            if let Some(whole) = deliver(position, item, result) {
                let results = whole.results.into_iter().flatten().collect();
                if let Err(error) = store.write_chunk(block, &assemble(block, results)) {
                    lock(&failure).get_or_insert(error);
                    stopped.store(true, Ordering::Relaxed);
                }
            }
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            if let Some(progress) = how.control.progress {
                progress(count, total);
            }
        }
    };
    let threads = threads(how.threads).min(total.max(1));
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(worker);
        }
        worker();
    });
    if let Some(error) = failure
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
    {
        return Err(error.into());
    }
    let finished = mine.iter().filter(|c| store.is_finished(**c)).count();
    if finished < mine.len() {
        return Err(WorkError::Cancelled {
            finished,
            total: mine.len(),
        });
    }
    store.tidy()?;
    Ok(())
}

/// Returns the number of threads for the option value `given`; 0 means one per core.
pub fn threads(given: usize) -> usize {
    if given > 0 {
        return given;
    }
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// Locks a mutex, also after a panic of another thread, which ends the scope anyway.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

impl From<WorkError> for nanotap_error::Error {
    fn from(error: WorkError) -> Self {
        match error {
            WorkError::Failed(error) => *error,
            WorkError::Store(error) => error.into(),
            WorkError::Cancelled { .. } | WorkError::Neighbours => {
                Self::new(nanotap_error::ErrorKind::Stopped, error.to_string())
            }
        }
    }
}
