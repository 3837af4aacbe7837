//! The least and the greatest value of a signal over a stretch, from the tabulated points and
//! quintics that certify a flight.
//!
//! Between two points the signal lies within the Bernstein coefficients of its quintic, give
//! or take the quintic's error (see [`lattice`](crate::lattice)). Most intervals therefore
//! cannot hold an extremum: they do not reach what was found before, or the best of the points.
//! In one that can, the quintic's own extremum is where Newton's method on the signal's rate
//! begins. What it finds is proved to be the interval's extremum: with curvature `κ` there and
//! `B` a bound of the third derivative the signal is concave (or convex) within `|κ|/B` on
//! either side, and beyond that the quintic's coefficients are not beyond it. What cannot be
//! proved so is left to the roots of the rate, found by certified steps.

use crate::extrema::sign_changes;
use crate::lattice::{Cell, Lattice, Level, Point, ROUNDING};
#[cfg(target_arch = "x86_64")]
use crate::pack::Fused;
use crate::pack::{self, Math, Pack, Plain, WIDTH};
use crate::regime::Kernel;
use crate::signal::Signal;

/// Least and greatest value; not looked for where it is minus or plus infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) least: f64,
    pub(crate) greatest: f64,
}

impl Range {
    /// With one more value.
    #[inline(always)]
    pub(crate) fn hold(&mut self, value: f64) {
        self.least = self.least.min(value);
        self.greatest = self.greatest.max(value);
    }
}

/// Value, rate and curvature at the points of a stretch, four to a pack.
pub(crate) type Points = Vec<[Pack; 3]>;

/// The rounding of a value that is known to be zero, in units of a signal's noise.
const DROWNED: f64 = 32.0;
/// Newton's method ends when its step, as an angle of the fastest term, is below this: what the
/// series then leaves out is below rounding.
const LAST_STEP: f64 = 3e-4;
/// Steps before it is given up.
const MOST_STEPS: usize = 5;

/// Work space of a search for extrema.
#[derive(Clone, Debug, Default)]
pub(crate) struct RangeWork {
    signal: Signal,
    points: Points,
}

/// Extends `range` by the extrema in `(0, length)` of an output that starts with these
/// coordinates and phasors.
pub(crate) fn extend(
    range: &mut Range,
    lattice: &Lattice,
    kernel: &Kernel,
    packed: &[[Pack; 2]],
    length: f64,
    work: &mut RangeWork,
) {
    #[cfg(target_arch = "x86_64")]
    if pack::fused_available() {
        // SAFETY: the machine has these instructions.
        return unsafe { extend_fused(range, lattice, kernel, packed, length, work) };
    }
    extend_in::<Plain>(range, lattice, kernel, packed, length, work);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn extend_fused(
    range: &mut Range,
    lattice: &Lattice,
    kernel: &Kernel,
    packed: &[[Pack; 2]],
    length: f64,
    work: &mut RangeWork,
) {
    extend_in::<Fused>(range, lattice, kernel, packed, length, work);
}

#[inline(always)]
fn extend_in<M: Math>(
    range: &mut Range,
    lattice: &Lattice,
    kernel: &Kernel,
    packed: &[[Pack; 2]],
    length: f64,
    work: &mut RangeWork,
) {
    let RangeWork { signal, points } = work;
    signal.refill::<M>(kernel, packed, length);
    if signal.is_finite() {
        extend_with::<M>(range, lattice, signal, length, points);
    }
}

/// The same of a signal without a table.
#[cold]
pub(crate) fn extend_by_certified_steps(range: &mut Range, signal: &Signal, length: f64) {
    for end in [signal.at(0.0), signal.at(length)] {
        range.hold(if end.abs() <= DROWNED * signal.noise() {
            0.0
        } else {
            end
        });
    }
    for s in sign_changes(&signal.differentiated(length), length) {
        range.hold(signal.at(s));
    }
}

#[inline(always)]
fn extend_with<M: Math>(
    range: &mut Range,
    lattice: &Lattice,
    signal: &mut Signal,
    length: f64,
    points: &mut Points,
) {
    signal.follow::<M>(lattice.followed());
    let Some(coarse) = &lattice.coarse else {
        let mut search = RangeSearch::new::<M>(&lattice.fine, signal, 0.0, length, points, range);
        while let Some(open) = search.next_open::<M>(points, range) {
            settle::<M>(&open, lattice.is_complete(), signal, length, range);
        }
        return;
    };
    let mut walk = RangeSearch::new::<M>(&coarse.level, signal, 0.0, length, points, range);
    // The fine level's points need the space: the coarse walk's are set aside.
    let aside = std::mem::take(points);
    while let Some(open) = walk.next_open::<M>(&aside, range) {
        signal.follow_from::<M>(lattice, &open.cell);
        let (start, end) = (open.cell.start, open.cell.end.min(length));
        let mut search = RangeSearch::new::<M>(&lattice.fine, signal, start, end, points, range);
        while let Some(open) = search.next_open::<M>(points, range) {
            settle::<M>(&open, lattice.is_complete(), signal, length, range);
        }
        signal.follow_from_start();
    }
    *points = aside;
}

/// An interval that may hold an extremum.
#[derive(Clone, Copy, Debug)]
struct Open {
    cell: Cell,
    /// Whether it may reach above, and below, what is known.
    above: bool,
    below: bool,
    /// Bound of the sixth derivative, times the width's sixth power over 7200.
    sixth: f64,
    /// What is reached already.
    reached: Range,
}

/// A walk along the intervals of one level.
struct RangeSearch<'a> {
    level: &'a Level,
    start: f64,
    end: f64,
    sixth: f64,
    error: f64,
    /// The range or, if wider, that of the points: what an interval must exceed.
    reached: Range,
    pack: usize,
    packs: usize,
    above: u32,
    below: u32,
}

impl<'a> RangeSearch<'a> {
    /// Evaluates the points of the stretch.
    #[inline(always)]
    fn new<M: Math>(
        level: &'a Level,
        signal: &Signal,
        start: f64,
        end: f64,
        points: &mut Points,
        range: &Range,
    ) -> Self {
        let [sixth, outside] = signal.weighted_amplitudes::<M>(&level.weights);
        let floor = outside + ROUNDING * signal.size();
        let most = level.table.len() / level.terms;
        // Point 0 is the start; the last interval is the one that holds the end.
        let last = ((end - start) / level.step) as usize;
        let packs = most.min((last + 1) / WIDTH + 1);
        points.clear();
        let zero = M::splat(0.0);
        let (mut highest, mut lowest) = (M::splat(f64::MIN), M::splat(f64::MAX));
        for pack in 0..packs {
            let (mut g, mut v, mut c) = (M::splat(signal.constant), zero, zero);
            let table = &level.table[pack * level.terms..][..level.terms];
            for (amplitude, [re, im]) in signal.followed().iter().zip(table) {
                let (re, im) = (M::load(re), M::load(im));
                let [[gr, gi], [vr, vi], [cr, ci]] = amplitude;
                g = M::fnma(M::load(gi), im, M::fma(M::load(gr), re, g));
                v = M::fnma(M::load(vi), im, M::fma(M::load(vr), re, v));
                c = M::fnma(M::load(ci), im, M::fma(M::load(cr), re, c));
            }
            points.push([M::store(g), M::store(v), M::store(c)]);
            if (pack + 1) * WIDTH <= last + 1 {
                highest = M::max(highest, g);
                lowest = M::min(lowest, g);
            }
        }
        let (highest, lowest) = (M::store(highest), M::store(lowest));
        let mut reached = Range {
            least: lowest.into_iter().fold(f64::MAX, f64::min) + floor,
            greatest: highest.into_iter().fold(f64::MIN, f64::max) - floor,
        };
        // A pack that reaches beyond the end.
        for k in (last + 1) / WIDTH * WIDTH..=last.min(packs * WIDTH - 1) {
            let value = points[k / WIDTH][0][k % WIDTH];
            reached.least = reached.least.min(value + floor);
            reached.greatest = reached.greatest.max(value - floor);
        }
        reached.least = reached.least.min(range.least);
        reached.greatest = reached.greatest.max(range.greatest);
        Self {
            level,
            start,
            end,
            sixth,
            error: sixth / 6.4 + floor,
            reached,
            pack: 0,
            packs,
            above: 0,
            below: 0,
        }
    }

    /// The next interval that may reach beyond `range` or the points.
    #[inline(always)]
    fn next_open<M: Math>(&mut self, points: &Points, range: &Range) -> Option<Open> {
        self.reached.least = self.reached.least.min(range.least);
        self.reached.greatest = self.reached.greatest.max(range.greatest);
        while self.above | self.below == 0 {
            if self.pack >= self.packs {
                return None;
            }
            self.look_at_pack::<M>(points);
        }
        let lane = (self.above | self.below).trailing_zeros() as usize;
        let bit = 1_u32 << lane;
        let (above, below) = (self.above & bit != 0, self.below & bit != 0);
        self.above &= !bit;
        self.below &= !bit;
        let right = (self.pack - 1) * WIDTH + lane;
        let start = self.start + (right - 1) as f64 * self.level.step;
        if start >= self.end {
            self.pack = self.packs;
            (self.above, self.below) = (0, 0);
            return None;
        }
        let point = |k: usize| {
            let [g, v, c] = &points[k / WIDTH];
            Point {
                value: g[k % WIDTH],
                rate: v[k % WIDTH],
                curvature: c[k % WIDTH],
            }
        };
        Some(Open {
            cell: Cell {
                start,
                end: self.start + right as f64 * self.level.step,
                point: right - 1,
                width: self.level.step,
                ends: [point(right - 1), point(right)],
                error: self.error,
            },
            above,
            below,
            sixth: self.sixth,
            reached: self.reached,
        })
    }

    /// Finds which of the intervals that end at the next pack's points may reach beyond.
    #[inline(always)]
    fn look_at_pack<M: Math>(&mut self, points: &Points) {
        let h = self.level.step;
        let (fifth, two_fifths) = (M::splat(0.2 * h), M::splat(0.4 * h));
        let twentieth = M::splat(h * h / 20.0);
        let load = |pack: usize| {
            let [g, v, c] = &points[pack];
            let (g, v) = (M::load(g), M::load(v));
            (g, v, M::fma(M::load(c), twentieth, g))
        };
        let (g, v, bent) = load(self.pack);
        let (g0, v0, bent0) = load(self.pack.saturating_sub(1));
        let left = |g, v, bent| (M::fma(v, fifth, g), M::fma(v, two_fifths, bent));
        let ((b1, b2), (p1, p2)) = (left(g, v, bent), left(g0, v0, bent0));
        let (b4, b3) = (M::fnma(v, fifth, g), M::fnma(v, two_fifths, bent));
        let highest = M::max(
            M::shifted_in(M::max(g0, M::max(p1, p2)), M::max(g, M::max(b1, b2))),
            M::max(g, M::max(b4, b3)),
        );
        let lowest = M::min(
            M::shifted_in(M::min(g0, M::min(p1, p2)), M::min(g, M::min(b1, b2))),
            M::min(g, M::min(b4, b3)),
        );
        self.above = M::below(M::splat(self.reached.greatest - self.error), highest);
        self.below = M::below(lowest, M::splat(self.reached.least + self.error));
        if self.pack == 0 {
            // There is no interval before the first point.
            self.above &= !1;
            self.below &= !1;
        }
        self.pack += 1;
    }
}

/// Extends `range` by the extrema of an interval that may hold some.
#[inline(always)]
fn settle<M: Math>(
    open: &Open,
    complete: bool,
    signal: &mut Signal,
    length: f64,
    range: &mut Range,
) {
    for (wanted, side) in [(open.above, 1.0), (open.below, -1.0)] {
        if !wanted {
            continue;
        }
        match extremum::<M>(open, side, complete, signal, length) {
            Extremum::Value(value) => range.hold(value),
            Extremum::None => {}
            Extremum::Unknown => by_certified_steps(&open.cell, signal, length, range),
        }
    }
}

/// What was proved of an interval.
enum Extremum {
    /// The signal's extremum in it.
    Value(f64),
    /// It holds none beyond what is known.
    None,
    /// Nothing.
    Unknown,
}

/// The greatest value in an interval (`side` 1), or the least (`side` −1).
#[inline(always)]
fn extremum<M: Math>(
    open: &Open,
    side: f64,
    complete: bool,
    signal: &mut Signal,
    length: f64,
) -> Extremum {
    let cell = &open.cell;
    let h = cell.width;
    let [p, q] = cell.ends;
    let (u, v) = (side * h * p.rate, side * h * q.rate);
    let (a, c) = (side * h * h * p.curvature, side * h * h * q.curvature);
    let (first, last) = (side * p.value, side * q.value);
    let hull = [
        first,
        first + 0.2 * u,
        first + 0.4 * u + 0.05 * a,
        last - 0.4 * v + 0.05 * c,
        last - 0.2 * v,
        last,
    ];
    let falls: [f64; 5] = std::array::from_fn(|i| hull[i] - hull[i + 1]);
    // |ė| ≤ √5 M₆h⁵/30000 of the quintic's rate, which is 5/h times these differences.
    let margin = 0.108 * open.sixth + 8.0 * ROUNDING * signal.size();
    let monotone = falls.iter().all(|f| *f > margin) || falls.iter().all(|f| *f < -margin);
    if complete && monotone {
        return Extremum::None;
    }
    let reached = if side > 0.0 {
        open.reached.greatest
    } else {
        -open.reached.least
    };
    // The quintic's own extremum.
    let r0 = last - first - u - 0.5 * a;
    let r1 = v - u - a;
    let r2 = c - a;
    let c3 = 10.0 * r0 - 4.0 * r1 + 0.5 * r2;
    let c4 = -15.0 * r0 + 7.0 * r1 - r2;
    let c5 = 6.0 * r0 - 3.0 * r1 + 0.5 * r2;
    let mut t = if falls[0] < 0.0 && falls[4] > 0.0 {
        falls[0] / (falls[0] - falls[4])
    } else {
        0.5
    };
    for _ in 0..3 {
        let rate = u + t * (a + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)));
        let curvature = a + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5));
        let next = t - rate / curvature;
        t = if next.is_finite() {
            next.clamp(0.0, 1.0)
        } else {
            0.5
        };
    }
    // The signal's.
    let mut at = cell.start + t * h;
    for _ in 0..MOST_STEPS {
        let (jet, jerk) = signal.jet_keeping_factors::<M>(at);
        let (rate, curvature, jerk) = (side * jet.rate, side * jet.curvature, side * jerk);
        if curvature >= 0.0 || curvature.is_nan() {
            return Extremum::Unknown;
        }
        let step = -rate / curvature;
        let step = -rate / (curvature + 0.5 * jerk * step);
        let angle = step.abs() * signal.fastest();
        if angle.is_nan() || angle > LAST_STEP {
            at = (at + step).clamp(cell.start - h, cell.end + h);
            continue;
        }
        at += step;
        let value = side * jet.value + step * (rate + step * (0.5 * curvature + step * jerk / 6.0));
        let inside = at >= 0.0 && at <= length;
        // Concave this far on either side, and beyond that not higher.
        let reach = 0.99 * -(curvature + jerk * step) / jet.third;
        let limit = if inside { value.max(reached) } else { reached } - cell.error;
        let before = (at - reach - cell.start) / h;
        let after = (at + reach - cell.start) / h;
        let proved = (before <= 0.0 || part(&hull, 0.0, before.min(1.0)) <= limit)
            && (after >= 1.0 || part(&hull, after.max(0.0), 1.0) <= limit);
        return match (proved, inside) {
            (true, true) => Extremum::Value(side * value),
            (true, false) => Extremum::None,
            (false, _) => Extremum::Unknown,
        };
    }
    Extremum::Unknown
}

/// The greatest Bernstein coefficient on the part from `from` to `to` of the unit interval.
fn part(hull: &[f64; 6], from: f64, to: f64) -> f64 {
    let mut right = *hull;
    // De Casteljau's triangle: its last entries are the coefficients beyond `from` …
    for level in 1..6 {
        for i in 0..6 - level {
            right[i] += from * (right[i + 1] - right[i]);
        }
    }
    // … and its first ones, of what is left, those before `to`.
    let until = if from < 1.0 {
        (to - from) / (1.0 - from)
    } else {
        1.0
    };
    let mut highest = right[0];
    for level in 1..6 {
        for i in 0..6 - level {
            right[i] += until * (right[i + 1] - right[i]);
        }
        highest = highest.max(right[0]);
    }
    highest
}

/// The same from every root of the rate, found by certified steps.
#[cold]
fn by_certified_steps(cell: &Cell, signal: &Signal, length: f64, range: &mut Range) {
    let start = cell.start.max(0.0);
    let width = cell.end.min(length) - start;
    if width <= 0.0 {
        return;
    }
    let rate = signal.differentiated(length).shifted(start, 1.0, width);
    for s in sign_changes(&rate, width) {
        range.hold(signal.at(start + s));
    }
}
