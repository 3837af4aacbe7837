//! Where a motion seems to go, before it is known that it does.
//!
//! Seeing a run approach an orbit, or measuring the exponents of one that does not close, takes
//! most of the time that naming a motion takes. Where the next motion only wants a start from this
//! one, it can set out from what Newton closed while another thread does the rest.

use crate::classify::run::{AfterLook, Closed, Guesses, Known, Run, Stop, refused};
use crate::classify::{Classified, ClassifyOptions, MotionKind, ended};
use crate::map::StroboscopicMap;
use crate::orbit::PeriodicOrbit;

/// A motion followed until it seems to be known.
pub struct Outlook<'a> {
    stage: Stage<'a>,
}

/// How far a motion was followed.
enum Stage<'a> {
    /// To an orbit that Newton closed, with the guesses that are left if it is not the end.
    Closed(Box<(Run<'a>, Closed, Guesses)>),
    /// Through its transient, without an orbit.
    Unclosed(Box<Run<'a>>),
    /// To its end.
    Known(Box<Classified>),
}

/// Follows the motion from `start` until Newton closes an orbit that it may go to, or its
/// transient is over. [`Outlook::verified`] names it, as [`classify`](super::classify()) would.
pub fn outlook<'a, M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    options: &'a ClassifyOptions,
) -> Outlook<'a> {
    let stage = match refused(start, map.dimension()) {
        Some(end) => Stage::Known(Box::new(ended(end, start))),
        None => followed(map, Run::new(start, Known::default(), options)),
    };
    Outlook { stage }
}

fn followed<'a, M: StroboscopicMap>(map: &mut M, mut run: Run<'a>) -> Stage<'a> {
    match run.run_to_look(map) {
        Ok(()) => {
            let guesses = run.guesses_at_look();
            looked(map, run, guesses)
        }
        Err(stop) => Stage::Known(Box::new(named(run, Err(stop)))),
    }
}

/// What the guesses of a look come to.
fn looked<'a, M: StroboscopicMap>(
    map: &mut M,
    mut run: Run<'a>,
    mut guesses: Guesses,
) -> Stage<'a> {
    if let Some(closed) = run.next_orbit(map, &mut guesses) {
        return Stage::Closed(Box::new((run, closed, guesses)));
    }
    match run.go_on() {
        AfterLook::Measure => Stage::Unclosed(Box::new(run)),
        _ => followed(map, run),
    }
}

/// What a run that knows nothing beforehand ended with.
fn named(run: Run<'_>, how: Result<MotionKind, Stop>) -> Classified {
    let state = run.state.clone();
    ended(run.ended(how), &state)
}

impl Outlook<'_> {
    /// The stable orbit that it seems to go to, or does.
    pub fn orbit(&self) -> Option<&PeriodicOrbit> {
        match &self.stage {
            Stage::Closed(beside) => match &beside.1 {
                Closed::Attracting(orbit) => Some(orbit),
                Closed::Occupied(_) => None,
            },
            Stage::Known(end) => match &end.kind {
                MotionKind::Periodic(orbit) | MotionKind::TransientChaos { orbit, .. } => {
                    Some(orbit)
                }
                _ => None,
            },
            Stage::Unclosed(_) => None,
        }
    }

    /// The state that it has come to.
    pub fn state(&self) -> &[f64] {
        match &self.stage {
            Stage::Closed(beside) => &beside.0.state,
            Stage::Unclosed(run) => &run.state,
            Stage::Known(end) => &end.state,
        }
    }

    /// Whether it ran off.
    pub fn is_unbounded(&self) -> bool {
        matches!(&self.stage, Stage::Known(end) if matches!(end.kind, MotionKind::Unbounded))
    }

    /// Follows it on, by the same map, until it is seen to go to an orbit or its transient is over.
    #[must_use]
    pub fn settled<M: StroboscopicMap>(self, map: &mut M) -> Self {
        let stage = match settled(map, self.stage) {
            Ok(end) => Stage::Known(end),
            Err(run) => Stage::Unclosed(run),
        };
        Self { stage }
    }

    /// Follows it on, by the same map, until it can be named.
    pub fn verified<M: StroboscopicMap>(self, map: &mut M) -> Classified {
        match settled(map, self.stage) {
            Ok(end) => *end,
            Err(mut run) => {
                let how = run.measure(map);
                named(*run, how)
            }
        }
    }
}

/// The end of a run, or the run where its transient is over without one.
fn settled<'a, M: StroboscopicMap>(
    map: &mut M,
    mut stage: Stage<'a>,
) -> Result<Box<Classified>, Box<Run<'a>>> {
    loop {
        let (mut run, closed, mut guesses) = match stage {
            Stage::Closed(beside) => *beside,
            Stage::Unclosed(run) => return Err(run),
            Stage::Known(end) => return Ok(end),
        };
        stage = match run.verdict(map, closed, &mut guesses).transpose() {
            None => looked(map, run, guesses),
            Some(how) => Stage::Known(Box::new(named(run, how))),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classify::approach::tests::{Line, barred};
    use crate::classify::run::tests::Logistic;

    /// r x (1 − x) at 3.2 goes to a period 2, at 3.9 nowhere that closes, at 4.1 away.
    #[test]
    fn what_is_seen_is_what_is_named() {
        let options = ClassifyOptions::default();
        let mut map = Logistic(3.2);
        let seen = outlook(&mut map, &[0.3], &options);
        let closed = seen.orbit().unwrap().clone();
        assert_eq!((closed.period, seen.is_unbounded()), (2, false));
        let seen = seen.settled(&mut map);
        assert!(seen.orbit().unwrap().is_same_as(&closed));
        let named = seen.verified(&mut map);
        assert!(matches!(&named.kind, MotionKind::Periodic(orbit) if orbit.is_same_as(&closed)));

        let mut map = Logistic(3.9);
        let seen = outlook(&mut map, &[0.3], &options);
        let (at, seen) = (seen.state().to_vec(), seen.settled(&mut map));
        assert!(seen.orbit().is_none() && !seen.is_unbounded() && seen.state() == at);
        let named = seen.verified(&mut map);
        assert!(matches!(named.kind, MotionKind::Chaotic(_)), "{named:?}");

        let mut map = Logistic(4.1);
        let seen = outlook(&mut map, &[0.3], &options);
        assert!(seen.is_unbounded());
        let named = seen.verified(&mut map);
        assert!(matches!(named.kind, MotionKind::Unbounded));
    }

    /// From 0.3 Newton closes the rest at 0, where the run does not come.
    #[test]
    fn what_seems_to_go_to_an_orbit_may_not() {
        let options = ClassifyOptions::default();
        let mut map = Line(barred);
        let seen = outlook(&mut map, &[0.3], &options);
        assert_eq!(seen.orbit().unwrap().states[0], [0.0]);
        let seen = seen.settled(&mut map);
        let goes_to_rest = |orbit: Option<&PeriodicOrbit>| {
            orbit.is_some_and(|orbit| orbit.states.iter().any(|x| x[0].abs() < 0.1))
        };
        assert!(!goes_to_rest(seen.orbit()));
        assert!((0.1..0.3).contains(&seen.state()[0]));
        let named = seen.verified(&mut map);
        assert!(!goes_to_rest(match &named.kind {
            MotionKind::Periodic(orbit) => Some(orbit),
            _ => None,
        }));
        assert!(named.met.iter().any(|orbit| goes_to_rest(Some(orbit))));
    }
}
