//! Points, boxes, lines and outlines, in millimetres from the page's top left.

use crate::colour::Colour;

/// A length in mm as whole micrometres, the grid on which every format draws.
pub(crate) fn micrometres(length: f64) -> i64 {
    (length * 1000.0).round() as i64
}

/// A length in mm, rounded to micrometres.
pub(crate) fn on_grid(length: f64) -> f32 {
    micrometres(length) as f32 / 1000.0
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    pub(crate) x: f64,
    pub(crate) y: f64,
}

impl Point {
    pub(crate) const fn new(x: f64, y: f64) -> Point {
        Point { x, y }
    }

    pub(crate) fn distance(self, other: Point) -> f64 {
        libm::hypot(self.x - other.x, self.y - other.y)
    }
}

/// A box given by its edges, `left <= right` and `top <= bottom`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rect {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) right: f64,
    pub(crate) bottom: f64,
}

impl Rect {
    pub(crate) fn width(self) -> f64 {
        self.right - self.left
    }

    pub(crate) fn height(self) -> f64 {
        self.bottom - self.top
    }

    /// The box with every edge moved outwards by `by`.
    pub(crate) fn grown(self, by: f64) -> Rect {
        Rect {
            left: self.left - by,
            top: self.top - by,
            right: self.right + by,
            bottom: self.bottom + by,
        }
    }

    pub(crate) fn contains(self, p: Point) -> bool {
        p.x >= self.left && p.x <= self.right && p.y >= self.top && p.y <= self.bottom
    }

    pub(crate) fn outline(self) -> Vec<Segment> {
        vec![
            Segment::Move(Point::new(self.left, self.top)),
            Segment::Line(Point::new(self.right, self.top)),
            Segment::Line(Point::new(self.right, self.bottom)),
            Segment::Line(Point::new(self.left, self.bottom)),
            Segment::Close,
        ]
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Segment {
    Move(Point),
    Line(Point),
    Quad(Point, Point),
    Cubic(Point, Point, Point),
    Close,
}

impl Segment {
    pub(crate) fn map(self, mut f: impl FnMut(Point) -> Point) -> Segment {
        match self {
            Segment::Move(p) => Segment::Move(f(p)),
            Segment::Line(p) => Segment::Line(f(p)),
            Segment::Quad(a, p) => Segment::Quad(f(a), f(p)),
            Segment::Cubic(a, b, p) => Segment::Cubic(f(a), f(b), f(p)),
            Segment::Close => Segment::Close,
        }
    }
}

/// Style of a line. Lengths in mm.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stroke {
    pub(crate) width: f64,
    pub(crate) colour: Colour,
    /// Lengths drawn and omitted alternately; empty: solid.
    pub(crate) dash: Vec<f64>,
    /// Whether the ends are rounded instead of cut.
    pub(crate) round: bool,
}

impl Stroke {
    pub(crate) fn solid(width: f64, colour: Colour) -> Stroke {
        Stroke {
            width,
            colour,
            dash: Vec::new(),
            round: false,
        }
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Path {
    pub(crate) segments: Vec<Segment>,
    pub(crate) fill: Option<Colour>,
    pub(crate) stroke: Option<Stroke>,
    /// Box outside which nothing is drawn.
    pub(crate) clip: Option<Rect>,
}

impl Path {
    /// Whether vector formats should contain the path as pixels: long lines that thinning could not
    /// shorten fill the panel.
    pub(crate) fn is_heavy(&self) -> bool {
        self.segments.len() > 30_000 && self.fill.is_none() && self.clip.is_some()
    }
}
