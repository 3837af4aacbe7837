//! Figures of the same motion under several contact laws: loops of force and indentation, and
//! dissipation and amplitude against the drive frequency.

use nanotap_figures::{Axis, DOUBLE_COLUMN, Dash, Figure, LINES, Legend, Line, Panel, Rule};

use crate::contact_laws::{Comparison, SampleMotion};
use nanotap_case::physical::Kind;
use nanotap_case::units::Units;
use nanotap_motions::branch::PointReport;
use nanotap_motions::figure::branch::{PlottedQuantity, runs};
use nanotap_motions::figure::panels::largest_of;

/// Loops of force and indentation under each law; if branches were followed, also dissipation and
/// amplitude against the drive frequency, dashed where unstable.
pub fn sample_figure(comparison: &Comparison, units: &Units) -> Figure {
    let nonlinear = comparison.samples.iter().any(|s| !s.force_curve.is_empty());
    let loops = if nonlinear {
        force_panel(comparison, units)
    } else {
        loops_panel(comparison, units)
    };
    if comparison.samples.iter().all(|s| s.branch.is_none()) {
        return Figure::single(loops).width(110.0).height(80.0);
    }
    Figure::new(1, 3)
        .width(DOUBLE_COLUMN)
        .height(72.0)
        .with(loops)
        .with(followed_panel(comparison, "dissipation", units))
        .with(followed_panel(comparison, "first_harmonic", units))
}

/// Force against gap of nonlinear laws, on a slow approach and back.
fn force_panel(comparison: &Comparison, units: &Units) -> Panel {
    let curves = || comparison.samples.iter().flat_map(|s| &s.force_curve);
    let (length, length_unit) = units.axis(Kind::Length, largest_of(curves().map(|p| p[0])));
    let (force, force_unit) = units.axis(Kind::Force, largest_of(curves().map(|p| p[1])));
    let mut panel = Panel::new(
        Axis::linear("gap $d$").unit(length_unit).tight(),
        Axis::linear("force on the tip").unit(force_unit),
    )
    .legend(Legend::Above)
    .with(Rule::horizontal(0.0));
    for (k, sample) in comparison.samples.iter().enumerate() {
        let points = sample.force_curve.iter();
        let line = Line::new(points.map(|[gap, f]| (length * gap, force * f)));
        panel = panel.with(
            line.colour(LINES[k % LINES.len()])
                .label(sample.contact.clone()),
        );
    }
    panel
}

fn loops_panel(comparison: &Comparison, units: &Units) -> Panel {
    let orbits = || comparison.samples.iter().filter_map(|s| s.orbit.as_ref());
    let deepest = largest_of(orbits().map(|o| o.observables.indentation));
    let strongest = largest_of(orbits().map(|o| o.observables.peak_force));
    let (length, length_unit) = units.axis(Kind::Length, deepest);
    let (force, force_unit) = units.axis(Kind::Force, strongest);
    let mut panel = Panel::new(
        // Most of the flight is beyond the range of the force.
        Axis::linear("indentation $-V_T$")
            .unit(length_unit)
            .range(-0.25 * length * deepest, 1.05 * length * deepest),
        Axis::linear("force on the tip").unit(force_unit),
    )
    .legend(Legend::Above)
    .with(Rule::horizontal(0.0));
    for (k, sample) in comparison.samples.iter().enumerate() {
        let Some(orbit) = &sample.orbit else { continue };
        let seen = orbit
            .force_loop
            .iter()
            .map(|[x, f]| (length * x, force * f))
            .map(|(x, f)| {
                let shown = x >= -0.25 * length * deepest;
                (if shown { x } else { f64::NAN }, f)
            });
        panel = panel.with(
            Line::new(seen)
                .colour(LINES[k % LINES.len()])
                .label(sample.contact.clone()),
        );
    }
    panel
}

fn followed_panel(comparison: &Comparison, shown: &str, units: &Units) -> Panel {
    let shown = PlottedQuantity::named(shown).unwrap_or(PlottedQuantity::SpectralRadius);
    let value = |p: &PointReport| shown.of(&p.observables, &p.multipliers);
    let points = |s: &SampleMotion| -> Vec<PointReport> {
        s.branch
            .as_ref()
            .map_or_else(Vec::new, |b| b.points.clone())
    };
    let all: Vec<PointReport> = comparison.samples.iter().flat_map(points).collect();
    let (y, factor) = shown.axis(
        true,
        |kind| units.si(kind),
        largest_of(all.iter().map(value)),
    );
    let (frequency, frequency_unit) =
        units.axis(Kind::Frequency, largest_of(all.iter().map(|p| p.parameter)));
    let mut panel = Panel::new(
        Axis::linear("drive frequency $Ω$")
            .unit(frequency_unit)
            .tight(),
        y,
    );
    for (k, sample) in comparison.samples.iter().enumerate() {
        let Some(branch) = &sample.branch else {
            continue;
        };
        for index in 0..branch.branches.len() {
            let own: Vec<&PointReport> =
                branch.points.iter().filter(|p| p.branch == index).collect();
            for (stable, run) in runs(&own, |p| p.stable) {
                let curve = run
                    .iter()
                    .map(|p| (frequency * p.parameter, factor * value(p)));
                let mut line = Line::new(curve).colour(LINES[k % LINES.len()]);
                if !stable {
                    line = line.dash(Dash::Dashed).width(0.6);
                }
                panel = panel.with(line);
            }
        }
    }
    panel
}
