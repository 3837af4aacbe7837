//! The figures of what an instrument's file holds: a curve, an image, a spectrum.

use afm_files::{Channel, Curve, Image, Spectrum, Style};
use nanotap_figures::{Axis, Colour, Figure, Heatmap, Line, ONE_AND_A_HALF_COLUMNS, Panel};

use crate::files::{Item, style_name};
use nanotap_case::physical::Kind;
use nanotap_motions::figure::panels::{largest_of, si_axis};

/// Most points of a line; of longer ones every n-th is drawn.
const MAX_POINTS: usize = 4000;

/// The figure of an item of a file.
pub fn item_figure(item: &Item) -> Figure {
    let panel = match item {
        Item::Curve(curve) => curve_panel(curve),
        Item::Image(image) => image_panel(image),
        Item::Spectrum(spectrum) => spectrum_panel(spectrum),
    };
    Figure::single(panel).width(ONE_AND_A_HALF_COLUMNS)
}

/// The axis of numbers in this unit, and their factor: with a prefix if it is a unit of SI.
fn shown<'a>(name: &str, unit: &str, values: impl Iterator<Item = &'a f64>) -> (Axis, f64) {
    match Kind::of_si_unit(unit) {
        Some(kind) => si_axis(name, kind, largest_of(values.copied())),
        None => (Axis::linear(name).unit(unit), 1.0),
    }
}

/// Deflection against distance, a line for each segment; without a distance, channels against points.
fn curve_panel(curve: &Curve) -> Panel {
    let channels = |of: &str| -> Vec<&Channel> {
        let found = curve
            .segments
            .iter()
            .filter_map(|segment| segment.channel(of));
        found.collect()
    };
    let first = curve.segments.iter().find_map(|of| of.channels.first());
    let x = curve.distance.as_ref().map(|of| of.channel.as_str());
    let y = curve
        .deflection
        .as_deref()
        .or(first.map(|of| of.name.as_str()));
    let axis = |name: Option<&str>, other: &str| {
        let found = name.map(channels).unwrap_or_default();
        let unit = found.first().map_or("", |of| of.unit.as_str());
        let values = found.iter().flat_map(|of| &of.values);
        shown(name.unwrap_or(other), unit, values)
    };
    let ((along, x_factor), (up, y_factor)) = (axis(x, "point"), axis(y, "value"));
    let mut panel = Panel::new(along, up);
    for segment in &curve.segments {
        let Some(values) = y.and_then(|of| segment.channel(of)) else {
            continue;
        };
        let place = x.and_then(|of| segment.channel(of));
        let step = values.values.len().div_ceil(MAX_POINTS).max(1);
        let points = values
            .values
            .iter()
            .enumerate()
            .step_by(step)
            .map(|(k, value)| {
                let x = place.map_or(k as f64, |of| of.values[k]);
                (x_factor * x, y_factor * value)
            });
        let colour = match segment.style {
            Style::Approach => Colour::BLUE,
            Style::Retract => Colour::VERMILLION,
            Style::Pause | Style::Modulation => Colour::GREY,
            Style::Unsplit => Colour::BLACK,
        };
        let line = Line::new(points.collect::<Vec<_>>()).colour(colour);
        panel = panel.with(line.label(style_name(segment.style)));
    }
    panel
}

fn image_panel(image: &Image) -> Panel {
    let [columns, rows] = image.shape;
    let sides = image.size.unwrap_or([columns as f64, rows as f64]);
    let unit = if image.size.is_some() { "m" } else { "" };
    let axis = |name: &str| shown(name, unit, sides.iter());
    let ((x, factor), (y, _)) = (axis("x"), axis("y"));
    let (colours, scale) = shown(&image.name, &image.unit, image.values.iter());
    // The row of the smallest y comes first.
    let from_below = image.values.chunks(columns.max(1)).rev().flatten();
    Panel::new(x.tight(), y.tight()).with(Heatmap::new(
        columns,
        rows,
        from_below.map(|of| scale * of),
        (0.0, factor * sides[0]),
        (0.0, factor * sides[1]),
        colours,
    ))
}

fn spectrum_panel(spectrum: &Spectrum) -> Panel {
    let (x, factor) = shown("frequency", "Hz", spectrum.frequency.iter());
    let y = Axis::log(&spectrum.name).unit(&spectrum.unit);
    // A logarithm needs values above zero.
    let drawn = spectrum.frequency.iter().zip(&spectrum.values);
    let drawn: Vec<(f64, f64)> = drawn
        .filter(|(_, value)| **value > 0.0)
        .map(|(frequency, value)| (factor * frequency, *value))
        .collect();
    let step = drawn.len().div_ceil(MAX_POINTS).max(1);
    let points: Vec<(f64, f64)> = drawn.into_iter().step_by(step).collect();
    Panel::new(x, y).with(Line::new(points).colour(Colour::BLUE))
}
