//! The error of every front end: kind, message, place, remedy.
//!
//! Studies return an [`Error`]. The model, the case and the dataset have typed errors, each with one
//! conversion to an [`Error`] next to it. An error has a [kind](ErrorKind), from which the terminal
//! takes its exit code and Python its exception, and problems, each with its place and a remedy.
//!
//! A message names an option of a study in braces: "look near a {state}". [`Error::written`]
//! puts it as the reader types it, `--state` at the terminal and `state=` in Python.

use std::fmt;
use std::ops::Range;

use schemars::JsonSchema;
use serde::Serialize;

/// Kind of an error, which determines exit code and exception.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// The input is not valid.
    BadInput,
    /// The input is valid, and the computation failed.
    Numerics,
    /// A file or folder could not be read or written.
    Files,
    /// The work was cancelled before it was finished.
    Stopped,
}

/// A text to which problems point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceText {
    /// Name for messages: the path as given.
    pub name: String,
    /// Whole text of the case file.
    pub text: String,
}

/// Place to which a problem points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ErrorPlace {
    /// The input or the file as a whole.
    Whole,
    /// An option of a study.
    Option(String),
    /// A `key=value` of `--set`, as written.
    Override(String),
    /// These bytes of the file.
    Span(Range<usize>),
}

/// A problem of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ErrorProblem {
    /// Place to which the problem points.
    pub place: ErrorPlace,
    /// What is wrong, with the value as given.
    pub message: String,
    /// Short label under the place in the file; may be empty.
    pub label: String,
    /// What to do to solve the problem, if known.
    pub remedy: Option<String>,
}

/// An error: its kind, and one or more problems with place and remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// Kind of the error.
    pub kind: ErrorKind,
    /// File to which the problems point, if there is one.
    pub source: Option<SourceText>,
    /// Problems that cause the error, at least one.
    pub problems: Vec<ErrorProblem>,
}

/// An error as an entry of a document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ErrorDocument {
    /// Kind of the error.
    pub kind: ErrorKind,
    /// What is wrong, one problem per line.
    pub message: String,
    /// What to do to solve the problem, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
}

/// A text for a message, which may quote input of any length: long words and long texts are shortened.
pub fn cut(text: String) -> String {
    const MAX_WORD: usize = 200;
    const MAX_TEXT: usize = 2000;
    let is_long = |word: &str| word.chars().count() > MAX_WORD;
    let text = if text.split_whitespace().any(is_long) {
        let words = text.split(' ').map(|word| shortened(word, MAX_WORD));
        words.collect::<Vec<_>>().join(" ")
    } else {
        text
    };
    shortened(&text, MAX_TEXT)
}

/// The first four fifths and the end of a text that is longer than `max` characters.
fn shortened(text: &str, max: usize) -> String {
    let count = text.chars().count();
    if count <= max {
        return text.to_owned();
    }
    let start = text.chars().take(max * 4 / 5);
    let end = text.chars().skip(count - max / 10);
    start.chain(" … ".chars()).chain(end).collect()
}

impl Error {
    /// Creates an error with one problem, without place and remedy.
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        Self {
            kind,
            source: None,
            problems: vec![ErrorProblem {
                place: ErrorPlace::Whole,
                message: cut(message.into()),
                label: String::new(),
                remedy: None,
            }],
        }
    }

    /// Creates an error for invalid input, with a remedy.
    pub fn input(message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(ErrorKind::BadInput, message).remedy(remedy)
    }

    /// Creates an error for an invalid value of an option of a study, with a remedy.
    pub fn option(name: &str, message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::input(message, remedy).at(name)
    }

    /// Creates an error for a computation that failed although its input is valid.
    pub fn numerics(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Numerics, message)
    }

    /// Creates an error for work that was cancelled.
    pub fn stopped() -> Self {
        Self::new(ErrorKind::Stopped, "stopped before it was done")
    }

    /// Creates an error for a file or folder that could not be read or written.
    pub fn files(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Files, message)
    }

    /// Returns the first problem's message, without its place and remedy.
    pub fn message(&self) -> String {
        let message = self.problems.first().map_or("", |problem| &problem.message);
        replaced(message, &str::to_owned)
    }

    /// The error as an entry of a document.
    pub fn document(&self) -> ErrorDocument {
        let plain = self.clone().written(str::to_owned);
        let remedy = plain
            .problems
            .iter()
            .find_map(|problem| problem.remedy.clone());
        let messages = plain.problems.into_iter().map(|problem| problem.message);
        ErrorDocument {
            kind: self.kind,
            message: messages.collect::<Vec<_>>().join("\n"),
            remedy,
        }
    }

    /// The same error, with all problems at an option of a study.
    #[must_use]
    pub fn at(mut self, option: &str) -> Self {
        for problem in &mut self.problems {
            problem.place = ErrorPlace::Option(cut(option.to_owned()));
        }
        self
    }

    /// The same error, with this remedy for its last problem.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        if let Some(problem) = self.problems.last_mut() {
            problem.remedy = Some(remedy.into());
        }
        self
    }

    /// The same error, with `words` and a colon before its first message.
    #[must_use]
    pub fn context(mut self, words: impl fmt::Display) -> Self {
        if let Some(problem) = self.problems.first_mut() {
            problem.message = format!("{words}: {}", problem.message);
        }
        self
    }

    /// The same error, with the options in messages and remedies written as `option` writes them.
    #[must_use]
    pub fn written(mut self, option: impl Fn(&str) -> String) -> Self {
        for problem in &mut self.problems {
            problem.message = replaced(&problem.message, &option);
            problem.remedy = problem.remedy.as_ref().map(|text| replaced(text, &option));
        }
        self
    }
}

/// Options in braces, as `option` writes them.
fn replaced(text: &str, option: &impl Fn(&str) -> String) -> String {
    let is_name =
        |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let mut written = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('{') {
        written.push_str(before);
        match after.split_once('}') {
            Some((name, tail)) if is_name(name) => {
                written.push_str(&option(name));
                rest = tail;
            }
            _ => {
                written.push('{');
                rest = after;
            }
        }
    }
    written.push_str(rest);
    written
}

impl fmt::Display for Error {
    /// Problem by problem: place, message, remedy.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plain = self.clone().written(str::to_owned);
        for (index, problem) in plain.problems.iter().enumerate() {
            if index > 0 {
                writeln!(formatter)?;
            }
            match (&problem.place, &self.source) {
                (ErrorPlace::Span(span), Some(source)) => {
                    let (line, column) = source.line_and_column(span.start);
                    write!(formatter, "{}:{line}:{column}: ", source.name)?;
                }
                (ErrorPlace::Option(name), _) => write!(formatter, "{name}: ")?,
                (ErrorPlace::Override(written), _) => write!(formatter, "{written}: ")?,
                (_, Some(source)) => write!(formatter, "{}: ", source.name)?,
                (_, None) => {}
            }
            write!(formatter, "{}", problem.message)?;
            if let Some(remedy) = &problem.remedy {
                write!(formatter, "; {remedy}")?;
            }
        }
        Ok(())
    }
}

impl std::error::Error for Error {}

impl SourceText {
    /// Line and column, both from 1, of a byte offset; columns count characters.
    pub fn line_and_column(&self, offset: usize) -> (usize, usize) {
        let before = self.text.get(..offset).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.matches('\n').count() + 1;
        (line, before[line_start..].chars().count() + 1)
    }
}

impl From<nanotap_flow::FlowError> for Error {
    fn from(error: nanotap_flow::FlowError) -> Self {
        match error {
            nanotap_flow::FlowError::Cancelled => Self::stopped(),
            error => Self::numerics(error.to_string()),
        }
    }
}

impl From<nanotap_volterra::VolterraError> for Error {
    fn from(error: nanotap_volterra::VolterraError) -> Self {
        match error {
            nanotap_volterra::VolterraError::Cancelled => Self::stopped(),
            error => Self::numerics(error.to_string()),
        }
    }
}

impl From<nanotap_dynamics::ShootingError> for Error {
    fn from(error: nanotap_dynamics::ShootingError) -> Self {
        match error {
            nanotap_dynamics::ShootingError::TooLarge { .. } => {
                Self::input(error.to_string(), "give a shorter {period} or fewer modes")
            }
            error => Self::numerics(error.to_string()),
        }
    }
}

/// Conversions of errors of computations whose input is valid.
macro_rules! numerics {
    ($($error:path),*) => {$(
        impl From<$error> for Error {
            fn from(error: $error) -> Self {
                Self::numerics(error.to_string())
            }
        }
    )*};
}

numerics!(
    nanotap_dynamics::ContinuationError,
    nanotap_dynamics::MultiplierError
);

impl From<nanotap_dynamics::StartBoxError> for Error {
    fn from(error: nanotap_dynamics::StartBoxError) -> Self {
        Self::input(error.to_string(), "change it with {box}")
    }
}

impl From<nanotap_dynamics::BasinError> for Error {
    fn from(error: nanotap_dynamics::BasinError) -> Self {
        Self::input(error.to_string(), "change {x} or {y}")
    }
}

impl From<nanotap_figures::FigureError> for Error {
    fn from(error: nanotap_figures::FigureError) -> Self {
        use nanotap_figures::FigureError;
        match error {
            FigureError::UnknownEnding { path } => Self::input(
                format!("{}: unsupported file extension", path.display()),
                "use .svg, .png or .pdf",
            ),
            error @ FigureError::Write { .. } => Self::files(error.to_string()),
            other => Self::numerics(other.to_string()),
        }
    }
}

impl From<serde_json::Error> for Error {
    fn from(error: serde_json::Error) -> Self {
        Self::numerics(format!("no JSON of the result: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_in_braces_are_written_as_the_reader_types_them() {
        let error = Error::option("starts", "0 is too few", "give 1 or {max_starts}, not {1}");
        assert_eq!(
            error.to_string(),
            "starts: 0 is too few; give 1 or max_starts, not {1}"
        );
        let terminal = error.written(|name| format!("--{}", name.replace('_', "-")));
        assert_eq!(
            terminal.problems[0].remedy.as_deref(),
            Some("give 1 or --max-starts, not {1}")
        );
    }
}
