//! Gwyddion Simple Field: a text header, padded with zeros, and 32-bit numbers.

use crate::bytes::{Bytes, Encoding, Number};
use crate::document::{Document, Image};
use crate::limits::{Budget, MAX_HEADER, at_most};
use crate::text::{number, utf8_or_windows};
use crate::{Error, Format, Limits};

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let end = bytes.iter().position(|of| *of == 0);
    let end = end.ok_or_else(|| {
        Format::Gsf.at_byte(
            bytes.len(),
            "the header does not end",
            "a zero after the header",
        )
    })?;
    at_most(end, MAX_HEADER, "bytes in a header")?;
    let mut document = Document::new(Format::Gsf, limits);
    for line in utf8_or_windows(&bytes[..end]).lines() {
        document.keep_setting(line, "=");
    }
    let text = |key: &str| {
        let found = document
            .settings
            .iter()
            .find(|(name, _)| name.eq_ignore_ascii_case(key));
        found.map(|(_, value)| value.as_str())
    };
    let side = |key: &str| Format::Gsf.side(key, text(key));
    let shape = [side("XRes")?, side("YRes")?];
    let points = shape[0].saturating_mul(shape[1]);
    Budget::new(limits).numbers(points)?;
    // One to four zeros, so that the numbers begin at a multiple of four.
    let raw = Bytes::new(bytes, Format::Gsf).slice(end / 4 * 4 + 4, points.saturating_mul(4))?;
    let real = |key: &str| text(key).and_then(number);
    let size = (text("XYUnits") == Some("m"))
        .then(|| real("XReal").zip(real("YReal")).map(|(x, y)| [x, y]))
        .flatten();
    let name = text("Title").unwrap_or("").to_owned();
    let unit = text("ZUnits").unwrap_or("").to_owned();
    let values = Encoding::little(Number::Float(4)).all(raw).collect();
    document
        .images
        .push(Image::new(name, &unit, shape, size, values));
    Ok(document)
}
