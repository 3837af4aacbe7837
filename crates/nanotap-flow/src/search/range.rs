//! The least and the greatest value of a signal over a stretch, from the tabulated points and
//! quintics that certify a flight.
//!
//! Between two points the signal lies within the Bernstein coefficients of its quintic, up to the
//! quintic's error (see [`walk`](super::walk)). Most intervals therefore cannot contain an extremum
//! of the stretch: they do not reach the value found before, or the best of the points. In one that
//! can, Newton's method on the signal's rate starts at the quintic's own extremum. Its result is
//! proved to be the interval's extremum: with curvature `κ` there and a bound `B` of the third
//! derivative the signal is concave (or convex) within `|κ|/B` on either side, and the quintic's
//! coefficients outside do not exceed the result. If that proof fails, certified steps find the
//! roots of the rate.

use super::interval::{Interval, Point};
use super::sign_changes;
use super::tabulated::{Followed, Grid, ROUNDING, Table};
use crate::regime::Kernel;
use crate::signal::Signal;
use crate::simd::{ComplexVector, Simd, Vector, WIDTH, Work, layout};

/// Least and greatest value; minus or plus infinity if that extremum is not requested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) least: f64,
    pub(crate) greatest: f64,
}

impl Range {
    /// Extends the range by one more value.
    #[inline(always)]
    pub(crate) fn hold(&mut self, value: f64) {
        self.least = self.least.min(value);
        self.greatest = self.greatest.max(value);
    }
}

/// Value, rate and curvature at the points of a stretch, four to a vector.
pub(crate) type Points = Vec<[Vector; 3]>;

/// Limit below which a value counts as zero, as a multiple of a signal's noise.
const DROWNED: f64 = 32.0;
/// Newton's method ends when its step, as an angle of the fastest term in radians, is below this:
/// the error of the series is then below rounding.
const LAST_STEP: f64 = 3e-4;
/// Number of steps of Newton's method after which it is abandoned.
const MAX_STEPS: usize = 5;

/// Work space of a search for extrema.
#[derive(Clone, Debug, Default)]
pub(crate) struct RangeWork {
    signal: Signal,
    followed: Followed,
    points: Points,
}

/// The arguments of a search for the extrema in `(0, length)` of an output that starts with these
/// coordinates and phasors; the search extends `range` by them.
pub(crate) struct Extend<'a> {
    pub(crate) range: &'a mut Range,
    pub(crate) table: &'a Table,
    pub(crate) kernel: &'a Kernel,
    pub(crate) packed: &'a [ComplexVector],
    pub(crate) length: f64,
    pub(crate) work: &'a mut RangeWork,
}

impl Work for Extend<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let RangeWork {
            signal,
            followed,
            points,
        } = self.work;
        signal.refill::<S>(self.kernel, self.packed, self.length);
        if signal.is_finite() {
            extend_with::<S>(
                self.range,
                self.table,
                signal,
                followed,
                self.length,
                points,
            );
        }
    }
}

/// Extends the range for a signal without a table.
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
fn extend_with<S: Simd>(
    range: &mut Range,
    table: &Table,
    signal: &mut Signal,
    followed: &mut Followed,
    length: f64,
    points: &mut Points,
) {
    followed.follow::<S>(table, signal);
    let reach = length.min(table.reach());
    if reach < length {
        by_certified_steps(reach, length, signal, length, range);
    }
    let Some(coarse) = &table.coarse else {
        let mut search =
            RangeSearch::new::<S>(&table.fine, signal, followed, 0.0, reach, points, range);
        while let Some(open) = search.next_open::<S>(points, range) {
            extend_within::<S>(&open, table.is_complete(), signal, length, range);
        }
        return;
    };
    let mut walk = RangeSearch::new::<S>(&coarse.grid, signal, followed, 0.0, reach, points, range);
    // The fine grid's points need the space: the coarse walk's are set aside.
    let aside = std::mem::take(points);
    while let Some(open) = walk.next_open::<S>(&aside, range) {
        followed.move_to::<S>(table, &open.interval);
        let (start, end) = (open.interval.start, open.interval.end.min(reach));
        let mut search =
            RangeSearch::new::<S>(&table.fine, signal, followed, start, end, points, range);
        while let Some(open) = search.next_open::<S>(points, range) {
            extend_within::<S>(&open, table.is_complete(), signal, length, range);
        }
        followed.move_back();
    }
    *points = aside;
}

/// An interval that may contain an extremum.
#[derive(Clone, Copy, Debug)]
struct Open {
    interval: Interval,
    /// Whether the interval may reach above, and below, the known range.
    above: bool,
    below: bool,
    /// Bound of the sixth derivative, times the sixth power of the width, over 7200.
    sixth: f64,
    /// Range that is already reached: an extremum inside it does not count.
    reached: Range,
}

/// A walk along the intervals of one grid.
struct RangeSearch<'a> {
    grid: &'a Grid,
    start: f64,
    end: f64,
    sixth: f64,
    error: f64,
    /// The range or, if wider, that of the points; an interval is of interest only if it may exceed
    /// it.
    reached: Range,
    vector: usize,
    vectors: usize,
    above: u32,
    below: u32,
}

impl<'a> RangeSearch<'a> {
    /// Evaluates the points of the stretch.
    #[inline(always)]
    fn new<S: Simd>(
        grid: &'a Grid,
        signal: &Signal,
        followed: &Followed,
        start: f64,
        end: f64,
        points: &mut Points,
        range: &Range,
    ) -> Self {
        let [sixth, outside, ..] = signal.weighted_amplitudes::<S>(&grid.weights);
        let floor = outside + ROUNDING * signal.size();
        let most = grid.table.len() / grid.terms;
        // Point 0 is the start; the last interval is the one that holds the end.
        let last = ((end - start) / grid.step) as usize;
        let vectors = most.min((last + 1) / WIDTH + 1);
        points.clear();
        let zero = S::splat(0.0);
        let (mut highest, mut lowest) = (S::splat(f64::MIN), S::splat(f64::MAX));
        for vector in 0..vectors {
            let (mut g, mut v, mut c) = (S::splat(signal.constant), zero, zero);
            let table = &grid.table[vector * grid.terms..][..grid.terms];
            for (amplitude, [re, im]) in followed.amplitudes().iter().zip(table) {
                let (re, im) = (S::load(re), S::load(im));
                let [[gr, gi], [vr, vi], [cr, ci]] = amplitude;
                g = S::fnma(S::load(gi), im, S::fma(S::load(gr), re, g));
                v = S::fnma(S::load(vi), im, S::fma(S::load(vr), re, v));
                c = S::fnma(S::load(ci), im, S::fma(S::load(cr), re, c));
            }
            points.push([S::store(g), S::store(v), S::store(c)]);
            if (vector + 1) * WIDTH <= last + 1 {
                highest = S::max(highest, g);
                lowest = S::min(lowest, g);
            }
        }
        let (highest, lowest) = (S::store(highest), S::store(lowest));
        let mut reached = Range {
            least: lowest.into_iter().fold(f64::MAX, f64::min) + floor,
            greatest: highest.into_iter().fold(f64::MIN, f64::max) - floor,
        };
        // A vector that reaches beyond the end.
        for k in (last + 1) / WIDTH * WIDTH..=last.min(vectors * WIDTH - 1) {
            let (vector, lane) = layout::place(k);
            let value = points[vector][0][lane];
            reached.least = reached.least.min(value + floor);
            reached.greatest = reached.greatest.max(value - floor);
        }
        reached.least = reached.least.min(range.least);
        reached.greatest = reached.greatest.max(range.greatest);
        Self {
            grid,
            start,
            end,
            sixth,
            error: sixth / 6.4 + floor,
            reached,
            vector: 0,
            vectors,
            above: 0,
            below: 0,
        }
    }

    /// Returns the next interval that may reach beyond `range` or the points.
    #[inline(always)]
    fn next_open<S: Simd>(&mut self, points: &Points, range: &Range) -> Option<Open> {
        self.reached.least = self.reached.least.min(range.least);
        self.reached.greatest = self.reached.greatest.max(range.greatest);
        while self.above | self.below == 0 {
            if self.vector >= self.vectors {
                return None;
            }
            self.look_at_next::<S>(points);
        }
        let lane = (self.above | self.below).trailing_zeros() as usize;
        let bit = 1_u32 << lane;
        let (above, below) = (self.above & bit != 0, self.below & bit != 0);
        self.above &= !bit;
        self.below &= !bit;
        let right = (self.vector - 1) * WIDTH + lane;
        let start = self.start + (right - 1) as f64 * self.grid.step;
        if start >= self.end {
            self.vector = self.vectors;
            (self.above, self.below) = (0, 0);
            return None;
        }
        let point = |k: usize| {
            let (vector, lane) = layout::place(k);
            let [value, rate, curvature] = points[vector].map(|lanes| lanes[lane]);
            Point {
                value,
                rate,
                curvature,
            }
        };
        Some(Open {
            interval: Interval {
                start,
                end: self.start + right as f64 * self.grid.step,
                point: right - 1,
                width: self.grid.step,
                ends: [point(right - 1), point(right)],
                error: self.error,
            },
            above,
            below,
            sixth: self.sixth,
            reached: self.reached,
        })
    }

    /// Finds which of the intervals that end at the next vector's points may reach beyond.
    #[inline(always)]
    fn look_at_next<S: Simd>(&mut self, points: &Points) {
        let h = self.grid.step;
        let (fifth, two_fifths) = (S::splat(0.2 * h), S::splat(0.4 * h));
        let twentieth = S::splat(h * h / 20.0);
        let load = |vector: usize| {
            let [g, v, c] = &points[vector];
            let (g, v) = (S::load(g), S::load(v));
            (g, v, S::fma(S::load(c), twentieth, g))
        };
        let (g, v, bent) = load(self.vector);
        let (g0, v0, bent0) = load(self.vector.saturating_sub(1));
        let left = |g, v, bent| (S::fma(v, fifth, g), S::fma(v, two_fifths, bent));
        let ((b1, b2), (p1, p2)) = (left(g, v, bent), left(g0, v0, bent0));
        let (b4, b3) = (S::fnma(v, fifth, g), S::fnma(v, two_fifths, bent));
        let highest = S::max(
            S::shifted_in(S::max(g0, S::max(p1, p2)), S::max(g, S::max(b1, b2))),
            S::max(g, S::max(b4, b3)),
        );
        let lowest = S::min(
            S::shifted_in(S::min(g0, S::min(p1, p2)), S::min(g, S::min(b1, b2))),
            S::min(g, S::min(b4, b3)),
        );
        self.above = S::below(S::splat(self.reached.greatest - self.error), highest);
        self.below = S::below(lowest, S::splat(self.reached.least + self.error));
        if self.vector == 0 {
            // There is no interval before the first point.
            self.above &= !1;
            self.below &= !1;
        }
        self.vector += 1;
    }
}

/// Extends `range` by the extrema of an interval that may contain some.
#[inline(always)]
fn extend_within<S: Simd>(
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
        match extremum::<S>(open, side, complete, signal, length) {
            Extremum::Value(value) => range.hold(value),
            Extremum::None => {}
            Extremum::Unknown => {
                let Interval { start, end, .. } = open.interval;
                by_certified_steps(start, end, signal, length, range);
            }
        }
    }
}

/// The conclusion about the extremum in an interval.
enum Extremum {
    /// The signal's extremum in it.
    Value(f64),
    /// The interval certainly contains no extremum beyond the known range.
    None,
    /// No proof: the interval is left to certified steps.
    Unknown,
}

/// Determines the greatest value in an interval (`side` 1), or the least (`side` −1).
#[inline(always)]
fn extremum<S: Simd>(
    open: &Open,
    side: f64,
    complete: bool,
    signal: &mut Signal,
    length: f64,
) -> Extremum {
    let interval = &open.interval;
    let h = interval.width;
    let [p, q] = interval.ends;
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
    let mut at = interval.start + t * h;
    for _ in 0..MAX_STEPS {
        let (jet, jerk) = signal.jet_keeping_factors::<S>(at);
        let (rate, curvature, jerk) = (side * jet.rate, side * jet.curvature, side * jerk);
        if curvature >= 0.0 || curvature.is_nan() {
            return Extremum::Unknown;
        }
        let step = -rate / curvature;
        let step = -rate / (curvature + 0.5 * jerk * step);
        let angle = step.abs() * signal.fastest();
        if angle.is_nan() || angle > LAST_STEP {
            at = (at + step).clamp(interval.start - h, interval.end + h);
            continue;
        }
        at += step;
        if at < 0.0 {
            // The bound of the third derivative does not hold before the start.
            return Extremum::Unknown;
        }
        let value = side * jet.value + step * (rate + step * (0.5 * curvature + step * jerk / 6.0));
        let inside = at <= length;
        // Concave this far on either side, and beyond that not higher.
        let reach = 0.99 * -(curvature + jerk * step) / jet.third;
        let limit = if inside { value.max(reached) } else { reached } - interval.error;
        let before = (at - reach - interval.start) / h;
        let after = (at + reach - interval.start) / h;
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

/// Returns the greatest Bernstein coefficient on the part from `from` to `to` of the unit interval.
fn part(hull: &[f64; 6], from: f64, to: f64) -> f64 {
    let mut right = *hull;
    // De Casteljau's triangle: its last entries are the coefficients beyond `from` …
    for grid in 1..6 {
        for i in 0..6 - grid {
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
    for grid in 1..6 {
        for i in 0..6 - grid {
            right[i] += until * (right[i + 1] - right[i]);
        }
        highest = highest.max(right[0]);
    }
    highest
}

/// Extends `range` by all extrema between `start` and `end`, from the roots of the rate found by
/// certified steps.
#[cold]
fn by_certified_steps(start: f64, end: f64, signal: &Signal, length: f64, range: &mut Range) {
    let start = start.max(0.0);
    let width = end.min(length) - start;
    if width <= 0.0 {
        return;
    }
    if start > 0.0 {
        // A root of the rate just there is no change of sign within.
        range.hold(signal.at(start));
    }
    let rate = signal.differentiated(length).shifted(start, 1.0, width);
    for s in sign_changes(&rate, width) {
        range.hold(signal.at(start + s));
    }
}
