//! Restrained colour. The styles are always written; the stream that prints them
//! (`anstream`) takes them out where there is no terminal or `NO_COLOR` is set.

use anstyle::{AnsiColor, Style};

fn styled(style: Style, text: &str) -> String {
    format!("{style}{text}{style:#}")
}

/// A heading.
pub(crate) fn bold(text: &str) -> String {
    styled(Style::new().bold(), text)
}

/// What is there when it is looked for.
pub(crate) fn faint(text: &str) -> String {
    styled(Style::new().dimmed(), text)
}

/// A note line.
pub(crate) fn note(text: &str) -> String {
    format!(
        "{} {text}",
        styled(AnsiColor::Cyan.on_default().bold(), "note:")
    )
}

/// A warning line.
pub(crate) fn warning(text: &str) -> String {
    format!(
        "{} {text}",
        styled(AnsiColor::Yellow.on_default().bold(), "warning:")
    )
}

/// An error line.
pub(crate) fn error(text: &str) -> String {
    format!(
        "{} {text}",
        styled(AnsiColor::Red.on_default().bold(), "error:")
    )
}

/// What would be right.
pub(crate) fn help(text: &str) -> String {
    format!(
        "{} {text}",
        styled(AnsiColor::Cyan.on_default().bold(), "help:")
    )
}
