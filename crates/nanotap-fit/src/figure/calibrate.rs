//! The figure of a thermal calibration: the spectrum with its fit, and their ratio.

use nanotap_figures::{
    Axis, Colour, Figure, Legend, Line, ONE_AND_A_HALF_COLUMNS, Panel, Points, Rule,
};

use crate::calibrate::CalibrateReport;
use nanotap_case::physical::Kind;
use nanotap_motions::figure::panels::si_axis;

/// Most points of a line; groups of more bins are averaged.
const MAX_POINTS: usize = 1500;

/// Power density against frequency around the range of the fit, and the ratio to the fit in the range.
pub fn calibrate_figure(report: &CalibrateReport) -> Figure {
    let [low, high] = report.calibration.range;
    let margin = 0.15 * (high - low);
    let shown = [(low - margin).max(0.0), high + margin];
    let (axis, factor) = si_axis("frequency", Kind::Frequency, high);
    let spectrum = &report.spectrum;
    let inside = |[low, high]: [f64; 2], value: &dyn Fn(f64, f64) -> f64| {
        let bins = spectrum.frequencies().zip(spectrum.powers());
        let points: Vec<(f64, f64)> = bins
            .filter(|(f, _)| (low..=high).contains(f))
            .map(|(f, power)| (factor * f, value(f, power)))
            .collect();
        averaged(&points)
    };
    let axis = || axis.clone().range(factor * shown[0], factor * shown[1]);
    let fit = (0..=1000).map(|k| {
        let f = low + (high - low) * f64::from(k) / 1000.0;
        (factor * f, report.calibration.density(f))
    });
    let symbol = report.calibration.unit.symbol();
    let density = Axis::log("power density").unit(format!("{symbol}²/Hz"));
    let measured = Line::new(inside(shown, &|_, power| power)).colour(Colour::GREY);
    let spectrum = Panel::new(axis(), density)
        .legend(Legend::Above)
        .with(measured.width(0.6).label("measured"))
        .with(
            Line::new(fit.collect::<Vec<_>>())
                .colour(Colour::VERMILLION)
                .label("fit"),
        );
    let ratio = |f, power: f64| power / report.calibration.density(f);
    let ratio = Points::new(inside([low, high], &ratio)).colour(Colour::GREY);
    let ratio = Panel::new(axis(), Axis::linear("density / fit"))
        .with(ratio)
        .with(Rule::horizontal(1.0));
    Figure::new(2, 1)
        .width(ONE_AND_A_HALF_COLUMNS)
        .height(100.0)
        .row_heights([2.0, 1.0])
        .share_x()
        .with(spectrum)
        .with(ratio)
}

/// Means of groups of neighbours.
fn averaged(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let size = points.len().div_ceil(MAX_POINTS).max(1);
    let mean = |group: &[(f64, f64)]| {
        let sum = group
            .iter()
            .fold((0.0, 0.0), |(x, y), of| (x + of.0, y + of.1));
        (sum.0 / group.len() as f64, sum.1 / group.len() as f64)
    };
    points.chunks(size).map(mean).collect()
}
