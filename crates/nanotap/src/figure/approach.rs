//! Approach and retract curves as a picture.

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Dash, Figure, Legend, Line, Markers, Panel, Shape,
};

use crate::case::physical::Kind;
use crate::case::units::Units;
use crate::figure::branch::{MARKS, Shown, runs, word};
use crate::observe::Observables;
use crate::study::approach::{ApproachReport, Way};
use crate::study::branch::PointReport;

/// Amplitude, phase, dissipation and greatest force against the distance: what was met on the
/// way there and back as marks in two colours, the branches as lines, dashed where unstable,
/// with their bifurcations.
pub fn approach_figure(report: &ApproachReport, units: &Units) -> Figure {
    const SHOWN: [&str; 4] = ["first_harmonic", "phase", "dissipation", "peak_force"];
    SHOWN
        .into_iter()
        .filter_map(Shown::named)
        .enumerate()
        .fold(
            Figure::new(2, 2).width(DOUBLE_COLUMN).height(130.0),
            |figure, (k, shown)| {
                let panel = panel(report, shown, units);
                // One legend is enough.
                figure.with(if k == 0 {
                    panel.legend(Legend::Above)
                } else {
                    panel.legend(Legend::Hidden)
                })
            },
        )
        .share_x()
}

fn panel(report: &ApproachReport, shown: Shown, units: &Units) -> Panel {
    let value = |observables: &Observables| shown.of(observables, &[]);
    let met = || report.table.iter().filter_map(|p| p.observables.as_ref());
    let points = || report.branches.iter().flat_map(|b| &b.points);
    let size = met()
        .chain(points().map(|p| &p.observables))
        .map(|observables| value(observables).abs())
        .fold(0.0, f64::max);
    let (label, factor) = shown.axis(true, |kind| units.si(kind), size);
    let (x_factor, x_unit) = units.axis(Kind::Length, report.from.abs().max(report.to.abs()));
    let symbol = if matches!(units, Units::Si(_)) {
        "distance $z_c$"
    } else if report.parameter == "gap" {
        "gap"
    } else {
        "distance $α₅$"
    };
    let mut panel = Panel::new(
        Axis::linear(format!("{symbol}{x_unit}"))
            .range(x_factor * report.to, x_factor * report.from),
        Axis::linear(label),
    );
    let place = |gap: f64, value: f64| (x_factor * gap, factor * value);
    for branch in report.branches.iter().flat_map(|b| 0..b.branches.len()) {
        let curve: Vec<&PointReport> = points().filter(|p| p.branch == branch).collect();
        for (stable, run) in runs(&curve) {
            let line = Line::new(
                unwrapped(
                    shown,
                    run.iter().map(|p| (p.parameter, value(&p.observables))),
                )
                .into_iter()
                .map(|(gap, value)| place(gap, value)),
            )
            .colour(Colour::GREY)
            .width(0.7);
            panel = panel.with(if stable {
                line
            } else {
                line.dash(Dash::Dashed)
            });
        }
    }
    if points().any(|p| !p.stable) {
        let nowhere = Line::new([(f64::NAN, f64::NAN)])
            .colour(Colour::GREY)
            .dash(Dash::Dashed)
            .width(0.7);
        panel = panel.with(nowhere.label("unstable"));
    }
    let ways = [
        (Way::Approach, Colour::BLUE, Shape::Circle, 1.3),
        (Way::Retract, Colour::VERMILLION, Shape::Circle, 0.8),
    ];
    for (way, colour, shape, diameter) in ways {
        let marks: Vec<(f64, f64)> = report
            .table
            .iter()
            .filter(|p| p.way == way)
            .filter_map(|p| Some(place(p.gap, value(p.observables.as_ref()?))))
            .collect();
        panel = panel.with(
            Markers::new(marks)
                .shape(shape)
                .colour(colour)
                .size(diameter)
                .label(way.name()),
        );
    }
    let bifurcations = report.branches.iter().flat_map(|b| &b.bifurcations);
    // Where there are many, each is to hide little.
    let size = if bifurcations.clone().count() > 12 {
        1.0
    } else {
        1.8
    };
    for (kind, shape, colour) in MARKS {
        let marks: Vec<(f64, f64)> = bifurcations
            .clone()
            .filter(|b| b.kind == kind)
            .map(|b| place(b.parameter, value(&b.observables)))
            .collect();
        if !marks.is_empty() {
            panel = panel.with(
                Markers::new(marks)
                    .shape(shape)
                    .colour(colour)
                    .open()
                    .size(size)
                    .label(word(kind)),
            );
        }
    }
    panel
}

/// A curve; of a phase broken where it comes round.
fn unwrapped(shown: Shown, curve: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (x, y) in curve {
        if shown.is_phase() && points.last().is_some_and(|last| (last.1 - y).abs() > 180.0) {
            points.push((f64::NAN, f64::NAN));
        }
        points.push((x, y));
    }
    points
}
