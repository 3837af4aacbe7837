//! Text set as letter shapes: measuring, sub- and superscripts, italics.

use crate::colour::Colour;
use crate::font::{CAP_HEIGHT, Cut, DESCENT, Glyph};
use crate::shape::{Point, Segment};

/// Millimetres in a typographer's point.
pub(crate) const MM_PER_POINT: f64 = 25.4 / 72.0;
/// Size of sub- and superscripts relative to their letter.
const SCRIPT_SIZE: f64 = 0.7;
/// Shift of superscripts (up) and subscripts (down) relative to the type size.
const RAISE: f64 = 0.34;
const LOWER: f64 = 0.16;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Script {
    Normal,
    Sub,
    Super,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Letter {
    character: char,
    script: Script,
    italic: bool,
}

/// Letters of the same size on the same baseline, ready to draw.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    /// Type size of the letters, mm.
    pub(crate) size: f64,
    /// Letters with the positions of their origins, mm from the text's origin, y upwards.
    pub(crate) glyphs: Vec<(Glyph, f64, f64)>,
}

/// A line of text, set but not yet placed. Lengths in mm.
#[derive(Debug, Clone)]
pub(crate) struct Words {
    pub(crate) runs: Vec<Run>,
    pub(crate) width: f64,
    pub(crate) size: f64,
    /// The text in plain characters, for readers that cannot see shapes.
    pub(crate) plain: String,
}

/// Horizontal anchor of the text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Across {
    Left,
    Centre,
    Right,
}

/// Vertical anchor of the text. Heights are those of capitals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Upright {
    Top,
    Middle,
    Baseline,
    /// At the depth of the descenders.
    Bottom,
}

/// A set line of text with its position on the page.
#[derive(Debug, Clone)]
pub(crate) struct PlacedWords {
    pub(crate) words: Words,
    /// Origin (left end of the baseline), mm from the top left of the page.
    pub(crate) origin: Point,
    /// Rotated by 90° to the left, to be read from below.
    pub(crate) upwards: bool,
    pub(crate) colour: Colour,
}

impl Words {
    /// Sets `source` at `points` (pt) in the given weight.
    ///
    /// Markup: `_{…}` lowers and `^{…}` raises. Between dollar signs Latin and small Greek letters
    /// are italic, and `_x`, `^x` need no braces. A backslash makes the next character literal. The
    /// Unicode sub- and superscripts (₁, ⁻³) are set like the markup.
    pub(crate) fn set(source: &str, points: f64, bold: bool) -> Words {
        let size = points * MM_PER_POINT;
        let letters = parse(source);
        let mut runs: Vec<Run> = Vec::new();
        let mut plain = String::new();
        let mut pen = 0.0;
        let mut before = Script::Normal;
        let mut last: Option<(Glyph, f64)> = None;
        for letter in &letters {
            plain.push(letter.character);
            let cut = match (bold, letter.italic) {
                (true, _) => Cut::Bold,
                (false, true) => Cut::Italic,
                (false, false) => Cut::Regular,
            };
            let (scale, lift) = match letter.script {
                Script::Normal => (1.0, 0.0),
                Script::Sub => (SCRIPT_SIZE, -LOWER),
                Script::Super => (SCRIPT_SIZE, RAISE),
            };
            let em = size * scale;
            if letter.script != before && letter.script != Script::Normal {
                pen += 0.03 * size;
            }
            before = letter.script;
            let glyph = Glyph::of(cut, letter.character);
            let mut at = (pen, lift * size);
            if ('\u{300}'..='\u{36f}').contains(&letter.character) {
                if let Some((base, origin)) = last {
                    let (dx, dy) = glyph.over(base);
                    at = (origin + dx * em, at.1 + dy * em);
                }
            } else {
                last = Some((glyph, pen));
                pen += glyph.advance() * em;
            }
            match runs.last_mut() {
                Some(run) if run.size == em => run.glyphs.push((glyph, at.0, at.1)),
                _ => runs.push(Run {
                    size: em,
                    glyphs: vec![(glyph, at.0, at.1)],
                }),
            }
        }
        Words {
            runs,
            width: pen,
            size,
            plain,
        }
    }

    pub(crate) fn cap_height(&self) -> f64 {
        CAP_HEIGHT * self.size
    }

    pub(crate) fn descent(&self) -> f64 {
        DESCENT * self.size
    }

    /// Places the text horizontally at `at`.
    pub(crate) fn place(
        self,
        at: Point,
        across: Across,
        upright: Upright,
        colour: Colour,
    ) -> PlacedWords {
        let (along, below) = self.shift(across, upright);
        PlacedWords {
            origin: Point::new(at.x + along, at.y + below),
            words: self,
            upwards: false,
            colour,
        }
    }

    /// Places the text at `at`, rotated to be read from below: "across" then runs up the page.
    pub(crate) fn place_upwards(
        self,
        at: Point,
        across: Across,
        upright: Upright,
        colour: Colour,
    ) -> PlacedWords {
        let (along, below) = self.shift(across, upright);
        PlacedWords {
            origin: Point::new(at.x + below, at.y - along),
            words: self,
            upwards: true,
            colour,
        }
    }

    fn shift(&self, across: Across, upright: Upright) -> (f64, f64) {
        let along = match across {
            Across::Left => 0.0,
            Across::Centre => -self.width / 2.0,
            Across::Right => -self.width,
        };
        let below = match upright {
            Upright::Top => self.cap_height(),
            Upright::Middle => self.cap_height() / 2.0,
            Upright::Baseline => 0.0,
            Upright::Bottom => -self.descent(),
        };
        (along, below)
    }
}

impl PlacedWords {
    /// The shapes of all letters on the page, mm.
    pub(crate) fn outline(&self) -> Vec<Segment> {
        let mut all = Vec::new();
        for run in &self.words.runs {
            for &(glyph, x, y) in &run.glyphs {
                let (segments, units) = glyph.outline();
                let scale = run.size / units;
                all.extend(segments.into_iter().map(|segment| {
                    segment.map(|p| {
                        let (along, up) = (x + p.x * scale, y + p.y * scale);
                        if self.upwards {
                            Point::new(self.origin.x - up, self.origin.y - along)
                        } else {
                            Point::new(self.origin.x + along, self.origin.y - up)
                        }
                    })
                }));
            }
        }
        all
    }
}

/// A label in matplotlib's mathtext: formulas between dollar signs, with letters that are not
/// variables upright.
pub fn mathtext(source: &str) -> String {
    let mut text = String::new();
    let mut maths = false;
    let mut before = Script::Normal;
    for letter in parse(source) {
        let needed = letter.italic || letter.script != Script::Normal;
        if before != Script::Normal && letter.script != before {
            text.push('}');
        }
        if needed != maths {
            text.push('$');
            maths = needed;
        }
        if letter.script != before {
            text.push_str(match letter.script {
                Script::Normal => "",
                Script::Sub => "_{",
                Script::Super => "^{",
            });
        }
        before = letter.script;
        match letter.character {
            '$' => text.push_str("\\$"),
            // In formulas an accent comes before its letter.
            mark @ '\u{300}'..='\u{36f}' => {
                let command = match mark {
                    '\u{302}' => "\\hat ",
                    '\u{304}' => "\\bar ",
                    '\u{308}' => "\\ddot ",
                    _ => "\\dot ",
                };
                let place = text.char_indices().last().map_or(0, |(place, _)| place);
                text.insert_str(place, command);
            }
            character if maths && !letter.italic && character.is_alphabetic() => {
                text.push_str("\\mathrm{");
                text.push(character);
                text.push('}');
            }
            character if maths && matches!(character, '%' | '#' | '_' | '{' | '}') => {
                text.push('\\');
                text.push(character);
            }
            character => text.push(character),
        }
    }
    if before != Script::Normal {
        text.push('}');
    }
    if maths {
        text.push('$');
    }
    text
}

fn parse(source: &str) -> Vec<Letter> {
    let mut letters = Vec::new();
    let mut maths = false;
    let mut script = Script::Normal;
    let mut braces = false;
    let mut single = false;
    let mut characters = source.chars().peekable();
    while let Some(character) = characters.next() {
        let mut taken = character;
        let mut literal = false;
        match character {
            '\\' => {
                let Some(next) = characters.next() else { break };
                taken = next;
                literal = true;
            }
            '$' => {
                maths = !maths;
                continue;
            }
            '_' | '^' => {
                let open = characters.peek() == Some(&'{');
                if open || maths {
                    script = if character == '_' {
                        Script::Sub
                    } else {
                        Script::Super
                    };
                    braces = open;
                    single = !open;
                    if open {
                        characters.next();
                    }
                    continue;
                }
            }
            '}' if braces => {
                script = Script::Normal;
                braces = false;
                continue;
            }
            _ => {}
        }
        let mut own = script;
        if !literal && let Some((plain, is)) = unicode_script(taken) {
            taken = plain;
            own = is;
        }
        if !literal && taken == '-' && (maths || own != Script::Normal) {
            taken = '−';
        }
        let italic = maths && is_variable(taken) && !(braces && own == Script::Sub);
        letters.push(Letter {
            character: taken,
            script: own,
            italic,
        });
        if single {
            script = Script::Normal;
            single = false;
        }
    }
    letters
}

/// Whether mathematicians set the letter in italics: Latin letters, with or without dots, and small
/// Greek ones.
fn is_variable(character: char) -> bool {
    character.is_ascii_alphabetic()
        || matches!(character, 'α'..='ω' | 'ϑ' | 'ϕ' | '\u{300}'..='\u{36f}')
        || (character.is_alphabetic()
            && matches!(character, '\u{c0}'..='\u{24f}' | '\u{1e00}'..='\u{1eff}'))
}

/// The plain character of a Unicode sub- or superscript.
fn unicode_script(character: char) -> Option<(char, Script)> {
    const SUPER: &str = "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ";
    const SUB: &str = "₀₁₂₃₄₅₆₇₈₉₊₋ₙ";
    const PLAIN: &str = "0123456789+−n";
    let find = |list: &str| list.chars().position(|c| c == character);
    let plain = |index| PLAIN.chars().nth(index);
    if let Some(index) = find(SUPER) {
        return plain(index).map(|c| (c, Script::Super));
    }
    find(SUB).and_then(plain).map(|c| (c, Script::Sub))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lowered letters after "_", raised ones after "^", italic ones after "*".
    fn show(source: &str) -> String {
        let mut shown = String::new();
        for letter in parse(source) {
            match letter.script {
                Script::Normal => {}
                Script::Sub => shown.push('_'),
                Script::Super => shown.push('^'),
            }
            if letter.italic {
                shown.push('*');
            }
            shown.push(letter.character);
        }
        shown
    }

    #[test]
    fn markup() {
        assert_eq!(show("Ω"), "Ω");
        assert_eq!(show("10^{-3}"), "10^−^3");
        assert_eq!(show("$a_1$, a₁"), "*a_1, a_1");
        assert_eq!(show("$E_{dis}$"), "*E_d_i_s");
        assert_eq!(show("contact_fraction"), "contact_fraction");
        assert_eq!(show("5 \\$"), "5 $");
        assert_eq!(show("$Ω$ / $τ$"), "Ω / *τ");
        assert_eq!(show("$ẆŴȧẋ×5$"), "*Ẇ*Ŵ*ȧ*ẋ×5");
        assert_eq!(show("}{^"), "}{^");
    }

    #[test]
    fn matplotlib_reads_the_same() {
        for (source, expected) in [
            (
                "time $τ / T$ (drive periods)",
                "time $τ$ / $T$ (drive periods)",
            ),
            (
                "$E_{dis}$ (aJ)",
                "$E_{dis}$ (aJ)"
                    .replace("dis", "\\mathrm{d}\\mathrm{i}\\mathrm{s}")
                    .as_str(),
            ),
            ("10^{-3}", "10$^{−3}$"),
            ("$a_1$", "$a_{1}$"),
            ("a₁", "a$_{1}$"),
            ("$x\u{302}_n$", "$\\hat x_{n}$"),
            ("5 \\$", "5 \\$"),
            ("", ""),
        ] {
            assert_eq!(mathtext(source), expected);
        }
    }

    #[test]
    fn widths_add_up() {
        let width = |s: &str| Words::set(s, 8.0, false).width;
        assert!((width("ab") - width("a") - width("b")).abs() < 1e-12);
        // A dot over a letter has no width.
        assert_eq!(width("$V\u{307}$"), width("$V$"));
        assert!(width("10^{3}") < width("103"));
        assert_eq!(width(""), 0.0);
    }

    #[test]
    fn placed_words_lie_where_they_were_put() {
        let bounds = |placed: &PlacedWords| {
            let mut b = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
            for segment in placed.outline() {
                segment.map(|p| {
                    b = [b[0].min(p.x), b[1].min(p.y), b[2].max(p.x), b[3].max(p.y)];
                    p
                });
            }
            b
        };
        let words = Words::set("HHH", 10.0, false);
        let width = words.width;
        let at = Point::new(50.0, 40.0);
        let level = bounds(&words.clone().place(
            at,
            Across::Centre,
            Upright::Middle,
            Colour::BLACK,
        ));
        assert!(
            (level[0] + level[2] - 100.0).abs() < 0.1 && (level[1] + level[3] - 80.0).abs() < 0.1
        );
        let up = bounds(&words.place_upwards(at, Across::Left, Upright::Baseline, Colour::BLACK));
        assert!(up[2] < 50.01 && up[3] < 40.0 && up[1] > 40.0 - width);
    }
}
