//! Maps over two parameters: the motions, the peak force on the sample, or the number of coexisting
//! motions.

use nanotap::dataset::{Store, StoreError};
use nanotap::figure::sweep::figure as sweep_figure;
use nanotap::study::sweep::from_neighbours;
use nanotap_figures::{Axis, CategoryMap, Colour, Figure, Heatmap, Layer, Legend};
use serde_json::Value;

use nanotap::case::quantity::Kind;
use nanotap::case::units::prefixed;

/// Quantity shown by a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Shows {
    /// The motions that were found.
    #[default]
    Motions,
    /// The largest peak force of any of them.
    Force,
    /// The number of coexisting motions.
    States,
}

/// Labels and colours of the numbers of motions.
const COLOURS: [(&str, Colour); 4] = [
    ("one", Colour::rgb(222, 235, 247)),
    ("two", Colour::ORANGE),
    ("three", Colour::VERMILLION),
    ("more", Colour::BLACK),
];

/// Amplitudes with a smaller relative difference belong to the same motion.
const SAME: f64 = 1e-6;

impl Shows {
    pub(crate) const ALL: [Self; 3] = [Self::Motions, Self::Force, Self::States];

    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::Motions => "kinds of motion",
            Self::Force => "peak force",
            Self::States => "number of motions",
        }
    }

    pub(crate) fn named(words: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|shows| shows.words() == words)
    }
}

/// Identity of a motion: its class, its period, its amplitude.
type Met = (u8, i32, f64);

/// The map of a sweep over two parameters.
pub(crate) fn figure(store: &Store, shows: Shows) -> Result<Figure, StoreError> {
    let mut figure = sweep_figure(store)?;
    if shows == Shows::Motions {
        return Ok(figure);
    }
    let Some(panel) = figure.panels.first_mut() else {
        return Ok(figure);
    };
    let Some(Layer::CategoryMap(grid)) = panel.layers.pop() else {
        return Ok(figure);
    };
    panel.layers.push(match shows {
        Shows::Force => force(store, &grid)?.into(),
        _ => states(store, &grid)?.into(),
    });
    panel.legend = Legend::Right;
    Ok(figure)
}

fn force(store: &Store, grid: &CategoryMap) -> Result<Heatmap, StoreError> {
    let mut greatest = vec![f64::NAN; grid.columns * grid.rows];
    let schema = store.schema();
    let width = schema.grid.axes[1].length;
    store.each(["peak_force"], |entry, [force]| {
        if let Some(most) = greatest.get_mut(entry[0] * width + entry[1]) {
            *most = most.max(force);
        }
    })?;
    let variable = schema.index_of("peak_force").map(|k| &schema.variables[k]);
    let units = variable.and_then(|v| v.attributes.get("units").and_then(Value::as_str));
    let size = greatest.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let (factor, unit) = if units == Some(Kind::Force.si_unit()) {
        prefixed(Kind::Force, 1.0, size)
    } else {
        (1.0, String::new())
    };
    let values: Vec<f64> = greatest.iter().map(|force| factor * force).collect();
    let scale = Axis::linear("peak force on the tip").unit(unit);
    Ok(Heatmap::new(
        grid.columns,
        grid.rows,
        values,
        grid.x,
        grid.y,
        scale,
    ))
}

/// The number of different motions at each place, including those continued from neighbouring
/// places.
fn states(store: &Store, grid: &CategoryMap) -> Result<CategoryMap, StoreError> {
    let mut found: Vec<Vec<Met>> = vec![Vec::new(); grid.columns * grid.rows];
    let mut meet = |at: usize, (code, period, amplitude): Met| {
        let Some(motions) = found.get_mut(at) else {
            return;
        };
        let same = |met: &Met| {
            let near = (met.2 - amplitude).abs() <= SAME * amplitude.abs();
            // A motion that does not repeat has no fixed amplitude.
            met.0 == code && met.1 == period && (period == 0 || near)
        };
        if !motions.iter().any(same) {
            motions.push((code, period, amplitude));
        }
    };
    let names = ["classification", "period", "first_harmonic"];
    let mut periodic = None;
    let width = store.schema().grid.axes[1].length;
    store.each(names, |entry, [code, period, amplitude]| {
        let (code, period) = (code as u8, period as i32);
        if code == 0 {
            return;
        }
        if period > 0 {
            periodic = Some(code);
        }
        meet(entry[0] * width + entry[1], (code, period, amplitude));
    })?;
    for orbit in from_neighbours(store)? {
        let at = orbit.at[1] * grid.columns + orbit.at[0];
        let period = i32::try_from(orbit.period).unwrap_or(0);
        if let Some(code) = periodic.filter(|_| period > 0) {
            meet(at, (code, period, orbit.first_harmonic));
        }
    }
    let cells: Vec<Option<usize>> = found
        .iter()
        .map(|motions| motions.len().min(COLOURS.len()).checked_sub(1))
        .collect();
    let most = cells.iter().flatten().max().map_or(1, |most| most + 1);
    let mut map = CategoryMap::new(grid.columns, grid.rows, cells, grid.x, grid.y);
    for (words, colour) in &COLOURS[..most] {
        map = map.category_in(*words, *colour);
    }
    Ok(map)
}
