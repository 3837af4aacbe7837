//! The description of a law, for case files, help, schema and figures.

/// Exponents of mass, length, time and electric charge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimension {
    /// Of mass.
    pub mass: i8,
    /// Of length.
    pub length: i8,
    /// Of time.
    pub time: i8,
    /// Of charge.
    pub charge: i8,
    /// The SI unit.
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
    /// A pure number.
    pub const NUMBER: Self = Self::new(0, 0, 0, 0, "");
    /// A time.
    pub const TIME: Self = Self::new(0, 0, 1, 0, "s");
    /// An angle, in radians.
    pub const ANGLE: Self = Self::new(0, 0, 0, 0, "rad");
    /// A length.
    pub const LENGTH: Self = Self::new(0, 1, 0, 0, "m");
    /// A pressure or modulus.
    pub const PRESSURE: Self = Self::new(1, -1, -2, 0, "Pa");
    /// An energy.
    pub const ENERGY: Self = Self::new(1, 2, -2, 0, "J");
    /// An energy an area, or a force a length.
    pub const SURFACE_ENERGY: Self = Self::new(1, 0, -2, 0, "J/m²");
    /// A force a length.
    pub const STIFFNESS: Self = Self::new(1, 0, -2, 0, "N/m");
    /// A force.
    pub const FORCE: Self = Self::new(1, 1, -2, 0, "N");
    /// A force a velocity.
    pub const DAMPING: Self = Self::new(1, 0, -1, 0, "N s/m");
    /// A dynamic viscosity.
    pub const VISCOSITY: Self = Self::new(1, -1, -1, 0, "Pa s");
    /// An energy a volume to the eighth power of a length (repulsive Lennard-Jones constant).
    pub const REPULSION: Self = Self::new(1, 8, -2, 0, "J m⁶");
    /// A voltage.
    pub const VOLTAGE: Self = Self::new(1, 2, -2, -1, "V");
    /// A permittivity.
    pub const PERMITTIVITY: Self = Self::new(-1, -3, 2, 2, "F/m");
    /// A charge an area.
    pub const CHARGE_DENSITY: Self = Self::new(0, -2, 0, 1, "C/m²");
}

/// A parameter of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterEntry {
    /// Its key.
    pub name: &'static str,
    /// What it is.
    pub words: &'static str,
    /// Its dimension.
    pub dimension: Dimension,
    /// Its value in SI where none is given; none if one must be.
    pub default: Option<f64>,
    /// What values make sense.
    pub range: Range,
}

/// The values that make sense.
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
    /// Between 0 and 90 degrees.
    Angle,
    /// Any finite number.
    Finite,
}

impl Range {
    /// Whether a value makes sense.
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

    /// In words.
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

/// What part of the interaction a law describes; two laws with the same part cannot be added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The elastic repulsion of the bodies in contact.
    Elasticity,
    /// Their attraction, in contact or across the gap.
    Adhesion,
}

/// An entry of the table of laws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// The name in a case file.
    pub name: &'static str,
    /// Description in one line.
    pub words: &'static str,
    /// The force as text.
    pub formula: &'static str,
    /// Reference.
    pub source: &'static str,
    /// The parameters, in the order of the formula's own.
    pub parameters: &'static [ParameterEntry],
    /// What it contributes that must not be counted twice.
    pub parts: &'static [Part],
    /// Whether the force depends on the gap alone, without a memory.
    pub conservative: bool,
}

/// A parameter of the table of laws.
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

/// Young's modulus of the sample.
pub const MODULUS: ParameterEntry = own(
    "modulus",
    "Young's modulus of the sample",
    Dimension::PRESSURE,
    None,
    Range::Positive,
);
/// Poisson's ratio of the sample.
pub const POISSON: ParameterEntry = own(
    "poisson",
    "Poisson's ratio of the sample",
    Dimension::NUMBER,
    Some(0.3),
    Range::Poisson,
);
/// Young's modulus of the tip.
pub const TIP_MODULUS: ParameterEntry = own(
    "tip_modulus",
    "Young's modulus of the tip",
    Dimension::PRESSURE,
    Some(f64::INFINITY),
    Range::PositiveOrInfinite,
);
/// Poisson's ratio of the tip.
pub const TIP_POISSON: ParameterEntry = own(
    "tip_poisson",
    "Poisson's ratio of the tip",
    Dimension::NUMBER,
    Some(0.3),
    Range::Poisson,
);
/// The radius of a spherical tip or of a flat punch.
pub const RADIUS: ParameterEntry = own(
    "radius",
    "radius of the tip",
    Dimension::LENGTH,
    None,
    Range::Positive,
);
/// The half angle of a conical tip.
pub const HALF_ANGLE: ParameterEntry = own(
    "half_angle",
    "half angle of the conical tip",
    Dimension::ANGLE,
    None,
    Range::Angle,
);
/// The gap at which contact begins.
pub const CONTACT_DISTANCE: ParameterEntry = own(
    "contact_distance",
    "intermolecular distance a0, the gap at which contact begins",
    Dimension::LENGTH,
    Some(0.165e-9),
    Range::Finite,
);
/// Hamaker's constant.
pub const HAMAKER: ParameterEntry = own(
    "hamaker",
    "Hamaker constant of tip, medium and sample",
    Dimension::ENERGY,
    None,
    Range::Finite,
);
/// The work of adhesion.
pub const WORK_OF_ADHESION: ParameterEntry = own(
    "work_of_adhesion",
    "work of adhesion",
    Dimension::SURFACE_ENERGY,
    None,
    Range::Positive,
);
/// A dynamic viscosity of the sample.
pub const VISCOSITY: ParameterEntry = own(
    "viscosity",
    "viscosity of the sample",
    Dimension::VISCOSITY,
    None,
    Range::NotNegative,
);
/// The thickness of the sample.
pub const THICKNESS: ParameterEntry = own(
    "thickness",
    "thickness of the sample on its rigid support",
    Dimension::LENGTH,
    None,
    Range::Positive,
);
