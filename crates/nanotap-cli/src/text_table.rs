//! Aligned tables, no wider than the terminal.

use std::ops::Range;

use unicode_width::UnicodeWidthStr;

pub(crate) use nanotap::frame::Align;
use nanotap::frame::Frame;

use crate::{page, style};

/// Number of blanks between two columns.
const BETWEEN: usize = 2;
/// Smallest width of a column in which words are broken, in characters.
const NARROWEST: usize = 14;

/// A table that is being filled.
pub(crate) struct Table {
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
    indent: usize,
}

impl Table {
    /// Creates a table with these column headers; if all are empty no header is printed.
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

    /// Creates the table of these rows of a frame.
    pub(crate) fn of(frame: &Frame<'_>, rows: impl IntoIterator<Item = usize>) -> Self {
        let shown = frame.shown(rows);
        let heads = shown.heads.iter();
        let mut table = Self::new(heads.map(|(head, _, align)| (head.as_str(), *align)));
        for row in shown.rows {
            table.row(row);
        }
        table
    }

    /// Creates the table of all rows of a frame.
    pub(crate) fn all(frame: &Frame<'_>) -> Self {
        Self::of(frame, 0..frame.rows)
    }

    /// Creates the table of the first row of a frame: a line a column, with its head, its value and
    /// what the label adds. Columns that are only shown are left out where they have no value.
    pub(crate) fn record(frame: &Frame<'_>) -> Self {
        let mut table = Self::new([("", Align::Left); 3]);
        for column in frame.shown_columns() {
            let words = if column.label == column.head {
                ""
            } else {
                &*column.label
            };
            match frame.text(column, 0) {
                text if !text.is_empty() => table.row([&*column.head, &*text, words]),
                _ if column.name.is_empty() => {}
                _ => table.row([&*column.head, "none", words]),
            }
        }
        table
    }

    /// Adds a row; missing cells are empty.
    pub(crate) fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        let mut row: Vec<String> = cells.into_iter().map(Into::into).collect();
        row.resize(self.columns.len(), String::new());
        self.rows.push(row);
    }

    /// Formats the table for the terminal, without blanks at the ends of lines.
    pub(crate) fn render(&self) -> String {
        self.fitted(page::width())
    }

    /// The table in lines of at most `width`: where it is wider, words are broken over several
    /// lines, and if that is not enough, the columns are in blocks beneath each other, each
    /// beginning with the first column.
    fn fitted(&self, width: usize) -> String {
        let headed = self.columns.iter().any(|(name, _)| !name.is_empty());
        let columns: Vec<Vec<String>> = (0..self.columns.len())
            .map(|index| {
                aligned(
                    &self.columns[index],
                    self.rows.iter().map(|row| &row[index]),
                )
            })
            .collect();
        let mut widths: Vec<usize> = columns.iter().map(|cells| cells[0].width()).collect();
        self.narrow(&mut widths, width);
        let blocks = self.blocks(&widths, width);
        let mut text = String::new();
        for (index, block) in blocks.iter().enumerate() {
            if index > 0 {
                text.push('\n');
            }
            // The first column says in each block which row it is.
            let members: Vec<usize> = (index > 0)
                .then_some(0)
                .into_iter()
                .chain(block.clone())
                .collect();
            for row in usize::from(!headed)..=self.rows.len() {
                let lines = self.lines(&columns, &widths, &members, row);
                text.push_str(&if row == 0 {
                    style::faint(&lines)
                } else {
                    lines
                });
                text.push('\n');
            }
        }
        text
    }

    /// Takes width from columns of words, the widest first, until the table fits or none has
    /// any to give: a word stays whole.
    fn narrow(&self, widths: &mut [usize], width: usize) {
        let full = |widths: &[usize]| {
            self.indent + widths.iter().sum::<usize>() + BETWEEN * widths.len().saturating_sub(1)
        };
        let least: Vec<usize> = (0..widths.len())
            .map(|index| self.longest_word(index))
            .collect();
        while full(widths) > width {
            let widest = (0..widths.len())
                .filter(|&index| {
                    self.columns[index].1 == Align::Left && widths[index] > least[index]
                })
                .max_by_key(|&index| widths[index]);
            let Some(widest) = widest else { return };
            let excess = full(widths) - width;
            widths[widest] = widths[widest].saturating_sub(excess).max(least[widest]);
        }
    }

    /// The width of the longest word of a column, or of the narrowest column of words.
    fn longest_word(&self, index: usize) -> usize {
        let cells = self.rows.iter().map(|row| row[index].as_str());
        std::iter::once(self.columns[index].0.as_str())
            .chain(cells)
            .flat_map(str::split_whitespace)
            .map(UnicodeWidthStr::width)
            .fold(NARROWEST, usize::max)
    }

    /// The columns of each block that fits; every block has at least one in addition to the first.
    fn blocks(&self, widths: &[usize], width: usize) -> Vec<Range<usize>> {
        let mut blocks = Vec::new();
        let mut begin = 0;
        let mut taken = self.indent;
        for (index, column) in widths.iter().enumerate() {
            if index > begin.max(1) && taken + BETWEEN + column > width {
                blocks.push(begin..index);
                begin = index;
                taken = self.indent + widths[0];
            }
            taken += column + if index > 0 { BETWEEN } else { 0 };
        }
        blocks.push(begin..widths.len());
        blocks
    }

    /// One row of these columns: a line, or several where words are broken.
    fn lines(
        &self,
        columns: &[Vec<String>],
        widths: &[usize],
        members: &[usize],
        row: usize,
    ) -> String {
        let cells: Vec<Vec<&str>> = members
            .iter()
            .map(|&index| page::broken(&columns[index][row], widths[index]))
            .collect();
        let height = cells.iter().map(Vec::len).max().unwrap_or(0);
        let lines: Vec<String> = (0..height)
            .map(|line| {
                let mut text = " ".repeat(self.indent);
                for (position, (cell, &index)) in cells.iter().zip(members).enumerate() {
                    let piece = cell.get(line).copied().unwrap_or_default();
                    text.push_str(&" ".repeat(if position > 0 { BETWEEN } else { 0 }));
                    text.push_str(piece);
                    text.push_str(&" ".repeat(widths[index].saturating_sub(piece.width())));
                }
                text.truncate(text.trim_end().len());
                text
            })
            .collect();
        lines.join("\n")
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
    fn a_turned_frame_has_a_line_a_column() {
        let rows = [("mean", 2e-8, 40.0), ("noise", 3e-12, 0.5)];
        let frame = nanotap::frame::frame! { nanotap::frame::Rows::new("summary", rows, None);
            "of", "", Plain => |(of, ..)| of;
            "A", "amplitude", (Length, Prefixed(3)) => |(_, amplitude, _)| amplitude;
            "phase", "phase", (Angle, Digits(3)) => |(.., phase)| phase;
            .turned();
        };
        // The heads are faint.
        let text = Table::all(&frame).render();
        let (heads, lines) = text.split_once('\n').unwrap();
        assert!(heads.contains("  mean   noise"), "{heads}");
        assert_eq!(
            lines,
            "  amplitude  20 nm  3 pm\n  phase (°)  40.0   0.500\n"
        );
        assert_eq!(
            frame.csv(),
            "of,A (m),phase (deg)\nmean,2e-8,40\nnoise,3e-12,0.5\n"
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
    /// A narrow terminal: words go on in the next line, under themselves.
    #[test]
    fn words_are_broken_where_the_line_ends() {
        let mut table = Table::new([("", Align::Left), ("", Align::Point), ("", Align::Left)]);
        table.row(["α1", "0.1", "tip mass over beam mass"]);
        table.row(["α4", "20", "stiffness"]);
        assert_eq!(
            table.fitted(28),
            "  α1   0.1  tip mass over\n            beam mass\n  α4  20    stiffness\n"
        );
        assert_eq!(table.fitted(usize::MAX), table.fitted(80));
    }

    /// Numbers cannot be broken: the columns go on in another block, with the first again.
    #[test]
    fn columns_go_on_beneath() {
        let mut table = Table::new([("", Align::Right); 4]);
        table.row(["1", "1.2345678", "2.3456789", "3.4567891"]);
        table.row(["2", "9.2345678", "8.3456789", "7.4567891"]);
        assert_eq!(
            table.fitted(26),
            "  1  1.2345678  2.3456789\n  2  9.2345678  8.3456789\n\n  1  3.4567891\n  2  7.4567891\n"
        );
        // However narrow, every number is there, whole.
        let narrow = table.fitted(5);
        assert!(
            ["3.4567891", "8.3456789"]
                .iter()
                .all(|n| narrow.contains(n)),
            "{narrow}"
        );
    }
}
