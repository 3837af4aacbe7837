//! The drive at the clamped end, and the gaps to the sample.

use super::error::PhysicalError;
use super::quantity::{Kind, Quantity};
use super::section::{Reader, Sections};

/// Frequency of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DriveFrequency {
    /// In Hz.
    Absolute(f64),
    /// In units of the lever's first free resonance f₀.
    Ratio(f64),
}

/// Strength of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DriveStrength {
    /// Amplitude f of the clamped end, in m.
    Base(f64),
    /// Free amplitude A₀: what the tip's deflection reaches far from the sample at the drive
    /// frequency, in m.
    Free(f64),
}

/// Amplitude that the feedback holds near the sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Setpoint {
    /// As a fraction of A₀.
    Ratio(f64),
    /// In m.
    Amplitude(f64),
}

/// The section `[drive]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Its frequency.
    pub frequency: DriveFrequency,
    /// Its strength.
    pub strength: DriveStrength,
    /// The setpoint, for experiments that solve for the gap.
    pub setpoint: Option<Setpoint>,
}

pub(crate) const DRIVE_KEYS: &[&str] = &[
    "frequency",
    "frequency_ratio",
    "amplitude",
    "free_amplitude",
    "setpoint",
];

pub(crate) const GAP_KEYS: &[&str] = &["tip", "beam"];

impl Drive {
    /// The section `[drive]`.
    pub(crate) fn read(sections: &Sections) -> Result<Self, PhysicalError> {
        let reader = Reader::new(sections, "drive", DRIVE_KEYS)?;
        reader.not_both("frequency", "frequency_ratio", "each gives the frequency")?;
        reader.not_both(
            "amplitude",
            "free_amplitude",
            "one follows from the other through the lever's free response",
        )?;
        let frequency = reader.positive("frequency", Kind::Frequency)?;
        let ratio = reader.positive("frequency_ratio", Kind::Number)?;
        let frequency = frequency
            .map(DriveFrequency::Absolute)
            .or(ratio.map(DriveFrequency::Ratio))
            .ok_or_else(|| {
                PhysicalError::missing(
                    reader.path("frequency"),
                    "give it, or drive.frequency_ratio in units of f0",
                )
            })?;
        let base = reader.not_negative("amplitude", Kind::Length)?;
        let free = reader.not_negative("free_amplitude", Kind::Length)?;
        let strength = base
            .map(DriveStrength::Base)
            .or(free.map(DriveStrength::Free))
            .ok_or_else(|| {
                PhysicalError::missing(
                    reader.path("amplitude"),
                    "give the amplitude of the clamped end, or drive.free_amplitude of the tip",
                )
            })?;
        Ok(Self {
            frequency,
            strength,
            setpoint: read_setpoint(&reader)?,
        })
    }
}

/// A ratio ("0.8", "80 %") or an amplitude ("8 nm").
fn read_setpoint(reader: &Reader<'_>) -> Result<Option<Setpoint>, PhysicalError> {
    let Some(text) = reader.text("setpoint") else {
        return Ok(None);
    };
    let is_length = |read: Quantity| read.dimension == Kind::Length.dimension();
    if text.parse::<Quantity>().is_ok_and(is_length) {
        let amplitude = reader.positive("setpoint", Kind::Length)?;
        return Ok(amplitude.map(Setpoint::Amplitude));
    }
    let ratio = reader.within(
        "setpoint",
        Kind::Number,
        |ratio| ratio > 0.0 && ratio < 1.0,
        "a setpoint is a fraction of the free amplitude between 0 and 1, or an amplitude \
         such as \"8 nm\"",
    )?;
    Ok(ratio.map(Setpoint::Ratio))
}

/// The section `[gap]`: distances at rest, in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaps {
    /// Between tip and sample, g₁; negative where the sample stands beyond the tip's rest
    /// position.
    pub tip: Option<f64>,
    /// Between beam and sample, g₀.
    pub beam: Option<f64>,
}

impl Gaps {
    /// The section `[gap]`.
    pub(crate) fn read(sections: &Sections) -> Result<Self, PhysicalError> {
        let reader = Reader::new(sections, "gap", GAP_KEYS)?;
        Ok(Self {
            tip: reader.quantity("tip", Kind::Length)?,
            beam: reader.positive("beam", Kind::Length)?,
        })
    }
}
