//! What is wrong with a formula, and where.

use std::ops::Range;

/// A formula that cannot be read, or does not state a force.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("at {}{}: {reason}", self.position(), self.part())]
pub struct FormulaError {
    /// The formula.
    pub text: String,
    /// Bytes of the text that are wrong; empty where something is missing.
    pub place: Range<usize>,
    /// What is wrong with them, and what would be right.
    pub reason: String,
}

impl FormulaError {
    pub(crate) fn new(text: &str, place: Range<usize>, reason: impl Into<String>) -> Self {
        let (text, reason) = (text.to_owned(), reason.into());
        Self {
            text,
            place,
            reason,
        }
    }

    /// Where the first wrong character is: `character 3`, `line 2, character 3`.
    fn position(&self) -> String {
        let before = self.text.get(..self.place.start).unwrap_or_default();
        let line = before.rsplit('\n').next().unwrap_or_default();
        let character = line.chars().count() + 1;
        if self.text.trim_end().contains('\n') {
            let number = before.matches('\n').count() + 1;
            return format!("line {number}, character {character}");
        }
        format!("character {character}")
    }

    /// The wrong part in quotes, if there is one.
    fn part(&self) -> String {
        match self.text.get(self.place.clone()) {
            Some(part) if !part.is_empty() => format!(" (\"{part}\")"),
            _ => String::new(),
        }
    }
}
