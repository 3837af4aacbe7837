//! Figures of all attractors together, and of a Poincaré section.

use nanotap_figures::{
    Axis, Colour, DOUBLE_COLUMN, Figure, LINES, Legend, Line, Markers, Panel, Points, Shape,
};
use nanotap_flow::Trajectory;

use crate::case::physical::Kind;
use crate::case::units::Units;
use crate::figure::motion::portrait;
use crate::model::Model;
use crate::study::attractors::{AttractorReport, Attractors};
use crate::study::lyapunov::{LyapunovReport, Section};

/// Drive periods of a motion that does not repeat that are drawn.
const WANDERING_PERIODS: usize = 48;
/// Strobe points of such a motion.
const STROBE_POINTS: usize = 3000;
/// Attractors drawn at most: more cannot be told apart.
const MOST: usize = 8;

/// Phase portraits and strobe points of every attractor, each in its own colour, and the
/// unstable orbits found as open markers.
pub fn attractors_figure(model: &Model, found: &Attractors, units: &Units) -> Figure {
    let tips = found.attractors.iter().filter_map(|a| {
        let o = a
            .orbit
            .as_ref()
            .map(|o| &o.observables)
            .or(a.wandering.as_ref().map(|w| &w.observables));
        o.map(|o| o.tip_max.abs().max(o.tip_min.abs()))
    });
    let (length, length_unit) = units.axis(Kind::Length, tips.fold(0.0, f64::max));
    let curves: Vec<(&AttractorReport, Curve)> = found
        .attractors
        .iter()
        .take(MOST)
        .filter_map(|a| Some((a, Curve::of(model, a)?)))
        .collect();
    let speed = curves
        .iter()
        .flat_map(|(_, c)| &c.line)
        .fold(0.0, |m: f64, p| m.max(p.1.abs()));
    let (velocity, velocity_unit) = units.axis(Kind::Velocity, speed);
    let scaled = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        points
            .iter()
            .map(|p| (length * p.0, velocity * p.1))
            .collect()
    };
    let axes = || {
        let (tip, rate) = if model.beam.is_some() {
            ("tip deflection $W$", "tip velocity $dW/dτ$")
        } else {
            ("displacement $x$", "velocity $dx/dt$")
        };
        (
            Axis::linear(format!("{tip}{length_unit}")),
            Axis::linear(format!("{rate}{velocity_unit}")),
        )
    };
    let (x, y) = axes();
    let mut portraits = Panel::new(x, y).legend(Legend::Above);
    let (x, y) = axes();
    let mut strobes = Panel::new(x, y)
        .legend(Legend::Above)
        .title("at drive phase 0");
    // The largest first, so that it hides no other.
    let mut order: Vec<usize> = (0..curves.len()).collect();
    let extent = |c: &Curve| c.line.iter().fold(0.0, |m: f64, p| m.max(p.0.abs()));
    order.sort_by(|&a, &b| extent(&curves[b].1).total_cmp(&extent(&curves[a].1)));
    for k in order {
        let (attractor, curve) = &curves[k];
        let colour = LINES[k % LINES.len()];
        let width = if attractor.orbit.is_some() { 0.9 } else { 0.25 };
        portraits = portraits.with(
            Line::new(scaled(&curve.line))
                .colour(colour)
                .width(width)
                .label(name(attractor)),
        );
        strobes = if attractor.orbit.is_some() {
            strobes.with(Markers::new(scaled(&curve.strobe)).colour(colour).size(1.6))
        } else {
            strobes.with(
                Points::new(scaled(&curve.strobe))
                    .colour(colour)
                    .diameter(0.35),
            )
        };
    }
    let unstable: Vec<(f64, f64)> = found
        .unstable
        .iter()
        .flatten()
        .flat_map(|o| o.states.iter().map(|s| at_phase_zero(model, s)))
        .collect();
    if !unstable.is_empty() {
        strobes = strobes.with(
            Markers::new(scaled(&unstable))
                .open()
                .shape(Shape::Diamond)
                .size(1.4)
                .colour(Colour::GREY)
                .label("unstable orbits"),
        );
    }
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(84.0)
        .with(portraits)
        .with(strobes)
}

/// "period 4, 37 %".
fn name(attractor: &AttractorReport) -> String {
    let what = attractor.orbit.as_ref().map_or_else(
        || attractor.classification.name().to_owned(),
        |o| format!("period {}", o.period),
    );
    format!("{what} ({:.0} %)", 100.0 * attractor.share.fraction)
}

struct Curve {
    line: Vec<(f64, f64)>,
    strobe: Vec<(f64, f64)>,
}

impl Curve {
    fn of(model: &Model, attractor: &AttractorReport) -> Option<Self> {
        if let Some(orbit) = &attractor.orbit {
            let strobe = orbit
                .states
                .iter()
                .map(|s| at_phase_zero(model, s))
                .collect();
            return Some(Self {
                line: portrait(model, &orbit.trajectory),
                strobe,
            });
        }
        let start = &attractor.wandering.as_ref()?.state;
        let trajectory = Trajectory::record(&model.system, start, WANDERING_PERIODS).ok()?;
        let section =
            crate::study::lyapunov::section(model, start, Section::Phase(0.0), STROBE_POINTS)
                .ok()?;
        let strobe = section.iter().map(|p| (p.tip, p.tip_rate)).collect();
        Some(Self {
            line: portrait(model, &trajectory),
            strobe,
        })
    }
}

fn at_phase_zero(model: &Model, state: &[f64]) -> (f64, f64) {
    let drive = model.system.drive();
    (
        model.tip.at(drive, state, 0.0),
        model.tip_rate().at(drive, state, 0.0),
    )
}

/// The Poincaré section and the exponents.
pub fn section_figure(model: &Model, report: &LyapunovReport, units: &Units) -> Figure {
    let size = |f: fn(&crate::study::lyapunov::SectionPoint) -> f64| {
        report
            .section
            .iter()
            .fold(0.0, |m: f64, p| m.max(f(p).abs()))
    };
    let diameter = if report.section.len() > 20_000 {
        0.15
    } else {
        0.3
    };
    let panel = match report.section_at {
        Section::Phase(phase) => {
            let (length, length_unit) = units.axis(Kind::Length, size(|p| p.tip));
            let (velocity, velocity_unit) = units.axis(Kind::Velocity, size(|p| p.tip_rate));
            let (tip, rate) = if model.beam.is_some() {
                ("$W$", "$dW/dτ$")
            } else {
                ("$x$", "$dx/dt$")
            };
            let title = format!("at drive phase {:.0}°", 360.0 * phase);
            Panel::new(
                Axis::linear(format!("tip deflection {tip}{length_unit}")),
                Axis::linear(format!("tip velocity {rate}{velocity_unit}")),
            )
            .title(title)
            .with(
                Points::new(
                    report
                        .section
                        .iter()
                        .map(|p| (length * p.tip, velocity * p.tip_rate)),
                )
                .diameter(diameter)
                .colour(Colour::BLUE),
            )
        }
        Section::Contact => {
            let (velocity, velocity_unit) = units.axis(Kind::Velocity, size(|p| p.gap_rate));
            Panel::new(
                Axis::linear("drive phase at contact (°)")
                    .range(0.0, 360.0)
                    .marks([0.0, 90.0, 180.0, 270.0, 360.0].map(|d| (d, format!("{d:.0}")))),
                Axis::linear(format!("speed of approach{velocity_unit}")),
            )
            .title("at the beginning of contacts")
            .with(
                Points::new(
                    report
                        .section
                        .iter()
                        .map(|p| (360.0 * p.phase, -velocity * p.gap_rate)),
                )
                .diameter(diameter)
                .colour(Colour::BLUE),
            )
        }
    };
    let exponents = report
        .exponents
        .iter()
        .enumerate()
        .map(|(k, e)| ((k + 1) as f64, *e));
    let bars = report
        .exponents
        .iter()
        .zip(&report.errors)
        .enumerate()
        .map(|(k, (e, s))| {
            Line::new([((k + 1) as f64, e - s), ((k + 1) as f64, e + s)])
                .colour(Colour::VERMILLION)
                .width(1.2)
        });
    let count = report.exponents.len();
    let every = count.div_ceil(12);
    let marks = (1..=count)
        .filter(|k| (k - 1) % every == 0)
        .map(|k| (k as f64, k.to_string()));
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(78.0)
        .column_widths([1.5, 1.0])
        .with(panel)
        .with(
            Panel::new(
                Axis::linear("number $i$")
                    .range(0.4, count as f64 + 0.6)
                    .marks(marks),
                Axis::linear("exponent $λ_i$ per drive period"),
            )
            .with(nanotap_figures::Rule::horizontal(0.0))
            .with_all(bars)
            .with(Markers::new(exponents).colour(Colour::VERMILLION)),
        )
}
