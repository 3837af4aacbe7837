//! A physical case mapped to the model: the view in SI.

use nanotap_arithmetic::ComplexFunctions as _;
use std::f64::consts::TAU;

use nalgebra::Complex;

use super::drive::{Drive, FIRST, FURTHER, FurtherTone, Given};
use super::error::PhysicalError;
use super::free_response::{free_response, response_at};
use super::lever::{Lever, LeverData};
use super::mapping::{MappingRow, Scales, mapping_table};
use super::reader::Reader;
use super::sample::Sample;
use super::tip::Tip;
use crate::file::{modes, word};
use crate::key::{Key, Laws, ModelKind};
use crate::lever_modes::LeverModes;
use crate::quantity::Kind;
use crate::stated::{Stated, Value};
use nanotap_model::cantilever::Cantilever;
use nanotap_model::drive_form::{Actuation, Hold};
use nanotap_model::exact_beam;
use nanotap_model::lever_mode::LeverMode;
use nanotap_model::parameter::{Numbers, Parameter, Unit};

/// Default height of the tip; tips of silicon levers are 10 to 15 µm high.
pub(super) const USUAL_TIP_HEIGHT: f64 = 10e-6;

/// Quantity that a feedback keeps constant, with its setpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Held {
    /// Amplitude as a fraction of the free amplitude A₀.
    Amplitude(f64),
    /// Largest force of a period, N.
    PeakForce(f64),
    /// Phase lag of the deflection, degrees.
    Phase(f64),
    /// Shift of the frequency at which amplitude and phase are constant, Hz.
    Shift(f64),
}

/// A physical case with its dimensionless parameters and the units between the two.
#[derive(Debug, Clone, PartialEq)]
pub struct Physical {
    /// Dimensionless parameters of the case, validated.
    pub cantilever: Cantilever,
    /// SI values of the model's units.
    pub scales: Scales,
    /// The lever with its stiffness, mass and resonance, in SI.
    pub lever: Lever,
    /// The sample with its contact or force law, in SI.
    pub sample: Sample,
    /// The physical quantities of the dimensionless numbers, in SI.
    pub parameters: Numbers,
    /// Free amplitude A₀ of the tip's deflection at the drive frequency, in m.
    pub free_amplitude: f64,
    /// Free amplitudes of further tones, in m.
    pub further_free_amplitudes: Vec<f64>,
    /// Phase of the free deflection behind the drive (the base's displacement, or the force
    /// on the lever) in degrees: 90 at resonance.
    pub free_phase: f64,
    /// Setpoint amplitude as a fraction of A₀, if one was given; studies then solve for the gap.
    pub setpoint: Option<f64>,
    /// Quantity that the feedback keeps constant, if a setpoint was given.
    pub held: Option<Held>,
    /// Height of the tip, g₀ − g₁, in m.
    pub tip_height: f64,
    /// Stated data of the lever, from which `lever` was determined.
    pub(super) data: LeverData,
    pub(super) tip: Tip,
    /// Measured modes of the lever in Hz and N/m, if they replace the beam.
    lever_modes: Option<LeverModes>,
}

impl Physical {
    /// Maps the stated quantities. If lever, tip and modes are unchanged, the previous `lever` is
    /// used.
    ///
    /// # Errors
    /// [`PhysicalError`] if the quantities contradict each other or describe something
    /// impossible; it names a key that was stated.
    pub(crate) fn map(reader: Reader<'_>, lever: Option<Lever>) -> Result<Self, PhysicalError> {
        mapped(reader, lever).map_err(|error| named(reader, error))
    }

    /// The same view with some dimensionless numbers replaced.
    pub(crate) fn with_numbers(
        mut self,
        numbers: &[(Parameter, f64)],
    ) -> Result<Self, PhysicalError> {
        for &(parameter, value) in numbers {
            self.cantilever = self.cantilever.with(parameter, value);
        }
        self.cantilever.validate()?;
        self.parameters = self.scales.quantities(&self.cantilever);
        let response = free_response(&self.cantilever)?;
        self.free_amplitude = self.cantilever.alpha2 * response.modulus() * self.scales.length;
        self.free_phase = -response.argument().to_degrees();
        let tones = self.cantilever.further_tones.iter().zip(Parameter::TONES);
        let amplitudes = tones.map(|(ratio, [strength, _])| {
            let response = response_at(&self.cantilever, ratio.value() * self.cantilever.omega)?;
            Ok(self.cantilever.get(strength) * response.modulus() * self.scales.length)
        });
        self.further_free_amplitudes = amplitudes.collect::<Result<_, PhysicalError>>()?;
        self.tip_height = self.scales.length - self.parameters.get(Parameter::Alpha5);
        Ok(self)
    }

    /// The mapping to α1 … α6 and Ω, line by line.
    pub fn mapping(&self) -> Vec<MappingRow> {
        mapping_table(&self.cantilever, &self.scales)
    }

    /// Returns the quantity to which phases refer, in words.
    pub const fn phase_reference(&self) -> &'static str {
        match self.cantilever.actuation {
            Actuation::Base => "displacement of the clamped end",
            Actuation::Tip => "force at the tip",
            Actuation::Distributed => "force on the lever",
        }
    }

    /// Returns the measured modes of the lever in Hz and N/m; none for a beam.
    pub fn lever_modes(&self) -> &[LeverMode] {
        self.lever_modes.as_ref().map_or(&[], LeverModes::modes)
    }

    /// True if a fluid determines mass and damping.
    pub const fn is_in_fluid(&self) -> bool {
        self.data.fluid.is_some()
    }

    /// Key of the drive strength: the motion of the base, or the force.
    pub fn strength_key(&self, keys: [Key; 3]) -> Key {
        match self.cantilever.actuation {
            Actuation::Base => keys[0],
            Actuation::Tip | Actuation::Distributed => keys[1],
        }
    }

    /// The value of a quantity in SI, stated or derived; `None` if it is unknown.
    pub fn value(&self, key: Key) -> Option<f64> {
        let quantity = |parameter| self.parameters.get(parameter);
        let tones = self.cantilever.further_tones.iter().zip(&FURTHER);
        for (k, (ratio, keys)) in tones.enumerate() {
            let [strength, phase] = Parameter::TONES[k];
            if key == keys.frequency {
                return Some(ratio.value() * quantity(Parameter::Omega));
            }
            if key == self.strength_key(keys.strength) {
                return Some(quantity(strength));
            }
            if key == keys.strength[2] {
                return self.further_free_amplitudes.get(k).copied();
            }
            if key == keys.phase {
                return Some(quantity(phase));
            }
        }
        if let Some(force) = &self.sample.force {
            if let Some(value) = force.get(key) {
                return Some(value);
            }
            let spring = [
                Key::SampleStiffness,
                Key::SampleDamping,
                Key::SampleLossTangent,
            ];
            if spring.contains(&key) || key.law_number().is_some() {
                return None;
            }
        }
        if let Some(number) = key.law_number() {
            let known = key.entry().laws == Laws::Some || self.cantilever.has(number);
            return known.then(|| quantity(number));
        }
        Some(match key {
            Key::LeverK => self.lever.k,
            Key::LeverK1 => match self.lever_modes().first() {
                Some(first) => first.stiffness,
                None => self.lever.modal_stiffness()?,
            },
            Key::LeverF0 => self.lever.f0,
            Key::LeverQ => self.lever.quality_factor,
            Key::LeverLength => self.lever.length?,
            Key::LeverWidth => self.data.geometry?.width,
            Key::LeverThickness => self.data.geometry?.thickness,
            Key::TipMass => quantity(Parameter::Alpha1),
            Key::TipMassRatio => self.lever.tip_mass_ratio,
            Key::TipRadius => self.tip.radius?,
            Key::TipHeight => self.tip_height,
            Key::TipModulus => self.tip.elastic?.modulus,
            Key::TipPoisson => self.tip.elastic?.poisson,
            Key::SampleStiffness => quantity(Parameter::Alpha4),
            Key::SampleDamping => quantity(Parameter::Alpha6),
            Key::SampleLossTangent => {
                quantity(Parameter::Alpha6) * TAU * quantity(Parameter::Omega)
                    / quantity(Parameter::Alpha4)
            }
            Key::SampleModulus => self.sample.elastic?.modulus,
            Key::SamplePoisson => self.sample.elastic?.poisson,
            Key::SampleIndentation => self.sample.hertz?.indentation,
            Key::DriveFrequency => quantity(Parameter::Omega),
            Key::DriveFrequencyRatio => quantity(Parameter::Omega) / self.lever.f0,
            Key::DriveAmplitude | Key::DriveForce if key == self.strength_key(FIRST) => {
                quantity(Parameter::Alpha2)
            }
            Key::DriveFreeAmplitude => self.free_amplitude,
            Key::DriveQControlGain if self.cantilever.has_q_control() => {
                quantity(Parameter::QControlGain)
            }
            Key::DriveQControlPhase if self.cantilever.has_q_control() => {
                quantity(Parameter::QControlPhase)
            }
            Key::GapTip => quantity(Parameter::Alpha5),
            Key::GapBeam => self.scales.length,
            _ => return None,
        })
    }

    /// Returns the stated values, completed by those that stay constant while a quantity varies. As
    /// with an instrument, only one control changes: the drive keeps its own amplitude (the voltage
    /// of a piezo) unless `drive.hold` states otherwise, further tones keep their ratio to the
    /// first, and gap and unit of length g₀ do not change, so that all values have the same unit.
    pub(crate) fn implied_constants(&self, stated: &Stated) -> Stated {
        let mut held = stated.clone();
        held.set(Key::GapBeam, self.scales.length);
        held.set(Key::GapTip, self.parameters.get(Parameter::Alpha5));
        let hold: Hold = word(stated, Key::DriveHold).unwrap_or_default();
        let further = FURTHER.iter().map(|keys| keys.strength);
        for keys in std::iter::once(FIRST).chain(further) {
            let [_, _, free] = keys;
            let strength = self.strength_key(keys);
            let (stays, follows) = match hold {
                Hold::Drive => (strength, free),
                Hold::FreeAmplitude => (free, strength),
            };
            if let (true, Some(value)) = (stated.has(follows), self.value(stays)) {
                held.set(stays, value);
            }
        }
        for (ratio, keys) in self.cantilever.further_tones.iter().zip(&FURTHER) {
            if stated.has(keys.frequency) {
                held.remove(keys.frequency);
                held.put(keys.ratio, Value::Ratio(*ratio));
            }
        }
        held
    }
}

/// Names the stated key that causes an invalid parameter.
fn named(reader: Reader<'_>, error: PhysicalError) -> PhysicalError {
    let PhysicalError::Model { key: None, error } = error else {
        return error;
    };
    let parameter = ModelKind::Cantilever
        .key(error.key)
        .and_then(Key::parameter);
    let feeds = |key: &Key| {
        let fed = key.entry().feeds.or_else(|| key.law_number());
        fed.is_some() && fed == parameter
    };
    let of_tone = |key: &Key| {
        FURTHER.iter().zip(Key::TONE_RATIOS).any(|(keys, ratio)| {
            [keys.frequency, keys.ratio].contains(key) && error.key == ratio.name()
        })
    };
    let stated = Key::all().find(|key| (feeds(key) || of_tone(key)) && reader.has(*key));
    PhysicalError::Model {
        key: stated.map(|key| (key, reader.stated.written(key))),
        error,
    }
}

fn mapped(reader: Reader<'_>, known: Option<Lever>) -> Result<Physical, PhysicalError> {
    let catalogued = reader.lever()?;
    let tip = Tip::read(reader, catalogued)?;
    let data = LeverData::read(reader, catalogued, tip.mass)?;
    let sample = Sample::read(reader, &tip)?;
    let drive = Drive::read(reader)?;
    let lever = known.map_or_else(|| Lever::resolve(&data), Ok)?;
    let frequency = match drive.frequency {
        (Key::DriveFrequencyRatio, ratio) => ratio * lever.f0,
        (_, frequency) => frequency,
    };
    let further: Vec<FurtherTone> = drive.further.into_iter().flatten().collect();
    let ratios = further.iter().map(|tone| tone.ratio(frequency));
    let like = Cantilever {
        modes: modes(reader.stated),
        cosine_term: word(reader.stated, Key::CosineTerm).unwrap_or_default(),
        contact: sample.law,
        actuation: drive.actuation,
        further_tones: ratios.collect::<Result<_, _>>()?,
        lever_modes: lever_modes(reader, &lever),
        ..Cantilever::paper()
    };
    // The free response does not depend on g0, so any length serves as unit here: g0 = 1 m,
    // in which a force is measured in k/3.
    let measured = measured_modes(reader, &tip, &lever, data.fluid.is_some())?;
    let measured = match (data.fluid, data.geometry) {
        (Some(fluid), Some(beam)) => {
            let loaded = fluid.higher_modes(&lever, beam.width, beam.length, like.modes)?;
            let missing = Parameter::MEASURED.into_iter();
            let missing = missing.filter(|of| measured.get(*of) == 0.0);
            missing.fold(measured, |all, of| all.with(of, loaded.get(of)))
        }
        _ => measured,
    };
    let time = lever.time_unit();
    let mut free = free_case(&lever, frequency, &like);
    let measured = Parameter::Q_CONTROL
        .into_iter()
        .zip(drive.q_control)
        .fold(measured, |all, (of, value)| all.with(of, value));
    for parameter in Parameter::MEASURED.into_iter().chain(Parameter::Q_CONTROL) {
        let value = measured.get(parameter);
        let number = match parameter.entry().unit {
            Unit::Frequency => TAU * value * time,
            Unit::Stiffness => 3.0 * value / lever.k,
            Unit::Degrees => value.to_degrees(),
            _ => value,
        };
        free = free.with(parameter, number);
    }
    let unit = Scales::new(&lever, 1.0).of(Parameter::Alpha2, like.actuation);
    let response = free_response(&free)?;
    let strength =
        |strength, response: Complex<f64>, key| applied(strength, response.modulus() / unit, key);
    let (base, free_amplitude) = strength(drive.strength, response, Key::DriveFreeAmplitude)?;
    let strengths = further
        .iter()
        .zip(&like.further_tones)
        .map(|(tone, ratio)| {
            let response = response_at(&free, ratio.value() * free.omega)?;
            strength(tone.strength, response, tone.keys.strength[2])
        });
    let strengths: Vec<(f64, f64)> = strengths.collect::<Result<_, _>>()?;
    let held = held(reader, &drive, free_amplitude)?;
    let setpoint = match held {
        Some(Held::Amplitude(ratio)) => Some(ratio),
        _ => None,
    };
    let tip_gap = match (reader.number(Key::GapTip)?, held) {
        (Some(gap), _) => gap,
        // Before the setpoint is solved for.
        (None, Some(Held::Amplitude(ratio))) => ratio * free_amplitude,
        (None, Some(_)) => free_amplitude,
        (None, None) => {
            return Err(PhysicalError::missing(
                Key::GapTip,
                "give the gap between tip and sample at rest, or drive.setpoint",
            ));
        }
    };
    let height = tip.height.unwrap_or(USUAL_TIP_HEIGHT);
    let beam_gap = reader.number(Key::GapBeam)?.unwrap_or(tip_gap + height);
    if !(beam_gap > tip_gap && beam_gap > 0.0) {
        return Err(PhysicalError::impossible(
            Key::GapBeam,
            Kind::Length.format(beam_gap),
            format!(
                "it is the tip's gap, {}, and the tip's height together: it must be above \
                 zero and above gap.tip, or the beam would touch before the tip",
                Kind::Length.format(tip_gap)
            ),
        ));
    }
    let scales = Scales::new(&lever, beam_gap);
    let mut parameters = measured
        .with(Parameter::Alpha1, lever.tip_mass())
        .with(Parameter::Alpha2, base)
        .with(Parameter::Alpha3, lever.damping() * scales.damping)
        .with(Parameter::Alpha4, sample.stiffness)
        .with(Parameter::Alpha5, tip_gap)
        .with(Parameter::Alpha6, sample.damper(TAU * frequency))
        .with(Parameter::Omega, frequency);
    for (parameter, number) in Parameter::of_law(sample.law).zip(&sample.numbers) {
        parameters.set(parameter, *number);
    }
    for (k, (tone, (applied, _))) in further.iter().zip(&strengths).enumerate() {
        let [strength, phase] = Parameter::TONES[k];
        parameters.set(strength, *applied);
        parameters.set(phase, tone.phase);
    }
    let mut cantilever = scales.case(&parameters, &like);
    let arms = sample.arms.iter().flat_map(|arms| arms.arms().points());
    let arms = arms.map(|(time, stiffness)| [time / scales.time, stiffness / scales.stiffness]);
    cantilever.arms = arms.collect();
    cantilever.validate()?;
    if let Some(force) = &sample.force {
        cantilever.law = Some(force.in_model(&scales)?);
    }
    Ok(Physical {
        cantilever,
        scales,
        lever,
        sample,
        parameters,
        free_amplitude,
        further_free_amplitudes: strengths.iter().map(|(_, free)| *free).collect(),
        free_phase: -response.argument().to_degrees(),
        setpoint,
        held,
        tip_height: beam_gap - tip_gap,
        data,
        tip,
        lever_modes: reader.lever_modes().cloned(),
    })
}

/// The measured modes of the lever in the units of the model. The damping of the first is that of α₃.
fn lever_modes(reader: Reader<'_>, lever: &Lever) -> Vec<LeverMode> {
    let modes = reader.lever_modes().map_or(&[][..], LeverModes::modes);
    let in_model = |(j, mode): (usize, &LeverMode)| LeverMode {
        frequency: TAU * mode.frequency * lever.time_unit(),
        stiffness: 3.0 * mode.stiffness / lever.k,
        quality: if j == 0 { 0.0 } else { mode.quality },
        participation: mode.participation,
    };
    modes.iter().enumerate().map(in_model).collect()
}

/// Measured data of the second and third mode, in SI; 0 if there are none.
fn measured_modes(
    reader: Reader<'_>,
    tip: &Tip,
    lever: &Lever,
    in_fluid: bool,
) -> Result<Numbers, PhysicalError> {
    let number = |key| reader.number(key).map(Option::unwrap_or_default);
    let beam = exact_beam::frequencies(lever.tip_mass_ratio, 0.0, 3)?;
    let frequency = |key, k: usize| {
        let given = number(key)?;
        let own = lever.f0 * beam[k] / beam[0];
        if given != 0.0 && !(0.5 * own..2.0 * own).contains(&given) {
            return Err(reader.impossible(
                key,
                format!(
                    "the uniform beam's frequency is {}: it must lie within a factor of two of \
                     that; state the modes of another lever by [[cantilever.mode]]",
                    Kind::Frequency.format_digits(own, 4)
                ),
            ));
        }
        Ok(given)
    };
    // In a fluid f2 without a tip mass is that in vacuum.
    let second = if in_fluid && tip.mass.is_none() {
        0.0
    } else {
        frequency(Key::LeverF2, 1)?
    };
    Ok(Numbers::ZERO
        .with(Parameter::Mode2Frequency, second)
        .with(Parameter::Mode3Frequency, frequency(Key::LeverF3, 2)?)
        .with(Parameter::Mode2Quality, number(Key::LeverQ2)?)
        .with(Parameter::Mode3Quality, number(Key::LeverQ3)?)
        .with(Parameter::Mode2Stiffness, number(Key::LeverK2)?)
        .with(Parameter::Mode3Stiffness, number(Key::LeverK3)?))
}

/// The lever without sample, driven with unit amplitude.
fn free_case(lever: &Lever, frequency: f64, like: &Cantilever) -> Cantilever {
    Cantilever {
        modes: like.modes,
        alpha1: lever.tip_mass_ratio,
        alpha2: 1.0,
        alpha3: lever.damping(),
        alpha4: 0.0,
        alpha5: 0.0,
        alpha6: 0.0,
        omega: TAU * frequency * lever.time_unit(),
        cosine_term: like.cosine_term,
        actuation: like.actuation,
        lever_modes: like.lever_modes.clone(),
        ..Cantilever::paper()
    }
}

fn held(
    reader: Reader<'_>,
    drive: &Drive,
    free_amplitude: f64,
) -> Result<Option<Held>, PhysicalError> {
    match drive.setpoint {
        None => Ok(None),
        Some((Kind::Length, amplitude)) if amplitude < free_amplitude => {
            Ok(Some(Held::Amplitude(amplitude / free_amplitude)))
        }
        Some((Kind::Length, _)) => Err(reader.impossible(
            Key::DriveSetpoint,
            format!(
                "it must be below the free amplitude, {}",
                Kind::Length.format(free_amplitude)
            ),
        )),
        Some((Kind::Force, force)) => Ok(Some(Held::PeakForce(force))),
        Some((Kind::Angle, phase)) => Ok(Some(Held::Phase(phase.to_degrees()))),
        Some((Kind::Frequency, shift)) => Ok(Some(Held::Shift(shift))),
        Some((_, ratio)) => Ok(Some(Held::Amplitude(ratio))),
    }
}

/// Amplitudes of the drive and of the free tip in SI, one from the other by the `gain` between
/// them.
fn applied((stated, value): Given, gain: f64, free: Key) -> Result<(f64, f64), PhysicalError> {
    if stated != free {
        return Ok((value, value * gain));
    }
    if (value / gain).is_finite() {
        return Ok((value / gain, value));
    }
    Err(PhysicalError::impossible(
        free,
        Kind::Length.format(value),
        "the lever does not move at this drive frequency",
    ))
}
