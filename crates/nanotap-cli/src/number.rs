//! Numbers as a person reads them, and as a table holds them.

use nanotap::case::physical::Kind;
use nanotap::case::quantity::format_electronvolts;
use nanotap::case::units::Units;
use nanotap::number::shortest;

/// `value` with `digits` significant digits: `0.1447`, `20.34`, `3.113e-8`.
///
/// Plain where that is short, with an exponent where zeros would have to be
/// counted. Trailing zeros stay: they say how much is known.
pub(crate) fn significant(value: f64, digits: usize) -> String {
    let digits = digits.clamp(1, 17);
    if value == 0.0 {
        // Without the sign of a negative zero.
        return "0".into();
    }
    if !value.is_finite() {
        return if value.is_nan() {
            "undefined".into()
        } else if value > 0.0 {
            "∞".into()
        } else {
            "−∞".into()
        };
    }
    let scientific = format!("{:.*e}", digits - 1, value);
    // The exponent after rounding: 9.999 with two digits is 1.0e1.
    let exponent: i32 = scientific
        .rsplit_once('e')
        .and_then(|(_, power)| power.parse().ok())
        .unwrap_or(0);
    if (-4..digits.max(5) as i32 + 1).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        scientific
    }
}

/// A number of the model with so many digits; where the case has SI, the quantity with so many.
pub(crate) fn quantity(units: &Units, kind: Kind, value: f64, [model, si]: [usize; 2]) -> String {
    match (units.si(kind), kind) {
        (None, _) => significant(value, model),
        (Some(unit), Kind::Energy) => format_electronvolts(unit * value),
        (Some(unit), _) => kind.format_digits(unit * value, si),
    }
}

/// A number that was given, as short as it can be without changing it:
/// `0.1`, `20`, `1e-9`.
pub(crate) fn chosen(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e9).contains(&size) {
        format!("{value:e}")
    } else if value == 0.0 {
        "0".into()
    } else {
        format!("{value}")
    }
}

/// A relative difference in percent, signed, two digits: `+0.18 %`, `−3e-8 %`.
pub(crate) fn percent(ratio: f64) -> String {
    let percent = 100.0 * ratio;
    if percent == 0.0 {
        return "0 %".into();
    }
    let digits = significant(percent.abs(), 2);
    let sign = if percent > 0.0 { '+' } else { '−' };
    format!("{sign}{digits} %")
}

/// `count` with the right form of its noun.
pub(crate) fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Numbers as a line of a CSV file, each in the shortest form that reads back.
pub(crate) fn row(values: impl IntoIterator<Item = f64>) -> String {
    let cells: Vec<String> = values.into_iter().map(shortest).collect();
    cells.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits_survive_every_size() {
        for (value, digits, text) in [
            (0.144_744, 4, "0.1447"),
            (20.337_21, 4, "20.34"),
            (-1.391_7, 3, "-1.39"),
            (3.112_9e-8, 4, "3.113e-8"),
            (9.999, 2, "10"),
            (0.000_123_4, 2, "0.00012"),
            (190_000.0, 3, "190000"),
            (6.02e23, 3, "6.02e23"),
            (0.0, 4, "0"),
            (-0.0, 4, "0"),
            (f64::NAN, 4, "undefined"),
            (f64::INFINITY, 4, "∞"),
            (f64::MIN_POSITIVE, 2, "2.2e-308"),
        ] {
            assert_eq!(significant(value, digits), text);
        }
    }

    #[test]
    fn chosen_numbers_come_back_unchanged() {
        for value in [0.1, 20.0, 1e-9, 2.6, -0.25, 1e15, 0.0] {
            assert_eq!(chosen(value).parse::<f64>().unwrap(), value);
        }
        assert_eq!(chosen(20.0), "20");
        assert_eq!(chosen(1e-9), "1e-9");
    }

    #[test]
    fn rows_read_back_and_are_short() {
        let values = [0.1, -0.0, 3.402830773979555e-18, 1.0 / 3.0, 20.0, -5e-9];
        let text = row(values);
        assert_eq!(
            text,
            "0.1,0,3.402830773979555e-18,0.3333333333333333,20,-5e-9"
        );
        let read = text.split(',').map(|cell| cell.parse::<f64>().unwrap());
        assert!(read.eq(values));
    }

    #[test]
    fn percentages_carry_their_sign() {
        assert_eq!(percent(0.0018), "+0.18 %");
        assert_eq!(percent(-0.0018), "−0.18 %");
        assert_eq!(percent(0.0), "0 %");
    }
}
