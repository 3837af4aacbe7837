//! Writes a number with an engineering prefix.

use super::units::PREFIXES;

/// `value` (SI) in `unit`, which is 10^`shift` of SI, with digits moved as text so that no
/// rounding enters.
pub(super) fn engineering(
    value: f64,
    digits: Option<usize>,
    unit: &str,
    shift: i32,
    prefixed: bool,
) -> String {
    let join = |number: &str, prefix: &str| {
        if unit.is_empty() {
            number.to_owned()
        } else {
            format!("{number} {prefix}{unit}")
        }
    };
    if value == 0.0 || !value.is_finite() {
        return join(&format!("{value}"), "");
    }
    let scientific = digits.map_or_else(
        || format!("{value:e}"),
        |digits| format!("{value:.*e}", digits - 1),
    );
    let Some((mantissa, exponent)) = scientific.split_once('e') else {
        return join(&scientific, "");
    };
    let exponent: i32 = exponent.parse().unwrap_or(0) - shift;
    let (sign, mantissa) = match mantissa.strip_prefix('-') {
        Some(rest) => ("-", rest),
        None => ("", mantissa),
    };
    let figures: String = mantissa.chars().filter(char::is_ascii_digit).collect();
    let figures = figures.trim_end_matches('0');
    let step = exponent.div_euclid(3) * 3;
    let prefix = prefix_of(step);
    let (number, prefix) = match (prefixed, prefix) {
        (true, Some(prefix)) => (place_point(figures, exponent - step), prefix),
        // Plain decimals while they are short, powers of ten beyond.
        _ if (-4..6).contains(&exponent) => (place_point(figures, exponent), String::new()),
        _ => (
            format!("{}e{exponent}", place_point(figures, 0)),
            String::new(),
        ),
    };
    join(&format!("{sign}{number}"), &prefix)
}

/// Returns the SI prefix of a power of ten, empty for 0; `None` if there is none.
pub fn prefix_of(power: i32) -> Option<String> {
    if power == 0 {
        return Some(String::new());
    }
    let is = |(letter, other): &&(char, i32)| *other == power && !matches!(letter, 'u' | '\u{3bc}');
    PREFIXES
        .iter()
        .find(is)
        .map(|(letter, _)| letter.to_string())
}

/// The decimal d.ddd × 10^`exponent` written out, from its figures.
fn place_point(figures: &str, exponent: i32) -> String {
    if exponent < 0 {
        return format!("0.{}{figures}", "0".repeat((-exponent - 1) as usize));
    }
    let whole = exponent as usize + 1;
    if figures.len() <= whole {
        return format!("{figures}{}", "0".repeat(whole - figures.len()));
    }
    format!("{}.{}", &figures[..whole], &figures[whole..])
}
