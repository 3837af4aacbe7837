//! Where the axes of a drawn figure lie.

use serde::Serialize;

use crate::axis::{Axis, Scale, View};

/// A panel as it was drawn: its box, in units of the SVG's `viewBox` (mm from the top left), and its
/// axes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PanelMap {
    /// Letter such as "(a)"; empty where there is none.
    pub letter: String,
    /// Words above the panel.
    pub title: String,
    /// Left edge of the box.
    pub left: f64,
    /// Upper edge of the box.
    pub top: f64,
    /// Width of the box.
    pub width: f64,
    /// Height of the box.
    pub height: f64,
    /// The horizontal axis, from the left edge to the right one.
    pub x: AxisMap,
    /// The vertical axis, from the lower edge to the upper one.
    pub y: AxisMap,
}

/// An axis as it was drawn. A value `v` lies at the part (v − from)/(to − from) of it; on a
/// logarithmic axis, this holds of logarithms.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisMap {
    /// Words and symbol.
    pub label: String,
    /// The unit; empty where there is none.
    pub unit: String,
    /// How values are spaced.
    pub scale: Scale,
    /// Value at its start.
    pub from: f64,
    /// Value at its end.
    pub to: f64,
}

impl AxisMap {
    pub(crate) fn new(axis: &Axis, view: View) -> AxisMap {
        AxisMap {
            label: axis.label.clone(),
            unit: axis.unit.clone(),
            scale: axis.scale,
            from: view.from,
            to: view.to,
        }
    }
}
