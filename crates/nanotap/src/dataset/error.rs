//! Why a store could not be used.

use std::path::{Path, PathBuf};

/// Why a store could not be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Something else stands where the store should be.
    #[error("{} is there already and is not a dataset: {what}", path.display())]
    Occupied {
        /// Where.
        path: PathBuf,
        /// What was found.
        what: String,
    },
    /// A store that there is not.
    #[error("{} is not a dataset of nanotap: {what}", path.display())]
    NotAStore {
        /// Where.
        path: PathBuf,
        /// What is missing or wrong.
        what: String,
    },
    /// The store was made by another case or with other options.
    #[error(
        "{} was made otherwise: {}",
        path.display(),
        differences.join("; ")
    )]
    Mismatch {
        /// Where.
        path: PathBuf,
        /// What differs, an entry a key, `key: there, here`.
        differences: Vec<String>,
    },
    /// A chunk that a reader needs is not there.
    #[error(
        "{}: {missing} of {total} chunks are missing; run the same command again to finish it",
        path.display()
    )]
    Unfinished {
        /// Where.
        path: PathBuf,
        /// How many chunks are missing.
        missing: usize,
        /// How many there must be.
        total: usize,
    },
    /// A file of the store does not hold what it should.
    #[error("{} is damaged: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The file system refused.
    #[error("cannot {doing} {}: {source}", path.display())]
    Io {
        /// Reading, writing …
        doing: &'static str,
        /// Which file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

impl StoreError {
    /// For `map_err`: what was being done with which file.
    pub(crate) fn io(doing: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io {
            doing,
            path,
            source,
        }
    }
}

impl From<StoreError> for crate::Error {
    fn from(error: StoreError) -> Self {
        let input = |remedy| Self::input(error.to_string(), remedy);
        match &error {
            StoreError::Occupied { .. } => input("name another folder with {out}"),
            StoreError::NotAStore { .. } => {
                input("name a folder that `nanotap sweep` or `basin` wrote")
            }
            StoreError::Mismatch { .. } => {
                input("name another folder with {out}, or remove what is there")
            }
            StoreError::Io { .. } => Self::files(error.to_string()),
            StoreError::Unfinished { .. } | StoreError::Damaged { .. } => {
                Self::numerics(error.to_string())
            }
        }
    }
}
