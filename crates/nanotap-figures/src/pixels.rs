//! The page as pixels, by tiny-skia.

use tiny_skia::{
    Color, ColorU8, FillRule, FilterQuality, LineCap, LineJoin, Mask, Paint, PathBuilder, Pattern,
    Pixmap, PixmapPaint, PremultipliedColorU8, SpreadMode, StrokeDash, Transform,
};

use crate::canvas::{self, Canvas};
use crate::colour::Colour;
use crate::raster::{self, EMBEDDED_DPI, Raster};
use crate::scene::{Item, Scene};
use crate::shape::{Path, Point, Rect, Segment, Stroke, on_grid};

/// Lines with more corners are drawn in pieces on a layer: the time to stroke a path grows with the
/// square of the number of its corners.
const LONG_STROKE: usize = 500;

/// The page as a PNG file of `dpi` dots per inch; `None` if it would have no pixels.
pub(crate) fn png(scene: &Scene, dpi: f64) -> Option<Vec<u8>> {
    let page = Page::drawn(scene, Color::WHITE, dpi)?;
    let (columns, rows) = (page.pixels.width() as usize, page.pixels.height() as usize);
    Some(raster::encode(&page.colours(), columns, rows, Some(dpi)))
}

/// A stroked path alone, as pixels of 600 dots per inch on a transparent ground; `None` without
/// stroke, clip or pixels.
pub(crate) fn of_path(path: &Path) -> Option<Raster> {
    let scale = EMBEDDED_DPI / 25.4;
    let clip = path.clip?;
    let colour = path.stroke.as_ref()?.colour;
    let corner = Point::new(
        (clip.left * scale).floor() / scale,
        (clip.top * scale).floor() / scale,
    );
    let shifted = |p: Point| Point::new(p.x - corner.x, p.y - corner.y);
    let scene = Scene {
        width: ((clip.right - corner.x) * scale).ceil() / scale,
        height: ((clip.bottom - corner.y) * scale).ceil() / scale,
        title: String::new(),
        items: vec![Item::Path(Path {
            segments: path.segments.iter().map(|s| s.map(shifted)).collect(),
            clip: None,
            ..path.clone()
        })],
    };
    let layer = Page::drawn(&scene, Color::TRANSPARENT, EMBEDDED_DPI)?;
    Some(Raster {
        rect: Rect {
            left: corner.x,
            top: corner.y,
            right: corner.x + scene.width,
            bottom: corner.y + scene.height,
        },
        clip,
        columns: layer.pixels.width() as usize,
        rows: layer.pixels.height() as usize,
        pixels: layer
            .colours()
            .iter()
            .map(|pixel| raster::shaded(colour, pixel.opacity()))
            .collect(),
    })
}

struct Page {
    dpi: f64,
    pixels: Pixmap,
    /// From millimetres to pixels.
    scale: Transform,
    /// The last clip with its coverage of the page.
    clip: Option<(Rect, Mask)>,
}

impl Page {
    /// The page on a ground of this colour.
    fn drawn(scene: &Scene, ground: Color, dpi: f64) -> Option<Page> {
        let count = |length: f64| (length * dpi / 25.4).round() as u32;
        let mut pixels = Pixmap::new(count(scene.width), count(scene.height))?;
        pixels.fill(ground);
        let scale = (dpi / 25.4) as f32;
        let mut page = Page {
            dpi,
            pixels,
            scale: Transform::from_scale(scale, scale),
            clip: None,
        };
        canvas::draw(scene, &mut page);
        Some(page)
    }

    fn colours(&self) -> Vec<Colour> {
        let pixels = self.pixels.pixels().iter();
        pixels
            .map(PremultipliedColorU8::demultiply)
            .map(|c| Colour {
                r: c.red(),
                g: c.green(),
                b: c.blue(),
                a: c.alpha(),
            })
            .collect()
    }

    /// Keeps the coverage of this clip for what is drawn next.
    fn set_clip(&mut self, clip: Option<Rect>) {
        if clip == self.clip.as_ref().map(|(rect, _)| *rect) {
            return;
        }
        self.clip = clip.and_then(|rect| {
            let mut mask = Mask::new(self.pixels.width(), self.pixels.height())?;
            let outline = outline(&rect.outline())?;
            mask.fill_path(&outline, FillRule::Winding, true, self.scale);
            Some((rect, mask))
        });
    }

    fn stroke(&mut self, segments: &[Segment], stroke: &Stroke) {
        let style = tiny_skia::Stroke {
            width: on_grid(stroke.width),
            line_cap: if stroke.round {
                LineCap::Round
            } else {
                LineCap::Butt
            },
            line_join: LineJoin::Round,
            dash: StrokeDash::new(stroke.dash.iter().map(|d| on_grid(*d)).collect(), 0.0),
            ..tiny_skia::Stroke::default()
        };
        let mask = self.clip.as_ref().map(|(_, mask)| mask);
        if segments.len() <= LONG_STROKE {
            if let Some(line) = outline(segments) {
                let paint = paint(stroke.colour);
                self.pixels
                    .stroke_path(&line, &paint, &style, self.scale, mask);
            }
            return;
        }
        // Pieces overlap at their joints: a translucent line is opaque on its layer.
        let Some(mut layer) = Pixmap::new(self.pixels.width(), self.pixels.height()) else {
            return;
        };
        let opaque = paint(stroke.colour.alpha(1.0));
        for line in pieces(segments).iter().filter_map(|piece| outline(piece)) {
            layer.stroke_path(&line, &opaque, &style, self.scale, None);
        }
        let paint = PixmapPaint {
            opacity: stroke.colour.opacity() as f32,
            ..PixmapPaint::default()
        };
        let layer = layer.as_ref();
        self.pixels
            .draw_pixmap(0, 0, layer, &paint, Transform::identity(), mask);
    }
}

impl Canvas for Page {
    fn dpi(&self) -> Option<f64> {
        Some(self.dpi)
    }

    fn path(&mut self, path: &Path) {
        self.set_clip(path.clip);
        if let Some(colour) = path.fill
            && let Some(shape) = outline(&path.segments)
        {
            let mask = self.clip.as_ref().map(|(_, mask)| mask);
            let paint = paint(colour);
            self.pixels
                .fill_path(&shape, &paint, FillRule::Winding, self.scale, mask);
        }
        if let Some(stroke) = &path.stroke {
            self.stroke(&path.segments, stroke);
        }
    }

    fn raster(&mut self, raster: &Raster) {
        let Some(mut image) = Pixmap::new(raster.columns as u32, raster.rows as u32) else {
            return;
        };
        for (pixel, c) in image.pixels_mut().iter_mut().zip(&raster.pixels) {
            *pixel = ColorU8::from_rgba(c.r, c.g, c.b, c.a).premultiply();
        }
        let whole = image.width() as f32;
        let Some(rect) = tiny_skia::Rect::from_xywh(0.0, 0.0, whole, image.height() as f32) else {
            return;
        };
        let stretched = self
            .scale
            .pre_translate(on_grid(raster.rect.left), on_grid(raster.rect.top))
            .pre_scale(
                on_grid(raster.rect.width()) / rect.width(),
                on_grid(raster.rect.height()) / rect.height(),
            );
        let identity = Transform::identity();
        let paint = Paint {
            shader: Pattern::new(
                image.as_ref(),
                SpreadMode::Pad,
                FilterQuality::Nearest,
                1.0,
                identity,
            ),
            ..Paint::default()
        };
        self.set_clip(Some(raster.clip));
        let mask = self.clip.as_ref().map(|(_, mask)| mask);
        self.pixels.fill_rect(rect, &paint, stretched, mask);
    }
}

fn paint(colour: Colour) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(colour.r, colour.g, colour.b, colour.a);
    paint
}

/// The path in tiny-skia's form; `None` if it has no length.
fn outline(segments: &[Segment]) -> Option<tiny_skia::Path> {
    let mut path = PathBuilder::new();
    let at = |p: Point| (on_grid(p.x), on_grid(p.y));
    for segment in segments {
        match *segment {
            Segment::Move(p) => path.move_to(on_grid(p.x), on_grid(p.y)),
            Segment::Line(p) => path.line_to(on_grid(p.x), on_grid(p.y)),
            Segment::Quad(a, p) => {
                let ((ax, ay), (x, y)) = (at(a), at(p));
                path.quad_to(ax, ay, x, y);
            }
            Segment::Cubic(a, b, p) => {
                let ((ax, ay), (bx, by), (x, y)) = (at(a), at(b), at(p));
                path.cubic_to(ax, ay, bx, by, x, y);
            }
            Segment::Close => path.close(),
        }
    }
    path.finish()
}

/// A long line as lines of at most [`LONG_STROKE`] corners.
fn pieces(segments: &[Segment]) -> Vec<Vec<Segment>> {
    let mut all: Vec<Vec<Segment>> = vec![Vec::new()];
    for segment in segments {
        let piece = all.last().map_or(&[][..], Vec::as_slice);
        if let (true, Segment::Line(_), Some(Segment::Move(last) | Segment::Line(last))) =
            (piece.len() >= LONG_STROKE, segment, piece.last())
        {
            all.push(vec![Segment::Move(*last)]);
        }
        if let Some(piece) = all.last_mut() {
            piece.push(*segment);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A translucent line of 1500 corners that crosses itself.
    fn curl() -> Path {
        let segments = (0..1500).map(|i| {
            let t = f64::from(i) / 100.0;
            let p = Point::new(10.0 + 8.0 * (3.0 * t).sin(), 10.0 + 8.0 * (2.1 * t).cos());
            if i == 0 {
                Segment::Move(p)
            } else {
                Segment::Line(p)
            }
        });
        Path {
            segments: segments.collect(),
            fill: None,
            stroke: Some(Stroke::solid(0.3, Colour::BLUE.alpha(0.5))),
            clip: None,
        }
    }

    #[test]
    fn a_long_line_in_pieces_looks_like_the_whole() {
        let Path {
            segments,
            stroke: Some(stroke),
            ..
        } = curl()
        else {
            panic!("no stroke")
        };
        let scene = |segments: Vec<Segment>| {
            let mut scene = Scene {
                width: 20.0,
                height: 20.0,
                title: String::new(),
                items: Vec::new(),
            };
            scene.stroke(segments, stroke.clone(), None);
            scene
        };
        let pieces = Page::drawn(&scene(segments.clone()), Color::WHITE, 254.0)
            .unwrap()
            .colours();
        // Without pieces: tiny-skia's own stroke of the whole line.
        let mut whole = Page::drawn(&scene(Vec::new()), Color::WHITE, 254.0).unwrap();
        whole.pixels.stroke_path(
            &outline(&segments).unwrap(),
            &paint(stroke.colour),
            &tiny_skia::Stroke {
                width: 0.3,
                line_join: LineJoin::Round,
                ..tiny_skia::Stroke::default()
            },
            whole.scale,
            None,
        );
        let off = pieces
            .iter()
            .zip(&whole.colours())
            .filter(|(a, b)| a.r.abs_diff(b.r) > 40)
            .count();
        // Smoothing may differ only where edges of two pieces share a pixel. A joint must not be
        // darker than the line.
        assert!(off < pieces.len() / 100, "{off}");
        assert!(pieces.iter().all(|c| c.r >= 126));
    }

    #[test]
    fn a_path_becomes_pixels_in_its_place() {
        let clip = Rect {
            left: 3.01,
            top: 2.0,
            right: 18.0,
            bottom: 17.0,
        };
        let path = Path {
            clip: Some(clip),
            ..curl()
        };
        let raster = of_path(&path).unwrap();
        let at = |x: f64, y: f64| {
            let place = |value: f64, from: f64| ((value - from) * 600.0 / 25.4) as usize;
            let (column, row) = (place(x, raster.rect.left), place(y, raster.rect.top));
            raster.pixels[row * raster.columns + column].a
        };
        // The curve at t = 0.5, and a point 2 mm from it.
        let (x, y) = (10.0 + 8.0 * 1.5f64.sin(), 10.0 + 8.0 * 1.05f64.cos());
        assert!(
            x > clip.right - 0.1 || at(x, y) == 136 || at(x, y) == 119,
            "{}",
            at(x, y)
        );
        assert_eq!(at(10.0, 3.0), 0);
    }
}
