//! What a census may have missed: a bound, never "all".
//!
//! After the k-th motion was found, n drawn starts in a row led to nothing new. If
//! starts that lead to motions not yet found had the share p of the set, such a row
//! would have the probability (1 − p)ⁿ. With the error δ_k = 0.05/(k(k+1)) for the
//! row after the k-th motion, which sums to 0.05 over all k, the statement
//!
//! p ≤ 1 − δ_k^{1/n}
//!
//! is wrong with probability 5 % at most, *whenever* the census stops: a row that
//! makes it wrong must be longer than the probability δ_k allows, at one k at least.
//!
//! It speaks of the set of starts, not of motions: one whose basin has no part of the
//! set is not bounded. Draws are taken as random; quasi-random ones are spread more
//! evenly, and drawing the sizes in turn only lowers (1 − p)ⁿ (the geometric mean of
//! the sizes' shares is below the arithmetic one). Starts left undecided are no
//! trials: the share is of those that have one.

/// Probability that the bound of a whole census is wrong, at most.
const ERROR: f64 = 0.05;

/// Bound on the fraction of the starts that may lead to motions that were not found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UndiscoveredFraction {
    /// Number of different motions found.
    pub motions: usize,
    /// Number of drawn starts decided since the last of them was found.
    pub starts: usize,
    /// Fraction of the starts, 0 to 1: with 95 % confidence at most this many lead to motions not
    /// found.
    pub share: f64,
}

impl UndiscoveredFraction {
    pub(crate) fn new(motions: usize, starts: usize) -> Self {
        let share = if starts == 0 {
            1.0
        } else {
            -nanotap_arithmetic::exp_m1(log_error(motions) / starts as f64)
        };
        Self {
            motions,
            starts,
            share,
        }
    }

    /// Starts in a row after which the share is bounded by this one.
    pub(crate) fn starts_needed(motions: usize, share: f64) -> usize {
        (log_error(motions) / nanotap_arithmetic::ln_1p(-share)).ceil() as usize
    }
}

/// Logarithm of the error for the row after so many motions.
fn log_error(motions: usize) -> f64 {
    let k = motions.max(1) as f64;
    nanotap_arithmetic::ln(ERROR / (k * (k + 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::unit;

    #[test]
    fn the_bound_falls_like_one_over_the_starts() {
        assert_eq!(UndiscoveredFraction::new(1, 0).share, 1.0);
        // ln 40 = 3.689.
        let one = UndiscoveredFraction::new(1, 10_000).share;
        assert!((one * 10_000.0 - 3.689).abs() < 2e-3);
        assert!(
            UndiscoveredFraction::new(5, 1000).share > UndiscoveredFraction::new(4, 1000).share
        );
    }

    #[test]
    fn the_row_for_a_share_is_the_shortest_that_bounds_it() {
        for motions in [0, 1, 2, 7, 100] {
            for share in [0.5, 0.01, 0.002, 1e-6] {
                let row = UndiscoveredFraction::starts_needed(motions, share);
                assert!(UndiscoveredFraction::new(motions, row).share <= share);
                assert!(UndiscoveredFraction::new(motions, row - 1).share > share);
            }
        }
        // Nothing bounds a share to none, and any row to all.
        assert_eq!(UndiscoveredFraction::starts_needed(1, 0.0), usize::MAX);
        assert_eq!(UndiscoveredFraction::starts_needed(1, 1.0), 0);
    }

    /// A thousand censuses of ten motions with shares 1/2, 1/4 … 1/512, 1/512, each
    /// stopped by the bound itself: it may be wrong in 5 % of them.
    #[test]
    fn it_is_wrong_as_rarely_as_it_says() {
        let motion = |u: f64| (-u.log2()).floor().min(9.0) as usize;
        let share = |seen: &[bool; 10]| -> f64 {
            (0..10)
                .filter(|&k| !seen[k])
                .map(|k| 0.5f64.powi((k as i32 + 1).min(9)))
                .sum()
        };
        let mut wrong = 0;
        for trial in 0..1000u64 {
            let (mut seen, mut found, mut row) = ([false; 10], 0, 0);
            for k in 0..5000u64 {
                let m = motion(1.0 - unit(trial << 32 | k));
                if seen[m] {
                    row += 1;
                } else {
                    seen[m] = true;
                    found += 1;
                    row = 0;
                }
                if UndiscoveredFraction::new(found, row).share < 0.02 {
                    break;
                }
            }
            wrong += usize::from(share(&seen) > UndiscoveredFraction::new(found, row).share);
        }
        assert!(wrong <= 50, "{wrong}");
    }
}
