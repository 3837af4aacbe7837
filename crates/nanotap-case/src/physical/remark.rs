//! Remarks about a resolved case.

use std::fmt;

use serde::Serialize;

/// Whether a remark is a note or a warning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// An assumption made or a quantity inferred.
    Note,
    /// The model may not describe the intended system.
    Warning,
}

/// A remark about a case.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Remark {
    /// Whether the remark is a note or a warning.
    pub severity: Severity,
    /// The sentence, without a full stop.
    pub text: String,
}

impl Remark {
    /// A note for each text.
    pub fn notes(texts: &[String]) -> Vec<Self> {
        texts.iter().map(Self::note).collect()
    }

    /// A warning for each text.
    pub fn warnings(texts: &[String]) -> Vec<Self> {
        texts.iter().map(Self::warning).collect()
    }

    /// Creates a note: an assumption made or a quantity inferred.
    pub fn note(text: impl Into<String>) -> Self {
        Self {
            severity: Severity::Note,
            text: text.into(),
        }
    }

    /// Creates a warning: the model may not describe the intended system.
    pub fn warning(text: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            text: text.into(),
        }
    }
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = match self.severity {
            Severity::Note => "note",
            Severity::Warning => "warning",
        };
        write!(f, "{word}: {}", self.text)
    }
}
