//! The sample under the tip: a spring and a damper, given or from Hertz's contact.

use super::catalogue::{Catalogue, Material};
use super::error::PhysicalError;
use super::quantity::Kind;
use super::remark::Remark;
use super::section::{Reader, Sections};
use super::tip::Tip;
use crate::model::contact::{ContactLaw, UnknownContactLaw};

/// Elastic constants of an isotropic solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elastic {
    /// Young's modulus in Pa, above zero.
    pub modulus: f64,
    /// Poisson's ratio, from -1 to 0.5, ends left out on the lower side.
    pub poisson: f64,
}

impl Elastic {
    /// E/(1 − ν²): what presses back on a rigid indenter, in Pa.
    pub fn plane_strain_modulus(self) -> f64 {
        self.modulus / (1.0 - self.poisson * self.poisson)
    }

    /// `modulus` and `poisson` of a section, with a catalogue's material for what is not given.
    pub(crate) fn read(
        reader: &Reader<'_>,
        material: Option<&Material>,
    ) -> Result<Option<Self>, PhysicalError> {
        let modulus = reader
            .positive("modulus", Kind::Pressure)?
            .or_else(|| material.map(|material| material.elastic.modulus));
        let poisson = reader
            .within(
                "poisson",
                Kind::Number,
                |ratio| ratio > -1.0 && ratio <= 0.5,
                "Poisson's ratio of a stable solid lies above -1 and not above 0.5",
            )?
            .or_else(|| material.map(|material| material.elastic.poisson));
        match (modulus, poisson) {
            (Some(modulus), Some(poisson)) => Ok(Some(Self { modulus, poisson })),
            (None, None) => Ok(None),
            (Some(_), None) => Err(PhysicalError::missing(
                reader.path("poisson"),
                "a contact needs Poisson's ratio beside the modulus (0.3 to 0.5 for polymers)",
            )),
            (None, Some(_)) => Err(PhysicalError::missing(
                reader.path("modulus"),
                "Poisson's ratio alone says nothing about the contact",
            )),
        }
    }
}

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
    /// E* in Pa.
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
        4.0 / 3.0 * self.reduced_modulus * self.radius.sqrt() * self.indentation.powf(1.5)
    }
}

/// How much a sample dissipates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SampleDamping {
    /// Damper C₁ in N s/m.
    Damper(f64),
    /// tan δ = C₁ω/K₁ at the drive frequency.
    LossTangent(f64),
}

/// The sample as the case file has it, with the tip that touches it.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Contact stiffness K₁ in N/m.
    pub stiffness: f64,
    /// The contact it comes from, if it is Hertz's.
    pub hertz: Option<Hertz>,
    /// Its damping; none given counts as zero.
    pub damping: Option<SampleDamping>,
    /// How it answers the tip.
    pub law: ContactLaw,
    /// Stiffness of a standard linear solid's relaxing arm in N/m; 0 of other samples.
    pub relaxation_stiffness: f64,
    /// Its relaxation time in s.
    pub relaxation_time: f64,
    /// What had to be assumed.
    pub remarks: Vec<Remark>,
}

pub(crate) const KEYS: &[&str] = &[
    "law",
    "material",
    "stiffness",
    "damping",
    "loss_tangent",
    "relaxation_stiffness",
    "relaxation_time",
    "modulus",
    "poisson",
    "indentation",
];

impl Sample {
    /// The section `[sample]`.
    pub(crate) fn read(
        sections: &Sections,
        catalogue: &Catalogue,
        tip: &Tip,
    ) -> Result<Self, PhysicalError> {
        let reader = Reader::new(sections, "sample", KEYS)?;
        let mut remarks = Vec::new();
        reader.not_both("damping", "loss_tangent", "each gives the damper C1")?;
        for key in ["material", "modulus", "poisson", "indentation"] {
            reader.not_both("stiffness", key, "the stiffness is either given or Hertz's")?;
        }
        let given = reader.not_negative("stiffness", Kind::Stiffness)?;
        let (stiffness, hertz) = if let Some(stiffness) = given {
            (stiffness, None)
        } else {
            let hertz = read_hertz(&reader, catalogue, tip, &mut remarks)?;
            (hertz.stiffness(), Some(hertz))
        };
        let damper = reader.not_negative("damping", Kind::Damping)?;
        let tangent = reader.not_negative("loss_tangent", Kind::Number)?;
        let damping = damper
            .map(SampleDamping::Damper)
            .or(tangent.map(SampleDamping::LossTangent));
        let law = read_law(&reader)?;
        let [relaxation_stiffness, relaxation_time] = read_relaxation(&reader, law)?;
        if damping.is_none() && law != ContactLaw::StandardLinearSolid {
            remarks.push(Remark::note(
                "sample.damping is not given: the contact dissipates nothing",
            ));
        }
        Ok(Self {
            stiffness,
            hertz,
            damping,
            law,
            relaxation_stiffness,
            relaxation_time,
            remarks,
        })
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

fn read_law(reader: &Reader<'_>) -> Result<ContactLaw, PhysicalError> {
    reader
        .text("law")
        .map_or(Ok(ContactLaw::default()), |name| {
            name.parse().map_err(|error: UnknownContactLaw| {
                PhysicalError::impossible(reader.path("law"), name, error.to_string())
            })
        })
}

/// Stiffness and time of the relaxing arm, which the standard linear solid has in place of
/// a damper and no other law has.
fn read_relaxation(reader: &Reader<'_>, law: ContactLaw) -> Result<[f64; 2], PhysicalError> {
    let stiffness = reader.not_negative("relaxation_stiffness", Kind::Stiffness)?;
    let time = reader.not_negative("relaxation_time", Kind::Time)?;
    let refuse = |keys: [&str; 2], reason: &str| {
        let given = keys.into_iter().find(|key| reader.text(key).is_some());
        given.map_or(Ok(()), |key| {
            Err(PhysicalError::impossible(
                reader.path(key),
                reader.text(key).unwrap_or_default(),
                reason,
            ))
        })
    };
    if law != ContactLaw::StandardLinearSolid {
        refuse(
            ["relaxation_stiffness", "relaxation_time"],
            "it belongs to sample.law = \"standard-linear-solid\"",
        )?;
        return Ok([0.0; 2]);
    }
    refuse(
        ["damping", "loss_tangent"],
        "a standard linear solid has its damper in the relaxing arm: give \
         sample.relaxation_stiffness and sample.relaxation_time",
    )?;
    let needed = |value: Option<f64>, key: &str| {
        value.ok_or_else(|| {
            PhysicalError::missing(
                reader.path(key),
                "a standard linear solid has a relaxing arm of this stiffness, as in \
                 relaxation_stiffness = \"50 N/m\", and time, as in relaxation_time = \"0.5 us\"",
            )
        })
    };
    Ok([
        needed(stiffness, "relaxation_stiffness")?,
        needed(time, "relaxation_time")?,
    ])
}

fn read_hertz(
    reader: &Reader<'_>,
    catalogue: &Catalogue,
    tip: &Tip,
    remarks: &mut Vec<Remark>,
) -> Result<Hertz, PhysicalError> {
    let material = reader
        .text("material")
        .map(|name| catalogue.material(&reader.path("material"), name))
        .transpose()?;
    if let Some(material) = material {
        remarks.push(Remark::note(format!(
            "sample \"{}\" from the catalogue: {}",
            material.name, material.source
        )));
    }
    let elastic = Elastic::read(reader, material)?.ok_or_else(|| {
        PhysicalError::missing(
            reader.path("stiffness"),
            "the contact needs either a stiffness, or modulus and poisson, or a material",
        )
    })?;
    let radius = tip.radius.ok_or_else(|| {
        PhysicalError::missing(
            "tip.radius",
            "Hertz's contact needs the tip's radius; give it, or sample.stiffness",
        )
    })?;
    let given = reader.positive("indentation", Kind::Length)?;
    let indentation = given.unwrap_or(radius / 9.0);
    if given.is_none() {
        remarks.push(Remark::note(format!(
            "sample.indentation is not given: taken as a ninth of the tip's radius, {}, as the \
             paper does",
            Kind::Length.format(indentation)
        )));
    }
    if indentation > 0.5 * radius {
        remarks.push(Remark::warning(format!(
            "the indentation of {} is more than half the tip's radius of {}: \
             Hertz's parabola is no longer the tip's shape",
            Kind::Length.format(indentation),
            Kind::Length.format(radius)
        )));
    }
    match tip.elastic {
        None => remarks.push(Remark::note(
            "the tip counts as rigid: give tip.material, or tip.modulus and tip.poisson, \
             to include its own compliance",
        )),
        Some(_) => remarks.push(Remark::note("the tip's own compliance is included")),
    }
    Ok(Hertz {
        reduced_modulus: reduced_modulus(elastic, tip.elastic),
        radius,
        indentation,
    })
}
