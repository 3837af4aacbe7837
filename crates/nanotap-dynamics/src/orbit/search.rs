//! Every periodic orbit that Newton reaches, unstable ones included.
//!
//! From each start, Newton is tried for every period on the start itself and on the
//! nearest recurrence of each period in the run from it: a chaotic motion passes
//! close to the unstable orbits that are embedded in it.
//!
//! Fails by omission: a list from finitely many starts is never proved complete.

use std::sync::atomic::AtomicUsize;

use rayon::prelude::*;

use crate::control::Control;
use crate::failure::advance;
use crate::map::StroboscopicMap;
use crate::orbit::{PeriodicOrbit, ShootingOptions, close_orbit, close_orbit_from_points};
use crate::vector::{distance, norm};

/// What to search for orbits.
#[derive(Clone, Debug, PartialEq)]
pub struct OrbitSearch {
    /// Longest period.
    pub max_period: usize,
    /// Periods that are run from each start in search of recurrences; 0 for none.
    pub run: usize,
    /// States with a larger entry end a run.
    pub bound: f64,
    /// Newton's options.
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

/// All orbits found from these starts, each once, by period and then by largest
/// multiplier and first state. The same for any number of threads.
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

/// Index of an orbit in a list, after adding it (in canonical phase) if it is new.
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
    // A quarter of the run lets the start's own transient pass.
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
