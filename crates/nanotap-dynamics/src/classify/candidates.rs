//! Candidate periods of a strobe sequence.
//!
//! Nothing here decides: how nearly a sequence repeats is a hint about which
//! period to hand to Newton, never an answer. It fails quietly, by ranking the
//! true period low or not at all, for sequences that are still far from their
//! limit; the caller comes back later.

use crate::vector::distance;

/// A period worth trying, and how nearly the sequence repeats after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The period in drive periods.
    pub period: usize,
    /// Largest entry of `x_k − x_{k−period}` over the window looked at.
    pub closure: f64,
}

/// Periods up to `max_period` after which the end of a strobe sequence nearly
/// repeats, nearest first.
///
/// `strobe` holds consecutive states row by row (`dimension` values each). Each
/// period is judged on as many of the latest states as it is long, 4 at least. A
/// period counts only if it more than halves the best closure of every shorter
/// one, so multiples of a period are not listed with it.
pub fn candidate_periods(strobe: &[f64], dimension: usize, max_period: usize) -> Vec<Candidate> {
    if dimension == 0 {
        return Vec::new();
    }
    let count = strobe.len() / dimension;
    let state = |k: usize| &strobe[k * dimension..(k + 1) * dimension];
    let mut best = f64::INFINITY;
    let mut found = Vec::new();
    for period in 1..=max_period.min(count.saturating_sub(1)) {
        let window = period.max(4).min(count - period);
        let mut closure: f64 = 0.0;
        for k in count - window..count {
            closure = closure.max(distance(state(k), state(k - period)));
            if closure >= 0.5 * best {
                break;
            }
        }
        if closure < 0.5 * best {
            best = closure;
            found.push(Candidate { period, closure });
        }
    }
    found.reverse();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeating_sequence_names_its_period_and_no_multiple() {
        let strobe: Vec<f64> = (0..40).map(|k| f64::from(k % 5 * k % 5)).collect();
        let found = candidate_periods(&strobe, 1, 16);
        assert_eq!(found[0].period, 5);
        assert_eq!(found[0].closure, 0.0);
        assert!(found.iter().all(|c| c.period <= 5));
    }

    #[test]
    fn a_decaying_doubled_sequence_ranks_two_before_one() {
        let strobe: Vec<f64> = (0..64)
            .map(|k| (if k % 2 == 0 { 1.0 } else { -1.0 }) * (1.0 + 0.9f64.powi(k)))
            .collect();
        assert_eq!(candidate_periods(&strobe, 1, 16)[0].period, 2);
    }

    /// States of two numbers, of which the first alone repeats sooner.
    #[test]
    fn every_entry_of_a_state_repeats() {
        let strobe: Vec<f64> = (0..24u32)
            .flat_map(|k| [f64::from(k % 2), f64::from(k % 4)])
            .collect();
        let found = candidate_periods(&strobe, 2, 8);
        assert_eq!((found[0].period, found[0].closure), (4, 0.0));
    }

    /// A period of more than half the sequence is judged on all states that have one before them:
    /// 1 comes back after 5, but neither 9 nor 4 does.
    #[test]
    fn a_long_period_is_judged_on_all_there_is() {
        let strobe = [9.0, 4.0, 1.0, 30.0, 60.0, 5.0, 7.0, 1.0];
        let found = candidate_periods(&strobe, 1, 5);
        assert!(found.iter().all(|c| c.period != 5 || c.closure >= 3.0));
    }

    #[test]
    fn too_short_or_empty_sequences_give_nothing() {
        assert!(candidate_periods(&[], 3, 8).is_empty());
        assert!(candidate_periods(&[1.0, 2.0], 2, 8).is_empty());
        assert!(candidate_periods(&[1.0], 0, 8).is_empty());
    }
}
