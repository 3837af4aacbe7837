//! The page as SVG.
//!
//! Letters are drawn as shapes, not as text, so that the picture looks the same on every machine,
//! whatever fonts it has. The characters of each text are in an `aria-label`, for search and for
//! screen readers.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use base64::Engine as _;

use crate::MADE_BY;
use crate::canvas::{self, Canvas};
use crate::colour::Colour;
use crate::font::Glyph;
use crate::raster::Raster;
use crate::scene::Scene;
use crate::shape::{Path, Point, Rect, Segment, micrometres};
use crate::text::PlacedWords;

/// Placeholder for the page's own prefix of identifiers until the whole page is known.
const PREFIX: char = '\u{1}';

pub(crate) fn write(scene: &Scene) -> String {
    let mut page = Page::default();
    canvas::draw(scene, &mut page);
    let mut svg = String::new();
    let (width, height) = (number(scene.width), number(scene.height));
    let _ = writeln!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" \
         width=\"{width}mm\" height=\"{height}mm\" viewBox=\"0 0 {width} {height}\" role=\"img\">"
    );
    if !scene.title.is_empty() {
        let _ = writeln!(svg, "<title>{}</title>", escaped(&scene.title));
    }
    let _ = writeln!(svg, "<!-- Made by {MADE_BY} -->");
    svg.push_str("<defs>\n");
    svg.push_str(&page.definitions());
    svg.push_str("</defs>\n");
    let _ = writeln!(
        svg,
        "<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>"
    );
    svg.push_str(&page.body);
    svg.push_str("</svg>\n");
    // Several figures in one HTML page must not share identifiers.
    let prefix = format!("f{:08x}-", fingerprint(svg.as_bytes()));
    svg.replace(PREFIX, &prefix)
}

/// FNV-1a, 32 bits: the same on every machine and in every version, which std's hasher does not
/// guarantee.
fn fingerprint(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |hash, &byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}

#[derive(Default)]
struct Page {
    body: String,
    glyphs: BTreeSet<Glyph>,
    clips: Vec<Rect>,
}

impl Page {
    fn definitions(&self) -> String {
        let mut text = String::new();
        for glyph in &self.glyphs {
            let (segments, _) = glyph.outline();
            let _ = writeln!(
                text,
                "<path id=\"{}\" d=\"{}\"/>",
                glyph_name(*glyph),
                // Font units are whole numbers.
                path_data(&segments, 0)
            );
        }
        for (index, clip) in self.clips.iter().enumerate() {
            let _ = writeln!(
                text,
                "<clipPath id=\"{PREFIX}c{index}\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>",
                number(clip.left),
                number(clip.top),
                number(clip.width()),
                number(clip.height())
            );
        }
        text
    }

    fn clip(&mut self, rect: Rect) -> String {
        let index = self
            .clips
            .iter()
            .position(|c| *c == rect)
            .unwrap_or_else(|| {
                self.clips.push(rect);
                self.clips.len() - 1
            });
        format!(" clip-path=\"url(#{PREFIX}c{index})\"")
    }

    fn paint(&mut self, what: &str, colour: Colour) {
        let _ = write!(
            self.body,
            " {what}=\"#{:02x}{:02x}{:02x}\"",
            colour.r, colour.g, colour.b
        );
        if colour.a < 255 {
            let _ = write!(
                self.body,
                " {what}-opacity=\"{}\"",
                number(colour.opacity())
            );
        }
    }
}

impl Canvas for Page {
    fn open(&mut self, class: &str, label: &str) {
        let _ = write!(self.body, "<g class=\"{class}\"");
        if !label.is_empty() {
            let _ = write!(self.body, " aria-label=\"{}\"", escaped(label));
        }
        self.body.push_str(">\n");
    }

    fn close(&mut self) {
        self.body.push_str("</g>\n");
    }

    fn path(&mut self, path: &Path) {
        if path.segments.is_empty() {
            return;
        }
        let clip = path.clip.map(|rect| self.clip(rect)).unwrap_or_default();
        let _ = write!(
            self.body,
            "<path d=\"{}\"{clip}",
            path_data(&path.segments, 3)
        );
        match path.fill {
            Some(colour) => self.paint("fill", colour),
            None => self.body.push_str(" fill=\"none\""),
        }
        if let Some(stroke) = &path.stroke {
            self.paint("stroke", stroke.colour);
            let _ = write!(self.body, " stroke-width=\"{}\"", number(stroke.width));
            if !stroke.dash.is_empty() {
                let dash: Vec<String> = stroke.dash.iter().map(|d| number(*d)).collect();
                let _ = write!(self.body, " stroke-dasharray=\"{}\"", dash.join(" "));
            }
            if stroke.round {
                self.body.push_str(" stroke-linecap=\"round\"");
            }
            self.body.push_str(" stroke-linejoin=\"round\"");
        }
        self.body.push_str("/>\n");
    }

    fn words(&mut self, placed: &PlacedWords) {
        let turn = if placed.upwards { " rotate(-90)" } else { "" };
        let _ = write!(
            self.body,
            "<g role=\"text\" aria-label=\"{}\" transform=\"translate({} {}){turn}\"",
            escaped(&placed.words.plain),
            number(placed.origin.x),
            number(placed.origin.y)
        );
        self.paint("fill", placed.colour);
        self.body.push('>');
        for run in &placed.words.runs {
            let Some(&(first, x0, y0)) = run.glyphs.first() else {
                continue;
            };
            let scale = run.size / first.outline().1;
            let _ = write!(
                self.body,
                "<g transform=\"translate({} {}) scale({scale:.7} -{scale:.7})\">",
                number(x0),
                number(-y0)
            );
            for &(glyph, x, y) in &run.glyphs {
                if glyph.outline().0.is_empty() {
                    continue;
                }
                self.glyphs.insert(glyph);
                let (dx, dy) = (((x - x0) / scale).round(), ((y - y0) / scale).round());
                let _ = write!(self.body, "<use xlink:href=\"#{}\"", glyph_name(glyph));
                if dx != 0.0 {
                    let _ = write!(self.body, " x=\"{dx}\"");
                }
                if dy != 0.0 {
                    let _ = write!(self.body, " y=\"{dy}\"");
                }
                self.body.push_str("/>");
            }
            self.body.push_str("</g>");
        }
        self.body.push_str("</g>\n");
    }

    fn raster(&mut self, raster: &Raster) {
        let clip = self.clip(raster.clip);
        let data = base64::engine::general_purpose::STANDARD.encode(raster.png());
        // The clip is on a group because some viewers ignore it on images.
        let _ = writeln!(
            self.body,
            "<g{clip}><image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" \
             image-rendering=\"pixelated\" xlink:href=\"data:image/png;base64,{data}\"/></g>",
            number(raster.rect.left),
            number(raster.rect.top),
            number(raster.rect.width()),
            number(raster.rect.height()),
        );
    }
}

fn glyph_name(glyph: Glyph) -> String {
    format!("{PREFIX}{}{}", glyph.cut.letter(), glyph.id)
}

/// A length in mm, to the micrometre.
fn number(value: f64) -> String {
    decimal(micrometres(value), 3)
}

/// A whole number of 10^−`places`, without unnecessary digits.
fn decimal(units: i64, places: u32) -> String {
    let one = 10u64.pow(places);
    let size = units.unsigned_abs();
    let mut text = String::new();
    if units < 0 {
        text.push('-');
    }
    if size >= one || size == 0 {
        let _ = write!(text, "{}", size / one);
    }
    if !size.is_multiple_of(one) {
        let rest = format!("{:0width$}", size % one, width = places as usize);
        text.push('.');
        text.push_str(rest.trim_end_matches('0'));
    }
    text
}

/// Path data with steps relative to the previous point, which is shortest; rounding errors do not
/// accumulate.
fn path_data(segments: &[Segment], places: u32) -> String {
    let scale = 10f64.powi(places as i32);
    let whole = |p: Point| ((p.x * scale).round() as i64, (p.y * scale).round() as i64);
    let mut text = String::new();
    let mut at = (0i64, 0i64);
    let mut start = at;
    let mut command = ' ';
    for segment in segments {
        let (letter, points): (char, Vec<Point>) = match *segment {
            Segment::Move(p) => ('m', vec![p]),
            Segment::Line(p) => ('l', vec![p]),
            Segment::Quad(a, p) => ('q', vec![a, p]),
            Segment::Cubic(a, b, p) => ('c', vec![a, b, p]),
            Segment::Close => {
                text.push('z');
                command = 'z';
                at = start;
                continue;
            }
        };
        // A repeated "m" would be read as a line.
        if letter != command || letter == 'm' {
            text.push(letter);
        }
        command = letter;
        let mut end = at;
        for p in points {
            end = whole(p);
            for step in [end.0 - at.0, end.1 - at.1] {
                let step = decimal(step, places);
                if !step.starts_with('-') && !text.ends_with(|c: char| c.is_ascii_alphabetic()) {
                    text.push(' ');
                }
                text.push_str(&step);
            }
        }
        at = end;
        if letter == 'm' {
            start = at;
        }
    }
    text
}

fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            // XML does not allow control characters.
            c if c.is_control() => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0001, "0"),
            (1.0, "1"),
            (0.25, ".25"),
            (-0.05, "-.05"),
            (86.1004, "86.1"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn path_steps_are_relative() {
        let path = [
            Segment::Move(Point::new(1.0, 2.0)),
            Segment::Line(Point::new(1.5, 1.0)),
            Segment::Line(Point::new(2.0, 3.0)),
            Segment::Close,
            Segment::Move(Point::new(1.0, 2.5)),
        ];
        assert_eq!(path_data(&path, 3), "m1 2l.5-1 .5 2zm0 .5");
    }

    #[test]
    fn markup_in_labels_is_harmless() {
        assert_eq!(escaped("a<b & \"c\"\u{7}"), "a&lt;b &amp; &quot;c&quot; ");
    }
}
