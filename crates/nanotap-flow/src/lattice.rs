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
//! Terms too fast for the lattice are replaced by minus their amplitude. A coarse level
//! that follows only the slowest terms certifies most of a flight; where it cannot, the
//! cell is looked at on a finer level, and what that leaves open is for the search of
//! [`crossing`](crate::crossing).

use crate::pack::{self, Math, Pack, WIDTH};
use crate::regime::Kernel;
use crate::signal::Signal;

/// Angle through which the fastest followed term turns from point to point: a larger one
/// needs fewer points, a smaller one leaves fewer cells open.
const ANGLE: f64 = 2.4;
/// The least number of cells in a period, on the fine level and on the coarse one.
const CELLS: [f64; 2] = [24.0, 8.0];
/// The most terms that are followed, on the fine level and on the coarse one.
const FOLLOWED: [usize; 2] = [8, 3];
/// The most terms that are followed on the fine level where extrema are looked for.
const FOLLOWED_FOR_EXTREMA: usize = 32;
/// How much faster the fine level's fastest term must be than the coarse level's.
const COARSER: f64 = 2.0;
/// What a period may cost on the fine level alone, in multiplications of packs, before a
/// coarse one is worth while.
const CHEAP: f64 = 1500.0;
/// The most packs of points: longer stretches are searched in pieces.
const LARGEST: usize = 64;
/// The most points of the fine level: faster terms are not followed. With that many the tables of
/// a regime stay below 16 MiB.
const MOST_POINTS: f64 = 8192.0;
/// What rounding, in table and sums, could take from a value, in units of the terms' size.
pub(crate) const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The tabulated exponentials of one guard.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lattice {
    /// Which terms are followed, slowest first.
    followed: Vec<usize>,
    /// Over the whole reach, or from one coarse point to the next.
    pub(crate) fine: Level,
    pub(crate) coarse: Option<Coarse>,
    /// How far it reaches.
    reach: f64,
}

/// The coarse level.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Coarse {
    pub(crate) level: Level,
    /// Of every followed term, the exponential at each point.
    powers: Vec<Vec<Pair>>,
}

/// Equidistant points with the exponentials of the slowest terms.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Level {
    /// Distance of the points, `h`, and its inverse.
    pub(crate) step: f64,
    density: f64,
    /// How many terms it follows.
    pub(crate) terms: usize,
    /// Whether these are all.
    pub(crate) complete: bool,
    /// `[Re, Im]` of each followed term's exponential at four points, pack after pack.
    pub(crate) table: Vec<[Pack; 2]>,
    /// For packs of terms: the weight of their amplitudes in `M₆h⁶/7200`, and 1 where a
    /// term is not followed.
    pub(crate) weights: Vec<[Pack; 2]>,
}

/// A complex number as `[Re, Im]`.
type Pair = [f64; 2];

/// A followed term's amplitude in value, rate and curvature, `[Re, Im]` each, the same in
/// every lane.
pub(crate) type Amplitude = [[Pack; 2]; 3];

/// Value, rate and curvature.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Point {
    pub(crate) value: f64,
    pub(crate) rate: f64,
    pub(crate) curvature: f64,
}

/// Two neighbouring points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
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
    /// The lattice for the guard `kernel` over stretches of up to `period`, if one makes sense.
    pub(crate) fn new(kernel: &Kernel, period: f64) -> Option<Self> {
        Self::following(FOLLOWED[0], kernel, period)
    }

    /// The lattice for outputs whose extrema are looked for.
    pub(crate) fn for_extrema(kernel: &Kernel, period: f64) -> Option<Self> {
        Self::following(FOLLOWED_FOR_EXTREMA, kernel, period)
    }

    /// The lattice that follows so many terms at most.
    fn following(most: usize, kernel: &Kernel, period: f64) -> Option<Self> {
        if kernel.grows || kernel.fastest <= 0.0 {
            return None;
        }
        let mut order: Vec<usize> = (0..kernel.count).collect();
        order.sort_by(|&a, &b| norm(kernel, a).total_cmp(&norm(kernel, b)));
        let step_of = |term: usize, level: usize| {
            (ANGLE / norm(kernel, order[term])).min(period / CELLS[level])
        };
        // The slowest term sets how coarse the coarse level can be.
        let slowest = step_of(0, 1);
        let follows = |term: &usize| slowest <= MOST_POINTS * step_of(*term, 0);
        let fine_terms = (1..order.len().min(most)).take_while(follows).count() + 1;
        let fastest = norm(kernel, order[fine_terms - 1]);
        let slow = order
            .iter()
            .filter(|&&k| norm(kernel, k) * COARSER < fastest);
        let terms = [fine_terms, slow.count().clamp(1, FOLLOWED[1])];
        let [fine_step, coarse_step] = [step_of(terms[0] - 1, 0), step_of(terms[1] - 1, 1)];
        let packs =
            |length: f64, step: f64| ((length / step / WIDTH as f64) as usize + 1).min(LARGEST);
        let cost = period / fine_step / WIDTH as f64 * (6 * terms[0] + 20) as f64;
        let single = cost < CHEAP || coarse_step < COARSER * fine_step;
        order.truncate(terms[0]);
        let columns = |step: f64, packs: usize| -> Vec<Vec<Pair>> {
            let column = |&k: &usize| exponentials(kernel, k, step, packs * WIDTH);
            order.iter().map(column).collect()
        };
        if single {
            let packs = packs(period, fine_step);
            return Some(Self {
                fine: Level::new(kernel, &order, fine_step, &columns(fine_step, packs)),
                coarse: None,
                reach: (packs * WIDTH - 1) as f64 * fine_step,
                followed: order,
            });
        }
        let divided = (coarse_step / fine_step).ceil();
        let fine_step = coarse_step / divided;
        let fine_columns = columns(fine_step, divided as usize / WIDTH + 1);
        let packs = packs(period, coarse_step);
        let powers = columns(coarse_step, packs);
        let coarse = &order[..terms[1]];
        Some(Self {
            fine: Level::new(kernel, &order, fine_step, &fine_columns),
            coarse: Some(Coarse {
                level: Level::new(kernel, coarse, coarse_step, &powers),
                powers,
            }),
            reach: (packs * WIDTH - 1) as f64 * coarse_step,
            followed: order,
        })
    }

    /// How far from its first point it reaches.
    pub(crate) fn reach(&self) -> f64 {
        self.reach
    }

    /// Whether every term is followed, on the fine level at least.
    pub(crate) fn is_complete(&self) -> bool {
        self.fine.complete
    }

    /// The terms that are followed.
    #[inline(always)]
    pub(crate) fn followed(&self) -> &[usize] {
        &self.followed
    }

    /// A walk along the cells of the coarse level, if there is one; what it leaves open is
    /// to be looked at in [`Lattice::fine`].
    #[inline(always)]
    pub(crate) fn coarse<M: Math>(&self, signal: &Signal, stretch: Stretch) -> Option<Scan<'_, M>> {
        let coarse = self.coarse.as_ref()?;
        Some(Scan::new(&coarse.level, signal, stretch))
    }

    /// A walk along the cells of the fine level.
    #[inline(always)]
    pub(crate) fn fine<M: Math>(&self, signal: &Signal, stretch: Stretch) -> Scan<'_, M> {
        Scan::new(&self.fine, signal, stretch)
    }

    /// The stretch within a coarse cell.
    #[inline(always)]
    pub(crate) fn within(cell: &Cell, stretch: Stretch) -> Stretch {
        Stretch {
            start: cell.start,
            end: cell.end.min(stretch.end),
            surface: if cell.point == 0 {
                stretch.surface
            } else {
                None
            },
        }
    }

    /// The amplitudes at the start of a coarse cell, written to `local`.
    #[inline(always)]
    pub(crate) fn move_to<M: Math>(
        &self,
        cell: &Cell,
        amplitudes: &[Amplitude],
        local: &mut Vec<Amplitude>,
    ) {
        local.clear();
        let Some(coarse) = &self.coarse else {
            return;
        };
        for (amplitude, column) in amplitudes.iter().zip(&coarse.powers) {
            let power = column[cell.point].map(M::splat);
            let mut moved = *amplitude;
            for z in &mut moved {
                let product = pack::complex_mul::<M>([M::load(&z[0]), M::load(&z[1])], power);
                *z = product.map(M::store);
            }
            local.push(moved);
        }
    }
}

/// A part of a regime that is to be searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stretch {
    /// Where the first point lies.
    pub(crate) start: f64,
    /// How far to look.
    pub(crate) end: f64,
    /// The rate at the start, if the signal is zero there by definition.
    pub(crate) surface: Option<f64>,
}

impl Level {
    /// The level that follows the terms `followed`, from a column of exponentials for each
    /// (of at least as many terms).
    fn new(kernel: &Kernel, followed: &[usize], step: f64, columns: &[Vec<Pair>]) -> Self {
        let terms = followed.len();
        let points = columns.first().map_or(0, Vec::len);
        let mut table = vec![[[0.0; WIDTH]; 2]; points / WIDTH * terms];
        for (j, column) in columns.iter().take(terms).enumerate() {
            for (p, &[re, im]) in column.iter().enumerate() {
                let entry = &mut table[p / WIDTH * terms + j];
                entry[0][p % WIDTH] = re;
                entry[1][p % WIDTH] = im;
            }
        }
        let mut weights = vec![[[0.0; WIDTH]; 2]; kernel.packs.len()];
        for k in 0..kernel.count {
            let entry = &mut weights[k / WIDTH];
            if followed.contains(&k) {
                entry[0][k % WIDTH] = (norm(kernel, k) * step).powi(6) / 7200.0;
            } else {
                entry[1][k % WIDTH] = 1.0;
            }
        }
        Self {
            step,
            density: 1.0 / step,
            terms,
            complete: terms == kernel.count,
            table,
            weights,
        }
    }
}

/// `|λ|` of a term.
fn norm(kernel: &Kernel, k: usize) -> f64 {
    let pack = &kernel.packs[k / WIDTH];
    pack.decay[k % WIDTH].hypot(pack.frequency[k % WIDTH])
}

/// `e^{λ h p}` of a term for `p = 0 … count − 1`. Each is a product of at most as many
/// factors as `p` has binary digits, so that rounding does not pile up along the table.
fn exponentials(kernel: &Kernel, k: usize, step: f64, count: usize) -> Vec<Pair> {
    let pack = &kernel.packs[k / WIDTH];
    let (decay, frequency) = (pack.decay[k % WIDTH], pack.frequency[k % WIDTH]);
    let mut powers = Vec::with_capacity(count);
    powers.push([1.0, 0.0]);
    let mut highest = 1;
    while powers.len() < count {
        let s = step * highest as f64;
        let (sin, cos) = (frequency * s).sin_cos();
        let grown = (decay * s).exp();
        for p in 0..highest.min(count - highest) {
            powers.push(product(powers[p], [grown * cos, grown * sin]));
        }
        highest *= 2;
    }
    powers
}

/// `a b` of complex numbers.
#[inline(always)]
fn product([ar, ai]: Pair, [br, bi]: Pair) -> Pair {
    [ar * br - ai * bi, ar * bi + ai * br]
}

/// A walk along the cells of one level.
pub(crate) struct Scan<'a, M: Math> {
    level: &'a Level,
    constant: f64,
    /// What Bernstein coefficients must not fall below.
    floor: f64,
    /// The same for the sum of the middle two.
    tension: f64,
    /// Bound on the distance from the quintic to the signal within a cell.
    error: f64,
    stretch: Stretch,
    /// The next pack of points, and how many there are to look at.
    pack: usize,
    packs: usize,
    /// Cells that end at the last pack's points and are not certified, a bit each.
    open: u32,
    /// Value, rate and curvature at the last two packs of points.
    ends: [[M::Lanes; 3]; 2],
    /// Of the last pack's cells, what their left ends give: the smallest coefficient, and b₂.
    lefts: [M::Lanes; 2],
    /// Points looked at so far.
    pub(crate) points: u64,
}

impl<'a, M: Math> Scan<'a, M> {
    #[inline(always)]
    fn new(level: &'a Level, signal: &Signal, stretch: Stretch) -> Self {
        let [sixth, outside] = signal.weighted_amplitudes::<M>(&level.weights);
        let floor = outside + ROUNDING * signal.size();
        let cells = (stretch.end - stretch.start) * level.density;
        let most = level.table.len() / level.terms;
        Self {
            level,
            constant: signal.constant,
            floor,
            tension: sixth + 2.0 * floor,
            error: sixth / 6.4 + floor,
            stretch,
            pack: 0,
            packs: most.min((cells * (1.0 / WIDTH as f64)) as usize + 2),
            open: 0,
            ends: [[M::splat(0.0); 3]; 2],
            lefts: [M::splat(f64::MAX); 2],
            points: 0,
        }
    }

    /// Where a point lies.
    #[inline(always)]
    fn at(&self, point: usize) -> f64 {
        self.stretch.start + point as f64 * self.level.step
    }

    /// The next cell that is not certified.
    #[inline(always)]
    pub(crate) fn next_open(&mut self, amplitudes: &[Amplitude]) -> Option<Cell> {
        while self.open == 0 {
            if self.pack >= self.packs {
                return None;
            }
            self.look_at_pack(amplitudes);
        }
        let lane = self.open.trailing_zeros() as usize;
        self.open &= self.open - 1;
        let point = (self.pack - 1) * WIDTH + lane - 1;
        if self.at(point) >= self.stretch.end {
            // It lies beyond the end, and so do all that follow.
            self.pack = self.packs;
            self.open = 0;
            return None;
        }
        let before = if lane == 0 {
            Point::of::<M>(&self.ends[0], WIDTH - 1)
        } else {
            Point::of::<M>(&self.ends[1], lane - 1)
        };
        Some(Cell {
            start: self.at(point),
            end: self.at(point + 1),
            point,
            width: self.level.step,
            ends: [before, Point::of::<M>(&self.ends[1], lane)],
            error: self.error,
        })
    }

    /// Certifies the cells that end at the next pack's points, or finds which are open.
    #[inline(always)]
    fn look_at_pack(&mut self, amplitudes: &[Amplitude]) {
        let h = self.level.step;
        let [g, v, c] = self.sums(amplitudes);
        let bent = M::fma(c, M::splat(h * h / 20.0), g);
        let (fifth, two_fifths) = (M::splat(0.2 * h), M::splat(0.4 * h));
        let (b1, b2) = (M::fma(v, fifth, g), M::fma(v, two_fifths, bent));
        let (b4, b3) = (M::fnma(v, fifth, g), M::fnma(v, two_fifths, bent));
        let inner = M::min(b1, b2);
        let mut left = M::min(g, inner);
        if self.pack == 0 && self.stretch.surface.is_some() && self.level.complete {
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
        self.points += WIDTH as u64;
    }

    /// Value, rate and curvature at the next pack's points.
    #[inline(always)]
    fn sums(&self, amplitudes: &[Amplitude]) -> [M::Lanes; 3] {
        let zero = M::splat(0.0);
        let (mut g, mut v, mut c) = (M::splat(self.constant), zero, zero);
        let terms = self.level.terms;
        let table = &self.level.table[self.pack * terms..][..terms];
        for (amplitude, [re, im]) in amplitudes.iter().zip(table) {
            let (re, im) = (M::load(re), M::load(im));
            let [[gr, gi], [vr, vi], [cr, ci]] = amplitude;
            g = M::fnma(M::load(gi), im, M::fma(M::load(gr), re, g));
            v = M::fnma(M::load(vi), im, M::fma(M::load(vr), re, v));
            c = M::fnma(M::load(ci), im, M::fma(M::load(cr), re, c));
        }
        if let (0, Some(rate)) = (self.pack, self.stretch.surface) {
            g = M::with_first(g, zero);
            v = M::with_first(v, M::splat(rate));
        }
        [g, v, c]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crossing::{Start, Statistics, first_crossing, first_crossing_on_lattice};
    use crate::pack::Plain;
    use crate::{Complex, Drive, HarmonicVector, Output, Regime};
    use nalgebra::{DMatrix, DVector, RowDVector};
    use proptest::prelude::*;

    /// Oscillators side by side, seen through one output; each is (frequency, damping,
    /// displacement, velocity, weight).
    type Oscillators = Vec<(f64, f64, f64, f64, f64)>;

    /// The lattice of the output, taken positive at the start, its signal from there and how
    /// far to look; and the output's sign.
    fn example(oscillators: &Oscillators, tone: f64, constant: f64) -> (Lattice, Signal, f64, f64) {
        let n = oscillators.len();
        let drive = Drive::single(1.7).unwrap();
        let mut matrix = DMatrix::zeros(2 * n, 2 * n);
        let mut row = RowDVector::zeros(2 * n);
        let mut state = DVector::zeros(2 * n);
        for (j, &(frequency, damping, x, v, weight)) in oscillators.iter().enumerate() {
            matrix[(2 * j, 2 * j + 1)] = 1.0;
            matrix[(2 * j + 1, 2 * j)] = -frequency * frequency;
            matrix[(2 * j + 1, 2 * j + 1)] = -2.0 * damping * frequency;
            row[2 * j] = weight;
            state[2 * j] = x;
            state[2 * j + 1] = v * frequency;
        }
        let output = Output::linear(row, 1)
            .with_tone(0, tone, 0.0)
            .with_constant(constant);
        let side = if output.at(&drive, state.as_slice(), 0.0) < 0.0 {
            -1.0
        } else {
            1.0
        };
        let regime = Regime::new(0, matrix, HarmonicVector::zeros(2 * n, 1), &drive).unwrap();
        let kernel = Kernel::new(&regime, &drive, &regime.project(&output.scaled(side)));
        let mut modal = vec![Complex::new(0.0, 0.0); n];
        let mut rest = vec![0.0; 2 * n];
        regime.to_modal(&drive, state.as_slice(), 0.0, &mut rest, &mut modal);
        modal.push(Complex::new(1.0, 0.0));
        let mut packed = vec![[[0.0; WIDTH]; 2]; modal.len().div_ceil(WIDTH)];
        for (k, q) in modal.iter().enumerate() {
            packed[k / WIDTH][0][k % WIDTH] = q.re;
            packed[k / WIDTH][1][k % WIDTH] = q.im;
        }
        let lattice = Lattice::new(&kernel, drive.period()).unwrap();
        let length = lattice.reach().min(drive.period());
        let mut signal = Signal::default();
        signal.refill::<Plain>(&kernel, &packed, length);
        (lattice, signal, length, side)
    }

    fn oscillators(most: usize) -> impl Strategy<Value = Oscillators> {
        let one = (
            (-0.7..5.0_f64).prop_map(f64::exp),
            0.001..0.3,
            -1.0..1.0_f64,
            -1.0..1.0_f64,
            -1.0..1.0_f64,
        );
        proptest::collection::vec(one, 1..most)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// The lattice finds the crossing that certified steps find, and no other: with few
        /// terms and one level, and with more than are followed.
        #[test]
        fn lattice_and_certified_steps_agree(
            oscillators in oscillators(12),
            tone in -1.0..1.0_f64,
            constant in -1.0..1.0_f64,
        ) {
            let (lattice, mut signal, length, _) = example(&oscillators, tone, constant);
            let mut statistics = Statistics::default();
            let start = Start::Inside;
            let found = first_crossing_on_lattice::<Plain>(
                &lattice, &mut signal, length, start, &mut statistics,
            );
            let expected = first_crossing(&signal, length, start, &mut statistics);
            match (found, expected) {
                (None, None) => {}
                (Some(a), Some(b)) => {
                    // A crossing at speed r is known to the value's rounding over r.
                    let known = 1e-14 + signal.noise() / b.rate.abs();
                    prop_assert!((a.at - b.at).abs() <= 4.0 * known, "{a:?} {b:?}");
                    let slack = 1e-9 * (1.0 + signal.fastest() * signal.size());
                    prop_assert!((a.rate - b.rate).abs() <= slack, "{a:?} {b:?}");
                }
                // At the very end, rounding decides.
                (Some(one), None) | (None, Some(one)) => {
                    prop_assert!(length - one.at < 1e-12, "{found:?} {expected:?} of {length}");
                }
            }
        }

        /// From the surface, with the rate known.
        #[test]
        fn leaving_the_surface_agrees(
            oscillators in oscillators(7),
            tone in -1.0..1.0_f64,
        ) {
            // The constant puts the start on the surface.
            let (_, signal, _, side) = example(&oscillators, tone, 0.0);
            let at_start = side * signal.first_jet().value;
            let (lattice, mut signal, length, _) = example(&oscillators, tone, -at_start);
            let start = Start::Surface { rate: None };
            let mut statistics = Statistics::default();
            let found = first_crossing_on_lattice::<Plain>(
                &lattice, &mut signal, length, start, &mut statistics,
            );
            let expected = first_crossing(&signal, length, start, &mut statistics);
            match (found, expected) {
                (None, None) => {}
                (Some(a), Some(b)) => {
                    let known = 1e-14 + signal.noise() / b.rate.abs();
                    prop_assert!((a.at - b.at).abs() <= 4.0 * known, "{a:?} {b:?}");
                }
                (Some(one), None) | (None, Some(one)) => {
                    prop_assert!(length - one.at < 1e-12, "{found:?} {expected:?} of {length}");
                }
            }
        }
    }

    /// The table's exponentials against the library's.
    #[test]
    fn tabulated_exponentials_are_accurate() {
        let (lattice, _, _, _) = example(&vec![(3.0, 0.01, 1.0, 0.0, 1.0)], 0.3, 1.0);
        let level = &lattice.fine;
        // Its two terms: the drive's, and the oscillator's.
        let rates = [
            Complex::new(0.0, 1.7),
            Complex::new(-0.03, 3.0 * (1.0_f64 - 1e-4).sqrt()),
        ];
        for (i, entries) in level.table.chunks(level.terms).enumerate() {
            for (entry, rate) in entries.iter().zip(rates) {
                for lane in 0..WIDTH {
                    let s = (i * WIDTH + lane) as f64 * level.step;
                    let exact = (rate * s).exp();
                    let imaginary = entry[1][lane].abs();
                    assert!((entry[0][lane] - exact.re).abs() < 4e-15, "{i} {lane}");
                    assert!((imaginary - exact.im.abs()).abs() < 4e-15, "{i} {lane}");
                }
            }
        }
    }
}
