//! Search for periodic orbits, stable and unstable.
//!
//! From each start, Newton is tried for every period at the start itself and at the nearest
//! recurrence of that period in the run from it: a chaotic motion passes close to the unstable
//! orbits embedded in it.
//!
//! Fails by omission: a list from finitely many starts is never proved to be complete.

use std::sync::atomic::AtomicUsize;

use rayon::prelude::*;

use crate::control::Control;
use crate::failure::advance;
use crate::map::StroboscopicMap;
use crate::orbit::{PeriodicOrbit, ShootingOptions, close_orbit, close_orbit_from_points};
use crate::vector::{distance, norm};

/// Options of the search for periodic orbits.
#[derive(Clone, Debug, PartialEq)]
pub struct OrbitSearch {
    /// Longest period in drive periods.
    pub max_period: usize,
    /// Number of drive periods run from each start in search of recurrences; 0 for none.
    pub run: usize,
    /// A run ends at a state with an entry above this, in units of the state.
    pub bound: f64,
    /// Options of Newton's method for closing candidates.
    pub shooting: ShootingOptions,
}

impl Default for OrbitSearch {
    fn default() -> Self {
        Self {
            max_period: 4,
            run: 512,
            bound: 1e8,
            shooting: ShootingOptions::default(),
        }
    }
}

/// Finds the orbits from these starts, each once, in order of period, largest multiplier and first
/// state. The result does not depend on the number of threads.
pub fn find_orbits<M: StroboscopicMap>(
    map: &M,
    starts: &[Vec<f64>],
    search: &OrbitSearch,
    control: &Control<'_>,
) -> Vec<PeriodicOrbit> {
    let done = AtomicUsize::new(0);
    let found: Vec<Vec<PeriodicOrbit>> = starts
        .par_iter()
        .map_init(
            || map.clone(),
            |map, start| {
                if control.is_cancelled() {
                    return Vec::new();
                }
                let orbits = from_one_start(map, start, search, control);
                control.report(&done, starts.len());
                orbits
            },
        )
        .collect();
    let mut all = Vec::new();
    for orbit in found.into_iter().flatten() {
        merge(&mut all, orbit);
    }
    all.sort_by(|a, b| {
        a.period
            .cmp(&b.period)
            .then(a.spectral_radius().total_cmp(&b.spectral_radius()))
            .then_with(|| {
                a.states
                    .partial_cmp(&b.states)
                    .unwrap_or(std::cmp::Ordering::Equal)
            })
    });
    all
}

/// Index of an orbit in a list; a new orbit is appended (in canonical phase).
pub(crate) fn merge(all: &mut Vec<PeriodicOrbit>, orbit: PeriodicOrbit) -> usize {
    if let Some(index) = all.iter().position(|o| o.is_same_as(&orbit)) {
        return index;
    }
    all.push(orbit.canonical());
    all.len() - 1
}

fn from_one_start<M: StroboscopicMap>(
    map: &mut M,
    start: &[f64],
    search: &OrbitSearch,
    control: &Control<'_>,
) -> Vec<PeriodicOrbit> {
    let mut found = Vec::new();
    for period in 1..=search.max_period {
        if control.is_cancelled() {
            return found;
        }
        if let Ok(orbit) = close_orbit(map, start, period, &search.shooting) {
            merge(&mut found, orbit);
        }
    }
    let d = start.len();
    if d == 0 || d != map.dimension() {
        return found;
    }
    let mut run = start.to_vec();
    let mut state = start.to_vec();
    for _ in 0..search.run {
        if advance(map, &mut state).is_err() || norm(&state) > search.bound {
            break;
        }
        run.extend_from_slice(&state);
    }
    let count = run.len() / d;
    let at = |k: usize| &run[k * d..(k + 1) * d];
    // The first quarter of the run is the transient of the start.
    for period in 1..=search.max_period.min(count - 1) {
        let nearest = (count / 4..count - period).min_by(|&a, &b| {
            distance(at(a), at(a + period)).total_cmp(&distance(at(b), at(b + period)))
        });
        if let Some(k) = nearest {
            let points = &run[k * d..(k + period) * d];
            if let Ok(orbit) = close_orbit_from_points(map, points, period, &search.shooting) {
                merge(&mut found, orbit);
            }
        }
    }
    found
}
