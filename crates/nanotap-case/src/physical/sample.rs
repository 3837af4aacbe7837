//! The sample under the tip: a spring and a damper, given or from Hertz's contact, or a
//! nonlinear force law.

use schemars::JsonSchema;
use serde::Serialize;

pub use super::elastic::Elastic;
use super::error::PhysicalError;
use super::force::SampleForce;
use super::reader::Reader;
use super::remark::Remark;
use super::tip::Tip;
use crate::force_table::ArmTable;
use crate::key::{Key, Laws};
use crate::quantity::Kind;
use nanotap_model::contact::ContactLaw;
use nanotap_model::contact::entry::Damper;
use nanotap_model::parameter::Parameter;

/// E* of two solids in contact, 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂, in Pa; without a tip's
/// constants the tip is rigid.
pub fn reduced_modulus(sample: Elastic, tip: Option<Elastic>) -> f64 {
    let sample = sample.plane_strain_modulus();
    match tip.map(Elastic::plane_strain_modulus) {
        None => sample,
        Some(tip) => sample * tip / (sample + tip),
    }
}

/// Hertz's contact of a sphere on a plane, taken as a spring at one indentation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hertz {
    /// Reduced modulus E* of sample and tip, Pa.
    pub reduced_modulus: f64,
    /// Radius R of the tip in m.
    pub radius: f64,
    /// Indentation Δ at which the stiffness is taken, in m.
    pub indentation: f64,
}

impl Hertz {
    /// The slope of F = (4/3) E* √R δ^(3/2) at δ = Δ: K₁ = 2 E* √(RΔ), in N/m.
    pub fn stiffness(self) -> f64 {
        2.0 * self.reduced_modulus * (self.radius * self.indentation).sqrt()
    }

    /// The force at the indentation Δ, (4/3) E* √R Δ^(3/2) in N.
    pub fn force(self) -> f64 {
        4.0 / 3.0
            * self.reduced_modulus
            * self.radius.sqrt()
            * nanotap_arithmetic::powf(self.indentation, 1.5)
    }
}

/// Largest relative deviation of Hertz's stiffness at the actual indentation.
const STIFFNESS_IN_DOUBT: f64 = 0.25;

/// A stiffness linearised at an indentation that differs from that of the motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct HertzMismatch {
    /// Indentation of the linearisation, m.
    #[schemars(extend("x-unit" = "m"))]
    pub assumed_indentation: f64,
    /// Stiffness at that indentation, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub assumed_stiffness: f64,
    /// Stiffness at the largest indentation of the motion, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub stiffness: f64,
}

impl Hertz {
    /// The mismatch at the greatest depth of a motion in m, where the stiffness there differs
    /// by more than a quarter from the one taken.
    pub fn mismatch(self, depth: f64) -> Option<HertzMismatch> {
        let there = Self {
            indentation: depth,
            ..self
        };
        let (assumed, stiffness) = (self.stiffness(), there.stiffness());
        (depth > 0.0 && (stiffness / assumed - 1.0).abs() > STIFFNESS_IN_DOUBT).then_some(
            HertzMismatch {
                assumed_indentation: self.indentation,
                assumed_stiffness: assumed,
                stiffness,
            },
        )
    }
}

/// Damping of a linear contact, as stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SampleDamping {
    /// Damper C₁ in N s/m.
    Damper(f64),
    /// tan δ = C₁ω/K₁ at the drive frequency.
    LossTangent(f64),
}

/// The sample of a case file, with the tip.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Contact stiffness K₁ in N/m.
    pub stiffness: f64,
    /// The Hertz contact from which it follows, if any.
    pub hertz: Option<Hertz>,
    /// Damping of the contact; `None` counts as zero.
    pub damping: Option<SampleDamping>,
    /// Law of the linear contact.
    pub law: ContactLaw,
    /// Numbers that only this law has, in the order of the law's entry, each in its SI unit.
    pub numbers: Vec<f64>,
    /// Relaxing arms of the law, in s and N/m.
    pub arms: Option<ArmTable>,
    /// Elastic constants of the sample; `None` unless the stiffness follows from Hertz's contact.
    pub elastic: Option<Elastic>,
    /// A nonlinear force law in place of the above.
    pub force: Option<SampleForce>,
}

impl Sample {
    /// Reads `[sample]` from the stated quantities.
    pub(crate) fn read(reader: Reader<'_>, tip: &Tip) -> Result<Self, PhysicalError> {
        if let Some(force) = SampleForce::read(reader, tip)? {
            return Ok(Self {
                stiffness: 0.0,
                hertz: None,
                damping: None,
                law: ContactLaw::default(),
                numbers: Vec::new(),
                arms: None,
                elastic: None,
                force: Some(force),
            });
        }
        let given = reader.number(Key::SampleStiffness)?;
        let (stiffness, hertz, elastic) = if let Some(stiffness) = given {
            (stiffness, None, None)
        } else {
            let (hertz, elastic) = read_hertz(reader, tip)?;
            (hertz.stiffness(), Some(hertz), Some(elastic))
        };
        let damper = reader.number(Key::SampleDamping)?;
        let tangent = reader.number(Key::SampleLossTangent)?;
        let damping = damper
            .map(SampleDamping::Damper)
            .or(tangent.map(SampleDamping::LossTangent));
        let law = crate::file::word(reader.stated, Key::SampleLaw).unwrap_or_default();
        Ok(Self {
            stiffness,
            hertz,
            damping,
            law,
            numbers: read_numbers(reader, law)?,
            arms: read_arms(reader, law)?,
            elastic,
            force: None,
        })
    }

    /// Assumptions and warnings about the sample.
    pub(crate) fn remarks(&self, reader: Reader<'_>, tip: &Tip) -> Vec<Remark> {
        if let Some(force) = &self.force {
            return force.remarks(reader, tip);
        }
        let mut remarks = Vec::new();
        if let Some(hertz) = self.hertz {
            if let Ok(Some(material)) = reader.material(Key::SampleMaterial) {
                remarks.push(Remark::note(format!(
                    "sample \"{}\" from the catalogue: {}",
                    material.name, material.source
                )));
            }
            if !reader.has(Key::SampleIndentation) {
                remarks.push(Remark::note(format!(
                    "sample.indentation is not given: taken as a ninth of the tip's radius, {}, \
                     as the paper does",
                    Kind::Length.format(hertz.indentation)
                )));
            }
            if hertz.indentation > 0.5 * hertz.radius {
                remarks.push(Remark::warning(format!(
                    "the indentation of {} is more than half the tip's radius of {}: \
                     Hertz's parabola is no longer the tip's shape",
                    Kind::Length.format(hertz.indentation),
                    Kind::Length.format(hertz.radius)
                )));
            }
            remarks.push(Remark::note(match tip.elastic {
                None => {
                    "the tip counts as rigid: give tip.material, or tip.modulus and tip.poisson, \
                     to include its own compliance"
                }
                Some(_) => "the tip's own compliance is included",
            }));
        }
        if let (None, Damper::Contact { none }) = (self.damping, self.law.entry().damper) {
            remarks.push(Remark::note(none));
        }
        remarks
    }

    /// Damper C₁ in N s/m for a drive of angular frequency `omega` in rad/s.
    pub fn damper(&self, omega: f64) -> f64 {
        match self.damping {
            None => 0.0,
            Some(SampleDamping::Damper(damper)) => damper,
            Some(SampleDamping::LossTangent(tangent)) => tangent * self.stiffness / omega,
        }
    }
}

/// The further parameters of `law`, in SI; those of other laws must not be stated.
fn read_numbers(reader: Reader<'_>, law: ContactLaw) -> Result<Vec<f64>, PhysicalError> {
    let refuse = |keys: &[Key], reason: &str| {
        let given = keys.iter().find(|key| reader.has(**key));
        given.map_or(Ok(()), |key| Err(reader.impossible(*key, reason)))
    };
    let mut numbers = Vec::new();
    for other in ContactLaw::ALL {
        let own = Parameter::of_law(other).filter_map(Key::stating);
        if other != law {
            let alone: Vec<Key> = own.filter(|key| key.entry().laws == Laws::Some).collect();
            refuse(&alone, &format!("it belongs to sample.law = \"{other}\""))?;
            continue;
        }
        let entry = law.entry();
        if let Damper::InArm { not_damping, .. } = entry.damper {
            refuse(&[Key::SampleDamping, Key::SampleLossTangent], not_damping)?;
        }
        for (key, number) in own.zip(entry.numbers) {
            let value = reader.number(key)?.or(number.default);
            numbers.push(value.ok_or_else(|| PhysicalError::missing(key, entry.needs))?);
        }
    }
    Ok(numbers)
}

/// The relaxing arms of `law`, if it has a list of these.
fn read_arms(reader: Reader<'_>, law: ContactLaw) -> Result<Option<ArmTable>, PhysicalError> {
    if !law.entry().arms {
        return Ok(None);
    }
    let arms = reader.arms(Key::SampleRelaxationArms);
    arms.cloned().map(Some).ok_or_else(|| {
        PhysicalError::missing(
            Key::SampleRelaxationArms,
            format!(
                "sample.law = \"{law}\" needs its relaxing arms, as in relaxation_arms = \
                 [[\"time (us)\", \"stiffness (N/m)\"], [0.5, 50], [4, 10]] or relaxation_arms = \
                 \"arms.csv\""
            ),
        )
    })
}

fn read_hertz(reader: Reader<'_>, tip: &Tip) -> Result<(Hertz, Elastic), PhysicalError> {
    let material = reader.material(Key::SampleMaterial)?;
    let elastic = reader
        .elastic([Key::SampleModulus, Key::SamplePoisson], material)?
        .ok_or_else(|| {
            PhysicalError::missing(
                Key::SampleStiffness,
                "the contact needs either a stiffness, or modulus and poisson, or a material",
            )
        })?;
    let radius = tip.radius.ok_or_else(|| {
        PhysicalError::missing(
            Key::TipRadius,
            "Hertz's contact needs the tip's radius; give it, or sample.stiffness",
        )
    })?;
    let indentation = reader.number(Key::SampleIndentation)?;
    let hertz = Hertz {
        reduced_modulus: reduced_modulus(elastic, tip.elastic),
        radius,
        indentation: indentation.unwrap_or(radius / 9.0),
    };
    Ok((hertz, elastic))
}
