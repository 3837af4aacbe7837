//! The orbits at the rows of a curve, branch by branch, and the branch of each row.
//!
//! A motion is followed along the curve as in the measurement: Newton finds the orbit of each row
//! from that of the previous one, in smaller steps if necessary. If that fails, the branch has
//! ended, and the motion continues to the next attractor. The same is done from the end of the
//! curve to its beginning, which finds the other side of a hysteresis. With wrong parameters the
//! motion may stay on one branch in both directions while the data are on another. Where none of
//! the orbits resembles the measured motion, an orbit near it is searched for and followed in both
//! directions. Orbits of one period that continue each other form a branch. Each row is assigned to
//! a branch so that the sum of squared residuals and of a penalty for every change of branch is
//! minimal (the shortest path through the table of rows and branches, row by row).
//!
//! Fails by omission: branches that none of these searches finds.

use nanotap_dynamics::{
    ClassifyOptions, LyapunovOptions, MotionKind, PeriodicOrbit, ShootingOptions,
    StroboscopicMap as _, classify, close_orbit_from_points,
};

use nanotap_case::Case;
use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;

/// An orbit at a row.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) branch: usize,
    pub(super) orbit: PeriodicOrbit,
}

/// The orbits at each row.
pub(super) type Rows = Vec<Vec<Candidate>>;

/// A curve with the cases of its rows.
pub(super) struct RowCases<'a> {
    /// Returns the case at a row, and at positions between rows.
    pub(super) at: &'a dyn Fn(&[f64]) -> Option<Case>,
    /// The positions of the rows.
    pub(super) places: &'a [Vec<f64>],
    /// Returns a state at drive phase 0 with the measured amplitude and phase of a row, if both
    /// were measured.
    pub(super) measured: &'a dyn Fn(usize, &Model) -> Option<Vec<f64>>,
    /// Longest period of the orbits in drive periods.
    pub(super) max_period: usize,
}

/// Largest distance of orbits that continue each other in one step, as a fraction of their size.
const MAX_CONTINUATION_DISTANCE: f64 = 0.3;
/// Number of drive periods after the transient at which a motion that has not repeated is examined
/// for the last time.
const LAST_CHECK_PERIODS: usize = 64;
/// Largest number of halvings of the step from one row to the next.
const MAX_HALVINGS: usize = 4;
/// Largest distance of an orbit from the measured state, as a fraction of that state, at which the
/// two are the same motion.
const MAX_MOTION_DISTANCE: f64 = 0.2;
/// Largest number of runs from measured states.
const MAX_RUNS: usize = 6;

impl RowCases<'_> {
    /// Finds the orbits at every row.
    pub(super) fn discover(&self) -> Rows {
        let mut rows: Rows = vec![Vec::new(); self.places.len()];
        let mut branches = 0;
        let count = self.places.len();
        self.follow_motion(&mut rows, &mut branches, (0..count).collect(), None);
        let last = rows.last().and_then(|row| row.first()).cloned();
        self.follow_motion(
            &mut rows,
            &mut branches,
            (0..count).rev().collect(),
            last.as_ref(),
        );
        self.add_measured_motions(&mut rows, &mut branches);
        rows
    }

    /// Continues the orbits found for other parameters to every row; `None` if one of them has no
    /// continuation.
    pub(super) fn continued_from(&self, before: &Rows) -> Option<Rows> {
        let row = |(place, candidates): (&Vec<f64>, &Vec<Candidate>)| {
            let model = (self.at)(place)?.model().ok()?;
            let mut map = ModelMap::new(&model);
            let one = |candidate: &Candidate| {
                let orbit = newton_continuation(&mut map, &candidate.orbit)?;
                let near = orbit.is_near(&candidate.orbit, MAX_CONTINUATION_DISTANCE);
                (orbit.is_stable() && near).then_some(Candidate {
                    branch: candidate.branch,
                    orbit,
                })
            };
            candidates.iter().map(one).collect::<Option<Vec<_>>>()
        };
        self.places.iter().zip(before).map(row).collect()
    }

    /// Adds the branches of motions near the measured one at rows where no orbit is near it.
    fn add_measured_motions(&self, rows: &mut Rows, branches: &mut usize) {
        let count = rows.len();
        // Rows that fail are usually neighbours: the next one tried is some distance away.
        let apart = count / (2 * MAX_RUNS) + 1;
        let (mut runs, mut row) = (0, 0);
        while row < count && runs < MAX_RUNS {
            let Some(state) = self.unmatched_state(row, &rows[row]) else {
                row += 1;
                continue;
            };
            runs += 1;
            let found = self.settle(row, Some(&state));
            let new = found.filter(|o| !rows[row].iter().any(|known| known.orbit.is_same_as(o)));
            let Some(orbit) = new else {
                row += apart;
                continue;
            };
            let branch = *branches;
            *branches += 1;
            let candidate = Candidate { branch, orbit };
            rows[row].push(candidate.clone());
            let on: Vec<usize> = (row..count).collect();
            let back: Vec<usize> = (0..=row).rev().collect();
            self.follow_branch(rows, &candidate, &on);
            self.follow_branch(rows, &candidate, &back);
        }
    }

    /// The measured state at a row, if no known orbit is near it.
    fn unmatched_state(&self, row: usize, known: &[Candidate]) -> Option<Vec<f64>> {
        let model = (self.at)(&self.places[row])?.model().ok()?;
        let state = (self.measured)(row, &model)?;
        // Velocities relative to those of the drive.
        let modes = (state.len() - model.memory) / 2;
        let weight = |k: usize| match k / modes {
            0 => 1.0,
            1 => 1.0 / model.frequency(),
            _ => 0.0,
        };
        let length = |of: &dyn Fn(usize) -> f64| {
            let squares = (0..state.len()).map(|k| (of(k) * weight(k)).powi(2));
            squares.sum::<f64>().sqrt()
        };
        let size = length(&|k| state[k]);
        let like = |candidate: &Candidate| {
            let states = candidate.orbit.states.iter();
            let mut distances = states.map(|at| length(&|k| at[k] - state[k]));
            distances.any(|distance| distance <= MAX_MOTION_DISTANCE * size)
        };
        (!known.iter().any(like)).then_some(state)
    }

    /// Follows a new branch over the rows in this order, from the orbit of the first one.
    fn follow_branch(&self, rows: &mut Rows, candidate: &Candidate, order: &[usize]) {
        let mut last = candidate.orbit.clone();
        for pair in order.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|k| self.places[k].as_slice());
            let Some(orbit) = self.follow(a, b, &last, MAX_HALVINGS) else {
                return;
            };
            let known = rows[pair[1]]
                .iter()
                .any(|known| known.orbit.is_same_as(&orbit));
            if known {
                return;
            }
            rows[pair[1]].push(Candidate {
                branch: candidate.branch,
                orbit: orbit.clone(),
            });
            last = orbit;
        }
    }

    /// Follows the motion over the rows in this order.
    fn follow_motion(
        &self,
        rows: &mut Rows,
        branches: &mut usize,
        order: Vec<usize>,
        from: Option<&Candidate>,
    ) {
        let mut last: Option<(usize, Candidate)> = None;
        let mut state: Option<Vec<f64>> =
            from.and_then(|candidate| candidate.orbit.states.first().cloned());
        for row in order {
            let continued = last.as_ref().and_then(|(before, candidate)| {
                let [a, b] = [*before, row].map(|k| self.places[k].as_slice());
                let orbit = self.follow(a, b, &candidate.orbit, MAX_HALVINGS)?;
                Some((orbit, Some(candidate.branch)))
            });
            let found = continued.or_else(|| {
                let orbit = self.settle(row, state.as_deref())?;
                Some((orbit, None))
            });
            let Some((orbit, branch)) = found else {
                last = None;
                continue;
            };
            state = orbit.states.first().cloned();
            let known = rows[row]
                .iter()
                .find(|known| known.orbit.is_same_as(&orbit));
            let candidate = if let Some(known) = known {
                known.clone()
            } else {
                let branch = branch.or_else(|| self.branch_of(rows, row, &orbit));
                let branch = branch.unwrap_or_else(|| {
                    *branches += 1;
                    *branches - 1
                });
                let candidate = Candidate { branch, orbit };
                rows[row].push(candidate.clone());
                candidate
            };
            last = Some((row, candidate));
        }
    }

    /// The branch of a newly found orbit: that of an orbit at the nearest row with any, if it
    /// continues to this one.
    fn branch_of(&self, rows: &Rows, row: usize, orbit: &PeriodicOrbit) -> Option<usize> {
        let here = &self.places[row];
        let away = |k: &usize| {
            let place = self.places[*k].iter().zip(here);
            place.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let others = (0..rows.len()).filter(|k| *k != row && !rows[*k].is_empty());
        let near = others.min_by(|a, b| away(a).total_cmp(&away(b)))?;
        let mut there = rows[near].iter();
        let continues = there.find(|candidate| {
            let found = self.follow(&self.places[near], here, &candidate.orbit, MAX_HALVINGS);
            found.is_some_and(|found| found.is_same_as(orbit))
        });
        continues.map(|candidate| candidate.branch)
    }

    /// The orbit at `to` that continues the one at `from`, if it is stable.
    fn follow(
        &self,
        from: &[f64],
        to: &[f64],
        orbit: &PeriodicOrbit,
        halvings: usize,
    ) -> Option<PeriodicOrbit> {
        let closed = (self.at)(to).and_then(|case| {
            let model = case.model().ok()?;
            newton_continuation(&mut ModelMap::new(&model), orbit)
        });
        // Beyond a fold Newton may find an orbit of another branch.
        let near = |found: &PeriodicOrbit| found.is_near(orbit, MAX_CONTINUATION_DISTANCE);
        let closed = closed.filter(|found| found.is_stable() && near(found));
        if closed.is_some() || halvings == 0 {
            return closed;
        }
        let middle: Vec<f64> = from.iter().zip(to).map(|(a, b)| 0.5 * (a + b)).collect();
        let half = self.follow(from, &middle, orbit, halvings - 1)?;
        self.follow(&middle, to, &half, halvings - 1)
    }

    /// The orbit that the motion at a row reaches from a state, or from rest.
    fn settle(&self, row: usize, state: Option<&[f64]>) -> Option<PeriodicOrbit> {
        let model = (self.at)(&self.places[row])?.model().ok()?;
        settle(&model, state, self.max_period)
    }
}

/// The orbit of up to `max_period` drive periods that the motion from a state, or from rest,
/// reaches.
pub(super) fn settle(
    model: &Model,
    state: Option<&[f64]>,
    max_period: usize,
) -> Option<PeriodicOrbit> {
    let rest = vec![0.0; model.dimension()];
    // Only periodic motions matter: computing the exponents of other motions would take longer than
    // the rest of the fit.
    let options = ClassifyOptions {
        max_period,
        long_period: max_period,
        lyapunov: LyapunovOptions {
            alignment: 0,
            min_periods: LAST_CHECK_PERIODS,
            max_periods: LAST_CHECK_PERIODS,
            ..LyapunovOptions::default()
        },
        birkhoff_periods: 0,
        ..ClassifyOptions::default()
    };
    let end = classify(&mut ModelMap::new(model), state.unwrap_or(&rest), &options);
    match end.kind {
        MotionKind::Periodic(orbit) | MotionKind::TransientChaos { orbit, .. } => Some(orbit),
        _ => None,
    }
}

/// The orbit of this map that Newton finds from another orbit of the same period.
pub(super) fn newton_continuation(
    map: &mut ModelMap,
    orbit: &PeriodicOrbit,
) -> Option<PeriodicOrbit> {
    if orbit.dimension() != map.dimension() {
        return None;
    }
    let points = orbit.states.concat();
    close_orbit_from_points(map, &points, orbit.period, &ShootingOptions::default())
        .ok()
        .filter(|found| found.period == orbit.period)
}

/// Lowest cost of a path to a candidate, and the row and candidate before it.
type Reached = (f64, Option<(usize, usize)>);

/// The branch of each row: the path of lowest cost, with a penalty of `price` for each change of
/// branch. `rows` are the branches of the candidates of each row, `costs` has one entry per
/// candidate. `None` where a row has no candidate.
pub(super) fn path(rows: &[Vec<usize>], costs: &[Vec<f64>], price: f64) -> Vec<Option<usize>> {
    let mut best: Vec<Vec<Reached>> = Vec::new();
    let mut last: Option<usize> = None;
    for (row, candidates) in rows.iter().enumerate() {
        let here = candidates.iter().zip(&costs[row]).map(|(candidate, own)| {
            let Some(before) = last else {
                return (*own, None);
            };
            let steps = rows[before].iter().zip(&best[before]).enumerate();
            let (cost, from) = steps
                .map(|(k, (other, (sum, _)))| {
                    let change = if other == candidate { 0.0 } else { price };
                    (sum + change, k)
                })
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap_or((0.0, 0));
            (cost + own, Some((before, from)))
        });
        best.push(here.collect());
        if !candidates.is_empty() {
            last = Some(row);
        }
    }
    let mut chosen = vec![None; rows.len()];
    let cheapest = |row: usize| {
        let costs = best[row].iter().enumerate();
        costs
            .min_by(|a, b| a.1.0.total_cmp(&b.1.0))
            .map(|(k, _)| (row, k))
    };
    let mut at = last.and_then(cheapest);
    while let Some((row, candidate)) = at {
        chosen[row] = Some(candidate);
        at = best[row][candidate].1;
    }
    chosen
}

/// Removes the last row before and the first row after each change of branch from the other branch,
/// if it is assigned to that branch only because its own has none there. With slightly wrong
/// parameters a branch ends too early, and a row assigned to the other branch would bias the fit.
/// `costs` as in [`path`]; `max_noise_cost` is more than the cost of noise.
pub(super) fn release_branch_ends(
    rows: &[Vec<usize>],
    costs: &[Vec<f64>],
    max_noise_cost: f64,
    chosen: &mut [Option<usize>],
) {
    let branch =
        |chosen: &[Option<usize>], row: usize| chosen[row].map(|candidate| rows[row][candidate]);
    let before = chosen.to_vec();
    for row in 1..before.len() {
        let (a, b) = (branch(&before, row - 1), branch(&before, row));
        let (Some(a), Some(b)) = (a, b) else { continue };
        if a == b {
            continue;
        }
        for (here, other) in [(row - 1, b), (row, a)] {
            let is_dear =
                before[here].is_some_and(|candidate| costs[here][candidate] > max_noise_cost);
            let has_other = rows[here].contains(&other);
            if is_dear && !has_other {
                chosen[here] = None;
            }
        }
    }
}
