//! The page as PDF: one page of the figure's size, letters as shapes, no date, so that the same
//! figure gives the same file.

use std::collections::BTreeSet;

use miniz_oxide::deflate::compress_to_vec_zlib;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect as Box, Ref, TextStr};

use crate::MADE_BY;
use crate::colour::Colour;
use crate::pixels;
use crate::raster::{EMBEDDED_DPI, Raster};
use crate::scene::{Item, Scene};
use crate::shape::{Path, Point, Rect, Segment};
use crate::text::MM_PER_POINT;

const CATALOG: i32 = 1;
const PAGES: i32 = 2;
const PAGE: i32 = 3;
const CONTENT: i32 = 4;
const INFO: i32 = 5;
const FIRST_FREE: i32 = 6;

/// Strong compression that is still fast.
const COMPRESSION: u8 = 9;

pub(crate) fn write(scene: &Scene) -> Vec<u8> {
    let mut page = Page {
        content: Content::new(),
        opacities: BTreeSet::new(),
        images: Vec::new(),
    };
    let points = (1.0 / MM_PER_POINT) as f32;
    let (width, height) = (scene.width as f32 * points, scene.height as f32 * points);
    page.content
        .transform([points, 0.0, 0.0, -points, 0.0, height]);
    for item in &scene.items {
        page.item(item);
    }

    let mut pdf = Pdf::new();
    pdf.catalog(Ref::new(CATALOG)).pages(Ref::new(PAGES));
    pdf.pages(Ref::new(PAGES)).kids([Ref::new(PAGE)]).count(1);
    let mut info = pdf.document_info(Ref::new(INFO));
    info.producer(TextStr(MADE_BY));
    if !scene.title.is_empty() {
        info.title(TextStr(&scene.title));
    }
    info.finish();

    let mut next = FIRST_FREE;
    let mut fresh = || {
        next += 1;
        Ref::new(next - 1)
    };
    let states: Vec<(u8, Ref)> = page.opacities.iter().map(|a| (*a, fresh())).collect();
    let images: Vec<(Ref, Ref)> = page.images.iter().map(|_| (fresh(), fresh())).collect();

    let mut sheet = pdf.page(Ref::new(PAGE));
    sheet.media_box(Box::new(0.0, 0.0, width, height));
    sheet.parent(Ref::new(PAGES));
    sheet.contents(Ref::new(CONTENT));
    let mut resources = sheet.resources();
    let mut named = resources.ext_g_states();
    for (alpha, id) in &states {
        named.pair(Name(format!("a{alpha}").as_bytes()), id);
    }
    named.finish();
    let mut named = resources.x_objects();
    for (index, (id, _)) in images.iter().enumerate() {
        named.pair(Name(format!("i{index}").as_bytes()), id);
    }
    named.finish();
    resources.finish();
    sheet.finish();

    for (alpha, id) in states {
        let share = f32::from(alpha) / 255.0;
        pdf.ext_graphics(id)
            .stroking_alpha(share)
            .non_stroking_alpha(share);
    }
    for ((image, mask), raster) in images.into_iter().zip(&page.images) {
        write_image(&mut pdf, raster, image, mask);
    }
    let content = compress_to_vec_zlib(&page.content.finish(), COMPRESSION);
    pdf.stream(Ref::new(CONTENT), &content)
        .filter(Filter::FlateDecode);
    pdf.finish()
}

fn write_image(pdf: &mut Pdf, raster: &Raster, image: Ref, mask: Ref) {
    let size = (raster.columns as i32, raster.rows as i32);
    let colours: Vec<u8> = raster.pixels.iter().flat_map(|c| [c.r, c.g, c.b]).collect();
    let colours = compress_to_vec_zlib(&colours, COMPRESSION);
    let mut object = pdf.image_xobject(image, &colours);
    object.filter(Filter::FlateDecode);
    object.width(size.0).height(size.1).bits_per_component(8);
    object.color_space().device_rgb();
    object.s_mask(mask);
    object.finish();

    let opacity: Vec<u8> = raster.pixels.iter().map(|c| c.a).collect();
    let opacity = compress_to_vec_zlib(&opacity, COMPRESSION);
    let mut object = pdf.image_xobject(mask, &opacity);
    object.filter(Filter::FlateDecode);
    object.width(size.0).height(size.1).bits_per_component(8);
    object.color_space().device_gray();
}

struct Page {
    content: Content,
    opacities: BTreeSet<u8>,
    images: Vec<Raster>,
}

impl Page {
    fn item(&mut self, item: &Item) {
        match item {
            Item::Open { .. } | Item::Close => {}
            Item::Path(path) if path.is_heavy() => {
                if let Some(raster) = pixels::path_raster(path, EMBEDDED_DPI) {
                    self.raster(raster);
                }
            }
            Item::Path(path) => self.path(path),
            Item::Words(words) => self.path(&Path {
                segments: words.outline(),
                fill: Some(words.colour),
                stroke: None,
                clip: None,
            }),
            Item::Raster(raster) => self.raster(raster.magnified()),
            Item::Cloud(cloud) => {
                if let Some(path) = cloud.path() {
                    self.path(&path);
                } else if let Some(raster) = cloud.raster(EMBEDDED_DPI) {
                    self.raster(raster);
                }
            }
        }
    }

    fn begin(&mut self, clip: Option<Rect>, opacity: u8) {
        self.content.save_state();
        if let Some(rect) = clip {
            self.content
                .rect(
                    rect.left as f32,
                    rect.top as f32,
                    rect.width() as f32,
                    rect.height() as f32,
                )
                .clip_nonzero()
                .end_path();
        }
        if opacity < 255 {
            self.opacities.insert(opacity);
            self.content
                .set_parameters(Name(format!("a{opacity}").as_bytes()));
        }
    }

    fn path(&mut self, path: &Path) {
        if path.segments.is_empty() {
            return;
        }
        if let Some(Colour { r, g, b, a }) = path.fill {
            self.begin(path.clip, a);
            self.content.set_fill_rgb(share(r), share(g), share(b));
            self.segments(&path.segments);
            self.content.fill_nonzero().restore_state();
        }
        if let Some(stroke) = &path.stroke {
            let Colour { r, g, b, a } = stroke.colour;
            self.begin(path.clip, a);
            self.content.set_stroke_rgb(share(r), share(g), share(b));
            self.content.set_line_width(stroke.width as f32);
            self.content.set_line_join(LineJoinStyle::RoundJoin);
            if stroke.round {
                self.content.set_line_cap(LineCapStyle::RoundCap);
            }
            if !stroke.dash.is_empty() {
                self.content
                    .set_dash_pattern(stroke.dash.iter().map(|d| *d as f32), 0.0);
            }
            self.segments(&path.segments);
            self.content.stroke().restore_state();
        }
    }

    fn segments(&mut self, segments: &[Segment]) {
        // To the micrometre, for shorter files.
        let f = |p: Point| {
            (
                ((p.x * 1000.0).round() / 1000.0) as f32,
                ((p.y * 1000.0).round() / 1000.0) as f32,
            )
        };
        let mut at = Point::new(0.0, 0.0);
        for segment in segments {
            match *segment {
                Segment::Move(p) => {
                    self.content.move_to(f(p).0, f(p).1);
                    at = p;
                }
                Segment::Line(p) => {
                    self.content.line_to(f(p).0, f(p).1);
                    at = p;
                }
                Segment::Quad(q, p) => {
                    // PDF has cubic curves only.
                    let third = |from: Point| {
                        Point::new(
                            from.x + (q.x - from.x) * 2.0 / 3.0,
                            from.y + (q.y - from.y) * 2.0 / 3.0,
                        )
                    };
                    let (a, b) = (f(third(at)), f(third(p)));
                    self.content.cubic_to(a.0, a.1, b.0, b.1, f(p).0, f(p).1);
                    at = p;
                }
                Segment::Cubic(a, b, p) => {
                    let (a, b) = (f(a), f(b));
                    self.content.cubic_to(a.0, a.1, b.0, b.1, f(p).0, f(p).1);
                    at = p;
                }
                Segment::Close => {
                    self.content.close_path();
                }
            }
        }
    }

    fn raster(&mut self, raster: Raster) {
        self.begin(Some(raster.clip), 255);
        let rect = raster.rect;
        self.content.transform([
            rect.width() as f32,
            0.0,
            0.0,
            -rect.height() as f32,
            rect.left as f32,
            rect.bottom as f32,
        ]);
        let name = format!("i{}", self.images.len());
        self.content.x_object(Name(name.as_bytes())).restore_state();
        self.images.push(raster);
    }
}

fn share(component: u8) -> f32 {
    f32::from(component) / 255.0
}
