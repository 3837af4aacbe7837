//! Studies of many motions, computed chunk by chunk into a dataset.

use crate::control::Control;
use crate::dataset::{Schema, Store, Work, WorkError};
use crate::study::basin::Basin;
use crate::study::sweep::Sweep;

/// What is computed, checked and ready: its chunks are pure functions of it.
#[derive(Debug)]
pub enum Recipe {
    /// Runs over one or two parameters.
    Sweep(Box<Sweep>),
    /// Points of a slice of initial states.
    Basin(Box<Basin>),
}

impl Recipe {
    /// What its dataset holds.
    pub fn schema(&self) -> &Schema {
        match self {
            Self::Sweep(sweep) => sweep.schema(),
            Self::Basin(basin) => basin.schema(),
        }
    }

    /// Computes the chunks that `store`, made for its schema, still lacks.
    ///
    /// # Errors
    /// When the work was stopped (what is finished stays), or the store refuses.
    pub fn compute(&self, store: &Store, work: &Work<'_>) -> Result<(), WorkError> {
        match self {
            Self::Sweep(sweep) => sweep.compute(store, work),
            Self::Basin(basin) => basin.compute(store, work),
        }
    }

    /// The files of one chunk, computed on this thread; `None` when it was stopped.
    pub fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>> {
        match self {
            Self::Sweep(sweep) => sweep.chunk_files(chunk, control),
            Self::Basin(basin) => basin.chunk_files(chunk, control),
        }
    }
}
