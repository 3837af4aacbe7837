//! What is drawn inside a panel.

use crate::axis::Axis;
use crate::colour::{Colour, Colourmap};

/// How a line is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dash {
    /// Unbroken.
    #[default]
    Solid,
    /// Dashes.
    Dashed,
    /// Dots.
    Dotted,
    /// Dashes and dots in turn.
    DashDot,
}

impl Dash {
    /// Lengths drawn and left out in turn, mm, for a line of the given width in mm.
    pub(crate) fn lengths(self, width: f64) -> Vec<f64> {
        let unit = width.max(0.2);
        let pattern: &[f64] = match self {
            Dash::Solid => &[],
            Dash::Dashed => &[4.0, 2.2],
            Dash::Dotted => &[1.0, 1.6],
            Dash::DashDot => &[5.0, 1.8, 1.2, 1.8],
        };
        pattern.iter().map(|part| part * unit).collect()
    }
}

/// The shape of a marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(missing_docs)]
pub enum Shape {
    #[default]
    Circle,
    Square,
    Triangle,
    Diamond,
    Cross,
    Plus,
}

/// A line through points. Points that are not finite (or not positive, on a logarithmic axis) leave
/// a gap. Long lines are thinned without visible change.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Line {
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) dash: Dash,
    pub(crate) width: f64,
    pub(crate) colour: Option<Colour>,
    pub(crate) label: String,
}

impl Line {
    /// A solid line of 0.9 pt in the panel's next colour.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Line {
        Line {
            points: points.into_iter().collect(),
            dash: Dash::Solid,
            width: 0.9,
            colour: None,
            label: String::new(),
        }
    }

    /// Breaks the line.
    pub fn dash(mut self, dash: Dash) -> Line {
        self.dash = dash;
        self
    }

    /// Width in points (1/72 inch).
    pub fn width(mut self, points: f64) -> Line {
        self.width = points;
        self
    }

    /// Colour instead of the panel's next.
    pub fn colour(mut self, colour: Colour) -> Line {
        self.colour = Some(colour);
        self
    }

    /// Words in the legend.
    pub fn label(mut self, label: impl Into<String>) -> Line {
        self.label = label.into();
        self
    }
}

/// Very many equal dots: a hundred thousand and more stay crisp and small on disk, because vector
/// formats hold them as pixels of 600 dots per inch (up to 3000 dots as vectors).
#[derive(Debug, Clone, PartialEq)]
#[must_use]
// Every kind of layer calls its points so.
#[allow(clippy::struct_field_names)]
pub struct Points {
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) diameter: f64,
    pub(crate) colour: Option<Colour>,
    pub(crate) label: String,
}

impl Points {
    /// Dots of 0.2 mm in the panel's next colour.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Points {
        Points {
            points: points.into_iter().collect(),
            diameter: 0.2,
            colour: None,
            label: String::new(),
        }
    }

    /// Diameter in mm.
    pub fn diameter(mut self, mm: f64) -> Points {
        self.diameter = mm;
        self
    }

    /// Colour instead of the panel's next; where it is translucent, density shows.
    pub fn colour(mut self, colour: Colour) -> Points {
        self.colour = Some(colour);
        self
    }

    /// Words in the legend.
    pub fn label(mut self, label: impl Into<String>) -> Points {
        self.label = label.into();
        self
    }
}

/// A few large marks.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Markers {
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) shape: Shape,
    pub(crate) size: f64,
    pub(crate) open: bool,
    pub(crate) edge: bool,
    pub(crate) colour: Option<Colour>,
    pub(crate) label: String,
}

impl Markers {
    /// Filled circles of 1.5 mm in the panel's next colour.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Markers {
        Markers {
            points: points.into_iter().collect(),
            shape: Shape::Circle,
            size: 1.5,
            open: false,
            edge: false,
            colour: None,
            label: String::new(),
        }
    }

    /// Another shape.
    pub fn shape(mut self, shape: Shape) -> Markers {
        self.shape = shape;
        self
    }

    /// Size in mm.
    pub fn size(mut self, mm: f64) -> Markers {
        self.size = mm;
        self
    }

    /// White inside instead of filled, as unstable motions are drawn.
    pub fn open(mut self) -> Markers {
        self.open = true;
        self
    }

    /// A white edge around each, to stand out from a heatmap.
    pub fn white_edge(mut self) -> Markers {
        self.edge = true;
        self
    }

    /// Colour instead of the panel's next.
    pub fn colour(mut self, colour: Colour) -> Markers {
        self.colour = Some(colour);
        self
    }

    /// Words in the legend.
    pub fn label(mut self, label: impl Into<String>) -> Markers {
        self.label = label.into();
        self
    }
}

/// A straight line across the whole panel.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Rule {
    pub(crate) at: f64,
    pub(crate) upright: bool,
    pub(crate) dash: Dash,
    pub(crate) width: f64,
    pub(crate) colour: Colour,
    pub(crate) label: String,
}

impl Rule {
    fn new(at: f64, upright: bool) -> Rule {
        Rule {
            at,
            upright,
            dash: Dash::Dashed,
            width: 0.6,
            colour: Colour::rgb(90, 90, 90),
            label: String::new(),
        }
    }

    /// A level line at the height `y`: dashed, grey, 0.6 pt.
    pub fn horizontal(y: f64) -> Rule {
        Rule::new(y, false)
    }

    /// An upright line at `x`: dashed, grey, 0.6 pt.
    pub fn vertical(x: f64) -> Rule {
        Rule::new(x, true)
    }

    /// Breaks the line otherwise.
    pub fn dash(mut self, dash: Dash) -> Rule {
        self.dash = dash;
        self
    }

    /// Width in points.
    pub fn width(mut self, points: f64) -> Rule {
        self.width = points;
        self
    }

    /// Another colour.
    pub fn colour(mut self, colour: Colour) -> Rule {
        self.colour = colour;
        self
    }

    /// Words in the legend.
    pub fn label(mut self, label: impl Into<String>) -> Rule {
        self.label = label.into();
        self
    }
}

/// Intervals of an axis shaded behind the data, such as the times in contact.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Band {
    pub(crate) intervals: Vec<(f64, f64)>,
    pub(crate) along_x: bool,
    pub(crate) colour: Colour,
    pub(crate) label: String,
}

impl Band {
    /// Shades intervals of the horizontal axis, light grey. Infinite ends reach the panel's edge.
    pub fn x(intervals: impl IntoIterator<Item = (f64, f64)>) -> Band {
        Band {
            intervals: intervals.into_iter().collect(),
            along_x: true,
            colour: Colour::LIGHT_GREY,
            label: String::new(),
        }
    }

    /// Shades intervals of the vertical axis, light grey. Infinite ends reach the panel's edge.
    pub fn y(intervals: impl IntoIterator<Item = (f64, f64)>) -> Band {
        Band {
            along_x: false,
            ..Band::x(intervals)
        }
    }

    /// Another colour.
    pub fn colour(mut self, colour: Colour) -> Band {
        self.colour = colour;
        self
    }

    /// Words in the legend.
    pub fn label(mut self, label: impl Into<String>) -> Band {
        self.label = label.into();
        self
    }
}

/// A place in a panel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// In the units of the axes.
    Data(f64, f64),
    /// In parts of the panel: (0, 0) bottom left, (1, 1) top right.
    Panel(f64, f64),
}

impl From<(f64, f64)> for Place {
    fn from((x, y): (f64, f64)) -> Place {
        Place::Data(x, y)
    }
}

/// Where words lie as seen from their place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(missing_docs)]
pub enum Side {
    #[default]
    Right,
    Left,
    Above,
    Below,
    Centre,
}

/// Words in a panel, with or without an arrow.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Note {
    pub(crate) at: Place,
    pub(crate) text: String,
    pub(crate) side: Side,
    pub(crate) tip: Option<Place>,
    pub(crate) colour: Colour,
}

impl Note {
    /// Words at a place, to its right.
    pub fn new(at: impl Into<Place>, text: impl Into<String>) -> Note {
        Note {
            at: at.into(),
            text: text.into(),
            side: Side::Right,
            tip: None,
            colour: Colour::BLACK,
        }
    }

    /// An arrow from a place to another; words go to its start.
    pub fn arrow(from: impl Into<Place>, to: impl Into<Place>) -> Note {
        Note {
            tip: Some(to.into()),
            ..Note::new(from, "")
        }
    }

    /// The words.
    pub fn text(mut self, text: impl Into<String>) -> Note {
        self.text = text.into();
        self
    }

    /// Where the words lie as seen from their place.
    pub fn side(mut self, side: Side) -> Note {
        self.side = side;
        self
    }

    /// Another colour than black.
    pub fn colour(mut self, colour: Colour) -> Note {
        self.colour = colour;
        self
    }
}

/// A grid of numbers as colours, with a colour bar. NaN stays white.
///
/// Cells are of equal size as drawn, also on logarithmic axes.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Heatmap {
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    pub(crate) values: Vec<f64>,
    pub(crate) x: (f64, f64),
    pub(crate) y: (f64, f64),
    pub(crate) scale: Axis,
    pub(crate) map: Colourmap,
}

impl Heatmap {
    /// `values` holds `rows` rows of `columns` numbers, the row of the smallest y first; the outer
    /// edges of the grid are `x` and `y`. `scale` labels the colour bar.
    pub fn new(
        columns: usize,
        rows: usize,
        values: impl IntoIterator<Item = f64>,
        x: (f64, f64),
        y: (f64, f64),
        scale: Axis,
    ) -> Heatmap {
        Heatmap {
            columns,
            rows,
            values: values.into_iter().collect(),
            x,
            y,
            scale,
            map: Colourmap::Viridis,
        }
    }

    /// Another colour scale than viridis.
    pub fn colourmap(mut self, map: Colourmap) -> Heatmap {
        self.map = map;
        self
    }
}

/// A grid of categories as colours, such as basins of attraction, with a legend.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct CategoryMap {
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    pub(crate) cells: Vec<Option<usize>>,
    pub(crate) x: (f64, f64),
    pub(crate) y: (f64, f64),
    pub(crate) names: Vec<(String, Option<Colour>)>,
}

impl CategoryMap {
    /// `cells` holds `rows` rows of `columns` category numbers (from 0; none stays white), the row
    /// of the smallest y first; the outer edges of the grid are `x` and `y`. Categories are named
    /// with [`CategoryMap::category`] in order.
    pub fn new(
        columns: usize,
        rows: usize,
        cells: impl IntoIterator<Item = Option<usize>>,
        x: (f64, f64),
        y: (f64, f64),
    ) -> CategoryMap {
        CategoryMap {
            columns,
            rows,
            cells: cells.into_iter().collect(),
            x,
            y,
            names: Vec::new(),
        }
    }

    /// Names the next category, in the next colour of the palette.
    pub fn category(mut self, name: impl Into<String>) -> CategoryMap {
        self.names.push((name.into(), None));
        self
    }

    /// Names the next category, in a colour of its own (grey for "undecided", say).
    pub fn category_in(mut self, name: impl Into<String>, colour: Colour) -> CategoryMap {
        self.names.push((name.into(), Some(colour)));
        self
    }
}

/// Thin upright lines with a dot on top, as spectra are drawn.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Stems {
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) foot: Option<f64>,
    pub(crate) colour: Option<Colour>,
    pub(crate) label: String,
}

impl Stems {
    /// Stems that stand on 0, or on the bottom of a logarithmic axis.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Stems {
        Stems {
            points: points.into_iter().collect(),
            foot: None,
            colour: None,
            label: String::new(),
        }
    }

    /// Stands on another value.
    pub fn foot(mut self, y: f64) -> Stems {
        self.foot = Some(y);
        self
    }

    /// Colour instead of the panel's next.
    pub fn colour(mut self, colour: Colour) -> Stems {
        self.colour = Some(colour);
        self
    }

    /// Words in the legend.
    pub fn label(mut self, label: impl Into<String>) -> Stems {
        self.label = label.into();
        self
    }
}

/// Upright bars.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Bars {
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) width: f64,
    pub(crate) colour: Option<Colour>,
    pub(crate) label: String,
}

impl Bars {
    /// Bars of `width` (in units of the horizontal axis) around each x, from 0 (or the bottom of a
    /// logarithmic axis) to each y.
    pub fn new(width: f64, points: impl IntoIterator<Item = (f64, f64)>) -> Bars {
        Bars {
            points: points.into_iter().collect(),
            width,
            colour: None,
            label: String::new(),
        }
    }

    /// Colour instead of the panel's next.
    pub fn colour(mut self, colour: Colour) -> Bars {
        self.colour = Some(colour);
        self
    }

    /// Words in the legend.
    pub fn label(mut self, label: impl Into<String>) -> Bars {
        self.label = label.into();
        self
    }
}

/// Anything that a panel shows. Maps and bands lie behind the rest, notes before it; otherwise later
/// layers lie over earlier ones.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum Layer {
    Line(Line),
    Points(Points),
    Markers(Markers),
    Rule(Rule),
    Band(Band),
    Note(Note),
    Heatmap(Heatmap),
    CategoryMap(CategoryMap),
    Stems(Stems),
    Bars(Bars),
}

macro_rules! into_layer {
    ($($kind:ident),*) => {$(
        impl From<$kind> for Layer {
            fn from(layer: $kind) -> Layer {
                Layer::$kind(layer)
            }
        }
    )*};
}

into_layer!(
    Line,
    Points,
    Markers,
    Rule,
    Band,
    Note,
    Heatmap,
    CategoryMap,
    Stems,
    Bars
);

impl Layer {
    /// Whether the layer takes the panel's next colour.
    pub(crate) fn takes_colour(&self) -> bool {
        match self {
            Layer::Line(l) => l.colour.is_none(),
            Layer::Points(l) => l.colour.is_none(),
            Layer::Markers(l) => l.colour.is_none(),
            Layer::Stems(l) => l.colour.is_none(),
            Layer::Bars(l) => l.colour.is_none(),
            _ => false,
        }
    }

    /// Place in the order of drawing, from the back.
    pub(crate) fn depth(&self) -> u8 {
        match self {
            Layer::Heatmap(_) | Layer::CategoryMap(_) => 0,
            Layer::Band(_) => 1,
            Layer::Rule(_) => 2,
            Layer::Note(_) => 4,
            _ => 3,
        }
    }
}
