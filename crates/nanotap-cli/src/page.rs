//! The width of what is printed.

use std::io::IsTerminal as _;
use std::sync::OnceLock;

use terminal_size::{Width, terminal_size_of};
use unicode_width::UnicodeWidthStr as _;

/// The longest line of running text, however wide the terminal.
const READABLE: usize = 92;
/// No terminal is taken to be narrower.
const NARROWEST: usize = 40;

/// The columns of the terminal (`COLUMNS` where that is set); without a terminal there is no
/// limit.
pub(crate) fn width() -> usize {
    static WIDTH: OnceLock<usize> = OnceLock::new();
    *WIDTH.get_or_init(|| {
        let said = std::env::var("COLUMNS")
            .ok()
            .and_then(|text| text.parse().ok());
        let measured = || {
            let stream = std::io::stdout();
            let size = stream
                .is_terminal()
                .then(|| terminal_size_of(&stream))
                .flatten();
            size.map(|(Width(columns), _)| usize::from(columns))
        };
        said.or_else(measured)
            .map_or(usize::MAX, |columns| columns.max(NARROWEST))
    })
}

/// Running text as lines indented by two.
pub(crate) fn paragraph(words: &str) -> String {
    let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
    broken(&words, READABLE.min(width()) - 2)
        .into_iter()
        .fold(String::new(), |text, line| text + "  " + line + "\n")
}

/// A remark that follows its label, broken as the terminal is wide; further lines are
/// indented by two.
pub(crate) fn remark(text: &str) -> String {
    if width() == usize::MAX {
        return text.to_owned();
    }
    // Room for "warning: ".
    broken(text, READABLE.min(width()) - 9).join("\n  ")
}

/// `text` cut at blanks into lines of at most `width`; a word that is longer has a line of its
/// own.
pub(crate) fn broken(text: &str, width: usize) -> Vec<&str> {
    let mut lines = Vec::new();
    let mut rest = text;
    while rest.width() > width {
        // The last blank at which the line still fits, or the first.
        let cut = rest
            .match_indices(' ')
            .map(|(at, _)| at)
            .filter(|&at| !rest[..at].trim_start().is_empty())
            .take_while(|&at| rest[..at].trim_end().width() <= width)
            .last()
            .or_else(|| {
                rest.trim_start()
                    .find(' ')
                    .map(|at| at + rest.len() - rest.trim_start().len())
            });
        let Some(cut) = cut else { break };
        lines.push(rest[..cut].trim_end());
        rest = rest[cut..].trim_start();
        if rest.is_empty() {
            return lines;
        }
    }
    lines.push(rest);
    lines
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use unicode_width::UnicodeWidthStr as _;

    use super::broken;

    #[test]
    fn lines_end_at_blanks() {
        assert_eq!(broken("one two three", 7), ["one two", "three"]);
        assert_eq!(broken("one two three", 3), ["one", "two", "three"]);
        assert_eq!(broken("one", 2), ["one"]);
        assert_eq!(broken("", 5), [""]);
        // Numbers are moved to the right by blanks before them.
        assert_eq!(broken("   12", 5), ["   12"]);
    }

    proptest! {
        #[test]
        fn no_word_is_lost(words in "[a-zα]{1,9}( [a-zα]{1,9}){0,9}", width in 1_usize..30) {
            let lines = broken(&words, width);
            prop_assert_eq!(lines.join(" "), words.as_str());
            prop_assert!(lines.iter().all(|line| line.width() <= width || !line.contains(' ')));
        }
    }
}
