//! Tables of numbers in text files.

use crate::document::Document;
use crate::error::Place;
use crate::limits::{Budget, MAX_CHANNELS, MAX_HEADER, MAX_LINE, at_most};
use crate::text::{number, number_with_comma};
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
    /// Between numbers; `None` for any blanks. Commas that separate nothing are decimal ones.
    pub(crate) separator: Option<char>,
    /// Columns, if the rows must have so many at most.
    pub(crate) columns: usize,
}

/// Reads the rows of a table; the number of the first line is `first`. An empty cell ends its column.
/// Of a last line that is cut off the whole numbers are kept, with a note.
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
        let (row, is_whole) = row(line, layout);
        if !is_whole {
            if lines.peek().is_some() || k == 0 {
                let shown: String = line.chars().take(60).collect();
                let expected = format!("at most {} numbers", layout.columns);
                let place = Place::Line(first + k);
                return Err(layout
                    .format
                    .damaged(place, format!("the text `{shown}`"), expected));
            }
            let whole = row.iter().flatten().count();
            table.notes.push(format!(
                "the last line {} is cut off: {whole} of its numbers are read",
                first + k
            ));
        }
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

/// The numbers of a line up to the first cell that is none, and whether that is the whole line.
fn row(line: &str, layout: &Layout) -> (Vec<Option<f64>>, bool) {
    let cells: Vec<&str> = match layout.separator {
        Some(separator) => line.split(separator).collect(),
        None => line.split_whitespace().collect(),
    };
    let value = |cell: &&str| -> Option<Option<f64>> {
        let cell = cell.trim();
        if cell.is_empty() {
            return Some(None);
        }
        if layout.separator == Some(',') {
            return number(cell).map(Some);
        }
        number_with_comma(cell).map(Some)
    };
    let mut row: Vec<Option<f64>> = cells.iter().map_while(value).collect();
    let is_whole = row.len() == cells.len();
    let rest = row.split_off(row.len().min(layout.columns));
    let fits = rest.iter().all(Option::is_none);
    (row, is_whole && fits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Limits;

    fn read(text: &str) -> Result<Table, Error> {
        let layout = Layout {
            format: Format::Workshop,
            separator: Some(','),
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
        assert_eq!(table.columns, [vec![1.0, 3.0, 5.0], vec![2.0]]);
        let note = "the last line 13 is cut off: 1 of its numbers are read";
        assert_eq!(table.notes, [note]);
    }

    #[test]
    fn commas_that_separate_nothing_are_decimal() {
        let layout = Layout {
            format: Format::Chiaro,
            separator: Some('\t'),
            columns: 2,
        };
        assert_eq!(
            row("1,5\t-2.5e3", &layout),
            (vec![Some(1.5), Some(-2500.0)], true)
        );
        assert_eq!(row("1,5,5\t2", &layout), (vec![], false));
        assert_eq!(row("1\t2\t3", &layout), (vec![Some(1.0), Some(2.0)], false));
    }

    #[test]
    fn a_wrong_line_is_named() {
        let error = read("1,2\n3,x\n5,6\n").expect_err("no number");
        assert!(error.to_string().contains("line 11"), "{error}");
    }
}
