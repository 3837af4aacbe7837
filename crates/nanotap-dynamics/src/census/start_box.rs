//! Seeded quasi-random starts in a box.
//!
//! The k-th start depends on the seed and k alone: a Halton sequence with nested
//! (Owen) scrambling, each digit going through a random affine permutation drawn from
//! a hash of seed, coordinate and the digits before it. Any part of the sequence can
//! be computed anywhere, in any order, and more starts extend fewer.
//!
//! Fails: Halton sequences in many dimensions (above about 20) fill the box no more
//! evenly than random points, until there are as many points as the largest prime.

use crate::control::Control;
use crate::vector::mix;

/// A box of initial states, from a lower to an upper corner.
#[derive(Clone, Debug, PartialEq)]
pub struct StartBox {
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// The reason why a box is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StartBoxError {
    /// The corners have different lengths, or none.
    #[error("a box needs as many lower as upper bounds, one at least ({lower} and {upper} given)")]
    Length {
        /// Number of lower bounds.
        lower: usize,
        /// Number of upper bounds.
        upper: usize,
    },
    /// The centre is no state of the box.
    #[error("the centre has {centre} coordinates, the box {dimension}")]
    Centre {
        /// Number of coordinates of the centre.
        centre: usize,
        /// Number of coordinates of the box.
        dimension: usize,
    },
    /// No scale is given.
    #[error("expected one scale of the box or more, got none")]
    NoScale,
    /// A side that does not run upwards between finite numbers.
    #[error(
        "side {index} of the box runs from {lower} to {upper}; it must run upwards, between finite numbers"
    )]
    Side {
        /// Index of the coordinate, from 0.
        index: usize,
        /// Lower bound of the coordinate, in its unit.
        lower: f64,
        /// Upper bound of the coordinate, in its unit.
        upper: f64,
    },
}

impl StartBox {
    /// Creates the box between two corners; a side of length zero fixes its coordinate.
    ///
    /// # Errors
    /// See [`StartBoxError`].
    pub fn new(lower: Vec<f64>, upper: Vec<f64>) -> Result<Self, StartBoxError> {
        if lower.len() != upper.len() || lower.is_empty() {
            return Err(StartBoxError::Length {
                lower: lower.len(),
                upper: upper.len(),
            });
        }
        for (index, (&l, &u)) in lower.iter().zip(&upper).enumerate() {
            if !(l <= u && (u - l).is_finite()) {
                return Err(StartBoxError::Side {
                    index,
                    lower: l,
                    upper: u,
                });
            }
        }
        Ok(Self { lower, upper })
    }

    /// Returns the dimension of the states, at least 1.
    pub fn dimension(&self) -> usize {
        self.lower.len()
    }

    /// Returns the lower corner: the lower bound of each coordinate, in its unit.
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// Returns the upper corner: the upper bound of each coordinate, in its unit.
    pub fn upper(&self) -> &[f64] {
        &self.upper
    }

    /// Returns start number `index` of the sequence with this seed.
    pub fn start(&self, seed: u64, index: u64) -> Vec<f64> {
        let mut base = 1;
        self.lower
            .iter()
            .zip(&self.upper)
            .enumerate()
            .map(|(i, (l, u))| {
                base = next_prime(base);
                let key = mix(seed ^ mix(i as u64));
                l + (u - l) * scrambled_radical_inverse(index, base, key)
            })
            .collect()
    }

    /// Returns starts 0 … count − 1 of the sequence with this seed.
    pub fn starts(&self, seed: u64, count: usize) -> Vec<Vec<f64>> {
        self.starts_until(seed, count, &Control::default())
    }

    /// Returns these starts, or those drawn before the work was cancelled.
    pub fn starts_until(&self, seed: u64, count: usize, control: &Control<'_>) -> Vec<Vec<f64>> {
        (0..count as u64)
            .take_while(|_| !control.is_cancelled())
            .map(|k| self.start(seed, k))
            .collect()
    }
}

fn next_prime(after: u64) -> u64 {
    let mut candidate = after + 1;
    while (2..candidate)
        .take_while(|f| f * f <= candidate)
        .any(|f| candidate.is_multiple_of(f))
    {
        candidate += 1;
    }
    candidate
}

/// Mirrors the digits of `index` in this base at the radix point, each permuted; in [0, 1).
fn scrambled_radical_inverse(mut index: u64, base: u64, key: u64) -> f64 {
    let mut prefix = key;
    let mut scale = 1.0 / base as f64;
    let mut value = 0.0;
    while scale > 2f64.powi(-54) {
        let digit = index % base;
        index /= base;
        let hash = mix(prefix);
        let factor = 1 + (hash & 0xffff_ffff) % (base - 1);
        let shift = (hash >> 32) % base;
        value += ((factor * digit + shift) % base) as f64 * scale;
        scale /= base as f64;
        prefix = mix(prefix ^ (digit + 1));
    }
    value.min(1.0 - f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit_box(d: usize) -> StartBox {
        StartBox::new(vec![0.0; d], vec![1.0; d]).unwrap()
    }

    /// Every one of bᵐ consecutive points falls in its own interval of length b⁻ᵐ:
    /// scrambling keeps the stratification of the Halton sequence.
    #[test]
    fn coordinates_are_stratified() {
        let b = unit_box(3);
        for (coordinate, count) in [(0, 64), (1, 81), (2, 125)] {
            let mut seen = vec![false; count];
            for k in 0..count as u64 {
                let cell = (b.start(5, k)[coordinate] * count as f64 + 1e-9) as usize;
                assert!(!seen[cell], "coordinate {coordinate}, cell {cell}");
                seen[cell] = true;
            }
        }
    }

    /// The product x₀x₁… of d uniforms averages 2⁻ᵈ; a quasi-random sum must be much
    /// nearer than the standard error of as many random points.
    #[test]
    fn the_sequence_integrates_better_than_chance() {
        let (d, n) = (4, 4096);
        let b = unit_box(d);
        let mean = b
            .starts(1, n)
            .iter()
            .map(|x| x.iter().product::<f64>())
            .sum::<f64>()
            / n as f64;
        let deviation = ((1.0f64 / 3.0).powi(4) - 0.25f64.powi(4)).sqrt() / (n as f64).sqrt();
        assert!((mean - 0.0625).abs() < 0.3 * deviation);
    }

    #[test]
    fn seeds_differ_and_order_does_not_matter() {
        let b = unit_box(2);
        assert_ne!(b.start(1, 7), b.start(2, 7));
        assert_eq!(b.starts(3, 10)[9], b.start(3, 9));
    }

    #[test]
    fn bad_boxes_are_refused() {
        assert!(StartBox::new(vec![], vec![]).is_err());
        assert!(StartBox::new(vec![0.0], vec![1.0, 2.0]).is_err());
        assert!(StartBox::new(vec![1.0], vec![0.0]).is_err());
        assert!(StartBox::new(vec![f64::NAN], vec![0.0]).is_err());
        assert!(StartBox::new(vec![f64::NEG_INFINITY], vec![0.0]).is_err());
    }

    proptest! {
        #[test]
        fn starts_stay_in_the_box(seed: u64, index: u64, low in -5.0f64..5.0, side in 0.0f64..3.0) {
            let b = StartBox::new(vec![low; 5], vec![low + side; 5]).unwrap();
            for v in b.start(seed, index) {
                prop_assert!(v >= low && v <= low + side);
            }
        }
    }
}
