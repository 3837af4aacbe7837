//! Positions and labels of an axis's ticks.

/// The ticks of one axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ticks {
    /// Positions of the labelled ticks, in data units, ascending.
    pub positions: Vec<f64>,
    /// Labels of the ticks, with markup for powers (see [`crate::Axis`]).
    pub labels: Vec<String>,
    /// Positions of the unlabelled minor ticks, in data units, ascending.
    pub minor: Vec<f64>,
    /// Common factor and offset of all labels ("×10⁻⁴ + 2.6"), if any.
    pub note: Option<String>,
}

/// A whole number of units 10^`exponent`, so that labels are exact whatever the rounding of floats.
#[derive(Debug, Clone, Copy)]
struct Decimal {
    digits: i64,
    exponent: i32,
}

impl Decimal {
    fn value(self) -> f64 {
        // Dividing by an exact power of ten rounds once; multiplying by 0.1… would round twice.
        if self.exponent >= 0 {
            self.digits as f64 * 10f64.powi(self.exponent)
        } else {
            self.digits as f64 / 10f64.powi(-self.exponent)
        }
    }

    /// The number divided by 10^`shift`, written out with a true minus sign.
    fn text(self, shift: i32) -> String {
        let exponent = self.exponent - shift;
        let sign = if self.digits < 0 { "−" } else { "" };
        let mut digits = self.digits.unsigned_abs().to_string();
        if self.digits == 0 && exponent >= 0 {
            return "0".into();
        }
        if exponent >= 0 {
            digits.push_str(&"0".repeat(exponent as usize));
            return format!("{sign}{digits}");
        }
        let decimals = exponent.unsigned_abs() as usize;
        if digits.len() <= decimals {
            digits.insert_str(0, &"0".repeat(decimals + 1 - digits.len()));
        }
        let point = digits.len() - decimals;
        format!("{sign}{}.{}", &digits[..point], &digits[point..])
    }

    /// The same number without trailing zeros.
    fn trimmed(mut self) -> Decimal {
        if self.digits == 0 {
            return Decimal {
                digits: 0,
                exponent: 0,
            };
        }
        while self.digits % 10 == 0 {
            self.digits /= 10;
            self.exponent += 1;
        }
        self
    }
}

/// Numbers of the first and the last multiple of `step` in a range, ends included.
fn multiples(low: f64, high: f64, step: Decimal) -> (i64, i64) {
    let (low, high) = (low / step.value(), high / step.value());
    // A tick at the very end counts, also where the quotient has the rounding of large numbers.
    let slack = |end: f64| 1e-9 + 4.0 * f64::EPSILON * end.abs();
    (
        (low - slack(low)).ceil() as i64,
        (high + slack(high)).floor() as i64,
    )
}

/// The step 1, 2, 2.5 or 5 times a power of ten that is the smallest with at most `max_count` marks.
fn nice_step(low: f64, high: f64, max_count: usize) -> Decimal {
    let mut exponent = libm::log10((high - low) / max_count as f64).floor() as i32 - 1;
    // The loop ends: the steps grow tenfold every round.
    loop {
        for (digits, lower) in [(1, 0), (2, 0), (25, 1), (5, 0)] {
            let step = Decimal {
                digits,
                exponent: exponent - lower,
            };
            let (first, last) = multiples(low, high, step);
            if last.saturating_sub(first) < max_count as i64 {
                return step;
            }
        }
        exponent += 1;
    }
}

/// Ticks of a linear axis from `low` to `high` (finite, `low < high`), at most `max_count`, at steps of
/// 1, 2, 2.5 or 5 times a power of ten.
///
/// Labels longer than six digits are shortened by a common factor, a common offset, or both, given
/// in [`Ticks::note`].
pub fn linear(low: f64, high: f64, max_count: usize) -> Ticks {
    let span = high - low;
    if !span.is_finite() || span <= 0.0 {
        return Ticks::default();
    }
    let step = nice_step(low, high, max_count.max(2));
    let width = step.value();
    let (first, last) = multiples(low, high, step);
    let marks: Vec<Decimal> = (first..=last)
        .map(|i| Decimal {
            digits: i.saturating_mul(step.digits),
            exponent: step.exponent,
        })
        .collect();

    let largest = low.abs().max(high.abs());
    let mut offset = Decimal {
        digits: 0,
        exponent: step.exponent,
    };
    if libm::log10(largest / width) > 5.0 {
        // Round the lower end down to the power of ten above the span: the rest has few digits.
        let unit = 10i64.pow((libm::log10(span).ceil() as i32 - step.exponent).clamp(0, 17) as u32);
        offset.digits = marks
            .first()
            .map_or(0, |m| m.digits.div_euclid(unit) * unit);
    }
    let rest = |mark: &Decimal| Decimal {
        digits: mark.digits - offset.digits,
        exponent: mark.exponent,
    };
    let largest = marks
        .iter()
        .map(|m| rest(m).value().abs())
        .fold(0.0, f64::max);
    let shift = if largest >= 1e5 || (largest > 0.0 && largest < 9.9e-4) {
        (libm::log10(largest) + 1e-9).floor() as i32
    } else {
        0
    };

    let mut note = String::new();
    if shift != 0 {
        note = format!("×10^{{{}}}", signed(shift));
    }
    if offset.digits != 0 {
        let sign = if offset.digits < 0 { '−' } else { '+' };
        let size = Decimal {
            digits: offset.digits.abs(),
            ..offset
        }
        .trimmed();
        let size = power_text(size);
        note = if note.is_empty() {
            format!("{sign} {size}")
        } else {
            format!("{note} {sign} {size}")
        };
    }
    Ticks {
        positions: marks.iter().map(|m| m.value().clamp(low, high)).collect(),
        labels: marks
            .iter()
            // A single tick at the offset needs no decimals, since no other labels have to align
            // with it.
            .map(|m| match rest(m) {
                _ if largest == 0.0 => "0".into(),
                rest => rest.text(shift),
            })
            .collect(),
        minor: Vec::new(),
        note: (!note.is_empty()).then_some(note),
    }
}

/// A whole number with a true minus sign.
fn signed(number: i32) -> String {
    if number < 0 {
        format!("−{}", number.unsigned_abs())
    } else {
        number.to_string()
    }
}

/// A positive number, written out or, if that is long, with a power of ten.
fn power_text(number: Decimal) -> String {
    let figures = number.digits.to_string().len() as i32;
    let leading = figures - 1 + number.exponent;
    if (-4..6).contains(&leading) {
        number.text(0)
    } else {
        let mantissa = number.text(leading);
        if mantissa == "1" {
            format!("10^{{{}}}", signed(leading))
        } else {
            format!("{mantissa}×10^{{{}}}", signed(leading))
        }
    }
}

/// Ticks of a logarithmic axis from `low` to `high` (finite, `0 < low < high`), at most `max_count`
/// labelled ones: decades, or fractions of a decade if the axis spans no more than about one.
pub fn logarithmic(low: f64, high: f64, max_count: usize) -> Ticks {
    if !(low > 0.0 && high > low && high.is_finite()) {
        return Ticks::default();
    }
    let first = (libm::log10(low) - 1e-9).ceil() as i32;
    let last = (libm::log10(high) + 1e-9).floor() as i32;
    let within = |v: f64| v >= low * (1.0 - 1e-9) && v <= high * (1.0 + 1e-9);
    let fine: Vec<Decimal> = (first - 1..=last)
        .flat_map(|exponent| (2..10).map(move |digits| Decimal { digits, exponent }))
        .filter(|m| within(m.value()))
        .collect();
    let decades = (last - first + 1).max(0) as usize;
    if decades < 2 {
        return part_of_decade(low, high, max_count, &fine, within);
    }
    let stride = decades.div_ceil(max_count.max(2)) as i32;
    // Ticks are at multiples of the stride, so that two figures of the same quantity agree.
    let labelled: Vec<i32> = (first..=last)
        .filter(|e| e.rem_euclid(stride) == 0)
        .collect();
    let minor = if stride == 1 && decades <= 12 {
        fine.iter().map(|m| m.value().clamp(low, high)).collect()
    } else if stride > 1 && decades <= 60 {
        (first..=last)
            .filter(|e| e.rem_euclid(stride) != 0)
            .map(|e| 10f64.powi(e).clamp(low, high))
            .collect()
    } else {
        Vec::new()
    };
    Ticks {
        positions: labelled
            .iter()
            .map(|&e| 10f64.powi(e).clamp(low, high))
            .collect(),
        labels: labelled
            .iter()
            .map(|&e| format!("10^{{{}}}", signed(e)))
            .collect(),
        minor,
        note: None,
    }
}

/// Ticks of a logarithmic axis that spans fewer than two decades.
fn part_of_decade(
    low: f64,
    high: f64,
    max_count: usize,
    fine: &[Decimal],
    within: impl Fn(f64) -> bool,
) -> Ticks {
    let lowest = libm::log10(low).floor() as i32;
    let highest = libm::log10(high).ceil() as i32;
    let mut all: Vec<Decimal> = fine.to_vec();
    all.extend((lowest..=highest).map(|exponent| Decimal {
        digits: 1,
        exponent,
    }));
    all.retain(|m| within(m.value()));
    all.sort_by(|a, b| a.value().total_cmp(&b.value()));
    let choices: [&[i64]; 3] = [&[1, 2, 3, 4, 5, 6, 7, 8, 9], &[1, 2, 5], &[1, 3]];
    let chosen = choices
        .iter()
        .map(|digits| {
            all.iter()
                .filter(|m| digits.contains(&m.digits))
                .copied()
                .collect::<Vec<_>>()
        })
        .find(|marks| marks.len() <= max_count.max(2));
    match chosen {
        Some(marks) if marks.len() >= 2 => Ticks {
            positions: marks.iter().map(|m| m.value().clamp(low, high)).collect(),
            labels: marks.iter().map(|m| power_text(*m)).collect(),
            minor: all
                .iter()
                .filter(|m| !marks.iter().any(|k| k.value() == m.value()))
                .map(|m| m.value().clamp(low, high))
                .collect(),
            note: None,
        },
        // Over less than a factor of about two the axis is almost linear.
        _ => linear(low, high, max_count),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number(label: &str) -> f64 {
        let plain = label.replace('−', "-");
        match plain.split_once("10^{") {
            Some((mantissa, power)) => {
                let power: i32 = power.trim_end_matches('}').parse().unwrap();
                let mantissa = mantissa.trim_end_matches('×');
                let mantissa = if mantissa.is_empty() { "1" } else { mantissa };
                format!("{mantissa}e{power}").parse().unwrap()
            }
            None => plain.parse().unwrap(),
        }
    }

    #[test]
    fn known_ranges() {
        assert_eq!(
            linear(0.0, 1.0, 6).labels,
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            linear(-1.0, 1.0, 5).labels,
            ["−1.0", "−0.5", "0.0", "0.5", "1.0"]
        );
        assert_eq!(
            linear(2.0, 4.0, 5).labels,
            ["2.0", "2.5", "3.0", "3.5", "4.0"]
        );
        assert_eq!(
            linear(0.0, 400.0, 5).labels,
            ["0", "100", "200", "300", "400"]
        );
        assert_eq!(
            linear(0.0, 1.0, 5).labels,
            ["0.00", "0.25", "0.50", "0.75", "1.00"]
        );
    }

    #[test]
    fn long_labels_are_shortened() {
        let small = linear(0.0, 3e-4, 4);
        assert_eq!(small.labels, ["0", "1", "2", "3"]);
        assert_eq!(small.note.as_deref(), Some("×10^{−4}"));
        let near = linear(2.6, 2.6000003, 4);
        assert_eq!(near.labels, ["0", "1", "2", "3"]);
        assert_eq!(near.note.as_deref(), Some("×10^{−7} + 2.6"));
        let one = linear(595.524318658102, 595.524318658102 * (1.0 + 1e-9), 2);
        assert_eq!(one.labels, ["0"]);
        assert_eq!(one.note.as_deref(), Some("+ 595.524319"));
    }

    #[test]
    fn logarithmic_ranges() {
        assert_eq!(
            logarithmic(1e-3, 1e1, 6).labels,
            ["10^{−3}", "10^{−2}", "10^{−1}", "10^{0}", "10^{1}"]
        );
        assert_eq!(logarithmic(1.0, 5.0, 6).labels, ["1", "2", "3", "4", "5"]);
        assert_eq!(
            logarithmic(1e-16, 1.0, 5).labels,
            ["10^{−16}", "10^{−12}", "10^{−8}", "10^{−4}", "10^{0}"]
        );
    }

    #[test]
    fn ranges_without_width_have_no_marks() {
        for (low, high) in [
            (1.0, 1.0),
            (2.0, 1.0),
            (f64::NAN, 1.0),
            (0.0, f64::INFINITY),
        ] {
            assert_eq!(linear(low, high, 5), Ticks::default());
            assert_eq!(logarithmic(low, high, 5), Ticks::default());
        }
    }

    proptest! {
        #[test]
        fn linear_marks_are_even_inside_and_few(
            centre in -1e6..1e6f64, exponent in -9..9i32, max_count in 2usize..12
        ) {
            let span = 10f64.powi(exponent).max(centre.abs() * 1e-9);
            let (low, high) = (centre, centre + span);
            let ticks = linear(low, high, max_count);
            prop_assert!(!ticks.positions.is_empty() && ticks.positions.len() <= max_count);
            // With space for four ticks there are at least two; otherwise the axis would have no
            // scale.
            prop_assert!(max_count < 4 || ticks.positions.len() >= 2, "{:?}", ticks);
            prop_assert!(ticks.positions.iter().all(|p| (low..=high).contains(p)));
            let gaps: Vec<f64> = ticks.positions.windows(2).map(|w| w[1] - w[0]).collect();
            for gap in &gaps {
                prop_assert!((gap - gaps[0]).abs() <= 1e-6 * span, "{:?}", ticks);
            }
        }

        #[test]
        fn labels_say_where_the_marks_are(
            centre in -1e6..1e6f64, exponent in -9..9i32, max_count in 2usize..12
        ) {
            let span = 10f64.powi(exponent).max(centre.abs() * 1e-9);
            let ticks = linear(centre, centre + span, max_count);
            let note = ticks.note.clone().unwrap_or_default();
            let (factor, offset) = match note.split_once([' ']) {
                _ if note.is_empty() => (1.0, 0.0),
                Some((factor, rest)) => {
                    let (factor, rest) = if factor.starts_with('×') {
                        (number(factor.trim_start_matches('×')), rest.to_string())
                    } else {
                        (1.0, note.clone())
                    };
                    (factor, number(&rest.replace([' ', '+'], "")))
                }
                None => (number(note.trim_start_matches('×')), 0.0),
            };
            for (position, label) in ticks.positions.iter().zip(&ticks.labels) {
                let read = number(label) * factor + offset;
                prop_assert!((read - position).abs() <= 1e-6 * span, "{label} {note} is not {position}");
                let digits = label.trim_start_matches('−').chars().count();
                prop_assert!(digits <= 8, "{label} is too long");
                prop_assert!(label != "−0" && !label.contains('-'));
            }
        }

        #[test]
        fn logarithmic_marks_are_inside_and_few(
            low in -300.0..280.0f64, decades in 0.01..20.0f64, max_count in 2usize..12
        ) {
            let (low, high) = (10f64.powf(low), 10f64.powf(low + decades));
            let ticks = logarithmic(low, high, max_count);
            prop_assert!(!ticks.positions.is_empty() && ticks.positions.len() <= max_count.max(2));
            prop_assert!(ticks.positions.iter().chain(&ticks.minor).all(|p| (low..=high).contains(p)));
            prop_assert!(ticks.positions.windows(2).all(|w| w[1] > w[0]));
        }
    }
}
