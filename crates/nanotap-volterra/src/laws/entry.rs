//! The description of a law, for case files, help, schema and figures.

/// Exponents of mass, length, time and electric charge, with the SI unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimension {
    /// Exponent of mass.
    pub mass: i8,
    /// Exponent of length.
    pub length: i8,
    /// Exponent of time.
    pub time: i8,
    /// Exponent of electric charge.
    pub charge: i8,
    /// Symbol of the SI unit, empty for a pure number.
    pub unit: &'static str,
}

impl Dimension {
    const fn new(mass: i8, length: i8, time: i8, charge: i8, unit: &'static str) -> Self {
        Self {
            mass,
            length,
            time,
            charge,
            unit,
        }
    }
    /// A pure number, without a unit.
    pub const NUMBER: Self = Self::new(0, 0, 0, 0, "");
    /// A time, s.
    pub const TIME: Self = Self::new(0, 0, 1, 0, "s");
    /// An angle, rad.
    pub const ANGLE: Self = Self::new(0, 0, 0, 0, "rad");
    /// A length, m.
    pub const LENGTH: Self = Self::new(0, 1, 0, 0, "m");
    /// A pressure or modulus, Pa.
    pub const PRESSURE: Self = Self::new(1, -1, -2, 0, "Pa");
    /// An energy, J.
    pub const ENERGY: Self = Self::new(1, 2, -2, 0, "J");
    /// An energy per area or a force per length, J/m².
    pub const SURFACE_ENERGY: Self = Self::new(1, 0, -2, 0, "J/m²");
    /// A force per length, N/m.
    pub const STIFFNESS: Self = Self::new(1, 0, -2, 0, "N/m");
    /// A force, N.
    pub const FORCE: Self = Self::new(1, 1, -2, 0, "N");
    /// A force per velocity, N s/m.
    pub const DAMPING: Self = Self::new(1, 0, -1, 0, "N s/m");
    /// A dynamic viscosity, Pa s.
    pub const VISCOSITY: Self = Self::new(1, -1, -1, 0, "Pa s");
    /// A repulsive Lennard-Jones constant, J m⁶.
    pub const REPULSION: Self = Self::new(1, 8, -2, 0, "J m⁶");
    /// A voltage, V.
    pub const VOLTAGE: Self = Self::new(1, 2, -2, -1, "V");
    /// A permittivity, F/m.
    pub const PERMITTIVITY: Self = Self::new(-1, -3, 2, 2, "F/m");
    /// A charge per area, C/m².
    pub const CHARGE_DENSITY: Self = Self::new(0, -2, 0, 1, "C/m²");
}

/// A parameter of a law, with its unit, default and range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterEntry {
    /// Key in case files and messages.
    pub name: &'static str,
    /// Description in a few words, without a unit.
    pub words: &'static str,
    /// Physical dimension, with its SI unit.
    pub dimension: Dimension,
    /// Default value in SI units; `None` if a value is required.
    pub default: Option<f64>,
    /// Range of the values that are accepted.
    pub range: Range,
}

/// The values that a parameter accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Above zero and finite.
    Positive,
    /// Above zero, infinity included (a rigid body).
    PositiveOrInfinite,
    /// Zero or above, finite.
    NotNegative,
    /// From −1 to ½ (Poisson's ratio).
    Poisson,
    /// Above 0 and below π/2 rad (90 degrees).
    Angle,
    /// Any finite number.
    Finite,
}

impl Range {
    /// Reports whether the range contains a value.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::Positive => value > 0.0 && value.is_finite(),
            Self::PositiveOrInfinite => value > 0.0,
            Self::NotNegative => value >= 0.0 && value.is_finite(),
            Self::Poisson => (-1.0..=0.5).contains(&value),
            Self::Angle => value > 0.0 && value < std::f64::consts::FRAC_PI_2,
            Self::Finite => value.is_finite(),
        }
    }

    /// Returns a description of the range for messages.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Positive => "positive and finite",
            Self::PositiveOrInfinite => "positive (infinite: rigid)",
            Self::NotNegative => "zero or positive, and finite",
            Self::Poisson => "between −1 and ½",
            Self::Angle => "between 0 and 90 degrees",
            Self::Finite => "finite",
        }
    }
}

/// The part of the interaction that a law describes; two laws with the same part cannot be added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The elastic repulsion of the bodies in contact.
    Elasticity,
    /// The attraction of the bodies, in contact or across the gap.
    Adhesion,
}

/// The description of a law in the table of laws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Name in case files.
    pub name: &'static str,
    /// Description of the law in one line.
    pub words: &'static str,
    /// Formula of the force as text, in the symbols of the law's source.
    pub formula: &'static str,
    /// Publication from which the formula is taken.
    pub source: &'static str,
    /// Parameters, in the order of the formula.
    pub parameters: &'static [ParameterEntry],
    /// Parts of the interaction that must not be counted twice in a sum of laws.
    pub parts: &'static [Part],
    /// Whether the force depends on the gap alone, without a memory.
    pub conservative: bool,
}

/// Creates an entry for a parameter.
pub const fn own(
    name: &'static str,
    words: &'static str,
    dimension: Dimension,
    default: Option<f64>,
    range: Range,
) -> ParameterEntry {
    ParameterEntry {
        name,
        words,
        dimension,
        default,
        range,
    }
}

/// Young's modulus of the sample, Pa.
pub const MODULUS: ParameterEntry = own(
    "modulus",
    "Young's modulus of the sample",
    Dimension::PRESSURE,
    None,
    Range::Positive,
);
/// Poisson's ratio of the sample, dimensionless.
pub const POISSON: ParameterEntry = own(
    "poisson",
    "Poisson's ratio of the sample",
    Dimension::NUMBER,
    Some(0.3),
    Range::Poisson,
);
/// Young's modulus of the tip, Pa; infinite for a rigid tip.
pub const TIP_MODULUS: ParameterEntry = own(
    "tip_modulus",
    "Young's modulus of the tip",
    Dimension::PRESSURE,
    Some(f64::INFINITY),
    Range::PositiveOrInfinite,
);
/// Poisson's ratio of the tip, dimensionless.
pub const TIP_POISSON: ParameterEntry = own(
    "tip_poisson",
    "Poisson's ratio of the tip",
    Dimension::NUMBER,
    Some(0.3),
    Range::Poisson,
);
/// Radius of a spherical tip or of a flat punch, m.
pub const RADIUS: ParameterEntry = own(
    "radius",
    "radius of the tip",
    Dimension::LENGTH,
    None,
    Range::Positive,
);
/// Half angle of a conical tip, rad.
pub const HALF_ANGLE: ParameterEntry = own(
    "half_angle",
    "half angle of the conical tip",
    Dimension::ANGLE,
    None,
    Range::Angle,
);
/// Gap at which contact begins, m.
pub const CONTACT_DISTANCE: ParameterEntry = own(
    "contact_distance",
    "intermolecular distance a0, the gap at which contact begins",
    Dimension::LENGTH,
    Some(0.165e-9),
    Range::Finite,
);
/// Hamaker constant of tip, medium and sample, J.
pub const HAMAKER: ParameterEntry = own(
    "hamaker",
    "Hamaker constant of tip, medium and sample",
    Dimension::ENERGY,
    None,
    Range::Finite,
);
/// Work of adhesion per area, J/m².
pub const WORK_OF_ADHESION: ParameterEntry = own(
    "work_of_adhesion",
    "work of adhesion",
    Dimension::SURFACE_ENERGY,
    None,
    Range::Positive,
);
/// Dynamic viscosity of the sample, Pa s.
pub const VISCOSITY: ParameterEntry = own(
    "viscosity",
    "viscosity of the sample",
    Dimension::VISCOSITY,
    None,
    Range::NotNegative,
);
/// Thickness of the sample, m.
pub const THICKNESS: ParameterEntry = own(
    "thickness",
    "thickness of the sample on its rigid support",
    Dimension::LENGTH,
    None,
    Range::Positive,
);
