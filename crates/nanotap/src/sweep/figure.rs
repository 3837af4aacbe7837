//! The picture of a sweep: a bifurcation diagram, or a map of what motions there are.

use std::collections::{BTreeMap, BTreeSet};

use nanotap_figures::{
    Axis, CategoryMap, Colour, DOUBLE_COLUMN, Figure, Legend, ONE_AND_A_HALF_COLUMNS, Panel,
    Points, category,
};

use super::summary::{Motions, class_of};
use crate::dataset::{Coordinate, Store, StoreError, Values};
use crate::simulate::Classification;

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
    let x = Scale::of(store, 0);
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
    let shown: BTreeSet<String> = directions.into_iter().collect();
    let mut figure = Figure::new(shown.len(), 1).width(DOUBLE_COLUMN).share_x();
    // "up" before "down".
    for direction in shown.iter().rev() {
        let title = if direction.is_empty() {
            String::new()
        } else {
            format!("following {direction}")
        };
        let mut panel = Panel::new(x.axis(), Axis::linear("max $W$ in a drive period"))
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
    let (y, x) = (Scale::of(store, 0), Scale::of(store, 1));
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

/// The values of a parameter and how they are spaced.
struct Scale {
    values: Vec<f64>,
    label: String,
    log: bool,
}

impl Scale {
    /// Of an axis of the grid.
    fn of(store: &Store, axis: usize) -> Self {
        let schema = store.schema();
        let axis = &schema.grid.axes[axis];
        let coordinate = schema.coordinate(&axis.name);
        let values = match coordinate.map(|c| &c.values) {
            Some(Values::Real(values)) => values.clone(),
            _ => (0..axis.length).map(|k| k as f64).collect(),
        };
        let text = |c: &Coordinate, key: &str| Some(c.attributes.get(key)?.as_str()?.to_owned());
        let label = coordinate
            .and_then(|c| text(c, "symbol"))
            .unwrap_or_else(|| axis.name.clone());
        let log = coordinate.and_then(|c| text(c, "spacing")).as_deref() == Some("log");
        Self { values, label, log }
    }

    fn axis(&self) -> Axis {
        let label = format!("${}$", self.label);
        if self.log {
            Axis::log(label).tight()
        } else {
            Axis::linear(label).tight()
        }
    }

    /// The outer edges of cells around the values.
    fn edges(&self) -> (f64, f64) {
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
