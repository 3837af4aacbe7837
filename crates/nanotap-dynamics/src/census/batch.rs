//! A batch of starts, which threads take one by one.
//!
//! Each thread follows some of them side by side, fewer towards the end, so that none is left with many.
//! A run that does not close is measured by any thread that is free. The outcome of a start does not
//! depend on the thread that follows it, nor on the others of its group.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Sender, channel};

use rayon::Scope;

use crate::classify::{
    ClassifyOptions, Followed, KnownMotions, RunEnd, follow_start, follow_starts,
};
use crate::control::Control;
use crate::map::StroboscopicMap;

/// Starts that are worth following side by side.
const MIN_BATCH: usize = 8;
/// Parts of a thread's share of what is left of which it follows one at a time: with fewer, others
/// have nothing left to do while it follows its last.
const PARTS_PER_THREAD: usize = 2;

/// Starts to be followed, and with what in mind.
pub(super) struct Batch<'a, M> {
    pub(super) map: &'a M,
    pub(super) starts: &'a [Vec<f64>],
    pub(super) known: KnownMotions<'a>,
    pub(super) options: &'a ClassifyOptions,
    pub(super) control: &'a Control<'a>,
    pub(super) progress: Progress<'a>,
}

/// Starts that the whole census has followed, and what they tell of those that it will follow.
#[derive(Clone, Copy)]
pub(super) struct Progress<'a> {
    /// Number of starts that are done.
    pub(super) done: &'a AtomicUsize,
    /// Cost of the work so far, in steps.
    pub(super) cost: &'a AtomicU64,
    /// Number of starts that are followed if the cost does not end the census before.
    pub(super) most: usize,
    /// Cost at which the census ends; `None` if it follows all its starts.
    pub(super) budget: Option<u64>,
}

impl Progress<'_> {
    /// Counts a start that took this cost; returns the number of starts that are done, and how many
    /// are expected at the present cost of a start.
    fn count(&self, cost: u64) -> (usize, usize) {
        let spent = self.cost.fetch_add(cost, Ordering::Relaxed) + cost;
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        let affordable = self.budget.filter(|_| spent > 0).map(|budget| {
            let starts = done as f64 * budget as f64 / spent as f64;
            (starts.ceil() as usize).max(done)
        });
        (
            done,
            affordable.map_or(self.most, |starts| starts.min(self.most)),
        )
    }
}

impl<M: StroboscopicMap> Batch<'_, M> {
    /// Where each start goes, with what that cost; `None` for those that were under way when the work
    /// was stopped.
    pub(super) fn followed(&self) -> Vec<Option<(RunEnd, u64)>> {
        let (sender, ended) = channel();
        let taken = AtomicUsize::new(0);
        rayon::scope(|scope| {
            for _ in 0..rayon::current_num_threads() {
                let turn = Turn {
                    batch: self,
                    taken: &taken,
                    sender: sender.clone(),
                };
                scope.spawn(move |scope| turn.follow(scope));
            }
        });
        let mut ends: Vec<Option<(RunEnd, u64)>> = self.starts.iter().map(|_| None).collect();
        for (place, end, cost) in ended.try_iter() {
            ends[place] = Some((end, cost));
        }
        ends
    }
}

/// What one thread does of a batch.
#[derive(Clone)]
struct Turn<'s, 'a, M> {
    batch: &'s Batch<'a, M>,
    /// Starts that some thread has taken.
    taken: &'s AtomicUsize,
    sender: Sender<(usize, RunEnd, u64)>,
}

impl<'s, 'a: 's, M: StroboscopicMap> Turn<'s, 'a, M> {
    /// Follows starts until all are taken.
    fn follow(self, scope: &Scope<'s>) {
        let Batch {
            map,
            starts,
            known,
            options,
            control,
            ..
        } = *self.batch;
        let mut map = map.clone();
        let cancelled = || control.is_cancelled();
        // Of few starts most places side by side would be empty.
        if map.batch_size() > 1 && starts.len() >= MIN_BATCH {
            let most = map.batch_size().max(MIN_BATCH);
            let parts = PARTS_PER_THREAD * rayon::current_num_threads();
            let places = || (self.left() / parts).clamp(MIN_BATCH, most);
            let followed = |place, followed| match followed {
                // Maps that take several motions at a time are in closed form and cost nothing.
                Followed::Ended(end) => self.send(place, end, 0),
                Followed::Unmeasured(run) => {
                    let other = self.clone();
                    scope.spawn(move |_| {
                        if !cancelled() {
                            let end = run.measured(&mut other.batch.map.clone());
                            other.send(place, end, 0);
                        }
                    });
                }
            };
            follow_starts(
                &mut map,
                places,
                || self.next(),
                known,
                options,
                cancelled,
                followed,
            );
        } else {
            while let (false, Some((place, start))) = (cancelled(), self.next()) {
                let before = map.cost();
                let end = follow_start(&mut map, start, known, options);
                self.send(place, end, map.cost() - before);
            }
        }
    }

    fn next(&self) -> Option<(usize, &'s [f64])> {
        let place = self.taken.fetch_add(1, Ordering::Relaxed);
        Some((place, self.batch.starts.get(place)?))
    }

    fn left(&self) -> usize {
        let taken = self.taken.load(Ordering::Relaxed);
        self.batch.starts.len().saturating_sub(taken)
    }

    fn send(&self, place: usize, end: RunEnd, cost: u64) {
        // The map may have ended a run that was under way.
        if self.batch.control.is_cancelled() {
            return;
        }
        let (done, all) = self.batch.progress.count(cost);
        self.batch.control.report_count(done, all);
        // The receiver outlives every sender.
        let _ = self.sender.send((place, end, cost));
    }
}
