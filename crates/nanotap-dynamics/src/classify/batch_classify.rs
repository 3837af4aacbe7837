//! Many starts followed in one batch until their motions are known.
//!
//! Each run gives the same result as [`follow_start`](super::follow_start) from its start, but for
//! rounding: the map advances all of them by some periods together, and each run then processes the
//! states that it passed, one by one. If it ends before the last of them, the others are ignored.
//! The outcome of a start does not depend on the others.

use crate::classify::run::{AfterLook, ChaosMatch, MAX_DIVERGENCE_PERIODS, Run, Stop, refused};
use crate::classify::{ClassifyOptions, KnownMotions, RunEnd};
use crate::failure::{MapFailure, finite};
use crate::map::StroboscopicMap;

/// Number of periods that are advanced before a run processes its states.
const PERIODS_AT_ONCE: usize = 32;

/// A start that is being followed.
struct Member<'a> {
    number: usize,
    run: Run<'a>,
    /// The neighbour that shows whether the run is on the chaos that it matches.
    companion: Option<Neighbour>,
}

/// A neighbour of a run, which diverges from it if the run is chaotic.
struct Neighbour {
    chaos: ChaosMatch,
    state: Vec<f64>,
    /// Periods run since the neighbour was placed.
    periods: usize,
}

/// The states at the ends of the periods that were advanced, and the failure that ended them.
#[derive(Default)]
struct Passed {
    states: Vec<f64>,
    failure: Option<MapFailure>,
}

/// Result of following a start.
pub(crate) enum Followed<'a> {
    Ended(RunEnd),
    /// Its exponents must still be measured; only runs in progress remain to be followed in the
    /// batch.
    Unmeasured(Unmeasured<'a>),
}

/// A run that does not close and whose exponents must be measured.
pub(crate) struct Unmeasured<'a>(Box<Run<'a>>);

impl Unmeasured<'_> {
    pub(crate) fn measured<M: StroboscopicMap>(mut self, map: &mut M) -> RunEnd {
        let how = self.0.measure(map);
        self.0.ended(how)
    }
}

/// Follows starts, each with its number, as many at a time as `places` returns. A start that is
/// done is passed to `followed` and replaced by the `next`, until there are no more or the work is
/// `cancelled`.
pub(crate) fn follow_starts<'a, M: StroboscopicMap>(
    map: &mut M,
    places: impl Fn() -> usize,
    mut next: impl FnMut() -> Option<(usize, &'a [f64])>,
    known: KnownMotions<'a>,
    options: &'a ClassifyOptions,
    cancelled: impl Fn() -> bool,
    mut followed: impl FnMut(usize, Followed<'a>),
) {
    let d = map.dimension();
    let mut members: Vec<Member<'_>> = Vec::new();
    let mut are_more = true;
    loop {
        while are_more && members.len() < places() {
            let Some((number, start)) = next() else {
                are_more = false;
                break;
            };
            match refused(start, d) {
                Some(end) => followed(number, Followed::Ended(end)),
                None => members.push(Member {
                    number,
                    run: Run::new(start, known, options),
                    companion: None,
                }),
            }
        }
        if members.is_empty() {
            return;
        }
        let mut passed = pass(map, &members).into_iter();
        let mut left = Vec::with_capacity(members.len());
        for mut member in members {
            if cancelled() {
                return;
            }
            let own = passed.next().unwrap_or_default();
            let neighbour = member.companion.as_ref().and_then(|_| passed.next());
            let how = match member.go_on(map, own, &neighbour.unwrap_or_default()) {
                Ok(AfterLook::GoOn | AfterLook::MaybeChaos(_)) => {
                    left.push(member);
                    continue;
                }
                Ok(AfterLook::Measure) if are_more => member.run.measure(map),
                Ok(AfterLook::Measure) => {
                    let run = Unmeasured(Box::new(member.run));
                    followed(member.number, Followed::Unmeasured(run));
                    continue;
                }
                Ok(AfterLook::Known(kind)) => Ok(kind),
                Err(stop) => Err(stop),
            };
            followed(member.number, Followed::Ended(member.run.ended(how)));
        }
        members = left;
    }
}

/// Advances every run by some periods, and its neighbour, if it has one, by as many.
fn pass<M: StroboscopicMap>(map: &mut M, members: &[Member<'_>]) -> Vec<Passed> {
    let (mut states, mut periods) = (Vec::new(), Vec::new());
    for Member { run, companion, .. } in members {
        states.extend_from_slice(&run.state);
        if let Some(companion) = companion {
            states.extend_from_slice(&companion.state);
            periods.extend([PERIODS_AT_ONCE.min(MAX_DIVERGENCE_PERIODS - companion.periods); 2]);
        } else {
            periods.push(PERIODS_AT_ONCE.min(run.next_look() - run.periods));
        }
    }
    let mut passed = vec![Vec::new(); periods.len()];
    let results = map.advance_each_through(&mut states, &periods, &mut passed);
    let each = passed.into_iter().zip(results);
    each.map(|(states, result)| Passed {
        states,
        failure: result.err().map(MapFailure::refused),
    })
    .collect()
}

impl Member<'_> {
    /// Processes the states that were passed, and examines the run when it is time to.
    fn go_on<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        own: Passed,
        neighbour: &Passed,
    ) -> Result<AfterLook, Stop> {
        let mut after = match self.companion.take() {
            None => {
                for state in own.states.chunks_exact(map.dimension()) {
                    self.run.step_to(map, state)?;
                }
                own.failure.map_or(Ok(()), Err)?;
                AfterLook::GoOn
            }
            Some(companion) => match self.go_on_with(map, companion, own, neighbour)? {
                Some(after) => after,
                None => return Ok(AfterLook::GoOn),
            },
        };
        loop {
            after = match after {
                AfterLook::MaybeChaos(chaos) => {
                    self.companion = Some(Neighbour {
                        state: chaos.neighbour(&self.run.state),
                        chaos,
                        periods: 0,
                    });
                    return Ok(AfterLook::GoOn);
                }
                AfterLook::GoOn if self.run.periods >= self.run.next_look() => {
                    self.run.at_look(map)?
                }
                after => return Ok(after),
            }
        }
    }

    /// Does the same for a run with a neighbour; `None` as long as the two may still diverge.
    fn go_on_with<M: StroboscopicMap>(
        &mut self,
        map: &mut M,
        mut companion: Neighbour,
        own: Passed,
        neighbour: &Passed,
    ) -> Result<Option<AfterLook>, Stop> {
        let d = map.dimension();
        let mut neighbours = neighbour.states.chunks_exact(d);
        for state in own.states.chunks_exact(d) {
            self.run.step_to(map, state)?;
            let Some(neighbour) = neighbours.next().filter(|x| finite(x).is_ok()) else {
                return Ok(Some(self.run.go_on()));
            };
            if companion.chaos.has_diverged(state, neighbour) {
                let kind = self.run.chaotic(companion.chaos.spectrum);
                return Ok(Some(AfterLook::Known(kind)));
            }
            companion.periods += 1;
            companion.state.copy_from_slice(neighbour);
        }
        own.failure.map_or(Ok(()), Err)?;
        if companion.periods >= MAX_DIVERGENCE_PERIODS {
            return Ok(Some(self.run.go_on()));
        }
        self.companion = Some(companion);
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use nalgebra::DMatrix;

    use super::*;
    use crate::classify::run::tests::Logistic;
    use crate::classify::{Classified, MotionKind, classify, follow_start};
    use crate::lyapunov::LyapunovSpectrum;
    use crate::neighbourhood::Neighbourhood;

    const STARTS: [&[f64]; 8] = [
        &[0.3],
        &[0.123],
        &[],
        &[f64::NAN],
        &[0.77],
        &[0.0],
        &[1.5],
        &[0.5],
    ];

    fn written(end: &RunEnd) -> String {
        format!("{end:?}")
    }

    /// In sequence, `map` gives the same bits, however many are followed at a time.
    fn assert_same_as_alone<M: StroboscopicMap>(map: &M, known: KnownMotions<'_>) -> Vec<RunEnd> {
        let options = ClassifyOptions::default();
        let alone: Vec<RunEnd> = STARTS
            .iter()
            .map(|start| follow_start(&mut map.clone(), start, known, &options))
            .collect();
        for most in [1, 3, STARTS.len(), 100] {
            let mut next = STARTS.into_iter().enumerate();
            let mut ends = vec![None; STARTS.len()];
            follow_starts(
                &mut map.clone(),
                || most,
                || next.next(),
                known,
                &options,
                || false,
                |number, followed| {
                    let end = match followed {
                        Followed::Ended(end) => end,
                        Followed::Unmeasured(run) => run.measured(&mut map.clone()),
                    };
                    ends[number] = Some(written(&end));
                },
            );
            for (end, alone) in ends.into_iter().zip(&alone) {
                assert_eq!(end, Some(written(alone)));
            }
        }
        alone
    }

    fn chaos(r: f64) -> LyapunovSpectrum {
        match classify(&mut Logistic(r), &[0.3], &ClassifyOptions::default()).kind {
            MotionKind::Chaotic(chaos) => chaos.spectrum,
            other => panic!("{other:?}"),
        }
    }

    /// Of r x (1 − x): an orbit of period 2 at 3.2, one that is reached slowly at 3.449, an orbit of
    /// period 3 after a chaotic while at 3.8285, chaos at 3.9, and nothing that stays at 4.5.
    #[test]
    fn starts_side_by_side_come_to_what_each_comes_to_alone() {
        for r in [3.2, 3.449, 3.8285, 3.9, 4.5] {
            assert_same_as_alone(&Logistic(r), KnownMotions::default());
        }
    }

    /// Waiting as a census has it, and neighbourhoods on the way.
    #[test]
    fn neighbourhoods_are_entered_after_as_many_periods() {
        let mut map = Logistic(3.2);
        let found = classify(&mut map, &[0.3], &ClassifyOptions::default());
        let MotionKind::Periodic(orbit) = found.kind else {
            panic!("3.2 x (1 − x) has an orbit of period 2")
        };
        let region = Neighbourhood::around(&mut map, &orbit).unwrap().unwrap();
        let known = KnownMotions {
            trapping_regions: &[region],
            max_wait_periods: 100,
            ..KnownMotions::default()
        };
        let ends = assert_same_as_alone(&map, known);
        assert!(matches!(
            ends[0],
            RunEnd::Entered {
                index: 0,
                periods: 1..100
            }
        ));
    }

    /// A start that resembles chaos is on it if a neighbour parts. On an orbit of period 3 none does,
    /// though its means are given as those of chaos.
    #[test]
    fn known_chaos_is_recognised_next_to_a_neighbour() {
        let own = [chaos(3.9)];
        let known = KnownMotions {
            chaos: &own,
            max_wait_periods: 300,
            ..KnownMotions::default()
        };
        let ends = assert_same_as_alone(&Logistic(3.9), known);
        let RunEnd::Classified(end) = &ends[0] else {
            panic!("there is no neighbourhood")
        };
        let Classified {
            kind: MotionKind::Chaotic(found),
            periods,
            ..
        } = &**end
        else {
            panic!("{end:?}")
        };
        assert_eq!(found.spectrum, own[0]);
        assert!(
            (300..400).contains(periods),
            "no exponents were measured: {periods}"
        );
        let mut other = chaos(3.9);
        other.strobe.errors.fill(1.0);
        let others = [other];
        let known = KnownMotions {
            chaos: &others,
            ..known
        };
        assert_same_as_alone(&Logistic(3.8285), known);
    }

    /// A map that fails above 0.97.
    #[derive(Clone)]
    struct Fails(Logistic);

    impl crate::Scheduling for Fails {}

    impl StroboscopicMap for Fails {
        type Error = std::fmt::Error;

        fn dimension(&self) -> usize {
            1
        }

        fn period(&self) -> f64 {
            1.0
        }

        fn advance(&mut self, state: &mut [f64]) -> Result<(), Self::Error> {
            let mut next = [state[0]];
            self.0.advance(&mut next).unwrap();
            if next[0] > 0.97 {
                return Err(std::fmt::Error);
            }
            state.copy_from_slice(&next);
            Ok(())
        }

        fn advance_with_jacobian(
            &mut self,
            state: &mut [f64],
            jacobian: &mut DMatrix<f64>,
        ) -> Result<(), Self::Error> {
            self.0.advance_with_jacobian(state, jacobian).unwrap();
            Ok(())
        }
    }

    #[test]
    fn a_failure_comes_after_as_many_periods() {
        assert_same_as_alone(&Fails(Logistic(3.9)), KnownMotions::default());
        let own = [chaos(3.9)];
        let known = KnownMotions {
            chaos: &own,
            max_wait_periods: 300,
            ..KnownMotions::default()
        };
        assert_same_as_alone(&Fails(Logistic(3.9)), known);
    }

    /// What had ended by then is reported.
    #[test]
    fn work_that_is_stopped_tells_what_it_knows() {
        let options = ClassifyOptions::default();
        let asked = Cell::new(0);
        let cancelled = || {
            asked.set(asked.get() + 1);
            asked.get() > 20
        };
        let mut next = STARTS.into_iter().enumerate();
        let mut ended = Vec::new();
        follow_starts(
            &mut Logistic(3.9),
            || STARTS.len(),
            || next.next(),
            KnownMotions::default(),
            &options,
            cancelled,
            |number, _| ended.push(number),
        );
        assert!(
            ended.contains(&2) && ended.contains(&6),
            "no states, and what runs off"
        );
        assert!(!ended.contains(&0));
    }
}
