//! The figure of the states of an image: height, states and corrected height.

use nanotap_figures::{
    Axis, Band, CategoryMap, Colour, DOUBLE_COLUMN, Figure, Heatmap, Legend, Line,
    ONE_AND_A_HALF_COLUMNS, Panel, Rule,
};

use crate::image_states::ImageStatesReport;
use nanotap_case::physical::Kind;
use nanotap_case::units::prefixed;
use nanotap_motions::figure::panels::{largest_of, si_axis};

/// Height, state and corrected height: of an image as maps, of one line as curves with the phase.
/// Without a height, phase and state. The caption is the verdict.
pub fn image_states_figure(report: &ImageStatesReport) -> Figure {
    let figure = if report.shape[1] == 1 {
        line_figure(report)
    } else {
        map_figure(report)
    };
    figure.caption(&report.verdict)
}

/// The colour of a state.
fn colour(name: &str) -> Colour {
    match name {
        "free" => Colour::rgb(222, 222, 222),
        "attractive" => Colour::BLUE,
        "repulsive" => Colour::VERMILLION,
        name if name.starts_with("attractive") => Colour::SKY,
        _ => Colour::ORANGE,
    }
}

/// Name of a state, with its share of the pixels.
fn named(name: &str, pixels: usize, report: &ImageStatesReport) -> String {
    let all = (report.shape[0] * report.shape[1]).max(1);
    let percent = 100.0 * pixels as f64 / all as f64;
    match percent {
        percent if percent > 0.0 && percent < 0.5 => format!("{name} (below 1 %)"),
        percent => format!("{name} ({percent:.0} %)"),
    }
}

/// Sides of the image with the axes along them; without a size in pixels.
fn sides(report: &ImageStatesReport) -> ([f64; 2], [Axis; 2]) {
    let labels = ["x", "y"].map(|side| format!("position ${side}$"));
    match report.size {
        Some(size) => {
            let largest = largest_of(size);
            let axes = labels.map(|label| si_axis(label, Kind::Length, largest));
            (
                size.map(|side| axes[0].1 * side),
                axes.map(|(axis, _)| axis),
            )
        }
        None => (
            report.shape.map(|count| count as f64),
            labels.map(|label| Axis::linear(label).unit("pixels")),
        ),
    }
}

fn phase_axis() -> Axis {
    Axis::linear("phase").unit("°")
}

/// Factor and unit of the heights, and the least of them, in m, above which they are drawn.
fn heights(report: &ImageStatesReport) -> (f64, String, f64) {
    let all = report.images.height.iter().flatten().flatten();
    let known = all.copied().filter(|height| height.is_finite());
    let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), height| {
        (low.min(height), high.max(height))
    });
    if low > high {
        return (1.0, "m".to_owned(), 0.0);
    }
    let (factor, unit) = prefixed(Kind::Length, 1.0, high - low);
    (factor, unit, low)
}

fn map_figure(report: &ImageStatesReport) -> Figure {
    let (size, axes) = sides(report);
    let [columns, lines] = report.shape;
    let axes = || axes.clone().map(Axis::tight);
    let map = |image: &[Vec<f64>], scale: &dyn Fn(f64) -> f64, colours: Axis| {
        let [x, y] = axes();
        // The line of the smallest y comes first.
        let values = image.iter().rev().flatten().map(|value| scale(*value));
        Panel::new(x, y).with(Heatmap::new(
            columns,
            lines,
            values,
            (0.0, size[0]),
            (0.0, size[1]),
            colours,
        ))
    };
    let present: Vec<usize> = (0..report.states.len())
        .filter(|state| report.states[*state].pixels > 0)
        .collect();
    let undecided = present.len();
    let cells = report.images.state.iter().rev().flatten().map(|state| {
        let known = state.and_then(|state| present.iter().position(|of| *of == state));
        Some(known.unwrap_or(undecided))
    });
    let mut layer = CategoryMap::new(columns, lines, cells, (0.0, size[0]), (0.0, size[1]));
    for state in &present {
        let state = &report.states[*state];
        let name = named(&state.name, state.pixels, report);
        layer = layer.category_in(name, colour(&state.name));
    }
    layer = layer.category_in(named("undecided", report.undecided, report), Colour::BLACK);
    let [x, y] = axes();
    let states = Panel::new(x, y).with(layer).legend(Legend::Above);
    let (factor, unit, low) = heights(report);
    let level = |height: f64| factor * (height - low);
    let of_height = |image: &Option<Vec<Vec<f64>>>, label: &str| {
        let image = image.as_ref();
        image.map(|image| map(image, &level, Axis::linear(label).unit(&unit)))
    };
    let images = &report.images;
    let measured = of_height(&images.height, "height $z$").or_else(|| {
        let phase = images.phase.as_ref();
        phase.map(|phase| map(phase, &|value| value, phase_axis()))
    });
    let corrected = of_height(&images.corrected, "corrected height");
    let panels: Vec<Panel> = measured
        .into_iter()
        .chain([states])
        .chain(corrected)
        .collect();
    let figure = Figure::new(1, panels.len())
        .width(DOUBLE_COLUMN)
        .height(72.0);
    panels.into_iter().fold(figure, Figure::with)
}

fn line_figure(report: &ImageStatesReport) -> Figure {
    let (size, [along, _]) = sides(report);
    let step = size[0] / report.shape[0].max(1) as f64;
    let points = |values: &[f64], scale: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
        let numbered = values.iter().enumerate();
        numbered
            .map(|(k, value)| ((k as f64 + 0.5) * step, scale(*value)))
            .collect()
    };
    let axis = || along.clone().range(0.0, size[0]);
    let images = &report.images;
    let mut panels = Vec::new();
    let (factor, unit, low) = heights(report);
    let level = |height: f64| factor * (height - low);
    let states = images.state.first().map_or(&[][..], Vec::as_slice);
    let band = |state: Option<usize>| Band::of_pixels(states.iter().map(|own| *own == state), step);
    if let (Some(height), Some(corrected)) = (&images.height, &images.corrected) {
        let mut panel = Panel::new(axis(), Axis::linear("height $z$").unit(unit));
        for (k, state) in report.states.iter().enumerate() {
            if let Some(band) = band(Some(k))
                && report.reference.as_ref() != Some(&state.name)
            {
                let band = band.colour(colour(&state.name));
                panel = panel.with(band.label(state.name.as_str()));
            }
        }
        if let Some(band) = band(None) {
            panel = panel.with(band.label("undecided"));
        }
        let measured = Line::new(points(&height[0], &level)).colour(Colour::GREY);
        let corrected = Line::new(points(&corrected[0], &level)).colour(Colour::BLACK);
        panel = panel
            .with(measured.label("measured"))
            .with(corrected.label("corrected"));
        panels.push(panel.legend(Legend::Above));
    }
    if let Some(phase) = &images.phase {
        let mut panel = Panel::new(axis(), phase_axis());
        for state in &report.states {
            if let Some(level) = state.measured_phase {
                panel = panel.with(Rule::horizontal(level));
            }
        }
        let line = Line::new(points(&phase[0], &|value| value)).colour(Colour::BLUE);
        panels.push(panel.with(line));
    }
    let figure = Figure::new(panels.len(), 1).width(ONE_AND_A_HALF_COLUMNS);
    let figure = figure.height(45.0 + 45.0 * panels.len() as f64).share_x();
    panels.into_iter().fold(figure, Figure::with)
}
