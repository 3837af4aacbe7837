//! The numbers of the dimensionless cantilever, each declared once: the paper's seven, those of
//! the contact laws, and those that only some drives and levers have.
//!
//! Case files, messages, documents, the mapping to physical quantities and the storage in a
//! [`Cantilever`](crate::model::cantilever::Cantilever) follow from the table. A new number is
//! an entry here, or in the file of its contact law, and the place where the equations read it.

use std::fmt;

use serde::{Serialize, Serializer};

use crate::model::contact::{self, ContactLaw};

/// Largest size of α1 … α6. A larger number is probably a value in SI units, and products of
/// parameters would lose too many digits.
pub const LARGEST_ALPHA: f64 = 1e9;
/// Range of Ω. The 50th mode is at 24,350 and the first at 3.5.
pub const OMEGA_RANGE: (f64, f64) = (1e-6, 1e6);

/// A number of the equations: an index into the table of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Parameter(u8);

/// What the table says of a parameter.
#[derive(Clone, Copy, Debug)]
pub struct ParameterEntry {
    /// Name in case files, messages and data.
    pub name: &'static str,
    /// Second name.
    pub alias: Option<&'static str>,
    /// Symbol in formulas and on axes.
    pub symbol: &'static str,
    /// Meaning, in one line.
    pub meaning: &'static str,
    /// Value where none is given; `None` if one must be.
    pub default: Option<f64>,
    /// Value for examples.
    pub example: f64,
    /// Least and greatest value.
    pub range: (f64, f64),
    /// Unit of the physical quantity behind it.
    pub unit: Unit,
    /// How it follows from the quantity: `3 K1/k`.
    pub formula: &'static str,
    /// The physical quantity.
    pub quantity: &'static str,
    /// Formula and quantity where a force on the lever drives it.
    pub by_force: Option<(&'static str, &'static str)>,
    /// When it applies.
    pub applies: Applies,
    /// Whether documents give it where it does not apply, as 0.
    pub always_written: bool,
    /// The key of `[sample]` that states the quantity, of a number of a contact law.
    pub stated_by: Option<SampleKey>,
}

/// When a parameter applies; elsewhere it is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applies {
    /// To every cantilever.
    Always,
    /// With a piecewise-linear contact law.
    Spring,
    /// With a piecewise-linear contact law that has the damper α6.
    Damper,
    /// With this contact law.
    Law(ContactLaw),
    /// With a second tone.
    SecondTone,
    /// Where it is not 0: a measured number of a mode.
    Measured,
}

/// What the model's unit of a parameter is in SI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Pure number.
    Number,
    /// Mass, kg.
    Mass,
    /// Length, m.
    Length,
    /// Time, s.
    Time,
    /// Frequency, Hz.
    Frequency,
    /// Stiffness, N/m.
    Stiffness,
    /// Damping, N s/m.
    Damping,
    /// Force, N.
    Force,
    /// Amplitude of the drive: m of a moving base, N of a force on the lever.
    Drive,
    /// Degrees.
    Degrees,
}

/// The key of `[sample]` with a law number's own name.
#[derive(Clone, Copy, Debug)]
pub enum SampleKey {
    /// A key of this law alone.
    Own {
        /// Meaning, in one line.
        meaning: &'static str,
        /// Whether 0 is allowed.
        zero: bool,
    },
    /// A key that nonlinear laws have, too.
    Shared,
}

impl ParameterEntry {
    /// A number from 0 up that always applies, has no default, and nothing else to say.
    pub const PLAIN: Self = Self {
        name: "",
        alias: None,
        symbol: "",
        meaning: "",
        default: None,
        example: 1.0,
        range: (0.0, LARGEST_ALPHA),
        unit: Unit::Number,
        formula: "",
        quantity: "",
        by_force: None,
        applies: Applies::Always,
        always_written: false,
        stated_by: None,
    };

    /// The same for a second tone or a measured mode, 0 by default.
    const fn optional(self, applies: Applies) -> Self {
        Self {
            default: Some(0.0),
            applies,
            ..self
        }
    }
}

const SIGNED: (f64, f64) = (-LARGEST_ALPHA, LARGEST_ALPHA);
const PLAIN: ParameterEntry = ParameterEntry::PLAIN;

macro_rules! parameters {
    ($($group:ident from $first:expr => { $($key:ident = $entry:expr;)* })*) => {
        #[expect(non_upper_case_globals, reason = "named as the variants of an enum")]
        #[expect(missing_docs, reason = "each entry has a meaning")]
        impl Parameter {
            $($(pub const $key: Self = Self(($first + $group::$key as usize) as u8);)*)*
        }
        $(
            enum $group { $($key),* }
            impl $group {
                const ENTRIES: &[ParameterEntry] = &[$($entry),*];
            }
        )*
    };
}

parameters! {
    Paper from 0 => {
        Alpha1 = ParameterEntry {
            name: "alpha1",
            alias: Some("tip_mass_ratio"),
            symbol: "α₁",
            meaning: "tip mass over beam mass, M/(mL)",
            example: 0.1,
            unit: Unit::Mass,
            formula: "M/(mL)",
            quantity: "tip mass M",
            ..PLAIN
        };
        Alpha2 = ParameterEntry {
            name: "alpha2",
            alias: Some("drive_amplitude"),
            symbol: "α₂",
            meaning: "drive amplitude over beam gap, f/g0",
            example: 0.1,
            unit: Unit::Drive,
            formula: "f/g0",
            quantity: "base amplitude f",
            by_force: Some(("F L^3/(EI g0) = 3 F/(k g0)", "amplitude of the drive's force F")),
            ..PLAIN
        };
        Alpha3 = ParameterEntry {
            name: "alpha3",
            alias: Some("beam_damping"),
            symbol: "α₃",
            meaning: "viscous damping of the beam, C·√(L⁴/(m·EI))",
            example: 0.1,
            unit: Unit::Damping,
            formula: "C sqrt(L^4/(m EI)) = (C L) T/(m L)",
            quantity: "damping of the whole beam C L",
            ..PLAIN
        };
        Alpha4 = ParameterEntry {
            name: "alpha4",
            alias: Some("contact_stiffness"),
            symbol: "α₄",
            meaning: "contact stiffness over bending stiffness, K1·L³/(EI)",
            example: 20.0,
            unit: Unit::Stiffness,
            formula: "K1 L^3/(EI) = 3 K1/k",
            quantity: "contact stiffness K1",
            applies: Applies::Spring,
            ..PLAIN
        };
        Alpha5 = ParameterEntry {
            name: "alpha5",
            alias: Some("gap"),
            symbol: "α₅",
            meaning: "tip gap over beam gap, g1/g0 (negative: pressed in at rest)",
            default: Some(0.0),
            range: SIGNED,
            unit: Unit::Length,
            formula: "g1/g0",
            quantity: "tip gap g1",
            ..PLAIN
        };
        Alpha6 = ParameterEntry {
            name: "alpha6",
            alias: Some("contact_damping"),
            symbol: "α₆",
            meaning: "viscous damping of the contact, (C1/L)·√(L⁴/(m·EI))",
            example: 0.2,
            unit: Unit::Damping,
            formula: "(C1/L) sqrt(L^4/(m EI)) = C1 T/(m L)",
            quantity: "contact damping C1",
            applies: Applies::Damper,
            ..PLAIN
        };
        Omega = ParameterEntry {
            name: "omega",
            alias: Some("drive_frequency"),
            symbol: "Ω",
            meaning: "drive frequency, ω·√(mL⁴/(EI))",
            example: 2.6,
            range: OMEGA_RANGE,
            unit: Unit::Frequency,
            formula: "omega sqrt(m L^4/(EI)) = 2 pi f T",
            quantity: "drive frequency",
            ..PLAIN
        };
    }
    Further from Parameter::PAPER + contact::NUMBERS => {
        Tone2Amplitude = ParameterEntry {
            name: "tone2_amplitude",
            alias: Some("second_tone_amplitude"),
            symbol: "A₂",
            meaning: "amplitude of the second tone, measured as alpha2",
            unit: Unit::Drive,
            formula: "f2/g0",
            quantity: "base amplitude of the second tone",
            by_force: Some(("F2 L^3/(EI g0) = 3 F2/(k g0)", "force of the second tone F2")),
            always_written: true,
            ..PLAIN.optional(Applies::SecondTone)
        };
        Tone2Phase = ParameterEntry {
            name: "tone2_phase",
            alias: Some("second_tone_phase"),
            symbol: "θ₂",
            meaning: "phase of the second tone in degrees",
            range: SIGNED,
            unit: Unit::Degrees,
            formula: "degrees",
            quantity: "phase of the second tone",
            always_written: true,
            ..PLAIN.optional(Applies::SecondTone)
        };
        Mode2Frequency = ParameterEntry {
            name: "mode2_frequency",
            symbol: "Ω₂",
            meaning: "measured frequency of the second free mode, as omega (0: the beam's own)",
            unit: Unit::Frequency,
            formula: "2 pi f2 T",
            quantity: "frequency of the second mode",
            ..PLAIN.optional(Applies::Measured)
        };
        Mode3Frequency = ParameterEntry {
            name: "mode3_frequency",
            symbol: "Ω₃",
            meaning: "measured frequency of the third free mode, as omega (0: the beam's own)",
            unit: Unit::Frequency,
            formula: "2 pi f3 T",
            quantity: "frequency of the third mode",
            ..PLAIN.optional(Applies::Measured)
        };
        Mode2Quality = ParameterEntry {
            name: "mode2_quality",
            symbol: "Q₂",
            meaning: "measured quality factor of the second free mode (0: as beam_damping has it)",
            formula: "Q2",
            quantity: "quality factor of the second mode",
            ..PLAIN.optional(Applies::Measured)
        };
        Mode3Quality = ParameterEntry {
            name: "mode3_quality",
            symbol: "Q₃",
            meaning: "measured quality factor of the third free mode (0: as beam_damping has it)",
            formula: "Q3",
            quantity: "quality factor of the third mode",
            ..PLAIN.optional(Applies::Measured)
        };
        Mode2Stiffness = ParameterEntry {
            name: "mode2_stiffness",
            symbol: "k₂",
            meaning: "measured stiffness of the second free mode at the tip, k2·L³/(EI) (0: the beam's own)",
            unit: Unit::Stiffness,
            formula: "k2 L^3/(EI) = 3 k2/k",
            quantity: "stiffness of the second mode",
            ..PLAIN.optional(Applies::Measured)
        };
        Mode3Stiffness = ParameterEntry {
            name: "mode3_stiffness",
            symbol: "k₃",
            meaning: "measured stiffness of the third free mode at the tip, k3·L³/(EI) (0: the beam's own)",
            unit: Unit::Stiffness,
            formula: "k3 L^3/(EI) = 3 k3/k",
            quantity: "stiffness of the third mode",
            ..PLAIN.optional(Applies::Measured)
        };
    }
}

static TABLE: [ParameterEntry; Parameter::COUNT] = {
    let mut table = [PLAIN; Parameter::COUNT];
    let mut k = 0;
    while k < table.len() {
        table[k] = if k < Parameter::PAPER {
            Paper::ENTRIES[k]
        } else if k < Parameter::PAPER + contact::NUMBERS {
            contact::number(k - Parameter::PAPER)
        } else {
            Further::ENTRIES[k - Parameter::PAPER - contact::NUMBERS]
        };
        k += 1;
    }
    table
};

impl Parameter {
    /// The paper's parameters, which every case has: α1 to α6 and then Ω.
    pub const ALL: [Self; Self::PAPER] = [
        Self::Alpha1,
        Self::Alpha2,
        Self::Alpha3,
        Self::Alpha4,
        Self::Alpha5,
        Self::Alpha6,
        Self::Omega,
    ];
    /// Measured numbers of the second and third mode.
    pub const MEASURED: [Self; 6] = [
        Self::Mode2Frequency,
        Self::Mode3Frequency,
        Self::Mode2Quality,
        Self::Mode3Quality,
        Self::Mode2Stiffness,
        Self::Mode3Stiffness,
    ];
    /// How many of them are the paper's.
    pub(crate) const PAPER: usize = Paper::ENTRIES.len();
    /// How many parameters there are.
    pub const COUNT: usize = Self::PAPER + contact::NUMBERS + Further::ENTRIES.len();

    /// The parameter at a place of the table.
    pub(crate) const fn at(index: usize) -> Self {
        Self(index as u8)
    }

    /// All parameters: the paper's, those of contact laws, and the others.
    pub fn every() -> impl DoubleEndedIterator<Item = Self> + Clone {
        (0..Self::COUNT as u8).map(Self)
    }

    /// The parameters of a contact law alone.
    pub fn of_law(law: ContactLaw) -> impl ExactSizeIterator<Item = Self> + Clone {
        let first = Self::PAPER + law.first_number();
        (first..first + law.entry().numbers.len()).map(|k| Self(k as u8))
    }

    /// The parameter with this name.
    pub fn find(name: &str) -> Option<Self> {
        Self::every().find(|parameter| parameter.name() == name)
    }

    /// Place in the table.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// Entry of the table.
    pub const fn entry(self) -> &'static ParameterEntry {
        &TABLE[self.index()]
    }

    /// Name in messages, case files and data: `alpha1` … `alpha6`, `omega`.
    pub const fn name(self) -> &'static str {
        self.entry().name
    }
}

/// A value of each parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers([f64; Parameter::COUNT]);

impl Numbers {
    /// All zero.
    pub const ZERO: Self = Self([0.0; Parameter::COUNT]);

    /// The value of a parameter.
    pub const fn get(&self, parameter: Parameter) -> f64 {
        self.0[parameter.index()]
    }

    /// Sets the value of a parameter.
    pub const fn set(&mut self, parameter: Parameter, value: f64) {
        self.0[parameter.index()] = value;
    }

    /// The same with another value of a parameter.
    #[must_use]
    pub const fn with(mut self, parameter: Parameter, value: f64) -> Self {
        self.set(parameter, value);
        self
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.name())
    }
}

impl Serialize for Parameter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}
