//! The items on the page, in millimetres from its top left. All formats draw these.

use crate::cloud::Cloud;
use crate::colour::Colour;
use crate::raster::Raster;
use crate::shape::{Path, Point, Rect, Segment, Stroke};
use crate::text::PlacedWords;

#[derive(Debug, Clone)]
pub(crate) enum Item {
    /// Groups the items up to its `Close`: a class, and a text that describes it.
    Open {
        class: &'static str,
        label: String,
    },
    Close,
    Path(Path),
    Words(PlacedWords),
    Raster(Raster),
    Cloud(Cloud),
}

/// A page with all its shapes and texts placed; lengths in mm.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(crate) title: String,
    pub(crate) items: Vec<Item>,
}

impl Scene {
    pub(crate) fn group(
        &mut self,
        class: &'static str,
        label: &str,
        draw: impl FnOnce(&mut Scene),
    ) {
        self.items.push(Item::Open {
            class,
            label: label.to_string(),
        });
        draw(self);
        self.items.push(Item::Close);
    }

    pub(crate) fn fill(&mut self, segments: Vec<Segment>, colour: Colour, clip: Option<Rect>) {
        self.path(Path {
            segments,
            fill: Some(colour),
            stroke: None,
            clip,
        });
    }

    pub(crate) fn stroke(&mut self, segments: Vec<Segment>, stroke: Stroke, clip: Option<Rect>) {
        self.path(Path {
            segments,
            fill: None,
            stroke: Some(stroke),
            clip,
        });
    }

    fn path(&mut self, path: Path) {
        if !path.segments.is_empty() {
            self.items.push(Item::Path(path));
        }
    }

    pub(crate) fn line(&mut self, from: Point, to: Point, stroke: Stroke) {
        self.stroke(vec![Segment::Move(from), Segment::Line(to)], stroke, None);
    }

    pub(crate) fn words(&mut self, words: PlacedWords) {
        if !words.words.runs.is_empty() {
            self.items.push(Item::Words(words));
        }
    }
}
