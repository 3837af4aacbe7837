//! How many threads work.

use clap::Args;

use crate::failure::Failure;

/// How many threads work.
#[derive(Args, Clone, Debug)]
pub(crate) struct ThreadsArgument {
    /// Threads; without it, one a core. The result is the same for any number
    #[arg(long, value_name = "T")]
    threads: Option<usize>,
}

impl ThreadsArgument {
    /// How many; 0 if nobody said.
    pub(crate) fn number(&self) -> Result<usize, Failure> {
        if self.threads == Some(0) {
            return Err(nobody());
        }
        Ok(self.threads.unwrap_or(0))
    }

    /// Does `work` on so many threads.
    pub(crate) fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> Result<R, Failure> {
        let Some(threads) = self.threads else {
            return Ok(work());
        };
        if threads == 0 {
            return Err(Failure::input(
                "--threads 0: nobody would work",
                "give 1 or more",
            ));
        }
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map(|pool| pool.install(work))
            .map_err(|error| Failure::numerics(format!("cannot start {threads} threads: {error}")))
    }
}

fn nobody() -> Failure {
    Failure::input("--threads 0: nobody would work", "give 1 or more")
}
