//! Tables of numbers in text files.

use crate::document::Document;
use crate::error::Place;
use crate::limits::{Budget, MAX_CHANNELS, MAX_HEADER, MAX_LINE, at_most};
use crate::text::number;
use crate::{Error, Format};

/// Columns of a table.
#[derive(Debug, Default)]
pub(crate) struct Table {
    /// Each column's numbers; columns may end early.
    pub(crate) columns: Vec<Vec<f64>>,
    /// What was left out.
    pub(crate) notes: Vec<String>,
}

/// How the rows of a table are written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub(crate) format: Format,
    /// Between numbers; `None` for any blanks.
    pub(crate) separator: Option<char>,
    pub(crate) decimal_comma: bool,
    /// Columns, if the rows must have so many at most.
    pub(crate) columns: usize,
}

/// Reads the rows of a table; the number of the first line is `first`. An empty cell ends its column.
/// A last line that is cut off is left out with a note.
pub(crate) fn rows<'a>(
    lines: impl Iterator<Item = &'a str>,
    first: usize,
    layout: &Layout,
    budget: &mut Budget,
) -> Result<Table, Error> {
    let mut table = Table {
        columns: vec![Vec::new(); layout.columns],
        notes: Vec::new(),
    };
    let mut lines = lines
        .enumerate()
        .filter(|(_, of)| !of.trim().is_empty())
        .peekable();
    while let Some((k, line)) = lines.next() {
        at_most(line.len(), MAX_LINE, "bytes in a line")?;
        budget.numbers(layout.columns)?;
        let Some(row) = row(line, layout) else {
            if lines.peek().is_none() && k > 0 {
                table.notes.push(format!(
                    "the last line {} is cut off and left out",
                    first + k
                ));
                break;
            }
            let shown: String = line.chars().take(60).collect();
            let expected = format!("at most {} numbers", layout.columns);
            let place = Place::Line(first + k);
            return Err(layout
                .format
                .damaged(place, format!("the text `{shown}`"), expected));
        };
        for (column, value) in table.columns.iter_mut().zip(row) {
            column.extend(value);
        }
    }
    Ok(table)
}

/// How settings and the head of the table below them are written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heading {
    /// Between the name and the value of a setting.
    pub(crate) setting: &'static str,
    /// How the line with the names of the columns begins.
    pub(crate) begins: &'static [&'static str],
    /// That line in errors.
    pub(crate) shown: &'static str,
    /// Between names and between numbers.
    pub(crate) separator: char,
}

/// Reads settings into `document` and the table below them; returns the names of its columns and their
/// numbers.
pub(crate) fn headed<'a>(
    text: &'a str,
    heading: &Heading,
    document: &mut Document,
) -> Result<(Vec<&'a str>, Vec<Vec<f64>>), Error> {
    let format = document.format;
    let mut lines = text.lines().enumerate();
    let mut length = 0;
    let (number, names) = loop {
        let (number, line) = lines
            .next()
            .ok_or_else(|| format.at_key(heading.shown, "no such line", "the head of a table"))?;
        if heading.begins.iter().any(|of| line.starts_with(of)) {
            break (number, line);
        }
        length += line.len();
        at_most(length, MAX_HEADER, "bytes in a header")?;
        document.keep_setting(line, heading.setting);
    };
    let names: Vec<&str> = names.split(heading.separator).map(str::trim).collect();
    at_most(names.len(), MAX_CHANNELS, "columns")?;
    let layout = Layout {
        format,
        separator: Some(heading.separator),
        decimal_comma: false,
        columns: names.len(),
    };
    let lines = lines.map(|(_, line)| line);
    let table = rows(
        lines,
        number + 2,
        &layout,
        &mut Budget::new(document.limits),
    )?;
    document.notes = table.notes;
    Ok((names, table.columns))
}

fn row(line: &str, layout: &Layout) -> Option<Vec<Option<f64>>> {
    let cells: Vec<&str> = match layout.separator {
        Some(separator) => line.split(separator).collect(),
        None => line.split_whitespace().collect(),
    };
    let value = |cell: &str| -> Option<Option<f64>> {
        let cell = cell.trim();
        if cell.is_empty() {
            return Some(None);
        }
        if layout.decimal_comma {
            return number(&cell.replace(',', ".")).map(Some);
        }
        number(cell).map(Some)
    };
    let row: Vec<Option<f64>> = cells.into_iter().map(value).collect::<Option<_>>()?;
    let (kept, rest) = row.split_at(row.len().min(layout.columns));
    rest.iter().all(Option::is_none).then(|| kept.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Limits;

    fn read(text: &str) -> Result<Table, Error> {
        let layout = Layout {
            format: Format::Workshop,
            separator: Some(','),
            decimal_comma: false,
            columns: 2,
        };
        rows(
            text.lines(),
            10,
            &layout,
            &mut Budget::new(Limits::default()),
        )
    }

    #[test]
    fn columns_may_end_early_and_the_last_line_may_be_cut() {
        let table = read("1,2\n3,\n\n5,-").expect("a table");
        assert_eq!(table.columns, [vec![1.0, 3.0], vec![2.0]]);
        assert!(table.notes[0].contains("line 13"), "{:?}", table.notes);
    }

    #[test]
    fn a_wrong_line_is_named() {
        let error = read("1,2\n3,x\n5,6\n").expect_err("no number");
        assert!(error.to_string().contains("line 11"), "{error}");
    }
}
