//! The files in a zip archive, stored or deflated (PKWARE, APPNOTE 6.3.10).
//!
//! An archive is refused before anything is unpacked if two files have one name or share bytes, or if
//! a stored file has another length than it states.

use std::collections::BTreeMap;

use super::limits::{Budget, MAX_FILES, MAX_NAME, MAX_TEXT, MAX_UNPACKED};
use super::{Number, RecordingError, slice};

/// Longest comment of an archive, and its last record.
const LONGEST_END: usize = 65_535 + 22;
/// Methods of compression.
const STORED: usize = 0;
const DEFLATED: usize = 8;

/// An archive with its files.
pub(super) struct Archive<'a> {
    files: Vec<File<'a>>,
    /// Index of each file by its name.
    places: BTreeMap<String, usize>,
}

/// A file in an archive.
struct File<'a> {
    name: String,
    packed: &'a [u8],
    /// Length when unpacked, as stated.
    size: usize,
    method: usize,
}

impl<'a> Archive<'a> {
    pub(super) fn open(bytes: &'a [u8], budget: &mut Budget) -> Option<Self> {
        let first = bytes.len().saturating_sub(LONGEST_END);
        let mut ends = (first..bytes.len().saturating_sub(21)).rev();
        let end = ends.find(|at| slice(bytes, *at, 4) == Some(b"PK\x05\x06"))?;
        let count = whole(bytes, end + 10, 2)?;
        budget.at_most(count, MAX_FILES, "files in its archive")?;
        let mut at = whole(bytes, end + 16, 4)?;
        let mut archive = Self {
            files: Vec::with_capacity(count),
            places: BTreeMap::new(),
        };
        let mut total = 0_usize;
        let mut ranges = Vec::with_capacity(count);
        for index in 0..count {
            (slice(bytes, at, 4)? == b"PK\x01\x02").then_some(())?;
            let field = |offset: usize, size: usize| whole(bytes, at.checked_add(offset)?, size);
            let (method, length, size) = (field(10, 2)?, field(20, 4)?, field(24, 4)?);
            let [name, extra, comment] = [28, 30, 32].map(|offset| field(offset, 2));
            let written = slice(bytes, at.checked_add(46)?, name?)?;
            budget.at_most(written.len(), MAX_NAME, "bytes in a file's name")?;
            let header = field(42, 4)?;
            let data = data_of(bytes, header, written)?;
            let packed = slice(bytes, data, length)?;
            let name = String::from_utf8_lossy(written).into_owned();
            if method == STORED && packed.len() != size {
                return budget.refuse(RecordingError::Unequal(name));
            }
            total = total.checked_add(size)?;
            budget.at_most(total, MAX_UNPACKED, "bytes in the files of its archive")?;
            if archive.places.insert(name.clone(), index).is_some() {
                return budget.refuse(RecordingError::Repeated(name));
            }
            ranges.push(header..data + length);
            archive.files.push(File {
                name,
                packed,
                size,
                method,
            });
            at = at.checked_add(46 + written.len() + extra? + comment?)?;
        }
        ranges.sort_by_key(|range| range.start);
        if ranges.windows(2).any(|two| two[1].start < two[0].end) {
            return budget.refuse(RecordingError::Overlapping);
        }
        Some(archive)
    }

    /// Names of all files in the archive, in its order.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|file| file.name.as_str())
    }

    fn find(&self, name: &str) -> Option<&File<'a>> {
        self.files.get(*self.places.get(name)?)
    }

    /// Length of a file when unpacked.
    pub(super) fn size(&self, name: &str) -> Option<usize> {
        Some(self.find(name)?.size)
    }

    /// The bytes of a file, as many as it states.
    pub(super) fn file(&self, name: &str) -> Option<Vec<u8>> {
        let file = self.find(name)?;
        match file.method {
            STORED => Some(file.packed.to_vec()),
            DEFLATED => {
                let limit = file.size;
                let unpacked =
                    miniz_oxide::inflate::decompress_to_vec_with_limit(file.packed, limit);
                unpacked.ok().filter(|bytes| bytes.len() == file.size)
            }
            _ => None,
        }
    }

    /// The text of a file; `None` too if there is no such file.
    pub(super) fn text(&self, name: &str, budget: &mut Budget) -> Option<String> {
        budget.at_most(self.size(name)?, MAX_TEXT, "bytes in a header")?;
        Some(super::latin(&self.file(name)?))
    }
}

/// Where the bytes of a file begin: after its local header, which names the same file.
fn data_of(bytes: &[u8], header: usize, name: &[u8]) -> Option<usize> {
    (slice(bytes, header, 4)? == b"PK\x03\x04").then_some(())?;
    let length = |offset: usize| whole(bytes, header.checked_add(offset)?, 2);
    let (named, extra) = (length(26)?, length(28)?);
    (slice(bytes, header.checked_add(30)?, named)? == name).then_some(())?;
    header.checked_add(30 + named + extra)
}

fn whole(bytes: &[u8], at: usize, size: usize) -> Option<usize> {
    let number = Number::Unsigned(size).all(slice(bytes, at, size)?, false);
    Some(*number.first()? as usize)
}
