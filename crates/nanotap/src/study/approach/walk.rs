//! One motion followed through all distances, there and back.
//!
//! At each distance the motion goes on from where the one before it ended. To see a run go to an
//! orbit, or to measure what does not close, takes most of the time. So a distance is left as soon
//! as Newton has closed an orbit there or the transient is over, and other threads name and measure
//! the motion. Where it turns out to be another than it seemed, what was made of the distances
//! after it is thrown away; so the table is the same on any number of threads. The next distances
//! are then left only when it is seen whether the run goes to the orbit.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use nanotap_dynamics::{ClassifyOptions, Control, Outlook, PeriodicOrbit, outlook};

use crate::case::{Case, CaseError};
use crate::model::Model;
use crate::model::strobe::Strobe;
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
}

/// A distance whose motion is known.
struct Known {
    point: ApproachPoint,
    passed: Passed,
}

impl<'a> Walk<'a> {
    /// The motions at all distances in the order of the way: there, then back.
    pub(super) fn there_and_back(
        &'a self,
        control: &Control<'_>,
    ) -> Result<Vec<ApproachPoint>, CaseError> {
        let mut table: Vec<ApproachPoint> = Vec::with_capacity(self.steps());
        let mut passed: Vec<Passed> = Vec::with_capacity(self.steps());
        while table.len() < self.steps() && !control.is_cancelled() {
            let known = self.go_on(&mut passed, control)?;
            passed.truncate(table.len());
            for step in known {
                passed.push(step.passed);
                table.push(step.point);
            }
        }
        Ok(table)
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

    /// The steps that follow those `passed`, up to the first whose motion is not what it seemed.
    /// What these hand on is added to `passed`, and may be wrong after that one.
    fn go_on(
        &'a self,
        passed: &mut Vec<Passed>,
        control: &Control<'_>,
    ) -> Result<Vec<Known>, CaseError> {
        let first = passed.len();
        let known: Vec<OnceLock<_>> = (first..self.steps()).map(|_| OnceLock::new()).collect();
        let end = AtomicUsize::new(self.steps());
        let unnamed = AtomicUsize::new(0);
        let told = Mutex::new(0);
        let tell = || {
            let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
            while first + *told < end.load(Ordering::Relaxed)
                && let Some(Ok(Known { point, .. })) = known[*told].get()
            {
                (self.told)(point);
                *told += 1;
            }
        };
        // Where one motion was not what it seemed the next may not be either.
        let mut doubt = first > 0;
        let needless = |step: usize| control.is_cancelled() || step >= end.load(Ordering::Relaxed);
        rayon::scope_fifo(|scope| {
            while !needless(passed.len()) {
                let step = passed.len();
                let (ahead, seems) = self.look_ahead(passed, doubt)?;
                doubt &= seems.orbit.is_none();
                passed.push(seems.clone());
                unnamed.fetch_add(1, Ordering::Relaxed);
                let (known, end, unnamed, tell) = (&known, &end, &unnamed, &tell);
                scope.spawn_fifo(move |_| {
                    unnamed.fetch_sub(1, Ordering::Relaxed);
                    if needless(step) {
                        return;
                    }
                    let named = self.name(step, ahead);
                    if !named
                        .as_ref()
                        .is_ok_and(|known| known.passed.leads_on_as(&seems))
                    {
                        end.fetch_min(step + 1, Ordering::Relaxed);
                    }
                    known[step - first].get_or_init(|| named);
                    tell();
                    if let Some(report) = control.progress {
                        report(step + 1, self.steps());
                    }
                });
                let mut most = AHEAD * (rayon::current_num_threads() - 1);
                if !doubt {
                    most = most.min(step - first);
                }
                while unnamed.load(Ordering::Relaxed) > most {
                    rayon::yield_local();
                }
            }
            Ok::<_, CaseError>(())
        })?;
        let certain = end.into_inner() - first;
        let known = known.into_iter().take(certain).map(OnceLock::into_inner);
        known.map_while(|step| step).collect()
    }

    /// The next step, and what it seems to hand on: in `doubt`, once it is seen to go to an orbit or its
    /// transient is over. Where the way back is on the orbit that the way
    /// there has passed, it goes on as that did, and is likely to stay with it: such a step need
    /// not be made to be left.
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
            reached.outlook = reached.outlook.settled(&mut Strobe::new(&reached.model));
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

    /// What the motion at a distance is and looks like.
    fn name(&'a self, step: usize, ahead: Ahead<'a>) -> Result<Known, CaseError> {
        let Reached { model, outlook } = match ahead {
            Ahead::Start(start) => self.reach(step, start.as_ref())?,
            Ahead::Reached(reached) => *reached,
        };
        let map = &mut Strobe::new(&model);
        let outlook = outlook.settled(map);
        // A motion that does not close is followed from where its transient ended, before it was
        // measured.
        let settled = outlook.orbit().is_none().then(|| outlook.state().to_vec());
        let classified = outlook.verified(map);
        let named = Named::of(&classified.kind);
        let settled = settled.filter(|_| named.orbit.is_none());
        let state = settled.as_ref().unwrap_or(&classified.state);
        let unbounded = named.classification == Classification::Unbounded;
        let passed = Passed::new(named.orbit.as_ref(), state, unbounded);
        let met = Met {
            classification: named.classification,
            evidence: named.evidence,
            orbit: named.orbit,
            state: classified.state,
        };
        let (way, gap) = self.place(step);
        Ok(Known {
            point: (self.observed)(way, gap, &model, met),
            passed,
        })
    }
}
