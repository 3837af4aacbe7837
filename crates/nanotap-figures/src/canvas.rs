//! What a page is drawn on: SVG, pixels or PDF.

use crate::pixels;
use crate::raster::{EMBEDDED_DPI, Raster};
use crate::scene::{Item, Scene};
use crate::shape::Path;
use crate::text::PlacedWords;

/// A page in one format, in millimetres from its top left. All formats round lengths to micrometres,
/// so that they show the same picture.
pub(crate) trait Canvas {
    /// Resolution of the page, dots per inch; `None` for a vector format.
    fn dpi(&self) -> Option<f64> {
        None
    }

    /// Opens a group of items: a class, and a text that describes it.
    fn open(&mut self, _class: &str, _label: &str) {}

    fn close(&mut self) {}

    fn path(&mut self, path: &Path);

    /// Draws a text as one shape.
    fn words(&mut self, words: &PlacedWords) {
        self.path(&Path {
            segments: words.outline(),
            fill: Some(words.colour),
            stroke: None,
            clip: None,
        });
    }

    fn raster(&mut self, raster: &Raster);
}

/// Draws a page. In vector formats shapes that are too heavy become pixels of 600 dots per inch.
pub(crate) fn draw(scene: &Scene, canvas: &mut impl Canvas) {
    let dpi = canvas.dpi();
    for item in &scene.items {
        match item {
            Item::Open { class, label } => canvas.open(class, label),
            Item::Close => canvas.close(),
            Item::Path(path) => {
                let heavy = dpi.is_none() && path.is_heavy();
                match heavy.then(|| pixels::of_path(path)).flatten() {
                    Some(raster) => canvas.raster(&raster),
                    None => canvas.path(path),
                }
            }
            Item::Words(words) => canvas.words(words),
            Item::Raster(raster) if dpi.is_some() => canvas.raster(raster),
            Item::Raster(raster) => canvas.raster(&raster.magnified()),
            Item::Cloud(cloud) => {
                if let Some(path) = cloud.path().filter(|_| dpi.is_none()) {
                    canvas.path(&path);
                } else if let Some(raster) = cloud.raster(dpi.unwrap_or(EMBEDDED_DPI)) {
                    canvas.raster(&raster);
                }
            }
        }
    }
}
