//! The figure of a scan: curves of a single line, images of several lines.

use nanotap_figures::{
    Axis, Band, Colour, DOUBLE_COLUMN, Dash, Figure, Heatmap, Legend, Line, ONE_AND_A_HALF_COLUMNS,
    Panel, Rule,
};

use nanotap_case::physical::Kind;
use nanotap_motions::figure::panels::{largest_of, si_axis};

use crate::scan::{CHANNELS, Channel, Interaction, Mode, ScanReport};

/// Channels that are drawn: axis, factor from SI, and values.
fn drawn(report: &ScanReport) -> impl Iterator<Item = (Axis, f64, &'static Channel)> {
    let names = ["height", "amplitude_error", "phase", "peak_force_max"];
    let channels = CHANNELS
        .iter()
        .filter(move |channel| names.contains(&channel.name));
    channels.map(|channel| {
        let images = report
            .directions()
            .flat_map(|(_, image)| (channel.values)(image));
        let size = largest_of(images.flatten().copied());
        let (axis, factor) = si_axis(channel.label, channel.dimension.entry(), size);
        (axis, factor, channel)
    })
}

/// Height, amplitude error, phase and largest peak force: of one line against the position, in both
/// directions; of more lines as pictures of the trace. The caption is the verdict.
pub fn scan_figure(report: &ScanReport) -> Figure {
    let figure = if report.trace.height.len() == 1 {
        line_figure(report)
    } else {
        image_figure(report)
    };
    figure.caption(&report.verdict)
}

/// Axis of the position, and the factor of positions: in the unit in which the middle of a line is shown.
fn along(report: &ScanReport) -> (Axis, f64) {
    si_axis("position $x$", Kind::Length, 0.5 * report.size[0])
}

fn line_figure(report: &ScanReport) -> Figure {
    let (x, factor) = along(report);
    let positions = report.pixel_positions();
    let of = |values: &[f64], scale: f64| -> Vec<(f64, f64)> {
        let both = positions.iter().zip(values);
        both.map(|(x, y)| (factor * x, scale * y)).collect()
    };
    let mut figure = Figure::new(4, 1)
        .width(ONE_AND_A_HALF_COLUMNS)
        .height(180.0)
        .row_heights([1.6, 1.0, 1.0, 1.3])
        .share_x();
    for (k, (y, scale, channel)) in drawn(report).enumerate() {
        let x = x.clone().range(0.0, factor * report.size[0]);
        let mut panel = Panel::new(x, y);
        for change in &report.branch_changes {
            panel = panel.with(Rule::vertical(factor * change.x));
        }
        if k == 0 {
            let states = &report.trace.state[0];
            let width = factor * report.size[0] / states.len().max(1) as f64;
            let attractive = states.iter().map(|s| *s == Some(Interaction::Attractive));
            if let Some(band) = Band::of_pixels(attractive, width) {
                panel = panel.with(band.label("attractive state"));
            }
            let level = surface_level(report);
            let surface: Vec<f64> = report.trace.surface[0].iter().map(|h| h + level).collect();
            panel = panel.with(
                Line::new(of(&surface, scale))
                    .colour(Colour::GREY)
                    .dash(Dash::Dashed)
                    .label("surface"),
            );
        }
        let colours = [Colour::BLUE, Colour::VERMILLION];
        for ((name, image), colour) in report.directions().zip(colours) {
            let line = Line::new(of(&(channel.values)(image)[0], scale)).colour(colour);
            panel = panel.with(if k == 0 { line.label(name) } else { line });
        }
        figure = figure.with(panel.legend(if k == 0 {
            Legend::Above
        } else {
            Legend::Hidden
        }));
    }
    figure
}

/// The distance at which the surface is drawn below the height.
fn surface_level(report: &ScanReport) -> f64 {
    if report.mode == Mode::ConstantHeight {
        return report.z0;
    }
    let pixels = report.trace.height[0].iter().zip(&report.trace.surface[0]);
    let mut apart: Vec<f64> = pixels.map(|(z, h)| z - h).collect();
    apart.retain(|value| value.is_finite());
    apart.sort_by(f64::total_cmp);
    apart.get(apart.len() / 2).copied().unwrap_or(0.0)
}

fn image_figure(report: &ScanReport) -> Figure {
    let (x, factor) = along(report);
    let size = report.size.map(|size| factor * size);
    let mut figure = Figure::new(2, 2).width(DOUBLE_COLUMN).height(150.0);
    for (colours, scale, channel) in drawn(report) {
        let rows = (channel.values)(&report.trace);
        let x = x.clone().tight();
        let y = Axis::linear("position $y$").unit(&x.unit).tight();
        let pixels = rows.iter().flatten().map(|value| scale * value);
        figure = figure.with(Panel::new(x, y).with(Heatmap::new(
            rows[0].len(),
            rows.len(),
            pixels,
            (0.0, size[0]),
            (0.0, size[1]),
            colours,
        )));
    }
    figure
}
