//! The picture of a sweep: a bifurcation diagram, or a map of what motions there are.

use std::collections::{BTreeMap, BTreeSet};

use nanotap_figures::{
    Axis, CategoryMap, Colour, DOUBLE_COLUMN, Figure, Legend, ONE_AND_A_HALF_COLUMNS, Panel,
    Points, category,
};

use super::summary::{Motions, class_of};
use crate::case::physical::Kind;
use crate::case::units::prefixed;
use crate::dataset::{Coordinate, Store, StoreError, Values};
use crate::study::simulate::Classification;

/// Categories of a map that get a colour of their own.
const MOST_CATEGORIES: usize = 12;
/// Colours of [`category`] before it begins again with tints.
const PALETTE: usize = 7;

/// The picture of a finished dataset.
pub(super) fn of(store: &Store) -> Result<Figure, StoreError> {
    store.require_all()?;
    let axes = &store.schema().grid.axes;
    if axes.len() > 2 {
        map(store)
    } else {
        diagram(store)
    }
}

/// Per-period maxima of the tip deflection over one parameter, a colour a
/// classification, a panel a direction of following.
fn diagram(store: &Store) -> Result<Figure, StoreError> {
    let schema = store.schema();
    let x = GridScale::of(store, 0);
    let directions: Vec<String> = match schema.coordinate("direction").map(|c| &c.values) {
        Some(Values::Text(words)) => words.clone(),
        _ => vec![String::new(); schema.grid.axes[1].length],
    };
    let mut clouds: BTreeMap<(String, u8), Vec<(f64, f64)>> = BTreeMap::new();
    let maxima = schema.index_of("period_max").unwrap_or(0);
    for chunk in 0..store.chunks() {
        let block = schema.grid.block(chunk);
        let Motions { codes, periods } = Motions::read(store, chunk)?;
        let Values::Real(highs) = store.read_chunk(&block, maxima)? else {
            continue;
        };
        let stride = schema.variables[maxima].stride();
        for (flat, entry) in block.entries().enumerate() {
            // An orbit repeats after one turn.
            let turn = if periods[flat] > 0 {
                periods[flat] as usize
            } else {
                stride
            };
            let row = &highs[flat * stride..(flat + 1) * stride];
            let cloud = clouds
                .entry((directions[entry[1]].clone(), codes[flat]))
                .or_default();
            let at = x.values[entry[0]];
            cloud.extend(
                row.iter()
                    .take(turn)
                    .filter(|y| y.is_finite())
                    .map(|y| (at, *y)),
            );
        }
    }
    let deflection = Deflection::of(store, "period_max", clouds.values().flatten().map(|p| p.1));
    let shown: BTreeSet<String> = directions.into_iter().collect();
    let mut figure = Figure::new(shown.len(), 1).width(DOUBLE_COLUMN).share_x();
    // "up" before "down".
    for direction in shown.iter().rev() {
        let title = if direction.is_empty() {
            String::new()
        } else {
            format!("following {direction}")
        };
        let label = format!("max $W$ in a drive period{}", deflection.unit);
        let mut panel = Panel::new(x.axis(), Axis::linear(label))
            .title(title)
            .legend(Legend::Above);
        // What is chaotic lies under what is periodic.
        for code in [4, 5, 3, 2, 1] {
            let (Some(class), Some(points)) =
                (class_of(code), clouds.remove(&(direction.clone(), code)))
            else {
                continue;
            };
            let diameter = match points.len() {
                0..2_000 => 0.5,
                2_000..20_000 => 0.3,
                _ => 0.13,
            };
            let points = points
                .into_iter()
                .map(|(at, y)| (at, deflection.factor * y));
            panel = panel.with(
                Points::new(points)
                    .diameter(diameter)
                    .colour(colour(class))
                    .label(class.name()),
            );
        }
        figure = figure.with(panel);
    }
    Ok(figure)
}

/// What motions there are over two parameters.
fn map(store: &Store) -> Result<Figure, StoreError> {
    let schema = store.schema();
    let (y, x) = (GridScale::of(store, 0), GridScale::of(store, 1));
    let columns = x.values.len();
    let mut found: Vec<BTreeSet<(u8, i32)>> = vec![BTreeSet::new(); columns * y.values.len()];
    for chunk in 0..store.chunks() {
        let block = schema.grid.block(chunk);
        let Motions { codes, periods } = Motions::read(store, chunk)?;
        for (flat, entry) in block.entries().enumerate() {
            found[entry[0] * columns + entry[1]].insert((codes[flat], periods[flat]));
        }
    }
    let mut counts: BTreeMap<&BTreeSet<(u8, i32)>, usize> = BTreeMap::new();
    for motions in &found {
        *counts.entry(motions).or_default() += 1;
    }
    // The most frequent ones are named, in the order of their motions.
    let mut frequent: Vec<_> = counts
        .iter()
        .map(|(motions, count)| (usize::MAX - count, *motions))
        .collect();
    frequent.sort();
    let mut named: Vec<&BTreeSet<(u8, i32)>> = frequent
        .iter()
        .take(MOST_CATEGORIES)
        .map(|(_, motions)| *motions)
        .collect();
    named.sort();
    let others = frequent.len() > named.len();
    let index: BTreeMap<_, usize> = named
        .iter()
        .enumerate()
        .map(|(k, motions)| (*motions, k))
        .collect();
    let cells: Vec<Option<usize>> = found
        .iter()
        .map(|motions| Some(index.get(motions).copied().unwrap_or(named.len())))
        .collect();
    let mut layer = CategoryMap::new(columns, y.values.len(), cells, x.edges(), y.edges());
    // Not those that stand for a class of motions, nor tints of them.
    let taken = [Colour::GREEN, Colour::VERMILLION].map(family);
    let mut free = (0..)
        .filter(|k| !taken.contains(&Some(k % PALETTE)))
        .map(category);
    for motions in &named {
        let name = words(motions);
        let single = if motions.len() == 1 {
            motions.first().and_then(|m| class_of(m.0))
        } else {
            None
        };
        layer = match single {
            Some(Classification::Periodic) | None => {
                layer.category_in(name, free.next().unwrap_or(Colour::GREY))
            }
            Some(class) => layer.category_in(name, colour(class)),
        };
    }
    if others {
        layer = layer.category_in("other", Colour::rgb(200, 200, 200));
    }
    let panel = Panel::new(x.axis(), y.axis())
        .with(layer)
        .legend(Legend::Right);
    Ok(Figure::single(panel).width(ONE_AND_A_HALF_COLUMNS))
}

/// The place of a colour among those of [`category`].
fn family(colour: Colour) -> Option<usize> {
    (0..PALETTE).find(|k| category(*k) == colour)
}

/// `period 1 + chaotic`.
fn words(motions: &BTreeSet<(u8, i32)>) -> String {
    let word = |(code, period): &(u8, i32)| match class_of(*code) {
        Some(Classification::Periodic) => format!("period {period}"),
        Some(class) => class.name().to_owned(),
        None => "missing".to_owned(),
    };
    motions.iter().map(word).collect::<Vec<_>>().join(" + ")
}

fn colour(class: Classification) -> Colour {
    match class {
        Classification::Periodic => Colour::BLUE,
        Classification::QuasiPeriodic => Colour::GREEN,
        Classification::Chaotic => Colour::VERMILLION,
        Classification::Unbounded => Colour::BLACK,
        Classification::Undecided => Colour::GREY,
    }
}

/// Amplitude and phase at the drive's frequency over one parameter, a colour a direction of
/// following: resonance curves.
pub(super) fn response(store: &Store) -> Result<Figure, StoreError> {
    store.require_all()?;
    let schema = store.schema();
    if schema.grid.axes.len() > 2 {
        return map(store);
    }
    let x = GridScale::of(store, 0);
    let directions: Vec<String> = match schema.coordinate("direction").map(|c| &c.values) {
        Some(Values::Text(words)) => words.clone(),
        _ => vec![String::new(); schema.grid.axes[1].length],
    };
    let mut figure = Figure::new(2, 1)
        .width(ONE_AND_A_HALF_COLUMNS)
        .height(120.0)
        .share_x();
    for (name, label) in [
        ("first_harmonic", "amplitude $A$"),
        ("phase", "phase behind the drive (°)"),
    ] {
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
        let unit = Deflection::of(store, name, curves.values().flatten().map(|p| p.1));
        let mut panel = Panel::new(x.axis(), Axis::linear(format!("{label}{}", unit.unit))).legend(
            if name == "phase" {
                Legend::Hidden
            } else {
                Legend::Above
            },
        );
        let mut named = BTreeSet::new();
        // "up" before "down", whose smaller marks lie upon it.
        for ((direction, _), mut curve) in curves.into_iter().rev() {
            curve.sort_by(|a, b| a.0.total_cmp(&b.0));
            let colour = if direction == "down" {
                Colour::VERMILLION
            } else {
                Colour::BLUE
            };
            // What was met is a list of motions: marks, so that a jump is not a line.
            let marks = curve.into_iter().map(|(at, y)| (at, unit.factor * y));
            let mut layer = Points::new(marks)
                .diameter(if direction == "down" { 0.6 } else { 0.9 })
                .colour(colour);
            if !direction.is_empty() && named.insert(direction.clone()) {
                layer = layer.label(format!("following {direction}"));
            }
            panel = panel.with(layer);
        }
        figure = figure.with(panel);
    }
    Ok(figure)
}

/// How a variable is shown: what its numbers are multiplied with, and the unit in brackets
/// (empty in the model's own units).
struct Deflection {
    factor: f64,
    unit: String,
}

impl Deflection {
    fn of(store: &Store, name: &str, values: impl Iterator<Item = f64>) -> Self {
        let size = values
            .filter(|v| v.is_finite())
            .fold(0.0, |size: f64, v| size.max(v.abs()));
        let schema = store.schema();
        let unit = schema
            .index_of(name)
            .and_then(|k| schema.variables[k].attributes.get("units")?.as_str());
        let kind = unit.filter(|unit| *unit == "m").map(|_| Kind::Length);
        kind.map_or_else(
            || Self {
                factor: 1.0,
                unit: String::new(),
            },
            |kind| {
                let (factor, unit) = prefixed(kind, 1.0, size);
                Self {
                    factor,
                    unit: format!(" ({unit})"),
                }
            },
        )
    }
}

/// The values of a parameter and how they are spaced.
pub(crate) struct GridScale {
    /// As they are shown.
    pub(crate) values: Vec<f64>,
    /// As they are in the dataset.
    pub(crate) raw: Vec<f64>,
    label: String,
    log: bool,
}

impl GridScale {
    /// Of an axis of the grid.
    pub(crate) fn of(store: &Store, axis: usize) -> Self {
        let schema = store.schema();
        let axis = &schema.grid.axes[axis];
        let coordinate = schema.coordinate(&axis.name);
        let values = match coordinate.map(|c| &c.values) {
            Some(Values::Real(values)) => values.clone(),
            _ => (0..axis.length).map(|k| k as f64).collect(),
        };
        let text = |c: &Coordinate, key: &str| Some(c.attributes.get(key)?.as_str()?.to_owned());
        let symbol = coordinate
            .and_then(|c| text(c, "symbol"))
            .unwrap_or_else(|| axis.name.clone());
        let log = coordinate.and_then(|c| text(c, "spacing")).as_deref() == Some("log");
        let unit = coordinate
            .and_then(|c| text(c, "units"))
            .unwrap_or_default();
        let kind = Kind::ALL
            .into_iter()
            .find(|kind| *kind != Kind::Number && kind.si_unit() == unit);
        // A quantity of a physical case is called by its path: drive.frequency.
        let words = symbol.replace(['.', '_'], " ");
        match kind {
            Some(kind) => {
                let size = values.iter().fold(0.0, |size: f64, v| size.max(v.abs()));
                let (factor, unit) = prefixed(kind, 1.0, size);
                Self {
                    values: values.iter().map(|v| factor * v).collect(),
                    raw: values,
                    label: format!("{words} ({unit})"),
                    log,
                }
            }
            None if symbol.contains('.') => Self {
                raw: values.clone(),
                values,
                label: words,
                log,
            },
            None => Self {
                raw: values.clone(),
                values,
                label: format!("${symbol}$"),
                log,
            },
        }
    }

    /// The axis.
    pub(crate) fn axis(&self) -> Axis {
        let label = self.label.clone();
        if self.log {
            Axis::log(label).tight()
        } else {
            Axis::linear(label).tight()
        }
    }

    /// The outer edges of cells around the values.
    pub(crate) fn edges(&self) -> (f64, f64) {
        let (from, to) = (self.values[0], self.values[self.values.len() - 1]);
        let steps = (self.values.len() - 1) as f64;
        if steps == 0.0 {
            let half = if from == 0.0 { 0.5 } else { 0.05 * from.abs() };
            return (from - half, to + half);
        }
        if self.log {
            let ratio = (to / from).powf(0.5 / steps);
            (from / ratio, to * ratio)
        } else {
            let half = 0.5 * (to - from) / steps;
            (from - half, to + half)
        }
    }
}
