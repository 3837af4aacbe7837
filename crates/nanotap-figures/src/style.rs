//! Sizes common to all figures, as journals require for lettering and lines at final size.

use crate::colour::Colour;
use crate::text::MM_PER_POINT;

/// Sizes of letters, pt, and of the lengths that scale with them, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Style {
    /// Type size of tick labels, pt.
    pub(crate) marks: f64,
    /// Type size of the labels of the axes, pt.
    pub(crate) label: f64,
    /// Type size of legends, notes and captions, pt.
    pub(crate) legend: f64,
    /// Type size of panel letters and titles, pt.
    pub(crate) title: f64,
    /// Length of labelled ticks, mm.
    pub(crate) mark: f64,
    pub(crate) minor_mark: f64,
    /// Small and large distance between neighbours, mm.
    pub(crate) pad: f64,
    pub(crate) gap: f64,
    /// Width of the lines of axes and ticks, mm.
    pub(crate) axis: f64,
}

/// Colour of axes and their labels.
pub(crate) const INK: Colour = Colour::BLACK;
/// Margin of the page, mm.
pub(crate) const EDGE: f64 = 0.8;

impl Style {
    /// The style with its letters `scale` times as large.
    pub(crate) fn scaled(scale: f64) -> Style {
        Style {
            marks: 7.0 * scale,
            label: 8.0 * scale,
            legend: 7.0 * scale,
            title: 8.0 * scale,
            mark: 0.9 * scale,
            minor_mark: 0.5 * scale,
            pad: 0.8 * scale,
            gap: 3.0 * scale,
            axis: 0.5 * scale * MM_PER_POINT,
        }
    }

    /// Line spacing of a legend or caption, mm.
    pub(crate) fn line(&self) -> f64 {
        1.3 * self.legend * MM_PER_POINT
    }
}
