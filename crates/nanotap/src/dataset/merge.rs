//! Putting together what several machines computed of one dataset.

use std::path::{Path, PathBuf};

use super::error::StoreError;
use super::store::{Store, mismatch, same};

/// What a merge came to.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Merged {
    /// The merged store.
    pub path: PathBuf,
    /// Chunks of the dataset.
    pub chunks: usize,
    /// Chunks that were copied now.
    pub copied: usize,
    /// Chunks that are in none of the stores, by index.
    pub missing: Vec<usize>,
}

/// Copies the finished chunks of `sources` into the store at `target`, which is made if
/// it is not there: byte for byte what one machine would have made. What is damaged in
/// one source is taken from another, or missing.
///
/// # Errors
/// When a source is no store, when two do not belong together, or when the file system
/// refuses.
pub fn merge(sources: &[PathBuf], target: &Path) -> Result<Merged, StoreError> {
    let mut stores = Vec::with_capacity(sources.len());
    for source in sources {
        let store = Store::open(source)?;
        if let Some(first) = stores.first() {
            let first: &Store = first;
            if !same(store.metadata(), first.metadata()) {
                return Err(mismatch(source, store.metadata(), first.metadata()));
            }
        }
        stores.push(store);
    }
    let Some(first) = stores.first() else {
        let what = "no store was given to merge".into();
        return Err(StoreError::NotAStore {
            path: target.into(),
            what,
        });
    };
    let merged = Store::create_or_resume(target, first.schema().clone())?;
    let mut copied = 0;
    for chunk in 0..merged.chunks() {
        if merged.is_finished(chunk) {
            continue;
        }
        if let Some(source) = stores.iter().find(|s| s.is_finished(chunk)) {
            merged.take_chunk(source, chunk)?;
            copied += 1;
        }
    }
    merged.tidy()?;
    let missing = (0..merged.chunks())
        .filter(|c| !merged.is_finished(*c))
        .collect();
    Ok(Merged {
        path: target.into(),
        chunks: merged.chunks(),
        copied,
        missing,
    })
}
