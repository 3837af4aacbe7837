//! Aligned tables for the terminal.

use unicode_width::UnicodeWidthStr;

use crate::style;

/// How the cells of a column stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Align {
    /// Words.
    Left,
    /// Whole numbers.
    Right,
    /// Numbers, their decimal points beneath each other.
    Point,
}

/// A table that is being filled.
pub(crate) struct Table {
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
    indent: usize,
}

impl Table {
    /// A table with these column headers; where all are empty no header is printed.
    pub(crate) fn new<'a>(columns: impl IntoIterator<Item = (&'a str, Align)>) -> Self {
        let columns = columns
            .into_iter()
            .map(|(name, align)| (name.to_owned(), align))
            .collect();
        Self {
            columns,
            rows: Vec::new(),
            indent: 2,
        }
    }

    /// Adds a row; cells that are missing are empty.
    pub(crate) fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        let mut row: Vec<String> = cells.into_iter().map(Into::into).collect();
        row.resize(self.columns.len(), String::new());
        self.rows.push(row);
    }

    /// The table, a line a row, no blanks at the ends of lines.
    pub(crate) fn render(&self) -> String {
        let cells: Vec<Vec<String>> = (0..self.columns.len())
            .map(|index| {
                aligned(
                    &self.columns[index],
                    self.rows.iter().map(|row| &row[index]),
                )
            })
            .collect();
        let mut text = String::new();
        if self.columns.iter().any(|(name, _)| !name.is_empty()) {
            let line = self.line(&cells, 0);
            text.push_str(&style::faint(&line));
            text.push('\n');
        }
        for row in 0..self.rows.len() {
            text.push_str(&self.line(&cells, row + 1));
            text.push('\n');
        }
        text
    }

    fn line(&self, cells: &[Vec<String>], row: usize) -> String {
        let mut line = " ".repeat(self.indent);
        for (index, column) in cells.iter().enumerate() {
            if index > 0 {
                line.push_str("  ");
            }
            line.push_str(&column[row]);
        }
        line.truncate(line.trim_end().len());
        line
    }
}

/// The header and the cells of one column, all of one width.
fn aligned<'a>(
    (name, align): &(String, Align),
    cells: impl Iterator<Item = &'a String> + Clone,
) -> Vec<String> {
    let cells: Vec<String> = match align {
        Align::Left | Align::Right => cells.cloned().collect(),
        Align::Point => {
            let tail = cells
                .clone()
                .map(|cell| cell.width() - head(cell))
                .max()
                .unwrap_or(0);
            cells
                .map(|cell| format!("{cell}{}", " ".repeat(tail - (cell.width() - head(cell)))))
                .collect()
        }
    };
    let width = cells
        .iter()
        .map(|cell| cell.width())
        .max()
        .unwrap_or(0)
        .max(name.width());
    std::iter::once(name)
        .chain(&cells)
        .map(|cell| {
            let blanks = " ".repeat(width - cell.width());
            if *align == Align::Left {
                format!("{cell}{blanks}")
            } else {
                format!("{blanks}{cell}")
            }
        })
        .collect()
}

/// The width of a number up to its decimal point.
fn head(cell: &str) -> usize {
    let end = cell.find(['.', 'e', ' ']).unwrap_or(cell.len());
    cell[..end].width()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_points_stand_beneath_each_other() {
        let mut table = Table::new([("", Align::Left), ("", Align::Point), ("", Align::Left)]);
        table.row(["α1", "0.1", "a"]);
        table.row(["α4", "20", "b"]);
        table.row(["Ω", "-1.25", ""]);
        assert_eq!(
            table.render(),
            "  α1   0.1   a\n  α4  20     b\n  Ω   -1.25\n"
        );
    }

    #[test]
    fn headers_and_short_rows_fit() {
        let mut table = Table::new([("mode", Align::Right), ("Ω", Align::Point)]);
        table.row(["1", "3.5160"]);
        table.row(["12"]);
        let lines: Vec<String> = table.render().lines().map(str::to_owned).collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[1].ends_with("   1  3.5160"), "{lines:?}");
        assert_eq!(lines[2], "    12");
    }
}
