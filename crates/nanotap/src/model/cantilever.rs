//! One dimensionless case of the model: how many modes and which parameters.

use std::fmt;

use serde::Serialize;

use crate::model::beam::{MAX_MODES, ModeCountError};
use crate::model::contact::ContactLaw;
use crate::model::contact::dual::Dual;
use crate::model::contact::law::Law;
use crate::model::contact::moving_surface::MovingSurface;
use crate::model::drive_form::{Actuation, FrequencyRatio};
use crate::model::higher_modes::HigherModes;
use crate::model::parameter::Parameter;
use crate::model::sample_law::SampleLaw;
use crate::number::shortest;

/// Which cosine term the drive has in Eq. (14) of the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CosineTerm {
    /// −α2 α3 Ω I cos Ωτ, as Eq. (6) has it.
    #[default]
    Corrected,
    /// −α2 α3 I cos Ωτ, as Eq. (14) is printed; kept for comparison.
    Printed,
}

impl CosineTerm {
    /// Both forms.
    pub const ALL: [Self; 2] = [Self::Corrected, Self::Printed];

    /// Its name in case files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Corrected => "corrected",
            Self::Printed => "printed",
        }
    }
}

/// A dimensionless case. Fields are as given: [`validate`](Self::validate) says
/// whether they make sense, and whatever is built from a case calls it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cantilever {
    /// Number of beam modes N, 1 to 50.
    pub modes: usize,
    /// Tip mass over beam mass, ≥ 0.
    pub alpha1: f64,
    /// Drive amplitude over the beam's gap, ≥ 0; 0 is an undriven beam.
    pub alpha2: f64,
    /// Damping of the beam, ≥ 0.
    pub alpha3: f64,
    /// Contact stiffness over bending stiffness, ≥ 0.
    pub alpha4: f64,
    /// The tip's gap over the beam's gap; negative where the sample stands beyond
    /// the tip's rest position, so that the tip presses on it at rest.
    pub alpha5: f64,
    /// Damping of the contact, ≥ 0.
    pub alpha6: f64,
    /// Drive frequency Ω > 0, in units of √(EI/(mL⁴)).
    pub omega: f64,
    /// Which form of Eq. (14) drives the beam.
    pub cosine_term: CosineTerm,
    /// How the sample answers the tip.
    pub contact: ContactLaw,
    /// A nonlinear force law in place of spring and damper, in the model's units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<SampleLaw>,
    /// Stiffness of the standard linear solid's relaxing arm over bending stiffness, ≥ 0;
    /// 0 with every other law.
    pub relaxation_stiffness: f64,
    /// Time in which that arm's force decays, ≥ 0; 0 with every other law.
    pub relaxation_time: f64,
    /// What a moving surface has of its own.
    #[serde(flatten)]
    pub surface: MovingSurface,
    /// Where the drive acts; α2 is an amplitude of motion or of force accordingly, see
    /// [`drive_form`](crate::model::drive_form).
    pub actuation: Actuation,
    /// Frequency of a second tone over Ω.
    pub tone2_ratio: Option<FrequencyRatio>,
    /// Its amplitude, measured as α2, ≥ 0; 0 without a second tone.
    pub tone2_amplitude: f64,
    /// Its phase in degrees.
    pub tone2_phase: f64,
    /// What was measured of the second and third mode, in place of the uniform beam's.
    #[serde(flatten)]
    pub higher_modes: HigherModes,
}

/// Largest size of α1 … α6. Beyond it a number is a slip (a value in SI units, say),
/// and products of parameters would no longer leave enough digits.
const LARGEST_ALPHA: f64 = 1e9;
/// Least damping of a moving surface, and its least part of the surface's stiffness.
const LEAST_SURFACE_DAMPING: f64 = 1e-15;
/// Range of Ω. The 50th mode is at 24,350 and the first at 3.5.
const OMEGA_RANGE: (f64, f64) = (1e-6, 1e6);

/// Where the value of a parameter stands.
macro_rules! place {
    ($case:ident, $parameter:ident $(, $mutable:tt)?) => {
        match $parameter {
            Parameter::Alpha1 => &$($mutable)? $case.alpha1,
            Parameter::Alpha2 => &$($mutable)? $case.alpha2,
            Parameter::Alpha3 => &$($mutable)? $case.alpha3,
            Parameter::Alpha4 => &$($mutable)? $case.alpha4,
            Parameter::Alpha5 => &$($mutable)? $case.alpha5,
            Parameter::Alpha6 => &$($mutable)? $case.alpha6,
            Parameter::Omega => &$($mutable)? $case.omega,
            Parameter::RelaxationStiffness => &$($mutable)? $case.relaxation_stiffness,
            Parameter::RelaxationTime => &$($mutable)? $case.relaxation_time,
            Parameter::SurfaceStiffness => &$($mutable)? $case.surface.stiffness,
            Parameter::SurfaceDamping => &$($mutable)? $case.surface.damping,
            Parameter::AdhesionForce => &$($mutable)? $case.surface.adhesion,
            Parameter::Tone2Amplitude => &$($mutable)? $case.tone2_amplitude,
            Parameter::Tone2Phase => &$($mutable)? $case.tone2_phase,
            Parameter::Mode2Frequency => &$($mutable)? $case.higher_modes.frequency[0],
            Parameter::Mode3Frequency => &$($mutable)? $case.higher_modes.frequency[1],
            Parameter::Mode2Quality => &$($mutable)? $case.higher_modes.quality[0],
            Parameter::Mode3Quality => &$($mutable)? $case.higher_modes.quality[1],
            Parameter::Mode2Stiffness => &$($mutable)? $case.higher_modes.stiffness[0],
            Parameter::Mode3Stiffness => &$($mutable)? $case.higher_modes.stiffness[1],
        }
    };
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
            relaxation_stiffness: 0.0,
            relaxation_time: 0.0,
            surface: MovingSurface::NONE,
            actuation: Actuation::Base,
            tone2_ratio: None,
            tone2_amplitude: 0.0,
            tone2_phase: 0.0,
            higher_modes: HigherModes::NONE,
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

    /// The value of a parameter.
    pub const fn get(&self, parameter: Parameter) -> f64 {
        *place!(self, parameter)
    }

    /// The same case with one parameter changed.
    #[must_use]
    pub fn with(mut self, parameter: Parameter, value: f64) -> Self {
        *place!(self, parameter, mut) = value;
        self
    }

    /// The same case with another number of modes.
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

    /// Whether a parameter has a meaning beside this case's law and drive.
    fn has(&self, parameter: Parameter) -> bool {
        let of_law = self.law.is_some();
        match parameter {
            Parameter::Alpha4 | Parameter::Alpha6 if of_law => false,
            Parameter::Alpha6 => self.contact != ContactLaw::StandardLinearSolid,
            Parameter::RelaxationStiffness | Parameter::RelaxationTime => {
                self.contact == ContactLaw::StandardLinearSolid
            }
            Parameter::SurfaceStiffness | Parameter::SurfaceDamping | Parameter::AdhesionForce => {
                self.contact == ContactLaw::MovingSurface && !of_law
            }
            Parameter::Tone2Amplitude | Parameter::Tone2Phase => self.tone2_ratio.is_some(),
            Parameter::Mode2Frequency
            | Parameter::Mode3Frequency
            | Parameter::Mode2Quality
            | Parameter::Mode3Quality
            | Parameter::Mode2Stiffness
            | Parameter::Mode3Stiffness => self.get(parameter) != 0.0,
            _ => true,
        }
    }

    /// The period of the drive: 2π/Ω, or with a second tone the time after which both
    /// repeat.
    pub fn period(&self) -> f64 {
        let repetition = self.tone2_ratio.map_or(1, FrequencyRatio::denominator);
        f64::from(repetition) * std::f64::consts::TAU / self.omega
    }

    /// What is wrong with the value of a parameter beside this case's law and drive: one that it
    /// does not have, or one that it cannot do without.
    pub(crate) fn misplaced(&self, parameter: Parameter) -> Option<Reason> {
        let there = self.has(parameter);
        let own = [Parameter::SurfaceStiffness, Parameter::SurfaceDamping];
        if there && own.contains(&parameter) && self.get(parameter) == 0.0 {
            return Some(Reason::BareSurface);
        }
        let slowest = LEAST_SURFACE_DAMPING * self.surface.stiffness.max(1.0);
        if there && parameter == Parameter::SurfaceDamping && self.surface.damping < slowest {
            return Some(Reason::FastSurface);
        }
        if there || self.get(parameter) == 0.0 {
            return None;
        }
        Some(match parameter {
            Parameter::Alpha4 | Parameter::Alpha6 if self.law.is_some() => Reason::SpringOfLaw,
            Parameter::Alpha6 => Reason::DamperOfSolid,
            Parameter::Tone2Amplitude | Parameter::Tone2Phase => Reason::NoSecondTone,
            Parameter::SurfaceStiffness | Parameter::SurfaceDamping | Parameter::AdhesionForce => {
                Reason::NoMovingSurface
            }
            _ => Reason::NoSolid,
        })
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`CantileverError`] for the first field that makes no sense, with its value and
    /// what would be right.
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
        Ok(())
    }

    /// A number of the case, with its derivative with respect to `parameter`.
    pub(crate) fn dual(&self, number: Parameter, parameter: Option<Parameter>) -> Dual {
        Dual::new(
            self.get(number),
            f64::from(u8::from(Some(number) == parameter)),
        )
    }

    /// What the sample answers, with the derivative of its numbers with respect to `parameter`.
    pub(crate) fn contact_law(&self, parameter: Option<Parameter>) -> Law {
        self.contact.law(|number| self.dual(number, parameter))
    }
}

/// The least and the greatest value of a parameter.
pub const fn range(parameter: Parameter) -> (f64, f64) {
    match parameter {
        Parameter::Omega => OMEGA_RANGE,
        Parameter::Alpha5 | Parameter::Tone2Phase => (-LARGEST_ALPHA, LARGEST_ALPHA),
        _ => (0.0, LARGEST_ALPHA),
    }
}

/// Checks one parameter on its own.
///
/// # Errors
/// [`CantileverError`] if `value` makes no sense for `parameter`.
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

/// What is wrong with `value` for `parameter`, if anything.
fn objection(parameter: Parameter, value: f64) -> Option<Reason> {
    if !value.is_finite() {
        return Some(Reason::NotFinite);
    }
    let (least, greatest) = range(parameter);
    if (least..=greatest).contains(&value) {
        return None;
    }
    Some(match parameter {
        Parameter::Omega if value <= 0.0 => Reason::FrequencyNotPositive,
        Parameter::Omega => Reason::FrequencyOutOfRange,
        _ if value.abs() > LARGEST_ALPHA => Reason::TooLarge,
        Parameter::Alpha2 | Parameter::Tone2Amplitude => Reason::NegativeDrive,
        _ => Reason::Negative,
    })
}

/// A field of a [`Cantilever`] that makes no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{key}` = {}: {reason}", shortest(*value))]
pub struct CantileverError {
    /// The field's name in a case file.
    pub key: &'static str,
    /// The value given.
    pub value: f64,
    /// What would be right.
    pub reason: Reason,
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
    /// NaN or infinite.
    NotFinite,
    /// A mass, stiffness or damping below zero.
    Negative,
    /// A drive amplitude below zero.
    NegativeDrive,
    /// A size beyond 10⁹.
    TooLarge,
    /// Ω ≤ 0.
    FrequencyNotPositive,
    /// Ω outside 10⁻⁶ … 10⁶.
    FrequencyOutOfRange,
    /// A damper beside a standard linear solid.
    DamperOfSolid,
    /// A spring or a damper beside a nonlinear law.
    SpringOfLaw,
    /// A relaxing arm of another law.
    NoSolid,
    /// A surface of its own under another law.
    NoMovingSurface,
    /// A moving surface without a spring or a damper of its own.
    BareSurface,
    /// A moving surface that recovers in no time that counts.
    FastSurface,
    /// A second tone without a frequency.
    NoSecondTone,
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
            Self::DamperOfSolid => formatter.write_str(
                "must be 0 with contact = \"standard-linear-solid\", whose damper is its arm's: \
                 relaxation_stiffness times relaxation_time",
            ),
            Self::SpringOfLaw => formatter
                .write_str("must be 0 beside a nonlinear force law, which is all of the sample"),
            Self::NoSecondTone => formatter.write_str(
                "there is no second tone: give tone2_ratio, as in \"25/4\", or leave this out",
            ),
            Self::NoSolid => formatter.write_str(
                "belongs to contact = \"standard-linear-solid\"; leave it out with any other",
            ),
            Self::NoMovingSurface => formatter
                .write_str("belongs to contact = \"moving-surface\"; leave it out with any other"),
            Self::BareSurface => formatter.write_str(
                "must be above 0 with contact = \"moving-surface\": the surface has a spring and a \
                 damper of its own, and without one it is a \"kelvin-voigt\" or \"spring-damper\" \
                 sample",
            ),
            Self::FastSurface => write!(
                formatter,
                "must be at least {LEAST_SURFACE_DAMPING:e}, and that part of surface_stiffness: \
                 such a surface recovers at once"
            ),
        }
    }
}

impl From<CantileverError> for crate::Error {
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
