//! Figures of branches, stable solid and unstable dashed, and of loci in two parameters.

use std::collections::BTreeSet;

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Dash, Figure, LINES, Legend, Line, Markers,
    ONE_AND_A_HALF_COLUMNS, Panel, Shape,
};

use crate::case::subject::Key;
use crate::case::units::Units;
pub use crate::figure::shown::Shown;
use crate::observe::{Observables, PhysicalMotion};
use crate::study::branch::{BranchReport, Loci, PointReport};

/// The parameter's axis: its label and what its values are multiplied with.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterAxis {
    /// The label, with its unit.
    pub label: String,
    /// The factor.
    pub factor: f64,
}

impl ParameterAxis {
    /// The parameter by its symbol, in the model's own units.
    pub fn of(key: Key) -> Self {
        let symbol = key.symbol();
        // A word is no symbol.
        let label = if symbol.chars().count() <= 2 {
            format!("${symbol}$")
        } else {
            symbol.to_owned()
        };
        Self { label, factor: 1.0 }
    }
}

pub(crate) const MARKS: [(&str, Shape, Colour); 5] = [
    ("fold", Shape::Square, Colour::BLACK),
    ("flip", Shape::Diamond, Colour::VERMILLION),
    ("neimark-sacker", Shape::Triangle, Colour::PURPLE),
    ("grazing", Shape::Circle, Colour::GREEN),
    ("crossing", Shape::Cross, Colour::BLACK),
];

/// Branches against the parameter, a colour a period, with their bifurcations; beside
/// them the loci of these in two parameters, if they were traced.
pub fn branch_figure(
    report: &BranchReport,
    shown: Shown,
    beam: bool,
    axes: &[ParameterAxis; 2],
    units: &Units,
) -> Figure {
    let branches = branches_panel(report, shown, beam, &axes[0], units);
    match &report.loci {
        None => Figure::single(branches)
            .width(ONE_AND_A_HALF_COLUMNS)
            .height(88.0),
        Some(loci) => Figure::new(1, 2)
            .width(DOUBLE_COLUMN)
            .height(88.0)
            .with(branches)
            .with(loci_panel(report, loci, axes)),
    }
}

fn branches_panel(
    report: &BranchReport,
    shown: Shown,
    beam: bool,
    axis: &ParameterAxis,
    units: &Units,
) -> Panel {
    // Where physical quantities vary, the model's units may vary with them: SI then.
    let si = report.points.iter().any(|p| p.physical.is_some());
    let of = |model: &Observables, physical: Option<&PhysicalMotion>, multipliers: &[[f64; 2]]| {
        shown.of(physical.map_or(model, |p| &p.observables), multipliers)
    };
    let value = |p: &PointReport| of(&p.observables, p.physical.as_ref(), &p.multipliers);
    let size = report
        .points
        .iter()
        .map(|p| value(p).abs())
        .fold(0.0, f64::max);
    let (label, factor) = shown.axis(
        beam,
        |kind| if si { Some(1.0) } else { units.si(kind) },
        size,
    );
    let periods: BTreeSet<usize> = report.points.iter().map(|p| p.period).collect();
    let mut panel = Panel::new(
        Axis::linear(axis.label.clone()).tight(),
        Axis::linear(label),
    )
    .legend(Legend::Above);
    for (k, period) in periods.iter().enumerate() {
        let mut named = false;
        for branch in 0..report.branches.len() {
            let points: Vec<&PointReport> = report
                .points
                .iter()
                .filter(|p| p.branch == branch && p.period == *period)
                .collect();
            for (stable, run) in runs(&points) {
                let curve = run
                    .iter()
                    .map(|p| (axis.factor * p.parameter, factor * value(p)));
                let mut line = Line::new(curve).colour(LINES[k % LINES.len()]);
                if !stable {
                    line = line.dash(Dash::Dashed).width(0.6);
                } else if !named {
                    line = line.label(format!("period {period}"));
                    named = true;
                }
                panel = panel.with(line);
            }
        }
    }
    if report.points.iter().any(|p| !p.stable) {
        // Only for the legend.
        let nowhere = Line::new([(f64::NAN, f64::NAN)])
            .colour(Colour::GREY)
            .dash(Dash::Dashed)
            .width(0.6);
        panel = panel.with(nowhere.label("unstable"));
    }
    // Where there are many, each is to hide little.
    let size = if report.bifurcations.len() > 12 {
        1.1
    } else {
        1.6
    };
    for (kind, shape, colour) in MARKS {
        let marks: Vec<(f64, f64)> = report
            .bifurcations
            .iter()
            .filter(|b| b.kind == kind)
            .map(|b| {
                (
                    axis.factor * b.parameter,
                    factor * of(&b.observables, b.physical.as_ref(), &b.multipliers),
                )
            })
            .collect();
        if !marks.is_empty() {
            panel = panel.with(
                Markers::new(marks)
                    .shape(shape)
                    .colour(colour)
                    .open()
                    .size(if kind == "grazing" { 0.7 * size } else { size })
                    .label(word(kind)),
            );
        }
    }
    panel
}

/// Stretches of one stability, each beginning where the last one ended.
pub(crate) fn runs<'a>(points: &[&'a PointReport]) -> Vec<(bool, Vec<&'a PointReport>)> {
    let mut runs: Vec<(bool, Vec<&'a PointReport>)> = Vec::new();
    for &p in points {
        match runs.last_mut() {
            Some((stable, run)) if *stable == p.stable => run.push(p),
            other => {
                let joint = other.and_then(|(_, run)| run.last().copied());
                runs.push((p.stable, joint.into_iter().chain([p]).collect()));
            }
        }
    }
    runs
}

pub(crate) fn word(kind: &str) -> &'static str {
    match kind {
        "fold" => "fold",
        "flip" => "period doubling",
        "neimark-sacker" => "Neimark–Sacker",
        "grazing" => "grazing",
        _ => "crossing",
    }
}

/// Loci in the plane of two parameters.
fn loci_panel(report: &BranchReport, loci: &Loci, axes: &[ParameterAxis; 2]) -> Panel {
    let [first, second] = axes;
    let mut panel = Panel::new(
        Axis::linear(first.label.clone()).range(
            first.factor * report.from.min(report.to),
            first.factor * report.from.max(report.to),
        ),
        Axis::linear(second.label.clone())
            .range(second.factor * loci.range[0], second.factor * loci.range[1]),
    )
    .legend(Legend::Above);
    let mut named: BTreeSet<(&str, usize)> = BTreeSet::new();
    for curve in &loci.curves {
        let (_, _, colour) = MARKS
            .iter()
            .copied()
            .find(|m| m.0 == curve.kind)
            .unwrap_or(MARKS[0]);
        let points = curve
            .first
            .iter()
            .zip(&curve.second)
            .map(|(x, y)| (first.factor * x, second.factor * y));
        let mut line = Line::new(points).colour(colour);
        if curve.period > 1 {
            line = line.dash(if curve.period == 2 {
                Dash::Dashed
            } else {
                Dash::Dotted
            });
        }
        if named.insert((curve.kind, curve.period)) {
            line = line.label(format!("{}, period {}", word(curve.kind), curve.period));
        }
        panel = panel.with(line);
    }
    panel
}
