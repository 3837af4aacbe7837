//! Approach and retract curves as a picture.

use std::collections::BTreeSet;

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Dash, Figure, Legend, Line, Markers, Panel, Range, Scale, Shape,
};
use serde::Deserialize;

use crate::approach::{ApproachReport, Way};
use crate::branch::BifurcationReport;
use crate::figure::branch::{
    BranchMark, BranchPoint, PlottedQuantity, natural_of, runs, scale_of, with_corners, with_marks,
};
use crate::frequency_modulation::Modulated;
use nanotap_case::physical::Kind;
use nanotap_case::units::Units;
use nanotap_observe::Observables;
use nanotap_observe::frame::{Declared, Row as _};

/// Amplitude, phase, dissipation and peak force against the distance; under frequency modulation the
/// frequency shift, drive, dissipation and the force by Sader and Jarvis. Motions on approach and
/// retract are marks in two colours, coexisting ones in a third; branches are lines, dashed where
/// unstable, with their bifurcations.
pub fn approach_figure(report: &ApproachReport, units: &Units) -> Figure {
    const SHOWN: [&str; 4] = ["first_harmonic", "phase", "dissipation", "peak_force"];
    let (x_factor, x_unit) = units.axis(Kind::Length, report.from.abs().max(report.to.abs()));
    // At a constant least distance the amplitude grows with the distance.
    let kept = report.modulation.as_ref().and_then(|m| {
        let closest = m.closest?;
        Some((closest, m.amplitude / (report.from - closest)))
    });
    let symbol = if kept.is_some() {
        "amplitude $A$"
    } else if matches!(units, Units::Si(_)) {
        "distance $z_c$"
    } else if report.parameter == "gap" {
        "gap"
    } else {
        "distance $α₅$"
    };
    // Amplitude and phase are constant: frequency shift and drive are drawn instead.
    let modulated = report.modulation.is_some();
    let of_drive = |names: &[&str]| -> Vec<ApproachPanel> {
        let columns = Modulated::COLUMNS
            .iter()
            .filter(|c| modulated && names.contains(&c.name));
        let panel = |column| ApproachPanel::of_drive(report, column, units, x_factor);
        columns.map(panel).collect()
    };
    let shown = SHOWN.into_iter();
    let shown = shown.filter(|name| !modulated || *name == "dissipation");
    let panels = of_drive(&["frequency_shift", "drive_ratio"])
        .into_iter()
        .chain(
            shown
                .filter_map(PlottedQuantity::named)
                .map(|shown| ApproachPanel::of(report, shown, units, x_factor)),
        )
        .chain(of_drive(&["sader_jarvis_force"]));
    let mut curves = ApproachCurves {
        x: Axis::linear(symbol)
            .unit(x_unit)
            .range(x_factor * report.to, x_factor * report.from),
        panels: panels.collect(),
    };
    if let Some((closest, share)) = kept {
        curves.against(|x| share * (x - x_factor * closest));
    }
    curves.figure()
}

/// Curves of approach and retract in the units of the figure.
#[derive(Clone, Debug, Deserialize)]
pub struct ApproachCurves {
    /// Axis of the distance, or of the amplitude at a constant least distance.
    pub x: Axis,
    /// Panels, one for each quantity.
    pub panels: Vec<ApproachPanel>,
}

/// One quantity against the distance.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct ApproachPanel {
    /// Axis of the quantity.
    pub y: Axis,
    /// Whether the quantity is a phase, in degrees.
    pub phase: bool,
    /// Motions on the approach: distance and quantity, in the units of the axes.
    pub approach: Vec<(f64, f64)>,
    /// Motions on the retract: distance and quantity, in the units of the axes.
    pub retract: Vec<(f64, f64)>,
    /// Coexisting motions that neither approach nor retract reached: distance and quantity.
    pub coexisting: Vec<(f64, f64)>,
    /// Curve for comparison, drawn as a line: distance and quantity.
    pub compared: Vec<(f64, f64)>,
    /// Legend of the curve for comparison; empty without one.
    pub comparison: String,
    /// Orbits of branches along the distance.
    pub branches: Vec<BranchPoint>,
    /// Bifurcations of the branches.
    pub bifurcations: Vec<BranchMark>,
}

impl ApproachCurves {
    /// Replaces the distance by the amplitude `other(distance)` and removes panels without points.
    fn against(&mut self, other: impl Fn(f64) -> f64) {
        if let Range::Fixed(from, to) = self.x.range {
            self.x = self.x.clone().range(other(from), other(to));
        }
        self.x.scale = Scale::Log;
        self.panels.retain(|panel| !panel.approach.is_empty());
        for panel in &mut self.panels {
            let curves = [&mut panel.approach, &mut panel.retract, &mut panel.compared];
            for (x, _) in curves.into_iter().flatten() {
                *x = other(*x);
            }
        }
    }

    /// Returns the figure with its panels in two columns.
    pub fn figure(&self) -> Figure {
        let rows = self.panels.len().div_ceil(2).max(1);
        let mut figure = Figure::new(rows, 2)
            .width(DOUBLE_COLUMN)
            .height(65.0 * rows as f64)
            .share_x();
        for (k, one) in self.panels.iter().enumerate() {
            let panel = one.panel(self.x.clone());
            // One legend is enough.
            figure = figure.with(if k == 0 || !one.comparison.is_empty() {
                panel.legend(Legend::Above)
            } else {
                panel.legend(Legend::Hidden)
            });
        }
        figure
    }
}

/// An approximation is drawn up to this multiple of the largest computed value.
const BEYOND: f64 = 1.2;

impl ApproachPanel {
    /// A column of frequency modulation; the frequency shift with the first-order one as a line.
    fn of_drive(
        report: &ApproachReport,
        column: &Declared<Modulated>,
        units: &Units,
        x_factor: f64,
    ) -> Self {
        let values = |way: Way, of: &dyn Fn(&Modulated) -> Option<f64>| -> Vec<(f64, f64)> {
            let met = report.table.iter().filter(|p| p.way == way);
            met.filter_map(|p| Some((x_factor * p.gap, of(p.modulation.as_ref()?)?)))
                .collect()
        };
        let [approach, retract] =
            [Way::Approach, Way::Retract].map(|way| values(way, &|m| column.number(m)));
        let met = approach.iter().chain(&retract);
        let size = met.fold(0.0, |m: f64, (_, y)| m.max(y.abs()));
        let (factor, unit) = match column.dimension.kind() {
            Some(kind) => units.axis(kind, size),
            None => (1.0, String::new()),
        };
        let scaled = |points: Vec<(f64, f64)>| -> Vec<(f64, f64)> {
            points.into_iter().map(|(x, y)| (x, factor * y)).collect()
        };
        let free = report.modulation.as_ref();
        let free = free.map_or(f64::NAN, |m| m.free_frequency);
        let near = |value: &f64| value.abs() <= BEYOND * size;
        let first = |m: &Modulated| Some(free * m.first_order_shift?).filter(near);
        let law = |m: &Modulated| m.static_force.filter(near);
        let (compared, comparison) = match column.name {
            "frequency_shift" => (values(Way::Approach, &first), "first order"),
            "sader_jarvis_force" => (values(Way::Approach, &law), "the law's force"),
            _ => (Vec::new(), ""),
        };
        Self {
            y: Axis::linear(column.label).unit(unit),
            approach: scaled(approach),
            retract: scaled(retract),
            compared: scaled(compared),
            comparison: comparison.to_owned(),
            ..Self::default()
        }
    }

    fn of(report: &ApproachReport, shown: PlottedQuantity, units: &Units, x_factor: f64) -> Self {
        let of = |shown: PlottedQuantity, observables: &Observables| shown.of(observables, &[]);
        let met = report.table.iter().filter_map(|p| p.observables.as_ref());
        let points = || report.branches.iter().flat_map(|b| &b.points);
        let largest = |f: &dyn Fn(&Observables) -> f64| {
            met.clone()
                .chain(points().map(|p| &p.observables))
                .map(|observables| f(observables).abs())
                .fold(0.0, f64::max)
        };
        let size = |shown: PlottedQuantity| largest(&|observables| of(shown, observables));
        let natural = natural_of(shown, size);
        let (y, factor) = shown.axis(true, |kind| units.si(kind), scale_of(size(shown), natural));
        let place =
            |gap: f64, observables: &Observables| (x_factor * gap, factor * of(shown, observables));
        let way = |way: Way| {
            let met = report.table.iter().chain(&report.coexisting);
            // The ends of a jump belong to the curve.
            let jumps = report.jumps.iter().flat_map(|j| [&j.before, &j.after]);
            let on = met.chain(jumps).filter(|p| p.way == way);
            on.filter_map(|p| Some(place(p.gap, p.observables.as_ref()?)))
                .collect()
        };
        let bifurcations = report.branches.as_ref();
        let bifurcations = bifurcations.map_or(&[][..], |b| &b.bifurcations);
        let mark = |b: &BifurcationReport| place(b.parameter, &b.observables);
        let orbits = points().map(|p| {
            let (x, y) = place(p.parameter, &p.observables);
            BranchPoint {
                branch: p.branch,
                period: p.period,
                stable: p.stable,
                x,
                y,
            }
        });
        Self {
            y: y.natural(natural.map(|size| factor * size)),
            phase: shown.is_phase(),
            approach: way(Way::Approach),
            retract: way(Way::Retract),
            coexisting: way(Way::Neither),
            branches: with_corners(orbits.collect(), bifurcations, mark),
            compared: Vec::new(),
            comparison: String::new(),
            bifurcations: bifurcations
                .iter()
                .map(|b| {
                    let (x, y) = mark(b);
                    BranchMark {
                        kind: b.kind.to_owned(),
                        x,
                        y,
                    }
                })
                .collect(),
        }
    }

    fn panel(&self, x: Axis) -> Panel {
        let mut panel = Panel::new(x, self.y.clone());
        let grey = |points: Vec<(f64, f64)>| Line::new(points).colour(Colour::GREY).width(0.7);
        let branches: BTreeSet<usize> = self.branches.iter().map(|p| p.branch).collect();
        for branch in branches {
            let curve: Vec<&BranchPoint> = self
                .branches
                .iter()
                .filter(|p| p.branch == branch)
                .collect();
            for (stable, run) in runs(&curve, |p| p.stable) {
                let line = grey(unwrapped(self.phase, run.iter().map(|p| (p.x, p.y))));
                panel = panel.with(if stable {
                    line
                } else {
                    line.dash(Dash::Dashed)
                });
            }
        }
        let nowhere = || grey(vec![(f64::NAN, f64::NAN)]);
        if self.branches.iter().any(|p| p.stable) {
            panel = panel.with(nowhere().label("stable"));
        }
        if self.branches.iter().any(|p| !p.stable) {
            panel = panel.with(nowhere().dash(Dash::Dashed).label("unstable"));
        }
        if !self.compared.is_empty() {
            panel = panel.with(grey(self.compared.clone()).label(&self.comparison));
        }
        let ways = [
            (&self.approach, Colour::BLUE, 1.3, Way::Approach),
            (&self.retract, Colour::VERMILLION, 0.8, Way::Retract),
        ];
        for (met, colour, size, way) in ways {
            let markers = Markers::new(met.clone()).colour(colour).size(size);
            panel = panel.with(markers.label(way.name()));
        }
        if !self.coexisting.is_empty() {
            let markers = Markers::new(self.coexisting.clone());
            // Another shape, since blue and green are alike to some.
            let markers = markers
                .colour(Colour::GREEN)
                .shape(Shape::Triangle)
                .size(1.1);
            panel = panel.with(markers.label("coexists"));
        }
        with_marks(panel, &self.bifurcations, [1.8, 1.0], 1.0)
    }
}

/// A curve; a phase is interrupted where it wraps around.
fn unwrapped(phase: bool, curve: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (x, y) in curve {
        if phase && points.last().is_some_and(|last| (last.1 - y).abs() > 180.0) {
            points.push((f64::NAN, f64::NAN));
        }
        points.push((x, y));
    }
    points
}
