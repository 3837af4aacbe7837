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
//! JKR), whose flow has no closed form, are in [`nonlinear`](crate::nonlinear).

pub mod dual;
pub mod entry;
pub(crate) mod law;

use crate::parameter::{Applies, Parameter, ParameterEntry, SampleKey};
use crate::words::words;
use dual::Dual;
use entry::{Damper, Entry, Numbers};
use law::Law;

/// The table of laws: name in programs, and file.
macro_rules! laws {
    ($($law:ident = $file:ident;)*) => {
        $(mod $file;)*

        words! {
            /// A piecewise-linear contact law, with its name in case files.
            #[expect(missing_docs, reason = "each entry has a meaning")]
            ContactLaw { $($law = $file::ENTRY.name),* }
        }

        impl ContactLaw {
            /// Returns the law's entry of the table: names, numbers, notes and equations.
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
    GeneralisedMaxwell = generalised_maxwell;
    MovingSurface = moving_surface;
}

pub(crate) use generalised_maxwell::MAX_ARMS;

/// Number of parameters that only one of the laws has.
pub(crate) const NUMBERS: usize = count(ContactLaw::ALL.len(), false);

/// Number of these that have a separate key among physical quantities.
pub const OWN_KEYS: usize = count(ContactLaw::ALL.len(), true);

/// Counts the parameters that only one of the first `laws` laws has, or of these, if `with_key`,
/// those that have a separate key.
const fn count(laws: usize, with_key: bool) -> usize {
    let (mut law, mut sum) = (0, 0);
    while law < laws {
        let numbers = ContactLaw::ALL[law].entry().numbers;
        let mut k = 0;
        while k < numbers.len() {
            let own = matches!(numbers[k].stated_by, Some(SampleKey::Own { .. }));
            sum += (own || !with_key) as usize;
            k += 1;
        }
        law += 1;
    }
    sum
}

/// The numbers that only one of the laws has, law by law.
pub(crate) fn numbers() -> Vec<ParameterEntry> {
    let of_law = |law: ContactLaw| {
        let numbers = law.entry().numbers.iter();
        numbers.map(move |number| ParameterEntry {
            applies: Applies::Law(law),
            ..*number
        })
    };
    ContactLaw::ALL.into_iter().flat_map(of_law).collect()
}

impl ContactLaw {
    /// Returns a description of the law in a few words.
    pub const fn meaning(self) -> &'static str {
        self.entry().meaning
    }

    /// Returns true if the law has the damper α6.
    pub const fn has_damper(self) -> bool {
        matches!(self.entry().damper, Damper::Contact { .. })
    }

    /// Returns the number of parameters that belong to only one of the laws before this one in the
    /// table.
    pub(crate) const fn first_number(self) -> usize {
        count(self as usize, false)
    }

    /// The equations with these numbers, and relaxing arms of a time and a stiffness each.
    pub(crate) fn law(self, dual: impl Fn(Parameter) -> Dual, arms: &[[f64; 2]]) -> Law {
        let own: Vec<Dual> = Parameter::of_law(self).map(&dual).collect();
        (self.entry().law)(Numbers {
            stiffness: dual(Parameter::Alpha4),
            damping: dual(Parameter::Alpha6),
            own: &own,
            arms,
        })
    }
}

/// No sample, but internal variables that decay at these rates and affect nothing.
pub(crate) fn no_sample(rates: &[f64]) -> Law {
    let none = Dual::constant(0.0);
    spring_damper::with_idle_variables(none, none, rates)
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
