//! What was measured of the second and third free mode.

use serde::{Serialize, Serializer};

use crate::model::parameter::Parameter;

/// Measured numbers of the second and third mode; 0 where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HigherModes {
    /// Frequencies, as Ω (or in Hz among physical quantities).
    pub frequency: [f64; 2],
    /// Quality factors.
    pub quality: [f64; 2],
    /// Stiffnesses at the tip, over EI/L³ (or in N/m).
    pub stiffness: [f64; 2],
}

impl HigherModes {
    /// Nothing measured.
    pub const NONE: Self = Self {
        frequency: [0.0; 2],
        quality: [0.0; 2],
        stiffness: [0.0; 2],
    };

    /// What `other` has where nothing was measured.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        let first = |own: [f64; 2], other: [f64; 2]| {
            [0, 1].map(|k| if own[k] == 0.0 { other[k] } else { own[k] })
        };
        Self {
            frequency: first(self.frequency, other.frequency),
            quality: first(self.quality, other.quality),
            stiffness: first(self.stiffness, other.stiffness),
        }
    }

    /// Whether nothing was measured.
    pub fn is_empty(&self) -> bool {
        *self == Self::NONE
    }
}

/// The keys of a case for what was measured, nothing else.
impl Serialize for HigherModes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let numbers = [
            (Parameter::Mode2Frequency, self.frequency[0]),
            (Parameter::Mode3Frequency, self.frequency[1]),
            (Parameter::Mode2Quality, self.quality[0]),
            (Parameter::Mode3Quality, self.quality[1]),
            (Parameter::Mode2Stiffness, self.stiffness[0]),
            (Parameter::Mode3Stiffness, self.stiffness[1]),
        ];
        let measured = numbers.iter().filter(|(_, number)| *number != 0.0);
        serializer.collect_map(measured.map(|(parameter, number)| (parameter.name(), number)))
    }
}
