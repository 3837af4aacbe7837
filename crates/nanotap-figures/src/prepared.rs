//! A panel with everything resolved that does not depend on its size.

use crate::axis::{Axis, Extent, Scale, View};
use crate::colour::{self, Colour};
use crate::layer::{Dash, Layer, Rule, Shape};
use crate::panel::Panel;
use crate::resolve;
use crate::shape::{Point, Rect};
use crate::text::MM_PER_POINT;

/// The sample that a legend shows next to a label.
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
    pub(crate) letter: &'a str,
    pub(crate) x: View,
    pub(crate) y: View,
    /// Whether nothing can be drawn.
    pub(crate) empty: bool,
    /// Whether the labels of the horizontal axis are shown.
    pub(crate) words_below: bool,
    pub(crate) entries: Vec<Entry>,
    pub(crate) bars: Vec<ColourBar<'a>>,
}

/// The scale of a heatmap.
pub(crate) struct ColourBar<'a> {
    pub(crate) axis: &'a Axis,
    pub(crate) view: View,
    pub(crate) map: colour::Colourmap,
}

/// A panel's position on the page.
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

    /// The ends of a rule, from the left or the bottom.
    pub(crate) fn rule(&self, rule: &Rule) -> Option<(Point, Point)> {
        let rect = self.rect;
        if rule.upright {
            let x = self.across(rule.at)?;
            Some((Point::new(x, rect.bottom), Point::new(x, rect.top)))
        } else {
            let y = self.upright(rule.at)?;
            Some((Point::new(rect.left, y), Point::new(rect.right, y)))
        }
    }

    pub(crate) fn place(&self, (x, y): (f64, f64)) -> Option<Point> {
        Some(Point::new(self.across(x)?, self.upright(y)?))
    }
}

impl<'a> Prepared<'a> {
    /// Measures axes, legend and colour bars of a panel whose colours and letter are resolved.
    pub(crate) fn new(panel: &'a Panel, words_below: bool) -> Prepared<'a> {
        let bars = panel
            .layers
            .iter()
            .filter_map(|layer| match layer {
                Layer::Heatmap(map) => Some(ColourBar {
                    axis: &map.scale,
                    view: map.scale.view(Extent::EMPTY),
                    map: map.map,
                }),
                _ => None,
            })
            .collect();
        Prepared {
            panel,
            letter: panel.letter.as_deref().unwrap_or_default(),
            x: panel.x.view(Extent::EMPTY),
            y: panel.y.view(Extent::EMPTY),
            empty: !resolve::extents(panel).2,
            words_below,
            entries: entries(&panel.layers),
            bars,
        }
    }

    pub(crate) fn frame(&self, rect: Rect) -> Frame {
        Frame {
            rect,
            x: self.x,
            y: self.y,
        }
    }

    /// The y of the feet of stems and bars of a layer.
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

/// The legend's entries; layers with the same label and look share one.
fn entries(layers: &[Layer]) -> Vec<Entry> {
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
    let line = |width: f64, dash: Dash| Sample::Line {
        width: width * MM_PER_POINT,
        dash,
    };
    for layer in layers {
        let sample = match layer {
            Layer::Line(l) => line(l.width, l.dash),
            Layer::Rule(l) => line(l.width, l.dash),
            Layer::Points(l) => Sample::Dot {
                diameter: l.diameter.max(0.8),
            },
            Layer::Markers(l) => Sample::Marker {
                shape: l.shape,
                size: l.size,
                open: l.open,
            },
            Layer::Band(_) | Layer::Bars(_) => Sample::Area,
            Layer::Stems(_) => Sample::Stem,
            Layer::CategoryMap(map) => {
                for one in &map.categories {
                    let colour = one.colour.unwrap_or(Colour::GREY);
                    add(&one.label, colour, Sample::Area);
                }
                continue;
            }
            Layer::Heatmap(_) | Layer::Note(_) => continue,
        };
        if let Some((mut colour, label)) = layer.look() {
            if matches!(layer, Layer::Points(_)) {
                // A legend's dot must be visible, however faint a single dot of the cloud is.
                colour.a = 255;
            }
            add(label, colour, sample);
        }
    }
    all
}
