//! The tip: its mass, given or from its shape, its radius and what it is made of.

use super::catalogue::Lever as CatalogueLever;
use super::elastic::Elastic;
use super::error::PhysicalError;
use super::reader::Reader;
use crate::key::Key;

/// A solid tip under the end of the lever.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TipShape {
    /// A cone standing on its base.
    Cone {
        /// Height of the cone, m.
        height: f64,
        /// Angle between axis and flank in rad.
        half_angle: f64,
    },
    /// A pyramid on a square base.
    Pyramid {
        /// Height of the pyramid, m.
        height: f64,
        /// Angle between axis and the middle of a face in rad.
        half_angle: f64,
    },
    /// A sphere, as glued on for colloidal probes.
    Sphere {
        /// Radius of the sphere, m.
        radius: f64,
    },
}

impl TipShape {
    /// Computes the volume, m³.
    pub fn volume(self) -> f64 {
        use std::f64::consts::PI;
        match self {
            Self::Cone { height, half_angle } => {
                PI / 3.0 * height.powi(3) * nanotap_arithmetic::tan(half_angle).powi(2)
            }
            Self::Pyramid { height, half_angle } => {
                4.0 / 3.0 * height.powi(3) * nanotap_arithmetic::tan(half_angle).powi(2)
            }
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
        }
    }
}

/// Determination of the mass at the end of the beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TipMass {
    /// Mass of the tip, kg.
    Absolute(f64),
    /// Mass of the tip as a fraction of the mass of the beam: α1.
    Ratio(f64),
    /// Frequency of the second mode, Hz, from which the mass of the tip follows.
    SecondMode(f64),
}

/// The tip of a case file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tip {
    /// How the mass is determined; `None` if not stated, which counts as zero.
    pub mass: Option<TipMass>,
    /// Radius of curvature of the apex in m.
    pub radius: Option<f64>,
    /// Height of the tip, m: distance of the beam from the sample when the tip touches.
    pub height: Option<f64>,
    /// Elastic constants; without them the tip counts as rigid.
    pub elastic: Option<Elastic>,
}

impl Tip {
    /// Reads `[tip]`, completed with radius and height of a catalogue lever.
    pub(crate) fn read(
        reader: Reader<'_>,
        lever: Option<&CatalogueLever>,
    ) -> Result<Self, PhysicalError> {
        let radius = reader
            .number(Key::TipRadius)?
            .or_else(|| lever.and_then(|lever| lever.tip_radius));
        let height = reader
            .number(Key::TipHeight)?
            .or_else(|| lever.and_then(|lever| lever.tip_height));
        let material = reader.material(Key::TipMaterial)?;
        let elastic = reader.elastic([Key::TipModulus, Key::TipPoisson], material)?;
        let density = reader
            .number(Key::TipDensity)?
            .or_else(|| material.and_then(|material| material.density));
        Ok(Self {
            mass: read_mass(reader, radius, height, density)?,
            radius,
            height,
            elastic,
        })
    }
}

fn read_mass(
    reader: Reader<'_>,
    radius: Option<f64>,
    height: Option<f64>,
    density: Option<f64>,
) -> Result<Option<TipMass>, PhysicalError> {
    let half_angle = reader.number(Key::TipHalfAngle)?;
    if let Some(mass) = reader.number(Key::TipMass)? {
        return Ok(Some(TipMass::Absolute(mass)));
    }
    if let Some(ratio) = reader.number(Key::TipMassRatio)? {
        return Ok(Some(TipMass::Ratio(ratio)));
    }
    let Some(shape) = reader.word(Key::TipShape) else {
        return Ok(None);
    };
    let needed = |value: Option<f64>, key: Key| {
        value.ok_or_else(|| {
            PhysicalError::missing(
                key,
                format!("the mass of a {shape} follows from its shape and density"),
            )
        })
    };
    let shape = match shape {
        "cone" => TipShape::Cone {
            height: needed(height, Key::TipHeight)?,
            half_angle: needed(half_angle, Key::TipHalfAngle)?,
        },
        "pyramid" => TipShape::Pyramid {
            height: needed(height, Key::TipHeight)?,
            half_angle: needed(half_angle, Key::TipHalfAngle)?,
        },
        _ => TipShape::Sphere {
            radius: needed(radius, Key::TipRadius)?,
        },
    };
    let mass = shape.volume() * needed(density, Key::TipDensity)?;
    Ok(Some(TipMass::Absolute(mass)))
}
