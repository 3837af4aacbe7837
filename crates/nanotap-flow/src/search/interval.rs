//! Two neighbouring points of a table, and the quintic that agrees with value, rate and curvature
//! at both.

use crate::simd::Simd;

/// Value, rate and curvature.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Point {
    pub(crate) value: f64,
    pub(crate) rate: f64,
    pub(crate) curvature: f64,
}

/// Two neighbouring points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    /// Where it begins.
    pub(crate) start: f64,
    /// Where it ends.
    pub(crate) end: f64,
    /// The number of the point where it begins.
    pub(crate) point: usize,
    /// Its width.
    pub(crate) width: f64,
    /// Its ends.
    pub(crate) ends: [Point; 2],
    /// Bound on the distance from the quintic to the signal within.
    pub(crate) error: f64,
}

/// A zero of an interval's quintic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FallingZero {
    /// Where.
    pub(crate) at: f64,
    /// How fast the quintic falls at least, anywhere in the interval.
    pub(crate) gentlest: f64,
    /// How far the signal can be from the quintic.
    pub(crate) error: f64,
}

impl Point {
    /// Those in one lane of sums over terms.
    #[inline(always)]
    pub(crate) fn of<S: Simd>(sums: &[S::Register; 3], lane: usize) -> Self {
        Self {
            value: S::store(sums[0])[lane],
            rate: S::store(sums[1])[lane],
            curvature: S::store(sums[2])[lane],
        }
    }
}

impl Interval {
    /// Where the quintic falls through zero; `None` unless it falls all the way, from above
    /// zero to below it.
    #[inline(always)]
    pub(crate) fn falling_zero(&self) -> Option<FallingZero> {
        let [p, q] = self.ends;
        let h = self.width;
        if p.value <= self.error || q.value >= -self.error {
            return None;
        }
        let (u, v) = (h * p.rate, h * q.rate);
        let (a, b) = (h * h * p.curvature, h * h * q.curvature);
        // The differences of the Bernstein coefficients: the rate's, a fifth of them.
        let first = 0.2 * u;
        let second = 0.2 * u + 0.05 * a;
        let last = 0.2 * v;
        let last_but_one = 0.2 * v - 0.05 * b;
        let rest = (q.value - p.value) - (first + second) - (last + last_but_one);
        let gentlest = first.max(second).max(rest).max(last.max(last_but_one));
        if gentlest >= 0.0 {
            return None;
        }
        // A first guess from the inverse function's cubic through both ends.
        let fall = p.value - q.value;
        let part = p.value / fall;
        let (left, right) = (-fall / u, -fall / v);
        let other = 1.0 - part;
        let guess = part * part * (3.0 - 2.0 * part) + part * other * (other * left - part * right);
        let t = guess.clamp(0.0, 1.0);
        // One Newton step on the quintic in powers of t.
        let (c1, c2) = (u, 0.5 * a);
        let r0 = q.value - p.value - c1 - c2;
        let r1 = v - c1 - 2.0 * c2;
        let r2 = b - 2.0 * c2;
        let c3 = 10.0 * r0 - 4.0 * r1 + 0.5 * r2;
        let c4 = -15.0 * r0 + 7.0 * r1 - r2;
        let c5 = 6.0 * r0 - 3.0 * r1 + 0.5 * r2;
        let t2 = t * t;
        let value = (p.value + c1 * t) + t2 * ((c2 + c3 * t) + t2 * (c4 + c5 * t));
        let slope = (c1 + 2.0 * c2 * t) + t2 * ((3.0 * c3 + 4.0 * c4 * t) + 5.0 * c5 * t2);
        let t = (t - value / slope).clamp(0.0, 1.0);
        Some(FallingZero {
            at: self.start + t * h,
            gentlest: -5.0 * gentlest / h,
            error: self.error,
        })
    }
}
