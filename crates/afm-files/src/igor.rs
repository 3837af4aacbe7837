//! Igor binary waves of version 5, in which Asylum Research writes curves, images and spectra (WaveMetrics,
//! Technical Note 003): a header, numbers, a note of settings, the names of the channels.

use crate::bytes::{Bytes, Encoding, Number};
use crate::distance::{Names, finish};
use crate::document::{Channel, Curve, Document, Image, Segment, Spectrum, Style};
use crate::limits::{Budget, MAX_CHANNELS, MAX_HEADER, MAX_SEGMENTS, at_most};
use crate::text::{number, until_zero, utf8_or_windows};
use crate::{Error, Format, Limits};

/// Size of the header without the data.
const HEADER: usize = 384;
/// Length of the name of a channel.
const LABEL: usize = 32;

pub(crate) const NAMES: Names = Names {
    measured: &["ZSnsr", "ZSensor", "LVDT"],
    commanded: &["Raw", "Height"],
    ramp: &[],
    deflection: &["Defl", "Deflection", "DeflV"],
    grows_toward_surface: true,
};

/// Version and byte order (big-endian or not), if this is an Igor wave: the 16-bit words of its header
/// add up to zero.
pub(crate) fn version(bytes: &[u8]) -> Option<(u8, bool)> {
    let (version, big_endian) = match *bytes.get(..2)? {
        [0, version] => (version, true),
        [version, 0] => (version, false),
        _ => return None,
    };
    let length = match version {
        1 => 134,
        2 => 142,
        3 => 146,
        5 => HEADER,
        _ => return None,
    };
    let words = bytes.get(..length)?.chunks_exact(2).map(|two| {
        let two = [two[0], two[1]];
        if big_endian {
            u16::from_be_bytes(two)
        } else {
            u16::from_le_bytes(two)
        }
    });
    let sum = words.fold(0_u16, u16::wrapping_add);
    (sum == 0).then_some((version, big_endian))
}

/// Whether this is an Igor experiment: its first two records have known types and fit each other.
pub(crate) fn is_experiment(head: &[u8]) -> bool {
    let big_endian = head.first() == Some(&0);
    let bytes = Bytes::new(head, Format::IgorExperiment);
    // Type, version, size. Newer types are numbered on; the first record is never an unused one.
    let size = |at: usize| -> Option<usize> {
        let number = |from: usize, size: usize| bytes.whole(at + from, size, big_endian).ok();
        let (kind, version) = (number(0, 2)?, number(2, 2)?);
        let is_known = (1..=30).contains(&(kind & 0x7FFF)) && version <= 8;
        is_known.then_some(number(4, 4)? as usize)
    };
    let second = size(0).filter(|of| (1..head.len()).contains(of));
    second.and_then(|of| size(8 + of)).is_some_and(|of| of > 0)
}

/// A wave: numbers in up to four dimensions, column by column.
struct Wave {
    shape: Vec<usize>,
    /// Step of each dimension.
    steps: [f64; 4],
    /// Beginning and unit of the first dimension.
    first: (f64, String),
    name: String,
    /// Unit of the numbers.
    unit: String,
    values: Vec<f64>,
    note: Vec<(String, String)>,
    /// Names of the entries of each dimension.
    labels: [Vec<String>; 4],
}

impl Wave {
    fn text(&self, key: &str) -> Option<&str> {
        let found = self.note.iter().find(|(name, _)| name == key);
        found.map(|(_, value)| value.as_str())
    }

    fn number(&self, key: &str) -> Option<f64> {
        self.text(key).and_then(number)
    }
}

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let budget = &mut Budget::new(limits);
    let wave = wave(bytes, budget)?;
    let mut document = Document::new(Format::Igor, limits);
    let channels = |dimension: usize| {
        let named = &wave.labels[dimension];
        wave.shape.get(dimension) == Some(&named.len()) && !named.is_empty()
    };
    match wave.shape.len() {
        2 if channels(1) => {
            at_most(wave.shape[1], MAX_CHANNELS, "channels")?;
            document.curves = Box::new(vec![curve(&wave)?]);
        }
        3 if channels(2) => {
            at_most(wave.shape[2], MAX_CHANNELS, "images in a file")?;
            document.images = images(&wave);
        }
        1 if wave.first.1 == "Hz" => document.spectra.push(spectrum(&wave)),
        _ => {
            let content = format!("an Igor wave of {} numbers", wave.values.len());
            let reason = "only the curves and images of Asylum Research are read, whose channels have names, \
                and spectra over Hz";
            return Err(Format::Igor.unsupported(content, reason));
        }
    }
    document.settings = wave.note;
    Ok(document)
}

fn wave(bytes: &[u8], budget: &mut Budget) -> Result<Wave, Error> {
    let Some((5, big_endian)) = version(bytes) else {
        let version = version(bytes).map_or(0, |(of, _)| of);
        let content = format!("an Igor wave of version {version}");
        return Err(Format::Igor.unsupported(
            content,
            "only version 5, which Asylum Research writes, is read",
        ));
    };
    let bytes = Bytes::new(bytes, Format::Igor);
    let whole =
        |at: usize, size: usize| Ok::<usize, Error>(bytes.whole(at, size, big_endian)? as usize);
    let kind = whole(80, 2)?;
    let encoding = Encoding {
        big_endian,
        number: match kind {
            2 => Number::Float(4),
            4 => Number::Float(8),
            8 => Number::Signed(1),
            0x10 => Number::Signed(2),
            0x20 => Number::Signed(4),
            0x48 => Number::Unsigned(1),
            0x50 => Number::Unsigned(2),
            0x60 => Number::Unsigned(4),
            0 => {
                return Err(
                    Format::Igor.unsupported("an Igor wave of texts", "only numbers are read")
                );
            }
            _ => {
                let problem = format!("numbers of type {kind}");
                return Err(Format::Igor.at_byte(80, problem, "real numbers"));
            }
        },
    };
    let mut shape = Vec::new();
    for k in 0..4 {
        shape.push(whole(132 + 4 * k, 4)?);
    }
    shape.truncate(shape.iter().position(|of| *of == 0).unwrap_or(4));
    let points = shape.iter().try_fold(1_usize, |a, b| a.checked_mul(*b));
    let points = points
        .filter(|of| shape.is_empty() || *of == whole(76, 4).unwrap_or(0))
        .ok_or_else(|| Format::Igor.at_byte(132, "other lengths than points", "their product"))?;
    let points = if shape.is_empty() {
        whole(76, 4)?
    } else {
        points
    };
    budget.numbers(points)?;
    let size = points.saturating_mul(encoding.size());
    let values = encoding.all(bytes.slice(HEADER, size)?).collect();
    let mut steps = [0.0; 4];
    for (k, step) in steps.iter_mut().enumerate() {
        *step = bytes.f64(148 + 8 * k, big_endian)?;
    }
    // After the numbers: formula, note, units of the data, units and names of each dimension.
    let (formula, note_length, data_units) = (whole(8, 4)?, whole(12, 4)?, whole(16, 4)?);
    at_most(note_length, MAX_HEADER, "bytes in a note")?;
    let mut at = HEADER.saturating_add(size).saturating_add(formula);
    let note = note(bytes.slice(at, note_length)?);
    at = at.saturating_add(note_length);
    // A unit of up to four letters is in the header, a longer one here.
    let unit = |short: usize, at: usize, length: usize| -> Result<String, Error> {
        at_most(length, MAX_HEADER, "bytes in a unit")?;
        let long = until_zero(bytes.slice(at, length)?);
        let short = until_zero(bytes.slice(short, 4)?);
        Ok(if long.is_empty() { short } else { long })
    };
    let unit_of_data = unit(212, at, data_units)?;
    at = at.saturating_add(data_units);
    let first = bytes.f64(180, big_endian)?;
    let first = (first, unit(216, at, whole(20, 4)?)?);
    for k in 0..4 {
        at = at.saturating_add(whole(20 + 4 * k, 4)?);
    }
    let mut labels = [const { Vec::new() }; 4];
    for (k, names) in labels.iter_mut().enumerate() {
        let length = whole(36 + 4 * k, 4)?;
        at_most(length, MAX_HEADER, "bytes in the names of channels")?;
        let raw = bytes.slice(at, length)?;
        // The first name is that of all together.
        *names = raw.chunks_exact(LABEL).skip(1).map(until_zero).collect();
        at += length;
    }
    Ok(Wave {
        shape,
        steps,
        first,
        name: until_zero(bytes.slice(92, LABEL)?),
        unit: unit_of_data,
        values,
        note,
        labels,
    })
}

/// Settings: lines `key: value` that end in a carriage return.
pub(crate) fn note(bytes: &[u8]) -> Vec<(String, String)> {
    let lines = bytes.split(|of| matches!(of, b'\r' | b'\n'));
    let pairs = lines.filter_map(|line| {
        let line = utf8_or_windows(line);
        let (key, value) = line.split_once(':')?;
        Some((key.trim().to_owned(), value.trim().to_owned()))
    });
    pairs.filter(|(key, _)| !key.is_empty()).collect()
}

/// The unit of a channel, by the beginning of its name.
fn unit(name: &str) -> &'static str {
    let lower = name.to_lowercase();
    let is_any = |beginnings: &[&str]| beginnings.iter().any(|of| lower.starts_with(of));
    if lower.starts_with("deflv") {
        "V"
    } else if is_any(&["amp", "defl", "lvdt", "raw", "zsnsr", "height"]) {
        "m"
    } else if is_any(&["phas"]) {
        "deg"
    } else {
        ""
    }
}

fn curve(wave: &Wave) -> Result<Curve, Error> {
    let (points, names) = (wave.shape[0], &wave.labels[1]);
    let mut curve = Curve::empty(0);
    curve.spring_constant = wave.number("SpringConstant").filter(|of| *of > 0.0);
    curve.sensitivity = wave.number("InvOLS").filter(|of| *of > 0.0);
    let position = wave.number("XLVDT").zip(wave.number("YLVDT"));
    curve.position = position.map(|(x, y)| [x, y]);
    let segment = |style: Style, range: std::ops::Range<usize>| {
        let columns = names.iter().zip(wave.values.chunks_exact(points.max(1)));
        let channels = columns
            .map(|(name, values)| Channel::new(name, unit(name), values[range.clone()].to_vec()));
        Segment {
            style,
            label: String::new(),
            duration: (wave.steps[0] > 0.0).then(|| range.len() as f64 * wave.steps[0]),
            channels: channels.collect(),
        }
    };
    let list = |key: &str| -> Option<Vec<&str>> {
        Some(wave.text(key)?.split(',').map(str::trim).collect())
    };
    let ends: Option<Vec<usize>> = list("Indexes").and_then(|of| {
        let ends = of.into_iter().filter(|end| !end.is_empty());
        ends.map(|end| number(end).map(|end| end as usize))
            .collect()
    });
    // The last row of each segment, after the first row of all.
    let is_split = |ends: &Vec<usize>| {
        ends.len() > 1
            && ends[0] == 0
            && ends.windows(2).all(|two| two[0] < two[1])
            && ends.last().is_some_and(|end| *end < points)
    };
    let Some(ends) = ends.filter(is_split) else {
        curve.segments.push(segment(Style::Unsplit, 0..points));
        finish(&mut curve, &NAMES);
        return Ok(curve);
    };
    at_most(ends.len() - 1, MAX_SEGMENTS, "segments in a curve")?;
    let directions = list("Direction").unwrap_or_default();
    for (k, two) in ends.windows(2).enumerate() {
        let style = match directions.get(k + 1) {
            Some(&"1") => Style::Approach,
            Some(&"-1") => Style::Retract,
            _ => Style::Pause,
        };
        let first = if k == 0 { 0 } else { two[0] + 1 };
        curve.segments.push(segment(style, first..two[1] + 1));
    }
    finish(&mut curve, &NAMES);
    Ok(curve)
}

fn spectrum(wave: &Wave) -> Spectrum {
    let frequency = |k: usize| wave.first.0 + k as f64 * wave.steps[0];
    Spectrum {
        name: wave.name.clone(),
        unit: wave.unit.clone(),
        frequency: (0..wave.values.len()).map(frequency).collect(),
        values: wave.values.clone(),
    }
}

fn images(wave: &Wave) -> Vec<Image> {
    let [points, lines] = [wave.shape[0], wave.shape[1]];
    let size = [wave.steps[0] * points as f64, wave.steps[1] * lines as f64];
    let layers = wave.labels[2]
        .iter()
        .zip(wave.values.chunks_exact((points * lines).max(1)));
    layers
        .map(|(name, values)| {
            // The first line in the file is the lowest.
            Image::new(
                name,
                unit(name),
                [points, lines],
                Some(size),
                values.to_vec(),
            )
            .flipped()
        })
        .collect()
}
