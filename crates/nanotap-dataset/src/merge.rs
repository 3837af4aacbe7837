//! Merging of partial datasets that several machines have computed.

use std::path::{Path, PathBuf};

use super::error::StoreError;
use super::schema::Schema;
use super::store::{Store, metadata_differences, same};

/// Result of merging partial datasets into one store.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
pub struct Merged {
    /// Path of the merged store.
    pub path: PathBuf,
    /// Number of chunks of the dataset.
    pub chunks: usize,
    /// Number of chunks copied in this merge.
    pub copied: usize,
    /// Number of chunks that are in none of the stores.
    pub missing_count: usize,
    /// Indices of the first of these, at most [`MAX_LISTED`].
    pub missing: Vec<usize>,
}

/// Largest number of missing chunks that are listed.
pub const MAX_LISTED: usize = 100_000;

/// Copies the finished chunks of `sources` into the store at `target`, which is created if
/// necessary; the bytes are those that one machine would have written. A chunk that is damaged in
/// one source is taken from another one, or is missing.
///
/// # Errors
/// If a source is not a store, if two do not belong together, or if the file system fails.
pub fn merge(sources: &[PathBuf], target: &Path) -> Result<Merged, StoreError> {
    let mut stores = sources
        .iter()
        .map(|source| Store::open(source))
        .collect::<Result<Vec<_>, _>>()?;
    let is_whole = |store: &Store| store.missing() == 0;
    if let Some((first, others)) = stores.split_first() {
        for other in others {
            let divided = (is_whole(first) || is_whole(other)) && alike(first, other);
            if !divided && !same(other.metadata(), first.metadata()) {
                return Err(StoreError::Foreign {
                    first: first.path().into(),
                    path: other.path().into(),
                    differences: metadata_differences(other.metadata(), first.metadata()),
                });
            }
        }
    }
    // A whole dataset is all that is needed, and may be divided into other chunks.
    if let Some(whole) = stores.iter().position(is_whole) {
        stores = vec![stores.swap_remove(whole)];
    }
    let Some(first) = stores.first() else {
        return Err(StoreError::Nothing);
    };
    let merged = if first.is_packed() {
        Store::beside(target, first.schema().clone(), true)
    } else {
        Store::create_or_resume(target, first.schema().clone())?
    };
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
    if merged.is_packed() {
        merged.write_documents()?;
    }
    merged.tidy()?;
    let missing = (0..merged.chunks())
        .filter(|c| !merged.is_finished(*c))
        .take(MAX_LISTED)
        .collect();
    Ok(Merged {
        path: target.into(),
        chunks: merged.chunks(),
        copied,
        missing_count: merged.missing(),
        missing,
    })
}

/// Whether two stores hold the same dataset, however it is divided into chunks.
fn alike(a: &Store, b: &Store) -> bool {
    let (a, b) = (a.schema(), b.schema());
    let lengths = |schema: &Schema| -> Vec<usize> {
        schema.grid.axes.iter().map(|axis| axis.length).collect()
    };
    a.attributes == b.attributes && a.variables == b.variables && lengths(a) == lengths(b)
}
