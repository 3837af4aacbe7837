//! How the ordinates of a spectrum scatter: around the oscillator, and from one to the next.

use crate::oscillator::Oscillator;
use crate::spectrum::Bin;

/// Bins between the ordinates of a difference that no common window correlates.
const FAR: usize = 3;

/// Widths f0/Q around f0 whose differences are left out: a peak that drifted is not smooth.
const RESONANCE: f64 = 3.0;
/// Fewest differences without the resonance.
const MIN_DIFFERENCES: usize = 200;

/// Scatter of P/S of the bins in a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BinScatter {
    /// Number of averages by the scatter around the fit: 1/mean((P/S − 1)²).
    pub(crate) seen: f64,
    /// Number of averages by differences of near ordinates, which no smooth misfit changes.
    pub(crate) local: f64,
    /// 1 + 2 Σ ρₖ², from the differences of ordinates 1, 2 and 3 bins apart.
    pub(crate) inflation: f64,
}

impl BinScatter {
    /// From P/S of these bins; a difference xₖ₋ₗ − 2xₖ + xₖ₊ₗ of ordinates with variance σ² has the
    /// variance σ² (6 − 8 ρₗ² + 2 ρ₂ₗ²).
    pub(crate) fn new(bins: &[Bin], ratios: &[f64], oscillator: &Oscillator) -> Self {
        let squares = bins.iter().zip(ratios);
        let of_fit = squares.map(|(bin, u)| bin.ordinates * (u - 1.0) * (u - 1.0));
        let seen = 1.0 / mean(of_fit);
        let is_far = |k: &usize| {
            let distance = (bins[*k].frequency - oscillator.f0).abs();
            distance > RESONANCE * oscillator.width()
        };
        let all = FAR..bins.len().saturating_sub(FAR);
        let far: Vec<usize> = all.clone().filter(is_far).collect();
        let inner = if far.len() < MIN_DIFFERENCES {
            all.collect()
        } else {
            far
        };
        let of_lag = |lag: usize| {
            mean(
                inner
                    .iter()
                    .map(|k| square_of_difference(bins, ratios, *k, lag)),
            )
        };
        let variance = of_lag(FAR);
        // Correlations within the noise of their estimate are taken as none.
        let noise = 3.0 / (inner.len() as f64).sqrt();
        let significant = |r: f64| if r > noise { r.min(1.0) } else { 0.0 };
        let second = significant(0.75 * (1.0 - of_lag(2) / variance));
        let first = significant(0.75 * (1.0 - of_lag(1) / variance) + 0.25 * second);
        Self {
            seen,
            local: 1.0 / variance,
            inflation: 1.0 + 2.0 * (first + second),
        }
    }
}

/// Number of averages by the median of the squared differences of near ordinates, which a few foreign
/// peaks do not change. Up to 1.7 times too large for few averages.
pub(crate) fn robust_averages(bins: &[Bin], ratios: &[f64]) -> f64 {
    /// Median of the square of a standard normal variable.
    const MEDIAN: f64 = 0.454_936;
    let inner = FAR..bins.len().saturating_sub(FAR);
    let mut squares: Vec<f64> = inner
        .map(|k| square_of_difference(bins, ratios, k, FAR))
        .collect();
    if squares.is_empty() {
        return 1.0;
    }
    let middle = squares.len() / 2;
    let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
    (MEDIAN / *median).max(1.0)
}

/// (xₖ₋ₗ − 2xₖ + xₖ₊ₗ)² relative to its variance for independent single periodograms.
fn square_of_difference(bins: &[Bin], ratios: &[f64], k: usize, lag: usize) -> f64 {
    let [a, b, c] = [k - lag, k, k + lag].map(|k| (ratios[k], 1.0 / bins[k].ordinates));
    let difference = a.0 - 2.0 * b.0 + c.0;
    difference * difference / (a.1 + 4.0 * b.1 + c.1)
}

/// The mean; NaN of nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}
