//! Narrow peaks that are not thermal noise: mains lines, modulations, radio.

use nanotap_arithmetic::ln;

use crate::oscillator::Oscillator;
use crate::spectrum::Bin;

/// Bins on each side whose median is the level around a bin.
const HALF_WINDOW: usize = 20;
/// Probability that a spectrum of pure noise has one such peak.
const FALSE_ALARM: f64 = 1e-3;
/// Bins next to a peak that a window fills too.
const MARGIN: usize = 2;

/// Widths f0/Q around f0 in which the spectrum may differ from the fit because the resonance drifted.
const RESONANCE: f64 = 3.0;
/// Height over bins 3 to 5 away that only a line has there.
const LINE: f64 = 3.0;

/// Runs of bins that are higher than the noise around them can be: index ranges with a margin. The
/// resonance itself is none, even where it differs from the fit.
pub(crate) fn foreign_peaks(
    bins: &[Bin],
    ratios: &[f64],
    averages: f64,
    oscillator: &Oscillator,
) -> Vec<[usize; 2]> {
    let is_line = |k: usize| {
        let near = (3..=5)
            .flat_map(|d| [k.checked_sub(d), Some(k + d)])
            .flatten();
        let highest = near
            .filter_map(|k| ratios.get(k).copied())
            .fold(0.0, f64::max);
        ratios[k] > LINE * highest
    };
    let threshold = ln(FALSE_ALARM / bins.len() as f64);
    let mut peaks: Vec<[usize; 2]> = Vec::new();
    let mut around = Vec::with_capacity(2 * HALF_WINDOW + 1);
    for (k, bin) in bins.iter().enumerate() {
        // The median of 41 bins rarely falls below a half of the mean; only candidates are sorted.
        if ratios[k] < 1.0 {
            continue;
        }
        let n = averages * bin.ordinates;
        let low = k.saturating_sub(HALF_WINDOW);
        around.clear();
        around.extend_from_slice(&ratios[low..(k + HALF_WINDOW + 1).min(ratios.len())]);
        let middle = around.len() / 2;
        let (_, median, _) = around.select_nth_unstable_by(middle, f64::total_cmp);
        let level = *median / median_of_gamma(n);
        let x = ratios[k] / level;
        // Chernoff's bound of the tail of a gamma variable with mean 1: e^{−n(x − 1 − ln x)}.
        let is_high = x.is_finite() && x > 1.0 && -n * (x - 1.0 - ln(x)) < threshold;
        let in_resonance = (bin.frequency - oscillator.f0).abs() < RESONANCE * oscillator.width();
        if is_high && (!in_resonance || is_line(k)) {
            let run = [k.saturating_sub(MARGIN), (k + MARGIN + 1).min(bins.len())];
            match peaks.last_mut() {
                Some(last) if last[1] >= run[0] => last[1] = run[1],
                _ => peaks.push(run),
            }
        }
    }
    peaks
}

/// Median of a gamma variable with mean 1 and shape n (E. B. Wilson and M. M. Hilferty, PNAS 17, 684
/// (1931)).
fn median_of_gamma(n: f64) -> f64 {
    let root = 1.0 - 1.0 / (9.0 * n);
    root * root * root
}
