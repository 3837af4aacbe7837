//! Static branches: where the lever rests against the sample, followed in the separation, with the
//! folds at which it jumps.
//!
//! The modes of a model have only part of the beam's static compliance `1/k`. The rest of it,
//! `1/k − Σ 1/kᵢ`, acts as a massless spring in series: at a rest with the force `F` it takes
//! `(1/k − Σ 1/kᵢ) F` of the distance, so that `F = k d` for any number of modes.

use nalgebra::DVector;

use super::Way;
use nanotap_case::Case;
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_model::nonlinear::Nonlinear;
use nanotap_volterra::Guard;
use std::sync::{Arc, LazyLock};

use super::path::Plan;

/// A rest of the lever, in the model's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rest {
    pub(super) distance: f64,
    pub(super) gap: f64,
    pub(super) force: f64,
    /// Branch of the law, or regime of a piecewise-linear sample.
    branch: usize,
}

/// Rests of one stability, by falling separation.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) contact: bool,
    pub(super) stable: bool,
    pub(super) rests: Vec<Rest>,
    /// The rest of the lowest force, where the force has a minimum or ends.
    pub(super) lowest: Rest,
    /// Whether the first and the last rest are at an end of the range of distances.
    cut: [bool; 2],
}

/// A jump of the lever at rest where its branch ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Jump {
    pub(super) way: Way,
    pub(super) before: Rest,
    pub(super) after: Option<Rest>,
}

/// Branches and jumps between two distances.
#[derive(Clone, Debug)]
pub(super) struct BranchesAndJumps {
    pub(super) pieces: Vec<Piece>,
    pub(super) jumps: Vec<Jump>,
    /// Lowest force in contact on the way back, up to the first jump.
    pub(super) pull_off: Option<Rest>,
}

/// The rests of a lever.
#[derive(Clone, Debug)]
pub(super) enum StaticCurve {
    /// Of a piecewise-linear sample: rests and guards are linear in the distance.
    Linear(Vec<LinearRests>),
    /// Under a nonlinear law: rests are followed in the separation.
    Law(Box<LawRests>),
}

/// The rests in one regime.
#[derive(Clone, Debug)]
pub(super) struct LinearRests {
    contact: bool,
    stable: bool,
    /// Distance at which the values are the first ones.
    origin: f64,
    /// Separation, force and guards, each with its slope.
    gap: [f64; 2],
    force: [f64; 2],
    guards: Vec<[f64; 2]>,
    /// State of the lever at rest, and its derivative by the distance.
    state: [DVector<f64>; 2],
}

/// The law with the lever's compliance.
#[derive(Clone, Debug)]
pub(super) struct LawRests {
    nonlinear: Arc<Nonlinear>,
    compliance: f64,
    /// Constant part of the gap without the distance.
    offset: f64,
    /// State of the lever without force, and under a unit of force.
    state: [DVector<f64>; 2],
}

/// Static compliance of a uniform beam at its tip, 1/k = L³/(3 EI), in units of L³/(EI).
const BEAM_COMPLIANCE: f64 = 1.0 / 3.0;
/// Number of points of a branch on each side of the gap at which contact begins.
const POINTS: usize = 1200;
/// Smallest step from there, as a part of the range.
const NEAR: f64 = 1e-9;
/// These parts of the ranges of separations.
static PARTS: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let part = |k| nanotap_arithmetic::powf(NEAR, k as f64 / POINTS as f64);
    (0..=POINTS).map(part).collect()
});
/// Two ends meet within this part of the range.
const MEET: f64 = 1e-9;

/// Static compliance of the whole lever at its tip: of all measured modes, or of the beam.
fn lever_compliance(case: &Case) -> f64 {
    let measured = case.cantilever().map(|lever| &lever.lever_modes);
    match measured.filter(|modes| !modes.is_empty()) {
        None => BEAM_COMPLIANCE,
        Some(modes) => modes.iter().map(|mode| 1.0 / mode.stiffness).sum(),
    }
}

impl StaticCurve {
    /// The rests of the lever of `case` with its model: with the compliance of the whole beam, or of
    /// the modes alone, as it moves.
    ///
    /// # Errors
    /// When the case has no model at another distance, or the lever does not restore.
    pub(super) fn new(case: &Case, model: &Model, whole: bool) -> Result<Self, Error> {
        let beam = if whole { lever_compliance(case) } else { 0.0 };
        let origin = case.get(case.gap_key());
        if let Some(nonlinear) = &model.nonlinear {
            let system = &nonlinear.system;
            let free = &model.system.regimes()[0];
            let n = system.dimension();
            let matrix = free.matrix().view((0, 0), (n, n)).into_owned().lu();
            let solve = |forcing: &DVector<f64>| {
                let rest = matrix.solve(&-forcing);
                rest.ok_or_else(|| Error::numerics("the free lever does not restore"))
            };
            let state = [
                solve(&system.drive().constant)?,
                solve(system.kernel().column())?,
            ];
            let row = system.kernel().row();
            return Ok(Self::Law(Box::new(LawRests {
                // Measured modes may have more than the beam: then there is nothing to add.
                compliance: (row * &state[1])[0].max(beam),
                offset: system.drive().offset - origin + (row * &state[0])[0],
                nonlinear: Arc::clone(nonlinear),
                state,
            })));
        }
        let moved = case.with(case.gap_key(), origin + 1.0).model()?;
        let both = [model, &moved];
        let rests = (0..model.system.regimes().len()).map(|r| {
            let states = both.map(|model| model.system.regimes()[r].response().constant.clone());
            let line = |of: &dyn Fn(&Model) -> nanotap_flow::Output| {
                let [a, b] = [0, 1].map(|k| {
                    let output = of(both[k]);
                    (&output.row * &states[k])[0] + output.constant
                });
                [a, b - a]
            };
            let regime = &model.system.regimes()[r];
            let rests = LinearRests {
                contact: model.contact[r],
                stable: regime.basis().eigenvalues.iter().all(|z| z.re < 0.0),
                origin,
                gap: line(&|model| model.height.clone()),
                force: line(&|model| model.force[r].clone()),
                guards: (0..model.system.transitions()[r].len())
                    .map(|e| line(&|model| model.system.transitions()[r][e].guard.clone()))
                    .collect(),
                state: [states[0].clone(), &states[1] - &states[0]],
            };
            let own = rests.compliance().unwrap_or(beam);
            rests.with_compliance((beam - own).max(0.0))
        });
        Ok(Self::Linear(rests.collect()))
    }

    /// State of the lever at rest at a distance, coming from far.
    ///
    /// # Errors
    /// When it rests nowhere.
    pub(super) fn rest_state(&self, distance: f64) -> Result<Vec<f64>, Error> {
        let none = || {
            Error::numerics("the lever rests nowhere at the first distance: give a larger {from}")
        };
        match self {
            Self::Linear(regimes) => {
                let mut open = regimes.iter().filter(|r| r.stable && r.holds(distance));
                let rests = open.next().ok_or_else(none)?;
                let state = &rests.state[0] + &rests.state[1] * (distance - rests.origin);
                Ok(state.as_slice().to_vec())
            }
            Self::Law(law) => {
                let pieces = self.pieces(distance - 0.1 * distance.abs(), distance);
                let rests = pieces.iter().filter(|piece| piece.stable);
                let rest = rests
                    .filter_map(|piece| self.at(piece, distance))
                    .max_by(|a, b| a.gap.total_cmp(&b.gap))
                    .ok_or_else(none)?;
                let state = &law.state[0] + &law.state[1] * rest.force;
                let mut state = state.as_slice().to_vec();
                if let Some(surface) = law.nonlinear.system.law().surface() {
                    let contact = law.nonlinear.static_law().touches(rest.branch);
                    let presses = contact || surface.always;
                    let pressed = rest.force - surface.adhesion;
                    let first = state.len() - surface.rates.len();
                    for k in first..state.len() {
                        state[k] = if presses {
                            law.state[1][k] * pressed
                        } else {
                            0.0
                        };
                    }
                }
                if law.nonlinear.remembers {
                    // The flow chooses the branch.
                    state.push(-1.0);
                }
                Ok(state)
            }
        }
    }

    /// The pieces of all branches between two distances.
    pub(super) fn pieces(&self, near: f64, far: f64) -> Vec<Piece> {
        match self {
            Self::Linear(regimes) => {
                let numbered = regimes.iter().enumerate();
                let pieces = numbered.filter_map(|(k, regime)| regime.piece(k, near, far));
                pieces.collect()
            }
            Self::Law(law) => law.pieces(near, far),
        }
    }

    /// Branches and jumps of a lever that comes from the distance `far`, turns at `near` and goes
    /// back.
    pub(super) fn branches_and_jumps(&self, near: f64, far: f64) -> BranchesAndJumps {
        let pieces = self.pieces(near, far);
        let mut jumps = Vec::new();
        let mut pull_off = None;
        let rests = pieces.iter().flat_map(|piece| &piece.rests);
        let largest = rests.map(|rest| rest.force.abs()).fold(0.0, f64::max);
        let farthest = |piece: &&Piece| piece.stable && self.at(piece, far).is_some();
        let start = pieces.iter().filter(farthest);
        let start = start.max_by(|a, b| a.rests[0].gap.total_cmp(&b.rests[0].gap));
        if let Some(start) = start {
            let visited = self.follow(&pieces, start, Way::Approach, far - near, &mut jumps);
            if let Some(turn) = visited.last() {
                let mut back = Vec::new();
                let visited = self.follow(&pieces, turn, Way::Retract, far - near, &mut back);
                let end = back.first().map_or(f64::INFINITY, |jump| jump.before.gap);
                let held = visited.iter().filter(|p| p.contact && p.lowest.gap <= end);
                pull_off = held
                    .map(|piece| piece.lowest)
                    .min_by(|a, b| a.force.total_cmp(&b.force))
                    // Rounding where contact begins without a force is none.
                    .filter(|rest| rest.force < -1e-12 * largest);
                jumps.extend(back);
            }
        }
        BranchesAndJumps {
            pieces,
            jumps,
            pull_off,
        }
    }

    /// The distance at which the lever at rest, coming from far, exerts a force.
    pub(super) fn distance_of_force(&self, far: f64, force: f64) -> Option<f64> {
        // A repulsive force bends the lever away: the distance is below the separation by so much.
        let mut near = far.min(0.0) - 0.1 * far.abs();
        for _ in 0..40 {
            let pieces = self.pieces(near, far);
            let stable = pieces.iter().filter(|piece| piece.stable);
            let mut found =
                stable.filter_map(|piece| self.between(&piece.rests, |r| r.force, force));
            if let Some(rest) = found.next() {
                return Some(rest.distance);
            }
            near -= near.abs().max(0.1 * far.abs());
        }
        None
    }

    /// The rest of a piece at a distance.
    pub(super) fn at(&self, piece: &Piece, distance: f64) -> Option<Rest> {
        // Along a stable piece the distance falls: only two rests can be about it.
        let rests = if piece.stable {
            let first = piece.rests.partition_point(|rest| rest.distance > distance);
            let end = piece.rests.len().min(first + 1);
            &piece.rests[first.saturating_sub(1)..end]
        } else {
            &piece.rests
        };
        self.between(rests, |rest| rest.distance, distance)
    }

    /// Compliance of the lever at rest, in the model's units.
    pub(super) fn compliance(&self) -> Option<f64> {
        match self {
            Self::Linear(regimes) => regimes.iter().find_map(LinearRests::compliance),
            Self::Law(law) => Some(law.compliance),
        }
    }

    /// The rest at the separation of a known one, of a piecewise-linear sample that at a distance;
    /// and for a law how distance and force change with the separation.
    pub(super) fn nearby(&self, known: &Rest, distance: f64) -> (Rest, Option<[f64; 2]>) {
        match self {
            Self::Linear(regimes) => {
                let regime = known.branch.min(regimes.len() - 1);
                (regimes[regime].rest(regime, distance), None)
            }
            Self::Law(law) => {
                let (rest, slopes) = law.rest(known.branch, known.gap);
                (rest, Some(slopes))
            }
        }
    }

    /// The first place between rests of a piece at which a quantity has a value.
    pub(super) fn between(
        &self,
        rests: &[Rest],
        of: impl Fn(&Rest) -> f64,
        value: f64,
    ) -> Option<Rest> {
        if let Some(rest) = rests.iter().find(|rest| of(rest) == value) {
            return Some(*rest);
        }
        let mut pairs = rests.windows(2);
        let pair = pairs.find(|pair| (of(&pair[0]) - value) * (of(&pair[1]) - value) < 0.0)?;
        Some(match self {
            Self::Linear(_) => {
                let part = (value - of(&pair[0])) / (of(&pair[1]) - of(&pair[0]));
                pair[0].towards(&pair[1], part)
            }
            Self::Law(law) => law.root(&pair[0], &pair[1], |rest, _| of(rest) - value),
        })
    }

    /// The pieces on a way, from one on; the jumps are added.
    fn follow<'a>(
        &self,
        pieces: &'a [Piece],
        start: &'a Piece,
        way: Way,
        range: f64,
        jumps: &mut Vec<Jump>,
    ) -> Vec<&'a Piece> {
        let approach = way == Way::Approach;
        // The rest where a piece begins on the way, and where it ends.
        let begin = |piece: &Piece| if approach { piece.high() } else { piece.low() };
        let end = |piece: &Piece| if approach { piece.low() } else { piece.high() };
        let mut visited = vec![start];
        while visited.len() <= 2 * pieces.len() {
            let piece = visited[visited.len() - 1];
            let last = end(piece);
            let others = || {
                let others = pieces.iter().filter(|other| other.stable);
                others.filter(|other| !std::ptr::eq(*other, piece))
            };
            let meets = |other: &&Piece| begin(other).meets(&last, range);
            if let Some(next) = others().find(meets) {
                visited.push(next);
                continue;
            }
            if piece.cut[usize::from(approach)] {
                break;
            }
            let beyond = others().filter_map(|other| {
                let rest = self.at(other, last.distance)?;
                let way = if approach { 1.0 } else { -1.0 };
                let farther = way * (last.gap - rest.gap);
                (farther > MEET * range).then_some((other, rest, farther))
            });
            let next = beyond.min_by(|a, b| a.2.total_cmp(&b.2));
            jumps.push(Jump {
                way,
                before: last,
                after: next.map(|(_, rest, _)| rest),
            });
            match next {
                Some((next, ..)) => visited.push(next),
                None => break,
            }
        }
        visited
    }
}

impl Rest {
    /// Whether it is the other within rounding, in a range of distances.
    pub(super) fn meets(&self, other: &Self, range: f64) -> bool {
        let is_near = |a: f64, b: f64| (a - b).abs() <= MEET * range;
        is_near(self.gap, other.gap) && is_near(self.distance, other.distance)
    }

    fn towards(&self, other: &Self, part: f64) -> Self {
        let mix = |a: f64, b: f64| a + part * (b - a);
        Self {
            distance: mix(self.distance, other.distance),
            gap: mix(self.gap, other.gap),
            force: mix(self.force, other.force),
            branch: self.branch,
        }
    }
}

impl Piece {
    pub(super) fn high(&self) -> Rest {
        self.rests[0]
    }

    pub(super) fn low(&self) -> Rest {
        self.rests[self.rests.len() - 1]
    }
}

impl LinearRests {
    /// Compliance of the lever; `None` where no force changes with the distance.
    fn compliance(&self) -> Option<f64> {
        (self.force[1] != 0.0).then(|| (self.gap[1] - 1.0) / self.force[1])
    }

    /// The rests of a lever on a spring with so much more compliance: at the same gap and force the
    /// distance is smaller by `compliance` times the force.
    fn with_compliance(mut self, compliance: f64) -> Self {
        let [force, slope] = self.force.map(|f| compliance * f);
        let by_distance = 1.0 / (1.0 - slope);
        self.stable &= by_distance > 0.0;
        let lines = [&mut self.gap, &mut self.force].into_iter();
        for [value, slope] in lines.chain(&mut self.guards) {
            *slope *= by_distance;
            *value += *slope * force;
        }
        let by_state = &mut self.state;
        by_state[1] *= by_distance;
        let moved = &by_state[1] * force;
        by_state[0] += moved;
        self
    }

    /// Whether the lever can rest in the regime at a distance.
    fn holds(&self, distance: f64) -> bool {
        let moved = distance - self.origin;
        self.guards
            .iter()
            .all(|[value, slope]| value + moved * slope > 0.0)
    }

    fn rest(&self, regime: usize, distance: f64) -> Rest {
        let at = |[value, slope]: [f64; 2]| value + (distance - self.origin) * slope;
        Rest {
            distance,
            gap: at(self.gap),
            force: at(self.force),
            branch: regime,
        }
    }

    fn piece(&self, regime: usize, near: f64, far: f64) -> Option<Piece> {
        let (mut low, mut high) = (near, far);
        for [value, slope] in &self.guards {
            let root = self.origin - value / slope;
            if *slope > 0.0 {
                low = low.max(root);
            } else if *slope < 0.0 {
                high = high.min(root);
            } else if *value <= 0.0 {
                return None;
            }
        }
        if low >= high {
            return None;
        }
        let mut rests = vec![self.rest(regime, high), self.rest(regime, low)];
        let mut cut = [high == far, low == near];
        if rests[1].gap > rests[0].gap {
            rests.reverse();
            cut.reverse();
        }
        let lowest = if rests[0].force < rests[1].force {
            rests[0]
        } else {
            rests[1]
        };
        Some(Piece {
            contact: self.contact,
            stable: self.stable,
            lowest,
            rests,
            cut,
        })
    }
}

impl LawRests {
    /// The rest at a separation on a branch, with `1 − c F′` and `F′`.
    fn rest(&self, branch: usize, gap: f64) -> (Rest, [f64; 2]) {
        let force = self.nonlinear.static_law().force(branch, gap, 0.0);
        let rest = Rest {
            distance: gap - self.offset - self.compliance * force.value,
            gap,
            force: force.value,
            branch,
        };
        (rest, [1.0 - self.compliance * force.by_gap, force.by_gap])
    }

    /// The rest between two, at which `of` changes its sign, to the last digit: the method of Chandrupatla
    /// (Adv. Eng. Software 28, 1997), inverse quadratic interpolation where it is sure to help, else halving.
    fn root(&self, one: &Rest, other: &Rest, of: impl Fn(&Rest, [f64; 2]) -> f64) -> Rest {
        let at = |gap: f64| {
            let (rest, slopes) = self.rest(one.branch, gap);
            (rest, of(&rest, slopes))
        };
        // The zero is between `a` and `b`; `c` is the point before.
        let (mut a, mut b) = (at(one.gap), at(other.gap));
        let mut part = 0.5;
        for _ in 0..200 {
            let next = at(a.0.gap + part * (b.0.gap - a.0.gap));
            let c = if next.1 * a.1 > 0.0 {
                a
            } else {
                std::mem::replace(&mut b, a)
            };
            a = next;
            let width = (b.0.gap - a.0.gap).abs();
            let least = f64::EPSILON * a.0.gap.abs().max(b.0.gap.abs()) / width;
            if a.1 == 0.0 || least.is_nan() || least >= 0.5 {
                break;
            }
            let xi = (a.0.gap - b.0.gap) / (c.0.gap - b.0.gap);
            let phi = (a.1 - b.1) / (c.1 - b.1);
            part = 0.5;
            if phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi {
                let by_b = a.1 / (b.1 - a.1) * c.1 / (b.1 - c.1);
                let ratio = (c.0.gap - a.0.gap) / (b.0.gap - a.0.gap);
                part = by_b + ratio * a.1 / (c.1 - a.1) * b.1 / (c.1 - b.1);
            }
            part = part.clamp(least, 1.0 - least);
        }
        if a.1.abs() < b.1.abs() { a.0 } else { b.0 }
    }

    fn pieces(&self, near: f64, far: f64) -> Vec<Piece> {
        let branches = 0..self.nonlinear.static_law().branches();
        branches
            .flat_map(|branch| self.pieces_of(branch, near, far))
            .collect()
    }

    /// Separations at which a branch is looked at, falling.
    fn gaps(&self, branch: usize, near: f64, far: f64) -> Vec<f64> {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for exit in self.nonlinear.static_law().exits(branch) {
            match exit.guard {
                Guard::Falls(level) => low = low.max(level),
                Guard::Rises(level) => high = high.min(level),
                Guard::Turns | Guard::Own(_) => {}
            }
        }
        // A branch may begin or end before contact, as at a bridge of liquid.
        let contact = self.nonlinear.contact_gap().unwrap_or(0.0);
        let contact = contact.max(low).min(high);
        let range = (far - near).max((far + self.offset - contact).abs());
        // To separations whose distances are outside the range.
        let reach = |sign: f64, outside: &dyn Fn(f64) -> bool| {
            let mut step = 1e-3 * range;
            for _ in 0..40 {
                let gap = contact + sign * step;
                if !(low..=high).contains(&gap) || outside(self.rest(branch, gap).0.distance) {
                    break;
                }
                step *= 2.0;
            }
            step
        };
        let outwards = reach(1.0, &|distance| distance >= far);
        let inwards = reach(-1.0, &|distance| distance <= near);
        let mut gaps = Vec::with_capacity(2 * POINTS + 4);
        for part in PARTS.iter() {
            gaps.push(contact + outwards * part);
            gaps.push(contact - inwards * part);
        }
        gaps.push(contact);
        gaps.retain(|gap| *gap > low && *gap < high);
        gaps.extend([low, high].into_iter().filter(|end| end.is_finite()));
        gaps.sort_by(|a, b| b.total_cmp(a));
        gaps.dedup();
        gaps
    }

    fn pieces_of(&self, branch: usize, near: f64, far: f64) -> Vec<Piece> {
        let gaps = self.gaps(branch, near, far);
        let looked_at = gaps.iter().map(|gap| self.rest(branch, *gap));
        let rests: Vec<(Rest, [f64; 2])> = looked_at
            .filter(|(rest, slopes)| rest.distance.is_finite() && !slopes[0].is_nan())
            .collect();
        let mut pieces = Vec::new();
        let mut run: Vec<Rest> = Vec::new();
        for (k, (rest, slopes)) in rests.iter().enumerate() {
            let stable = slopes[0] > 0.0;
            if let Some((before, known)) = k.checked_sub(1).map(|k| rests[k])
                && (known[0] > 0.0) != stable
            {
                let fold = self.root(&before, rest, |_, slopes| slopes[0]);
                run.push(fold);
                pieces.extend(self.cut(std::mem::take(&mut run), known[0] > 0.0, near, far));
                run.push(fold);
            }
            run.push(*rest);
        }
        if let Some((_, slopes)) = rests.last() {
            pieces.extend(self.cut(run, slopes[0] > 0.0, near, far));
        }
        pieces
    }

    /// The part of rests of one stability between two distances.
    fn cut(&self, mut rests: Vec<Rest>, stable: bool, near: f64, far: f64) -> Option<Piece> {
        rests.dedup_by(|a, b| a.gap == b.gap);
        let mut whole = Vec::with_capacity(rests.len() + 2);
        for pair in rests.windows(2) {
            whole.push(pair[0]);
            let mut ends: Vec<Rest> = [near, far]
                .into_iter()
                .filter(|level| (pair[0].distance - level) * (pair[1].distance - level) < 0.0)
                .map(|level| Rest {
                    // To the bit, so that the end is found again.
                    distance: level,
                    ..self.root(&pair[0], &pair[1], |rest, _| rest.distance - level)
                })
                .collect();
            ends.sort_by(|a, b| b.gap.total_cmp(&a.gap));
            whole.extend(ends);
        }
        whole.extend(rests.last().copied());
        let inside = |rest: &Rest| (near..=far).contains(&rest.distance);
        let first = whole.iter().position(inside)?;
        let last = whole.iter().rposition(inside)?;
        if first == last {
            return None;
        }
        let cut = [first > 0, last + 1 < whole.len()];
        let rests = whole[first..=last].to_vec();
        let numbered = rests.iter().enumerate();
        let (k, least) = numbered.min_by(|a, b| a.1.force.total_cmp(&b.1.force))?;
        let mut lowest = *least;
        if k > 0 && k + 1 < rests.len() {
            let sides = [&rests[k - 1], &rests[k + 1]];
            let [a, b] = sides.map(|rest| self.rest(lowest.branch, rest.gap).1[1]);
            if a * b < 0.0 {
                lowest = self.root(sides[0], sides[1], |_, slopes| slopes[1]);
            }
        }
        Some(Piece {
            contact: self.nonlinear.static_law().touches(lowest.branch),
            stable,
            rests,
            lowest,
            cut,
        })
    }
}

/// The static branches of a plan.
pub(super) fn statics(plan: &Plan<'_>) -> BranchesAndJumps {
    plan.statics
        .branches_and_jumps(plan.path.to, plan.path.from)
}
