//! A flag that cancels long computations.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Time that a computation with a [grace period](CancelFlag::with_grace) may continue.
const GRACE: Duration = Duration::from_millis(300);

/// A flag that cancels a computation. Clones share the flag. The default can never be set.
///
/// Systems carry the flag and poll it on every segment of a motion, so that a loop over motions
/// ends early, with errors, even if it does not poll the flag itself. The flag is not part of a
/// system's identity: two flags always compare equal.
#[derive(Clone, Debug, Default)]
pub struct CancelFlag {
    flag: Option<Arc<AtomicBool>>,
    /// Time of the first poll after the flag was set, if there is a grace period.
    grace: Option<Arc<OnceLock<Instant>>>,
}

impl CancelFlag {
    /// Creates a flag that is not set.
    pub fn new() -> Self {
        Self {
            flag: Some(Arc::default()),
            grace: None,
        }
    }

    /// The same flag, which appears set only 0.3 s after the first poll that found it set: for code
    /// that turns finished results into a report.
    #[must_use]
    pub fn with_grace(&self) -> Self {
        Self {
            flag: self.flag.clone(),
            grace: Some(Arc::default()),
        }
    }

    /// Sets the flag: computations that poll it end soon.
    pub fn cancel(&self) {
        if let Some(flag) = &self.flag {
            flag.store(true, Ordering::SeqCst);
        }
    }

    /// True if the flag is set.
    #[inline]
    pub fn is_cancelled(&self) -> bool {
        match &self.flag {
            Some(flag) if flag.load(Ordering::Relaxed) => self.is_late(),
            _ => false,
        }
    }

    /// True if there is no grace period or it is over.
    #[cold]
    fn is_late(&self) -> bool {
        self.grace
            .as_ref()
            .is_none_or(|since| since.get_or_init(Instant::now).elapsed() > GRACE)
    }
}

impl PartialEq for CancelFlag {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clones_share_the_flag_and_a_grace_period_ends() {
        let flag = CancelFlag::new();
        let (clone, graced) = (flag.clone(), flag.with_grace());
        assert!(!clone.is_cancelled() && !graced.is_cancelled());
        flag.cancel();
        assert!(clone.is_cancelled() && !graced.is_cancelled());
        std::thread::sleep(GRACE + Duration::from_millis(5));
        assert!(graced.is_cancelled());
    }

    #[test]
    fn the_default_cannot_be_set() {
        let flag = CancelFlag::default();
        flag.cancel();
        assert!(!flag.is_cancelled());
    }
}
