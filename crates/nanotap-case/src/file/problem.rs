//! Problems of a case: what is wrong, where, and the remedy.
//!
//! The terminal shows them with the line of the file; Python raises them with the text of their
//! `Display`.

use std::fmt;
use std::ops::Range;

/// A text to which problems point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// Name for messages: the path as given.
    pub name: String,
    /// Whole text of the case file.
    pub text: String,
}

impl Source {
    /// Line and column, both from 1, of a byte offset; columns count characters.
    pub fn line_and_column(&self, offset: usize) -> (usize, usize) {
        let before = self.text.get(..offset).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.matches('\n').count() + 1;
        (line, before[line_start..].chars().count() + 1)
    }
}

/// Place to which a problem of a case points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// These bytes of the case file.
    Span(Range<usize>),
    /// A `key=value` override, as written.
    Override(String),
    /// The case as a whole.
    Whole,
}

impl Place {
    /// Position in the order of reading.
    pub(super) fn offset(&self) -> usize {
        match self {
            Self::Span(span) => span.start,
            Self::Override(_) | Self::Whole => usize::MAX,
        }
    }
}

/// A problem of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Place to which the problem points.
    pub place: Place,
    /// What is wrong, with the key and the value as written.
    pub message: String,
    /// A short label under the place; may be empty.
    pub label: String,
    /// What to do to solve the problem, if known.
    pub help: Option<String>,
    /// The key concerned, as `section.key` for a physical case.
    pub key: Option<&'static str>,
    /// Whether the key is needed and not stated.
    pub is_missing: bool,
    /// `key=value` words that solve the problem, shown after the help.
    pub words: Vec<String>,
}

impl Problem {
    /// Creates a problem without label, remedy, key and words.
    pub fn new(place: Place, message: impl Into<String>) -> Self {
        Self {
            place,
            message: message.into(),
            label: String::new(),
            help: None,
            key: None,
            is_missing: false,
            words: Vec::new(),
        }
    }

    /// Sets the key concerned; `None` if there is none.
    #[must_use]
    pub const fn key(mut self, key: Option<&'static str>) -> Self {
        self.key = key;
        self
    }

    /// Sets `key=value` words that solve the problem.
    #[must_use]
    pub fn words(mut self, words: Vec<String>) -> Self {
        self.words = words;
        self
    }

    /// Sets the label under the place.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = label.into();
        self
    }

    /// Sets the remedy, shown as help.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// Largest number of problems that are shown for one case.
pub const SHOWN: usize = 20;

/// A case that cannot be used: its problems, in the order of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CaseFileError {
    /// The case file, if it exists and could be read.
    pub source: Option<Source>,
    /// From one to [`SHOWN`] problems.
    pub problems: Vec<Problem>,
    /// Number of problems beyond [`SHOWN`], which are not listed.
    pub more: usize,
}

impl CaseFileError {
    /// The key of a physical case that is missing, if nothing else is wrong.
    pub fn missing(&self) -> Option<&'static str> {
        match self.problems.as_slice() {
            [problem] => problem.key.filter(|_| problem.is_missing),
            _ => None,
        }
    }
}

/// Problems in the order of discovery; those beyond [`SHOWN`] are only counted.
#[derive(Debug, Default)]
pub(super) struct Problems {
    pub(super) found: Vec<Problem>,
    pub(super) more: usize,
}

impl Problems {
    /// Adds a problem, which is created only if it will be shown.
    pub(super) fn add(&mut self, problem: impl FnOnce() -> Problem) {
        if self.found.len() < SHOWN {
            self.found.push(problem());
        } else {
            self.more += 1;
        }
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.found.is_empty()
    }
}

impl CaseFileError {
    /// An error of one problem.
    pub fn one(source: Option<Source>, problem: Problem) -> Self {
        Self {
            source,
            problems: vec![problem],
            more: 0,
        }
    }

    /// An error with all `problems`, sorted by place.
    pub fn all(source: Option<Source>, mut problems: Vec<Problem>) -> Self {
        let more = problems.len().saturating_sub(SHOWN);
        problems.sort_by_key(|problem| match &problem.place {
            Place::Span(span) => span.start,
            Place::Override(_) => usize::MAX - 1,
            Place::Whole => usize::MAX,
        });
        problems.truncate(SHOWN);
        Self {
            source,
            problems,
            more,
        }
    }

    /// An error with the collected problems.
    pub(super) fn of(source: Option<Source>, problems: Problems) -> Self {
        let error = Self::all(source, problems.found);
        Self {
            more: error.more + problems.more,
            ..error
        }
    }
}

impl fmt::Display for CaseFileError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.problems.iter().enumerate() {
            if index > 0 {
                writeln!(formatter)?;
            }
            match (&problem.place, &self.source) {
                (Place::Span(span), Some(source)) => {
                    let (line, column) = source.line_and_column(span.start);
                    write!(formatter, "{}:{line}:{column}: ", source.name)?;
                }
                (Place::Override(written), _) => write!(formatter, "{written}: ")?,
                (_, Some(source)) => write!(formatter, "{}: ", source.name)?,
                (_, None) => {}
            }
            write!(formatter, "{}", problem.message)?;
            if let Some(help) = &problem.help {
                write!(formatter, "; {help}")?;
                if !problem.words.is_empty() {
                    write!(formatter, " {}", problem.words.join(", "))?;
                }
            }
        }
        if self.more > 0 {
            write!(formatter, "\nand {} more", self.more)?;
        }
        Ok(())
    }
}

impl std::error::Error for CaseFileError {}

impl From<CaseFileError> for nanotap_error::Error {
    fn from(error: CaseFileError) -> Self {
        use nanotap_error::{ErrorPlace, ErrorProblem, SourceText, cut};
        let place = |place| match place {
            Place::Span(span) => ErrorPlace::Span(span),
            Place::Override(written) => ErrorPlace::Override(cut(written)),
            Place::Whole => ErrorPlace::Whole,
        };
        let in_file = error.source.is_some();
        let remedy = |help: String, words: &[String]| match words {
            [] => help,
            words if in_file => format!("{help} {}", words.join(", ")),
            words => format!("{help} {{set}} {}", words.join(" {set} ")),
        };
        let mut problems: Vec<ErrorProblem> = error
            .problems
            .into_iter()
            .map(|problem| ErrorProblem {
                place: place(problem.place),
                message: cut(problem.message),
                label: problem.label,
                remedy: problem.help.map(|help| remedy(help, &problem.words)),
            })
            .collect();
        if error.more > 0 {
            problems.push(ErrorProblem {
                place: ErrorPlace::Whole,
                message: format!("and {} more problems", error.more),
                label: String::new(),
                remedy: None,
            });
        }
        Self {
            problems,
            source: error.source.map(|source| SourceText {
                name: source.name,
                text: source.text,
            }),
            kind: nanotap_error::ErrorKind::BadInput,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters_not_bytes() {
        let source = Source {
            name: "x".into(),
            text: "ω = 1\nαβγ = 2".into(),
        };
        let offset = source.text.find('γ').unwrap();
        assert_eq!(source.line_and_column(offset), (2, 3));
        assert_eq!(source.line_and_column(0), (1, 1));
        // Past the end and inside a character: the end, not a panic.
        assert_eq!(source.line_and_column(1).0, 2);
        assert_eq!(source.line_and_column(999).0, 2);
    }

    #[test]
    fn words_stand_in_the_order_of_the_file() {
        let error = CaseFileError::all(
            Some(Source {
                name: "c.toml".into(),
                text: "a = 1\nb = 2\n".into(),
            }),
            vec![
                Problem::new(Place::Whole, "third"),
                Problem::new(Place::Span(6..7), "second").help("do so"),
                Problem::new(Place::Span(0..1), "first"),
            ],
        );
        assert_eq!(
            error.to_string(),
            "c.toml:1:1: first\nc.toml:2:1: second; do so\nc.toml: third"
        );
    }
}
