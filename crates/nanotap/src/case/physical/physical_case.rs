//! A case as an experimenter states it, and what the model makes of it.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::catalogue::{self, Catalogue};
use super::drive::{self, Drive, DriveFrequency, DriveStrength, Gaps, Setpoint};
use super::error::PhysicalError;
use super::free_response::{free_response, response_at};
use super::lever::{self, Lever, LeverData};
use super::mapping::{MappingRow, PhysicalParameters, Scales, mapping_table};
use super::quantity::Kind;
use super::remark::Remark;
use super::sample::{self, Sample};
use super::section::{Reader, Sections};
use super::tip::{self, Tip};
use crate::case::near_name::suggestion;
use crate::model::cantilever::{Cantilever, CosineTerm};
use crate::model::drive_form::Actuation;
use crate::model::exact_beam;
use crate::model::parameter::Parameter;

/// The sections of a physical case with the keys that each may have.
pub const SECTIONS: [(&str, &[&str]); 5] = [
    ("cantilever", lever::KEYS),
    ("tip", tip::KEYS),
    ("sample", sample::KEYS),
    ("drive", drive::DRIVE_KEYS),
    ("gap", drive::GAP_KEYS),
];

/// Height of the tip where nothing tells it; tips of silicon levers are 10 to 15 µm high.
const USUAL_TIP_HEIGHT: f64 = 10e-6;

/// A lever, a tip, a sample, a drive and gaps, read and each checked by itself; SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct PhysicalCase {
    /// Number of modes N of the model.
    pub modes: usize,
    /// Which form of Eq. (14) drives the beam.
    pub cosine_term: CosineTerm,
    /// The lever.
    pub lever: LeverData,
    /// The tip.
    pub tip: Tip,
    /// The sample.
    pub sample: Sample,
    /// The drive.
    pub drive: Drive,
    /// The gaps.
    pub gaps: Gaps,
    /// What was assumed while reading.
    pub remarks: Vec<Remark>,
}

/// A physical case with its dimensionless parameters and the units between the two.
#[derive(Debug, Clone, PartialEq)]
pub struct Resolved {
    /// The dimensionless case, valid.
    pub case: Cantilever,
    /// SI values of the model's units.
    pub scales: Scales,
    /// The lever.
    pub lever: Lever,
    /// The sample.
    pub sample: Sample,
    /// The physical quantities behind α1 … α6 and Ω.
    pub parameters: PhysicalParameters,
    /// Free amplitude A₀ of the tip's deflection at the drive frequency, in m.
    pub free_amplitude: f64,
    /// Free amplitude of the second tone, in m, if there is one.
    pub second_free_amplitude: Option<f64>,
    /// Phase of the free deflection behind the drive (the base's displacement, or the force
    /// on the lever) in degrees: 90 at resonance.
    pub free_phase: f64,
    /// Setpoint amplitude over A₀, if one was given: experiments solve for its gap.
    pub setpoint: Option<f64>,
    /// Height of the tip, g₀ − g₁, in m.
    pub tip_height: f64,
    /// Assumptions and warnings.
    pub remarks: Vec<Remark>,
}

impl PhysicalCase {
    /// Reads the sections `[cantilever]`, `[tip]`, `[sample]`, `[drive]` and `[gap]`, given
    /// as key → text. Numbers may be passed as their text.
    ///
    /// # Errors
    /// [`PhysicalError`] names section and key, what was given and what would be right.
    pub fn from_sections(
        sections: &Sections,
        modes: usize,
        cosine_term: CosineTerm,
        catalogue: &Catalogue,
    ) -> Result<Self, PhysicalError> {
        let names = SECTIONS.map(|(name, _)| name);
        if let Some(section) = sections.keys().find(|s| !names.contains(&s.as_str())) {
            return Err(PhysicalError::UnknownSection {
                section: section.clone(),
                suggestion: suggestion(section, &names),
            });
        }
        let reader = Reader::new(sections, "cantilever", lever::KEYS)?;
        let known: Option<&catalogue::Lever> = reader
            .text("lever")
            .map(|name| catalogue.lever(&reader.path("lever"), name))
            .transpose()?;
        let mut remarks = Vec::new();
        if let Some(known) = known {
            remarks.push(Remark::note(format!(
                "lever \"{}\" from the catalogue: {}",
                known.name, known.source
            )));
        }
        let tip = Tip::read(sections, catalogue, known)?;
        let lever = LeverData::read(&reader, known, tip.mass)?;
        if tip.mass.is_none() && reader.text("f2").is_none() {
            remarks.push(Remark::note(
                "no tip mass is given: taken as zero (cantilever.f2, tip.mass, tip.mass_ratio \
                 or tip.shape would tell it)",
            ));
        }
        Ok(Self {
            modes,
            cosine_term,
            lever,
            tip,
            sample: Sample::read(sections, catalogue, &tip)?,
            drive: Drive::read(sections)?,
            gaps: Gaps::read(sections)?,
            remarks,
        })
    }

    /// The model's parameters and units.
    ///
    /// # Errors
    /// [`PhysicalError`] if the quantities contradict each other or describe something
    /// impossible.
    pub fn resolve(&self) -> Result<Resolved, PhysicalError> {
        let mut remarks = self.remarks.clone();
        let (lever, lever_remarks) = Lever::resolve(&self.lever)?;
        remarks.extend(lever_remarks);
        remarks.extend(self.sample.remarks.iter().cloned());
        let frequency = match self.drive.frequency {
            DriveFrequency::Absolute(frequency) => frequency,
            DriveFrequency::Ratio(ratio) => ratio * lever.f0,
        };
        let ratio = self.drive.second.map(|s| s.frequency.ratio(frequency));
        let like = Cantilever {
            modes: self.modes,
            cosine_term: self.cosine_term,
            contact: self.sample.law,
            actuation: self.drive.actuation,
            tone2_ratio: ratio.transpose()?,
            ..Cantilever::paper()
        };
        // The free response does not depend on g0, so any length serves as unit here: g0 = 1 m,
        // in which a force is measured in k/3.
        let free = Self::free_case(&lever, frequency, &like);
        let unit = Scales::new(&lever, 1.0).of(Parameter::Alpha2, like.actuation);
        let response = free_response(&free)?;
        let strength =
            |strength, response: Complex<f64>, key| applied(strength, response.norm() / unit, key);
        let (base, free_amplitude) =
            strength(self.drive.strength, response, "drive.free_amplitude")?;
        let second = match (self.drive.second, like.tone2_ratio) {
            (Some(second), Some(ratio)) => {
                let response = response_at(&free, ratio.value() * free.omega)?;
                let key = "drive.second_free_amplitude";
                Some((second.phase, strength(second.strength, response, key)?))
            }
            _ => None,
        };
        let setpoint = self.setpoint_ratio(free_amplitude)?;
        let (tip_gap, beam_gap) = self.gaps(setpoint, free_amplitude, &mut remarks)?;
        let scales = Scales::new(&lever, beam_gap);
        let parameters = PhysicalParameters {
            tip_mass: lever.tip_mass(),
            drive_amplitude: base,
            beam_damping: lever.damping() * scales.damping,
            contact_stiffness: self.sample.stiffness,
            tip_gap,
            contact_damping: self.sample.damper(TAU * frequency),
            drive_frequency: frequency,
            relaxation_stiffness: self.sample.relaxation_stiffness,
            relaxation_time: self.sample.relaxation_time,
            tone2_amplitude: second.map_or(0.0, |(_, (applied, _))| applied),
            tone2_phase: second.map_or(0.0, |(phase, _)| phase),
        };
        let case = parameters.to_case(&scales, &like);
        case.validate()?;
        let resolved = Resolved {
            case,
            scales,
            lever,
            sample: self.sample.clone(),
            parameters,
            free_amplitude,
            second_free_amplitude: second.map(|(_, (_, free))| free),
            free_phase: -response.arg().to_degrees(),
            setpoint,
            tip_height: beam_gap - tip_gap,
            remarks: Vec::new(),
        };
        remarks.extend(resolved.clearance_remarks());
        remarks.extend(resolved.truncation_remark()?);
        Ok(Resolved {
            remarks,
            ..resolved
        })
    }

    /// The lever alone, driven with unit amplitude.
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
            ..Cantilever::paper()
        }
    }

    fn setpoint_ratio(&self, free_amplitude: f64) -> Result<Option<f64>, PhysicalError> {
        match self.drive.setpoint {
            None => Ok(None),
            Some(Setpoint::Ratio(ratio)) => Ok(Some(ratio)),
            Some(Setpoint::Amplitude(amplitude)) if amplitude < free_amplitude => {
                Ok(Some(amplitude / free_amplitude))
            }
            Some(Setpoint::Amplitude(amplitude)) => Err(PhysicalError::impossible(
                "drive.setpoint",
                Kind::Length.format(amplitude),
                format!(
                    "it must be below the free amplitude, {}",
                    Kind::Length.format(free_amplitude)
                ),
            )),
        }
    }

    /// g₁ and g₀ in m.
    fn gaps(
        &self,
        setpoint: Option<f64>,
        free_amplitude: f64,
        remarks: &mut Vec<Remark>,
    ) -> Result<(f64, f64), PhysicalError> {
        let tip_gap = match (self.gaps.tip, setpoint) {
            (Some(gap), _) => gap,
            (None, Some(ratio)) => {
                let gap = ratio * free_amplitude;
                remarks.push(Remark::note(format!(
                    "gap.tip is not given: {}, the setpoint amplitude, until the setpoint is \
                     solved for",
                    Kind::Length.format(gap)
                )));
                gap
            }
            (None, None) => {
                return Err(PhysicalError::missing(
                    "gap.tip",
                    "give the gap between tip and sample at rest, or drive.setpoint",
                ));
            }
        };
        let beam_gap = match (self.gaps.beam, self.tip.height) {
            (Some(gap), _) => gap,
            (None, Some(height)) => tip_gap + height,
            (None, None) => {
                remarks.push(Remark::note(format!(
                    "neither gap.beam nor tip.height is given: the tip counts as {} high, which \
                     matters only for whether the beam touches",
                    Kind::Length.format(USUAL_TIP_HEIGHT)
                )));
                tip_gap + USUAL_TIP_HEIGHT
            }
        };
        if beam_gap > tip_gap && beam_gap > 0.0 {
            return Ok((tip_gap, beam_gap));
        }
        Err(PhysicalError::impossible(
            "gap.beam",
            Kind::Length.format(beam_gap),
            format!(
                "it is the tip's gap, {}, and the tip's height together: it must be above \
                 zero and above gap.tip, or the beam would touch before the tip",
                Kind::Length.format(tip_gap)
            ),
        ))
    }
}

/// Amplitude of the drive and of the free tip, one from the other by the `gain` from the
/// first to the second, both in SI.
fn applied(
    strength: DriveStrength,
    gain: f64,
    key: &'static str,
) -> Result<(f64, f64), PhysicalError> {
    match strength {
        DriveStrength::Applied(applied) => Ok((applied, applied * gain)),
        DriveStrength::Free(free) if (free / gain).is_finite() => Ok((free / gain, free)),
        DriveStrength::Free(free) => Err(PhysicalError::impossible(
            key,
            Kind::Length.format(free),
            "the lever does not move at this drive frequency",
        )),
    }
}

impl Resolved {
    /// The mapping to α1 … α6 and Ω, line by line.
    pub fn mapping(&self) -> Vec<MappingRow> {
        mapping_table(&self.case, &self.scales)
    }

    /// What phases are counted from.
    pub const fn phase_reference(&self) -> &'static str {
        match self.case.actuation {
            Actuation::Base => "displacement of the clamped end",
            Actuation::Tip => "force at the tip",
            Actuation::Distributed => "force on the lever",
        }
    }

    /// Whether another part of the beam would touch. The trajectory decides in the end; what
    /// can be said beforehand is how deep the tip sinks when it brings its energy along,
    /// ½kA₀² = ½K₁δ², but no deeper than it swings.
    fn clearance_remarks(&self) -> Vec<Remark> {
        let mut remarks = Vec::new();
        let base = match self.case.actuation {
            Actuation::Base => self.parameters.drive_amplitude + self.parameters.tone2_amplitude,
            Actuation::Tip | Actuation::Distributed => 0.0,
        };
        if base >= self.scales.length {
            remarks.push(Remark::warning(format!(
                "the drive moves the clamped end by {}, further than its gap of {}: the beam \
                 would touch the sample",
                Kind::Length.format(base),
                Kind::Length.format(self.scales.length)
            )));
        }
        let softness = (self.lever.k / self.sample.stiffness).sqrt().min(1.0);
        let static_depth = (-self.parameters.tip_gap).max(0.0) * self.lever.k
            / (self.lever.k + self.sample.stiffness);
        let depth = (self.free_amplitude + base) * softness + static_depth;
        if depth >= self.tip_height {
            remarks.push(Remark::warning(format!(
                "on so soft a sample the tip may sink by {}, more than its height of {}: \
                 another part of the beam would touch",
                Kind::Length.format_digits(depth, 2),
                Kind::Length.format(self.tip_height)
            )));
        }
        if let Some(hertz) = self.sample.hertz
            && hertz.indentation >= self.tip_height
        {
            remarks.push(Remark::warning(format!(
                "the indentation of {} is more than the tip's height of {}: another part of \
                 the beam would touch",
                Kind::Length.format(hertz.indentation),
                Kind::Length.format(self.tip_height)
            )));
        }
        remarks
    }

    /// How far the truncated model's first resonance lies from f₀: with a tip mass, modes of
    /// the bare beam do not reproduce it exactly.
    fn truncation_remark(&self) -> Result<Option<Remark>, PhysicalError> {
        let exact = exact_beam::frequencies(self.case.alpha1, 0.0, 1)?[0];
        let truncated = truncated_first_frequency(&self.case)?;
        let shift = truncated / exact - 1.0;
        if shift * self.lever.quality_factor < 0.05 {
            return Ok(None);
        }
        Ok(Some(Remark::warning(format!(
            "with {} modes the model resonates at {} instead of {}, {} of the resonance's \
             width away: take more modes",
            self.case.modes,
            Kind::Frequency.format_digits(self.lever.f0 * (1.0 + shift), 5),
            Kind::Frequency.format_digits(self.lever.f0, 5),
            Kind::Number.format_digits(shift * self.lever.quality_factor, 2)
        ))))
    }
}

/// First natural frequency of the Galerkin equations with tip mass: the root below ω₀₁ of
/// 1 = α1Ω² Σφ_j(1)²/(β_j⁴ − Ω²), whose right side rises from 0 to infinity.
fn truncated_first_frequency(case: &Cantilever) -> Result<f64, PhysicalError> {
    let bare = exact_beam::frequencies(0.0, 0.0, case.modes)?;
    let excess = |omega: f64| {
        let square = omega * omega;
        let sum: f64 = bare
            .iter()
            .map(|frequency| 4.0 / (frequency * frequency - square))
            .sum();
        case.alpha1 * square * sum >= 1.0
    };
    let (mut low, mut high) = (0.0, bare[0]);
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Ok(middle);
        }
        if excess(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
}
