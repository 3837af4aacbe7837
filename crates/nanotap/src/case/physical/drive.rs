//! The drive, at the clamped end or on the lever itself, and the gaps to the sample.

use super::error::PhysicalError;
use super::reader::Reader;
use crate::case::key::Key;
use crate::case::quantity::Kind;
use crate::case::stated::Value;
use crate::model::drive_form::{Actuation, FrequencyRatio, RatioError};

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
    /// Amplitude of the drive: of the clamped end's motion, in m, or of a force on the lever,
    /// in N.
    Applied(f64),
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
    /// Where it acts.
    pub actuation: Actuation,
    /// The second tone, if there is one.
    pub second: Option<SecondTone>,
}

/// A second tone of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondTone {
    /// Its frequency over that of the first.
    pub frequency: SecondFrequency,
    /// Its strength.
    pub strength: DriveStrength,
    /// Its phase in rad.
    pub phase: f64,
}

/// Frequency of the second tone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SecondFrequency {
    /// In Hz; it must be a ratio of small whole numbers to the first one's.
    Absolute(f64),
    /// As a ratio to the first one's.
    Ratio(FrequencyRatio),
}

impl SecondFrequency {
    /// The ratio to a first tone of `frequency` Hz.
    pub(crate) fn ratio(self, frequency: f64) -> Result<FrequencyRatio, PhysicalError> {
        match self {
            Self::Ratio(ratio) => Ok(ratio),
            Self::Absolute(second) => FrequencyRatio::of(second / frequency).map_err(|error| {
                let nearest = match &error {
                    RatioError::Irrational { nearest, .. } => format!(
                        ", or drive.second_frequency = {}",
                        Kind::Frequency.format_digits(nearest.value() * frequency, 12)
                    ),
                    _ => String::new(),
                };
                PhysicalError::impossible(
                    Key::SecondFrequency,
                    Kind::Frequency.format_digits(second, 12),
                    format!("{error}; say that by drive.second_ratio{nearest}"),
                )
            }),
        }
    }
}

impl Drive {
    /// Reads `[drive]`.
    pub(crate) fn read(reader: Reader<'_>) -> Result<Self, PhysicalError> {
        let frequency = reader.number(Key::DriveFrequency)?;
        let ratio = reader.number(Key::DriveFrequencyRatio)?;
        let frequency = frequency
            .map(DriveFrequency::Absolute)
            .or(ratio.map(DriveFrequency::Ratio))
            .ok_or_else(|| {
                PhysicalError::missing(
                    Key::DriveFrequency,
                    "give it, or drive.frequency_ratio in units of f0",
                )
            })?;
        let actuation =
            crate::case::file::word(reader.stated, Key::DriveActuation).unwrap_or_default();
        let strength = read_strength(reader, actuation, FIRST)?.ok_or_else(|| {
            let (key, what) = match actuation {
                Actuation::Base => (Key::DriveAmplitude, "the amplitude of the clamped end"),
                _ => (Key::DriveForce, "the amplitude of the force on the lever"),
            };
            PhysicalError::missing(
                key,
                format!("give {what}, or drive.free_amplitude of the tip"),
            )
        })?;
        Ok(Self {
            frequency,
            strength,
            setpoint: read_setpoint(reader)?,
            actuation,
            second: read_second(reader, actuation)?,
        })
    }
}

/// Keys for the strength of a tone: motion of the base, force on the lever, free amplitude of the
/// tip.
pub(crate) const FIRST: [Key; 3] = [
    Key::DriveAmplitude,
    Key::DriveForce,
    Key::DriveFreeAmplitude,
];

/// Keys for the strength of the second tone.
pub(crate) const SECOND: [Key; 3] = [
    Key::SecondAmplitude,
    Key::SecondForce,
    Key::SecondFreeAmplitude,
];

/// A motion of the base, a force on the lever, or a free amplitude of the tip, under these
/// keys.
fn read_strength(
    reader: Reader<'_>,
    actuation: Actuation,
    [motion, force, free]: [Key; 3],
) -> Result<Option<DriveStrength>, PhysicalError> {
    let (key, other, why) = match actuation {
        Actuation::Base => (
            motion,
            force,
            "a drive through the base has an amplitude, not a force; say drive.actuation = \
             \"tip\" or \"distributed\" for one on the lever itself",
        ),
        Actuation::Tip | Actuation::Distributed => (
            force,
            motion,
            "a drive on the lever itself has a force; the base is at rest",
        ),
    };
    if reader.has(other) {
        return Err(reader.impossible(other, why));
    }
    let applied = reader.number(key)?.map(DriveStrength::Applied);
    let free = reader.number(free)?.map(DriveStrength::Free);
    Ok(applied.or(free))
}

fn read_second(
    reader: Reader<'_>,
    actuation: Actuation,
) -> Result<Option<SecondTone>, PhysicalError> {
    let absolute = reader.number(Key::SecondFrequency)?;
    let strength = read_strength(reader, actuation, SECOND)?;
    let phase = reader.number(Key::SecondPhase)?;
    let frequency = absolute
        .map(SecondFrequency::Absolute)
        .or(reader.ratio(Key::SecondRatio).map(SecondFrequency::Ratio));
    match (frequency, strength) {
        (Some(frequency), Some(strength)) => Ok(Some(SecondTone {
            frequency,
            strength,
            phase: phase.unwrap_or(0.0),
        })),
        (None, None) if phase.is_none() => Ok(None),
        (None, _) => Err(PhysicalError::missing(
            Key::SecondFrequency,
            "the second tone needs a frequency, or drive.second_ratio as in \"25/4\"",
        )),
        (Some(_), None) => Err(PhysicalError::missing(
            Key::SecondFreeAmplitude,
            "the second tone needs a strength: its free amplitude, or second_amplitude of the \
             base or second_force on the lever",
        )),
    }
}

/// A fraction ("0.8", "80 %") or an amplitude ("8 nm").
fn read_setpoint(reader: Reader<'_>) -> Result<Option<Setpoint>, PhysicalError> {
    let Some(value) = reader.number(Key::DriveSetpoint)? else {
        return Ok(None);
    };
    Ok(Some(match reader.stated.get(Key::DriveSetpoint) {
        Some(Value::Number(_, Kind::Length)) => Setpoint::Amplitude(value),
        _ => Setpoint::Ratio(value),
    }))
}
