//! A statement of the paper and the corresponding result of this program.

use schemars::JsonSchema;
use serde::Serialize;

/// Verdict on a statement of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The statement holds for this program's result.
    Reproduced,
    /// The statement does not hold for this program's result.
    Differs,
    /// The paper's information is insufficient or contradictory.
    Ambiguous,
}

impl Verdict {
    /// The three verdicts: reproduced, differs, ambiguous.
    pub const ALL: [Self; 3] = [Self::Reproduced, Self::Differs, Self::Ambiguous];

    /// [`Reproduced`](Self::Reproduced) if the statement `holds`, otherwise
    /// [`Differs`](Self::Differs).
    pub const fn of(holds: bool) -> Self {
        if holds {
            Self::Reproduced
        } else {
            Self::Differs
        }
    }

    /// Returns the name of the verdict in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::Differs => "differs",
            Self::Ambiguous => "ambiguous",
        }
    }
}

/// Subject of a statement of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum About {
    /// A formula, a number or a caption as printed.
    Print,
    /// A motion of the system.
    Motion,
}

/// A statement of the paper, the result of this program, and how to reproduce it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Check {
    /// Identifier, such as `eq25` or `fig8-amplitude`.
    pub id: String,
    /// The paper's statement, with its location.
    pub paper: String,
    /// The result of this program.
    pub here: String,
    /// Whether the statement is about the printed text or about the motion.
    pub about: About,
    /// Whether statement and result agree.
    pub verdict: Verdict,
    /// Evidence for the verdict, in words; empty if there is none.
    pub evidence: String,
    /// A command line that reproduces the result.
    pub rerun: String,
}

/// Whether `value`, rounded to `decimals` decimals, equals the `printed` number.
pub(super) fn rounds_to(value: f64, printed: f64, decimals: i32) -> bool {
    // A thousandth of a unit allows for the binary form of the printed number.
    (value - printed).abs() <= 0.501 * 10f64.powi(-decimals)
}

/// `value` with `digits` significant digits, without an exponent if it is short.
pub(super) fn digits(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = nanotap_arithmetic::log10(value.abs()).floor();
    let text = if (-4.0..7.0).contains(&exponent) {
        let decimals = (digits as f64 - 1.0 - exponent).max(0.0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.*e}", digits.saturating_sub(1))
    };
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_numbers_are_compared_at_their_last_digit() {
        // Eq. (23) of the paper: 4.694² = 22.0336 is printed as 22.03.
        assert!(rounds_to(22.0336, 22.03, 2));
        assert!(!rounds_to(22.0361, 22.03, 2));
        assert!(rounds_to(61.6972, 61.7, 1));
        assert!(!rounds_to(f64::NAN, 61.7, 1));
    }

    #[test]
    fn digits_are_significant_ones() {
        assert_eq!(digits(7.790_952, 4), "7.791");
        assert_eq!(digits(0.004_700_1, 2), "0.0047");
        assert_eq!(digits(-55.718, 3), "−55.7");
        assert_eq!(digits(3.1e-9, 2), "3.1e−9");
        assert_eq!(digits(0.0, 3), "0");
    }

    #[test]
    fn verdicts_follow_from_whether_the_statement_holds() {
        assert_eq!(Verdict::of(true), Verdict::Reproduced);
        assert_eq!(Verdict::of(false), Verdict::Differs);
    }
}
