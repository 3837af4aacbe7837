//! The page as pixels.

use tiny_skia::{
    FillRule, LineCap, LineJoin, Mask, Paint, PathBuilder, Pixmap, PixmapPaint, StrokeDash,
    Transform,
};

use crate::colour::Colour;
use crate::raster::{self, Raster};
use crate::scene::{Item, Scene};
use crate::shape::{Path, Point, Rect, Segment};

/// Lines with more corners are drawn piece by piece on a separate layer: the time to draw one grows
/// with the square of the number of corners.
const LONG_STROKE: usize = 500;

/// The page as a PNG file of `dpi` dots per inch; `None` if it would have no pixels, or too many.
pub(crate) fn write(scene: &Scene, dpi: f64) -> Option<Vec<u8>> {
    let scale = dpi / 25.4;
    let (columns, rows) = (
        (scene.width * scale).round() as u32,
        (scene.height * scale).round() as u32,
    );
    let mut canvas = Canvas::new(columns, rows, Point::new(0.0, 0.0), scale)?;
    canvas.pixmap.fill(tiny_skia::Color::WHITE);
    for item in &scene.items {
        match item {
            Item::Open { .. } | Item::Close => {}
            Item::Path(path) => canvas.path(path),
            Item::Words(words) => canvas.path(&Path {
                segments: words.outline(),
                fill: Some(words.colour),
                stroke: None,
                clip: None,
            }),
            Item::Raster(raster) => canvas.raster(raster),
            Item::Cloud(cloud) => {
                if let Some(raster) = cloud.raster(dpi) {
                    canvas.raster(&raster);
                }
            }
        }
    }
    let pixels = canvas.colours();
    Some(raster::encode(
        &pixels,
        columns as usize,
        rows as usize,
        Some(dpi),
    ))
}

/// A stroked path alone, as pixels on a transparent ground.
pub(crate) fn path_raster(path: &Path, dpi: f64) -> Option<Raster> {
    let scale = dpi / 25.4;
    let clip = path.clip?;
    let colour = path.stroke.as_ref()?.colour;
    let corner = Point::new(
        (clip.left * scale).floor() / scale,
        (clip.top * scale).floor() / scale,
    );
    let columns = ((clip.right - corner.x) * scale).ceil() as u32;
    let rows = ((clip.bottom - corner.y) * scale).ceil() as u32;
    let mut canvas = Canvas::new(columns, rows, corner, scale)?;
    canvas.path(path);
    Some(Raster {
        rect: Rect {
            left: corner.x,
            top: corner.y,
            right: corner.x + f64::from(columns) / scale,
            bottom: corner.y + f64::from(rows) / scale,
        },
        clip,
        columns: columns as usize,
        rows: rows as usize,
        pixels: canvas
            .pixmap
            .pixels()
            .iter()
            .map(|p| raster::shaded(colour, f64::from(p.alpha()) / 255.0))
            .collect(),
    })
}

struct Canvas {
    pixmap: Pixmap,
    /// Page coordinates of the canvas's corner, mm.
    corner: Point,
    /// Pixels per millimetre.
    scale: f64,
    /// The last clip and its mask: neighbouring items usually have the same.
    mask: Option<(Rect, Mask)>,
}

impl Canvas {
    fn new(columns: u32, rows: u32, corner: Point, scale: f64) -> Option<Canvas> {
        Some(Canvas {
            pixmap: Pixmap::new(columns, rows)?,
            corner,
            scale,
            mask: None,
        })
    }

    fn colours(&self) -> Vec<Colour> {
        self.pixmap
            .pixels()
            .iter()
            .map(|pixel| {
                let c = pixel.demultiply();
                Colour {
                    r: c.red(),
                    g: c.green(),
                    b: c.blue(),
                    a: c.alpha(),
                }
            })
            .collect()
    }

    fn transform(&self) -> Transform {
        let scale = self.scale as f32;
        Transform::from_row(
            scale,
            0.0,
            0.0,
            scale,
            (-self.corner.x * self.scale) as f32,
            (-self.corner.y * self.scale) as f32,
        )
    }

    fn path(&mut self, path: &Path) {
        let Some(outline) = outline(&path.segments) else {
            return;
        };
        let transform = self.transform();
        if let Some(rect) = path.clip {
            self.prepare_mask(rect);
        }
        let mask = path.clip.and(self.mask.as_ref()).map(|(_, mask)| mask);
        if let Some(colour) = path.fill {
            self.pixmap
                .fill_path(&outline, &paint(colour), FillRule::Winding, transform, mask);
        }
        if let Some(stroke) = &path.stroke {
            let style = tiny_skia::Stroke {
                width: stroke.width as f32,
                line_cap: if stroke.round {
                    LineCap::Round
                } else {
                    LineCap::Butt
                },
                line_join: LineJoin::Round,
                dash: StrokeDash::new(stroke.dash.iter().map(|d| *d as f32).collect(), 0.0),
                ..tiny_skia::Stroke::default()
            };
            if path.segments.len() <= LONG_STROKE {
                self.pixmap
                    .stroke_path(&outline, &paint(stroke.colour), &style, transform, mask);
                return;
            }
            let Some(mut layer) = Pixmap::new(self.pixmap.width(), self.pixmap.height()) else {
                return;
            };
            let opaque = Colour {
                a: 255,
                ..stroke.colour
            };
            for piece in pieces(&path.segments) {
                layer.stroke_path(&piece, &paint(opaque), &style, transform, None);
            }
            let blend = PixmapPaint {
                opacity: stroke.colour.opacity() as f32,
                ..PixmapPaint::default()
            };
            self.pixmap
                .draw_pixmap(0, 0, layer.as_ref(), &blend, Transform::identity(), mask);
        }
    }

    fn prepare_mask(&mut self, rect: Rect) {
        if self.mask.as_ref().is_some_and(|(known, _)| *known == rect) {
            return;
        }
        let transform = self.transform();
        let mask = Mask::new(self.pixmap.width(), self.pixmap.height());
        self.mask = mask.map(|mut mask| {
            if let Some(outline) = outline(&rect.outline()) {
                mask.fill_path(&outline, FillRule::Winding, true, transform);
            }
            (rect, mask)
        });
    }

    /// Draws pixels on pixels. Each target pixel takes the colour at its centre, so that cells keep
    /// sharp edges and a picture of the same resolution is copied.
    fn raster(&mut self, raster: &Raster) {
        self.prepare_mask(raster.clip);
        let mask = self.mask.as_ref().map(|(_, mask)| mask.data());
        let (width, height) = (self.pixmap.width() as usize, self.pixmap.height() as usize);
        let places = |from: f64, to: f64, corner: f64, count: usize, most: usize| {
            let (from, to) = ((from - corner) * self.scale, (to - corner) * self.scale);
            let inside = from.round().max(0.0) as usize..(to.round().max(0.0) as usize).min(most);
            inside.map(move |target| {
                let share = (target as f64 + 0.5 - from) / (to - from);
                (target, ((share * count as f64) as usize).min(count - 1))
            })
        };
        let rect = raster.rect;
        let across: Vec<(usize, usize)> =
            places(rect.left, rect.right, self.corner.x, raster.columns, width).collect();
        let down = places(rect.top, rect.bottom, self.corner.y, raster.rows, height);
        let target = self.pixmap.pixels_mut();
        for (row, from_row) in down {
            for &(column, from_column) in &across {
                let colour = raster.pixels[from_row * raster.columns + from_column];
                let index = row * width + column;
                let visible = mask.map_or(1.0, |m| f64::from(m[index]) / 255.0);
                if colour.a > 0 && visible > 0.0 {
                    target[index] = over(colour, visible, target[index]);
                }
            }
        }
    }
}

/// Blends a colour over a pixel.
fn over(
    top: Colour,
    visible: f64,
    below: tiny_skia::PremultipliedColorU8,
) -> tiny_skia::PremultipliedColorU8 {
    let opacity = top.opacity() * visible;
    let mix = |t: f64, b: u8| (opacity * t + (1.0 - opacity) * f64::from(b)).round() as u8;
    let alpha = mix(255.0, below.alpha());
    tiny_skia::PremultipliedColorU8::from_rgba(
        mix(f64::from(top.r), below.red()).min(alpha),
        mix(f64::from(top.g), below.green()).min(alpha),
        mix(f64::from(top.b), below.blue()).min(alpha),
        alpha,
    )
    .unwrap_or(below)
}

/// A long line as lines of at most [`LONG_STROKE`] corners.
fn pieces(segments: &[Segment]) -> Vec<tiny_skia::Path> {
    let mut all = Vec::new();
    let mut piece: Vec<Segment> = Vec::new();
    for segment in segments {
        let full = piece.len() >= LONG_STROKE;
        if let (true, Segment::Line(_), Some(Segment::Move(last) | Segment::Line(last))) =
            (full, segment, piece.last())
        {
            let start = Segment::Move(*last);
            all.extend(outline(&piece));
            piece = vec![start];
        }
        piece.push(*segment);
    }
    all.extend(outline(&piece));
    all
}

fn paint(colour: Colour) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(colour.r, colour.g, colour.b, colour.a);
    paint.anti_alias = true;
    paint
}

fn outline(segments: &[Segment]) -> Option<tiny_skia::Path> {
    let mut pen = PathBuilder::new();
    let f = |p: Point| (p.x as f32, p.y as f32);
    for segment in segments {
        match *segment {
            Segment::Move(p) => pen.move_to(f(p).0, f(p).1),
            Segment::Line(p) => pen.line_to(f(p).0, f(p).1),
            Segment::Quad(a, p) => pen.quad_to(f(a).0, f(a).1, f(p).0, f(p).1),
            Segment::Cubic(a, b, p) => {
                pen.cubic_to(f(a).0, f(a).1, f(b).0, f(b).1, f(p).0, f(p).1);
            }
            Segment::Close => pen.close(),
        }
    }
    pen.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_in_pieces_looks_like_the_whole() {
        // A translucent line that crosses itself must not grow darker at its joints.
        let segments: Vec<Segment> = (0..3 * LONG_STROKE)
            .map(|i| {
                let t = i as f64 / 100.0;
                let p = Point::new(10.0 + 8.0 * (3.0 * t).sin(), 10.0 + 8.0 * (2.1 * t).cos());
                if i == 0 {
                    Segment::Move(p)
                } else {
                    Segment::Line(p)
                }
            })
            .collect();
        assert!(pieces(&segments).len() >= 3);
        let stroke = crate::shape::Stroke::solid(0.3, Colour::BLUE.alpha(0.5));
        let path = Path {
            segments,
            fill: None,
            stroke: Some(stroke),
            clip: None,
        };
        let draw = |whole: bool| {
            let mut canvas = Canvas::new(200, 200, Point::new(0.0, 0.0), 10.0).unwrap();
            if whole {
                let outline = outline(&path.segments).unwrap();
                let style = tiny_skia::Stroke {
                    width: 0.3,
                    line_join: LineJoin::Round,
                    ..tiny_skia::Stroke::default()
                };
                let transform = canvas.transform();
                canvas.pixmap.stroke_path(
                    &outline,
                    &paint(Colour::BLUE.alpha(0.5)),
                    &style,
                    transform,
                    None,
                );
            } else {
                canvas.path(&path);
            }
            canvas.colours()
        };
        let (pieces, whole) = (draw(false), draw(true));
        let off = pieces
            .iter()
            .zip(&whole)
            .filter(|(a, b)| a.a.abs_diff(b.a) > 40)
            .count();
        // Smoothing may differ only where edges of two pieces share a pixel.
        assert!(off < pieces.len() / 100, "{off}");
        assert!(pieces.iter().all(|c| c.a <= 128));
    }

    #[test]
    fn cells_are_where_they_belong() {
        let mut canvas = Canvas::new(20, 20, Point::new(0.0, 0.0), 1.0).unwrap();
        let rect = Rect {
            left: 3.0,
            right: 13.0,
            top: 5.0,
            bottom: 9.0,
        };
        canvas.raster(&Raster {
            rect,
            clip: Rect {
                right: 12.0,
                ..rect
            },
            columns: 5,
            rows: 2,
            pixels: (0..10).map(|i| Colour::rgb(i, 100, 0)).collect(),
        });
        let pixels = canvas.colours();
        for (index, pixel) in pixels.iter().enumerate() {
            let (column, row) = (index % 20, index / 20);
            if (3..12).contains(&column) && (5..9).contains(&row) {
                let cell = (row - 5) / 2 * 5 + (column - 3) / 2;
                assert_eq!(*pixel, Colour::rgb(cell as u8, 100, 0));
            } else {
                assert_eq!(pixel.a, 0, "{column} {row}");
            }
        }
    }
}
