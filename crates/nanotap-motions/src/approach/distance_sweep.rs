//! Quasi-static motion of the lever along the distance.
//!
//! A lever that is brought near slowly stays on its branch of stable orbits until that ends: at
//! a fold, at a bifurcation that destabilises it, where it grazes and does not go on, or where
//! its law has no motion any more. So branches are continued, and a run is needed only at their
//! ends: it starts near the last stable orbit, just beyond the end, and where it goes the lever
//! jumps. At a flip with a stable doubled branch beyond it the lever goes on along that one. A
//! motion that does not close is followed on a grid of distances that depends on the case alone,
//! until an orbit is found there, whose branch is then continued back to its beginning as well.
//!
//! The work is counted in steps of the flow and ends at a budget ([`SWEEP_STEPS`]): what was followed by
//! then is kept, with the reason why it goes no further.
//!
//! Fails: what a motion that does not close meets within a step of the grid is not seen. Where it ends
//! by a jump, the place is bisected to a thousandth of such a step: chaos that ends lives for long near
//! its end, so that the place depends on how long it is followed.

use std::fmt;

use nanotap_dynamics::{
    Bifurcation, BifurcationKind, Branch, BranchEnd, BranchPoint, CancelFlag, ClassifyOptions,
    ContinuationOptions, Control, Direction, LyapunovOptions, MotionKind, PeriodicOrbit,
    Scheduling as _, ShootingOptions, UndecidedReason, classify, close_orbit,
    close_orbit_from_points, continue_orbit, switch_at_flip,
};

use crate::branch::kind_name;
use crate::short_run::short_run;
use crate::simulate::{Classification, NamedMotion};
use nanotap_case::{Case, CaseError, Family};
use nanotap_model::Model;
use nanotap_model::model_map::ModelMap;
use nanotap_quantity::number::shortest;

use super::BEYOND;

/// Steps of the grid on which motions without a branch are followed, in the scale of distances.
const GRID: f64 = 100.0;
/// Longest period of continued orbits, drive periods.
const LONGEST_BRANCH: usize = 8;
/// Distance between places, in the scale of distances, that are one.
const SAME_PLACE: f64 = 1e-7;
/// Distances beyond a fold, in the scale of distances, at which the jump is followed, and how far
/// from the orbit at the fold the run starts, as a part of its size, towards the unstable side.
/// The farther ones serve where the run from the nearer ones stays near the fold for too long.
const BEYOND_FOLD: [(f64, f64); 2] = [(1e-4, 0.05), (1e-3, 0.1)];
/// The same beyond other ends, where a disturbance grows in proportion to the distance.
const BEYOND_END: (f64, f64) = (1e-3, 0.01);
/// Part of an orbit's size by which a motion may differ and still be its continuation.
const CONTINUOUS: f64 = 0.05;
/// How often a grid step is halved where no motion can be followed over it.
const HALVINGS: usize = 6;
/// How often a step of the grid is halved over which a motion without a branch ends by a jump.
const BISECTIONS: usize = 10;
/// Smallest step that is halved, in steps of the grid.
const MIN_GRID_STEP: f64 = 1e-3;
/// Branches and stretches without an orbit after which a way is not followed further.
const MAX_PIECES: usize = 400;
/// Points after which a branch is not followed further.
const MAX_POINTS: usize = 2000;
/// Periods in which a motion that is followed on the grid may close at each of its distances.
const GRID_TRANSIENT: usize = 512;
/// Periods after which a motion is measured that starts on the motion of the grid's distance before.
const ROW_TRANSIENT: usize = 128;
/// Decay times that a jump is given to settle.
const DECAY_TIMES: f64 = 30.0;
/// Most drive periods that a jump is given to settle.
const MAX_TRANSIENT: usize = 1 << 15;

/// Steps after which a motion is not followed further along the distance.
pub(crate) const SWEEP_STEPS: u64 = 30_000_000;

/// Reason why a piece of a path ends.
#[derive(Clone, Debug)]
pub(crate) enum End {
    /// The range of distances ends.
    Range,
    /// The orbits lose stability; holds the first unstable one.
    Bifurcation {
        at: Box<Bifurcation>,
        unstable: Option<Box<PeriodicOrbit>>,
    },
    /// The orbits meet a branch of this shorter period.
    Meeting { period: usize },
    /// A motion without a branch goes over into one that has one.
    Closes,
    /// The branch could not be followed further.
    Lost(String),
    /// The budget of steps was spent.
    Budget(u64),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range => f.write_str("the end of the range"),
            Self::Bifurcation { at, .. } => f.write_str(kind_name(at.kind)),
            Self::Meeting { period } => write!(f, "meets period {period}"),
            Self::Closes => f.write_str("becomes periodic"),
            Self::Lost(reason) => f.write_str(reason),
            Self::Budget(steps) => f.write_str(&budget_text(*steps)),
        }
    }
}

/// Describes in words that a budget of steps was spent.
pub(crate) fn budget_text(steps: u64) -> String {
    format!("the lever was followed {}", up_to_budget(steps))
}

/// Describes in words that any work reached its budget of steps.
pub(crate) fn up_to_budget(steps: u64) -> String {
    let millions = steps as f64 / 1e6;
    format!("up to the budget of {} million steps", shortest(millions))
}

/// A stretch of a branch on which all orbits are stable, by ascending distance.
#[derive(Clone, Debug)]
pub(crate) struct Stretch {
    pub(crate) period: usize,
    pub(crate) points: Vec<BranchPoint>,
    /// The least and the greatest distance, and why it ends there.
    pub(crate) ends: [(f64, End); 2],
}

impl Stretch {
    pub(crate) fn holds(&self, gap: f64) -> bool {
        (self.ends[0].0..=self.ends[1].0).contains(&gap)
    }

    fn end(&self, direction: Direction) -> &(f64, End) {
        &self.ends[usize::from(direction == Direction::Increasing)]
    }
}

/// A motion and the state that starts it.
#[derive(Clone, Debug)]
pub(crate) struct FoundMotion {
    pub(crate) classification: Classification,
    pub(crate) evidence: String,
    pub(crate) orbit: Option<PeriodicOrbit>,
    pub(crate) state: Vec<f64>,
    /// Whether the motion from the start could not be computed.
    failed: bool,
    /// Whether the motion is on an orbit, stable or not.
    closes: bool,
    /// Whether only an orbit was searched for, so that the class is not known otherwise.
    only_searched: bool,
}

impl FoundMotion {
    pub(crate) fn periodic(orbit: PeriodicOrbit) -> Self {
        Self {
            classification: Classification::Periodic,
            evidence: String::new(),
            state: orbit.states.first().cloned().unwrap_or_default(),
            orbit: Some(orbit),
            failed: false,
            closes: true,
            only_searched: false,
        }
    }

    pub(crate) fn undecided(evidence: String, state: &[f64]) -> Self {
        Self {
            classification: Classification::Undecided,
            evidence,
            orbit: None,
            state: state.to_vec(),
            failed: true,
            closes: false,
            only_searched: false,
        }
    }

    /// Returns the state in which the motion at the next distance starts: rest if this motion is
    /// unbounded.
    fn next_start(&self) -> Vec<f64> {
        match self.classification {
            Classification::Unbounded => vec![0.0; self.state.len()],
            _ => self.state.clone(),
        }
    }
}

/// Motion of the lever along a piece of its path.
#[derive(Clone, Debug)]
pub(crate) enum Motion {
    /// The stable orbits of a stretch, by its index.
    Periodic(usize),
    /// A motion without a branch that is followed, as it was found at distances in the order of
    /// the way: none that closes, or one of a long period.
    OnGrid(Vec<(f64, FoundMotion)>),
}

/// A piece of a way.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// Distances between which the piece lies, in the order of the way and in the model's unit of
    /// length.
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) motion: Motion,
    /// Distance at which the motion was first seen, in the model's unit of length.
    pub(crate) entered: f64,
    /// Reason why the piece ends.
    pub(crate) end: End,
    /// Whether the lever jumps there.
    pub(crate) jumps: bool,
    /// Uncertainty of the distance at which the piece ends, in the model's unit of length.
    pub(crate) uncertainty: f64,
}

impl Piece {
    pub(crate) fn holds(&self, gap: f64) -> bool {
        gap >= self.from.min(self.to) && gap <= self.from.max(self.to)
    }
}

/// The lever's motion at a distance.
#[derive(Clone, Debug)]
pub(crate) enum Place {
    On { stretch: usize, gap: f64 },
    Off { gap: f64, motion: FoundMotion },
}

/// Motions followed along the distance.
pub(crate) struct DistanceSweep<'a> {
    /// With the flag of the present budget.
    case: Case,
    family: Family,
    /// The least and the greatest distance.
    range: (f64, f64),
    /// The unit in which small differences of distances are measured.
    scale: f64,
    classify: ClassifyOptions,
    control: &'a Control<'a>,
    /// Flag that cancels the work: when the caller does, or when the budget is spent.
    flag: CancelFlag,
    is_nonlinear: bool,
    /// Steps and points of the stretches that were continued.
    continued: (u64, usize),
    /// Whether a motion that is followed on the grid is one piece per step.
    pub(crate) piece_a_step: bool,
    pub(crate) stretches: Vec<Stretch>,
}

impl<'a> DistanceSweep<'a> {
    /// Prepares the sweep of a case between two distances. `reach` is how far the free tip swings,
    /// in the model's unit of length.
    pub(crate) fn new(
        case: &Case,
        (near, far): (f64, f64),
        reach: f64,
        max_period: usize,
        control: &'a Control<'a>,
    ) -> Result<Self, CaseError> {
        let swings = reach > 0.0 && reach.is_finite();
        let far = if swings { far.max(BEYOND * reach) } else { far };
        let short = short_run(max_period);
        let model = case.with(case.gap_key(), far).model()?;
        // The slowest decay of the free lever, by its trace.
        let rate = model.system.regimes().first().map_or(0.0, |free| {
            let matrix = free.matrix();
            -matrix.trace() / matrix.nrows().max(1) as f64 * model.system.drive().period()
        });
        let decays = (DECAY_TIMES / rate).min(MAX_TRANSIENT as f64);
        let decays = if decays.is_nan() { 0 } else { decays as usize };
        let mut sweep = Self {
            case: case.clone(),
            family: case.family(case.gap_key()),
            range: (near, far),
            scale: if swings { reach } else { far - near },
            classify: ClassifyOptions {
                first_look: 4,
                max_transient: decays.max(2048).next_power_of_two(),
                lyapunov: LyapunovOptions {
                    max_periods: 1000,
                    ..short.lyapunov
                },
                birkhoff_periods: 1024,
                ..short
            },
            control,
            flag: CancelFlag::default(),
            is_nonlinear: model.nonlinear.is_some(),
            continued: (0, 0),
            piece_a_step: false,
            stretches: Vec::new(),
        };
        sweep.allow_steps(SWEEP_STEPS);
        Ok(sweep)
    }

    /// Allows so many steps from here on.
    pub(crate) fn allow_steps(&mut self, steps: u64) {
        let flag = self.control.cancel.unwrap_or(self.case.cancel());
        self.flag = flag.with_budget(steps);
        self.case = self.case.with_flag(&self.flag);
        self.family = self.case.family(self.case.gap_key());
    }

    /// Returns the control that cancels the work: when the caller does, or when the budget is
    /// spent.
    pub(crate) fn limited(&self) -> Control<'_> {
        Control {
            cancel: Some(&self.flag),
            progress: None,
        }
    }

    /// The budget, if it is spent.
    pub(crate) fn spent_budget(&self) -> Option<u64> {
        self.flag.budget().filter(|_| self.flag.is_spent())
    }

    /// Returns the number of points of branches for which `steps` suffice, by the average so far;
    /// `usize::MAX` where steps are not counted.
    pub(crate) fn points_in(&self, steps: u64) -> usize {
        let (taken, points) = self.continued;
        let points = steps.saturating_mul(points as u64).checked_div(taken);
        points.map_or(usize::MAX, |points| points as usize)
    }

    /// The greatest distance: that of the free motion, or beyond.
    pub(crate) const fn farthest(&self) -> f64 {
        self.range.1
    }

    pub(crate) fn model(&self, gap: f64) -> Result<Model, CaseError> {
        self.case.with(self.case.gap_key(), gap).model()
    }

    /// The motion far from the sample: the orbit that Newton closes near the free response, or
    /// where a run from rest goes.
    pub(crate) fn free(&mut self) -> Result<Place, CaseError> {
        let gap = self.range.1;
        let model = self.model(gap)?;
        let drive = model.system.drive();
        let response = model.system.regimes().first();
        let response = response.map(|free| free.response().at(drive, 0.0).as_slice().to_vec());
        let mut start = vec![0.0; model.dimension()];
        if let Some(response) = response.filter(|x| x.iter().all(|v| v.is_finite())) {
            let shared = start.len().min(response.len());
            start[..shared].copy_from_slice(&response[..shared]);
            let mut map = ModelMap::new(&model);
            let closed = close_orbit(&mut map, &start, 1, &ShootingOptions::default());
            if let Ok(orbit) = closed
                && orbit.is_stable()
                && orbit.nearest(&start).1 <= CONTINUOUS * orbit.scale()
            {
                return Ok(self.on(gap, orbit));
            }
            start.fill(0.0);
        }
        Ok(self.arrive(gap, &start))
    }

    /// Returns the place that a run from a state at a distance reaches. Under a nonlinear law a
    /// motion that does not close on the approximate map is classified exactly only where it is
    /// reported.
    fn arrive(&mut self, gap: f64, start: &[f64]) -> Place {
        let searched = self.is_nonlinear.then(|| {
            let options = self.classify.clone();
            self.search_orbit(gap, start, &options)
        });
        let is_confirmed =
            |motion: &FoundMotion| !motion.failed && motion.closes == motion.orbit.is_some();
        let motion = searched
            .filter(is_confirmed)
            .unwrap_or_else(|| self.run_from(gap, start, self.classify.max_transient));
        self.place(gap, motion)
    }

    /// The place of a motion: on its branch, where that is followed.
    fn place(&mut self, gap: f64, motion: FoundMotion) -> Place {
        match motion.orbit {
            Some(orbit) if orbit.period <= LONGEST_BRANCH => self.on(gap, orbit),
            _ => Place::Off { gap, motion },
        }
    }

    /// Classifies the motion that a run from a state at a distance reaches.
    fn run_from(&self, gap: f64, start: &[f64], max_transient: usize) -> FoundMotion {
        let options = ClassifyOptions {
            max_transient,
            ..self.classify.clone()
        };
        match self.model(gap) {
            Ok(model) => named(
                &mut ModelMap::new(&model),
                &reachable(&model, start),
                &options,
            ),
            Err(error) => FoundMotion::undecided(error.to_string(), start),
        }
    }

    /// Options that only show whether an orbit closes.
    fn search_options(&self) -> ClassifyOptions {
        ClassifyOptions {
            max_transient: GRID_TRANSIENT,
            long_period: self.classify.max_period,
            lyapunov: LyapunovOptions {
                alignment: 0,
                min_periods: 1,
                max_periods: 1,
                ..self.classify.lyapunov.clone()
            },
            birkhoff_periods: 1,
            ..self.classify.clone()
        }
    }

    /// As [`run_from`](Self::run_from), on the approximate map where there is one; an orbit is that of
    /// the exact map.
    fn search_orbit(&self, gap: f64, start: &[f64], options: &ClassifyOptions) -> FoundMotion {
        let model = match self.model(gap) {
            Ok(model) => model,
            Err(error) => return FoundMotion::undecided(error.to_string(), start),
        };
        let mut map = ModelMap::new(&model);
        let start = &reachable(&model, start);
        let mut motion = match map.coarse() {
            Some(mut coarse) => named(&mut coarse, start, &options.on_coarse_map()),
            None => named(&mut map.clone(), start, options),
        };
        if let Some(near) = motion.orbit.take() {
            let (points, period) = (near.states.concat(), near.period);
            let closed =
                close_orbit_from_points(&mut map, &points, period, &ShootingOptions::default());
            motion.orbit = closed.ok().filter(|orbit| {
                orbit.is_stable() && orbit.distance_to(&near).1 <= CONTINUOUS * near.scale()
            });
        }
        // An orbit of the approximate map alone shows nothing.
        if self.is_nonlinear && motion.closes && motion.orbit.is_none() {
            motion = named(&mut map, start, options);
        }
        FoundMotion {
            only_searched: true,
            ..motion
        }
    }

    /// The place on a stable orbit, whose stretch is continued both ways unless it is known.
    pub(crate) fn on(&mut self, gap: f64, orbit: PeriodicOrbit) -> Place {
        let known = (0..self.stretches.len()).find(|&k| {
            let stretch = &self.stretches[k];
            stretch.period == orbit.period
                && stretch.holds(gap)
                && (self.orbit_at(k, gap)).is_some_and(|own| is_same(&own, &orbit))
        });
        let stretch = known.unwrap_or_else(|| {
            let before = self.flag.spent();
            let stretch = self.continued(gap, orbit);
            self.continued.0 += self.flag.spent() - before;
            self.continued.1 += stretch.points.len();
            self.stretches.push(stretch);
            self.stretches.len() - 1
        });
        Place::On { stretch, gap }
    }

    /// A state at drive phase 0 of the lever at a place.
    pub(crate) fn state(&self, place: &Place) -> Vec<f64> {
        match place {
            Place::On { stretch, gap } => {
                let orbit = self.orbit_at(*stretch, *gap);
                orbit
                    .and_then(|o| o.states.first().cloned())
                    .unwrap_or_default()
            }
            Place::Off { motion, .. } => motion.state.clone(),
        }
    }

    fn options(&self) -> ContinuationOptions {
        let (near, far) = self.range;
        ContinuationOptions {
            until_unstable: true,
            // Those of piecewise-linear systems take little time and end branches.
            grazings: !self.is_nonlinear,
            max_points: MAX_POINTS,
            parameter_scale: Some(self.scale),
            ..ContinuationOptions::over(near, far)
        }
    }

    fn follow(
        &self,
        gap: f64,
        orbit: &PeriodicOrbit,
        direction: Direction,
    ) -> (Vec<BranchPoint>, (f64, End)) {
        let options = self.options();
        let control = self.limited();
        let (points, mut end) =
            match continue_orbit(&self.family, gap, orbit, direction, &options, &control) {
                Ok(branch) => stable_part(branch, &|gap| self.case.shown(self.case.gap_key(), gap)),
                Err(error) => (Vec::new(), (gap, End::Lost(error.to_string()))),
            };
        if let Some(steps) = self.spent_budget() {
            end.1 = End::Budget(steps);
        }
        (points, end)
    }

    /// The stretch of stable orbits through one.
    fn continued(&self, gap: f64, orbit: PeriodicOrbit) -> Stretch {
        let (mut points, near) = self.follow(gap, &orbit, Direction::Decreasing);
        let (further, far) = self.follow(gap, &orbit, Direction::Increasing);
        points.reverse();
        let shared = usize::from(!points.is_empty());
        points.extend(further.into_iter().skip(shared));
        let period = orbit.period;
        if points.is_empty() {
            points.push(BranchPoint {
                parameter: gap,
                orbit,
                arclength: 0.0,
                slope: 0.0,
                tangencies: Vec::new(),
            });
        }
        Stretch {
            period,
            points,
            ends: [near, far],
        }
    }

    /// The orbit of a stretch at a distance.
    pub(crate) fn orbit_at(&self, stretch: usize, gap: f64) -> Option<PeriodicOrbit> {
        let stretch = &self.stretches[stretch];
        for (at, end) in &stretch.ends {
            if let End::Bifurcation { at: found, .. } = end
                && *at == gap
            {
                return Some(found.orbit.clone());
            }
        }
        let points = &stretch.points;
        let above = points.partition_point(|p| p.parameter < gap);
        let neighbours = [above.checked_sub(1), Some(above)];
        let [below, above] = neighbours.map(|k| k.and_then(|k| points.get(k)));
        if let (Some(a), Some(b)) = (below, above) {
            let t = (gap - a.parameter) / (b.parameter - a.parameter);
            let [from, to] = [a, b].map(|p| p.orbit.states.concat());
            let between: Vec<f64> = from.iter().zip(&to).map(|(x, y)| x + t * (y - x)).collect();
            let chord = from
                .iter()
                .zip(&to)
                .fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()));
            let model = self.model(gap).ok()?;
            let options = ShootingOptions::default();
            let mut map = ModelMap::new(&model);
            let closed = close_orbit_from_points(&mut map, &between, stretch.period, &options);
            if let Ok(orbit) = closed
                && orbit.period == stretch.period
                && orbit.is_stable()
            {
                let moved = orbit.states.concat();
                let moved = moved.iter().zip(&between);
                let moved = moved.fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()));
                if moved <= 0.5 * chord + 10.0 * orbit.error {
                    return Some(orbit);
                }
            }
        }
        // Near an end, and where the chord leads elsewhere: step by step from the nearer point.
        let nearest = [below, above].into_iter().flatten();
        let nearest = nearest.min_by(|a, b| {
            let apart = |p: &BranchPoint| (p.parameter - gap).abs();
            apart(a).total_cmp(&apart(b))
        })?;
        if nearest.parameter == gap {
            return Some(nearest.orbit.clone());
        }
        let (low, high) = (gap.min(nearest.parameter), gap.max(nearest.parameter));
        let options = ContinuationOptions {
            range: (low, high),
            ..self.options()
        };
        let direction = if gap > nearest.parameter {
            Direction::Increasing
        } else {
            Direction::Decreasing
        };
        let (at, orbit) = (nearest.parameter, &nearest.orbit);
        let branch = continue_orbit(
            &self.family,
            at,
            orbit,
            direction,
            &options,
            &self.limited(),
        )
        .ok()?;
        let last = branch.points.into_iter().next_back()?;
        let arrived = matches!(branch.end, BranchEnd::RangeEnd) && last.orbit.is_stable();
        arrived.then_some(last.orbit)
    }

    /// The motion of a piece at a distance.
    pub(crate) fn motion_at(&self, piece: &Piece, gap: f64) -> FoundMotion {
        let nearby = match &piece.motion {
            Motion::Periodic(stretch) => {
                if let Some(orbit) = self.orbit_at(*stretch, gap) {
                    return FoundMotion::periodic(orbit);
                }
                let nearest = self.stretches[*stretch].points.iter().min_by(|a, b| {
                    let apart = |p: &BranchPoint| (p.parameter - gap).abs();
                    apart(a).total_cmp(&apart(b))
                });
                nearest.and_then(|p| p.orbit.states.first().cloned())
            }
            Motion::OnGrid(found) => {
                let here = |(at, motion): &&(f64, FoundMotion)| *at == gap && !motion.only_searched;
                if let Some((_, motion)) = found.iter().find(here) {
                    return motion.clone();
                }
                let passed = |at: f64| (at - piece.from).abs() <= (gap - piece.from).abs();
                let last = found.iter().rfind(|(at, _)| passed(*at)).or(found.first());
                last.map(|(_, motion)| motion.next_start())
            }
        };
        self.run_from(gap, &nearby.unwrap_or_default(), ROW_TRANSIENT)
    }

    /// The pieces of the way from a place to a distance, until one is `enough`.
    pub(crate) fn way(
        &mut self,
        mut place: Place,
        to: f64,
        mut enough: impl FnMut(&Self, &Piece) -> bool,
    ) -> (Vec<Piece>, Place) {
        let mut pieces: Vec<Piece> = Vec::new();
        loop {
            let (mut piece, mut next) = self.piece(place.clone(), to);
            // A jump takes no distance.
            piece.from = pieces.last().map_or(piece.from, |last| last.to);
            if let Some(steps) = self.spent_budget() {
                (piece.end, piece.jumps) = (End::Budget(steps), false);
                next.get_or_insert(place.clone());
            }
            let done = enough(self, &piece) || self.flag.is_cancelled();
            pieces.push(piece);
            match next {
                Some(next) if !done && pieces.len() < MAX_PIECES => place = next,
                Some(next) => return (pieces, next),
                None => {
                    let last = pieces.last().map(|p| (p.motion.clone(), p.to));
                    let end = match last {
                        Some((Motion::Periodic(stretch), gap)) => Place::On { stretch, gap },
                        Some((Motion::OnGrid(mut found), gap)) => match found.pop() {
                            Some((_, motion)) => Place::Off { gap, motion },
                            None => place,
                        },
                        None => place,
                    };
                    return (pieces, end);
                }
            }
        }
    }

    /// The piece that begins at a place, and where the lever goes at its end; nowhere if that is
    /// `to`.
    fn piece(&mut self, place: Place, to: f64) -> (Piece, Option<Place>) {
        match place {
            Place::On { stretch, gap } => {
                let direction = direction(gap, to);
                let (at, end) = self.stretches[stretch].end(direction).clone();
                let beyond = (at - to) * sign(direction) >= 0.0;
                let piece = |to: f64, end: End, jumps: bool| Piece {
                    from: gap,
                    entered: gap,
                    to,
                    motion: Motion::Periodic(stretch),
                    uncertainty: match &end {
                        End::Bifurcation { at, .. } => at.uncertainty,
                        _ => 0.0,
                    },
                    end,
                    jumps,
                };
                if beyond || matches!(end, End::Range) {
                    return (piece(to, End::Range, false), None);
                }
                let (next, jumps) = self.beyond(stretch, direction, to);
                // A stretch that leads no further is not entered again.
                let stuck = (at - gap).abs() <= 1e-9 * self.scale;
                let next = match next {
                    Place::On { stretch: same, gap } if same == stretch && stuck => {
                        let motion = self.orbit_at(same, gap).map_or_else(
                            || FoundMotion::undecided(end.to_string(), &[]),
                            FoundMotion::periodic,
                        );
                        Place::Off { gap, motion }
                    }
                    next => next,
                };
                (piece(at, end, jumps), Some(next))
            }
            Place::Off { gap, motion } => self.on_grid(gap, motion, to),
        }
    }

    /// Finds where the lever goes from the end of a stretch, and whether it jumps.
    fn beyond(&mut self, stretch: usize, direction: Direction, to: f64) -> (Place, bool) {
        let (at, end) = self.stretches[stretch].end(direction).clone();
        let (side, scale) = (sign(direction), self.scale);
        let points = &self.stretches[stretch].points;
        let last = match direction {
            Direction::Increasing => points.last(),
            Direction::Decreasing => points.first(),
        };
        let last = last.map(|p| p.orbit.clone());
        let (orbit, unstable, tries) = match end {
            End::Bifurcation {
                at: found,
                unstable,
            } => {
                if found.kind == BifurcationKind::Flip
                    && let Some(stretch) = self.doubled(&found, direction)
                {
                    return (Place::On { stretch, gap: at }, false);
                }
                let tries: &[_] = match found.kind {
                    BifurcationKind::Fold => &BEYOND_FOLD,
                    _ => &[BEYOND_END],
                };
                (Some(found.orbit), unstable, tries)
            }
            End::Meeting { period } => {
                let motion = (0..self.stretches.len()).find(|&k| {
                    let other = &self.stretches[k];
                    let near = |(gap, _): &(f64, End)| (gap - at).abs() <= SAME_PLACE * scale;
                    other.period == period && other.ends.iter().any(near)
                });
                if let Some(stretch) = motion {
                    return (Place::On { stretch, gap: at }, false);
                }
                (last, None, &[BEYOND_END][..])
            }
            _ => (last, None, &[BEYOND_END][..]),
        };
        let Some(orbit) = orbit else {
            let motion = FoundMotion::undecided(NO_ORBIT.to_owned(), &[]);
            return (Place::Off { gap: at, motion }, true);
        };
        let mut next = None;
        for &(step, push) in tries {
            let gap = at + side * step * scale;
            let gap = if (gap - to) * side > 0.0 { to } else { gap };
            let place = self.arrive(gap, &pushed(&orbit, unstable.as_deref(), push));
            let settled = !matches!(&place, Place::Off { motion, .. }
                if motion.classification == Classification::Undecided);
            next = Some(place);
            if settled {
                break;
            }
        }
        let motion = || FoundMotion::undecided(NO_ORBIT.to_owned(), &[]);
        let next = next.unwrap_or_else(|| Place::Off {
            gap: at,
            motion: motion(),
        });
        let jumps = !self.goes_on(&orbit, &next);
        (next, jumps)
    }

    /// Whether a place is the continuation of an orbit.
    fn goes_on(&self, orbit: &PeriodicOrbit, place: &Place) -> bool {
        let near = |state: &[f64]| orbit.nearest(state).1 <= CONTINUOUS * orbit.scale();
        match place {
            Place::On { stretch, gap } => (self.orbit_at(*stretch, *gap))
                .is_some_and(|next| next.states.iter().all(|state| near(state))),
            Place::Off { motion, .. } => match &motion.orbit {
                Some(next) => next.states.iter().all(|state| near(state)),
                None => near(&motion.state),
            },
        }
    }

    /// Whether a motion that is undecided, as where it settles slowly, is near the orbit of a place.
    fn has_arrived(&self, motion: &FoundMotion, place: &Place) -> bool {
        let Place::On { stretch, gap } = place else {
            return false;
        };
        let orbit = self.orbit_at(*stretch, *gap);
        motion.classification == Classification::Undecided
            && orbit.is_some_and(|o| o.nearest(&motion.state).1 <= CONTINUOUS * o.scale())
    }

    /// The stretch of doubled period that begins at a flip and goes on in a direction.
    fn doubled(&mut self, flip: &Bifurcation, direction: Direction) -> Option<usize> {
        let period = 2 * flip.orbit.period;
        if period > LONGEST_BRANCH.min(self.classify.max_period) {
            return None;
        }
        let at = flip.parameter;
        let known = (0..self.stretches.len()).find(|&k| {
            let (gap, end) = self.stretches[k].end(reversed(direction));
            let born = matches!(end, End::Meeting { period } if *period == flip.orbit.period);
            self.stretches[k].period == period
                && born
                && (gap - at).abs() <= SAME_PLACE * self.scale
        });
        if known.is_some() {
            return known;
        }
        let branch = switch_at_flip(&self.family, flip, &self.options(), &self.limited()).ok()?;
        let shown = |gap| self.case.shown(self.case.gap_key(), gap);
        let (mut points, end) = stable_part(branch, &shown);
        let side = sign(direction);
        let first = points.first()?;
        let last = points.last()?;
        let onwards = (first.parameter - at) * side >= 0.0 && (last.parameter - at) * side > 0.0;
        if !onwards {
            return None;
        }
        let birth = (
            at,
            End::Meeting {
                period: flip.orbit.period,
            },
        );
        let ends = match direction {
            Direction::Increasing => [birth, end],
            Direction::Decreasing => {
                points.reverse();
                [end, birth]
            }
        };
        self.stretches.push(Stretch {
            period,
            points,
            ends,
        });
        Some(self.stretches.len() - 1)
    }

    /// A motion without a branch that is followed, from grid distance to grid distance until it
    /// has one.
    fn on_grid(&mut self, from: f64, motion: FoundMotion, to: f64) -> (Piece, Option<Place>) {
        let side = sign(direction(from, to));
        let step = self.scale / GRID;
        let mut piece = Piece {
            from,
            entered: from,
            to,
            motion: Motion::OnGrid(Vec::new()),
            end: End::Range,
            jumps: false,
            uncertainty: 0.0,
        };
        let mut found = vec![(from, motion)];
        let mut onwards = None;
        while let Some((gap, before)) = found.last().cloned() {
            if (gap - to) * side >= 0.0 {
                break;
            }
            let is_piece = self.piece_a_step && found.len() > 1;
            if is_piece || self.flag.is_cancelled() {
                piece.to = gap;
                onwards = Some(Place::Off {
                    gap,
                    motion: before,
                });
                break;
            }
            // The next multiple of a step, beyond rounding.
            let mut next = step * side * ((side * gap / step + 1e-6).floor() + 1.0);
            if (next - to) * side > 0.0 {
                next = to;
            }
            let start = before.next_start();
            let options = self.search_options();
            let mut motion = self.search_orbit(next, &start, &options);
            for _ in 0..HALVINGS {
                if !motion.failed || (next - gap).abs() < MIN_GRID_STEP * step {
                    break;
                }
                next = 0.5 * (gap + next);
                motion = self.search_orbit(next, &start, &options);
            }
            let Place::On { mut stretch, .. } = self.place(next, motion.clone()) else {
                found.push((next, motion));
                continue;
            };
            let direction = direction(from, to);
            let (begins, how) = self.stretches[stretch].end(reversed(direction)).clone();
            let inside = (begins - gap) * side > 0.0 && (next - begins) * side >= 0.0;
            let mut place = Place::On {
                stretch,
                gap: if inside { begins } else { next },
            };
            let goes_on = match &before.orbit {
                Some(orbit) => self.goes_on(orbit, &place),
                None => inside && is_continuous(&how) || self.has_arrived(&before, &place),
            };
            if inside && (goes_on || is_continuous(&how)) {
                (piece.to, piece.end) = (begins, how);
            } else {
                // The last motion found without a branch, and the first with one.
                let mut last = gap;
                for _ in 0..BISECTIONS {
                    let between = 0.5 * (last + next);
                    let start = found.last().map(|(_, motion)| motion.next_start());
                    let start = start.unwrap_or_default();
                    let motion = self.search_orbit(between, &start, &options);
                    if motion.failed {
                        break;
                    }
                    if let Place::On { stretch: other, .. } = self.place(between, motion.clone()) {
                        (next, stretch) = (between, other);
                    } else {
                        last = between;
                        found.push((between, motion));
                    }
                }
                place = Place::On { stretch, gap: next };
                (piece.to, piece.end) = (next, End::Closes);
                piece.uncertainty = (next - last).abs();
            }
            piece.jumps = !goes_on;
            onwards = Some(place);
            break;
        }
        piece.motion = Motion::OnGrid(found);
        (piece, onwards)
    }
}

/// A state of a motion at another distance, on the stop where it would be behind it.
fn reachable(model: &Model, state: &[f64]) -> Vec<f64> {
    let mut state = state.to_vec();
    model.stop_at_wall(&mut state);
    state
}

/// Classifies the motion that a run of a map reaches.
fn named(map: &mut ModelMap, start: &[f64], options: &ClassifyOptions) -> FoundMotion {
    let classified = classify(map, start, options);
    let named = NamedMotion::of(&classified.kind);
    FoundMotion {
        classification: named.classification,
        evidence: named.evidence,
        orbit: named.orbit,
        closes: matches!(
            classified.kind,
            MotionKind::Periodic(_)
                | MotionKind::TransientChaos { .. }
                | MotionKind::Undecided {
                    reason: UndecidedReason::OnOrbitThatDoesNotAttract(_),
                    ..
                }
        ),
        failed: matches!(
            classified.kind,
            MotionKind::Undecided {
                reason: UndecidedReason::Map { .. } | UndecidedReason::BadStart(_),
                ..
            }
        ),
        only_searched: false,
        state: classified.state,
    }
}

/// Why nothing is known beyond an end.
const NO_ORBIT: &str = "the branch that ends here has no orbit to start from";

/// Whether two orbits at one distance are the same.
pub(crate) fn is_same(a: &PeriodicOrbit, b: &PeriodicOrbit) -> bool {
    a.is_same_as(b)
}

/// Whether a motion goes over into another at an end without a jump.
const fn is_continuous(end: &End) -> bool {
    match end {
        End::Bifurcation { at, .. } => matches!(
            at.kind,
            BifurcationKind::Flip
                | BifurcationKind::NeimarkSacker { .. }
                | BifurcationKind::Crossing
        ),
        End::Meeting { .. } => true,
        End::Range | End::Closes | End::Lost(_) | End::Budget(_) => false,
    }
}

/// The stable points of a branch in the order in which it was followed, and its end.
fn stable_part(
    mut branch: Branch,
    shown: &dyn Fn(f64) -> String,
) -> (Vec<BranchPoint>, (f64, End)) {
    let first = branch.points.first().map_or(f64::NAN, |p| p.parameter);
    let last_of = |points: &[BranchPoint]| points.last().map_or(first, |p| p.parameter);
    let end = match &branch.end {
        BranchEnd::RangeEnd => (last_of(&branch.points), End::Range),
        BranchEnd::Unstable { .. } => {
            let unstable = branch.points.pop();
            let last = branch.points.len().saturating_sub(1);
            let mut between: Vec<Bifurcation> = branch.bifurcations;
            between.retain(|b| b.after_point == last);
            let of_stability =
                |b: &&Bifurcation| !matches!(b.kind, BifurcationKind::Grazing { .. });
            let chosen = between.iter().find(of_stability).or(between.first());
            if let Some(found) = chosen {
                let unstable = unstable.map(|p| Box::new(p.orbit));
                let at = Box::new(found.clone());
                (found.parameter, End::Bifurcation { at, unstable })
            } else {
                let reason = "the orbit is stable no longer".to_owned();
                (last_of(&branch.points), End::Lost(reason))
            }
        }
        BranchEnd::Collapsed { period, parameter } => {
            (*parameter, End::Meeting { period: *period })
        }
        BranchEnd::Grazing { parameter } => {
            let grazing = branch
                .bifurcations
                .iter()
                .rfind(|b| b.parameter == *parameter);
            let end = match grazing {
                Some(found) => End::Bifurcation {
                    at: Box::new(found.clone()),
                    unstable: None,
                },
                None => End::Lost(branch.end.words(shown)),
            };
            (*parameter, end)
        }
        other => (last_of(&branch.points), End::Lost(other.words(shown))),
    };
    (branch.points, end)
}

/// A state near the orbit at an end: pushed from it by a part of its size, towards an unstable
/// one, if there is one.
fn pushed(orbit: &PeriodicOrbit, unstable: Option<&PeriodicOrbit>, push: f64) -> Vec<f64> {
    let Some(state) = orbit.states.first() else {
        return Vec::new();
    };
    let continuous = state.len() - orbit.discrete.min(state.len());
    let push = push * orbit.scale();
    let towards = unstable.and_then(|other| other.states.first());
    let away: Vec<f64> = match towards {
        Some(other) => other.iter().zip(state).map(|(x, y)| x - y).collect(),
        None => state.clone(),
    };
    let length = away[..continuous]
        .iter()
        .fold(0.0, |m: f64, x| m.max(x.abs()));
    let factor = if length > 0.0 { push / length } else { 0.0 };
    let moved = |(k, (x, a)): (usize, (&f64, &f64))| {
        if k < continuous { x + factor * a } else { *x }
    };
    state.iter().zip(&away).enumerate().map(moved).collect()
}

fn direction(from: f64, to: f64) -> Direction {
    if to > from {
        Direction::Increasing
    } else {
        Direction::Decreasing
    }
}

const fn reversed(direction: Direction) -> Direction {
    match direction {
        Direction::Increasing => Direction::Decreasing,
        Direction::Decreasing => Direction::Increasing,
    }
}

const fn sign(direction: Direction) -> f64 {
    match direction {
        Direction::Increasing => 1.0,
        Direction::Decreasing => -1.0,
    }
}
