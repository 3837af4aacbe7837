//! The walk along the points of a table for eight signals side by side, a lane each.
//!
//! A lane cannot stop early, so the proof has to be cheap everywhere. Most of a flight is far from
//! zero, and there the values of the slow terms suffice: between two points they stay above the
//! lower value minus the deviation of a curve from its chord, and every other term is at most its
//! amplitude. The intervals that this leaves open, mostly the first of a flight and the last ones,
//! are examined as in the walk of a single signal ([`walk`](super::walk)), with all followed terms,
//! by the quintic's Bernstein coefficients. Each lane then examines its own next open interval.

use super::interval::Quintic;
use super::tabulated::Table;
use super::walk::{Bounds, coefficients};
use crate::regime::Kernel;
use crate::simd::{self, ComplexOctet, LANES, Octet, WIDTH, Wide, layout};

/// Largest number of intervals in a search: one bit each.
const MAX_INTERVALS: usize = 64;
/// Number of terms that are followed; missing ones are zero.
const TERMS: usize = 4;

/// Eight guards at the start of a stretch.
pub(crate) struct Signals<'a> {
    pub(crate) kernel: &'a Kernel,
    pub(crate) table: &'a Table,
    /// The amplitudes of all terms.
    pub(crate) amplitudes: &'a [ComplexOctet],
    /// Sums of the amplitudes' absolute values with the fine grid's
    /// [`Weights`](super::tabulated::Weights); `size` is that without weights.
    pub(crate) sums: [Octet; 4],
    pub(crate) size: Octet,
    /// Times up to which the search goes, from the start of the stretch.
    pub(crate) reach: Octet,
    /// Lanes whose signal starts at zero by definition, and the rate with which it does.
    pub(crate) on_surface: u32,
    pub(crate) rate: Octet,
    /// Lanes without a search, one bit each.
    pub(crate) idle: u32,
}

/// The first interval in each lane that is not certified, if there is one.
#[derive(Clone, Copy)]
pub(crate) struct Intervals<W: Wide> {
    /// Lanes in which there is such an interval, one bit each.
    pub(crate) found: u32,
    pub(crate) start: W::Register,
    /// Value, rate and curvature at both ends.
    pub(crate) ends: [[W::Register; 3]; 2],
}

/// Returns the longest time over which the signals of a table can be searched side by side.
pub(crate) fn reach(table: &Table) -> f64 {
    (table.fine.points() - 1).min(MAX_INTERVALS) as f64 * table.fine.step
}

/// Reports whether the signals of a table can be searched side by side.
pub(crate) fn fits(table: &Table) -> bool {
    table.coarse.is_none() && table.fine.terms <= TERMS
}

impl Signals<'_> {
    /// Finds the first interval in each lane that is not certified, and the bounds of the signals
    /// on the table's grid.
    #[inline(always)]
    pub(crate) fn first_open<W: Wide>(&self) -> (Intervals<W>, Bounds<W>) {
        let grid = &self.table.fine;
        let [sixth, outside, outside_rate, _] = &self.sums;
        let sums = [W::load(sixth), W::load(outside), W::load(outside_rate)];
        let bounds = Bounds::<W>::new(sums, W::load(&self.size), grid.density);
        let mut open = match grid.slow {
            0 => self.open_intervals::<W, 0>(&bounds),
            1 => self.open_intervals::<W, 1>(&bounds),
            2 => self.open_intervals::<W, 2>(&bounds),
            3 => self.open_intervals::<W, 3>(&bounds),
            _ => self.open_intervals::<W, 4>(&bounds),
        };
        let followed = self.followed::<W>();
        // What falls through zero, for the arithmetic of lanes without an interval.
        let falling = |value| {
            [
                W::splat(value),
                W::splat(-2.0 * grid.density),
                W::splat(0.0),
            ]
        };
        let mut found = Intervals {
            found: 0,
            start: W::splat(0.0),
            ends: [falling(1.0), falling(-1.0)],
        };
        while open.iter().fold(0, |all, open| all | open) != 0 {
            self.look_at_next(&followed, &bounds, &mut open, &mut found);
        }
        (found, bounds)
    }

    /// Returns the number of the `j`-th followed term in the kernel.
    #[inline(always)]
    fn term(&self, j: usize) -> usize {
        self.table.followed()[j]
    }

    /// Returns the intervals that the `SLOW` slowest terms do not certify, one bit each, lane by
    /// lane.
    #[inline(always)]
    fn open_intervals<W: Wide, const SLOW: usize>(&self, bounds: &Bounds<W>) -> [u64; LANES] {
        let grid = &self.table.fine;
        let reach = W::load(&self.reach);
        let constant = W::splat(self.kernel.constant);
        // What slow terms take between two points, and all others anywhere.
        let rounding = W::sub(bounds.floor, W::load(&self.sums[1]));
        let floor = W::add(W::load(&self.sums[3]), rounding);
        let gone = W::sub(W::splat(0.0), floor);
        let mut amplitudes = [[W::splat(0.0); 2]; SLOW];
        for (j, amplitude) in amplitudes.iter_mut().enumerate() {
            *amplitude = W::load_complex(&self.amplitudes[self.term(j)]);
        }
        let mut before = W::splat(f64::MAX);
        let mut ended = self.idle;
        // The first is that before the first point.
        let mut open = [0_u8; MAX_INTERVALS + WIDTH];
        let vectors = grid.table.chunks_exact(grid.terms);
        let mut points = 0;
        for (vector, open) in vectors.zip(open.chunks_exact_mut(WIDTH)) {
            for (place, open) in open.iter_mut().enumerate() {
                let (mut value, mut other) = (constant, W::splat(0.0));
                for ([re, im], [ar, ai]) in vector.iter().zip(&amplitudes) {
                    value = W::fma(*ar, W::splat(re[place]), value);
                    other = W::fma(*ai, W::splat(im[place]), other);
                }
                let value = W::sub(value, other);
                *open = (W::below(W::min(before, value), floor) & !ended) as u8;
                before = value;
                // Below zero for certain, or at the end of the stretch. What is below zero from the
                // start has its first interval open.
                let at = W::splat(points as f64 * grid.step);
                if points > 0 {
                    ended |= !W::below(gone, value) | !W::below(at, reach);
                }
                points += 1;
            }
            if ended & ALL == ALL {
                break;
            }
        }
        transposed(&open, points)
    }

    /// Returns the followed terms, filled up with zeros.
    #[inline(always)]
    fn followed<W: Wide>(&self) -> [Term<W>; TERMS] {
        let zero = [W::splat(0.0); 2];
        let mut terms = [Term::<W> {
            amplitude: zero,
            turn: zero,
            rate: zero,
            squared: zero,
        }; TERMS];
        for (j, term) in terms.iter_mut().enumerate().take(self.table.fine.terms) {
            let rate = self.kernel.rate(self.term(j));
            let squared = rate * rate;
            let [re, im] = self.table.fine.exponential(j, 1);
            *term = Term {
                amplitude: W::load_complex(&self.amplitudes[self.term(j)]),
                turn: [W::splat(re), W::splat(im)],
                rate: [W::splat(rate.re), W::splat(rate.im)],
                squared: [W::splat(squared.re), W::splat(squared.im)],
            };
        }
        terms
    }

    /// Returns the exponentials of the followed terms at one point per lane.
    #[inline(always)]
    fn exponentials(&self, points: &[usize; LANES]) -> [ComplexOctet; TERMS] {
        let grid = &self.table.fine;
        let mut exponentials = [ComplexOctet::default(); TERMS];
        for (lane, point) in points.iter().enumerate() {
            let (vector, place) = layout::place(*point);
            let vectors = &grid.table[vector * grid.terms..][..grid.terms];
            for (out, [re, im]) in exponentials.iter_mut().zip(vectors) {
                out[0][lane] = re[place];
                out[1][lane] = im[place];
            }
        }
        exponentials
    }

    /// Examines the next open interval of each lane that has one.
    #[inline(always)]
    fn look_at_next<W: Wide>(
        &self,
        followed: &[Term<W>; TERMS],
        bounds: &Bounds<W>,
        open: &mut [u64; LANES],
        found: &mut Intervals<W>,
    ) {
        let grid = &self.table.fine;
        let (mut points, mut start) = ([0; LANES], Octet::default());
        let (mut at_start, mut looking) = (0, 0);
        for (lane, open) in open.iter_mut().enumerate() {
            let point = open.trailing_zeros() as usize % MAX_INTERVALS;
            points[lane] = point;
            start[lane] = point as f64;
            at_start |= u32::from(point == 0) << lane;
            looking |= u32::from(*open != 0) << lane;
            *open &= open.wrapping_sub(1);
        }
        // The terms at the intervals' first points.
        let mut terms = [[W::splat(0.0); 2]; TERMS];
        if at_start == ALL {
            for (term, with) in terms.iter_mut().zip(followed) {
                *term = with.amplitude;
            }
        } else {
            let exponentials = self.exponentials(&points);
            for (term, (with, z)) in terms.iter_mut().zip(followed.iter().zip(&exponentials)) {
                *term = simd::complex_mul::<W>(with.amplitude, W::load_complex(z));
            }
        }
        let mut low = self.sums_of(followed, &terms);
        for (term, with) in terms.iter_mut().zip(followed) {
            *term = simd::complex_mul::<W>(*term, with.turn);
        }
        let high = self.sums_of(followed, &terms);
        let from_zero = at_start & self.on_surface;
        if from_zero != 0 {
            low[0] = W::select(from_zero, W::splat(0.0), low[0]);
            low[1] = W::select(from_zero, W::load(&self.rate), low[1]);
        }
        let [[b1, b2], _] = coefficients::<W>(low, grid.step);
        let [_, [b4, b3]] = coefficients::<W>(high, grid.step);
        let least = W::min(
            W::min(low[0], high[0]),
            W::min(W::min(b1, b2), W::min(b3, b4)),
        );
        let mut not_certified =
            W::below(least, bounds.floor) | W::below(W::add(b2, b3), bounds.tension);
        if from_zero != 0 {
            // What starts at zero and rises all the way is certified as well.
            let quintic = Quintic::<W> {
                width: W::splat(grid.step),
                ends: [low, high],
            };
            let rises = !W::below(quintic.rates()[0], bounds.rate_error);
            not_certified &= !(from_zero & rises);
        }
        let here = looking & not_certified;
        for (lane, open) in open.iter_mut().enumerate() {
            *open &= u64::from((here >> lane) & 1).wrapping_sub(1);
        }
        // Beyond the end nothing is looked for.
        let start = W::mul(W::load(&start), W::splat(grid.step));
        let here = here & W::below(start, W::load(&self.reach));
        found.set(here, start, [low, high]);
    }

    /// Returns value, rate and curvature from these terms.
    #[inline(always)]
    fn sums_of<W: Wide>(
        &self,
        followed: &[Term<W>; TERMS],
        terms: &[[W::Register; 2]; TERMS],
    ) -> [W::Register; 3] {
        let zero = W::splat(0.0);
        let mut sums = [W::splat(self.kernel.constant), zero, zero];
        for ([re, im], with) in terms.iter().zip(followed) {
            sums[0] = W::add(sums[0], *re);
            sums[1] = W::fma(with.rate[0], *re, sums[1]);
            sums[1] = W::fnma(with.rate[1], *im, sums[1]);
            sums[2] = W::fma(with.squared[0], *re, sums[2]);
            sums[2] = W::fnma(with.squared[1], *im, sums[2]);
        }
        sums
    }
}

impl<W: Wide> Intervals<W> {
    #[inline(always)]
    fn set(&mut self, lanes: u32, start: W::Register, ends: [[W::Register; 3]; 2]) {
        self.found |= lanes;
        self.start = W::select(lanes, start, self.start);
        for (own, new) in self.ends.iter_mut().zip(&ends) {
            for (own, new) in own.iter_mut().zip(new) {
                *own = W::select(lanes, *new, *own);
            }
        }
    }
}

/// A bit for each lane.
const ALL: u32 = (1 << LANES) - 1;

/// A term that is followed: its amplitude, `e^{λh}`, `λ`, `λ²`.
#[derive(Clone, Copy)]
struct Term<W: Wide> {
    amplitude: [W::Register; 2],
    turn: [W::Register; 2],
    rate: [W::Register; 2],
    squared: [W::Register; 2],
}

/// Transposes bits by interval and lane into bits by lane and interval. The first interval is
/// omitted.
#[inline(always)]
fn transposed(open: &[u8; MAX_INTERVALS + WIDTH], count: usize) -> [u64; LANES] {
    let mut lanes = [0_u64; LANES];
    let groups = open[1..].chunks_exact(8).take(count.div_ceil(8));
    for (group, eight) in groups.enumerate() {
        let mut bits = 0;
        for (k, interval) in eight.iter().enumerate() {
            bits |= u64::from(*interval) << (8 * k);
        }
        let bits = transpose_eight(bits);
        for (lane, out) in lanes.iter_mut().enumerate() {
            *out |= ((bits >> (8 * lane)) & 0xff) << (8 * group);
        }
    }
    lanes
}

/// The transpose of eight by eight bits (Warren, Hacker's Delight, 7–3).
#[inline(always)]
fn transpose_eight(mut bits: u64) -> u64 {
    let swap = |bits: u64, shift: u32, mask: u64| {
        let t = (bits ^ (bits >> shift)) & mask;
        bits ^ t ^ (t << shift)
    };
    bits = swap(bits, 7, 0x00aa_00aa_00aa_00aa);
    bits = swap(bits, 14, 0x0000_cccc_0000_cccc);
    swap(bits, 28, 0x0000_0000_f0f0_f0f0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_change_places() {
        let mut open = [0; MAX_INTERVALS + WIDTH];
        for (interval, lanes) in open.iter_mut().enumerate() {
            *lanes = (interval * 37 + interval / 7) as u8;
        }
        let lanes = transposed(&open, MAX_INTERVALS);
        for (interval, bits) in open[1..=MAX_INTERVALS].iter().enumerate() {
            for (lane, intervals) in lanes.iter().enumerate() {
                assert_eq!(u64::from(bits >> lane) & 1, (intervals >> interval) & 1);
            }
        }
    }
}
