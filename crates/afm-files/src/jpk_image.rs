//! Images of JPK: a TIFF whose first directory is a thumbnail with the size of the scan, and whose
//! other directories are the channels, with private tags for their units.

use std::collections::BTreeMap;

use crate::bytes::{Bytes, Encoding, Number};
use crate::document::{Document, Image};
use crate::limits::{Budget, MAX_CHANNELS, at_most};
use crate::text::until_zero;
use crate::{Error, Format, Limits};

/// Directories of a file.
const MAX_DIRECTORIES: usize = 1000;
/// Bytes of a value in a directory.
const MAX_VALUE: usize = 1 << 20;
/// Largest photometric interpretation of a picture in grey.
const GREY: f64 = 1.0;
const NAME: u16 = 0x8050;
const PROPERTIES: u16 = 0x8053;
const SLOTS: u16 = 0x8080;
const DEFAULT_SLOT: u16 = 0x8081;
const FIRST_SLOT: u16 = 0x8090;
const SLOT_STEP: u16 = 0x30;
const SCAN_SIZE: [u16; 2] = [0x8042, 0x8043];

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let mut document = Document::new(Format::JpkImage, limits);
    document.images = images(bytes, &mut Budget::new(limits))?;
    Ok(document)
}

/// A value of a directory: text, or numbers.
#[derive(Debug)]
enum Value {
    Text(String),
    Numbers(Vec<f64>),
}

/// Values of a directory by their tags.
#[derive(Debug, Default)]
struct Directory(BTreeMap<u16, Value>);

impl Directory {
    fn text(&self, tag: u16) -> Option<&str> {
        match self.0.get(&tag)? {
            Value::Text(text) => Some(text),
            Value::Numbers(_) => None,
        }
    }

    fn numbers(&self, tag: u16) -> &[f64] {
        match self.0.get(&tag) {
            Some(Value::Numbers(numbers)) => numbers,
            _ => &[],
        }
    }

    fn number(&self, tag: u16) -> Option<f64> {
        self.numbers(tag)
            .first()
            .copied()
            .filter(|of| of.is_finite())
    }
}

/// All channels of a file.
pub(crate) fn images(bytes: &[u8], budget: &mut Budget) -> Result<Vec<Image>, Error> {
    let big_endian = bytes.starts_with(b"MM");
    let bytes = Bytes::new(bytes, Format::JpkImage);
    let mut images = Vec::new();
    let mut seen = Vec::new();
    let mut size = None;
    let mut at = bytes.whole(4, 4, big_endian)? as usize;
    while at != 0 {
        at_most(seen.len() + 1, MAX_DIRECTORIES, "directories in a TIFF")?;
        if seen.contains(&at) {
            return Err(Format::JpkImage.at_byte(
                at,
                "a directory for the second time",
                "the next one",
            ));
        }
        let (directory, next) = directory(&bytes, at, big_endian, budget)?;
        if seen.is_empty() {
            let [width, height] = SCAN_SIZE.map(|tag| directory.number(tag));
            size = width.zip(height).map(|(width, height)| [width, height]);
        }
        seen.push(at);
        if let Some(name) = directory.text(NAME) {
            at_most(images.len() + 1, MAX_CHANNELS, "images in a file")?;
            let place = Place {
                bytes,
                at,
                big_endian,
                size,
            };
            images.extend(image(&place, &directory, name, budget)?);
        }
        at = next;
    }
    if images.is_empty() {
        return Err(
            Format::JpkImage.unsupported("a TIFF without channels of JPK", "only those are read")
        );
    }
    Ok(images)
}

/// Reads a directory; gives the place of the next one too.
fn directory(
    bytes: &Bytes,
    at: usize,
    big_endian: bool,
    budget: &mut Budget,
) -> Result<(Directory, usize), Error> {
    let count = bytes.whole(at, 2, big_endian)? as usize;
    let mut directory = Directory::default();
    for k in 0..count {
        let entry = at + 2 + 12 * k;
        let tag = bytes.whole(entry, 2, big_endian)? as u16;
        let kind = bytes.whole(entry + 2, 2, big_endian)?;
        let items = bytes.whole(entry + 4, 4, big_endian)? as usize;
        let number = match kind {
            1 | 2 => Number::Unsigned(1),
            3 => Number::Unsigned(2),
            4 => Number::Unsigned(4),
            6 => Number::Signed(1),
            8 => Number::Signed(2),
            9 => Number::Signed(4),
            11 => Number::Float(4),
            12 => Number::Float(8),
            _ => continue,
        };
        let length = items.saturating_mul(number.size());
        at_most(length, MAX_VALUE, "bytes in a value of a TIFF")?;
        budget.take(8 * length as u64)?;
        let place = if length <= 4 {
            entry + 8
        } else {
            bytes.whole(entry + 8, 4, big_endian)? as usize
        };
        let raw = bytes.slice(place, length)?;
        let value = if kind == 2 {
            Value::Text(until_zero(raw))
        } else {
            Value::Numbers(Encoding { number, big_endian }.all(raw).collect())
        };
        directory.0.insert(tag, value);
    }
    let next = bytes.whole(at + 2 + 12 * count, 4, big_endian)? as usize;
    Ok((directory, next))
}

/// Where a directory is, and the size of the scan.
struct Place<'a> {
    bytes: Bytes<'a>,
    at: usize,
    big_endian: bool,
    size: Option<[f64; 2]>,
}

/// The channel of a directory; `None` for a picture in colours.
fn image(
    place: &Place,
    directory: &Directory,
    name: &str,
    budget: &mut Budget,
) -> Result<Option<Image>, Error> {
    let Place {
        bytes,
        at,
        big_endian,
        size,
    } = *place;
    if directory.number(262).is_some_and(|of| of > GREY) {
        return Ok(None);
    }
    let damaged = |problem: String, expected: &str| Format::JpkImage.at_byte(at, problem, expected);
    let side = |tag: u16| directory.number(tag).unwrap_or(0.0) as usize;
    let shape = [side(256), side(257)];
    let bits = directory.number(258).unwrap_or(1.0);
    let width = match bits {
        8.0 => 1,
        16.0 => 2,
        32.0 => 4,
        _ => return Err(damaged(format!("{bits} bits a point"), "8, 16 or 32")),
    };
    let number = match directory.number(339).unwrap_or(1.0) {
        2.0 => Number::Signed(width),
        3.0 if width == 4 => Number::Float(width),
        _ => Number::Unsigned(width),
    };
    if directory.number(259).is_some_and(|of| of != 1.0) {
        return Err(damaged(
            "a compressed channel".to_owned(),
            "numbers as they are",
        ));
    }
    let points = shape[0].saturating_mul(shape[1]);
    budget.numbers(points)?;
    let (starts, lengths) = (directory.numbers(273), directory.numbers(279));
    let mut values = Vec::new();
    let encoding = Encoding { number, big_endian };
    for (start, length) in starts.iter().zip(lengths) {
        let strip = bytes.slice(*start as usize, *length as usize)?;
        at_most(
            values.len() + strip.len() / width,
            points,
            "points in an image",
        )?;
        values.extend(encoding.all(strip));
    }
    if values.len() != points || points == 0 {
        let problem = format!("{} points in its strips", values.len());
        return Err(damaged(problem, &format!("{} × {}", shape[0], shape[1])));
    }
    let mut unit = "";
    let default = directory.text(DEFAULT_SLOT);
    for slot in 0..(side(SLOTS).min(64) as u16) {
        let first = FIRST_SLOT + SLOT_STEP * slot;
        let is_linear = directory.text(first + 0x13) == Some("LinearScaling");
        if directory.text(first) == default && is_linear {
            let factor = directory.number(first + 0x14).unwrap_or(1.0);
            let offset = directory.number(first + 0x15).unwrap_or(0.0);
            for of in &mut values {
                *of = *of * factor + offset;
            }
            unit = directory.text(first + 0x12).unwrap_or("");
        }
    }
    let properties = directory.text(PROPERTIES).unwrap_or("");
    let direction = if properties.contains("retrace : true") {
        "retrace"
    } else {
        "trace"
    };
    // The first line in the file is the lowest.
    Ok(Some(
        Image::new(format!("{name} {direction}"), unit, shape, size, values).flipped(),
    ))
}
