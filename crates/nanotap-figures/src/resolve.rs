//! Resolves everything that does not depend on a figure's size: ranges, colours, letters.

use crate::axis::{Axis, Extent, Range, View};
use crate::colour::{self, Colour};
use crate::figure::Figure;
use crate::layer::{CategoryMap, Layer};
use crate::panel::Panel;

/// The figure with a range for each axis, a colour for each layer and a letter for each panel.
pub(crate) fn figure(given: &Figure) -> Figure {
    let mut figure = given.clone();
    let extents: Vec<(Extent, Extent, bool)> = given.panels.iter().map(extents).collect();
    for (index, panel) in figure.panels.iter_mut().enumerate() {
        panel.letter.get_or_insert_with(|| {
            if given.letters {
                letter(index)
            } else {
                String::new()
            }
        });
        let (mut x, y, any) = extents[index];
        if given.share_x {
            extents
                .iter()
                .skip(index % given.cols)
                .step_by(given.cols)
                .for_each(|(other, _, _)| x.join(*other));
        }
        // An axis without data has no marks unless it was given a range.
        if any {
            fix(&mut panel.x, x);
            fix(&mut panel.y, y);
        }
        let mut free = colour::LINES.into_iter().cycle();
        for layer in &mut panel.layers {
            let default = match layer {
                Layer::Rule(_) | Layer::Note(_) => Some(Colour::BLACK),
                Layer::Band(_) => Some(Colour::LIGHT_GREY),
                _ => None,
            };
            if let Some(own) = layer.colour_mut()
                && own.is_none()
            {
                *own = default.or_else(|| free.next());
            }
            match layer {
                Layer::CategoryMap(map) => colour_categories(map),
                Layer::Heatmap(map) => {
                    let mut extent = Extent::EMPTY;
                    for &value in map.values.iter().filter(|v| map.scale.holds(**v)) {
                        extent.feet.add(value);
                    }
                    fix(&mut map.scale, extent);
                }
                _ => {}
            }
        }
    }
    figure
}

fn fix(axis: &mut Axis, extent: Extent) {
    let View { from, to, .. } = axis.view(extent);
    axis.range = Range::Fixed(from, to);
}

/// A category with an explicit colour does not use one of the palette.
fn colour_categories(map: &mut CategoryMap) {
    let mut free = (0..).map(colour::category);
    for category in &mut map.categories {
        if category.colour.is_none() {
            category.colour = free.next();
        }
    }
}

/// Extents of a panel's layers along its axes, and whether there is anything to draw.
pub(crate) fn extents(panel: &Panel) -> (Extent, Extent, bool) {
    let (mut x, mut y) = (Extent::EMPTY, Extent::EMPTY);
    let mut any = false;
    for layer in &panel.layers {
        let mut own = false;
        for &(px, py) in layer.points() {
            if panel.x.holds(px) && panel.y.holds(py) {
                own = true;
                x.data.add(px);
                y.data.add(py);
                if let Layer::Bars(bars) = layer {
                    [px - bars.width / 2.0, px + bars.width / 2.0]
                        .into_iter()
                        .filter(|edge| panel.x.holds(*edge))
                        .for_each(|edge| x.data.add(edge));
                }
            }
        }
        match layer {
            Layer::Stems(_) | Layer::Bars(_) if own => {
                let foot = match layer {
                    Layer::Stems(stems) => stems.foot.unwrap_or(0.0),
                    _ => 0.0,
                };
                if panel.y.holds(foot) {
                    y.feet.add(foot);
                }
            }
            Layer::Heatmap(map) => {
                own = map.values.iter().any(|v| map.scale.holds(*v));
                add_area(&mut x, &mut y, map.x, map.y);
            }
            Layer::CategoryMap(map) => {
                own = map.cells.iter().any(Option::is_some);
                add_area(&mut x, &mut y, map.x, map.y);
            }
            Layer::Rule(rule) => {
                let (axis, extent) = if rule.upright {
                    (&panel.x, &mut x)
                } else {
                    (&panel.y, &mut y)
                };
                if axis.holds(rule.at) {
                    extent.data.add(rule.at);
                }
            }
            _ => {}
        }
        any |= own;
    }
    (x, y, any)
}

fn add_area(x: &mut Extent, y: &mut Extent, across: (f64, f64), upright: (f64, f64)) {
    for (extent, edges) in [(x, across), (y, upright)] {
        extent.maps.add(edges.0);
        extent.maps.add(edges.1);
    }
}

/// (a) … (z), (aa) …
fn letter(index: usize) -> String {
    let mut rest = index;
    let mut name = String::new();
    loop {
        name.insert(0, char::from(b'a' + (rest % 26) as u8));
        if rest < 26 {
            return format!("({name})");
        }
        rest = rest / 26 - 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_go_on_after_z() {
        assert_eq!(letter(0), "(a)");
        assert_eq!(letter(25), "(z)");
        assert_eq!(letter(26), "(aa)");
        assert_eq!(letter(27), "(ab)");
    }
}
