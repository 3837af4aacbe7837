//! The figure: panels in a grid, as data.

use serde::{Deserialize, Serialize};

use crate::error::FigureError;
use crate::panel::Panel;

/// Width of one column of a journal page, mm.
pub const SINGLE_COLUMN: f64 = 86.0;
/// Width of one and a half columns, mm.
pub const ONE_AND_A_HALF_COLUMNS: f64 = 129.0;
/// Width of two columns, mm.
pub const DOUBLE_COLUMN: f64 = 178.0;

/// Panels in a grid.
///
/// The same figure always gives the same bytes. Letters are shapes in every format, so that the
/// figure looks the same on every machine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[must_use]
pub struct Figure {
    /// Number of rows of the grid of panels.
    pub rows: usize,
    /// Number of columns of the grid of panels.
    pub cols: usize,
    /// Width of the figure in print, mm.
    pub width: f64,
    /// Height of the figure in print, mm; `None`: panels are about two thirds as high as wide.
    pub height: Option<f64>,
    /// Relative widths of the columns (dimensionless, only ratios matter); empty: equal.
    pub column_widths: Vec<f64>,
    /// Relative heights of the rows (dimensionless, only ratios matter); empty: equal.
    pub row_heights: Vec<f64>,
    /// Text above the whole figure, and the title of the file.
    pub title: String,
    /// Text below the whole figure.
    pub caption: String,
    /// Whether panels are lettered (a), (b), ….
    pub letters: bool,
    /// Whether the panels of a column share their horizontal range.
    pub share_x: bool,
    /// Factor by which letters and ticks are larger than usual (dimensionless), 0.2 to 10; 1 for
    /// print.
    pub text_scale: f64,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

impl Default for Figure {
    fn default() -> Figure {
        Figure::new(1, 1)
    }
}

impl Figure {
    /// A figure of one column's width with `rows` × `cols` cells, still empty.
    pub fn new(rows: usize, cols: usize) -> Figure {
        Figure {
            rows,
            cols,
            width: SINGLE_COLUMN,
            height: None,
            column_widths: Vec::new(),
            row_heights: Vec::new(),
            title: String::new(),
            caption: String::new(),
            letters: rows.saturating_mul(cols) > 1,
            share_x: false,
            text_scale: 1.0,
            panels: Vec::new(),
        }
    }

    /// A figure of a single panel, one column wide.
    pub fn single(panel: Panel) -> Figure {
        Figure::new(1, 1).with(panel)
    }

    /// Adds the panel of the next cell, row by row.
    pub fn with(mut self, panel: Panel) -> Figure {
        self.panels.push(panel);
        self
    }

    /// Sets the width in print, mm ([`SINGLE_COLUMN`], [`ONE_AND_A_HALF_COLUMNS`],
    /// [`DOUBLE_COLUMN`]).
    pub fn width(mut self, mm: f64) -> Figure {
        self.width = mm;
        self
    }

    /// Sets the height, mm; without it, panels are about two thirds as high as wide.
    pub fn height(mut self, mm: f64) -> Figure {
        self.height = Some(mm);
        self
    }

    /// Sets the relative widths of the columns.
    pub fn column_widths(mut self, shares: impl IntoIterator<Item = f64>) -> Figure {
        self.column_widths = shares.into_iter().collect();
        self
    }

    /// Sets the relative heights of the rows.
    pub fn row_heights(mut self, shares: impl IntoIterator<Item = f64>) -> Figure {
        self.row_heights = shares.into_iter().collect();
        self
    }

    /// Sets the text above the whole figure, and the title of the file.
    pub fn title(mut self, title: impl Into<String>) -> Figure {
        self.title = title.into();
        self
    }

    /// Sets the text below the whole figure, which is broken into lines.
    pub fn caption(mut self, caption: impl Into<String>) -> Figure {
        self.caption = caption.into();
        self
    }

    /// Sets whether panels are lettered (a), (b) …; the default is yes if there is more than one
    /// cell.
    pub fn letters(mut self, letters: bool) -> Figure {
        self.letters = letters;
        self
    }

    /// Gives the panels of each column the same horizontal range, labelled below the lowest one
    /// only.
    pub fn share_x(mut self) -> Figure {
        self.share_x = true;
        self
    }

    /// Makes letters and ticks `factor` times as large, for example for slides.
    pub fn text_scale(mut self, factor: f64) -> Figure {
        self.text_scale = factor;
        self
    }

    /// Checks that the figure can be drawn: sizes, ranges, counts of panels and cells. Whatever draws it
    /// does so first.
    ///
    /// # Errors
    /// If it cannot; the message names the number.
    pub fn check(&self) -> Result<(), FigureError> {
        let cells = self.rows.saturating_mul(self.cols);
        if !(1..=400).contains(&cells) || self.panels.len() > cells {
            return Err(FigureError::Invalid(format!(
                "{} panels do not fit a grid of {} × {}: it must have 1 to 400 cells, one for each panel",
                self.panels.len(),
                self.rows,
                self.cols
            )));
        }
        let sensible = |length: f64| (10.0..=2000.0).contains(&length);
        if !sensible(self.width) || !sensible(self.full_height()) {
            return Err(FigureError::Invalid(format!(
                "a figure of {} mm × {} mm cannot be drawn: both sides must lie between 10 mm and 2000 mm",
                self.width,
                self.full_height()
            )));
        }
        if !(0.2..=10.0).contains(&self.text_scale) {
            return Err(FigureError::length(
                "a text scale (0.2 to 10)",
                self.text_scale,
            ));
        }
        for (what, given, expected) in [
            ("widths", &self.column_widths, self.cols),
            ("heights", &self.row_heights, self.rows),
        ] {
            let right = given.len() == expected && given.iter().all(|s| s.is_finite() && *s > 0.0);
            if !(given.is_empty() || right) {
                return Err(FigureError::Invalid(format!(
                    "{given:?} cannot be the relative {what} of {expected} cells: give one positive number for each"
                )));
            }
        }
        self.panels.iter().try_for_each(Panel::check)
    }

    pub(crate) fn full_height(&self) -> f64 {
        self.height.unwrap_or_else(|| {
            let panel = 0.68 * self.width / self.cols.max(1) as f64;
            panel.clamp(42.0, 90.0) * self.rows as f64
        })
    }
}
