//! Numbers as a person reads them, and as a table holds them.

use nanotap::case::physical::Kind;
use nanotap::case::quantity::format_electronvolts;
use nanotap::case::units::Units;
use nanotap::number::shortest;
pub(crate) use nanotap::number::{counted, significant};

/// A number of the model with so many digits; where the case has SI, the quantity with so many.
pub(crate) fn quantity(units: &Units, kind: Kind, value: f64, [model, si]: [usize; 2]) -> String {
    match (units.si(kind), kind) {
        (None, _) => significant(value, model),
        (Some(unit), Kind::Energy) => format_electronvolts(unit * value),
        (Some(unit), _) => kind.format_digits(unit * value, si),
    }
}

/// Part of the larger end of a range below which the other end is its rounding.
const ROUNDING: f64 = 1e-13;

/// Two ends of a range, each as [`quantity`]: an end that is rounding of the other is 0.
pub(crate) fn range(units: &Units, kind: Kind, ends: [f64; 2], digits: [usize; 2]) -> String {
    let size = ends[0].abs().max(ends[1].abs());
    let resolved = |end: f64| {
        if end.abs() < ROUNDING * size {
            0.0
        } else {
            end
        }
    };
    let [low, high] = ends.map(|end| quantity(units, kind, resolved(end), digits));
    format!("{low} … {high}")
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

/// Numbers as a line of a CSV file, each in the shortest form that reads back.
pub(crate) fn row(values: impl IntoIterator<Item = f64>) -> String {
    let cells: Vec<String> = values.into_iter().map(shortest).collect();
    cells.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
