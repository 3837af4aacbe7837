//! The figure of a fit: measured curves, the fitted model, and the residuals.

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Figure, Heatmap, Legend, Line, Markers, Panel, Rule, category,
};
use serde::Deserialize;

use crate::fit::{FitReport, FittedColumn, FittedRow, OF_FORCES, Reading};
use nanotap_case::Key;
use nanotap_case::physical::Kind;
use nanotap_dataset::schema::Attributes;
use nanotap_dataset::{Store, StoreError};
use nanotap_motions::approach::Way;
use nanotap_motions::figure::panels::{largest_of, si_axis};
use nanotap_motions::figure::plotted_quantity::PlottedQuantity;
use nanotap_motions::frequency_modulation::Modulated;
use nanotap_observe::frame::Row as _;
use nanotap_observe::table::shown_phase;

/// Number of panels side by side.
const ACROSS: usize = 3;

/// An axis of a map of fits, or the values of a fitted parameter row by row.
#[derive(Clone, Debug, Deserialize)]
pub struct MappedColumn {
    /// Name of the axis, or key of the parameter.
    pub name: String,
    /// SI unit of the values; `1` for pure numbers.
    pub units: String,
    /// The values; `None` where nothing was fitted.
    pub values: Vec<Option<f64>>,
}

impl MappedColumn {
    fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        self.values.iter().map(|value| value.unwrap_or(f64::NAN))
    }

    /// The values as they are drawn, and their axis.
    fn drawn(&self) -> (Vec<f64>, Axis) {
        let (axis, factor) = self.axis();
        let values = self.numbers().map(|value| factor * value).collect();
        (values, axis)
    }

    /// The axis, and what multiplies the values where they are drawn.
    fn axis(&self) -> (Axis, f64) {
        let kind = Key::find(&self.name).map(Key::kind);
        match kind.or_else(|| Kind::of_si_unit(&self.units)) {
            Some(kind) => si_axis(&self.name, kind, largest_of(self.numbers())),
            None => (Axis::linear(&self.name).unit(&self.units), 1.0),
        }
    }
}

/// The fitted parameters of a force volume over its pixels.
#[derive(Clone, Debug, Deserialize)]
pub struct FitMaps {
    /// The axes of the pixels, the slowest first.
    pub axes: Vec<MappedColumn>,
    /// The parameters.
    pub maps: Vec<MappedColumn>,
}

impl FitMaps {
    /// Reads the parameters of a finished dataset.
    ///
    /// # Errors
    /// When a chunk is missing or damaged.
    pub fn of(store: &Store) -> Result<Self, StoreError> {
        store.require_all()?;
        let schema = store.schema();
        let units = |attributes: &Attributes| {
            let unit = attributes.get("units").and_then(|unit| unit.as_str());
            unit.unwrap_or("1").to_owned()
        };
        let axes = schema.grid.axes.iter().enumerate().map(|(k, axis)| {
            let coordinate = schema.coordinate(&axis.name);
            MappedColumn {
                name: axis.name.clone(),
                units: coordinate.map_or_else(|| "1".into(), |c| units(&c.attributes)),
                values: schema.axis_values(k).into_iter().map(Some).collect(),
            }
        });
        let mut maps = Vec::new();
        for (k, variable) in schema.variables.iter().enumerate() {
            let is_parameter = schema
                .index_of(&format!("{}_error", variable.name))
                .is_some();
            if !is_parameter && !OF_FORCES.iter().any(|(name, ..)| *name == variable.name) {
                continue;
            }
            let mut values = Vec::new();
            for chunk in 0..store.chunks() {
                let numbers = store.read_chunk(&schema.grid.block(chunk), k)?.numbers();
                values.extend(numbers.into_iter().map(Some));
            }
            if values.iter().flatten().all(|value: &f64| value.is_nan()) {
                continue;
            }
            maps.push(MappedColumn {
                name: variable.name.clone(),
                units: units(&variable.attributes),
                values,
            });
        }
        Ok(Self {
            axes: axes.collect(),
            maps,
        })
    }

    /// A map of each parameter; of a single row of pixels, its values.
    pub fn figure(&self) -> Figure {
        let across = self.maps.len().clamp(1, 2);
        let down = self.maps.len().div_ceil(across).max(1);
        let figure = Figure::new(down, across)
            .width(DOUBLE_COLUMN)
            .height(80.0 * down as f64);
        let (Some(y), Some(x)) = (self.axes.first(), self.axes.last()) else {
            return figure;
        };
        let [rows, columns] = match self.axes.len() {
            1 => [1, x.values.len()],
            _ => [y.values.len(), x.values.len()],
        };
        self.maps.iter().fold(figure, |figure, map| {
            let (scaled, scale) = map.drawn();
            let ((along, x_axis), (across, y_axis)) = (x.drawn(), y.drawn());
            figure.with(if rows == 1 {
                let points = along.into_iter().zip(scaled);
                Panel::new(x_axis, scale).with(Markers::new(points).colour(Colour::BLUE))
            } else {
                let edges = |at: Vec<f64>| {
                    let [first, last] = [at.first(), at.last()].map(|end| *end.unwrap_or(&0.0));
                    let half = 0.5 * (last - first) / (at.len() - 1).max(1) as f64;
                    (first - half, last + half)
                };
                let map = Heatmap::new(columns, rows, scaled, edges(along), edges(across), scale);
                Panel::new(x_axis.tight(), y_axis.tight()).with(map)
            })
        })
    }
}

/// Each measured quantity with the fit and the other stable orbits, and below it the residuals in
/// standard errors.
pub fn fit_figure(report: &FitReport) -> Figure {
    let across = report.columns.len().clamp(1, ACROSS);
    let blocks = report.columns.len().div_ceil(across).max(1);
    let heights = (0..blocks).flat_map(|_| [2.2, 1.0]);
    let mut figure = Figure::new(2 * blocks, across)
        .width(DOUBLE_COLUMN)
        .height(88.0 * blocks as f64)
        .row_heights(heights)
        .share_x();
    for block in report.columns.chunks(across) {
        for (index, column) in block.iter().enumerate() {
            let first = index == 0 && std::ptr::eq(block, &raw const report.columns[..across]);
            let legend = if first { Legend::Above } else { Legend::Hidden };
            figure = figure.with(readings(report, column).legend(legend));
        }
        for _ in block.len()..across {
            figure = figure.with(Panel::new(Axis::linear(""), Axis::linear("")));
        }
        for column in block {
            figure = figure.with(residuals(report, column));
        }
        for _ in block.len()..across {
            figure = figure.with(Panel::new(Axis::linear(""), Axis::linear("")));
        }
    }
    figure
}

/// The axis of the swept quantity, and the factor of its values.
fn swept(report: &FitReport) -> (Axis, f64) {
    let key = Key::all().find(|key| key.path() == report.swept);
    let size = report.rows.iter().map(|r| r.at.abs()).fold(0.0, f64::max);
    let symbol = key.map_or_else(|| report.swept.clone(), Key::label);
    let kind = key.filter(|key| key.is_physical()).map(Key::kind);
    si_axis(symbol, kind.unwrap_or(Kind::Number), size)
}

/// Rows in one colour: name, colour and indices.
fn groups(report: &FitReport) -> Vec<(String, Colour, Vec<&FittedRow>)> {
    let mut names: Vec<(String, Option<Way>)> = Vec::new();
    for row in &report.rows {
        let name = (row.curve.clone(), row.way);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let one_curve = names.iter().all(|(curve, _)| *curve == names[0].0);
    let named = |(index, (curve, way)): (usize, &(String, Option<Way>))| {
        let name = match way {
            Some(way) if one_curve => way.name().to_owned(),
            Some(way) => format!("{curve}, {}", way.name()),
            None if one_curve => "data".to_owned(),
            None => curve.clone(),
        };
        let colour = match index {
            0 => Colour::BLUE,
            1 => Colour::VERMILLION,
            more => category(more),
        };
        let of = |row: &&FittedRow| row.curve == *curve && row.way == *way;
        (name, colour, report.rows.iter().filter(of).collect())
    };
    names.iter().enumerate().map(named).collect()
}

fn readings(report: &FitReport, column: &FittedColumn) -> Panel {
    let (x, along) = swept(report);
    let shown = PlottedQuantity::named(&column.observable);
    let phase = shown.is_some_and(PlottedQuantity::is_phase);
    let physical = report
        .rows
        .iter()
        .filter_map(|r| r.readings.get(&column.name));
    let size = physical
        .filter_map(|reading| reading.measured)
        .fold(0.0, |size: f64, value| size.max(value.abs()));
    let si = |_| (column.unit != "1" && Key::find(&report.swept).is_some()).then_some(1.0);
    let modulated = Modulated::COLUMNS
        .iter()
        .find(|c| c.name == column.observable);
    let name = modulated.map_or(column.name.as_str(), |c| c.label);
    let kind = modulated.map_or_else(|| Kind::of_si_unit(&column.unit), |c| c.dimension.kind());
    let (axis, factor) = match (shown, kind) {
        (Some(shown), _) => shown.axis(true, si, size),
        (None, Some(kind)) if column.unit != "1" => si_axis(name, kind, size),
        (None, _) => (Axis::linear(name), 1.0),
    };
    let y = |value: f64| factor * if phase { shown_phase(value) } else { value };
    let points = |rows: &[&FittedRow], of: fn(&Reading) -> Option<f64>| -> Vec<(f64, f64)> {
        let point = |row: &&FittedRow| {
            let value = of(row.readings.get(&column.name)?)?;
            Some((along * row.at, y(value)))
        };
        rows.iter().filter_map(point).collect()
    };
    let mut panel = Panel::new(x, axis);
    for (index, jump) in report.jumps.iter().enumerate() {
        let fold = Rule::vertical(along * jump.fold);
        // One entry of the legend for all.
        panel = panel.with(if index == 0 {
            fold.label("folds of the fit")
        } else {
            fold
        });
    }
    let others: Vec<(f64, f64)> = report
        .others
        .iter()
        .filter_map(|other| Some((along * other.at, y(*other.readings.get(&column.name)?))))
        .collect();
    if !others.is_empty() {
        let other = Markers::new(others).colour(Colour::GREY).size(0.5);
        panel = panel.with(other.label("other stable motions"));
    }
    for (name, colour, rows) in groups(report) {
        let measured = Markers::new(points(&rows, |reading| reading.measured))
            .colour(colour)
            .open()
            .size(1.1);
        panel = panel.with(measured.label(name));
    }
    let mut lines: Vec<(f64, f64)> = Vec::new();
    for (_, _, rows) in groups(report) {
        for run in rows.chunk_by(|a, b| a.branch == b.branch) {
            lines.extend(points(run, |reading| reading.model));
            lines.push((f64::NAN, f64::NAN));
        }
    }
    panel.with(
        Line::new(lines)
            .colour(Colour::BLACK)
            .width(0.8)
            .label("fit"),
    )
}

fn residuals(report: &FitReport, column: &FittedColumn) -> Panel {
    let (x, along) = swept(report);
    let mut panel = Panel::new(x, Axis::linear("residual / $σ$"))
        .legend(Legend::Hidden)
        .with(Rule::horizontal(0.0));
    for (_, colour, rows) in groups(report) {
        let point = |row: &&FittedRow| {
            let residual = row.readings.get(&column.name)?.residual?;
            Some((along * row.at, residual))
        };
        let points: Vec<(f64, f64)> = rows.iter().filter_map(point).collect();
        panel = panel.with(Markers::new(points).colour(colour).open().size(0.9));
    }
    panel
}
