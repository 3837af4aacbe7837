//! The figure of bimodal operation: what the loops let change of each tone, the largest force, and
//! the moduli of the formula and of the sample.

use nanotap_case::physical::Kind;
use nanotap_figures::{Colour, DOUBLE_COLUMN, Figure, Legend, Line, Panel, Rule};
use nanotap_motions::figure::panels::{largest_of, si_axis};

use crate::bimodal::{BimodalPoint, BimodalReport, ToneReading};

/// What a panel shows of each point.
type Shown<'a> = &'a dyn Fn(&BimodalPoint) -> Option<f64>;

/// A quantity in SI against the distance, and the factor to its drawn values. `also`: a further value
/// that is drawn.
fn panel(
    report: &BimodalReport,
    label: String,
    kind: Kind,
    of: Shown<'_>,
    also: Option<f64>,
) -> (Panel, f64) {
    let distances = report.table.iter().map(|p| p.zc);
    let (x, along) = si_axis("distance $z_c$", Kind::Length, largest_of(distances));
    let values = report.table.iter().filter_map(of).chain(also);
    let (y, factor) = si_axis(label, kind, largest_of(values));
    let drawn = |p: &BimodalPoint| Some((along * p.zc, factor * of(p)?));
    let curve = report.table.iter().filter_map(drawn);
    let panel = Panel::new(x, y)
        .legend(Legend::Hidden)
        .with(Line::new(curve).colour(Colour::BLUE));
    (panel, factor)
}

/// The panels of a tone: amplitude and phase where its loop does not hold them, frequency shift and
/// drive where it does.
fn of_tone(report: &BimodalReport, k: usize) -> [Panel; 2] {
    let n = k + 1;
    let kind = report.loops[k];
    let shown = |label: String, kind: Kind, of: fn(&ToneReading) -> f64| {
        panel(report, label, kind, &|p| Some(of(&p.tones[k])), None).0
    };
    let by_phase = if kind.holds_phase() {
        shown(format!("shift $Δf_{n}$"), Kind::Frequency, |tone| {
            tone.frequency_shift
        })
    } else {
        shown(format!("lag $φ_{n}$"), Kind::Degrees, |tone| tone.phase)
    };
    let by_amplitude = if kind.holds_amplitude() {
        shown(format!("drive {n} / free drive"), Kind::Number, |tone| {
            tone.drive_ratio
        })
    } else {
        shown(format!("amplitude $A_{n}$"), Kind::Length, |tone| {
            tone.amplitude
        })
    };
    [by_amplitude, by_phase]
}

/// Both tones, force and modulus against the distance.
pub fn bimodal_figure(report: &BimodalReport) -> Figure {
    let mut figure = Figure::new(2, 3).width(DOUBLE_COLUMN).height(110.0);
    let [first, second] = [0, 1].map(|k| of_tone(report, k));
    let force = |p: &BimodalPoint| Some(p.peak_force);
    let (force, _) = panel(report, "largest force".into(), Kind::Force, &force, None);
    let estimate = |p: &BimodalPoint| p.estimates.reduced_modulus;
    let label = "$E^*$ by formula".to_owned();
    let exact = report.reduced_modulus;
    let (mut modulus, factor) = panel(report, label, Kind::Pressure, &estimate, exact);
    if let Some(exact) = exact {
        modulus = modulus.with(Rule::horizontal(factor * exact));
    }
    let [a, b] = first;
    let [c, d] = second;
    for panel in [a, b, force, c, d, modulus] {
        figure = figure.with(panel);
    }
    figure
}
