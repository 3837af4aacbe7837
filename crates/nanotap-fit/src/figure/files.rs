//! The figures of what an instrument's file holds: a curve, an image, a spectrum.

use afm_files::{Channel, Curve, Image, Spectrum, Style};
use nanotap_figures::{Axis, Colour, Figure, Heatmap, Line, ONE_AND_A_HALF_COLUMNS, Panel};

use crate::files::{Item, style_name};
use nanotap_case::physical::Kind;
use nanotap_case::units::prefixed;

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

/// Numbers in the prefixed unit that fits, and the label of their axis.
fn shown<'a>(
    name: &str,
    unit: &str,
    values: impl Iterator<Item = &'a f64> + Clone,
) -> (f64, String) {
    let kind = match unit {
        "m" => Some(Kind::Length),
        "N" => Some(Kind::Force),
        "V" => Some(Kind::Voltage),
        "N/m" => Some(Kind::Stiffness),
        "Hz" => Some(Kind::Frequency),
        _ => None,
    };
    let finite = values.filter(|of| of.is_finite());
    let size = finite.fold(0.0_f64, |size, of| size.max(of.abs()));
    match kind.map(|kind| prefixed(kind, 1.0, size)) {
        Some((factor, unit)) => (factor, format!("{name} ({unit})")),
        None if unit.is_empty() => (1.0, name.to_owned()),
        None => (1.0, format!("{name} ({unit})")),
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
    let ((x_factor, x_label), (y_factor, y_label)) = (axis(x, "point"), axis(y, "value"));
    let mut panel = Panel::new(Axis::linear(x_label), Axis::linear(y_label));
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
    let ((factor, x), (_, y)) = (axis("x"), axis("y"));
    let (scale, label) = shown(&image.name, &image.unit, image.values.iter());
    // The row of the smallest y comes first.
    let from_below = image.values.chunks(columns.max(1)).rev().flatten();
    Panel::new(Axis::linear(x).tight(), Axis::linear(y).tight()).with(Heatmap::new(
        columns,
        rows,
        from_below.map(|of| scale * of),
        (0.0, factor * sides[0]),
        (0.0, factor * sides[1]),
        Axis::linear(label),
    ))
}

fn spectrum_panel(spectrum: &Spectrum) -> Panel {
    let (factor, x) = shown("frequency", "Hz", spectrum.frequency.iter());
    let y = format!("{} ({})", spectrum.name, spectrum.unit);
    // A logarithm needs values above zero.
    let drawn = spectrum.frequency.iter().zip(&spectrum.values);
    let drawn: Vec<(f64, f64)> = drawn
        .filter(|(_, value)| **value > 0.0)
        .map(|(frequency, value)| (factor * frequency, *value))
        .collect();
    let step = drawn.len().div_ceil(MAX_POINTS).max(1);
    let points: Vec<(f64, f64)> = drawn.into_iter().step_by(step).collect();
    Panel::new(Axis::linear(x), Axis::log(y)).with(Line::new(points).colour(Colour::BLUE))
}
