//! Confidence intervals for basin fractions and for mean lifetimes, at 95 %.

/// Two-sided 95 % quantile of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;
/// −ln 0.05: a mean lifetime below exposure/this would have shown an escape with
/// probability 95 %.
const NONE_SEEN: f64 = 2.995_732_273_553_991;

/// A fraction of starts with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fraction {
    /// Number of starts with this outcome.
    pub count: usize,
    /// Number of starts in all.
    pub total: usize,
    /// `count/total`, 0 to 1; 0 if `total` is 0.
    pub estimate: f64,
    /// Lower end of the 95 % interval, 0 to 1.
    pub low: f64,
    /// Upper end of the 95 % interval, 0 to 1.
    pub high: f64,
}

impl Fraction {
    /// Computes Wilson's score interval (J. Am. Stat. Assoc. 22, 209, 1927), whose coverage is
    /// right for small counts too. It treats the starts as random; quasi-random ones are spread
    /// more evenly, so the interval is rather too wide.
    pub fn new(count: usize, total: usize) -> Self {
        if total == 0 {
            return Self {
                count,
                total,
                estimate: 0.0,
                low: 0.0,
                high: 1.0,
            };
        }
        let n = total as f64;
        let p = count as f64 / n;
        let z2 = Z * Z / n;
        let centre = (p + 0.5 * z2) / (1.0 + z2);
        let half = Z * (p * (1.0 - p) / n + 0.25 * z2 / n).sqrt() / (1.0 + z2);
        Self {
            count,
            total,
            estimate: p,
            low: if count == 0 {
                0.0
            } else {
                (centre - half).max(0.0)
            },
            high: if count == total {
                1.0
            } else {
                (centre + half).min(1.0)
            },
        }
    }
}

/// A mean lifetime in drive periods, estimated from the number of escapes and the time observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lifetime {
    /// Number of runs that escaped.
    pub escapes: usize,
    /// Total time observed, in drive periods: the sum over all runs, each up to its escape or its
    /// end.
    pub exposure: f64,
    /// Mean lifetime in drive periods, `exposure/escapes`: the maximum-likelihood estimate with
    /// censored runs; infinite if none escaped.
    pub mean: f64,
    /// Lower end of the 95 % interval, in drive periods; with no escape, the mean lifetime is above
    /// this at 95 %.
    pub low: f64,
    /// Upper end of the 95 % interval, in drive periods; infinite if none escaped.
    pub high: f64,
}

impl Lifetime {
    /// Assumes exponential lifetimes: the number of escapes in a given exposure (drive periods) is
    /// Poisson, and the interval is Garwood's exact one (Biometrika 28, 437, 1936).
    pub fn new(escapes: usize, exposure: f64) -> Self {
        if escapes == 0 {
            return Self {
                escapes,
                exposure,
                mean: f64::INFINITY,
                low: exposure / NONE_SEEN,
                high: f64::INFINITY,
            };
        }
        Self {
            escapes,
            exposure,
            mean: exposure / escapes as f64,
            low: exposure / poisson_mean(escapes, 0.025),
            high: exposure / poisson_mean(escapes - 1, 0.975),
        }
    }
}

/// The Poisson mean for which a count of `count` or fewer has this probability.
fn poisson_mean(count: usize, probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, 2.0 * count as f64 + 20.0);
    // The probability falls with the mean.
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if poisson_cumulative(count, middle) > probability {
            low = middle;
        } else {
            high = middle;
        }
        if high - low <= 1e-12 * high {
            break;
        }
    }
    0.5 * (low + high)
}

fn poisson_cumulative(count: usize, mean: f64) -> f64 {
    let mut log_term = -mean;
    let mut sum = nanotap_arithmetic::exp(log_term);
    for k in 1..=count {
        log_term += nanotap_arithmetic::ln(mean / k as f64);
        sum += nanotap_arithmetic::exp(log_term);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Newcombe (Stat. Med. 17, 857, 1998), table I: 81/263 → 0.2553…0.3662, 0/20 →
    /// 0…0.1611, 1/29 → 0.0061…0.1718.
    #[test]
    fn wilson_agrees_with_the_published_table() {
        for (count, total, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let f = Fraction::new(count, total);
            assert!((f.low - low).abs() < 6e-5, "{f:?}");
            assert!((f.high - high).abs() < 6e-5, "{f:?}");
        }
        assert_eq!(Fraction::new(5, 5).high, 1.0);
        assert_eq!(Fraction::new(0, 0).high, 1.0);
    }

    /// Garwood's exact Poisson limits: 1 → 0.0253…5.572, 10 → 4.795…18.39.
    #[test]
    fn lifetimes_follow_the_poisson_limits() {
        for (escapes, low, high) in [(1, 0.0253, 5.572), (10, 4.795, 18.39)] {
            let l = Lifetime::new(escapes, 1.0);
            assert!((1.0 / l.high / low - 1.0).abs() < 1e-3, "{l:?}");
            assert!((1.0 / l.low / high - 1.0).abs() < 1e-3, "{l:?}");
        }
        let none = Lifetime::new(0, 3000.0);
        assert!((none.low - 1001.4).abs() < 0.1);
        assert!(none.high.is_infinite());
    }
}
