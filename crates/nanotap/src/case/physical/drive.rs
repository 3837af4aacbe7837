//! The drive, at the clamped end or on the lever itself, and the gaps to the sample.

use super::error::PhysicalError;
use super::reader::Reader;
use crate::case::key::Key;
use crate::case::quantity::Kind;
use crate::case::stated::Value;
use crate::model::drive_form::{Actuation, FrequencyRatio, RatioError};

/// A quantity that one of several keys states: the key, and its value in SI.
pub(crate) type Given = (Key, f64);

/// The section `[drive]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Its frequency, in Hz or over the lever's f₀.
    pub(crate) frequency: Given,
    /// Its strength: of the clamped end's motion in m, of a force on the lever in N, or the free
    /// amplitude of the tip in m.
    pub(crate) strength: Given,
    /// The setpoint, for experiments that solve for the gap: a fraction of A₀, or an amplitude, a
    /// force or an angle in SI.
    pub(crate) setpoint: Option<(Kind, f64)>,
    /// Where it acts.
    pub actuation: Actuation,
    /// The second tone, if there is one.
    pub(crate) second: Option<SecondTone>,
}

/// A second tone of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SecondTone {
    /// Its frequency in Hz, which must be a ratio of small whole numbers to the first one's.
    frequency: Option<f64>,
    /// Its frequency over that of the first, in place of that.
    ratio: Option<FrequencyRatio>,
    /// Its strength, as that of the first.
    pub(crate) strength: Given,
    /// Its phase in rad.
    pub(crate) phase: f64,
}

impl SecondTone {
    /// The ratio to a first tone of `frequency` Hz.
    pub(crate) fn ratio(&self, frequency: f64) -> Result<Option<FrequencyRatio>, PhysicalError> {
        let Some(second) = self.frequency else {
            return Ok(self.ratio);
        };
        let ratio = FrequencyRatio::of(second / frequency).map_err(|error| {
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
        })?;
        Ok(Some(ratio))
    }
}

impl Drive {
    /// Reads `[drive]`.
    pub(crate) fn read(reader: Reader<'_>) -> Result<Self, PhysicalError> {
        let keys = [Key::DriveFrequency, Key::DriveFrequencyRatio];
        let frequency = reader.first(&keys)?.ok_or_else(|| {
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
        let setpoint = reader.number(Key::DriveSetpoint)?;
        Ok(Self {
            frequency,
            strength,
            setpoint: setpoint.map(|value| match reader.stated.get(Key::DriveSetpoint) {
                Some(Value::Number(_, kind)) => (*kind, value),
                _ => (Kind::Number, value),
            }),
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
) -> Result<Option<Given>, PhysicalError> {
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
    reader.first(&[key, free])
}

fn read_second(
    reader: Reader<'_>,
    actuation: Actuation,
) -> Result<Option<SecondTone>, PhysicalError> {
    let frequency = reader.number(Key::SecondFrequency)?;
    let strength = read_strength(reader, actuation, SECOND)?;
    let phase = reader.number(Key::SecondPhase)?;
    let ratio = reader.ratio(Key::SecondRatio);
    match (frequency.is_some() || ratio.is_some(), strength) {
        (true, Some(strength)) => Ok(Some(SecondTone {
            frequency,
            ratio,
            strength,
            phase: phase.unwrap_or(0.0),
        })),
        (false, None) if phase.is_none() => Ok(None),
        (false, _) => Err(PhysicalError::missing(
            Key::SecondFrequency,
            "the second tone needs a frequency, or drive.second_ratio as in \"25/4\"",
        )),
        (true, None) => Err(PhysicalError::missing(
            Key::SecondFreeAmplitude,
            "the second tone needs a strength: its free amplitude, or second_amplitude of the \
             base or second_force on the lever",
        )),
    }
}
