//! The figure of a force curve: force against separation, deflection against distance.

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Dash, Figure, Legend, Line, Markers, Panel, Rule,
};

use crate::force_curve::{CurvePoint, ForceCurveReport, StaticPoint};
use nanotap_motions::approach::Way;

/// The coordinates of a point of the curve and of a rest.
type Coordinates = (
    fn(&CurvePoint) -> (f64, f64),
    fn(&StaticPoint) -> (f64, f64),
);

const FORCE: Coordinates = (
    |p| (1e9 * p.separation, 1e9 * p.force),
    |p| (1e9 * p.separation, 1e9 * p.force),
);
const DEFLECTION: Coordinates = (
    |p| (1e9 * p.distance, 1e9 * p.deflection),
    |p| (1e9 * p.distance, 1e9 * p.deflection),
);

/// Approach and retract with the branches of the lever at rest, stable and unstable, and the ends
/// from which it jumps: force against separation, and deflection against distance. Those of a driven
/// lever are means over drive periods.
pub fn force_curve_figure(report: &ForceCurveReport) -> Figure {
    let mean = if report.driven { "mean " } else { "" };
    let [separation, force, deflection] = ["separation $d$ (nm)", "force (nN)", "deflection (nm)"]
        .map(|label| format!("{mean}{label}"));
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(80.0)
        .with(panel(report, FORCE, &separation, &force).legend(Legend::Above))
        .with(panel(report, DEFLECTION, "distance $z$ (nm)", &deflection).legend(Legend::Hidden))
}

fn panel(report: &ForceCurveReport, (of, rest): Coordinates, x: &str, y: &str) -> Panel {
    let mut panel = Panel::new(Axis::linear(x), Axis::linear(y)).with(Rule::horizontal(0.0));
    for stable in [true, false] {
        let branches = report.statics.branches.iter();
        for (k, branch) in branches.filter(|b| b.stable == stable).enumerate() {
            let line = Line::new(branch.points.iter().map(rest))
                .colour(Colour::GREY)
                .width(2.0)
                .dash(if stable { Dash::Solid } else { Dash::Dotted });
            panel = panel.with(match (k, stable) {
                (0, true) => line.label("at rest"),
                (0, false) => line.label("at rest, unstable"),
                _ => line,
            });
        }
    }
    let ways = [
        (Way::Approach, Colour::BLUE),
        (Way::Retract, Colour::VERMILLION),
    ];
    for (way, colour) in ways {
        let points = report.points.iter().filter(|point| point.way == way);
        panel = panel.with(Line::new(points.map(of)).colour(colour).label(way.name()));
    }
    let ends = report.statics.jumps.iter().map(|jump| rest(&jump.before));
    let ends: Vec<(f64, f64)> = ends.collect();
    if !ends.is_empty() {
        panel = panel.with(
            Markers::new(ends)
                .colour(Colour::BLACK)
                .open()
                .label("jump at rest"),
        );
    }
    panel
}
