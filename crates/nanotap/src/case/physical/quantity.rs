//! Numbers with units as people type them: `"2.8 N/m"`, `"75 kHz"`, `"30 µm"`, `"1e-3 N s/m"`.
//!
//! A value is read into SI under a dimension check and written back with an engineering
//! prefix. Decimal prefixes are folded into the number's own exponent before it is converted
//! to binary, so `"30 um"` is exactly the `f64` nearest to 3e-5, and
//! [`Kind::format_exact`] followed by [`Kind::parse`] gives back the same bits.
//!
//! The general unit crates were tried first. `uom`'s `FromStr` knows neither `um` nor
//! compound units such as `N s/m`; `fend-core` ignores case, so it takes `5 pn` for five
//! peta-newtons, and works out `3 N/m m` as 3 N. Wrong by thirty orders without a word is
//! worse than a short parser that refuses: hence this one.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use crate::case::near_name::near_names;

/// Elementary charge in coulomb, hence joules in one electronvolt; exact in the SI of 2019.
pub const JOULES_PER_ELECTRONVOLT: f64 = 1.602_176_634e-19;

/// Exponents of the base units kilogram, metre, second and radian.
///
/// The radian counts as a unit of its own here, so that an angular frequency in rad/s cannot
/// be taken for a frequency in Hz, a factor 2π apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dimension {
    /// Exponent of the kilogram.
    pub mass: i32,
    /// Exponent of the metre.
    pub length: i32,
    /// Exponent of the second.
    pub time: i32,
    /// Exponent of the radian.
    pub angle: i32,
}

impl Dimension {
    const NONE: Self = Self::new(0, 0, 0, 0);

    const fn new(mass: i32, length: i32, time: i32, angle: i32) -> Self {
        Self {
            mass,
            length,
            time,
            angle,
        }
    }

    fn times(self, other: Self, power: i32) -> Self {
        Self {
            mass: self.mass + power * other.mass,
            length: self.length + power * other.length,
            time: self.time + power * other.time,
            angle: self.angle + power * other.angle,
        }
    }

    /// The kind of quantity that has this dimension, if it is one of [`Kind::ALL`].
    pub fn kind(self) -> Option<Kind> {
        Kind::ALL.into_iter().find(|kind| kind.dimension() == self)
    }
}

impl fmt::Display for Dimension {
    /// Words where there are some ("a frequency"), base units otherwise ("m^2 s^-1").
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(kind) = self.kind() {
            return f.write_str(kind.noun());
        }
        let exponents = [
            ("kg", self.mass),
            ("m", self.length),
            ("s", self.time),
            ("rad", self.angle),
        ];
        let mut separator = "";
        for (unit, exponent) in exponents.into_iter().filter(|&(_, e)| e != 0) {
            write!(f, "{separator}{unit}")?;
            if exponent != 1 {
                write!(f, "^{exponent}")?;
            }
            separator = " ";
        }
        Ok(())
    }
}

/// What a quantity measures: fixes its dimension, its words in messages and its display unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A plain number: quality factor, Poisson's ratio, setpoint ratio. Percent allowed.
    Number,
    /// Metre.
    Length,
    /// Kilogram.
    Mass,
    /// Second.
    Time,
    /// Kilogram per cubic metre.
    Density,
    /// Hertz: cycles, not radians, per second.
    Frequency,
    /// Radian per second.
    AngularFrequency,
    /// Newton.
    Force,
    /// Newton per metre.
    Stiffness,
    /// Pascal.
    Pressure,
    /// Newton second per metre.
    Damping,
    /// Joule.
    Energy,
    /// Watt.
    Power,
    /// Metre per second.
    Velocity,
    /// Radian; shown in degrees.
    Angle,
}

impl Kind {
    /// Every kind, in the order in which a dimension is named.
    pub const ALL: [Self; 15] = [
        Self::Number,
        Self::Length,
        Self::Mass,
        Self::Time,
        Self::Density,
        Self::Frequency,
        Self::AngularFrequency,
        Self::Force,
        Self::Stiffness,
        Self::Pressure,
        Self::Damping,
        Self::Energy,
        Self::Power,
        Self::Velocity,
        Self::Angle,
    ];

    /// Its exponents of kg, m, s and rad.
    pub const fn dimension(self) -> Dimension {
        match self {
            Self::Number => Dimension::NONE,
            Self::Length => Dimension::new(0, 1, 0, 0),
            Self::Mass => Dimension::new(1, 0, 0, 0),
            Self::Time => Dimension::new(0, 0, 1, 0),
            Self::Density => Dimension::new(1, -3, 0, 0),
            Self::Frequency => Dimension::new(0, 0, -1, 0),
            Self::AngularFrequency => Dimension::new(0, 0, -1, 1),
            Self::Force => Dimension::new(1, 1, -2, 0),
            Self::Stiffness => Dimension::new(1, 0, -2, 0),
            Self::Pressure => Dimension::new(1, -1, -2, 0),
            Self::Damping => Dimension::new(1, 0, -1, 0),
            Self::Energy => Dimension::new(1, 2, -2, 0),
            Self::Power => Dimension::new(1, 2, -3, 0),
            Self::Velocity => Dimension::new(0, 1, -1, 0),
            Self::Angle => Dimension::new(0, 0, 0, 1),
        }
    }

    /// With its article, for messages: "a force per length".
    pub const fn noun(self) -> &'static str {
        match self {
            Self::Number => "a number without a unit",
            Self::Length => "a length",
            Self::Mass => "a mass",
            Self::Time => "a time",
            Self::Density => "a mass per volume",
            Self::Frequency => "a frequency",
            Self::AngularFrequency => "an angular frequency",
            Self::Force => "a force",
            Self::Stiffness => "a force per length",
            Self::Pressure => "a pressure",
            Self::Damping => "a force per velocity",
            Self::Energy => "an energy",
            Self::Power => "a power",
            Self::Velocity => "a velocity",
            Self::Angle => "an angle",
        }
    }

    /// A text that would be right, for messages.
    pub const fn example(self) -> &'static str {
        match self {
            Self::Number => "200",
            Self::Length => "30 um",
            Self::Mass => "3 ng",
            Self::Time => "12 us",
            Self::Density => "2330 kg/m^3",
            Self::Frequency => "75 kHz",
            Self::AngularFrequency => "4.7e5 rad/s",
            Self::Force => "4.2 nN",
            Self::Stiffness => "2.8 N/m",
            Self::Pressure => "4 GPa",
            Self::Damping => "1e-6 N s/m",
            Self::Energy => "12 eV",
            Self::Power => "1 pW",
            Self::Velocity => "2 mm/s",
            Self::Angle => "25 deg",
        }
    }

    /// SI unit in which [`Kind::parse`] answers.
    pub const fn si_unit(self) -> &'static str {
        match self {
            Self::Number => "1",
            Self::Mass => "kg",
            Self::Angle => "rad",
            other => other.display_unit().0,
        }
    }

    /// Unit shown, power of ten that it is away from SI, and whether it takes a prefix.
    const fn display_unit(self) -> (&'static str, i32, bool) {
        match self {
            Self::Number => ("", 0, false),
            Self::Length => ("m", 0, true),
            Self::Mass => ("g", -3, true),
            Self::Time => ("s", 0, true),
            Self::Density => ("kg/m^3", 0, false),
            Self::Frequency => ("Hz", 0, true),
            Self::AngularFrequency => ("rad/s", 0, false),
            Self::Force => ("N", 0, true),
            Self::Stiffness => ("N/m", 0, true),
            Self::Pressure => ("Pa", 0, true),
            Self::Damping => ("N s/m", 0, true),
            Self::Energy => ("J", 0, true),
            Self::Power => ("W", 0, true),
            Self::Velocity => ("m/s", 0, true),
            Self::Angle => ("rad", 0, false),
        }
    }

    /// Reads a quantity of this kind, in SI. A bare `0` needs no unit.
    ///
    /// # Errors
    /// [`QuantityError`] if the text is no number with a known unit, or has another dimension;
    /// the message says what was expected, with an example.
    pub fn parse(self, text: &str) -> Result<f64, QuantityError> {
        let quantity = read(text, Some(self))?;
        if quantity.dimension == self.dimension() {
            return Ok(quantity.value);
        }
        if quantity.value == 0.0 && quantity.dimension == Dimension::NONE {
            return Ok(0.0);
        }
        Err(QuantityError::WrongDimension {
            expected: self,
            text: text.trim().to_owned(),
            got: quantity.dimension,
        })
    }

    /// Writes a value given in SI with four significant digits and an engineering prefix:
    /// 65697 as a frequency is "65.7 kHz", an angle is shown in degrees.
    pub fn format(self, value: f64) -> String {
        self.format_digits(value, 4)
    }

    /// As [`Kind::format`] with so many significant digits (at least one, at most 17);
    /// trailing zeros are left out.
    pub fn format_digits(self, value: f64, digits: usize) -> String {
        let digits = digits.clamp(1, 17);
        if self == Self::Angle {
            return engineering(value.to_degrees(), Some(digits), "deg", 0, false);
        }
        let (unit, shift, prefixed) = self.display_unit();
        engineering(value, Some(digits), unit, shift, prefixed)
    }

    /// Writes a value given in SI with as many digits as [`Kind::parse`] needs to give back
    /// the same `f64`.
    pub fn format_exact(self, value: f64) -> String {
        let (unit, shift, prefixed) = self.display_unit();
        engineering(value, None, unit, shift, prefixed)
    }
}

/// Writes an energy in joules as electronvolts with four significant digits: "12.3 eV".
pub fn format_electronvolts(joules: f64) -> String {
    engineering(joules / JOULES_PER_ELECTRONVOLT, Some(4), "eV", 0, true)
}

/// A value in SI (kg, m, s, rad) with its dimension, as read from text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Value in SI.
    pub value: f64,
    /// Its dimension.
    pub dimension: Dimension,
}

impl FromStr for Quantity {
    type Err = QuantityError;

    fn from_str(text: &str) -> Result<Self, QuantityError> {
        read(text, None)
    }
}

/// Why a text is not the quantity that was asked for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum QuantityError {
    /// The text does not begin with a finite decimal number.
    #[error("{}got \"{text}\": {reason}", wanted(*expected))]
    NotANumber {
        /// What was asked for, if known.
        expected: Option<Kind>,
        /// The text.
        text: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The unit is not one of those known here.
    #[error("{}got \"{text}\": unknown unit \"{unit}\"{}", wanted(*expected), offer(nearest))]
    UnknownUnit {
        /// What was asked for, if known.
        expected: Option<Kind>,
        /// The text.
        text: String,
        /// The part of it that is no unit.
        unit: String,
        /// Known units that look like it, nearest first.
        nearest: Vec<String>,
    },
    /// The units are put together in a way that has no single meaning.
    #[error("{}got \"{text}\": {reason}", wanted(*expected))]
    Malformed {
        /// What was asked for, if known.
        expected: Option<Kind>,
        /// The text.
        text: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A quantity, but of another kind.
    #[error("expected {} such as \"{}\", got \"{text}\" ({got})", expected.noun(), expected.example())]
    WrongDimension {
        /// What was asked for.
        expected: Kind,
        /// The text.
        text: String,
        /// What it is.
        got: Dimension,
    },
    /// Too large or too small for a double.
    #[error("{}got \"{text}\": too large or too small for a double", wanted(*expected))]
    OutOfRange {
        /// What was asked for, if known.
        expected: Option<Kind>,
        /// The text.
        text: String,
    },
}

fn wanted(expected: Option<Kind>) -> String {
    expected.map_or_else(String::new, |kind| {
        format!("expected {} such as \"{}\", ", kind.noun(), kind.example())
    })
}

fn offer(nearest: &[String]) -> String {
    if nearest.is_empty() {
        return String::new();
    }
    let names: Vec<String> = nearest.iter().map(|name| format!("\"{name}\"")).collect();
    format!("; did you mean {}?", names.join(" or "))
}

/// Symbol, power of ten and further factor to SI, dimension, whether prefixes go with it.
struct Unit {
    symbol: &'static str,
    decimal: i32,
    factor: f64,
    dimension: Dimension,
    prefixed: bool,
}

const fn unit(
    symbol: &'static str,
    decimal: i32,
    factor: f64,
    dimension: Dimension,
    prefixed: bool,
) -> Unit {
    Unit {
        symbol,
        decimal,
        factor,
        dimension,
        prefixed,
    }
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

const UNITS: &[Unit] = &[
    unit("m", 0, 1.0, Kind::Length.dimension(), true),
    unit("g", -3, 1.0, Kind::Mass.dimension(), true),
    unit("s", 0, 1.0, Kind::Time.dimension(), true),
    unit("Hz", 0, 1.0, Kind::Frequency.dimension(), true),
    unit("N", 0, 1.0, Kind::Force.dimension(), true),
    unit("Pa", 0, 1.0, Kind::Pressure.dimension(), true),
    unit("J", 0, 1.0, Kind::Energy.dimension(), true),
    unit("W", 0, 1.0, Kind::Power.dimension(), true),
    unit(
        "eV",
        0,
        JOULES_PER_ELECTRONVOLT,
        Kind::Energy.dimension(),
        true,
    ),
    unit("rad", 0, 1.0, Kind::Angle.dimension(), true),
    unit("deg", 0, DEGREE, Kind::Angle.dimension(), false),
    unit("°", 0, DEGREE, Kind::Angle.dimension(), false),
    // U+00C5 (letter) and U+212B (sign).
    unit("Å", -10, 1.0, Kind::Length.dimension(), false),
    unit("\u{212b}", -10, 1.0, Kind::Length.dimension(), false),
    unit("angstrom", -10, 1.0, Kind::Length.dimension(), false),
    unit("micron", -6, 1.0, Kind::Length.dimension(), false),
    unit("min", 0, 60.0, Kind::Time.dimension(), false),
    unit("%", -2, 1.0, Dimension::NONE, false),
];

/// Prefixes and their powers of ten. Micro is `u`, the micro sign or the Greek letter.
const PREFIXES: &[(char, i32)] = &[
    ('y', -24),
    ('z', -21),
    ('a', -18),
    ('f', -15),
    ('p', -12),
    ('n', -9),
    ('u', -6),
    ('\u{b5}', -6),
    ('\u{3bc}', -6),
    ('m', -3),
    ('c', -2),
    ('d', -1),
    ('h', 2),
    ('k', 3),
    ('M', 6),
    ('G', 9),
    ('T', 12),
    ('P', 15),
];

/// Units that a product may be written of are few and powers small: bounds keep hostile text
/// from overflowing an exponent or the stack.
const MAX_POWER: i32 = 9;
const MAX_DEPTH: usize = 4;
const MAX_FACTORS: usize = 16;

fn read(text: &str, expected: Option<Kind>) -> Result<Quantity, QuantityError> {
    let trimmed = text.trim().replace('\u{2212}', "-");
    let (mantissa, exponent, rest) =
        split_number(&trimmed).map_err(|reason| QuantityError::NotANumber {
            expected,
            text: trimmed.clone(),
            reason,
        })?;
    let scale = UnitParser::parse(rest, &trimmed, expected)?;
    let power = exponent.saturating_add(scale.decimal);
    let out_of_range = || QuantityError::OutOfRange {
        expected,
        text: trimmed.clone(),
    };
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

/// Product of powers of units: decimal exponent, further factor, dimension.
#[derive(Clone, Copy)]
struct Scale {
    decimal: i32,
    factor: f64,
    dimension: Dimension,
}

impl Scale {
    const ONE: Self = Self {
        decimal: 0,
        factor: 1.0,
        dimension: Dimension::NONE,
    };

    fn times(self, other: Self, power: i32) -> Self {
        Self {
            decimal: self.decimal + power * other.decimal,
            factor: self.factor * other.factor.powi(power),
            dimension: self.dimension.times(other.dimension, power),
        }
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
/// a slash, powers. A product after a slash must stand in parentheses.
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

    fn malformed(&self, reason: impl Into<String>) -> QuantityError {
        QuantityError::Malformed {
            expected: self.expected,
            text: self.text.to_owned(),
            reason: reason.into(),
        }
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
                return Err(self.malformed("a second number stands where a unit was expected"));
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
        find_unit(symbol).ok_or_else(|| QuantityError::UnknownUnit {
            expected: self.expected,
            text: self.text.to_owned(),
            unit: symbol.to_owned(),
            nearest: nearest_units(symbol, self.expected),
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

fn find_unit(symbol: &str) -> Option<Scale> {
    let scale = |unit: &Unit, prefix: i32| Scale {
        decimal: unit.decimal + prefix,
        factor: unit.factor,
        dimension: unit.dimension,
    };
    if let Some(unit) = UNITS.iter().find(|unit| unit.symbol == symbol) {
        return Some(scale(unit, 0));
    }
    let mut chars = symbol.chars();
    let first = chars.next()?;
    let &(_, power) = PREFIXES.iter().find(|(prefix, _)| *prefix == first)?;
    UNITS
        .iter()
        .find(|unit| unit.prefixed && unit.symbol == chars.as_str())
        .map(|unit| scale(unit, power))
}

/// Known units that look like `symbol`; those that differ only in case come alone, and those
/// that would be of the expected kind before others.
fn nearest_units(symbol: &str, expected: Option<Kind>) -> Vec<String> {
    let names: Vec<String> = UNITS
        .iter()
        .flat_map(|unit| {
            let prefixed = PREFIXES
                .iter()
                .filter(|(prefix, _)| unit.prefixed && prefix.is_ascii())
                .map(|(prefix, _)| format!("{prefix}{}", unit.symbol));
            std::iter::once(unit.symbol.to_owned()).chain(prefixed)
        })
        .collect();
    let same: Vec<String> = names
        .iter()
        .filter(|name| name.eq_ignore_ascii_case(symbol))
        .cloned()
        .collect();
    if !same.is_empty() {
        return same;
    }
    let fitting = |name: &&String| {
        expected.is_some_and(|kind| {
            find_unit(name).is_some_and(|scale| scale.dimension == kind.dimension())
        })
    };
    let mut found = near_names(symbol, names.iter().filter(fitting).map(String::as_str));
    if found.is_empty() {
        found = near_names(symbol, names.iter().map(String::as_str));
    }
    found.truncate(2);
    found.into_iter().map(str::to_owned).collect()
}

/// `value` (SI) in `unit`, which is 10^`shift` of SI, with digits moved as text so that no
/// rounding enters.
fn engineering(
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
    let prefix = PREFIXES
        .iter()
        .find(|(letter, power)| *power == step && *letter != 'u' && *letter != '\u{3bc}')
        .map(|(letter, _)| letter.to_string());
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn reads_what_stands_on_boxes_and_labels() {
        // Right-hand sides are the nearest doubles to the decimal value: compared bit by bit.
        let cases = [
            ("2.8 N/m", Kind::Stiffness, 2.8),
            ("2.8N/m", Kind::Stiffness, 2.8),
            ("2.8 nN/nm", Kind::Stiffness, 2.8),
            ("75 kHz", Kind::Frequency, 75e3),
            ("75e3 s^-1", Kind::Frequency, 75e3),
            ("75e3 1/s", Kind::Frequency, 75e3),
            ("75e3 /s", Kind::Frequency, 75e3),
            ("30 um", Kind::Length, 30e-6),
            ("30 \u{b5}m", Kind::Length, 30e-6),
            ("30 \u{3bc}m", Kind::Length, 30e-6),
            ("30 micron", Kind::Length, 30e-6),
            ("3.35 Å", Kind::Length, 3.35e-10),
            ("4 GPa", Kind::Pressure, 4e9),
            ("4 nN/nm^2", Kind::Pressure, 4e9),
            ("4 mPa", Kind::Pressure, 4e-3),
            ("4 MPa", Kind::Pressure, 4e6),
            ("8 nm", Kind::Length, 8e-9),
            ("\u{2212}8 nm", Kind::Length, -8e-9),
            ("3 ng", Kind::Mass, 3e-12),
            ("1e-3 N s/m", Kind::Damping, 1e-3),
            ("1e-3 N·s·m^-1", Kind::Damping, 1e-3),
            ("1e-3 kg/s", Kind::Damping, 1e-3),
            ("1e-3 N/(m/s)", Kind::Damping, 1e-3),
            ("2330 kg/m^3", Kind::Density, 2330.0),
            ("2330 kg/m³", Kind::Density, 2330.0),
            ("2330 kg m⁻³", Kind::Density, 2330.0),
            ("2330 kg/m3", Kind::Density, 2330.0),
            ("2330 kg m-3", Kind::Density, 2330.0),
            ("2.33 g/cm^3", Kind::Density, 2330.0),
            ("200", Kind::Number, 200.0),
            (" .5 ", Kind::Number, 0.5),
            ("80 %", Kind::Number, 0.8),
            ("3 eV", Kind::Energy, 3.0 * JOULES_PER_ELECTRONVOLT),
            ("3eV", Kind::Energy, 3.0 * JOULES_PER_ELECTRONVOLT),
            ("180 deg", Kind::Angle, 180.0 * DEGREE),
            ("0", Kind::Length, 0.0),
            ("0 nm", Kind::Length, 0.0),
        ];
        for (text, kind, expected) in cases {
            assert_eq!(kind.parse(text), Ok(expected), "{text}");
        }
    }

    #[test]
    fn says_what_was_expected_and_what_was_given() {
        let message = |kind: Kind, text: &str| kind.parse(text).unwrap_err().to_string();
        assert_eq!(
            message(Kind::Stiffness, "75 kHz"),
            "expected a force per length such as \"2.8 N/m\", got \"75 kHz\" (a frequency)"
        );
        assert_eq!(
            message(Kind::Length, "30"),
            "expected a length such as \"30 um\", got \"30\" (a number without a unit)"
        );
        assert_eq!(
            message(Kind::Frequency, "4.7e5 rad/s"),
            "expected a frequency such as \"75 kHz\", got \"4.7e5 rad/s\" (an angular frequency)"
        );
        assert_eq!(
            message(Kind::Number, "3 m^2"),
            "expected a number without a unit such as \"200\", got \"3 m^2\" (m^2)"
        );
    }

    #[test]
    fn offers_the_nearest_unit_and_never_guesses_a_prefix() {
        let nearest = |kind: Kind, text: &str| match kind.parse(text) {
            Err(QuantityError::UnknownUnit { nearest, .. }) => nearest,
            other => panic!("{text}: {other:?}"),
        };
        assert_eq!(nearest(Kind::Frequency, "75 Khz"), ["kHz"]);
        assert_eq!(nearest(Kind::Pressure, "4 gpa"), ["GPa"]);
        // Nine orders apart: both are offered.
        assert_eq!(nearest(Kind::Pressure, "4 mpa"), ["mPa", "MPa"]);
        assert_eq!(nearest(Kind::Force, "5 pn"), ["pN", "PN"]);
        assert!(nearest(Kind::Length, "3 nmm").contains(&"nm".to_owned()));
        assert!(nearest(Kind::Mass, "3 parsec").is_empty());
    }

    #[test]
    fn refuses_what_has_no_single_meaning() {
        for text in [
            "",
            " ",
            "nm",
            "NaN",
            "inf m",
            "-inf",
            "1,5 nm",
            "1_000 nm",
            "1.2.3 nm",
            "3 J/m s",
            "3 m^",
            "3 m^^2",
            "3 m^10",
            "3 m^99999999999",
            "3 (m",
            "3 m)",
            "3 ()",
            "3 m/",
            "3 /",
            "3 m 4",
            "3 4 m",
            "3 * m",
            "1e999 m",
            "1e-999 m",
            "1e308 Gm",
            "3 m^1.5",
            "3 $",
            "e3 m",
            "3 ((((((((m))))))))",
        ] {
            assert!(text.parse::<Quantity>().is_err(), "{text}");
        }
        let many = format!("3 {}", "m ".repeat(1000));
        assert!(many.parse::<Quantity>().is_err());
    }

    #[test]
    fn writes_with_engineering_prefixes() {
        let cases = [
            (Kind::Frequency, 65_697.0, "65.7 kHz"),
            (Kind::Force, 4.2e-9, "4.2 nN"),
            (Kind::Length, 30e-6, "30 µm"),
            (Kind::Length, 999.96e-9, "1 µm"),
            (Kind::Length, -8e-9, "-8 nm"),
            (Kind::Mass, 4.4e-12, "4.4 ng"),
            (Kind::Mass, 1.0, "1 kg"),
            (Kind::Stiffness, 0.2, "200 mN/m"),
            (Kind::Pressure, 4e9, "4 GPa"),
            (Kind::Density, 2330.0, "2330 kg/m^3"),
            (Kind::Damping, 1e-6, "1 µN s/m"),
            (Kind::Number, 0.000_047, "4.7e-5"),
            (Kind::Number, 200.0, "200"),
            (Kind::Length, 0.0, "0 m"),
            (Kind::Force, 1e-30, "1e-30 N"),
            (Kind::Angle, 25.0 * DEGREE, "25 deg"),
        ];
        for (kind, value, expected) in cases {
            assert_eq!(kind.format(value), expected);
        }
        assert_eq!(
            format_electronvolts(12.3 * JOULES_PER_ELECTRONVOLT),
            "12.3 eV"
        );
    }

    fn any_kind() -> impl Strategy<Value = Kind> {
        prop::sample::select(Kind::ALL.to_vec())
    }

    proptest! {
        #[test]
        fn exact_text_gives_back_the_same_bits(kind in any_kind(), value in prop::num::f64::NORMAL) {
            // Away from overflow of the prefix arithmetic's ends.
            prop_assume!(value.abs() > 1e-290 && value.abs() < 1e290);
            prop_assert_eq!(kind.parse(&kind.format_exact(value)), Ok(value));
        }

        #[test]
        fn shown_text_is_right_to_four_digits(kind in any_kind(), value in 1e-28_f64..1e20) {
            let read = kind.parse(&kind.format(value)).unwrap();
            prop_assert!((read / value - 1.0).abs() <= 5.1e-4, "{} {}", value, kind.format(value));
        }

        #[test]
        fn no_text_makes_it_panic(text in "\\PC{0,40}", kind in any_kind()) {
            let _ = kind.parse(&text);
        }

        #[test]
        fn no_unit_like_text_makes_it_panic(text in "-?[0-9.e+-]{0,6} ?[a-zA-Zµ°%^/()·*0-9⁻² -]{0,20}") {
            let _ = text.parse::<Quantity>();
        }
    }
}
