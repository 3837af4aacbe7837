//! PNG and PDF, made from the page's SVG by resvg and svg2pdf.
//!
//! Letters are shapes in the SVG, so neither needs a font.

use pdf_writer::{Content, Finish as _, Name, Pdf, Rect as Box, Ref, TextStr};
use resvg::tiny_skia::{Color, Pixmap, PremultipliedColorU8, Transform};
use resvg::usvg::{ImageRendering, Options, Tree};

use crate::MADE_BY;
use crate::colour::Colour;
use crate::raster::{self, EMBEDDED_DPI, Raster};
use crate::scene::{Item, Scene};
use crate::shape::{Path, Point, Rect};
use crate::svg::{self, Target};

/// Typographer's points in an inch, the unit of PDF.
const POINTS_PER_INCH: f64 = 72.0;
/// Objects of a PDF file outside the drawing.
const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const INFO: Ref = Ref::new(5);
const DRAWING: Name = Name(b"drawing");

/// The page as a PNG file of `dpi` dots per inch.
///
/// # Errors
/// If it would have no pixels, or the SVG cannot be converted.
pub(crate) fn png(scene: &Scene, dpi: f64) -> Result<Vec<u8>, String> {
    let page = pixels(scene, Color::WHITE, dpi)?;
    let (columns, rows) = (page.width() as usize, page.height() as usize);
    Ok(raster::encode(&colours(&page), columns, rows, Some(dpi)))
}

/// The page as a PDF file of one page: no date, so that the same figure gives the same file.
///
/// # Errors
/// If the SVG cannot be converted.
pub(crate) fn pdf(scene: &Scene) -> Result<Vec<u8>, String> {
    let tree = tree(&svg::write(scene, Target::Pdf), POINTS_PER_INCH)?;
    let (chunk, drawing) = svg2pdf::to_chunk(&tree, svg2pdf::ConversionOptions::default())
        .map_err(|error| error.to_string())?;
    let shifted = |object: Ref| Ref::new(object.get() + INFO.get());

    let mut pdf = Pdf::new();
    pdf.catalog(CATALOG).pages(PAGES);
    pdf.pages(PAGES).kids([PAGE]).count(1);
    let mut info = pdf.document_info(INFO);
    info.producer(TextStr(MADE_BY));
    if !scene.title.is_empty() {
        info.title(TextStr(&scene.title));
    }
    info.finish();
    let (width, height) = (tree.size().width(), tree.size().height());
    let mut page = pdf.page(PAGE);
    page.media_box(Box::new(0.0, 0.0, width, height));
    page.parent(PAGES);
    page.contents(CONTENT);
    page.resources().x_objects().pair(DRAWING, shifted(drawing));
    page.finish();
    let mut content = Content::new();
    content.transform([width, 0.0, 0.0, height, 0.0, 0.0]);
    content.x_object(DRAWING);
    pdf.stream(CONTENT, &content.finish());
    pdf.extend(&chunk.renumber(shifted));
    Ok(with_sorted_resources(&pdf.finish()))
}

/// The file with the resources of each object in alphabetical order: svg2pdf writes them in random
/// order. No object changes its place or length.
fn with_sorted_resources(pdf: &[u8]) -> Vec<u8> {
    let is_resource = |line: &[u8]| {
        let line = line.trim_ascii_start();
        (line.starts_with(b"/xo") || line.starts_with(b"/gs")) && line.ends_with(b" 0 R")
    };
    let mut lines: Vec<&[u8]> = pdf.split(|byte| *byte == b'\n').collect();
    for run in lines.chunk_by_mut(|a, b| is_resource(a) && is_resource(b)) {
        run.sort_unstable();
    }
    lines.join(&b'\n')
}

/// A stroked path alone, as pixels of 600 dots per inch on a transparent ground; `None` without
/// stroke, clip or pixels.
pub(crate) fn path_raster(path: &Path) -> Option<Raster> {
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
    let layer = pixels(&scene, Color::TRANSPARENT, EMBEDDED_DPI).ok()?;
    Some(Raster {
        rect: Rect {
            left: corner.x,
            top: corner.y,
            right: corner.x + scene.width,
            bottom: corner.y + scene.height,
        },
        clip,
        columns: layer.width() as usize,
        rows: layer.height() as usize,
        pixels: colours(&layer)
            .iter()
            .map(|pixel| raster::shaded(colour, pixel.opacity()))
            .collect(),
    })
}

/// The SVG with one unit per dot.
fn tree(svg: &str, dpi: f64) -> Result<Tree, String> {
    let options = Options {
        dpi: dpi as f32,
        // The reader takes "pixelated" from style sheets only, which a page's policy may forbid.
        image_rendering: ImageRendering::Pixelated,
        ..Options::default()
    };
    Tree::from_str(svg, &options).map_err(|error| error.to_string())
}

/// The page on a ground of this colour.
fn pixels(scene: &Scene, ground: Color, dpi: f64) -> Result<Pixmap, String> {
    let count = |length: f64| (length * dpi / 25.4).round() as u32;
    let mut page = Pixmap::new(count(scene.width), count(scene.height))
        .ok_or("the page has no pixels, or too many")?;
    page.fill(ground);
    let tree = tree(&svg::write(scene, Target::Pixels { dpi }), dpi)?;
    resvg::render(&tree, Transform::identity(), &mut page.as_mut());
    Ok(page)
}

fn colours(page: &Pixmap) -> Vec<Colour> {
    let pixels = page.pixels().iter().map(PremultipliedColorU8::demultiply);
    pixels
        .map(|c| Colour {
            r: c.red(),
            g: c.green(),
            b: c.blue(),
            a: c.alpha(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{Segment, Stroke};

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
        let scene = Scene {
            width: 20.0,
            height: 20.0,
            title: String::new(),
            items: vec![Item::Path(curl())],
        };
        let whole = tree(&svg::write(&scene, Target::Svg), 254.0).unwrap();
        let mut page = Pixmap::new(200, 200).unwrap();
        resvg::render(&whole, Transform::identity(), &mut page.as_mut());
        let whole = colours(&page);
        let pieces = colours(&pixels(&scene, Color::WHITE, 254.0).unwrap());
        let svg = svg::write(&scene, Target::Pixels { dpi: 254.0 });
        assert!(svg.matches("<path").count() >= 3);
        let off = pieces
            .iter()
            .zip(&whole)
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
        let raster = path_raster(&path).unwrap();
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
