//! The tip: its mass, given or from its shape, its radius and what it is made of.

use super::catalogue::{Catalogue, Lever as CatalogueLever};
use super::error::PhysicalError;
use super::quantity::Kind;
use super::sample::Elastic;
use super::section::{Reader, Sections};
use crate::case::near_name::suggestion;

/// A solid tip under the end of the lever.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TipShape {
    /// A cone standing on its base.
    Cone {
        /// Height in m.
        height: f64,
        /// Angle between axis and flank in rad.
        half_angle: f64,
    },
    /// A pyramid on a square base.
    Pyramid {
        /// Height in m.
        height: f64,
        /// Angle between axis and the middle of a face in rad.
        half_angle: f64,
    },
    /// A sphere, as glued on for colloidal probes.
    Sphere {
        /// Radius in m.
        radius: f64,
    },
}

impl TipShape {
    /// Volume in m³.
    pub fn volume(self) -> f64 {
        use std::f64::consts::PI;
        match self {
            Self::Cone { height, half_angle } => {
                PI / 3.0 * height.powi(3) * half_angle.tan().powi(2)
            }
            Self::Pyramid { height, half_angle } => {
                4.0 / 3.0 * height.powi(3) * half_angle.tan().powi(2)
            }
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
        }
    }
}

/// How the mass at the end of the beam is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TipMass {
    /// In kg.
    Absolute(f64),
    /// As a fraction of the beam's mass: α1.
    Ratio(f64),
    /// From the frequency of the second mode in Hz.
    SecondMode(f64),
}

/// The tip as the case file has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tip {
    /// Its mass; none given counts as zero.
    pub mass: Option<TipMass>,
    /// Radius of curvature of the apex in m.
    pub radius: Option<f64>,
    /// Height in m: what separates the beam from the sample when the tip touches.
    pub height: Option<f64>,
    /// Elastic constants; without them the tip counts as rigid.
    pub elastic: Option<Elastic>,
}

pub(crate) const KEYS: &[&str] = &[
    "mass",
    "mass_ratio",
    "shape",
    "height",
    "half_angle",
    "density",
    "radius",
    "material",
    "modulus",
    "poisson",
];

const SHAPES: &[&str] = &["cone", "pyramid", "sphere"];

impl Tip {
    /// The section `[tip]`; a lever from the catalogue lends its tip's radius and height.
    pub(crate) fn read(
        sections: &Sections,
        catalogue: &Catalogue,
        lever: Option<&CatalogueLever>,
    ) -> Result<Self, PhysicalError> {
        let reader = Reader::new(sections, "tip", KEYS)?;
        let radius = reader
            .positive("radius", Kind::Length)?
            .or_else(|| lever.and_then(|lever| lever.tip_radius));
        let height = reader
            .positive("height", Kind::Length)?
            .or_else(|| lever.and_then(|lever| lever.tip_height));
        let material = reader
            .text("material")
            .map(|name| catalogue.material(&reader.path("material"), name))
            .transpose()?;
        let elastic = Elastic::read(&reader, material)?;
        let density = reader
            .positive("density", Kind::Density)?
            .or_else(|| material.and_then(|material| material.density));
        let mass = read_mass(&reader, radius, height, density)?;
        Ok(Self {
            mass,
            radius,
            height,
            elastic,
        })
    }
}

fn read_mass(
    reader: &Reader<'_>,
    radius: Option<f64>,
    height: Option<f64>,
    density: Option<f64>,
) -> Result<Option<TipMass>, PhysicalError> {
    let reason = "each gives the tip's mass; keep the one that is known best";
    reader.not_both("mass", "mass_ratio", reason)?;
    reader.not_both("mass", "shape", reason)?;
    reader.not_both("mass_ratio", "shape", reason)?;
    let half_angle = reader.within(
        "half_angle",
        Kind::Angle,
        |angle| angle > 0.0 && angle < std::f64::consts::FRAC_PI_2,
        "it must lie between 0 and 90 deg",
    )?;
    if let Some(mass) = reader.not_negative("mass", Kind::Mass)? {
        return Ok(Some(TipMass::Absolute(mass)));
    }
    if let Some(ratio) = reader.not_negative("mass_ratio", Kind::Number)? {
        return Ok(Some(TipMass::Ratio(ratio)));
    }
    let Some(shape) = reader.text("shape") else {
        return Ok(None);
    };
    let needed = |value: Option<f64>, key: &str| {
        value.ok_or_else(|| {
            PhysicalError::missing(
                reader.path(key),
                format!("the mass of a {shape} follows from its shape and density"),
            )
        })
    };
    let shape = match shape {
        "cone" => TipShape::Cone {
            height: needed(height, "height")?,
            half_angle: needed(half_angle, "half_angle")?,
        },
        "pyramid" => TipShape::Pyramid {
            height: needed(height, "height")?,
            half_angle: needed(half_angle, "half_angle")?,
        },
        "sphere" => TipShape::Sphere {
            radius: needed(radius, "radius")?,
        },
        other => {
            return Err(PhysicalError::impossible(
                reader.path("shape"),
                format!("\"{other}\""),
                suggestion(other, SHAPES),
            ));
        }
    };
    let mass = shape.volume() * needed(density, "density")?;
    Ok(Some(TipMass::Absolute(mass)))
}
