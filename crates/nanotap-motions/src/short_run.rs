//! Limits of the classification of one of very many runs.

use nanotap_dynamics::{ClassifyOptions, LyapunovOptions};

/// A tenth of what a single run is given.
pub fn short_run(max_period: usize) -> ClassifyOptions {
    ClassifyOptions {
        max_period,
        max_transient: 512,
        lyapunov: LyapunovOptions {
            alignment: 50,
            min_periods: 250,
            max_periods: 2000,
            absolute_error: 5e-3,
            relative_error: 0.1,
        },
        birkhoff_periods: 2048,
        torus_digits: 6.0,
        ..ClassifyOptions::default()
    }
}
