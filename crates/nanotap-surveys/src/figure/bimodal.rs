//! The figure of bimodal operation: what the loops let change of each tone, the largest force, and
//! the moduli of the formula and of the sample.

use nanotap_figures::{Axis, Colour, DOUBLE_COLUMN, Figure, Legend, Line, Panel, Rule};

use crate::bimodal::{BimodalPoint, BimodalReport};

/// A quantity against the distance in nm.
fn panel(report: &BimodalReport, label: &str, of: impl Fn(&BimodalPoint) -> Option<f64>) -> Panel {
    let curve = report
        .table
        .iter()
        .filter_map(|p| Some((1e9 * p.zc, of(p)?)));
    Panel::new(Axis::linear("distance $z_c$ (nm)"), Axis::linear(label))
        .legend(Legend::Hidden)
        .with(Line::new(curve).colour(Colour::BLUE))
}

/// The panels of a tone: amplitude and phase where its loop does not hold them, frequency shift and
/// drive where it does.
fn of_tone(report: &BimodalReport, k: usize) -> [Panel; 2] {
    let n = k + 1;
    let kind = report.loops[k];
    let by_phase = if kind.holds_phase() {
        panel(report, &format!("shift $Δf_{n}$ (Hz)"), |p| {
            Some(p.tones[k].frequency_shift)
        })
    } else {
        panel(report, &format!("lag $φ_{n}$ (°)"), |p| {
            Some(p.tones[k].phase)
        })
    };
    let by_amplitude = if kind.holds_amplitude() {
        panel(report, &format!("drive {n} / free drive"), |p| {
            Some(p.tones[k].drive_ratio)
        })
    } else {
        panel(report, &format!("amplitude $A_{n}$ (nm)"), |p| {
            Some(1e9 * p.tones[k].amplitude)
        })
    };
    [by_amplitude, by_phase]
}

/// Both tones, force and modulus against the distance.
pub fn bimodal_figure(report: &BimodalReport) -> Figure {
    let mut figure = Figure::new(2, 3).width(DOUBLE_COLUMN).height(110.0);
    let [first, second] = [0, 1].map(|k| of_tone(report, k));
    let force = panel(report, "largest force (nN)", |p| Some(1e9 * p.peak_force));
    let mut modulus = panel(report, "$E^*$ by formula (MPa)", |p| {
        p.estimates.reduced_modulus.map(|value| 1e-6 * value)
    });
    if let Some(exact) = report.reduced_modulus {
        modulus = modulus.with(Rule::horizontal(1e-6 * exact));
    }
    let [a, b] = first;
    let [c, d] = second;
    for panel in [a, b, force, c, d, modulus] {
        figure = figure.with(panel);
    }
    figure
}
