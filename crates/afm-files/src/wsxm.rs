//! Images of WSxM (`.stp`, `.top`): a text header of the length that it states, then numbers.

use crate::bytes::{Bytes, Encoding, Number};
use crate::document::{Document, Image};
use crate::limits::{Budget, MAX_HEADER, at_most};
use crate::text::{leading_number, si, utf8_or_windows};
use crate::{Error, Format, Limits};

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let file = Bytes::new(bytes, Format::Wsxm);
    let first = utf8_or_windows(&bytes[..bytes.len().min(300)]);
    let length = first
        .lines()
        .find_map(|line| line.strip_prefix("Image header size:")?.trim().parse().ok());
    let length: usize = length.ok_or_else(|| {
        Format::Wsxm.at_key("Image header size", "missing", "the length of the header")
    })?;
    at_most(length, MAX_HEADER, "bytes in a header")?;
    let header = file.slice(0, length)?;
    let mut document = Document::new(Format::Wsxm, limits);
    for line in header.split(|of| *of == b'\n').map(utf8_or_windows) {
        document.keep_setting(&line, ":");
    }
    let text = |key: &str| document.setting(key);
    let side = |key: &str| Format::Wsxm.side(key, text(key));
    let shape = [side("Number of columns")?, side("Number of rows")?];
    let kind = text("Image Data Type").unwrap_or("short");
    let number = match kind {
        "short" => Number::Signed(2),
        "int" => Number::Signed(4),
        "float" => Number::Float(4),
        "double" => Number::Float(8),
        other => {
            let expected = "short, int, float or double";
            return Err(Format::Wsxm.at_key(
                "Image Data Type",
                format!("the type `{other}`"),
                expected,
            ));
        }
    };
    let points = shape[0].saturating_mul(shape[1]);
    Budget::new(limits).numbers(points)?;
    let raw = file.slice(length, points.saturating_mul(number.size()))?;
    // Lines run from the bottom, points from the right.
    let mut values: Vec<f64> = Encoding::little(number).all(raw).rev().collect();
    let amplitude = text("Z Amplitude").and_then(leading_number);
    let unit = amplitude.map_or("", |(_, unit)| unit).to_owned();
    // Integers span the amplitude from their minimum to their maximum.
    if let (Number::Signed(_), Some((amplitude, _))) = (number, amplitude) {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if high > low {
            let factor = amplitude / (high - low);
            for of in &mut values {
                *of = (*of - low) * factor;
            }
        }
    }
    let length = |key: &str| {
        let (value, unit) = text(key).and_then(leading_number)?;
        let (factor, si_unit) = si(unit);
        (si_unit == "m").then_some(value * factor)
    };
    let size = length("X Amplitude")
        .zip(length("Y Amplitude"))
        .map(|(x, y)| [x, y]);
    let name = text("Acquisition channel").unwrap_or("").to_owned();
    document
        .images
        .push(Image::new(name, &unit, shape, size, values));
    Ok(document)
}
