//! Parsing and formatting of quantities with units: `"2.8 N/m"`, `"75 kHz"`, `"30 µm"`, `"1e-3 N
//! s/m"`.
//!
//! A value is read into SI under a dimension check and written back with an engineering
//! prefix. Decimal prefixes are folded into the number's own exponent before it is converted
//! to binary, so `"30 um"` is exactly the `f64` nearest to 3e-5, and
//! [`Kind::format_exact`] followed by [`Kind::parse`] gives back the same bits.
//!
//! General unit crates are not used: `uom`'s `FromStr` knows neither `um` nor compound units such
//! as `N s/m`, and `fend-core` ignores case, so it reads `5 pn` as five peta-newtons, and evaluates
//! `3 N/m m` to 3 N.

mod format;
mod parser;
mod units;

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use format::engineering;
pub(crate) use format::prefix_of;
use parser::read;

/// Elementary charge in coulomb, hence joules in one electronvolt; exact in the SI of 2019.
pub const JOULES_PER_ELECTRONVOLT: f64 = 1.602_176_634e-19;

/// Exponents of the base units kilogram, metre, second, radian and coulomb.
///
/// The radian counts as a base unit here, so that an angular frequency in rad/s cannot be confused
/// with a frequency in Hz, a factor of 2π.
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

/// The table of kinds: dimension, noun with its article, an example, and the unit for display with
/// its power of ten relative to SI and whether it takes a prefix.
macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident: $dimension:expr, $noun:expr, $example:expr, $unit:expr;)*) => {
        /// What a quantity measures: determines its dimension, its words in messages and its unit
        /// for display.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Kind { $($(#[$doc])* $kind),* }

        impl Kind {
            /// All kinds; the first one with a dimension names it in messages.
            pub const ALL: [Self; [$(stringify!($kind)),*].len()] = [$(Self::$kind),*];

            /// Returns the exponents of kg, m, s, rad and C.
            pub const fn dimension(self) -> Dimension {
                match self { $(Self::$kind => $dimension),* }
            }

            /// Returns the description with its article, for messages: "a force per length".
            pub const fn noun(self) -> &'static str {
                match self { $(Self::$kind => $noun),* }
            }

            /// Returns the text of a valid quantity, for messages.
            pub const fn example(self) -> &'static str {
                match self { $(Self::$kind => $example),* }
            }

            /// Unit for display, its power of ten relative to SI, and whether it takes a prefix.
            const fn display_unit(self) -> (&'static str, i32, bool) {
                match self { $(Self::$kind => $unit),* }
            }
        }
    };
}

kinds! {
    /// A plain number: quality factor, Poisson's ratio, setpoint ratio. Percent allowed.
    Number: Dimension::NONE, "a number without a unit", "200", ("", 0, false);
    /// Length, m.
    Length: Dimension::new(0, 1, 0, 0), "a length", "30 um", ("m", 0, true);
    /// Mass, kg; shown in g.
    Mass: Dimension::new(1, 0, 0, 0), "a mass", "3 ng", ("g", -3, true);
    /// Time, s.
    Time: Dimension::new(0, 0, 1, 0), "a time", "12 us", ("s", 0, true);
    /// Mass density, kg/m³.
    Density: Dimension::new(1, -3, 0, 0), "a mass per volume", "2330 kg/m^3", ("kg/m^3", 0, false);
    /// Frequency, Hz: cycles, not radians, per second.
    Frequency: Dimension::new(0, 0, -1, 0), "a frequency", "75 kHz", ("Hz", 0, true);
    /// Angular frequency, rad/s.
    AngularFrequency: Dimension::new(0, 0, -1, 1), "an angular frequency", "4.7e5 rad/s", ("rad/s", 0, false);
    /// Force, N.
    Force: Dimension::new(1, 1, -2, 0), "a force", "4.2 nN", ("N", 0, true);
    /// Stiffness, N/m.
    Stiffness: Dimension::new(1, 0, -2, 0), "a force per length", "2.8 N/m", ("N/m", 0, true);
    /// Pressure or elastic modulus, Pa.
    Pressure: Dimension::new(1, -1, -2, 0), "a pressure", "4 GPa", ("Pa", 0, true);
    /// Damping: force per velocity, N s/m.
    Damping: Dimension::new(1, 0, -1, 0), "a force per velocity", "1e-6 N s/m", ("N s/m", 0, true);
    /// Energy, J.
    Energy: Dimension::new(1, 2, -2, 0), "an energy", "12 eV", ("J", 0, true);
    /// Power, W.
    Power: Dimension::new(1, 2, -3, 0), "a power", "1 pW", ("W", 0, true);
    /// Velocity, m/s.
    Velocity: Dimension::new(0, 1, -1, 0), "a velocity", "2 mm/s", ("m/s", 0, true);
    /// Angle, rad; shown in degrees.
    Angle: Dimension::new(0, 0, 0, 1), "an angle", "25 deg", ("rad", 0, false);
    /// Dynamic viscosity, Pa s.
    Viscosity: Dimension::new(1, -1, -1, 0), "a viscosity", "2 Pa s", ("Pa s", 0, true);
    /// Voltage, V.
    Voltage: Dimension::new(1, 2, -2, 0).charged(-1), "a voltage", "0.5 V", ("V", 0, true);
    /// Charge per area, C/m².
    ChargeDensity: Dimension::new(0, -2, 0, 0).charged(1), "a charge per area", "-2.5 mC/m^2", ("C/m^2", 0, true);
    /// Strength of the repulsion of a Lennard-Jones law, J m⁶.
    Repulsion: Dimension::new(1, 8, -2, 0), "an energy times a length to the sixth", "1e-76 J m^6", ("J m^6", 0, false);
}

impl Kind {
    /// Returns the kind whose SI unit this is; `None` for a pure number and for any other unit.
    pub fn of_si_unit(unit: &str) -> Option<Self> {
        let mut kinds = Self::ALL.into_iter();
        kinds.find(|kind| *kind != Self::Number && kind.si_unit() == unit)
    }

    /// SI unit of the result of [`Kind::parse`].
    pub const fn si_unit(self) -> &'static str {
        match self {
            Self::Number => "1",
            Self::Mass => "kg",
            Self::Angle => "rad",
            other => other.display_unit().0,
        }
    }

    /// Reads a quantity of this kind, in SI. A number without a unit is in SI.
    ///
    /// # Errors
    /// [`QuantityError`] if the text is no number with a known unit, or has another dimension;
    /// the message says what was expected, with an example.
    pub fn parse(self, text: &str) -> Result<f64, QuantityError> {
        let quantity = read(text, Some(self))?;
        let is_bare = text.trim().replace('\u{2212}', "-").parse::<f64>().is_ok();
        if quantity.dimension == self.dimension() || is_bare {
            return Ok(quantity.value);
        }
        Err(QuantityError {
            reason: format!(" ({})", quantity.dimension),
            ..QuantityError::new(Some(self), text.trim(), "")
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
