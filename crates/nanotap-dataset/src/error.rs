//! Errors of dataset stores.

use std::path::{Path, PathBuf};

use nanotap_case::input::{InputError, InputFault};

/// Why a store could not be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The path exists and is not a dataset.
    #[error("{} already exists and is not a dataset: {what}", path.display())]
    Occupied {
        /// Path that was given for the store.
        path: PathBuf,
        /// Type and content of what is at the path.
        what: String,
    },
    /// The store does not exist or is not a dataset of nanotap.
    #[error("{} is not a dataset of nanotap: {what}", path.display())]
    NotAStore {
        /// Path that was given for the store.
        path: PathBuf,
        /// What is missing or wrong.
        what: String,
    },
    /// The store belongs to another case or other options.
    #[error(
        "{} belongs to another case or other options: {}",
        path.display(),
        differences.join("; ")
    )]
    Mismatch {
        /// Path of the existing store.
        path: PathBuf,
        /// The differences, one per key, as `key: there, here`.
        differences: Vec<String>,
    },
    /// Two stores that are not shares of one dataset.
    #[error(
        "{} (there) and {} (here) are not shares of one dataset: {}",
        path.display(),
        first.display(),
        differences.join("; ")
    )]
    Foreign {
        /// Path of the first store.
        first: PathBuf,
        /// Path of the other store.
        path: PathBuf,
        /// The differences, one per key, as `key: there, here`, the first store being here.
        differences: Vec<String>,
    },
    /// There is no dataset to merge.
    #[error("there is no dataset to merge")]
    Nothing,
    /// A dataset is needed completely, but some of its chunks are missing.
    #[error(
        "{}: {missing} of {total} chunks are missing; run the same command again to finish it",
        path.display()
    )]
    Unfinished {
        /// Path of the unfinished store.
        path: PathBuf,
        /// Number of unfinished chunks.
        missing: usize,
        /// Number of chunks of the dataset.
        total: usize,
    },
    /// The content of a file is invalid.
    #[error("{} is damaged: {what}", path.display())]
    Damaged {
        /// Path of the damaged file or store.
        path: PathBuf,
        /// What is wrong with the content.
        what: String,
    },
    /// The file system returned an error.
    #[error("cannot {doing} {}: {source}", path.display())]
    Io {
        /// The operation: reading, writing …
        doing: &'static str,
        /// Path of the file or folder of the operation.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
}

impl StoreError {
    /// For `map_err`: records the operation and the file.
    pub(crate) fn io(doing: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io {
            doing,
            path,
            source,
        }
    }
}

impl From<InputError> for StoreError {
    fn from(InputError { path, fault }: InputError) -> Self {
        let io = |source| Self::Io {
            doing: "read",
            path: path.clone(),
            source,
        };
        match fault {
            InputFault::System(source) => io(source),
            InputFault::Missing => io(std::io::ErrorKind::NotFound.into()),
            other => Self::Damaged {
                path,
                what: other.to_string(),
            },
        }
    }
}

impl From<StoreError> for nanotap_error::Error {
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
            StoreError::Foreign { .. } => {
                input("merge what one command wrote of one case with the same options")
            }
            StoreError::Nothing => input("name the datasets of the shares"),
            StoreError::Io { .. } => Self::files(error.to_string()),
            StoreError::Unfinished { .. } | StoreError::Damaged { .. } => {
                Self::numerics(error.to_string())
            }
        }
    }
}
