//! Numbers as a person reads them, and as a table holds them.

use nanotap::case::physical::Kind;
use nanotap::case::quantity::format_electronvolts;
use nanotap::case::units::Units;
use nanotap::number::shortest;
pub(crate) use nanotap::number::significant;

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
