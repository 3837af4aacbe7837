//! Studies of many motions, computed chunk by chunk into a dataset.

use std::fmt::Debug;

use crate::control::Control;
use crate::dataset::{Schema, Store, Work, WorkError};

/// What is computed, checked and ready: its chunks are pure functions of it.
pub type Recipe = Box<dyn Computation>;

/// The computation of a dataset.
pub trait Computation: Debug + Send + Sync {
    /// What its dataset holds.
    fn schema(&self) -> &Schema;

    /// Computes the chunks that `store`, made for its schema, still lacks.
    ///
    /// # Errors
    /// When the work was stopped (what is finished stays), or the store refuses.
    fn compute(&self, store: &Store, work: &Work<'_>) -> Result<(), WorkError>;

    /// The files of one chunk, computed on this thread: the same bytes wherever that is. `None`
    /// when it was stopped, and for a chunk that there is not.
    fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>>;
}
