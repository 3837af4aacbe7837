//! The steps of a walk while threads name their motions.
//!
//! A step is begun from what the one before it seems to hand on. Where that turns out to be
//! something else, all steps after it are begun anew, and what threads still do for them is in vain.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::case::CaseError;

/// A step as it was begun.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    index: usize,
    /// How often it had been given up before.
    revision: usize,
}

impl Step {
    /// Its place in the order of the way.
    pub(super) const fn index(self) -> usize {
        self.index
    }
}

/// What is known of all steps: of each a `T`, and what it hands on, a `P`, where that is not what
/// it seemed to.
pub(super) struct Steps<'a, T, P> {
    known: Mutex<Known<T, P>>,
    /// Who is told of each step, in their order, as soon as what is known of it stands.
    told: &'a (dyn Fn(&T) + Sync),
}

struct Known<T, P> {
    /// How often each step was given up.
    revisions: Vec<usize>,
    found: Vec<Option<Result<T, CaseError>>>,
    told: usize,
    /// The first step that hands on something else than those after it were begun from, and what.
    corrected: Option<(usize, P)>,
}

impl<T, P> Known<T, P> {
    fn is_vain(&self, step: Step) -> bool {
        let Self { corrected, .. } = self;
        let corrected = corrected.as_ref().map(|(corrected, _)| *corrected);
        self.revisions[step.index] != step.revision || corrected.is_some_and(|k| k < step.index)
    }
}

impl<'a, T, P> Steps<'a, T, P> {
    /// So many steps of which nothing is known.
    pub(super) fn new(count: usize, told: &'a (dyn Fn(&T) + Sync)) -> Self {
        let known = Known {
            revisions: vec![0; count],
            found: (0..count).map(|_| None).collect(),
            told: 0,
            corrected: None,
        };
        Self {
            known: Mutex::new(known),
            told,
        }
    }

    fn known(&self) -> MutexGuard<'_, Known<T, P>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The step at a place, as it is begun now.
    pub(super) fn begin(&self, index: usize) -> Step {
        let revision = self.known().revisions[index];
        Step { index, revision }
    }

    /// Whether the step is to be begun anew.
    pub(super) fn is_vain(&self, step: Step) -> bool {
        self.known().is_vain(step)
    }

    /// A step hands on something else than those after it were begun from.
    pub(super) fn correct(&self, step: Step, passed: P) {
        let mut known = self.known();
        if known.is_vain(step) {
            return;
        }
        known.found[step.index + 1..].fill_with(|| None);
        known.corrected = Some((step.index, passed));
    }

    /// The first step that was corrected since last asked, and what it hands on: those after it can
    /// be begun anew.
    pub(super) fn take_correction(&self) -> Option<(usize, P)> {
        let mut known = self.known();
        let (step, passed) = known.corrected.take()?;
        for revision in &mut known.revisions[step + 1..] {
            *revision += 1;
        }
        Some((step, passed))
    }

    /// Whether a step was corrected since last asked.
    pub(super) fn is_any_corrected(&self) -> bool {
        self.known().corrected.is_some()
    }

    /// What was found out of a step.
    pub(super) fn write(&self, step: Step, found: Result<T, CaseError>) {
        let mut known = self.known();
        if known.is_vain(step) {
            return;
        }
        known.found[step.index] = Some(found);
        while let Some(Some(Ok(found))) = known.found.get(known.told) {
            (self.told)(found);
            known.told += 1;
        }
    }

    /// What is known of the steps, up to the first of which nothing is.
    pub(super) fn into_found(self) -> Result<Vec<T>, CaseError> {
        let known = self.known.into_inner();
        let found = known.unwrap_or_else(PoisonError::into_inner).found;
        found.into_iter().map_while(|found| found).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Does something with five steps and says who was told of which, and what is known in the end.
    fn after(work: impl FnOnce(&Steps<'_, usize, char>)) -> (Vec<usize>, Vec<usize>) {
        let told = Mutex::new(Vec::new());
        let tell = |found: &usize| told.lock().unwrap().push(*found);
        let steps = Steps::new(5, &tell);
        work(&steps);
        let found = steps.into_found().unwrap();
        (told.into_inner().unwrap(), found)
    }

    fn all(steps: &Steps<'_, usize, char>) -> [Step; 5] {
        [0, 1, 2, 3, 4].map(|k| steps.begin(k))
    }

    #[test]
    fn steps_are_told_in_their_order() {
        let (told, found) = after(|steps| {
            let [a, b, c, ..] = all(steps);
            for step in [b, a, c] {
                steps.write(step, Ok(step.index()));
            }
        });
        assert_eq!((told, found), (vec![0, 1, 2], vec![0, 1, 2]));
    }

    #[test]
    fn what_follows_a_corrected_step_is_in_vain() {
        let (told, found) = after(|steps| {
            let [a, b, c, d, _] = all(steps);
            steps.write(c, Ok(2));
            steps.correct(b, 'b');
            assert!(steps.is_vain(c) && steps.is_vain(d) && !steps.is_vain(b) && !steps.is_vain(a));
            // Neither found nor corrected, nor begun anew, before the walk has turned back.
            steps.write(d, Ok(3));
            steps.correct(c, 'c');
            assert!(steps.is_vain(steps.begin(2)));
            assert!(steps.is_any_corrected());
            assert_eq!(steps.take_correction(), Some((1, 'b')));
            assert!(!steps.is_any_corrected() && steps.take_correction().is_none());
            steps.write(c, Ok(2));
            steps.correct(d, 'd');
            for step in [a, b, steps.begin(2)] {
                steps.write(step, Ok(10 + step.index()));
            }
            assert!(steps.take_correction().is_none());
        });
        assert_eq!((told, found), (vec![10, 11, 12], vec![10, 11, 12]));
    }

    #[test]
    fn the_first_corrected_step_counts() {
        let (told, found) = after(|steps| {
            let [a, b, c, ..] = all(steps);
            steps.correct(c, 'c');
            steps.correct(a, 'a');
            steps.correct(b, 'b');
            assert_eq!(steps.take_correction(), Some((0, 'a')));
            // It may still turn out to be another.
            steps.correct(a, 'A');
            assert_eq!(steps.take_correction(), Some((0, 'A')));
            let [_, b, ..] = all(steps);
            steps.write(b, Ok(1));
        });
        assert_eq!((told, found), (vec![], vec![]));
    }
}
