//! The numbers of the dimensionless model, under every name they go by: the paper's seven,
//! and those that only some samples and drives have.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::case::near_name::near_name;

/// A dimensionless parameter of the model, Eqs. (5) and (7) of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Parameter {
    /// α1 = M/(mL): tip mass over beam mass.
    Alpha1,
    /// α2 = f/g₀: drive amplitude over the beam's gap.
    Alpha2,
    /// α3 = C√(L⁴/(m EI)): damping of the beam.
    Alpha3,
    /// α4 = K₁L³/(EI): contact stiffness over bending stiffness.
    Alpha4,
    /// α5 = g₁/g₀: the tip's gap over the beam's gap.
    Alpha5,
    /// α6 = (C₁/L)√(L⁴/(m EI)): damping of the contact.
    Alpha6,
    /// Ω = ω√(mL⁴/(EI)): drive frequency.
    Omega,
    /// k_m L³/(EI): stiffness of the standard linear solid's relaxing arm over bending
    /// stiffness.
    RelaxationStiffness,
    /// Time in which the force of that arm decays at constant indentation, in the model's
    /// unit of time √(mL⁴/(EI)).
    RelaxationTime,
    /// Amplitude of the second tone, measured as α2.
    Tone2Amplitude,
    /// Phase θ of the second tone in degrees: it is sin(ρΩτ + θ), ρ the ratio of frequencies.
    Tone2Phase,
}

/// What is known of a parameter besides its value.
struct Entry {
    name: &'static str,
    alias: &'static str,
    symbol: &'static str,
    ascii_symbol: &'static str,
    meaning: &'static str,
}

impl Parameter {
    /// The paper's parameters, which every case has: α1 to α6 and then Ω.
    pub const ALL: [Self; 7] = [
        Self::Alpha1,
        Self::Alpha2,
        Self::Alpha3,
        Self::Alpha4,
        Self::Alpha5,
        Self::Alpha6,
        Self::Omega,
    ];

    /// Parameters that only some samples and drives have; 0 where they are not said.
    pub const FURTHER: [Self; 4] = [
        Self::RelaxationStiffness,
        Self::RelaxationTime,
        Self::Tone2Amplitude,
        Self::Tone2Phase,
    ];

    const fn entry(self) -> Entry {
        match self {
            Self::Alpha1 => Entry {
                name: "alpha1",
                alias: "tip_mass_ratio",
                symbol: "α₁",
                ascii_symbol: "α1",
                meaning: "tip mass over beam mass, M/(mL)",
            },
            Self::Alpha2 => Entry {
                name: "alpha2",
                alias: "drive_amplitude",
                symbol: "α₂",
                ascii_symbol: "α2",
                meaning: "drive amplitude over beam gap, f/g0",
            },
            Self::Alpha3 => Entry {
                name: "alpha3",
                alias: "beam_damping",
                symbol: "α₃",
                ascii_symbol: "α3",
                meaning: "viscous damping of the beam, C·√(L⁴/(m·EI))",
            },
            Self::Alpha4 => Entry {
                name: "alpha4",
                alias: "contact_stiffness",
                symbol: "α₄",
                ascii_symbol: "α4",
                meaning: "contact stiffness over bending stiffness, K1·L³/(EI)",
            },
            Self::Alpha5 => Entry {
                name: "alpha5",
                alias: "gap",
                symbol: "α₅",
                ascii_symbol: "α5",
                meaning: "tip gap over beam gap, g1/g0 (negative: pressed in at rest)",
            },
            Self::Alpha6 => Entry {
                name: "alpha6",
                alias: "contact_damping",
                symbol: "α₆",
                ascii_symbol: "α6",
                meaning: "viscous damping of the contact, (C1/L)·√(L⁴/(m·EI))",
            },
            Self::Omega => Entry {
                name: "omega",
                alias: "drive_frequency",
                symbol: "Ω",
                ascii_symbol: "Ω",
                meaning: "drive frequency, ω·√(mL⁴/(EI))",
            },
            Self::RelaxationStiffness => Entry {
                name: "relaxation_stiffness",
                alias: "relaxation_stiffness",
                symbol: "kₘ",
                ascii_symbol: "km",
                meaning: "stiffness of the relaxing arm over bending stiffness, km·L³/(EI)",
            },
            Self::RelaxationTime => Entry {
                name: "relaxation_time",
                alias: "relaxation_time",
                symbol: "τₘ",
                ascii_symbol: "τm",
                meaning: "time in which the arm's force decays, over √(mL⁴/(EI))",
            },
            Self::Tone2Amplitude => Entry {
                name: "tone2_amplitude",
                alias: "second_tone_amplitude",
                symbol: "A₂",
                ascii_symbol: "A2",
                meaning: "amplitude of the second tone, measured as alpha2",
            },
            Self::Tone2Phase => Entry {
                name: "tone2_phase",
                alias: "second_tone_phase",
                symbol: "θ₂",
                ascii_symbol: "θ2",
                meaning: "phase of the second tone in degrees",
            },
        }
    }

    /// Every parameter there is.
    pub fn every() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().chain(Self::FURTHER)
    }

    /// The name in case files and in data: `alpha1` … `alpha6`, `omega`.
    pub const fn name(self) -> &'static str {
        self.entry().name
    }

    /// The readable name, accepted wherever [`name`](Self::name) is: `contact_stiffness`.
    pub const fn alias(self) -> &'static str {
        self.entry().alias
    }

    /// The symbol for axis labels: `α₁`, `Ω`.
    pub const fn symbol(self) -> &'static str {
        self.entry().symbol
    }

    /// One line that says what the parameter is.
    pub const fn meaning(self) -> &'static str {
        self.entry().meaning
    }

    /// Whether `word`, already in lower case with underscores, names this parameter.
    fn answers_to(self, word: &str) -> bool {
        let entry = self.entry();
        [
            entry.name,
            entry.alias,
            &entry.symbol.to_lowercase(),
            &entry.ascii_symbol.to_lowercase(),
        ]
        .contains(&word)
    }

    /// The valid name that `word` was probably meant to be.
    fn nearest_name(word: &str) -> Option<&'static str> {
        let names: Vec<&str> = Self::every()
            .flat_map(|parameter| [parameter.name(), parameter.alias()])
            .collect();
        near_name(word, names.iter().copied())
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.name())
    }
}

impl Serialize for Parameter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// A word that names no parameter.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "no parameter is called `{given}`{}",
    match .nearest {
        Some(name) => format!("; did you mean `{name}`?"),
        None => format!(
            "; the parameters are {}",
            Parameter::ALL.map(|p| format!("{} ({})", p.name(), p.alias())).join(", "),
        ),
    }
)]
pub struct UnknownParameter {
    /// The word as given.
    pub given: String,
    /// The valid name nearest to it, if one is near.
    pub nearest: Option<&'static str>,
}

impl FromStr for Parameter {
    type Err = UnknownParameter;

    /// Reads a canonical name, a readable name or a symbol. Case does not matter,
    /// and neither do hyphens and blanks in place of underscores.
    fn from_str(given: &str) -> Result<Self, UnknownParameter> {
        let word = given.trim().to_lowercase().replace(['-', ' '], "_");
        Self::every()
            .find(|parameter| parameter.answers_to(&word))
            .ok_or_else(|| UnknownParameter {
                given: given.to_owned(),
                nearest: Self::nearest_name(&word),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_leads_back_to_its_parameter() {
        for parameter in Parameter::every() {
            for word in [parameter.name(), parameter.alias(), parameter.symbol()] {
                assert_eq!(word.parse(), Ok(parameter), "{word}");
                assert_eq!(word.to_uppercase().parse(), Ok(parameter), "{word}");
            }
            assert_eq!(parameter.alias().replace('_', "-").parse(), Ok(parameter));
            assert_eq!(
                serde_json::to_string(&parameter).unwrap(),
                format!("\"{}\"", parameter.name())
            );
        }
        assert_eq!("α4".parse(), Ok(Parameter::Alpha4));
        assert_eq!(" Drive frequency ".parse(), Ok(Parameter::Omega));
    }

    #[test]
    fn names_are_all_different() {
        let mut names: Vec<_> = Parameter::every()
            .flat_map(|p| [p.name(), p.alias()])
            .collect();
        names.sort_unstable();
        names.dedup();
        // The arm's two names are readable as they are.
        assert_eq!(names.len(), 20);
    }

    #[test]
    fn a_slip_gets_the_name_that_was_meant() {
        for (slip, meant) in [
            ("omgea", "omega"),
            ("alhpa3", "alpha3"),
            ("contact_stifness", "contact_stiffness"),
            ("drive_freqency", "drive_frequency"),
            ("tip_mass", "tip_mass_ratio"),
            ("relaxation_tme", "relaxation_time"),
        ] {
            let error = slip.parse::<Parameter>().unwrap_err();
            assert_eq!(error.nearest, Some(meant), "{slip}");
            assert!(error.to_string().contains(slip) && error.to_string().contains(meant));
        }
    }

    #[test]
    fn a_strange_word_gets_the_whole_list() {
        for strange in ["", "temperature", "\u{0}", "ααα"] {
            let error = strange.parse::<Parameter>().unwrap_err();
            assert_eq!(error.nearest, None, "{strange}");
            assert!(error.to_string().contains("contact_damping"));
        }
    }
}
