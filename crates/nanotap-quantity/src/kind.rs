//! The table of kinds of quantities: name, dimension, units, words.

use std::collections::HashMap;
use std::fmt;
use std::sync::{LazyLock, Mutex, PoisonError};

use serde::{Serialize, Serializer};

use crate::format::engineering;
use crate::parser::read;
use crate::{Dimension, QuantityError};

/// What a quantity measures: determines its dimension, its units, and its words in messages.
///
/// The kinds below are known everywhere. One that only a single contact law needs is declared with
/// that law, by [`Kind::new`].
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Kind(&'static KindEntry);

/// Description of a kind of quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct KindEntry {
    /// Name in data: `angular_frequency`.
    pub name: &'static str,
    /// Exponents of kg, m, s, rad and C.
    pub dimension: Dimension,
    /// Symbol of the SI unit, `1` for a pure number.
    pub si_unit: &'static str,
    /// How a value is shown.
    pub display: Display,
    /// Description with its article, for messages: "a force per length".
    pub noun: &'static str,
    /// Text of a valid quantity, for messages.
    pub example: &'static str,
    /// The model's unit, of a kind in which results are measured. Units of the model are the gap g₀
    /// of the beam, the time T = √(mL⁴/(EI)) and the force F = EI g₀/L³; the powers of these three
    /// follow from the dimension.
    pub model_unit: Option<&'static str>,
}

/// How a value of a kind is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Display {
    /// Without a unit.
    Bare,
    /// In the SI unit.
    Unit,
    /// In the SI unit with a prefix.
    Prefixed,
    /// In grams with a prefix.
    Grams,
    /// In degrees.
    Degrees,
}

macro_rules! kinds {
    ($(#[$list_doc:meta])* $list:ident: $(
        $(#[$doc:meta])*
        $kind:ident $name:literal: $dimension:expr, $si_unit:literal $display:ident,
        $noun:literal, $example:literal $(, $model_unit:literal)?;
    )*) => {
        #[expect(non_upper_case_globals, reason = "named as the variants of an enum")]
        impl Kind {
            $($(#[$doc])* pub const $kind: Self = Self(&KindEntry {
                name: $name,
                dimension: $dimension,
                si_unit: $si_unit,
                display: Display::$display,
                noun: $noun,
                example: $example,
                model_unit: kinds!(@ $($model_unit)?),
            });)*

            $(#[$list_doc])*
            pub const $list: [Self; [$($name),*].len()] = [$(Self::$kind),*];
        }
    };
    (@) => { None };
    (@ $model_unit:literal) => { Some($model_unit) };
}

const fn d(mass: i32, length: i32, time: i32) -> Dimension {
    Dimension::new(mass, length, time)
}

kinds! {
    /// Kinds that texts state with a unit; the first one with a dimension names it in messages.
    ALL:
    /// A plain number: quality factor, Poisson's ratio, setpoint ratio. Percent allowed.
    Number "number": Dimension::NONE, "1" Bare, "a number without a unit", "200";
    /// Length, m.
    Length "length": d(0, 1, 0), "m" Prefixed, "a length", "30 um", "g0";
    /// Mass, kg; shown in g.
    Mass "mass": d(1, 0, 0), "kg" Grams, "a mass", "3 ng";
    /// Time, s.
    Time "time": d(0, 0, 1), "s" Prefixed, "a time", "12 us", "sqrt(m L^4/EI)";
    /// Mass density, kg/m³.
    Density "density": d(1, -3, 0), "kg/m^3" Unit, "a mass per volume", "2330 kg/m^3";
    /// Frequency, Hz: cycles, not radians, per second; the model's unit counts radians.
    Frequency "frequency": d(0, 0, -1), "Hz" Prefixed, "a frequency", "75 kHz", "sqrt(EI/(m L^4))";
    /// Angular frequency, rad/s.
    AngularFrequency "angular_frequency": Dimension { angle: 1, ..d(0, 0, -1) }, "rad/s" Unit,
    "an angular frequency", "4.7e5 rad/s";
    /// Force, N.
    Force "force": d(1, 1, -2), "N" Prefixed, "a force", "4.2 nN", "EI g0/L^3";
    /// Stiffness, N/m.
    Stiffness "stiffness": d(1, 0, -2), "N/m" Prefixed, "a force per length", "2.8 N/m";
    /// Energy per area, J/m².
    SurfaceEnergy "surface_energy": d(1, 0, -2), "J/m^2" Prefixed, "an energy per area", "20 mJ/m^2";
    /// Pressure or elastic modulus, Pa.
    Pressure "pressure": d(1, -1, -2), "Pa" Prefixed, "a pressure", "4 GPa";
    /// Damping: force per velocity, N s/m.
    Damping "damping": d(1, 0, -1), "N s/m" Prefixed, "a force per velocity", "1e-6 N s/m";
    /// Energy, J.
    Energy "energy": d(1, 2, -2), "J" Prefixed, "an energy", "12 eV", "EI g0^2/L^3";
    /// Power, W.
    Power "power": d(1, 2, -3), "W" Prefixed, "a power", "1 pW", "EI g0^2/L^3 sqrt(EI/(m L^4))";
    /// Velocity, m/s.
    Velocity "velocity": d(0, 1, -1), "m/s" Prefixed, "a velocity", "2 mm/s", "g0 sqrt(EI/(m L^4))";
    /// Angle, rad; shown in degrees.
    Angle "angle": Dimension::ANGLE, "rad" Degrees, "an angle", "25 deg";
    /// Dynamic viscosity, Pa s.
    Viscosity "viscosity": d(1, -1, -1), "Pa s" Prefixed, "a viscosity", "2 Pa s";
    /// Voltage, V.
    Voltage "voltage": d(1, 2, -2).charged(-1), "V" Prefixed, "a voltage", "0.5 V";
    /// Charge per area, C/m².
    ChargeDensity "charge_density": d(0, -2, 0).charged(1), "C/m^2" Prefixed, "a charge per area", "-2.5 mC/m^2";
    /// Strength of the repulsion of a Lennard-Jones law, J m⁶.
    Repulsion "repulsion": d(1, 8, -2), "J m^6" Unit, "an energy times a length to the sixth", "1e-76 J m^6";
}

kinds! {
    /// Kinds of results whose numbers have no SI unit.
    DIMENSIONLESS:
    /// Slope; dW/dξ in the model with the unit g₀/L, the pure number dw/dx in SI.
    Slope "slope": Dimension::NONE, "1" Bare, "a slope", "0.1", "g0/L";
    /// Angle in degrees, in the model and in SI.
    Degrees "degrees": Dimension::NONE, "degree" Unit, "an angle in degrees", "25";
    /// A whole number of events, without a unit.
    Count "count": Dimension::NONE, "1" Bare, "a number of events", "3";
    /// A count per drive period.
    PerPeriod "per_period": Dimension::NONE, "1/drive period" Unit, "a number per drive period", "3";
    /// Time in drive periods, in the model and in SI.
    Periods "periods": Dimension::NONE, "drive periods" Unit, "a number of drive periods", "3";
    /// A position along the beam as a fraction of its length, 0 (clamp) to 1 (tip).
    Place "place": Dimension::NONE, "1" Bare, "a place on the beam", "0.5", "L";
}

/// Largest number of kinds that are not in the table; each dimension needs one, for as long as the program
/// runs.
const MAX_KINDS: usize = 1000;

impl Kind {
    /// Creates a kind that is not in the table.
    pub const fn new(entry: &'static KindEntry) -> Self {
        Self(entry)
    }

    /// Returns the kind of quantities of a dimension: the first of [`Kind::ALL`] that has it, or one with
    /// its base units. `None` for a new one after a thousand others.
    ///
    /// ```
    /// use nanotap_quantity::{Dimension, Kind};
    ///
    /// let kind = Kind::of(Dimension::new(1, -2, -2)).unwrap();
    /// assert_eq!(kind.si_unit(), "kg m^-2 s^-2");
    /// assert_eq!(kind.parse("1 GN/m^3"), Ok(1e9));
    /// assert_eq!(Kind::of(Dimension::new(1, 1, -2)), Some(Kind::Force));
    /// ```
    pub fn of(dimension: Dimension) -> Option<Self> {
        static OTHERS: LazyLock<Mutex<HashMap<Dimension, Kind>>> = LazyLock::new(Mutex::default);
        if let Some(kind) = dimension.kind() {
            return Some(kind);
        }
        let mut others = OTHERS.lock().unwrap_or_else(PoisonError::into_inner);
        let count = others.len();
        if let Some(kind) = others.get(&dimension) {
            return Some(*kind);
        }
        if count == MAX_KINDS {
            return None;
        }
        // Kept for as long as the program runs, once a dimension.
        let kept = |text: String| -> &'static str { text.leak() };
        let unit = kept(dimension.to_string());
        let kind = Self(Box::leak(Box::new(KindEntry {
            name: kept(unit.replace([' ', '^'], "_")),
            dimension,
            si_unit: unit,
            display: Display::Unit,
            noun: kept(format!("a quantity in {unit}")),
            example: kept(format!("1 {unit}")),
            model_unit: None,
        })));
        others.insert(dimension, kind);
        Some(kind)
    }

    /// Returns the kind whose SI unit this is; `None` for a pure number and for any other unit.
    pub fn of_si_unit(unit: &str) -> Option<Self> {
        let mut kinds = Self::ALL.into_iter();
        kinds.find(|kind| *kind != Self::Number && kind.si_unit() == unit)
    }

    /// Returns the exponents of kg, m, s, rad and C.
    pub const fn dimension(self) -> Dimension {
        self.0.dimension
    }

    /// Returns the kind, if its numbers have a dimension, and so a unit with prefixes.
    pub const fn dimensional(self) -> Option<Self> {
        if self.dimension().is_none() {
            None
        } else {
            Some(self)
        }
    }

    /// Returns the SI unit, that of the result of [`Kind::parse`].
    pub const fn si_unit(self) -> &'static str {
        self.0.si_unit
    }

    /// Returns the model's unit, if results of the model have this kind.
    pub const fn model_unit(self) -> Option<&'static str> {
        self.0.model_unit
    }

    /// Returns the unit of results of a dimensionless case: the model's, or the SI unit of kinds
    /// whose numbers are the same in both.
    pub const fn result_unit(self) -> &'static str {
        match self.0.model_unit {
            Some(unit) => unit,
            None => self.0.si_unit,
        }
    }

    /// Returns the description with its article, for messages: "a force per length".
    pub const fn noun(self) -> &'static str {
        self.0.noun
    }

    /// Returns the text of a valid quantity, for messages.
    pub const fn example(self) -> &'static str {
        self.0.example
    }

    /// Unit for display, its power of ten relative to SI, and whether it takes a prefix.
    const fn display_unit(self) -> (&'static str, i32, bool) {
        match self.0.display {
            Display::Bare => ("", 0, false),
            Display::Unit | Display::Degrees => (self.0.si_unit, 0, false),
            Display::Prefixed => (self.0.si_unit, 0, true),
            Display::Grams => ("g", -3, true),
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
        if self.0.display == Display::Degrees {
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

impl fmt::Debug for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.name)
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.0.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_kinds_have_one_name() {
        let kinds = || Kind::ALL.into_iter().chain(Kind::DIMENSIONLESS);
        for kind in kinds() {
            let same = kinds().filter(|other| other.0.name == kind.0.name);
            assert_eq!(same.count(), 1, "{kind:?}");
        }
    }

    /// F = kg m s⁻² with F, g₀ and T in place of kg, m and s: kg = F T²/g₀.
    #[test]
    fn exponents_of_force_are_those_of_mass_rewritten() {
        let of = |kind: Kind| kind.dimension().of_force();
        assert_eq!(of(Kind::Force), [1, 0, 0]);
        assert_eq!(of(Kind::Energy), [1, 1, 0]);
        assert_eq!(of(Kind::Power), [1, 1, -1]);
        assert_eq!(of(Kind::Mass), [1, -1, 2]);
        assert_eq!(of(Kind::Velocity), [0, 1, -1]);
    }
}
