//! A contact law in numbers.

use nanotap_flow::Onset;

use super::dual::Dual;

/// `height · V_T + rate · V̇_T + memory · s + constant`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Combination {
    pub(crate) height: Dual,
    pub(crate) rate: Dual,
    pub(crate) memory: Dual,
    pub(crate) constant: Dual,
}

impl Combination {
    pub(crate) fn height(factor: Dual) -> Self {
        Self {
            height: factor,
            ..Self::default()
        }
    }

    pub(crate) fn rate(factor: Dual) -> Self {
        Self {
            rate: factor,
            ..Self::default()
        }
    }

    pub(crate) fn memory(factor: Dual) -> Self {
        Self {
            memory: factor,
            ..Self::default()
        }
    }

    pub(crate) fn constant(constant: Dual) -> Self {
        Self {
            constant,
            ..Self::default()
        }
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        Self {
            height: self.height + other.height,
            rate: self.rate + other.rate,
            memory: self.memory + other.memory,
            constant: self.constant + other.constant,
        }
    }

    pub(crate) fn times(self, factor: Dual) -> Self {
        Self {
            height: self.height * factor,
            rate: self.rate * factor,
            memory: self.memory * factor,
            constant: self.constant * factor,
        }
    }
}

/// `weight · combination²`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Square {
    pub(crate) weight: f64,
    pub(crate) of: Combination,
}

/// `weight · one · other`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bilinear {
    pub(crate) weight: f64,
    pub(crate) one: Combination,
    pub(crate) other: Combination,
}

impl From<Square> for Bilinear {
    fn from(square: Square) -> Self {
        Self {
            weight: square.weight,
            one: square.of,
            other: square.of,
        }
    }
}

/// What the sample does while the tip is away, or while it touches.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Answer {
    /// Force on the tip.
    pub(crate) force: Combination,
    /// ṡ of a surface with a memory.
    pub(crate) memory_rate: Combination,
    /// Power that the sample takes.
    pub(crate) dissipated: Vec<Square>,
    /// Energy that it stores.
    pub(crate) stored: Vec<Bilinear>,
}

/// A contact law.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Law {
    /// Whether the surface has a memory `s`.
    pub(crate) has_memory: bool,
    /// The tip's height over the free surface; contact begins where it falls to zero.
    pub(crate) gap: Combination,
    /// Contact ends where this falls to zero.
    pub(crate) hold: Combination,
    /// What `s` becomes when contact ends, if it jumps.
    pub(crate) left: Option<Combination>,
    /// What is known of the guards when contact begins and ends, if they are not each
    /// other's negatives.
    pub(crate) onsets: Option<[Onset; 2]>,
    /// In flight.
    pub(crate) flight: Answer,
    /// In contact.
    pub(crate) contact: Answer,
    /// Whether in contact the beam moves as one with spring α4 and damper α6 at its tip, its
    /// memory apart, so that its spectrum is known.
    pub(crate) plain_contact: bool,
}
