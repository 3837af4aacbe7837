//! The `--threads` argument: the number of threads of parallel work.

use clap::Args;
use nanotap::study::threads::{checked, install};

use crate::failure::Failure;

/// How many threads work.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct ThreadsArgument {
    /// Number of threads; default: one per core. The result is the same for any number
    #[arg(long, value_name = "T")]
    threads: Option<usize>,
}

impl ThreadsArgument {
    /// Number of threads; 0: one per core.
    pub(crate) fn number(&self) -> Result<usize, Failure> {
        Ok(checked(self.threads)?.unwrap_or(0))
    }

    /// Runs `work` on this number of threads.
    pub(crate) fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> Result<R, Failure> {
        install(self.threads, work)
    }
}
