use std::path::PathBuf;

/// Why a figure could not be drawn or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FigureError {
    /// The path's ending names no format that can be written.
    #[error(
        "cannot tell a picture format from \"{}\": end the path in .svg, .png or .pdf",
        path.display()
    )]
    UnknownEnding {
        /// The path as given.
        path: PathBuf,
    },
    /// The file could not be written.
    #[error("cannot write \"{}\": {source}", path.display())]
    Write {
        /// The path as given.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A figure that could not be read from JSON, or not be written as such.
    #[error("this is no figure in JSON: {0}")]
    Json(serde_json::Error),
    /// The figure's width or height is not a sensible length.
    #[error(
        "a figure of {width_mm} mm × {height_mm} mm cannot be drawn: both sides must lie between 10 mm and 2000 mm"
    )]
    Size {
        /// Width as given, mm.
        width_mm: f64,
        /// Height as given, mm.
        height_mm: f64,
    },
    /// The picture would have no pixels, or too many.
    #[error(
        "{dpi} dots per inch cannot be drawn at this size: choose 10 to 2400 with at most 200 million pixels in all"
    )]
    Resolution {
        /// Resolution as given, dots per inch.
        dpi: f64,
    },
    /// More panels than cells, or a grid without cells.
    #[error(
        "{panels} panels do not fit a grid of {rows} × {cols}: it must have 1 to 400 cells, one for each panel"
    )]
    Grid {
        /// Rows as given.
        rows: usize,
        /// Columns as given.
        cols: usize,
        /// Number of panels given.
        panels: usize,
    },
    /// Relative widths or heights that do not describe the grid.
    #[error(
        "{given:?} cannot be the relative {what} of {expected} cells: give one positive number for each"
    )]
    Ratios {
        /// Widths or heights.
        what: &'static str,
        /// As given.
        given: Vec<f64>,
        /// How many were expected.
        expected: usize,
    },
    /// A fixed range that no axis can have.
    #[error("the axis \"{axis}\" cannot run from {from} to {to}: {reason}")]
    Range {
        /// Label of the axis.
        axis: String,
        /// Start as given.
        from: f64,
        /// End as given.
        to: f64,
        /// What would be right.
        reason: &'static str,
    },
    /// A heatmap whose cells do not fill its grid.
    #[error(
        "a heatmap of {columns} columns and {rows} rows cannot be filled with {given} values: give one value for each cell, and at least one"
    )]
    Cells {
        /// Columns as given.
        columns: usize,
        /// Rows as given.
        rows: usize,
        /// Number of values given.
        given: usize,
    },
    /// A heatmap cell that belongs to a category that was not named.
    #[error("a cell belongs to category {category}, but only {named} categories are named")]
    Category {
        /// Number of the category, from 0.
        category: usize,
        /// How many categories were named.
        named: usize,
    },
    /// A length in a layer (line width, marker size …) that cannot be drawn.
    #[error("{what} of {given} cannot be drawn: it must be finite and positive")]
    Length {
        /// What the length is.
        what: &'static str,
        /// As given.
        given: f64,
    },
    /// Labels and legends leave no room for the data.
    #[error(
        "the panel in row {row}, column {column} has {width_mm:.1} mm × {height_mm:.1} mm left for its data: make the figure larger, its labels shorter, or its panels fewer"
    )]
    NoRoom {
        /// Row from 1.
        row: usize,
        /// Column from 1.
        column: usize,
        /// Width left, mm.
        width_mm: f64,
        /// Height left, mm.
        height_mm: f64,
    },
}
