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

mod format;
mod parser;
mod units;

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use format::engineering;
use parser::read;

/// Elementary charge in coulomb, hence joules in one electronvolt; exact in the SI of 2019.
pub const JOULES_PER_ELECTRONVOLT: f64 = 1.602_176_634e-19;

/// Exponents of the base units kilogram, metre, second, radian and coulomb.
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
    /// Exponent of the coulomb.
    pub charge: i32,
}

impl Dimension {
    const NONE: Self = Self::new(0, 0, 0, 0);
    const CHARGE: Self = Self::NONE.charged(1);

    const fn new(mass: i32, length: i32, time: i32, angle: i32) -> Self {
        Self {
            mass,
            length,
            time,
            angle,
            charge: 0,
        }
    }

    const fn charged(self, charge: i32) -> Self {
        Self { charge, ..self }
    }

    fn times(self, other: Self, power: i32) -> Self {
        Self {
            mass: self.mass + power * other.mass,
            length: self.length + power * other.length,
            time: self.time + power * other.time,
            angle: self.angle + power * other.angle,
            charge: self.charge + power * other.charge,
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
            ("C", self.charge),
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
    /// Pascal second.
    Viscosity,
    /// Volt.
    Voltage,
    /// Coulomb per square metre.
    ChargeDensity,
    /// Joule times metre to the sixth: what repels in a Lennard-Jones law.
    Repulsion,
}

impl Kind {
    /// Every kind, in the order in which a dimension is named.
    pub const ALL: [Self; 19] = [
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
        Self::Viscosity,
        Self::Voltage,
        Self::ChargeDensity,
        Self::Repulsion,
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
            Self::Viscosity => Dimension::new(1, -1, -1, 0),
            Self::Voltage => Dimension::new(1, 2, -2, 0).charged(-1),
            Self::ChargeDensity => Dimension::new(0, -2, 0, 0).charged(1),
            Self::Repulsion => Dimension::new(1, 8, -2, 0),
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
            Self::Viscosity => "a viscosity",
            Self::Voltage => "a voltage",
            Self::ChargeDensity => "a charge per area",
            Self::Repulsion => "an energy times a length to the sixth",
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
            Self::Viscosity => "2 Pa s",
            Self::Voltage => "0.5 V",
            Self::ChargeDensity => "-2.5 mC/m^2",
            Self::Repulsion => "1e-76 J m^6",
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
            Self::Viscosity => ("Pa s", 0, true),
            Self::Voltage => ("V", 0, true),
            Self::ChargeDensity => ("C/m^2", 0, true),
            Self::Repulsion => ("J m^6", 0, false),
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

#[cfg(test)]
mod tests;
