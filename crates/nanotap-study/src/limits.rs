//! Upper limits on options: beyond these a study would run for days or fill the memory.

pub use nanotap_observe::time_series::MAX_ROWS;

/// Longest period of an orbit, in drive periods.
pub const MAX_PERIOD: usize = 10_000;
/// Maximum number of drive periods of one run.
pub const MAX_PERIODS: usize = 100_000_000;
/// Maximum number of samples a drive period in a time series.
pub const MAX_SAMPLES: usize = 1_000_000;
/// Maximum number of points of a mode shape.
pub const MAX_POINTS: usize = 1_000_000;
/// Maximum number of distances of an approach curve: with all that is observed they fill a gigabyte.
pub const MAX_DISTANCES: usize = 20_000;
/// Maximum number of starts of each of the censuses that look for branches.
pub const MAX_SEED_STARTS: usize = 100_000;
/// Maximum number of numbers of the states that one run keeps: 400 MB.
pub const MAX_STATE_NUMBERS: usize = 50_000_000;
/// Maximum number of doublings that are followed: beyond, periods exceed [`MAX_PERIOD`].
pub const MAX_DOUBLINGS: usize = 12;
/// Maximum number of threads that an option can request.
pub const MAX_THREADS: usize = 1024;
