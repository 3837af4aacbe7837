//! Continuation of attractors over a grid of parameter values: an attractor known at one value is
//! sought at its neighbours.
//!
//! A census is taken at every value. Then each attractor is tried at the neighbouring values. For
//! an orbit, Newton closes the orbit there; if that fails or the orbit is unstable, the motion from
//! its state is classified. The motions from the states of chaotic attractors and tori are
//! classified too. An attractor already found at the neighbouring value is not tried again in the
//! other direction. New attractors are tried at their neighbours in turn, until no value gains one
//! (global continuation, as Datseris, Luiz Rossi and Wagemakers, Chaos 33, 073151, 2023, with
//! Newton in place of recurrences).
//!
//! Attractors at neighbouring values that continue each other (Newton from either one closes the
//! other, at a small distance) form a branch.
//!
//! Rounds over the whole grid run in sequence, so the result does not depend on the number of
//! threads.
//!
//! Fails: an attractor that exists only between two values of the grid, or that no census finds
//! anywhere, is missed. An attractor that moves by more than half its size from value to value is
//! found but not joined to its branch.

use std::collections::{BTreeMap, HashSet};

use rayon::prelude::*;

use crate::census::{
    Attractor, AttractorKind, Census, CensusOptions, Fraction, Lifetime, StartSet, census_of,
};
use crate::classify::{ClassifyOptions, MotionKind, classify};
use crate::control::Control;
use crate::map::{MapFamily, StroboscopicMap};
use crate::orbit::{PeriodicOrbit, close_orbit_from_points};

/// Largest distance between an orbit and its continuation at the next value, as a fraction of the
/// orbit's size.
const MAX_DISPLACEMENT: f64 = 0.5;

/// Options of the continuation of attractors over a grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AttractorContinuationOptions {
    /// Options of the census at every value.
    pub census: CensusOptions,
}

/// Result at one value of the grid.
#[derive(Clone, Debug)]
pub struct AttractorsAtValue {
    /// The attractors: those of the census, then those found from neighbours.
    pub attractors: Vec<ContinuedAttractor>,
    /// The census; `None` if there is no map at this value or the computation was cancelled.
    pub census: Option<Census>,
    /// Why there is no map at this value.
    pub failure: Option<String>,
}

/// An attractor at one value of the grid.
#[derive(Clone, Debug)]
pub struct ContinuedAttractor {
    /// The attractor. If it was found from a neighbour, its fraction counts no starts.
    pub attractor: Attractor,
    /// Index of the value from which it was found; `None` if the census found it.
    pub found_from: Option<usize>,
    /// Number of its branch, counted from 0 in the order of the grid.
    pub branch: usize,
}

/// Finds the attractors of a one-parameter family at each of `values`, in their order. `starts`
/// returns the initial states for the value with this index.
pub fn continue_attractors<F: MapFamily>(
    family: &F,
    values: &[f64],
    starts: impl Fn(usize, &F::Map) -> StartSet + Sync,
    options: &AttractorContinuationOptions,
    control: &Control<'_>,
) -> Vec<AttractorsAtValue> {
    let at = |k: usize| family.at(values[k]).map_err(|e| e.to_string());
    let neighbours = grid_neighbours(&[values.len()]);
    continue_over_graph(values.len(), at, neighbours, starts, options, control)
}

/// Neighbours of each value in a grid of one or two parameters with the given numbers of values.
/// The index runs fastest along the first parameter.
pub fn grid_neighbours(shape: &[usize]) -> impl Fn(usize) -> Vec<usize> + use<> {
    let columns = shape.first().copied().unwrap_or(1).max(1);
    let rows = shape.get(1).copied().unwrap_or(1);
    move |k| {
        let (x, y) = (k % columns, k / columns);
        [
            (x > 0).then(|| k - 1),
            (x + 1 < columns).then_some(k + 1),
            (y > 0).then(|| k - columns),
            (y + 1 < rows).then_some(k + columns),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

/// Index of a value and of an attractor there.
type AttractorIndex = (usize, usize);

/// Result of trying an attractor at a neighbouring value.
struct Trial {
    from: AttractorIndex,
    at: usize,
    kind: AttractorKind,
    state: Vec<f64>,
    /// Whether it is the continuation of the attractor.
    continued: bool,
}

fn continue_over_graph<M: StroboscopicMap>(
    count: usize,
    at: impl Fn(usize) -> Result<M, String> + Sync,
    neighbours: impl Fn(usize) -> Vec<usize>,
    starts: impl Fn(usize, &M) -> StartSet + Sync,
    options: &AttractorContinuationOptions,
    control: &Control<'_>,
) -> Vec<AttractorsAtValue> {
    let quiet = Control {
        cancel: control.cancel,
        progress: None,
    };
    let done = std::sync::atomic::AtomicUsize::new(0);
    let values: Vec<AttractorsAtValue> = (0..count)
        .into_par_iter()
        .with_max_len(1)
        .map(|k| {
            if control.is_cancelled() {
                return AttractorsAtValue {
                    attractors: Vec::new(),
                    census: None,
                    failure: None,
                };
            }
            let value = match at(k) {
                Ok(map) => from_census(census_of(&map, &starts(k, &map), &options.census, &quiet)),
                Err(failure) => AttractorsAtValue {
                    attractors: Vec::new(),
                    census: None,
                    failure: Some(failure),
                },
            };
            control.report(&done, count);
            value
        })
        .collect();
    share_attractors(values, at, neighbours, &options.census.classify, control)
}

/// Tries the orbits known at some values at the neighbouring values, until no value gains one: the
/// last step of [`continue_attractors`] for runs that exist already. `known` contains the stable
/// orbits at each value, `at` returns the map there, and `neighbours` the indices of neighbouring
/// values ([`grid_neighbours`]).
pub fn share_orbits<M: StroboscopicMap>(
    known: Vec<Vec<PeriodicOrbit>>,
    at: impl Fn(usize) -> Result<M, String> + Sync,
    neighbours: impl Fn(usize) -> Vec<usize>,
    classify: &ClassifyOptions,
    control: &Control<'_>,
) -> Vec<AttractorsAtValue> {
    let values = known.into_iter().map(|orbits| AttractorsAtValue {
        attractors: orbits
            .into_iter()
            .map(|orbit| ContinuedAttractor {
                attractor: Attractor {
                    state: orbit.states[0].clone(),
                    kind: AttractorKind::Periodic(orbit),
                    fraction: Fraction::new(0, 0),
                    first_start: None,
                },
                found_from: None,
                branch: 0,
            })
            .collect(),
        census: None,
        failure: None,
    });
    share_attractors(values.collect(), at, neighbours, classify, control)
}

/// Tries the attractors of each value at its neighbours until no value gains one.
fn share_attractors<M: StroboscopicMap>(
    mut values: Vec<AttractorsAtValue>,
    at: impl Fn(usize) -> Result<M, String> + Sync,
    neighbours: impl Fn(usize) -> Vec<usize>,
    classify: &ClassifyOptions,
    control: &Control<'_>,
) -> Vec<AttractorsAtValue> {
    let mut links: Vec<(AttractorIndex, AttractorIndex)> = Vec::new();
    // Attractors whose continuation at a neighbouring value is known.
    let mut continued: HashSet<(AttractorIndex, usize)> = HashSet::new();
    let mut untried: Vec<AttractorIndex> = indices(&values);
    while !untried.is_empty() && !control.is_cancelled() {
        // Two neighbouring values, and the attractors of either one to be tried at the other.
        let mut pairs: BTreeMap<[usize; 2], Vec<AttractorIndex>> = BTreeMap::new();
        for from in untried.drain(..) {
            for at in neighbours(from.0) {
                if values[at].failure.is_none() && !continued.contains(&(from, at)) {
                    let pair = [from.0.min(at), from.0.max(at)];
                    pairs.entry(pair).or_default().push(from);
                }
            }
        }
        let pairs: Vec<_> = pairs.into_iter().collect();
        let trials: Vec<Vec<Trial>> = pairs
            .into_par_iter()
            .with_max_len(1)
            .map(|(pair, indices)| {
                let cancelled = || control.is_cancelled();
                try_neighbours(&values, pair, &indices, &at, classify, cancelled)
            })
            .collect();
        for trial in trials.into_iter().flatten() {
            let known = &mut values[trial.at].attractors;
            let index = known
                .iter()
                .position(|a| a.attractor.kind.is_same_as(&trial.kind));
            let index = index.unwrap_or_else(|| {
                known.push(ContinuedAttractor {
                    attractor: Attractor {
                        kind: trial.kind,
                        fraction: Fraction::new(0, 0),
                        first_start: None,
                        state: trial.state,
                    },
                    found_from: Some(trial.from.0),
                    branch: 0,
                });
                untried.push((trial.at, known.len() - 1));
                known.len() - 1
            });
            if trial.continued {
                let found = (trial.at, index);
                links.push((trial.from, found));
                continued.extend([(trial.from, trial.at), (found, trial.from.0)]);
            }
        }
    }
    number_branches(&mut values, &links);
    values
}

/// Tries attractors of two neighbouring values, each at the other value: orbits by Newton, then
/// those without a continuation in either direction by a run.
fn try_neighbours<M: StroboscopicMap>(
    values: &[AttractorsAtValue],
    pair: [usize; 2],
    indices: &[AttractorIndex],
    at: impl Fn(usize) -> Result<M, String>,
    classify: &ClassifyOptions,
    cancelled: impl Fn() -> bool,
) -> Vec<Trial> {
    if cancelled() {
        return Vec::new();
    }
    let known = |(k, a): AttractorIndex| &values[k].attractors[a].attractor;
    let mut maps = pair.map(|k| at(k).ok());
    let mut trials: Vec<Trial> = Vec::new();
    for by_newton in [true, false] {
        for &from in indices {
            let at = usize::from(from.0 == pair[0]);
            let continues = |trial: &Trial| {
                trial.at == from.0 && trial.continued && trial.kind.is_same_as(&known(from).kind)
            };
            if trials.iter().any(|t| t.from == from || continues(t)) {
                continue;
            }
            if cancelled() {
                return trials;
            }
            let Some(map) = &mut maps[at] else { continue };
            let found = if by_newton {
                close_from(map, known(from), classify)
            } else {
                classify_from(map, known(from), classify)
            };
            trials.extend(found.map(|(kind, state, continued)| Trial {
                from,
                at: pair[at],
                kind,
                state,
                continued,
            }));
        }
    }
    trials
}

fn from_census(census: Census) -> AttractorsAtValue {
    let attractors = census
        .attractors
        .iter()
        .map(|attractor| ContinuedAttractor {
            attractor: attractor.clone(),
            found_from: None,
            branch: 0,
        })
        .collect();
    AttractorsAtValue {
        attractors,
        census: Some(census),
        failure: None,
    }
}

fn indices(values: &[AttractorsAtValue]) -> Vec<AttractorIndex> {
    values
        .iter()
        .enumerate()
        .flat_map(|(k, v)| (0..v.attractors.len()).map(move |a| (k, a)))
        .collect()
}

/// Attractor reached from a neighbour's, a state on it, and whether it is the continuation.
type Reached = (AttractorKind, Vec<f64>, bool);

/// The stable orbit that Newton closes from a neighbour's orbit.
fn close_from<M: StroboscopicMap>(
    map: &mut M,
    attractor: &Attractor,
    options: &ClassifyOptions,
) -> Option<Reached> {
    let AttractorKind::Periodic(orbit) = &attractor.kind else {
        return None;
    };
    let closed =
        close_orbit_from_points(map, &orbit.flat(), orbit.period, &options.shooting).ok()?;
    if !closed.is_stable() {
        return None;
    }
    let continued = orbit.is_near(&closed, MAX_DISPLACEMENT);
    let state = closed.states[0].clone();
    Some((AttractorKind::Periodic(closed), state, continued))
}

/// The attractor that the motion from a neighbour's attractor reaches.
fn classify_from<M: StroboscopicMap>(
    map: &mut M,
    attractor: &Attractor,
    options: &ClassifyOptions,
) -> Option<Reached> {
    let classified = classify(map, &attractor.state, options);
    let (kind, continued) = match classified.kind {
        MotionKind::Periodic(orbit) | MotionKind::TransientChaos { orbit, .. } => {
            (AttractorKind::Periodic(orbit), false)
        }
        MotionKind::QuasiPeriodic(torus) => (
            AttractorKind::QuasiPeriodic(torus),
            matches!(attractor.kind, AttractorKind::QuasiPeriodic(_)),
        ),
        MotionKind::Chaotic(chaos) => (
            AttractorKind::Chaotic {
                spectrum: chaos.spectrum,
                lifetime: Lifetime::new(0, chaos.observed as f64),
            },
            matches!(attractor.kind, AttractorKind::Chaotic { .. }),
        ),
        MotionKind::Unbounded | MotionKind::Undecided { .. } => return None,
    };
    Some((kind, classified.state, continued))
}

/// Assigns one number to linked attractors, in the order of the grid.
fn number_branches(values: &mut [AttractorsAtValue], links: &[(AttractorIndex, AttractorIndex)]) {
    let all = indices(values);
    let offset: Vec<usize> = values
        .iter()
        .scan(0, |sum, v| {
            let before = *sum;
            *sum += v.attractors.len();
            Some(before)
        })
        .collect();
    let index = |(k, a): AttractorIndex| offset[k] + a;
    let mut parent: Vec<usize> = (0..all.len()).collect();
    for &(a, b) in links {
        let (a, b) = (root(&mut parent, index(a)), root(&mut parent, index(b)));
        parent[a.max(b)] = a.min(b);
    }
    let mut numbers: Vec<Option<usize>> = vec![None; all.len()];
    let mut next = 0;
    for &(value, attractor) in &all {
        let r = root(&mut parent, index((value, attractor)));
        let number = *numbers[r].get_or_insert_with(|| {
            next += 1;
            next - 1
        });
        values[value].attractors[attractor].branch = number;
    }
}

/// The representative of a set of linked attractors (union–find with path halving).
fn root(parent: &mut [usize], mut k: usize) -> usize {
    while parent[k] != k {
        parent[k] = parent[parent[k]];
        k = parent[k];
    }
    k
}
