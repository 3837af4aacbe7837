//! Whole flights are certified on a table's points, without computing an exponential.
//!
//! At the points value, rate and curvature are plain sums over the terms. Between two of
//! them, at distance `h`, the quintic that agrees with all six numbers has the Bernstein
//! coefficients
//!
//! ```text
//! b₀ = g₀    b₁ = g₀ + hġ₀/5    b₂ = g₀ + 2hġ₀/5 + h²g̈₀/20
//! b₅ = g₁    b₄ = g₁ − hġ₁/5    b₃ = g₁ − 2hġ₁/5 + h²g̈₁/20
//! ```
//!
//! and its error is at most `M₆/720 · (t(1 − t)h²)³`, `M₆` being a bound of the sixth
//! derivative. In degree six that error is a multiple of the single Bernstein polynomial
//! `20 t³(1 − t)³`, so the signal is positive in the interval for certain when all
//! coefficients are and `½(b₂ + b₃) ≥ M₆h⁶/14400`. This holds up to a zero at either end,
//! for instance right after a switch. Terms that the grid does not follow are replaced by minus
//! their amplitude. What is left open is for certified steps ([`steps`](super::steps)).

use super::interval::{Interval, Point};
use super::tabulated::{Grid, ROUNDING, Table};
use crate::signal::{Amplitude, Signal};
use crate::simd::{Lanes, Simd, Single, WIDTH};

/// `7200 √5/30000`: factor from `M₆h⁶/7200` to `h` times the bound of a quintic's rate error.
const RATE_OF_SIXTH: f64 = 0.536_656_314_599_949_5;

/// A part of a regime that is to be searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    /// Time of the first point.
    pub(crate) start: f64,
    /// Time at which the search ends.
    pub(crate) end: f64,
    /// The rate at the start, if the signal is zero there by definition.
    pub(crate) surface: Option<f64>,
}

/// Bounds for a signal on a grid, from the sums of its amplitudes with the grid's
/// [`Weights`](super::tabulated::Weights).
#[derive(Clone, Copy)]
pub(crate) struct Bounds<L: Lanes> {
    /// Lower limit of the Bernstein coefficients of a certified interval.
    pub(crate) floor: L::Register,
    /// The same limit for the sum of the middle two.
    pub(crate) tension: L::Register,
    /// Bound on the distance from the quintic to the signal within an interval.
    pub(crate) error: L::Register,
    /// Bound on the distance of their rates.
    pub(crate) rate_error: L::Register,
}

impl<L: Lanes> Bounds<L> {
    /// Computes the bounds from these sums, and the size of all terms.
    #[inline(always)]
    pub(crate) fn new(
        [sixth, outside, outside_rate]: [L::Register; 3],
        size: L::Register,
        density: f64,
    ) -> Self {
        let rounding = L::mul(L::splat(ROUNDING), size);
        let floor = L::add(outside, rounding);
        // Of the quintic's rate |e'| ≤ √5/30000 M₆h⁵ (Birkhoff and Priver 1967).
        let rate = L::fma(
            L::splat(RATE_OF_SIXTH),
            sixth,
            L::mul(L::splat(10.0), rounding),
        );
        Self {
            floor,
            tension: L::fma(L::splat(2.0), floor, sixth),
            error: L::fma(L::splat(1.0 / 6.4), sixth, floor),
            rate_error: L::fma(rate, L::splat(density), outside_rate),
        }
    }
}

/// Returns the inner Bernstein coefficients that a point gives to the interval on its right, b₁ and
/// b₂, and to that on its left, b₄ and b₃.
#[inline(always)]
pub(crate) fn coefficients<L: Lanes>(
    [g, v, c]: [L::Register; 3],
    step: f64,
) -> [[L::Register; 2]; 2] {
    let bent = L::fma(c, L::splat(step * step / 20.0), g);
    let (fifth, two_fifths) = (L::splat(0.2 * step), L::splat(0.4 * step));
    [
        [L::fma(v, fifth, g), L::fma(v, two_fifths, bent)],
        [L::fnma(v, fifth, g), L::fnma(v, two_fifths, bent)],
    ]
}

/// A walk along the intervals of one grid.
pub(crate) struct Scan<'a, S: Simd> {
    grid: &'a Grid,
    constant: f64,
    bounds: Bounds<Single>,
    span: Span,
    /// Next vector of points to examine, and number of vectors.
    vector: usize,
    vectors: usize,
    /// Intervals that end at the last vector's points and are not certified, a bit each.
    open: u32,
    /// Value, rate and curvature at the last two vectors of points.
    ends: [[S::Register; 3]; 2],
    /// Of the last vector's intervals, the smallest coefficient from their left ends, and b₂.
    lefts: [S::Register; 2],
    /// Number of points examined.
    pub(crate) points: u64,
}

impl<'a, S: Simd> Scan<'a, S> {
    #[inline(always)]
    fn new(grid: &'a Grid, signal: &Signal, span: Span) -> Self {
        let sums = signal.weighted_amplitudes::<S>(&grid.weights);
        let intervals = (span.end - span.start) * grid.density;
        let most = grid.table.len() / grid.terms;
        Self {
            grid,
            constant: signal.constant,
            bounds: Bounds::new([sums[0], sums[1], sums[2]], signal.size(), grid.density),
            span,
            vector: 0,
            vectors: most.min((intervals * (1.0 / WIDTH as f64)) as usize + 2),
            open: 0,
            ends: [[S::splat(0.0); 3]; 2],
            lefts: [S::splat(f64::MAX); 2],
            points: 0,
        }
    }

    /// Returns a bound on the distance from the rate of an interval's quintic to that of the
    /// signal.
    #[inline(always)]
    pub(crate) fn rate_error(&self) -> f64 {
        self.bounds.rate_error
    }

    /// Returns the time of a point.
    #[inline(always)]
    fn at(&self, point: usize) -> f64 {
        self.span.start + point as f64 * self.grid.step
    }

    /// Returns the next interval that is not certified.
    #[inline(always)]
    pub(crate) fn next_open(&mut self, amplitudes: &[Amplitude]) -> Option<Interval> {
        while self.open == 0 {
            if self.vector >= self.vectors {
                return None;
            }
            self.look_at_next(amplitudes);
        }
        let lane = self.open.trailing_zeros() as usize;
        self.open &= self.open - 1;
        let point = (self.vector - 1) * WIDTH + lane - 1;
        if self.at(point) >= self.span.end {
            // It lies beyond the end, and so do all that follow.
            self.vector = self.vectors;
            self.open = 0;
            return None;
        }
        let before = if lane == 0 {
            Point::of::<S>(&self.ends[0], WIDTH - 1)
        } else {
            Point::of::<S>(&self.ends[1], lane - 1)
        };
        Some(Interval {
            start: self.at(point),
            end: self.at(point + 1),
            point,
            width: self.grid.step,
            ends: [before, Point::of::<S>(&self.ends[1], lane)],
            error: self.bounds.error,
        })
    }

    /// Certifies the intervals that end at the next vector's points, or marks them as open.
    #[inline(always)]
    fn look_at_next(&mut self, amplitudes: &[Amplitude]) {
        let [g, v, c] = self.sums(amplitudes);
        let [[b1, b2], [b4, b3]] = coefficients::<S>([g, v, c], self.grid.step);
        let inner = S::min(b1, b2);
        let mut left = S::min(g, inner);
        if self.vector == 0 && self.span.surface.is_some() && self.grid.complete {
            // Zero there by definition, which is allowed.
            left = S::with_first(left, inner);
        }
        let right = S::min(g, S::min(b4, b3));
        let low = S::min(S::shifted_in(self.lefts[0], left), right);
        let middle = S::add(S::shifted_in(self.lefts[1], b2), b3);
        let below = S::below(low, S::splat(self.bounds.floor));
        self.open = below | S::below(middle, S::splat(self.bounds.tension));
        if self.vector == 0 {
            // There is no interval before the first point.
            self.open &= !1;
        }
        self.ends = [self.ends[1], [g, v, c]];
        self.lefts = [left, b2];
        self.vector += 1;
        self.points += WIDTH as u64;
    }

    /// Returns value, rate and curvature at the next vector's points.
    #[inline(always)]
    fn sums(&self, amplitudes: &[Amplitude]) -> [S::Register; 3] {
        let zero = S::splat(0.0);
        let (mut g, mut v, mut c) = (S::splat(self.constant), zero, zero);
        let terms = self.grid.terms;
        let table = &self.grid.table[self.vector * terms..][..terms];
        for (amplitude, [re, im]) in amplitudes.iter().zip(table) {
            let (re, im) = (S::load(re), S::load(im));
            let [[gr, gi], [vr, vi], [cr, ci]] = amplitude;
            g = S::fnma(S::load(gi), im, S::fma(S::load(gr), re, g));
            v = S::fnma(S::load(vi), im, S::fma(S::load(vr), re, v));
            c = S::fnma(S::load(ci), im, S::fma(S::load(cr), re, c));
        }
        if let (0, Some(rate)) = (self.vector, self.span.surface) {
            g = S::with_first(g, zero);
            v = S::with_first(v, S::splat(rate));
        }
        [g, v, c]
    }
}

impl Table {
    /// Starts a walk along the intervals of the coarse grid, if there is one; the intervals that it
    /// leaves open must be examined with [`Table::fine`].
    #[inline(always)]
    pub(crate) fn coarse<S: Simd>(&self, signal: &Signal, span: Span) -> Option<Scan<'_, S>> {
        let coarse = self.coarse.as_ref()?;
        Some(Scan::new(&coarse.grid, signal, span))
    }

    /// Starts a walk along the intervals of the fine grid.
    #[inline(always)]
    pub(crate) fn fine<S: Simd>(&self, signal: &Signal, span: Span) -> Scan<'_, S> {
        Scan::new(&self.fine, signal, span)
    }
}

impl Span {
    /// Returns the part of the span within a coarse interval.
    #[inline(always)]
    pub(crate) fn within(self, interval: &Interval) -> Self {
        Self {
            start: interval.start,
            end: interval.end.min(self.end),
            surface: if interval.point == 0 {
                self.surface
            } else {
                None
            },
        }
    }
}
