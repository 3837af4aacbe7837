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
use crate::random::mix;

/// A box of initial states, from a lower to an upper corner, or the part of it in front of a wall.
#[derive(Clone, Debug, PartialEq)]
pub struct StartBox {
    lower: Vec<f64>,
    upper: Vec<f64>,
    wall: Option<Wall>,
}

/// A plane behind which no motion starts: states `x` are in front where `row · x > least`.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// Coefficients of the distance from the wall, one per coordinate.
    pub row: Vec<f64>,
    /// Value of `row · x` at the wall, in its unit.
    pub least: f64,
}

impl Wall {
    /// Returns whether a state is in front of the wall.
    pub fn is_before(&self, state: &[f64]) -> bool {
        self.distance(state) > 0.0
    }

    /// Returns `row · x − least`.
    pub fn distance(&self, state: &[f64]) -> f64 {
        let products = self.row.iter().zip(state).map(|(a, x)| a * x);
        products.sum::<f64>() - self.least
    }
}

/// Number of draws before a start is moved out of the part behind a wall.
const DRAWS: u64 = 64;

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
    /// No state of the box is in front of the wall.
    #[error("no state of the box is in front of the wall")]
    BehindWall,
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
        Ok(Self {
            lower,
            upper,
            wall: None,
        })
    }

    /// Returns the part of the box in front of a wall, within the smallest box around it.
    ///
    /// # Errors
    /// [`StartBoxError::BehindWall`] if there is none.
    pub fn before(mut self, wall: Wall) -> Result<Self, StartBoxError> {
        let most = wall.distance(&self.farthest(&wall.row));
        if most.is_nan() || most <= 0.0 {
            return Err(StartBoxError::BehindWall);
        }
        for (i, &slope) in wall.row.iter().enumerate() {
            // With the other coordinates where they are farthest from the wall.
            let (from, end) = if slope > 0.0 {
                (self.upper[i], &mut self.lower[i])
            } else {
                (self.lower[i], &mut self.upper[i])
            };
            if (from - *end).abs() * slope.abs() > most {
                *end = from - most / slope;
            }
        }
        self.wall = Some(wall);
        Ok(self)
    }

    /// Returns the corner with the greatest `row · x`.
    fn farthest(&self, row: &[f64]) -> Vec<f64> {
        let ends = self.lower.iter().zip(&self.upper).zip(row);
        ends.map(|((l, u), slope)| if *slope > 0.0 { *u } else { *l })
            .collect()
    }

    /// Returns the wall in front of which the starts are, if there is one.
    pub fn wall(&self) -> Option<&Wall> {
        self.wall.as_ref()
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

    /// Returns start number `index` of the sequence with this seed. A draw behind the wall is
    /// replaced by a random one: points of other sequences with the same index are not independent.
    pub fn start(&self, seed: u64, index: u64) -> Vec<f64> {
        let start = self.point(seed, index);
        let Some(wall) = self.wall.as_ref().filter(|wall| !wall.is_before(&start)) else {
            return start;
        };
        let mut others = (1..DRAWS).map(|draw| self.point(seed, mix(index ^ mix(!draw))));
        others
            .find(|other| wall.is_before(other))
            .unwrap_or_else(|| {
                // Half-way from the wall towards the corner that is farthest from it.
                let corner = self.farthest(&wall.row);
                let (near, far) = (wall.distance(&start), wall.distance(&corner));
                let part = 0.5 * far / (far - near);
                let ends = corner.iter().zip(&start);
                ends.map(|(c, x)| c + part * (x - c)).collect()
            })
    }

    /// Returns point number `index` of the sequence with this seed in the whole box.
    fn point(&self, seed: u64, index: u64) -> Vec<f64> {
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

    /// A third of the square is in front, or a tiny corner of it; all starts are there, and in the
    /// first case they are spread evenly.
    #[test]
    fn starts_are_before_the_wall() {
        let square = StartBox::new(vec![-1.0; 2], vec![1.0; 2]).unwrap();
        let wall = |least| Wall {
            row: vec![1.0, 0.5],
            least,
        };
        for least in [0.3, 1.499, 1.499_999_9] {
            let part = square.clone().before(wall(least)).unwrap();
            let starts = part.starts(4, 500);
            assert!(starts.iter().all(|x| wall(least).is_before(x)), "{least}");
            let inside = |x: &f64| (-1.0..=1.0).contains(x);
            assert!(starts.iter().flatten().all(inside), "{least}");
        }
        let part = square.clone().before(wall(0.3)).unwrap();
        assert!((part.lower()[0] + 0.2).abs() < 1e-15 && part.lower()[1] == -1.0);
        let starts = part.starts(4, 2000);
        let share = starts.iter().filter(|x| x[0] < 0.3).count() as f64 / 2000.0;
        // The area with x + y/2 > 0.3: a triangle up to x = 0.8 and a rectangle; a quarter of the
        // triangle is at x < 0.3.
        let (left, all) = (0.25, 1.0 + 0.4);
        assert!((share - left / all).abs() < 0.03, "{share}");
        assert_eq!(
            square.before(wall(1.5)),
            Err(StartBoxError::BehindWall),
            "only the corner itself is at the wall"
        );
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
