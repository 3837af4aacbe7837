//! One plot of a figure.

use serde::{Deserialize, Serialize};

use crate::axis::Axis;
use crate::error::FigureError;
use crate::layer::Layer;

/// Position of the legend of a panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Legend {
    /// In a corner or at an edge where it hides no data, otherwise above the panel.
    #[default]
    Auto,
    /// Inside the panel, top left.
    TopLeft,
    /// Inside the panel, top right.
    TopRight,
    /// Inside the panel, bottom left.
    BottomLeft,
    /// Inside the panel, bottom right.
    BottomRight,
    /// Outside, in rows above the panel.
    Above,
    /// Outside, in a column to the right of the panel.
    Right,
    /// The panel has no legend.
    Hidden,
}

/// Two axes and the layers between them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
#[must_use]
pub struct Panel {
    /// Title above the panel; empty if there is none.
    pub title: String,
    /// The panel's letter, such as "(a)"; `None`: the one given by the figure.
    pub letter: Option<String>,
    /// The horizontal axis, with its label, unit and range.
    pub x: Axis,
    /// The vertical axis, with its label, unit and range.
    pub y: Axis,
    /// The layers, from back to front.
    pub layers: Vec<Layer>,
    /// Position of the legend, which lists the layers with a label.
    pub legend: Legend,
}

impl Panel {
    /// Creates a panel with these axes and without layers.
    pub fn new(x: Axis, y: Axis) -> Panel {
        Panel {
            x,
            y,
            ..Panel::default()
        }
    }

    /// Sets the title above the panel.
    pub fn title(mut self, title: impl Into<String>) -> Panel {
        self.title = title.into();
        self
    }

    /// Sets the panel's letter, such as "(a)", instead of the one given by the figure.
    pub fn letter(mut self, letter: impl Into<String>) -> Panel {
        self.letter = Some(letter.into());
        self
    }

    /// Sets the position of the legend.
    pub fn legend(mut self, legend: Legend) -> Panel {
        self.legend = legend;
        self
    }

    /// Adds a layer in front of the others.
    pub fn with(mut self, layer: impl Into<Layer>) -> Panel {
        self.layers.push(layer.into());
        self
    }

    /// Adds layers in front of the others, from back to front.
    pub fn with_all<L: Into<Layer>>(mut self, layers: impl IntoIterator<Item = L>) -> Panel {
        self.layers.extend(layers.into_iter().map(Into::into));
        self
    }

    pub(crate) fn check(&self) -> Result<(), FigureError> {
        self.x.check()?;
        self.y.check()?;
        self.layers
            .iter()
            .try_for_each(|layer| self.check_layer(layer))
    }

    fn check_layer(&self, layer: &Layer) -> Result<(), FigureError> {
        match layer {
            Layer::Line(l) => length("the line width (pt)", l.width),
            Layer::Rule(l) => length("the line width (pt)", l.width),
            Layer::Points(l) => length("the diameter of points (mm)", l.diameter),
            Layer::Markers(l) => length("the size of markers (mm)", l.size),
            Layer::Bars(l) => length("the width of bars", l.width),
            Layer::Heatmap(l) => {
                l.scale.check()?;
                cells(l.columns, l.rows, l.values.len())?;
                self.check_edges(l.x, l.y)
            }
            Layer::CategoryMap(l) => {
                cells(l.columns, l.rows, l.cells.len())?;
                let named = l.categories.len();
                match l.cells.iter().flatten().find(|c| **c >= named) {
                    Some(category) => Err(FigureError::Invalid(format!(
                        "a cell belongs to category {category}, but only {named} categories are named"
                    ))),
                    None => self.check_edges(l.x, l.y),
                }
            }
            Layer::Stems(_) | Layer::Band(_) | Layer::Note(_) => Ok(()),
        }
    }

    /// Checks that the edges of a grid make a valid axis.
    fn check_edges(&self, x: (f64, f64), y: (f64, f64)) -> Result<(), FigureError> {
        self.x.clone().range(x.0, x.1).check()?;
        self.y.clone().range(y.0, y.1).check()
    }
}

fn length(what: &'static str, given: f64) -> Result<(), FigureError> {
    if given.is_finite() && given > 0.0 {
        Ok(())
    } else {
        Err(FigureError::length(what, given))
    }
}

fn cells(columns: usize, rows: usize, given: usize) -> Result<(), FigureError> {
    if columns.checked_mul(rows) == Some(given) && given > 0 {
        Ok(())
    } else {
        Err(FigureError::Invalid(format!(
            "a heatmap of {columns} columns and {rows} rows cannot be filled with {given} values: give one value for each cell, and at least one"
        )))
    }
}
