//! Reproducible random numbers.

/// Numbers between −1 and 1 (a multiplicative congruence).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// Random numbers of a long run: from the seed in the random tests' environment variable, or
    /// the `usual` seed.
    #[allow(dead_code, reason = "not every test that draws numbers is a long run")]
    pub(crate) fn of_a_long_run(usual: u64) -> Self {
        let seed = std::env::var("PROPTEST_RNG_SEED");
        Self(seed.map_or(usual, |seed| seed.parse().expect("a number")))
    }

    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
