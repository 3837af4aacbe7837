//! Figures of all attractors together, and of a Poincaré section.

use nanotap_figures::Figure;

use crate::attractors::{AttractorReport, Attractors};
use crate::figure::motion::portrait;
use crate::figure::panels::{AttractorCurve, AttractorCurves, MotionAxes, SectionCurves};
use crate::lyapunov::{LyapunovReport, Section};
use nanotap_case::physical::Kind;
use nanotap_case::units::Units;
use nanotap_model::Model;
use nanotap_model::recording::Recording;

/// Drive periods that are drawn of a motion that does not repeat.
const WANDERING_PERIODS: usize = 48;
/// Strobe states that are drawn of a motion that does not repeat.
const STROBE_POINTS: usize = 3000;
/// Largest number of attractors drawn: more cannot be distinguished.
const MOST: usize = 8;

/// Phase portraits and strobe points of every attractor, each in its own colour, and the
/// unstable orbits found as open markers.
pub fn attractors_figure(model: &Model, found: &Attractors, units: &Units) -> Figure {
    let tips = found.attractors.iter().filter_map(|a| {
        let o = a
            .orbit
            .as_ref()
            .map(|o| &o.observables)
            .or(a.non_periodic.as_ref().map(|w| &w.observables));
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
    let unstable: Vec<(f64, f64)> = found
        .unstable
        .iter()
        .flatten()
        .flat_map(|o| o.motion.states.iter().map(|s| at_phase_zero(model, s)))
        .collect();
    AttractorCurves {
        axes: MotionAxes {
            beam: model.beam.is_some(),
            length: length_unit,
            velocity: velocity_unit,
        },
        attractors: curves
            .iter()
            .map(|(attractor, curve)| AttractorCurve {
                name: name(attractor),
                classification: attractor.classification.name().to_owned(),
                period: attractor.orbit.as_ref().map(|orbit| orbit.period),
                portrait: scaled(&curve.line),
                strobe: scaled(&curve.strobe),
            })
            .collect(),
        unstable: scaled(&unstable),
    }
    .figure()
}

/// Name for the legend with the share of initial states, as "period 4 (37 %)".
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
        let start = &attractor.non_periodic.as_ref()?.state;
        let trajectory = Recording::of(model, start, WANDERING_PERIODS).ok()?;
        let section =
            crate::lyapunov::section(model, start, Section::Phase(0.0), STROBE_POINTS).ok()?;
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
    let size = |f: fn(&crate::lyapunov::SectionPoint) -> f64| {
        report
            .section
            .iter()
            .fold(0.0, |m: f64, p| m.max(f(p).abs()))
    };
    let (length, length_unit) = units.axis(Kind::Length, size(|p| p.tip));
    let rate = match report.section_at {
        Section::Phase(_) => size(|p| p.tip_rate),
        Section::Contact => size(|p| p.gap_rate),
    };
    let (velocity, velocity_unit) = units.axis(Kind::Velocity, rate);
    SectionCurves {
        axes: MotionAxes {
            beam: model.beam.is_some(),
            length: length_unit,
            velocity: velocity_unit,
        },
        phase: match report.section_at {
            Section::Phase(phase) => Some(phase),
            Section::Contact => None,
        },
        points: report
            .section
            .iter()
            .map(|p| match report.section_at {
                Section::Phase(_) => (length * p.tip, velocity * p.tip_rate),
                Section::Contact => (360.0 * p.phase, -velocity * p.gap_rate),
            })
            .collect(),
        exponents: report.exponents.clone(),
        errors: report.errors.clone(),
    }
    .figure()
}
