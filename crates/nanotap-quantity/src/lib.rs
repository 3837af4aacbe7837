//! Kinds of quantities in one table, with parsing and formatting of their values with units:
//! `"2.8 N/m"`, `"75 kHz"`, `"30 µm"`, `"1e-3 N s/m"`.
//!
//! A value is read into SI under a dimension check and written back with an engineering
//! prefix. Decimal prefixes are folded into the number's own exponent before it is converted
//! to binary, so `"30 um"` is exactly the `f64` nearest to 3e-5, and
//! [`Kind::format_exact`] followed by [`Kind::parse`] gives back the same bits.
//!
//! General unit crates are not used: `uom`'s `FromStr` knows neither `um` nor compound units such
//! as `N s/m`, and `fend-core` ignores case, so it reads `5 pn` as five peta-newtons, and evaluates
//! `3 N/m m` to 3 N.

mod dimension;
mod format;
mod kind;
pub mod near_name;
pub mod number;
mod parser;
mod units;

use std::fmt;
use std::str::FromStr;

pub use dimension::Dimension;
use format::engineering;
pub use format::prefix_of;
pub use kind::{Display, Kind, KindEntry};
use parser::read;

/// Elementary charge in coulomb, hence joules in one electronvolt; exact in the SI of 2019.
pub const JOULES_PER_ELECTRONVOLT: f64 = 1.602_176_634e-19;

/// Writes an energy in joules as electronvolts with four significant digits: "12.3 eV".
pub fn format_electronvolts(joules: f64) -> String {
    engineering(joules / JOULES_PER_ELECTRONVOLT, Some(4), "eV", 0, true)
}

/// A value in SI (kg, m, s, rad, C) with its dimension, as read from text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Value in SI: kg, m, s, rad and C.
    pub value: f64,
    /// Dimension of the value, as exponents of the base units.
    pub dimension: Dimension,
}

impl FromStr for Quantity {
    type Err = QuantityError;

    fn from_str(text: &str) -> Result<Self, QuantityError> {
        read(text, None)
    }
}

/// A text that is not the expected quantity.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}got \"{text}\"{reason}", wanted(*expected))]
pub struct QuantityError {
    /// The expected kind, if known.
    pub expected: Option<Kind>,
    /// Text that was parsed.
    pub text: String,
    /// What is wrong with the text, with its punctuation.
    reason: String,
    /// Known units that look like an unknown one, nearest first.
    pub nearest: Vec<String>,
}

impl QuantityError {
    fn new(expected: Option<Kind>, text: &str, reason: impl fmt::Display) -> Self {
        Self {
            expected,
            text: text.to_owned(),
            reason: format!(": {reason}"),
            nearest: Vec::new(),
        }
    }
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

#[cfg(test)]
mod tests;
