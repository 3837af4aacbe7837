//! The page as pixels.

use tiny_skia::{
    FillRule, LineCap, LineJoin, Mask, Paint, PathBuilder, Pixmap, PixmapPaint, StrokeDash,
    Transform,
};

use crate::colour::Colour;
use crate::raster::{self, Raster};
use crate::scene::{Item, Path, Point, Rect, Scene, Segment};

/// Lines of more corners are drawn piece by piece on a layer of their own: the time to draw one grows
/// with the square of its corners.
const LONG_STROKE: usize = 500;

/// The page as a PNG file of `dpi` dots per inch; none if it would have no pixels, or too many.
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
    /// Pixels in a millimetre.
    scale: f64,
    /// The last clip and its mask: neighbouring items mostly share theirs.
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

    /// Draws pixels on pixels, each of ours the mean of what it covers: sharp edges stay sharp when
    /// enlarged, and nothing is skipped when reduced.
    fn raster(&mut self, raster: &Raster) {
        let across = Shares::new(
            (raster.rect.left - self.corner.x) * self.scale,
            (raster.rect.right - self.corner.x) * self.scale,
            raster.columns,
            self.pixmap.width() as usize,
        );
        let down = Shares::new(
            (raster.rect.top - self.corner.y) * self.scale,
            (raster.rect.bottom - self.corner.y) * self.scale,
            raster.rows,
            self.pixmap.height() as usize,
        );
        self.prepare_mask(raster.clip);
        let width = self.pixmap.width() as usize;
        let mask = self.mask.as_ref().map(|(_, mask)| mask.data().to_vec());
        let target = self.pixmap.pixels_mut();
        for (row, rows) in down.targets() {
            for (column, columns) in across.targets() {
                let mut sum = [0.0f64; 4];
                for &(source_row, share_row) in rows {
                    for &(source_column, share) in columns {
                        let c = raster.pixels[source_row * raster.columns + source_column];
                        let weight = share * share_row * c.opacity();
                        sum[0] += weight * f64::from(c.r);
                        sum[1] += weight * f64::from(c.g);
                        sum[2] += weight * f64::from(c.b);
                        sum[3] += weight * 255.0;
                    }
                }
                let index = row * width + column;
                let visible = mask.as_ref().map_or(1.0, |m| f64::from(m[index]) / 255.0);
                if sum[3] * visible > 0.0 {
                    target[index] = over(sum.map(|v| v * visible), target[index]);
                }
            }
        }
    }
}

/// Lays a premultiplied colour (0 to 255) over a pixel.
fn over(top: [f64; 4], below: tiny_skia::PremultipliedColorU8) -> tiny_skia::PremultipliedColorU8 {
    let rest = 1.0 - top[3] / 255.0;
    let mix = |t: f64, b: u8| (t + rest * f64::from(b)).round().clamp(0.0, 255.0) as u8;
    let alpha = mix(top[3], below.alpha());
    tiny_skia::PremultipliedColorU8::from_rgba(
        mix(top[0], below.red()).min(alpha),
        mix(top[1], below.green()).min(alpha),
        mix(top[2], below.blue()).min(alpha),
        alpha,
    )
    .unwrap_or(below)
}

/// Which source pixels each target pixel covers along one direction, and how much of the target
/// pixel each fills.
struct Shares {
    first: usize,
    shares: Vec<Vec<(usize, f64)>>,
}

impl Shares {
    /// `count` source pixels lie evenly between `from` and `to`, in target pixels.
    fn new(from: f64, to: f64, count: usize, targets: usize) -> Shares {
        let first = from.max(0.0).floor() as usize;
        let last = (to.ceil().max(0.0) as usize).min(targets);
        let size = (to - from) / count as f64;
        let shares = (first..last)
            .map(|target| {
                let (start, stop) = (target as f64, target as f64 + 1.0);
                let source = |edge: f64| (edge - from) / size;
                let low = source(start).floor().max(0.0) as usize;
                let high = (source(stop).ceil().max(0.0) as usize).min(count);
                (low..high)
                    .filter_map(|index| {
                        let left = (from + index as f64 * size).max(start);
                        let right = (from + (index + 1) as f64 * size).min(stop);
                        // Grids that agree must not blur by rounding.
                        (right - left > 1e-6).then_some((index, right - left))
                    })
                    .collect()
            })
            .collect();
        Shares { first, shares }
    }

    fn targets(&self) -> impl Iterator<Item = (usize, &Vec<(usize, f64)>)> {
        self.shares
            .iter()
            .enumerate()
            .map(|(i, shares)| (self.first + i, shares))
    }
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
    fn shares_fill_every_covered_pixel() {
        for (from, to, count) in [(2.0, 12.0, 10), (1.3, 9.8, 3), (0.25, 7.0, 40)] {
            let shares = Shares::new(from, to, count, 20);
            let total: f64 = shares.shares.iter().flatten().map(|s| s.1).sum();
            assert!((total - (to - from)).abs() < 1e-3, "{total}");
            assert!(
                shares
                    .shares
                    .iter()
                    .all(|s| s.iter().map(|x| x.1).sum::<f64>() < 1.0 + 1e-9)
            );
        }
    }

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
        let stroke = crate::scene::Stroke::solid(0.3, Colour::BLUE.alpha(0.5));
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
        // Only where edges of two pieces share a pixel may the smoothing differ.
        assert!(off < pieces.len() / 100, "{off}");
        assert!(pieces.iter().all(|c| c.a <= 128));
    }

    #[test]
    fn agreeing_grids_are_copied() {
        let shares = Shares::new(3.0, 8.0, 5, 20);
        assert!(
            shares
                .targets()
                .all(|(target, s)| s.len() == 1 && s[0].0 == target - 3)
        );
    }
}
