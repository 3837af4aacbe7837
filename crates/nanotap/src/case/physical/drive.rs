//! The drive, at the clamped end or on the lever itself, and the gaps to the sample.

use super::error::PhysicalError;
use super::quantity::{Kind, Quantity};
use super::section::{Reader, Sections};
use crate::model::drive_form::{Actuation, FrequencyRatio, RatioError, UnknownActuation};

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
                    "drive.second_frequency",
                    Kind::Frequency.format_digits(second, 12),
                    format!("{error}; say that by drive.second_ratio{nearest}"),
                )
            }),
        }
    }
}

pub(crate) const DRIVE_KEYS: &[&str] = &[
    "frequency",
    "frequency_ratio",
    "amplitude",
    "force",
    "free_amplitude",
    "setpoint",
    "actuation",
    "second_frequency",
    "second_ratio",
    "second_amplitude",
    "second_force",
    "second_free_amplitude",
    "second_phase",
];

pub(crate) const GAP_KEYS: &[&str] = &["tip", "beam"];

impl Drive {
    /// The section `[drive]`.
    pub(crate) fn read(sections: &Sections) -> Result<Self, PhysicalError> {
        let reader = Reader::new(sections, "drive", DRIVE_KEYS)?;
        reader.not_both("frequency", "frequency_ratio", "each gives the frequency")?;
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
        let actuation = read_actuation(&reader)?;
        let strength = read_strength(&reader, actuation, ["amplitude", "force", "free_amplitude"])?
            .ok_or_else(|| {
                let (key, what) = match actuation {
                    Actuation::Base => ("amplitude", "the amplitude of the clamped end"),
                    _ => ("force", "the amplitude of the force on the lever"),
                };
                PhysicalError::missing(
                    reader.path(key),
                    format!("give {what}, or drive.free_amplitude of the tip"),
                )
            })?;
        Ok(Self {
            frequency,
            strength,
            setpoint: read_setpoint(&reader)?,
            actuation,
            second: read_second(&reader, actuation)?,
        })
    }
}

fn read_actuation(reader: &Reader<'_>) -> Result<Actuation, PhysicalError> {
    reader
        .text("actuation")
        .map_or(Ok(Actuation::default()), |name| {
            name.parse().map_err(|error: UnknownActuation| {
                PhysicalError::impossible(reader.path("actuation"), name, error.to_string())
            })
        })
}

/// A motion of the base, a force on the lever, or a free amplitude of the tip, under these
/// keys.
fn read_strength(
    reader: &Reader<'_>,
    actuation: Actuation,
    [motion, force, free]: [&'static str; 3],
) -> Result<Option<DriveStrength>, PhysicalError> {
    let (key, kind, other, why) = match actuation {
        Actuation::Base => (
            motion,
            Kind::Length,
            force,
            "a drive through the base has an amplitude, not a force; say drive.actuation = \
             \"tip\" or \"distributed\" for one on the lever itself",
        ),
        Actuation::Tip | Actuation::Distributed => (
            force,
            Kind::Force,
            motion,
            "a drive on the lever itself has a force; the base is at rest",
        ),
    };
    if let Some(text) = reader.text(other) {
        return Err(PhysicalError::impossible(reader.path(other), text, why));
    }
    reader.not_both(
        key,
        free,
        "one follows from the other through the lever's free response",
    )?;
    let applied = reader.not_negative(key, kind)?;
    let free = reader.not_negative(free, Kind::Length)?;
    Ok(applied
        .map(DriveStrength::Applied)
        .or(free.map(DriveStrength::Free)))
}

fn read_second(
    reader: &Reader<'_>,
    actuation: Actuation,
) -> Result<Option<SecondTone>, PhysicalError> {
    reader.not_both(
        "second_frequency",
        "second_ratio",
        "each gives the frequency",
    )?;
    let absolute = reader.positive("second_frequency", Kind::Frequency)?;
    let ratio = reader
        .text("second_ratio")
        .map(|text| {
            text.parse().map_err(|error: RatioError| {
                PhysicalError::impossible(reader.path("second_ratio"), text, error.to_string())
            })
        })
        .transpose()?;
    let strength = read_strength(
        reader,
        actuation,
        ["second_amplitude", "second_force", "second_free_amplitude"],
    )?;
    let phase = reader.quantity("second_phase", Kind::Angle)?;
    let frequency = absolute
        .map(SecondFrequency::Absolute)
        .or(ratio.map(SecondFrequency::Ratio));
    match (frequency, strength) {
        (Some(frequency), Some(strength)) => Ok(Some(SecondTone {
            frequency,
            strength,
            phase: phase.unwrap_or(0.0),
        })),
        (None, None) if phase.is_none() => Ok(None),
        (None, _) => Err(PhysicalError::missing(
            reader.path("second_frequency"),
            "the second tone needs a frequency, or drive.second_ratio as in \"25/4\"",
        )),
        (Some(_), None) => Err(PhysicalError::missing(
            reader.path("second_free_amplitude"),
            "the second tone needs a strength: its free amplitude, or second_amplitude of the \
             base or second_force on the lever",
        )),
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
