//! Gwyddion's own format: one tree of objects, each with named components (user guide of Gwyddion).

use crate::bytes::{Bytes, Encoding, Number};
use crate::document::{Document, Image};
use crate::limits::{Budget, MAX_CHANNELS, MAX_ENTRIES, MAX_LINE, at_most};
use crate::text::utf8_or_windows;
use crate::{Error, Format, Limits};

/// Objects within objects.
const MAX_DEPTH: usize = 32;

/// A component of an object.
#[derive(Debug)]
enum Value<'a> {
    Number(f64),
    Text(&'a [u8]),
    /// Numbers of an array, not decoded.
    Numbers(Encoding, &'a [u8]),
    Object(Object<'a>),
    /// An array of texts or objects: nothing here needs them.
    Other,
}

/// An object: name of its type, and its components.
#[derive(Debug)]
struct Object<'a> {
    kind: &'a [u8],
    components: Vec<(&'a [u8], Value<'a>)>,
}

impl<'a> Object<'a> {
    fn get(&self, name: &str) -> Option<&Value<'a>> {
        let found = self
            .components
            .iter()
            .find(|(of, _)| *of == name.as_bytes());
        found.map(|(_, value)| value)
    }

    fn number(&self, name: &str) -> Option<f64> {
        match self.get(name)? {
            Value::Number(number) => Some(*number),
            _ => None,
        }
    }

    fn text(&self, name: &str) -> Option<String> {
        match self.get(name)? {
            Value::Text(text) => Some(utf8_or_windows(text)),
            _ => None,
        }
    }

    fn object(&self, name: &str) -> Option<&Object<'a>> {
        match self.get(name)? {
            Value::Object(object) => Some(object),
            _ => None,
        }
    }
}

/// Reads objects; counts their components.
struct Reader<'a> {
    file: Bytes<'a>,
    count: usize,
}

impl<'a> Reader<'a> {
    fn name(&self, at: usize, end: usize) -> Result<(&'a [u8], usize), Error> {
        let rest = self.file.slice(at, end.saturating_sub(at))?;
        let length = rest.iter().position(|of| *of == 0).ok_or_else(|| {
            Format::Gwyddion.at_byte(
                at,
                "a text without its end",
                "a zero before the object ends",
            )
        })?;
        Ok((&rest[..length], at + length + 1))
    }

    /// The object at a place, and where it ends.
    fn object(
        &mut self,
        at: usize,
        end: usize,
        depth: usize,
    ) -> Result<(Object<'a>, usize), Error> {
        at_most(depth, MAX_DEPTH, "objects within objects")?;
        let (kind, at) = self.name(at, end)?;
        let size = self.file.u32_le(at)?;
        let first = at + 4;
        let stop = first.saturating_add(size);
        if stop > end {
            let problem = format!("an object of {size} bytes");
            return Err(Format::Gwyddion.at_byte(
                at,
                problem,
                format!("at most {}", end.saturating_sub(first)),
            ));
        }
        let mut components = Vec::new();
        let mut at = first;
        while at < stop {
            self.count += 1;
            at_most(self.count, MAX_ENTRIES, "components of objects")?;
            let (name, after) = self.name(at, stop)?;
            let (value, next) = self.value(after, stop, depth)?;
            components.push((name, value));
            at = next;
        }
        Ok((Object { kind, components }, stop))
    }

    /// The component whose type letter is at a place, and where it ends.
    fn value(&mut self, at: usize, stop: usize, depth: usize) -> Result<(Value<'a>, usize), Error> {
        let letter = self.file.slice(at, 1)?[0];
        let at = at + 1;
        let number = match letter.to_ascii_lowercase() {
            b'b' | b'c' => Some(Number::Unsigned(1)),
            b'i' => Some(Number::Signed(4)),
            b'q' => Some(Number::Signed(8)),
            b'd' => Some(Number::Float(8)),
            b's' | b'o' => None,
            _ => {
                let problem = format!("a component of type `{}`", char::from(letter));
                return Err(Format::Gwyddion.at_byte(
                    at - 1,
                    problem,
                    "b, c, i, q, d, s, o or an array",
                ));
            }
        };
        let is_array = letter.is_ascii_uppercase();
        let (count, at) = if is_array {
            (self.file.u32_le(at)?, at + 4)
        } else {
            (1, at)
        };
        if let Some(number) = number {
            let length = count.saturating_mul(number.size());
            if length > stop.saturating_sub(at) {
                let problem = format!("an array of {length} bytes");
                return Err(Format::Gwyddion.at_byte(at, problem, "one inside its object"));
            }
            let raw = self.file.slice(at, length)?;
            let encoding = Encoding::little(number);
            let value = match encoding.all(raw).next() {
                Some(number) if !is_array => Value::Number(number),
                _ => Value::Numbers(encoding, raw),
            };
            return Ok((value, at + length));
        }
        let mut at = at;
        let mut last = Value::Other;
        for _ in 0..count {
            self.count += 1;
            at_most(self.count, MAX_ENTRIES, "components of objects")?;
            if letter.eq_ignore_ascii_case(&b's') {
                let (text, next) = self.name(at, stop)?;
                (last, at) = (Value::Text(text), next);
            } else {
                let (object, next) = self.object(at, stop, depth + 1)?;
                (last, at) = (Value::Object(object), next);
            }
        }
        Ok((if is_array { Value::Other } else { last }, at))
    }
}

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    if bytes.starts_with(b"GWYO") {
        let content = "a Gwyddion file of the old layout (GWYO)";
        return Err(Format::Gwyddion.unsupported(content, "open it in Gwyddion and save it again"));
    }
    let mut reader = Reader {
        file: Bytes::new(bytes, Format::Gwyddion),
        count: 0,
    };
    let (top, _) = reader.object(4, bytes.len(), 0)?;
    let mut document = Document::new(Format::Gwyddion, limits);
    let budget = &mut Budget::new(limits);
    let mut others = 0;
    for (key, value) in &top.components {
        let Value::Object(object) = value else {
            continue;
        };
        let key = utf8_or_windows(key);
        match object.kind {
            b"GwyDataField" if key.ends_with("/data") => {
                at_most(document.images.len() + 1, MAX_CHANNELS, "images in a file")?;
                let title = top.text(&format!("{key}/title"));
                document
                    .images
                    .push(field(object, title.as_ref().unwrap_or(&key), budget)?);
            }
            b"GwyContainer" if key.ends_with("/meta") => {
                let texts = object
                    .components
                    .iter()
                    .filter_map(|(name, value)| match value {
                        Value::Text(text) if text.len() <= MAX_LINE => Some((
                            format!("{key}/{}", utf8_or_windows(name)),
                            utf8_or_windows(text),
                        )),
                        _ => None,
                    });
                document.settings.extend(texts);
            }
            b"GwyGraphModel" | b"GwySpectra" | b"GwyBrick" => others += 1,
            _ => {}
        }
    }
    if others > 0 {
        document.notes.push(format!(
            "{others} graphs, point spectra or volumes are not read"
        ));
    }
    Ok(document)
}

fn field(object: &Object, title: &str, budget: &mut Budget) -> Result<Image, Error> {
    let wrong = |key: &str, expected: &str| {
        Format::Gwyddion.at_key(format!("{title}: {key}"), "missing or wrong", expected)
    };
    let side = |key: &str| {
        let found = object.number(key).filter(|of| *of >= 1.0);
        found
            .map(|of| of as usize)
            .ok_or_else(|| wrong(key, "a count above 0"))
    };
    let shape = [side("xres")?, side("yres")?];
    let Some(Value::Numbers(encoding, raw)) = object.get("data") else {
        return Err(wrong("data", "numbers"));
    };
    let count = raw.len() / encoding.size();
    if shape[0].saturating_mul(shape[1]) != count {
        return Err(wrong("data", "xres · yres numbers"));
    }
    budget.numbers(count)?;
    let unit = |key: &str| {
        object
            .object(key)
            .and_then(|of| of.text("unitstr"))
            .unwrap_or_default()
    };
    let size = object
        .number("xreal")
        .zip(object.number("yreal"))
        .map(|(x, y)| [x, y]);
    let is_length = unit("si_unit_xy") == "m";
    let size = size.filter(|_| is_length);
    Ok(Image::new(
        title,
        &unit("si_unit_z"),
        shape,
        size,
        encoding.all(raw).collect(),
    ))
}
