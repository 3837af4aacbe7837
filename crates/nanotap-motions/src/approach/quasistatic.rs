//! The curve of a slow approach, written: rows, jumps, hysteresis and what coexists.

use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::{Control, PeriodicOrbit};
use rayon::prelude::*;

use super::distance_sweep::{
    DistanceSweep, End, FoundMotion, Motion, Piece, Place, budget_text, is_same, up_to_budget,
};
use super::ramp::ramp;
use super::{ApproachPoint, Curve, Hysteresis, StateJump, Way, branching, difference};
use crate::branch::{BranchReport, BranchesThrough, Range};
use crate::simulate::Classification;
use nanotap_case::{Case, CaseError};
use nanotap_error::Error;
use nanotap_study::FreeMotion;

/// What is reported of a curve.
pub(super) struct FollowedCurve {
    pub(super) table: Vec<ApproachPoint>,
    pub(super) jumps: Vec<StateJump>,
    pub(super) coexisting: Vec<ApproachPoint>,
    pub(super) hysteresis: Vec<Hysteresis>,
    /// Whether the two ways were compared everywhere.
    pub(super) compared: bool,
    pub(super) branches: Option<BranchReport>,
    /// Why less was followed than there is.
    pub(super) limits: Vec<String>,
}

/// Steps of the approximate flow after which no more rows are measured, for every hundred distances,
/// so that a longer table is measured as completely.
const ROW_STEPS: u64 = 30_000_000;
/// Steps that finding jumps and comparing the two ways may take.
const COMPARISON_STEPS: u64 = 10_000_000;
/// Steps that branches may take.
const BRANCH_STEPS: u64 = 10_000_000;
/// Points that the branches through a curve have all together, mostly; where steps suffice for fewer,
/// grazings are not located.
const USUAL_POINTS: usize = 1000;
/// Points to which each branch may always be followed.
const MIN_POINTS: usize = 16;
/// Steps after which no more states are looked for from which a census starts.
const SEED_STEPS: u64 = 10_000_000;
/// Rows that are measured before it is seen whether the budget is spent.
const ROWS_AT_ONCE: usize = 16;

/// Both ways of a slowly moved lever.
pub(crate) struct Ways {
    pub(crate) approach: Vec<Piece>,
    pub(crate) retract: Vec<Piece>,
}

impl Ways {
    /// From the free motion to `from` and `to`, and back to `from`.
    pub(crate) fn of(
        sweep: &mut DistanceSweep<'_>,
        from: f64,
        to: f64,
    ) -> Result<(Self, Place), CaseError> {
        let mut place = sweep.free()?;
        if sweep.farthest() > from {
            place = sweep.way(place, from, |_, _| false).1;
        }
        let first = place.clone();
        let (approach, place) = sweep.way(place, to, |_, _| false);
        let retract = match approach.last() {
            Some(last) if last.to == to => sweep.way(place, from, |_, _| false).0,
            _ => Vec::new(),
        };
        Ok((Self { approach, retract }, first))
    }

    fn each(&self) -> [(Way, &[Piece]); 2] {
        [
            (Way::Approach, &self.approach),
            (Way::Retract, &self.retract),
        ]
    }
}

/// The curve at these distances, from far to near.
pub(super) fn followed_curve(
    curve: &Curve<'_>,
    free: &FreeMotion,
    distances: &[f64],
    control: &Control<'_>,
) -> Result<FollowedCurve, Error> {
    let (case, options) = (curve.case, curve.options);
    let (from, to) = (distances[0], distances[distances.len() - 1]);
    let range = (to, from);
    let mut sweep = DistanceSweep::new(case, range, free.reach, options.max_period, control)?;
    let (ways, first) = if curve.speed.is_none() {
        Ways::of(&mut sweep, from, to)?
    } else {
        let mut place = sweep.free()?;
        if sweep.farthest() > from {
            place = sweep.way(place, from, |_, _| false).1;
        }
        let none = Ways {
            approach: Vec::new(),
            retract: Vec::new(),
        };
        (none, place)
    };
    let not_followed = sweep.spent_budget().map(budget_text);
    let not_followed_text = not_followed.as_deref().unwrap_or(NOT_FOLLOWED);
    // A long table must not take the steps that tell whether the two ways differ.
    sweep.allow_steps(COMPARISON_STEPS);
    let written = Written {
        curve,
        sweep: &sweep,
        ways: &ways,
        distances,
        not_followed: not_followed_text,
    };
    let jumps = written.jumps(free.amplitude)?;
    let (hysteresis, compared) = written.hysteresis(free.amplitude)?;
    let not_compared = sweep
        .spent_budget()
        .map(|steps| format!("the two ways were compared {}", up_to_budget(steps)));
    sweep.allow_steps(ROW_STEPS * (distances.len() as u64).div_ceil(100));
    let written = Written {
        curve,
        sweep: &sweep,
        ways: &ways,
        distances,
        not_followed: not_followed_text,
    };
    let table = match curve.speed {
        Some(speed) => ramp(curve, speed, distances, &sweep.state(&first), control)?,
        None => written.table(control)?,
    };
    let coexisting = match curve.speed {
        None => written.coexisting(&table, control)?,
        Some(_) => Vec::new(),
    };
    let not_measured = sweep.spent_budget().map(Written::not_measured);
    let (branches, cut) = branches(curve, &mut sweep, range, control)?;
    let limits = [not_followed, not_compared, not_measured, cut].into_iter();
    let limits = limits.flatten();
    Ok(FollowedCurve {
        jumps,
        hysteresis,
        compared,
        branches,
        table,
        coexisting,
        limits: limits.collect(),
    })
}

/// The branches through every stretch of stable orbits, and why they are cut, if they are.
fn branches(
    curve: &Curve<'_>,
    sweep: &mut DistanceSweep<'_>,
    (near, far): (f64, f64),
    control: &Control<'_>,
) -> Result<(Option<BranchReport>, Option<String>), Error> {
    if !curve.options.branches {
        return Ok((None, None));
    }
    let points = sweep.points_in(BRANCH_STEPS);
    sweep.allow_steps(ROW_STEPS);
    let quiet = Control {
        progress: None,
        ..*control
    };
    let mut how = branching(curve.options);
    let cut = points < USUAL_POINTS;
    if cut {
        // Two ways from each seed.
        let each = points / (2 * sweep.stretches.len()).max(1);
        how.max_points = each.max(MIN_POINTS);
        how.grazings = false;
    }
    let cut = cut.then(|| {
        let points = how.max_points;
        format!(
            "branches were followed for {points} points each way, and without their grazings: an \
             orbit takes too many steps for more"
        )
    });
    let range = Range {
        key: curve.case.gap_key(),
        from: far,
        to: near,
    };
    let mut branches = BranchesThrough::new(curve.case, range, &how)?;
    // A doubled branch is followed from its flip, as deep as the options say.
    let is_doubled = |k: &usize| {
        let ends = sweep.stretches[*k].ends.iter();
        ends.into_iter()
            .any(|(_, end)| matches!(end, End::Meeting { .. }))
    };
    let seeds = (0..sweep.stretches.len())
        .filter(|k| !is_doubled(k))
        .filter_map(|k| {
            let stretch = &sweep.stretches[k];
            let low = stretch.ends[0].0.max(near);
            let high = stretch.ends[1].0.min(far);
            let middle = 0.5 * (low + high);
            let nearest = stretch.points.iter().min_by(|a, b| {
                let apart = |gap: f64| (gap - middle).abs();
                apart(a.parameter).total_cmp(&apart(b.parameter))
            })?;
            if (near..=far).contains(&nearest.parameter) {
                return Some((nearest.parameter, nearest.orbit.clone()));
            }
            (low <= high).then(|| Some((middle, sweep.orbit_at(k, middle)?)))?
        });
    branches.follow(seeds.collect::<Vec<_>>(), &quiet);
    let any = !branches.is_empty() && !control.is_cancelled();
    Ok((any.then(|| branches.report(&quiet)), cut.filter(|_| any)))
}

/// A row of the approach and one of the retraction, as far as they were reached.
type RowPair = (Option<ApproachPoint>, Option<ApproachPoint>);

/// A followed curve and the distances at which it is written.
struct Written<'a> {
    curve: &'a Curve<'a>,
    sweep: &'a DistanceSweep<'a>,
    ways: &'a Ways,
    distances: &'a [f64],
    /// Why the lever was not followed to every distance.
    not_followed: &'a str,
}

/// Distances of an interval at which the two ways are compared, its ends included.
const COMPARED: usize = 9;
/// The same number where a motion has no branch: fewer, since it takes longer, and none at the ends,
/// where another motion begins.
const COMPARED_ON_GRID: usize = 3;

impl Written<'_> {
    fn row(&self, way: Way, gap: f64, motion: FoundMotion) -> Result<ApproachPoint, CaseError> {
        let model = self.sweep.model(gap)?;
        Ok(self.curve.observed(way, gap, &model, motion))
    }

    /// The rows at the written distances, there and back: up to the first that was not reached,
    /// where the work was stopped.
    fn table(&self, control: &Control<'_>) -> Result<Vec<ApproachPoint>, CaseError> {
        let done = AtomicUsize::new(0);
        let mut rows = Vec::with_capacity(self.distances.len());
        // Which rows fail at the end of the budget depends on threads: all that are measured
        // together are then undecided.
        for distances in self.distances.chunks(ROWS_AT_ONCE) {
            if control.is_cancelled() {
                break;
            }
            let measured = self.rows(distances, &done, control)?;
            match self.sweep.spent_budget() {
                None => rows.extend(measured),
                Some(steps) => {
                    let unmeasured = |way: Way, gap: f64| {
                        let motion = FoundMotion::undecided(Self::not_measured(steps), &[]);
                        self.row(way, gap, motion).map(Some)
                    };
                    for &gap in distances {
                        rows.push((
                            unmeasured(Way::Approach, gap)?,
                            unmeasured(Way::Retract, gap)?,
                        ));
                    }
                }
            }
        }
        let (there, mut back): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        back.reverse();
        Ok(there.into_iter().chain(back).map_while(|row| row).collect())
    }

    /// In words that the budget for the rows was spent.
    fn not_measured(steps: u64) -> String {
        format!("the rows were measured {}", up_to_budget(steps))
    }

    /// The rows at some distances, there and back; none that were not reached, where the work was
    /// stopped.
    fn rows(
        &self,
        distances: &[f64],
        done: &AtomicUsize,
        control: &Control<'_>,
    ) -> Result<Vec<RowPair>, CaseError> {
        let count = self.distances.len();
        let report = || {
            if let Some(progress) = control.progress {
                progress(done.fetch_add(1, Ordering::Relaxed) + 1, 2 * count);
            }
        };
        distances
            .par_iter()
            .with_max_len(1)
            .map(|&gap| {
                let on = |pieces: &[Piece]| pieces.iter().find(|p| p.holds(gap)).cloned();
                let of = |way: Way, piece: Option<Piece>| match piece {
                    Some(piece) if !control.is_cancelled() => {
                        let motion = self.sweep.motion_at(&piece, gap);
                        self.row(way, gap, motion).map(Some)
                    }
                    _ if control.is_cancelled() => Ok(None),
                    _ => {
                        let motion = FoundMotion::undecided(self.not_followed.to_owned(), &[]);
                        self.row(way, gap, motion).map(Some)
                    }
                };
                let [there, back] = self.ways.each().map(|(_, pieces)| on(pieces));
                let same = match (&there, &back) {
                    (Some(a), Some(b)) => a.is_on_stretch_of(b),
                    _ => false,
                };
                let there = of(Way::Approach, there)?;
                report();
                let back = if same {
                    let same = there.clone();
                    same.map(|row| ApproachPoint {
                        way: Way::Retract,
                        ..row
                    })
                } else {
                    of(Way::Retract, back)?
                };
                report();
                Ok((there, back))
            })
            .collect()
    }

    /// Orbits of stretches on which neither way is at a distance; none where the work was stopped.
    fn coexisting(
        &self,
        table: &[ApproachPoint],
        control: &Control<'_>,
    ) -> Result<Vec<ApproachPoint>, CaseError> {
        let rows: Result<Vec<Vec<_>>, CaseError> = self
            .distances
            .par_iter()
            .with_max_len(1)
            .map(|&gap| {
                let here = || table.iter().filter(|p| p.gap.to_bits() == gap.to_bits());
                let mut found: Vec<PeriodicOrbit> = Vec::new();
                for (k, stretch) in self.sweep.stretches.iter().enumerate() {
                    let used = |pieces: &[Piece]| {
                        let is_on = |p: &Piece| matches!(p.motion, Motion::Periodic(s) if s == k);
                        pieces.iter().any(|p| p.holds(gap) && is_on(p))
                    };
                    if control.is_cancelled() {
                        break;
                    }
                    if !stretch.holds(gap) || self.ways.each().iter().any(|(_, w)| used(w)) {
                        continue;
                    }
                    let orbit = self.sweep.orbit_at(k, gap).filter(PeriodicOrbit::is_stable);
                    let Some(orbit) = orbit else { continue };
                    let rows = here().filter_map(|p| p.orbit.as_ref());
                    if !rows.chain(&found).any(|other| is_same(other, &orbit)) {
                        found.push(orbit);
                    }
                }
                let found = found.into_iter();
                found
                    .map(|orbit| self.row(Way::Neither, gap, FoundMotion::periodic(orbit)))
                    .collect()
            })
            .collect();
        let rows = rows?.into_iter().flatten();
        // What was found before the budget was spent, or the work was stopped, depends on threads.
        let complete = self.sweep.spent_budget().is_none() && !control.is_cancelled();
        Ok(rows.filter(|_| complete).collect())
    }

    fn jumps(&self, free_amplitude: f64) -> Result<Vec<StateJump>, CaseError> {
        let mut jumps = Vec::new();
        for (way, pieces) in self.ways.each() {
            for pair in pieces.windows(2).filter(|pair| pair[0].jumps) {
                let (before, after) = (&pair[0], &pair[1]);
                let view = self.curve.case.physical();
                let row = |piece: &Piece, gap| self.row(way, gap, self.sweep.motion_at(piece, gap));
                let (mut from, mut to) = (row(before, before.to)?, row(after, after.entered)?);
                let (mut gap, mut uncertainty) = (before.to, before.uncertainty);
                // What did not close on the grid may have come to the same orbit already, at once
                // or by a jump on the way.
                let orbits = from.orbit.as_ref().zip(to.orbit.as_ref());
                if from.gap == to.gap && orbits.is_some_and(|(a, b)| is_same(a, b)) {
                    let Some([last, next]) = self.parting(before, after) else {
                        continue;
                    };
                    (from, to) = (row(before, last)?, row(before, next)?);
                    (gap, uncertainty) = (next, (next - last).abs());
                    if apart(&from, &to) <= JUMP * free_amplitude {
                        continue;
                    }
                }
                jumps.push(StateJump {
                    way,
                    gap,
                    zc: view.map(|view| gap * view.scales.length),
                    uncertainty,
                    zc_uncertainty: view.map(|view| uncertainty * view.scales.length),
                    reason: before.end.to_string(),
                    before: from,
                    after: to,
                });
            }
        }
        Ok(jumps)
    }

    /// The last distance on the grid at which the motion of a piece is not yet on the stretch that
    /// comes after it, and the next; `None` if it is there from the first.
    fn parting(&self, before: &Piece, after: &Piece) -> Option<[f64; 2]> {
        let (Motion::OnGrid(found), Motion::Periodic(stretch)) = (&before.motion, &after.motion)
        else {
            return None;
        };
        let arrived = |(gap, _): &(f64, FoundMotion)| {
            let orbit = self.sweep.stretches[*stretch].holds(*gap);
            let orbit = orbit.then(|| self.sweep.orbit_at(*stretch, *gap)).flatten();
            let here = self.sweep.motion_at(before, *gap).orbit;
            here.zip(orbit).is_some_and(|(a, b)| is_same(&a, &b))
        };
        let first = found.partition_point(|place| !arrived(place));
        let last = found.get(first.checked_sub(1)?)?.0;
        Some([last, found.get(first).map_or(before.to, |(gap, _)| *gap)])
    }

    /// The intervals in which the two ways show different motions, and whether the ways were
    /// compared everywhere.
    fn hysteresis(&self, free_amplitude: f64) -> Result<(Vec<Hysteresis>, bool), CaseError> {
        let (from, to) = (self.distances[0], self.distances[self.distances.len() - 1]);
        let pieces = || self.ways.each().into_iter().flat_map(|(_, pieces)| pieces);
        let mut ends: Vec<f64> = pieces().flat_map(|p| [p.from, p.to]).collect();
        ends.sort_by(|a, b| b.total_cmp(a));
        ends.dedup_by(|a, b| (*a - *b).abs() <= 1e-9 * (from - to));
        // Intervals on branches take few steps and come first. Those compared before the budget is
        // spent do not depend on threads, since they are compared in turn.
        let mut intervals: Vec<_> = ends
            .windows(2)
            .map(|pair| (pair, Comparison::Unknown))
            .collect();
        intervals.sort_by_key(|(pair, _)| !self.is_on_branches(0.5 * (pair[0] + pair[1])));
        for (pair, comparison) in &mut intervals {
            let compared = self.compared(pair[1], pair[0], free_amplitude)?;
            if self.sweep.spent_budget().is_some() {
                break;
            }
            *comparison = compared;
        }
        intervals.sort_by(|(a, _), (b, _)| b[0].total_cmp(&a[0]));
        let unknown = |(_, one): &(_, Comparison)| matches!(one, Comparison::Unknown);
        let compared = !intervals.is_empty() && !intervals.iter().any(unknown);
        let mut found: Vec<Hysteresis> = Vec::new();
        for (pair, comparison) in intervals {
            let Comparison::Different(difference) = comparison else {
                continue;
            };
            match found.last_mut() {
                Some(last) if last.near == pair[0] => {
                    last.near = pair[1];
                    last.difference = last.difference.max(difference);
                }
                _ => found.push(Hysteresis {
                    near: pair[1],
                    far: pair[0],
                    difference,
                    physical: None,
                }),
            }
        }
        Ok((found, compared))
    }

    /// The pieces of the two ways at a distance.
    fn pieces_at(&self, gap: f64) -> [Option<&Piece>; 2] {
        let at = |(_, pieces): (Way, &'_ [Piece])| pieces.iter().position(|p| p.holds(gap));
        let [there, back] = self.ways.each().map(at);
        [
            there.map(|k| &self.ways.approach[k]),
            back.map(|k| &self.ways.retract[k]),
        ]
    }

    /// Whether both ways are on branches at a distance.
    fn is_on_branches(&self, gap: f64) -> bool {
        let is_on = |piece: Option<&Piece>| {
            piece.is_some_and(|piece| matches!(piece.motion, Motion::Periodic(_)))
        };
        self.pieces_at(gap).into_iter().all(is_on)
    }

    /// Compares the two ways between two distances, where each is on one piece.
    fn compared(&self, near: f64, far: f64, free_amplitude: f64) -> Result<Comparison, CaseError> {
        let [Some(there), Some(back)] = self.pieces_at(0.5 * (near + far)) else {
            return Ok(Comparison::Unknown);
        };
        let on_grid = |piece: &Piece| matches!(piece.motion, Motion::OnGrid(_));
        let shares: Vec<f64> = match (on_grid(there), on_grid(back)) {
            (true, true) => return Ok(Comparison::Unknown),
            (false, false) if there.is_on_stretch_of(back) => return Ok(Comparison::Same),
            (false, false) => (0..COMPARED)
                .map(|k| k as f64 / (COMPARED - 1) as f64)
                .collect(),
            _ => (0..COMPARED_ON_GRID)
                .map(|k| (k as f64 + 0.5) / COMPARED_ON_GRID as f64)
                .collect(),
        };
        let rows: Result<Vec<_>, CaseError> = shares
            .into_par_iter()
            .with_max_len(1)
            .map(|share| {
                let gap = near * (1.0 - share) + far * share;
                let row = |way, piece| self.row(way, gap, self.sweep.motion_at(piece, gap));
                Ok((row(Way::Approach, there)?, row(Way::Retract, back)?))
            })
            .collect();
        let rows = rows?;
        let apart = rows
            .iter()
            .filter_map(|(a, b)| difference(a, b, free_amplitude));
        let undecided = |row: &ApproachPoint| row.classification == Classification::Undecided;
        Ok(match apart.reduce(f64::max) {
            Some(largest) => Comparison::Different(largest),
            None if rows.iter().any(|(a, b)| undecided(a) || undecided(b)) => Comparison::Unknown,
            None => Comparison::Same,
        })
    }
}

/// Least change of the lock-in's reading, in free amplitudes, that is a jump where a motion comes to
/// an orbit between two distances of the grid.
const JUMP: f64 = 0.02;

/// The distance between two motions in the plane of a lock-in amplifier; 0 where one is undecided.
fn apart(a: &ApproachPoint, b: &ApproachPoint) -> f64 {
    let reading = |point: &ApproachPoint| {
        let seen = point.observables.as_ref()?;
        let (sin, cos) = nanotap_arithmetic::sin_cos(seen.phase.to_radians());
        Some((seen.first_harmonic * cos, seen.first_harmonic * sin))
    };
    let readings = reading(a).zip(reading(b));
    readings.map_or(0.0, |((x, y), (u, v))| {
        nanotap_arithmetic::hypot(x - u, y - v)
    })
}

/// What is known of the two ways between two distances.
enum Comparison {
    Same,
    /// The amplitudes differ by up to this, in the model's unit of length.
    Different(f64),
    /// A motion is undecided, or neither way is on a branch.
    Unknown,
}

/// Why a row is undecided.
const NOT_FOLLOWED: &str = "the lever was not followed so far: its motion changed too often";

impl Piece {
    fn is_on_stretch_of(&self, other: &Self) -> bool {
        matches!((&self.motion, &other.motion),
            (Motion::Periodic(a), Motion::Periodic(b)) if a == b)
    }
}

/// The stable orbits at a case's own distance on which a slowly moved lever may be: coming from
/// far, coming from the nearest distance, and those to which it jumps elsewhere and which reach
/// as far as here. The case needs a drive that moves the tip.
///
/// # Errors
/// When the case makes no sense.
pub fn states_near(
    case: &Case,
    max_period: usize,
    control: &Control<'_>,
) -> Result<Vec<PeriodicOrbit>, CaseError> {
    let at = case.get(case.gap_key());
    states_at(case, &[at], &[], max_period, control)
        .map(|mut states| states.pop().unwrap_or_default())
}

/// As [`states_near`], at each of some distances; also the stable orbits to which the branches of
/// `known` orbits, each at its distance, lead.
///
/// # Errors
/// As [`states_near`].
pub fn states_at(
    case: &Case,
    distances: &[f64],
    known: &[(f64, PeriodicOrbit)],
    max_period: usize,
    control: &Control<'_>,
) -> Result<Vec<Vec<PeriodicOrbit>>, CaseError> {
    let free = FreeMotion::of(&case.model()?);
    let nothing = || vec![Vec::new(); distances.len()];
    if !(free.reach > 0.0 && free.reach.is_finite()) {
        return Ok(nothing());
    }
    let near = distances.iter().copied().fold(0.0, f64::min);
    let far = distances.iter().copied().fold(near, f64::max);
    if !(near.is_finite() && far.is_finite()) {
        return Ok(nothing());
    }
    let far = far.max(super::BEYOND * free.reach);
    let mut sweep = DistanceSweep::new(case, (near, far), free.reach, max_period, control)?;
    sweep.allow_steps(SEED_STEPS);
    Ways::of(&mut sweep, far, near)?;
    sweep.allow_steps(SEED_STEPS);
    for (gap, orbit) in known {
        if sweep.spent_budget().is_some() || control.is_cancelled() {
            break;
        }
        sweep.on(*gap, orbit.clone());
    }
    sweep.allow_steps(SEED_STEPS);
    Ok(distances
        .iter()
        .map(|&gap| {
            let mut found: Vec<PeriodicOrbit> = Vec::new();
            for (k, stretch) in sweep.stretches.iter().enumerate() {
                let orbit = stretch.holds(gap).then(|| sweep.orbit_at(k, gap)).flatten();
                if let Some(orbit) = orbit.filter(PeriodicOrbit::is_stable)
                    && !found.iter().any(|other| is_same(other, &orbit))
                {
                    found.push(orbit);
                }
            }
            found
        })
        .collect())
}

/// What a motion is, in the rows of a curve at a finite speed.
pub(super) const MOVING: Classification = Classification::Transient;
