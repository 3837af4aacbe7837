//! Attractors all over a grid of parameter values: none that is known at one value is
//! missed at its neighbours.
//!
//! A census is taken at every value. Then each attractor is tried at the neighbouring
//! values: of an orbit Newton looks for the same orbit there; where that fails, or finds
//! it unstable, the motion from its state is classified; of chaos and tori likewise. One
//! that is seen to go on at the neighbouring value from there need not be tried from here.
//! What is new at a value is tried at its neighbours in turn, both ways, until no value
//! gains an attractor (global continuation, as Datseris, Luiz Rossi and Wagemakers,
//! Chaos 33, 073151, 2023, with Newton in place of recurrences).
//!
//! Attractors at neighbouring values that are one another's continuation (Newton from
//! either closes the other, with little change of place) form a branch.
//!
//! The rounds are taken one after the other over the whole grid, so the result is the
//! same for any number of threads.
//!
//! Fails: an attractor whose whole range lies between two values of the grid, or that no
//! census meets anywhere in its range, stays unseen; one that moves by more than half
//! its size from value to value is found but not joined to its branch.

use std::collections::{BTreeMap, HashSet};

use rayon::prelude::*;

use crate::census::{
    Attractor, AttractorKind, Census, CensusOptions, Fraction, Lifetime, StartSet, census_of,
};
use crate::classify::{ClassifyOptions, MotionKind, classify};
use crate::control::Control;
use crate::map::{MapFamily, StroboscopicMap};
use crate::orbit::{PeriodicOrbit, close_orbit_from_points};

/// Part of an orbit's size by which it may move from one value to the next and still be
/// called the same.
const CONTINUITY: f64 = 0.5;

/// How attractors are sought over a grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GlobalOptions {
    /// The census at every value. What it may leave unseen there, neighbours can show.
    pub census: CensusOptions,
}

/// What is known at one value of the grid.
#[derive(Clone, Debug)]
pub struct GlobalValue {
    /// The attractors: those of the census, then those that neighbours showed.
    pub attractors: Vec<GlobalAttractor>,
    /// The census; `None` if there is no map at this value or the work was stopped.
    pub census: Option<Census>,
    /// Why there is no map at this value.
    pub failure: Option<String>,
}

/// An attractor at one value of the grid.
#[derive(Clone, Debug)]
pub struct GlobalAttractor {
    /// The attractor. One that a neighbour showed has a fraction of no starts.
    pub attractor: Attractor,
    /// Index of the value whose attractor led to it; `None` if the census found it.
    pub shown_by: Option<usize>,
    /// Number of the branch on which it lies, counted from 0 in the order of the grid.
    pub branch: usize,
}

/// The attractors of a one-parameter family at each of `values`, in their order.
/// `starts` gives the starts at the value with this index.
pub fn attractors_along<F: MapFamily>(
    family: &F,
    values: &[f64],
    starts: impl Fn(usize, &F::Map) -> StartSet + Sync,
    options: &GlobalOptions,
    control: &Control<'_>,
) -> Vec<GlobalValue> {
    let at = |k: usize| family.at(values[k]).map_err(|e| e.to_string());
    let neighbours = grid_neighbours(&[values.len()]);
    over_graph(values.len(), at, neighbours, starts, options, control)
}

/// The values beside each value of a grid of one or two parameters with so many values each;
/// the index of a value runs fastest along the first.
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

/// One attractor of one value.
type Place = (usize, usize);

/// What came of trying an attractor at a neighbouring value.
struct Trial {
    from: Place,
    at: usize,
    kind: AttractorKind,
    state: Vec<f64>,
    /// Whether it is the same attractor, moved a little.
    continued: bool,
}

fn over_graph<M: StroboscopicMap>(
    count: usize,
    at: impl Fn(usize) -> Result<M, String> + Sync,
    neighbours: impl Fn(usize) -> Vec<usize>,
    starts: impl Fn(usize, &M) -> StartSet + Sync,
    options: &GlobalOptions,
    control: &Control<'_>,
) -> Vec<GlobalValue> {
    let quiet = Control {
        cancel: control.cancel,
        progress: None,
    };
    let done = std::sync::atomic::AtomicUsize::new(0);
    let values: Vec<GlobalValue> = (0..count)
        .into_par_iter()
        .with_max_len(1)
        .map(|k| {
            if control.is_cancelled() {
                return GlobalValue {
                    attractors: Vec::new(),
                    census: None,
                    failure: None,
                };
            }
            let value = match at(k) {
                Ok(map) => from_census(census_of(&map, &starts(k, &map), &options.census, &quiet)),
                Err(failure) => GlobalValue {
                    attractors: Vec::new(),
                    census: None,
                    failure: Some(failure),
                },
            };
            control.report(&done, count);
            value
        })
        .collect();
    shared(values, at, neighbours, &options.census.classify, control)
}

/// Orbits that are known at some values, tried at the neighbouring ones in turn until no
/// value gains one: the last step of [`attractors_along`] where runs were made already.
/// `known` has the stable orbits at each value, `at` is the map there, `neighbours` are the
/// values beside it ([`grid_neighbours`]).
pub fn orbits_shared<M: StroboscopicMap>(
    known: Vec<Vec<PeriodicOrbit>>,
    at: impl Fn(usize) -> Result<M, String> + Sync,
    neighbours: impl Fn(usize) -> Vec<usize>,
    classify: &ClassifyOptions,
    control: &Control<'_>,
) -> Vec<GlobalValue> {
    let values = known.into_iter().map(|orbits| GlobalValue {
        attractors: orbits
            .into_iter()
            .map(|orbit| GlobalAttractor {
                attractor: Attractor {
                    state: orbit.states[0].clone(),
                    kind: AttractorKind::Periodic(orbit),
                    fraction: Fraction::new(0, 0),
                    first_start: None,
                },
                shown_by: None,
                branch: 0,
            })
            .collect(),
        census: None,
        failure: None,
    });
    shared(values.collect(), at, neighbours, classify, control)
}

/// Tries what is known at each value at its neighbours until none gains anything.
fn shared<M: StroboscopicMap>(
    mut values: Vec<GlobalValue>,
    at: impl Fn(usize) -> Result<M, String> + Sync,
    neighbours: impl Fn(usize) -> Vec<usize>,
    classify: &ClassifyOptions,
    control: &Control<'_>,
) -> Vec<GlobalValue> {
    let mut links: Vec<(Place, Place)> = Vec::new();
    // Attractors that are known to go on at a neighbouring value.
    let mut continued: HashSet<(Place, usize)> = HashSet::new();
    let mut fresh: Vec<Place> = places(&values);
    while !fresh.is_empty() && !control.is_cancelled() {
        // Two neighbouring values, and what is to be tried from either at the other.
        let mut pairs: BTreeMap<[usize; 2], Vec<Place>> = BTreeMap::new();
        for from in fresh.drain(..) {
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
            .map(|(pair, places)| {
                let cancelled = || control.is_cancelled();
                trials(&values, pair, &places, &at, classify, cancelled)
            })
            .collect();
        for trial in trials.into_iter().flatten() {
            let known = &mut values[trial.at].attractors;
            let index = known
                .iter()
                .position(|a| a.attractor.kind.is_same_as(&trial.kind));
            let index = index.unwrap_or_else(|| {
                known.push(GlobalAttractor {
                    attractor: Attractor {
                        kind: trial.kind,
                        fraction: Fraction::new(0, 0),
                        first_start: None,
                        state: trial.state,
                    },
                    shown_by: Some(trial.from.0),
                    branch: 0,
                });
                fresh.push((trial.at, known.len() - 1));
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

/// What comes of trying attractors of two neighbouring values, each at the other: of orbits by
/// Newton, then of those that were not seen to go on, in either direction, by a run.
fn trials<M: StroboscopicMap>(
    values: &[GlobalValue],
    pair: [usize; 2],
    places: &[Place],
    at: impl Fn(usize) -> Result<M, String>,
    classify: &ClassifyOptions,
    cancelled: impl Fn() -> bool,
) -> Vec<Trial> {
    if cancelled() {
        return Vec::new();
    }
    let known = |(k, a): Place| &values[k].attractors[a].attractor;
    let mut maps = pair.map(|k| at(k).ok());
    let mut trials: Vec<Trial> = Vec::new();
    for by_newton in [true, false] {
        for &from in places {
            let at = usize::from(from.0 == pair[0]);
            let goes_on = |trial: &Trial| {
                trial.at == from.0 && trial.continued && trial.kind.is_same_as(&known(from).kind)
            };
            if trials.iter().any(|t| t.from == from || goes_on(t)) {
                continue;
            }
            if cancelled() {
                return trials;
            }
            let Some(map) = &mut maps[at] else { continue };
            let found = if by_newton {
                closed(map, known(from), classify)
            } else {
                arrived(map, known(from), classify)
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

fn from_census(census: Census) -> GlobalValue {
    let attractors = census
        .attractors
        .iter()
        .map(|attractor| GlobalAttractor {
            attractor: attractor.clone(),
            shown_by: None,
            branch: 0,
        })
        .collect();
    GlobalValue {
        attractors,
        census: Some(census),
        failure: None,
    }
}

fn places(values: &[GlobalValue]) -> Vec<Place> {
    values
        .iter()
        .enumerate()
        .flat_map(|(k, v)| (0..v.attractors.len()).map(move |a| (k, a)))
        .collect()
}

/// The attractor to which a neighbour's leads, a state on it, and whether it is the same one.
type Led = (AttractorKind, Vec<f64>, bool);

/// The stable orbit that Newton closes from a neighbour's.
fn closed<M: StroboscopicMap>(
    map: &mut M,
    attractor: &Attractor,
    options: &ClassifyOptions,
) -> Option<Led> {
    let AttractorKind::Periodic(orbit) = &attractor.kind else {
        return None;
    };
    let closed =
        close_orbit_from_points(map, &orbit.flat(), orbit.period, &options.shooting).ok()?;
    if !closed.is_stable() {
        return None;
    }
    let continued = orbit.is_near(&closed, CONTINUITY);
    let state = closed.states[0].clone();
    Some((AttractorKind::Periodic(closed), state, continued))
}

/// The attractor at which a run from a neighbour's arrives.
fn arrived<M: StroboscopicMap>(
    map: &mut M,
    attractor: &Attractor,
    options: &ClassifyOptions,
) -> Option<Led> {
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

/// Gives linked attractors one number, in the order of the grid.
fn number_branches(values: &mut [GlobalValue], links: &[(Place, Place)]) {
    let all = places(values);
    let offset: Vec<usize> = values
        .iter()
        .scan(0, |sum, v| {
            let before = *sum;
            *sum += v.attractors.len();
            Some(before)
        })
        .collect();
    let index = |(k, a): Place| offset[k] + a;
    let mut parent: Vec<usize> = (0..all.len()).collect();
    for &(a, b) in links {
        let (a, b) = (root(&mut parent, index(a)), root(&mut parent, index(b)));
        parent[a.max(b)] = a.min(b);
    }
    let mut numbers: Vec<Option<usize>> = vec![None; all.len()];
    let mut next = 0;
    for &place in &all {
        let r = root(&mut parent, index(place));
        let number = *numbers[r].get_or_insert_with(|| {
            next += 1;
            next - 1
        });
        values[place.0].attractors[place.1].branch = number;
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
