//! Two neighbouring points of a table, the quintic that agrees with value, rate and curvature
//! at both, and the cubic that leads from near its zero to the signal's.
//!
//! The polynomials are written for lanes: one motion has one, eight side by side have eight.

use crate::simd::{Lanes, Simd, Single};

/// Value, rate and curvature of a signal at a point of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Point {
    pub(crate) value: f64,
    pub(crate) rate: f64,
    pub(crate) curvature: f64,
}

/// An interval between two neighbouring points of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    /// Time of the left end, from the start of the stretch.
    pub(crate) start: f64,
    /// Time of the right end, from the start of the stretch.
    pub(crate) end: f64,
    /// Number of the point at the left end.
    pub(crate) point: usize,
    pub(crate) width: f64,
    /// Signal at the left and at the right end.
    pub(crate) ends: [Point; 2],
    /// Bound on the distance from the quintic to the signal within the interval.
    pub(crate) error: f64,
}

impl Point {
    /// Returns the points in one lane of sums over terms.
    #[inline(always)]
    pub(crate) fn of<S: Simd>(sums: &[S::Register; 3], lane: usize) -> Self {
        Self {
            value: S::store(sums[0])[lane],
            rate: S::store(sums[1])[lane],
            curvature: S::store(sums[2])[lane],
        }
    }

    /// Returns value, rate and curvature, in this order.
    #[inline(always)]
    pub(crate) fn numbers(self) -> [f64; 3] {
        [self.value, self.rate, self.curvature]
    }
}

impl Interval {
    /// Returns the quintic that agrees with value, rate and curvature at both ends.
    #[inline(always)]
    pub(crate) fn quintic(&self) -> Quintic<Single> {
        Quintic {
            width: self.width,
            ends: self.ends.map(Point::numbers),
        }
    }

    /// Reports whether the signal is certainly above zero at the start and below at the end.
    #[inline(always)]
    pub(crate) fn crosses(&self) -> bool {
        self.ends[0].value > self.error && self.ends[1].value < -self.error
    }
}

/// A quintic in an interval's Bernstein form, one per lane.
pub(crate) struct Quintic<L: Lanes> {
    /// Width of the interval, in time.
    pub(crate) width: L::Register,
    /// Value, rate and curvature at both ends.
    pub(crate) ends: [[L::Register; 3]; 2],
}

impl<L: Lanes> Quintic<L> {
    /// Returns bounds of its rate: the least and the greatest Bernstein coefficient of the rate,
    /// which are five times the differences of the quintic's own over the width.
    #[inline(always)]
    pub(crate) fn rates(&self) -> [L::Register; 2] {
        let [[p, u, a], [q, v, b]] = self.ends;
        let h = self.width;
        let part = |factor: f64, x| L::mul(L::splat(factor), x);
        let bent = part(0.05, L::mul(h, h));
        let first = part(0.2, L::mul(h, u));
        let second = L::fma(bent, a, first);
        let last = part(0.2, L::mul(h, v));
        let last_but_one = L::fnma(bent, b, last);
        let rest = L::sub(
            L::sub(q, p),
            L::add(L::add(first, second), L::add(last, last_but_one)),
        );
        let all = [second, rest, last_but_one, last];
        let least = all.iter().fold(first, |least, x| L::min(least, *x));
        let greatest = all.iter().fold(first, |greatest, x| L::max(greatest, *x));
        let factor = L::div(L::splat(5.0), h);
        [L::mul(factor, least), L::mul(factor, greatest)]
    }

    /// Returns the place at which it falls through zero, as a fraction of the width from the start,
    /// for a quintic that falls throughout from above zero to below.
    #[inline(always)]
    pub(crate) fn zero(&self) -> L::Register {
        let [[p, u, a], [q, v, b]] = self.ends;
        let h = self.width;
        let c = L::splat;
        let (u, v) = (L::mul(h, u), L::mul(h, v));
        let h2 = L::mul(h, h);
        let (a, b) = (L::mul(h2, a), L::mul(h2, b));
        // A first guess from the inverse function's cubic through both ends.
        let fall = L::sub(p, q);
        let part = L::div(p, fall);
        let other = L::sub(c(1.0), part);
        // Of `other · left − part · right` with `left = −fall/u`, `right = −fall/v`.
        let slopes = L::div(fall, L::mul(u, v));
        let sides = L::mul(slopes, L::sub(L::mul(part, u), L::mul(other, v)));
        let straight = L::mul(L::mul(part, part), L::fnma(c(2.0), part, c(3.0)));
        let guess = L::fma(L::mul(part, other), sides, straight);
        let t = L::clamp(guess, 0.0, 1.0);
        // One Newton step on the quintic in powers of t.
        let (c1, c2) = (u, L::mul(c(0.5), a));
        let r0 = L::sub(L::sub(L::sub(q, p), c1), c2);
        let r1 = L::fnma(c(2.0), c2, L::sub(v, c1));
        let r2 = L::fnma(c(2.0), c2, b);
        let c3 = L::fma(c(10.0), r0, L::fma(c(-4.0), r1, L::mul(c(0.5), r2)));
        let c4 = L::fma(c(-15.0), r0, L::fma(c(7.0), r1, L::sub(c(0.0), r2)));
        let c5 = L::fma(c(6.0), r0, L::fma(c(-3.0), r1, L::mul(c(0.5), r2)));
        let t2 = L::mul(t, t);
        let low = L::fma(c1, t, p);
        let middle = L::fma(c3, t, c2);
        let high = L::fma(c5, t, c4);
        let value = L::fma(t2, L::fma(t2, high, middle), low);
        let low = L::fma(L::mul(c(2.0), c2), t, c1);
        let middle = L::fma(L::mul(c(4.0), c4), t, L::mul(c(3.0), c3));
        let high = L::mul(c(5.0), c5);
        let slope = L::fma(t2, L::fma(t2, high, middle), low);
        L::clamp(L::sub(t, L::div(value, slope)), 0.0, 1.0)
    }
}

/// Value and first three derivatives near a zero, one signal per lane.
pub(crate) struct Cubic<L: Lanes> {
    pub(crate) value: L::Register,
    pub(crate) rate: L::Register,
    pub(crate) curvature: L::Register,
    pub(crate) jerk: L::Register,
}

impl<L: Lanes> Cubic<L> {
    /// Returns the distance to its zero: that of the parabola, improved by one step of Newton's
    /// method; NaN if the parabola has no zero.
    #[inline(always)]
    pub(crate) fn step(&self) -> L::Register {
        let doubled = L::mul(L::splat(2.0), self.value);
        let discriminant = L::fnma(doubled, self.curvature, L::mul(self.rate, self.rate));
        let first = L::div(doubled, L::sub(L::sqrt(discriminant), self.rate));
        let cubed = L::mul(L::mul(first, first), L::mul(first, self.jerk));
        let slope = L::mul(L::splat(6.0), self.slope(first));
        L::sub(first, L::div(cubed, slope))
    }

    /// Returns its slope at a distance `h`.
    #[inline(always)]
    pub(crate) fn slope(&self, h: L::Register) -> L::Register {
        let half = L::mul(L::splat(0.5), self.jerk);
        L::fma(h, L::fma(half, h, self.curvature), self.rate)
    }

    /// Returns its value at a distance `h`.
    #[inline(always)]
    pub(crate) fn at(&self, h: L::Register) -> L::Register {
        let sixth = L::mul(L::splat(1.0 / 6.0), self.jerk);
        let half = L::mul(L::splat(0.5), self.curvature);
        let slope = L::fma(h, L::fma(h, sixth, half), self.rate);
        L::fma(h, slope, self.value)
    }
}
