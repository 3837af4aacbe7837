//! Piecewise-linear contact laws, under which the motion is still exact.
//!
//! A law is one file with its [`entry::Entry`]: name, numbers, keys of a physical case, notes,
//! and equations. The equations give the force in contact, the motion of the free surface, the
//! thresholds at which contact begins and ends, and where energy goes. All are sums
//! `h V_T + r V̇_T + Σ m_k s_k + c` of the height V_T of the tip over the undeformed surface, its
//! rate, the internal variables `s_k` of the surface, and a constant; see `law::Law`. The
//! model joins them with the beam to a piecewise-linear system.
//!
//! To add a law, write its file and add its line to the table below. Nonlinear laws (Hertz, DMT,
//! JKR), whose flow has no closed form, are in [`nonlinear`](crate::model::nonlinear).

pub(crate) mod dual;
pub mod entry;
pub(crate) mod law;

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::model::parameter::{Applies, Parameter, ParameterEntry};
use dual::Dual;
use entry::{Damper, Entry, Numbers};
use law::Law;

/// The table of laws: name in programs, and file.
macro_rules! laws {
    ($($law:ident = $file:ident;)*) => {
        $(mod $file;)*

        /// A piecewise-linear contact law.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        #[expect(missing_docs, reason = "each entry has a meaning")]
        pub enum ContactLaw { #[default] $($law),* }

        impl ContactLaw {
            /// Every law.
            pub const ALL: [Self; [$(stringify!($law)),*].len()] = [$(Self::$law),*];

            /// Entry of the table.
            pub const fn entry(self) -> &'static Entry {
                match self { $(Self::$law => &$file::ENTRY),* }
            }
        }
    };
}

laws! {
    SpringDamper = spring_damper;
    KelvinVoigt = kelvin_voigt;
    StandardLinearSolid = standard_linear_solid;
    MovingSurface = moving_surface;
}

/// How many numbers only one of the laws has.
pub(crate) const NUMBERS: usize = numbers_before(ContactLaw::ALL.len());

/// How many numbers the first `count` laws have for themselves.
const fn numbers_before(count: usize) -> usize {
    let (mut k, mut sum) = (0, 0);
    while k < count {
        sum += ContactLaw::ALL[k].entry().numbers.len();
        k += 1;
    }
    sum
}

/// Number `k` of all that only one of the laws has.
pub(crate) const fn number(k: usize) -> ParameterEntry {
    let mut of = 0;
    while numbers_before(of + 1) <= k {
        of += 1;
    }
    let law = ContactLaw::ALL[of];
    ParameterEntry {
        applies: Applies::Law(law),
        ..law.entry().numbers[k - numbers_before(of)]
    }
}

impl ContactLaw {
    /// Name in case files.
    pub const fn name(self) -> &'static str {
        self.entry().name
    }

    /// What it is, in a few words.
    pub const fn meaning(self) -> &'static str {
        self.entry().meaning
    }

    /// Whether it has the damper α6.
    pub const fn has_damper(self) -> bool {
        matches!(self.entry().damper, Damper::Contact { .. })
    }

    /// How many numbers the laws before it have for themselves.
    pub(crate) const fn first_number(self) -> usize {
        numbers_before(self as usize)
    }

    /// The equations with these numbers.
    pub(crate) fn law(self, dual: impl Fn(Parameter) -> Dual) -> Law {
        let own: Vec<Dual> = Parameter::of_law(self).map(&dual).collect();
        (self.entry().law)(Numbers {
            stiffness: dual(Parameter::Alpha4),
            damping: dual(Parameter::Alpha6),
            own: &own,
        })
    }
}

/// No sample, but `internal` variables that decay and affect nothing.
pub(crate) fn no_sample(internal: usize) -> Law {
    let none = Dual::constant(0.0);
    spring_damper::with_idle_variables(none, none, internal)
}

impl fmt::Display for ContactLaw {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.name())
    }
}

impl Serialize for ContactLaw {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
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
