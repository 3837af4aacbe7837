//! Asylum Research `.ardf`: records with a checksum, a size and four letters, then the content.
//!
//! No file of this format was at hand when this was written, only a description. So nothing relies on
//! the tables of the file: records are found by their letters and believed by their checksums, and
//! numbers are taken only where the sizes of a record agree.

use crate::bytes::{Bytes, Encoding, Number};
use crate::distance::finish;
use crate::document::{Channel, Curve, CurveSource, Document, Grid, Image, Segment, Style};
use crate::igor;
use crate::limits::{Budget, MAX_CHANNELS, MAX_CURVES, MAX_ENTRIES, at_most};
use crate::text::until_zero;
use crate::{Error, Format, Limits};

/// Checksum, size, letters, flags.
const HEAD: usize = 16;
/// Length of a name.
const NAME: usize = 32;
/// Whole numbers before the data of a curve: index, line, point, count, channel, five offsets.
const NUMBERS: usize = 10;
/// Bytes between those numbers and the data, at most.
const MAX_PADDING: usize = 32;
/// Records of the largest kind that is checked.
const LETTERS: [&[u8; 4]; 6] = [b"TEXT", b"VDEF", b"VCHN", b"VDAT", b"IDEF", b"IDAT"];
const FLOAT: Encoding = Encoding::little(Number::Float(4));

/// A record with the right checksum.
#[derive(Clone, Copy, Debug)]
struct Record {
    letters: [u8; 4],
    at: usize,
    size: usize,
}

/// A part of a curve: the numbers of one channel.
#[derive(Clone, Debug)]
struct Data {
    /// Index, line, point, count, channel and five offsets of segments.
    numbers: [usize; NUMBERS],
    first: usize,
    count: usize,
}

/// The curves of a file.
#[derive(Debug)]
struct Volume {
    file: Vec<u8>,
    /// Name and unit of each channel.
    channels: Vec<(String, String)>,
    segments: Vec<Style>,
    /// Parts of each curve.
    curves: Vec<Vec<Data>>,
    grid: Option<Grid>,
    note: Vec<(String, String)>,
}

pub(crate) fn read(bytes: Vec<u8>, limits: Limits) -> Result<Document, Error> {
    let records = records(&bytes)?;
    let file = Bytes::new(&bytes, Format::Ardf);
    let mut document = Document::new(Format::Ardf, limits);
    document.notes.push(
        "this reader of .ardf was written without a real file: compare with the instrument's program"
            .to_owned(),
    );
    let budget = &mut Budget::new(limits);
    let mut volume = Volume {
        file: Vec::new(),
        channels: Vec::new(),
        segments: Vec::new(),
        curves: Vec::new(),
        grid: None,
        note: Vec::new(),
    };
    for record in &records {
        let content = file.slice(record.at + HEAD, record.size - HEAD)?;
        match &record.letters {
            b"TEXT" => volume.note.extend(igor::note(content)),
            b"VDEF" => {
                let shape = [
                    file.u32_le(record.at + HEAD)?,
                    file.u32_le(record.at + HEAD + 4)?,
                ];
                volume.grid = Some(Grid {
                    shape,
                    size: [0.0; 2],
                    centre: [0.0; 2],
                    angle: 0.0,
                    back_and_forth: false,
                });
                volume.segments = segment_names(content);
            }
            b"VCHN" => {
                at_most(volume.channels.len() + 1, MAX_CHANNELS, "channels")?;
                let text = |at: usize| until_zero(content.get(at..at + NAME).unwrap_or_default());
                volume.channels.push((text(0), text(NAME)));
            }
            b"VDAT" => volume.add(&file, record)?,
            b"IDEF" => {
                at_most(document.images.len() + 1, MAX_CHANNELS, "images in a file")?;
                let shape = [
                    file.u32_le(record.at + HEAD)?,
                    file.u32_le(record.at + HEAD + 4)?,
                ];
                let name = until_zero(&content[content.len().saturating_sub(NAME)..]);
                let name = if name.is_empty() {
                    format!("image {}", document.images.len())
                } else {
                    name
                };
                document
                    .images
                    .push(Image::new(name, "", shape, None, Vec::new()));
            }
            _ => {
                if let Some(image) = document.images.last_mut()
                    && content.len() == image.shape[0].saturating_mul(4)
                {
                    budget.numbers(image.shape[0])?;
                    image.values.extend(FLOAT.all(content));
                }
            }
        }
    }
    let (whole, cut): (Vec<Image>, Vec<Image>) = document.images.into_iter().partition(|image| {
        let points = image.shape[0].saturating_mul(image.shape[1]);
        image.values.len() == points && points > 0
    });
    // The first line in the file is the lowest.
    document.images = whole.into_iter().map(Image::flipped).collect();
    let names = cut
        .iter()
        .map(|image| format!("the image `{}` is incomplete and left out", image.name));
    document.notes.extend(names);
    at_most(volume.curves.len(), MAX_CURVES, "curves in a file")?;
    if volume.curves.is_empty() && document.images.is_empty() {
        return Err(Format::Ardf.unsupported(
            "an Asylum .ardf without whole curves or images",
            "only those are read",
        ));
    }
    if let Some(mut grid) = volume.grid.take() {
        let number = |key: &str| volume.number(key);
        let both = |keys: [&str; 2]| keys.map(|key| number(key).unwrap_or(0.0));
        grid.size = both(["FastScanSize", "SlowScanSize"]);
        grid.centre = both(["XOffset", "YOffset"]);
        grid.angle = number("ScanAngle").unwrap_or(0.0).to_radians();
        volume.grid = Some(grid);
    }
    document.settings.clone_from(&volume.note);
    document.grid = volume.grid.filter(|_| !volume.curves.is_empty());
    document.curves = Box::new(Volume {
        file: bytes,
        ..volume
    });
    Ok(document)
}

/// Records of the known kinds with the right checksum, in the order of the file.
fn records(file: &[u8]) -> Result<Vec<Record>, Error> {
    let word = |at: usize| {
        let bytes = file.get(at..at + 4)?;
        Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    };
    let mut records = Vec::new();
    // Wrong records may overlap: their checksums together cost no more than a few passes.
    let mut left = file.len().saturating_mul(4);
    let mut at = 0;
    while at + HEAD <= file.len() {
        let letters = &file[at + 8..at + 12];
        let size = word(at + 4).unwrap_or(0) as usize;
        let whole = LETTERS
            .iter()
            .any(|of| of[..] == *letters)
            .then(|| file.get(at..at.checked_add(size)?))
            .flatten();
        let is_right = |record: &&[u8]| {
            record.len() > HEAD
                && record.len() <= left
                && Some(crc32fast::hash(&record[4..])) == word(at)
        };
        if let Some(record) = whole.filter(is_right) {
            at_most(records.len() + 1, MAX_ENTRIES, "records in a file")?;
            records.push(Record {
                letters: [letters[0], letters[1], letters[2], letters[3]],
                at,
                size: record.len(),
            });
            left -= record.len();
            at += record.len();
        } else {
            left = left.saturating_sub(whole.map_or(0, <[u8]>::len));
            at += 1;
        }
    }
    Ok(records)
}

/// Styles by names between semicolons, such as `Ext;Ret;`.
fn segment_names(content: &[u8]) -> Vec<Style> {
    let mut texts = content.split(|of| *of == 0);
    let Some(names) = texts.rfind(|of| of.contains(&b';')) else {
        return Vec::new();
    };
    let names = names.split(|of| *of == b';').filter(|of| !of.is_empty());
    let style = |name: &[u8]| match name {
        [b'E' | b'e', ..] => Style::Approach,
        [b'R' | b'r', ..] => Style::Retract,
        _ => Style::Pause,
    };
    names.map(style).collect()
}

impl Volume {
    /// Adds the numbers of a channel to their curve.
    fn add(&mut self, file: &Bytes, record: &Record) -> Result<(), Error> {
        let content = record.size - HEAD;
        if content < 4 * NUMBERS {
            return Ok(());
        }
        let mut numbers = [0; NUMBERS];
        for (k, number) in numbers.iter_mut().enumerate() {
            *number = file.u32_le(record.at + HEAD + 4 * k)?;
        }
        // The count is of numbers or of bytes: the size of the record decides.
        let is_rest = |bytes: &usize| {
            content
                .checked_sub(*bytes)
                .is_some_and(|of| (4 * NUMBERS..=4 * NUMBERS + MAX_PADDING).contains(&of))
        };
        let sizes = [numbers[3].saturating_mul(4), numbers[3]];
        let Some(bytes) = sizes.into_iter().find(is_rest) else {
            return Ok(());
        };
        let data = Data {
            numbers,
            first: record.at + record.size - bytes,
            count: bytes / 4,
        };
        let is_same = |of: &&mut Vec<Data>| {
            of.first()
                .is_some_and(|first| first.numbers[..3] == numbers[..3])
        };
        match self.curves.last_mut().filter(is_same) {
            Some(curve) => curve.push(data),
            None => self.curves.push(vec![data]),
        }
        Ok(())
    }

    fn number(&self, key: &str) -> Option<f64> {
        let found = self.note.iter().find(|(name, _)| name == key);
        found.and_then(|(_, value)| crate::text::number(value))
    }
}

impl CurveSource for Volume {
    fn count(&self) -> usize {
        self.curves.len()
    }

    fn curve(&self, number: usize, limits: Limits) -> Result<Curve, Error> {
        let parts = &self.curves[number];
        let mut curve = Curve::empty(number);
        let above_zero = |key: &str| self.number(key).filter(|of| *of > 0.0);
        curve.spring_constant = above_zero("SpringConstant");
        curve.sensitivity = above_zero("InvOLS");
        at_most(parts.len(), MAX_CHANNELS, "channels in a curve")?;
        let Some(first) = parts.first() else {
            return Ok(curve);
        };
        curve.pixel = self.pixel(number, limits);
        let grid = self.grid.filter(|of| of.size != [0.0; 2]);
        curve.position = grid.and_then(|of| of.position(curve.pixel?));
        let mut cuts: Vec<usize> = first.numbers[5..]
            .iter()
            .copied()
            .filter(|of| (1..first.count).contains(of))
            .collect();
        cuts.dedup();
        cuts.push(first.count);
        let is_ordered = cuts.windows(2).all(|two| two[0] < two[1]);
        let styles = if is_ordered && cuts.len() == self.segments.len() {
            self.segments.clone()
        } else {
            cuts = vec![first.count];
            vec![Style::Unsplit]
        };
        let mut from = 0;
        let budget = &mut Budget::new(limits);
        for (style, end) in styles.into_iter().zip(cuts) {
            let mut channels = Vec::new();
            for data in parts.iter().filter(|of| of.count == first.count) {
                budget.numbers(end - from)?;
                let raw = self
                    .file
                    .get(data.first + 4 * from..data.first + 4 * end)
                    .unwrap_or_default();
                let known = self.channels.get(data.numbers[4]);
                let (name, unit) = known.map_or_else(
                    || (format!("channel {}", data.numbers[4]), ""),
                    |(name, unit)| (name.clone(), unit.as_str()),
                );
                channels.push(Channel::new(name, unit, FLOAT.all(raw).collect()));
            }
            curve.segments.push(Segment {
                style,
                label: String::new(),
                duration: None,
                channels,
            });
            from = end;
        }
        finish(&mut curve, &igor::NAMES);
        Ok(curve)
    }

    fn pixel(&self, number: usize, _: Limits) -> Option<usize> {
        let [_, line, point, ..] = self.curves[number].first()?.numbers;
        self.grid?.pixel([point, line])
    }
}
