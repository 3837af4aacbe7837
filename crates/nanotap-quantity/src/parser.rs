//! Reads a number with its unit.

use super::units::{Scale, find_unit, nearest_units};
use super::{Kind, Quantity, QuantityError, offer};

/// Largest power of a unit. With the next two limits it keeps hostile text from overflowing an exponent
/// or the stack.
const MAX_POWER: i32 = 9;
/// Largest depth of parentheses.
const MAX_DEPTH: usize = 4;
/// Largest number of factors of a unit, parentheses included.
const MAX_FACTORS: usize = 16;

pub(super) fn read(text: &str, expected: Option<Kind>) -> Result<Quantity, QuantityError> {
    let trimmed = text.trim().replace('\u{2212}', "-");
    let (mantissa, exponent, rest) =
        split_number(&trimmed).map_err(|reason| QuantityError::new(expected, &trimmed, reason))?;
    let scale = UnitParser::parse(rest, &trimmed, expected)?;
    let power = exponent.saturating_add(scale.decimal);
    let out_of_range =
        || QuantityError::new(expected, &trimmed, "too large or too small for a double");
    let value = format!("{mantissa}e{power}")
        .parse::<f64>()
        .map_err(|_| out_of_range())?
        * scale.factor;
    let is_zero = mantissa.chars().all(|c| matches!(c, '0' | '.' | '+' | '-'));
    if !value.is_finite() || (value == 0.0) != is_zero {
        return Err(out_of_range());
    }
    Ok(Quantity {
        value,
        dimension: scale.dimension,
    })
}

/// Mantissa, decimal exponent and what follows them.
fn split_number(text: &str) -> Result<(&str, i32, &str), &'static str> {
    if text.is_empty() {
        return Err("empty");
    }
    let bytes = text.as_bytes();
    let digits = |from: usize| {
        bytes[from..]
            .iter()
            .take_while(|b| b.is_ascii_digit())
            .count()
    };
    let mut end = usize::from(matches!(bytes[0], b'+' | b'-'));
    let whole = digits(end);
    end += whole;
    let mut fraction = 0;
    if bytes.get(end) == Some(&b'.') {
        fraction = digits(end + 1);
        end += 1 + fraction;
    }
    if whole + fraction == 0 {
        let word = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
        return Err(if word.starts_with("nan") || word.starts_with("inf") {
            "a finite number is needed"
        } else {
            "it does not begin with a number"
        });
    }
    let mantissa = &text[..end];
    let mut exponent = 0;
    // An `e` belongs to the number only if digits follow: "3 eV" and "3eV" are energies.
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let count = if end + 1 + sign <= bytes.len() {
            digits(end + 1 + sign)
        } else {
            0
        };
        if count > 0 {
            let stop = end + 1 + sign + count;
            let clamp = if bytes[end + 1] == b'-' {
                -99_999
            } else {
                99_999
            };
            exponent = text[end + 1..stop]
                .parse::<i32>()
                .unwrap_or(clamp)
                .clamp(-99_999, 99_999);
            end = stop;
        }
    }
    match bytes.get(end) {
        Some(b',') => Err("the decimal sign is a point, and digits are not grouped"),
        Some(b'_' | b'\'' | b'.') => Err("the digits are not those of one decimal number"),
        _ => Ok((mantissa, exponent, &text[end..])),
    }
}

#[derive(Debug, Clone, PartialEq)]
enum Token {
    Symbol(String),
    Integer(i32),
    Power,
    Times,
    Over,
    Open,
    Close,
}

/// Reads `N s/m`, `N·s·m^-1`, `kg/(m s^2)`, `kg m⁻³`: factors joined by a space, `·` or `*`,
/// a slash, powers. A product after a slash must be in parentheses.
struct UnitParser<'a> {
    tokens: Vec<Token>,
    at: usize,
    factors: usize,
    text: &'a str,
    expected: Option<Kind>,
}

impl<'a> UnitParser<'a> {
    fn parse(units: &str, text: &'a str, expected: Option<Kind>) -> Result<Scale, QuantityError> {
        let mut parser = Self {
            tokens: Vec::new(),
            at: 0,
            factors: 0,
            text,
            expected,
        };
        parser.tokens = parser.tokenize(units.trim())?;
        if parser.tokens.is_empty() {
            return Ok(Scale::ONE);
        }
        let scale = parser.product(0)?;
        if parser.at < parser.tokens.len() {
            return Err(parser.malformed("a parenthesis closes that was never opened"));
        }
        Ok(scale)
    }

    fn malformed(&self, reason: impl std::fmt::Display) -> QuantityError {
        QuantityError::new(self.expected, self.text, reason)
    }

    fn tokenize(&self, units: &str) -> Result<Vec<Token>, QuantityError> {
        let mut tokens = Vec::new();
        let mut chars = units.chars().peekable();
        // A number right behind a unit is its power: "kg/m3", "s-1".
        let mut glued = false;
        while let Some(&c) = chars.peek() {
            if is_symbol(c) {
                let mut symbol = String::new();
                while let Some(c) = chars.next_if(|&c| is_symbol(c)) {
                    symbol.push(c);
                }
                tokens.push(Token::Symbol(symbol));
                glued = true;
                continue;
            }
            if let Some(superscript) = superscript(c) {
                let mut digits = String::from(superscript);
                chars.next();
                while let Some(d) = chars.peek().copied().and_then(self::superscript) {
                    digits.push(d);
                    chars.next();
                }
                tokens.push(Token::Power);
                tokens.push(Token::Integer(self.integer(&digits)?));
                glued = false;
                continue;
            }
            chars.next();
            let follows_unit = std::mem::replace(&mut glued, c == ')');
            match c {
                c if c.is_whitespace() => {}
                '^' => tokens.push(Token::Power),
                '*' | '·' | '\u{22c5}' | '\u{d7}' => tokens.push(Token::Times),
                '/' => tokens.push(Token::Over),
                '(' => tokens.push(Token::Open),
                ')' => tokens.push(Token::Close),
                '-' | '+' | '0'..='9' => {
                    let mut digits = String::from(c);
                    while let Some(d) = chars.next_if(char::is_ascii_digit) {
                        digits.push(d);
                    }
                    if follows_unit {
                        tokens.push(Token::Power);
                    }
                    tokens.push(Token::Integer(self.integer(&digits)?));
                }
                other => {
                    return Err(
                        self.malformed(format!("unexpected character '{other}' in the unit"))
                    );
                }
            }
        }
        Ok(tokens)
    }

    fn integer(&self, digits: &str) -> Result<i32, QuantityError> {
        digits
            .parse::<i32>()
            .ok()
            .filter(|power| power.abs() <= MAX_POWER)
            .ok_or_else(|| {
                self.malformed(format!(
                    "the power {digits} of a unit is not an integer from -{MAX_POWER} to {MAX_POWER}"
                ))
            })
    }

    fn product(&mut self, depth: usize) -> Result<Scale, QuantityError> {
        if depth > MAX_DEPTH {
            return Err(self.malformed("parentheses nested too deeply"));
        }
        let mut scale = Scale::ONE;
        let mut power = 1;
        let mut divided = false;
        // "1/s" and "/s": a reciprocal.
        if self.tokens.get(self.at) == Some(&Token::Integer(1))
            && self.tokens.get(self.at + 1) == Some(&Token::Over)
        {
            self.at += 1;
        }
        let mut first = self.tokens.get(self.at) != Some(&Token::Over);
        loop {
            if !first {
                match self.tokens.get(self.at) {
                    None | Some(Token::Close) => return Ok(scale),
                    Some(Token::Over) => {
                        self.at += 1;
                        power = -1;
                        divided = true;
                    }
                    Some(Token::Times) => {
                        self.at += 1;
                        power = self.product_power(divided)?;
                    }
                    Some(_) => power = self.product_power(divided)?,
                }
            }
            first = false;
            let factor = self.factor(depth)?;
            scale = scale.times(factor, power);
        }
    }

    fn product_power(&self, divided: bool) -> Result<i32, QuantityError> {
        if divided {
            return Err(self.malformed(
                "a product after a slash can be read two ways: write \"J/(m s)\" or \"J s/m\"",
            ));
        }
        Ok(1)
    }

    fn factor(&mut self, depth: usize) -> Result<Scale, QuantityError> {
        self.factors += 1;
        if self.factors > MAX_FACTORS {
            return Err(self.malformed("too many units"));
        }
        let base = match self.tokens.get(self.at).cloned() {
            Some(Token::Symbol(symbol)) => {
                self.at += 1;
                self.lookup(&symbol)?
            }
            Some(Token::Open) => {
                self.at += 1;
                let inner = self.product(depth + 1)?;
                if self.tokens.get(self.at) != Some(&Token::Close) {
                    return Err(self.malformed("a parenthesis is not closed"));
                }
                self.at += 1;
                inner
            }
            Some(Token::Integer(_)) => {
                return Err(self.malformed("a second number where a unit was expected"));
            }
            _ => return Err(self.malformed("a unit is missing")),
        };
        if self.tokens.get(self.at) != Some(&Token::Power) {
            return Ok(base);
        }
        self.at += 1;
        let Some(&Token::Integer(power)) = self.tokens.get(self.at) else {
            return Err(self.malformed("a power is missing after '^'"));
        };
        self.at += 1;
        Ok(Scale::ONE.times(base, power))
    }

    fn lookup(&self, symbol: &str) -> Result<Scale, QuantityError> {
        find_unit(symbol).ok_or_else(|| {
            let nearest = nearest_units(symbol, self.expected);
            let offer = offer(&nearest);
            QuantityError {
                nearest,
                ..self.malformed(format_args!("unknown unit \"{symbol}\"{offer}"))
            }
        })
    }
}

fn is_symbol(c: char) -> bool {
    c.is_alphabetic() || matches!(c, '%' | '°' | '\u{b5}')
}

fn superscript(c: char) -> Option<char> {
    "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"
        .chars()
        .zip("0123456789-".chars())
        .find_map(|(raised, plain)| (raised == c).then_some(plain))
}
