//! Positions of the axes in a drawn figure.

use serde::Serialize;

use crate::axis::{Axis, Scale, View};

/// A drawn panel: its box, in units of the SVG's `viewBox` (mm from the top left), and its axes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PanelMap {
    /// Letter such as "(a)"; empty if there is none.
    pub letter: String,
    /// Title above the panel; empty if there is none.
    pub title: String,
    /// Left edge of the box, mm from the left edge of the figure.
    pub left: f64,
    /// Upper edge of the box, mm from the upper edge of the figure.
    pub top: f64,
    /// Width of the box, mm.
    pub width: f64,
    /// Height of the box, mm.
    pub height: f64,
    /// The horizontal axis, from the left edge to the right one.
    pub x: AxisMap,
    /// The vertical axis, from the lower edge to the upper one.
    pub y: AxisMap,
}

/// A drawn axis. A value `v` is at the fraction (v − from)/(to − from) of the axis; on a
/// logarithmic axis this applies to the logarithms.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisMap {
    /// Quantity on the axis, without the unit; may contain markup.
    pub label: String,
    /// Unit; empty if there is none.
    pub unit: String,
    /// Spacing of values along the axis, linear or logarithmic.
    pub scale: Scale,
    /// Value at the start of the axis, in its unit.
    pub from: f64,
    /// Value at the end of the axis, in its unit.
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
