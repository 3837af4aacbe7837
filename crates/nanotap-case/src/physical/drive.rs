//! The drive, at the clamped end or on the lever itself, and the gaps to the sample.

use super::error::PhysicalError;
use super::reader::Reader;
use crate::key::Key;
use crate::quantity::Kind;
use crate::stated::Value;
use nanotap_model::drive_form::{Actuation, FrequencyRatio, MAX_TONES};

/// A quantity that one of several keys states: the key, and its value in SI.
pub(crate) type Given = (Key, f64);

/// The drive of a physical case, from `[drive]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Frequency of the first tone, Hz or as a multiple of f₀, depending on its key.
    pub(crate) frequency: Given,
    /// Strength of the first tone: amplitude of the clamped end, m, of a force on the lever, N, or
    /// of the free tip, m, depending on its key.
    pub(crate) strength: Given,
    /// Setpoint, for studies that solve for the gap: a fraction of A₀, or an amplitude, a force, a
    /// phase or a frequency shift in SI.
    pub(crate) setpoint: Option<(Kind, f64)>,
    /// Where the drive acts: on the base, on the tip or along the lever.
    pub actuation: Actuation,
    /// Gain, N/m, and phase, rad, of Q control; 0 without it.
    pub(crate) q_control: [f64; 2],
    /// The second tone, if there is one, and the third.
    pub(crate) further: [Option<FurtherTone>; MAX_TONES - 1],
}

/// The keys of a further tone.
#[derive(Debug, PartialEq)]
pub(crate) struct ToneKeys {
    /// Prefix of the keys of the tone: `second` or `third`.
    word: &'static str,
    /// Key of the frequency in Hz.
    pub(crate) frequency: Key,
    /// Key of the ratio to the frequency of the first tone.
    pub(crate) ratio: Key,
    /// Keys of the strength: motion of the base, force on the lever, free amplitude of the tip.
    pub(crate) strength: [Key; 3],
    pub(crate) phase: Key,
}

/// The keys of each further tone.
pub(crate) static FURTHER: [ToneKeys; MAX_TONES - 1] = [
    ToneKeys {
        word: "second",
        frequency: Key::SecondFrequency,
        ratio: Key::SecondRatio,
        strength: [
            Key::SecondAmplitude,
            Key::SecondForce,
            Key::SecondFreeAmplitude,
        ],
        phase: Key::SecondPhase,
    },
    ToneKeys {
        word: "third",
        frequency: Key::ThirdFrequency,
        ratio: Key::ThirdRatio,
        strength: [
            Key::ThirdAmplitude,
            Key::ThirdForce,
            Key::ThirdFreeAmplitude,
        ],
        phase: Key::ThirdPhase,
    },
];

/// A further tone of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FurtherTone {
    /// Keys of the tone, which messages name.
    pub(crate) keys: &'static ToneKeys,
    frequency: ToneFrequency,
    /// Strength of the tone, in the same units as that of the first.
    pub(crate) strength: Given,
    /// Phase of the tone, rad.
    pub(crate) phase: f64,
}

/// The frequency of a further tone.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ToneFrequency {
    /// Frequency, Hz.
    Hertz(f64),
    /// Ratio to the frequency of the first tone.
    Ratio(FrequencyRatio),
}

impl FurtherTone {
    /// The ratio to a first tone of `frequency` Hz.
    pub(crate) fn ratio(&self, frequency: f64) -> Result<FrequencyRatio, PhysicalError> {
        let own = match self.frequency {
            ToneFrequency::Ratio(ratio) => return Ok(ratio),
            ToneFrequency::Hertz(own) => own,
        };
        FrequencyRatio::any(own / frequency).map_err(|error| {
            PhysicalError::impossible(
                self.keys.frequency,
                Kind::Frequency.format_digits(own, 12),
                error.to_string(),
            )
        })
    }
}

impl Drive {
    /// Reads `[drive]` from the stated quantities.
    pub(crate) fn read(reader: Reader<'_>) -> Result<Self, PhysicalError> {
        let keys = [Key::DriveFrequency, Key::DriveFrequencyRatio];
        let frequency = reader.first(&keys)?.ok_or_else(|| {
            PhysicalError::missing(
                Key::DriveFrequency,
                "give it, or drive.frequency_ratio in units of f0",
            )
        })?;
        let actuation = crate::file::word(reader.stated, Key::DriveActuation).unwrap_or_default();
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
            q_control: read_q_control(reader)?,
            further: read_further(reader, actuation)?,
        })
    }
}

/// Keys for the strength of a tone: motion of the base, force on the lever, free amplitude of the
/// tip.
pub const FIRST: [Key; 3] = [
    Key::DriveAmplitude,
    Key::DriveForce,
    Key::DriveFreeAmplitude,
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

fn read_q_control(reader: Reader<'_>) -> Result<[f64; 2], PhysicalError> {
    let [gain, phase] = [Key::DriveQControlGain, Key::DriveQControlPhase];
    match [reader.number(gain)?, reader.number(phase)?] {
        [None, None] => Ok([0.0; 2]),
        [Some(gain), Some(phase)] => Ok([gain, phase]),
        [None, _] => Err(PhysicalError::missing(
            gain,
            "Q control has a gain and a phase: give it, such as \"0.01 N/m\"",
        )),
        [_, None] => Err(PhysicalError::missing(
            phase,
            "Q control has a gain and a phase: \"90 deg\" raises Q, \"-90 deg\" lowers it",
        )),
    }
}

fn read_further(
    reader: Reader<'_>,
    actuation: Actuation,
) -> Result<[Option<FurtherTone>; MAX_TONES - 1], PhysicalError> {
    let mut tones = [None; MAX_TONES - 1];
    for (tone, keys) in tones.iter_mut().zip(&FURTHER) {
        *tone = read_tone(reader, actuation, keys)?;
    }
    if matches!(tones, [None, Some(_)]) {
        return Err(PhysicalError::missing(
            FURTHER[0].frequency,
            "the drive has a third tone and no second one: call the third the second",
        ));
    }
    Ok(tones)
}

fn read_tone(
    reader: Reader<'_>,
    actuation: Actuation,
    keys: &'static ToneKeys,
) -> Result<Option<FurtherTone>, PhysicalError> {
    let word = keys.word;
    let ratio = reader.ratio(keys.ratio).map(ToneFrequency::Ratio);
    let frequency = reader.number(keys.frequency)?.map(ToneFrequency::Hertz);
    let strength = read_strength(reader, actuation, keys.strength)?;
    let phase = reader.number(keys.phase)?;
    match (frequency.or(ratio), strength) {
        (Some(frequency), Some(strength)) => Ok(Some(FurtherTone {
            keys,
            frequency,
            strength,
            phase: phase.unwrap_or(0.0),
        })),
        (None, None) if phase.is_none() => Ok(None),
        (None, _) => Err(PhysicalError::missing(
            keys.frequency,
            format!("the {word} tone needs a frequency, or drive.{word}_ratio as in \"25/4\""),
        )),
        (Some(_), None) => Err(PhysicalError::missing(
            keys.strength[2],
            format!(
                "the {word} tone needs a strength: its free amplitude, or {word}_amplitude of the \
                 base or {word}_force on the lever"
            ),
        )),
    }
}
