//! The words and signs of a formula.

use std::ops::Range;

use crate::error::FormulaError;

/// A word or sign.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Token {
    Number(f64),
    Name(String),
    Sign(&'static str),
    End,
}

/// Signs, the longer ones first.
const SIGNS: [&str; 18] = [
    "'", "**", "<=", ">=", "+", "-", "−", "*", "·", "/", "^", "(", ")", ",", ";", "<", ">", "=",
];

/// Parts a text into tokens, each with its place.
pub(crate) fn tokens(text: &str) -> Result<Vec<(Token, Range<usize>)>, FormulaError> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        let (token, length) = if first.is_whitespace() {
            at += first.len_utf8();
            continue;
        } else if first.is_ascii_digit() || first == '.' {
            let length = number_length(rest);
            let number = rest[..length].parse().ok().filter(|x: &f64| x.is_finite());
            let number = number.ok_or_else(|| {
                FormulaError::new(text, at..at + length, "a finite number is needed")
            })?;
            (Token::Number(number), length)
        } else if first.is_alphabetic() || first == '_' {
            let part = |c: char| c.is_alphanumeric() || c == '_';
            let length = rest.find(|c| !part(c)).unwrap_or(rest.len());
            (Token::Name(rest[..length].to_owned()), length)
        } else if let Some(sign) = SIGNS.into_iter().find(|sign| rest.starts_with(sign)) {
            let meaning = match sign {
                "**" => "^",
                "−" => "-",
                "·" => "*",
                other => other,
            };
            (Token::Sign(meaning), sign.len())
        } else {
            return Err(FormulaError::new(
                text,
                at..at + first.len_utf8(),
                "a formula has no such sign",
            ));
        };
        found.push((token, at..at + length));
        at += length;
    }
    found.push((Token::End, text.len()..text.len()));
    Ok(found)
}

/// Bytes of the number with which a text begins.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| {
        bytes[from..]
            .iter()
            .take_while(|b| b.is_ascii_digit())
            .count()
    };
    let mut end = digits(0);
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let from = end + 1 + sign;
        if from <= bytes.len() && digits(from) > 0 {
            end = from + digits(from);
        }
    }
    end.max(1)
}
