//! The figure of a sweep: a bifurcation diagram, or a map of motions.

use std::collections::{BTreeMap, BTreeSet};

use nanotap_figures::{
    Axis, CategoryMap, Colour, DOUBLE_COLUMN, Figure, Heatmap, Legend, Motion,
    ONE_AND_A_HALF_COLUMNS, Panel, Points,
};
use serde::Deserialize;

use crate::sweep::{FromNeighbour, class_of, from_neighbours};
use nanotap_case::physical::Kind;
use nanotap_case::units::prefixed;
use nanotap_dataset::{Coordinate, Store, StoreError, Values};
use nanotap_motions::figure::branch::{natural_of, scale_of};
use nanotap_motions::figure::panels::largest_of;
use nanotap_motions::figure::plotted_quantity::PlottedQuantity;
use nanotap_motions::simulate::Classification;
use nanotap_observe::table::shown_phase;

/// Largest number of categories of a map, and of periods of a diagram, with separate colours.
const MAX_CATEGORIES: usize = 12;
/// Colour of the categories without a separate colour.
const OTHERS: Colour = Colour::rgb(222, 222, 222);

/// An axis of a sweep's grid.
#[derive(Clone, Debug, Deserialize)]
pub struct GridAxis {
    /// Name of the parameter, without the unit.
    pub label: String,
    /// SI unit of the values; empty in model units.
    #[serde(default)]
    pub units: String,
    /// Whether the values are evenly spaced by their logarithms.
    #[serde(default)]
    pub log: bool,
    /// Values of the parameter, in `units`; in model units if that is empty.
    #[serde(default)]
    pub values: Vec<f64>,
}

/// The motions of a sweep, in the order of the grid with the last index fastest: over the
/// parameters, then over the initial states.
#[derive(Clone, Debug, Deserialize)]
pub struct SweepTable {
    /// One parameter or two; the first of two is the vertical axis.
    pub axes: Vec<GridAxis>,
    /// Direction in which each initial state was followed (`up`, `down`); empty if it was not.
    pub directions: Vec<String>,
    /// SI unit of the maxima; empty in model units.
    #[serde(default)]
    pub units: String,
    /// Code of each motion's classification.
    #[serde(default)]
    pub classification: Vec<u8>,
    /// Period of each motion in drive periods; 0 if it has none.
    #[serde(default)]
    pub period: Vec<i32>,
    /// Maxima of the tip deflection in each recorded drive period, motion by motion; empty for a
    /// sweep over two parameters.
    #[serde(default)]
    pub period_max: Vec<f64>,
    /// Orbits that no initial state reached, continued from neighbouring values.
    #[serde(default)]
    pub neighbours: Vec<FromNeighbour>,
}

/// Direction and motion of a cloud of points; `None`: a motion too rare for the legend.
type CloudOf<'a> = (&'a str, Option<Motion>);

impl SweepTable {
    /// Reads a finished dataset.
    ///
    /// # Errors
    /// If chunks are missing or cannot be read.
    pub fn of(store: &Store) -> Result<Self, StoreError> {
        store.require_all()?;
        let schema = store.schema();
        let parameters = schema.grid.axes.len() - 1;
        let starts = schema.grid.axes[parameters].length;
        let cells: usize = schema.grid.axes.iter().map(|axis| axis.length).product();
        let maxima = schema.index_of("period_max").filter(|_| parameters == 1);
        let stride = maxima.map_or(0, |index| schema.variables[index].stride());
        let mut table = Self {
            axes: (0..parameters)
                .map(|axis| GridAxis::of(store, axis))
                .collect(),
            directions: match schema.coordinate("direction").map(|c| &c.values) {
                Some(Values::Text(words)) => words.clone(),
                _ => vec![String::new(); starts],
            },
            units: maxima
                .and_then(|k| schema.variables[k].attributes.get("units")?.as_str())
                .unwrap_or_default()
                .to_owned(),
            classification: vec![0; cells],
            period: vec![0; cells],
            period_max: vec![f64::NAN; cells * stride],
            neighbours: from_neighbours(store)?,
        };
        let cell_of = |entry: &[usize]| {
            let axes = entry.iter().zip(&schema.grid.axes);
            axes.fold(0, |cell, (index, axis)| cell * axis.length + index)
        };
        store.each(["classification", "period"], |entry, [code, period]| {
            let cell = cell_of(entry);
            table.classification[cell] = code as u8;
            table.period[cell] = period as i32;
        })?;
        let Some(maxima) = maxima else {
            return Ok(table);
        };
        for chunk in 0..store.chunks() {
            let block = schema.grid.block(chunk);
            let highs = store.read_chunk(&block, maxima)?.numbers();
            for (flat, entry) in block.entries().enumerate() {
                let cell = cell_of(&entry);
                if let Some(row) = highs.get(flat * stride..(flat + 1) * stride) {
                    table.period_max[cell * stride..(cell + 1) * stride].copy_from_slice(row);
                }
            }
        }
        Ok(table)
    }

    /// The figure: a bifurcation diagram of one parameter, a map of motions over two. `None` if the
    /// columns do not fill the grid.
    pub fn figure(&self) -> Option<Figure> {
        let points: usize = self.axes.iter().map(|axis| axis.values.len()).product();
        let cells = points.checked_mul(self.directions.len())?;
        let fits = cells > 0
            && self.classification.len() == cells
            && self.period.len() == cells
            && self.period_max.len().is_multiple_of(cells);
        match self.axes.as_slice() {
            [x] if fits => Some(self.diagram(&x.shown())),
            [y, x] if fits => {
                let panel = self.map(&x.shown(), &y.shown()).legend(Legend::Right);
                Some(Figure::single(panel).width(ONE_AND_A_HALF_COLUMNS))
            }
            _ => None,
        }
    }

    /// The motion, which determines its colour; `None` if it is missing.
    fn motion(&self, cell: usize) -> Option<Motion> {
        motion(self.classification[cell], self.period[cell])
    }

    /// Maxima of the tip deflection per period over one parameter, one colour per motion; if motions
    /// were followed, above that both directions, one colour each.
    fn diagram(&self, x: &GridScale) -> Figure {
        let starts = self.directions.len();
        let cells = self.classification.len();
        let stride = self.period_max.len() / cells;
        let mut counts: BTreeMap<Motion, usize> = BTreeMap::new();
        for motion in (0..cells).filter_map(|cell| self.motion(cell)) {
            *counts.entry(motion).or_default() += 1;
        }
        let mut frequent: Vec<Motion> = counts.keys().copied().collect();
        frequent.sort_by_key(|motion| std::cmp::Reverse(counts[motion]));
        frequent.truncate(MAX_CATEGORIES);
        // `None`: motions too rare for the legend.
        let mut clouds: BTreeMap<CloudOf<'_>, Vec<(f64, f64)>> = BTreeMap::new();
        for cell in 0..cells {
            let Some(motion) = self.motion(cell) else {
                continue;
            };
            // An orbit repeats after one turn.
            let turn = match motion {
                Motion::Periodic(period) => period.min(stride),
                _ => stride,
            };
            let row = &self.period_max[cell * stride..cell * stride + turn];
            let at = x.values[cell / starts];
            let cloud = clouds
                .entry((
                    &self.directions[cell % starts],
                    frequent.contains(&motion).then_some(motion),
                ))
                .or_default();
            cloud.extend(row.iter().filter(|y| y.is_finite()).map(|y| (at, *y)));
        }
        // Followed motions show hysteresis.
        let drawn = self.directions.iter().all(String::is_empty);
        for orbit in self.neighbours.iter().filter(|_| drawn) {
            let (Some(&at), Some(motion)) = (x.values.get(orbit.at[0]), orbit.motion()) else {
                continue;
            };
            let key = ("", frequent.contains(&motion).then_some(motion));
            clouds.entry(key).or_default().push((at, orbit.tip_max));
        }
        let (factor, unit) = deflection(&self.units, clouds.values().flatten().map(|p| p.1));
        let empty = || {
            let y = Axis::linear("max $W$ in a drive period").unit(&unit);
            Panel::new(x.axis(), y).legend(Legend::Above)
        };
        let cloud = |points: &[(f64, f64)], part: f64| {
            let diameter = match points.len() {
                0..2_000 => 0.8,
                2_000..20_000 => 0.3,
                _ => 0.13,
            };
            Points::new(points.iter().map(|(at, y)| (*at, factor * y))).diameter(part * diameter)
        };
        let mut by_motion: BTreeMap<Option<Motion>, Vec<(f64, f64)>> = BTreeMap::new();
        let mut by_direction: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
        for ((direction, motion), points) in clouds {
            by_direction.entry(direction).or_default().extend(&points);
            by_motion.entry(motion).or_default().extend(points);
        }
        // Chaos is drawn first, below periodic motions.
        let motions = by_motion
            .iter()
            .rev()
            .filter(|(_, points)| !points.is_empty());
        let motions = motions.map(|(motion, points)| {
            cloud(points, 1.0)
                .colour(motion.map_or(OTHERS, Motion::colour))
                .label(motion.map_or_else(|| "other".to_owned(), |m| m.to_string()))
        });
        let motions = empty().with_all(motions);
        if drawn {
            return Figure::new(1, 1).width(DOUBLE_COLUMN).with(motions);
        }
        // "up" first: the smaller marks of "down" lie above.
        let directions = by_direction.iter().rev().map(|(direction, points)| {
            let (part, colour) = of_direction(direction);
            cloud(points, part)
                .colour(colour)
                .label(format!("following {direction}"))
        });
        Figure::new(2, 1)
            .width(DOUBLE_COLUMN)
            .share_x()
            .with(empty().with_all(directions))
            .with(motions)
    }

    /// Map of the motions over two parameters.
    fn map(&self, x: &GridScale, y: &GridScale) -> Panel {
        let starts = self.directions.len();
        let mut found: Vec<BTreeSet<Option<Motion>>> = (0..x.values.len() * y.values.len())
            .map(|place| {
                (0..starts)
                    .map(|k| self.motion(place * starts + k))
                    .collect()
            })
            .collect();
        for orbit in &self.neighbours {
            let place = orbit.at[1] * x.values.len() + orbit.at[0];
            if let (Some(motions), Some(motion)) = (found.get_mut(place), orbit.motion()) {
                motions.insert(Some(motion));
            }
        }
        let mut counts: BTreeMap<&BTreeSet<Option<Motion>>, usize> = BTreeMap::new();
        for motions in &found {
            *counts.entry(motions).or_default() += 1;
        }
        // The most frequent ones are named, in the order of their motions.
        let mut frequent: Vec<_> = counts
            .iter()
            .map(|(motions, count)| (usize::MAX - count, *motions))
            .collect();
        frequent.sort();
        let mut named: Vec<&BTreeSet<Option<Motion>>> = frequent
            .iter()
            .take(MAX_CATEGORIES)
            .map(|(_, motions)| *motions)
            .collect();
        named.sort();
        let others = frequent.len() > named.len();
        let index: BTreeMap<_, usize> = named.iter().enumerate().map(|(k, m)| (*m, k)).collect();
        let cells: Vec<Option<usize>> = found
            .iter()
            .map(|motions| Some(index.get(motions).copied().unwrap_or(named.len())))
            .collect();
        let mut layer = GridScale::map(x, y, &cells);
        // A set of several motions has a separate colour.
        let alone: BTreeSet<Motion> = named
            .iter()
            .filter(|motions| motions.len() == 1)
            .filter_map(|motions| *motions.first()?)
            .collect();
        let mut free = (1..=16)
            .rev()
            .map(Motion::Periodic)
            .filter(|motion| !alone.contains(motion))
            .map(Motion::colour);
        for motions in named {
            let colour = match (motions.len(), motions.first()) {
                (1, Some(Some(motion))) => motion.colour(),
                (1, _) => Colour::WHITE,
                _ => free.next().unwrap_or(OTHERS),
            };
            let words: Vec<String> = motions
                .iter()
                .map(|m| m.map_or_else(|| "missing".to_owned(), |m| m.to_string()))
                .collect();
            layer = layer.category_in(words.join(" + "), colour);
        }
        if others {
            layer = layer.category_in("other", OTHERS);
        }
        Panel::new(x.axis(), y.axis()).with(layer)
    }
}

impl FromNeighbour {
    /// The motion, which determines its colour; `None` if it does not repeat.
    fn motion(&self) -> Option<Motion> {
        (self.period > 0).then_some(Motion::Periodic(self.period))
    }
}

/// The motion of a code and a period; `None` if it is missing.
pub(crate) fn motion(code: u8, period: i32) -> Option<Motion> {
    Some(match class_of(code)? {
        Classification::Periodic => Motion::Periodic(usize::try_from(period).unwrap_or(0)),
        Classification::QuasiPeriodic => Motion::QuasiPeriodic,
        Classification::Chaotic => Motion::Chaotic,
        Classification::Unbounded => Motion::Unbounded,
        Classification::Transient | Classification::Undecided => Motion::Undecided,
    })
}

/// Size and colour of the marks of a direction; those of "down" lie above those of "up".
fn of_direction(direction: &str) -> (f64, Colour) {
    if direction == "down" {
        (1.0, Colour::VERMILLION)
    } else {
        (1.8, Colour::BLUE)
    }
}

/// Factor and unit of deflections; the unit is empty in model units.
fn deflection(units: &str, values: impl Iterator<Item = f64>) -> (f64, String) {
    if units != "m" {
        return (1.0, String::new());
    }
    prefixed(Kind::Length, 1.0, largest_of(values))
}

/// The figure of a finished dataset: a bifurcation diagram over one parameter, a map of
/// classifications over two.
///
/// # Errors
/// When a chunk is missing or damaged.
pub fn figure(store: &Store) -> Result<Figure, StoreError> {
    Ok(SweepTable::of(store)?.figure().unwrap_or_default())
}

/// Amplitude and phase at the drive frequency over one parameter, one colour per direction
/// (resonance curves); over two parameters maps of the motions and of the measured quantities.
///
/// # Errors
/// If chunks are missing or cannot be read.
pub fn response(store: &Store) -> Result<Figure, StoreError> {
    store.require_all()?;
    let schema = store.schema();
    if schema.grid.axes.len() > 2 {
        return maps(store);
    }
    let x = GridAxis::of(store, 0).shown();
    let directions: Vec<String> = match schema.coordinate("direction").map(|c| &c.values) {
        Some(Values::Text(words)) => words.clone(),
        _ => vec![String::new(); schema.grid.axes[1].length],
    };
    let mut figure = Figure::new(2, 1)
        .width(ONE_AND_A_HALF_COLUMNS)
        .height(120.0)
        .share_x();
    for (name, label) in [("first_harmonic", "amplitude $A$"), ("phase", "phase lag")] {
        let index = schema.index_of(name).unwrap_or(0);
        let mut curves: BTreeMap<(String, usize), Vec<(f64, f64)>> = BTreeMap::new();
        for chunk in 0..store.chunks() {
            let block = schema.grid.block(chunk);
            let Values::Real(values) = store.read_chunk(&block, index)? else {
                continue;
            };
            for (value, entry) in values.iter().zip(block.entries()) {
                curves
                    .entry((directions[entry[1]].clone(), entry[1]))
                    .or_default()
                    .push((x.values[entry[0]], *value));
            }
        }
        let units = schema.variables[index].attributes.get("units");
        let units = units.and_then(|unit| unit.as_str()).unwrap_or_default();
        let (factor, unit) = match units {
            "degree" => (1.0, "°".to_owned()),
            units => deflection(units, curves.values().flatten().map(|p| p.1)),
        };
        let mut panel =
            Panel::new(x.axis(), Axis::linear(label).unit(unit)).legend(if name == "phase" {
                Legend::Hidden
            } else {
                Legend::Above
            });
        let mut named = BTreeSet::new();
        // "up" first: the smaller marks of "down" lie above.
        for ((direction, _), mut curve) in curves.into_iter().rev() {
            curve.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (part, colour) = of_direction(&direction);
            // Marks, so that a jump is not drawn as a line.
            let marks = curve.into_iter().map(|(at, y)| (at, factor * y));
            let mut layer = Points::new(marks).diameter(0.6 * part).colour(colour);
            if !direction.is_empty() && named.insert(direction.clone()) {
                layer = layer.label(format!("following {direction}"));
            }
            panel = panel.with(layer);
        }
        figure = figure.with(panel);
    }
    Ok(figure)
}

/// Maps over two parameters: the motions, and amplitude, phase, peak force, dissipation and contact
/// time of the motions of the first initial state.
fn maps(store: &Store) -> Result<Figure, StoreError> {
    const SHOWN: [&str; 5] = [
        "first_harmonic",
        "phase",
        "peak_force",
        "dissipation",
        "contact_fraction",
    ];
    let [y, x] = [0, 1].map(|axis| GridAxis::of(store, axis).shown());
    let motions = SweepTable::of(store)?.map(&x, &y).legend(Legend::Above);
    let mut figure = Figure::new(3, 2)
        .width(DOUBLE_COLUMN)
        .height(195.0)
        .with(motions.title("motions"));
    let mut values = Vec::new();
    for shown in SHOWN.into_iter().filter_map(PlottedQuantity::named) {
        values.push((shown, of_first_start(store, shown)?));
    }
    let size = |values: &[f64]| largest_of(values.iter().copied());
    let largest = |wanted: PlottedQuantity| {
        let found = values.iter().find(|(shown, _)| *shown == wanted);
        found.map_or(0.0, |(_, (of, _))| size(of))
    };
    for (shown, (of, in_si)) in &values {
        let natural = natural_of(*shown, largest);
        let si = |_| in_si.then_some(1.0);
        let (title, factor) = shown.axis(true, si, scale_of(size(of), natural));
        let scale = Axis::linear("").natural(natural.map(|size| factor * size));
        let layer = GridScale::heatmap(&x, &y, of.iter().map(|v| factor * v), scale);
        figure = figure.with(
            Panel::new(x.axis(), y.axis())
                .with(layer)
                .title(title.words()),
        );
    }
    Ok(figure)
}

/// A quantity of the motions of the first initial state over two parameters, row by row, and
/// whether it is in SI.
fn of_first_start(store: &Store, shown: PlottedQuantity) -> Result<(Vec<f64>, bool), StoreError> {
    let schema = store.schema();
    let [rows, columns] = [0, 1].map(|axis| schema.grid.axes[axis].length);
    let mut all = vec![f64::NAN; rows * columns];
    let name = shown.observable().map_or("", |o| o.name);
    let Some(index) = schema.index_of(name) else {
        return Ok((all, false));
    };
    for chunk in 0..store.chunks() {
        let block = schema.grid.block(chunk);
        let Values::Real(values) = store.read_chunk(&block, index)? else {
            continue;
        };
        for (value, entry) in values.iter().zip(block.entries()) {
            if entry[2] == 0 {
                let value = if shown.is_phase() {
                    shown_phase(*value)
                } else {
                    *value
                };
                all[entry[0] * columns + entry[1]] = value;
            }
        }
    }
    let units = schema.variables[index].attributes.get("units");
    let in_si = units
        .and_then(|unit| unit.as_str())
        .is_some_and(|u| !u.is_empty());
    Ok((all, in_si))
}

impl GridAxis {
    /// The axis with index `axis` of a dataset's grid.
    pub(crate) fn of(store: &Store, axis: usize) -> Self {
        let schema = store.schema();
        let name = &schema.grid.axes[axis].name;
        let coordinate = schema.coordinate(name);
        let text = |c: &Coordinate, key: &str| Some(c.attributes.get(key)?.as_str()?.to_owned());
        let said = |key: &str| coordinate.and_then(|c| text(c, key));
        Self {
            label: said("label").unwrap_or_else(|| name.replace(['.', '_'], " ")),
            units: said("units").unwrap_or_default(),
            log: said("spacing").as_deref() == Some("log"),
            values: schema.axis_values(axis),
        }
    }

    /// Values and label of the axis in the units of the figure.
    pub(crate) fn shown(&self) -> GridScale {
        let (factor, unit) = match Kind::of_si_unit(&self.units) {
            Some(kind) => {
                let size = self
                    .values
                    .iter()
                    .fold(0.0, |size: f64, v| size.max(v.abs()));
                prefixed(kind, 1.0, size)
            }
            None => (1.0, String::new()),
        };
        GridScale {
            values: self.values.iter().map(|v| factor * v).collect(),
            label: self.label.clone(),
            unit,
            log: self.log,
        }
    }
}

/// Number of cells along an axis with uneven values.
const CELLS: usize = 800;

/// The values of a parameter in the units of the figure.
pub(crate) struct GridScale {
    pub(crate) values: Vec<f64>,
    label: String,
    unit: String,
    log: bool,
}

impl GridScale {
    pub(crate) fn axis(&self) -> Axis {
        let axis = if self.log {
            Axis::log(&self.label)
        } else {
            Axis::linear(&self.label)
        };
        axis.unit(&self.unit).tight()
    }

    /// A map of the categories of a grid, row by row.
    pub(crate) fn map(x: &Self, y: &Self, points: &[Option<usize>]) -> CategoryMap {
        let (columns, rows) = (x.cells(), y.cells());
        let width = x.values.len();
        let cells = rows.iter().flat_map(|row| {
            columns
                .iter()
                .map(move |column| points[row * width + column])
        });
        CategoryMap::new(columns.len(), rows.len(), cells, x.edges(), y.edges())
    }

    /// A map of a number at each point of a grid, row by row.
    pub(crate) fn heatmap(
        x: &Self,
        y: &Self,
        points: impl Iterator<Item = f64>,
        scale: Axis,
    ) -> Heatmap {
        let points: Vec<f64> = points.collect();
        let (columns, rows) = (x.cells(), y.cells());
        let width = x.values.len();
        let values = rows
            .iter()
            .flat_map(|row| columns.iter().map(move |column| (row, column)));
        let values = values.map(|(row, column)| points[row * width + column]);
        let values: Vec<f64> = values.collect();
        Heatmap::new(
            columns.len(),
            rows.len(),
            values,
            x.edges(),
            y.edges(),
            scale,
        )
    }

    /// Index of the value in each cell: one cell per value, or many even cells with the nearest value
    /// if the values are uneven.
    fn cells(&self) -> Vec<usize> {
        let last = self.values.len() - 1;
        if !self.is_uneven() {
            return (0..=last).collect();
        }
        let (from, to) = self.edges();
        let nearest = |cell: usize| {
            let at = from + (to - from) * (cell as f64 + 0.5) / CELLS as f64;
            let above = self.values.partition_point(|v| *v < at).clamp(1, last);
            let [low, high] = [above - 1, above].map(|k| self.values[k]);
            if at - low <= high - at {
                above - 1
            } else {
                above
            }
        };
        (0..CELLS).map(nearest).collect()
    }

    /// Whether the values have neither equal steps nor, on a logarithmic axis, equal ratios.
    fn is_uneven(&self) -> bool {
        let [from, to] = [self.values.first(), self.values.last()].map(Option::<&f64>::copied);
        let (Some(from), Some(to)) = (from, to) else {
            return false;
        };
        let steps = (self.values.len() - 1) as f64;
        let step = (to - from) / steps;
        let even = |(k, v): (usize, &f64)| (v - (from + step * k as f64)).abs() <= 1e-6 * step;
        !self.log && !self.values.iter().enumerate().all(even)
    }

    /// The borders of the cells of the values, one more than there are values.
    pub(crate) fn borders(&self) -> Vec<f64> {
        let (from, to) = self.edges();
        let between = self.values.windows(2).map(|pair| {
            if self.log && !self.is_uneven() {
                (pair[0] * pair[1]).sqrt()
            } else {
                0.5 * (pair[0] + pair[1])
            }
        });
        let inner: Vec<f64> = between.collect();
        std::iter::once(from)
            .chain(inner)
            .chain(std::iter::once(to))
            .collect()
    }

    /// The outer edges of cells around the values.
    pub(crate) fn edges(&self) -> (f64, f64) {
        let (from, to) = (self.values[0], self.values[self.values.len() - 1]);
        let steps = (self.values.len() - 1) as f64;
        if steps == 0.0 {
            let half = if from == 0.0 { 0.5 } else { 0.05 * from.abs() };
            return (from - half, to + half);
        }
        if self.is_uneven() {
            let last = self.values.len() - 1;
            let low = 0.5 * (self.values[1] - from);
            let high = 0.5 * (to - self.values[last - 1]);
            return (from - low, to + high);
        }
        if self.log {
            let ratio = nanotap_arithmetic::powf(to / from, 0.5 / steps);
            (from / ratio, to * ratio)
        } else {
            let half = 0.5 * (to - from) / steps;
            (from - half, to + half)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_uneven_values_end_midway() {
        let scale = GridScale {
            values: vec![0.0, 1.0, 5.0],
            label: String::new(),
            unit: String::new(),
            log: false,
        };
        // Edges −0.5, 0.5, 3, 7: parts 1/7.5, 2.5/7.5, 4/7.5.
        assert_eq!(scale.edges(), (-0.5, 7.0));
        let cells = scale.cells();
        for (value, part) in [1.0 / 7.5, 2.5 / 7.5, 4.0 / 7.5].into_iter().enumerate() {
            let count = cells.iter().filter(|cell| **cell == value).count();
            assert!((count as f64 / CELLS as f64 - part).abs() < 2.0 / CELLS as f64);
        }
        let even = GridScale {
            values: vec![0.0, 1.0, 2.0],
            ..scale
        };
        assert_eq!(even.cells(), [0, 1, 2]);
    }
}
