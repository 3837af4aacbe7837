//! The numbers of the dimensionless model: the paper's seven,
//! and those that only some samples and drives have.

use std::fmt;

use serde::{Serialize, Serializer};

/// A dimensionless parameter of the model, Eqs. (5) and (7) of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Parameter {
    /// α1 = M/(mL): tip mass over beam mass.
    Alpha1,
    /// α2 = f/g₀: drive amplitude over the beam's gap.
    Alpha2,
    /// α3 = C√(L⁴/(m EI)): damping of the beam.
    Alpha3,
    /// α4 = K₁L³/(EI): contact stiffness over bending stiffness.
    Alpha4,
    /// α5 = g₁/g₀: the tip's gap over the beam's gap.
    Alpha5,
    /// α6 = (C₁/L)√(L⁴/(m EI)): damping of the contact.
    Alpha6,
    /// Ω = ω√(mL⁴/(EI)): drive frequency.
    Omega,
    /// k_m L³/(EI): stiffness of the standard linear solid's relaxing arm over bending
    /// stiffness.
    RelaxationStiffness,
    /// Time in which the force of that arm decays at constant indentation, in the model's
    /// unit of time √(mL⁴/(EI)).
    RelaxationTime,
    /// k_s L³/(EI): a moving surface's own stiffness over bending stiffness.
    SurfaceStiffness,
    /// Its own damping, as α6.
    SurfaceDamping,
    /// F L³/(EI g₀): force that pulls a touching tip to a moving surface.
    AdhesionForce,
    /// Amplitude of the second tone, measured as α2.
    Tone2Amplitude,
    /// Phase θ of the second tone in degrees: it is sin(ρΩτ + θ), ρ the ratio of frequencies.
    Tone2Phase,
    /// Measured frequency of the second free mode, as Ω.
    Mode2Frequency,
    /// Measured frequency of the third free mode, as Ω.
    Mode3Frequency,
    /// Measured quality factor of the second free mode.
    Mode2Quality,
    /// Measured quality factor of the third free mode.
    Mode3Quality,
    /// Measured stiffness k₂L³/(EI) of the second free mode at the tip.
    Mode2Stiffness,
    /// Measured stiffness k₃L³/(EI) of the third free mode at the tip.
    Mode3Stiffness,
}

impl Parameter {
    /// The paper's parameters, which every case has: α1 to α6 and then Ω.
    pub const ALL: [Self; 7] = [
        Self::Alpha1,
        Self::Alpha2,
        Self::Alpha3,
        Self::Alpha4,
        Self::Alpha5,
        Self::Alpha6,
        Self::Omega,
    ];

    /// Parameters that only some samples, drives and levers have; 0 where they are not said.
    pub const FURTHER: [Self; 13] = [
        Self::RelaxationStiffness,
        Self::RelaxationTime,
        Self::SurfaceStiffness,
        Self::SurfaceDamping,
        Self::AdhesionForce,
        Self::Tone2Amplitude,
        Self::Tone2Phase,
        Self::Mode2Frequency,
        Self::Mode3Frequency,
        Self::Mode2Quality,
        Self::Mode3Quality,
        Self::Mode2Stiffness,
        Self::Mode3Stiffness,
    ];

    /// Every parameter there is.
    pub fn every() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().chain(Self::FURTHER)
    }

    /// The name in refusals, in case files and in data: `alpha1` … `alpha6`, `omega`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Alpha1 => "alpha1",
            Self::Alpha2 => "alpha2",
            Self::Alpha3 => "alpha3",
            Self::Alpha4 => "alpha4",
            Self::Alpha5 => "alpha5",
            Self::Alpha6 => "alpha6",
            Self::Omega => "omega",
            Self::RelaxationStiffness => "relaxation_stiffness",
            Self::RelaxationTime => "relaxation_time",
            Self::SurfaceStiffness => "surface_stiffness",
            Self::SurfaceDamping => "surface_damping",
            Self::AdhesionForce => "adhesion_force",
            Self::Tone2Amplitude => "tone2_amplitude",
            Self::Tone2Phase => "tone2_phase",
            Self::Mode2Frequency => "mode2_frequency",
            Self::Mode3Frequency => "mode3_frequency",
            Self::Mode2Quality => "mode2_quality",
            Self::Mode3Quality => "mode3_quality",
            Self::Mode2Stiffness => "mode2_stiffness",
            Self::Mode3Stiffness => "mode3_stiffness",
        }
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
