//! Upper limits on options: beyond these a study would run for days or fill the memory.

pub use crate::observe::time_series::MAX_ROWS as MOST_ROWS;

/// Longest period of an orbit, in drive periods.
pub const MOST_PERIOD: usize = 10_000;
/// Most drive periods of one run.
pub const MOST_PERIODS: usize = 100_000_000;
/// Most samples a drive period in a time series.
pub const MOST_SAMPLES: usize = 1_000_000;
/// Most points of a mode shape.
pub const MOST_POINTS: usize = 1_000_000;
/// Most distances of an approach curve: with all that is observed they fill a gigabyte.
pub const MOST_DISTANCES: usize = 20_000;
/// Most starts of each of the censuses that look for branches.
pub const MOST_SEED_STARTS: usize = 100_000;
/// Most numbers of the states that one run keeps: 400 MB.
pub const MOST_STATE_NUMBERS: usize = 50_000_000;
/// Most doublings that are followed: beyond, periods exceed [`MOST_PERIOD`].
pub const MOST_DOUBLINGS: usize = 12;
/// Most threads.
pub const MOST_THREADS: usize = 1024;
