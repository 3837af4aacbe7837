//! Why a file is not read.

use std::fmt;

use crate::Format;

/// Why a file, or a curve of it, is not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The content is of no format that this crate recognises.
    #[error("not a file of an AFM that is known here: it begins with {beginning}")]
    Unknown {
        /// The first bytes, as text where they are text.
        beginning: String,
    },
    /// The content is recognised, but nothing reads it.
    #[error("{content}: {reason}")]
    Unsupported {
        /// The file's format.
        format: Format,
        /// What the file is, such as "a high-speed AFM video (.asd)".
        content: String,
        /// Why it is not read, or what to do.
        reason: String,
    },
    /// The file is incomplete or contradicts its format.
    #[error("{format}, {place}: {problem}; expected {expected}")]
    Damaged {
        /// The file's format.
        format: Format,
        /// Where the problem is.
        place: Place,
        /// What is there.
        problem: String,
        /// What would be right.
        expected: String,
    },
    /// The file states or holds more than is allowed.
    #[error("{quantity}: {found} exceed the limit of {limit}")]
    Limit {
        /// What there is too much of.
        quantity: &'static str,
        /// How many there are; at least so many where counting stopped.
        found: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// The disk or the network does not give the file's bytes.
    #[error("the file cannot be read: {problem}")]
    Io {
        /// What the system says.
        problem: String,
    },
    /// The curve does not exist.
    #[error("no curve {number}: the file has {count}, counted from 0")]
    NoCurve {
        /// The number that was requested.
        number: usize,
        /// How many curves the file has.
        count: usize,
    },
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// Offset from the beginning of the file, in bytes.
    Byte(u64),
    /// Name of an entry of an archive.
    Entry(String),
    /// Key of a header.
    Key(String),
    /// Line of a text, counted from 1.
    Line(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(at) => write!(out, "byte {at}"),
            Self::Entry(name) => write!(out, "entry `{name}`"),
            Self::Key(name) => write!(out, "key `{name}`"),
            Self::Line(number) => write!(out, "line {number}"),
        }
    }
}

impl Format {
    pub(crate) fn damaged(
        self,
        place: Place,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Error {
        Error::Damaged {
            format: self,
            place,
            problem: problem.into(),
            expected: expected.into(),
        }
    }

    /// Damage at a byte of the file.
    pub(crate) fn at_byte(
        self,
        at: usize,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Error {
        self.damaged(Place::Byte(at as u64), problem, expected)
    }

    /// The count of points along a side of an image, from the value of this key.
    pub(crate) fn side(self, key: &str, value: Option<&str>) -> Result<usize, Error> {
        let count = value.and_then(|of| of.parse::<usize>().ok());
        count
            .filter(|of| *of > 0)
            .ok_or_else(|| self.at_key(key, "missing or not a count", "a whole number above 0"))
    }

    /// Damage at a key of a header.
    pub(crate) fn at_key(
        self,
        key: impl Into<String>,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Error {
        self.damaged(Place::Key(key.into()), problem, expected)
    }

    /// The content is recognised, but nothing reads it.
    pub(crate) fn unsupported(
        self,
        content: impl Into<String>,
        reason: impl Into<String>,
    ) -> Error {
        Error::Unsupported {
            format: self,
            content: content.into(),
            reason: reason.into(),
        }
    }
}
