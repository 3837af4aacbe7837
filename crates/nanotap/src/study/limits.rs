//! Most of everything that can be asked for: beyond these a study would run for days or fill
//! the memory, and whoever asks for more has almost always mistyped.

pub use crate::observe::time_series::MOST_ROWS;

/// Longest period of an orbit, in drive periods.
pub const MOST_PERIOD: usize = 10_000;
/// Most drive periods of one run.
pub const MOST_PERIODS: usize = 100_000_000;
/// Most starts of a census.
pub const MOST_STARTS: usize = 100_000_000;
/// Most samples a drive period in a time series.
pub const MOST_SAMPLES: usize = 1_000_000;
/// Most values or points of a curve.
pub const MOST_POINTS: usize = 1_000_000;
/// Most doublings that are followed: beyond, periods exceed [`MOST_PERIOD`].
pub const MOST_DOUBLINGS: usize = 12;
/// Most threads.
pub const MOST_THREADS: usize = 1024;
