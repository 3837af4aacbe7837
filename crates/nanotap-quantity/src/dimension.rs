//! Dimensions of quantities, as exponents of base units.

use std::fmt;

use crate::Kind;

/// Exponents of the base units kilogram, metre, second, radian and coulomb.
///
/// The radian counts as a base unit here, so that an angular frequency in rad/s cannot be confused
/// with a frequency in Hz, a factor of 2π.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
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
    /// The dimension of a pure number.
    pub const NONE: Self = Self::new(0, 0, 0);
    /// The dimension of an angle.
    pub const ANGLE: Self = Self {
        angle: 1,
        ..Self::NONE
    };
    /// The dimension of an electric charge.
    pub const CHARGE: Self = Self::NONE.charged(1);

    /// Creates a dimension from the exponents of kilogram, metre and second.
    pub const fn new(mass: i32, length: i32, time: i32) -> Self {
        Self {
            mass,
            length,
            time,
            angle: 0,
            charge: 0,
        }
    }

    /// Sets the exponent of the coulomb.
    #[must_use]
    pub const fn charged(self, charge: i32) -> Self {
        Self { charge, ..self }
    }

    /// Whether it is that of a pure number.
    pub const fn is_none(self) -> bool {
        matches!(
            self,
            Self {
                mass: 0,
                length: 0,
                time: 0,
                angle: 0,
                charge: 0
            }
        )
    }

    pub(crate) fn times(self, other: Self, power: i32) -> Self {
        Self {
            mass: self.mass + power * other.mass,
            length: self.length + power * other.length,
            time: self.time + power * other.time,
            angle: self.angle + power * other.angle,
            charge: self.charge + power * other.charge,
        }
    }

    /// Returns the exponents of force, length and time in place of mass, length and time.
    pub const fn of_force(self) -> [i32; 3] {
        [
            self.mass,
            self.length - self.mass,
            self.time + 2 * self.mass,
        ]
    }

    /// Returns the first of [`Kind::ALL`] that has this dimension.
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
