//! Figures for the page, which draws their description, and as files.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use nanotap_figures::{Axis, Colour, DPI, Figure, Layer, Range};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::api_error::ApiError;
use crate::clicks::conversion;

/// Steps of the colours of a map.
const SHADES: usize = 64;

/// The visible range of a panel, in the units of its axes.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct View {
    panel: usize,
    x: [f64; 2],
    y: [f64; 2],
}

/// Views of figures by the name of their place on the page.
pub(crate) type Views = BTreeMap<String, Vec<View>>;

/// The figure with the given ranges of its axes. Panels that share their horizontal axis are moved
/// together.
pub(crate) fn viewed(mut figure: Figure, views: &[View]) -> Figure {
    for View { panel, x, y } in views {
        let column = panel % figure.cols.max(1);
        for (k, one) in figure.panels.iter_mut().enumerate() {
            let shares = figure.share_x && k % figure.cols.max(1) == column;
            if k == *panel || shares {
                one.x.range = Range::Fixed(x[0], x[1]);
            }
            if k == *panel {
                one.y.range = Range::Fixed(y[0], y[1]);
            }
        }
    }
    figure
}

/// Legend of the curves of a pinned figure.
const PINNED: &str = "pinned";

/// Draws the curves of a pinned figure behind those of another, in the panels with the same axes.
/// Returns whether there are any.
pub(crate) fn over_pinned(figure: &mut Figure, pinned: &Figure) -> bool {
    let factor = |one: &Axis, other: &Axis| {
        (one.label == other.label).then(|| conversion(&other.unit, &one.unit))?
    };
    let mut any = false;
    for (panel, old) in figure.panels.iter_mut().zip(&pinned.panels) {
        let (Some(across), Some(up)) = (factor(&panel.x, &old.x), factor(&panel.y, &old.y)) else {
            continue;
        };
        let mut label = PINNED;
        let mut behind = Vec::new();
        for layer in &old.layers {
            let mut layer = layer.clone();
            let (colour, words, points) = match &mut layer {
                Layer::Line(l) => (&mut l.colour, &mut l.label, &mut l.points),
                Layer::Points(l) => (&mut l.colour, &mut l.label, &mut l.points),
                Layer::Markers(l) => (&mut l.colour, &mut l.label, &mut l.points),
                _ => continue,
            };
            // What was pinned behind the pinned figure stays there.
            if words == PINNED {
                continue;
            }
            for (x, y) in points {
                *x *= across;
                *y *= up;
            }
            *colour = Some(Colour::GREY);
            std::mem::take(&mut label).clone_into(words);
            behind.push(layer);
        }
        any |= !behind.is_empty();
        behind.append(&mut panel.layers);
        panel.layers = behind;
    }
    any
}

/// The description of a figure, which the page draws.
pub(crate) fn drawn(figure: &Figure) -> Result<Value, ApiError> {
    let text = figure.to_json().map_err(ApiError::of)?;
    let mut drawn: Value = serde_json::from_str(&text)
        .map_err(|error| ApiError::failed(format!("no JSON of the figure: {error}")))?;
    for (k, panel) in figure.panels.iter().enumerate() {
        for (n, layer) in panel.layers.iter().enumerate() {
            if let Layer::Heatmap(map) = layer {
                let colour = |k: usize| map.map.at(k as f64 / SHADES as f64).to_string();
                let colours: Vec<String> = (0..=SHADES).map(colour).collect();
                drawn["panels"][k]["layers"][n]["colours"] = json!(colours);
            }
        }
    }
    Ok(drawn)
}

/// A figure in a format, given by its file extension.
pub(crate) fn picture(figure: &Figure, format: &str) -> Result<(&'static str, Vec<u8>), ApiError> {
    Ok(match format {
        "svg" => (
            "image/svg+xml",
            figure.to_svg().map_err(ApiError::of)?.into_bytes(),
        ),
        "png" => ("image/png", figure.to_png(DPI).map_err(ApiError::of)?),
        "pdf" => ("application/pdf", figure.to_pdf().map_err(ApiError::of)?),
        "csv" => {
            // The figure of a request may have cells that do not fit its columns.
            figure.check().map_err(ApiError::of)?;
            ("text/csv", csv(figure).into_bytes())
        }
        other => {
            return Err(ApiError::input(
                format!("unknown format `{other}`"),
                "there are svg, png, pdf and csv",
            ));
        }
    })
}

/// The data of a figure, point by point, in the units of the axes. The first lines have the names
/// of the axes; for a map, the last column is the value at the centre of each cell.
fn csv(figure: &Figure) -> String {
    let mut text = String::new();
    for (k, panel) in figure.panels.iter().enumerate() {
        for (name, axis) in [("x", &panel.x), ("y", &panel.y)] {
            let words = format!("{} {}", axis.label, axis.unit);
            let _ = writeln!(
                text,
                "# panel {k}, {name}: {}",
                words.trim().replace('$', "")
            );
        }
    }
    text.push_str("panel,series,x,y,value\n");
    for (k, panel) in figure.panels.iter().enumerate() {
        for layer in &panel.layers {
            match layer {
                Layer::Line(l) => series(&mut text, k, &l.label, &l.points),
                Layer::Points(l) => series(&mut text, k, &l.label, &l.points),
                Layer::Markers(l) => series(&mut text, k, &l.label, &l.points),
                Layer::Stems(l) => series(&mut text, k, &l.label, &l.points),
                Layer::Bars(l) => series(&mut text, k, &l.label, &l.points),
                Layer::Heatmap(l) => {
                    let values = l.values.iter().map(|v| (*v).to_string());
                    grid(
                        &mut text,
                        k,
                        &l.scale.label,
                        (l.columns, l.x, l.rows, l.y),
                        values,
                    );
                }
                Layer::CategoryMap(l) => {
                    let name = |cell: &Option<usize>| {
                        let category = cell.and_then(|c| l.categories.get(c));
                        category.map_or_else(String::new, |c| field(&c.label))
                    };
                    let values = l.cells.iter().map(name);
                    grid(&mut text, k, "map", (l.columns, l.x, l.rows, l.y), values);
                }
                _ => {}
            }
        }
    }
    text
}

fn series(text: &mut String, panel: usize, label: &str, points: &[(f64, f64)]) {
    for (x, y) in points
        .iter()
        .filter(|(x, y)| x.is_finite() && y.is_finite())
    {
        let _ = writeln!(text, "{panel},{},{x},{y},", field(label));
    }
}

fn grid(
    text: &mut String,
    panel: usize,
    label: &str,
    (columns, x, rows, y): (usize, (f64, f64), usize, (f64, f64)),
    values: impl Iterator<Item = String>,
) {
    let middle = |(from, to): (f64, f64), count: usize, k: usize| {
        from + (to - from) * (k as f64 + 0.5) / count as f64
    };
    for (cell, value) in values.enumerate() {
        let [x, y] = [
            middle(x, columns, cell % columns),
            middle(y, rows, cell / columns),
        ];
        let _ = writeln!(text, "{panel},{},{x},{y},{value}", field(label));
    }
}

/// A text as a CSV field.
fn field(word: &str) -> String {
    let word = word.replace('$', "");
    if word.contains([',', '"', '\n']) {
        format!("\"{}\"", word.replace('"', "\"\""))
    } else {
        word
    }
}

/// Request for a figure that the page has, as a file, in a range.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wish {
    figure: Figure,
    #[serde(default)]
    views: Vec<View>,
    format: String,
}

/// A figure of the page as a file.
pub(crate) fn redrawn(wish: &Wish) -> Result<(&'static str, Vec<u8>), ApiError> {
    picture(&viewed(wish.figure.clone(), &wish.views), &wish.format)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_figures::{Axis, CategoryMap, Line, Panel};

    #[test]
    fn the_table_of_a_figure_has_its_points_and_the_middles_of_its_cells() {
        let lines = Panel::new(Axis::linear("$x$").unit("nm"), Axis::linear("y"))
            .with(Line::new([(1.0, 2.0), (f64::NAN, 0.0)]).label("a, b"));
        let cells = CategoryMap::new(2, 1, [Some(0), None], (0.0, 2.0), (0.0, 1.0));
        let map = Panel::new(Axis::linear("x"), Axis::linear("y"))
            .with(cells.category_in("chaotic", nanotap_figures::Colour::BLACK));
        let text = csv(&Figure::new(1, 2).with(lines).with(map));
        let rows: Vec<&str> = text.lines().skip_while(|l| l.starts_with('#')).collect();
        assert_eq!(
            rows,
            [
                "panel,series,x,y,value",
                "0,\"a, b\",1,2,",
                "1,map,0.5,0.5,chaotic",
                "1,map,1.5,0.5,",
            ]
        );
        assert!(text.starts_with("# panel 0, x: x nm\n"));
    }

    #[test]
    fn a_pinned_curve_is_behind_where_the_axes_are_the_same() {
        let panel = |unit: &str, y: f64| {
            Panel::new(Axis::linear("$x$").unit(unit), Axis::linear("y"))
                .with(Line::new([(1.0, y)]).label("curve"))
        };
        let drawn = |unit: &str, y: f64| Figure::new(1, 1).with(panel(unit, y));
        let mut twice = drawn("nm", 3.0);
        assert!(over_pinned(&mut twice, &drawn("nm", 2.0)));
        let heights: Vec<(f64, &str)> = twice.panels[0]
            .layers
            .iter()
            .filter_map(|layer| match layer {
                Layer::Line(line) => Some((line.points[0].1, line.label.as_str())),
                _ => None,
            })
            .collect();
        assert_eq!(heights, [(2.0, PINNED), (3.0, "curve")]);
        // A pinned curve of a pinned figure is not drawn again.
        let mut third = drawn("nm", 4.0);
        over_pinned(&mut third, &twice);
        assert_eq!(third.panels[0].layers.len(), 2);
        let mut other = drawn("um", 3.0);
        assert!(over_pinned(&mut other, &drawn("nm", 2.0)));
        assert!(
            matches!(&other.panels[0].layers[0], Layer::Line(line) if (line.points[0].0 - 1e-3).abs() < 1e-15)
        );
        let mut other = drawn("Hz", 3.0);
        assert!(!over_pinned(&mut other, &drawn("nm", 2.0)));
        assert_eq!(other.panels[0].layers.len(), 1);
    }
}
