//! The typeface: Noto Sans, included in the program so that no font needs to be installed.

use std::sync::OnceLock;

use ttf_parser::{Face, GlyphId, OutlineBuilder};

use crate::shape::{Point, Segment};

/// A variant of the typeface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Cut {
    Regular,
    Italic,
    Bold,
}

impl Cut {
    /// Letter that identifies the variant in SVG identifiers.
    pub(crate) fn letter(self) -> char {
        match self {
            Cut::Regular => 'r',
            Cut::Italic => 'i',
            Cut::Bold => 'b',
        }
    }

    fn face(self) -> Option<&'static Face<'static>> {
        static FACES: OnceLock<[Option<Face<'static>>; 3]> = OnceLock::new();
        let faces = FACES.get_or_init(|| {
            [
                notosans::REGULAR_TTF,
                notosans::ITALIC_TTF,
                notosans::BOLD_TTF,
            ]
            .map(|bytes| Face::parse(bytes, 0).ok())
        });
        faces[self as usize].as_ref()
    }
}

/// Height of capitals and digits relative to the type size (Noto Sans: 1462/2048).
pub(crate) const CAP_HEIGHT: f64 = 0.714;
/// Height of small letters relative to the type size (Noto Sans: 1096/2048).
const X_HEIGHT: f64 = 0.535;
/// Depth of descenders relative to the type size.
pub(crate) const DESCENT: f64 = 0.24;

/// Shape of a letter: a glyph of one of the fonts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Glyph {
    pub(crate) cut: Cut,
    pub(crate) id: u16,
}

impl Glyph {
    /// The shape of a character; a character that the typeface lacks has the shape of its "missing"
    /// box.
    pub(crate) fn of(cut: Cut, character: char) -> Glyph {
        let id = cut
            .face()
            .and_then(|face| face.glyph_index(character))
            .map_or(0, |id| id.0);
        Glyph { cut, id }
    }

    /// Distance to the next letter relative to the type size.
    pub(crate) fn advance(self) -> f64 {
        self.cut.face().map_or(0.6, |face| {
            let units = f64::from(face.units_per_em());
            f64::from(face.glyph_hor_advance(GlyphId(self.id)).unwrap_or(0)) / units
        })
    }

    /// Left, bottom, right and top of the ink relative to the type size.
    fn ink(self) -> Option<[f64; 4]> {
        let face = self.cut.face()?;
        let units = f64::from(face.units_per_em());
        let ink = face.glyph_bounding_box(GlyphId(self.id))?;
        Some([ink.x_min, ink.y_min, ink.x_max, ink.y_max].map(|v| f64::from(v) / units))
    }

    /// Shift that sets this combining mark (drawn for small letters) over the letter `base` whose
    /// origin is at 0.
    pub(crate) fn over(self, base: Glyph) -> (f64, f64) {
        match (self.ink(), base.ink()) {
            (Some(mark), Some(letter)) => (
                f64::midpoint(letter[0], letter[2]) - f64::midpoint(mark[0], mark[2]),
                (letter[3] - X_HEIGHT).max(0.0),
            ),
            _ => (0.0, 0.0),
        }
    }

    /// The outline, in font units with y upwards, and the number of units in the type size.
    pub(crate) fn outline(self) -> (Vec<Segment>, f64) {
        let mut pen = Pen(Vec::new());
        let mut units = 1.0;
        if let Some(face) = self.cut.face() {
            units = f64::from(face.units_per_em());
            face.outline_glyph(GlyphId(self.id), &mut pen);
        }
        (pen.0, units)
    }
}

struct Pen(Vec<Segment>);

fn point(x: f32, y: f32) -> Point {
    Point::new(f64::from(x), f64::from(y))
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.push(Segment::Move(point(x, y)));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.push(Segment::Line(point(x, y)));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.push(Segment::Quad(point(x1, y1), point(x, y)));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0
            .push(Segment::Cubic(point(x1, y1), point(x2, y2), point(x, y)));
    }

    fn close(&mut self) {
        self.0.push(Segment::Close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sign_of_the_field_exists() {
        let signs = "0123456789 ABCXYZabcxyz()[]/.,:;=+-−×·±≤≥≈≠→←∞∂√°–—…′ΩταξμλβωφσπδεγθνρψηκχζΔΣΦΨΛΓẋȧẇẍ²³½µÅ\u{307}\u{308}\u{302}\u{304}";
        for cut in [Cut::Regular, Cut::Italic, Cut::Bold] {
            for sign in signs.chars() {
                let glyph = Glyph::of(cut, sign);
                assert_ne!(glyph.id, 0, "{cut:?} lacks {sign:?}");
                let ink = !glyph.outline().0.is_empty();
                assert_eq!(ink, sign != ' ', "{cut:?} {sign:?}");
            }
        }
    }

    #[test]
    fn heights_are_those_of_the_face() {
        let top = |c| Glyph::of(Cut::Regular, c).ink().unwrap()[3];
        assert!((top('H') - CAP_HEIGHT).abs() < 0.01);
        assert!((top('x') - X_HEIGHT).abs() < 0.01);
    }

    #[test]
    fn a_dot_sits_above_its_letter() {
        let letter = Glyph::of(Cut::Italic, 'V');
        let mark = Glyph::of(Cut::Italic, '\u{307}');
        let (_, up) = mark.over(letter);
        assert!(mark.ink().unwrap()[1] + up > letter.ink().unwrap()[3]);
    }
}
