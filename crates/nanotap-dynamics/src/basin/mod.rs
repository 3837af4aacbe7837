//! Basins of attraction on a two-dimensional slice of initial states.
//!
//! A start is labelled as soon as it is inside a neighbourhood that contracts to a
//! known attractor ([`crate::neighbourhood`], which says what that proves) and its
//! next return confirms it. Attractors without such a neighbourhood (chaotic ones,
//! tori) cannot capture a start that way: a start that reaches none within the
//! budget is compared with the boxes that hold the strobe points of those
//! attractors, and labelled if its last states stay in exactly one of them.
//!
//! Fails: that comparison is evidence, not proof (a transient may live inside the box
//! of a chaotic attractor); an attractor not in the list leaves its basin unsettled;
//! the label of a start within rounding of a basin boundary is a matter of chance.

use crate::census::{Attractor, AttractorKind};
use crate::failure::{MapFailure, advance, advance_each};
use crate::map::StroboscopicMap;
use crate::neighbourhood::Neighbourhood;
use crate::vector::norm;

/// One axis of a slice: a coordinate and the values it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct SliceAxis {
    /// Which coordinate of the state.
    pub coordinate: usize,
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// How many values, both ends included.
    pub count: usize,
}

impl SliceAxis {
    /// The `index`-th value.
    pub fn value(&self, index: usize) -> f64 {
        if self.count <= 1 {
            return self.from;
        }
        let t = index as f64 / (self.count - 1) as f64;
        self.from + (self.to - self.from) * t
    }
}

/// A grid of initial states: two coordinates vary, the others stay.
#[derive(Clone, Debug, PartialEq)]
pub struct Slice {
    origin: Vec<f64>,
    x: SliceAxis,
    y: SliceAxis,
}

/// Why a basin could not be computed.
#[derive(Clone, Debug, thiserror::Error)]
pub enum BasinError {
    /// An axis that does not fit.
    #[error("bad slice: {0}")]
    Slice(String),
    /// The map cannot be followed on an attractor.
    #[error("an attractor could not be followed")]
    Map(#[from] MapFailure),
}

impl Slice {
    /// The slice through `origin` (a full state) spanned by two axes. Points are
    /// numbered row by row: index = iy · x.count + ix.
    ///
    /// # Errors
    /// If an axis has no points, is not finite, or names a coordinate that the
    /// origin lacks or that the other axis has.
    pub fn new(origin: Vec<f64>, x: SliceAxis, y: SliceAxis) -> Result<Self, BasinError> {
        for axis in [&x, &y] {
            if axis.coordinate >= origin.len() {
                return Err(BasinError::Slice(format!(
                    "coordinate {} of a state of {} (they count from 0)",
                    axis.coordinate,
                    origin.len()
                )));
            }
            if axis.count == 0 || !axis.from.is_finite() || !axis.to.is_finite() {
                return Err(BasinError::Slice(format!(
                    "{} points from {} to {}: one point at least, between finite numbers",
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

    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.count * self.y.count
    }

    /// Never true: an axis has one point at least.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Writes the state at a point to `out`.
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

/// Where a start goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// To the attractor of this index.
    Attractor(u32),
    /// To none of them within the budget.
    Unsettled,
    /// It left every bound.
    Unbounded,
    /// The map could not be followed.
    Failed,
}

/// How long starts are followed.
#[derive(Clone, Debug, PartialEq)]
pub struct BasinOptions {
    /// Periods after which a start is called unsettled.
    pub max_periods: usize,
    /// A state with an entry above this is unbounded.
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

/// Last states of an unsettled start that must lie in an attractor's box.
const LAST: usize = 64;
/// Starts that are followed together: a flow may advance several at a time.
const TOGETHER: usize = 64;
/// Strobe points that the box of an attractor that is no orbit is drawn around.
const CLOUD: usize = 4096;

/// What the chunks of a basin share: ready to be cloned into any thread.
#[derive(Clone, Debug)]
pub struct Basins {
    slice: Slice,
    options: BasinOptions,
    balls: Vec<(u32, Neighbourhood)>,
    boxes: Vec<(u32, Vec<f64>, Vec<f64>)>,
}

impl Basins {
    /// Prepares the attractors of a census (labels are their indices).
    ///
    /// # Errors
    /// If the slice does not fit the map or an attractor cannot be followed.
    pub fn new<M: StroboscopicMap>(
        map: &M,
        slice: Slice,
        attractors: &[Attractor],
        options: BasinOptions,
    ) -> Result<Self, BasinError> {
        let d = map.dimension();
        if slice.origin.len() != d {
            return Err(BasinError::Slice(format!(
                "the origin has {} numbers, {d} are needed",
                slice.origin.len()
            )));
        }
        let mut map = map.clone();
        let mut balls = Vec::new();
        let mut boxes = Vec::new();
        for (label, attractor) in attractors.iter().enumerate() {
            let label = label as u32;
            let ball = match &attractor.kind {
                AttractorKind::Periodic(orbit) => Neighbourhood::around(&mut map, orbit)?,
                _ => None,
            };
            if let Some(ball) = ball {
                balls.push((label, ball));
            } else {
                let (low, high) = cloud(&mut map, &attractor.state)?;
                boxes.push((label, low, high));
            }
        }
        Ok(Self {
            slice,
            options,
            balls,
            boxes,
        })
    }

    /// Number of points of the slice.
    pub fn len(&self) -> usize {
        self.slice.len()
    }

    /// Never true: a slice has one point at least.
    pub fn is_empty(&self) -> bool {
        self.slice.is_empty()
    }

    /// Labels of the points of a range of indices (cut at the end of the slice). A
    /// pure function: chunks may be computed anywhere, in any order.
    pub fn chunk<M: StroboscopicMap>(
        &self,
        map: &mut M,
        range: std::ops::Range<usize>,
    ) -> Vec<Label> {
        let points: Vec<usize> = (range.start..range.end.min(self.len())).collect();
        self.labels(map, &points)
    }

    /// The same of any points. Many at a time may be faster than each alone, and come to the same.
    pub fn labels<M: StroboscopicMap>(&self, map: &mut M, points: &[usize]) -> Vec<Label> {
        let mut labels = vec![Label::Unsettled; points.len()];
        for (points, labels) in points.chunks(TOGETHER).zip(labels.chunks_mut(TOGETHER)) {
            self.label(map, points, labels);
        }
        labels
    }

    /// Labels some points, whose motions are followed together.
    fn label<M: StroboscopicMap>(&self, map: &mut M, points: &[usize], labels: &mut [Label]) {
        let d = map.dimension();
        let mut scratch = vec![0.0; d];
        let mut states = vec![0.0; d * points.len()];
        for (state, &point) in states.chunks_exact_mut(d).zip(points) {
            self.slice.state(point, state);
        }
        let mut runs: Vec<Run<'_>> = (0..points.len())
            .map(|number| Run::new(number, self))
            .collect();
        let mut periods = Vec::with_capacity(points.len());
        while !runs.is_empty() {
            let (mut going_on, mut left) = (Vec::with_capacity(states.len()), Vec::new());
            periods.clear();
            for (mut run, state) in runs.into_iter().zip(states.chunks_exact(d)) {
                match self.look(map, &mut run, state, &mut scratch) {
                    Ok(Look::Again(after)) => {
                        going_on.extend_from_slice(state);
                        periods.push(after);
                        run.period += after;
                        left.push(run);
                    }
                    Ok(Look::Settled(label)) => labels[run.number] = label,
                    Err(failure) => labels[run.number] = label_of(&failure),
                }
            }
            let advanced = advance_each(map, &mut going_on, &periods);
            (runs, states) = (Vec::with_capacity(left.len()), Vec::new());
            let each = left.into_iter().zip(going_on.chunks_exact(d));
            for ((run, state), result) in each.zip(advanced) {
                match result {
                    Ok(()) => {
                        states.extend_from_slice(state);
                        runs.push(run);
                    }
                    Err(failure) => labels[run.number] = label_of(&failure),
                }
            }
        }
    }

    /// Looks where a run is: its label, or in how many periods to look again.
    fn look<M: StroboscopicMap>(
        &self,
        map: &mut M,
        run: &mut Run<'_>,
        state: &[f64],
        scratch: &mut [f64],
    ) -> Result<Look, MapFailure> {
        let (max_periods, period) = (self.options.max_periods, run.period);
        let size = norm(state);
        if size > self.options.bound {
            return Ok(Look::Settled(Label::Unbounded));
        }
        for (label, ball) in &self.balls {
            if ball.contains(state) && ball.holds(map, state, scratch)? {
                return Ok(Look::Settled(Label::Attractor(*label)));
            }
        }
        if period + LAST > max_periods {
            for (flag, (_, low, high)) in run.inside.iter_mut().zip(&self.boxes) {
                *flag &= state
                    .iter()
                    .zip(low.iter().zip(high))
                    .all(|(x, (l, h))| l <= x && x <= h);
            }
        }
        if period == max_periods {
            let mut held = self.boxes.iter().zip(&run.inside).filter(|(_, f)| **f);
            return Ok(Look::Settled(match (held.next(), held.next()) {
                (Some(((label, ..), _)), None) => Label::Attractor(*label),
                _ => Label::Unsettled,
            }));
        }
        // The last states are all looked at, and those of a motion that may run off.
        let unwatched = (max_periods + 1).saturating_sub(period + LAST);
        Ok(Look::Again(if size > SMALL * self.options.bound {
            1
        } else {
            run.wait.after(state).min(unwatched).max(1)
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
struct Run<'a> {
    /// Whose label it is.
    number: usize,
    /// Periods so far.
    period: usize,
    /// Boxes that have held every one of the last states.
    inside: Vec<bool>,
    wait: Wait<'a>,
}

impl<'a> Run<'a> {
    fn new(number: usize, basins: &'a Basins) -> Self {
        Self {
            number,
            period: 0,
            inside: vec![true; basins.boxes.len()],
            wait: Wait::new(&basins.balls),
        }
    }
}

/// What comes of a look at a run.
enum Look {
    Settled(Label),
    /// It is to be looked at again after so many periods.
    Again(usize),
}

/// How long a start need not be looked at: half of what it would take to the nearest ball at
/// the ball's own rate. A start that is in a ball meanwhile stays there, so this decides nothing
/// but when its label is found.
struct Wait<'a> {
    balls: &'a [(u32, Neighbourhood)],
    /// Looks in a row that see every phase of every orbit.
    phases: usize,
    looks: usize,
    /// Periods to the nearest ball in any of these looks.
    nearest: f64,
}

/// Periods that a start is not looked at, at most.
const LONGEST_WAIT: f64 = 64.0;
/// Size of a state, as a part of the bound, up to which it may be left alone.
const SMALL: f64 = 1e-4;

impl<'a> Wait<'a> {
    fn new(balls: &'a [(u32, Neighbourhood)]) -> Self {
        Self {
            balls,
            phases: balls.iter().map(|(_, b)| b.period()).max().unwrap_or(1),
            looks: 0,
            nearest: f64::INFINITY,
        }
    }

    /// Periods to the next look, after one at `state`.
    fn after(&mut self, state: &[f64]) -> usize {
        for (_, ball) in self.balls {
            self.nearest = self.nearest.min(ball.periods_away(state));
        }
        self.looks += 1;
        if self.looks < self.phases {
            return 1;
        }
        let wait = (0.5 * self.nearest).min(LONGEST_WAIT);
        self.looks = 0;
        self.nearest = f64::INFINITY;
        wait as usize
    }
}

/// The box around a stretch of an attractor, widened by a twentieth.
fn cloud<M: StroboscopicMap>(
    map: &mut M,
    state: &[f64],
) -> Result<(Vec<f64>, Vec<f64>), MapFailure> {
    let mut x = state.to_vec();
    let (mut low, mut high) = (x.clone(), x.clone());
    for _ in 0..CLOUD {
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
