//! The position of each panel's box. Boxes of a column have equal widths and boxes of a row equal
//! heights; the text around each box has the space that it needs.

use crate::error::FigureError;
use crate::legend::{self, Stand};
use crate::marks::Marks;
use crate::prepared::Prepared;
use crate::shape::Rect;
use crate::style::{EDGE, Style};
use crate::text::Words;

/// Smallest useful side of a box, mm.
const SMALLEST: f64 = 8.0;
/// The space around a box depends on its ticks, and these depend on its size. The iteration
/// converges in this number of rounds.
const ROUNDS: usize = 4;

/// Space around a box, mm.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sides {
    pub(crate) top: f64,
    pub(crate) right: f64,
    /// Ticks and their labels, without the axis label beyond them.
    pub(crate) left_marks: f64,
    pub(crate) left_label: f64,
    pub(crate) bottom_marks: f64,
    pub(crate) bottom_label: f64,
}

impl Sides {
    fn left(self) -> f64 {
        self.left_marks + self.left_label
    }

    fn bottom(self) -> f64 {
        self.bottom_marks + self.bottom_label
    }

    /// The larger space on each side.
    fn max(self, other: Sides) -> Sides {
        Sides {
            top: self.top.max(other.top),
            right: self.right.max(other.right),
            left_marks: self.left_marks.max(other.left_marks),
            left_label: self.left_label.max(other.left_label),
            bottom_marks: self.bottom_marks.max(other.bottom_marks),
            bottom_label: self.bottom_label.max(other.bottom_label),
        }
    }
}

/// A panel's box, with the space of its column and row around it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    pub(crate) rect: Rect,
    pub(crate) sides: Sides,
    pub(crate) stand: Stand,
}

/// The grid and the part of the page that it fills.
pub(crate) struct Grid<'a> {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    pub(crate) widths: &'a [f64],
    pub(crate) heights: &'a [f64],
    pub(crate) area: Rect,
}

/// Lays out panels, row by row.
pub(crate) fn spots(
    panels: &[Prepared],
    grid: &Grid,
    style: &Style,
) -> Result<Vec<Spot>, FigureError> {
    let (rows, cols) = (grid.rows, grid.cols);
    let guess = Rect {
        left: 0.0,
        top: 0.0,
        right: (grid.area.width() / cols as f64 - 14.0).max(SMALLEST),
        bottom: (grid.area.height() / rows as f64 - 12.0).max(SMALLEST),
    };
    let mut rects = vec![guess; panels.len()];
    let mut stands = vec![Stand::Nowhere; panels.len()];
    let mut around = vec![Sides::default(); panels.len()];
    for round in 0..ROUNDS {
        for (index, panel) in panels.iter().enumerate() {
            // A legend that was placed outside once stays outside, or the rounds might not
            // converge.
            let outside = matches!(stands[index], Stand::Above | Stand::Right);
            if round == 0 || !outside {
                stands[index] = legend::stand(panel, rects[index], style);
            }
            around[index] = sides(panel, rects[index], stands[index], style);
        }
        let column: Vec<Sides> = (0..cols)
            .map(|c| joined(around.iter().skip(c).step_by(cols)))
            .collect();
        let row: Vec<Sides> = (0..rows)
            .map(|r| joined(around.iter().skip(r * cols).take(cols)))
            .collect();
        let width = grid.area.width()
            - column.iter().map(|s| s.left() + s.right).sum::<f64>()
            - style.gap * (cols - 1) as f64;
        let height = grid.area.height()
            - row.iter().map(|s| s.top + s.bottom()).sum::<f64>()
            - 0.6 * style.gap * (rows - 1) as f64;
        let (all_widths, all_heights): (f64, f64) =
            (grid.widths.iter().sum(), grid.heights.iter().sum());
        for (index, rect) in rects.iter_mut().enumerate() {
            let (r, c) = (index / cols, index % cols);
            let left = grid.area.left
                + column[..c]
                    .iter()
                    .map(|s| s.left() + s.right + style.gap)
                    .sum::<f64>()
                + grid.widths[..c].iter().sum::<f64>() / all_widths * width
                + column[c].left();
            let top = grid.area.top
                + row[..r]
                    .iter()
                    .map(|s| s.top + s.bottom() + 0.6 * style.gap)
                    .sum::<f64>()
                + grid.heights[..r].iter().sum::<f64>() / all_heights * height
                + row[r].top;
            *rect = Rect {
                left,
                top,
                right: left + grid.widths[c] / all_widths * width,
                bottom: top + grid.heights[r] / all_heights * height,
            };
            if !(rect.width() >= SMALLEST && rect.height() >= SMALLEST) {
                return Err(FigureError::Invalid(format!(
                    "the panel in row {}, column {} has {:.1} mm × {:.1} mm left for its data: make the figure larger, its labels shorter, or its panels fewer",
                    r + 1,
                    c + 1,
                    rect.width().max(0.0),
                    rect.height().max(0.0)
                )));
            }
            around[index] = Sides {
                top: row[r].top,
                left_marks: column[c].left_marks,
                left_label: column[c].left_label,
                bottom_marks: row[r].bottom_marks,
                bottom_label: row[r].bottom_label,
                ..around[index]
            };
        }
    }
    Ok(rects
        .into_iter()
        .zip(around)
        .zip(stands)
        .map(|((rect, sides), stand)| Spot { rect, sides, stand })
        .collect())
}

fn joined<'s>(all: impl Iterator<Item = &'s Sides>) -> Sides {
    all.fold(Sides::default(), |a, b| a.max(*b))
}

/// Height of a line of text, mm.
fn line_height(words: &Words) -> f64 {
    words.cap_height() + words.descent()
}

/// The space that a panel needs around a box of the given size.
fn sides(panel: &Prepared, rect: Rect, stand: Stand, style: &Style) -> Sides {
    let mut sides = Sides {
        top: EDGE,
        right: EDGE,
        left_marks: EDGE,
        bottom_marks: EDGE,
        ..Sides::default()
    };
    let label = |words: &str| Words::set(words, style.label, false);

    if panel.panel.y.marked() {
        let marks = Marks::new(&panel.panel.y, panel.y, rect.height(), true, style);
        sides.left_marks = style.mark + style.pad + marks.widest();
        if let Some(note) = &marks.note {
            sides.top += line_height(note) + style.pad;
        } else if let Some((_, words)) = marks.major.last() {
            sides.top = sides.top.max(words.cap_height() / 2.0 + EDGE / 2.0);
        }
    }
    let y = panel.panel.y.words();
    if !y.is_empty() {
        sides.left_label = style.pad + line_height(&label(&y)) + EDGE;
    }
    if panel.panel.x.marked() {
        let marks = Marks::new(&panel.panel.x, panel.x, rect.width(), false, style);
        sides.bottom_marks = style.mark;
        if panel.words_below {
            let (start, end) = marks.overhang(rect.width());
            let height = marks
                .major
                .first()
                .map_or(0.0, |(_, w)| 1.2 * w.cap_height());
            sides.bottom_marks += style.pad + height;
            sides.left_marks = sides.left_marks.max(start + EDGE);
            sides.right = sides.right.max(end + EDGE);
            if let Some(note) = &marks.note
                && !shares_row(panel, rect.width(), style)
            {
                sides.bottom_label = style.pad + line_height(note);
            }
        }
    }
    let x = panel.panel.x.words();
    if panel.words_below && !x.is_empty() {
        sides.bottom_label += style.pad + line_height(&label(&x));
    }

    for bar in &panel.bars {
        let marks = Marks::new(bar.axis, bar.view, rect.height(), true, style);
        sides.right = sides.right.max(0.0) + bar_width(&marks, &bar.axis.words(), style);
        if let Some(note) = &marks.note {
            sides.top = sides.top.max(EDGE + line_height(note) + style.pad);
        }
    }
    match stand {
        Stand::Above => {
            sides.top += legend::height_above(&panel.entries, rect.width(), style) + style.pad;
        }
        Stand::Right => {
            sides.right += style.pad * 2.0 + legend::column_size(&panel.entries, style).0;
        }
        Stand::Inside(..) | Stand::Nowhere => {}
    }
    let heading = title_height(panel, style);
    if !panel.panel.title.is_empty() {
        sides.top += heading;
    } else if !panel.letter.is_empty() {
        // The letter is to the left of the box, next to the text above it.
        sides.top = sides.top.max(heading + EDGE / 2.0);
    }
    sides
}

/// Space for the letter and title, mm.
pub(crate) fn title_height(panel: &Prepared, style: &Style) -> f64 {
    if panel.panel.title.is_empty() && panel.letter.is_empty() {
        return 0.0;
    }
    let words = Words::set("H", style.title, true);
    words.cap_height() + words.descent() + style.pad
}

/// Whether the common factor of the horizontal axis fits into the row of the label, which may be
/// moved to the left for it.
pub(crate) fn shares_row(panel: &Prepared, width: f64, style: &Style) -> bool {
    let marks = Marks::new(&panel.panel.x, panel.x, width, false, style);
    let label = Words::set(&panel.panel.x.words(), style.label, false);
    let fits = |note: Words| label.width + style.gap + note.width <= width;
    label.width > 0.0 && marks.note.is_none_or(fits)
}

/// Distance of a colour bar from the item to its left, and its width, mm.
pub(crate) fn bar_shape(style: &Style) -> (f64, f64) {
    (2.0 * style.pad, 2.6 * style.mark)
}

/// Total width of a colour bar with its labels, mm.
pub(crate) fn bar_width(marks: &Marks, label: &str, style: &Style) -> f64 {
    let (gap, width) = bar_shape(style);
    let note = marks
        .note
        .as_ref()
        .map_or(0.0, |n| n.width - width - style.mark);
    let words = if label.is_empty() {
        0.0
    } else {
        style.pad + line_height(&Words::set(label, style.label, false))
    };
    gap + width + style.mark + style.pad + marks.widest().max(note) + words
}
