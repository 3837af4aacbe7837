//! One motion followed through all distances, there and back.
//!
//! At each distance the motion goes on from where the one before it ended. To see a run go to an
//! orbit, or to measure what does not close, takes most of the time. So a distance is left as soon
//! as Newton has closed an orbit there or the transient is over, and other threads name and measure
//! the motion. Where it turns out to be another than it seemed, the walk turns back to it as soon as
//! that is seen, and what was made of the distances after it is thrown away; so the table is the
//! same on any number of threads. The next distance is then left only when it is seen whether the
//! run goes to the orbit.

use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::{ClassifyOptions, Control, Outlook, PeriodicOrbit, outlook};
use rayon::ScopeFifo;

use crate::case::{Case, CaseError};
use crate::model::Model;
use crate::model::strobe::Strobe;
use crate::study::approach::steps::{Step, Steps};
use crate::study::approach::{ApproachPoint, Met, Way};
use crate::study::simulate::{Classification, Named};

/// Periods after which it is looked for the first time where the motion goes: it starts on the
/// orbit of the distance before, near its own.
pub(super) const FIRST_LOOK: usize = 4;

/// Distances that are left, for every other thread, before those behind them have their motions
/// named.
const AHEAD: usize = 8;

/// How the motion is followed.
pub(super) struct Walk<'a> {
    pub(super) case: &'a Case,
    pub(super) classify: &'a ClassifyOptions,
    /// The distances, from far to near.
    pub(super) distances: &'a [f64],
    /// What a motion is at a distance, as a line of the table.
    pub(super) observed: &'a (dyn Fn(Way, f64, &Model, Met) -> ApproachPoint + Sync),
    /// Who is told of each line, in the order of the table, as soon as it stands.
    pub(super) told: &'a (dyn Fn(&ApproachPoint) + Sync),
}

/// What a distance hands on.
#[derive(Clone)]
struct Passed {
    orbit: Option<PeriodicOrbit>,
    /// Where the motion at the next distance starts; nowhere: from rest.
    onwards: Option<Vec<f64>>,
}

impl Passed {
    /// The next motion starts on this one's orbit, not where its decay was when Newton saw the end
    /// of it. A motion that ran off is not followed.
    fn new(orbit: Option<&PeriodicOrbit>, state: &[f64], unbounded: bool) -> Self {
        let onwards = match orbit {
            Some(orbit) => Some(orbit.nearest(state).0.to_vec()),
            None => (!unbounded).then(|| state.to_vec()),
        };
        Self {
            orbit: orbit.cloned(),
            onwards,
        }
    }

    /// Whether the next motion starts as it would after the other.
    fn leads_on_as(&self, other: &Self) -> bool {
        self.is_on_orbit_of(other) || self.onwards == other.onwards
    }

    fn is_on_orbit_of(&self, other: &Self) -> bool {
        let orbits = self.orbit.as_ref().zip(other.orbit.as_ref());
        orbits.is_some_and(|(a, b)| a.is_same_as(b))
    }
}

/// A step whose motion is not yet named.
enum Ahead<'a> {
    /// It is not made either: where it starts.
    Start(Option<Vec<f64>>),
    /// It is made as far as to see where the motion seems to go.
    Reached(Box<Reached<'a>>),
}

/// A distance that may be left.
struct Reached<'a> {
    model: Model,
    outlook: Outlook<'a>,
}

impl Reached<'_> {
    /// What it hands on if its motion is what it seems.
    fn seems(&self) -> Passed {
        let Self { outlook, .. } = self;
        Passed::new(outlook.orbit(), outlook.state(), outlook.is_unbounded())
    }

    /// It followed until its motion is seen to go to an orbit or its transient is over.
    fn settled(self) -> Self {
        let Self { model, outlook } = self;
        let outlook = outlook.settled(&mut Strobe::new(&model));
        Self { model, outlook }
    }
}

impl<'a> Walk<'a> {
    /// The motions at all distances in the order of the way: there, then back.
    pub(super) fn there_and_back(
        &'a self,
        control: &Control<'_>,
    ) -> Result<Vec<ApproachPoint>, CaseError> {
        let work = Work {
            walk: self,
            steps: Steps::new(self.steps(), self.told),
            waiting: AtomicUsize::new(0),
            control,
        };
        let mut passed = Vec::with_capacity(self.steps());
        let mut doubt = false;
        loop {
            work.go_on(&mut passed, &mut doubt)?;
            if control.is_cancelled() || !work.steps.is_any_corrected() {
                return work.steps.into_found();
            }
        }
    }

    fn steps(&self) -> usize {
        2 * self.distances.len()
    }

    /// The step of the other way at the same distance.
    fn opposite(&self, step: usize) -> usize {
        self.steps() - 1 - step
    }

    fn place(&self, step: usize) -> (Way, f64) {
        match self.distances.get(step) {
            Some(gap) => (Way::Approach, *gap),
            None => (Way::Retract, self.distances[self.opposite(step)]),
        }
    }

    /// The next step, and what it seems to hand on: in `doubt`, once it is seen to go to an orbit
    /// or its transient is over. Where the way back is on the orbit that the way there has passed,
    /// it goes on as that did, and is likely to stay with it: such a step need not be made to be
    /// left.
    fn look_ahead(
        &'a self,
        passed: &[Passed],
        doubt: bool,
    ) -> Result<(Ahead<'a>, Passed), CaseError> {
        let step = passed.len();
        let back = step > self.distances.len();
        let there = back.then(|| &passed[self.opposite(step - 1)]);
        let last = passed.last();
        let beside = there.filter(|there| last.is_some_and(|last| last.is_on_orbit_of(there)));
        let start = beside.or(last).and_then(|passed| passed.onwards.as_ref());
        if beside.is_some()
            && let there = &passed[self.opposite(step)]
            && there.orbit.is_some()
        {
            return Ok((Ahead::Start(start.cloned()), there.clone()));
        }
        let mut reached = self.reach(step, start)?;
        if doubt {
            reached = reached.settled();
        }
        let seems = reached.seems();
        Ok((Ahead::Reached(Box::new(reached)), seems))
    }

    /// Brings the sample to the distance of a step, where the motion sets out from `start`, or from
    /// rest.
    fn reach(&'a self, step: usize, start: Option<&Vec<f64>>) -> Result<Reached<'a>, CaseError> {
        let (_, gap) = self.place(step);
        let model = self.case.with(self.case.gap_key(), gap).model()?;
        let rest = || vec![0.0; model.dimension()];
        let start = start.cloned().unwrap_or_else(rest);
        let outlook = outlook(&mut Strobe::new(&model), &start, self.classify);
        Ok(Reached { model, outlook })
    }

    /// The motion of a step, seen to go to an orbit or its transient over.
    fn settled(&'a self, step: usize, ahead: Ahead<'a>) -> Result<Reached<'a>, CaseError> {
        let reached = match ahead {
            Ahead::Start(start) => self.reach(step, start.as_ref())?,
            Ahead::Reached(reached) => *reached,
        };
        Ok(reached.settled())
    }

    /// What the motion of a step is and looks like, and what it hands on.
    fn measured(&'a self, step: usize, settled: Reached<'a>) -> (ApproachPoint, Passed) {
        let passed = settled.seems();
        let Reached { model, outlook } = settled;
        let classified = outlook.verified(&mut Strobe::new(&model));
        let named = Named::of(&classified.kind);
        let unbounded = named.classification == Classification::Unbounded;
        let passed = match &named.orbit {
            // It is followed from where its transient ended, before it was measured.
            None if !unbounded => passed,
            orbit => Passed::new(orbit.as_ref(), &classified.state, unbounded),
        };
        let met = Met {
            classification: named.classification,
            evidence: named.evidence,
            orbit: named.orbit,
            state: classified.state,
        };
        let (way, gap) = self.place(step);
        ((self.observed)(way, gap, &model, met), passed)
    }
}

/// A walk that threads are at work on.
struct Work<'w, 'a> {
    walk: &'a Walk<'a>,
    steps: Steps<'a, ApproachPoint, Passed>,
    /// Tasks that no thread has begun.
    waiting: AtomicUsize,
    control: &'w Control<'w>,
}

impl<'a> Work<'_, 'a> {
    /// Makes the steps that follow those `passed`, and makes anew those after one that hands on
    /// something else than it seemed to. Where one motion was not what it seemed the next may not
    /// be either: from then on there is `doubt`, until one closes.
    fn go_on(&self, passed: &mut Vec<Passed>, doubt: &mut bool) -> Result<(), CaseError> {
        let most = AHEAD * (rayon::current_num_threads() - 1);
        rayon::scope_fifo(|scope| {
            loop {
                if let Some((step, corrected)) = self.steps.take_correction() {
                    passed.truncate(step);
                    passed.push(corrected);
                    *doubt = true;
                }
                if passed.len() == self.walk.steps() || self.control.is_cancelled() {
                    return Ok(());
                }
                let step = self.steps.begin(passed.len());
                let (ahead, seems) = self.walk.look_ahead(passed, *doubt)?;
                *doubt &= seems.orbit.is_none();
                passed.push(seems.clone());
                self.spawn(scope, step, move |scope| {
                    self.name(scope, step, ahead, &seems);
                });
                while self.waiting.load(Ordering::Relaxed) > most {
                    rayon::yield_local();
                }
            }
        })
    }

    /// Leaves a task on a step to the next free thread.
    fn spawn<'s>(
        &'s self,
        scope: &ScopeFifo<'s>,
        step: Step,
        task: impl FnOnce(&ScopeFifo<'s>) + Send + 's,
    ) {
        self.waiting.fetch_add(1, Ordering::Relaxed);
        scope.spawn_fifo(move |scope| {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            if !self.control.is_cancelled() && !self.steps.is_vain(step) {
                task(scope);
            }
        });
    }

    /// Sees whether a step hands on what it seems to, and measures its motion.
    fn name<'s>(&'s self, scope: &ScopeFifo<'s>, step: Step, ahead: Ahead<'a>, seems: &Passed) {
        let settled = match self.walk.settled(step.index(), ahead) {
            Ok(settled) => settled,
            Err(error) => return self.steps.write(step, Err(error)),
        };
        let passed = settled.seems();
        if passed.leads_on_as(seems) {
            return self.measure(step, settled, seems);
        }
        // To measure it takes longer. The walk, if it was this thread's, goes on meanwhile.
        self.steps.correct(step, passed.clone());
        self.spawn(scope, step, move |_| self.measure(step, settled, &passed));
    }

    /// Measures the motion of a step that seems to hand that on.
    fn measure(&self, step: Step, settled: Reached<'a>, seems: &Passed) {
        let (point, passed) = self.walk.measured(step.index(), settled);
        if !passed.leads_on_as(seems) {
            self.steps.correct(step, passed);
        }
        self.steps.write(step, Ok(point));
        if let Some(report) = self.control.progress {
            report(step.index() + 1, self.walk.steps());
        }
    }
}
