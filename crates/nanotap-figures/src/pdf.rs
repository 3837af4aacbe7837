//! The page as PDF. Texts are shapes, so that the file needs no font.

use std::collections::BTreeSet;

use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::writers::{ExtGraphicsState, ImageXObject};
use pdf_writer::{Content, Filter, Finish as _, Name, Pdf, Ref, TextStr};

use crate::MADE_BY;
use crate::canvas::{self, Canvas};
use crate::colour::Colour;
use crate::raster::Raster;
use crate::scene::Scene;
use crate::shape::{Path, Point, Rect, Segment, on_grid};
use crate::text::MM_PER_POINT;

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const INFO: Ref = Ref::new(5);
/// The first object that depends on the drawing.
const FIRST: Ref = Ref::new(6);
/// Level of zlib's compression, 0 to 10.
const COMPRESSION: u8 = 6;

/// The page as a PDF file of one page: no date, so that the same figure gives the same file.
pub(crate) fn write(scene: &Scene) -> Vec<u8> {
    Drawing::of(scene).file(scene)
}

struct Drawing {
    pdf: Pdf,
    content: Content,
    opacities: BTreeSet<u8>,
    images: Vec<Ref>,
    /// The next object.
    next: Ref,
}

impl Drawing {
    fn of(scene: &Scene) -> Drawing {
        let mut drawing = Drawing {
            pdf: Pdf::new(),
            content: Content::new(),
            opacities: BTreeSet::new(),
            images: Vec::new(),
            next: FIRST,
        };
        let (width, height) = (points(scene.width), points(scene.height));
        let content = &mut drawing.content;
        content.set_fill_rgb(1.0, 1.0, 1.0);
        content.rect(0.0, 0.0, width, height).fill_nonzero();
        content.transform([points(1.0), 0.0, 0.0, -points(1.0), 0.0, height]);
        canvas::draw(scene, &mut drawing);
        drawing
    }

    fn file(mut self, scene: &Scene) -> Vec<u8> {
        self.pdf.catalog(CATALOG).pages(PAGES);
        self.pdf.pages(PAGES).kids([PAGE]).count(1);
        let mut info = self.pdf.document_info(INFO);
        info.producer(TextStr(MADE_BY));
        if !scene.title.is_empty() {
            info.title(TextStr(&scene.title));
        }
        info.finish();
        let mut page = self.pdf.page(PAGE);
        let (width, height) = (points(scene.width), points(scene.height));
        page.media_box(pdf_writer::Rect::new(0.0, 0.0, width, height));
        page.parent(PAGES);
        page.contents(CONTENT);
        let mut resources = page.resources();
        let mut states = resources.ext_g_states();
        for &opacity in &self.opacities {
            let share = f32::from(opacity) / 255.0;
            let state = states.insert(Name(opacity_name(opacity).as_bytes()));
            let mut state = state.start::<ExtGraphicsState<'_>>();
            state.stroking_alpha(share).non_stroking_alpha(share);
        }
        states.finish();
        let mut images = resources.x_objects();
        for (number, image) in self.images.iter().enumerate() {
            images.pair(Name(image_name(number).as_bytes()), *image);
        }
        images.finish();
        resources.finish();
        page.finish();
        let content = deflated(&self.content.finish());
        self.pdf
            .stream(CONTENT, &content)
            .filter(Filter::FlateDecode);
        self.pdf.finish()
    }

    /// Draws something within a clip.
    fn clipped(&mut self, clip: Option<Rect>, draw: impl FnOnce(&mut Self)) {
        self.content.save_state();
        if let Some(clip) = clip {
            let [left, top] = [clip.left, clip.top].map(on_grid);
            let [width, height] = [clip.width(), clip.height()].map(on_grid);
            self.content
                .rect(left, top, width, height)
                .clip_nonzero()
                .end_path();
        }
        draw(self);
        self.content.restore_state();
    }

    fn opacity(&mut self, colour: Colour) {
        if colour.a < 255 {
            self.opacities.insert(colour.a);
            let name = opacity_name(colour.a);
            self.content.set_parameters(Name(name.as_bytes()));
        }
    }

    /// Adds an outline to the current path.
    fn outline(&mut self, segments: &[Segment]) {
        let mut last = Point::new(0.0, 0.0);
        for segment in segments {
            last = match *segment {
                Segment::Move(p) => {
                    self.content.move_to(on_grid(p.x), on_grid(p.y));
                    p
                }
                Segment::Line(p) => {
                    self.content.line_to(on_grid(p.x), on_grid(p.y));
                    p
                }
                // PDF has no quadratic curves: the same curve as a cubic one.
                Segment::Quad(a, p) => self.curve(two_thirds(last, a), two_thirds(p, a), p),
                Segment::Cubic(a, b, p) => self.curve(a, b, p),
                Segment::Close => {
                    self.content.close_path();
                    last
                }
            }
        }
    }

    /// Adds a cubic curve to the current path, and returns its end.
    fn curve(&mut self, a: Point, b: Point, end: Point) -> Point {
        let [ax, ay, bx, by, x, y] = [a.x, a.y, b.x, b.y, end.x, end.y].map(on_grid);
        self.content.cubic_to(ax, ay, bx, by, x, y);
        end
    }

    /// Adds the picture's samples of 8 bits as a compressed image.
    fn image<'a>(&'a mut self, raster: &Raster, samples: &'a [u8]) -> (Ref, ImageXObject<'a>) {
        let object = self.next.bump();
        let mut image = self.pdf.image_xobject(object, samples);
        image.filter(Filter::FlateDecode);
        image.bits_per_component(8);
        image
            .width(raster.columns as i32)
            .height(raster.rows as i32);
        (object, image)
    }
}

impl Canvas for Drawing {
    fn path(&mut self, path: &Path) {
        if path.segments.is_empty() {
            return;
        }
        if let Some(colour) = path.fill {
            self.clipped(path.clip, |page| {
                page.opacity(colour);
                let [r, g, b] = shares(colour);
                page.content.set_fill_rgb(r, g, b);
                page.outline(&path.segments);
                page.content.fill_nonzero();
            });
        }
        if let Some(stroke) = &path.stroke {
            self.clipped(path.clip, |page| {
                page.opacity(stroke.colour);
                let [r, g, b] = shares(stroke.colour);
                page.content
                    .set_stroke_rgb(r, g, b)
                    .set_line_width(on_grid(stroke.width))
                    .set_line_join(LineJoinStyle::RoundJoin);
                if stroke.round {
                    page.content.set_line_cap(LineCapStyle::RoundCap);
                }
                if !stroke.dash.is_empty() {
                    let lengths = stroke.dash.iter().map(|length| on_grid(*length));
                    page.content.set_dash_pattern(lengths, 0.0);
                }
                page.outline(&path.segments);
                page.content.stroke();
            });
        }
    }

    fn raster(&mut self, raster: &Raster) {
        let pixels = &raster.pixels;
        let opacities: Vec<u8> = pixels.iter().map(|c| c.a).collect();
        let mask = opacities.iter().any(|a| *a < 255).then(|| {
            let samples = deflated(&opacities);
            let (object, mut mask) = self.image(raster, &samples);
            mask.color_space().device_gray();
            object
        });
        let colours: Vec<u8> = pixels.iter().flat_map(|c| [c.r, c.g, c.b]).collect();
        let samples = deflated(&colours);
        let (object, mut image) = self.image(raster, &samples);
        image.color_space().device_rgb();
        if let Some(mask) = mask {
            image.s_mask(mask);
        }
        image.finish();
        let name = image_name(self.images.len());
        self.images.push(object);
        self.clipped(Some(raster.clip), |page| {
            let rect = raster.rect;
            let [left, bottom] = [rect.left, rect.bottom].map(on_grid);
            let [width, height] = [rect.width(), rect.height()].map(on_grid);
            // An image covers the unit square, upwards.
            page.content
                .transform([width, 0.0, 0.0, -height, left, bottom])
                .x_object(Name(name.as_bytes()));
        });
    }
}

fn opacity_name(opacity: u8) -> String {
    format!("a{opacity}")
}

fn image_name(number: usize) -> String {
    format!("i{number}")
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    miniz_oxide::deflate::compress_to_vec_zlib(bytes, COMPRESSION)
}

/// A length in mm in typographer's points, the unit of PDF.
fn points(length: f64) -> f32 {
    (length / MM_PER_POINT) as f32
}

/// Red, green and blue from 0 to 1.
fn shares(colour: Colour) -> [f32; 3] {
    [colour.r, colour.g, colour.b].map(|c| f32::from(c) / 255.0)
}

/// The point at two thirds of the way from `a` to `b`.
fn two_thirds(a: Point, b: Point) -> Point {
    Point::new((a.x + 2.0 * b.x) / 3.0, (a.y + 2.0 * b.y) / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Item;
    use crate::shape::Stroke;

    #[test]
    fn all_that_the_page_uses_is_in_the_file() {
        let rect = Rect {
            left: 1.0,
            top: 2.0,
            right: 9.0,
            bottom: 8.0,
        };
        let corner = Point::new(1.0, 2.0);
        let faint = Colour::BLUE.alpha(0.5);
        let path = |segments, fill, stroke| {
            Item::Path(Path {
                segments,
                fill,
                stroke,
                clip: Some(rect),
            })
        };
        let curve = vec![
            Segment::Move(corner),
            Segment::Quad(Point::new(4.0, 8.0), Point::new(7.0, 2.0)),
        ];
        let raster = Raster {
            rect,
            clip: rect,
            columns: 2,
            rows: 1,
            pixels: vec![Colour::BLACK, faint],
        };
        let scene = Scene {
            width: 25.4,
            height: 25.4,
            title: "some title".into(),
            items: vec![
                path(rect.outline(), Some(faint), None),
                path(curve, None, Some(Stroke::solid(0.5, Colour::BLACK))),
                Item::Raster(raster),
            ],
        };
        let drawing = Drawing::of(&scene);
        let drawn = String::from_utf8_lossy(drawing.content.as_bytes()).into_owned();
        // The quadratic curve, as a cubic one: its controls are two thirds of the way to 4, 8.
        assert!(drawn.contains("3 6 5 6 7 2 c"), "{drawn}");
        for operator in ["q", "Q", "f", "S", "Do", "gs"] {
            let count = drawn
                .lines()
                .filter(|l| l.split(' ').next_back() == Some(operator));
            let expected = match operator {
                "q" | "Q" => 3,
                "f" => 2,
                _ => 1,
            };
            assert_eq!(count.count(), expected, "{operator} in {drawn}");
        }
        let file = drawing.file(&scene);
        let text = String::from_utf8_lossy(&file);
        assert!(text.contains("/MediaBox [0 0 72 72]") && text.contains("(some title)"));
        assert_eq!(text.matches("/Subtype /Image").count(), 2);
        for name in drawn
            .split_whitespace()
            .filter(|word| word.starts_with('/'))
        {
            assert!(text.contains(&format!("{name} ")), "{name}");
        }
    }
}
