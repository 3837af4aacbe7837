//! Errors of the library as Python exceptions: invalid input is a `ValueError`, a failed
//! computation a `RuntimeError`, an error of the file system an `OSError`. Options are written as
//! keyword arguments.

use nanotap::{Error, ErrorKind};
use pyo3::PyErr;
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyValueError};

/// An error that is raised as a Python exception.
#[derive(Debug)]
pub(crate) struct Failure(pub(crate) Error);

impl Failure {
    /// Creates the failure of invalid input, with a message.
    pub(crate) fn input(words: impl Into<String>) -> Self {
        Self(Error::new(ErrorKind::BadInput, words))
    }
}

impl<E: Into<Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self(error.into())
    }
}

impl From<Failure> for PyErr {
    fn from(Failure(error): Failure) -> Self {
        let kind = error.kind;
        // A Python keyword gets an underscore at its end.
        let words = error
            .written(|option| match option {
                "from" => "from_".to_owned(),
                // A key of the case is set by its name alone.
                "set" => String::new(),
                other => other.to_owned(),
            })
            .to_string()
            .replace("  ", " ");
        match kind {
            ErrorKind::BadInput => PyValueError::new_err(words),
            ErrorKind::Numerics | ErrorKind::Stopped => PyRuntimeError::new_err(words),
            ErrorKind::Files => PyOSError::new_err(words),
        }
    }
}
