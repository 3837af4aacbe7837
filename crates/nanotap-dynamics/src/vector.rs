//! Vector operations on slices.

/// Largest modulus of an entry, 0 for an empty slice.
pub(crate) fn norm(a: &[f64]) -> f64 {
    a.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Largest modulus of an entry of `a − b`.
pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()))
}

/// Difference `a − b`, entry by entry.
pub(crate) fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x - y).collect()
}

/// Sum of the squared entries.
pub(crate) fn sum_of_squares(a: &[f64]) -> f64 {
    a.iter().map(|v| v * v).sum()
}

/// Scalar product of `a` and `b`.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// A well-mixed 64-bit value from another one (splitmix64 finaliser, Steele, Lea and Flood 2014):
/// the only source of pseudo-random numbers in this crate.
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
