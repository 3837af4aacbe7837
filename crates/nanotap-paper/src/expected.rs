//! What a computation has to give so that a statement holds, and what it gave.

use super::check::{Verdict, rounds_to};

/// What a computation has to give so that a statement holds.
pub(super) enum Expected {
    /// A number above this one.
    Above(f64),
    /// A number below this one.
    Below(f64),
    /// At least so many.
    AtLeast(usize),
    /// At most so many.
    AtMost(usize),
    /// This number, up to the second one.
    Near(f64, f64),
    /// These printed numbers, each with its decimals.
    Digits(&'static [(f64, i32)]),
    /// The condition that the computation evaluates.
    Holds,
    /// Nothing: the equations contradict the statement.
    Contradicted,
    /// Nothing: the paper's information is insufficient or contradictory.
    Open,
}

/// What a computation gave.
#[derive(Clone, Debug)]
pub(super) struct Computed {
    /// The numbers of the case as printed.
    printed: Vec<f64>,
    /// The numbers of another reading of the paper, with which the statement is ambiguous; empty if
    /// there is none.
    other: Vec<f64>,
}

impl Computed {
    /// The number with the case as printed, and that with another reading of the paper.
    pub(super) fn readings(printed: f64, other: f64) -> Self {
        let (printed, other) = (vec![printed], vec![other]);
        Self { printed, other }
    }
}

impl From<Vec<f64>> for Computed {
    fn from(printed: Vec<f64>) -> Self {
        let other = Vec::new();
        Self { printed, other }
    }
}

impl From<f64> for Computed {
    fn from(number: f64) -> Self {
        vec![number].into()
    }
}

impl From<usize> for Computed {
    fn from(count: usize) -> Self {
        (count as f64).into()
    }
}

impl From<bool> for Computed {
    fn from(holds: bool) -> Self {
        f64::from(u8::from(holds)).into()
    }
}

/// Of a statement that needs no number.
impl From<()> for Computed {
    fn from((): ()) -> Self {
        Vec::new().into()
    }
}

impl Expected {
    /// The verdict on the statement.
    pub(super) fn verdict(&self, found: &Computed) -> Verdict {
        if matches!(self, Self::Open) || !self.admits(&found.printed) && self.admits(&found.other) {
            Verdict::Ambiguous
        } else {
            Verdict::of(self.admits(&found.printed))
        }
    }

    fn admits(&self, numbers: &[f64]) -> bool {
        let all = |admits: &dyn Fn(f64) -> bool| {
            !numbers.is_empty() && numbers.iter().all(|number| admits(*number))
        };
        match *self {
            Self::Above(limit) => all(&|number| number > limit),
            Self::Below(limit) => all(&|number| number < limit),
            Self::AtLeast(count) => all(&|number| number >= count as f64),
            Self::AtMost(count) => all(&|number| number <= count as f64),
            Self::Near(value, tolerance) => all(&|number| (number - value).abs() < tolerance),
            Self::Digits(printed) => agree(numbers, printed),
            Self::Holds => all(&|number| number == 1.0),
            Self::Contradicted | Self::Open => false,
        }
    }
}

/// Whether every number rounds to its printed form.
pub(super) fn agree(values: &[f64], printed: &[(f64, i32)]) -> bool {
    let same =
        |(value, (printed, decimals)): (&f64, &(f64, i32))| rounds_to(*value, *printed, *decimals);
    values.len() >= printed.len() && values.iter().zip(printed).all(same)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_reading_that_fits_leaves_a_statement_open() {
        let verdict =
            |printed, other| Expected::AtLeast(2).verdict(&Computed::readings(printed, other));
        assert_eq!(verdict(2.0, 0.0), Verdict::Reproduced);
        assert_eq!(verdict(1.0, 2.0), Verdict::Ambiguous);
        assert_eq!(verdict(1.0, 1.0), Verdict::Differs);
    }

    #[test]
    fn a_computation_without_a_result_supports_nothing() {
        for expected in [
            Expected::Below(1.0),
            Expected::AtMost(0),
            Expected::Above(0.0),
        ] {
            assert_eq!(expected.verdict(&().into()), Verdict::Differs);
            assert_eq!(expected.verdict(&f64::NAN.into()), Verdict::Differs);
        }
        assert_eq!(Expected::Open.verdict(&().into()), Verdict::Ambiguous);
    }
}
