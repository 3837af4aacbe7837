//! One dimensionless case of the model: how many modes and which parameters.

use std::cmp::Ordering;
use std::fmt;
use std::sync::Arc;

use serde::ser::SerializeMap as _;
use serde::{Serialize, Serializer};

use crate::beam::{MAX_MODES, ModeCountError};
use crate::contact::dual::Dual;
use crate::contact::entry::Damper;
use crate::contact::law::Law;
use crate::contact::{ContactLaw, MAX_ARMS};
use crate::drive_form::{Actuation, FrequencyRatio, LARGEST, MAX_TONES, repetition};
use crate::drive_signal::DriveSignal;
use crate::lever_mode::LeverMode;
use crate::parameter::{Applies, LARGEST_ALPHA, Numbers, OMEGA_RANGE, Parameter, Unit};
use crate::sample_law::SampleLaw;
use crate::words::words;
use nanotap_quantity::number::shortest;

words! {
    /// Which cosine term the drive has in Eq. (14) of the paper.
    CosineTerm {
        /// −α2 α3 Ω I cos Ωτ, as Eq. (6) has it.
        Corrected = "corrected",
        /// −α2 α3 I cos Ωτ, as Eq. (14) is printed; kept for comparison.
        Printed = "printed",
    }
}

/// A dimensionless case. The fields are not checked when set: [`validate`](Self::validate) checks
/// them, and whatever is built from a case calls it.
#[derive(Clone, Debug, PartialEq)]
pub struct Cantilever {
    /// Number of beam modes N, 1 to 50.
    pub modes: usize,
    /// Tip mass over beam mass, M/(mL), dimensionless, ≥ 0.
    pub alpha1: f64,
    /// Drive amplitude, ≥ 0; 0 is an undriven beam. Motion of the base over the beam's gap, f/g₀,
    /// or a force in units of EI g₀/L³.
    pub alpha2: f64,
    /// Viscous damping of the beam, C·√(L⁴/(m·EI)), dimensionless, ≥ 0.
    pub alpha3: f64,
    /// Contact stiffness over bending stiffness, K₁L³/(EI), dimensionless, ≥ 0.
    pub alpha4: f64,
    /// Tip gap over beam gap, g₁/g₀, dimensionless; negative where the surface is beyond the tip's
    /// rest position, so that the tip presses on it at rest.
    pub alpha5: f64,
    /// Viscous damping of the contact, (C₁/L)·√(L⁴/(m·EI)), dimensionless, ≥ 0.
    pub alpha6: f64,
    /// Drive frequency Ω > 0, in units of √(EI/(mL⁴)).
    pub omega: f64,
    /// Which form of Eq. (14) drives the beam.
    pub cosine_term: CosineTerm,
    /// Contact law of the sample.
    pub contact: ContactLaw,
    /// A nonlinear force law in place of spring and damper, in the model's units.
    pub law: Option<SampleLaw>,
    /// Where the drive acts: α2 is an amplitude of motion at the base, else one of force; see
    /// [`drive_form`](crate::drive_form).
    pub actuation: Actuation,
    /// Frequencies of further tones over Ω: of the second, and of a third.
    pub further_tones: Vec<FrequencyRatio>,
    /// A piece of a signal of one shot in place of the tones; documents do not give it.
    pub signal: Option<Arc<DriveSignal>>,
    /// Relaxing arms, each `[time, stiffness]` in units of √(mL⁴/(EI)) and EI/L³; empty for a
    /// contact law without a list of arms.
    pub arms: Vec<[f64; 2]>,
    /// Modes of a lever that was measured as a whole, by ascending frequency, in place of those of the
    /// uniform beam; empty for the uniform beam. A quality factor of 0 stands for that of α₃.
    pub lever_modes: Vec<LeverMode>,
    /// Parameters that only some laws, drives and levers have; see [`get`](Self::get).
    pub further: Numbers,
}

impl Cantilever {
    /// The paper's parameters for Figs. 5–17, Eq. (26), with α1 = 0.1, Ω = 2.6 and N = 3.
    pub const fn paper() -> Self {
        Self {
            modes: 3,
            alpha1: 0.1,
            alpha2: 0.1,
            alpha3: 0.1,
            alpha4: 20.0,
            alpha5: 0.0,
            alpha6: 0.2,
            omega: 2.6,
            cosine_term: CosineTerm::Corrected,
            contact: ContactLaw::SpringDamper,
            law: None,
            actuation: Actuation::Base,
            further_tones: Vec::new(),
            signal: None,
            arms: Vec::new(),
            lever_modes: Vec::new(),
            further: Numbers::ZERO,
        }
    }

    /// The paper's undamped parameters for Fig. 4, Eq. (24), with Ω = 4.1 and N = 3.
    pub fn paper_eq24() -> Self {
        Self {
            alpha3: 0.0,
            alpha6: 0.0,
            omega: 4.1,
            ..Self::paper()
        }
    }

    /// Returns the value of a parameter, dimensionless, or degrees for a phase.
    pub const fn get(&self, parameter: Parameter) -> f64 {
        match parameter {
            Parameter::Alpha1 => self.alpha1,
            Parameter::Alpha2 => self.alpha2,
            Parameter::Alpha3 => self.alpha3,
            Parameter::Alpha4 => self.alpha4,
            Parameter::Alpha5 => self.alpha5,
            Parameter::Alpha6 => self.alpha6,
            Parameter::Omega => self.omega,
            further => self.further.get(further),
        }
    }

    /// Returns the case with one parameter changed.
    #[must_use]
    pub fn with(mut self, parameter: Parameter, value: f64) -> Self {
        match parameter {
            Parameter::Alpha1 => self.alpha1 = value,
            Parameter::Alpha2 => self.alpha2 = value,
            Parameter::Alpha3 => self.alpha3 = value,
            Parameter::Alpha4 => self.alpha4 = value,
            Parameter::Alpha5 => self.alpha5 = value,
            Parameter::Alpha6 => self.alpha6 = value,
            Parameter::Omega => self.omega = value,
            further => self.further.set(further, value),
        }
        self
    }

    /// Returns the case with another contact law and the numbers that only this law has, in the
    /// order of [`Parameter::of_law`]; those of the previous law become 0.
    #[must_use]
    pub fn on(mut self, contact: ContactLaw, numbers: &[f64]) -> Self {
        for parameter in Parameter::of_law(self.contact) {
            self.further.set(parameter, 0.0);
        }
        for (parameter, number) in Parameter::of_law(contact).zip(numbers) {
            self.further.set(parameter, *number);
        }
        if !contact.entry().arms {
            self.arms.clear();
        }
        Self { contact, ..self }
    }

    /// Returns the case with another number of modes.
    #[must_use]
    pub const fn with_modes(mut self, modes: usize) -> Self {
        self.modes = modes;
        self
    }

    /// The parameters that this case has: the paper's (without α6 where the damper is the
    /// relaxing arm's) and those of its contact law, its second tone and its measured modes.
    pub fn parameters(&self) -> Vec<Parameter> {
        Parameter::every().filter(|of| self.has(*of)).collect()
    }

    /// Whether a parameter applies to this case's law, drive and lever.
    pub fn has(&self, parameter: Parameter) -> bool {
        match parameter.entry().applies {
            Applies::Always => true,
            Applies::Spring => self.law.is_none(),
            Applies::Damper => self.law.is_none() && self.contact.has_damper(),
            Applies::Law(law) => self.law.is_none() && self.contact == law,
            Applies::Tone(number) => self.further_tones.len() + 2 > number,
            Applies::NotZero => self.get(parameter) != 0.0,
        }
    }

    /// The parameters beyond the paper's that documents give.
    fn written(&self) -> impl Iterator<Item = Parameter> {
        let further = Parameter::every().skip(Parameter::PAPER);
        further.filter(|of| of.entry().always_written || self.has(*of))
    }

    /// The numbers of contact laws that documents give.
    pub fn written_law_numbers(&self) -> impl Iterator<Item = Parameter> {
        self.written().filter(|of| is_of_law(*of))
    }

    /// Returns true if a frequency, quality factor or stiffness of a higher mode was measured, or the
    /// lever as a whole.
    pub fn has_measured_modes(&self) -> bool {
        !self.lever_modes.is_empty() || Parameter::MEASURED.iter().any(|of| self.has(*of))
    }

    /// Returns true if the deflection is fed back to a force at the tip.
    pub fn has_q_control(&self) -> bool {
        self.has(Parameter::QControlGain)
    }

    /// Returns true if the lever is not the uniform beam with a mass at its tip.
    pub fn is_corrected(&self) -> bool {
        self.has_measured_modes() || self.has_q_control()
    }

    /// Returns the values of the parameters that only the contact law has.
    pub fn own_numbers(&self) -> Vec<f64> {
        let own = Parameter::of_law(self.contact);
        own.map(|parameter| self.get(parameter)).collect()
    }

    /// Returns stiffness and damping of the single arm that the contact law has in place of α6, in
    /// model units; `None` for other laws.
    pub fn arm(&self) -> Option<[f64; 2]> {
        match self.contact.entry().damper {
            Damper::InArm { arm: Some(arm), .. } => Some(arm(&self.own_numbers())),
            Damper::InArm { .. } | Damper::Contact { .. } => None,
        }
    }

    /// Whether the surface pulls a touching tip with a constant force, see
    /// [`Entry::attracts`](crate::contact::entry::Entry::attracts).
    pub fn has_attractive_surface(&self) -> bool {
        self.law.is_none() && self.contact.entry().attracts
    }

    /// Returns the number of periods of the first tone after which all tones repeat.
    pub fn repetition(&self) -> u32 {
        u32::try_from(repetition(&self.further_tones)).unwrap_or(u32::MAX)
    }

    /// Returns the period of the drive, in units of √(mL⁴/(EI)): 2π/Ω, or with several tones the
    /// time after which all repeat; that of the first tone where they never repeat together. Under a
    /// piece of a signal it
    /// is its length.
    pub fn period(&self) -> f64 {
        let repetition = f64::from(self.repetition());
        self.signal.as_ref().map_or(repetition, |of| of.length) * std::f64::consts::TAU / self.omega
    }

    /// Returns the case under its first tone alone.
    #[must_use]
    pub fn under_one_tone(mut self) -> Self {
        self.further_tones.clear();
        for [amplitude, phase] in Parameter::TONES {
            self.further.set(amplitude, 0.0);
            self.further.set(phase, 0.0);
        }
        self
    }

    /// Returns why the value of a parameter is invalid with this case's law and drive: it does not
    /// apply, or the law does not allow it. `None` if it is valid.
    pub fn misplaced(&self, parameter: Parameter) -> Option<Reason> {
        let applies = parameter.entry().applies;
        if self.has(parameter) {
            let Applies::Law(law) = applies else {
                return None;
            };
            let k = Parameter::of_law(law).position(|own| own == parameter)?;
            let objection = (law.entry().objection)(&self.own_numbers(), k);
            return objection.map(Reason::Law);
        }
        if self.get(parameter) == 0.0 {
            return None;
        }
        match (applies, self.contact.entry().damper) {
            (Applies::Spring | Applies::Damper, _) if self.law.is_some() => {
                Some(Reason::SpringOfLaw)
            }
            (Applies::Damper, Damper::InArm { not_alpha6, .. }) => Some(Reason::Law(not_alpha6)),
            (Applies::Law(law), _) => Some(Reason::OtherLaw(law)),
            (Applies::Tone(number), _) => Some(Reason::NoTone(number)),
            _ => None,
        }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`CantileverError`] for the first invalid field, with its value and the remedy.
    pub fn validate(&self) -> Result<(), CantileverError> {
        if !(1..=MAX_MODES).contains(&self.modes) {
            return Err(ModeCountError { given: self.modes }.into());
        }
        for parameter in Parameter::every() {
            let value = self.get(parameter);
            check(parameter, value)?;
            if let Some(reason) = self.misplaced(parameter) {
                return Err(CantileverError {
                    key: parameter.name(),
                    value,
                    reason,
                });
            }
        }
        self.check_tones()?;
        self.check_lever_modes()?;
        self.check_arms()
    }

    /// Checks the measured modes of the lever.
    ///
    /// # Errors
    /// [`CantileverError`] for the first invalid value.
    pub fn check_lever_modes(&self) -> Result<(), CantileverError> {
        let refuse = |key, value, reason| Err(CantileverError { key, value, reason });
        let count = self.lever_modes.len();
        if count == 0 {
            return Ok(());
        }
        if count > MAX_MODES {
            return refuse("lever_modes", count as f64, Reason::Modes);
        }
        if self.modes > count {
            return refuse("modes", self.modes as f64, Reason::LeverModes(count));
        }
        let twice = std::iter::once(Parameter::Alpha1).chain(Parameter::MEASURED);
        for parameter in twice {
            let value = self.get(parameter);
            if value != 0.0 {
                return refuse(parameter.name(), value, Reason::OfLeverModes);
            }
        }
        let mut last = 0.0;
        for mode in &self.lever_modes {
            for value in [mode.frequency, mode.stiffness] {
                if !(value > 0.0 && value <= LARGEST_ALPHA) {
                    return refuse("lever_modes", value, Reason::LeverMode);
                }
            }
            if !(0.0..=LARGEST_ALPHA).contains(&mode.quality) {
                return refuse("lever_modes", mode.quality, Reason::LeverMode);
            }
            if let Some(participation) = mode.participation
                && participation.abs().partial_cmp(&LARGEST_ALPHA) != Some(Ordering::Less)
            {
                return refuse("lever_modes", participation, Reason::LeverMode);
            }
            if mode.frequency <= last {
                return refuse("lever_modes", mode.frequency, Reason::LeverModeOrder);
            }
            last = mode.frequency;
        }
        Ok(())
    }

    /// Checks the relaxing arms.
    ///
    /// # Errors
    /// [`CantileverError`] for the first invalid value.
    pub fn check_arms(&self) -> Result<(), CantileverError> {
        let refuse = |value, reason| {
            Err(CantileverError {
                key: "relaxation_arms",
                value,
                reason,
            })
        };
        let count = self.arms.len();
        let takes = self.law.is_none() && self.contact.entry().arms;
        if !takes && count > 0 {
            return refuse(
                count as f64,
                Reason::OtherLaw(ContactLaw::GeneralisedMaxwell),
            );
        }
        if takes && !(1..=MAX_ARMS).contains(&count) {
            return refuse(count as f64, Reason::Arms);
        }
        let size = |value: &f64| (0.0..=LARGEST_ALPHA).contains(value);
        for [time, stiffness] in &self.arms {
            if !(*time > 0.0 && size(time)) {
                return refuse(*time, Reason::ArmTime);
            }
            if !size(stiffness) {
                return refuse(*stiffness, Reason::Negative);
            }
        }
        Ok(())
    }

    /// Checks the frequencies of the tones against each other.
    ///
    /// # Errors
    /// When two tones are the same, or the tones never repeat together.
    pub fn check_tones(&self) -> Result<(), CantileverError> {
        let refuse = |k: usize, reason| {
            Err(CantileverError {
                key: ["tone2_ratio", "tone3_ratio"][k.min(1)],
                value: self.further_tones[k].value(),
                reason,
            })
        };
        for (k, ratio) in self.further_tones.iter().enumerate() {
            let is_alone = self.further_tones.len() == 1;
            if k + 2 > MAX_TONES || !is_alone && !ratio.repeats() {
                return refuse(k, Reason::Tones);
            }
            if self.further_tones[..k].contains(ratio) {
                return refuse(k, Reason::SameTone);
            }
            if repetition(&self.further_tones[..=k]) > u64::from(LARGEST.0) {
                return refuse(k, Reason::Repetition);
            }
        }
        Ok(())
    }

    /// A number of the case, with its derivative with respect to `parameter`.
    pub(crate) fn dual(&self, number: Parameter, parameter: Option<Parameter>) -> Dual {
        Dual::new(
            self.get(number),
            f64::from(u8::from(Some(number) == parameter)),
        )
    }

    /// Returns the equations of the contact law, with the derivatives of its numbers with respect
    /// to `parameter`.
    pub(crate) fn contact_law(&self, parameter: Option<Parameter>) -> Law {
        let number = |number| self.dual(number, parameter);
        self.contact.law(number, &self.arms)
    }
}

/// Whether only one contact law has a parameter.
fn is_of_law(parameter: Parameter) -> bool {
    matches!(parameter.entry().applies, Applies::Law(_))
}

/// Checks one parameter on its own.
///
/// # Errors
/// [`CantileverError`] if `value` is not allowed for `parameter`.
pub fn check(parameter: Parameter, value: f64) -> Result<(), CantileverError> {
    match objection(parameter, value) {
        None => Ok(()),
        Some(reason) => Err(CantileverError {
            key: parameter.name(),
            value,
            reason,
        }),
    }
}

/// Returns why `value` is not allowed for `parameter`; `None` if it is.
fn objection(parameter: Parameter, value: f64) -> Option<Reason> {
    if !value.is_finite() {
        return Some(Reason::NotFinite);
    }
    let (least, greatest) = parameter.entry().range;
    if (least..=greatest).contains(&value) {
        return None;
    }
    Some(match parameter {
        Parameter::Omega if value <= 0.0 => Reason::FrequencyNotPositive,
        Parameter::Omega => Reason::FrequencyOutOfRange,
        _ if value.abs() > LARGEST_ALPHA => Reason::TooLarge,
        _ if parameter.entry().unit == Unit::Drive => Reason::NegativeDrive,
        _ => Reason::Negative,
    })
}

/// An invalid field of a [`Cantilever`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{key}` = {}: {reason}", shortest(*value))]
pub struct CantileverError {
    /// The field's name in a case file.
    pub key: &'static str,
    /// Refused value, in model units; a count where the number of modes or arms is invalid.
    pub value: f64,
    /// Why the value is refused; its text says what is allowed.
    pub reason: Reason,
}

/// The keys of a case file, and a nonlinear law. Numbers that do not apply are left out, except
/// those that every document gives.
impl Serialize for Cantilever {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("modes", &self.modes)?;
        for parameter in Parameter::ALL {
            map.serialize_entry(parameter.name(), &self.get(parameter))?;
        }
        map.serialize_entry("cosine_term", &self.cosine_term)?;
        map.serialize_entry("contact", &self.contact)?;
        if let Some(law) = &self.law {
            map.serialize_entry("law", law)?;
        }
        if !self.arms.is_empty() {
            map.serialize_entry("relaxation_arms", &self.arms)?;
        }
        if !self.lever_modes.is_empty() {
            map.serialize_entry("lever_modes", &self.lever_modes)?;
        }
        for parameter in self.written_law_numbers() {
            map.serialize_entry(parameter.name(), &self.get(parameter))?;
        }
        map.serialize_entry("actuation", &self.actuation)?;
        map.serialize_entry("tone2_ratio", &self.further_tones.first())?;
        if let Some(third) = self.further_tones.get(1) {
            map.serialize_entry("tone3_ratio", third)?;
        }
        for parameter in self.written().filter(|of| !is_of_law(*of)) {
            map.serialize_entry(parameter.name(), &self.get(parameter))?;
        }
        map.end()
    }
}

impl From<ModeCountError> for CantileverError {
    fn from(error: ModeCountError) -> Self {
        Self {
            key: "modes",
            value: error.given as f64,
            reason: Reason::Modes,
        }
    }
}

/// Why a value is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The number of modes lies outside 1 … 50.
    Modes,
    /// The value is NaN or infinite.
    NotFinite,
    /// A mass, stiffness or damping below zero.
    Negative,
    /// A drive amplitude below zero.
    NegativeDrive,
    /// The magnitude exceeds 10⁹, the limit of all α: probably a value in SI units.
    TooLarge,
    /// The drive frequency Ω is zero or negative.
    FrequencyNotPositive,
    /// Ω outside 10⁻⁶ … 10⁶.
    FrequencyOutOfRange,
    /// The contact law does not allow the value, for the reason given.
    Law(&'static str),
    /// Too many relaxing arms, or none.
    Arms,
    /// An arm's time that is not positive and finite.
    ArmTime,
    /// More modes than the measured ones of the lever, by their number.
    LeverModes(usize),
    /// A frequency, stiffness, quality factor or participation of a measured mode that is not allowed.
    LeverMode,
    /// Measured modes that are not in the order of their frequencies.
    LeverModeOrder,
    /// A mass or a number of a mode in addition to the measured modes of the lever.
    OfLeverModes,
    /// A spring or a damper in addition to a nonlinear law.
    SpringOfLaw,
    /// A number that only this other law has.
    OtherLaw(ContactLaw),
    /// Amplitude or phase of a further tone, by its number (2 or 3), that has no frequency.
    NoTone(usize),
    /// More than three tones, or a third tone that never repeats together with the first.
    Tones,
    /// Two tones with the same frequency.
    SameTone,
    /// Tones that repeat together after too many periods.
    Repetition,
    /// A feedback under which the free lever oscillates by itself.
    SelfExcited,
}

impl fmt::Display for Reason {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Modes => write!(formatter, "must be a whole number from 1 to {MAX_MODES}"),
            Self::NotFinite => formatter.write_str("must be a finite number"),
            Self::Negative => formatter.write_str(
                "must be 0 or more: a negative mass, stiffness or damping is not a contact model",
            ),
            Self::NegativeDrive => formatter.write_str(
                "must be 0 or more (0 leaves the beam undriven); \
                 a negative amplitude is the positive one half a period later",
            ),
            Self::TooLarge => write!(
                formatter,
                "must be at most {LARGEST_ALPHA:e} in size; is it a dimensional value?"
            ),
            Self::FrequencyNotPositive => formatter.write_str(
                "must be more than 0; for a beam without drive set `alpha2` = 0 instead",
            ),
            Self::FrequencyOutOfRange => write!(
                formatter,
                "must lie between {:e} and {:e} (the first mode is at 3.516); \
                 is it in hertz?",
                OMEGA_RANGE.0, OMEGA_RANGE.1
            ),
            Self::Law(reason) => formatter.write_str(reason),
            Self::Arms => write!(
                formatter,
                "expected 1 to {MAX_ARMS} relaxing arms, each a time and a stiffness"
            ),
            Self::ArmTime => write!(
                formatter,
                "the time of an arm must be above 0 and at most {LARGEST_ALPHA:e}"
            ),
            Self::LeverModes(count) => write!(
                formatter,
                "must be at most {count}, the number of the lever's measured modes"
            ),
            Self::LeverMode => write!(
                formatter,
                "frequency and stiffness of a mode must be above 0, its quality factor 0 or more, \
                 and all of its numbers at most {LARGEST_ALPHA:e} in size"
            ),
            Self::LeverModeOrder => formatter.write_str(
                "the modes must be in the order of their frequencies, each different from the others",
            ),
            Self::OfLeverModes => formatter.write_str(
                "must be 0 for a lever whose modes were measured: they contain the tip's mass and \
                 each mode's own numbers",
            ),
            Self::SpringOfLaw => formatter.write_str(
                "must be 0 with a nonlinear force law, which describes the whole sample",
            ),
            Self::NoTone(number) => {
                let word = if *number == 2 { "second" } else { "third" };
                write!(
                    formatter,
                    "no {word} tone: give tone{number}_ratio, as in \"25/4\", or leave this out"
                )
            }
            Self::Tones => write!(
                formatter,
                "expected at most {MAX_TONES} tones, and ratios of whole numbers for all of three"
            ),
            Self::SelfExcited => formatter.write_str(
                "the free lever would oscillate by itself: take a smaller gain, or a phase nearer -90 degrees",
            ),
            Self::SameTone => formatter
                .write_str("two tones have the same frequency: add their amplitudes to one tone"),
            Self::Repetition => write!(
                formatter,
                "the tones repeat together after more than {} periods of the first; choose \
                 ratios with a common denominator",
                LARGEST.0
            ),
            Self::OtherLaw(law) => write!(
                formatter,
                "belongs to contact = \"{law}\"; leave it out with any other"
            ),
        }
    }
}

impl From<CantileverError> for nanotap_error::Error {
    fn from(error: CantileverError) -> Self {
        Self::input(error.to_string(), "change it in the case")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_cases_are_valid_and_as_printed() {
        // Eq. (26) of the paper, with the α1, Ω and N of its Figs. 6–9.
        let paper = Cantilever::paper();
        let expected = [0.1, 0.1, 0.1, 20.0, 0.0, 0.2, 2.6];
        assert_eq!(Parameter::ALL.map(|p| paper.get(p)), expected);
        // Eq. (24) of the paper, with the Ω of its Fig. 4.
        let undamped = Cantilever::paper_eq24();
        let expected = [0.1, 0.1, 0.0, 20.0, 0.0, 0.0, 4.1];
        assert_eq!(Parameter::ALL.map(|p| undamped.get(p)), expected);
        assert_eq!(paper.validate(), Ok(()));
        assert_eq!(undamped.validate(), Ok(()));
    }

    #[test]
    fn with_changes_one_parameter_and_no_other() {
        for changed in Parameter::ALL {
            let case = Cantilever::paper().with(changed, 0.625);
            for parameter in Parameter::ALL {
                let expected = if parameter == changed {
                    0.625
                } else {
                    Cantilever::paper().get(parameter)
                };
                assert_eq!(case.get(parameter), expected);
            }
        }
    }

    #[test]
    fn every_refusal_names_key_and_value() {
        let paper = Cantilever::paper;
        let mut bad = vec![
            (paper().with_modes(0), "modes", Reason::Modes),
            (paper().with_modes(51), "modes", Reason::Modes),
            (paper().with_modes(usize::MAX), "modes", Reason::Modes),
            (
                paper().with(Parameter::Alpha2, -0.1),
                "alpha2",
                Reason::NegativeDrive,
            ),
            (
                paper().with(Parameter::Omega, 0.0),
                "omega",
                Reason::FrequencyNotPositive,
            ),
            (
                paper().with(Parameter::Omega, -2.6),
                "omega",
                Reason::FrequencyNotPositive,
            ),
            (
                paper().with(Parameter::Omega, 2e6),
                "omega",
                Reason::FrequencyOutOfRange,
            ),
            (
                paper().with(Parameter::Omega, 1e-300),
                "omega",
                Reason::FrequencyOutOfRange,
            ),
        ];
        for parameter in Parameter::ALL {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                bad.push((
                    paper().with(parameter, value),
                    parameter.name(),
                    Reason::NotFinite,
                ));
            }
        }
        for parameter in [
            Parameter::Alpha1,
            Parameter::Alpha3,
            Parameter::Alpha4,
            Parameter::Alpha6,
        ] {
            bad.push((
                paper().with(parameter, -1e-9),
                parameter.name(),
                Reason::Negative,
            ));
            bad.push((
                paper().with(parameter, 2e9),
                parameter.name(),
                Reason::TooLarge,
            ));
        }
        bad.push((
            paper().with(Parameter::Alpha5, -2e9),
            "alpha5",
            Reason::TooLarge,
        ));
        for (case, key, reason) in bad {
            let error = case.validate().unwrap_err();
            assert_eq!((error.key, error.reason), (key, reason));
            let message = error.to_string();
            assert!(message.contains(key) && message.contains(&shortest(error.value)));
        }
    }

    #[test]
    fn limits_themselves_are_allowed() {
        for (parameter, value) in [
            (Parameter::Alpha1, 0.0),
            (Parameter::Alpha2, 0.0),
            (Parameter::Alpha3, 0.0),
            (Parameter::Alpha4, 0.0),
            (Parameter::Alpha4, 1e9),
            (Parameter::Alpha5, -1.0),
            (Parameter::Alpha6, 0.0),
            (Parameter::Omega, 1e6),
        ] {
            assert_eq!(
                Cantilever::paper().with(parameter, value).validate(),
                Ok(())
            );
        }
        for modes in [1, 50] {
            assert_eq!(Cantilever::paper().with_modes(modes).validate(), Ok(()));
        }
    }
}
