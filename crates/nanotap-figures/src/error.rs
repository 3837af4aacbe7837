use std::path::PathBuf;

/// The reason why a figure could not be drawn or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FigureError {
    /// No format is known for the file extension.
    #[error(
        "cannot tell a picture format from \"{}\": end the path in .svg, .png or .pdf",
        path.display()
    )]
    UnknownEnding {
        /// Path whose extension is unknown.
        path: PathBuf,
    },
    /// The file could not be written.
    #[error("cannot write \"{}\": {source}", path.display())]
    Write {
        /// Path of the file to be written.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A figure could not be read from JSON or written as JSON.
    #[error("cannot read or write the figure as JSON: {0}")]
    Json(serde_json::Error),
    /// The picture would have no pixels, or too many.
    #[error(
        "{dpi} dots per inch cannot be drawn at this size: choose 10 to 2400 with at most 200 million pixels in all"
    )]
    Resolution {
        /// Given resolution, dots per inch.
        dpi: f64,
    },
    /// A number of the figure cannot be drawn: a size, a range, a count of cells.
    #[error("{0}")]
    Invalid(String),
}

impl FigureError {
    /// A length that is not finite and positive.
    pub(crate) fn length(what: &str, given: f64) -> FigureError {
        FigureError::Invalid(format!(
            "{what} of {given} cannot be drawn: it must be finite and positive"
        ))
    }
}
