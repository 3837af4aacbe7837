//! Pseudo-random numbers that depend on nothing but a seed.

use nanotap_arithmetic::{cos, ln};

/// A well-mixed 64-bit value from another one (splitmix64 finaliser, Steele, Lea and Flood
/// 2014).
pub(crate) fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Uniform in [0, 1) from the top 53 bits of a mixed value.
pub(crate) fn unit(z: u64) -> f64 {
    (mix(z) >> 11) as f64 * 2f64.powi(-53)
}

/// A sequence of numbers, the same for the same seed on every machine: splitmix64.
///
/// ```
/// use nanotap_dynamics::random::Random;
///
/// let mut random = Random::new(7);
/// let mean = (0..10_000).map(|_| random.normal()).sum::<f64>() / 1e4;
/// assert!(mean.abs() < 0.03);
/// ```
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The sequence of a seed.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number, uniform in (0, 1).
    pub fn uniform(&mut self) -> f64 {
        let bits = mix(self.0) >> 11;
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (bits as f64 + 0.5) * 2f64.powi(-53)
    }

    /// The next number of mean 0 and variance 1, normally distributed (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * ln(self.uniform())).sqrt();
        radius * cos(std::f64::consts::TAU * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first numbers of splitmix64 from 0 and 1234567, according to its authors' C code
    /// (<https://prng.di.unimi.it/splitmix64.c>).
    #[test]
    fn mixing_is_splitmix64() {
        assert_eq!(mix(0), 0xe220_a839_7b1d_cdaf);
        assert_eq!(mix(0x9e37_79b9_7f4a_7c15), 0x6e78_9e6a_a1b9_65f4);
        assert_eq!(mix(1_234_567), 6_457_827_717_110_365_317);
    }
}
