//! The files in a zip archive, stored or deflated (PKWARE, APPNOTE 6.3.10).

use super::{Number, slice};

/// Most bytes that the files of an archive may have together.
const MAX_BYTES: usize = 256 << 20;
/// Longest comment of an archive, and its last record.
const LONGEST_END: usize = 65_535 + 22;

/// An archive with the places of its files.
pub(super) struct Archive<'a> {
    bytes: &'a [u8],
    entries: Vec<(String, Place)>,
}

#[derive(Clone, Copy)]
struct Place {
    header: usize,
    packed: usize,
    size: usize,
    method: usize,
}

impl<'a> Archive<'a> {
    pub(super) fn open(bytes: &'a [u8]) -> Option<Self> {
        let first = bytes.len().saturating_sub(LONGEST_END);
        let mut ends = (first..bytes.len().saturating_sub(21)).rev();
        let end = ends.find(|at| slice(bytes, *at, 4) == Some(b"PK\x05\x06"))?;
        let count = whole(bytes, end + 10, 2)?;
        let mut at = whole(bytes, end + 16, 4)?;
        let mut entries = Vec::new();
        let mut total = 0_usize;
        for _ in 0..count {
            (slice(bytes, at, 4)? == b"PK\x01\x02").then_some(())?;
            let field = |offset: usize, size: usize| whole(bytes, at.checked_add(offset)?, size);
            let place = Place {
                method: field(10, 2)?,
                packed: field(20, 4)?,
                size: field(24, 4)?,
                header: field(42, 4)?,
            };
            total = total.checked_add(place.size)?;
            (total <= MAX_BYTES).then_some(())?;
            let lengths = [28, 30, 32].map(|offset| field(offset, 2));
            let [name, extra, comment] = lengths;
            let text = String::from_utf8_lossy(slice(bytes, at.checked_add(46)?, name?)?);
            entries.push((text.into_owned(), place));
            at = at.checked_add(46 + name? + extra? + comment?)?;
        }
        Some(Self { bytes, entries })
    }

    /// Names of all files in the archive.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|(name, _)| name.as_str())
    }

    /// The bytes of a file.
    pub(super) fn file(&self, name: &str) -> Option<Vec<u8>> {
        let (_, place) = self.entries.iter().find(|(known, _)| known == name)?;
        let at = place.header;
        (slice(self.bytes, at, 4)? == b"PK\x03\x04").then_some(())?;
        let [name, extra] = [26, 28].map(|offset| whole(self.bytes, at.checked_add(offset)?, 2));
        let data = at.checked_add(30 + name? + extra?)?;
        let packed = slice(self.bytes, data, place.packed)?;
        match place.method {
            0 => Some(packed.to_vec()),
            8 => {
                let file = miniz_oxide::inflate::decompress_to_vec_with_limit(packed, place.size);
                file.ok().filter(|file| file.len() == place.size)
            }
            _ => None,
        }
    }

    /// The text of a file.
    pub(super) fn text(&self, name: &str) -> Option<String> {
        Some(super::latin(&self.file(name)?))
    }
}

fn whole(bytes: &[u8], at: usize, size: usize) -> Option<usize> {
    let number = Number::Unsigned(size).all(slice(bytes, at, size)?, false);
    Some(*number.first()? as usize)
}
