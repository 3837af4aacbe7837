//! How often starts escape from a motion that seems chaotic.

use crate::census::Outcome;
use crate::census::confidence::Lifetime;

/// Escapes of starts that outlived every linear transient.
pub(crate) struct Escapes {
    /// Periods up to which nothing is counted.
    after: f64,
    /// Start and periods of each escape.
    pub(crate) escaped: Vec<(usize, usize)>,
    /// Periods watched of each start that is still chaotic.
    unescaped: Vec<usize>,
}

/// Periods after which a start left chaos, if that came `after` so many: it came to an orbit, or was
/// reset.
pub(super) fn escape_after(outcome: &Outcome, after: f64) -> Option<usize> {
    match outcome {
        Outcome::Orbit { periods, .. } | Outcome::Reset { periods, .. } => {
            (*periods as f64 > after).then_some(*periods)
        }
        _ => None,
    }
}

impl Escapes {
    /// Periods after which a start that is in no neighbourhood has outlived every linear
    /// transient.
    pub(crate) fn after(relaxation: f64) -> f64 {
        (3.0 * relaxation).max(64.0)
    }

    /// Counts the escapes that came `after` so many periods.
    pub(crate) fn count(outcomes: &[Outcome], after: f64) -> Self {
        let mut escaped = Vec::new();
        let mut unescaped = Vec::new();
        for (k, outcome) in outcomes.iter().enumerate() {
            if let Outcome::Chaos(chaos, _) = outcome {
                unescaped.push(chaos.observed);
            }
            escaped.extend(escape_after(outcome, after).map(|periods| (k, periods)));
        }
        Self {
            after,
            escaped,
            unescaped,
        }
    }

    /// End of the first quarter of the time for which all wanderers were watched that
    /// were watched for long enough to count.
    fn early(&self) -> f64 {
        let watched = self.unescaped.iter().map(|&t| t as f64);
        let end = watched.filter(|&t| t > self.after).fold(f64::NAN, f64::min);
        self.after + 0.25 * (end - self.after).max(0.0)
    }

    fn exposure_between(&self, from: f64, to: f64) -> f64 {
        let share = |t: usize| ((t as f64).min(to) - from).max(0.0);
        self.escaped.iter().map(|&(_, t)| share(t)).sum::<f64>()
            + self.unescaped.iter().map(|&t| share(t)).sum::<f64>()
    }

    pub(crate) fn lifetime(&self) -> Lifetime {
        Lifetime::new(
            self.escaped.len(),
            self.exposure_between(self.after, f64::INFINITY),
        )
    }

    /// True if the wanderers are on an attractor: one at least was watched for long
    /// enough to count, and none escaped, or escapes stopped early in a way that a
    /// constant rate would show with probability below 1 %.
    pub(crate) fn chaos_lasts(&self) -> bool {
        if !self.unescaped.iter().any(|&t| t as f64 > self.after) {
            return false;
        }
        if self.escaped.is_empty() {
            return true;
        }
        let early = self.early();
        if self.escaped.iter().any(|&(_, t)| t as f64 > early) {
            return false;
        }
        let rate = self.escaped.len() as f64 / self.exposure_between(self.after, early).max(1.0);
        let expected = rate * self.exposure_between(early, f64::INFINITY);
        expected > nanotap_arithmetic::ln(100f64)
    }

    /// Part of a wanderer's time that counts towards "none escaped".
    pub(crate) fn exposure_without_escape(&self, observed: usize) -> f64 {
        let from = if self.escaped.is_empty() {
            self.after.min(observed as f64)
        } else {
            self.early()
        };
        (observed as f64 - from).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn escapes(escaped: &[usize], unescaped: &[usize]) -> Escapes {
        Escapes {
            after: 64.0,
            escaped: escaped.iter().copied().enumerate().collect(),
            unescaped: unescaped.to_vec(),
        }
    }

    #[test]
    fn three_relaxations_pass_and_64_periods_at_least() {
        assert_eq!(Escapes::after(10.0), 64.0);
        assert_eq!(Escapes::after(100.0), 300.0);
    }

    /// From 64 to the shortest watch that counts, 164, a quarter is 25 periods.
    #[test]
    fn the_first_quarter_of_what_all_were_watched_for() {
        assert_eq!(escapes(&[], &[164, 464, 30]).early(), 89.0);
        assert_eq!(escapes(&[], &[30]).early(), 64.0);
        assert_eq!(escapes(&[70], &[164]).exposure_without_escape(189), 100.0);
        assert_eq!(escapes(&[], &[164]).exposure_without_escape(189), 125.0);
    }

    /// A quarter of 10,000 periods was watched when the last start escaped. At the rate of n starts
    /// in those 2500 periods 3 n more are expected in the 7500 since, and none of them comes with
    /// probability e^(−3n): above 1 % for one, below for two.
    #[test]
    fn escapes_that_stop_early_are_weighed() {
        assert!(!escapes(&[], &[30]).chaos_lasts());
        assert!(escapes(&[], &[65]).chaos_lasts());
        assert!(!escapes(&[70], &[10_064]).chaos_lasts());
        assert!(escapes(&[70, 75], &[10_064]).chaos_lasts());
        assert!(!escapes(&[70, 75, 2600], &[10_064]).chaos_lasts());
    }
}
