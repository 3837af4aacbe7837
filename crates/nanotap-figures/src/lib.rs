//! Publication figures: one data model, written as SVG, PNG, PDF and JSON.
//!
//! A [`Figure`] is plain data: it has [`Panel`]s in a grid; a panel has two axes ([`Axis`]) and
//! layers ([`Line`], [`Points`], [`Markers`], [`Heatmap`] …). Sizes are those of the printed page.
//! Nothing depends on the machine: the typeface is part of the program, letters are drawn as shapes
//! in every format, and the same figure gives the same bytes.
//!
//! Other renderers (matplotlib, a browser) use the same description from [`Figure::to_json`], with
//! all ranges, colours and letters resolved, or the SVG together with the positions of its axes
//! from [`Figure::to_svg_with_map`]. Colours of motions come from [`Motion::colour`].
//!
//! ```
//! use nanotap_figures::{Axis, Figure, Line, Panel};
//!
//! let wave = (0..=200).map(|i| f64::from(i) / 200.0).map(|t| (t, (6.28 * t).sin()));
//! let panel = Panel::new(Axis::linear("τ / T").tight(), Axis::linear("$W$"))
//!     .with(Line::new(wave).label("tip"));
//! let svg = Figure::single(panel).to_svg()?;
//! assert!(svg.contains("aria-label=\"τ / T\""));
//! # Ok::<(), nanotap_figures::FigureError>(())
//! ```
//!
//! The typeface is Noto Sans (SIL Open Font License 1.1), from the notosans crate.
//!
//! Values that are not finite, or not positive on a logarithmic axis, are gaps. A panel without
//! data shows "no data".

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

mod axis;
mod canvas;
mod cloud;
mod colour;
mod draw;
mod error;
mod figure;
mod font;
mod layer;
mod layout;
mod legend;
mod map;
mod marks;
mod note;
mod numbers;
mod page;
mod panel;
mod pdf;
mod pixels;
mod polyline;
mod prepared;
mod raster;
mod resolve;
mod scene;
mod shape;
mod style;
mod svg;
mod symbol;
mod text;
pub mod ticks;

pub use axis::{Axis, ROUNDING, Range, Scale};
pub use colour::{Colour, Colourmap, LINES, Motion, category};
pub use error::FigureError;
pub use figure::{DOUBLE_COLUMN, Figure, ONE_AND_A_HALF_COLUMNS, SINGLE_COLUMN};
pub use layer::{
    Band, Bars, Category, CategoryMap, Dash, Heatmap, Layer, Line, Markers, Note, Place, Points,
    Rule, Shape, Side, Stems,
};
pub use map::{AxisMap, PanelMap};
pub use page::DPI;
pub use panel::{Legend, Panel};
pub use text::mathtext;

/// Name of the program in every picture: a comment in SVG, the software of PNG, the producer of
/// PDF.
pub const MADE_BY: &str = "nanotap";
