//! Stopping long work from outside and hearing how far it is.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// What a caller hands to long work. The default neither cancels nor reports.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Work stops soon after this becomes true; what is done is returned.
    pub cancel: Option<&'a AtomicBool>,
    /// Called with the number of finished items and their total, from any thread,
    /// in no particular order.
    pub progress: Option<&'a (dyn Fn(usize, usize) + Sync)>,
}

impl std::fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Control")
            .field("cancel", &self.cancel)
            .field("progress", &self.progress.is_some())
            .finish()
    }
}

impl Control<'_> {
    /// True once the caller wants the work to stop.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|c| c.load(Ordering::Relaxed))
    }

    pub(crate) fn report(&self, done: &AtomicUsize, total: usize) {
        let count = done.fetch_add(1, Ordering::Relaxed) + 1;
        if let Some(progress) = self.progress {
            progress(count, total);
        }
    }
}
