//! Basins of attraction on a two-dimensional slice of initial states.
//!
//! A start gets its label as soon as it is inside a neighbourhood that contracts to a known
//! attractor ([`crate::neighbourhood`] explains what that proves) and its next return confirms the
//! contraction. Chaotic attractors and tori have no such neighbourhood. A start that reaches no
//! neighbourhood within the budget is compared with the boxes around the strobe points of those
//! attractors. It gets a label if its last states all lie in exactly one box.
//!
//! Fails: the comparison with boxes is evidence, not proof (a transient may stay inside the box of
//! a chaotic attractor); starts that go to an attractor missing from the list stay unsettled; the
//! label of a start within rounding of a basin boundary is arbitrary.

use std::sync::OnceLock;

use crate::census::{Attractor, AttractorKind};
use crate::classify::{ClassifyOptions, KnownMotions, MotionKind, classify_reset};
use crate::failure::{MapFailure, advance, advance_each_until_reset};
use crate::map::StroboscopicMap;
use crate::neighbourhood::Neighbourhood;
use crate::orbit::PeriodicOrbit;
use crate::vector::norm;

/// One axis of a slice: a coordinate and its evenly spaced values.
#[derive(Clone, Debug, PartialEq)]
pub struct SliceAxis {
    /// Index of the coordinate in the state.
    pub coordinate: usize,
    /// First value, in the unit of the coordinate.
    pub from: f64,
    /// Last value, in the unit of the coordinate; may be below `from`.
    pub to: f64,
    /// Number of values, both ends included.
    pub count: usize,
}

impl SliceAxis {
    /// The value with this index, counted from 0.
    pub fn value(&self, index: usize) -> f64 {
        if self.count <= 1 {
            return self.from;
        }
        let t = index as f64 / (self.count - 1) as f64;
        self.from + (self.to - self.from) * t
    }
}

/// A grid of initial states: two coordinates vary, the others are fixed.
#[derive(Clone, Debug, PartialEq)]
pub struct Slice {
    origin: Vec<f64>,
    x: SliceAxis,
    y: SliceAxis,
}

/// Why a basin could not be computed.
#[derive(Clone, Debug, thiserror::Error)]
pub enum BasinError {
    /// The slice does not fit the map, or an axis is invalid.
    #[error("invalid slice: {0}")]
    Slice(String),
    /// The map failed on an attractor.
    #[error("the map failed on an attractor")]
    Map(#[from] MapFailure),
}

impl Slice {
    /// Creates the slice through `origin` (a full state) that two axes span. Points are numbered
    /// row by row: index = iy · x.count + ix.
    ///
    /// # Errors
    /// If an axis has no points or non-finite ends, if its coordinate does not exist, if both axes
    /// have the same coordinate, or if the origin is not finite.
    pub fn new(origin: Vec<f64>, x: SliceAxis, y: SliceAxis) -> Result<Self, BasinError> {
        for axis in [&x, &y] {
            if axis.coordinate >= origin.len() {
                return Err(BasinError::Slice(format!(
                    "coordinate {} does not exist: the state has {} coordinates, counted from 0",
                    axis.coordinate,
                    origin.len()
                )));
            }
            if axis.count == 0 || !axis.from.is_finite() || !axis.to.is_finite() {
                return Err(BasinError::Slice(format!(
                    "an axis needs at least 1 point and finite ends, got {} points from {} to {}",
                    axis.count, axis.from, axis.to
                )));
            }
        }
        if x.coordinate == y.coordinate {
            return Err(BasinError::Slice(format!(
                "both axes vary coordinate {}",
                x.coordinate
            )));
        }
        if origin.iter().any(|v| !v.is_finite()) {
            return Err(BasinError::Slice("the origin is not finite".into()));
        }
        Ok(Self { origin, x, y })
    }

    /// Number of points of the grid.
    pub fn len(&self) -> usize {
        self.x.count * self.y.count
    }

    /// Always false: an axis has at least one point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Writes the state of a grid point to `out` (length: dimension of the state).
    pub fn state(&self, index: usize, out: &mut [f64]) {
        out.copy_from_slice(&self.origin);
        out[self.x.coordinate] = self.x.value(index % self.x.count);
        out[self.y.coordinate] = self.y.value(index / self.x.count);
    }

    /// The axes, x then y.
    pub fn axes(&self) -> (&SliceAxis, &SliceAxis) {
        (&self.x, &self.y)
    }
}

/// Result for one initial state of a slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// It goes to the attractor with this index.
    Attractor(u32),
    /// It reached no attractor within the budget.
    Unsettled,
    /// A state exceeded the bound or overflowed.
    Unbounded,
    /// The map returned an error, so the run could not go on.
    Failed,
}

/// Limits on the run from each initial state.
#[derive(Clone, Debug, PartialEq)]
pub struct BasinOptions {
    /// Drive periods after which a start is called unsettled.
    pub max_periods: usize,
    /// Largest entry of a bounded state, in units of the state.
    pub bound: f64,
}

impl Default for BasinOptions {
    fn default() -> Self {
        Self {
            max_periods: 5000,
            bound: 1e8,
        }
    }
}

/// Number of last states of an unsettled start that must lie in an attractor's box.
const LAST_STATES: usize = 64;
/// Number of starts that are followed together: some flows advance several at a time.
const BATCH_SIZE: usize = 64;
/// Number of strobe points that define the box of a non-periodic attractor.
const BOX_POINTS: usize = 4096;

/// Labels points of a slice; immutable, so that threads can share it.
#[derive(Clone, Debug)]
pub struct Basins {
    slice: Slice,
    options: BasinOptions,
    balls: Vec<(u32, Neighbourhood)>,
    boxes: Vec<(u32, Vec<f64>, Vec<f64>)>,
    orbits: Vec<(u32, PeriodicOrbit)>,
    /// Label of starts that are reset ([`StroboscopicMap::resets`]), once one was.
    after_reset: OnceLock<Label>,
}

impl Basins {
    /// Prepares neighbourhoods or boxes for the attractors of a census. A label is the index of an
    /// attractor.
    ///
    /// # Errors
    /// If the slice does not fit the map, or the map fails on an attractor.
    pub fn new<M: StroboscopicMap>(
        map: &M,
        slice: Slice,
        attractors: &[Attractor],
        options: BasinOptions,
    ) -> Result<Self, BasinError> {
        let d = map.dimension();
        if slice.origin.len() != d {
            return Err(BasinError::Slice(format!(
                "the origin has length {}, expected {d}",
                slice.origin.len()
            )));
        }
        let mut map = map.clone();
        let mut balls = Vec::new();
        let mut boxes = Vec::new();
        let mut orbits = Vec::new();
        for (label, attractor) in attractors.iter().enumerate() {
            let label = label as u32;
            let (ball, is_superstable) = match &attractor.kind {
                AttractorKind::Periodic(orbit) => {
                    orbits.push((label, orbit.clone()));
                    let is_superstable = orbit.is_superstable();
                    (Neighbourhood::around(&mut map, orbit)?, is_superstable)
                }
                _ => (None, false),
            };
            if let Some(ball) = ball {
                balls.push((label, ball));
            } else if !is_superstable {
                // Starts come to a superstable orbit by a reset, if not by its neighbourhood.
                let (low, high) = bounding_box(&mut map, &attractor.state)?;
                boxes.push((label, low, high));
            }
        }
        Ok(Self {
            slice,
            options,
            balls,
            boxes,
            orbits,
            after_reset: OnceLock::new(),
        })
    }

    /// Label of a start that was reset: that of the motion that follows every reset.
    fn label_after_reset<M: StroboscopicMap>(&self, map: &mut M) -> Label {
        *self.after_reset.get_or_init(|| {
            let options = ClassifyOptions::default();
            match classify_reset(map, KnownMotions::default(), &options).kind {
                MotionKind::Periodic(orbit) | MotionKind::TransientChaos { orbit, .. } => {
                    let mut known = self.orbits.iter();
                    let own = known.find(|(_, known)| known.is_same_as(&orbit));
                    own.map_or(Label::Unsettled, |(label, _)| Label::Attractor(*label))
                }
                _ => Label::Unsettled,
            }
        })
    }

    /// Number of points of the slice.
    pub fn len(&self) -> usize {
        self.slice.len()
    }

    /// Always false: a slice has at least one point.
    pub fn is_empty(&self) -> bool {
        self.slice.is_empty()
    }

    /// Labels the points of a range of indices, cut at the end of the slice. The result does not
    /// depend on how a slice is divided into ranges, nor on their order.
    pub fn chunk<M: StroboscopicMap>(
        &self,
        map: &mut M,
        range: std::ops::Range<usize>,
    ) -> Vec<Label> {
        let points: Vec<usize> = (range.start..range.end.min(self.len())).collect();
        self.labels(map, &points)
    }

    /// Labels points given by their indices. Many points in one call may be faster; the labels are
    /// the same.
    pub fn labels<M: StroboscopicMap>(&self, map: &mut M, points: &[usize]) -> Vec<Label> {
        let mut labels = vec![Label::Unsettled; points.len()];
        for (points, labels) in points.chunks(BATCH_SIZE).zip(labels.chunks_mut(BATCH_SIZE)) {
            self.label(map, points, labels);
        }
        labels
    }

    /// Labels one batch of points, whose motions are followed together.
    fn label<M: StroboscopicMap>(&self, map: &mut M, points: &[usize], labels: &mut [Label]) {
        let d = map.dimension();
        let mut scratch = vec![0.0; d];
        let mut states = vec![0.0; d * points.len()];
        for (state, &point) in states.chunks_exact_mut(d).zip(points) {
            self.slice.state(point, state);
        }
        let mut runs: Vec<Trajectory<'_>> = (0..points.len())
            .map(|number| Trajectory::new(number, self))
            .collect();
        let mut periods = Vec::with_capacity(points.len());
        while !runs.is_empty() {
            let (mut continuing, mut remaining) = (Vec::with_capacity(states.len()), Vec::new());
            periods.clear();
            for (mut run, state) in runs.into_iter().zip(states.chunks_exact(d)) {
                match self.check(map, &mut run, state, &mut scratch) {
                    Ok(Check::After(after)) => {
                        continuing.extend_from_slice(state);
                        periods.push(after);
                        run.period += after;
                        remaining.push(run);
                    }
                    Ok(Check::Done(label)) => labels[run.number] = label,
                    Err(failure) => labels[run.number] = label_of(&failure),
                }
            }
            let advanced = advance_each_until_reset(map, &mut continuing, &periods);
            (runs, states) = (Vec::with_capacity(remaining.len()), Vec::new());
            let each = remaining.into_iter().zip(continuing.chunks_exact(d));
            for ((run, state), (result, is_reset)) in each.zip(advanced) {
                match result {
                    Ok(()) if is_reset => labels[run.number] = self.label_after_reset(map),
                    Ok(()) => {
                        states.extend_from_slice(state);
                        runs.push(run);
                    }
                    Err(failure) => labels[run.number] = label_of(&failure),
                }
            }
        }
    }

    /// Checks where a trajectory is: returns its label, or the periods to the next check.
    fn check<M: StroboscopicMap>(
        &self,
        map: &mut M,
        run: &mut Trajectory<'_>,
        state: &[f64],
        scratch: &mut [f64],
    ) -> Result<Check, MapFailure> {
        let (max_periods, period) = (self.options.max_periods, run.period);
        let size = norm(state);
        if size > self.options.bound {
            return Ok(Check::Done(Label::Unbounded));
        }
        for (label, ball) in &self.balls {
            if ball.contains(state) && ball.holds(map, state, scratch)? {
                return Ok(Check::Done(Label::Attractor(*label)));
            }
        }
        if period + LAST_STATES > max_periods {
            for (flag, (_, low, high)) in run.inside.iter_mut().zip(&self.boxes) {
                *flag &= state
                    .iter()
                    .zip(low.iter().zip(high))
                    .all(|(x, (l, h))| l <= x && x <= h);
            }
        }
        if period == max_periods {
            let mut held = self.boxes.iter().zip(&run.inside).filter(|(_, f)| **f);
            return Ok(Check::Done(match (held.next(), held.next()) {
                (Some(((label, ..), _)), None) => Label::Attractor(*label),
                _ => Label::Unsettled,
            }));
        }
        // Every one of the last states is checked, and so is every state of a motion that may
        // escape.
        let unchecked = (max_periods + 1).saturating_sub(period + LAST_STATES);
        Ok(Check::After(if size > SMALL_STATE * self.options.bound {
            1
        } else {
            run.schedule.next_after(state).min(unchecked).max(1)
        }))
    }
}

fn label_of(failure: &MapFailure) -> Label {
    match failure {
        MapFailure::NotFinite => Label::Unbounded,
        MapFailure::Refused(_) => Label::Failed,
    }
}

/// A start that is being followed.
struct Trajectory<'a> {
    /// Index of the start's label in its batch.
    number: usize,
    /// Drive periods run so far.
    period: usize,
    /// For each box: whether it contained all of the last states.
    inside: Vec<bool>,
    schedule: CheckSchedule<'a>,
}

impl<'a> Trajectory<'a> {
    fn new(number: usize, basins: &'a Basins) -> Self {
        Self {
            number,
            period: 0,
            inside: vec![true; basins.boxes.len()],
            schedule: CheckSchedule::new(&basins.balls),
        }
    }
}

/// Result of checking where a trajectory is.
enum Check {
    Done(Label),
    /// Check again after this many periods.
    After(usize),
}

/// Decides when a trajectory is checked next: after half of the time that it would take to reach
/// the nearest ball at the ball's own rate. A trajectory that enters a ball in the meantime stays
/// there, so only the time of its label depends on this.
struct CheckSchedule<'a> {
    balls: &'a [(u32, Neighbourhood)],
    /// Consecutive checks that cover every phase of every orbit.
    phases: usize,
    checks: usize,
    /// Smallest number of periods to a ball in these checks.
    nearest: f64,
}

/// Longest time between checks, in periods.
const MAX_CHECK_INTERVAL: f64 = 64.0;
/// Largest state, as a fraction of the bound, for which checks may be skipped.
const SMALL_STATE: f64 = 1e-4;

impl<'a> CheckSchedule<'a> {
    fn new(balls: &'a [(u32, Neighbourhood)]) -> Self {
        Self {
            balls,
            phases: balls.iter().map(|(_, b)| b.period()).max().unwrap_or(1),
            checks: 0,
            nearest: f64::INFINITY,
        }
    }

    /// Periods to the next check after one at `state`.
    fn next_after(&mut self, state: &[f64]) -> usize {
        for (_, ball) in self.balls {
            self.nearest = self.nearest.min(ball.periods_away(state));
        }
        self.checks += 1;
        if self.checks < self.phases {
            return 1;
        }
        let interval = (0.5 * self.nearest).min(MAX_CHECK_INTERVAL);
        self.checks = 0;
        self.nearest = f64::INFINITY;
        interval as usize
    }
}

/// The bounding box of 4096 strobe points of an attractor, widened by 5 % on each side.
fn bounding_box<M: StroboscopicMap>(
    map: &mut M,
    state: &[f64],
) -> Result<(Vec<f64>, Vec<f64>), MapFailure> {
    let mut x = state.to_vec();
    let (mut low, mut high) = (x.clone(), x.clone());
    for _ in 0..BOX_POINTS {
        advance(map, &mut x)?;
        for (v, (l, h)) in x.iter().zip(low.iter_mut().zip(&mut high)) {
            *l = l.min(*v);
            *h = h.max(*v);
        }
    }
    for (l, h) in low.iter_mut().zip(&mut high) {
        let margin = 0.05 * (*h - *l);
        *l -= margin;
        *h += margin;
    }
    Ok((low, high))
}
