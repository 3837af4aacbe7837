//! How the sample answers the tip: contact laws under which the motion is still exact.
//!
//! A law says in numbers only what the beam need know: the force in contact, what the free
//! surface does meanwhile, when contact begins and ends, and where energy goes. All are sums
//! `h V_T + r V̇_T + m s + c` of the height V_T of the tip over the undeformed surface, its rate,
//! the one number `s` that a surface with a memory carries, and a constant; see `law::Law`. The model
//! joins them with the beam to a piecewise-linear system.
//!
//! - `spring_damper`: the paper's; contact is where V_T ≤ 0, and its damper pulls on a tip
//!   that leaves;
//! - `kelvin_voigt`: the same spring and damper as a surface of its own; contact ends when
//!   the force is zero, and the surface recovers until the tip meets it again;
//! - `standard_linear_solid`: a spring beside a spring and damper in series;
//! - `moving_surface`: spring, damper and adhesion to a surface with a spring and a damper of its
//!   own.
//!
//! A law that is not linear (Hertz, DMT, JKR) has no place here, since its flow has no closed
//! form: see [`nonlinear`](crate::model::nonlinear).

pub(crate) mod dual;
mod kelvin_voigt;
pub(crate) mod law;
pub mod moving_surface;
mod spring_damper;
mod standard_linear_solid;

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::model::parameter::Parameter;
use dual::Dual;
use law::Law;

/// How the sample answers the tip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, JsonSchema, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactLaw {
    /// The paper's spring α4 and damper α6, in contact where V_T ≤ 0.
    #[default]
    SpringDamper,
    /// A surface of spring α4 and damper α6 that recovers by itself; contact ends when the
    /// force is zero.
    KelvinVoigt,
    /// A surface of a spring α4 beside a relaxing arm: a spring and a damper in series.
    StandardLinearSolid,
    /// A surface with a spring and a damper of its own, which the tip touches through spring α4
    /// and damper α6 and which holds it by a constant adhesion.
    MovingSurface,
}

impl ContactLaw {
    /// Every law.
    pub const ALL: [Self; 4] = [
        Self::SpringDamper,
        Self::KelvinVoigt,
        Self::StandardLinearSolid,
        Self::MovingSurface,
    ];

    /// Its name in case files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SpringDamper => "spring-damper",
            Self::KelvinVoigt => "kelvin-voigt",
            Self::StandardLinearSolid => "standard-linear-solid",
            Self::MovingSurface => "moving-surface",
        }
    }

    /// What it is, in a few words.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::SpringDamper => "spring and damper where the tip is below the surface",
            Self::KelvinVoigt => "spring and damper as a surface that recovers by itself",
            Self::StandardLinearSolid => "spring beside a relaxing arm, as a surface that recovers",
            Self::MovingSurface => "spring, damper and adhesion to a surface that moves by itself",
        }
    }

    /// The law with these numbers.
    pub(crate) fn law(self, dual: impl Fn(Parameter) -> Dual) -> Law {
        let stiffness = dual(Parameter::Alpha4);
        match self {
            Self::SpringDamper => spring_damper::law(stiffness, dual(Parameter::Alpha6)),
            Self::KelvinVoigt => kelvin_voigt::law(stiffness, dual(Parameter::Alpha6)),
            Self::StandardLinearSolid => standard_linear_solid::law(
                stiffness,
                dual(Parameter::RelaxationStiffness),
                dual(Parameter::RelaxationTime),
            ),
            Self::MovingSurface => moving_surface::law(
                [stiffness, dual(Parameter::Alpha6)],
                [
                    Parameter::SurfaceStiffness,
                    Parameter::SurfaceDamping,
                    Parameter::AdhesionForce,
                ]
                .map(dual),
            ),
        }
    }
}

/// No sample at all, beside a memory that nothing depends on or none.
pub(crate) fn no_sample(has_memory: bool) -> Law {
    let none = Dual::constant(0.0);
    if has_memory {
        spring_damper::without_memory(none, none)
    } else {
        spring_damper::law(none, none)
    }
}

impl fmt::Display for ContactLaw {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.name())
    }
}

/// A word that names no contact law.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{given}` is no contact law; there are {}", ContactLaw::ALL.map(ContactLaw::name).join(", "))]
pub struct UnknownContactLaw {
    /// The word.
    pub given: String,
}

impl FromStr for ContactLaw {
    type Err = UnknownContactLaw;

    /// Reads a law's name; underscores and blanks do for hyphens, and case does not matter.
    fn from_str(given: &str) -> Result<Self, UnknownContactLaw> {
        let word = given.trim().to_lowercase().replace(['_', ' '], "-");
        Self::ALL
            .into_iter()
            .find(|law| law.name() == word)
            .ok_or_else(|| UnknownContactLaw {
                given: given.to_owned(),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_law_is_read_by_its_name() {
        for law in ContactLaw::ALL {
            assert_eq!(law.name().parse(), Ok(law));
            assert_eq!(law.name().to_uppercase().replace('-', "_").parse(), Ok(law));
            assert_eq!(
                serde_json::to_string(&law).unwrap(),
                format!("\"{}\"", law.name())
            );
        }
        let refused = "hertz".parse::<ContactLaw>().unwrap_err().to_string();
        assert!(refused.contains("hertz") && refused.contains("kelvin-voigt"));
    }
}
