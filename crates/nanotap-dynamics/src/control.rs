//! Stopping long work from outside and hearing how far it is.
//!
//! A loop polls [`Control::is_cancelled`] between its items and keeps the finished ones. Within an
//! item the map itself ends with an error once the flag is set, if the system behind it carries the
//! flag; what an item came to meanwhile is then worth nothing, so a loop polls after each item too.

use std::sync::atomic::{AtomicUsize, Ordering};

pub use nanotap_arithmetic::CancelFlag;

/// What a caller hands to long work. The default neither cancels nor reports.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Work stops soon after this is set; what is done is returned.
    pub cancel: Option<&'a CancelFlag>,
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
        self.cancel.is_some_and(CancelFlag::is_cancelled)
    }

    /// The flag that cancels the work, for the systems that it runs.
    pub fn flag(&self) -> CancelFlag {
        self.cancel.cloned().unwrap_or_default()
    }

    pub(crate) fn report(&self, done: &AtomicUsize, total: usize) {
        let count = done.fetch_add(1, Ordering::Relaxed) + 1;
        if let Some(progress) = self.progress {
            progress(count, total);
        }
    }
}
