//! Terminal styles. They are always written; the stream that prints them (`anstream`) removes them
//! if there is no terminal or `NO_COLOR` is set.

use anstyle::{AnsiColor, Style};

fn styled(style: Style, text: &str) -> String {
    format!("{style}{text}{style:#}")
}

/// Formats a heading in bold.
pub(crate) fn bold(text: &str) -> String {
    styled(Style::new().bold(), text)
}

/// Formats secondary text, dimmed.
pub(crate) fn faint(text: &str) -> String {
    styled(Style::new().dimmed(), text)
}

/// Formats a note, with the prefix "note:".
pub(crate) fn note(text: &str) -> String {
    format!(
        "{} {text}",
        styled(AnsiColor::Cyan.on_default().bold(), "note:")
    )
}

/// Formats a warning, with the prefix "warning:".
pub(crate) fn warning(text: &str) -> String {
    format!(
        "{} {text}",
        styled(AnsiColor::Yellow.on_default().bold(), "warning:")
    )
}

/// Formats an error, with the prefix "error:".
pub(crate) fn error(text: &str) -> String {
    format!(
        "{} {text}",
        styled(AnsiColor::Red.on_default().bold(), "error:")
    )
}

/// Formats advice on an error, with the prefix "help:".
pub(crate) fn help(text: &str) -> String {
    format!(
        "{} {text}",
        styled(AnsiColor::Cyan.on_default().bold(), "help:")
    )
}

/// Replaces control characters of `text`, which may come from file names and data, but keeps line
/// breaks, tabs and the colours of this module.
pub(crate) fn safe(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(|c: char| c.is_control() && c != '\n' && c != '\t') {
        let (before, found) = rest.split_at(at);
        safe.push_str(before);
        let colour = found.strip_prefix("\u{1b}[").and_then(|code| {
            let end = code.find(|c: char| !c.is_ascii_digit() && c != ';')?;
            code[end..].starts_with('m').then_some(end + 3)
        });
        let length = colour.unwrap_or_else(|| found.chars().next().map_or(0, char::len_utf8));
        safe.push_str(if colour.is_some() {
            &found[..length]
        } else {
            "\u{fffd}"
        });
        rest = &found[length..];
    }
    safe + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_replaced_and_colours_kept() {
        assert_eq!(safe("a\tb\n°"), "a\tb\n°");
        assert_eq!(safe(&error("x")), error("x"));
        assert_eq!(
            safe("\u{1b}[2Jevil\u{7}\u{9b}5m"),
            "\u{fffd}[2Jevil\u{fffd}\u{fffd}5m"
        );
        assert_eq!(safe("\u{1b}"), "\u{fffd}");
        assert_eq!(safe("\u{1b}[1;31"), "\u{fffd}[1;31");
    }
}
