//! Exponentials of a regime's slowest terms, tabulated at equidistant points.
//!
//! Terms too fast for the table are bounded by their amplitude. A coarse grid that follows only
//! the slowest terms certifies most of a flight; otherwise the interval is searched on
//! a finer grid. [`walk`](super::walk) draws the conclusions from the points.

use super::interval::Interval;
use crate::Complex;
use crate::regime::Kernel;
use crate::signal::{Amplitude, Signal};
use crate::simd::{self, ComplexVector, Simd, Vector, WIDTH, Work, layout};
use nanotap_arithmetic::ComplexFunctions as _;

/// Angle, in radians, through which the fastest followed term turns from point to point: a larger
/// angle needs fewer points, a smaller one leaves fewer intervals open.
const ANGLE: f64 = 2.4;
/// Least number of intervals per period, on the fine grid and on the coarse one.
const INTERVALS: [f64; 2] = [24.0, 8.0];
/// Largest number of followed terms, on the fine grid and on the coarse one.
const FOLLOWED: [usize; 2] = [4, 3];
/// Largest number of followed terms on the fine grid in a search for extrema.
const FOLLOWED_FOR_EXTREMA: usize = 32;
/// Least ratio of the rates of the fine grid's and the coarse grid's fastest terms, and of the
/// steps of the coarse and the fine grid.
const COARSER: f64 = 2.0;
/// Cost of a period on the fine grid alone, in multiplications of vectors, above which a coarse
/// grid is worth while.
const CHEAP: f64 = 1500.0;
/// Largest number of vectors of points: longer stretches are searched in pieces.
const LARGEST: usize = 64;
/// Largest number of points of the fine grid: faster terms are not followed. With this number the
/// tables of a regime stay below 16 MiB.
const MAX_POINTS: f64 = 8192.0;
/// Largest deviation of a slow term of amplitude one from its chord over an interval.
const SLOW: f64 = 0.5;
/// Bound of the rounding errors of a value, from table and sums, as a fraction of the terms' size.
pub(crate) const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The tabulated exponentials of a regime's slowest terms, for one guard or output.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Table {
    /// Numbers of the terms that are followed, slowest first.
    followed: Vec<usize>,
    /// Grid over the whole reach, or from one coarse point to the next.
    pub(crate) fine: Grid,
    pub(crate) coarse: Option<Coarse>,
    /// Time from the first point to the last of the grid that covers the stretch.
    reach: f64,
}

/// The coarse grid, with the exponentials of all terms followed on the fine grid at its points.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Coarse {
    pub(crate) grid: Grid,
    /// For every term followed on the fine grid, the exponential at each point.
    powers: Vec<Column>,
}

/// Equidistant points with the exponentials of the slowest terms.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    /// Distance of the points, `h`, and its inverse.
    pub(crate) step: f64,
    pub(crate) density: f64,
    /// Number of terms that it follows.
    pub(crate) terms: usize,
    /// Number of followed terms that are slow: nearly straight over an interval.
    pub(crate) slow: usize,
    /// Whether the followed terms are all terms of the kernel.
    pub(crate) complete: bool,
    /// `[Re, Im]` of each followed term's exponential at four points, vector after vector.
    pub(crate) table: Vec<ComplexVector>,
    /// For vectors of terms: the weights of their amplitudes in the bounds.
    pub(crate) weights: Vec<Weights>,
}

/// Weights of four terms' amplitudes in the bounds: `(|λ|h)⁶/7200` of a followed term; 1 of a term
/// that is not followed; `|λ|` of such a term, or the rounding of a followed one; and the deviation
/// of a slow term from its chord over an interval, or 1 of any other.
pub(crate) type Weights = [Vector; 4];

impl Table {
    /// Creates the table for the guard `kernel` over stretches of up to `period`; `None` if a term
    /// grows or none varies.
    pub(crate) fn new(kernel: &Kernel, period: f64) -> Option<Self> {
        Self::following(FOLLOWED[0], kernel, period)
    }

    /// Creates the table for outputs whose extrema are requested.
    pub(crate) fn for_extrema(kernel: &Kernel, period: f64) -> Option<Self> {
        Self::following(FOLLOWED_FOR_EXTREMA, kernel, period)
    }

    /// Creates the table of at most `most` terms.
    fn following(most: usize, kernel: &Kernel, period: f64) -> Option<Self> {
        if kernel.grows || kernel.fastest <= 0.0 {
            return None;
        }
        let mut order: Vec<usize> = (0..kernel.count).collect();
        order.sort_by(|&a, &b| {
            kernel
                .rate(a)
                .modulus()
                .total_cmp(&kernel.rate(b).modulus())
        });
        let step_of = |term: usize, grid: usize| {
            (ANGLE / kernel.rate(order[term]).modulus()).min(period / INTERVALS[grid])
        };
        // The slowest term sets how coarse the coarse grid can be.
        let slowest = step_of(0, 1);
        let follows = |term: &usize| slowest <= MAX_POINTS * step_of(*term, 0);
        let fine_terms = (1..order.len().min(most)).take_while(follows).count() + 1;
        let fastest = kernel.rate(order[fine_terms - 1]).modulus();
        let slow = order
            .iter()
            .filter(|&&k| kernel.rate(k).modulus() * COARSER < fastest);
        let terms = [fine_terms, slow.count().clamp(1, FOLLOWED[1])];
        let [fine_step, coarse_step] = [step_of(terms[0] - 1, 0), step_of(terms[1] - 1, 1)];
        // So many that the last point is not before the end.
        let vectors = |length: f64, step: f64| {
            let intervals = (length / step).ceil() as usize;
            layout::vectors_for(intervals + 1).min(LARGEST)
        };
        let cost = period / fine_step / WIDTH as f64 * (6 * terms[0] + 20) as f64;
        let single = cost < CHEAP || coarse_step < COARSER * fine_step;
        order.truncate(terms[0]);
        let columns = |step: f64, vectors: usize| {
            simd::dispatch(Columns {
                rates: order.iter().map(|&k| kernel.rate(k)).collect(),
                step,
                vectors,
            })
        };
        if single {
            let vectors = vectors(period, fine_step);
            return Some(Self {
                fine: Grid::new(kernel, &order, fine_step, &columns(fine_step, vectors)),
                coarse: None,
                reach: (vectors * WIDTH - 1) as f64 * fine_step,
                followed: order,
            });
        }
        let divided = (coarse_step / fine_step).ceil();
        let fine_step = coarse_step / divided;
        let fine_columns = columns(fine_step, divided as usize / WIDTH + 1);
        let vectors = vectors(period, coarse_step);
        let powers = columns(coarse_step, vectors);
        let coarse = &order[..terms[1]];
        Some(Self {
            fine: Grid::new(kernel, &order, fine_step, &fine_columns),
            coarse: Some(Coarse {
                grid: Grid::new(kernel, coarse, coarse_step, &powers),
                powers,
            }),
            reach: (vectors * WIDTH - 1) as f64 * coarse_step,
            followed: order,
        })
    }

    /// Returns the time from its first point to its last.
    pub(crate) fn reach(&self) -> f64 {
        self.reach
    }

    /// Returns the terms that are followed, slowest first.
    pub(crate) fn followed(&self) -> &[usize] {
        &self.followed
    }

    /// Reports whether every term is followed, on the fine grid at least.
    pub(crate) fn is_complete(&self) -> bool {
        self.fine.complete
    }
}

/// Work space: the amplitudes of the terms that a table follows, and those at another point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Followed {
    here: Vec<Amplitude>,
    other: Vec<Amplitude>,
}

impl Followed {
    /// Copies the amplitudes of the terms that `table` follows.
    #[inline(always)]
    pub(crate) fn follow<S: Simd>(&mut self, table: &Table, signal: &Signal) {
        signal.amplitudes::<S>(&table.followed, &mut self.here);
    }

    /// Returns the amplitudes of the followed terms, slowest first.
    #[inline(always)]
    pub(crate) fn amplitudes(&self) -> &[Amplitude] {
        &self.here
    }

    /// Moves them to the start of a coarse interval, until [`Followed::move_back`].
    #[inline(always)]
    pub(crate) fn move_to<S: Simd>(&mut self, table: &Table, interval: &Interval) {
        self.other.clear();
        let Some(coarse) = &table.coarse else {
            return;
        };
        for (amplitude, column) in self.here.iter().zip(&coarse.powers) {
            let power = layout::get(column, interval.point);
            let power = [S::splat(power.re), S::splat(power.im)];
            let mut moved = *amplitude;
            for z in &mut moved {
                let product = simd::complex_mul::<S>([S::load(&z[0]), S::load(&z[1])], power);
                *z = [S::store(product[0]), S::store(product[1])];
            }
            self.other.push(moved);
        }
        std::mem::swap(&mut self.here, &mut self.other);
    }

    /// Restores the amplitudes at the signal's start.
    #[inline(always)]
    pub(crate) fn move_back(&mut self) {
        std::mem::swap(&mut self.here, &mut self.other);
    }
}

impl Grid {
    /// Returns the number of points.
    pub(crate) fn points(&self) -> usize {
        self.table.len() / self.terms * WIDTH
    }

    /// Returns the exponential of followed term `j` at a point, `[Re, Im]`.
    #[inline(always)]
    pub(crate) fn exponential(&self, j: usize, point: usize) -> [f64; 2] {
        let (vector, lane) = layout::place(point);
        let [re, im] = &self.table[vector * self.terms + j];
        [re[lane], im[lane]]
    }

    /// Creates the grid that follows the terms `followed`, from a column of exponentials for each
    /// (of at least as many terms).
    fn new(kernel: &Kernel, followed: &[usize], step: f64, columns: &[Column]) -> Self {
        let terms = followed.len();
        let vectors = columns.first().map_or(0, Vec::len);
        let mut table = Vec::with_capacity(vectors * terms);
        for vector in 0..vectors {
            table.extend(columns.iter().take(terms).map(|column| column[vector]));
        }
        let slow = |k: &&usize| chord(kernel.rate(**k).modulus(), step) <= SLOW;
        let slow = followed.iter().take_while(slow).count();
        let mut weights = vec![Weights::default(); kernel.vectors.len()];
        for k in 0..kernel.count {
            let (vector, lane) = layout::place(k);
            let entry = &mut weights[vector];
            let size = kernel.rate(k).modulus();
            if followed.contains(&k) {
                entry[0][lane] = (size * step).powi(6) / 7200.0;
                entry[2][lane] = ROUNDING * size;
            } else {
                entry[1][lane] = 1.0;
                entry[2][lane] = size;
            }
            entry[3][lane] = if followed[..slow].contains(&k) {
                chord(size, step)
            } else {
                1.0
            };
        }
        Self {
            step,
            density: 1.0 / step,
            terms,
            slow,
            complete: terms == kernel.count,
            table,
            weights,
        }
    }
}

/// Returns the deviation of a term of amplitude one from its chord over an interval of width
/// `step`: at most an eighth of the squared width times its curvature.
fn chord(rate: f64, step: f64) -> f64 {
    (rate * step).powi(2) / 8.0
}

/// `e^{λ h p}` of a term for `p = 0, 1, …`, four points to a vector.
type Column = Vec<ComplexVector>;

/// Computes a column of vectors for each rate `λ`, with `step` as `h`.
struct Columns {
    rates: Vec<Complex>,
    step: f64,
    vectors: usize,
}

impl Work for Columns {
    type Output = Vec<Column>;

    /// Computes the columns. The first vector is evaluated, and so are the powers that carry 1, 2,
    /// 4, … vectors to the next as many: each number is a product of few factors, and rounding
    /// errors do not accumulate along the table.
    #[inline(always)]
    fn run<S: Simd>(self) -> Vec<Column> {
        let mut columns = Vec::with_capacity(self.rates.len());
        for rate in &self.rates {
            let mut column = Vec::with_capacity(self.vectors);
            column.push(exponentials::<S>(*rate, [0.0, 1.0, 2.0, 3.0], self.step));
            let mut jump = WIDTH as f64;
            while column.len() < self.vectors {
                let jumps = [1.0, 2.0, 4.0, 8.0].map(|times| times * jump);
                let [re, im] = exponentials::<S>(*rate, jumps, self.step);
                for (re, im) in re.into_iter().zip(im) {
                    let power = [S::splat(re), S::splat(im)];
                    for p in 0..column.len().min(self.vectors - column.len()) {
                        let [re, im] = &column[p];
                        let moved = simd::complex_mul::<S>([S::load(re), S::load(im)], power);
                        column.push([S::store(moved[0]), S::store(moved[1])]);
                    }
                }
                jump *= 16.0;
            }
            columns.push(column);
        }
        columns
    }
}

/// `e^{λ h p}` of four `p`.
#[inline(always)]
fn exponentials<S: Simd>(rate: Complex, points: Vector, step: f64) -> ComplexVector {
    let times = S::mul(S::load(&points), S::splat(step));
    let [re, im] = simd::exp_complex::<S>(S::splat(rate.re), S::splat(rate.im), times);
    [S::store(re), S::store(im)]
}
