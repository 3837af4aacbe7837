//! How long a study takes, from a short trial.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use nanotap::control::{CancelFlag, Control};
use nanotap_arithmetic::clock::Instant;
use serde_json::{Map, Value, json};

use super::Studied;
use crate::commands::study_command;

/// Longest trial.
const LONGEST: Duration = Duration::from_millis(1200);
/// Time between looks at the clock.
const BETWEEN: Duration = Duration::from_millis(20);

/// What a trial records.
#[derive(Default)]
pub(super) struct Trial {
    stages: Mutex<Vec<Tried>>,
    /// The studies that were begun, and the last command of each.
    commands: Mutex<Vec<(String, String)>>,
}

/// A stage of a trial, which may be interrupted.
struct Tried {
    /// Number of values of the stage.
    count: usize,
    begun: Instant,
    /// Time until the present part of the stage began: work is counted part by part.
    before: Duration,
    /// Finished items of this part and their total, as reported last, and when.
    done: usize,
    total: usize,
    took: Duration,
    is_complete: bool,
}

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Trial {
    /// A stage of so many values begins.
    pub(super) fn stage(&self, count: usize) {
        locked(&self.stages).push(Tried {
            count,
            begun: Instant::now(),
            before: Duration::ZERO,
            done: 0,
            total: 0,
            took: Duration::ZERO,
            is_complete: false,
        });
    }

    /// The last stage ended, by itself or by interruption.
    pub(super) fn ended(&self, is_complete: bool) {
        if let Some(tried) = locked(&self.stages).last_mut() {
            tried.is_complete = is_complete;
            // After a part that is complete another one follows, which takes at least the rest of the trial.
            if is_complete || tried.done == 0 || tried.done == tried.total {
                tried.took = tried.begun.elapsed();
            }
        }
    }

    fn progress(&self, done: usize, total: usize) {
        if let Some(tried) = locked(&self.stages).last_mut() {
            if total != tried.total {
                (tried.done, tried.total) = (0, total);
                tried.before = tried.begun.elapsed();
            }
            // Counts of several threads come in any order.
            if done > tried.done {
                tried.done = done;
                tried.took = tried.begun.elapsed();
            }
        }
    }

    /// Seconds of the last stage, which is the finest one.
    fn seconds(&self) -> Option<f64> {
        let stages = locked(&self.stages);
        let (first, last) = stages.first().zip(stages.last())?;
        let ratio = |of: usize, to: usize| of as f64 / to.max(1) as f64;
        let whole = |tried: &Tried| {
            if tried.is_complete {
                return tried.took.as_secs_f64();
            }
            let part = tried.took.saturating_sub(tried.before).as_secs_f64();
            tried.before.as_secs_f64() + part * ratio(tried.total, tried.done)
        };
        if last.is_complete || last.done > 0 || stages.len() == 1 {
            return (last.is_complete || last.total > 0).then(|| whole(last));
        }
        // No item of the finest stage was finished: it takes as many times as long as it is larger.
        let larger = ratio(last.count, first.count).max(ratio(last.total, first.total));
        Some(whole(first) * larger)
    }
}

impl Studied<'_> {
    /// Records that a study begins, in a trial.
    pub(super) fn begins(&self, name: &str, options: &Map<String, Value>) {
        if let Some(trial) = self.trial {
            let command = study_command(self.app, &self.request.case, name, options);
            let command = command.unwrap_or_default();
            let mut commands = locked(&trial.commands);
            commands.retain(|(other, _)| other != name);
            commands.push((name.to_owned(), command));
            if locked(&trial.stages).is_empty() {
                trial.stage(1);
            }
        }
    }

    /// Tries the study for a moment, and says how many seconds it takes (null if unknown) and the command for
    /// the terminal.
    pub(super) fn estimated(&self) {
        let trial = Trial::default();
        let stop = CancelFlag::new();
        let begun = Instant::now();
        let is_over = || begun.elapsed() > LONGEST || self.control.is_cancelled();
        let progress = |done: usize, total: usize| {
            // What an interrupted computation leaves out is not done.
            trial.progress(if stop.is_cancelled() { 0 } else { done }, total);
            if is_over() {
                stop.cancel();
            }
        };
        let control = Control {
            cancel: Some(&stop),
            progress: Some(&progress),
        };
        let tried = Studied {
            control: &control,
            trial: Some(&trial),
            ..*self
        };
        let ended = AtomicBool::new(false);
        thread::scope(|scope| {
            let watch = || {
                while !ended.load(Ordering::Relaxed) && !is_over() {
                    thread::sleep(BETWEEN);
                }
                stop.cancel();
            };
            // In a browser there are no threads: the progress ends the trial.
            let _ = thread::Builder::new().spawn_scoped(scope, watch);
            let result = tried.run();
            if locked(&trial.stages).len() == 1 {
                trial.ended(result.is_ok() && !stop.is_cancelled());
            }
            ended.store(true, Ordering::Relaxed);
        });
        let commands = locked(&trial.commands);
        let commands: Vec<&str> = commands
            .iter()
            .map(|(_, command)| command.as_str())
            .collect();
        (self.hand_over)(json!({ "estimate": trial.seconds(), "command": commands.join("\n") }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tried(count: usize, [done, total]: [usize; 2], took: u64, is_complete: bool) -> Tried {
        Tried {
            count,
            begun: Instant::now(),
            before: Duration::ZERO,
            done,
            total,
            took: Duration::from_secs(took),
            is_complete,
        }
    }

    fn seconds(stages: Vec<Tried>) -> Option<f64> {
        let trial = Trial::default();
        *locked(&trial.stages) = stages;
        trial.seconds()
    }

    #[test]
    fn the_finest_stage_counts_or_is_scaled_from_the_first() {
        assert_eq!(seconds(vec![]), None);
        // Nothing is known of the size of a study without stages and without progress.
        assert_eq!(seconds(vec![tried(1, [0, 0], 1, false)]), None);
        assert_eq!(seconds(vec![tried(1, [2, 80], 1, false)]), Some(40.0));
        let first = || tried(8, [64, 64], 1, true);
        assert_eq!(
            seconds(vec![first(), tried(48, [9, 2304], 3, false)]),
            Some(768.0)
        );
        assert_eq!(
            seconds(vec![first(), tried(48, [0, 2304], 0, false)]),
            Some(36.0)
        );
        // Two lines of values are two items, however many values they have.
        assert_eq!(
            seconds(vec![
                tried(30, [2, 2], 1, true),
                tried(120, [0, 2], 0, false)
            ]),
            Some(4.0)
        );
        assert_eq!(
            seconds(vec![first(), tried(48, [9, 9], 3, true)]),
            Some(3.0)
        );
    }
}
