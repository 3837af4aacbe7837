//! Cancellation and progress reports of long computations.
//!
//! A loop polls [`Control::is_cancelled`] between its items and keeps the finished ones. If the
//! system carries the flag, the map fails as soon as the flag is set; the item being computed is
//! then invalid, so a loop polls after each item too.

use std::sync::atomic::{AtomicUsize, Ordering};

pub use nanotap_arithmetic::CancelFlag;

/// Cancellation flag and progress callback of a long computation. The default has neither.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// The computation stops soon after this flag is set and returns what is finished.
    pub cancel: Option<&'a CancelFlag>,
    /// Called with the number of finished items and their total, from any thread, in no particular
    /// order.
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
    /// True if the caller has cancelled the computation.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(CancelFlag::is_cancelled)
    }

    /// The cancellation flag, for the systems that are run.
    pub fn flag(&self) -> CancelFlag {
        self.cancel.cloned().unwrap_or_default()
    }

    pub(crate) fn report(&self, done: &AtomicUsize, total: usize) {
        self.report_count(done.fetch_add(1, Ordering::Relaxed) + 1, total);
    }

    /// Reports the number of finished items and their total.
    pub(crate) fn report_count(&self, done: usize, total: usize) {
        if let Some(progress) = self.progress {
            progress(done, total);
        }
    }
}
