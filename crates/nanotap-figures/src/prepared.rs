//! A panel with everything decided that does not depend on its size.

use crate::axis::{Axis, Extent, Range, Scale, View};
use crate::colour::{self, Colour};
use crate::layer::{CategoryMap, Dash, Layer, Shape};
use crate::panel::Panel;
use crate::scene::{Point, Rect};
use crate::text::MM_PER_POINT;

/// What a legend shows beside a label.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Sample {
    Line { width: f64, dash: Dash },
    Dot { diameter: f64 },
    Marker { shape: Shape, size: f64, open: bool },
    Stem,
    Area,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    pub(crate) label: String,
    pub(crate) colour: Colour,
    pub(crate) sample: Sample,
}

pub(crate) struct Prepared<'a> {
    pub(crate) panel: &'a Panel,
    pub(crate) letter: String,
    pub(crate) x: View,
    pub(crate) y: View,
    /// Whether nothing can be drawn.
    pub(crate) empty: bool,
    /// Whether the horizontal axis shows its words.
    pub(crate) words_below: bool,
    /// The colour of each layer.
    pub(crate) colours: Vec<Colour>,
    pub(crate) entries: Vec<Entry>,
    pub(crate) bars: Vec<ColourBar<'a>>,
}

/// The scale of a heatmap.
pub(crate) struct ColourBar<'a> {
    pub(crate) axis: &'a Axis,
    pub(crate) view: View,
    pub(crate) map: colour::Colourmap,
}

/// A panel's place on the page.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) rect: Rect,
    pub(crate) x: View,
    pub(crate) y: View,
}

impl Frame {
    pub(crate) fn across(&self, x: f64) -> Option<f64> {
        self.x
            .share(x)
            .map(|share| self.rect.left + share * self.rect.width())
    }

    pub(crate) fn upright(&self, y: f64) -> Option<f64> {
        self.y
            .share(y)
            .map(|share| self.rect.bottom - share * self.rect.height())
    }

    pub(crate) fn place(&self, (x, y): (f64, f64)) -> Option<Point> {
        Some(Point::new(self.across(x)?, self.upright(y)?))
    }
}

/// Points of layers that hold points.
pub(crate) fn points_of(layer: &Layer) -> &[(f64, f64)] {
    match layer {
        Layer::Line(l) => &l.points,
        Layer::Points(l) => &l.points,
        Layer::Markers(l) => &l.points,
        Layer::Stems(l) => &l.points,
        Layer::Bars(l) => &l.points,
        _ => &[],
    }
}

/// How far a panel's layers reach along its axes, and whether there is anything to see.
pub(crate) fn extents(panel: &Panel) -> (Extent, Extent, bool) {
    let (mut x, mut y) = (Extent::EMPTY, Extent::EMPTY);
    let mut any = false;
    for layer in &panel.layers {
        let mut own = false;
        for &(px, py) in points_of(layer) {
            if panel.x.holds(px) && panel.y.holds(py) {
                own = true;
                x.add(px);
                y.add(py);
                if let Layer::Bars(bars) = layer {
                    for edge in [px - bars.width / 2.0, px + bars.width / 2.0] {
                        if panel.x.holds(edge) {
                            x.add(edge);
                        }
                    }
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
                    y.add_edge(foot);
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
                    extent.add(rule.at);
                }
            }
            _ => {}
        }
        any |= own;
    }
    (x, y, any)
}

fn add_area(x: &mut Extent, y: &mut Extent, across: (f64, f64), upright: (f64, f64)) {
    for edge in [across.0, across.1] {
        x.add_map(edge);
    }
    for edge in [upright.0, upright.1] {
        y.add_map(edge);
    }
}

impl<'a> Prepared<'a> {
    /// `x` is the extent of the horizontal axis, which panels may share.
    pub(crate) fn new(
        panel: &'a Panel,
        letter: String,
        x: Extent,
        words_below: bool,
    ) -> Prepared<'a> {
        let (_, y, any) = extents(panel);
        let mut taken = 0;
        let colours: Vec<Colour> = panel
            .layers
            .iter()
            .map(|layer| {
                if layer.takes_colour() {
                    taken += 1;
                    colour::LINES[(taken - 1) % colour::LINES.len()]
                } else {
                    own_colour(layer)
                }
            })
            .collect();
        let bars = panel
            .layers
            .iter()
            .filter_map(|layer| match layer {
                Layer::Heatmap(map) => {
                    let mut extent = Extent::EMPTY;
                    for &value in map.values.iter().filter(|v| map.scale.holds(**v)) {
                        extent.add_edge(value);
                    }
                    Some(ColourBar {
                        axis: &map.scale,
                        view: map.scale.view(extent),
                        map: map.map,
                    })
                }
                _ => None,
            })
            .collect();
        Prepared {
            panel,
            letter,
            x: panel.x.view(x),
            y: panel.y.view(y),
            empty: !any,
            words_below,
            entries: entries(&panel.layers, &colours),
            colours,
            bars,
        }
    }

    /// Whether an axis of an empty panel has marks: only if it was given a range.
    pub(crate) fn marked(&self, axis: &Axis) -> bool {
        !self.empty || matches!(axis.range, Range::Fixed(..)) || axis.marks.is_some()
    }

    pub(crate) fn frame(&self, rect: Rect) -> Frame {
        Frame {
            rect,
            x: self.x,
            y: self.y,
        }
    }

    /// Where stems and bars of a layer stand.
    pub(crate) fn foot(&self, layer: &Layer) -> f64 {
        let bottom = self.y.from;
        match layer {
            Layer::Stems(stems) => match stems.foot {
                Some(foot) if self.panel.y.holds(foot) => foot,
                _ if self.panel.y.scale == Scale::Log => bottom,
                _ => 0.0,
            },
            _ if self.panel.y.scale == Scale::Log => bottom,
            _ => 0.0,
        }
    }
}

/// The colour of a layer that has one.
fn own_colour(layer: &Layer) -> Colour {
    let given = match layer {
        Layer::Line(l) => l.colour,
        Layer::Points(l) => l.colour,
        Layer::Markers(l) => l.colour,
        Layer::Stems(l) => l.colour,
        Layer::Bars(l) => l.colour,
        Layer::Rule(l) => Some(l.colour),
        Layer::Band(l) => Some(l.colour),
        Layer::Note(l) => Some(l.colour),
        Layer::Heatmap(_) | Layer::CategoryMap(_) => None,
    };
    given.unwrap_or(Colour::BLACK)
}

/// The colour of a category.
pub(crate) fn category_colour(map: &CategoryMap, index: usize) -> Colour {
    let given = map.names.get(index).and_then(|(_, colour)| *colour);
    // A category with a colour of its own does not use one up.
    let before = map.names[..index.min(map.names.len())]
        .iter()
        .filter(|(_, colour)| colour.is_none())
        .count();
    given.unwrap_or_else(|| colour::category(before))
}

/// The legend's entries; layers of the same label and look share one.
fn entries(layers: &[Layer], colours: &[Colour]) -> Vec<Entry> {
    let mut all: Vec<Entry> = Vec::new();
    let mut add = |label: &str, colour: Colour, sample: Sample| {
        let entry = Entry {
            label: label.to_string(),
            colour,
            sample,
        };
        if !label.is_empty() && !all.contains(&entry) {
            all.push(entry);
        }
    };
    for (layer, &colour) in layers.iter().zip(colours) {
        match layer {
            Layer::Line(l) => add(
                &l.label,
                colour,
                Sample::Line {
                    width: l.width * MM_PER_POINT,
                    dash: l.dash,
                },
            ),
            Layer::Rule(l) => add(
                &l.label,
                colour,
                Sample::Line {
                    width: l.width * MM_PER_POINT,
                    dash: l.dash,
                },
            ),
            Layer::Points(l) => add(
                &l.label,
                // A legend's dot must be seen, however faint one dot of the cloud.
                Colour { a: 255, ..colour },
                Sample::Dot {
                    diameter: l.diameter.max(0.8),
                },
            ),
            Layer::Markers(l) => add(
                &l.label,
                colour,
                Sample::Marker {
                    shape: l.shape,
                    size: l.size,
                    open: l.open,
                },
            ),
            Layer::Band(l) => add(&l.label, colour, Sample::Area),
            Layer::Bars(l) => add(&l.label, colour, Sample::Area),
            Layer::Stems(l) => add(&l.label, colour, Sample::Stem),
            Layer::CategoryMap(map) => {
                for (index, (name, _)) in map.names.iter().enumerate() {
                    add(name, category_colour(map, index), Sample::Area);
                }
            }
            Layer::Heatmap(_) | Layer::Note(_) => {}
        }
    }
    all
}
