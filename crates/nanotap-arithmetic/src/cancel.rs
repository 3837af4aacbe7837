//! A flag that cancels long computations, from outside or at a budget of steps.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use crate::clock::Instant;

/// Time that a computation with a [grace period](CancelFlag::with_grace) may continue.
const GRACE: Duration = Duration::from_millis(300);

/// A flag that cancels a computation, from outside or when a budget is spent. Clones share both. The
/// default can never be set.
///
/// Systems carry the flag and poll it on every segment of a motion, so that a loop over motions
/// ends early, with errors, even if it does not poll the flag itself. The flag is not part of a
/// system's identity: two flags always compare equal.
#[derive(Clone, Debug, Default)]
pub struct CancelFlag {
    flag: Option<Arc<AtomicBool>>,
    /// Time of the first poll after the flag was set, if there is a grace period.
    grace: Option<Arc<OnceLock<Instant>>>,
    budget: Option<Arc<Budget>>,
}

/// Steps that work may take. Whether the work in a parallel section exceeds them does not depend on
/// the order of its threads; which of its items fails does.
#[derive(Debug)]
struct Budget {
    limit: u64,
    spent: AtomicU64,
}

impl CancelFlag {
    /// Creates a flag that is not set.
    pub fn new() -> Self {
        Self {
            flag: Some(Arc::default()),
            grace: None,
            budget: None,
        }
    }

    /// The same flag, which appears set only 0.3 s after the first poll that found it set: for code
    /// that turns finished results into a report.
    #[must_use]
    pub fn with_grace(&self) -> Self {
        Self {
            flag: self.flag.clone(),
            grace: Some(Arc::default()),
            budget: self.budget.clone(),
        }
    }

    /// The same flag, seen as set also once so many steps are spent, counted from now. A smaller budget
    /// that the flag has is the limit of the new one too.
    #[must_use]
    pub fn with_budget(&self, steps: u64) -> Self {
        Self {
            budget: Some(Arc::new(Budget {
                limit: self.budget().map_or(steps, |limit| limit.min(steps)),
                spent: AtomicU64::new(0),
            })),
            ..self.clone()
        }
    }

    /// Counts steps of time integration towards the budget, if there is one.
    #[inline]
    pub fn spend(&self, steps: u64) {
        if let Some(budget) = &self.budget {
            budget.spent.fetch_add(steps, Ordering::Relaxed);
        }
    }

    /// Steps of the budget, if there is one.
    pub fn budget(&self) -> Option<u64> {
        self.budget.as_ref().map(|budget| budget.limit)
    }

    /// Steps spent of the budget; 0 without one.
    pub fn spent(&self) -> u64 {
        let budget = self.budget.as_ref();
        budget.map_or(0, |budget| budget.spent.load(Ordering::Relaxed))
    }

    /// Whether the budget is spent.
    #[inline]
    pub fn is_spent(&self) -> bool {
        let budget = self.budget.as_ref();
        budget.is_some_and(|budget| budget.spent.load(Ordering::Relaxed) > budget.limit)
    }

    /// Whether there is a budget. Work that is shared out without waiting for it would then be counted
    /// in an order that depends on threads.
    pub fn has_budget(&self) -> bool {
        self.budget.is_some()
    }

    /// Sets the flag: computations that poll it end soon.
    pub fn cancel(&self) {
        if let Some(flag) = &self.flag {
            flag.store(true, Ordering::SeqCst);
        }
    }

    /// True if the flag is set or the budget is spent.
    #[inline]
    pub fn is_cancelled(&self) -> bool {
        match &self.flag {
            Some(flag) if flag.load(Ordering::Relaxed) => self.is_late(),
            _ => self.is_spent(),
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
    fn a_budget_ends_work_and_clones_share_it() {
        let flag = CancelFlag::new();
        let limited = flag.with_budget(10);
        limited.clone().spend(10);
        assert!(!limited.is_cancelled());
        limited.spend(1);
        assert!(limited.is_cancelled() && limited.is_spent() && limited.spent() == 11);
        assert!(!flag.is_cancelled() && !limited.with_budget(20).is_cancelled());
        let limits = [5, 20].map(|steps| limited.with_budget(steps).budget());
        assert_eq!((limits, flag.budget()), ([Some(5), Some(10)], None));
    }

    #[test]
    fn the_default_cannot_be_set() {
        let flag = CancelFlag::default();
        flag.cancel();
        assert!(!flag.is_cancelled());
    }
}
