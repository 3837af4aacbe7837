//! The numbers of Eqs. (7), (14), (23), (25) and of section 4's ten samples.

use super::check::digits;
use super::expected::agree;
use super::runs::Runs;
use super::section::{Section, Table};
use super::{PaperError, rerun};
use nanotap::case::physical::sample::{Elastic, reduced_modulus};
use nanotap::model::cantilever::{Cantilever, CosineTerm};
use nanotap::model::exact_beam;
use nanotap::model::parameter::Parameter;
use nanotap::study::modes::ModeTable;

/// Eq. (7): α3 and α6 as printed are not dimensionless.
#[allow(clippy::unnecessary_wraps)] // One signature for every section.
pub(super) fn damping_units(_: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let lever = DampedLever {
        length: 100e-6,
        mass: 1e-7,
        bending: 1e-11,
        damping: 1e-3,
    };
    let printed = lever.in_grams().alpha3_printed() / lever.alpha3_printed();
    let corrected = lever.in_grams().alpha3_corrected() / lever.alpha3_corrected();
    Ok(section
        .text(
            "A dimensionless parameter must not change when the same lever is described in other units. \
             The factor √(L⁴/EI) of Eq. (7) does; √(L⁴/(m EI)), which Eq. (5) uses for time, does not, \
             and it is what turns Eq. (3) into Eq. (6).",
        )
        .check(
            "eq7",
            printed,
            "α₃ = C√(L⁴/(m EI)), α₆ = (C₁/L)√(L⁴/(m EI))",
            format!(
                "the same lever in grams instead of kilograms multiplies the printed α₃ by {}, the corrected one by {}",
                digits(printed, 4),
                digits(corrected, 4)
            ),
            rerun::section("eq7"),
        ))
}

/// The properties of a lever that Eq. (7) uses.
#[derive(Clone, Copy)]
struct DampedLever {
    length: f64,
    mass: f64,
    bending: f64,
    damping: f64,
}

impl DampedLever {
    /// Converts to a unit of mass a thousand times smaller: m (kg/m), EI (kg m³/s²) and C (kg/(m
    /// s)) are each proportional to it.
    fn in_grams(self) -> Self {
        Self {
            mass: 1e3 * self.mass,
            bending: 1e3 * self.bending,
            damping: 1e3 * self.damping,
            ..self
        }
    }

    fn alpha3_printed(self) -> f64 {
        self.damping * (self.length.powi(4) / self.bending).sqrt()
    }

    fn alpha3_corrected(self) -> f64 {
        self.damping * (self.length.powi(4) / (self.mass * self.bending)).sqrt()
    }
}

/// Eq. (14): the printed cosine term lacks the Ω of Eq. (6). Does it matter?
pub(super) fn cosine_term(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let mut table = Table::new(
        "Attractors with the cosine term of Eq. (6) and with that printed in Eq. (14)",
        ["N", "Ω", "α₁", "Eq. (6)", "Eq. (14) as printed"],
    );
    let mut same = true;
    for (omega, alpha1) in [(2.6, 0.1), (20.0, 0.1), (20.0, 0.0)] {
        let case = Cantilever::paper()
            .with(Parameter::Omega, omega)
            .with(Parameter::Alpha1, alpha1);
        let corrected = runs.count(&case)?;
        let printed = runs.count(&Cantilever {
            cosine_term: CosineTerm::Printed,
            ..case.clone()
        })?;
        same &= corrected.kinds() == printed.kinds();
        table.row([
            case.modes.to_string(),
            omega.to_string(),
            alpha1.to_string(),
            corrected.kinds().join(", "),
            printed.kinds().join(", "),
        ]);
    }
    let here = if same {
        "−α₂ α₃ Ω ∫φ_i cos Ωτ, as the Galerkin projection of Eq. (6) gives it; with the printed form the attractors are of the same \
         kinds"
    } else {
        "−α₂ α₃ Ω ∫φ_i cos Ωτ, as the Galerkin projection of Eq. (6) gives it; with the printed form the attractors are of other \
         kinds"
    };
    let printed_case = Cantilever {
        cosine_term: CosineTerm::Printed,
        ..Cantilever::paper()
    };
    Ok(section
        .text(
            "Eq. (6) damps the beam by its own velocity and by that of its base, α₂ Ω cos Ωτ. Eq. (14), its \
             projection on a mode, is printed without the Ω. Everything in this report uses the projection of \
             Eq. (6); this section compares it with the printed form.",
        )
        .check(
            "eq14",
            (),
            here,
            format!(
                "as printed, Eq. (14) contradicts Eq. (6); attractors of both forms: {}",
                table.rows.iter().map(|r| format!("Ω = {}, α₁ = {}: {} | {}", r[1], r[2], r[3], r[4])).collect::<Vec<_>>().join("; ")
            ),
            rerun::on_case("attractors", &printed_case, "--starts 64 --seed 1"),
        )
        .table(table))
}

/// Computes the section on Eq. (23): frequencies of the bare beam.
pub(super) fn bare_frequencies(_: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let exact = exact_beam::frequencies(0.0, 0.0, 3).map_err(nanotap::model::ModelError::from)?;
    let bare = Cantilever::paper()
        .with(Parameter::Alpha1, 0.0)
        .with(Parameter::Alpha4, 0.0);
    let here = list(&exact, 7);
    Ok(section.check(
        "eq23",
        exact,
        here,
        "squares of the roots of cos β cosh β = −1, to the last bit",
        rerun::on_case("modes", &bare, ""),
    ))
}

/// Largest number of modes with which Eq. (25) is computed.
const MAX_MODES: usize = 10;
/// Numbers of Eq. (25) with their decimals.
const EQ25: [(f64, i32); 3] = [(7.79, 2), (20.33, 2), (55.81, 2)];

/// Computes the section on Eq. (25): frequencies in contact.
pub(super) fn contact_frequencies(_: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let table_of = |modes: usize| {
        ModeTable::new(&Cantilever::paper_eq24().with_modes(modes))
            .map_err(PaperError::failed("the frequencies in contact"))
    };
    let mut table = Table::new(
        "Frequencies in contact at α₁ = 0.1, α₄ = 20; the paper prints 7.79, 20.33, 55.81",
        ["modes N", "ω₁", "ω₂", "ω₃", "agrees with the print"],
    );
    let mut agreeing = Vec::new();
    let mut three = Vec::new();
    for modes in 1..=MAX_MODES {
        let contact = table_of(modes)?.contact;
        let agrees = modes >= 3 && agree(&contact, &EQ25);
        if agrees {
            agreeing.push(modes.to_string());
        }
        if modes == 3 {
            three.clone_from(&contact);
        }
        let cell = |i: usize| {
            contact
                .get(i)
                .map_or_else(String::new, |v| format!("{v:.4}"))
        };
        table.row([
            modes.to_string(),
            cell(0),
            cell(1),
            cell(2),
            if agrees { "yes".into() } else { "no".into() },
        ]);
    }
    let last = table_of(3)?;
    let exact = &last.exact_contact;
    let exact_agrees = agree(exact, &EQ25);
    table.row([
        "exact beam".into(),
        format!("{:.4}", exact[0]),
        format!("{:.4}", exact[1]),
        format!("{:.4}", exact[2]),
        if exact_agrees {
            "yes".into()
        } else {
            "no".into()
        },
    ]);
    let bare = exact_beam::frequencies(0.0, 0.0, 3).map_err(nanotap::model::ModelError::from)?;
    let with_tip = &last.exact_free;
    let trend = exact[0] > 1.5 * bare[0] && exact[1] < bare[1] && exact[2] < bare[2];
    let five = Cantilever::paper_eq24().with_modes(5);
    Ok(section
        .text(
            "The Galerkin frequencies fall towards those of the beam as modes are added, so the printed digits show \
             how many modes were used.",
        )
        .check(
            "eq25",
            agreeing.len(),
            if agreeing.is_empty() {
                format!("no N up to {MAX_MODES} gives all three")
            } else {
                format!("these digits belong to N = {}", agreeing.join(", "))
            },
            format!("N = 1 … {MAX_MODES} compared digit by digit (table)"),
            rerun::on_case("modes", &five, ""),
        )
        .check(
            "eq25-modes",
            (),
            format!("N = 3 gives {}, the beam itself {}", list(&three, 5), list(exact, 8)),
            format!(
                "the third frequency is {:.2} % too high with N = 3 and {:.2} % in print",
                100.0 * (three[2] / exact[2] - 1.0),
                100.0 * (EQ25[2].0 / exact[2] - 1.0)
            ),
            rerun::on_case("modes", &Cantilever::paper_eq24(), ""),
        )
        .check(
            "eq25-trend",
            trend,
            format!(
                "ω₁ rises from {} to {}, ω₂ falls from {} to {}, ω₃ from {} to {}",
                digits(bare[0], 4),
                digits(exact[0], 4),
                digits(bare[1], 4),
                digits(exact[1], 4),
                digits(bare[2], 4),
                digits(exact[2], 4)
            ),
            format!(
                "the tip mass lowers them, not the contact: in free flight with α₁ = 0.1 they are {}, each below its \
                 value in contact",
                list(with_tip, 4)
            ),
            rerun::on_case("modes", &Cantilever::paper_eq24(), ""),
        )
        .table(table))
}

fn list(values: &[f64], significant: usize) -> String {
    values
        .iter()
        .map(|v| digits(*v, significant))
        .collect::<Vec<_>>()
        .join(", ")
}

/// A sample of section 4: modulus in Pa, α4 as printed, half a unit of its last digit.
const SAMPLES: [(&str, f64, f64, f64); 4] = [
    ("softest", 1e6, 4.7e-3, 0.05e-3),
    ("polystyrene", 4e9, 18.7, 0.05),
    ("graphite", 5e9, 23.4, 0.05),
    ("stiffest", 50e9, 233.5, 0.05),
];
/// The tip as described in section 4.
const SILICON: Elastic = Elastic {
    modulus: 130e9,
    poisson: 0.27,
};

/// Section 4: α4 of ten samples from Hertz's contact.
#[allow(clippy::unnecessary_wraps)] // One signature for every section.
pub(super) fn samples(_: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let (low, high) = slopes(|modulus| modulus);
    let rigid = low <= high;
    // If the tip's own compliance counts, there must be one Poisson ratio for all samples.
    let ratios: Vec<f64> = (0..=50).map(|k| 0.01 * f64::from(k)).collect();
    let compliant = |poisson: f64| {
        slopes(|modulus| reduced_modulus(Elastic { modulus, poisson }, Some(SILICON)))
    };
    let fits = ratios.iter().any(|&poisson| {
        let (low, high) = compliant(poisson);
        low <= high
    });
    let mut table = Table::new(
        "α₄ as printed, and as Hertz's formula scales it from polystyrene's 18.7 (ν₂ = 0.3)",
        [
            "sample",
            "E₂",
            "printed",
            "rigid tip",
            "tip of E₁ = 130 GPa",
        ],
    );
    let scaled = |tip: Option<Elastic>, modulus: f64| {
        let of = |modulus: f64| {
            reduced_modulus(
                Elastic {
                    modulus,
                    poisson: 0.3,
                },
                tip,
            )
        };
        SAMPLES[1].2 * of(modulus) / of(SAMPLES[1].1)
    };
    for (name, modulus, printed, _) in SAMPLES {
        table.row([
            name.to_owned(),
            format!("{} GPa", digits(1e-9 * modulus, 1)),
            digits(printed, if printed < 1.0 { 2 } else { 4 }),
            digits(scaled(None, modulus), 4),
            digits(scaled(Some(SILICON), modulus), 4),
        ]);
    }
    Ok(section
        .text(
            "Section 4 gives the formula α₄ = 3K₁/K_c with K₁ = 2E*√(RΔ), Δ = R/9, so that α₄ = 2RE*/K_c: for one \
             lever, α₄ is proportional to E* of the sample. R/K_c is not given, so only the ratios can be \
             checked.",
        )
        .check(
            "alpha4-samples",
            fits,
            if rigid {
                format!(
                    "the four numbers are proportional to E₂ (α₄ = {} E₂/GPa), as for a rigid tip",
                    digits(1e9 * 0.5 * (low + high), 3)
                )
            } else {
                "the four numbers are not even proportional to E₂".to_owned()
            },
            format!(
                "with the tip's stated compliance no ν₂ from 0 to 0.5 fits all four; scaled from polystyrene at \
                 ν₂ = 0.3, 50 GPa has α₄ = {} instead of 233.5",
                digits(scaled(Some(SILICON), 50e9), 4)
            ),
            rerun::section("alpha4"),
        )
        .table(table))
}

/// The range of factors between α4 and `modulus_of` that agree with the printed digits of all
/// samples; empty (low > high) if there are none.
fn slopes(modulus_of: impl Fn(f64) -> f64) -> (f64, f64) {
    SAMPLES.iter().fold(
        (0.0, f64::INFINITY),
        |(low, high), &(_, modulus, printed, half)| {
            let modulus = modulus_of(modulus);
            (
                f64::max(low, (printed - half) / modulus),
                f64::min(high, (printed + half) / modulus),
            )
        },
    )
}

/// Section 3: with α5 = 0 nothing depends on the amplitude of the motion.
pub(super) fn scaling(_: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    use nanotap_dynamics::StroboscopicMap as _;
    let map_of = |alpha2: f64| -> Result<_, PaperError> {
        let case = Cantilever::paper().with(Parameter::Alpha2, alpha2);
        Ok(nanotap::model::model_map::ModelMap::new(
            &nanotap::model::Model::cantilever(&case)?,
        ))
    };
    let failed = PaperError::failed("a run");
    let factor = 3.0;
    let (mut small, mut large) = (map_of(0.1)?, map_of(0.1 * factor)?);
    let mut x = vec![0.1, 0.01, 0.001, 0.2, 0.02, 0.002];
    let mut y: Vec<f64> = x.iter().map(|v| factor * v).collect();
    small.advance(&mut x).map_err(&failed)?;
    large.advance(&mut y).map_err(&failed)?;
    let size = y.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let difference = x
        .iter()
        .zip(&y)
        .map(|(x, y)| (factor * x - y).abs())
        .fold(0.0, f64::max)
        / size;
    Ok(section.check(
        "scaling",
        difference,
        "with α₅ = 0 the whole motion scales: three times the drive and the initial state give three times the motion",
        format!(
            "P(3x; 3α₂) and 3P(x; α₂) differ by {} of their size after a period with contact; with a gap (α₅ ≠ 0) \
             only α₅/α₂ matters",
            digits(difference, 1)
        ),
        rerun::section("scaling"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_corrected_damping_is_a_pure_number() {
        let lever = DampedLever {
            length: 2.0,
            mass: 3.0,
            bending: 5.0,
            damping: 0.7,
        };
        // C and EI are proportional to the unit of mass, the printed factor to its square root.
        assert!(
            (lever.in_grams().alpha3_printed() / lever.alpha3_printed() - 1e3f64.sqrt()).abs()
                < 1e-12
        );
        assert!(
            (lever.in_grams().alpha3_corrected() / lever.alpha3_corrected() - 1.0).abs() < 1e-12
        );
    }

    #[test]
    fn printed_lists_are_compared_number_by_number() {
        // Eq. (25), and the exact beam of the same case from its transcendental equation.
        assert!(!agree(&[7.790952, 20.324970, 55.718523], &EQ25));
        assert!(agree(&[7.7931, 20.3312, 55.8098], &EQ25));
        assert!(!agree(&[7.7931, 20.3312], &EQ25));
    }

    #[test]
    fn slopes_are_those_that_every_digit_allows() {
        // α4 = 4.67 E₂/GPa agrees with the digits of all four; E₂² does not.
        let (low, high) = slopes(|modulus| modulus);
        assert!(low <= 4.67e-9 && 4.67e-9 <= high);
        let (low, high) = slopes(|modulus| modulus * modulus);
        assert!(low > high);
    }
}
