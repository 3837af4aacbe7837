//! Conclusions from an evaluation of a signal near its zero.

use super::interval::Cubic;
use super::steps::RESOLUTION;
use crate::simd::Lanes;

/// A signal near a zero, one per lane.
pub(crate) struct Near<L: Lanes> {
    /// The signal and its first three derivatives.
    pub(crate) cubic: Cubic<L>,
    /// Bound of the third derivative from here on.
    pub(crate) third: L::Register,
    /// Largest `|λ|` of the signal's terms: the fourth derivative is at most this times `third`.
    pub(crate) fastest: L::Register,
    /// The size of rounding errors in the value.
    pub(crate) noise: L::Register,
    /// The length of the stretch, against which times are resolved.
    pub(crate) length: L::Register,
}

impl<L: Lanes> Near<L> {
    /// Returns the lanes, one bit each, in which the signal may have another zero in an interval
    /// where a quintic within `error` of it falls at least as fast as `gentlest`. Every zero there
    /// is near; in the other lanes the rate keeps its sign up to it.
    #[inline(always)]
    pub(crate) fn not_unique(&self, gentlest: L::Register, error: L::Register) -> u32 {
        let value = L::fma(L::splat(2.0), error, L::abs(self.cubic.value));
        let near = L::div(value, gentlest);
        let third = L::mul(L::splat(1.2), L::mul(self.third, near));
        let change = L::mul(near, L::add(L::abs(self.cubic.curvature), third));
        L::below(L::splat(0.1), L::mul(near, self.fastest))
            | L::below(L::sub(L::splat(0.0), change), self.cubic.rate)
    }

    /// Returns the lanes, one bit each, in which a step to the cubic's zero, where the cubic has
    /// this slope, is not certain to end at the signal's zero.
    #[inline(always)]
    pub(crate) fn goes_on(&self, step: L::Register, slope: L::Register) -> u32 {
        // |g(at + step)| ≤ B₄ step⁴ / 24 where the cubic vanishes, and B₄ ≤ B max|λ|.
        let squared = L::mul(step, step);
        let fourth = L::mul(self.third, self.fastest);
        let error = L::mul(
            L::mul(fourth, L::splat(1.0 / 24.0)),
            L::mul(squared, squared),
        );
        let resolution = L::mul(L::splat(RESOLUTION), L::mul(self.length, L::abs(slope)));
        L::below(self.noise, L::abs(self.cubic.at(step))) | L::below(resolution, error)
    }
}
