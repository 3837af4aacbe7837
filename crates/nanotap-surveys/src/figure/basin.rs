//! The figure of basins: one colour per attractor, with the positions of the attractors.

use std::collections::BTreeSet;

use nanotap_figures::{
    Axis, CategoryMap, Colour, Figure, Legend, Markers, Motion, ONE_AND_A_HALF_COLUMNS, Panel,
    Points,
};
use serde::Deserialize;

use crate::basin::{BEHIND, BasinAttractor, FAILED, UNBOUNDED, UNSETTLED, entries, known, labels};
use nanotap_case::physical::Kind;
use nanotap_dataset::{Store, StoreError};
use nanotap_motions::figure::panels::motion_of;
use nanotap_motions::figure::panels::si_axis;

/// The attractors that are reached from the points of a slice of states.
#[derive(Clone, Debug, Deserialize)]
pub struct BasinTable {
    /// The entry of the state that is drawn to the right.
    pub x: String,
    /// The entry of the state that is drawn upwards.
    pub y: String,
    /// Values of x, evenly spaced, in SI; in model units where `si` is 1.
    #[serde(default)]
    pub x_values: Vec<f64>,
    /// Values of y, evenly spaced, in SI; in model units where `si` is 1.
    #[serde(default)]
    pub y_values: Vec<f64>,
    /// SI values of the model's units of x and y; 1 where the values have no unit.
    #[serde(default = "no_units")]
    pub si: [f64; 2],
    /// Attractors of the dataset, with their states at drive phase 0 in model units.
    pub attractors: Vec<BasinAttractor>,
    /// Names of the entries of a state.
    pub entries: Vec<String>,
    /// Number of the attractor that is reached from each point, row by row from the smallest y;
    /// negative if none is.
    #[serde(default)]
    pub labels: Vec<i32>,
}

/// The figure of a finished dataset.
///
/// # Errors
/// When a chunk is missing or damaged.
pub fn figure(store: &Store) -> Result<Figure, StoreError> {
    store.require_all()?;
    let schema = store.schema();
    let axes = &schema.grid.axes;
    let columns = axes[1].length;
    let recipe: serde_json::Value = schema
        .attributes
        .get("basin")
        .and_then(|text| serde_json::from_str(text.as_str()?).ok())
        .unwrap_or_default();
    let mut table = BasinTable {
        si: ["x", "y"].map(|name| recipe[name]["si"].as_f64().unwrap_or(1.0)),
        x: axes[1].name.clone(),
        y: axes[0].name.clone(),
        x_values: schema.axis_values(1),
        y_values: schema.axis_values(0),
        attractors: known(store)?,
        entries: entries(store),
        labels: vec![FAILED; axes[0].length * columns],
    };
    for chunk in 0..store.chunks() {
        let block = schema.grid.block(chunk);
        for (entry, label) in block.entries().zip(labels(store, &block)?) {
            table.labels[entry[0] * columns + entry[1]] = label;
        }
    }
    Ok(table.figure().unwrap_or_default())
}

impl BasinTable {
    /// Returns the figure; `None` if the labels do not fill the slice.
    pub fn figure(&self) -> Option<Figure> {
        let (columns, rows) = (self.x_values.len(), self.y_values.len());
        if columns.checked_mul(rows)? != self.labels.len() || self.labels.is_empty() {
            return None;
        }
        let colours = Motion::colours(self.attractors.iter().map(motion));
        // Categories of points without an attractor follow those of the attractors.
        let present: BTreeSet<i32> = self.labels.iter().copied().collect();
        let others: Vec<(i32, &str, Colour)> = [
            (UNSETTLED, "unsettled", Motion::Undecided.colour()),
            (UNBOUNDED, "unbounded", Motion::Unbounded.colour()),
            (FAILED, "not followed", Colour::rgb(120, 120, 120)),
            (BEHIND, "behind the surface", Colour::rgb(225, 225, 225)),
        ]
        .into_iter()
        .filter(|(label, ..)| present.contains(label))
        .collect();
        let known = self.attractors.len();
        let cells = self.labels.iter().map(|&label| {
            let other = || Some(known + others.iter().position(|(l, ..)| *l == label)?);
            usize::try_from(label)
                .ok()
                .filter(|k| *k < known)
                .or_else(other)
        });
        let x = Side::new(&self.x, &self.x_values, self.si[0]);
        let y = Side::new(&self.y, &self.y_values, self.si[1]);
        let mut layer = CategoryMap::new(columns, rows, cells, x.ends, y.ends);
        for (attractor, colour) in self.attractors.iter().zip(&colours) {
            layer = layer.category_in(attractor.name(), *colour);
        }
        for (_, name, colour) in others {
            layer = layer.category_in(name, colour);
        }
        let mut panel = Panel::new(x.axis.tight(), y.axis.tight())
            .with(layer)
            .legend(Legend::Right);
        let place = |name: &str| self.entries.iter().position(|n| n == name);
        if let (Some(kx), Some(ky)) = (place(&self.x), place(&self.y)) {
            let within = |v: f64, (low, high): (f64, f64)| low <= v && v <= high;
            for (attractor, colour) in self.attractors.iter().zip(colours) {
                let points: Vec<(f64, f64)> = attractor
                    .states
                    .iter()
                    .filter_map(|s| Some((x.factor * s.get(kx)?, y.factor * s.get(ky)?)))
                    .filter(|p| within(p.0, x.ends) && within(p.1, y.ends))
                    .collect();
                panel = if attractor.period.is_some() {
                    panel.with(Markers::new(points).size(1.6).colour(colour).white_edge())
                } else {
                    panel.with(Points::new(points).diameter(0.3).colour(Colour::BLACK))
                };
            }
            // One entry in the legend for the points of all orbits.
            let grey = Colour::rgb(120, 120, 120);
            let key = Markers::new([]).size(1.6).colour(grey).white_edge();
            panel = panel.with(key.label("orbits, each in its colour"));
        }
        Some(Figure::single(panel).width(ONE_AND_A_HALF_COLUMNS))
    }
}

fn motion(attractor: &BasinAttractor) -> Motion {
    attractor
        .period
        .map_or_else(|| motion_of(&attractor.classification), Motion::Periodic)
}

struct Side {
    /// Outer edges of the first and last cell, in the unit of the axis.
    ends: (f64, f64),
    /// Factor from the model's unit to the unit of the axis.
    factor: f64,
    axis: Axis,
}

impl Side {
    /// The side of an entry of the state with its values, in SI if `si`, the SI value of the model's
    /// unit, is not 1.
    fn new(name: &str, values: &[f64], si: f64) -> Self {
        let (low, high) = edges(values);
        let kind = match name.chars().next() {
            Some('a') if si != 1.0 => Kind::Length,
            Some('v') if si != 1.0 => Kind::Velocity,
            _ => Kind::Number,
        };
        let (axis, scale) = si_axis(symbol(name), kind, low.abs().max(high.abs()));
        Self {
            axis,
            ends: (scale * low, scale * high),
            factor: if kind == Kind::Number {
                1.0
            } else {
                scale * si
            },
        }
    }
}

fn no_units() -> [f64; 2] {
    [1.0; 2]
}

/// The outer edges of cells around evenly spaced values.
fn edges(values: &[f64]) -> (f64, f64) {
    let (from, to) = (values[0], values[values.len() - 1]);
    let half = match 0.5 * (to - from) / (values.len() - 1).max(1) as f64 {
        0.0 => 0.5,
        half => half,
    };
    (from - half, to + half)
}

/// Symbol of an entry of the state: `$a_1$` for `a1`.
fn symbol(name: &str) -> String {
    let (letter, number) = name.split_at(1.min(name.len()));
    let letter = if letter == "v" && !number.is_empty() {
        "ȧ"
    } else {
        letter
    };
    if number.is_empty() {
        format!("${letter}$")
    } else {
        format!("${letter}_{{{number}}}$")
    }
}
