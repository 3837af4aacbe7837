//! A guard on a lattice of equidistant points, at which its exponentials are tabulated:
//! whole stretches of a regime are searched for a switch without computing one.
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
//! `20 t³(1 − t)³`, so the signal is positive in the cell for certain when all
//! coefficients are and `½(b₂ + b₃) ≥ M₆h⁶/14400`. This holds up to a zero at either end,
//! for instance right after a switch.
//!
//! Terms too fast for the lattice are replaced by minus their amplitude. What a cell
//! cannot certify is left to the search of [`crossing`](crate::crossing).

use crate::pack::{Math, Pack, WIDTH};
use crate::regime::Kernel;
use crate::signal::Signal;

/// Angle through which the fastest followed term turns from point to point.
const ANGLE: f64 = 3.0;
/// The most terms that are followed.
const FOLLOWED: usize = 8;
/// The most packs of points: longer stretches are searched in pieces.
const LARGEST: usize = 64;
/// What rounding, in table and sums, could take from a value, in units of the terms' size.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The tabulated exponentials of one guard.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lattice {
    /// Distance of the points, `h`.
    step: f64,
    /// `[Re, Im]` of each followed term's exponential at four points, pack after pack.
    table: Vec<[Pack; 2]>,
    /// Which terms are followed.
    followed: Vec<usize>,
    /// For packs of terms: the weight of their amplitudes in `M₆h⁶/7200`, and 1 where a
    /// term is not followed.
    weights: Vec<[Pack; 2]>,
    /// Whether all terms are followed.
    complete: bool,
    /// How far it reaches.
    reach: f64,
}

/// Value, rate and curvature.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Point {
    value: f64,
    rate: f64,
    curvature: f64,
}

/// Two neighbouring points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    /// Where it begins.
    pub(crate) start: f64,
    /// Where it ends.
    pub(crate) end: f64,
    /// Its width.
    width: f64,
    /// Its ends.
    ends: [Point; 2],
    /// Bound on the quintic's error within.
    error: f64,
    /// Whether the quintic is the signal's own, no term left out.
    complete: bool,
}

/// A zero of a cell's quintic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FallingZero {
    /// Where.
    pub(crate) at: f64,
    /// How fast the quintic falls at least, anywhere in the cell.
    pub(crate) gentlest: f64,
    /// How far the signal can be from the quintic.
    pub(crate) error: f64,
}

impl Lattice {
    /// The lattice for `kernel` over stretches of up to `period`, if one makes sense.
    pub(crate) fn new(kernel: &Kernel, period: f64) -> Option<Self> {
        if kernel.grows || kernel.fastest <= 0.0 {
            return None;
        }
        let rates: Vec<[f64; 2]> = (0..kernel.count)
            .map(|k| {
                let pack = &kernel.packs[k / WIDTH];
                [pack.decay[k % WIDTH], pack.frequency[k % WIDTH]]
            })
            .collect();
        let norm = |k: usize| rates[k][0].hypot(rates[k][1]);
        let mut followed: Vec<usize> = (0..kernel.count).collect();
        followed.sort_by(|&a, &b| norm(a).total_cmp(&norm(b)));
        followed.truncate(FOLLOWED);
        let fastest = norm(*followed.last()?);
        let step = (ANGLE / fastest).min(period / 4.0);
        let packs = ((period / step / WIDTH as f64) as usize + 1).min(LARGEST);
        let mut table = vec![[[0.0; WIDTH]; 2]; packs * followed.len()];
        for (j, &k) in followed.iter().enumerate() {
            for (p, [re, im]) in powers(rates[k], step, packs * WIDTH)
                .into_iter()
                .enumerate()
            {
                let entry = &mut table[p / WIDTH * followed.len() + j];
                entry[0][p % WIDTH] = re;
                entry[1][p % WIDTH] = im;
            }
        }
        let mut weights = vec![[[0.0; WIDTH]; 2]; kernel.packs.len()];
        for k in 0..kernel.count {
            let entry = &mut weights[k / WIDTH];
            if followed.contains(&k) {
                entry[0][k % WIDTH] = (norm(k) * step).powi(6) / 7200.0;
            } else {
                entry[1][k % WIDTH] = 1.0;
            }
        }
        Some(Self {
            step,
            table,
            complete: followed.len() == kernel.count,
            followed,
            weights,
            reach: (packs * WIDTH - 1) as f64 * step,
        })
    }

    /// How far from its first point it reaches.
    pub(crate) fn reach(&self) -> f64 {
        self.reach
    }

    /// Looks at the cells of `signal` up to `length` in turn. `surface` is the rate at the
    /// first point where the signal is zero there by definition.
    #[inline(always)]
    pub(crate) fn scan<M: Math>(
        &self,
        signal: &Signal,
        length: f64,
        surface: Option<f64>,
    ) -> Scan<'_, M> {
        let mut amplitudes = [[[0.0; 2]; 3]; FOLLOWED];
        for (amplitude, &k) in amplitudes.iter_mut().zip(&self.followed) {
            *amplitude = signal.amplitudes(k);
        }
        let [sixth, outside] = signal.weighted_amplitudes::<M>(&self.weights);
        let noise = ROUNDING * signal.size();
        Scan {
            lattice: self,
            amplitudes,
            constant: signal.constant,
            floor: outside + noise,
            tension: sixth + 2.0 * (outside + noise),
            error: sixth / 6.4 + noise,
            length,
            surface,
            pack: 0,
            open: 0,
            ends: [[M::splat(0.0); 3]; 2],
            lefts: [M::splat(f64::MAX); 2],
        }
    }
}

/// A walk along the cells.
pub(crate) struct Scan<'a, M: Math> {
    lattice: &'a Lattice,
    /// Of the followed terms, in value, rate and curvature.
    amplitudes: [[[f64; 2]; 3]; FOLLOWED],
    constant: f64,
    /// What Bernstein coefficients must not fall below.
    floor: f64,
    /// The same for the sum of the middle two.
    tension: f64,
    /// Bound on the quintic's error within a cell.
    error: f64,
    length: f64,
    surface: Option<f64>,
    /// The next pack of points.
    pack: usize,
    /// Cells that end at the last pack's points and are not certified, a bit each.
    open: u32,
    /// Value, rate and curvature at the last two packs of points.
    ends: [[M::Lanes; 3]; 2],
    /// Of the last pack's cells, what their left ends give: the smallest coefficient, and b₂.
    lefts: [M::Lanes; 2],
}

impl<M: Math> Scan<'_, M> {
    /// The next cell that is not certified.
    #[inline(always)]
    pub(crate) fn next_open(&mut self) -> Option<Cell> {
        while self.open == 0 {
            let table = self.pack * self.lattice.followed.len();
            let before = (self.pack * WIDTH) as f64 - 1.0;
            if table >= self.lattice.table.len() || before * self.lattice.step >= self.length {
                return None;
            }
            self.look_at_pack();
        }
        let lane = self.open.trailing_zeros() as usize;
        self.open &= self.open - 1;
        let point = (self.pack - 1) * WIDTH + lane;
        let h = self.lattice.step;
        let start = (point - 1) as f64 * h;
        if start >= self.length {
            return None;
        }
        let before = if lane == 0 {
            Point::of::<M>(&self.ends[0], WIDTH - 1)
        } else {
            Point::of::<M>(&self.ends[1], lane - 1)
        };
        Some(Cell {
            start,
            end: point as f64 * h,
            width: h,
            ends: [before, Point::of::<M>(&self.ends[1], lane)],
            error: self.error,
            complete: self.lattice.complete,
        })
    }

    /// Certifies the cells that end at the next pack's points, or finds which are open.
    #[inline(always)]
    fn look_at_pack(&mut self) {
        let h = self.lattice.step;
        let [g, v, c] = self.sums();
        let bent = M::fma(c, M::splat(h * h / 20.0), g);
        let (fifth, two_fifths) = (M::splat(0.2 * h), M::splat(0.4 * h));
        let (b1, b2) = (M::fma(v, fifth, g), M::fma(v, two_fifths, bent));
        let (b4, b3) = (M::fnma(v, fifth, g), M::fnma(v, two_fifths, bent));
        let inner = M::min(b1, b2);
        let mut left = M::min(g, inner);
        if self.pack == 0 && self.surface.is_some() && self.lattice.complete {
            // Zero there by definition, which is allowed.
            left = M::with_first(left, inner);
        }
        let right = M::min(g, M::min(b4, b3));
        let low = M::min(M::shifted_in(self.lefts[0], left), right);
        let middle = M::add(M::shifted_in(self.lefts[1], b2), b3);
        let below = M::below(low, M::splat(self.floor));
        self.open = below | M::below(middle, M::splat(self.tension));
        if self.pack == 0 {
            // There is no cell before the first point.
            self.open &= !1;
        }
        self.ends = [self.ends[1], [g, v, c]];
        self.lefts = [left, b2];
        self.pack += 1;
    }

    /// Value, rate and curvature at the next pack's points.
    #[inline(always)]
    fn sums(&self) -> [M::Lanes; 3] {
        let zero = M::splat(0.0);
        let (mut g, mut v, mut c) = (M::splat(self.constant), zero, zero);
        let n = self.lattice.followed.len();
        let table = &self.lattice.table[self.pack * n..][..n];
        for (amplitude, [re, im]) in self.amplitudes.iter().zip(table) {
            let (re, im) = (M::load(re), M::load(im));
            let [[gr, gi], [vr, vi], [cr, ci]] = *amplitude;
            g = M::fnma(M::splat(gi), im, M::fma(M::splat(gr), re, g));
            v = M::fnma(M::splat(vi), im, M::fma(M::splat(vr), re, v));
            c = M::fnma(M::splat(ci), im, M::fma(M::splat(cr), re, c));
        }
        if let (0, Some(rate)) = (self.pack, self.surface) {
            g = M::with_first(g, zero);
            v = M::with_first(v, M::splat(rate));
        }
        [g, v, c]
    }

    /// Points looked at so far.
    #[inline(always)]
    pub(crate) fn points(&self) -> u64 {
        (self.pack * WIDTH) as u64
    }
}

impl Point {
    #[inline(always)]
    fn of<M: Math>(sums: &[M::Lanes; 3], lane: usize) -> Self {
        Self {
            value: M::store(sums[0])[lane],
            rate: M::store(sums[1])[lane],
            curvature: M::store(sums[2])[lane],
        }
    }
}

impl Cell {
    /// Where the quintic falls through zero; `None` unless it falls all the way, from above
    /// zero to below it.
    #[inline(always)]
    pub(crate) fn falling_zero(&self) -> Option<FallingZero> {
        let [p, q] = self.ends;
        let h = self.width;
        if !self.complete || p.value <= self.error || q.value >= -self.error {
            return None;
        }
        let b = [
            p.value,
            p.value + 0.2 * h * p.rate,
            p.value + 0.4 * h * p.rate + 0.05 * h * h * p.curvature,
            q.value - 0.4 * h * q.rate + 0.05 * h * h * q.curvature,
            q.value - 0.2 * h * q.rate,
            q.value,
        ];
        let d: [f64; 5] = std::array::from_fn(|i| b[i + 1] - b[i]);
        let gentlest = d[0].max(d[1]).max(d[2].max(d[3])).max(d[4]);
        if gentlest >= 0.0 {
            return None;
        }
        // The inverse function's cubic through both ends, then two Newton steps.
        let (rise, run) = (1.0 / (p.value - q.value), p.value);
        let u = run * rise;
        let (m0, m1) = (-1.0 / (rise * h * p.rate), -1.0 / (rise * h * q.rate));
        let w = 1.0 - u;
        let guess = u * u * (3.0 - 2.0 * u) + u * w * (w * m0 - u * m1);
        let mut t = guess.clamp(0.0, 1.0);
        let c2 = 0.5 * h * h * p.curvature;
        let c1 = h * p.rate;
        let (r0, r1, r2) = (
            q.value - p.value - c1 - c2,
            h * q.rate - c1 - 2.0 * c2,
            h * h * q.curvature - 2.0 * c2,
        );
        let c3 = 10.0 * r0 - 4.0 * r1 + 0.5 * r2;
        let c4 = -15.0 * r0 + 7.0 * r1 - r2;
        let c5 = 6.0 * r0 - 3.0 * r1 + 0.5 * r2;
        for _ in 0..2 {
            let t2 = t * t;
            let value = (p.value + c1 * t) + t2 * ((c2 + c3 * t) + t2 * (c4 + c5 * t));
            let slope = (c1 + 2.0 * c2 * t) + t2 * ((3.0 * c3 + 4.0 * c4 * t) + 5.0 * c5 * t2);
            t = (t - value / slope).clamp(0.0, 1.0);
        }
        Some(FallingZero {
            at: self.start + t * h,
            gentlest: -5.0 * gentlest / h,
            error: self.error,
        })
    }
}

/// `e^{λ h p}` for `p = 0 … count − 1`. Each is a product of at most as many factors as
/// `p` has binary digits, so that rounding does not pile up along the table.
fn powers([decay, frequency]: [f64; 2], step: f64, count: usize) -> Vec<[f64; 2]> {
    let mut powers = Vec::with_capacity(count);
    powers.push([1.0, 0.0]);
    let mut highest = 1;
    while powers.len() < count {
        let s = step * highest as f64;
        let (sin, cos) = (frequency * s).sin_cos();
        let grown = (decay * s).exp();
        let [fr, fi] = [grown * cos, grown * sin];
        for p in 0..highest.min(count - highest) {
            let [re, im]: [f64; 2] = powers[p];
            powers.push([re * fr - im * fi, re * fi + im * fr]);
        }
        highest *= 2;
    }
    powers
}
