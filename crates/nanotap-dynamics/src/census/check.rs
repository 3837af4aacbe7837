//! Starts of a census followed again on the map itself.
//!
//! A census may follow its starts on a [coarse](crate::Scheduling::coarse) map. A check follows some
//! of them from the beginning on the map itself, alone, and compares where they go. Near a boundary
//! between basins the two may rightly differ; more than a few differences in a hundred say that
//! the fractions of the census are not those of the map.

use rayon::prelude::*;

use crate::census::{AttractorKind, Census, StartOutcome, StartSet};
use crate::classify::{
    ClassifyOptions, KnownMotions, MotionKind, RunEnd, after_reset, follow_start,
};
use crate::control::Control;
use crate::lyapunov::LyapunovSpectrum;
use crate::map::StroboscopicMap;
use crate::neighbourhood::Neighbourhood;
use crate::orbit::PeriodicOrbit;
use crate::random::{mix, unit};

/// A start of a census that was followed again on the map itself.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedStart {
    /// Index of the start in the census.
    pub start: usize,
    /// Outcome in the census.
    pub outcome: StartOutcome,
    /// Motion on the map itself.
    pub exact: ExactOutcome,
    /// Whether both are the same motion; `None` if one of them is undecided.
    pub agrees: Option<bool>,
    /// Whether a neighbour, within 2e-5 of each entry, goes to another motion on the map itself than
    /// this start; followed only where the two outcomes differ.
    pub is_sensitive: bool,
}

/// Distance of the neighbours of a start, as a fraction of each of its entries: the error that a
/// coarse map may have in a drive period.
const NEIGHBOUR: f64 = 2e-5;
/// Number of neighbours that are followed at most, until one goes elsewhere.
const NEIGHBOURS: u64 = 8;

/// Where a start goes on the map itself.
#[derive(Clone, Debug, PartialEq)]
pub enum ExactOutcome {
    /// To the periodic attractor with this index in [`Census::attractors`].
    Attractor(usize),
    /// To a stable orbit of this period, in drive periods, that the census does not list.
    OtherOrbit(usize),
    /// To a torus.
    QuasiPeriodic,
    /// To chaos, as long as it was followed.
    Chaotic,
    /// A state exceeded the bound or overflowed.
    Unbounded,
    /// Undecided, for this reason.
    Undecided(String),
}

/// Follows `count` starts of a census again on the map itself, chosen by `seed`, and compares. The
/// result does not depend on the number of threads. Stopped work leaves out the starts that were not
/// done.
pub fn check_starts<M: StroboscopicMap>(
    map: &M,
    starts: &StartSet,
    census: &Census,
    (count, seed): (usize, u64),
    options: &ClassifyOptions,
    control: &Control<'_>,
) -> Vec<CheckedStart> {
    let chosen = chosen(census.outcomes_by_start.len(), count, seed);
    let orbits = census.attractors.iter().enumerate();
    let orbits = orbits.filter_map(|(index, attractor)| match &attractor.kind {
        AttractorKind::Periodic(orbit) => Some((index, orbit)),
        _ => None,
    });
    let orbits: Vec<_> = orbits.collect();
    let (owners, regions): (Vec<usize>, Vec<Neighbourhood>) = orbits
        .par_iter()
        .filter_map(|(index, orbit)| {
            let region = Neighbourhood::around(&mut map.clone(), orbit);
            Some((*index, region.ok().flatten()?))
        })
        .unzip();
    let chaos: Vec<LyapunovSpectrum> = chaos(census);
    let known = KnownMotions {
        trapping_regions: &regions,
        chaos: &chaos,
        cancel: control.cancel,
        ..KnownMotions::default()
    };
    let follow = |map: &mut M, state: &[f64]| match follow_start(map, state, known, options) {
        RunEnd::Entered { index, .. } => ExactOutcome::Attractor(owners[index]),
        RunEnd::Classified(found) => exact_outcome(found.kind, &orbits),
        // What follows a reset is one motion, known or not.
        RunEnd::Reset(reset) => {
            let known = KnownMotions {
                trapping_regions: &[],
                ..known
            };
            exact_outcome(after_reset(map, *reset, known, options).kind, &orbits)
        }
    };
    let checked = chosen.par_iter().with_max_len(1).map_init(
        || map.clone(),
        |map, &start| {
            let state = starts.start(start)?;
            if control.is_cancelled() {
                return None;
            }
            let exact = follow(map, &state);
            let outcome = census.outcomes_by_start[start];
            let agrees = agree(census, outcome, &exact);
            let is_sensitive = agrees == Some(false)
                && (0..NEIGHBOURS).any(|number| {
                    let other = follow(map, &neighbour(&state, seed ^ number));
                    !control.is_cancelled() && other != exact
                });
            // The map may have ended a run that was under way.
            (!control.is_cancelled()).then_some(CheckedStart {
                start,
                outcome,
                exact,
                agrees,
                is_sensitive,
            })
        },
    );
    let checked: Vec<Option<CheckedStart>> = checked.collect();
    checked.into_iter().flatten().collect()
}

/// Returns the outcome of a start with this motion, among the listed `orbits` with their indices.
fn exact_outcome(kind: MotionKind, orbits: &[(usize, &PeriodicOrbit)]) -> ExactOutcome {
    match kind {
        MotionKind::Periodic(orbit) | MotionKind::TransientChaos { orbit, .. } => {
            let mut listed = orbits.iter();
            let listed = listed.find(|(_, other)| other.is_same_as(&orbit));
            listed.map_or(ExactOutcome::OtherOrbit(orbit.period), |(index, _)| {
                ExactOutcome::Attractor(*index)
            })
        }
        MotionKind::QuasiPeriodic(_) => ExactOutcome::QuasiPeriodic,
        MotionKind::Chaotic(_) => ExactOutcome::Chaotic,
        MotionKind::Unbounded => ExactOutcome::Unbounded,
        MotionKind::Undecided { reason, .. } => ExactOutcome::Undecided(reason.to_string()),
    }
}

/// A state whose entries differ from those of `state` by up to [`NEIGHBOUR`] of each.
fn neighbour(state: &[f64], seed: u64) -> Vec<f64> {
    let entries = state.iter().zip(0_u64..);
    entries
        .map(|(x, k)| x * (1.0 + NEIGHBOUR * (2.0 * unit(seed ^ mix(k)) - 1.0)))
        .collect()
}

/// Chooses `count` different numbers below `all`, in ascending order.
fn chosen(all: usize, count: usize, seed: u64) -> Vec<usize> {
    let mut numbers: Vec<usize> = (0..all).collect();
    numbers.sort_by_key(|&k| mix(seed ^ mix(k as u64)));
    numbers.truncate(count);
    numbers.sort_unstable();
    numbers
}

/// Spectra of the chaos that a census found.
fn chaos(census: &Census) -> Vec<LyapunovSpectrum> {
    let attractors = census.attractors.iter();
    let lasting = attractors.filter_map(|attractor| match &attractor.kind {
        AttractorKind::Chaotic { spectrum, .. } => Some(spectrum.clone()),
        _ => None,
    });
    let transient = census.transient_chaos.iter();
    lasting
        .chain(transient.filter_map(|chaos| chaos.spectrum.clone()))
        .collect()
}

/// Whether an outcome of a census and one on the map are the same motion; `None` if one is undecided.
fn agree(census: &Census, outcome: StartOutcome, exact: &ExactOutcome) -> Option<bool> {
    let kind_of = |index: usize| &census.attractors[index].kind;
    Some(match (outcome, exact) {
        (StartOutcome::Undecided, _) | (_, ExactOutcome::Undecided(_)) => return None,
        (StartOutcome::Attractor { index, .. }, ExactOutcome::Attractor(other)) => index == *other,
        (StartOutcome::Attractor { index, .. }, ExactOutcome::QuasiPeriodic) => {
            matches!(kind_of(index), AttractorKind::QuasiPeriodic(_))
        }
        (StartOutcome::Attractor { index, .. }, ExactOutcome::Chaotic) => {
            // A start that escapes from transient chaos may stay on it longer on the map itself.
            census.transient_chaos.is_some()
                || matches!(kind_of(index), AttractorKind::Chaotic { .. })
        }
        // It escaped, or has not yet.
        (
            StartOutcome::TransientChaos { .. },
            ExactOutcome::Attractor(_) | ExactOutcome::Chaotic,
        )
        | (StartOutcome::Unbounded, ExactOutcome::Unbounded) => true,
        _ => false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_starts_are_different_and_depend_on_the_seed() {
        let some = chosen(1000, 30, 7);
        assert_eq!(some.len(), 30);
        assert!(some.windows(2).all(|pair| pair[0] < pair[1]) && some[29] < 1000);
        assert_ne!(some, chosen(1000, 30, 8));
        assert_eq!(chosen(5, 30, 7), [0, 1, 2, 3, 4]);
    }
}
