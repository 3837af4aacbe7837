//! Texts of instruments: their encodings, numbers and units.

use std::borrow::Cow;

/// A text in Latin-1.
pub(crate) fn latin1(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| char::from(*byte)).collect()
}

/// Characters of Windows-1252 at 0x80–0x9F; five places are not in use.
const WINDOWS: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8d}Ž\u{8f}\u{90}‘’“”•–—˜™š›œ\u{9d}žŸ";

/// A text in UTF-8 or, where it is not, in Windows-1252. Instruments mix both in one file, so use it
/// line by line.
pub(crate) fn utf8_or_windows(bytes: &[u8]) -> String {
    if let Ok(text) = std::str::from_utf8(bytes) {
        return text.to_owned();
    }
    let of_byte = |byte: &u8| match byte {
        0x80..=0x9F => WINDOWS.chars().nth(usize::from(byte - 0x80)),
        _ => Some(char::from(*byte)),
    };
    bytes.iter().filter_map(of_byte).collect()
}

/// A text in UTF-8 with or without a byte order mark, in UTF-16 with one, or in Windows-1252.
pub(crate) fn any(bytes: &[u8]) -> Cow<'_, str> {
    let utf16 = |of: &[u8], decode: fn([u8; 2]) -> u16| {
        let units = of.chunks_exact(2).map(|two| decode([two[0], two[1]]));
        char::decode_utf16(units)
            .map(|of| of.unwrap_or(char::REPLACEMENT_CHARACTER))
            .collect()
    };
    let bytes = match bytes {
        [0xFF, 0xFE, rest @ ..] => return utf16(rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => return utf16(rest, u16::from_be_bytes),
        [0xEF, 0xBB, 0xBF, rest @ ..] => rest,
        _ => bytes,
    };
    let text = std::str::from_utf8(bytes);
    text.map_or_else(|_| Cow::Owned(utf8_or_windows(bytes)), Cow::Borrowed)
}

/// A text up to its first zero, in Latin-1.
pub(crate) fn until_zero(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0);
    latin1(&bytes[..end.unwrap_or(bytes.len())])
}

/// The finite number that a text is.
pub(crate) fn number(text: &str) -> Option<f64> {
    let number: f64 = text.trim().parse().ok()?;
    number.is_finite().then_some(number)
}

/// The finite number that a text is, with a decimal point or comma.
pub(crate) fn number_with_comma(text: &str) -> Option<f64> {
    number(text).or_else(|| number(&text.replace(',', ".")))
}

/// The finite number at the beginning of a text, and what follows it.
pub(crate) fn leading_number(text: &str) -> Option<(f64, &str)> {
    let text = text.trim_start();
    let is_of_number = |of: char| of.is_ascii_digit() || "+-.eE".contains(of);
    let end = text.find(|of| !is_of_number(of)).unwrap_or(text.len());
    // The exponent's letter may be the unit's, as in `1 eV` without the blank.
    let digits = text[..end].trim_end_matches(|of| "+-.eE".contains(of));
    [&text[..end], digits]
        .into_iter()
        .find_map(|of| Some((number(of)?, text[of.len()..].trim())))
}

/// Factor to the SI unit, and that unit. An unknown unit stays as it is.
pub(crate) fn si(unit: &str) -> (f64, &str) {
    match unit {
        "m" => (1.0, "m"),
        "mm" => (1e-3, "m"),
        "um" | "~m" | "µm" | "μm" => (1e-6, "m"),
        "nm" => (1e-9, "m"),
        "Å" => (1e-10, "m"),
        "pm" => (1e-12, "m"),
        "mN" => (1e-3, "N"),
        "uN" | "µN" | "μN" => (1e-6, "N"),
        "nN" => (1e-9, "N"),
        "pN" => (1e-12, "N"),
        "kV" => (1e3, "V"),
        "mV" => (1e-3, "V"),
        "uV" | "µV" | "μV" => (1e-6, "V"),
        "mA" => (1e-3, "A"),
        "uA" | "µA" => (1e-6, "A"),
        "nA" => (1e-9, "A"),
        "pA" => (1e-12, "A"),
        "ms" => (1e-3, "s"),
        "us" | "µs" => (1e-6, "s"),
        "MHz" => (1e6, "Hz"),
        "kHz" => (1e3, "Hz"),
        "kPa" => (1e3, "Pa"),
        "MPa" => (1e6, "Pa"),
        "GPa" => (1e9, "Pa"),
        "mN/m" => (1e-3, "N/m"),
        "nN/nm" => (1.0, "N/m"),
        "nm/V" => (1e-9, "m/V"),
        "°" | "Deg" | "deg" => (1.0, "deg"),
        other => (1.0, other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_every_encoding_are_read() {
        assert_eq!(any(b"\xEF\xBB\xBFa"), "a");
        assert_eq!(any(b"\xFF\xFE\xB5\x00m\x00"), "µm");
        assert_eq!(any(b"\xFE\xFF\x00\xB5\x00m"), "µm");
        assert_eq!(any(b"\xB5m \x80"), "µm €");
        assert_eq!(any("40 °C".as_bytes()), "40 °C");
        assert_eq!(until_zero(b"\xB5m\0rest"), "µm");
    }

    #[test]
    fn a_number_with_its_unit_is_split() {
        assert_eq!(leading_number("-1523.3 nm"), Some((-1523.3, "nm")));
        assert_eq!(leading_number("1e-3eV"), Some((1e-3, "eV")));
        assert_eq!(leading_number("nm"), None);
        assert_eq!(leading_number("1e999 nm"), None);
    }
}
