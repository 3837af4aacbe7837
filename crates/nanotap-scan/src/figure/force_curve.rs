//! The figure of a force curve: force against separation, deflection against distance.

use nanotap_case::physical::Kind;
use nanotap_figures::{Colour, DOUBLE_COLUMN, Dash, Figure, Legend, Line, Markers, Panel, Rule};

use crate::force_curve::{CurvePoint, ForceCurveReport, StaticPoint};
use nanotap_motions::approach::Way;
use nanotap_motions::figure::panels::{largest_of, si_axis};

/// The coordinates of a point of the curve and of a rest, in SI.
type Coordinates = (
    fn(&CurvePoint) -> (f64, f64),
    fn(&StaticPoint) -> (f64, f64),
);

const FORCE: Coordinates = (|p| (p.separation, p.force), |p| (p.separation, p.force));
const DEFLECTION: Coordinates = (
    |p| (p.distance, p.deflection),
    |p| (p.distance, p.deflection),
);

/// Approach and retract with the branches of the lever at rest, stable and unstable, and the ends
/// from which it jumps: force against separation, and deflection against distance. Those of a driven
/// lever are means over drive periods.
pub fn force_curve_figure(report: &ForceCurveReport) -> Figure {
    let mean = if report.driven { "mean " } else { "" };
    let [separation, force, deflection] =
        ["separation $d$", "force", "deflection"].map(|label| format!("{mean}{label}"));
    let forces = [
        (separation.as_str(), Kind::Length),
        (force.as_str(), Kind::Force),
    ];
    let deflections = [
        ("distance $z$", Kind::Length),
        (deflection.as_str(), Kind::Length),
    ];
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(80.0)
        .with(panel(report, FORCE, forces).legend(Legend::Above))
        .with(panel(report, DEFLECTION, deflections).legend(Legend::Hidden))
}

fn panel(
    report: &ForceCurveReport,
    (of, rest): Coordinates,
    [(x, of_x), (y, of_y)]: [(&str, Kind); 2],
) -> Panel {
    let branches = || report.statics.branches.iter().flat_map(|b| &b.points);
    let all = || report.points.iter().map(of).chain(branches().map(rest));
    let (x, along) = si_axis(x, of_x, largest_of(all().map(|p| p.0)));
    let (y, factor) = si_axis(y, of_y, largest_of(all().map(|p| p.1)));
    let drawn = |(x, y): (f64, f64)| (along * x, factor * y);
    let mut panel = Panel::new(x, y).with(Rule::horizontal(0.0));
    for stable in [true, false] {
        let branches = report.statics.branches.iter();
        for (k, branch) in branches.filter(|b| b.stable == stable).enumerate() {
            let line = Line::new(branch.points.iter().map(|point| drawn(rest(point))))
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
        let line = Line::new(points.map(|point| drawn(of(point))));
        panel = panel.with(line.colour(colour).label(way.name()));
    }
    let jumps = report.statics.jumps.iter();
    let ends: Vec<(f64, f64)> = jumps.map(|jump| drawn(rest(&jump.before))).collect();
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
