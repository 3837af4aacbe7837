//! Averages of blocks of rows, before anything else is done to a long table: a force curve of a million
//! rows then takes the time and the memory of one of some ten thousand.

use super::FitOptions;
use super::data::error_of;
use super::instrument::is_plain_force_curve;
use nanotap_case::table::{Entry, Header, Table};

/// Tables of force curves with more rows are averaged to about this number.
const MAX_ROWS: usize = 20_000;

/// The tables of a request, of which `columns` are used, with the long force curves averaged; `None` if there
/// are none, or if `rows` of the request is 0: then every row counts.
pub(super) fn averaged(request: &FitOptions, columns: &[String]) -> Option<Vec<Table>> {
    let tables = &request.data;
    let is_long = |table: &Table| {
        table.rows() > 2 * MAX_ROWS && is_plain_force_curve(table, columns, &request.convert)
    };
    if request.rows == 0 || !tables.iter().any(is_long) {
        return None;
    }
    let averaged = tables.iter().map(|table| {
        if is_long(table) {
            average(table, table.rows().div_ceil(MAX_ROWS))
        } else {
            table.clone()
        }
    });
    Some(averaged.collect())
}

/// Averages of `count` consecutive rows. A block ends where a text changes, or the number of a curve.
fn average(table: &Table, count: usize) -> Table {
    let rows = table.rows();
    let is_curve = |header: &str| Header::of(header).name.eq_ignore_ascii_case("curve");
    // A program may give columns of different lengths, which is refused later.
    let changes = |row: usize| {
        table.columns.iter().any(|(header, column)| {
            let (before, now) = (column.get(row - 1), column.get(row));
            let is_text = |entry: Option<&Entry>| matches!(entry, Some(Entry::Text(_)));
            let tells = is_curve(header) || is_text(before) || is_text(now);
            tells && before != now
        })
    };
    let mut starts = vec![0];
    for row in 1..rows {
        if row - starts[starts.len() - 1] == count || changes(row) {
            starts.push(row);
        }
    }
    let blocks = || {
        let ends = starts.iter().skip(1).copied().chain([rows]);
        starts.iter().copied().zip(ends)
    };
    let columns = table.columns.iter().map(|(header, column)| {
        let of_error = error_of(&Header::of(header)).is_some();
        let entries =
            blocks().map(|(start, end)| mean(column.get(start..end).unwrap_or_default(), of_error));
        (header.clone(), entries.collect())
    });
    let lines = starts.iter().filter_map(|row| table.lines.get(*row));
    let mut remarks = table.remarks.clone();
    remarks.push(format!(
        "{rows} rows were averaged in blocks of {count} first; the option `rows` with 0 uses every row"
    ));
    Table {
        name: table.name.clone(),
        columns: columns.collect(),
        lines: lines.copied().collect(),
        notes: table.notes.clone(),
        remarks,
    }
}

/// The mean of the numbers of a block, or of standard errors that of the mean; else its first entry.
fn mean(entries: &[Entry], of_error: bool) -> Entry {
    let numbers = entries.iter().filter_map(|entry| match entry {
        Entry::Number(value) => Some(*value),
        _ => None,
    });
    let power = |value: f64| if of_error { value * value } else { value };
    let (count, sum) = numbers.fold((0.0, 0.0), |(n, sum), value| (n + 1.0, sum + power(value)));
    match entries.first() {
        Some(Entry::Text(text)) => Entry::Text(text.clone()),
        _ if count == 0.0 => Entry::Missing,
        _ if of_error => Entry::Number(f64::sqrt(sum) / count),
        _ => Entry::Number(sum / count),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_end_where_the_direction_changes() {
        let numbers = |of: &[f64]| of.iter().copied().map(Entry::Number).collect();
        let words = |of: &[&str]| of.iter().map(|w| Entry::Text((*w).to_owned())).collect();
        let table = Table {
            columns: vec![
                (
                    "distance (nm)".to_owned(),
                    numbers(&[1.0, 3.0, 5.0, 5.0, 2.0]),
                ),
                (
                    "deflection error (nm)".to_owned(),
                    numbers(&[3.0, 4.0, 1.0, 1.0, 1.0]),
                ),
                (
                    "direction".to_owned(),
                    words(&["approach", "approach", "approach", "retract", "retract"]),
                ),
            ],
            lines: vec![2, 3, 4, 5, 6],
            ..Table::default()
        };
        let found = average(&table, 2);
        assert_eq!(found.columns[0].1, numbers(&[2.0, 5.0, 3.5]));
        // Of a mean of two: the root of the sum of squares over two.
        assert_eq!(
            found.columns[1].1,
            numbers(&[2.5, 1.0, f64::sqrt(2.0) / 2.0])
        );
        assert_eq!(
            found.columns[2].1,
            words(&["approach", "approach", "retract"])
        );
        assert_eq!(found.lines, [2, 4, 5]);
    }
}
