//! Conversion of LaTeX formulas to MathML.

use std::fmt::Write as _;

use pulldown_latex::config::{DisplayMode, RenderConfig};
use pulldown_latex::{Parser, Storage, push_mathml};

/// The MathML of a formula, on one line, so that Markdown leaves it unchanged.
///
/// # Errors
/// A description of what cannot be parsed.
pub(crate) fn typeset(formula: &str, displayed: bool) -> Result<String, String> {
    if bare_fraction(formula) {
        return Err("`12` would be one number: write the fraction's parts in braces".into());
    }
    let storage = Storage::new();
    let events: Vec<_> = Parser::new(formula, &storage).collect();
    if let Some(error) = events.iter().find_map(|event| event.as_ref().err()) {
        return Err(error.to_string());
    }
    let config = RenderConfig {
        display_mode: if displayed {
            DisplayMode::Block
        } else {
            DisplayMode::Inline
        },
        ..RenderConfig::default()
    };
    let mut mathml = String::new();
    push_mathml(&mut mathml, events.into_iter(), config).map_err(|error| error.to_string())?;
    Ok(plain_to_markdown(&mathml))
}

/// Whether a fraction's numerator is a digit without braces, which the parser would join with the
/// digits after it.
fn bare_fraction(formula: &str) -> bool {
    let mut parts = formula.split("frac");
    parts.next();
    parts.any(|part| part.starts_with(|sign: char| sign.is_ascii_digit()))
}

/// Replaces every character with a meaning in Markdown by its character reference.
fn plain_to_markdown(html: &str) -> String {
    let mut text = String::with_capacity(html.len());
    for sign in html.chars() {
        match sign {
            '*' | '_' | '[' | ']' | '\\' | '`' | '~' | '|' | '$' => {
                let _ = write!(text, "&#{};", sign as u32);
            }
            '\n' => text.push(' '),
            _ => text.push(sign),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::typeset;

    #[test]
    fn a_formula_is_one_line_that_markdown_leaves_alone() {
        let mathml = typeset(
            r"\frac{a_1 * b}{c} = \begin{pmatrix} 0 \\ 1 \end{pmatrix}",
            true,
        );
        let mathml = mathml.unwrap();
        assert!(mathml.starts_with("<math display=\"block\""), "{mathml}");
        assert!(
            mathml.contains("<mfrac>") && mathml.contains("<mtable"),
            "{mathml}"
        );
        assert!(!mathml.contains(['*', '_', '\n', '\\']), "{mathml}");
    }

    #[test]
    fn what_is_no_formula_is_refused() {
        assert!(typeset(r"\frac{a", false).is_err());
        assert!(typeset(r"\nosuchcommand", false).is_err());
        assert!(typeset(r"\frac12 a", false).is_err());
    }
}
