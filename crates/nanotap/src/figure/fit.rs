//! Measured curves, what the fitted model says, and the residuals as a picture.

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Figure, Legend, Line, Markers, Panel, Rule, category,
};

use crate::case::Key;
use crate::case::physical::Kind;
use crate::case::units::prefixed;
use crate::figure::shown::Shown;
use crate::observe::table::shown_phase;
use crate::study::approach::Way;
use crate::study::fit::{FitReport, FittedColumn, FittedRow, Reading};
use crate::study::frequency_modulation::COLUMNS;

/// Panels side by side.
const ACROSS: usize = 3;

/// Each measured quantity with the fit through it and the orbits that the data are not on, and
/// beneath it the residuals in standard errors.
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

/// The axis of what was swept, and what its values are to be multiplied with.
fn swept(report: &FitReport) -> (Axis, f64) {
    let key = Key::all().find(|key| key.path() == report.swept);
    let size = report.rows.iter().map(|r| r.at.abs()).fold(0.0, f64::max);
    let symbol = key.map_or_else(|| report.swept.clone(), Key::label);
    match key.filter(|key| key.is_physical()).map(Key::kind) {
        Some(kind) if kind != Kind::Number => {
            let (factor, unit) = prefixed(kind, 1.0, size);
            (Axis::linear(format!("{symbol} ({unit})")), factor)
        }
        _ => (Axis::linear(symbol), 1.0),
    }
}

/// Rows that are drawn alike: their name, colour, and which they are.
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
    let shown = Shown::named(&column.observable);
    let phase = shown.is_some_and(Shown::is_phase);
    let physical = report
        .rows
        .iter()
        .filter_map(|r| r.readings.get(&column.name));
    let size = physical
        .filter_map(|reading| reading.measured)
        .fold(0.0, |size: f64, value| size.max(value.abs()));
    let si = |_| (column.unit != "1" && Key::find(&report.swept).is_some()).then_some(1.0);
    let modulated = COLUMNS.iter().find(|c| c.name == column.observable);
    let (label, factor) = match (shown, modulated.map(|c| (c.label, c.kind))) {
        (Some(shown), _) => shown.axis(true, si, size),
        (None, Some((label, Some(kind)))) if column.unit != "1" => {
            let (factor, unit) = prefixed(kind, 1.0, size);
            (format!("{label} ({unit})"), factor)
        }
        (None, Some((label, _))) => (label.to_owned(), 1.0),
        (None, None) => (column.name.clone(), 1.0),
    };
    let y = |value: f64| factor * if phase { shown_phase(value) } else { value };
    let points = |rows: &[&FittedRow], of: fn(&Reading) -> Option<f64>| -> Vec<(f64, f64)> {
        let point = |row: &&FittedRow| {
            let value = of(row.readings.get(&column.name)?)?;
            Some((along * row.at, y(value)))
        };
        rows.iter().filter_map(point).collect()
    };
    let mut panel = Panel::new(x, Axis::linear(label));
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
