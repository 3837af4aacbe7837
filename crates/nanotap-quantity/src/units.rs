//! The units that are known, their prefixes, and the nearest to one that is not.

use super::{Dimension, JOULES_PER_ELECTRONVOLT, Kind};
use crate::near_name::near_names;

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

pub(super) const DEGREE: f64 = std::f64::consts::PI / 180.0;

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
    unit("V", 0, 1.0, Kind::Voltage.dimension(), true),
    unit("C", 0, 1.0, Dimension::CHARGE, true),
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
pub(super) const PREFIXES: &[(char, i32)] = &[
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

/// Product of powers of units: decimal exponent, further factor, dimension.
#[derive(Clone, Copy)]
pub(super) struct Scale {
    pub(super) decimal: i32,
    pub(super) factor: f64,
    pub(super) dimension: Dimension,
}

impl Scale {
    pub(super) const ONE: Self = Self {
        decimal: 0,
        factor: 1.0,
        dimension: Dimension::NONE,
    };

    pub(super) fn times(self, other: Self, power: i32) -> Self {
        Self {
            decimal: self.decimal + power * other.decimal,
            factor: self.factor * other.factor.powi(power),
            dimension: self.dimension.times(other.dimension, power),
        }
    }
}

pub(super) fn find_unit(symbol: &str) -> Option<Scale> {
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
pub(super) fn nearest_units(symbol: &str, expected: Option<Kind>) -> Vec<String> {
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
