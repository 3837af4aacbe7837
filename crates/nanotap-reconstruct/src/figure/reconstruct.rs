//! Reconstructed force and dissipation against distance.

use std::ops::Range;

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Dash, Figure, Legend, Line, Markers, Panel, Rule, SINGLE_COLUMN,
};

use crate::reconstruct::{ForceCurve, ReconstructReport};
use nanotap_case::physical::Kind;
use nanotap_case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use nanotap_motions::approach::Way;
use nanotap_motions::figure::panels::{largest_of, si_axis};

/// Half length of a bar in standard errors.
const STANDARD_ERRORS: f64 = 2.0;

/// Force with bars of two standard errors, and, if it was measured, the dissipated energy of each row
/// against its closest approach.
pub fn reconstruct_figure(report: &ReconstructReport) -> Figure {
    if report.table.dissipation.iter().all(Option::is_none) {
        let figure = Figure::new(1, 1).width(SINGLE_COLUMN).height(72.0);
        return figure.with(force_panel(report));
    }
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(72.0)
        .with(force_panel(report))
        .with(dissipation_panel(report))
}

/// The axis of these values, and their factor.
fn axis_of(report: &ReconstructReport, label: &str, kind: Kind, values: &[f64]) -> (Axis, f64) {
    let kind = if report.physical { kind } else { Kind::Number };
    si_axis(label, kind, largest_of(values.iter().copied()))
}

/// The rows of the table that are drawn: from the closest approach of a row of the data on.
fn shown(report: &ReconstructReport) -> Range<usize> {
    let closest = report.rows.iter().map(|row| row.closest);
    let closest = closest.fold(f64::INFINITY, f64::min);
    let end = report.shown_rows();
    let nodes = &report.table.distance[..end];
    let beyond = nodes.iter().take_while(|node| **node < closest).count();
    beyond.min(end - 1)..end
}

/// Axis of the distance, its factor, and the distances shown.
fn distance(report: &ReconstructReport) -> (Axis, f64, [f64; 2]) {
    let nodes = &report.table.distance[shown(report)];
    let (axis, factor) = axis_of(report, "tip–sample distance $d$", Kind::Length, nodes);
    let (low, high) = (nodes[0], nodes[nodes.len() - 1]);
    let margin = 0.15 * (high - low);
    let range = [low - margin, high + margin];
    (
        axis.range(factor * range[0], factor * range[1]),
        factor,
        range,
    )
}

/// Vertical bars of two standard errors.
fn bars(curve: &ForceCurve, range: [f64; 2], along: f64, factor: f64) -> Vec<(f64, f64)> {
    let rows = curve
        .distance
        .iter()
        .zip(&curve.force)
        .zip(&curve.force_error);
    let shown = rows.filter(|((x, _), _)| (range[0]..=range[1]).contains(*x));
    shown
        .flat_map(|((x, force), error)| {
            let half = STANDARD_ERRORS * error;
            let end = |side: f64| (along * x, factor * (force + side * half));
            [end(-1.0), end(1.0), (f64::NAN, f64::NAN)]
        })
        .collect()
}

fn force_panel(report: &ReconstructReport) -> Panel {
    let (axis, along, range) = distance(report);
    let inside = |x: f64| (range[0]..=range[1]).contains(&x);
    let curve = &report.table;
    let shown = &curve.force[shown(report)];
    let (y, factor) = axis_of(report, "force on the tip", Kind::Force, shown);
    let mut panel = Panel::new(axis, y)
        .legend(Legend::Above)
        .with(Rule::horizontal(0.0));
    let bars = Line::new(bars(curve, range, along, factor)).colour(Colour::GREY);
    panel = panel.with(bars.width(0.6).label("two standard errors"));
    let line = |x: &[f64], y: &[f64]| {
        let points = x.iter().zip(y).filter(|(x, _)| inside(**x));
        Line::new(
            points
                .map(|(x, y)| (along * x, factor * y))
                .collect::<Vec<_>>(),
        )
    };
    if let Some(plain) = &report.sader_jarvis {
        let formula = line(&plain.distance, &plain.force).colour(Colour::VERMILLION);
        panel = panel.with(formula.dash(Dash::Dashed).label("Sader, Jarvis"));
    }
    for way in &report.ways {
        let colour = way_colour(Some(way.way));
        let alone = line(&way.table.distance, &way.table.force).colour(colour);
        panel = panel.with(alone.width(0.6).label(format!("{} alone", way.way.name())));
    }
    panel.with(
        line(&curve.distance, &curve.force)
            .colour(Colour::BLACK)
            .label("force"),
    )
}

const fn way_colour(way: Option<Way>) -> Colour {
    match way {
        Some(Way::Retract) => Colour::VERMILLION,
        _ => Colour::BLUE,
    }
}

fn dissipation_panel(report: &ReconstructReport) -> Panel {
    let (axis, along, range) = distance(report);
    let (factor, unit) = if report.physical {
        (1.0 / JOULES_PER_ELECTRONVOLT, "eV")
    } else {
        (1.0, "")
    };
    let y = Axis::linear("dissipation $E_{dis}$").unit(unit);
    let mut panel = Panel::new(axis, y)
        .legend(Legend::Above)
        .with(Rule::horizontal(0.0));
    for way in [Some(Way::Approach), Some(Way::Retract), None] {
        let rows = report.rows.iter().filter(|row| row.way == way);
        let rows = rows.filter(|row| (range[0]..=range[1]).contains(&row.closest));
        let rows = rows.filter_map(|row| {
            let (value, error) = row.dissipation.zip(row.dissipation_error)?;
            Some((along * row.closest, factor * value, factor * error))
        });
        let rows: Vec<_> = rows.collect();
        if rows.is_empty() {
            continue;
        }
        let bars = rows.iter().flat_map(|(x, value, error)| {
            let end = |side: f64| (*x, value + side * STANDARD_ERRORS * error);
            [end(-1.0), end(1.0), (f64::NAN, f64::NAN)]
        });
        let bars: Vec<_> = bars.collect();
        let points: Vec<_> = rows.iter().map(|(x, value, _)| (*x, *value)).collect();
        panel = panel.with(Line::new(bars).colour(Colour::GREY).width(0.6));
        let label = way.map_or("rows", Way::name);
        let markers = Markers::new(points)
            .colour(way_colour(way))
            .open()
            .size(1.0);
        panel = panel.with(markers.label(label));
    }
    panel
}
