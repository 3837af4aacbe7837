use std::path::PathBuf;

/// Why a figure could not be drawn or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FigureError {
    /// No format is known for the file extension.
    #[error(
        "cannot tell a picture format from \"{}\": end the path in .svg, .png or .pdf",
        path.display()
    )]
    UnknownEnding {
        /// The given path.
        path: PathBuf,
    },
    /// The file could not be written.
    #[error("cannot write \"{}\": {source}", path.display())]
    Write {
        /// The given path.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The figure's SVG could not be converted to PNG or PDF.
    #[error("cannot convert the figure from SVG: {reason}")]
    Conversion {
        /// The converter's message.
        reason: String,
    },
    /// A figure could not be read from JSON or written as JSON.
    #[error("this is no figure in JSON: {0}")]
    Json(serde_json::Error),
    /// The figure's width or height cannot be drawn.
    #[error(
        "a figure of {width_mm} mm × {height_mm} mm cannot be drawn: both sides must lie between 10 mm and 2000 mm"
    )]
    Size {
        /// Given width, mm.
        width_mm: f64,
        /// Given height, mm.
        height_mm: f64,
    },
    /// The picture would have no pixels, or too many.
    #[error(
        "{dpi} dots per inch cannot be drawn at this size: choose 10 to 2400 with at most 200 million pixels in all"
    )]
    Resolution {
        /// Given resolution, dots per inch.
        dpi: f64,
    },
    /// More panels than cells, or a grid without cells.
    #[error(
        "{panels} panels do not fit a grid of {rows} × {cols}: it must have 1 to 400 cells, one for each panel"
    )]
    Grid {
        /// Given number of rows.
        rows: usize,
        /// Given number of columns.
        cols: usize,
        /// Given number of panels.
        panels: usize,
    },
    /// Relative widths or heights that do not match the grid.
    #[error(
        "{given:?} cannot be the relative {what} of {expected} cells: give one positive number for each"
    )]
    Ratios {
        /// "widths" or "heights".
        what: &'static str,
        /// The given values.
        given: Vec<f64>,
        /// Expected number of values.
        expected: usize,
    },
    /// An invalid fixed range of an axis.
    #[error("the axis \"{axis}\" cannot run from {from} to {to}: {reason}")]
    Range {
        /// Label of the axis.
        axis: String,
        /// Given start.
        from: f64,
        /// Given end.
        to: f64,
        /// What a valid range is.
        reason: &'static str,
    },
    /// A heatmap whose number of values does not match its grid.
    #[error(
        "a heatmap of {columns} columns and {rows} rows cannot be filled with {given} values: give one value for each cell, and at least one"
    )]
    Cells {
        /// Given number of columns.
        columns: usize,
        /// Given number of rows.
        rows: usize,
        /// Given number of values.
        given: usize,
    },
    /// A heatmap cell with the number of an undefined category.
    #[error("a cell belongs to category {category}, but only {named} categories are named")]
    Category {
        /// Number of the category, from 0.
        category: usize,
        /// Number of defined categories.
        named: usize,
    },
    /// A length in a layer (line width, marker size …) that cannot be drawn.
    #[error("{what} of {given} cannot be drawn: it must be finite and positive")]
    Length {
        /// Name of the length.
        what: &'static str,
        /// Given length.
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
