//! The numbers of the dimensionless cantilever, each declared once: the paper's seven, those of
//! the contact laws, and those that only some drives and levers have.
//!
//! Case files, messages, documents, the mapping to physical quantities and the storage in a
//! [`Cantilever`](crate::cantilever::Cantilever) follow from the table. A new number is
//! an entry here, or in the file of its contact law, and the place where the equations read it.

use std::fmt;
use std::sync::LazyLock;

use serde::{Serialize, Serializer};

use crate::contact::{self, ContactLaw};
use crate::drive_form::MAX_TONES;

/// Largest size of α1 … α6. A larger number is probably a value in SI units, and products of
/// parameters would lose too many digits.
pub const LARGEST_ALPHA: f64 = 1e9;
/// Range of Ω. The 50th mode is at 24,350 and the first at 3.5.
pub const OMEGA_RANGE: (f64, f64) = (1e-6, 1e6);

/// A number of the equations: an index into the table of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Parameter(u8);

/// Entry of the table of parameters.
#[derive(Clone, Copy, Debug)]
pub struct ParameterEntry {
    /// Name in case files, messages and data.
    pub name: &'static str,
    /// Alternative name, as `tip_mass_ratio` of `alpha1`; `None` if there is none.
    pub alias: Option<&'static str>,
    /// Symbol in formulas and on axes.
    pub symbol: &'static str,
    /// Meaning in one line, with the formula of the number.
    pub meaning: &'static str,
    /// Value where none is given; `None` if one must be.
    pub default: Option<f64>,
    /// Typical value for examples in messages, dimensionless, or degrees for a phase.
    pub example: f64,
    /// Least and greatest allowed value, dimensionless, or degrees for a phase.
    pub range: (f64, f64),
    /// Unit of the physical quantity behind it.
    pub unit: Unit,
    /// Formula by which it follows from the quantity: `3 K1/k`.
    pub formula: &'static str,
    /// Physical quantity behind the parameter, in words: `tip mass M`.
    pub quantity: &'static str,
    /// Formula and quantity where a force on the lever drives it.
    pub by_force: Option<(&'static str, &'static str)>,
    /// Cases to which the parameter applies.
    pub applies: Applies,
    /// Whether documents give it where it does not apply, as 0.
    pub always_written: bool,
    /// The key of `[sample]` that states the quantity, of a number of a contact law.
    pub stated_by: Option<SampleKey>,
}

/// Cases to which a parameter applies; elsewhere it is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applies {
    /// The parameter applies to every cantilever.
    Always,
    /// With any piecewise-linear contact law.
    Spring,
    /// With a piecewise-linear contact law that has the damper α6.
    Damper,
    /// Only with this piecewise-linear contact law.
    Law(ContactLaw),
    /// Where the drive has this further tone, 2 or 3.
    Tone(usize),
    /// Where it is not 0: a measured number of a mode, or one of Q control.
    NotZero,
}

/// Kind of physical quantity behind a parameter, with the SI unit of its values and the model's
/// unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Pure number, the same in SI and in the model.
    Number,
    /// Mass, kg; the model's unit is mL.
    Mass,
    /// Length, m; the model's unit is g₀.
    Length,
    /// Time, s; the model's unit is T = √(mL⁴/(EI)).
    Time,
    /// Frequency, Hz; that of Ω = 1 is 1/(2πT), with T = √(mL⁴/(EI)).
    Frequency,
    /// Stiffness, N/m; the model's unit is EI/L³ = k/3.
    Stiffness,
    /// Damping, N s/m; the model's unit is mL/T, with T = √(mL⁴/(EI)).
    Damping,
    /// Force, N; the model's unit is EI g₀/L³ = k g₀/3.
    Force,
    /// Amplitude of the drive: m of a moving base, N of a force on the lever.
    Drive,
    /// Angle, degrees, the same in the model.
    Degrees,
}

/// Key of `[sample]` that states a number of a contact law, under the number's name.
#[derive(Clone, Copy, Debug)]
pub enum SampleKey {
    /// A key of this law alone.
    Own {
        /// Meaning of the key in one line.
        meaning: &'static str,
        /// Whether the value 0 is allowed for the key.
        zero: bool,
        /// Value for examples in messages and forms, in SI.
        example: f64,
    },
    /// A key that nonlinear laws have, too.
    Shared,
}

impl ParameterEntry {
    /// A number from 0 up that always applies and has no default.
    pub(crate) const fn new(
        name: &'static str,
        symbol: &'static str,
        meaning: &'static str,
    ) -> Self {
        Self {
            name,
            alias: None,
            symbol,
            meaning,
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
        }
    }

    /// Sets the unit, the quantity and its formula.
    pub(crate) const fn of(
        self,
        unit: Unit,
        quantity: &'static str,
        formula: &'static str,
    ) -> Self {
        Self {
            unit,
            formula,
            quantity,
            ..self
        }
    }

    /// Sets quantity and formula for a lever that a force drives.
    const fn by_force(self, quantity: &'static str, formula: &'static str) -> Self {
        Self {
            by_force: Some((formula, quantity)),
            ..self
        }
    }

    const fn also(self, alias: &'static str) -> Self {
        Self {
            alias: Some(alias),
            ..self
        }
    }

    pub(crate) const fn or(self, default: f64) -> Self {
        Self {
            default: Some(default),
            ..self
        }
    }

    pub(crate) const fn such_as(self, example: f64) -> Self {
        Self { example, ..self }
    }

    const fn within(self, range: (f64, f64)) -> Self {
        Self { range, ..self }
    }

    const fn when(self, applies: Applies) -> Self {
        Self { applies, ..self }
    }

    pub(crate) const fn always_written(self) -> Self {
        Self {
            always_written: true,
            ..self
        }
    }

    pub(crate) const fn stated_by(self, key: SampleKey) -> Self {
        Self {
            stated_by: Some(key),
            ..self
        }
    }
}

const fn number(name: &'static str, symbol: &'static str, meaning: &'static str) -> ParameterEntry {
    ParameterEntry::new(name, symbol, meaning)
}

/// Range of a parameter of either sign.
const SIGNED: (f64, f64) = (-LARGEST_ALPHA, LARGEST_ALPHA);

/// Declares a measured number of a mode; 0 stands for none.
const fn measured(
    name: &'static str,
    symbol: &'static str,
    meaning: &'static str,
) -> ParameterEntry {
    number(name, symbol, meaning).or(0.0).when(Applies::NotZero)
}

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
        Alpha1 = number("alpha1", "α₁", "tip mass over beam mass, M/(mL)")
            .also("tip_mass_ratio").such_as(0.1)
            .of(Unit::Mass, "tip mass M", "M/(mL)");
        Alpha2 = number("alpha2", "α₂", "drive amplitude over beam gap, f/g0")
            .also("drive_amplitude").such_as(0.1)
            .of(Unit::Drive, "base amplitude f", "f/g0")
            .by_force("amplitude of the drive's force F", "F L^3/(EI g0) = 3 F/(k g0)");
        Alpha3 = number("alpha3", "α₃", "viscous damping of the beam, C·√(L⁴/(m·EI))")
            .also("beam_damping").such_as(0.1)
            .of(Unit::Damping, "damping of the whole beam C L", "C sqrt(L^4/(m EI)) = (C L) T/(m L)");
        Alpha4 = number("alpha4", "α₄", "contact stiffness over bending stiffness, K1·L³/(EI)")
            .also("contact_stiffness").when(Applies::Spring).such_as(20.0)
            .of(Unit::Stiffness, "contact stiffness K1", "K1 L^3/(EI) = 3 K1/k");
        Alpha5 = number("alpha5", "α₅", "tip gap over beam gap, g1/g0 (negative: pressed in at rest)")
            .also("gap").or(0.0).within(SIGNED)
            .of(Unit::Length, "tip gap g1", "g1/g0");
        Alpha6 = number("alpha6", "α₆", "viscous damping of the contact, (C1/L)·√(L⁴/(m·EI))")
            .also("contact_damping").when(Applies::Damper).such_as(0.2)
            .of(Unit::Damping, "contact damping C1", "(C1/L) sqrt(L^4/(m EI)) = C1 T/(m L)");
        Omega = number("omega", "Ω", "drive frequency, ω·√(mL⁴/(EI))")
            .also("drive_frequency").such_as(2.6).within(OMEGA_RANGE)
            .of(Unit::Frequency, "drive frequency", "omega sqrt(m L^4/(EI)) = 2 pi f T");
    }
    Further from Parameter::PAPER + contact::NUMBERS => {
        Tone2Amplitude = number("tone2_amplitude", "A₂", "amplitude of the second tone, measured as alpha2")
            .also("second_tone_amplitude").or(0.0).when(Applies::Tone(2)).always_written()
            .of(Unit::Drive, "base amplitude of the second tone", "f2/g0")
            .by_force("force of the second tone F2", "F2 L^3/(EI g0) = 3 F2/(k g0)");
        Tone2Phase = number("tone2_phase", "θ₂", "phase of the second tone in degrees")
            .also("second_tone_phase").or(0.0).when(Applies::Tone(2)).within(SIGNED).always_written()
            .of(Unit::Degrees, "phase of the second tone", "degrees");
        Tone3Amplitude = number("tone3_amplitude", "A₃", "amplitude of the third tone, measured as alpha2")
            .or(0.0).when(Applies::Tone(3))
            .of(Unit::Drive, "base amplitude of the third tone", "f3/g0")
            .by_force("force of the third tone F3", "F3 L^3/(EI g0) = 3 F3/(k g0)");
        Tone3Phase = number("tone3_phase", "θ₃", "phase of the third tone in degrees")
            .or(0.0).when(Applies::Tone(3)).within(SIGNED)
            .of(Unit::Degrees, "phase of the third tone", "degrees");
        Mode2Frequency = measured("mode2_frequency", "Ω₂", "measured frequency of the second free mode, as omega (0: the beam's own)")
            .of(Unit::Frequency, "frequency of the second mode", "2 pi f2 T");
        Mode3Frequency = measured("mode3_frequency", "Ω₃", "measured frequency of the third free mode, as omega (0: the beam's own)")
            .of(Unit::Frequency, "frequency of the third mode", "2 pi f3 T");
        Mode2Quality = measured("mode2_quality", "Q₂", "measured quality factor of the second free mode (0: as beam_damping has it)")
            .of(Unit::Number, "quality factor of the second mode", "Q2");
        Mode3Quality = measured("mode3_quality", "Q₃", "measured quality factor of the third free mode (0: as beam_damping has it)")
            .of(Unit::Number, "quality factor of the third mode", "Q3");
        Mode2Stiffness = measured("mode2_stiffness", "k₂", "measured stiffness of the second free mode at the tip, k2·L³/(EI) (0: the beam's own)")
            .of(Unit::Stiffness, "stiffness of the second mode", "k2 L^3/(EI) = 3 k2/k");
        Mode3Stiffness = measured("mode3_stiffness", "k₃", "measured stiffness of the third free mode at the tip, k3·L³/(EI) (0: the beam's own)")
            .of(Unit::Stiffness, "stiffness of the third mode", "k3 L^3/(EI) = 3 k3/k");
        QControlGain = number("q_control_gain", "G", "Q control: force at the tip per deflection of the tip, G·L³/(EI)")
            .or(0.0).when(Applies::NotZero)
            .of(Unit::Stiffness, "gain of Q control", "G L^3/(EI) = 3 G/k");
        QControlPhase = number("q_control_phase", "θ", "phase by which the force of Q control leads the deflection at the first resonance, in degrees: 90 raises Q, -90 lowers it")
            .or(0.0).when(Applies::NotZero).within(SIGNED).such_as(-90.0)
            .of(Unit::Degrees, "phase of Q control", "degrees");
    }
}

static TABLE: LazyLock<Vec<ParameterEntry>> = LazyLock::new(|| {
    let groups = [
        Paper::ENTRIES.to_vec(),
        contact::numbers(),
        Further::ENTRIES.to_vec(),
    ];
    groups.concat()
});

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
    /// Gain and phase of the feedback of the deflection.
    pub const Q_CONTROL: [Self; 2] = [Self::QControlGain, Self::QControlPhase];
    /// Amplitude and phase of each further tone.
    pub const TONES: [[Self; 2]; MAX_TONES - 1] = [
        [Self::Tone2Amplitude, Self::Tone2Phase],
        [Self::Tone3Amplitude, Self::Tone3Phase],
    ];
    /// Number of the paper's parameters.
    pub(crate) const PAPER: usize = Paper::ENTRIES.len();
    /// Number of parameters in the table.
    pub const COUNT: usize = Self::PAPER + contact::NUMBERS + Further::ENTRIES.len();

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

    /// Returns the index in the table of parameters, from 0.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// Returns the entry in the table of parameters.
    pub fn entry(self) -> &'static ParameterEntry {
        &TABLE[self.index()]
    }

    /// Name in messages, case files and data: `alpha1` … `alpha6`, `omega`.
    pub fn name(self) -> &'static str {
        self.entry().name
    }
}

/// The values of all parameters, dimensionless, phases in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers([f64; Parameter::COUNT]);

impl Numbers {
    /// The value 0 for every parameter.
    pub const ZERO: Self = Self([0.0; Parameter::COUNT]);

    /// The value of a parameter.
    pub const fn get(&self, parameter: Parameter) -> f64 {
        self.0[parameter.index()]
    }

    /// Sets the value of a parameter.
    pub const fn set(&mut self, parameter: Parameter, value: f64) {
        self.0[parameter.index()] = value;
    }

    /// Returns the values with that of one parameter changed.
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
