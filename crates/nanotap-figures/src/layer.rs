//! The items drawn inside a panel.

use serde::{Deserialize, Serialize};

use crate::axis::Axis;
use crate::colour::{Colour, Colourmap};
use crate::numbers;

/// Dash pattern of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Dash {
    /// Drawn without gaps.
    #[default]
    Solid,
    /// Drawn as dashes.
    Dashed,
    /// Drawn as dots.
    Dotted,
    /// Drawn as dashes and dots alternately.
    DashDot,
}

impl Dash {
    /// Lengths drawn and omitted alternately, mm, for a line of the given width in mm.
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Line {
    /// Corners, in the units of the axes.
    #[serde(with = "numbers::points")]
    pub points: Vec<(f64, f64)>,
    /// Dash pattern of the line.
    #[serde(default)]
    pub dash: Dash,
    /// Width of the line in points (1/72 inch).
    pub width: f64,
    /// Colour; `None`: the next one of the palette.
    pub colour: Option<Colour>,
    /// Text in the legend; empty: no entry.
    #[serde(default)]
    pub label: String,
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
}

/// Very many equal dots. A hundred thousand or more remain sharp and small on disk, because vector
/// formats contain them as pixels of 600 dots per inch (up to 3000 dots as vectors).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
// The name of the points is the same in every kind of layer.
#[allow(clippy::struct_field_names)]
pub struct Points {
    /// Centres, in the units of the axes.
    #[serde(with = "numbers::points")]
    pub points: Vec<(f64, f64)>,
    /// Diameter of each dot, mm.
    pub diameter: f64,
    /// Colour; `None`: the next one of the palette. A translucent colour makes the density visible.
    pub colour: Option<Colour>,
    /// Text in the legend; empty: no entry.
    #[serde(default)]
    pub label: String,
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

    /// Sets the diameter of each dot, mm.
    pub fn diameter(mut self, mm: f64) -> Points {
        self.diameter = mm;
        self
    }
}

/// Markers at a few points, with one shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Markers {
    /// Centres, in the units of the axes.
    #[serde(with = "numbers::points")]
    pub points: Vec<(f64, f64)>,
    /// Shape of all markers of the layer.
    #[serde(default)]
    pub shape: Shape,
    /// Size of each marker, mm; the diameter of a circle.
    pub size: f64,
    /// Whether the markers are white inside instead of filled.
    #[serde(default)]
    pub open: bool,
    /// Whether each marker has a white edge.
    #[serde(default)]
    pub edge: bool,
    /// Colour; `None`: the next one of the palette.
    pub colour: Option<Colour>,
    /// Text in the legend; empty: no entry.
    #[serde(default)]
    pub label: String,
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

    /// Sets the shape of all markers.
    pub fn shape(mut self, shape: Shape) -> Markers {
        self.shape = shape;
        self
    }

    /// Sets the size of each marker, mm.
    pub fn size(mut self, mm: f64) -> Markers {
        self.size = mm;
        self
    }

    /// Makes the markers white inside instead of filled; used for unstable motions.
    pub fn open(mut self) -> Markers {
        self.open = true;
        self
    }

    /// Gives each marker a white edge, for contrast on a heatmap.
    pub fn white_edge(mut self) -> Markers {
        self.edge = true;
        self
    }
}

/// A straight line across the whole panel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Rule {
    /// The x of a vertical line, the y of a horizontal one, in the unit of the axis.
    pub at: f64,
    /// Whether the line is vertical.
    pub upright: bool,
    /// Dash pattern of the line.
    pub dash: Dash,
    /// Width of the line in points (1/72 inch).
    pub width: f64,
    /// Colour of the line; `None`: grey.
    pub colour: Option<Colour>,
    /// Text in the legend; empty: no entry.
    #[serde(default)]
    pub label: String,
}

impl Rule {
    fn new(at: f64, upright: bool) -> Rule {
        Rule {
            at,
            upright,
            dash: Dash::Dashed,
            width: 0.6,
            colour: Some(Colour::rgb(90, 90, 90)),
            label: String::new(),
        }
    }

    /// A horizontal line at the height `y`: dashed, grey, 0.6 pt.
    pub fn horizontal(y: f64) -> Rule {
        Rule::new(y, false)
    }

    /// A vertical line at `x`: dashed, grey, 0.6 pt.
    pub fn vertical(x: f64) -> Rule {
        Rule::new(x, true)
    }
}

/// Intervals of an axis shaded behind the data, such as the times in contact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Band {
    /// Start and end of each interval; an end that is not a number is the panel's edge.
    #[serde(deserialize_with = "numbers::intervals")]
    pub intervals: Vec<(f64, f64)>,
    /// Whether the intervals are those of the horizontal axis.
    pub along_x: bool,
    /// Colour of the intervals; `None`: light grey.
    pub colour: Option<Colour>,
    /// Text in the legend; empty: no entry.
    #[serde(default)]
    pub label: String,
}

impl Band {
    /// Shades intervals of the horizontal axis, light grey. Infinite ends reach the panel's edge.
    pub fn x(intervals: impl IntoIterator<Item = (f64, f64)>) -> Band {
        Band {
            intervals: intervals.into_iter().collect(),
            along_x: true,
            colour: Some(Colour::LIGHT_GREY),
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

    /// Shades the pixels of a line for which `holds` is true, each `width` wide, the first from 0;
    /// neighbours are one band. `None` if it holds for none.
    ///
    /// ```
    /// use nanotap_figures::Band;
    ///
    /// let band = Band::of_pixels([true, true, false, true], 2.0).unwrap();
    /// assert_eq!(band.intervals, [(0.0, 4.0), (6.0, 8.0)]);
    /// ```
    pub fn of_pixels(holds: impl IntoIterator<Item = bool>, width: f64) -> Option<Band> {
        let mut intervals: Vec<(f64, f64)> = Vec::new();
        let mut before = false;
        for (k, holds) in holds.into_iter().enumerate() {
            let (from, to) = (width * k as f64, width * (k + 1) as f64);
            match intervals.last_mut() {
                Some(last) if holds && before => last.1 = to,
                _ if holds => intervals.push((from, to)),
                _ => {}
            }
            before = holds;
        }
        (!intervals.is_empty()).then(|| Band::x(intervals))
    }
}

/// A place in a panel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// In the units of the axes.
    Data(f64, f64),
    /// Relative to the panel: (0, 0) bottom left, (1, 1) top right.
    Panel(f64, f64),
}

impl From<(f64, f64)> for Place {
    fn from((x, y): (f64, f64)) -> Place {
        Place::Data(x, y)
    }
}

/// Position of a text relative to its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum Side {
    #[default]
    Right,
    Left,
    Above,
    Below,
    Centre,
}

/// Text in a panel, with or without an arrow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Note {
    /// Position of the text, and start of the arrow.
    pub at: Place,
    /// Text of the note; may contain markup.
    pub text: String,
    /// Side of the place on which the text lies.
    #[serde(default)]
    pub side: Side,
    /// End of the arrow; `None`: no arrow.
    pub tip: Option<Place>,
    /// Colour of text and arrow; `None`: black.
    pub colour: Option<Colour>,
}

impl Note {
    /// Text at a place, to its right.
    pub fn new(at: impl Into<Place>, text: impl Into<String>) -> Note {
        Note {
            at: at.into(),
            text: text.into(),
            side: Side::Right,
            tip: None,
            colour: Some(Colour::BLACK),
        }
    }

    /// An arrow from one place to another; its text is at the start.
    pub fn arrow(from: impl Into<Place>, to: impl Into<Place>) -> Note {
        Note {
            tip: Some(to.into()),
            ..Note::new(from, "")
        }
    }

    /// Sets the text of the note.
    pub fn text(mut self, text: impl Into<String>) -> Note {
        self.text = text.into();
        self
    }

    /// Sets the side of the place on which the text lies.
    pub fn side(mut self, side: Side) -> Note {
        self.side = side;
        self
    }
}

/// A grid of numbers shown as colours, with a colour bar. NaN is white.
///
/// Cells are drawn with equal size, also on logarithmic axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Heatmap {
    /// Number of cells along x.
    pub columns: usize,
    /// Number of cells along y.
    pub rows: usize,
    /// Values, row by row, in the unit of `scale`, `rows` × `columns` of them; the row of the
    /// smallest y comes first; NaN is white.
    #[serde(deserialize_with = "numbers::gaps")]
    pub values: Vec<f64>,
    /// Outer edges of the grid along x, in the unit of the horizontal axis.
    pub x: (f64, f64),
    /// Outer edges of the grid along y, in the unit of the vertical axis.
    pub y: (f64, f64),
    /// The axis of the colour bar.
    pub scale: Axis,
    /// Colour scale from the smallest to the largest value.
    #[serde(default)]
    pub map: Colourmap,
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

    /// Sets the colour scale; the default is viridis.
    pub fn colourmap(mut self, map: Colourmap) -> Heatmap {
        self.map = map;
        self
    }
}

/// A category of a [`CategoryMap`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Category {
    /// Text of the category in the legend.
    pub label: String,
    /// Colour of the cells; `None`: the palette's next colour.
    pub colour: Option<Colour>,
}

/// A grid of categories shown as colours, such as basins of attraction, with a legend.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct CategoryMap {
    /// Number of cells along x.
    pub columns: usize,
    /// Number of cells along y.
    pub rows: usize,
    /// Numbers of categories, from 0, row by row; the row of the smallest y comes first; `None` is
    /// white.
    pub cells: Vec<Option<usize>>,
    /// Outer edges of the grid along x, in the unit of the horizontal axis.
    pub x: (f64, f64),
    /// Outer edges of the grid along y, in the unit of the vertical axis.
    pub y: (f64, f64),
    /// The categories in the order of their numbers.
    pub categories: Vec<Category>,
}

impl CategoryMap {
    /// `cells` has `rows` rows of `columns` category numbers (from 0; `None` is white); the row of
    /// the smallest y comes first. The outer edges of the grid are `x` and `y`. Name the categories
    /// in order with [`CategoryMap::category`].
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
            categories: Vec::new(),
        }
    }

    /// Names the next category, in the next colour of the palette.
    pub fn category(mut self, label: impl Into<String>) -> CategoryMap {
        self.categories.push(Category {
            label: label.into(),
            colour: None,
        });
        self
    }

    /// Names the next category and sets its colour (grey for "undecided", for example).
    pub fn category_in(mut self, label: impl Into<String>, colour: Colour) -> CategoryMap {
        self.categories.push(Category {
            label: label.into(),
            colour: Some(colour),
        });
        self
    }
}

/// Thin vertical lines with a dot on top, as in spectra.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Stems {
    /// The dots, in the units of the axes.
    #[serde(with = "numbers::points")]
    pub points: Vec<(f64, f64)>,
    /// The y of the feet of the stems, in the unit of the vertical axis; `None`: 0, or the bottom
    /// of a logarithmic axis.
    pub foot: Option<f64>,
    /// Colour; `None`: the next one of the palette.
    pub colour: Option<Colour>,
    /// Text in the legend; empty: no entry.
    #[serde(default)]
    pub label: String,
}

impl Stems {
    /// Stems with their feet at 0, or at the bottom of a logarithmic axis.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Stems {
        Stems {
            points: points.into_iter().collect(),
            foot: None,
            colour: None,
            label: String::new(),
        }
    }

    /// Sets the y of the feet.
    pub fn foot(mut self, y: f64) -> Stems {
        self.foot = Some(y);
        self
    }
}

/// Vertical bars of equal width.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Bars {
    /// Middle (x) and end (y) of each bar.
    #[serde(with = "numbers::points")]
    pub points: Vec<(f64, f64)>,
    /// Width in units of the horizontal axis.
    pub width: f64,
    /// Colour; `None`: the next one of the palette.
    pub colour: Option<Colour>,
    /// Text in the legend; empty: no entry.
    #[serde(default)]
    pub label: String,
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
}

/// Any item of a panel. Maps and bands lie behind the rest, notes in front of it; otherwise later
/// layers lie over earlier ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
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

/// Methods that several kinds of layers share.
macro_rules! shared {
    (colour: $($kind:ident)*) => {$(
        impl $kind {
            /// Sets the colour of the layer.
            pub fn colour(mut self, colour: Colour) -> $kind {
                self.colour = Some(colour);
                self
            }
        }
    )*};
    (label: $($kind:ident)*) => {$(
        impl $kind {
            /// Sets the text of the layer in the legend.
            pub fn label(mut self, label: impl Into<String>) -> $kind {
                self.label = label.into();
                self
            }
        }
    )*};
    (line: $($kind:ident)*) => {$(
        impl $kind {
            /// Sets the dash pattern of the line.
            pub fn dash(mut self, dash: Dash) -> $kind {
                self.dash = dash;
                self
            }

            /// Sets the width of the line in points (1/72 inch).
            pub fn width(mut self, points: f64) -> $kind {
                self.width = points;
                self
            }
        }
    )*};
    (layer: $($kind:ident)*) => {$(
        impl From<$kind> for Layer {
            fn from(layer: $kind) -> Layer {
                Layer::$kind(layer)
            }
        }
    )*};
}

shared!(colour: Line Points Markers Rule Band Note Stems Bars);
shared!(label: Line Points Markers Rule Band Stems Bars);
shared!(line: Line Rule);
shared!(layer: Line Points Markers Rule Band Note Heatmap CategoryMap Stems Bars);

impl Layer {
    /// The points of layers that hold points.
    pub(crate) fn points(&self) -> &[(f64, f64)] {
        match self {
            Layer::Line(l) => &l.points,
            Layer::Points(l) => &l.points,
            Layer::Markers(l) => &l.points,
            Layer::Stems(l) => &l.points,
            Layer::Bars(l) => &l.points,
            _ => &[],
        }
    }

    /// The colour of the layer, for setting it; none for maps.
    pub(crate) fn colour_mut(&mut self) -> Option<&mut Option<Colour>> {
        match self {
            Layer::Line(Line { colour, .. })
            | Layer::Points(Points { colour, .. })
            | Layer::Markers(Markers { colour, .. })
            | Layer::Stems(Stems { colour, .. })
            | Layer::Bars(Bars { colour, .. })
            | Layer::Rule(Rule { colour, .. })
            | Layer::Band(Band { colour, .. })
            | Layer::Note(Note { colour, .. }) => Some(colour),
            Layer::Heatmap(_) | Layer::CategoryMap(_) => None,
        }
    }

    /// The layer's colour, once set, and its text in the legend; none for maps and notes.
    pub(crate) fn look(&self) -> Option<(Colour, &str)> {
        match self {
            Layer::Line(Line { colour, label, .. })
            | Layer::Points(Points { colour, label, .. })
            | Layer::Markers(Markers { colour, label, .. })
            | Layer::Stems(Stems { colour, label, .. })
            | Layer::Bars(Bars { colour, label, .. })
            | Layer::Rule(Rule { colour, label, .. })
            | Layer::Band(Band { colour, label, .. }) => {
                Some((colour.unwrap_or(Colour::BLACK), label))
            }
            Layer::Note(_) | Layer::Heatmap(_) | Layer::CategoryMap(_) => None,
        }
    }

    /// Position in the order of drawing, from the back.
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
